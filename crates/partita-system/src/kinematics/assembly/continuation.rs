//! Continuation of a closed mechanism to given coordinates.

use super::descent::nearly;
use super::{close, messages, Assembly};
use crate::manifold::least_change::{near_by, LeastChange};
use crate::manifold::{self, follow, Closed, ClosingScratch, Curve, End, Pace, Residuals, Visit};
use crate::system::{ConstrainedSystem, SystemError};
use partita_math::tolerance;

/// Largest reduction of a step by the linear conditions before they forbid it. Scale: fraction of the step. Reason:
/// errors of the linear solution (its damping against a nearly singular loop) stay below.
const YIELDS: f64 = 1e-3;
/// Maximum number of steps: thirty thousand radians.
const LONGEST: usize = 100_000;

struct Target {
    coordinate: usize,
    velocity: usize,
    value: f64,
}

fn read<S: ConstrainedSystem>(system: &S, targets: &[(usize, f64)]) -> Result<Vec<Target>, SystemError> {
    let mut read = Vec::with_capacity(targets.len());
    for &(coordinate, value) in targets {
        let Some(velocity) = system.structure().coordinates[coordinate].velocity else {
            return Err(SystemError::argument(
                "targets",
                format!(
                    "coordinate {coordinate} is one component of a spatial rotation and cannot be a target by \
                    itself"
                ),
            ));
        };
        if !value.is_finite() {
            return Err(SystemError::argument(
                "targets",
                format!("the target of {} is {value}", system.structure().velocities[velocity].name),
            ));
        }
        read.push(Target { coordinate, velocity, value });
    }
    Ok(read)
}

/// The curve along which the targets vary linearly, from 0 to 1.
struct Towards<'a, 's, S: ConstrainedSystem> {
    rows: &'a mut LeastChange<'s, S>,
    targets: &'a [Target],
    from: Vec<f64>,
    ahead: Vec<f64>,
    locked: &'a [usize],
    tolerance: f64,
    memory: ClosingScratch,
}

impl<S: ConstrainedSystem> Curve for Towards<'_, '_, S> {
    fn direct(&mut self, q: &[f64], _s: f64, tangent: &mut [f64]) -> Result<bool, SystemError> {
        self.rows.scaled.locked.fill(false);
        self.rows.evaluate(q)?;
        self.rows.ahead(&self.ahead, tangent);
        // the linear conditions are solved by least squares: the remainder is a limit of the mechanism
        let largest = self.ahead.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        Ok(!self.locked.iter().zip(&self.ahead).any(|(&v, x)| (tangent[v] - x).abs() > YIELDS * largest))
    }
    fn predict(&mut self, q: &mut [f64], tangent: &[f64], ds: f64) {
        self.rows.go(q, ds, tangent);
    }
    fn close(&mut self, q: &mut [f64], s: f64) -> Result<Closed, SystemError> {
        for (x, from) in self.targets.iter().zip(&self.from) {
            q[x.coordinate] = if s == 1.0 { x.value } else { from + (x.value - from) * s };
        }
        self.rows.lock(self.locked);
        manifold::close(self.rows, q, &near_by(self.tolerance), &mut self.memory)
    }
}

/// Move a closed mechanism to given coordinates `(coordinate, value)` along its own motion, on its branch.
///
/// `tolerance` as in [`close`].
///
/// # Errors
/// With the value that was reached if the mechanism cannot reach the target.
pub fn move_to<S: ConstrainedSystem>(
    system: &S,
    t: f64,
    q: &mut [f64],
    targets: &[(usize, f64)],
    tolerance: f64,
) -> Result<Assembly, SystemError> {
    let targets = read(system, targets)?;
    let locked: Vec<usize> = targets.iter().map(|x| x.velocity).collect();
    let mut rows = LeastChange::new(system, t, q, &locked)?;
    let from: Vec<f64> = targets.iter().map(|x| q[x.coordinate]).collect();
    let displacement = &rows.scaled.displacement;
    let ahead: Vec<f64> =
        targets.iter().zip(&from).map(|(x, from)| (x.value - from) / displacement[x.velocity]).collect();
    let far = ahead.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let mut report = Assembly::default();
    if far > 0.0 {
        let (targets, locked, memory) = (&targets[..], &locked[..], ClosingScratch::default());
        let mut curve = Towards { rows: &mut rows, targets, from, ahead, locked, tolerance, memory };
        let pace = Pace {
            longest: manifold::follow::LONGEST_PREDICTION,
            shortest: tolerance::SHORTEST_STEP.min(0.1 * far),
            steps: LONGEST,
        };
        let done = follow(&mut curve, q, &vec![0.0; system.size().nv], 1.0, &pace, &mut |_, _| Ok(Visit::On))?;
        (report.iterations, report.target_steps) = (done.iterations, done.steps);
        match done.end {
            End::There => {}
            End::Long => {
                rows.evaluate(q)?;
                return Err(messages::not_closed(&rows, &report, tolerance, "the target is too many turns away"));
            }
            _ => return Err(resisted(&mut rows, q, targets, tolerance, &mut report)?),
        }
    }
    let last = close(system, t, q, tolerance, &locked)?;
    report.iterations += last.iterations;
    report.residual = last.residual;
    Ok(report)
}

/// Why the continuation ends at q: the values reached, and the closure error at the targets themselves.
fn resisted<S: ConstrainedSystem>(
    rows: &mut LeastChange<S>,
    q: &[f64],
    targets: &[Target],
    tolerance: f64,
    report: &mut Assembly,
) -> Result<SystemError, SystemError> {
    let name = |x: &Target| &rows.scaled.system.structure().velocities[x.velocity].name;
    let reached: Vec<String> =
        targets.iter().map(|x| format!("{} reached {:.6} of {:.6}", name(x), q[x.coordinate], x.value)).collect();
    let mut there = q.to_vec();
    targets.iter().for_each(|x| there[x.coordinate] = x.value);
    rows.lock(&targets.iter().map(|x| x.velocity).collect::<Vec<_>>());
    let last = manifold::close(rows, &mut there, &nearly(tolerance), &mut ClosingScratch::default())?;
    report.iterations += last.iterations;
    let advice = if last.is_closed() {
        "the loops close there on another branch, but no motion leads to it from here; give `near` on that branch"
    } else {
        "the loops do not allow more; choose a nearer target"
    };
    Ok(messages::not_closed(rows, report, tolerance, &format!("{}: {advice}", reached.join(", "))))
}
