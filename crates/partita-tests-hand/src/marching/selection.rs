//! Rules of choice during a run: the motion does not depend on them, how often and how well they choose does.

use crate::pieces::{any, distance, march, reference, run, times, Angles, FourBar, InUnits, LENGTHS};
use partita_integrate::options::Options;
use partita_integrate::simulate::{simulate, Settings, Status};
use partita_integrate::tableau::DOP853;
use partita_system::equations::Equations;
use partita_system::formulation::motion::Projective;
use partita_system::formulation::Formulation;
use partita_system::options::FormulationOptions;
use partita_system::partition::{determinant, Selection};
use partita_system::prelude::*;
use partita_system::reduction::Reduction;
use partita_system::{start, SystemError};
use std::f64::consts::TAU;
use std::ops::ControlFlow;

/// The rods with the crank at `f`, turning with `w`.
fn pose(f: f64, w: f64) -> (Vec<f64>, Vec<f64>) {
    let [a, b] = Angles::close(f);
    let angles = [f, a, b];
    let rates = Angles::rates(angles, w);
    let (mut q, mut v, mut p, mut u) = (vec![], vec![], [0.0; 2], [0.0; 2]);
    for i in 0..3 {
        let ((s, c), half) = (angles[i].sin_cos(), 0.5 * LENGTHS[i]);
        q.extend([p[0] + half * c, p[1] + half * s, angles[i]]);
        v.extend([u[0] - half * s * rates[i], u[1] + half * c * rates[i], rates[i]]);
        p = [p[0] + LENGTHS[i] * c, p[1] + LENGTHS[i] * s];
        u = [u[0] - LENGTHS[i] * s * rates[i], u[1] + LENGTHS[i] * c * rates[i]];
    }
    (q, v)
}

fn by(selection: Selection) -> FormulationOptions {
    let window = (selection == Selection::Persistence).then_some(1.0);
    FormulationOptions { selection, window, ..FormulationOptions::default() }
}

#[test]
fn the_motion_does_not_depend_on_the_rule() {
    let (system, at) = (any(FourBar), times(0.25, 16));
    // fast enough to go round
    let start = pose(0.8, 10.0);
    let exact = run(&system, FormulationOptions::default(), &start, &at, &reference(4.0));
    for selection in Selection::ALL {
        let options = Options { rtol: 1e-10, atol: 1e-12.into(), ..Options::default() };
        let settings = Settings { t_end: 4.0, method: &DOP853, options, max_steps: 100_000 };
        let mut f = Projective::new(&system, 8, &by(selection));
        let samples = march(&mut f, &start.0, &start.1, &at, &settings);
        let error = distance(&samples, &exact);
        // some ten turns multiply what the tolerance leaves
        assert!(error < 1e-6, "{}: {error:e}", selection.name());
        assert!(samples.iter().all(|s| s.closure < 1e-13));
        for e in f.history().events {
            assert_eq!((e.independent.len(), e.dependent.len()), (1, 8));
        }
        let switches: usize = f.history().events.iter().skip(1).map(|e| e.entering.len()).sum();
        assert_eq!(switches as u64, f.history().counters.switches);
        if let Some(e) = f.history().events.get(1) {
            assert!(e.reason.contains("the place of") && e.quality.sigma > 0.0, "{}", e.reason);
        }
    }
}

#[test]
fn a_threshold_without_end_keeps_the_first_choice() {
    let (system, at) = (any(Angles), times(0.1, 10));
    let q: Vec<f64> = pose(0.8, 0.0).0.iter().skip(2).step_by(3).copied().collect();
    let v = Angles::rates([q[0], q[1], q[2]], 10.0).to_vec();
    for selection in Selection::ALL {
        let mut f =
            Projective::new(&system, 2, &FormulationOptions { switch_threshold: f64::INFINITY, ..by(selection) });
        march(&mut f, &q, &v, &at, &crate::pieces::grid(1.0, 0.002));
        assert_eq!((f.history().counters.switches, f.history().events.len()), (0, 1), "{}", selection.name());
    }
}

/// The places of the mass centres and the angles by |det C_D|, largest first.
fn raw_ranking(length: f64, angle: f64) -> Vec<String> {
    let s: Vec<f64> = (0..9).map(|i| if i % 3 == 2 { angle } else { length }).collect();
    let system = any(InUnits(FourBar, s.clone()));
    let q: Vec<f64> = pose(0.8, 0.0).0.iter().zip(&s).map(|(q, s)| q * s).collect();
    let mut r = Reduction::new(&system, 8);
    start::choose_partition(&mut r, 0.0, &q, None, None).unwrap();
    r.evaluate(0.0, &q, &[0.0]).unwrap();
    let score = |i: usize| determinant::ratio(&r.at.dt, &r.planned.partition.independent, r.scales(), &[i]);
    let mut order: Vec<usize> = (0..9).collect();
    order.sort_by(|&a, &b| score(b).total_cmp(&score(a)));
    // what the rule takes is the first of them
    let best = determinant::choose(&r.at.dt, &r.planned.partition.independent, r.scales());
    assert_eq!(best.independent, [order[0]]);
    order.iter().map(|&i| system.structure().velocity_name(i)).collect()
}

#[test]
fn millimetres_and_degrees_turn_the_determinant_over() {
    assert_eq!(raw_ranking(1.0, 1.0)[..2], ["angle1", "x2"]);
    assert_eq!(raw_ranking(1e3, 1.0)[..2], ["x2", "y2"]);
    assert_eq!(raw_ranking(1.0, 360.0 / TAU)[..3], ["angle1", "angle3", "angle2"]);
}

/// Switches over one turn of the crank in small steps, and the least measure met.
fn one_turn(equations: impl Equations + 'static, at: impl Fn(f64) -> Vec<f64>, threshold: f64) -> (usize, f64) {
    let system = any(equations);
    let n = system.size().nv;
    let mut r = Reduction::new(&system, n - 1);
    start::choose_partition(&mut r, 0.0, &at(0.0), None, None).unwrap();
    let (mut switches, mut least, mut rho) = (0, 1.0f64, vec![0.0; n]);
    for i in 0..2000 {
        let q = at(TAU * f64::from(i) / 2000.0);
        r.position(0.0, &q).unwrap();
        r.refresh_scales(0.0, &q).unwrap();
        r.evaluate(0.0, &q, &[0.0]).unwrap();
        let x = r.best_switch().unwrap();
        if x.gain > threshold {
            let enters = r.planned.partition.dependent[x.enters];
            r.set_partition(0.0, &[enters]).unwrap();
            r.evaluate(0.0, &q, &[0.0]).unwrap();
            switches += 1;
        }
        r.measure(0.0, &q, &mut rho).unwrap();
        least = least.min(rho[r.planned.partition.independent[0]]);
    }
    (switches, least)
}

/// Hysteresis: fewer switches for a higher threshold, at the price of quality.
#[test]
fn switches_over_one_turn() {
    let rods = |f: f64| pose(f, 0.0).0;
    for (threshold, count, least) in [(1.2, 5, 0.43), (1.5, 5, 0.36), (2.0, 4, 0.28), (3.0, 4, 0.19)] {
        let (switches, rho) = one_turn(FourBar, rods, threshold);
        assert_eq!(switches, count, "threshold {threshold}");
        // two digits known, one step of the turn
        assert!((rho - least).abs() < 0.01, "threshold {threshold}: {rho}");
        // (32) with σ_min(B) = 1, k = 1, m = 8
        assert!(rho > 1.0 / (1.0 + 8.0 * threshold * threshold).sqrt());
    }
    for threshold in [1.5, 2.0, 3.0] {
        let angles = |f: f64| {
            let [a, b] = Angles::close(f);
            vec![f, a - f, b - a]
        };
        let (switches, rho) = one_turn(Joints, angles, threshold);
        assert!(switches == 0 && (rho - 0.73).abs() < 0.005, "threshold {threshold}: {switches}, {rho}");
    }
}

/// The four-bar in relative angles: φ = T q with T a triangle of ones.
struct Joints;

impl Joints {
    fn sums(q: &[f64]) -> Vec<f64> {
        vec![q[0], q[0] + q[1], q[0] + q[1] + q[2]]
    }
}

impl Equations for Joints {
    fn n(&self) -> usize {
        3
    }
    fn rows(&self) -> usize {
        2
    }
    fn holonomic(&self) -> usize {
        2
    }
    fn name(&self, i: usize) -> String {
        format!("joint{}", i + 1)
    }
    fn rheonomic(&self) -> bool {
        false
    }
    fn mass(&self, t: f64, q: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        let mut m = [0.0; 9];
        Angles.mass(t, &Self::sums(q), &mut m)?;
        // Tᵀ M T: sums over everything further out
        for e in 0..9 {
            out[e] = (e / 3..3).flat_map(|i| (e % 3..3).map(move |j| 3 * i + j)).map(|e| m[e]).sum();
        }
        Ok(())
    }
    fn forces(&self, _: f64, _: &[f64], _: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        out.fill(0.0);
        Ok(())
    }
    fn constraints(&self, t: f64, q: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        Angles.constraints(t, &Self::sums(q), out)
    }
    fn jacobian(&self, t: f64, q: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        let mut c = [0.0; 6];
        Angles.jacobian(t, &Self::sums(q), &mut c)?;
        (0..6).for_each(|e| out[e] = c[e..3 * (e / 3) + 3].iter().sum());
        Ok(())
    }
    fn rate(&self, _: f64, _: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        out.fill(0.0);
        Ok(())
    }
    fn bias(&self, _: f64, _: &[f64], _: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        out.fill(0.0);
        Ok(())
    }
}

/// Persistence finds the crank angle among nine coordinates, of which every other one passes zero, and keeps it.
#[test]
fn persistence_finds_the_crank() {
    let system = any(FourBar);
    let (q, v) = pose(0.8, 10.0);
    // crossing of zero is seen whatever the steps
    for h in [0.002, 0.01] {
        let at = times(0.5, 20);
        let mut f = Projective::new(&system, 8, &by(Selection::Persistence));
        let samples = march(&mut f, &q, &v, &at, &crate::pieces::grid(10.0, h));
        let turns = (samples[19].q[2] - q[2]).abs() / TAU;
        assert!(turns > 10.0, "{turns}");
        let events = f.history().events;
        let last = events.last().unwrap();
        assert_eq!(last.independent, [2], "{f:?}", f = last);
        // the window of one second fills once; the crank may still have to wait till it is not much the worse
        assert!(last.t < 2.5, "{}", last.t);
        assert!(last.reason.starts_with("angle1 takes the place of"), "{}", last.reason);
        // the collective rule goes on switching
        let mut collective = Projective::new(&system, 8, &FormulationOptions::default());
        march(&mut collective, &q, &v, &at, &crate::pieces::grid(10.0, h));
        let later = collective.history().events.iter().filter(|e| e.t > last.t).count();
        assert!(later > 30, "{later}");
    }
}

/// What does not belong together is refused before the run.
#[test]
fn contradictions_are_refused() {
    let system = any(FourBar);
    let (q, v) = FourBar::start();
    let refusal = |options: FormulationOptions| {
        let mut f = Projective::new(&system, 8, &options);
        f.start(0.0, &q, &v, &mut vec![0.0; f.layout().dim()]).unwrap_err().to_string()
    };
    let d = FormulationOptions::default;
    assert!(refusal(FormulationOptions { selection: Selection::Persistence, ..d() }).contains("window"));
    assert!(refusal(FormulationOptions { window: Some(1.0), ..d() }).contains("persistence"));
    let weights = Some(vec![1.0; 9]);
    assert!(refusal(FormulationOptions { selection: Selection::Determinant, weights, ..d() }).contains("weights"));
    let fixed = Some(vec![2]);
    assert!(
        refusal(FormulationOptions { selection: Selection::Greedy, independent: fixed, ..d() }).contains("both given")
    );
}

/// A point on a circle beside three carts coupled rigidly, without forces.
struct PointAndCarts;

impl Equations for PointAndCarts {
    fn n(&self) -> usize {
        5
    }
    fn rows(&self) -> usize {
        3
    }
    fn holonomic(&self) -> usize {
        3
    }
    fn name(&self, i: usize) -> String {
        ["x", "y", "cart1", "cart2", "cart3"][i].into()
    }
    fn rheonomic(&self) -> bool {
        false
    }
    fn mass(&self, _: f64, _: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        (0..25).for_each(|e| out[e] = f64::from(u8::from(e % 6 == 0)));
        Ok(())
    }
    fn forces(&self, _: f64, _: &[f64], _: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        out.fill(0.0);
        Ok(())
    }
    fn constraints(&self, _: f64, q: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        out.copy_from_slice(&[0.5 * (q[0] * q[0] + q[1] * q[1] - 1.0), q[2] - q[3], q[3] - q[4]]);
        Ok(())
    }
    fn jacobian(&self, _: f64, q: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        out.copy_from_slice(&[q[0], q[1], 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0, -1.0]);
        Ok(())
    }
    fn rate(&self, _: f64, _: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        out.fill(0.0);
        Ok(())
    }
    fn bias(&self, _: f64, _: &[f64], v: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        out.copy_from_slice(&[v[0] * v[0] + v[1] * v[1], 0.0, 0.0]);
        Ok(())
    }
}

/// One by one: near 45 degrees both coordinates of the point lead, the carts are left without one, and the run ends saying
/// so. The rules that look at the choice as a whole, persistence with its two coordinates among them, pass.
#[test]
fn an_impossible_choice_ends_the_run_by_name() {
    let system = any(PointAndCarts);
    // ρ = (0.95, 0.3, 0.58, 0.58, 0.58), going round with 1 rad/s
    let (q, v) = ([0.3, -0.91f64.sqrt(), 0.0, 0.0, 0.0], [0.91f64.sqrt(), 0.3, 0.5, 0.5, 0.5]);
    for selection in Selection::ALL {
        let mut f = Projective::new(&system, 3, &by(selection));
        let mut keep = |_: &partita_system::record::Output| Ok(());
        let settings = crate::pieces::grid(20.0, 0.01);
        let outcome =
            simulate(&mut f, 0.0, &q, &v, &[20.0], &settings, &mut keep, &mut |_| ControlFlow::Continue(())).unwrap();
        if selection == Selection::Individual {
            assert_eq!(outcome.status, Status::Singular);
            assert!(outcome.message.contains("selection \"individual\" chooses x, y"), "{}", outcome.message);
            assert!(outcome.t < 1.5 && matches!(outcome.error, Some(SystemError::Choice { .. })));
            continue;
        }
        assert_eq!(outcome.status, Status::Finished, "{}: {}", selection.name(), outcome.message);
        // one coordinate for each of the two motions, at any time
        for e in f.history().events {
            assert_eq!(e.independent.iter().filter(|&&i| i < 2).count(), 1, "{}: {e:?}", selection.name());
        }
        assert!(f.history().events.len() > 5, "{}", selection.name());
    }
}
