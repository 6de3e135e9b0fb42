//! What watches the reduction: how far it is from singular, how open the loops are, how good the choice is.

use super::Reduction;
use crate::partition::criterion::{self, Quality};
use crate::partition::exchange;
use crate::system::{ConstrainedSystem, SystemError};
use partita_math::dense;
use partita_math::elimination::{Pattern, Plan};

/// Redundant rows are chosen anew when what they keep of rank falls below this part of what it was: seldom, and long
/// before rounding suffers.
const FADING: f64 = 0.3;

impl<S: ConstrainedSystem> Reduction<'_, S> {
    /// Smallest scaled pivot of the current plan: how far C_D was from losing rank when it was made.
    pub fn smallest(&self) -> f64 {
        self.plan.as_ref().map_or(1.0, Plan::smallest_pivot)
    }

    /// How far the mechanism is from a singular position at the last tangent: falls linearly to zero towards one. With the
    /// number of the plan it belongs to: values of different choices of coordinates or rows do not compare.
    ///
    /// It is the smallest singular value of C_D, by inverse iteration, times √(1 + |A|²); rows and coordinates are measured
    /// in reaches. Where only the choice of coordinates is singular the one falls as the other grows; where the mechanism
    /// itself is, A stays as it is. Pivots alone would not do: one of them may vanish for the order of elimination only.
    /// Three solves with the factors at hand.
    pub fn distance(&mut self) -> (f64, u64) {
        let x = &mut self.work[..self.rank];
        for (x, &row) in x.iter_mut().zip(&self.partition.rows) {
            // irregular, so that no self-stress of a mechanism is orthogonal to it
            *x = 1.0 + 0.5 * (row as f64 * 1.7).sin();
        }
        let mut given = 1.0;
        let mut answer = 1.0;
        if let Some(plan) = &self.plan {
            for transposed in [false, true, false] {
                given = dense::dot(x, x);
                let rows = self.partition.rows.iter().map(|&i| self.row_reach[i].unwrap_or(1.0));
                let columns = self.partition.dependent.iter().map(|&i| self.reach[i]);
                if transposed {
                    x.iter_mut().zip(columns).for_each(|(x, reach)| *x /= reach);
                    plan.solve_transposed(&self.factors, x, 1);
                    x.iter_mut().zip(rows).for_each(|(x, reach)| *x *= reach);
                } else {
                    x.iter_mut().zip(rows).for_each(|(x, reach)| *x *= reach);
                    plan.solve(&self.factors, x, 1);
                    x.iter_mut().zip(columns).for_each(|(x, reach)| *x /= reach);
                }
                answer = dense::dot(x, x);
            }
        }
        let mut mixed = 1.0;
        for (p, &d) in self.partition.dependent.iter().enumerate() {
            for (a, &i) in self.a_matrix[p * self.k..(p + 1) * self.k].iter().zip(&self.partition.independent) {
                mixed += (a * self.reach[i] / self.reach[d]).powi(2);
            }
        }
        ((given * mixed / answer).sqrt(), self.plans)
    }

    fn smallest_pivot(&self) -> (f64, u64) {
        let Some(plan) = &self.plan else { return (1.0, self.plans) };
        let smallest = (0..self.rank).fold(f64::INFINITY, |m: f64, k| {
            let (row, column) = (self.partition.rows[k], self.partition.dependent[k]);
            let open = self.row_reach[row].unwrap_or(1.0);
            m.min(plan.pivot(&self.factors, k) * self.reach[column] / open)
        });
        (smallest, self.plans)
    }

    /// Of redundant rows, have those kept come nearer to dependence since they were chosen? Ask after `factor`.
    ///
    /// Such rows lose rank in positions where nothing is wrong with the mechanism; others take their place.
    pub fn rows_fade(&mut self) -> bool {
        if self.rank == self.size.rows || self.rank == 0 {
            return false;
        }
        let (now, _) = self.smallest_pivot();
        let fresh = *self.fresh_distance.get_or_insert(now);
        now < FADING * fresh
    }

    /// Keep other rows for the same partition, at the last position; leaves the tangent there.
    pub fn renew_rows(&mut self, t: f64) -> Result<(), SystemError> {
        let independent = self.partition.independent.clone();
        self.set_partition(t, &independent)?;
        self.tangent(t)
    }

    /// Largest |Φ|; NaN counts as infinite.
    pub fn closure(&self) -> f64 {
        largest(self.phi.iter().copied())
    }

    /// Is Φ zero up to its own round-off?
    pub fn is_closed(&self) -> bool {
        self.phi.iter().zip(&self.noise).all(|(x, n)| x.abs() <= *n)
    }

    /// Largest |Φ_i| and its row, each Φ_i in units of its own round-off; NaN counts as infinite.
    pub fn openness(&self) -> (f64, usize) {
        self.phi.iter().zip(&self.noise).enumerate().fold((0.0, 0), |best: (f64, usize), (i, (x, n))| {
            let open = if x.is_nan() { f64::INFINITY } else { x.abs() / n.max(f64::MIN_POSITIVE) };
            if open > best.0 {
                (open, i)
            } else {
                best
            }
        })
    }

    /// Largest |C v + a| over all rows at the last position with `self.v`.
    pub fn velocity_closure(&self) -> f64 {
        largest(velocity_residuals(self.system.pattern(), &self.c, &self.v, &self.a))
    }

    /// Squared size of row i of C for unit reaches, over what a large move can open it by: 1 for a healthy row.
    pub fn strength(&self, i: usize) -> Option<f64> {
        let pattern = self.system.pattern();
        let reach = self.row_reach[i]?;
        let sum: f64 = pattern.row(i).map(|e| (self.c[e] * self.reach[pattern.col_idx[e]]).powi(2)).sum();
        Some(sum / (reach * reach))
    }

    /// The best exchange at the last tangent.                                              (P6)
    pub fn best_exchange(&self) -> Option<exchange::Exchange> {
        exchange::best(&self.a_matrix, &self.s, &self.partition.dependent, &self.partition.independent)
    }

    /// σ and √μ at the last evaluation.
    pub fn quality(&mut self, t: f64, q: &[f64]) -> Result<Quality, SystemError> {
        quality_of(self.system, t, q, &self.partition.independent, &self.md, &mut self.scratch)
    }

    /// P4 at the last evaluation, with fresh scales.
    pub fn measure(&mut self, t: f64, q: &[f64], rho: &mut [f64]) -> Result<(), SystemError> {
        let mut s2 = vec![0.0; self.size.nv];
        self.system.inverse_mass_diagonal(t, q, &mut self.scratch, &mut s2)?;
        let mut work = vec![0.0; self.k];
        criterion::measure_tangent(&self.dt, self.k, &self.md_factor, &s2, &mut work, rho);
        Ok(())
    }
}

/// Largest |x|; NaN counts as infinite.
pub fn largest(x: impl IntoIterator<Item = f64>) -> f64 {
    x.into_iter().fold(0.0, |m: f64, x| if x.is_nan() { f64::INFINITY } else { m.max(x.abs()) })
}

/// C v + a, row by row, for values of C in pattern order.
pub fn velocity_residuals<'x>(
    pattern: &'x Pattern,
    c: &'x [f64],
    v: &'x [f64],
    a: &'x [f64],
) -> impl Iterator<Item = f64> + 'x {
    a.iter().enumerate().map(|(i, a)| pattern.row(i).map(|e| c[e] * v[pattern.col_idx[e]]).sum::<f64>() + a)
}

/// σ and √μ of independent velocities with the reduced mass matrix M_d at `(t, q)`, the last position of the scratch.
pub fn quality_of<S: ConstrainedSystem>(
    system: &S,
    t: f64,
    q: &[f64],
    independent: &[usize],
    md: &[f64],
    scratch: &mut S::Scratch,
) -> Result<Quality, SystemError> {
    let (n, k) = (system.size().nv, independent.len());
    let mut columns = vec![0.0; n * k];
    system.inverse_mass_columns(t, q, independent, scratch, &mut columns)?;
    let block: Vec<f64> = independent.iter().flat_map(|&i| columns[i * k..(i + 1) * k].iter().copied()).collect();
    let s2: Vec<f64> = (0..k).map(|j| block[j * k + j]).collect();
    Ok(criterion::quality(md, &s2, &block))
}
