//! Outputs of a mechanism along a motion: bodies, joints, reactions, energies. Each is computed on request, at all
//! outputs at once, from the part of the mechanism on which it depends.

mod checks;
mod motion;
mod reactions;
mod rows;

pub use checks::checks;
pub use motion::{bodies, body_accelerations, counted_potential, energies, joint_accelerations, joints, load};
pub use motion::{BODY, JOINT_POINT};
pub use reactions::{augmented, reaction, reactions, shares, JOINT_AXES};
pub use rows::{tables, tables_on, whole, Rows, Watch};

use partita_model::Model;
use partita_system::prelude::*;

/// User functions are called in order, on one thread.
pub(crate) fn chunk_of(model: &Model) -> usize {
    if model.equations().calls_functions() {
        usize::MAX
    } else {
        1
    }
}

/// t, q and v at the outputs, row by row.
#[derive(Clone, Copy, Debug)]
pub struct States<'a> {
    /// Times.
    pub t: &'a [f64],
    /// Coordinates.
    pub q: &'a [f64],
    /// Velocities.
    pub v: &'a [f64],
}

/// Accelerations and multipliers at the outputs, row by row.
#[derive(Clone, Copy, Debug)]
pub struct Forces<'a> {
    /// v'.
    pub vdot: &'a [f64],
    /// λ.
    pub multipliers: &'a [f64],
}

impl<'a> States<'a> {
    /// Number of outputs.
    pub fn len(&self) -> usize {
        self.t.len()
    }
    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.t.is_empty()
    }
    /// t, q and v of output i.
    pub fn at(&self, model: &Model, i: usize) -> (f64, &'a [f64], &'a [f64]) {
        let size = model.size();
        (self.t[i], &self.q[i * size.nq..][..size.nq], &self.v[i * size.nv..][..size.nv])
    }
}

impl<'a> Forces<'a> {
    /// v' and λ of output i.
    pub fn at(&self, model: &Model, i: usize) -> (&'a [f64], &'a [f64]) {
        let size = model.size();
        (&self.vdot[i * size.nv..][..size.nv], &self.multipliers[i * size.rows..][..size.rows])
    }
}
