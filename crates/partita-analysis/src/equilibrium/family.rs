//! Families of equilibria over a number on which the equations depend, by pseudo-arclength continuation.
//!
//! ```text
//! h_d(z, x) = 0        [ K_d   −(h_d)_x ] [dz]   [0]
//!                      [ τ_zᵀ     τ_x   ] [dx] = [1]       τ: the tangent before         (E2)
//! ```
//!
//! Steps go along the tangent and are corrected across it, so that x may turn back: at a fold, where det K_d changes its
//! sign and dx/ds its own. Where det K_d alone changes its sign, another family branches off.

use super::deflation::displacement_between;
use super::forces::{travel, ByNumber, Here, Rest};
use crate::error::AnalysisError;
use partita_math::dense::{self, Matrix};
use partita_math::factor;
use partita_math::sorting::sort_by;
use partita_math::tolerance;
use partita_math::zero::false_position;
use partita_model::Model;
use partita_system::manifold::kept_rows::close_kept;
use partita_system::manifold::least_change::FIRST_CORRECTION;
use partita_system::manifold::{follow, At, Closed, ClosureError, Curve, End, Ending, Pace, Visit};
use partita_system::prelude::*;
use partita_system::start;
use partita_system::system::Varied;
use partita_system::{ConstrainedSystem, SystemError};
use std::sync::Arc;

/// Longest step along a family. Unit: characteristic displacement; for the parameter the range of its values. Reason: over a
/// tenth of a radian springs and weights change by a few hundredths.
const LONGEST_FAMILY_STEP: f64 = 0.1;
/// Before this length from its end no part of a closed family lies beyond its beginning. Scale: characteristic displacement.
/// Reason: no step is longer.
const LAST_PART: f64 = 0.1;
/// Steps along a family before it ends: two hundred radians.
const MOST_FAMILY_STEPS: usize = 2000;
/// Corrections of one position of a family. Reason: Newton's method needs five.
const CORRECTIONS: usize = 12;
/// Folds and branchings in one step are separated down to steps of this length. Scale: characteristic displacement.
/// Reason: nearer ones are one to six digits of their difference.
const SEPARATED: f64 = 1e-4;

/// A position of the family.
#[derive(Clone, Debug)]
pub struct Point {
    /// Coordinates.
    pub q: Vec<f64>,
    /// The number.
    pub x: f64,
    /// Length of the family up to here, in characteristic displacements and ranges of x.
    pub s: f64,
    /// How many directions have negative curvature.
    pub negative: usize,
}

/// A position in which det K_d is zero.
#[derive(Clone, Debug)]
pub struct Event {
    /// The position.
    pub at: Point,
    /// Whether x turns back there at an end of stability; otherwise another family crosses.
    pub fold: bool,
    /// Displacement (nv) along which no effort changes.
    pub direction: Vec<f64>,
    /// Directions of negative curvature before and after.
    pub negative: [usize; 2],
}

/// What was found.
#[derive(Clone, Debug, Default)]
pub struct Family {
    /// Positions in their order along the family.
    pub points: Vec<Point>,
    /// Folds and branchings, likewise.
    pub events: Vec<Event>,
    /// Positions in which x has a value that was asked for, likewise: its index, the position.
    pub asked: Vec<(usize, Point)>,
    /// Why it ends at its first and at its last position.
    pub ends: [String; 2],
}

/// The equations for a value of x.
pub type Equations<'m, S> = &'m dyn Fn(f64) -> Result<Arc<S>, AnalysisError>;

/// Everything at a closed position.
struct There<S: ConstrainedSystem + Varied + 'static> {
    /// q and x.
    at: Vec<f64>,
    here: Here,
    by: ByNumber,
    rest: Rest<'static, S>,
}

/// One position with what its neighbours are told apart by.
#[derive(Clone)]
struct Mark {
    /// q and x.
    at: Vec<f64>,
    s: f64,
    tangent: Vec<f64>,
    natural: Matrix,
    largest: f64,
    negative: usize,
}

impl Mark {
    fn x(&self) -> f64 {
        self.at[self.at.len() - 1]
    }
    fn slope(&self) -> f64 {
        self.tangent[self.tangent.len() - 1]
    }
    /// det K_d in the natural metric, its entries over `scale`: it does not depend on the choice of coordinates.
    fn determinant(&self, scale: f64) -> f64 {
        let k = self.natural.rows();
        let mut a: Vec<f64> = self.natural.data().iter().map(|x| x / scale).collect();
        let mut pivots = vec![0; k];
        dense::lu(&mut a, k, &mut pivots).map_or(0.0, |()| dense::lu_determinant(&a, k, &pivots))
    }
    fn point(&self) -> Point {
        let nq = self.at.len() - 1;
        Point { q: self.at[..nq].to_vec(), x: self.at[nq], s: self.s, negative: self.negative }
    }
}

/// Equilibria as a curve: positions are q with x behind it, tangents displacements in characteristic ones with dx in its
/// scale behind them.
struct Equilibria<'m, S: ConstrainedSystem + Varied + 'static> {
    equations: Equations<'m, S>,
    base: Arc<S>,
    t: f64,
    rank: usize,
    displacement: Vec<f64>,
    scale: f64,
    there: Option<There<S>>,
    /// The tangent of the last prediction.
    border: Vec<f64>,
    /// Why the last position could not be evaluated.
    refusal: Option<String>,
}

impl<S: ConstrainedSystem + Varied + 'static> Equilibria<'_, S> {
    /// Close the loops at (q, x) and evaluate there.
    fn place(&self, at: &mut [f64]) -> Result<There<S>, AnalysisError> {
        let nq = at.len() - 1;
        let x = at[nq];
        let system = (self.equations)(x)?;
        let mut rest = Rest::new(system.clone().into(), self.rank, self.t);
        rest.displacement.clone_from(&self.displacement);
        let r = &mut rest.reduction;
        start::choose_partition(r, self.t, &at[..nq], None, None)?;
        if !close_kept(r, self.t, &mut at[..nq])?.is_closed() {
            return Err(SystemError::NotFinite { what: "a loop that does not close".into(), t: self.t }.into());
        }
        let here = rest.look(&at[..nq])?;
        // where the errors of a central difference meet
        let step = f64::EPSILON.cbrt() * self.scale;
        let ahead = (self.equations)(x + step);
        let behind = (self.equations)(x - step);
        let (ahead, behind, step) = match (ahead, behind) {
            (Ok(ahead), Ok(behind)) => (ahead, behind, step),
            // at the end of what the model takes
            (Ok(ahead), Err(_)) => (ahead, system, 0.5 * step),
            (Err(_), Ok(behind)) => (system, behind, 0.5 * step),
            (Err(e), Err(_)) => return Err(e),
        };
        let by = rest.by_number(&at[..nq], &here, (&*ahead, &*behind), step)?;
        Ok(There { at: at.to_vec(), here, by, rest })
    }

    /// The displacement of the positions beside that changes −h_d by −`force` and goes `along` the border; none where
    /// it is not determined.
    fn solve(&self, there: &There<S>, border: &[f64], force: &[f64], along: f64) -> Option<Vec<f64>> {
        let (here, by, n) = (&there.here, &there.by, self.displacement.len());
        let k = here.force.len();
        let size: Vec<f64> = here.independent.iter().map(|&i| self.displacement[i]).collect();
        let mut m = Matrix::new(k + 1, k + 1);
        let mut right = vec![0.0; k + 1];
        for i in 0..k {
            (0..k).for_each(|j| m[(i, j)] = here.stiffness[(i, j)] * size[i] * size[j]);
            m[(i, k)] = by.force[i] * size[i] * self.scale;
            right[i] = force[i] * size[i];
        }
        let largest = m.data().iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        if k > 0 && (largest == 0.0 || !largest.is_finite()) {
            return None;
        }
        m.data_mut().iter_mut().for_each(|x| *x /= largest);
        right.iter_mut().for_each(|x| *x /= largest);
        // displacements per unit of each unknown
        let of = |l: usize, j: usize| {
            let d = if j < k { here.dt[l * k + j] * size[j] } else { by.displacement[l] * self.scale };
            d / self.displacement[l]
        };
        for j in 0..=k {
            m[(k, j)] = (0..n).map(|l| border[l] * of(l, j)).sum::<f64>() + if j == k { border[n] } else { 0.0 };
        }
        right[k] = along;
        let y = factor::solve_dense(&m, &right).ok()?;
        let mut out: Vec<f64> = (0..n).map(|l| (0..=k).map(|j| of(l, j) * y[j]).sum()).collect();
        out.push(y[k]);
        Some(out)
    }

    /// (q, x) displaced.
    fn advance(&self, at: &mut [f64], by: &[f64], part: f64) {
        let (nq, n) = (at.len() - 1, self.displacement.len());
        let dv: Vec<f64> = (0..n).map(|l| part * by[l] * self.displacement[l]).collect();
        self.base.step(&mut at[..nq], &dv);
        at[nq] += part * by[n] * self.scale;
    }

    /// The displacement from a mark to a position, as tangents are given.
    fn from(&self, system: &S, mark: &Mark, q: &[f64], x: f64) -> Vec<f64> {
        let mut from = displacement_between(system, &mark.at[..q.len()], q);
        from.push((x - mark.x()) / self.scale);
        from
    }

    /// How far a position lies beyond a mark, along its tangent.
    fn beyond(&self, mark: &Mark, at: &Point) -> f64 {
        let from = self.from(&self.base, mark, &at.q, at.x);
        from.iter().zip(&mark.tangent).map(|(x, t)| x * t).sum()
    }

    /// Positions that cannot be evaluated end the family; other errors are errors.
    fn placed(&mut self, at: &mut [f64]) -> Result<There<S>, SystemError> {
        match self.place(at) {
            Ok(there) => Ok(there),
            Err(AnalysisError::System(e @ SystemError::Function { .. })) => Err(e),
            Err(e) => {
                self.refusal = Some(e.to_string());
                Err(SystemError::NotFinite { what: "an equilibrium".into(), t: self.t })
            }
        }
    }

    /// What was evaluated last.
    fn mark(&self, at: &[f64], s: f64, tangent: &[f64]) -> Result<Mark, AnalysisError> {
        let Some(there) = &self.there else {
            return Err(SystemError::NotFinite { what: "an equilibrium".into(), t: self.t }.into());
        };
        let found = there.here.curvatures()?;
        Ok(Mark {
            at: at.to_vec(),
            s,
            tangent: tangent.to_vec(),
            negative: found.values.iter().filter(|x| **x < 0.0).count(),
            largest: found.largest,
            natural: found.natural,
        })
    }

    /// The position a part of a step behind a mark.
    fn beside(&mut self, from: &Mark, ds: f64) -> Result<Option<Mark>, AnalysisError> {
        let mut at = from.at.clone();
        self.predict(&mut at, &from.tangent, ds);
        let mut tangent = from.tangent.clone();
        match self.close(&mut at, from.s + ds) {
            Ok(closed) if closed.is_closed() => {}
            Ok(_) | Err(SystemError::NotFinite { .. }) => return Ok(None),
            Err(e) => return Err(e.into()),
        }
        if !self.direct(&at, from.s + ds, &mut tangent)? {
            // where another family branches off there are two tangents
            tangent.clone_from(&from.tangent);
        }
        self.mark(&at, from.s + ds, &tangent).map(Some)
    }

    /// The first zero of a function of the positions between two lengths behind a mark; the nearest position to it that
    /// is determined, where branches meet there.
    fn located(
        &mut self,
        from: &Mark,
        (a, b): ((f64, f64), (f64, f64)),
        value: &dyn Fn(&Mark) -> f64,
    ) -> Result<Option<Mark>, AnalysisError> {
        let mut best: Option<(f64, Mark)> = None;
        false_position(a, b, |ds| {
            let Some(there) = self.beside(from, ds)? else { return Ok(None) };
            let here = value(&there);
            if best.as_ref().is_none_or(|(least, _)| here.abs() <= *least) {
                best = Some((here.abs(), there));
            }
            Ok::<_, AnalysisError>(Some(here))
        })?;
        Ok(best.map(|x| x.1))
    }
}

impl<S: ConstrainedSystem + Varied + 'static> Curve for Equilibria<'_, S> {
    fn direct(&mut self, at: &[f64], _s: f64, tangent: &mut [f64]) -> Result<bool, SystemError> {
        if self.there.as_ref().is_none_or(|there| there.at != at) {
            let there = self.placed(&mut at.to_vec())?;
            self.there = Some(there);
        }
        let Some(there) = &self.there else { return Ok(false) };
        let none = vec![0.0; there.here.force.len()];
        let Some(found) = self.solve(there, tangent, &none, 1.0) else { return Ok(false) };
        let size = found.iter().map(|x| x * x).sum::<f64>().sqrt();
        tangent.iter_mut().zip(&found).for_each(|(x, y)| *x = y / size);
        Ok(size.is_finite())
    }
    fn predict(&mut self, at: &mut [f64], tangent: &[f64], ds: f64) {
        self.border.clear();
        self.border.extend(tangent);
        self.advance(at, tangent, ds);
    }
    fn close(&mut self, at: &mut [f64], _s: f64) -> Result<Closed, SystemError> {
        let mut closed =
            Closed { ending: Ending::Elsewhere, iterations: 0, closure_error: ClosureError::default(), moved: 0.0 };
        let mut left = f64::INFINITY;
        while closed.iterations < CORRECTIONS {
            let there = self.placed(at)?;
            // where branches meet, corrections are not determined, but none is needed
            let rests = there.here.rests();
            let by = if rests { None } else { self.solve(&there, &self.border, &there.here.force, 0.0) };
            let length = by.iter().flatten().fold(0.0, |m: f64, x| m.max(x.abs()));
            let arrived = rests
                || by.is_some() && length <= tolerance::SUM_ROUNDING
                || by.is_some() && length < tolerance::CLOSED_IN_RUN && tolerance::DOUBLED * length > left;
            if arrived {
                self.there = Some(there);
                return Ok(Closed { ending: Ending::Closed, ..closed });
            }
            let Some(by) = by.filter(|_| length <= FIRST_CORRECTION && length <= tolerance::CONVERGES * left) else {
                return Ok(closed);
            };
            self.advance(at, &by, 1.0);
            closed.moved += length;
            closed.iterations += 1;
            left = length;
        }
        Ok(Closed { ending: Ending::Unfinished, ..closed })
    }
}

/// The part of a family on one side of its first position.
struct Side {
    marks: Vec<Mark>,
    end: String,
    /// Length at which it comes back to its first position.
    returned: Option<f64>,
}

/// Follow a family from a position, x growing first or falling, while it stays within limits.
fn side<S: ConstrainedSystem + Varied + 'static>(
    curve: &mut Equilibria<S>,
    q: &[f64],
    (x, direction): (f64, f64),
    limits: (f64, f64),
) -> Result<Side, AnalysisError> {
    let n = curve.displacement.len();
    let mut at = q.to_vec();
    at.push(x);
    let mut first = vec![0.0; n + 1];
    first[n] = direction;
    // the first tangent, before it is followed
    let mut tangent = first.clone();
    curve.there = Some(curve.place(&mut at)?);
    if !curve.direct(&at, 0.0, &mut tangent)? {
        let end = "the parameter is stationary along the family at its start".to_string();
        return Ok(Side { marks: vec![curve.mark(&at, 0.0, &first)?], end, returned: None });
    }
    let mut marks = vec![curve.mark(&at, 0.0, &tangent)?];
    let (mut returned, mut left, mut trouble) = (None, false, None);
    let start = marks[0].clone();
    let pace = Pace { longest: LONGEST_FAMILY_STEP, shortest: tolerance::SHORTEST_STEP, steps: MOST_FAMILY_STEPS };
    let length = LONGEST_FAMILY_STEP * MOST_FAMILY_STEPS as f64;
    let followed = follow(curve, &mut at, &tangent, length, &pace, &mut |curve, there: At| {
        let last = &marks[marks.len() - 1];
        let now = match curve.mark(there.q, there.s, there.tangent) {
            Ok(now) => now,
            Err(e) => {
                trouble = Some(e);
                return Ok(Visit::Stop);
            }
        };
        let turned = (last.slope() > 0.0) != (now.slope() > 0.0);
        let changed = (last.determinant(last.largest) > 0.0) != (now.determinant(last.largest) > 0.0);
        let several = last.negative.abs_diff(now.negative) > 1 || (turned && !changed);
        if several && there.s - last.s > SEPARATED {
            return Ok(Visit::Back);
        }
        // beyond the first position, along its tangent
        let nq = now.at.len() - 1;
        let step = there.s - last.s;
        let beyond = |system: &S| {
            let from = curve.from(system, &start, &now.at[..nq], now.x());
            let beyond: f64 = from.iter().zip(&start.tangent).map(|(x, t)| x * t).sum();
            let size = from.iter().map(|x| x * x).sum::<f64>().sqrt();
            ((0.0..=step).contains(&beyond) && size <= tolerance::DOUBLED * step).then_some(beyond)
        };
        // what winds up for one value of the number may not do so for another
        let winds = curve.there.as_ref().is_some_and(|there| beyond(&there.rest.reduction.system).is_none());
        if marks.len() > 2 && !winds {
            returned = beyond(&curve.base).map(|beyond| there.s - beyond);
        }
        left = now.x() < limits.0 || now.x() > limits.1;
        marks.push(now);
        Ok(if left || returned.is_some() { Visit::Stop } else { Visit::On })
    })?;
    if let Some(e) = trouble {
        return Err(e);
    }
    let end = match followed.end {
        _ if returned.is_some() => "it comes back to its start".to_string(),
        _ if left => "the parameter leaves the range of its values".to_string(),
        End::Long | End::There => format!("after {MOST_FAMILY_STEPS} steps"),
        _ => curve.refusal.take().unwrap_or_else(|| "no equilibrium continues it: branches meet there".to_string()),
    };
    Ok(Side { marks, end, returned })
}

/// The positions asked for and the events between two marks.
fn between<S: ConstrainedSystem + Varied + 'static>(
    curve: &mut Equilibria<S>,
    (a, b): (&Mark, &Mark),
    asked: &[f64],
    out: &mut Family,
) -> Result<(), AnalysisError> {
    let ds = b.s - a.s;
    let (turned, scale) = ((a.slope() > 0.0) != (b.slope() > 0.0), a.largest);
    let (one, two) = (a.determinant(scale), b.determinant(scale));
    let mut parts = vec![(0.0, a.x())];
    if (one > 0.0) != (two > 0.0) || turned {
        let found = if (one > 0.0) != (two > 0.0) {
            curve.located(a, ((0.0, one), (ds, two)), &|m| m.determinant(scale))?
        } else {
            curve.located(a, ((0.0, a.slope()), (ds, b.slope())), &Mark::slope)?
        };
        if let Some(found) = found {
            // where x turns back and det K_d does not change its sign, the family crosses another one
            let fold = turned && (one > 0.0) != (two > 0.0);
            let direction = free_direction(&curve.place(&mut found.at.clone())?)?;
            parts.push((found.s - a.s, found.x()));
            let at = found.point();
            out.events.push(Event { at, fold, direction, negative: [a.negative, b.negative] });
        }
    }
    parts.push((ds, b.x()));
    for part in parts.windows(2) {
        let ((s1, x1), (s2, x2)) = (part[0], part[1]);
        let mut inside: Vec<usize> = (0..asked.len())
            .filter(|&i| (asked[i] > x1 && asked[i] <= x2) || (asked[i] < x1 && asked[i] >= x2))
            .collect();
        sort_by(&mut inside, |&i, &j| (asked[i] - x1).abs().total_cmp(&(asked[j] - x1).abs()));
        for i in inside {
            let wanted = asked[i];
            let found = if x2 == wanted {
                curve.beside(a, s2)?
            } else {
                curve.located(a, ((s1, x1 - wanted), (s2, x2 - wanted)), &|m| m.x() - wanted)?
            };
            let Some(found) = found else { continue };
            let mut at = found.at.clone();
            let nq = at.len() - 1;
            at[nq] = wanted;
            curve.place(&mut at)?;
            at.truncate(nq);
            out.asked.push((i, Point { q: at, x: wanted, ..found.point() }));
        }
    }
    Ok(())
}

/// The displacement (nv) along which efforts change least, its largest component one.
fn free_direction<S: ConstrainedSystem + Varied + 'static>(there: &There<S>) -> Result<Vec<f64>, AnalysisError> {
    let (here, n) = (&there.here, there.rest.displacement.len());
    let (k, found) = (here.force.len(), here.curvatures()?);
    let Some(least) = (0..k).min_by(|&i, &j| found.values[i].abs().total_cmp(&found.values[j].abs())) else {
        return Ok(vec![0.0; n]);
    };
    let mut z: Vec<f64> = (0..k).map(|i| found.vectors[(i, least)]).collect();
    here.backward(&mut z);
    let size = travel(&here.dt, &there.rest.displacement, &z);
    Ok(here.dt.chunks_exact(k).map(|row| dense::dot(row, &z) / size).collect())
}

/// The family of equilibria through the one at (q, x), over all values `asked`: it is followed as long as x stays within
/// their range, widened by itself on both sides but not through zero, folds included.
///
/// # Errors
/// Where the position has no neighbours, and errors of functions that the model calls.
pub fn family(equations: Equations<Model>, t: f64, q: &[f64], x: f64, asked: &[f64]) -> Result<Family, AnalysisError> {
    let base = equations(x)?;
    let rank = start::analyse(&*base, t, q)?.rank;
    let (low, high) = asked.iter().fold((x, x), |(low, high), a| (low.min(*a), high.max(*a)));
    let scale = if high > low { high - low } else { x.abs().max(1.0) };
    // a stiffness or a length that is positive everywhere stays so
    let beyond = |limit: f64, end: f64| if limit * end > 0.0 { limit } else { 0.0 };
    let crosses = low < 0.0 && high > 0.0 || low == 0.0 || high == 0.0;
    let limits = match crosses {
        true => (low - scale, high + scale),
        false => (beyond(low - scale, low), beyond(high + scale, high)),
    };
    let displacement = (0..base.size().nv).map(|l| base.structure().displacement(l)).collect();
    let mut curve =
        Equilibria { equations, base, t, rank, displacement, scale, there: None, border: Vec::new(), refusal: None };
    let mut sides = Vec::new();
    let first = if x < high { 1.0 } else { -1.0 };
    sides.push((first, side(&mut curve, q, (x, first), limits)?));
    if x > low && x < high && sides[0].1.returned.is_none() {
        sides.push((-first, side(&mut curve, q, (x, -first), limits)?));
    }
    let mut parts: Vec<Family> = Vec::new();
    for (_, side) in &sides {
        let mut part = Family::default();
        for pair in side.marks.windows(2) {
            between(&mut curve, (&pair[0], &pair[1]), asked, &mut part)?;
        }
        if let Some(returned) = side.returned {
            let first = &side.marks[0];
            let before = |at: &Point| at.s < returned - LAST_PART || curve.beyond(first, at) < -tolerance::OPEN;
            part.asked.retain(|(_, at)| before(at));
            part.events.retain(|event| before(&event.at));
        }
        part.points = side.marks.iter().map(Mark::point).collect();
        part.ends[1].clone_from(&side.end);
        parts.push(part);
    }
    let mut out = Family::default();
    if parts.len() == 2 {
        // the other side comes first, backwards
        let mut back = parts.remove(1);
        let turn = |at: &mut Point| at.s = -at.s;
        back.points.iter_mut().for_each(turn);
        back.asked.iter_mut().for_each(|x| turn(&mut x.1));
        back.events.iter_mut().for_each(|x| {
            turn(&mut x.at);
            x.negative.reverse();
        });
        out.points.extend(back.points.into_iter().skip(1).rev());
        out.asked.extend(back.asked.into_iter().rev());
        out.events.extend(back.events.into_iter().rev());
        out.ends[0].clone_from(&back.ends[1]);
    } else {
        out.ends[0] = "it starts there".to_string();
    }
    let part = parts.remove(0);
    let own = part.points.first().cloned();
    for (i, _) in asked.iter().enumerate().filter(|a| *a.1 == x) {
        out.asked.extend(own.clone().map(|at| (i, at)));
    }
    out.points.extend(part.points);
    out.asked.extend(part.asked);
    out.events.extend(part.events);
    out.ends[1].clone_from(&part.ends[1]);
    Ok(out)
}
