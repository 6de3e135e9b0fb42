//! The stages of a step by Newton's method.
//!
//! ```text
//! R_i = f(t + c_i h, y + Z_i) − Σ A⁻¹_ij Z_j / h      R_i = L X_i + E_i
//! dE_i = h Σ A_ij E_j,    (Λ/h − A) T⁻¹ dX = T⁻¹ (X + B dE),    Z_i ← Z_i + L dX_i + dE_i
//! ```
//!
//! What the loops forbid, E, follows from rates that no force makes stiff: it needs no matrix.

use super::coefficients::{Nodes, Stages, NODES, REAL, S, T, T_INVERSE};
use super::newton_matrix::NewtonMatrix;
use crate::ode::{Ode, RhsError};
use partita_math::dense::Singular;
use partita_system::linear_rates::LinearRates;
use std::fmt::Display;

/// Most iterations. Unit: number. Reason: what converges more slowly is served better by a shorter step.
pub(super) const MOST: usize = 10;
/// Error of the stages that is left. Scale: multiples of the tolerance. Reason: a fiftieth of what the step may be off by.
const LEFT: f64 = 0.02;
/// An iteration that no longer gains has found the stages if they change by less than this. Scale: multiples of the tolerance.
/// Reason: what still changes is rounding, and the step may be off by five times as much.
const UNCHANGED: f64 = 0.2;
/// Iterations that gain less than this are at rest, or do not converge. Scale: ratio of changes. Reason: half a digit in three.
const GAINS: f64 = 0.5;

/// How an iteration ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Iterated {
    /// After so many iterations, the last of which changed the stages at this rate; none where one sufficed.
    Found { count: usize, rate: Option<f64> },
    /// It does not converge, or too slowly, at this rate.
    Slow { rate: f64 },
}

/// Where the matrix of the iterations was made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Matrix {
    /// Nowhere yet, or for another motion.
    Missing,
    /// In a step before.
    Kept,
    /// In this step.
    OfThisStep,
}

/// A step whose stages are sought.
#[derive(Clone, Copy, Debug)]
pub(super) struct Task<'a> {
    pub(super) t: f64,
    pub(super) y: &'a [f64],
    pub(super) h: f64,
    /// When the last stage is evaluated.
    pub(super) end: f64,
    /// What each component may be off by.
    pub(super) tolerances: &'a [f64],
}

/// The stages, the matrices and their memory.
#[derive(Debug)]
pub(super) struct StageSolver {
    dim: usize,
    /// Z, stage by stage.
    pub(super) z: Vec<f64>,
    /// The rates changed to first order.
    pub(super) linear: LinearRates,
    pub(super) matrix: Matrix,
    factors: NewtonMatrix,
    /// rate / (1 − rate) of the last iterations.
    gain: f64,
    y: Vec<f64>,
    /// R, then what it changes.
    r: Vec<f64>,
    x: Vec<f64>,
    w: Vec<f64>,
    e: Vec<f64>,
    /// Changes of one stage.
    row: Vec<f64>,
}

/// Component l of Σ_j m_ij x_j, stages one after the other.
#[inline(always)]
fn combine(row: &[f64; S], x: &[f64], n: usize, l: usize) -> f64 {
    row[0] * x[l] + row[1] * x[n + l] + row[2] * x[2 * n + l]
}

impl StageSolver {
    pub(super) fn new(dim: usize) -> Self {
        Self {
            dim,
            z: vec![0.0; S * dim],
            linear: LinearRates::default(),
            matrix: Matrix::Missing,
            factors: NewtonMatrix::default(),
            gain: 1.0,
            y: vec![0.0; dim],
            r: vec![0.0; S * dim],
            x: Vec::new(),
            w: Vec::new(),
            e: vec![0.0; S * dim],
            row: vec![0.0; dim],
        }
    }

    /// The rates changed to first order at (t, y), where they are dy, for steps of length h.
    pub(super) fn linearise<E: Display>(
        &mut self,
        ode: &mut dyn Ode<Error = E>,
        (t, h): (f64, f64),
        at: (&[f64], &[f64]),
        sizes: &[f64],
    ) -> Result<(), RhsError<E>> {
        self.matrix = Matrix::Missing;
        self.factors.forget();
        self.linear.shift = NewtonMatrix::shift(h);
        ode.linear_rates(t, at, sizes, &mut self.linear)?;
        (self.matrix, self.gain) = (Matrix::OfThisStep, 1.0);
        self.x.resize(S * self.linear.width(), 0.0);
        self.w.resize(S * self.linear.width(), 0.0);
        Ok(())
    }

    /// A matrix of a step before serves no longer.
    pub(super) fn forget_kept(&mut self) {
        if self.matrix == Matrix::Kept {
            self.matrix = Matrix::Missing;
        }
    }

    /// Factors for steps of length h; true if they had to be made.
    pub(super) fn factor(&mut self, h: f64) -> Result<bool, Singular> {
        if self.factors.is_for(h) {
            return Ok(false);
        }
        self.factors.factor(&self.linear, h)?;
        Ok(true)
    }

    /// Solve for the stages from the Z at hand. An error comes with its time.
    pub(super) fn solve<E: Display>(
        &mut self,
        ode: &mut dyn Ode<Error = E>,
        task: &Task,
        evaluations: &mut u64,
    ) -> Result<Iterated, (f64, RhsError<E>)> {
        let (mut last, mut rate) = (f64::INFINITY, None);
        let mut gain = self.gain.max(f64::EPSILON).powf(0.8);
        for count in 1..=MOST {
            self.residual(ode, task, evaluations)?;
            let change = self.change(task);
            if !change.is_finite() {
                return Ok(Iterated::Slow { rate: f64::INFINITY });
            }
            if count > 1 {
                let now = if last > 0.0 { change / last } else { 0.0 };
                if now >= GAINS && change <= UNCHANGED {
                    self.advance();
                    return Ok(Iterated::Found { count, rate: Some(now) });
                }
                if now >= 1.0 || now.powi((MOST - count) as i32) / (1.0 - now) * change > LEFT {
                    return Ok(Iterated::Slow { rate: now });
                }
                gain = now / (1.0 - now);
                rate = Some(now);
            }
            self.advance();
            if gain * change <= LEFT {
                self.gain = gain;
                return Ok(Iterated::Found { count, rate });
            }
            last = change;
        }
        Ok(Iterated::Slow { rate: rate.unwrap_or(1.0) })
    }

    /// R of the Z at hand.
    fn residual<E: Display>(
        &mut self,
        ode: &mut dyn Ode<Error = E>,
        task: &Task,
        evaluations: &mut u64,
    ) -> Result<(), (f64, RhsError<E>)> {
        let (n, nodes): (usize, &Nodes) = (self.dim, &NODES);
        for i in 0..S {
            let stage = i * n..(i + 1) * n;
            self.y.iter_mut().zip(task.y.iter().zip(&self.z[stage.clone()])).for_each(|(to, (y, z))| *to = y + z);
            let t = if i == S - 1 { task.end } else { task.t + nodes.c[i] * task.h };
            *evaluations += 1;
            ode.rhs(t, &self.y, &mut self.r[stage.clone()]).map_err(|e| (t, e))?;
            for l in 0..n {
                self.r[i * n + l] -= combine(&nodes.inverse[i], &self.z, n, l) / task.h;
            }
        }
        Ok(())
    }

    /// Turn R into changes of Z; the largest of them in units of the tolerances.
    fn change(&mut self, task: &Task) -> f64 {
        let (n, m) = (self.dim, self.linear.width());
        for i in 0..S {
            let (r, x) = (&mut self.r[i * n..(i + 1) * n], &mut self.x[i * m..(i + 1) * m]);
            self.linear.select(r, x);
            // E
            self.row.fill(0.0);
            self.linear.lift(x, &mut self.row);
            r.iter_mut().zip(&self.row).for_each(|(r, lifted)| *r -= lifted);
        }
        // dE of each stage, and what it moves
        for i in 0..S {
            for l in 0..n {
                self.e[i * n + l] = task.h * combine(&NODES.a[i], &self.r, n, l);
            }
            self.linear.couple(&self.e[i * n..(i + 1) * n], &mut self.x[i * m..(i + 1) * m]);
        }
        let transformed = |by: &Stages, from: &[f64], to: &mut [f64]| {
            (0..S).for_each(|i| (0..m).for_each(|l| to[i * m + l] = combine(&by[i], from, m, l)));
        };
        transformed(&T_INVERSE, &self.x, &mut self.w);
        let (own, pair) = self.w.split_at_mut(m);
        let (re, im) = pair.split_at_mut(m);
        self.factors.solve_real(&self.linear, own);
        self.factors.solve_complex(&self.linear, re, im);
        transformed(&T, &self.w, &mut self.x);
        let mut largest = 0.0f64;
        for i in 0..S {
            let change = &mut self.r[i * n..(i + 1) * n];
            change.copy_from_slice(&self.e[i * n..(i + 1) * n]);
            self.linear.lift(&self.x[i * m..(i + 1) * m], change);
            for (change, tolerance) in change.iter().zip(task.tolerances) {
                let x = (change / tolerance).abs();
                largest = if x <= largest { largest } else { x };
            }
        }
        largest
    }

    fn advance(&mut self) {
        self.z.iter_mut().zip(&self.r).for_each(|(z, change)| *z += change);
    }

    /// `x ← (γ/h − J)⁻¹ x`.
    pub(super) fn filter(&mut self, h: f64, x: &mut [f64]) {
        let m = self.linear.width();
        let own = &mut self.x[..m];
        self.linear.select(x, own);
        self.row.fill(0.0);
        self.linear.lift(own, &mut self.row);
        x.iter_mut().zip(&self.row).for_each(|(x, lifted)| *x = (*x - lifted) * h / REAL);
        self.linear.couple(x, own);
        self.factors.solve_real(&self.linear, own);
        self.linear.lift(own, x);
    }

    /// The polynomial of the stages at part θ of the step, less its start, for component l.
    #[inline(always)]
    pub(super) fn increment(&self, weights: &[f64; S], l: usize) -> f64 {
        combine(weights, &self.z, self.dim, l)
    }

    /// Begin the iteration with a polynomial: the part of its step at which each stage lies, and the part from which it counts.
    pub(super) fn predict(&mut self, from: &[f64], parts: [f64; S], origin: f64) {
        let start = NODES.weights(origin);
        for (i, part) in parts.into_iter().enumerate() {
            let weights = NODES.weights(part);
            let difference: [f64; S] = std::array::from_fn(|j| weights[j] - start[j]);
            (0..self.dim).for_each(|l| self.z[i * self.dim + l] = combine(&difference, from, self.dim, l));
        }
    }
}
