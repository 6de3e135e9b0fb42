//! An initial state that violates the constraints: how it is corrected and reported.

use crate::error::AnalysisError;
use partita_math::formatted;
use partita_math::tolerance;
use partita_system::record::Output;
use partita_system::reduction::{velocity_residuals, Reduction};
use partita_system::ConstrainedSystem;

/// Constraint violations of an initial state.
pub struct Seen {
    /// Violated rows of S3 and S4, in words.
    findings: Vec<String>,
    /// Is S3 among them?
    violated: bool,
}

/// Examine an initial state, and refuse one that is not close to one that satisfies the constraints; `r` lends its
/// levels, which are those of that state already if it is `there`.
///
/// # Errors
/// `Argument`, and where the system cannot be evaluated there.
pub(super) fn see<S: ConstrainedSystem>(
    r: &mut Reduction<S>,
    (t, q, v): (f64, &[f64], &[f64]),
    there: bool,
) -> Result<Seen, AnalysisError> {
    let system = r.system.clone();
    let weighs = !system.lacks_mass(); // where all moving bodies have mass, masses do not matter
    if !there {
        r.position(t, q)?;
    }
    if !there || r.weighs_displacements() != weighs {
        r.weigh_displacements(weighs);
        r.refresh_scales(t, q)?;
    }
    let (closure_error, row) = r.closure_error();
    if tolerance::ROUNDING * closure_error >= tolerance::FAR_OPEN {
        return Err(AnalysisError::Argument {
            argument: "initial",
            message: format!(
                "the initial state violates the constraints: {} has a closure error of {}; start from the state \
                 that assemble() returns",
                system.row_name(row),
                formatted(r.phi[row].abs())
            ),
        });
    }
    let (closure_error, row) = r.closure_error();
    let mut findings = Vec::new();
    if closure_error > tolerance::OPEN_ROUNDINGS {
        findings.push(format!("{} has a closure error of {}", system.row_name(row), formatted(r.phi[row].abs())));
    }
    let pattern = system.pattern();
    let residuals = velocity_residuals(pattern, &r.c, v, &r.a);
    let mut worst = (0.0, 0, 0.0);
    for (i, x) in residuals.enumerate() {
        let (mut sum, mut arm) = (r.a[i].abs(), 0.0f64);
        for e in pattern.row(i) {
            sum += (r.c[e] * v[pattern.col_idx[e]]).abs();
            arm = arm.max(r.c[e].abs() * system.characteristic_displacement(pattern.col_idx[e]));
        }
        if x.abs() > tolerance::RATES_MET * sum && x.abs() > tolerance::STANDING * arm && x.abs() / sum > worst.0 {
            worst = (x.abs() / sum, i, x.abs());
        }
    }
    if worst.0 > 0.0 {
        findings.push(format!("{} has a rate error of {} per second", system.row_name(worst.1), formatted(worst.2)));
    }
    Ok(Seen { findings, violated: closure_error > tolerance::OPEN_ROUNDINGS })
}

/// The report on the start (t, q, v), and by how much `first`, the output there, was moved from it.
pub(super) fn note<S: ConstrainedSystem>(
    system: &S,
    Seen { findings, violated }: &Seen,
    (t, q, v): (f64, &[f64], &[f64]),
    first: Option<&Output>,
) -> Option<String> {
    if findings.is_empty() {
        return None;
    }
    let moved = match first.filter(|x| x.t == t) {
        None => "an output at the start shows the correction".into(),
        Some(first) => {
            let names = (0..v.len()).map(|i| system.velocity_name(i));
            let by = largest(names.zip(v.iter().zip(&first.v).map(|(x, y)| (y - x).abs())));
            let far = q.iter().zip(&first.q).fold(0.0, |m: f64, (x, y)| m.max((y - x).abs()));
            let position = if *violated { format!("positions by up to {}, ", formatted(far)) } else { String::new() };
            format!("the first output is corrected: {position}velocities by up to {} ({})", formatted(by.1), by.0)
        }
    };
    Some(format!("the initial state violates the constraints: {}; {moved}", findings.join(", ")))
}

fn largest(all: impl Iterator<Item = (String, f64)>) -> (String, f64) {
    all.fold((String::new(), 0.0), |most, x| if x.1 >= most.1 { x } else { most })
}
