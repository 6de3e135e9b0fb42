//! A drawing that is off by a little: conditions that would be redundant, were it exact, are bridged.
//!
//! Rows and velocities are measured in natural sizes. What a row adds to the others within the drawing tolerance makes it a
//! candidate. Whether it closes a motion, merely misfits or says nothing at all is not told by its rank at one position: the
//! mechanism is moved, closed with the rows kept, and what the others open by is the misfit.     (11.9)

use crate::reduction::openness::CLOSED;
use crate::reduction::{bridged_gap, bridged_row, Reduction, FITS, REDUNDANT};
use crate::system::{ConstrainedSystem, SystemError};
use partita_math::rank::weighed_rows;

/// What adds less than this (squared, in natural sizes) cannot be told from nothing: round-off of sums of squares.
pub const EXACT: f64 = 1e-14;
/// A row kept must add this many times what a row left out does: below there is no telling which is which.
const CLEAR: f64 = 10.0;
/// Length of the motion by which misfits are told from conditions, in reaches of the velocity that moves most...
const MOVED: f64 = 0.1;
/// ... in so many steps, each closed: Newton's method from a fiftieth of a reach finds the position next to it.
const STEPS: usize = 5;
/// A misfit opens a row by no more than this part of what it adds, on so short a motion; next to a singular position, where
/// it adds as much as the distance, the motion opens it by half its own square.
const GROWS: f64 = 0.4;
/// A misfit belongs to the drawing and stays about as weak wherever the mechanism goes (within a quarter in all that were
/// tried); what lies near a singular position changes with the distance from it, here by a tenth of a reach (to twice, or to
/// nothing).
const STAYS: f64 = 1.5;
/// Directions in which a mechanism of several freedoms is moved, at the most.
const DIRECTIONS: usize = 4;

/// What is bridged.
#[derive(Clone, Debug)]
pub struct Bridged {
    /// Rank of the mechanism as it was meant, drives included.
    pub rank: usize,
    /// Rows that are left out, ascending.
    pub dropped: Vec<usize>,
    /// Those of them that misfit, each with what it opens by, in parts of its size, over the motion that was tried.
    pub near: Vec<(usize, f64)>,
    /// Rows that add something, however little, to those kept: with them the mechanism is the one that is drawn.
    pub weak: Vec<usize>,
    /// The largest of the openings.
    pub misfit: f64,
    /// Ratio between what the weakest row kept adds (squared) and the strongest one left out.
    pub gap: f64,
    /// Square of what the weakest row kept adds.
    pub smallest: f64,
}

/// The largest drawing tolerance: beyond it what differs is another mechanism.
pub const LARGEST_TOLERANCE: f64 = 1e-2;

/// Closings that misfit by no more than `tolerance`, which the motion bridges; `None` where nothing is to be bridged, or
/// where what is nearly redundant closes a motion all the same.
///
/// Drives are never bridged. Cost: one sparse search for the rank, and where there is something to be bridged some forty
/// evaluations a direction.
///
/// # Errors
/// Where nothing can be evaluated at (t, q).
pub fn bridged<S: ConstrainedSystem>(
    system: &S,
    t: f64,
    q: &[f64],
    tolerance: f64,
) -> Result<Option<Bridged>, SystemError> {
    let size = system.size();
    if tolerance <= 0.0 || size.rows == 0 || size.rows != size.holonomic {
        return Ok(None);
    }
    let Some(found) = candidates(system, t, q, tolerance)? else { return Ok(None) };
    tried(system, t, q, bridged_gap(tolerance), found, None)
}

/// What would be bridged if the drawing might be off by more than it may: closings that hardly say anything, and open by no
/// more than that when the mechanism is moved without them. A position near a singular one is none of these: what is weak
/// there is strong next to it.
///
/// # Errors
/// Where nothing can be evaluated at (t, q).
pub fn beyond<S: ConstrainedSystem>(system: &S, t: f64, q: &[f64]) -> Result<Option<Bridged>, SystemError> {
    let size = system.size();
    if size.rows == 0 || size.rows != size.holonomic {
        return Ok(None);
    }
    let Some(found) = candidates(system, t, q, LARGEST_TOLERANCE)? else { return Ok(None) };
    if found.bridged.near.is_empty() {
        return Ok(None);
    }
    let weak = (found.bridged.smallest / found.bridged.gap).sqrt();
    tried(system, t, q, GROWS * weak, found, Some(weak))
}

/// What rank alone tells.
struct Candidates {
    /// Independent closings.
    closings: usize,
    bridged: Bridged,
}

fn candidates<S: ConstrainedSystem>(
    system: &S,
    t: f64,
    q: &[f64],
    tolerance: f64,
) -> Result<Option<Candidates>, SystemError> {
    let mut r = Reduction::geometric(system, 0);
    r.position(t, q)?;
    r.refresh_scales(t, q)?;
    let limit = bridged_row(tolerance);
    let reach: Vec<f64> = (0..system.size().nv).map(|i| system.reach(i)).collect();
    let sizes: Vec<f64> = (0..system.size().rows).map(|i| r.row_size(i)).collect();
    let drive = |i: usize| system.row_is_drive(i);
    let found = weighed_rows(system.pattern(), &r.c, (&reach, &sizes), EXACT, (limit, &drive));
    let (mut near, mut kept) = (Vec::new(), Vec::new());
    let (mut smallest, mut strongest, mut closings) = (1.0f64, found.largest_dropped, 0);
    for (&row, &pivot) in found.kept.iter().zip(&found.pivots) {
        if !drive(row) && pivot > limit {
            closings += 1;
            smallest = smallest.min(pivot);
            kept.push(row);
        } else if !drive(row) {
            strongest = strongest.max(pivot);
            near.push((row, 0.0));
        } else if pivot > REDUNDANT {
            kept.push(row);
        }
    }
    if kept.len() + near.len() == 0 || (0..system.size().rows).all(|i| drive(i) || kept.contains(&i)) {
        return Ok(None);
    }
    if closings == 0 || smallest < CLEAR * CLEAR * strongest {
        return Ok(None);
    }
    near.sort_unstable_by_key(|x| x.0);
    let rank = kept.len();
    let mut is_kept = vec![false; system.size().rows];
    kept.iter().for_each(|&i| is_kept[i] = true);
    let dropped: Vec<usize> = (0..is_kept.len()).filter(|&i| !is_kept[i]).collect();
    let gap = smallest / strongest.max(f64::MIN_POSITIVE);
    let weak = near.iter().map(|x| x.0).collect();
    let bridged = Bridged { rank, dropped, near, weak, misfit: 0.0, gap, smallest };
    Ok(Some(Candidates { closings, bridged }))
}

/// Move the mechanism with the drives released, closed with the rows kept: do the others stay within the tolerance? And, where
/// it is said how `weak` they are here, do they stay that weak?
fn tried<S: ConstrainedSystem>(
    system: &S,
    t: f64,
    q: &[f64],
    limit: f64,
    found: Candidates,
    weak: Option<f64>,
) -> Result<Option<Bridged>, SystemError> {
    let mut bridged = found.bridged;
    let mut r = Reduction::geometric(system, found.closings);
    match r.first_partition(t, q) {
        Ok(()) => {}
        Err(SystemError::Singular { .. }) => return Ok(None),
        Err(e) => return Err(e),
    }
    let mut opened: Vec<(usize, f64)> =
        bridged.dropped.iter().filter(|&&i| !system.row_is_drive(i)).map(|&i| (i, 0.0)).collect();
    let look = |r: &Reduction<S>, opened: &mut [(usize, f64)]| {
        for (i, most) in opened.iter_mut() {
            let part = r.phi[*i].abs() / r.row_size(*i);
            *most = if part.is_nan() { f64::INFINITY } else { most.max(part) };
        }
        opened.iter().all(|x| x.1 <= limit)
    };
    let mut home = q.to_vec();
    if !closed(&mut r, t, &mut home)? || !look(&r, &mut opened) {
        return Ok(None);
    }
    let k = r.k();
    let mut moves = vec![0.0; k];
    let mut by = vec![0.0; system.size().nv];
    for direction in 0..k.min(DIRECTIONS) {
        for sign in [1.0, -1.0] {
            let tried_once = direction > 0 || sign < 0.0;
            if tried_once && bridged.near.is_empty() && opened.iter().all(|x| x.1 <= FITS) {
                return Ok(None); // redundant for good
            }
            let mut there = home.clone();
            r.position(t, &there)?;
            if r.tangent(t).is_err() {
                return Ok(None);
            }
            for _ in 0..STEPS {
                // fixed irregular directions, so that no symmetry of a mechanism hides a condition
                for (j, x) in moves.iter_mut().enumerate() {
                    let wave = (1.3 + 1.7 * j as f64 + 2.9 * direction as f64 * (j as f64 + 1.0)).sin();
                    *x = sign * (1.0 + 0.37 * wave) * system.reach(r.partition.independent[j]);
                    *x *= if direction > 0 && (j + direction) % 2 == 0 { -1.0 } else { 1.0 };
                }
                r.gamma.fill(0.0);
                r.spread(&moves);
                let fastest = (0..by.len()).fold(0.0, |m: f64, i| m.max(r.v[i].abs() / system.reach(i)));
                if !(fastest.is_finite() && fastest > 0.0) {
                    return Ok(None);
                }
                let scale = MOVED / (STEPS as f64 * fastest);
                by.iter_mut().zip(&r.v).for_each(|(x, v)| *x = scale * v);
                system.step(&mut there, &by);
                system.normalise(&mut there);
                if !closed(&mut r, t, &mut there)? {
                    break; // the motion ends here: what was seen of it counts
                }
                if !look(&r, &mut opened) {
                    return Ok(None);
                }
                if r.tangent(t).is_err() {
                    break;
                }
            }
            if let Some(weak) = weak {
                let found = candidates(system, t, &there, LARGEST_TOLERANCE)?;
                let strength = found.map(|x| (x.bridged.smallest / x.bridged.gap).sqrt() / weak);
                if !strength.is_some_and(|x| x < STAYS && x > 1.0 / STAYS) {
                    return Ok(None); // otherwise next to it: the position is near a singular one
                }
            }
        }
    }
    let is_near = |i: usize, near: &[(usize, f64)]| near.iter().any(|x| x.0 == i);
    opened.retain(|&(i, part)| part > FITS || is_near(i, &bridged.near));
    bridged.near = opened;
    // a row that adds something is bridged even where it opens by nothing that is seen on so short a motion
    let largest = bridged.near.iter().fold(0.0, |m: f64, x| m.max(x.1));
    bridged.misfit = largest.max(f64::EPSILON);
    Ok((!bridged.near.is_empty()).then_some(bridged))
}

/// Close the rows kept near q; leaves the levels there. False where they do not.
fn closed<S: ConstrainedSystem>(r: &mut Reduction<S>, t: f64, q: &mut [f64]) -> Result<bool, SystemError> {
    for _ in 0..8 {
        r.position(t, q)?;
        if r.factor(t).is_err() {
            return Ok(false);
        }
        if r.gap_of_kept() < 0.01 * FITS {
            return Ok(true);
        }
        if !r.correct_dependent(q) {
            break;
        }
    }
    r.position(t, q)?;
    Ok(r.factor(t).is_ok() && r.gap_of_kept() < CLOSED)
}
