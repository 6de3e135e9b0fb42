//! Whether every motion that the constraints allow moves mass. M itself may be singular; `D M Dᵀ` may not.

use crate::reduction::Reduction;
use crate::system::{ConstrainedSystem, SystemError, Tangent};
use partita_math::dense::{self, Matrix};
use partita_math::sorting::sort_by;
use partita_math::tolerance;

/// Number of steps of inverse iteration: each amplifies the least part of the spectrum by the gap to the rest.
const STEPS: usize = 4;
/// Above this number of velocities the dense check is skipped, because the pivots of each evaluation show the same.
const MOST: usize = 2000;
/// Number of coordinates named before the rest is counted.
const NAMED: usize = 8;

/// A motion that moves no mass at `(t, q)`, if there is one: its velocities, the fastest 1 (in characteristic
/// displacements per second).
pub fn unfelt<S: ConstrainedSystem>(
    system: &S,
    t: f64,
    q: &[f64],
    rank: usize,
) -> Result<Option<Vec<f64>>, SystemError> {
    let n = system.size().nv;
    if !system.lacks_mass() || rank >= n || n > MOST {
        return Ok(None);
    }
    let mut r = Reduction::dense(system, rank).weighing_displacements();
    r.first_partition(t, q)?;
    let k = r.k();
    let rest = vec![0.0; n];
    r.system.velocity(t, q, &rest, &mut r.scratch, &mut r.b)?;
    let (mut md, mut hd) = (vec![0.0; k * k], vec![0.0; k]);
    let tangent = Tangent { k, dt: &r.dt, delta: &rest };
    r.system.project(t, q, &rest, &tangent, &mut r.scratch, &mut md, &mut hd)?;
    let mut more = Matrix::new(n, n);
    r.system.add_metric(&mut r.scratch, more.data_mut());
    let d = Matrix::from_vec(n, k, r.dt.clone());
    let more = d.transpose().matmul(&more).matmul(&d);
    let mut metric: Vec<f64> = md.iter().zip(more.data()).map(|(m, e)| m + e).collect();
    if dense::cholesky(&mut metric, k).is_err() {
        return Ok(None); // nothing to hold it against
    }
    // L⁻¹ M_d L⁻ᵀ: 1 where all moving bodies are massive
    let mut half = Matrix::from_vec(k, k, md);
    for _ in 0..2 {
        (0..k).for_each(|i| dense::cholesky_forward(&metric, k, half.row_mut(i)));
        half = half.transpose();
    }
    let share = half;
    let mut factor = share.data().to_vec();
    (0..k).for_each(|i| factor[i * k + i] += tolerance::LOST_PIVOT);
    let mut y: Vec<f64> = (0..k).map(|i| 1.0 + 0.3 * (i as f64 * 1.7).sin()).collect();
    if dense::cholesky(&mut factor, k).is_err() {
        return Ok(None);
    }
    for _ in 0..STEPS {
        dense::cholesky_solve(&factor, k, &mut y);
        let length = dense::dot(&y, &y).sqrt();
        y.iter_mut().for_each(|y| *y /= length);
    }
    if dense::dot(&y, &share.matvec(&y)) > tolerance::LONG_ROUNDING {
        return Ok(None);
    }
    dense::cholesky_backward(&metric, k, &mut y);
    let mut v = d.matvec(&y);
    let fastest = (0..n).max_by(|&i, &j| {
        (v[i].abs() / system.characteristic_displacement(i))
            .total_cmp(&(v[j].abs() / system.characteristic_displacement(j)))
    });
    if let Some(i) = fastest {
        let size = v[i] / system.characteristic_displacement(i);
        v.iter_mut().for_each(|v| *v /= size);
    }
    Ok(Some(v))
}

/// Refuse a start in which some degree of freedom moves no mass, with its joints and bodies.
///
/// # Errors
/// `Unfelt`.
pub fn refuse<S: ConstrainedSystem>(system: &S, t: f64, q: &[f64], rank: usize) -> Result<(), SystemError> {
    match words(system, t, q, rank)? {
        None => Ok(()),
        Some((motion, bodies)) => Err(SystemError::Unfelt { t, motion, bodies }),
    }
}

/// Description of the motion that moves no mass, and the bodies that move in it.
pub fn words<S: ConstrainedSystem>(
    system: &S,
    t: f64,
    q: &[f64],
    rank: usize,
) -> Result<Option<(String, Vec<String>)>, SystemError> {
    let Some(v) = unfelt(system, t, q, rank)? else { return Ok(None) };
    let mut moving: Vec<usize> =
        (0..v.len()).filter(|&i| v[i].abs() > tolerance::TAKES_PART * system.characteristic_displacement(i)).collect();
    sort_by(&mut moving, |&i, &j| {
        (v[j].abs() / system.characteristic_displacement(j))
            .total_cmp(&(v[i].abs() / system.characteristic_displacement(i)))
    });
    let named = moving.iter().take(NAMED).map(|&i| format!("{} at {:.4}", system.velocity_name(i), v[i]));
    let mut motion = named.collect::<Vec<_>>().join(", ");
    if moving.len() > NAMED {
        motion += &format!(" and {} more", moving.len() - NAMED);
    }
    Ok(Some((motion, system.bodies_moved(q, &v))))
}
