//! Memory of the recursions over a tree: kept with the state of its links, filled by the sweeps.

/// Of the articulated recursion: DIM x DIM numbers per link.
#[derive(Clone, Debug, Default)]
pub struct Articulated<S> {
    pub(crate) inertia: Vec<S>,
    /// S (DIM x 3) and K = U D⁻¹ (DIM x 3) of each link.
    pub(crate) axes: Vec<S>,
    pub(crate) gain: Vec<S>,
    /// D⁻¹ (3 x 3) of each link.
    pub(crate) inverse: Vec<S>,
    pub(crate) compliance: Vec<S>,
    pub(crate) force: Vec<S>,
    pub(crate) motion: Vec<S>,
    /// Residual effort on each link.
    pub(crate) left: Vec<[S; 3]>,
}

/// Of the recursion over clusters.
#[derive(Clone, Debug, Default)]
pub struct ClusterScratch<S> {
    /// Articulated inertia of each link (DIM x DIM) and force it needs at rest (DIM).
    pub(crate) inertia: Vec<S>,
    pub(crate) force: Vec<S>,
    /// Acceleration of each link relative to its initial one (DIM).
    pub(crate) motion: Vec<S>,
    /// For each velocity: unit twist, and the corresponding force of the link's inertia (DIM each).
    pub(crate) axis: Vec<S>,
    pub(crate) push: Vec<S>,
    /// For each velocity: 1 / inertia felt, residual effort.
    pub(crate) inverse: Vec<S>,
    pub(crate) left: Vec<S>,
    /// Inertia felt by each velocity.
    pub(crate) pivots: Vec<S>,
    /// Rows: forces on links, efforts at the joints they pass, couplings, right sides, 1 / pivot, multipliers.
    pub(crate) row_force: Vec<S>,
    pub(crate) row_effort: Vec<S>,
    pub(crate) coupling: Vec<S>,
    pub(crate) row_left: Vec<S>,
    pub(crate) row_inverse: Vec<S>,
    pub(crate) lambda: Vec<S>,
    pub(crate) few: FewScratch<S>,
}

/// Of all clusters with few degrees of freedom.
#[derive(Clone, Debug, Default)]
pub struct FewScratch<S> {
    /// Partial twists, links x k x DIM.
    pub(crate) partial: Vec<S>,
    /// Reduced mass of the cluster on a base at rest: its Cholesky factor (k x k).
    pub(crate) mass: Vec<S>,
    /// As `mass`, before it was factored, for the choice of coordinates.
    pub(crate) whole: Vec<S>,
    /// Accelerations u' on an unaccelerated base (k), and the gain K of the base's acceleration (k x DIM).
    pub(crate) own: Vec<S>,
    pub(crate) gain: Vec<S>,
}
