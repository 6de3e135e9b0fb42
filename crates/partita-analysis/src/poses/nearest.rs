//! The nearest there is: soft rows as small as the hard ones let them be, by damped least squares.

use super::field::{Duty, Field};
use partita_system::SystemError;

/// Largest move in one iteration, in reaches.
const LARGEST: f64 = 0.5;
const FIRST_DAMPING: f64 = 1e-2;
const LARGEST_DAMPING: f64 = 1e10;
const ITERATIONS: usize = 200;
/// A move this small (in reaches) is the last: what is left is below nine digits.
const LAST: f64 = 1e-9;
/// Corrections of the hard rows after each move.
const CORRECTIONS: usize = 8;
/// Hard rows are kept to this, in reaches.
const KEPT: f64 = 1e-11;

/// Move q to where the soft rows have their least sum of squares with the hard rows kept; what is left of it.
///
/// # Errors
/// Those of functions that the conditions call.
pub(super) fn nearest(f: &mut Field, q: &mut Vec<f64>, aims: &[f64]) -> Result<f64, SystemError> {
    let mut r = vec![0.0; f.phi.len()];
    let mut trial = q.clone();
    if !restore(f, &mut trial, aims, &mut r)? {
        trial.clone_from(q);
        f.evaluate(q, aims)?;
    }
    q.clone_from(&trial);
    let (mut square, mut damping) = (f.square(), FIRST_DAMPING);
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
        let gained = restore(f, &mut trial, aims, &mut r)? && f.square() < square;
        if gained {
            let now = f.square();
            let small = square - now < 1e-14 * square;
            square = now;
            q.clone_from(&trial);
            damping *= 0.3;
            if largest <= LAST || small {
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
fn restore(f: &mut Field, q: &mut [f64], aims: &[f64], r: &mut [f64]) -> Result<bool, SystemError> {
    let duty = f.duty.clone();
    f.duty.iter_mut().filter(|d| **d == Duty::Soft).for_each(|d| *d = Duty::Idle);
    let mut done = false;
    for _ in 0..CORRECTIONS {
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
        if f.newton(r) > LARGEST {
            break;
        }
        f.step(q, 1.0);
    }
    f.duty = duty;
    Ok(done)
}
