//! Every formulation of the registry on the same systems: one set of accelerations, one set of constraint forces.

use crate::instants::{sample, vector, GivenTangent, Instant};
use crate::user_system::{any, Angles, FourBar, Pendulum, Plate, Redundant};
use partita_math::dense::{self, Matrix};
use partita_math::elimination::Pattern;
use partita_math::factor;
use partita_system::equations::full::{self, baumgarte, AccelerationRule};
use partita_system::equations::{Equations, UserSystem};
use partita_system::formulation::registry::{by_name, unread, NAMES};
use partita_system::formulation::Depth;
use partita_system::options::{FormulationOptions, Renew, TangentMap};
use partita_system::partition::Selection;
use partita_system::prelude::*;
use partita_system::record::Correction;
use partita_system::reduction::Reduction;
use partita_system::{start, SystemError};
use std::sync::Arc;

/// What a formulation asks for besides the equations.
#[derive(Clone, Copy, PartialEq)]
enum Needs {
    Nothing,
    /// Two numbers without a default.
    Stabilisation,
    /// A function that closes the loops.
    Closing,
    /// Tangent velocities of the user.
    Tangent,
}

/// Name, needs, and whether `C v + a = 0` is not kept by itself: v is integrated as a whole, or as the user says.
const TABLE: &[(&str, Needs, bool)] = &[
    ("projective", Needs::Nothing, false),
    ("multipliers", Needs::Nothing, true),
    ("sparse-multipliers", Needs::Nothing, true),
    ("range-space", Needs::Nothing, true),
    ("baumgarte", Needs::Stabilisation, true),
    ("proximal", Needs::Nothing, true),
    ("wehage-haug", Needs::Nothing, false),
    ("explicit-closing", Needs::Closing, false),
    ("fixed", Needs::Nothing, false),
    ("zero-eigenvalue", Needs::Nothing, false),
    ("svd", Needs::Nothing, false),
    ("qr", Needs::Nothing, false),
    ("liang-lance", Needs::Nothing, false),
    ("gram-schmidt", Needs::Nothing, false),
    ("tangent-space", Needs::Nothing, false),
    ("user-tangent", Needs::Tangent, true),
];

/// Round-off, times the condition of M and the amplification of an ordinary partition.
const TOLERANCE: f64 = 1e-10;

/// The tangent of a partition at one state, handed over as if the user had written it.
fn tangent_at<E: Equations>(system: &UserSystem<E>, t: f64, q: &[f64], v: &[f64]) -> Arc<dyn TangentMap> {
    let mut r = Reduction::new(system, start::analyse(system, t, q).unwrap().rank);
    start::choose_partition(&mut r, t, q, None, None).unwrap();
    let speeds: Vec<f64> = r.planned.partition.independent.iter().map(|&i| v[i]).collect();
    r.evaluate(t, q, &speeds).unwrap();
    Arc::new(GivenTangent {
        dt: mixed(&r.at.dt, r.planned.partition.independent.len()),
        gamma: r.at.gamma,
        delta: r.at.delta,
    })
}

/// Directions that are no partition's: each a combination of all, the same ones at all times, so that what is left of
/// v' where u' is nothing stays as it is.
fn mixed(dt: &[f64], k: usize) -> Vec<f64> {
    let weight = |i: usize, j: usize| f64::from(u8::from(i == j)) + 0.8 / k as f64 * ((1 + 3 * i + 5 * j) as f64).sin();
    let row = |row: &[f64]| (0..k).map(|j| (0..k).map(|i| row[i] * weight(i, j)).sum()).collect::<Vec<f64>>();
    dt.chunks_exact(k.max(1)).flat_map(row).collect()
}

/// The options under which the formulation runs on this system; `None` if it does not apply.
fn options(needs: Needs, closes: bool, tangent: &Arc<dyn TangentMap>) -> Option<FormulationOptions> {
    let plain = FormulationOptions { correction: Correction::None, ..FormulationOptions::default() };
    match needs {
        Needs::Nothing => Some(plain),
        Needs::Stabilisation => Some(FormulationOptions { baumgarte: Some((3.0, 5.0)), ..plain }),
        Needs::Closing => closes.then_some(plain),
        Needs::Tangent => Some(FormulationOptions { tangent: Some(tangent.clone()), ..plain }),
    }
}

/// v' from `[M Cᵀ; C 0]` on independent rows, by LU with pivoting.
fn accelerations<E: Equations>(
    system: &UserSystem<E>,
    t: f64,
    q: &[f64],
    v: &[f64],
    rank: usize,
) -> (Vec<f64>, Vec<f64>) {
    let e = &system.equations;
    let (n, m) = (e.n(), e.rows());
    let (mut mass, mut h, mut c, mut b) = (vec![0.0; n * n], vec![0.0; n], vec![0.0; m * n], vec![0.0; m]);
    e.mass(t, q, &mut mass).unwrap();
    e.forces(t, q, v, &mut h).unwrap();
    e.jacobian(t, q, &mut c).unwrap();
    e.bias(t, q, v, &mut b).unwrap();
    let c = Matrix::from_vec(m, n, c);
    // independent rows by a QR of Cᵀ, which no formulation uses for them
    let rows = factor::qr_null_space(&c).unwrap().perm[..rank].to_vec();
    let mut k = Matrix::new(n + rank, n + rank);
    let mut x = h.clone();
    for i in 0..n {
        k.row_mut(i)[..n].copy_from_slice(&mass[i * n..(i + 1) * n]);
    }
    for (i, &row) in rows.iter().enumerate() {
        for j in 0..n {
            (k[(n + i, j)], k[(j, n + i)]) = (c[(row, j)], c[(row, j)]);
        }
        x.push(-b[row]);
    }
    let vdot = factor::solve_dense(&k, &x).unwrap()[..n].to_vec();
    let reaction = (0..n).map(|i| dense::dot(&mass[i * n..(i + 1) * n], &vdot) - h[i]).collect();
    (vdot, reaction)
}

/// |x − y| over |y|, each entry in its natural scale `s`.
fn apart(x: &[f64], y: &[f64], s: &[f64]) -> f64 {
    let norm = |f: &dyn Fn(usize) -> f64| (0..s.len()).map(|i| (f(i) / s[i]).powi(2)).sum::<f64>().sqrt();
    norm(&|i| x[i] - y[i]) / norm(&|i| y[i]).max(f64::MIN_POSITIVE)
}

/// Run all applicable formulations at one state, S3 and S4 satisfied.
fn check<E: Equations>(what: &str, system: &UserSystem<E>, t: f64, q: &[f64], v: &[f64]) -> usize {
    let size = system.size();
    let rank = start::analyse(system, t, q).unwrap().rank;
    let (vdot, reaction) = accelerations(system, t, q, v, rank);
    let mut scratch = system.scratch();
    let (mut phi, mut c, mut a) = (vec![0.0; size.holonomic], vec![0.0; size.rows * size.nv], vec![0.0; size.rows]);
    system.position(t, q, &mut scratch, &mut phi, &mut c, &mut a).unwrap();
    let mut s2 = vec![0.0; size.nv];
    system.inverse_mass_diagonal(t, q, &mut scratch, &mut s2).unwrap();
    let s: Vec<f64> = s2.iter().map(|x| x.sqrt()).collect();
    let inverse: Vec<f64> = s.iter().map(|x| 1.0 / x).collect();
    let mut done = 0;
    let tangent = tangent_at(system, t, q, v);
    for &(name, needs, full) in TABLE {
        let Some(options) = options(needs, system.equations.explicit_closing().is_some(), &tangent) else { continue };
        let mut f = by_name(name, system, rank, &options).unwrap();
        assert_eq!(f.history().name, name);
        let mut y = vec![0.0; f.layout().dim()];
        f.start(t, q, v, &mut y).unwrap();
        let mut out = sample(&mut *f, t, &y);
        let off = apart(&out.vdot, &vdot, &s);
        assert!(off < TOLERANCE, "{what}, {name}: v' off by {off:e}");
        let pattern = system.pattern();
        let mut force = vec![0.0; size.nv];
        for i in 0..size.rows {
            pattern.row(i).for_each(|e| force[pattern.col_idx[e]] += c[e] * out.multipliers[i]);
        }
        let off = apart(&force, &reaction, &inverse);
        assert!(off < TOLERANCE, "{what}, {name}: reactions off by {off:e}");
        assert_eq!(out.measure.len(), size.nv);
        assert!(out.sigma > 0.0 && out.sqrt_mu > 0.0 && out.independent.len() == size.nv - rank);
        // a row that the multipliers use is a row that is reported as kept
        assert!((0..size.rows).all(|i| out.multipliers[i] == 0.0 || f.history().rows.contains(&i)), "{what}, {name}");
        if !full {
            // a state off the closed position: computed velocities satisfy S4 there too
            for (i, y) in y.iter_mut().enumerate() {
                *y += 1e-4 * (1.0 + i as f64).sin();
            }
            let mut dy = vec![0.0; f.layout().dim()];
            f.rates(t, &y, &mut dy, Depth::Rates).unwrap();
            out = sample(&mut *f, t, &y);
            let speed = v.iter().zip(&s).map(|(v, s)| (v / s).abs()).fold(1.0, f64::max);
            let row = |i: usize| pattern.row(i).map(|e| (c[e] * s[pattern.col_idx[e]]).abs()).fold(0.0, f64::max);
            let arm = (0..size.rows).map(row).fold(0.0, f64::max);
            assert!(out.velocity_closure < 1e-12 * arm * speed, "{what}, {name}: {:e}", out.velocity_closure);
        }
        done += 1;
    }
    done
}

#[test]
fn the_table_names_every_formulation() {
    let (mut named, mut all): (Vec<&str>, _) = (TABLE.iter().map(|row| row.0).collect(), NAMES.to_vec());
    named.sort_unstable();
    all.sort_unstable();
    assert_eq!(named, all);
}

#[test]
fn accelerations_and_reactions_of_mechanisms() {
    let resting = any(Pendulum::RESTING_PIVOT);
    assert_eq!(check("pendulum", &resting, 0.0, &[0.6, -0.8], &[0.8 * 1.3, 0.6 * 1.3]), TABLE.len());
    let moving = Pendulum { amplitude: 0.3, frequency: 2.0, mass: 2.0 };
    let t = 0.7;
    let [p, u, _] = moving.pivot(t);
    let done = check("moving pivot", &any(moving), t, &[0.6 + p, -0.8], &[0.8 * 1.3 + u, 0.6 * 1.3]);
    assert_eq!(done, TABLE.len());
    let (q, v) = Plate::start();
    assert_eq!(check("plate", &any(Plate), 0.0, &q, &v), TABLE.len());
    let (q, v) = Angles::start();
    assert_eq!(check("four-bar in angles", &any(Angles), 0.0, &q, &v), TABLE.len());
    assert_eq!(check("redundant rows", &any(Redundant(Angles)), 0.0, &q, &v), TABLE.len());
    let (q, v) = FourBar::start();
    assert_eq!(check("four-bar of free rods", &any(FourBar), 0.0, &q, &v), TABLE.len());
    assert_eq!(check("redundant free rods", &any(Redundant(FourBar)), 0.0, &q, &v), TABLE.len());
}

/// The values of the reference four-bar, computed independently to twelve digits.
#[test]
fn regression_values_of_the_four_bar() {
    let system = any(Angles);
    let (q, v) = Angles::start();
    let tangent = tangent_at(&system, 0.0, &q, &v);
    for &(name, needs, _) in TABLE {
        let mut f = by_name(name, &system, 2, &options(needs, true, &tangent).unwrap()).unwrap();
        let mut y = vec![0.0; f.layout().dim()];
        f.start(0.0, &q, &v, &mut y).unwrap();
        let out = sample(&mut *f, 0.0, &y);
        // link angles are sums of the joint angles of the reference: the crank is the same
        assert!((out.vdot[0] + 10.466415143407).abs() < 1e-11, "{name}: {}", out.vdot[0]);
        let lambda = [7.546968149505, 27.999622165247];
        out.multipliers.iter().zip(lambda).for_each(|(x, y)| assert!((x - y).abs() < 1e-10, "{name}: {x} {y}"));
    }
}

/// Random M, C, h, a, b in random units: nothing but linear algebra.
#[test]
fn accelerations_and_reactions_of_random_systems() {
    let mut rng = fastrand::Rng::with_seed(41);
    let mut done = 0;
    for i in 0..60 {
        let n = rng.usize(2..9);
        let m = rng.usize(1..n);
        // q = 0 closes Φ = C q; of the velocities that satisfy S4 take the shortest
        let system = Instant::random(&mut rng, n, m, 1e3).user_system();
        let e = &system.equations;
        let units = natural_units(&e.mass);
        let scaled = Matrix::from_vec(m, n, (0..m * n).map(|x| e.c.data()[x] * units[x % n]).collect());
        let rows: Vec<f64> = (0..m).map(|i| 1.0 / dense::dot(scaled.row(i), scaled.row(i)).sqrt()).collect();
        let unit = Matrix::from_vec(m, n, (0..m * n).map(|x| scaled.data()[x] * rows[x / n]).collect());
        let right: Vec<f64> = e.a.iter().zip(&rows).map(|(a, r)| -a * r).collect();
        let (w, _) = factor::least_squares_min_norm(&unit, &right, 1e-12).unwrap();
        let v: Vec<f64> = w.iter().zip(&units).map(|(w, s)| w * s).collect();
        if factor::svd(&unit).unwrap().s[m - 1] < 1e-2 {
            continue; // nearly dependent rows amplify the round-off of every method
        }
        check(&format!("random {i}"), &system, 0.0, &vec![0.0; n], &v);
        done += 1;
    }
    assert!(done > 30, "{done}");
}

/// `M_ii^-1/2`: natural units of the velocities.
fn natural_units(mass: &Matrix) -> Vec<f64> {
    (0..mass.rows()).map(|i| 1.0 / mass[(i, i)].sqrt()).collect()
}

#[test]
fn what_is_missing_is_asked_for() {
    let system = any(Angles);
    let refused = |name: &str, o: &FormulationOptions, word: &str| match by_name(name, &system, 2, o) {
        Err(SystemError::Argument { message, .. }) => assert!(message.contains(word), "{message}"),
        Err(other) => panic!("{other}"),
        Ok(_) => panic!("{name} was accepted"),
    };
    let plain = FormulationOptions::default();
    refused("baumgarte", &plain, "no default");
    for bad in [(-1.0, 1.0), (1.0, f64::NAN), (f64::INFINITY, 1.0)] {
        refused("baumgarte", &FormulationOptions { baumgarte: Some(bad), ..plain.clone() }, "finite and not negative");
    }
    refused("lagrange", &plain, "choose among projective, ");
    let two = FormulationOptions { independent: Some(vec![0, 1]), ..plain.clone() };
    refused("explicit-closing", &two, "the number of degrees of freedom is 1");
    // inputs other than those of the function
    let coupler = FormulationOptions { independent: Some(vec![1]), ..plain.clone() };
    let mut f = by_name("explicit-closing", &system, 2, &coupler).unwrap();
    let (q, v) = Angles::start();
    let mut y = vec![0.0; f.layout().dim()];
    match f.start(0.0, &q, &v, &mut y) {
        Err(SystemError::Argument { message, .. }) => assert!(message.contains("takes crank as inputs"), "{message}"),
        other => panic!("{other:?}"),
    }
    // no function at all
    let instant = Instant::random(&mut fastrand::Rng::with_seed(3), 3, 1, 10.0).user_system();
    let mut f = by_name("explicit-closing", &instant, 1, &plain).unwrap();
    let mut y = vec![0.0; f.layout().dim()];
    assert!(matches!(f.start(0.0, &[0.0; 3], &[0.0; 3], &mut y), Err(SystemError::Argument { .. })));
}

/// Options that make no sense are refused by every formulation, whichever it reads.
#[test]
fn senseless_options_are_refused() {
    let system = any(Angles);
    let (q, v) = Angles::start();
    let tangent = tangent_at(&system, 0.0, &q, &v);
    type Change = fn(&mut FormulationOptions);
    let senseless: [(&str, Change); 13] = [
        ("switch_threshold is NaN", |o| o.switch_threshold = f64::NAN),
        ("switch_threshold is 0.5", |o| o.switch_threshold = 0.5),
        ("switch_threshold is -inf", |o| o.switch_threshold = f64::NEG_INFINITY),
        ("renew is NaN", |o| o.renew = f64::NAN.into()),
        ("renew is -0.1", |o| o.renew = (-0.1).into()),
        ("renew is 2", |o| o.renew = 2.0.into()),
        ("there is no velocity 7", |o| o.independent = Some(vec![7])),
        ("velocity 0 is named twice", |o| o.independent = Some(vec![0, 0])),
        ("weights has 2 numbers", |o| o.weights = Some(vec![1.0; 2])),
        ("weights[1] is NaN", |o| o.weights = Some(vec![1.0, f64::NAN, 1.0])),
        ("weights[2] is 0", |o| o.weights = Some(vec![1.0, 1.0, 0.0])),
        ("weights[0] is -1", |o| o.weights = Some(vec![-1.0, 1.0, 1.0])),
        ("weights[0] is inf", |o| o.weights = Some(vec![f64::INFINITY, 1.0, 1.0])),
    ];
    for &(name, needs, _) in TABLE {
        for (words, change) in senseless {
            let mut o = options(needs, true, &tangent).unwrap();
            change(&mut o);
            match by_name(name, &system, 2, &o) {
                Err(SystemError::Argument { message, .. }) => assert!(message.contains(words), "{name}: {message}"),
                Err(other) => panic!("{name}: {other}"),
                Ok(_) => panic!("{name} accepted: {words}"),
            }
        }
    }
    // the same for those who choose without a formulation
    let mut r = Reduction::new(&system, 2);
    for bad in [vec![3], vec![0, 1]] {
        let refused = start::choose_partition(&mut r, 0.0, &q, None, Some(&bad));
        assert!(matches!(refused, Err(SystemError::Argument { .. })), "{bad:?}");
    }
}

/// What a formulation reads changes what it does or is asked for; the rest is named, and nothing is named that is not
/// set.
#[test]
fn unread_options_are_named() {
    let plain = FormulationOptions::default();
    let (q, v) = Angles::start();
    let tangent = tangent_at(&any(Angles), 0.0, &q, &v);
    let all = FormulationOptions {
        correction: Correction::None,
        switch_threshold: 2.0,
        independent: Some(vec![0]),
        weights: Some(vec![1.0; 3]),
        selection: Selection::Persistence,
        window: Some(1.0),
        baumgarte: Some((1.0, 1.0)),
        renew: Renew::EachStep,
        tangent: options(Needs::Tangent, true, &tangent).unwrap().tangent,
        ..plain.clone()
    };
    for &name in NAMES {
        assert!(unread(name, &plain).is_empty(), "{name}");
        assert!(unread(name, &all).len() < 9, "{name} reads nothing");
    }
    assert_eq!(unread("projective", &all), ["baumgarte", "renew", "tangent"]);
    assert_eq!(unread("tangent-space", &FormulationOptions { renew: 0.1.into(), ..plain.clone() }), [""; 0]);
    let chosen = FormulationOptions { selection: Selection::Greedy, ..plain };
    assert_eq!(unread("svd", &chosen), ["selection"]);
}

/// The side of a pendulum is a dead point of x: the choice is to blame, and the message names another. Where the length
/// itself is lost no choice helps, and none is blamed.
#[test]
fn a_fixed_choice_is_distinguished_from_a_singular_mechanism() {
    let system = any(Pendulum::RESTING_PIVOT);
    let fixed = FormulationOptions { independent: Some(vec![0]), ..FormulationOptions::default() };
    for name in ["projective", "fixed"] {
        let mut f = by_name(name, &system, 1, &fixed).unwrap();
        let (mut y, mut dy) = (vec![0.0; f.layout().dim()], vec![0.0; f.layout().dim()]);
        f.start(0.0, &[0.6, -0.8], &[0.8, 0.6], &mut y).unwrap();
        y[..2].copy_from_slice(&[1.0, 0.0]);
        match f.rates(0.0, &y, &mut dy, Depth::Rates) {
            Err(SystemError::DeadPoint { coordinates, seen, advice, .. }) => {
                assert!(coordinates == "x" && seen.contains("C_D is singular"), "{coordinates} {seen}");
                assert!(advice.contains("not singular, and y would serve"), "{advice}");
            }
            other => panic!("{name}: {other:?}"),
        }
        y[..2].copy_from_slice(&[0.0, 0.0]);
        assert!(matches!(f.rates(0.0, &y, &mut dy, Depth::Rates), Err(SystemError::Singular { .. })), "{name}");
        // the same at the start
        match f.start(0.0, &[1.0, 0.0], &[0.0, 1.0], &mut y) {
            Err(SystemError::Argument { message, .. }) => assert!(message.contains("y would serve"), "{message}"),
            other => panic!("{name}: {other:?}"),
        }
    }
}

/// Where nothing can be evaluated an error comes back, never a number.
#[test]
fn what_is_not_finite_is_refused() {
    for &(name, needs, _) in TABLE {
        let system = any(Angles);
        let (q, v) = Angles::start();
        let tangent = tangent_at(&system, 0.0, &q, &v);
        let mut f = by_name(name, &system, 2, &options(needs, true, &tangent).unwrap()).unwrap();
        let mut y = vec![0.0; f.layout().dim()];
        f.start(0.0, &q, &v, &mut y).unwrap();
        let good = y.clone();
        for i in 0..f.layout().controlled {
            let mut dy = vec![0.0; f.layout().dim()];
            y.copy_from_slice(&good);
            y[i] = f64::NAN;
            let answer = f.rates(0.0, &y, &mut dy, Depth::Rates);
            // the cheap forms leave a NaN in a speed to the stepper, which looks at every derivative
            assert!(answer.is_err() || dy.iter().any(|x| !x.is_finite()), "{name}: {dy:?}");
            assert!(answer.map_or_else(|e| e.is_local(), |()| true), "{name}");
            // and the formulation is as good as before
            f.rates(0.0, &good, &mut dy, Depth::Rates).unwrap();
            assert!(dy.iter().all(|x| x.is_finite()), "{name}");
        }
    }
}

/// Squared sines between rows far above ε take three iterations; near it and below, the damping is lowered; what is lost in
/// rounding is refused as a loss of rank.
#[test]
fn the_proximal_iteration_lowers_its_damping_and_refuses_what_is_lost_in_rounding() {
    let nearly = |angle: f64| Instant {
        mass: Matrix::identity(3),
        c: Matrix::from_rows(&[&[1.0, 0.0, 0.0], &[1.0, angle, 0.0]]),
        h: vec![0.3, -0.2, 0.5],
        a: vec![0.0; 2],
        b: vec![0.4, 0.7],
    };
    let ask = |angle: f64| {
        let system = nearly(angle).user_system();
        let mut f = by_name("proximal", &system, 2, &FormulationOptions::default()).unwrap();
        let (mut y, mut dy) = (vec![0.0; f.layout().dim()], vec![0.0; f.layout().dim()]);
        f.start(0.0, &[0.0; 3], &[0.0; 3], &mut y).map_err(|e| e.to_string())?;
        f.rates(0.0, &y, &mut dy, Depth::Rates).map_err(|e| e.to_string())?;
        // v' = (−b0, (b0 − b1) / angle, h2)
        let off = (dy[4] - (0.4 - 0.7) / angle).abs() * angle;
        assert_eq!(dy[5], 0.5);
        Ok::<_, String>((off, f.history().counters.proximal_iterations))
    };
    for (angle, closer, most) in [(0.5, 1e-12, 4), (1e-3, 1e-9, 10), (1e-5, 1e-5, 20)] {
        let (off, iterations) = ask(angle).unwrap();
        assert!(off < closer && iterations <= most, "{angle}: {off:e} {iterations}");
    }
    let lost = ask(1e-8).unwrap_err();
    assert!(lost.contains("lose rank"), "{lost}");
}

/// `Φ̈ + 2α Φ̇ + β² Φ = 0` on rows that remain open in position and in rate; on one without a position the last
/// term is missing.
#[test]
fn baumgarte_pulls_open_rows_as_it_says() {
    let mut rng = fastrand::Rng::with_seed(31);
    let (n, rows, holonomic, alpha, beta) = (5, [0, 1, 2], 2, 3.0, 7.0);
    let pattern = Pattern::from_rows(n, &vec![(0..n).collect(); rows.len()]);
    for _ in 0..30 {
        let system = Instant::random(&mut rng, n, rows.len(), 10.0);
        let mut random = |count: usize| vector(&mut rng, count);
        let (phi, a, b, v, h) = (random(holonomic), random(3), random(3), random(n), random(n));
        let (mass, c) = (system.mass.data(), system.c.data());
        let x = full::Instant {
            pattern: &pattern,
            rows: &rows,
            holonomic,
            mass,
            h: &h,
            phi: &phi,
            c,
            a: &a,
            b: &b,
            v: &v,
            scales: &[],
        };
        let (mut vdot, mut lambda) = (vec![0.0; n], vec![0.0; 3]);
        let mut rule = baumgarte::Stabilised::new(n, 3, 3, Some((alpha, beta))).unwrap();
        rule.solve(&x, &mut vdot, &mut lambda).unwrap();
        // all in units up to a thousand apart: sums against their terms
        let sums_to_zero = |terms: &[f64]| {
            let (sum, size) = terms.iter().fold((0.0, 0.0), |(s, z), x| (s + x, z + x.abs()));
            assert!(sum.abs() < 1e-10 * size, "{sum:e} of {size:e}");
        };
        let products = |x: &[f64], y: &[f64]| -> Vec<f64> { x.iter().zip(y).map(|(x, y)| x * y).collect() };
        for i in rows {
            let row = &c[i * n..(i + 1) * n];
            let rate = dense::dot(row, &v) + a[i];
            let open = if i < holonomic { phi[i] } else { 0.0 };
            let mut terms = products(row, &vdot);
            terms.extend([b[i], 2.0 * alpha * rate, beta * beta * open]);
            sums_to_zero(&terms);
        }
        for i in 0..n {
            let mut terms = products(&mass[i * n..(i + 1) * n], &vdot);
            terms.push(-h[i]);
            terms.extend((0..3).map(|j| -c[j * n + i] * lambda[j]));
            sums_to_zero(&terms);
        }
    }
}
