//! Where a sparse matrix may be nonzero.

use super::layout::Layouts;
use std::ops::Range;

/// The sparsity of a `rows`×`cols` matrix, row by row (CSR).
///
/// Entries of row i are at the indices `row_ptr[i]..row_ptr[i + 1]` of `col_idx` and of the corresponding values. No
/// column occurs twice in a row; the order within a row is free.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
pub struct Pattern {
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub cols: usize,
    /// Index of the first entry of each row (`rows + 1` indices).
    pub row_ptr: Vec<usize>,
    /// The column of each entry.
    pub col_idx: Vec<usize>,
    /// Eliminations laid out before.
    pub(super) layouts: Layouts,
}

impl Pattern {
    /// From the CSR arrays.
    ///
    /// # Panics
    /// If the arrays contradict one another, a column is out of range, or a row names a column twice.
    pub fn new(rows: usize, cols: usize, row_ptr: Vec<usize>, col_idx: Vec<usize>) -> Self {
        assert_eq!(row_ptr.len(), rows + 1, "{rows} rows need {} row starts", rows + 1);
        assert_eq!(row_ptr[0], 0, "the first row starts at 0");
        assert_eq!(row_ptr[rows], col_idx.len(), "the last row ends with the entries");
        let mut last_row = vec![usize::MAX; cols];
        for i in 0..rows {
            assert!(row_ptr[i] <= row_ptr[i + 1], "row {i} ends before it starts");
            for &j in &col_idx[row_ptr[i]..row_ptr[i + 1]] {
                assert!(j < cols, "row {i} names column {j} of {cols}");
                assert_ne!(last_row[j], i, "row {i} names column {j} twice");
                last_row[j] = i;
            }
        }
        Self { rows, cols, row_ptr, col_idx, layouts: Layouts::default() }
    }

    /// Every entry of a `rows`×`cols` matrix, so that its values are those of the dense row-major matrix.
    pub fn dense(rows: usize, cols: usize) -> Self {
        Self {
            rows,
            cols,
            row_ptr: (0..=rows).map(|i| i * cols).collect(),
            col_idx: (0..rows).flat_map(|_| 0..cols).collect(),
            layouts: Layouts::default(),
        }
    }

    /// From the columns of each row.
    ///
    /// # Panics
    /// If a column is out of range or occurs twice in a row.
    pub fn from_rows(cols: usize, rows: &[Vec<usize>]) -> Self {
        let mut row_ptr = Vec::with_capacity(rows.len() + 1);
        row_ptr.push(0);
        let mut col_idx = Vec::new();
        for row in rows {
            col_idx.extend_from_slice(row);
            row_ptr.push(col_idx.len());
        }
        Self::new(rows.len(), cols, row_ptr, col_idx)
    }

    /// Number of entries.
    pub fn nnz(&self) -> usize {
        self.col_idx.len()
    }

    /// The indices of row `i`'s entries in `col_idx` and in the values.
    #[inline]
    pub fn row(&self, i: usize) -> Range<usize> {
        self.row_ptr[i]..self.row_ptr[i + 1]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_found_again() {
        let p = Pattern::from_rows(4, &[vec![3, 0], vec![], vec![1]]);
        assert_eq!((p.rows, p.cols, p.nnz()), (3, 4, 3));
        assert_eq!(p.col_idx[p.row(0)], [3, 0]);
        assert!(p.row(1).is_empty());
        assert_eq!(p.col_idx[p.row(2)], [1]);
        let d = Pattern::dense(2, 3);
        assert_eq!(d.col_idx, [0, 1, 2, 0, 1, 2]);
        assert_eq!(d, Pattern::new(2, 3, vec![0, 3, 6], d.col_idx.clone()));
    }

    #[test]
    #[should_panic(expected = "twice")]
    fn a_column_twice_is_refused() {
        Pattern::from_rows(2, &[vec![1, 1]]);
    }
}
