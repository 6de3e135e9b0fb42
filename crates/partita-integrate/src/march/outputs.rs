//! Outputs of a march at requested times: on the dense output, and next to singular positions.

use super::{is_of_a_position, Adapter, March};
use crate::failure::StepFailure;
use crate::stepper::Stepper;
use partita_system::formulation::Formulation;
use partita_system::record::Output;
use partita_system::SystemError;

/// Receiver of the outputs.
pub type Sink<'s> = &'s mut dyn FnMut(&Output) -> Result<(), SystemError>;

/// Outputs in singular positions are taken from others at this distance. Unit: fraction of the step. Reason: far enough
/// for those to be exact, and so near that the polynomial through them is.
const OUTPUTS_BESIDE: f64 = 1.0 / 80.0;

/// Outputs requested before the end.
pub struct Outputs<'o> {
    t_eval: &'o [f64],
    next: usize,
    sink: Sink<'o>,
}

impl<'o> Outputs<'o> {
    /// At these ascending times, into `sink`.
    pub fn new(t_eval: &'o [f64], sink: Sink<'o>) -> Self {
        Self { t_eval, next: 0, sink }
    }
}

impl March {
    /// The outputs at the current state.
    pub(crate) fn emit<F: Formulation>(
        &mut self,
        formulation: &mut F,
        outputs: &mut Outputs,
    ) -> Result<(), SystemError> {
        while outputs.t_eval.get(outputs.next).is_some_and(|t| *t <= self.t) {
            formulation.state_at(self.t, &self.y, &mut self.output)?;
            (outputs.sink)(&self.output)?;
            outputs.next += 1;
        }
        Ok(())
    }

    /// The output at t inside the step that was concluded; y is memory for a state.
    fn output_at<F: Formulation>(
        &mut self,
        formulation: &mut F,
        t: f64,
        y: &mut [f64],
    ) -> Result<(), StepFailure<SystemError>> {
        let stepper: &mut dyn Stepper<SystemError> = if self.crosses { &mut self.crossing } else { &mut *self.stepper };
        let (from, to) = (stepper.current().t_old, stepper.current().t_new);
        let mut state = |t: f64, out: &mut Output| {
            stepper.interpolate(&mut Adapter(formulation), t, y)?;
            formulation.state_at(t, y, out).map_err(|error| StepFailure::Rhs { t, error })
        };
        let failed = match state(t, &mut self.output) {
            Ok(()) if !self.output.singular => return Ok(()),
            Ok(()) => None,
            Err(StepFailure::Rhs { t, error }) if is_of_a_position(&error) => Some(StepFailure::Rhs { t, error }),
            Err(other) => return Err(other),
        };
        // In a singular position q_D and v_D are quotients 0 / 0, although the motion is smooth: they are taken from
        // the polynomial through three positions on either side, with an error of the sixth power of their distance.
        let apart = ((t - from) / 3.0).min((to - t) / 3.0).min((to - from) * OUTPUTS_BESIDE);
        let (mut side, mut q, mut v, mut work) = (Output::default(), Vec::new(), Vec::new(), 0.0);
        for (i, weight) in [-3.0, -2.0, -1.0, 1.0, 2.0, 3.0].into_iter().zip([1.0, -6.0, 15.0, 15.0, -6.0, 1.0]) {
            if let Err(beside) = state(t + i * apart, &mut side) {
                return Err(failed.unwrap_or(beside));
            }
            q.resize(side.q.len(), 0.0);
            v.resize(side.v.len(), 0.0);
            q.iter_mut().zip(&side.q).for_each(|(to, x)| *to += weight / 20.0 * x);
            v.iter_mut().zip(&side.v).for_each(|(to, x)| *to += weight / 20.0 * x);
            work += weight / 20.0 * side.work;
        }
        self.output.set(t, &q, &v, work);
        (self.output.choice, self.output.singular) = (side.choice, true);
        Ok(())
    }

    pub(super) fn outputs<F: Formulation>(
        &mut self,
        formulation: &mut F,
        outputs: &mut Outputs,
    ) -> Result<(), StepFailure<SystemError>> {
        let end = self.active().current().t_new;
        while let Some(&t) = outputs.t_eval.get(outputs.next).filter(|t| **t <= end) {
            let mut y = std::mem::take(&mut self.buffer);
            let done = self.output_at(formulation, t, &mut y);
            self.buffer = y;
            done?;
            (outputs.sink)(&self.output).map_err(|error| StepFailure::Rhs { t, error })?;
            outputs.next += 1;
        }
        Ok(())
    }
}
