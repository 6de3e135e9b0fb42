//! The public interface of a plan: made once, then [`factor`](Plan::factor) and [`solve`](Plan::solve).

use super::blocks::Block;
use super::choice;
use super::layout::Layout;
use super::program::sparse::SparseScratch;
use super::Pattern;
use crate::scalar::{Real, Scalar};
use crate::tolerance;
use std::convert::Infallible;
use std::sync::Arc;

/// How pivots are chosen and watched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanOptions {
    /// A pivot must reach this fraction of the largest scaled entry in the remainder of its row. Smaller: less fill;
    /// larger: pivots that stay valid longer.
    pub threshold: f64,
    /// A pivot that falls below this fraction of its value at planning requires a new plan.
    pub guard: f64,
    /// A scaled pivot must be larger than this.
    pub null: f64,
    /// Whether rows that have lost most of their size wait for stronger ones, because they may depend on them. In a regular
    /// matrix they lose it to stiffness, and waiting costs fill.
    pub waits: bool,
}

/// Least pivot relative to the largest entry of its row. Unit: ratio. Reason: the threshold of sparse
/// elimination, which bounds the growth by ten in a step.
const PIVOT_THRESHOLD: f64 = 0.1;
/// A pivot that shrinks below this requires a new plan. Scale: the pivot when the plan was made. Reason: two digits are
/// lost then.
const PIVOT_GUARD: f64 = 1e-2;

/// A guard over its pivot, below which the comparison of both does not depend on rounding. Scale: ratio. Reason: a
/// reciprocal and a product round by less than 1e-15.
const CLEARLY_ABOVE: f64 = 1.0 - 1e-9;

impl Default for PlanOptions {
    fn default() -> Self {
        Self { threshold: PIVOT_THRESHOLD, guard: PIVOT_GUARD, null: tolerance::NULL_VALUE, waits: true }
    }
}

/// Why no plan could be made.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PlanError {
    /// The eligible rows and columns do not hold enough pivots.
    #[error(
        "only {found} of {wanted} pivots found; the largest scaled entry left is {best:e}: offer more columns, or lower the rank"
    )]
    RankDeficient {
        /// Pivots found.
        found: usize,
        /// Number of pivots requested.
        wanted: usize,
        /// Largest scaled entry that was left.
        best: f64,
    },
    /// A value or a scale is NaN or infinite.
    #[error("row {row} has a value or a scale that is not finite")]
    NotFinite {
        /// The row.
        row: usize,
    },
}

/// A pivot left the range its plan was made for.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("pivot {step} has shrunk from {reference:e} to {pivot:e}: make a new plan, or another partition")]
pub struct PivotShrunk {
    /// The step of the elimination.
    pub step: usize,
    /// The present pivot.
    pub pivot: f64,
    /// Its magnitude when the plan was made.
    pub reference: f64,
}

/// Elimination of a sparse `C_D` (rank×rank block of C) in a fixed order.
///
/// Unknowns and equations are numbered by step: step k pairs row `pivot_rows()[k]` with column `pivot_cols()[k]`.
/// Making a plan costs a numeric sparse elimination with search; a factorisation costs its multiplications, without
/// allocation or branches other than the guard. Dependent rows are skipped while better ones remain.
#[derive(Clone, Debug)]
pub struct Plan {
    layout: Arc<Layout>,
    smallest_pivot: f64,
    /// Pivot magnitudes when the plan was made, and the least allowed.
    references: Vec<f64>,
    guards: Vec<f64>,
}

impl Plan {
    /// Whether both eliminate and watch alike.
    pub fn is_same(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.layout, &other.layout) && self.references == other.references && self.guards == other.guards
    }

    /// Chooses `rank` pivots of the matrix with the given pattern and values and records the elimination.
    ///
    /// Only rows and columns marked eligible are used; sizes are judged on `row_scale[i] · |c_ij| · col_scale[j]`,
    /// where rows should be of order 1. Among acceptable pivots (see [`PlanOptions::threshold`]) the one that fills in
    /// least is taken, then the largest. Rank up to 64: all candidates are compared; above: those of lowest count.
    ///
    /// # Errors
    /// [`PlanError::RankDeficient`] if fewer pivots above 1e-10 (scaled) exist, [`PlanError::NotFinite`] on bad values.
    ///
    /// # Panics
    /// If a length contradicts the pattern.
    pub fn new(
        pattern: &Pattern,
        values: &[f64],
        eligible_rows: &[bool],
        eligible_cols: &[bool],
        row_scale: &[f64],
        col_scale: &[f64],
        rank: usize,
        options: PlanOptions,
    ) -> Result<Plan, PlanError> {
        assert_eq!(values.len(), pattern.nnz(), "one value per entry");
        assert_eq!(eligible_rows.len(), pattern.rows, "one mark per row");
        assert_eq!(eligible_cols.len(), pattern.cols, "one mark per column");
        assert_eq!(row_scale.len(), pattern.rows, "one scale per row");
        assert_eq!(col_scale.len(), pattern.cols, "one scale per column");
        let steps =
            choice::choose(pattern, values, eligible_rows, eligible_cols, row_scale, col_scale, rank, &options)?;
        let layout = pattern.layouts.of(pattern, &steps);
        let program = &layout.program;
        let mut work = vec![0.0; program.len()];
        let deficient = |(found, best)| PlanError::RankDeficient { found, wanted: rank, best };
        program.factor(values, &mut work, |k, pivot: f64| above(f64::MIN_POSITIVE, k, pivot)).map_err(deficient)?;
        let references: Vec<f64> = (0..rank).map(|k| 1.0 / work[program.pivot_place(k)].abs()).collect();
        Ok(Plan {
            smallest_pivot: steps.iter().fold(f64::INFINITY, |m, s| m.min(s.size)),
            guards: references.iter().map(|r| options.guard * r).collect(),
            references,
            layout,
        })
    }

    /// Number of pivots.
    pub fn rank(&self) -> usize {
        self.layout.pivot_rows.len()
    }

    /// The row of C each step uses (`rank`).
    pub fn pivot_rows(&self) -> &[usize] {
        &self.layout.pivot_rows
    }

    /// The column of C each step uses (`rank`): the dependent coordinates, in the order of the unknowns.
    pub fn pivot_cols(&self) -> &[usize] {
        &self.layout.pivot_cols
    }

    /// Length of the memory that [`factor`](Plan::factor) fills.
    pub fn factor_len(&self) -> usize {
        self.layout.program.len()
    }

    /// Number of entries in both factors, the pivots counted once.
    pub fn nnz_factors(&self) -> usize {
        self.layout.program.len()
    }

    /// Smallest scaled pivot magnitude met when the plan was made; infinite for rank 0.
    pub fn smallest_pivot(&self) -> f64 {
        self.smallest_pivot
    }

    /// Magnitude of the pivot of step `k` in the factors of the last [`factor`](Self::factor).
    pub fn pivot<T: Scalar>(&self, work: &[T], k: usize) -> T {
        T::one() / work[self.layout.program.pivot_place(k)].abs()
    }

    /// Signs of the determinants of the diagonal blocks of `C_D` and last that of all of it, true for negative, rows
    /// and columns ascending, for the factors of the last [`factor`](Self::factor). The result identifies the blocks:
    /// for the same blocks, a change of sign shows that `C_D` was singular in between; for the same rows and columns,
    /// the last sign does.
    pub fn signs(&self, work: &[f64], out: &mut Vec<bool>) -> u64 {
        out.clear();
        out.extend_from_slice(&self.layout.blocks.odd);
        let mut all = self.layout.blocks.all_odd;
        for (k, &block) in self.layout.blocks.of_step.iter().enumerate() {
            let negative = work[self.layout.program.pivot_place(k)] < 0.0;
            out[block] ^= negative;
            all ^= negative;
        }
        out.push(all);
        self.layout.blocks.signature
    }

    /// The diagonal blocks of `C_D` for the factors of the last [`factor`](Self::factor) of these values; row and column
    /// of step k are multiplied by `scale(k)`. None where `C_D` is one block.
    pub fn blocks(&self, values: &[f64], work: &[f64], scale: impl Fn(usize) -> (f64, f64), out: &mut Vec<Block>) {
        let Layout { program, blocks, .. } = &*self.layout;
        out.clear();
        if blocks.entries.is_empty() {
            return;
        }
        out.resize(blocks.odd.len(), Block::EMPTY);
        for (k, &block) in blocks.of_step.iter().enumerate() {
            let (row, column) = scale(k);
            out[block].add_pivot(row * column / work[program.pivot_place(k)]);
        }
        for [e, k, l] in blocks.entries.iter().map(|x| x.map(|x| x as usize)) {
            out[blocks.of_step[k]].add_entry(scale(k).0 * values[e] * scale(l).1);
        }
    }

    /// Factors `C_D` from the values of C (in the order of the pattern) into `work` (`factor_len()`).
    ///
    /// # Errors
    /// [`PivotShrunk`] if a pivot is below its guard, or not finite; `work` is then of no use.
    #[inline]
    pub fn factor<T: Real>(&self, values: &[T], work: &mut [T]) -> Result<(), PivotShrunk> {
        let guarded = |k: usize, pivot: T| above(self.guards[k], k, pivot.value());
        self.layout.program.factor(values, work, guarded).map_err(|(step, pivot)| self.shrunk(step, pivot))
    }

    /// As `factor`, without inspecting the pivots, for scalars that have no value. Where there is a value,
    /// [`check`](Self::check) determines afterwards whether the plan still applies.
    #[inline]
    pub fn eliminate<T: Scalar>(&self, values: &[T], work: &mut [T]) {
        let all = |_: usize, _: T| Ok::<(), Infallible>(());
        match self.layout.program.factor(values, work, all) {
            Ok(()) => {}
            Err(never) => match never {},
        }
    }

    /// Whether the pivots of the last [`eliminate`](Self::eliminate) exceed their guards.
    pub fn check<T: Real>(&self, work: &[T]) -> Result<(), PivotShrunk> {
        let pivot = |k: usize| 1.0 / work[self.layout.program.pivot_place(k)].value();
        let failed = (0..self.rank()).find_map(|k| above(self.guards[k], k, pivot(k)).err());
        failed.map_or(Ok(()), |(step, pivot)| Err(self.shrunk(step, pivot)))
    }

    /// `1 / pivot` of step `k` in the factors of the last [`eliminate`](Self::eliminate).
    pub fn reciprocal<T: Scalar>(&self, work: &[T], k: usize) -> T {
        work[self.layout.program.pivot_place(k)]
    }

    /// Whether pivots with these [`reciprocals`](Self::reciprocal), one for each step, exceed their guards beyond
    /// rounding.
    pub fn clearly_holds(&self, reciprocals: &[f64]) -> bool {
        let clear = |(x, guard): (&f64, &f64)| x.abs() * guard < CLEARLY_ABOVE;
        reciprocals.len() == self.rank() && reciprocals.iter().zip(&self.guards).all(clear)
    }

    /// The same as a number: above 0 where a pivot of the last [`eliminate`](Self::eliminate) is below its guard.
    pub fn excess<T: Scalar>(&self, work: &[T]) -> T {
        let relative = |k: usize| work[self.layout.program.pivot_place(k)].abs().scale(self.guards[k]);
        (0..self.rank()).fold(T::zero(), |m, k| m.max(relative(k))) - T::one()
    }

    #[cold]
    fn shrunk(&self, step: usize, pivot: f64) -> PivotShrunk {
        PivotShrunk { step, pivot, reference: self.references[step] }
    }

    /// Solves `C_D x = b` in place for `nrhs` right-hand sides, with `work` from [`factor`](Plan::factor).
    ///
    /// `b` (rank×nrhs, row-major): row k belongs to row `pivot_rows()[k]` of C on entry and to the unknown
    /// `pivot_cols()[k]` on return.
    #[inline]
    pub fn solve<T: Scalar>(&self, work: &[T], b: &mut [T], nrhs: usize) {
        match nrhs {
            0 => {}
            1 => self.layout.program.solve_fixed::<T, 1>(work, b),
            2 => self.layout.program.solve_fixed::<T, 2>(work, b),
            3 => self.layout.program.solve_fixed::<T, 3>(work, b),
            4 => self.layout.program.solve_fixed::<T, 4>(work, b),
            _ => self.layout.program.solve_many(work, b, nrhs),
        }
    }

    /// Solves `C_Dᵀ y = b` in place for `nrhs` right-hand sides, with `work` from [`factor`](Plan::factor).
    ///
    /// `b` (rank×nrhs, row-major): row k belongs to column `pivot_cols()[k]` of C on entry and to row `pivot_rows()[k]`
    /// (its multiplier) on return.
    #[inline]
    pub fn solve_transposed<T: Scalar>(&self, work: &[T], b: &mut [T], nrhs: usize) {
        match nrhs {
            0 => {}
            1 => self.layout.program.solve_transposed_fixed::<T, 1>(work, b),
            2 => self.layout.program.solve_transposed_fixed::<T, 2>(work, b),
            3 => self.layout.program.solve_transposed_fixed::<T, 3>(work, b),
            4 => self.layout.program.solve_transposed_fixed::<T, 4>(work, b),
            _ => self.layout.program.solve_transposed_many(work, b, nrhs),
        }
    }

    /// Solves `C_Dᵀ y = b` for a right-hand side with few entries `(step, value)`; into `found` the entries of y that are
    /// not zero, in any order. What cancels to rounding errors of its terms counts as zero.
    ///
    /// Cost: proportional to the rows of the factors that are touched, not to the rank.
    pub fn solve_transposed_sparse(
        &self,
        work: &[f64],
        b: &[(usize, f64)],
        memory: &mut SparseScratch,
        found: &mut Vec<(usize, f64)>,
    ) {
        self.layout.program.solve_transposed_sparse(work, b, memory, found);
    }
}

/// Is the pivot of step k large enough? Written so that NaN and infinity fail as well.
#[inline(always)]
fn above(guard: f64, k: usize, pivot: f64) -> Result<(), (usize, f64)> {
    if (guard..f64::INFINITY).contains(&pivot.abs()) {
        Ok(())
    } else {
        Err((k, pivot))
    }
}

#[cfg(test)]
mod tests;
