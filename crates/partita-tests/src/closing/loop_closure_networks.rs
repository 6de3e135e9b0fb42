//! Explicit closing of several loops in the plane: what can be ordered into dyads, and what cannot.

use crate::linkages::*;
use partita_system::closing::Closing;
use partita_system::prelude::*;
use std::f64::consts::TAU;

/// All inversions, all choices of the input: explicit wherever a four-bar loop contains the input, implicit otherwise.
#[test]
fn six_bars() {
    let mut explicit = 0;
    let mut implicit = 0;
    for (watt, grounds) in [(true, vec!["t1", "a"]), (false, vec!["a", "c", "t1"])] {
        for ground in grounds {
            let model = six_bar(watt, ground).model();
            for v in 0..model.size().nv {
                let input = model.structure().velocity_name(v);
                let mut closing = by(&model, &[&input]);
                let easy = watt || ["1", "2", "3", "4"].contains(&input.as_str());
                assert_eq!(closing.is_explicit(), easy, "{ground} {input}: {:?}", words(&closing));
                *(if easy { &mut explicit } else { &mut implicit }) += 1;
                sweep(&model, &mut closing, &input, 0.05, 8);
                let mut back = by(&model, &[&input]);
                sweep(&model, &mut back, &input, -0.05, 8);
            }
            // left to itself it finds inputs with closed forms
            assert!(model.loop_closing(0.0, &model.initial(), None).unwrap().is_explicit());
        }
    }
    assert!(explicit >= 15 && implicit >= 5, "{explicit} {implicit}");
}

/// Andrews' squeezing mechanism: three loops, every one a dyad, from any of its two good inputs.
#[test]
fn andrews_squeezer_is_dyads_alone() {
    let beta = -0.061_713_890_014_276_45_f64;
    // points of the mechanism from its lengths: O, F, E, B, A, G, H
    let f = polar(0.007, beta);
    let (a, b) = ([-0.06934, -0.00227], [-0.03635, 0.03273]);
    // EF turned by Theta = 0 against OF: E beyond O
    let e = [f[0] - 0.028 * beta.cos(), f[1] - 0.028 * beta.sin()];
    let g = dyad(a, e, 0.04, 0.02, 1.0);
    let h = dyad(a, e, 0.04, 0.02, -1.0);
    assert!(((e[0] - b[0]).hypot(e[1] - b[1]) - 0.035).abs() < 1e-8);
    let model = drawing("squeezer")
        .pin("beta", "ground", "OF", [0.0; 2])
        .pin("theta", "OF", "EF", f)
        .pin("E", "EF", "EBD", e)
        .pin("B", "ground", "EBD", b)
        .pin("E1", "EBD", "GE", e)
        .pin("G", "GE", "AG", g)
        .pin("A1", "ground", "AG", a)
        .pin("E2", "EBD", "HE", e)
        .pin("H", "HE", "AH", h)
        .pin("A2", "ground", "AH", a)
        .model();
    for input in ["beta", "theta"] {
        let mut closing = by(&model, &[input]);
        assert!(closing.is_explicit());
        let dyads = words(&closing);
        assert_eq!(dyads.len(), 3, "{dyads:?}");
        assert!(dyads.iter().all(|w| w.starts_with("RRR dyad")), "{dyads:?}");
        sweep(&model, &mut closing, input, if input == "beta" { TAU } else { -0.5 }, 40);
    }
}

/// A chain of crank-rockers: the cost grows with the number of loops, the blocks are one a loop.
#[test]
fn chain_of_four_bars() {
    let n = 60;
    let mut d = drawing("chain");
    for i in 0..=n {
        let x = 1.1 * i as f64;
        d = d.pin(&format!("A{i}"), "ground", &format!("upright{i}"), [x, 0.0]);
    }
    for i in 0..n {
        let x = 1.1 * i as f64;
        d = d.pin(&format!("B{i}"), &format!("upright{i}"), &format!("coupler{i}"), [x, 1.0]).pin(
            &format!("C{i}"),
            &format!("coupler{i}"),
            &format!("upright{}", i + 1),
            [x + 1.1, 1.0],
        );
    }
    let model = d.model();
    let mut closing = by(&model, &["A30"]);
    assert_eq!(closing.blocks().len(), n);
    assert!(closing.blocks().iter().all(|b| b.explicit && b.rows.len() == 2));
    let mut q = model.initial();
    for angle in [0.2, 0.7, 1.2] {
        q[coordinate(&model, "A30")] = angle;
        closing.close(0.0, &mut q).unwrap();
        // errors do not add along the chain
        let (closure_error, _) = position(&model, 0.0, &q);
        assert!(closure_error < 1e-14, "{closure_error}");
        assert!((q[coordinate(&model, "A0")] - angle).abs() < 1e-12);
        assert!((q[coordinate(&model, "A60")] - angle).abs() < 1e-12);
    }
}

#[test]
fn five_bar_with_two_inputs() {
    let (b, d) = (polar(0.4, 1.2), [1.0 + 0.4 * 0.5_f64.cos(), 0.4 * 0.5_f64.sin()]);
    let c = dyad(b, d, 1.2, 1.1, 1.0);
    let model = drawing("five-bar")
        .pin("A", "ground", "left", [0.0; 2])
        .pin("B", "left", "reach", b)
        .pin("C", "reach", "arm", c)
        .pin("D", "right", "arm", d)
        .pin("E", "ground", "right", [1.0, 0.0])
        .model();
    let mut closing = by(&model, &["A", "E"]);
    sweep(&model, &mut closing, "A", TAU, 30);
    let mut q = model.initial();
    closing.close(0.0, &mut q).unwrap();
    assert_tangent(&model, &mut closing, 0.0, &q);
    // one input is too few, three are too many
    let one = model.loop_closing(0.0, &q, Some(&[0])).err().unwrap().to_string();
    assert!(one.contains("1 inputs were requested, but the number of degrees of freedom is 2"), "{one}");
}

/// The planar platform on three legs, base angles as inputs: the triad has no closed form, but it closes.
#[test]
fn three_legged_platform_is_one_implicit_block() {
    let mut d = drawing("3-RRR");
    let mut closers = Vec::new();
    for i in 0..3 {
        let direction = (90.0 + 120.0 * f64::from(i)).to_radians();
        let (a, c) = (polar(1.5, direction), polar(0.5, direction + 0.1));
        let b = dyad(a, c, 0.9, 0.9, 1.0);
        let (lower, upper) = (format!("lower{i}"), format!("upper{i}"));
        d = d.pin(&format!("base{i}"), "ground", &lower, a).pin(&format!("elbow{i}"), &lower, &upper, b);
        closers.push((format!("wrist{i}"), upper, c));
    }
    for (name, upper, c) in closers {
        d = d.pin(&name, &upper, "platform", c);
    }
    let model = d.model();
    let mut closing = by(&model, &["base0", "base1", "base2"]);
    assert!(!closing.is_explicit());
    assert_eq!(closing.blocks().iter().map(|b| b.unknown.len()).sum::<usize>(), 4);
    sweep(&model, &mut closing, "base1", 0.3, 12);
    // from a wrist and an elbow on one leg the platform is in place, and all legs are dyads
    let mut closing = by(&model, &["base0", "elbow0", "wrist0"]);
    assert!(closing.is_explicit());
    sweep(&model, &mut closing, "base0", 0.2, 12);
}

/// Many degrees of freedom, too many sets of inputs to look at them all: a long pendulum with loops along it.
#[test]
fn inputs_of_a_large_mechanism_are_found_by_switches() {
    let mut d = drawing("rope ladder");
    let mut last = "ground".to_string();
    for i in 0..14 {
        let y = -1.5 * f64::from(i);
        let names = ["left", "right", "rung"].map(|n| format!("{n}{i}"));
        d = d
            .pin(&format!("a{i}"), &last, &names[0], [0.0, y])
            .pin(&format!("b{i}"), &last, &names[1], [0.8, y])
            .pin(&format!("c{i}"), &names[0], &names[2], [0.1, y - 1.0])
            .pin(&format!("d{i}"), &names[1], &names[2], [0.9, y - 1.1])
            .pin(&format!("e{i}"), &names[2], &format!("bob{i}"), [0.4, y - 1.2]);
        last.clone_from(&names[2]);
    }
    let model = d.model();
    let mut closing = model.loop_closing(0.0, &model.initial(), None).unwrap();
    assert_eq!(closing.inputs().len(), 28);
    assert!(closing.is_explicit());
    let mut q = model.initial();
    for (i, &v) in closing.inputs().to_vec().iter().enumerate() {
        q[v] = 0.1 * (i as f64).sin();
    }
    closing.close(0.0, &mut q).unwrap();
    assert_closed(&model, 0.0, &q, "rope ladder");
    assert_tangent(&model, &mut closing, 0.0, &q);
}

/// A triad without a closed form drives a dyad: implicit first, then explicit again.
#[test]
fn dyads_follow_implicit_blocks() {
    let model = six_bar(false, "c").pin("8", "b", "e", [1.9, 0.9]).pin("9", "e", "f", [2.8, 1.0]).pin(
        "10",
        "ground",
        "f",
        [2.6, 0.0],
    );
    let model = model.model();
    let mut closing = by(&model, &["5"]);
    let kinds: Vec<bool> = closing.blocks().iter().map(|b| b.explicit).collect();
    assert_eq!(kinds, [false, true], "{:?}", words(&closing));
    assert!(words(&closing)[1].starts_with("RRR dyad"));
    sweep(&model, &mut closing, "5", 0.05, 8);
    let both = model.assemblies(0.0, &model.initial(), Some(&[velocity(&model, "5")])).unwrap();
    assert_eq!((both.found.len(), both.notes.len()), (2, 1));
}
