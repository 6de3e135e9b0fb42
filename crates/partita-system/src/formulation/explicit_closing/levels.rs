//! One evaluation: the loops closed, then P1-P3 block by block, and λ backwards.

use super::super::dead_point::dead_point;
use super::{undecided, ExplicitClosing, MOST_DOUBT};
use crate::system::{ConstrainedSystem, SystemError, Tangent};
use partita_math::dense;

/// A closing that leaves more than this open (in reaches) does not close: closed forms leave round-off, a function that
/// iterates what it was told to.
const OPEN: f64 = 1e-6;

impl<S: ConstrainedSystem> ExplicitClosing<'_, S> {
    /// `self.q` closed at the inputs in y.                                                   (37)
    ///
    /// Where a singular position may be passed each block takes the branch nearest to where the velocities at the end of
    /// the last step lead: its pivot goes through zero there, and which sign comes next only the velocities tell. Where
    /// they lead too near to the position to tell the branches apart the step has to be another. Inside a finished step
    /// the path is known better than any such distance that matters.
    pub(super) fn close(&mut self, t: f64, y: &[f64]) -> Result<(), SystemError> {
        let Some(loops) = &mut self.loops else {
            return Err(SystemError::Request("no closing was chosen before the evaluation".into()));
        };
        self.good.copy_from_slice(&self.q);
        // before the end of the last step: an output inside it
        let follow = if t < self.home_t { self.followed } else { self.passing || self.approaching };
        if std::mem::replace(&mut self.following, follow) && !follow {
            loops.closing.set_branches(&self.branches);
            self.q.copy_from_slice(&self.home);
        }
        let closed = if follow {
            self.q.copy_from_slice(&self.home);
            self.continuity.predict(t, &mut self.move_by);
            self.system.step(&mut self.q, &self.move_by);
            self.states.scatter(y, &mut self.q);
            let followed = loops.closing.follow(t, &mut self.q);
            followed.and_then(|doubt| match doubt <= MOST_DOUBT || t < self.home_t {
                true => Ok(()),
                false => Err(undecided(self.system, self.rank, t, &self.q, &*loops.closing)),
            })
        } else {
            self.states.scatter(y, &mut self.q);
            loops.closing.close(t, &mut self.q)
        };
        if closed.is_err() {
            self.q.copy_from_slice(&self.good);
        }
        closed
    }

    /// Close, then P1-P3, at the inputs and input velocities in y.
    pub(super) fn evaluate(&mut self, t: f64, y: &[f64]) -> Result<(), SystemError> {
        self.kinematics(t, y)?;
        let Some(loops) = &mut self.loops else { return Ok(()) };
        let (k, c) = (self.k, &self.c);
        self.system.velocity(t, &self.q, &self.v, &mut self.scratch, &mut self.b)?;
        loops.blocks.forward(c, &mut self.delta, |i| i, |row| self.b[row]);
        let tangent = Tangent { k, dt: &self.dt, delta: &self.delta };
        self.system.project(t, &self.q, &self.v, &tangent, &mut self.scratch, &mut self.md, &mut self.hd)?;
        self.md_factor.copy_from_slice(&self.md);
        dense::cholesky(&mut self.md_factor, k).map_err(|e| SystemError::Mass {
            name: self.system.velocity_name(loops.closing.inputs()[e.index]),
            pivot: e.pivot,
        })?;
        dense::cholesky_solve(&self.md_factor, k, &mut self.hd); // v_I'
        for (i, (x, d)) in self.vdot.iter_mut().zip(&self.delta).enumerate() {
            *x = d + dense::dot(&self.dt[i * k..(i + 1) * k], &self.hd);
        }
        Ok(())
    }

    /// Close, then P1 and P2: v in `self.v`.
    pub(super) fn kinematics(&mut self, t: f64, y: &[f64]) -> Result<(), SystemError> {
        self.close(t, y)?;
        let Some(loops) = &mut self.loops else { return Ok(()) };
        let (k, places) = (self.k, self.states.places());
        self.system.position(t, &self.q, &mut self.scratch, &mut self.phi, &mut self.c, &mut self.a)?;
        let reach = |i: usize| self.system.row_reach(i).unwrap_or(1.0);
        let wide = |&(i, phi): &(usize, &f64)| phi.is_nan() || phi.abs() > OPEN * reach(i);
        if let Some((row, phi)) = self.phi.iter().enumerate().find(wide) {
            return Err(SystemError::Request(format!(
                "the explicit closing leaves {} open by {phi:.3e} at t = {t}; check the function that closes the loops, and that it \
                 takes the branch of the start",
                self.system.row_words(row)
            )));
        }
        self.counters.factorisations += 1;
        loops.blocks.factor(&self.c).map_err(|b| match self.c.iter().all(|x| x.is_finite()) {
            true => {
                let seen = format!("{} has no pivot left", loops.closing.blocks()[b].words);
                dead_point(self.system, self.rank, t, &self.q, loops.closing.inputs(), seen)
            }
            false => SystemError::NotFinite { what: "the constraint Jacobian".into(), t },
        })?;
        // one motion per input with the others at rest, and the motion of time alone          (38)
        let c = &self.c;
        for j in 0..k {
            loops.blocks.forward(c, &mut self.dt, |i| i * k + j, |_| 0.0);
        }
        if self.system.rheonomic() {
            loops.blocks.forward(c, &mut self.gamma, |i| i, |row| self.a[row]);
        }
        let speeds = &y[places..places + k];
        for (i, (v, g)) in self.v.iter_mut().zip(&self.gamma).enumerate() {
            *v = g + dense::dot(&self.dt[i * k..(i + 1) * k], speeds);
        }
        Ok(())
    }

    /// λ at the last evaluation, left in `self.lambda`.                                     (43)
    pub(super) fn multipliers(&mut self, t: f64) -> Result<(), SystemError> {
        let s = &mut self.scratch;
        self.system.inverse_dynamics(t, &self.q, &self.v, &self.vdot, s, &mut self.force)?;
        self.lambda.fill(0.0);
        if let Some(loops) = &mut self.loops {
            loops.blocks.backward(&self.c, &mut self.force, &mut self.lambda);
        }
        Ok(())
    }

    /// dE/dt that is not the work of conservative forces.
    pub(super) fn power(&mut self, t: f64) -> Result<f64, SystemError> {
        let mut p = self.system.power(t, &self.q, &self.v, &mut self.scratch)?;
        if self.system.rheonomic() {
            self.multipliers(t)?;
            p -= dense::dot(&self.lambda, &self.a);
        }
        Ok(p)
    }
}
