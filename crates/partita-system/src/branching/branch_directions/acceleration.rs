//! The accelerations with which a motion leaves a singular position, to third order.

use super::{columns, combined, dot, largest, BranchDirections};
use crate::system::{ConstrainedSystem, SystemError};
use partita_math::dense;

/// Displacements over which third orders are differences. Unit: characteristic displacement. Reason: third powers
/// exceed rounding, fourth powers are a hundredth of them.
const THIRD_ORDER_MOVE: f64 = 0.03;

impl<S: ConstrainedSystem> BranchDirections<'_, S> {
    /// The accelerations with which the motion along `v`, one that [`admits`](Self::admits), leaves (t, q): the limit
    /// of those next to it. None where they are not determined.
    ///
    /// To third order nᵀ Φ(q(t)) = 0 is linear in them; it replaces the row that is dependent here. Its coefficient
    /// comes from differences over displacements of a few hundredths of the characteristic ones, exact to some six
    /// digits.
    ///
    /// # Errors
    /// Where the system cannot be evaluated.
    pub fn acceleration(&self, q: &[f64], v: &[f64]) -> Result<Option<Vec<f64>>, SystemError> {
        let (system, t, n) = (self.system, self.t, v.len());
        let size = system.size();
        let mut scratch = system.scratch();
        let (mut phi, mut c, mut a_rows) =
            (vec![0.0; size.holonomic], vec![0.0; system.pattern().nnz()], vec![0.0; size.rows]);
        system.position(t, q, &mut scratch, &mut phi, &mut c, &mut a_rows)?;
        let mut b = vec![0.0; size.rows];
        system.velocity(t, q, v, &mut scratch, &mut b)?;
        let (mut mass, mut h) = (vec![0.0; n * n], vec![0.0; n]);
        system.dynamics(t, q, v, &mut scratch, &mut mass, &mut h)?;
        let b: Vec<f64> = self.rows.iter().map(|&(i, size)| b[i] / size).collect();
        let mut forced = vec![0.0; n];
        for (left, s, right) in &self.range {
            let part = -dot(left, &b) / s;
            forced.iter_mut().zip(right).for_each(|(f, r)| *f += part * r);
        }
        // K^T (h - M a): the remaining load for the free rates
        let moved = self.mass.matvec(&forced);
        let left: Vec<f64> = h.iter().zip(&self.displacement).zip(&moved).map(|((h, r), m)| h * r - m).collect();
        let kernel = columns(&self.kernel);
        let k = self.k;
        let of: Vec<Vec<f64>> = kernel.iter().map(|d| self.mass.matvec(d)).collect();
        let mut l: Vec<f64> = (0..k * k).map(|e| dot(&kernel[e / k], &of[e % k])).collect();
        if dense::cholesky(&mut l, k).is_err() {
            return Ok(None);
        }
        let mut z: Vec<f64> = kernel.iter().map(|d| dot(d, &left)).collect();
        dense::cholesky_solve(&l, k, &mut z);
        let w: Vec<f64> = v.iter().zip(&self.displacement).map(|(v, r)| v / r).collect();
        let (u, _) = self.rates_of(&w);
        let slope: Vec<f64> = self.bend(&u).1.iter().map(|s| s * self.unit).collect();
        // the third order of n^T phi along v t + forced t^2 / 2, by its odd part
        let apart = (THIRD_ORDER_MOVE / largest(&w).max(f64::MIN_POSITIVE))
            .min((THIRD_ORDER_MOVE / largest(&forced).max(f64::MIN_POSITIVE)).sqrt());
        let mut odd = |e: f64| -> Result<f64, SystemError> {
            let mut sum = 0.0;
            for sign in [1.0, -1.0] {
                let by: Vec<f64> =
                    (0..n).map(|i| sign * e * v[i] + 0.5 * e * e * forced[i] * self.displacement[i]).collect();
                let mut there = q.to_vec();
                system.step(&mut there, &by);
                system.position(t + sign * e, &there, &mut scratch, &mut phi, &mut c, &mut a_rows)?;
                let open = self.rows.iter().zip(&self.lost).map(|(&(i, size), n)| n * phi[i] / size);
                sum += 0.5 * sign * open.sum::<f64>();
            }
            Ok(sum / (e * e * e))
        };
        let third = (4.0 * odd(0.5 * apart)? - odd(apart)?) / 3.0;
        // slope . z = -4 third, by the least change of z in the mass metric
        let mut along = slope.clone();
        dense::cholesky_solve(&l, k, &mut along);
        let part = (-4.0 * third - dot(&slope, &z)) / dot(&slope, &along);
        z.iter_mut().zip(&along).for_each(|(z, a)| *z += part * a);
        let found = self.natural(&combined(&forced, &kernel, &z));
        Ok(found.iter().all(|a| a.is_finite()).then_some(found))
    }
}
