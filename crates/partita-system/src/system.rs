//! The one contract: a constrained system by levels, with a fixed sparsity and its own tangential projection.

use crate::breakpoints::{Breakpoints, Reading};
use crate::closing::Closing;
use crate::clusters::Clusters;
pub use crate::error::SystemError;
use partita_math::dense;
use partita_math::elimination::Pattern;
use std::ops::Deref;
use std::sync::Arc;

/// What is known of the degrees of freedom of a system over finite motions, drives released.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Finite {
    /// Degrees of freedom at generic positions.
    pub freedoms: usize,
    /// Further motions that exist at every position, but for an instant only.
    pub instantaneous: usize,
    /// May a condition be as weak as a drawing tolerance and hold all the same?
    pub weak: bool,
    /// Is one so weak that rounding hides it?
    pub hidden: bool,
}

/// Sizes of a system.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Coordinates q.
    pub nq: usize,
    /// Velocities v.
    pub nv: usize,
    /// Constraint rows of S4 (holonomic ones first).
    pub rows: usize,
    /// How many of them exist as S3 too.
    pub holonomic: usize,
}

/// `D` and `[0; ξ]` of P2, indexed by velocity.
pub struct Tangent<'a> {
    /// Number of independent velocities k.
    pub k: usize,
    /// `Dᵀ` (nv x k), row by row.
    pub dt: &'a [f64],
    /// `[0; ξ]` (nv).
    pub delta: &'a [f64],
}

/// How a system finds its reduced accelerations cluster by cluster, decided when rows are kept.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Recursion {
    /// Columns of the packed `Dᵀ` it wants: the most degrees of freedom of a cluster that goes by partial velocities.
    pub columns: usize,
    /// Does this cluster go by partial velocities? The others need no D.
    pub by_partial_velocities: Vec<bool>,
}

/// Takes the number of a cluster, its independent velocities, and their block of M_d⁻¹.
pub type BlockSink<'b, T = f64> = &'b mut dyn FnMut(usize, &[usize], &[T]);

/// What the recursion over clusters is given.
pub struct ClusterTangent<'a> {
    /// Columns of `dt`.
    pub columns: usize,
    /// `Dᵀ` (nv x columns): the degrees of freedom of its own cluster beside each velocity; zero where the cluster
    /// needs none.
    pub dt: &'a [f64],
    /// `[0; ξ]` (nv).
    pub delta: &'a [f64],
    /// Values of C in pattern order.
    pub c: &'a [f64],
    /// b (rows).
    pub b: &'a [f64],
}

/// A system that is worked with: borrowed for as long as it is, or shared by all who work with it.
pub enum SystemRef<'s, S> {
    /// Borrowed.
    Borrowed(&'s S),
    /// Shared: whoever works with it may outlive who made it.
    Shared(Arc<S>),
}

impl<S> Clone for SystemRef<'_, S> {
    fn clone(&self) -> Self {
        match self {
            Self::Borrowed(system) => Self::Borrowed(system),
            Self::Shared(system) => Self::Shared(system.clone()),
        }
    }
}

impl<S> Deref for SystemRef<'_, S> {
    type Target = S;
    #[inline]
    fn deref(&self) -> &S {
        match self {
            Self::Borrowed(system) => system,
            Self::Shared(system) => system,
        }
    }
}

impl<'s, S> From<&'s S> for SystemRef<'s, S> {
    fn from(system: &'s S) -> Self {
        Self::Borrowed(system)
    }
}

impl<S> From<Arc<S>> for SystemRef<'_, S> {
    fn from(system: Arc<S>) -> Self {
        Self::Shared(system)
    }
}

/// S1-S5 of a mechanism or of a user-defined system.
///
/// Evaluated by level: [`position`](Self::position), then [`velocity`](Self::velocity) at the same `(t, q)`, then the
/// dynamics. What one level computes it leaves in the scratch for the next; the scratch is never an answer. The
/// pattern of C is fixed. After set-up no level allocates.
pub trait ConstrainedSystem: Send + Sync {
    /// Memory reused between evaluations.
    type Scratch;

    /// Sizes.
    fn size(&self) -> Size;
    /// Sparsity of C (rows x nv).
    fn pattern(&self) -> &Pattern;
    /// New scratch.
    fn scratch(&self) -> Self::Scratch;
    /// Name of velocity `i`.
    fn velocity_name(&self, i: usize) -> String;
    /// Name of constraint row `i`.
    fn row_name(&self, i: usize) -> String;
    /// Where constraint row `i` comes from, in words.
    fn row_description(&self, i: usize) -> String {
        self.row_name(i)
    }
    /// Does any row depend on time (a ≠ 0)?
    fn rheonomic(&self) -> bool;
    /// Is work of non-conservative forces to be accounted?
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
    /// Blocks of velocities and rows connected through C; one block by default.
    fn clusters(&self) -> Clusters {
        let size = self.size();
        Clusters::one(size.nv, size.rows)
    }
    /// Prepare the recursion over clusters with these rows kept; `None` where one dense M_d is cheaper, or all there
    /// is.
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
    /// Motion that efforts (nv) alone cause from rest: as `accelerate`, without forces, gravity and the terms of
    /// velocity. After `position` and [`plan_recursion`](Self::plan_recursion).
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
    /// Reduced mass (k_c x k_c, lower triangle) on a resting base of the n-th cluster that goes by partial velocities,
    /// after `accelerate` or `respond`.
    fn cluster_mass<'x>(&self, _n: usize, _s: &'x Self::Scratch) -> &'x [f64] {
        &[]
    }
    /// `[Dᵀ M_d⁻¹ D]_ii` of all velocities, and `block(cluster, its independent velocities, their block of M_d⁻¹)` for each
    /// cluster, after `accelerate` or `respond`.                                                (21)
    fn mobility(
        &self,
        _tangent: &ClusterTangent,
        _independent: &[usize],
        _s: &mut Self::Scratch,
        _diagonal: &mut [f64],
        _block: BlockSink,
    ) {
    }
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
    /// Is M short of mass somewhere, so that it is no metric? Then one stands beside it:
    /// [`add_metric`](Self::add_metric) is what it has more, and `[M⁻¹]_ii` and columns of `M⁻¹` are its own. Equations
    /// of motion are those of M.
    fn lacks_mass(&self) -> bool {
        false
    }
    /// Make a dense M (nv x nv) the metric, after `position`.
    fn add_metric(&self, _s: &mut Self::Scratch, _mass: &mut [f64]) {}
    /// Names of the bodies that move at these velocities.
    fn bodies_moved(&self, _q: &[f64], _v: &[f64]) -> Vec<String> {
        Vec::new()
    }
    /// What is to be said of a start with these velocities, or against it.
    ///
    /// # Errors
    /// Velocities that nothing carries on.
    fn start_notes(&self, _q: &[f64], _v: &[f64]) -> Result<Vec<String>, SystemError> {
        Ok(Vec::new())
    }
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
    /// Power of the non-conservative applied forces, after `velocity` (see [`has_power`](Self::has_power)).
    fn power(&self, _t: f64, _q: &[f64], _v: &[f64], _s: &mut Self::Scratch) -> Result<f64, SystemError> {
        Ok(0.0)
    }

    /// `q' = N(q) v`.                                                                      (S2)
    fn rate(&self, q: &[f64], v: &[f64], qdot: &mut [f64]) {
        let _ = q;
        qdot.copy_from_slice(v);
    }
    /// Move `q` by the small velocity-like increment `dv` (an exponential for turns in space).
    fn step(&self, q: &mut [f64], dv: &[f64]) {
        for (q, d) in q.iter_mut().zip(dv) {
            *q += d;
        }
    }
    /// Remove the drift of redundant coordinates (unit quaternions); true if anything moved.
    fn normalise(&self, _q: &mut [f64]) -> bool {
        false
    }
    /// The coordinates that velocity `i` changes: its own integral, or the whole quaternion of a turn in space.
    fn coordinates_of(&self, i: usize) -> std::ops::Range<usize> {
        i..i + 1
    }
    /// Is coordinate `i` an angle that may lose whole turns without anything in S1-S5 noticing?
    fn turns(&self, _i: usize) -> bool {
        false
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
        Err(SystemError::argument("formulation",
            "explicit closing needs loops that can be recognised, or, for equations by hand, a function that closes them \
             (closing=); use another formulation"
                .into(),
        ))
    }
    /// The velocity whose integral coordinate `i` is, if there is one.
    fn velocity_of_coordinate(&self, i: usize) -> Option<usize> {
        Some(i)
    }
    /// What a large move can open row `i` by (1 for an angle, a length for a displacement), if the system knows: a row
    /// whose entries are all small against it is closed by nothing, which no comparison with other rows can tell.
    fn row_displacement(&self, _i: usize) -> Option<f64> {
        None
    }
    /// The time after which nothing can be evaluated, and what ends there, in words.
    fn time_domain(&self) -> Option<(f64, String)> {
        None
    }
    /// Ascending times of known discontinuities of loads and drives: steps end there.
    fn discontinuities(&self) -> Vec<f64> {
        Vec::new()
    }
    /// Curves with breakpoints: steps end where a breakpoint that matters is passed.
    fn breakpoints(&self) -> Vec<Breakpoints> {
        Vec::new()
    }
    /// What each of them is read at, and its rate, at the point (t, q, v) last evaluated.
    fn breakpoint_readings(&self, _t: f64, _q: &[f64], _v: &[f64], _s: &mut Self::Scratch, _out: &mut [Reading]) {}
    /// The verdict on rank, where one was made once and for all; else each position is asked.
    fn finite(&self) -> Option<Finite> {
        None
    }
    /// What holds motions that exist for an instant only, in words.
    fn instantaneous(&self) -> String {
        "its conditions".into()
    }
    /// Size of velocities v, in characteristic displacements: the fastest coordinate, or its invariant over axes.
    fn travel(&self, v: &[f64]) -> f64 {
        v.iter().enumerate().fold(0.0, |m: f64, (i, v)| m.max(v.abs() / self.characteristic_displacement(i)))
    }
    /// What condition `i` belongs to, in words.
    fn row_owner(&self, i: usize) -> String {
        self.row_description(i)
    }
    /// Does row `i` prescribe a motion? Such rows are kept after all others: what closes a loop is no matter of choice.
    fn row_is_drive(&self, _i: usize) -> bool {
        false
    }
    /// May condition `i` hold in one place at one instant and in another at the next? What closes a loop cannot.
    fn row_may_jump(&self, i: usize) -> bool {
        self.row_is_drive(i)
    }
    /// Does row `i` close a direction (rad), not a length?
    fn row_is_angle(&self, _i: usize) -> bool {
        false
    }
    /// Rows that are closed at q the wrong way round: the directions they compare are perpendicular as they should be,
    /// but an axis points backwards. One row for each closing that is.
    fn turned_over(&self, _q: &[f64]) -> Vec<usize> {
        Vec::new()
    }
    /// A typical magnitude of a large move of velocity `i` (1 for an angle, a length for a slide).
    fn characteristic_displacement(&self, _i: usize) -> f64 {
        1.0
    }
}

/// The projection P3 through dense M and h, for systems that offer nothing better.
///
/// Cost: n²k multiply-adds.
pub fn project_dense(mass: &[f64], h: &[f64], tangent: &Tangent, work: &mut [f64], md: &mut [f64], hd: &mut [f64]) {
    let (n, k, dt) = (h.len(), tangent.k, tangent.dt);
    // force left over: h − M [0; ξ]
    hd.fill(0.0);
    md.fill(0.0);
    let row = &mut work[..k];
    for i in 0..n {
        let m_i = &mass[i * n..(i + 1) * n];
        let f = h[i] - dense::dot(m_i, tangent.delta);
        row.fill(0.0);
        for (j, &m) in m_i.iter().enumerate() {
            if m != 0.0 {
                for (r, d) in row.iter_mut().zip(&dt[j * k..(j + 1) * k]) {
                    *r += m * d;
                }
            }
        }
        let d_i = &dt[i * k..(i + 1) * k];
        for (a, &d) in d_i.iter().enumerate() {
            hd[a] += d * f;
            if d != 0.0 {
                for (x, r) in md[a * k..(a + 1) * k].iter_mut().zip(row.iter()) {
                    *x += d * r;
                }
            }
        }
    }
}
