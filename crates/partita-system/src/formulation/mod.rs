//! Rules that turn S1-S5 into ordinary differential equations, one file each.

pub mod acceleration;
pub mod any_tangent;
pub mod baumgarte;
mod blocks;
pub mod chooser;
mod continuity;
mod dead_point;
pub mod explicit_closing;
pub mod full_state;
pub mod gram_schmidt;
pub mod instant;
pub mod multipliers;
pub mod options;
pub mod projective;
pub mod proximal;
pub mod qr;
pub mod range_space;
pub mod reduction;
pub mod registry;
pub mod selector;
mod state_coordinates;
pub mod svd;
pub mod tangent;
pub mod tangent_space;
pub mod turns;
pub mod user_tangent;
pub mod wehage_haug;
pub mod zero_eigenvalue;

use crate::partition::criterion::Quality;
use crate::system::SystemError;
use partita_math::dense::Matrix;
use std::sync::Arc;

/// How the remainder of S3 is removed after an accepted step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Correction {
    /// `q_D ← q_D − C_D⁻¹ Φ`: the independent coordinates stay untouched.               (34)
    #[default]
    Partition,
    /// `q ← q − M⁻¹ Cᵀ M_c⁻¹ Φ`: the least change in the mass metric.                    (33)
    MassOrthogonal,
    /// Nothing: the drift stays, and the result shows it.
    None,
}

/// What was changed, when and why.
#[derive(Clone, Debug)]
pub struct PartitionEvent {
    /// Time.
    pub t: f64,
    /// Independent velocities from here on.
    pub independent: Vec<usize>,
    /// Dependent velocities.
    pub dependent: Vec<usize>,
    /// Velocities that became independent.
    pub entering: Vec<usize>,
    /// Velocities that became dependent.
    pub leaving: Vec<usize>,
    /// In words.
    pub reason: String,
    /// Quality right after.
    pub quality: Quality,
    /// S (k x n), where a basis was frozen.
    pub basis: Option<Arc<Matrix>>,
}

impl PartitionEvent {
    /// A choice made at t in the place of `before` (empty: the first one).
    pub fn new(
        t: f64,
        before: &[usize],
        independent: &[usize],
        dependent: &[usize],
        reason: String,
        quality: Quality,
    ) -> Self {
        let without = |x: &[usize], y: &[usize]| x.iter().copied().filter(|i| !y.contains(i)).collect();
        Self {
            t,
            entering: without(independent, before),
            leaving: without(before, independent),
            independent: independent.to_vec(),
            dependent: dependent.to_vec(),
            reason,
            quality,
            basis: None,
        }
    }
}

impl Output {
    /// Take over an instant; `turns` and `choice` stay.
    pub(crate) fn set(&mut self, t: f64, q: &[f64], v: &[f64], work: f64) {
        (self.t, self.work) = (t, work);
        self.q.clear();
        self.q.extend_from_slice(q);
        self.v.clear();
        self.v.extend_from_slice(v);
    }
}

/// What to do with an accepted step, seen from its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Review {
    /// Go on.
    Keep,
    /// Go on, but change the independent coordinates first.
    Change,
    /// The partition went bad inside the step: repeat it.
    Reject,
}

/// What a run keeps of an instant; everything else follows from it, see [`Sample::of`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Output {
    /// Time.
    pub t: f64,
    /// Coordinates (nq), closed to round-off; angles without their whole `turns`.
    pub q: Vec<f64>,
    /// Whole turns of each coordinate (nq) besides q; filled in by who marches.
    pub turns: Vec<i32>,
    /// Velocities (nv).
    pub v: Vec<f64>,
    /// Work of non-conservative forces and of driven constraints since the start.
    pub work: f64,
    /// Number, among the events of the run, of the choice in use; filled in by who marches.
    pub choice: usize,
}

/// Everything known about the motion at one instant.
#[derive(Clone, Debug, Default)]
pub struct Sample {
    /// Time.
    pub t: f64,
    /// Coordinates (nq), closed to round-off; angles without their whole `turns`.
    pub q: Vec<f64>,
    /// Whole turns of each coordinate (nq) besides q; filled in by who marches.
    pub turns: Vec<i32>,
    /// Velocities (nv).
    pub v: Vec<f64>,
    /// Accelerations (nv).
    pub vdot: Vec<f64>,
    /// Multipliers of all rows; zero where a row was dropped as redundant.
    pub multipliers: Vec<f64>,
    /// Largest |Φ| over all rows, the dropped ones included.
    pub closure: f64,
    /// Largest |C v + a| over all rows.
    pub velocity_closure: f64,
    /// P4 (nv).
    pub measure: Vec<f64>,
    /// σ and √μ of the current choice.
    pub sigma: f64,
    /// See `sigma`.
    pub sqrt_mu: f64,
    /// Current independent velocities.
    pub independent: Vec<usize>,
    /// Work of non-conservative forces and of driven constraints since the start.
    pub work: f64,
    /// Why something is not determined here (and NaN), in a sentence.
    pub note: Option<String>,
}

/// Counts of work done below the integrator.
#[derive(Clone, Copy, Debug, Default)]
pub struct FormulationCounters {
    /// Executions of the elimination plan.
    pub factorisations: u64,
    /// Elimination plans made.
    pub plans: u64,
    /// Exchanges of independent coordinates.
    pub exchanges: u64,
    /// Position corrections applied.
    pub corrections: u64,
    /// Iterations inside evaluations: Newton's for dependent coordinates, proximal ones for multipliers.
    pub iterations: u64,
}

/// Natural sizes of q (nq): those of the velocities they are integrals of, 1 for quaternions.
fn sizes_of_coordinates<S: crate::ConstrainedSystem>(system: &S, out: &mut [f64]) {
    out.fill(1.0);
    for i in 0..system.size().nv {
        let own = system.coordinates_of(i);
        if own.len() == 1 {
            out[own.start] = system.reach(i);
        }
    }
}

/// A rule that turns S1-S5 into `y' = f(t, y)` and back.
///
/// Duties: `derivative` is called at any point near the motion; the others only at ends of steps (`correct`, then one
/// `derivative` there, then `review`) and at outputs (`state_at`), whose every other number is computed when it is asked for
/// (`describe`).
pub trait Formulation {
    /// Name used in results and messages.
    fn name(&self) -> &'static str;
    /// Length of y.
    fn dim(&self) -> usize;
    /// How many leading components of y the step size answers for.
    fn controlled(&self) -> usize;
    /// Natural size of each component of y: 1 for angles, a characteristic length for displacements, the same for their
    /// rates [1/s]. Absolute tolerances are in these, so that they mean the same for a watch and for a crane. Asked again
    /// after `start`, `change` and `recover`.
    fn natural_sizes(&self, out: &mut [f64]) {
        out.fill(1.0);
    }
    /// Take over the assembled state and write y.
    fn start(&mut self, t: f64, q: &[f64], v: &[f64], y: &mut [f64]) -> Result<(), SystemError>;
    /// `y' = f(t, y)`.
    fn derivative(&mut self, t: f64, y: &[f64], dy: &mut [f64]) -> Result<(), SystemError>;
    /// Remove the remainder of S3 at the end of a step; true if y moved.
    fn correct(&mut self, t: f64, y: &mut [f64]) -> Result<bool, SystemError>;
    /// Judge the step just concluded at (t, y); the last `derivative` was there.
    fn review(&mut self, t: f64, y: &[f64]) -> Review;
    /// How far the mechanism is from a singular position after the last `derivative`, as a number that falls to zero
    /// there, and the number of the plan it was measured with. `None`: the rule does not suffer there.
    fn distance(&mut self) -> Option<(f64, u64)> {
        None
    }
    /// Is the singular position that is expected `ahead` after the state (t, y) really there? Asked before the march crosses it
    /// in one step.
    fn confirms_passage(&mut self, _t: f64, _y: &[f64], _ahead: f64) -> bool {
        true
    }
    /// Close the loops inside every evaluation while a singular position is passed.
    ///
    /// There the tangent is a quotient of small numbers, and what one stage leaves open the next one divides again.
    fn close_stages(&mut self, _on: bool) {}
    /// The step that `review` has just judged is given up after all: what was kept of its end is void.
    fn retreat(&mut self) {}
    /// Take whole turns off angles that have grown (see [`turns`]) at the end of a step and add them to `turns` (nq);
    /// true if y changed. y' stays the same.
    fn wrap(&mut self, _y: &mut [f64], _turns: &mut [i32]) -> bool {
        false
    }
    /// Carry out the change announced by `review`: rewrites y and y'; (q, v) stay the same.
    fn change(&mut self, t: f64, y: &mut [f64], dy: &mut [f64]) -> Result<(), SystemError>;
    /// After `Review::Reject`: look for a better start at the beginning of the step.
    fn recover(&mut self, t: f64, y: &mut [f64], dy: &mut [f64]) -> Result<(), SystemError>;
    /// Closed position, velocities and work at (t, y), y near the motion; about the cost of an evaluation.
    fn state_at(&mut self, t: f64, y: &[f64], out: &mut Output) -> Result<(), SystemError>;
    /// Everything else at a closed (t, q, v), with the choice of `within`, an event of this run or of one with the same options
    /// (`None`: with the choice in use); turns and work are left to the caller. May be asked before `start` and after the run.
    fn describe(
        &mut self,
        t: f64,
        q: &[f64],
        v: &[f64],
        within: Option<&PartitionEvent>,
        out: &mut Sample,
    ) -> Result<(), SystemError>;
    /// Changes so far, the first choice included.
    fn events(&self) -> &[PartitionEvent];
    /// Work done.
    fn counters(&self) -> FormulationCounters;
    /// Rows kept at the moment.
    fn rows(&self) -> Vec<usize>;
    /// What the user should know besides the changes, in sentences.
    fn notes(&self) -> Vec<String> {
        Vec::new()
    }
}

impl<F: Formulation + ?Sized> Formulation for Box<F> {
    fn name(&self) -> &'static str {
        (**self).name()
    }
    fn dim(&self) -> usize {
        (**self).dim()
    }
    fn controlled(&self) -> usize {
        (**self).controlled()
    }
    fn natural_sizes(&self, out: &mut [f64]) {
        (**self).natural_sizes(out);
    }
    fn start(&mut self, t: f64, q: &[f64], v: &[f64], y: &mut [f64]) -> Result<(), SystemError> {
        (**self).start(t, q, v, y)
    }
    #[inline]
    fn derivative(&mut self, t: f64, y: &[f64], dy: &mut [f64]) -> Result<(), SystemError> {
        (**self).derivative(t, y, dy)
    }
    fn correct(&mut self, t: f64, y: &mut [f64]) -> Result<bool, SystemError> {
        (**self).correct(t, y)
    }
    fn review(&mut self, t: f64, y: &[f64]) -> Review {
        (**self).review(t, y)
    }
    fn distance(&mut self) -> Option<(f64, u64)> {
        (**self).distance()
    }
    fn confirms_passage(&mut self, t: f64, y: &[f64], ahead: f64) -> bool {
        (**self).confirms_passage(t, y, ahead)
    }
    fn retreat(&mut self) {
        (**self).retreat();
    }
    fn close_stages(&mut self, on: bool) {
        (**self).close_stages(on);
    }
    fn wrap(&mut self, y: &mut [f64], turns: &mut [i32]) -> bool {
        (**self).wrap(y, turns)
    }
    fn change(&mut self, t: f64, y: &mut [f64], dy: &mut [f64]) -> Result<(), SystemError> {
        (**self).change(t, y, dy)
    }
    fn recover(&mut self, t: f64, y: &mut [f64], dy: &mut [f64]) -> Result<(), SystemError> {
        (**self).recover(t, y, dy)
    }
    fn state_at(&mut self, t: f64, y: &[f64], out: &mut Output) -> Result<(), SystemError> {
        (**self).state_at(t, y, out)
    }
    fn describe(
        &mut self,
        t: f64,
        q: &[f64],
        v: &[f64],
        within: Option<&PartitionEvent>,
        out: &mut Sample,
    ) -> Result<(), SystemError> {
        (**self).describe(t, q, v, within, out)
    }
    fn events(&self) -> &[PartitionEvent] {
        (**self).events()
    }
    fn counters(&self) -> FormulationCounters {
        (**self).counters()
    }
    fn rows(&self) -> Vec<usize> {
        (**self).rows()
    }
    fn notes(&self) -> Vec<String> {
        (**self).notes()
    }
}
