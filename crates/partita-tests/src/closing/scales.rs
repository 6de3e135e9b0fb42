//! Free of scale: a mechanism of micrometres and one of a thousand kilometres give the same digits.
//!
//! Lengths and gravity are multiplied by the same number, so that the motion in time stays as it is: angles and rates of
//! turns the same, displacements multiplied. With powers of two every product is exact, so the digits must agree to the last.

use crate::families::*;
use crate::linkages::*;
use partita_integrate::method;
use partita_integrate::options::Options;
use partita_integrate::simulate::{simulate, Settings, Status};
use partita_math::tolerance;
use partita_model::spec::{Force, Spec};
use partita_model::tree::LinkMotion;
use partita_model::Model;
use partita_system::formulation::registry;
use partita_system::kinematics::assembly::{self};
use partita_system::options::FormulationOptions;
use partita_system::prelude::*;
use partita_system::record::Output;
use partita_system::start;
use std::ops::ControlFlow;

/// Lengths times s, accelerations too: moments of inertia and torques times s².
fn scaled(mut spec: Spec, s: f64) -> Model {
    let by = |x: &mut [f64; 3]| x.iter_mut().for_each(|x| *x *= s);
    by(&mut spec.gravity);
    for b in &mut spec.bodies {
        by(&mut b.com);
        by(&mut b.position);
        b.inertia.iter_mut().flatten().for_each(|x| *x *= s * s);
    }
    for j in &mut spec.joints {
        by(&mut j.point);
        j.child_point.iter_mut().for_each(by);
    }
    for f in &mut spec.forces {
        if let Force::Spring(x) = f {
            by(&mut x.point1);
            by(&mut x.point2);
            x.length *= s;
        }
    }
    Drawing(spec).model()
}

/// Coordinates or velocities with displacements divided by s.
fn in_units(model: &Model, x: &[f64], s: f64, velocities: bool) -> Vec<f64> {
    let mut x = x.to_vec();
    for l in model.equations().full.links.iter().skip(1) {
        if matches!(l.motion, LinkMotion::Slide(_)) {
            x[if velocities { l.v } else { l.q }] /= s;
        }
    }
    x
}

/// Everything that a mechanism answers, in its own units of length.
#[derive(Debug, PartialEq)]
struct Answers {
    assembled: Vec<f64>,
    iterations: usize,
    rank: usize,
    dropped: Vec<usize>,
    mobility: usize,
    independent: Vec<String>,
    quality: [f64; 2],
    determined: Vec<[bool; 6]>,
    counters: String,
    samples: Vec<Vec<f64>>,
}

fn answers(spec: &Spec, s: f64, formulation: &str) -> Answers {
    let model = scaled(spec.clone(), s);
    let mut rng = fastrand::Rng::with_seed(5);
    let mut q = rough(&model, &mut rng, 0.2);
    let closed = assembly::close(&model, 0.0, &mut q, tolerance::CLOSED, &[]).unwrap_or_else(|e| panic!("{s:e}: {e}"));
    let report = partita_analysis::report::report(&model, 0.0, &q).unwrap_or_else(|e| panic!("{s:e}: {e}"));
    let found = start::analyse(&model, 0.0, &q).unwrap();
    let options = FormulationOptions::default();
    let mut f = registry::by_name(formulation, &model, found.rank, &options).unwrap();
    let settings = Settings {
        t_end: 1.0,
        method: method::by_name("dop853").unwrap(),
        options: Options::default(),
        max_steps: 10_000,
    };
    let mut samples = Vec::new();
    let mut sink = |x: &Output| {
        samples.push(in_units(&model, &x.q, s, false));
        samples.push(in_units(&model, &x.v, s, true));
        Ok(())
    };
    let rest = vec![0.0; model.size().nv];
    let watch = &mut |_| ControlFlow::Continue(());
    let outcome = simulate(&mut *f, 0.0, &q, &rest, &[0.3, 1.0], &settings, &mut sink, watch).unwrap();
    assert_eq!(outcome.status, Status::Finished, "{} by {s:e}: {}", spec.name, outcome.message);
    Answers {
        assembled: in_units(&model, &q, s, false),
        iterations: closed.iterations,
        rank: found.rank,
        dropped: found.dropped,
        mobility: report.mobility,
        independent: report.independent,
        quality: [report.sigma.unwrap(), report.sqrt_mu.unwrap()],
        determined: report.reactions.iter().map(|r| r.determined).collect(),
        counters: format!("{:?} {:?}", outcome.counters, f.history().counters),
        samples,
    }
}

fn drawings() -> Vec<Drawing> {
    vec![
        four_bar([1.0, 0.3, 0.9, 0.7], 1.0, 1.0),
        slider_crank(),
        rssr("S"),
        rssr("U"),
        spatial_cranks(1),
        uprights(12, |i| 1.0 + 0.2 * (i as f64).sin()),
        side_by_side(3),
        scissors(4),
        bricard(),
    ]
}

#[test]
fn powers_of_two_change_no_digit() {
    for Drawing(spec) in drawings() {
        let one = answers(&spec, 1.0, "projective");
        for s in [2.0_f64.powi(-20), 2.0_f64.powi(20)] {
            let other = answers(&spec, s, "projective");
            assert_eq!(one, other, "{} by {s:e}", spec.name);
        }
    }
}

#[test]
fn powers_of_ten_change_the_last_digits_alone() {
    for Drawing(spec) in drawings() {
        let one = answers(&spec, 1.0, "projective");
        for s in [1e-6, 1e-3, 1e3, 1e6] {
            let other = answers(&spec, s, "projective");
            assert_eq!((one.rank, &one.dropped, one.mobility), (other.rank, &other.dropped, other.mobility));
            assert_eq!((&one.independent, &one.determined), (&other.independent, &other.determined), "{}", spec.name);
            let close = |x: &[f64], y: &[f64], tolerance: f64| {
                x.iter().zip(y).all(|(x, y)| (x - y).abs() <= tolerance * (1.0 + x.abs()))
            };
            // round-off of the description, times what the closing amplifies
            let (x, y) = (&one.assembled, &other.assembled);
            assert!(close(x, y, 1e-12), "{} by {s:e}: {x:?} {y:?}", spec.name);
            // the tolerance of the run is 1e-8. The same steps make the same error, until the scissors fold up: passing
            // positions with all links in line they multiply round-off by a hundred thousand
            for ((x, y), allowed) in one.samples.iter().zip(&other.samples).zip([1e-11, 1e-11, 1e-8, 1e-8]) {
                assert!(close(x, y, allowed), "{} by {s:e}: {x:?} {y:?}", spec.name);
            }
        }
    }
}
