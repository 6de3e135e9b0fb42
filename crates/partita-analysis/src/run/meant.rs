//! Runs of drawings that misfit within their tolerance: of the mechanism as it was meant, its loops closed to the last digit.

use partita_model::Model;
use partita_system::kinematics::assembly;
use partita_system::reduction::{largest, Reduction};
use partita_system::{ConstrainedSystem, SystemError};

/// A run's mechanism whose drawing fits, in place of one whose drawing misfits.
pub struct Stand {
    /// The mechanism.
    pub model: Model,
    /// Coordinates next to those of the start.
    pub q: Vec<f64>,
    /// What was changed, in a sentence.
    pub note: String,
}

impl Stand {
    /// The mechanism that was meant, standing next to q; None where the drawing fits, or where it stays as it is drawn: it is
    /// then bridged, or it is another mechanism.
    pub fn of(model: &Model, t: f64, q: &[f64]) -> Option<Self> {
        let meant = model.as_meant(t, q).ok().flatten()?;
        let mut there = q.to_vec();
        assembly::close(&meant.model, t, &mut there, assembly::CLOSED, &[]).ok()?;
        let joint = model.spec.joints.get(meant.joint).map_or("", |j| &j.name);
        let note = format!(
            "the run is that of the nearest drawing found that fits: joints were moved by up to {:.1e} m and turned by up to \
             {:.1e} deg, most \"{joint}\"",
            meant.shift,
            meant.turn.to_degrees()
        );
        Some(Self { model: meant.model, q: there, note })
    }
}

/// The largest part of its size by which a closing of the drawing stands open where the mechanism goes.
///
/// # Errors
/// Where the drawing cannot be evaluated there.
pub fn misfit<'x>(drawn: &Model, places: impl Iterator<Item = (f64, &'x [f64])>) -> Result<f64, SystemError> {
    let mut r = Reduction::geometric(drawn, 0);
    let mut most = 0.0f64;
    for (t, q) in places {
        r.position(t, q)?;
        r.refresh_scales(t, q)?;
        let closings = (0..r.phi.len()).filter(|&i| !drawn.row_is_drive(i));
        most = most.max(largest(closings.map(|i| r.phi[i] / r.row_size(i))));
    }
    Ok(most)
}
