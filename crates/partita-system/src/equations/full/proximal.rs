//! Multipliers by proximal iteration:
//!
//! ```text
//! λ⁺ = (M_c + ε 1)⁻¹ (ε λ − (b + C M⁻¹ h)),   v' = M⁻¹ (h + Cᵀ λ)                               (R4)
//! ```
//! The regularised matrix is positive definite however close the rows are to dependence, and the
//! iteration removes the regularisation again: it ends at the v' of the exact equations. Where it is slow, ε is too large
//! for the weakest direction and is made smaller. Rows are brought to length 1 in the mass metric first, so that ε means
//! the same in all units.
//!
//! v' follows from the rows kept: redundant ones are open by rounding or by the error of a stage, and along a direction
//! that only they hold the iteration would divide that by next to nothing. λ is then shared among all rows, from λ = 0 to
//! the shortest one in these scales that gives this v'. That makes the answer unique, not physical: where reactions are not
//! determined (R2), they depend on the metric chosen. `Cᵀ λ` and v' do not.

use super::range_space::MassMetric;
use super::{AccelerationRule, Failure, Instant};
use partita_math::dense;
use partita_math::tolerance;

/// Damping of the proximal iteration. Unit: squared sines, in natural scales. Reason: far above the rounding of M_c
/// (1e-16), far below squared sines between healthy rows, which take three iterations then.
const PROXIMAL_DAMPING: f64 = 1e-8;
/// Damping after changes that fall too slowly. Unit: ratio to the damping before. Reason: directions that were halved in
/// each iteration settle in four then.
const DAMPING_LOWERED: f64 = 1e-3;
/// Number of consecutive slow changes that cannot be chance.
const SLOW_IN_A_ROW: u32 = 2;

/// `v'` and λ by proximal iteration.
pub struct Iteration {
    /// All rows.
    metric: MassMetric,
    all: Vec<usize>,
    /// Number of independent rows.
    rank: usize,
    /// `L⁻¹ h`.
    free: Vec<f64>,
    /// `W Wᵀ` of the rows in use, lower triangle, and the factor of the regularised one.
    gram: Vec<f64>,
    factor: Vec<f64>,
    x: Vec<f64>,
    change: Vec<f64>,
    step: Vec<f64>,
}

impl Iteration {
    /// Memory for n velocities and m rows of the given rank.
    pub fn new(n: usize, m: usize, rank: usize) -> Self {
        Self {
            metric: MassMetric::new(n, m),
            all: (0..m).collect(),
            rank,
            free: vec![0.0; n],
            gram: vec![0.0; m * m],
            factor: vec![0.0; m * m],
            x: vec![0.0; m],
            change: vec![0.0; m],
            step: vec![0.0; n],
        }
    }

    /// From λ = 0 to the λ that satisfies these `rows`, left in `x` one by one; `metric.y` holds Lᵀ v' then. The damping is
    /// lowered down to `least` where a change falls slowly. Returns the number of iterations.
    fn converge(&mut self, rows: &[usize], least: f64) -> Result<u64, Failure> {
        let Self { metric, free, gram, factor, x, change, step, .. } = self;
        let (r, n) = (rows.len(), step.len());
        let (x, change) = (&mut x[..r], &mut change[..r]);
        let (gram, factor) = (&mut gram[..r * r], &mut factor[..r * r]);
        for i in 0..r {
            for j in 0..=i {
                gram[i * r + j] = dense::dot(metric.w(rows[i], n), metric.w(rows[j], n));
            }
        }
        metric.y.copy_from_slice(free);
        let length = dense::dot(free, free).sqrt();
        x.fill(0.0);
        let (mut iterations, mut damping) = (0, PROXIMAL_DAMPING);
        loop {
            factor.copy_from_slice(gram);
            (0..r).for_each(|i| factor[i * r + i] += damping);
            dense::cholesky(factor, r).map_err(|e| Failure::Rows { sine2: e.pivot })?;
            let (mut last, mut slow) = (f64::INFINITY, 0);
            while slow < SLOW_IN_A_ROW {
                // λ⁺ − λ = (M_c + ε 1)⁻¹ (−(b + C v')), with the v' of λ
                for (change, &row) in change.iter_mut().zip(rows) {
                    *change = -(metric.b[row] + dense::dot(metric.w(row, n), &metric.y));
                }
                dense::cholesky_solve(factor, r, change);
                step.fill(0.0);
                for ((x, change), &row) in x.iter_mut().zip(change.iter()).zip(rows) {
                    dense::axpy(*change, metric.w(row, n), step);
                    *x += change;
                }
                metric.y.iter_mut().zip(step.iter()).for_each(|(y, d)| *y += d);
                iterations += 1;
                // lengths of accelerations in the mass metric; without constraints nothing changes at all
                let size = length.max(dense::dot(&metric.y, &metric.y).sqrt());
                let now = dense::dot(step, step).sqrt();
                // the caller names what is not finite
                let settled = now <= tolerance::SOLUTION_ROUNDING * size || !now.is_finite();
                if settled || (now >= last && now <= tolerance::NEGLIGIBLE * size) {
                    return Ok(iterations);
                }
                slow = if tolerance::CLEARLY * now > last { slow + 1 } else { 0 };
                last = now;
            }
            if damping <= least {
                return Err(Failure::Rows { sine2: damping });
            }
            damping = (DAMPING_LOWERED * damping).max(least);
        }
    }
}

impl AccelerationRule for Iteration {
    fn name(&self) -> &'static str {
        "proximal"
    }

    fn loads_all_rows(&self) -> bool {
        true
    }

    fn solve(&mut self, x: &Instant, vdot: &mut [f64], lambda: &mut [f64]) -> Result<u64, Failure> {
        let all = std::mem::take(&mut self.all);
        let found = self.solve_with(&all, x, vdot, lambda);
        self.all = all;
        found
    }
}

impl Iteration {
    fn solve_with(&mut self, all: &[usize], x: &Instant, vdot: &mut [f64], lambda: &mut [f64]) -> Result<u64, Failure> {
        self.metric.set_with(x, all)?;
        self.free.copy_from_slice(&self.metric.y);
        let mut iterations = self.converge(x.rows, tolerance::LOST_PIVOT)?;
        for (x, &row) in self.x.iter().zip(x.rows) {
            lambda[row] = x * self.metric.scale[row];
        }
        self.metric.acceleration(vdot);
        if self.rank < all.len() {
            // b as v' gives it: the residual of redundant rows is no motion
            let n = vdot.len();
            for i in 0..all.len() {
                self.metric.b[i] = -dense::dot(self.metric.w(i, n), &self.metric.y);
            }
            // between the ends of steps redundant rows depend on the others only nearly, and it may not converge: the λ of
            // the rows kept stays, which gives the same v' and is as valid
            if let Ok(more) = self.converge(all, PROXIMAL_DAMPING) {
                iterations += more;
                for (lambda, (x, scale)) in lambda.iter_mut().zip(self.x.iter().zip(&self.metric.scale)) {
                    *lambda = x * scale;
                }
            }
        }
        Ok(iterations)
    }
}
