//! Where a reading is stationary along a path of goals, and limits: where a goal itself is.

use super::continuation::{Continuation, Ending, Start};
use super::goal::{Goal, Target};
use partita_math::dense;
use partita_math::zero::false_position;
use partita_model::joint::Motion;
use partita_model::model::ModelScratch;
use partita_model::Model;
use partita_system::prelude::*;
use partita_system::SystemError;

/// First distance from the end of a continuation to a position beyond the limit. Scale: characteristic displacements of
/// the coordinate followed. Reason: continuations end nearer to a limit.
const PAST_LIMIT: f64 = 1e-2;
/// How often it is doubled.
const DOUBLINGS: usize = 6;

/// A located position.
#[derive(Clone, Debug)]
pub struct Stationary {
    /// Coordinates.
    pub q: Vec<f64>,
    /// Fraction of the path.
    pub part: f64,
}

/// Positions along the straight path of goals from a start, and the slope of a reading there.
struct Path<'a, 'm> {
    continuation: Continuation<'m>,
    start: &'a Start,
    to: &'a [f64],
    reading: &'a Target,
    rest: Vec<f64>,
    memory: Vec<f64>,
    scratch: ModelScratch,
}

impl Path<'_, '_> {
    /// The position after this fraction of the path, and the derivative of the reading by it; none where the path ends
    /// before.
    fn at(&mut self, part: f64, q: &mut Vec<f64>) -> Result<Option<f64>, SystemError> {
        let (from, to) = (&self.start.y, self.to);
        let aims: Vec<f64> = from.iter().zip(to).map(|(from, to)| from + (to - from) * part).collect();
        let Some(there) = self.continuation.start_at(self.start, &aims)? else { return Ok(None) };
        let by_goal = self.continuation.directions(&there)?;
        q.clone_from(&there.q);
        self.rest.fill(0.0);
        for ((v, from), to) in by_goal.iter().zip(from).zip(to) {
            self.rest.iter_mut().zip(v).for_each(|(sum, v)| *sum += (to - from) * v);
        }
        Ok(Some(self.slope(q)))
    }

    /// Rate of the reading for the velocity in `rest`.
    fn slope(&mut self, q: &[f64]) -> f64 {
        let model = self.continuation.field.model;
        let mut gradient = Vec::with_capacity(self.reading.velocities.len());
        self.reading.rates(model, q, &mut self.memory, &mut self.scratch, |g| gradient.push(g));
        gradient.iter().zip(&self.reading.velocities).map(|(g, &i)| g * self.rest[i]).sum()
    }
}

fn path<'a, 'm>(
    model: &'m Model,
    continuation: Continuation<'m>,
    (start, to): (&'a Start, &'a [f64]),
    reading: &'a Target,
) -> Path<'a, 'm> {
    let n = model.size().nv;
    Path { continuation, start, to, reading, rest: vec![0.0; n], memory: vec![0.0; n], scratch: model.scratch() }
}

/// Where the reading is stationary while the goals move straight to the values `to`, from the closed position q: the
/// zero of its slope, to round-off. None where the slope has one sign, or the path ends before.
///
/// # Errors
/// Those of functions that the model calls.
pub fn stationary(
    model: &Model,
    t: f64,
    q: &[f64],
    targets: &[Target],
    to: &[f64],
    reading: &Target,
) -> Result<Option<Stationary>, SystemError> {
    let mut continuation = Continuation::new(model, targets, t);
    let start = continuation.start(q)?;
    zero(&mut path(model, continuation, (&start, to), reading), 1.0)
}

/// The first zero of the slope up to this fraction of the path, if the signs at its ends differ.
fn zero(path: &mut Path, end: f64) -> Result<Option<Stationary>, SystemError> {
    let (mut q, mut there) = (Vec::new(), Vec::new());
    let (Some(first), Some(last)) = (path.at(0.0, &mut q)?, path.at(end, &mut there)?) else { return Ok(None) };
    if first == 0.0 {
        return Ok(Some(Stationary { q, part: 0.0 }));
    }
    if last == 0.0 {
        return Ok(Some(Stationary { q: there, part: end }));
    }
    if (first > 0.0) == (last > 0.0) || !first.is_finite() || !last.is_finite() {
        return Ok(None);
    }
    let part = false_position((0.0, first), (end, last), |part| path.at(part, &mut q))?;
    Ok(part.map(|part| Stationary { q, part }))
}

/// The end of the range of a goal.
#[derive(Clone, Debug)]
pub struct Limit {
    /// Coordinates there.
    pub q: Vec<f64>,
    /// Values of all goals there.
    pub goals: Vec<f64>,
    /// Whether it is the position in which the goal is stationary, to round-off; otherwise the last position of the
    /// continuation.
    pub located: bool,
}

/// Where the straight path of the goals to the values `to` ends, from the closed position q; none where it does not.
///
/// Where one goal varies, it is stationary there along the motion: another coordinate of the mechanism is followed in
/// its place, the one that moves fastest, until the slope of the goal by it is zero.
///
/// # Errors
/// Those of functions that the model calls.
pub fn limit(model: &Model, t: f64, q: &[f64], targets: &[Target], to: &[f64]) -> Result<Option<Limit>, SystemError> {
    let mut continuation = Continuation::new(model, targets, t);
    let start = continuation.start(q)?;
    let mut end = q.to_vec();
    match continuation.go(&start, to, &mut end)? {
        Ending::There => return Ok(None),
        Ending::Crossing(_) => {
            return Ok(Some(Limit { goals: continuation.field.y.clone(), q: end, located: false }));
        }
        Ending::Limit(_) => {}
    }
    let goals = continuation.field.y.clone();
    let varying: Vec<usize> = (0..to.len()).filter(|&k| to[k] != start.y[k]).collect();
    if let [k] = varying[..] {
        let folded = folded(model, t, &end, targets, (k, (to[k] - start.y[k]).signum()))?;
        if let Some(found) = folded {
            let mut field = Continuation::new(model, targets, t).field;
            field.y.copy_from_slice(&goals);
            field.look(&found.q);
            return Ok(Some(Limit { q: found.q, goals: field.y.clone(), located: true }));
        }
    }
    Ok(Some(Limit { q: end, goals, located: false }))
}

/// The position next to q in which goal `k`, which grows in this direction, is stationary, the others as they are.
fn folded(
    model: &Model,
    t: f64,
    q: &[f64],
    targets: &[Target],
    (k, direction): (usize, f64),
) -> Result<Option<Stationary>, SystemError> {
    let mut continuation = Continuation::new(model, targets, t);
    let here = continuation.start(q)?;
    let Some(v) = continuation.directions(&here)?.into_iter().nth(k) else { return Ok(None) };
    let Some((leader, rate)) = fastest(model, q, &v) else { return Ok(None) };
    let mut others = targets.to_vec();
    let reading = std::mem::replace(&mut others[k], leader);
    let mut continuation = Continuation::new(model, &others, t);
    let start = continuation.start(q)?;
    let mut distance = PAST_LIMIT * others[k].displacement;
    for _ in 0..DOUBLINGS {
        let mut to = start.y.clone();
        to[k] += distance * (direction * rate).signum();
        let continuation = Continuation::new(model, &others, t);
        if let Some(found) = zero(&mut path(model, continuation, (&start, &to), &reading), 1.0)? {
            return Ok(Some(found));
        }
        distance *= 2.0;
    }
    Ok(None)
}

/// The coordinate of a joint that the velocity v moves fastest, in characteristic displacements, and its rate.
fn fastest(model: &Model, q: &[f64], v: &[f64]) -> Option<(Target, f64)> {
    let (mut s, mut memory, mut best) = (model.scratch(), vec![0.0; v.len()], None);
    for (joint, p) in model.zero_position().joints.iter().enumerate() {
        let mut coordinate = 0;
        for motion in &p.shape.motions {
            let goal = Goal::Joint { joint, coordinate };
            coordinate += motion.coordinates();
            if *motion == Motion::Ball {
                continue;
            }
            let Ok(x) = Target::new(model, &goal, &model.spec.joints[joint].name) else { continue };
            let mut gradient = Vec::with_capacity(x.velocities.len());
            x.rates(model, q, &mut memory, &mut s, |g| gradient.push(g));
            let own: Vec<f64> = x.velocities.iter().map(|&i| v[i]).collect();
            let rate = dense::dot(&gradient, &own);
            if best
                .as_ref()
                .is_none_or(|(y, most): &(Target, f64)| (rate / x.displacement).abs() > (most / y.displacement).abs())
            {
                best = Some((x, rate));
            }
        }
    }
    best
}
