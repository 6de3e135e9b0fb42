//! Systems in which the coordinates with the largest measures, taken one by one, make a bad or an impossible choice.

use crate::instants::{inverse, Instant};
use partita_math::dense::Matrix;
use partita_system::partition::criterion;
use partita_system::reduction::Reduction;
use partita_system::start;

/// The k largest measures, ascending; ties to the lower index.
fn one_by_one(rho: &[f64], k: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..rho.len()).collect();
    order.sort_by(|&a, &b| rho[b].total_cmp(&rho[a]));
    let mut top = order[..k].to_vec();
    top.sort_unstable();
    top
}

/// What P5 alone picks from a given first partition, and what the start picks with switches, each with its σ.
fn chosen(system: &Instant, first: &[usize]) -> [(Vec<usize>, f64); 2] {
    let system = system.clone().user_system();
    let (n, m) = (system.equations.mass.rows(), system.equations.c.rows());
    let q = vec![0.0; n];
    let still = vec![0.0; n - m];
    let mut r = Reduction::new(&system, m);
    r.position(0.0, &q).unwrap();
    r.refresh_scales(0.0, &q).unwrap();
    r.set_partition(0.0, first).unwrap();
    r.evaluate(0.0, &q, &still).unwrap();
    let greedy = criterion::choose(&r.at.dt, n - m, &r.at.md_factor, &r.scale.s2, None);
    r.set_partition(0.0, &greedy).unwrap();
    r.evaluate(0.0, &q, &still).unwrap();
    let sigma = r.quality(0.0, &q).unwrap().sigma;
    start::choose_partition(&mut r, 0.0, &q, None, None).unwrap();
    r.evaluate(0.0, &q, &still).unwrap();
    let after = r.quality(0.0, &q).unwrap().sigma;
    [(greedy, sigma), (r.planned.partition.independent.clone(), after)]
}

fn refused(system: &Instant, independent: &[usize]) -> bool {
    let system = system.clone().user_system();
    let (n, m) = (system.equations.mass.rows(), system.equations.c.rows());
    let mut r = Reduction::new(&system, m);
    let fixed = start::choose_partition(&mut r, 0.0, &vec![0.0; n], None, Some(independent));
    fixed.is_err_and(|e| e.to_string().contains("cannot be independent here"))
}

fn still(mass: Matrix, c: Matrix) -> Instant {
    let (n, m) = (c.cols(), c.rows());
    Instant { mass, c, h: vec![0.0; n], a: vec![0.0; m], b: vec![0.0; m] }
}

/// A pendulum at 45 degrees beside three equal carts coupled rigidly.
#[test]
fn a_pendulum_beside_coupled_carts() {
    let d = 0.5f64.sqrt();
    let c = Matrix::from_rows(&[&[d, -d, 0.0, 0.0, 0.0], &[0.0, 0.0, 1.0, -1.0, 0.0], &[0.0, 0.0, 0.0, 1.0, -1.0]]);
    let system = still(Matrix::identity(5), c);
    let rho = criterion::measure_constraint(&system.mass, &system.c).unwrap();
    let expected = [d, d, 1.0 / 3f64.sqrt(), 1.0 / 3f64.sqrt(), 1.0 / 3f64.sqrt()];
    rho.iter().zip(expected).for_each(|(r, e)| assert!((r - e).abs() < 1e-14, "{rho:?}"));
    let top = one_by_one(&rho, 2);
    assert_eq!(top, [0, 1]);
    assert!(refused(&system, &top));
    for (independent, sigma) in chosen(&system, &[1, 4]) {
        // one of the pendulum and one of the carts: the optimum, 1/√3
        assert_eq!(independent.iter().filter(|&&i| i < 2).count(), 1, "{independent:?}");
        assert!((sigma - 1.0 / 3f64.sqrt()).abs() < 1e-12, "{sigma}");
    }
}

/// One constraint between two of three coordinates whose inertias are coupled.
#[test]
fn a_coordinate_outside_the_only_constraint() {
    let minv = Matrix::from_rows(&[&[1.0, -0.4, 0.5], &[-0.4, 1.0, 0.5], &[0.5, 0.5, 1.0]]);
    let system = still(inverse(&minv), Matrix::from_rows(&[&[1.0, 1.0, 0.0]]));
    let rho = criterion::measure_constraint(&system.mass, &system.c).unwrap();
    // M_c = 1.2; ρ1² = 1 − 0.6²/1.2, ρ3² = 1 − 1/1.2
    let expected = [0.7f64.sqrt(), 0.7f64.sqrt(), (1.0f64 / 6.0).sqrt()];
    rho.iter().zip(expected).for_each(|(r, e)| assert!((r - e).abs() < 1e-13, "{rho:?}"));
    let top = one_by_one(&rho, 2);
    assert_eq!(top, [0, 1]);
    assert!(refused(&system, &top));
    // the dependent side ranked by the direct base vectors knows better: coordinate 3 is not in the constraint
    let mc = 1.2;
    let direct: Vec<f64> = [1.0, 1.0, 0.0].iter().enumerate().map(|(j, c)| c * c / mc / system.mass[(j, j)]).collect();
    assert!(direct[2] == 0.0 && direct[0] > 0.1);
    for (independent, sigma) in chosen(&system, &[1, 2]) {
        assert!(independent.contains(&2), "{independent:?}");
        assert!(sigma >= 0.40, "{sigma}");
    }
}

/// Whatever the system, the start ends at a partition that no single switch improves, and so within the bound (32).
#[test]
fn the_start_reaches_the_guaranteed_quality() {
    let mut rng = fastrand::Rng::with_seed(31);
    let mut behind = 0;
    for _ in 0..300 {
        let n = rng.usize(3..12);
        let m = rng.usize(1..n - 1);
        let k = n - m;
        // diagonal M: then σ_min(B) = 1
        let mut system = Instant::random(&mut rng, n, m, 1.0);
        for e in 0..n * n {
            if e / n != e % n {
                system.mass.data_mut()[e] = 0.0;
            }
        }
        let user_system = system.clone().user_system();
        let q = vec![0.0; n];
        let mut r = Reduction::new(&user_system, m);
        start::choose_partition(&mut r, 0.0, &q, None, None).unwrap();
        r.evaluate(0.0, &q, &vec![0.0; k]).unwrap();
        let quality = r.quality(0.0, &q).unwrap();
        // M diagonal: σ = √μ, Σ ρ² = k
        assert!((quality.sigma - quality.sqrt_mu).abs() < 1e-9, "{quality:?}");
        let mut rho = vec![0.0; n];
        r.measure(0.0, &q, &mut rho).unwrap();
        assert!((rho.iter().map(|r| r * r).sum::<f64>() - k as f64).abs() < 1e-9 * k as f64);
        let gain = r.best_switch().unwrap().gain;
        assert!(gain <= 1.0 + 1e-6, "{gain}");
        // (32) with f = 1
        let bound = 1.0 / ((1 + k * m) as f64).sqrt();
        assert!(quality.sigma >= bound * (1.0 - 1e-6), "{} below {bound}", quality.sigma);
        // one by one is not in general the volume's maximum
        behind += usize::from(one_by_one(&rho, k) != r.planned.partition.independent);
    }
    assert!(behind > 30, "{behind}");
}
