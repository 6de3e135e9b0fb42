//! Before the first step: rank of the constraints, redundant rows, the first choice of coordinates.

use crate::branching;
use crate::manifold::kept_rows;
use crate::partition::criterion;
use crate::rank::exact::ranked as by_sizes;
use crate::reduction::Reduction;
use crate::system::{ConstrainedSystem, Finite, SystemError};
use partita_math::rank::{preferred_rows, RowRank};
use partita_math::tolerance;

/// The displacement by which redundant rows are distinguished from rows that are dependent here only. Unit:
/// characteristic displacement. Reason: its square, 1e-6, is far above rounding.
const NEXT_DOOR: f64 = 1e-3;

/// Result of the analysis at the start.
#[derive(Clone, Debug, Default)]
pub struct Start {
    /// Rank of C.
    pub rank: usize,
    /// Rows that are combinations of the others everywhere, ascending.
    pub dropped: Vec<usize>,
    /// Ratio between the last pivot kept and the first one dropped (infinite when nothing was dropped).
    pub gap: f64,
    /// Smallest squared sine kept: κ, the distance of the mechanism from a singular position.
    pub smallest: f64,
}

/// Rank at the last position; rows that are nearly zero as a whole are ignored.
fn rank_at_last<S: ConstrainedSystem>(r: &Reduction<S>) -> RowRank {
    let pattern = r.system.pattern();
    let mut c = r.at.c.clone();
    let mut weakest: f64 = 1.0;
    for i in 0..pattern.rows {
        match r.strength(i) {
            Some(s) if s < tolerance::REDUNDANT => pattern.row(i).for_each(|e| c[e] = 0.0),
            Some(s) => weakest = weakest.min(s),
            None => {}
        }
    }
    let drive = |i: usize| r.system.structure().rows[i].is_drive;
    let mut rank = preferred_rows(pattern, &c, r.scales(), tolerance::REDUNDANT, (tolerance::REDUNDANT, &drive));
    rank.pivots.push(weakest);
    rank
}

/// Rank of the constraints at an assembled position, and the rows to be kept.
///
/// If the geometry has been decided, its rank is used, with the strongest rows here. Otherwise a gap in the pivots of
/// the scaled Delassus matrix decides, and a small move along the motion distinguishes a row that is dependent only
/// here (a singular position) from a redundant one: redundant rows stay closed and stay dependent.
///
/// # Errors
/// `SingularStart` in a singular position, and for a mechanism with motions that exist only instantaneously,
/// everywhere.
pub fn analyse<S: ConstrainedSystem>(system: &S, t: f64, q: &[f64]) -> Result<Start, SystemError> {
    analyse_with(&mut Reduction::new(system, 0), t, q)
}

/// As `analyse`, with the levels of any reduction of rank 0; where there is no error they are those at (t, q) afterwards,
/// with scales by the weights set in it.
///
/// # Errors
/// See [`analyse`].
pub fn analyse_with<S: ConstrainedSystem>(probe: &mut Reduction<S>, t: f64, q: &[f64]) -> Result<Start, SystemError> {
    let system = probe.system.clone();
    if let Some(who) = &system.structure().drawing.ambiguous {
        return Err(SystemError::argument("drawing_tolerance", format!("{who} {AMBIGUOUS}")));
    }
    let Some(finite) = system.structure().drawing.finite else {
        let (start, largest_dropped) = ranked(probe, t, q)?;
        if !start.dropped.is_empty() {
            persists(&*system, (t, q), &start, largest_dropped)?;
        }
        return Ok(start);
    };
    if finite.instantaneous > 0 {
        return Err(shaky(t, finite, &system.structure().drawing.instantaneous));
    }
    let start = counted(probe, t, q, finite)?;
    let wanted = system.size().nv.saturating_sub(finite.dof);
    let is_drive = |i: &usize| system.structure().rows[*i].is_drive;
    let closings = (0..system.size().rows).filter(|i| !is_drive(i)).count();
    let kept = closings - start.dropped.iter().filter(|i| !is_drive(i)).count();
    if kept < wanted && finite.hidden {
        let who = owners(&*system, &start.dropped);
        return Err(SystemError::argument("drawing_tolerance", format!("{HIDDEN} ({who})")));
    }
    if kept < wanted {
        return Err(singular(&*system, (t, q), &start, start.rank + wanted - kept)?);
    }
    if start.dropped.iter().any(is_drive) && start.rank < system.size().nv {
        check_neighbour(&*system, t, q, &start)?;
    }
    Ok(start)
}

/// Message for constraints hidden by round-off.
const HIDDEN: &str = "the mechanism is locked by constraints so weak that their forces are lost in rounding: its \
    geometric error slightly exceeds the drawing_tolerance; give the joint positions with all digits, or a larger \
    drawing_tolerance for the play they have";

/// Message for a condition with an error of about the drawing tolerance.
const AMBIGUOUS: &str =
    "nearly follows from the other constraints, by a difference of about the drawing_tolerance: if \
    it should follow from them (wheels on one axis, equal bars, a ring of gears), give its axis, radius, length or \
                         ratio exactly; if it is intended as drawn, give a smaller drawing_tolerance";

/// The first elements to which these rows belong.
fn owners<S: ConstrainedSystem>(system: &S, rows: &[usize]) -> String {
    rows.iter().take(3).map(|&i| &*system.structure().rows[i].owner).collect::<Vec<_>>().join(", ")
}

/// Motions that exist only instantaneously, at every position.
fn shaky(t: f64, finite: Finite, who: &str) -> SystemError {
    let (k, more) = (finite.dof, finite.instantaneous);
    let message = format!(
        "{more} motion{} of the mechanism exist{} only instantaneously, at every position: beyond {k} degree{} of \
         freedom {who} lock at a higher order, where their forces are not determined; add a joint that constrains {} \
         (a guide, a leg that is not parallel to the others), or free one",
        if more == 1 { "" } else { "s" },
        if more == 1 { "s" } else { "" },
        if k == 1 { "" } else { "s" },
        if more == 1 { "it" } else { "them" },
    );
    SystemError::SingularStart { t, message }
}

/// Of the loop closures that the verdict accepts the strongest ones at a position, and drives besides. Where the
/// position is singular there are fewer.
fn counted<S: ConstrainedSystem>(
    probe: &mut Reduction<S>,
    t: f64,
    q: &[f64],
    finite: Finite,
) -> Result<Start, SystemError> {
    let system = probe.system.clone();
    let limit = if finite.weak { tolerance::LOST_PIVOT } else { tolerance::REDUNDANT };
    let drive = |i: usize| system.structure().rows[i].is_drive;
    probe.weigh_displacements(true);
    probe.position(t, q)?;
    probe.refresh_scales(t, q)?;
    let wanted = system.size().nv.saturating_sub(finite.dof);
    let found = by_sizes(probe, 0.0, (0.0, &drive));
    let of_closings: Vec<(usize, f64)> =
        found.kept.iter().copied().zip(found.pivots.iter().copied()).filter(|x| !drive(x.0)).collect();
    let kept = of_closings.iter().take(wanted).filter(|x| x.1 > limit).count();
    let strongest = of_closings[kept..].iter().fold(found.largest_dropped, |m: f64, x| m.max(x.1));
    let mut is_kept = vec![false; system.size().rows];
    of_closings[..kept].iter().for_each(|x| is_kept[x.0] = true);
    let mut start = Start { gap: f64::INFINITY, smallest: 1.0, ..Start::default() };
    start.smallest = of_closings[..kept].iter().fold(1.0, |m: f64, x| m.min(x.1));
    if strongest > 0.0 {
        start.gap = start.smallest / strongest;
    }
    if (0..is_kept.len()).any(drive) {
        let (pattern, c) = (system.pattern(), probe.at.c.clone());
        (0..is_kept.len()).filter(|&i| !is_kept[i] && !drive(i)).for_each(|i| probe.at.c[pattern.row(i)].fill(0.0));
        let with_drives = by_sizes(probe, tolerance::REDUNDANT, (0.0, &drive));
        with_drives.kept.iter().zip(&with_drives.pivots).filter(|x| drive(*x.0)).for_each(|(&i, &pivot)| {
            is_kept[i] = true;
            start.smallest = start.smallest.min(pivot);
        });
        probe.at.c = c;
    }
    start.rank = is_kept.iter().filter(|x| **x).count();
    start.dropped = (0..is_kept.len()).filter(|&i| !is_kept[i]).collect();
    Ok(start)
}

/// Message for rows that are dependent here and not nearby, where the rank is `there`.
fn singular<S: ConstrainedSystem>(
    system: &S,
    (t, q): (f64, &[f64]),
    start: &Start,
    there: usize,
) -> Result<SystemError, SystemError> {
    let names: Vec<String> =
        start.dropped.iter().take(6).map(|&i| system.structure().rows[i].name.to_string()).collect();
    let advice = branching::words(system, t, q)?
        .unwrap_or_else(|| "the motion from here is not unique; start a little away from it".into());
    let message = format!(
        "the rank of the constraints is {} here and {there} next to it (dependent here: {}); {advice}",
        start.rank,
        names.join(", "),
    );
    Ok(SystemError::SingularStart { t, message })
}

/// Whether the removed rows are redundant at neighbouring positions too.
fn persists<S: ConstrainedSystem>(
    system: &S,
    (t, q): (f64, &[f64]),
    start: &Start,
    largest_dropped: f64,
) -> Result<(), SystemError> {
    if start.gap < tolerance::RANK_GAP {
        let message = format!(
            "the rank of the constraints is not clear: the last row kept has the squared sine {:.2e}, the first one \
             dropped {largest_dropped:.2e} (of {}); start a little away from it, or give the joint positions with \
             all digits",
            start.smallest,
            owners(system, &start.dropped)
        );
        return Err(SystemError::SingularStart { t, message });
    }
    match start.rank < system.size().nv {
        true => check_neighbour(system, t, q, start),
        false => Ok(()),
    }
}

/// Rank of the constraints at one position, and the rows that are combinations of the others there. Nothing is refused:
/// a singular position has a rank of its own.
pub fn rank_here<S: ConstrainedSystem>(system: &S, t: f64, q: &[f64]) -> Result<Start, SystemError> {
    let mut probe = Reduction::new(system, 0);
    match system.structure().drawing.finite {
        Some(finite) => counted(&mut probe, t, q, finite),
        None => Ok(ranked(&mut probe, t, q)?.0),
    }
}

/// The rank at a position, and the largest squared sine of a dropped row.
fn ranked<S: ConstrainedSystem>(probe: &mut Reduction<S>, t: f64, q: &[f64]) -> Result<(Start, f64), SystemError> {
    probe.weigh_displacements(false);
    probe.position(t, q)?;
    probe.refresh_scales(t, q)?;
    let here = rank_at_last(probe);
    let smallest = here.pivots.iter().copied().fold(1.0, f64::min);
    let mut dropped = here.dropped.clone();
    dropped.sort_unstable();
    Ok((Start { rank: here.rank, dropped, gap: here.gap, smallest }, here.largest_dropped))
}

/// Take a small step along the motion that the kept rows allow; a redundant row stays closed.
fn check_neighbour<S: ConstrainedSystem>(system: &S, t: f64, q: &[f64], start: &Start) -> Result<(), SystemError> {
    let mut r = Reduction::new(system, start.rank);
    first_partition(&mut r, t, q)?;
    let k = r.k();
    // a fixed irregular direction
    let move_independent: Vec<f64> = (0..k)
        .map(|j| {
            let sign = if j % 2 == 0 { 1.0 } else { -1.0 };
            NEXT_DOOR
                * sign
                * (1.0 + 0.37 * (j as f64).sin())
                * system.structure().displacement(r.planned.partition.independent[j])
        })
        .collect();
    let mut near = q.to_vec();
    if !all_closed(&mut r, t, &mut near)? {
        return Ok(());
    }
    let (part, row) = r.dropped_gap();
    if part > tolerance::OPEN {
        return Err(r.contradiction(t, row, part, ""));
    }
    r.at.gamma.fill(0.0);
    r.spread(&move_independent);
    system.step(&mut near, &r.at.v.clone());
    if !all_closed(&mut r, t, &mut near)? {
        return Ok(());
    }
    r.refresh_scales(t, &near)?;
    let part = |i: usize| r.at.phi[i].abs() / system.structure().rows[i].size();
    let closure_error = start.dropped.iter().filter(|&&i| i < r.at.phi.len()).fold(0.0, |m: f64, &i| m.max(part(i)));
    let there = rank_at_last(&r);
    if there.rank > start.rank || closure_error > tolerance::CLOSED_IN_RUN {
        return Err(singular(system, (t, q), start, there.rank.max(start.rank + 1))?);
    }
    Ok(())
}

/// Close the kept rows near q. False where the probe itself runs into a singular position: it gives no verdict.
fn all_closed<S: ConstrainedSystem>(r: &mut Reduction<S>, t: f64, q: &mut [f64]) -> Result<bool, SystemError> {
    match kept_rows::close_kept(r, t, q) {
        // next to a singular position the residuals must be small, because contradictory rows are detected by far
        // larger ones
        Ok(_) => Ok(r.factor(t).is_ok()),
        Err(SystemError::Singular { .. }) => Ok(false),
        Err(e) => Err(e),
    }
}

/// Any admissible partition: the one a sparse elimination with pivoting arrives at.
pub(crate) fn first_partition<S: ConstrainedSystem>(
    r: &mut Reduction<S>,
    t: f64,
    q: &[f64],
) -> Result<(), SystemError> {
    r.first_partition(t, q)
}

/// These velocities, ascending: below n and each named once.
///
/// # Errors
/// `Argument`, with the invalid one.
pub(crate) fn distinct(named: &[usize], n: usize) -> Result<Vec<usize>, SystemError> {
    let mut sorted = named.to_vec();
    sorted.sort_unstable();
    if let Some(i) = sorted.last().filter(|&&i| i >= n) {
        let message = format!("independent: there is no velocity {i}; there are {n}, numbered from 0");
        return Err(SystemError::argument("independent", message));
    }
    if let Some(x) = sorted.windows(2).find(|x| x[0] == x[1]) {
        return Err(SystemError::argument(
            "independent",
            format!("independent: velocity {} is named twice; name each once", x[0]),
        ));
    }
    Ok(sorted)
}

/// Choose independent coordinates at `(t, q)`: P5 on any admissible partition, then P6 until no switch gains.
///
/// `weights` multiply ρ (preferences); `fixed` is the user's own choice, accepted as given or refused with a reason.
/// Ends with the reduction at `(t, q)` with the tangent of the new partition.
pub fn choose_partition<S: ConstrainedSystem>(
    r: &mut Reduction<S>,
    t: f64,
    q: &[f64],
    weights: Option<&[f64]>,
    fixed: Option<&[usize]>,
) -> Result<(), SystemError> {
    if let Some(fixed) = fixed {
        if fixed.len() != r.k() {
            return Err(SystemError::argument(
                "independent",
                format!(
                    "{} independent coordinates were requested, but the number of degrees of freedom is {}; name as \
                 many, or none",
                    fixed.len(),
                    r.k()
                ),
            ));
        }
        let sorted = distinct(fixed, r.size().nv)?;
        r.position(t, q)?;
        r.refresh_scales(t, q)?;
        if let Err(e) = r.set_partition(t, &sorted) {
            if !matches!(e, SystemError::Singular { .. }) {
                return Err(e);
            }
            // no choice exists: then the mechanism is singular
            choose_with_threshold(r, t, q, None, 1.0)?;
            let names = |x: &[usize]| r.system.structure().names(x);
            return Err(SystemError::argument(
                "independent",
                format!(
                "the coordinates {} cannot be independent here: they do not determine the others (C_D is singular), \
                 although the mechanism is not singular; {} would serve",
                names(&sorted),
                names(&r.planned.partition.independent)
            ),
            ));
        }
        return r.tangent(t);
    }
    choose_with_threshold(r, t, q, weights, 1.0)
}

/// As [`choose_partition`], but switches with a gain below `threshold` are not made.
pub fn choose_with_threshold<S: ConstrainedSystem>(
    r: &mut Reduction<S>,
    t: f64,
    q: &[f64],
    weights: Option<&[f64]>,
    threshold: f64,
) -> Result<(), SystemError> {
    first_partition(r, t, q)?;
    if r.k() == 0 || r.rank() == 0 {
        return Ok(());
    }
    let evaluate = |r: &mut Reduction<S>| {
        r.at.v.fill(0.0);
        r.velocity(t, q)?;
        r.acceleration(t, q)
    };
    // where the first partition loses M_d in rounding, as in nets of bodies with coordinates of their own, better ones do not
    match evaluate(r) {
        Err(SystemError::Mass { .. }) => {
            switch_to_best(r, t, None, 1.0)?;
            evaluate(r)?;
        }
        found => found?,
    }
    let chosen = match r.by_clusters() {
        true => r.choose_by_clusters(weights)?,
        false => criterion::choose(&r.at.dt, r.k(), &r.at.md_factor, &r.scale.s2, weights),
    };
    // P5 is a factorisation of a good basis: its choice is admissible up to rounding
    if r.set_partition(t, &chosen).is_err() {
        let first = r.planned.partition.independent.clone();
        r.set_partition(t, &first)?;
    }
    r.tangent(t)?;
    switch_to_best(r, t, weights, threshold)
}

/// Switches with a gain above `threshold` (P6), until there are none; the tangent of the last partition is evaluated.
fn switch_to_best<S: ConstrainedSystem>(
    r: &mut Reduction<S>,
    t: f64,
    weights: Option<&[f64]>,
    threshold: f64,
) -> Result<(), SystemError> {
    let scales: Vec<f64> = match weights {
        Some(w) => r.scales().iter().zip(w).map(|(s, w)| s / w).collect(),
        None => r.scales().to_vec(),
    };
    // every switch multiplies the volume by more than that, so the loop ends; the bound is for round-off
    for _ in 0..10 * r.size().nv {
        let pairs = r.best_switches(&scales, threshold.max(1.0 + tolerance::TIE));
        if pairs.is_empty() {
            break;
        }
        let mut next = r.planned.partition.independent.clone();
        pairs.iter().for_each(|x| next[x.leaves] = r.planned.partition.dependent[x.enters]);
        next.sort_unstable();
        r.set_partition(t, &next)?;
        r.tangent(t)?;
    }
    Ok(())
}
