//! Joints side by side between the same two bodies: hinges of a door, bearings of a shaft, balls in one centre.   (T5)
//!
//! Two hinges are drawn to leave one rotation, which they do on one axis only. So joints between two bodies, or bodies
//! fixed to each other, are laid on one line or in one centre where that is within the drawing tolerance and frees a
//! motion: by a linear fit on each body, without paths or singular values. As drawn they lock their bodies, whatever the
//! rest of the mechanism does.

use super::change::{largest, OWN};
use super::{Drawing, LARGEST_CHANGE};
use crate::coincident;
use crate::joint::alignment;
use crate::model::Model;
use crate::spec::{Joint, JointKind, Spec};
use crate::validate::GROUND;
use partita_math::spatial::Vec3;
use partita_math::tolerance;
use std::collections::BTreeMap;

/// What a joint says of a common axis on one of its bodies.
struct Feature {
    /// Index of its displacement in a change of the drawing.
    offset: usize,
    /// A point of the axis.
    at: Option<Vec3<f64>>,
    /// Its direction.
    along: Option<Vec3<f64>>,
}

/// A joint beside others: what it says on the first body and on the second, and whether it holds them along the axis.
struct Side {
    on: [Feature; 2],
    locks_height: bool,
}

/// An axis: a point and a unit vector.
type Line = (Vec3<f64>, Vec3<f64>);

/// Joints beside each other in a model, changes in fractions of a length.
struct Beside<'m> {
    model: &'m Model,
    length: f64,
    fixed: Vec<usize>,
}

/// Whether some joints beside each other are off by more than rounding and less than the tolerance. Cost: proportional to
/// the joints.
pub(super) fn are_off(model: &Model, tolerance: f64) -> bool {
    let beside = Beside::new(model, model.own.placed.size);
    beside.groups().iter().any(|joints| beside.laid(joints).iter().any(|own| beside.is_within(own, tolerance)))
}

impl Drawing {
    /// The drawing with joints beside each other on common axes or in common centres, and the change; none where that
    /// frees nothing or exceeds the tolerance.
    pub(super) fn bearings(&self, tolerance: f64) -> Option<(Self, Vec<f64>)> {
        let mut numbers = vec![0.0; OWN * self.model.spec.joints.len()];
        let beside = Beside::new(&self.model, self.length);
        let mut is_laid = false;
        for joints in beside.groups() {
            let laid = beside.laid(&joints).into_iter().filter(|own| beside.is_within(own, tolerance));
            if let Some(own) = laid.into_iter().find(|own| self.frees(own, &joints, &beside.fixed, tolerance)) {
                numbers.iter_mut().zip(&own).for_each(|(x, more)| *x += more);
                is_laid = true;
            }
        }
        let laid = is_laid.then(|| self.changed_to(&numbers)).flatten()?;
        Some((laid, numbers))
    }

    /// Whether the two bodies of these joints, by themselves, have more degrees of freedom after this change.
    fn frees(&self, numbers: &[f64], joints: &[usize], fixed: &[usize], tolerance: f64) -> bool {
        let Some(changed) = self.changed_to(numbers) else { return false };
        let Some(placed) = joints.first().map(|&j| &self.model.own.placed.joints[j]) else { return false };
        let ends = [fixed[placed.parent], fixed[placed.child]];
        let (base, other) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
        let dof = |of: &Self| {
            let spec = &of.model.spec;
            let name = |node: usize| match fixed[node] == base {
                true => GROUND.to_owned(),
                false => spec.bodies[other - 1].name.clone(),
            };
            let mut own: Vec<Joint> = joints.iter().map(|&j| spec.joints[j].clone()).collect();
            for (joint, &j) in own.iter_mut().zip(joints) {
                let placed = &of.model.own.placed.joints[j];
                (joint.parent, joint.child) = (name(placed.parent), name(placed.child));
            }
            let own = Spec {
                bodies: vec![spec.bodies[other - 1].clone()],
                joints: own,
                couplings: Vec::new(),
                ..(**spec).clone()
            };
            let pair = Self::new(own, of.model.functions(), None, of.model.is_planar())?;
            pair.settled(0, tolerance)?.dof
        };
        dof(&changed).is_some_and(|after| after > dof(self).unwrap_or(0))
    }
}

impl<'m> Beside<'m> {
    fn new(model: &'m Model, length: f64) -> Self {
        let mut beside = Self { model, length, fixed: Vec::new() };
        beside.fixed = beside.fixed_to_each_other();
        beside
    }

    /// Changes that lay these joints together: in one centre, or on one axis.
    fn laid(&self, joints: &[usize]) -> Vec<Vec<f64>> {
        let sides = self.sides(joints);
        [self.put_in_one_centre(&sides), self.laid_on_one_axis(&sides)].into_iter().flatten().collect()
    }

    /// Whether a change is due to errors within the tolerance.
    fn is_within(&self, numbers: &[f64], tolerance: f64) -> bool {
        let most = largest(numbers);
        let rounding = coincident::near(self.model.spec.joints.iter().map(|j| j.point)) / self.length;
        most > rounding.max(tolerance::SUM_ROUNDING) && most <= LARGEST_CHANGE * tolerance
    }
    /// For each body (0 the ground) the first of those that are fixed to it where they are drawn.
    fn fixed_to_each_other(&self) -> Vec<usize> {
        let mut first: Vec<usize> = (0..=self.model.spec.bodies.len()).collect();
        for (joint, placed) in self.model.spec.joints.iter().zip(&self.model.own.placed.joints) {
            let in_place = joint.child_point.is_none() && joint.child_axis.is_none() && joint.child_frame.is_none();
            if joint.kind == JointKind::Fixed && in_place {
                let (a, b) = (first[placed.parent], first[placed.child]);
                first.iter_mut().filter(|x| **x == a.max(b)).for_each(|x| *x = a.min(b));
            }
        }
        first
    }

    /// Joints with the same two bodies, where there is more than one.
    fn groups(&self) -> Vec<Vec<usize>> {
        let mut found: BTreeMap<[usize; 2], Vec<usize>> = BTreeMap::new();
        for (j, placed) in self.model.own.placed.joints.iter().enumerate() {
            let (a, b) = (self.fixed[placed.parent], self.fixed[placed.child]);
            if a != b {
                found.entry([a.min(b), a.max(b)]).or_default().push(j);
            }
        }
        found.into_values().filter(|joints| joints.len() > 1).collect()
    }

    /// What these joints say of an axis, each on the body that is drawn first and on the other one.
    fn sides(&self, joints: &[usize]) -> Vec<Side> {
        let side = |&j: &usize| {
            let (joint, placed) = (&self.model.spec.joints[j], &self.model.own.placed.joints[j]);
            let mut on = features(joint, j * OWN)?;
            if self.fixed[placed.parent] > self.fixed[placed.child] {
                on.reverse();
            }
            let locks_height = !matches!(
                joint.kind,
                JointKind::Cylindrical | JointKind::Screw | JointKind::PointOnLine | JointKind::Parallel
            );
            Some(Side { on, locks_height })
        };
        joints.iter().filter_map(side).collect()
    }

    /// The least change that lays these joints on one axis.
    fn laid_on_one_axis(&self, sides: &[Side]) -> Option<Vec<f64>> {
        let mut numbers = vec![0.0; OWN * self.model.spec.joints.len()];
        let mut heights: [Vec<f64>; 2] = [Vec::new(), Vec::new()];
        let first = first_directions(sides)?;
        let mut lines = first.map(|along| (Vec3::zero(), along));
        for (k, line) in lines.iter_mut().enumerate() {
            let features: Vec<&Feature> = sides.iter().map(|x| &x.on[k]).collect();
            *line = fitted(&features, line.1, self.length)?;
            for (feature, side) in features.iter().zip(sides) {
                let mut at = feature.at;
                if let Some(here) = at.as_mut() {
                    let foot = line.0 + line.1.times(line.1.dot(*here - line.0));
                    let shift = (foot - *here).times(1.0 / self.length);
                    numbers[feature.offset..feature.offset + 3].copy_from_slice(&shift.0);
                    *here = foot;
                }
                if let Some(along) = feature.along {
                    let turn = turn_to(along, line.1);
                    numbers[feature.offset + 3..feature.offset + 6].copy_from_slice(&turn.0);
                }
                if let (Some(at), true) = (at, side.locks_height) {
                    heights[k].push(line.1.dot(at - line.0));
                }
            }
        }
        // what holds both bodies along the axis is equally far apart on either
        let off: Vec<f64> = heights[0].iter().zip(&heights[1]).map(|(a, b)| a - b).collect();
        let mean = off.iter().sum::<f64>() / off.len().max(1) as f64;
        for (side, off) in sides.iter().filter(|x| x.locks_height && x.on[0].at.is_some()).zip(&off) {
            for (k, sign) in [(0, -0.5), (1, 0.5)] {
                let by = lines[k].1.times(sign * (off - mean) / self.length);
                let own = &mut numbers[side.on[k].offset..][..3];
                own.iter_mut().zip(&by.0).for_each(|(x, more)| *x += more);
            }
        }
        Some(numbers)
    }

    /// The least change that puts these points into one.
    fn put_in_one_centre(&self, sides: &[Side]) -> Option<Vec<f64>> {
        if sides.len() < 2 || sides.iter().any(|x| x.on.iter().any(|x| x.along.is_some() || x.at.is_none())) {
            return None;
        }
        let mut numbers = vec![0.0; OWN * self.model.spec.joints.len()];
        for k in [0, 1] {
            let points: Vec<(usize, Vec3<f64>)> =
                sides.iter().filter_map(|x| Some((x.on[k].offset, x.on[k].at?))).collect();
            let middle = mean(points.iter().map(|x| x.1));
            for (offset, at) in points {
                numbers[offset..offset + 3].copy_from_slice(&(middle - at).times(1.0 / self.length).0);
            }
        }
        Some(numbers)
    }
}

/// What a joint says of an axis about which its bodies rotate, on its parent and on its child.
fn features(joint: &Joint, offset: usize) -> Option<[Feature; 2]> {
    let align = alignment(joint).ok()?;
    let axis = joint.axis.and_then(|x| Vec3(x).unit());
    let points = [Vec3(joint.point), Vec3(joint.child_point.unwrap_or(joint.point))];
    // whether it has a point and a direction, on the parent and on the child
    let (at, along) = match joint.kind {
        JointKind::Revolute | JointKind::Cylindrical | JointKind::Screw => ([true; 2], [true; 2]),
        JointKind::Spherical => ([true; 2], [false; 2]),
        JointKind::PointOnLine => ([true; 2], [true, false]),
        JointKind::Planar | JointKind::Parallel => ([false; 2], [true; 2]),
        _ => return None,
    };
    let axes = [axis, axis.map(|x| align.apply_transposed(x))];
    if along[0] && axis.is_none() {
        return None;
    }
    Some([0, 1].map(|k| Feature {
        offset: offset + k * OWN / 2,
        at: at[k].then_some(points[k]),
        along: axes[k].filter(|_| along[k]),
    }))
}

/// A first direction of the common axis on either body, in the same sense: that of a joint, or from one point to the
/// farthest.
fn first_directions(sides: &[Side]) -> Option<[Vec3<f64>; 2]> {
    if let Some(found) = sides.iter().find_map(|x| Some([x.on[0].along?, x.on[1].along?])) {
        return Some(found);
    }
    let first = sides.first()?;
    let from = |k: usize, x: &Side| Some(x.on[k].at? - first.on[k].at?);
    let far = |x: &Side| from(0, x).map_or(0.0, |x| x.norm());
    let farthest = sides.iter().max_by(|a, b| far(a).total_cmp(&far(b)))?;
    Some([from(0, farthest)?.unit()?, from(1, farthest)?.unit()?])
}

/// The line nearest to these points (in lengths) and directions (in radians) of one body.
fn fitted(features: &[&Feature], first: Vec3<f64>, length: f64) -> Option<Line> {
    let ahead = |x: Vec3<f64>| x.times(if x.dot(first) < 0.0 { -1.0 } else { 1.0 });
    let points: Vec<Vec3<f64>> = features.iter().filter_map(|x| x.at).collect();
    let directions: Vec<Vec3<f64>> = features.iter().filter_map(|x| x.along).map(ahead).collect();
    if points.is_empty() {
        let along = mean(directions.into_iter()).unit()?;
        return Some((Vec3::zero(), along));
    }
    let middle = mean(points.iter().copied());
    // directions that agree stay: of a planar drawing its plane
    let agree = !directions.is_empty() && directions.iter().all(|x| x.cross(first).norm() <= tolerance::EQUAL);
    if agree {
        return Some((middle, first));
    }
    let (e1, e2) = first.complement();
    // heights from the middle: then the line passes through it, and its slope alone is fitted
    let heights: Vec<f64> = points.iter().map(|x| first.dot(*x - middle) / length).collect();
    let weight = heights.iter().map(|h| h * h).sum::<f64>() + directions.len() as f64;
    if weight <= f64::MIN_POSITIVE {
        return None;
    }
    let slope = |e: Vec3<f64>| {
        let of_points: f64 = points.iter().zip(&heights).map(|(x, h)| e.dot(*x - middle) / length * h).sum();
        (of_points + directions.iter().map(|x| e.dot(*x)).sum::<f64>()) / weight
    };
    let along = (first + e1.times(slope(e1)) + e2.times(slope(e2))).unit()?;
    Some((middle, along))
}

/// The rotation of a direction, in either sense, to another.
fn turn_to(from: Vec3<f64>, to: Vec3<f64>) -> Vec3<f64> {
    let ahead = from.times(if from.dot(to) < 0.0 { -1.0 } else { 1.0 });
    let across = ahead.cross(to);
    let sine = across.norm();
    if sine > 0.0 {
        across.times(sine.atan2(ahead.dot(to)) / sine)
    } else {
        Vec3::zero()
    }
}

fn mean(points: impl Iterator<Item = Vec3<f64>>) -> Vec3<f64> {
    let (sum, count) = points.fold((Vec3::zero(), 0.0), |(sum, count), x| (sum + x, count + 1.0));
    sum.times(1.0 / f64::max(count, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hinge(z: f64, off: [f64; 2], along: [f64; 3]) -> Feature {
        Feature { offset: 0, at: Some(Vec3([off[0], off[1], z])), along: Vec3(along).unit() }
    }

    #[test]
    fn axes_that_agree_keep_their_direction_and_others_are_fitted_with_their_points() {
        let up = Vec3([0.0, 0.0, 1.0]);
        let features = [hinge(-1.0, [0.0, 0.0], up.0), hinge(1.0, [1e-6, 0.0], up.0)];
        let (at, along) = fitted(&features.each_ref(), up, 1.0).unwrap();
        assert_eq!(along, up);
        assert!((at.0[0] - 5e-7).abs() < 1e-20);
        // two points ask for the slope s, one axis for none and one for twice it
        let s = 1e-6;
        let features = [hinge(-1.0, [-s, 0.0], up.0), hinge(1.0, [s, 0.0], [2.0 * s, 0.0, 1.0])];
        let (_, along) = fitted(&features.each_ref(), up, 1.0).unwrap();
        assert!((along.0[0] - s).abs() < 1e-15);
    }

    #[test]
    fn a_direction_turns_to_another_whatever_its_sense() {
        let (up, tilted) = (Vec3([0.0, 0.0, 1.0]), Vec3([1e-5, 0.0, 1.0]).unit().unwrap());
        for from in [tilted, tilted.times(-1.0)] {
            let turn = turn_to(from, up);
            assert!((turn - Vec3([0.0, -1e-5, 0.0])).norm() < 1e-15);
        }
        assert_eq!(turn_to(up, up), Vec3::zero());
    }
}
