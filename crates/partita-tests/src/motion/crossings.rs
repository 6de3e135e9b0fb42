//! Chains of equal four-bars pass positions in which all links are in line and the constraints lose rank, twice a turn.
//!
//! ```text
//!    B0 ---- B1 ---- B2
//!    |       |       |       N = 2: one degree of freedom, three of them when the uprights lie down
//!    P0      P1      P2
//! ```

use crate::planar::{chain, closure_error, upright_angle};
use partita_integrate::method;
use partita_integrate::options::Options;
use partita_integrate::simulate::{simulate, Settings, Status};
use partita_system::formulation::motion::Projective;
use partita_system::kinematics::velocity;
use partita_system::options::FormulationOptions;
use partita_system::positions::turns;
use partita_system::prelude::*;
use partita_system::reduction::Reduction;
use partita_system::start;
use std::ops::ControlFlow;

/// 180 runs of 10 s: 1 to 40 loops, ten initial rates (so that steps meet the singular positions at all distances),
/// three tolerances. Each passes some fourteen singular positions on the right branch.
#[test]
fn chains_pass_all_their_singular_positions_on_their_branch() {
    let t_end = 10.0;
    let (mut passed, mut dated) = (0, Vec::new());
    for loops in [1, 2, 3, 5, 10, 40] {
        let model = chain(loops);
        let q = model.initial();
        let found = start::analyse(&model, 0.0, &q).unwrap();
        assert_eq!(found.rank, 2 * loops);
        let upright = model.structure().velocities.iter().position(|v| &*v.name == "P0").unwrap();
        for k in 0..10 {
            let rate = 1.0 + 0.237 * f64::from(k);
            let exact = upright_angle(loops, rate, &[t_end])[0];
            for rtol in [1e-8, 1e-10, 1e-12] {
                let mut r = Reduction::new(&model, found.rank);
                start::choose_partition(&mut r, 0.0, &q, None, None).unwrap();
                let v = velocity::with_rates(&mut r, 0.0, &q, &[(upright, -rate)]).unwrap();
                let mut f = Projective::new(&model, found.rank, &FormulationOptions::default());
                let settings = Settings {
                    t_end,
                    method: method::by_name("dop853").unwrap(),
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
                        last = (turns::whole(s.q[upright], s.turns[upright]), closure_error(&model, s));
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
                passed += outcome.crossings.times.len();
                let angles = upright_angle(loops, rate, &outcome.crossings.times);
                dated.extend(angles.iter().map(|angle| angle.cos().abs()));
            }
        }
    }
    assert!(passed > 1000, "only {passed} singular positions were met");
    // dated where the uprights lie: a step turns them by half a radian, and in it the distance from the position falls
    // and grows nearly linearly
    dated.sort_by(f64::total_cmp);
    let (median, worst) = (dated[dated.len() / 2], dated[dated.len() - 1]);
    assert!(median < 0.005 && worst < 0.25, "off by {median} rad, at the worst {worst}");
}
