//! One engine for every explicit Runge–Kutta table, behind the contract of a [`Stepper`].
//!
//! All memory is allocated in [`ExplicitRungeKutta::new`]; nothing is allocated afterwards.

mod access;
mod memory;
pub(crate) mod method;
mod obstacles;

use self::memory::Memory;
use self::method::{prepared, Method};
use crate::combination::{first_not_finite, padded};
use crate::counters::Counters;
use crate::dense_output::{DenseOutput, Known};
use crate::failure::StepFailure;
use crate::ode::{Ode, RhsError};
use crate::options::{Options, OptionsError};
use crate::placement::Placement;
use crate::rounding::SlopeRounding;
use crate::step_size::{controller, first_step, ErrorNorm, StepController};
use crate::stepper::{Conclusion, StepEnd, Stepper};
use crate::tableau::{ErrorWeights, Tableau};
use std::borrow::Cow;
use std::fmt::Display;

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

/// An explicit Runge–Kutta method at work on one equation.
#[derive(Debug)]
pub struct ExplicitRungeKutta {
    tableau: &'static Tableau,
    dim: usize,
    stride: usize,
    options: Options,
    method: Cow<'static, Method>,
    /// Slopes of earlier steps, where the method uses them.
    memory: Option<Memory>,
    // the state: all vectors padded with zeros to `stride`
    at: Placement,
    /// When the slope at the start was evaluated: before a jump, if a step ended there.
    sloped_at: f64,
    y_old: Vec<f64>,
    y_new: Vec<f64>,
    y_stage: Vec<f64>,
    /// Slopes, slot by slot; slot 0 is the slope at `y_old`, the tableau's end slot that at `y_new`.
    stages: Vec<f64>,
    phase: Phase,
    error: f64,
    norm: ErrorNorm,
    rounding: SlopeRounding,
    /// Whether the error of the step is within the tolerance by the rounding of its estimate alone.
    by_rounding: bool,
    controller: StepController,
    dense: DenseOutput,
    counters: Counters,
}

impl ExplicitRungeKutta {
    /// Take all memory for an equation of dimension `dim`.
    ///
    /// # Errors
    /// Options that contradict themselves or the method, such as error control for a method without an estimate.
    pub fn new(tableau: &'static Tableau, dim: usize, options: Options) -> Result<Self, OptionsError> {
        Self::made(tableau, false, dim, options)
    }

    /// As `new`, for the method of Adams, Bashforth and Moulton that starts with a table of two stages.
    ///
    /// # Errors
    /// See [`new`](Self::new).
    pub fn remembering(tableau: &'static Tableau, dim: usize, options: Options) -> Result<Self, OptionsError> {
        Self::made(tableau, true, dim, options)
    }

    fn made(tableau: &'static Tableau, remembers: bool, dim: usize, options: Options) -> Result<Self, OptionsError> {
        options.check(dim)?;
        if options.fixed_step.is_none() && matches!(tableau.error, ErrorWeights::None) {
            return Err(OptionsError::NeedsFixedStep { method: tableau.name });
        }
        let stride = padded(dim);
        let vector = || vec![0.0; stride];
        let (method, dense) = match remembers {
            true => {
                let dense = DenseOutput::remade(memory::MOST - 2, memory::SLOTS, &memory::DENSE_SLOTS, stride);
                (Cow::Owned(Method::remade(memory::SLOTS)), dense)
            }
            false => {
                let (method, dense) = prepared(tableau);
                (method, DenseOutput::new(dense, stride))
            }
        };
        Ok(Self {
            method,
            memory: remembers.then(Memory::new),
            at: Placement::new(),
            sloped_at: 0.0,
            y_old: vector(),
            y_new: vector(),
            y_stage: vector(),
            stages: vec![0.0; if remembers { memory::SLOTS } else { tableau.slots() } * stride],
            phase: Phase::Ready,
            error: 0.0,
            // a method that raises its order until the motion is exact leaves the error to what varies faster
            norm: ErrorNorm::new(&options, options.observed.filter(|_| remembers), dim, stride),
            rounding: SlopeRounding::new(stride),
            by_rounding: false,
            controller: controller(tableau),
            dense,
            counters: Counters::default(),
            tableau,
            dim,
            stride,
            options,
        })
    }

    fn first_step<E: Display>(&mut self, ode: &mut dyn Ode<Error = E>) -> Result<f64, StepFailure<E>> {
        let (n, dim, order) = (self.stride, self.dim, self.tableau.error_order);
        let (f0, rest) = self.stages.split_at_mut(n);
        let memory = (&mut self.y_stage[..dim], &mut rest[..dim]);
        let start = (&self.y_old[..dim], &f0[..dim]);
        let about = (self.options.max_step, order);
        first_step(ode, &self.norm, &self.at, about, start, memory, &mut self.counters.evaluations)
    }

    /// All stages of a step and its end. An error comes with its time.
    fn stages<E: Display>(
        &mut self,
        ode: &mut dyn Ode<Error = E>,
        h: f64,
        t_new: f64,
    ) -> Result<(), (f64, RhsError<E>)> {
        let (n, dim, c) = (self.stride, self.dim, self.tableau.c);
        let t_new = self.at.before_jumps(t_new, h);
        if let Some(memory) = &mut self.memory {
            memory.prepare(self.at.t_old, h, self.method.to_mut());
        }
        let inner = if self.tableau.fsal { self.tableau.stages - 1 } else { self.tableau.stages };
        for i in 1..inner {
            self.method.stages[i].advance(&self.stages, h, &self.y_old, &mut self.y_stage);
            let t = if c[i] == 1.0 { t_new } else { self.at.t_old + c[i] * h };
            self.counters.evaluations += 1;
            ode.rhs(t, &self.y_stage[..dim], &mut self.stages[i * n..i * n + dim]).map_err(|e| (t, e))?;
        }
        self.method.end.advance(&self.stages, h, &self.y_old, &mut self.y_new);
        if self.tableau.fsal {
            self.counters.evaluations += 1;
            ode.rhs(t_new, &self.y_new[..dim], &mut self.stages[inner * n..inner * n + dim]).map_err(|e| (t_new, e))?;
        }
        Ok(())
    }

    /// Measure the rounding of the slopes at the start of the step. Where that is impossible it stays unknown.
    fn measure_rounding<E: Display>(&mut self, ode: &mut dyn Ode<Error = E>) {
        let (dim, evaluations) = (self.dim, &mut self.counters.evaluations);
        let at = (&self.y_old[..dim], &self.stages[..dim]);
        self.rounding.measure(ode, self.at.t_old, at, self.norm.sizes(), &mut self.y_stage[..dim], evaluations);
    }

    /// Error of the step at hand in units of the tolerance, and whether it is at most one because of the rounding of its
    /// estimate.
    fn judged(&mut self, h: f64, at_a_corner: bool) -> (f64, bool) {
        let between = (&self.y_old[..], &self.y_new[..]);
        let plain = self.method.error(&self.norm, h, &self.stages, between, at_a_corner);
        if plain <= 1.0 || !self.rounding.known {
            return (plain, false);
        }
        self.norm.set_floor(Some(&self.rounding.slopes), h);
        let error = self.method.error(&self.norm, h, &self.stages, between, at_a_corner);
        if error <= 1.0 {
            return (error, true); // what decides on the next step sees it as well
        }
        self.norm.set_floor(None, h);
        (error, false)
    }

    fn prepare_dense_output<E: Display>(&mut self, ode: &mut dyn Ode<Error = E>) -> Result<(), StepFailure<E>> {
        let (h, dim) = (self.at.attempted_h, self.dim);
        let missing = if self.dense.known == Known::Stages { self.dense.extra() } else { &[] };
        for stage in missing {
            stage.row.advance(&self.stages, h, &self.y_old, &mut self.y_stage);
            let (t, begin) = (self.at.t_old + stage.node * h, stage.slot * self.stride);
            self.counters.dense_evaluations += 1;
            match ode.rhs(t, &self.y_stage[..dim], &mut self.stages[begin..begin + dim]) {
                Ok(()) => {}
                Err(RhsError::Retry(error)) => return Err(StepFailure::Interpolation { t, error }),
                Err(RhsError::Fatal(error)) => return Err(StepFailure::Rhs { t, error }),
            }
        }
        if let Some(memory) = &self.memory {
            memory.fill_dense(&mut self.dense);
        }
        self.dense.fill(&self.stages, self.tableau.end_slot(), h, &self.y_old, &self.y_new);
        Ok(())
    }

    /// Forget the slopes of earlier steps.
    fn forget(&mut self) {
        if let Some(memory) = &mut self.memory {
            memory.forget();
            self.controller.set_order(memory.order());
        }
    }

    fn slot(&self, slot: usize) -> &[f64] {
        &self.stages[slot * self.stride..slot * self.stride + self.dim]
    }
}

impl<E: Display> Stepper<E> for ExplicitRungeKutta {
    fn start(&mut self, ode: &mut dyn Ode<Error = E>, t: f64, y: &[f64], t_end: f64) -> Result<(), StepFailure<E>> {
        assert_eq!(ode.dim(), self.dim, "the stepper was made for another dimension");
        (self.at.t_old, self.at.t_new, self.sloped_at) = (t, t, t);
        self.y_old[..self.dim].copy_from_slice(y);
        self.y_new[..self.dim].copy_from_slice(y);
        self.phase = Phase::Ready;
        self.dense.known = Known::Stages;
        self.controller.reset();
        (self.at.corner_ahead, self.at.corner_behind) = (false, false);
        self.forget();
        self.rounding.forget();
        if let Some(component) = first_not_finite(&self.y_old) {
            return Err(StepFailure::NotFinite { t, component });
        }
        self.counters.evaluations += 1;
        match ode.rhs(t, &self.y_old[..self.dim], &mut self.stages[..self.dim]) {
            Ok(()) => {}
            Err(RhsError::Retry(error) | RhsError::Fatal(error)) => return Err(StepFailure::Rhs { t, error }),
        }
        if let Some(component) = first_not_finite(&self.stages[..self.dim]) {
            return Err(StepFailure::NotFinite { t, component });
        }
        self.at.step = match self.at.head_for(t_end, &self.options) {
            Some(h) => h,
            None => self.first_step(ode)?,
        };
        Ok(())
    }

    fn attempt(&mut self, ode: &mut dyn Ode<Error = E>) -> Result<(), StepFailure<E>> {
        assert_eq!(self.phase, Phase::Ready, "commit or reject the previous step");
        // the obstacle ahead, also where shorter steps end before it with too large an error
        let mut obstacle = None;
        loop {
            let (h, t_new) = self.at.plan();
            if t_new == self.at.t_old {
                let h = self.at.step;
                return Err(StepFailure::TooSmall { t: t_new, h, last: obstacle });
            }
            if self.sloped_at != self.at.t_old {
                let (t, dim) = (self.at.t_old, self.dim);
                self.counters.evaluations += 1;
                match ode.rhs(t, &self.y_old[..dim], &mut self.stages[..dim]) {
                    Ok(()) => self.sloped_at = t,
                    Err(RhsError::Retry(error) | RhsError::Fatal(error)) => return Err(StepFailure::Rhs { t, error }),
                }
            }
            if self.at.grid.is_none() && self.rounding.is_due() {
                self.measure_rounding(ode);
            }
            match self.stages(ode, h, t_new) {
                Ok(()) => {}
                Err((_, RhsError::Retry(error))) => {
                    self.shorten_for_retry(h);
                    obstacle = Some(error);
                    self.at.check_length(h, &mut obstacle)?;
                    continue;
                }
                Err((t, RhsError::Fatal(error))) => return Err(StepFailure::Rhs { t, error }),
            }
            let (error, by_rounding) = match self.at.grid {
                Some(_) => (0.0, false),
                None => {
                    let at_a_corner = self.at.has_corner(t_new);
                    self.judged(h, at_a_corner)
                }
            };
            if let Some(component) = self.not_finite(error) {
                self.shorten_not_finite(h);
                self.at.check_finite(h, component)?;
                continue;
            }
            if error <= 1.0 {
                self.at.t_new = t_new;
                self.at.attempted_h = h;
                (self.error, self.by_rounding) = (error, by_rounding);
                self.dense.known = Known::Stages;
                self.phase = Phase::Attempted;
                return Ok(());
            }
            self.counters.rejected += 1;
            if self.rounding.suspected(self.at.t_old, h, error) {
                // the next attempt is judged by what is measured
                self.measure_rounding(ode);
            }
            self.at.step = h.abs() * self.controller.rejected(error);
            if let Some(memory) = &mut self.memory {
                memory.failed();
                self.controller.set_order(memory.order());
            }
            self.at.check_length(h, &mut obstacle)?;
        }
    }

    fn conclude(&mut self, end: StepEnd<'_, E>) -> Result<Conclusion, StepFailure<E>> {
        assert_eq!(self.phase, Phase::Attempted, "attempt a step first");
        let (h, dim) = (self.at.attempted_h, self.dim);
        let t = self.at.before_jumps(self.at.t_new, h);
        let begin = self.tableau.end_slot() * self.stride;
        let slope = &mut self.stages[begin..begin + dim];
        match end(t, &mut self.y_new[..dim], slope, self.tableau.fsal) {
            Ok(evaluated) => self.counters.evaluations += u64::from(evaluated),
            Err(RhsError::Retry(error)) => {
                self.counters.evaluations += 1;
                self.phase = Phase::Ready;
                self.shorten_for_retry(h);
                self.at.check_length(h, &mut Some(error))?;
                return Ok(Conclusion::Rejected);
            }
            Err(RhsError::Fatal(error)) => return Err(StepFailure::Rhs { t, error }),
        }
        let spoilt = first_not_finite(&self.y_new).or_else(|| first_not_finite(self.slot(self.tableau.end_slot())));
        if let Some(component) = spoilt {
            self.phase = Phase::Ready;
            self.shorten_not_finite(h);
            self.at.check_finite(h, component)?;
            return Ok(Conclusion::Rejected);
        }
        self.phase = Phase::Concluded;
        Ok(Conclusion::Done)
    }

    fn interpolate(&mut self, ode: &mut dyn Ode<Error = E>, t: f64, out: &mut [f64]) -> Result<(), StepFailure<E>> {
        assert_eq!(self.phase, Phase::Concluded, "conclude the step first");
        if t == self.at.t_new {
            out.copy_from_slice(&self.y_new[..self.dim]);
            return Ok(());
        }
        if self.dense.known != Known::Coefficients {
            self.prepare_dense_output(ode)?;
        }
        let out = &mut out[..self.dim];
        self.dense.evaluate((t - self.at.t_old) / self.at.attempted_h, &self.y_old, out);
        Ok(())
    }
}
