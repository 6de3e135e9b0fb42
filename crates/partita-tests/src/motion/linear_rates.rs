//! The rates changed to first order, of Newton's method in implicit steps: those of differences, on mechanisms drawn by chance,
//! along what the loops allow and beside it.

use crate::mechanisms::{on_random_mechanisms, Moment, Wishes};
use partita_model::Model;
use partita_system::formulation::{registry, Depth, LinearRates};
use partita_system::linear_rates::Along;
use partita_system::options::FormulationOptions;
use partita_system::prelude::*;
use partita_system::system::Derivatives;

const COUNT: usize = 15;
/// Length of the differences.
const H: f64 = 1e-5;

fn check(rng: &mut fastrand::Rng, model: &Model, m: &Moment) {
    let mut f = registry::by_name("projective", model, m.rank, &FormulationOptions::default()).unwrap();
    let mut y = vec![0.0; f.layout().dim()];
    f.start(m.t, &m.q, &m.v, &mut y).unwrap();
    let mut linear = LinearRates::default();
    f.linear_rates(m.t, &y, &mut linear).unwrap();
    let holonomic = model.size().holonomic == model.size().rows;
    assert_eq!(matches!(linear.along, Along::Tangent { .. }), holonomic);
    let count = linear.count;
    let mut slopes = |y: &[f64]| {
        let mut dy = vec![0.0; y.len()];
        f.rates(m.t, y, &mut dy, Depth::Levels).unwrap();
        dy
    };
    // fourth order, of S f
    let mut changed = |along: &[f64]| -> Vec<f64> {
        let mut out = vec![0.0; count];
        for (step, weight) in [(1.0, 8.0), (-1.0, -8.0), (2.0, -1.0), (-2.0, 1.0)] {
            let moved: Vec<f64> = y.iter().zip(along).map(|(y, d)| y + step * H * d).collect();
            let mut x = vec![0.0; count];
            linear.select(&slopes(&moved), &mut x);
            out.iter_mut().zip(x).for_each(|(to, x)| *to += weight * x / (12.0 * H));
        }
        out
    };
    let largest = linear.a.iter().fold(1.0, |m: f64, x| m.max(x.abs()));
    let bound = if linear.derivatives == Derivatives::Exact { 1e-7 } else { 1e-5 } * largest;
    for j in 0..count {
        let mut x = vec![0.0; count];
        x[j] = 1.0;
        let mut along = vec![0.0; y.len()];
        linear.lift(&x, &mut along);
        for (i, found) in changed(&along).into_iter().enumerate() {
            let a = linear.a[i * count + j];
            assert!((found - a).abs() < bound, "{i} {j}: {found} {a} of {largest}");
        }
    }
    // beside what the loops allow
    let mut beside: Vec<f64> = (0..y.len()).map(|_| rng.f64() - 0.5).collect();
    let mut x = vec![0.0; count];
    linear.select(&beside, &mut x);
    x.iter_mut().for_each(|x| *x = -*x);
    linear.lift(&x, &mut beside);
    // nor along a quaternion itself, whose length means nothing, nor along what is only integrated
    let q = model.size().nq;
    beside[q..].fill(0.0);
    if holonomic && model.size().nq == model.size().nv {
        let mut coupled = vec![0.0; count];
        linear.couple(&beside, &mut coupled);
        for (found, expected) in changed(&beside).into_iter().zip(&coupled) {
            assert!((found - expected).abs() < bound, "{found} {expected} of {largest}");
        }
    }
}

#[test]
fn the_matrix_of_newton_is_that_of_differences() {
    for (seed, wishes) in [
        (71, Wishes { planar: true, bound: true, drives: false }),
        (72, Wishes { planar: false, bound: true, drives: false }),
        (73, Wishes { planar: true, bound: true, drives: true }),
    ] {
        on_random_mechanisms(seed, COUNT, wishes, check);
    }
}
