//! Maps: where a set of measurements is singular, and how far from that it is.
//!
//! ```text
//! A(q) = [C; Eᵀ],   A w = 0,  ψᵀ A = 0 at a singular position          C closes the loops, E are k measurements
//! σ(q) = least singular value of Êᵀ N,  C N = 0,  NᵀN = 1              zero there, whatever the coordinates
//! dσ   = ψᵀ dA w                                                       smooth where σ is simple
//! ```
//!
//! Three kinds are one function of the position: E of actuators (a motion escapes their efforts), of outputs (a motion
//! leaves them at rest), and no E at all: then σ is the weakest of the constraints. Singular positions of two free
//! goals form curves. The positions within a range are covered by samples first, on all sheets, since sheets meet where
//! measurements are singular; Newton's method leads from them to singular positions, and each curve is followed.

mod cover;
mod measures;
mod slice;
mod trace;

pub use measures::measures;
pub use slice::Set;

use crate::error::AnalysisError;
use crate::outputs::Watch;
use crate::poses::Target;
use partita_model::Model;
use slice::Slice;

/// The positions that are asked for.
#[derive(Clone, Copy, Debug)]
pub struct Range<'a> {
    /// Time of prescribed motions.
    pub t: f64,
    /// Goals.
    pub targets: &'a [Target],
    /// Lower and upper value of each; equal ones hold it.
    pub limits: &'a [[f64; 2]],
    /// Closed positions to begin with, one after the other; the first one is regular.
    pub seeds: &'a [f64],
    /// Whether to stay on the branch of the seeds, on which the goals determine the position.
    pub one_branch: bool,
}

/// How a curve ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CurveEnd {
    /// It returns to its first point.
    Closed,
    /// At the end of the range.
    Range,
    /// At the end of the branch, where the goals are singular.
    Branch,
    /// Positions further on do not close, or the curve has no direction there.
    Limit,
    /// More points than are followed.
    Long,
}

impl CurveEnd {
    /// In one word.
    pub fn word(self) -> &'static str {
        match self {
            Self::Closed => "closed",
            Self::Range => "range",
            Self::Branch => "branch",
            Self::Limit => "limit",
            Self::Long => "long",
        }
    }
}

/// A curve of singular positions, or a single one.
#[derive(Clone, Debug)]
pub struct SingularCurve {
    /// Coordinates, point after point.
    pub q: Vec<f64>,
    /// Values of the goals, likewise.
    pub goals: Vec<f64>,
    /// What remains of the measure at each point.
    pub measure: Vec<f64>,
    /// How it begins and ends; none for a single position.
    pub ends: Option<[CurveEnd; 2]>,
}

/// All that were found.
#[derive(Clone, Debug, Default)]
pub struct Singularities {
    /// Curves and single positions.
    pub curves: Vec<SingularCurve>,
    /// Number of positions that cover the range.
    pub samples: usize,
    /// Whether the range is covered.
    pub complete: bool,
}

/// Singular positions of a set of measurements within a range, on all sheets that are connected with the seeds, or on
/// their branch alone.
///
/// # Errors
/// `Argument` where goals or measurements are too few or too many; errors of functions that the model calls, and of
/// `watch`.
pub fn singularities(model: &Model, range: Range, set: Set, watch: Watch) -> Result<Singularities, AnalysisError> {
    let mut slice = Slice::new(model, range, set)?;
    let cover = cover::cover(&mut slice, range.seeds, watch)?;
    let mut found =
        Singularities { samples: cover.samples.len(), complete: cover.complete, ..Singularities::default() };
    found.curves = trace::traced(&mut slice, &cover.samples, watch)?;
    Ok(found)
}
