//! What can be read from a stepper, and set between two steps.

use super::{Phase, Stepper};
use crate::counters::Counters;
use crate::tableau::Tableau;

/// Shorter steps are not shortened again. Scale: fraction of the time (of the run, near t = 0). Reason: some hundred
/// times the round-off of t.
const SHORTEST_IN_TIME: f64 = 1e-13;

impl Stepper {
    /// The method.
    pub fn tableau(&self) -> &'static Tableau {
        self.tableau
    }

    /// Whether `t_end` is reached.
    pub fn finished(&self) -> bool {
        self.t_old == self.t_end
    }

    /// Where the integration ends.
    pub fn t_end(&self) -> f64 {
        self.t_end
    }

    /// Start of the step.
    pub fn t_old(&self) -> f64 {
        self.t_old
    }

    /// End of the attempted step.
    pub fn t_new(&self) -> f64 {
        self.t_new
    }

    /// State at `t_old`.
    pub fn y_old(&self) -> &[f64] {
        &self.y_old[..self.dim]
    }

    /// Slope at `t_old`.
    pub fn dy_old(&self) -> &[f64] {
        self.slot(0)
    }

    /// State at `t_new`, the replaced one if it was replaced.
    pub fn y_new(&self) -> &[f64] {
        let y = if self.replaced { &self.y_next } else { &self.y_new };
        &y[..self.dim]
    }

    /// State at `t_new`, to be corrected in place between [`attempt`](Stepper::attempt) and
    /// [`conclude`](Stepper::conclude).
    pub fn y_new_mut(&mut self) -> &mut [f64] {
        assert_eq!(self.phase, Phase::Attempted, "correct the end before the step is concluded");
        &mut self.y_new[..self.dim]
    }

    /// Slope at `t_new` of the concluded step, the replaced one if it was replaced.
    pub fn dy_new(&self) -> &[f64] {
        if self.replaced {
            &self.f_next[..self.dim]
        } else {
            self.slot(self.tableau.end_slot())
        }
    }

    /// Is the next step still long enough for half of it to be worth a try?
    pub fn may_shrink(&self) -> bool {
        self.step > SHORTEST_IN_TIME * self.t_new.abs().max(self.span)
    }

    /// Error of the attempted step in units of the tolerance, at most one; 0 with a fixed step.
    pub fn error_ratio(&self) -> f64 {
        self.error
    }

    /// Length of the next step to be attempted (positive), before it is cut to meet `t_end`.
    pub fn step_size(&self) -> f64 {
        self.step
    }

    /// Set the length of the next step to be attempted; its sign is ignored. Call it after
    /// [`commit`](Stepper::commit) or [`reject`](Stepper::reject). A fixed step returns with the step after it.
    pub fn set_step_size(&mut self, h: f64) {
        self.step = h.abs();
        self.others.clear();
    }

    /// Should the next step fail by its error, try these lengths, the last first, before it is shortened: for where a
    /// shorter one is no better. Call it after [`set_step_size`](Stepper::set_step_size), which forgets them.
    pub fn set_other_sizes(&mut self, lengths: impl IntoIterator<Item = f64>) {
        self.others.extend(lengths);
    }

    /// The next step is to end at `t` if it would go beyond.
    pub fn set_goal(&mut self, t: Option<f64>) {
        self.goal = t;
    }

    /// Unless set otherwise: take no tolerance for smaller than `floor` (0 is the rule), and accept errors up to
    /// `limit` tolerances (1 is the rule). For where the estimate is known to be round-off, so that shorter steps would
    /// not lower it. Steps that the tolerances themselves would have refused are counted.
    pub fn set_lenience(&mut self, floor: f64, limit: f64) {
        self.floor = floor;
        self.norm.set_floor(floor);
        self.lenience = limit.max(1.0);
    }

    /// Natural size of each component, in which `atol` and the floor of [`set_lenience`](Stepper::set_lenience) are
    /// meant from the next step on; 1 unless set otherwise.
    pub fn set_sizes(&mut self, sizes: &[f64]) {
        self.norm.set_sizes(sizes);
    }

    /// The work done since [`new`](Stepper::new).
    pub fn counters(&self) -> &Counters {
        &self.counters
    }
}
