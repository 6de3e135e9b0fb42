//! What pivots and a short motion settle: closings that are independent, and closings that are redundant to the last
//! digit.
//!
//! Sparse, so that it serves a thousand loops as well as one. Rows kept close the motion; where it is closed so, the
//! others open by nothing but rounding, or something else is the matter, which is not decided here.

use crate::manifold::kept_rows::close_kept;
use crate::reduction::{largest, Reduction};
use crate::system::{ConstrainedSystem, SystemError};
use partita_math::rank::{weighed_rows, RowRank};
use partita_math::tolerance;

/// Skip single degrees of freedom above this number: mixed directions still move each.
const SINGLE: usize = 60;
/// Its steps, each closed.
const STEPS: usize = 5;
/// Mixed directions at the most.
const DIRECTIONS: usize = 4;

/// What is settled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Exact {
    /// All closings are independent; degrees of freedom, and what the weakest closing adds, squared.
    Regular(usize, f64),
    /// Closings are redundant wherever the mechanism goes; likewise, of those that are kept.
    Redundant(usize, f64),
    /// Neither.
    Open,
}

/// Look at the closings near q, drives released. Values of C up to `level` (in natural sizes) are not taken as clear.
///
/// # Errors
/// Where nothing can be evaluated at (t, q).
pub fn exact<S: ConstrainedSystem>(system: &S, t: f64, q: &[f64], level: f64) -> Result<Exact, SystemError> {
    let size = system.size();
    let drive = |i: usize| system.row_is_drive(i);
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
    let clear =
        size.rows == size.holonomic && smallest >= tolerance::CLEARLY * tolerance::CLEARLY * found.largest_dropped;
    Ok(if clear && fits(system, t, q, closings)? { Exact::Redundant(dof, smallest) } else { Exact::Open })
}

/// What the last of so many closings adds at (t, q), squared and in natural sizes: as weak as that the conditions are.
///
/// # Errors
/// Where nothing can be evaluated there.
pub fn weakest<S: ConstrainedSystem>(system: &S, t: f64, q: &[f64], closings: usize) -> Result<f64, SystemError> {
    let drive = |i: usize| system.row_is_drive(i);
    let mut r = Reduction::geometric(system, 0);
    r.position(t, q)?;
    r.refresh_scales(t, q)?;
    let found = ranked(&r, tolerance::LOST_PIVOT, (0.0, &drive));
    let of_closings = || found.kept.iter().zip(&found.pivots).filter(|x| !drive(*x.0)).map(|x| *x.1);
    Ok(if of_closings().count() < closings { 0.0 } else { of_closings().take(closings).fold(1.0, f64::min) })
}

/// Rows of the last position by what they add to those before them, in natural sizes.
pub(crate) fn ranked<S: ConstrainedSystem>(
    r: &Reduction<S>,
    least: f64,
    preference: (f64, &dyn Fn(usize) -> bool),
) -> RowRank {
    let system = r.system.clone();
    let displacement: Vec<f64> = (0..system.size().nv).map(|i| system.characteristic_displacement(i)).collect();
    let sizes: Vec<f64> = (0..system.size().rows).map(|i| r.row_size(i)).collect();
    weighed_rows(system.pattern(), &r.c, (&displacement, &sizes), least, preference)
}

/// Moved along each degree of freedom and along mixtures of them, closed with the rows kept: do the others stay closed?
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

/// What the closings that were not kept open by, in parts of sizes.
fn opened<S: ConstrainedSystem>(r: &Reduction<S>) -> f64 {
    let closings = r.dropped().iter().filter(|&&i| i < r.size().holonomic && !r.system.row_is_drive(i));
    largest(closings.map(|&i| r.phi[i] / r.row_size(i)))
}

/// Independent rates of a direction: mixed ones first, irregular, so that no symmetry hides a condition.
fn rates<S: ConstrainedSystem>(r: &Reduction<S>, (direction, mixed): (usize, usize)) -> Vec<f64> {
    let displacement = |j: usize| r.system.characteristic_displacement(r.partition.independent[j]);
    if let Some(one) = direction.checked_sub(mixed) {
        return (0..r.k()).map(|j| if j == one { displacement(j) } else { 0.0 }).collect();
    }
    let wave = |j: usize| (1.3 + 1.7 * j as f64 + 2.9 * direction as f64 * (j as f64 + 1.0)).sin();
    let sign = |j: usize| if direction > 0 && (j + direction) % 2 == 0 { -1.0 } else { 1.0 };
    (0..r.k()).map(|j| sign(j) * (1.0 + 0.37 * wave(j)) * displacement(j)).collect()
}

/// Move along a direction from `home`, as far as it goes. False where a row left out opens.
fn moved<S: ConstrainedSystem>(
    r: &mut Reduction<S>,
    t: f64,
    home: &[f64],
    direction: (usize, usize),
    sign: f64,
) -> Result<bool, SystemError> {
    let system = r.system.clone();
    let mut there = home.to_vec();
    r.position(t, &there)?;
    if r.tangent(t).is_err() {
        return Ok(false);
    }
    let rates = rates(r, direction);
    for _ in 0..STEPS {
        r.gamma.fill(0.0);
        r.spread(&rates);
        let fastest = system.travel(&r.v);
        if !(fastest.is_finite() && fastest > 0.0) {
            return Ok(false);
        }
        let scale = sign * tolerance::RANK_MOVE / (STEPS as f64 * fastest);
        let by: Vec<f64> = r.v.iter().map(|v| scale * v).collect();
        system.step(&mut there, &by);
        system.normalise(&mut there);
        if !closed(r, t, &mut there)? {
            return Ok(false);
        }
        if opened(r) > tolerance::FITS {
            return Ok(false);
        }
        if r.tangent(t).is_err() {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Close the rows kept near q; leaves the position level there. False where they do not close.
fn closed<S: ConstrainedSystem>(r: &mut Reduction<S>, t: f64, q: &mut [f64]) -> Result<bool, SystemError> {
    match close_kept(r, t, q) {
        Ok(closed) => Ok(closed.is_closed() || r.gap_of_kept() < tolerance::CLOSED_IN_RUN),
        Err(SystemError::Singular { .. }) => Ok(false),
        Err(e) => Err(e),
    }
}
