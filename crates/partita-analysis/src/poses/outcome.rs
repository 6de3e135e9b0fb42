//! What became of a pose among thousands.

/// What became of a pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Assembled on the branch.
    Closed,
    /// The loops stay open there.
    Open,
    /// It closes, but not on this branch.
    OtherBranch,
    /// A position where branches meet blocks the path.
    Singular,
    /// The goals contradict each other.
    Contradiction,
}

impl Outcome {
    /// All of them, in the order of their numbers.
    pub const ALL: [Self; 5] = [Self::Closed, Self::Open, Self::OtherBranch, Self::Singular, Self::Contradiction];

    /// In one word, for messages.
    pub fn word(self) -> &'static str {
        match self {
            Self::Closed => "closed",
            Self::Open => "open",
            Self::OtherBranch => "other branch",
            Self::Singular => "singular",
            Self::Contradiction => "contradiction",
        }
    }
}

/// One pose as numbers.
pub(super) struct PoseNumbers {
    pub outcome: Outcome,
    pub shortfall: f64,
    pub angle: f64,
    /// Row, block or goal that is at fault.
    pub culprit: usize,
    pub detour: bool,
}

impl PoseNumbers {
    pub fn closed(detour: bool) -> Self {
        Self { outcome: Outcome::Closed, shortfall: 0.0, angle: 0.0, culprit: 0, detour }
    }
}
