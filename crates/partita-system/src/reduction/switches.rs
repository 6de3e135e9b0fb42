//! The best switch of each cluster, and the columns of A that are computed for it where A is not formed.

use super::{Reduction, NONE};
use crate::partition::switch;
use crate::system::ConstrainedSystem;
use partita_math::tolerance;

/// Columns solved for at a time where A is not formed.
const WIDTH: usize = 8;

/// Memory for examining clusters after a step, and the part of it that belongs to the choice.
#[derive(Clone, Debug, Default)]
pub(super) struct SwitchScratch {
    /// Independent velocity in each packed column, by cluster.
    index: Vec<usize>,
    solves: Vec<Solve>,
    best: Vec<Option<switch::CoordinateSwitch>>,
    columns: Vec<f64>,
}

/// Columns of A of independent velocities whose clusters form no A, some at a time. Velocities that reach no dependent
/// velocity in common share a column.
#[derive(Clone, Debug, Default)]
struct Solve {
    width: usize,
    /// Entries of C: step of the elimination, entry, column.
    entries: Vec<[u32; 3]>,
    /// Entries of A that are not zero: step, column, index in v_I; by steps.
    answers: Vec<[u32; 3]>,
}

impl<S: ConstrainedSystem> Reduction<'_, S> {
    /// The best switch of all at the last tangent.                                       (P6)
    pub fn best_switch(&mut self) -> Option<switch::CoordinateSwitch> {
        let scales = std::mem::take(&mut self.scale.s);
        let all = self.best_switches(&scales, 0.0);
        self.scale.s = scales;
        all.into_iter().reduce(|a, b| if b.gain > a.gain { b } else { a })
    }

    /// The best switch of each cluster at the last tangent, for these scales, those that gain more than `threshold`.
    /// (P6)
    ///
    /// Cost: the entries of A; for clusters that form no A its columns are computed here.
    pub fn best_switches(&mut self, scales: &[f64], threshold: f64) -> Vec<switch::CoordinateSwitch> {
        let p = &self.planned.partition;
        if self.planned.recursion.is_none() {
            let best = switch::best(&self.at.a_matrix, scales, &p.dependent, &p.independent);
            return best.into_iter().filter(|x| x.gain > threshold).collect();
        }
        let SwitchScratch { index, solves, best, columns } = &mut self.memory;
        best.fill(None);
        let mut see = |c: usize, enters: usize, leaves: usize, a: f64| {
            let gain = a.abs() * scales[p.independent[leaves]] / scales[p.dependent[enters]];
            if gain > threshold && best[c].is_none_or(|b| gain > b.gain * (1.0 + tolerance::TIE)) {
                best[c] = Some(switch::CoordinateSwitch { enters, leaves, gain });
            }
        };
        let k = self.planned.columns;
        let of = |i: usize| self.planned.clusters.of_velocity[i] as usize;
        for (e, &d) in p.dependent.iter().enumerate() {
            for c in 0..k {
                let j = index[of(d) * k + c];
                if j != usize::MAX {
                    see(of(d), e, j, self.at.a_matrix[e * k + c]);
                }
            }
        }
        let Some(plan) = &self.planned.plan else { return Vec::new() };
        for Solve { width, entries, answers } in solves.iter() {
            let x = &mut columns[..self.planned.rank * width];
            x.fill(0.0);
            for [step, e, w] in entries.iter().map(|x| x.map(|x| x as usize)) {
                x[step * width + w] = -self.at.c[e];
            }
            plan.solve(&self.at.factors, x, *width);
            for [step, w, j] in answers.iter().map(|x| x.map(|x| x as usize)) {
                see(of(p.dependent[step]), step, j, x[step * width + w]);
            }
        }
        best.iter().flatten().copied().collect()
    }

    /// Lay out the memory for the choice just adopted.
    pub(super) fn lay_out(&mut self) {
        let (k, count) = (self.planned.columns, self.planned.clusters.count);
        let mut index = vec![usize::MAX; count * k];
        for (j, (&i, &c)) in self.planned.partition.independent.iter().zip(&self.planned.column_of).enumerate() {
            if c != NONE {
                index[self.planned.clusters.of_velocity[i] as usize * k + c as usize] = j;
            }
        }
        let solves = self.solves();
        let widest = solves.iter().map(|x| x.width).max().unwrap_or(0);
        self.memory =
            SwitchScratch { index, solves, best: vec![None; count], columns: vec![0.0; self.planned.rank * widest] };
    }

    /// The columns of A that are not formed, as few as there can be one after the other.
    fn solves(&self) -> Vec<Solve> {
        let free: Vec<&(u32, u32, u32)> =
            self.planned.spread_entries.iter().filter(|x| self.planned.column_of[x.2 as usize] == NONE).collect();
        if free.is_empty() {
            return Vec::new();
        }
        let mut by_step = vec![Vec::new(); self.planned.rank];
        free.iter().for_each(|x| by_step[x.0 as usize].push(x.2));
        // which entries of A are not zero, by columns: a dependent velocity follows from its row and from those of the
        // dependent velocities in it
        let system = self.system.clone();
        let pattern = system.pattern();
        let mut step_of = vec![None; self.size.nv];
        self.planned.partition.dependent.iter().enumerate().for_each(|(step, &i)| step_of[i] = Some(step));
        let mut reached = vec![Vec::new(); self.planned.k];
        let mut met = vec![usize::MAX; self.planned.rank];
        let mut open = Vec::new();
        for step in 0..self.planned.rank {
            met[step] = step;
            open.push(step);
            while let Some(s) = open.pop() {
                for &j in &by_step[s] {
                    let own: &mut Vec<usize> = &mut reached[j as usize];
                    if own.last() != Some(&step) {
                        own.push(step);
                    }
                }
                for next in pattern.row(self.planned.partition.rows[s]).filter_map(|e| step_of[pattern.col_idx[e]]) {
                    if std::mem::replace(&mut met[next], step) != step {
                        open.push(next);
                    }
                }
            }
        }
        let column = shared_columns(&reached, self.planned.rank);
        let count = column.iter().zip(&reached).filter(|x| !x.1.is_empty()).map(|x| x.0 + 1).max().unwrap_or(0);
        let mut solves = vec![Solve::default(); count.div_ceil(WIDTH)];
        for (n, solve) in solves.iter_mut().enumerate() {
            solve.width = (count - n * WIDTH).min(WIDTH);
        }
        let short = |j: u32| (column[j as usize] / WIDTH, (column[j as usize] % WIDTH) as u32);
        for &&(step, e, j) in &free {
            let (solve, w) = short(j);
            solves[solve].entries.push([step, e, w]);
        }
        let of = |i: usize| self.planned.clusters.of_velocity[i];
        for (j, steps) in (0..).zip(&reached) {
            let (solve, w) = short(j);
            let own = |step: &&usize| {
                of(self.planned.partition.dependent[**step]) == of(self.planned.partition.independent[j as usize])
            };
            solves[solve].answers.extend(steps.iter().filter(own).map(|&step| [step as u32, w, j]));
        }
        solves.iter_mut().for_each(|x| x.answers.sort_unstable_by_key(|&[step, _, j]| (step, j)));
        solves
    }
}

/// A column for each velocity, none of which holds two that reach a step in common: the first one that is free.
fn shared_columns(reached: &[Vec<usize>], steps: usize) -> Vec<usize> {
    // columns taken in each step, one bit each
    let mut taken: Vec<Vec<u64>> = vec![Vec::new(); steps];
    let mut here: Vec<u64> = Vec::new();
    let mut first_free = |own: &Vec<usize>| {
        here.clear();
        for taken in own.iter().map(|&step| &taken[step]) {
            here.resize(here.len().max(taken.len()), 0);
            here.iter_mut().zip(taken).for_each(|(all, x)| *all |= x);
        }
        let word = here.iter().position(|x| *x != u64::MAX).unwrap_or(here.len());
        let bit = here.get(word).map_or(0, |x| x.trailing_ones());
        for &step in own {
            let taken = &mut taken[step];
            taken.resize(taken.len().max(word + 1), 0);
            taken[word] |= 1 << bit;
        }
        64 * word + bit as usize
    };
    reached.iter().map(&mut first_free).collect()
}
