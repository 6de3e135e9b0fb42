//! Which of redundant rows are kept.

use super::Reduction;
use crate::system::ConstrainedSystem;
use partita_math::rank::{preferred_rows, weighed_rows};

/// A loop closure above this comes before drives, and before rows that hold for velocities only. Scale: squared sine.
/// Reason: a redundant closure is weaker even where positions are closed to 1e-3 alone, as between the ends of a step.
const BEFORE_DRIVES: f64 = 1e-6;

impl<S: ConstrainedSystem> Reduction<'_, S> {
    /// Rows a plan may keep: all, or of redundant ones those that are most independent of each other here. Loop
    /// closures come before drives and rows that hold for velocities only: the kept rows then close every position, and
    /// the others depend on them.
    pub(crate) fn eligible_rows(&self) -> Vec<bool> {
        let (rows, rank) = (self.size.rows, self.planned.rank);
        if rank == rows {
            return vec![true; rows];
        }
        let pattern = self.system.pattern();
        let mut c = self.at.c.clone();
        let clear = |c: &mut [f64], i: usize| pattern.row(i).for_each(|e| c[e] = 0.0);
        for i in (0..rows).filter(|&i| self.scale.row_scale[i] == 0.0) {
            clear(&mut c, i); // round-off alone, in whatever direction
        }
        let last = |i: usize| i >= self.size.holonomic || self.system.structure().rows[i].is_drive;
        if self.system.structure().rows.iter().all(|x| x.displacement.is_some()) {
            // a loop closure that is weak as a whole is kept only where no other serves: closed by it, others would be
            // open by as much more
            let found = weighed_rows(
                pattern,
                &c,
                (&self.scale.displacement, &self.scale.row_size),
                0.0,
                (BEFORE_DRIVES, &last),
            );
            if found.rank >= rank {
                let mut kept = vec![false; rows];
                found.kept.iter().take(rank).for_each(|&i| kept[i] = true);
                (0..rows).filter(|&i| !kept[i] && !last(i)).for_each(|i| clear(&mut c, i));
            }
        }
        let found = preferred_rows(pattern, &c, &self.scale.s, 0.0, (BEFORE_DRIVES, &last));
        if found.rank < rank {
            return vec![true; rows];
        }
        let mut eligible = vec![false; rows];
        found.kept.iter().take(rank).for_each(|&i| eligible[i] = true);
        eligible
    }
}
