//! Which of redundant rows are kept.

use super::Reduction;
use crate::system::ConstrainedSystem;
use partita_math::rank::{preferred_rows, weighed_rows, RowRank};

/// Squared sine below which a row counts as a combination of the others (scaled, so free of units).
///
/// Rounding in the assembled position leaves about 1e-16 times the condition; true redundancy is seen at 1e-20..1e-25.
pub const REDUNDANT: f64 = 1e-9;

/// Squared sine above which a closing comes before drives, and before rows that hold for velocities only. A redundant closing
/// stands out by less even where positions are closed to 1e-3 alone, as between the ends of a step.
const CLEAR: f64 = 1e-6;

/// A tilt or a misfit of one tolerance adds up to so many to a row, by lever arms and by the joints that share it.
const ADDS_UP: f64 = 3.0;
/// ... and over all positions to so many: both ends of a turn are off, and rows that fade before others take their place make
/// twice as much of it.
const OVER_A_MOTION: f64 = 5.0;

/// What a row adds depends on the rows before it, by less than this factor in all that was tried: what may be a misfit is
/// sought so far beyond the tolerance, and judged by what depends on no choice.
pub const BY_CHOICE: f64 = 10.0;

/// What a row adds at the most, squared and in natural sizes, that says nothing within a drawing tolerance.
pub fn bridged_row(tolerance: f64) -> f64 {
    (ADDS_UP * tolerance).powi(2)
}

/// How far conditions may be open that a tolerance bridges, in parts of their sizes: what it adds up to over a motion, where
/// both ends of a turn may be off.
pub fn bridged_gap(tolerance: f64) -> f64 {
    OVER_A_MOTION * tolerance
}

/// Rows of a mechanism that is not drawn exactly stay in use until others add this many times as much, squared: seldom
/// enough that a motion does not hop between them, and long before the condition suffers.
const STAYS: f64 = 0.3;

impl<S: ConstrainedSystem> Reduction<'_, S> {
    /// Rows a plan may keep: all, or of redundant ones those that are most independent of each other here. Closings come
    /// before drives and rows that hold for velocities only: what is kept then closes every position, and what says nothing
    /// new follows from it.
    pub(crate) fn eligible_rows(&self) -> Vec<bool> {
        let (rows, rank) = (self.size.rows, self.rank);
        if rank == rows {
            return vec![true; rows];
        }
        if self.rows_stay && self.partition.rows.len() == rank {
            let mut eligible = vec![false; rows];
            self.partition.rows.iter().for_each(|&i| eligible[i] = true);
            return eligible;
        }
        let pattern = self.system.pattern();
        let mut c = self.c.clone();
        let clear = |c: &mut [f64], i: usize| pattern.row(i).for_each(|e| c[e] = 0.0);
        for i in (0..rows).filter(|&i| self.row_scale[i] == 0.0) {
            clear(&mut c, i); // round-off alone, in whatever direction
        }
        for i in self.closings_left_out(&c) {
            clear(&mut c, i);
        }
        let last = |i: usize| i >= self.size.holonomic || self.system.row_is_drive(i);
        let found = preferred_rows(pattern, &c, &self.s, 0.0, (CLEAR, &last));
        if found.rank < rank {
            return vec![true; rows];
        }
        let mut eligible = vec![false; rows];
        found.kept.iter().take(rank).for_each(|&i| eligible[i] = true);
        eligible
    }

    /// Where a drawing tolerance may bridge closings: those that the mechanism as it was meant does without. What a row says is
    /// measured by its size, not by its length: a row that is all misfit points somewhere, but says nothing.
    ///
    /// Rows in use stay in use as long as they serve nearly as well as any: others misfit otherwise.
    fn closings_left_out(&self, c: &[f64]) -> Vec<usize> {
        if self.system.drawing_tolerance() <= 0.0 || self.size.holonomic < self.size.rows {
            return Vec::new();
        }
        let fresh = self.by_what_they_add(c);
        if fresh.rank < self.rank {
            return Vec::new();
        }
        let kept = match self.poor_beside(c, &fresh) {
            Some((false, now)) => now.kept,
            _ => fresh.kept,
        };
        let mut left_out: Vec<bool> = (0..self.size.rows).map(|i| !self.system.row_is_drive(i)).collect();
        kept.iter().take(self.rank).for_each(|&i| left_out[i] = false);
        (0..self.size.rows).filter(|&i| left_out[i]).collect()
    }

    /// The rows in use by what they add, and are they poor beside the `fresh` ones? None where there are none in use.
    fn poor_beside(&self, c: &[f64], fresh: &RowRank) -> Option<(bool, RowRank)> {
        if self.partition.rows.len() != self.rank {
            return None;
        }
        let weakest = |x: &RowRank| x.pivots.iter().take(self.rank).fold(f64::INFINITY, |m: f64, x| m.min(*x));
        let mut of_rows = c.to_vec();
        self.dropped.iter().for_each(|&i| of_rows[self.system.pattern().row(i)].fill(0.0));
        let now = self.by_what_they_add(&of_rows);
        Some((now.rank < self.rank || weakest(&now) <= STAYS * weakest(fresh), now))
    }

    /// Would other rows serve far better at the last position, where the drawing misfits?
    pub fn rows_are_poor(&self) -> bool {
        self.poor_beside(&self.c, &self.by_what_they_add(&self.c)).is_some_and(|x| x.0)
    }

    /// Does each of the strongest rows at the last position say more than any that misfits within the drawing tolerance?
    /// Next to a singular position of the mechanism as it was meant the last of them does not: what stands out there is what
    /// was drawn wrongly.
    pub(crate) fn rows_are_clear(&self) -> bool {
        let limit = BY_CHOICE.powi(2) * bridged_row(self.system.drawing_tolerance());
        let found = self.by_what_they_add(&self.c);
        found.rank >= self.rank && found.pivots.iter().take(self.rank).all(|x| *x > limit)
    }

    /// Rows by what they add to those before them, in natural sizes; closings before drives.
    fn by_what_they_add(&self, c: &[f64]) -> RowRank {
        let drive = |i: usize| self.system.row_is_drive(i);
        let sizes = (&self.reach[..], &self.row_size[..]);
        let clear = (BY_CHOICE.powi(2) * bridged_row(self.system.drawing_tolerance())).max(REDUNDANT);
        weighed_rows(self.system.pattern(), c, sizes, 0.0, (clear, &drive))
    }

    /// The same at the last position.
    pub(crate) fn strongest_rows(&self) -> RowRank {
        self.by_what_they_add(&self.c)
    }
}
