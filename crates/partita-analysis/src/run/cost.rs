//! The cost of one evaluation alone, without steps and outputs: all contenders at the same states, in turn.

use super::{Balance, Prepared, Request};
use crate::error::AnalysisError;
use partita_integrate::options::Options;
use partita_integrate::simulate::{simulate, Settings, Status};
use partita_system::formulation::{
    Depth, Formulation, Layout, LinearRates, Point, Purpose, Step, StepDecision, TrialEnd,
};
use partita_system::options::TangentMap;
use partita_system::record::{History, Output, PartitionEvent, Sample};
use partita_system::SystemError;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Steps taken before the one whose stages are measured, for formulations that extrapolate from earlier steps.
const BEFORE: u64 = 2;
/// Time of a batch of evaluations. Unit: s. Reason: a thousand readings of the clock.
const BATCH: f64 = 4e-5;
/// Longest time of a contender at one state, apart from its first two batches: a comparison answers while one waits.
const LONGEST_TIMING: Duration = Duration::from_millis(150);
/// Batches of each contender at each state; the fastest counts, being the least disturbed.
const ROUNDS: usize = 25;
/// A formulation with its options, and a usual length of its steps (s).
pub struct Contender {
    /// Its options.
    pub request: Request,
    /// The user's tangent velocities.
    pub tangent: Option<Arc<dyn TangentMap>>,
    /// Evaluations are taken over steps of this length.
    pub step: f64,
}

/// A closed state to evaluate at.
pub struct ClosedState {
    /// Time.
    pub t: f64,
    /// Coordinates.
    pub q: Vec<f64>,
    /// Velocities.
    pub v: Vec<f64>,
}

/// Records the times and states of the evaluations since the last step.
struct RecordingFormulation<'s> {
    formulation: Box<dyn Formulation + Send + 's>,
    asked: Vec<(f64, Vec<f64>)>,
    last_step: Vec<(f64, Vec<f64>)>,
}

impl Formulation for RecordingFormulation<'_> {
    fn layout(&self) -> &Layout {
        self.formulation.layout()
    }
    fn start(&mut self, t: f64, q: &[f64], v: &[f64], y: &mut [f64]) -> Result<(), SystemError> {
        self.formulation.start(t, q, v, y)
    }
    fn rates(&mut self, t: f64, y: &[f64], dy: &mut [f64], depth: Depth) -> Result<(), SystemError> {
        self.asked.push((t, y.to_vec()));
        self.formulation.rates(t, y, dy, depth)
    }
    fn linear_rates(&mut self, t: f64, y: &[f64], out: &mut LinearRates) -> Result<(), SystemError> {
        self.formulation.linear_rates(t, y, out)
    }
    fn trial_end(&mut self, t: f64, y: &mut [f64], dy: &mut [f64], known: bool) -> Result<TrialEnd, SystemError> {
        self.formulation.trial_end(t, y, dy, known)
    }
    fn commit(&mut self, decision: StepDecision, step: &mut Step) -> Result<bool, SystemError> {
        self.last_step = std::mem::take(&mut self.asked);
        self.formulation.commit(decision, step)
    }
    fn state_at(&mut self, t: f64, y: &[f64], purpose: Purpose, out: &mut Output) -> Result<(), SystemError> {
        self.formulation.state_at(t, y, purpose, out)
    }
    fn describe(&mut self, at: &Output, within: Option<&PartitionEvent>, out: &mut Sample) -> Result<(), SystemError> {
        self.formulation.describe(at, within, out)
    }
    fn history(&self) -> History {
        self.formulation.history()
    }
    fn point(&mut self) -> &mut dyn Point {
        self.formulation.point()
    }
}

/// A contender at one state: the stages of a step that begins two steps from there.
struct Trial<'s> {
    formulation: Box<dyn Formulation + Send + 's>,
    stages: Vec<(f64, Vec<f64>)>,
    dy: Vec<f64>,
    /// Evaluations in a batch, the next stage, seconds used, fastest mean so far.
    count: usize,
    next: usize,
    used: f64,
    fastest: f64,
}

impl<'s> Trial<'s> {
    /// Everything set up and tested; `None` where it fails.
    fn new<S: Balance<Scratch: Send>>(
        system: &'s S,
        contender: &Contender,
        state: &ClosedState,
        watch: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Option<Self>, AnalysisError> {
        // the same integration twice: once to the end of a step, to record its stages, and once to its beginning
        let mut marched = |steps: u64| {
            let t_end = state.t + steps as f64 * contender.step;
            // by levels, as all formulations evaluate, unless asked otherwise
            let compiled = Some(contender.request.compiled == Some(true));
            let request = Request { t0: state.t, t_end, compiled, ..contender.request.clone() };
            let prepared = match Prepared::new(system, &request, contender.tangent.clone(), (&state.q, &state.v)) {
                Ok(prepared) if prepared.singular_start.is_none() => prepared,
                // a contender that fails there has no cost
                Ok(_)
                | Err(
                    AnalysisError::System(SystemError::SingularStart { .. } | SystemError::Singular { .. })
                    | AnalysisError::Argument { argument: "formulation", .. },
                ) => return Ok(None),
                Err(e) => return Err(e),
            };
            let Prepared { formulation, settings, q, v, .. } = prepared;
            let mut noted = RecordingFormulation { formulation, asked: Vec::new(), last_step: Vec::new() };
            let fixed = Options { fixed_step: Some(contender.step), ..settings.options.clone() };
            let settings = Settings { t_end, options: fixed, ..settings };
            let (mut sink, mut ask) = (|_: &Output| Ok(()), |_: f64| watch());
            let end = simulate(&mut noted, state.t, &q, &v, &[], &settings, &mut sink, &mut ask);
            Ok(end.is_ok_and(|end| end.status == Status::Finished).then_some(noted))
        };
        let (Some(ahead), Some(here)) = (marched(BEFORE + 1)?, marched(BEFORE)?) else { return Ok(None) };
        let (formulation, stages) = (here.formulation, ahead.last_step);
        let dy = vec![0.0; formulation.layout().dim()];
        if stages.len() < 2 || stages.iter().any(|x| x.1.len() != dy.len()) {
            return Ok(None);
        }
        let mut trial = Self { formulation, stages, dy, count: 2, next: 0, used: 0.0, fastest: f64::INFINITY };
        // plans may be made in the first
        if !(trial.batch() && trial.batch()) {
            return Ok(None);
        }
        let count = (BATCH / trial.fastest).ceil();
        trial.count = (count as usize).clamp(2, 100_000);
        trial.fastest = f64::INFINITY;
        Ok(Some(trial))
    }

    /// One batch of evaluations; false where one fails.
    fn batch(&mut self) -> bool {
        let began = Instant::now();
        for _ in 0..self.count {
            let (t, y) = &self.stages[self.next];
            self.next = (self.next + 1) % self.stages.len();
            if self.formulation.rates(*t, y, &mut self.dy, Depth::Rates).is_err() {
                return false;
            }
        }
        let took = began.elapsed().as_secs_f64();
        self.used += took;
        self.fastest = self.fastest.min(took / self.count as f64);
        true
    }
}

/// Seconds of one evaluation of each contender, the mean over the states; NaN for one that fails at all of them.
///
/// Evaluations are those that the stages of a step request. At each state the contenders take turns in short batches,
/// and the fastest batch of each counts. Takes about a millisecond per contender and state, longer where one evaluation
/// does. `watch` may stop it: then `None`.
///
/// # Errors
/// Invalid options, or states at which the system cannot be analysed.
pub fn evaluation_costs<S: Balance<Scratch: Send>>(
    system: &S,
    contenders: &[Contender],
    states: &[ClosedState],
    watch: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<Option<Vec<f64>>, AnalysisError> {
    system.timed(contenders, states, watch)
}

pub(super) fn timed<S: Balance<Scratch: Send>>(
    system: &S,
    contenders: &[Contender],
    states: &[ClosedState],
    watch: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<Option<Vec<f64>>, AnalysisError> {
    let (mut sums, mut counts) = (vec![0.0; contenders.len()], vec![0_u32; contenders.len()]);
    for state in states {
        let mut trials = Vec::with_capacity(contenders.len());
        for contender in contenders {
            trials.push(Trial::new(system, contender, state, watch)?);
            if watch().is_break() {
                return Ok(None);
            }
        }
        for round in 0..ROUNDS {
            for trial in &mut trials {
                let Some(x) = trial else { continue };
                if round >= 2 && x.used > LONGEST_TIMING.as_secs_f64() {
                    continue;
                }
                if !x.batch() {
                    *trial = None;
                }
                if watch().is_break() {
                    return Ok(None);
                }
            }
        }
        for (i, trial) in trials.iter().enumerate() {
            if let Some(x) = trial {
                sums[i] += x.fastest;
                counts[i] += 1;
            }
        }
    }
    Ok(Some(sums.iter().zip(&counts).map(|(s, n)| s / f64::from(*n)).collect()))
}
