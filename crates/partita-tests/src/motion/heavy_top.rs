//! A heavy top on a spherical joint, in absolute coordinates: turns in space under a partition that changes.

use crate::mechanisms::{bodies, compile, empty, joint};
use partita_integrate::method::Method;
use partita_integrate::options::Options;
use partita_integrate::simulate::{simulate, Settings, Status};
use partita_integrate::tableau::{DOP853, RK4};
use partita_math::spatial::{Mat3, Vec3};
use partita_model::spec::{Body, JointKind, Spec};
use partita_model::zero_position::Coordinates;
use partita_model::Model;
use partita_system::formulation::motion::Projective;
use partita_system::formulation::motion::TangentSpace;
use partita_system::formulation::motion::WehageHaug;
use partita_system::formulation::{registry, Depth, Formulation};
use partita_system::options::FormulationOptions;
use partita_system::prelude::*;
use partita_system::record::{Correction, Output, Sample};
use std::ops::ControlFlow;

const MASS: f64 = 3.0;
const ARM: [f64; 3] = [0.2, 0.1, 0.6];

/// Three different moments of inertia, drawn askew.
fn top() -> Spec {
    let mut spec = empty("top");
    spec.gravity = [0.0, 0.0, -9.81];
    let r = Mat3::about(Vec3([1.0, 2.0, -0.5]).unit().unwrap(), 0.8f64.sin(), 0.8f64.cos());
    spec.bodies.push(Body {
        name: "top".into(),
        mass: MASS,
        com: ARM,
        inertia: [[0.3, 0.02, 0.0], [0.02, 0.4, -0.03], [0.0, -0.03, 0.2]],
        position: [0.0; 3],
        orientation: r.0,
        shape: None,
    });
    spec.joints.push(joint("foot".into(), JointKind::Spherical, "ground", "top", [0.0; 3]));
    spec
}

fn march(f: &mut dyn Formulation, q: &[f64], v: &[f64], at: &[f64], h: Option<f64>) -> Vec<Sample> {
    let mut outputs = Vec::new();
    let mut sink = |s: &Output| {
        outputs.push(s.clone());
        Ok(())
    };
    let method: &'static dyn Method = if h.is_some() { &RK4 } else { &DOP853 };
    let options = Options { rtol: 1e-13, atol: 1e-13.into(), fixed_step: h, ..Options::default() };
    let settings = Settings { t_end: at[at.len() - 1], method, options, max_steps: u64::MAX };
    let outcome = simulate(f, 0.0, q, v, at, &settings, &mut sink, &mut |_| ControlFlow::Continue(())).unwrap();
    assert_eq!(outcome.status, Status::Finished, "{}", outcome.message);
    let events = f.history().events;
    outputs.iter().map(|output| Sample::of(f, output, &events).unwrap()).collect()
}

/// The top with a foot to close: six velocities, three rows; and without: the joint's own coordinates.
fn both() -> (Model, Model) {
    (compile(&top(), Coordinates::Absolute).unwrap(), compile(&top(), Coordinates::Relative).unwrap())
}

/// q and v.
type State = (Vec<f64>, Vec<f64>);

/// Tumbling: carried over, and in joint coordinates.
fn start(absolute: &Model, relative: &Model) -> (State, State) {
    let (q, v) = (relative.initial(), vec![3.0, -4.0, 5.0]);
    (absolute.transferred(relative, &q, &v), (q, v))
}

/// Turn, position of the origin and angular velocity at the samples.
fn states(model: &Model, samples: &[Sample]) -> Vec<f64> {
    let mut all = Vec::new();
    for s in samples {
        let b = bodies(model, &s.q, &s.v)[0];
        all.extend(b.rotation.0.into_iter().flatten().chain(b.position.0).chain(b.angular_velocity.0));
    }
    all
}

fn energy(model: &Model, s: &Sample) -> f64 {
    let b = bodies(model, &s.q, &s.v)[0];
    let arm = b.rotation.apply(Vec3(ARM));
    let u = b.velocity + b.angular_velocity.cross(arm);
    let w = b.rotation.apply_transposed(b.angular_velocity);
    let j = Mat3(model.spec.bodies[0].inertia);
    0.5 * (MASS * u.dot(u) + w.dot(j.apply(w))) + MASS * 9.81 * (b.position + arm).0[2]
}

/// Angular momentum about the vertical through the foot.
fn vertical_momentum(model: &Model, s: &Sample) -> f64 {
    let b = bodies(model, &s.q, &s.v)[0];
    let arm = b.rotation.apply(Vec3(ARM));
    let u = b.velocity + b.angular_velocity.cross(arm);
    let spin =
        b.rotation.apply(Mat3(model.spec.bodies[0].inertia).apply(b.rotation.apply_transposed(b.angular_velocity)));
    (spin + (b.position + arm).cross(u).times(MASS)).0[2]
}

fn largest(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).fold(0.0, |m: f64, (x, y)| m.max((x - y).abs()))
}

#[test]
fn order_rotation_and_invariants() {
    const STEPS: [f64; 4] = [0.004, 0.002, 0.001, 0.0005];
    let (absolute, relative) = both();
    assert_eq!((absolute.size().nq, absolute.size().nv, absolute.size().rows), (7, 6, 3));
    assert_eq!((relative.size().nq, relative.size().rows), (4, 0));
    let ((q, v), (q0, v0)) = start(&absolute, &relative);
    let at: Vec<f64> = (1..=10).map(|i| 0.2 * f64::from(i)).collect();
    let exact = march(&mut Projective::new(&relative, 0, &FormulationOptions::default()), &q0, &v0, &at, None);
    let exact_states = states(&relative, &exact);
    for correction in [Correction::None, Correction::MassOrthogonal, Correction::Partition] {
        let options = FormulationOptions { correction, ..FormulationOptions::default() };
        let mut errors = Vec::new();
        for h in STEPS {
            let mut f = Projective::new(&absolute, 3, &options);
            let samples = march(&mut f, &q, &v, &at, Some(h));
            assert!(f.history().counters.switches >= 4, "{}", f.history().counters.switches);
            for s in &samples {
                let r = bodies(&absolute, &s.q, &s.v)[0].rotation;
                let off = r.transpose().mul(&r).add(&Mat3(Mat3::<f64>::identity().0.map(|x| x.map(|x| -x))));
                let off = off.0.into_iter().flatten().fold(0.0, |m: f64, x| m.max(x.abs()));
                assert!(off < 1e-12, "{off:e}");
                assert!(s.velocity_closure < 1e-13);
                assert!(correction == Correction::None || s.closure < 1e-14, "{:e}", s.closure);
                // ball joint, three of six: the choice stays good however the top stands
                assert!(s.sigma > 0.3, "{}", s.sigma);
            }
            errors.push(largest(&states(&absolute, &samples), &exact_states));
            let (e, l) = (energy(&absolute, &samples[0]), vertical_momentum(&absolute, &samples[0]));
            let last = &samples[samples.len() - 1];
            // no worse than the motion: energy is some 40 J, its derivative in the state some tens
            let bound = 100.0 * errors[errors.len() - 1] + 1e-10;
            assert!(
                (energy(&absolute, last) - e).abs() < bound && (vertical_momentum(&absolute, last) - l).abs() < bound
            );
        }
        let p = slope(&STEPS, &errors);
        assert!((p - 4.0).abs() < 0.2, "{correction:?}: order {p} from {errors:?}");
    }
}

/// Slope of ln y over ln x by least squares.
fn slope(x: &[f64], y: &[f64]) -> f64 {
    let n = x.len() as f64;
    let (x, y): (Vec<f64>, Vec<f64>) = x.iter().zip(y).map(|(x, y)| (x.ln(), y.ln())).unzip();
    let (mx, my) = (x.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let num: f64 = x.iter().zip(&y).map(|(x, y)| (x - mx) * (y - my)).sum();
    num / x.iter().map(|x| (x - mx).powi(2)).sum::<f64>()
}

/// Joint coordinates, absolute coordinates with k equations, and with multipliers: one motion.
#[test]
fn every_form_tumbles_alike() {
    let (absolute, relative) = both();
    let ((q, v), (q0, v0)) = start(&absolute, &relative);
    let at: Vec<f64> = (1..=6).map(|i| 0.25 * f64::from(i)).collect();
    let x = march(&mut Projective::new(&relative, 0, &FormulationOptions::default()), &q0, &v0, &at, None);
    let y = march(&mut Projective::new(&absolute, 3, &FormulationOptions::default()), &q, &v, &at, None);
    let least = FormulationOptions { correction: Correction::MassOrthogonal, ..FormulationOptions::default() };
    let z = march(&mut *registry::by_name("multipliers", &absolute, 3, &least).unwrap(), &q, &v, &at, None);
    // 1e-13 a step, a few hundred steps, a tumbling top that spreads errors by some tens
    let states = [states(&relative, &x), states(&absolute, &y), states(&absolute, &z)];
    assert!(largest(&states[0], &states[1]) < 1e-9, "{:e}", largest(&states[0], &states[1]));
    assert!(largest(&states[0], &states[2]) < 1e-9, "{:e}", largest(&states[0], &states[2]));
    for (model, samples) in [(&relative, &x), (&absolute, &y), (&absolute, &z)] {
        let e = energy(model, &samples[0]);
        samples.iter().for_each(|s| assert!((energy(model, s) - e).abs() < 1e-9 * e.abs(), "{}", energy(model, s) - e));
    }
}

/// A quaternion is a state as a whole, whichever of its velocities is independent, and the choice changes on the way.
#[test]
fn two_k_states_with_a_quaternion() {
    let (absolute, relative) = both();
    let ((q, v), _) = start(&absolute, &relative);
    let at: Vec<f64> = (1..=6).map(|i| 0.25 * f64::from(i)).collect();
    let exact = march(&mut Projective::new(&absolute, 3, &FormulationOptions::default()), &q, &v, &at, None);
    for switch_threshold in [1.05, 1.25, 2.0] {
        let options = FormulationOptions { switch_threshold, ..FormulationOptions::default() };
        let mut f = WehageHaug::new(&absolute, 3, &options).unwrap();
        // three velocities of six; one of them may bring in the quaternion with three numbers more
        assert_eq!((f.layout().dim(), f.layout().controlled), (9, 9));
        let samples = march(&mut f, &q, &v, &at, None);
        let off = largest(&states(&absolute, &samples), &states(&absolute, &exact));
        assert!(off < 1e-9, "{switch_threshold}: {off:e}");
        samples.iter().for_each(|s| assert!(s.closure < 1e-14 && s.velocity_closure < 1e-13, "{:e}", s.closure));
        assert!(f.history().counters.switches > 0);
        assert!(f.history().counters.newton_iterations > 0);
    }
}

/// Frozen tangent velocities and tangent charts: a ball is not the integral of its velocities, and the chart has to know.
#[test]
fn tangent_forms_tumble_alike() {
    const STEPS: [f64; 4] = [0.004, 0.002, 0.001, 0.0005];
    let (absolute, relative) = both();
    let ((q, v), (q0, v0)) = start(&absolute, &relative);
    assert!((0..3).all(|i| relative.structure().velocities[i].coordinates == (0..4)));
    let at: Vec<f64> = (1..=6).map(|i| 0.25 * f64::from(i)).collect();
    let exact = march(&mut Projective::new(&relative, 0, &FormulationOptions::default()), &q0, &v0, &at, None);
    let exact = states(&relative, &exact);
    let options = FormulationOptions::default();
    for name in ["zero-eigenvalue", "svd", "qr", "liang-lance", "gram-schmidt", "tangent-space"] {
        // the top with its foot to close, and the joint's own coordinates (nothing to close, the chart is the ball's)
        for (model, rank, q, v) in [(&absolute, 3, &q, &v), (&relative, 0, &q0, &v0)] {
            let make = || registry::by_name(name, model, rank, &options).unwrap();
            let mut f = make();
            let samples = march(&mut *f, q, v, &at, None);
            let off = largest(&states(model, &samples), &exact);
            assert!(off < 1e-9, "{name}, rank {rank}: {off:e}");
            if name == "tangent-space" {
                assert_eq!(f.layout().controlled, 6);
                let turned = f.history().events.iter().filter(|e| e.reason.contains("ball")).count();
                // with the foot to close the basis decays about as fast as the ball turns
                assert!(turned >= 1 && f.history().events.len() >= 5, "{:?}", f.history().events);
            }
            let errors = STEPS.map(|h| {
                let samples = march(&mut *make(), q, v, &at, Some(h));
                samples.iter().for_each(|s| assert!(s.closure < 1e-14 && s.velocity_closure < 1e-12));
                largest(&states(model, &samples), &exact)
            });
            let p = slope(&STEPS, &errors);
            assert!((p - 4.0).abs() < 0.2, "{name}, rank {rank}: order {p} from {errors:?}");
        }
    }
}

/// Far from the base point of the chart, with random speeds: p' agrees with differences of p along the motion.
#[test]
fn a_chart_of_turns_moves_as_its_ball_turns() {
    let (absolute, relative) = both();
    let ((q, v), (q0, v0)) = start(&absolute, &relative);
    for (model, rank, q, v) in [(&absolute, 3, &q, &v), (&relative, 0, &q0, &v0)] {
        let mut f = TangentSpace::new(model, rank, &FormulationOptions::default()).unwrap();
        let mut y = vec![0.0; 6 + usize::from(model.structure().has_power)];
        f.start(0.0, q, v, &mut y).unwrap();
        // Θ of a few tenths up to more than two
        for size in [0.1, 0.4, 0.8] {
            y[..3].copy_from_slice(&[0.5 * size, -size, 0.7 * size]);
            let mut dy = vec![0.0; y.len()];
            f.rates(0.0, &y, &mut dy, Depth::Rates).unwrap();
            let (middle, v) = (f.position().to_vec(), f.reduction().at.v.clone());
            // rotation and place a little further along p', against the turn by ω and the step by v
            let h = 1e-4;
            let mut along = |s: f64| {
                let mut y = y.clone();
                (0..3).for_each(|j| y[j] += s * dy[j]);
                f.rates(0.0, &y, &mut vec![0.0; y.len()], Depth::Rates).unwrap();
                let b = bodies(model, f.position(), &v)[0];
                b.rotation.0.into_iter().flatten().chain(b.position.0).collect::<Vec<f64>>()
            };
            let (plus, minus) = (along(h), along(-h));
            let moved = |s: f64| {
                let mut q = middle.clone();
                model.step(&mut q, &v.iter().map(|v| s * v).collect::<Vec<f64>>());
                let b = bodies(model, &q, &v)[0];
                b.rotation.0.into_iter().flatten().chain(b.position.0).collect::<Vec<f64>>()
            };
            let (forward, backward) = (moved(h), moved(-h));
            for i in 0..12 {
                let (x, y) = ((plus[i] - minus[i]) / (2.0 * h), (forward[i] - backward[i]) / (2.0 * h));
                // h² times third derivatives of some hundred
                assert!((x - y).abs() < 1e-5 * (1.0 + y.abs()), "{x} {y} at {size}");
            }
        }
    }
}
