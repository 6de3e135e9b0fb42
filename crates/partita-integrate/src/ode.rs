//! The contract between an equation and the stepper.

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
}
