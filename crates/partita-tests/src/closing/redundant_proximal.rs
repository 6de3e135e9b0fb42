//! Proximal iteration on redundant rows that contradict each other a little between the ends of steps.

use crate::linkages::{drawing, velocity};
use partita_integrate::options::Options;
use partita_integrate::simulate::{simulate, Settings, Status};
use partita_integrate::tableau::DOP853;
use partita_model::spec::JointKind::Revolute;
use partita_model::Model;
use partita_system::formulation::registry;
use partita_system::options::FormulationOptions;
use partita_system::prelude::*;
use partita_system::start;
use std::ops::ControlFlow;

/// Bricard's mechanism, six hinges along the edges of a cube: one row of six follows from the others.
fn bricard() -> Model {
    let points = [[0, 0, 0], [1, 0, 0], [1, -1, 0], [1, -1, 1], [0, -1, 1], [0, 0, 1]].map(|p| p.map(f64::from));
    let axes = [[0, 1, 0], [0, 0, 1], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 0]].map(|p| p.map(f64::from));
    let bodies = ["ground", "1", "2", "3", "4", "5", "ground"];
    let mut d = drawing("Bricard");
    for i in 0..6 {
        d = d.joint(&format!("P{i}"), Revolute, bodies[i], bodies[i + 1], points[i], axes[i]);
    }
    d.model()
}

/// All rows at once cost no more steps than an independent choice of them, and give the same motion.
#[test]
fn redundant_rows_do_not_shorten_the_steps() {
    let model = bricard();
    let q = model.initial();
    let rank = start::analyse(&model, 0.0, &q).unwrap().rank;
    assert!(rank < model.size().rows);
    let first = velocity(&model, "P0");
    for rtol in [1e-6, 1e-8, 1e-10] {
        let run = |name: &str| {
            let mut f = registry::by_name(name, &model, rank, &FormulationOptions::default()).unwrap();
            let settings = Settings {
                t_end: 3.0,
                method: &DOP853,
                options: Options { rtol, atol: (0.01 * rtol).into(), ..Options::default() },
                max_steps: 5000,
            };
            let mut end = f64::NAN;
            let mut sink = |s: &partita_system::record::Output| {
                end = s.q[first];
                Ok(())
            };
            let go_on = &mut |_: f64| ControlFlow::Continue(());
            let v = vec![0.0; model.size().nv];
            let outcome = simulate(&mut *f, 0.0, &q, &v, &[3.0], &settings, &mut sink, go_on).unwrap();
            assert_eq!(outcome.status, Status::Finished, "{name}: {}", outcome.message);
            (outcome.counters.evaluations as f64, end)
        };
        let (all, chosen) = (run("proximal"), run("range-space"));
        assert!(all.0 < 1.5 * chosen.0, "{} evaluations against {}", all.0, chosen.0);
        assert!((all.1 - chosen.1).abs() < 1e4 * rtol, "{} {}", all.1, chosen.1);
    }
}
