//! Marching by ticks of one length, for control loops: so many equal steps of a method each, whatever happens.
//!
//! What acts may change between two ticks, and only there. Memory is taken at the start; a tick takes none, but where the
//! formulation changes coordinates.

use crate::explicit_rk::{Conclusion, Stepper};
use crate::failure::StepFailure;
use crate::options::{Options, OptionsError};
use crate::simulate::{sorted, Adapter};
use crate::tableau::Tableau;
use partita_system::formulation::{Formulation, Step, Verdict};
use partita_system::SystemError;

/// Attempts for each step of a tick: a choice of coordinates that has gone bad is renewed and the step taken again.
const ATTEMPTS: u32 = 4;

/// Nearer to a singular position than this, in parts of the reaches, no step may end: rates are quotients of what round-off
/// leaves of the closing by the square of the distance, so that six digits of them are left here and none a little nearer.
const NEAR: f64 = 1e-5;

/// How time goes on.
#[derive(Clone, Copy, Debug)]
pub struct Ticks {
    /// Method.
    pub tableau: &'static Tableau,
    /// Length of a tick.
    pub length: f64,
    /// Steps in each.
    pub steps: u32,
}

/// A formulation's state and the stepper that takes it from tick to tick.
#[derive(Debug)]
pub struct Clock {
    ticks: Ticks,
    stepper: Stepper,
    origin: f64,
    count: u64,
    y: Vec<f64>,
    slope: Vec<f64>,
    turns: Vec<i32>,
}

impl Clock {
    /// For a formulation of dimension `dim` with nq coordinates.
    ///
    /// # Errors
    /// Options out of range.
    pub fn new(ticks: Ticks, dim: usize, nq: usize) -> Result<Self, OptionsError> {
        let fixed_step = Some(ticks.length / f64::from(ticks.steps));
        let stepper = Stepper::new(ticks.tableau, dim, Options { fixed_step, ..Options::default() })?;
        let (y, slope) = (vec![0.0; dim], vec![0.0; dim]);
        Ok(Self { ticks, stepper, origin: 0.0, count: 0, y, slope, turns: vec![0; nq] })
    }

    /// Begin, or begin again after `count` ticks since `origin`, at the state of `formulation` there.
    ///
    /// # Errors
    /// Where the formulation cannot start.
    pub fn start<F: Formulation>(
        &mut self,
        formulation: &mut F,
        (origin, count): (f64, u64),
        (q, v): (&[f64], &[f64]),
        turns: &[i32],
    ) -> Result<(), SystemError> {
        (self.origin, self.count) = (origin, count);
        self.turns.copy_from_slice(turns);
        formulation.start(self.time(), q, v, &mut self.y)
    }

    /// The time of the last tick: a multiple formed anew, so that errors do not add.
    pub fn time(&self) -> f64 {
        self.origin + self.count as f64 * self.ticks.length
    }

    /// Ticks so far.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Where the first tick began.
    pub fn origin(&self) -> f64 {
        self.origin
    }

    /// State of the formulation.
    pub fn state(&self) -> &[f64] {
        &self.y
    }

    /// Whole turns taken off each coordinate.
    pub fn turns(&self) -> &[i32] {
        &self.turns
    }

    /// One tick.
    ///
    /// # Errors
    /// What could not be evaluated; then the clock has to be started again where it stood.
    pub fn tick<F: Formulation>(&mut self, formulation: &mut F) -> Result<(), StepFailure<SystemError>> {
        let (t, end) = (self.time(), self.origin + (self.count + 1) as f64 * self.ticks.length);
        self.stepper.start(&mut Adapter(formulation), t, &self.y, end)?;
        let mut left = ATTEMPTS * self.ticks.steps;
        while !self.stepper.finished() {
            if left == 0 {
                return Err(StepFailure::TooSmall { t: self.stepper.t_old(), h: self.stepper.step_size(), last: None });
            }
            left -= 1;
            self.step(formulation)?;
        }
        self.y.copy_from_slice(self.stepper.y_old());
        self.count += 1;
        Ok(())
    }

    fn step<F: Formulation>(&mut self, formulation: &mut F) -> Result<(), StepFailure<SystemError>> {
        self.stepper.attempt(&mut Adapter(formulation))?;
        let mut verdict = Verdict::Keep;
        let concluded = self.stepper.conclude_with(|t, y, dy, known| {
            let (judged, evaluated) = formulation.trial_end(t, y, dy, known).map_err(sorted)?;
            verdict = judged;
            Ok(evaluated)
        })?;
        if concluded == Conclusion::Rejected {
            return Ok(());
        }
        if verdict != Verdict::Repeat && formulation.margin().is_some_and(|m| m.abs() < NEAR) {
            let t = self.stepper.t_old() + self.stepper.step_size();
            let message =
                "it would end next to a singular position, such as one in which links are in line and the motion can \
                           branch, from where rates cannot be told; step over it: another number of substeps, another \
                           length of steps";
            return Err(StepFailure::Rhs { t, error: SystemError::Tick { t, message: message.into() } });
        }
        match verdict {
            Verdict::Repeat => self.stepper.reject(0.5),
            _ => self.stepper.commit(),
        }
        let t = self.stepper.t_old();
        self.y.copy_from_slice(self.stepper.y_old());
        self.slope.copy_from_slice(self.stepper.dy_old());
        let mut step = Step { t, y: &mut self.y, dy: &mut self.slope, turns: &mut self.turns, pace: None };
        let rewritten = formulation.commit(verdict, &mut step);
        let now = step.t;
        if rewritten.map_err(|error| StepFailure::Rhs { t, error })? {
            self.stepper.replace_start(now, &self.y, &self.slope);
        }
        Ok(())
    }
}
