//! All formulations by name.

use super::multipliers::Multipliers;
use super::options::FormulationOptions;
use super::projective::{Projective, ProjectiveOptions};
use super::Formulation;
use crate::system::{ConstrainedSystem, SystemError};

/// Names, the default first.
pub const NAMES: &[&str] = &["projective", "multipliers"];

/// The formulation of this name for a system of the given rank (see [`crate::start::analyse`]).
pub fn by_name<'s, S: ConstrainedSystem<Scratch: Send>>(
    name: &str,
    system: &'s S,
    rank: usize,
    options: &FormulationOptions,
) -> Result<Box<dyn Formulation + Send + 's>, SystemError> {
    let o = options;
    Ok(match name {
        "projective" => Box::new(Projective::new(
            system,
            rank,
            ProjectiveOptions {
                exchange: o.exchange,
                correction: o.correction,
                fixed: o.independent.clone(),
                weights: o.weights.clone(),
                selection: o.selection,
                window: o.window,
            },
        )),
        "multipliers" => Box::new(Multipliers::new(system, rank, o.correction)),
        other => {
            let message = format!("there is no formulation \"{other}\"; choose among {}", NAMES.join(", "));
            return Err(SystemError::Request(message));
        }
    })
}
