//! Applied forces: one element, one file, one `wrench`. Equations of motion, energies, power, reactions and derivatives
//! all sum the same function.
//!
//! ```text
//! (t, q, v), poses, twists ──► wrench ──► Effect: what acts where, the potential, the power it does not explain
//! ```

mod build;
mod bushing;
mod contact;
mod gravity;
mod law;
mod load;
mod loads;
mod point_force;
mod resistance;
mod sight;
mod spot;
mod spring;
mod two_point;
mod tyre;
mod weightless;

pub(crate) use build::Maker;
pub use bushing::Bushing;
pub use contact::{Contact, Surface};
pub use gravity::Gravity;
pub use law::{Law, LawInput};
pub use load::{Bearing, Curve, Effort, Friction, Load, LoadLaw, SetValued, SpringDamper, Stop};
pub use point_force::PointForce;
pub use resistance::Buffer;
pub use sight::CutSight;
pub use spot::Spot;
pub use spring::Spring;
pub use two_point::{Line, TwoPoint};
pub use tyre::Tyre;
pub use weightless::Weightless;

use crate::measurement::Measurement;
use crate::tree::{Tree, TreeScratch};
use crate::value::{Functions, Instant, Source};
use partita_math::scalar::{Cases, Scalar};
use partita_math::spatial::Space;
use partita_system::SystemError;

/// One applied force.
#[derive(Clone, Debug)]
pub enum Element<G: Space> {
    /// Spring and damper between two points.
    Spring(Spring<G>),
    /// An effort along a measurement.
    Load(Box<Load<G>>),
    /// Force at a point of a body.
    Force(PointForce<G>),
    /// Stiffness and damping in all directions.
    Bushing(Box<Bushing<G>>),
    /// A sphere against a plane or a sphere.
    Contact(Box<Contact<G>>),
    /// A law of the distance of two points.
    TwoPoint(Box<TwoPoint<G>>),
    /// A wheel on a road.
    Tyre(Box<Tyre<G>>),
    /// A function of its readings.
    Law(Box<Law<G>>),
    /// No gravity on a body.
    Weightless(Weightless<G>),
    /// Time-dependent gravity.
    Gravity(Box<Gravity<G>>),
}

/// Memory of elements.
#[derive(Clone, Debug)]
pub struct ForceScratch<G: Space> {
    /// Plain arguments of functions known in `f64` alone.
    pub(crate) plain: Vec<f64>,
    /// Readings and results of a law.
    seen: Vec<G::S>,
    answers: Vec<G::S>,
    /// Wrenches of an element that has many: see [`ForceApplication::Listed`].
    pub(crate) wrenches: Vec<AppliedWrench<G>>,
    /// Normal forces of the reaction-dependent frictions, arms included.
    pub(crate) normal_forces: Vec<G::S>,
    /// Coordinates and velocities as functions read them.
    pub(crate) q: Vec<G::S>,
    pub(crate) v: Vec<G::S>,
}

impl<G: Space> ForceScratch<G> {
    /// Empty, but for the normal forces of the frictions in another.
    pub(crate) fn with_normal_forces(other: &Self) -> Self {
        Self { normal_forces: other.normal_forces.clone(), ..Self::default() }
    }
}

impl<G: Space> Default for ForceScratch<G> {
    fn default() -> Self {
        Self {
            plain: Vec::new(),
            seen: Vec::new(),
            answers: Vec::new(),
            wrenches: Vec::new(),
            normal_forces: Vec::new(),
            q: Vec::new(),
            v: Vec::new(),
        }
    }
}

/// The point of a body at which an element acts.
#[derive(Clone, Copy, Debug)]
pub struct AttachmentPoint<G: Space> {
    /// Node of the body (0 is the ground).
    pub node: usize,
    /// Its link.
    pub link: usize,
    /// Point from the link's reference point, link axes.
    pub at: G::Vec,
}

/// A wrench on one link, world axes.
#[derive(Clone, Copy, Debug)]
pub struct AppliedWrench<G: Space> {
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
pub enum ForceApplication<G: Space> {
    /// Along a tree velocity.
    Along(usize, G::S),
    /// On a body.
    On(AppliedWrench<G>),
    /// On two bodies.
    Between(AppliedWrench<G>, AppliedWrench<G>),
    /// On as many as are listed in the memory.
    Listed,
}

/// Effect of an element at one instant.
#[derive(Clone, Copy, Debug)]
pub struct Effect<G: Space> {
    /// What acts.
    pub application: ForceApplication<G>,
    /// Its potential, 0 if it has none.
    pub potential: G::S,
    /// Power of its loads that the potential does not account for.
    pub power: G::S,
}

/// An instant of the tree: where elements look up what they need.
pub(crate) struct At<'a, G: Space> {
    pub tree: &'a Tree<G>,
    pub s: &'a TreeScratch<G>,
    pub instant: Instant<'a, G::S>,
}

impl<G: Space> At<'_, G> {
    /// Offset of an attachment point from the reference point of its link, world axes.
    #[inline(always)]
    fn arm(&self, p: &AttachmentPoint<G>) -> G::Vec {
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
    /// Its effect at the last poses and twists. A user function is called once.
    #[inline(always)]
    pub(crate) fn wrench(&self, at: &At<G>, memory: &mut ForceScratch<G>) -> Result<Effect<G>, SystemError> {
        match self {
            Self::Spring(e) => Ok(e.wrench(at)),
            Self::Load(e) => e.wrench(at, memory),
            Self::Force(e) => e.wrench(at, &mut memory.plain),
            Self::Weightless(e) => Ok(e.wrench(at)),
            other => other.rare(at, memory),
        }
    }

    /// For a spring the force that stretches it by its own length, or by `size` where that is larger; 0 for others. A spring
    /// near its free length pulls by a difference of such forces.
    pub(crate) fn elastic(&self, tree: &Tree<G>, size: f64) -> G::S {
        let size = G::S::from_f64(size);
        match self {
            Self::Spring(e) => e.stiffness.abs() * e.length.abs().max(size),
            Self::Load(e) => match &e.law {
                LoadLaw::SpringDamper(x) if e.along.is_angle(tree) => {
                    x.stiffness.abs() * x.free.abs().max(G::S::one()) / size
                }
                LoadLaw::SpringDamper(x) => x.stiffness.abs() * x.free.abs().max(size),
                _ => G::S::zero(),
            },
            _ => G::S::zero(),
        }
    }

    /// Effort along the coordinate of a joint that corresponds to an effect of it.
    pub(crate) fn effort(&self, at: &At<G>, effect: &Effect<G>) -> Option<G::S> {
        match (&effect.application, self) {
            (ForceApplication::Along(_, effort), _) => Some(*effort),
            (ForceApplication::Between(on, _), Self::Load(e)) => e.effort(at, on),
            _ => None,
        }
    }

    /// The large elements, stored separately from the others.
    #[inline(never)]
    fn rare(&self, at: &At<G>, memory: &mut ForceScratch<G>) -> Result<Effect<G>, SystemError> {
        match self {
            Self::Bushing(e) => e.wrench(at),
            Self::Contact(e) => Ok(e.wrench(at)),
            Self::TwoPoint(e) => Ok(e.wrench(at)),
            Self::Tyre(e) => Ok(e.wrench(at)),
            Self::Law(e) => e.wrench(at, memory),
            Self::Gravity(e) => e.wrench(at, memory),
            Self::Spring(_) | Self::Load(_) | Self::Force(_) | Self::Weightless(_) => self.wrench(at, memory),
        }
    }

    /// Whether it does work that no potential accounts for.
    pub fn is_dissipative(&self) -> bool {
        match self {
            Self::Spring(e) => e.damped,
            Self::Load(e) => e.is_dissipative(),
            Self::Law(_) | Self::Gravity(_) => true,
            Self::Force(e) => !e.is_conservative(),
            Self::Bushing(e) => e.damped,
            Self::Contact(e) => e.buffer.damped || e.rough,
            Self::TwoPoint(e) => e.is_dissipative(),
            Self::Tyre(e) => e.buffer.damped || e.has_slip_forces,
            Self::Weightless(_) => false,
        }
    }

    /// Its arguments, whole turns included: a torsion spring winds up, a constant torque does work.
    pub(crate) fn depends_on(&self) -> Option<&Measurement<G>> {
        match self {
            Self::Load(e) => e.depends_on(),
            _ => None,
        }
    }

    /// What its effort depends on, whole turns included: a torsion spring winds up, a constant torque and a damper do
    /// not.
    pub(crate) fn winds_up(&self) -> Option<&Measurement<G>>
    where
        G: Space<S = f64>,
    {
        match self {
            Self::Load(e) if e.law.winds_up() => e.depends_on(),
            _ => None,
        }
    }

    /// Name of an element that depends on an angle measured from the pose, the value about which the angle is unique,
    /// and the half width of that range.
    pub fn turn_range(&self) -> Option<(&str, f64, f64)>
    where
        G: Space<S = f64>,
    {
        match self {
            Self::Load(e) => e.turns.map(|(middle, within)| (e.name.as_str(), middle, within)),
            _ => None,
        }
    }

    /// Whether it is given over a range of what it reads alone.
    pub(crate) fn has_range(&self) -> bool {
        matches!(self, Self::Load(e) if e.turns.is_some() || matches!(e.law, LoadLaw::Curve(_)))
    }

    /// Whether it calls a user function, which may depend on all coordinates including whole turns.
    pub(crate) fn calls_function(&self) -> bool {
        matches!(self, Self::Law(_)) || self.sources().iter().any(|s| matches!(s, Source::Function(_)))
    }

    /// Whether it calls a function of the whole state.
    pub(crate) fn sees_state(&self, functions: &dyn Functions) -> bool {
        self.sources().iter().any(|s| matches!(s, Source::Function(i) if functions.sees_state(*i)))
    }

    /// The name of the element if it calls one of these functions, which f64 alone can do.
    pub(crate) fn calls(&self, functions: &dyn Functions) -> Option<&str> {
        let name = match self {
            Self::Load(e) => &e.name,
            Self::Force(e) => &e.name,
            Self::Law(e) => &e.name,
            Self::Gravity(e) => &e.name,
            _ => return None,
        };
        let is_called = |s: &Source<G::S>| matches!(s, Source::Function(i) if functions.given(*i).is_none());
        (matches!(self, Self::Law(_)) || self.sources().iter().any(is_called)).then_some(name)
    }

    fn sources(&self) -> &[Source<G::S>] {
        match self {
            Self::Load(e) => e.sources(),
            Self::Force(e) => e.value.sources(),
            Self::Gravity(e) => e.value.sources(),
            _ => &[],
        }
    }

    /// Nodes of the bodies it acts on; 0 is the ground.
    pub(crate) fn nodes(&self) -> Vec<usize> {
        let of = |all: &[Spot<G>]| all.iter().map(|p| p.attachment.node).collect();
        match self {
            Self::Spring(e) => vec![e.a.node, e.b.node],
            Self::Load(e) => e.nodes(),
            Self::Force(e) => vec![e.on.node],
            Self::Bushing(e) => of(&e.ends),
            Self::Contact(e) => of(&[e.centre, e.other]),
            Self::TwoPoint(e) => of(&[e.a, e.b]),
            Self::Tyre(e) => of(&[e.centre, e.road]),
            Self::Law(e) => of(&e.on),
            Self::Weightless(e) => vec![e.on.node],
            Self::Gravity(e) => e.on.iter().map(|(p, _)| p.node).collect(),
        }
    }

    /// Velocity that it acts along, or the links it acts on.
    pub(crate) fn touches(&self) -> (Option<usize>, Vec<usize>) {
        let of = |all: &[Spot<G>]| (None, all.iter().map(|p| p.attachment.link).collect());
        match self {
            Self::Spring(e) => (None, vec![e.a.link, e.b.link]),
            Self::Load(e) => e.touches(),
            Self::Force(e) => (None, vec![e.on.link]),
            Self::Bushing(e) => of(&e.ends),
            Self::Contact(e) => of(&[e.centre, e.other]),
            Self::TwoPoint(e) => of(&[e.a, e.b]),
            Self::Tyre(e) => of(&[e.centre, e.road]),
            Self::Law(e) => of(&e.on),
            Self::Weightless(e) => (None, vec![e.on.link]),
            Self::Gravity(e) => (None, e.on.iter().map(|(p, _)| p.link).collect()),
        }
    }

    /// Whether it depends on the reaction of its joint.
    pub(crate) fn follows_reactions(&self) -> bool {
        matches!(self, Self::Load(load) if matches!(&load.law, LoadLaw::Friction(law) if law.follows.is_some()))
    }

    /// Links that it reads without acting on them.
    pub(crate) fn looks_at(&self) -> Vec<usize> {
        match self {
            Self::Law(e) => e.sees.iter().flat_map(LawInput::links).collect(),
            Self::Load(e) => e.over.iter().flat_map(|x| x.links).collect(),
            _ => Vec::new(),
        }
    }
}

impl<G: Space> Tree<G> {
    /// Adds the effect of an element to the applied forces.
    #[inline(always)]
    pub(crate) fn add_effect(&self, s: &mut TreeScratch<G>, effect: &Effect<G>, memory: &ForceScratch<G>) {
        match &effect.application {
            ForceApplication::Along(v, effort) => s.effort[*v] += *effort,
            ForceApplication::On(p) => self.add_wrench(s, p),
            ForceApplication::Between(p, other) => {
                self.add_wrench(s, p);
                self.add_wrench(s, other);
            }
            ForceApplication::Listed => memory.wrenches.iter().for_each(|p| self.add_wrench(s, p)),
        }
    }

    #[inline(always)]
    fn add_wrench(&self, s: &mut TreeScratch<G>, p: &AppliedWrench<G>) {
        self.add_force(s, p.link, p.arm, p.force);
        s.links[p.link].moment += p.moment;
    }
}

/// Half of `stiffness · stretch²`.
#[inline(always)]
fn stored<S: Scalar>(stiffness: S, stretch: S) -> S {
    (stiffness * stretch * stretch).scale(0.5)
}
