//! The steps of a run, as derivatives follow them: where each began, by which coefficients and for which coordinates it was
//! taken.

use super::jump::Jump;
use crate::error::AnalysisError;
use crate::run::SolutionLog;
use partita_integrate::march::StepReader;
use partita_integrate::scheme::Taken;
use partita_model::Model;
use partita_system::choice::OwnedChoice;
use partita_system::positions::turns;
use partita_system::record::Output;
use partita_system::reduction::Reduction;
use partita_system::SystemError;
use std::sync::Arc;

/// A closed state, with whole turns in its coordinates.
#[derive(Clone, Debug, Default)]
pub struct Instant {
    /// Time.
    pub t: f64,
    /// Coordinates.
    pub q: Vec<f64>,
    /// Velocities.
    pub v: Vec<f64>,
}

impl Instant {
    /// Of an output.
    pub fn of(x: &Output) -> Self {
        let q = x.q.iter().zip(&x.turns).map(|(q, n)| turns::whole(*q, *n)).collect();
        Self { t: x.t, q, v: x.v.clone() }
    }
}

/// A step.
pub struct Stride {
    /// Where it began.
    pub from: Instant,
    /// When it ended.
    pub t_end: f64,
    /// How it was taken.
    pub taken: Taken,
    /// Components of the states of its stages.
    pub dim: usize,
    /// Whether it crosses a singular position.
    pub across: bool,
    /// Rows, coordinates, and the order of the elimination.
    pub choice: Arc<OwnedChoice>,
    /// Outputs inside it and at its end, each with its number among the times that were asked.
    pub outputs: Vec<(usize, Instant)>,
}

/// The steps of one mechanism, one after the other.
pub struct Leg {
    /// It.
    pub model: Arc<Model>,
    /// Steps.
    pub strides: Vec<Stride>,
    /// Where they end.
    pub end: Instant,
    /// Outputs where they begin.
    pub first: Vec<(usize, Instant)>,
    /// What happens at their end.
    pub jump: Option<Jump>,
}

/// A time at which something is observed.
#[derive(Clone, Copy, Debug)]
pub struct Time {
    /// It.
    pub t: f64,
    /// Whether what happens there has not happened yet.
    pub before: bool,
}

/// What a run lacks.
fn lacking(message: &str) -> AnalysisError {
    SystemError::argument("run", message.to_owned()).into()
}

impl Leg {
    /// Of a run of a mechanism from `start` on, with outputs at these times within it, each with its number.
    ///
    /// # Errors
    /// A run that does not keep all its steps.
    pub fn new(
        model: &Arc<Model>,
        log: &SolutionLog,
        reader: Option<&mut StepReader>,
        start: Instant,
        times: &[Time],
    ) -> Result<Self, AnalysisError> {
        let (steps, reader) = match (log.steps.as_ref().map(|x| &x.0).filter(|steps| steps.count() > 0), reader) {
            (Some(steps), Some(reader)) => (steps, reader),
            // something happens at once
            (Some(_), None) | (None, _) if log.outputs.iter().all(|x| x.t <= start.t) => {
                return Ok(Self { model: model.clone(), strides: Vec::new(), end: start, first: Vec::new(), jump: None });
            }
            _ => {
                return Err(lacking(
                    "this run keeps no steps that derivatives could follow; run it by simulate with the default \
                     formulation",
                ));
            }
        };
        if steps.every() != 1 {
            return Err(lacking(
                "the run keeps only some of its steps, as all of them take more memory than the limit \"step_bytes\"; raise \
                 it (partita.limits) and run again",
            ));
        }
        let mut strides: Vec<Stride> = Vec::with_capacity(steps.count());
        let mut reduction = Reduction::dense(&**model, log.recipe.rank);
        let mut choice: Option<(u64, Arc<OwnedChoice>)> = None;
        for i in 0..steps.count() {
            let step = reader.step(steps, i)?;
            if step.span.1 <= step.span.0 {
                continue;
            }
            reduction.restore(&step.choice);
            let version = reduction.version();
            let now = match choice.take().filter(|known| known.0 == version) {
                Some((_, known)) => known,
                None => Arc::new(reduction.choice().owned()),
            };
            choice = Some((version, now.clone()));
            let from = Instant { t: step.span.0, q: step.start.0, v: step.start.1 };
            let (taken, dim, across) = (step.taken, step.dim, step.across);
            strides.push(Stride { from, t_end: step.span.1, taken, dim, across, choice: now, outputs: Vec::new() });
        }
        let begin = strides.first().map_or(start.t, |x| x.from.t);
        if begin > start.t {
            return Err(lacking(&format!(
                "it begins at a singular position, of which its motion has no derivative: the first step from t = {} s is \
                 not one of its method; start beside it",
                start.t
            )));
        }
        let mut read = |t: f64| -> Result<Instant, AnalysisError> {
            Ok(reader.read(steps, t)?.map(Instant::of).unwrap_or_default())
        };
        let mut first = Vec::new();
        for (number, time) in times.iter().enumerate() {
            match strides.iter_mut().find(|x| x.from.t < time.t && time.t <= x.t_end) {
                Some(stride) => stride.outputs.push((number, read(time.t)?)),
                None if time.t == begin && !time.before => first.push((number, start.clone())),
                None => {}
            }
        }
        let end = read(strides.last().map_or(begin, |x| x.t_end))?;
        Ok(Self { model: model.clone(), strides, end, first, jump: None })
    }

    /// When it begins.
    pub fn begin(&self) -> f64 {
        self.strides.first().map_or(self.end.t, |x| x.from.t)
    }
}
