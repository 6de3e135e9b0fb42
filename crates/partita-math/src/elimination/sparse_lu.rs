//! LU factors of square sparse matrices whose entries change by orders of magnitude, real or complex.
//!
//! ```text
//! pattern, values ──► LuOrder (pivots: little fill, not small) ──► LuFactors: factor, solve
//!                     once, while its pivots serve                 for each matrix
//! ```
//!
//! A [`Plan`](super::Plan) compares pivots with those it was made for. Here each row is compared with itself: rows and columns are
//! scaled anew for each matrix, and an order serves while its pivots are not small in their rows.

use super::choice;
use super::{Pattern, PivotShrunk, PlanError, PlanOptions};
use crate::dense::Complex;

/// Least pivot in what is left of its row, both scaled, with which an order is tried at all. Unit: ratio. Reason: half of the
/// digits, and what they are worth is measured.
const TRIED_PIVOT: f64 = 1e-8;
/// Error of the equations of a known solution with which an order still serves. Scale: the largest unknown, all scaled. Reason:
/// an iteration of Newton's method gains at most three digits, for which matrices of so many are as good as exact ones.
const SERVING_ERROR: f64 = 1e-7;
/// By which part of 1 each unknown of that solution is larger than the one before, without the whole part. Unit: ratio. Reason:
/// the golden section repeats nothing that matrices repeat.
const UNEVEN_STEP: f64 = 0.618_033_988_749_894_9;

/// Numbers of a matrix: real or complex ones.
pub trait Number: Copy + Default {
    /// A real number.
    fn real(x: f64) -> Self;
    /// The sum.
    fn plus(self, other: Self) -> Self;
    /// The product.
    fn times(self, other: Self) -> Self;
    /// The product with a real number.
    fn scaled(self, factor: f64) -> Self;
    /// The reciprocal.
    fn reciprocal(self) -> Self;
    /// A size.
    fn size(self) -> f64;
    /// `x − f y`.
    #[inline(always)]
    fn less(self, f: Self, y: Self) -> Self {
        self.plus(f.times(y).scaled(-1.0))
    }
}

impl Number for f64 {
    #[inline(always)]
    fn real(x: f64) -> Self {
        x
    }
    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        self + other
    }
    #[inline(always)]
    fn times(self, other: Self) -> Self {
        self * other
    }
    #[inline(always)]
    fn scaled(self, factor: f64) -> Self {
        self * factor
    }
    #[inline(always)]
    fn reciprocal(self) -> Self {
        1.0 / self
    }
    #[inline(always)]
    fn size(self) -> f64 {
        self.abs()
    }
}

impl Number for Complex {
    #[inline(always)]
    fn real(x: f64) -> Self {
        [x, 0.0]
    }
    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        [self[0] + other[0], self[1] + other[1]]
    }
    #[inline(always)]
    fn times(self, other: Self) -> Self {
        [self[0] * other[0] - self[1] * other[1], self[0] * other[1] + self[1] * other[0]]
    }
    #[inline(always)]
    fn scaled(self, factor: f64) -> Self {
        [self[0] * factor, self[1] * factor]
    }
    #[inline(always)]
    fn reciprocal(self) -> Self {
        // entries are scaled: nothing overflows
        let square = self[0] * self[0] + self[1] * self[1];
        [self[0] / square, -self[1] / square]
    }
    #[inline(always)]
    fn size(self) -> f64 {
        self[0].abs() + self[1].abs()
    }
}

/// Lists of numbers, one after the other.
#[derive(Clone, Debug, Default)]
struct Lists<X> {
    starts: Vec<usize>,
    entries: Vec<X>,
}

impl<X> Lists<X> {
    fn new(of: impl Iterator<Item = Vec<X>>) -> Self {
        let mut out = Self { starts: vec![0], entries: Vec::new() };
        for list in of {
            out.entries.extend(list);
            out.starts.push(out.entries.len());
        }
        out
    }

    #[inline(always)]
    fn range(&self, k: usize) -> std::ops::Range<usize> {
        self.starts[k]..self.starts[k + 1]
    }
}

/// Pivots of a square matrix in an order of little fill, and where its factors are not zero.
#[derive(Clone, Debug)]
pub struct LuOrder {
    /// Row and column of each step.
    rows: Vec<usize>,
    cols: Vec<usize>,
    /// The entries of the row of each step: index among the values, step of the column.
    given: Lists<(u32, u32)>,
    /// Earlier steps that the row of each step is reduced by, ascending.
    lower: Lists<u32>,
    /// Steps of the other columns of the reduced row.
    upper: Lists<u32>,
    multiplications: usize,
}

/// Rows and columns scaled so that the largest entries are of order 1.
fn equilibrate(pattern: &Pattern, size: impl Fn(usize) -> f64, rows: &mut Vec<f64>, cols: &mut Vec<f64>) {
    let over = |x: &mut f64| *x = if *x > 0.0 { 1.0 / *x } else { 1.0 };
    rows.clear();
    rows.resize(pattern.rows, 0.0);
    cols.clear();
    cols.resize(pattern.cols, 0.0);
    // geometric means of both, then rows to 1
    for i in 0..pattern.rows {
        rows[i] = pattern.row(i).fold(0.0, |m: f64, e| m.max(size(e))).sqrt();
        over(&mut rows[i]);
        pattern.row(i).for_each(|e| {
            let j = pattern.col_idx[e];
            cols[j] = cols[j].max(size(e) * rows[i]);
        });
    }
    cols.iter_mut().for_each(over);
    for i in 0..pattern.rows {
        rows[i] = pattern.row(i).fold(0.0, |m: f64, e| m.max(size(e) * cols[pattern.col_idx[e]]));
        over(&mut rows[i]);
    }
}

impl LuOrder {
    /// For matrices of this square pattern, pivots chosen for these values.
    ///
    /// # Errors
    /// A singular matrix, or one that is not finite.
    ///
    /// # Panics
    /// If the pattern is not square.
    pub fn new(pattern: &Pattern, values: &[f64]) -> Result<Self, PlanError> {
        let n = pattern.rows;
        assert_eq!(n, pattern.cols, "a square matrix");
        let (mut row_scale, mut col_scale) = (Vec::new(), Vec::new());
        equilibrate(pattern, |e| values[e].abs(), &mut row_scale, &mut col_scale);
        let all = vec![true; n];
        let options = PlanOptions { null: 0.0, waits: false, ..PlanOptions::default() };
        let steps = choice::choose(pattern, values, &all, &all, &row_scale, &col_scale, n, &options)?;
        let (mut step_of_row, mut step_of_col) = (vec![0; n], vec![0; n]);
        for (k, step) in steps.iter().enumerate() {
            (step_of_row[step.row], step_of_col[step.col]) = (k, k);
        }
        let mut lower = vec![Vec::new(); n];
        for (k, step) in steps.iter().enumerate() {
            step.rows_below.iter().for_each(|&i| lower[step_of_row[i]].push(k as u32));
        }
        let given = |i: usize| pattern.row(i).map(|e| (e as u32, step_of_col[pattern.col_idx[e]] as u32)).collect();
        let right = |cols: &[usize]| {
            let mut out: Vec<u32> = cols.iter().map(|&j| step_of_col[j] as u32).collect();
            out.sort_unstable();
            out
        };
        Ok(Self {
            rows: steps.iter().map(|s| s.row).collect(),
            cols: steps.iter().map(|s| s.col).collect(),
            given: Lists::new(steps.iter().map(|s| given(s.row))),
            lower: Lists::new(lower.into_iter()),
            upper: Lists::new(steps.iter().map(|s| right(&s.cols_right))),
            multiplications: steps.iter().map(|s| s.rows_below.len() * (s.cols_right.len() + 1)).sum(),
        })
    }

    /// Multiplications of a factorisation.
    pub fn multiplications(&self) -> usize {
        self.multiplications
    }

    /// Entries of both factors, the pivots counted once: multiplications of a solution.
    pub fn nnz_factors(&self) -> usize {
        self.rows.len() + self.lower.entries.len() + self.upper.entries.len()
    }
}

/// Factors in an order, and their memory.
#[derive(Clone, Debug, Default)]
pub struct LuFactors<T> {
    lower: Vec<T>,
    upper: Vec<T>,
    /// Reciprocal pivots.
    pivots: Vec<T>,
    row_scale: Vec<f64>,
    col_scale: Vec<f64>,
    work: Vec<T>,
    known: Vec<T>,
    found: Vec<T>,
}

impl<T: Number> LuFactors<T> {
    /// Factor the matrix with these values in its pattern. After the first time with an order nothing is allocated.
    ///
    /// # Errors
    /// Pivots that are small, so that a known solution is not found again, or not finite: then another order is needed.
    pub fn factor(&mut self, pattern: &Pattern, order: &LuOrder, values: &[T]) -> Result<(), PivotShrunk> {
        self.factor_with(TRIED_PIVOT, pattern, order, values)?;
        let error = self.error(pattern, order, values);
        if error <= SERVING_ERROR {
            Ok(())
        } else {
            Err(PivotShrunk { step: order.rows.len(), pivot: SERVING_ERROR, reference: error })
        }
    }

    /// The largest error, in scaled equations, of what the factors find for a right side with a known solution of order 1.
    fn error(&mut self, pattern: &Pattern, order: &LuOrder, values: &[T]) -> f64 {
        let (mut known, mut found) = (std::mem::take(&mut self.known), std::mem::take(&mut self.found));
        known.clear();
        known.extend(self.col_scale.iter().enumerate().map(|(j, s)| {
            let uneven = (j as f64 * UNEVEN_STEP).fract();
            T::real((0.5 + uneven) * s)
        }));
        found.clear();
        found.resize(known.len(), T::default());
        let product = |i: usize, x: &[T]| {
            pattern.row(i).fold(T::default(), |sum, e| sum.plus(values[e].times(x[pattern.col_idx[e]])))
        };
        (0..known.len()).for_each(|i| found[i] = product(i, &known));
        self.solve(order, &mut found);
        let mut largest = 1.0f64;
        for ((x, known), scale) in found.iter_mut().zip(&known).zip(&self.col_scale) {
            largest = largest.max(x.size() / scale);
            *x = x.less(T::real(1.0), *known);
        }
        let error = |i: usize| product(i, &found).size() * self.row_scale[i];
        // a NaN is no small error
        let worst = (0..known.len()).map(error).fold(0.0, |m: f64, x| if x <= m { m } else { x });
        (self.known, self.found) = (known, found);
        worst / largest
    }

    /// The same by any pivots that are not zero, for an order that was chosen for a matrix as large.
    ///
    /// # Errors
    /// A pivot that is zero, or not finite.
    pub fn factor_by_any(&mut self, pattern: &Pattern, order: &LuOrder, values: &[T]) -> Result<(), PivotShrunk> {
        self.factor_with(0.0, pattern, order, values)
    }

    fn factor_with(&mut self, least: f64, pattern: &Pattern, order: &LuOrder, values: &[T]) -> Result<(), PivotShrunk> {
        let n = order.rows.len();
        equilibrate(pattern, |e| values[e].size(), &mut self.row_scale, &mut self.col_scale);
        self.lower.resize(order.lower.entries.len(), T::default());
        self.upper.resize(order.upper.entries.len(), T::default());
        self.pivots.resize(n, T::default());
        self.work.clear();
        self.work.resize(n, T::default());
        let w = &mut self.work[..];
        for k in 0..n {
            let scale = self.row_scale[order.rows[k]];
            for &(e, j) in &order.given.entries[order.given.range(k)] {
                let j = j as usize;
                w[j] = values[e as usize].scaled(scale * self.col_scale[order.cols[j]]);
            }
            for slot in order.lower.range(k) {
                let j = order.lower.entries[slot] as usize;
                let factor = std::mem::take(&mut w[j]).times(self.pivots[j]);
                self.lower[slot] = factor;
                let row = order.upper.range(j);
                for (&p, u) in order.upper.entries[row.clone()].iter().zip(&self.upper[row]) {
                    let x = &mut w[p as usize];
                    *x = x.less(factor, *u);
                }
            }
            let pivot = std::mem::take(&mut w[k]);
            let mut largest = 0.0f64;
            for slot in order.upper.range(k) {
                let x = std::mem::take(&mut w[order.upper.entries[slot] as usize]);
                self.upper[slot] = x;
                largest = largest.max(x.size());
            }
            let size = pivot.size();
            // a NaN serves neither
            if !(size > 0.0 && size >= least * largest && size.is_finite()) {
                return Err(PivotShrunk { step: k, pivot: size, reference: largest });
            }
            self.pivots[k] = pivot.reciprocal();
        }
        Ok(())
    }

    /// `x ← A⁻¹ x` with the last factors: rows of the matrix in, columns out.
    pub fn solve(&mut self, order: &LuOrder, x: &mut [T]) {
        let (n, w) = (order.rows.len(), &mut self.work[..]);
        for k in 0..n {
            let row = order.rows[k];
            let mut sum = x[row].scaled(self.row_scale[row]);
            let range = order.lower.range(k);
            for (&j, l) in order.lower.entries[range.clone()].iter().zip(&self.lower[range]) {
                sum = sum.less(*l, w[j as usize]);
            }
            w[k] = sum;
        }
        for k in (0..n).rev() {
            let mut sum = w[k];
            let range = order.upper.range(k);
            for (&j, u) in order.upper.entries[range.clone()].iter().zip(&self.upper[range]) {
                sum = sum.less(*u, w[j as usize]);
            }
            w[k] = sum.times(self.pivots[k]);
            x[order.cols[k]] = w[k].scaled(self.col_scale[order.cols[k]]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A saddle matrix of a chain: blocks of two masses and a condition, with neighbours; units of rows and columns over many
    /// orders.
    fn chain(n: usize, rng: &mut fastrand::Rng) -> (Pattern, Vec<f64>) {
        let (mut rows, mut values) = (Vec::new(), Vec::new());
        let units: Vec<f64> = (0..6 * n).map(|_| 10f64.powf(6.0 * rng.f64())).collect();
        for i in 0..n {
            let own = 3 * i;
            for (row, cols) in [
                (own, vec![(own, 2.0), (own + 2, 1.0), (own + 3, 0.3)]),
                (own + 1, vec![(own + 1, 3.0), (own + 2, 1.0), (own.wrapping_sub(2), 0.4)]),
                (own + 2, vec![(own, 1.0), (own + 1, 1.0)]),
            ] {
                let inside: Vec<_> = cols.into_iter().filter(|(j, _)| *j < 3 * n).collect();
                values.extend(inside.iter().map(|(j, x)| x * (0.8 + 0.4 * rng.f64()) * units[row] / units[3 * n + j]));
                rows.push(inside.into_iter().map(|e| e.0).collect());
            }
        }
        (Pattern::from_rows(3 * n, &rows), values)
    }

    fn product<T: Number>(pattern: &Pattern, values: &[T], x: &[T]) -> Vec<T> {
        let row =
            |i: usize| pattern.row(i).fold(T::default(), |sum, e| sum.plus(values[e].times(x[pattern.col_idx[e]])));
        (0..pattern.rows).map(row).collect()
    }

    #[test]
    fn solutions_satisfy_the_equations_real_and_complex() {
        let mut rng = fastrand::Rng::with_seed(11);
        for n in [1, 2, 5, 40] {
            let (pattern, values) = chain(n, &mut rng);
            let order = LuOrder::new(&pattern, &values).unwrap();
            let close = |found: f64, x: f64| assert!((found - x).abs() < 1e-10 * (1.0 + x.abs()), "{found} {x}");
            let x: Vec<f64> = (0..3 * n).map(|_| rng.f64() - 0.5).collect();
            let mut factors = LuFactors::default();
            factors.factor(&pattern, &order, &values).unwrap();
            let mut found = product(&pattern, &values, &x);
            factors.solve(&order, &mut found);
            found.iter().zip(&x).for_each(|(found, x)| close(*found, *x));
            let complex: Vec<Complex> = values.iter().map(|x| [*x, 0.3 * x]).collect();
            let mut factors = LuFactors::default();
            factors.factor(&pattern, &order, &complex).unwrap();
            let pairs: Vec<Complex> = x.iter().map(|x| [*x, 1.0 - x]).collect();
            let mut found = product(&pattern, &complex, &pairs);
            factors.solve(&order, &mut found);
            found.iter().zip(&pairs).for_each(|(f, x)| (0..2).for_each(|i| close(f[i], x[i])));
        }
    }

    #[test]
    fn work_grows_as_the_chain_and_not_faster() {
        let mut rng = fastrand::Rng::with_seed(12);
        let [short, long] = [50, 400].map(|n| {
            let (pattern, values) = chain(n, &mut rng);
            LuOrder::new(&pattern, &values).unwrap().multiplications()
        });
        assert!(long < 12 * short, "{short} {long}");
    }

    #[test]
    fn an_order_whose_pivot_vanishes_no_longer_serves() {
        let pattern = Pattern::dense(2, 2);
        let order = LuOrder::new(&pattern, &[1.0, 0.3, 0.2, 1.0]).unwrap();
        let mut factors = LuFactors::default();
        assert!(factors.factor(&pattern, &order, &[0.0, 1.0, 1.0, 0.0]).is_err());
        assert!(factors.factor(&pattern, &order, &[f64::NAN, 1.0, 1.0, 0.0]).is_err());
        let weak = [1e-12, 1.0, 1.0, 0.0];
        assert!(factors.factor(&pattern, &order, &weak).is_err());
        let weak = [1e-5, 1.0, 1.0, 0.0];
        for any in [false, true] {
            let f = if any { LuFactors::factor_by_any } else { LuFactors::factor };
            f(&mut factors, &pattern, &order, &weak).unwrap();
            let mut x = [1.0, 1e-5];
            factors.solve(&order, &mut x);
            // numbers grow by one over the weak pivot, and so does their rounding
            assert!((x[0] - 1e-5).abs() < 1e-10 && (x[1] - (1.0 - 1e-10)).abs() < 1e-14, "{x:?}");
        }
        // two weak pivots, each of which would do
        let four = Pattern::dense(4, 4);
        let tried = |w: f64| [w, 1.0, 0.3, 0.2, 1.0, 0.1, 0.7, 0.4, 0.3, 0.6, w, 1.0, 0.2, 0.5, 1.0, 0.1];
        let strong = [1.0, 0.1, 0.0, 0.0, 0.1, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.1, 0.0, 0.0, 0.1, 1.0];
        let order_of_four = LuOrder::new(&four, &strong).unwrap();
        for weak in [1e-3, 1e-5, 1e-7] {
            let served = factors.factor(&four, &order_of_four, &tried(weak)).is_ok();
            let mut x = [1.0; 4];
            if served {
                factors.solve(&order_of_four, &mut x);
                product(&four, &tried(weak), &x).iter().for_each(|y| assert!((y - 1.0).abs() < 1e-6, "{weak} {y}"));
            }
            assert!(served || weak < 1e-3, "{weak}");
        }
        let order = LuOrder::new(&pattern, &[0.0, 1.0, 1.0, 0.0]).unwrap();
        factors.factor(&pattern, &order, &[0.0, 1.0, 1.0, 0.0]).unwrap();
        let mut x = [3.0, 4.0];
        factors.solve(&order, &mut x);
        assert_eq!(x, [4.0, 3.0]);
        assert!(LuOrder::new(&pattern, &[1.0, 1.0, 1.0, 1.0]).is_err(), "singular");
    }
}
