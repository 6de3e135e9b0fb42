//! Lengths that were intended to be equal: in a parallelogram they contain more information than all its motion.
//!
//! Where pins lie in a line and cranks were intended to be parallel, an error of a crank rotates the coupler by p and
//! opens the loop by p²: the closure error has a double root, which gives neither its position nor, below the root of
//! rounding, its existence. Equal lengths between parallel axes, and axes of one body in one plane, are simple roots of
//! the same drawing.

use super::change::{is_sought, LARGEST, OWN};
use super::{bearings, blocks, Drawing};
use crate::joint::alignment;
use crate::model::Model;
use crate::spec::JointKind;
use partita_math::dense::Matrix;
use partita_math::factor::svd;
use partita_math::sorting::sort_by;
use partita_math::spatial::Vec3;
use partita_math::tolerance;

/// Changes of lengths: each is quadratically better than the one before.
const ROUNDS: usize = 8;

/// An axis on its body, as drawn.
struct Pin {
    node: usize,
    /// Index of its displacement in a change of the drawing.
    offset: usize,
    at: Vec3<f64>,
    axis: Vec3<f64>,
}

/// A relation that holds nearly, and was intended to hold.
pub(super) enum Alike {
    /// Two axes of one body are parallel.
    Parallel(usize, usize),
    /// Two axes of one body coincide.
    Coaxial(usize, usize),
    /// The third axis lies in the plane of the first two, between them.
    InLine([usize; 3]),
    /// Two pairs of axes are equally far apart.
    Equal([usize; 2], [usize; 2]),
}

/// A condition on a change of the drawing: its parts, each an index in the change and a direction, and its error.
pub(super) struct Condition {
    parts: Vec<(usize, Vec3<f64>)>,
    pub(super) off: f64,
}

impl Condition {
    /// As a row over the numbers of a change.
    pub(super) fn set(&self, row: &mut [f64]) {
        for (offset, side) in &self.parts {
            side.0.iter().zip(&mut row[*offset..]).for_each(|(x, out)| *out += x);
        }
    }
}

impl Drawing {
    /// Axes of one body, parallel to each other, whose distances equal others within a few tolerances, or which lie in
    /// one plane.
    pub(super) fn alike(&self, tolerance: f64) -> Vec<Alike> {
        alike(
            &pins(&self.model, 0..self.model.spec.joints.len()),
            tolerance::INTENDED_PARALLEL * tolerance * self.length,
        )
    }

    /// These relations as conditions on a change of this drawing.
    pub(super) fn conditions(&self, alike: &[Alike]) -> Vec<Condition> {
        let pins = if alike.is_empty() { Vec::new() } else { pins(&self.model, 0..self.model.spec.joints.len()) };
        alike.iter().flat_map(|x| x.conditions(&pins, self.length)).collect()
    }

    /// The shortest change of the drawing that satisfies all these relations.
    pub(super) fn made_alike(&self, alike: &[Alike]) -> Option<Vec<f64>> {
        let joints = self.model.spec.joints.len();
        let (size, mut pins) = (self.length, pins(&self.model, 0..joints));
        let mut change = vec![0.0; OWN * joints];
        if 2 * alike.len() * change.len().pow(2) > LARGEST {
            return None;
        }
        for _ in 0..ROUNDS {
            let lengths = alike.iter().filter(|x| !matches!(x, Alike::Parallel(..)));
            let conditions: Vec<Condition> = lengths.flat_map(|x| x.conditions(&pins, size)).collect();
            if conditions.iter().all(|x| x.off.abs() <= tolerance::ROUNDING) {
                break;
            }
            let by = shortest(&conditions, change.len())?;
            for pin in &mut pins {
                pin.at += Vec3([0, 1, 2].map(|k| by[pin.offset + k] * size));
            }
            change.iter_mut().zip(&by).for_each(|(x, by)| *x += by);
        }
        Some(change)
    }
}

/// Whether nearly equal lengths of a block differ by more than rounding, or joints beside each other do. Blocks too large for a search are skipped: the
/// number of relations grows with the third power of the number of axes in one line.
pub(super) fn is_unlike(model: &Model, tolerance: f64) -> bool {
    if bearings::are_off(model, tolerance) {
        return true;
    }
    let (size, near) = (model.own.placed.size, tolerance::INTENDED_PARALLEL * tolerance * model.own.placed.size);
    blocks::joints_of_blocks(&model.spec).into_iter().filter(|joints| is_sought(joints.len())).any(|joints| {
        let pins = pins(model, joints);
        let off = |x: &Alike| x.conditions(&pins, size).iter().any(|x| x.off.abs() > tolerance::SUM_ROUNDING);
        alike(&pins, near).iter().any(off)
    })
}

/// The axes about which bodies rotate, on either side of these joints.
fn pins(model: &Model, joints: impl IntoIterator<Item = usize>) -> Vec<Pin> {
    let mut pins = Vec::new();
    for j in joints {
        let (joint, placed) = (&model.spec.joints[j], &model.own.placed.joints[j]);
        let turns = matches!(joint.kind, JointKind::Revolute | JointKind::Cylindrical);
        let (true, Some(axis), Ok(align)) = (turns, joint.axis.and_then(|x| Vec3(x).unit()), alignment(joint)) else {
            continue;
        };
        let there = joint.child_point.unwrap_or(joint.point);
        pins.push(Pin { node: placed.parent, offset: j * OWN, at: Vec3(joint.point), axis });
        let axis = align.apply_transposed(axis);
        pins.push(Pin { node: placed.child, offset: j * OWN + OWN / 2, at: Vec3(there), axis });
    }
    pins
}

/// The relations that hold within `near` (m).
fn alike(pins: &[Pin], near: f64) -> Vec<Alike> {
    let mut found = Vec::new();
    let mut lengths: Vec<(f64, [usize; 2])> = Vec::new();
    let one_body = |i: usize, j: usize| {
        let (a, b) = (&pins[i], &pins[j]);
        a.node == b.node && a.axis.cross(b.axis).norm() <= tolerance::EQUAL
    };
    for i in 0..pins.len() {
        for j in (i + 1..pins.len()).filter(|&j| one_body(i, j)) {
            found.push(Alike::Parallel(i, j));
            let length = between(pins, i, j).norm();
            if length <= near {
                found.push(Alike::Coaxial(i, j));
                continue;
            }
            lengths.push((length, [i, j]));
            for k in (0..pins.len()).filter(|&k| k != i && k != j && one_body(i, k)) {
                let (first, second) = (between(pins, i, k), between(pins, k, j));
                let is_between = first.norm().max(second.norm()) < length && first.norm().min(second.norm()) > near;
                if is_between && across(pins, [i, j, k]).is_some_and(|x| x.1.abs() <= near) {
                    found.push(Alike::InLine([i, j, k]));
                }
            }
        }
    }
    sort_by(&mut lengths, |x, y| x.0.total_cmp(&y.0));
    let mut first: Option<(f64, [usize; 2])> = None;
    for (length, pair) in lengths {
        match first {
            Some((least, other)) if length - least <= near => found.push(Alike::Equal(other, pair)),
            _ => first = Some((length, pair)),
        }
    }
    found
}

/// Vector from one axis to another, perpendicular to the first.
fn between(pins: &[Pin], i: usize, j: usize) -> Vec3<f64> {
    let (axis, to) = (pins[i].axis, pins[j].at - pins[i].at);
    to - axis.times(axis.dot(to))
}

/// Direction normal to the plane of two axes, the distance of a third from it, and its position between them.
fn across(pins: &[Pin], [i, j, k]: [usize; 3]) -> Option<(Vec3<f64>, f64, f64)> {
    let (along, to) = (between(pins, i, j), between(pins, i, k));
    let (unit, length) = (along.unit()?, along.norm());
    let across = pins[i].axis.cross(unit);
    Some((across, across.dot(to), unit.dot(to) / length))
}

impl Alike {
    fn conditions(&self, pins: &[Pin], size: f64) -> Vec<Condition> {
        let at = |i: usize| pins[i].offset;
        match *self {
            Self::Parallel(i, j) => {
                let (axis, other) = (pins[i].axis, pins[j].axis);
                let by = axis.times(axis.dot(other).signum()).cross(other);
                let turned = |i: usize, side| (at(i) + 3, side);
                let parts = |side: Vec3<f64>| vec![turned(j, side), turned(i, side.times(-1.0))];
                sides(axis).map(|side| Condition { parts: parts(side), off: side.dot(by) }).into()
            }
            Self::Coaxial(i, j) => {
                let to = between(pins, i, j);
                let parts = |side: Vec3<f64>| vec![(at(j), side), (at(i), side.times(-1.0))];
                sides(pins[i].axis).map(|side| Condition { parts: parts(side), off: side.dot(to) / size }).into()
            }
            Self::InLine([i, j, k]) => match across(pins, [i, j, k]) {
                Some((side, off, part)) => {
                    let parts = vec![(at(k), side), (at(i), side.times(part - 1.0)), (at(j), side.times(-part))];
                    vec![Condition { parts, off: off / size }]
                }
                None => Vec::new(),
            },
            Self::Equal([i, j], [k, l]) => {
                let (one, two) = (between(pins, i, j), between(pins, k, l));
                let (Some(u), Some(v)) = (one.unit(), two.unit()) else { return Vec::new() };
                let parts = vec![(at(j), u), (at(i), u.times(-1.0)), (at(l), v.times(-1.0)), (at(k), v)];
                vec![Condition { parts, off: (one.norm() - two.norm()) / size }]
            }
        }
    }
}

/// Directions perpendicular to an axis that span all of them.
fn sides(axis: Vec3<f64>) -> [Vec3<f64>; 3] {
    [0, 1, 2].map(|k| {
        let mut side = Vec3([0.0; 3]);
        side.0[k] = 1.0;
        side - axis.times(axis.dot(side))
    })
}

/// The shortest change that satisfies all conditions to first order.
fn shortest(conditions: &[Condition], numbers: usize) -> Option<Vec<f64>> {
    let mut rows = Matrix::new(conditions.len(), numbers);
    conditions.iter().enumerate().for_each(|(r, x)| x.set(rows.row_mut(r)));
    let f = svd(&rows).ok()?;
    let least = tolerance::DEPENDENT * f.s.first().copied()?;
    let mut by = vec![0.0; numbers];
    for (i, s) in f.s.iter().enumerate().filter(|x| *x.1 > least) {
        let part = -conditions.iter().enumerate().map(|(r, x)| f.u[(r, i)] * x.off).sum::<f64>() / s;
        by.iter_mut().enumerate().for_each(|(j, x)| *x += part * f.v[(j, i)]);
    }
    Some(by)
}
