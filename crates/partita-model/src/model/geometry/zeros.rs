//! Where the coordinates of a repaired drawing are zero.
//!
//! A repair changes lengths and axes; the loops then close next to the drawing, each joint with an own angle. Motors
//! left and right that follow one law need one zero: it is put where the loops close.                              (T2)

use super::{closed, coarsest};
use crate::joint::alignment;
use crate::model::Model;
use crate::spec::{Joint, JointKind, Spec};
use crate::zero_position::Coordinates;
use partita_math::spatial::{Mat3, Quaternion, Vec3};

/// The joints of a repaired mechanism, their coordinates zero in the position next to the drawing where its loops close.
/// None where they close as drawn, or farther away than a geometric error.
///
/// What a joint holds does not change: hinges turn about their axes, slides are shifted along theirs.
pub(in crate::model) fn closed_zeros(model: &Model, tolerance: f64) -> Option<Vec<Joint>> {
    let spec = Spec { drives: Vec::new(), ..(*model.spec).clone() };
    let model = Model::compiled(spec, model.functions(), (Coordinates::Relative, true), true).ok()?;
    let drawn = model.initial();
    let q = closed(&model, coarsest(tolerance))?;
    let near = |(q, drawn): (&f64, &f64)| (q - drawn).abs() <= coarsest(tolerance) * model.own.placed.size.max(1.0);
    if q == drawn || !q.iter().zip(&drawn).all(near) {
        return None;
    }
    let pose = model.pose(&q);
    let mut joints = model.spec.joints.clone();
    for joint in &mut joints {
        let [parent, child] = [&joint.parent, &joint.child].map(|x| pose.of(x));
        let Ok(drawn) = alignment(joint) else { continue };
        // of the child, in axes of the parent
        let there = child.seen_from(&parent);
        let turned = rotation_vector(&there.turn.mul(&drawn.transpose()));
        let on_child = Vec3(joint.child_point.unwrap_or(joint.point));
        let shifted = there.of(on_child) - Vec3(joint.point);
        let Some((turn, shift)) = free(joint, turned, shifted) else { continue };
        if turn.norm() > 0.0 {
            let fits = Quaternion::exp(turn).matrix().mul(&drawn);
            let frame = joint.frame.map_or_else(Mat3::identity, Mat3);
            joint.child_axis = None;
            joint.child_frame = Some(fits.transpose().mul(&frame).0);
        }
        if shift.norm() > 0.0 {
            let Ok(align) = alignment(joint) else { continue };
            joint.child_point = Some((on_child - align.apply_transposed(shift)).0);
        }
    }
    Some(joints)
}

/// The axis of a rotation of less than a half turn, times its angle.
fn rotation_vector(turn: &Mat3<f64>) -> Vec3<f64> {
    let [w, x, y, z] = Quaternion::from_matrix(turn).0;
    let axis = Vec3([x, y, z]);
    let sine = axis.norm();
    axis.times(if sine > 0.0 { 2.0 * sine.atan2(w) / sine } else { 0.0 })
}

/// The part of a rotation and a displacement that a joint is free to make.
fn free(joint: &Joint, turned: Vec3<f64>, shifted: Vec3<f64>) -> Option<(Vec3<f64>, Vec3<f64>)> {
    let axis = joint.axis.and_then(|x| Vec3(x).unit());
    let along = |x: Vec3<f64>| axis.map(|axis| axis.times(axis.dot(x)));
    let nothing = Vec3::zero();
    match joint.kind {
        JointKind::Revolute => Some((along(turned)?, nothing)),
        JointKind::Prismatic => Some((nothing, along(shifted)?)),
        JointKind::Cylindrical => Some((along(turned)?, along(shifted)?)),
        JointKind::Planar => Some((along(turned)?, shifted - along(shifted)?)),
        JointKind::Spherical => Some((turned, nothing)),
        _ => None,
    }
}
