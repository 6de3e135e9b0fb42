//! Marching any system and handing the outputs over as a dictionary of arrays.

use crate::arrays::{array, shaped};
use crate::failure::{self, raise};
use crate::tangent::{TangentFunctions, UserTangent};
use numpy::PyReadonlyArray1;
use partita_integrate::options::Options;
use partita_integrate::simulate::{simulate, Outcome, Settings, Status};
use partita_integrate::tableau;
use partita_system::formulation::options::{FormulationOptions, TangentMap};
use partita_system::formulation::{registry, turns};
use partita_system::formulation::{Correction, Formulation, FormulationCounters, Output, PartitionEvent, Sample};
use partita_system::partition::Selection;
use partita_system::{start, ConstrainedSystem, SystemError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use serde::Deserialize;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Options of a run, as Python writes them.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunOptions {
    #[serde(default)]
    t0: f64,
    t_end: f64,
    rtol: f64,
    atol: f64,
    method: String,
    formulation: String,
    #[serde(default)]
    step: Option<f64>,
    #[serde(default)]
    max_step: Option<f64>,
    correction: String,
    exchange: f64,
    max_steps: u64,
    #[serde(default)]
    independent: Option<Vec<String>>,
    selection: String,
    #[serde(default)]
    weights: Option<Vec<(String, f64)>>,
    #[serde(default)]
    window: Option<f64>,
    #[serde(default)]
    baumgarte: Option<(f64, f64)>,
    renew: f64,
}

impl RunOptions {
    /// Start of the run.
    pub fn t0(&self) -> f64 {
        self.t0
    }
}

fn refuse(py: Python<'_>, argument: &str, message: String) -> PyErr {
    raise(py, "ArgumentError", &message, &[("argument", argument.into())])
}

/// Read options written by the front.
pub fn read_options(py: Python<'_>, text: &str) -> PyResult<RunOptions> {
    serde_json::from_str(text).map_err(|e| refuse(py, "options", format!("options: {e}")))
}

/// The user's tangent velocities for a system of n velocities.
pub fn tangent(n: usize, functions: Option<TangentFunctions>) -> Option<Arc<dyn TangentMap>> {
    functions.map(|functions| Arc::new(UserTangent { n, functions }) as Arc<dyn TangentMap>)
}

/// Everything collected during a run.
#[derive(Default)]
struct Collected {
    outputs: Vec<Output>,
    energies: Vec<(f64, f64)>,
}

struct Report {
    outcome: Outcome,
    events: Vec<PartitionEvent>,
    counters: FormulationCounters,
    rows: Vec<usize>,
    notes: Vec<String>,
}

fn march<F: Formulation>(
    formulation: &mut F,
    t0: f64,
    q: &[f64],
    v: &[f64],
    t_eval: &[f64],
    settings: &Settings,
    sink: &mut dyn FnMut(&Output) -> Result<(), SystemError>,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Report, SystemError> {
    let outcome = simulate(formulation, t0, q, v, t_eval, settings, sink, watch)?;
    let (rows, notes) = (formulation.rows(), formulation.notes());
    Ok(Report { notes, outcome, events: formulation.events().to_vec(), counters: formulation.counters(), rows })
}

/// March `system` from `(q, v)` and return the dictionary of results.
///
/// `energy` gives kinetic and potential energy of a sample, if the system knows them.
pub fn run<'py, S: ConstrainedSystem<Scratch: Send>>(
    py: Python<'py>,
    system: &S,
    options: &RunOptions,
    t_eval: &PyReadonlyArray1<'py, f64>,
    (q, v): (&[f64], &[f64]),
    tangent: Option<Arc<dyn TangentMap>>,
    progress: Option<Py<PyAny>>,
    mut energy: impl FnMut(&Output) -> Result<Option<(f64, f64)>, SystemError> + Send,
) -> PyResult<Bound<'py, PyDict>> {
    let t_eval = crate::arrays::any_vector(t_eval);
    let tableau = tableau::by_name(&options.method).ok_or_else(|| {
        let known: Vec<&str> = tableau::METHODS.iter().map(|m| m.name).collect();
        refuse(py, "method", format!("there is no method \"{}\"; choose among {}", options.method, known.join(", ")))
    })?;
    let correction = match options.correction.as_str() {
        "partition" => Correction::Partition,
        "mass-orthogonal" => Correction::MassOrthogonal,
        "none" => Correction::None,
        other => {
            let message = format!("there is no correction \"{other}\"; choose among partition, mass-orthogonal, none");
            return Err(refuse(py, "correction", message));
        }
    };
    let selection = Selection::by_name(&options.selection).ok_or_else(|| {
        let known: Vec<&str> = Selection::ALL.iter().map(|s| s.name()).collect();
        let message = format!("there is no selection \"{}\"; choose among {}", options.selection, known.join(", "));
        refuse(py, "selection", message)
    })?;
    let independent = match &options.independent {
        None => None,
        Some(names) => Some(indices(py, system, names)?),
    };
    let weights = match &options.weights {
        None => None,
        Some(pairs) => {
            let names: Vec<String> = pairs.iter().map(|p| p.0.clone()).collect();
            let mut weights = vec![1.0; system.size().nv];
            for (i, (_, w)) in indices(py, system, &names)?.into_iter().zip(pairs) {
                weights[i] = *w;
            }
            Some(weights)
        }
    };
    let formulation_options = FormulationOptions {
        correction,
        exchange: options.exchange,
        independent,
        weights,
        selection,
        window: options.window,
        baumgarte: options.baumgarte,
        renew: options.renew,
        tangent,
    };
    let settings = Settings {
        t_end: options.t_end,
        tableau,
        options: Options {
            rtol: options.rtol,
            atol: options.atol.into(),
            controlled: usize::MAX,
            max_step: options.max_step.unwrap_or(f64::INFINITY),
            fixed_step: options.step,
            first_step: None,
        },
        max_steps: options.max_steps,
    };
    let mut notes = Vec::new();
    let unread = registry::unread(&options.formulation, &formulation_options);
    if !unread.is_empty() {
        notes.push(format!("formulation \"{}\" has no use for {}", options.formulation, unread.join(", ")));
    }
    let found = start::analyse(system, options.t0, q).map_err(|e| failure::system(py, e))?;
    if !found.dropped.is_empty() {
        let names: Vec<String> = found.dropped.iter().take(6).map(|&i| system.row_name(i)).collect();
        let more = if found.dropped.len() > 6 { ", ..." } else { "" };
        notes.push(format!(
            "{} closing rows say nothing that the others do not and were dropped by rank ({}{more}); the gap between kept \
             and dropped pivots is {:.1e}",
            found.dropped.len(),
            names.join(", "),
            found.gap
        ));
    }
    let mut collected = Collected::default();
    // an exception out of `progress`, or Ctrl-C
    let mut stopped: Option<PyErr> = None;
    let mut last = Instant::now();
    let (t0, span) = (options.t0, options.t_end - options.t0);
    let mut watch = |t: f64| {
        if last.elapsed() < Duration::from_millis(50) {
            return ControlFlow::Continue(());
        }
        last = Instant::now();
        let asked = Python::attach(|py| {
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
    let report = {
        let collected = &mut collected;
        let (outputs, energies) = (&mut collected.outputs, &mut collected.energies);
        let mut sink = |s: &Output| {
            if let Some(e) = energy(s)? {
                energies.push(e);
            }
            outputs.push(s.clone());
            Ok(())
        };
        let mut f = registry::by_name(&options.formulation, system, found.rank, &formulation_options)
            .map_err(|e| refuse(py, "formulation", e.to_string()))?;
        let marched = py.detach(|| march(&mut f, t0, q, v, &t_eval, &settings, &mut sink, &mut watch));
        let outputs = &collected.outputs;
        marched.and_then(|report| {
            let described = |output: &Output| Sample::of(&mut f, output, &report.events);
            let samples: Vec<Sample> = py.detach(|| outputs.iter().map(described).collect::<Result<_, _>>())?;
            Ok((report, samples))
        })
    };
    let (mut report, samples) = report.map_err(|e| failure::system(py, e))?;
    notes.append(&mut report.notes);
    let passed = &report.outcome.passages;
    if !passed.is_empty() {
        let times: Vec<String> = passed.iter().take(6).map(|t| format!("{t:.4}")).collect();
        let more = if passed.len() > 6 { ", ..." } else { "" };
        notes.push(format!(
            "{} singular positions of the mechanism were stepped over (t = {}{more}); around them the loops were closed inside \
             every evaluation, and {} steps were taken with an error estimate above the tolerance because it was round-off",
            passed.len(),
            times.join(", "),
            report.outcome.counters.lenient
        ));
    }
    // an exception from the user's own function ends the run; Ctrl-C inside it counts as Ctrl-C
    if let Some(SystemError::Function { source, .. }) = report.outcome.error.take() {
        if let Ok(own) = source.downcast::<PyErr>() {
            if own.is_instance_of::<pyo3::exceptions::PyKeyboardInterrupt>(py) {
                report.outcome.status = Status::Interrupted;
                report.outcome.message =
                    format!("interrupted at t = {}; the outputs up to there are kept", report.outcome.t);
            } else {
                return Err(*own);
            }
        }
    }
    if let Some(e) = stopped {
        if !e.is_instance_of::<pyo3::exceptions::PyKeyboardInterrupt>(py) {
            return Err(e);
        }
    }
    dictionary(py, system, &collected, &samples, &report, notes)
}

fn indices<S: ConstrainedSystem>(py: Python<'_>, system: &S, names: &[String]) -> PyResult<Vec<usize>> {
    let known: Vec<String> = (0..system.size().nv).map(|i| system.velocity_name(i)).collect();
    names
        .iter()
        .map(|name| {
            known.iter().position(|k| k == name).ok_or_else(|| {
                let message = format!("there is no coordinate \"{name}\"; known: {}", known.join(", "));
                raise(py, "UnknownNameError", &message, &[("name", name.as_str().into())])
            })
        })
        .collect()
}

fn dictionary<'py, S: ConstrainedSystem>(
    py: Python<'py>,
    system: &S,
    collected: &Collected,
    samples: &[Sample],
    report: &Report,
    notes: Vec<String>,
) -> PyResult<Bound<'py, PyDict>> {
    let size = system.size();
    let nt = samples.len();
    let d = PyDict::new(py);
    let column = |f: &dyn Fn(&Sample) -> f64| array(py, &[nt], samples.iter().map(f).collect());
    let rows = |width: usize, f: &dyn Fn(&Sample) -> &[f64]| {
        array(py, &[nt, width], samples.iter().flat_map(|s| f(s).iter().copied()).collect())
    };
    d.set_item("t", column(&|s| s.t))?;
    let q = samples.iter().flat_map(|s| s.q.iter().zip(&s.turns).map(|(q, n)| turns::whole(*q, *n))).collect();
    d.set_item("q", array(py, &[nt, size.nq], q))?;
    d.set_item("v", rows(size.nv, &|s| &s.v))?;
    d.set_item("vdot", rows(size.nv, &|s| &s.vdot))?;
    d.set_item("multipliers", rows(size.rows, &|s| &s.multipliers))?;
    d.set_item("measure", rows(size.nv, &|s| &s.measure))?;
    d.set_item("closure", column(&|s| s.closure))?;
    d.set_item("velocity_closure", column(&|s| s.velocity_closure))?;
    d.set_item("sigma", column(&|s| s.sigma))?;
    d.set_item("sqrt_mu", column(&|s| s.sqrt_mu))?;
    let k = samples.first().map_or(0, |s| s.independent.len());
    let independent: Vec<i64> = samples.iter().flat_map(|s| s.independent.iter().map(|&i| i as i64)).collect();
    d.set_item("independent", shaped(py, &[nt, k], independent))?;
    let energies = &collected.energies;
    let known = !energies.is_empty();
    d.set_item("kinetic", array(py, &[energies.len()], energies.iter().map(|e| e.0).collect()))?;
    d.set_item("potential", array(py, &[energies.len()], energies.iter().map(|e| e.1).collect()))?;
    let work: Vec<f64> = if known { samples.iter().map(|s| s.work).collect() } else { Vec::new() };
    d.set_item("work", array(py, &[work.len()], work))?;
    let partitions = PyList::empty(py);
    for e in &report.events {
        let p = PyDict::new(py);
        p.set_item("t", e.t)?;
        p.set_item("independent", &e.independent)?;
        p.set_item("dependent", &e.dependent)?;
        let first = partitions.is_empty();
        p.set_item("entering", if first { Vec::new() } else { e.entering.clone() })?;
        p.set_item("leaving", &e.leaving)?;
        p.set_item("reason", &e.reason)?;
        p.set_item("sigma", e.quality.sigma)?;
        p.set_item("sqrt_mu", e.quality.sqrt_mu)?;
        partitions.append(p)?;
    }
    d.set_item("partitions", partitions)?;
    d.set_item("notes", notes)?;
    d.set_item("kept_rows", &report.rows)?;
    let counters = PyDict::new(py);
    let (c, f) = (&report.outcome.counters, &report.counters);
    for (name, value) in [
        ("steps", c.steps),
        ("rejected", c.rejected),
        ("retries", c.retries),
        ("evaluations", c.evaluations),
        ("dense_evaluations", c.dense_evaluations),
        ("factorisations", f.factorisations),
        ("plans", f.plans),
        ("exchanges", f.exchanges),
        ("corrections", f.corrections),
    ] {
        counters.set_item(name, value)?;
    }
    d.set_item("counters", counters)?;
    d.set_item("status", report.outcome.status.word())?;
    d.set_item("success", report.outcome.status == Status::Finished)?;
    d.set_item("message", &report.outcome.message)?;
    Ok(d)
}
