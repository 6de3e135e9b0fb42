//! The mechanism between communication points: inputs in, a step, outputs.

use crate::inputs::{Course, Inputs};
use crate::resource::{Input, Resource, Shown, VERSION};
use partita_analysis::error::AnalysisError;
use partita_analysis::outputs::{self, Forces, States};
use partita_analysis::run::{self, Request, Run};
use partita_integrate::simulate::Status;
use partita_math::tolerance;
use partita_model::zero_position::Coordinates;
use partita_model::Model;
use partita_system::positions::turns;
use partita_system::prelude::*;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

/// The mutable part of the state; a copy of it can be restored.
#[derive(Clone)]
pub struct State {
    /// Time.
    pub t: f64,
    q: Vec<f64>,
    v: Vec<f64>,
    /// Values of the inputs.
    inputs: Vec<f64>,
    /// Their courses over the last step.
    courses: Vec<Course>,
    /// Values; `None` where they must be computed again.
    outputs: Option<Vec<f64>>,
}

/// A mechanism that steps.
pub struct Slave {
    model: Model,
    options: Request,
    kinds: Vec<Input>,
    shown: Vec<(Shown, usize)>,
    cell: Inputs,
    first: State,
    state: State,
}

/// How a step ended.
pub struct Stepped {
    /// Findings that make it suspect, in sentences.
    pub doubts: Vec<String>,
}

fn words(e: impl std::fmt::Display) -> String {
    e.to_string()
}

impl Slave {
    /// The mechanism in the folder of resources; `guid` is that of the environment.
    pub fn open(folder: &Path, guid: &str) -> Result<Self, String> {
        let path = folder.join("model.json");
        let text = std::fs::read_to_string(&path).map_err(|e| format!("cannot read {}: {e}", path.display()))?;
        let resource: Resource =
            serde_json::from_str(&text).map_err(|e| format!("{} cannot be read: {e}", path.display()))?;
        if resource.guid != guid {
            return Err(format!(
                "the environment expects the model {guid}, but the resources contain {}",
                resource.guid
            ));
        }
        Self::new(resource)
    }

    /// The mechanism of a resource.
    pub fn new(resource: Resource) -> Result<Self, String> {
        if resource.fmu != VERSION {
            return Err(format!(
                "the resources have version {}, but this binary reads version {VERSION}",
                resource.fmu
            ));
        }
        let start = resource.start;
        let courses = resource.inputs.iter().map(|input| match *input {
            Input::Effort { start } => Course::Effort(start),
            Input::Rate { start: rate, position: x } => Course::Motion { t: start.t, x, rate, growth: 0.0 },
        });
        let courses: Vec<Course> = courses.collect();
        let inputs = resource.inputs.iter().map(|input| match *input {
            Input::Effort { start } | Input::Rate { start, .. } => start,
        });
        let inputs: Vec<f64> = inputs.collect();
        let cell = Inputs::default();
        cell.set(&courses);
        let model = Model::new(resource.model, Arc::new(cell.clone()), Coordinates::Relative).map_err(words)?;
        let size = model.size();
        if (start.q.len(), start.v.len()) != (size.nq, size.nv) {
            return Err(format!("the start has {} coordinates and {} velocities", start.q.len(), start.v.len()));
        }
        let shown = resource.outputs.into_iter().map(|x| Ok((x.clone(), joint_of(&model, &x)?)));
        let shown = shown.collect::<Result<Vec<_>, String>>()?;
        let first = State { t: start.t, q: start.q, v: start.v, inputs, courses, outputs: None };
        Ok(Self { model, options: resource.options, kinds: resource.inputs, shown, cell, state: first.clone(), first })
    }

    /// Current state.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Restore a state.
    pub fn restore(&mut self, state: State) {
        self.cell.set(&state.courses);
        self.state = state;
    }

    /// Return to the initial state.
    pub fn reset(&mut self) {
        self.restore(self.first.clone());
    }

    /// Start at time t; `rtol` replaces the relative tolerance.
    pub fn begin(&mut self, t: f64, rtol: Option<f64>) -> Result<(), String> {
        if !t.is_finite() {
            return Err(format!("the start time is {t}"));
        }
        if let Some(rtol) = rtol {
            if !(rtol > 0.0 && rtol < 1.0) {
                return Err(format!("the tolerance is {rtol}; give one between 0 and 1"));
            }
            self.options.rtol = rtol;
        }
        let mut state = self.state.clone();
        state.t = t;
        for course in &mut state.courses {
            if let Course::Motion { t: since, .. } = course {
                *since = t;
            }
        }
        state.outputs = None;
        self.restore(state);
        Ok(())
    }

    /// Number of inputs and outputs.
    pub fn size(&self) -> (usize, usize) {
        (self.kinds.len(), self.shown.len())
    }

    /// Set an input.
    pub fn set(&mut self, reference: usize, value: f64) -> Result<(), String> {
        if !value.is_finite() {
            return Err(format!("input {reference} is {value}"));
        }
        let known = self.kinds.len();
        let input = self.state.inputs.get_mut(reference);
        let input = input.ok_or_else(|| {
            format!(
                "value reference {reference} is not an input; inputs are numbered \
            below {known}"
            )
        })?;
        *input = value;
        Ok(())
    }

    /// Inputs set at the start hold from the start: efforts act at once, drives move at their rates.
    pub fn settle(&mut self) {
        let mut state = self.state.clone();
        for (course, input) in state.courses.iter_mut().zip(&state.inputs) {
            if let Course::Effort(value) = course {
                *value = *input;
            }
        }
        state.outputs = None;
        self.restore(state);
    }

    /// An input or an output.
    pub fn get(&mut self, reference: usize) -> Result<f64, String> {
        let (inputs, outputs) = self.size();
        if let Some(value) = self.state.inputs.get(reference) {
            return Ok(*value);
        }
        let unknown =
            || format!("there is no value reference {reference}; they are numbered below {}", inputs + outputs);
        let slot = reference.checked_sub(inputs).filter(|i| *i < outputs).ok_or_else(unknown)?;
        if self.state.outputs.is_none() {
            self.look()?;
        }
        self.state.outputs.as_ref().and_then(|x| x.get(slot)).copied().ok_or_else(unknown)
    }

    /// Advance from t by `step`; on failure the state is unchanged.
    pub fn step(&mut self, t: f64, step: f64) -> Result<Stepped, String> {
        let now = self.state.t;
        if !(step > 0.0 && step.is_finite() && (t - now).abs() <= tolerance::EQUAL_IN_SIX_DIGITS * step) {
            return Err(format!("a step of {step} s from t = {t} s was requested, but the model is at t = {now} s"));
        }
        let end = t + step;
        let before = self.state.courses.clone();
        let mut courses = before.clone();
        for (course, input) in courses.iter_mut().zip(&self.state.inputs) {
            *course = match *course {
                Course::Effort(_) => Course::Effort(*input),
                Course::Motion { .. } => {
                    let [x, rate, _] = course.at(now);
                    Course::Motion { t: now, x, rate, growth: (input - rate) / (end - now) }
                }
            };
        }
        self.cell.set(&courses);
        match self.marched(now, end, &[end], false) {
            Ok((state, doubts)) => {
                self.state = State { inputs: std::mem::take(&mut self.state.inputs), courses, ..state };
                Ok(Stepped { doubts })
            }
            Err(e) => {
                self.cell.set(&before);
                Err(e)
            }
        }
    }

    /// Compute the outputs at the current state.
    fn look(&mut self) -> Result<(), String> {
        let now = self.state.t;
        let span = 1.0_f64.max(now.abs());
        let (state, _) = self.marched(now, now + span, &[now], true)?;
        self.state.outputs = state.outputs;
        Ok(())
    }

    /// Integrate to the one requested output; `at_once` stops there.
    fn marched(&self, now: f64, end: f64, t_eval: &[f64], at_once: bool) -> Result<(State, Vec<String>), String> {
        let options = Request { t0: now, t_end: end, ..self.options.clone() };
        let mut watch = |_: f64| if at_once { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
        let (q, v) = (&self.state.q[..], &self.state.v[..]);
        let found = run::run(&self.model, &options, None, t_eval, (q, v), &mut watch).map_err(words)?;
        let ended = found.outcome.status;
        if !(matches!(ended, Status::Finished | Status::Invalid) || (at_once && ended == Status::Interrupted)) {
            return Err(format!("it ends at t = {} ({}): {}", found.outcome.t, ended.word(), found.outcome.message));
        }
        if let Some(invalid) = found.findings.iter().find(|x| x.invalid) {
            return Err(format!("at t = {}: {}", invalid.t, invalid.sentence));
        }
        let doubts = found.findings.iter().map(|x| x.sentence.clone()).collect();
        Ok((self.shown(&found)?, doubts))
    }

    /// The state at the first output of a run, with its outputs.
    fn shown(&self, found: &Run) -> Result<State, String> {
        let output = found.log.outputs.first().ok_or("the run has no output")?;
        let q: Vec<f64> = output.q.iter().zip(&output.turns).map(|(q, n)| turns::whole(*q, *n)).collect();
        let (t, v) = (output.t, output.v.clone());
        let mut watch = || Ok::<(), AnalysisError>(());
        let times = [t];
        let states = States { t: &times, q: &q, v: &v };
        let reacts = |x: &Shown| matches!(x, Shown::Force { .. } | Shown::Moment { .. } | Shown::Effort { .. });
        let forces = match self.shown.iter().any(|(x, _)| reacts(x)) {
            true => Some(found.log.describe::<_, AnalysisError>(&self.model, false, &mut watch).map_err(words)?),
            false => None,
        };
        let mut values = Vec::with_capacity(self.shown.len());
        // components of a joint follow each other: each table is computed once
        let (mut reactions, mut motions) = (None::<(usize, Vec<Vec<f64>>)>, None::<(usize, Vec<Vec<f64>>)>);
        let mut energies = None::<Vec<Vec<f64>>>;
        for (what, j) in &self.shown {
            let j = *j;
            let (tables, table, i) = match what {
                Shown::Position { component, .. } | Shown::Velocity { component, .. } => {
                    let known = motions.take().filter(|(of, _)| *of == j);
                    let known = match known {
                        Some(known) => known,
                        None => (j, outputs::joints(&self.model, &states, &[j], &mut watch).map_err(words)?),
                    };
                    let table = usize::from(matches!(what, Shown::Velocity { .. }));
                    (&motions.insert(known).1, table, *component)
                }
                Shown::Force { component, .. } | Shown::Moment { component, .. } | Shown::Effort { component, .. } => {
                    let known = match (reactions.take().filter(|(of, _)| *of == j), &forces) {
                        (Some(known), _) => known,
                        (None, Some(forces)) => {
                            let forces = Forces { vdot: &forces.vdot, multipliers: &forces.multipliers };
                            (j, outputs::reaction(&self.model, &states, &forces, j, &mut watch).map_err(words)?)
                        }
                        (None, None) => return Err("there are no reactions".into()),
                    };
                    let table = match what {
                        Shown::Force { .. } => 0,
                        Shown::Moment { .. } => 1,
                        _ => 2,
                    };
                    (&reactions.insert(known).1, table, *component)
                }
                Shown::Kinetic | Shown::Potential => {
                    let known = match energies.take() {
                        Some(known) => known,
                        None => outputs::energies(&self.model, &states, &mut watch).map_err(words)?,
                    };
                    let table = usize::from(matches!(what, Shown::Potential));
                    (&*energies.insert(known), table, 0)
                }
            };
            let value = tables.get(table).and_then(|row| row.get(i)).copied();
            values.push(value.ok_or_else(|| format!("an output names component {i}, which does not exist"))?);
        }
        Ok(State { t, q, v, inputs: Vec::new(), courses: Vec::new(), outputs: Some(values) })
    }
}

/// The number of the joint that an output is about; 0 where it is about none.
fn joint_of(model: &Model, what: &Shown) -> Result<usize, String> {
    match what {
        Shown::Position { joint, .. }
        | Shown::Velocity { joint, .. }
        | Shown::Force { joint, .. }
        | Shown::Moment { joint, .. }
        | Shown::Effort { joint, .. } => {
            let found = model.placed.joint_numbers.get(joint).copied();
            found.ok_or_else(|| format!("an output names the joint \"{joint}\", which does not exist"))
        }
        Shown::Kinetic | Shown::Potential => Ok(0),
    }
}
