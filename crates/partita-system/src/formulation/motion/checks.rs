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
    /// The distance from a singular position, as in the checks, where it has fallen up to the end of the step that is
    /// judged, and of the one before.
    trial_nearest: Gap,
    nearest: Gap,
    /// The motion up to here for which errors of the dimensions alone have held the mechanism.
    by_errors: Gap,
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
        let (speed, strongest) = (length(s, |i| r.at.v[i]), r.strongest(vdot).max(r.fastest().powi(2)));
        self.trial_sizes = (self.sizes.0.max(speed), self.sizes.1.max(strongest));
        let (violation, row) = r.acceleration_gap(vdot);
        self.trial.acceleration =
            Gap { part: in_parts(violation, self.trial_sizes.1.max(tolerance::STANDING)), t, row };
        self.trial.jump = self.jump(t, r);
        let part = drift.map_or(0.0, |(violation, distance)| in_parts(violation, distance * distance));
        self.trial.branch = Gap { part, t, row: 0 };
        self.trial.speed = s.iter().zip(&r.at.v).fold(0.0, |m, (s, v)| m.max((v / s).abs()));
    }

    /// Difference of velocities from the integrated ones, relative to the speed.
    fn jump<S: ConstrainedSystem>(&mut self, t: f64, r: &Reduction<S>) -> Gap {
        let s = r.scales();
        let part = match self.integrated.len() == r.at.v.len() {
            true => {
                let speed = self.trial_sizes.0.max(length(s, |i| r.at.v[i])).max(tolerance::STANDING);
                in_parts(length(s, |i| r.at.v[i] - self.integrated[i]), speed)
            }
            false => 0.0,
        };
        self.integrated.clear();
        Gap { part, t, row: 0 }
    }

    /// The end of a step, at this distance from a singular position, the start at the distance `before`. What comes near and
    /// recedes without crossing one has passed it.
    fn approach(&mut self, near: Gap, before: Option<f64>, crosses: bool) {
        // one that only its rounding moves does not fall
        let falls = before.is_some_and(|before| near.part * before * before > 1.0 + tolerance::EQUAL);
        self.trial_nearest = if falls && !crosses { near } else { Gap::default() };
        if !falls && !crosses {
            self.trial.nearest = self.nearest;
        }
    }

    /// The strongest acceleration up to the end of the step that is judged [1/s²].
    pub(super) fn strongest(&self) -> f64 {
        self.trial_sizes.1
    }

    /// The step that was examined is accepted; `hidden` where it crossed a guard and came back.
    pub(super) fn accept(&mut self, hidden: Option<Gap>) {
        self.trial.hidden = hidden.unwrap_or_default();
        self.sizes = self.trial_sizes;
        (self.nearest, self.by_errors) = (self.trial_nearest, self.trial.by_errors);
        self.taken.raise(&self.trial);
        self.taken.near_end = self.nearest;
    }

    /// An output, the point last evaluated.
    pub(super) fn output<S: ConstrainedSystem>(&mut self, t: f64, r: &Reduction<S>, outputs: Gaps, explained: f64) {
        let jump = self.jump(t, r);
        let surge = Gap { part: in_parts(r.fastest(), explained), t, row: 0 };
        let surge_rate = match surge.part > tolerance::CLEARLY {
            true => r.fastest(),
            false if surge.part.is_nan() => f64::INFINITY,
            false => 0.0,
        };
        self.taken.raise(&StepChecks { outputs, jump, surge, surge_rate, ..StepChecks::default() });
    }
}

impl<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>, P: Positions<'s, S, T>> Motion<'s, S, T, P> {
    /// Compare the end of a step, the point last evaluated, with the state before it.
    pub(super) fn check_step(&mut self, t: f64) {
        let (distance, near) = (self.tangent.distance_of_drift(), self.near(t));
        let r = self.tangent.seen();
        let drift = distance.map(|distance| (r.gap().0, distance));
        self.checks.look(t, r, &self.vdot, drift);
        self.checks.trial.nearest = Gap::default();
        let part = near.map_or(0.0, |d| (d * d).recip());
        let passes = self.monitor.crosses_now();
        let [before, _] = self.margins();
        self.checks.approach(Gap { part, t, row: 0 }, before, passes);
        let moved = self.monitor.length().unwrap_or(0.0) * self.monitor.rate();
        let by_errors = near.is_some_and(|d| d < self.drawing_errors.0) && !passes;
        self.checks.trial.by_errors = match by_errors {
            true => Gap { part: self.checks.by_errors.part + moved, t, row: 0 },
            false => Gap::default(),
        };
    }

    /// Distance of the mechanism from a singular position at the end of a step, the point last evaluated, where errors of
    /// its dimensions may have opened what meets there.
    fn near(&self, t: f64) -> Option<f64> {
        let (removed, possible) = self.drawing_errors;
        let limit = possible.max(removed / tolerance::BRANCH_BY_ERROR);
        let within = |d: &f64| d * d < limit;
        let kept = self.margin.map(|m| m.0).filter(within)?;
        // rows that are kept come near to dependence elsewhere as well
        let of_mechanism = self.others(t, self.positions.q()).map_or(kept, |x| x.distance.max(kept));
        Some(of_mechanism).filter(within)
    }

    /// Violations at an output, the point last evaluated.
    pub(super) fn output_gaps(&self, t: f64) -> Gaps {
        let r = self.tangent.seen();
        let mut found = gaps(t, r);
        found.in_parts_of(self.closure.fastest_yet().max(r.fastest()));
        found
    }

    /// Count an output, the point last evaluated, with these violations.
    pub(super) fn count_output(&mut self, t: f64, found: Gaps) {
        // before the first step the speed is unknown
        let explained = match self.monitor.length() {
            // what rests moves within the tolerance, between the ends of steps as at them
            Some(h) => {
                let rests = tolerance::ERROR_GROWTH * tolerance::STANDING;
                self.closure.fastest_yet() + h * self.checks.trial_sizes.1 + rests
            }
            None => f64::INFINITY,
        };
        self.checks.output(t, self.tangent.seen(), found, explained);
    }
}
