//! Data of a run: outputs, quantities at each, changes of the choice, counts of work.

use crate::partition::criterion::Quality;
use partita_math::dense::Matrix;
use std::sync::Arc;

/// How the error of S3 is corrected after an accepted step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Correction {
    /// `q_D ← q_D − C_D⁻¹ Φ`: the independent coordinates stay untouched.               (34)
    #[default]
    Partition,
    /// As `Partition`, with the factors of C_D of the last evaluation, as long as the closure error at least halves.
    Kantorovich,
    /// `q ← q − M⁻¹ Cᵀ M_c⁻¹ Φ`: the least change in the mass metric.                    (33)
    MassOrthogonal,
    /// Nothing: the drift remains, and the result shows it.
    None,
}

/// A change, its time and reason.
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
    /// A choice made at t instead of `before` (empty: the first one).
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

/// Changes of the choice that are listed however many follow: the first ones. Unit: number. Reason: a run that changes
/// its choice more often is not read change by change, and the memory of a run is that of its outputs.
const LISTED: usize = 1000;

/// Changes of the choice: the first ones, those in use at outputs, and the last one. Others are counted.
#[derive(Clone, Debug, Default)]
pub struct ChoiceLog {
    /// Those listed.
    pub events: Vec<PartitionEvent>,
    /// Number of those that are not.
    pub unlisted: u64,
    /// Number of switches among these.
    pub unlisted_switches: u64,
    /// Whether an output uses the last one.
    in_use: bool,
}

impl ChoiceLog {
    /// The choice from here on. Numbers of those in use at outputs stay.
    pub fn record(&mut self, event: PartitionEvent) {
        if self.events.len() > LISTED && !self.in_use {
            let last = self.events.pop();
            self.unlisted += 1;
            self.unlisted_switches += u64::from(last.is_some_and(|x| !x.entering.is_empty()));
        }
        self.in_use = false;
        self.events.push(event);
    }
    /// An output that is kept uses the last one.
    pub fn keep(&mut self) {
        self.in_use = true;
    }
}

/// Singular positions that were crossed: the first ones and the latest. Others are counted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Crossings {
    /// Times.
    pub times: Vec<f64>,
    /// Number of those that are not listed.
    pub unlisted: u64,
}

impl Crossings {
    /// Latest ones that stay listed. Unit: number. Reason: more than one step may cross; a run that ends before them does
    /// not count them.
    const LATEST: usize = 64;

    /// One more.
    pub fn push(&mut self, t: f64) {
        if self.times.len() > LISTED {
            self.times.remove(LISTED - Self::LATEST);
            self.unlisted += 1;
        }
        self.times.push(t);
    }
    /// All until t.
    pub fn until(mut self, t: f64) -> Self {
        self.times.retain(|zero| *zero <= t);
        self
    }
    /// How many.
    pub fn count(&self) -> u64 {
        self.unlisted + self.times.len() as u64
    }
}

impl Output {
    /// Take over an instant, not a singular one; `turns`, `choice` and `basis` stay.
    pub fn set(&mut self, t: f64, q: &[f64], v: &[f64], work: f64) {
        (self.t, self.work, self.singular) = (t, work, false);
        self.q.clear();
        self.q.extend_from_slice(q);
        self.v.clear();
        self.v.extend_from_slice(v);
    }
}

/// Data of a run at an instant; everything else follows from them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Output {
    /// Time.
    pub t: f64,
    /// Coordinates (nq), closed to round-off; angles without their whole `turns`.
    pub q: Vec<f64>,
    /// Whole turns of each coordinate (nq) besides q; filled in by the integration.
    pub turns: Vec<i32>,
    /// Velocities (nv).
    pub v: Vec<f64>,
    /// Work of non-conservative forces and of driven constraints since the start.
    pub work: f64,
    /// Number, among the events of the run, of the choice in use.
    pub choice: usize,
    /// S (k x n) in use, where it is renewed without an event; otherwise that of `choice`, if it has one.
    pub basis: Option<Arc<Matrix>>,
    /// Whether the mechanism is at a singular position here. Then accelerations and multipliers do not follow from it.
    pub singular: bool,
}

/// Everything known about the motion at one instant.
#[derive(Clone, Debug, Default)]
pub struct Sample {
    /// Time.
    pub t: f64,
    /// Coordinates (nq), closed to round-off; angles without their whole `turns`.
    pub q: Vec<f64>,
    /// Whole turns of each coordinate (nq) besides q; filled in by the integration.
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
    /// Both relative to sizes, with the rows; rates relative to the size alone [1/s].
    pub gaps: Gaps,
    /// The fastest rate [1/s].
    pub fastest: f64,
    /// P4 (nv).
    pub measure: Vec<f64>,
    /// σ and √μ of the current choice.
    pub sigma: f64,
    /// See `sigma`.
    pub sqrt_mu: f64,
    /// Current independent velocities.
    pub independent: Vec<usize>,
    /// S (k x n) of the tangent velocities `u = S v`; empty where these are independent velocities, or all.
    pub selector: Vec<f64>,
    /// Work of non-conservative forces and of driven constraints since the start.
    pub work: f64,
    /// Why something is not determined here (and NaN), in a sentence.
    pub note: Option<String>,
    /// Set by the caller: measure, σ, √μ and S are not needed and hold nothing.
    pub brief: bool,
}

/// Counts of work done below the integrator.
#[derive(Clone, Copy, Debug, Default)]
pub struct FormulationCounters {
    /// Number of executions of the elimination plan.
    pub factorisations: u64,
    /// Elimination plans made.
    pub plans: u64,
    /// Switches of independent coordinates.
    pub switches: u64,
    /// Switches that the record does not list.
    pub unlisted_switches: u64,
    /// Position corrections applied.
    pub corrections: u64,
    /// Tangent bases made, the first included: S of a frozen basis, of a tangent chart.
    pub renewals: u64,
    /// Iterations of Newton's method for dependent coordinates inside evaluations.
    pub newton_iterations: u64,
    /// Proximal iterations for multipliers inside evaluations.
    pub proximal_iterations: u64,
    /// Evaluations by compiled code.
    pub compiled_evaluations: u64,
}

impl FormulationCounters {
    /// Add the work of another part of a run.
    pub fn add(&mut self, other: &Self) {
        self.factorisations += other.factorisations;
        self.plans += other.plans;
        self.switches += other.switches;
        self.unlisted_switches += other.unlisted_switches;
        self.corrections += other.corrections;
        self.renewals += other.renewals;
        self.newton_iterations += other.newton_iterations;
        self.proximal_iterations += other.proximal_iterations;
        self.compiled_evaluations += other.compiled_evaluations;
    }
}

/// The record of a run so far.
#[derive(Clone, Debug, Default)]
pub struct History {
    /// Name of the formulation.
    pub name: &'static str,
    /// Changes of the choice, the first one included.
    pub events: Vec<PartitionEvent>,
    /// Work done.
    pub counters: FormulationCounters,
    /// Rows kept at present, ascending.
    pub rows: Vec<usize>,
    /// Singular positions that were crossed.
    pub crossings: Crossings,
    /// Largest |Φ| and |C v + a| over all rows at the ends of accepted steps.
    pub closure_error: (f64, f64),
    /// As `closure_error`, relative to sizes, with times and rows.
    pub gaps: Gaps,
    /// Other checks of steps and outputs.
    pub checks: StepChecks,
    /// Further notes for the user, in sentences.
    pub notes: Vec<String>,
}

/// Largest violation of a condition, relative to its size.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gap {
    /// Fraction of the row's size; for rates, over the fastest rate of the motion as well.
    pub part: f64,
    /// When.
    pub t: f64,
    /// Which row.
    pub row: usize,
}

impl Gap {
    /// The worse of two; NaN is worse than any number.
    pub fn worse(self, other: Self) -> Self {
        match other.part > self.part || other.part.is_nan() {
            true => other,
            false => self,
        }
    }
}

/// Constraint violations at the ends of accepted steps, over all rows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gaps {
    /// Φ.
    pub position: Gap,
    /// C v + a.
    pub velocity: Gap,
}

impl Gaps {
    /// Rates relative to the fastest.
    pub fn in_parts_of(&mut self, fastest: f64) {
        let rate = &mut self.velocity.part;
        *rate = if *rate > 0.0 { *rate / fastest } else { 0.0 };
    }

    /// Adopt what is worse in `other`.
    pub fn raise(&mut self, other: &Self) {
        self.position = self.position.worse(other.position);
        self.velocity = self.velocity.worse(other.velocity);
    }
}

/// Checks of accepted steps and outputs besides the closure of the conditions at the ends of steps, each where it was
/// worst.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepChecks {
    /// C v' + b over all rows, relative to the strongest acceleration so far.                                    (S5)
    pub acceleration: Gap,
    /// Change of v from the integrated value to one that satisfies S4, at the ends of steps and outputs, in the mass
    /// metric, relative to the largest speed so far. It has no row.
    pub jump: Gap,
    /// Where constraints are not corrected: Φ relative to its sizes, over the squared distance from a singular
    /// position. From 1 on this error decides the branch on which the motion continues. It has no row.
    pub branch: Gap,
    /// 1 over the squared distance from a singular position, where errors of the dimensions may have led past it. It has
    /// no row.
    pub nearest: Gap,
    /// As `nearest`, at the end of the last step, which comes nearer to one.
    pub near_end: Gap,
    /// The longest motion, in characteristic displacements, over which the mechanism is nearer to a singular position than
    /// the errors that were removed from its dimensions. It has no row.
    pub by_errors: Gap,
    /// Φ and C v + a at the outputs, relative as at the ends of steps.
    pub outputs: Gaps,
    /// The fastest rate at an output, over what speeds and accelerations at the ends of the steps so far explain. It
    /// has no row.
    pub surge: Gap,
    /// The fastest rate at an output that is clearly faster than they explain, in characteristic displacements per second.
    pub surge_rate: f64,
    /// 1 where a step that could not be shortened crossed a guard and came back; the row is the number of the guard.
    pub hidden: Gap,
    /// The largest velocity at the ends of steps, in scales: half its square is at most the kinetic energy.
    pub speed: f64,
}

impl StepChecks {
    /// Lower bound of the energy exchanged.
    pub fn exchanged(&self) -> f64 {
        0.5 * self.speed * self.speed
    }

    /// Adopt what is worse in `other`.
    pub fn raise(&mut self, other: &Self) {
        self.acceleration = self.acceleration.worse(other.acceleration);
        self.jump = self.jump.worse(other.jump);
        self.branch = self.branch.worse(other.branch);
        self.nearest = self.nearest.worse(other.nearest);
        self.by_errors = self.by_errors.worse(other.by_errors);
        self.outputs.raise(&other.outputs);
        self.surge = self.surge.worse(other.surge);
        self.surge_rate = self.surge_rate.max(other.surge_rate);
        self.hidden = self.hidden.worse(other.hidden);
        self.speed = self.speed.max(other.speed);
    }
}

/// Decision about a step, at its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepDecision {
    /// Take it.
    Keep,
    /// Accept it, and choose anew at its end.
    Change,
    /// The choice became poor inside it: reject it, choose anew at its start and try half of it.
    Repeat,
    /// There is none yet: an integration begins.
    Begin,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn choices_are_listed_where_outputs_use_them_and_counted_otherwise() {
        let mut log = ChoiceLog::default();
        let mut used = Vec::new();
        for i in 0..4 * LISTED {
            let quality = Quality { sigma: 1.0, sqrt_mu: 1.0 };
            log.record(PartitionEvent::new(i as f64, &[i % 2], &[1 - i % 2], &[], String::new(), quality));
            if i % 100 == 7 {
                log.keep();
                used.push((log.events.len() - 1, i as f64));
            }
        }
        assert_eq!(log.events.len() as u64 + log.unlisted, 4 * LISTED as u64);
        assert_eq!(log.unlisted, log.unlisted_switches);
        assert!(log.events.len() <= LISTED + 2 + used.len());
        assert!(used.iter().all(|&(number, t)| log.events[number].t == t));
        assert!(log.events.windows(2).all(|x| x[0].t < x[1].t));
        assert_eq!(log.events.last().map(|x| x.t), Some((4 * LISTED - 1) as f64));
    }

    #[test]
    fn crossings_are_counted_and_the_latest_may_lie_beyond_the_end() {
        let mut found = Crossings::default();
        (0..5 * LISTED).for_each(|i| found.push(i as f64));
        assert_eq!((found.count(), found.times.len()), (5 * LISTED as u64, LISTED + 1));
        assert_eq!(found.times[..6], [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        let end = (5 * LISTED - 3) as f64;
        assert_eq!(found.until(end).count(), 5 * LISTED as u64 - 2);
    }
}
