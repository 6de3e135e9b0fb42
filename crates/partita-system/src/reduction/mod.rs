//! The reduction itself: P1-P3 at one point, with everything prepared so that an evaluation allocates nothing.
//! Occasional decisions are in `choosing`, checks in `watch`.

mod choosing;
pub mod closure_error;
mod correction;
mod distance;
mod quality;
mod row_exchange;
mod rows;
pub mod snapshot;
mod switches;
mod watch;

pub use crate::choice::Choice;
pub use correction::DependentStep;
pub use quality::quality_of;
pub use snapshot::ReductionSnapshot;
pub use watch::{is_round_off, largest, strength, velocity_residuals, Sides};

use crate::clusters::Clusters;
use crate::partition::Partition;
use crate::rates::{self, Point};
use crate::system::{ClusterTangent, ConstrainedSystem, Recursion, Size, SystemError, SystemRef, Tangent};
use partita_math::dense;
use partita_math::elimination::Plan;
use partita_math::tolerance;

/// No column.
const NONE: u32 = u32::MAX;

/// A correction with a larger displacement is rounding, unless it is longer than [`tolerance::OPEN`] or its residual is
/// no rounding. Scale: multiples of the relative residual. Reason: three digits lost to a poor choice of coordinates.
pub const LARGEST_AMPLIFICATION: f64 = 1e3;

/// Rows kept, coordinates, and the elimination planned for them. No evaluation changes it, but where a pivot has shrunk.
pub struct PlannedChoice {
    rank: usize,
    k: usize,
    /// The current choice.
    pub partition: Partition,
    plan: Option<Plan>,
    /// Blocks of C.
    pub clusters: Clusters,
    /// Where many degrees of freedom make one M_d expensive: the plan of the recursion over clusters.
    recursion: Option<Recursion>,
    /// Whether a recursion may be taken at all.
    dense_only: bool,
    /// The rows it was planned for, ascending.
    planned_rows: Option<Vec<usize>>,
    /// Columns of `dt` and `a_matrix`: all degrees of freedom, or the most of one cluster.
    columns: usize,
    /// Column of each independent velocity; `NONE` where its cluster needs no D.
    column_of: Vec<u32>,
    /// Entries of the kept rows in independent columns: step of the elimination, entry, index in v_I.
    spread_entries: Vec<(u32, u32, u32)>,
    independent_entries: Vec<(u32, u32, u32)>,
    /// Rows not kept, ascending.
    dropped: Vec<usize>,
    /// Whether this row is not kept. Then it is not used in closing.
    left_out: Vec<bool>,
    rheonomic: bool,
}

impl PlannedChoice {
    /// As evaluations over any scalar type take it. Inline: every level of an evaluation asks for it.
    #[inline(always)]
    fn choice(&self) -> Choice<'_> {
        Choice {
            plan: self.plan.as_ref().filter(|_| self.rank > 0),
            rows: &self.partition.rows,
            dependent: &self.partition.dependent,
            independent: &self.partition.independent,
            columns: self.columns,
            column_of: &self.column_of,
            entries: &self.independent_entries,
            spread_entries: &self.spread_entries,
            packed: self.recursion.is_some(),
            rheonomic: self.rheonomic,
        }
    }
}

/// The levels at one point (t, q, v), with their memory.
pub struct PointValues {
    /// Φ (holonomic rows).
    pub phi: Vec<f64>,
    /// Values of C in pattern order.
    pub c: Vec<f64>,
    /// a.
    pub a: Vec<f64>,
    /// b.
    pub b: Vec<f64>,
    factors: Vec<f64>,
    rhs: Vec<f64>,
    /// A (r x [`columns`](Reduction::columns)), rows in the order of `partition.dependent`.    (P1)
    pub a_matrix: Vec<f64>,
    /// `Dᵀ` (nv x [`columns`](Reduction::columns)).                                            (P2)
    pub dt: Vec<f64>,
    /// `[0; η]`.
    pub gamma: Vec<f64>,
    /// `[0; ξ]`.
    pub delta: Vec<f64>,
    /// v (nv).
    pub v: Vec<f64>,
    vdot: Vec<f64>,
    /// M_d, not factored.
    pub md: Vec<f64>,
    /// Cholesky factor of M_d.
    pub md_factor: Vec<f64>,
    hd: Vec<f64>,
    /// `v_I'`.
    pub vdot_independent: Vec<f64>,
    residual: Vec<f64>,
    work: Vec<f64>,
}

impl PointValues {
    /// What the recursion over clusters needs of them, `dt` with this many columns.
    fn cluster_tangent(&self, columns: usize) -> ClusterTangent<'_> {
        ClusterTangent { columns, dt: &self.dt, delta: &self.delta, c: &self.c, b: &self.b }
    }

    /// The accelerations of independent velocities are those among all.
    fn pick_independent(&mut self, independent: &[usize]) {
        for (x, &i) in self.vdot_independent.iter_mut().zip(independent) {
            *x = self.vdot[i];
        }
    }
}

/// Natural sizes of velocities and rows.
pub struct Scales {
    /// `s_i² = [M⁻¹]_ii`, frozen between refreshes: they are only scales.
    pub s2: Vec<f64>,
    s: Vec<f64>,
    displacement: Vec<f64>,
    row_scale: Vec<f64>,
    /// Closure error of each row under a large displacement.
    row_size: Vec<f64>,
    /// Whether velocities are weighted by their characteristic displacements, whatever the masses.
    weighs_displacements: bool,
    /// Whether M is singular because bodies are massless.
    lacks_mass: bool,
    /// Round-off of each row of Φ: smaller residuals are meaningless.
    noise: Vec<f64>,
}

/// Counts of work.
#[derive(Clone, Copy, Debug, Default)]
pub struct Counts {
    /// Counts of factorisations and plans.
    pub factorisations: u64,
    /// Plans made.
    pub plans: u64,
    /// Choices of rows and independent velocities so far.
    choices: u64,
    /// Plans and changes of the round-off of rows so far.
    version: u64,
}

/// The reduced equations of a system at one point `(t, q, v)`.
///
/// Levels follow each other: [`position`](Self::position), [`tangent`](Self::tangent),
/// [`velocity`](Self::velocity), [`acceleration`](Self::acceleration).
pub struct Reduction<'s, S: ConstrainedSystem> {
    /// The system.
    pub system: SystemRef<'s, S>,
    /// Its scratch.
    pub scratch: S::Scratch,
    size: Size,
    /// The choice in use.
    pub planned: PlannedChoice,
    /// The levels at the point last evaluated.
    pub at: PointValues,
    /// Natural sizes of velocities and rows.
    pub scale: Scales,
    /// Counts of work.
    pub counts: Counts,
    distance: distance::Distance,
    memory: switches::SwitchScratch,
    row_memory: row_exchange::RowScratch,
}

impl<'s, S: ConstrainedSystem> Reduction<'s, S> {
    /// The same system, with initial rows: of redundant ones these are kept where they serve.
    pub fn keeping(mut self, rows: &[usize]) -> Self {
        self.planned.partition.rows = rows.to_vec();
        self.planned.dropped = (0..self.size.rows).filter(|i| !rows.contains(i)).collect();
        self.planned.left_out = (0..self.size.rows).map(|i| !rows.contains(&i)).collect();
        self
    }

    /// Memory for a system whose constraints have rank `rank`; no partition yet. With many degrees of freedom the
    /// accelerations come from the system's recursion over clusters; then there is no M_d, and `dt`, `a_matrix` are
    /// packed by cluster.
    pub fn new(system: impl Into<SystemRef<'s, S>>, rank: usize) -> Self {
        let system = system.into();
        let clusters = system.structure().clusters.clone();
        Self::memory(system, rank, Some(clusters))
    }

    /// For questions of geometry alone: velocities are weighted by their characteristic displacements, so that masses
    /// do not enter and may be missing.
    pub fn geometric(system: impl Into<SystemRef<'s, S>>, rank: usize) -> Self {
        Self::new(system, rank).weighing_displacements()
    }

    /// As `geometric`, for an existing reduction.
    pub fn weighing_displacements(mut self) -> Self {
        self.scale.weighs_displacements = true;
        self
    }

    /// Whether velocities are weighted by their characteristic displacements, not by masses.
    pub fn weighs_displacements(&self) -> bool {
        self.scale.weighs_displacements
    }

    /// Weight velocities by their characteristic displacements, or by masses, from the next scales on.
    pub fn weigh_displacements(&mut self, displacements: bool) {
        self.scale.weighs_displacements = displacements;
    }

    /// As `geometric`, with `dt` in full.
    pub fn geometric_dense(system: impl Into<SystemRef<'s, S>>, rank: usize) -> Self {
        let mut new = Self::dense(system, rank);
        new.scale.weighs_displacements = true;
        new
    }

    /// As `new`, with `dt` (nv x k), `a_matrix` (r x k) and M_d in full, however many degrees of freedom there are.
    pub fn dense(system: impl Into<SystemRef<'s, S>>, rank: usize) -> Self {
        Self::memory(system.into(), rank, None)
    }

    /// Without clusters `dt` and M_d are held in full.
    fn memory(system: SystemRef<'s, S>, rank: usize, clusters: Option<Clusters>) -> Self {
        let size = system.size();
        let (n, k) = (size.nv, size.nv - rank);
        let planned = PlannedChoice {
            dense_only: clusters.is_none(),
            clusters: clusters.unwrap_or_else(|| Clusters::one(n, size.rows)),
            rank,
            k,
            partition: Partition::default(),
            plan: None,
            recursion: None,
            planned_rows: None,
            columns: 0,
            column_of: Vec::new(),
            spread_entries: Vec::new(),
            independent_entries: Vec::new(),
            dropped: Vec::new(),
            left_out: vec![false; size.rows],
            rheonomic: system.structure().rheonomic,
        };
        let at = PointValues {
            phi: vec![0.0; size.holonomic],
            c: vec![0.0; system.pattern().nnz()],
            a: vec![0.0; size.rows],
            b: vec![0.0; size.rows],
            factors: Vec::new(),
            rhs: Vec::new(),
            a_matrix: Vec::new(),
            dt: Vec::new(),
            gamma: vec![0.0; n],
            delta: vec![0.0; n],
            v: vec![0.0; n],
            vdot: vec![0.0; n],
            md: Vec::new(),
            md_factor: Vec::new(),
            hd: Vec::new(),
            vdot_independent: vec![0.0; k],
            residual: vec![0.0; n],
            work: vec![0.0; n.max(k).max(rank)],
        };
        let scale = Scales {
            s2: vec![1.0; n],
            s: vec![1.0; n],
            displacement: system.structure().displacements().collect(),
            row_scale: vec![1.0; size.rows],
            row_size: (0..size.rows).map(|i| system.structure().rows[i].size()).collect(),
            weighs_displacements: false,
            lacks_mass: system.structure().lacks_mass,
            noise: vec![0.0; size.rows],
        };
        Self {
            planned,
            at,
            scale,
            counts: Counts::default(),
            scratch: system.scratch(),
            size,
            distance: distance::Distance::default(),
            memory: switches::SwitchScratch::default(),
            row_memory: row_exchange::RowScratch::default(),
            system,
        }
    }

    /// The choice in use, for evaluations over another scalar type.
    pub fn choice(&self) -> Choice<'_> {
        self.planned.choice()
    }
    /// Number of independent velocities.
    pub fn k(&self) -> usize {
        self.planned.k
    }
    /// Columns of `dt` and `a_matrix`: k, or with a recursion over clusters the most degrees of freedom of one of them.
    pub fn columns(&self) -> usize {
        self.planned.columns
    }
    /// Whether `dt` and M_d are always held in full.
    pub fn is_dense(&self) -> bool {
        self.planned.dense_only
    }
    /// Whether the accelerations come from a recursion over clusters.
    pub fn by_clusters(&self) -> bool {
        self.planned.recursion.is_some()
    }
    /// Choices of rows and independent velocities so far: their number.
    pub fn choices(&self) -> u64 {
        self.counts.choices
    }
    /// Rank of the constraints.
    pub fn rank(&self) -> usize {
        self.planned.rank
    }
    /// Sizes of the system.
    pub fn size(&self) -> Size {
        self.size
    }

    /// s, the square roots of `s2`.
    pub fn scales(&self) -> &[f64] {
        &self.scale.s
    }

    /// Φ, C and a at (t, q).
    #[inline]
    pub fn position(&mut self, t: f64, q: &[f64]) -> Result<(), SystemError> {
        self.system.position(t, q, &mut self.scratch, &mut self.at.phi, &mut self.at.c, &mut self.at.a)
    }

    /// Factor C_D at the last position; a pivot that shrank leads to a new plan on the same partition.
    pub fn factor(&mut self, t: f64) -> Result<(), SystemError> {
        if self.planned.rank == 0 {
            return Ok(());
        }
        self.counts.factorisations += 1;
        let ok = match &self.planned.plan {
            Some(plan) => plan.factor(&self.at.c, &mut self.at.factors).is_ok(),
            None => return Err(SystemError::Unchosen("partition")),
        };
        if ok {
            return Ok(());
        }
        if !self.at.c.iter().all(|x| x.is_finite()) {
            return Err(SystemError::NotFinite { what: "the constraint Jacobian".into(), t });
        }
        let independent = std::mem::take(&mut self.planned.partition.independent);
        let planned = self.set_partition(t, &independent);
        if planned.is_err() {
            self.planned.partition.independent = independent;
        }
        planned?;
        match self.planned.plan.as_ref().map(|p| p.factor(&self.at.c, &mut self.at.factors)) {
            Some(Ok(())) => Ok(()),
            _ => Err(SystemError::Singular { t, pivot: 0.0, limit: tolerance::SINGULAR_PIVOT }),
        }
    }

    /// Whether pivots of C_D with these reciprocals lie clearly within the range of the plan in use.
    pub(crate) fn clearly_regular(&self, reciprocals: &[f64]) -> bool {
        self.planned.rank == 0 || self.planned.plan.as_ref().is_some_and(|plan| plan.clearly_holds(reciprocals))
    }

    /// `x ← C_D⁻¹ x` for r numbers in the order of the kept rows; on return in the order of D.
    pub fn solve(&self, x: &mut [f64], columns: usize) {
        if let Some(plan) = &self.planned.plan {
            plan.solve(&self.at.factors, x, columns);
        }
    }

    /// The elimination of C_D and its factors.
    pub fn closing(&self) -> Option<(&Plan, &[f64])> {
        self.planned.plan.as_ref().filter(|_| self.planned.rank > 0).map(|plan| (plan, &self.at.factors[..]))
    }

    /// `x ← C_D⁻ᵀ x` for r numbers in the order of D; on return in the order of the kept rows.
    pub fn solve_transposed(&self, x: &mut [f64]) {
        if let Some(plan) = &self.planned.plan {
            plan.solve_transposed(&self.at.factors, x, 1);
        }
    }

    /// A, D and η at the last position: `v_D = A v_I + η`.                                 (P1, P2)
    pub fn tangent(&mut self, t: f64) -> Result<(), SystemError> {
        self.factor(t)?;
        let choice = self.planned.choice();
        choice.tangent(
            &self.at.factors,
            &self.at.c,
            &self.at.a,
            &mut self.at.rhs,
            &mut self.at.a_matrix,
            &mut self.at.dt,
            &mut self.at.gamma,
        );
        Ok(())
    }

    /// `v = Dᵀ v_I + [0; η]`, stored in `self.v`.                                                                (P2)
    pub fn spread(&mut self, v_independent: &[f64]) {
        let choice = self.planned.choice();
        let tangent = (&self.at.dt[..], &self.at.gamma[..]);
        choice.spread(
            &self.at.factors,
            &self.at.c,
            &self.at.a,
            tangent,
            v_independent,
            &mut self.at.work,
            &mut self.at.v,
        );
    }

    /// b at (t, q, self.v) and ξ.                                                          (S5, P1)
    pub fn velocity(&mut self, t: f64, q: &[f64]) -> Result<(), SystemError> {
        self.system.velocity(t, q, &self.at.v, &mut self.scratch, &mut self.at.b)?;
        self.planned.choice().bias(&self.at.factors, &self.at.b, &mut self.at.work, &mut self.at.delta);
        Ok(())
    }

    /// b and ξ at (t, q, self.v), and accelerations that are known, where they come from a recursion.         (S5, P1)
    pub fn accept_acceleration(&mut self, t: f64, q: &[f64], vdot: &[f64]) -> Result<(), SystemError> {
        self.velocity(t, q)?;
        self.at.vdot.copy_from_slice(vdot);
        self.at.pick_independent(&self.planned.partition.independent);
        Ok(())
    }

    /// `M_d v_I' = h_d` with the state of the lower levels.                                (P3)
    pub fn acceleration(&mut self, t: f64, q: &[f64]) -> Result<(), SystemError> {
        if let (Some(_), Some(clustered)) = (&self.planned.recursion, self.system.clustered()) {
            let tangent = ClusterTangent {
                columns: self.planned.columns,
                dt: &self.at.dt,
                delta: &self.at.delta,
                c: &self.at.c,
                b: &self.at.b,
            };
            clustered.accelerate(t, q, &self.at.v, &tangent, &mut self.scratch, &mut self.at.vdot)?;
            self.at.pick_independent(&self.planned.partition.independent);
            return Ok(());
        }
        let tangent = Tangent { k: self.planned.k, dt: &self.at.dt, delta: &self.at.delta };
        self.system.project(t, q, &self.at.v, &tangent, &mut self.scratch, &mut self.at.md, &mut self.at.hd)?;
        self.at.md_factor.copy_from_slice(&self.at.md);
        self.at.vdot_independent.copy_from_slice(&self.at.hd);
        dense::cholesky(&mut self.at.md_factor, self.planned.k).map_err(|e| SystemError::Mass {
            name: self.system.structure().velocity_name(self.planned.partition.independent[e.index]),
            pivot: e.pivot,
        })?;
        if self.scale.lacks_mass {
            self.feels()?;
        }
        dense::cholesky_solve(&self.at.md_factor, self.planned.k, &mut self.at.vdot_independent);
        Ok(())
    }

    /// Where M is singular: whether each pivot of M_d is significant in the metric, or a rounding error.
    fn feels(&self) -> Result<(), SystemError> {
        for (j, &i) in self.planned.partition.independent.iter().enumerate() {
            let pivot = self.at.md_factor[j * self.planned.k + j].powi(2);
            if pivot * self.scale.s2[i] < tolerance::SOLUTION_ROUNDING {
                return Err(SystemError::Mass { name: self.system.structure().velocity_name(i), pivot });
            }
        }
        Ok(())
    }

    /// Accept pivots of M_d as they are: other tangent velocities have units of their own.
    pub fn trusting_pivots(mut self) -> Self {
        self.scale.lacks_mass = false;
        self
    }

    /// All levels at `(t, q, v_I)`.
    #[inline]
    pub fn evaluate(&mut self, t: f64, q: &[f64], v_independent: &[f64]) -> Result<(), SystemError> {
        self.position(t, q)?;
        self.tangent(t)?;
        self.spread(v_independent);
        self.velocity(t, q)?;
        self.acceleration(t, q)
    }

    /// `h_d` of the last evaluation.
    pub fn reduced_force(&self) -> &[f64] {
        &self.at.hd
    }

    /// `v' = Dᵀ v_I' + [0; ξ]` of the last evaluation.                                     (P2)
    pub fn full_acceleration(&self, out: &mut [f64]) {
        if self.planned.recursion.is_some() {
            out.copy_from_slice(&self.at.vdot);
            return;
        }
        self.planned.choice().full_acceleration(&self.at.dt, &self.at.delta, &self.at.vdot_independent, out);
    }

    /// q', v_I', and the power if `out` goes on, at the point last evaluated.                           (S2, P3)
    pub fn rates(&mut self, t: f64, q: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        self.complete_acceleration();
        let choice = self.planned.choice();
        let at = Point { t, q, v: &self.at.v, gamma: &self.at.gamma, vdot: &self.at.vdot };
        rates::rates(&mut (&*self.system, &mut self.scratch), &choice, &at, &mut self.at.residual, out)
    }

    /// dE/dt that is not the work of conservative forces, at the point last evaluated.
    pub fn power(&mut self, t: f64, q: &[f64]) -> Result<f64, SystemError> {
        if self.planned.rheonomic {
            self.complete_acceleration();
        }
        let at = Point { t, q, v: &self.at.v, gamma: &self.at.gamma, vdot: &self.at.vdot };
        rates::power(&mut (&*self.system, &mut self.scratch), self.planned.rheonomic, &at, &mut self.at.residual)
    }

    /// v' of all velocities, where it does not come from a recursion.                                     (P2)
    fn complete_acceleration(&mut self) {
        if self.planned.recursion.is_none() {
            self.planned.choice().full_acceleration(
                &self.at.dt,
                &self.at.delta,
                &self.at.vdot_independent,
                &mut self.at.vdot,
            );
        }
    }

    /// Multipliers of all rows from the dependent rows of `M v' − h`: `C_Dᵀ λ = (M v' − h)_D`; zero on dropped rows.
    ///                                                                                     (R1, 41)
    pub fn multipliers(&mut self, t: f64, q: &[f64], vdot: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        self.system.inverse_dynamics(t, q, &self.at.v, vdot, &mut self.scratch, &mut self.at.residual)?;
        self.planned.choice().multipliers(&self.at.factors, &self.at.residual, &mut self.at.work, out);
        Ok(())
    }

    /// λ of forces r (nv) with the present factors: `C_Dᵀ λ = r_D`; zero on dropped rows. `work` has room for the rank.
    pub fn multipliers_of(&self, forces: &[f64], work: &mut [f64], out: &mut [f64]) {
        self.planned.choice().multipliers(&self.at.factors, forces, work, out);
    }

    /// The step of the dependent coordinates last found, `q_D ← q_D − C_D⁻¹ Φ`.                        (34)
    pub fn move_dependent(&mut self, q: &mut [f64]) {
        self.at.residual.fill(0.0);
        for (x, &i) in self.at.work.iter().zip(&self.planned.partition.dependent) {
            self.at.residual[i] = *x;
        }
        self.system.step(q, &self.at.residual);
    }
}
