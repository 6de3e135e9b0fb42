//! Radau IIA of order five: an implicit method for stiff forces, behind the contract of a [`Stepper`].
//!
//! Its steps are as long as the motion allows, however stiff the forces are that hold it (L-stable). Each step solves for its
//! stages by Newton's method, whose matrix is kept over steps while it converges.
//!
//! The estimate of Hairer and Wanner is of order three, and steps by it fall with the fourth root of the tolerance, which the
//! end of the step, of order five, does not need. It is multiplied by the square of the ratio of the third to the second
//! difference of the slopes, where that is below 1: of a smooth motion this is four times the error, and of order five.

mod access;
mod coefficients;
mod dense;
mod newton_matrix;
mod stages;

use self::coefficients::{Nodes, ERROR, ESTIMATE_ORDER, NODES, S};
use self::dense::Polynomial;
use self::stages::{Iterated, Matrix, StageSolver, Task, MOST};
use crate::combination::first_not_finite;
use crate::counters::Counters;
use crate::failure::StepFailure;
use crate::ode::{Ode, RhsError};
use crate::options::{Options, OptionsError};
use crate::placement::Placement;
use crate::rounding::SlopeRounding;
use crate::step_size::{first_step, ErrorNorm, SAFETY, SMALLEST_FACTOR};
use crate::stepper::{Conclusion, StepEnd, Stepper};
use partita_system::system::Derivatives;
use std::fmt::Display;

/// Largest lengthening of an implicit step. Unit: ratio of steps. Reason: Hairer and Wanner's; a transient that has died out leaves
/// steps that may be longer by orders.
const LARGEST_IMPLICIT: f64 = 8.0;
/// A step is not lengthened by less than this. Unit: ratio of steps. Reason: Hairer and Wanner's; the matrices keep their
/// factors.
const KEPT_FACTOR: f64 = 1.2;
/// A matrix is made anew after a step whose last iteration gained less. Scale: ratio of changes. Reason: another iteration
/// costs three evaluations, about as much as a matrix of few freedoms.
const RENEWED: f64 = 0.02;
/// Where the matrix of a step is made. Unit: part of the step. Reason: in the middle of the stages.
const MATRIX_AT: f64 = 0.6;
/// Iterations after which a matrix is made anew in any case. Scale: number. Reason: as for `RENEWED`.
const KEPT_ITERATIONS: usize = 3;
/// Third over second difference of the slopes, for the estimate as a multiple of the third. Unit: factor. Reason: the estimate
/// is a tenth of that difference.
const THIRD_OF_ESTIMATE: f64 = 10.0;
/// Rate of the iterations for which steps are made, and the power of their length with which it grows. Unit: ratio of changes,
/// and number. Reason: three digits in three iterations; where the stiffest directions turn by δ in a step, what is soft gets
/// a share δ² K h² of their forces.
const AIMED_RATE: (f64, f64) = (0.1, 4.0);
/// The least part of the estimate that counts. Unit: factor. Reason: what is stiff keeps an order between, and an estimate of
/// one component by the ratio of others is trusted to three digits.
const LEAST_PART: f64 = 1e-3;
/// The shortest error that is remembered. Scale: multiples of the tolerance. Reason: a lucky step must not forbid the next one.
const LEAST_REMEMBERED: f64 = 1e-2;

/// Position in the cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    /// At `t_old`, a step may be attempted.
    Ready,
    /// `y_new` is proposed.
    Attempted,
    /// The slope at `y_new` is known too.
    Concluded,
}

/// What an attempted step was found to be.
#[derive(Debug, Clone, Copy, Default)]
struct Judged {
    /// Its error in units of the tolerance.
    error: f64,
    /// The power of the length with which that falls.
    power: f64,
    /// Iterations.
    iterations: usize,
    /// The rate of the last one.
    rate: Option<f64>,
}

impl Judged {
    /// Whether the next step makes its matrix anew.
    fn renews(&self) -> bool {
        self.rate.is_some_and(|rate| rate > RENEWED) || self.iterations > KEPT_ITERATIONS
    }
}

/// The factor with which a step's iterations converge as they should, where they did at this rate.
fn by_rate(rate: f64) -> f64 {
    (AIMED_RATE.0 / rate.max(f64::MIN_POSITIVE)).powf(1.0 / AIMED_RATE.1)
}

/// Control of the step after Gustafsson: it follows the trend of the errors.
#[derive(Debug, Clone, Default)]
struct Predictive {
    /// Length and error of the step before.
    before: Option<(f64, f64)>,
    held: bool,
}

impl Predictive {
    /// The factor by the error alone.
    fn by_error(found: Judged) -> f64 {
        let most = (2 * MOST + 1) as f64;
        SAFETY * most / (most + found.iterations as f64 - 1.0)
            * found.error.max(f64::MIN_POSITIVE).powf(-1.0 / found.power)
    }

    fn accepted(&mut self, h: f64, found: Judged) -> f64 {
        let mut factor = Self::by_error(found);
        if let Some((length, error)) = self.before {
            let trend = h / length * (error / found.error.max(f64::MIN_POSITIVE)).powf(1.0 / found.power);
            factor = factor.min(factor * trend);
        }
        self.before = Some((h, found.error.max(LEAST_REMEMBERED)));
        let largest = if std::mem::take(&mut self.held) { 1.0 } else { LARGEST_IMPLICIT };
        let largest = found.rate.map_or(largest, |rate| largest.min(by_rate(rate).max(1.0)));
        let factor = factor.clamp(SMALLEST_FACTOR, largest);
        // the factors of the matrices are kept
        if (1.0..KEPT_FACTOR).contains(&factor) {
            1.0
        } else {
            factor
        }
    }

    fn rejected(&mut self, found: Judged) -> f64 {
        self.held = true;
        Self::by_error(found).clamp(SMALLEST_FACTOR, 1.0)
    }

    /// Forbid the next accepted step to lengthen the one after it.
    fn hold(&mut self) {
        self.held = true;
    }
}

/// Radau IIA at work on one equation.
#[derive(Debug)]
pub struct Radau {
    options: Options,
    at: Placement,
    /// When the slope at the start was evaluated: before a jump, if a step ended there.
    sloped_at: f64,
    y_old: Vec<f64>,
    y_new: Vec<f64>,
    f_old: Vec<f64>,
    f_new: Vec<f64>,
    phase: Phase,
    solver: StageSolver,
    /// Of half a step.
    half: StageSolver,
    polynomial: Polynomial,
    /// Stages of the step before, and its length, where the motion goes on.
    before: Vec<f64>,
    behind: Option<f64>,
    /// Whether an attempt from here was rejected for its error.
    repeated: bool,
    found: Judged,
    norm: ErrorNorm,
    sizes: Vec<f64>,
    tolerances: Vec<f64>,
    rounding: SlopeRounding,
    by_rounding: bool,
    estimate: Vec<f64>,
    difference: Vec<f64>,
    moved: Vec<f64>,
    controller: Predictive,
    counters: Counters,
}

impl Radau {
    /// Name used in options, results and messages.
    pub const NAME: &'static str = "radau";

    /// Take the memory for an equation of dimension `dim`.
    ///
    /// # Errors
    /// Options that contradict themselves.
    pub fn new(dim: usize, options: Options) -> Result<Self, OptionsError> {
        options.check(dim)?;
        let vector = || vec![0.0; dim];
        Ok(Self {
            at: Placement::new(),
            sloped_at: 0.0,
            y_old: vector(),
            y_new: vector(),
            f_old: vector(),
            f_new: vector(),
            phase: Phase::Ready,
            solver: StageSolver::new(dim),
            half: StageSolver::new(dim),
            polynomial: Polynomial::new(dim),
            before: vec![0.0; S * dim],
            behind: None,
            repeated: false,
            found: Judged::default(),
            norm: ErrorNorm::new(&options, None, dim, dim),
            sizes: vec![1.0; dim],
            tolerances: vector(),
            rounding: SlopeRounding::new(dim),
            by_rounding: false,
            estimate: vector(),
            difference: vector(),
            moved: vector(),
            controller: Predictive::default(),
            counters: Counters::default(),
            options,
        })
    }

    /// The slopes before say nothing about those ahead.
    fn forget(&mut self) {
        (self.behind, self.solver.matrix) = (None, Matrix::Missing);
        self.controller.before = None;
        self.rounding.forget();
    }

    /// Tolerances of states from y_old to `y_new`.
    fn set_tolerances(&mut self, with_end: bool) {
        for (i, to) in self.tolerances.iter_mut().enumerate() {
            *to = self.norm.tolerance(i, &self.y_old);
            if with_end {
                *to = to.max(self.norm.tolerance(i, &self.y_new));
            }
        }
    }

    /// Add what the rounding of slopes may change in a step of length h.
    fn add_rounding(&mut self, h: f64) {
        if !self.rounding.known {
            return;
        }
        for sign in [1.0, -1.0] {
            let signed = |(l, x): (usize, &f64)| if l % 2 == 0 { *x } else { sign * x };
            self.moved.iter_mut().zip(self.rounding.slopes.iter().enumerate().map(signed)).for_each(|(to, x)| *to = x);
            self.solver.filter(h, &mut self.moved);
            for (to, x) in self.tolerances.iter_mut().zip(&self.moved) {
                *to += 0.5 * SlopeRounding::of_estimate(x.abs(), 1.0);
            }
        }
    }

    /// Measure the rounding of the slopes at the start of the step. Where that is impossible it stays unknown.
    fn measure_rounding<E: Display>(&mut self, ode: &mut dyn Ode<Error = E>) {
        let (at, evaluations) = ((&self.y_old[..], &self.f_old[..]), &mut self.counters.evaluations);
        self.rounding.measure(ode, self.at.t_old, at, &self.sizes, &mut self.moved, evaluations);
    }

    /// The matrix at the start of the step, unless one is kept, and its factors for steps of length h; false where it cannot be
    /// factored.
    fn prepare<E: Display>(&mut self, ode: &mut dyn Ode<Error = E>, h: f64) -> Result<bool, StepFailure<E>> {
        let t = self.at.t_old;
        if self.solver.matrix == Matrix::Missing {
            self.linearise_ahead(ode, h);
            if self.solver.matrix == Matrix::Missing {
                let made = self.solver.linearise(ode, (t, h), (&self.y_old, &self.f_old), &self.sizes);
                self.count_linearisation(false);
                made.map_err(|e| Self::at_start(t, e))?;
            }
        }
        let made = self.solver.factor(h);
        self.counters.factored += u64::from(*made.as_ref().unwrap_or(&true));
        Ok(made.is_ok())
    }

    /// The matrix within the step of length h, where the polynomial of the step before tells where that is: the stiffest
    /// directions turn with the motion.
    fn linearise_ahead<E: Display>(&mut self, ode: &mut dyn Ode<Error = E>, h: f64) {
        let Some(behind) = self.behind else { return };
        let (at_end, ahead) = (NODES.weights(1.0), NODES.weights(1.0 + MATRIX_AT * h / behind));
        let (n, t) = (self.y_old.len(), self.at.t_old + MATRIX_AT * h);
        for l in 0..n {
            let moved = (0..S).map(|j| (ahead[j] - at_end[j]) * self.before[j * n + l]).sum::<f64>();
            self.moved[l] = self.y_old[l] + moved;
        }
        self.counters.evaluations += 1;
        if ode.rhs(t, &self.moved, &mut self.difference).is_ok() {
            let _ = self.solver.linearise(ode, (t, h), (&self.moved, &self.difference), &self.sizes);
            self.count_linearisation(false);
        }
    }

    fn at_start<E: Display>(t: f64, error: RhsError<E>) -> StepFailure<E> {
        let (RhsError::Retry(error) | RhsError::Fatal(error)) = error;
        StepFailure::Rhs { t, error }
    }

    /// A linearisation was made: of the step, or of half of it.
    fn count_linearisation(&mut self, half: bool) {
        let linear = if half { &self.half.linear } else { &self.solver.linear };
        let differenced = u64::from(linear.derivatives == Derivatives::Differences);
        match half {
            true => {
                self.counters.dense_jacobians += 1;
                self.counters.dense_evaluations += linear.evaluations;
            }
            false => {
                self.counters.jacobians += 1;
                self.counters.differenced += differenced;
                self.counters.evaluations += linear.evaluations;
            }
        }
    }

    /// First guess of the stages: the polynomial of the step before, or none.
    fn predict(&mut self, h: f64) {
        match self.behind {
            Some(behind) => {
                let parts = NODES.c.map(|c| 1.0 + c * h / behind);
                self.solver.predict(&self.before, parts, 1.0);
            }
            None => self.solver.z.fill(0.0),
        }
    }

    /// Largest component in units of the tolerances.
    fn size(&self, x: &[f64]) -> f64 {
        x.iter().zip(&self.tolerances).fold(0.0, |m: f64, (x, tolerance)| {
            let e = (x / tolerance).abs();
            if e <= m {
                m
            } else {
                e
            }
        })
    }

    /// The error of the step in units of the tolerances, and the power of h with which it falls.
    fn judge<E: Display>(&mut self, ode: &mut dyn Ode<Error = E>, h: f64) -> Result<(f64, f64), (f64, RhsError<E>)> {
        let nodes: &Nodes = &NODES;
        for l in 0..self.y_old.len() {
            self.estimate[l] = self.f_old[l] + self.solver.increment(&ERROR, l) / h;
            self.difference[l] = self.solver.increment(&nodes.second, l) / h;
        }
        let (mut estimate, mut difference) = (std::mem::take(&mut self.estimate), std::mem::take(&mut self.difference));
        self.solver.filter(h, &mut estimate);
        self.solver.filter(h, &mut difference);
        let (mut error, slower) = (self.size(&estimate), self.size(&difference));
        let mut found = Ok(());
        if error > 1.0 && (self.repeated || self.behind.is_none()) {
            // of stiff components the slope at the start says more than it should
            self.moved.iter_mut().zip(self.y_old.iter().zip(&estimate)).for_each(|(to, (y, e))| *to = y + e);
            self.counters.evaluations += 1;
            found = ode.rhs(self.at.t_old, &self.moved, &mut estimate).map_err(|e| (self.at.t_old, e));
            for (l, x) in estimate.iter_mut().enumerate() {
                *x += self.solver.increment(&ERROR, l) / h;
            }
            self.solver.filter(h, &mut estimate);
            let again = self.size(&estimate);
            error = if again.is_finite() && found.is_ok() { again } else { error };
        }
        (self.estimate, self.difference) = (estimate, difference);
        match found {
            Err((t, RhsError::Fatal(error))) => return Err((t, RhsError::Fatal(error))),
            Ok(()) | Err((_, RhsError::Retry(_))) => {}
        }
        let ratio = THIRD_OF_ESTIMATE * error / slower;
        Ok(if ratio < 1.0 { (error * (ratio * ratio).max(LEAST_PART), 6.0) } else { (error, 4.0) })
    }

    /// A component that makes the step unusable.
    fn not_finite(&self, error: f64) -> Option<usize> {
        first_not_finite(&self.y_new)
            .or_else(|| (!error.is_finite()).then(|| first_not_finite(&self.estimate).unwrap_or(0)))
    }

    fn shorten_not_finite<E: Display>(&mut self, h: f64, component: usize) -> Result<(), StepFailure<E>> {
        self.at.shorten_not_finite(h);
        self.controller.hold();
        self.counters.rejected += 1;
        self.counters.not_finite += 1;
        self.at.check_finite(h, component)
    }

    fn shorten_for_retry<E: Display>(&mut self, h: f64, obstacle: &mut Option<E>) -> Result<(), StepFailure<E>> {
        self.at.shorten_for_retry(h, self.counters.retries);
        self.controller.hold();
        self.counters.rejected += 1;
        self.counters.retries += 1;
        self.at.check_length(h, obstacle)
    }

    /// The stages did not converge: what is tried next. With the matrix of the start, tolerances that know their rounding, and
    /// at last a shorter step.
    fn try_otherwise<E: Display>(
        &mut self,
        ode: &mut dyn Ode<Error = E>,
        (h, rate): (f64, f64),
        obstacle: &mut Option<E>,
    ) -> Result<(), StepFailure<E>> {
        if self.solver.matrix == Matrix::Kept {
            self.solver.forget_kept();
            return Ok(());
        }
        if !self.rounding.known {
            self.measure_rounding(ode);
            if self.rounding.known {
                return Ok(());
            }
        }
        self.at.step = by_rate(rate).clamp(SMALLEST_FACTOR, 0.7) * h.abs();
        self.controller.hold();
        self.counters.rejected += 1;
        self.at.check_length(h, obstacle)
    }

    /// Take half the step as well, for the polynomial.
    fn prepare_dense_output<E: Display>(&mut self, ode: &mut dyn Ode<Error = E>) -> Result<(), StepFailure<E>> {
        let (t, h) = (self.at.t_old, 0.5 * self.at.attempted_h);
        let inside = |(t, error)| match error {
            RhsError::Retry(error) => StepFailure::Interpolation { t, error },
            RhsError::Fatal(error) => StepFailure::Rhs { t, error },
        };
        let made = self.half.linearise(ode, (t, h), (&self.y_old, &self.f_old), &self.sizes);
        self.count_linearisation(true);
        made.map_err(|e| inside((t, e)))?;
        self.half.predict(&self.solver.z, NODES.c.map(|c| 0.5 * c), 0.0);
        self.set_tolerances(true);
        let made = self.half.factor(h);
        if made.is_ok() {
            let task = Task { t, y: &self.y_old, h, end: t + h, tolerances: &self.tolerances };
            // where rounding allows no better, what was found last serves
            let _ = self.half.solve(ode, &task, &mut self.counters.dense_evaluations).map_err(inside)?;
        }
        self.polynomial.fill(&self.y_old, &self.y_new, &self.solver, &self.half);
        Ok(())
    }
}

impl<E: Display> Stepper<E> for Radau {
    fn start(&mut self, ode: &mut dyn Ode<Error = E>, t: f64, y: &[f64], t_end: f64) -> Result<(), StepFailure<E>> {
        assert_eq!(ode.dim(), self.y_old.len(), "the stepper was made for another dimension");
        (self.at.t_old, self.at.t_new, self.sloped_at) = (t, t, t);
        self.y_old.copy_from_slice(y);
        self.y_new.copy_from_slice(y);
        (self.phase, self.polynomial.known, self.repeated) = (Phase::Ready, false, false);
        self.controller = Predictive::default();
        (self.at.corner_ahead, self.at.corner_behind) = (false, false);
        self.forget();
        if let Some(component) = first_not_finite(&self.y_old) {
            return Err(StepFailure::NotFinite { t, component });
        }
        self.counters.evaluations += 1;
        ode.rhs(t, &self.y_old, &mut self.f_old).map_err(|e| Self::at_start(t, e))?;
        if let Some(component) = first_not_finite(&self.f_old) {
            return Err(StepFailure::NotFinite { t, component });
        }
        self.at.step = match self.at.head_for(t_end, &self.options) {
            Some(h) => h,
            None => {
                let (start, memory) =
                    ((&self.y_old[..], &self.f_old[..]), (&mut self.moved[..], &mut self.difference[..]));
                let about = (self.options.max_step, ESTIMATE_ORDER);
                first_step(ode, &self.norm, &self.at, about, start, memory, &mut self.counters.evaluations)?
            }
        };
        Ok(())
    }

    fn attempt(&mut self, ode: &mut dyn Ode<Error = E>) -> Result<(), StepFailure<E>> {
        assert_eq!(self.phase, Phase::Ready, "commit or reject the previous step");
        let mut obstacle = None;
        loop {
            let (h, t_new) = self.at.plan();
            if t_new == self.at.t_old {
                return Err(StepFailure::TooSmall { t: t_new, h: self.at.step, last: obstacle });
            }
            if self.sloped_at != self.at.t_old {
                let t = self.at.t_old;
                self.counters.evaluations += 1;
                ode.rhs(t, &self.y_old, &mut self.f_old).map_err(|e| Self::at_start(t, e))?;
                self.sloped_at = t;
            }
            if self.rounding.is_due() {
                self.measure_rounding(ode);
            }
            if !self.prepare(ode, h)? {
                self.shorten_not_finite(h, 0)?;
                continue;
            }
            self.predict(h);
            self.set_tolerances(false);
            self.add_rounding(h);
            let end = self.at.before_jumps(t_new, h);
            let task = Task { t: self.at.t_old, y: &self.y_old, h, end, tolerances: &self.tolerances };
            let iterated = self.solver.solve(ode, &task, &mut self.counters.evaluations);
            let (iterations, rate) = match iterated {
                Ok(Iterated::Found { count, rate }) => (count, rate),
                Ok(Iterated::Slow { rate }) => {
                    self.try_otherwise(ode, (h, rate), &mut obstacle)?;
                    continue;
                }
                Err((_, RhsError::Retry(error))) => {
                    self.solver.forget_kept();
                    obstacle = Some(error);
                    self.shorten_for_retry(h, &mut obstacle)?;
                    continue;
                }
                Err((t, RhsError::Fatal(error))) => return Err(StepFailure::Rhs { t, error }),
            };
            let n = self.y_old.len();
            let last = &self.solver.z[(S - 1) * n..];
            self.y_new.iter_mut().zip(self.y_old.iter().zip(last)).for_each(|(to, (y, z))| *to = y + z);
            self.by_rounding = false;
            let (error, power) = match self.at.grid {
                Some(_) => (0.0, 6.0),
                None => {
                    self.set_tolerances(true);
                    let judged = self.judge(ode, h);
                    let mut judged = judged.map_err(|(t, e)| Self::at_start(t, e))?;
                    if judged.0 > 1.0 && self.rounding.known {
                        self.add_rounding(h);
                        let again = self.judge(ode, h).map_err(|(t, e)| Self::at_start(t, e))?;
                        (self.by_rounding, judged) = (again.0 <= 1.0, if again.0 <= 1.0 { again } else { judged });
                    }
                    judged
                }
            };
            if let Some(component) = self.not_finite(error) {
                self.shorten_not_finite(h, component)?;
                continue;
            }
            self.found = Judged { error, power, iterations, rate };
            if error <= 1.0 {
                (self.at.t_new, self.at.attempted_h) = (t_new, h);
                (self.phase, self.polynomial.known) = (Phase::Attempted, false);
                return Ok(());
            }
            self.counters.rejected += 1;
            self.repeated = true;
            if self.rounding.suspected(self.at.t_old, h, error) {
                self.measure_rounding(ode);
            }
            self.at.step = h.abs() * self.controller.rejected(self.found);
            self.at.check_length(h, &mut obstacle)?;
        }
    }

    fn conclude(&mut self, end: StepEnd<'_, E>) -> Result<Conclusion, StepFailure<E>> {
        assert_eq!(self.phase, Phase::Attempted, "attempt a step first");
        let h = self.at.attempted_h;
        let t = self.at.before_jumps(self.at.t_new, h);
        match end(t, &mut self.y_new, &mut self.f_new, false) {
            Ok(evaluated) => self.counters.evaluations += u64::from(evaluated),
            Err(RhsError::Retry(error)) => {
                self.counters.evaluations += 1;
                self.phase = Phase::Ready;
                self.shorten_for_retry(h, &mut Some(error))?;
                return Ok(Conclusion::Rejected);
            }
            Err(RhsError::Fatal(error)) => return Err(StepFailure::Rhs { t, error }),
        }
        if let Some(component) = first_not_finite(&self.y_new).or_else(|| first_not_finite(&self.f_new)) {
            self.phase = Phase::Ready;
            self.shorten_not_finite(h, component)?;
            return Ok(Conclusion::Rejected);
        }
        self.phase = Phase::Concluded;
        Ok(Conclusion::Done)
    }

    fn interpolate(&mut self, ode: &mut dyn Ode<Error = E>, t: f64, out: &mut [f64]) -> Result<(), StepFailure<E>> {
        assert_eq!(self.phase, Phase::Concluded, "conclude the step first");
        if t == self.at.t_new || t == self.at.t_old {
            out.copy_from_slice(if t == self.at.t_new { &self.y_new } else { &self.y_old });
            return Ok(());
        }
        if !self.polynomial.known {
            self.prepare_dense_output(ode)?;
        }
        self.polynomial.evaluate((t - self.at.t_old) / self.at.attempted_h, &self.y_old, out);
        Ok(())
    }
}
