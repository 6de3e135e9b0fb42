//! Drives that exceed what the joints allow: which joint, at which value, and by how much.

use super::goal::{Goal, Target};
use super::one::{one, Ask};
use partita_math::tolerance;
use partita_model::evaluator::DriveRow;
use partita_model::spec::Level;
use partita_model::Model;
use partita_system::prelude::*;
use partita_system::SystemError;

/// Number of times at which the driven motion is evaluated. Unit: fraction of the time that was left. Reason: the first
/// time that cannot be reached locates the end of the motion; far beyond it the motion may exist again.
const AHEAD: [f64; 4] = [0.01, 0.05, 0.2, 1.0];

/// The reason why a run that stopped at `t` cannot continue to `until` as driven, from the closed position q shortly
/// before; `None` if the joints allow it, or if no drive prescribes a joint position.
pub fn driven_beyond(model: &Model, t: f64, q: &[f64], until: f64) -> Option<String> {
    let driven: Vec<(usize, Goal, String)> = model.drives.iter().filter_map(|d| asked(model, d)).collect();
    if driven.is_empty() || until <= t {
        return None;
    }
    let twin = model.without_drives().ok()?;
    let size = model.size();
    let rest = vec![0.0; size.nv];
    let (from, _) = twin.transferred(model, q, &rest);
    let (mut s, mut phi) = (model.scratch(), vec![0.0; size.holonomic]);
    let (mut c, mut a) = (vec![0.0; model.pattern().col_idx.len()], vec![0.0; size.rows]);
    for part in AHEAD {
        let later = t + part * (until - t);
        model.position(later, q, &mut s, &mut phi, &mut c, &mut a).ok()?;
        let mut targets = Vec::with_capacity(driven.len());
        for (row, goal, name) in &driven {
            // the row is the coordinate of the joint minus its prescribed value
            let wanted = Target::new(model, goal, name).ok()?.value(model, q, &rest, &mut s, 0.0) - phi[*row];
            targets.push((Target::new(&twin, goal, name).ok()?, wanted));
        }
        let ask = Ask { levels: vec![targets], tolerance: tolerance::CLOSED, ..Ask::default() };
        if let Err(SystemError::Targets { message, .. }) = one(&twin, later, &from, &ask) {
            return Some(message);
        }
    }
    None
}

/// Row, goal and name of a drive of a joint's position.
fn asked(model: &Model, d: &DriveRow) -> Option<(usize, Goal, String)> {
    let (joint, velocity) = d.joint.filter(|_| d.level == Level::Position)?;
    let shape = &model.placed.joints[joint].shape;
    let (mut coordinate, mut first) = (0, 0);
    for motion in &shape.motions {
        if first + motion.velocities() > velocity {
            break;
        }
        first += motion.velocities();
        coordinate += motion.coordinates();
    }
    let owner = &model.spec.joints[joint].name;
    let name = if shape.motions.len() == 1 { owner.clone() } else { format!("{owner}.{}", shape.names[velocity]) };
    Some((d.row, Goal::Joint { joint, coordinate: coordinate + velocity - first }, name))
}
