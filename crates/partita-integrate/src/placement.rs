//! Where steps begin and end: lengths, goals, grids. No method of integration differs here.

use crate::failure::StepFailure;
use crate::fixed_grid::FixedGrid;
use crate::options::Options;
use partita_math::tolerance;
use std::fmt::Display;

/// Lower bound of |t| for the round-off of the time. Unit: fraction of the run. Reason: near t = 0 the time itself has
/// no size.
const NEAR_ZERO_TIME: f64 = 1e-6;
/// Shortening after a point that cannot be evaluated. Unit: ratio of steps. Reason: near the end of what can be
/// evaluated a half would be too short.
const RETRY_FACTOR: f64 = 0.6;
/// Shortening after a number that is not finite. Unit: ratio of steps. Reason: its cause is unknown.
const NOT_FINITE_FACTOR: f64 = 0.5;

/// The times of the step at hand and the length of the next one.
#[derive(Debug, Clone)]
pub(crate) struct Placement {
    pub(crate) t_old: f64,
    pub(crate) t_new: f64,
    pub(crate) t_end: f64,
    /// Length of the run.
    pub(crate) span: f64,
    /// Where the next step is to end at the latest.
    pub(crate) goal: Option<f64>,
    /// A step of a fixed grid ends here instead of at the next point.
    pub(crate) before_grid: Option<f64>,
    /// Whether the slopes have a corner at `goal`, and at `t_old`.
    pub(crate) corner_ahead: bool,
    pub(crate) corner_behind: bool,
    /// Length of the next attempt, positive.
    pub(crate) step: f64,
    pub(crate) direction: f64,
    pub(crate) grid: Option<FixedGrid>,
    /// Signed length of the last attempt that was acceptable.
    pub(crate) attempted_h: f64,
    shortest: f64,
}

/// A motion between two steps, to be gone on with by another method.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Handover<'a> {
    pub(crate) at: &'a Placement,
    /// When the slope was evaluated.
    pub(crate) sloped_at: f64,
    pub(crate) y: &'a [f64],
    pub(crate) dy: &'a [f64],
}

impl Placement {
    pub(crate) fn new() -> Self {
        Self {
            t_old: 0.0,
            t_new: 0.0,
            t_end: 0.0,
            span: 0.0,
            goal: None,
            before_grid: None,
            corner_ahead: false,
            corner_behind: false,
            step: 0.0,
            direction: 1.0,
            grid: None,
            attempted_h: 0.0,
            shortest: 0.0,
        }
    }

    /// Continue to another end. A fixed grid begins anew at `t_old`.
    fn set_t_end(&mut self, t_end: f64, fixed_step: Option<f64>) {
        let span = t_end - self.t_old;
        self.t_end = t_end;
        self.span = span.abs();
        self.direction = if span < 0.0 { -1.0 } else { 1.0 };
        self.shortest = tolerance::TEN_ROUNDINGS * (NEAR_ZERO_TIME * span.abs());
        self.grid = fixed_step.map(|h| FixedGrid::new(h, self.t_old, t_end));
    }

    /// Head for an end: the length of the first step, where it is given.
    pub(crate) fn head_for(&mut self, t_end: f64, options: &Options) -> Option<f64> {
        self.set_t_end(t_end, options.fixed_step);
        options.fixed_step.or(options.first_step.map(|h| h.min(options.max_step)))
    }

    /// Signed step and its end: `t_end`, the next grid point or the goal if within reach, so that they are met exactly.
    pub(crate) fn plan(&self) -> (f64, f64) {
        let first = |a: f64, b: f64| if (b - a) * self.direction < 0.0 { b } else { a };
        let ahead = || self.goal.into_iter().fold(self.t_end, first);
        let on_grid = |grid: &FixedGrid| self.before_grid.unwrap_or(grid.goal());
        let goal = self.grid.as_ref().map_or_else(ahead, on_grid);
        let rest = goal - self.t_old;
        if rest.abs() <= tolerance::TO_THE_END * self.step {
            return (rest, goal);
        }
        // the step goes to its end as rounded: over many steps those roundings would add up
        let t_new = self.t_old + self.step * self.direction;
        (t_new - self.t_old, t_new)
    }

    /// Where a step to t_new is evaluated at its end: where its slopes may jump, before that.
    pub(crate) fn before_jumps(&self, t_new: f64, h: f64) -> f64 {
        let jumps = self.goal == Some(t_new) && !self.corner_ahead;
        match self.grid.is_none() && jumps {
            true => t_new - self.direction * f64::EPSILON * t_new.abs().max(h.abs()),
            false => t_new,
        }
    }

    /// Whether a step that ends at t_new begins or ends at a corner of the slopes.
    pub(crate) fn has_corner(&self, t_new: f64) -> bool {
        self.corner_behind || (self.corner_ahead && self.goal == Some(t_new))
    }

    /// Whether half of the step is still long enough to be tried.
    pub(crate) fn may_shrink(&self) -> bool {
        self.step > tolerance::SOLUTION_ROUNDING * self.t_new.abs().max(self.span)
    }

    /// The attempted step is the last one: the next one begins at its end. Whether it was cut to meet an end, and whether
    /// something unknown happens there, so that slopes may jump.
    pub(crate) fn take(&mut self) -> (bool, bool) {
        let changes = self.goal == Some(self.t_new);
        self.corner_behind = self.corner_ahead && changes;
        self.corner_ahead = false;
        let cut = self.t_new != self.t_old + self.step * self.direction;
        self.t_old = self.t_new;
        (self.goal, self.before_grid) = (None, None);
        (cut, changes)
    }

    /// The next step of a grid, or one that is `factor` times as long as the one taken.
    pub(crate) fn lengthen(&mut self, cut: bool, longest: f64, factor: impl FnOnce() -> f64) {
        match &mut self.grid {
            Some(grid) => {
                grid.reached(self.t_old);
                self.step = grid.step();
            }
            None => {
                let h = self.attempted_h.abs();
                let next = h * factor();
                // a step shortened by t_end does not change the planned length
                let planned = if cut && h < self.step { self.step } else { 0.0 };
                self.step = next.max(planned).min(longest);
            }
        }
    }

    /// The concluded step is repeated and ends at t inside it.
    pub(crate) fn end_at(&mut self, t: f64) {
        self.step = self.step.max(self.attempted_h.abs());
        match self.grid {
            Some(_) => self.before_grid = Some(t),
            None => self.goal = Some(t),
        }
        self.corner_ahead = false;
    }

    /// The next attempt after one of length h at which f was not evaluable for the n-th time. The factor varies a little
    /// from time to time, so that the stages of the repetitions do not meet the same point again.
    pub(crate) fn shorten_for_retry(&mut self, h: f64, n: u64) {
        let wander = (n as f64 * 0.618_033_988_749_895).fract();
        self.step = h.abs() * (RETRY_FACTOR - 0.05 * wander);
    }

    /// The next attempt after one of length h that led to a number that is not finite.
    pub(crate) fn shorten_not_finite(&mut self, h: f64) {
        self.step = h.abs() * NOT_FINITE_FACTOR;
    }

    /// The shortest step worth trying here.
    pub(crate) fn shortest_step(&self) -> f64 {
        self.shortest.max(tolerance::TEN_ROUNDINGS * self.t_old.abs())
    }

    /// Whether the next step is too short after one of length h.
    fn is_too_short(&self, h: f64) -> bool {
        self.step < self.shortest_step() || h == 0.0
    }

    /// Whether the next step is long enough. Else the last obstacle is taken for the reason.
    pub(crate) fn check_length<E: Display>(&self, h: f64, last: &mut Option<E>) -> Result<(), StepFailure<E>> {
        match self.is_too_short(h) {
            true => Err(StepFailure::TooSmall { t: self.t_old, h: self.step, last: last.take() }),
            false => Ok(()),
        }
    }

    /// Likewise, where a component was not finite.
    pub(crate) fn check_finite<E: Display>(&self, h: f64, component: usize) -> Result<(), StepFailure<E>> {
        match self.is_too_short(h) {
            true => Err(StepFailure::NotFinite { t: self.t_old, component }),
            false => Ok(()),
        }
    }
}
