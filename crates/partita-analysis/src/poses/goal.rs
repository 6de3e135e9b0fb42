//! Goals of a position: a coordinate of any joint, or the position of a point of a body.

use partita_math::spatial::Vec3;
use partita_model::joint::Motion;
use partita_model::model::ModelScratch;
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
}

/// How a goal is evaluated.
#[derive(Clone, Debug)]
enum Source {
    Own { q: usize, v: usize },
    Joint { joint: usize, position: usize, velocity: usize, wraps: bool },
    Point { body: usize, point: Vec3<f64>, axis: usize },
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
        i = model.placed.links[i].parent;
    }
    found
}

fn velocities(model: &Model, links: impl Iterator<Item = usize>) -> Vec<usize> {
    let of = |i: usize| {
        let l = &model.placed.links[i];
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
                let v = model.velocity_of_coordinate(q).ok_or_else(refuse)?;
                let displacement = model.characteristic_displacement(v);
                let turn = model.placed.links.iter().any(|l| l.v == v && matches!(l.motion, Motion::Turn(_)));
                Ok(named(Source::Own { q, v }, displacement, unit(turn), vec![v], Part::default()))
            }
            Goal::Joint { joint, coordinate } => {
                let p = &model.placed.joints[joint];
                let (mut position, mut velocity) = (0, 0);
                for (i, motion) in p.shape.motions.iter().enumerate() {
                    if position + motion.coordinates() > coordinate {
                        if *motion == Motion::Ball {
                            break;
                        }
                        if let Some(&link) = p.links.as_ref().and_then(|links| links.get(i)) {
                            let l = &model.placed.links[link];
                            return Self::new(model, &Goal::Own { q: l.q }, name);
                        }
                        let turn = matches!(motion, Motion::Turn(_));
                        let wraps = turn && !model.is_planar();
                        let sides = [p.parent, p.child].map(|n| ancestors(model, model.placed.link_of(n)));
                        // joints that carry both sides do not change it
                        let between = velocities(model, sides[0].symmetric_difference(&sides[1]).copied());
                        let source = Source::Joint { joint, position, velocity, wraps };
                        let displacement = if turn { 1.0 } else { model.placed.length };
                        return Ok(named(source, displacement, unit(turn), between, model.part_of_joint(joint)));
                    }
                    position += motion.coordinates();
                    velocity += motion.velocities();
                }
                Err(refuse())
            }
            Goal::Point { body, point, axis } => {
                let links = ancestors(model, model.placed.bodies[body].link);
                let source = Source::Point { body, point: Vec3(point), axis };
                let own = velocities(model, links.into_iter());
                Ok(named(source, model.placed.length, "m", own, model.part_of_body(body)))
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

    /// Its value at q; an angle measured from a pose is taken within half a turn of `near`.
    pub fn value(&self, model: &Model, q: &[f64], rest: &[f64], s: &mut ModelScratch, near: f64) -> f64 {
        match &self.source {
            Source::Own { q: i, .. } => q[*i],
            Source::Joint { joint, position, wraps, .. } => {
                model.look_at(&self.part, q, rest, s);
                let x = model.joint_state(*joint, q, rest, s).position[*position];
                if *wraps {
                    x + ((near - x) / TAU).round() * TAU
                } else {
                    x
                }
            }
            Source::Point { body, point, axis } => {
                model.look_at(&self.part, q, rest, s);
                let b = model.body_state(*body, s);
                (b.position + b.rotation.apply(*point)).0[*axis]
            }
        }
    }

    /// Its derivatives by `velocities`, in their order. `v` is scratch memory, zero before and after.
    pub fn gradient(&self, model: &Model, q: &[f64], v: &mut [f64], s: &mut ModelScratch, mut put: impl FnMut(f64)) {
        if let Source::Own { .. } = self.source {
            return put(1.0);
        }
        for &i in &self.velocities {
            v[i] = 1.0;
            model.look_at(&self.part, q, v, s);
            v[i] = 0.0;
            put(match &self.source {
                Source::Own { .. } => 1.0,
                Source::Joint { joint, velocity, .. } => {
                    v[i] = 1.0;
                    let rate = model.joint_state(*joint, q, v, s).velocity[*velocity];
                    v[i] = 0.0;
                    rate
                }
                Source::Point { body, point, axis } => {
                    let b = model.body_state(*body, s);
                    (b.velocity + b.angular_velocity.cross(b.rotation.apply(*point))).0[*axis]
                }
            });
        }
    }
}
