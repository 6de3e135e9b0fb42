//! Thousands of positions for values of the goals, each on the branch of one state.

use super::continuation::{Continuation, Ending, Start};
use super::field::Duty;
use super::goal::Target;
use super::nearest::nearest;
use crate::instant::Levels;
use crate::outputs::{tables, Rows, Watch};
use partita_math::tolerance;
use partita_model::loop_closure::LoopClosing;
use partita_model::Model;
use partita_system::closing::Closing;
use partita_system::prelude::*;
use partita_system::SystemError;

/// Up to this many blocks, other signs are tried where a pose does not close on its branch.
const BLOCKS: usize = 6;

/// What became of a pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Assembled on the branch.
    Closed,
    /// The loops stay open there.
    Open,
    /// It closes, but not on this branch.
    OtherBranch,
    /// A position where branches meet blocks the path.
    Singular,
    /// The goals contradict each other.
    Contradiction,
}

impl Outcome {
    const ALL: [Self; 5] = [Self::Closed, Self::Open, Self::OtherBranch, Self::Singular, Self::Contradiction];

    /// In one word, for messages.
    pub fn word(self) -> &'static str {
        match self {
            Self::Closed => "closed",
            Self::Open => "open",
            Self::OtherBranch => "other branch",
            Self::Singular => "singular",
            Self::Contradiction => "contradiction",
        }
    }
}

/// Poses, row by row.
#[derive(Clone, Debug, Default)]
pub struct Poses {
    /// Coordinates; NaN where the pose was not assembled.
    pub q: Vec<f64>,
    /// What became of each.
    pub outcomes: Vec<Outcome>,
    /// Fraction of the direct path that the goals covered.
    pub reached: Vec<f64>,
    /// Closure error of the nearest position (m); NaN where it is not known.
    pub shortfall: Vec<f64>,
    /// As `shortfall`, for directions (rad).
    pub angle: Vec<f64>,
    /// Whether the direct continuation was abandoned.
    pub detour: Vec<bool>,
    /// Why the others were not assembled: number and sentence.
    pub reasons: Vec<(usize, String)>,
    /// Blocks of loops with their signs on this branch, where closed forms were used.
    pub branch: Option<Vec<(String, i8)>>,
}

/// One pose as numbers.
struct Found {
    outcome: Outcome,
    shortfall: f64,
    angle: f64,
    /// Row, block or goal that is at fault.
    culprit: usize,
    detour: bool,
}

impl Found {
    fn closed(detour: bool) -> Self {
        Self { outcome: Outcome::Closed, shortfall: 0.0, angle: 0.0, culprit: 0, detour }
    }
}

/// The rows of the tables in which poses are found.
const RESULT: usize = 5;

fn put(found: &Found, reached: &[f64], q: &[f64], i: usize, rows: &mut Rows) {
    let number = Outcome::ALL.iter().position(|x| *x == found.outcome).unwrap_or(0);
    match found.outcome {
        Outcome::Closed => rows.row(0, i).copy_from_slice(q),
        _ => rows.row(0, i).fill(f64::NAN),
    }
    rows.row(1, i).copy_from_slice(reached);
    let reported =
        [number as f64, found.shortfall, found.angle, found.culprit as f64, f64::from(u8::from(found.detour))];
    rows.row(2, i).copy_from_slice(&reported);
}

/// Positions in which the goals have the values of each row of `values`, on the branch of the closed position q.
///
/// The branch contains the positions reached from q by linear variation of the goals without meeting a limit or a
/// singular position. Where several goals are inputs from which all loops follow in closed form, the branch is given by
/// the signs of their blocks: a pose is found wherever it closes with these signs, even if the direct path is blocked.
/// Each pose depends only on its own values and on q.
///
/// # Errors
/// `Argument` where the values do not fit; those of functions that the model calls, and of `watch`.
pub fn many<E: Send + From<SystemError>>(
    model: &Model,
    t: f64,
    q: &[f64],
    targets: &[Target],
    values: &[f64],
    watch: Watch<E>,
) -> Result<Poses, E> {
    let width = targets.len();
    if width == 0 || values.len() % width != 0 {
        let message = format!("{} values do not fit {width} goals", values.len());
        return Err(SystemError::argument("targets", message).into());
    }
    let count = values.len() / width;
    let widths = [model.size().nq, width, RESULT];
    let chunk = if model.calls_functions() { usize::MAX } else { 1 };
    let start = Continuation::new(model, targets, t).start(q)?;
    for (i, &value) in values.iter().enumerate() {
        let (x, here) = (&targets[i % width], start.y[i % width]);
        if (value - here).abs() > tolerance::FARTHEST * x.displacement {
            let message = format!(
                "{} = {value} of pose {} is more than ten thousand radians, or lengths of the mechanism, away from \
                 its value {here:.6} {} in the state of the branch",
                x.name,
                i / width,
                x.unit
            );
            return Err(SystemError::argument("targets", message).into());
        }
    }
    let explicit = Explicit::new(model, t, q, targets, &start);
    let of = |i: usize| &values[i * width..][..width];
    let tables = match &explicit {
        Some(explicit) => {
            let row = |i: usize, room: &mut Option<Explicit>, rows: &mut Rows| {
                let Some(room) = room else {
                    let message = "the loops cannot be solved in a second order; give a state farther from a \
                        limit position";
                    return Err(SystemError::argument("near", message.into()).into());
                };
                let (found, reached) = room.pose(of(i))?;
                put(&found, &reached, &room.there, i, rows);
                Ok(())
            };
            tables(count, &widths, chunk, || explicit.again(), row, watch)?
        }
        None => {
            let row = |i: usize, room: &mut Numeric, rows: &mut Rows| {
                let (found, reached) = room.pose(of(i))?;
                put(&found, &reached, &room.there, i, rows);
                Ok(())
            };
            tables(count, &widths, chunk, || Numeric::new(model, t, targets, &start), row, watch)?
        }
    };
    let mut tables = tables.into_iter();
    let mut next = || tables.next().unwrap_or_default();
    let (q, reached, reported) = (next(), next(), next());
    let mut poses = Poses { q, reached, ..Poses::default() };
    for (i, x) in reported.chunks(RESULT).enumerate() {
        let outcome = Outcome::ALL[x[0] as usize];
        let found = Found { outcome, shortfall: x[1], angle: x[2], culprit: x[3] as usize, detour: x[4] != 0.0 };
        if outcome != Outcome::Closed {
            let reached = &poses.reached[i * width..][..width];
            let what = Asked { model, targets, wanted: of(i), reached, from: &start.y, free: &start.free };
            poses.reasons.push((i, what.reason(&found, explicit.as_ref())));
        }
        poses.outcomes.push(outcome);
        poses.shortfall.push(found.shortfall);
        poses.angle.push(found.angle);
        poses.detour.push(found.detour);
    }
    poses.branch = explicit.map(|x| {
        let words = x.closing.blocks().iter().map(|b| b.words.clone());
        words.zip(x.signs.iter().copied()).filter(|(_, sign)| *sign != 0).collect()
    });
    Ok(poses)
}

/// Poses by closed forms.
struct Explicit<'m> {
    model: &'m Model,
    t: f64,
    q: Vec<f64>,
    targets: &'m [Target],
    inputs: Vec<usize>,
    closing: LoopClosing<'m>,
    signs: Vec<i8>,
    there: Vec<f64>,
    before: Vec<f64>,
    trial: Vec<f64>,
    /// Pivots at q, and the position reached on the path.
    first: Vec<f64>,
    pivots: Vec<f64>,
    levels: Levels<'m, Model>,
}

impl<'m> Explicit<'m> {
    /// Where the goals are inputs that order all loops.
    fn new(model: &'m Model, t: f64, q: &[f64], targets: &'m [Target], start: &Start) -> Option<Self> {
        if start.rest > 0 || !start.free.iter().all(|f| *f) {
            return None;
        }
        let inputs: Option<Vec<usize>> = targets.iter().map(|x| x.own().map(|own| own.1)).collect();
        let inputs = inputs?;
        let closing = model.loop_closing(t, q, Some(&inputs)).ok()?;
        if !closing.is_explicit() {
            return None;
        }
        let signs = closing.state().iter().map(|s| s.branch).collect();
        let pivots: Vec<f64> = closing.state().iter().map(|s| s.pivot).collect();
        Some(Self {
            model,
            t,
            targets,
            inputs,
            closing,
            signs,
            q: q.to_vec(),
            there: q.to_vec(),
            before: q.to_vec(),
            trial: q.to_vec(),
            first: pivots.clone(),
            pivots,
            levels: Levels::new(model),
        })
    }

    /// The same for another thread: the plan follows from the position alone.
    fn again(&self) -> Option<Self> {
        Some(Self {
            closing: self.model.loop_closing(self.t, &self.q, Some(&self.inputs)).ok()?,
            q: self.q.clone(),
            inputs: self.inputs.clone(),
            signs: self.signs.clone(),
            there: self.q.clone(),
            before: self.q.clone(),
            trial: self.q.clone(),
            first: self.first.clone(),
            pivots: self.first.clone(),
            levels: Levels::new(self.model),
            ..*self
        })
    }

    fn set(&mut self, values: &[f64], part: f64) {
        for (x, &value) in self.targets.iter().zip(values) {
            if let Some((at, _)) = x.own() {
                self.trial[at] = if part == 1.0 { value } else { self.q[at] + (value - self.q[at]) * part };
            }
        }
    }

    /// Close the loops with the goals at this fraction of the path; otherwise the block that fails and its closure
    /// error.
    fn close(&mut self, values: &[f64], part: f64) -> Result<Option<(f64, usize)>, SystemError> {
        self.trial.clone_from(&self.there);
        self.set(values, part);
        match self.closing.close(self.t, &mut self.trial) {
            Ok(()) => {}
            Err(SystemError::Limit { block, shortfall, .. }) => {
                let index = self.closing.blocks().iter().position(|b| b.words.starts_with(&block)).unwrap_or(0);
                return Ok(Some((shortfall, index)));
            }
            Err(e) => return Err(e),
        }
        self.levels.position(self.t, &self.trial)?;
        let closure_error = |(i, x): (usize, &f64)| x.abs() / self.model.row_displacement(i).unwrap_or(1.0);
        let worst = self.levels.phi.iter().enumerate().map(closure_error).fold(0.0, f64::max);
        if !worst.is_finite() {
            return Err(SystemError::NotFinite { what: "a loop-closure constraint".into(), t: self.t });
        }
        if worst > tolerance::CLOSED_FORM {
            let raw = self.levels.phi.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            return Ok(Some((raw, 0)));
        }
        std::mem::swap(&mut self.there, &mut self.trial);
        Ok(None)
    }

    fn pose(&mut self, values: &[f64]) -> Result<(Found, Vec<f64>), SystemError> {
        self.closing.set_branches(&self.signs);
        self.there.clone_from(&self.q);
        self.pivots.clone_from(&self.first);
        let mut far = 0.0f64;
        for (x, &value) in self.targets.iter().zip(values) {
            far = x.own().map_or(far, |(at, _)| far.max((value - self.q[at]).abs() / x.displacement));
        }
        let longest = tolerance::STRIDE / far;
        let (mut done, mut stride) = (0.0f64, longest);
        // full steps while nothing limits them, so that the last one is not needlessly short
        if longest < 1.0 {
            stride = 1.0 / (1.0 / longest).ceil();
        }
        while done < 1.0 {
            let next = if done + stride > 1.0 - tolerance::EQUAL { 1.0 } else { done + stride };
            self.before.clone_from(&self.there);
            let limit = self.close(values, next)?.is_some();
            // a pivot that halves within a step may have passed zero, or may reach it next
            let well = !limit
                && self.pivots.iter().zip(self.closing.state()).all(|(before, now)| {
                    now.branch == 0 || tolerance::HALF_LOST * now.pivot >= (now.pivot - before).abs()
                });
            if well {
                self.pivots.iter_mut().zip(self.closing.state()).for_each(|(before, now)| *before = now.pivot);
                done = next;
                stride = (2.0 * stride).min(longest);
                continue;
            }
            if !limit {
                std::mem::swap(&mut self.there, &mut self.before);
            }
            stride *= 0.5;
            if stride * far < tolerance::SHORTEST_STEP {
                return self.beyond(values, done, limit);
            }
        }
        Ok((Found::closed(false), values.to_vec()))
    }

    /// The direct path ends here, after this fraction: at a limit, or where branches meet.
    fn beyond(&mut self, values: &[f64], done: f64, limit: bool) -> Result<(Found, Vec<f64>), SystemError> {
        let missing = self.close(values, 1.0)?;
        // a single goal has only one path; with several goals the signs define the branch, whatever the path
        if missing.is_none() && values.len() > 1 {
            return Ok((Found::closed(true), values.to_vec()));
        }
        let (shortfall, culprit) = missing.unwrap_or((0.0, 0));
        let at = |x: &Target| x.own().map_or(f64::NAN, |own| self.q[own.0]);
        let reached = self.targets.iter().zip(values).map(|(x, value)| at(x) + (value - at(x)) * done).collect();
        let outcome = match missing {
            None if !limit => Outcome::Singular,
            None => Outcome::OtherBranch,
            Some(_) if self.other_branch(values)? => Outcome::OtherBranch,
            Some(_) => Outcome::Open,
        };
        Ok((Found { outcome, shortfall, angle: 0.0, culprit, detour: false }, reached))
    }

    /// Whether it closes with other signs.
    fn other_branch(&mut self, values: &[f64]) -> Result<bool, SystemError> {
        let free: Vec<usize> = (0..self.signs.len()).filter(|&i| self.signs[i] != 0).collect();
        if free.len() > BLOCKS {
            return Ok(false);
        }
        for combination in 1usize..1 << free.len() {
            let mut signs = self.signs.clone();
            for (bit, &i) in free.iter().enumerate() {
                if combination >> bit & 1 == 1 {
                    signs[i] = -signs[i];
                }
            }
            self.closing.set_branches(&signs);
            if self.close(values, 1.0)?.is_none() {
                return Ok(true);
            }
        }
        Ok(false)
    }
}

/// Poses by following the motion.
struct Numeric<'m> {
    continuation: Continuation<'m>,
    start: &'m Start,
    there: Vec<f64>,
}

impl<'m> Numeric<'m> {
    fn new(model: &'m Model, t: f64, targets: &'m [Target], start: &'m Start) -> Self {
        Self { continuation: Continuation::new(model, targets, t), start, there: start.q.clone() }
    }

    /// Points between which the goals vary linearly, one after the other, forward and backward.
    fn detours(&self, values: &[f64]) -> [Vec<Vec<f64>>; 2] {
        let one_by_one = |order: &mut dyn Iterator<Item = usize>| {
            let mut now = self.start.y.clone();
            let mut by = Vec::with_capacity(values.len());
            for k in order {
                now[k] = values[k];
                by.push(now.clone());
            }
            by.pop();
            by
        };
        [one_by_one(&mut (0..values.len())), one_by_one(&mut (0..values.len()).rev())]
    }

    fn pose(&mut self, values: &[f64]) -> Result<(Found, Vec<f64>), SystemError> {
        let first = self.continuation.go(self.start, values, &mut self.there)?;
        if first == Ending::There {
            return Ok((self.agreeing(values, false), values.to_vec()));
        }
        let reached = self.continuation.field.y.clone();
        let here = self.there.clone();
        if self.start.free.iter().filter(|f| **f).count() > 1 {
            for by in self.detours(values) {
                if self.continuation.go_by(self.start, &by, values, &mut self.there)? == Ending::There {
                    return Ok((self.agreeing(values, true), values.to_vec()));
                }
            }
        }
        // from the end of the direct path: the closure error with the goals at their targets
        self.there.clone_from(&here);
        let f = &mut self.continuation.field;
        f.y.copy_from_slice(&reached);
        let m = f.closings();
        f.duty[..m].fill(Duty::Soft);
        nearest(f, &mut self.there, values)?;
        let goals_met = f.worst(Duty::Hard) <= tolerance::CLOSED.sqrt();
        let (culprit, shortfall, angle) = f.closure_error();
        let closes = goals_met && f.worst(Duty::Soft) <= tolerance::CLOSED.sqrt();
        let outcome = match first {
            Ending::Crossing(_) => Outcome::Singular,
            _ if closes => Outcome::OtherBranch,
            _ => Outcome::Open,
        };
        let (shortfall, angle) = if goals_met { (shortfall, angle) } else { (f64::NAN, f64::NAN) };
        Ok((Found { outcome, shortfall, angle, culprit, detour: false }, reached))
    }

    /// Goals that depend on the others must have reached their targets.
    fn agreeing(&mut self, values: &[f64], detour: bool) -> Found {
        self.continuation.field.look(&self.there);
        let f = &self.continuation.field;
        let off = |k: usize| (f.y[k] - values[k]).abs() / f.targets[k].displacement;
        let dependent = (0..values.len()).filter(|&k| !self.start.free[k]);
        match dependent.max_by(|&i, &j| off(i).total_cmp(&off(j))) {
            Some(k) if off(k) > tolerance::EQUAL => {
                Found { outcome: Outcome::Contradiction, shortfall: f.y[k], angle: f64::NAN, culprit: k, detour }
            }
            _ => Found::closed(detour),
        }
    }
}

/// The goals of one pose, for messages.
struct Asked<'a> {
    model: &'a Model,
    targets: &'a [Target],
    wanted: &'a [f64],
    reached: &'a [f64],
    from: &'a [f64],
    free: &'a [bool],
}

impl Asked<'_> {
    /// "A = 1 and E = 2".
    fn goals(&self, which: impl Fn(usize) -> bool) -> String {
        let of = (0..self.wanted.len()).filter(|&k| which(k));
        super::messages::listed(
            &of.map(|k| format!("{} = {:.6}", self.targets[k].name, self.wanted[k])).collect::<Vec<_>>(),
        )
    }

    fn ends(&self) -> String {
        let moved = (0..self.wanted.len()).filter(|&k| self.free[k] && self.wanted[k] != self.from[k]);
        let words = moved.map(|k| {
            let x = &self.targets[k];
            format!("{} at {:.6} {} of {:.6}", x.name, self.reached[k], x.unit, self.wanted[k])
        });
        super::messages::listed(&words.collect::<Vec<_>>())
    }

    fn reason(&self, found: &Found, explicit: Option<&Explicit>) -> String {
        let subject = match explicit {
            Some(x) => x.closing.blocks().get(found.culprit).map_or_else(String::new, |b| b.words.clone()),
            None => super::messages::loop_of(self.model, found.culprit),
        };
        let closure_error = super::messages::gap(found.shortfall, found.angle);
        let (goals, ends) = (self.goals(|_| true), self.ends());
        match found.outcome {
            Outcome::Closed => String::new(),
            Outcome::Open => format!(
                "{goals} cannot be reached: the continuation from the state of the branch stops at {ends}; at the \
                 target, {subject} keeps a closure error of {closure_error}"
            ),
            Outcome::OtherBranch if found.shortfall > 0.0 && explicit.is_some() => format!(
                "{goals} is reached on another branch only: on this one {subject} misses by {closure_error}, and the \
                 continuation stops at {ends}"
            ),
            Outcome::OtherBranch => format!(
                "the loops close at {goals}, but no motion on this branch leads there: the continuation meets a \
                 limit at {ends}"
            ),
            Outcome::Singular => format!(
                "a singular position, where branches meet, lies between the state of the branch and {goals}, at \
                 {ends}; give a state of the wanted branch beyond it"
            ),
            Outcome::Contradiction => {
                let (k, x) = (found.culprit, &self.targets[found.culprit]);
                format!(
                    "the targets contradict each other: with {} on this branch {} is {:.6} {}, not {:.6}",
                    self.goals(|i| self.free[i]),
                    x.name,
                    found.shortfall,
                    x.unit,
                    self.wanted[k]
                )
            }
        }
    }
}
