//! An initial state that violates the constraints: how it is corrected and reported.

use super::{Motions, Recipe};
use crate::error::AnalysisError;
use partita_math::formatted;
use partita_math::tolerance;
use partita_system::formulation::Purpose;
use partita_system::record::Output;
use partita_system::reduction::{velocity_residuals, Reduction};
use partita_system::{ConstrainedSystem, SystemRef};

/// Corrections of a start at most. Reason: the first leaves rounding, which the next one leaves as it is.
const CORRECTIONS: usize = 4;

/// Constraint violations of an initial state.
pub struct StartViolations {
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
) -> Result<StartViolations, AnalysisError> {
    let system = r.system.clone();
    let weighs = !system.structure().lacks_mass; // where all moving bodies have mass, masses do not matter
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
                system.structure().rows[row].name,
                formatted(r.at.phi[row].abs())
            ),
        });
    }
    let (closure_error, row) = r.closure_error();
    let mut findings = Vec::new();
    if closure_error > tolerance::OPEN_ROUNDINGS {
        findings.push(format!(
            "{} has a closure error of {}",
            system.structure().rows[row].name,
            formatted(r.at.phi[row].abs())
        ));
    }
    let pattern = system.pattern();
    let residuals = velocity_residuals(pattern, &r.at.c, v, &r.at.a);
    let mut worst = (0.0, 0, 0.0);
    for (i, x) in residuals.enumerate() {
        let (mut sum, mut arm) = (r.at.a[i].abs(), 0.0f64);
        for e in pattern.row(i) {
            sum += (r.at.c[e] * v[pattern.col_idx[e]]).abs();
            arm = arm.max(r.at.c[e].abs() * system.structure().displacement(pattern.col_idx[e]));
        }
        if x.abs() > tolerance::RATES_MET * sum && x.abs() > tolerance::STANDING * arm && x.abs() / sum > worst.0 {
            worst = (x.abs() / sum, i, x.abs());
        }
    }
    if worst.0 > 0.0 {
        findings.push(format!(
            "{} has a rate error of {} per second",
            system.structure().rows[worst.1].name,
            formatted(worst.2)
        ));
    }
    Ok(StartViolations { findings, violated: closure_error > tolerance::OPEN_ROUNDINGS })
}

impl StartViolations {
    /// Whether the state satisfies the constraints.
    pub(super) fn satisfied(&self) -> bool {
        self.findings.is_empty()
    }
}

/// The closed state next to (t, q, v), as a formulation closes it: from it a run starts like from any closed state. A
/// formulation that corrects no positions keeps them.
///
/// # Errors
/// Where nothing can be closed or evaluated there.
pub(super) fn corrected<'s, S: Motions>(
    system: &SystemRef<'s, S>,
    recipe: &Recipe,
    (t, q, v): (f64, &[f64], &[f64]),
) -> Result<(Vec<f64>, Vec<f64>), AnalysisError> {
    let mut output = Output { q: q.to_vec(), v: v.to_vec(), ..Output::default() };
    for _ in 0..CORRECTIONS {
        let (q, v) = (output.q.clone(), output.v.clone());
        // a formulation that starts anew chooses coordinates there as the run will
        let mut formulation = recipe.make(system.clone())?;
        let mut y = vec![0.0; formulation.layout().dim()];
        formulation.start(t, &q, &v, &mut y)?;
        formulation.state_at(t, &y, Purpose::Look, &mut output)?;
        if output.q == q && output.v == v {
            break;
        }
    }
    Ok((output.q, output.v))
}

/// The report on the start (t, q, v), and by how much `first`, the state there, was moved from it.
pub(super) fn note<S: ConstrainedSystem>(
    system: &S,
    StartViolations { findings, violated }: &StartViolations,
    (q, v): (&[f64], &[f64]),
    first: Option<(&[f64], &[f64])>,
) -> Option<String> {
    if findings.is_empty() {
        return None;
    }
    let moved = match first {
        None => "an output at the start shows the correction".into(),
        Some((closed, rates)) => {
            let names = (0..v.len()).map(|i| system.structure().velocity_name(i));
            let by = largest(names.zip(v.iter().zip(rates).map(|(x, y)| (y - x).abs())));
            let far = q.iter().zip(closed).fold(0.0, |m: f64, (x, y)| m.max((y - x).abs()));
            let position = match violated {
                true if far > 0.0 => format!("positions by up to {}, ", formatted(far)),
                true => "positions kept, because the options correct none, ".into(),
                false => String::new(),
            };
            format!(
                "the run starts from the corrected state: {position}velocities by up to {} ({})",
                formatted(by.1),
                by.0
            )
        }
    };
    Some(format!("the initial state violates the constraints: {}; {moved}", findings.join(", ")))
}

fn largest(all: impl Iterator<Item = (String, f64)>) -> (String, f64) {
    all.fold((String::new(), 0.0), |most, x| if x.1 >= most.1 { x } else { most })
}
