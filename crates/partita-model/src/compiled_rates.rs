//! The rates of a choice of coordinates as a program, for the evaluations inside the steps of one run.
//!
//! The same generic code as in plain numbers: where the program applies, it has the bits of the evaluation by levels.

use crate::evaluator::Evaluator;
use crate::model::Model;
use crate::reduced::Reduced;
use partita_math::program::Program;
use partita_math::scalar::{Cases, Recorder, Recording, Scalar};
use partita_math::tolerance;
use partita_system::choice::Choice;
use partita_system::prelude::*;
use partita_system::SystemError;

/// A pivot of M_d is watched as long as it is this small. Scale: multiples of the least one accepted. Reason: the decision
/// is left to plain numbers where it depends on rounding.
const WATCHED: f64 = 1.0 + 1e-6;

impl Model {
    /// The rates of a choice as a program; none where elements call functions of the user or frictions follow reactions,
    /// and where M_d is formed from a dense M or may lack mass.
    pub(crate) fn rates_of(&self, choice: &Choice) -> Option<Program> {
        if self.uses_dense_mass() || self.lacks_mass() {
            return None;
        }
        let e = self.over::<Recorder>().ok()?;
        let (nq, k) = (self.size().nq, choice.k());
        let made = Recording::new(nq + k + 1, |x| self.record_rates(&e, choice, (x[nq + k], &x[..nq], &x[nq..nq + k])));
        Some(Program::new(&made.ok()?, 0..0))
    }

    /// q', v_I', power, reciprocal pivots, excess.
    fn record_rates(
        &self,
        e: &Evaluator<Recorder>,
        choice: &Choice,
        (t, q, u): (Recorder, &[Recorder], &[Recorder]),
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
        let mut out = vec![Recorder::zero(); self.size().nq];
        e.rate(q, &x.v, &mut out);
        out.extend(choice.independent.iter().map(|&i| x.vdot[i]));
        if self.has_power() {
            out.push(e.power(t, q, &x.v, &mut s)?);
        }
        let pivot = |i: usize| choice.plan.map_or(Recorder::one(), |plan| plan.reciprocal(&x.factors, i));
        out.extend((0..choice.rows.len()).map(pivot));
        let mut excess = Recorder::beyond();
        let k = choice.k();
        // of the first pivot a number that is not finite tells
        for j in (1..k).filter(|_| plan.is_none()) {
            let (entry, root) = (x.md[j * k + j], x.factor[j * k + j]);
            excess = excess.max(entry.scale(tolerance::LOST_PIVOT * WATCHED) - root * root);
        }
        out.push(excess);
        Ok(out)
    }
}
