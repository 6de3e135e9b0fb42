//! Curves of singular positions, followed from the samples of a cover.

use super::cover::{distance, Sample, SAMPLE_SPACING};
use super::slice::{alike, Evaluation, Slice};
use super::{CurveEnd, SingularCurve};
use crate::error::AnalysisError;
use crate::outputs::Watch;
use partita_math::dense;
use partita_math::tolerance;
use partita_system::manifold::{follow, At, Closed, Curve, End, Pace, Visit};
use partita_system::SystemError;

/// Distance between points of a curve, at most. Unit: characteristic displacements. Reason: chords of a circle of one
/// radian deviate by a three-thousandth.
const LONGEST_CHORD: f64 = 0.05;
/// Distance between points of a curve, at least, except at its ends, which are approached by ever shorter steps. Scale:
/// characteristic displacements of the body that moves most. Reason: a fifth of the longest.
const LEAST_CHORD: f64 = 0.01;
/// Points nearer to a point of a curve than this belong to it. Scale: characteristic displacements of the body that moves
/// most. Reason: a tenth of the longest chord.
const SAME_CURVE: f64 = 5e-3;
/// Points nearer to a chord than this are on its curve. Scale: length of the chord. Reason: where a curve turns by half a
/// radian over a chord, the most that a step may, it deviates by a sixteenth.
const SAGITTA: f64 = 0.1;
/// Goals oriented by less than this are singular along the curve itself, which ends no branch. Scale: sine. Reason: far
/// above round-off; a curve that crosses the end of a branch is cut a billionth beyond it.
const SINGULAR_GOALS: f64 = 1e-9;
/// Single positions nearer to each other are one. Scale: characteristic displacements of the body that moves most.
/// Reason: those of constraints are known to half of the digits.
const SAME_POINT: f64 = 1e-6;
/// Maximum number of points of a curve.
const POINTS: usize = 20_000;
/// Length up to which a curve is followed from a point beyond the range into it. Unit: characteristic displacements.
/// Reason: several samples.
const LONGEST_DETOUR: f64 = 1.0;
/// Length up to which curves are followed. Unit: characteristic displacements. Reason: longer than the largest number of
/// steps.
const LONGEST_CURVE: f64 = 1e4;

/// Steps along a curve; at the end of the range they shorten to nine digits.
const PACE: Pace = Pace { longest: LONGEST_CHORD, shortest: tolerance::LAST_MOVE, steps: POINTS };

/// A point with what tells it from others.
struct Point {
    q: Vec<f64>,
    y: Vec<f64>,
    measure: f64,
    signature: Vec<f64>,
}

struct Trace<'s, 'm> {
    slice: &'s mut Slice<'m>,
    /// Values of the goals at the last point taken.
    home: Vec<f64>,
    place: Option<Evaluation>,
    /// The sign of the branch, and the slice that it belongs to, at the last point taken.
    branch: (f64, Vec<Vec<f64>>),
}

impl Curve for Trace<'_, '_> {
    fn direct(&mut self, q: &[f64], _s: f64, tangent: &mut [f64]) -> Result<bool, SystemError> {
        if self.place.is_none() {
            self.slice.field.evaluate(q)?;
            self.place = Some(self.slice.look(q)?);
        }
        let Some(place) = &self.place else { return Ok(false) };
        let Some(mut found) = self.slice.direction(q, place)? else { return Ok(false) };
        if dense::dot(&found, tangent) < 0.0 {
            found.iter_mut().for_each(|x| *x = -*x);
        }
        tangent.copy_from_slice(&found);
        Ok(true)
    }
    fn predict(&mut self, q: &mut [f64], tangent: &[f64], ds: f64) {
        self.slice.field.y.copy_from_slice(&self.home);
        self.slice.moved(q, tangent, ds);
    }
    fn close(&mut self, q: &mut [f64], _s: f64) -> Result<Closed, SystemError> {
        let (closed, place) = self.slice.locate(q, LONGEST_CHORD)?;
        self.place = place;
        Ok(closed)
    }
    fn conclude(&mut self, taken: bool) {
        if taken {
            self.home.copy_from_slice(&self.slice.field.y);
        } else {
            self.slice.field.y.copy_from_slice(&self.home);
        }
    }
}

/// All curves, or single positions in one dimension.
pub(super) fn traced(slice: &mut Slice, samples: &[Sample], watch: Watch) -> Result<Vec<SingularCurve>, AnalysisError> {
    let mut curves: Vec<(Vec<Point>, Option<[CurveEnd; 2]>)> = Vec::new();
    for sample in samples {
        let Some(towards) = &sample.towards else { continue };
        watch()?;
        let mut q = sample.q.clone();
        slice.field.y.copy_from_slice(&sample.y);
        slice.moved(&mut q, towards, 1.0);
        let reached = match slice.locate(&mut q, 2.0 * SAMPLE_SPACING) {
            Err(SystemError::NotFinite { .. }) => continue,
            other => other?,
        };
        let (true, Some(place)) = (reached.0.is_closed(), reached.1) else { continue };
        let sign = sample.sign * alike(&place.slice, &sample.place.slice);
        let (inside, orientation) = (slice.is_within(0.0), slice.orientation(&place));
        let y = slice.field.y.clone();
        let mut found = (Point { signature: slice.signature(&q), q, y, measure: place.measure }, place, sign);
        if !inside {
            match entered(slice, &found)? {
                Some(point) => found = point,
                None => continue,
            }
        } else if slice.one_branch && sign * orientation < -SINGULAR_GOALS {
            continue;
        }
        let (seed, place, sign) = found;
        let near = if slice.dimension == 1 { SAME_POINT } else { SAME_CURVE };
        if curves.iter().any(|(points, ends)| meets((points, *ends), &seed, slice, near)) {
            continue;
        }
        let found = if slice.dimension == 1 { (vec![seed], None) } else { both_directions(slice, seed, place, sign)? };
        curves.push(found);
    }
    let joined = |(points, ends): (Vec<Point>, _)| SingularCurve {
        measure: points.iter().map(|p| p.measure).collect(),
        goals: points.iter().flat_map(|p| &p.y).copied().collect(),
        q: points.iter().flat_map(|p| &p.q).copied().collect(),
        ends,
    };
    Ok(curves.into_iter().map(joined).collect())
}

/// Whether a point lies on a curve.
fn meets((points, ends): (&[Point], Option<[CurveEnd; 2]>), at: &Point, slice: &Slice, near: f64) -> bool {
    // the same position after whole turns of a goal is another point
    let apart = |p: &Point| {
        let turns = p.y.iter().zip(&at.y).zip(slice.field.targets);
        turns.fold(0.0, |m: f64, ((x, y), target)| m.max((x - y).abs() / target.displacement))
    };
    let on = |p: &Point| distance(&p.signature, &at.signature) < near && apart(p) < 1.0;
    let between = |a: &Point, b: &Point| {
        let chord: Vec<f64> = b.signature.iter().zip(&a.signature).map(|(x, y)| x - y).collect();
        let there: Vec<f64> = at.signature.iter().zip(&a.signature).map(|(x, y)| x - y).collect();
        let square = dense::dot(&chord, &chord);
        if square <= 0.0 {
            return false;
        }
        let part = (dense::dot(&chord, &there) / square).clamp(0.0, 1.0);
        let rest = chord.iter().zip(&there).fold(0.0, |m: f64, (c, x)| m.max((x - part * c).abs()));
        rest < near + SAGITTA * distance(&a.signature, &b.signature) && apart(a) < 1.0
    };
    let last = match (points.last(), points.first(), ends) {
        (Some(last), Some(first), Some([CurveEnd::Closed, _])) => between(last, first),
        _ => false,
    };
    last || points.iter().any(on) || points.windows(2).any(|pair| between(&pair[0], &pair[1]))
}

/// The first point within the range on the curve through a point beyond its end, with its evaluation and the sign of the
/// branch: a part in a corner of the range may have no sample whose slope points to it.
fn entered(
    slice: &mut Slice,
    (seed, place, sign): &(Point, Evaluation, f64),
) -> Result<Option<(Point, Evaluation, f64)>, SystemError> {
    if slice.dimension == 1 || !slice.is_within(2.0 * SAMPLE_SPACING) {
        return Ok(None);
    }
    slice.field.evaluate(&seed.q)?;
    let Some(tangent) = slice.direction(&seed.q, place)? else { return Ok(None) };
    for turned in [1.0, -1.0] {
        let direction: Vec<f64> = tangent.iter().map(|x| turned * x).collect();
        slice.field.y.copy_from_slice(&seed.y);
        let mut q = seed.q.clone();
        let mut trace = Trace { slice, home: seed.y.clone(), place: None, branch: (*sign, place.slice.clone()) };
        let mut found = None;
        let mut visit = |trace: &mut Trace, at: At| {
            let Some(place) = &trace.place else { return Ok(Visit::Stop) };
            let sign = trace.branch.0 * alike(&place.slice, &trace.branch.1);
            trace.branch = (sign, place.slice.clone());
            let slice = &mut *trace.slice;
            if slice.is_within(0.0) {
                if !slice.one_branch || sign * slice.orientation(place) >= -SINGULAR_GOALS {
                    let y = slice.field.y.clone();
                    let signature = slice.signature(at.q);
                    let point = Point { signature, q: at.q.to_vec(), y, measure: place.measure };
                    found = Some((point, place.clone(), sign));
                }
                return Ok(Visit::Stop);
            }
            Ok(if slice.is_within(2.0 * SAMPLE_SPACING) { Visit::On } else { Visit::Stop })
        };
        follow(&mut trace, &mut q, &direction, LONGEST_DETOUR, &PACE, &mut visit)?;
        if found.is_some() {
            return Ok(found);
        }
    }
    Ok(None)
}

/// A curve through a point, followed in both directions unless it returns.
fn both_directions(
    slice: &mut Slice,
    seed: Point,
    place: Evaluation,
    sign: f64,
) -> Result<(Vec<Point>, Option<[CurveEnd; 2]>), SystemError> {
    slice.field.y.copy_from_slice(&seed.y);
    slice.field.evaluate(&seed.q)?;
    let Some(tangent) = slice.direction(&seed.q, &place)? else { return Ok((vec![seed], None)) };
    let (ahead, end) = one_way(slice, &seed, &tangent, (sign, &place))?;
    if end == CurveEnd::Closed {
        let mut points = vec![seed];
        points.extend(ahead);
        return Ok((points, Some([CurveEnd::Closed; 2])));
    }
    let back: Vec<f64> = tangent.iter().map(|x| -x).collect();
    let (behind, first) = one_way(slice, &seed, &back, (sign, &place))?;
    // after whole turns of a goal, of which the range holds more than one
    let (ahead, ends) =
        if first == CurveEnd::Closed { (Vec::new(), [CurveEnd::Closed; 2]) } else { (ahead, [first, end]) };
    let mut points: Vec<Point> = behind.into_iter().rev().collect();
    points.push(seed);
    points.extend(ahead);
    Ok((points, Some(ends)))
}

fn one_way(
    slice: &mut Slice,
    seed: &Point,
    tangent: &[f64],
    (sign, place): (f64, &Evaluation),
) -> Result<(Vec<Point>, CurveEnd), SystemError> {
    slice.field.y.copy_from_slice(&seed.y);
    let mut q = seed.q.clone();
    let mut trace = Trace { slice, home: seed.y.clone(), place: None, branch: (sign, place.slice.clone()) };
    let (mut points, mut outside, mut beyond): (Vec<Point>, bool, bool) = (Vec::new(), false, false);
    let mut visit = |trace: &mut Trace, at: At| {
        let slice = &mut *trace.slice;
        outside = !slice.is_within(0.0);
        beyond = false;
        if outside {
            return Ok(Visit::Back);
        }
        if let Some(place) = &trace.place {
            let sign = trace.branch.0 * alike(&place.slice, &trace.branch.1);
            beyond = slice.one_branch && sign * slice.orientation(place) < -SINGULAR_GOALS;
            if beyond {
                return Ok(Visit::Back);
            }
            trace.branch = (sign, place.slice.clone());
        }
        let measure = trace.place.as_ref().map_or(f64::NAN, |x| x.measure);
        let y = slice.field.y.clone();
        let point = Point { signature: slice.signature(at.q), q: at.q.to_vec(), y, measure };
        let before = points.last().unwrap_or(seed);
        // back at the first point: it lies between the last two
        let returns = points.len() > 1 && {
            let chord = distance(&before.signature, &point.signature);
            let there = distance(&seed.signature, &point.signature);
            let start = distance(&before.signature, &seed.signature);
            there <= chord && start <= chord && dense::dot(at.tangent, tangent) > 0.0
        };
        if returns {
            return Ok(Visit::Stop);
        }
        points.push(point);
        Ok(Visit::On)
    };
    let found = follow(&mut trace, &mut q, tangent, LONGEST_CURVE, &PACE, &mut visit)?;
    let mut kept: Vec<Point> = Vec::with_capacity(points.len());
    for point in points.into_iter().rev() {
        let near = |x: &Point| distance(&x.signature, &point.signature) < LEAST_CHORD;
        if !kept.last().is_some_and(near) && (kept.is_empty() || !near(seed)) {
            kept.push(point);
        }
    }
    kept.reverse();
    let end = match found.end {
        End::Stopped => CurveEnd::Closed,
        _ if beyond => CurveEnd::Branch,
        End::Refused => CurveEnd::Range,
        End::Long | End::There => CurveEnd::Long,
        _ if outside => CurveEnd::Range,
        _ => CurveEnd::Limit,
    };
    Ok((kept, end))
}
