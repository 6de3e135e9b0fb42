//! The cases decided by pivots and a short motion: independent loop closures, and loop closures that are exactly
//! redundant.
//!
//! Sparse, so that it serves a thousand loops as well as one. The kept rows close the motion; the others must stay
//! closed to rounding, otherwise this module does not decide.

use super::branch::WHOLE_STEP;
use crate::manifold::kept_rows::close_kept;
use crate::manifold::{follow, Closed, Curve, End, Pace, Visit};
use crate::reduction::{largest, Reduction};
use crate::system::{ConstrainedSystem, SystemError};
use partita_math::rank::{weighed_rows, RowRank};
use partita_math::tolerance;

/// Skip single degrees of freedom above this number: mixed directions still move each.
const SINGLE: usize = 60;
/// Its steps, each closed.
const STEPS: usize = 5;
/// Maximum number of mixed directions.
const DIRECTIONS: usize = 4;

/// The decision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Exact {
    /// All loop closures are independent; degrees of freedom, and the squared contribution of the weakest closure.
    Regular(usize, f64),
    /// Loop closures are redundant at every position; likewise, for those that are kept.
    Redundant(usize, f64),
    /// Neither.
    Open,
}

/// Determine the rank of the loop closures near q with the drives released. Values of C up to `level` (in natural
/// sizes) are regarded as undecided.
///
/// # Errors
/// Where nothing can be evaluated at (t, q).
pub fn exact<S: ConstrainedSystem>(system: &S, t: f64, q: &[f64], level: f64) -> Result<Exact, SystemError> {
    let size = system.size();
    let drive = |i: usize| system.structure().rows[i].is_drive;
    let mut r = Reduction::geometric(system, 0);
    r.position(t, q)?;
    r.refresh_scales(t, q)?;
    let found = ranked(&r, tolerance::LOST_PIVOT, (level * level, &drive));
    let of_closings = || found.kept.iter().zip(&found.pivots).filter(|x| !drive(*x.0)).map(|x| *x.1);
    let (closings, smallest) = (of_closings().count(), of_closings().fold(1.0, f64::min));
    let all = (0..size.rows).filter(|&i| !drive(i)).count();
    let dof = size.nv - closings;
    if smallest <= level * level {
        return Ok(Exact::Open);
    }
    if closings == all {
        return Ok(Exact::Regular(dof, smallest));
    }
    let clear = smallest >= tolerance::CLEARLY * tolerance::CLEARLY * found.largest_dropped;
    Ok(if clear && fits(system, t, q, closings)? { Exact::Redundant(dof, smallest) } else { Exact::Open })
}

/// The contribution of the last of these loop closures at (t, q), squared and in natural sizes: the strength of the
/// weakest condition.
///
/// # Errors
/// Where nothing can be evaluated there.
pub fn weakest<S: ConstrainedSystem>(system: &S, t: f64, q: &[f64], closings: usize) -> Result<f64, SystemError> {
    let found = pivots(system, t, q, &|_| false)?;
    Ok(if found.len() < closings { 0.0 } else { found.iter().take(closings).fold(1.0, |m: f64, x| m.min(x.1)) })
}

/// The independent loop closures at (t, q), each with its contribution beyond those before it, squared and in natural
/// sizes; those with `late` true come after the others.
///
/// # Errors
/// Where nothing can be evaluated there.
pub fn pivots<S: ConstrainedSystem>(
    system: &S,
    t: f64,
    q: &[f64],
    late: &dyn Fn(usize) -> bool,
) -> Result<Vec<(usize, f64)>, SystemError> {
    let mut r = Reduction::geometric(system, 0);
    r.position(t, q)?;
    r.refresh_scales(t, q)?;
    let last = |i: usize| late(i) || system.structure().rows[i].is_drive;
    let found = ranked(&r, tolerance::LOST_PIVOT, (tolerance::LOST_PIVOT, &last));
    let rows = found.kept.into_iter().zip(found.pivots);
    Ok(rows.filter(|x| !system.structure().rows[x.0].is_drive).collect())
}

/// Rows of the last position by their contribution beyond those before them, in natural sizes.
pub(crate) fn ranked<S: ConstrainedSystem>(
    r: &Reduction<S>,
    least: f64,
    preference: (f64, &dyn Fn(usize) -> bool),
) -> RowRank {
    let system = r.system.clone();
    let displacement: Vec<f64> = system.structure().displacements().collect();
    let sizes: Vec<f64> = (0..system.size().rows).map(|i| r.row_size(i)).collect();
    weighed_rows(system.pattern(), &r.at.c, (&displacement, &sizes), least, preference)
}

/// Moved along each degree of freedom and along mixtures of them, closed with the kept rows: whether the others stay
/// closed, and those on rates do not oppose it.
fn fits<S: ConstrainedSystem>(system: &S, t: f64, q: &[f64], closings: usize) -> Result<bool, SystemError> {
    let mut r = Reduction::geometric(system, closings);
    match r.first_partition(t, q) {
        Ok(()) => {}
        Err(SystemError::Singular { .. }) => return Ok(false),
        Err(e) => return Err(e),
    }
    let mut home = q.to_vec();
    if !closed(&mut r, t, &mut home)? || opened(&r) > tolerance::FITS {
        return Ok(false);
    }
    let k = r.k();
    let mixed = k.min(DIRECTIONS);
    let single = if k > 1 && k <= SINGLE { k } else { 0 };
    for direction in 0..mixed + single {
        for sign in [1.0, -1.0] {
            if !moved(&mut r, t, &home, (direction, mixed), sign)? {
                return Ok(false);
            }
        }
    }
    Ok(true)
}

/// Relative closure error of the loop closures that were not kept.
fn opened<S: ConstrainedSystem>(r: &Reduction<S>) -> f64 {
    let closings = r.dropped().iter().filter(|&&i| i < r.size().holonomic && !r.system.structure().rows[i].is_drive);
    largest(closings.map(|&i| r.at.phi[i] / r.row_size(i)))
}

/// Largest rate of the conditions on rates that were not kept, where the fastest coordinate has the speed 1.
fn dropped_rate<S: ConstrainedSystem>(r: &Reduction<S>, fastest: f64) -> f64 {
    let pattern = r.system.pattern();
    let rate = |i: usize| pattern.row(i).map(|e| r.at.c[e] * r.at.v[pattern.col_idx[e]]).sum::<f64>();
    let closings = r.dropped().iter().filter(|&&i| i >= r.size().holonomic && !r.system.structure().rows[i].is_drive);
    largest(closings.map(|&i| rate(i) / (r.row_size(i) * fastest)))
}

/// Independent rates of a direction: mixed ones first, irregular, so that no symmetry hides a condition.
fn rates<S: ConstrainedSystem>(r: &Reduction<S>, (direction, mixed): (usize, usize)) -> Vec<f64> {
    let displacement = |j: usize| r.system.structure().displacement(r.planned.partition.independent[j]);
    if let Some(one) = direction.checked_sub(mixed) {
        return (0..r.k()).map(|j| if j == one { displacement(j) } else { 0.0 }).collect();
    }
    let wave = |j: usize| (1.3 + 1.7 * j as f64 + 2.9 * direction as f64 * (j as f64 + 1.0)).sin();
    let sign = |j: usize| if direction > 0 && (j + direction) % 2 == 0 { -1.0 } else { 1.0 };
    (0..r.k()).map(|j| sign(j) * (1.0 + 0.37 * wave(j)) * displacement(j)).collect()
}

/// The motion of the kept rows, by independent rates that are constant.
struct Own<'r, 's, S: ConstrainedSystem> {
    r: &'r mut Reduction<'s, S>,
    t: f64,
    rates: Vec<f64>,
    dv: Vec<f64>,
}

impl<S: ConstrainedSystem> Curve for Own<'_, '_, S> {
    /// Where last evaluated; its fastest coordinate is 1. False where a condition on rates that was not kept opposes it.
    fn direct(&mut self, _q: &[f64], _s: f64, tangent: &mut [f64]) -> Result<bool, SystemError> {
        if self.r.tangent(self.t).is_err() {
            return Ok(false);
        }
        self.r.at.gamma.fill(0.0);
        self.r.spread(&self.rates);
        let fastest = self.r.system.travel(&self.r.at.v);
        let scale = |(i, v): (usize, &f64)| v / (fastest * self.r.system.structure().displacement(i));
        tangent.iter_mut().zip(self.r.at.v.iter().enumerate().map(scale)).for_each(|(to, x)| *to = x);
        Ok(fastest.is_finite() && fastest > 0.0 && dropped_rate(self.r, fastest) <= tolerance::NULL_VALUE)
    }
    fn predict(&mut self, q: &mut [f64], tangent: &[f64], ds: f64) {
        let system = &self.r.system;
        let by = tangent.iter().enumerate().map(|(i, x)| ds * x * system.structure().displacement(i));
        self.dv.iter_mut().zip(by).for_each(|(to, x)| *to = x);
        system.step(q, &self.dv);
        system.normalise(q);
    }
    fn close(&mut self, q: &mut [f64], _s: f64) -> Result<Closed, SystemError> {
        close_kept(self.r, self.t, q)
    }
    fn accepts(&self, closed: &Closed) -> bool {
        is_closed(self.r, closed)
    }
    fn travel(&self, _tangent: &[f64]) -> f64 {
        1.0
    }
}

/// Move along a direction from `home`, as far as possible. False where a row left out opens, or the kept rows lead no
/// further.
fn moved<S: ConstrainedSystem>(
    r: &mut Reduction<S>,
    t: f64,
    home: &[f64],
    direction: (usize, usize),
    sign: f64,
) -> Result<bool, SystemError> {
    let mut there = home.to_vec();
    r.position(t, &there)?;
    let rates: Vec<f64> = rates(r, direction).iter().map(|x| sign * x).collect();
    let n = r.at.v.len();
    let longest = tolerance::RANK_MOVE / STEPS as f64;
    let pace = Pace { longest, shortest: WHOLE_STEP * longest, steps: STEPS };
    let mut curve = Own { r, t, rates, dv: vec![0.0; n] };
    let followed = follow(&mut curve, &mut there, &vec![0.0; n], tolerance::RANK_MOVE, &pace, &mut |curve, _| {
        Ok(if opened(curve.r) > tolerance::FITS { Visit::Back } else { Visit::On })
    });
    match followed {
        Ok(followed) => Ok(followed.end == End::There),
        Err(SystemError::Singular { .. }) => Ok(false),
        Err(e) => Err(e),
    }
}

/// Close the kept rows near q; evaluates the position level there. False where they do not close.
fn closed<S: ConstrainedSystem>(r: &mut Reduction<S>, t: f64, q: &mut [f64]) -> Result<bool, SystemError> {
    match close_kept(r, t, q) {
        Ok(closed) => Ok(is_closed(r, &closed)),
        Err(SystemError::Singular { .. }) => Ok(false),
        Err(e) => Err(e),
    }
}

fn is_closed<S: ConstrainedSystem>(r: &Reduction<S>, closed: &Closed) -> bool {
    closed.is_closed() || r.gap_of_kept() < tolerance::CLOSED_IN_RUN
}
