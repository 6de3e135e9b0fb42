//! Points of a drawing that coincide up to rounding.
//!
//! A small body between two joints in one point, as in a gimbal or a ball of three hinges, has no arm between them.
//! Where its points were computed in different ways they differ in their last digits, and a force through them rotates
//! the body by that arm: for an inertia of 1e-11 kg m² an arm of 1e-17 m gives 1e-8 rad/s². Distances below the
//! rounding of the coordinates carry no information, so such points are merged.

use crate::spec::Spec;
use partita_math::tolerance;

/// A point of a joint: its joint, and whether it is the one on the child.
type JointPoint = (usize, bool);

/// Merge joint points that coincide up to rounding: all take the coordinates of the first.
///
/// Cost: n log n.
pub(crate) fn unite(spec: &mut Spec) {
    let drawn = |j: usize| {
        let joint = &spec.joints[j];
        std::iter::once(((j, false), joint.point)).chain(joint.child_point.map(|x| ((j, true), x)))
    };
    for ((j, on_child), to) in moved((0..spec.joints.len()).flat_map(drawn).collect()) {
        let joint = &mut spec.joints[j];
        match on_child {
            true => joint.child_point = Some(to),
            false => joint.point = to,
        }
    }
}

/// Points that differ by at most this in each coordinate coincide.
pub(crate) fn near(points: impl Iterator<Item = [f64; 3]>) -> f64 {
    tolerance::TEN_ROUNDINGS * points.flatten().fold(0.0, |m: f64, x| m.max(x.abs()))
}

/// The points that move, and their new positions.
fn moved(mut points: Vec<(JointPoint, [f64; 3])>) -> Vec<(JointPoint, [f64; 3])> {
    let near = near(points.iter().map(|x| x.1));
    let mut moved = Vec::new();
    join(&mut points, near, 0, &mut moved);
    moved
}

/// Split along one axis after the other at each gap; what remains together is one point.
fn join(points: &mut [(JointPoint, [f64; 3])], near: f64, axis: usize, moved: &mut Vec<(JointPoint, [f64; 3])>) {
    if points.len() < 2 {
        return;
    }
    if axis == 3 {
        let first = points.iter().min_by_key(|x| x.0).map_or([0.0; 3], |x| x.1);
        moved.extend(points.iter().filter(|x| x.1 != first).map(|x| (x.0, first)));
        return;
    }
    points.sort_unstable_by(|x, y| x.1[axis].total_cmp(&y.1[axis]));
    for group in points.chunk_by_mut(|x, y| y.1[axis] - x.1[axis] <= near) {
        join(group, near, axis + 1, moved);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_that_differ_by_rounding_are_the_one_drawn_first_and_others_stay() {
        let (one, off) = (0.1 + 0.2, 0.3);
        assert!(one != off);
        let far = [off, 1.0, 1e-14];
        let points = [((1, true), [one, 1.0, 1e-17]), ((2, false), far), ((0, false), [one, 1.0, 0.0])];
        let mut found = moved([&points[..], &[((1, false), [off, 1.0, 0.0])]].concat());
        found.sort_by_key(|x| x.0);
        assert_eq!(found, [((1, false), [one, 1.0, 0.0]), ((1, true), [one, 1.0, 0.0])]);
    }

    #[test]
    fn a_long_row_of_points_stays_as_it_is() {
        assert!(moved((0..1000).map(|i| ((i, false), [0.0, 0.0, i as f64 * 1e-3])).collect()).is_empty());
    }
}
