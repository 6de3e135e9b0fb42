//! The arithmetic of one evaluation, counted: all coordinates integrated, or the dependent ones computed.
//!
//! The operations are recorded: equal ones count once, those without influence on the rates not at all. What a run does
//! besides (checks, predictions, moving of numbers) is not arithmetic and is not counted.

use crate::model::Model;
use partita_math::scalar::{OperationCounts, Recorder, Recording, Scalar};
use partita_system::closing::Closing;
use partita_system::prelude::*;
use partita_system::reduction::Reduction;
use partita_system::SystemError;

/// What is recorded of t, q and v_I.
type Recorded<'a> = dyn Fn(Recorder, &mut [Recorder], &[Recorder]) -> Result<Vec<Recorder>, SystemError> + 'a;

/// Operations of one evaluation of the rates.
#[derive(Clone, Copy, Debug, Default)]
pub struct EvaluationCounts {
    /// Of all coordinates and the independent velocities.
    pub projective: OperationCounts,
    /// Of the independent coordinates and velocities, the dependent coordinates by inverse kinematics.
    pub explicit_closing: OperationCounts,
    /// One iteration of Newton's method for the dependent coordinates.                                         (34)
    pub iteration: OperationCounts,
}

impl Model {
    /// Operations of one evaluation at the closed (t, q), with these input velocities or those that order the most
    /// loops.
    ///
    /// # Errors
    /// Where explicit closing does not apply or leaves a block to Newton's method, and for functions that are known in
    /// `f64` alone.
    pub fn evaluation_counts(
        &self,
        t: f64,
        q: &[f64],
        inputs: Option<&[usize]>,
    ) -> Result<EvaluationCounts, SystemError> {
        let closing = self.loop_closing(t, q, inputs)?;
        if let Some(block) = closing.blocks().iter().find(|b| !b.explicit) {
            let message = format!("{} has no closed form: how often it iterates depends on its start", block.words);
            return Err(SystemError::argument("inputs", message));
        }
        let independent = closing.inputs().to_vec();
        let (nq, k) = (self.size().nq, independent.len());
        let mut r = Reduction::dense(self, self.size().nv - k);
        r.position(t, q)?;
        r.refresh_scales(t, q)?;
        r.set_partition(t, &independent)?;
        let choice = r.choice();
        let e = self.over::<Recorder>().map_err(|e| SystemError::argument("mechanism", e.to_string()))?;
        // t, q, v_I
        let count = |f: &Recorded| {
            let made = Recording::new(1 + nq + k, |x| f(x[0], &mut x[1..=nq].to_vec(), &x[1 + nq..]))?;
            Ok::<_, SystemError>(made.lean().counts())
        };
        // q' and v_I'
        let rates = |t: Recorder, q: &[Recorder], u: &[Recorder]| -> Result<Vec<Recorder>, SystemError> {
            let mut out = vec![Recorder::zero(); nq + k];
            self.evaluation(&e, choice).rates(t, q, u, &mut out)?;
            Ok(out)
        };
        Ok(EvaluationCounts {
            projective: count(&|t, q, u| rates(t, q, u))?,
            explicit_closing: count(&|t, q, u| {
                let excess = closing.close_over(&e, t, q, &mut closing.scratch_over(&e))?;
                let found = rates(t, q, u)?;
                let states = independent.iter().flat_map(|&i| self.structure().coordinates_of(i)).map(|c| found[c]);
                Ok(states.chain(found[nq..].iter().copied()).chain([excess]).collect())
            })?,
            // q_D − C_D⁻¹ Φ                                                               (34)
            iteration: count(&|t, q, _| {
                self.evaluation(&e, choice).correct(t, q)?;
                Ok(choice.dependent.iter().flat_map(|&i| self.structure().coordinates_of(i)).map(|c| q[c]).collect())
            })?,
        })
    }
}
