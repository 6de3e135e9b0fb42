//! The one contract: a constrained system by levels, with a fixed sparsity and its own tangential projection.

mod duties;
pub mod structure;
mod varied;

pub use crate::error::SystemError;
pub use duties::{Clustered, Guards, Levels, Manifold, Methods, Metric};
use partita_math::dense;
use std::ops::Deref;
use std::sync::Arc;
pub use structure::{Finite, Structure};
pub use varied::{by_differences, At, Changes, Derivatives, Directions, Varied};

/// Sizes of a system.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Coordinates q.
    pub nq: usize,
    /// Velocities v.
    pub nv: usize,
    /// Constraint rows of S4 (holonomic ones first).
    pub rows: usize,
    /// Number of them that exist as S3 too.
    pub holonomic: usize,
}

/// `D` and `[0; ξ]` of P2, indexed by velocity.
pub struct Tangent<'a, N = f64> {
    /// Number of independent velocities k.
    pub k: usize,
    /// `Dᵀ` (nv x k), row by row.
    pub dt: &'a [N],
    /// `[0; ξ]` (nv).
    pub delta: &'a [N],
}

/// The system's method for its reduced accelerations cluster by cluster, decided when rows are kept.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Recursion {
    /// Columns of the packed `Dᵀ` it needs: the most degrees of freedom of a cluster that uses partial velocities.
    pub columns: usize,
    /// Whether this cluster uses partial velocities. The others need no D.
    pub by_partial_velocities: Vec<bool>,
}

/// Takes the number of a cluster, its independent velocities, and their block of M_d⁻¹.
pub type BlockSink<'b, T = f64> = &'b mut dyn FnMut(usize, &[usize], &[T]);

/// Input of the recursion over clusters.
#[derive(Clone, Copy)]
pub struct ClusterTangent<'a, N = f64> {
    /// Columns of `dt`.
    pub columns: usize,
    /// `Dᵀ` (nv x columns): the degrees of freedom of its own cluster beside each velocity; zero where the cluster
    /// needs none.
    pub dt: &'a [N],
    /// `[0; ξ]` (nv).
    pub delta: &'a [N],
    /// Values of C in pattern order.
    pub c: &'a [N],
    /// b (rows).
    pub b: &'a [N],
}

/// A system in use: borrowed for the time of use, or shared by its users.
pub enum SystemRef<'s, S> {
    /// Borrowed.
    Borrowed(&'s S),
    /// Shared: its users may outlive its creator.
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

/// S1-S5 of a mechanism or of a user-defined system: all traits together.
pub trait ConstrainedSystem: Levels + Metric + Manifold + Guards + Methods + Varied {}

impl<S> ConstrainedSystem for S where S: Levels + Metric + Manifold + Guards + Methods + Varied {}

/// The projection P3 through dense M and h, for systems without a better method.
///
/// Cost: n²k multiply-adds.
pub fn project_dense(mass: &[f64], h: &[f64], tangent: &Tangent, work: &mut [f64], md: &mut [f64], hd: &mut [f64]) {
    let (n, k, dt) = (h.len(), tangent.k, tangent.dt);
    // remaining force: h − M [0; ξ]
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
