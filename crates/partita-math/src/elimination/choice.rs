//! Choosing the pivots: Markowitz cost among the entries that pass a threshold within their row.
//!
//! The elimination is executed numerically on the scaled matrix, so that a row which depends on earlier ones is seen to
//! vanish. Rows that have lost most of their size wait until no stronger one remains.

use super::{Pattern, PlanError, PlanOptions};
use crate::tolerance;

/// What must be left of a row for it to be used; the next weaker level only when no row meets the present one. Scale:
/// scaled size of the row. Reason: two digits of growth a level, down to what counts as null.
const PIVOT_LEVELS: [f64; 5] = [1e-2, 1e-4, 1e-6, 1e-8, tolerance::NULL_VALUE];
/// Up to this rank every remaining entry is compared at each step.
const FULL_SEARCH: usize = 64;
/// Above it, this many rows and columns of lowest count.
const LINES_SEARCHED: usize = 4;

/// One step of the elimination.
pub(super) struct Step {
    /// Row of the pivot.
    pub row: usize,
    /// Column of the pivot.
    pub col: usize,
    /// Other rows with an entry in that column at that time.
    pub rows_below: Vec<usize>,
    /// Other columns with an entry in that row at that time.
    pub cols_right: Vec<usize>,
    /// Magnitude of the scaled pivot.
    pub size: f64,
}

/// Chooses `rank` pivots among the eligible rows and columns.
pub(super) fn choose(
    pattern: &Pattern,
    values: &[f64],
    eligible_rows: &[bool],
    eligible_cols: &[bool],
    row_scale: &[f64],
    col_scale: &[f64],
    rank: usize,
    options: &PlanOptions,
) -> Result<Vec<Step>, PlanError> {
    let mut rest = Remainder::new(pattern, options, rank > FULL_SEARCH);
    for i in (0..pattern.rows).filter(|&i| eligible_rows[i]) {
        let entries = pattern.row(i).map(|entry| (pattern.col_idx[entry], values[entry]));
        let eligible = entries.filter(|&(j, _)| eligible_cols[j]);
        let mut row = Vec::with_capacity(pattern.row(i).len());
        row.extend(eligible.map(|(j, c)| (j, row_scale[i] * c * col_scale[j])));
        rest.load(i, row)?;
    }
    rest.queue_everything();
    let mut steps = Vec::with_capacity(rank);
    while steps.len() < rank {
        match rest.search() {
            Some((row, col)) => steps.push(rest.eliminate(row, col)),
            None if rest.lower_level() => {}
            None => return Err(PlanError::RankDeficient { found: steps.len(), wanted: rank, best: rest.largest() }),
        }
    }
    Ok(steps)
}

/// A candidate pivot; the better one fills in less, or is larger.
#[derive(Clone, Copy)]
struct Candidate {
    cost: usize,
    size: f64,
    row: usize,
    col: usize,
}

impl Candidate {
    fn beats(&self, other: &Option<Candidate>) -> bool {
        other.is_none_or(|o| self.cost < o.cost || (self.cost == o.cost && self.size > o.size))
    }
}

/// The remainder of the scaled matrix.
struct Remainder {
    threshold: f64,
    /// Null, and what must be left of a row, where no row waits.
    null: f64,
    most_lost: f64,
    /// Entries of each row in the columns not yet used.
    rows: Vec<Vec<(usize, f64)>>,
    /// Rows that have an entry in each column; may still name rows that are used up.
    cols: Vec<Vec<usize>>,
    /// Number of live rows in each column.
    col_count: Vec<usize>,
    row_live: Vec<bool>,
    /// Largest entry of each row at present, and at the beginning.
    row_max: Vec<f64>,
    reference: Vec<f64>,
    level: usize,
    /// Rows and columns by number of entries, for large systems only.
    queues: Option<(Buckets, Buckets)>,
    /// Place + 1 of each column in the row being updated, else 0.
    entry: Vec<usize>,
}

impl Remainder {
    fn new(pattern: &Pattern, options: &PlanOptions, large: bool) -> Self {
        let (m, n) = (pattern.rows, pattern.cols);
        Self {
            threshold: options.threshold,
            null: options.null,
            most_lost: if options.waits { f64::INFINITY } else { 0.0 },
            rows: vec![Vec::new(); m],
            cols: vec![Vec::new(); n],
            col_count: vec![0; n],
            row_live: vec![false; m],
            row_max: vec![0.0; m],
            reference: vec![0.0; m],
            level: 0,
            queues: large.then(|| (Buckets::new(m), Buckets::new(n))),
            entry: vec![0; n],
        }
    }

    fn load(&mut self, i: usize, row: Vec<(usize, f64)>) -> Result<(), PlanError> {
        if row.iter().any(|(_, s)| !s.is_finite()) {
            return Err(PlanError::NotFinite { row: i });
        }
        for &(j, _) in &row {
            self.cols[j].push(i);
            self.col_count[j] += 1;
        }
        self.row_max[i] = max_size(&row);
        self.reference[i] = self.row_max[i];
        self.row_live[i] = true;
        self.rows[i] = row;
        Ok(())
    }

    /// Whether row `i` may give a pivot at the present level.
    fn usable(&self, i: usize) -> bool {
        self.row_live[i]
            && self.row_max[i] > self.null
            && self.row_max[i] >= PIVOT_LEVELS[self.level].min(self.most_lost) * self.reference[i]
    }

    /// Admits weaker rows; false when there is no weaker level.
    fn lower_level(&mut self) -> bool {
        if self.level + 1 == PIVOT_LEVELS.len() {
            return false;
        }
        self.level += 1;
        self.queue_everything();
        true
    }

    /// Largest entry left.
    fn largest(&self) -> f64 {
        (0..self.rows.len()).filter(|&i| self.row_live[i]).fold(0.0, |m, i| m.max(self.row_max[i]))
    }

    fn queue_everything(&mut self) {
        // Backwards, because each goes in front of the earlier ones.
        for i in (0..self.rows.len()).rev() {
            self.queue_row(i);
        }
        for j in (0..self.cols.len()).rev() {
            self.queue_col(j);
        }
    }

    fn queue_row(&mut self, i: usize) {
        let usable = self.usable(i);
        if let Some((rows, _)) = &mut self.queues {
            rows.remove(i);
            if usable {
                rows.insert(i, self.rows[i].len());
            }
        }
    }

    fn queue_col(&mut self, j: usize) {
        if let Some((_, cols)) = &mut self.queues {
            cols.remove(j);
            if self.col_count[j] > 0 {
                cols.insert(j, self.col_count[j]);
            }
        }
    }

    fn search(&mut self) -> Option<(usize, usize)> {
        let best = if self.queues.is_some() { self.search_queues() } else { self.search_all() };
        best.map(|b| (b.row, b.col))
    }

    fn search_all(&self) -> Option<Candidate> {
        let mut best = None;
        for i in (0..self.rows.len()).filter(|&i| self.usable(i)) {
            self.search_row(i, &mut best);
        }
        best
    }

    /// Looks through the lowest counts, alternating between columns and rows.
    fn search_queues(&mut self) -> Option<Candidate> {
        let (row_queue, mut col_queue) = self.queues.take()?;
        let mut best: Option<Candidate> = None;
        let mut lines = 0;
        'counts: for count in 1..row_queue.top().max(col_queue.top()) {
            let mut cursor = col_queue.first(count);
            while let Some(j) = cursor {
                if best.is_some_and(|b| b.cost <= (count - 1) * (count - 1)) || lines >= LINES_SEARCHED {
                    break 'counts;
                }
                cursor = col_queue.after(j);
                if self.search_col(j, &mut best) {
                    lines += 1;
                } else {
                    // Nothing here until one of its rows changes, which queues the column again.
                    col_queue.remove(j);
                }
            }
            let mut cursor = row_queue.first(count);
            while let Some(i) = cursor {
                if best.is_some_and(|b| b.cost <= (count - 1) * count) || lines >= LINES_SEARCHED {
                    break 'counts;
                }
                cursor = row_queue.after(i);
                self.search_row(i, &mut best);
                lines += 1;
            }
        }
        self.queues = Some((row_queue, col_queue));
        best
    }

    fn search_row(&self, i: usize, best: &mut Option<Candidate>) {
        for &(j, s) in &self.rows[i] {
            self.consider(i, j, s, best);
        }
    }

    /// Returns whether the column has an acceptable entry.
    fn search_col(&mut self, j: usize, best: &mut Option<Candidate>) -> bool {
        let mut rows = std::mem::take(&mut self.cols[j]);
        rows.retain(|&i| self.row_live[i]);
        let mut any = false;
        for &i in rows.iter().filter(|&&i| self.usable(i)) {
            if let Some(&(_, s)) = self.rows[i].iter().find(|e| e.0 == j) {
                any |= self.consider(i, j, s, best);
            }
        }
        self.cols[j] = rows;
        any
    }

    /// Returns whether the entry passes the threshold within its row.
    fn consider(&self, row: usize, col: usize, s: f64, best: &mut Option<Candidate>) -> bool {
        let size = s.abs();
        if size < self.threshold * self.row_max[row] || size <= self.null {
            return false;
        }
        let candidate = Candidate { cost: (self.rows[row].len() - 1) * (self.col_count[col] - 1), size, row, col };
        if candidate.beats(best) {
            *best = Some(candidate);
        }
        true
    }

    /// Subtracts the pivot row from the others so that the pivot column vanishes, and forgets both.
    fn eliminate(&mut self, row: usize, col: usize) -> Step {
        let mut pivot_row = std::mem::take(&mut self.rows[row]);
        let entry = pivot_row.iter().position(|e| e.0 == col).expect("the search returns an entry of the row");
        let (_, pivot) = pivot_row.swap_remove(entry);
        self.row_live[row] = false;
        let mut rows_below = std::mem::take(&mut self.cols[col]);
        rows_below.retain(|&i| self.row_live[i]);
        for &(j, _) in &pivot_row {
            self.col_count[j] -= 1;
        }
        self.col_count[col] = 0;
        self.queue_row(row);
        self.queue_col(col);
        for &i in &rows_below {
            self.update_row(i, col, pivot, &pivot_row);
        }
        for &(j, _) in &pivot_row {
            self.queue_col(j);
        }
        Step { row, col, rows_below, cols_right: pivot_row.into_iter().map(|e| e.0).collect(), size: pivot.abs() }
    }

    fn update_row(&mut self, i: usize, col: usize, pivot: f64, pivot_row: &[(usize, f64)]) {
        let mut row = std::mem::take(&mut self.rows[i]);
        let entry = row.iter().position(|e| e.0 == col).expect("rows and columns agree");
        let (_, s) = row.swap_remove(entry);
        let factor = s / pivot;
        for (k, &(j, _)) in row.iter().enumerate() {
            self.entry[j] = k + 1;
        }
        let before = row.len();
        for &(j, u) in pivot_row {
            match self.entry[j] {
                0 => {
                    row.push((j, -factor * u));
                    self.cols[j].push(i);
                    self.col_count[j] += 1;
                }
                k => row[k - 1].1 -= factor * u,
            }
        }
        for &(j, _) in &row[..before] {
            self.entry[j] = 0;
        }
        self.row_max[i] = max_size(&row);
        self.rows[i] = row;
        self.queue_row(i);
        if self.queues.is_some() {
            for k in 0..self.rows[i].len() {
                let j = self.rows[i][k].0;
                self.queue_col(j);
            }
        }
    }
}

fn max_size(row: &[(usize, f64)]) -> f64 {
    row.iter().fold(0.0, |m, (_, s)| m.max(s.abs()))
}

/// Items in doubly linked lists, one list per count.
struct Buckets {
    head: Vec<usize>,
    next: Vec<usize>,
    prev: Vec<usize>,
    /// The list an item is in, or `NONE`.
    list: Vec<usize>,
}

const NONE: usize = usize::MAX;

impl Buckets {
    fn new(items: usize) -> Self {
        Self { head: Vec::new(), next: vec![NONE; items], prev: vec![NONE; items], list: vec![NONE; items] }
    }

    /// One more than the largest count ever held.
    fn top(&self) -> usize {
        self.head.len()
    }

    fn first(&self, count: usize) -> Option<usize> {
        self.head.get(count).copied().filter(|&item| item != NONE)
    }

    fn after(&self, item: usize) -> Option<usize> {
        Some(self.next[item]).filter(|&item| item != NONE)
    }

    fn insert(&mut self, item: usize, count: usize) {
        if count >= self.head.len() {
            self.head.resize(count + 1, NONE);
        }
        let second = self.head[count];
        self.next[item] = second;
        self.prev[item] = NONE;
        if second != NONE {
            self.prev[second] = item;
        }
        self.head[count] = item;
        self.list[item] = count;
    }

    fn remove(&mut self, item: usize) {
        let count = std::mem::replace(&mut self.list[item], NONE);
        if count == NONE {
            return;
        }
        let (before, after) = (self.prev[item], self.next[item]);
        match before {
            NONE => self.head[count] = after,
            _ => self.next[before] = after,
        }
        if after != NONE {
            self.prev[after] = before;
        }
    }
}
