//! The planar robot with three legs in a pose where its three base angles have the largest measures and yet leave the
//! platform loose: choosing coordinates one by one picks a singular set.

use crate::mechanisms::{compile, empty, joint};
use partita_model::spec::{Body, Cut, JointKind, Spec};
use partita_model::zero_position::Coordinates;
use partita_system::partition::Selection;
use partita_system::prelude::*;
use partita_system::reduction::Reduction;
use partita_system::tangent::chooser;
use partita_system::{start, SystemError};

const BASE: f64 = 1.5;
const PLATFORM: f64 = 0.5;
const LINK: f64 = 0.9;

fn body(name: &str, at: [f64; 2], angle: f64, mass: f64, com: f64, inertia: f64) -> Body {
    let (s, c) = angle.sin_cos();
    Body {
        name: name.into(),
        mass,
        com: [com, 0.0, 0.0],
        inertia: [[inertia, 0.0, 0.0], [0.0, inertia, 0.0], [0.0, 0.0, inertia]],
        position: [at[0], at[1], 0.0],
        orientation: [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]],
        shape: None,
    }
}

/// Drawn at the pose (x, y, φ) of the platform with the given elbows; legs 2 and 3 are cut at the platform.
fn robot([x, y, phi]: [f64; 3], elbows: [f64; 3]) -> Option<Spec> {
    let mut spec = empty("3-RRR");
    spec.gravity = [0.0; 3];
    let mut closers = Vec::new();
    for (i, sign) in elbows.iter().enumerate() {
        let direction = (90.0 + 120.0 * i as f64).to_radians();
        let a = [BASE * direction.cos(), BASE * direction.sin()];
        let c = [x + PLATFORM * (direction + phi).cos(), y + PLATFORM * (direction + phi).sin()];
        let (dx, dy) = (c[0] - a[0], c[1] - a[1]);
        let half = 0.5 * dx.hypot(dy);
        if half >= LINK {
            return None;
        }
        let first = dy.atan2(dx) + sign * (half / LINK).acos();
        let b = [a[0] + LINK * first.cos(), a[1] + LINK * first.sin()];
        let second = (c[1] - b[1]).atan2(c[0] - b[0]);
        let inertia = LINK.powi(3) / 12.0;
        let (lower, upper) = (format!("lower{i}"), format!("upper{i}"));
        spec.bodies.push(body(&lower, a, first, LINK, 0.5 * LINK, inertia));
        spec.bodies.push(body(&upper, b, second, LINK, 0.5 * LINK, inertia));
        let pin = |name: String, from: &str, to: &str, at: [f64; 2]| {
            let mut j = joint(name, JointKind::Revolute, from, to, [at[0], at[1], 0.0]);
            j.axis = Some([0.0, 0.0, 1.0]);
            j
        };
        spec.joints.push(pin(format!("base{i}"), "ground", &lower, a));
        spec.joints.push(pin(format!("elbow{i}"), &lower, &upper, b));
        closers.push(pin(format!("wrist{i}"), &upper, "platform", c));
        closers[i].cut = if i == 0 { Cut::Never } else { Cut::Always };
    }
    spec.bodies.push(body("platform", [x, y], phi, 1.0, 0.0, 0.125));
    spec.joints.extend(closers);
    Some(spec)
}

/// The pose at which the three base angles cannot move the platform.
const PARALLEL: [f64; 3] = [0.44480746107270663, -0.28272813748931336, -0.2492938366933924];

/// The k largest measures.
fn one_by_one(rho: &[f64], k: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..rho.len()).collect();
    order.sort_by(|&a, &b| rho[b].total_cmp(&rho[a]));
    let mut top = order[..k].to_vec();
    top.sort_unstable();
    top
}

#[test]
fn the_largest_measures_are_collectively_singular() {
    let model = compile(&robot(PARALLEL, [1.0, -1.0, 1.0]).unwrap(), Coordinates::Relative).unwrap();
    let size = model.size();
    assert_eq!((size.nv, size.rows, model.is_planar()), (7, 4, true));
    let q = model.initial();
    let found = start::analyse(&model, 0.0, &q).unwrap();
    // C itself is in perfect order
    assert!(found.rank == 4 && found.smallest > 0.05, "{found:?}");
    let mut r = Reduction::new(&model, 4);
    start::choose_partition(&mut r, 0.0, &q, None, None).unwrap();
    r.evaluate(0.0, &q, &[0.0; 3]).unwrap();
    let mut rho = vec![0.0; 7];
    r.measure(0.0, &q, &mut rho).unwrap();
    let sigma = r.quality(0.0, &q).unwrap().sigma;
    // the collective choice; 0.464 is what P5 finds here
    assert!(sigma >= 0.46, "σ = {sigma} with {:?}, {rho:?}", r.planned.partition.independent);
    // one by one: the three base angles
    let top = one_by_one(&rho, 3);
    let names: Vec<String> = top.iter().map(|&i| model.structure().velocity_name(i)).collect();
    assert_eq!(names, ["base0", "base1", "base2"], "{rho:?}");
    let mut largest = top.iter().map(|&i| rho[i]).collect::<Vec<_>>();
    largest.sort_by(f64::total_cmp);
    for (found, known) in largest.iter().zip([0.643, 0.709, 0.837]) {
        assert!((found - known).abs() < 6e-4, "{largest:?}");
    }
    // the pose is given with sixteen digits, so what should be singular is so to round-off
    let refused = start::choose_partition(&mut r, 0.0, &q, None, Some(&top)).unwrap_err().to_string();
    assert!(refused.contains("cannot be independent here") && refused.contains(" would serve"), "{refused}");
    // the rule itself says so, and no other comes to its help
    let refused = chooser::choose_by(&mut r, 0.0, &q, Selection::Individual, None).unwrap_err();
    assert!(matches!(refused, SystemError::Choice { rule: "individual", .. }), "{refused}");
    assert!(refused.to_string().contains("base0, base1, base2"), "{refused}");
    for rule in [Selection::Greedy, Selection::NormalisedDeterminant, Selection::Collective] {
        chooser::choose_by(&mut r, 0.0, &q, rule, None).unwrap();
        r.evaluate(0.0, &q, &[0.0; 3]).unwrap();
        let sigma = r.quality(0.0, &q).unwrap().sigma;
        assert!(sigma >= 0.46, "{}: {sigma}", rule.name());
    }
}

/// Over random poses: the collective choice stays good where the other one fails now and then.
#[test]
fn quality_over_many_poses() {
    let mut rng = fastrand::Rng::with_seed(41);
    let (mut poses, mut failed, mut worst_chosen, mut worst_top) = (0, 0, 1.0f64, 1.0f64);
    while poses < 400 {
        let pose = [0.0; 3].map(|_| crate::mechanisms::between(&mut rng, -0.7, 0.7));
        let elbows = [0; 3].map(|_| if rng.bool() { 1.0 } else { -1.0 });
        let Some(spec) = robot(pose, elbows) else { continue };
        let model = compile(&spec, Coordinates::Relative).unwrap();
        let q = model.initial();
        let Ok(found) = start::analyse(&model, 0.0, &q) else { continue };
        if found.rank < 4 || found.smallest < 1e-3 {
            continue;
        }
        poses += 1;
        let mut r = Reduction::new(&model, 4);
        start::choose_partition(&mut r, 0.0, &q, None, None).unwrap();
        r.evaluate(0.0, &q, &[0.0; 3]).unwrap();
        worst_chosen = worst_chosen.min(r.quality(0.0, &q).unwrap().sigma);
        let mut rho = vec![0.0; 7];
        r.measure(0.0, &q, &mut rho).unwrap();
        let sigma = match start::choose_partition(&mut r, 0.0, &q, None, Some(&one_by_one(&rho, 3))) {
            Ok(()) => {
                r.evaluate(0.0, &q, &[0.0; 3]).unwrap();
                r.quality(0.0, &q).unwrap().sigma
            }
            Err(_) => 0.0,
        };
        failed += usize::from(sigma < 0.1);
        worst_top = worst_top.min(sigma);
    }
    assert!(worst_chosen > 0.25, "{worst_chosen}");
    assert!(failed >= 2 && worst_top < 0.1, "{failed} failures, worst {worst_top}");
}
