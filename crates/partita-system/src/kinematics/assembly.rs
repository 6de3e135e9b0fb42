//! Closing the loops. A far start and a near start are different jobs: [`close`] goes from a rough drawing to the
//! nearest closed position, [`move_to`] walks a closed mechanism along its own motion to given coordinates.
//!
//! Both solve min |W (q − q₀)|² under Φ(q, t) = 0 by damped Gauss-Newton steps with sparse rows, the same for three
//! velocities and for thirty thousand. Everything is measured in natural scales: moves in reaches (a radian, a
//! characteristic length), residuals in what a large move opens the row by. So a mechanism of micrometres and one of
//! a thousand kilometres take the same steps.

mod descent;
mod scaled;
mod walk;
mod words;

pub use walk::move_to;

use crate::system::{ConstrainedSystem, SystemError};
use descent::{Descent, Ending};

/// Largest residual that counts as closed, in radians and parts of the characteristic length of each loop: ten thousand
/// times the round-off of one number, which sums along loops of a thousand links stay below.
pub const CLOSED: f64 = 1e-12;

/// A drawing closed to this part of the tolerance is left as it is drawn: what remains is its own round-off.
const AS_DRAWN: f64 = 1e-3;

/// What a drawing with twelve digits leaves open along its loops, and no motion closes: a tenth of what counts as closed.
const LAST_DIGITS: f64 = 1e-10;

/// Starts around the drawing that are tried where the drawing itself leads to a position that is nearest to closing
/// without closing: with a chance of one half each, one in ten million is missed.
const STARTS: usize = 24;
/// ... as long as they take no more iterations than this in all: thousands of loops are not tried for minutes.
const PATIENCE: usize = 2000;

/// What the assembly did.
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
/// Loops that come to rest open, or closed with an axis pointing backwards, are tried again from a few starts around the
/// drawing, always the same ones.
///
/// # Errors
/// `Lengths` where every way ends at rest with the loop open: by how much, and which. `Assembly` where the iterations
/// ran out before.
pub fn close<S: ConstrainedSystem>(
    system: &S,
    t: f64,
    q: &mut [f64],
    tolerance: f64,
    locked: &[usize],
) -> Result<Assembly, SystemError> {
    let mut d = Descent::new(system, t, q, &[])?;
    d.lock(locked);
    let mut report = Assembly::default();
    let drawn = q.to_vec();
    d.evaluate(t, q)?;
    d.judge(tolerance * AS_DRAWN);
    d.turn_over(q);
    if d.open().next().is_none() {
        report.residual = d.scaled.residual();
        return Ok(report);
    }
    let opened: Vec<bool> = d.parts.iter().map(|p| p.ending != Ending::Closed).collect();
    report.iterations += d.descend(t, q, tolerance)?;
    d.accept_last_digits(LAST_DIGITS);
    let mut turned = d.turn_over(q);
    // the best of each part of the mechanism over the starts
    let mut best = q.to_vec();
    let mut least: Vec<(f64, Ending)> = d.parts.iter().map(|p| (p.square, p.ending)).collect();
    let open = |d: &Descent<S>| d.parts.iter().any(|p| p.ending != Ending::Closed);
    while open(&d) && report.restarts < STARTS && report.iterations < PATIENCE {
        report.restarts += 1;
        d.start_again(t, q, &drawn, report.restarts)?;
        report.iterations += d.descend(t, q, tolerance)?;
        let over = d.turn_over(q);
        turned = if over.is_empty() { turned } else { over };
        for (i, (square, ending)) in least.iter_mut().enumerate() {
            let now = &d.parts[i];
            if *ending != Ending::Closed && (now.ending == Ending::Closed || now.square < *square) {
                (*square, *ending) = (now.square, now.ending);
                d.copy_part(i, q, &mut best);
            }
        }
    }
    q.copy_from_slice(&best);
    d.evaluate(t, q)?;
    if least.iter().any(|(_, ending)| *ending != Ending::Closed) {
        let endings: Vec<Ending> = least.iter().map(|l| l.1).collect();
        return Err(words::refused(&d, &endings, &turned, &report, tolerance));
    }
    report.iterations += d.polish(t, q, |i| opened[i])?;
    report.residual = d.scaled.residual();
    Ok(report)
}
