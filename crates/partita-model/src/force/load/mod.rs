//! A load: one effort along a measurement, by a law. It acts on both sides along the gradient of the measurement, so
//! that a law is independent of whether its joint is in the tree, closes a loop or is described in absolute
//! coordinates.
//!
//! ```text
//! value x, rate x' ──► law ──► effort, potential, power          gradient, effort ──► what acts where
//! ```

mod curve;
mod effort;
mod friction;
mod gas_spring;
mod set_valued;
mod spring_damper;
mod stop;

pub use curve::Curve;
pub use effort::Effort;
pub use friction::{Bearing, Friction};
pub use gas_spring::GasSpring;
pub use set_valued::SetValued;
pub use spring_damper::SpringDamper;
pub use stop::Stop;

use super::build::Maker;
use super::{AppliedWrench, At, AttachmentPoint, Effect, ForceApplication, ForceScratch};
use crate::error::DescriptionError;
use crate::measurement::{Measurement, Quantity, Read};
use crate::numbers::Fields;
use crate::spec::{Force, Torque, Value};
use crate::value::{Instant, Source};
use partita_math::scalar::{Cases, Functions, Scalar};
use partita_math::spatial::Space;
use partita_system::SystemError;
use std::f64::consts::{PI, TAU};

/// Arguments of an effort.
pub(crate) struct EffortArguments<'a, S> {
    /// Name of the load, for messages.
    pub name: &'a str,
    /// Value of its argument.
    pub x: S,
    /// Rate of the measurement.
    pub rate: S,
    /// Time and state.
    pub instant: &'a Instant<'a, S>,
    /// Normal forces of the reaction-dependent frictions.
    pub normal_forces: &'a [S],
}

/// Result of a law.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Response<S> {
    /// Along the measurement.
    pub effort: S,
    /// Its potential, 0 if it has none.
    pub potential: S,
    /// Power of the effort that the potential does not account for.
    pub power: S,
}

/// One effort: the contract of a law.
pub(crate) trait ScalarLaw<S: Scalar> {
    /// The effort and its energies. `plain` is memory for arguments of functions known in `f64` alone.
    fn respond(&self, asked: &EffortArguments<S>, plain: &mut Vec<f64>) -> Result<Response<S>, SystemError>;
    /// Whether it does non-conservative work.
    fn is_dissipative(&self) -> bool {
        true
    }
    /// Whether it depends on the value, including whole turns of an angle.
    fn depends_on_value(&self) -> bool {
        true
    }
    /// The middle and half width of the range in which an angle is unique, where whole turns matter and are not
    /// counted.
    fn turns(&self) -> Option<(S, f64)> {
        None
    }
    /// Its numbers, tables and functions.
    fn sources(&self) -> &[Source<S>] {
        &[]
    }
}

/// The laws.
#[derive(Clone, Debug)]
pub enum LoadLaw<S> {
    /// Spring and damper.
    SpringDamper(SpringDamper<S>),
    /// A number, a table or a function.
    Effort(Effort<S>),
    /// A curve over a measurement.
    Curve(Curve),
    /// Friction.
    Friction(Box<Friction<S>>),
    /// Gas spring.
    GasSpring(GasSpring<S>),
    /// Compliant ends.
    Stop(Box<Stop<S>>),
    /// What a run decides about.
    SetValued(SetValued<S>),
}

impl LoadLaw<f64> {
    /// Whether the effort depends on the value, including whole turns of an angle.
    pub(crate) fn winds_up(&self) -> bool {
        match self {
            Self::Effort(_) => false,
            Self::SpringDamper(x) => x.stiffness != 0.0,
            other => other.as_law().depends_on_value(),
        }
    }
}

impl<S: Scalar> LoadLaw<S> {
    /// Of a force along a joint coordinate; `in_state`: one of the state.
    fn new(force: &Force, n: &Fields<S>, in_state: bool) -> Option<Self> {
        Some(match force {
            Force::TorsionSpring(x) => Self::SpringDamper(SpringDamper::new(n, x.damping != 0.0)),
            Force::Torque(Torque { value: Value::Table(curve), over: Some(_), periodic, .. }) => {
                Self::Curve(Curve { curve: curve.clone(), periodic: *periodic })
            }
            Force::Torque(x) => {
                Self::Effort(Effort { value: Source::new(&x.value, n.field("value").first()), in_state })
            }
            Force::Friction(x) if x.stick_velocity == 0.0 => Self::SetValued(SetValued::friction(x, n)),
            Force::Friction(x) => Self::Friction(Box::new(Friction::new(x, n))),
            Force::GasSpring(x) => Self::GasSpring(GasSpring::new(x, n)),
            Force::Stop(x) if x.restitution.is_some() => Self::SetValued(SetValued::constraint()),
            Force::Stop(x) => Self::Stop(Box::new(Stop::new(x, n))),
            Force::Freewheel(_) | Force::Latch(_) => Self::SetValued(SetValued::constraint()),
            _ => return None,
        })
    }

    fn as_law(&self) -> &dyn ScalarLaw<S> {
        match self {
            Self::SpringDamper(x) => x,
            Self::Effort(x) => x,
            Self::Curve(x) => x,
            Self::Friction(x) => &**x,
            Self::GasSpring(x) => x,
            Self::Stop(x) => &**x,
            Self::SetValued(x) => x,
        }
    }

    /// The frequent laws, stored inline.
    #[inline(always)]
    fn respond(&self, asked: &EffortArguments<S>, plain: &mut Vec<f64>) -> Result<Response<S>, SystemError> {
        match self {
            Self::SpringDamper(x) => x.respond(asked, plain),
            Self::Effort(x) => x.respond(asked, plain),
            other => other.respond_rarely(asked, plain),
        }
    }

    #[inline(never)]
    fn respond_rarely(&self, asked: &EffortArguments<S>, plain: &mut Vec<f64>) -> Result<Response<S>, SystemError> {
        self.as_law().respond(asked, plain)
    }
}

/// An effort along a measurement.
#[derive(Clone, Debug)]
pub struct Load<G: Space> {
    /// Name, for messages.
    pub name: String,
    /// The measurement.
    pub along: Measurement<G>,
    /// The argument of the law, if it differs.
    pub over: Option<Box<Measurement<G>>>,
    /// Where it acts on A and B, both at the same point of space; none along a velocity of the tree.
    pub sides: Option<[AttachmentPoint<G>; 2]>,
    /// Middle and half width of the range in which an angle is unique, where whole turns matter and are not counted.
    pub turns: Option<(G::S, f64)>,
    /// The law.
    pub law: LoadLaw<G::S>,
}

impl<G: Space<S = f64>> Load<G> {
    /// The argument of the effort, and its rate.
    pub(crate) fn value_and_rate(&self, at: &At<G>) -> (f64, f64) {
        let measured = self.measured();
        let (x, rate) = (measured.value(at.tree, at.s, at.instant.q), measured.rate(at.tree, at.s, at.instant.v));
        let near = |(middle, within)| self.nearest(x, middle, within).ok();
        (self.turns.map_or(x, |turns| near(turns).unwrap_or(x)), rate)
    }

    /// Both ends of a stop; none for another load.
    pub(crate) fn ends(&self) -> [Option<f64>; 2] {
        match &self.law {
            LoadLaw::Stop(stop) => [stop.lower, stop.upper],
            _ => [None; 2],
        }
    }

    /// Natural size of the values between them: how far they are apart, one radian or metre where there is one alone.
    pub(crate) fn stop_range(&self) -> f64 {
        match self.ends() {
            [Some(lower), Some(upper)] if upper > lower => upper - lower,
            _ => 1.0,
        }
    }
}

impl<G: Space> Load<G> {
    /// Arguments of the effort.
    pub fn measured(&self) -> &Measurement<G> {
        self.over.as_deref().unwrap_or(&self.along)
    }

    /// Value, rate and gradient of the measurement.
    #[inline(always)]
    pub(crate) fn read(&self, at: &At<G>) -> Read<G> {
        self.along.read(at.tree, at.s, at.instant.q, at.instant.v)
    }

    /// Along a coordinate of the tree that is also its only argument, nothing needs to be evaluated.
    #[inline(always)]
    pub(crate) fn wrench(&self, at: &At<G>, memory: &mut ForceScratch<G>) -> Result<Effect<G>, SystemError> {
        match (&self.along.quantity, &self.over) {
            (&Quantity::Coordinate { q, v }, None) => {
                let Response { effort, potential, power } =
                    self.respond(at, at.instant.q[q], at.instant.v[v], memory)?;
                Ok(Effect { application: ForceApplication::Along(v, effort), potential, power })
            }
            _ => self.look(at, memory),
        }
    }

    #[inline(never)]
    fn look(&self, at: &At<G>, memory: &mut ForceScratch<G>) -> Result<Effect<G>, SystemError> {
        let read = self.read(at);
        let x = match &self.over {
            None => read.value,
            Some(over) => over.value(at.tree, at.s, at.instant.q),
        };
        let x = match self.turns {
            None => x,
            Some((middle, within)) => self.nearest(x, middle, within)?,
        };
        let Response { effort, potential, power } = self.respond(at, x, read.rate, memory)?;
        Ok(Effect { application: self.application(at, &read, effort), potential, power })
    }

    #[inline(always)]
    fn respond(
        &self,
        at: &At<G>,
        x: G::S,
        rate: G::S,
        memory: &mut ForceScratch<G>,
    ) -> Result<Response<G::S>, SystemError> {
        let ForceScratch { normal_forces, plain, .. } = memory;
        self.law.respond(&EffortArguments { name: &self.name, x, rate, instant: &at.instant, normal_forces }, plain)
    }

    /// The value of an angle closest to the middle; refused so far from it that it could differ by a full turn.
    fn nearest(&self, x: G::S, middle: G::S, within: f64) -> Result<G::S, SystemError> {
        let x = x - (x - middle).scale(1.0 / TAU).round().scale(TAU);
        match (x - middle).outside(-within, within) {
            Some(by) => Err(SystemError::Wound { what: self.name.clone(), by }),
            None => Ok(x),
        }
    }

    /// An effort along the measurement: on B, its opposite on A.
    #[inline(always)]
    pub(crate) fn application(&self, at: &At<G>, read: &Read<G>, effort: G::S) -> ForceApplication<G> {
        match (&self.sides, &read.unit) {
            (Some([a, b]), Some(unit)) => {
                let (moment, force) = (G::scale_ang(unit.moment, effort), G::scale(unit.force, effort));
                let arm = at.arm(b);
                // action equals reaction at the same point of space
                let back = at.tree.reference_point(b.link, at.s) + arm - at.tree.reference_point(a.link, at.s);
                let push = |e: &AttachmentPoint<G>, arm, moment, force| AppliedWrench {
                    node: e.node,
                    link: e.link,
                    arm,
                    moment,
                    force,
                };
                ForceApplication::Between(push(b, arm, moment, force), push(a, back, -moment, -force))
            }
            _ => ForceApplication::Along(self.along.velocity().unwrap_or(0), effort),
        }
    }

    /// Magnitudes of friction that may stick: while it slips, and while it sticks; none for another law.
    pub(crate) fn friction_levels(
        &self,
        at: &At<G>,
        memory: &mut ForceScratch<G>,
    ) -> Result<Option<[G::S; 2]>, SystemError> {
        match &self.law {
            LoadLaw::SetValued(x) => x.levels(&at.instant, &self.name, &mut memory.plain),
            _ => Ok(None),
        }
    }

    /// Number of unit efforts in a load on B.
    pub(crate) fn effort(&self, at: &At<G>, on: &AppliedWrench<G>) -> Option<G::S> {
        let unit = self.along.unit(at.tree, at.s)?;
        let size = G::dot_ang(unit.moment, unit.moment) + G::dot(unit.force, unit.force);
        Some((G::dot_ang(unit.moment, on.moment) + G::dot(unit.force, on.force)) / size)
    }

    /// Whether it does non-conservative work.
    pub fn is_dissipative(&self) -> bool {
        self.law.as_law().is_dissipative()
    }

    /// Its arguments, whole turns of an angle included.
    pub fn depends_on(&self) -> Option<&Measurement<G>> {
        self.law.as_law().depends_on_value().then(|| self.measured())
    }

    /// Its numbers, tables and functions.
    pub fn sources(&self) -> &[Source<G::S>] {
        self.law.as_law().sources()
    }

    /// Velocity that it acts along, or the links it acts on.
    pub fn touches(&self) -> (Option<usize>, Vec<usize>) {
        (self.along.velocity(), self.sides.iter().flatten().map(|p| p.link).collect())
    }

    /// Nodes of the bodies it acts on.
    pub fn nodes(&self) -> Vec<usize> {
        self.sides.iter().flatten().map(|p| p.node).collect()
    }
}

impl<G: Space> Maker<'_, G> {
    /// The load of a force that acts along a joint coordinate.
    pub(super) fn load(&self, force: &Force, n: &Fields<G::S>) -> Result<Option<Load<G>>, DescriptionError> {
        let (name, Some((joint, coordinate))) = (force.name(), force.along()) else { return Ok(None) };
        let along = match force {
            Force::Torque(_) => self.measurements.effort(joint, coordinate, "force", name)?,
            _ => self.measurements.joint(joint, coordinate, "force", name)?,
        };
        let over = match force {
            Force::Torque(Torque { value: Value::Table(_), over: Some(over), .. }) => {
                Some(Box::new(self.measurements.reading(over, "force", name)?))
            }
            _ => None,
        };
        let Some(law) = LoadLaw::new(force, n, along.coordinate().is_some()) else { return Ok(None) };
        let turns = law.as_law().turns().filter(|_| over.as_deref().unwrap_or(&along).wraps);
        if let Some(why) = turns.and_then(|(middle, within)| unknown_turns(middle, within)) {
            let m = format!(
                "the angle of the cut joint \"{joint}\" is measured from the pose, without full turns, and {why}; \
                 keep the joint in the tree (cut=\"never\", relative coordinates)"
            );
            return Err(DescriptionError::new("force", name, m));
        }
        let sides = along.velocity().is_none().then(|| self.sides(joint));
        Ok(Some(Load { name: name.into(), along, over, sides, turns, law }))
    }

    /// The point of a joint on parent and child.
    fn sides(&self, joint: &str) -> [AttachmentPoint<G>; 2] {
        let j = self.placed.joint_numbers[joint];
        let (p, points) = (&self.placed.joints[j], self.numbers.joints[j]);
        [self.attachment(p.parent, points.0), self.attachment(p.child, points.1)]
    }
}

/// Why an angle that is known up to whole turns is not known that far from there.
fn unknown_turns<S: Scalar>(middle: S, within: f64) -> Option<String> {
    match middle.outside(-PI, PI) {
        Some(middle) => Some(format!("{middle:.3} rad is more than half a turn from the drawing")),
        None if within >= PI => Some(format!(
            "stops {:.3} rad apart cannot be distinguished from stops one turn closer",
            2.0 * (2.0 * within - PI)
        )),
        None => None,
    }
}
