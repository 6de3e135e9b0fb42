//! Marching constrained systems: the order survives corrections and switches, drift is that of a first integral,
//! switches carry the state over bit by bit.

use crate::pieces::{any, distance, grid, march, reference, run, slope, times, Angles, FourBar, InUnits, Pendulum};
use partita_system::equations::{Equations, UserSystem};
use partita_system::formulation::motion::Projective;
use partita_system::formulation::{
    Depth, Formulation, Layout, LinearRates, Point, Purpose, Step, StepDecision, TrialEnd,
};
use partita_system::options::FormulationOptions;
use partita_system::prelude::*;
use partita_system::record::{Correction, History, Output, PartitionEvent, Sample};
use partita_system::reduction::Reduction;
use partita_system::{start, SystemError};

const CORRECTIONS: [Correction; 4] =
    [Correction::None, Correction::MassOrthogonal, Correction::Partition, Correction::Kantorovich];
/// Steps in the range where the leading error term rules and round-off does not.
const PENDULUM_STEPS: [f64; 4] = [0.004, 0.002, 0.001, 0.0005];
/// The same for the four-bar, which is stiffer (its crank whips round once).
const FOUR_BAR_STEPS: [f64; 4] = [0.002, 0.001, 0.0005, 0.00025];

fn options(correction: Correction, switch_threshold: f64) -> FormulationOptions {
    FormulationOptions { correction, switch_threshold, ..FormulationOptions::default() }
}

/// Errors over the steps, and how often the last run switched.
fn errors<E: Equations>(
    system: &UserSystem<E>,
    start: &(Vec<f64>, Vec<f64>),
    t_end: f64,
    steps: &[f64],
    options: &FormulationOptions,
) -> (Vec<f64>, u64) {
    let at = times(0.1 * t_end, 10);
    let exact = run(system, FormulationOptions::default(), start, &at, &reference(t_end));
    let mut switches = 0;
    let errors = steps.iter().map(|&h| {
        let mut f = Projective::new(system, system.size().rows, options);
        let samples = march(&mut f, &start.0, &start.1, &at, &grid(t_end, h));
        switches = f.history().counters.switches;
        distance(&samples, &exact)
    });
    (errors.collect(), switches)
}

#[track_caller]
fn assert_order(steps: &[f64], errors: &[f64], what: &str) {
    let p = slope(steps, errors);
    assert!((p - 4.0).abs() < 0.2, "{what}: order {p} from {errors:?}");
}

/// A point that goes over the top.
fn whirling() -> (Vec<f64>, Vec<f64>) {
    (vec![0.6, -0.8], vec![0.8 * 7.0, 0.6 * 7.0])
}

#[test]
fn order_of_a_pendulum() {
    let system = any(Pendulum::RESTING_PIVOT);
    for correction in CORRECTIONS {
        // over the top x and y take turns
        let (errors, switches) = errors(&system, &whirling(), 2.0, &PENDULUM_STEPS, &options(correction, 1.25));
        assert!(switches >= 6, "{switches}");
        assert_order(&PENDULUM_STEPS, &errors, &format!("{correction:?}, {switches} switches"));
        // a swing of 0.64 rad: x alone serves
        let swing = (vec![0.6, -0.8], vec![0.0, 0.0]);
        let (errors, switches) =
            self::errors(&system, &swing, 2.0, &PENDULUM_STEPS, &options(correction, f64::INFINITY));
        assert_eq!(switches, 0);
        assert_order(&PENDULUM_STEPS, &errors, &format!("{correction:?}, x alone"));
    }
}

#[test]
fn order_of_a_four_bar() {
    let system = any(FourBar);
    for correction in CORRECTIONS {
        let (errors, switches) = errors(&system, &FourBar::start(), 2.0, &FOUR_BAR_STEPS, &options(correction, 1.25));
        assert!(switches >= 3, "{switches}");
        assert_order(&FOUR_BAR_STEPS, &errors, &format!("{correction:?}, {switches} switches"));
        let crank = FormulationOptions { independent: Some(vec![2]), ..options(correction, 1.25) };
        let (errors, switches) = self::errors(&system, &FourBar::start(), 2.0, &FOUR_BAR_STEPS, &crank);
        assert_eq!(switches, 0);
        assert_order(&FOUR_BAR_STEPS, &errors, &format!("{correction:?}, crank angle"));
    }
}

#[test]
fn rods_and_angles_move_alike() {
    let at = times(0.25, 16);
    let rods = run(&any(FourBar), FormulationOptions::default(), &FourBar::start(), &at, &reference(4.0));
    let angles = run(&any(Angles), FormulationOptions::default(), &Angles::start(), &at, &reference(4.0));
    // tolerance 2e-14, a few hundred steps, growth of errors by some hundreds in four seconds
    for (x, y) in rods.iter().zip(&angles) {
        for i in 0..3 {
            assert!((x.q[3 * i + 2] - y.q[i]).abs() < 1e-9, "{} {}", x.q[3 * i + 2], y.q[i]);
            assert!((x.v[3 * i + 2] - y.v[i]).abs() < 1e-8, "{} {}", x.v[3 * i + 2], y.v[i]);
        }
    }
    let e = FourBar::energy(&rods[0]);
    rods.iter().for_each(|s| assert!((FourBar::energy(s) - e).abs() < 1e-10 * e.abs(), "{}", FourBar::energy(s) - e));
}

/// Without correction |Φ| is the error of a first integral: it adds up linearly and has the order of the method.
#[test]
fn drift() {
    let (system, at) = (any(FourBar), times(2.0, 16));
    // single values scatter with the phase of the motion (about two seconds a turn): largest of ten seconds each
    let drift = |h: f64, windows: usize| -> Vec<f64> {
        let at = times(0.5, 20 * windows);
        let none = options(Correction::None, 1.25);
        let samples = run(&system, none, &FourBar::start(), &at, &grid(at[at.len() - 1], h));
        // velocities are computed, not integrated: they satisfy S4 to round-off all the while
        samples.iter().for_each(|s| assert!(s.velocity_closure < 1e-12, "{}", s.velocity_closure));
        samples.chunks(20).map(|s| s.iter().fold(0.0, |m: f64, s| m.max(s.closure))).collect()
    };
    let p = slope(&[10.0, 20.0, 30.0, 40.0, 50.0, 60.0], &drift(0.01, 6));
    assert!((p - 1.0).abs() < 0.15, "drift over time with exponent {p}");
    let by_step: Vec<f64> = FOUR_BAR_STEPS.iter().map(|&h| drift(2.0 * h, 1)[0]).collect();
    let p = slope(&FOUR_BAR_STEPS, &by_step);
    assert!((p - 4.0).abs() < 0.2, "drift over steps with exponent {p}: {by_step:?}");
    // with a correction nothing is left
    for correction in [Correction::Partition, Correction::Kantorovich, Correction::MassOrthogonal] {
        let samples = run(&system, options(correction, 1.25), &FourBar::start(), &at, &grid(32.0, 0.01));
        samples.iter().for_each(|s| assert!(s.closure < 1e-14, "{}", s.closure));
    }
}

/// Corrections by factors that are kept converge linearly, the faster the nearer the position of the factors is; those
/// by new factors converge quadratically.
#[test]
fn kept_factors_converge_linearly() {
    let (system, (q, _)) = (any(FourBar), FourBar::start());
    let distances = [0.02, 0.01, 0.005, 0.0025];
    // what the second correction leaves of the closure error
    let left = |distance: f64, renewed: bool| -> f64 {
        let mut r = Reduction::new(&system, system.size().rows);
        start::choose_partition(&mut r, 0.0, &q, None, None).unwrap();
        let mut there = q.clone();
        there[r.planned.partition.independent[0]] += distance;
        let mut closure_errors = Vec::new();
        for _ in 0..3 {
            r.position(0.0, &there).unwrap();
            closure_errors.push(r.gap().0);
            if renewed {
                r.factor(0.0).unwrap();
            }
            r.dependent_step();
            r.move_dependent(&mut there);
        }
        closure_errors[2] / closure_errors[1]
    };
    for (renewed, order) in [(false, 1.0), (true, 2.0)] {
        let p = slope(&distances, &distances.map(|d| left(d, renewed)));
        assert!((p - order).abs() < 0.2, "order {p}, not {order}");
    }
}

/// Corrections change the energy by no more than the integrator does.
#[test]
fn corrections_do_no_work() {
    let system = any(FourBar);
    let at = times(0.1, 100);
    let drift = CORRECTIONS.map(|c| {
        let samples = run(&system, options(c, 1.25), &FourBar::start(), &at, &grid(10.0, 0.01));
        let e = FourBar::energy(&run(&system, options(c, 1.25), &FourBar::start(), &[0.0], &grid(0.0, 0.01))[0]);
        samples.iter().fold(0.0, |m: f64, s| m.max((FourBar::energy(s) - e).abs()))
    });
    assert!(drift[1..].iter().all(|x| *x < 1.5 * drift[0]), "{drift:?}");
}

/// Forwards everything and examines every change.
struct Watched<'s, E: Equations> {
    inner: Projective<'s, UserSystem<E>>,
    /// Change to the first dependent velocity of at least this measure after every step, whatever the rule says.
    force: Option<f64>,
    changes: u64,
    steps: u64,
}

impl<'s, E: Equations> Watched<'s, E> {
    fn new(system: &'s UserSystem<E>, options: FormulationOptions, force: Option<f64>) -> Self {
        Self { inner: Projective::new(system, system.size().rows, &options), force, changes: 0, steps: 0 }
    }

    /// All velocities at y.
    fn velocities(&mut self, t: f64, y: &[f64]) -> Vec<f64> {
        let r = self.inner.reduction();
        let (nq, k) = (r.size().nq, r.k());
        r.evaluate(t, &y[..nq], &y[nq..nq + k]).unwrap();
        r.at.v.clone()
    }
}

impl<E: Equations> Formulation for Watched<'_, E> {
    fn layout(&self) -> &Layout {
        self.inner.layout()
    }
    fn start(&mut self, t: f64, q: &[f64], v: &[f64], y: &mut [f64]) -> Result<(), SystemError> {
        self.inner.start(t, q, v, y)
    }
    fn rates(&mut self, t: f64, y: &[f64], dy: &mut [f64], depth: Depth) -> Result<(), SystemError> {
        self.inner.rates(t, y, dy, depth)
    }
    fn linear_rates(&mut self, t: f64, y: &[f64], out: &mut LinearRates) -> Result<(), SystemError> {
        self.inner.linear_rates(t, y, out)
    }
    fn trial_end(&mut self, t: f64, y: &mut [f64], dy: &mut [f64], known: bool) -> Result<TrialEnd, SystemError> {
        self.steps += 1;
        let end = self.inner.trial_end(t, y, dy, known)?;
        Ok(if self.force.is_some() { TrialEnd { decision: StepDecision::Change, ..end } } else { end })
    }
    fn commit(&mut self, verdict: StepDecision, step: &mut Step) -> Result<bool, SystemError> {
        if verdict != StepDecision::Change {
            return self.inner.commit(verdict, step);
        }
        let Step { t, y, dy, turns, pace, findings } = step;
        let t = *t;
        let before = (y.to_vec(), self.velocities(t, y));
        let independent = self.inner.reduction().planned.partition.independent.clone();
        match self.force {
            None => {
                self.inner
                    .commit(verdict, &mut Step { t, y, dy, turns, pace: pace.as_deref_mut(), findings: *findings })?;
            }
            Some(least) => {
                self.inner.commit(
                    StepDecision::Keep,
                    &mut Step { t, y, dy, turns, pace: pace.as_deref_mut(), findings: *findings },
                )?;
                let r = self.inner.reduction();
                let (nq, mut vdot, mut rho) = (r.size().nq, vec![0.0; r.size().nv], vec![0.0; r.size().nv]);
                r.full_acceleration(&mut vdot);
                r.measure(t, &y[..nq], &mut rho)?;
                let Some(&next) = r.planned.partition.dependent.iter().find(|&&i| rho[i] > least) else {
                    return Ok(false);
                };
                r.set_partition(t, &[next])?;
                (y[nq], dy[nq]) = (before.1[next], vdot[next]);
            }
        }
        let now = self.inner.reduction().planned.partition.independent.clone();
        if now == independent {
            return Ok(true);
        }
        self.changes += 1;
        let nq = self.inner.reduction().size().nq;
        assert!(y[..nq].iter().zip(&before.0).all(|(x, y)| x.to_bits() == y.to_bits()), "q moved");
        for (j, &i) in now.iter().enumerate() {
            assert_eq!(y[nq + j].to_bits(), before.1[i].to_bits(), "v of {i} changed at t = {t}");
        }
        // the others follow from them by another C_D: round-off times its condition
        let after = self.velocities(t, y);
        after.iter().zip(&before.1).for_each(|(x, y)| assert!((x - y).abs() < 1e-12 * (1.0 + y.abs()), "{x} {y}"));
        Ok(true)
    }
    fn state_at(&mut self, t: f64, y: &[f64], purpose: Purpose, out: &mut Output) -> Result<(), SystemError> {
        self.inner.state_at(t, y, purpose, out)
    }
    fn describe(&mut self, at: &Output, within: Option<&PartitionEvent>, out: &mut Sample) -> Result<(), SystemError> {
        self.inner.describe(at, within, out)
    }
    fn history(&self) -> History {
        self.inner.history()
    }
    fn point(&mut self) -> &mut dyn Point {
        self.inner.point()
    }
}

/// A swing of 60 degrees, 2000 steps, other coordinates after every step in which they have a measure of at least 0.3.
#[test]
fn changing_after_every_step_costs_nothing() {
    let system = any(Pendulum::RESTING_PIVOT);
    let start = (vec![0.75f64.sqrt(), -0.5], vec![0.0, 0.0]);
    let at = times(0.5, 20);
    let exact = run(&system, FormulationOptions::default(), &start, &at, &reference(10.0));
    let still = FormulationOptions { independent: Some(vec![0]), ..FormulationOptions::default() };
    let rest = distance(&run(&system, still, &start, &at, &grid(10.0, 0.005)), &exact);
    let mut restless = Watched::new(&system, FormulationOptions::default(), Some(0.3));
    let error = distance(&march(&mut restless, &start.0, &start.1, &at, &grid(10.0, 0.005)), &exact);
    assert_eq!(restless.steps, 2000);
    assert!(restless.changes > 1000, "{}", restless.changes);
    assert!(error < 3.0 * rest, "{error:e} with {} changes, {rest:e} without", restless.changes);
    // and the order is kept
    let mut finer = Watched::new(&system, FormulationOptions::default(), Some(0.3));
    let half = distance(&march(&mut finer, &start.0, &start.1, &at, &grid(10.0, 0.0025)), &exact);
    let p = (error / half).log2();
    assert!((p - 4.0).abs() < 0.3, "order {p}");
}

#[test]
fn switching_at_every_opportunity_costs_nothing() {
    let system = any(FourBar);
    let start = FourBar::start();
    let at = times(0.5, 8);
    let exact = run(&system, FormulationOptions::default(), &start, &at, &reference(4.0));
    let error = |switch_threshold: f64, fixed: Option<Vec<usize>>| {
        let options = FormulationOptions { switch_threshold, independent: fixed, ..FormulationOptions::default() };
        let mut f = Watched::new(&system, options, None);
        let e = distance(&march(&mut f, &start.0, &start.1, &at, &grid(4.0, 0.005)), &exact);
        (e, f.changes)
    };
    let (crank, none) = error(1.25, Some(vec![2]));
    let (eager, many) = error(1.0 + 1e-6, None);
    let (usual, some) = error(1.25, None);
    assert_eq!(none, 0);
    assert!(many >= some && some > 5, "{many} {some}");
    assert!(eager < 3.0 * usual, "{eager:e} against {usual:e}");
    // the crank angle is a better coordinate for this motion than any that is the best for an instant
    assert!(eager < 5.0 * crank, "{eager:e} against {crank:e}");
}

/// Trajectories in other units are the same ones.
#[test]
fn trajectories_in_other_units() {
    let (q, v) = FourBar::start();
    let at = times(0.5, 4);
    let metres = run(&any(FourBar), FormulationOptions::default(), &(q.clone(), v.clone()), &at, &grid(2.0, 0.01));
    for (length, angle) in [(1e3, 1.0), (1.0 / 0.0254, 180.0 / std::f64::consts::PI), (1e-3, 1e3)] {
        let s: Vec<f64> = (0..9).map(|i| if i % 3 == 2 { angle } else { length }).collect();
        let to = |x: &[f64]| x.iter().zip(&s).map(|(x, s)| x * s).collect::<Vec<_>>();
        let system = any(InUnits(FourBar, s.clone()));
        let mut other = run(&system, FormulationOptions::default(), &(to(&q), to(&v)), &at, &grid(2.0, 0.01));
        for (x, y) in metres.iter().zip(&mut other) {
            assert_eq!(x.independent, y.independent);
            assert!((x.sigma - y.sigma).abs() < 1e-10 && (x.sqrt_mu - y.sqrt_mu).abs() < 1e-10);
            x.measure.iter().zip(&y.measure).for_each(|(x, y)| assert!((x - y).abs() < 1e-10));
            for i in 0..9 {
                y.q[i] /= s[i];
                y.v[i] /= s[i];
            }
        }
        // round-off of 200 steps
        assert!(distance(&metres, &other) < 1e-11, "{:e}", distance(&metres, &other));
    }
}
