//! The report: what a mechanism is, what can move, what is superfluous, what is determined, in words and numbers.

use crate::determined::determined;
use crate::error::AnalysisError;
use crate::mobility::{mobility, Mobility, Redundant};
use crate::reason::names;
use partita_model::Model;
use partita_system::reduction::Reduction;
use partita_system::start::choose_partition;
use serde::Serialize;
use std::collections::HashSet;

/// Squared sine of the closing rows below which a position is called close to a singular one: closing errors are
/// amplified a hundred times there.
const CLOSE: f64 = 1e-4;
/// Reasons listed before the rest is counted.
const REASONS: usize = 5;

/// A joint and what it joins, as described.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct JointLine {
    /// Its name; that of the body where no joint holds it.
    pub joint: String,
    /// Kind of joint; `floating` for a body that no joint of the tree holds.
    pub kind: String,
    /// Parent body or `ground`.
    pub parent: String,
    /// Child body.
    pub child: String,
}

/// A velocity of the tree.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CoordinateLine {
    /// Its name.
    pub name: String,
    /// How mobile it is with the loops closed, relative to opened: 0 (locked) to 1.         (P4)
    pub rho: f64,
    /// Does the choice integrate it?
    pub independent: bool,
    /// `√[M⁻¹]_ii`: its scale in the mass metric.
    pub scale: f64,
}

/// What the motion determines of a joint's reaction.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ReactionLine {
    /// Name of the joint.
    pub joint: String,
    /// Force x, y, z and moment x, y, z, joint axes.
    pub determined: [bool; 6],
}

/// Everything worth knowing about a mechanism at one position, at rest; names, not indices.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Degrees of freedom, driven ones not counted.
    pub mobility: usize,
    /// Conditions of all joints, in space.
    pub joint_rows: usize,
    /// Independent ones.
    pub joint_rank: usize,
    /// Conditions of the joints that close loops, in space.
    pub closing_rows: usize,
    /// Independent ones.
    pub closing_rank: usize,
    /// Do all motions lie in one plane?
    pub planar: bool,
    /// What the closings that misfit in the drawing open by when it is moved a little, in parts of sizes; 0 where it fits.
    pub misfit: f64,
    /// What of the drawing does not fit, in sentences.
    pub misfits: Vec<String>,
    /// Rows that say nothing new.
    pub redundant: Vec<Redundant>,
    /// Joints of the spanning tree, from the ground outwards.
    pub tree: Vec<JointLine>,
    /// Joints that close loops.
    pub cuts: Vec<JointLine>,
    /// Velocities of the tree.
    pub coordinates: Vec<CoordinateLine>,
    /// Names of the independent ones.
    pub independent: Vec<String>,
    /// Conditioning of the reduced equations: 1 is best.                                    (26)
    pub sigma: f64,
    /// Smallest principal cosine between the choice and the possible motions: 1 is best.    (27)
    pub sqrt_mu: f64,
    /// Which reactions are determined.
    pub reactions: Vec<ReactionLine>,
    /// In words.
    pub notes: Vec<String>,
}

/// The report at an assembled position, at rest.
///
/// Fails at a singular position, and where a body that moves has neither mass nor inertia.
pub fn report(model: &Model, t: f64, q: &[f64]) -> Result<Report, AnalysisError> {
    let found = mobility(model, t, q)?;
    let known = determined(model, t, q, true)?;
    let mut r = Reduction::new(model, model.placed.nv - found.mobility);
    choose_partition(&mut r, t, q, None, None)?;
    let rest = vec![0.0; r.k()];
    r.evaluate(t, q, &rest)?;
    let mut rho = vec![0.0; model.placed.nv];
    r.measure(t, q, &mut rho)?;
    let quality = r.quality(t, q)?;
    let mut is_independent = vec![false; rho.len()];
    r.partition.independent.iter().for_each(|&i| is_independent[i] = true);

    let placed = &model.placed;
    let coordinates = rho
        .iter()
        .enumerate()
        .map(|(i, &rho)| CoordinateLine {
            name: placed.velocity_names[i].clone(),
            rho,
            independent: is_independent[i],
            scale: r.scales()[i],
        })
        .collect();
    let tree = placed.topology.tree.iter().map(|e| match e.joint {
        Some(j) => joint_line(model, j),
        None => {
            let body = &model.spec.bodies[e.to - 1].name;
            let parent = partita_model::validate::GROUND.into();
            JointLine { joint: body.clone(), kind: "floating".into(), parent, child: body.clone() }
        }
    });
    let reactions = model.spec.joints.iter().zip(known);
    Ok(Report {
        tree: tree.collect(),
        cuts: placed.topology.cuts.iter().map(|&j| joint_line(model, j)).collect(),
        coordinates,
        independent: r.partition.independent.iter().map(|&i| placed.velocity_names[i].clone()).collect(),
        sigma: quality.sigma,
        sqrt_mu: quality.sqrt_mu,
        reactions: reactions.map(|(j, determined)| ReactionLine { joint: j.name.clone(), determined }).collect(),
        notes: notes(model, &found),
        mobility: found.mobility,
        joint_rows: found.joint_rows,
        joint_rank: found.joint_rank,
        closing_rows: found.closing_rows,
        closing_rank: found.closing_rank,
        planar: model.is_planar(),
        misfit: found.misfit,
        misfits: found.misfits,
        redundant: found.redundant,
    })
}

fn joint_line(model: &Model, j: usize) -> JointLine {
    let j = &model.spec.joints[j];
    JointLine {
        joint: j.name.clone(),
        kind: format!("{:?}", j.kind).to_lowercase(),
        parent: j.parent.clone(),
        child: j.child.clone(),
    }
}

fn count(n: usize, one: &str, many: &str) -> String {
    format!("{n} {}", if n == 1 { one } else { many })
}

fn notes(model: &Model, found: &Mobility) -> Vec<String> {
    let mut notes = Vec::new();
    let k = found.mobility;
    let drives: Vec<&str> = model.spec.drives.iter().map(|d| d.joint.as_str()).collect();
    notes.push(match (k, drives.is_empty()) {
        (0, true) => "no motion left: the joints make a structure of the bodies; free a joint to move it".into(),
        (0, false) => format!("no motion left to integrate: the drives of {} prescribe all of it", names(&drives)),
        _ => format!("{} to integrate", count(k, "degree of freedom", "degrees of freedom")),
    });
    if k > 0 && !drives.is_empty() {
        notes.push(format!("the motion of {} is prescribed, not integrated", names(&drives)));
    }
    notes.extend(found.of_drawing(model.spec.drawing_tolerance));
    over_constrained(found, &mut notes);
    let superfluous: Vec<&Redundant> = found.redundant[found.closing_rows - found.closing_rank..].iter().collect();
    for d in superfluous {
        notes.push(format!("{} of {} is superfluous: {}; remove it", d.row, d.joint, d.why));
    }
    if model.is_planar() && !model.out_of_plane.is_empty() {
        notes.push(format!(
            "all motions lie in one plane: {} that hold the bodies in it are left out of the motion",
            count(model.out_of_plane.len(), "closing row", "closing rows")
        ));
    }
    notes.extend(floating(model));
    if found.smallest < CLOSE {
        notes.push(format!(
            "close to a singular position: a closing row is within {:.1e} rad of following from the others, and errors grow \
             as the inverse of that; start farther away if you can",
            found.smallest.sqrt()
        ));
    }
    notes
}

/// How far the joints over-constrain the bodies, and why.
fn over_constrained(found: &Mobility, notes: &mut Vec<String>) {
    let rows = &found.redundant[..found.closing_rows - found.closing_rank];
    if rows.is_empty() {
        return;
    }
    notes.push(format!(
        "over-constrained: {} of the {} joint rows say nothing that the others do not (rank {}); the motion and the \
         reactions marked as determined are what they would be without them, the other reactions depend on elasticity and \
         clearances",
        rows.len(),
        found.joint_rows,
        found.joint_rank
    ));
    let mut reasons: Vec<(&str, Vec<&str>)> = Vec::new();
    let mut others = 0;
    for r in rows {
        match reasons.iter().position(|x| x.0 == r.why) {
            Some(i) => reasons[i].1.push(&r.row),
            None if reasons.len() < REASONS => reasons.push((&r.why, vec![&r.row])),
            None => others += 1,
        }
    }
    for (why, of) in reasons {
        notes.push(format!("superfluous {}: {why}", names(&of)));
    }
    if others > 0 {
        notes.push(format!("superfluous, for reasons of their own: {}", count(others, "further row", "further rows")));
    }
}

/// Bodies that no chain of joints links to the ground, one note per group.
fn floating(model: &Model) -> Vec<String> {
    let nodes = model.spec.bodies.len() + 1;
    let mut neighbours = vec![Vec::new(); nodes];
    for p in &model.placed.joints {
        neighbours[p.parent].push(p.child);
        neighbours[p.child].push(p.parent);
    }
    let mut seen = HashSet::new();
    let mut group = |first: usize| {
        let (mut open, mut group) = (vec![first], Vec::new());
        while let Some(i) = open.pop() {
            if seen.insert(i) {
                group.push(i);
                open.extend(&neighbours[i]);
            }
        }
        group.sort_unstable();
        group
    };
    group(0);
    let mut notes = Vec::new();
    for i in 1..nodes {
        let bodies: Vec<&str> = group(i).iter().map(|&i| model.spec.bodies[i - 1].name.as_str()).collect();
        match bodies.as_slice() {
            [] => {}
            [one] => notes.push(format!("{one} is held by no joint: it floats in space")),
            all => notes.push(format!("{} are linked with each other but not with the ground: they float", names(all))),
        }
    }
    notes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::examples::*;
    use partita_model::place::Coordinates;
    use partita_model::spec::JointKind::Revolute;
    use partita_model::spec::Spec;

    fn of(spec: Spec) -> Report {
        let m = model(spec);
        report(&m, 0.0, &m.initial()).unwrap()
    }
    fn says(r: &Report, words: &str) -> bool {
        r.notes.iter().any(|n| n.contains(words))
    }

    #[test]
    fn four_bar_in_a_tilted_plane() {
        let r = of(tilted(four_bar([Revolute; 4])));
        assert!(r.planar);
        assert_eq!(r.independent.len(), 1);
        assert_eq!(r.coordinates.iter().filter(|c| c.independent).count(), 1);
        let best = r.coordinates.iter().max_by(|a, b| a.rho.total_cmp(&b.rho)).unwrap();
        assert!(best.independent && best.name == r.independent[0]);
        assert!((best.rho - r.sigma).abs() < 1e-12, "one coordinate: σ is its ρ");
        assert!((r.sqrt_mu - r.sigma).abs() < 1e-12);
        assert!(r.coordinates.iter().all(|c| c.scale > 0.0));
        assert_eq!(r.cuts.len(), 1);
        assert_eq!(
            (r.cuts[0].joint.as_str(), r.cuts[0].parent.as_str(), r.cuts[0].child.as_str()),
            ("C", "coupler", "rocker")
        );
        assert_eq!(r.tree.iter().map(|t| t.joint.as_str()).collect::<Vec<_>>(), ["A", "D", "B"]);
        assert!(r.tree.iter().all(|t| t.kind == "revolute"));
        assert!(says(&r, "1 degree of freedom to integrate"), "{:?}", r.notes);
        assert!(says(&r, "over-constrained: 3 of the 20 joint rows"));
        assert!(says(&r, "3 closing rows that hold the bodies in it"));
        assert!(!says(&r, "singular"));
    }

    #[test]
    fn it_is_plain_data() {
        let text = serde_json::to_string(&of(four_bar([Revolute; 4]))).unwrap();
        let value: serde_json::Value = serde_json::from_str(&text).unwrap();
        for key in [
            "mobility",
            "joint_rows",
            "joint_rank",
            "closing_rows",
            "closing_rank",
            "planar",
            "redundant",
            "tree",
            "cuts",
            "coordinates",
            "independent",
            "sigma",
            "sqrt_mu",
            "reactions",
            "notes",
        ] {
            assert!(!value[key].is_null(), "{key}");
        }
        assert_eq!(value["redundant"][0]["joint"], "C");
        assert_eq!(value["reactions"][0]["determined"], serde_json::json!([true, true, false, false, false, true]));
    }

    #[test]
    fn driven() {
        let mut spec = four_bar([Revolute; 4]);
        spec.drives.push(drive("motor", "A"));
        let r = of(spec.clone());
        assert_eq!(r.mobility, 0);
        assert!(r.independent.is_empty() && r.coordinates.iter().all(|c| c.rho == 0.0));
        assert!(says(&r, "the drives of A prescribe all of it"), "{:?}", r.notes);
        let c = spec.joints[2].point;
        spec.bodies.push(body("bob", c, [c[0], c[1] - 1.0, 0.0]));
        spec.joints.push(joint("pin", Revolute, "coupler", "bob", c, Z));
        spec.drives.push(drive("second", "D"));
        let r = of(spec);
        assert_eq!((r.mobility, r.independent), (1, vec!["pin".to_string()]));
        assert!(r.notes.iter().any(|n| n.starts_with("drive second of D is superfluous")), "{:?}", r.notes);
        assert!(r.notes.iter().any(|n| n == "the motion of A and D is prescribed, not integrated"));
    }

    #[test]
    fn structure() {
        let mut spec = four_bar([Revolute; 4]);
        spec.joints[1].kind = partita_model::spec::JointKind::Fixed;
        let r = of(spec);
        assert_eq!((r.mobility, r.sigma, r.sqrt_mu), (0, 1.0, 1.0));
        assert!(says(&r, "no motion left: the joints make a structure"), "{:?}", r.notes);
    }

    #[test]
    fn floating_bodies() {
        let mut spec = four_bar([Revolute; 4]);
        spec.joints.retain(|j| j.name != "A" && j.name != "D");
        spec.bodies.push(body("stone", [5.0; 3], [6.0; 3]));
        for coordinates in [Coordinates::Relative, Coordinates::Absolute] {
            let m = compiled(spec.clone(), coordinates);
            let r = report(&m, 0.0, &m.initial()).unwrap();
            assert_eq!((r.mobility, r.joint_rows), (14, 10), "{coordinates:?}");
            assert!(says(&r, "crank, coupler and rocker are linked with each other"), "{:?}", r.notes);
            assert!(says(&r, "stone is held by no joint"));
            assert!(r.tree.iter().any(|t| t.joint == "stone" && t.kind == "floating"));
        }
    }

    #[test]
    fn near_a_singular_position() {
        let r = of(chain(2, std::f64::consts::FRAC_PI_2 - 1e-3));
        assert!(says(&r, "close to a singular position"), "{:?}", r.notes);
    }

    #[test]
    fn many_loops_make_few_notes() {
        let r = of(chain(40, 0.3));
        assert_eq!((r.mobility, r.redundant.len()), (1, 120));
        assert!(r.notes.len() < 12 && says(&r, "further rows"), "{:#?}", r.notes);
    }
}
