//! The whole of a run while it is made: models of modes, and segments in them.

use super::follow::{Following, Largest, Lasts, Shared, WithContacts};
use super::mode::{Bounds, FrictionOf, Mode, Own, StickSlip, StopOf, Whole, RATE_AT_REST};
use super::{Action, Cause, Happening, Kind, Plan, Segment, Slipping, Transition};
use crate::error::AnalysisError;
use crate::run::impact::OneSided;
use crate::run::{Request, Run};
use partita_integrate::simulate::Observe;
use partita_math::tolerance;
use partita_model::Model;
use partita_system::event::{Event, EventFunctions, MotionState, Occurrence};
use partita_system::prelude::*;
use partita_system::record::Output;
use partita_system::watched::Reading;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::ControlFlow;
use std::sync::{Arc, Mutex};

/// Models of modes that are kept. Reason: a mechanism has a few modes; inputs that are set anew at each event make as many as
/// there are events.
const MOST_KEPT: usize = 64;

/// When an effort that events set acts. Unit: seconds. Reason: no motion lasts so long, and its cube is a number.
const ALL_TIMES: [f64; 2] = [-1e15, 1e15];

/// The whole of a run while it is made.
pub(super) struct Maker {
    pub(super) plan: Arc<Plan>,
    pub(super) functions: Shared,
    pub(super) stops: Vec<StopOf>,
    pub(super) frictions: Vec<FrictionOf>,
    /// Rows of the whole mechanism by the names of drives.
    pub(super) rows: BTreeMap<String, usize>,
    /// Rows that always act.
    pub(super) always: Vec<usize>,
    /// Models of modes that acted before.
    pub(super) models: BTreeMap<Mode, (Arc<Model>, Vec<usize>)>,
    /// With all drives.
    pub(super) wholes: BTreeMap<Whole, Arc<Model>>,
    /// How often each event has occurred.
    pub(super) count: Vec<u64>,
    pub(super) happenings: Vec<Happening>,
    /// The last one.
    pub(super) transition: Option<Transition>,
}

pub(super) fn refuse(message: String) -> AnalysisError {
    AnalysisError::Argument { argument: "events", message }
}

impl Maker {
    pub(super) fn new(plan: Arc<Plan>, functions: Box<dyn EventFunctions>) -> Result<(Self, Mode), AnalysisError> {
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
                    let size = size(drive);
                    let side = OneSided { row: known(drive)?, sign, restitution, slow: RATE_AT_REST * size };
                    stops.push(StopOf { event, drive: drive.clone(), side, size, bounds });
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
        let mode = Mode { locked, frictions: resting, whole, ..Mode::default() };
        let (models, wholes) = (BTreeMap::new(), BTreeMap::new());
        let (happenings, count) = (Vec::new(), vec![0; plan.events.len()]);
        let transition = None;
        let made =
            Self { plan, functions, stops, frictions, rows, always, models, wholes, count, happenings, transition };
        Ok((made, mode))
    }

    /// The mechanism with all drives, without the joints that are apart, and with its inputs. Made once.
    pub(super) fn whole(&mut self, what: &Whole) -> Result<Arc<Model>, AnalysisError> {
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
            made = Arc::new(made.with_efforts(&efforts.collect::<Vec<_>>(), ALL_TIMES)?);
        }
        if self.wholes.len() >= MOST_KEPT {
            self.wholes.clear();
        }
        self.wholes.insert(what.clone(), made.clone());
        Ok(made)
    }

    /// The mechanism in a mode, and the row of the whole one that each of its rows is. Made once.
    pub(super) fn model(&mut self, mode: &Mode) -> Result<(Arc<Model>, Vec<usize>), AnalysisError> {
        if let Some(found) = self.models.get(mode) {
            return Ok(found.clone());
        }
        let whole = self.whole(&mode.whole)?;
        let pressing: BTreeSet<&String> = mode.pressing.iter().map(|&i| &self.stops[i].drive).collect();
        let rubbing = || self.frictions.iter().zip(&mode.frictions);
        let sticks = |name: &str| rubbing().any(|(x, state)| *state == StickSlip::Sticks && x.drive == name);
        let acts = |name: &str| {
            let switched = self.plan.switched.iter().any(|x| x == name);
            !switched || mode.locked.contains(name) || pressing.contains(&name.to_owned()) || sticks(name)
        };
        let slips = |name: &str| rubbing().find(|x| x.0.name == name).map_or([0.0; 2], |x| x.1.signs());
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
    pub(super) fn segment(
        &mut self,
        mode: &Mode,
        request: &Request,
        times: &[f64],
        now: &Output,
        watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Segment, AnalysisError> {
        let (whole, (model, _)) = (self.whole(&mode.whole)?, self.model(mode)?);
        let observe = self.observe(mode, &whole, &model);
        let run = crate::run::observed(&*model, request, None, times, (&now.q, &now.v), Some(observe), watch)?;
        self.with_run(mode, run, now.clone())
    }

    /// The segment of a run in a mode.
    pub(super) fn with_run(&mut self, mode: &Mode, run: Run, start: Output) -> Result<Segment, AnalysisError> {
        let (whole, (model, rows)) = (self.whole(&mode.whole)?, self.model(mode)?);
        let rubbing = self.frictions.iter().zip(&mode.frictions).filter(|x| x.1.sign() != 0);
        let slips = rubbing.map(|(x, state)| Slipping { row: x.row, force: x.force, signs: state.signs() });
        Ok(Segment { start, transition: None, whole, model, rows, run, slips: slips.collect() })
    }

    /// What a mode follows beside the events, in the order of their numbers after those of the events.
    pub(super) fn own(&self, mode: &Mode) -> Vec<Own> {
        let presses = mode.pressing.iter().map(|&s| Own::Press(s));
        let rests = (0..self.frictions.len()).filter(|&i| !matches!(mode.frictions[i], StickSlip::Slips(_)));
        presses.chain(rests.flat_map(|i| [1, -1].map(|sign| Own::Slip(i, sign)))).collect()
    }

    /// Why a segment in this mode ended.
    pub(super) fn causes(&self, mode: &Mode, model: &Model, occurred: &[Occurrence]) -> Vec<Cause> {
        let own = self.own(mode);
        let row = |drive: &str| model.drives().iter().find(|d| d.name == drive).map_or(0, |d| d.row);
        let of = |x: &Occurrence| match x.event.checked_sub(self.plan.events.len()).map(|i| own.get(i)) {
            None => Some(Cause::Event(x.event)),
            Some(Some(Own::Press(stop))) => Some(Cause::Force(row(&self.stops[*stop].drive), None)),
            Some(Some(Own::Slip(i, sign))) => {
                let friction = &self.frictions[*i];
                Some(match mode.frictions[*i] {
                    StickSlip::Sticks => Cause::Force(row(&friction.drive), Some(friction.name.clone())),
                    _ => Cause::Passes(friction.event, f64::from(*sign) * RATE_AT_REST * friction.size),
                })
            }
            Some(None) => None,
        };
        occurred.iter().filter_map(of).collect()
    }

    /// What finds the events of a segment in a mode.
    pub(super) fn observe(&self, mode: &Mode, whole: &Arc<Model>, model: &Model) -> Observe {
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
                if mode.pressing.contains(&s) || mode.covered.contains(&s) {
                    event.most = 0; // its force is followed instead, or that of what holds it
                }
            }
            for (_, state) in self.frictions.iter().zip(&mode.frictions).filter(|x| x.0.event == i) {
                match state {
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
    pub(super) fn closed(&mut self, state: &MotionState) -> Result<Vec<usize>, AnalysisError> {
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
    pub(super) fn note(&mut self, occurred: &[Occurrence]) {
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
    pub(super) fn ends(&self, occurred: &[Occurrence]) -> bool {
        let own = occurred.iter().filter(|x| x.event < self.count.len());
        own.into_iter().any(|x| self.plan.events[x.event].last == Some(self.count[x.event]))
    }

    /// The last events, in words.
    pub(super) fn latest(&self) -> String {
        let words = self.happenings.iter().rev().take(4).rev();
        let words = words.map(|x| format!("\"{}\" ({})", self.plan.events[x.event].name, x.kind.word()));
        words.collect::<Vec<_>>().join(", ")
    }
}
