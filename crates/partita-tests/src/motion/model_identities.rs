//! The compiled equations against each other, on mechanisms drawn by chance.

use crate::mechanisms::{
    accelerations, apart, bodies, derivative, moved, on_random_mechanisms, second_derivative, Moment, Wishes, STEP,
};
use partita_math::dense::{self, Matrix};
use partita_model::{Evaluator, Model};
use partita_system::equations::full::saddle::Saddle;
use partita_system::formulation::motion::{FullState, Projective};
use partita_system::formulation::{Formulation, Purpose};
use partita_system::options::FormulationOptions;
use partita_system::prelude::*;
use partita_system::record::{Correction, Output, Sample};
use partita_system::reduction::Reduction;
use partita_system::start;
use partita_system::system::{project_dense, Tangent};

const SPATIAL: Wishes = Wishes { planar: false, bound: true, drives: true };
const PLANAR: Wishes = Wishes { planar: true, bound: true, drives: true };
const COUNT: usize = 60;

/// Differences of fourth order against derivatives of some tens: see [`crate::mechanisms::STEP`].
const DIFFERENCE: f64 = 1e-8;
/// Sums of some tens of products; matrices of condition 1e4 at the most where one is inverted.
const ROUND_OFF: f64 = 1e-11;

fn everywhere(seed: u64, mut check: impl FnMut(&mut fastrand::Rng, &Model, &Moment)) {
    on_random_mechanisms(seed, COUNT, SPATIAL, &mut check);
    on_random_mechanisms(seed + 1000, COUNT, PLANAR, &mut check);
}

/// Φ, C (dense) and a.
fn position(model: &Model, t: f64, q: &[f64]) -> (Vec<f64>, Matrix, Vec<f64>) {
    let (size, pattern) = (model.size(), model.pattern());
    let (mut phi, mut c, mut a) = (vec![0.0; size.holonomic], vec![0.0; pattern.nnz()], vec![0.0; size.rows]);
    model.position(t, q, &mut model.scratch(), &mut phi, &mut c, &mut a).unwrap();
    let mut dense = Matrix::new(size.rows, size.nv);
    for i in 0..size.rows {
        for e in pattern.row(i) {
            dense[(i, pattern.col_idx[e])] = c[e];
        }
    }
    (phi, dense, a)
}

/// Scratch after `position` and `velocity`, and b.
fn evaluated(
    model: &Model,
    t: f64,
    q: &[f64],
    v: &[f64],
) -> (<Model as partita_system::system::Levels>::Scratch, Vec<f64>) {
    let size = model.size();
    let (mut phi, mut c) = (vec![0.0; size.holonomic], vec![0.0; model.pattern().nnz()]);
    let (mut a, mut b, mut s) = (vec![0.0; size.rows], vec![0.0; size.rows], model.scratch());
    model.position(t, q, &mut s, &mut phi, &mut c, &mut a).unwrap();
    model.velocity(t, q, v, &mut s, &mut b).unwrap();
    (s, b)
}

/// M and h.
fn dynamics(model: &Model, m: &Moment) -> (Matrix, Vec<f64>) {
    let n = model.size().nv;
    let (mut mass, mut h) = (vec![0.0; n * n], vec![0.0; n]);
    let (mut s, _) = evaluated(model, m.t, &m.q, &m.v);
    model.dynamics(m.t, &m.q, &m.v, &mut s, &mut mass, &mut h).unwrap();
    (Matrix::from_vec(n, n, mass), h)
}

fn stepped(model: &Model, q: &[f64], v: &[f64], h: f64) -> Vec<f64> {
    let mut q = q.to_vec();
    model.step(&mut q, &v.iter().map(|v| h * v).collect::<Vec<_>>());
    q
}

#[test]
fn constraint_matrix_is_the_derivative_of_the_constraints() {
    everywhere(1, |rng, model, m| {
        // any direction, not only one that the loops allow
        let v = crate::mechanisms::point(rng, 1.0)
            .into_iter()
            .cycle()
            .zip(0..model.size().nv)
            .map(|(x, i)| x + 0.1 * (i % 7) as f64);
        let v: Vec<f64> = v.collect();
        let (_, c, a) = position(model, m.t, &m.q);
        let along = derivative(STEP, |h| position(model, m.t, &stepped(model, &m.q, &v, h)).0);
        assert!(apart(&along, &c.matvec(&v)) < DIFFERENCE, "{along:?} {:?}", c.matvec(&v));
        let in_time = derivative(STEP, |h| position(model, m.t + h, &m.q).0);
        assert!(apart(&in_time, &a) < DIFFERENCE, "{in_time:?} {a:?}");
    });
}

#[test]
fn bias_is_the_second_derivative_of_the_constraints() {
    everywhere(2, |rng, model, m| {
        // v stays as it is, so the flow is the step itself; any v, also one that opens the loops
        let v: Vec<f64> = m.v.iter().map(|v| v + crate::mechanisms::between(rng, -0.5, 0.5)).collect();
        let (_, b) = evaluated(model, m.t, &m.q, &v);
        let twice = second_derivative(3e-3, |h| position(model, m.t + h, &stepped(model, &m.q, &v, h)).0);
        // h⁴/90 = 1e-12 times a sixth derivative (up to some 1e4), 5 ε/h² = 1e-10
        assert!(apart(&twice, &b) < 1e-7, "{twice:?} {b:?}");
        // d(C v + a)/dt too, as long as the loops stay closed to first order: C leaves out how an open loop is carried
        let (_, b) = evaluated(model, m.t, &m.q, &m.v);
        let rate = derivative(STEP, |h| {
            let (_, c, a) = position(model, m.t + h, &stepped(model, &m.q, &m.v, h));
            c.matvec(&m.v).iter().zip(&a).map(|(x, a)| x + a).collect()
        });
        assert!(apart(&rate, &b) < DIFFERENCE, "{rate:?} {b:?}");
    });
}

/// M by its own pattern is M: what the pattern leaves out is zero, the rest is the same, and so is h.
#[test]
fn sparse_mass_matrix_is_the_mass_matrix() {
    everywhere(12, |_, model, m| {
        let (mass, h) = dynamics(model, m);
        let (n, pattern) = (model.size().nv, model.mass_pattern());
        let (mut values, mut again) = (vec![f64::NAN; pattern.nnz()], vec![f64::NAN; n]);
        let (mut s, _) = evaluated(model, m.t, &m.q, &m.v);
        model.sparse_dynamics(m.t, &m.q, &m.v, &mut s, &mut values, &mut again).unwrap();
        assert_eq!(h, again);
        let mut full = Matrix::new(n, n);
        for i in 0..n {
            pattern.row(i).for_each(|e| full[(i, pattern.col_idx[e])] = values[e]);
        }
        let size = mass.max_abs();
        for e in 0..n * n {
            let off = (full.data()[e] - mass.data()[e]).abs();
            assert!(off <= 1e-14 * size, "entry {e}: {off:e} of {size:e}");
        }
    });
}

#[test]
fn constraints_hold_on_three_levels() {
    everywhere(3, |_, model, m| {
        let (phi, c, a) = position(model, m.t, &m.q);
        let (_, b) = evaluated(model, m.t, &m.q, &m.v);
        assert!(phi.iter().all(|x| x.abs() < 1e-11), "{phi:?}");
        // dropped rows (planar mechanisms drawn with closings that say the same twice) hold with the others
        let rate: Vec<f64> = c.matvec(&m.v).iter().zip(&a).map(|(x, a)| x + a).collect();
        let again: Vec<f64> = c.matvec(&m.vdot).iter().zip(&b).map(|(x, b)| x + b).collect();
        let size = m.v.iter().chain(&m.vdot).chain(&b).fold(1.0, |s: f64, x| s.max(x.abs()));
        assert!(rate.iter().chain(&again).all(|x| x.abs() < 1e-10 * size), "{rate:?} {again:?}");
    });
}

#[test]
fn rate_of_coordinates_is_the_derivative_of_the_step() {
    everywhere(4, |_, model, m| {
        let mut rate = vec![0.0; model.size().nq];
        model.rate(&m.q, &m.v, &mut rate);
        let along = derivative(STEP, |h| stepped(model, &m.q, &m.v, h));
        assert!(apart(&rate, &along) < DIFFERENCE, "{rate:?} {along:?}");
        // a step keeps unit quaternions, and has nothing to do with normalising
        let mut q = stepped(model, &m.q, &m.v, 0.7);
        let before = q.clone();
        model.normalise(&mut q);
        assert!(apart(&q, &before) < 1e-14);
    });
}

#[test]
fn mass_matrix_kinetic_energy_and_inverse_dynamics() {
    everywhere(5, |_, model, m| {
        let n = model.size().nv;
        let (mass, h) = dynamics(model, m);
        let (mut s, _) = evaluated(model, m.t, &m.q, &m.v);
        let size = mass.max_abs().max(1.0);
        // T = ½ vᵀ M v
        let (kinetic, _) = model.energy(m.t, &m.q, &m.v, &s).unwrap();
        let quadratic = 0.5 * dense::dot(&m.v, &mass.matvec(&m.v));
        assert!((kinetic - quadratic).abs() < ROUND_OFF * (1.0 + kinetic), "{kinetic} {quadratic}");
        // columns of M by inverse dynamics, and h by inverse dynamics at rest
        let (mut rest, mut pushed, mut unit) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        model.inverse_dynamics(m.t, &m.q, &m.v, &unit, &mut s, &mut rest).unwrap();
        assert!(apart(&rest.iter().map(|x| -x).collect::<Vec<_>>(), &h) < ROUND_OFF);
        let force = rest.iter().fold(size, |s: f64, x| s.max(x.abs()));
        for j in 0..n {
            unit.fill(0.0);
            unit[j] = 1.0;
            model.inverse_dynamics(m.t, &m.q, &m.v, &unit, &mut s, &mut pushed).unwrap();
            for i in 0..n {
                assert!((pushed[i] - rest[i] - mass[(i, j)]).abs() < ROUND_OFF * force, "entry {i}, {j}");
                assert!((mass[(i, j)] - mass[(j, i)]).abs() < ROUND_OFF * size);
            }
        }
    });
}

#[test]
fn inverse_mass_matrix_by_recursion() {
    everywhere(6, |_, model, m| {
        let n = model.size().nv;
        let (mass, _) = dynamics(model, m);
        let (mut l, mut inverse) = (mass.data().to_vec(), vec![0.0; n * n]);
        dense::cholesky(&mut l, n).unwrap();
        dense::inverse_from_cholesky(&l, n, &mut inverse);
        let (mut s, _) = evaluated(model, m.t, &m.q, &m.v);
        let mut diagonal = vec![0.0; n];
        model.inverse_mass_diagonal(m.t, &m.q, &mut s, &mut diagonal).unwrap();
        // every other column, in falling order
        let which: Vec<usize> = (0..n).rev().step_by(2).collect();
        let mut columns = vec![0.0; n * which.len()];
        model.inverse_mass_columns(m.t, &m.q, &which, &mut s, &mut columns).unwrap();
        for i in 0..n {
            let natural = |j: usize| (inverse[i * n + i] * inverse[j * n + j]).sqrt();
            // massless bodies at the end of long chains: condition up to 1e5
            assert!(
                (diagonal[i] - inverse[i * n + i]).abs() < 1e-9 * natural(i),
                "{} {}",
                diagonal[i],
                inverse[i * n + i]
            );
            for (c, &j) in which.iter().enumerate() {
                assert!((columns[i * which.len() + c] - inverse[i * n + j]).abs() < 1e-9 * natural(j), "{i} {j}");
            }
        }
    });
}

#[test]
fn projection_by_partial_velocities() {
    everywhere(7, |rng, model, m| {
        let n = model.size().nv;
        let (mass, h) = dynamics(model, m);
        let (mut s, _) = evaluated(model, m.t, &m.q, &m.v);
        for k in [1, n.div_ceil(2), n] {
            // any D and any δ
            let dt: Vec<f64> = (0..n * k).map(|_| crate::mechanisms::between(rng, -1.0, 1.0)).collect();
            let delta: Vec<f64> = (0..n).map(|_| crate::mechanisms::between(rng, -1.0, 1.0)).collect();
            let tangent = Tangent { k, dt: &dt, delta: &delta };
            let (mut md, mut hd) = (vec![0.0; k * k], vec![0.0; k]);
            let (mut md2, mut hd2, mut work) = (md.clone(), hd.clone(), vec![0.0; n]);
            model.project(m.t, &m.q, &m.v, &tangent, &mut s, &mut md, &mut hd).unwrap();
            project_dense(mass.data(), &h, &tangent, &mut work, &mut md2, &mut hd2);
            assert!(apart(&md, &md2) < ROUND_OFF && apart(&hd, &hd2) < ROUND_OFF, "k = {k}");
            // the tree's own recursion, also where the dense method is chosen for its lower cost
            let (mut md3, mut hd3) = (vec![0.0; k * k], vec![0.0; k]);
            {
                let (mut s, _) = evaluated(model, m.t, &m.q, &m.v);
                Evaluator::project(
                    model.equations(),
                    m.t,
                    &m.q,
                    &m.v,
                    (k, &dt, &delta),
                    s.equations(),
                    &mut md3,
                    &mut hd3,
                )
                .unwrap();
                assert!(apart(&md, &md3) < ROUND_OFF && apart(&hd, &hd3) < ROUND_OFF, "k = {k}");
            }
        }
    });
}

/// d(T + V)/dt is the power of what has no potential, and −λᵀ a.
#[test]
fn power_balance() {
    let mut driven = 0;
    everywhere(8, |_, model, m| {
        let (mut s, _) = evaluated(model, m.t, &m.q, &m.v);
        let energy = derivative(STEP, |h| {
            let (q, v) = moved(model, m, h);
            let (s, _) = evaluated(model, m.t + h, &q, &v);
            let (t, u) = model.energy(m.t + h, &q, &v, &s).unwrap();
            vec![t + u]
        });
        let (_, _, a) = position(model, m.t, &m.q);
        let power = model.power(m.t, &m.q, &m.v, &mut s).unwrap() - dense::dot(&m.lambda, &a);
        driven += usize::from(model.structure().rheonomic);
        let size = 1.0 + energy[0].abs() + m.vdot.iter().fold(0.0, |s: f64, x| s.max(x.abs()));
        assert!((energy[0] - power).abs() < DIFFERENCE * size, "{} against {power}", energy[0]);
    });
    assert!(driven > 10, "{driven}");
}

/// Accelerations with k equations and with multipliers.
#[test]
fn formulations_agree() {
    everywhere(9, |_, model, m| {
        let none = Correction::None;
        let options = FormulationOptions { correction: none, ..FormulationOptions::default() };
        let mut projective = Projective::new(model, m.rank, &options);
        let mut state = vec![0.0; projective.layout().dim()];
        projective.start(m.t, &m.q, &m.v, &mut state).unwrap();
        let x = sample(&mut projective, m.t, &state);
        let mut multipliers = FullState::new(model, m.rank, Box::new(Saddle::new(model.size().nv, m.rank)), &options);
        let mut state = vec![0.0; multipliers.layout().dim()];
        multipliers.start(m.t, &m.q, &m.v, &mut state).unwrap();
        let y = sample(&mut multipliers, m.t, &state);
        // condition of M (1e5) times round-off
        assert!(apart(&x.vdot, &y.vdot) < 1e-10, "{:e}", apart(&x.vdot, &y.vdot));
        assert!(apart(&x.multipliers, &y.multipliers) < 1e-9, "{:e}", apart(&x.multipliers, &y.multipliers));
        assert!(apart(&x.measure, &y.measure) < 1e-10);
    });
}

/// A planar mechanism computed with three numbers a twist moves as the same one computed with six.
#[test]
fn the_plane_is_a_part_of_space() {
    let mut tilted = 0;
    on_random_mechanisms(10, COUNT, PLANAR, |_, model, m| {
        let space = model.in_space().unwrap();
        assert!(model.is_planar() && !space.is_planar());
        assert_eq!(model.size().nv, space.size().nv);
        tilted += usize::from(model.zero_position().basis.0[2][2] < 0.9);
        let found = start::analyse(&space, m.t, &m.q).unwrap();
        assert_eq!(found.rank, m.rank, "the same degrees of freedom");
        let mut r = Reduction::new(&space, found.rank);
        start::choose_partition(&mut r, m.t, &m.q, None, None).unwrap();
        let speeds: Vec<f64> = r.planned.partition.independent.iter().map(|&i| m.v[i]).collect();
        r.evaluate(m.t, &m.q, &speeds).unwrap();
        let mut other = Moment { v: r.at.v.clone(), ..m.clone() };
        r.full_acceleration(&mut other.vdot);
        assert!(apart(&m.v, &other.v) < 1e-10 && apart(&m.vdot, &other.vdot) < 1e-9, "{:?} {:?}", m.vdot, other.vdot);
        assert!(apart(&accelerations(model, m), &accelerations(&space, &other)) < DIFFERENCE);
        for (x, y) in bodies(model, &m.q, &m.v).iter().zip(&bodies(&space, &m.q, &m.v)) {
            assert!((x.position - y.position).norm() < 1e-12 && (x.velocity - y.velocity).norm() < 1e-12);
        }
    });
    assert!(tilted > COUNT / 2);
}

/// All that a formulation tells about the state y.
fn sample(f: &mut dyn Formulation, t: f64, y: &[f64]) -> Sample {
    let mut output = Output::default();
    f.state_at(t, y, Purpose::Look, &mut output).unwrap();
    Sample::of(f, &output, &[]).unwrap()
}
