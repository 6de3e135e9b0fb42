//! Many members of one mechanism at once: other initial states, other parameters.
//!
//! ```text
//! members ──► lanes    one program for each choice of coordinates, a step size for each lane, lanes refilled
//!    │          │ a pivot fades, the choice becomes poor, a loop opens, anything else than an ordinary step
//!    └──────────┴──► ordinary run of the whole member
//! ```
//!
//! The choices and the orders of their eliminations are those that ordinary runs of a few members meet. Each member's
//! result depends on its own numbers and on those few alone, whatever runs beside it and on however many cores.

mod engine;
mod lanes;

use crate::error::AnalysisError;
use crate::outputs::{tables_on, Rows, Watch};
use crate::poses;
use crate::run::{self, Request};
use engine::{Engine, Engines};
use partita_integrate::method::{Method as _, AUTO};
use partita_integrate::simulate::Status;
use partita_math::sorting::sort_by_key;
use partita_math::tolerance;
use partita_model::motion_programs::Varied;
use partita_model::zero_position::Coordinates;
use partita_model::Model;
use partita_system::positions::turns;
use partita_system::prelude::*;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Time between two looks for an interrupt, within an ordinary run.
const PATIENCE: Duration = Duration::from_millis(50);
/// Members that one thread takes at a time. Reason: enough to fill lanes that become free, few enough to share a thousand
/// evenly among cores.
const BATCH: usize = 256;
/// The same where every member runs alone. Reason: between batches an interrupt is heard.
const SMALL_BATCH: usize = 8;
/// A member takes at least this. Reason: ten evaluations of the smallest mechanism in lanes.
const LEAST: Duration = Duration::from_micros(1);
/// From this many members on lanes are worth their programs. Reason: recording takes as long as some tens of runs.
const WORTH_PROGRAMS: usize = 64;
/// Most degrees of freedom in lanes. Reason: with more the accelerations come from a recursion over clusters, whose
/// cost does not grow with their square.
const MOST_DOF: usize = 8;

/// What is computed.
pub struct Members<'a> {
    /// Tolerances and the end; methods and formulations as in a run.
    pub request: &'a Request,
    /// Ascending times of the outputs.
    pub t_eval: &'a [f64],
    /// Initial coordinates and velocities, one row for each member, or one for all.
    pub q: &'a [f64],
    /// See `q`.
    pub v: &'a [f64],
    /// Parameters that vary.
    pub parameters: &'a [Varied],
    /// Their numbers, one row for each member.
    pub values: &'a [f64],
    /// Members.
    pub count: usize,
    /// Whether members whose parameters open the loops are assembled anew.
    pub assembles: bool,
    /// Threads at most.
    pub workers: Option<usize>,
    /// Whether to stop; asked from any thread, many times a second.
    pub interrupted: &'a (dyn Fn() -> bool + Sync),
}

/// The motions of all members.
#[derive(Debug, Default)]
pub struct Ensemble {
    /// Coordinates, member by member, output by output; NaN where a member did not get there.
    pub q: Vec<f64>,
    /// Velocities.
    pub v: Vec<f64>,
    /// How each member ended.
    pub status: Vec<Status>,
    /// Whether it ran in lanes.
    pub in_lanes: Vec<bool>,
    /// Steps and evaluations in lanes.
    pub steps: u64,
    /// Messages of members that did not finish.
    pub messages: Vec<(usize, String)>,
    /// Why none ran in lanes, in words.
    pub refusal: Option<String>,
}

/// The rows of the tables: q, v, and status, in lanes, steps.
const REPORT: usize = 3;

const STATUSES: [Status; 8] = [
    Status::Finished,
    Status::Invalid,
    Status::Interrupted,
    Status::StepTooSmall,
    Status::Singular,
    Status::Contradiction,
    Status::MaxSteps,
    Status::EvaluationFailed,
];

impl Members<'_> {
    /// Initial state of a member.
    fn state(&self, model: &Model, i: usize) -> (&[f64], &[f64]) {
        let (nq, nv) = (model.size().nq, model.size().nv);
        let row = |x: &'_ [f64], n: usize| if x.len() > n { i } else { 0 };
        let (a, b) = (row(self.q, nq), row(self.v, nv));
        (&self.q[a * nq..][..nq], &self.v[b * nv..][..nv])
    }

    /// Parameters of a member.
    fn numbers(&self, i: usize) -> &[f64] {
        let width: usize = self.parameters.iter().map(|p| p.1).sum();
        &self.values[i * width..][..width]
    }

    fn changes(&self, i: usize) -> Vec<(&str, &[f64])> {
        let mut rest = self.numbers(i);
        let mut found = Vec::with_capacity(self.parameters.len());
        for (name, count) in self.parameters {
            let (own, others) = rest.split_at(*count);
            found.push((name.as_str(), own));
            rest = others;
        }
        found
    }

    /// The model of a member.
    fn model(&self, model: &Model, i: usize) -> Result<Option<Model>, AnalysisError> {
        if self.parameters.is_empty() {
            return Ok(None);
        }
        Ok(Some(model.with_parameters(&self.changes(i))?))
    }

    /// The ordinary run of a member.
    fn ordinary(&self, model: &Model, i: usize, t_eval: &[f64]) -> Result<run::Run, AnalysisError> {
        let own = self.model(model, i)?;
        let m = own.as_ref().unwrap_or(model);
        let (q, v) = self.state(model, i);
        let mut q = q.to_vec();
        if self.assembles && own.is_some() {
            poses::closed(m, self.request.t0, &mut q, tolerance::CLOSED, &[])?;
        }
        let mut last = Instant::now();
        let mut watch = |_: f64| {
            if last.elapsed() < PATIENCE {
                return ControlFlow::Continue(());
            }
            last = Instant::now();
            match (self.interrupted)() {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            }
        };
        // the steps of lanes, unless stiff forces limit them
        let usual = self.request.method == Request::over(0.0, 0.0).method;
        let method = if usual { AUTO.name().to_string() } else { self.request.method.clone() };
        run::run(m, &Request { method, ..self.request.clone() }, None, t_eval, (&q, v), &mut watch)
    }
}

/// Why lanes cannot run this mechanism; none where they can.
fn refusal(model: &Model, what: &Members) -> Option<String> {
    let (size, request, watched) = (model.size(), what.request, model.watched());
    let usual = Request { t0: request.t0, rtol: request.rtol, atol: request.atol, ..Request::over(0.0, request.t_end) };
    let cases = [
        (what.count < WORTH_PROGRAMS, "few members"),
        (what.t_eval.is_empty(), "no outputs"),
        (format!("{request:?}") != format!("{usual:?}"), "options other than tolerances"),
        (model.coordinates() != Coordinates::Relative, "absolute coordinates"),
        (size.rows != size.holonomic, "nonholonomic constraints"),
        (model.structure().rheonomic, "prescribed motions"),
        (model.equations().calls_functions(), "Python functions"),
        (model.follows_reactions(), "friction that depends on reactions"),
        (model.structure().lacks_mass, "massless bodies"),
        (!watched.guards.is_empty(), "contacts, stops or other elements with guards"),
        (!watched.breakpoints.is_empty() || !watched.discontinuities.is_empty(), "tables"),
        (watched.domain.is_some() || model.equations().has_ranges(), "tables with an end"),
        (model.geometry().drawn.is_some() && !what.parameters.is_empty(), "a repaired drawing with other parameters"),
    ];
    cases.iter().find(|x| x.0).map(|x| x.1.to_string())
}

/// The motions of all members; `watch` is called at intervals with the fraction that is done.
///
/// # Errors
/// Those of `watch`. A member that fails is not an error: see its status.
pub fn ensemble(
    model: &Model,
    what: &Members,
    watch: &mut dyn FnMut(f64) -> Result<(), AnalysisError>,
) -> Result<Ensemble, AnalysisError> {
    let size = model.size();
    let mut refused = refusal(model, what);
    let engines = match &refused {
        Some(_) => None,
        None => match Engines::new(model, what) {
            Ok(engines) => Some(engines),
            Err(why) => {
                refused = Some(why);
                None
            }
        },
    };
    let outputs = what.t_eval.len();
    let widths = [outputs * size.nq, outputs * size.nv, REPORT];
    let messages: Mutex<Vec<(usize, String)>> = Mutex::default();
    let finished = AtomicUsize::new(0);
    let chunk = match (&engines, model.equations().calls_functions()) {
        (_, true) => usize::MAX,
        (Some(_), _) => BATCH,
        (None, _) => SMALL_BATCH,
    };
    let cores = if model.equations().calls_functions() { Some(1) } else { what.workers };
    let batch = if chunk == usize::MAX { 1 } else { chunk };
    let row = |i: usize, memory: &mut Vec<Engine>, rows: &mut Rows| {
        if i % batch != 0 {
            return Ok::<(), AnalysisError>(());
        }
        let members = i..what.count.min(i + batch);
        let mut left: Vec<usize> = Vec::new();
        match &engines {
            Some(engines) => engines.run(model, what, members.clone(), memory, rows, &mut left),
            None => left.extend(members.clone()),
        }
        for i in left {
            if (what.interrupted)() {
                break;
            }
            alone(model, what, i, rows, &messages);
            if engines.is_none() {
                finished.fetch_add(1, Ordering::Relaxed);
            }
        }
        if engines.is_some() {
            finished.fetch_add(members.len(), Ordering::Relaxed);
        }
        Ok(())
    };
    let scratch = || engines.as_ref().map_or_else(Vec::new, Engines::memory);
    let mut done = || watch(finished.load(Ordering::Relaxed) as f64 / what.count.max(1) as f64);
    let watching: Watch = &mut done;
    let mut found = tables_on((cores, LEAST), what.count, &widths, chunk, scratch, row, watching)?.into_iter();
    let mut next = || found.next().unwrap_or_default();
    let (q, v, reported) = (next(), next(), next());
    let mut ensemble = Ensemble { q, v, refusal: refused, ..Ensemble::default() };
    for x in reported.chunks(REPORT) {
        ensemble.status.push(STATUSES[x[0] as usize]);
        ensemble.in_lanes.push(x[1] != 0.0);
        ensemble.steps += x[2] as u64;
    }
    ensemble.messages = messages.into_inner().unwrap_or_default();
    sort_by_key(&mut ensemble.messages, |x| x.0);
    Ok(ensemble)
}

fn report(rows: &mut Rows, i: usize, status: Status, in_lanes: bool, steps: u64) {
    let number = STATUSES.iter().position(|s| *s == status).unwrap_or(0);
    rows.row(2, i).copy_from_slice(&[number as f64, f64::from(u8::from(in_lanes)), steps as f64]);
}

/// The ordinary run of a member, into its rows.
fn alone(model: &Model, what: &Members, i: usize, rows: &mut Rows, messages: &Mutex<Vec<(usize, String)>>) {
    let (nq, nv) = (model.size().nq, model.size().nv);
    rows.row(0, i).fill(f64::NAN);
    rows.row(1, i).fill(f64::NAN);
    let (status, message) = match what.ordinary(model, i, what.t_eval) {
        Ok(found) => {
            for (o, x) in found.log.outputs.iter().enumerate().take(what.t_eval.len()) {
                let q = x.q.iter().zip(&x.turns).map(|(q, n)| turns::whole(*q, *n));
                rows.row(0, i)[o * nq..][..nq].iter_mut().zip(q).for_each(|(to, x)| *to = x);
                rows.row(1, i)[o * nv..][..nv].copy_from_slice(&x.v);
            }
            (found.outcome.status, found.outcome.message)
        }
        Err(e) => (Status::EvaluationFailed, format!("it cannot start: {e}")),
    };
    report(rows, i, status, false, 0);
    if status != Status::Finished {
        if let Ok(mut all) = messages.lock() {
            all.push((i, message));
        }
    }
}

/// A position of an ordinary run, and the choice in use.
struct Scouted {
    t: f64,
    q: Vec<f64>,
    independent: Vec<usize>,
}

/// Rank, and the positions that ordinary runs of a few members meet.
fn scouted(model: &Model, what: &Members) -> Result<(usize, Vec<Scouted>), String> {
    let mut members = vec![0, what.count / 2, what.count - 1];
    members.dedup();
    let (from, to) = (what.request.t0, what.request.t_end);
    let times: Vec<f64> = (0..=SAMPLES).map(|i| from + (to - from) * i as f64 / SAMPLES as f64).collect();
    let (mut found, mut rank, mut failed) = (Vec::new(), None, String::new());
    for i in members {
        match what.ordinary(model, i, &times) {
            Ok(run) => {
                rank = rank.or(Some(run.log.recipe.rank));
                if run.outcome.counters.factored > 0 {
                    return Err("stiff forces, which an implicit method follows".into());
                }
                for x in run.log.outputs.iter().filter(|x| !x.singular) {
                    if let Some(event) = run.log.events.get(x.choice) {
                        found.push(Scouted { t: x.t, q: x.q.clone(), independent: event.independent.clone() });
                    }
                }
            }
            Err(e) => failed = format!("the first members cannot start: {e}"),
        }
    }
    match rank {
        Some(rank) if !found.is_empty() => Ok((rank, found)),
        _ => Err(failed),
    }
}

/// Positions of each of those runs that are looked at.
const SAMPLES: usize = 48;

/// Whether the parameters of a member are numbers that a mechanism can have.
fn admissible(model: &Model, what: &Members, i: usize) -> bool {
    let simple = |p: &Varied| p.0.ends_with(".mass") || p.0 == "gravity";
    let masses = what
        .changes(i)
        .iter()
        .all(|(name, x)| x.iter().all(|x| x.is_finite()) && (!name.ends_with(".mass") || x.iter().all(|x| *x > 0.0)));
    masses && (what.parameters.iter().all(simple) || what.model(model, i).is_ok())
}

/// A failure of a model, in words.
fn worded(e: impl Into<AnalysisError>) -> String {
    e.into().to_string()
}
