//! Which of redundant rows are kept.

use super::Reduction;
use crate::system::ConstrainedSystem;
use partita_math::dense::dot;
use partita_math::rank::{independent_rows, preferred_rows};

/// Squared sine below which a row counts as a combination of the others (scaled, so free of units).
///
/// Rounding in the assembled position leaves about 1e-16 times the condition; true redundancy is seen at 1e-20..1e-25.
pub const REDUNDANT: f64 = 1e-9;

/// Squared part of its reach below which a row is faint: what it closes others leave open by a thousand times as much.
const FAINT: f64 = 1e-6;

impl<S: ConstrainedSystem> Reduction<'_, S> {
    /// Rows a plan may keep: all, or of redundant ones those that are most independent of each other here; drives come
    /// last.
    ///
    /// Rows with a position go before those that hold for velocities only: what is kept then closes every position, and
    /// the velocity rows that say nothing new follow from them.
    pub(crate) fn eligible_rows(&self) -> Vec<bool> {
        let (rows, rank) = (self.size.rows, self.rank);
        if rank == rows {
            return vec![true; rows];
        }
        let pattern = self.system.pattern();
        let mut c = self.c.clone();
        let clear = |c: &mut [f64], i: usize| pattern.row(i).for_each(|e| c[e] = 0.0);
        for i in (0..rows).filter(|&i| self.row_scale[i] == 0.0) {
            clear(&mut c, i); // round-off alone, in whatever direction
        }
        let mut eligible = vec![false; rows];
        // rows that are faint as a whole serve only where no others do: closed by them, others open by as much more
        let faint: Vec<usize> = (0..rows).filter(|&i| self.strength(i).is_some_and(|s| s < FAINT)).collect();
        if self.size.holonomic == rows && !faint.is_empty() {
            let mut strong = c.clone();
            faint.iter().for_each(|&i| clear(&mut strong, i));
            let found = preferred_rows(pattern, &strong, &self.s, REDUNDANT, (REDUNDANT, &|i| self.system.row_is_drive(i)));
            if found.rank >= rank {
                found.kept.iter().take(rank).for_each(|&i| eligible[i] = true);
                return eligible;
            }
        }
        if self.size.holonomic == rows {
            let found = preferred_rows(pattern, &c, &self.s, 0.0, (REDUNDANT, &|i| self.system.row_is_drive(i)));
            if found.rank < rank {
                return vec![true; rows];
            }
            found.kept.iter().take(rank).for_each(|&i| eligible[i] = true);
            return eligible;
        }
        let mut of_positions = c.clone();
        (self.size.holonomic..rows).for_each(|i| clear(&mut of_positions, i));
        let mut kept = independent_rows(pattern, &of_positions, &self.s, REDUNDANT).kept;
        kept.truncate(rank);
        self.add_velocity_rows(&c, &mut kept);
        if kept.len() < rank {
            return vec![true; rows];
        }
        kept.into_iter().for_each(|i| eligible[i] = true);
        eligible
    }

    /// To the rows kept those velocity rows that stand out of their span most, one after the other, up to the rank.
    fn add_velocity_rows(&self, c: &[f64], kept: &mut Vec<usize>) {
        let pattern = self.system.pattern();
        let scaled = |i: usize| {
            let mut row = vec![0.0; self.size.nv];
            pattern
                .row(i)
                .for_each(|e| row[pattern.col_idx[e]] = c[e] * self.s[pattern.col_idx[e]] * self.row_scale[i]);
            row
        };
        let mut basis: Vec<Vec<f64>> = Vec::with_capacity(self.rank);
        for &i in kept.iter() {
            let mut row = scaled(i);
            basis.iter().for_each(|unit| remove(&mut row, unit));
            normalise(&mut row);
            basis.push(row);
        }
        let mut waiting: Vec<(usize, Vec<f64>)> =
            (self.size.holonomic..self.size.rows).map(|i| (i, scaled(i))).collect();
        for unit in &basis {
            waiting.iter_mut().for_each(|(_, row)| remove(row, unit));
        }
        while kept.len() < self.rank {
            let farthest =
                waiting.iter().enumerate().max_by(|x, y| dot(&x.1 .1, &x.1 .1).total_cmp(&dot(&y.1 .1, &y.1 .1)));
            let Some(place) = farthest.map(|x| x.0) else { return };
            let (i, mut unit) = waiting.swap_remove(place);
            if !normalise(&mut unit) {
                return;
            }
            waiting.iter_mut().for_each(|(_, row)| remove(row, &unit));
            kept.push(i);
        }
    }
}

/// The part of `row` along `unit` taken out; twice, so that rounding leaves nothing of it.
fn remove(row: &mut [f64], unit: &[f64]) {
    for _ in 0..2 {
        let along = dot(row, unit);
        row.iter_mut().zip(unit).for_each(|(x, u)| *x -= along * u);
    }
}

/// Length one; false where there is no direction.
fn normalise(row: &mut [f64]) -> bool {
    let length = dot(row, row).sqrt();
    row.iter_mut().for_each(|x| *x /= length.max(f64::MIN_POSITIVE));
    length > 0.0
}
