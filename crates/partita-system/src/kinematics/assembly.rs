//! Closing the loops. There are two tasks: [`close`] finds the closed position nearest to a rough drawing, [`move_to`]
//! moves a closed mechanism by continuation to given coordinates.
//!
//! Both solve min |W (q − q₀)|² under Φ(q, t) = 0 by damped Gauss-Newton steps with sparse rows, the same for three
//! velocities and for thirty thousand. All quantities are in natural scales: displacements in characteristic
//! displacements (a radian, a characteristic length), residuals relative to the closure error of a large displacement.
//! So a mechanism of micrometres and one of a thousand kilometres take the same steps.

mod continuation;
mod descent;
mod messages;
#[cfg(test)]
mod tests;

pub use continuation::move_to;

use crate::manifold::Residuals;
use crate::system::{ConstrainedSystem, SystemError};
use descent::{to_round_off, Descent, Ending};
use partita_math::tolerance;

/// Starts around the drawing that are tried where the drawing itself leads to a local minimum of the closure error:
/// with a chance of one half each, one in ten million is missed.
const STARTS: usize = 24;
/// ... as long as they take no more iterations than this in all: thousands of loops are not tried for minutes.
const PATIENCE: usize = 2000;

/// Result of the assembly.
#[derive(Clone, Copy, Debug, Default)]
pub struct Assembly {
    /// Gauss-Newton iterations in all.
    pub iterations: usize,
    /// Largest |Φ| at the end [rad, or the unit of length of the row].
    pub residual: f64,
    /// Steps taken towards targets.
    pub target_steps: usize,
    /// Starts around the drawing that were tried after the drawing itself.
    pub restarts: usize,
}

/// Close a rough drawing: the nearest position with Φ(q, t) = 0 that damped least-norm steps reach.          (S3)
///
/// `tolerance` is relative: in radians for angles, in parts of each row's characteristic length for displacements; the
/// loops are then closed further, to round-off. Redundant rows are harmless. `locked` velocities keep their coordinate.
/// Loops that come to rest open, or closed with an axis pointing backwards, are tried again from a few starts around
/// the drawing, always the same ones.
///
/// # Errors
/// `Lengths` where every start converges to an open loop: by how much, and which. `Assembly` where the iterations were
/// exhausted before.
pub fn close<S: ConstrainedSystem>(
    system: &S,
    t: f64,
    q: &mut [f64],
    tolerance: f64,
    locked: &[usize],
) -> Result<Assembly, SystemError> {
    let mut d = Descent::new(system, t, q)?;
    d.rows.lock(locked);
    let mut report = Assembly::default();
    let drawn = q.to_vec();
    d.rows.evaluate(q)?;
    d.leave(tolerance * tolerance::NEGLIGIBLE_ERROR);
    d.turn_over(q);
    if d.is_closed() {
        report.residual = d.rows.scaled.residual();
        return Ok(report);
    }
    report.iterations += d.descend(q, &to_round_off(tolerance))?;
    d.accept_last_digits(tolerance::CLOSED_FORM);
    let mut turned = d.turn_over(q);
    // the best of each part of the mechanism over the starts
    let mut best = q.to_vec();
    let mut least = d.parts.clone();
    while !d.is_closed() && report.restarts < STARTS && report.iterations < PATIENCE {
        report.restarts += 1;
        d.start_again(q, &drawn, report.restarts)?;
        report.iterations += d.descend(q, &to_round_off(tolerance))?;
        let over = d.turn_over(q);
        turned = if over.is_empty() { turned } else { over };
        for (i, (least, now)) in least.iter_mut().zip(&d.parts).enumerate() {
            if least.0 != Ending::Closed && (now.0 == Ending::Closed || now.1 < least.1) {
                *least = *now;
                d.rows.keep(i, q, &mut best);
            }
        }
    }
    q.copy_from_slice(&best);
    d.rows.evaluate(q)?;
    if least.iter().any(|(ending, _)| *ending != Ending::Closed) {
        let endings: Vec<Ending> = least.iter().map(|l| l.0).collect();
        return Err(messages::refused(&d.rows, &endings, &turned, &report, tolerance));
    }
    report.residual = d.rows.scaled.residual();
    Ok(report)
}
