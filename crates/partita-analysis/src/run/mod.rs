//! A run from end to end: look at the start, choose, march, and keep what everything else can be computed from.

pub mod cost;
mod inconsistent;
mod journal;
mod request;
mod verdict;

pub use journal::{Assessed, Described, Journal};
pub use request::Request;
pub use verdict::{Finding, Limits};

use crate::error::AnalysisError;
use partita_integrate::simulate::{simulate, Outcome, Status};
use partita_system::formulation::{registry, Formulation};
use partita_system::options::TangentMap;
use partita_system::record::{FormulationCounters, Gaps, Output};
use partita_system::reduction::bridged_gap;
use partita_system::singular::consistency;
use partita_system::start::{self, Start};
use partita_system::{weight, ConstrainedSystem};
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

/// March `system` from `(q, v)` as asked, with outputs at `t_eval`; `watch` is asked after every step whether to go on.
///
/// # Errors
/// What was asked makes no sense, or nothing could start. A run that ends early is a run: see its outcome.
pub fn run<S: ConstrainedSystem<Scratch: Send>>(
    system: &S,
    request: &Request,
    tangent: Option<Arc<dyn TangentMap>>,
    t_eval: &[f64],
    (q, v): (&[f64], &[f64]),
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Run, AnalysisError> {
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
    let found = start::analyse(system, request.t0, q)?;
    if found.misfit > 0.0 {
        options.misfit = bridged_gap(system.drawing_tolerance());
        limits.misfit = options.misfit;
    }
    if !found.dropped.is_empty() {
        notes.push(note_of_dropped(system, &found));
        consistency::check(system, &found, (request.t0, q, v), request.t_end - request.t0)?;
    }
    inconsistent::refuse(system, found.rank, request.t0, q)?;
    weight::refuse(system, request.t0, q, found.rank)?;
    notes.extend(system.start_notes(q, v)?);
    let mut f = registry::by_name(&request.formulation, system, found.rank, &options)
        .map_err(|e| AnalysisError::Argument { argument: "formulation", message: e.to_string() })?;
    let mut outputs = Vec::with_capacity(t_eval.len());
    let mut sink = |output: &Output| {
        outputs.push(output.clone());
        Ok(())
    };
    let reached = &t_eval[..t_eval.partition_point(|t| *t <= settings.t_end)];
    let mut outcome = simulate(&mut f, request.t0, q, v, reached, &settings, &mut sink, watch)?;
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
    notes.extend(told.notes);
    if !outcome.passages.is_empty() {
        notes.push(note_of_passages(&outcome));
    }
    let (rows, counters, events, open, gaps) = (told.rows, told.counters, told.events, told.open, told.gaps);
    drop(f);
    let journal =
        Journal { formulation: request.formulation.clone(), rank: found.rank, options, events, outputs, limits };
    let mut findings = Vec::new();
    limits.judge(system, &gaps, "the end of the step", &mut findings);
    verdict::of_steps(&outcome, &mut findings);
    Ok(Run { outcome, journal, counters, rows, open, gaps, notes, findings })
}
