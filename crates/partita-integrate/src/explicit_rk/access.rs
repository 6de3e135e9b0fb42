//! Read access to the stepper, and decisions between its evaluations.

use super::{memory, ExplicitRungeKutta, Phase};
use crate::counters::Counters;
use crate::stepper::{CurrentStep, StepControl, StepPlan};
use partita_math::tolerance;

impl StepControl for ExplicitRungeKutta {
    fn current(&self) -> CurrentStep<'_> {
        CurrentStep {
            t_old: self.t_old,
            t_new: self.t_new,
            t_end: self.t_end,
            y_old: &self.y_old[..self.dim],
            dy_old: self.slot(0),
            y_new: &self.y_new[..self.dim],
            dy_new: self.slot(self.tableau.end_slot()),
            next: self.step,
            may_shrink: self.step > tolerance::SOLUTION_ROUNDING * self.t_new.abs().max(self.span),
        }
    }

    fn counters(&self) -> &Counters {
        &self.counters
    }

    fn plan(&mut self, plan: &StepPlan) {
        let length = plan.length.abs();
        self.step = self.memory.as_ref().map_or(length, |memory| memory.limited(length));
        self.goal = plan.goal.map(|t| self.exactly(t));
        self.corner_ahead = false;
    }

    fn set_sizes(&mut self, sizes: &[f64]) {
        self.norm.set_sizes(sizes);
    }

    fn set_reference(&mut self, size: f64) {
        self.norm.set_reference(size);
    }

    fn replace_start(&mut self, t: f64, y: &[f64], dy: &[f64]) {
        assert_eq!(self.phase, Phase::Ready, "commit or reject the previous step");
        self.corner_behind &= t == self.t_old;
        // whole turns and times of drives are rewritten at each step; slopes of the same motion remain
        let continues = t == self.t_old && self.stages[..self.dim] == *dy;
        if t != self.t_old {
            self.sloped_at = t;
        }
        (self.t_old, self.t_new) = (t, t);
        self.y_old[..self.dim].copy_from_slice(y);
        self.stages[..self.dim].copy_from_slice(dy);
        if !continues {
            self.forget();
        }
        self.step = self.memory.as_ref().map_or(self.step, |memory| memory.limited(self.step));
    }

    fn commit(&mut self) {
        assert_eq!(self.phase, Phase::Concluded, "conclude the step first");
        let (n, end) = (self.stride, self.tableau.end_slot() * self.stride);
        // what happens where a step was to end, the method does not know: its slopes may jump there
        let changes = self.goal == Some(self.t_new) || self.is_discontinuity(self.t_new);
        self.sloped_at = self.before_jumps(self.t_new, self.attempted_h);
        self.corner_behind = self.corner_ahead && self.goal == Some(self.t_new);
        self.corner_ahead = false;
        let cut = self.t_new != self.t_old + self.step * self.direction;
        let mut growth = None;
        if let Some(memory) = &mut self.memory {
            let error = memory.decide(&self.norm, self.attempted_h, &self.stages, &self.y_old, &self.y_new);
            self.controller.set_order(memory.order());
            let factor = self.controller.accepted(error).min(memory::LARGEST_GROWTH);
            growth = Some(if factor > 1.0 && factor < memory::LEAST_GROWTH { 1.0 } else { factor });
            memory.shift(self.t_old, &mut self.stages, n);
        }
        std::mem::swap(&mut self.y_old, &mut self.y_new);
        self.stages.copy_within(end..end + n, 0);
        self.t_old = self.t_new;
        self.phase = Phase::Ready;
        self.goal = None;
        self.counters.steps += 1;
        self.counters.by_rounding += u64::from(self.by_rounding);
        self.rounding.taken(self.by_rounding);
        self.judge_anew();
        match &mut self.grid {
            Some(grid) => {
                grid.reached(self.t_old);
                self.step = grid.step();
            }
            None => {
                let h = self.attempted_h.abs();
                let next = h * growth.unwrap_or_else(|| self.controller.accepted(self.error));
                // a step shortened by t_end does not change the planned length
                let planned = if cut && h < self.step { self.step } else { 0.0 };
                self.step = next.max(planned).min(self.options.max_step);
            }
        }
        if changes {
            self.forget();
        }
    }

    fn reject(&mut self, factor: f64) {
        assert_ne!(self.phase, Phase::Ready, "there is no step to reject");
        self.step = self.attempted_h.abs() * factor;
        self.controller.hold();
        self.throw_away();
    }

    fn end_at(&mut self, t: f64) {
        assert_eq!(self.phase, Phase::Concluded, "conclude the step first");
        self.step = self.step.max(self.attempted_h.abs());
        self.goal = Some(self.exactly(t));
        self.corner_ahead = false;
        self.throw_away();
    }

    fn end_at_corner(&mut self, t: f64) {
        self.end_at(t);
        self.corner_ahead = true;
    }
}

impl ExplicitRungeKutta {
    /// The next step is judged by the tolerance alone again.
    fn judge_anew(&mut self) {
        if std::mem::take(&mut self.by_rounding) {
            self.norm.set_floor(None, self.attempted_h);
        }
    }

    fn throw_away(&mut self) {
        self.judge_anew();
        self.dense.ready = false;
        self.phase = Phase::Ready;
        self.counters.rejected += 1;
    }

    /// Error of the attempted step in units of the tolerance, at most one; 0 with a fixed step.
    pub fn error_ratio(&self) -> f64 {
        self.error
    }
}
