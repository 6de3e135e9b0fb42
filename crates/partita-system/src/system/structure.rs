//! The structure of a system: what is the same at every time and position, computed once.

use super::Size;
use crate::clusters::Clusters;
use partita_math::elimination::Pattern;
use std::ops::Range;
use std::sync::Arc;

/// What a system is at every time and position.
#[derive(Clone, Debug)]
pub struct Structure {
    /// Sizes.
    pub size: Size,
    /// Sparsity of C (rows x nv).
    pub pattern: Pattern,
    /// Blocks of velocities and rows connected through C.
    pub clusters: Clusters,
    /// Coordinates q.
    pub coordinates: Vec<Coordinate>,
    /// Velocities v.
    pub velocities: Vec<Velocity>,
    /// Rows of S4, holonomic ones first.
    pub rows: Vec<Row>,
    /// Whether any row depends on time (a ≠ 0).
    pub rheonomic: bool,
    /// Whether the work of non-conservative forces is accumulated.
    pub has_power: bool,
    /// Whether M is singular because bodies are massless, so that it is not a metric. Then a metric exists beside it:
    /// [`add_metric`](super::Metric::add_metric) adds the difference, and `[M⁻¹]_ii` and columns of `M⁻¹` are those of
    /// the metric. Equations of motion use M.
    pub lacks_mass: bool,
    /// How many numbers are given from outside; inputs of the recorded rates.
    pub given_count: usize,
    /// The decision about its drawing.
    pub drawing: Verdict,
}

/// A coordinate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Coordinate {
    /// The velocity whose integral it is, if there is one.
    pub velocity: Option<usize>,
    /// Whether it is an angle from which whole turns may be removed without changing S1-S5.
    pub turns: bool,
    /// Whether it is an angle after a whole turn of which all forces and conditions are the same again. Energies may
    /// differ: a constant torque has done work.
    pub repeats: bool,
}

/// A velocity.
#[derive(Clone, Debug, PartialEq)]
pub struct Velocity {
    /// Its name.
    pub name: Arc<str>,
    /// The coordinates that it changes: its own integral, or the whole quaternion of a spatial rotation.
    pub coordinates: Range<usize>,
    /// Characteristic displacement: a typical magnitude of a large displacement (1 for an angle, a length for a
    /// translation).
    pub displacement: f64,
}

/// A constraint row.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Its name.
    pub name: Arc<str>,
    /// Its origin, in words.
    pub description: Arc<str>,
    /// The element to which it belongs, in words.
    pub owner: Arc<str>,
    /// Closure error under a large displacement (1 for an angle, a length for a displacement), if the system knows it: a
    /// row whose entries are all small compared with it cannot be closed, which no comparison with other rows shows.
    pub displacement: Option<f64>,
    /// Whether it constrains a direction (rad), not a length.
    pub is_angle: bool,
    /// Whether it prescribes a motion. Such rows are kept after all others: loop closures are not a matter of choice.
    pub is_drive: bool,
    /// Whether it may be discontinuous in its position. Loop closures cannot.
    pub may_jump: bool,
}

impl Row {
    /// Its closure error under a large displacement; 1 where the system does not know it.
    pub fn size(&self) -> f64 {
        self.displacement.unwrap_or(1.0)
    }
}

/// The decision about a drawing, for all positions.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// The verdict on rank, if one was made for all positions; otherwise each position is analysed.
    pub finite: Option<Finite>,
    /// A condition, in words, that may or may not have been intended: then the mechanism is not run.
    pub ambiguous: Option<String>,
    /// A description of what locks instantaneous motions.
    pub instantaneous: String,
    /// Errors of the dimensions (rad, fractions of lengths): the largest that was removed, and the largest that there
    /// may be.
    pub errors: (f64, f64),
}

impl Default for Verdict {
    /// Of equations: nothing was decided.
    fn default() -> Self {
        Self { finite: None, ambiguous: None, instantaneous: "its conditions".into(), errors: (0.0, 0.0) }
    }
}

/// Degrees of freedom of a system over finite motions, drives released.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Finite {
    /// Degrees of freedom at generic positions.
    pub dof: usize,
    /// Further motions that exist at every position, but only instantaneously.
    pub instantaneous: usize,
    /// Whether a constraint may be as weak as the drawing tolerance and still be accepted.
    pub weak: bool,
    /// Whether one is so weak that rounding hides it.
    pub hidden: bool,
}

impl Structure {
    /// Of equations in coordinates that are the integrals of the velocities, with unit displacements and closing rows of
    /// unknown size, all in one cluster.
    pub fn of_equations(pattern: Pattern, holonomic: usize, name: impl Fn(usize) -> String) -> Self {
        let (n, rows) = (pattern.cols, pattern.rows);
        let velocity = |i| Velocity { name: name(i).into(), coordinates: i..i + 1, displacement: 1.0 };
        let row = |i| {
            let name: Arc<str> = format!("constraint {i}").into();
            let (description, owner) = (name.clone(), name.clone());
            Row { name, description, owner, displacement: None, is_angle: false, is_drive: false, may_jump: false }
        };
        Self {
            size: Size { nq: n, nv: n, rows, holonomic },
            pattern,
            clusters: Clusters::one(n, rows),
            coordinates: (0..n).map(|i| Coordinate { velocity: Some(i), turns: false, repeats: false }).collect(),
            velocities: (0..n).map(velocity).collect(),
            rows: (0..rows).map(row).collect(),
            rheonomic: false,
            has_power: false,
            lacks_mass: false,
            given_count: 0,
            drawing: Verdict::default(),
        }
    }

    /// Name of velocity `i`.
    pub fn velocity_name(&self, i: usize) -> String {
        self.velocities[i].name.to_string()
    }

    /// The coordinates that velocity `i` changes.
    pub fn coordinates_of(&self, i: usize) -> Range<usize> {
        self.velocities[i].coordinates.clone()
    }

    /// Characteristic displacement of velocity `i`.
    pub fn displacement(&self, i: usize) -> f64 {
        self.velocities[i].displacement
    }

    /// Names of these velocities.
    pub fn names(&self, velocities: &[usize]) -> String {
        velocities.iter().map(|&i| &*self.velocities[i].name).collect::<Vec<_>>().join(", ")
    }

    /// Characteristic displacements of all velocities.
    pub fn displacements(&self) -> impl Iterator<Item = f64> + '_ {
        self.velocities.iter().map(|v| v.displacement)
    }
}
