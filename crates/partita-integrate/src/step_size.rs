//! How large the error is, and how long the next step shall be.

use crate::combination::{Row, TILE};
use crate::failure::StepFailure;
use crate::ode::{Ode, RhsError};
use crate::options::{AbsoluteTolerance, Options};
use crate::placement::Placement;
use crate::rounding::SlopeRounding;
use crate::tableau::Tableau;
use partita_math::tolerance;
use std::fmt::Display;

/// Rates below this do not indicate the scale of a motion. Scale: multiples of the tolerance. Reason: the rule of Hairer,
/// Norsett and Wanner for the first step.
const MOVED_NOTHING: f64 = 1e-5;
/// A state below this does not indicate the scale of a motion. Scale: multiples of the tolerance. Reason: what is smaller
/// than its tolerance may be rounding, and a hundredth of it over a rate is then a time that means nothing.
const NO_SIZE: f64 = 1.0;
/// The first step where nothing else is known. Unit: s. Reason: the rule of Hairer, Norsett and Wanner for the first
/// step.
const FIRST_STEP: f64 = 1e-6;
/// Fraction of the first guess that remains where nothing accelerates. Unit: ratio of steps. Reason: the rule of
/// Hairer, Norsett and Wanner for the first step.
const FIRST_GROWTH: f64 = 1e-3;
/// Fraction of the theoretically right step that is taken. Unit: ratio of steps. Reason: refused steps cost more than
/// shorter ones.
pub const SAFETY: f64 = 0.9;
/// Largest shortening of a step for its error. Unit: ratio of steps. Reason: one estimate is not trusted any further.
pub const SMALLEST_FACTOR: f64 = 0.2;
/// Largest lengthening of a step. Unit: ratio of steps. Reason: one estimate is not trusted any further.
pub const LARGEST_FACTOR: f64 = 6.0;
/// Smaller errors are stored as this. Unit: multiples of the tolerance. Reason: a lucky step must not forbid the next
/// one.
const SMALLEST_REMEMBERED_ERROR: f64 = 1e-4;

/// The first step is at least this long. Scale: multiples of ten roundings of the time. Reason: over it the rounding of
/// the time changes a slope by less than the motion does.
const FIRST_ROUNDINGS: f64 = 1e3;

/// Proportional–integral control of the step, after Gustafsson, with the constants of Hairer and Wanner.
///
/// With `err` the error of this step and `err_old` that of the step before, both relative to the tolerance, the next
/// step is `h · 0.9 · err^(−1/(q+1) + 0.75 β) · err_old^β`, between 0.2 h and 6 h, and no longer than h right after a
/// rejection. `β = 0` is the elementary controller.
#[derive(Debug, Clone)]
pub struct StepController {
    exponent: f64,
    beta: f64,
    previous_error: f64,
    may_grow: bool,
}

impl StepController {
    /// Controller for an error estimate of order `error_order` with integral share `beta`.
    pub fn new(error_order: usize, beta: f64) -> Self {
        let exponent = 1.0 / (error_order as f64 + 1.0) - 0.75 * beta;
        Self { exponent, beta, previous_error: SMALLEST_REMEMBERED_ERROR, may_grow: true }
    }

    /// Factor for the next step after one of error `err` was taken.
    pub fn accepted(&mut self, err: f64) -> f64 {
        let mut factor = SAFETY * err.powf(-self.exponent);
        if self.beta != 0.0 {
            factor *= self.previous_error.powf(self.beta);
        }
        let largest = if self.may_grow { LARGEST_FACTOR } else { 1.0 };
        self.may_grow = true;
        self.previous_error = err.max(SMALLEST_REMEMBERED_ERROR);
        factor.clamp(SMALLEST_FACTOR, largest)
    }

    /// Factor for the repetition of a step whose error `err` was above one.
    pub fn rejected(&mut self, err: f64) -> f64 {
        self.may_grow = false;
        (SAFETY * err.powf(-self.exponent)).max(SMALLEST_FACTOR)
    }

    /// The estimate is of this order from now on.
    pub fn set_order(&mut self, error_order: usize) {
        self.exponent = 1.0 / (error_order as f64 + 1.0) - 0.75 * self.beta;
    }

    /// Forbid the next accepted step to lengthen the one after it.
    pub fn hold(&mut self) {
        self.may_grow = false;
    }

    /// Forget all history, for a new start.
    pub fn reset(&mut self) {
        self.previous_error = SMALLEST_REMEMBERED_ERROR;
        self.may_grow = true;
    }
}

/// An estimated error is multiplied by this before it is compared with the tolerance. Unit: factor. Reason: mechanisms
/// pass positions where a motion nearly stops, and earlier errors are multiplied by thousands; at order eight it costs
/// a fifth more steps and leaves a quarter of the error.
pub const ERROR_MARGIN: f64 = 4.0;

/// The largest of the controlled components, each measured in its own tolerance.
///
/// Not their root mean square: the dependent coordinates of a mechanism follow from the independent ones, so a mean
/// would divide the error of the few that matter by the number of those that do not.
#[derive(Debug)]
pub(crate) struct ErrorNorm {
    rtol: f64,
    /// As requested, in natural sizes.
    asked: Vec<f64>,
    /// Natural sizes of the components.
    sizes: Vec<f64>,
    atol: Vec<f64>,
    /// What is added to each tolerance: rounding of the estimate.
    floor: Vec<f64>,
    controlled: usize,
    /// A component whose error is bounded too, and its absolute tolerance and reference size.
    observed: Option<Observed>,
}

/// Errors of an observed component are bounded by this. Scale: multiples of the tolerance of a controlled one, relative to
/// the largest of its values and its reference. Reason: what a balance over the run may be off.
const OBSERVED: f64 = tolerance::ERROR_GROWTH;

/// A component that decides on a step only where its error is far beyond the tolerance.
#[derive(Debug, Clone, Copy)]
struct Observed {
    at: usize,
    atol: f64,
    size: f64,
    reference: f64,
}

/// The larger of these squares and those of errors in units of their tolerances.
#[inline(always)]
pub(crate) fn enlarge(squares: &mut [f64; TILE], error: &[f64; TILE], tolerance: &[f64; TILE]) {
    for lane in 0..TILE {
        let e = error[lane] / tolerance[lane];
        // a NaN must not hide behind a comparison
        let e2 = e * e;
        squares[lane] = if e2 <= squares[lane] { squares[lane] } else { e2 };
    }
}

impl ErrorNorm {
    /// Norm for an equation of dimension `dim`, with an observed component behind the controlled ones; `stride` is the padded
    /// length.
    pub(crate) fn new(options: &Options, observed: Option<usize>, dim: usize, stride: usize) -> Self {
        let controlled = options.controlled.min(dim);
        let mut atol = vec![1.0; stride]; // ones in the padding: it must not divide zero by zero
        match &options.atol {
            AbsoluteTolerance::Same(value) => atol[..controlled].fill(*value),
            AbsoluteTolerance::Each(values) => atol[..controlled].copy_from_slice(values),
        }
        let least = match &options.atol {
            AbsoluteTolerance::Same(value) => *value,
            AbsoluteTolerance::Each(values) => values.iter().copied().fold(f64::INFINITY, f64::min),
        };
        let observed = observed.filter(|at| (controlled..dim).contains(at));
        let observed = observed.map(|at| Observed { at, atol: least, size: 1.0, reference: 0.0 });
        let (asked, sizes, floor) = (atol.clone(), vec![1.0; stride], vec![0.0; stride]);
        Self { rtol: options.rtol, asked, sizes, atol, floor, controlled, observed }
    }

    /// Estimates over a step of length h have the rounding of these slopes; none: nothing is known of it.
    pub(crate) fn set_floor(&mut self, slopes: Option<&[f64]>, h: f64) {
        match slopes {
            Some(slopes) => {
                self.floor.iter_mut().zip(slopes).for_each(|(to, x)| *to = SlopeRounding::of_estimate(*x, h));
            }
            None => self.floor.fill(0.0),
        }
    }

    /// Natural sizes of the components.
    pub(crate) fn sizes(&self) -> &[f64] {
        &self.sizes
    }

    /// Absolute tolerances are in these sizes, one for each component.
    pub(crate) fn set_sizes(&mut self, sizes: &[f64]) {
        for (i, size) in sizes.iter().take(self.controlled).enumerate() {
            self.sizes[i] = *size;
            self.atol[i] = self.asked[i] * size;
        }
        if let Some(x) = &mut self.observed {
            x.size = sizes.get(x.at).copied().unwrap_or(1.0);
        }
    }

    /// The size that errors of the observed component are compared with at least.
    pub(crate) fn set_reference(&mut self, reference: f64) {
        if let Some(x) = &mut self.observed {
            x.reference = reference;
        }
    }

    /// For each of the rows, the largest `(Σ w_j k_j / tolerance)²` over the controlled components.
    pub(crate) fn largest_squares<const R: usize>(
        &self,
        rows: &[Row; R],
        stages: &[f64],
        y_old: &[f64],
        y_new: &[f64],
    ) -> [f64; R] {
        let mut squares = [[0.0; TILE]; R];
        for at in (0..self.controlled).step_by(TILE) {
            let tolerance = self.tolerance_tile(at, y_old, y_new);
            let lanes = (self.controlled - at).min(TILE);
            for (row, squares) in rows.iter().zip(&mut squares) {
                let mut error = row.tile(stages, y_old.len(), at);
                error[lanes..].fill(0.0);
                enlarge(squares, &error, &tolerance);
            }
        }
        if let Some(x) = &self.observed {
            let largest = y_old[x.at].abs().max(y_new[x.at].abs()).max(x.reference);
            let tolerance = (OBSERVED * (x.atol * x.size + self.rtol * largest)).max(f64::MIN_POSITIVE);
            let (at, lane) = (x.at / TILE * TILE, x.at % TILE);
            for (row, squares) in rows.iter().zip(&mut squares) {
                let e = row.tile(stages, y_old.len(), at)[lane] / tolerance;
                let e2 = e * e;
                squares[lane] = if e2 <= squares[lane] { squares[lane] } else { e2 };
            }
        }
        squares.map(|lanes| lanes.iter().fold(0.0, |m: f64, &x| if x <= m { m } else { x }))
    }

    #[inline(always)]
    fn tolerance_tile(&self, at: usize, y_old: &[f64], y_new: &[f64]) -> [f64; TILE] {
        let between = (&y_old[at..at + TILE], &y_new[at..at + TILE]);
        self.tolerances(&self.atol[at..at + TILE], &self.floor[at..at + TILE], between)
    }

    /// Tolerances of numbers between these, for absolute tolerances and what is added for rounding.
    #[inline(always)]
    fn tolerances(&self, atol: &[f64], floor: &[f64], (a, b): (&[f64], &[f64])) -> [f64; TILE] {
        let (atol, floor, a, b) = (&atol[..TILE], &floor[..TILE], &a[..TILE], &b[..TILE]);
        let mut tolerance = [0.0; TILE];
        for lane in 0..TILE {
            let scale = atol[lane] + self.rtol * a[lane].abs().max(b[lane].abs()) + floor[lane];
            tolerance[lane] = scale.max(f64::MIN_POSITIVE);
        }
        tolerance
    }

    /// The same for component i in several lanes.
    #[inline(always)]
    pub(crate) fn tolerances_in_lanes(&self, i: usize, between: (&[f64], &[f64])) -> [f64; TILE] {
        self.tolerances(&[self.atol[i]; TILE], &[0.0; TILE], between)
    }

    /// Natural size of component i.
    pub(crate) fn size(&self, i: usize) -> f64 {
        self.sizes[i]
    }

    /// Tolerance of component i at `y`; infinite where its error is not controlled.
    pub(crate) fn tolerance(&self, i: usize, y: &[f64]) -> f64 {
        if i < self.controlled {
            (self.atol[i] + self.rtol * y[i].abs()).max(f64::MIN_POSITIVE)
        } else {
            f64::INFINITY
        }
    }

    /// Largest |x|, measured with the tolerance at `y`.
    fn of(&self, y: &[f64], x: impl Fn(usize) -> f64) -> f64 {
        (0..self.controlled).fold(0.0, |m: f64, i| {
            let e = (x(i) / (self.atol[i] + self.rtol * y[i].abs()).max(f64::MIN_POSITIVE)).abs();
            if e <= m {
                m
            } else {
                e
            }
        })
    }

    /// First guess for the step: an explicit Euler step of this length moves the state by a hundredth of its size.
    pub(crate) fn first_guess(&self, y: &[f64], f: &[f64]) -> f64 {
        let (d0, d1) = (self.of(y, |i| y[i]), self.of(y, |i| f[i]));
        let guess = 0.01 * d0 / d1;
        if d0 < NO_SIZE || d1 < MOVED_NOTHING || !guess.is_finite() {
            FIRST_STEP
        } else {
            guess
        }
    }

    /// Better guess from the slope `f1` at the end of an Euler step of length `h0`: a step whose leading error term,
    /// measured by the larger of first and second derivative, is a hundredth of the tolerance.
    pub(crate) fn second_guess(&self, h0: f64, order: usize, y: &[f64], f0: &[f64], f1: &[f64]) -> f64 {
        let d1 = self.of(y, |i| f0[i]);
        let d2 = self.of(y, |i| f1[i] - f0[i]) / h0;
        let largest = d1.max(d2);
        let h1 = if largest <= tolerance::ROUNDING {
            (h0 * FIRST_GROWTH).max(FIRST_STEP)
        } else {
            (0.01 / largest).powf(1.0 / (order as f64 + 1.0))
        };
        h1.min(100.0 * h0)
    }
}

/// First step by the rule of Hairer, Norsett and Wanner for a method whose estimate has this order, from the slopes at the start
/// and after a guess; `moved` and `f1` are memory.
///
/// # Errors
/// Where the equation fails and no shorter step helps.
pub(crate) fn first_step<E: Display>(
    ode: &mut dyn Ode<Error = E>,
    norm: &ErrorNorm,
    at: &Placement,
    (max_step, order): (f64, usize),
    (y, f0): (&[f64], &[f64]),
    (moved, f1): (&mut [f64], &mut [f64]),
    evaluations: &mut u64,
) -> Result<f64, StepFailure<E>> {
    let longest = max_step.min((at.t_end - at.t_old).abs());
    let least = FIRST_ROUNDINGS * tolerance::TEN_ROUNDINGS * at.t_old.abs();
    let guess = norm.first_guess(y, f0).max(least).min(longest);
    if guess == 0.0 {
        return Ok(longest);
    }
    let h = guess * at.direction;
    moved.iter_mut().zip(y.iter().zip(f0)).for_each(|(to, (y, f))| *to = y + h * f);
    *evaluations += 1;
    let t = at.t_old + h;
    match ode.rhs(t, moved, f1) {
        Ok(()) => {}
        // not evaluable even there: begin with the short guess, which the first attempts will adapt
        Err(RhsError::Retry(_)) => return Ok(guess),
        Err(RhsError::Fatal(error)) => return Err(StepFailure::Rhs { t, error }),
    }
    let better = norm.second_guess(guess, order, y, f0, f1);
    Ok(if better.is_finite() { better.max(least).min(longest) } else { guess })
}

/// The controller of a tableau.
pub fn controller(tableau: &Tableau) -> StepController {
    StepController::new(tableau.error_order, tableau.pi_beta)
}
