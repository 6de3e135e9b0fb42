//! The formulations by name: each is a tangent basis combined with position coordinates.

use super::Motion;
use crate::equations::full::AccelerationRule;
use crate::error::Result;
use crate::options::FormulationOptions;
use crate::positions::all::All;
use crate::positions::chart::Chart;
use crate::positions::independent::Independent;
use crate::positions::inverse_kinematics::InverseKinematics;
use crate::positions::needs_positions;
use crate::positions::newton::Newton;
use crate::record::Correction;
use crate::system::{ConstrainedSystem, SystemError, SystemRef};
use crate::tangent::all::AllVelocities;
use crate::tangent::basis::{Basis, Rule};
use crate::tangent::blocks::Blocks;
use crate::tangent::frozen::Frozen;
use crate::tangent::partition::Chosen;
use crate::tangent::user::MappedTangent;
use crate::tangent::TangentLevels;

/// A partition and all coordinates (k + nq states): `projective`, and with an infinite threshold `fixed`.
pub type Projective<'s, S> = Motion<'s, S, Chosen<'s, S>, All>;
/// A partition and its coordinates, the others by Newton's method (2k states).
pub type WehageHaug<'s, S> = Motion<'s, S, Chosen<'s, S>, Independent<Newton>>;
/// Blocks and their inputs, the loops closed by inverse kinematics (2k states).
pub type ExplicitClosing<'s, S> = Motion<'s, S, Blocks<'s, S>, Independent<InverseKinematics>>;
/// A frozen basis and all coordinates.
pub type TangentVelocities<'s, S> = Motion<'s, S, Frozen<'s, S>, All>;
/// A frozen basis and a chart of the closed positions (2k states).
pub type TangentSpace<'s, S> = Motion<'s, S, Frozen<'s, S>, Chart>;
/// The user's basis and all coordinates.
pub type UserTangent<'s, S> = Motion<'s, S, MappedTangent<'s, S>, All>;
/// All coordinates and all velocities, by a rule.
pub type FullState<'s, S> = Motion<'s, S, AllVelocities<'s, S>, All>;

impl<'s, S: ConstrainedSystem> Projective<'s, S> {
    /// For a system of the given rank (see [`crate::start::analyse`]).
    pub fn new(system: impl Into<SystemRef<'s, S>>, rank: usize, options: &FormulationOptions) -> Self {
        let system = system.into();
        let name = if options.switch_threshold.is_finite() { "projective" } else { "fixed" };
        let positions = All::new(system.size(), options.correction);
        let motion = Self::with(name, Chosen::new(system, rank, options), positions);
        match options.correction {
            // it corrects with the factors of the last evaluation
            Correction::Kantorovich => motion,
            _ => motion.compiling(options.compilation),
        }
    }
}

impl<'s, S: ConstrainedSystem> WehageHaug<'s, S> {
    /// For a system of the given rank. There must be no nonholonomic rows. No corrections are needed.
    pub fn new(system: impl Into<SystemRef<'s, S>>, rank: usize, options: &FormulationOptions) -> Result<Self> {
        let system = system.into();
        needs_positions(&*system, "wehage-haug", "integrates as many coordinates as velocities")?;
        let positions = Independent::new(&*system, rank, Newton::default());
        Ok(Self::with("wehage-haug", Chosen::new(system, rank, options), positions))
    }
}

impl<'s, S: ConstrainedSystem> ExplicitClosing<'s, S> {
    /// For a system of the given rank. There must be no nonholonomic rows.
    pub fn new(system: impl Into<SystemRef<'s, S>>, rank: usize, options: &FormulationOptions) -> Result<Self> {
        let system = system.into();
        needs_positions(&*system, "explicit-closing", "computes dependent coordinates from independent ones")?;
        let positions = Independent::new(&*system, rank, InverseKinematics::default());
        Ok(Self::with("explicit-closing", Blocks::new(system, rank, options)?, positions))
    }
}

impl<'s, S: ConstrainedSystem> TangentVelocities<'s, S> {
    /// For a system of the given rank, with S from a rule.
    pub fn new(
        system: impl Into<SystemRef<'s, S>>,
        rank: usize,
        basis: Box<dyn Basis>,
        options: &FormulationOptions,
    ) -> Self {
        let system = system.into();
        let (name, positions) = (basis.name(), All::new(system.size(), options.correction));
        Self::with(name, Frozen::new(system, rank, basis, options.renew), positions)
    }
}

impl<'s, S: ConstrainedSystem> TangentSpace<'s, S> {
    /// For a system of the given rank without nonholonomic rows.
    pub fn new(system: impl Into<SystemRef<'s, S>>, rank: usize, options: &FormulationOptions) -> Result<Self> {
        let system = system.into();
        needs_positions(&*system, "tangent-space", "parametrises closed positions")?;
        let positions = Chart::new(&*system, rank, options.renew)?;
        Ok(Self::with(
            "tangent-space",
            Frozen::new(system, rank, Box::new(Rule::GramSchmidt), options.renew),
            positions,
        ))
    }
}

impl<'s, S: ConstrainedSystem> UserTangent<'s, S> {
    /// For a system of the given rank; needs the user's tangent velocities in the options. Their functions may count
    /// whole turns.
    pub fn new(system: impl Into<SystemRef<'s, S>>, rank: usize, options: &FormulationOptions) -> Result<Self> {
        let system = system.into();
        let Some(map) = &options.tangent else {
            let message =
                "user-tangent needs tangent velocities: give tangent=, the matrix D^T as a function of (t, q)";
            return Err(SystemError::argument("tangent", message.into()));
        };
        let positions = All::new(system.size(), options.correction).whole_turns();
        Ok(Self::with("user-tangent", MappedTangent::new(system, rank, map.clone()), positions))
    }
}

impl<'s, S: ConstrainedSystem> FullState<'s, S> {
    /// For a system of the given rank, with v' and λ from a rule.
    pub fn new(
        system: impl Into<SystemRef<'s, S>>,
        rank: usize,
        rule: Box<dyn AccelerationRule + Send>,
        options: &FormulationOptions,
    ) -> Self {
        let name = rule.name();
        let tangent = AllVelocities::new(system, rank, rule, options);
        let positions = All::new(tangent.seen().size(), tangent.correction);
        Self::with(name, tangent, positions)
    }
}
