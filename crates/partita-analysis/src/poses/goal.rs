//! Goals of a position: a coordinate of any joint, the position of a point of a body, or the orientation of a body.

use partita_math::spatial::{Mat3, Quaternion, Vec3};
use partita_math::tolerance;
use partita_model::joint::Motion;
use partita_model::model::ModelScratch;
use partita_model::observe::DegreeOfFreedom;
use partita_model::{Model, Part};
use partita_system::prelude::*;
use partita_system::SystemError;
use std::collections::BTreeSet;
use std::f64::consts::TAU;

/// A scalar function of the position.
#[derive(Clone, Debug, PartialEq)]
pub enum Goal {
    /// A coordinate of the state.
    Own {
        /// Its number.
        q: usize,
    },
    /// A coordinate of a joint, in the state or not.
    Joint {
        /// Number of the joint.
        joint: usize,
        /// Number of the coordinate among those of the joint.
        coordinate: usize,
    },
    /// A world coordinate of a point fixed to a body.
    Point {
        /// Number of the body; none for the ground is needed, which rests.
        body: usize,
        /// The point in body axes.
        point: [f64; 3],
        /// x, y or z of the world.
        axis: usize,
    },
    /// A component of the rotation vector of a body relative to a reference orientation. The three components of one
    /// body follow each other among the goals: whole turns are counted on all of them together.
    Turn {
        /// Number of the body.
        body: usize,
        /// The reference: its columns are the axes of the body there, in the world; row by row.
        reference: [f64; 9],
        /// Along x, y or z of the reference.
        axis: usize,
    },
}

/// How a goal is evaluated.
#[derive(Clone, Debug)]
enum Source {
    Own { q: usize, v: usize },
    Joint { joint: usize, position: usize, velocity: usize, wraps: bool },
    Point { body: usize, point: Vec3<f64>, axis: usize },
    Turn { body: usize, reference: Mat3<f64>, axis: usize },
}

/// A goal with its name, its natural scale, and its dependences.
#[derive(Clone, Debug)]
pub struct Target {
    source: Source,
    /// Its definition.
    pub goal: Goal,
    /// Its name.
    pub name: String,
    /// A large change: 1 for an angle, a length for a displacement.
    pub displacement: f64,
    /// "rad" or "m".
    pub unit: &'static str,
    /// Velocities that may change it.
    pub velocities: Vec<usize>,
    part: Part,
}

/// Links between a link and the ground.
fn ancestors(model: &Model, link: usize) -> BTreeSet<usize> {
    let mut found = BTreeSet::new();
    let mut i = link;
    while i != 0 && found.insert(i) {
        i = model.zero_position().links[i].parent;
    }
    found
}

fn velocities(model: &Model, links: impl Iterator<Item = usize>) -> Vec<usize> {
    let of = |i: usize| {
        let l = &model.zero_position().links[i];
        l.v..l.v + l.motion.velocities()
    };
    let found: BTreeSet<usize> = links.flat_map(of).collect();
    found.into_iter().collect()
}

impl Target {
    /// The goal of a model, under this name.
    ///
    /// # Errors
    /// `Argument` where a spatial rotation has no such coordinate.
    pub fn new(model: &Model, goal: &Goal, name: &str) -> Result<Self, SystemError> {
        let refuse = || {
            let message = format!(
                "{name} is one component of a spatial rotation and cannot be a target by itself; use points of the \
                 body as targets"
            );
            SystemError::argument("targets", message)
        };
        let named = |source, displacement, unit, velocities, part| {
            let name = name.to_string();
            Self { source, goal: goal.clone(), name, displacement, unit, velocities, part }
        };
        let unit = |turn: bool| if turn { "rad" } else { "m" };
        match *goal {
            Goal::Own { q } => {
                let v = model.structure().coordinates[q].velocity.ok_or_else(refuse)?;
                let displacement = model.structure().displacement(v);
                let turn = model.zero_position().links.iter().any(|l| l.v == v && matches!(l.motion, Motion::Turn(_)));
                Ok(named(Source::Own { q, v }, displacement, unit(turn), vec![v], Part::default()))
            }
            Goal::Joint { joint, coordinate } => {
                let p = &model.zero_position().joints[joint];
                let (mut position, mut velocity) = (0, 0);
                for (i, motion) in p.shape.motions.iter().enumerate() {
                    if position + motion.coordinates() > coordinate {
                        if *motion == Motion::Ball {
                            break;
                        }
                        if let Some(&link) = p.links.as_ref().and_then(|links| links.get(i)) {
                            let l = &model.zero_position().links[link];
                            return Self::new(model, &Goal::Own { q: l.q }, name);
                        }
                        let turn = matches!(motion, Motion::Turn(_));
                        let wraps = turn && !model.is_planar();
                        let sides = [p.parent, p.child].map(|n| ancestors(model, model.zero_position().link_of(n)));
                        // joints that carry both sides do not change it
                        let between = velocities(model, sides[0].symmetric_difference(&sides[1]).copied());
                        let source = Source::Joint { joint, position, velocity, wraps };
                        let displacement = if turn { 1.0 } else { model.length() };
                        return Ok(named(
                            source,
                            displacement,
                            unit(turn),
                            between,
                            model.equations().part_of_joint(joint),
                        ));
                    }
                    position += motion.coordinates();
                    velocity += motion.velocities();
                }
                Err(refuse())
            }
            Goal::Point { body, point, axis } => {
                let links = ancestors(model, model.zero_position().bodies[body].link);
                let source = Source::Point { body, point: Vec3(point), axis };
                let own = velocities(model, links.into_iter());
                Ok(named(source, model.length(), "m", own, model.equations().part_of_body(body)))
            }
            Goal::Turn { body, reference, axis } => {
                let links = ancestors(model, model.zero_position().bodies[body].link);
                let reference = Mat3(std::array::from_fn(|i| std::array::from_fn(|j| reference[3 * i + j])));
                let own = velocities(model, links.into_iter());
                Ok(named(Source::Turn { body, reference, axis }, 1.0, "rad", own, model.equations().part_of_body(body)))
            }
        }
    }

    /// Coordinate and velocity of the state that it is, if it is one.
    pub fn own(&self) -> Option<(usize, usize)> {
        match self.source {
            Source::Own { q, v } => Some((q, v)),
            _ => None,
        }
    }

    /// Whether it is an angle measured from a pose, which is unchanged by whole turns.
    pub fn wraps(&self) -> bool {
        matches!(self.source, Source::Joint { wraps: true, .. })
    }

    /// Refuse a value that q cannot represent: an angle beyond half a turn whose whole turns are not counted.
    ///
    /// # Errors
    /// `Wound`.
    pub fn check_turns(&self, model: &Model, value: f64) -> Result<(), SystemError> {
        match self.source {
            Source::Joint { joint, velocity, wraps: true, .. } => model.check_turns_at(joint, velocity, value),
            _ => Ok(()),
        }
    }

    /// The values that are counted on from: its own, or all three of an orientation; `y` holds those of all goals, its own
    /// at `k`.
    pub fn near(&self, y: &[f64], k: usize) -> [f64; 3] {
        match self.source {
            Source::Turn { axis, .. } => std::array::from_fn(|i| y[k - axis + i]),
            _ => [y[k], 0.0, 0.0],
        }
    }

    /// Its value at q, an angle measured from a pose within half a turn of `near`; of an orientation within half a turn
    /// of the reference.
    pub fn value(&self, model: &Model, q: &[f64], rest: &[f64], s: &mut ModelScratch, near: f64) -> f64 {
        match self.source {
            Source::Turn { .. } => self.value_near(model, q, rest, s, [0.0; 3]),
            _ => self.value_near(model, q, rest, s, [near, 0.0, 0.0]),
        }
    }

    /// As `value`, of an orientation too the nearest to [`near`](Self::near).
    pub fn value_near(&self, model: &Model, q: &[f64], rest: &[f64], s: &mut ModelScratch, near: [f64; 3]) -> f64 {
        match &self.source {
            Source::Own { q: i, .. } => q[*i],
            Source::Joint { joint, position, wraps, .. } => {
                model.equations().look_at(&self.part, q, rest, s.equations());
                let x = model.joint_state(*joint, q, rest, s).position[*position];
                if *wraps {
                    x + ((near[0] - x) / TAU).round() * TAU
                } else {
                    x
                }
            }
            Source::Point { body, point, axis } => {
                model.equations().look_at(&self.part, q, rest, s.equations());
                let b = model.body_state(*body, s);
                (b.position + b.rotation.apply(*point)).0[*axis]
            }
            Source::Turn { body, reference, axis } => {
                model.equations().look_at(&self.part, q, rest, s.equations());
                rotation_vector(reference, &model.body_state(*body, s).rotation, near).0[*axis]
            }
        }
    }

    /// Its derivatives by `velocities`, in their order; of an orientation where its values are `near`. `v` is scratch
    /// memory, zero before and after.
    pub fn gradient(
        &self,
        model: &Model,
        q: &[f64],
        near: [f64; 3],
        v: &mut [f64],
        s: &mut ModelScratch,
        mut put: impl FnMut(f64),
    ) {
        match &self.source {
            Source::Turn { body, reference, axis } => {
                model.equations().look_at(&self.part, q, v, s.equations());
                let rotation = model.body_state(*body, s).rotation;
                let turn = rotation_vector(reference, &rotation, near);
                self.columns(model, q, v, s, |columns| put(turning(turn, rotation.apply_transposed(columns)).0[*axis]));
            }
            _ => self.rates(model, q, v, s, put),
        }
    }

    /// How its rate follows from `velocities`, in their order: as the gradient, but of an orientation that of the angular
    /// velocity along an axis of the world. `v` is scratch memory, zero before and after.
    pub fn rates(&self, model: &Model, q: &[f64], v: &mut [f64], s: &mut ModelScratch, mut put: impl FnMut(f64)) {
        match &self.source {
            Source::Own { .. } => put(1.0),
            Source::Joint { joint, velocity, .. } => {
                for &i in &self.velocities {
                    v[i] = 1.0;
                    model.equations().look_at(&self.part, q, v, s.equations());
                    put(model.joint_state(*joint, q, v, s).velocity[*velocity]);
                    v[i] = 0.0;
                }
            }
            Source::Point { axis, .. } | Source::Turn { axis, .. } => {
                self.columns(model, q, v, s, |column| put(column.0[*axis]));
            }
        }
    }

    /// Velocity of the point, or angular velocity of the body, for each of `velocities` alone at unit rate.
    fn columns(&self, model: &Model, q: &[f64], v: &mut [f64], s: &mut ModelScratch, mut put: impl FnMut(Vec3<f64>)) {
        for &i in &self.velocities {
            v[i] = 1.0;
            model.equations().look_at(&self.part, q, v, s.equations());
            v[i] = 0.0;
            match &self.source {
                Source::Point { body, point, .. } => {
                    let b = model.body_state(*body, s);
                    put(b.velocity + b.angular_velocity.cross(b.rotation.apply(*point)));
                }
                Source::Turn { body, .. } => put(model.body_state(*body, s).angular_velocity),
                _ => {}
            }
        }
    }

    /// What its acceleration is made of; only coordinates of joints outside of the state have such a thing.
    ///
    /// # Errors
    /// None for a model that could be compiled.
    pub fn degree_of_freedom(&self, model: &Model) -> Result<Option<DegreeOfFreedom>, SystemError> {
        let Source::Joint { joint, velocity, .. } = self.source else { return Ok(None) };
        let all = model.degrees_of_freedom_of(&[joint]).map_err(|e| SystemError::argument("targets", e.to_string()))?;
        Ok(all.into_iter().nth(velocity))
    }

    /// Its acceleration at (q, v) for v' = `vdot`, along an axis of the world for a point or an orientation; `dof` as
    /// [`degree_of_freedom`](Self::degree_of_freedom) gave it.
    pub fn acceleration(
        &self,
        model: &Model,
        (q, v, vdot): (&[f64], &[f64], &[f64]),
        s: &mut ModelScratch,
        dof: &mut Option<DegreeOfFreedom>,
    ) -> f64 {
        match &self.source {
            Source::Own { v: i, .. } => vdot[*i],
            Source::Joint { .. } => {
                model.equations().look_at(&self.part, q, v, s.equations());
                dof.as_mut().map_or(f64::NAN, |dof| dof.acceleration(model, vdot, s))
            }
            Source::Point { body, point, axis } => {
                model.equations().look_at(&self.part, q, v, s.equations());
                let [acceleration, alpha] = model.body_acceleration(*body, &self.part, vdot, s);
                let b = model.body_state(*body, s);
                let (arm, omega) = (b.rotation.apply(*point), b.angular_velocity);
                (acceleration + alpha.cross(arm) + omega.cross(omega.cross(arm))).0[*axis]
            }
            Source::Turn { body, axis, .. } => {
                model.equations().look_at(&self.part, q, v, s.equations());
                model.body_acceleration(*body, &self.part, vdot, s)[1].0[*axis]
            }
        }
    }
}

/// The rotation vector y of `rotation = reference exp(y)` nearest to `near`, less than a turn.
fn rotation_vector(reference: &Mat3<f64>, rotation: &Mat3<f64>, near: [f64; 3]) -> Vec3<f64> {
    let Quaternion([w, x, y, z]) = Quaternion::from_matrix(&reference.transpose().mul(rotation));
    let (half, sin) = (Vec3([x, y, z]), Vec3([x, y, z]).norm());
    if sin < tolerance::ROUNDING {
        return half.times(2.0 * w.signum());
    }
    // the two quaternions of a rotation belong to two rotation vectors
    let of = |sign: f64| half.times(sign * 2.0 * sin.atan2(sign * w) / sin);
    let [one, other] = [of(1.0), of(-1.0)];
    let distance = |a: Vec3<f64>| (a - Vec3(near)).norm();
    if distance(one) <= distance(other) {
        one
    } else {
        other
    }
}

/// The rate of a rotation vector y for an angular velocity along the axes of the body:
/// `ω + ½ y × ω + (1 − ½θ cot ½θ)/θ² y × (y × ω)`, θ = |y|.
fn turning(y: Vec3<f64>, omega: Vec3<f64>) -> Vec3<f64> {
    let (angle, square) = (y.norm(), y.dot(y));
    let third = if angle < tolerance::SERIES_ANGLE {
        1.0 / 12.0 + square * (1.0 / 720.0 + square * (1.0 / 30_240.0 + square / 1_209_600.0))
    } else {
        (1.0 - 0.5 * angle / (0.5 * angle).tan()) / square
    };
    let across = y.cross(omega);
    omega + across.times(0.5) + y.cross(across).times(third)
}
