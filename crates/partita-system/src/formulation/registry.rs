//! All formulations by name.

use super::baumgarte::Baumgarte;
use super::explicit_closing::ExplicitClosing;
use super::full_state::FullState;
use super::multipliers::Saddle;
use super::options::FormulationOptions;
use super::projective::{Projective, ProjectiveOptions};
use super::proximal::Proximal;
use super::range_space::RangeSpace;
use super::wehage_haug::WehageHaug;
use super::Formulation;
use crate::system::{ConstrainedSystem, SystemError};

/// Names, the default first.
pub const NAMES: &[&str] =
    &["projective", "multipliers", "range-space", "baumgarte", "proximal", "wehage-haug", "explicit-closing"];

/// The formulation of this name for a system of the given rank (see [`crate::start::analyse`]).
pub fn by_name<'s, S: ConstrainedSystem<Scratch: Send>>(
    name: &str,
    system: &'s S,
    rank: usize,
    options: &FormulationOptions,
) -> Result<Box<dyn Formulation + Send + 's>, SystemError> {
    let o = options;
    let projective = || ProjectiveOptions {
        exchange: o.exchange,
        correction: o.correction,
        fixed: o.independent.clone(),
        weights: o.weights.clone(),
    };
    Ok(match name {
        "projective" => Box::new(Projective::new(system, rank, projective())),
        "multipliers" => Box::new(FullState::with_rule(system, rank, Saddle::new(system.size().nv, rank), o)),
        "range-space" => Box::new(RangeSpace::new(system, rank, o)),
        "baumgarte" => Box::new(Baumgarte::new(system, rank, o)?),
        "proximal" => Box::new(Proximal::new(system, rank, o)),
        "wehage-haug" => Box::new(WehageHaug::new(system, rank, projective())?),
        "explicit-closing" => Box::new(ExplicitClosing::new(system, rank, o)?),
        other => {
            let message = format!("there is no formulation \"{other}\"; choose among {}", NAMES.join(", "));
            return Err(SystemError::Request(message));
        }
    })
}
