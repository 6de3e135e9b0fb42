//! Every formulation on mechanisms drawn by chance: the same accelerations and reactions, velocities that satisfy the
//! constraints to round-off, every body in balance. (Invariants (a), (b), (g) of any row of the catalogue.)

use crate::mechanisms::{apart, on_random_mechanisms, Moment, Wishes};
use partita_math::dense;
use partita_math::elimination::Pattern;
use partita_model::Model;
use partita_system::formulation::{registry, Depth, Formulation, Purpose};
use partita_system::options::{FormulationOptions, TangentMap};
use partita_system::prelude::*;
use partita_system::record::{Output, Sample};
use partita_system::reduction::Reduction;
use partita_system::{start, SystemError};
use std::collections::BTreeMap;
use std::sync::Arc;

const COUNT: usize = 40;

/// The tangent of a partition at one point, handed over as if the user had written it.
struct AtOnePoint {
    dt: Vec<f64>,
    gamma: Vec<f64>,
    delta: Vec<f64>,
}

impl TangentMap for AtOnePoint {
    fn tangent(&self, _t: f64, _q: &[f64], dt: &mut [f64]) -> Result<(), SystemError> {
        dt.copy_from_slice(&self.dt);
        Ok(())
    }
    fn offset(&self, _t: f64, _q: &[f64], gamma: &mut [f64]) -> Result<(), SystemError> {
        gamma.copy_from_slice(&self.gamma);
        Ok(())
    }
    fn bias(&self, _t: f64, _q: &[f64], _v: &[f64], delta: &mut [f64]) -> Result<bool, SystemError> {
        delta.copy_from_slice(&self.delta);
        Ok(true)
    }
}

fn tangent_at(model: &Model, m: &Moment) -> AtOnePoint {
    let mut r = Reduction::dense(model, m.rank);
    start::choose_partition(&mut r, m.t, &m.q, None, None).unwrap();
    let speeds: Vec<f64> = r.planned.partition.independent.iter().map(|&i| m.v[i]).collect();
    r.evaluate(m.t, &m.q, &speeds).unwrap();
    AtOnePoint { dt: r.at.dt.clone(), gamma: r.at.gamma.clone(), delta: r.at.delta.clone() }
}

/// Cᵀ λ.
fn generalised(pattern: &Pattern, c: &[f64], lambda: &[f64], n: usize) -> Vec<f64> {
    let mut out = vec![0.0; n];
    for i in 0..pattern.rows {
        for e in pattern.row(i) {
            out[pattern.col_idx[e]] += c[e] * lambda[i];
        }
    }
    out
}

fn sample(f: &mut dyn Formulation, m: &Moment) -> Result<Sample, SystemError> {
    let (mut y, mut dy, mut out) = (vec![0.0; f.layout().dim()], vec![0.0; f.layout().dim()], Output::default());
    f.start(m.t, &m.q, &m.v, &mut y)?;
    f.rates(m.t, &y, &mut dy, Depth::Rates)?;
    assert!(dy.iter().all(|x| x.is_finite()));
    f.state_at(m.t, &y, Purpose::Look, &mut out)?;
    Sample::of(f, &out, &[])
}

#[test]
fn all_give_the_same_accelerations_and_reactions() {
    let mut compared: BTreeMap<&str, usize> = BTreeMap::new();
    for (planar, drives) in [(false, false), (true, false), (false, true), (true, true)] {
        let wishes = Wishes { planar, bound: drives, drives };
        on_random_mechanisms(31 + u64::from(planar), COUNT, wishes, |_, model, m| {
            let options = FormulationOptions {
                baumgarte: Some((4.0, 4.0)), // at a closed position there is nothing to stabilise
                tangent: Some(Arc::new(tangent_at(model, m))),
                ..FormulationOptions::default()
            };
            let size = model.size();
            let mut s = model.scratch();
            let (mut phi, mut a) = (vec![0.0; size.holonomic], vec![0.0; size.rows]);
            let mut c = vec![0.0; model.pattern().nnz()];
            model.position(m.t, &m.q, &mut s, &mut phi, &mut c, &mut a).unwrap();
            let reference = generalised(model.pattern(), &c, &m.lambda, size.nv);
            let cut = model.drives().iter().any(|d| d.tree.is_none());
            // a drive of a cut joint has no place in closed forms, which say so
            for &name in registry::NAMES.iter().filter(|n| !(cut && **n == "explicit-closing")) {
                let mut f = registry::by_name(name, model, m.rank, &options).unwrap();
                let out = sample(&mut *f, m).unwrap_or_else(|e| panic!("{name}: {e}"));
                assert_eq!(f.history().name, name);
                // positions may move by the round-off that was left in them, amplified by the weakest constraint
                assert!(apart(&out.q, &m.q) < 1e-11, "{name}");
                let off = apart(&out.vdot, &m.vdot);
                assert!(off < 1e-10, "{name}: v' off by {off:e}");
                let off = apart(&generalised(model.pattern(), &c, &out.multipliers, size.nv), &reference);
                assert!(off < 1e-9, "{name}: reactions off by {off:e}"); // compared with entries of C of order 1
                let rates = dense::dot(&m.v, &m.v).sqrt();
                assert!(out.velocity_closure < 1e-12 * (1.0 + rates), "{name}: {:e}", out.velocity_closure);
                let r = model
                    .equations()
                    .reactions(m.t, &out.q, &out.v, &out.vdot, &out.multipliers, s.equations())
                    .unwrap();
                assert!(r.residual < 1e-9, "{name}: Newton-Euler residual {:e}", r.residual);
                *compared.entry(name).or_default() += 1;
            }
        });
    }
    let least = |name: &str| if name == "explicit-closing" { 4 * COUNT - COUNT / 2 } else { 4 * COUNT };
    assert!(registry::NAMES.iter().all(|name| compared[name] >= least(name)), "{compared:?}");
}
