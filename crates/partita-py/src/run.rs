//! Results of a run for Python: options in, a dictionary of arrays out.

use crate::arrays::{array, entries_of, rows_of};
use crate::ending::{entered, released};
use crate::failure::{self, guarded, raise};
use crate::outputs::{assessed, described, watched};
use crate::state::Array;
use crate::tangent::{TangentFunctions, UserTangent};
use numpy::{PyArray1, PyReadonlyArray1, PyReadonlyArray2};
use partita_analysis::error::AnalysisError;
use partita_analysis::run::cost::{evaluation_costs, ClosedState, Contender};
use partita_analysis::run::{self, Balance, Finding, Request, Run, SolutionLog};
use partita_analysis::sensitivity::{self, Instant as At, Leg, SensitivityRequest, Time, Weights};
use partita_integrate::counters::Counters;
use partita_integrate::march::StepReader;
use partita_integrate::simulate::{Observe, Outcome, Status};
use partita_integrate::step_log::StepLog;
use partita_model::carried::Observable;
use partita_model::Model;
use partita_system::event::Occurrence;
use partita_system::options::TangentMap;
use partita_system::positions::turns;
use partita_system::record::{FormulationCounters, Output};
use partita_system::{Size, SystemError};
use pyo3::exceptions::{PyException, PyKeyboardInterrupt};
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use std::ops::ControlFlow;
use std::sync::{Arc, Mutex, OnceLock};
use std::time::{Duration, Instant};

/// Read options written by the Python package.
fn read_options(py: Python<'_>, text: &str) -> PyResult<Request> {
    serde_json::from_str(text)
        .map_err(|e| raise(py, "ArgumentError", &format!("options: {e}"), &[("argument", "options".into())]))
}

/// Options of runs, read once.
#[pyclass(frozen, module = "partita._core")]
pub struct Options(Request);

#[pymethods]
impl Options {
    #[new]
    fn new(py: Python<'_>, text: &str) -> PyResult<Self> {
        guarded(py, || Ok(Self(read_options(py, text)?)))
    }
}

impl Options {
    /// As the core takes them.
    pub fn request(&self) -> &Request {
        &self.0
    }

    /// The same, with so much memory for the steps of the run.
    pub fn keeping(&self, step_bytes: usize) -> Request {
        Request { step_bytes, ..self.0.clone() }
    }
}

/// The user's tangent velocities for a system of n velocities.
pub fn tangent(n: usize, functions: Option<TangentFunctions>) -> Option<Arc<dyn TangentMap>> {
    functions.map(|functions| Arc::new(UserTangent { n, functions }) as Arc<dyn TangentMap>)
}

/// The numbers of one state.
type Flat<'py> = Bound<'py, PyArray1<f64>>;

/// Whether what was read could be evaluated.
pub type Read = Result<(), AnalysisError>;

/// A run from which further quantities can be computed.
pub trait Reported: Send + Sync {
    fn describe<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>>;
    fn assess<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>>;
    fn partitions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>>;
    fn work(&self) -> Vec<f64>;
    fn read(&self, take: &mut dyn FnMut(&SolutionLog, &mut StepReader) -> Read) -> Read;
    fn steps(&self) -> Vec<&StepLog>;
    fn size(&self) -> Size;
    /// The part that contains a time.
    fn at(&self, t: f64) -> &dyn Reported;
    /// Its steps, for derivatives, with outputs at these times.
    fn legs(&self, times: &[Time]) -> Result<Vec<Leg>, AnalysisError>;
    /// Whether it has several.
    fn is_divided(&self) -> bool {
        false
    }
    /// Where joints are parted: numbers of outputs one after the other, each with the mechanism that moves there.
    fn stages(&self) -> Vec<(usize, Arc<Model>)> {
        Vec::new()
    }
}

/// Findings as plain data: broken, t, sentence.
pub fn reported(findings: &[Finding]) -> Vec<(bool, f64, String)> {
    findings.iter().map(|x| (x.invalid, x.t, x.sentence.clone())).collect()
}

pub struct RunLog<S> {
    pub system: Arc<S>,
    pub log: SolutionLog,
    /// Without user functions outputs may be computed concurrently.
    shared: bool,
    /// What read the steps the last time.
    reader: Mutex<Option<Box<StepReader<'static>>>>,
}

impl<S> RunLog<S> {
    /// Of a system whose functions, if it has some, need not be called one after the other.
    pub fn new(system: Arc<S>, log: SolutionLog, shared: bool) -> Self {
        Self { system, log, shared, reader: Mutex::new(None) }
    }
}

impl<S: Balance + Send + Sync + 'static> RunLog<S> {
    /// Its steps from `start` on, for derivatives.
    pub fn leg(&self, start: At, times: &[Time]) -> Result<Leg, AnalysisError> {
        let model = (self.system.clone() as Arc<dyn std::any::Any + Send + Sync>).downcast::<Model>();
        let model = model.map_err(|_| {
            let message = "derivatives of runs are those of mechanisms, not of systems given by matrices";
            SystemError::argument("run", message.into())
        })?;
        let mut found = None;
        self.read(&mut |log, reader| {
            found = Some(Leg::new(&model, log, Some(reader), start.clone(), times)?);
            Ok(())
        })?;
        found.map_or_else(|| Leg::new(&model, &self.log, None, start, times), Ok)
    }
}

impl<S: Balance + Send + Sync + 'static> Reported for RunLog<S> {
    fn describe<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let size = self.system.size();
        let found = watched(py, |watch| self.log.describe::<S>(&self.system, self.shared, watch))?;
        let findings = reported(&self.log.judge(&*self.system, &found));
        let d = described(py, self.log.outputs.len(), size, found)?;
        d.set_item("findings", findings)?;
        Ok(d)
    }
    fn assess<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let size = self.system.size();
        let found = watched(py, |watch| self.log.assess::<S>(&self.system, self.shared, watch))?;
        assessed(py, self.log.outputs.len(), size, found)
    }
    fn partitions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        let partitions = PyList::empty(py);
        for e in &self.log.events {
            let p = PyDict::new(py);
            p.set_item(intern!(py, "t"), e.t)?;
            p.set_item(intern!(py, "independent"), &e.independent)?;
            p.set_item(intern!(py, "dependent"), &e.dependent)?;
            let first = partitions.is_empty();
            p.set_item(intern!(py, "entering"), if first { Vec::new() } else { e.entering.clone() })?;
            p.set_item(intern!(py, "leaving"), &e.leaving)?;
            p.set_item(intern!(py, "reason"), &e.reason)?;
            // as plain data, which cannot represent infinite numbers
            let finite = |x: f64| x.is_finite().then_some(x);
            p.set_item(intern!(py, "sigma"), finite(e.quality.sigma))?;
            p.set_item(intern!(py, "sqrt_mu"), finite(e.quality.sqrt_mu))?;
            partitions.append(p)?;
        }
        Ok(partitions)
    }
    fn work(&self) -> Vec<f64> {
        self.log.work(&*self.system)
    }
    fn read(&self, take: &mut dyn FnMut(&SolutionLog, &mut StepReader) -> Read) -> Read {
        // another thread, or a function of the user called from here, may have taken it
        let known = self.reader.try_lock().ok().and_then(|mut reader| reader.take());
        let made = || Ok::<_, AnalysisError>(self.log.reader::<S>(self.system.clone())?.map(Box::new));
        let Some(mut reader) = known.map_or_else(made, |reader| Ok(Some(reader)))? else { return Ok(()) };
        let read = take(&self.log, &mut reader);
        if let Ok(mut kept) = self.reader.try_lock() {
            *kept = Some(reader);
        }
        read
    }
    fn steps(&self) -> Vec<&StepLog> {
        self.log.steps.iter().map(|steps| &steps.0).collect()
    }
    fn size(&self) -> Size {
        self.system.size()
    }
    fn at(&self, _: f64) -> &dyn Reported {
        self
    }
    fn legs(&self, times: &[Time]) -> Result<Vec<Leg>, AnalysisError> {
        let start = self.log.outputs.first().map(At::of).unwrap_or_default();
        Ok(vec![self.leg(start, times)?])
    }
}

/// The part of a run that is kept to compute outputs later, and what is seldom read.
#[pyclass(frozen, module = "partita._core", name = "SolutionLog")]
pub struct Account {
    run: Box<dyn Reported>,
    described: OnceLock<Py<PyDict>>,
    steps: Counters,
    work: FormulationCounters,
    steps_open: (f64, f64),
    gaps: (f64, f64),
    exchanged: f64,
}

impl Account {
    /// Of a run, with its work, its largest violations (absolute and relative) and the energy exchanged.
    pub fn new(
        run: Box<dyn Reported>,
        (steps, work): (Counters, FormulationCounters),
        (steps_open, gaps): ((f64, f64), (f64, f64)),
        exchanged: f64,
    ) -> Self {
        Self { run, described: OnceLock::new(), steps, work, steps_open, gaps, exchanged }
    }

    /// See [`Reported::stages`].
    pub fn stages(&self) -> Vec<(usize, Arc<Model>)> {
        self.run.stages()
    }

    /// What describes the outputs, computed when first needed.
    pub fn described<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        if let Some(found) = self.described.get() {
            return Ok(found.bind(py).clone());
        }
        // of threads that ask at once each computes: none waits while it has the interpreter
        let found = self.run.describe(py)?;
        Ok(self.described.get_or_init(|| found.unbind()).bind(py).clone())
    }
}

#[pymethods]
impl Account {
    /// vdot, multipliers, independent, closure, velocity_closure at every output; notes.
    fn describe<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        guarded(py, || self.described(py))
    }
    /// measure, sigma, sqrt_mu at every output, and selector where tangent velocities are frozen.
    fn assess<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        guarded(py, || self.run.assess(py))
    }
    /// Choices of coordinates, one dictionary each.
    fn partitions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        guarded(py, || self.run.partitions(py))
    }
    /// Work at every output.
    fn work<'py>(&self, py: Python<'py>) -> Array<'py> {
        let work = self.run.work();
        array(py, &[work.len()], work)
    }
    /// Largest |Φ| and |C v + a| at the ends of accepted steps.
    fn steps_open(&self) -> (f64, f64) {
        self.steps_open
    }
    /// The same, relative to sizes.
    fn gaps(&self) -> (f64, f64) {
        self.gaps
    }
    /// Lower bound of the energy exchanged.
    fn exchanged(&self) -> f64 {
        self.exchanged
    }
    /// t, q and v at a time where a step is kept; elsewhere of the last earlier time at which one is. None where there is
    /// none.
    fn state<'py>(&self, py: Python<'py>, t: f64) -> PyResult<Option<(f64, Flat<'py>, Flat<'py>)>> {
        guarded(py, || {
            let mut found = None;
            let read = self.run.at(t).read(&mut |log, reader| {
                let Some((steps, _)) = &log.steps else { return Ok(()) };
                let at = |x: &Output| {
                    let q: Vec<f64> = whole(x).collect();
                    (x.t, PyArray1::from_slice(py, &q), PyArray1::from_slice(py, &x.v))
                };
                found = reader.read(steps, t)?.map(at);
                Ok(())
            });
            read.map_err(|e| failure::analysis(py, e))?;
            Ok(found)
        })
    }
    /// The same at these times, a row each; NaN where there is none.
    fn states<'py>(
        &self,
        py: Python<'py>,
        times: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<(Array<'py>, Array<'py>, Array<'py>)> {
        guarded(py, || {
            let (times, size) = (entries_of(&times), self.run.size());
            let n = times.len();
            let mut rows = [vec![f64::NAN; n], vec![f64::NAN; n * size.nq], vec![f64::NAN; n * size.nv]];
            let [t, q, v] = &mut rows;
            let mut take = |i: usize, x: &Output| {
                t[i] = x.t;
                q[i * size.nq..(i + 1) * size.nq].iter_mut().zip(whole(x)).for_each(|(to, q)| *to = q);
                v[i * size.nv..(i + 1) * size.nv].copy_from_slice(&x.v);
            };
            watched(py, |watch| {
                if !self.run.is_divided() {
                    return self.run.read(&mut |log, reader| log.read(reader, &times, watch, &mut take));
                }
                for (i, time) in times.iter().enumerate() {
                    let part = self.run.at(*time);
                    part.read(&mut |log, reader| log.read(reader, &[*time], watch, &mut |_, x| take(i, x)))?;
                }
                Ok(())
            })?;
            let [t, q, v] = rows;
            Ok((array(py, &[n], t), array(py, &[n, size.nq], q), array(py, &[n, size.nv], v)))
        })
    }
    /// Values, rates and derivatives of what a text asks, row by row, at these times; `before` of some what happens there.
    /// Also integrals, and when something happens, with their derivatives.
    fn derivatives<'py>(
        &self,
        py: Python<'py>,
        asked: &str,
        times: PyReadonlyArray1<'py, f64>,
        before: Vec<bool>,
    ) -> PyResult<([Array<'py>; 3], [Derived; 2])> {
        guarded(py, || {
            let asked: SensitivityRequest = read_asked(py, asked)?;
            let times = times_of(&times, before);
            let (n, m, d) = (times.len(), asked.observables.len(), asked.directions.len());
            let found = watched(py, |watch| {
                let legs = self.run.legs(&times)?;
                sensitivity::forward(&legs, n, &asked, watch)
            })?;
            let arrays =
                [array(py, &[n, m], found.values), array(py, &[n, m], found.rates), array(py, &[n, m, d], found.along)];
            Ok((arrays, [found.integrals, found.shifts]))
        })
    }
    /// The derivatives of a weighed sum of what a text asks, backwards.
    fn gradient<'py>(
        &self,
        py: Python<'py>,
        asked: &str,
        weights: &str,
        times: PyReadonlyArray1<'py, f64>,
        before: Vec<bool>,
    ) -> PyResult<Array<'py>> {
        guarded(py, || {
            let (asked, weights): (SensitivityRequest, Weights) = (read_asked(py, asked)?, read_asked(py, weights)?);
            let times = times_of(&times, before);
            let found = watched(py, |watch| {
                let legs = self.run.legs(&times)?;
                sensitivity::backward(&legs, &asked, &weights, watch)
            })?;
            Ok(array(py, &[found.len()], found))
        })
    }
    /// Values and rates at these times of what a text names.
    fn observed<'py>(
        &self,
        py: Python<'py>,
        observables: &str,
        times: PyReadonlyArray1<'py, f64>,
        before: Vec<bool>,
    ) -> PyResult<[Array<'py>; 2]> {
        guarded(py, || {
            let observables: Vec<Observable> = read_asked(py, observables)?;
            let (times, m) = (times_of(&times, before), observables.len());
            let found = watched(py, |_| {
                let legs = self.run.legs(&times)?;
                sensitivity::observed(&legs, times.len(), &observables)
            })?;
            Ok(found.map(|x| array(py, &[times.len(), m], x)))
        })
    }
    /// When the first step kept begins and the last one ends; None where none is.
    fn span(&self) -> Option<(f64, f64)> {
        let spans: Vec<(f64, f64)> = self.run.steps().into_iter().filter_map(StepLog::span).collect();
        Some((spans.first()?.0, spans.last()?.1))
    }
    /// Counts of work.
    fn counters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let counters = PyDict::new(py);
        let (c, f) = (&self.steps, &self.work);
        for (name, value) in [
            (intern!(py, "steps"), c.steps),
            (intern!(py, "rejected"), c.rejected),
            (intern!(py, "retries"), c.retries),
            (intern!(py, "lenient"), c.lenient),
            (intern!(py, "by_rounding"), c.by_rounding),
            (intern!(py, "evaluations"), c.evaluations),
            (intern!(py, "dense_evaluations"), c.dense_evaluations),
            (intern!(py, "jacobians"), c.jacobians),
            (intern!(py, "differenced_jacobians"), c.differenced),
            (intern!(py, "dense_jacobians"), c.dense_jacobians),
            (intern!(py, "factored_jacobians"), c.factored),
            (intern!(py, "factorisations"), f.factorisations),
            (intern!(py, "plans"), f.plans),
            (intern!(py, "switches"), f.switches),
            (intern!(py, "unlisted_switches"), f.unlisted_switches),
            (intern!(py, "corrections"), f.corrections),
            (intern!(py, "renewals"), f.renewals),
            (intern!(py, "newton_iterations"), f.newton_iterations),
            (intern!(py, "proximal_iterations"), f.proximal_iterations),
            (intern!(py, "compiled_evaluations"), f.compiled_evaluations),
            (intern!(py, "kept_steps"), self.run.steps().into_iter().map(StepLog::count).sum::<usize>() as u64),
            (intern!(py, "kept_step_bytes"), self.run.steps().into_iter().map(StepLog::bytes).sum::<usize>() as u64),
        ] {
            counters.set_item(name, value)?;
        }
        Ok(counters)
    }
}

/// Numbers, each with its derivatives.
type Derived = Vec<(f64, Vec<f64>)>;

/// What is asked of derivatives, as the Python package writes it.
pub(crate) fn read_asked<T: serde::de::DeserializeOwned>(py: Python<'_>, text: &str) -> PyResult<T> {
    serde_json::from_str(text)
        .map_err(|e| raise(py, "ArgumentError", &format!("derivatives: {e}"), &[("argument", "by".into())]))
}

fn times_of(times: &PyReadonlyArray1<f64>, before: Vec<bool>) -> Vec<Time> {
    entries_of(times).iter().zip(before).map(|(&t, before)| Time { t, before }).collect()
}

/// Asks after each step whether to go on.
pub type Stopping<'w> = &'w mut (dyn FnMut(f64) -> ControlFlow<()> + Send);

/// A run with progress and interrupts, and what ended it early.
pub fn carried_out<T: Send>(
    py: Python<'_>,
    request: &Request,
    progress: Option<Py<PyAny>>,
    go: impl FnOnce(Stopping) -> Result<T, AnalysisError> + Send,
    outcome_of: impl FnOnce(&mut T) -> &mut Outcome,
) -> PyResult<(T, Option<PyErr>)> {
    // an exception from `progress`, or Ctrl-C
    let mut stopped: Option<PyErr> = None;
    let mut last = Instant::now();
    let (t0, span) = (request.t0, request.t_end - request.t0);
    let mut watch = |t: f64| {
        if last.elapsed() < Duration::from_millis(50) {
            return ControlFlow::Continue(());
        }
        last = Instant::now();
        let asked = entered(|py| {
            py.check_signals()?;
            match &progress {
                Some(p) => p.call1(py, (((t - t0) / span).clamp(0.0, 1.0),)).map(|_| ()),
                None => Ok(()),
            }
        });
        match asked {
            Ok(()) => ControlFlow::Continue(()),
            Err(e) => {
                stopped = Some(e);
                ControlFlow::Break(())
            }
        }
    };
    let found = released(py, || go(&mut watch));
    let mut found = found.map_err(|e| failure::analysis(py, e))?;
    let outcome = outcome_of(&mut found);
    // an exception from a user function ends the run, and the results so far are kept; Ctrl-C in it is Ctrl-C
    let mut cause = None;
    if let Some(error) = outcome.error.take() {
        let (message, name) = (outcome.message.clone(), blamed(&error));
        let of_functions = matches!(error, SystemError::Derivative { .. });
        let error = failure::system(py, error);
        if of_functions {
            cause = Some(error);
        } else if error.is_instance_of::<PyKeyboardInterrupt>(py) {
            outcome.status = Status::Interrupted;
            outcome.message = format!("interrupted at t = {}; the outputs up to there are kept", outcome.t);
        } else if error.is_instance_of::<PyException>(py) {
            cause = Some(ended(py, &message, outcome.t, &name, error));
        } else {
            return Err(error);
        }
    }
    if let Some(e) = stopped {
        if e.is_instance_of::<PyException>(py) {
            outcome.message = format!("progress failed at t = {}: {e}; the outputs up to there are kept", outcome.t);
            cause = Some(ended(py, &outcome.message, outcome.t, "progress", e));
        } else if !e.is_instance_of::<PyKeyboardInterrupt>(py) {
            return Err(e);
        }
    }
    Ok((found, cause))
}

/// Integrate `system` from `(q, v)` and return the dictionary of results.
pub fn run<'py, S: Balance<Scratch: Send> + Send + Sync + 'static>(
    py: Python<'py>,
    system: Arc<S>,
    request: &Request,
    t_eval: &PyReadonlyArray1<'py, f64>,
    (q, v): (&[f64], &[f64]),
    tangent: Option<Arc<dyn TangentMap>>,
    observe: Option<Observe>,
    progress: Option<Py<PyAny>>,
    calls_functions: bool,
) -> PyResult<Bound<'py, PyDict>> {
    let t_eval = entries_of(t_eval);
    let shared = !calls_functions && tangent.is_none();
    let go = |watch: Stopping| run::observed(&*system, request, tangent, &t_eval, (q, v), observe, watch);
    let (found, cause) = carried_out(py, request, progress, go, |found| &mut found.outcome)?;
    reported_run(py, system, found, shared, cause)
}

/// Results of a stepped motion, in the form of `run`; user functions are called in order.
pub fn left<'py, S: Balance + Send + Sync + 'static>(
    py: Python<'py>,
    system: &Arc<S>,
    found: Run,
) -> PyResult<Bound<'py, PyDict>> {
    reported_run(py, system.clone(), found, false, None)
}

/// States at which to evaluate, one row each: t (nt), q (nt, nq), v (nt, nv).
pub struct ClosedStates<'x, 'py> {
    pub t: &'x PyReadonlyArray1<'py, f64>,
    pub q: &'x PyReadonlyArray2<'py, f64>,
    pub v: &'x PyReadonlyArray2<'py, f64>,
}

/// Seconds of one evaluation, for each of the `options` with steps of the lengths `steps`; NaN where none works.
pub fn costs<S: Balance<Scratch: Send> + Send + Sync>(
    py: Python<'_>,
    system: &S,
    options: &[String],
    steps: &[f64],
    states: &ClosedStates<'_, '_>,
    tangent: Option<Arc<dyn TangentMap>>,
) -> PyResult<Vec<f64>> {
    if options.len() != steps.len() {
        let message = format!("{} options, but {} lengths of steps; give one each", options.len(), steps.len());
        return Err(raise(py, "ArgumentError", &message, &[("argument", "steps".into())]));
    }
    let contenders = options.iter().zip(steps).map(|(text, &step)| {
        let request = read_options(py, text)?;
        let tangent = tangent.clone().filter(|_| request.formulation == "user-tangent");
        Ok(Contender { request, tangent, step })
    });
    let contenders: Vec<Contender> = contenders.collect::<PyResult<_>>()?;
    let (size, t) = (system.size(), entries_of(states.t));
    let (q, v) = (rows_of(states.q, t.len(), size.nq, "q")?, rows_of(states.v, t.len(), size.nv, "v")?);
    let row = |x: &[f64], n: usize, i: usize| x[i * n..(i + 1) * n].to_vec();
    let state = |i: usize| ClosedState { t: t[i], q: row(&q, size.nq, i), v: row(&v, size.nv, i) };
    let states: Vec<ClosedState> = (0..t.len()).map(state).collect();
    let (mut stopped, mut last) = (None, Instant::now());
    let mut watch = || {
        if stopped.is_some() {
            return ControlFlow::Break(());
        }
        if last.elapsed() < Duration::from_millis(50) {
            return ControlFlow::Continue(());
        }
        last = Instant::now();
        match entered(|py| py.check_signals()) {
            Ok(()) => ControlFlow::Continue(()),
            Err(e) => {
                stopped = Some(e);
                ControlFlow::Break(())
            }
        }
    };
    let found = released(py, || evaluation_costs(system, &contenders, &states, &mut watch));
    match (found.map_err(|e| failure::analysis(py, e))?, stopped) {
        (Some(costs), None) => Ok(costs),
        (_, Some(e)) => Err(e),
        (None, None) => Ok(vec![f64::NAN; contenders.len()]),
    }
}

/// Source of the failed evaluation.
fn blamed(error: &SystemError) -> String {
    match error {
        SystemError::Function { what, .. } | SystemError::NotFinite { what, .. } => what.clone(),
        SystemError::OutsideTable { what, .. }
        | SystemError::OutsideCurve { what, .. }
        | SystemError::Wound { what, .. }
        | SystemError::Uncounted { what, .. }
        | SystemError::Twisted { what, .. } => what.clone(),
        _ => String::new(),
    }
}

/// The error of a run that ended early, raised from `cause` where it is not Partita's own.
fn ended(py: Python<'_>, message: &str, t: f64, name: &str, cause: PyErr) -> PyErr {
    let error = raise(py, "EvaluationError", message, &[("t", t.into()), ("where", name.into())]);
    error.set_cause(py, Some(cause));
    error
}

/// Coordinates with their whole turns.
pub fn whole(x: &Output) -> impl Iterator<Item = f64> + '_ {
    x.q.iter().zip(&x.turns).map(|(q, n)| turns::whole(*q, *n))
}

/// Number of an event, whether its function rises, time, coordinates and velocities.
pub type Occurred = (usize, bool, f64, Vec<f64>, Vec<f64>);

/// Events that occurred, as plain data.
pub fn occurred(all: &[Occurrence]) -> Vec<Occurred> {
    all.iter().map(|x| (x.event, x.rises, x.state.t, whole(&x.state).collect(), x.state.v.clone())).collect()
}

/// What a run reports at once: its times and states, how it ended, and its log, which has all else.
fn reported_run<'py, S: Balance + Send + Sync + 'static>(
    py: Python<'py>,
    system: Arc<S>,
    run: Run,
    shared: bool,
    cause: Option<PyErr>,
) -> PyResult<Bound<'py, PyDict>> {
    let size = system.size();
    let ended = Ended {
        outputs: run.log.outputs.iter().collect(),
        notes: &run.notes,
        findings: &run.findings,
        outcome: &run.outcome,
    };
    let d = ended.reported(py, size, cause)?;
    d.set_item(intern!(py, "occurrences"), occurred(&run.occurrences))?;
    let (open, gaps) = (run.closure_error, (run.gaps.position.part, run.gaps.velocity.part));
    let (work, exchanged) = ((run.outcome.counters, run.counters), run.exchanged);
    let log = Account::new(Box::new(RunLog::new(system, run.log, shared)), work, (open, gaps), exchanged);
    d.set_item(intern!(py, "log"), log.into_pyobject(py)?)?;
    Ok(d)
}

/// How a run ended, with its outputs.
pub struct Ended<'r> {
    pub outputs: Vec<&'r Output>,
    pub notes: &'r [String],
    pub findings: &'r [Finding],
    pub outcome: &'r Outcome,
}

impl Ended<'_> {
    /// Arrays, notes, findings and how it ended.
    pub fn reported<'py>(&self, py: Python<'py>, size: Size, cause: Option<PyErr>) -> PyResult<Bound<'py, PyDict>> {
        let (nt, outputs) = (self.outputs.len(), &self.outputs);
        let q = outputs.iter().flat_map(|x| whole(x)).collect();
        let v = outputs.iter().flat_map(|x| x.v.iter().copied()).collect();
        let arrays = PyDict::new(py);
        arrays.set_item(intern!(py, "t"), array(py, &[nt], outputs.iter().map(|x| x.t).collect()))?;
        arrays.set_item(intern!(py, "q"), array(py, &[nt, size.nq], q))?;
        arrays.set_item(intern!(py, "v"), array(py, &[nt, size.nv], v))?;
        let d = PyDict::new(py);
        d.set_item(intern!(py, "arrays"), arrays)?;
        d.set_item(intern!(py, "notes"), self.notes)?;
        d.set_item(intern!(py, "findings"), reported(self.findings))?;
        let status = self.outcome.status;
        d.set_item(intern!(py, "status"), status.word())?;
        d.set_item(intern!(py, "success"), matches!(status, Status::Finished | Status::Event))?;
        d.set_item(intern!(py, "message"), &self.outcome.message)?;
        d.set_item(intern!(py, "error"), cause.map(|e| e.into_value(py)))?;
        Ok(d)
    }
}
