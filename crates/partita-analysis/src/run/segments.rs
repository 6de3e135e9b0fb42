//! Runs made of segments: between two of them velocities jump, or other rows act. Each segment is a run of its own of the
//! mechanism with the rows that act in it; all have the coordinates of the whole mechanism.

use super::impact::{Acting, Impact, OneSided, Rates, Reached};
use super::{Request, Run};
use crate::determined::determined;
use crate::error::AnalysisError;
use crate::outputs::{energies, reactions, Forces, States};
use partita_integrate::simulate::{Observe, Outcome, Status};
use partita_math::tolerance;
use partita_model::model::Silent;
use partita_model::Model;
use partita_system::event::{Event, EventFunctions, MotionState, Occurrence};
use partita_system::positions::turns;
use partita_system::prelude::*;
use partita_system::record::Output;
use partita_system::watched::Reading;
use partita_system::SystemError;
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::ControlFlow;
use std::sync::{Arc, Mutex, PoisonError};

/// Changes without progress that are made at one instant. Reason: of contacts and locks each changes once or twice.
const MOST_AT_ONCE: usize = 50;

/// Frictions that change between sticking and slipping until a combination holds. Reason: far more than pairs of the few
/// that come to rest together.
const MOST_FLIPS: usize = 1000;

/// A coordinate that is slower is at rest. Scale: natural size of the coordinate per second. Reason: far above the rounding
/// of rates, far below any motion.
const RATE_AT_REST: f64 = 1e-9;

/// Models of modes that are kept. Reason: a mechanism has a few modes; inputs that are set anew at each event make as many as
/// there are events.
const MOST_KEPT: usize = 64;

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

/// Impulses of all joints with which velocities change by `dv`, with those along the rows.
fn of_joints(
    model: &Model,
    (t, q): (f64, &[f64]),
    dv: &[f64],
    along: &[f64],
) -> Result<Vec<JointImpulse>, AnalysisError> {
    let (times, rest, none) = ([t], vec![0.0; dv.len()], vec![0.0; along.len()]);
    let states = States { t: &times, q, v: &rest };
    // reactions are linear in accelerations and multipliers: the loads of the instant are in both
    let with = reactions(model, &states, &Forces { vdot: dv, multipliers: along }, &mut || Ok(()))?;
    let without = reactions(model, &states, &Forces { vdot: &rest, multipliers: &none }, &mut || Ok(()))?;
    let known = determined(model.permanent(), t, q, false)?;
    let part = |table: usize, i: usize| with[table][i] - without[table][i];
    let joint = |(j, known): (usize, [bool; 6])| {
        let mut wrench = [0.0; 6];
        for i in 0..3 {
            (wrench[i], wrench[3 + i]) = (part(0, 3 * j + i), part(1, 3 * j + i));
        }
        (wrench, known)
    };
    Ok(known.into_iter().enumerate().map(joint).collect())
}

/// Refuse to part a joint where a body goes on spinning about an axis about which it has no inertia: by the mechanisms
/// before and after, whose kinetic energies differ by that of the spin, which is held there.
fn check_spins(before: &Model, after: &Model, (t, q, v): (f64, &[f64], &[f64])) -> Result<(), AnalysisError> {
    let (times, go) = ([t], || Ok(()));
    let states = States { t: &times, q, v };
    let [first, last] = [before, after].map(|model| energies(model, &states, &mut go.clone()));
    let (first, last) = (first?[0][0], last?[0][0]);
    if (first - last).abs() > tolerance::SOLUTION_ROUNDING * first.max(last) {
        return Err(refuse(format!(
            "at t = {t:.6} s a body is parted that spins about an axis about which it has no inertia, so that its motion is \
             not determined from there on; give it inertia about all axes"
        )));
    }
    Ok(())
}

/// A part of a run.
pub struct Segment {
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
    /// The sense of the motion.
    pub sign: f64,
}

impl Slipping {
    /// Its force at an output.
    ///
    /// # Errors
    /// Errors of user functions.
    pub fn effort(&self, model: &Model, at: &Output) -> Result<f64, SystemError> {
        let q: Vec<f64> = at.q.iter().zip(&at.turns).map(|(q, n)| turns::whole(*q, *n)).collect();
        let levels = model.friction_levels(self.force, at.t, (&q, &at.v))?;
        Ok(levels.map_or(0.0, |levels| -self.sign * levels[0]))
    }
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

/// Functions that several segments follow one after the other.
#[derive(Clone, Debug)]
struct Shared(Arc<Mutex<Box<dyn EventFunctions>>>);

impl EventFunctions for Shared {
    fn read(&mut self, at: &MotionState, out: &mut [Reading]) -> Result<(), SystemError> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).read(at, out)
    }
    fn accept(&mut self, t: f64) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).accept(t);
    }
}

/// The force that a friction can carry at most.
#[derive(Clone)]
struct Largest {
    model: Arc<Model>,
    force: usize,
}

impl std::fmt::Debug for Largest {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.debug_struct("Largest").field("force", &self.force).finish_non_exhaustive()
    }
}

/// What is followed because of what is held; positive while that lasts.
#[derive(Clone, Debug)]
enum Lasts {
    /// The force of a contact, or what friction can carry beyond its force.
    Force { row: usize, sign: f64, most: Option<Largest> },
    /// The rate that an event follows is not beyond this one.
    Rate { event: usize, sign: f64, width: f64 },
}

/// The same along a motion.
#[derive(Clone, Debug)]
struct Following {
    what: Lasts,
    /// Time and value where the motion stands, and where they were read since.
    last: Option<(f64, f64)>,
    read: Vec<(f64, f64)>,
}

impl From<Lasts> for Following {
    fn from(what: Lasts) -> Self {
        Self { what, last: None, read: Vec::new() }
    }
}

/// The functions of the events, and those that say how long what is held lasts.
#[derive(Debug)]
struct WithContacts {
    inner: Shared,
    count: usize,
    contacts: Vec<Following>,
}

impl EventFunctions for WithContacts {
    fn read(&mut self, at: &MotionState, out: &mut [Reading]) -> Result<(), SystemError> {
        self.inner.read(at, &mut out[..self.count])?;
        let (events, own) = out.split_at_mut(self.count);
        for (x, out) in self.contacts.iter_mut().zip(own) {
            let (force, terms) = match &x.what {
                Lasts::Force { row, sign, most } => {
                    let (force, levels) = (sign * at.multipliers[*row], most.as_ref());
                    let levels = levels.map(|x| x.model.friction_levels(x.force, at.t, (&at.q, &at.v))).transpose()?;
                    let most = levels.flatten().map_or(0.0, |levels| levels[1]);
                    (most + force, most.abs() + force.abs())
                }
                Lasts::Rate { event, sign, width } => (width - sign * events[*event].x, *width),
            };
            let rate = x.last.filter(|last| last.0 < at.t).map_or(0.0, |last| (force - last.1) / (at.t - last.0));
            x.read.push((at.t, force));
            *out = Reading { x: force, rate, terms, ..Reading::default() };
        }
        Ok(())
    }
    fn accept(&mut self, t: f64) {
        self.inner.accept(t);
        for x in &mut self.contacts {
            x.last = x.read.iter().rev().find(|read| read.0 == t).copied().or(x.last);
            x.read.clear();
        }
    }
    fn reads_forces(&self) -> bool {
        self.contacts.iter().any(|x| matches!(x.what, Lasts::Force { .. }))
    }
}

/// What a condition on one side bounds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Bounds {
    Position,
    Rate,
}

/// A stop or a freewheel: its event, its row in the whole mechanism, its law, and the size of what it bounds.
#[derive(Clone, Debug)]
struct StopOf {
    event: usize,
    drive: String,
    side: OneSided,
    size: f64,
    bounds: Bounds,
}

/// A friction that may stick: its event, its row in the whole mechanism, and its force.
#[derive(Clone, Debug)]
struct FrictionOf {
    event: usize,
    drive: String,
    row: usize,
    force: usize,
    name: String,
    size: f64,
}

impl FrictionOf {
    /// Its coordinate, in its positive sense.
    fn side(&self) -> OneSided {
        OneSided { row: self.row, sign: 1.0, restitution: 0.0 }
    }
}

/// How a friction acts; signs are those of the motion that its force resists.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum StickSlip {
    /// By a row.
    Sticks,
    /// By a force against the motion.
    Slips(i8),
    /// Other rows hold its coordinate at rest; its force is as large as it can be, or zero.
    Rests(i8),
}

impl StickSlip {
    fn sign(self) -> i8 {
        match self {
            Self::Sticks => 0,
            Self::Slips(sign) | Self::Rests(sign) => sign,
        }
    }
}

/// Which rows act.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
struct Mode {
    /// Drives that hold in both directions.
    locked: BTreeSet<String>,
    /// Stops that press, by their numbers.
    pressing: BTreeSet<usize>,
    /// How the frictions act.
    frictions: Vec<StickSlip>,
    /// What moves.
    whole: Whole,
}

/// What moves, whichever rows act.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
struct Whole {
    /// Joints that are apart.
    parted: BTreeSet<String>,
    /// Bits of the inputs that were set.
    inputs: BTreeMap<usize, u64>,
}

/// What a mode follows beside the events.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Own {
    /// The force of a stop.
    Press(usize),
    /// A friction at rest is about to slip in this sense, or is moved by other rows.
    Slip(usize, i8),
}

/// The whole of a run while it is made.
struct Maker<'p> {
    plan: &'p Plan,
    functions: Shared,
    stops: Vec<StopOf>,
    frictions: Vec<FrictionOf>,
    /// Rows of the whole mechanism by the names of drives.
    rows: BTreeMap<String, usize>,
    /// Rows that always act.
    always: Vec<usize>,
    /// Models of modes that acted before.
    models: BTreeMap<Mode, (Arc<Model>, Vec<usize>)>,
    /// With all drives.
    wholes: BTreeMap<Whole, Arc<Model>>,
    /// The times in which it moves, with room at both ends.
    span: [f64; 2],
    /// How often each event has occurred.
    count: Vec<u64>,
    happenings: Vec<Happening>,
}

fn refuse(message: String) -> AnalysisError {
    AnalysisError::Argument { argument: "events", message }
}

impl<'p> Maker<'p> {
    fn new(
        plan: &'p Plan,
        functions: Box<dyn EventFunctions>,
        (t0, t_end): (f64, f64),
    ) -> Result<(Self, Mode), AnalysisError> {
        let room = 1.0 + (t_end - t0);
        let span = [t0 - room, t_end + room];
        let functions = Shared(Arc::new(Mutex::new(functions)));
        let rows: BTreeMap<String, usize> =
            plan.model.drives().iter().map(|drive| (drive.name.clone(), drive.row)).collect();
        let switched: BTreeSet<usize> = plan.switched.iter().filter_map(|name| rows.get(name).copied()).collect();
        let always = (0..plan.model.size().rows).filter(|row| !switched.contains(row)).collect();
        let known = |name: &String| {
            let row = rows.get(name).copied();
            row.ok_or_else(|| refuse(format!("there is no drive \"{name}\" that an event could hold")))
        };
        let size = |drive: &String| {
            let measured = plan.model.spec.drives.iter().find(|x| x.name == *drive);
            measured.map_or(1.0, |x| plan.model.natural_size(&x.measure))
        };
        let (mut stops, mut frictions) = (Vec::new(), Vec::new());
        for (event, actions) in plan.actions.iter().enumerate() {
            for action in actions {
                let mut bound = |drive: &String, sign: f64, restitution: f64, bounds: Bounds| {
                    let side = OneSided { row: known(drive)?, sign, restitution };
                    stops.push(StopOf { event, drive: drive.clone(), side, size: size(drive), bounds });
                    Ok::<(), AnalysisError>(())
                };
                match action {
                    Action::Stop { drive, sign, restitution } => bound(drive, *sign, *restitution, Bounds::Position)?,
                    Action::Freewheel { drive, sign } => bound(drive, *sign, 0.0, Bounds::Rate)?,
                    Action::Friction { drive, force } => {
                        let number = plan.model.spec.forces.iter().position(|x| x.name() == force);
                        let number = number.ok_or_else(|| refuse(format!("there is no force \"{force}\"")))?;
                        let (drive, row, size) = (drive.clone(), known(drive)?, size(drive));
                        frictions.push(FrictionOf { event, drive, row, force: number, name: force.clone(), size });
                    }
                    Action::Lock(_) | Action::Release(_) | Action::Part(_) | Action::Rates(_) => {}
                    Action::Inputs(_) | Action::Decide(_) => {}
                }
            }
        }
        let [locked, parted] = [&plan.locked, &plan.parted].map(|names| names.iter().cloned().collect());
        let resting = vec![StickSlip::Rests(0); frictions.len()];
        let whole = Whole { parted, inputs: BTreeMap::new() };
        let mode = Mode { locked, pressing: BTreeSet::new(), frictions: resting, whole };
        let (models, wholes) = (BTreeMap::new(), BTreeMap::new());
        let (happenings, count) = (Vec::new(), vec![0; plan.events.len()]);
        Ok((Self { plan, functions, stops, frictions, rows, always, models, wholes, span, count, happenings }, mode))
    }

    /// The mechanism with all drives, without the joints that are apart, and with its inputs. Made once.
    fn whole(&mut self, what: &Whole) -> Result<Arc<Model>, AnalysisError> {
        if let Some(found) = self.wholes.get(what) {
            return Ok(found.clone());
        }
        let mut made = match what.parted.is_empty() {
            true => self.plan.model.clone(),
            false => Arc::new(self.plan.model.parted(&what.parted)?),
        };
        if !self.plan.inputs.is_empty() {
            let given = self.plan.inputs.iter().enumerate();
            let efforts = given.map(|(i, x)| (x.0, what.inputs.get(&i).map_or(x.1, |bits| f64::from_bits(*bits))));
            made = Arc::new(made.with_efforts(&efforts.collect::<Vec<_>>(), self.span)?);
        }
        if self.wholes.len() >= MOST_KEPT {
            self.wholes.clear();
        }
        self.wholes.insert(what.clone(), made.clone());
        Ok(made)
    }

    /// The mechanism in a mode, and the row of the whole one that each of its rows is. Made once.
    fn model(&mut self, mode: &Mode) -> Result<(Arc<Model>, Vec<usize>), AnalysisError> {
        if let Some(found) = self.models.get(mode) {
            return Ok(found.clone());
        }
        let whole = self.whole(&mode.whole)?;
        let pressing: BTreeSet<&String> = mode.pressing.iter().map(|&i| &self.stops[i].drive).collect();
        let rubbing = || self.frictions.iter().zip(&mode.frictions);
        let sticks = |name: &str| rubbing().any(|(x, acts)| *acts == StickSlip::Sticks && x.drive == name);
        let acts = |name: &str| {
            let switched = self.plan.switched.iter().any(|x| x == name);
            !switched || mode.locked.contains(name) || pressing.contains(&name.to_owned()) || sticks(name)
        };
        let slips = |name: &str| rubbing().find(|x| x.0.name == name).map_or(0.0, |x| f64::from(x.1.sign()));
        let made = Arc::new(whole.with_drives(&acts, &slips)?);
        let rows = self.plan.model.rows_of(&made);
        let found = (made, rows);
        if self.models.len() >= MOST_KEPT {
            self.models.clear();
        }
        self.models.insert(mode.clone(), found.clone());
        Ok(found)
    }

    /// The segment in a mode from a state on.
    fn segment(
        &mut self,
        mode: &Mode,
        request: &Request,
        times: &[f64],
        now: &Output,
        watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Segment, AnalysisError> {
        let (whole, (model, rows)) = (self.whole(&mode.whole)?, self.model(mode)?);
        let observe = self.observe(mode, &whole, &model);
        let run = super::observed(&*model, request, None, times, (&now.q, &now.v), Some(observe), watch)?;
        let rubbing = self.frictions.iter().zip(&mode.frictions).filter(|x| x.1.sign() != 0);
        let slips = rubbing.map(|(x, acts)| Slipping { row: x.row, force: x.force, sign: acts.sign().into() });
        Ok(Segment { whole, model, rows, run, slips: slips.collect() })
    }

    /// What a mode follows beside the events, in the order of their numbers after those of the events.
    fn own(&self, mode: &Mode) -> Vec<Own> {
        let presses = mode.pressing.iter().map(|&s| Own::Press(s));
        let rests = (0..self.frictions.len()).filter(|&i| !matches!(mode.frictions[i], StickSlip::Slips(_)));
        presses.chain(rests.flat_map(|i| [1, -1].map(|sign| Own::Slip(i, sign)))).collect()
    }

    /// What finds the events of a segment in a mode.
    fn observe(&self, mode: &Mode, whole: &Arc<Model>, model: &Model) -> Observe {
        let mut events = Vec::with_capacity(self.plan.events.len());
        for (i, event) in self.plan.events.iter().enumerate() {
            let left = |x: u64| x.saturating_sub(self.count[i]);
            let mut event = Event { most: left(event.most), last: event.last.map(left), ..event.clone() };
            if !self.plan.actions[i].is_empty() && event.most > 0 {
                event.last = Some(1);
            }
            let stops = self.stops.iter().enumerate().filter(|x| x.1.event == i);
            for (s, stop) in stops {
                event.side = Some(stop.side.sign > 0.0);
                if mode.pressing.contains(&s) {
                    event.most = 0; // its force is followed instead
                }
            }
            for (_, acts) in self.frictions.iter().zip(&mode.frictions).filter(|x| x.0.event == i) {
                match acts {
                    StickSlip::Slips(sign) => event.side = Some(*sign > 0),
                    StickSlip::Sticks | StickSlip::Rests(_) => event.most = 0,
                }
            }
            events.push(event);
        }
        let count = events.len();
        let row = |drive: &str| model.drives().iter().find(|d| d.name == drive).map_or(0, |d| d.row);
        let mut contacts: Vec<Following> = Vec::new();
        for own in self.own(mode) {
            let (what, event, ends) = match own {
                Own::Press(s) => {
                    let stop = &self.stops[s];
                    (Lasts::Force { row: row(&stop.drive), sign: stop.side.sign, most: None }, stop.event, "opens")
                }
                Own::Slip(i, sign) => {
                    let (friction, sign) = (&self.frictions[i], f64::from(sign));
                    let what = match mode.frictions[i] {
                        StickSlip::Sticks => {
                            let most = Some(Largest { model: whole.clone(), force: friction.force });
                            Lasts::Force { row: row(&friction.drive), sign, most }
                        }
                        _ => Lasts::Rate { event: friction.event, sign, width: RATE_AT_REST * friction.size },
                    };
                    (what, friction.event, "slips")
                }
            };
            contacts.push(what.into());
            let name = format!("{} {ends}", self.plan.events[event].name);
            events.push(Event { name, last: Some(1), most: 1, side: Some(true), ..Event::default() });
        }
        let functions = Box::new(WithContacts { inner: self.functions.clone(), count, contacts });
        Observe { events, functions, most: self.plan.most.saturating_sub(self.happenings.len()) }
    }

    /// The stops that are closed at a state.
    fn closed(&mut self, state: &MotionState) -> Result<Vec<usize>, AnalysisError> {
        let mut readings = vec![Reading::default(); self.plan.events.len()];
        self.functions.read(state, &mut readings)?;
        let mut closed = Vec::new();
        let count = &self.count;
        let over = |stop: &StopOf| count[stop.event] >= self.plan.events[stop.event].most;
        for (i, stop) in self.stops.iter().enumerate().filter(|x| !over(x.1)) {
            if stop.bounds == Bounds::Rate {
                closed.push(i);
                continue;
            }
            let gap = stop.side.sign * readings[stop.event].x;
            if gap < -tolerance::OPEN * stop.size {
                return Err(refuse(format!(
                    "at t = {} s the mechanism is beyond the stop of event \"{}\", by {}; start on its other side, or \
                     move the stop",
                    state.t,
                    self.plan.events[stop.event].name,
                    partita_math::formatted(-gap)
                )));
            }
            if gap <= tolerance::CLOSED_IN_RUN * stop.size {
                closed.push(i);
            }
        }
        Ok(closed)
    }

    /// Count what occurred, and note what only observes.
    fn note(&mut self, occurred: &[Occurrence]) {
        let known = self.count.len();
        for x in occurred.iter().filter(|x| x.event < known) {
            self.count[x.event] += 1;
            if self.plan.actions[x.event].is_empty() {
                self.happenings.push(Happening {
                    event: x.event,
                    kind: Kind::Crossing,
                    rises: x.rises,
                    before: x.state.clone(),
                    after: x.state.v.clone(),
                    impulses: Vec::new(),
                    joints: Vec::new(),
                    energy_lost: 0.0,
                });
            }
        }
    }

    /// Whether one of these events ends the run.
    fn ends(&self, occurred: &[Occurrence]) -> bool {
        let own = occurred.iter().filter(|x| x.event < self.count.len());
        own.into_iter().any(|x| self.plan.events[x.event].last == Some(self.count[x.event]))
    }

    /// The last events, in words.
    fn latest(&self) -> String {
        let words = self.happenings.iter().rev().take(4).rev();
        let words = words.map(|x| format!("\"{}\" ({})", self.plan.events[x.event].name, x.kind.word()));
        words.collect::<Vec<_>>().join(", ")
    }

    /// These actions, with what they decide at a state in the place of each decision.
    fn decided(&self, actions: &[Action], at: &MotionState) -> Result<Vec<Action>, AnalysisError> {
        let mut all = Vec::with_capacity(actions.len());
        for action in actions {
            match action {
                Action::Decide(i) => all.extend(self.plan.decisions.decide(*i, at)?),
                other => all.push(other.clone()),
            }
        }
        Ok(all)
    }

    /// Carry out actions at a state: the next mode and the velocities there.
    fn change(
        &mut self,
        mode: &Mode,
        before: &Output,
        occurred: &[Occurrence],
    ) -> Result<(Mode, Vec<f64>, f64), AnalysisError> {
        let t = before.t;
        let q: Vec<f64> = before.q.iter().zip(&before.turns).map(|(q, n)| turns::whole(*q, *n)).collect();
        let mut next = mode.clone();
        let mut set: Vec<(usize, f64)> = Vec::new();
        let mut done: Vec<(usize, bool, Kind)> = Vec::new();
        // an event that holds several coordinates does one thing
        let mut note = |event: usize, rises: bool, kind: Kind| {
            if !done.contains(&(event, rises, kind)) {
                done.push((event, rises, kind));
            }
        };
        let (v, vdot) = (before.v.clone(), vec![0.0; before.v.len()]);
        let state = MotionState { t, q: q.clone(), v, vdot, multipliers: Vec::new() };
        for x in occurred {
            let Some(actions) = self.plan.actions.get(x.event) else { continue };
            for action in self.decided(actions, &state)? {
                match &action {
                    Action::Lock(name) => {
                        if next.locked.insert(name.clone()) {
                            note(x.event, x.rises, Kind::Lock);
                        }
                    }
                    Action::Release(name) => {
                        if next.locked.remove(name) {
                            note(x.event, x.rises, Kind::Release);
                        }
                    }
                    Action::Part(joint) => {
                        if next.whole.parted.insert(joint.clone()) {
                            note(x.event, x.rises, Kind::Release);
                        }
                    }
                    Action::Rates(rates) => {
                        for (name, rate) in rates {
                            let row = self.rows.get(name).copied();
                            let row = row.ok_or_else(|| refuse(format!("there is no drive \"{name}\"")))?;
                            set.push((row, *rate));
                        }
                        note(x.event, x.rises, Kind::Rates);
                    }
                    Action::Inputs(values) => {
                        let bits = values.iter().map(|(i, value)| (*i, value.to_bits()));
                        next.whole.inputs.extend(bits);
                        note(x.event, x.rises, Kind::Input);
                    }
                    Action::Stop { .. } | Action::Freewheel { .. } | Action::Friction { .. } | Action::Decide(_) => {}
                }
            }
        }
        let closed = self.closed(&state)?;
        let whole = self.whole(&next.whole)?;
        let rows = self.plan.model.rows_of(&whole);
        let always: Vec<usize> = self.always.iter().copied().filter(|x| rows.contains(x)).collect();
        if next.whole.parted != mode.whole.parted {
            check_spins(&*self.whole(&mode.whole)?, &whole, (t, &q, &before.v))?;
        }
        let acting = Acting { model: &whole, rows: &rows, count: self.plan.model.size().rows, always: &always };
        let impact = Impact::new(&acting, t, &q, &before.v)?;
        let mut held: Vec<(usize, f64)> = always.iter().map(|&row| (row, 0.0)).collect();
        held.extend(next.locked.iter().filter_map(|name| self.rows.get(name)).map(|&row| (row, 0.0)));
        let own = self.own(mode);
        let passed = occurred.iter().filter_map(|x| x.event.checked_sub(self.plan.events.len()));
        let passed: Vec<Own> = passed.filter_map(|i| own.get(i).copied()).collect();
        let Settled { reached, pressing, frictions, accumulated } =
            self.settled((&acting, t, &q), &impact, (&held, &set), (&closed, &passed), (mode, occurred))?;
        let Reached { v, multipliers, energy } = reached;
        for &i in &closed {
            let stop = &self.stops[i];
            let rises = stop.side.sign < 0.0;
            let closes = impact.rate(stop.side) < -tolerance::SOLUTION_ROUNDING * impact.fastest(stop.side);
            let changes = (mode.pressing.contains(&i), pressing.contains(&i));
            match (stop.bounds, changes) {
                (Bounds::Position, _) if closes => done.push((stop.event, rises, Kind::Impact)),
                // how it is at the start is no event, unless velocities jump
                (Bounds::Rate, (false, true)) if closes || !occurred.is_empty() => {
                    done.push((stop.event, rises, Kind::Lock));
                }
                (Bounds::Rate, (true, false)) => done.push((stop.event, !rises, Kind::Release)),
                _ => {}
            }
            match (stop.bounds, changes) {
                (Bounds::Position, (false, true)) => done.push((stop.event, rises, Kind::Rest)),
                (Bounds::Position, (true, false)) => done.push((stop.event, !rises, Kind::LiftOff)),
                _ => {}
            }
        }
        next.pressing = pressing;
        for (i, (from, to)) in mode.frictions.iter().zip(&frictions).enumerate() {
            let (event, rises) = (self.frictions[i].event, from.sign().max(to.sign()) > 0);
            match (from, to) {
                _ if occurred.is_empty() => {}
                (StickSlip::Slips(_), StickSlip::Sticks | StickSlip::Rests(_)) => {
                    done.push((event, from.sign() < 0, Kind::Stick))
                }
                (_, StickSlip::Slips(_)) if from != to => done.push((event, rises, Kind::Slip)),
                _ => {}
            }
        }
        next.frictions = frictions;
        let moved = |(a, b): (&f64, &f64)| (a - b).abs() > tolerance::ROUNDING * a.abs().max(b.abs());
        let jumps = v.iter().zip(&before.v).any(moved);
        let (v, mut lost, impulses) = match jumps {
            true => (v, -energy, multipliers),
            false => (before.v.clone(), 0.0, Vec::new()),
        };
        let energy = -lost;
        let dv: Vec<f64> = v.iter().zip(&before.v).map(|(after, before)| after - before).collect();
        let along: Vec<f64> = if jumps { rows.iter().map(|&row| impulses[row]).collect() } else { Vec::new() };
        let joints = if jumps { of_joints(&whole, (t, &q), &dv, &along)? } else { Vec::new() };
        for (event, rises, kind) in done {
            let own = matches!(kind, Kind::Impact | Kind::Lock | Kind::Rates);
            let impulses = if own { impulses.clone() } else { Vec::new() };
            let joints = if own { joints.clone() } else { Vec::new() };
            let energy_lost = if own { std::mem::take(&mut lost) } else { 0.0 };
            let (before, after) = (before.clone(), v.clone());
            self.happenings.push(Happening { event, kind, rises, before, after, impulses, joints, energy_lost });
        }
        if let Some((i, rest)) = accumulated {
            let mut at = Output { v: v.clone(), ..before.clone() };
            at.t += rest;
            self.happenings.push(Happening {
                event: self.stops[i].event,
                kind: Kind::Accumulation,
                rises: self.stops[i].side.sign < 0.0,
                before: at,
                after: v.clone(),
                impulses: Vec::new(),
                joints: Vec::new(),
                energy_lost: 0.0,
            });
        }
        Ok((next, v, energy))
    }

    /// Velocities after an instant, and the stops that press and the frictions that stick from there on; `held` are rows
    /// with their rates and `set` those of this instant alone, `passed` what has just ceased to last.
    fn settled(
        &self,
        (acting, t, q): (&Acting, f64, &[f64]),
        impact: &Impact,
        (held, set): (&Rates, &Rates),
        (closed, passed): (&[usize], &[Own]),
        (mode, occurred): (&Mode, &[Occurrence]),
    ) -> Result<Settled, AnalysisError> {
        let mut sides: Vec<OneSided> = closed.iter().map(|&i| self.stops[i].side).collect();
        let mut stays = vec![false; sides.len()];
        let rows: Vec<usize> = held.iter().map(|x| x.0).collect();
        let mut accumulated = None;
        loop {
            let reached = impact.velocities(held, set, &sides)?;
            let after = Impact::new(acting, t, q, &reached.v)?;
            for (stays, side) in stays.iter_mut().zip(&sides) {
                *stays |= after.rate(*side) <= tolerance::EQUAL * after.fastest(*side);
            }
            let resting: Vec<OneSided> = sides.iter().zip(&stays).filter(|x| *x.1).map(|x| *x.0).collect();
            let still = |i: usize| {
                let x = &self.frictions[i];
                let side = x.side();
                let (rate, fastest) = (after.rate(side), after.fastest(side).max(impact.fastest(side)));
                let small = tolerance::EQUAL * fastest;
                // it has just come to rest, and nothing has moved it since
                let stopped = occurred.iter().any(|o| o.event == x.event) && (rate - impact.rate(side)).abs() <= small;
                stopped || rate.abs() <= small.max(RATE_AT_REST * x.size)
            };
            let still: Vec<bool> = (0..self.frictions.len()).map(still).collect();
            let before = (&mode.frictions[..], passed);
            let (frictions, pushed) =
                self.rubbed((acting, t, q, &reached.v), (&after, &still), (&rows, &resting), before)?;
            // one that comes back at once, and hardly leaves, stays
            let low = |&i: &usize| {
                let (side, stop) = (sides[i], &self.stops[closed[i]]);
                let (rate, growth) = (after.rate(side), after.growth(side, &pushed.v));
                let height = -0.5 * rate * rate / growth;
                let bounces = stop.bounds == Bounds::Position && !stays[i];
                bounces && growth < 0.0 && height <= tolerance::CLOSED * stop.size
            };
            let fallen: Vec<usize> = (0..sides.len()).filter(low).collect();
            if fallen.is_empty() {
                let presses = |&i: &usize| {
                    let still = tolerance::EQUAL * after.strongest(sides[i]);
                    let force = after.contact_acceleration(sides[i], &pushed);
                    let least = if passed.contains(&Own::Press(closed[i])) { still } else { 0.0 };
                    stays[i] && after.growth(sides[i], &pushed.v) <= still && force >= least
                };
                let pressing = (0..sides.len()).filter(presses).map(|i| closed[i]).collect();
                return Ok(Settled { reached, pressing, frictions, accumulated });
            }
            for i in fallen {
                let side = sides[i];
                if 0.0 < side.restitution && side.restitution < 1.0 {
                    let next = -2.0 * after.rate(side) / after.growth(side, &pushed.v);
                    let tail = next / (1.0 - side.restitution);
                    accumulated = accumulated.or((t + tail > t).then_some((closed[i], tail)));
                }
                (stays[i], sides[i].restitution) = (true, 0.0);
            }
        }
    }

    /// How the frictions act at (t, q, v), and the accelerations there. Those that move slip. Of those at rest all that do
    /// not carry as much as they can stick to begin with; the first one that would have to carry too much slips, the first one that would slip against its force
    /// sticks, until none is left (for equal magnitudes at rest and in motion the rule of the least index, which ends).
    fn rubbed(
        &self,
        (acting, t, q, v): (&Acting, f64, &[f64], &[f64]),
        (after, still): (&Impact, &[bool]),
        (rows, resting): (&[usize], &[OneSided]),
        (before, passed): (&[StickSlip], &[Own]),
    ) -> Result<(Vec<StickSlip>, Reached), AnalysisError> {
        let count = self.frictions.len();
        if count == 0 {
            return Ok((Vec::new(), after.accelerations(rows, resting, &[])?));
        }
        let level = |x: &FrictionOf| acting.model.friction_levels(x.force, t, (q, v));
        let levels = self.frictions.iter().map(level).collect::<Result<Vec<_>, _>>()?;
        let levels: Vec<[f64; 2]> = levels.into_iter().map(Option::unwrap_or_default).collect();
        let side = |i: usize| self.frictions[i].side();
        let sense = |x: f64| if x > 0.0 { 1 } else { -1 };
        let bare = after.accelerations(rows, resting, &[])?;
        let mut acts = vec![StickSlip::Sticks; count];
        let mut decided = vec![false; count];
        for i in 0..count {
            let (rate, growth) = (after.rate(side(i)), after.growth(side(i), &bare.v));
            let moves = !still[i];
            let bound = after.follows(side(i).row, rows);
            let set_off = bound && growth.abs() > tolerance::EQUAL * after.strongest(side(i));
            let led = passed.iter().find_map(|x| match x {
                Own::Slip(k, sign) if *k == i => Some(*sign),
                _ => None,
            });
            (acts[i], decided[i]) = match (moves, set_off, led) {
                (true, ..) => (StickSlip::Slips(sense(rate)), true),
                (_, true, _) => (StickSlip::Slips(sense(growth)), true),
                (.., Some(sign)) => (StickSlip::Slips(sign), bound),
                _ if bound => (StickSlip::Rests(0), true),
                _ => match before[i] {
                    // as large as it can be, which it may be still
                    StickSlip::Rests(sign) if sign != 0 => (StickSlip::Slips(sign), false),
                    _ => (StickSlip::Sticks, false),
                },
            };
        }
        for _ in 0..MOST_FLIPS {
            let mut held = rows.to_vec();
            let mut applied = Vec::new();
            let mut now = acts.clone();
            for i in 0..count {
                let row = side(i).row;
                match acts[i] {
                    StickSlip::Sticks if after.follows(row, &held) => now[i] = StickSlip::Rests(0),
                    StickSlip::Sticks => held.push(row),
                    StickSlip::Slips(sign) | StickSlip::Rests(sign) => {
                        applied.push((row, -f64::from(sign) * levels[i][0]))
                    }
                }
            }
            let pushed = after.accelerations(&held, resting, &applied)?;
            let flip = (0..count).filter(|&i| !decided[i]).find_map(|i| match now[i] {
                StickSlip::Sticks => {
                    let carried = pushed.multipliers[side(i).row];
                    let over = carried.abs() > levels[i][1] * (1.0 + tolerance::EQUAL);
                    over.then(|| (i, StickSlip::Slips(-sense(carried))))
                }
                StickSlip::Slips(sign) if !after.follows(side(i).row, &held) => {
                    let still = tolerance::EQUAL * after.strongest(side(i));
                    let against = f64::from(sign) * after.growth(side(i), &pushed.v) < -still;
                    against.then_some((i, StickSlip::Sticks))
                }
                _ => None,
            });
            if let Some((i, to)) = flip {
                acts[i] = to;
                continue;
            }
            for i in (0..count).filter(|&i| !decided[i]) {
                if let (StickSlip::Slips(sign), true) = (now[i], after.follows(side(i).row, &held)) {
                    now[i] = StickSlip::Rests(sign);
                }
            }
            return Ok((now, pushed));
        }
        let names: Vec<&str> = self.frictions.iter().map(|x| &*x.name).collect();
        Err(refuse(format!(
            "at t = {t} s it cannot be decided which of the frictions stick ({}): their magnitudes at rest exceed those in \
             motion so far that none of the combinations holds; make them more alike",
            names.join(", ")
        )))
    }
}

/// What follows from an instant.
struct Settled {
    reached: Reached,
    /// The stops that press.
    pressing: BTreeSet<usize>,
    /// How the frictions act.
    frictions: Vec<StickSlip>,
    /// One whose infinitely many impacts are over so soon.
    accumulated: Option<(usize, f64)>,
}

/// Integrate a mechanism whose events act.
///
/// # Errors
/// See [`run`](super::run()); where a later segment cannot begin the run ends there instead.
pub fn in_segments(
    plan: &Plan,
    functions: Box<dyn EventFunctions>,
    request: &Request,
    t_eval: &[f64],
    (q, v): (&[f64], &[f64]),
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Segments, AnalysisError> {
    let (mut maker, mode) = Maker::new(plan, functions, (request.t0, request.t_end))?;
    let zero = vec![0; q.len()];
    let mut now = Output { t: request.t0, q: q.to_vec(), v: v.to_vec(), turns: zero, ..Output::default() };
    let (mut mode, first, energy) = maker.change(&mode, &now, &[])?;
    now.v = first;
    let (mut work, mut bytes, mut at_once, mut exchanged) = (energy, request.step_bytes, 0, 0.0);
    let mut all: Vec<Segment> = Vec::new();
    loop {
        let own = Request { t0: now.t, step_bytes: bytes, exchanged_before: exchanged, ..request.clone() };
        let times = &t_eval[t_eval.partition_point(|t| *t < now.t)..];
        let mut segment = match maker.segment(&mode, &own, times, &now, watch) {
            Ok(segment) => segment,
            Err(error) => return stopped(all, maker.happenings, now.t, error),
        };
        let run = &mut segment.run;
        exchanged += run.exchanged;
        bytes = bytes.saturating_sub(run.log.steps.as_ref().map_or(0, |steps| steps.0.bytes()));
        run.log.outputs.iter_mut().for_each(|x| x.work += work);
        run.occurrences.iter_mut().for_each(|x| x.state.work += work);
        maker.note(&run.occurrences);
        let last = run.occurrences.last().map(|x| x.state.clone());
        let Some(last) = last.filter(|_| run.outcome.status == Status::Event) else {
            all.push(segment);
            return Ok(Segments::new(all, maker.happenings));
        };
        let occurred: Vec<Occurrence> = run.occurrences.iter().filter(|x| x.state.t == last.t).cloned().collect();
        let changed = maker.change(&mode, &last, &occurred);
        let ends = maker.ends(&occurred);
        let over = ends || request.t_end - last.t <= tolerance::SUM_ROUNDING * request.t_end.abs();
        if let (Ok((_, after, _)), false) = (&changed, ends) {
            // an output at that instant is the state after it
            run.log.outputs.retain(|x| x.t < last.t);
            let late = if over { t_eval.partition_point(|t| *t < last.t) } else { t_eval.len() };
            let at_the_end = |&t: &f64| Output { t, v: after.clone(), ..last.clone() };
            run.log.outputs.extend(t_eval[late..].iter().map(at_the_end));
        }
        all.push(segment);
        let (next, after, energy) = match changed {
            Ok(changed) => changed,
            Err(error) => return stopped(all, maker.happenings, last.t, error),
        };
        if over {
            return Ok(Segments::new(all, maker.happenings));
        }
        at_once = if last.t == now.t { at_once + 1 } else { 0 };
        if at_once > MOST_AT_ONCE {
            let message = format!(
                "events change what holds without end: {}; let one of them act only once (once=True), or in one direction",
                maker.latest()
            );
            return stopped(all, maker.happenings, last.t, refuse(message));
        }
        work = last.work + energy;
        let whole = last.q.iter().zip(&last.turns).map(|(q, n)| turns::whole(*q, *n)).collect();
        now = Output { t: last.t, q: whole, v: after, ..Output::default() };
        mode = next;
    }
}

/// A run that cannot go on at t.
fn stopped(
    mut all: Vec<Segment>,
    happenings: Vec<Happening>,
    t: f64,
    error: AnalysisError,
) -> Result<Segments, AnalysisError> {
    let Some(last) = all.last_mut() else { return Err(error) };
    let outcome = &mut last.run.outcome;
    (outcome.status, outcome.message) = (Status::EvaluationFailed, format!("stopped at t = {t:.6} s: {error}"));
    if let AnalysisError::System(error) = error {
        outcome.error = Some(error);
    }
    Ok(Segments::new(all, happenings))
}
