//! The rates of a choice of coordinates as a program, for the evaluations inside the steps of one run.
//!
//! The same generic code as in plain numbers: where the program applies, it has the bits of the evaluation by levels.

use crate::evaluator::Evaluator;
use crate::model::Model;
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
        let mut x = self.evaluation(e, *choice);
        let (moves, k) = (self.structure().rheonomic, choice.k());
        let mut out = vec![Recorder::zero(); self.size().nq + k + usize::from(self.structure().has_power || moves)];
        x.rates(t, q, u, &mut out)?;
        if moves || choice.packed {
            out.extend(&x.vdot);
        }
        out.extend(x.reciprocal_pivots());
        let mut excess = Recorder::beyond();
        // of the first pivot of M_d a number that is not finite tells
        for (md, factor) in x.md.iter().zip(&x.md_factor).step_by(k + 1).skip(1) {
            excess = excess.max(md.scale(tolerance::LOST_PIVOT * CLEARLY_ACCEPTED) - *factor * *factor);
        }
        out.push(excess);
        Ok(out)
    }
}
