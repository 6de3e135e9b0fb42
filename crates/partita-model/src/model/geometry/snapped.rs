//! Planar drawings with sides: left and right, front and back.                                                (T5)
//!
//! What is drawn twice coincides in the plane: pins of both sides in one point, their guides on one line. Where they do
//! so within the drawing tolerance they are put together, both frames of a joint at once, so that the sides are equal in
//! all their lengths. This takes a mean for each group and no motion, whatever the size of the drawing; that the result
//! moves is decided by its pivots and a short motion.

use super::change::{largest, OWN};
use super::{at, closed, coarsest, BlockDecision, Decided, Drawing, LARGEST_CHANGE};
use crate::joint::alignment;
use crate::spec::{Joint, JointKind};
use partita_math::sorting::sort_by;
use partita_math::spatial::Vec3;
use partita_math::tolerance;
use partita_system::rank::Exact;

/// A guide in the drawn position, on either of its bodies.
struct Guide {
    joint: usize,
    points: [Vec3<f64>; 2],
    directions: [Vec3<f64>; 2],
}

impl Drawing {
    /// The decision about this planar drawing with its sides made equal; none where they are not nearly so, or pivots do
    /// not decide what results.
    pub(super) fn with_equal_sides(&self, own: usize, tolerance: f64) -> Option<Decided> {
        let (equal, numbers) = self.with_sides(tolerance)?;
        let level = coarsest(tolerance);
        // what is put together is equal by construction: of other lengths nothing is asked
        let (verdict, dof) = match at(&equal.model, closed(&equal.model, level).as_deref(), level) {
            Exact::Regular(dof, _) => (BlockDecision::Regular, dof),
            Exact::Redundant(dof, _) => (BlockDecision::Redundant, dof),
            Exact::Open => return None,
        };
        let dof = dof.checked_sub(own).filter(|k| *k > 0)?;
        let decided = Decided::plain(verdict, Some(dof));
        Some(decided.after(numbers, self.length, &self.model.spec, &equal.model.spec.joints))
    }

    /// With pins in common points and guides on common lines; and the change.
    fn with_sides(&self, tolerance: f64) -> Option<(Self, Vec<f64>)> {
        let spec = &self.model.spec;
        if !self.model.is_planar() || !spec.couplings.is_empty() {
            return None;
        }
        let normal = self.normal()?;
        let (e1, e2) = normal.complement();
        let in_plane = |x: Vec3<f64>| [e1.dot(x), e2.dot(x)];
        let near = LARGEST_CHANGE * tolerance;
        let mut numbers = vec![0.0; OWN * spec.joints.len()];
        let ends = |j: &Joint| [Vec3(j.point), Vec3(j.child_point.unwrap_or(j.point))];
        let mut pins: Vec<(usize, [[f64; 2]; 2])> = Vec::new();
        let mut guides: Vec<Guide> = Vec::new();
        for (i, joint) in spec.joints.iter().enumerate() {
            let points = ends(joint);
            match joint.kind {
                JointKind::Revolute | JointKind::Cylindrical | JointKind::Spherical => {
                    pins.push((i, points.map(in_plane)));
                }
                JointKind::Prismatic => {
                    let axis = Vec3(joint.axis?).unit()?;
                    let directions = [axis, alignment(joint).ok()?.apply_transposed(axis)];
                    guides.push(Guide { joint: i, points, directions });
                }
                _ => {}
            }
        }
        let mut shift = |offset: usize, by: Vec3<f64>| {
            numbers[offset..offset + 3].copy_from_slice(&by.times(1.0 / self.length).0);
        };
        let groups = grouped(&pins.iter().map(|x| middle(x.1)).collect::<Vec<_>>(), near * self.length);
        for group in groups {
            let joints: Vec<usize> = group.iter().map(|&i| pins[i].0).collect();
            if self.holds_a_whole_body(&joints) {
                return None;
            }
            let (first, count) = (middle(pins[group[0]].1), group.len() as f64);
            // from the first of them: where all coincide the mean is that point to the last digit
            let mean =
                [0, 1].map(|k| first[k] + group.iter().map(|&i| middle(pins[i].1)[k] - first[k]).sum::<f64>() / count);
            for &i in &group {
                let (joint, points) = pins[i];
                for (side, at) in points.iter().enumerate() {
                    shift(joint * OWN + side * OWN / 2, e1.times(mean[0] - at[0]) + e2.times(mean[1] - at[1]));
                }
            }
        }
        self.align_guides(&guides, normal, (near, &mut numbers[..]));
        let is_within = largest(&numbers) > tolerance::SUM_ROUNDING && largest(&numbers) <= near;
        let equal = is_within.then(|| self.changed(&numbers)).flatten()?;
        Some((equal, numbers))
    }

    /// Guides that are nearly on one line of the plane, on both of their bodies, laid on it.
    fn align_guides(&self, guides: &[Guide], normal: Vec3<f64>, (near, numbers): (f64, &mut [f64])) {
        let mut left: Vec<usize> = (0..guides.len()).collect();
        while let Some(&first) = left.first() {
            let reference = guides[first].directions[0];
            let parallel = |g: &Guide| g.directions.iter().all(|x| x.cross(reference).norm() <= near);
            let (group, others): (Vec<usize>, Vec<usize>) = left.into_iter().partition(|&i| parallel(&guides[i]));
            left = others;
            if group.is_empty() {
                // its own two bodies disagree by more
                left.retain(|x| *x != first);
                continue;
            }
            let angle = |x: Vec3<f64>| {
                let ahead = x.times(x.dot(reference).signum());
                normal.dot(reference.cross(ahead)).atan2(reference.dot(ahead))
            };
            let count = 2.0 * group.len() as f64;
            let mean = group.iter().flat_map(|&i| guides[i].directions).map(angle).sum::<f64>() / count;
            for &i in &group {
                for (side, direction) in guides[i].directions.iter().enumerate() {
                    let turn = normal.times(mean - angle(*direction));
                    let offset = guides[i].joint * OWN + side * OWN / 2 + 3;
                    numbers[offset..offset + 3].copy_from_slice(&turn.0);
                }
            }
            let along = reference.times(mean.cos()) + normal.cross(reference).times(mean.sin());
            let across = normal.cross(along);
            let height = |i: usize| {
                let [a, b] = guides[i].points.map(|x| across.dot(x));
                0.5 * (a + b)
            };
            let lines = grouped(&group.iter().map(|&i| [height(i), 0.0]).collect::<Vec<_>>(), near * self.length);
            for line in lines {
                let first = height(group[line[0]]);
                let mean = first + line.iter().map(|&k| height(group[k]) - first).sum::<f64>() / line.len() as f64;
                for &k in &line {
                    let guide = &guides[group[k]];
                    for (side, at) in guide.points.iter().enumerate() {
                        let by = across.times((mean - across.dot(*at)) / self.length);
                        let offset = guide.joint * OWN + side * OWN / 2;
                        numbers[offset..offset + 3].copy_from_slice(&by.0);
                    }
                }
            }
        }
    }

    /// Whether some body has all its joints among these, apart from each other, to more than one other body: an
    /// eccentric, which has a length of its own.
    fn holds_a_whole_body(&self, joints: &[usize]) -> bool {
        let placed = &self.model.own.placed.joints;
        let ends = |j: usize| [placed[j].parent, placed[j].child];
        let at = |j: usize| Vec3(self.model.spec.joints[j].point);
        let normal = self.normal().unwrap_or(Vec3([0.0, 0.0, 1.0]));
        let apart = |i: usize, j: usize| normal.cross(at(i) - at(j)).norm() > tolerance::EQUAL * self.length;
        joints.len() > 1
            && joints.iter().flat_map(|&j| ends(j)).filter(|body| *body > 0).any(|body| {
                let own: Vec<usize> = (0..placed.len()).filter(|&j| ends(j).contains(&body)).collect();
                let Some(&first) = own.first() else { return false };
                own.iter().all(|j| joints.contains(j))
                    && own.iter().any(|&j| apart(first, j) && (ends(first) != ends(j)))
            })
    }
}

/// The middle between two points of a plane.
fn middle([a, b]: [[f64; 2]; 2]) -> [f64; 2] {
    [0, 1].map(|k| a[k] + 0.5 * (b[k] - a[k]))
}

/// Points of a plane in groups, each within `near` of the first of its group.
fn grouped(points: &[[f64; 2]], near: f64) -> Vec<Vec<usize>> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    sort_by(&mut order, |&i, &j| points[i][0].total_cmp(&points[j][0]).then(i.cmp(&j)));
    let mut taken = vec![false; points.len()];
    let mut groups = Vec::new();
    for (k, &first) in order.iter().enumerate() {
        if taken[first] {
            continue;
        }
        let ahead = order[k..].iter().copied().take_while(|&i| points[i][0] - points[first][0] <= near);
        let own = ahead.filter(|&i| !taken[i] && (points[i][1] - points[first][1]).abs() <= near);
        let mut group: Vec<usize> = own.collect();
        group.sort_unstable();
        group.iter().for_each(|&i| taken[i] = true);
        groups.push(group);
    }
    groups
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_within_the_limit_of_the_first_are_one_group() {
        let points = [[0.0, 0.0], [1.0, 0.0], [1e-5, -1e-5], [1.0, 3e-4], [0.99999, 1e-5], [2.0, 0.0]];
        assert_eq!(grouped(&points, 1e-4), vec![vec![0, 2], vec![1, 4], vec![3], vec![5]]);
    }
}
