//! Actuators: forces E τ beside those of S1, in the reduced equations.
//!
//! ```text
//! B = D E,   B τ = τ_d := D (M v' − h)          h without the efforts τ                      (I1)
//! ```
//!
//! The columns of E (n x s) are generalised forces of unit efforts, and gradients of the quantities along which the
//! efforts act: the set can cause every motion where their parts along the admissible motions span these.

use partita_math::dense::{self, Matrix};
use partita_math::factor::{self, FactorError};
use partita_math::quadratic::{Polyhedron, ProgramError};
use partita_math::tolerance;

/// B of a set of actuators at one position, and its scale.
#[derive(Clone, Debug)]
pub struct Actuation {
    b: Matrix,
    /// Cholesky factor of M_d.
    md: Vec<f64>,
    /// L_d⁻¹ B diag(1/|k_s|): what is without units.
    scaled: Matrix,
    margin: f64,
}

/// A column of E: entries by velocity.
pub type Column = [(usize, f64)];

/// B (k x s) for Dᵀ (n x k).
pub fn reduced<'e>(dt: &[f64], k: usize, columns: impl ExactSizeIterator<Item = &'e Column>, b: &mut [f64]) {
    let s = columns.len();
    b.fill(0.0);
    for (j, column) in columns.enumerate() {
        for &(i, e) in column {
            for (r, d) in dt[i * k..(i + 1) * k].iter().enumerate() {
                b[r * s + j] += d * e;
            }
        }
    }
}

impl Actuation {
    /// For B, M_d (k x k), and |k_s|² = E_sᵀ M⁻¹ E_s of each column, which is zero where it acts on nothing.
    ///
    /// # Errors
    /// The index and the pivot where M_d is not positive definite; `None` where numbers are not finite.
    pub fn new(b: Matrix, md: &[f64], lengths2: &[f64]) -> Result<Self, Option<(usize, f64)>> {
        let (k, s) = (b.rows(), b.cols());
        let mut l = md.to_vec();
        dense::cholesky(&mut l, k).map_err(|e| Some((e.index, e.pivot)))?;
        let mut scaled = Matrix::new(k, s);
        let mut column = vec![0.0; k];
        for (j, length2) in lengths2.iter().enumerate().filter(|x| *x.1 > 0.0) {
            column.iter_mut().enumerate().for_each(|(i, x)| *x = b[(i, j)]);
            dense::cholesky_forward(&l, k, &mut column);
            column.iter().enumerate().for_each(|(i, x)| scaled[(i, j)] = x / length2.sqrt());
        }
        let singular = factor::svd(&scaled).map_err(|_: FactorError| None)?.s;
        // with more motions than actuators: how far these are from doing the same
        let margin = singular.last().copied().unwrap_or(1.0);
        Ok(Self { b, md: l, scaled, margin })
    }

    /// Smallest singular value of L_d⁻¹ B diag(1/|k_s|): 1 where the admissible motions are those along the actuators, 0
    /// where a motion escapes them, or two of them do the same.                                    (I2)
    pub fn margin(&self) -> f64 {
        self.margin
    }

    /// `L_d⁻¹ B diag(1/|k_s|)` (k x s), without units: the margin of a subset is that of its columns.
    pub fn scaled(&self) -> &Matrix {
        &self.scaled
    }

    /// Whether efforts follow from B up to rounding.
    pub fn is_regular(&self) -> bool {
        self.margin >= tolerance::SINGULAR_PIVOT
    }

    /// Actuator that does the least work on the admissible motions, and the ratio of its part along them.
    pub fn weakest(&self) -> Option<(usize, f64)> {
        let length = |j: usize| (0..self.scaled.rows()).map(|i| self.scaled[(i, j)].powi(2)).sum::<f64>().sqrt();
        (0..self.scaled.cols()).map(|j| (j, length(j))).min_by(|x, y| x.1.total_cmp(&y.1))
    }

    /// `τ = τ_0 + W⁻¹ Bᵀ (B W⁻¹ Bᵀ)⁻¹ (τ_d − B τ_0)`: of all that cause the motion those with the least (τ − τ_0)ᵀ W (τ − τ_0),
    /// W diagonal; where none does, those that leave the least in the metric M_d⁻¹.
    ///
    /// # Errors
    /// Numbers that are not finite.
    pub fn efforts(&self, needed: &[f64], preload: &[f64], weights: &[f64]) -> Result<Vec<f64>, FactorError> {
        let root: Vec<f64> = weights.iter().map(|w| w.sqrt()).collect();
        let mut g = self.half(&self.b);
        for i in 0..g.rows() {
            g.row_mut(i).iter_mut().zip(&root).for_each(|(x, root)| *x /= root);
        }
        let rest = self.rest(needed, preload);
        let (y, _) = factor::least_squares_min_norm(&g, &rest, tolerance::LOST_PIVOT)?;
        Ok(y.iter().zip(&root).zip(preload).map(|((y, root), x)| x + y / root).collect())
    }

    /// As `efforts`, between limits (lower, upper).
    ///
    /// # Errors
    /// `Infeasible` where no such efforts cause the motion.
    pub fn within(
        &self,
        needed: &[f64],
        preload: &[f64],
        weights: &[f64],
        limits: &[[f64; 2]],
    ) -> Result<Vec<f64>, ProgramError> {
        let s = self.b.cols();
        let root: Vec<f64> = weights.iter().map(|w| w.sqrt()).collect();
        let mut equations = self.half(&self.b);
        for i in 0..equations.rows() {
            equations.row_mut(i).iter_mut().zip(&root).for_each(|(x, root)| *x /= root);
        }
        let (mut normals, mut least) = (Matrix::new(2 * s, s), vec![0.0; 2 * s]);
        for (j, [lower, upper]) in limits.iter().enumerate() {
            (normals[(j, j)], normals[(s + j, j)]) = (1.0, -1.0);
            (least[j], least[s + j]) = (root[j] * (lower - preload[j]), -root[j] * (upper - preload[j]));
        }
        let values = self.rest(needed, preload);
        let y = Polyhedron { equations, values, normals, least }.nearest(&vec![0.0; s])?;
        Ok(y.iter().zip(&root).zip(preload).map(|((y, root), x)| x + y / root).collect())
    }

    /// Of all efforts that cause the motion those whose largest fraction of their limits is least: limits (lower, upper)
    /// on both sides of 0.
    ///
    /// # Errors
    /// Where the programme does not end.
    pub fn least_use(&self, needed: &[f64], limits: &[[f64; 2]]) -> Result<Vec<f64>, ProgramError> {
        let (k, s) = (self.b.rows(), self.b.cols());
        let size: Vec<f64> = limits.iter().map(|[lower, upper]| upper.max(-lower)).collect();
        let b = self.half(&self.b);
        let (mut equations, values) = (Matrix::new(k, s + 1), self.rest(needed, &vec![0.0; s]));
        let scale = values.iter().fold(f64::MIN_POSITIVE, |m: f64, x| m.max(x.abs()));
        for i in 0..k {
            equations.row_mut(i).iter_mut().zip(b.row(i)).zip(&size).for_each(|((x, b), size)| *x = b * size);
        }
        // a unit of the unknowns is about the use that is needed
        let gain = equations.max_abs().max(f64::MIN_POSITIVE);
        equations.data_mut().iter_mut().for_each(|x| *x /= gain);
        let values = values.iter().map(|x| x / scale).collect();
        let mut normals = Matrix::new(2 * s, s + 1);
        for (j, [lower, upper]) in limits.iter().enumerate() {
            (normals[(j, j)], normals[(j, s)]) = (1.0, -lower / size[j]);
            (normals[(s + j, j)], normals[(s + j, s)]) = (-1.0, upper / size[j]);
        }
        let mut cost = vec![0.0; s + 1];
        cost[s] = 1.0;
        let program = Polyhedron { equations, values, normals, least: vec![0.0; 2 * s] };
        let x = program.cheapest(&cost, &vec![0.0; s + 1])?;
        Ok(x.iter().zip(&size).map(|(x, size)| x * size * scale / gain).collect())
    }

    /// |B τ − τ_d| over the larger of two forces of which τ_d is the difference, in the metric M_d⁻¹: what the efforts
    /// leave, beside all that acts.
    pub fn remainder(&self, needed: &[f64], tau: &[f64], acting: [&[f64]; 2]) -> f64 {
        let norm = |x: Vec<f64>| dense::dot(&x, &x).sqrt();
        let still = vec![0.0; tau.len()];
        let all = acting.into_iter().map(|x| norm(self.rest(x, &still))).fold(0.0, f64::max);
        let left = norm(self.rest(needed, tau));
        if all > 0.0 {
            left / all
        } else {
            left
        }
    }

    /// Efforts that cause no motion (s x (s − k), in columns): orthonormal in the metric W.
    ///
    /// # Errors
    /// Numbers that are not finite.
    pub fn null_space(&self, weights: &[f64]) -> Result<Matrix, FactorError> {
        let (k, s) = (self.b.rows(), self.b.cols());
        let root: Vec<f64> = weights.iter().map(|w| w.sqrt()).collect();
        let mut g = self.half(&self.b);
        for i in 0..k {
            g.row_mut(i).iter_mut().zip(&root).for_each(|(x, root)| *x /= root);
        }
        let v = factor::svd_full(&g)?.v;
        let mut null = Matrix::new(s, s.saturating_sub(k));
        for i in 0..s {
            for j in 0..null.cols() {
                null[(i, j)] = v[(i, k + j)] / root[i];
            }
        }
        Ok(null)
    }

    /// B.
    pub fn b(&self) -> &Matrix {
        &self.b
    }

    /// L_d⁻¹ (τ_d − B τ).
    fn rest(&self, needed: &[f64], tau: &[f64]) -> Vec<f64> {
        let mut rest: Vec<f64> = needed.iter().zip(self.b.matvec(tau)).map(|(x, y)| x - y).collect();
        dense::cholesky_forward(&self.md, rest.len(), &mut rest);
        rest
    }

    /// L_d⁻¹ of a matrix.
    fn half(&self, x: &Matrix) -> Matrix {
        let mut columns = x.transpose();
        (0..columns.rows()).for_each(|j| dense::cholesky_forward(&self.md, x.rows(), columns.row_mut(j)));
        columns.transpose()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// M_d and three actuators of two motions.
    fn set() -> Actuation {
        let b = Matrix::from_vec(2, 3, vec![1.0, 0.5, -0.3, 0.2, 2.0, 1.1]);
        Actuation::new(b, &[2.0, 0.4, 0.4, 1.0], &[0.7, 3.0, 1.9]).unwrap()
    }

    /// What is needed is given, what is left over is least, and nothing else causes no motion.
    #[test]
    fn of_more_actuators_than_motions_the_least_efforts_are_taken() {
        let (set, needed, preload, weights) = (set(), [1.3, -0.7], [0.2, -0.4, 0.9], [1.0, 3.0, 0.25]);
        let found = set.efforts(&needed, &preload, &weights).unwrap();
        let given = set.b().matvec(&found);
        assert!(given.iter().zip(&needed).all(|(x, y)| (x - y).abs() < 1e-14));
        let null = set.null_space(&weights).unwrap();
        let n: Vec<f64> = (0..3).map(|i| null[(i, 0)]).collect();
        assert!(set.b().matvec(&n).iter().all(|x| x.abs() < 1e-14));
        let weighed = |x: &[f64], y: &[f64]| (0..3).map(|i| weights[i] * x[i] * y[i]).sum::<f64>();
        let more: Vec<f64> = found.iter().zip(&preload).map(|(x, y)| x - y).collect();
        assert!((weighed(&n, &n) - 1.0).abs() < 1e-14 && weighed(&n, &more).abs() < 1e-14);
    }

    /// Units of efforts and of motions cancel.
    #[test]
    fn the_margin_has_no_unit() {
        let b = [1.0, 0.5, -0.3, 0.2, 2.0, 1.1];
        let (of_motion, of_effort) = ([1e3, 0.1], [1e-2, 7.0, 40.0]);
        let scaled = (0..6).map(|e| b[e] * of_motion[e / 3] * of_effort[e % 3]).collect();
        let md: Vec<f64> =
            [2.0, 0.4, 0.4, 1.0].iter().enumerate().map(|(e, m)| m * of_motion[e / 2] * of_motion[e % 2]).collect();
        let lengths2: Vec<f64> = [0.7, 3.0, 1.9].iter().zip(of_effort).map(|(x, u)| x * u * u).collect();
        let other = Actuation::new(Matrix::from_vec(2, 3, scaled), &md, &lengths2).unwrap();
        assert!((other.margin() - set().margin()).abs() < 1e-14);
    }

    /// One actuator of two motions leaves what is perpendicular to it in the metric M_d⁻¹.
    #[test]
    fn what_cannot_be_caused_remains() {
        let set = Actuation::new(Matrix::from_vec(2, 1, vec![1.0, 0.0]), &[1.0, 0.0, 0.0, 4.0], &[1.0]).unwrap();
        let found = set.efforts(&[3.0, 8.0], &[0.0], &[1.0]).unwrap();
        let left = set.remainder(&[3.0, 8.0], &found, [&[3.0, 8.0], &[0.0, 0.0]]);
        assert!((found[0] - 3.0).abs() < 1e-14 && (left - 0.8).abs() < 1e-14);
        assert_eq!(Actuation::new(Matrix::new(1, 1), &[1.0], &[0.0]).unwrap().margin(), 0.0);
    }
}
