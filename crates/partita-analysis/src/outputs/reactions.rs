//! Reactions of joints along a motion.

use super::chunk_of;
use super::rows::{tables, Rows, Watch};
use super::{Forces, States};
use partita_model::model::ModelScratch;
use partita_model::Model;
use partita_system::{ConstrainedSystem, SystemError};

/// Width of the axes of a joint (row by row) in the tables of this module.
pub const JOINT_AXES: usize = 9;

/// Force, moment, efforts of the drives and axes of one joint, for a motion with its accelerations and multipliers.
///
/// # Errors
/// What a user's function raises on the bodies that the joint holds, and those of `watch`.
pub fn reaction<E: Send + From<SystemError>>(
    model: &Model,
    states: &States,
    forces: &Forces,
    j: usize,
    watch: Watch<E>,
) -> Result<Vec<Vec<f64>>, E> {
    let part = model.part_of_reaction(j);
    let freedoms = model.placed.joints[j].shape.freedoms();
    let row = |i: usize, s: &mut ModelScratch, rows: &mut Rows| {
        let ((t, q, v), (vdot, lambda)) = (states.at(model, i), forces.at(model, i));
        let w = model.reaction_of(j, &part, t, q, v, vdot, lambda, s)?;
        rows.row(0, i).copy_from_slice(&w.force.0);
        rows.row(1, i).copy_from_slice(&w.moment.0);
        rows.row(2, i).copy_from_slice(&model.drive_of(j, lambda));
        rows.row(3, i).copy_from_slice(model.joint_frame(j, s).0.as_flattened());
        Ok(())
    };
    tables(states.len(), &[3, 3, freedoms, JOINT_AXES], chunk_of(model), || model.scratch(), row, watch)
}

/// The same of all joints side by side, and the Newton-Euler residual over the largest force.
///
/// # Errors
/// What a user's function raises, and those of `watch`.
pub fn reactions<E: Send + From<SystemError>>(
    model: &Model,
    states: &States,
    forces: &Forces,
    watch: Watch<E>,
) -> Result<Vec<Vec<f64>>, E> {
    let (whole, nj) = (model.whole(), model.placed.joints.len());
    let freedoms: usize = model.placed.joints.iter().map(|p| p.shape.freedoms()).sum();
    let row = |i: usize, s: &mut ModelScratch, rows: &mut Rows| {
        let ((t, q, v), (vdot, lambda)) = (states.at(model, i), forces.at(model, i));
        let r = model.reactions_of(&whole, t, q, v, vdot, lambda, s)?;
        let mut drives = rows.row(2, i).iter_mut();
        for (to, from) in drives.by_ref().zip(r.drives.iter().flatten()) {
            *to = *from;
        }
        for (j, w) in r.joints.iter().enumerate() {
            rows.row(0, i)[3 * j..][..3].copy_from_slice(&w.force.0);
            rows.row(1, i)[3 * j..][..3].copy_from_slice(&w.moment.0);
            rows.row(3, i)[9 * j..][..9].copy_from_slice(model.joint_frame(j, s).0.as_flattened());
        }
        rows.row(4, i)[0] = r.residual;
        Ok(())
    };
    let widths = [3 * nj, 3 * nj, freedoms, JOINT_AXES * nj, 1];
    tables(states.len(), &widths, chunk_of(model), || model.scratch(), row, watch)
}

/// Forces and moments of all joints side by side, by augmented joint coordinates.
///
/// # Errors
/// What a user's function raises, and those of `watch`.
pub fn augmented<E: Send + From<SystemError>>(
    model: &Model,
    states: &States,
    forces: &Forces,
    watch: Watch<E>,
) -> Result<Vec<Vec<f64>>, E> {
    let nj = model.placed.joints.len();
    let row = |i: usize, s: &mut ModelScratch, rows: &mut Rows| {
        let ((t, q, v), (vdot, lambda)) = (states.at(model, i), forces.at(model, i));
        for (j, w) in model.augmented_reactions(t, q, v, vdot, lambda, s)?.iter().enumerate() {
            rows.row(0, i)[3 * j..][..3].copy_from_slice(&w.force.0);
            rows.row(1, i)[3 * j..][..3].copy_from_slice(&w.moment.0);
        }
        Ok(())
    };
    tables(states.len(), &[3 * nj, 3 * nj], chunk_of(model), || model.scratch(), row, watch)
}
