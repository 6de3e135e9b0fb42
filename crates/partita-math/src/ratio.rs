//! The least ratio of two quadratic forms that are known by their products with vectors.

use crate::dense::{dot, Matrix};
use crate::{factor, tolerance};

/// Products at most. Scale: products of each form. Reason: a hundred give six digits where neighbouring ratios lie close.
const MOST: usize = 300;
/// Gain of a step that counts, and steps in a row without one that end the search. Scale: ratio. Reason: gains of a slow
/// search add up to a thousand times as much, which leaves six digits.
const GAIN: f64 = 1e-9;
const PATIENCE: usize = 3;

/// A vector with its products.
#[derive(Clone)]
struct Direction {
    x: Vec<f64>,
    ax: Vec<f64>,
    bx: Vec<f64>,
}

impl Direction {
    fn add(&mut self, factor: f64, other: &Self) {
        for (to, from) in [(&mut self.x, &other.x), (&mut self.ax, &other.ax), (&mut self.bx, &other.bx)] {
            to.iter_mut().zip(from).for_each(|(to, from)| *to += factor * from);
        }
    }

    fn scale(&mut self, factor: f64) {
        [&mut self.x, &mut self.ax, &mut self.bx].into_iter().flatten().for_each(|x| *x *= factor);
    }

    /// Of unit length and orthogonal to others, in the metric B; none where nothing of it is left.
    fn orthonormal(mut self, others: &[Self]) -> Option<Self> {
        let before = dot(&self.x, &self.bx).max(0.0).sqrt();
        // twice, since the first time leaves round-off of what it takes away
        for other in others.iter().chain(others) {
            self.add(-dot(&self.x, &other.bx), other);
        }
        let length = dot(&self.x, &self.bx).max(0.0).sqrt();
        if length.is_nan() || length <= tolerance::LONG_ROUNDING * before {
            return None;
        }
        self.scale(1.0 / length);
        Some(self)
    }
}

/// Two symmetric forms of n numbers, B positive definite.
pub trait Forms {
    /// Why a product cannot be computed.
    type Error;

    /// A x and B x.
    fn products(&mut self, x: &[f64], ax: &mut [f64], bx: &mut [f64]) -> Result<(), Self::Error>;

    /// Near A⁻¹ x, in place: the nearer, the fewer products are asked for. Symmetric and positive definite.
    fn precondition(&mut self, x: &mut [f64]) -> Result<(), Self::Error>;
}

/// The least `xᵀ A x / xᵀ B x` from this first vector on, by the best combination of the last vector, its preconditioned
/// gradient and the last step.
///
/// Cost: some tens to hundreds of products. Accuracy: from above; six digits where the preconditioner is near A⁻¹.
///
/// # Errors
/// Those of the products.
pub fn least_ratio<F: Forms>(first: Vec<f64>, forms: &mut F) -> Result<f64, F::Error> {
    let n = first.len();
    let made = |x: Vec<f64>, forms: &mut F| {
        let mut all = Direction { x, ax: vec![0.0; n], bx: vec![0.0; n] };
        forms.products(&all.x, &mut all.ax, &mut all.bx).map(|()| all)
    };
    let Some(mut best) = made(first, forms)?.orthonormal(&[]) else { return Ok(f64::NAN) };
    let mut least = dot(&best.x, &best.ax);
    let (mut last, mut idle): (Option<Direction>, usize) = (None, 0);
    for _ in 0..MOST {
        let mut gradient: Vec<f64> = best.ax.iter().zip(&best.bx).map(|(a, b)| a - least * b).collect();
        forms.precondition(&mut gradient)?;
        let mut all = vec![best];
        for direction in [Some(made(gradient, forms)?), last.take()].into_iter().flatten() {
            all.extend(direction.orthonormal(&all));
        }
        let mut small = Matrix::new(all.len(), all.len());
        for i in 0..all.len() {
            for j in 0..all.len() {
                small[(i, j)] = 0.5 * (dot(&all[i].x, &all[j].ax) + dot(&all[j].x, &all[i].ax));
            }
        }
        let Ok((_, vectors)) = factor::symmetric_eigen(&small) else { return Ok(f64::NAN) };
        let mut step = Direction { x: vec![0.0; n], ax: vec![0.0; n], bx: vec![0.0; n] };
        (1..all.len()).for_each(|i| step.add(vectors[(i, 0)], &all[i]));
        best = all.swap_remove(0);
        best.scale(vectors[(0, 0)]);
        best.add(1.0, &step);
        best.scale(1.0 / dot(&best.x, &best.bx).sqrt());
        let now = dot(&best.x, &best.ax);
        idle = if least - now > GAIN * least.abs() { 0 } else { idle + 1 };
        (least, last) = (least.min(now), Some(step));
        if idle == PATIENCE {
            break;
        }
    }
    Ok(least)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dense;
    use std::convert::Infallible;

    fn random_form(n: usize, near: usize, random: &mut fastrand::Rng) -> Matrix {
        let mut a = Matrix::new(n, n);
        for i in 0..n {
            a[(i, i)] = 0.5 + random.f64();
            for j in i.saturating_sub(near)..i {
                let x = (random.f64() - 0.5) / near as f64;
                (a[(i, j)], a[(j, i)]) = (x, x);
            }
        }
        let mut product = a.matmul(&a.transpose());
        (0..n).for_each(|i| product[(i, i)] += 0.05);
        product
    }

    struct Dense<'m> {
        a: &'m Matrix,
        b: &'m Matrix,
        /// L of A, where A⁻¹ is known.
        inverse: Option<Vec<f64>>,
    }

    impl Forms for Dense<'_> {
        type Error = Infallible;
        fn products(&mut self, x: &[f64], ax: &mut [f64], bx: &mut [f64]) -> Result<(), Infallible> {
            for (m, to) in [(self.a, ax), (self.b, bx)] {
                to.iter_mut().enumerate().for_each(|(i, to)| *to = dot(m.row(i), x));
            }
            Ok(())
        }
        fn precondition(&mut self, x: &mut [f64]) -> Result<(), Infallible> {
            match &self.inverse {
                Some(l) => dense::cholesky_solve(l, x.len(), x),
                None => x.iter_mut().enumerate().for_each(|(i, x)| *x /= self.b[(i, i)]),
            }
            Ok(())
        }
    }

    /// Against all eigenvalues of L⁻¹ A L⁻ᵀ, B = L Lᵀ.
    #[test]
    fn the_least_ratio_is_the_least_eigenvalue() {
        let mut random = fastrand::Rng::with_seed(11);
        for (n, near) in [(1, 1), (2, 1), (3, 2), (60, 59), (150, 4), (400, 2)] {
            let (a, b) = (random_form(n, near, &mut random), random_form(n, near, &mut random));
            let mut l = b.data().to_vec();
            dense::cholesky(&mut l, n).unwrap();
            // columns of L⁻¹ A, then rows
            let mut m = a.clone();
            for _ in 0..2 {
                for j in 0..n {
                    let mut column: Vec<f64> = (0..n).map(|i| m[(i, j)]).collect();
                    dense::cholesky_forward(&l, n, &mut column);
                    (0..n).for_each(|i| m[(i, j)] = column[i]);
                }
                m = m.transpose();
            }
            let least = factor::symmetric_eigen(&m).unwrap().0[0];
            let mut inverse = a.data().to_vec();
            dense::cholesky(&mut inverse, n).unwrap();
            for inverse in [None, Some(inverse)] {
                let first = (0..n).map(|i| 1.0 + 0.5 * (i as f64).sin()).collect();
                let found = least_ratio(first, &mut Dense { a: &a, b: &b, inverse });
                let found = found.unwrap_or_else(|never| match never {});
                assert!((found - least).abs() <= 1e-6 * least, "{n}: {found:e} is not {least:e}");
            }
        }
    }
}
