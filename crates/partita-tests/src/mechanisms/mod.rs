//! Mechanisms drawn by chance, compiled, and states in which they stand and move.
#![allow(dead_code, unused_imports, reason = "each test file uses the part it needs")]

mod drawn;

pub use drawn::{
    between, body, couple, drawing, empty, in_space, joint, loads, point, rotation, Wishes, COUPLINGS, ROLLS,
};

use partita_math::scalar::Recorder;
use partita_model::observe::BodyState;
use partita_model::spec::{Force, Spec};
use partita_model::value::{Functions, NoFunctions, RELATION};
use partita_model::zero_position::Coordinates;
use partita_model::Model;
use partita_system::kinematics::assembly;
use partita_system::prelude::*;
use partita_system::reduction::Reduction;
use partita_system::{start, ConstrainedSystem};
use std::sync::Arc;

type Failed = Box<dyn std::error::Error + Send + Sync>;

/// Smooth functions of time alone: they mean the same in any coordinates.
pub struct OfTime;

impl Functions for OfTime {
    fn count(&self) -> usize {
        3
    }
    fn scalar(&self, i: usize, t: f64, _: &[f64], _: &[f64]) -> Result<f64, Failed> {
        Ok(2.0 * (1.3 * t + i as f64).sin())
    }
    fn vector(&self, i: usize, t: f64, _: &[f64], _: &[f64]) -> Result<[f64; 3], Failed> {
        Ok([3.0 * (2.0 * t).cos(), 1.0 + i as f64, t * t - 2.0])
    }
    fn motion(&self, _: usize, t: f64) -> Result<[f64; 3], Failed> {
        let (s, c) = (1.7 * t).sin_cos();
        Ok([0.3 * s + 0.2 * t, 0.51 * c + 0.2, -0.867 * s])
    }
    fn law(&self, i: usize, t: f64, seen: &[f64], out: &mut [f64]) -> Result<(), Failed> {
        law(i, t, seen, out);
        Ok(())
    }
    fn relation(&self, _: usize, t: f64, x: &[f64], rates: &[f64]) -> Result<[f64; RELATION], Failed> {
        Ok(relation(t, x, rates))
    }
}

/// `x_0 + 0.4 x_1 + 0.2 sin(x_0 − x_1) − 0.1 sin t` with its derivatives, as couplings ask for them.
pub fn relation(t: f64, x: &[f64], rates: &[f64]) -> [f64; RELATION] {
    let (apart, rate) = (x[0] - x[1], rates[0] - rates[1]);
    let mut found = [0.0; RELATION];
    found[0] = x[0] + 0.4 * x[1] + 0.2 * apart.sin() - 0.1 * t.sin();
    found[1] = -0.1 * t.cos();
    found[2] = -0.2 * apart.sin() * rate * rate + 0.1 * t.sin();
    (found[3], found[4]) = (1.0 + 0.2 * apart.cos(), 0.4 - 0.2 * apart.cos());
    found
}

/// A smooth function of all that a law sees.
pub fn law(i: usize, t: f64, seen: &[f64], out: &mut [f64]) {
    for (k, out) in out.iter_mut().enumerate() {
        let sum: f64 = seen.iter().enumerate().map(|(j, x)| x * (0.7 * (j + k) as f64 + 1.0).sin()).sum();
        *out = (t + i as f64 + 0.3 * sum).sin();
    }
}

pub fn compile(spec: &Spec, coordinates: Coordinates) -> Option<Model> {
    Model::new(spec.clone(), Arc::new(OfTime), coordinates).ok()
}

/// A state with everything that follows from it.
#[derive(Clone, Debug)]
pub struct Moment {
    pub t: f64,
    pub q: Vec<f64>,
    pub v: Vec<f64>,
    pub vdot: Vec<f64>,
    pub lambda: Vec<f64>,
    pub rank: usize,
}

/// Weakest accepted constraints and partitions: what is computed through them loses three digits at the most.
const WELL_POSED: f64 = 1e-3;

impl Moment {
    /// Accelerations and multipliers of a state; none where the constraints or all partitions are weak.
    pub fn at(model: &Model, t: f64, q: Vec<f64>, v: Vec<f64>) -> Option<Self> {
        let found = start::analyse(model, t, &q).ok()?;
        if !found.dropped.is_empty() && !model.out_of_plane.is_empty() || found.smallest < WELL_POSED {
            return None;
        }
        let mut r = Reduction::new(model, found.rank);
        start::choose_partition(&mut r, t, &q, None, None).ok()?;
        let speeds: Vec<f64> = r.planned.partition.independent.iter().map(|&i| v[i]).collect();
        r.evaluate(t, &q, &speeds).ok()?;
        if r.quality(t, &q).ok()?.sqrt_mu < WELL_POSED {
            return None;
        }
        let mut moment =
            Self { t, q, v: r.at.v.clone(), vdot: v, lambda: vec![0.0; model.size().rows], rank: found.rank };
        r.full_acceleration(&mut moment.vdot);
        r.multipliers(t, &moment.q, &moment.vdot, &mut moment.lambda).ok()?;
        Some(moment)
    }

    /// Somewhere away from the drawing, moving.
    pub fn random(rng: &mut fastrand::Rng, model: &Model) -> Option<Self> {
        let t = between(rng, 0.1, 0.5);
        let mut q = model.initial();
        assembly::close(model, t, &mut q, 1e-9, &[]).ok()?;
        let rank = start::analyse(model, t, &q).ok().filter(|s| s.dropped.is_empty() || model.is_planar())?.rank;
        let mut r = Reduction::new(model, rank);
        if r.k() == 0 {
            return None;
        }
        for _ in 0..3 {
            start::choose_partition(&mut r, t, &q, None, None).ok()?;
            r.at.gamma.fill(0.0);
            let move_by: Vec<f64> = (0..r.k()).map(|_| between(rng, -0.3, 0.3)).collect();
            r.spread(&move_by);
            if r.at.v.iter().any(|x| x.abs() > 1.0) {
                return None;
            }
            model.step(&mut q, &r.at.v.clone());
            model.normalise(&mut q);
            assembly::close(model, t, &mut q, 1e-9, &[]).ok()?;
        }
        start::choose_partition(&mut r, t, &q, None, None).ok()?;
        let speeds: Vec<f64> = (0..r.k()).map(|_| between(rng, -1.0, 1.0)).collect();
        r.evaluate(t, &q, &speeds).ok()?;
        let v = r.at.v.clone();
        Self::at(model, t, q, v)
    }
}

/// Run `check` on `count` mechanisms with a state each.
pub fn on_random_mechanisms(
    seed: u64,
    count: usize,
    wishes: Wishes,
    check: impl FnMut(&mut fastrand::Rng, &Model, &Moment),
) {
    on_mechanisms(seed, count, wishes, |_, _, _| true, check);
}

/// The same with a coupling or a drive of every one of these kinds in turn.
pub fn on_coupled_mechanisms(
    seed: u64,
    count: usize,
    wishes: Wishes,
    kinds: &[usize],
    check: impl FnMut(&mut fastrand::Rng, &Model, &Moment),
) {
    let coupled = |rng: &mut fastrand::Rng, spec: &mut Spec, done: usize| {
        couple(rng, spec, wishes.planar, kinds[done % kinds.len()])
    };
    on_mechanisms(seed, count, wishes, coupled, check);
}

fn on_mechanisms(
    seed: u64,
    count: usize,
    wishes: Wishes,
    mut more: impl FnMut(&mut fastrand::Rng, &mut Spec, usize) -> bool,
    mut check: impl FnMut(&mut fastrand::Rng, &Model, &Moment),
) {
    let mut rng = fastrand::Rng::with_seed(seed);
    let (mut done, mut drawn) = (0, 0);
    while done < count {
        drawn += 1;
        assert!(drawn < 100 * count, "only {done} of {drawn} drawings could be used");
        let mut spec = drawing(&mut rng, wishes);
        loads(&mut fastrand::Rng::with_seed(seed + drawn as u64), &mut spec);
        if !more(&mut rng, &mut spec, done) {
            continue;
        }
        let Some(model) = compile(&spec, Coordinates::Relative) else { continue };
        if model.is_planar() != wishes.planar {
            continue;
        }
        let Some(moment) = Moment::random(&mut rng, &model) else { continue };
        check(&mut rng, &model, &moment);
        done += 1;
    }
}

/// The same without the forces that call functions, and its state; none where anything else does.
pub fn without_functions(model: &Model, m: &Moment) -> Option<(Model, Moment)> {
    let made = |spec: &Spec| Model::new(spec.clone(), Arc::new(NoFunctions), Coordinates::Relative).ok();
    let mut spec = (*model.spec).clone();
    let forces = std::mem::take(&mut spec.forces);
    let alone = |force: &Force| made(&Spec { forces: vec![force.clone()], ..spec.clone() });
    let kept = forces.iter().filter(|f| alone(f).is_some_and(|x| x.over::<Recorder>().is_ok())).cloned().collect();
    spec.forces = kept;
    let plain = made(&spec).filter(|x| x.over::<Recorder>().is_ok())?;
    // forces may have kept it from being planar
    let plain = Some(plain).filter(|x| x.size() == model.size())?;
    let moment = Moment::at(&plain, m.t, m.q.clone(), m.v.clone())?;
    Some((plain, moment))
}

/// All bodies at (q, v).
pub fn bodies(model: &Model, q: &[f64], v: &[f64]) -> Vec<BodyState> {
    let mut s = model.scratch();
    model.equations().look(q, v, s.equations());
    (0..model.spec.bodies.len()).map(|i| model.body_state(i, &s)).collect()
}

/// Derivative at 0 by central differences of fourth order: error h⁴/30 times the fifth derivative, round-off ε/h.
pub fn derivative(h: f64, mut f: impl FnMut(f64) -> Vec<f64>) -> Vec<f64> {
    let (a, b, c, d) = (f(-2.0 * h), f(-h), f(h), f(2.0 * h));
    (0..a.len()).map(|i| (8.0 * (c[i] - b[i]) - (d[i] - a[i])) / (12.0 * h)).collect()
}

/// The step of [`derivative`] at which its two errors meet: 3e-16 times a fifth derivative (up to 1e5 where springs are
/// short), and 3e-13 of round-off.
pub const STEP: f64 = 3e-4;

/// Second derivative at 0, of fourth order as well: error h⁴/90 times the sixth derivative, round-off 5 ε/h².
pub fn second_derivative(h: f64, mut f: impl FnMut(f64) -> Vec<f64>) -> Vec<f64> {
    let (a, b, m, c, d) = (f(-2.0 * h), f(-h), f(0.0), f(h), f(2.0 * h));
    (0..a.len()).map(|i| (16.0 * (c[i] + b[i]) - (d[i] + a[i]) - 30.0 * m[i]) / (12.0 * h * h)).collect()
}

/// q after the motion with v and v' for the time h: right to the second order, which is what a derivative needs.
pub fn moved(model: &Model, m: &Moment, h: f64) -> (Vec<f64>, Vec<f64>) {
    let mut q = m.q.clone();
    let dv: Vec<f64> = m.v.iter().zip(&m.vdot).map(|(v, a)| h * v + 0.5 * h * h * a).collect();
    model.step(&mut q, &dv);
    (q, m.v.iter().zip(&m.vdot).map(|(v, a)| v + h * a).collect())
}

/// Accelerations of all bodies, linear and angular, one after the other.
pub fn accelerations(model: &Model, m: &Moment) -> Vec<f64> {
    derivative(STEP, |h| {
        let (q, v) = moved(model, m, h);
        bodies(model, &q, &v).iter().flat_map(|b| b.velocity.0.into_iter().chain(b.angular_velocity.0)).collect()
    })
}

/// Largest difference against the largest entry (or 1).
pub fn apart(x: &[f64], y: &[f64]) -> f64 {
    assert_eq!(x.len(), y.len());
    let size = x.iter().chain(y).fold(1.0, |m: f64, x| m.max(x.abs()));
    x.iter().zip(y).fold(0.0, |m: f64, (x, y)| m.max((x - y).abs())) / size
}
