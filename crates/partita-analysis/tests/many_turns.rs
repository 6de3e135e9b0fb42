//! A crank that has turned a thousand times closes its loop as exactly as in its first turn.

mod planar;

use partita_integrate::options::Options;
use partita_integrate::simulate::{simulate, Settings, Status};
use partita_integrate::tableau::DOP853;
use partita_system::formulation::projective::{Projective, ProjectiveOptions};
use partita_system::formulation::turns;
use partita_system::kinematics::velocity;
use partita_system::{start, ConstrainedSystem};
use planar::{link, model, pin};
use std::f64::consts::TAU;
use std::ops::ControlFlow;

#[test]
fn a_thousand_turns_leave_the_loop_closed() {
    // ground 3, crank 1, coupler 3, rocker 2.5
    let (b, far) = ([0.5, 0.75_f64.sqrt()], 7.0_f64.sqrt());
    let (along, n) = ((7.0 + 9.0 - 6.25) / (2.0 * far), [2.5 / far, -b[1] / far]);
    let across = (9.0 - along * along).sqrt();
    let c = [b[0] + along * n[0] - across * n[1], b[1] + along * n[1] + across * n[0]];
    let model = model(
        &[link("crank", [0.0, 0.0], b), link("coupler", b, c), link("rocker", [3.0, 0.0], c)],
        &[
            pin("A", "ground", "crank", [0.0, 0.0]),
            pin("B", "crank", "coupler", b),
            pin("C", "coupler", "rocker", c),
            pin("D", "ground", "rocker", [3.0, 0.0]),
        ],
        [0.0; 3],
    );
    let crank = (0..model.size().nv).find(|&i| model.velocity_name(i) == "A").unwrap();
    let q = model.initial();
    let rank = start::analyse(&model, 0.0, &q).unwrap().rank;
    let mut f = Projective::new(&model, rank, ProjectiveOptions::default());
    start::choose_partition(f.reduction(), 0.0, &q, None, None).unwrap();
    let v = velocity::with_rates(f.reduction(), 0.0, &q, &[(crank, TAU)]).unwrap();
    let settings = Settings {
        t_end: 1100.0,
        tableau: &DOP853,
        options: Options { rtol: 1e-8, atol: 1e-10.into(), ..Options::default() },
        max_steps: 10_000_000,
    };
    let t_eval: Vec<f64> = (0..=110).map(|i| 10.0 * f64::from(i)).collect();
    let (mut worst, mut turned): (f64, f64) = (0.0, 0.0);
    let mut sink = |s: &partita_system::formulation::Sample| {
        worst = worst.max(s.closure);
        // the angle goes on where its turns were taken off
        assert!(s.q.iter().all(|q| q.abs() < 30.0));
        turned = turns::whole(s.q[crank], s.turns[crank]);
        Ok(())
    };
    let outcome =
        simulate(&mut f, 0.0, &q, &v, &t_eval, &settings, &mut sink, &mut |_| ControlFlow::Continue(())).unwrap();
    assert_eq!(outcome.status, Status::Finished, "{}", outcome.message);
    // the crank speeds up and slows down with the rocker's inertia, so turns are not seconds
    assert!(turned.abs() > 900.0 * TAU, "{turned}");
    // links of 3 m: a few units in the last place of the sum of their projections
    assert!(worst < 5e-15, "{worst:e}");
}
