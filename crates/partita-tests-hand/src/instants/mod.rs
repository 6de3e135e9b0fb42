//! Constrained systems at one instant: random matrices in random units, handed to the library as a user-defined system.
#![allow(dead_code, reason = "each test file uses the part it needs")]

use partita_math::dense::{self, Matrix};
use partita_math::factor;
use partita_system::equations::{Equations, UserSystem};
use partita_system::formulation::{Findings, Formulation, Purpose, Step, StepDecision};
use partita_system::options::TangentMap;
use partita_system::record::{Output, Sample};
use partita_system::reduction::Reduction;
use partita_system::SystemError;

/// M, C, h, a, b that stay as they are; Φ = C q.
#[derive(Clone, Debug)]
pub struct Instant {
    pub mass: Matrix,
    pub c: Matrix,
    pub h: Vec<f64>,
    pub a: Vec<f64>,
    pub b: Vec<f64>,
}

impl Equations for Instant {
    fn n(&self) -> usize {
        self.mass.rows()
    }
    fn rows(&self) -> usize {
        self.c.rows()
    }
    fn holonomic(&self) -> usize {
        self.c.rows()
    }
    fn name(&self, i: usize) -> String {
        format!("q{i}")
    }
    fn rheonomic(&self) -> bool {
        true
    }
    fn mass(&self, _: f64, _: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        out.copy_from_slice(self.mass.data());
        Ok(())
    }
    fn forces(&self, _: f64, _: &[f64], _: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        out.copy_from_slice(&self.h);
        Ok(())
    }
    fn constraints(&self, _: f64, q: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        out.copy_from_slice(&self.c.matvec(q));
        Ok(())
    }
    fn jacobian(&self, _: f64, _: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        out.copy_from_slice(self.c.data());
        Ok(())
    }
    fn rate(&self, _: f64, _: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        out.copy_from_slice(&self.a);
        Ok(())
    }
    fn bias(&self, _: f64, _: &[f64], _: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        out.copy_from_slice(&self.b);
        Ok(())
    }
}

pub fn between(rng: &mut fastrand::Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * rng.f64()
}

pub fn vector(rng: &mut fastrand::Rng, n: usize) -> Vec<f64> {
    (0..n).map(|_| between(rng, -1.0, 1.0)).collect()
}

/// Factors that change units by up to a thousand either way.
pub fn units(rng: &mut fastrand::Rng, n: usize) -> Vec<f64> {
    (0..n).map(|_| 10f64.powf(between(rng, -3.0, 3.0))).collect()
}

fn scaled(x: &Matrix, rows: &[f64], cols: &[f64]) -> Matrix {
    let data = (0..x.rows() * x.cols()).map(|e| x.data()[e] * rows[e / x.cols()] * cols[e % x.cols()]).collect();
    Matrix::from_vec(x.rows(), x.cols(), data)
}

impl Instant {
    /// n velocities, m rows; M has the condition `condition` before the units are drawn.
    pub fn random(rng: &mut fastrand::Rng, n: usize, m: usize, condition: f64) -> Self {
        // M = U diag(λ) Uᵀ with U the singular vectors of a random matrix
        let u = factor::svd_full(&Matrix::from_vec(n, n, vector(rng, n * n))).unwrap().u;
        let ends = |i: usize| condition.powf(-(i as f64) / (n - 1).max(1) as f64);
        let d: Vec<f64> = (0..n).map(ends).collect();
        let one = vec![1.0; n];
        let mass = scaled(&u, &one, &d).matmul(&u.transpose());
        // symmetric to the last bit
        let mass =
            Matrix::from_vec(n, n, (0..n * n).map(|e| 0.5 * (mass[(e / n, e % n)] + mass[(e % n, e / n)])).collect());
        let c = Matrix::from_vec(m, n, vector(rng, m * n));
        let plain = Self { mass, c, h: vector(rng, n), a: vector(rng, m), b: vector(rng, m) };
        let (s, x) = (units(rng, n), units(rng, m));
        plain.in_units(&s).recombined(&scaled(&Matrix::identity(m), &x, &vec![1.0; m]))
    }

    /// The same system in q' = S q.
    pub fn in_units(&self, s: &[f64]) -> Self {
        let inverse: Vec<f64> = s.iter().map(|s| 1.0 / s).collect();
        let one = vec![1.0; self.c.rows()];
        Self {
            mass: scaled(&self.mass, &inverse, &inverse),
            c: scaled(&self.c, &one, &inverse),
            h: self.h.iter().zip(&inverse).map(|(h, s)| h * s).collect(),
            a: self.a.clone(),
            b: self.b.clone(),
        }
    }

    /// The same system with Φ' = X Φ.
    pub fn recombined(&self, x: &Matrix) -> Self {
        Self { c: x.matmul(&self.c), a: x.matvec(&self.a), b: x.matvec(&self.b), ..self.clone() }
    }

    /// The same system with its velocities in another order: new i is old `order[i]`.
    pub fn reordered(&self, order: &[usize]) -> Self {
        let (n, m) = (order.len(), self.c.rows());
        Self {
            mass: Matrix::from_vec(n, n, (0..n * n).map(|e| self.mass[(order[e / n], order[e % n])]).collect()),
            c: Matrix::from_vec(m, n, (0..m * n).map(|e| self.c[(e / n, order[e % n])]).collect()),
            h: order.iter().map(|&i| self.h[i]).collect(),
            a: self.a.clone(),
            b: self.b.clone(),
        }
    }

    pub fn user_system(self) -> UserSystem<Self> {
        UserSystem::new(self)
    }
}

/// M⁻¹ by Cholesky.
pub fn inverse(m: &Matrix) -> Matrix {
    let n = m.rows();
    let (mut l, mut out) = (m.data().to_vec(), vec![0.0; n * n]);
    dense::cholesky(&mut l, n).unwrap();
    dense::inverse_from_cholesky(&l, n, &mut out);
    Matrix::from_vec(n, n, out)
}

/// Lower Cholesky factor with zeros above the diagonal.
pub fn lower(m: &Matrix) -> Matrix {
    let n = m.rows();
    let mut l = m.data().to_vec();
    dense::cholesky(&mut l, n).unwrap();
    Matrix::from_vec(n, n, (0..n * n).map(|e| if e % n <= e / n { l[e] } else { 0.0 }).collect())
}

/// L⁻¹ X for a lower triangle L, column by column.
pub fn forward(l: &Matrix, x: &Matrix) -> Matrix {
    let mut out = x.clone();
    for j in 0..x.cols() {
        let mut column: Vec<f64> = (0..x.rows()).map(|i| x[(i, j)]).collect();
        dense::cholesky_forward(l.data(), l.rows(), &mut column);
        (0..x.rows()).for_each(|i| out[(i, j)] = column[i]);
    }
    out
}

/// Rows and columns of M.
pub fn block(m: &Matrix, rows: &[usize], cols: &[usize]) -> Matrix {
    let data = rows.iter().flat_map(|&i| cols.iter().map(move |&j| (i, j))).map(|e| m[e]).collect();
    Matrix::from_vec(rows.len(), cols.len(), data)
}

/// ln det of a symmetric positive definite matrix (logarithms: the units are many powers of ten apart).
pub fn log_det(m: &Matrix) -> f64 {
    let l = lower(m);
    (0..m.rows()).map(|i| 2.0 * l[(i, i)].ln()).sum()
}

/// ln |det| of a square matrix.
pub fn log_det_general(m: &Matrix) -> f64 {
    let n = m.rows();
    let (mut f, mut piv) = (m.data().to_vec(), vec![0; n]);
    match dense::lu(&mut f, n, &mut piv) {
        Ok(()) => (0..n).map(|i| f[i * n + i].abs().ln()).sum(),
        Err(_) => f64::NEG_INFINITY,
    }
}

/// D = Dᵀᵀ as a matrix (k x n).
pub fn tangent<S: partita_system::ConstrainedSystem>(r: &Reduction<S>) -> Matrix {
    Matrix::from_vec(r.size().nv, r.k(), r.at.dt.clone()).transpose()
}

/// D, γ and δ written out.
#[derive(Clone)]
pub struct GivenTangent {
    pub dt: Vec<f64>,
    pub gamma: Vec<f64>,
    pub delta: Vec<f64>,
}

impl TangentMap for GivenTangent {
    fn tangent(&self, _: f64, _: &[f64], dt: &mut [f64]) -> Result<(), SystemError> {
        dt.copy_from_slice(&self.dt);
        Ok(())
    }
    fn offset(&self, _: f64, _: &[f64], gamma: &mut [f64]) -> Result<(), SystemError> {
        gamma.copy_from_slice(&self.gamma);
        Ok(())
    }
    fn bias(&self, _: f64, _: &[f64], _: &[f64], delta: &mut [f64]) -> Result<bool, SystemError> {
        delta.copy_from_slice(&self.delta);
        Ok(true)
    }
}

/// Carry out a verdict where steps are fixed; true if y was rewritten.
pub fn commit(f: &mut dyn Formulation, verdict: StepDecision, t: f64, y: &mut [f64], dy: &mut [f64]) -> bool {
    let mut turns = vec![0; y.len()];
    f.commit(verdict, &mut Step { t, y, dy, turns: &mut turns, pace: None, findings: Findings::default() }).unwrap()
}

/// All that a formulation tells about the state y.
pub fn sample(f: &mut dyn Formulation, t: f64, y: &[f64]) -> Sample {
    let mut output = Output::default();
    f.state_at(t, y, Purpose::Look, &mut output).unwrap();
    Sample::of(f, &output, &[]).unwrap()
}
