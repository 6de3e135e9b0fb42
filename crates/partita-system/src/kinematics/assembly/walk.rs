//! Walking a closed mechanism to given coordinates.

use super::descent::{Descent, Ending};
use super::{close, words, Assembly};
use crate::system::{ConstrainedSystem, SystemError};

/// Largest step towards a target, in reaches.
const STEP: f64 = 0.1;
/// A step that moves a coordinate by this many times its own length has left the branch.
const LEAP: f64 = 5.0;
/// Where steps of this part of the largest do not lead on, the loops resist.
const SHORTEST: f64 = 1e-4;
/// What the linear conditions may take from a step: beyond that they forbid it. A part of the step that errors of the
/// linear solution (its damping against a nearly singular loop) stay below.
const YIELDS: f64 = 1e-3;
/// Steps in all: ten thousand radians.
const LONGEST: usize = 100_000;

struct Target {
    coordinate: usize,
    velocity: usize,
    value: f64,
}

fn read<S: ConstrainedSystem>(system: &S, targets: &[(usize, f64)]) -> Result<Vec<Target>, SystemError> {
    let mut read = Vec::with_capacity(targets.len());
    for &(coordinate, value) in targets {
        let Some(velocity) = system.velocity_of_coordinate(coordinate) else {
            return Err(SystemError::argument(
                "targets",
                format!("coordinate {coordinate} of a turn in space cannot be a target by itself"),
            ));
        };
        if !value.is_finite() {
            return Err(SystemError::argument(
                "targets",
                format!("the target of {} is {value}", system.velocity_name(velocity)),
            ));
        }
        read.push(Target { coordinate, velocity, value });
    }
    Ok(read)
}

/// Walk a closed mechanism to given coordinates `(coordinate, value)` along its own motion, branch kept.
///
/// Steps of at most a tenth of a radian (or reach), each closed again before the next; halved where the loops resist.
/// `tolerance` as in [`close`].
///
/// # Errors
/// With the value reached when the mechanism cannot go there.
pub fn move_to<S: ConstrainedSystem>(
    system: &S,
    t: f64,
    q: &mut [f64],
    targets: &[(usize, f64)],
    tolerance: f64,
) -> Result<Assembly, SystemError> {
    let targets = read(system, targets)?;
    let locked: Vec<usize> = targets.iter().map(|x| x.velocity).collect();
    let mut d = Descent::new(system, t, q, &locked)?;
    let mut report = Assembly::default();
    let mut fraction = 1.0f64;
    let mut here = q.to_vec();
    loop {
        let rest: Vec<f64> = targets.iter().map(|x| (x.value - q[x.coordinate]) / d.scaled.reach[x.velocity]).collect();
        let far = rest.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        if far == 0.0 {
            break;
        }
        let part = (STEP * fraction / far).min(1.0);
        let ahead: Vec<f64> = rest.iter().map(|x| x * part).collect();
        here.copy_from_slice(q);
        if step(&mut d, t, q, &ahead, &locked, tolerance, &mut report)? && !has_leapt(&d, q, &here) {
            report.target_steps += 1;
            fraction = (2.0 * fraction).min(1.0);
            if part == 1.0 {
                // exactly what was asked for, round-off of the steps removed
                targets.iter().for_each(|x| q[x.coordinate] = x.value);
                break;
            }
        } else {
            q.copy_from_slice(&here);
            fraction *= 0.5;
            if fraction < SHORTEST {
                return Err(resisted(&mut d, t, q, &targets, tolerance, &mut report)?);
            }
        }
        if report.target_steps > LONGEST {
            d.evaluate(t, q)?;
            return Err(words::open(&d, &report, tolerance, "the target is too many turns away"));
        }
    }
    let last = close(system, t, q, tolerance, &locked)?;
    report.iterations += last.iterations;
    report.residual = last.residual;
    Ok(report)
}

/// One step ahead and the loops closed again; false if the loops do not let it be.
fn step<S: ConstrainedSystem>(
    d: &mut Descent<S>,
    t: f64,
    q: &mut [f64],
    ahead: &[f64],
    locked: &[usize],
    tolerance: f64,
    report: &mut Assembly,
) -> Result<bool, SystemError> {
    d.scaled.locked.fill(false);
    d.evaluate(t, q)?;
    let y = d.step_ahead(ahead).to_vec();
    // the linear conditions answer in the least-squares sense: what they cannot do is a limit of the mechanism
    let largest = ahead.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    if locked.iter().zip(ahead).any(|(&v, x)| (y[v] - x).abs() > YIELDS * largest) {
        return Ok(false);
    }
    let dv: Vec<f64> = y.iter().zip(&d.scaled.reach).map(|(y, reach)| y * reach).collect();
    d.scaled.system.step(q, &dv);
    d.scaled.system.normalise(q);
    d.lock(locked);
    report.iterations += d.descend(t, q, tolerance)?;
    report.iterations += d.polish(t, q, |_| true)?;
    Ok(d.worst() <= tolerance)
}

fn has_leapt<S: ConstrainedSystem>(d: &Descent<S>, q: &[f64], here: &[f64]) -> bool {
    (0..here.len()).any(|i| {
        let far = |v: usize| (q[i] - here[i]).abs() > LEAP * STEP * d.scaled.reach[v];
        d.scaled.system.velocity_of_coordinate(i).is_some_and(far)
    })
}

/// Why the walk ends at q: what was reached, and how open the loops are at the targets themselves.
fn resisted<S: ConstrainedSystem>(
    d: &mut Descent<S>,
    t: f64,
    q: &[f64],
    targets: &[Target],
    tolerance: f64,
    report: &mut Assembly,
) -> Result<SystemError, SystemError> {
    let name = |x: &Target| d.scaled.system.velocity_name(x.velocity);
    let reached: Vec<String> =
        targets.iter().map(|x| format!("{} reached {:.6} of {:.6}", name(x), q[x.coordinate], x.value)).collect();
    let mut there = q.to_vec();
    targets.iter().for_each(|x| there[x.coordinate] = x.value);
    d.lock(&targets.iter().map(|x| x.velocity).collect::<Vec<_>>());
    report.iterations += d.descend(t, &mut there, tolerance)?;
    let advice = if d.parts.iter().all(|p| p.ending == Ending::Closed) {
        "another branch closes there, but no motion leads to it from here; give `near` on that branch"
    } else {
        "the loops do not let it go further; ask for less"
    };
    Ok(words::open(d, report, tolerance, &format!("{}: {advice}", reached.join(", "))))
}
