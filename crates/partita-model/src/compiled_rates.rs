//! The rates of a choice of coordinates as a program, for the evaluations inside the steps of one run.
//!
//! The same generic code as in plain numbers: where the program applies, it has the bits of the evaluation by levels.

use crate::evaluator::{Evaluator, Scratch};
use crate::model::Model;
use crate::reduced::Reduced;
use partita_math::dense;
use partita_math::scalar::{Cases, Recorder, Recording, Scalar};
use partita_math::tolerance;
use partita_system::choice::Choice;
use partita_system::prelude::*;
use partita_system::SystemError;

/// Pivots of M_d above this are accepted whatever the rounding. Scale: multiples of the least one accepted. Reason: two
/// products that round differently differ by less than 1e-15.
const CLEARLY_ACCEPTED: f64 = 1.0 + 1e-6;

/// Time, coordinates, velocities.
type At<'a> = (Recorder, &'a [Recorder], &'a [Recorder]);

impl Model {
    /// The rates of a choice, numbers given from outside among its inputs; none where elements call functions of the user,
    /// frictions follow reactions, or bodies are massless.
    pub(crate) fn rates_of(&self, choice: &Choice, most: usize) -> Option<Recording> {
        if self.structure().lacks_mass {
            return None;
        }
        let e = self.over::<Recorder>().ok()?;
        let (nq, k) = (self.size().nq, choice.k());
        let inputs = [nq + k + 1, self.own.callers.functions.given_count()];
        let of = |x: &[Recorder]| self.record_rates(&e, choice, (x[nq + k], &x[..nq], &x[nq..nq + k]));
        Recording::of_parts(most, inputs, of).ok()?
    }

    /// q', v_I', power, v', reciprocal pivots, excess.
    fn record_rates(
        &self,
        e: &Evaluator<Recorder>,
        choice: &Choice,
        (t, q, u): At,
    ) -> Result<Vec<Recorder>, SystemError> {
        let (mut s, mut x) = (e.scratch(), Reduced::default());
        let plan = choice.packed.then(|| {
            let mut kept = choice.rows.to_vec();
            kept.sort_unstable();
            self.recursion(&kept)
        });
        if let Some(plan) = &plan {
            e.fit(plan, &mut s);
        }
        e.reduced(choice, plan.as_ref(), t, q, u, &mut s, &mut x)?;
        let mut excess = Recorder::beyond();
        if plan.is_none() {
            if self.uses_dense_mass() {
                project_by_mass(e, choice, (t, q), &mut s, &mut x)?;
            }
            // of the first pivot a number that is not finite tells
            for j in (1..choice.k()).map(|j| j * choice.k() + j) {
                let least = x.md[j].scale(tolerance::LOST_PIVOT * CLEARLY_ACCEPTED);
                excess = excess.max(least - x.factor[j] * x.factor[j]);
            }
        }
        let mut out = vec![Recorder::zero(); self.size().nq];
        e.rate(q, &x.v, &mut out);
        out.extend(choice.independent.iter().map(|&i| x.vdot[i]));
        let moves = self.structure().rheonomic;
        if self.structure().has_power || moves {
            let applied = if self.structure().has_power { e.power(t, q, &x.v, &mut s)? } else { Recorder::zero() };
            out.push(applied + if moves { driving(e, (t, q), &x, &mut s)? } else { Recorder::zero() });
        }
        if moves || plan.is_some() {
            out.extend(&x.vdot);
        }
        let pivot = |i: usize| choice.plan.map_or(Recorder::one(), |plan| plan.reciprocal(&x.factors, i));
        out.extend((0..choice.rows.len()).map(pivot));
        out.push(excess);
        Ok(out)
    }
}

/// Power of the drives, (M v' − h)ᵀ γ.
fn driving(
    e: &Evaluator<Recorder>,
    (t, q): (Recorder, &[Recorder]),
    x: &Reduced<Recorder>,
    s: &mut Scratch<Recorder>,
) -> Result<Recorder, SystemError> {
    let mut residual = vec![Recorder::zero(); x.v.len()];
    e.inverse_dynamics(t, q, &x.v, &x.vdot, s, &mut residual)?;
    Ok(dense::dot(&residual, &x.gamma))
}

/// M_d, h_d and v' by way of a dense M, as where that is cheaper; terms that plain numbers leave out are 0.    (P3)
fn project_by_mass(
    e: &Evaluator<Recorder>,
    choice: &Choice,
    (t, q): (Recorder, &[Recorder]),
    s: &mut Scratch<Recorder>,
    x: &mut Reduced<Recorder>,
) -> Result<(), SystemError> {
    let (n, k) = (x.v.len(), choice.k());
    let (mut mass, mut h) = (vec![Recorder::zero(); n * n], vec![Recorder::zero(); n]);
    e.dynamics(t, q, &x.v, s, &mut mass, &mut h)?;
    x.md.fill(Recorder::zero());
    x.hd.fill(Recorder::zero());
    for i in 0..n {
        let row_of_mass = &mass[i * n..(i + 1) * n];
        let force = h[i] - dense::dot(row_of_mass, &x.delta);
        let mut row = vec![Recorder::zero(); k];
        for (j, &m) in row_of_mass.iter().enumerate() {
            row.iter_mut().zip(&x.dt[j * k..(j + 1) * k]).for_each(|(r, &d)| *r += m * d);
        }
        for (a, &d) in x.dt[i * k..(i + 1) * k].iter().enumerate() {
            x.hd[a] += d * force;
            x.md[a * k..(a + 1) * k].iter_mut().zip(&row).for_each(|(md, &r)| *md += d * r);
        }
    }
    x.factor.copy_from_slice(&x.md);
    dense::cholesky_straight(&mut x.factor, k);
    let mut rates = x.hd.clone();
    dense::cholesky_solve(&x.factor, k, &mut rates);
    choice.full_acceleration(&x.dt, &x.delta, &rates, &mut x.vdot);
    Ok(())
}
