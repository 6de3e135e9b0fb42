//! Thousands of positions for values of the goals, each on the branch of one state.

use super::continuation::{Continuation, Start};
use super::explicit::Explicit;
use super::flood::flooded;
use super::goal::Target;
use super::lanes::{self, PoseLanes};
use super::lattice::{LastSteps, Lattice};
use super::numeric::Numeric;
use super::outcome::{Outcome, PoseNumbers};
use crate::error::AnalysisError;
use crate::outputs::{tables, Rows, Watch};
use partita_math::tolerance;
use partita_model::Model;
use partita_system::prelude::*;
use partita_system::SystemError;
use std::sync::Arc;

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
pub(super) const RESULT: usize = 5;

/// All of a row but its coordinates.
pub(super) fn put(found: &PoseNumbers, reached: &[f64], rows: &mut Rows, i: usize) {
    let number = found.outcome as usize;
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
/// Each pose depends only on its own values and on q, unless the rows are those of a `grid` of this shape, the last
/// dimension fastest, values growing along each: then the branch contains what steps from one position of the grid to
/// its neighbours lead to.
///
/// # Errors
/// `Argument` where the values do not fit, or where a coupling that constrains rates alone loses its phase; those of functions that the model calls, and of `watch`.
pub fn many(
    model: &Model,
    t: f64,
    q: &[f64],
    targets: &[Target],
    values: &[f64],
    grid: Option<&[usize]>,
    watch: Watch,
) -> Result<Poses, AnalysisError> {
    let width = targets.len();
    if width == 0 || values.len() % width != 0 {
        let message = format!("{} values do not fit {width} goals", values.len());
        return Err(SystemError::argument("targets", message).into());
    }
    let count = values.len() / width;
    let widths = [model.size().nq, width, RESULT];
    let chunk = if model.equations().calls_functions() { usize::MAX } else { 1 };
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
            let program = (count >= lanes::WORTH_A_RECORDING && chunk == 1).then(|| explicit.program()).flatten();
            let program = program.map(Arc::new);
            let chunk = if program.is_some() { lanes::BATCH } else { chunk };
            let row = |i: usize, (one, side): &mut (Option<Explicit>, Option<PoseLanes>), rows: &mut Rows| {
                let Some(one) = one else {
                    let message = "the loops cannot be solved in a second order; give a state farther from a \
                        limit position";
                    return Err(SystemError::argument("near", message.into()).into());
                };
                match side {
                    // the first of a batch finds them all
                    Some(lanes) if i % chunk == 0 => lanes.fill(i..count.min(i + chunk), of, one, rows)?,
                    Some(_) => {}
                    None => {
                        let (found, reached) = one.pose(of(i))?;
                        put(&found, &reached, rows, i);
                        one.write(&found, rows.row(0, i));
                    }
                }
                Ok(())
            };
            let scratch = || (explicit.again(), program.as_ref().map(PoseLanes::new));
            tables(count, &widths, chunk, scratch, row, watch)?
        }
        None => match grid {
            Some(shape) => flooded((model, t), targets, &start, (shape, values), watch)?,
            None => by_following(model, t, targets, &start, values, watch)?,
        },
    };
    let mut tables = tables.into_iter();
    let mut next = || tables.next().unwrap_or_default();
    let (found, reached, reported) = (next(), next(), next());
    let mut poses = Poses { q: found, reached, ..Poses::default() };
    for (i, x) in reported.chunks(RESULT).enumerate() {
        let outcome = Outcome::ALL[x[0] as usize];
        let found = PoseNumbers { outcome, shortfall: x[1], angle: x[2], culprit: x[3] as usize, detour: x[4] != 0.0 };
        if outcome != Outcome::Closed {
            let reached = &poses.reached[i * width..][..width];
            let what = PoseGoals { model, targets, wanted: of(i), reached, from: &start.y, free: &start.free };
            poses.reasons.push((i, what.reason(&found, explicit.as_ref())));
        }
        poses.outcomes.push(outcome);
        poses.shortfall.push(found.shortfall);
        poses.angle.push(found.angle);
        poses.detour.push(found.detour);
    }
    poses.branch = explicit.map(|x| x.branch());
    let nq = model.size().nq;
    let closed = poses.outcomes.iter().enumerate().filter(|(_, outcome)| **outcome == Outcome::Closed);
    closed.map(|(i, _)| i).try_for_each(|i| model.held_on(q, &poses.q[i * nq..][..nq]))?;
    Ok(poses)
}

/// The tables of poses found by following the motion.
fn by_following(
    model: &Model,
    t: f64,
    targets: &[Target],
    start: &Start,
    values: &[f64],
    watch: Watch,
) -> Result<Vec<Vec<f64>>, AnalysisError> {
    let width = targets.len();
    let count = values.len() / width;
    let widths = [model.size().nq, width, RESULT];
    let of = |i: usize| &values[i * width..][..width];
    let lattice = Lattice::new(model, t, targets, start).map(|x| x.with_stations(values)).transpose()?;
    let chunk = if model.equations().calls_functions() { usize::MAX } else { LastSteps::BATCH };
    let row = |i: usize, memory: &mut Numeric, rows: &mut Rows| {
        let place = i % LastSteps::BATCH;
        if place == 0 {
            memory.batch((i..count.min(i + LastSteps::BATCH)).map(of))?;
        }
        let found = memory.pose(place, of(i))?;
        put(&found, &memory.reached, rows, i);
        match found.outcome {
            Outcome::Closed => rows.row(0, i).copy_from_slice(&memory.there),
            _ => rows.row(0, i).fill(f64::NAN),
        }
        Ok(())
    };
    tables(count, &widths, chunk, || Numeric::new(model, t, targets, start, lattice.as_ref()), row, watch)
}

/// The goals of one pose, for messages.
struct PoseGoals<'a> {
    model: &'a Model,
    targets: &'a [Target],
    wanted: &'a [f64],
    reached: &'a [f64],
    from: &'a [f64],
    free: &'a [bool],
}

impl PoseGoals<'_> {
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

    fn reason(&self, found: &PoseNumbers, explicit: Option<&Explicit>) -> String {
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
