//! The rules of choice on random systems: what they claim to maximise, what may and what may not decide them.

use crate::instants::{block, inverse, log_det_general, units, vector, Instant};
use partita_math::dense::Matrix;
use partita_math::factor;
use partita_system::equations::UserSystem;
use partita_system::partition::{complete_pivoting, criterion, determinant, normalised_determinant, volume, Selection};
use partita_system::reduction::Reduction;
use partita_system::tangent::chooser::{self, Choice};
use partita_system::SystemError;

fn random(rng: &mut fastrand::Rng) -> Instant {
    let n = rng.usize(2..9);
    let m = rng.usize(1..n);
    let condition = 10f64.powf(4.0 * rng.f64());
    Instant::random(rng, n, m, condition)
}

/// The choice of a rule, with the reduction where it was made.
fn choose<'s>(
    system: &'s UserSystem<Instant>,
    rule: Selection,
    weights: Option<&[f64]>,
) -> Result<(Choice, Reduction<'s, UserSystem<Instant>>), SystemError> {
    let (n, m) = (system.equations.mass.rows(), system.equations.c.rows());
    let mut r = Reduction::new(system, m);
    let choice = chooser::choose_by(&mut r, 0.0, &vec![0.0; n], rule, weights)?;
    assert_eq!(choice.independent, r.planned.partition.independent);
    r.evaluate(0.0, &vec![0.0; n], &vec![0.0; n - m])?;
    Ok((choice, r))
}

fn chosen(system: &Instant, rule: Selection) -> Vec<usize> {
    choose(&system.clone().user_system(), rule, None).unwrap().0.independent
}

fn complement(n: usize, which: &[usize]) -> Vec<usize> {
    (0..n).filter(|i| !which.contains(i)).collect()
}

/// All subsets of k out of n.
fn subsets(n: usize, k: usize) -> Vec<Vec<usize>> {
    (0u32..1 << n)
        .filter(|b| b.count_ones() as usize == k)
        .map(|b| (0..n).filter(|i| b >> i & 1 == 1).collect())
        .collect()
}

/// ln |det C_D| by elimination of the block itself.
fn log_det_dependent(c: &Matrix, independent: &[usize]) -> f64 {
    log_det_general(&block(c, &(0..c.rows()).collect::<Vec<_>>(), &complement(c.cols(), independent)))
}

/// ln vol (28) but for what all partitions share.
fn log_volume(system: &Instant, independent: &[usize]) -> f64 {
    let minv = inverse(&system.mass);
    log_det_dependent(&system.c, independent) - independent.iter().map(|&i| 0.5 * minv[(i, i)].ln()).sum::<f64>()
}

#[test]
fn determinants_are_the_largest_there_are() {
    let mut rng = fastrand::Rng::with_seed(41);
    for _ in 0..200 {
        let system = random(&mut rng);
        let (n, k) = (system.mass.rows(), system.mass.rows() - system.c.rows());
        let user_system = system.clone().user_system();
        for (rule, value) in [
            (Selection::Determinant, (|s, i| log_det_dependent(&s.c, i)) as fn(&Instant, &[usize]) -> f64),
            (Selection::NormalisedDeterminant, log_volume),
        ] {
            let (choice, r) = choose(&user_system, rule, None).unwrap();
            assert!(choice.exact);
            let best = subsets(n, k).iter().map(|i| value(&system, i)).fold(f64::NEG_INFINITY, f64::max);
            let found = value(&system, &choice.independent);
            // logarithms of products of up to nine pivots in units a million apart
            assert!((found - best).abs() < 1e-8, "{}: {found} below {best}", rule.name());
            // the ratio told for a change is that of the determinants
            for other in subsets(n, k) {
                let direct = value(&system, &other) - found;
                let now = &r.planned.partition.independent;
                let reported = match rule {
                    Selection::Determinant => determinant::ratio(&r.at.dt, now, r.scales(), &other),
                    _ => normalised_determinant::ratio(&r.at.dt, now, r.scales(), None, &other),
                };
                assert!((reported - direct.exp()).abs() < 1e-7, "{reported} {}", direct.exp());
            }
        }
    }
}

/// Too many partitions to compare: no single switch helps, and the answer says that this is all.
#[test]
fn many_partitions_are_searched_by_switches() {
    let mut rng = fastrand::Rng::with_seed(42);
    for _ in 0..5 {
        let system = Instant::random(&mut rng, 20, 10, 10.0);
        let user_system = system.clone().user_system();
        for rule in [Selection::Determinant, Selection::NormalisedDeterminant] {
            let (choice, _) = choose(&user_system, rule, None).unwrap();
            assert!(!choice.exact);
            let value = |i: &[usize]| match rule {
                Selection::Determinant => log_det_dependent(&system.c, i),
                _ => log_volume(&system, i),
            };
            let here = value(&choice.independent);
            for j in 0..10 {
                for enters in complement(20, &choice.independent) {
                    let mut other = choice.independent.clone();
                    other[j] = enters;
                    other.sort_unstable();
                    assert!(value(&other) < here + 1e-8);
                }
            }
        }
    }
    // C(20, 10) is more, C(18, 6) less than the limit
    let at = |n: usize, k: usize| {
        let rows: Vec<f64> = (0..n * k).map(|e| f64::from(u8::from(e / k == e % k))).collect();
        volume::largest(&rows, &vec![0.0; n], &(0..k).collect::<Vec<_>>()).exact
    };
    assert!(!at(20, 10) && at(18, 6));
}

/// With one degree of freedom the geometric rule takes what moves most in its own displacement, whatever the masses; in
/// displacements that are the lengths of the gradients it is the criterion itself.
#[test]
fn displacements_alone_decide_the_geometric_rule() {
    let mut rng = fastrand::Rng::with_seed(44);
    for _ in 0..200 {
        let n = rng.usize(2..9);
        let system = Instant::random(&mut rng, n, n - 1, 100.0);
        let minv = inverse(&system.mass);
        let gradients: Vec<f64> = (0..n).map(|i| minv[(i, i)].sqrt()).collect();
        let lengths: Vec<f64> = gradients.iter().map(|s| s * 10f64.powf(rng.f64() - 0.5)).collect();
        let mut heavier = system.clone();
        let factors: Vec<f64> = (0..n).map(|_| 0.5 + rng.f64()).collect();
        for (i, j) in (0..n * n).map(|e| (e / n, e % n)) {
            heavier.mass[(i, j)] *= factors[i] * factors[j];
        }
        let by = |s: &Instant, l: &[f64], rule| {
            let user_system = s.clone().user_system().with_lengths(l.to_vec());
            let (choice, r) = choose(&user_system, rule, None).unwrap();
            (choice.independent, r.planned.partition.independent.clone(), r.at.dt.clone())
        };
        let (now, _, dt) = by(&system, &lengths, Selection::Geometric);
        // v = D^T u with D^T = 1 for the coordinate taken
        assert!((0..n).all(|i| dt[i].abs() / lengths[i] <= (1.0 + 1e-8) / lengths[now[0]]));
        assert_eq!(now, by(&heavier, &lengths, Selection::Geometric).0);
        assert_eq!(by(&system, &gradients, Selection::Geometric).0, by(&system, &[], Selection::Greedy).0);
    }
}

#[test]
fn units_decide_only_the_raw_rules() {
    let mut rng = fastrand::Rng::with_seed(43);
    let mut flipped = [0; 2];
    for _ in 0..200 {
        let system = random(&mut rng);
        let (n, m) = (system.mass.rows(), system.c.rows());
        let other = system.in_units(&units(&mut rng, n));
        let mut order: Vec<usize> = (0..n).collect();
        rng.shuffle(&mut order);
        let mut x = Matrix::from_vec(m, m, vector(&mut rng, m * m));
        while factor::svd(&x).unwrap().s[m - 1] < 1e-2 {
            x = Matrix::from_vec(m, m, vector(&mut rng, m * m));
        }
        // rows of very different units would be mixed by X: bring them to one size first
        let level = |c: &Matrix| {
            let minv = inverse(&system.mass);
            let mc = c.matmul(&minv).matmul(&c.transpose());
            Matrix::from_vec(
                m,
                m,
                (0..m * m).map(|e| if e / m == e % m { 1.0 / mc[(e / m, e / m)].sqrt() } else { 0.0 }).collect(),
            )
        };
        let mixed = system.recombined(&x.matmul(&level(&system.c)));
        for rule in [Selection::NormalisedDeterminant, Selection::Individual, Selection::Greedy, Selection::Collective]
        {
            let user_system = system.clone().user_system();
            // an impossible choice one by one is as impossible in other units
            let Ok((choice, _)) = choose(&user_system, rule, None) else { continue };
            let here = choice.independent;
            assert_eq!(here, chosen(&other, rule), "{}", rule.name());
            assert_eq!(here, chosen(&mixed, rule), "{}", rule.name());
            let mut back: Vec<usize> = chosen(&system.reordered(&order), rule).iter().map(|&i| order[i]).collect();
            back.sort_unstable();
            assert_eq!(here, back, "{}", rule.name());
        }
        // rows do not decide a determinant, units of the coordinates do
        assert_eq!(chosen(&system, Selection::Determinant), chosen(&mixed, Selection::Determinant));
        for (rule, flipped) in [Selection::Determinant, Selection::CompletePivoting].iter().zip(&mut flipped) {
            *flipped += i32::from(chosen(&system, *rule) != chosen(&other, *rule));
        }
    }
    assert!(flipped[0] > 100 && flipped[1] > 100, "{flipped:?}");
}

#[test]
fn one_degree_of_freedom_has_one_criterion() {
    let mut rng = fastrand::Rng::with_seed(44);
    for _ in 0..200 {
        let n = rng.usize(2..9);
        let system = Instant::random(&mut rng, n, n - 1, 100.0);
        let rho = criterion::measure_constraint(&system.mass, &system.c).unwrap();
        let first = (0..n).reduce(|b, i| if rho[i] > rho[b] * (1.0 + 1e-9) { i } else { b }).unwrap();
        for rule in [
            Selection::NormalisedDeterminant,
            Selection::Individual,
            Selection::Greedy,
            Selection::Collective,
            Selection::Persistence,
        ] {
            assert_eq!(chosen(&system, rule), [first], "{}", rule.name());
        }
    }
}

/// Greedy choices reach the largest volume but for a factor k! at the worst (Çivril, Magdon-Ismail 2009).
#[test]
fn greedy_is_close_to_the_largest_volume() {
    let mut rng = fastrand::Rng::with_seed(45);
    let mut behind = 0;
    for _ in 0..200 {
        let system = random(&mut rng);
        let k = system.mass.rows() - system.c.rows();
        let best = log_volume(&system, &chosen(&system, Selection::NormalisedDeterminant));
        let greedy = log_volume(&system, &chosen(&system, Selection::Greedy));
        let collective = log_volume(&system, &chosen(&system, Selection::Collective));
        let factorial: f64 = (1..=k).map(|i| (i as f64).ln()).sum();
        assert!(greedy >= best - factorial - 1e-8, "{greedy} {best}");
        assert!(collective >= greedy - 1e-8 && collective <= best + 1e-8);
        behind += i32::from(greedy < best - 1e-6);
    }
    // and not always the same
    assert!(behind > 5, "{behind}");
}

/// Complete pivoting by a literal elimination of the whole matrix, rows and columns moved.
#[test]
fn complete_pivoting_takes_the_columns_of_the_pivots() {
    let mut rng = fastrand::Rng::with_seed(46);
    for _ in 0..200 {
        let system = random(&mut rng);
        let (m, n) = (system.c.rows(), system.c.cols());
        let mut c: Vec<Vec<f64>> = (0..m).map(|i| system.c.row(i).to_vec()).collect();
        let mut columns: Vec<usize> = (0..n).collect();
        for s in 0..m {
            let pairs = (s..m).flat_map(|i| (s..n).map(move |j| (i, j)));
            let (i, j) = pairs.max_by(|a, b| c[a.0][a.1].abs().total_cmp(&c[b.0][b.1].abs())).unwrap();
            c.swap(s, i);
            c.iter_mut().for_each(|row| row.swap(s, j));
            columns.swap(s, j);
            for i in s + 1..m {
                let f = c[i][s] / c[s][s];
                (s..n).for_each(|j| c[i][j] -= f * c[s][j]);
            }
        }
        let mut rest = columns[m..].to_vec();
        rest.sort_unstable();
        assert_eq!(complete_pivoting::choose(&system.c, m).unwrap().0, rest);
        assert_eq!(chosen(&system, Selection::CompletePivoting), rest);
    }
    // two equal rows have one pivot
    let c = Matrix::from_rows(&[&[1.0, 2.0, 3.0], &[1.0, 2.0, 3.0]]);
    assert_eq!(complete_pivoting::choose(&c, 1).unwrap().0, [0, 1]);
    assert!(complete_pivoting::choose(&c, 2).is_none());
}

fn still(mass: Matrix, c: Matrix) -> UserSystem<Instant> {
    let (n, m) = (c.cols(), c.rows());
    Instant { mass, c, h: vec![0.0; n], a: vec![0.0; m], b: vec![0.0; m] }.user_system()
}

/// One by one the choice is impossible, and the error says which coordinates and why; the others do well.
#[test]
fn what_cannot_be_is_refused_by_name() {
    let d = 0.5f64.sqrt();
    let carts = Matrix::from_rows(&[&[d, -d, 0.0, 0.0, 0.0], &[0.0, 0.0, 1.0, -1.0, 0.0], &[0.0, 0.0, 0.0, 1.0, -1.0]]);
    let minv = Matrix::from_rows(&[&[1.0, -0.4, 0.5], &[-0.4, 1.0, 0.5], &[0.5, 0.5, 1.0]]);
    let coupled = Matrix::from_rows(&[&[1.0, 1.0, 0.0]]);
    for (system, least) in [(still(Matrix::identity(5), carts), 0.577), (still(inverse(&minv), coupled), 0.40)] {
        let e = choose(&system, Selection::Individual, None).err().unwrap();
        assert!(matches!(e, SystemError::Choice { rule: "individual", .. }), "{e}");
        let words = e.to_string();
        assert!(words.contains("q0, q1") && words.contains("C_D is singular"), "{words}");
        for rule in [Selection::Collective, Selection::Greedy, Selection::NormalisedDeterminant] {
            let (choice, mut r) = choose(&system, rule, None).unwrap();
            let sigma = r.quality(0.0, &vec![0.0; system.equations.mass.rows()]).unwrap().sigma;
            assert!(sigma >= least, "{}: {:?}, {sigma}", rule.name(), choice.independent);
        }
    }
}

#[test]
fn preferences_weigh_where_measures_are_compared() {
    let mut rng = fastrand::Rng::with_seed(47);
    for _ in 0..100 {
        let system = random(&mut rng);
        let n = system.mass.rows();
        let user_system = system.clone().user_system();
        let favourite = rng.usize(0..n);
        let mut weights = vec![1.0; n];
        weights[favourite] = 1e6;
        let rho = criterion::measure_constraint(&system.mass, &system.c).unwrap();
        if rho[favourite] < 1e-3 {
            continue;
        }
        let rules =
            [Selection::Collective, Selection::Greedy, Selection::NormalisedDeterminant, Selection::Persistence];
        for rule in rules {
            let (choice, _) = choose(&user_system, rule, Some(&weights)).unwrap();
            assert!(choice.independent.contains(&favourite), "{}", rule.name());
        }
    }
    for rule in [Selection::Determinant, Selection::CompletePivoting] {
        let e = chooser::check(rule, Some(&[1.0]), None).unwrap_err().to_string();
        assert!(e.contains(rule.name()) && e.contains("weights"), "{e}");
    }
    assert!(chooser::check(Selection::Persistence, None, None).is_err_and(|e| e.to_string().contains("window")));
    for window in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(chooser::check(Selection::Persistence, None, Some(window)).is_err(), "{window}");
    }
    assert!(chooser::check(Selection::Persistence, None, Some(1.0)).is_ok());
    assert!(chooser::check(Selection::Greedy, None, Some(1.0)).is_err());
}

/// The volume of a choice passes zero where its sign changes, whatever rows were swapped to compute it.
#[test]
fn volumes_have_the_sign_of_the_determinant() {
    let mut rng = fastrand::Rng::with_seed(29);
    for i in 0..200 {
        let k = 2 + i % 6;
        let mut random = || Matrix::from_vec(k, k, (0..k * k).map(|_| rng.f64() - 0.5).collect());
        let (a, b) = (random(), random());
        let of = |m: &Matrix| volume::signed_log(&mut m.data().to_vec(), k);
        let ((sign_a, log_a), (sign_b, log_b), (sign, log)) = (of(&a), of(&b), of(&a.matmul(&b)));
        // det AB = det A det B; the logarithm loses what elimination loses, 1e-16 times the condition
        assert_eq!(sign, sign_a * sign_b);
        assert!((log - log_a - log_b).abs() < 1e-9, "{log} {log_a} {log_b}");
        let mut swapped = a.clone();
        swapped.row_mut(0).copy_from_slice(a.row(k - 1));
        swapped.row_mut(k - 1).copy_from_slice(a.row(0));
        assert_eq!(of(&swapped).0, -sign_a);
    }
}
