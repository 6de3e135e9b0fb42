//! A joint coordinate that a force reads and acts along: its value, its rate and its unit wrench, in the tree or cut.

use super::build::{joint_index, tree_coordinate, unit};
use super::{AppliedWrench, At, ForceApplication, Place, Unit};
use crate::error::DescriptionError;
use crate::joint::Motion;
use crate::measurement;
use crate::numbers::Numbers;
use crate::zero_position::{Placed, PlacedJoint};
use partita_math::scalar::Scalar;
use partita_math::spatial::{Space, Vec3};
use partita_system::SystemError;
use std::f64::consts::PI;

/// A little less than half a turn (rad): up to here an angle read off the pose is known from the middle of what can be told,
/// so that no step passes the place where it starts again unseen.
pub(crate) const KNOWN: f64 = 3.0;

/// A joint coordinate that is a slide or an angle.
#[derive(Clone, Debug)]
pub enum Reading<G: Space> {
    /// A coordinate of the tree and its velocity.
    Tree {
        /// Coordinate.
        q: usize,
        /// Velocity.
        v: usize,
    },
    /// A coordinate of a cut joint.
    Cut(Box<Cut<G>>),
}

/// What is read off the two sides of a cut joint.
#[derive(Clone, Debug)]
pub struct Cut<G: Space> {
    /// The joint's point on the parent.
    pub parent: Place<G>,
    /// The joint's point on the child.
    pub child: Place<G>,
    /// Wrench on the child for a unit effort.
    pub unit: Unit<G>,
    value: Value<G::S>,
}

/// How the value is found.
#[derive(Clone, Debug)]
enum Value<S> {
    /// Along the axis of the unit force.
    Slide,
    /// In the plane: coordinates of the tree, each with its sign, add up. Turns are counted.
    Sum(Vec<(usize, f64)>),
    /// Angle about an axis from a direction of the parent to one of the child; link axes. Between `middle` − π and + π.
    Angle { axis: Vec3<S>, on_child: bool, from: Vec3<S>, to: Vec3<S>, middle: S },
}

/// Value and rate of a coordinate, and what a unit effort would be.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Read<G: Space> {
    pub value: G::S,
    pub rate: G::S,
    /// Of a cut joint.
    held: Option<Held<G>>,
}

/// The unit wrench of a cut joint as it stands now.
#[derive(Clone, Copy, Debug)]
struct Held<G: Space> {
    /// Arms of the joint's point on parent and child.
    back: G::Vec,
    arm: G::Vec,
    /// Moment and force.
    axis: G::Ang,
    direction: G::Vec,
}

impl<G: Space> Reading<G> {
    /// Coordinate number `coordinate` of a joint; `middle` is where its angle is expected, should it have to be read off
    /// the pose, which tells it up to full turns.
    pub(crate) fn new(
        placed: &Placed,
        numbers: &Numbers<G::S>,
        force: &str,
        (joint, coordinate): (&str, usize),
        middle: G::S,
    ) -> Result<Self, DescriptionError> {
        let j = joint_index(placed, joint);
        let p = &placed.joints[j];
        let fail = |m: String| Err(DescriptionError::new("force", force, m));
        let mut at = 0;
        let found = p.shape.motions.iter().find(|m| {
            at += m.velocities();
            coordinate < at
        });
        let motion = match found {
            None => {
                let n = p.shape.freedoms();
                return fail(format!(
                    "joint \"{joint}\" has {n} coordinates, number {coordinate} was asked for (the first is 0)"
                ));
            }
            Some(Motion::Ball) => {
                return fail(format!(
                    "joint \"{joint}\" turns about all axes there, which is no single angle; name a slide or an angle"
                ));
            }
            Some(m) => *m,
        };
        if p.links.is_some() {
            let (q, v) = tree_coordinate(placed, "force", force, joint, coordinate)?;
            return Ok(Self::Tree { q: q.unwrap_or(v), v });
        }
        let place = |node: usize, point: Vec3<G::S>| {
            let link = placed.link_of(node);
            Place { node, link, at: G::vec_in(point - numbers.reference[link]) }
        };
        let (parent_point, child_point) = numbers.joints[j];
        let value = match motion {
            Motion::Slide(_) | Motion::Ball => Value::Slide,
            Motion::Turn(axis) if placed.planar => Value::Sum(measurement::in_plane(placed, p, axis)),
            Motion::Turn(axis) => match middle.outside(-PI, PI) {
                None => angle(p, axis, middle),
                Some(middle) => {
                    return fail(format!(
                        "the angle of joint \"{joint}\", which closes a loop in space, is read off the pose up to full turns, and \
                         {middle:.3} rad is more than half a turn from the drawing; keep the joint in the tree \
                         (cut=\"never\", relative coordinates)"
                    ));
                }
            },
        };
        Ok(Self::Cut(Box::new(Cut {
            parent: place(p.parent, parent_point),
            child: place(p.child, child_point),
            unit: unit(p, motion, 0),
            value,
        })))
    }

    /// Refuse a value so far from the middle of what can be told that the next one may be a full turn beside it.
    #[inline(always)]
    pub(crate) fn known(&self, name: &str, from_middle: G::S, within: f64) -> Result<(), SystemError> {
        if self.wraps() {
            if let Some(by) = from_middle.outside(-within, within) {
                return Err(SystemError::Wound { what: name.to_string(), by });
            }
        }
        Ok(())
    }

    /// Is its value known up to full turns only?
    pub fn wraps(&self) -> bool {
        matches!(self, Self::Cut(c) if matches!(c.value, Value::Angle { .. }))
    }

    /// The one coordinate of the tree that it is.
    pub fn coordinate(&self) -> Option<usize> {
        match self {
            Self::Tree { q, .. } => Some(*q),
            Self::Cut(_) => None,
        }
    }

    /// Velocity of the tree that it is, or the links of its two sides.
    pub fn touches(&self) -> (Option<usize>, Vec<usize>) {
        match self {
            Self::Tree { v, .. } => (Some(*v), Vec::new()),
            Self::Cut(c) => (None, vec![c.parent.link, c.child.link]),
        }
    }

    /// Nodes of its two sides, if efforts along it act on bodies.
    pub fn nodes(&self) -> Vec<usize> {
        match self {
            Self::Tree { .. } => Vec::new(),
            Self::Cut(c) => vec![c.parent.node, c.child.node],
        }
    }

    /// Value and rate at the last poses and twists.
    #[inline(always)]
    pub(crate) fn read(&self, at: &At<G>) -> Read<G> {
        match self {
            Self::Tree { q, v } => Read { value: at.instant.q[*q], rate: at.instant.v[*v], held: None },
            Self::Cut(c) => c.read(at),
        }
    }

    /// The effort that a push on the child is; none for a coordinate of the tree.
    pub(crate) fn effort(&self, at: &At<G>, on: &AppliedWrench<G>) -> Option<G::S> {
        match self {
            Self::Tree { .. } => None,
            Self::Cut(c) => Some(c.unit.effort(at, c.parent.link, on)),
        }
    }

    /// An effort along the coordinate: on the child, its opposite on the parent.
    #[inline(always)]
    pub(crate) fn application(&self, read: &Read<G>, effort: G::S) -> ForceApplication<G> {
        match (self, &read.held) {
            (Self::Cut(c), Some(Held { back, arm, axis, direction })) => {
                let (moment, force) = (G::scale_ang(*axis, effort), G::scale(*direction, effort));
                let push =
                    |e: &Place<G>, arm, moment, force| AppliedWrench { node: e.node, link: e.link, arm, moment, force };
                ForceApplication::Between(push(&c.child, *arm, moment, force), push(&c.parent, *back, -moment, -force))
            }
            (Self::Tree { v, .. }, _) => ForceApplication::Along(*v, effort),
            (Self::Cut(_), None) => ForceApplication::Along(0, G::S::zero()),
        }
    }
}

impl<G: Space> Cut<G> {
    fn read(&self, at: &At<G>) -> Read<G> {
        let (parent, child) = (self.parent.link, self.child.link);
        let (xp, xc) = (&at.s.links[parent], &at.s.links[child]);
        let arm = at.arm(&self.child);
        // action equals reaction at the same point of space
        let back = at.tree.place(child, at.s) + arm - at.tree.place(parent, at.s);
        let (axis, direction, rate, slid) = match self.unit {
            Unit::Moment(on_parent, on_child) => {
                let axis = G::rotate_ang(&xp.rot, on_parent) + G::rotate_ang(&xc.rot, on_child);
                (axis, G::Vec::default(), G::dot_ang(axis, xc.w - xp.w), G::S::zero())
            }
            Unit::Force(a) => {
                let d = G::rotate(&xp.rot, a);
                let rate = at.velocity(child, arm) - at.velocity(parent, back);
                (G::Ang::default(), d, G::dot(d, rate), G::dot(d, back - at.arm(&self.parent)))
            }
        };
        let value = match &self.value {
            Value::Slide => slid,
            Value::Sum(all) => all.iter().fold(G::S::zero(), |x, (q, sign)| x + at.instant.q[*q].scale(*sign)),
            Value::Angle { axis, on_child, from, to, middle } => {
                let (rp, rc) = (G::rot_to(&xp.rot), G::rot_to(&xc.rot));
                let a = if *on_child { rc.apply(*axis) } else { rp.apply(*axis) };
                let (x, y) = (rp.apply(*from), rc.apply(*to));
                let angle = a.dot(x.cross(y)).atan2(x.dot(y) - a.dot(x) * a.dot(y));
                let turn = 2.0 * std::f64::consts::PI;
                angle - (angle - *middle).scale(1.0 / turn).round().scale(turn)
            }
        };
        Read { value, rate, held: Some(Held { back, arm, axis, direction }) }
    }
}

/// The angle of a turn read off the pose: the first of two turns takes the other's axis along, which the second starts
/// from.
fn angle<S: Scalar>(p: &PlacedJoint, axis: Vec3<f64>, middle: S) -> Value<S> {
    let turns: Vec<Vec3<f64>> =
        p.shape.motions.iter().filter_map(|m| if let Motion::Turn(a) = m { Some(*a) } else { None }).collect();
    let lift = |x: Vec3<f64>| Vec3::<S>::from_f64(x.0);
    let second = turns.len() == 2 && turns[1] == axis;
    let probe = match turns.as_slice() {
        [first, other] => {
            if second {
                *first
            } else {
                *other
            }
        }
        _ => axis.complement().0,
    };
    let on = if second { &p.on_child } else { &p.on_parent };
    let (from, to) = (lift(p.on_parent.apply(probe)), lift(p.on_child.apply(probe)));
    Value::Angle { axis: lift(on.apply(axis)), on_child: second, from, to, middle }
}
