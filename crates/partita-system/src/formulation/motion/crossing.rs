//! Singular positions during a motion: foreseen, crossed, verified, and distinguished from dead points of the choice.

use super::{LevelsOf, Motion};
use crate::error::CrossingOutcome;
use crate::error::Result;
use crate::formulation::{Course, Passing, Point as _, Side, Step};
use crate::positions::Positions;
use crate::reduction::{Reduction, Sides};
use crate::singular::change_point::{Advice, Crossing, Probe};
use crate::singular::checkpoint::Checkpoints;
use crate::singular::dead_point::{self, Loss};
use crate::start::choose_partition;
use crate::step_boundary::StepBoundary;
use crate::system::{ConstrainedSystem, Size, SystemError};
use crate::tangent::Tangent;
use partita_math::tolerance;

/// Longest step. Unit: characteristic displacement. Reason: an error estimate with a dozen points per turn resolves a
/// circle, and singular positions lie half a turn apart.
const LONGEST_MARCH: f64 = 1.2;

/// Maximum number of attempts at a shorter first step.
const MOST_TRIED: u32 = 30;
/// Shortest part of it that is tried next. Unit: ratio of lengths. Reason: what acts grows with a power of the length
/// that is not known.
const FELT_SHORTER: f64 = 0.1;
/// Length of a step across a singular position. Unit: characteristic displacement. Reason: Gauss collocation of ten nodes
/// is exact to round-off over it, and its nodes keep hundredths of it clear of the position.
const CROSSING_MOVE: f64 = 0.8;

/// Nearer to a singular position velocities must be continuous over every step. Scale: distance in natural scales. Reason:
/// steps end so near only before a position that cannot be crossed, where rounding may lead onto another branch; farther
/// away a jump is that of a drive, which is reported as such.
const JUDGED_NEAR: f64 = 0.05;

/// Maximum number of consecutive steps that are shortened because the choice came to a dead point of its own; where the
/// choice is not integrated that is harmless.
const MOST_SPOILT: u32 = 6;

/// Rows that may replace those kept, and the distance of the mechanism from a singular position by them.
pub(super) struct ReplacementRows {
    rows: Vec<usize>,
    pub(super) distance: f64,
}

/// Who chooses the lengths of steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Pacing {
    /// The user.
    Fixed,
    /// The integration, with the formulation.
    Free,
}

/// The sides of C_D at the end of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum SideChange {
    /// Those of its start.
    Same,
    /// Others: C_D was singular within it, the mechanism close to it.
    Changed,
}

/// What the end of a step shows of singular positions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shown {
    /// Nothing that speaks against it.
    Regular,
    /// The branch was lost, or may have been: velocities jumped where C_D was singular.
    Lost,
    /// Velocities jumped next to a position that cannot be crossed.
    Jumped,
    /// A dead point of the choice alone.
    Spoilt,
}

/// The end of the step that was judged last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Judgement {
    side: SideChange,
    pub(super) shown: Shown,
}

impl Judgement {
    const REGULAR: Self = Self { side: SideChange::Same, shown: Shown::Regular };
}

/// Motion since the last singular position, and indications of the next from the current and the last step.
pub(super) struct CrossingMonitor {
    pub(super) crossing: Crossing,
    pub(super) next: Course,
    pub(super) checkpoints: Checkpoints,
    /// Start of the current step, and the end of the step that was judged.
    step_start: StepBoundary,
    step_end: StepBoundary,
    /// Rows to be kept from the start of the current step.
    others: Option<ReplacementRows>,
    /// Margin at the start of the step under way.
    margin_before: Option<(f64, u64)>,
    pacing: Pacing,
    /// Sides of C_D there and at the end of the step that was judged.
    pub(super) sides: Sides,
    sides_ahead: Sides,
    /// At another point inside the step.
    sides_inside: Sides,
    /// The end of the current step, once it was reached and judged.
    pub(super) judgement: Option<Judgement>,
    /// The last one of an attempt at the current step.
    pub(super) attempted: Judgement,
    /// Where what acts changed abruptly within the steps across one.
    pub(super) abrupt: Option<f64>,
    /// Of redundant rows that lost rank alone: those that serve.
    pub(super) serving: Option<Vec<usize>>,
    /// Steps in a row that were shortened for a dead point of the choice, or next to a singular position.
    pub(super) spoilt_in_a_row: u32,
    /// Largest rate and acceleration at the end of the step that was judged, in characteristic displacements.
    fastest: (f64, f64),
}

impl CrossingMonitor {
    pub(super) fn new(size: Size) -> Self {
        Self {
            crossing: Crossing::default(),
            next: Course::Along,
            checkpoints: Checkpoints::new(size.nq, size.nv),
            step_start: StepBoundary::new(size.nq, size.nv),
            step_end: StepBoundary::new(size.nq, size.nv),
            others: None,
            margin_before: None,
            pacing: Pacing::Fixed,
            sides: Sides::new(size.rows),
            sides_ahead: Sides::new(size.rows),
            sides_inside: Sides::new(size.rows),
            judgement: None,
            attempted: Judgement::REGULAR,
            abrupt: None,
            serving: None,
            spoilt_in_a_row: 0,
            fastest: (0.0, 0.0),
        }
    }

    /// Is the next step one across a singular position?
    pub(super) fn crosses_next(&self) -> bool {
        self.next == Course::Across
    }

    /// What the end of the step shows.
    pub(super) fn judge(&mut self, judgement: Judgement) {
        (self.judgement, self.attempted) = (Some(judgement), judgement);
    }

    /// The branch was lost in the step that was judged.
    pub(super) fn lose(&mut self) {
        self.judge(Judgement { shown: Shown::Lost, ..self.attempted });
    }

    /// Did C_D change sides over the step that was judged?
    pub(super) fn flipped(&self) -> bool {
        self.attempted.side == SideChange::Changed
    }

    /// Is the step that was judged one across a singular position?
    pub(super) fn crosses_now(&self) -> bool {
        self.flipped() || self.crosses_next()
    }

    /// Does the step that was judged pass a singular position, or is one expected?
    pub(super) fn passes_a_singular_position(&self) -> bool {
        self.crosses_now() || self.crossing.zero().is_some()
    }

    /// The rate at which the distance falls at the most: by no more than the motion moves.
    pub(super) fn rate(&self) -> f64 {
        self.fastest.0
    }

    /// Length of the step that was judged; none before the first.
    pub(super) fn length(&self) -> Option<f64> {
        let (from, to) = (&self.step_start, &self.step_end);
        (!from.v().is_empty() && !to.v().is_empty()).then(|| (to.t() - from.t()).abs())
    }
}

impl<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>, P: Positions<'s, S, T>> Motion<'s, S, T, P> {
    /// Distance from a singular position at this time after the state (t, y), by the present plan.
    pub(super) fn probe(&mut self, t: f64, y: &[f64], ahead: f64) -> Probe {
        // where a drive leads to the limit of a loop nothing lies beyond
        if P::CLOSED && self.k == 0 {
            return Probe::Unknown;
        }
        if self.levels_of != LevelsOf::Planning && self.evaluate(t, y).is_err() {
            return Probe::Unknown;
        }
        self.levels_of = LevelsOf::Elsewhere;
        let Some((_, plan)) = self.tangent.margin() else { return Probe::Unknown };
        self.tangent.full_acceleration(&mut self.vdot);
        let v = &self.tangent.seen().at.v;
        let moved: Vec<f64> = v.iter().zip(&self.vdot).map(|(v, a)| ahead * (v + 0.5 * ahead * a)).collect();
        let mut q = self.positions.q().to_vec();
        self.system.step(&mut q, &moved);
        let there = t + ahead;
        let found = self.tangent.reduction().position(there, &q);
        let by_plan = match found.and_then(|()| self.tangent.tangent(there, &q, false)) {
            // a plan made there would be for a point that the step avoids; one for here follows with the next
            // evaluation
            Ok(()) => match self.tangent.margin() {
                Some((distance, same)) if same == plan => {
                    let beyond = self.changed().is_some_and(|changed| changed > 0);
                    Probe::Distance(if beyond { -distance } else { distance })
                }
                _ => Probe::Unknown,
            },
            Err(_) => Probe::Unknown,
        };
        let Some(others) = self.others(there, &q) else { return by_plan };
        let kept = if let Probe::Distance(kept) = by_plan { kept.abs() } else { 0.0 };
        let distance = kept.max(others.distance);
        self.monitor.others = (kept < tolerance::MUCH_SMALLER * others.distance).then_some(others);
        Probe::Distance(distance)
    }

    /// Number of blocks of C_D that at the point last evaluated are on another side than at the start of the step under
    /// way.
    fn changed(&mut self) -> Option<usize> {
        let monitor = &mut self.monitor;
        self.tangent.sides(&mut monitor.sides_inside);
        let comparable = monitor.sides_inside.choice() == monitor.sides.choice();
        comparable.then(|| monitor.sides.changed(&monitor.sides_inside))
    }

    /// Whether there are rows that are not kept.
    fn is_redundant(&self) -> bool {
        self.tangent.seen().rank() < self.system.size().rows
    }

    /// Of redundant rows those kept lose rank in positions where the mechanism is regular: those that serve best at (t,
    /// q). None where there are no other rows.
    pub(super) fn others(&self, t: f64, q: &[f64]) -> Option<ReplacementRows> {
        if !self.is_redundant() {
            return None;
        }
        let rank = self.tangent.seen().rank();
        let mut best = Reduction::new(self.system.clone(), rank).keeping(&self.tangent.seen().planned.partition.rows);
        choose_partition(&mut best, t, q, None, None).ok()?;
        Some(ReplacementRows { distance: best.distance().0, rows: best.planned.partition.rows })
    }

    /// Distance from a singular position at the point (t, q) last evaluated, inside the step that was judged, and the
    /// sides of C_D: of the rows kept, unless they are nearer to dependence than to any position at the ends.
    pub(super) fn side_inside(&mut self, t: f64) -> Option<Side> {
        let (distance, _) = self.tangent.margin()?;
        // where another choice was made on the way the distance alone tells
        let changed = self.changed();
        let of_blocks = changed.and_then(|_| self.monitor.sides_inside.clearance());
        let changed = changed.unwrap_or(0);
        let at_ends = self.margins().into_iter().flatten().fold(0.0, f64::max);
        let others = (distance < tolerance::MUCH_SMALLER * at_ends).then(|| self.others(t, self.positions.q()));
        let distance = others.flatten().map_or(distance, |x| x.distance.max(distance));
        Some(Side { distance, clearance: of_blocks.map_or(distance, |x| x.max(distance)), changed })
    }

    /// Keep other rows from (t, y) on, if a look ahead found those in use about to lose rank and others not.
    fn keep_others(&mut self, t: f64, y: &[f64]) -> Result<()> {
        let Some(others) = self.monitor.others.take() else { return Ok(()) };
        self.evaluate(t, y)?;
        let r = self.tangent.reduction();
        let serves = r.keep_rows(t, &others.rows).is_ok() && r.distance().0 > tolerance::MUCH_SMALLER * others.distance;
        if !serves {
            r.factor(t)?;
            r.exchange_rows(t)?; // those that are best here
        }
        self.tangent.sides(&mut self.monitor.sides);
        self.monitor.margin_before = None;
        Ok(())
    }

    /// The end of a step, the point last evaluated: was a singular position crossed, and was the branch kept?
    pub(super) fn look_back(&mut self, t: f64) {
        self.tangent.full_acceleration(&mut self.vdot);
        let r = self.tangent.seen();
        let largest =
            |x: &[f64]| (0..x.len()).fold(0.0, |m: f64, i| m.max(x[i].abs() / self.system.structure().displacement(i)));
        self.monitor.fastest = (largest(&r.at.v), largest(&self.vdot));
        self.monitor.step_end.start(t, self.positions.q(), &r.at.v, &self.vdot);
        self.monitor.judge(Judgement::REGULAR);
        if self.margin.is_none() {
            return;
        }
        self.tangent.sides(&mut self.monitor.sides_ahead);
        let mut side = SideChange::Same;
        if self.monitor.sides.differ(&self.monitor.sides_ahead) {
            let loss = self.loss();
            if !matches!(loss, Loss::Mechanism) {
                self.monitor.serving = if let Loss::Rows(rows) = loss { Some(rows) } else { None };
                if self.monitor.spoilt_in_a_row < MOST_SPOILT {
                    self.monitor.judge(Judgement { side, shown: Shown::Spoilt });
                }
                return;
            }
            side = SideChange::Changed;
        }
        self.monitor.judge(Judgement { side, shown: Shown::Regular });
        let flipped = side == SideChange::Changed;
        if !flipped && self.monitor.crossing.zero().is_some_and(|zero| zero < t) && self.stays_clear() {
            self.monitor.crossing.forget();
        }
        if P::CLOSED {
            return; // positions on another branch are distinguished where they are solved for
        }
        // a singular position that was not foreseen is crossed by a step of its own
        let unforeseen = flipped && self.monitor.crossing.zero().is_none();
        let crosses = flipped || self.monitor.crossing.zero().is_some();
        let near = self.margins().into_iter().flatten().any(|m| m < JUDGED_NEAR);
        let scales = self.tangent.seen().scales();
        let jumps = (crosses || near) && !self.monitor.step_start.continues_to(&self.monitor.step_end, scales);
        // a step that ends in the position itself goes on by rounding alone
        let lands = self.margin.is_some_and(|m| m.0 < tolerance::LANDED);
        let barred = lands && !crosses && self.monitor.crossing.is_barred();
        let shown = match self.monitor.pacing {
            Pacing::Free if crosses && (unforeseen || jumps || lands) => Shown::Lost,
            Pacing::Free if jumps || barred => Shown::Jumped,
            _ => Shown::Regular,
        };
        self.monitor.judge(Judgement { side, shown });
    }

    /// Singular positions that the step that was judged may have passed unforeseen.
    pub(super) fn passing(&self) -> Option<Passing> {
        let at_ends = self.margins().into_iter().flatten().fold(f64::INFINITY, f64::min);
        let barred = self.monitor.crossing.is_barred();
        let near = match self.monitor.spoilt_in_a_row < MOST_SPOILT {
            true => JUDGED_NEAR.min(tolerance::MUCH_SMALLER * at_ends),
            false => 0.0,
        };
        let may = self.monitor.flipped() || self.may_flip_twice();
        may.then(|| Passing { rate: self.monitor.rate(), repeats: !P::CLOSED && !barred, near })
    }

    /// Whether C_D may have changed sides twice over the step that was judged: the distance falls by no more than the motion
    /// moves.
    pub(super) fn may_flip_twice(&self) -> bool {
        let ([Some(one), Some(two)], Some(h)) = (self.margins(), self.monitor.length()) else { return false };
        let (moves, monitor) = (h * self.monitor.rate(), &self.monitor);
        let clear = one + two >= moves || monitor.sides.stay_regular(&monitor.sides_ahead, moves);
        !clear && !monitor.crossing.is_barred()
    }

    /// Distances at both ends of the step that was judged.
    pub(super) fn margins(&self) -> [Option<f64>; 2] {
        [self.monitor.margin_before, self.margin].map(|m| m.map(|m| m.0))
    }

    /// The next evaluations lie inside a step with these distances at its ends.
    pub(super) fn replay_between(&mut self, margins: [f64; 2]) {
        let [before, after] = margins.map(|distance| (!distance.is_nan()).then_some((distance, 0)));
        (self.monitor.margin_before, self.margin) = (before, after);
        self.levels_of = LevelsOf::Elsewhere;
        self.monitor.next = Course::Along;
    }

    /// What lost rank in the step that was judged, in which C_D changed sides?
    fn loss(&self) -> Loss {
        let (one, two) = (&self.monitor.step_start, &self.monitor.step_end);
        let (half_t, half) = self.half_way();
        let ends = [(one.t(), one.q()), (two.t(), two.q())];
        dead_point::loss(self.tangent.seen(), ends, (half_t, &half))
    }

    /// Redundant rows: is the mechanism as far from singular half-way through the step that was judged as at its ends?
    /// Rows kept come near to dependence elsewhere, and what their distance foretells need not be there.
    fn stays_clear(&self) -> bool {
        let at_ends = self.margins().into_iter().flatten().fold(f64::INFINITY, f64::min);
        let (t, q) = self.half_way();
        self.others(t, &q).is_some_and(|half| half.distance > tolerance::MUCH_SMALLER * at_ends)
    }

    /// Is the position last evaluated, inside the step that was judged, singular for all that can be computed? Next to
    /// one v is
    /// off by round-off over the distance, v' by that over its square.
    pub(super) fn is_at_a_singular_position(&mut self) -> bool {
        let here = self.tangent.margin();
        self.is_singular(here)
    }

    /// Whether a position with this margin is one.
    pub(super) fn is_singular(&self, here: Option<(f64, u64)>) -> bool {
        let at_ends = self.margins().into_iter().flatten().fold(0.0, f64::max);
        at_ends > 0.0 && here.is_none_or(|(here, _)| here < tolerance::AT_SINGULARITY * at_ends)
    }

    /// Half-way through the step that was judged.
    pub(super) fn half_way(&self) -> (f64, Vec<f64>) {
        let (from, to) = (&self.monitor.step_start, &self.monitor.step_end);
        let t = 0.5 * (from.t() + to.t());
        let (mut q, mut moved) = (from.q().to_vec(), vec![0.0; from.v().len()]);
        from.displacement(to, t, &mut moved);
        self.system.step(&mut q, &moved);
        (t, q)
    }

    /// When C_D was singular within the step to t that was judged, in which it changed sides: by the distances at both its
    /// ends, which are of one choice, or, where the first is not known, as foreseen.
    pub(super) fn flip(&self, t: f64) -> Option<f64> {
        let (from, h) = (self.monitor.step_start.t(), t - self.monitor.step_start.t());
        let between = || match self.margins() {
            [Some(one), Some(two)] if one + two > 0.0 => from + h * one / (one + two),
            _ => self.monitor.crossing.zero().filter(|zero| (from..t).contains(zero)).unwrap_or(from + 0.5 * h),
        };
        self.monitor.flipped().then(between)
    }

    /// Where the choice alone was singular in the step that was judged, not the mechanism, and nothing replaces it: its
    /// error.
    fn choice_lost(&self) -> Option<SystemError> {
        if self.monitor.step_start.q().is_empty() || self.monitor.step_end.q().is_empty() {
            return None;
        }
        let Loss::Coordinates = self.loss() else { return None };
        let (t, q) = self.half_way();
        let singular = SystemError::Singular { t, pivot: 0.0, limit: tolerance::SINGULAR_PIVOT };
        match self.tangent.blame(t, &q, singular) {
            SystemError::Singular { .. } => None,
            e => Some(e),
        }
    }

    /// The error of a singular position at t that no step crossed.
    pub(super) fn not_crossed(&self, t: f64) -> SystemError {
        if let Some(e) = self.choice_lost() {
            return e;
        }
        let r = self.tangent.seen();
        let row = r.weakest_row().map_or_else(String::new, |row| self.system.structure().rows[row].name.to_string());
        let (tries, jumped) = self.monitor.crossing.tries();
        let outcome = match self.monitor.abrupt {
            Some(at) => CrossingOutcome::Abrupt { at },
            None if jumped || tries == 0 => CrossingOutcome::Jumped,
            None => CrossingOutcome::Unsolved,
        };
        SystemError::Crossing { t, tries, row: row.into(), outcome }
    }

    /// The step that was judged lost the branch: cross with another length, or from farther away.
    pub(super) fn cross_again(&mut self, step: &mut Step) -> Result<bool, SystemError> {
        let located = step.findings.located.and_then(|located| located.first().copied());
        let lost = self.monitor.attempted.shown == Shown::Lost;
        let zero = located
            .or_else(|| self.monitor.crossing.zero())
            .or_else(|| self.flip(self.monitor.step_end.t()))
            .unwrap_or(step.t);
        if let Some(pace) = step.pace.as_deref_mut() {
            let advice = match self.monitor.crossing.zero() {
                None => self.monitor.crossing.found(zero, step.t, pace),
                Some(_) => self.monitor.crossing.again(zero, step.t, lost, pace),
            };
            if !matches!(advice, Advice::GiveUp { .. }) {
                self.monitor.next = if advice == Advice::Crossing { Course::Across } else { Course::Along };
                self.derivative_by_levels(step.t, step.y, step.dy)?;
                return Ok(true);
            }
        }
        if let Some(to) = self.monitor.crossing.back(zero) {
            if self.go_back(zero, to, step)? {
                return Ok(true);
            }
        }
        if let Some(pace) = step.pace.as_deref_mut() {
            if self.monitor.crossing.nearer(zero, step.t, pace) {
                self.monitor.next = Course::Along;
                self.derivative_by_levels(step.t, step.y, step.dy)?;
                return Ok(true);
            }
        }
        Err(self.not_crossed(zero))
    }

    /// Set the integration back to a state not after `to`, before the singular position at `zero`. False where none is
    /// left.
    pub(super) fn go_back(&mut self, zero: f64, to: f64, step: &mut Step) -> Result<bool, SystemError> {
        let (p, w) = self.offsets();
        let (Some(checkpoint), Some(pace)) = (self.monitor.checkpoints.back_to(to), step.pace.as_deref_mut()) else {
            return Ok(false);
        };
        let (t, mut q) = (checkpoint.t, checkpoint.q);
        self.tangent.resume(t, &mut q, &checkpoint.v)?;
        self.positions.start(&mut self.tangent, t, &q, step.y);
        self.tangent.select(&checkpoint.v, &mut step.y[p..w]);
        if self.observes_work {
            step.y[w] = checkpoint.work;
        }
        self.prescribed.start(&q, &checkpoint.v, &mut step.y[self.layout.beside..]);
        step.turns.copy_from_slice(&checkpoint.turns);
        step.t = t;
        self.monitor.crossing.put_back(zero, pace);
        self.monitor.next = Course::Across;
        self.derivative_by_levels(t, step.y, step.dy)?;
        self.margin = self.tangent.margin();
        self.look_back(t);
        self.begin();
        Ok(true)
    }

    /// The next step begins where the one that was judged ended.
    pub(super) fn begin(&mut self) {
        std::mem::swap(&mut self.monitor.step_start, &mut self.monitor.step_end);
        std::mem::swap(&mut self.monitor.sides, &mut self.monitor.sides_ahead);
        (self.monitor.judgement, self.monitor.attempted) = (None, Judgement::REGULAR);
        self.monitor.abrupt = None;
        if self.tangent.choice_of_sides() != self.monitor.sides.choice() {
            self.tangent.sides(&mut self.monitor.sides); // of a choice made at the end
            self.margin = self.tangent.margin();
        }
        self.monitor.margin_before = self.margin;
    }

    /// Length, not above `longest`, of the first step on the other side of a guard: over it the new load changes the
    /// velocities by a small part. Stages of a longer one would all miss the load, and agree.
    fn first_inside(&mut self, step: &Step, longest: f64) -> Result<f64> {
        let (p, w) = self.offsets();
        let norm = |motion: &Self, x: &dyn Fn(usize) -> f64| {
            (0..w - p).map(|j| (x(j) / motion.tangent.natural_size(j)).powi(2)).sum::<f64>().sqrt()
        };
        // driven coordinates move as well, where the independent velocities may be zero
        let speed = norm(self, &|j| step.y[p + j]).max(self.monitor.fastest.0);
        let ((mut y, mut dy), mut h) = (std::mem::take(&mut self.ahead), longest);
        y.resize(step.y.len(), 0.0);
        dy.resize(step.dy.len(), 0.0);
        let mut found = Ok(());
        for _ in 0..MOST_TRIED {
            y.iter_mut().zip(step.y.iter().zip(&*step.dy)).for_each(|(y, (from, rate))| *y = from + h * rate);
            let change = match self.derivative_by_levels(step.t + h, &y, &mut dy) {
                Ok(()) => h * norm(self, &|j| dy[p + j] - step.dy[p + j]),
                Err(e) if e.is_local() => f64::INFINITY,
                Err(e) => {
                    found = Err(e);
                    break;
                }
            };
            if change <= tolerance::VISIBLE_CHANGE * speed {
                break;
            }
            h *= (0.5 * tolerance::VISIBLE_CHANGE * speed / change).sqrt().max(FELT_SHORTER);
        }
        self.ahead = (y, dy);
        found.map(|()| h)
    }

    /// How the integration continues from (t, y).
    pub(super) fn plan_ahead(&mut self, step: &mut Step) -> Result<bool, SystemError> {
        let Some(pace) = step.pace.take() else {
            self.monitor.next = Course::Along;
            return Ok(false);
        };
        self.monitor.pacing = Pacing::Free;
        let (rate, acceleration) = self.monitor.fastest;
        if self.tangent.seen().rank() > 0 && rate > 0.0 {
            pace.next = pace.next.min(LONGEST_MARCH / rate);
        }
        if let Some(longest) = step.findings.longest {
            pace.next = self.first_inside(step, pace.next.min(longest))?;
        }
        // v h + v' h^2 / 2 = CROSSING_MOVE
        let whole = 2.0 * CROSSING_MOVE / (rate + (rate * rate + 2.0 * CROSSING_MOVE * acceleration).sqrt());
        let mut crossing = std::mem::take(&mut self.monitor.crossing);
        let (t, y) = (step.t, &*step.y);
        let advice = crossing.foresee(t, pace, self.margin, whole, |ahead| self.probe(t, y, ahead));
        self.monitor.crossing = crossing;
        let nears = self.monitor.crossing.is_expected() && self.monitor.others.is_none();
        if nears && advice == Advice::Free && self.is_redundant() {
            // rows that come near to dependence in the next step are replaced before it
            self.probe(t, y, pace.next);
        }
        self.keep_others(t, y)?;
        self.monitor.next = if advice == Advice::Free { Course::Along } else { Course::Across };
        if let Advice::GiveUp { zero } = advice {
            return Err(self.not_crossed(zero));
        }
        if let Advice::Back { zero, to } = advice {
            step.pace = Some(pace);
            if self.go_back(zero, to, step)? {
                return Ok(true);
            }
            if let Some(pace) = step.pace.as_deref_mut() {
                self.monitor.crossing.cross(zero, pace);
            }
        } else if !P::CLOSED {
            let (w, apart) = (self.work(y), 0.25 * self.monitor.crossing.whole());
            let (q, v) = (&y[..self.system.size().nq], self.monitor.step_start.v());
            self.monitor.checkpoints.push(t, apart, (q, v), w, step.turns);
        }
        Ok(false)
    }
}
