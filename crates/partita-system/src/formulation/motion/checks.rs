//! Checks of accepted steps and outputs besides the closure of the conditions at the ends of steps.

use super::Motion;
use crate::positions::Positions;
use crate::record::{Gap, Gaps, StepChecks};
use crate::reduction::Reduction;
use crate::singular::consistency::gaps;
use crate::step_boundary::length;
use crate::system::ConstrainedSystem;
use crate::tangent::Tangent;
use partita_math::tolerance;

/// Checks of the step that is judged, of accepted ones, and of the outputs.
#[derive(Default)]
pub(super) struct Checks {
    trial: StepChecks,
    /// Largest speed, in scales, and acceleration [1/s²] up to the end of the step that is judged, and of accepted
    /// ones.
    trial_sizes: (f64, f64),
    sizes: (f64, f64),
    /// Velocities as integrated, before their error of S4 is removed.
    integrated: Vec<f64>,
    pub(super) taken: StepChecks,
}

fn in_parts(x: f64, of: f64) -> f64 {
    if x > 0.0 {
        x / of
    } else {
        0.0
    }
}

impl Checks {
    /// Velocities as they come out of a step.
    pub(super) fn integrated(&mut self, v: &[f64]) {
        self.integrated.clear();
        self.integrated.extend_from_slice(v);
    }

    /// The end of a step, the point last evaluated, with accelerations `vdot`. `violation` and `distance`: for a motion that
    /// drifts, the relative closure error of its positions, and the distance from a singular position.
    pub(super) fn look<S: ConstrainedSystem>(
        &mut self,
        t: f64,
        r: &Reduction<S>,
        vdot: &[f64],
        drift: Option<(f64, f64)>,
    ) {
        let s = r.scales();
        let (speed, strongest) = (length(s, |i| r.v[i]), r.strongest(vdot).max(r.fastest().powi(2)));
        self.trial_sizes = (self.sizes.0.max(speed), self.sizes.1.max(strongest));
        let (violation, row) = r.acceleration_gap(vdot);
        self.trial.acceleration = Gap { part: in_parts(violation, self.trial_sizes.1), t, row };
        self.trial.jump = self.jump(t, r);
        let part = drift.map_or(0.0, |(violation, distance)| in_parts(violation, distance * distance));
        self.trial.branch = Gap { part, t, row: 0 };
        self.trial.hidden = Gap::default();
        self.trial.speed = s.iter().zip(&r.v).fold(0.0, |m, (s, v)| m.max((v / s).abs()));
    }

    /// Difference of velocities from the integrated ones, relative to the speed.
    fn jump<S: ConstrainedSystem>(&mut self, t: f64, r: &Reduction<S>) -> Gap {
        let s = r.scales();
        let part = match self.integrated.len() == r.v.len() {
            true => {
                let speed = self.trial_sizes.0.max(length(s, |i| r.v[i]));
                in_parts(length(s, |i| r.v[i] - self.integrated[i]), speed)
            }
            false => 0.0,
        };
        self.integrated.clear();
        Gap { part, t, row: 0 }
    }

    /// The step that is judged crosses a guard and comes back, and cannot be shortened.
    pub(super) fn hidden(&mut self, t: f64, guard: usize) {
        self.trial.hidden = Gap { part: 1.0, t, row: guard };
    }

    /// The step that was examined is accepted.
    pub(super) fn accept(&mut self) {
        self.sizes = self.trial_sizes;
        self.taken.raise(&self.trial);
    }

    /// An output, the point last evaluated.
    pub(super) fn output<S: ConstrainedSystem>(&mut self, t: f64, r: &Reduction<S>, outputs: Gaps, explained: f64) {
        let jump = self.jump(t, r);
        let surge = Gap { part: in_parts(r.fastest(), explained), t, row: 0 };
        self.taken.raise(&StepChecks { outputs, jump, surge, ..StepChecks::default() });
    }

    /// Count from here on.
    pub(super) fn forget(&mut self) {
        self.taken = StepChecks::default();
    }
}

impl<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>, P: Positions<'s, S, T>> Motion<'s, S, T, P> {
    /// Compare the end of a step, the point last evaluated, with the state before it.
    pub(super) fn check_step(&mut self, t: f64) {
        let distance = self.tangent.distance_of_drift();
        let r = self.tangent.seen();
        let drift = distance.map(|distance| (r.gap().0, distance));
        self.checks.look(t, r, &self.vdot, drift);
    }

    /// Violations at an output, the point last evaluated.
    pub(super) fn output_gaps(&self, t: f64) -> Gaps {
        let r = self.tangent.seen();
        let mut found = gaps(t, r);
        found.in_parts_of(self.watch.fastest_yet().max(r.fastest()));
        found
    }

    /// Count an output, the point last evaluated, with these violations.
    pub(super) fn count_output(&mut self, t: f64, found: Gaps) {
        // before the first step the speed is unknown
        let explained = match self.monitor.length() {
            // what rests moves within the tolerance, between the ends of steps as at them
            Some(h) => {
                let rests = tolerance::ERROR_GROWTH * tolerance::STANDING;
                self.watch.fastest_yet() + h * self.checks.trial_sizes.1 + rests
            }
            None => f64::INFINITY,
        };
        self.checks.output(t, self.tangent.seen(), found, explained);
    }
}
