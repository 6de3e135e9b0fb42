//! A crank that has turned a thousand times closes its loop as exactly as in its first turn.

use crate::planar::{closure_error, link, model, pin};
use partita_integrate::options::Options;
use partita_integrate::simulate::{simulate, Settings, Status};
use partita_integrate::tableau::DOP853;
use partita_model::Model;
use partita_system::formulation::motion::Projective;
use partita_system::formulation::registry;
use partita_system::kinematics::velocity;
use partita_system::options::FormulationOptions;
use partita_system::positions::turns;
use partita_system::prelude::*;
use partita_system::record::Output;
use partita_system::reduction::Reduction;
use partita_system::start;
use std::f64::consts::TAU;
use std::ops::ControlFlow;

/// A crank of 1 m, coupler 3, rocker 2.5, ground 3.
fn crank_and_rocker() -> Model {
    let (b, far) = ([0.5, 0.75_f64.sqrt()], 7.0_f64.sqrt());
    let (along, n) = ((7.0 + 9.0 - 6.25) / (2.0 * far), [2.5 / far, -b[1] / far]);
    let across = (9.0 - along * along).sqrt();
    let c = [b[0] + along * n[0] - across * n[1], b[1] + along * n[1] + across * n[0]];
    model(
        &[link("crank", [0.0, 0.0], b), link("coupler", b, c), link("rocker", [3.0, 0.0], c)],
        &[
            pin("A", "ground", "crank", [0.0, 0.0]),
            pin("B", "crank", "coupler", b),
            pin("C", "coupler", "rocker", c),
            pin("D", "ground", "rocker", [3.0, 0.0]),
        ],
        [0.0; 3],
    )
}

/// The largest closure error at these outputs, and the angle of the crank at the last.
fn run(rtol: f64, t_eval: &[f64]) -> (f64, f64) {
    let model = crank_and_rocker();
    let crank = model.structure().velocities.iter().position(|v| &*v.name == "A").unwrap();
    let q = model.initial();
    let rank = start::analyse(&model, 0.0, &q).unwrap().rank;
    let mut f = Projective::new(&model, rank, &FormulationOptions::default());
    start::choose_partition(f.reduction(), 0.0, &q, None, None).unwrap();
    let v = velocity::with_rates(f.reduction(), 0.0, &q, &[(crank, TAU)]).unwrap();
    let settings = Settings {
        t_end: t_eval[t_eval.len() - 1],
        method: &DOP853,
        options: Options { rtol, atol: (0.01 * rtol).into(), ..Options::default() },
        max_steps: 10_000_000,
    };
    let (mut worst, mut turned): (f64, f64) = (0.0, 0.0);
    let mut sink = |s: &Output| {
        worst = worst.max(closure_error(&model, s));
        // the angle goes on where its turns were taken off
        assert!(s.q.iter().all(|q| q.abs() < 30.0));
        turned = turns::whole(s.q[crank], s.turns[crank]);
        Ok(())
    };
    let outcome =
        simulate(&mut f, 0.0, &q, &v, t_eval, &settings, &mut sink, &mut |_| ControlFlow::Continue(())).unwrap();
    assert_eq!(outcome.status, Status::Finished, "{}", outcome.message);
    (worst, turned)
}

#[test]
fn a_thousand_turns_leave_the_loop_closed() {
    let t_eval: Vec<f64> = (0..=110).map(|i| 10.0 * f64::from(i)).collect();
    let (worst, turned) = run(1e-8, &t_eval);
    // the crank speeds up and slows down with the rocker's inertia, so turns are not seconds
    assert!(turned.abs() > 900.0 * TAU, "{turned}");
    // links of 3 m: a few units in the last place of the sum of their projections
    assert!(worst < 5e-15, "{worst:e}");
}

/// Outputs between steps of few digits are closed like all others: one iteration would leave the square of their error.
#[test]
fn outputs_of_a_loose_run_close_to_round_off() {
    let t_eval: Vec<f64> = (1..=2000).map(|i| 0.01 * f64::from(i)).collect();
    let (worst, _) = run(1e-3, &t_eval);
    // some units in the last place more than at a hundred outputs
    assert!(worst < 2e-14, "{worst:e}");
}

/// sin and cos do not know of whole turns: an angle that has lost some points where it did, to the last digit. A turn is
/// no double: four times what `TAU` misses of it is 1e-15, which a thousand turns would make visible.
#[test]
fn turns_are_taken_off_to_the_last_digit() {
    let model = crank_and_rocker();
    let crank = model.structure().velocities.iter().position(|v| &*v.name == "A").unwrap();
    for i in 0..600 {
        // four turns and less than half a one more
        let before = (25.0 + 0.005 * f64::from(i + 1)) * if i % 2 == 0 { 1.0 } else { -1.0 };
        let (mut angle, mut turned) = (before, 0);
        assert!(turns::reduce_one(&model, crank, &mut angle, &mut turned));
        assert!(angle.abs() <= 0.5 * TAU && turned == if before > 0.0 { 4 } else { -4 });
        // half a unit in the last place of an angle below half a turn, and of each sine
        let off = (angle.sin() - before.sin()).abs().max((angle.cos() - before.cos()).abs());
        assert!(off < 4.5e-16, "{before}: {off:e}");
        // four times a double loses nothing, their sum half a unit in the last place of 28
        assert!((turns::whole(angle, turned) - before).abs() < 4e-15);
    }
}

/// Forms whose coordinates are states, and those that find them from a base: angles stay small, and with the turns put back
/// they are the same.
#[test]
fn every_form_counts_the_same_turns() {
    let model = crank_and_rocker();
    let crank = model.structure().velocities.iter().position(|v| &*v.name == "A").unwrap();
    let q = model.initial();
    let rank = start::analyse(&model, 0.0, &q).unwrap().rank;
    let mut r = Reduction::new(&model, rank);
    start::choose_partition(&mut r, 0.0, &q, None, None).unwrap();
    let v = velocity::with_rates(&mut r, 0.0, &q, &[(crank, 2.0 * TAU)]).unwrap();
    let options = Options { rtol: 1e-11, atol: 1e-12.into(), ..Options::default() };
    let settings = Settings { t_end: 15.0, method: &DOP853, options, max_steps: u64::MAX };
    let t_eval: Vec<f64> = (1..=30).map(|i| 0.5 * f64::from(i)).collect();
    let run = |name: &str| {
        let mut f = registry::by_name(name, &model, rank, &FormulationOptions::default()).unwrap();
        let mut all = Vec::new();
        let mut sink = |s: &Output| {
            assert!(s.q.iter().all(|q| q.abs() < 40.0), "{name}: {:?}", s.q);
            // angles of up to 25 rad are rounded by 3.6e-15, and three of them move links of 3 m; a chart adds its base, and
            // leaves 2e-14 to 5e-14 at the worst output, by where the steps end
            let allowed = if name == "tangent-space" { 8e-14 } else { 4e-14 };
            let open = closure_error(&model, s);
            assert!(open < allowed, "{name}: {open:e}");
            all.push((0..s.q.len()).map(|i| turns::whole(s.q[i], s.turns[i])).collect::<Vec<f64>>());
            Ok(())
        };
        let outcome =
            simulate(&mut *f, 0.0, &q, &v, &t_eval, &settings, &mut sink, &mut |_| ControlFlow::Continue(())).unwrap();
        assert_eq!(outcome.status, Status::Finished, "{name}: {}", outcome.message);
        all
    };
    let exact = run("projective");
    assert!(exact[29][crank].abs() > 20.0 * TAU, "{}", exact[29][crank]);
    for name in ["svd", "gram-schmidt", "tangent-space"] {
        for (x, y) in run(name).iter().zip(&exact) {
            // tolerance 1e-11 a step, a thousand steps, the crank's phase collects them
            x.iter().zip(y).for_each(|(x, y)| assert!((x - y).abs() < 1e-6, "{name}: {x} {y}"));
        }
    }
}
