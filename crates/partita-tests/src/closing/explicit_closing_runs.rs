//! Runs with the loops closed explicitly: a thousand turns on one branch, assemblies that are kept, limits that are
//! told.

use crate::linkages::*;
use partita_integrate::options::Options;
use partita_integrate::simulate::{simulate, Outcome, Settings, Status};
use partita_integrate::tableau::DOP853;
use partita_model::spec::{Table, Value};
use partita_model::Model;
use partita_system::closing::Closing;
use partita_system::formulation::registry;
use partita_system::kinematics::velocity;
use partita_system::options::FormulationOptions;
use partita_system::positions::turns;
use partita_system::record::Output;
use partita_system::reduction::Reduction;
use partita_system::{start, SystemError};
use std::f64::consts::TAU;
use std::ops::ControlFlow;

/// Angles of up to 25 rad are rounded by 3.6e-15 before their turns are taken off; this is the largest |Φ| over the
/// size of the mechanism that three or four of them may leave.
const CLOSED: f64 = 1e-14;

/// A run from the drawing with given rates, closing and independent velocities by the rule of that name.
struct Run<'m> {
    model: &'m Model,
    rule: &'m str,
    inputs: Option<&'m [usize]>,
    rates: &'m [(usize, f64)],
    rtol: f64,
    t_eval: Vec<f64>,
}

impl Run<'_> {
    fn march(&self, mut see: impl FnMut(&Output)) -> (Outcome, Vec<String>) {
        let (model, q) = (self.model, self.model.initial());
        let rank = start::analyse(model, 0.0, &q).unwrap().rank;
        let mut r = Reduction::new(model, rank);
        start::choose_partition(&mut r, 0.0, &q, None, None).unwrap();
        let v = velocity::with_rates(&mut r, 0.0, &q, self.rates).unwrap();
        let independent = self.inputs.map(<[usize]>::to_vec);
        let options = FormulationOptions { independent, ..FormulationOptions::default() };
        let mut f = registry::by_name(self.rule, model, rank, &options).unwrap();
        let settings = Settings {
            t_end: *self.t_eval.last().unwrap(),
            method: &DOP853,
            options: Options { rtol: self.rtol, atol: (0.01 * self.rtol).into(), ..Options::default() },
            max_steps: 1_000_000,
        };
        let mut sink = |s: &Output| {
            see(s);
            Ok(())
        };
        let go_on = &mut |_: f64| ControlFlow::Continue(());
        let outcome = simulate(&mut *f, 0.0, &q, &v, &self.t_eval, &settings, &mut sink, go_on).unwrap();
        (outcome, f.history().notes)
    }
}

/// Largest difference of coordinates, whole turns aside.
fn apart(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).fold(0.0, |m: f64, (x, y)| {
        let d = x - y;
        m.max((d - (d / TAU).round() * TAU).abs())
    })
}

/// A thousand turns of the crank without gravity: every output closed to round-off, on the branches of the start (a
/// closing that never leaves them finds the same position for the crank's angle), every turn counted.
fn a_thousand_turns(drawing: Drawing, names: &[&str]) {
    let model = drawing.weightless().model();
    let mut inputs: Vec<usize> = names.iter().map(|n| velocity(&model, n)).collect();
    inputs.sort_unstable();
    let (crank, rate) = (velocity(&model, names[0]), 10.0 * TAU);
    let at = coordinate(&model, names[0]);
    let mut kept = model.loop_closing(0.0, &model.initial(), Some(&inputs)).unwrap();
    kept.close(0.0, &mut model.initial()).unwrap();
    let own = branches(&kept);
    // ten turns a second at the start, a few outputs in each turn; the crank may speed up or slow down with its load
    let t_eval: Vec<f64> = (1..=4700).map(|i| 0.025 * f64::from(i)).collect();
    let run = Run {
        model: &model,
        rule: "explicit-closing",
        inputs: Some(&inputs),
        rates: &[(crank, rate)],
        rtol: 1e-8,
        t_eval,
    };
    let (mut worst, mut strayed) = (0.0f64, 0.0f64);
    let (mut angle, mut counted, mut slowest) = (0.0f64, 0.0f64, f64::INFINITY);
    let mut last = 0.0f64;
    let (outcome, notes) = run.march(|s| {
        worst = worst.max(closure_error(&model, s));
        let mut q = s.q.clone();
        kept.close(0.0, &mut q).unwrap();
        assert_eq!(branches(&kept), own);
        strayed = strayed.max(apart(&q, &s.q));
        angle = turns::whole(s.q[at], s.turns[at]);
        // counted anew from the angle modulo a turn: outputs are less than half a turn apart
        let d = s.q[at] - last;
        counted += d - (d / TAU).round() * TAU;
        last = s.q[at];
        slowest = slowest.min(s.v[crank]);
    });
    assert_eq!(outcome.status, Status::Finished, "{}", outcome.message);
    assert!(worst <= CLOSED * model.extent(), "closure {worst:e} of {}", model.extent());
    // the same closed form at the same angle; half the digits of a pivot of 0.1 lie between
    assert!(strayed < 1e-13, "off the branch by {strayed:e}");
    assert!(slowest > 0.0 && angle > 1000.0 * TAU, "{} turns", angle / TAU);
    assert!((angle - counted).abs() < 1e-6, "{angle} {counted}");
    // no block went over to its other branch
    assert!(notes.iter().all(|n| !n.contains("change")), "{notes:?}");
}

#[test]
fn a_thousand_turns_of_the_four_bar() {
    a_thousand_turns(four_bar([1.0, 0.3, 0.9, 0.7], 1.0, 1.0), &["A"]);
}

#[test]
fn a_thousand_turns_of_the_slider_crank() {
    a_thousand_turns(slider_crank(), &["A"]);
}

#[test]
fn a_thousand_turns_of_watts_six_bar() {
    a_thousand_turns(watt(), &["A"]);
}

#[test]
fn a_thousand_turns_of_stephensons_six_bar() {
    a_thousand_turns(stephenson(), &["A"]);
}

/// The rod's spin about itself is the second input; measured along the rod's own z axis it is seen at every angle.
#[test]
fn a_thousand_turns_of_rssr() {
    a_thousand_turns(rssr("S").cut("B"), &["crank", "A.wz"]);
}

/// The closing alone, at angles all over a thousand turns.
#[test]
fn closings_over_a_thousand_turns_keep_branch_and_closure() {
    let all = [
        (four_bar([1.0, 0.3, 0.9, 0.7], 1.0, 1.0), vec!["A"]),
        (slider_crank(), vec!["A"]),
        (watt(), vec!["A"]),
        (stephenson(), vec!["A"]),
        (rssr("S").cut("B"), vec!["crank", "A.wz"]),
    ];
    for (drawing, names) in all {
        let model = drawing.model();
        let inputs: Vec<usize> = names.iter().map(|n| velocity(&model, n)).collect();
        let mut closing = model.loop_closing(0.0, &model.initial(), Some(&inputs)).unwrap();
        let (mut q, at) = (model.initial(), coordinate(&model, names[0]));
        closing.close(0.0, &mut q).unwrap();
        let own = branches(&closing);
        for k in 0..7000 {
            // a seventh of a turn and a little
            q[at] = 0.14301 * TAU * f64::from(k);
            closing.close(0.0, &mut q).unwrap();
            assert_closed(&model, 0.0, &q, &model.spec.name);
            assert_eq!(branches(&closing), own);
        }
        assert!(q[at] > 1000.0 * TAU);
    }
}

const GRASHOF: [f64; 4] = [1.0, 0.5, 1.2, 0.8];

/// Benchmark 11: ground 1.0, crank 0.5, coupler 1.2, rocker 0.8 through whole revolutions, in both assemblies, whatever
/// the rule.
#[test]
fn grashof_keeps_its_assembly_in_every_rule() {
    for sign in [1.0, -1.0] {
        let model = four_bar(GRASHOF, 0.7, sign).model();
        let other = four_bar(GRASHOF, 0.7, -sign).model();
        let crank = velocity(&model, "A");
        let mut own = model.loop_closing(0.0, &model.initial(), Some(&[crank])).unwrap();
        for rule in ["projective", "wehage-haug", "explicit-closing"] {
            for inputs in [None, Some(&[crank][..])] {
                let t_eval = (1..=60).map(|i| 0.02 * f64::from(i)).collect();
                let run = Run { model: &model, rule, inputs, rates: &[(crank, 2.0 * TAU)], rtol: 1e-9, t_eval };
                let (mut angle, mut strayed) = (0.0, 0.0f64);
                let (outcome, _) = run.march(|s| {
                    let mut q = s.q.clone();
                    own.close(0.0, &mut q).unwrap();
                    strayed = strayed.max(apart(&q, &s.q));
                    angle = turns::whole(s.q[0], s.turns[0]);
                });
                assert_eq!(outcome.status, Status::Finished, "{rule}: {}", outcome.message);
                assert!(angle > 1.5 * TAU, "{rule}: {angle}");
                assert!(strayed < 1e-12, "{rule}, assembly {sign}: off by {strayed:e}");
            }
        }
        // and the other assembly is another one: at the same angle its rocker stands elsewhere
        assert!(apart(&absolute(&model), &absolute(&other)) > 0.5);
    }
}

/// Angles of the bodies as drawn: of coupler and rocker from their pins.
fn absolute(model: &Model) -> Vec<f64> {
    let at = |name: &str| model.spec.joints.iter().find(|j| j.name == name).unwrap().point;
    let (b, c, d) = (at("B"), at("C"), at("D"));
    vec![(c[1] - b[1]).atan2(c[0] - b[0]), (c[1] - d[1]).atan2(c[0] - d[0])]
}

/// Crank 0.8, coupler 0.5, rocker 0.6 on a ground of 1: the crank swings, B may be 1.1 from D at the most.
const SWINGING: [f64; 4] = [1.0, 0.8, 0.5, 0.6];

/// Cosine law: 1² + 0.8² − 2·0.8 cos φ = 1.1².
fn swing() -> f64 {
    ((1.0 + 0.64 - 1.21) / 1.6_f64).acos()
}

/// A fixed input ends the run at the limit of its block, in few steps; with an input that may change the run continues.
#[test]
fn a_fixed_crank_stops_at_its_limit() {
    let model = four_bar(SWINGING, 0.6, 1.0).weightless().model();
    let crank = velocity(&model, "A");
    let (inputs, rates) = ([crank], [(crank, 3.0)]);
    for rtol in [1e-4, 1e-6, 1e-9, 1e-11, 1e-12, 1e-13] {
        for rule in ["explicit-closing", "wehage-haug"] {
            let run = |inputs| {
                let t_eval = (1..=40).map(|i| 0.05 * f64::from(i)).collect();
                Run { model: &model, rule, inputs, rates: &rates, rtol, t_eval }
            };
            let mut angle = 0.0;
            let (outcome, _) = run(Some(&inputs[..])).march(|s| angle = s.q[0]);
            assert_ne!(outcome.status, Status::Finished);
            match outcome.error {
                // which coordinate stands, at which block, and what else would do
                Some(SystemError::DeadPoint { coordinates, seen, advice, t }) => {
                    assert!(coordinates == "A" && advice.contains("D would serve"), "{coordinates}: {advice}");
                    assert!(rule != "explicit-closing" || seen.contains("RRR dyad"), "{seen}");
                    assert!(t > 0.0 && t < 1.0, "{t}");
                }
                Some(SystemError::Limit { block, shortfall, t }) => {
                    assert!(rule != "explicit-closing" || block.contains("RRR dyad"), "{block}");
                    // the limit itself: the last steps stand in front of it by less than what a step may miss
                    assert!((0.0..1e-4).contains(&shortfall), "{shortfall:e}");
                    assert!(t > 0.0 && t < 1.0, "{t}");
                }
                other => panic!("{rule}: {other:?}"),
            }
            // an output shortly before the end of what was reached
            assert!(angle + 0.6 < swing() && angle + 0.6 > swing() - 0.2, "{} of {}", angle + 0.6, swing());
            assert!(outcome.counters.steps < 200, "{} steps", outcome.counters.steps);

            let mut largest = 0.0f64;
            let (outcome, _) = run(None).march(|s| largest = largest.max(s.q[0] + 0.6));
            assert_eq!(outcome.status, Status::Finished, "{}", outcome.message);
            assert!(largest < swing() + 1e-9, "{largest} {}", swing());
        }
    }
}

/// Driven beyond its limit the crank tells by how much the lengths miss each other where it stands: |BD| − (l2 + l3).
#[test]
fn a_driven_crank_reports_its_shortfall() {
    let rate = 2.0;
    let table = Table { breaks: vec![0.0, 10.0], coefficients: vec![[0.0, 0.0, rate, 0.0]] };
    let model = four_bar(SWINGING, 0.6, 1.0).drive("A", Value::Table(table)).model();
    let t_eval = (1..=40).map(|i| 0.05 * f64::from(i)).collect();
    let run = Run { model: &model, rule: "explicit-closing", inputs: None, rates: &[], rtol: 1e-9, t_eval };
    let mut reached = 0.0;
    let (outcome, _) = run.march(|s| reached = s.t);
    match outcome.error {
        Some(SystemError::Limit { block, t, shortfall }) => {
            let b = polar(0.8, 0.6 + rate * t);
            let missing = (b[0] - 1.0).hypot(b[1]) - 1.1;
            assert!(block.contains("RRR dyad"), "{block}");
            // its work grows as one over what is missing, so rounding of the angle keeps it from the tolerance where less
            // than the quotient of both is missing: the steps stand there, and what is missing then is nothing
            let stands = shortfall == 0.0 && missing.abs() < f64::EPSILON / run.rtol;
            let misses = missing > 0.0 && (shortfall - missing).abs() < 1e-14;
            assert!(stands || misses, "{shortfall} {missing}");
            assert!((0.6 + rate * t - swing()).abs() < 1e-6, "{t}");
        }
        other => panic!("{other:?}: {}", outcome.message),
    }
    assert!((0.6 + rate * reached - swing()).abs() < rate * 0.05, "{reached}");
}
