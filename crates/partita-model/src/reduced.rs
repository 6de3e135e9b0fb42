//! The reduced equations over any scalar: v, v' and λ for a choice made in plain numbers.

use crate::clusters::{self, Tangents};
use crate::evaluator::{Engine, Evaluator, Scratch};
use partita_math::dense;
use partita_math::scalar::Scalar;
use partita_system::reduction::Choice;
use partita_system::SystemError;

/// An evaluation of the reduced equations.
#[derive(Clone, Debug, Default)]
pub struct Reduced<S> {
    /// Φ.
    pub phi: Vec<S>,
    /// Values of C in pattern order.
    pub c: Vec<S>,
    /// a and b.
    pub a: Vec<S>,
    /// See `a`.
    pub b: Vec<S>,
    /// Dᵀ (nv x columns), `[0; η]` and `[0; ξ]`.
    pub dt: Vec<S>,
    /// See `dt`.
    pub gamma: Vec<S>,
    /// See `dt`.
    pub delta: Vec<S>,
    /// M_d (k x k) and h_d, where the accelerations do not come from a recursion.
    pub md: Vec<S>,
    /// See `md`.
    pub hd: Vec<S>,
    /// Velocities.
    pub v: Vec<S>,
    /// Accelerations.
    pub vdot: Vec<S>,
    /// Multipliers of all rows.
    pub multipliers: Vec<S>,
    pub(crate) factors: Vec<S>,
    rhs: Vec<S>,
    a_matrix: Vec<S>,
    /// Cholesky factor of M_d.
    pub(crate) factor: Vec<S>,
    work: Vec<S>,
}

impl<S: Scalar> Evaluator<S> {
    /// Rows of C and entries in them.
    fn sizes(&self) -> (usize, usize) {
        let (rows, _, entries) = match &self.engine {
            Engine::Planar(tree) => tree.sizes(),
            Engine::Full => self.full.sizes(),
        };
        (rows, entries)
    }

    /// Everything that follows from `(t, q, v_I)` for the choice of a reduction in plain numbers, made near there; `plan` is the
    /// recursion over clusters where the choice is packed for one (see [`Evaluator::fit`]).            (P1-P3, R1)
    ///
    /// Without branches: whether the choice still applies is not checked.
    pub fn reduced(
        &self,
        choice: &Choice,
        plan: Option<&clusters::Plan>,
        t: S,
        q: &[S],
        v_independent: &[S],
        s: &mut Scratch<S>,
        x: &mut Reduced<S>,
    ) -> Result<(), SystemError> {
        let (n, k, columns) = (self.placed.nv, choice.k(), choice.columns);
        let rank = choice.rows.len();
        let (rows, entries) = self.sizes();
        let fit = |x: &mut Vec<S>, n: usize| x.resize(n, S::zero());
        for (x, n) in [
            (&mut x.phi, rows),
            (&mut x.c, entries),
            (&mut x.a, rows),
            (&mut x.b, rows),
            (&mut x.gamma, n),
            (&mut x.delta, n),
            (&mut x.v, n),
            (&mut x.vdot, n),
            (&mut x.multipliers, rows),
            (&mut x.factors, choice.plan.map_or(0, |p| p.factor_len())),
            (&mut x.rhs, rank * (columns + 1)),
            (&mut x.a_matrix, rank * columns),
            (&mut x.work, n.max(rank)),
        ] {
            fit(x, n);
        }
        fit(&mut x.dt, n * columns);
        choice.units(&mut x.dt);
        self.position(t, q, s, &mut x.phi, &mut x.c, &mut x.a)?;
        if let Some(plan) = choice.plan {
            plan.eliminate(&x.c, &mut x.factors);
        }
        choice.tangent(&x.factors, &x.c, &x.a, &mut x.rhs, &mut x.a_matrix, &mut x.dt, &mut x.gamma);
        let tangent = (&x.dt[..], &x.gamma[..]);
        choice.spread(&x.factors, &x.c, &x.a, tangent, v_independent, &mut x.work, &mut x.v);
        self.velocity(t, q, &x.v, s, &mut x.b)?;
        choice.bias(&x.factors, &x.b, &mut x.work, &mut x.delta);
        match plan {
            Some(plan) => {
                let tangents = Tangents { dt: &x.dt, delta: &x.delta, c: &x.c, b: &x.b };
                self.accelerate(t, q, &x.v, plan, &tangents, s, &mut x.vdot)?;
            }
            None => {
                fit(&mut x.md, k * k);
                fit(&mut x.hd, k);
                self.project(t, q, &x.v, (k, &x.dt, &x.delta), s, &mut x.md, &mut x.hd)?;
                x.factor.clear();
                x.factor.extend_from_slice(&x.md);
                dense::cholesky_straight(&mut x.factor, k);
                let mut rates = std::mem::take(&mut x.work);
                rates.resize(n.max(rank).max(k), S::zero());
                rates[..k].copy_from_slice(&x.hd);
                dense::cholesky_solve(&x.factor, k, &mut rates[..k]);
                choice.full_acceleration(&x.dt, &x.delta, &rates[..k], &mut x.vdot);
                x.work = rates;
            }
        }
        let mut residual = std::mem::take(&mut x.rhs);
        residual.resize(residual.len().max(n), S::zero());
        self.inverse_dynamics(t, q, &x.v, &x.vdot, s, &mut residual[..n])?;
        choice.multipliers(&x.factors, &residual, &mut x.work, &mut x.multipliers);
        residual.truncate(rank * (columns + 1));
        x.rhs = residual;
        Ok(())
    }
}
