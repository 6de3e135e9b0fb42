//! The traits of a constrained system.

use super::{BlockSink, ClusterTangent, Finite, Recursion, Size, SystemError, SystemRef, Tangent};
use crate::choice::Choice;
use crate::closing::Closing;
use crate::clusters::Clusters;
use crate::compiled::CompiledRates;
use crate::watched::{Reading, Watched};
use partita_math::elimination::Pattern;
use partita_math::scalar::Recording;
use std::sync::Arc;

/// S1-S5 by level.
///
/// Evaluated in order: [`position`](Self::position), then [`velocity`](Self::velocity) at the same `(t, q)`, then the
/// dynamics. Each level leaves its results in the scratch for the next; the scratch is never an answer. The pattern of
/// C is fixed. After set-up no level allocates.
pub trait Levels: Send + Sync {
    /// Memory reused between evaluations.
    type Scratch;
    /// Sizes.
    fn size(&self) -> Size;
    /// Sparsity of C (rows x nv).
    fn pattern(&self) -> &Pattern;
    /// New scratch.
    fn scratch(&self) -> Self::Scratch;
    /// Whether any row depends on time (a ≠ 0).
    fn rheonomic(&self) -> bool;
    /// Whether the work of non-conservative forces is accumulated.
    fn has_power(&self) -> bool {
        false
    }
    /// Position level: Φ (holonomic rows), the values of C in pattern order, and a.       (S3, S4)
    fn position(
        &self,
        t: f64,
        q: &[f64],
        s: &mut Self::Scratch,
        phi: &mut [f64],
        c: &mut [f64],
        a: &mut [f64],
    ) -> Result<(), SystemError>;
    /// Velocity level, at the `(t, q)` of the last `position`: b.                          (S5)
    fn velocity(&self, t: f64, q: &[f64], v: &[f64], s: &mut Self::Scratch, b: &mut [f64]) -> Result<(), SystemError>;
    /// Dense M (nv x nv) and h (nv), after `velocity`.                                     (S1)
    fn dynamics(
        &self,
        t: f64,
        q: &[f64],
        v: &[f64],
        s: &mut Self::Scratch,
        mass: &mut [f64],
        h: &mut [f64],
    ) -> Result<(), SystemError>;
    /// Tangential projection, after `velocity`: `M_d = D M Dᵀ`, `h_d = D (h − M [0; ξ])`.  (P3)
    fn project(
        &self,
        t: f64,
        q: &[f64],
        v: &[f64],
        tangent: &Tangent,
        s: &mut Self::Scratch,
        md: &mut [f64],
        hd: &mut [f64],
    ) -> Result<(), SystemError>;
    /// `M v' − h` (nv), after `velocity`.
    fn inverse_dynamics(
        &self,
        t: f64,
        q: &[f64],
        v: &[f64],
        vdot: &[f64],
        s: &mut Self::Scratch,
        out: &mut [f64],
    ) -> Result<(), SystemError>;
    /// Power of the non-conservative applied forces, after `velocity` (see [`has_power`](Self::has_power)).
    fn power(&self, _t: f64, _q: &[f64], _v: &[f64], _s: &mut Self::Scratch) -> Result<f64, SystemError> {
        Ok(0.0)
    }
}

/// M by its entries, and as a metric.
pub trait Metric: Levels {
    /// Pattern of M (nv x nv, both triangles); full by default.
    fn mass_pattern(&self) -> Pattern {
        Pattern::dense(self.size().nv, self.size().nv)
    }
    /// The entries of M in the order of [`mass_pattern`](Self::mass_pattern), and h (nv), after `velocity`.  (S1)
    fn sparse_dynamics(
        &self,
        t: f64,
        q: &[f64],
        v: &[f64],
        s: &mut Self::Scratch,
        mass: &mut [f64],
        h: &mut [f64],
    ) -> Result<(), SystemError> {
        self.dynamics(t, q, v, s, mass, h)
    }
    /// Whether M is singular because bodies are massless, so that it is not a metric. Then a metric exists beside it:
    /// [`add_metric`](Self::add_metric) adds the difference, and `[M⁻¹]_ii` and columns of `M⁻¹` are those of the
    /// metric. Equations of motion use M.
    fn lacks_mass(&self) -> bool {
        false
    }
    /// Make a dense M (nv x nv) the metric, after `position`.
    fn add_metric(&self, _s: &mut Self::Scratch, _mass: &mut [f64]) {}
    /// `s_i² = [M⁻¹]_ii` after `position`: the squared lengths |k_i|².                     (19)
    fn inverse_mass_diagonal(
        &self,
        t: f64,
        q: &[f64],
        s: &mut Self::Scratch,
        out: &mut [f64],
    ) -> Result<(), SystemError>;
    /// Columns `which` of `M⁻¹` after `position` (nv x which.len(), row by row).
    fn inverse_mass_columns(
        &self,
        t: f64,
        q: &[f64],
        which: &[usize],
        s: &mut Self::Scratch,
        out: &mut [f64],
    ) -> Result<(), SystemError>;
}

/// Reduced accelerations cluster by cluster, where that is cheaper than one dense M_d.
pub trait Clustered: Levels {
    /// Blocks of velocities and rows connected through C; one block by default.
    fn clusters(&self) -> Clusters {
        let size = self.size();
        Clusters::one(size.nv, size.rows)
    }
    /// Prepare the recursion over clusters with these rows kept; `None` where one dense M_d is cheaper, or the only
    /// method.
    fn plan_recursion(&self, _kept: &[usize], _s: &mut Self::Scratch) -> Option<Recursion> {
        None
    }
    /// `v'` with `C v' + b = 0`, after `velocity` and [`plan_recursion`](Self::plan_recursion).     (P3 by clusters)
    fn accelerate(
        &self,
        _t: f64,
        _q: &[f64],
        _v: &[f64],
        _tangent: &ClusterTangent,
        _s: &mut Self::Scratch,
        _vdot: &mut [f64],
    ) -> Result<(), SystemError> {
        Err(SystemError::argument(
            "formulation",
            "this system offers no recursion over clusters; give its equations densely".into(),
        ))
    }
    /// Motion that efforts (nv) alone cause from rest: as `accelerate`, without forces, gravity and velocity terms.
    /// After `position` and [`plan_recursion`](Self::plan_recursion).
    fn respond(
        &self,
        _tangent: &ClusterTangent,
        _effort: &[f64],
        _s: &mut Self::Scratch,
        _out: &mut [f64],
    ) -> Result<(), SystemError> {
        Err(SystemError::argument(
            "formulation",
            "this system offers no recursion over clusters; give its equations densely".into(),
        ))
    }
    /// Reduced mass (k_c x k_c, lower triangle) on a base at rest of the n-th cluster that uses partial velocities,
    /// after `accelerate` or `respond`.
    fn cluster_mass<'x>(&self, _n: usize, _s: &'x Self::Scratch) -> &'x [f64] {
        &[]
    }
    /// Motion that efforts (nv) cause from rest without any closing condition, `M⁻¹ f`, after `position`.
    fn respond_freely(&self, _effort: &[f64], _s: &mut Self::Scratch, _out: &mut [f64]) -> Result<(), SystemError> {
        Err(SystemError::argument(
            "formulation",
            "this system offers no recursion over clusters; give its equations densely".into(),
        ))
    }
    /// `[Dᵀ M_d⁻¹ D]_ii` of all velocities, and `block(cluster, its independent velocities, their block of M_d⁻¹)` for each
    /// cluster, after `accelerate` or `respond`; nothing for clusters with more than `most` independent velocities. (21)
    fn mobility(
        &self,
        _tangent: &ClusterTangent,
        _independent: &[usize],
        _most: usize,
        _s: &mut Self::Scratch,
        _diagonal: &mut [f64],
        _block: BlockSink,
    ) {
    }
}

/// Positions: the relation of q and v, and displacements of q.
pub trait Manifold {
    /// `q' = N(q) v`.                                                                      (S2)
    fn rate(&self, q: &[f64], v: &[f64], qdot: &mut [f64]) {
        let _ = q;
        qdot.copy_from_slice(v);
    }
    /// Move `q` by the small velocity-like increment `dv` (an exponential for spatial rotations).
    fn step(&self, q: &mut [f64], dv: &[f64]) {
        for (q, d) in q.iter_mut().zip(dv) {
            *q += d;
        }
    }
    /// Remove the drift of redundant coordinates (unit quaternions); true if anything moved.
    fn normalise(&self, _q: &mut [f64]) -> bool {
        false
    }
    /// The coordinates that velocity `i` changes: its own integral, or the whole quaternion of a spatial rotation.
    fn coordinates_of(&self, i: usize) -> std::ops::Range<usize> {
        i..i + 1
    }
    /// Whether coordinate `i` is an angle from which whole turns may be removed without changing S1-S5.
    fn turns(&self, _i: usize) -> bool {
        false
    }
    /// Whether coordinate `i` is an angle after a whole turn of which all forces and conditions are the same again.
    /// Energies may differ: a constant torque has done work.
    fn repeats(&self, i: usize) -> bool {
        self.turns(i)
    }
    /// The velocity whose integral coordinate `i` is, if there is one.
    fn velocity_of_coordinate(&self, i: usize) -> Option<usize> {
        Some(i)
    }
}

/// Natural sizes of displacements and rows, which make all criteria unit-free.
pub trait Scales {
    /// Closure error of row `i` under a large displacement (1 for an angle, a length for a displacement), if the system
    /// knows it: a row whose entries are all small compared with it cannot be closed, which no comparison with other
    /// rows shows.
    fn row_displacement(&self, _i: usize) -> Option<f64> {
        None
    }
    /// Size of velocities v, in characteristic displacements: the fastest coordinate, or its invariant over axes.
    fn travel(&self, v: &[f64]) -> f64 {
        v.iter().enumerate().fold(0.0, |m: f64, (i, v)| m.max(v.abs() / self.characteristic_displacement(i)))
    }
    /// Whether row `i` constrains a direction (rad), not a length.
    fn row_is_angle(&self, _i: usize) -> bool {
        false
    }
    /// A typical magnitude of a large displacement of velocity `i` (1 for an angle, a length for a translation).
    fn characteristic_displacement(&self, _i: usize) -> f64 {
        1.0
    }
    /// Errors of the dimensions (rad, fractions of lengths): the largest that was removed, and the largest that there
    /// may be.
    fn drawing_errors(&self) -> (f64, f64) {
        (0.0, 0.0)
    }
}

/// Names, for messages and reports.
pub trait Names {
    /// Name of velocity `i`.
    fn velocity_name(&self, i: usize) -> String;
    /// Name of constraint row `i`.
    fn row_name(&self, i: usize) -> String;
    /// Origin of constraint row `i`, in words.
    fn row_description(&self, i: usize) -> String {
        self.row_name(i)
    }
    /// Names of the bodies that move at these velocities.
    fn bodies_moved(&self, _q: &[f64], _v: &[f64]) -> Vec<String> {
        Vec::new()
    }
    /// Notes on a start with these velocities, or reasons to refuse it.
    ///
    /// # Errors
    /// Velocities whose motion is not continued.
    fn start_notes(&self, _q: &[f64], _v: &[f64]) -> Result<Vec<String>, SystemError> {
        Ok(Vec::new())
    }
    /// A description of what locks instantaneous motions.
    fn instantaneous(&self) -> String {
        "its conditions".into()
    }
    /// Element to which condition `i` belongs, in words.
    fn row_owner(&self, i: usize) -> String {
        self.row_description(i)
    }
}

/// Prior knowledge of the rows of S3 and S4.
pub trait Conditions {
    /// The verdict on rank, if one was made for all positions; otherwise each position is analysed.
    fn finite(&self) -> Option<Finite> {
        None
    }
    /// A condition, in words, that may or may not have been intended: then the mechanism is not run.
    fn ambiguous(&self) -> Option<String> {
        None
    }
    /// Whether row `i` prescribes a motion. Such rows are kept after all others: loop closures are not a matter of
    /// choice.
    fn row_is_drive(&self, _i: usize) -> bool {
        false
    }
    /// Whether condition `i` may be discontinuous in its position. Loop closures cannot.
    fn row_may_jump(&self, i: usize) -> bool {
        self.row_is_drive(i)
    }
    /// Rows that are closed at q with an axis reversed: the directions they compare are perpendicular as they should
    /// be, but an axis points backwards. One row for each such loop closure.
    fn turned_over(&self, _q: &[f64]) -> Vec<usize> {
        Vec::new()
    }
}

/// Times and positions that no step may pass unseen.
pub trait Guards: Levels {
    /// Them all.
    fn watched(&self) -> Watched {
        Watched::default()
    }
    /// The functions among them at the point (t, q, v) last evaluated.
    fn readings(&self, _t: f64, _q: &[f64], _v: &[f64], _s: &mut Self::Scratch, _out: &mut [Reading]) {}
}

/// Evaluations by code of the processor, where the system can be recorded.
pub trait Programs {
    /// The recorded rates of a choice (see [`compiled`](crate::compiled)), where they can be recorded.
    fn recorded_rates(&self, _choice: &Choice, _most: usize) -> Option<Recording> {
        None
    }
    /// The place of their code; none where they cannot be recorded.
    fn compiled_rates(&self, _choice: &Choice) -> Option<Arc<CompiledRates>> {
        None
    }
    /// How many numbers are given from outside; inputs of the recorded rates.
    fn given_count(&self) -> usize {
        0
    }
    /// The given number at a place.
    fn given_number(&self, _place: usize) -> f64 {
        f64::NAN
    }
    /// Have `work` done by a thread of its own; false, and nothing done, where the system cannot be shared with one.
    fn beside(_system: &SystemRef<Self>, _work: impl FnOnce(&Self) + Send + 'static) -> bool
    where
        Self: Sized,
    {
        false
    }
}

/// Loops closed by inverse kinematics, where the system can.
pub trait InverseKinematics {
    /// Explicit closing by inverse kinematics for these input velocities, on the branch of the closed position q. (37)
    ///
    /// `None` leaves the choice of inputs to the system: those that order the most loops into explicit blocks.
    fn closing<'s>(
        _system: SystemRef<'s, Self>,
        _t: f64,
        _q: &[f64],
        _inputs: Option<&[usize]>,
    ) -> Result<Box<dyn Closing + Send + 's>, SystemError>
    where
        Self: Sized + 's,
    {
        Err(SystemError::argument(
            "formulation",
            "explicit closing needs a mechanism whose loops it can analyse, or a user-defined system with a closing \
             function (closing=); use another formulation"
                .into(),
        ))
    }
}
