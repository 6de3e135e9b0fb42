//! Runs made of segments, for Python.

use crate::arrays::entries_of;
use crate::events::{EventList, Events};
use crate::failure;
use crate::functions::Callables;
use crate::outputs::{assessed, described, watched};
use crate::run::{carried_out, reported, whole, Account, Ended, Read, Reported, RunLog, Stopping};
use numpy::PyReadonlyArray1;
use partita_analysis::run::segments::{
    in_segments, spread, Action, Cause, Decisions, Happening, Plan, Segment, Segments, Slipping, Transition, WrittenPlan,
};
use partita_analysis::error::AnalysisError;
use partita_analysis::sensitivity::{Instant, Jump, Leg, Reason, Time};
use partita_analysis::run::{Assessed, Balance, Described, Finding, Request, SolutionLog};
use partita_integrate::counters::Counters;
use partita_integrate::march::StepReader;
use partita_integrate::simulate::Observe;
use partita_integrate::step_log::StepLog;
use partita_model::event_functions::Formula;
use partita_model::Model;
use partita_system::event::{EventFunctions, MotionState};
use partita_system::prelude::*;
use partita_system::record::{FormulationCounters, Gaps, Output};
use partita_system::{Size, SystemError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use std::sync::Arc;

/// Functions that decide, with the names of their events.
pub type DecisionList = Vec<(String, Py<PyAny>)>;

/// Decisions that Python functions of (t, q, v) take, each the text of a list of actions, and the names of their events.
struct Deciding(Vec<String>, Callables);

impl Decisions for Deciding {
    fn decide(&self, i: usize, at: &MotionState) -> Result<Vec<Action>, SystemError> {
        let failed = |source| SystemError::Function { what: format!("event \"{}\"", self.0[i]), source };
        let text: String = self.1.call(i, at.t, &at.q, &at.v, |x| x.extract()).map_err(failed)?;
        serde_json::from_str(&text).map_err(|e| failed(Box::new(e)))
    }
}

/// A segment with what describes its outputs.
struct Part {
    start: Output,
    transition: Option<Transition>,
    whole: Arc<Model>,
    run: RunLog<Model>,
    rows: Vec<usize>,
    slips: Vec<Slipping>,
}

/// The segments of a run, of a mechanism with all rows.
struct SegmentsLog {
    whole: Arc<Model>,
    parts: Vec<Part>,
    shared: bool,
    /// What the events follow, by name.
    formulas: Vec<(String, Formula)>,
}

impl SegmentsLog {
    fn outputs(&self) -> impl Iterator<Item = &Output> {
        self.parts.iter().flat_map(|part| &part.run.log.outputs)
    }

    fn count(&self) -> usize {
        self.outputs().count()
    }

    /// What happens between two parts, for derivatives.
    fn jump(&self, of: &Transition) -> Result<Jump, AnalysisError> {
        let named = |event: usize| -> Result<(String, Formula), AnalysisError> {
            let none = || SystemError::argument("run", "an event of this run is not known any more".into());
            Ok(self.formulas.get(event).cloned().ok_or_else(none)?)
        };
        let cause = |cause: &Cause| {
            Ok(match cause {
                Cause::Event(event) => {
                    let (name, formula) = named(*event)?;
                    (name, Reason::Zero(formula))
                }
                Cause::Force(row, friction) => {
                    (friction.clone().unwrap_or_else(|| "contact".into()), Reason::Force(*row))
                }
                Cause::Passes(event, value) => {
                    let (name, formula) = named(*event)?;
                    (name, Reason::Zero(Formula::Sum(vec![formula, Formula::Number(-value)])))
                }
            })
        };
        let causes = of.causes.iter().map(cause).collect::<Result<_, AnalysisError>>()?;
        Ok(Jump { whole: of.whole.clone(), causes, laws: of.laws.clone() })
    }
}

impl Reported for SegmentsLog {
    fn describe<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let size = self.whole.size();
        let mut all = Vec::with_capacity(self.parts.len());
        let mut findings: Vec<Finding> = Vec::new();
        for part in &self.parts {
            let (log, system) = (&part.run.log, &part.run.system);
            let found = watched(py, |watch| log.describe::<Model>(system, self.shared, watch))?;
            findings.extend(log.judge(&**system, &found));
            all.push(found);
        }
        let k = all.iter().map(|x| x.k).max().unwrap_or(0);
        let mut one = Described {
            vdot: Vec::new(),
            multipliers: Vec::new(),
            independent: Vec::new(),
            closure: Vec::new(),
            velocity_closure: Vec::new(),
            k,
            notes: Vec::new(),
            gaps: Gaps::default(),
        };
        for (part, found) in self.parts.iter().zip(all) {
            let (nt, own) = (part.run.log.outputs.len(), part.rows.len());
            one.vdot.extend(found.vdot);
            for i in 0..nt {
                let from = &found.multipliers[i * own..(i + 1) * own];
                let rows = (&part.rows[..], size.rows);
                let row = spread(&part.whole, rows, &part.slips, (&part.run.log.outputs[i], from));
                one.multipliers.extend(row.map_err(|e| failure::system(py, e))?);
                one.independent.extend_from_slice(&found.independent[i * found.k..(i + 1) * found.k]);
                one.independent.extend((found.k..k).map(|_| f64::NAN));
            }
            one.closure.extend(found.closure);
            one.velocity_closure.extend(found.velocity_closure);
            one.notes.extend(found.notes);
        }
        let d = described(py, self.count(), size, one)?;
        d.set_item("findings", reported(&findings))?;
        Ok(d)
    }
    fn assess<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let mut one = Assessed { measure: Vec::new(), sigma: Vec::new(), sqrt_mu: Vec::new(), selector: Vec::new() };
        for part in &self.parts {
            let (log, system) = (&part.run.log, &part.run.system);
            let found = watched(py, |watch| log.assess::<Model>(system, self.shared, watch))?;
            one.measure.extend(found.measure);
            one.sigma.extend(found.sigma);
            one.sqrt_mu.extend(found.sqrt_mu);
        }
        assessed(py, self.count(), self.whole.size(), one)
    }
    fn partitions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        let all = PyList::empty(py);
        for part in &self.parts {
            for item in part.run.partitions(py)? {
                all.append(item)?;
            }
        }
        Ok(all)
    }
    fn work(&self) -> Vec<f64> {
        let outputs: Vec<Output> = self.outputs().cloned().collect();
        let mut work: Vec<f64> = outputs.iter().map(|x| x.work).collect();
        // inputs that events may set have no potential
        let whole = self.parts.first().map_or(&self.whole, |part| &part.whole);
        let counted = whole.counted_potential(&outputs).unwrap_or_default();
        let first = counted.first().copied().unwrap_or_default();
        work.iter_mut().zip(counted).for_each(|(to, x)| *to += x - first);
        work
    }
    fn read(&self, take: &mut dyn FnMut(&SolutionLog, &mut StepReader) -> Read) -> Read {
        self.parts.first().map_or(Ok(()), |part| part.run.read(take))
    }
    fn steps(&self) -> Vec<&StepLog> {
        self.parts.iter().flat_map(|part| part.run.steps()).collect()
    }
    fn size(&self) -> Size {
        self.whole.size()
    }
    fn at(&self, t: f64) -> &dyn Reported {
        let begins = |part: &Part| part.run.steps().first().and_then(|steps| steps.span()).map(|span| span.0);
        // at an instant where velocities jump the state is that after it
        let found = self.parts.iter().rev().find(|part| begins(part).is_some_and(|begin| begin <= t));
        match found.or(self.parts.first()) {
            Some(part) => &part.run,
            None => self,
        }
    }
    fn legs(&self, times: &[Time]) -> Result<Vec<Leg>, AnalysisError> {
        let mut legs = Vec::new();
        for part in &self.parts {
            let mut leg = part.run.leg(Instant::of(&part.start), times)?;
            leg.jump = part.transition.as_ref().map(|x| self.jump(x)).transpose()?;
            legs.push(leg);
        }
        Ok(legs)
    }
    fn is_divided(&self) -> bool {
        true
    }
    fn stages(&self) -> Vec<(usize, Arc<Model>)> {
        if self.whole.follows_reactions() {
            // what they follow is what acts in each mode
            let of = |part: &Part| {
                part.whole.with_reactions_of(&part.run.system).map(Arc::new).unwrap_or(part.whole.clone())
            };
            return self.parts.iter().map(|part| (part.run.log.outputs.len(), of(part))).collect();
        }
        let mut stages: Vec<(usize, Arc<Model>)> = Vec::new();
        for part in &self.parts {
            let count = part.run.log.outputs.len();
            match stages.last_mut().filter(|last| Arc::ptr_eq(&last.1, &part.whole)) {
                Some(last) => last.0 += count,
                None => stages.push((count, part.whole.clone())),
            }
        }
        stages
    }
}

/// Impulses along the rows, of the joints, and the energy lost.
pub type Impulses = (Vec<f64>, Vec<([f64; 6], [bool; 6])>, f64);
/// Number of an event, what happened, whether its function rises, time, coordinates, velocities before and after, and
/// impulses.
pub type Happened = (usize, &'static str, bool, f64, Vec<f64>, Vec<f64>, Vec<f64>, Impulses);

/// What happened, as plain data.
pub fn happened(x: &Happening) -> Happened {
    let (before, q) = (&x.before, whole(&x.before).collect());
    let impulses = (x.impulses.clone(), x.joints.clone(), x.energy_lost);
    (x.event, x.kind.word(), x.rises, before.t, q, before.v.clone(), x.after.clone(), impulses)
}

/// What events do, and their functions.
pub fn planned(
    py: Python<'_>,
    model: &Arc<Model>,
    events: &Events,
    (acts, decisions): (&str, DecisionList),
) -> PyResult<(Plan, Box<dyn EventFunctions>)> {
    let written: WrittenPlan = serde_json::from_str(acts).map_err(|e| failure::unexpected(format!("actions: {e}")))?;
    let observe = events.of_mechanism(model.clone()).map_err(|e| failure::description(py, &e))?;
    let (names, called) = decisions.into_iter().unzip();
    let decisions = Box::new(Deciding(names, Callables::new(called)));
    let Observe { events, functions, most } = observe;
    Ok((written.plan(model, (events, most), decisions), functions))
}

/// Integrate a mechanism whose events act, as `run` does, and return the dictionary of results.
pub fn run<'py>(
    py: Python<'py>,
    model: &Arc<Model>,
    request: &Request,
    t_eval: &PyReadonlyArray1<'py, f64>,
    (q, v): (&[f64], &[f64]),
    (events, (acts, decisions)): (EventList, (&str, DecisionList)),
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let t_eval = entries_of(t_eval);
    let events = Events::new(events)?;
    let (plan, functions) = planned(py, model, &events, (acts, decisions))?;
    let go = |watch: Stopping| in_segments(plan, functions, request, &t_eval, (q, v), watch);
    let (found, cause) = carried_out(py, request, progress, go, |found| &mut found.outcome)?;
    reported_segments(py, model, (found, events.formulas()), cause)
}

/// Notes that differ in their numbers alone are told this often. Unit: number. Reason: what happens in every segment is read
/// once.
const ALIKE: usize = 2;

/// The notes of segments, each once.
fn gathered<'n>(notes: impl Iterator<Item = &'n String>) -> Vec<String> {
    let without_numbers = |note: &str| note.replace(|c: char| c.is_ascii_digit() || c == '.' || c == '-', "");
    let (mut out, mut alike): (Vec<String>, Vec<(String, usize)>) = (Vec::new(), Vec::new());
    for note in notes {
        if out.contains(note) {
            continue;
        }
        let form = without_numbers(note);
        let count = match alike.iter_mut().find(|(known, _)| *known == form) {
            Some((_, count)) => {
                *count += 1;
                *count
            }
            None => {
                alike.push((form, 1));
                1
            }
        };
        if count <= ALIKE {
            out.push(note.clone());
        }
    }
    for (form, count) in alike.into_iter().filter(|(_, count)| *count > ALIKE) {
        let last = out.iter().rposition(|note| without_numbers(note) == form);
        if let Some(note) = last.and_then(|at| out.get_mut(at)) {
            note.push_str(&format!(" (and likewise {} times more, in other segments)", count - ALIKE));
        }
    }
    out
}

/// What segments report, as `run` does.
pub fn reported_segments<'py>(
    py: Python<'py>,
    model: &Arc<Model>,
    (found, formulas): (Segments, Vec<(String, Formula)>),
    cause: Option<PyErr>,
) -> PyResult<Bound<'py, PyDict>> {
    let Segments { all, happenings, outcome } = found;
    let notes = gathered(all.iter().flat_map(|segment| &segment.run.notes));
    let findings: Vec<Finding> = all.iter().flat_map(|segment| segment.run.findings.clone()).collect();
    let (mut counters, mut work) = (Counters::default(), FormulationCounters::default());
    let (mut open, mut gaps, mut exchanged) = ((0.0f64, 0.0f64), Gaps::default(), 0.0);
    for Segment { run, .. } in &all {
        counters = counters + run.outcome.counters;
        work.add(&run.counters);
        open = (open.0.max(run.closure_error.0), open.1.max(run.closure_error.1));
        gaps.raise(&run.gaps);
        exchanged += run.exchanged;
    }
    let shared = !model.equations().calls_functions();
    let ended = Ended {
        outputs: all.iter().flat_map(|segment| &segment.run.log.outputs).collect(),
        notes: &notes,
        findings: &findings,
        outcome: &outcome,
    };
    let d = ended.reported(py, model.size(), cause)?;
    d.set_item("happenings", happenings.iter().map(happened).collect::<Vec<_>>())?;
    let part = |Segment { start, transition, whole, model, rows, run, slips }: Segment| Part {
        start,
        transition,
        whole,
        run: RunLog::new(model, run.log, shared),
        rows,
        slips,
    };
    let log = SegmentsLog { whole: model.clone(), parts: all.into_iter().map(part).collect(), shared, formulas };
    let gaps = (gaps.position.part, gaps.velocity.part);
    d.set_item("log", Account::new(Box::new(log), (counters, work), (open, gaps), exchanged).into_pyobject(py)?)?;
    Ok(d)
}
