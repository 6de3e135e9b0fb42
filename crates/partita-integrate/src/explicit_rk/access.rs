//! Read access to the stepper, and decisions between its evaluations.

use super::{memory, ExplicitRungeKutta, Phase};
use crate::combination::append;
use crate::counters::Counters;
use crate::dense_output::Known;
use crate::placement::Handover;
use crate::scheme::{Scheme, Taken};
use crate::stepper::{CurrentStep, StepControl, StepPlan, StepStorage};

impl StepControl for ExplicitRungeKutta {
    fn current(&self) -> CurrentStep<'_> {
        CurrentStep {
            t_old: self.at.t_old,
            t_new: self.at.t_new,
            t_end: self.at.t_end,
            y_old: &self.y_old[..self.dim],
            dy_old: self.slot(0),
            y_new: &self.y_new[..self.dim],
            dy_new: self.slot(self.tableau.end_slot()),
            next: self.at.step,
            may_shrink: self.at.may_shrink(),
        }
    }

    fn counters(&self) -> &Counters {
        &self.counters
    }

    fn plan(&mut self, plan: &StepPlan) {
        let length = plan.length.abs();
        self.at.step = self.memory.as_ref().map_or(length, |memory| memory.limited(length));
        self.at.goal = plan.goal;
        self.at.corner_ahead = false;
    }

    fn set_sizes(&mut self, sizes: &[f64]) {
        self.norm.set_sizes(sizes);
    }

    fn set_reference(&mut self, size: f64) {
        self.norm.set_reference(size);
    }

    fn replace_start(&mut self, t: f64, y: &[f64], dy: &[f64]) {
        assert_eq!(self.phase, Phase::Ready, "commit or reject the previous step");
        self.at.corner_behind &= t == self.at.t_old;
        // whole turns and times of drives are rewritten at each step; slopes of the same motion remain
        let continues = t == self.at.t_old && self.stages[..self.dim] == *dy;
        if t != self.at.t_old {
            self.sloped_at = t;
        }
        (self.at.t_old, self.at.t_new) = (t, t);
        self.y_old[..self.dim].copy_from_slice(y);
        self.stages[..self.dim].copy_from_slice(dy);
        if !continues {
            self.forget();
        }
        self.at.step = self.memory.as_ref().map_or(self.at.step, |memory| memory.limited(self.at.step));
    }

    fn commit(&mut self) {
        assert_eq!(self.phase, Phase::Concluded, "conclude the step first");
        let (n, end) = (self.stride, self.tableau.end_slot() * self.stride);
        // what happens where a step was to end, the method does not know: its slopes may jump there
        self.sloped_at = self.at.before_jumps(self.at.t_new, self.at.attempted_h);
        let t_before = self.at.t_old;
        let (cut, changes) = self.at.take();
        let mut growth = None;
        if let Some(memory) = &mut self.memory {
            let error = memory.decide(&self.norm, self.at.attempted_h, &self.stages, &self.y_old, &self.y_new);
            self.controller.set_order(memory.order());
            let factor = self.controller.accepted(error).min(memory::LARGEST_GROWTH);
            growth = Some(if factor > 1.0 && factor < memory::LEAST_GROWTH { 1.0 } else { factor });
            memory.shift(t_before, &mut self.stages, n);
        }
        std::mem::swap(&mut self.y_old, &mut self.y_new);
        self.stages.copy_within(end..end + n, 0);
        self.phase = Phase::Ready;
        self.counters.steps += 1;
        self.counters.by_rounding += u64::from(self.by_rounding);
        self.rounding.taken(self.by_rounding);
        self.judge_anew();
        let (controller, error) = (&mut self.controller, self.error);
        self.at.lengthen(cut, self.options.max_step, || growth.unwrap_or_else(|| controller.accepted(error)));
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

impl StepStorage for ExplicitRungeKutta {
    fn save(&self, out: &mut Vec<f64>) -> bool {
        let (dim, stride) = (self.dim, self.stride);
        let slots = self.dense.slots();
        out.reserve((2 + slots.len()) * dim + stride);
        append(&self.y_old, dim, out);
        append(&self.y_new, dim, out);
        let count = self.memory.as_ref().map_or(slots.len(), |memory| memory.save(out));
        for &slot in &slots[..count] {
            append(&self.stages[slot * stride..(slot + 1) * stride], dim, out);
        }
        true
    }

    fn save_extra(&self, out: &mut Vec<f64>) {
        if self.dense.known == Known::Coefficients {
            self.dense.extra().iter().for_each(|stage| out.extend_from_slice(self.slot(stage.slot)));
        }
    }

    fn load(&mut self, (t_old, t_new): (f64, f64), step: &[f64], extra: &[f64]) {
        let (dim, stride) = (self.dim, self.stride);
        (self.at.t_old, self.at.t_new, self.at.attempted_h) = (t_old, t_new, t_new - t_old);
        let (y_old, rest) = step.split_at(dim);
        let (y_new, mut rest) = rest.split_at(dim);
        self.y_old[..dim].copy_from_slice(y_old);
        self.y_new[..dim].copy_from_slice(y_new);
        if let Some(memory) = &mut self.memory {
            rest = memory.load(rest);
        }
        let mut fill = |slot: usize, of: &[f64]| self.stages[slot * stride..slot * stride + dim].copy_from_slice(of);
        self.dense.slots().iter().zip(rest.chunks_exact(dim.max(1))).for_each(|(slot, of)| fill(*slot, of));
        self.dense.extra().iter().zip(extra.chunks_exact(dim.max(1))).for_each(|(stage, of)| fill(stage.slot, of));
        self.dense.known = if extra.is_empty() { Known::Stages } else { Known::ExtraStages };
        self.phase = Phase::Concluded;
    }
    fn taken(&self) -> Option<Taken> {
        let scheme = if self.memory.is_some() { Scheme::accurate() } else { Scheme::of_table(self.tableau) };
        Some(Taken { scheme, states: Vec::new() })
    }
}

impl ExplicitRungeKutta {
    /// The next step is judged by the tolerance alone again.
    fn judge_anew(&mut self) {
        if std::mem::take(&mut self.by_rounding) {
            self.norm.set_floor(None, self.at.attempted_h);
        }
    }

    fn throw_away(&mut self) {
        self.judge_anew();
        self.dense.known = Known::Stages;
        self.phase = Phase::Ready;
        self.counters.rejected += 1;
    }

    /// What another method goes on from.
    pub(crate) fn hand_over(&self) -> Handover<'_> {
        assert_eq!(self.phase, Phase::Ready, "commit or reject the previous step");
        Handover { at: &self.at, sloped_at: self.sloped_at, y: &self.y_old[..self.dim], dy: self.slot(0) }
    }

    /// Go on from where another method stands.
    pub(crate) fn adopt(&mut self, from: Handover) {
        (self.at, self.sloped_at) = (from.at.clone(), from.sloped_at);
        self.y_old[..self.dim].copy_from_slice(from.y);
        self.stages[..self.dim].copy_from_slice(from.dy);
        (self.phase, self.dense.known) = (Phase::Ready, Known::Stages);
        self.controller.reset();
        self.forget();
        self.rounding.forget();
    }

    /// Error of the attempted step in units of the tolerance, at most one; 0 with a fixed step.
    pub fn error_ratio(&self) -> f64 {
        self.error
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ode::{Ode, RhsError};
    use crate::options::Options;
    use crate::stepper::Stepper;
    use crate::tableau::{HEUN_EULER, METHODS};

    /// A swing, and its evaluations.
    struct Swing(usize);

    impl Ode for Swing {
        type Error = String;
        fn dim(&self) -> usize {
            2
        }
        fn rhs(&mut self, _t: f64, y: &[f64], dy: &mut [f64]) -> Result<(), RhsError<String>> {
            self.0 += 1;
            (dy[0], dy[1]) = (y[1], -y[0].sin());
            Ok(())
        }
    }

    #[test]
    fn a_step_that_is_loaded_has_the_bits_of_the_one_saved_and_evaluates_its_slopes_once() {
        for (method, remembers) in METHODS.map(|method| (method, false)).into_iter().chain([(&HEUN_EULER, true)]) {
            let options = Options { fixed_step: (method.error_order == 0).then_some(0.1), ..Options::default() };
            let make = if remembers { ExplicitRungeKutta::remembering } else { ExplicitRungeKutta::new };
            let mut stepper = make(method, 2, options.clone()).unwrap();
            let mut reader = make(method, 2, options).unwrap();
            let mut ode = Swing(0);
            stepper.start(&mut ode, 0.0, &[1.0, 0.3], 3.0).unwrap();
            while !StepControl::current(&stepper).finished() {
                stepper.attempt(&mut ode).unwrap();
                let end: crate::stepper::StepEnd<String> = &mut |t, y, dy, _| {
                    y[0] += 1e-9;
                    Swing(0).rhs(t, y, dy).map(|()| true)
                };
                assert_eq!(stepper.conclude(end), Ok(crate::stepper::Conclusion::Done));
                let (mut step, mut extra) = (Vec::new(), Vec::new());
                assert!(stepper.save(&mut step));
                let (from, to) = (stepper.at.t_old, stepper.at.t_new);
                reader.load((from, to), &step, &[]);
                for part in [0.0, 0.3, 0.9, 1.0] {
                    let t = from + part * (to - from);
                    let (mut own, mut read) = ([0.0; 2], [0.0; 2]);
                    stepper.interpolate(&mut ode, t, &mut own).unwrap();
                    reader.interpolate(&mut ode, t, &mut read).unwrap();
                    assert_eq!(own, read, "{} at {t}", method.name);
                }
                reader.save_extra(&mut extra);
                reader.load((from, to), &step, &extra);
                let before = ode.0;
                let mut again = [0.0; 2];
                reader.interpolate(&mut ode, 0.5 * (from + to), &mut again).unwrap();
                assert_eq!(ode.0 - before, if extra.is_empty() { method.dense.nodes.len() } else { 0 });
                stepper.commit();
            }
        }
    }
}
