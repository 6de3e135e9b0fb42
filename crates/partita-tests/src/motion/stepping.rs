//! A motion stepped by ticks: no memory after set-up, the same work at each tick, back where it stood after a failure.

use crate::counting::allocations;
use crate::mechanisms::{body, empty, joint};
use partita_analysis::run::{Request, Stepping};
use partita_math::tolerance;
use partita_model::spec::{Force, JointKind, Spec, Torque, Value};
use partita_model::value::Functions;
use partita_model::zero_position::Coordinates;
use partita_model::Model;
use partita_system::kinematics::assembly;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::Arc;

/// Two torques that are held, and how often they were asked for.
struct Motors {
    numbers: [AtomicU64; 2],
    calls: AtomicU64,
    fails: f64,
    /// Whether they are numbers given from outside instead of functions.
    given: bool,
}

type Fault = Box<dyn std::error::Error + Send + Sync>;

impl Functions for Motors {
    fn count(&self) -> usize {
        2
    }
    fn given(&self, i: usize) -> Option<usize> {
        self.given.then_some(i)
    }
    fn given_count(&self) -> usize {
        self.numbers.len()
    }
    fn given_number(&self, place: usize) -> f64 {
        f64::from_bits(self.numbers[place].load(Ordering::Relaxed))
    }
    fn scalar(&self, i: usize, t: f64, _: &[f64], _: &[f64]) -> Result<f64, Fault> {
        self.calls.fetch_add(1, Ordering::Relaxed);
        if t > self.fails {
            return Err("the motor is off".into());
        }
        Ok(self.given_number(i))
    }
    fn vector(&self, _: usize, _: f64, _: &[f64], _: &[f64]) -> Result<[f64; 3], Fault> {
        Err("no vector".into())
    }
    fn motion(&self, _: usize, _: f64) -> Result<[f64; 3], Fault> {
        Err("no motion".into())
    }
}

/// Five bars with a torque at each foot.
fn five_bar() -> Spec {
    let mut rng = fastrand::Rng::with_seed(5);
    let mut spec = empty("five-bar");
    let points = [[0.0, 0.0, 0.0], [-0.4, 0.8, 0.0], [0.5, 1.6, 0.0], [1.4, 0.8, 0.0], [1.0, 0.0, 0.0]];
    let names = ["ground", "a", "b", "c", "d", "ground"];
    names[1..5].iter().for_each(|name| spec.bodies.push(body(&mut rng, (*name).into())));
    for (i, at) in points.into_iter().enumerate() {
        let (parent, child) = if i == 4 { ("ground", "d") } else { (names[i], names[i + 1]) };
        let mut pin = joint(format!("pin{i}"), JointKind::Revolute, parent, child, at);
        pin.axis = Some([0.0, 0.0, 1.0]);
        spec.joints.push(pin);
    }
    for (i, foot) in ["pin0", "pin4"].into_iter().enumerate() {
        spec.forces.push(Force::Torque(Torque {
            name: format!("motor{i}"),
            joint: foot.into(),
            coordinate: 0,
            value: Value::Function(i),
            over: None,
            periodic: false,
        }));
    }
    spec
}

fn request() -> Request {
    let text = r#"{"t_end": 1.0, "rtol": 1e-8, "atol": 1e-10, "method": "rk4", "formulation": "projective", "step": 5e-4,
        "correction": "partition", "switch_threshold": 1.25, "max_steps": 100, "selection": "collective", "renew": 0.5}"#;
    serde_json::from_str(text).unwrap()
}

fn motors(fails: f64, given: bool) -> Arc<Motors> {
    Arc::new(Motors { numbers: Default::default(), calls: AtomicU64::new(0), fails, given })
}

fn started(motors: &Arc<Motors>) -> (Model, Vec<f64>, Vec<f64>) {
    let model = Model::new(five_bar(), motors.clone(), Coordinates::Relative).unwrap();
    let mut q = model.initial();
    assembly::close(&model, 0.0, &mut q, tolerance::CLOSED, &[]).unwrap();
    let v = vec![0.0; q.len()];
    (model, q, v)
}

#[test]
fn a_tick_takes_no_memory_and_always_the_same_work() {
    let motors = motors(f64::INFINITY, false);
    let (model, q, v) = started(&motors);
    let mut motion = Stepping::new((&model).into(), &request(), (1e-3, 2), (0.0, &q, &v), false).unwrap();
    let mut work = Vec::with_capacity(1000);
    let (mut worst, mut changes) = (0, motion.reported(false).log.events.len());
    for k in 0..1000 {
        let t = f64::from(k) * 1e-3;
        for (cell, u) in motors.numbers.iter().zip([3.0 * (9.0 * t).sin(), -2.0 * (7.0 * t).cos()]) {
            cell.store(u.to_bits(), Ordering::Relaxed);
        }
        let before = motors.calls.load(Ordering::Relaxed);
        let (taken, counted) = allocations(|| motion.step());
        taken.unwrap();
        let calls = motors.calls.load(Ordering::Relaxed) - before;
        let known = std::mem::replace(&mut changes, motion.reported(false).log.events.len());
        // the first tick makes room, and a switch is written down
        if k > 0 && known == changes {
            work.push(calls);
            worst = worst.max(counted);
        }
    }
    assert!(work.len() > 950);
    assert_eq!(worst, 0);
    // nine evaluations, one at the start and four in each of two steps; each asks two motors for forces and for power
    assert!(work.iter().all(|&calls| calls == 9 * 2 * 2), "{work:?}");
    assert!((motion.now().t - 1.0).abs() < 1e-14);
}

#[test]
fn a_tick_that_fails_leaves_the_motion_where_it_was() {
    let motors = motors(0.0205, false);
    let (model, q, v) = started(&motors);
    let mut motion = Stepping::new((&model).into(), &request(), (1e-3, 2), (0.0, &q, &v), true).unwrap();
    for _ in 0..20 {
        motion.step().unwrap();
    }
    let before = motion.now().clone();
    for _ in 0..2 {
        assert!(motion.step().unwrap_err().to_string().contains("the motor is off"));
        assert_eq!(*motion.now(), before);
    }
    assert_eq!(motion.reported(false).log.outputs.len(), 21);
    motion.begin(0.0, &q, &v, &mut || ()).unwrap();
    for _ in 0..20 {
        motion.step().unwrap();
    }
    for (x, y) in motion.now().v.iter().zip(&before.v) {
        assert!((x - y).abs() < 1e-15, "the same again");
    }
}

#[test]
fn given_numbers_move_it_as_functions_of_time_do() {
    let all = [false, true].map(|given| motors(f64::INFINITY, given));
    let made = all.each_ref().map(started);
    let [mut one, mut other] = made
        .each_ref()
        .map(|(model, q, v)| Stepping::new(model.into(), &request(), (1e-3, 2), (0.0, q, v), false).unwrap());
    for k in 0..300 {
        let t = f64::from(k) * 1e-3;
        for (cell, u) in all.iter().flat_map(|x| x.numbers.iter().zip([3.0 * (9.0 * t).sin(), -2.0 * (7.0 * t).cos()]))
        {
            cell.store(u.to_bits(), Ordering::Relaxed);
        }
        one.step().unwrap();
        let (taken, counted) = allocations(|| other.step());
        taken.unwrap();
        assert_eq!(one.now(), other.now());
        assert!(k == 0 || counted == 0 || other.reported(false).log.events.len() > 1, "tick {k}");
    }
    assert_eq!(all[1].calls.load(Ordering::Relaxed), 0);
}
