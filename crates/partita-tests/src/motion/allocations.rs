//! After the first call an evaluation of a mechanism allocates nothing, whichever way its equations are projected.

use crate::counting::{allocations, BYTES};
use crate::mechanisms::{body, compile, couple, drawing, empty, joint, loads, Moment, Wishes, COUPLINGS, ROLLS};
use partita_analysis::actuated::Actuated;
use partita_analysis::inverse::{Actuator, Inverse};
use partita_analysis::run::run;
use partita_integrate::simulate::Status;
use partita_model::spec::{Follows, Force, Friction, JointKind, Measure, Spec, Spring, Torque, Value};
use partita_model::zero_position::Coordinates;
use partita_model::Model;
use partita_system::formulation::motion::Projective;
use partita_system::formulation::{registry, Depth, Findings, Formulation, Step, StepDecision};

use partita_system::options::FormulationOptions;
use partita_system::prelude::*;
use partita_system::start;
use std::ops::ControlFlow;
use std::sync::Arc;

const Z: Option<[f64; 3]> = Some([0.0, 0.0, 1.0]);

/// Rods between points of the plane; pins at their ends.
fn pin(spec: &mut Spec, a: &str, b: &str, at: [f64; 3]) {
    let name = format!("pin{}", spec.joints.len());
    spec.joints.push(joint(name, JointKind::Revolute, a, b, at));
    spec.joints.last_mut().unwrap().axis = Z;
}

/// N loops of uprights and couplers, all but upright.
fn chain(n: usize) -> Spec {
    let mut rng = fastrand::Rng::with_seed(n as u64);
    let mut spec = empty("chain");
    let top = |i: usize| [i as f64 + 0.4, 0.9, 0.0];
    for i in 0..=n {
        spec.bodies.push(body(&mut rng, format!("upright{i}")));
        pin(&mut spec, "ground", &format!("upright{i}"), [i as f64, 0.0, 0.0]);
    }
    for i in 0..n {
        let coupler = format!("coupler{i}");
        spec.bodies.push(body(&mut rng, coupler.clone()));
        pin(&mut spec, &format!("upright{i}"), &coupler, top(i));
        pin(&mut spec, &coupler, &format!("upright{}", i + 1), top(i + 1));
    }
    spec
}

fn four_bar() -> Spec {
    let mut rng = fastrand::Rng::with_seed(1);
    let mut spec = empty("four-bar");
    for name in ["crank", "coupler", "rocker"] {
        spec.bodies.push(body(&mut rng, name.into()));
    }
    pin(&mut spec, "ground", "crank", [0.0; 3]);
    pin(&mut spec, "crank", "coupler", [0.7, 0.7, 0.0]);
    pin(&mut spec, "coupler", "rocker", [3.1, 1.8, 0.0]);
    pin(&mut spec, "ground", "rocker", [2.2, 0.0, 0.0]);
    let name = "torque".to_string();
    spec.forces.push(Force::Torque(Torque {
        name,
        joint: "pin0".into(),
        coordinate: 0,
        value: Value::Constant(1.0),
        over: None,
        periodic: false,
    }));
    spec
}

/// The spatial chain with springs across it.
fn in_space() -> Spec {
    let mut spec = crate::mechanisms::in_space();
    for (i, (a, b)) in [("ground", "body1"), ("body0", "body2")].into_iter().enumerate() {
        spec.forces.push(Force::Spring(Spring {
            name: format!("spring{i}"),
            body1: a.into(),
            point1: [0.3, 0.2, 0.1],
            body2: b.into(),
            point2: [0.0, 0.1, -0.2],
            stiffness: 20.0,
            damping: 0.5,
            length: 0.4,
        }));
    }
    spec
}

/// Twelve pendulums side by side, two of them coupled: nearly as many degrees of freedom as coordinates, so that dense
/// matrices are the cheaper way.
fn rank_and_file(kind: JointKind) -> Spec {
    let mut rng = fastrand::Rng::with_seed(3);
    let mut spec = empty("rank and file");
    for i in 0..12 {
        let name = format!("body{i}");
        spec.bodies.push(body(&mut rng, name.clone()));
        let mut j = joint(format!("joint{i}"), kind, "ground", &name, [i as f64, 0.0, 0.0]);
        j.axis = Z;
        spec.joints.push(j);
    }
    spec.bodies.push(body(&mut rng, "coupler".into()));
    pin(&mut spec, "body3", "coupler", [3.2, 0.7, 0.0]);
    pin(&mut spec, "coupler", "body4", [4.1, 0.9, 0.0]);
    if kind == JointKind::Spherical {
        // between turning balls a pin would lock too much
        for j in spec.joints.iter_mut().skip(12) {
            j.kind = JointKind::Spherical;
        }
    }
    spec
}

/// Allocations of the calls that follow the first one, at states all around the start.
fn count(model: &Model, what: &str) {
    let mut q = model.initial();
    partita_system::kinematics::assembly::close(model, 0.0, &mut q, 1e-10, &[]).unwrap();
    let rank = start::analyse(model, 0.0, &q).unwrap().rank;
    let mut f = Projective::new(model, rank, &FormulationOptions::default());
    let (mut y, mut dy) = (vec![0.0; f.layout().dim()], vec![0.0; f.layout().dim()]);
    f.start(0.0, &q, &vec![0.0; model.size().nv], &mut y).unwrap();
    let (nq, k) = (model.size().nq, model.size().nv - rank);
    assert!(k > 0);
    let speeds: Vec<f64> = (0..k).map(|i| 0.3 + 0.1 * i as f64 / k as f64).collect();
    y[nq..nq + k].copy_from_slice(&speeds);
    f.rates(0.0, &y, &mut dy, Depth::Rates).unwrap();
    let (q, mut turns) = (y[..nq].to_vec(), vec![0; nq]);
    let ((), counted) = allocations(|| {
        for i in 0..20 {
            y[nq] = 0.2 + 0.01 * f64::from(i);
            // a stage: a little off the closed position
            y[0] = q[0] + 1e-3 * f64::from(i);
            f.rates(1e-3 * f64::from(i), &y, &mut dy, Depth::Rates).unwrap();
            f.reduction().evaluate(0.0, &q, &speeds).unwrap();
            // corrects and evaluates the end; the scales are refreshed when it is taken, now and then
            f.trial_end(1e-3 * f64::from(i), &mut y, &mut dy, true).unwrap();
            let mut step = Step {
                t: 1e-3 * f64::from(i),
                y: &mut y,
                dy: &mut dy,
                turns: &mut turns,
                pace: None,
                findings: Findings::default(),
            };
            f.commit(StepDecision::Keep, &mut step).unwrap();
        }
    });
    assert_eq!(counted, 0, "{what}: {} allocations", counted);
}

/// Allocations of evaluations by a formulation of the registry, stages all around the start.
fn count_named(name: &str, model: &Model) {
    let mut q = model.initial();
    partita_system::kinematics::assembly::close(model, 0.0, &mut q, 1e-10, &[]).unwrap();
    let rank = start::analyse(model, 0.0, &q).unwrap().rank;
    let options = FormulationOptions { baumgarte: Some((5.0, 5.0)), ..FormulationOptions::default() };
    let mut f = registry::by_name(name, model, rank, &options).unwrap();
    let (mut y, mut dy) = (vec![0.0; f.layout().dim()], vec![0.0; f.layout().dim()]);
    f.start(0.0, &q, &vec![0.0; model.size().nv], &mut y).unwrap();
    f.rates(0.0, &y, &mut dy, Depth::Rates).unwrap();
    let (start, last) = (y.clone(), f.layout().controlled - 1);
    let ((), counted) = allocations(|| {
        for i in 0..20 {
            (y[0], y[last]) = (start[0] + 1e-4 * f64::from(i), start[last] + 0.01 * f64::from(i));
            f.rates(1e-3 * f64::from(i), &y, &mut dy, Depth::Rates).unwrap();
        }
    });
    assert_eq!(counted, 0, "{name}: {} allocations", counted);
}

#[test]
fn evaluations_allocate_nothing() {
    let compiled = |spec: Spec| compile(&spec, Coordinates::Relative).unwrap();
    count(&compiled(four_bar()), "four-bar");
    count(&compiled(chain(20)), "twenty loops");
    let space = compiled(in_space());
    assert!(!space.is_planar());
    count(&space, "in space");
    count(&compile(&in_space(), Coordinates::Absolute).unwrap(), "in space, absolute");
    count(&compiled(rank_and_file(JointKind::Revolute)), "rank and file in the plane");
    let balls = compiled(rank_and_file(JointKind::Spherical));
    assert!(balls.size().nq > balls.size().nv);
    count(&balls, "rank and file of balls");
    for name in ["multipliers", "range-space", "baumgarte", "proximal", "wehage-haug"] {
        count_named(name, &compiled(four_bar()));
        count_named(name, &space);
        count_named(name, &balls);
    }
    for model in [four_bar(), chain(20), in_space(), rank_and_file(JointKind::Revolute)] {
        count_named("explicit-closing", &compiled(model));
    }
}

fn diagonal(x: f64) -> [[f64; 3]; 3] {
    [[x, 0.0, 0.0], [0.0, x, 0.0], [0.0, 0.0, x]]
}

/// A crank, a rod between balls, which spins idly, and a slider.
fn rod_between_balls() -> Spec {
    let mut rng = fastrand::Rng::with_seed(5);
    let mut spec = empty("rod");
    for name in ["crank", "rod", "slider"] {
        spec.bodies.push(body(&mut rng, name.into()));
    }
    pin(&mut spec, "ground", "crank", [0.0; 3]);
    spec.joints.push(joint("near".into(), JointKind::Spherical, "crank", "rod", [0.3, 0.4, 0.2]));
    spec.joints.push(joint("far".into(), JointKind::Spherical, "rod", "slider", [1.7, 0.1, 0.5]));
    let mut slide = joint("slide".into(), JointKind::Prismatic, "ground", "slider", [1.7, 0.1, 0.5]);
    slide.axis = Some([1.0, 0.0, 0.0]);
    spec.joints.push(slide);
    let rod = spec.bodies.iter_mut().find(|b| b.name == "rod").unwrap();
    // its centre of mass on its line, without a preferred side
    (rod.position, rod.com) = ([1.0, 0.25, 0.35], [0.0; 3]);
    (rod.orientation, rod.inertia) = (diagonal(1.0), diagonal(0.2));
    spec
}

/// Allocations of the equations in the rates of actuators, at states around the start.
fn count_actuated(spec: &Spec, motors: &[&str], what: &str) {
    let model = Arc::new(compile(spec, Coordinates::Relative).unwrap());
    let along = |joint: &&str| Actuator {
        name: (*joint).into(),
        along: vec![Measure::Joint { joint: (*joint).into(), coordinate: 0 }],
        rate: false,
        axis: None,
    };
    let set = Inverse::new(&model, &motors.iter().map(along).collect::<Vec<_>>(), &[]).unwrap();
    let mut q = model.initial();
    partita_system::kinematics::assembly::close(&*model, 0.0, &mut q, 1e-10, &[]).unwrap();
    let mut a = Actuated::new(Arc::new(set), 0.0, &q).unwrap();
    let mut v = vec![0.0; model.size().nv];
    a.evaluate(0.0, &q, &v).unwrap();
    for (v, row) in v.iter_mut().zip(a.ratios.chunks_exact(motors.len())) {
        *v = row.iter().sum();
    }
    let ((), counted) = allocations(|| (0..20).for_each(|_| a.evaluate(0.0, &q, &v).unwrap()));
    assert_eq!(counted, 0, "{what}: {counted} allocations");
    assert!(a.rates(&v).iter().all(|w| (w - 1.0).abs() < 1e-12), "{what}");
}

#[test]
fn equations_in_the_rates_of_actuators_allocate_nothing() {
    for motor in ["pin0", "pin1", "pin2", "pin3"] {
        count_actuated(&four_bar(), &[motor], motor);
    }
    for motor in ["pin0", "slide"] {
        count_actuated(&rod_between_balls(), &[motor], motor);
    }
}

/// Evaluations of a mechanism that moves, by one formulation; of the projective one the ends of steps as well.
fn count_moving(name: &str, model: &Model, m: &Moment, what: &str) {
    let options = FormulationOptions { baumgarte: Some((5.0, 5.0)), ..FormulationOptions::default() };
    let mut f = registry::by_name(name, model, m.rank, &options).unwrap();
    let (mut y, mut dy) = (vec![0.0; f.layout().dim()], vec![0.0; f.layout().dim()]);
    f.start(m.t, &m.q, &m.v, &mut y).unwrap();
    f.rates(m.t, &y, &mut dy, Depth::Rates).unwrap();
    let (start, slope, mut turns) = (y.clone(), dy.clone(), vec![0; m.q.len()]);
    let holonomic = model.equations().full.conditions.iter().all(|c| c.holonomic);
    let mut around = |count: i32| {
        for i in 0..count {
            // along the motion, as stages of a step are
            let h = 1e-5 * f64::from(i);
            y.iter_mut().zip(start.iter().zip(&slope)).for_each(|(y, (s, d))| *y = s + h * d);
            f.rates(m.t + h, &y, &mut dy, Depth::Rates).unwrap();
            // where rates alone are held, the end of a step is corrected in all velocities, with matrices of its own
            if name == "projective" && holonomic {
                f.trial_end(m.t + h, &mut y, &mut dy, true).unwrap();
                let mut step = Step {
                    t: m.t + h,
                    y: &mut y,
                    dy: &mut dy,
                    turns: &mut turns,
                    pace: None,
                    findings: Findings::default(),
                };
                f.commit(StepDecision::Keep, &mut step).unwrap();
            }
        }
    };
    around(1);
    let ((), counted) = allocations(|| around(20));
    assert_eq!(counted, 0, "{what}, {name}: {counted} allocations");
}

/// Bushings, contacts, a tyre, friction, stops, laws and functions, with every kind of coupling and drive.
#[test]
fn loads_and_couplings_allocate_nothing() {
    let mut rng = fastrand::Rng::with_seed(61);
    for planar in [false, true] {
        for kind in (0..COUPLINGS).filter(|&kind| !planar || kind != ROLLS) {
            let wishes = Wishes { planar, bound: true, drives: true };
            let found = (0..400).find_map(|_| {
                let mut spec = drawing(&mut rng, wishes);
                loads(&mut rng, &mut spec);
                let drawn = couple(&mut rng, &mut spec, planar, kind);
                let model = compile(&spec, Coordinates::Relative).filter(|m| drawn && m.is_planar() == planar)?;
                let moment = Moment::random(&mut rng, &model)?;
                Some((model, moment))
            });
            let (model, moment) = found.expect("a mechanism that moves");
            let what = format!("coupling {kind}, planar {planar}");
            for name in ["projective", "multipliers", "range-space"] {
                count_moving(name, &model, &moment, &what);
            }
            if model.equations().full.conditions.iter().all(|c| c.holonomic) {
                count_moving("wehage-haug", &model, &moment, &what);
                count_moving("explicit-closing", &model, &moment, &what);
            }
        }
    }
}

/// Friction in every turn and slide of a drawing that follows its reaction.
fn rub(spec: &mut Spec) {
    for j in &spec.joints {
        if !matches!(j.kind, JointKind::Revolute | JointKind::Prismatic) {
            continue;
        }
        let radius = (j.kind == JointKind::Revolute).then_some(0.02);
        let follows = Follows { coefficient: 0.1, held: Some(0.15), radius, length: None, collar: None, preload: 1.0 };
        spec.forces.push(Force::Friction(Friction {
            name: format!("rubs {}", j.name),
            joint: j.name.clone(),
            coordinate: 0,
            dynamic: Value::Constant(0.0),
            held: None,
            stick_velocity: 0.5,
            follows: Some(follows),
            signs: [0.0; 2],
        }));
    }
}

#[test]
fn frictions_that_follow_reactions_allocate_nothing() {
    for (spec, what) in [(four_bar(), "four-bar"), (chain(4), "four loops"), (in_space(), "in space")] {
        for coordinates in [Coordinates::Relative, Coordinates::Absolute] {
            let mut rubbing = spec.clone();
            rub(&mut rubbing);
            assert!(rubbing.forces.len() > spec.forces.len(), "{what}");
            let model = compile(&rubbing, coordinates).unwrap();
            count(&model, what);
            for name in ["multipliers", "sparse-multipliers", "wehage-haug"] {
                count_named(name, &model);
            }
        }
    }
}

/// How many bytes `f` asks for on this thread, whether it gives them back or not.
fn bytes<R>(f: impl FnOnce() -> R) -> (R, usize) {
    let before = BYTES.get();
    std::hint::black_box(vec![1.0; 3]);
    let start = BYTES.get();
    assert!(start >= before + 24, "the counter counts");
    let result = f();
    (result, BYTES.get() - start)
}

/// From the look at its drawing to the end of a few steps: nothing in a run is kept for each pair of loops, let alone
/// for each three of them.
#[test]
fn memory_of_a_run_grows_as_the_loops_do() {
    let text = r#"{"t_end": 0.004, "rtol": 1e-8, "atol": 1e-10, "method": "rk4", "formulation": "projective", "step": 1e-3,
        "correction": "partition", "switch_threshold": 1.25, "max_steps": 100, "selection": "collective", "renew": 0.5}"#;
    let request = serde_json::from_str(text).unwrap();
    for coordinates in [Coordinates::Relative, Coordinates::Absolute] {
        let [few, many] = [60, 240].map(|loops| {
            let mut spec = chain(loops);
            for body in &mut spec.bodies {
                let at = spec.joints.iter().find(|j| j.child == body.name).expect("all hang on something").point;
                body.position = [at[0] + 0.2, at[1] + 0.3, at[2] + 0.1];
            }
            let (done, taken) = bytes(|| {
                let model = compile(&spec, coordinates).expect("a chain compiles");
                assert!(model.geometry().dof.is_some(), "it fits as it is drawn");
                let (q, v) = (model.initial(), vec![0.0; model.size().nv]);
                run(&model, &request, None, &[0.004], (&q, &v), &mut |_| ControlFlow::Continue(())).unwrap()
            });
            assert_eq!(done.outcome.status, Status::Finished, "{}", done.outcome.message);
            taken
        });
        // four times the loops
        assert!(many < 6 * few, "{coordinates:?}: {few} bytes for 60 loops, {many} for 240");
    }
}
