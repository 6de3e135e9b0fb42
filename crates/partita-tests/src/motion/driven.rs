//! Work along motions: energy less the work of what has no potential and of the drives stays what it was.

use crate::mechanisms::{body, compile, empty, joint, on_random_mechanisms, Moment, Wishes};
use partita_integrate::options::Options;
use partita_integrate::simulate::{simulate, Settings, Status};
use partita_integrate::tableau::DOP853;
use partita_model::spec::{Drive, Force, JointKind, Level, Measure, Spec, Value};
use partita_model::zero_position::Coordinates;
use partita_model::Model;
use partita_system::formulation::motion::Projective;
use partita_system::formulation::Formulation;
use partita_system::kinematics::velocity;
use partita_system::options::FormulationOptions;
use partita_system::prelude::*;
use partita_system::record::{Output, Sample};
use partita_system::reduction::Reduction;
use partita_system::start;
use std::ops::ControlFlow;

/// Samples at `at` after the moment; none if the motion runs into a singular position.
fn march(model: &Model, m: &Moment, at: &[f64]) -> Option<Vec<Sample>> {
    let mut outputs = Vec::new();
    let mut sink = |s: &Output| {
        outputs.push(s.clone());
        Ok(())
    };
    let options = Options { rtol: 1e-12, atol: 1e-12.into(), ..Options::default() };
    let settings = Settings { t_end: at[at.len() - 1], method: &DOP853, options, max_steps: 20_000 };
    let mut f = Projective::new(model, m.rank, &FormulationOptions::default());
    let go = &mut |_| ControlFlow::Continue(());
    let outcome = simulate(&mut f, m.t, &m.q, &m.v, at, &settings, &mut sink, go).ok()?;
    let events = f.history().events;
    let samples = outputs.iter().map(|output| Sample::of(&mut f, output, &events).unwrap());
    (outcome.status == Status::Finished).then(|| samples.collect())
}

fn energy(model: &Model, s: &Sample) -> f64 {
    let size = model.size();
    let (mut phi, mut c) = (vec![0.0; size.holonomic], vec![0.0; model.pattern().nnz()]);
    let (mut a, mut b, mut x) = (vec![0.0; size.rows], vec![0.0; size.rows], model.scratch());
    model.position(s.t, &s.q, &mut x, &mut phi, &mut c, &mut a).unwrap();
    model.velocity(s.t, &s.q, &s.v, &mut x, &mut b).unwrap();
    let (kinetic, potential) = model.energy(s.t, &s.q, &s.v, &x).unwrap();
    kinetic + potential
}

/// Largest change of energy less work, and the largest work.
fn balance(model: &Model, samples: &[Sample]) -> (f64, f64) {
    let first = energy(model, &samples[0]) - samples[0].work;
    samples.iter().fold((0.0, 0.0), |(off, work), s| {
        let x: f64 = energy(model, s) - s.work - first;
        (x.abs().max(off), s.work.abs().max(work))
    })
}

/// The same with stops, contacts, ropes and tyres that do not act: at the corner of a first touch a step is off by more than its
/// error estimate, whatever the tolerance.
fn without_discontinuities(model: &Model) -> Model {
    let corner = |f: &&Force| matches!(f, Force::Stop(_) | Force::Contact(_) | Force::Rope(_) | Force::Tyre(_));
    let names: Vec<String> =
        model.spec.forces.iter().filter(corner).map(|f| format!("{}.stiffness", f.name())).collect();
    let changes: Vec<(&str, &[f64])> = names.iter().map(|name| (name.as_str(), &[0.0][..])).collect();
    model.with_parameters(&changes).unwrap()
}

#[test]
fn energy_less_work_is_kept() {
    for planar in [false, true] {
        let (mut marched, mut driven) = (0, 0);
        let wishes = Wishes { planar, bound: true, drives: true };
        on_random_mechanisms(51, 30, wishes, |_, model, m| {
            let at: Vec<f64> = (0..=5).map(|i| m.t + 0.06 * f64::from(i)).collect();
            let model = &without_discontinuities(model);
            let Some(samples) = march(model, m, &at) else { return };
            let (off, work) = balance(model, &samples);
            // 1e-12 a step, some tens of steps, energies of some tens of joules; springs can whip up short motions
            assert!(
                off < 1e-8 * (1.0 + work + energy(model, &samples[0]).abs()),
                "off by {off:e} J with {work} J done"
            );
            assert!(samples.iter().all(|s| s.closure < 1e-11 && s.velocity_closure < 1e-10));
            marched += 1;
            driven += usize::from(model.structure().rheonomic);
        });
        assert!(marched >= 20 && driven >= 3, "{marched} {driven}");
    }
}

/// ```text
///      B ---- C
///     /        \        the crank AB is driven; with `loose` the rocker carries a pendulum
///    A          D
/// ```
fn driven_four_bar(loose: bool) -> Spec {
    let mut rng = fastrand::Rng::with_seed(52);
    let mut spec = empty("driven four-bar");
    spec.gravity = [0.0, -9.81, 0.0];
    let mut pin = |spec: &mut Spec, name: &str, a: &str, b: &str, at: [f64; 3]| {
        if !spec.bodies.iter().any(|x| x.name == b) {
            spec.bodies.push(body(&mut rng, b.into()));
        }
        spec.joints.push(joint(name.into(), JointKind::Revolute, a, b, at));
        spec.joints.last_mut().unwrap().axis = Some([0.0, 0.0, 1.0]);
    };
    pin(&mut spec, "A", "ground", "crank", [0.0; 3]);
    pin(&mut spec, "B", "crank", "coupler", [0.7, 0.7, 0.0]);
    pin(&mut spec, "D", "ground", "rocker", [2.2, 0.0, 0.0]);
    pin(&mut spec, "C", "coupler", "rocker", [3.1, 1.8, 0.0]);
    if loose {
        pin(&mut spec, "E", "rocker", "pendulum", [3.1, 1.8, 0.0]);
    }
    spec.drives.push(Drive {
        name: "motor".into(),
        measure: Measure::joint("A", 0),
        motion: Value::Function(0),
        level: Level::Position,
        turning: None,
    });
    spec
}

#[test]
fn a_driven_crank() {
    for loose in [false, true] {
        let model = compile(&driven_four_bar(loose), Coordinates::Relative).unwrap();
        let (q, n) = (model.initial(), model.size().nv);
        let rank = start::analyse(&model, 0.0, &q).unwrap().rank;
        assert_eq!(n - rank, usize::from(loose), "the drive takes the crank's degree of freedom");
        let m = Moment { t: 0.0, q, v: vec![0.0; n], vdot: vec![0.0; n], lambda: vec![], rank };
        let at: Vec<f64> = (0..=20).map(|i| 0.1 * f64::from(i)).collect();
        let samples = march(&model, &m, &at).unwrap();
        let crank = model.drives()[0].tree.unwrap().0;
        for s in &samples {
            // the drive is a constraint: kept to round-off, also in its speed
            let (sin, cos) = (1.7 * s.t).sin_cos();
            assert!((s.q[crank] - 0.3 * sin - 0.2 * s.t).abs() < 1e-14);
            assert!((s.v[crank] - 0.51 * cos - 0.2).abs() < 1e-13);
            // its multiplier is the motor's effort, on the joint's own axis
            let r = model
                .equations()
                .reactions(s.t, &s.q, &s.v, &s.vdot, &s.multipliers, model.scratch().equations())
                .unwrap();
            let motor = s.multipliers[model.drives()[0].row];
            assert_eq!(r.drives[0], [motor]);
            assert!((r.joints[0].moment.0[2] - motor).abs() < 1e-10 * (1.0 + motor.abs()));
            assert!(r.residual < 1e-9);
        }
        let (off, work) = balance(&model, &samples);
        // 1e-12 a step, a hundred steps
        assert!(work > 1.0 && off < 1e-10 * work, "off by {off:e} J with {work} J done");
    }
}

/// Of all velocities with the rate asked for, those of least energy: their momentum M v does no work on any motion that
/// leaves the rate alone. Drives move on meanwhile.
#[test]
fn speeds_that_nobody_asked_for_take_the_least_energy() {
    let (mut asked, mut driven) = (0, 0);
    for planar in [false, true] {
        on_random_mechanisms(53, 40, Wishes { planar, bound: true, drives: true }, |_, model, m| {
            let mut r = Reduction::dense(model, m.rank);
            start::choose_partition(&mut r, m.t, &m.q, None, None).unwrap();
            let (n, k) = (m.v.len(), r.k());
            if k < 2 {
                return;
            }
            let first = r.planned.partition.independent[0];
            let v = velocity::with_rates(&mut r, m.t, &m.q, &[(first, 1.3)]).unwrap();
            assert!((v[first] - 1.3).abs() < 1e-9);
            let (mut x, mut mass, mut h) = (model.scratch(), vec![0.0; n * n], vec![0.0; n]);
            let (mut phi, mut c) = (vec![0.0; model.size().holonomic], vec![0.0; model.pattern().nnz()]);
            let (mut a, mut b) = (vec![0.0; model.size().rows], vec![0.0; model.size().rows]);
            model.position(m.t, &m.q, &mut x, &mut phi, &mut c, &mut a).unwrap();
            model.velocity(m.t, &m.q, &v, &mut x, &mut b).unwrap();
            model.dynamics(m.t, &m.q, &v, &mut x, &mut mass, &mut h).unwrap();
            let along = |x: &[f64], y: &[f64]| -> f64 {
                (0..n).map(|i| x[i] * (0..n).map(|j| mass[i * n + j] * y[j]).sum::<f64>()).sum()
            };
            // the other columns of D^T are such motions
            for j in 1..k {
                let motion: Vec<f64> = (0..n).map(|i| r.at.dt[i * k + j]).collect();
                let size = (along(&motion, &motion) * along(&v, &v)).sqrt();
                // round-off times the conditions of M and of the choice
                assert!(along(&motion, &v).abs() < 1e-10 * size, "{:e}", along(&motion, &v) / size);
            }
            asked += 1;
            driven += usize::from(model.structure().rheonomic);
        });
    }
    assert!(asked >= 20 && driven >= 5, "{asked} {driven}");
}
