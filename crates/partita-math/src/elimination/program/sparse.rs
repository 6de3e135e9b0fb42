//! The transposed substitution for a right-hand side with few entries, at a cost proportional to the entries touched.

use super::Program;
use crate::tolerance;
use std::collections::BinaryHeap;

/// Memory of [`Plan::solve_transposed_sparse`](crate::elimination::Plan::solve_transposed_sparse), reused.
#[derive(Clone, Debug, Default)]
pub struct SparseScratch {
    /// Value of each unknown, and the sum of the magnitudes of its terms; zero between two solutions.
    value: Vec<f64>,
    magnitude: Vec<f64>,
    waits: Vec<bool>,
    /// Pending steps, the next one on top.
    open: BinaryHeap<i64>,
    /// Steps met so far.
    met: Vec<usize>,
}

impl SparseScratch {
    /// Memory for a plan of this rank.
    pub fn new(rank: usize) -> Self {
        Self {
            value: vec![0.0; rank],
            magnitude: vec![0.0; rank],
            waits: vec![false; rank],
            open: BinaryHeap::with_capacity(rank),
            met: Vec::with_capacity(rank),
        }
    }

    /// Add to unknown `k`, which is final when `turn` is the largest pending step.
    fn add(&mut self, k: usize, x: f64, turn: i64) {
        if x == 0.0 {
            return;
        }
        if self.magnitude[k] == 0.0 {
            self.met.push(k);
        }
        self.value[k] += x;
        self.magnitude[k] += x.abs();
        if !std::mem::replace(&mut self.waits[k], true) {
            self.open.push(turn);
        }
    }

    /// The unknown `k`; zero where its terms cancel.
    fn settled(&mut self, k: usize) -> f64 {
        self.waits[k] = false;
        if self.value[k].abs() <= tolerance::SOLUTION_ROUNDING * self.magnitude[k] {
            self.value[k] = 0.0;
        }
        self.value[k]
    }
}

impl Program {
    /// `Uᵀ Lᵀ y = b` for the entries `(step, value)` of b; those of y that are not zero, in any order.
    pub(in super::super) fn solve_transposed_sparse(
        &self,
        work: &[f64],
        b: &[(usize, f64)],
        memory: &mut SparseScratch,
        found: &mut Vec<(usize, f64)>,
    ) {
        for &(k, x) in b {
            memory.add(k, x, -(k as i64));
        }
        while let Some(turn) = memory.open.pop() {
            let k = -turn as usize;
            let x = memory.settled(k);
            if x == 0.0 {
                continue;
            }
            let line = self.lines[k];
            for p in line.diagonal as usize + 1..line.end as usize {
                let j = self.columns[p] as usize;
                memory.add(j, -work[p] * x, -(j as i64));
            }
        }
        for i in 0..memory.met.len() {
            let k = memory.met[i];
            memory.waits[k] = true;
            memory.open.push(k as i64);
        }
        while let Some(turn) = memory.open.pop() {
            let k = turn as usize;
            let line = self.lines[k];
            let reciprocal = work[line.diagonal as usize];
            let x = memory.settled(k) * reciprocal;
            memory.value[k] = x;
            if x == 0.0 {
                continue;
            }
            for p in line.start as usize..line.diagonal as usize {
                let j = self.columns[p] as usize;
                memory.add(j, -work[p] * x, j as i64);
            }
        }
        found.clear();
        for k in memory.met.drain(..) {
            if memory.value[k] != 0.0 {
                found.push((k, memory.value[k]));
            }
            (memory.value[k], memory.magnitude[k]) = (0.0, 0.0);
        }
    }
}
