//! What must not matter: units, the combination of the constraints, the order of the coordinates.

use crate::instants::{between, units, vector, Instant};
use partita_math::dense::Matrix;
use partita_math::factor;
use partita_system::partition::criterion::Quality;
use partita_system::reduction::Reduction;
use partita_system::start;

/// Two computations of the same number in other units: round-off (1e-16) times the condition of M (up to 1e4 here) and
/// of its parts once more.
const TOLERANCE: f64 = 1e-9;

/// What the library finds at one instant with its own choice of coordinates.
#[derive(Debug)]
struct OwnChoice {
    independent: Vec<usize>,
    quality: Quality,
    rho: Vec<f64>,
    vdot: Vec<f64>,
    v: Vec<f64>,
    lambda: Vec<f64>,
}

/// Choose, then evaluate with the given full velocities (those of them that are independent).
fn find(system: &Instant, v: &[f64]) -> OwnChoice {
    let system = system.clone().user_system();
    let (n, m) = (system.equations.mass.rows(), system.equations.c.rows());
    let q = vec![0.0; n];
    let mut r = Reduction::new(&system, m);
    start::choose_partition(&mut r, 0.0, &q, None, None).unwrap();
    let speeds: Vec<f64> = r.planned.partition.independent.iter().map(|&i| v[i]).collect();
    r.evaluate(0.0, &q, &speeds).unwrap();
    let (mut rho, mut vdot, mut lambda) = (vec![0.0; n], vec![0.0; n], vec![0.0; m]);
    r.measure(0.0, &q, &mut rho).unwrap();
    r.full_acceleration(&mut vdot);
    r.multipliers(0.0, &q, &vdot, &mut lambda).unwrap();
    let quality = r.quality(0.0, &q).unwrap();
    OwnChoice { independent: r.planned.partition.independent.clone(), quality, rho, vdot, v: r.at.v.clone(), lambda }
}

fn random(rng: &mut fastrand::Rng) -> Instant {
    let n = rng.usize(2..10);
    let m = rng.usize(1..n);
    let condition = 10f64.powf(between(rng, 0.0, 4.0));
    Instant::random(rng, n, m, condition)
}

/// Entries of x and y agree against the largest of x in natural units `s`.
#[track_caller]
fn same(x: &[f64], y: impl IntoIterator<Item = f64>, s: &[f64]) {
    let size = x.iter().zip(s).fold(0.0, |m: f64, (x, s)| m.max((x / s).abs()));
    for ((x, y), s) in x.iter().zip(y).zip(s) {
        assert!(((x - y) / s).abs() <= TOLERANCE * size, "{x:e} against {y:e}, units {s:e}, largest {size:e}");
    }
}

#[track_caller]
fn same_quality(x: &OwnChoice, y: &OwnChoice, order: &[usize]) {
    assert!((x.quality.sigma - y.quality.sigma).abs() < TOLERANCE, "{x:?} {y:?}");
    assert!((x.quality.sqrt_mu - y.quality.sqrt_mu).abs() < TOLERANCE, "{x:?} {y:?}");
    for (new, &old) in order.iter().enumerate() {
        assert!((x.rho[old] - y.rho[new]).abs() < TOLERANCE, "{x:?} {y:?}");
    }
}

/// s_i = √[M⁻¹]_ii: speeds that one unit of energy gives.
fn natural(system: &Instant) -> Vec<f64> {
    let minv = crate::instants::inverse(&system.mass);
    (0..minv.rows()).map(|i| minv[(i, i)].sqrt()).collect()
}

#[test]
fn units_change_nothing_but_the_numbers() {
    let mut rng = fastrand::Rng::with_seed(21);
    for _ in 0..200 {
        let system = random(&mut rng);
        let n = system.mass.rows();
        let s = units(&mut rng, n);
        let other = system.in_units(&s);
        let v: Vec<f64> = vector(&mut rng, n).iter().zip(natural(&system)).map(|(v, s)| v * s).collect();
        let w: Vec<f64> = v.iter().zip(&s).map(|(v, s)| v * s).collect();
        let (here, there) = (find(&system, &v), find(&other, &w));
        assert_eq!(here.independent, there.independent);
        same_quality(&here, &there, &(0..n).collect::<Vec<_>>());
        let scales = natural(&system);
        same(&here.vdot, there.vdot.iter().zip(&s).map(|(x, s)| x / s), &scales);
        same(&here.v, there.v.iter().zip(&s).map(|(x, s)| x / s), &scales);
        let rows: Vec<f64> = row_scales(&system);
        same(&here.lambda, there.lambda.iter().copied(), &rows);
    }
}

/// Multipliers of one unit of mass norm.
fn row_scales(system: &Instant) -> Vec<f64> {
    let mc = system.c.matmul(&crate::instants::inverse(&system.mass)).matmul(&system.c.transpose());
    (0..mc.rows()).map(|i| 1.0 / mc[(i, i)].sqrt()).collect()
}

#[test]
fn powers_of_two_change_no_bit() {
    let mut rng = fastrand::Rng::with_seed(22);
    for _ in 0..200 {
        let system = random(&mut rng);
        let n = system.mass.rows();
        let s: Vec<f64> = (0..n).map(|_| 2f64.powi(rng.i32(-10..=10))).collect();
        let v = vector(&mut rng, n);
        let w: Vec<f64> = v.iter().zip(&s).map(|(v, s)| v * s).collect();
        let (here, there) = (find(&system, &v), find(&system.in_units(&s), &w));
        assert_eq!(here.independent, there.independent);
        assert_eq!(here.rho, there.rho);
        assert_eq!(here.lambda, there.lambda);
        let back = |x: &[f64]| x.iter().zip(&s).map(|(x, s)| x / s).collect::<Vec<_>>();
        assert_eq!(here.vdot, back(&there.vdot));
        assert_eq!(here.v, back(&there.v));
    }
}

#[test]
fn recombined_constraints_are_the_same_constraints() {
    let mut rng = fastrand::Rng::with_seed(23);
    let mut done = 0;
    while done < 200 {
        let system = random(&mut rng);
        let (n, m) = (system.mass.rows(), system.c.rows());
        // X of condition 1e3 at most in the units of the rows, so that it adds three digits to the loss
        let x = Matrix::from_vec(m, m, vector(&mut rng, m * m));
        let spread = factor::svd(&x).unwrap().s;
        if spread[m - 1] < 1e-2 * spread[0] {
            continue;
        }
        done += 1;
        let d = row_scales(&system);
        let out = units(&mut rng, m);
        let x = Matrix::from_vec(m, m, (0..m * m).map(|e| out[e / m] * x[(e / m, e % m)] * d[e % m]).collect());
        let other = system.recombined(&x);
        let v: Vec<f64> = vector(&mut rng, n).iter().zip(natural(&system)).map(|(v, s)| v * s).collect();
        let (here, there) = (find(&system, &v), find(&other, &v));
        assert_eq!(here.independent, there.independent);
        same_quality(&here, &there, &(0..n).collect::<Vec<_>>());
        same(&here.vdot, there.vdot.iter().copied(), &natural(&system));
        // λ' = X⁻ᵀ λ
        same(&here.lambda, x.transpose().matvec(&there.lambda), &d);
    }
}

#[test]
fn the_order_of_the_coordinates_is_forgotten() {
    let mut rng = fastrand::Rng::with_seed(24);
    for _ in 0..200 {
        let system = random(&mut rng);
        let n = system.mass.rows();
        let mut order: Vec<usize> = (0..n).collect();
        rng.shuffle(&mut order);
        let v: Vec<f64> = vector(&mut rng, n).iter().zip(natural(&system)).map(|(v, s)| v * s).collect();
        let w: Vec<f64> = order.iter().map(|&i| v[i]).collect();
        let (here, there) = (find(&system, &v), find(&system.reordered(&order), &w));
        let mut back: Vec<usize> = there.independent.iter().map(|&i| order[i]).collect();
        back.sort_unstable();
        assert_eq!(here.independent, back);
        same_quality(&here, &there, &order);
        let mut vdot = vec![0.0; n];
        order.iter().zip(&there.vdot).for_each(|(&i, x)| vdot[i] = *x);
        same(&here.vdot, vdot, &natural(&system));
    }
}
