//! Small constrained user-defined systems, and short ways to march them.
#![allow(dead_code, unused_imports, reason = "each test file uses the part it needs")]

pub use crate::user_system::*;
use partita_integrate::options::Options;
use partita_integrate::simulate::{simulate, Settings, Status};
use partita_integrate::tableau::{DOP853, RK4};
use partita_system::equations::{Equations, UserSystem};
use partita_system::formulation::motion::Projective;
use partita_system::formulation::Formulation;
use partita_system::options::FormulationOptions;
use partita_system::prelude::*;
use partita_system::record::{Output, Sample};
use partita_system::ConstrainedSystem;
use std::ops::ControlFlow;

/// Settings of RK4 on a grid.
pub fn grid(t_end: f64, h: f64) -> Settings {
    let options = Options { fixed_step: Some(h), ..Options::default() };
    Settings { t_end, method: &RK4, options, max_steps: u64::MAX }
}

/// Settings for reference solutions: the tolerance is a hundred times round-off.
pub fn reference(t_end: f64) -> Settings {
    let options = Options { rtol: 2e-14, atol: 1e-14.into(), ..Options::default() };
    Settings { t_end, method: &DOP853, options, max_steps: u64::MAX }
}

/// Samples at `times`.
pub fn march(f: &mut dyn Formulation, q: &[f64], v: &[f64], times: &[f64], settings: &Settings) -> Vec<Sample> {
    let mut outputs = Vec::new();
    let mut sink = |s: &Output| {
        outputs.push(s.clone());
        Ok(())
    };
    let outcome = simulate(f, 0.0, q, v, times, settings, &mut sink, &mut |_| ControlFlow::Continue(())).unwrap();
    assert_eq!(outcome.status, Status::Finished, "{}", outcome.message);
    assert_eq!(outputs.len(), times.len());
    described(f, &outputs)
}

/// All that a formulation tells about the outputs of its run.
pub fn described(f: &mut dyn Formulation, outputs: &[Output]) -> Vec<Sample> {
    let events = f.history().events;
    outputs.iter().map(|output| Sample::of(f, output, &events).unwrap()).collect()
}

/// Samples in the compact form.
pub fn run<E: Equations>(
    system: &UserSystem<E>,
    options: FormulationOptions,
    (q, v): &(Vec<f64>, Vec<f64>),
    times: &[f64],
    settings: &Settings,
) -> Vec<Sample> {
    march(&mut Projective::new(system, system.size().rows, &options), q, v, times, settings)
}

/// Largest difference in q and v over all samples.
pub fn distance(x: &[Sample], y: &[Sample]) -> f64 {
    let mut largest: f64 = 0.0;
    for (x, y) in x.iter().zip(y) {
        for (x, y) in x.q.iter().zip(&y.q).chain(x.v.iter().zip(&y.v)) {
            largest = largest.max((x - y).abs());
        }
    }
    largest
}

/// Slope of ln y over ln x by least squares.
pub fn slope(x: &[f64], y: &[f64]) -> f64 {
    let (x, y): (Vec<f64>, Vec<f64>) = x.iter().zip(y).map(|(x, y)| (x.ln(), y.ln())).unzip();
    let n = x.len() as f64;
    let (mx, my) = (x.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let num: f64 = x.iter().zip(&y).map(|(x, y)| (x - mx) * (y - my)).sum();
    num / x.iter().map(|x| (x - mx).powi(2)).sum::<f64>()
}

/// `n` times from `dt` on.
pub fn times(dt: f64, n: usize) -> Vec<f64> {
    (1..=n).map(|i| dt * i as f64).collect()
}
