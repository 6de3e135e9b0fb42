//! Geometric error of a drawing, joint by joint.

use crate::reason::names;
use crate::stress::Pose;
use partita_math::spatial::Vec3;
use partita_math::tolerance;
use partita_model::joint::Motion;
use partita_model::spec::LARGEST_TOLERANCE;
use partita_model::{BlockDecision, Geometry, Model};
use std::collections::BTreeSet;

/// Of the joints that are off, those off by more are named. Scale: fraction of the worst. Reason: the others follow
/// from it.
const NAMED_ERROR: f64 = 0.5;
/// Geometric errors of a drawing.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct GeometricError {
    /// In sentences.
    pub(crate) sentences: Vec<String>,
    /// The largest change of a joint frame that makes it fit (rad, fractions of lengths).
    pub(crate) size: f64,
    /// Degrees of freedom with the change, where it exceeds the tolerance and is not made.
    pub(crate) repaired_mobility: Option<usize>,
}

/// What was repaired in a drawing, or which change beyond its tolerance would make the mechanism movable.
pub(crate) fn of_drawing(model: &Model) -> GeometricError {
    let own = model.geometry();
    if own.geometric_error() > 0.0 {
        let drawn = model.as_drawn();
        let sentences = drawn.as_ref().map_or_else(Vec::new, |drawn| sentences(drawn, own));
        return GeometricError { sentences, size: own.geometric_error(), repaired_mobility: None };
    }
    let dof = own.dof.unwrap_or(0);
    let wide = model.geometry_within(LARGEST_TOLERANCE);
    match wide.dof.filter(|x| *x > dof && wide.geometric_error() > 0.0) {
        Some(repaired_mobility) => GeometricError {
            sentences: sentences(model, &wide),
            size: wide.geometric_error(),
            repaired_mobility: Some(repaired_mobility),
        },
        None => GeometricError::default(),
    }
}

/// One sentence for each loop that does not fit.
fn sentences(drawn: &Model, geometry: &Geometry) -> Vec<String> {
    let mut found: Vec<String> = Vec::new();
    let Ok(space) = drawn.in_space() else { return found };
    let pose = Pose::new(&space, 0.0, &space.initial());
    for block in geometry.blocks.iter().filter(|x| x.verdict == BlockDecision::Repaired) {
        let joints: BTreeSet<usize> = block.joints.iter().copied().collect();
        let mut all = out_of_parallel(&pose, &joints);
        let worst = block.changed.iter().zip(&block.joints).max_by(|a, b| a.0.total_cmp(b.0));
        if let Some((_, &joint)) =
            worst.filter(|_| all.is_empty() || tolerance::CLEARLY * block.moved.0 > block.length * block.moved.1)
        {
            all.push(format!(
                "the loops would close with joint frames moved by up to {:.2e} m and turned by up to {}, most at {}",
                block.moved.0,
                degrees(block.moved.1),
                drawn.spec.joints[joint].name
            ));
        }
        all.retain(|x| !found.contains(x));
        found.extend(all);
    }
    found
}

/// An angle in degrees, as drawings give it.
fn degrees(angle: f64) -> String {
    let angle = angle.to_degrees();
    match format!("{angle:.3}") {
        none if none == "0.000" => format!("{angle:.1e} deg"),
        plain => format!("{plain} deg"),
    }
}

/// Axes of rotation that were intended to be parallel, and slides perpendicular to them; or slides alone.
fn out_of_parallel(pose: &Pose, joints: &BTreeSet<usize>) -> Vec<String> {
    let model = pose.model;
    let name = |j: usize| model.spec.joints[j].name.as_str();
    let mut turns: Vec<(usize, Vec3<f64>)> = Vec::new();
    let mut slides: Vec<(usize, Vec3<f64>)> = Vec::new();
    for &j in joints {
        let p = &model.zero_position().joints[j];
        let rot = |node: usize, on| pose.tree.links[model.zero_position().link_of(node)].rot.mul(on);
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
    if off.iter().any(|x| x.1 > tolerance::INTENDED_PARALLEL * LARGEST_TOLERANCE) {
        return Vec::new();
    }
    let across: Vec<(usize, f64)> = slides.iter().map(|&(j, a)| (j, a.dot(normal).abs().min(1.0).asin())).collect();
    let worst = |all: &[(usize, f64)]| all.iter().fold(0.0, |m: f64, x| m.max(x.1));
    let mut found = Vec::new();
    let mut say = |all: &[(usize, f64)], words: &str, than: &[(usize, f64)]| {
        let top = worst(all);
        if top <= tolerance::SOLUTION_ROUNDING || top > tolerance::INTENDED_PARALLEL * LARGEST_TOLERANCE {
            return;
        }
        let mut which: Vec<usize> = all.iter().filter(|x| x.1 >= NAMED_ERROR * top).map(|x| x.0).collect();
        which.dedup();
        let mut others: Vec<&str> = than.iter().map(|x| x.0).filter(|j| !which.contains(j)).map(name).collect();
        others.dedup();
        let verb = if which.len() == 1 { "is" } else { "are" };
        let which: Vec<&str> = which.into_iter().map(name).collect();
        found.push(format!("{} {verb} {} {words} {}", names(&which), degrees(top), names(&others)));
    };
    say(&off, "out of parallel with", &off);
    say(&across, "out of the plane normal to the axes of", &off);
    found
}
