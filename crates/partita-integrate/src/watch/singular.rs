//! Singular positions that a step passed although it was not made for them.                                      (X2)

use super::{singular_times, Look, StepView, Watch};
use crate::failure::StepFailure;
use partita_system::formulation::Repeated;
use partita_system::SystemError;

/// The singular positions within ordinary steps. Those across one are located as they are attempted.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SingularWatch;

impl Watch for SingularWatch {
    /// They are located on the dense output. A step is repeated that was not to pass them, or that came near to one where it
    /// was to end farther away.
    fn look(&mut self, step: &mut StepView) -> Result<Look, StepFailure<SystemError>> {
        let Some(passing) = step.end.passing.filter(|_| !step.crosses()) else { return Ok(Look::Clear) };
        let nearest = step.locate(passing.rate);
        if !step.may_end_earlier() {
            return Ok(Look::Clear);
        }
        Ok(match (nearest, step.located.times.is_empty()) {
            (Some(nearest), true) if nearest < passing.near => Look::Repeat(Some(Repeated::Near)),
            (Some(_), false) if passing.repeats => Look::Repeat(Some(Repeated::Passed)),
            _ => Look::Clear,
        })
    }
}

impl StepView<'_> {
    /// Locate the singular positions on the dense output; distances from one fall by `rate` per second at the most. The least
    /// distance that was found, none if sides cannot be compared.
    fn locate(&mut self, rate: f64) -> Option<f64> {
        let ends = self.ends();
        let mut times = std::mem::take(&mut self.located.times);
        let mut side = |t: f64| {
            self.interpolate(t).ok()?;
            self.formulation.point().side(t, self.state)
        };
        let found = singular_times::find(ends, rate, &mut side, &mut times);
        self.located.times = times;
        self.located.note(found);
        found
    }
}
