//! Dead points: where independent coordinates that stay do not determine the others, though other coordinates would.

use crate::reduction::{Reduction, Sides};
use crate::start;
use crate::system::{ConstrainedSystem, SystemError};

/// Where the best choice leaves a smaller pivot, the mechanism is next to a singular position. Scale: scaled pivots.
/// Reason: sound ones have pivots of the order of 1, and coordinates are given up within 1e-4 of their dead point; a
/// margin of ten.
const SOUND: f64 = 1e-3;

/// Advice on `independent` coordinates that fail next to `(t, q)` for the reason `seen`: whether others would serve,
/// and which.
///
/// Chooses a partition there: for failures only.
pub(crate) fn dead_point<S: ConstrainedSystem>(
    system: &S,
    rank: usize,
    t: f64,
    q: &[f64],
    independent: &[usize],
    seen: String,
) -> SystemError {
    refusal(system, best_choice(system, rank, t, q), t, independent, seen)
}

/// The best choice at `(t, q)` and its smallest scaled pivot, 0 where there is none.
fn best_choice<S: ConstrainedSystem>(system: &S, rank: usize, t: f64, q: &[f64]) -> (Vec<usize>, f64) {
    let mut best = Reduction::new(system, rank);
    match start::choose_partition(&mut best, t, q, None, None) {
        Ok(()) => (best.planned.partition.independent.clone(), best.smallest()),
        Err(_) => (Vec::new(), 0.0),
    }
}

/// What lost rank where the determinant of C_D changed sign.
pub(crate) enum Loss {
    /// The mechanism is in a singular position.
    Mechanism,
    /// The independent coordinates are at a dead point of theirs.
    Coordinates,
    /// The redundant rows kept depend on each other; these do not.
    Rows(Vec<usize>),
}

/// What lost rank between two positions on whose way the C_D of a choice changed sides? Where C itself does, all rows
/// taken together, the determinants of all choices change their signs; other coordinates or rows, best half-way, have
/// C_D on one side at both ends.
///
/// Chooses a partition there: for steps alone in which C_D changed sides.
pub(crate) fn loss<S: ConstrainedSystem>(
    choice: &Reduction<S>,
    ends: [(f64, &[f64]); 2],
    (t, q): (f64, &[f64]),
) -> Loss {
    let in_use = &choice.planned.partition;
    let mut r = Reduction::new(choice.system.clone(), choice.rank()).keeping(&in_use.rows);
    if start::choose_partition(&mut r, t, q, None, None).is_err() || r.smallest() < SOUND || !one_side(&mut r, ends) {
        return Loss::Mechanism;
    }
    let rows = r.planned.partition.rows.clone();
    if rows.iter().all(|row| in_use.rows.contains(row)) {
        return Loss::Coordinates;
    }
    match r.position(t, q).and_then(|()| r.set_partition(t, &in_use.independent)) {
        Ok(()) if one_side(&mut r, ends) => Loss::Rows(rows),
        _ => Loss::Coordinates,
    }
}

/// Whether the C_D of the choice of r is on one side at both ends.
fn one_side<S: ConstrainedSystem>(r: &mut Reduction<S>, ends: [(f64, &[f64]); 2]) -> bool {
    let rows = r.size().rows;
    let [mut one, mut two] = [Sides::new(rows), Sides::new(rows)];
    let choice = r.choices();
    for (sides, (t, q)) in [&mut one, &mut two].into_iter().zip(ends) {
        if r.position(t, q).and_then(|()| r.factor(t)).is_err() {
            return false;
        }
        r.sides(sides);
    }
    // a new plan is not comparable with any other
    r.choices() == choice && !one.differ(&two)
}

fn refusal<S: ConstrainedSystem>(
    system: &S,
    (others, pivot): (Vec<usize>, f64),
    t: f64,
    independent: &[usize],
    seen: String,
) -> SystemError {
    let names = |x: &[usize]| system.structure().names(x);
    let advice = match pivot >= SOUND && others != independent {
        true => format!(
            "the mechanism itself is not singular, and {} would serve: give those, or none, and use a formulation \
             that switches coordinates (\"projective\")",
            names(&others)
        ),
        false => format!(
            "other coordinates are hardly better, the mechanism itself is next to a singular position (the best \
             choice leaves a scaled pivot of {pivot:.1e}); use the formulation \"projective\", which steps over such \
             positions, or start elsewhere"
        ),
    };
    SystemError::DeadPoint { coordinates: names(independent), t, seen, advice }
}

/// What a failed evaluation at (t, q) shows of a choice that hardly determines the others: C_D singular, or so nearly
/// that M_d, whose entries grow with the square of those of C_D⁻¹, is lost in round-off; none for other errors.
pub(crate) fn lost<S: ConstrainedSystem>(r: &Reduction<S>, t: f64, q: &[f64], e: &SystemError) -> Option<String> {
    match e {
        SystemError::Singular { pivot, limit, .. } => {
            Some(format!("C_D is singular for them (smallest scaled pivot {pivot:.1e}, limit {limit:.0e})"))
        }
        SystemError::Mass { .. } if r.rank() > 0 => {
            let mut here = Reduction::new(r.system.clone(), r.rank());
            let at = here.position(t, q).and_then(|()| here.refresh_scales(t, q));
            let pivot = match at.and_then(|()| here.set_partition(t, &r.planned.partition.independent)) {
                Ok(()) => here.smallest(),
                Err(SystemError::Singular { pivot, .. }) => pivot,
                Err(_) => return None,
            };
            Some(format!(
                "C_D is nearly singular for them (smallest scaled pivot {pivot:.1e}), so that M_d is lost in round-off"
            ))
        }
        _ => None,
    }
}

/// Whether the reduced mass matrix of a choice at (t, q), the point last evaluated, is positive definite.
pub(crate) fn has_mass<S: ConstrainedSystem>(r: &mut Reduction<S>, t: f64, q: &[f64]) -> bool {
    r.at.v.fill(0.0);
    r.velocity(t, q).and_then(|()| r.acceleration(t, q)).is_ok()
}

/// Tell coordinates that no longer determine the others from a singular position of the mechanism; other errors pass.
pub(crate) fn blame<S: ConstrainedSystem>(r: &Reduction<S>, t: f64, q: &[f64], e: SystemError) -> SystemError {
    let Some(seen) = lost(r, t, q, &e) else { return e };
    let best = best_choice(&*r.system, r.rank(), t, q);
    let served = |best: &[usize]| {
        let mut probe = Reduction::new(r.system.clone(), r.rank());
        start::choose_partition(&mut probe, t, q, None, Some(best)).is_ok() && has_mass(&mut probe, t, q)
    };
    if best.1 < SOUND || !served(&best.0) {
        return e;
    }
    refusal(&*r.system, best, t, &r.planned.partition.independent, seen)
}
