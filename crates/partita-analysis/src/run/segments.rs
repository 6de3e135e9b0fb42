//! Runs made of segments: between two of them velocities jump, or other rows act. Each segment is a run of its own of the
//! mechanism with the rows that act in it; all have the coordinates of the whole mechanism.

use super::impact::{Acting, Impact, OneSided, Rates, Reached};
use super::{Request, Run};
use crate::determined::determined;
use crate::error::AnalysisError;
use crate::outputs::{energies, reactions, Forces, States};
use partita_integrate::simulate::{Observe, Outcome, Status};
use partita_math::tolerance;
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

/// The force of a contact that is closed, positive while it presses.
#[derive(Clone, Debug)]
struct Pressing {
    row: usize,
    sign: f64,
    /// Time and force where the motion stands, and where they were read since.
    last: Option<(f64, f64)>,
    read: Vec<(f64, f64)>,
}

/// The functions of the events, and the forces of the contacts that are closed.
#[derive(Debug)]
struct WithContacts {
    inner: Shared,
    count: usize,
    contacts: Vec<Pressing>,
}

impl EventFunctions for WithContacts {
    fn read(&mut self, at: &MotionState, out: &mut [Reading]) -> Result<(), SystemError> {
        self.inner.read(at, &mut out[..self.count])?;
        for (x, out) in self.contacts.iter_mut().zip(&mut out[self.count..]) {
            let force = x.sign * at.multipliers[x.row];
            let rate = x.last.filter(|last| last.0 < at.t).map_or(0.0, |last| (force - last.1) / (at.t - last.0));
            x.read.push((at.t, force));
            *out = Reading { x: force, rate, terms: force.abs(), ..Reading::default() };
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
        !self.contacts.is_empty()
    }
}

/// A stop: its event, its row in the whole mechanism, its law, and the size of what it bounds.
#[derive(Clone, Debug)]
struct StopOf {
    event: usize,
    drive: String,
    side: OneSided,
    size: f64,
}

/// Which rows act.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
struct Mode {
    /// Drives that hold in both directions.
    locked: BTreeSet<String>,
    /// Stops that press, by their numbers.
    pressing: BTreeSet<usize>,
    /// Joints that are apart.
    parted: BTreeSet<String>,
}

/// The whole of a run while it is made.
struct Maker<'p> {
    plan: &'p Plan,
    functions: Shared,
    stops: Vec<StopOf>,
    /// Rows of the whole mechanism by the names of drives.
    rows: BTreeMap<String, usize>,
    /// Rows that always act.
    always: Vec<usize>,
    /// Models of modes that acted before.
    models: BTreeMap<Mode, (Arc<Model>, Vec<usize>)>,
    /// With all drives, by the joints that are apart.
    wholes: BTreeMap<BTreeSet<String>, Arc<Model>>,
    /// How often each event has occurred.
    count: Vec<u64>,
    happenings: Vec<Happening>,
}

fn refuse(message: String) -> AnalysisError {
    AnalysisError::Argument { argument: "events", message }
}

impl<'p> Maker<'p> {
    fn new(plan: &'p Plan, functions: Box<dyn EventFunctions>) -> Result<(Self, Mode), AnalysisError> {
        let functions = Shared(Arc::new(Mutex::new(functions)));
        let rows: BTreeMap<String, usize> =
            plan.model.drives().iter().map(|drive| (drive.name.clone(), drive.row)).collect();
        let switched: BTreeSet<usize> = plan.switched.iter().filter_map(|name| rows.get(name).copied()).collect();
        let always = (0..plan.model.size().rows).filter(|row| !switched.contains(row)).collect();
        let known = |name: &String| {
            let row = rows.get(name).copied();
            row.ok_or_else(|| refuse(format!("there is no drive \"{name}\" that an event could hold")))
        };
        let mut stops = Vec::new();
        for (event, actions) in plan.actions.iter().enumerate() {
            for action in actions {
                if let Action::Stop { drive, sign, restitution } = action {
                    let side = OneSided { row: known(drive)?, sign: *sign, restitution: *restitution };
                    let measured = plan.model.spec.drives.iter().find(|x| x.name == *drive);
                    let size = measured.map_or(1.0, |x| plan.model.natural_size(&x.measure));
                    stops.push(StopOf { event, drive: drive.clone(), side, size });
                }
            }
        }
        let [locked, parted] = [&plan.locked, &plan.parted].map(|names| names.iter().cloned().collect());
        let mode = Mode { locked, pressing: BTreeSet::new(), parted };
        let (models, happenings, count) = (BTreeMap::new(), Vec::new(), vec![0; plan.events.len()]);
        let wholes = BTreeMap::from([(BTreeSet::new(), plan.model.clone())]);
        Ok((Self { plan, functions, stops, rows, always, models, wholes, count, happenings }, mode))
    }

    /// The mechanism with all drives, without the joints that are apart. Made once.
    fn whole(&mut self, parted: &BTreeSet<String>) -> Result<Arc<Model>, AnalysisError> {
        if let Some(found) = self.wholes.get(parted) {
            return Ok(found.clone());
        }
        let made = Arc::new(self.plan.model.parted(parted)?);
        self.wholes.insert(parted.clone(), made.clone());
        Ok(made)
    }

    /// The mechanism in a mode, and the row of the whole one that each of its rows is. Made once.
    fn model(&mut self, mode: &Mode) -> Result<(Arc<Model>, Vec<usize>), AnalysisError> {
        if let Some(found) = self.models.get(mode) {
            return Ok(found.clone());
        }
        let whole = self.whole(&mode.parted)?;
        let pressing: BTreeSet<&String> = mode.pressing.iter().map(|&i| &self.stops[i].drive).collect();
        let acts = |name: &str| {
            let switched = self.plan.switched.iter().any(|x| x == name);
            !switched || mode.locked.contains(name) || pressing.contains(&name.to_owned())
        };
        let made = Arc::new(whole.with_drives(&acts)?);
        let rows = self.plan.model.rows_of(&made);
        let found = (made, rows);
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
        let (whole, (model, rows)) = (self.whole(&mode.parted)?, self.model(mode)?);
        let observe = self.observe(mode, &model);
        let run = super::observed(&*model, request, None, times, (&now.q, &now.v), Some(observe), watch)?;
        Ok(Segment { whole, model, rows, run })
    }

    /// What finds the events of a segment in a mode.
    fn observe(&self, mode: &Mode, model: &Model) -> Observe {
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
            events.push(event);
        }
        let count = events.len();
        let mut contacts = Vec::new();
        for &s in &mode.pressing {
            let stop = &self.stops[s];
            let row = model.drives().iter().find(|d| d.name == stop.drive).map_or(0, |d| d.row);
            contacts.push(Pressing { row, sign: stop.side.sign, last: None, read: Vec::new() });
            let name = format!("{} opens", self.plan.events[stop.event].name);
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
        for x in occurred {
            let Some(actions) = self.plan.actions.get(x.event) else { continue };
            for action in actions {
                match action {
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
                        if next.parted.insert(joint.clone()) {
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
                    Action::Stop { .. } => {}
                }
            }
        }
        let (v, vdot) = (before.v.clone(), vec![0.0; before.v.len()]);
        let state = MotionState { t, q: q.clone(), v, vdot, multipliers: Vec::new() };
        let closed = self.closed(&state)?;
        let whole = self.whole(&next.parted)?;
        let rows = self.plan.model.rows_of(&whole);
        let always: Vec<usize> = self.always.iter().copied().filter(|x| rows.contains(x)).collect();
        if next.parted != mode.parted {
            check_spins(&*self.whole(&mode.parted)?, &whole, (t, &q, &before.v))?;
        }
        let acting = Acting { model: &whole, rows: &rows, count: self.plan.model.size().rows, always: &always };
        let impact = Impact::new(&acting, t, &q, &before.v)?;
        let mut held: Vec<(usize, f64)> = always.iter().map(|&row| (row, 0.0)).collect();
        held.extend(next.locked.iter().filter_map(|name| self.rows.get(name)).map(|&row| (row, 0.0)));
        // contacts whose own force passes zero
        let own = occurred.iter().filter_map(|x| x.event.checked_sub(self.plan.events.len()));
        let opening: BTreeSet<usize> = own.filter_map(|i| mode.pressing.iter().nth(i).copied()).collect();
        let Settled { reached, pressing, accumulated } =
            self.settled((&acting, t, &q), &impact, (&held, &set), (&closed, &opening))?;
        let Reached { v, multipliers, energy } = reached;
        for &i in &closed {
            let stop = &self.stops[i];
            let rises = stop.side.sign < 0.0;
            if impact.rate(stop.side) < -tolerance::SOLUTION_ROUNDING * impact.fastest(stop.side) {
                done.push((stop.event, rises, Kind::Impact));
            }
            match (mode.pressing.contains(&i), pressing.contains(&i)) {
                (false, true) => done.push((stop.event, rises, Kind::Rest)),
                (true, false) => done.push((stop.event, !rises, Kind::LiftOff)),
                _ => {}
            }
        }
        next.pressing = pressing;
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

    /// Velocities after an instant and the stops that press from there on; `held` are rows with their rates and `set`
    /// those of this instant alone, `opening` the closed stops whose force has just passed zero.
    fn settled(
        &self,
        (acting, t, q): (&Acting, f64, &[f64]),
        impact: &Impact,
        (held, set): (&Rates, &Rates),
        (closed, opening): (&[usize], &BTreeSet<usize>),
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
            let pushed = after.accelerations(&rows, &resting)?;
            // one that comes back at once, and hardly leaves, stays
            let low = |&i: &usize| {
                let (side, size) = (sides[i], self.stops[closed[i]].size);
                let (rate, growth) = (after.rate(side), after.growth(side, &pushed.v));
                let height = -0.5 * rate * rate / growth;
                !stays[i] && growth < 0.0 && height <= tolerance::CLOSED * size
            };
            let fallen: Vec<usize> = (0..sides.len()).filter(low).collect();
            if fallen.is_empty() {
                let presses = |&i: &usize| {
                    let still = tolerance::EQUAL * after.strongest(sides[i]);
                    let force = after.pushes(sides[i], &pushed);
                    let least = if opening.contains(&closed[i]) { still } else { 0.0 };
                    stays[i] && after.growth(sides[i], &pushed.v) <= still && force >= least
                };
                let pressing = (0..sides.len()).filter(presses).map(|i| closed[i]).collect();
                return Ok(Settled { reached, pressing, accumulated });
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
}

/// What follows from an instant.
struct Settled {
    reached: Reached,
    /// The stops that press.
    pressing: BTreeSet<usize>,
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
    let (mut maker, mode) = Maker::new(plan, functions)?;
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
