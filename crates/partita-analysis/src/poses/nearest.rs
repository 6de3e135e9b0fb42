//! The nearest position: soft rows minimised subject to the hard ones, by damped least squares.

use super::field::{Field, Soft};
use partita_math::tolerance;
use partita_system::manifold::follow::LONGEST_PREDICTION;
use partita_system::manifold::least_change::LARGEST_MOVE;
use partita_system::manifold::{close, ClosingScratch, Rule};
use partita_system::SystemError;

/// Hard rows at the start, where they may be far away...
const FAR: Rule = Rule::new(60, f64::EPSILON, tolerance::FITS).cut(LARGEST_MOVE);
/// ... and after each step, which nearly preserves them: a correction by more than half of it, or a growing one, would
/// lead to another branch.
const NEAR: Rule =
    Rule::new(8, f64::EPSILON, tolerance::FITS).contracting(tolerance::HALF_LOST * LONGEST_PREDICTION, 1.0);
/// Steps that minimise the soft rows, at most 0.3 characteristic displacements each: after a step of 1e-9 the remainder
/// is below nine digits.
const LEAST: Rule = Rule::new(200, 0.0, 0.0).cut(LONGEST_PREDICTION).to_rest(tolerance::LAST_MOVE);
/// The same to four digits.
const ROUGHLY: Rule = Rule::new(200, 0.0, 0.0).cut(LONGEST_PREDICTION).to_rest(FOUR_DIGITS);
/// Shorter steps change four digits of a position no more. Scale: characteristic displacement. Reason: steps become
/// shorter by half or more.
const FOUR_DIGITS: f64 = 1e-4;

/// Move q to the least sum of squares of the soft rows, subject to the hard rows.
///
/// # Errors
/// The errors of functions that the conditions call.
pub(super) fn nearest(f: &mut Field, q: &mut Vec<f64>, aims: &[f64]) -> Result<(), SystemError> {
    least(f, q, aims, &LEAST)
}

/// As [`nearest`], to four digits.
///
/// # Errors
/// As [`nearest`].
pub(super) fn nearly(f: &mut Field, q: &mut Vec<f64>, aims: &[f64]) -> Result<(), SystemError> {
    least(f, q, aims, &ROUGHLY)
}

fn least(f: &mut Field, q: &mut Vec<f64>, aims: &[f64], rule: &Rule) -> Result<(), SystemError> {
    f.aims.copy_from_slice(aims);
    let (mut trial, y) = (q.clone(), f.y.clone());
    match f.close_hard(&mut trial, &FAR) {
        Ok(closed) if closed.is_closed() => q.clone_from(&trial),
        Ok(_) | Err(SystemError::NotFinite { .. }) => f.y.copy_from_slice(&y),
        Err(e) => return Err(e),
    }
    close(&mut Soft::new(f, NEAR), q, rule, &mut ClosingScratch::default())?;
    Ok(())
}
