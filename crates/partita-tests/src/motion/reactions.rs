//! Reactions of all joints, on mechanisms drawn by chance: every body in balance, no work along what a joint leaves free,
//! and the same whichever joints are cut and whatever the coordinates.

use crate::mechanisms::{accelerations, apart, bodies, compile, drawing, on_random_mechanisms, Moment, Wishes};
use partita_math::dense;
use partita_math::spatial::Vec3;
use partita_model::reaction::{Reactions, Wrench};
use partita_model::spec::{Cut, Force, JointKind, Spec};
use partita_model::zero_position::Coordinates;
use partita_model::Model;
use partita_system::prelude::*;
use std::collections::BTreeSet;

const ALL: Wishes = Wishes { planar: false, bound: true, drives: true };
const UNBOUND: Wishes = Wishes { planar: false, bound: false, drives: false };
const COUNT: usize = 80;

fn reactions(model: &Model, m: &Moment) -> Reactions {
    model.equations().reactions(m.t, &m.q, &m.v, &m.vdot, &m.lambda, model.scratch().equations()).unwrap()
}

/// Moments and forces of all joints, one after the other; lengths are of the order of 1.
///
/// Of a planar mechanism what lies in its plane: its loops share out what acts across it in many ways, so that part
/// depends on where they are cut. Both sides of a comparison are seen in the axes of the same model.
fn wrenches(model: &Model, r: &Reactions) -> Vec<f64> {
    if !model.is_planar() {
        return r.joints.iter().flat_map(|w| w.moment.0.into_iter().chain(w.force.0)).collect();
    }
    let inside = |w: &Wrench| {
        let (m, f) = (model.zero_position().basis.apply(w.moment), model.zero_position().basis.apply(w.force));
        [m.0[2], f.0[0], f.0[1]]
    };
    r.joints.iter().flat_map(inside).collect()
}

#[test]
fn every_body_is_in_balance() {
    for planar in [false, true] {
        on_random_mechanisms(21, COUNT, Wishes { planar, ..ALL }, |_, model, m| {
            let r = reactions(model, m);
            // the limit for every joint of the project; here round-off times the condition of C_D would suffice
            assert!(r.residual < 1e-9, "{:e}", r.residual);
        });
    }
}

/// A wrench that a joint carries does no work on a twist that it allows; what is left is the work of its drives.
#[test]
fn reactions_do_no_work_on_free_motions() {
    let mut driven = 0;
    for planar in [false, true] {
        on_random_mechanisms(22, COUNT, Wishes { planar, ..ALL }, |_, model, m| {
            let r = reactions(model, m);
            let states = bodies(model, &m.q, &m.v);
            let mut s = model.scratch();
            model.equations().look(&m.q, &m.v, s.equations());
            for (j, p) in model.zero_position().joints.iter().enumerate() {
                let x = model.joint_state(j, &m.q, &m.v, &s);
                // velocity of the point of space at the joint, as carried by a node
                let at = |node: usize| match node {
                    0 => (Vec3::zero(), Vec3::zero()),
                    _ => {
                        let b = &states[node - 1];
                        let arm = Vec3(x.point) - b.position;
                        (b.angular_velocity, b.velocity + b.angular_velocity.cross(arm))
                    }
                };
                let ((wc, uc), (wp, up)) = (at(p.child), at(p.parent));
                let w = &r.joints[j];
                let power = w.moment.dot(wc - wp) + w.force.dot(uc - up);
                let drive = dense::dot(&r.drives[j], &x.velocity);
                driven += usize::from(drive != 0.0);
                let size = w.moment.norm() * (wc - wp).norm() + w.force.norm() * (uc - up).norm();
                let name = (&model.spec.joints[j].name, model.spec.joints[j].kind, p.links.is_some(), p.reversed);
                assert!((power - drive).abs() < 1e-9 * (1.0 + size), "{name:?}: {power:e} with drives {drive:e}");
            }
        });
    }
    assert!(driven > COUNT / 4, "{driven}");
}

/// Mark one more joint to be cut.
fn cut_elsewhere(spec: &Spec, joint: usize) -> Spec {
    let mut spec = spec.clone();
    spec.joints.iter_mut().for_each(|j| j.cut = Cut::Auto);
    spec.joints[joint].cut = Cut::Always;
    spec
}

/// The moment in the coordinates of another model of the same mechanism, with its own accelerations and multipliers.
#[track_caller]
fn in_coordinates(model: &Model, m: &Moment, other: &Model) -> Option<Moment> {
    let (q, v) = other.transferred(model, &m.q, &m.v);
    for (a, b) in bodies(model, &m.q, &m.v).iter().zip(&bodies(other, &q, &v)) {
        // positions read off poses: an angle loses half the digits nowhere, a frame is rebuilt a few times
        assert!((a.position - b.position).norm() < 1e-9, "{} {:?} {:?}", other.spec.name, a.position, b.position);
        assert!((a.velocity - b.velocity).norm() < 1e-9, "{:?} {:?}", a.velocity, b.velocity);
        assert!((a.angular_velocity - b.angular_velocity).norm() < 1e-9);
    }
    let there = Moment::at(other, m.t, q, v)?;
    let off = apart(&accelerations(model, m), &accelerations(other, &there));
    assert!(off < 1e-8, "accelerations off by {off:e}");
    Some(there)
}

#[test]
fn reactions_do_not_depend_on_the_cut() {
    let (mut compared, mut kinds) = (0, BTreeSet::new());
    for planar in [false, true] {
        on_random_mechanisms(23, COUNT, Wishes { planar, bound: true, drives: false }, |rng, model, m| {
            // redundant rows leave reactions open: another test's subject
            if m.rank < model.size().rows {
                return;
            }
            let here = wrenches(model, &reactions(model, m));
            for _ in 0..3 {
                let j = rng.usize(0..model.spec.joints.len());
                let Some(other) = compile(&cut_elsewhere(&model.spec, j), Coordinates::Relative) else { continue };
                if other.zero_position().topology == model.zero_position().topology || other.is_planar() != planar {
                    continue;
                }
                let Some(there) = in_coordinates(model, m, &other) else { continue };
                let r = reactions(&other, &there);
                assert!(r.residual < 1e-9);
                // two sets of multipliers with a thousandfold amplification each
                let off = apart(&here, &wrenches(model, &r));
                assert!(off < 1e-8, "off by {off:e} with {:?} cut", model.spec.joints[j].kind);
                compared += 1;
                for &c in other.cuts() {
                    kinds.insert(format!("{:?}", other.spec.joints[c].kind));
                }
            }
        });
    }
    assert!(compared > COUNT, "{compared}");
    // every kind closes a loop somewhere
    for kind in ["Revolute", "Prismatic", "Cylindrical", "Universal", "Spherical", "Planar", "Generic", "Fixed"] {
        assert!(kinds.contains(kind), "{kinds:?}");
    }
}

#[test]
fn absolute_coordinates_give_the_same_motion_and_reactions() {
    let mut compared = 0;
    for planar in [false, true] {
        on_random_mechanisms(24, COUNT, Wishes { planar, ..UNBOUND }, |_, model, m| {
            let Some(other) = compile(&model.spec, Coordinates::Absolute) else { return };
            if m.rank < model.size().rows || other.is_planar() != planar {
                return;
            }
            let Some(there) = in_coordinates(model, m, &other) else { return };
            let r = reactions(&other, &there);
            assert!(r.residual < 1e-9);
            let (x, y) = (wrenches(model, &reactions(model, m)), wrenches(model, &r));
            if there.rank == other.size().rows {
                // absolute coordinates: more rows, scaled worse
                assert!(apart(&x, &y) < 1e-8, "off by {:e}", apart(&x, &y));
                compared += 1;
            }
        });
    }
    assert!(compared > COUNT / 2, "{compared}");
}

/// The drawings of this file cover every kind of joint in every role.
#[test]
fn drawings_are_rich() {
    let mut seen: BTreeSet<String> = BTreeSet::new();
    on_random_mechanisms(22, COUNT, ALL, |_, model, _| {
        for (p, j) in model.zero_position().joints.iter().zip(&model.spec.joints) {
            let role = match (&p.links, p.reversed) {
                (None, _) => "cut",
                (Some(_), true) => "reversed",
                (Some(_), false) => "tree",
            };
            seen.insert(format!("{:?} {role}", j.kind));
            let loaded = model.spec.forces.iter().any(|f| matches!(f, Force::Torque(x) if x.joint == j.name));
            if loaded {
                seen.insert(format!("{:?} {role} loaded", j.kind));
            }
        }
    });
    for kind in [JointKind::Revolute, JointKind::Prismatic, JointKind::Cylindrical, JointKind::Universal] {
        for role in ["tree", "tree loaded", "reversed", "reversed loaded", "cut", "cut loaded"] {
            assert!(seen.contains(&format!("{kind:?} {role}")), "{kind:?} {role}: {seen:?}");
        }
    }
    for role in ["tree", "tree loaded", "reversed", "reversed loaded", "cut"] {
        assert!(seen.contains(&format!("Planar {role}")), "{role}: {seen:?}");
    }
    for kind in [JointKind::Spherical, JointKind::Generic] {
        for role in ["tree", "reversed", "cut"] {
            assert!(seen.contains(&format!("{kind:?} {role}")), "{kind:?} {role}: {seen:?}");
        }
    }
    let mut rng = fastrand::Rng::with_seed(7);
    assert!((0..20).all(|_| !drawing(&mut rng, UNBOUND).forces.is_empty()));
}

/// Augmented joint coordinates (45) and the Newton-Euler recursion (R3) share no formula beyond what each body needs, and
/// give the same wrenches of all joints, efforts of drives included.
#[test]
fn augmented_joint_coordinates_give_the_reactions_of_the_recursion() {
    for planar in [false, true] {
        on_random_mechanisms(27, COUNT, Wishes { planar, ..ALL }, |_, model, m| {
            let recursion = reactions(model, m);
            let augmented =
                model.augmented_reactions(m.t, &m.q, &m.v, &m.vdot, &m.lambda, &mut model.scratch()).unwrap();
            let components =
                |x: &[Wrench]| -> Vec<f64> { x.iter().flat_map(|w| w.moment.0.into_iter().chain(w.force.0)).collect() };
            let off = apart(&components(&recursion.joints), &components(&augmented));
            // round-off of sums over the bodies outboard
            assert!(off < 1e-11, "{off:e}");
        });
    }
}
