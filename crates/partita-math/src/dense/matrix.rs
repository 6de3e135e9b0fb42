//! An owned row-major matrix.

use std::ops::{Index, IndexMut};

/// A dense matrix, `rows`×`cols`, stored row by row.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Matrix {
    rows: usize,
    cols: usize,
    data: Vec<f64>,
}

impl Matrix {
    /// All zeros.
    pub fn new(rows: usize, cols: usize) -> Self {
        Self { rows, cols, data: vec![0.0; rows * cols] }
    }

    /// A matrix from its rows.
    ///
    /// # Panics
    /// If the rows differ in length.
    pub fn from_rows(rows: &[&[f64]]) -> Self {
        let cols = rows.first().map_or(0, |row| row.len());
        let mut data = Vec::with_capacity(rows.len() * cols);
        for (i, row) in rows.iter().enumerate() {
            assert_eq!(row.len(), cols, "row {i} has {} entries, row 0 has {cols}", row.len());
            data.extend_from_slice(row);
        }
        Self { rows: rows.len(), cols, data }
    }

    /// Takes over numbers stored row by row.
    ///
    /// # Panics
    /// If there are not `rows * cols` of them.
    pub fn from_vec(rows: usize, cols: usize, data: Vec<f64>) -> Self {
        assert_eq!(data.len(), rows * cols, "{} numbers do not fill a {rows} x {cols} matrix", data.len());
        Self { rows, cols, data }
    }

    /// The identity, `n`×`n`.
    pub fn identity(n: usize) -> Self {
        let mut unit = Self::new(n, n);
        for i in 0..n {
            unit[(i, i)] = 1.0;
        }
        unit
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Number of columns.
    pub fn cols(&self) -> usize {
        self.cols
    }

    /// All entries, row by row.
    pub fn data(&self) -> &[f64] {
        &self.data
    }

    /// All entries, row by row, for the in-place kernels.
    pub fn data_mut(&mut self) -> &mut [f64] {
        &mut self.data
    }

    /// Consumes the matrix and returns its entries, row by row.
    pub fn into_vec(self) -> Vec<f64> {
        self.data
    }

    /// Row `i`.
    pub fn row(&self, i: usize) -> &[f64] {
        &self.data[i * self.cols..(i + 1) * self.cols]
    }

    /// Row `i`, to write to.
    pub fn row_mut(&mut self, i: usize) -> &mut [f64] {
        &mut self.data[i * self.cols..(i + 1) * self.cols]
    }

    /// The transposed matrix.
    pub fn transpose(&self) -> Self {
        let mut out = Self::new(self.cols, self.rows);
        for i in 0..self.rows {
            for (j, &x) in self.row(i).iter().enumerate() {
                out.data[j * self.rows + i] = x;
            }
        }
        out
    }

    /// Product with another matrix.
    ///
    /// # Panics
    /// If the inner sizes differ.
    pub fn matmul(&self, other: &Matrix) -> Self {
        assert_eq!(
            self.cols, other.rows,
            "a {} x {} matrix cannot multiply a {} x {} matrix",
            self.rows, self.cols, other.rows, other.cols
        );
        let mut out = Self::new(self.rows, other.cols);
        for i in 0..self.rows {
            for k in 0..self.cols {
                super::axpy(self[(i, k)], other.row(k), out.row_mut(i));
            }
        }
        out
    }

    /// Product with a vector.
    ///
    /// # Panics
    /// If the vector does not have `cols` entries.
    pub fn matvec(&self, x: &[f64]) -> Vec<f64> {
        assert_eq!(x.len(), self.cols, "a {} x {} matrix cannot multiply {} numbers", self.rows, self.cols, x.len());
        (0..self.rows).map(|i| super::dot(self.row(i), x)).collect()
    }

    /// Largest absolute entry; 0 for an empty matrix, NaN if any entry is NaN.
    pub fn max_abs(&self) -> f64 {
        self.data.iter().fold(0.0, |m, x| larger(m, x.abs()))
    }
}

/// The larger of two numbers, NaN winning.
fn larger(m: f64, x: f64) -> f64 {
    if m.is_nan() || m > x {
        m
    } else {
        x
    }
}

impl Index<(usize, usize)> for Matrix {
    type Output = f64;
    #[inline]
    fn index(&self, (i, j): (usize, usize)) -> &f64 {
        assert!(j < self.cols, "column {j} of a matrix with {} columns", self.cols);
        &self.data[i * self.cols + j]
    }
}

impl IndexMut<(usize, usize)> for Matrix {
    #[inline]
    fn index_mut(&mut self, (i, j): (usize, usize)) -> &mut f64 {
        assert!(j < self.cols, "column {j} of a matrix with {} columns", self.cols);
        &mut self.data[i * self.cols + j]
    }
}

#[cfg(test)]
mod tests {
    use super::super::samples::{distance, random};
    use super::*;

    #[test]
    fn transposing_a_product_reverses_it() {
        let mut rng = fastrand::Rng::with_seed(3);
        let (a, b) = (random(&mut rng, 4, 6), random(&mut rng, 6, 3));
        let left = a.matmul(&b).transpose();
        let right = b.transpose().matmul(&a.transpose());
        assert!(distance(left.data(), right.data()) < 1e-15);
        assert_eq!(a.transpose().transpose(), a);
        assert_eq!(a.matmul(&Matrix::identity(6)), a);
    }

    #[test]
    fn product_with_a_vector_is_product_with_a_column() {
        let mut rng = fastrand::Rng::with_seed(4);
        let (a, x) = (random(&mut rng, 5, 7), random(&mut rng, 7, 1));
        assert!(distance(&a.matvec(x.data()), a.matmul(&x).data()) < 1e-15);
    }

    #[test]
    fn largest_entry_ignores_sign_but_not_nan() {
        let a = Matrix::from_rows(&[&[1.0, -3.0], &[2.0, 0.0]]);
        assert_eq!(a.max_abs(), 3.0);
        assert!(Matrix::from_rows(&[&[f64::NAN, 1.0]]).max_abs().is_nan());
        assert_eq!(Matrix::default().max_abs(), 0.0);
        assert_eq!(a.row(1), [2.0, 0.0]);
    }
}
