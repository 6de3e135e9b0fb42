//! Applied forces other than gravity and springs between points.

use crate::compile::{point_on, reference_points};
use crate::error::DescriptionError;
use crate::joint::Motion;
use crate::place::{Placed, PlacedJoint};
use crate::spec::{Axes, Force, Spec, Value, VectorValue};
use crate::tree::{Tree, TreeScratch};
use crate::validate;
use crate::value::{self, Functions};
use partita_math::scalar::Scalar;
use partita_math::spatial::{Mat3, Space, Vec3};
use partita_system::SystemError;

/// One applied force.
#[derive(Clone, Debug)]
pub enum Load {
    /// Spring and damper in a tree coordinate.
    Torsion {
        /// Coordinate and velocity.
        q: usize,
        /// Velocity.
        v: usize,
        /// Stiffness.
        stiffness: f64,
        /// Damping.
        damping: f64,
        /// Free position.
        angle: f64,
    },
    /// Effort along a tree velocity.
    Effort {
        /// Name, for messages.
        name: String,
        /// Coordinate, if one integrates the velocity.
        q: Option<usize>,
        /// Velocity.
        v: usize,
        /// Effort.
        value: Value,
    },
    /// Effort along a coordinate that no tree velocity stands for: a pair of wrenches.
    CutEffort {
        /// Name, for messages.
        name: String,
        /// Node and link of the parent.
        parent: (usize, usize),
        /// Node and link of the child.
        child: (usize, usize),
        /// Wrench on the child for a unit effort.
        push: Push,
        /// The joint's point on the child, from the link's reference point.
        at: Vec3<f64>,
        /// Effort.
        value: Value,
    },
    /// Force at a point.
    Force {
        /// Name, for messages.
        name: String,
        /// Node of the body.
        node: usize,
        /// Its link.
        link: usize,
        /// Point from the link's reference point, link axes.
        at: Vec3<f64>,
        /// Force.
        value: VectorValue,
        /// Body axes in the link, if the force turns with the body.
        body_axes: Option<Mat3<f64>>,
    },
}

/// Wrench of a unit effort, about the joint's point on the child.
#[derive(Clone, Copy, Debug)]
pub enum Push {
    /// Moment: a part fixed in the parent's link axes and one in the child's.
    Moment(Vec3<f64>, Vec3<f64>),
    /// Force along an axis of the parent's link.
    Force(Vec3<f64>),
}

impl Load {
    /// The coordinate whose whole turns this load counts: a torsion spring winds up, a constant torque does work.
    pub fn counted(&self) -> Option<usize> {
        match self {
            Self::Torsion { q, .. } => Some(*q),
            Self::Effort { q, .. } => *q,
            Self::CutEffort { .. } | Self::Force { .. } => None,
        }
    }

    /// Does a function of the user's see all coordinates, turns included?
    pub fn sees_coordinates(&self) -> bool {
        let function = |v: &Value| matches!(v, Value::Function(_));
        match self {
            Self::Torsion { .. } => false,
            Self::Effort { value, .. } | Self::CutEffort { value, .. } => function(value),
            Self::Force { value: VectorValue::Whole(v), .. } => function(v),
            Self::Force { value: VectorValue::Components(v), .. } => v.iter().any(function),
        }
    }
}

impl Push {
    /// For a motion of a joint, of which the coordinate is number `which`.
    fn new(p: &PlacedJoint, motion: Motion, which: usize) -> Self {
        let turns: Vec<Vec3<f64>> =
            p.shape.motions.iter().filter_map(|m| if let Motion::Turn(a) = m { Some(*a) } else { None }).collect();
        match (motion, turns.as_slice()) {
            (Motion::Slide(a), _) => Self::Force(p.on_parent.apply(a)),
            (Motion::Turn(a), [first, second]) => {
                // the moment between the axes, one fixed on the parent and one on the child, that does work on one only
                let c = first.dot(*second);
                let (own, other) = (1.0 / (1.0 - c * c), -c / (1.0 - c * c));
                let (x, y) = if a == *first { (own, other) } else { (other, own) };
                Self::Moment(p.on_parent.apply(*first).times(x), p.on_child.apply(*second).times(y))
            }
            (Motion::Turn(a), _) => Self::Moment(p.on_parent.apply(a), Vec3::zero()),
            // turns in space are counted in the child's axes
            (Motion::Ball, _) => Self::Moment(Vec3::zero(), Vec3([0, 1, 2].map(|i| f64::from(u8::from(i == which))))),
        }
    }
}

fn is_constant(v: &VectorValue) -> bool {
    match v {
        VectorValue::Components(c) => c.iter().all(|v| matches!(v, Value::Constant(_))),
        VectorValue::Whole(v) => matches!(v, Value::Constant(_)),
    }
}

impl Load {
    /// All loads of a description.
    pub fn all(spec: &Spec, placed: &Placed) -> Result<Vec<Self>, DescriptionError> {
        let nodes = validate::nodes(spec)?;
        let reference = reference_points(placed);
        let mut loads = Vec::new();
        for f in &spec.forces {
            match f {
                Force::Spring { .. } => {}
                Force::TorsionSpring { name, joint, coordinate, stiffness, damping, angle } => {
                    let (q, v) = tree_coordinate(placed, "force", name, joint, *coordinate)?;
                    let q = q.ok_or_else(|| {
                        DescriptionError::new("force", name, "a turn in space has no single angle to spring back to; put springs between points of the bodies")
                    })?;
                    loads.push(Self::Torsion { q, v, stiffness: *stiffness, damping: *damping, angle: *angle });
                }
                Force::Torque { name, joint, coordinate, value } => {
                    let j = joint_index(placed, joint);
                    let p = &placed.joints[j];
                    let mut which = *coordinate;
                    let found = p.shape.motions.iter().find(|m| {
                        let found = which < m.velocities();
                        which -= if found { 0 } else { m.velocities() };
                        found
                    });
                    let motion = *found.ok_or_else(|| {
                        let m = format!(
                            "joint \"{joint}\" has {} coordinates, number {coordinate} was asked for (the first is 0)",
                            p.shape.freedoms()
                        );
                        DescriptionError::new("force", name, m)
                    })?;
                    let in_space = motion == Motion::Ball;
                    // the velocities of a ball that is walked from child to parent are not the joint's own
                    if p.links.is_some() && !(p.reversed && in_space) {
                        let (q, v) = tree_coordinate(placed, "force", name, joint, *coordinate)?;
                        loads.push(Self::Effort { name: name.clone(), q, v, value: value.clone() });
                        continue;
                    }
                    if p.links.is_none() && in_space {
                        let m =
                            format!("joint \"{joint}\" closes a loop and turns in space; use a force on its bodies");
                        return Err(DescriptionError::new("force", name, m));
                    }
                    let link = placed.link_of(p.child);
                    loads.push(Self::CutEffort {
                        name: name.clone(),
                        parent: (p.parent, placed.link_of(p.parent)),
                        child: (p.child, link),
                        push: Push::new(p, motion, which),
                        at: p.child_point - reference[link],
                        value: value.clone(),
                    });
                }
                Force::Force { name, body, point, value, axes } => {
                    let node = nodes[body.as_str()];
                    if node == 0 {
                        return Err(DescriptionError::new(
                            "force",
                            name,
                            "the ground does not feel a force; name a body",
                        ));
                    }
                    let (link, at) = point_on(placed, node, *point);
                    loads.push(Self::Force {
                        name: name.clone(),
                        node,
                        link,
                        at: at - reference[link],
                        value: value.clone(),
                        body_axes: (*axes == Axes::Body).then(|| placed.bodies[node - 1].rot),
                    });
                }
            }
        }
        Ok(loads)
    }

    /// Does work that no potential accounts for?
    pub fn is_dissipative(&self) -> bool {
        match self {
            Self::Torsion { damping, .. } => *damping != 0.0,
            Self::Effort { q, value, .. } => q.is_none() || !matches!(value, Value::Constant(_)),
            Self::CutEffort { .. } => true,
            Self::Force { value, body_axes, .. } => body_axes.is_some() || !is_constant(value),
        }
    }
}

/// Index of a joint that exists.
pub fn joint_index(placed: &Placed, name: &str) -> usize {
    placed.joint_numbers.get(name).copied().unwrap_or(0)
}

/// Coordinate (if any) and velocity of a joint's coordinate in the tree.
pub fn tree_coordinate(
    placed: &Placed,
    element: &'static str,
    name: &str,
    joint: &str,
    coordinate: usize,
) -> Result<(Option<usize>, usize), DescriptionError> {
    let p = &placed.joints[joint_index(placed, joint)];
    let Some(links) = &p.links else {
        let m = format!(
            "joint \"{joint}\" closes a loop in which every joint is driven, sprung or loaded, so it has no coordinate; \
             replace one of them by a spring between points"
        );
        return Err(DescriptionError::new(element, name, m));
    };
    let mut left = coordinate;
    for (motion, &link) in p.shape.motions.iter().zip(links) {
        if left < motion.velocities() {
            let l = &placed.links[link];
            let ball = *motion == Motion::Ball;
            return Ok(((!ball).then_some(l.q), l.v + left));
        }
        left -= motion.velocities();
    }
    let m = format!(
        "joint \"{joint}\" has {} coordinates, number {coordinate} was asked for (the first is 0)",
        p.shape.freedoms()
    );
    Err(DescriptionError::new(element, name, m))
}

/// A force in mechanism axes at one instant.
pub fn force_at(
    load: &Load,
    rot_link: &[[f64; 3]; 3],
    basis: &Mat3<f64>,
    f: &dyn Functions,
    t: f64,
    q: &[f64],
    v: &[f64],
) -> Result<Vec3<f64>, SystemError> {
    let Load::Force { name, value, body_axes, .. } = load else { return Ok(Vec3::zero()) };
    let x = Vec3(value::vector_at(value, f, t, q, v, name)?);
    Ok(match body_axes {
        Some(axes) => Mat3(*rot_link).apply(axes.apply(x)),
        None => basis.apply(x),
    })
}

impl<G: Space> Tree<G> {
    /// Add all loads at the last twists.
    pub fn apply_loads(
        &self,
        loads: &[Load],
        basis: &Mat3<f64>,
        f: &dyn Functions,
        t: f64,
        q: &[f64],
        v: &[f64],
        s: &mut TreeScratch<G>,
    ) -> Result<(), SystemError> {
        for load in loads {
            match load {
                Load::Torsion { q: i, v: j, stiffness, damping, angle } => {
                    s.effort[*j] -= G::S::from_f64(stiffness * (q[*i] - angle) + damping * v[*j]);
                }
                Load::Effort { name, v: j, value, .. } => {
                    s.effort[*j] += G::S::from_f64(value::scalar_at(value, f, t, q, v, name)?);
                }
                Load::CutEffort { name, parent, child, push, at, value } => {
                    let x = G::S::from_f64(value::scalar_at(value, f, t, q, v, name)?);
                    let arm = G::rotate(&s.links[child.1].rot, G::vec_from(at.0));
                    let back = self.place(child.1, s) + arm - self.place(parent.1, s);
                    match push {
                        Push::Moment(on_parent, on_child) => {
                            let axis = G::rotate_ang(&s.links[parent.1].rot, G::ang_from(on_parent.0))
                                + G::rotate_ang(&s.links[child.1].rot, G::ang_from(on_child.0));
                            let m = G::scale_ang(axis, x);
                            s.links[child.1].moment += m;
                            s.links[parent.1].moment -= m;
                        }
                        Push::Force(a) => {
                            let p = G::scale(G::rotate(&s.links[parent.1].rot, G::vec_from(a.0)), x);
                            self.add_force(s, child.1, arm, p);
                            self.add_force(s, parent.1, back, -p);
                        }
                    }
                }
                Load::Force { link, at, .. } => {
                    let rot = G::rot_to(&s.links[*link].rot);
                    let x = force_at(load, &rot, basis, f, t, q, v)?;
                    let arm = G::rotate(&s.links[*link].rot, G::vec_from(at.0));
                    self.add_force(s, *link, arm, G::vec_from(x.0));
                }
            }
        }
        Ok(())
    }

    /// Potential of the conservative loads and power of the others at the last twists: `(V, P)`.
    pub fn load_energy(
        &self,
        loads: &[Load],
        basis: &Mat3<f64>,
        f: &dyn Functions,
        t: f64,
        q: &[f64],
        v: &[f64],
        s: &TreeScratch<G>,
    ) -> Result<(f64, f64), SystemError> {
        let (mut potential, mut power) = (0.0, 0.0);
        for load in loads {
            match load {
                Load::Torsion { q: i, v: j, stiffness, damping, angle } => {
                    potential += 0.5 * stiffness * (q[*i] - angle).powi(2);
                    power -= damping * v[*j].powi(2);
                }
                Load::Effort { name, q: i, v: j, value } => match (i, value) {
                    (Some(i), Value::Constant(x)) => potential -= x * q[*i],
                    _ => power += value::scalar_at(value, f, t, q, v, name)? * v[*j],
                },
                Load::CutEffort { name, parent, child, push, at, value } => {
                    let x = value::scalar_at(value, f, t, q, v, name)?;
                    let (xp, xc) = (&s.links[parent.1], &s.links[child.1]);
                    let rate = match push {
                        Push::Moment(on_parent, on_child) => {
                            let axis = G::rotate_ang(&xp.rot, G::ang_from(on_parent.0))
                                + G::rotate_ang(&xc.rot, G::ang_from(on_child.0));
                            G::dot_ang(axis, xc.w - xp.w).value()
                        }
                        Push::Force(a) => {
                            let d = G::rotate(&xp.rot, G::vec_from(a.0));
                            let arm = G::rotate(&xc.rot, G::vec_from(at.0));
                            let back = self.place(child.1, s) + arm - self.place(parent.1, s);
                            G::dot(d, xc.u + G::cross(xc.w, arm) - xp.u - G::cross(xp.w, back)).value()
                        }
                    };
                    power += x * rate;
                }
                Load::Force { link, at, .. } => {
                    let x = &s.links[*link];
                    let force = force_at(load, &G::rot_to(&x.rot), basis, f, t, q, v)?;
                    let arm = G::rotate(&x.rot, G::vec_from(at.0));
                    if load.is_dissipative() {
                        let rate = G::vec_to(x.u + G::cross(x.w, arm));
                        power += force.dot(Vec3(rate));
                    } else {
                        potential -= force.dot(Vec3(G::vec_to(self.place(*link, s) + arm)));
                    }
                }
            }
        }
        Ok((potential, power))
    }
}
