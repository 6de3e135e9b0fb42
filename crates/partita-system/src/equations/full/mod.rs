//! The full equations: methods that give `v'` and λ at one instant in all velocities.

pub mod baumgarte;
pub mod proximal;
pub mod range_space;
pub mod saddle;
pub mod sparse;

use partita_math::elimination::Pattern;

/// Everything known at `(t, q, v)` before the accelerations.
#[derive(Clone, Copy)]
pub struct Instant<'a> {
    /// Where C may be nonzero (all rows x n).
    pub pattern: &'a Pattern,
    /// The rows to be used.
    pub rows: &'a [usize],
    /// Number of rows that exist at position level: the first ones.
    pub holonomic: usize,
    /// M (n x n), or its entries in the order of [`AccelerationRule::mass_pattern`].
    pub mass: &'a [f64],
    /// h (n).
    pub h: &'a [f64],
    /// Φ (holonomic).
    pub phi: &'a [f64],
    /// C in pattern order.
    pub c: &'a [f64],
    /// a (all rows).
    pub a: &'a [f64],
    /// b (all rows).
    pub b: &'a [f64],
    /// v (n).
    pub v: &'a [f64],
    /// Scales w of all rows where M is singular, otherwise empty: see [`heavier`](Self::heavier).
    pub scales: &'a [f64],
}

impl Instant<'_> {
    /// Row i of C, written out (n).
    pub fn row(&self, i: usize, out: &mut [f64]) {
        out.fill(0.0);
        for e in self.pattern.row(i) {
            out[self.pattern.col_idx[e]] = self.c[e];
        }
    }

    /// Where M alone is singular: `M + Cᵀ W C` instead of M (n x n) and `h − Cᵀ W b` instead of h, W = diag(w²) over
    /// the rows in use. With `C v' + b = 0` neither v' nor λ changes, and the sum is definite wherever the motion
    /// carries mass.
    pub fn heavier(&self, mass: &mut [f64], h: &mut [f64]) {
        if self.scales.is_empty() {
            return;
        }
        let n = self.h.len();
        for &row in self.rows {
            let weight = self.scales[row] * self.scales[row];
            for e in self.pattern.row(row) {
                let (i, x) = (self.pattern.col_idx[e], weight * self.c[e]);
                h[i] -= x * self.b[row];
                for f in self.pattern.row(row) {
                    mass[i * n + self.pattern.col_idx[f]] += x * self.c[f];
                }
            }
        }
    }

    /// `(C v + a)_i`: the rate of the closure error of row i.
    pub fn closure_error_rate(&self, i: usize) -> f64 {
        self.pattern.row(i).map(|e| self.c[e] * self.v[self.pattern.col_idx[e]]).sum::<f64>() + self.a[i]
    }
}

/// Why a rule found no accelerations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Failure {
    /// M is not positive definite.
    Mass {
        /// The velocity where it was detected.
        index: usize,
        /// Its pivot.
        pivot: f64,
    },
    /// The rows are not independent: squared sine of the angle between one of them and those before it.
    Rows {
        /// The squared sine.
        sine2: f64,
    },
}

/// A rule that gives `v'` and λ with `M v' = h + Cᵀ λ` and `C v' + b = 0` (S1, S5).
///
/// `solve` is called in every evaluation and allocates nothing; memory is prepared when the rule is made.
pub trait AccelerationRule {
    /// Name used in results and messages.
    fn name(&self) -> &'static str;
    /// Whether λ is distributed over redundant rows too.
    fn loads_all_rows(&self) -> bool {
        false
    }
    /// Whether errors of S3 and S4 are corrected after a step.
    fn corrected(&self) -> bool {
        true
    }
    /// `v'` (n) and λ (all rows; entries of rows not used come in as zero). Returns the iterations it took.
    fn solve(&mut self, x: &Instant, vdot: &mut [f64], lambda: &mut [f64]) -> Result<u64, Failure>;
    /// The entries of M the rule needs, if it does not need all of them.
    fn mass_pattern(&self) -> Option<&Pattern> {
        None
    }
    /// The least displacement in the mass metric that closes rows open by `open` (all rows), `−M⁻¹ Cᵀ M_c⁻¹ x`, where
    /// the rule has its own method to compute it.                                                                (35)
    fn least_move(&mut self, _x: &Instant, _open: &[f64], _out: &mut [f64]) -> Option<Result<(), Failure>> {
        None
    }
    /// Elimination plans made.
    fn plans(&self) -> u64 {
        0
    }
    /// Notes for the user, in sentences.
    fn notes(&self) -> Vec<String> {
        Vec::new()
    }
}
