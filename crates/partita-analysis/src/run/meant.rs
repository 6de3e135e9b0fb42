//! Runs of drawings that misfit within their tolerance: of the mechanism as it was meant, its loops closed to the last digit.

use partita_model::Model;
use partita_system::kinematics::{assembly, velocity::near_with_rates};
use partita_system::reduction::{largest, Reduction};
use partita_system::{start, ConstrainedSystem, SystemError};

/// A start is next to one that fits when it moves by no more than so many tolerances.
const NEAR: f64 = 30.0;

/// A run's mechanism whose drawing fits, in place of one whose drawing misfits.
pub struct Stand {
    /// The mechanism.
    pub model: Model,
    /// Coordinates next to those of the start.
    pub q: Vec<f64>,
    /// Velocities next to those of the start.
    pub v: Vec<f64>,
    /// What was changed, in a sentence.
    pub note: String,
}

impl Stand {
    /// The mechanism that was meant, standing next to q and moving next to v; None where the
    /// drawing fits, or where it stays as it is drawn: it is then bridged, or it is another mechanism.
    pub fn of(model: &Model, t: f64, (q, v): (&[f64], &[f64])) -> Option<Self> {
        let meant = model.as_meant(t, q).ok().flatten()?;
        let system = &meant.model;
        let mut there = q.to_vec();
        assembly::close(system, t, &mut there, assembly::CLOSED, &[]).ok()?;
        // what stood elsewhere, or moved otherwise, is told by the run of the drawing
        let near = NEAR * system.drawing_tolerance();
        let reach = |c: usize| system.velocity_of_coordinate(c).map_or(1.0, |v| system.reach(v));
        if q.iter().zip(&there).enumerate().any(|(c, (x, y))| (x - y).abs() > near * reach(c)) {
            return None;
        }
        let mut r = Reduction::new(system, start::analyse(system, t, &there).ok()?.rank);
        start::choose_partition(&mut r, t, &there, None, None).ok()?;
        let moving = near_with_rates(&mut r, t, &there, v, &[]).ok()?;
        let speed = |v: &[f64]| v.iter().enumerate().fold(0.0, |m: f64, (i, v)| m.max(v.abs() / system.reach(i)));
        let off: Vec<f64> = v.iter().zip(&moving).map(|(x, y)| x - y).collect();
        if speed(&off) > near * speed(v) {
            return None;
        }
        let joint = model.spec.joints.get(meant.joint).map_or("", |j| &j.name);
        let note = format!(
            "the run is that of the nearest drawing found that fits: joints were moved by up to {:.1e} m and turned by up to \
             {:.1e} deg, most \"{joint}\"",
            meant.shift,
            meant.turn.to_degrees()
        );
        drop(r);
        Some(Self { model: meant.model, q: there, v: moving, note })
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
