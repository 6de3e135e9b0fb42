//! Outputs of a march at requested times: on the dense output, and next to singular positions.

use super::March;
use crate::adapter::{is_of_a_position, Adapter};
use crate::failure::StepFailure;
use crate::stepper::Stepper;
use crate::watch::Zero;
use partita_math::tolerance;
use partita_system::event::Occurrence;
use partita_system::formulation::{Course, Formulation, Purpose};
use partita_system::record::Output;
use partita_system::SystemError;

/// Receiver of the outputs.
pub type Sink<'s> = &'s mut dyn FnMut(&Output) -> Result<(), SystemError>;

/// Outputs in singular positions are taken from others at this distance. Unit: fraction of the step. Reason: far enough
/// for those to be exact, and so near that the polynomial through them is.
pub(super) const OUTPUTS_BESIDE: f64 = 1.0 / 80.0;
/// Places of those others on both sides. Unit: multiples of that distance. Reason: the polynomial through six is exact to
/// the sixth power of it.
const PLACES_BESIDE: [f64; 6] = [-3.0, -2.0, -1.0, 1.0, 2.0, 3.0];

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

    /// One more, unless it is the last one already.
    pub(super) fn end_with(&mut self, last: &Output) -> Result<(), SystemError> {
        match self.next.checked_sub(1).is_some_and(|i| self.t_eval[i] == last.t) {
            true => Ok(()),
            false => (self.sink)(last),
        }
    }
}

impl March {
    /// The outputs at the current state.
    pub(crate) fn emit(&mut self, formulation: &mut dyn Formulation, outputs: &mut Outputs) -> Result<(), SystemError> {
        while outputs.t_eval.get(outputs.next).is_some_and(|t| *t <= self.t) {
            formulation.state_at(self.t, &self.y, Purpose::Keep, &mut self.output)?;
            (outputs.sink)(&self.output)?;
            outputs.next += 1;
        }
        Ok(())
    }

    /// The output at t inside the step that was concluded; y is memory for a state.
    pub(super) fn output_at(
        &mut self,
        formulation: &mut dyn Formulation,
        t: f64,
        y: &mut [f64],
    ) -> Result<(), StepFailure<SystemError>> {
        let stepper: &mut dyn Stepper<SystemError> = match self.course {
            Course::Across => &mut self.crossing,
            Course::Along => &mut *self.stepper,
        };
        let (from, to) = (stepper.current().t_old, stepper.current().t_new);
        let mut state = |t: f64, out: &mut Output| {
            stepper.interpolate(&mut Adapter::new(formulation), t, y)?;
            formulation.state_at(t, y, Purpose::Keep, out).map_err(|error| StepFailure::Rhs { t, error })
        };
        let beside = (to - from) * OUTPUTS_BESIDE;
        let near = self.located.times.iter().copied().find(|zero| (t - zero).abs() < beside);
        let failed = match state(t, &mut self.output) {
            Ok(()) if !self.output.singular && near.is_none() => return Ok(()),
            Ok(()) => None,
            Err(StepFailure::Rhs { t, error }) if is_of_a_position(&error) || (near.is_some() && error.is_local()) => {
                Some(StepFailure::Rhs { t, error })
            }
            Err(other) => return Err(other),
        };
        // In a singular position q_D and v_D are quotients 0 / 0, and next to it what is off is divided by the distance,
        // although the motion is smooth: they are taken from the polynomial through three positions on either side, with
        // an error of the sixth power of their distance.
        let singular = failed.is_some() || self.output.singular;
        let centre = near.filter(|zero| *zero - beside > from && zero + beside < to).unwrap_or(t);
        let apart = ((centre - from) / 3.0).min((to - centre) / 3.0).min(beside);
        let at = (t - centre) / apart.max(f64::MIN_POSITIVE);
        let (mut side, mut q, mut v, mut work) = (Output::default(), Vec::new(), Vec::new(), 0.0);
        let direct = (!singular).then(|| self.output.clone());
        for i in PLACES_BESIDE {
            if let Err(beside) = state(centre + i * apart, &mut side) {
                return Err(failed.unwrap_or(beside));
            }
            let weight = |m: f64, j: f64| if j == i { m } else { m * (at - j) / (i - j) };
            let weight = PLACES_BESIDE.into_iter().fold(1.0, weight);
            q.resize(side.q.len(), 0.0);
            v.resize(side.v.len(), 0.0);
            q.iter_mut().zip(&side.q).for_each(|(to, x)| *to += weight * x);
            v.iter_mut().zip(&side.v).for_each(|(to, x)| *to += weight * x);
            work += weight * side.work;
        }
        self.output.set(t, &q, &v, work);
        (self.output.choice, self.output.basis, self.output.singular) = (side.choice, side.basis, singular);
        // A motion that passes at a distance which is small beside those places bends between them: no polynomial
        // through them is closed.
        let closed = (tolerance::CLOSED_IN_RUN, tolerance::WORST_ROUNDING);
        let within = direct.as_ref().map_or((f64::INFINITY, f64::INFINITY), |_| closed);
        let accepted =
            formulation.point().accept_output(&self.output, within).map_err(|error| StepFailure::Rhs { t, error })?;
        if let Some(direct) = direct.filter(|_| !accepted) {
            self.output = direct;
        }
        Ok(())
    }

    /// The states at the events of the concluded step.
    pub(super) fn occurrences(&mut self, formulation: &mut dyn Formulation) -> Result<(), StepFailure<SystemError>> {
        let Some(mut events) = self.watches.events.take() else { return Ok(()) };
        let mut y = std::mem::take(&mut self.buffer);
        let mut found = Vec::with_capacity(events.zeros().len());
        let mut done = Ok(());
        for &Zero { t, event, rises } in events.zeros() {
            done = self.output_at(formulation, t, &mut y);
            if done.is_err() {
                break;
            }
            found.push(Occurrence { event, rises, state: self.output.clone() });
        }
        if done.is_ok() {
            found.into_iter().for_each(|x| events.report(x));
        }
        (self.buffer, self.watches.events) = (y, Some(events));
        done
    }

    pub(super) fn outputs(
        &mut self,
        formulation: &mut dyn Formulation,
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
