//! Rules that turn S1-S5 into ordinary differential equations: a tangent basis times position coordinates.

pub mod motion;
pub mod registry;

use crate::error::{Result, SystemError};
use crate::event::MotionState;
pub use crate::linear_rates::LinearRates;
pub use crate::record::StepDecision;
use crate::record::{Crossings, Gaps, History, Output, PartitionEvent, Sample, StepChecks};
pub use crate::singular::change_point::{Across, Pace};
pub use crate::tangent::ChoiceSnapshot;
use crate::watched::{Reading, Watched};

/// Components of y.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Layout {
    /// Natural size of each: 1 for angles, a characteristic length for displacements, the same for their rates [1/s].
    /// Absolute tolerances are in these units, so that they have the same meaning for a watch and for a crane.
    pub sizes: Vec<f64>,
    /// Number of leading components whose error is controlled.
    pub controlled: usize,
    /// A component behind them whose error may not grow beyond what a balance over the run explains; its sizes are
    /// compared with [`StepChecks::exchanged`].
    pub observed: Option<usize>,
    /// First of the components that are integrated for the conditions that prescribe a motion.
    pub beside: usize,
}

impl Layout {
    /// Length of y.
    pub fn dim(&self) -> usize {
        self.sizes.len()
    }
}

/// What has to be known after an evaluation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Depth {
    /// Rates alone, which compiled code finds as well.
    Rates,
    /// All levels at the point, for readings of watched functions.
    Levels,
}

/// How the next step is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Course {
    /// As any other.
    Along,
    /// Across a singular position.
    Across,
}

/// What becomes of an output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// It is looked at.
    Look,
    /// It is kept: the record lists the choice that it uses.
    Keep,
}

/// What the watches of an integration found in the step that is accepted or repeated.
#[derive(Clone, Copy, Debug, Default)]
pub struct Findings<'a> {
    /// When C_D was singular in it, in the order of time; `None` where it was not searched.
    pub located: Option<&'a [f64]>,
    /// Why it is repeated, if not by its own end.
    pub repeated: Option<Repeated>,
    /// When it crossed a guard and came back, and which, where it could not be shortened.
    pub hidden: Option<(f64, usize)>,
    /// The longest next step, where that begins on the other side of a guard.
    pub longest: Option<f64>,
}

/// Why a step is repeated that its end did not refuse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Repeated {
    /// It passed a singular position for which it was not made.
    Passed,
    /// It came near to one.
    Near,
    /// It crosses one, and what acts changes abruptly within it, at this time.
    Abrupt(f64),
}

/// Where a decision is carried out: at the end of an accepted step, or at the start of one that is repeated. An integration
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
    /// What was found in the step.
    pub findings: Findings<'a>,
}

/// The end of a step, as the formulation judges it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrialEnd {
    /// When it was evaluated: at a discontinuity, shortly before that.
    pub t: f64,
    /// What is to be done with the step.
    pub decision: StepDecision,
    /// Whether the rates were evaluated anew.
    pub evaluated: bool,
    /// Distance of the end from a singular position, where that is known, in natural scales: it falls linearly towards one.
    pub margin: Option<f64>,
    /// Singular positions that the step may have passed unforeseen.
    pub passing: Option<Passing>,
    /// Whether the step crosses a singular position, or one is expected.
    pub crosses: bool,
    /// The fastest rate [1/s] and the strongest acceleration [1/s²] up to here.
    pub most: (f64, f64),
}

impl TrialEnd {
    /// An end that was not judged.
    pub fn undecided(decision: StepDecision) -> Self {
        Self { t: f64::NAN, decision, evaluated: false, margin: None, passing: None, crosses: false, most: (0.0, 0.0) }
    }
}

/// A step may have passed singular positions: C_D changed sides over it, or the distances at its ends are so small that it
/// may have done so twice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passing {
    /// The rate at which the distance from one falls at the most.
    pub rate: f64,
    /// Whether a step that passed one is repeated by one that is made for it.
    pub repeats: bool,
    /// A step that came nearer than this to one is repeated with a shorter one: outputs inside it are as far off as its
    /// polynomial, divided by that distance.
    pub near: f64,
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

/// A condition that prescribes a motion, such as a drive, at an instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Prescription {
    /// Φ and C v + a.
    pub violation: [f64; 2],
    /// b.
    pub bias: f64,
    /// Sizes of the terms of Φ and of C v + a.
    pub sizes: [f64; 2],
    /// Size of the closure error of its row under a large displacement.
    pub row_size: f64,
    /// Whether the row is kept. Those left out as redundant are judged by their violations.
    pub kept: bool,
}

/// Where prescribing conditions are evaluated.
#[derive(Clone, Copy, Debug)]
pub enum Prescribing<'a> {
    /// At the closed point last evaluated.
    Here,
    /// At this time, for the quantities that are integrated for them, with b or without.
    Integrated(f64, &'a [f64], bool),
}

/// Natural sizes of q (nq): those of the velocities they are integrals of, 1 for quaternions.
fn sizes_of_coordinates<S: crate::ConstrainedSystem>(system: &S) -> Vec<f64> {
    let mut out = vec![1.0; system.size().nq];
    for i in 0..system.size().nv {
        let own = system.structure().coordinates_of(i);
        if own.len() == 1 {
            out[own.start] = system.structure().displacement(i);
        }
    }
    out
}

/// States inside steps that were taken before, from their dense output.
pub trait StepReplay {
    /// Number of the choice in use and of what else states depend on besides (t, y); `None` where it cannot be restored.
    fn choice_version(&self) -> Option<u64>;
    /// The choice in use.
    fn choice_snapshot(&self) -> Option<ChoiceSnapshot>;
    /// Distances from a singular position at both ends of the step of the last `trial_end`; NaN where they are not known.
    fn step_margins(&self) -> [f64; 2];
    /// The next evaluations lie inside a step with these distances; it was taken with this choice, or with the one in use.
    fn replay(&mut self, choice: Option<&ChoiceSnapshot>, margins: [f64; 2]);
}

/// The system at the point last evaluated, for what watches an integration.
pub trait Point: StepReplay {
    /// What no step may pass unseen.
    fn watched(&self) -> Watched;
    /// All levels at (t, y).
    fn evaluate(&mut self, t: f64, y: &[f64]) -> Result<()>;
    /// Velocities and accelerations at the point last evaluated with all levels, and its position without whole turns;
    /// for those at a time the multipliers too.
    ///
    /// # Errors
    /// Where these cannot be evaluated.
    fn state(&mut self, forces_at: Option<f64>, out: &mut MotionState) -> Result<()>;
    /// The fastest rate [1/s], and the watched functions.
    fn readings(&mut self, t: f64, out: &mut [Reading]) -> f64;
    /// The side at (t, y) inside the step that was judged or is attempted. `None` where sides cannot be compared.
    fn side(&mut self, t: f64, y: &[f64]) -> Option<Side>;
    /// The error of a singular position at t, if steps across it were tried in vain.
    fn obstacle(&self, t: f64) -> Option<SystemError>;
    /// Rows that prescribe a motion, as a step may end only where they agree with their own derivatives.
    fn prescribing(&self) -> &[usize];
    /// These conditions.
    fn prescribed(&mut self, at: Prescribing, out: &mut [Prescription]) -> Result<()>;
    /// What prescribes a motion by this row, in words.
    fn prescriber(&self, row: usize) -> String;
    /// Whether an output that was computed from others is closed within these limits: positions relative to their sizes,
    /// rates to the fastest. One that is accepted is counted by the checks.
    fn accept_output(&mut self, at: &Output, within: (f64, f64)) -> Result<bool>;
    /// Constraint violations at the ends of steps since the start, and other checks of steps and outputs.
    fn checks(&self) -> (Gaps, StepChecks);
    /// Singular positions that were crossed.
    fn crossings(&self) -> Crossings;
}

/// A rule that turns S1-S5 into `y' = f(t, y)` and back; `rates` is called at any point near the motion.
///
/// `trial_end` is called at the end of a step that may be accepted; `commit` when it is, after the outputs inside it.
/// Before `commit` nothing changes later evaluations, so a step is rejected by not committing it.
pub trait Formulation {
    /// The components of y; their sizes are those of the last start or commit.
    fn layout(&self) -> &Layout;
    /// Start from the assembled state and write y; checks are counted from here.
    fn start(&mut self, t: f64, q: &[f64], v: &[f64], y: &mut [f64]) -> Result<()>;
    /// `y' = f(t, y)`.
    fn rates(&mut self, t: f64, y: &[f64], dy: &mut [f64], depth: Depth) -> Result<()>;
    /// The rates at (t, y) changed to first order, for implicit methods; about as many evaluations as independent velocities.
    fn linear_rates(&mut self, t: f64, y: &[f64], out: &mut LinearRates) -> Result<()>;
    /// The end (t, y) of a step: removes the remainder of S3 from y, evaluates y' there and judges the step. `known`
    /// states that dy contains `f(t, y)` from the last evaluation.
    fn trial_end(&mut self, t: f64, y: &mut [f64], dy: &mut [f64], known: bool) -> Result<TrialEnd>;
    /// Carry out the decision of the last `trial_end`, or begin, and plan the next step; (q, v) stay the same. True if y or
    /// y' was rewritten.
    fn commit(&mut self, decision: StepDecision, step: &mut Step) -> Result<bool>;
    /// Closed position, velocities and work at (t, y), y near the motion; about the cost of an evaluation.
    fn state_at(&mut self, t: f64, y: &[f64], purpose: Purpose, out: &mut Output) -> Result<()>;
    /// Everything else `at` a closed (t, q, v), with the choice of `within`, an event of this run or of one with the
    /// same options (`None`: with the choice in use); turns and work are left to the caller. May be asked before
    /// `start` and after the run.
    fn describe(&mut self, at: &Output, within: Option<&PartitionEvent>, out: &mut Sample) -> Result<()>;
    /// The record so far.
    fn history(&self) -> History;
    /// The system at the point last evaluated.
    fn point(&mut self) -> &mut dyn Point;
}

impl Sample {
    /// An output with everything that `formulation` provides; `events` are those of the run.
    ///
    /// # Errors
    /// Where something cannot be evaluated. Undetermined quantities at a singular position are NaN, with a `note`.
    pub fn of(formulation: &mut dyn Formulation, output: &Output, events: &[PartitionEvent]) -> Result<Self> {
        let mut sample = Self::default();
        formulation.describe(output, events.get(output.choice), &mut sample)?;
        sample.turns.clone_from(&output.turns);
        sample.work = output.work;
        Ok(sample)
    }
}
