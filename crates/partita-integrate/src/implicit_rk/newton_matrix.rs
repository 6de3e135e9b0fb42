//! The matrices of Newton's method, transformed to a real and a complex system.
//!
//! ```text
//! (μ − A) x = r;     where A = [0 1; K D] and x = (z, u):   (μ² − μ D − K) z = r_u + (μ − D) r_z,   u = μ z − r_z
//! ```

use super::coefficients::{COMPLEX, REAL};
use partita_math::dense::{lu, lu_complex, lu_complex_solve, lu_solve, Complex, Singular};
use partita_system::linear_rates::LinearRates;
use partita_system::sparse_rates::{ComplexShift, RealShift};

/// Factors for one length of step.
#[derive(Debug, Default)]
pub(super) struct NewtonMatrix {
    /// The length, and the size of the systems.
    h: f64,
    n: usize,
    real: Vec<f64>,
    real_order: Vec<usize>,
    complex: Vec<Complex>,
    complex_order: Vec<usize>,
    own: Vec<f64>,
    pair: Vec<Complex>,
    /// Where A is not formed.
    sparse_real: RealShift,
    sparse_complex: ComplexShift,
}

#[inline(always)]
fn times([a, b]: Complex, [c, d]: Complex) -> Complex {
    [a * c - b * d, a * d + b * c]
}

/// μ of the complex system for steps of length h.
fn complex_over(h: f64) -> Complex {
    [COMPLEX[0] / h, -COMPLEX[1] / h]
}

impl NewtonMatrix {
    /// μ of the real system for steps of length h.
    pub(super) fn shift(h: f64) -> f64 {
        REAL / h
    }

    /// Whether the factors are those of steps of length h.
    pub(super) fn is_for(&self, h: f64) -> bool {
        self.h == h
    }

    /// The rates changed.
    pub(super) fn forget(&mut self) {
        self.h = 0.0;
    }

    /// Factor for steps of length h.
    ///
    /// # Errors
    /// A singular matrix, or one that is not finite.
    pub(super) fn factor(&mut self, linear: &LinearRates, h: f64) -> Result<(), Singular> {
        self.h = 0.0;
        let (count, a) = (linear.count, &linear.a);
        let (real, pair) = (Self::shift(h), complex_over(h));
        if let Some(sparse) = linear.unformed() {
            let singular = |_| Singular { index: 0, pivot: 0.0 };
            self.sparse_real.factor(sparse, real).map_err(singular)?;
            self.sparse_complex.try_before(&self.sparse_real);
            self.sparse_complex.factor(sparse, pair).map_err(singular)?;
            self.h = h;
            return Ok(());
        }
        self.n = if linear.second_order { count / 2 } else { count };
        let n = self.n;
        self.real.clear();
        self.complex.clear();
        for i in 0..n {
            for j in 0..n {
                let one = f64::from(u8::from(i == j));
                let entry = |mu: Complex| -> Complex {
                    if linear.second_order {
                        let (k, d) = (a[(n + i) * count + j], a[(n + i) * count + n + j]);
                        let [re, im] = times(mu, [one * mu[0] - d, one * mu[1]]);
                        [re - k, im]
                    } else {
                        [one * mu[0] - a[i * count + j], one * mu[1]]
                    }
                };
                self.real.push(entry([real, 0.0])[0]);
                self.complex.push(entry(pair));
            }
        }
        self.real_order.resize(n, 0);
        self.complex_order.resize(n, 0);
        self.own.resize(n, 0.0);
        self.pair.resize(n, [0.0; 2]);
        lu(&mut self.real, n, &mut self.real_order)?;
        lu_complex(&mut self.complex, n, &mut self.complex_order)?;
        self.h = h;
        Ok(())
    }

    /// `x ← (γ/h − A)⁻¹ x`; what x carries behind it is used up.
    pub(super) fn solve_real(&mut self, linear: &LinearRates, x: &mut [f64]) {
        if let Some(sparse) = linear.unformed() {
            return self.sparse_real.solve(sparse, x);
        }
        let n = self.n;
        if !linear.second_order {
            return lu_solve(&self.real, n, &self.real_order, x);
        }
        let (mu, count) = (Self::shift(self.h), linear.count);
        let (z, u) = x.split_at_mut(n);
        for i in 0..n {
            let damped: f64 = (0..n).map(|j| linear.a[(n + i) * count + n + j] * z[j]).sum();
            self.own[i] = u[i] + mu * z[i] - damped;
        }
        lu_solve(&self.real, n, &self.real_order, &mut self.own);
        for i in 0..n {
            u[i] = mu * self.own[i] - z[i];
            z[i] = self.own[i];
        }
    }

    /// `x + i y ← (μ/h − A)⁻¹ (x + i y)` for μ = α − i β.
    pub(super) fn solve_complex(&mut self, linear: &LinearRates, x: &mut [f64], y: &mut [f64]) {
        if let Some(sparse) = linear.unformed() {
            self.pair.clear();
            self.pair.extend(x.iter().zip(&*y).map(|(x, y)| [*x, *y]));
            self.sparse_complex.solve(sparse, &mut self.pair);
            self.pair.iter().zip(x.iter_mut().zip(y)).for_each(|(p, (x, y))| [*x, *y] = *p);
            return;
        }
        let n = self.n;
        if !linear.second_order {
            self.pair.iter_mut().zip(x.iter().zip(&*y)).for_each(|(p, (x, y))| *p = [*x, *y]);
            lu_complex_solve(&self.complex, n, &self.complex_order, &mut self.pair);
            self.pair.iter().zip(x.iter_mut().zip(y)).for_each(|(p, (x, y))| [*x, *y] = *p);
            return;
        }
        let (mu, count) = (complex_over(self.h), linear.count);
        for i in 0..n {
            let row = &linear.a[(n + i) * count + n..(n + i + 1) * count];
            let damped = row.iter().zip(x.iter().zip(&*y)).fold([0.0; 2], |[a, b], (d, (x, y))| [a + d * x, b + d * y]);
            let [re, im] = times(mu, [x[i], y[i]]);
            self.pair[i] = [x[n + i] + re - damped[0], y[n + i] + im - damped[1]];
        }
        lu_complex_solve(&self.complex, n, &self.complex_order, &mut self.pair);
        for i in 0..n {
            let [re, im] = times(mu, self.pair[i]);
            (x[n + i], y[n + i]) = (re - x[i], im - y[i]);
            [x[i], y[i]] = self.pair[i];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Damped oscillators, coupled, of very different frequencies.
    fn oscillators(n: usize, second_order: bool) -> LinearRates {
        let mut out = LinearRates { count: 2 * n, second_order, a: vec![0.0; 4 * n * n], ..LinearRates::default() };
        for i in 0..n {
            out.a[i * 2 * n + n + i] = 1.0;
            for j in 0..n {
                let near = if i == j { 1.0 } else { 0.3 / (1.0 + (i + 2 * j) as f64) };
                out.a[(n + i) * 2 * n + j] = -near * 10f64.powi(2 * i as i32);
                out.a[(n + i) * 2 * n + n + j] = -0.1 * near * 10f64.powi(i as i32);
            }
        }
        out
    }

    #[test]
    fn the_small_system_of_second_order_has_the_solution_of_the_whole_one() {
        for n in 1..6 {
            let [mut small, mut whole] = [NewtonMatrix::default(), NewtonMatrix::default()];
            let (reduced, full) = (oscillators(n, true), oscillators(n, false));
            small.factor(&reduced, 0.01).unwrap();
            whole.factor(&full, 0.01).unwrap();
            let r: Vec<f64> = (0..2 * n).map(|i| 1.0 - 0.7 * i as f64).collect();
            let s: Vec<f64> = (0..2 * n).map(|i| 0.2 + (i as f64).sin()).collect();
            let [mut a, mut b] = [r.clone(), r.clone()];
            small.solve_real(&reduced, &mut a);
            whole.solve_real(&full, &mut b);
            let close = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-10 * (1.0 + b.abs()));
            assert!(close(&a, &b), "{a:?} {b:?}");
            let [mut ax, mut ay, mut bx, mut by] = [r.clone(), s.clone(), r, s];
            small.solve_complex(&reduced, &mut ax, &mut ay);
            whole.solve_complex(&full, &mut bx, &mut by);
            assert!(close(&ax, &bx) && close(&ay, &by), "{ax:?} {bx:?}");
        }
    }
}
