//! The mechanism between communication points: inputs in, a step, outputs.

use crate::inputs::{Course, Inputs};
use crate::resource::{Holding, Input, Parameter, Resource, Shown, VERSION};
use crate::serial;
use partita_analysis::error::AnalysisError;
use partita_analysis::outputs::{self, Forces, States};
use partita_analysis::poses::{self, Ask};
use partita_analysis::run::segments::{spread, Gone, Happening, ModeState, Relay, Segment, Undecided};
use partita_analysis::run::{self, Request, Run};
use partita_integrate::simulate::Status;
use partita_math::tolerance;
use partita_model::event_functions::Formulas;
use partita_model::zero_position::Coordinates;
use partita_model::Model;
use partita_system::event::EventFunctions;
use partita_system::positions::turns;
use partita_system::prelude::*;
use std::ops::{ControlFlow, Range};
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
    /// Rates of the inputs that are efforts.
    slopes: Vec<f64>,
    /// Their courses over the last step.
    courses: Vec<Course>,
    /// Values; `None` where they must be computed again.
    outputs: Option<Vec<f64>>,
    /// Values of the parameters.
    parameters: Vec<f64>,
    /// How what holds at times stands; `None` before the start.
    mode_state: Option<ModeState>,
    /// How often something happened to each event, and when for the last time.
    happened: Vec<(f64, f64)>,
}

/// A mechanism that steps.
pub struct Slave {
    guid: String,
    /// With the parameters of the file.
    drawn: Arc<Model>,
    /// With those in `built`, where they are others.
    changed: Option<Arc<Model>>,
    /// What holds at times, and what follows it, with these parameters.
    holding: Option<Holding>,
    relay: Option<Relay>,
    parameters: Vec<Parameter>,
    built: Vec<f64>,
    options: Request,
    /// Relative tolerance of the file.
    rtol: f64,
    /// First and last number, plus one, of values that are one variable, in order.
    arrays: Vec<Range<usize>>,
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

/// Arrays among so many values, as ranges; `None` where they overlap, are empty or out of order, or go beyond them.
fn arrays(given: &[(usize, usize)], count: usize) -> Option<Vec<Range<usize>>> {
    let mut free = 0;
    let ranges = given.iter().map(|&(first, length)| {
        let end = first.checked_add(length).filter(|end| first >= free && length > 0 && *end <= count)?;
        free = end;
        Some(first..end)
    });
    ranges.collect()
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
            Input::Effort { start: value } => Course::Effort { t: start.t, value, slope: 0.0 },
            Input::Position { position: x, rate } | Input::Rate { position: x, rate } => {
                Course::Motion { t: start.t, start: [x, rate, 0.0], bends: [0.0; 3] }
            }
        });
        let courses: Vec<Course> = courses.collect();
        let inputs: Vec<f64> = resource.inputs.iter().flat_map(Input::values).collect();
        let slopes = vec![0.0; resource.inputs.len()];
        let cell = Inputs::default();
        cell.set(&courses);
        let model = Model::new(resource.model, Arc::new(cell.clone()), Coordinates::Relative).map_err(words)?;
        let model = with_drives(Arc::new(model), resource.holding.as_ref())?;
        let size = model.size();
        if (start.q.len(), start.v.len()) != (size.nq, size.nv) {
            return Err(format!("the start has {} coordinates and {} velocities", start.q.len(), start.v.len()));
        }
        let shown = resource.outputs.into_iter().map(|x| Ok((x.clone(), joint_of(&model, &x)?)));
        let shown = shown.collect::<Result<Vec<_>, String>>()?;
        let known = model.parameters();
        let number = |x: &Parameter| {
            let values = known.iter().find(|(name, _)| *name == x.name).map(|(_, values)| values);
            let value = values.and_then(|values| values.get(x.component)).copied();
            value.ok_or_else(|| format!("the model has no parameter \"{}\", number {}", x.name, x.component))
        };
        let built = resource.parameters.iter().map(number).collect::<Result<Vec<_>, String>>()?;
        let count = inputs.len() + shown.len() + built.len();
        let arrays = arrays(&resource.arrays, count).ok_or("the arrays of the resources do not fit")?;
        let (t, q, v, parameters) = (start.t, start.q, start.v, built.clone());
        let events = resource.holding.as_ref().map_or(0, |x| x.events.len());
        let happened = vec![(0.0, t); events];
        let first = State { t, q, v, inputs, slopes, courses, outputs: None, parameters, mode_state: None, happened };
        Ok(Self {
            guid: resource.guid,
            drawn: model,
            changed: None,
            holding: resource.holding,
            relay: None,
            parameters: resource.parameters,
            built,
            rtol: resource.options.rtol,
            options: resource.options,
            arrays,
            kinds: resource.inputs,
            shown,
            cell,
            state: first.clone(),
            first,
        })
    }

    /// The model with the parameters in use.
    fn model(&self) -> &Arc<Model> {
        self.changed.as_ref().unwrap_or(&self.drawn)
    }

    /// Make the model with these parameters; on failure nothing changes.
    fn rebuild(&mut self, values: &[f64]) -> Result<(), String> {
        if self.built == values {
            return Ok(());
        }
        let mut changes: Vec<(String, Vec<f64>)> = Vec::new();
        let known = self.drawn.parameters();
        for (parameter, value) in self.parameters.iter().zip(values) {
            let at = match changes.iter().position(|(name, _)| *name == parameter.name) {
                Some(at) => at,
                None => {
                    let found = known.iter().find(|(name, _)| *name == parameter.name);
                    changes.push(found.ok_or("a parameter does not exist")?.clone());
                    changes.len() - 1
                }
            };
            let slot = changes.get_mut(at).and_then(|(_, numbers)| numbers.get_mut(parameter.component));
            *slot.ok_or("a parameter has fewer numbers")? = *value;
        }
        let changes: Vec<(&str, &[f64])> = changes.iter().map(|(name, x)| (&name[..], &x[..])).collect();
        self.changed = match self.first.parameters == values {
            true => None,
            false => {
                let changed = self.drawn.permanent().with_parameters(&changes).map_err(words)?;
                Some(with_drives(Arc::new(changed), self.holding.as_ref())?)
            }
        };
        self.relay = None;
        self.built = values.to_vec();
        Ok(())
    }

    /// Current state.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Restore a state.
    pub fn restore(&mut self, state: State) -> Result<(), String> {
        self.rebuild(&state.parameters)?;
        self.hold(state);
        Ok(())
    }

    /// Make a state with the parameters in use the current one.
    fn hold(&mut self, state: State) {
        self.cell.set(&state.courses);
        self.state = state;
    }

    /// Return to the initial state.
    pub fn reset(&mut self) -> Result<(), String> {
        self.restore(self.first.clone())
    }

    /// A state as bytes, for this model alone.
    pub fn bytes_of(&self, state: &State, phase: u8) -> Vec<u8> {
        let courses: Vec<f64> = state.courses.iter().flat_map(Course::numbers).collect();
        let (outputs, known) =
            (state.outputs.clone().unwrap_or_default(), f64::from(u8::from(state.outputs.is_some())));
        let alone = [state.t, f64::from(phase), known];
        let mode_state = state.mode_state.as_ref().zip(self.relay.as_ref());
        let mode_state = mode_state.map(|(mode_state, relay)| relay.numbers(mode_state)).unwrap_or_default();
        let happened: Vec<f64> = state.happened.iter().flat_map(|x| [x.0, x.1]).collect();
        let lists: [&[f64]; 10] = [
            &alone,
            &state.q,
            &state.v,
            &state.inputs,
            &state.slopes,
            &courses,
            &outputs,
            &state.parameters,
            &mode_state,
            &happened,
        ];
        serial::bytes(&self.guid, &lists)
    }

    /// The state and the phase in bytes of this model.
    pub fn state_of(&mut self, bytes: &[u8]) -> Result<(State, u8), String> {
        let wrong = || "these bytes are not a state of this model".to_string();
        let lists = serial::lists(&self.guid, bytes).ok_or_else(wrong)?;
        let [alone, q, v, inputs, slopes, courses, outputs, parameters, mode_state, happened]: [Vec<f64>; 10] =
            lists.try_into().map_err(|_| wrong())?;
        let [t, phase, known]: [f64; 3] = alone.try_into().map_err(|_| wrong())?;
        let courses = courses.chunks(Course::NUMBERS).map(Course::from_numbers).collect::<Option<Vec<_>>>();
        let courses = courses.ok_or_else(wrong)?;
        let sizes = |x: &State| {
            [&x.q, &x.v, &x.inputs, &x.slopes, &x.parameters].map(Vec::len).into_iter().chain([x.courses.len()])
        };
        let outputs = (known != 0.0).then_some(outputs);
        let happened: Vec<(f64, f64)> =
            happened.chunks(2).map(|x| (x[0], x.get(1).copied().unwrap_or_default())).collect();
        let mode_state = match mode_state.is_empty() {
            true => None,
            false => {
                let relay = self.relay()?.ok_or_else(wrong)?;
                Some(relay.from_numbers(&mode_state).ok_or_else(wrong)?)
            }
        };
        let fits = happened.len() == self.first.happened.len();
        let state = State { t, q, v, inputs, slopes, courses, outputs, parameters, mode_state, happened };
        let fits = fits && state.outputs.as_ref().is_none_or(|x| x.len() == self.shown.len());
        match sizes(&state).eq(sizes(&self.first)) && fits {
            true => Ok((state, phase as u8)),
            false => Err(wrong()),
        }
    }

    /// Start at time t; `rtol` replaces the relative tolerance.
    pub fn begin(&mut self, t: f64, rtol: Option<f64>) -> Result<(), String> {
        if !t.is_finite() {
            return Err(format!("the start time is {t}"));
        }
        if let Some(rtol) = rtol.filter(|rtol| !(*rtol > 0.0 && *rtol < 1.0)) {
            return Err(format!("the tolerance is {rtol}; give one between 0 and 1"));
        }
        self.options.rtol = rtol.unwrap_or(self.rtol);
        let mut state = self.state.clone();
        (state.t, state.mode_state) = (t, None);
        state.happened.iter_mut().for_each(|x| *x = (0.0, t));
        for course in &mut state.courses {
            *course = course.from(t);
        }
        state.outputs = None;
        self.hold(state);
        Ok(())
    }

    /// Whether a value is that of a parameter, which is set before the start alone.
    pub fn is_parameter(&self, number: usize) -> bool {
        let (inputs, outputs) = self.size();
        (inputs + outputs..self.time()).contains(&number)
    }

    /// The number of the time, after those of the parameters.
    fn time(&self) -> usize {
        let (inputs, outputs) = self.size();
        inputs + outputs + self.parameters.len()
    }

    /// Numbers of the values of a variable: one, or those of an array, whose first one is its value reference.
    pub fn slots(&self, reference: usize) -> Result<Range<usize>, String> {
        let next = self.arrays.partition_point(|array| array.end <= reference);
        match self.arrays.get(next).filter(|array| array.contains(&reference)) {
            Some(array) if array.start == reference => Ok(array.clone()),
            Some(array) => Err(format!(
                "there is no value reference {reference}; value {reference} is in the array with the value reference {}",
                array.start
            )),
            None => Ok(reference..reference.saturating_add(1)),
        }
    }

    /// Number of values of inputs, and of outputs.
    pub fn size(&self) -> (usize, usize) {
        (self.first.inputs.len(), self.shown.len())
    }

    /// The inputs with the numbers of their values.
    fn ranges(&self) -> impl Iterator<Item = (&Input, Range<usize>)> {
        let mut free = 0;
        self.kinds.iter().map(move |kind| {
            let first = free;
            free += kind.values().len();
            (kind, first..free)
        })
    }

    /// Set a derivative of an input, of an order from 1: it is the value that follows, or the rate of an effort.
    pub fn differentiate(&mut self, reference: usize, order: usize, value: f64) -> Result<(), String> {
        if !value.is_finite() {
            return Err(format!("derivative {order} of value {reference} is {value}"));
        }
        let found = self.ranges().enumerate().find(|(_, (_, range))| range.contains(&reference));
        let found = found.map(|(i, (kind, range))| (i, *kind, range));
        let Some((i, kind, range)) = found else {
            return Err(format!("value reference {reference} is not an input, so it has no derivatives"));
        };
        let most = match kind {
            Input::Effort { .. } => 1,
            _ => range.end - 1 - reference,
        };
        let slot = match kind {
            Input::Effort { .. } => self.state.slopes.get_mut(i),
            _ => self.state.inputs.get_mut(reference + order),
        };
        match slot.filter(|_| (1..=most).contains(&order)) {
            Some(slot) => *slot = value,
            None => return Err(format!("value reference {reference} has derivatives up to order {most}, not {order}")),
        }
        Ok(())
    }

    /// Set an input or a parameter.
    pub fn set(&mut self, reference: usize, value: f64) -> Result<(), String> {
        if !value.is_finite() {
            return Err(format!("value {reference} is {value}"));
        }
        if self.is_parameter(reference) {
            let (inputs, outputs) = self.size();
            if let Some(slot) = self.state.parameters.get_mut(reference - inputs - outputs) {
                *slot = value;
            }
            return Ok(());
        }
        let known = self.size().0;
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

    /// Inputs and parameters set at the start hold from the start: efforts act at once, drives move at their rates; with
    /// other parameters the loops are closed from the initial position.
    pub fn settle(&mut self) -> Result<(), String> {
        let mut state = self.state.clone();
        if state.parameters != self.built {
            self.rebuild(&state.parameters)?;
            let (model, t) = (self.model().permanent(), state.t);
            let ask = Ask { guess: vec![], fixed: vec![], levels: vec![], tolerance: tolerance::EQUAL };
            let q = poses::one(model, t, &self.first.q, &ask).map_err(words)?.q;
            let rest = self.first.v.iter().all(|v| *v == 0.0) && !model.structure().rheonomic;
            let near = &self.first.v;
            state.v = match rest {
                true => near.clone(),
                false => poses::with_rates(model, t, &q, near, &[], &[]).map_err(words)?,
            };
            state.q = q;
        }
        for ((course, (_, range)), slope) in state.courses.iter_mut().zip(self.ranges()).zip(&state.slopes) {
            match (course, state.inputs.get(range).unwrap_or_default()) {
                (Course::Effort { value, slope: rate, .. }, [input]) => (*value, *rate) = (*input, *slope),
                (Course::Motion { start, .. }, [.., gain]) => start[2] = *gain,
                _ => {}
            }
        }
        state.outputs = None;
        self.hold(state);
        Ok(())
    }

    /// An input, an output, a parameter or the time.
    pub fn get(&mut self, reference: usize) -> Result<f64, String> {
        let (inputs, outputs) = self.size();
        if let Some(value) = reference.checked_sub(inputs + outputs).and_then(|i| self.state.parameters.get(i)) {
            return Ok(*value);
        }
        if let Some(value) = self.state.inputs.get(reference) {
            return Ok(*value);
        }
        if reference == self.time() {
            return Ok(self.state.t);
        }
        let count = self.time() + 1;
        let unknown = || format!("there is no value reference {reference}; they are numbered below {count}");
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
        let span = end - now;
        for ((course, (kind, range)), slope) in courses.iter_mut().zip(self.ranges()).zip(&self.state.slopes) {
            let given = self.state.inputs.get(range).unwrap_or_default();
            let [x, rate, growth] = course.at(now);
            *course = match (kind, given) {
                (Input::Effort { .. }, [value]) => Course::Effort { t: now, value: *value, slope: *slope },
                (Input::Position { .. }, [position, speed, gain]) => {
                    let end = [position + (speed + 0.5 * gain * span) * span, speed + gain * span, *gain];
                    Course::between(now, [x, rate, growth], span, end)
                }
                (Input::Rate { .. }, [speed, gain]) => {
                    let growth = (speed + gain * span - rate) / span;
                    Course::Motion { t: now, start: [x, rate, growth], bends: [0.0; 3] }
                }
                _ => return Err("the inputs do not fit".into()),
            };
        }
        self.cell.set(&courses);
        let moved = match self.holding.is_some() {
            true => self.followed(now, end, false),
            false => self.marched(now, end, &[end], false),
        };
        match moved {
            Ok((state, doubts)) => {
                let old = std::mem::replace(&mut self.state, state);
                let State { inputs, slopes, parameters, .. } = old;
                (self.state.inputs, self.state.slopes, self.state.parameters) = (inputs, slopes, parameters);
                self.state.courses = courses;
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
        let (state, _) = match self.holding.is_some() {
            true => self.followed(now, now + span, true)?,
            false => self.marched(now, now + span, &[now], true)?,
        };
        self.state.outputs = state.outputs;
        if self.holding.is_some() {
            (self.state.mode_state, self.state.happened, self.state.v) = (state.mode_state, state.happened, state.v);
        }
        Ok(())
    }

    /// What follows what holds at times, with the parameters in use.
    fn relay(&mut self) -> Result<Option<&mut Relay>, String> {
        let Some(holding) = self.holding.clone() else { return Ok(None) };
        if self.relay.is_none() {
            let now = self.state.t;
            let request = Request { t0: now, t_end: now + 1.0_f64.max(now.abs()), ..self.options.clone() };
            let model = self.model().clone();
            let events = holding.events.iter().map(|x| x.event()).collect();
            let plan = holding.plan.plan(&model, (events, holding.most), Box::new(Undecided));
            let formulas: Vec<_> = holding.events.into_iter().map(|x| (x.name, x.formula)).collect();
            let calls = Arc::new(self.cell.clone());
            let functions = Box::new(move || {
                let made = Formulas::of_mechanism(model.clone(), &formulas, calls.clone())?;
                Ok(Box::new(made) as Box<dyn EventFunctions>)
            });
            let relay = Relay::new(plan, functions, &request, (&self.state.q, &self.state.v)).map_err(words)?;
            self.relay = Some(relay);
        }
        Ok(self.relay.as_mut())
    }

    /// As `marched`, where something holds at times: to the end, or with the outputs at the start.
    fn followed(&mut self, now: f64, end: f64, at_once: bool) -> Result<(State, Vec<String>), String> {
        if self.state.mode_state.is_none() {
            self.relay = None; // it begins here
        }
        let (mut state, options) = (self.state.clone(), Request { t0: now, t_end: end, ..self.options.clone() });
        let relay = self.relay()?.ok_or("nothing holds here")?;
        let mode_state = match &state.mode_state {
            Some(mode_state) => mode_state.clone(),
            None => {
                let (mode_state, v, happenings) = relay.started();
                state.v = v.to_vec();
                count(&mut state.happened, happenings);
                mode_state
            }
        };
        let t_eval = [if at_once { now } else { end }];
        let mut watch = |_: f64| if at_once { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
        let gone = relay.go_on(&mode_state, (&state.q, &state.v), &options, &t_eval, &mut watch).map_err(words)?;
        let Gone { segments, happenings, mode_state: after } = gone;
        let last = segments.last().ok_or("the step has no segment")?;
        let found = &last.run.outcome;
        let ends = [Status::Finished, Status::Invalid, Status::Event];
        if !(ends.contains(&found.status) || (at_once && found.status == Status::Interrupted)) {
            return Err(format!("it ends at t = {} ({}): {}", found.t, found.status.word(), found.message));
        }
        let findings = || segments.iter().flat_map(|x| &x.run.findings);
        if let Some(invalid) = findings().find(|x| x.invalid) {
            return Err(format!("at t = {}: {}", invalid.t, invalid.sentence));
        }
        let doubts = findings().map(|x| x.sentence.clone()).collect();
        if !at_once {
            count(&mut state.happened, &happenings);
        }
        state.mode_state = Some(if at_once { mode_state } else { after });
        let at = segments.iter().rev().find(|x| !x.run.log.outputs.is_empty()).ok_or("the run has no output")?;
        let (happened, mode_state) = (state.happened, state.mode_state);
        let mut shown = self.shown(&at.run, Some(at), &happened)?;
        (shown.happened, shown.mode_state) = (happened, mode_state);
        Ok((shown, doubts))
    }

    /// Integrate to the one requested output; `at_once` stops there.
    fn marched(&self, now: f64, end: f64, t_eval: &[f64], at_once: bool) -> Result<(State, Vec<String>), String> {
        let options = Request { t0: now, t_end: end, ..self.options.clone() };
        let mut watch = |_: f64| if at_once { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
        let (q, v) = (&self.state.q[..], &self.state.v[..]);
        let found = run::run(&**self.model(), &options, None, t_eval, (q, v), &mut watch).map_err(words)?;
        let ended = found.outcome.status;
        if !(matches!(ended, Status::Finished | Status::Invalid) || (at_once && ended == Status::Interrupted)) {
            return Err(format!("it ends at t = {} ({}): {}", found.outcome.t, ended.word(), found.outcome.message));
        }
        if let Some(invalid) = found.findings.iter().find(|x| x.invalid) {
            return Err(format!("at t = {}: {}", invalid.t, invalid.sentence));
        }
        let doubts = found.findings.iter().map(|x| x.sentence.clone()).collect();
        Ok((self.shown(&found, None, &[])?, doubts))
    }

    /// The state at the first output of a run, or of a segment, with its outputs.
    fn shown(&self, found: &Run, of: Option<&Segment>, happened: &[(f64, f64)]) -> Result<State, String> {
        let model: &Model = of.map_or(self.model(), |x| &x.whole);
        let output = found.log.outputs.first().ok_or("the run has no output")?;
        let q: Vec<f64> = output.q.iter().zip(&output.turns).map(|(q, n)| turns::whole(*q, *n)).collect();
        let (t, v) = (output.t, output.v.clone());
        let mut watch = || Ok::<(), AnalysisError>(());
        let times = [t];
        let states = States { t: &times, q: &q, v: &v };
        let reacts = |x: &Shown| {
            matches!(x, Shown::Force { .. } | Shown::Moment { .. } | Shown::Effort { .. } | Shown::Carried { .. })
        };
        let forces = match self.shown.iter().any(|(x, _)| reacts(x)) {
            true => {
                let own = of.map_or(model, |x| &x.model);
                let mut forces = found.log.describe(own, false, &mut watch).map_err(words)?;
                if let Some(x) = of {
                    let first = forces.multipliers.get(..x.rows.len()).unwrap_or_default();
                    let rows = (&x.rows[..], model.size().rows);
                    forces.multipliers = spread(model, rows, &x.slips, (output, first)).map_err(words)?;
                    forces.vdot.truncate(v.len());
                }
                Some(forces)
            }
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
                        None => (j, outputs::joints(model, &states, &[j], &mut watch).map_err(words)?),
                    };
                    let table = usize::from(matches!(what, Shown::Velocity { .. }));
                    (&motions.insert(known).1, table, *component)
                }
                Shown::Force { component, .. } | Shown::Moment { component, .. } | Shown::Effort { component, .. } => {
                    let known = match (reactions.take().filter(|(of, _)| *of == j), &forces) {
                        (Some(known), _) => known,
                        (None, Some(forces)) => {
                            let forces = Forces { vdot: &forces.vdot, multipliers: &forces.multipliers };
                            (j, outputs::reaction(model, &states, &forces, j, &mut watch).map_err(words)?)
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
                        None => outputs::energies(model, &states, &mut watch).map_err(words)?,
                    };
                    let table = usize::from(matches!(what, Shown::Potential));
                    (&*energies.insert(known), table, 0)
                }
                Shown::Carried { drives } => {
                    let forces = forces.as_ref().ok_or("there are no forces")?;
                    let rows = model.drives().iter().filter(|x| drives.contains(&x.name)).map(|x| x.row);
                    values.push(rows.filter_map(|row| forces.multipliers.get(row)).sum());
                    continue;
                }
                Shown::Count { events } | Shown::Last { events } => {
                    let known = events.iter().map(|event| happened.get(*event).copied()).collect::<Option<Vec<_>>>();
                    let known = known.ok_or("an output names an event that does not exist")?;
                    values.push(match what {
                        Shown::Count { .. } => known.iter().map(|x| x.0).sum(),
                        _ => known.iter().fold(f64::NEG_INFINITY, |t, x| t.max(x.1)),
                    });
                    continue;
                }
            };
            let value = tables.get(table).and_then(|row| row.get(i)).copied();
            values.push(value.ok_or_else(|| format!("an output names component {i}, which does not exist"))?);
        }
        let outputs = Some(values);
        let (inputs, slopes, courses, parameters) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        Ok(State { t, q, v, inputs, slopes, courses, outputs, parameters, mode_state: None, happened: Vec::new() })
    }
}

/// Count what happened.
fn count(happened: &mut [(f64, f64)], new: &[Happening]) {
    for x in new {
        if let Some(known) = happened.get_mut(x.event) {
            *known = (known.0 + 1.0, x.before.t);
        }
    }
}

/// A mechanism with the drives by which it holds at times.
fn with_drives(model: Arc<Model>, holding: Option<&Holding>) -> Result<Arc<Model>, String> {
    match holding {
        None => Ok(model),
        Some(holding) => Ok(Arc::new(model.with_more_drives(holding.drives.clone()).map_err(words)?)),
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
            let found = model.zero_position().joint_numbers.get(joint).copied();
            found.ok_or_else(|| format!("an output names the joint \"{joint}\", which does not exist"))
        }
        Shown::Kinetic | Shown::Potential => Ok(0),
        Shown::Carried { .. } | Shown::Count { .. } | Shown::Last { .. } => Ok(0),
    }
}
