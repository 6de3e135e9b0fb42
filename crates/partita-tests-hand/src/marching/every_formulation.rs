//! Every formulation of the registry, marched: the same motion, the order of the method, the drift of its invariants.

use crate::pieces::{
    any, described, distance, grid, march, reference, slope, times, Angles, FourBar, Pendulum, Plate, Redundant,
};
use partita_integrate::simulate::{simulate, Status};
use partita_system::equations::{Equations, UserSystem};
use partita_system::formulation::registry::{by_name, NAMES};
use partita_system::formulation::Formulation;
use partita_system::options::FormulationOptions;
use partita_system::record::{Correction, Output, Sample};
use partita_system::start;
use std::ops::ControlFlow;

/// Drift of the closing conditions without correction.
#[derive(Clone, Copy, PartialEq)]
enum Drift {
    /// Φ is a first integral of the equations: it is lost like t. S4 holds by itself.
    Position,
    /// Φ' is one, Φ follows it: t and t².
    Velocity,
    /// Pulled back to the order of the method.
    Stabilised,
    /// Closed at every stage.
    Never,
}

/// Name and drift, one line each.
const TABLE: &[(&str, Drift)] = &[
    ("projective", Drift::Position),
    ("multipliers", Drift::Velocity),
    ("sparse-multipliers", Drift::Velocity),
    ("range-space", Drift::Velocity),
    ("baumgarte", Drift::Stabilised),
    ("proximal", Drift::Velocity),
    ("wehage-haug", Drift::Never),
    ("explicit-closing", Drift::Never),
    ("zero-eigenvalue", Drift::Position),
    ("svd", Drift::Position),
    ("qr", Drift::Position),
    ("liang-lance", Drift::Position),
    ("gram-schmidt", Drift::Position),
    ("tangent-space", Drift::Never),
];

const CORRECTIONS: [Correction; 4] =
    [Correction::None, Correction::MassOrthogonal, Correction::Partition, Correction::Kantorovich];

fn options(name: &str, correction: Correction) -> FormulationOptions {
    // slow against the steps used here, fast against the motion
    let baumgarte = (name == "baumgarte").then_some((20.0, 20.0));
    FormulationOptions { correction, baumgarte, ..FormulationOptions::default() }
}

fn formulation<'s, E: Equations>(
    name: &str,
    system: &'s UserSystem<E>,
    start: &(Vec<f64>, Vec<f64>),
    correction: Correction,
) -> Box<dyn Formulation + Send + 's> {
    let rank = start::analyse(system, 0.0, &start.0).unwrap().rank;
    by_name(name, system, rank, &options(name, correction)).unwrap()
}

fn run<E: Equations>(
    name: &str,
    system: &UserSystem<E>,
    start: &(Vec<f64>, Vec<f64>),
    correction: Correction,
    at: &[f64],
    settings: &partita_integrate::simulate::Settings,
) -> Vec<Sample> {
    march(&mut *formulation(name, system, start, correction), &start.0, &start.1, at, settings)
}

#[test]
fn the_table_names_every_formulation() {
    let (mut named, mut all): (Vec<&str>, _) = (TABLE.iter().map(|row| row.0).collect(), NAMES.to_vec());
    // the one that needs a tangent written for the mechanism is tested with the tangent methods; the
    // fixed choice is the compact form with its switches disabled
    named.extend(["user-tangent", "fixed"]);
    named.sort_unstable();
    all.sort_unstable();
    assert_eq!(named, all);
}

/// Tight tolerances, all corrections: one motion, one energy.
#[test]
fn one_motion() {
    fn check<E: Equations>(
        what: &str,
        system: &UserSystem<E>,
        start: &(Vec<f64>, Vec<f64>),
        energy: &dyn Fn(&Sample) -> f64,
        t_end: f64,
        within: f64,
    ) {
        let at = times(0.2 * t_end, 5);
        let exact = run("projective", system, start, Correction::Partition, &at, &reference(at[4]));
        for &(name, drift) in TABLE {
            for correction in CORRECTIONS {
                let mut f = formulation(name, system, start, correction);
                let samples = march(&mut *f, &start.0, &start.1, &at, &reference(at[4]));
                let off = distance(&samples, &exact);
                assert!(off < within, "{what}, {name}, {correction:?}: {off:e}");
                // what went in as work is all that changes it; forces of some tens of newtons times the error in q and
                // v
                let balance = |s: &Sample| energy(s) - s.work;
                let lost = samples.iter().fold(0.0, |m: f64, s| m.max((balance(s) - balance(&exact[0])).abs()));
                assert!(lost < 100.0 * within, "{what}, {name}, {correction:?}: energy off by {lost:e} J");
                let closure_error = samples.iter().fold(0.0, |m: f64, s| m.max(s.closure).max(s.velocity_closure));
                if correction != Correction::None && drift != Drift::Stabilised || drift == Drift::Never {
                    assert!(closure_error < 1e-12, "{what}, {name}, {correction:?}: open by {closure_error:e}");
                } else {
                    // what is not corrected is reported
                    let reported = f.history().notes.iter().any(|n| n.contains("not exactly closed"));
                    assert!(reported || drift == Drift::Position, "{what}, {name}: {:?}", f.history().notes);
                }
                let forces = |x: &Sample, y: &Sample| {
                    let off = x.multipliers.iter().zip(&y.multipliers).map(|(x, y)| (x - y).abs());
                    off.fold(0.0, f64::max)
                };
                if system.equations.rows() == exact[0].q.len() - exact[0].independent.len() {
                    samples
                        .iter()
                        .zip(&exact)
                        .for_each(|(x, y)| assert!(forces(x, y) < 1e3 * within, "{what}, {name}"));
                }
            }
        }
    }
    // tolerance 2e-14, some hundred steps, growth of errors by some hundreds
    let swing = (vec![0.6, -0.8], vec![0.0, 0.0]);
    check("pendulum", &any(Pendulum::RESTING_PIVOT), &swing, &|s| Pendulum::RESTING_PIVOT.energy(s), 3.0, 1e-10);
    let shaken = Pendulum { amplitude: 0.1, frequency: 3.0, mass: 2.0 };
    check(
        "shaken pendulum",
        &any(shaken),
        &(vec![0.3, -0.91f64.sqrt()], vec![0.3, 0.0]),
        &|s| shaken.energy(s),
        2.0,
        1e-10,
    );
    check("plate", &any(Plate), &Plate::start(), &Plate::energy, 3.0, 1e-10);
    check("four-bar of rods", &any(FourBar), &FourBar::start(), &FourBar::energy, 2.0, 1e-9);
    check("four-bar in angles", &any(Angles), &Angles::start(), &Angles::energy, 2.0, 1e-9);
    check("redundant four-bar", &any(Redundant(FourBar)), &FourBar::start(), &FourBar::energy, 1.0, 1e-9);
}

/// Order 4 of the classical Runge-Kutta method, whatever is corrected.
#[test]
fn order() {
    // steps in the range where the leading error term rules and round-off does not: the crank whips round once
    const STEPS: [f64; 4] = [0.002, 0.001, 0.0005, 0.00025];
    let (system, start) = (any(Angles), Angles::start());
    let at = times(0.2, 10);
    let exact = run("projective", &system, &start, Correction::Partition, &at, &reference(at[9]));
    for &(name, drift) in TABLE {
        for correction in CORRECTIONS {
            if correction != Correction::None && matches!(drift, Drift::Never | Drift::Stabilised) {
                continue; // there is nothing to correct, or it is not done
            }
            let errors = STEPS.map(|h| distance(&run(name, &system, &start, correction, &at, &grid(at[9], h)), &exact));
            let p = slope(&STEPS, &errors);
            assert!((p - 4.0).abs() < 0.2, "{name}, {correction:?}: order {p} from {errors:?}");
        }
    }
}

/// Without corrections: by which power of time the constraints are lost, and that the step decides how fast.
#[test]
fn drift() {
    let (system, start) = (any(FourBar), FourBar::start());
    // the motion repeats itself about every two seconds: the largest of ten seconds each, some revolutions
    let windows = [10.0, 20.0, 30.0, 40.0, 50.0, 60.0];
    let lost = |name: &str, h: f64| -> (Vec<f64>, Vec<f64>) {
        let at = times(0.25, 240);
        let samples = run(name, &system, &start, Correction::None, &at, &grid(60.0, h));
        let largest =
            |f: &dyn Fn(&Sample) -> f64| samples.chunks(40).map(|s| s.iter().map(f).fold(0.0, f64::max)).collect();
        (largest(&|s| s.closure), largest(&|s| s.velocity_closure))
    };
    for &(name, drift) in TABLE {
        let (phi, rate) = lost(name, 0.01);
        let (p, u) = (slope(&windows, &phi), slope(&windows, &rate));
        match drift {
            Drift::Position => {
                assert!((p - 1.0).abs() < 0.2, "{name}: t^{p} from {phi:?}");
                assert!(rate.iter().all(|x| *x < 1e-12), "{name}: {rate:?}");
            }
            Drift::Velocity => {
                assert!((p - 2.0).abs() < 0.2, "{name}: t^{p} from {phi:?}");
                assert!((u - 1.0).abs() < 0.2, "{name}: t^{u} from {rate:?}");
            }
            Drift::Stabilised => {
                // no growth at all, but of the size of the error of a step, nothing like round-off
                assert!(p.abs() < 0.2 && phi.iter().all(|x| *x > 1e-9 && *x < 1e-5), "{name}: t^{p} from {phi:?}");
            }
            Drift::Never => {
                let largest = phi.iter().chain(&rate).fold(0.0, |m: f64, x| m.max(*x));
                assert!(largest < 1e-12, "{name}: {phi:?} {rate:?}");
            }
        }
    }
}

/// At a dead point of inputs that stay, a form with 2k states can pass or be thrown back, both within any tolerance.
/// What it tells is true all the same: it goes on as the mechanism does, or it stops and says so.
#[test]
fn nothing_is_thrown_back_at_a_dead_point() {
    let system = any(Pendulum::RESTING_PIVOT);
    // x = 1 is reached after 0.144 s
    let (q, v) = (vec![0.6, -0.8], vec![0.8 * 7.0, 0.6 * 7.0]);
    let at = times(0.02, 50);
    let exact = run("projective", &system, &(q.clone(), v.clone()), Correction::Partition, &at, &reference(at[49]));
    for rtol in [1e-3, 1e-5, 1e-8, 1e-12] {
        for name in ["wehage-haug", "explicit-closing"] {
            let options = FormulationOptions { independent: Some(vec![0]), ..FormulationOptions::default() };
            let mut f = by_name(name, &system, 1, &options).unwrap();
            let mut settings = reference(at[49]);
            (settings.options.rtol, settings.options.atol) = (rtol, rtol.into());
            let mut outputs = Vec::new();
            let mut sink = |s: &Output| {
                outputs.push(s.clone());
                Ok(())
            };
            let go_on = &mut |_| ControlFlow::Continue(());
            let outcome = simulate(&mut *f, 0.0, &q, &v, &at, &settings, &mut sink, go_on).unwrap();
            let samples = described(&mut *f, &outputs);
            // errors of the steps next to the dead point grow by its gain there
            let off = distance(&samples, &exact); // as far as it came
            assert!(off < 100.0 * rtol.max(1e-6), "{name} at {rtol:e}: {off:e}");
            assert!(samples.len() >= 6, "{name} at {rtol:e}: {}", outcome.message);
            // the closing keeps its branch: there is no way on for it
            assert!(name == "wehage-haug" || outcome.status != Status::Finished && outcome.t < 0.15, "{}", outcome.t);
            let reported = outcome.status == Status::Finished
                || ["cannot close", "are at a dead point"].iter().any(|words| outcome.message.contains(words));
            assert!(reported, "{name} at {rtol:e}: {}", outcome.message);
        }
    }
    // free to choose, the classical form goes over the top like all others
    let at = times(0.2, 10);
    let exact = run("projective", &system, &(q.clone(), v.clone()), Correction::Partition, &at, &reference(at[9]));
    let mut f = formulation("wehage-haug", &system, &(q.clone(), v.clone()), Correction::Partition);
    let off = distance(&march(&mut *f, &q, &v, &at, &reference(at[9])), &exact);
    assert!(off < 1e-9 && f.history().counters.switches >= 6, "{off:e}");
}
