//! Implicit steps with and without a matrix of all degrees of freedom: the same motions, on mechanisms drawn by chance and on
//! chains whose results between bodies are unknowns of their own.

use crate::counting::allocations;
use crate::mechanisms::{body, compile, empty, joint, on_random_mechanisms, without_functions, Moment, Wishes};

use partita_integrate::method::RADAU;
use partita_integrate::options::Options;
use partita_integrate::simulate::{simulate, Settings, Status};
use partita_model::spec::{JointKind, Spec};
use partita_model::zero_position::Coordinates;
use partita_model::Model;
use partita_system::formulation::{
    registry, Depth, Formulation, Layout, LinearRates, Point, Purpose, Step, StepDecision, TrialEnd,
};
use partita_system::linear_rates::Route;
use partita_system::options::FormulationOptions;
use partita_system::prelude::*;
use partita_system::record::{History, Output, PartitionEvent, Sample};
use partita_system::{start, SystemError};
use std::ops::ControlFlow;

/// Tolerance of the runs, and how near their ends are: the matrix decides how iterations converge, not to what.
const RTOL: f64 = 1e-9;
const NEAR: f64 = 1e-7;

/// A formulation whose linearisations go one route.
struct Routed<'s> {
    inner: Box<dyn Formulation + Send + 's>,
    route: Route,
    unformed: u64,
}

impl Formulation for Routed<'_> {
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
        out.route = self.route;
        self.inner.linear_rates(t, y, out)?;
        self.unformed += u64::from(out.unformed().is_some());
        Ok(())
    }
    fn trial_end(&mut self, t: f64, y: &mut [f64], dy: &mut [f64], known: bool) -> Result<TrialEnd, SystemError> {
        self.inner.trial_end(t, y, dy, known)
    }
    fn commit(&mut self, decision: StepDecision, step: &mut Step) -> Result<bool, SystemError> {
        self.inner.commit(decision, step)
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

/// q and v at the end of a run, its steps, and its linearisations without a matrix; none if it does not get there.
fn end(model: &Model, m: &Moment, duration: f64, route: Route) -> Option<(Vec<f64>, u64, u64)> {
    let inner = registry::by_name("projective", model, m.rank, &FormulationOptions::default()).unwrap();
    let mut f = Routed { inner, route, unformed: 0 };
    let options = Options { rtol: RTOL, atol: RTOL.into(), ..Options::default() };
    let settings = Settings { t_end: m.t + duration, method: &RADAU, options, max_steps: 2_000 };
    let mut last = Vec::new();
    let mut sink = |s: &Output| {
        last = [&s.q[..], &s.v[..]].concat();
        Ok(())
    };
    let go = &mut |_| ControlFlow::Continue(());
    let outcome = simulate(&mut f, m.t, &m.q, &m.v, &[m.t + duration], &settings, &mut sink, go).ok()?;
    (outcome.status == Status::Finished).then_some((last, outcome.counters.steps, f.unformed))
}

/// Whether both routes were taken.
fn agree(model: &Model, m: &Moment, duration: f64) -> bool {
    let (Some(dense), Some(sparse)) = (end(model, m, duration, Route::Dense), end(model, m, duration, Route::Sparse))
    else {
        return false;
    };
    assert_eq!(dense.2, 0);
    let largest = dense.0.iter().fold(1.0, |m: f64, x| m.max(x.abs()));
    for (a, b) in dense.0.iter().zip(&sparse.0) {
        assert!((a - b).abs() < NEAR * largest, "{a} {b} of {largest}");
    }
    assert!(sparse.1 <= dense.1 + dense.1 / 4 + 2, "{} steps, {} with a matrix", sparse.1, dense.1);
    sparse.2 > 0
}

#[test]
fn random_mechanisms_move_alike() {
    let mut both = 0;
    for (seed, planar) in [(91, true), (92, false)] {
        on_random_mechanisms(seed, 10, Wishes { planar, bound: true, drives: false }, |_, model, m| {
            if let Some((model, m)) = without_functions(model, m) {
                both += u64::from(agree(&model, &m, 0.01));
            }
        });
    }
    assert!(both >= 12, "{both}");
}

/// Loops one on the other: a strip of four-bars, each on the coupler of the one before.
fn strip(loops: usize, planar: bool) -> Spec {
    let mut rng = fastrand::Rng::with_seed(93);
    let mut spec = empty("strip");
    spec.gravity = [0.0, -9.81, 0.0];
    let mut base = "ground".to_string();
    for i in 0..loops {
        let x = 0.4 * i as f64;
        let [a, b, c] = ["a", "b", "c"].map(|name| format!("{name}{i}"));
        [&a, &b, &c].into_iter().for_each(|name| spec.bodies.push(body(&mut rng, name.clone())));
        let mut add = |name: &str, kind, one: &str, other: &str, at| {
            spec.joints.push(joint(format!("{name}{i}"), kind, one, other, at));
            spec.joints.last_mut().unwrap().axis = (kind == JointKind::Revolute).then_some([0.0, 0.0, 1.0]);
        };
        // in space one pin is a ball, so that no row is redundant
        let ball = if planar { JointKind::Revolute } else { JointKind::Spherical };
        add("A", JointKind::Revolute, &base, &a, [x, 0.0, 0.0]);
        add("B", JointKind::Revolute, &base, &b, [x, 0.1, 0.0]);
        add("C", ball, &a, &c, [x + 0.4, 0.0, 0.0]);
        add("D", ball, &b, &c, [x + 0.38, 0.11, 0.0]);
        base = c;
    }
    spec
}

#[test]
fn strips_of_loops_move_alike_and_linearise_without_allocating() {
    for (loops, planar) in [(6, true), (3, false)] {
        for coordinates in [Coordinates::Relative, Coordinates::Absolute] {
            let model = compile(&strip(loops, planar), coordinates).unwrap();
            let (q, n) = (model.initial(), model.size().nv);
            let rank = start::analyse(&model, 0.0, &q).unwrap().rank;
            let m = Moment { t: 0.0, q, v: vec![0.0; n], vdot: vec![0.0; n], lambda: vec![], rank };
            assert!(agree(&model, &m, 0.1), "{loops} {coordinates:?}");
            let mut f = registry::by_name("projective", &model, m.rank, &FormulationOptions::default()).unwrap();
            let mut y = vec![0.0; f.layout().dim()];
            f.start(m.t, &m.q, &m.v, &mut y).unwrap();
            let mut linear = LinearRates { route: Route::Sparse, ..LinearRates::default() };
            (0..2).for_each(|_| f.linear_rates(m.t, &y, &mut linear).unwrap());
            let ((), counted) = allocations(|| (0..3).for_each(|_| f.linear_rates(m.t, &y, &mut linear).unwrap()));
            assert_eq!(counted, 0, "{loops} {coordinates:?}");
        }
    }
}
