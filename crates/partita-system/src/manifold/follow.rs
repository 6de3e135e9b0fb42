//! Following a curve of closed positions: one predictor-corrector along a tangent.
//!
//! ```text
//! q ⊕ ds T(q)  →  closed with the conditions at s + ds  →  T there
//! ```
//!
//! A step is accepted if its position closes, if the correction removes no more than half of it, if the tangent turns
//! little over it and if the visitor does not object; otherwise it is halved. So a step never lands on another branch,
//! and a curve that ends (at a limit, where the tangent grows without bound; or where an instantaneous motion is
//! removed by closing) is followed to its end and reports the reason.

use super::close::{Closed, Ending};
use crate::error::Result;
use crate::system::SystemError;
use partita_math::tolerance;

/// Longest step along a curve. Unit: characteristic displacement. Reason: over a third of a radian the deviation from a
/// straight line is a twentieth.
pub const LONGEST_PREDICTION: f64 = 0.3;

/// A curve of closed positions, by its parameter s.
pub trait Curve {
    /// The tangent at the closed position q, where the parameter is s: displacements per unit of s, in characteristic
    /// displacements. On entry it is the previous one, for curves that continue a direction. False where there is none,
    /// as at a dead point of the request.
    ///
    /// # Errors
    /// Where nothing can be evaluated at q.
    fn direct(&mut self, q: &[f64], s: f64, tangent: &mut [f64]) -> Result<bool>;
    /// q displaced along a tangent.
    fn predict(&mut self, q: &mut [f64], tangent: &[f64], ds: f64);
    /// Close the predicted position with the conditions at s.
    ///
    /// # Errors
    /// `NotFinite` where they cannot be evaluated: the step is refused. Other errors end the curve.
    fn close(&mut self, q: &mut [f64], s: f64) -> Result<Closed>;
    /// Whether a position that closed like this belongs to the curve.
    fn accepts(&self, closed: &Closed) -> bool {
        closed.is_closed()
    }
    /// The position last closed is accepted, or refused: then the turns counted on the way to it are removed.
    fn conclude(&mut self, _taken: bool) {}
    /// Size of a displacement, in characteristic displacements.
    fn travel(&self, tangent: &[f64]) -> f64 {
        largest(tangent)
    }
}

/// Lengths of steps.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    /// Longest step, in characteristic displacements of the fastest coordinate.
    pub longest: f64,
    /// Steps shorter than this end the curve, in characteristic displacements of the fastest coordinate: next to a limit
    /// of the parameter the others still move by its root.
    pub shortest: f64,
    /// Maximum number of steps.
    pub steps: usize,
}

/// Decision of a visitor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Visit {
    /// Go on.
    On,
    /// Accept this position and stop.
    Stop,
    /// Refuse this position: approach it by shorter steps, or not at all.
    Back,
}

/// Why a curve ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// All of it was followed.
    There,
    /// The visitor requested a stop.
    Stopped,
    /// The correction removes more than half of every step.
    ThrownBack,
    /// Positions further on do not close.
    ClosureError(Ending),
    /// The tangent grows or turns without bound: a limit.
    Limit,
    /// The visitor refused every position further on.
    Refused,
    /// More steps than allowed.
    Long,
}

/// Result of following a curve.
#[derive(Clone, Copy, Debug)]
pub struct Followed {
    /// Why it ended.
    pub end: End,
    /// Parameter of the last position taken.
    pub s: f64,
    /// Steps taken.
    pub steps: usize,
    /// Linear steps in all.
    pub iterations: usize,
}

/// A position on a curve.
#[derive(Clone, Copy, Debug)]
pub struct At<'a> {
    /// The position.
    pub q: &'a [f64],
    /// Its parameter.
    pub s: f64,
    /// The tangent there, displacements per unit of s in characteristic displacements.
    pub tangent: &'a [f64],
}

/// Visits each position, with the curve as its tangent was found there.
pub type Visitor<'v, C> = &'v mut dyn FnMut(&mut C, At) -> Result<Visit>;

/// One step from q along `tangent`; q ends at the new position and `next` is the tangent there. Returns the relative
/// change of the tangent and the decision of the visitor, or why the step fails.
fn step<C: Curve + ?Sized>(
    curve: &mut C,
    q: &mut [f64],
    (tangent, next): (&[f64], &mut [f64]),
    (s, ds): (f64, f64),
    iterations: &mut usize,
    visit: Visitor<C>,
) -> Result<std::result::Result<(f64, Visit), End>> {
    curve.predict(q, tangent, ds);
    let closed = match curve.close(q, s + ds) {
        Err(SystemError::NotFinite { .. }) => return Ok(Err(End::ClosureError(Ending::Unfinished))),
        other => other?,
    };
    *iterations += closed.iterations;
    if !curve.accepts(&closed) {
        return Ok(Err(End::ClosureError(closed.ending)));
    }
    if closed.moved > tolerance::HALF_LOST * ds * curve.travel(tangent) {
        return Ok(Err(End::ThrownBack));
    }
    next.copy_from_slice(tangent);
    if !curve.direct(q, s + ds, next)? {
        return Ok(Err(End::Limit));
    }
    let turned = turned(tangent, next);
    if turned.is_nan() || turned > tolerance::HALF_LOST {
        return Ok(Err(End::Limit));
    }
    Ok(match visit(curve, At { q, s: s + ds, tangent: next })? {
        Visit::Back => Err(End::Refused),
        visit => Ok((turned, visit)),
    })
}

/// Follow a curve from the closed position q, where its parameter is 0, to where it is `length`, or as far as possible;
/// q ends at the last accepted position. `direction` is the initial tangent, for curves that continue one.
///
/// # Errors
/// The errors of the curve, and of `visit`.
pub fn follow<C: Curve + ?Sized>(
    curve: &mut C,
    q: &mut [f64],
    direction: &[f64],
    length: f64,
    pace: &Pace,
    visit: Visitor<C>,
) -> Result<Followed> {
    let mut found = Followed { end: End::There, s: 0.0, steps: 0, iterations: 0 };
    if length == 0.0 {
        return Ok(found);
    }
    let mut tangent = direction.to_vec();
    if !curve.direct(q, 0.0, &mut tangent)? {
        return Ok(Followed { end: End::Limit, ..found });
    }
    let (mut next, mut trial) = (tangent.clone(), q.to_vec());
    let mut part = length;
    while found.steps < pace.steps {
        part = part.min(pace.longest / curve.travel(&tangent).max(f64::MIN_POSITIVE));
        let last = found.s + tolerance::TO_THE_END * part >= length;
        let ds = if last { length - found.s } else { part };
        trial.copy_from_slice(q);
        let taken = step(curve, &mut trial, (&tangent, &mut next), (found.s, ds), &mut found.iterations, visit)?;
        curve.conclude(taken.is_ok());
        match taken {
            Ok((turned, visited)) => {
                found.s = if last { length } else { found.s + ds };
                found.steps += 1;
                q.copy_from_slice(&trial);
                tangent.copy_from_slice(&next);
                match visited {
                    Visit::Stop => return Ok(Followed { end: End::Stopped, ..found }),
                    _ if last => return Ok(found),
                    _ => {}
                }
                if turned < tolerance::MUCH_SMALLER * tolerance::HALF_LOST {
                    part *= 2.0;
                }
            }
            Err(end) => {
                part = 0.5 * ds;
                if part * curve.travel(&tangent) < pace.shortest {
                    return Ok(Followed { end, ..found });
                }
            }
        }
    }
    Ok(Followed { end: End::Long, ..found })
}

/// One step from the closed position q, where the parameter is s, by this many `displacements` of the fastest
/// coordinate, but not beyond `length`: the position reached, or why there is none. For a single step, or for probing
/// beyond the end of a curve.
///
/// # Errors
/// As [`follow`].
pub fn leap<C: Curve + ?Sized>(
    curve: &mut C,
    q: &mut [f64],
    direction: &[f64],
    (s, length): (f64, f64),
    displacements: f64,
    visit: Visitor<C>,
) -> Result<End> {
    let mut tangent = direction.to_vec();
    if !curve.direct(q, s, &mut tangent)? {
        return Ok(End::Limit);
    }
    let ds = (displacements / curve.travel(&tangent)).min(length - s);
    let mut next = tangent.clone();
    let taken = step(curve, q, (&tangent, &mut next), (s, ds), &mut 0, visit)?;
    curve.conclude(taken.is_ok());
    Ok(taken.err().unwrap_or(End::There))
}

fn largest(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |m: f64, x| m.max(x.abs()))
}

/// The change from one tangent to the next, relative to the shorter one.
fn turned(one: &[f64], two: &[f64]) -> f64 {
    let size = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>().sqrt();
    let change = one.iter().zip(two).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    change / size(one).min(size(two))
}
