//! Removal of the remainder of S3 for formulations without a partition.

use super::projection::{dense_rows, MassProjection};
use crate::formulation::reduction::Reduction;
use crate::system::{ConstrainedSystem, SystemError};

/// One step `q ← q − M⁻¹ Cᵀ M_c⁻¹ Φ` with the holonomic ones of the kept rows; true if q moved.       (33)
///
/// Nonholonomic rows have no position to correct. Needs a partition in `r` (for the rows) and leaves it at `(t, q)` with
/// velocity zero. Dense: n³/6 + n²m, allocates.
pub fn orthogonal<S: ConstrainedSystem>(r: &mut Reduction<S>, t: f64, q: &mut [f64]) -> Result<bool, SystemError> {
    let size = r.size();
    let n = size.nv;
    let rows: Vec<usize> = r.partition.rows.iter().copied().filter(|&i| i < size.holonomic).collect();
    if rows.is_empty() {
        return Ok(false);
    }
    let zero = vec![0.0; n];
    r.position(t, q)?;
    r.system.velocity(t, q, &zero, &mut r.scratch, &mut r.b)?;
    let (mut mass, mut h) = (vec![0.0; n * n], vec![0.0; n]);
    r.system.dynamics(t, q, &zero, &mut r.scratch, &mut mass, &mut h)?;
    let c = dense_rows(r.system, &r.c, &rows);
    let p = MassProjection::new(r.system, &mass, &c)?;
    let x: Vec<f64> = rows.iter().map(|&i| r.phi[i]).collect();
    r.system.step(q, &p.correction(&x));
    Ok(true)
}

/// Repeat `step` until the loops are closed to round-off or nothing is gained any more; counts the steps taken.
///
/// `residual` tells what is left open at q, `None` if that is round-off; `step` moves q, and false if it did not. Two
/// iterations of Newton's method reach round-off from an interpolation error, one more sees that nothing is gained.
pub fn close_with<X>(
    x: &mut X,
    q: &mut [f64],
    mut residual: impl FnMut(&mut X, &[f64]) -> Result<Option<f64>, SystemError>,
    mut step: impl FnMut(&mut X, &mut [f64]) -> Result<bool, SystemError>,
) -> Result<u32, SystemError> {
    let Some(mut left) = residual(x, q)? else { return Ok(0) };
    let mut last = q.to_vec();
    for steps in 0..8 {
        if !step(x, q)? {
            return Ok(steps);
        }
        let Some(now) = residual(x, q)? else { return Ok(steps + 1) };
        if now >= left {
            q.copy_from_slice(&last);
            return Ok(steps);
        }
        let done = now > 0.25 * left;
        left = now;
        last.copy_from_slice(q);
        if done {
            return Ok(steps + 1);
        }
    }
    Ok(8)
}
