//! All formulations by name.

use super::motion::{ExplicitClosing, FullState, Projective, TangentSpace, TangentVelocities, UserTangent, WehageHaug};
use super::Formulation;
use crate::compiled::Compilation;
use crate::equations::full::baumgarte::Stabilised;
use crate::equations::full::proximal::Iteration;
use crate::equations::full::range_space::Range;
use crate::equations::full::saddle::Saddle;
use crate::equations::full::sparse::Sparse;
use crate::equations::full::AccelerationRule;
use crate::error::Result;
use crate::options::FormulationOptions;
use crate::record::Correction;
use crate::system::{ConstrainedSystem, SystemError, SystemRef};
use crate::tangent::basis::Rule;

/// Names, the default first.
pub const NAMES: &[&str] = &[
    "projective",
    "fixed",
    "wehage-haug",
    "explicit-closing",
    "zero-eigenvalue",
    "svd",
    "qr",
    "liang-lance",
    "gram-schmidt",
    "tangent-space",
    "user-tangent",
    "multipliers",
    "sparse-multipliers",
    "range-space",
    "proximal",
    "baumgarte",
];

/// The formulation of this name for a system of the given rank (see [`crate::start::analyse`]).
///
/// # Errors
/// `Argument` for a name that is not one of [`NAMES`], and for options that are invalid or missing.
pub fn by_name<'s, S: ConstrainedSystem<Scratch: Send> + 's>(
    name: &str,
    system: impl Into<SystemRef<'s, S>>,
    rank: usize,
    options: &FormulationOptions,
) -> Result<Box<dyn Formulation + Send + 's>> {
    let system = system.into();
    let (o, size) = (options, system.size());
    o.check(size.nv)?;
    let frozen = |rule| Box::new(TangentVelocities::new(system.clone(), rank, Box::new(rule), o));
    let full = |rule: Box<dyn AccelerationRule + Send>| Box::new(FullState::new(system.clone(), rank, rule, o));
    Ok(match name {
        "projective" => Box::new(Projective::new(system, rank, o)),
        "fixed" => {
            let never = FormulationOptions { switch_threshold: f64::INFINITY, ..o.clone() };
            Box::new(Projective::new(system, rank, &never))
        }
        "wehage-haug" => Box::new(WehageHaug::new(system, rank, o)?),
        "explicit-closing" => Box::new(ExplicitClosing::new(system, rank, o)?),
        "zero-eigenvalue" => frozen(Rule::ZeroEigenvalue),
        "svd" => frozen(Rule::SingularValues),
        "qr" => frozen(Rule::OrthogonalTriangular),
        "liang-lance" => frozen(Rule::LiangLance),
        "gram-schmidt" => frozen(Rule::GramSchmidt),
        "tangent-space" => Box::new(TangentSpace::new(system, rank, o)?),
        "user-tangent" => Box::new(UserTangent::new(system, rank, o)?),
        "multipliers" => full(Box::new(Saddle::new(size.nv, rank))),
        "sparse-multipliers" => full(Box::new(Sparse::new(system.mass_pattern(), system.pattern()))),
        "range-space" => full(Box::new(Range::new(size.nv, rank))),
        "proximal" => full(Box::new(Iteration::new(size.nv, size.rows, rank))),
        "baumgarte" => full(Box::new(Stabilised::new(size.nv, size.rows, rank, o.baumgarte)?)),
        other => {
            let message = format!("there is no formulation \"{other}\"; choose among {}", NAMES.join(", "));
            return Err(SystemError::argument("formulation", message));
        }
    })
}

/// Options that were set but are not used by this formulation, so that they can be reported.
///
/// Options that differ from [`FormulationOptions::default`] count as set.
pub fn unread(name: &str, options: &FormulationOptions) -> Vec<&'static str> {
    let read: &[&str] = match name {
        "projective" => &["correction", "switch_threshold", "independent", "weights", "selection", "window"],
        "fixed" => &["correction", "independent", "weights", "selection", "window"],
        "wehage-haug" => &["switch_threshold", "independent", "weights", "selection", "window"],
        "explicit-closing" => &["switch_threshold", "independent"],
        "zero-eigenvalue" | "svd" | "qr" | "liang-lance" | "gram-schmidt" => &["correction", "renew"],
        "tangent-space" => &["renew"],
        "user-tangent" => &["correction", "tangent"],
        "multipliers" | "sparse-multipliers" | "range-space" | "proximal" => &["correction", "switch_threshold"],
        "baumgarte" => &["baumgarte", "switch_threshold"],
        _ => &[],
    };
    let (o, usual) = (options, FormulationOptions::default());
    let compiles = matches!(name, "projective" | "fixed") && o.correction != Correction::Kantorovich;
    let set = [
        ("correction", o.correction != usual.correction),
        ("switch_threshold", o.switch_threshold != usual.switch_threshold),
        ("independent", o.independent.is_some()),
        ("weights", o.weights.is_some()),
        ("selection", o.selection != usual.selection),
        ("window", o.window.is_some()),
        ("baumgarte", o.baumgarte.is_some()),
        ("renew", o.renew != usual.renew),
        ("tangent", o.tangent.is_some()),
        ("compiled", o.compilation == Compilation::Always && !compiles),
    ];
    set.into_iter().filter(|(option, set)| *set && !read.contains(option)).map(|(option, _)| option).collect()
}
