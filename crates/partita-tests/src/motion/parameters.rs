//! Parameters change without compiling anew, and what depends on them can be differentiated by them.

use crate::mechanisms::{apart, between, compile, derivative, drawing, on_random_mechanisms, Moment, Wishes, STEP};
use partita_math::scalar::{Dual, Scalar};
use partita_model::zero_position::Coordinates;
use partita_model::{Evaluator, Model};
use partita_system::prelude::*;

const KINDS: [Wishes; 2] =
    [Wishes { planar: false, bound: true, drives: true }, Wishes { planar: true, bound: true, drives: true }];
const COUNT: usize = 25;

/// Φ, C, b, M, h, energies and reactions at a state.
fn everything<S: Scalar>(e: &Evaluator<S>, nnz: usize, rows: usize, m: &Moment) -> Vec<S> {
    let lift = |x: &[f64]| x.iter().map(|x| S::from_f64(*x)).collect::<Vec<S>>();
    let (t, q, v, nv) = (S::from_f64(m.t), lift(&m.q), lift(&m.v), m.v.len());
    let memory = |n: usize| vec![S::zero(); n];
    let (mut s, mut phi, mut c, mut a, mut b) = (e.scratch(), memory(rows), memory(nnz), memory(rows), memory(rows));
    let (mut mass, mut h) = (memory(nv * nv), memory(nv));
    e.position(t, &q, &mut s, &mut phi, &mut c, &mut a).unwrap();
    e.velocity(t, &q, &v, &mut s, &mut b).unwrap();
    e.dynamics(t, &q, &v, &mut s, &mut mass, &mut h).unwrap();
    let energies = e.energies(t, &q, &v, &s).unwrap().to_vec();
    let r = e.reactions(t, &q, &v, &lift(&m.vdot), &lift(&m.lambda), &mut s).unwrap();
    let wrenches = r.joints.iter().flat_map(|w| w.force.0.into_iter().chain(w.moment.0)).collect();
    [phi, c, b, mass, h, energies, wrenches].concat()
}

/// A change of every parameter: inertias keep their shape, points of a planar mechanism its plane.
fn along(rng: &mut fastrand::Rng, model: &Model) -> Vec<(String, Vec<f64>, Vec<f64>)> {
    let normal = model.zero_position().basis.0[2];
    let in_plane = |mut x: Vec<f64>| {
        if model.is_planar() {
            let off: f64 = x.iter().zip(normal).map(|(x, n)| x * n).sum();
            x.iter_mut().zip(normal).for_each(|(x, n)| *x -= off * n);
        }
        x
    };
    let random = |rng: &mut fastrand::Rng, n: usize| (0..n).map(|_| between(rng, -1.0, 1.0)).collect::<Vec<f64>>();
    let one = |(name, x): (String, Vec<f64>), rng: &mut fastrand::Rng| {
        let d = match name.rsplit('.').next() {
            Some("inertia") => x.iter().map(|x| 0.3 * x).collect(),
            Some("point") => in_plane(random(rng, x.len())),
            _ => random(rng, x.len()),
        };
        (name, x, d)
    };
    model.parameters().into_iter().map(|p| one(p, rng)).collect()
}

fn moved(model: &Model, along: &[(String, Vec<f64>, Vec<f64>)], h: f64) -> Model {
    let values: Vec<Vec<f64>> =
        along.iter().map(|(_, x, d)| x.iter().zip(d).map(|(x, d)| x + h * d).collect()).collect();
    let changes: Vec<(&str, &[f64])> = along.iter().zip(&values).map(|(a, x)| (a.0.as_str(), &x[..])).collect();
    model.with_parameters(&changes).unwrap()
}

/// The same numbers as a model compiled from the changed description.
#[test]
fn changed_parameters_are_those_of_a_new_model() {
    for (i, wishes) in KINDS.into_iter().enumerate() {
        on_random_mechanisms(41 + i as u64, COUNT, wishes, |rng, model, m| {
            let changed = moved(model, &along(rng, model), 0.02);
            let anew = compile(&changed.spec, Coordinates::Relative).unwrap();
            let (size, nnz) = (model.size(), model.pattern().nnz());
            assert_eq!((anew.size(), anew.pattern()), (size, model.pattern()));
            let (x, y) =
                (everything(changed.equations(), nnz, size.rows, m), everything(anew.equations(), nnz, size.rows, m));
            // sums of some tens of products, with turns recovered from products of rotations
            assert!(apart(&x, &y) < 1e-12, "{:e}", apart(&x, &y));
            assert!(apart(&x, &everything(model.equations(), nnz, size.rows, m)) > 1e-6);
            for i in 0..size.nv {
                assert!((changed.structure().displacement(i) - anew.structure().displacement(i)).abs() < 1e-12);
            }
        });
    }
}

#[test]
fn derivatives_by_parameters_agree_with_differences() {
    for (i, wishes) in KINDS.into_iter().enumerate() {
        on_random_mechanisms(43 + i as u64, COUNT, wishes, |rng, model, m| {
            let (size, nnz) = (model.size(), model.pattern().nnz());
            let all = along(rng, model);
            // all at once, and one at a time
            for part in std::iter::once(&all[..]).chain(all.chunks(1)) {
                let seeds: Vec<Vec<Dual>> =
                    part.iter().map(|(_, x, d)| x.iter().zip(d).map(|(x, d)| Dual::new(*x, [*d])).collect()).collect();
                let changes: Vec<(&str, &[Dual])> =
                    part.iter().zip(&seeds).map(|(a, x)| (a.0.as_str(), &x[..])).collect();
                let dual = everything(&model.over_with(&changes).unwrap(), nnz, size.rows, m);
                let slopes: Vec<f64> = dual.iter().map(|x| x.eps[0]).collect();
                let differences =
                    derivative(STEP, |h| everything(moved(model, part, h).equations(), nnz, size.rows, m));
                assert!(apart(&slopes, &differences) < 1e-6, "{}: {:e}", part[0].0, apart(&slopes, &differences));
            }
        });
    }
}

#[test]
fn parameters_that_cannot_be_are_refused() {
    let mut rng = fastrand::Rng::with_seed(45);
    let model = std::iter::repeat_with(|| drawing(&mut rng, KINDS[1]))
        .find_map(|s| compile(&s, Coordinates::Relative).filter(|m| m.is_planar() && m.cuts().len() == 1))
        .unwrap();
    let refused = |changes: &[(&str, &[f64])]| model.with_parameters(changes).err().unwrap().to_string();
    assert!(refused(&[("body1.colour", &[1.0])]).contains("there is no such parameter"));
    assert!(refused(&[("nobody.mass", &[1.0])]).contains("body1.mass"));
    assert!(refused(&[("body1.mass", &[1.0, 2.0])]).contains("it has 1 numbers, 2 were given"));
    assert!(refused(&[("body1.mass", &[1.0]), ("body1.mass", &[2.0])]).contains("twice"));
    assert!(refused(&[("body1.mass", &[-1.0])]).contains("negative"));
    assert!(refused(&[("gravity", &[0.0, f64::NAN, 0.0])]).contains("not finite"));
    assert!(refused(&[("force0.value", &[0.0; 3])]).contains("no such parameter"), "a function is no parameter");
    assert!(model.with_parameters(&[]).is_ok());
}

/// Threads evaluate one model at the same time, each with its own scratch, and get what one thread gets.
#[test]
fn threads_share_a_model() {
    fn shared<T: Send + Sync>(_: &T) {}
    on_random_mechanisms(46, 5, KINDS[0], |_, model, m| {
        shared(model);
        let (nnz, rows) = (model.pattern().nnz(), model.size().rows);
        let alone = everything(model.equations(), nnz, rows, m);
        std::thread::scope(|scope| {
            let all: Vec<_> = (0..4)
                .map(|_| scope.spawn(|| (0..20).all(|_| everything(model.equations(), nnz, rows, m) == alone)))
                .collect();
            assert!(all.into_iter().all(|t| t.join().unwrap()));
        });
    });
}
