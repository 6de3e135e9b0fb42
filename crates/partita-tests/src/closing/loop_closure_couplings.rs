//! Explicit closing through couplings: gears, racks, screws and cams lead from one loop to the next.

use crate::linkages::*;
use partita_model::spec::JointKind::{Prismatic, Revolute, Screw};
use partita_model::spec::{Coupling, Measure, Table, Value};
use partita_model::Model;
use partita_system::closing::Closing;
use partita_system::prelude::*;
use std::f64::consts::TAU;

fn linear(word: &str, terms: Vec<Measure>, factors: &[f64], offset: f64) -> Coupling {
    Coupling::Linear { name: word.into(), word: word.into(), terms, factors: factors.to_vec(), offset, given_as: None }
}

fn coupled(mut d: Drawing, c: Coupling) -> Drawing {
    d.0.couplings.push(c);
    d
}

/// The geared five-bar: two cranks at the ground, the second turned by the first, their rods meet in a pin.
fn geared_five_bar(ratio: f64) -> Drawing {
    let (b, d) = (polar(0.4, 0.8), [1.0 + 0.3 * 1.9_f64.cos(), 0.3 * 1.9_f64.sin()]);
    let c = dyad(b, d, 0.9, 0.8, 1.0);
    let five = drawing("geared five-bar")
        .pin("A", "ground", "first", [0.0; 2])
        .pin("B", "first", "rod", b)
        .pin("C", "rod", "other", c)
        .pin("D", "second", "other", d)
        .pin("E", "ground", "second", [1.0, 0.0]);
    coupled(five, linear("gear", vec![Measure::joint("E", 0), Measure::joint("A", 0)], &[1.0, -ratio], 0.0))
}

/// Every turn of the crank closed by the gear and one dyad, its branch kept, its tangent that of the rows of C; the
/// gear counts every turn.
#[test]
fn the_geared_five_bar_closes_in_closed_form() {
    for (ratio, input, other) in [(-1.0, "A", "E"), (2.0, "A", "E"), (2.0, "E", "A"), (-0.5, "A", "E")] {
        let model = geared_five_bar(ratio).model();
        let mut closing = by(&model, &[input]);
        assert!(closing.is_explicit());
        let steps = words(&closing);
        assert!(steps.len() == 2 && steps[0] == "gear \"gear\"" && steps[1].starts_with("RRR dyad"), "{steps:?}");
        let q = sweep(&model, &mut closing, input, 3.0 * TAU, 140);
        let (own, turned) = (q[coordinate(&model, input)], q[coordinate(&model, other)]);
        let expected = if input == "A" { ratio * own } else { own / ratio };
        assert!((turned - expected).abs() < 1e-13 && own.abs() > 18.0, "{turned} {expected}");
    }
}

/// Its two assemblies, each with the gear where it was.
#[test]
fn assemblies_go_through_gears() {
    let model = geared_five_bar(-1.0).model();
    let q = model.initial();
    let all = model.assemblies(0.0, &q, Some(&[velocity(&model, "A")])).unwrap();
    assert_eq!((all.found.len(), all.notes.len()), (2, 0));
    let pins = all.found.iter().map(|one| {
        assert_closed(&model, 0.0, &one.q, "assembly");
        assert!((one.q[coordinate(&model, "E")] + one.q[coordinate(&model, "A")]).abs() < 1e-15);
        one.q[coordinate(&model, "B")]
    });
    let pins: Vec<f64> = pins.collect();
    assert!((pins[0] - pins[1]).abs() > 0.1, "{pins:?}");
    // a rocker whose gear turns the crank of a second four-bar: two times two
    let shift = |p: [f64; 2]| [p[0] + 3.0, p[1]];
    let (b, d) = (polar(0.3, 0.7), [1.0, 0.0]);
    let train = four_bar([1.0, 0.3, 0.9, 0.7], 1.0, 1.0)
        .pin("A2", "ground", "crank2", shift([0.0; 2]))
        .pin("B2", "crank2", "coupler2", shift(b))
        .pin("C2", "coupler2", "rocker2", shift(dyad(b, d, 0.9, 0.7, -1.0)))
        .pin("D2", "ground", "rocker2", shift(d));
    let gear = linear("gear", vec![Measure::joint("A2", 0), Measure::joint("D", 0)], &[1.0, 2.5], 0.0);
    let model = coupled(train, gear).model();
    let all = model.assemblies(0.0, &model.initial(), Some(&[velocity(&model, "A")])).unwrap();
    assert_eq!((all.found.len(), all.notes.len()), (4, 0), "{:?}", all.notes);
    for one in &all.found {
        assert_closed(&model, 0.0, &one.q, "assembly");
        let [a, d] = ["A2", "D"].map(|n| one.q[coordinate(&model, n)]);
        assert!((a + 2.5 * d).abs() < 1e-14);
    }
}

/// Where the gear only says what the loop says already, assemblies that break it are left out.
#[test]
fn a_superfluous_gear_leaves_out_assemblies() {
    let parallel = four_bar([1.0, 0.5, 1.0, 0.5], 1.0, 1.0);
    let crossed = |d: Drawing| {
        let model = d.model();
        model.assemblies(0.0, &model.initial(), Some(&[velocity(&model, "A")])).unwrap().found.len()
    };
    assert_eq!(crossed(parallel.clone()), 2);
    let gear = linear("gear", vec![Measure::joint("A", 0), Measure::joint("D", 0)], &[1.0, -1.0], 0.0);
    assert_eq!(crossed(coupled(parallel, gear)), 1);
}

/// A cam whose follower pushes a slider-crank, a rack behind its crank; a screw and a gear in space.
#[test]
fn cams_racks_and_screws() {
    let two = |a: &str, b: &str| vec![Measure::joint(a, 0), Measure::joint(b, 0)];
    // lift 0.02 (1 − cos) as a cubic spline would be: one cubic of a period's half, and back
    let half = TAU / 2.0;
    let (cube, square) = (-0.08 / half.powi(3), 0.12 / half.powi(2));
    let curve = Table {
        breaks: vec![0.0, half, TAU],
        coefficients: vec![[cube, square, 0.0, 0.0], [-cube, -square, 0.0, 0.04]],
    };
    let cam = Coupling::Curve { name: "cam".into(), word: "cam".into(), terms: two("D", "cam"), curve, periodic: true };
    let driven =
        slider_crank().pin("cam", "ground", "disc", [2.0, 0.0]).slide("rack", "ground", "bar", [0.0, 1.0], [1.0, 0.0]);
    let driven = coupled(coupled(driven, cam), linear("rack", two("rack", "A"), &[1.0, -0.1], 0.0));
    let model = driven.model();
    let mut closing = by(&model, &["cam"]);
    assert!(closing.is_explicit());
    let words = words(&closing);
    assert_eq!((words[0].as_str(), words[2].as_str()), ("cam \"cam\"", "rack \"rack\""), "{words:?}");
    let q = sweep(&model, &mut closing, "cam", 2.5 * TAU, 100);
    let [lift, crank, bar] = ["D", "A", "rack"].map(|n| q[coordinate(&model, n)]);
    assert!((lift - 0.04).abs() < 1e-15 && (bar - 0.1 * crank).abs() < 1e-15);
    let space = rssr("U")
        .joint("nut", Screw, "ground", "nut", [3.0, 0.0, 0.0], Z)
        .joint("slide", Prismatic, "nut", "weight", [3.0, 1.0, 0.0], [1.0, 0.2, 0.1])
        .joint("wheel", Revolute, "ground", "wheel", [0.0, 2.0, 0.0], [1.0, 0.0, 0.0]);
    let mut space = coupled(space, linear("gear", two("nut", "rocker"), &[1.0, 3.0], 0.0));
    for j in &mut space.0.joints {
        if j.name == "nut" {
            j.pitch = Some(0.05);
        }
    }
    // three readings, one of them a slide
    let third = vec![Measure::joint("slide", 0), Measure::joint("nut", 1), Measure::joint("wheel", 0)];
    let model = coupled(space, linear("differential", third, &[2.0, 1.0, -0.3], 0.0)).model();
    let mut closing = by(&model, &["crank", "wheel"]);
    assert!(closing.is_explicit(), "{:?}", closing.blocks());
    let q = sweep(&model, &mut closing, "crank", 1.0, 30);
    let names: Vec<String> = model.zero_position().coordinate_names.to_vec();
    assert!(q.iter().all(|x| x.is_finite()), "{names:?}");
}

/// A distance closes by Newton's method, and says so; a drive of a joint that closes a loop as well.
#[test]
fn other_conditions_close_implicitly() {
    let mut held = geared_five_bar(-1.0);
    held.0.couplings.clear();
    // body axes start where a body is first drawn: the second crank at the pin D
    let (from, to) = ([0.3, 0.5], [1.0 + 0.3 * 1.9_f64.cos() + 0.2, 0.3 * 1.9_f64.sin() + 0.1]);
    let measure = Measure::Distance {
        body1: "ground".into(),
        point1: [from[0], from[1], 0.0],
        body2: "second".into(),
        point2: [0.2, 0.1, 0.0],
    };
    let length = (to[0] - from[0]).hypot(to[1] - from[1]);
    let model = coupled(held, linear("distance", vec![measure], &[1.0], length)).model();
    let mut closing = by(&model, &["A"]);
    assert!(!closing.is_explicit());
    let mut q = model.initial();
    let at = coordinate(&model, "A");
    for k in 0..20 {
        q[at] = 0.02 * f64::from(k);
        closing.close(0.0, &mut q).unwrap();
        assert_closed(&model, 0.0, &q, "a distance");
    }
    let all = model.assemblies(0.0, &model.initial(), Some(&[velocity(&model, "A")])).unwrap();
    assert!(all.notes.iter().any(|n| n.contains("implicit block")), "{:?}", all.notes);
    let ramp = Table { breaks: vec![0.0, 1.0], coefficients: vec![[0.0, 0.0, 0.3, 0.0]] };
    let bar = four_bar([1.0, 0.3, 0.9, 0.7], 1.0, 1.0).cut("C").drive("C", Value::Table(ramp));
    let model: Model = bar.model();
    assert!(model.drives()[0].tree.is_none());
    let mut closing = model.loop_closing(0.0, &model.initial(), None).unwrap();
    let mut q = model.initial();
    for k in 0..10 {
        let t = 0.1 * f64::from(k);
        closing.close(t, &mut q).unwrap();
        assert_closed(&model, t, &q, "a drive of a cut joint");
    }
    assert_eq!(
        closing.inputs().len() + closing.blocks().iter().map(|b| b.unknown.len()).sum::<usize>(),
        model.size().nv
    );
}
