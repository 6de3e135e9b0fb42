//! The levels of a mechanism over any numbers for one choice of coordinates, as the rates ask for them.

use crate::clusters;
use crate::evaluator::{Evaluator, Scratch};
use crate::model::Model;
use partita_math::dense;
use partita_math::scalar::Scalar;
use partita_system::choice::Choice;
use partita_system::error::Result;
use partita_system::prelude::*;
use partita_system::rates::{Evaluation, LevelsOver, MotionOver};
use partita_system::system::{ClusterTangent, Tangent};
use partita_system::Size;

/// A mechanism over the numbers S, with its scratch.
pub struct ChosenLevels<'e, S: Scalar> {
    e: &'e Evaluator<S>,
    pub(crate) s: Scratch<S>,
    sizes: (Size, usize),
    /// The recursion over clusters, where the choice is packed for one.
    plan: Option<clusters::Plan>,
    has_power: bool,
    /// M and h, where M_d is formed from a dense M.
    dense: Option<[Vec<S>; 2]>,
}

impl Model {
    /// The equations of a choice over the numbers of `e`, these equations over other numbers.
    pub fn evaluation<'c, 'e, S: Scalar>(
        &self,
        e: &'e Evaluator<S>,
        choice: Choice<'c>,
    ) -> Evaluation<'c, S, ChosenLevels<'e, S>> {
        let (mut s, n) = (e.scratch(), self.size().nv);
        let plan = choice.packed.then(|| {
            let mut kept = choice.rows.to_vec();
            kept.sort_unstable();
            self.recursion(&kept)
        });
        if let Some(plan) = &plan {
            e.fit(plan, &mut s);
        }
        let dense = (plan.is_none() && self.uses_dense_mass()).then(|| [n * n, n].map(|n| vec![S::zero(); n]));
        let sizes = (self.size(), self.pattern().nnz());
        Evaluation::new(ChosenLevels { e, s, sizes, plan, has_power: self.structure().has_power, dense }, choice)
    }
}

impl<S: Scalar> MotionOver<S> for ChosenLevels<'_, S> {
    fn rate(&self, q: &[S], v: &[S], qdot: &mut [S]) {
        self.e.rate(q, v, qdot);
    }
    fn power(&mut self, t: S, q: &[S], v: &[S]) -> Result<S> {
        match self.has_power {
            true => self.e.power(t, q, v, &mut self.s),
            false => Ok(S::zero()),
        }
    }
    fn inverse_dynamics(&mut self, t: S, q: &[S], v: &[S], vdot: &[S], out: &mut [S]) -> Result<()> {
        self.e.inverse_dynamics(t, q, v, vdot, &mut self.s, out)
    }
}

impl<S: Scalar> LevelsOver<S> for ChosenLevels<'_, S> {
    fn sizes(&self) -> (Size, usize) {
        self.sizes
    }
    fn position(&mut self, t: S, q: &[S], phi: &mut [S], c: &mut [S], a: &mut [S]) -> Result<()> {
        self.e.position(t, q, &mut self.s, phi, c, a)
    }
    fn velocity(&mut self, t: S, q: &[S], v: &[S], b: &mut [S]) -> Result<()> {
        self.e.velocity(t, q, v, &mut self.s, b)
    }
    fn project(&mut self, (t, q, v): (S, &[S], &[S]), tangent: &Tangent<S>, md: &mut [S], hd: &mut [S]) -> Result<()> {
        let &Tangent { k, dt, delta } = tangent;
        let Some([mass, h]) = &mut self.dense else {
            return self.e.project(t, q, v, (k, dt, delta), &mut self.s, md, hd);
        };
        self.e.dynamics(t, q, v, &mut self.s, mass, h)?;
        // as in plain numbers, where terms that are 0 are left out
        md.fill(S::zero());
        hd.fill(S::zero());
        let mut row = vec![S::zero(); k];
        for (i, row_of_mass) in mass.chunks_exact(v.len()).enumerate() {
            let force = h[i] - dense::dot(row_of_mass, delta);
            row.fill(S::zero());
            for (j, &m) in row_of_mass.iter().enumerate() {
                row.iter_mut().zip(&dt[j * k..(j + 1) * k]).for_each(|(r, &d)| *r += m * d);
            }
            for (a, &d) in dt[i * k..(i + 1) * k].iter().enumerate() {
                hd[a] += d * force;
                md[a * k..(a + 1) * k].iter_mut().zip(&row).for_each(|(md, &r)| *md += d * r);
            }
        }
        Ok(())
    }
    fn step(&self, q: &mut [S], dv: &[S]) {
        self.e.step(q, dv);
    }
    fn accelerate(&mut self, (t, q, v): (S, &[S], &[S]), tangent: &ClusterTangent<S>, vdot: &mut [S]) -> Result<()> {
        let plan = self.plan.as_ref().expect("a choice is packed for its recursion");
        self.e.accelerate(t, q, v, plan, tangent, &mut self.s, vdot)
    }
}
