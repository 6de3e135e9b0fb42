//! The report on a mechanism: its degrees of freedom, its redundancy and its determined reactions, in words and
//! numbers.

use crate::determined::determined;
use crate::error::AnalysisError;
use crate::geometry::Geometry;
use crate::mobility::{mobility, Mobility, Redundant};
use crate::plausibility::{idle, spins_unfelt, suspicious, without_inertia, Idle};
use crate::reason::names;
use crate::remedies::{remedies, Remedy};
use partita_math::tolerance;
use partita_model::evaluator::DriveRow;
use partita_model::Model;
use partita_system::branching::{self, Branch};
use partita_system::kinematics::assembly::move_to;
use partita_system::prelude::*;
use partita_system::reduction::Reduction;
use partita_system::start::{choose_partition, rank_here};
use partita_system::{weight, SystemError};
use serde::Serialize;
use std::collections::{BTreeMap, HashSet};

mod sentences;

use sentences::{floating, notes, redundancy};

/// A joint and the bodies it connects, as described.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct JointLine {
    /// Its name; that of the body where it floats.
    pub joint: String,
    /// Kind of joint; `floating` for a body without a joint in the tree.
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
    /// Whether it is chosen as an independent coordinate.
    pub independent: bool,
    /// `√[M⁻¹]_ii`: its scale in the mass metric.
    pub scale: f64,
}

/// Determinacy of a joint's reaction.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ReactionLine {
    /// Name of the joint.
    pub joint: String,
    /// Force x, y, z and moment x, y, z, joint axes.
    pub determined: [bool; 6],
}

/// Report on a mechanism at rest in one position, with names instead of indices.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Degrees of freedom, driven ones not counted.
    pub mobility: usize,
    /// Degrees of freedom with all drives released.
    pub degrees_of_freedom: usize,
    /// Gruebler's count: 6 per body minus all conditions of joints.
    pub gruebler: i64,
    /// Bodies that spin between their ball joints: a degree of freedom each.
    pub idle: Vec<Idle>,
    /// Joints to replace so that nothing is redundant.
    pub remedies: Vec<Remedy>,
    /// Redundancy, its reason and its remedy, in one paragraph; empty where there is none.
    pub redundancy: String,
    /// Coordinates that the closed loops lock.
    pub locked: Vec<String>,
    /// Coordinates other than theirs that follow from the drives alone.
    pub prescribed: Vec<String>,
    /// Coordinates with zero rate in this position only: dead positions.
    pub dead: Vec<String>,
    /// Data that look like a typing error.
    pub suspicious: Vec<String>,
    /// Conditions of all joints, in space.
    pub joint_rows: usize,
    /// Independent ones.
    pub joint_rank: usize,
    /// Conditions of the joints that close loops, in space.
    pub closing_rows: usize,
    /// Independent ones.
    pub closing_rank: usize,
    /// Whether all motions lie in one plane.
    pub planar: bool,
    /// The largest change of a joint frame that makes the drawing fit (rad, fractions of lengths); 0 where it fits as
    /// drawn.
    pub geometric_error: f64,
    /// Geometric errors of the drawing, in sentences.
    pub geometric_errors: Vec<String>,
    /// Redundant rows.
    pub redundant: Vec<Redundant>,
    /// Joints of the spanning tree, from the ground outwards.
    pub tree: Vec<JointLine>,
    /// Joints that close loops.
    pub cuts: Vec<JointLine>,
    /// Velocities of the tree.
    pub coordinates: Vec<CoordinateLine>,
    /// Names of the independent ones.
    pub independent: Vec<String>,
    /// Conditioning of the reduced equations: 1 is best. None where a body that moves has no inertia.       (26)
    pub sigma: Option<f64>,
    /// Smallest principal cosine between the choice and the possible motions: 1 is best.    (27)
    pub sqrt_mu: Option<f64>,
    /// Which reactions are determined.
    pub reactions: Vec<ReactionLine>,
    /// In words.
    pub notes: Vec<String>,
    /// The singular position and its branches, if it is singular.
    pub singular: Option<Singular>,
}

/// One branch that leaves a singular position.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BranchAccount {
    /// Rates of the coordinates that move, the fastest 1 (rad/s, or one length of the mechanism a second).
    pub rates: BTreeMap<String, f64>,
    /// Where these coordinates are a few degrees along it: a guess for an assembly.
    pub guess: BTreeMap<String, f64>,
    /// Degrees of freedom on it.
    pub mobility: usize,
}

/// A singular position, drives released.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Singular {
    /// Degrees of freedom here, those of an instant.
    pub here: usize,
    /// Degrees of freedom next to it; 0: none was found.
    pub beside: usize,
    /// Certainly a structure, mobile for an instant only.
    pub structure: bool,
    /// The branches are samples: there are more than can be listed.
    pub many: bool,
    /// Branches that meet here.
    pub branches: Vec<BranchAccount>,
    /// Whether the rest of the report describes the mechanism on the first branch. If not it is left out.
    pub described: bool,
    /// All this in words.
    pub words: String,
}

/// Measures and the choice at a position; none where a body that moves has no inertia.
fn measured(model: &Model, t: f64, q: &[f64], mobility: usize) -> Result<Option<Measured>, SystemError> {
    let mut r = Reduction::new(model, model.size().nv - mobility);
    if mobility == 0 {
        // no coordinate to choose, however weak the conditions that lock it
        r.position(t, q)?;
        return match r.refresh_scales(t, q) {
            Err(SystemError::Mass { .. }) => Ok(None),
            Err(e) => Err(e),
            Ok(()) => {
                let (rho, scales) = (vec![0.0; model.size().nv], r.scales().to_vec());
                Ok(Some(Measured { rho, independent: Vec::new(), scales, sigma: 1.0, sqrt_mu: 1.0 }))
            }
        };
    }
    let rest = vec![0.0; r.k()];
    match choose_partition(&mut r, t, q, None, None).and_then(|()| r.evaluate(t, q, &rest)) {
        Err(SystemError::Mass { .. }) => return Ok(None),
        other => other?,
    }
    let mut rho = vec![0.0; model.size().nv];
    r.measure(t, q, &mut rho)?;
    let quality = r.quality(t, q)?;
    let (independent, scales) = (r.planned.partition.independent.clone(), r.scales().to_vec());
    Ok(Some(Measured { rho, independent, scales, sigma: quality.sigma, sqrt_mu: quality.sqrt_mu }))
}

struct Measured {
    rho: Vec<f64>,
    independent: Vec<usize>,
    scales: Vec<f64>,
    sigma: f64,
    sqrt_mu: f64,
}

/// The report at an assembled position, at rest.
///
/// At a singular position it describes the mechanism next to it and the branches. If a body moves without mass or
/// inertia, the report names it and omits the measures.
pub fn report(model: &Model, t: f64, q: &[f64]) -> Result<Report, AnalysisError> {
    let e = match mobility(model, t, q) {
        Ok(found) => return regular(model, t, q, found),
        Err(e) => e,
    };
    if !matches!(e, AnalysisError::System(SystemError::SingularStart { .. })) {
        return Err(e);
    }
    let joints = Geometry::new(model, false);
    let driven = Geometry::new(model, true);
    let Some(found) = branching::look(&joints, t, q, false)? else {
        // the joints alone are regular, so the drives are at a dead centre
        let Some(words) = branching::words(&driven, t, q)? else { return Err(e) };
        let free = model.size().nv - rank_here(&joints, t, q)?.rank;
        let (many, structure, described, branches) = (false, false, false, Vec::new());
        let singular = Singular { here: free, beside: free, structure, many, branches, described, words };
        return Ok(Report { degrees_of_freedom: free, singular: Some(singular), ..unmoved(model)? });
    };
    let named = |x: Vec<(String, f64)>| x.into_iter().collect::<BTreeMap<_, _>>();
    let account = |b: &Branch| BranchAccount {
        rates: named(branching::rates(&joints, b, &found.branches)),
        guess: named(branching::guess(&joints, q, b)),
        mobility: b.mobility,
    };
    // drives that lock it here need not lock it elsewhere, and a mobility that is only instantaneous remains so along
    // the rest
    let on = found.branches.first().filter(|_| model.drives().is_empty() && found.seeming == 0);
    let singular = Singular {
        here: found.here,
        beside: found.beside(),
        structure: found.structure(),
        many: found.many,
        branches: found.branches.iter().map(account).collect(),
        described: on.is_some(),
        words: branching::of_joints(&joints, q, &found),
    };
    let mut reported = match on {
        None => unmoved(model)?,
        Some(b) => {
            let there = mobility(model, t, &b.beside)?;
            regular(model, t, &b.beside, there)?
        }
    };
    reported.degrees_of_freedom = singular.beside;
    reported.mobility = match found.branches.first() {
        Some(b) if !model.drives().is_empty() => model.size().nv - rank_here(&driven, t, &b.beside)?.rank,
        _ => singular.beside,
    };
    reported.singular = Some(singular);
    Ok(reported)
}

/// Properties of a mechanism that do not depend on its motion.
fn unmoved(model: &Model) -> Result<Report, AnalysisError> {
    let twin = model.in_space()?;
    let placed = twin.zero_position();
    let joint_rows = placed.joints.iter().map(|p| p.shape.conditions()).sum::<usize>();
    let gruebler = 6 * placed.bodies.len() as i64 - joint_rows as i64;
    Ok(Report {
        mobility: 0,
        degrees_of_freedom: 0,
        gruebler,
        idle: idle(model),
        remedies: Vec::new(),
        redundancy: String::new(),
        locked: Vec::new(),
        prescribed: Vec::new(),
        dead: Vec::new(),
        suspicious: suspicious(model),
        joint_rows,
        joint_rank: joint_rows,
        closing_rows: 0,
        closing_rank: 0,
        planar: model.is_planar(),
        geometric_error: 0.0,
        geometric_errors: Vec::new(),
        redundant: Vec::new(),
        tree: tree(model),
        cuts: model.cuts().iter().map(|&j| joint_line(model, j)).collect(),
        coordinates: Vec::new(),
        independent: Vec::new(),
        sigma: None,
        sqrt_mu: None,
        reactions: Vec::new(),
        notes: floating(model),
        singular: None,
    })
}

/// Joints of the spanning tree, from the ground outwards.
fn tree(model: &Model) -> Vec<JointLine> {
    let line = |e: &partita_model::topology::TreeEdge| match e.joint {
        Some(j) => joint_line(model, j),
        None => {
            let body = &model.spec.bodies[e.to - 1].name;
            let parent = partita_model::validate::GROUND.into();
            JointLine { joint: body.clone(), kind: "floating".into(), parent, child: body.clone() }
        }
    };
    model.tree().iter().map(line).collect()
}

/// Report at a position that is not singular, given its mobility.
fn regular(model: &Model, t: f64, q: &[f64], found: Mobility) -> Result<Report, AnalysisError> {
    let known = determined(model, t, q, true)?;
    let measured = measured(model, t, q, found.mobility)?;
    let placed = model.zero_position();
    let lines = |m: &Measured| -> Vec<CoordinateLine> {
        let line = |i: usize| CoordinateLine {
            name: placed.velocity_names[i].clone(),
            rho: m.rho[i],
            independent: m.independent.contains(&i),
            scale: m.scales[i],
        };
        (0..m.rho.len()).map(line).collect()
    };
    let reactions = model.spec.joints.iter().zip(known);
    let idle = idle(model);
    let mut notes = notes(model, &found);
    let weightless = measured.is_none();
    if weightless {
        let unfelt = weight::words(model, t, q, placed.nv - found.mobility)?;
        let spins = spins_unfelt(model);
        notes.push(match (unfelt, spins) {
            (_, Some(words)) => words,
            (Some((motion, v)), _) => format!(
                "a degree of freedom moves no mass: the motion {motion} (rad/s, m/s) involves only {}, without mass \
                 or inertia in that direction",
                names(&model.bodies_moved(q, &v))
            ),
            (None, None) => without_inertia(model),
        });
    }
    notes.extend(model.held_note());
    let replacements = remedies(model, t, q)?;
    let Still { locked, dead, prescribed } = still(model, t, q, measured.as_ref(), found.mobility);
    Ok(Report {
        tree: tree(model),
        singular: None,
        cuts: placed.topology.cuts.iter().map(|&j| joint_line(model, j)).collect(),
        coordinates: measured.as_ref().map(lines).unwrap_or_default(),
        independent: measured
            .iter()
            .flat_map(|m| m.independent.iter().map(|&i| placed.velocity_names[i].clone()))
            .collect(),
        sigma: measured.as_ref().map(|m| m.sigma),
        sqrt_mu: measured.as_ref().map(|m| m.sqrt_mu),
        reactions: reactions.map(|(j, determined)| ReactionLine { joint: j.name.clone(), determined }).collect(),
        notes,
        mobility: found.mobility,
        degrees_of_freedom: 6 * placed.bodies.len() - found.joint_rank,
        gruebler: 6 * placed.bodies.len() as i64 - found.joint_rows as i64,
        idle,
        redundancy: redundancy(&found, &replacements),
        remedies: replacements,
        locked,
        prescribed,
        dead,
        suspicious: suspicious(model),
        joint_rows: found.joint_rows,
        joint_rank: found.joint_rank,
        closing_rows: found.closing_rows,
        closing_rank: found.closing_rank,
        planar: model.is_planar(),
        geometric_error: found.geometric_error,
        geometric_errors: found.geometric_errors,
        redundant: found.redundant,
    })
}

/// The displacement that distinguishes a coordinate at rest only here from one that is always at rest. Unit:
/// characteristic displacement. Reason: its square is far above [`tolerance::TAKES_PART`].
const NUDGE: f64 = 0.02;

/// Names of coordinates in which no motion is free.
#[derive(Default)]
struct Still {
    /// In any position.
    locked: Vec<String>,
    /// In this one alone.
    dead: Vec<String>,
    /// Because they follow from the drives.
    prescribed: Vec<String>,
}

/// Mobility of each coordinate without the drives.
fn undriven(model: &Model, t: f64, q: &[f64]) -> Option<Vec<f64>> {
    let released = model.released(&[]).ok()?;
    let rank = rank_here(&released, t, q).ok()?.rank;
    Some(measured(&released, t, q, released.size().nv - rank).ok()??.rho)
}

/// Coordinates in which no motion is free, and why.
fn still(model: &Model, t: f64, q: &[f64], measured: Option<&Measured>, mobility: usize) -> Still {
    let Some(m) = measured.filter(|_| mobility > 0) else { return Default::default() };
    let size = model.size();
    if (size.holonomic..size.rows).any(|i| !model.structure().rows[i].is_drive) {
        return Default::default(); // what rolls comes to any position by manoeuvres, one nearby tells nothing
    }
    let driven: HashSet<usize> = model.drives().iter().filter_map(DriveRow::velocity).collect();
    let stands = |rho: &[f64], i: usize| rho[i] < tolerance::TAKES_PART && !driven.contains(&i);
    let all: Vec<usize> = (0..m.rho.len()).filter(|&i| stands(&m.rho, i)).collect();
    if all.is_empty() {
        return Default::default();
    }
    let names = |which: Vec<usize>| which.into_iter().map(|i| model.structure().velocity_name(i)).collect();
    let without = if model.drives().is_empty() { None } else { undriven(model, t, q) };
    let follows = |i: usize| without.as_ref().is_some_and(|rho| rho[i] >= tolerance::TAKES_PART);
    let (prescribed, all): (Vec<usize>, Vec<usize>) = all.into_iter().partition(|&i| follows(i));
    let prescribed = names(prescribed);
    if all.is_empty() {
        return Still { prescribed, ..Still::default() };
    }
    let nearby = || -> Option<Vec<f64>> {
        // all of them, by moves that have nothing in common
        let moved = m.independent.iter().enumerate().filter_map(|(k, &i)| {
            let c = (0..q.len()).find(|&c| model.structure().coordinates[c].velocity == Some(i))?;
            Some((c, q[c] + NUDGE * (1.0 + 0.37 * (k as f64).sin()) * model.structure().displacement(i)))
        });
        let moved: Vec<(usize, f64)> = moved.collect();
        let mut near = q.to_vec();
        if moved.is_empty() {
            return None;
        }
        move_to(model, t, &mut near, &moved, tolerance::CLOSED).ok()?;
        Some(self::measured(model, t, &near, mobility).ok()??.rho)
    };
    let Some(there) = nearby() else { return Still { prescribed, ..Still::default() } };
    let (locked, dead): (Vec<usize>, Vec<usize>) = all.into_iter().partition(|&i| stands(&there, i));
    Still { locked: names(locked), dead: names(dead), prescribed }
}

fn joint_line(model: &Model, j: usize) -> JointLine {
    let j = &model.spec.joints[j];
    JointLine { joint: j.name.clone(), kind: j.kind.words().into(), parent: j.parent.clone(), child: j.child.clone() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::examples::*;
    use partita_model::spec::JointKind::Revolute;
    use partita_model::spec::Spec;
    use partita_model::zero_position::Coordinates;

    fn of(spec: Spec) -> Report {
        let m = model(spec);
        report(&m, 0.0, &m.initial()).unwrap()
    }
    fn says(r: &Report, words: &str) -> bool {
        r.notes.iter().chain([&r.redundancy]).any(|n| n.contains(words))
    }

    #[test]
    fn four_bar_in_a_tilted_plane() {
        let r = of(tilted(four_bar([Revolute; 4])));
        assert!(r.planar);
        assert_eq!(r.independent.len(), 1);
        assert_eq!(r.coordinates.iter().filter(|c| c.independent).count(), 1);
        let best = r.coordinates.iter().max_by(|a, b| a.rho.total_cmp(&b.rho)).unwrap();
        assert!(best.independent && best.name == r.independent[0]);
        let sigma = r.sigma.unwrap();
        assert!((best.rho - sigma).abs() < 1e-12, "one coordinate: σ is its ρ");
        assert!((r.sqrt_mu.unwrap() - sigma).abs() < 1e-12);
        assert_eq!((r.gruebler, r.degrees_of_freedom, r.remedies.len()), (-2, 1, 2));
        assert!(r.coordinates.iter().all(|c| c.scale > 0.0));
        assert_eq!(r.cuts.len(), 1);
        assert_eq!(
            (r.cuts[0].joint.as_str(), r.cuts[0].parent.as_str(), r.cuts[0].child.as_str()),
            ("C", "coupler", "rocker")
        );
        assert_eq!(r.tree.iter().map(|t| t.joint.as_str()).collect::<Vec<_>>(), ["A", "D", "B"]);
        assert!(r.tree.iter().all(|t| t.kind == "revolute"));
        assert!(says(&r, "Over-constrained: 3 of the 20 constraints of the joints are redundant"), "{}", r.redundancy);
        assert!(says(
            &r,
            "replace hinge C by a cylindrical joint and hinge D by a ball joint; then nothing is redundant"
        ));
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
        assert_eq!(r.degrees_of_freedom, 1);
        let c = spec.joints[2].point;
        spec.bodies.push(body("bob", c, [c[0], c[1] - 1.0, 0.0]));
        spec.joints.push(joint("pin", Revolute, "coupler", "bob", c, Z));
        spec.drives.push(drive("second", "D"));
        let r = of(spec);
        assert_eq!((r.mobility, r.independent), (1, vec!["pin".to_string()]));
        assert!(r.notes.iter().any(|n| n.starts_with("drive second of D is redundant")), "{:?}", r.notes);
        assert_eq!(r.degrees_of_freedom, 2);
    }

    #[test]
    fn structure() {
        let mut spec = four_bar([Revolute; 4]);
        spec.joints[1].kind = partita_model::spec::JointKind::Fixed;
        let r = of(spec);
        assert_eq!((r.mobility, r.sigma, r.sqrt_mu), (0, Some(1.0), Some(1.0)));
        assert_eq!(r.degrees_of_freedom, 0);
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
            assert!(says(&r, "crank, coupler and rocker are connected with each other"), "{:?}", r.notes);
            assert!(says(&r, "stone is connected by no joint"));
            assert!(r.tree.iter().any(|t| t.joint == "stone" && t.kind == "floating"));
        }
    }

    #[test]
    fn near_a_singular_position() {
        let r = of(chain(2, std::f64::consts::FRAC_PI_2 - 1e-3));
        assert!(says(&r, "close to a singular position"), "{:?}", r.notes);
    }

    #[test]
    fn idle_spins_and_dead_positions() {
        use partita_model::spec::JointKind::Spherical;
        // a rod between balls, without inertia about its line
        let mut spec = four_bar([Revolute, Spherical, Spherical, Revolute]);
        let m = model(spec.clone());
        let r = report(&m, 0.0, &m.initial()).unwrap();
        assert_eq!((r.degrees_of_freedom, r.gruebler), (2, 2));
        assert_eq!(
            r.idle,
            [Idle { bodies: vec!["coupler".into()], joints: vec!["B".into(), "C".into()], held: false }]
        );
        let line = [0, 1, 2].map(|i| spec.joints[2].point[i] - spec.joints[1].point[i]);
        let square: f64 = line.iter().map(|x| x * x).sum();
        spec.bodies[1].inertia = std::array::from_fn(|i| {
            std::array::from_fn(|j| (f64::from(u8::from(i == j)) - line[i] * line[j] / square) * 0.1)
        });
        let m = model(spec);
        let r = report(&m, 0.0, &m.initial()).unwrap();
        assert!(says(&r, "coupler is held from spinning"), "{:?}", r.notes);
        assert!(r.idle[0].held && !r.coordinates.is_empty() && r.sigma.is_some());
        // stretched out, the slider stands still
        let r = of(stretched_slider_crank());
        assert_eq!((r.dead, r.locked.len()), (vec!["S".to_string()], 0));
    }

    #[test]
    fn many_loops_make_few_notes() {
        let r = of(chain(40, 0.3));
        assert_eq!((r.mobility, r.redundant.len()), (1, 120));
        assert!(
            r.notes.len() < 3 && r.redundancy.len() < 2000 && says(&r, "further constraints"),
            "{:#?}",
            r.redundancy
        );
    }
}
