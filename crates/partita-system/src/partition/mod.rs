//! Which coordinates are independent: the projective criterion, its collective extension and the switch rule; for
//! comparison or special needs also other rules, one file each.

pub mod complete_pivoting;
pub mod criterion;
pub mod determinant;
pub mod geometric;
pub mod geometry;
pub mod individual;
pub mod normalised_determinant;
pub mod persistence;
pub mod split;
pub mod switch;
pub mod volume;

/// Rules that choose the independent coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Selection {
    /// The projective criterion, each choice locked before the next, then switches: P5 and P6.
    #[default]
    Collective,
    /// The projective criterion with lock and repeat alone: P5.
    Greedy,
    /// The k coordinates of largest ρ, one by one. With k > 1 the choice may be impossible.
    Individual,
    /// Largest |det C_D| in the units given, on which it depends.
    Determinant,
    /// Largest normalised determinant (28): the volume of the choice.
    NormalisedDeterminant,
    /// The projective criterion with lock and repeat, in characteristic displacements.
    Geometric,
    /// LU with complete pivoting on C in the units given, on which it depends.
    CompletePivoting,
    /// The choice that remains good longest: largest least volume over a window of the past.
    Persistence,
}

impl Selection {
    /// All rules, the default first.
    pub const ALL: [Self; 8] = [
        Self::Collective,
        Self::Greedy,
        Self::Individual,
        Self::Determinant,
        Self::NormalisedDeterminant,
        Self::Geometric,
        Self::CompletePivoting,
        Self::Persistence,
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Collective => "collective",
            Self::Greedy => "greedy",
            Self::Individual => "individual",
            Self::Determinant => "determinant",
            Self::NormalisedDeterminant => "normalised-determinant",
            Self::Geometric => "geometric",
            Self::CompletePivoting => "complete-pivoting",
            Self::Persistence => "persistence",
        }
    }

    /// The rule of this name.
    pub fn by_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|s| s.name() == name)
    }
}

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
