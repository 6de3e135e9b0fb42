//! Constraints that move with time: order, and the power that the drive puts in.

use crate::pieces::{any, distance, grid, march, reference, run, slope, times, Any, Pendulum};
use partita_integrate::simulate::Settings;
use partita_system::equations::UserSystem;
use partita_system::formulation::motion::Projective;
use partita_system::formulation::registry::by_name;
use partita_system::formulation::Formulation;
use partita_system::options::FormulationOptions;
use partita_system::record::{Correction, Sample};

const STEPS: [f64; 4] = [0.004, 0.002, 0.001, 0.0005];

/// Pivot shaken by 0.3 m at 3 rad/s; the rod goes over the top.
const SHAKEN: Pendulum = Pendulum { amplitude: 0.3, frequency: 3.0, mass: 2.0 };

fn shaken() -> (UserSystem<Any>, (Vec<f64>, Vec<f64>)) {
    let u = SHAKEN.pivot(0.0)[1];
    (any(SHAKEN), (vec![0.6, -0.8], vec![u + 0.8 * 7.0, 0.6 * 7.0]))
}

#[test]
fn order_with_a_moving_pivot() {
    let (system, start) = shaken();
    let at = times(0.2, 10);
    let exact = run(&system, FormulationOptions::default(), &start, &at, &reference(2.0));
    for correction in [Correction::None, Correction::MassOrthogonal, Correction::Partition] {
        let options = FormulationOptions { correction, ..FormulationOptions::default() };
        let errors = STEPS.map(|h| {
            let mut f = Projective::new(&system, 1, &options);
            let samples = march(&mut f, &start.0, &start.1, &at, &grid(2.0, h));
            assert!(f.history().counters.switches >= 4);
            samples.iter().for_each(|s| assert!(s.velocity_closure < 1e-13));
            distance(&samples, &exact)
        });
        let p = slope(&STEPS, &errors);
        assert!((p - 4.0).abs() < 0.2, "{correction:?}: order {p} from {errors:?}");
    }
}

/// Energy of the point minus the work of the constraint.
fn balance(samples: &[Sample]) -> Vec<f64> {
    samples.iter().map(|s| SHAKEN.energy(s) - s.work).collect()
}

/// dE/dt + λ a = 0, by integrating the power along and by looking at it alone.
#[test]
fn power_balance() {
    let (system, (q, v)) = shaken();
    let at: Vec<f64> = (0..=40).map(|i| 0.05 * f64::from(i)).collect();
    let check = |samples: &[Sample], tolerance: f64| {
        let sums = balance(samples);
        let moved = samples.iter().fold(0.0, |m: f64, s| m.max(s.work.abs()));
        assert!(moved > 10.0, "the drive does no work worth measuring: {moved} J");
        sums.iter().for_each(|x| assert!((x - sums[0]).abs() < tolerance * moved, "{}", x - sums[0]));
    };
    // 2e-14 a step, some hundred steps, energies of some tens of joules
    let mut projective = Projective::new(&system, 1, &FormulationOptions::default());
    let samples = march(&mut projective, &q, &v, &at, &reference(2.0));
    check(&samples, 1e-11);
    let mut multipliers = by_name("multipliers", &system, 1, &least_moves()).unwrap();
    check(&march(&mut *multipliers, &q, &v, &at, &reference(2.0)), 1e-11);
    // at one instant: E' by differences of the exact motion against −λ a
    let h = 1e-3;
    let close = |t: f64| -> Vec<Sample> {
        let times = [t - 2.0 * h, t - h, t, t + h, t + 2.0 * h];
        run(&system, FormulationOptions::default(), &(q.clone(), v.clone()), &times, &reference(t + 3.0 * h))
    };
    for t in [0.4, 0.9, 1.7] {
        let s = close(t);
        let e: Vec<f64> = s.iter().map(|s| SHAKEN.energy(s)).collect();
        let rate = (8.0 * (e[3] - e[1]) - (e[4] - e[0])) / (12.0 * h);
        let [p, u, _] = SHAKEN.pivot(t);
        let power = s[2].multipliers[0] * (s[2].q[0] - p) * u;
        // error of the difference: h⁴ times the fifth derivative (a few 1e4), 1e-15 E / h of round-off
        assert!((rate - power).abs() < 1e-6 * (1.0 + power.abs()), "{rate} against {power}");
    }
}

/// The pivot moves at constant speed: seen from it, nothing is driven at all.
#[test]
fn a_uniformly_moving_pivot_is_a_resting_one() {
    // amplitude · ω = 1 m/s with ω so slow that sin(ω t) = ω t to 1e-13 over the run (relative (ω t)²/6)
    let (w, t_end) = (2e-7, 2.0);
    let pendulum = Pendulum { amplitude: 1.0 / w, frequency: w, mass: 2.0 };
    let moving = any(pendulum);
    let resting = any(Pendulum::RESTING_PIVOT);
    let at = times(0.25, 8);
    let settings: Settings = reference(t_end);
    let (q, v) = (vec![0.6, -0.8], vec![0.8 * 3.0, 0.6 * 3.0]);
    let moved = vec![v[0] + 1.0, v[1]];
    let x = run(&moving, FormulationOptions::default(), &(q.clone(), moved), &at, &settings);
    let y = run(&resting, FormulationOptions::default(), &(q, v), &at, &settings);
    for (x, y) in x.iter().zip(&y) {
        let [p, u, _] = pendulum.pivot(x.t);
        assert!((x.q[0] - p - y.q[0]).abs() < 1e-9 && (x.q[1] - y.q[1]).abs() < 1e-9);
        assert!((x.v[0] - u - y.v[0]).abs() < 1e-8 && (x.v[1] - y.v[1]).abs() < 1e-8);
        assert!((x.multipliers[0] - y.multipliers[0]).abs() < 1e-7);
        // the measure and the choice do not depend on a
        assert!((x.sigma - y.sigma).abs() < 1e-8);
    }
}

fn least_moves() -> FormulationOptions {
    FormulationOptions { correction: Correction::MassOrthogonal, ..FormulationOptions::default() }
}
