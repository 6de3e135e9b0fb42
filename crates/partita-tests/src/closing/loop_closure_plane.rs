//! Explicit closing of one loop in the plane: dyads of every kind, their branches, limits and assemblies.

use crate::linkages::*;
use partita_model::spec::{Table, Value};
use partita_model::Model;
use partita_system::closing::Closing;
use partita_system::prelude::*;
use partita_system::SystemError;
use std::f64::consts::TAU;

/// Benchmark 11: Grashof's crank turns fully, the branch is kept; for every joint that may be cut.
#[test]
fn grashof_crank_turns_fully_whatever_is_cut() {
    for cut in ["B", "C", "D"] {
        for sign in [1.0, -1.0] {
            let model = four_bar([1.0, 0.5, 1.2, 0.8], 0.7, sign).cut(cut).model();
            let mut closing = by(&model, &["A"]);
            assert_eq!(closing.blocks().len(), 1);
            assert!(closing.is_explicit() && words(&closing)[0].starts_with("RRR dyad"), "{:?}", words(&closing));
            let end = sweep(&model, &mut closing, "A", TAU, 50);
            // the rocker swings and comes back, the coupler does not turn around either
            let start = model.initial();
            for (i, (a, b)) in end.iter().zip(&start).enumerate() {
                let turns = ((a - b) / TAU).round();
                assert!((a - b - turns * TAU).abs() < 1e-13, "coordinate {i}: {a} after {b}");
            }
        }
    }
}

#[test]
fn a_thousand_turns_keep_the_branch() {
    let model = four_bar([1.0, 0.5, 1.2, 0.8], 0.7, 1.0).model();
    let mut closing = by(&model, &["A"]);
    let (mut q, at) = (model.initial(), coordinate(&model, "A"));
    closing.close(0.0, &mut q).unwrap();
    let own = branches(&closing);
    for k in 0..4000 {
        // a quarter of a turn and a little, so that all angles are met
        q[at] = 0.2505 * TAU * f64::from(k);
        closing.close(0.0, &mut q).unwrap();
        assert_closed(&model, 0.0, &q, "thousand turns");
        assert_eq!(branches(&closing), own);
    }
    // the angle of the coupler to the crank has made all turns of the crank, backwards
    let relative = q[coordinate(&model, "B")];
    assert!((relative + q[at]).abs() < TAU, "{relative} after {}", q[at]);
}

/// Reference data of the four-bar: l = (1, 2.5, 2), d = 2.2, drawn at 0.3 rad and closed
/// at the crank angle 0.8: φ and A; it is one of the two assemblies.
#[test]
fn reference_four_bar_closed_forms() {
    let model = four_bar([2.2, 1.0, 2.5, 2.0], 0.3, 1.0).cut("D").model();
    let all = model.assemblies(0.0, &model.initial(), Some(&[velocity(&model, "A")])).unwrap();
    assert_eq!(all.found.len(), 2);
    let mut seen = 0;
    for sign in [1.0, -1.0] {
        let model = four_bar([2.2, 1.0, 2.5, 2.0], 0.3, sign).cut("D").model();
        let mut closing = by(&model, &["A"]);
        let mut q = model.initial();
        q[coordinate(&model, "A")] = 0.8 - 0.3;
        closing.close(0.0, &mut q).unwrap();
        let start = absolute_angles(0.3, sign);
        let phi2 = start[1] + q[0] + q[1];
        let phi3 = start[2] + q[0] + q[1] + q[2];
        let near = |a: f64, b: f64| (a - b - ((a - b) / TAU).round() * TAU).abs() < 1e-12;
        if near(phi2, 0.477935466983) {
            assert!(near(phi3, -1.937228058039), "{phi3}");
            let (_, c) = position(&model, 0.0, &q);
            let det = c[0][1] * c[1][2] - c[0][2] * c[1][1];
            let a2 = -(c[0][0] * c[1][2] - c[0][2] * c[1][0]) / det;
            let a3 = -(c[0][1] * c[1][0] - c[0][0] * c[1][1]) / det;
            // relative angles: A of the absolute ones less that of the link before
            assert!((a2 + 1.236935882644).abs() < 1e-11 && (a3 - 0.475210113261).abs() < 1e-11, "{a2} {a3}");
            seen += 1;
        }
    }
    assert_eq!(seen, 1);
}

/// Absolute angles of crank, coupler and rocker (from C to D) of the reference four-bar.
fn absolute_angles(crank: f64, sign: f64) -> [f64; 3] {
    let (b, d) = (polar(1.0, crank), [2.2, 0.0]);
    let c = dyad(b, d, 2.5, 2.0, sign);
    [crank, (c[1] - b[1]).atan2(c[0] - b[0]), (d[1] - c[1]).atan2(d[0] - c[0])]
}

/// Closed form x = a cos φ ± √(l² − (a sin φ − e)²), for every cut.
#[test]
fn slider_crank_with_offset() {
    let (a, l, e) = (0.05, 0.2, 0.02);
    let crank = 0.6_f64;
    let pin = polar(a, crank);
    let x0 = pin[0] + (l * l - (pin[1] - e) * (pin[1] - e)).sqrt();
    let draw = || {
        drawing("slider-crank")
            .pin("crank", "ground", "crank", [0.0; 2])
            .pin("pin", "crank", "rod", pin)
            .pin("wrist", "rod", "slider", [x0, e])
            .slide("slide", "ground", "slider", [x0, e], [1.0, 0.0])
    };
    for cut in ["pin", "wrist", "slide"] {
        let model = draw().cut(cut).model();
        let mut closing = by(&model, &["crank"]);
        assert_eq!(words(&closing), ["RRP dyad (joints \"pin\", \"wrist\", \"slide\")"]);
        sweep(&model, &mut closing, "crank", TAU, 40);
        let mut q = model.initial();
        q[0] = 2.1;
        closing.close(0.0, &mut q).unwrap();
        let phi = crank + 2.1;
        let x = a * phi.cos() + (l * l - (a * phi.sin() - e) * (a * phi.sin() - e)).sqrt();
        let mut s = model.scratch();
        model.equations().look(&q, &vec![0.0; model.size().nv], s.equations());
        let slider = model.spec.bodies.iter().position(|b| b.name == "slider").unwrap();
        let moved = model.body_state(slider, &s).position.0;
        assert!((moved[0] - x).abs() < 1e-15 && (moved[1] - e).abs() < 1e-15, "{moved:?} {x}");
        // pivot: cosine of the rod's angle to the slide
        let cosine = (1.0 - ((a * phi.sin() - e) / l).powi(2)).sqrt();
        assert!((closing.state()[0].pivot - cosine).abs() < 1e-14);
    }
    // driven from the slide it has dead points; the crank is a dyad of another kind then
    let model = draw().cut("wrist").model();
    let mut closing = by(&model, &["slide"]);
    assert!(words(&closing)[0].starts_with("RRR dyad"), "{:?}", words(&closing));
    sweep(&model, &mut closing, "slide", -0.03, 10);
}

/// Quick-return: a block slides along the lever, r = ε √(|P − Q|² − e²).
#[test]
fn inverted_slider_crank() {
    for cut in ["pin", "slide", "lever"] {
        let at = polar(0.1, 0.4);
        let model = drawing("quick return")
            .pin("crank", "ground", "crank", [0.0; 2])
            .pin("pin", "crank", "block", at)
            .slide("slide", "block", "lever", at, [at[0] + 0.02, at[1] + 0.3])
            .pin("lever", "ground", "lever", [0.01, -0.3])
            .cut(cut)
            .model();
        let mut closing = by(&model, &["crank"]);
        assert!(words(&closing)[0].starts_with("RPR dyad"), "{:?}", words(&closing));
        sweep(&model, &mut closing, "crank", 2.0 * TAU, 60);
    }
}

/// Scotch yoke x = a cos φ, and the elliptic trammel.
#[test]
fn two_slides() {
    for cut in ["pin", "slot", "guide"] {
        let at = polar(0.3, 0.4);
        let model = drawing("scotch yoke")
            .pin("crank", "ground", "crank", [0.0; 2])
            .pin("pin", "crank", "block", at)
            .slide("slot", "block", "yoke", at, [0.0, 1.0])
            .slide("guide", "ground", "yoke", [0.0, 0.0], [1.0, 0.0])
            .cut(cut)
            .model();
        let mut closing = by(&model, &["crank"]);
        assert!(words(&closing).iter().any(|w| w.starts_with("RPP dyad")), "{:?}", words(&closing));
        sweep(&model, &mut closing, "crank", TAU, 30);
        if cut != "guide" {
            let mut q = model.initial();
            q[0] = 5.0;
            closing.close(0.0, &mut q).unwrap();
            let x = q[coordinate(&model, "guide")];
            assert!((x - (0.3 * 5.4_f64.cos() - at[0])).abs() < 1e-15);
        }
    }
    let (c, s) = (0.8, 0.6);
    for cut in ["x", "y", "at x", "at y"] {
        let model = drawing("trammel")
            .slide("x", "ground", "block x", [c, 0.0], [1.0, 0.0])
            .slide("y", "ground", "block y", [0.0, s], [0.0, 1.0])
            .pin("at x", "block x", "bar", [c, 0.0])
            .pin("at y", "block y", "bar", [0.0, s])
            .cut(cut)
            .model();
        let input = if cut == "x" { "y" } else { "x" };
        let mut closing = by(&model, &[input]);
        sweep(&model, &mut closing, input, -0.3, 20);
    }
}

/// Three slides between wedges: the rows of the turns are redundant.
#[test]
fn wedges() {
    let model = drawing("wedges")
        .slide("floor", "ground", "wedge", [0.0, 0.0], [1.0, 0.0])
        .slide("wall", "ground", "rod", [0.0, 1.0], [0.0, 1.0])
        .slide("face", "wedge", "rod", [0.0, 0.5], [0.8, 0.6])
        .model();
    let mut closing = by(&model, &["floor"]);
    sweep(&model, &mut closing, "floor", 0.7, 10);
    let mut q = model.initial();
    q[coordinate(&model, "floor")] = 0.4;
    closing.close(0.0, &mut q).unwrap();
    // the rod rises or sinks along the face: slope 3/4
    assert!((q[coordinate(&model, "wall")] + 0.3).abs() < 1e-15, "{q:?}");
}

/// Two assemblies of a four-bar are mirror images about the line from B to D.
#[test]
fn assemblies_are_mirror_images() {
    let model = four_bar([1.0, 0.5, 1.2, 0.8], 0.7, 1.0).cut("C").model();
    let q = model.initial();
    let all = model.assemblies(0.0, &q, Some(&[velocity(&model, "A")])).unwrap();
    assert_eq!((all.found.len(), all.blocks.len(), all.notes.len()), (2, 1, 0));
    assert!(all.found.iter().all(|a| a.residual < 1e-15));
    assert_eq!(all.found[0].branches[0], -all.found[1].branches[0]);
    let mut s = model.scratch();
    let points: Vec<[f64; 2]> = all
        .found
        .iter()
        .map(|a| {
            model.equations().look(&a.q, &vec![0.0; model.size().nv], s.equations());
            let at = model.joint_state(2, &a.q, &vec![0.0; model.size().nv], &s).point;
            [at[0], at[1]]
        })
        .collect();
    let b = polar(0.5, 0.7);
    for (p, sign) in points.iter().zip([1.0, -1.0]) {
        let expected = dyad(b, [1.0, 0.0], 1.2, 0.8, sign);
        assert!((p[0] - expected[0]).abs() < 1e-15 && (p[1] - expected[1]).abs() < 1e-15);
    }
    // a six-bar has four, some of which may not close
    let model = six_bar(true, "t1").model();
    let all = model.assemblies(0.0, &model.initial(), Some(&[velocity(&model, "1")])).unwrap();
    assert_eq!(all.found.len(), 4);
    // an implicit block is reported
    let model = six_bar(false, "c").model();
    let all = model.assemblies(0.0, &model.initial(), Some(&[velocity(&model, "5")])).unwrap();
    assert!(all.notes.iter().any(|n| n.contains("only the solution near")), "{:?}", all.notes);
}

/// At a limit the shortfall is what the lengths miss: |BD| − (l2 + l3).
#[test]
fn limits_report_the_shortfall() {
    // double rocker: the crank cannot pass the ground line on the far side
    let lengths = [1.0, 0.8, 0.5, 0.6];
    let model = four_bar(lengths, 0.6, 1.0).model();
    let mut closing = by(&model, &["A"]);
    let mut q = model.initial();
    q[coordinate(&model, "A")] = 2.5 - 0.6;
    let b = polar(0.8, 2.5);
    let missing = (b[0] - 1.0).hypot(b[1]) - 1.1;
    assert!(missing > 0.0);
    match closing.close(0.25, &mut q) {
        Err(SystemError::Limit { block, t, shortfall }) => {
            assert_eq!((block.as_str(), t), ("RRR dyad (joints \"B\", \"C\", \"D\")", 0.25));
            assert!((shortfall - missing).abs() < 1e-14, "{shortfall} {missing}");
        }
        other => panic!("{other:?}"),
    }
    // slider-crank with a rod shorter than the crank
    let pin = polar(0.3, 0.2);
    let x = pin[0] + (0.04 - pin[1] * pin[1]).sqrt();
    let model = drawing("short rod")
        .pin("crank", "ground", "crank", [0.0; 2])
        .pin("pin", "crank", "rod", pin)
        .pin("wrist", "rod", "slider", [x, 0.0])
        .slide("slide", "ground", "slider", [x, 0.0], [1.0, 0.0])
        .model();
    let mut closing = by(&model, &["crank"]);
    let mut q = model.initial();
    q[0] = 1.3;
    match closing.close(0.0, &mut q) {
        Err(SystemError::Limit { shortfall, .. }) => {
            assert!((shortfall - (0.3 * 1.5_f64.sin() - 0.2)).abs() < 1e-14, "{shortfall}")
        }
        other => panic!("{other:?}"),
    }
}

/// A driven crank is no input: nothing is left free, the closing follows time.
#[test]
fn drives_are_steps_of_their_own() {
    let table = Table { breaks: vec![0.0, 10.0], coefficients: vec![[0.0, 0.0, 1.5, 0.0]] };
    let model = four_bar([1.0, 0.5, 1.2, 0.8], 0.7, 1.0).drive("A", Value::Table(table)).model();
    let q0 = model.initial();
    let mut closing = model.loop_closing(0.0, &q0, None).unwrap();
    assert!(closing.inputs().is_empty());
    assert_eq!(closing.blocks().iter().filter(|b| b.words == "drive \"drive of A\"").count(), 1);
    let mut q = q0.clone();
    for k in 0..40 {
        let t = 0.25 * f64::from(k);
        closing.close(t, &mut q).unwrap();
        assert_closed(&model, t, &q, "driven");
        assert!((q[0] - 1.5 * t).abs() < 1e-15 * (1.0 + 1.5 * t));
    }
    let refused = model.loop_closing(0.0, &q0, Some(&[0])).err().unwrap().to_string();
    assert!(refused.contains("is driven by"), "{refused}");
}

/// A parallelogram with a third, redundant rocker: the closed forms close all of it.
#[test]
fn redundant_parallelogram() {
    let model = drawing("parallelogram")
        .pin("A", "ground", "left", [0.0, 0.0])
        .pin("B", "left", "beam", [0.2, 1.0])
        .pin("C", "beam", "middle", [1.2, 1.0])
        .pin("D", "ground", "middle", [1.0, 0.0])
        .pin("E", "beam", "right", [3.2, 1.0])
        .pin("F", "ground", "right", [3.0, 0.0])
        .model();
    let mut closing = by(&model, &["A"]);
    assert!(closing.is_explicit());
    let rows: usize = closing.blocks().iter().map(|b| b.rows.len()).sum();
    assert_eq!((model.size().rows, rows), (4, 3));
    let mut q = model.initial();
    for angle in [0.3, -0.4, 0.9] {
        q[0] = angle;
        closing.close(0.0, &mut q).unwrap();
        assert_closed(&model, 0.0, &q, "parallelogram");
    }
}

/// Targets are met in one go, on the branch of the walk, whole turns counted.
#[test]
fn placing_equals_walking() {
    let model = four_bar([1.0, 0.5, 1.2, 0.8], 0.7, 1.0).model();
    let q = model.initial();
    let at = coordinate(&model, "A");
    for target in [1.0, -2.0, 9.0] {
        let placed = model.at_targets(0.0, &q, &[(at, target)]).unwrap();
        let mut walked = q.clone();
        partita_system::kinematics::assembly::move_to(&model, 0.0, &mut walked, &[(at, target)], 1e-12).unwrap();
        for (a, b) in placed.iter().zip(&walked) {
            assert!((a - b).abs() < 1e-10, "{placed:?} {walked:?}");
        }
    }
    // a parallelogram in line may go on either way: the walk decides
    let square = four_bar([1.0, 0.5, 1.0, 0.5], 0.7, 1.0).model();
    assert!(square.at_targets(0.0, &square.initial(), &[(coordinate(&square, "A"), 0.9)]).is_some());
    assert_eq!(square.at_targets(0.0, &square.initial(), &[(coordinate(&square, "A"), 3.0)]), None);
    // out of reach, or not a set of inputs: not its business
    let rocker = coordinate(&model, "D");
    assert_eq!(model.at_targets(0.0, &q, &[(rocker, 3.0)]), None);
    assert_eq!(model.at_targets(0.0, &q, &[(at, 1.0), (rocker, 0.1)]), None);
    assert_eq!(model.at_targets(0.0, &q, &[]), None);
    assert_eq!(model.at_targets(0.0, &q, &[(at, f64::NAN)]), None);
}

#[test]
fn what_cannot_be_is_refused_in_words() {
    let spec = four_bar([1.0, 0.5, 1.2, 0.8], 0.7, 1.0).0;
    let absolute = Model::new(
        spec.clone(),
        std::sync::Arc::new(partita_model::value::NoFunctions),
        partita_model::zero_position::Coordinates::Absolute,
    )
    .unwrap();
    let refused = absolute.loop_closing(0.0, &absolute.initial(), None).err().unwrap().to_string();
    assert!(refused.contains("use relative coordinates"), "{refused}");
    let model = Drawing(spec).model();
    let mut open = model.initial();
    open[1] += 0.1;
    let refused = model.loop_closing(0.0, &open, None).err().unwrap().to_string();
    assert!(refused.contains("assemble first"), "{refused}");
    let refused = model.loop_closing(0.0, &model.initial(), Some(&[7])).err().unwrap().to_string();
    assert!(refused.contains("different numbers of velocities below 3"), "{refused}");
    let mut closing = by(&model, &["A"]);
    let mut q = model.initial();
    q[0] = f64::NAN;
    assert!(matches!(closing.close(0.0, &mut q), Err(SystemError::NotFinite { .. })));
    assert_eq!(Model::closing((&model).into(), 0.0, &model.initial(), None).unwrap().blocks().len(), 1);
}

/// Inputs that jump by turns: a slide that is cut locks its angle with all its turns, and the nearest angles of the
/// others must add up to them.
#[test]
fn jumps_keep_the_whole_turns_of_slides() {
    let mut rng = fastrand::Rng::with_seed(5);
    let at = polar(0.1, 0.4);
    let model = drawing("quick return")
        .pin("crank", "ground", "crank", [0.0; 2])
        .pin("pin", "crank", "block", at)
        .slide("slide", "block", "lever", at, [at[0] - 0.005, at[1] - 0.05])
        .pin("lever", "ground", "lever", [0.01, 0.05])
        .cut("slide")
        .model();
    // the lever turns with the crank: both angles grow with it
    let mut closing = by(&model, &["crank"]);
    let mut q = model.initial();
    for _ in 0..500 {
        q[coordinate(&model, "crank")] = 40.0 * (rng.f64() - 0.5);
        closing.close(0.0, &mut q).unwrap();
        assert_closed(&model, 0.0, &q, "jump");
    }
}

/// On the way into a limit the loops stay closed to the last digit, whatever is left of the pivot; at the exactly flat
/// position they close, beyond it the shortfall is reported.
#[test]
fn closed_up_to_the_limit() {
    let lengths = [1.0, 0.8, 0.5, 0.6];
    let model = four_bar(lengths, 0.6, 1.0).model();
    let mut closing = by(&model, &["A"]);
    // |BD| = l2 + l3
    let limit = ((1.0 + 0.64 - 1.21) / (2.0 * 0.8_f64)).acos();
    for exponent in 1..16 {
        let before = 10.0_f64.powi(-exponent);
        let mut q = model.initial();
        q[coordinate(&model, "A")] = limit - before - 0.6;
        closing.close(0.0, &mut q).unwrap();
        assert_closed(&model, 0.0, &q, "near the limit");
        // sin μ² ≈ 2 (1 + cos μ),  cos μ = (l2² + l3² − R²)/(2 l2 l3)
        let r2 = 1.64 - 1.6 * (limit - before).cos();
        let cosine = (0.61 - r2) / 0.6;
        let sine2 = 1.0 - cosine * cosine;
        assert!((closing.state()[0].pivot.powi(2) - sine2).abs() < 1e-14);
        q[coordinate(&model, "A")] = limit + before - 0.6;
        if exponent < 15 {
            assert!(matches!(closing.close(0.0, &mut q), Err(SystemError::Limit { .. })), "{before} beyond");
        }
    }
}
