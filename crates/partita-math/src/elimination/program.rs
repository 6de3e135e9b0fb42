//! The recorded elimination: storage of the factors, the list of multiplications, and the substitutions.
//!
//! `C_D = L U` in the order of the steps, U with unit diagonal. Each row is stored in one piece,
//!
//! ```text
//! row k:   l_k0 … l_k,k−1 | 1/pivot_k | u_k,k+1 … u_k,r−1        (present entries only)
//! ```
//!
//! so that both halves of both substitutions run along contiguous memory.

use super::choice::Step;
use super::Pattern;
use crate::scalar::Scalar;
use std::ops::Range;

pub mod sparse;

/// Runs of targets at least this long are executed as a loop over slices.
const RUN: usize = 4;

/// Row k of the factors: offsets `start..diagonal` of L, then the pivot, then U up to `end`.
#[derive(Clone, Copy, Debug)]
struct Line {
    start: u32,
    diagonal: u32,
    end: u32,
}

/// One row of a substitution: which of its entries multiply unknowns found before.
#[derive(Clone, Copy, Debug)]
struct Turn {
    row: u32,
    /// Place of the pivot.
    diagonal: u32,
    /// Entries in the list, without that of the unknown found just before.
    count: u32,
    /// Whether that one has an entry: it stands beside the pivot.
    waits: bool,
}

/// The rows of a substitution in their order, without those that it leaves as they are, and their entries: place in the
/// factors, unknown.
#[derive(Clone, Debug, Default)]
struct Substitution {
    turns: Vec<Turn>,
    entries: Vec<[u32; 2]>,
}

/// `work[target] −= work[l] · work[u]`, for `length` consecutive targets and u.
#[derive(Clone, Copy, Debug)]
struct Run {
    target: u32,
    l: u32,
    u: u32,
    length: u32,
}

/// Number of single updates and of runs after pivot k.
#[derive(Clone, Copy, Debug, Default)]
struct Tally {
    singles: u32,
    runs: u32,
}

/// See the head of the file.
#[derive(Clone, Debug)]
pub(super) struct Program {
    lines: Vec<Line>,
    /// The step whose unknown each stored entry multiplies.
    columns: Vec<u32>,
    /// (place in the factors, place in the values of C).
    scatter: Vec<[u32; 2]>,
    /// Offsets of entries that are zero before the elimination.
    fill: Vec<u32>,
    tallies: Vec<Tally>,
    /// (target, l, u).
    singles: Vec<[u32; 3]>,
    runs: Vec<Run>,
    forward: Substitution,
    /// From the last row to the first.
    backward: Substitution,
}

impl Substitution {
    fn add(&mut self, row: usize, line: &Line, slots: Range<u32>, waits: bool, columns: &[u32]) {
        self.turns.push(Turn { row: short(row), diagonal: line.diagonal, count: short(slots.len()), waits });
        self.entries.extend(slots.map(|p| [p, columns[p as usize]]));
    }
}

fn short(slot: usize) -> u32 {
    u32::try_from(slot).expect("the factors have fewer than 2^32 entries")
}

impl Program {
    pub(super) fn new(pattern: &Pattern, steps: &[Step]) -> Self {
        let row_step = positions(pattern.rows, steps.iter().map(|s| s.row));
        let col_step = positions(pattern.cols, steps.iter().map(|s| s.col));
        let mut program = Self {
            lines: Vec::with_capacity(steps.len()),
            columns: Vec::new(),
            scatter: Vec::new(),
            fill: Vec::new(),
            tallies: vec![Tally::default(); steps.len()],
            singles: Vec::new(),
            runs: Vec::new(),
            forward: Substitution::default(),
            backward: Substitution::default(),
        };
        program.lay_out(steps, &row_step, &col_step);
        program.record_scatter(pattern, steps, &col_step);
        program.record_updates();
        program.record_substitutions();
        program
    }

    /// Decides where each entry of the factors is stored.
    fn lay_out(&mut self, steps: &[Step], row_step: &[Option<usize>], col_step: &[Option<usize>]) {
        let mut lower = vec![Vec::new(); steps.len()];
        for (k, step) in steps.iter().enumerate() {
            for i in step.rows_below.iter().filter_map(|&i| row_step[i]) {
                lower[i].push(short(k));
            }
        }
        for (k, step) in steps.iter().enumerate() {
            let start = self.columns.len();
            self.columns.append(&mut lower[k]);
            let diagonal = self.columns.len();
            self.columns.push(short(k));
            self.columns.extend(step.cols_right.iter().filter_map(|&j| col_step[j]).map(short));
            self.columns[diagonal + 1..].sort_unstable();
            self.lines.push(Line { start: short(start), diagonal: short(diagonal), end: short(self.columns.len()) });
        }
    }

    /// Place of the entry in row `i` and the column of step `j`; it must be stored.
    fn slot(&self, i: usize, j: u32) -> usize {
        let line = self.lines[i];
        let row = &self.columns[line.start as usize..line.end as usize];
        let offset = row.binary_search(&j).expect("the elimination stores every entry it meets");
        line.start as usize + offset
    }

    fn record_scatter(&mut self, pattern: &Pattern, steps: &[Step], col_step: &[Option<usize>]) {
        let mut original = vec![false; self.columns.len()];
        for (k, step) in steps.iter().enumerate() {
            for source in pattern.row(step.row) {
                if let Some(j) = col_step[pattern.col_idx[source]] {
                    let target = self.slot(k, short(j));
                    original[target] = true;
                    self.scatter.push([short(target), short(source)]);
                }
            }
        }
        self.fill = (0..self.columns.len()).filter(|&p| !original[p]).map(short).collect();
    }

    fn record_updates(&mut self) {
        let mut column = vec![Vec::new(); self.lines.len()];
        for (i, line) in self.lines.iter().enumerate() {
            for l in line.start..line.diagonal {
                column[self.columns[l as usize] as usize].push((i, l));
            }
        }
        for (k, below) in column.iter().enumerate() {
            let (singles, runs) = (self.singles.len(), self.runs.len());
            for &(i, l) in below {
                self.record_row_update(k, i, l);
            }
            self.tallies[k] =
                Tally { singles: short(self.singles.len() - singles), runs: short(self.runs.len() - runs) };
        }
    }

    /// Row i minus `l` times row k of U, cut into runs of neighbouring targets.
    fn record_row_update(&mut self, k: usize, i: usize, l: u32) {
        let (mut u, end) = (self.lines[k].diagonal + 1, self.lines[k].end);
        while u < end {
            let target = short(self.slot(i, self.columns[u as usize]));
            let same =
                |offset: u32| self.columns.get((target + offset) as usize) == self.columns.get((u + offset) as usize);
            let mut length = 1;
            while u + length < end && target + length < self.lines[i].end && same(length) {
                length += 1;
            }
            if length as usize >= RUN {
                self.runs.push(Run { target, l, u, length });
            } else {
                self.singles.extend((0..length).map(|s| [target + s, l, u + s]));
            }
            u += length;
        }
    }

    fn record_substitutions(&mut self) {
        for (i, line) in self.lines.iter().enumerate() {
            let waits = line.start < line.diagonal && self.columns[line.diagonal as usize - 1] as usize + 1 == i;
            let slots = line.start..line.diagonal - u32::from(waits);
            self.forward.add(i, line, slots, waits, &self.columns);
        }
        for (i, line) in self.lines.iter().enumerate().rev() {
            let right = line.diagonal + 1;
            if right == line.end {
                continue;
            }
            let found = self.backward.turns.last().is_some_and(|turn| turn.row as usize == i + 1);
            let waits = found && self.columns[right as usize] as usize == i + 1;
            self.backward.add(i, line, right + u32::from(waits)..line.end, waits, &self.columns);
        }
    }

    /// Number of entries in L and U.
    pub(super) fn len(&self) -> usize {
        self.columns.len()
    }

    /// Place of the reciprocal of pivot `k`.
    pub(super) fn pivot_place(&self, k: usize) -> usize {
        self.lines[k].diagonal as usize
    }

    /// Runs the elimination; `accept(k, pivot)` may stop it before pivot k is divided by.
    #[inline]
    pub(super) fn factor<T: Scalar, E>(
        &self,
        values: &[T],
        work: &mut [T],
        mut accept: impl FnMut(usize, T) -> Result<(), E>,
    ) -> Result<(), E> {
        let work = &mut work[..self.columns.len()];
        for &slot in &self.fill {
            work[slot as usize] = T::zero();
        }
        for &[target, source] in &self.scatter {
            work[target as usize] = values[source as usize];
        }
        let (mut singles, mut runs) = (&self.singles[..], &self.runs[..]);
        for (k, (line, tally)) in self.lines.iter().zip(&self.tallies).enumerate() {
            let diagonal = line.diagonal as usize;
            let row = &mut work[diagonal..line.end as usize];
            let pivot = row[0];
            accept(k, pivot)?;
            let reciprocal = T::one() / pivot;
            row[0] = reciprocal;
            for u in &mut row[1..] {
                *u *= reciprocal;
            }
            let (now, later) = singles.split_at(tally.singles as usize);
            singles = later;
            for &[target, l, u] in now {
                let product = work[l as usize] * work[u as usize];
                work[target as usize] -= product;
            }
            if tally.runs == 0 {
                continue;
            }
            let (now, later) = runs.split_at(tally.runs as usize);
            runs = later;
            for run in now {
                // Both l and row k lie before the entries they change.
                let (before, after) = work.split_at_mut(run.target as usize);
                let (u, length) = (run.u as usize, run.length as usize);
                let l = before[run.l as usize];
                crate::dense::axpy(-l, &before[u..u + length], &mut after[..length]);
            }
        }
        Ok(())
    }

    /// `L U x = b`, N right-hand sides side by side.
    ///
    /// In a chain each unknown depends on the one found just before it: that one is subtracted last and stays in a
    /// register.
    #[inline]
    pub(super) fn solve_fixed<T: Scalar, const N: usize>(&self, work: &[T], b: &mut [T]) {
        let (b, work) = (&mut b[..self.lines.len() * N], &work[..self.columns.len()]);
        let mut found = [T::zero(); N];
        let mut entries = &self.forward.entries[..];
        for turn in &self.forward.turns {
            let i = turn.row as usize;
            let mut row = take::<T, N>(b, i);
            let (now, later) = entries.split_at(turn.count as usize);
            entries = later;
            for &[place, j] in now {
                subtract(&mut row, work[place as usize], &take::<T, N>(b, j as usize));
            }
            if turn.waits {
                subtract(&mut row, work[turn.diagonal as usize - 1], &found);
            }
            for x in &mut row {
                *x *= work[turn.diagonal as usize];
            }
            put::<T, N>(b, i, &row);
            found = row;
        }
        let mut entries = &self.backward.entries[..];
        for turn in &self.backward.turns {
            let i = turn.row as usize;
            let mut row = take::<T, N>(b, i);
            let (now, later) = entries.split_at(turn.count as usize);
            entries = later;
            for &[place, j] in now {
                subtract(&mut row, work[place as usize], &take::<T, N>(b, j as usize));
            }
            if turn.waits {
                subtract(&mut row, work[turn.diagonal as usize + 1], &found);
            }
            put::<T, N>(b, i, &row);
            found = row;
        }
    }

    /// `Uᵀ Lᵀ y = b`, N right-hand sides side by side.
    #[inline]
    pub(super) fn solve_transposed_fixed<T: Scalar, const N: usize>(&self, work: &[T], b: &mut [T]) {
        let b = &mut b[..self.lines.len() * N];
        for (k, line) in self.lines.iter().enumerate() {
            let row = take::<T, N>(b, k);
            let (right, end) = (line.diagonal as usize + 1, line.end as usize);
            for (u, &j) in work[right..end].iter().zip(&self.columns[right..end]) {
                let mut other = take::<T, N>(b, j as usize);
                subtract(&mut other, *u, &row);
                b[j as usize * N..(j as usize + 1) * N].copy_from_slice(&other);
            }
        }
        for (k, line) in self.lines.iter().enumerate().rev() {
            let (start, diagonal) = (line.start as usize, line.diagonal as usize);
            let mut row = take::<T, N>(b, k);
            for y in &mut row {
                *y *= work[diagonal];
            }
            b[k * N..(k + 1) * N].copy_from_slice(&row);
            for (l, &j) in work[start..diagonal].iter().zip(&self.columns[start..diagonal]) {
                let mut other = take::<T, N>(b, j as usize);
                subtract(&mut other, *l, &row);
                b[j as usize * N..(j as usize + 1) * N].copy_from_slice(&other);
            }
        }
    }

    /// `L U x = b`, any number of right-hand sides.
    pub(super) fn solve_many<T: Scalar>(&self, work: &[T], b: &mut [T], nrhs: usize) {
        for (i, line) in self.lines.iter().enumerate() {
            let (known, rest) = b.split_at_mut(i * nrhs);
            let row = &mut rest[..nrhs];
            for p in line.start as usize..line.diagonal as usize {
                let j = self.columns[p] as usize;
                crate::dense::axpy(-work[p], &known[j * nrhs..(j + 1) * nrhs], row);
            }
            let reciprocal = work[line.diagonal as usize];
            for x in row {
                *x *= reciprocal;
            }
        }
        for (i, line) in self.lines.iter().enumerate().rev() {
            let (head, known) = b.split_at_mut((i + 1) * nrhs);
            let row = &mut head[i * nrhs..];
            for p in line.diagonal as usize + 1..line.end as usize {
                let j = self.columns[p] as usize - i - 1;
                crate::dense::axpy(-work[p], &known[j * nrhs..(j + 1) * nrhs], row);
            }
        }
    }

    /// `Uᵀ Lᵀ y = b`, any number of right-hand sides.
    pub(super) fn solve_transposed_many<T: Scalar>(&self, work: &[T], b: &mut [T], nrhs: usize) {
        for (k, line) in self.lines.iter().enumerate() {
            let (head, waiting) = b.split_at_mut((k + 1) * nrhs);
            let row = &head[k * nrhs..];
            for p in line.diagonal as usize + 1..line.end as usize {
                let j = self.columns[p] as usize - k - 1;
                crate::dense::axpy(-work[p], row, &mut waiting[j * nrhs..(j + 1) * nrhs]);
            }
        }
        for (k, line) in self.lines.iter().enumerate().rev() {
            let (waiting, rest) = b.split_at_mut(k * nrhs);
            let row = &mut rest[..nrhs];
            let reciprocal = work[line.diagonal as usize];
            for y in row.iter_mut() {
                *y *= reciprocal;
            }
            for p in line.start as usize..line.diagonal as usize {
                let j = self.columns[p] as usize;
                crate::dense::axpy(-work[p], row, &mut waiting[j * nrhs..(j + 1) * nrhs]);
            }
        }
    }
}

/// Step of each row (or column), for those that have one.
fn positions(count: usize, used: impl Iterator<Item = usize>) -> Vec<Option<usize>> {
    let mut steps = vec![None; count];
    for (k, item) in used.enumerate() {
        steps[item] = Some(k);
    }
    steps
}

/// Row `i` of N numbers.
#[inline(always)]
fn take<T: Scalar, const N: usize>(b: &[T], i: usize) -> [T; N] {
    if N == 1 {
        return [b[i]; N];
    }
    let mut row = [T::zero(); N];
    row.copy_from_slice(&b[i * N..(i + 1) * N]);
    row
}

#[inline(always)]
fn put<T: Scalar, const N: usize>(b: &mut [T], i: usize, row: &[T; N]) {
    if N == 1 {
        b[i] = row[0];
    } else {
        b[i * N..(i + 1) * N].copy_from_slice(row);
    }
}

#[inline(always)]
fn subtract<T: Scalar, const N: usize>(row: &mut [T; N], factor: T, other: &[T; N]) {
    for (x, &y) in row.iter_mut().zip(other) {
        *x -= factor * y;
    }
}
