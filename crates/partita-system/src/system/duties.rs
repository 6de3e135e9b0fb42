//! The traits of a constrained system.

use super::{BlockSink, ClusterTangent, Recursion, Size, Structure, SystemError, SystemRef, Tangent};
use crate::choice::Choice;
use crate::closing::Closing;
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
    /// What is the same at every time and position.
    fn structure(&self) -> &Structure;
    /// Sizes of the system.
    fn size(&self) -> Size {
        self.structure().size
    }
    /// Sparsity of C (rows x nv).
    fn pattern(&self) -> &Pattern {
        &self.structure().pattern
    }
    /// New scratch.
    fn scratch(&self) -> Self::Scratch;
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
    /// Power of the non-conservative applied forces, after `velocity` (see [`Structure::has_power`]).
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

/// Reduced accelerations cluster by cluster, over scratch memory `X`: for systems with a recursion.
pub trait Clustered<X> {
    /// Prepare the recursion over clusters with these rows kept; `None` where one dense M_d is cheaper.
    fn plan_recursion(&self, kept: &[usize], s: &mut X) -> Option<Recursion>;
    /// `v'` with `C v' + b = 0`, after `velocity` and [`plan_recursion`](Self::plan_recursion).     (P3 by clusters)
    fn accelerate(
        &self,
        t: f64,
        q: &[f64],
        v: &[f64],
        tangent: &ClusterTangent,
        s: &mut X,
        vdot: &mut [f64],
    ) -> Result<(), SystemError>;
    /// Motion that efforts (nv) alone cause from rest: as `accelerate`, without forces, gravity and velocity terms.
    /// After `position` and [`plan_recursion`](Self::plan_recursion).
    fn respond(&self, tangent: &ClusterTangent, effort: &[f64], s: &mut X, out: &mut [f64]) -> Result<(), SystemError>;
    /// Reduced mass (k_c x k_c, lower triangle) on a base at rest of the n-th cluster that uses partial velocities,
    /// after `accelerate` or `respond`.
    fn cluster_mass<'x>(&self, n: usize, s: &'x X) -> &'x [f64];
    /// Motion that efforts (nv) cause from rest without any closing condition, `M⁻¹ f`, after `position`.
    fn respond_freely(&self, effort: &[f64], s: &mut X, out: &mut [f64]) -> Result<(), SystemError>;
    /// `[Dᵀ M_d⁻¹ D]_ii` of all velocities, and `block(cluster, its independent velocities, their block of M_d⁻¹)` for each
    /// cluster, after `accelerate` or `respond`; nothing for clusters with more than `most` independent velocities. (21)
    fn mobility(
        &self,
        tangent: &ClusterTangent,
        independent: &[usize],
        most: usize,
        s: &mut X,
        diagonal: &mut [f64],
        block: BlockSink,
    );
}

/// Positions: the relation of q and v, and displacements of q.
pub trait Manifold: Levels {
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
    /// Size of velocities v, in characteristic displacements: the fastest coordinate, or its invariant over axes.
    fn travel(&self, v: &[f64]) -> f64 {
        v.iter()
            .zip(self.structure().displacements())
            .fold(0.0, |m: f64, (v, displacement)| m.max(v.abs() / displacement))
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

/// Methods of its own that a system may have for its equations.
pub trait Methods: Levels {
    /// The recursion over clusters, where the system has one.
    fn clustered(&self) -> Option<&dyn Clustered<Self::Scratch>> {
        None
    }
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
    /// The recorded rates of a choice (see [`compiled`](crate::compiled)), where they can be recorded.
    fn recorded_rates(&self, _choice: &Choice, _most: usize) -> Option<Recording> {
        None
    }
    /// The place of their code; none where they cannot be recorded.
    fn compiled_rates(&self, _choice: &Choice) -> Option<Arc<CompiledRates>> {
        None
    }
    /// The given number at a place, of [`Structure::given_count`].
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
