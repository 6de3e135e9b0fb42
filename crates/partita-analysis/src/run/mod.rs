//! A complete run: analyse the start, choose coordinates, integrate, and keep the data from which all outputs are
//! computed.

pub mod balance;
pub mod cost;
pub mod impact;
mod inconsistent;
mod prepared;
mod request;
pub mod segments;
mod singular_start;
mod solution_log;
mod stepping;
mod verdict;

pub use balance::Balance;
pub use prepared::{ExaminedStart, Motions, Prepared, Recipe};
pub use request::Request;
pub use solution_log::{Assessed, Described, SolutionLog};
pub use stepping::Stepping;
pub use verdict::{Finding, Limits};

use crate::error::AnalysisError;
use partita_integrate::simulate::{simulate_recorded, Observe, Outcome, Recorded, Status};
use partita_integrate::step_log::StepLog;
use partita_math::formatted;
use partita_system::event::Occurrence;
use partita_system::options::TangentMap;
use partita_system::positions::turns;
use partita_system::record::{FormulationCounters, Gaps, Output};
use partita_system::SystemError;
use std::ops::ControlFlow;
use std::sync::Arc;

/// Result of a run.
pub struct Run {
    /// How it ended.
    pub outcome: Outcome,
    /// The outputs and the choices in use.
    pub log: SolutionLog,
    /// Events that occurred.
    pub occurrences: Vec<Occurrence>,
    /// Work done below the integrator.
    pub counters: FormulationCounters,
    /// Rows kept at the end.
    pub rows: Vec<usize>,
    /// Largest |Φ| and |C v + a| at the ends of the steps taken.
    pub closure_error: (f64, f64),
    /// As `closure_error`, relative to sizes, with times and rows.
    pub gaps: Gaps,
    /// Notes for the user, in sentences.
    pub notes: Vec<String>,
    /// Lower bound of the energy exchanged, from the speeds at the ends of the steps.
    pub exchanged: f64,
    /// Findings of a run at the ends of its steps.
    pub findings: Vec<Finding>,
}

/// At most six of many, in words.
fn some<T>(all: &[T], word: impl Fn(&T) -> String) -> String {
    let first: Vec<String> = all.iter().take(6).map(word).collect();
    let more = if all.len() > 6 { ", ..." } else { "" };
    format!("{}{more}", first.join(", "))
}

fn note_of_crossings(outcome: &Outcome) -> String {
    format!(
        "{} singular positions of the mechanism were crossed (t = {}); near them the loops were closed in every \
         evaluation, and {} steps were accepted although their error estimate, which was round-off, exceeded the \
         tolerance",
        outcome.crossings.count(),
        some(&outcome.crossings.times, |t| format!("{t:.4}")),
        outcome.counters.lenient
    )
}

fn note_of_rounding(outcome: &Outcome, request: &Request) -> String {
    format!(
        "the tolerance (rtol = {}, atol = {}) is below the rounding of the accelerations in {} of {} steps, as stiff \
         forces have it; these steps were taken as exact as they can be, and a looser \
         tolerance has the same result",
        formatted(request.rtol),
        formatted(request.atol),
        outcome.counters.by_rounding,
        outcome.counters.steps
    )
}

/// Where the steps of a run do not fit into the memory allowed for them.
fn note_of_steps(steps: &StepLog, limit: usize) -> Option<String> {
    let kept = match (steps.every(), steps.is_given_up()) {
        (1, false) => return None,
        (_, true) => "none is kept".into(),
        (every, false) => format!("one in {every} is kept"),
    };
    Some(format!(
        "the steps of the run take more than {limit} bytes (limit \"step_bytes\"), so {kept}: states between outputs \
         that lie in others are integrated from the last one known before them"
    ))
}

/// For a motion that stopped, determine whether a drive exceeded a limit of the joints. Whether the step size or the
/// pivot failed first is a matter of rounding.
fn report_driven_beyond<S: Balance>(
    system: &S,
    request: &Request,
    last: Option<&Output>,
    q: &[f64],
    outcome: &mut Outcome,
) {
    if !matches!(outcome.status, Status::Singular | Status::StepTooSmall) {
        return;
    }
    let since = last.map_or(request.t0, |x| x.t);
    let last =
        last.map_or_else(|| q.to_vec(), |x| x.q.iter().zip(&x.turns).map(|(q, n)| turns::whole(*q, *n)).collect());
    if let Some(why) = system.driven_beyond((since, &last), outcome.t, request.t_end) {
        outcome.status = Status::Singular;
        outcome.message = format!("stopped at t = {:.6} s, a drive exceeds what the joints allow: {why}", outcome.t);
    }
}

/// Integrate `system` from `(q, v)` as requested, with outputs at `t_eval`; `watch` decides after every step whether to
/// continue.
///
/// # Errors
/// The request is invalid, or the run cannot start. A run that ends early is not an error: see its outcome.
pub fn run<S: Balance<Scratch: Send>>(
    system: &S,
    request: &Request,
    tangent: Option<Arc<dyn TangentMap>>,
    t_eval: &[f64],
    state: (&[f64], &[f64]),
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Run, AnalysisError> {
    observed(system, request, tangent, t_eval, state, None, watch)
}

/// As [`run`](run()), with events.
///
/// # Errors
/// See [`run`](run()).
pub fn observed<S: Balance<Scratch: Send>>(
    system: &S,
    request: &Request,
    tangent: Option<Arc<dyn TangentMap>>,
    t_eval: &[f64],
    state: (&[f64], &[f64]),
    observe: Option<Observe>,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Run, AnalysisError> {
    system.integrated(request, tangent, t_eval, state, observe, watch)
}

fn integrated<S: Balance<Scratch: Send>>(
    system: &S,
    request: &Request,
    tangent: Option<Arc<dyn TangentMap>>,
    t_eval: &[f64],
    (q, v): (&[f64], &[f64]),
    observe: Option<Observe>,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Run, AnalysisError> {
    let Prepared {
        formulation: mut f,
        recipe,
        settings,
        limits,
        mut notes,
        rigid,
        ends,
        mut singular_start,
        seen,
        corrected,
        q,
        v,
        ..
    } = Prepared::new(system, request, tangent, (q, v))?;
    let (t, q_start, v_start) = match &singular_start {
        Some(x) => (x.step.t, x.step.q.clone(), x.step.v.clone()),
        None => (request.t0, q.clone(), v.clone()),
    };
    let mut outputs = Vec::with_capacity(t_eval.len());
    let reached = &t_eval[..t_eval.partition_point(|t| *t <= settings.t_end)];
    let done = match &mut singular_start {
        Some(singular_start) => singular_start.outputs(reached, &mut outputs)?,
        None => 0,
    };
    let work = singular_start.as_ref().map_or(0.0, |x| x.step.work);
    let start =
        Output { t, q: q_start.clone(), turns: vec![0; q.len()], v: v_start.clone(), work, ..Output::default() };
    let mut sink = |output: &Output| {
        outputs.push(Output { work: output.work + work, ..output.clone() });
        Ok(())
    };
    let observes = observe.is_some();
    let mut recorded = Recorded { steps: StepLog::within(request.step_bytes), observe, ..Recorded::default() };
    let (from, times) = ((t, &q_start[..], &v_start[..]), &reached[done..]);
    let mut outcome = match simulate_recorded(&mut *f, from, times, &settings, &mut recorded, &mut sink, watch) {
        Err(SystemError::Singular { .. }) if rigid => return Err(prepared::no_reactions()),
        Err(e) => return Err(prepared::explained(system, e.into())),
        Ok(outcome) => outcome,
    };
    let Recorded { steps, mut occurrences, .. } = recorded;
    occurrences.iter_mut().for_each(|x| x.state.work += work);
    if let Some(singular_start) = &singular_start {
        singular_start.report(&mut outcome, &mut notes);
        notes.extend(observes.then(|| {
            format!("events were looked for from t = {t} s on, after the first step out of the singular position")
        }));
        let first = outputs.first().filter(|x| x.t == request.t0).map(|x| (&x.q[..], &x.v[..]));
        notes.extend(inconsistent::note(system, &seen, (&q, &v), first));
    }
    if let (Some((end, what)), Status::Finished) = (&ends, outcome.status) {
        outcome.status = Status::EvaluationFailed;
        outcome.message = format!(
            "stopped at t = {end}: the table of {what} ends at {end} s, before the end of the run at {} s; extend \
             the table or shorten the run",
            request.t_end
        );
    }
    report_driven_beyond(system, request, outputs.last(), &q, &mut outcome);
    // where a run goes on from itself, what is closed anew is rounding
    notes.extend(corrected.filter(|_| request.exchanged_before.is_none()));
    let reported = f.history();
    notes.extend(reported.notes);
    notes.append(&mut outcome.notes);
    if outcome.crossings.count() > 0 {
        notes.push(note_of_crossings(&outcome));
    }
    if outcome.counters.by_rounding > 0 {
        notes.push(note_of_rounding(&outcome, request));
    }
    let (rows, counters, events, closure_error, gaps) =
        (reported.rows, reported.counters, reported.events, reported.closure_error, reported.gaps);
    notes.extend(verdict::note_of_nearness(system, &reported.checks));
    notes.extend(note_of_steps(&steps, request.step_bytes));
    let log = SolutionLog { recipe, events, outputs, limits, steps: Some((steps, settings)) };
    let mut findings = Vec::new();
    limits.judge(system, &gaps, "the end of the step", &mut findings);
    limits.judge_checks(system, &reported.checks, &mut findings);
    verdict::conclude(system, &mut *f, (&log, Some(&start)), &mut outcome, &mut findings);
    let exchanged = reported.checks.exchanged();
    Ok(Run { outcome, log, occurrences, counters, rows, closure_error, gaps, notes, exchanged, findings })
}
