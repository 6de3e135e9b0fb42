//! Whole turns of angles, stored separately from the angles: after a thousand turns a mechanism is computed as exactly
//! as at the start.
//!
//! An angle of 6000 rad has a round-off of 5e-13, which is a closure error of every loop through it.

use crate::system::ConstrainedSystem;
use std::f64::consts::TAU;

/// Angles beyond this are brought back to within half a turn. Scale: rad. Reason: seldom, and before their round-off
/// (2e-15) counts.
const WOUND: f64 = 25.0;
/// The remainder of 2π beyond `TAU`. Unit: rad. Reason: turns are removed to the last digit.
const TAU_REST: f64 = 2.449_293_598_294_706_4e-16;

/// Remove whole turns from the angles of q that have grown beyond a few turns, count them; true if q changed.
pub fn reduce<S: ConstrainedSystem>(system: &S, q: &mut [f64], turns: &mut [i32]) -> bool {
    let mut changed = false;
    for i in 0..q.len() {
        changed |= reduce_one(system, i, &mut q[i], &mut turns[i]);
    }
    changed
}

/// As `reduce`, for coordinate i alone.
pub fn reduce_one<S: ConstrainedSystem>(system: &S, i: usize, angle: &mut f64, turns: &mut i32) -> bool {
    if angle.abs() <= WOUND || !angle.is_finite() || !system.structure().coordinates[i].turns {
        return false;
    }
    let n = (*angle / TAU).round();
    // a run that makes 2e9 turns is cut off long before by its number of steps
    *turns = turns.saturating_add(n as i32);
    *angle = (*angle - n * TAU) - n * TAU_REST;
    true
}

/// Angle and turns together, as shown to the user.
pub fn whole(angle: f64, turns: i32) -> f64 {
    angle + f64::from(turns) * TAU
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_parts_of_the_full_turn() {
        // sin(2π) as doubles see it is what the first part misses
        assert!((TAU.sin() + TAU_REST).abs() < 1e-30);
    }
}
