//! Multipliers by proximal iteration:
//!
//! ```text
//! λ⁺ = (M_c + ε 1)⁻¹ (ε λ − (b + C M⁻¹ h)),   v' = M⁻¹ (h + Cᵀ λ)
//! ```
//! Catalogue row 23. The regularised matrix is positive definite however close the rows are to dependence, and the
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

/// Damping of the proximal iteration. Scale: squared sines, in natural scales. Reason: far above the rounding of M_c
/// (1e-16), far below squared sines between healthy rows, which take three iterations then.
const PROXIMAL_DAMPING: f64 = 1e-8;
/// Least damping of the proximal iteration. Scale: squared sines, in natural scales. Reason: some hundred roundings of
/// M_c; weaker rows are lost in them.
const LEAST_DAMPING: f64 = 1e-14;
/// Damping after changes that fall too slowly. Scale: ratio to the damping before. Reason: directions that were halved in
/// each iteration settle in four then.
const DAMPING_LOWERED: f64 = 1e-3;
/// A change that decreases by less indicates that the damping is too large. Scale: ratio of successive changes. Reason:
/// an iteration with less damping costs a factorisation, which saves ten such iterations.
const SLOW_CHANGE: f64 = 0.1;
/// A change of v' that no longer falls is rounding below this. Scale: fraction of v' and the free acceleration. Reason:
/// rows at squared sines near the damping amplify rounding.
const STAGNANT_CHANGE: f64 = 1e-9;
/// Number of consecutive slow changes that cannot be chance.
const SLOW_IN_A_ROW: u32 = 2;

/// One iteration's memory, for r rows.
struct Room {
    metric: MassMetric,
    factor: Vec<f64>,
    x: Vec<f64>,
    change: Vec<f64>,
    step: Vec<f64>,
}

/// `v'` and λ by proximal iteration.
pub struct Iteration {
    kept: Room,
    /// All rows, where some are redundant.
    all: Option<(Vec<usize>, Room)>,
}

impl Iteration {
    /// Memory for n velocities and m rows of the given rank.
    pub fn new(n: usize, m: usize, rank: usize) -> Self {
        Self { kept: Room::new(n, rank), all: (rank < m).then(|| ((0..m).collect(), Room::new(n, m))) }
    }
}

impl Room {
    fn new(n: usize, r: usize) -> Self {
        Self {
            metric: MassMetric::new(n, r),
            factor: vec![0.0; r * r],
            x: vec![0.0; r],
            change: vec![0.0; r],
            step: vec![0.0; n],
        }
    }

    /// From λ = 0 to the λ that keeps the rows of the metric, left in `x`; `metric.y` holds Lᵀ v' then. The damping is
    /// lowered down to `least` where a change falls slowly. Returns the iterations it took.
    fn settle(&mut self, least: f64) -> Result<u64, Failure> {
        let Self { metric, factor, x, change, step } = self;
        let (m, n) = (x.len(), step.len());
        let free = dense::dot(&metric.y, &metric.y).sqrt();
        x.fill(0.0);
        let (mut iterations, mut damping) = (0, PROXIMAL_DAMPING);
        loop {
            metric.gram(damping, factor);
            dense::cholesky(factor, m).map_err(|e| Failure::Rows { sine2: e.pivot })?;
            let (mut last, mut slow) = (f64::INFINITY, 0);
            while slow < SLOW_IN_A_ROW {
                // λ⁺ − λ = (M_c + ε 1)⁻¹ (−(b + C v')), with the v' of λ
                for i in 0..m {
                    change[i] = -(metric.b[i] + dense::dot(metric.w(i, n), &metric.y));
                }
                dense::cholesky_solve(factor, m, change);
                step.fill(0.0);
                for i in 0..m {
                    dense::axpy(change[i], metric.w(i, n), step);
                    x[i] += change[i];
                }
                metric.y.iter_mut().zip(step.iter()).for_each(|(y, d)| *y += d);
                iterations += 1;
                // lengths of accelerations in the mass metric; without constraints nothing changes at all
                let size = free.max(dense::dot(&metric.y, &metric.y).sqrt());
                let now = dense::dot(step, step).sqrt();
                if now <= tolerance::SOLUTION_ROUNDING * size || (now >= last && now <= STAGNANT_CHANGE * size) {
                    return Ok(iterations);
                }
                if !now.is_finite() {
                    return Err(Failure::Rows { sine2: f64::NAN });
                }
                slow = if now > SLOW_CHANGE * last { slow + 1 } else { 0 };
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
        let Self { kept, all } = self;
        kept.metric.set(x)?;
        let mut iterations = kept.settle(LEAST_DAMPING)?;
        for (i, &row) in x.rows.iter().enumerate() {
            lambda[row] = kept.x[i] * kept.metric.scale[i];
        }
        if let Some((rows, all)) = all {
            all.metric.set(&Instant { rows, ..*x })?;
            // b as v' gives it: what redundant rows are open by is no motion
            let n = kept.metric.y.len();
            for i in 0..rows.len() {
                all.metric.b[i] = -dense::dot(all.metric.w(i, n), &kept.metric.y);
            }
            // where it does not settle the λ of the rows kept stays, which gives the same v'
            if let Ok(more) = all.settle(PROXIMAL_DAMPING) {
                iterations += more;
                for (i, &row) in rows.iter().enumerate() {
                    lambda[row] = all.x[i] * all.metric.scale[i];
                }
            }
        }
        kept.metric.acceleration(vdot);
        Ok(iterations)
    }
}
