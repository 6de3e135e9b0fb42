//! Applied forces: one element, one file, one `wrench`. Equations of motion, energies, power, reactions and derivatives
//! all sum the same function.
//!
//! ```text
//! (t, q, v), poses, twists ──► wrench ──► Effect: what acts where, the potential, the power it does not explain
//! ```

mod build;
mod cut_effort;
mod effort;
mod point_force;
mod spring;
mod torsion;

pub use build::{joint_index, tree_coordinate};
pub use cut_effort::{CutEffort, Unit};
pub use effort::Effort;
pub use point_force::PointForce;
pub use spring::Spring;
pub use torsion::Torsion;

use crate::tree::{Tree, TreeScratch};
use crate::value::{Instant, Source};
use partita_math::scalar::Scalar;
use partita_math::spatial::Space;
use partita_system::SystemError;

/// One applied force.
#[derive(Clone, Debug)]
pub enum Element<G: Space> {
    /// Spring and damper between two points.
    Spring(Spring<G>),
    /// Spring and damper in a tree coordinate.
    Torsion(Torsion<G::S>),
    /// Effort along a tree velocity.
    Effort(Effort<G::S>),
    /// Effort along a coordinate that no tree velocity stands for: a pair of wrenches.
    CutEffort(CutEffort<G>),
    /// Force at a point of a body.
    Force(PointForce<G>),
}

/// Where an element acts.
#[derive(Clone, Copy, Debug)]
pub struct Place<G: Space> {
    /// Node of the body (0 is the ground).
    pub node: usize,
    /// Its link.
    pub link: usize,
    /// Point from the link's reference point, link axes.
    pub at: G::Vec,
}

/// A wrench on one link, world axes.
#[derive(Clone, Copy, Debug)]
pub struct Push<G: Space> {
    /// Node of the body (0 is the ground).
    pub node: usize,
    /// Its link.
    pub link: usize,
    /// Point of the force, from the link's reference point.
    pub arm: G::Vec,
    /// Moment about that point.
    pub moment: G::Ang,
    /// Force.
    pub force: G::Vec,
}

/// How an element acts.
#[derive(Clone, Copy, Debug)]
pub enum Acts<G: Space> {
    /// Along a tree velocity.
    Along(usize, G::S),
    /// On a body.
    On(Push<G>),
    /// On two bodies.
    Between(Push<G>, Push<G>),
}

/// What an element does at one instant.
#[derive(Clone, Copy, Debug)]
pub struct Effect<G: Space> {
    /// What acts.
    pub acts: Acts<G>,
    /// Its potential, 0 if it has none.
    pub potential: G::S,
    /// Power of what acts, so far as the potential does not account for it.
    pub power: G::S,
}

/// An instant of the tree: where elements look up what they need.
pub(crate) struct At<'a, G: Space> {
    pub tree: &'a Tree<G>,
    pub s: &'a TreeScratch<G>,
    pub instant: Instant<'a, G::S>,
}

impl<G: Space> At<'_, G> {
    /// Offset of a place from its link's reference point, world axes.
    #[inline(always)]
    fn arm(&self, p: &Place<G>) -> G::Vec {
        G::rotate(&self.s.links[p.link].rot, p.at)
    }

    /// Velocity of the point at an arm of a link.
    #[inline(always)]
    fn velocity(&self, link: usize, arm: G::Vec) -> G::Vec {
        let x = &self.s.links[link];
        x.u + G::cross(x.w, arm)
    }
}

impl<G: Space> Element<G> {
    /// What it does at the last poses and twists. A user's function is called once.
    #[inline(always)]
    pub(crate) fn wrench(&self, at: &At<G>, room: &mut Vec<f64>) -> Result<Effect<G>, SystemError> {
        match self {
            Self::Spring(e) => Ok(e.wrench(at)),
            Self::Torsion(e) => Ok(e.wrench(at)),
            Self::Effort(e) => e.wrench(at, room),
            Self::CutEffort(e) => e.wrench(at, room),
            Self::Force(e) => e.wrench(at, room),
        }
    }

    /// Does work that no potential accounts for?
    pub fn is_dissipative(&self) -> bool {
        match self {
            Self::Spring(e) => e.damped,
            Self::Torsion(e) => e.damped,
            Self::Effort(e) => !e.is_conservative(),
            Self::CutEffort(_) => true,
            Self::Force(e) => !e.is_conservative(),
        }
    }

    /// The coordinate whose whole turns it counts: a torsion spring winds up, a constant torque does work.
    pub fn counted(&self) -> Option<usize> {
        match self {
            Self::Torsion(e) => Some(e.q),
            Self::Effort(e) => e.q,
            Self::Spring(_) | Self::CutEffort(_) | Self::Force(_) => None,
        }
    }

    /// Does a function of the user's see all coordinates, turns included?
    pub fn sees_coordinates(&self) -> bool {
        self.sources().iter().any(|s| matches!(s, Source::Function(_)))
    }

    /// The name of the element if it calls a function of the user's.
    pub(crate) fn calls(&self) -> Option<&str> {
        let name = match self {
            Self::Spring(_) | Self::Torsion(_) => return None,
            Self::Effort(e) => &e.name,
            Self::CutEffort(e) => &e.name,
            Self::Force(e) => &e.name,
        };
        self.sees_coordinates().then_some(name)
    }

    fn sources(&self) -> &[Source<G::S>] {
        match self {
            Self::Spring(_) | Self::Torsion(_) => &[],
            Self::Effort(e) => std::slice::from_ref(&e.value),
            Self::CutEffort(e) => std::slice::from_ref(&e.value),
            Self::Force(e) => e.value.sources(),
        }
    }

    /// Nodes of the bodies it acts on; 0 is the ground.
    pub(crate) fn nodes(&self) -> [usize; 2] {
        match self {
            Self::Spring(e) => [e.a.node, e.b.node],
            Self::Torsion(_) | Self::Effort(_) => [0, 0],
            Self::CutEffort(e) => [e.parent.node, e.child.node],
            Self::Force(e) => [e.on.node, 0],
        }
    }

    /// Velocity that it acts along, or the links it acts on.
    pub(crate) fn touches(&self) -> (Option<usize>, [usize; 2]) {
        match self {
            Self::Spring(e) => (None, [e.a.link, e.b.link]),
            Self::Torsion(e) => (Some(e.v), [0, 0]),
            Self::Effort(e) => (Some(e.v), [0, 0]),
            Self::CutEffort(e) => (None, [e.parent.link, e.child.link]),
            Self::Force(e) => (None, [e.on.link, 0]),
        }
    }
}

impl<G: Space> Tree<G> {
    /// Adds what an element does to the applied forces.
    #[inline(always)]
    pub(crate) fn add_effect(&self, s: &mut TreeScratch<G>, effect: &Effect<G>) {
        match &effect.acts {
            Acts::Along(v, effort) => s.effort[*v] += *effort,
            Acts::On(p) => self.add_push(s, p),
            Acts::Between(p, other) => {
                self.add_push(s, p);
                self.add_push(s, other);
            }
        }
    }

    #[inline(always)]
    fn add_push(&self, s: &mut TreeScratch<G>, p: &Push<G>) {
        self.add_force(s, p.link, p.arm, p.force);
        s.links[p.link].moment += p.moment;
    }
}

/// Half of `stiffness · stretch²`.
#[inline(always)]
fn stored<S: Scalar>(stiffness: S, stretch: S) -> S {
    (stiffness * stretch * stretch).scale(0.5)
}
