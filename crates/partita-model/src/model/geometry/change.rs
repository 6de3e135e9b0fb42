//! The least change of a drawing that makes it movable.                                                          (T2)
//!
//! Between free bodies every joint is a loop closure. Its frame on either body may have a small error p (displacements
//! over the block's length, and rotations). Along the motion each self-stress n requires
//!
//! ```text
//! nᵀ (Φ + P p) = 0,   P = C times the motion of the body that carries the frame
//! ```
//!
//! and the shortest p that satisfies all of them at once is the least change.

use super::alike::{Alike, Condition};
use super::{Drawing, LARGEST_CHANGE};
use crate::joint::alignment;
use crate::spec::{Joint, JointKind, Spec};
use crate::tree::TreeScratch;
use partita_math::dense::Matrix;
use partita_math::factor::svd;
use partita_math::spatial::{Mat3, Quaternion, Spatial, Vec3};
use partita_math::tolerance;
use partita_system::prelude::*;
use partita_system::rank::{BranchPoint, Cut, Kernel};
use partita_system::SystemError;

/// Numbers of a joint: displacement and rotation on either side.
pub(super) const OWN: usize = 12;
/// Rounds: quadratic from 1e-4 to rounding in three or four, linear next to double roots.
const ROUNDS: usize = 14;
/// Rounds in a row that do not halve the closure error before a change is given up. Reason: near a double root each gains
/// a factor of four; where the weakest singular values must be used first, four rounds descend to them.
const IDLE: usize = 4;
/// Number of positions at which the self-stresses are evaluated.
const PLACES: usize = 14;
/// Number of them in large blocks, at least.
const FEW_PLACES: usize = 6;
/// Number of products in a decomposition up to which all of them are used.
const CHEAP: usize = 60_000_000;
/// Fewer are not informative.
const FEWEST: usize = 3;
/// Singular values of the conditions below this multiple of the closure error are null. Scale: multiples of the closure
/// error. Reason: the error of the conditions is as large as the closure error, times the length of a loop.
const CLOSURE_FACTOR: f64 = 30.0;
/// Largest number of products in a decomposition for which a change is sought.
pub(super) const LARGEST: usize = 150_000_000;
/// A fit that depends on smaller singular values may be near a double root. Scale: fraction of the largest singular
/// value. Reason: the root of the closure error of a fit.
const SURE_FIT: f64 = 1e-4;
/// At a double root null singular values exceed this. Scale: fraction of the remaining change. Reason: at a double root
/// they are as large as the change.
const DOUBLE_ROOT: f64 = 1e-2;
/// Near a double root the remaining change is below this. Scale: natural scales of the drawing. Reason: a larger one
/// would appear in the closure error.
const CHANGE_LEFT: f64 = 1e-5;

/// A change larger than this after the second round is not pursued. Scale: multiples of the largest change that is made.
/// Reason: the first round is right to the square of the change.
const FAR_BEYOND: f64 = 4.0;

/// A change that makes a drawing fit.
pub(super) struct Change {
    pub(super) numbers: Vec<f64>,
    /// The smallest singular value that was used, as a fraction of the largest.
    least: f64,
    /// The null singular values.
    weak: Vec<f64>,
}

impl Change {
    /// Whether the change rests on a double root in lengths with the error `off`. They are significant then where they
    /// have an error.
    pub(super) fn is_double(&self, off: f64) -> bool {
        self.least < SURE_FIT
            || off < CHANGE_LEFT && self.weak.iter().any(|s| *s > (DOUBLE_ROOT * off).max(tolerance::SUM_ROUNDING))
    }
}

/// Largest change of the frame of a joint on one body.
pub(super) fn largest(numbers: &[f64]) -> f64 {
    numbers.chunks(OWN / 2).map(|x| x.iter().map(|x| x * x).sum::<f64>().sqrt()).fold(0.0, f64::max)
}

/// Whether a change is sought in a block with this number of joints.
pub(super) fn is_sought(joints: usize) -> bool {
    (OWN * joints).saturating_pow(3) <= LARGEST
}

impl Drawing {
    /// The shortest change near `begun`, with the part `kept` of it, that gives this drawing `kernel` null directions
    /// at the positions. None where there is none, or one far beyond the tolerance.
    pub(super) fn change(
        &self,
        points: &[BranchPoint],
        kernel: usize,
        (begun, kept): (&[f64], &[Alike]),
        tolerance: f64,
    ) -> Result<Option<Change>, SystemError> {
        let mut change = Change { numbers: begun.to_vec(), least: 1.0, weak: Vec::new() };
        let Some(mut now) = self.changed(&change.numbers) else { return Ok(None) };
        let cut = Cut::Rank(self.model.size().nv.saturating_sub(kernel));
        let count = self.position_count(kernel);
        let mut at: Vec<Vec<f64>> = spread(points, kernel, count).into_iter().map(|x| x.q.clone()).collect();
        let (mut before, mut nothing) = (f64::INFINITY, super::WEAK_CONDITION);
        let (mut best, mut idle) = (f64::INFINITY, 0);
        for round in 0..ROUNDS {
            if self.is_abandoned() {
                return Ok(None);
            }
            let (rows, closure_error) = now.asked(&mut at, cut, &now.conditions(kept))?;
            if at.len() < FEWEST || rows.rows() * rows.cols().pow(2) > LARGEST {
                return Ok(None);
            }
            let worst = closure_error.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            if worst < tolerance::ROUNDING || worst < tolerance::CLOSED && worst > tolerance::CONVERGES * before {
                return Ok(Some(change));
            }
            (best, idle) = if worst <= tolerance::CONVERGES * best { (worst, 0) } else { (best, idle + 1) };
            if !worst.is_finite() || idle >= IDLE && !kept.is_empty() {
                return Ok(None);
            }
            // normally the iteration is quadratic; near a double root little is gained, and values above the rounding
            // level are used
            nothing = match tolerance::CLEARLY * worst > before {
                true => (nothing / CLOSURE_FACTOR).max(tolerance::NULL_VALUE),
                false => (CLOSURE_FACTOR * worst).clamp(tolerance::NULL_VALUE, super::WEAK_CONDITION),
            };
            before = worst;
            let Ok(f) = svd(&rows) else { return Ok(None) };
            let Some(top) = f.s.first().copied().filter(|s| *s > 0.0) else { return Ok(None) };
            // the least of the whole change, not of its last step: A p_new = A p - open
            let wanted: Vec<f64> = rows
                .matvec(&change.numbers)
                .iter()
                .zip(&closure_error)
                .map(|(a, closure_error)| a - closure_error)
                .collect();
            change.numbers.fill(0.0);
            change.weak = f.s.iter().map(|s| s / top).filter(|s| *s < tolerance::DEPENDENT).collect();
            for (i, s) in f.s.iter().enumerate().take_while(|x| *x.1 > nothing * top) {
                change.least = s / top;
                let part = (0..rows.rows()).map(|r| f.u[(r, i)] * wanted[r]).sum::<f64>() / s;
                change.numbers.iter_mut().enumerate().for_each(|(j, x)| *x += part * f.v[(j, i)]);
            }
            if round > 0 && largest(&change.numbers) > FAR_BEYOND * LARGEST_CHANGE * tolerance {
                return Ok(None);
            }
            let Some(next) = self.changed(&change.numbers) else { return Ok(None) };
            now = next;
        }
        Ok(None)
    }

    /// Number of positions at which the self-stresses are evaluated: of large blocks fewer, so that a decomposition stays
    /// cheap. That the others fit is checked afterwards.
    fn position_count(&self, kernel: usize) -> usize {
        let columns = OWN * self.model.spec.joints.len();
        let rank = self.model.size().nv.saturating_sub(kernel);
        let stresses = Kernel::new(&self.model, 0.0).rows.len().saturating_sub(rank);
        (CHEAP / (stresses * columns.pow(2)).max(1)).clamp(FEW_PLACES, PLACES)
    }

    /// Requirements of the self-stresses at the positions, closed again, and of the conditions on the drawing: rows of
    /// a change, and the error of each.
    fn asked(&self, at: &mut Vec<Vec<f64>>, cut: Cut, kept: &[Condition]) -> Result<(Matrix, Vec<f64>), SystemError> {
        let columns = OWN * self.model.spec.joints.len();
        let (mut rows, mut closure_error): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
        let mut kernel = Kernel::new(&self.model, 0.0);
        let mut s = self.model.own.full.scratch();
        let mut still = Vec::with_capacity(at.len());
        for mut q in at.drain(..) {
            if kernel.close(&mut q, cut)?.is_none() {
                continue;
            }
            let stresses = kernel.stresses(&q, cut)?;
            self.model.own.full.poses(&q, &mut s);
            for stress in &stresses {
                let mut row = vec![0.0; columns];
                let weights = stress.iter().zip(&kernel.sizes).map(|(x, size)| x / size);
                let weighed: Vec<(usize, f64)> = kernel.rows.iter().copied().zip(weights).collect();
                self.slope(&weighed, kernel.raw_c(), &s, &mut row);
                rows.extend(row);
                closure_error.push(weighed.iter().map(|(i, w)| w * kernel.raw_phi()[*i]).sum());
            }
            still.push(q);
        }
        *at = still;
        for condition in kept {
            let mut row = vec![0.0; columns];
            condition.set(&mut row);
            rows.extend(row);
            closure_error.push(condition.off);
        }
        Ok((Matrix::from_vec(closure_error.len(), columns, rows), closure_error))
    }

    /// With the frames of the joints changed by this; in a plane it stays the plane.
    pub(super) fn changed(&self, change: &[f64]) -> Option<Self> {
        self.made(change, self.model.is_planar()).filter(|new| new.model.is_planar() == self.model.is_planar())
    }

    /// As `changed`, in whatever plane results.
    pub(super) fn changed_to(&self, change: &[f64]) -> Option<Self> {
        self.made(change, true)
    }

    fn made(&self, change: &[f64], allow_plane: bool) -> Option<Self> {
        let mut spec: Spec = (*self.model.spec).clone();
        for (joint, x) in spec.joints.iter_mut().zip(change.chunks(OWN)) {
            set(joint, x, self.length, self.normal());
        }
        Self::new(spec, self.model.functions(), Some(self.length), allow_plane)
    }

    /// The change by which joints with parallel axes have one height along them on both of their bodies.
    pub(super) fn heights(&self) -> Option<Vec<f64>> {
        let joints = &self.model.spec.joints;
        let normal = joints.iter().find_map(|j| j.axis.filter(|_| j.kind == JointKind::Revolute)).map(Vec3)?.unit()?;
        let mut change = vec![0.0; OWN * joints.len()];
        for (j, x) in joints.iter().zip(change.chunks_mut(OWN)) {
            let off = normal.dot(Vec3(j.child_point.unwrap_or(j.point)) - Vec3(j.point)) / self.length;
            let half = normal.times(0.5 * off);
            x[..3].copy_from_slice(&half.0);
            x[OWN / 2..OWN / 2 + 3].copy_from_slice(&half.times(-1.0).0);
        }
        Some(change)
    }

    /// Distances between the frames of each body, perpendicular to the first axis if it is a hinge's.
    pub(super) fn lengths(&self) -> Vec<f64> {
        let model = &self.model;
        let mut frames: Vec<(usize, Vec3<f64>, Option<Vec3<f64>>)> = Vec::new();
        for (joint, placed) in model.spec.joints.iter().zip(&model.own.placed.joints) {
            let axis = joint.axis.filter(|_| joint.kind == JointKind::Revolute).and_then(|x| Vec3(x).unit());
            let there = joint.child_point.unwrap_or(joint.point);
            frames.push((placed.parent, Vec3(joint.point), axis));
            frames.push((placed.child, Vec3(there), axis));
        }
        let mut lengths = Vec::new();
        for (i, one) in frames.iter().enumerate() {
            for two in frames[i + 1..].iter().filter(|x| x.0 == one.0) {
                let to = two.1 - one.1;
                lengths.push(one.2.map_or(to, |axis| to - axis.times(axis.dot(to))).norm());
            }
        }
        lengths
    }

    /// Normal of the plane of its motion.
    pub(super) fn normal(&self) -> Option<Vec3<f64>> {
        let up = Vec3([0.0, 0.0, 1.0]);
        self.model.is_planar().then(|| self.model.own.placed.basis.apply_transposed(up))
    }

    /// This change, with nearly parallel axes made parallel and nearly equal lengths made equal; the part of it to be
    /// kept; and its size.
    pub(super) fn alike_too(&self, change: &[f64], q: &[f64], tolerance: f64) -> Option<(Vec<f64>, Vec<Alike>, f64)> {
        let mut numbers = change.to_vec();
        let mut off = 0.0f64;
        let mut add = |more: &[f64]| {
            numbers.iter_mut().zip(more).for_each(|(x, more)| *x += more);
            off = more.iter().fold(off, |m: f64, x| m.max(x.abs()));
            self.changed(&numbers)
        };
        let parallel = add(&self.changed(change)?.parallel(q, tolerance::INTENDED_PARALLEL * tolerance))?;
        let alike = parallel.alike(tolerance);
        add(&parallel.made_alike(&alike)?)?;
        (off > tolerance::SUM_ROUNDING).then_some((numbers, alike, off))
    }

    /// The change of this drawing that makes axes which are parallel within `near` at q exactly parallel, and guides
    /// that are perpendicular to hinges within it exactly perpendicular: where the fit is a double root, to first order
    /// they need no change.
    pub(super) fn parallel(&self, q: &[f64], near: f64) -> Vec<f64> {
        let model = &self.model;
        let mut change = vec![0.0; OWN * model.spec.joints.len()];
        let mut s = model.own.full.scratch();
        model.own.full.poses(q, &mut s);
        // index of the rotation in a change, orientation of its body, and the present axis; hinges first
        let mut axes: Vec<(usize, Mat3<f64>, Vec3<f64>)> = Vec::new();
        let is_hinge = |j: usize| model.spec.joints[j].kind == JointKind::Revolute;
        let out = model.own.placed.basis;
        for (j, (joint, placed)) in model.spec.joints.iter().zip(&model.own.placed.joints).enumerate() {
            let (Some(axis), None, Ok(align)) = (joint.axis, joint.axis2, alignment(joint)) else { continue };
            let Some(axis) = Vec3(axis).unit() else { continue };
            for (node, offset, axis) in [(placed.parent, 3, axis), (placed.child, 9, align.apply_transposed(axis))] {
                let turn = out.transpose().mul(&s.links[model.own.placed.link_of(node)].rot).mul(&out);
                axes.push((j * OWN + offset, turn, turn.apply(axis)));
            }
        }
        axes.sort_by_key(|x| !is_hinge(x.0 / OWN));
        let mut hinges: Vec<Vec3<f64>> = Vec::new();
        while let Some((index, _, first)) = axes.first().copied() {
            let (group, others): (Vec<_>, Vec<_>) = axes.into_iter().partition(|x| x.2.cross(first).norm() <= near);
            axes = others;
            let ahead = |x: Vec3<f64>| x.times(if x.dot(first) < 0.0 { -1.0 } else { 1.0 });
            // the axis that the others are nearest to: where most are exactly parallel, those stay unchanged
            let off = |x: Vec3<f64>| group.iter().map(|y| x.cross(y.2).norm()).sum::<f64>();
            let least = group.iter().min_by(|x, y| off(x.2).total_cmp(&off(y.2))).map_or(first, |x| ahead(x.2));
            let wanted = match is_hinge(index / OWN) {
                true => least,
                false => across(least, &hinges, near),
            };
            hinges.extend(Some(wanted).filter(|_| is_hinge(index / OWN)));
            for &(offset, turn, axis) in &group {
                let across = ahead(axis).cross(wanted);
                let (sine, cosine) = (across.norm(), ahead(axis).dot(wanted));
                if sine > 0.0 {
                    let by = turn.apply_transposed(across.times(sine.atan2(cosine) / sine));
                    change[offset..offset + 3].copy_from_slice(&by.0);
                }
            }
        }
        change
    }

    /// Closure error that a change of each number would cause, rows added up with these weights, at the position of `s`
    /// and `c`.
    fn slope(&self, rows: &[(usize, f64)], c: &[f64], s: &TreeScratch<Spatial<f64>>, out: &mut [f64]) {
        let model = &self.model;
        let (pattern, placed) = (model.pattern(), &model.own.placed);
        // mechanism axes are world axes, unless a plane lies tilted
        let basis = placed.basis;
        for &(row, weight) in rows.iter().filter(|x| x.1 != 0.0) {
            let Some(j) = model.joint_of_row(row) else { continue };
            let joint = &placed.joints[j];
            for (node, other, point, first) in [
                (joint.parent, joint.child, joint.parent_point, 0),
                (joint.child, joint.parent, joint.child_point, OWN / 2),
            ] {
                // a frame on the ground moves by as much as the other body would move relative to it
                let (body, sign) = if node == 0 { (other, -weight) } else { (node, weight) };
                let (own, link) = (placed.link_of(node), placed.link_of(body));
                let effort = self
                    .effort(link, |v| pattern.row(row).find(|&e| pattern.col_idx[e] == v).map_or(0.0, |e| sign * c[e]));
                let (force, moment) =
                    (effort.0, if self.model.is_planar() { effort.1 } else { s.links[link].rot.apply(effort.1) });
                let turn = &s.links[own].rot;
                let here = model.own.full.reference_point(own, s) + turn.apply(point - model.own.reference()[own]);
                let about = moment + (model.own.full.reference_point(link, s) - here).cross(force);
                let shift = basis.apply_transposed(turn.apply_transposed(force)).times(self.length);
                let turned = basis.apply_transposed(turn.apply_transposed(about));
                let numbers = &mut out[j * OWN + first..][..OWN / 2];
                shift.0.iter().chain(&turned.0).zip(numbers).for_each(|(x, out)| *out += x);
            }
        }
    }

    /// Force (mechanism axes) and moment (body axes; in a plane the same) on a floating link from the effort along each
    /// of its velocities.
    fn effort(&self, link: usize, of: impl Fn(usize) -> f64) -> (Vec3<f64>, Vec3<f64>) {
        let links = &self.model.own.placed.links;
        let v = links[link].v;
        match self.model.is_planar() {
            true => (Vec3([of(v - 2), of(v - 1), 0.0]), Vec3([0.0, 0.0, of(v)])),
            false => (Vec3([of(v - 3), of(v - 2), of(v - 1)]), Vec3([of(v), of(v + 1), of(v + 2)])),
        }
    }
}

/// A direction made perpendicular to those of these to which it is so within `near`.
fn across(direction: Vec3<f64>, to: &[Vec3<f64>], near: f64) -> Vec3<f64> {
    let nearly: Vec<Vec3<f64>> = to.iter().copied().filter(|x| x.dot(direction).abs() <= near).collect();
    let wanted = match nearly[..] {
        [] => Some(direction),
        [one] => (direction - one.times(one.dot(direction))).unit(),
        [one, two, ..] => one.cross(two).unit().map(|x| x.times(x.dot(direction).signum())),
    };
    wanted.filter(|x| x.cross(direction).norm() <= near).unwrap_or(direction)
}

/// Positions with the right kernel, spread over the paths.
fn spread(points: &[BranchPoint], kernel: usize, count: usize) -> Vec<&BranchPoint> {
    let right: Vec<&BranchPoint> = points.iter().filter(|x| x.kernel.0 == kernel).collect();
    let all = if right.len() < FEWEST { points.iter().collect() } else { right };
    let step = all.len() as f64 / count.min(all.len()).max(1) as f64;
    (0..count.min(all.len())).map(|i| all[((i as f64 + 0.5) * step) as usize]).collect()
}

/// Change the frames of a joint by displacements (in parts of `size`) and rotations, first on the parent; in a plane
/// they rotate about its normal.
fn set(joint: &mut Joint, by: &[f64], size: f64, normal: Option<Vec3<f64>>) {
    let part = |i: usize| Vec3([by[i], by[i + 1], by[i + 2]]);
    let turned = |w: Vec3<f64>| normal.map_or(w, |n| n.times(n.dot(w)));
    if part(0).norm() + part(6).norm() > 0.0 {
        let child = Vec3(joint.child_point.unwrap_or(joint.point)) + part(6).times(size);
        joint.child_point = Some(child.0);
        joint.point = (Vec3(joint.point) + part(0).times(size)).0;
    }
    let turns = [part(3), part(9)].map(turned);
    if turns[0].norm() + turns[1].norm() == 0.0 {
        return;
    }
    let [on_parent, on_child] = turns.map(|w| Quaternion::exp(w).matrix());
    let Ok(drawn) = alignment(joint) else { return };
    let one_frame = joint.child_axis.is_none() && joint.child_frame.is_none() && turns[0].0 == turns[1].0;
    for axis in [&mut joint.axis, &mut joint.axis2].into_iter().flatten() {
        *axis = on_parent.apply(Vec3(*axis)).0;
    }
    joint.frame = joint.frame.map(|frame| on_parent.mul(&Mat3(frame)).0);
    if one_frame {
        return;
    }
    let fits = on_parent.mul(&drawn).mul(&on_child.transpose());
    let frame = joint.frame.map_or_else(Mat3::identity, Mat3);
    joint.child_axis = None;
    joint.child_frame = Some(fits.transpose().mul(&frame).0);
}
