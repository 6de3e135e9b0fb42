//! The rates changed to first order, of Newton's method in implicit steps: those of differences, on mechanisms drawn by chance,
//! along what the loops allow and beside it.

use crate::mechanisms::{on_random_mechanisms, without_functions, Moment, Wishes};
use partita_math::dense::{lu, lu_complex, lu_complex_solve, lu_solve, Complex};
use partita_model::Model;
use partita_system::formulation::{registry, Depth, LinearRates};
use partita_system::linear_rates::{Along, Route};
use partita_system::options::FormulationOptions;
use partita_system::prelude::*;
use partita_system::sparse_rates::{ComplexShift, RealShift};
use partita_system::system::Derivatives;

const COUNT: usize = 15;
/// Length of the differences.
const H: f64 = 1e-5;

/// Without a matrix, where nothing calls functions: the same products, and the same solutions beside what the loops allow, real and complex. Whether there was anything
/// to check.
fn check_sparse(rng: &mut fastrand::Rng, model: &Model, m: &Moment) -> bool {
    let mut f = registry::by_name("projective", model, m.rank, &FormulationOptions::default()).unwrap();
    let mut y = vec![0.0; f.layout().dim()];
    f.start(m.t, &m.q, &m.v, &mut y).unwrap();
    let [mut dense, mut sparse] =
        [Route::Dense, Route::Sparse].map(|route| LinearRates { route, ..LinearRates::default() });
    f.linear_rates(m.t, &y, &mut dense).unwrap();
    f.linear_rates(m.t, &y, &mut sparse).unwrap();
    let holonomic = model.size().holonomic == model.size().rows;
    assert_eq!(sparse.unformed().is_some(), holonomic && dense.derivatives == Derivatives::Exact);
    let count = dense.count;
    if sparse.unformed().is_none() {
        return false;
    }
    assert_eq!((sparse.count, sparse.derivatives), (count, dense.derivatives));
    let largest = |x: &[f64]| x.iter().fold(1.0, |m: f64, x| m.max(x.abs()));
    let near = |found: &[f64], expected: &[f64], what: &str| {
        let bound = 1e-8 * largest(expected);
        let worst = found.iter().zip(expected).fold(0.0, |m: f64, (a, b)| m.max((a - b).abs()));
        assert!(worst < bound, "{what}: {worst:e} of {bound:e}, {found:?} {expected:?}");
    };
    near(&sparse.unformed().unwrap().in_full().unwrap(), &dense.a, "A");
    // x and e of a change of y
    let change: Vec<f64> = y.iter().map(|_| rng.f64() - 0.5).collect();
    let part = |linear: &mut LinearRates| {
        let mut x = vec![0.0; linear.width()];
        linear.select(&change, &mut x);
        let mut beside: Vec<f64> = change.iter().map(|x| -x).collect();
        linear.lift(&x, &mut beside);
        beside.iter_mut().for_each(|x| *x = -*x);
        linear.couple(&beside, &mut x);
        (x, beside)
    };
    let ((expected, lifted), (found, other)) = (part(&mut dense), part(&mut sparse));
    near(&other, &lifted, "beside");
    let of = sparse.unformed().unwrap();
    for mu in [1.0, 30.0, 1e4] {
        let mut matrix: Vec<f64> = dense.a.iter().map(|x| -x).collect();
        (0..count).for_each(|i| matrix[i * count + i] += mu);
        let mut order = vec![0; count];
        lu(&mut matrix, count, &mut order).unwrap();
        let (mut a, mut b) = (expected.clone(), found.clone());
        lu_solve(&matrix, count, &order, &mut a);
        let mut factors = RealShift::default();
        factors.factor(of, mu).unwrap();
        factors.solve(of, &mut b);
        near(&b[..count], &a, "real");
        let mut matrix: Vec<Complex> = dense.a.iter().map(|x| [-x, 0.0]).collect();
        (0..count).for_each(|i| matrix[i * count + i] = [mu - dense.a[i * count + i], -1.2 * mu]);
        lu_complex(&mut matrix, count, &mut order).unwrap();
        let mut a: Vec<Complex> = expected.iter().map(|x| [*x, 0.5 - x]).collect();
        lu_complex_solve(&matrix, count, &order, &mut a);
        // the shift of the imaginary part moves x alone
        let mut b: Vec<Complex> =
            found.iter().enumerate().map(|(i, x)| [*x, if i < count { 0.5 - expected[i] } else { 0.0 }]).collect();
        let mut factors = ComplexShift::default();
        factors.factor(of, [mu, -1.2 * mu]).unwrap();
        factors.solve(of, &mut b);
        near(b[..count].as_flattened(), a.as_flattened(), "complex");
    }
    true
}

fn check(rng: &mut fastrand::Rng, model: &Model, m: &Moment) {
    let mut f = registry::by_name("projective", model, m.rank, &FormulationOptions::default()).unwrap();
    let mut y = vec![0.0; f.layout().dim()];
    f.start(m.t, &m.q, &m.v, &mut y).unwrap();
    let [mut lifting, mut linear] = [(); 2].map(|()| LinearRates { route: Route::Dense, ..LinearRates::default() });
    f.linear_rates(m.t, &y, &mut lifting).unwrap();
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
        lifting.lift(&x, &mut along);
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
    lifting.lift(&x, &mut beside);
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

#[test]
fn sparse_equations_have_the_solutions_of_the_matrix() {
    let mut sparse = 0;
    for (seed, wishes) in [
        (81, Wishes { planar: true, bound: true, drives: false }),
        (82, Wishes { planar: false, bound: true, drives: false }),
        (83, Wishes { planar: true, bound: true, drives: true }),
        (84, Wishes { planar: false, bound: false, drives: true }),
    ] {
        on_random_mechanisms(seed, COUNT, wishes, |rng, model, m| {
            check_sparse(rng, model, m);
            if let Some((plain, m)) = without_functions(model, m) {
                sparse += u64::from(check_sparse(rng, &plain, &m));
            }
        });
    }
    assert!(sparse >= 30, "{sparse}");
}
