//! Mass-orthonormal tangent velocities (Liang, Lance 1987; Agrawal, Saigal 1989; Blajer 1995).
//!
//! `D₀ M₀ D₀ᵀ = 1`, S = D₀ M₀: the reduced mass matrix is the identity when the basis is frozen and its quality √μ_S is 1, the
//! best there is, whatever the units; u' is the reduced force itself there. The vectors are those of a Gram-Schmidt process in
//! the mass metric that begins with the constraints. Cost when frozen: that of [`qr`](super::qr) + n³/6 + n²(m + k)/2. The basis
//! to take where one is to last.

use super::Basis;
use partita_math::dense::{self, Matrix};
use partita_math::factor::{self, FactorError};

/// Rows of S: mass-orthonormal tangent vectors, seen as covectors.
pub struct GramSchmidt;

/// Twice is enough: what the first pass leaves of a vector along the others, up to ε times its condition, the second removes.
const PASSES: usize = 2;

impl Basis for GramSchmidt {
    fn name(&self) -> &'static str {
        "gram-schmidt"
    }
    fn basis(&self, mass: &Matrix, c: &Matrix) -> Result<Matrix, FactorError> {
        let n = mass.rows();
        let mut l = mass.data().to_vec();
        dense::cholesky(&mut l, n).map_err(|e| match e.pivot.is_finite() {
            true => FactorError::NotPositiveDefinite { index: e.index },
            false => FactorError::NotFinite,
        })?;
        // with x̂ = Lᵀ x the mass metric is the plain one; covectors become L⁻¹ c
        let mut hats = c.clone();
        for i in 0..c.rows() {
            dense::cholesky_forward(&l, n, hats.row_mut(i));
        }
        // the constraints first (the tangent vectors are what is orthogonal to them)
        let range = match c.rows() {
            0 => Matrix::new(n, 0),
            _ => factor::qr_null_space(&hats)?.range,
        };
        let mut done: Vec<Vec<f64>> = (0..range.cols()).map(|j| (0..n).map(|i| range[(i, j)]).collect()).collect();
        let r = done.len();
        while done.len() < n {
            // next the unit vector of which the most is left: at least (n − done)/n of its square
            let left = |i: &usize| 1.0 - done.iter().map(|x| x[*i] * x[*i]).sum::<f64>();
            let Some(next) = (0..n).max_by(|a, b| left(a).total_cmp(&left(b))) else { break };
            let mut x = vec![0.0; n];
            x[next] = 1.0;
            for _ in 0..PASSES {
                for y in &done {
                    let along = dense::dot(&x, y);
                    dense::axpy(-along, y, &mut x);
                }
                let length = dense::dot(&x, &x).sqrt();
                x.iter_mut().for_each(|x| *x /= length);
            }
            done.push(x);
        }
        // D₀ = x̂ᵀ L⁻¹, so S = D₀ L Lᵀ = x̂ᵀ Lᵀ
        let mut s = Matrix::new(n - r, n);
        for (j, x) in done[r..].iter().enumerate() {
            for i in 0..n {
                s[(j, i)] = dense::dot(&l[i * n..=i * n + i], x);
            }
        }
        Ok(s)
    }
}
