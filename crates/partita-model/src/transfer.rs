//! A state of one model in the coordinates of another model of the same mechanism.

use crate::joint::Motion;
use crate::measurement::Measurement;
use crate::model::{Model, ModelScratch};
use partita_math::spatial::{Mat3, Quaternion, Vec3};
use partita_system::prelude::*;
use partita_system::SystemError;
use std::f64::consts::TAU;

impl Model {
    /// (q, v) of this model in which every body is and moves as in `from` at its (q, v). Both models must be compiled from the
    /// same description; which joints they cut and whether their coordinates are relative or absolute does not matter.
    ///
    /// Whole turns are kept where both models have the joint in their trees, and in the plane.
    pub fn transferred(&self, from: &Model, q: &[f64], v: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let mut s = from.scratch();
        from.own.look(q, v, s.equations());
        let (mut q2, mut v2) = (self.initial(), vec![0.0; self.size().nv]);
        let turned = from.turned(q);
        for e in &self.own.placed.topology.tree {
            match e.joint {
                Some(j) => self.transfer_joint(j, from, (q, v), &s, &mut q2, &mut v2),
                None => self.transfer_floating(e.to - 1, (from, &turned), &s, &mut q2, &mut v2),
            }
        }
        for (r, p) in self.spec.rotors.iter().zip(&self.own.placed.rotors) {
            let (Some(link), Some(&j)) = (p.link, self.own.placed.joint_numbers.get(&r.joint)) else { continue };
            // translations and angles come before a spatial rotation, of which no rotor reads a part
            let x = from.joint_state(j, q, v, &s);
            let l = &self.own.placed.links[link];
            (q2[l.q], v2[l.v]) = (x.position[r.coordinate], x.velocity[r.coordinate]);
        }
        (q2, v2)
    }

    /// Rotations of the links of a planar mechanism from the drawing, whole turns included; parents come first.
    fn turned(&self, q: &[f64]) -> Vec<f64> {
        let mut turned = vec![0.0; self.own.placed.links.len()];
        for (i, l) in self.own.placed.links.iter().enumerate().skip(1) {
            let own = if let Motion::Turn(a) = l.motion { a.0[2].signum() * q[l.q] } else { 0.0 };
            turned[i] = turned[l.parent] + own;
        }
        turned
    }

    /// Refuse a state of another model of the same mechanism in which an angle is wound beyond the range of this model:
    /// in its coordinates it would be another state.
    ///
    /// # Errors
    /// `Wound`.
    pub fn check_transfer(&self, from: &Model, q: &[f64]) -> Result<(), SystemError> {
        for (own, other) in self.own.full.elements.iter().zip(&from.own.full.elements) {
            let counted = other.depends_on().and_then(Measurement::coordinate);
            let (Some((what, middle, within)), Some(counted)) = (own.turn_range(), counted) else { continue };
            let by = q[counted] - middle;
            if by.abs() > within {
                return Err(SystemError::Wound { what: what.to_string(), by });
            }
        }
        Ok(())
    }

    /// Coordinates of a joint in the tree.
    fn transfer_joint(
        &self,
        j: usize,
        from: &Model,
        (q, v): (&[f64], &[f64]),
        s: &ModelScratch,
        q2: &mut [f64],
        v2: &mut [f64],
    ) {
        let p = &self.own.placed.joints[j];
        let x = from.joint_state(j, q, v, s);
        let (mut iq, mut iv) = (0, 0);
        for (m, &link) in p.shape.motions.iter().zip(p.links.iter().flatten()) {
            let l = &self.own.placed.links[link];
            if *m == Motion::Ball {
                // from the axes of the drawing to those of the zero position
                let [real, x1, x2, x3] = [0, 1, 2, 3].map(|i| x.position[iq + i]);
                let [x1, x2, x3] = p.on_child.apply(Vec3([x1, x2, x3])).0;
                let mut turn = Quaternion([real, x1, x2, x3]);
                let mut w = p.on_child.apply(Vec3([0, 1, 2].map(|i| x.velocity[iv + i])));
                if p.reversed {
                    turn = Quaternion([turn.0[0], -turn.0[1], -turn.0[2], -turn.0[3]]);
                    w = -turn.matrix().apply_transposed(w);
                }
                q2[l.q..l.q + 4].copy_from_slice(&turn.0);
                v2[l.v..l.v + 3].copy_from_slice(&w.0);
            } else {
                q2[l.q] = x.position[iq];
                v2[l.v] = x.velocity[iv];
            }
            iq += m.coordinates();
            iv += m.velocities();
        }
    }

    /// Coordinates of a floating body: displacement of its centre of mass and rotation, from the drawing.
    fn transfer_floating(
        &self,
        body: usize,
        (from, turned): (&Model, &[f64]),
        s: &ModelScratch,
        q: &mut [f64],
        v: &mut [f64],
    ) {
        let b = &self.spec.bodies[body];
        let x = from.body_state(body, s);
        let drawn = Vec3(b.position) + Mat3(b.orientation).apply(Vec3(b.com));
        let arm = x.rotation.apply(Vec3(b.com));
        let inside = &self.own.placed.basis;
        let turn = x.rotation.mul(&Mat3(b.orientation).transpose());
        self.place_floating(body, x.position + arm - drawn, &turn, turned[from.own.placed.bodies[body].link], q);
        let rate = inside.apply(x.velocity + x.angular_velocity.cross(arm));
        let turn = inside.mul(&turn).mul(&inside.transpose());
        let spin = inside.apply(x.angular_velocity);
        let mut link = self.own.placed.bodies[body].link;
        while link != 0 {
            let l = &self.own.placed.links[link];
            match l.motion {
                Motion::Ball => v[l.v..l.v + 3].copy_from_slice(&turn.apply_transposed(spin).0),
                Motion::Turn(_) => v[l.v] = spin.0[2],
                Motion::Slide(a) => v[l.v] = a.dot(rate),
            }
            link = l.parent;
        }
    }

    /// Coordinates of a floating body whose centre of mass was displaced from the drawing, and that was rotated; in a
    /// plane by the angle nearest to the one that was `counted`.
    pub(crate) fn place_floating(
        &self,
        body: usize,
        displaced: Vec3<f64>,
        turn: &Mat3<f64>,
        counted: f64,
        q: &mut [f64],
    ) {
        let inside = &self.own.placed.basis;
        let (moved, turn) = (inside.apply(displaced), inside.mul(turn).mul(&inside.transpose()));
        let mut link = self.own.placed.bodies[body].link;
        while link != 0 {
            let l = &self.own.placed.links[link];
            match l.motion {
                Motion::Ball => q[l.q..l.q + 4].copy_from_slice(&Quaternion::from_matrix(&turn).0),
                Motion::Turn(_) => {
                    let angle = turn.0[1][0].atan2(turn.0[0][0]);
                    q[l.q] = angle + ((counted - angle) / TAU).round() * TAU;
                }
                Motion::Slide(a) => q[l.q] = a.dot(moved),
            }
            link = l.parent;
        }
    }
}
