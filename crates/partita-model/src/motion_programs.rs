//! The equations of motion of one choice of coordinates as programs, for the members of an ensemble.
//!
//! ```text
//! inputs   t | q | v_I | parameters (settled)
//! rates    q' | v_I' | pivots of C_D                                              (S2, P3)
//! end      q with the remainder of S3 removed | q', v_I' there | v | A | pivots | closure error    (34, P1, P2)
//! output   q with the remainder of S3 removed twice | v | closure error
//! ```
//! The closure error is the sum of all rows of Φ, each in its characteristic displacement.

use crate::error::DescriptionError;
use crate::evaluator::Evaluator;
use crate::model::Model;
use partita_math::program::Program;
use partita_math::scalar::{Recorder, Recording, Scalar};
use partita_system::prelude::*;
use partita_system::reduction::Reduction;
use partita_system::SystemError;

/// A parameter and how many numbers it has.
pub type Varied = (String, usize);

/// The programs of one choice.
#[derive(Clone, Debug)]
pub struct MotionPrograms {
    /// At a state inside a step.
    pub rates: Program,
    /// At the end of a step.
    pub end: Program,
    /// At an output.
    pub output: Program,
    /// Coordinates, velocities, independent velocities, pivots.
    pub sizes: [usize; 4],
}

impl MotionPrograms {
    /// The first output of A of `end`; those of the pivots and the closure error follow.
    pub fn end_a(&self) -> usize {
        let [nq, nv, k, _] = self.sizes;
        2 * nq + k + nv
    }

    /// The first pivot of `end`.
    pub fn end_pivots(&self) -> usize {
        let [_, nv, k, _] = self.sizes;
        self.end_a() + (nv - k) * k
    }

    /// The closure error of `end`.
    pub fn end_closure(&self) -> usize {
        self.end_pivots() + self.sizes[3]
    }
}

/// A failure to record.
fn refused(model: &Model, e: &SystemError) -> DescriptionError {
    DescriptionError::new("mechanism", &model.spec.name, format!("its equations cannot be recorded: {e}"))
}

impl Model {
    /// The programs for the choice of a reduction with D in full, whose rows are all holonomic, with these parameters as
    /// inputs.
    ///
    /// # Errors
    /// As [`over_with`](Self::over_with), and for functions that are known in `f64` alone.
    pub fn motion_programs(
        &self,
        r: &Reduction<Self>,
        parameters: &[Varied],
    ) -> Result<MotionPrograms, DescriptionError> {
        let (size, choice) = (self.size(), r.choice());
        let (nq, k) = (size.nq, choice.k());
        let first = 1 + nq + k;
        let inputs = first + parameters.iter().map(|p| p.1).sum::<usize>();
        type Recorded<'a> = dyn Fn(&Evaluator<Recorder>, Recorder, &mut [Recorder], &[Recorder]) -> Result<Vec<Recorder>, SystemError>
            + 'a;
        let record = |f: &Recorded| {
            let made = Recording::new(inputs, |x| {
                let mut next = first;
                let changes: Vec<(&str, &[Recorder])> = parameters
                    .iter()
                    .map(|(name, count)| {
                        next += count;
                        (name.as_str(), &x[next - count..next])
                    })
                    .collect();
                let e = self.over_with::<Recorder>(&changes)?;
                f(&e, x[0], &mut x[1..1 + nq].to_vec(), &x[1 + nq..first]).map_err(|e| refused(self, &e))
            })?;
            Ok::<_, DescriptionError>(Program::new(&made, first..inputs))
        };
        let inverted = |x: Recorder| Recorder::one() / x;
        Ok(MotionPrograms {
            rates: record(&|e, t, q, u| {
                let (mut x, mut slope) = (self.evaluation(e, choice), vec![Recorder::zero(); nq + k]);
                x.rates(t, q, u, &mut slope)?;
                Ok(slope.into_iter().chain(x.reciprocal_pivots().map(inverted)).collect())
            })?,
            end: record(&|e, t, q, u| {
                e.normalise(q);
                let (mut x, mut slope) = (self.evaluation(e, choice), vec![Recorder::zero(); nq + k]);
                x.correct(t, q)?;
                x.rates(t, q, u, &mut slope)?;
                let a = choice.dependent.iter().flat_map(|&i| &x.dt[i * choice.columns..][..choice.columns]);
                let found = q.iter().chain(&slope).chain(&x.v).chain(a).copied();
                Ok(found.chain(x.reciprocal_pivots().map(inverted)).chain([self.open(&x.phi)]).collect())
            })?,
            output: record(&|e, t, q, u| {
                e.normalise(q);
                let mut x = self.evaluation(e, choice);
                x.correct(t, q)?;
                x.correct(t, q)?;
                e.normalise(q);
                x.levels(t, q, u)?;
                Ok([q.to_vec(), x.v, vec![self.open(&x.phi)]].concat())
            })?,
            sizes: [nq, size.nv, k, choice.rows.len()],
        })
    }

    /// Sum of the rows of Φ, each in its characteristic displacement.
    pub(crate) fn open<S: Scalar>(&self, phi: &[S]) -> S {
        let mut sum = S::zero();
        for (i, x) in phi.iter().enumerate() {
            sum += x.abs().scale(1.0 / self.structure().rows[i].size());
        }
        sum
    }
}
