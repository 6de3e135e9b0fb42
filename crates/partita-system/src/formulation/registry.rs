//! All formulations by name.

use super::gram_schmidt::GramSchmidt;
use super::multipliers::Multipliers;
use super::options::FormulationOptions;
use super::projective::{Projective, ProjectiveOptions};
use super::qr::OrthogonalTriangular;
use super::svd::SingularValues;
use super::tangent::TangentVelocities;
use super::tangent_space::TangentSpace;
use super::user_tangent::UserTangent;
use super::zero_eigenvalue::ZeroEigenvalue;
use super::Formulation;
use crate::system::{ConstrainedSystem, SystemError};

/// Names, the default first.
pub const NAMES: &[&str] =
    &["projective", "multipliers", "zero-eigenvalue", "svd", "qr", "gram-schmidt", "tangent-space", "user-tangent"];

/// The formulation of this name for a system of the given rank (see [`crate::start::analyse`]).
pub fn by_name<'s, S: ConstrainedSystem<Scratch: Send>>(
    name: &str,
    system: &'s S,
    rank: usize,
    options: &FormulationOptions,
) -> Result<Box<dyn Formulation + Send + 's>, SystemError> {
    let o = options;
    if !(0.0..=1.0).contains(&o.renew) {
        let message = format!("renew is {}, but a part of the quality when frozen lies in 0..1 (0: never)", o.renew);
        return Err(SystemError::Request(message));
    }
    let frozen = |basis| Box::new(TangentVelocities::new(system, rank, basis, o.correction, o.renew));
    Ok(match name {
        "projective" => Box::new(Projective::new(
            system,
            rank,
            ProjectiveOptions {
                exchange: o.exchange,
                correction: o.correction,
                fixed: o.independent.clone(),
                weights: o.weights.clone(),
            },
        )),
        "multipliers" => Box::new(Multipliers::new(system, rank, o.correction)),
        "zero-eigenvalue" => frozen(Box::new(ZeroEigenvalue)),
        "svd" => frozen(Box::new(SingularValues)),
        "qr" => frozen(Box::new(OrthogonalTriangular)),
        "gram-schmidt" => frozen(Box::new(GramSchmidt)),
        "tangent-space" => Box::new(TangentSpace::new(system, rank, o.renew)?),
        "user-tangent" => match &o.tangent {
            Some(map) => Box::new(UserTangent::new(system, rank, map.clone(), o.correction)),
            None => {
                let message =
                    "user-tangent needs tangent velocities: hand over tangent=, the matrix D^T as a function of (t, q)";
                return Err(SystemError::Request(message.into()));
            }
        },
        other => {
            let message = format!("there is no formulation \"{other}\"; choose among {}", NAMES.join(", "));
            return Err(SystemError::Request(message));
        }
    })
}
