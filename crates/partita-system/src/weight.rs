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
    if !system.structure().lacks_mass || rank >= n || n > MOST {
        return Ok(None);
    }
    let mut r = Reduction::dense(system, rank).weighing_displacements();
    r.first_partition(t, q)?;
    let k = r.k();
    let rest = vec![0.0; n];
    r.system.velocity(t, q, &rest, &mut r.scratch, &mut r.at.b)?;
    let (mut md, mut hd) = (vec![0.0; k * k], vec![0.0; k]);
    let tangent = Tangent { k, dt: &r.at.dt, delta: &rest };
    r.system.project(t, q, &rest, &tangent, &mut r.scratch, &mut md, &mut hd)?;
    let mut more = Matrix::new(n, n);
    r.system.add_metric(&mut r.scratch, more.data_mut());
    let d = Matrix::from_vec(n, k, r.at.dt.clone());
    let more = between(&d, &more);
    // motions that share neither mass nor what it lacks are examined apart
    let mut least: Option<(f64, Vec<usize>, Vec<f64>)> = None;
    for own in sharing(&md, &more, k) {
        if let Some((share, y)) = least_share(&md, &more, k, &own) {
            if least.as_ref().is_none_or(|x| share < x.0) {
                least = Some((share, own, y));
            }
        }
    }
    let Some((_, own, part)) = least.filter(|x| x.0 <= tolerance::LONG_ROUNDING) else { return Ok(None) };
    let mut y = vec![0.0; k];
    own.iter().zip(&part).for_each(|(&i, x)| y[i] = *x);
    let mut v = d.matvec(&y);
    let fastest = (0..n).max_by(|&i, &j| {
        (v[i].abs() / system.structure().displacement(i)).total_cmp(&(v[j].abs() / system.structure().displacement(j)))
    });
    if let Some(i) = fastest {
        let size = v[i] / system.structure().displacement(i);
        v.iter_mut().for_each(|v| *v /= size);
    }
    Ok(Some(v))
}

/// Dᵀ X D, (k x k), of matrices that may be sparse.
fn between(d: &Matrix, x: &Matrix) -> Vec<f64> {
    let (n, k) = (d.rows(), d.cols());
    let entries = |i: usize| d.row(i).iter().enumerate().filter(|e| *e.1 != 0.0);
    let (mut out, mut row) = (vec![0.0; k * k], vec![0.0; k]);
    for i in 0..n {
        row.fill(0.0);
        let mut any = false;
        for (j, x) in x.row(i).iter().enumerate().filter(|e| *e.1 != 0.0) {
            any = true;
            entries(j).for_each(|(b, d)| row[b] += x * d);
        }
        if any {
            entries(i).for_each(|(a, d)| {
                out[a * k..][..k].iter_mut().zip(&row).for_each(|(to, x)| *to += d * x);
            });
        }
    }
    out
}

/// Groups of motions that share entries of M_d or of what it lacks, ascending, of those that lack something.
fn sharing(md: &[f64], more: &[f64], k: usize) -> Vec<Vec<usize>> {
    let mut group = vec![usize::MAX; k];
    let mut found = Vec::new();
    for first in 0..k {
        if group[first] != usize::MAX {
            continue;
        }
        let (mut own, mut next) = (vec![first], 0);
        group[first] = first;
        while let Some(&i) = own.get(next) {
            next += 1;
            for j in 0..k {
                if group[j] == usize::MAX && (md[i * k + j] != 0.0 || more[i * k + j] != 0.0) {
                    group[j] = first;
                    own.push(j);
                }
            }
        }
        if own.iter().any(|&i| more[i * k + i] != 0.0) {
            own.sort_unstable();
            found.push(own);
        }
    }
    found
}

/// The least share of M_d in the metric among these motions, and the motion of it; none where the metric is singular.
fn least_share(md: &[f64], more: &[f64], k: usize, own: &[usize]) -> Option<(f64, Vec<f64>)> {
    let m = own.len();
    let part = |x: &[f64]| -> Vec<f64> { own.iter().flat_map(|&i| own.iter().map(move |&j| x[i * k + j])).collect() };
    let md = part(md);
    let mut metric: Vec<f64> = md.iter().zip(part(more)).map(|(m, e)| m + e).collect();
    dense::cholesky(&mut metric, m).ok()?;
    // L⁻¹ M_d L⁻ᵀ: 1 where all moving bodies are massive
    let mut share = Matrix::from_vec(m, m, md);
    for _ in 0..2 {
        (0..m).for_each(|i| dense::cholesky_forward(&metric, m, share.row_mut(i)));
        share = share.transpose();
    }
    let mut factor = share.data().to_vec();
    (0..m).for_each(|i| factor[i * m + i] += tolerance::LOST_PIVOT);
    let mut y: Vec<f64> = (0..m).map(|i| 1.0 + 0.3 * (i as f64 * 1.7).sin()).collect();
    dense::cholesky(&mut factor, m).ok()?;
    for _ in 0..STEPS {
        dense::cholesky_solve(&factor, m, &mut y);
        let length = dense::dot(&y, &y).sqrt();
        y.iter_mut().for_each(|y| *y /= length);
    }
    let least = dense::dot(&y, &share.matvec(&y));
    dense::cholesky_backward(&metric, m, &mut y);
    Some((least, y))
}

/// Description of the motion that moves no mass, and its velocities.
pub fn words<S: ConstrainedSystem>(
    system: &S,
    t: f64,
    q: &[f64],
    rank: usize,
) -> Result<Option<(String, Vec<f64>)>, SystemError> {
    let Some(v) = unfelt(system, t, q, rank)? else { return Ok(None) };
    let mut moving: Vec<usize> =
        (0..v.len()).filter(|&i| v[i].abs() > tolerance::TAKES_PART * system.structure().displacement(i)).collect();
    sort_by(&mut moving, |&i, &j| {
        (v[j].abs() / system.structure().displacement(j)).total_cmp(&(v[i].abs() / system.structure().displacement(i)))
    });
    let named = moving.iter().take(NAMED).map(|&i| format!("{} at {:.4}", system.structure().velocities[i].name, v[i]));
    let mut motion = named.collect::<Vec<_>>().join(", ");
    if moving.len() > NAMED {
        motion += &format!(" and {} more", moving.len() - NAMED);
    }
    Ok(Some((motion, v)))
}
