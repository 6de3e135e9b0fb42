//! The work an integration has done.

/// Counted work; exact, so that tests can state it and results can show it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counters {
    /// Steps committed.
    pub steps: u64,
    /// Rejected attempts, whatever the reason.
    pub rejected: u64,
    /// Rejected steps that ended at a point where the right-hand side could not be evaluated.
    pub retries: u64,
    /// Rejected steps that produced a number that is not finite.
    pub not_finite: u64,
    /// Steps taken with an error above the tolerance, where the caller allowed it.
    pub lenient: u64,
    /// Steps whose estimate of the error was above the tolerance, but within its own rounding.
    pub by_rounding: u64,
    /// Calls of the right-hand side for the steps themselves, the start included.
    pub evaluations: u64,
    /// Calls of the right-hand side made only for dense output; not contained in `evaluations`.
    pub dense_evaluations: u64,
    /// Linearisations of the rates, of implicit methods; their evaluations are not contained in `evaluations`, unless they
    /// are differences of the rates.
    pub jacobians: u64,
    /// Of these, those that are differences.
    pub differenced: u64,
    /// Linearisations made only for dense output; not contained in `jacobians`.
    pub dense_jacobians: u64,
    /// Matrices of Newton's method that were factored.
    pub factored: u64,
}

impl std::ops::Add for Counters {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self {
            steps: self.steps + other.steps,
            rejected: self.rejected + other.rejected,
            retries: self.retries + other.retries,
            not_finite: self.not_finite + other.not_finite,
            lenient: self.lenient + other.lenient,
            by_rounding: self.by_rounding + other.by_rounding,
            evaluations: self.evaluations + other.evaluations,
            dense_evaluations: self.dense_evaluations + other.dense_evaluations,
            jacobians: self.jacobians + other.jacobians,
            differenced: self.differenced + other.differenced,
            dense_jacobians: self.dense_jacobians + other.dense_jacobians,
            factored: self.factored + other.factored,
        }
    }
}
