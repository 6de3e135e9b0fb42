//! All formulations by name.

use super::baumgarte::Baumgarte;
use super::explicit_closing::ExplicitClosing;
use super::full_state::FullState;
use super::gram_schmidt::GramSchmidt;
use super::multipliers::Saddle;
use super::options::FormulationOptions;
use super::projective::{Projective, ProjectiveOptions};
use super::proximal::Proximal;
use super::qr::OrthogonalTriangular;
use super::range_space::RangeSpace;
use super::svd::SingularValues;
use super::tangent::TangentVelocities;
use super::tangent_space::TangentSpace;
use super::user_tangent::UserTangent;
use super::wehage_haug::WehageHaug;
use super::zero_eigenvalue::ZeroEigenvalue;
use super::Formulation;
use crate::system::{ConstrainedSystem, SystemError};

/// Names, the default first.
pub const NAMES: &[&str] = &[
    "projective",
    "fixed",
    "wehage-haug",
    "explicit-closing",
    "zero-eigenvalue",
    "svd",
    "qr",
    "gram-schmidt",
    "tangent-space",
    "user-tangent",
    "multipliers",
    "range-space",
    "proximal",
    "baumgarte",
];

/// The formulation of this name for a system of the given rank (see [`crate::start::analyse`]).
///
/// # Errors
/// `Request` for a name that is not one of [`NAMES`], and for options that make no sense or that the formulation misses.
pub fn by_name<'s, S: ConstrainedSystem<Scratch: Send>>(
    name: &str,
    system: &'s S,
    rank: usize,
    options: &FormulationOptions,
) -> Result<Box<dyn Formulation + Send + 's>, SystemError> {
    let o = options;
    o.check(system.size().nv)?;
    let projective = |exchange: f64| ProjectiveOptions {
        exchange,
        correction: o.correction,
        fixed: o.independent.clone(),
        weights: o.weights.clone(),
        selection: o.selection,
        window: o.window,
    };
    let frozen = |basis| Box::new(TangentVelocities::new(system, rank, basis, o.correction, o.renew));
    Ok(match name {
        "projective" => Box::new(Projective::new(system, rank, projective(o.exchange))),
        "fixed" => Box::new(Projective::new(system, rank, projective(f64::INFINITY))),
        "wehage-haug" => Box::new(WehageHaug::new(system, rank, projective(o.exchange))?),
        "explicit-closing" => Box::new(ExplicitClosing::new(system, rank, o)?),
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
        "multipliers" => Box::new(FullState::with_rule(system, rank, Saddle::new(system.size().nv, rank), o)),
        "range-space" => Box::new(RangeSpace::new(system, rank, o)),
        "proximal" => Box::new(Proximal::new(system, rank, o)),
        "baumgarte" => Box::new(Baumgarte::new(system, rank, o)?),
        other => {
            let message = format!("there is no formulation \"{other}\"; choose among {}", NAMES.join(", "));
            return Err(SystemError::Request(message));
        }
    })
}

/// Options that were set and that the formulation of this name does not read: to be told, for they change nothing.
///
/// What differs from [`FormulationOptions::default`] counts as set.
pub fn unread(name: &str, options: &FormulationOptions) -> Vec<&'static str> {
    let read: &[&str] = match name {
        "projective" => &["correction", "exchange", "independent", "weights", "selection", "window"],
        "fixed" => &["correction", "independent", "weights", "selection", "window"],
        "wehage-haug" => &["exchange", "independent", "weights", "selection", "window"],
        "explicit-closing" => &["exchange", "independent"],
        "zero-eigenvalue" | "svd" | "qr" | "gram-schmidt" => &["correction", "renew"],
        "tangent-space" => &["renew"],
        "user-tangent" => &["correction", "tangent"],
        "multipliers" | "range-space" | "proximal" => &["correction", "exchange"],
        "baumgarte" => &["baumgarte", "exchange"],
        _ => &[],
    };
    let (o, usual) = (options, FormulationOptions::default());
    let set = [
        ("correction", o.correction != usual.correction),
        ("exchange", o.exchange != usual.exchange),
        ("independent", o.independent.is_some()),
        ("weights", o.weights.is_some()),
        ("selection", o.selection != usual.selection),
        ("window", o.window.is_some()),
        ("baumgarte", o.baumgarte.is_some()),
        ("renew", o.renew != usual.renew),
        ("tangent", o.tangent.is_some()),
    ];
    set.into_iter().filter(|(option, set)| *set && !read.contains(option)).map(|(option, _)| option).collect()
}
