//! Closing the loops of a mechanism from a drawing, in any coordinates.

use partita_model::zero_position::Coordinates;
use partita_model::Model;
use partita_system::kinematics::assembly::{self, Assembly};
use partita_system::prelude::*;
use partita_system::SystemError;

/// The nearest position to q in which the loops close; `locked` velocities keep their coordinates.                        (S3)
///
/// Free bodies may converge to an open position where the joints of the same drawing would close; then the joints are
/// kept closed during the iteration.
///
/// # Errors
/// As [`assembly::close`].
pub fn closed(
    model: &Model,
    t: f64,
    q: &mut Vec<f64>,
    tolerance: f64,
    locked: &[usize],
) -> Result<Assembly, SystemError> {
    let drawn = q.clone();
    let e = match assembly::close(model, t, q, tolerance, locked) {
        Err(e @ (SystemError::Assembly { .. } | SystemError::Lengths { .. })) => e,
        other => return other,
    };
    if model.coordinates() == Coordinates::Relative || !locked.is_empty() {
        return Err(e);
    }
    let Some(mut found) = by_joints(model, t, &drawn, tolerance) else { return Err(e) };
    let report = assembly::close(model, t, &mut found, tolerance, &[]).map_err(|_| e)?;
    *q = found;
    Ok(report)
}

fn by_joints(model: &Model, t: f64, drawn: &[f64], tolerance: f64) -> Option<Vec<f64>> {
    let twin = model.in_coordinates(Coordinates::Relative).ok()?;
    let mut q = twin.transferred(model, drawn, &vec![0.0; model.size().nv]).0;
    assembly::close(&twin, t, &mut q, tolerance, &[]).ok()?;
    Some(model.transferred(&twin, &q, &vec![0.0; twin.size().nv]).0)
}
