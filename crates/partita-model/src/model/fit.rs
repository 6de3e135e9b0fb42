//! Whether a drawing fits: asked of the bodies, each by its own six coordinates, and all joints between them.
//!
//! Which joints close loops is a matter of the tree, and with it what a row is worth. Between free bodies every joint is a
//! closing, every point is measured in the same length, and every body by its centre of mass: the verdict is the same in any
//! coordinates, axes, units and order.

use super::Model;
use crate::place::Coordinates;
use partita_math::spatial::{Mat3, Quaternion};
use partita_system::drawing::judged;
use partita_system::{Fit, SystemError};

impl Model {
    /// The same mechanism as free bodies between joints, in space; and its coordinates where this one has q.
    pub(super) fn by_bodies(&self, q: &[f64]) -> Option<(Self, Vec<f64>)> {
        // what could be compiled in one kind of coordinates and not in the other is judged as it stands
        let twin =
            Self::build((*self.spec).clone(), self.callers.functions.clone(), Coordinates::Absolute, false).ok()?;
        let mut s = self.full.scratch();
        self.full.poses(q, &mut s);
        let out = self.placed.basis;
        let mut there = twin.initial();
        for (own, free) in self.placed.bodies.iter().zip(&twin.placed.bodies) {
            let ball = twin.placed.links[free.link].q;
            let turned: Mat3<f64> = out.transpose().mul(&s.links[own.link].rot).mul(&own.rot);
            let com = self.full.place(own.link, &s) + s.links[own.link].rot.apply(own.com - self.reference()[own.link]);
            let turn = turned.mul(&free.rot.transpose());
            let reference = twin.reference()[free.link];
            let shift = out.apply_transposed(com) + turn.apply(reference - free.com) - reference;
            there.get_mut(ball.checked_sub(3)?..ball)?.copy_from_slice(&shift.0);
            there.get_mut(ball..ball + 4)?.copy_from_slice(&Quaternion::from_matrix(&turn).0);
        }
        Some((twin, there))
    }

    pub(super) fn judged_by_bodies(&self, t: f64, q: &[f64], tolerance: f64) -> Result<Option<Fit>, SystemError> {
        if self.coordinates == Coordinates::Absolute && !self.is_planar() {
            return judged(self, t, q, tolerance).map(|x| Some(x.unwrap_or(self.exact())));
        }
        let Some((twin, there)) = self.by_bodies(q) else { return Ok(None) };
        judged(&twin, t, &there, tolerance).map(|x| Some(x.unwrap_or(self.exact())))
    }

    /// The verdict on a drawing that fits.
    fn exact(&self) -> Fit {
        Fit { freedoms: 0, drawn: 0, misfit: 0.0, within: true }
    }
}
