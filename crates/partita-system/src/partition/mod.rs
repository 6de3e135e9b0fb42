//! Which coordinates are independent: the projective criterion, its collective extension and the exchange rule.

pub mod criterion;
pub mod exchange;

/// A choice of independent velocities, dependent velocities and constraint rows that determine them.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
pub struct Partition {
    /// I: k velocities, ascending.
    pub independent: Vec<usize>,
    /// D: r velocities in elimination order.
    pub dependent: Vec<usize>,
    /// The r rows kept, in elimination order.
    pub rows: Vec<usize>,
}
