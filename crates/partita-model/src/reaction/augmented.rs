//! Reactions of tree joints by augmented joint coordinates (Blajer 2004): an alternative to the recursion, for
//! verification.
//!
//! Give each joint, besides its own coordinates, the displacements z that it prohibits. A small z_i moves everything
//! outboard of the joint like one rigid body, E_i = ∂p/∂z_i; the reaction along z_i is the virtual power
//! `σ_i = E_iᵀ (M_a p̈ − h_a − J_cᵀ λ)` of what the bodies outboard still need.                           (44, 45)
//! No matrix is inverted, and only the columns asked for are formed. Cost: (bodies outboard) for each component.

use super::Known;
use crate::model::{Model, ModelScratch};
use crate::wrench::{Free, Wrench};
use partita_math::spatial::Vec3;
use partita_math::tolerance;
use partita_system::SystemError;

/// One prohibited displacement of a joint: a rotation about, or a translation along, a unit axis.
#[derive(Clone, Copy, Debug)]
struct Prohibited {
    turn: bool,
    axis: Vec3<f64>,
}

impl Model {
    /// Reactions of all joints for a motion with the multipliers `lambda`: those of tree joints from (45), those of cut
    /// joints from λ. Same meaning and axes as [`Reactions::joints`](super::Reactions).
    pub fn augmented_reactions(
        &self,
        t: f64,
        q: &[f64],
        v: &[f64],
        vdot: &[f64],
        lambda: &[f64],
        s: &mut ModelScratch,
    ) -> Result<Vec<Wrench<f64>>, SystemError> {
        let Known { mut joints, needed, own, .. } =
            self.own.known(self.whole(), t, q, v, vdot, lambda, s.equations())?;
        let (mut free, mut velocities) = (Vec::new(), Vec::new());
        for (index, e) in self.own.placed.carrying.iter().enumerate() {
            let Some(j) = e.joint else { continue };
            let outboard = self.outboard(index);
            let point = self.own.joint_point_now(s.evaluated(), j);
            self.own.free_axes(j, s.evaluated(), &mut free);
            let mut w = Wrench::default();
            for z in prohibited(&free) {
                let sigma = self.virtual_power(z, point, &outboard, &needed, s); // (45)
                match z.turn {
                    true => w.moment += z.axis.times(sigma),
                    false => w.force += z.axis.times(sigma),
                }
            }
            w = if e.reversed { w.opposite() } else { w };
            if self.own.placed.joints[j].links.is_none() {
                joints[j].add(&w.across());
                continue;
            }
            self.own.velocities_of(j, &mut velocities);
            joints[j] = Free::new(&free).with_along(&w, |i| own[velocities[i]]);
        }
        joints.iter_mut().for_each(|w| *w = w.out_of(&self.own.placed.basis));
        Ok(joints)
    }

    /// Nodes that move with a displacement in the joint of tree edge `index`.
    fn outboard(&self, index: usize) -> Vec<usize> {
        let tree = &self.own.placed.carrying;
        let mut nodes = vec![tree[index].to];
        for e in &tree[index + 1..] {
            if nodes.contains(&e.from) {
                nodes.push(e.to);
            }
        }
        nodes
    }

    /// Power of the forces that the bodies outboard need in the rigid displacement z about `point`: a column of E times
    /// the rest.
    fn virtual_power(
        &self,
        z: Prohibited,
        point: Vec3<f64>,
        outboard: &[usize],
        needed: &[Wrench<f64>],
        s: &ModelScratch,
    ) -> f64 {
        outboard.iter().fold(0.0, |sum, &node| {
            let w = &needed[node - 1];
            sum + match z.turn {
                true => {
                    z.axis.dot(w.moment) + z.axis.cross(self.own.com_now(s.evaluated(), node - 1) - point).dot(w.force)
                }
                false => z.axis.dot(w.force),
            }
        })
    }
}

/// An orthonormal basis of the displacements that a joint with these free axes prohibits.
fn prohibited(free: &[(bool, Vec3<f64>)]) -> Vec<Prohibited> {
    let mut found = Vec::with_capacity(6);
    for turn in [true, false] {
        let mut base: Vec<Vec3<f64>> = Vec::with_capacity(3);
        let of_this_kind = free.iter().filter(|a| a.0 == turn).map(|a| a.1);
        let free_base: Vec<Vec3<f64>> = of_this_kind.fold(Vec::new(), |mut known, axis| {
            // two free axes in line (gimbal lock) span one direction only
            known.extend(perpendicular(axis, &known, tolerance::EQUAL));
            known
        });
        base.extend(&free_base);
        for axis in [Vec3([1.0, 0.0, 0.0]), Vec3([0.0, 1.0, 0.0]), Vec3([0.0, 0.0, 1.0])] {
            // of three unit axes one leaves any plane by more than half its length
            if let Some(axis) = perpendicular(axis, &base, 0.5) {
                base.push(axis);
                found.push(Prohibited { turn, axis });
            }
        }
    }
    found
}

/// The unit part of `axis` perpendicular to an orthonormal `base`, if it is longer than `least`.
fn perpendicular(axis: Vec3<f64>, base: &[Vec3<f64>], least: f64) -> Option<Vec3<f64>> {
    let mut rest = axis;
    for _ in 0..2 {
        rest = base.iter().fold(rest, |x, b| x + b.times(-b.dot(x)));
    }
    let length = rest.norm();
    (length > least).then(|| rest.times(1.0 / length))
}
