//! A drawing that is off by a little: conditions that would be redundant, were it exact, are bridged.
//!
//! Rows and velocities are measured in natural sizes. What a row adds to the others within the drawing tolerance makes it a
//! candidate. Whether it closes a motion, merely misfits or says nothing at all is not told by its rank at one position: the
//! mechanism is moved, closed with the rows kept, and what the others open by is the misfit.     (11.9)
//!
//! Which rows are kept, in which coordinates, along which axes and in which order, is a matter of choice. The verdict is
//! none: it is found on one form of the mechanism ([`ConstrainedSystem::fit`]), and what is measured is what the joints must
//! open by together, at the least. With N the self-stresses (a row for each row left out, in natural sizes) and r what they
//! find open, that is
//!
//! ```text
//! |e|² = rᵀ (N Nᵀ)⁻¹ r,   the least of all openings e with N e = r
//! ```
//!
//! the same whichever rows were left out.

mod openings;

pub use openings::{openings, Place, Said};

use crate::reduction::openness::CLOSED;
use crate::reduction::{bridged_gap, bridged_row, Reduction, BY_CHOICE, FITS, REDUNDANT};
use crate::system::{ConstrainedSystem, Fit, SystemError};
use partita_math::dense::{cholesky, cholesky_backward, cholesky_forward, Matrix};
use partita_math::factor::symmetric_eigen;
use partita_math::rank::{weighed_rows, RowRank};

/// What adds less than this (squared, in natural sizes) cannot be told from nothing: round-off of sums of squares.
pub const EXACT: f64 = 1e-14;
/// A row kept must add this many times what a row left out does: below there is no telling which is which.
const CLEAR: f64 = 10.0;
/// Rates of opening, in parts of the motion, that a tolerance allows each self-stress: where every joint was off by one
/// tolerance, in its axis and in its point, it came to 0.3 to 1.54 (four-bar, five-bar, Bennett, parallel cranks, delta);
/// several self-stresses add up by their squares.
const EACH: f64 = 1.6;
/// Of more rows left out than this each is judged by its own self-stress alone: of chains of many loops, whose self-stresses
/// hardly meet, N Nᵀ would be a large matrix.
const TOGETHER: usize = 200;
/// Of more freedoms than this the weakest motion is not sought.
const SEARCHED: usize = 60;
/// Length of the motion by which misfits are told from conditions, in reaches of the velocity that moves most...
const MOVED: f64 = 0.1;
/// ... in so many steps, each closed: Newton's method from a fiftieth of a reach finds the position next to it.
const STEPS: usize = 5;
const SHORT: (f64, usize) = (MOVED, STEPS);
/// A misfit opens a row by no more than this part of what it adds, on so short a motion; next to a singular position, where
/// it adds as much as the distance, the motion opens it by half its own square.
const GROWS: f64 = 0.4;
/// Nor, unless it stays as weak, by more than twice of what is in proportion (arms of a sixtieth of the base, half a degree from
/// flat, came to three times that).
const BENDS: f64 = 2.0 * MOVED;
/// A misfit belongs to the drawing and stays about as weak wherever the mechanism goes (within a quarter in all that were
/// tried); what lies near a singular position changes with the distance from it, here by a tenth of a reach (to twice, or to
/// nothing).
const STAYS: f64 = 1.3;
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

/// Closings that misfit within `tolerance`, which the motion bridges; `None` where nothing is to be bridged, or where what is
/// nearly redundant closes a motion all the same.
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
    match fit(system, t, q, tolerance)? {
        Some(fit) if fit.within => in_rows(system, t, q, &fit),
        _ => Ok(None),
    }
}

/// What would be bridged if the drawing might be off by more than `tolerance`: closings that hardly say anything, and open by
/// no more than that when the mechanism is moved without them. A position near a singular one is none of these: what is weak
/// there is strong next to it.
///
/// # Errors
/// Where nothing can be evaluated at (t, q).
pub fn beyond<S: ConstrainedSystem>(
    system: &S,
    t: f64,
    q: &[f64],
    tolerance: f64,
) -> Result<Option<Bridged>, SystemError> {
    match fit(system, t, q, tolerance)? {
        Some(fit) if !fit.within => in_rows(system, t, q, &fit),
        _ => Ok(None),
    }
}

/// Does the drawing fit, and what was meant by it? `None` where it does, or where what is weak is no matter of drawing.
///
/// # Errors
/// Where nothing can be evaluated at (t, q).
pub fn fit<S: ConstrainedSystem>(system: &S, t: f64, q: &[f64], tolerance: f64) -> Result<Option<Fit>, SystemError> {
    let size = system.size();
    if tolerance <= 0.0 || size.rows == 0 || size.rows != size.holonomic {
        return Ok(None);
    }
    // what is weak for the largest tolerance may be a closing of its own, and what misfits be weaker by far
    let largest = limits(tolerance).into_iter().fold(0.0, f64::max);
    let found = candidates(system, t, q, largest)?;
    if found.others == 0 || found.weak == 0 && found.clear && fits(system, t, q, &found)? {
        return Ok(None);
    }
    match system.fit(t, q, tolerance)? {
        Some(fit) => Ok((fit.freedoms != fit.drawn || fit.misfit > 0.0).then_some(fit)),
        None => Ok(judged(system, t, q, tolerance)?.misfit()),
    }
}

/// Freedoms of a mechanism some of whose closings are redundant, drives released; `None` where none are.
///
/// # Errors
/// Where nothing can be evaluated at (t, q).
pub fn redundant<S: ConstrainedSystem>(
    system: &S,
    t: f64,
    q: &[f64],
    tolerance: f64,
) -> Result<Option<usize>, SystemError> {
    let size = system.size();
    if tolerance <= 0.0 || size.rows == 0 || size.rows != size.holonomic {
        return Ok(None);
    }
    let found = candidates(system, t, q, bridged_row(tolerance))?;
    let is_so = found.clear && found.others > 0 && found.weak == 0;
    Ok(is_so.then(|| size.nv.saturating_sub(found.closings)))
}

/// What may be weak (squared, in natural sizes), in the order in which it is tried; the last is the largest.
fn limits(tolerance: f64) -> Vec<f64> {
    let largest = bridged_row(LARGEST_TOLERANCE);
    let mut limits = vec![(BY_CHOICE.powi(2) * bridged_row(tolerance)).min(largest), bridged_row(tolerance), largest];
    limits.dedup();
    limits
}

/// What a drawing says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Judged {
    /// It fits; so many degrees of freedom, drives released.
    Fits(usize),
    /// It misfits, within the tolerance or beyond it.
    Misfits(Fit),
    /// What is weak is no matter of drawing: the position is singular, or nearly so.
    Unclear,
}

impl Judged {
    fn misfit(self) -> Option<Fit> {
        match self {
            Self::Misfits(fit) => Some(fit),
            Self::Fits(_) | Self::Unclear => None,
        }
    }
}

/// The same on this very system, whatever form of the mechanism it is.
///
/// # Errors
/// Where nothing can be evaluated at (t, q).
pub fn judged<S: ConstrainedSystem>(system: &S, t: f64, q: &[f64], tolerance: f64) -> Result<Judged, SystemError> {
    let nv = system.size().nv;
    let mut tried: Vec<usize> = Vec::new();
    let mut judged = Judged::Unclear;
    for limit in limits(tolerance) {
        let found = candidates(system, t, q, limit)?;
        if !found.clear || tried.contains(&found.closings) {
            continue; // the same rows, or none
        }
        tried.push(found.closings);
        let freedoms = nv - found.closings;
        if found.others == 0 {
            judged = Judged::Fits(freedoms);
            continue;
        }
        let Some(seen) = seen(system, (t, q), tolerance, &found)? else { continue };
        let fit = Fit { freedoms, drawn: freedoms - found.weak.min(freedoms), misfit: seen.opened, within: true };
        if seen.opened <= FITS && found.weak == 0 {
            judged = Judged::Fits(freedoms);
            continue; // what is left out says nothing; what is kept may still be a misfit beyond the tolerance
        }
        let sums = (found.weak.max(1) as f64).sqrt();
        // what opens by more than in proportion, and elsewhere at another rate, is a condition next to a singular position
        let bends = !seen.stays && seen.opened - seen.home > (BENDS * seen.weak).max(MOVED * tolerance);
        if seen.weak <= EACH * sums * tolerance && seen.opened <= bridged_gap(tolerance) && !bends {
            return Ok(Judged::Misfits(fit));
        }
        if found.weak > 0 && seen.opened <= GROWS * seen.weak && seen.stays {
            return Ok(Judged::Misfits(Fit { within: false, ..fit }));
        }
    }
    Ok(judged)
}

/// What rank alone tells.
struct Candidates {
    /// Independent closings.
    closings: usize,
    /// Closings that add something to them, but little.
    weak: usize,
    /// All closings that are left out, these included.
    others: usize,
    /// Are those kept far stronger than those left out?
    clear: bool,
}

fn candidates<S: ConstrainedSystem>(system: &S, t: f64, q: &[f64], limit: f64) -> Result<Candidates, SystemError> {
    let drive = |i: usize| system.row_is_drive(i);
    let mut r = Reduction::geometric(system, 0);
    r.position(t, q)?;
    r.refresh_scales(t, q)?;
    let found = ranked(&r, EXACT, (limit, &drive));
    let (mut smallest, mut strongest) = (1.0f64, found.largest_dropped);
    let (mut closings, mut weak) = (0, 0);
    for (_, &pivot) in found.kept.iter().zip(&found.pivots).filter(|x| !drive(*x.0)) {
        if pivot > limit {
            closings += 1;
            smallest = smallest.min(pivot);
        } else {
            weak += 1;
            strongest = strongest.max(pivot);
        }
    }
    let all = (0..system.size().rows).filter(|&i| !drive(i)).count();
    Ok(Candidates { closings, weak, others: all - closings, clear: smallest >= CLEAR * CLEAR * strongest })
}

/// Rows of the last position by what they add, in natural sizes.
fn ranked<S: ConstrainedSystem>(r: &Reduction<S>, least: f64, preference: (f64, &dyn Fn(usize) -> bool)) -> RowRank {
    let system = r.system;
    let reach: Vec<f64> = (0..system.size().nv).map(|i| system.reach(i)).collect();
    let sizes: Vec<f64> = (0..system.size().rows).map(|i| r.row_size(i)).collect();
    weighed_rows(system.pattern(), &r.c, (&reach, &sizes), least, preference)
}

/// Moved once, do the rows left out stay closed to the last digits?
fn fits<S: ConstrainedSystem>(system: &S, t: f64, q: &[f64], found: &Candidates) -> Result<bool, SystemError> {
    let mut r = Reduction::geometric(system, found.closings);
    let Some(home) = started(&mut r, t, q)? else { return Ok(false) };
    if r.misfit().0 > FITS || r.k() == 0 {
        return Ok(r.k() == 0);
    }
    let mut fits = true;
    let ways = Ways::new(&r, Vec::new());
    moved(&mut r, (t, &home), &ways, (0, 1.0), SHORT, &mut |r, _| {
        fits &= r.misfit().0 <= FITS;
        fits
    })?;
    Ok(fits)
}

/// What a motion shows.
struct Seen {
    /// The largest rate at which the joints open, for a motion of one reach, where it begins.
    weak: f64,
    /// What they are open by there.
    home: f64,
    /// The most they opened by.
    opened: f64,
    /// Are they about as weak where the motions ended?
    stays: bool,
}

/// Move the mechanism with the drives released, closed with the rows kept. `None` where the others open by more than any
/// misfit would, or where nothing can be tried.
fn seen<S: ConstrainedSystem>(
    system: &S,
    (t, q): (f64, &[f64]),
    tolerance: f64,
    found: &Candidates,
) -> Result<Option<Seen>, SystemError> {
    let mut r = Reduction::geometric_dense(system, found.closings);
    let Some(home) = started(&mut r, t, q)? else { return Ok(None) };
    let Some(stresses) = SelfStresses::new(&r) else { return Ok(None) };
    let open = stresses.opened(&r);
    let mut seen = Seen { weak: 0.0, home: open, opened: open, stays: true };
    if r.k() == 0 {
        return Ok(Some(seen));
    }
    if r.tangent(t).is_err() {
        return Ok(None);
    }
    let weakest = if found.weak > 0 { stresses.weakest(&mut r) } else { Vec::new() };
    seen.weak = stresses.rate(&mut r, &weakest);
    let limit = bridged_gap(tolerance).max(GROWS * seen.weak);
    let ways = Ways::new(&r, weakest);
    for direction in 0..ways.count {
        for sign in [1.0, -1.0] {
            moved(&mut r, (t, &home), &ways, (direction, sign), SHORT, &mut |r, _| {
                let open = SelfStresses::new(r).map_or(f64::INFINITY, |x| x.opened(r));
                seen.opened = seen.opened.max(open);
                seen.opened <= limit
            })?;
            if seen.opened > limit {
                return Ok(None);
            }
            if seen.weak > 0.0 {
                let there = match (r.tangent(t), SelfStresses::new(&r)) {
                    (Ok(()), Some(x)) => {
                        let weakest = x.weakest(&mut r);
                        x.rate(&mut r, &weakest)
                    }
                    _ => 0.0,
                };
                seen.stays &= there < STAYS * seen.weak && seen.weak < STAYS * there;
            }
        }
    }
    Ok(Some(seen))
}

/// Self-stresses of the closings left out at the last position, factored: N Nᵀ = L Lᵀ, in natural sizes.
struct SelfStresses {
    /// Closings left out.
    rows: Vec<usize>,
    /// L, or its diagonal alone.
    lower: Vec<f64>,
    diagonal: bool,
}

impl SelfStresses {
    /// Needs the factors of C_D; None where they are of no use.
    fn new<S: ConstrainedSystem>(r: &Reduction<S>) -> Option<Self> {
        let (system, pattern) = (r.system, r.system.pattern());
        let rows: Vec<usize> = r.dropped().iter().copied().filter(|&i| !system.row_is_drive(i)).collect();
        let (n, diagonal) = (rows.len(), rows.len() > TOGETHER);
        let mut of_row = vec![0.0; system.size().nv];
        let mut stresses: Vec<Vec<f64>> = Vec::with_capacity(if diagonal { 0 } else { n });
        let mut lower = vec![0.0; if diagonal { n } else { n * n }];
        for (place, &row) in rows.iter().enumerate() {
            of_row.fill(0.0);
            pattern.row(row).for_each(|e| of_row[pattern.col_idx[e]] = r.c[e]);
            // C_Dᵀ w = (C_i)_D: the row as a sum of kept ones
            let mut w: Vec<f64> = r.partition.dependent.iter().map(|&i| of_row[i]).collect();
            r.solve_transposed(&mut w);
            w.iter_mut().zip(&r.partition.rows).for_each(|(w, &kept)| *w *= r.row_size(kept) / r.row_size(row));
            let own = 1.0 + w.iter().map(|x| x * x).sum::<f64>();
            if !own.is_finite() {
                return None;
            }
            if diagonal {
                lower[place] = own.sqrt();
                continue;
            }
            for (other, x) in stresses.iter().enumerate() {
                lower[place * n + other] = x.iter().zip(&w).map(|(x, y)| x * y).sum();
                lower[other * n + place] = lower[place * n + other];
            }
            lower[place * n + place] = own;
            stresses.push(w);
        }
        if !diagonal && n > 0 && cholesky(&mut lower, n).is_err() {
            return None;
        }
        Some(Self { rows, lower, diagonal })
    }

    /// L⁻¹ r.
    fn least(&self, r: &mut [f64]) {
        match self.diagonal {
            true => r.iter_mut().zip(&self.lower).for_each(|(r, l)| *r /= l),
            false => cholesky_forward(&self.lower, r.len(), r),
        }
    }

    /// What the joints open by at the last position, together and at the least, in parts of sizes.
    fn opened<S: ConstrainedSystem>(&self, r: &Reduction<S>) -> f64 {
        let mut open: Vec<f64> = self.rows.iter().map(|&i| r.phi[i] / r.row_size(i)).collect();
        self.least(&mut open);
        norm(&open)
    }

    /// Rates at which they open, at the independent rates u for a motion of one reach.
    fn rate<S: ConstrainedSystem>(&self, r: &mut Reduction<S>, u: &[f64]) -> f64 {
        if u.is_empty() {
            return 0.0;
        }
        r.gamma.fill(0.0);
        r.spread(u);
        let travel = r.system.travel(&r.v);
        let mut open: Vec<f64> = self.rows.iter().map(|&i| r.row_times(i, &r.v) / r.row_size(i)).collect();
        self.least(&mut open);
        if travel > 0.0 {
            norm(&open) / travel
        } else {
            0.0
        }
    }

    /// Independent rates of the motion along which the joints open fastest, for its length in reaches; of many freedoms none.
    fn weakest<S: ConstrainedSystem>(&self, r: &mut Reduction<S>) -> Vec<f64> {
        let k = r.k();
        if k > SEARCHED {
            return vec![1.0; k];
        }
        let reach: Vec<f64> = (0..r.v.len()).map(|i| r.system.reach(i)).collect();
        let (mut motions, mut open) = (Vec::with_capacity(k), Vec::with_capacity(k));
        r.gamma.fill(0.0);
        for j in 0..k {
            let mut unit = vec![0.0; k];
            unit[j] = reach[r.partition.independent[j]];
            r.spread(&unit);
            motions.push(r.v.iter().zip(&reach).map(|(v, s)| v / s).collect::<Vec<f64>>());
            let mut rates: Vec<f64> = self.rows.iter().map(|&i| r.row_times(i, &r.v) / r.row_size(i)).collect();
            self.least(&mut rates);
            open.push(rates);
        }
        // the largest eigenvalue of S x = λ G x, where G = Lg Lgᵀ measures motions and S what they open
        let mut metric = gram(&motions, k);
        if cholesky(&mut metric, k).is_err() {
            return Vec::new();
        }
        let mut turned: Vec<Vec<f64>> = (0..open.first().map_or(0, Vec::len))
            .map(|i| {
                let mut column: Vec<f64> = open.iter().map(|x| x[i]).collect();
                cholesky_forward(&metric, k, &mut column);
                column
            })
            .collect();
        let columns: Vec<Vec<f64>> = (0..k).map(|j| turned.iter().map(|row| row[j]).collect()).collect();
        turned.clear();
        let Ok((_, vectors)) = symmetric_eigen(&Matrix::from_vec(k, k, gram(&columns, k))) else { return Vec::new() };
        let mut u: Vec<f64> = (0..k).map(|j| vectors.row(j)[k - 1]).collect();
        cholesky_backward(&metric, k, &mut u);
        u.iter_mut().zip(&r.partition.independent).for_each(|(u, &i)| *u *= reach[i]);
        u
    }
}

/// Products of vectors with each other.
fn gram(of: &[Vec<f64>], k: usize) -> Vec<f64> {
    let mut g = vec![0.0; k * k];
    for i in 0..k {
        for j in 0..k {
            g[i * k + j] = of[i].iter().zip(&of[j]).map(|(x, y)| x * y).sum();
        }
    }
    g
}

fn norm(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Ways in which a mechanism is moved: the one along which it opens fastest; fixed irregular ones, so that no symmetry of a
/// mechanism hides a condition; and, where something is weak, every freedom by itself, so that none hides behind a faster
/// one.
struct Ways {
    weakest: Vec<f64>,
    irregular: usize,
    /// How many.
    count: usize,
}

impl Ways {
    fn new<S: ConstrainedSystem>(r: &Reduction<S>, weakest: Vec<f64>) -> Self {
        let k = r.k();
        let first = usize::from(!weakest.is_empty());
        let irregular = if k == 1 && first == 1 { 0 } else { k.min(DIRECTIONS) };
        let single = if k > 1 && k <= SEARCHED { first * k } else { 0 };
        Self { count: first + irregular + single, irregular, weakest }
    }

    /// Independent rates along a way.
    fn rates<S: ConstrainedSystem>(&self, r: &Reduction<S>, way: usize) -> Vec<f64> {
        let first = usize::from(!self.weakest.is_empty());
        if way < first {
            return self.weakest.clone();
        }
        let reach = |i: usize| r.system.reach(r.partition.independent[i]);
        if way >= first + self.irregular {
            let one = way - first - self.irregular;
            return (0..r.k()).map(|j| if j == one { reach(j) } else { 0.0 }).collect();
        }
        let direction = way - first;
        let wave = |j: usize| (1.3 + 1.7 * j as f64 + 2.9 * direction as f64 * (j as f64 + 1.0)).sin();
        let sign = |j: usize| if direction > 0 && (j + direction) % 2 == 0 { -1.0 } else { 1.0 };
        (0..r.k()).map(|j| sign(j) * (1.0 + 0.37 * wave(j)) * reach(j)).collect()
    }
}

/// The position at which the rows kept are closed, near q, with a choice made there; None where there is none.
fn started<S: ConstrainedSystem>(r: &mut Reduction<S>, t: f64, q: &[f64]) -> Result<Option<Vec<f64>>, SystemError> {
    match r.first_partition(t, q) {
        Ok(()) => {}
        Err(SystemError::Singular { .. }) => return Ok(None),
        Err(e) => return Err(e),
    }
    let mut home = q.to_vec();
    Ok(closed(r, t, &mut home)?.then_some(home))
}

/// Move along a way from `home`, closed with the rows kept, as far as it goes and as `look` says; leaves the levels there.
fn moved<S: ConstrainedSystem>(
    r: &mut Reduction<S>,
    (t, home): (f64, &[f64]),
    ways: &Ways,
    (direction, sign): (usize, f64),
    (length, steps): (f64, usize),
    look: &mut dyn FnMut(&Reduction<S>, &[f64]) -> bool,
) -> Result<(), SystemError> {
    let system = r.system;
    let mut there = home.to_vec();
    r.position(t, &there)?;
    if r.tangent(t).is_err() {
        return Ok(());
    }
    let rates = ways.rates(r, direction);
    for _ in 0..steps {
        r.gamma.fill(0.0);
        r.spread(&rates);
        let fastest = system.travel(&r.v);
        if !(fastest.is_finite() && fastest > 0.0) {
            return Ok(());
        }
        let scale = sign * length / (steps as f64 * fastest);
        let by: Vec<f64> = r.v.iter().map(|v| scale * v).collect();
        let before = there.clone();
        system.step(&mut there, &by);
        system.normalise(&mut there);
        // where the motion ends, what was seen of it counts
        if !closed(r, t, &mut there)? {
            r.position(t, &before)?;
            return Ok(());
        }
        if !look(r, &there) || r.tangent(t).is_err() {
            return Ok(());
        }
    }
    Ok(())
}

/// The verdict in the rows and coordinates of this system: which are left out, and what each opens by.
fn in_rows<S: ConstrainedSystem>(system: &S, t: f64, q: &[f64], fit: &Fit) -> Result<Option<Bridged>, SystemError> {
    let nv = system.size().nv;
    let mut probe = Reduction::geometric(system, 0);
    probe.position(t, q)?;
    probe.refresh_scales(t, q)?;
    let drive = |i: usize| system.row_is_drive(i);
    let found = ranked(&probe, 0.0, (0.0, &drive));
    let of_closings: Vec<(usize, f64)> =
        found.kept.iter().copied().zip(found.pivots.iter().copied()).filter(|x| !drive(x.0)).collect();
    let (closings, drawn) = (nv.saturating_sub(fit.freedoms), nv.saturating_sub(fit.drawn));
    if of_closings.len() < closings {
        return Ok(None);
    }
    let mut is_kept = vec![false; system.size().rows];
    of_closings[..closings].iter().for_each(|x| is_kept[x.0] = true);
    let smallest = of_closings[..closings].iter().fold(1.0, |m: f64, x| m.min(x.1));
    let strongest = of_closings[closings..].iter().fold(f64::MIN_POSITIVE, |m: f64, x| m.max(x.1));
    let weak: Vec<usize> =
        of_closings[closings..drawn.clamp(closings, of_closings.len())].iter().map(|x| x.0).collect();
    let mut near: Vec<(usize, f64)> = weak.iter().map(|&i| (i, 0.0)).collect();
    let mut r = Reduction::geometric(system, closings);
    if let Some(home) = started(&mut r, t, q)? {
        let mut opened: Vec<(usize, f64)> = r.dropped().iter().filter(|i| !drive(**i)).map(|&i| (i, 0.0)).collect();
        let ways = Ways::new(&r, Vec::new());
        for direction in 0..ways.count {
            for sign in [1.0, -1.0] {
                moved(&mut r, (t, &home), &ways, (direction, sign), SHORT, &mut |r, _| {
                    opened.iter_mut().for_each(|(i, most)| *most = most.max(r.phi[*i].abs() / r.row_size(*i)));
                    true
                })?;
            }
        }
        opened.retain(|x| x.1 > FITS || weak.contains(&x.0));
        near.retain(|x| !opened.iter().any(|y| y.0 == x.0));
        near.extend(opened);
    }
    near.sort_unstable_by_key(|x| x.0);
    // drives come after all closings, and are never bridged
    let pattern = system.pattern();
    (0..is_kept.len()).filter(|&i| !is_kept[i] && !drive(i)).for_each(|i| probe.c[pattern.row(i)].fill(0.0));
    let with_drives = ranked(&probe, REDUNDANT, (0.0, &drive));
    with_drives.kept.iter().filter(|i| drive(**i)).for_each(|&i| is_kept[i] = true);
    let dropped: Vec<usize> = (0..is_kept.len()).filter(|&i| !is_kept[i]).collect();
    Ok(Some(Bridged {
        rank: is_kept.iter().filter(|x| **x).count(),
        dropped,
        near,
        weak,
        misfit: fit.misfit.max(f64::EPSILON),
        gap: smallest / strongest,
        smallest,
    }))
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
