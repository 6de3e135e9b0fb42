//! Forms in 2k states at change points: parallelograms in line, where both solutions of every loop meet.
//!
//! ```text
//!    B0 ---- B1 ---- B2
//!    |       |       |       an upright that passes the ground line is followed by all others, or by none
//!    P0      P1      P2
//! ```

use crate::planar::{chain, closure_error, upright_angle};
use partita_integrate::method;
use partita_integrate::options::Options;
use partita_integrate::simulate::{simulate, Outcome, Settings, Status};
use partita_model::Model;
use partita_system::formulation::registry;
use partita_system::kinematics::velocity;
use partita_system::options::FormulationOptions;
use partita_system::positions::turns;
use partita_system::prelude::*;
use partita_system::reduction::Reduction;
use partita_system::start;
use std::ops::ControlFlow;

/// What the uprights and couplers do at the outputs: largest error of all coordinates against the parallelograms.
struct PathError {
    outcome: Outcome,
    error: f64,
    closure: f64,
    notes: Vec<String>,
}

fn run(model: &Model, rule: &str, rate: f64, options: Options, times: &[f64], exact: &[f64]) -> PathError {
    let q = model.initial();
    let rank = start::analyse(model, 0.0, &q).unwrap().rank;
    let upright = model.structure().velocities.iter().position(|v| &*v.name == "P0").unwrap();
    let mut r = Reduction::new(model, rank);
    start::choose_partition(&mut r, 0.0, &q, None, None).unwrap();
    let v = velocity::with_rates(&mut r, 0.0, &q, &[(upright, -rate)]).unwrap();
    let mut f = registry::by_name(rule, model, rank, &FormulationOptions::default()).unwrap();
    let method = if options.fixed_step.is_some() { "rk4" } else { "dop853" };
    let settings =
        Settings { t_end: *times.last().unwrap(), method: method::by_name(method).unwrap(), options, max_steps: 5000 };
    let (mut error, mut closure, mut next) = (0.0f64, 0.0f64, 0);
    let outcome = simulate(
        &mut *f,
        0.0,
        &q,
        &v,
        times,
        &settings,
        &mut |s| {
            // uprights turn together, couplers stay level: joint by joint the angle of the upright, its opposite, or 0
            for i in 0..s.q.len() {
                let angle = turns::whole(s.q[i], s.turns[i]).abs();
                error = error.max((angle - exact[next].abs()).abs().min(angle.abs()));
            }
            error = error.max((turns::whole(s.q[upright], s.turns[upright]) + exact[next]).abs());
            closure = closure.max(closure_error(model, s));
            next += 1;
            Ok(())
        },
        &mut |_| ControlFlow::Continue(()),
    )
    .unwrap();
    PathError { outcome, error, closure, notes: f.history().notes }
}

/// Ten crossings in ten seconds; steps meet them at all distances. The outputs lie everywhere, next to crossings as
/// well.
#[test]
fn chains_pass_their_change_points_in_2k_states() {
    let times: Vec<f64> = (1..=200).map(|i| 0.05 * f64::from(i)).collect();
    for loops in [1, 2, 5, 40] {
        let model = chain(loops);
        for k in 0..if loops == 40 { 1 } else { 3 } {
            let rate = 1.0 + 0.237 * f64::from(k);
            let exact = upright_angle(loops, rate, &times);
            for rule in ["explicit-closing", "wehage-haug"] {
                for rtol in [1e-6, 1e-8, 1e-10, 1e-12] {
                    let options = Options { rtol, atol: (0.01 * rtol).into(), ..Options::default() };
                    let seen = run(&model, rule, rate, options, &times, &exact);
                    let case = format!("{loops} loops, {rule}, rate {rate}, rtol {rtol}: {}", seen.outcome.message);
                    assert_eq!(seen.outcome.status, Status::Finished, "{case}");
                    // near the upright position errors grow by 1e3 to 1e4 in 10 s: those of the tolerance and the
                    // round-off of a crossing, up to 1e-10
                    assert!(seen.error <= 1e5 * rtol + 1e-6, "{case}: error {:.2e}", seen.error);
                    // lengths of 1 m, whatever lies between a stage and a change point: next to one Newton's method
                    // leaves up to a hundred round-offs of three of them, which it would amplify, not remove
                    assert!(seen.closure <= 2e-13, "{case}: closure {:.2e}", seen.closure);
                    assert!(seen.outcome.counters.steps < 400, "{case}: {} steps", seen.outcome.counters.steps);
                    if rule == "explicit-closing" {
                        let reported = seen.notes.iter().filter(|n| n.contains("change point")).count();
                        assert!(reported > 0, "{:?}", seen.notes);
                    }
                }
            }
        }
    }
}

/// Steps of a given length cannot choose where they meet a change point: the form itself follows the motion.
#[test]
fn fixed_steps_pass_change_points_too() {
    let times: Vec<f64> = (1..=5).map(f64::from).collect();
    for loops in [1, 2, 40] {
        let model = chain(loops);
        let exact = upright_angle(loops, 1.0, &times);
        for rule in ["explicit-closing", "wehage-haug"] {
            for h in [0.03, 0.02, 0.01] {
                let options = Options { fixed_step: Some(h), ..Options::default() };
                let seen = run(&model, rule, 1.0, options, &times, &exact);
                assert_eq!(seen.outcome.status, Status::Finished, "{rule} {h}: {}", seen.outcome.message);
                // RK4 at up to 5 rad/s: (5 h)⁵ / 120 a step, a hundred times amplified in 5 s
                let allowed = 1e2 * (5.0 * h).powi(5) / 120.0 * 5.0 / h;
                assert!(seen.error < allowed, "{loops} loops, {rule}, h = {h}: {:e} of {allowed:e}", seen.error);
            }
        }
    }
}
