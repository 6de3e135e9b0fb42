//! Inverse kinematics of loops over every scalar: derivatives by inputs, time and lengths, eight closings at once, and a
//! recording of a closing.

use crate::mechanisms::{
    apart, between, couple, derivative, drawing, on_coupled_mechanisms, on_random_mechanisms, Moment, Wishes, STEP,
};
use partita_math::scalar::{Dual, Lanes, Recorder, Recording, Scalar};
use partita_model::loop_closure::LoopClosing;
use partita_model::spec::{Force, Value, VectorValue};
use partita_model::value::NoFunctions;
use partita_model::zero_position::Coordinates;
use partita_model::{Evaluator, Model};
use partita_system::closing::Closing;
use partita_system::prelude::*;
use std::sync::Arc;

const KINDS: [Wishes; 2] =
    [Wishes { planar: false, bound: true, drives: true }, Wishes { planar: true, bound: true, drives: true }];
const COUNT: usize = 30;
/// Couplings of positions that need no function: gears, a curve, a distance, a displacement.
const COUPLED: [usize; 5] = [0, 1, 2, 4, 5];
/// Blocks with pivots above this lose one digit, and a derivative two.
const HEALTHY: f64 = 0.1;

fn closed_over<S: Scalar>(c: &LoopClosing, e: &Evaluator<S>, t: S, q: &[S]) -> (Vec<S>, S) {
    let mut q = q.to_vec();
    let excess = c.close_over(e, t, &mut q, &mut c.scratch_over(e)).unwrap();
    (q, excess)
}

/// Closings of random mechanisms that stand well, with a direction for their inputs: q and q' of the input velocities.
fn everywhere(seed: u64, mut check: impl FnMut(&mut fastrand::Rng, &Model, &Moment, &mut LoopClosing, &[f64], &[f64])) {
    for (i, wishes) in KINDS.into_iter().enumerate() {
        let (mut explicit, mut implicit) = (0, 0);
        let mut see = |rng: &mut fastrand::Rng, model: &Model, m: &Moment| {
            if model.equations().full.conditions.iter().any(|c| !c.holonomic) {
                return; // angles of two cut joints without a common period: their rates alone are held
            }
            let mut closing = model.loop_closing(m.t, &m.q, None).unwrap();
            let mut q = m.q.clone();
            if closing.close(m.t, &mut q).is_err() || closing.state().iter().any(|s| s.pivot < HEALTHY) {
                return;
            }
            let mut dv = vec![0.0; model.size().nv];
            for &i in closing.inputs() {
                dv[i] = between(rng, -1.0, 1.0);
            }
            let (here, mut along) = (q.clone(), q.clone());
            partita_system::system::Manifold::rate(model, &here, &dv, &mut along);
            *if closing.is_explicit() { &mut explicit } else { &mut implicit } += 1;
            check(rng, model, m, &mut closing, &here, &along);
        };
        on_random_mechanisms(seed + i as u64, COUNT, wishes, &mut see);
        on_coupled_mechanisms(seed + i as u64, COUNT / 2, wishes, &COUPLED, &mut see);
        // the right inputs leave dyads in the plane
        let enough = explicit > COUNT / 6 && (wishes.planar || implicit > COUNT / 6);
        assert!(enough, "{explicit} explicit, {implicit} implicit");
    }
}

fn shifted(q: &[f64], along: &[f64], h: f64) -> Vec<f64> {
    q.iter().zip(along).map(|(q, d)| q + h * d).collect()
}

#[test]
fn derivatives_by_inputs_and_time() {
    everywhere(81, |_, model, m, closing, q, along| {
        let dual = model.over::<Dual>().unwrap();
        let seed: Vec<Dual> = q.iter().zip(along).map(|(q, d)| Dual::new(*q, [*d])).collect();
        let (found, excess) = closed_over(closing, &dual, Dual::new(m.t, [0.7]), &seed);
        assert!(excess.re <= 0.0);
        let slopes: Vec<f64> = found.iter().map(|x| x.eps[0]).collect();
        // next to a limit position of the closing fifth derivatives are a hundred times as large: of 1e-6 a step three times
        // as short leaves 1e-8
        let differences = derivative(STEP / 3.0, |h| {
            // the closing remembers the joints that are cut
            closing.close(m.t, &mut q.to_vec()).unwrap();
            let mut there = shifted(q, along, h);
            closing.close(m.t + 0.7 * h, &mut there).unwrap();
            there
        });
        assert!(apart(&slopes, &differences) < 1e-6, "{:e}", apart(&slopes, &differences));
    });
}

/// Closed for all lengths: Φ stays 0 to the first order.
#[test]
fn derivatives_by_lengths() {
    everywhere(83, |rng, model, m, closing, q, along| {
        let points: Vec<(String, Vec<Dual>)> = model
            .parameters()
            .into_iter()
            .filter(|(name, _)| name.ends_with(".point") && name.starts_with("joint"))
            .map(|(name, x)| {
                let mut d: Vec<f64> = x.iter().map(|_| between(rng, -0.3, 0.3)).collect();
                if model.is_planar() {
                    let off: f64 = d.iter().zip(model.zero_position().basis.0[2]).map(|(d, n)| d * n).sum();
                    d.iter_mut().zip(model.zero_position().basis.0[2]).for_each(|(d, n)| *d -= off * n);
                }
                (name, x.iter().zip(d).map(|(x, d)| Dual::new(*x, [d])).collect())
            })
            .collect();
        let changes: Vec<(&str, &[Dual])> = points.iter().map(|(n, x)| (n.as_str(), &x[..])).collect();
        let dual = model.over_with(&changes).unwrap();
        let seed: Vec<Dual> = q.iter().zip(along).map(|(q, d)| Dual::new(*q, [*d])).collect();
        let t = Dual::new(m.t, [0.3]);
        let (found, excess) = closed_over(closing, &dual, t, &seed);
        // lengths recovered with their own round-off may miss a redundant condition by as much
        assert!(excess.re <= 0.0);
        let (size, mut s) = (model.size(), dual.scratch());
        let memory = |n: usize| vec![Dual::zero(); n];
        let (mut phi, mut c, mut a) = (memory(size.rows), memory(model.pattern().nnz()), memory(size.rows));
        dual.position(t, &found, &mut s, &mut phi, &mut c, &mut a).unwrap();
        let most = found.iter().fold(1.0, |m: f64, x| m.max(x.eps[0].abs()));
        for x in phi {
            assert!(x.re.abs() < 1e-11 && x.eps[0].abs() < 1e-9 * most, "{x:?}");
        }
    });
}

#[test]
fn eight_closings_at_once() {
    everywhere(85, |_, model, m, closing, q, along| {
        let at: Vec<Vec<f64>> = (0..Lanes::COUNT).map(|l| shifted(q, along, 2e-3 * l as f64)).collect();
        let input: Vec<Lanes> = (0..q.len()).map(|i| Lanes::from_fn(|l| at[l][i])).collect();
        let lanes = model.over::<Lanes>().unwrap();
        let (together, excess) = closed_over(closing, &lanes, Lanes::from_f64(m.t), &input);
        for (l, q) in at.iter().enumerate() {
            let (single, own) = closed_over(closing, model.equations(), m.t, q);
            assert!(single.iter().zip(&together).all(|(x, y)| x.to_bits() == y.0[l].to_bits()));
            assert_eq!(own.to_bits(), excess.0[l].to_bits());
            // and what the closing itself finds
            let mut other = q.clone();
            let mut open = 0.0;
            if own <= 0.0 && closing.close(m.t, &mut other).is_ok() {
                open = apart(&single, &other);
            }
            assert!(open < 1e-10, "{open:e}");
        }
    });
}

#[test]
fn a_recorded_closing() {
    let mut rng = fastrand::Rng::with_seed(87);
    let mut done = 0;
    while done < COUNT {
        let mut spec = drawing(&mut rng, KINDS[done % 2]);
        if done % 3 == 0 && !couple(&mut rng, &mut spec, KINDS[done % 2].planar, COUPLED[done % 5]) {
            continue;
        }
        let plain = |v: &mut Value| *v = Value::Constant(0.2);
        spec.drives.iter_mut().for_each(|d| plain(&mut d.motion));
        for f in &mut spec.forces {
            match f {
                Force::Torque(x) => plain(&mut x.value),
                Force::Force(x) => x.value = VectorValue::Whole(Value::Constant(1.0)),
                _ => {}
            }
        }
        let Ok(model) = Model::new(spec, Arc::new(NoFunctions), Coordinates::Relative) else { continue };
        let Some(m) = Moment::random(&mut rng, &model) else { continue };
        let Ok(closing) = model.loop_closing(m.t, &m.q, None) else { continue };
        let recorder = model.over::<Recorder>().unwrap();
        let made = Recording::new(m.q.len(), |q: &[Recorder]| {
            let (mut q, excess) = closed_over(&closing, &recorder, Recorder::from_f64(m.t), q);
            q.push(excess);
            Ok::<_, ()>(q)
        })
        .unwrap();
        let (mut work, mut out) = (vec![0.0; made.len()], vec![0.0; made.outputs()]);
        for _ in 0..3 {
            let q: Vec<f64> = m.q.iter().map(|q| q + between(&mut rng, -1e-2, 1e-2)).collect();
            let (mut expected, excess) = closed_over(&closing, model.equations(), m.t, &q);
            expected.push(excess);
            made.evaluate(&q, &mut work, &mut out);
            assert!(expected.iter().zip(&out).all(|(x, y)| x.to_bits() == y.to_bits() || x.is_nan() && y.is_nan()));
        }
        done += 1;
    }
}

#[test]
fn a_closing_belongs_to_its_model() {
    on_random_mechanisms(88, 2, KINDS[1], |_, model, m| {
        let closing = model.loop_closing(m.t, &m.q, None).unwrap();
        let other = model.with_parameters(&[]).unwrap();
        let mut memory = closing.scratch_over(other.equations());
        let refused = closing.close_over(other.equations(), m.t, &mut m.q.clone(), &mut memory).unwrap_err();
        assert!(refused.to_string().contains("different models"));
    });
}
