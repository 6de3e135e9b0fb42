//! Runs made of segments: between two of them velocities jump, or other rows act. Each segment is a run of its own of the
//! mechanism with the rows that act in it; all have the coordinates of the whole mechanism.

mod follow;
mod maker;
mod mode;
mod relay;
mod settle;
mod ticks;
mod transition;

use crate::error::AnalysisError;
use crate::run::{Request, Run};
use maker::{refuse, Maker};
use mode::Mode;
use partita_integrate::simulate::{Outcome, Status};
use partita_math::tolerance;
use partita_model::model::Silent;
use partita_model::Model;
use partita_system::event::{Event, EventFunctions, MotionState, Occurrence};
use partita_system::positions::turns;
use partita_system::record::Output;
use partita_system::SystemError;
use serde::Deserialize;
use std::ops::ControlFlow;
use std::sync::Arc;

pub use relay::{Gone, ModeState, Relay};
pub use ticks::{MakeFunctions, Ticks};

/// Changes without progress that are made at one instant. Reason: of contacts and locks each changes once or twice.
const MOST_AT_ONCE: usize = 50;

/// What is done at an event.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum Action {
    /// The drive of this name holds from there on.
    Lock(String),
    /// It does not hold any more.
    Release(String),
    /// The constraints of this joint act no longer.
    Part(String),
    /// What these drives prescribe gets these rates.
    Rates(Vec<(String, f64)>),
    /// What is followed may not pass the value, that of this drive.
    Stop {
        /// The drive that holds while the contact presses.
        drive: String,
        /// 1 where the function of the event stays positive, −1 where it stays negative.
        sign: f64,
        /// e.
        restitution: f64,
    },
    /// What is followed, the rate of what this drive holds, never gets the other sign.
    Freewheel {
        /// The drive that holds while it carries.
        drive: String,
        /// The sign of rates that are free.
        sign: f64,
    },
    /// Dry friction against what is followed, the rate of what this drive holds.
    Friction {
        /// The drive that holds while it sticks.
        drive: String,
        /// The name of the force.
        force: String,
    },
    /// These inputs, by their numbers, get these values.
    Inputs(Vec<(usize, f64)>),
    /// What this decision says, by its number.
    Decide(usize),
}

/// Decisions about actions, taken where an event happens.
pub trait Decisions: Send + Sync {
    /// What decision i says at this state.
    ///
    /// # Errors
    /// Where it fails, or says what cannot be.
    fn decide(&self, i: usize, at: &MotionState) -> Result<Vec<Action>, SystemError>;
}

/// A run whose events act.
pub struct Plan {
    /// The mechanism with all drives that may hold.
    pub model: Arc<Model>,
    /// The names of those that do not always hold.
    pub switched: Vec<String>,
    /// Those among them that hold at the start.
    pub locked: Vec<String>,
    /// Joints that are apart at the start.
    pub parted: Vec<String>,
    /// Events, and what each does.
    pub events: Vec<Event>,
    /// See `events`.
    pub actions: Vec<Vec<Action>>,
    /// How many may occur.
    pub most: usize,
    /// Efforts that events may set, and their values at the start.
    pub inputs: Vec<(Silent, f64)>,
    /// What the actions ask.
    pub decisions: Box<dyn Decisions>,
}

/// What events do, as files and the Python package write it.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WrittenPlan {
    switched: Vec<String>,
    locked: Vec<String>,
    #[serde(default)]
    parted: Vec<String>,
    actions: Vec<Vec<Action>>,
    #[serde(default)]
    inputs: Vec<(Silent, f64)>,
}

impl WrittenPlan {
    /// That of a mechanism with all drives that may hold, of these events, of which so many may occur.
    pub fn plan(self, model: &Arc<Model>, (events, most): (Vec<Event>, usize), decisions: Box<dyn Decisions>) -> Plan {
        let Self { switched, locked, parted, actions, inputs } = self;
        Plan { model: model.clone(), switched, locked, parted, events, actions, most, inputs, decisions }
    }
}

impl Plan {
    /// The same for another mechanism with these rows; it decides nothing any more.
    fn of(&self, model: &Arc<Model>) -> Self {
        let [switched, locked, parted] = [&self.switched, &self.locked, &self.parted].map(Clone::clone);
        let (events, actions, inputs) = (self.events.clone(), self.actions.clone(), self.inputs.clone());
        let decisions = Box::new(Undecided);
        Self { model: model.clone(), switched, locked, parted, events, actions, most: self.most, inputs, decisions }
    }
}

/// No decisions.
pub struct Undecided;

impl Decisions for Undecided {
    fn decide(&self, _: usize, _: &MotionState) -> Result<Vec<Action>, SystemError> {
        Ok(Vec::new())
    }
}

/// What happened at an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Something passed a value.
    Crossing,
    /// A stop was hit.
    Impact,
    /// It stays closed.
    Rest,
    /// It opens without an impact.
    LiftOff,
    /// Infinitely many impacts, of which the rest is over in no time.
    Accumulation,
    /// Something is held.
    Lock,
    /// It is no longer held, or the joint is apart.
    Release,
    /// Rates were set.
    Rates,
    /// Inputs were set.
    Input,
    /// Friction holds.
    Stick,
    /// It no longer does, or slips in the other sense.
    Slip,
}

impl Kind {
    /// In a word.
    pub fn word(self) -> &'static str {
        match self {
            Self::Crossing => "crossing",
            Self::Impact => "impact",
            Self::Rest => "rest",
            Self::LiftOff => "lift-off",
            Self::Accumulation => "accumulation",
            Self::Lock => "lock",
            Self::Release => "release",
            Self::Rates => "rates",
            Self::Input => "input",
            Self::Stick => "stick",
            Self::Slip => "slip",
        }
    }
}

/// Of a joint on its child in world axes: force and moment about the joint's point, and which of these components are
/// determined.
pub type JointImpulse = ([f64; 6], [bool; 6]);

/// An event with both sides of it.
#[derive(Clone, Debug)]
pub struct Happening {
    /// Number of the event.
    pub event: usize,
    /// What happened.
    pub kind: Kind,
    /// Whether its function rose through zero.
    pub rises: bool,
    /// The state before.
    pub before: Output,
    /// Velocities after.
    pub after: Vec<f64>,
    /// Impulses along all rows of the whole mechanism; empty where there are none.
    pub impulses: Vec<f64>,
    /// Of the joints.
    pub joints: Vec<JointImpulse>,
    /// Loss of kinetic energy.
    pub energy_lost: f64,
}

/// The rate that an instant gives to a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Law {
    /// None.
    Still,
    /// That which was asked.
    Set,
    /// Part of that with which it closed.
    Bounces,
}

/// Why a segment ended.
#[derive(Clone, Debug)]
pub enum Cause {
    /// The function of an event, by its number, is zero.
    Event(usize),
    /// The force along a row of its mechanism is zero, or as large as the friction of this name can carry.
    Force(usize, Option<String>),
    /// The function of an event has this value.
    Passes(usize, f64),
}

/// What happened between two segments, as their derivatives need it.
#[derive(Clone)]
pub struct Transition {
    /// The mechanism with all drives that may hold.
    pub whole: Arc<Model>,
    /// Why.
    pub causes: Vec<Cause>,
    /// Its rows to which velocities jumped; none where they did not.
    pub laws: Vec<(usize, Law)>,
}

/// A part of a run.
pub struct Segment {
    /// Where it begins, with whole turns in its coordinates.
    pub start: Output,
    /// What ended it, if something did.
    pub transition: Option<Transition>,
    /// The mechanism with all drives that may hold, without the joints that are apart.
    pub whole: Arc<Model>,
    /// The mechanism with the rows that act.
    pub model: Arc<Model>,
    /// The row of the whole mechanism that each of its rows is.
    pub rows: Vec<usize>,
    /// The run.
    pub run: Run,
    /// Frictions that act by a force.
    pub slips: Vec<Slipping>,
}

/// A friction that acts by a force, which stands in results as the multiplier of the row by which it sticks.
#[derive(Clone, Copy, Debug)]
pub struct Slipping {
    /// The row of the whole mechanism.
    pub row: usize,
    /// Its number among the forces.
    pub force: usize,
    /// The senses of the motion that its sliding and its static magnitude resist.
    pub signs: [f64; 2],
}

impl Slipping {
    /// Its force at an output.
    ///
    /// # Errors
    /// Errors of user functions.
    pub fn effort(&self, model: &Model, at: &Output) -> Result<f64, SystemError> {
        let q: Vec<f64> = at.q.iter().zip(&at.turns).map(|(q, n)| turns::whole(*q, *n)).collect();
        let levels = model.friction_levels(self.force, at.t, (&q, &at.v))?;
        Ok(levels.map_or(0.0, |levels| -(self.signs[0] * levels[0] + self.signs[1] * levels[1])))
    }
}

/// The multipliers of the rows of a whole mechanism, so many, at an output of a segment, of those of its own rows.
///
/// # Errors
/// Errors of user functions.
pub fn spread(
    whole: &Model,
    (rows, count): (&[usize], usize),
    slips: &[Slipping],
    (at, own): (&Output, &[f64]),
) -> Result<Vec<f64>, SystemError> {
    let mut all = vec![0.0; count];
    rows.iter().zip(own).for_each(|(&to, x)| all[to] = *x);
    for x in slips {
        all[x.row] = x.effort(whole, at)?;
    }
    Ok(all)
}

/// A run made of segments.
pub struct Segments {
    /// In the order of time.
    pub all: Vec<Segment>,
    /// What happened.
    pub happenings: Vec<Happening>,
    /// How the last one ended; those of the segments have counts of work alone.
    pub outcome: Outcome,
}

impl Segments {
    fn new(mut all: Vec<Segment>, happenings: Vec<Happening>) -> Self {
        let mut outcome = Outcome::nothing();
        if let Some(last) = all.last_mut() {
            outcome.counters = last.run.outcome.counters;
            std::mem::swap(&mut outcome, &mut last.run.outcome);
        }
        Self { all, happenings, outcome }
    }
}

/// The state of a run, in its mode.
pub(super) struct RunState {
    maker: Maker,
    mode: Mode,
    /// State, with whole turns in its coordinates.
    now: Output,
    /// Work done, and energy exchanged, so far.
    work: f64,
    exchanged: Option<f64>,
    /// Changes at this instant, one after the other.
    at_once: usize,
}

impl RunState {
    /// At the start: what is closed there closes, and velocities may jump.
    fn new(
        plan: Arc<Plan>,
        functions: Box<dyn EventFunctions>,
        request: &Request,
        (q, v): (&[f64], &[f64]),
    ) -> Result<Self, AnalysisError> {
        let (mut maker, mode) = Maker::new(plan, functions)?;
        let zero = vec![0; q.len()];
        let mut now = Output { t: request.t0, q: q.to_vec(), v: v.to_vec(), turns: zero, ..Output::default() };
        let (mode, first, work) = maker.change(&mode, &now, &[])?;
        now.v = first;
        Ok(Self { maker, mode, now, work, exchanged: None, at_once: 0 })
    }

    /// On to the end of the request, in as many segments as it takes.
    fn go_on(
        &mut self,
        request: &Request,
        t_eval: &[f64],
        watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Vec<(Mode, Segment)>, AnalysisError> {
        let (mut bytes, mut all) = (request.step_bytes, Vec::<(Mode, Segment)>::new());
        loop {
            let (from, exchanged_before) = (self.now.t, self.exchanged);
            let own = Request { t0: from, step_bytes: bytes, exchanged_before, ..request.clone() };
            let times = &t_eval[t_eval.partition_point(|t| *t < from)..];
            let mut segment = match self.maker.segment(&self.mode, &own, times, &self.now, watch) {
                Ok(segment) => segment,
                Err(error) => return stopped(all, from, error),
            };
            let run = &mut segment.run;
            self.exchanged = Some(self.exchanged.unwrap_or_default() + run.exchanged);
            bytes = bytes.saturating_sub(run.log.steps.as_ref().map_or(0, |steps| steps.0.bytes()));
            run.log.outputs.iter_mut().for_each(|x| x.work += self.work);
            run.occurrences.iter_mut().for_each(|x| x.state.work += self.work);
            self.maker.note(&run.occurrences);
            let last = run.occurrences.last().map(|x| x.state.clone());
            let Some(last) = last.filter(|_| run.outcome.status == Status::Event) else {
                if let Some(end) = run.log.outputs.last() {
                    (self.work, self.now) = (end.work, whole(end, end.v.clone()));
                }
                all.push((self.mode.clone(), segment));
                return Ok(all);
            };
            let occurred: Vec<Occurrence> = run.occurrences.iter().filter(|x| x.state.t == last.t).cloned().collect();
            let changed = self.maker.change(&self.mode, &last, &occurred);
            let ends = self.maker.ends(&occurred);
            let over = ends || request.t_end - last.t <= tolerance::SUM_ROUNDING * request.t_end.abs();
            if let (Ok((_, after, _)), false) = (&changed, ends) {
                // an output at that instant is the state after it
                run.log.outputs.retain(|x| x.t < last.t);
                let late = if over { t_eval.partition_point(|t| *t < last.t) } else { t_eval.len() };
                let at_the_end = |&t: &f64| Output { t, v: after.clone(), ..last.clone() };
                run.log.outputs.extend(t_eval[late..].iter().map(at_the_end));
            }
            all.push((self.mode.clone(), segment));
            let (next, after, energy) = match changed {
                Ok(changed) => changed,
                Err(error) => return stopped(all, last.t, error),
            };
            if let Some((_, segment)) = all.last_mut() {
                segment.transition = self.maker.transition.take();
            }
            self.work = last.work + energy;
            (self.now, self.mode) = (whole(&last, after), next);
            if over {
                return Ok(all);
            }
            self.at_once = if last.t == from { self.at_once + 1 } else { 0 };
            if self.at_once > MOST_AT_ONCE {
                let message = format!(
                    "events change what holds without end: {}; let one of them act only once (once=True), or in one \
                     direction",
                    self.maker.latest()
                );
                return stopped(all, last.t, refuse(message));
            }
        }
    }
}

/// A state with its whole turns in its coordinates, and with these velocities.
fn whole(x: &Output, v: Vec<f64>) -> Output {
    let q: Vec<f64> = x.q.iter().zip(&x.turns).map(|(q, n)| turns::whole(*q, *n)).collect();
    Output { t: x.t, turns: vec![0; q.len()], q, v, ..Output::default() }
}

/// Integrate a mechanism whose events act.
///
/// # Errors
/// See [`run`](super::run()); where a later segment cannot begin the run ends there instead.
pub fn in_segments(
    plan: Plan,
    functions: Box<dyn EventFunctions>,
    request: &Request,
    t_eval: &[f64],
    start: (&[f64], &[f64]),
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Segments, AnalysisError> {
    let mut state = RunState::new(Arc::new(plan), functions, request, start)?;
    let all = state.go_on(request, t_eval, watch)?;
    Ok(Segments::new(all.into_iter().map(|x| x.1).collect(), state.maker.happenings))
}

/// A run that cannot go on at t.
fn stopped(mut all: Vec<(Mode, Segment)>, t: f64, error: AnalysisError) -> Result<Vec<(Mode, Segment)>, AnalysisError> {
    let Some((_, last)) = all.last_mut() else { return Err(error) };
    let outcome = &mut last.run.outcome;
    (outcome.status, outcome.message) = (Status::EvaluationFailed, format!("stopped at t = {t:.6} s: {error}"));
    if let AnalysisError::System(error) = error {
        outcome.error = Some(error);
    }
    Ok(all)
}
