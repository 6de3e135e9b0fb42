//! Replacements of joints after which nothing is redundant and no new motion exists.
//!
//! Releasing a component of a joint removes a self-stress if some self-stress loads it; otherwise it adds a motion. So
//! as many components must be released as there are self-stresses, and the self-stresses must be independent in them.

use crate::error::AnalysisError;
use crate::geometry::{in_space, Geometry};
use crate::mobility::mobility;
use crate::stress::{stresses, Pose};
use partita_math::sorting::sort_by_key;
use partita_math::tolerance;
use partita_model::spec::{Coupling, Force, Joint, JointKind, Measure, Spec};
use partita_model::value::NoFunctions;
use partita_model::zero_position::Coordinates;
use partita_model::Model;
use partita_system::prelude::*;
use partita_system::start::analyse;
use serde::Serialize;
use std::collections::HashSet;
use std::sync::Arc;

/// Number of self-stresses up to which remedies are searched; beyond, the remedy is the same for each loop.
const MOST: usize = 150;
/// Up to this number of self-stresses all choices of few joints are tried, fewest joints first.
const FEW: usize = 6;
/// Maximum number of joints replaced in that search, and of joints among which it chooses.
const REPLACED: usize = 3;
const AMONG: usize = 16;

/// A joint to be replaced by another kind.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Remedy {
    /// Name of the joint.
    pub joint: String,
    /// Its kind, in words.
    pub is: String,
    /// What to put in its place, in words.
    pub by: String,
}

/// One replacement that releases components of a joint.
struct Replacement {
    joint: usize,
    kind: JointKind,
    by: &'static str,
    /// Components of force and moment in joint axes that it releases.
    frees: Vec<usize>,
    usual: bool,
}

/// Possible replacements of a joint.
fn replacements(kind: JointKind, joint: usize) -> Vec<Replacement> {
    let replacement = |kind, by, frees: &[usize], usual| Replacement { joint, kind, by, frees: frees.to_vec(), usual };
    let guide = "a ball joint that slides along the axis";
    match kind {
        JointKind::Revolute => vec![
            replacement(JointKind::Spherical, "a ball joint", &[3, 4], true),
            replacement(JointKind::Cylindrical, "a cylindrical joint", &[2], true),
            replacement(JointKind::Generic, guide, &[2, 3, 4], false),
        ],
        JointKind::Prismatic => vec![
            replacement(JointKind::Cylindrical, "a cylindrical joint", &[5], true),
            replacement(JointKind::Generic, guide, &[3, 4, 5], false),
        ],
        JointKind::Cylindrical => vec![replacement(JointKind::Generic, guide, &[3, 4], false)],
        JointKind::Universal => vec![replacement(JointKind::Spherical, "a ball joint", &[5], true)],
        _ => vec![],
    }
}

/// Common names of the kinds.
pub(crate) fn word(kind: JointKind) -> &'static str {
    match kind {
        JointKind::Revolute => "hinge",
        JointKind::Prismatic => "slide",
        JointKind::Cylindrical => "cylindrical joint",
        JointKind::Universal => "universal joint",
        JointKind::Spherical => "ball joint",
        JointKind::Planar => "planar joint",
        JointKind::Fixed => "weld",
        JointKind::Free => "free joint",
        JointKind::Generic => "joint",
        other => other.words(),
    }
}

/// Orthonormal columns that grow while new ones are independent of them.
#[derive(Clone, Default)]
struct Base(Vec<Vec<f64>>);

impl Base {
    /// Takes all columns, or none where one depends on the others.
    fn take<'c>(&mut self, columns: impl Iterator<Item = &'c Vec<f64>>) -> bool {
        let before = self.0.len();
        for column in columns {
            let mut rest = column.clone();
            for _ in 0..2 {
                for b in &self.0 {
                    let along: f64 = b.iter().zip(&rest).map(|(x, y)| x * y).sum();
                    rest.iter_mut().zip(b).for_each(|(x, b)| *x -= along * b);
                }
            }
            let size = rest.iter().map(|x| x * x).sum::<f64>().sqrt();
            if size <= tolerance::DEPENDENT {
                self.0.truncate(before);
                return false;
            }
            rest.iter_mut().for_each(|x| *x /= size);
            self.0.push(rest);
        }
        true
    }
}

/// Replacements that keep the mobility and leave nothing redundant, verified on the drawing; none where none was found.
///
/// # Errors
/// The errors of [`mobility`].
pub fn remedies(model: &Model, t: f64, q: &[f64]) -> Result<Vec<Remedy>, AnalysisError> {
    let (twin, q) = in_space(model, q)?;
    let system = Geometry::new(&twin, false);
    let start = analyse(&system, t, &q)?;
    let count = start.dropped.len();
    if count == 0 || count > MOST {
        return Ok(Vec::new());
    }
    let found = stresses(&system, &Pose::new(&twin, t, &q), &start, t, &q)?;
    let mut scratch = twin.scratch();
    twin.equations().look(&q, &vec![0.0; twin.size().nv], scratch.equations());
    // of each joint, six columns: what each self-stress does to a component
    let mut columns = vec![vec![vec![0.0; count]; 6]; twin.spec.joints.len()];
    for (i, stress) in found.iter().enumerate() {
        let norm = |w: &partita_model::reaction::Wrench| w.force.norm().max(w.moment.norm() / twin.length());
        let size = stress.joints.iter().fold(0.0, |m: f64, (_, w)| m.max(norm(w)));
        for (j, w) in &stress.joints {
            let axes = twin.joint_frame(*j, &scratch);
            let (f, m) = (axes.apply_transposed(w.force), axes.apply_transposed(w.moment));
            for c in 0..3 {
                columns[*j][c][i] = f.0[c] / size;
                columns[*j][3 + c][i] = m.0[c] / (size * twin.length());
            }
        }
    }
    let used = worked(&model.spec);
    let loaded: HashSet<usize> = found.iter().flat_map(|s| s.joints.iter().map(|x| x.0)).collect();
    let free = |j: &usize| loaded.contains(j) && !used.contains(model.spec.joints[*j].name.as_str());
    // joints described last usually close the loops
    let joints: Vec<usize> = (0..columns.len()).rev().filter(free).collect();
    let mut chosen = Vec::new();
    if count <= FEW {
        let some = &joints[..joints.len().min(AMONG)];
        for usual in [true, false] {
            for most in 1..=REPLACED {
                if chosen.is_empty() {
                    search(model, some, &columns, (count, most, usual), &Base::default(), &mut chosen);
                }
            }
        }
    }
    if chosen.is_empty() {
        let mut base = Base::default();
        for usual in [true, false] {
            for &j in &joints {
                if chosen.iter().any(|w: &Replacement| w.joint == j) {
                    continue;
                }
                let fits = |w: &Replacement| w.usual == usual && w.frees.len() + base.0.len() <= count;
                for replacement in
                    replacements(model.spec.joints[j].kind, j).into_iter().filter(fits).collect::<Vec<_>>()
                {
                    if base.take(replacement.frees.iter().map(|&c| &columns[j][c])) {
                        chosen.push(replacement);
                        break;
                    }
                }
            }
        }
        if base.0.len() < count {
            return Ok(Vec::new());
        }
    }
    sort_by_key(&mut chosen, |w| w.joint);
    if !restores(model, &chosen, twin.size().nv - start.rank) {
        return Ok(Vec::new());
    }
    let remedy = |w: &Replacement| {
        let j = &model.spec.joints[w.joint];
        Remedy { joint: j.name.clone(), is: word(j.kind).into(), by: w.by.into() }
    };
    Ok(chosen.iter().map(remedy).collect())
}

/// Joints whose coordinates are referred to elsewhere, so that their kind cannot be changed.
fn worked(spec: &Spec) -> HashSet<&str> {
    let measures = spec.drives.iter().map(|d| &d.measure).chain(spec.couplings.iter().flat_map(Coupling::terms));
    let drives = measures.filter_map(Measure::of_joint);
    let forces = spec.forces.iter().filter_map(|f| match f {
        Force::TorsionSpring(_) | Force::Torque(_) => f.along().map(|(joint, _)| joint),
        _ => None,
    });
    drives.chain(forces).collect()
}

/// Exactly `most` of the joints, to the count of self-stresses; the first that fits.
fn search(
    model: &Model,
    joints: &[usize],
    columns: &[Vec<Vec<f64>>],
    (count, most, usual): (usize, usize, bool),
    base: &Base,
    chosen: &mut Vec<Replacement>,
) -> bool {
    for (index, &j) in joints.iter().enumerate() {
        for replacement in replacements(model.spec.joints[j].kind, j).into_iter().filter(|w| w.usual || !usual) {
            let mut grown = base.clone();
            if base.0.len() + replacement.frees.len() > count
                || !grown.take(replacement.frees.iter().map(|&c| &columns[j][c]))
            {
                continue;
            }
            let done = grown.0.len() == count;
            chosen.push(replacement);
            if done && most == 1
                || most > 1 && search(model, &joints[index + 1..], columns, (count, most - 1, usual), &grown, chosen)
            {
                return true;
            }
            chosen.pop();
        }
    }
    false
}

/// Whether the mechanism with these replacements keeps its mobility and has no redundancy.
fn restores(model: &Model, chosen: &[Replacement], dof: usize) -> bool {
    let mut spec = (*model.spec).clone();
    spec.drives.clear();
    spec.forces.clear();
    for w in chosen {
        let shape = model.shape(w.joint);
        let j: &mut Joint = &mut spec.joints[w.joint];
        j.kind = w.kind;
        if w.kind == JointKind::Generic {
            j.frame = Some(shape.frame.0);
            j.free = Some(["z", "rx", "ry", "rz"].map(Into::into).to_vec());
            j.axis = None;
            j.child_axis = None;
        }
    }
    let Ok(tried) = Model::new(spec, Arc::new(NoFunctions), Coordinates::Relative) else { return false };
    match mobility(&tried, 0.0, &tried.initial()) {
        Ok(found) => found.mobility == dof && found.redundant.is_empty(),
        Err(_) => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::examples::*;
    use partita_model::spec::JointKind::{Prismatic, Revolute};

    fn of(spec: Spec) -> Vec<String> {
        let m = model(spec);
        let found = remedies(&m, 0.0, &m.initial()).unwrap();
        found.iter().map(|c| format!("{} {} by {}", c.is, c.joint, c.by)).collect()
    }

    #[test]
    fn a_four_bar_takes_a_ball_and_a_cylinder() {
        for spec in [four_bar([Revolute; 4]), tilted(four_bar([Revolute; 4]))] {
            assert_eq!(of(spec), ["hinge C by a cylindrical joint", "hinge D by a ball joint"]);
        }
    }

    #[test]
    fn a_driven_joint_stays_what_it_is() {
        let mut spec = four_bar([Revolute; 4]);
        spec.drives.push(drive("motor", "D"));
        assert!(of(spec).iter().all(|words| !words.contains(" D ")));
    }

    #[test]
    fn one_self_stress_takes_one_joint() {
        let found = of(bricard());
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(found[0].ends_with("by a cylindrical joint"));
    }

    #[test]
    fn a_door_on_two_hinges_and_a_chain() {
        let mut spec = empty("door");
        spec.bodies.push(body("door", [0.0; 3], [1.0, 0.0, 2.0]));
        spec.joints.push(joint("low", Revolute, "ground", "door", [0.0, 0.0, 0.2], Z));
        spec.joints.push(joint("high", Revolute, "ground", "door", [0.0, 0.0, 1.8], Z));
        assert_eq!(of(spec), ["hinge low by a ball joint that slides along the axis", "hinge high by a ball joint"]);
        assert_eq!(of(chain(5, 0.3)).len(), 10);
    }

    #[test]
    fn nothing_to_remedy_and_nothing_that_remedies() {
        let mut spec = four_bar([Revolute; 4]);
        spec.joints.truncate(3);
        assert!(of(spec).is_empty());
        // two equal slides: turns alone can be freed of either
        let mut spec = empty("guides");
        spec.bodies.push(body("block", [0.0; 3], [1.0, 0.0, 0.0]));
        for (name, y) in [("low", -1.0), ("high", 1.0)] {
            spec.joints.push(joint(name, Prismatic, "ground", "block", [0.0, y, 0.0], [1.0, 0.0, 0.0]));
        }
        assert!(of(spec).is_empty());
    }
}
