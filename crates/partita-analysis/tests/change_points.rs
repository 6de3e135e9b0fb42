mod planar;

use partita_integrate::options::Options;
use partita_integrate::simulate::{simulate, Settings};
use partita_integrate::tableau;
use partita_model::Model;
use partita_system::formulation::options::FormulationOptions;
use partita_system::formulation::reduction::Reduction;
use partita_system::formulation::{registry, turns, Formulation};
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

#[test]
fn explore() {
    for loops in [1, 2, 40] {
        let model = chain(loops);
        let q = model.initial();
        let found = start::analyse(&model, 0.0, &q).unwrap();
        let upright = (0..model.size().nv).find(|&i| model.velocity_name(i) == "P0").unwrap();
        let mut r = Reduction::new(&model, found.rank);
        start::choose_partition(&mut r, 0.0, &q, None, None).unwrap();
        let v = velocity::with_rates(&mut r, 0.0, &q, &[(upright, -1.0)]).unwrap();
        for fixed in [None, Some(0.03),Some(0.02), Some(0.01),Some(0.005)] { for name in ["projective", "wehage-haug", "explicit-closing"] {
            for rtol in [1e-4,1e-6,1e-8,1e-11,1e-13] {
                let mut f = registry::by_name(name, &model, found.rank, &FormulationOptions::default()).unwrap();
                let settings = Settings {
                    t_end: 10.0,
                    tableau: tableau::by_name(if fixed.is_some() { "rk4" } else { "dop853" }).unwrap(),
                    options: Options { fixed_step: fixed, rtol, atol: (0.01 * rtol).into(), ..Options::default() },
                    max_steps: 5000,
                };
                let mut last = 0.0;
                let mut closure = 0.0f64;
                let outcome = simulate(
                    &mut f,
                    0.0,
                    &q,
                    &v,
                    &[5.0, 10.0],
                    &settings,
                    &mut |s| {
                        last = turns::whole(s.q[upright], s.turns[upright]);
                        closure = closure.max(s.closure);
                        Ok(())
                    },
                    &mut |_| ControlFlow::Continue(()),
                )
                .unwrap();
                println!(
                    "{fixed:?} {loops} {name} {rtol:e}: {:?} steps {} rej {} ev {} pass {} closure {closure:.1e} last {last:.12} {}",
                    outcome.status, outcome.counters.steps, outcome.counters.rejected, outcome.counters.evaluations,
                    outcome.passages.len(), outcome.message
                );
                
            }
        }
    }
}}
