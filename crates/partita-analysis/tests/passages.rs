//! Chains of equal four-bars pass positions in which all links are in line and the constraints lose rank, twice a turn.
//!
//! ```text
//!    B0 ---- B1 ---- B2
//!    |       |       |       N = 2: one degree of freedom, three of them when the uprights lie down
//!    P0      P1      P2
//! ```

mod planar;

use partita_integrate::options::Options;
use partita_integrate::simulate::{simulate, Settings, Status};
use partita_integrate::tableau;
use partita_model::Model;
use partita_system::formulation::projective::{Projective, ProjectiveOptions};
use partita_system::formulation::reduction::Reduction;
use partita_system::formulation::turns;
use partita_system::kinematics::velocity;
use partita_system::{start, ConstrainedSystem};
use planar::{link, model, pin};
use std::ops::ControlFlow;

fn chain(loops: usize) -> Model {
    let (mut bodies, mut joints) = (Vec::new(), Vec::new());
    for i in 0..=loops {
        let x = i as f64;
        bodies.push(link(&format!("u{i}"), [x, 0.0], [x, 1.0]));
        joints.push(pin(&format!("P{i}"), "ground", &format!("u{i}"), [x, 0.0]));
    }
    for i in 1..=loops {
        let x = i as f64;
        bodies.push(link(&format!("c{i}"), [x - 1.0, 1.0], [x, 1.0]));
        joints.push(pin(&format!("L{i}"), &format!("u{}", i - 1), &format!("c{i}"), [x - 1.0, 1.0]));
        joints.push(pin(&format!("R{i}"), &format!("c{i}"), &format!("u{i}"), [x, 1.0]));
    }
    model(&bodies, &joints, [0.0, -9.81, 0.0])
}

/// ((N+1)/3 + N) phi'' = ((N+1)/2 + N) g sin phi, by fine steps of the classical method of order four.
fn upright_angle(loops: usize, rate: f64, t_end: f64) -> f64 {
    let n = loops as f64;
    let k = ((n + 1.0) / 2.0 + n) * 9.81 / ((n + 1.0) / 3.0 + n);
    let steps = 100_000;
    let h = t_end / f64::from(steps);
    let f = |p: f64| k * p.sin();
    let (mut p, mut w) = (0.0, rate);
    for _ in 0..steps {
        let k1 = (w, f(p));
        let k2 = (w + 0.5 * h * k1.1, f(p + 0.5 * h * k1.0));
        let k3 = (w + 0.5 * h * k2.1, f(p + 0.5 * h * k2.0));
        let k4 = (w + h * k3.1, f(p + h * k3.0));
        p += h / 6.0 * (k1.0 + 2.0 * k2.0 + 2.0 * k3.0 + k4.0);
        w += h / 6.0 * (k1.1 + 2.0 * k2.1 + 2.0 * k3.1 + k4.1);
    }
    p
}

/// 180 runs of 10 s: 1 to 40 loops, ten initial rates (so that steps meet the singular positions at all distances),
/// three tolerances. Each passes some fourteen singular positions on the right branch.
#[test]
fn chains_pass_all_their_singular_positions_on_their_branch() {
    let t_end = 10.0;
    let mut passed = 0;
    for loops in [1, 2, 3, 5, 10, 40] {
        let model = chain(loops);
        let q = model.initial();
        let found = start::analyse(&model, 0.0, &q).unwrap();
        assert_eq!(found.rank, 2 * loops);
        let upright = (0..model.size().nv).find(|&i| model.velocity_name(i) == "P0").unwrap();
        for k in 0..10 {
            let rate = 1.0 + 0.237 * f64::from(k);
            let exact = upright_angle(loops, rate, t_end);
            for rtol in [1e-8, 1e-10, 1e-12] {
                let mut r = Reduction::new(&model, found.rank);
                start::choose_partition(&mut r, 0.0, &q, None, None).unwrap();
                let v = velocity::with_rates(&mut r, 0.0, &q, &[(upright, -rate)]).unwrap();
                let mut f = Projective::new(&model, found.rank, ProjectiveOptions::default());
                let settings = Settings {
                    t_end,
                    tableau: tableau::by_name("dop853").unwrap(),
                    options: Options { rtol, atol: (0.01 * rtol).into(), ..Options::default() },
                    max_steps: 5000,
                };
                let mut last = (f64::NAN, f64::NAN);
                let outcome = simulate(
                    &mut f,
                    0.0,
                    &q,
                    &v,
                    &[t_end],
                    &settings,
                    &mut |s| {
                        last = (turns::whole(s.q[upright], s.turns[upright]), s.closure);
                        Ok(())
                    },
                    &mut |_| ControlFlow::Continue(()),
                )
                .unwrap();
                let case = format!("{loops} loops, rate {rate}, rtol {rtol}: {}", outcome.message);
                assert_eq!(outcome.status, Status::Finished, "{case}");
                // near the upright position errors grow by exp(sqrt(k) t) between turns: 1e3 to 1e4 in 10 s
                let error = (last.0 + exact).abs();
                assert!(error <= 1e5 * rtol, "{case}: error {error:.2e}");
                // round-off of lengths of 1 m
                assert!(last.1 <= 1e-13, "{case}: closure {:.2e}", last.1);
                passed += outcome.passages.len();
            }
        }
    }
    assert!(passed > 1000, "only {passed} singular positions were met");
}
