//! The contract between an equation and the stepper.

use partita_system::linear_rates::LinearRates;

/// Why a right-hand side could not be evaluated.
#[derive(Debug, Clone, PartialEq)]
pub enum RhsError<E> {
    /// This point is not evaluable (a singular matrix, a loop that does not close): try again with a shorter step.
    Retry(E),
    /// No shorter step will help: stop at once.
    Fatal(E),
}

/// A system of first-order ordinary differential equations `y' = f(t, y)`.
///
/// The implementer keeps its own scratch; `rhs` must depend on `t` and `y` alone, not on the calls before it, because
/// steps are rejected and repeated.
pub trait Ode {
    /// Error of an evaluation; its `Display` becomes part of the stepper's message.
    type Error: std::fmt::Display;

    /// Number of equations.
    fn dim(&self) -> usize;

    /// Write `f(t, y)` into `dy`; both slices have length [`dim`](Ode::dim). `dy` holds old numbers on entry, and
    /// every entry must be set.
    ///
    /// # Errors
    /// [`RhsError::Retry`] where a shorter step may avoid the point, [`RhsError::Fatal`] otherwise.
    fn rhs(&mut self, t: f64, y: &[f64], dy: &mut [f64]) -> Result<(), RhsError<Self::Error>>;

    /// The rates at (t, y), where they are `dy`, changed to first order; `sizes` are those of the components. By differences
    /// unless the equation can do better.
    ///
    /// # Errors
    /// As [`rhs`](Ode::rhs).
    fn linear_rates(
        &mut self,
        t: f64,
        (y, dy): (&[f64], &[f64]),
        sizes: &[f64],
        out: &mut LinearRates,
    ) -> Result<(), RhsError<Self::Error>> {
        out.by_differences((y.len(), |i| sizes[i]), (y, dy), &mut |y, dy| self.rhs(t, y, dy))
    }
}
