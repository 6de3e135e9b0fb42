//! Frozen tangent velocities: k velocities `u = S v` and all coordinates, for S from a rule (36).
//!
//! The forms with artificial tangent velocities, one [`Basis`] each: `zero-eigenvalue`, `svd`, `qr`, `gram-schmidt`. All give
//! the same accelerations as any other form; they differ in the velocities integrated, in cost and in how long a basis lasts.
//! A basis is best where it is frozen and decays along the motion, as a partition does, but renewing it costs a
//! factorisation where a partition only picks other rows: prefer the projective form for marching, and these for comparison,
//! or where the frozen velocities themselves are wanted (modes, frozen Jacobians). Each evaluation factors [S; C] densely,
//! n³/3 + n²(k + 1).
//!
//! Drift of positions is removed after a step: by the least move in the mass metric (33), or along G, `q ← q − G Φ`, which keeps
//! `S Δ = 0` as the partition's correction (34) keeps q_I, and for rows of the identity in S is (34) itself.

use super::selector::{Basis, Selector};
use super::{turns, Correction, Formulation, FormulationCounters, Output, PartitionEvent, Review, Sample};
use crate::system::{ConstrainedSystem, SystemError};

/// States (q, u): coordinates by S2, tangent velocities by (36).
pub struct TangentVelocities<'s, S: ConstrainedSystem> {
    x: Selector<'s, S>,
    correction: Correction,
    renew: f64,
    observes_work: bool,
    corrections: u64,
}

impl<'s, S: ConstrainedSystem> TangentVelocities<'s, S> {
    /// For a system of the given rank. `renew`: see
    /// [`FormulationOptions`](super::options::FormulationOptions::renew).
    pub fn new(system: &'s S, rank: usize, basis: Box<dyn Basis>, correction: Correction, renew: f64) -> Self {
        Self {
            x: Selector::new(system, rank, basis),
            correction,
            renew,
            observes_work: system.has_power() || system.rheonomic(),
            corrections: 0,
        }
    }

    /// The selector, at the point last evaluated.
    pub fn selector(&mut self) -> &mut Selector<'s, S> {
        &mut self.x
    }

    fn sizes(&self) -> (usize, usize) {
        (self.x.r.size().nq, self.x.r.k())
    }

    /// Freeze anew at the point of y and rewrite u, and its derivative, from (v, v') there.
    fn renew(&mut self, t: f64, y: &mut [f64], dy: &mut [f64], why: &str) -> Result<(), SystemError> {
        let (nq, k) = self.sizes();
        let (q, rest) = y.split_at_mut(nq);
        // outputs may have been evaluated since: come back to the point
        self.x.evaluate(t, q, &rest[..k])?;
        let v = self.x.r.v.clone();
        let mut vdot = vec![0.0; v.len()];
        self.x.r.full_acceleration(&mut vdot);
        if self.x.renew(t, q, why)? {
            self.x.select(&v, &mut rest[..k]);
            self.x.select(&vdot, &mut dy[nq..nq + k]); // S δ = 0
        }
        Ok(())
    }
}

impl<S: ConstrainedSystem> Formulation for TangentVelocities<'_, S> {
    fn name(&self) -> &'static str {
        self.x.name()
    }
    fn dim(&self) -> usize {
        self.controlled() + usize::from(self.observes_work)
    }
    fn controlled(&self) -> usize {
        let (nq, k) = self.sizes();
        nq + k
    }
    fn start(&mut self, t: f64, q: &[f64], v: &[f64], y: &mut [f64]) -> Result<(), SystemError> {
        let (nq, k) = self.sizes();
        self.x.start(t, q)?;
        y.fill(0.0);
        y[..nq].copy_from_slice(q);
        self.x.select(v, &mut y[nq..nq + k]);
        Ok(())
    }
    fn derivative(&mut self, t: f64, y: &[f64], dy: &mut [f64]) -> Result<(), SystemError> {
        let (nq, k) = self.sizes();
        let q = &y[..nq];
        self.x.evaluate(t, q, &y[nq..nq + k])?;
        self.x.r.system.rate(q, &self.x.r.v, &mut dy[..nq]);
        self.x.tangent_acceleration(&mut dy[nq..nq + k]);
        if self.observes_work {
            dy[nq + k] = self.x.power(t, q)?;
        }
        Ok(())
    }
    fn correct(&mut self, t: f64, y: &mut [f64]) -> Result<bool, SystemError> {
        let nq = self.sizes().0;
        let q = &mut y[..nq];
        let moved = self.x.r.system.normalise(q);
        if self.correction == Correction::None || self.x.r.size().holonomic == 0 || self.x.r.rank() == 0 {
            return Ok(moved);
        }
        self.x.r.position(t, q)?;
        if self.x.r.is_closed() || !self.x.correct_once(t, q, self.correction)? {
            return Ok(moved);
        }
        self.corrections += 1;
        Ok(true)
    }
    fn review(&mut self, t: f64, y: &[f64]) -> Review {
        let nq = self.sizes().0;
        self.x.judge(t, &y[..nq], self.renew)
    }
    fn wrap(&mut self, y: &mut [f64], turns: &mut [i32]) -> bool {
        let nq = self.sizes().0;
        turns::reduce(self.x.r.system, &mut y[..nq], turns)
    }
    fn change(&mut self, t: f64, y: &mut [f64], dy: &mut [f64]) -> Result<(), SystemError> {
        self.renew(t, y, dy, "it had decayed along the motion")
    }
    fn recover(&mut self, t: f64, y: &mut [f64], dy: &mut [f64]) -> Result<(), SystemError> {
        self.renew(t, y, dy, "it went bad inside the step, which is repeated")?;
        self.derivative(t, y, dy)
    }
    fn state_at(&mut self, t: f64, y: &[f64], out: &mut Output) -> Result<(), SystemError> {
        let (nq, k) = self.sizes();
        let mut q = std::mem::take(&mut out.q);
        q.clear();
        q.extend_from_slice(&y[..nq]);
        self.x.r.system.normalise(&mut q);
        self.x.close(t, &mut q, self.correction)?;
        self.x.kinematics(t, &q, &y[nq..nq + k])?;
        out.set(t, &q, &self.x.r.v, if self.observes_work { y[nq + k] } else { 0.0 });
        Ok(())
    }

    fn describe(
        &mut self,
        t: f64,
        q: &[f64],
        v: &[f64],
        within: Option<&PartitionEvent>,
        out: &mut Sample,
    ) -> Result<(), SystemError> {
        self.x.describe(t, q, v, within, out)
    }
    fn events(&self) -> &[PartitionEvent] {
        self.x.events()
    }
    fn counters(&self) -> FormulationCounters {
        FormulationCounters {
            factorisations: self.x.r.factorisations,
            plans: self.x.frozen(),
            corrections: self.corrections,
            ..FormulationCounters::default()
        }
    }
    fn rows(&self) -> Vec<usize> {
        self.x.kept_rows()
    }
    fn notes(&self) -> Vec<String> {
        self.x.notes(self.renew)
    }
}
