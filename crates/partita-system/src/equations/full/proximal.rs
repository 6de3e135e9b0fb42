//! Multipliers by proximal iteration, on all rows, redundant ones included:
//!
//! ```text
//! λ⁺ = (M_c + ε 1)⁻¹ (ε λ − (b + C M⁻¹ h)),   v' = M⁻¹ (h + Cᵀ λ)
//! ```
//! Catalogue row 23. The regularised matrix is positive definite whatever the rank of C, so no row is dropped and no rank
//! decided; the iteration removes the regularisation again and ends at the v' of the exact equations. Prefer it where the
//! rank is in doubt, as on the way through a singular position. Rows are brought to length 1 in the mass metric first, so
//! that ε means the same in all units.
//!
//! Starting from λ = 0 it ends at the shortest λ in these scales. That makes the answer unique, not physical: where
//! reactions are not determined (R2), they depend on the metric chosen. `Cᵀ λ` and v' do not.

use super::range_space::MassMetric;
use super::{AccelerationRule, Failure, Instant};
use partita_math::dense;
use partita_math::tolerance;

/// Damping of the proximal iteration. Unit: squared sines, in natural scales. Reason: far above the rounding of M_c
/// (1e-16), far below squared sines between healthy rows, which take three iterations then.
const PROXIMAL_DAMPING: f64 = 1e-8;
/// A change of v' that no longer falls is rounding below this. Scale: fraction of v' and the free acceleration. Reason:
/// rows at squared sines near the damping amplify rounding.
const STAGNANT_CHANGE: f64 = 1e-9;
/// After so many iterations a direction of squared sine ε/4 has come to within 1e-8 of its end.
const MOST: u64 = 80;

/// A change that falls by less is repeated without end. Scale: ratio of successive changes. Reason: redundant rows that
/// contradict each other a little, as with every stage that is not quite closed, move one direction by the same amount
/// in each iteration; its squared sine is far below the damping.
const PUMPED_CHANGE: f64 = 0.9;
/// After so many such changes in a row all others have died out, and what they have added is taken back.
const IN_A_ROW: u32 = 3;

/// `v'` and λ by proximal iteration.
pub struct Iteration {
    metric: MassMetric,
    factor: Vec<f64>,
    x: Vec<f64>,
    change: Vec<f64>,
    step: Vec<f64>,
    /// Whether there are rows that others imply.
    redundant: bool,
    unsettled: u64,
    largest: f64,
}

impl Iteration {
    /// Room for n velocities and m rows, some of them `redundant` or not.
    pub fn new(n: usize, m: usize, redundant: bool) -> Self {
        Self {
            metric: MassMetric::new(n, m),
            factor: vec![0.0; m * m],
            x: vec![0.0; m],
            change: vec![0.0; m],
            step: vec![0.0; n],
            redundant,
            unsettled: 0,
            largest: 0.0,
        }
    }
}

impl AccelerationRule for Iteration {
    fn name(&self) -> &'static str {
        "proximal"
    }

    fn takes_all_rows(&self) -> bool {
        true
    }

    fn solve(&mut self, x: &Instant, vdot: &mut [f64], lambda: &mut [f64]) -> Result<u64, Failure> {
        let (m, n) = (x.rows.len(), x.h.len());
        let metric = &mut self.metric;
        metric.set(x)?;
        metric.gram(PROXIMAL_DAMPING, &mut self.factor);
        dense::cholesky(&mut self.factor, m).map_err(|e| Failure::Rows { sine2: e.pivot })?;
        let free = dense::dot(&metric.y, &metric.y).sqrt();
        self.x.fill(0.0);
        let (mut iterations, mut last, mut pumped) = (0, f64::INFINITY, 0);
        loop {
            // λ⁺ − λ = (M_c + ε 1)⁻¹ (−(b + C v')), with the v' of λ
            for i in 0..m {
                self.change[i] = -(metric.b[i] + dense::dot(metric.w(i, n), &metric.y));
            }
            dense::cholesky_solve(&self.factor, m, &mut self.change);
            self.step.fill(0.0);
            for i in 0..m {
                dense::axpy(self.change[i], metric.w(i, n), &mut self.step);
                self.x[i] += self.change[i];
            }
            metric.y.iter_mut().zip(&self.step).for_each(|(y, d)| *y += d);
            iterations += 1;
            // lengths of accelerations in the mass metric; without constraints nothing changes at all
            let size = free.max(dense::dot(&metric.y, &metric.y).sqrt());
            let now = dense::dot(&self.step, &self.step).sqrt();
            if now <= tolerance::SOLUTION_ROUNDING * size || (now >= last && now <= STAGNANT_CHANGE * size) {
                break;
            }
            pumped = if self.redundant && now > PUMPED_CHANGE * last { pumped + 1 } else { 0 };
            if pumped == IN_A_ROW {
                // geometric series with the quotient r: the sum of all changes from the last one
                let r = (now / last).min(1.0);
                let sum: f64 = (0..iterations).map(|k| r.powi(-(k as i32))).sum();
                for (i, change) in self.change.iter().enumerate() {
                    self.x[i] -= sum * change;
                }
                metric.y.iter_mut().zip(&self.step).for_each(|(y, d)| *y -= sum * d);
                break;
            }
            if iterations == MOST || !now.is_finite() {
                self.unsettled += 1;
                self.largest = self.largest.max(now / size);
                break;
            }
            last = now;
        }
        for (i, &row) in x.rows.iter().enumerate() {
            lambda[row] = self.x[i] * metric.scale[i];
        }
        metric.acceleration(vdot);
        Ok(iterations)
    }

    fn notes(&self) -> Vec<String> {
        if self.unsettled == 0 {
            return Vec::new();
        }
        vec![format!(
            "the proximal iteration did not settle within {MOST} iterations in {} evaluations (last change up to \
             {:.1e} of the acceleration): the constraint rows were nearly dependent there, as at a singular \
             position, and the accelerations are those of slightly relaxed constraints",
            self.unsettled, self.largest
        )]
    }
}
