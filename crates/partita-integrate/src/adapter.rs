//! A formulation as the equation of a stepper.

use crate::ode::{Ode, RhsError};
use partita_system::formulation::{Depth, Formulation};
use partita_system::linear_rates::LinearRates;
use partita_system::SystemError;

/// What is done after an evaluation at a time; returns what has to be known after the next one.
pub(crate) type After<'a> = &'a mut dyn FnMut(f64, &mut dyn Formulation) -> Depth;

/// A formulation as the equation of a stepper.
pub(crate) struct Adapter<'f> {
    pub(crate) formulation: &'f mut dyn Formulation,
    /// What has to be known after an evaluation.
    pub(crate) depth: Depth,
    pub(crate) after: Option<After<'f>>,
    /// Receives why a point could not be evaluated, where a shorter step is tried.
    pub(crate) reason: Option<&'f mut Option<String>>,
}

impl<'f> Adapter<'f> {
    pub(crate) fn new(formulation: &'f mut dyn Formulation) -> Self {
        Self { formulation, depth: Depth::Rates, after: None, reason: None }
    }
}

impl Ode for Adapter<'_> {
    type Error = SystemError;
    fn dim(&self) -> usize {
        self.formulation.layout().dim()
    }
    #[inline]
    fn rhs(&mut self, t: f64, y: &[f64], dy: &mut [f64]) -> Result<(), RhsError<SystemError>> {
        if let Err(e) = self.formulation.rates(t, y, dy, self.depth) {
            // of a position another message tells what to do
            if let Some(reason) = self.reason.as_mut().filter(|_| !is_of_a_position(&e)) {
                **reason = Some(e.to_string());
            }
            return Err(sorted(e));
        }
        if let Some(after) = &mut self.after {
            self.depth = after(t, self.formulation);
        }
        Ok(())
    }
    fn linear_rates(
        &mut self,
        t: f64,
        (y, _): (&[f64], &[f64]),
        _sizes: &[f64],
        out: &mut LinearRates,
    ) -> Result<(), RhsError<SystemError>> {
        self.formulation.linear_rates(t, y, out).map_err(sorted)
    }
}

/// Whether a shorter step may help.
pub(crate) fn sorted(e: SystemError) -> RhsError<SystemError> {
    if e.is_local() {
        RhsError::Retry(e)
    } else {
        RhsError::Fatal(e)
    }
}

/// Whether the failure is due to a position rather than a function.
pub(crate) fn is_of_a_position(e: &SystemError) -> bool {
    matches!(
        e,
        SystemError::Singular { .. }
            | SystemError::DeadPoint { .. }
            | SystemError::Limit { .. }
            | SystemError::Crossing { .. }
    )
}
