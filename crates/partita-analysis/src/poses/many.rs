//! Thousands of positions for values of the goals, each on the branch of one state.

use super::continuation::{Continuation, Ending, Start};
use super::explicit::Explicit;
use super::field::Duty;
use super::goal::Target;
use super::nearest::nearest;
use super::outcome::{Found, Outcome};
use crate::outputs::{tables, Rows, Watch};
use partita_math::tolerance;
use partita_model::Model;
use partita_system::prelude::*;
use partita_system::SystemError;

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
    let explicit = Explicit::new(model, t, q, targets, &start).map(|x| x.with_stations(values)).transpose()?;
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
    poses.branch = explicit.map(|x| x.branch());
    Ok(poses)
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
            Some(x) => x.words_of(found.culprit),
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
