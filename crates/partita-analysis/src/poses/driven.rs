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

/// Intervals of Simpson's rule by which a prescribed velocity is integrated. Reason: positions are printed with six
/// decimals.
const INTERVALS: usize = 64;

/// The reason why a run that stopped at `t` cannot continue to `until` as driven, from the closed position q at the
/// time `since` shortly before; `None` if the joints allow it, or if no drive prescribes the motion of a joint.
pub fn driven_beyond(model: &Model, (since, q): (f64, &[f64]), t: f64, until: f64) -> Option<String> {
    let driven: Vec<Driven> = model.drives().iter().filter_map(|d| asked(model, d)).collect();
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
        // a row of velocities is the velocity of the joint minus its prescribed value, which is -a
        let mut moved = vec![0.0; driven.len()];
        let h = (later - since) / INTERVALS as f64;
        for i in 0..=INTERVALS {
            model.position(since + h * i as f64, q, &mut s, &mut phi, &mut c, &mut a).ok()?;
            let weight = h / 3.0 * if i == 0 || i == INTERVALS { 1.0 } else { 2.0 + 2.0 * (i % 2) as f64 };
            moved.iter_mut().zip(&driven).for_each(|(moved, d)| *moved -= weight * a[d.row]);
        }
        model.position(later, q, &mut s, &mut phi, &mut c, &mut a).ok()?;
        let mut targets = Vec::with_capacity(driven.len());
        for (d, moved) in driven.iter().zip(moved) {
            // a row of positions is the coordinate of the joint minus its prescribed value
            let missing = if d.level == Level::Position { -phi[d.row] } else { moved };
            let wanted = Target::new(model, &d.goal, &d.name).ok()?.value(model, q, &rest, &mut s, 0.0) + missing;
            targets.push((Target::new(&twin, &d.goal, &d.name).ok()?, wanted));
        }
        let ask = Ask { levels: vec![targets], tolerance: tolerance::CLOSED, ..Ask::default() };
        if let Err(SystemError::Targets { message, .. }) = one(&twin, later, &from, &ask) {
            return Some(message);
        }
    }
    None
}

/// A drive of a joint.
struct Driven {
    row: usize,
    level: Level,
    goal: Goal,
    name: String,
}

/// What a drive of a joint's position or velocity prescribes.
fn asked(model: &Model, d: &DriveRow) -> Option<Driven> {
    let (joint, velocity) = d.joint?;
    let shape = model.shape(joint);
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
    let goal = Goal::Joint { joint, coordinate: coordinate + velocity - first };
    Some(Driven { row: d.row, level: d.level, goal, name })
}
