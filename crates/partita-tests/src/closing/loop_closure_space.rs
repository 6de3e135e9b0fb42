//! Explicit closing in space: characteristic pairs, planar loops in spatial mechanisms, implicit blocks.

use crate::linkages::*;
use partita_math::spatial::{Mat3, Vec3};
use partita_model::loop_closure::LoopClosing;
use partita_model::spec::JointKind::{Cylindrical, Prismatic, Revolute, Spherical, Universal};
use partita_model::Model;
use partita_system::closing::Closing;
use partita_system::prelude::*;
use partita_system::SystemError;
use std::f64::consts::TAU;

fn by<'m>(model: &'m Model, names: &[&str]) -> LoopClosing<'m> {
    let inputs: Vec<usize> = names.iter().map(|n| velocity(model, n)).collect();
    model.loop_closing(0.0, &model.initial(), Some(&inputs)).unwrap()
}

fn words(closing: &LoopClosing) -> Vec<String> {
    closing.blocks().iter().map(|b| b.words.clone()).collect()
}

/// The rocker's angle by the characteristic equation written down for RSSR:                             (39)
/// `r = O₂ − P`, `s₂` the arm: `a = 2(r + par)·per`, `b = 2(r + par)·(u₂×s₂)`, `c = |r + par|² + |per|² − L²`.
fn rocker_angles(crank: f64) -> [f64; 2] {
    let p = Mat3::about(Vec3(Z), crank.sin(), crank.cos()).apply(Vec3(CRANK_AT));
    let u2 = Vec3(ROCKER).unit().unwrap();
    let (o2, q) = (Vec3(PIVOT), Vec3(ROCKER_AT));
    let s2 = q - o2;
    let length = (q - Vec3(CRANK_AT)).norm();
    let par = u2.times(u2.dot(s2));
    let per = s2 - par;
    let r = o2 - p;
    let a = 2.0 * (r + par).dot(per);
    let b = 2.0 * (r + par).dot(u2.cross(s2));
    let c = (r + par).dot(r + par) + per.dot(per) - length * length;
    [1.0, -1.0].map(|sign| b.atan2(a) + sign * (-c / a.hypot(b)).acos())
}

#[test]
fn rssr_turns_fully_and_follows_its_characteristic_equation() {
    for cut in ["A", "B", "rocker"] {
        let model = rssr("S").cut(cut).model();
        // the spin of the rod is the second degree of freedom: the velocity of a ball in the tree
        let spin = if cut == "A" { "B.wx" } else { "A.wx" };
        let mut closing = by(&model, &["crank", spin]);
        assert!(closing.is_explicit(), "{:?}", words(&closing));
        assert_eq!(closing.blocks().iter().filter(|b| !b.rows.is_empty()).count(), 1);
        sweep(&model, &mut closing, "crank", TAU, 40);
        if cut == "rocker" {
            continue;
        }
        let (mut q, at) = (model.initial(), coordinate(&model, "crank"));
        for k in 0..12 {
            q[at] = 0.5 * f64::from(k);
            closing.close(0.0, &mut q).unwrap();
            let rocker = q[coordinate(&model, "rocker")];
            let near = rocker_angles(q[at]).iter().fold(f64::INFINITY, |m: f64, x| {
                let d = x - rocker;
                m.min((d - (d / TAU).round() * TAU).abs())
            });
            assert!(near < 1e-13, "{near}");
        }
    }
}

/// Twice the sign: of the characteristic equation and of the universal joint. All four assemblies close.
#[test]
fn rsur_has_four_assemblies() {
    for cut in ["A", "B", "crank"] {
        let model = rssr("U").cut(cut).model();
        // a cut crank has no velocity: the rocker leads then, as far as it swings
        let (input, angle) = if cut == "crank" { ("rocker", -0.5) } else { ("crank", TAU) };
        let mut closing = by(&model, &[input]);
        assert!(closing.is_explicit(), "{:?}", words(&closing));
        let w = words(&closing);
        assert!(w[0].ends_with("characteristic equation") && w[1].ends_with("universal joint"), "{w:?}");
        if cut == "A" || cut == "crank" {
            sweep(&model, &mut closing, input, 0.3 * angle, 20);
        }
        let all = model.assemblies(0.0, &model.initial(), Some(&[velocity(&model, input)])).unwrap();
        assert_eq!(all.found.len(), 4, "{:?}", all.notes);
        for a in &all.found {
            assert!(a.residual < 2e-15, "{}", a.residual);
        }
        // all different
        for (i, a) in all.found.iter().enumerate() {
            for b in &all.found[..i] {
                assert!(a.q.iter().zip(&b.q).any(|(x, y)| (x - y).abs() > 1e-3));
            }
        }
    }
}

/// `follow` closes on the branches nearest to what it is given: from a little beside each assembly that assembly,
/// with little doubt; half-way between two of them in much doubt.
#[test]
fn branches_can_follow_the_position() {
    let cases = [
        (four_bar([1.0, 0.5, 1.2, 0.8], 0.7, 1.0), "A", 2),
        (watt(), "A", 2),
        (stephenson(), "A", 2),
        (crate::linkages::slider_crank(), "A", 2),
        (rssr("U").cut("B"), "crank", 4),
    ];
    for (drawing, input, count) in cases {
        let model = drawing.model();
        let inputs = [velocity(&model, input)];
        let all = model.assemblies(0.0, &model.initial(), Some(&inputs)).unwrap();
        assert!(all.found.len() >= count, "{}: {:?}", model.spec.name, all.notes);
        let mut closing = model.loop_closing(0.0, &model.initial(), Some(&inputs)).unwrap();
        for a in &all.found {
            let mut q = a.q.clone();
            let dv: Vec<f64> = (0..model.size().nv).map(|v| if v == inputs[0] { 0.0 } else { 1e-3 }).collect();
            model.step(&mut q, &dv);
            let doubt = closing.follow(0.0, &mut q).unwrap();
            assert!(doubt > 0.0 && doubt < 0.1, "{}: {doubt}", model.spec.name);
            let off = q.iter().zip(&a.q).fold(0.0, |m: f64, (x, y)| m.max((x - y).abs()));
            assert!(off < 1e-12, "{}: {off:e}", model.spec.name);
            // and from there it keeps that branch
            let own = branches(&closing);
            closing.close(0.0, &mut q).unwrap();
            assert_eq!(branches(&closing), own);
        }
        let between = |i: usize| 0.5 * (all.found[0].q[i] + all.found[1].q[i]);
        if model.is_planar() {
            let mut q: Vec<f64> = (0..model.size().nq).map(between).collect();
            let doubt = closing.follow(0.0, &mut q).unwrap();
            assert!(doubt > 0.9, "{}: {doubt}", model.spec.name);
        }
    }
}

/// Spatial slider-crank: crank about x, rod on a ball, universal joint at the slider.
fn slider_crank(balls: bool) -> Drawing {
    let d = drawing("spatial slider-crank")
        .joint("crank", Revolute, "ground", "crank", [0.0, 0.1, 0.12], [1.0, 0.0, 0.0])
        .joint("pin", Spherical, "crank", "rod", [0.0, 0.1, 0.2], Z);
    let d = if balls {
        d.joint("wrist", Spherical, "rod", "slider", [0.2, 0.0, 0.0], Z)
    } else {
        // the axis on the rod stays square to the slide
        let rod = Vec3([0.2, -0.1, -0.2]).unit().unwrap();
        let across = Vec3([1.0, 0.0, 0.0]).cross(rod).unit().unwrap();
        d.joint("wrist", Universal, "slider", "rod", [0.2, 0.0, 0.0], [1.0, 0.0, 0.0]).and(across.0)
    };
    d.joint("slide", Prismatic, "ground", "slider", [0.2, 0.0, 0.0], [1.0, 0.0, 0.0])
}

/// Closed form: x = √(L² − y² − z²) of the crank pin's y and z.
#[test]
fn spatial_slider_crank() {
    for balls in [false, true] {
        for cut in ["pin", "wrist", "slide"] {
            let model = slider_crank(balls).cut(cut).model();
            let inputs: Vec<&str> = match (balls, cut) {
                (false, _) => vec!["crank"],
                (true, "pin") => vec!["crank", "wrist.wx"],
                (true, _) => vec!["crank", "pin.wx"],
            };
            let mut closing = by(&model, &inputs);
            assert!(closing.is_explicit(), "{:?}", words(&closing));
            sweep(&model, &mut closing, "crank", TAU, 40);
            if cut == "slide" {
                continue;
            }
            let mut q = model.initial();
            q[coordinate(&model, "crank")] = 2.0;
            closing.close(0.0, &mut q).unwrap();
            let (y, z) = (0.1 - 0.08 * 2.0_f64.sin(), 0.12 + 0.08 * 2.0_f64.cos());
            let x = (0.09 - y * y - z * z).sqrt();
            assert!((q[coordinate(&model, "slide")] - (x - 0.2)).abs() < 1e-15);
        }
    }
}

#[test]
fn spatial_limits_report_the_shortfall() {
    // a rod too short for the far side of the crank
    let model = drawing("short")
        .joint("crank", Revolute, "ground", "crank", [0.0; 3], [1.0, 0.0, 0.0])
        .joint("pin", Spherical, "crank", "rod", [0.0, 0.3, 0.0], Z)
        .joint("wrist", Universal, "slider", "rod", [0.2, 0.2, 0.0], [1.0, 0.0, 0.0])
        .and([0.0, 0.3, 1.0])
        .joint("slide", Prismatic, "ground", "slider", [0.2, 0.2, 0.0], [1.0, 0.0, 0.0])
        .model();
    let mut closing = by(&model, &["crank"]);
    let mut q = model.initial();
    q[coordinate(&model, "crank")] = 3.0;
    let length = 0.05_f64.sqrt();
    let off = (0.3 * 3.0_f64.cos() - 0.2).hypot(0.3 * 3.0_f64.sin());
    match closing.close(0.0, &mut q) {
        Err(SystemError::Limit { block, shortfall, .. }) => {
            assert!(block.contains("\"pin\"") && (shortfall - (off - length)).abs() < 1e-14, "{block} {shortfall}")
        }
        other => panic!("{other:?}"),
    }
    // RSSR the other way round: the rocker as input has limits, measured by the distance the rod misses
    let model = rssr("S").model();
    let mut closing = by(&model, &["rocker", "A.wx"]);
    let mut q = model.initial();
    q[coordinate(&model, "rocker")] = 2.5;
    let u2 = Vec3(ROCKER).unit().unwrap();
    let b = Vec3(PIVOT) + Mat3::about(u2, 2.5_f64.sin(), 2.5_f64.cos()).apply(Vec3(ROCKER_AT) - Vec3(PIVOT));
    let rod = (Vec3(ROCKER_AT) - Vec3(CRANK_AT)).norm();
    let radius = CRANK_AT[0].hypot(CRANK_AT[1]);
    let r = b.0[0].hypot(b.0[1]);
    let nearest = (r - radius).hypot(b.0[2] - CRANK_AT[2]);
    let farthest = (r + radius).hypot(b.0[2] - CRANK_AT[2]);
    let missing = (nearest - rod).max(rod - farthest);
    assert!(missing > 0.0);
    match closing.close(0.0, &mut q) {
        Err(SystemError::Limit { shortfall, .. }) => {
            assert!((shortfall - missing).abs() < 1e-14, "{shortfall} {missing}")
        }
        other => panic!("{other:?}"),
    }
}

/// A planar four-bar whose rocker carries a spatial loop: the plane's dyad first, then the characteristic pair.
#[test]
fn planar_loop_in_a_spatial_mechanism() {
    let model = drawing("mixed")
        .pin("A", "ground", "crank", [0.0, 0.0])
        .pin("B", "crank", "coupler", [0.3, 0.4])
        .pin("C", "coupler", "rocker", [1.2, 0.9])
        .pin("D", "ground", "rocker", [1.0, 0.0])
        .joint("E", Spherical, "rocker", "rod", [1.3, 0.6, 0.4], Z)
        .joint("F", Universal, "rod", "slider", [1.8, 0.2, 1.0], [0.0, 1.0, 0.1])
        .and([1.0, 0.1, 0.0])
        .joint("G", Prismatic, "ground", "slider", [1.8, 0.2, 1.0], [0.3, 0.2, 1.0])
        .model();
    assert!(!model.is_planar());
    let mut closing = by(&model, &["A"]);
    assert!(closing.is_explicit());
    let w = words(&closing);
    assert!(w[0].starts_with("RRR dyad") && w.last().unwrap().contains("loop"), "{w:?}");
    // the plane's loop brings three rows too many
    let rows: usize = closing.blocks().iter().map(|b| b.rows.len()).sum();
    assert_eq!(model.size().nv, rows + 1);
    sweep(&model, &mut closing, "A", 0.3, 10);
    // free choice: everything explicit as well
    assert!(model.loop_closing(0.0, &model.initial(), None).unwrap().is_explicit());
}

/// Seven revolutes in space: no closed form, one implicit block of six.
#[test]
fn seven_revolutes_are_one_implicit_block() {
    let mut rng = fastrand::Rng::with_seed(23);
    let mut d = drawing("7R");
    let name = |i: usize| if i % 7 == 0 { "ground".to_string() } else { format!("link{i}") };
    for i in 0..7 {
        let angle = TAU * i as f64 / 7.0;
        let axis = [rng.f64() - 0.5, rng.f64() - 0.5, rng.f64() - 0.5];
        let at = [angle.cos(), angle.sin(), 0.4 * rng.f64()];
        d = d.joint(&format!("J{i}"), Revolute, &name(i), &name(i + 1), at, axis);
    }
    let model = d.model();
    let mut closing = model.loop_closing(0.0, &model.initial(), None).unwrap();
    assert!(!closing.is_explicit());
    assert_eq!(closing.inputs().len(), 1);
    let input = model.structure().velocity_name(closing.inputs()[0]);
    let unknown: usize = closing.blocks().iter().map(|b| b.unknown.len()).sum();
    assert_eq!(unknown, 5);
    sweep(&model, &mut closing, &input, 0.05, 8);
}

/// Drawn open: a cut joint that sits elsewhere, and turned, on its child. The branch and the closed forms are those of
/// the assembled position.
#[test]
fn open_drawings_close_too() {
    for planar in [true, false] {
        let mut d = if planar {
            drawing("open")
                .pin("A", "ground", "crank", [0.0, 0.0])
                .pin("B", "crank", "coupler", [0.3, 0.4])
                .pin("C", "coupler", "rocker", [1.2, 0.9])
                .pin("D", "ground", "rocker", [1.0, 0.0])
                .cut("C")
        } else {
            rssr("S").cut("B")
        };
        let j = d.0.joints.iter_mut().find(|j| j.name == if planar { "C" } else { "B" }).unwrap();
        // in the plane the child stays in the plane
        j.child_point = Some([j.point[0] + 0.03, j.point[1] - 0.02, j.point[2] + if planar { 0.0 } else { 0.04 }]);
        let model = d.model();
        let mut q = model.initial();
        partita_system::kinematics::assembly::close(&model, 0.0, &mut q, 1e-12, &[]).unwrap();
        let inputs: Vec<usize> = if planar {
            vec![velocity(&model, "A")]
        } else {
            vec![velocity(&model, "crank"), velocity(&model, "A.wx")]
        };
        let mut closing = model.loop_closing(0.0, &q, Some(&inputs)).unwrap();
        assert!(closing.is_explicit());
        let before = q.clone();
        closing.close(0.0, &mut q).unwrap();
        assert_closed(&model, 0.0, &q, "open drawing");
        assert!(q.iter().zip(&before).all(|(a, b)| (a - b).abs() < 1e-10));
        assert_tangent(&model, &mut closing, 0.0, &q);
    }
}

/// A four-bar drawn without redundant rows: pins, a ball and a cylindrical joint. It moves as the planar one does; and
/// a slide in place of the crank's pin, at any angle to the cylinder.
#[test]
fn ball_and_cylinder() {
    let planar = drawing("four-bar")
        .pin("A", "ground", "crank", [0.0, 0.0])
        .pin("B", "crank", "coupler", [0.3, 0.4])
        .pin("C", "coupler", "rocker", [1.2, 0.9])
        .pin("D", "ground", "rocker", [1.0, 0.0])
        .model();
    let mut reference = by(&planar, &["A"]);
    for cut in ["B", "C", "D"] {
        for backward in [false, true] {
            let (a, b) = if backward { ("rocker", "coupler") } else { ("coupler", "rocker") };
            let model = drawing("RSCR")
                .pin("A", "ground", "crank", [0.0, 0.0])
                .joint("B", Spherical, "crank", "coupler", [0.3, 0.4, 0.1], Z)
                .joint("C", Cylindrical, a, b, [1.2, 0.9, -0.2], Z)
                .pin("D", "ground", "rocker", [1.0, 0.0])
                .cut(cut)
                .model();
            assert!(!model.is_planar() && model.size().nv == model.size().rows + 1);
            let mut closing = by(&model, &["A"]);
            assert!(closing.is_explicit(), "{:?}", words(&closing));
            sweep(&model, &mut closing, "A", 0.5, 15);
            if cut == "D" {
                continue;
            }
            let (mut q, mut planar_q) = (model.initial(), planar.initial());
            q[coordinate(&model, "A")] = 0.4;
            planar_q[coordinate(&planar, "A")] = 0.4;
            closing.close(0.0, &mut q).unwrap();
            reference.close(0.0, &mut planar_q).unwrap();
            let (x, y) = (q[coordinate(&model, "D")], planar_q[coordinate(&planar, "D")]);
            assert!((x - y).abs() < 1e-14, "{x} {y}");
        }
    }
    // a skew slide and a skew cylinder on the slider; the input turns the cylinder's other part
    let model = drawing("PSCR")
        .joint("slide", Prismatic, "ground", "slider", [0.0; 3], [1.0, 0.2, 0.1])
        .joint("ball", Spherical, "slider", "rod", [0.1, 0.2, 0.0], Z)
        .joint("cylinder", Cylindrical, "rod", "arm", [0.8, 0.9, 0.3], [0.2, -0.3, 1.0])
        .joint("arm", Revolute, "ground", "arm", [1.5, 0.0, 0.0], [0.0, 1.0, 0.4])
        .model();
    let mut closing = by(&model, &["arm"]);
    assert!(closing.is_explicit(), "{:?}", words(&closing));
    sweep(&model, &mut closing, "arm", 0.3, 10);
    // the arm turned by the slide is no closed form: the axes are skew
    let skew = by(&model, &["slide"]);
    assert!(!skew.is_explicit(), "{:?}", words(&skew));
}

/// Loops by chance: input and output turn or slide, ball on one side, universal, cylindrical or ball on the other,
/// every joint drawn from either side, every one cut. All close in closed form, from either end.
#[test]
fn characteristic_pairs_by_chance() {
    let mut rng = fastrand::Rng::with_seed(31);
    let mut closed = 0;
    for trial in 0..200 {
        let mut vector = |size: f64| [0; 3].map(|_| size * (2.0 * rng.f64() - 1.0));
        let points = [vector(1.0), vector(1.0), vector(1.0), vector(1.0)];
        let axes = [vector(1.0), vector(1.0), vector(1.0), vector(1.0)];
        let second = vector(1.0);
        let names = ["I", "A", "B", "J"];
        let b = [Universal, Cylindrical, Spherical][trial % 3];
        let ends = [Revolute, Prismatic];
        let (input, mut output) = (ends[rng.usize(0..2)], ends[rng.usize(0..2)]);
        if b == Cylindrical {
            output = Prismatic; // turns about skew axes have no closed form there
        }
        let kinds = [input, Spherical, b, output];
        let bodies = ["ground", "x", "z", "y", "ground"];
        let mut d = drawing("by chance");
        for i in 0..4 {
            let (from, to) = if rng.bool() { (bodies[i], bodies[i + 1]) } else { (bodies[i + 1], bodies[i]) };
            d = d.joint(names[i], kinds[i], from, to, points[i], axes[i]).and(second);
        }
        let cut = names[rng.usize(1..4)];
        let model = d.cut(cut).model();
        let spin = if cut == "A" { "B.wx" } else { "A.wx" };
        let inputs: Vec<usize> = if b == Spherical {
            vec![velocity(&model, "I"), velocity(&model, spin)]
        } else {
            vec![velocity(&model, "I")]
        };
        let q0 = model.initial();
        // some drawings stand near a dead point of the input
        let Ok(mut closing) = model.loop_closing(0.0, &q0, Some(&inputs)) else { continue };
        assert!(closing.is_explicit(), "{trial}: {:?}", words(&closing));
        let (mut q, own) = (q0.clone(), branches(&closing));
        let at = coordinate(&model, "I");
        for k in 0..5 {
            q[at] = 0.02 * f64::from(k);
            if closing.close(0.0, &mut q).is_err() {
                break; // a limit within reach
            }
            assert_closed(&model, 0.0, &q, "by chance");
            assert_eq!(branches(&closing), own);
        }
        if closing.state().iter().any(|s| s.pivot < 0.3) || q[at] < 0.08 {
            continue;
        }
        q[at] = 0.06;
        closing.close(0.0, &mut q).unwrap();
        assert_tangent(&model, &mut closing, 0.0, &q);
        closed += 1;
    }
    assert!(closed > 80, "{closed}");
}
