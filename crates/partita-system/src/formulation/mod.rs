//! Rules that turn S1-S5 into ordinary differential equations: a tangent basis times position coordinates.

pub mod motion;
pub mod registry;

use crate::breakpoints::Passing;
use crate::guards::Look;
use crate::record::{Crossings, Gaps, History, Output, PartitionEvent, Sample, StepChecks};

use crate::error::{Result, SystemError};
pub use crate::record::StepDecision;

pub use crate::singular::change_point::{Across, Pace};
pub use crate::tangent::ChoiceSnapshot;

/// Where a verdict is applied: at the end of an accepted step, or at the start of one that is repeated. An integration
/// that came too close to a singular position is set back: then t is an earlier time, and y, dy, turns are those of it.
pub struct Step<'a> {
    /// Time.
    pub t: f64,
    /// State; rewritten where coordinates change or turns are removed.
    pub y: &'a mut [f64],
    /// Its slope, rewritten along with it.
    pub dy: &'a mut [f64],
    /// Whole turns removed from each coordinate so far (nq).
    pub turns: &'a mut [i32],
    /// The control of the next steps, if it can be changed; `None` for fixed steps.
    pub pace: Option<&'a mut Pace>,
    /// When C_D was singular in the step that was taken, or in the attempt that failed, in the order of time; `None`
    /// where the march has not searched it.
    pub located: Option<&'a [f64]>,
}

/// Where a position lies with respect to the singular ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Side {
    /// Distance from singular in natural scales, of this choice.
    pub distance: f64,
    /// A bound of it from below that falls by no more than the motion moves: that distance, or that of its blocks.
    pub clearance: f64,
    /// Number of blocks of C_D that are on another side than at the start of the step.
    pub changed: usize,
}

/// Natural sizes of q (nq): those of the velocities they are integrals of, 1 for quaternions.
fn sizes_of_coordinates<S: crate::ConstrainedSystem>(system: &S, out: &mut [f64]) {
    out.fill(1.0);
    for i in 0..system.size().nv {
        let own = system.coordinates_of(i);
        if own.len() == 1 {
            out[own.start] = system.characteristic_displacement(i);
        }
    }
}

/// The steps of a formulation: tried, judged and accepted, and their checks.
///
/// `trial_end` is called at the end of a step that may be accepted; `commit` when it is, after the outputs inside it.
/// Before `commit` nothing changes later evaluations, so a step is rejected by not committing it.
pub trait FormulationSteps {
    /// The end (t, y) of a step: removes the remainder of S3 from y, evaluates y' there and judges the step. `known`
    /// states that dy contains `f(t, y)` from the last evaluation. The second answer is true where f was evaluated
    /// anew.
    fn trial_end(&mut self, t: f64, y: &mut [f64], dy: &mut [f64], known: bool) -> Result<(StepDecision, bool)>;
    /// Carry out the verdict of the last `trial_end`; (q, v) stay the same. True if y or y' was rewritten.
    fn commit(&mut self, verdict: StepDecision, step: &mut Step) -> Result<bool>;
    /// Whether the step of the last `trial_end` passes a point where a load is not smooth, if this changes the
    /// velocities by more than the fraction `tolerance`: the step should end there.
    fn breakpoint_within(&mut self, _tolerance: f64) -> Passing {
        Passing::Clear
    }
    /// When a step of length h from the last `commit` would pass one, by prediction.
    fn breakpoint_ahead(&self, _h: f64, _tolerance: f64) -> Option<f64> {
        None
    }
    /// Whether the step of the last `trial_end` crosses a guard, where motions are as exact as `tolerance`. Where it
    /// cannot end there, a crossing that neither end shows is counted among the checks.
    fn guard(&mut self, _tolerance: f64, _may_end: bool) -> Look {
        Look::Clear
    }
    /// The guards, and what curves read, at (t, y) inside that step.
    fn look_at(&mut self, _t: f64, _y: &[f64]) -> Result<()> {
        Ok(())
    }
    /// The record so far.
    fn history(&self) -> History;
    /// Singular positions that were crossed.
    fn crossings(&self) -> Crossings {
        self.history().crossings
    }
    /// Constraint violations at the ends of steps since the start; allocates nothing.
    fn gaps(&self) -> Gaps {
        self.history().gaps
    }
    /// Other checks of steps and outputs since then; allocates nothing.
    fn checks(&self) -> StepChecks {
        self.history().checks
    }
    /// Count both from here on.
    fn forget_gaps(&mut self) {}
    /// How far from a singular position the last step ended, where that is known, in parts of the
    /// reaches: it falls linearly towards one.
    fn margin(&self) -> Option<f64> {
        None
    }
}

/// Singular positions within steps.
pub trait SingularSteps {
    /// The error of a singular position at t, if steps across it were tried in vain.
    fn crossing_failed(&self, _t: f64) -> Option<SystemError> {
        None
    }
    /// If the step of the last `trial_end` may have passed a singular position, the rate at which the distance from one
    /// falls at the most: C_D changed sides over it, or the distances at its ends are so small that it may have done so
    /// twice.
    fn may_have_passed(&self) -> Option<f64> {
        None
    }
    /// It came as near as this to one without passing it. True if it is to be repeated with a shorter one: outputs inside
    /// it are as far off as its polynomial, divided by that distance.
    fn nears_unforeseen(&mut self, _distance: f64) -> bool {
        false
    }
    /// One was found in that step, which was not made for it. True if it is to be repeated by one that is.
    fn passed_unforeseen(&mut self) -> bool {
        false
    }
}

/// Level at which a row that prescribes a motion is compared with its derivatives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PrescribedLevel {
    /// Φ, against the integral of velocities.
    Position = 0,
    /// C v + a, against the integral of accelerations.
    Rate = 1,
}

/// A row that prescribes a motion and misses the integral of its derivative over a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrescribedGap {
    /// Which row.
    pub row: usize,
    /// The level.
    pub level: PrescribedLevel,
    /// Its violation at the start of the step.
    pub before: f64,
    /// The difference from the integral.
    pub by: f64,
    /// Whether that is more than for a smooth function, so that the step must be rejected.
    pub shorten: bool,
}

/// Rows that prescribe a motion, such as drives: a step may end only where they agree with their own derivatives.
pub trait PrescribedRows {
    /// The row that at this level misses the integral of its derivative most over the step of the last `trial_end`, if
    /// one misses it by more than these tolerances, relative and absolute.
    fn prescribed_gap(&self, _level: PrescribedLevel, _tolerances: (f64, f64)) -> Option<PrescribedGap> {
        None
    }
    /// By how much it misses the integral at a state (t, y) inside that step, and its second derivative b there.
    fn prescribed_at(&mut self, _t: f64, _y: &[f64], _of: &PrescribedGap) -> Result<[f64; 2]> {
        Ok([0.0; 2])
    }
    /// The error for a row that jumps by this amount.
    fn prescribed_jump(&self, t: f64, of: &PrescribedGap, by: f64) -> SystemError {
        let what = format!("row {}", of.row);
        SystemError::Jump { what: what.into(), t, by, rate: of.level == PrescribedLevel::Rate }
    }
}

/// States inside steps that were taken before, from their dense output.
pub trait StepReplay {
    /// Number of the choice in use and of what else states depend on besides (t, y); `None` where it cannot be restored.
    fn choice_version(&self) -> Option<u64> {
        None
    }
    /// The choice in use.
    fn choice_snapshot(&self) -> Option<ChoiceSnapshot> {
        None
    }
    /// Distances from a singular position at both ends of the step of the last `trial_end`.
    fn step_margins(&self) -> [Option<f64>; 2] {
        [None; 2]
    }
    /// The next evaluations lie inside a step with these distances; it was taken with this choice, or with the one in use.
    fn replay(&mut self, _choice: Option<&ChoiceSnapshot>, _margins: [Option<f64>; 2]) {}
}

/// A rule that turns S1-S5 into `y' = f(t, y)` and back; `derivative` is called at any point near the motion.
pub trait Formulation: FormulationSteps + SingularSteps + PrescribedRows + StepReplay {
    /// Length of y.
    fn dim(&self) -> usize;
    /// Number of leading components of y whose error is controlled.
    fn controlled(&self) -> usize;
    /// A component behind them whose error may not grow beyond what a balance over the run explains; its sizes are
    /// compared with [`StepChecks::exchanged`].
    fn observed(&self) -> Option<usize> {
        None
    }
    /// Natural size of each component of y: 1 for angles, a characteristic length for displacements, the same for their
    /// rates [1/s]. Absolute tolerances are in these units, so that they have the same meaning for a watch and for a
    /// crane. Called again after `start` and wherever `commit` rewrites.
    fn natural_sizes(&self, out: &mut [f64]) {
        out.fill(1.0);
    }
    /// Start from the assembled state and write y.
    fn start(&mut self, t: f64, q: &[f64], v: &[f64], y: &mut [f64]) -> Result<()>;
    /// The integration begins at the current state: plan its first step. Nothing is rewritten.
    fn set_out(&mut self, _step: &mut Step) -> Result<()> {
        Ok(())
    }
    /// `y' = f(t, y)`.
    fn derivative(&mut self, t: f64, y: &[f64], dy: &mut [f64]) -> Result<()>;
    /// The side at (t, y) inside the current step. `None` where sides cannot be compared.
    fn side(&mut self, _t: f64, _y: &[f64]) -> Option<Side> {
        None
    }
    /// Closed position, velocities and work at (t, y), y near the motion; about the cost of an evaluation.
    fn state_at(&mut self, t: f64, y: &[f64], out: &mut Output) -> Result<()>;
    /// An output that is kept uses the present choice: the record lists it.
    fn keep_choice(&mut self) {}
    /// Whether an output that was computed from others is closed within these limits: positions relative to their sizes,
    /// rates to the fastest. One that is accepted is counted by the checks.
    fn accept_output(&mut self, _at: &Output, _within: (f64, f64)) -> Result<bool> {
        Ok(true)
    }
    /// Everything else `at` a closed (t, q, v), with the choice of `within`, an event of this run or of one with the
    /// same options (`None`: with the choice in use); turns and work are left to the caller. May be asked before
    /// `start` and after the run.
    fn describe(&mut self, at: &Output, within: Option<&PartitionEvent>, out: &mut Sample) -> Result<()>;
}

impl Sample {
    /// An output with everything that `formulation` provides; `events` are those of the run.
    ///
    /// # Errors
    /// Where something cannot be evaluated. Undetermined quantities at a singular position are NaN, with a `note`.
    pub fn of<F: Formulation + ?Sized>(
        formulation: &mut F,
        output: &Output,
        events: &[PartitionEvent],
    ) -> Result<Self> {
        let mut sample = Self::default();
        formulation.describe(output, events.get(output.choice), &mut sample)?;
        sample.turns.clone_from(&output.turns);
        sample.work = output.work;
        Ok(sample)
    }
}

impl<F: Formulation + ?Sized> FormulationSteps for Box<F> {
    fn trial_end(&mut self, t: f64, y: &mut [f64], dy: &mut [f64], known: bool) -> Result<(StepDecision, bool)> {
        (**self).trial_end(t, y, dy, known)
    }
    fn commit(&mut self, verdict: StepDecision, step: &mut Step) -> Result<bool> {
        (**self).commit(verdict, step)
    }
    fn breakpoint_within(&mut self, tolerance: f64) -> Passing {
        (**self).breakpoint_within(tolerance)
    }
    fn breakpoint_ahead(&self, h: f64, tolerance: f64) -> Option<f64> {
        (**self).breakpoint_ahead(h, tolerance)
    }
    fn guard(&mut self, tolerance: f64, may_end: bool) -> Look {
        (**self).guard(tolerance, may_end)
    }
    fn look_at(&mut self, t: f64, y: &[f64]) -> Result<()> {
        (**self).look_at(t, y)
    }
    fn history(&self) -> History {
        (**self).history()
    }
    fn crossings(&self) -> Crossings {
        (**self).crossings()
    }
    fn gaps(&self) -> Gaps {
        (**self).gaps()
    }
    fn checks(&self) -> StepChecks {
        (**self).checks()
    }
    fn forget_gaps(&mut self) {
        (**self).forget_gaps();
    }
    fn margin(&self) -> Option<f64> {
        (**self).margin()
    }
}

impl<F: Formulation + ?Sized> SingularSteps for Box<F> {
    fn crossing_failed(&self, t: f64) -> Option<SystemError> {
        (**self).crossing_failed(t)
    }
    fn may_have_passed(&self) -> Option<f64> {
        (**self).may_have_passed()
    }
    fn nears_unforeseen(&mut self, distance: f64) -> bool {
        (**self).nears_unforeseen(distance)
    }
    fn passed_unforeseen(&mut self) -> bool {
        (**self).passed_unforeseen()
    }
}

impl<F: Formulation + ?Sized> StepReplay for Box<F> {
    fn choice_version(&self) -> Option<u64> {
        (**self).choice_version()
    }
    fn choice_snapshot(&self) -> Option<ChoiceSnapshot> {
        (**self).choice_snapshot()
    }
    fn step_margins(&self) -> [Option<f64>; 2] {
        (**self).step_margins()
    }
    fn replay(&mut self, choice: Option<&ChoiceSnapshot>, margins: [Option<f64>; 2]) {
        (**self).replay(choice, margins);
    }
}

impl<F: Formulation + ?Sized> PrescribedRows for Box<F> {
    fn prescribed_gap(&self, level: PrescribedLevel, tolerances: (f64, f64)) -> Option<PrescribedGap> {
        (**self).prescribed_gap(level, tolerances)
    }
    fn prescribed_at(&mut self, t: f64, y: &[f64], of: &PrescribedGap) -> Result<[f64; 2]> {
        (**self).prescribed_at(t, y, of)
    }
    fn prescribed_jump(&self, t: f64, of: &PrescribedGap, by: f64) -> SystemError {
        (**self).prescribed_jump(t, of, by)
    }
}

impl<F: Formulation + ?Sized> Formulation for Box<F> {
    fn set_out(&mut self, step: &mut Step) -> Result<()> {
        (**self).set_out(step)
    }
    fn side(&mut self, t: f64, y: &[f64]) -> Option<Side> {
        (**self).side(t, y)
    }
    fn dim(&self) -> usize {
        (**self).dim()
    }
    fn controlled(&self) -> usize {
        (**self).controlled()
    }
    fn observed(&self) -> Option<usize> {
        (**self).observed()
    }
    fn natural_sizes(&self, out: &mut [f64]) {
        (**self).natural_sizes(out);
    }
    fn start(&mut self, t: f64, q: &[f64], v: &[f64], y: &mut [f64]) -> Result<()> {
        (**self).start(t, q, v, y)
    }
    #[inline]
    fn derivative(&mut self, t: f64, y: &[f64], dy: &mut [f64]) -> Result<()> {
        (**self).derivative(t, y, dy)
    }
    fn keep_choice(&mut self) {
        (**self).keep_choice();
    }
    fn state_at(&mut self, t: f64, y: &[f64], out: &mut Output) -> Result<()> {
        (**self).state_at(t, y, out)
    }
    fn accept_output(&mut self, at: &Output, within: (f64, f64)) -> Result<bool> {
        (**self).accept_output(at, within)
    }
    fn describe(&mut self, at: &Output, within: Option<&PartitionEvent>, out: &mut Sample) -> Result<()> {
        (**self).describe(at, within, out)
    }
}
