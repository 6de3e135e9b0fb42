//! A run from end to end: look at the start, choose, march, and keep what everything else can be computed from.

pub mod balance;
pub mod cost;
mod departure;
mod inconsistent;
mod journal;
pub mod meant;
mod request;
mod stepping;
mod verdict;

pub use balance::Balance;
pub use journal::{Assessed, Described, Journal};
pub use request::Request;
pub use stepping::Stepping;
pub use verdict::{Finding, Limits};

use crate::error::AnalysisError;
use partita_integrate::simulate::{simulate, Outcome, Status};
use partita_system::drawing;
use partita_system::formulation::{registry, Formulation};
use partita_system::options::TangentMap;
use partita_system::record::{FormulationCounters, Gaps, Output};
use partita_system::reduction::bridged_gap;
use partita_system::singular::consistency;
use partita_system::start::{self, Start};
use partita_system::{weight, ConstrainedSystem, SystemError};
use std::ops::ControlFlow;
use std::sync::Arc;

/// What a run left.
pub struct Run {
    /// How it ended.
    pub outcome: Outcome,
    /// The outputs and the choices in use.
    pub journal: Journal,
    /// Work done below the integrator.
    pub counters: FormulationCounters,
    /// Rows kept at the end.
    pub rows: Vec<usize>,
    /// Largest |Φ| and |C v + a| at the ends of the steps taken.
    pub open: (f64, f64),
    /// The same in parts of sizes, with times and rows.
    pub gaps: Gaps,
    /// What the user should know, in sentences.
    pub notes: Vec<String>,
    /// What stands against the run at the ends of its steps.
    pub findings: Vec<Finding>,
}

/// A drawing is tried by a tenth of a reach; what joints share goes out of balance by its misfit over a whole one.
const WHOLE: f64 = 10.0;

/// At most six of many, in words.
fn some<T>(all: &[T], word: impl Fn(&T) -> String) -> String {
    let first: Vec<String> = all.iter().take(6).map(word).collect();
    let more = if all.len() > 6 { ", ..." } else { "" };
    format!("{}{more}", first.join(", "))
}

/// Does what ends then end inside the run, by more than the round-off of its last step?
fn within(end: f64, request: &Request) -> bool {
    end > request.t0 && request.t_end - end > 1e-9 * (request.t_end - request.t0)
}

fn note_of_dropped<S: ConstrainedSystem>(system: &S, found: &Start) -> String {
    format!(
        "{} closing rows say nothing that the others do not and were dropped by rank ({}); the gap between kept and dropped \
         pivots is {:.1e}",
        found.dropped.len(),
        some(&found.dropped, |&i| system.row_name(i)),
        found.gap
    )
}

fn note_of_passages(outcome: &Outcome) -> String {
    format!(
        "{} singular positions of the mechanism were stepped over (t = {}); around them the loops were closed inside every \
         evaluation, and {} steps were taken with an error estimate above the tolerance because it was round-off",
        outcome.passages.len(),
        some(&outcome.passages, |t| format!("{t:.4}")),
        outcome.counters.lenient
    )
}

/// A run of a structure: it is no motion, and no failure either.
const CANNOT_MOVE: &str =
    "the mechanism cannot move: its joints make a structure of the bodies, with no degree of freedom; the run \
     holds it where it is, and its reactions are those at rest";

/// What a structure is told whose conditions are too weak for its reactions to be computed.
fn no_reactions<S: ConstrainedSystem>(system: &S, t: f64, q: &[f64]) -> Result<AnalysisError, SystemError> {
    let beyond = drawing::beyond(system, t, q, system.drawing_tolerance())?;
    let rows: Vec<usize> = beyond.iter().flat_map(|x| &x.near).map(|x| x.0).collect();
    let weak = match rows.is_empty() {
        true => String::new(),
        false => format!(", such as {}", some(&rows, |&i| system.row_words(i))),
    };
    let message = format!(
        "the mechanism cannot move: it is held by conditions so weak{weak} that what they carry is lost in rounding; draw its \
         joints exactly as they are meant, or give a drawing_tolerance (now {:.0e}) for the play they have",
        system.drawing_tolerance()
    );
    Ok(AnalysisError::Argument { argument: "drawing_tolerance", message })
}

/// March `system` from `(q, v)` as asked, with outputs at `t_eval`; `watch` is asked after every step whether to go on.
///
/// # Errors
/// What was asked makes no sense, or nothing could start. A run that ends early is a run: see its outcome.
pub fn run<S: Balance<Scratch: Send>>(
    system: &S,
    request: &Request,
    tangent: Option<Arc<dyn TangentMap>>,
    t_eval: &[f64],
    (q, v): (&[f64], &[f64]),
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Run, AnalysisError> {
    system.agree(request.t0, q, v)?;
    let mut settings = request.settings()?;
    settings.options.corners = system.corners();
    let ends = system.horizon().filter(|(end, _)| within(*end, request));
    if let Some((end, _)) = &ends {
        settings.t_end = *end;
    }
    let mut options = request.formulation_options(system, tangent)?;
    let mut limits = Limits::of(request);
    let mut notes = Vec::new();
    let unread = registry::unread(&request.formulation, &options);
    if !unread.is_empty() {
        notes.push(format!("formulation \"{}\" has no use for {}", request.formulation, unread.join(", ")));
    }
    let (found, mut launched) = match start::analyse(system, request.t0, q) {
        Err(e @ SystemError::SingularStart { .. }) => {
            let end = settings.options.corners.iter().copied().find(|t| *t > request.t0);
            let end = end.map_or(settings.t_end, |corner| corner.min(settings.t_end));
            let departure = departure::depart(system, (request.t0, q, v), (end, request.rtol), e)?;
            (start::analyse(system, departure.launch.t, &departure.launch.q)?, Some(departure))
        }
        found => (found?, None),
    };
    let (t, q_start, v_start) = match &launched {
        Some(x) => (x.launch.t, x.launch.q.clone(), x.launch.v.clone()),
        None => (request.t0, q.to_vec(), v.to_vec()),
    };
    let (q_start, v_start) = (&q_start[..], &v_start[..]);
    if found.misfit > 0.0 {
        options.misfit = bridged_gap(system.drawing_tolerance());
        limits.misfit = options.misfit;
    }
    if !found.dropped.is_empty() {
        notes.push(note_of_dropped(system, &found));
        consistency::check(system, &found, (t, q_start, v_start), request.t_end - t)?;
    }
    inconsistent::refuse(system, found.rank, t, q_start)?;
    let rigid = found.rank == system.size().nv && !(0..system.size().rows).any(|i| system.row_is_drive(i));
    if rigid && !system.rheonomic() {
        notes.push(CANNOT_MOVE.to_string());
    }
    weight::refuse(system, t, q_start, found.rank)?;
    notes.extend(system.start_notes(q_start, v_start)?);
    let mut f = registry::by_name(&request.formulation, system, found.rank, &options)
        .map_err(|e| AnalysisError::Argument { argument: "formulation", message: e.to_string() })?;
    let mut outputs = Vec::with_capacity(t_eval.len());
    let reached = &t_eval[..t_eval.partition_point(|t| *t <= settings.t_end)];
    let done = match &mut launched {
        Some(departure) => departure.outputs(reached, &mut outputs)?,
        None => 0,
    };
    let work = launched.as_ref().map_or(0.0, |x| x.launch.work);
    let mut sink = |output: &Output| {
        outputs.push(Output { work: output.work + work, ..output.clone() });
        Ok(())
    };
    let mut outcome = match simulate(&mut f, t, q_start, v_start, &reached[done..], &settings, &mut sink, watch) {
        Err(SystemError::Singular { .. }) if rigid => return Err(no_reactions(system, request.t0, q)?),
        outcome => outcome?,
    };
    if let Some(departure) = &launched {
        departure.tell(&mut outcome, &mut notes);
    }
    if let (Some((end, what)), Status::Finished) = (&ends, outcome.status) {
        outcome.status = Status::EvaluationFailed;
        outcome.message = format!(
            "stopped at t = {end}: the table of {what} ends at {end} s, before the run does at {} s; extend the table or \
             shorten the run",
            request.t_end
        );
    }
    notes.extend(inconsistent::note(system, found.rank, (request.t0, q, v), outputs.first())?);
    let told = f.journal();
    if limits.misfit > 0.0 {
        limits.asked.misfit = told.gaps.misfit.part.max(WHOLE * found.misfit);
    }
    notes.extend(told.notes);
    if !outcome.passages.is_empty() {
        notes.push(note_of_passages(&outcome));
    }
    let (rows, counters, events, open, gaps) = (told.rows, told.counters, told.events, told.open, told.gaps);
    let journal =
        Journal { formulation: request.formulation.clone(), rank: found.rank, options, events, outputs, limits };
    let mut findings = Vec::new();
    limits.judge(system, &gaps, "the end of the step", &mut findings);
    limits.judge_checks(system, &told.checks, &mut findings);
    verdict::conclude(system, &mut f, &journal, &mut outcome, &mut findings);
    Ok(Run { outcome, journal, counters, rows, open, gaps, notes, findings })
}
