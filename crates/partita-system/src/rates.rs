//! The rates of a state for one choice of coordinates: written once, over any number type.
//!
//! ```text
//! y = (q, v_I, work)     q' = N(q) v,   M_d v_I' = h_d,   work' = P − λᵀ a                     (S2, P1-P3, R1)
//! ```
//!
//! Over dual numbers, lanes and recordings an [`Evaluation`] goes through all levels without a branch; what is recorded
//! of it serves machine code, ensembles, C and counts of operations. In plain numbers the levels are those of a
//! [`Reduction`](crate::reduction::Reduction), which looks at pivots and plans anew; [`rates`] and [`power`] are the same.

use crate::choice::Choice;
use crate::error::Result;
use crate::system::{ClusterTangent, Levels, Manifold, Size, Tangent};
use partita_math::dense;
use partita_math::elimination::Plan;
use partita_math::scalar::Scalar;

/// What rates ask of a system besides its accelerations, after its levels.
pub trait MotionOver<N> {
    /// `q' = N(q) v`.                                                                      (S2)
    fn rate(&self, q: &[N], v: &[N], qdot: &mut [N]);
    /// P, the power of the non-conservative applied forces.
    fn power(&mut self, t: N, q: &[N], v: &[N]) -> Result<N>;
    /// `M v' − h`.
    fn inverse_dynamics(&mut self, t: N, q: &[N], v: &[N], vdot: &[N], out: &mut [N]) -> Result<()>;
}

/// S1-S5 by level over any numbers, with the scratch (see [`Levels`]).
pub trait LevelsOver<N>: MotionOver<N> {
    /// Sizes, and the entries of C.
    fn sizes(&self) -> (Size, usize);
    /// Φ, the values of C in pattern order, and a.                                         (S3, S4)
    fn position(&mut self, t: N, q: &[N], phi: &mut [N], c: &mut [N], a: &mut [N]) -> Result<()>;
    /// b.                                                                                  (S5)
    fn velocity(&mut self, t: N, q: &[N], v: &[N], b: &mut [N]) -> Result<()>;
    /// `M_d = D M Dᵀ`, `h_d = D (h − M [0; ξ])`.                                           (P3)
    fn project(&mut self, at: (N, &[N], &[N]), tangent: &Tangent<N>, md: &mut [N], hd: &mut [N]) -> Result<()>;
    /// Move q by the small displacement `dv`.
    fn step(&self, q: &mut [N], dv: &[N]);
    /// `v'` with `C v' + b = 0` by the recursion over clusters, where the choice is packed for one.        (48)
    fn accelerate(&mut self, at: (N, &[N], &[N]), tangent: &ClusterTangent<N>, vdot: &mut [N]) -> Result<()>;
}

impl<S: Levels + Manifold> MotionOver<f64> for (&S, &mut S::Scratch) {
    fn rate(&self, q: &[f64], v: &[f64], qdot: &mut [f64]) {
        self.0.rate(q, v, qdot);
    }
    fn power(&mut self, t: f64, q: &[f64], v: &[f64]) -> Result<f64> {
        self.0.power(t, q, v, self.1)
    }
    fn inverse_dynamics(&mut self, t: f64, q: &[f64], v: &[f64], vdot: &[f64], out: &mut [f64]) -> Result<()> {
        self.0.inverse_dynamics(t, q, v, vdot, self.1, out)
    }
}

/// A state whose levels were evaluated.
pub struct Point<'a, N> {
    /// Time.
    pub t: N,
    /// Coordinates.
    pub q: &'a [N],
    /// Velocities.
    pub v: &'a [N],
    /// `[0; η]`, where rows depend on time.
    pub gamma: &'a [N],
    /// Accelerations.
    pub vdot: &'a [N],
}

/// q', v_I', and the power if `out` goes on; `residual` has room for all velocities.                    (S2, P3)
pub fn rates<N: Scalar>(
    of: &mut impl MotionOver<N>,
    choice: &Choice,
    at: &Point<N>,
    residual: &mut [N],
    out: &mut [N],
) -> Result<()> {
    let (qdot, rest) = out.split_at_mut(at.q.len());
    let (udot, work) = rest.split_at_mut(choice.k());
    of.rate(at.q, at.v, qdot);
    udot.iter_mut().zip(choice.independent).for_each(|(x, &i)| *x = at.vdot[i]);
    if let [work] = work {
        *work = power(of, choice.rheonomic, at, residual)?;
    }
    Ok(())
}

/// dE/dt that is not the work of conservative forces: applied power and, of rows that depend on time, −λᵀ a = λᵀ C v =
/// (M v' − h)ᵀ γ, because the reaction does no work along the rows of D.                                    (R1)
pub fn power<N: Scalar>(of: &mut impl MotionOver<N>, rheonomic: bool, at: &Point<N>, residual: &mut [N]) -> Result<N> {
    let applied = of.power(at.t, at.q, at.v)?;
    if !rheonomic {
        return Ok(applied);
    }
    of.inverse_dynamics(at.t, at.q, at.v, at.vdot, residual)?;
    Ok(applied + dense::dot(residual, at.gamma))
}

/// The levels of a choice at one point, with their memory.
pub struct Evaluation<'c, N, L> {
    choice: Choice<'c>,
    /// The system.
    pub of: L,
    /// Φ.
    pub phi: Vec<N>,
    /// Values of C in pattern order.
    pub c: Vec<N>,
    /// a and b.
    pub a: Vec<N>,
    /// See `a`.
    pub b: Vec<N>,
    /// C_D, eliminated.
    pub factors: Vec<N>,
    /// Dᵀ (nv x columns), `[0; η]` and `[0; ξ]`.
    pub dt: Vec<N>,
    /// See `dt`.
    pub gamma: Vec<N>,
    /// See `dt`.
    pub delta: Vec<N>,
    /// M_d (k x k), its Cholesky factor and h_d, where the accelerations do not come from a recursion.
    pub md: Vec<N>,
    /// See `md`.
    pub md_factor: Vec<N>,
    /// See `md`.
    pub hd: Vec<N>,
    /// Velocities.
    pub v: Vec<N>,
    /// Accelerations.
    pub vdot: Vec<N>,
    rhs: Vec<N>,
    a_matrix: Vec<N>,
    work: Vec<N>,
}

impl<'c, N: Scalar, L: LevelsOver<N>> Evaluation<'c, N, L> {
    /// For a choice made in plain numbers, near the points to be evaluated: whether it still applies is not checked.
    pub fn new(of: L, choice: Choice<'c>) -> Self {
        let (size, entries) = of.sizes();
        let (n, rank, columns) = (size.nv, choice.rows.len(), choice.columns);
        let k = if choice.packed { 0 } else { choice.k() };
        let memory = |n: usize| vec![N::zero(); n];
        Self {
            choice,
            of,
            phi: memory(size.holonomic),
            c: memory(entries),
            a: memory(size.rows),
            b: memory(size.rows),
            factors: memory(choice.plan.map_or(0, |p| p.factor_len())),
            dt: memory(n * columns),
            gamma: memory(n),
            delta: memory(n),
            md: memory(k * k),
            md_factor: memory(k * k),
            hd: memory(k),
            v: memory(n),
            vdot: memory(n),
            rhs: memory(rank * (columns + 1)),
            a_matrix: memory(rank * columns),
            work: memory(n.max(rank)),
        }
    }

    /// Φ, C, a, the factors of C_D, D and η.                                               (S3, S4, P1, P2)
    pub fn position(&mut self, t: N, q: &[N]) -> Result<()> {
        self.choice.units(&mut self.dt);
        self.of.position(t, q, &mut self.phi, &mut self.c, &mut self.a)?;
        if let Some(plan) = self.choice.plan {
            plan.eliminate(&self.c, &mut self.factors);
        }
        self.choice.tangent(
            &self.factors,
            &self.c,
            &self.a,
            &mut self.rhs,
            &mut self.a_matrix,
            &mut self.dt,
            &mut self.gamma,
        );
        Ok(())
    }

    /// All levels at (t, q, v_I).                                                          (P1-P3)
    pub fn levels(&mut self, t: N, q: &[N], v_independent: &[N]) -> Result<()> {
        self.position(t, q)?;
        let (choice, tangent) = (self.choice, (&self.dt[..], &self.gamma[..]));
        choice.spread(&self.factors, &self.c, &self.a, tangent, v_independent, &mut self.work, &mut self.v);
        self.of.velocity(t, q, &self.v, &mut self.b)?;
        choice.bias(&self.factors, &self.b, &mut self.work, &mut self.delta);
        let (at, dt, delta) = ((t, q, &self.v[..]), &self.dt[..], &self.delta[..]);
        if choice.packed {
            let tangent = ClusterTangent { columns: choice.columns, dt, delta, c: &self.c, b: &self.b };
            return self.of.accelerate(at, &tangent, &mut self.vdot);
        }
        let k = choice.k();
        self.of.project(at, &Tangent { k, dt, delta }, &mut self.md, &mut self.hd)?;
        self.md_factor.copy_from_slice(&self.md);
        dense::cholesky_straight(&mut self.md_factor, k);
        let udot = &mut self.work[..k];
        udot.copy_from_slice(&self.hd);
        dense::cholesky_solve(&self.md_factor, k, udot);
        choice.full_acceleration(dt, delta, udot, &mut self.vdot);
        Ok(())
    }

    /// `q_D ← q_D − C_D⁻¹ Φ`; rows that are not holonomic are kept to the first order.              (34)
    pub fn correct(&mut self, t: N, q: &mut [N]) -> Result<()> {
        self.position(t, q)?;
        self.put_on(q);
        Ok(())
    }

    /// As [`correct`](Self::correct), to where the rows have these values instead of 0; what rows of rates hold moves by
    /// nothing.
    pub fn correct_to(&mut self, t: N, q: &mut [N], values: &[N]) -> Result<()> {
        self.position(t, q)?;
        self.phi.iter_mut().zip(values).for_each(|(phi, x)| *phi -= *x);
        self.put_on(q);
        Ok(())
    }

    /// The correction for Φ at the position last evaluated.                                (34)
    fn put_on(&mut self, q: &mut [N]) {
        let mut dv = std::mem::take(&mut self.work);
        self.closing(&mut dv[..self.v.len()]);
        self.of.step(q, &dv[..self.v.len()]);
        self.work = dv;
    }

    /// v at (t, q, v_I).                                                                    (P2)
    pub fn velocities(&mut self, t: N, q: &[N], v_independent: &[N]) -> Result<()> {
        self.position(t, q)?;
        let (choice, tangent) = (self.choice, (&self.dt[..], &self.gamma[..]));
        choice.spread(&self.factors, &self.c, &self.a, tangent, v_independent, &mut self.work, &mut self.v);
        Ok(())
    }

    /// λ of all rows at the point (t, q) whose levels were evaluated last.                 (R1)
    pub fn multipliers(&mut self, t: N, q: &[N], out: &mut [N]) -> Result<()> {
        let mut residual = vec![N::zero(); self.v.len()];
        self.of.inverse_dynamics(t, q, &self.v, &self.vdot, &mut residual)?;
        self.choice.multipliers(&self.factors, &residual, &mut self.work, out);
        Ok(())
    }

    /// The displacement `−C_D⁻¹ Φ` of the dependent velocities at the position evaluated last.              (34)
    pub fn closing(&mut self, dv: &mut [N]) {
        dv.fill(N::zero());
        let Some(plan) = self.choice.plan else { return };
        let x = &mut self.rhs[..self.choice.rows.len()];
        for (x, &row) in x.iter_mut().zip(self.choice.rows) {
            *x = self.phi.get(row).map_or(N::zero(), |phi| -*phi);
        }
        plan.solve(&self.factors, x, 1);
        self.choice.put_dependent(x, dv);
    }

    /// 1 / pivots of C_D, in the order of the elimination.
    pub fn reciprocal_pivots(&self) -> impl Iterator<Item = N> + use<'_, 'c, N, L> {
        let of = move |plan: &'c Plan| (0..plan.rank()).map(move |i| plan.reciprocal(&self.factors, i));
        self.choice.plan.into_iter().flat_map(of)
    }

    /// Above 0 where one of them is outside its range.
    pub fn excess(&self) -> N {
        self.choice.plan.map_or(-N::one(), |plan| plan.excess(&self.factors))
    }

    /// [`rates`] at (t, q, v_I).
    pub fn rates(&mut self, t: N, q: &[N], v_independent: &[N], out: &mut [N]) -> Result<()> {
        self.levels(t, q, v_independent)?;
        let at = Point { t, q, v: &self.v, gamma: &self.gamma, vdot: &self.vdot };
        rates(&mut self.of, &self.choice, &at, &mut self.work[..self.v.len()], out)
    }
}

/// What steps ask of an [`Evaluation`], whatever the system.
pub trait ChosenRates<N> {
    /// See [`Evaluation::rates`].
    fn rates(&mut self, t: N, q: &[N], v_independent: &[N], out: &mut [N]) -> Result<()>;
    /// Φ at (t, q).
    fn phi(&mut self, t: N, q: &[N]) -> Result<&[N]>;
    /// See [`Evaluation::correct_to`].
    fn correct_to(&mut self, t: N, q: &mut [N], values: &[N]) -> Result<()>;
    /// See [`Evaluation::velocities`].
    fn velocities(&mut self, t: N, q: &[N], v_independent: &[N]) -> Result<&[N]>;
    /// v' at (t, q, v_I).
    fn accelerations(&mut self, t: N, q: &[N], v_independent: &[N]) -> Result<&[N]>;
    /// λ of all rows there.
    fn multipliers(&mut self, t: N, q: &[N], out: &mut [N]) -> Result<()>;
    /// v and v' where the rates were evaluated last.
    fn motion(&self) -> (&[N], &[N]);
}

impl<N: Scalar, L: LevelsOver<N>> ChosenRates<N> for Evaluation<'_, N, L> {
    fn rates(&mut self, t: N, q: &[N], v_independent: &[N], out: &mut [N]) -> Result<()> {
        self.rates(t, q, v_independent, out)
    }
    fn phi(&mut self, t: N, q: &[N]) -> Result<&[N]> {
        self.position(t, q)?;
        Ok(&self.phi)
    }
    fn correct_to(&mut self, t: N, q: &mut [N], values: &[N]) -> Result<()> {
        self.correct_to(t, q, values)
    }
    fn velocities(&mut self, t: N, q: &[N], v_independent: &[N]) -> Result<&[N]> {
        self.velocities(t, q, v_independent)?;
        Ok(&self.v)
    }
    fn accelerations(&mut self, t: N, q: &[N], v_independent: &[N]) -> Result<&[N]> {
        self.levels(t, q, v_independent)?;
        Ok(&self.vdot)
    }
    fn multipliers(&mut self, t: N, q: &[N], out: &mut [N]) -> Result<()> {
        self.multipliers(t, q, out)
    }
    fn motion(&self) -> (&[N], &[N]) {
        (&self.v, &self.vdot)
    }
}
