//! Read access to the stepper, and decisions between its evaluations.

use super::coefficients::{NODES, S};
use super::stages::Matrix;
use super::{Phase, Predictive, Radau};
use crate::counters::Counters;
use crate::placement::Handover;
use crate::scheme::{Scheme, Taken};
use crate::stepper::{CurrentStep, StepControl, StepPlan, StepStorage};
use partita_system::linear_rates::LinearRates;

impl StepControl for Radau {
    fn current(&self) -> CurrentStep<'_> {
        CurrentStep {
            t_old: self.at.t_old,
            t_new: self.at.t_new,
            t_end: self.at.t_end,
            y_old: &self.y_old,
            dy_old: &self.f_old,
            y_new: &self.y_new,
            dy_new: &self.f_new,
            next: self.at.step,
            may_shrink: self.at.may_shrink(),
        }
    }

    fn counters(&self) -> &Counters {
        &self.counters
    }

    fn notes(&self) -> Vec<String> {
        let differenced = self.counters.differenced;
        let note = || {
            format!(
                "{differenced} of {} matrices of Newton's method are differences: functions of the user's, or the \
                 formulation, have no derivatives",
                self.counters.jacobians
            )
        };
        (differenced > 0).then(note).into_iter().collect()
    }

    fn plan(&mut self, plan: &StepPlan) {
        (self.at.step, self.at.goal, self.at.corner_ahead) = (plan.length.abs(), plan.goal, false);
    }

    fn set_sizes(&mut self, sizes: &[f64]) {
        self.norm.set_sizes(sizes);
        self.sizes.copy_from_slice(sizes);
    }

    fn replace_start(&mut self, t: f64, y: &[f64], dy: &[f64]) {
        assert_eq!(self.phase, Phase::Ready, "commit or reject the previous step");
        self.at.corner_behind &= t == self.at.t_old;
        // whole turns are rewritten at each step; slopes of the same motion remain
        let continues = t == self.at.t_old && self.f_old == *dy;
        if t != self.at.t_old {
            self.sloped_at = t;
        }
        (self.at.t_old, self.at.t_new) = (t, t);
        self.y_old.copy_from_slice(y);
        self.f_old.copy_from_slice(dy);
        if !continues {
            self.forget();
        }
    }

    fn commit(&mut self) {
        assert_eq!(self.phase, Phase::Concluded, "conclude the step first");
        // what happens where a step was to end, the method does not know: its slopes may jump there
        self.sloped_at = self.at.before_jumps(self.at.t_new, self.at.attempted_h);
        let (cut, changes) = self.at.take();
        std::mem::swap(&mut self.y_old, &mut self.y_new);
        std::mem::swap(&mut self.f_old, &mut self.f_new);
        self.before.copy_from_slice(&self.solver.z);
        self.phase = Phase::Ready;
        self.counters.steps += 1;
        self.counters.by_rounding += u64::from(self.by_rounding);
        self.rounding.taken(self.by_rounding);
        let h = self.at.attempted_h;
        let (controller, found) = (&mut self.controller, self.found);
        self.at.lengthen(cut, self.options.max_step, || controller.accepted(h.abs(), found));
        (self.behind, self.repeated) = (Some(h), false);
        self.solver.matrix = if found.renews() { Matrix::Missing } else { Matrix::Kept };
        if changes {
            self.forget();
        }
    }

    fn reject(&mut self, factor: f64) {
        assert_ne!(self.phase, Phase::Ready, "there is no step to reject");
        self.at.step = self.at.attempted_h.abs() * factor;
        self.controller.hold();
        self.throw_away();
    }

    fn end_at(&mut self, t: f64) {
        assert_eq!(self.phase, Phase::Concluded, "conclude the step first");
        self.at.end_at(t);
        self.throw_away();
    }

    fn end_at_corner(&mut self, t: f64) {
        self.end_at(t);
        self.at.corner_ahead = true;
    }
}

impl StepStorage for Radau {
    fn save(&self, out: &mut Vec<f64>) -> bool {
        [&self.y_old, &self.y_new, &self.f_old, &self.solver.z].into_iter().for_each(|x| out.extend_from_slice(x));
        true
    }

    fn save_extra(&self, out: &mut Vec<f64>) {
        if self.polynomial.known {
            out.extend_from_slice(&self.half.z);
        }
    }

    fn load(&mut self, (t_old, t_new): (f64, f64), step: &[f64], extra: &[f64]) {
        let n = self.y_old.len();
        (self.at.t_old, self.at.t_new, self.at.attempted_h) = (t_old, t_new, t_new - t_old);
        self.y_old.copy_from_slice(&step[..n]);
        self.y_new.copy_from_slice(&step[n..2 * n]);
        self.f_old.copy_from_slice(&step[2 * n..3 * n]);
        self.solver.z.copy_from_slice(&step[3 * n..(3 + S) * n]);
        self.phase = Phase::Concluded;
        self.polynomial.known = false;
        if !extra.is_empty() {
            self.half.z.copy_from_slice(extra);
            self.polynomial.fill(&self.y_old, &self.y_new, &self.solver, &self.half);
        }
    }
    fn taken(&self) -> Option<Taken> {
        let a: Vec<Vec<f64>> = NODES.a.iter().map(|row| row.to_vec()).collect();
        let scheme = Scheme { c: NODES.c.to_vec(), b: a[S - 1].clone(), a, implicit: true };
        let states = self.solver.z.iter().enumerate().map(|(i, z)| self.y_old[i % self.y_old.len()] + z).collect();
        Some(Taken { scheme, states })
    }
}

impl Radau {
    fn throw_away(&mut self) {
        self.polynomial.known = false;
        self.phase = Phase::Ready;
        self.counters.rejected += 1;
    }

    /// The rates changed to first order that the next step uses, if it keeps them.
    pub(crate) fn linear(&self) -> Option<&LinearRates> {
        (self.solver.matrix != Matrix::Missing).then_some(&self.solver.linear)
    }

    /// What another method goes on from.
    pub(crate) fn hand_over(&self) -> Handover<'_> {
        assert_eq!(self.phase, Phase::Ready, "commit or reject the previous step");
        Handover { at: &self.at, sloped_at: self.sloped_at, y: &self.y_old, dy: &self.f_old }
    }

    /// Go on from where another method stands.
    pub(crate) fn adopt(&mut self, from: Handover) {
        (self.at, self.sloped_at) = (from.at.clone(), from.sloped_at);
        self.y_old.copy_from_slice(from.y);
        self.f_old.copy_from_slice(from.dy);
        (self.phase, self.polynomial.known, self.repeated) = (Phase::Ready, false, false);
        self.controller = Predictive::default();
        self.forget();
    }
}
