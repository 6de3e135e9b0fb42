//! Closing to round-off.

use crate::system::SystemError;

/// Repeat `step` until the loops are closed to round-off or nothing is gained any more; true if `residual` was last asked at
/// the q that is left.
///
/// `residual` tells what is left open at q, `None` if that is round-off; `step` moves q, and false if it did not. Two
/// iterations of Newton's method reach round-off from an interpolation error, one more sees that nothing is gained.
pub(super) fn close_with<X>(
    x: &mut X,
    q: &mut [f64],
    mut residual: impl FnMut(&mut X, &[f64]) -> Result<Option<f64>, SystemError>,
    mut step: impl FnMut(&mut X, &mut [f64]) -> Result<bool, SystemError>,
) -> Result<bool, SystemError> {
    let Some(mut left) = residual(x, q)? else { return Ok(true) };
    let mut last = q.to_vec();
    for _ in 0..8 {
        if !step(x, q)? {
            return Ok(true);
        }
        let Some(now) = residual(x, q)? else { return Ok(true) };
        if now >= left {
            q.copy_from_slice(&last);
            return Ok(false);
        }
        let done = now > 0.25 * left;
        left = now;
        last.copy_from_slice(q);
        if done {
            break;
        }
    }
    Ok(true)
}
