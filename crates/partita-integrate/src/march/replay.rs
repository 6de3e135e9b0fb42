//! Steps of a march put into its log, and read from it: a step that is loaded again is interpolated, closed and, next to a
//! singular position, read from both sides as an output is.

use super::{Control, March};
use crate::failure::StepFailure;
use crate::method::Method;
use crate::options::{Options, OptionsError};
use crate::scheme::{Scheme, Taken};
use crate::step_log::StepLog;
use crate::stepper::Stepper;
use partita_system::formulation::{Course, Formulation};
use partita_system::positions::turns;
use partita_system::record::Output;
use partita_system::reduction::snapshot::ReductionSnapshot;
use partita_system::SystemError;
use std::collections::HashMap;
use std::mem::size_of;

/// Slopes that were evaluated to read steps are forgotten where they take more. Scale: fraction of the memory of the steps.
/// Reason: of a log that is read all over they are a third.
const EXTRA: f64 = 0.5;

impl March {
    /// Keep the steps from here on.
    pub(crate) fn log_into(&mut self, log: StepLog) {
        self.log = log;
    }

    /// The steps kept.
    pub(crate) fn take_log(&mut self) -> StepLog {
        std::mem::take(&mut self.log)
    }

    /// Keep the step that is about to be committed.
    pub(super) fn log_step(&mut self, formulation: &mut dyn Formulation) {
        let stepper: &dyn Stepper<SystemError> = match self.course {
            Course::Across => &self.crossing,
            Course::Along => &*self.stepper,
        };
        let now = stepper.current();
        let beside = (&self.output.turns[..], &self.located.times[..]);
        self.log
            .push(formulation.point(), (now.t_old, now.t_new), self.course, beside, |numbers| stepper.save(numbers));
    }
}

/// What reads the steps of a log: a formulation and a stepper like those that took them.
pub struct StepReader<'s> {
    formulation: Box<dyn Formulation + Send + 's>,
    march: March,
    buffer: Vec<f64>,
    /// The step loaded, and the number of its choice.
    loaded: Option<usize>,
    version: Option<u64>,
    /// Slopes evaluated for steps that were read, and how many numbers these are.
    extra: HashMap<usize, Vec<f64>>,
    extra_count: usize,
}

/// A step of a log, for derivatives.
pub struct StepTaken {
    /// When it begins and ends.
    pub span: (f64, f64),
    /// The closed state at its start, with whole turns in its coordinates.
    pub start: (Vec<f64>, Vec<f64>),
    /// How it was taken, whole turns in the coordinates of its states.
    pub taken: Taken,
    /// Components of each of these.
    pub dim: usize,
    /// Whether it crosses a singular position.
    pub across: bool,
    /// The choice in use.
    pub choice: ReductionSnapshot,
}

impl<'s> StepReader<'s> {
    /// For a formulation that was not started, with nq coordinates.
    ///
    /// # Errors
    /// Options out of range.
    pub fn new(
        mut formulation: Box<dyn Formulation + Send + 's>,
        nq: usize,
        method: &'static dyn Method,
        options: Options,
    ) -> Result<Self, OptionsError> {
        let march = March::new(&mut *formulation, nq, method, options, Control::Free { max_steps: 0 })?;
        let buffer = vec![0.0; formulation.layout().dim()];
        let extra = HashMap::new();
        Ok(Self { formulation, march, buffer, loaded: None, version: None, extra, extra_count: 0 })
    }

    /// Read the state at t of the run with this log, the same for all calls; where no step is kept there, that at the last
    /// earlier time at which one is. `None` where there is none: the start of the log is later.
    ///
    /// # Errors
    /// Where something cannot be evaluated.
    pub fn read(&mut self, log: &StepLog, t: f64) -> Result<Option<&Output>, SystemError> {
        let mut step = log.find(t);
        if let Ok(i) = step {
            match self.read_step(log, i, t) {
                Ok(()) => return Ok(Some(&self.march.output)),
                // the run would have taken a shorter step there
                Err(StepFailure::Interpolation { .. }) => step = Err(i.checked_sub(1)),
                Err(failure) => return Err(cause(failure, t)),
            }
        }
        let Err(Some(before)) = step else { return Ok(None) };
        let end = log.step(before).t_new;
        self.read_step(log, before, end).map_err(|failure| cause(failure, end))?;
        Ok(Some(&self.march.output))
    }

    /// Step i of a log; the last one ends where the run does.
    ///
    /// # Errors
    /// Where something cannot be evaluated.
    pub fn step(&mut self, log: &StepLog, i: usize) -> Result<StepTaken, SystemError> {
        let step = log.step(i);
        self.read_step(log, i, step.t_old).map_err(|failure| cause(failure, step.t_old))?;
        let turns = log.turns(i);
        let whole = |q: &[f64]| q.iter().zip(turns).map(|(q, n)| turns::whole(*q, *n)).collect::<Vec<f64>>();
        let start = (whole(&self.march.output.q), self.march.output.v.clone());
        let dim = self.buffer.len();
        let mut taken = self.march.active().taken().unwrap_or(Taken { scheme: Scheme::accurate(), states: Vec::new() });
        for state in taken.states.chunks_exact_mut(dim.max(1)) {
            let q = whole(&state[..turns.len().min(dim)]);
            state[..q.len()].copy_from_slice(&q);
        }
        let end = log.span().map_or(step.t_new, |span| step.t_new.min(span.1));
        let across = step.course == Course::Across;
        Ok(StepTaken { span: (step.t_old, end), start, taken, dim, across, choice: log.choice(i).reduction.clone() })
    }

    fn read_step(&mut self, log: &StepLog, i: usize, t: f64) -> Result<(), StepFailure<SystemError>> {
        let version = self.formulation.point().choice_version();
        if self.loaded != Some(i) || self.version != version {
            self.load(log, i);
        }
        self.march.output_at(&mut *self.formulation, t, &mut self.buffer)?;
        if !self.extra.contains_key(&i) {
            self.keep_extra(log, i);
        }
        Ok(())
    }

    /// Make step i the concluded one of the march.
    fn load(&mut self, log: &StepLog, i: usize) {
        let (step, march) = (log.step(i), &mut self.march);
        let (numbers, located) = log.numbers(i);
        let extra = self.extra.get(&i);
        march.course = step.course;
        march.located.forget();
        march.located.times.extend_from_slice(located);
        march.output.turns.copy_from_slice(log.turns(i));
        march.active().load((step.t_old, step.t_new), numbers, extra.map_or(&[], |extra| extra));
        // evaluations may have planned anew since
        let same = self.version.is_some() && self.version == self.formulation.point().choice_version();
        let same = same && self.loaded.is_some_and(|now| log.step(now).choice == step.choice);
        self.formulation.point().replay((!same).then_some(log.choice(i)), step.margins);
        self.version = self.formulation.point().choice_version();
        self.loaded = Some(i);
    }

    /// Keep the slopes that were evaluated to read the step loaded.
    fn keep_extra(&mut self, log: &StepLog, i: usize) {
        let mut slopes = Vec::new();
        self.march.active().save_extra(&mut slopes);
        // none are evaluated at the ends of a step
        if slopes.is_empty() {
            return;
        }
        let bytes = size_of::<f64>() * (self.extra_count + slopes.len());
        if bytes as f64 > EXTRA * log.bytes() as f64 {
            self.extra.clear();
            self.extra_count = 0;
        }
        self.extra_count += slopes.len();
        self.extra.insert(i, slopes);
    }
}

/// What failed at t.
fn cause(failure: StepFailure<SystemError>, t: f64) -> SystemError {
    match failure {
        StepFailure::Rhs { error, .. } | StepFailure::Interpolation { error, .. } => error,
        StepFailure::TooSmall { last: Some(error), .. } => error,
        StepFailure::TooSmall { .. } | StepFailure::NotFinite { .. } => {
            SystemError::NotFinite { what: "the state".into(), t }
        }
    }
}
