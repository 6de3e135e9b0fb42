//! Marching with tangent velocities: order, one motion with every form, and how a frozen basis decays.

use crate::pieces::{
    any, distance, grid, march, reference, run, slope, times, Angles, Any, FourBar, Pendulum, GROUND, LENGTHS,
};
use partita_system::equations::{Equations, UserSystem};
use partita_system::formulation::motion::TangentSpace;
use partita_system::formulation::{registry, Depth, Formulation};
use partita_system::options::{FormulationOptions, Renew, TangentMap};
use partita_system::prelude::*;
use partita_system::record::{Correction, Sample};
use partita_system::tangent::basis::Rule;
use partita_system::tangent::frozen::Frozen;
use partita_system::tangent::TangentChoice;
use partita_system::tangent::TangentLevels;
use partita_system::SystemError;
use std::sync::Arc;

const NAMES: [&str; 6] = ["zero-eigenvalue", "svd", "qr", "liang-lance", "gram-schmidt", "tangent-space"];
/// Steps in the range where the leading error term rules and round-off does not.
const STEPS: [f64; 4] = [0.002, 0.001, 0.0005, 0.00025];

fn formulation<'s, E: Equations>(
    system: &'s UserSystem<E>,
    name: &str,
    correction: Correction,
    renew: impl Into<Renew>,
) -> Box<dyn Formulation + Send + 's> {
    let options = FormulationOptions { correction, renew: renew.into(), ..FormulationOptions::default() };
    registry::by_name(name, system, system.size().rows, &options).unwrap()
}

#[test]
fn order_of_a_four_bar() {
    let system = any(FourBar);
    let (q, v) = FourBar::start();
    let at = times(0.2, 10);
    let exact = run(&system, FormulationOptions::default(), &FourBar::start(), &at, &reference(2.0));
    let mut last = Vec::new();
    for name in NAMES {
        for correction in [Correction::None, Correction::MassOrthogonal, Correction::Partition] {
            if name == "tangent-space" && correction != Correction::Partition {
                continue; // nothing to correct
            }
            let errors = STEPS.map(|h| {
                // renewed early: near the end of a basis the higher terms of the error still show at these steps
                let mut f = formulation(&system, name, correction, 0.8);
                let samples = march(&mut *f, &q, &v, &at, &grid(2.0, h));
                assert!(f.history().events.len() >= 3, "{name}: {:?}", f.history().events);
                for s in &samples {
                    assert!(s.velocity_closure < 1e-12, "{name}: {:e}", s.velocity_closure);
                    assert!(correction == Correction::None || s.closure < 1e-14, "{name}: {:e}", s.closure);
                }
                distance(&samples, &exact)
            });
            let p = slope(&STEPS, &errors);
            assert!((p - 4.0).abs() < 0.2, "{name}, {correction:?}: order {p} from {errors:?}");
            last.push(errors[3]);
        }
    }
    // different variables, one motion: errors of one size
    let (low, high) = last.iter().fold((f64::INFINITY, 0.0f64), |m, &e| (m.0.min(e), m.1.max(e)));
    assert!(high < 30.0 * low, "{last:?}");
}

/// To the tolerance of the reference, over some turns of the crank.
#[test]
fn one_motion_with_every_form() {
    let system = any(FourBar);
    let (q, v) = FourBar::start();
    let at = times(0.5, 8);
    let exact = run(&system, FormulationOptions::default(), &FourBar::start(), &at, &reference(4.0));
    for name in NAMES {
        let mut f = formulation(&system, name, Correction::Partition, 0.5);
        let samples = march(&mut *f, &q, &v, &at, &reference(4.0));
        // tolerance 2e-14, a few hundred steps, growth of errors by some hundreds in four seconds
        assert!(distance(&samples, &exact) < 1e-8, "{name}: {:e}", distance(&samples, &exact));
        for (x, y) in samples.iter().zip(&exact) {
            x.multipliers
                .iter()
                .zip(&y.multipliers)
                .for_each(|(x, y)| assert!((x - y).abs() < 1e-6, "{name}: {x} {y}"));
            assert_eq!(x.independent.len(), 1);
            // an orthonormal basis of the units at hand is oblique from the start, one in the mass metric falls to renew
            let least = if name == "gram-schmidt" || name == "tangent-space" { 0.4 } else { 0.1 };
            assert!(x.sqrt_mu > least, "{name}: {}", x.sqrt_mu);
        }
        let notes = f.history().notes;
        assert!(notes.iter().any(|n| n.contains("renewed")), "{notes:?}");
    }
}

/// Renewed after each step, early or never (over an arc for which one basis suffices): the same motion, errors within a factor 3.
#[test]
fn renewing_is_free_of_error() {
    let system = any(FourBar);
    let (q, v) = FourBar::start();
    // swings down from 0.8 rad with the rocker: half a second keeps the first basis above 0.4
    let at = times(0.05, 10);
    let exact = run(&system, FormulationOptions::default(), &FourBar::start(), &at, &reference(0.5));
    for name in NAMES {
        let errors = [0.0.into(), 0.5.into(), 1.0.into(), Renew::EachStep].map(|renew: Renew| {
            let mut f = formulation(&system, name, Correction::Partition, renew);
            let samples = march(&mut *f, &q, &v, &at, &grid(0.5, 0.005));
            let counters = f.history().counters;
            if renew.never() {
                assert_eq!((f.history().events.len(), counters.renewals), (1, 1));
            }
            if renew == Renew::EachStep {
                // counted, not listed: a long run must not fill the memory
                assert_eq!((f.history().events.len(), counters.renewals), (1, 101));
                assert!(f.history().notes.iter().any(|n| n.contains("renewed 100 times")), "{:?}", f.history().notes);
            }
            if renew == 1.0.into() && ["svd", "gram-schmidt", "tangent-space"].contains(&name) {
                // after most of the hundred steps (a basis oblique from the start may get better for a while)
                assert!(f.history().events.len() > 30, "{}", f.history().events.len());
            }
            distance(&samples, &exact)
        });
        let (low, high) = errors.iter().fold((f64::INFINITY, 0.0f64), |m, &e| (m.0.min(e), m.1.max(e)));
        assert!(high < 3.0 * low, "{name}: {errors:?}");
    }
}

/// A mass-orthonormal basis frozen at the crank angle 0.8 rad: √μ after the crank has turned on by so many degrees.
#[test]
fn decay_of_a_frozen_basis() {
    let system = any(FourBar);
    let mut x = Frozen::new(&system, 8, Box::new(Rule::GramSchmidt), 0.5);
    let at = |degrees: f64| {
        let crank = 0.8 + degrees.to_radians();
        let [a, b] = Angles::close(crank);
        let (mut q, mut p) = (vec![], [0.0, 0.0]);
        for (l, f) in LENGTHS.iter().zip([crank, a, b]) {
            q.extend([p[0] + 0.5 * l * f.cos(), p[1] + 0.5 * l * f.sin(), f]);
            p = [p[0] + l * f.cos(), p[1] + l * f.sin()];
        }
        assert!((p[0] - GROUND).abs() < 1e-14 && p[1].abs() < 1e-14);
        q
    };
    x.start(0.0, &mut at(0.0), &[0.0; 9]).unwrap();
    for (degrees, wanted) in [(0.0, 1.0), (10.0, 0.98), (40.0, 0.83), (80.0, 0.46), (120.0, 0.04)] {
        let q = at(degrees);
        x.reduction().position(0.0, &q).unwrap();
        x.tangent(0.0, &q, false).unwrap();
        x.spread(&[1.0]);
        x.accelerate(0.0, &q, &[1.0]).unwrap();
        let found = x.quality_here(0.0, &q).unwrap().sqrt_mu;
        assert!((found - wanted).abs() < 0.005, "{found} after {degrees} degrees");
    }
}

/// The chart of the tangent space is closed wherever it is evaluated, not only at the ends of steps.
#[test]
fn every_stage_is_closed() {
    let system = any(FourBar);
    let (q, v) = FourBar::start();
    let mut f = TangentSpace::new(&system, 8, &FormulationOptions::default()).unwrap();
    let mut y = vec![0.0; f.layout().dim()];
    assert_eq!((f.layout().dim(), f.layout().controlled), (2, 2));
    f.start(0.0, &q, &v, &mut y).unwrap();
    let mut dy = vec![0.0; 2];
    for i in -20..=20 {
        // far from the base, and nowhere near a motion
        let point = [0.02 * f64::from(i), 3.0 * f64::from(i % 3)];
        f.rates(0.0, &point, &mut dy, Depth::Rates).unwrap();
        let (mut phi, p) = (vec![0.0; 8], f.position().to_vec());
        system.equations.constraints(0.0, &p, &mut phi).unwrap();
        phi.iter().for_each(|x| assert!(x.abs() < 1e-14, "{x:e} at {point:?}"));
        let moved: Vec<f64> = p.iter().zip(&q).map(|(p, q)| p - q).collect();
        let mut back = [0.0];
        f.tangent().select(&moved, &mut back);
        assert!((back[0] - point[0]).abs() < 1e-13, "{} for {}", back[0], point[0]);
        assert_eq!(dy[0], point[1]);
    }
}

const SHAKEN: Pendulum = Pendulum { amplitude: 0.3, frequency: 3.0, mass: 2.0 };
const SHAKEN_STEPS: [f64; 4] = [0.004, 0.002, 0.001, 0.0005];

/// Times at which the shaken pendulum is looked at, from its start, and what the compact form finds there.
fn shaken(system: &UserSystem<Any>, start: &(Vec<f64>, Vec<f64>)) -> (Vec<f64>, Vec<Sample>) {
    let at: Vec<f64> = (0..=10).map(|i| 0.2 * f64::from(i)).collect();
    let exact = run(system, FormulationOptions::default(), start, &at, &reference(2.0));
    (at, exact)
}

/// Constraints that move with time: order, and the work of the drive.
#[test]
fn a_shaken_pivot() {
    let p = SHAKEN;
    let system = any(p);
    let (q, v) = (vec![0.6, -0.8], vec![p.pivot(0.0)[1] + 0.8 * 7.0, 0.6 * 7.0]);
    let (at, exact) = shaken(&system, &(q.clone(), v.clone()));
    for name in NAMES {
        let errors = SHAKEN_STEPS.map(|h| {
            let mut f = formulation(&system, name, Correction::Partition, 0.5);
            let samples = march(&mut *f, &q, &v, &at, &grid(2.0, h));
            samples.iter().for_each(|s| assert!(s.velocity_closure < 1e-13));
            distance(&samples, &exact)
        });
        let slope = slope(&SHAKEN_STEPS, &errors);
        assert!((slope - 4.0).abs() < 0.2, "{name}: order {slope} from {errors:?}");
        let mut f = formulation(&system, name, Correction::Partition, 0.5);
        let samples = march(&mut *f, &q, &v, &at, &reference(2.0));
        for s in &samples {
            let balance = p.energy(s) - s.work - p.energy(&samples[0]);
            assert!(balance.abs() < 1e-9, "{name}: {balance:e}");
        }
    }
}

/// Angular speed of the pendulum about its pivot, with or without its bias.
struct AboutThePivot {
    pendulum: Pendulum,
    bias: bool,
}

impl TangentMap for AboutThePivot {
    fn tangent(&self, t: f64, q: &[f64], dt: &mut [f64]) -> Result<(), SystemError> {
        dt.copy_from_slice(&[-q[1], q[0] - self.pendulum.pivot(t)[0]]);
        Ok(())
    }
    fn offset(&self, t: f64, _: &[f64], gamma: &mut [f64]) -> Result<(), SystemError> {
        gamma.copy_from_slice(&[self.pendulum.pivot(t)[1], 0.0]);
        Ok(())
    }
    fn bias(&self, t: f64, q: &[f64], v: &[f64], delta: &mut [f64]) -> Result<bool, SystemError> {
        let [p, u, a] = self.pendulum.pivot(t);
        let (x, y) = (q[0] - p, q[1]);
        let speed = (x * v[1] - y * (v[0] - u)) / (x * x + y * y);
        delta.copy_from_slice(&[-v[1] * speed + a, (v[0] - u) * speed]);
        Ok(self.bias)
    }
}

/// The four-bar along its own tangent, t_i = l_j l_k sin(φ_k − φ_j): healthy at every crank angle.
struct AlongTheBars;

impl TangentMap for AlongTheBars {
    fn tangent(&self, _: f64, q: &[f64], dt: &mut [f64]) -> Result<(), SystemError> {
        for i in 0..3 {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            dt[i] = LENGTHS[j] * LENGTHS[k] * (q[k] - q[j]).sin();
        }
        Ok(())
    }
}

/// Closed forms by the user: order 4 and the motion of the other forms, with a bias of theirs or one found by differences.
#[test]
fn tangent_velocities_of_the_user() {
    let p = SHAKEN;
    let system = any(p);
    let (q, v) = (vec![0.6, -0.8], vec![p.pivot(0.0)[1] + 0.8 * 7.0, 0.6 * 7.0]);
    let (at, exact) = shaken(&system, &(q.clone(), v.clone()));
    for bias in [true, false] {
        let tangent: Arc<dyn TangentMap> = Arc::new(AboutThePivot { pendulum: p, bias });
        for correction in [Correction::None, Correction::MassOrthogonal, Correction::Partition] {
            let options =
                FormulationOptions { correction, tangent: Some(tangent.clone()), ..FormulationOptions::default() };
            let make = || registry::by_name("user-tangent", &system, 1, &options).unwrap();
            let errors = SHAKEN_STEPS.map(|h| {
                let mut f = make();
                let samples = march(&mut *f, &q, &v, &at, &grid(2.0, h));
                let reported = f.history().notes;
                assert_eq!(reported.is_empty(), bias, "{reported:?}");
                distance(&samples, &exact)
            });
            let slope = slope(&SHAKEN_STEPS, &errors);
            assert!((slope - 4.0).abs() < 0.2, "{bias}, {correction:?}: order {slope} from {errors:?}");
            if correction == Correction::None {
                continue; // the loop opens with the drift
            }
            let samples = march(&mut *make(), &q, &v, &at, &reference(2.0));
            // differences leave 1e-14 of a velocity over 1e-2 of a move in each evaluation
            assert!(distance(&samples, &exact) < 1e-9, "{bias}: {:e}", distance(&samples, &exact));
            for s in &samples {
                assert!(s.closure < 1e-14 && s.velocity_closure < 1e-12);
                assert!((p.energy(s) - s.work - p.energy(&samples[0])).abs() < 1e-8);
            }
        }
    }
    let system = any(Angles);
    let (q, v) = Angles::start();
    let at = times(0.25, 8);
    let exact = run(&system, FormulationOptions::default(), &(q.clone(), v.clone()), &at, &reference(2.0));
    let options = FormulationOptions { tangent: Some(Arc::new(AlongTheBars)), ..FormulationOptions::default() };
    let mut f = registry::by_name("user-tangent", &system, 2, &options).unwrap();
    let samples = march(&mut *f, &q, &v, &at, &reference(2.0));
    assert!(distance(&samples, &exact) < 1e-9, "{:e}", distance(&samples, &exact));
    for (x, y) in samples.iter().zip(&exact) {
        x.multipliers.iter().zip(&y.multipliers).for_each(|(x, y)| assert!((x - y).abs() < 1e-7, "{x} {y}"));
    }
}

/// A mass on a line whose place is prescribed, sin(ω t): nothing is free to move.
struct Prescribed {
    frequency: f64,
}

impl Equations for Prescribed {
    fn n(&self) -> usize {
        1
    }
    fn rows(&self) -> usize {
        1
    }
    fn holonomic(&self) -> usize {
        1
    }
    fn name(&self, _: usize) -> String {
        "x".into()
    }
    fn rheonomic(&self) -> bool {
        self.frequency != 0.0
    }
    fn mass(&self, _: f64, _: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        out[0] = 2.0;
        Ok(())
    }
    fn forces(&self, _: f64, _: &[f64], _: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        out[0] = -3.0;
        Ok(())
    }
    fn constraints(&self, t: f64, q: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        out[0] = q[0] - (self.frequency * t).sin();
        Ok(())
    }
    fn jacobian(&self, _: f64, _: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        out[0] = 1.0;
        Ok(())
    }
    fn rate(&self, t: f64, _: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        out[0] = -self.frequency * (self.frequency * t).cos();
        Ok(())
    }
    fn bias(&self, t: f64, _: &[f64], _: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        out[0] = self.frequency * self.frequency * (self.frequency * t).sin();
        Ok(())
    }
}

/// Its tangent: none, and the velocity that is prescribed.
impl TangentMap for Prescribed {
    fn tangent(&self, _: f64, _: &[f64], _: &mut [f64]) -> Result<(), SystemError> {
        Ok(())
    }
    fn offset(&self, t: f64, _: &[f64], gamma: &mut [f64]) -> Result<(), SystemError> {
        gamma[0] = self.frequency * (self.frequency * t).cos();
        Ok(())
    }
}

/// No degree of freedom at all: the motion is the drive's, or rest, and λ holds it there.
#[test]
fn without_a_degree_of_freedom() {
    for frequency in [2.0, 0.0] {
        let system = any(Prescribed { frequency });
        let tangent: Arc<dyn TangentMap> = Arc::new(Prescribed { frequency });
        let options = FormulationOptions { tangent: Some(tangent), ..FormulationOptions::default() };
        let at = times(0.1, 10);
        for name in NAMES.into_iter().chain(["user-tangent"]) {
            let mut f = registry::by_name(name, &system, 1, &options).unwrap();
            for s in march(&mut *f, &[0.0], &[frequency], &at, &reference(1.0)) {
                let (sin, cos) = (frequency * s.t).sin_cos();
                assert!((s.q[0] - sin).abs() < 1e-13 && (s.v[0] - frequency * cos).abs() < 1e-13, "{name}");
                // M x'' = h + λ; the bias by differences is good to 1e-10
                let force = 3.0 - 2.0 * frequency * frequency * sin;
                assert!((s.multipliers[0] - force).abs() < 1e-9, "{name}: {} {force}", s.multipliers[0]);
            }
        }
    }
}

/// A pendulum whose rod is written down twice: one of the rows is dropped, the motion is the same.
#[test]
fn a_redundant_row() {
    struct Twice(Pendulum);
    impl Equations for Twice {
        fn n(&self) -> usize {
            2
        }
        fn rows(&self) -> usize {
            2
        }
        fn holonomic(&self) -> usize {
            2
        }
        fn name(&self, i: usize) -> String {
            self.0.name(i)
        }
        fn rheonomic(&self) -> bool {
            false
        }
        fn mass(&self, t: f64, q: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
            self.0.mass(t, q, out)
        }
        fn forces(&self, t: f64, q: &[f64], v: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
            self.0.forces(t, q, v, out)
        }
        fn constraints(&self, t: f64, q: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
            self.0.constraints(t, q, &mut out[..1])?;
            out[1] = -3.0 * out[0];
            Ok(())
        }
        fn jacobian(&self, t: f64, q: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
            self.0.jacobian(t, q, &mut out[..2])?;
            (out[2], out[3]) = (-3.0 * out[0], -3.0 * out[1]);
            Ok(())
        }
        fn rate(&self, _: f64, _: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
            out.fill(0.0);
            Ok(())
        }
        fn bias(&self, t: f64, q: &[f64], v: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
            self.0.bias(t, q, v, &mut out[..1])?;
            out[1] = -3.0 * out[0];
            Ok(())
        }
    }
    let once = any(Pendulum::RESTING_PIVOT);
    let twice = any(Twice(Pendulum::RESTING_PIVOT));
    let (q, v) = (vec![0.6, -0.8], vec![0.8 * 7.0, 0.6 * 7.0]);
    let at = times(0.2, 10);
    let exact = run(&once, FormulationOptions::default(), &(q.clone(), v.clone()), &at, &reference(2.0));
    let tangent: Arc<dyn TangentMap> = Arc::new(AboutThePivot { pendulum: Pendulum::RESTING_PIVOT, bias: false });
    let options = FormulationOptions { tangent: Some(tangent), ..FormulationOptions::default() };
    for name in NAMES.into_iter().chain(["user-tangent"]) {
        let mut f = registry::by_name(name, &twice, 1, &options).unwrap();
        let samples = march(&mut *f, &q, &v, &at, &reference(2.0));
        assert_eq!(f.history().rows.len(), 1);
        assert!(distance(&samples, &exact) < 1e-10, "{name}: {:e}", distance(&samples, &exact));
        for (x, y) in samples.iter().zip(&exact) {
            // one of the rows carries it all
            let load = x.multipliers[0] - 3.0 * x.multipliers[1];
            assert!((load - y.multipliers[0]).abs() < 1e-8, "{name}");
            assert!(x.closure < 1e-14);
        }
    }
}

#[test]
fn what_cannot_be_is_refused_in_words() {
    let system = any(FourBar);
    for renew in [-0.1, 1.5, f64::NAN] {
        let options = FormulationOptions { renew: renew.into(), ..FormulationOptions::default() };
        let refused = registry::by_name("svd", &system, 8, &options).err().unwrap().to_string();
        assert!(refused.contains("renew") && refused.contains("0..1"), "{refused}");
    }
    let refused = registry::by_name("user-tangent", &system, 8, &FormulationOptions::default()).err().unwrap();
    assert!(refused.to_string().contains("tangent="), "{refused}");
}
