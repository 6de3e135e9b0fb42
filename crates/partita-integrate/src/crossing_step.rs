//! Steps across singular positions by Gauss collocation, behind the contract of a stepper.

use crate::collocation::{refined, solve, Guess, Stages, Task, LESS, MORE, RULES};
use crate::counters::Counters;
use crate::failure::StepFailure;
use crate::ode::{Ode, RhsError};
use crate::options::Options;
use crate::scheme::{Scheme, Taken};
use crate::step_size::ErrorNorm;
use crate::stepper::{Conclusion, CurrentStep, StepControl, StepEnd, StepPlan, StepStorage, Stepper};
use partita_math::tolerance;
use std::fmt::Display;
use std::sync::LazyLock;

/// Sweeps that stop converging below this are limited by rounding. Scale: fraction of the largest change. Reason: four
/// digits were gained; sweeps that do not converge gain none.
const SWEEPS_AT_REST: f64 = 1e-4;
/// Number of rules whose nodes must be clear of the position; more are rarely needed.
const USUAL: usize = 5;
/// Limits of the lengths of steps across one position. Unit: fraction of the length that the motion suggests. Reason:
/// collocation gains two digits or more by each halving, so three serve where one can.
const CROSSING_LENGTHS: [f64; 4] = [1.25, 0.7, 0.4, 0.2];
/// A longer step keeps its nodes clearer by this. Scale: ratio of lengths. Reason: rounding falls by its square.
const LONGER: f64 = 1.3;
/// Shortest crossing step. Unit: multiples of the distance to the position. Reason: enough of the step must lie beyond
/// it.
const BEYOND: f64 = 1.25;
/// Lengths that are looked at for one whose nodes keep clear of a position.
const LENGTHS_TRIED: usize = 60;
/// Nodes of all rules but the last, which are seldom used.
static USUAL_NODES: LazyLock<Vec<f64>> =
    LazyLock::new(|| RULES[..USUAL].iter().flat_map(|nodes| nodes.c.iter().copied()).collect());

/// How clear the usual nodes of a step of length h keep of positions `ahead`.
fn clearance(h: f64, ahead: &[f64]) -> f64 {
    let of = |ahead: &f64| USUAL_NODES.iter().fold(f64::INFINITY, |least: f64, c| least.min((c * h - ahead).abs()));
    ahead.iter().map(of).fold(f64::INFINITY, f64::min)
}

/// The length between both that keeps clearest of positions `ahead`.
fn clearest(shortest: f64, longest: f64, ahead: &[f64]) -> f64 {
    let tried = (0..=LENGTHS_TRIED).map(|i| shortest + (longest - shortest) * i as f64 / LENGTHS_TRIED as f64);
    let first = (longest, clearance(longest, ahead));
    let best = tried.map(|h| (h, clearance(h, ahead))).fold(first, |best, at| if at.1 > best.1 { at } else { best });
    best.0
}

/// The length of an attempt: between these limits, that which keeps clearest of the position `ahead`.
#[derive(Clone, Copy, Debug)]
struct Length {
    shortest: f64,
    longest: f64,
    ahead: f64,
}

impl Length {
    fn given(h: f64) -> Self {
        Self { shortest: h, longest: h, ahead: f64::NAN }
    }

    fn find(self) -> f64 {
        match self.shortest < self.longest {
            true => clearest(self.shortest, self.longest, &[self.ahead]),
            false => self.longest,
        }
    }
}

/// Lengths of a step across a position `ahead`, ever shorter ones, each with the position between two other nodes. `whole`
/// is the length that motion and accuracy suggest; none is longer than `rest`.
fn lengths(ahead: f64, whole: f64, rest: f64) -> impl Iterator<Item = Length> {
    let least = BEYOND * ahead;
    CROSSING_LENGTHS.windows(2).enumerate().filter_map(move |(i, pair)| {
        let (longest, shortest) = ((pair[0] * whole).max(least), (pair[1] * whole).max(least));
        let found = Length { shortest: shortest.min(rest), longest: longest.min(rest), ahead };
        (longest > shortest || i == 0).then_some(found)
    })
}

/// Steps across singular positions, behind the contract of a stepper.
#[derive(Debug)]
pub struct CrossingStep {
    t_old: f64,
    t_new: f64,
    t_end: f64,
    y_old: Vec<f64>,
    dy_old: Vec<f64>,
    y_new: Vec<f64>,
    dy_new: Vec<f64>,
    /// What the end was corrected by.
    shift: Vec<f64>,
    length: f64,
    /// The longest that the motion suggests; was the last one tried so short that rounding spoilt it?
    longest: Length,
    rounded: bool,
    /// The attempts, one after the other, until a step is as exact as requested.
    lengths: Vec<Length>,
    norm: ErrorNorm,
    tolerances: Vec<f64>,
    allowed: Vec<f64>,
    stages: Option<Stages>,
    /// The least error of the steps that failed since the last one that was taken, in tolerances.
    least_error: f64,
    counters: Counters,
}

impl CrossingStep {
    /// For an equation of dimension `dim`.
    pub fn new(dim: usize, options: &Options) -> Self {
        let zeros = || vec![0.0; dim];
        Self {
            t_old: 0.0,
            t_new: 0.0,
            t_end: 0.0,
            y_old: zeros(),
            dy_old: zeros(),
            y_new: zeros(),
            dy_new: zeros(),
            shift: zeros(),
            length: 0.0,
            longest: Length::given(0.0),
            rounded: false,
            lengths: Vec::new(),
            norm: ErrorNorm::new(options, None, dim, crate::combination::padded(dim)),
            tolerances: zeros(),
            allowed: zeros(),
            stages: None,
            least_error: f64::INFINITY,
            counters: Counters::default(),
        }
    }

    /// The least error of the steps that failed since the last one that was taken, in tolerances.
    pub fn least_error(&self) -> f64 {
        self.least_error
    }

    /// Whether the attempted step has a polynomial, exact or not.
    pub fn has_polynomial(&self) -> bool {
        self.stages.is_some()
    }

    /// Plan a step from `t_old` across the position at `zero`; `whole` is the length that has served, `longest` the
    /// one that the motion suggests, `tries` how often it was tried before. It ends at `t_end` at the latest.
    pub fn aim(&mut self, zero: f64, (whole, longest): (f64, f64), tries: usize, t_end: f64) {
        let (ahead, rest) = (zero - self.t_old, t_end - self.t_old);
        self.lengths.clear();
        self.lengths.extend(lengths(ahead, whole, rest));
        self.longest = lengths(ahead, longest, rest).next().unwrap_or(Length::given(rest));
        if tries == 0 {
            self.least_error = f64::INFINITY;
        }
        let first = tries % self.lengths.len();
        self.lengths.rotate_left(first);
        self.t_end = t_end;
    }

    /// End at `t_end` at the latest: the step that was planned is tried again within this.
    pub fn end_by(&mut self, t_end: f64) {
        let rest = t_end - self.t_old;
        for length in self.lengths.iter_mut().chain([&mut self.longest]) {
            (length.shortest, length.longest) = (length.shortest.min(rest), length.longest.min(rest));
        }
        self.t_end = t_end;
    }

    /// The attempted step crosses the positions at `zeros`: plan another one if one of them lies close to a node. True if
    /// so.
    pub fn aim_again(&mut self, zeros: &[f64]) -> bool {
        let (h, t) = (self.t_new - self.t_old, self.t_old);
        let ahead: Vec<f64> = zeros.iter().map(|zero| zero - t).collect();
        let Some(last) = ahead.last() else { return false };
        let (shortest, longest) = ((0.7 * h).max(BEYOND * last), (1.3 * h).max(BEYOND * last));
        let better = clearest(shortest, longest, &ahead).min(self.t_end - t);
        let poor = clearance(h, &ahead) < tolerance::MUCH_SMALLER * clearance(better, &ahead);
        if poor {
            self.lengths.clear();
            self.lengths.push(Length::given(better));
            self.counters.rejected += 1;
        }
        poor
    }

    /// The state at `t` in the attempted step, its end not corrected.
    pub fn polynomial(&self, t: f64, out: &mut [f64]) {
        out.copy_from_slice(&self.y_old);
        if let Some(stages) = &self.stages {
            stages.advance((t - self.t_old) / (self.t_new - self.t_old), out);
        }
    }

    /// The step of length h by as many nodes as it takes.
    fn solved<E: Display>(
        &mut self,
        ode: &mut dyn Ode<Error = E>,
        h: f64,
    ) -> Result<Option<Solved>, (f64, RhsError<E>)> {
        for (i, (to, allowed)) in self.tolerances.iter_mut().zip(&mut self.allowed).enumerate() {
            *to = self.norm.tolerance(i, &self.y_old);
            let moved = self.norm.size(i).max(self.y_old[i].abs()).max((h * self.dy_old[i]).abs());
            *allowed = to.max(tolerance::SINGULAR_ROUNDING * moved);
        }
        let task = Task { t: self.t_old, y: &self.y_old, h, tolerances: &self.tolerances, allowed: &self.allowed };
        match by_sweeps(ode, &task, &self.dy_old, &mut self.counters)? {
            Sweeps::Converged(found) => return Ok(Some(found)),
            Sweeps::Slow => return Ok(None),
            Sweeps::Rounded(found) => {
                self.rounded = true;
                return Ok(Some(found));
            }
            Sweeps::Diverging => {}
        }
        let still = vec![0.0; self.y_old.len()];
        let [first, second, third] = [LESS, MORE, MORE + 1].map(|i| &RULES[i]);
        let judged = |stages: Stages, other: &Stages| {
            let [error, beyond] = stages.differ(other, [task.tolerances, task.allowed]);
            Solved { error, beyond, stages }
        };
        let Some(few) = solve(ode, &task, first, Guess::Line(&self.dy_old, &still), &mut self.counters)? else {
            return Ok(None);
        };
        let more = judged(refined(ode, &task, &few, second, &mut self.counters)?, &few);
        if more.error <= 1.0 {
            return Ok(Some(more));
        }
        let Some(more) = solve(ode, &task, second, Guess::Like(&more.stages), &mut self.counters)? else {
            return Ok(None);
        };
        Ok(Some(judged(refined(ode, &task, &more, third, &mut self.counters)?, &more)))
    }
}

/// The outcome of sweeps over an increasing number of nodes.
enum Sweeps {
    Converged(Solved),
    /// They converge, but no rule would be accurate enough: the step is too long.
    Slow,
    /// They do not converge.
    Diverging,
    /// They are limited by rounding: the step is too short, its nodes are too near the position.
    Rounded(Solved),
}

/// A step by sweeps over an increasing number of nodes, two by each rule, since each gains an order.
fn by_sweeps<E: Display>(
    ode: &mut dyn Ode<Error = E>,
    task: &Task,
    slope: &[f64],
    counters: &mut Counters,
) -> Result<Sweeps, (f64, RhsError<E>)> {
    let first = &RULES[0];
    let mut stages = Stages { nodes: first, h: task.h, rates: slope.repeat(first.count()) };
    let (mut last, mut raised, mut largest, mut poor) = (f64::INFINITY, f64::INFINITY, 0.0f64, 0);
    let stalled = |found: Solved, largest: f64| match found.error < SWEEPS_AT_REST * largest {
        true => Sweeps::Rounded(found),
        false => Sweeps::Diverging,
    };
    for (index, nodes) in RULES.iter().enumerate().flat_map(|(i, nodes)| [(i, nodes), (i, nodes)]) {
        let found = match refined(ode, task, &stages, nodes, counters) {
            Ok(found) => found,
            // a node so near the position that nothing can be evaluated there: others lie elsewhere
            Err((_, RhsError::Retry(_))) => continue,
            Err(fatal) => return Err(fatal),
        };
        let more = nodes.count() > stages.nodes.count();
        let [error, beyond] = found.differ(&stages, [task.tolerances, task.allowed]);
        stages = found;
        if !error.is_finite() {
            return Ok(Sweeps::Diverging);
        }
        poor = if error < tolerance::CONVERGES * last { 0 } else { poor + 1 };
        (last, largest) = (error, largest.max(error));
        if poor > 2 {
            return Ok(stalled(Solved { stages, error, beyond }, largest));
        }
        if !more {
            continue;
        }
        if error <= 1.0 || (beyond <= 1.0 && poor > 0) {
            return Ok(Sweeps::Converged(Solved { stages, error, beyond }));
        }
        // as much gained by each of the rules that are left
        let gain = error / std::mem::replace(&mut raised, error);
        if gain > 0.0 && beyond * gain.powi((RULES.len() - 1 - index) as i32) > 1.0 {
            return Ok(match gain < tolerance::CONVERGES {
                true => Sweeps::Slow,
                false => stalled(Solved { stages, error, beyond }, largest),
            });
        }
    }
    Ok(Sweeps::Slow)
}

/// A step, and what it is off by: in tolerances, and in what rounding next to the position excuses.
struct Solved {
    stages: Stages,
    error: f64,
    beyond: f64,
}

impl StepControl for CrossingStep {
    fn current(&self) -> CurrentStep<'_> {
        CurrentStep {
            t_old: self.t_old,
            t_new: self.t_new,
            t_end: self.t_end,
            y_old: &self.y_old,
            dy_old: &self.dy_old,
            y_new: &self.y_new,
            dy_new: &self.dy_new,
            next: self.length,
            may_shrink: false,
        }
    }
    fn counters(&self) -> &Counters {
        &self.counters
    }
    fn plan(&mut self, plan: &StepPlan) {
        self.lengths.clear();
        self.lengths.push(Length::given(plan.length));
    }
    fn set_sizes(&mut self, sizes: &[f64]) {
        self.norm.set_sizes(sizes);
    }
    fn replace_start(&mut self, t: f64, y: &[f64], dy: &[f64]) {
        (self.t_old, self.t_new) = (t, t);
        self.y_old.copy_from_slice(y);
        self.dy_old.copy_from_slice(dy);
    }
    fn commit(&mut self) {
        self.t_old = self.t_new;
        std::mem::swap(&mut self.y_old, &mut self.y_new);
        std::mem::swap(&mut self.dy_old, &mut self.dy_new);
        self.least_error = f64::INFINITY;
        self.counters.steps += 1;
    }
    fn reject(&mut self, factor: f64) {
        let length = factor * (self.t_new - self.t_old);
        self.plan(&StepPlan { length, goal: None });
        self.counters.rejected += 1;
    }
    fn end_at(&mut self, t: f64) {
        let length = t - self.t_old;
        self.plan(&StepPlan { length, goal: None });
        self.counters.rejected += 1;
    }
}

impl StepStorage for CrossingStep {
    fn save(&self, out: &mut Vec<f64>) -> bool {
        let Some(stages) = &self.stages else { return false };
        out.push(stages.h);
        out.extend_from_slice(&self.y_old);
        out.extend_from_slice(&self.shift);
        out.extend_from_slice(&stages.rates);
        true
    }
    fn load(&mut self, ends: (f64, f64), step: &[f64], _extra: &[f64]) {
        let dim = self.y_old.len();
        let (h, rest) = step.split_at(1);
        let (y_old, rest) = rest.split_at(dim);
        let (shift, rates) = rest.split_at(dim);
        (self.t_old, self.t_new) = ends;
        self.y_old.copy_from_slice(y_old);
        self.shift.copy_from_slice(shift);
        let nodes = RULES.iter().find(|nodes| nodes.count() * dim == rates.len());
        self.stages = nodes.map(|nodes| Stages { nodes, h: h[0], rates: rates.to_vec() });
    }
    fn taken(&self) -> Option<Taken> {
        let stages = self.stages.as_ref()?;
        let mut states = Vec::with_capacity(stages.nodes.count() * self.y_old.len());
        for c in &stages.nodes.c {
            let first = states.len();
            states.extend_from_slice(&self.y_old);
            stages.advance(*c, &mut states[first..]);
        }
        Some(Taken { scheme: Scheme::of_nodes(stages.nodes), states })
    }
}

impl<E: Display> Stepper<E> for CrossingStep {
    fn start(&mut self, ode: &mut dyn Ode<Error = E>, t: f64, y: &[f64], t_end: f64) -> Result<(), StepFailure<E>> {
        self.t_end = t_end;
        self.counters.evaluations += 1;
        let mut slope = std::mem::take(&mut self.dy_new);
        let evaluated = ode.rhs(t, y, &mut slope);
        self.replace_start(t, y, &slope);
        self.dy_new = slope;
        match evaluated {
            Ok(()) => Ok(()),
            Err(RhsError::Retry(error) | RhsError::Fatal(error)) => Err(StepFailure::Rhs { t, error }),
        }
    }

    fn attempt(&mut self, ode: &mut dyn Ode<Error = E>) -> Result<(), StepFailure<E>> {
        let (t, rest) = (self.t_old, self.t_end - self.t_old);
        let (mut best, mut last): (Option<Solved>, _) = (None, None);
        let mut nearest: Option<Solved> = None;
        let mut next = self.lengths.first().map(|x| x.find());
        let mut i = 0;
        while let Some(h) = next.map(|h| h.min(rest)) {
            self.rounded = false;
            match self.solved(ode, h) {
                // one that is no number is none
                Ok(Some(found))
                    if found.beyond
                        <= best
                            .as_ref()
                            .map_or(if self.rounded { tolerance::CLEARLY } else { 1.0 }, |best| best.beyond) =>
                {
                    best = Some(found)
                }
                Ok(Some(found)) if found.error.is_finite() => {
                    if nearest.as_ref().is_none_or(|nearest| found.error < nearest.error) {
                        nearest = Some(found);
                    }
                }
                Ok(_) => {}
                Err((_, RhsError::Retry(error))) => last = Some(error),
                Err((t, RhsError::Fatal(error))) => return Err(StepFailure::Rhs { t, error }),
            }
            if best.as_ref().is_some_and(|best| best.beyond <= 1.0) {
                break;
            }
            i += 1;
            next = match self.rounded {
                true => Some(self.longest.find()).filter(|longest| *longest > LONGER * h),
                false => self.lengths.get(i).map(|x| x.find()),
            };
            self.counters.rejected += u64::from(next.is_some());
        }
        let h = self.lengths.first().map_or(0.0, |x| x.find());
        let Some(Solved { stages, error, .. }) = best else {
            // not exact enough, but its polynomial shows where the position is
            if let Some(nearest) = &nearest {
                self.least_error = self.least_error.min(nearest.error);
                self.t_new = t + nearest.stages.h;
            }
            self.stages = nearest.map(|nearest| nearest.stages);
            return Err(StepFailure::TooSmall { t, h, last });
        };
        self.counters.lenient += u64::from(error > 1.0);
        self.length = stages.h;
        self.t_new = if stages.h == rest { self.t_end } else { t + stages.h };
        self.y_new.copy_from_slice(&self.y_old);
        stages.advance(1.0, &mut self.y_new);
        self.shift.copy_from_slice(&self.y_new);
        self.stages = Some(stages);
        Ok(())
    }

    fn conclude(&mut self, end: StepEnd<'_, E>) -> Result<Conclusion, StepFailure<E>> {
        let t = self.t_new;
        match end(t, &mut self.y_new, &mut self.dy_new, false) {
            Ok(evaluated) => self.counters.evaluations += u64::from(evaluated),
            Err(RhsError::Retry(error)) => {
                self.counters.evaluations += 1;
                return Err(StepFailure::TooSmall { t: self.t_old, h: self.length, last: Some(error) });
            }
            Err(RhsError::Fatal(error)) => return Err(StepFailure::Rhs { t, error }),
        }
        self.shift.iter_mut().zip(&self.y_new).for_each(|(shift, y)| *shift = y - *shift);
        Ok(Conclusion::Done)
    }

    fn interpolate(&mut self, _: &mut dyn Ode<Error = E>, t: f64, out: &mut [f64]) -> Result<(), StepFailure<E>> {
        self.polynomial(t, out);
        let x = (t - self.t_old) / (self.t_new - self.t_old);
        out.iter_mut().zip(&self.shift).for_each(|(out, shift)| *out += x * shift);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_crossing_step_keeps_clear_of_the_position_wherever_it_lies() {
        for ahead in [0.0, 1e-3, 0.02, 0.1, 0.3, 0.5, 0.6] {
            let found: Vec<f64> = lengths(ahead, 1.0, f64::MAX).map(Length::find).collect();
            assert!(found.windows(2).all(|pair| pair[1] < pair[0]), "{ahead}: {found:?}");
            for h in found {
                let clear = clearance(h, &[ahead]) > 5e-3 * h;
                assert!(clear && h >= 1.25 * ahead && (0.2..=1.25).contains(&h), "{ahead}: {h}");
            }
        }
    }
}
