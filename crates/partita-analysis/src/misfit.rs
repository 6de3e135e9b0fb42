//! What of a drawing does not fit, joint by joint, in the words of the drawing.

use crate::geometry::Geometry;
use crate::reason::names;
use crate::stress::{Pose, Stress};
use partita_math::spatial::Vec3;
use partita_model::joint::Motion;
use partita_system::start::Start;
use partita_system::ConstrainedSystem;
use std::collections::BTreeSet;

/// Axes this near to parallel were meant to be parallel (rad): ten times the largest drawing tolerance.
const MEANT_PARALLEL: f64 = 0.1;
/// Angles below this are round-off of the drawing itself.
const ROUND_OFF: f64 = 1e-13;
/// Of those that are off, the ones that are off by at least this part of the worst are named.
const NAMED: f64 = 0.5;

/// One sentence for each loop that does not fit, the worst first in each; and one that says what the closings open by.
pub(crate) fn sentences(system: &Geometry, pose: &Pose, start: &Start, stresses: &[Stress]) -> Vec<String> {
    let mut loops: Vec<BTreeSet<usize>> = Vec::new();
    for (stress, row) in stresses.iter().zip(&start.dropped) {
        if start.near.iter().any(|x| x.0 == *row) {
            let joints: BTreeSet<usize> = stress.joints.iter().map(|x| x.0).collect();
            if !joints.is_empty() && !loops.contains(&joints) {
                loops.push(joints);
            }
        }
    }
    // a loop within another one says the same of fewer joints
    let all = loops.clone();
    loops.retain(|x| !all.iter().any(|y| x != y && x.is_subset(y)));
    let mut said: Vec<String> = Vec::new();
    for joints in &loops {
        for sentence in out_of_parallel(pose, joints) {
            if !said.contains(&sentence) {
                said.push(sentence);
            }
        }
    }
    let worst = start.near.iter().max_by(|a, b| a.1.total_cmp(&b.1));
    if let Some(&(row, part)) = worst.filter(|x| x.1 > 0.0) {
        let by = part * system.row_reach(row).unwrap_or(1.0);
        let by = if system.row_is_angle(row) { degrees(by) } else { format!("{by:.2e} m") };
        said.push(format!(
            "{} opens by {by} ({part:.1e} of its size) when the mechanism is moved by a tenth of a radian or of its length",
            system.row_words(row)
        ));
    }
    said
}

/// An angle as people read it off a drawing.
fn degrees(angle: f64) -> String {
    let angle = angle.to_degrees();
    if angle >= 1e-3 {
        format!("{angle:.3} deg")
    } else {
        format!("{angle:.1e} deg")
    }
}

/// Turning axes that were meant to be parallel, and slides across them; or slides alone.
fn out_of_parallel(pose: &Pose, joints: &BTreeSet<usize>) -> Vec<String> {
    let model = pose.model;
    let name = |j: usize| model.spec.joints[j].name.as_str();
    let mut turns: Vec<(usize, Vec3<f64>)> = Vec::new();
    let mut slides: Vec<(usize, Vec3<f64>)> = Vec::new();
    for &j in joints {
        let p = &model.placed.joints[j];
        let rot = |node: usize, on| pose.tree.links[model.placed.link_of(node)].rot.mul(on);
        let (on_parent, on_child) = (rot(p.parent, &p.on_parent), rot(p.child, &p.on_child));
        let mut first = true;
        for m in &p.shape.motions {
            match m {
                Motion::Turn(a) => {
                    turns.push((j, if first { on_parent.apply(*a) } else { on_child.apply(*a) }));
                    first = false;
                }
                Motion::Slide(a) => slides.push((j, on_parent.apply(*a))),
                Motion::Ball => return Vec::new(),
            }
        }
        // the drawing may hold two axes of one joint that differ
        if let ([Motion::Turn(a)], true) = (p.shape.motions.as_slice(), p.links.is_none()) {
            turns.push((j, on_child.apply(*a)));
        }
    }
    if turns.is_empty() {
        std::mem::swap(&mut turns, &mut slides); // guides of one carriage
    }
    let angle = |a: Vec3<f64>, b: Vec3<f64>| a.cross(b).norm().atan2(a.dot(b).abs());
    // the axis that the others are nearest to
    let sum = |x: &(usize, Vec3<f64>)| turns.iter().map(|y| angle(x.1, y.1)).sum::<f64>();
    let Some(&(_, normal)) = turns.iter().min_by(|x, y| sum(x).total_cmp(&sum(y))) else { return Vec::new() };
    let off: Vec<(usize, f64)> = turns.iter().map(|&(j, a)| (j, angle(a, normal))).collect();
    if off.iter().any(|x| x.1 > MEANT_PARALLEL) {
        return Vec::new();
    }
    let across: Vec<(usize, f64)> = slides.iter().map(|&(j, a)| (j, a.dot(normal).abs().min(1.0).asin())).collect();
    let worst = |all: &[(usize, f64)]| all.iter().fold(0.0, |m: f64, x| m.max(x.1));
    let mut said = Vec::new();
    let mut say = |all: &[(usize, f64)], words: &str, than: &[(usize, f64)]| {
        let top = worst(all);
        if top <= ROUND_OFF || top > MEANT_PARALLEL {
            return;
        }
        let mut which: Vec<usize> = all.iter().filter(|x| x.1 >= NAMED * top).map(|x| x.0).collect();
        which.dedup();
        let mut others: Vec<&str> = than.iter().map(|x| x.0).filter(|j| !which.contains(j)).map(name).collect();
        others.dedup();
        let verb = if which.len() == 1 { "is" } else { "are" };
        let which: Vec<&str> = which.into_iter().map(name).collect();
        said.push(format!("{} {verb} {} {words} {}", names(&which), degrees(top), names(&others)));
    };
    say(&off, "out of parallel with", &off);
    say(&across, "out of the plane across the axes of", &off);
    said
}
