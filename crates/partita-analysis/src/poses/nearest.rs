//! The nearest there is: soft rows as small as the hard ones let them be, by damped least squares.

use super::field::{Duty, Field};
use partita_system::SystemError;

/// Largest move in one iteration, in reaches.
const LARGEST: f64 = 0.3;
const FIRST_DAMPING: f64 = 1e-2;
const LARGEST_DAMPING: f64 = 1e10;
const ITERATIONS: usize = 200;
/// A move this small (in reaches) is the last: what is left is below nine digits.
const LAST: f64 = 1e-9;
/// Changes of the square below this part of it may be round-off...
const FLAT: f64 = 1e-12;
/// ... and then each move is to be this part of the one before.
const SHORTER: f64 = 0.7;
/// Corrections of the hard rows at the start, where they may be far away, and the largest move of each in reaches...
const FAR: (usize, f64) = (60, 0.5);
/// ... and after each move, which keeps them nearly: more would be another branch.
const NEAR: (usize, f64) = (8, 0.15);
/// Hard rows are kept to this, in reaches.
const KEPT: f64 = 1e-11;

/// Move q to where the soft rows have their least sum of squares with the hard rows kept; what is left of it.
///
/// # Errors
/// Those of functions that the conditions call.
pub(super) fn nearest(f: &mut Field, q: &mut Vec<f64>, aims: &[f64]) -> Result<f64, SystemError> {
    let mut r = vec![0.0; f.phi.len()];
    let mut trial = q.clone();
    if !restore(f, &mut trial, aims, &mut r, FAR)? {
        trial.clone_from(q);
        f.evaluate(q, aims)?;
    }
    q.clone_from(&trial);
    let (mut square, mut damping, mut before) = (f.square(), FIRST_DAMPING, f64::INFINITY);
    for _ in 0..ITERATIONS {
        if square == 0.0 || damping > LARGEST_DAMPING {
            break;
        }
        f.evaluate(q, aims)?;
        f.factor(damping * square.min(1.0));
        let mut largest = f.newton(&mut r);
        let part = (LARGEST / largest).min(1.0);
        largest *= part;
        let y = f.y.clone();
        trial.clone_from(q);
        f.step(&mut trial, part);
        let kept = restore(f, &mut trial, aims, &mut r, NEAR)?;
        let now = f.square();
        // at its least the square is flat and tells nothing any more: there moves that become shorter are good ones
        let flat = (square - now).abs() <= FLAT * square;
        if kept && (if flat { largest <= SHORTER * before } else { now < square }) {
            square = now;
            before = largest;
            q.clone_from(&trial);
            damping *= if flat { 1.0 } else { 0.3 };
            if largest <= LAST {
                break;
            }
        } else {
            f.y.copy_from_slice(&y);
            if largest <= LAST {
                break;
            }
            damping *= 4.0;
        }
    }
    f.evaluate(q, aims)?;
    Ok(square)
}

/// The hard rows closed again, the soft ones left alone; false where they do not let themselves be closed from here.
fn restore(
    f: &mut Field,
    q: &mut [f64],
    aims: &[f64],
    r: &mut [f64],
    (corrections, move_of): (usize, f64),
) -> Result<bool, SystemError> {
    let duty = f.duty.clone();
    f.duty.iter_mut().filter(|d| **d == Duty::Soft).for_each(|d| *d = Duty::Idle);
    let mut done = false;
    for _ in 0..corrections {
        match f.evaluate(q, aims) {
            Ok(()) => {}
            Err(SystemError::NotFinite { .. }) => break,
            Err(e) => {
                f.duty = duty;
                return Err(e);
            }
        }
        if f.worst(Duty::Hard) <= KEPT {
            done = true;
            break;
        }
        f.factor(0.0);
        let largest = f.newton(r);
        if largest > move_of && corrections == NEAR.0 {
            break;
        }
        f.step(q, (move_of / largest).min(1.0));
    }
    f.duty = duty;
    Ok(done)
}
