//! The reduction itself: P1-P3 at one point, with everything prepared so that an evaluation allocates nothing.

mod arithmetic;
pub mod openness;
mod rows;
mod watch;

pub use arithmetic::Choice;
pub use rows::{bridged_gap, bridged_row, REDUNDANT};
pub use watch::{largest, quality_of, velocity_residuals, Sides};

use crate::clusters::Clusters;
use crate::partition::Partition;
use crate::system::{ClusterTangent, ConstrainedSystem, Recursion, Size, SystemError, Tangent};
use partita_math::dense;
use partita_math::elimination::{Plan, PlanOptions};

/// Scaled pivots below this mean that the constraints themselves have lost rank: rounding (1e-16) is then amplified to
/// 1e-9 in one evaluation, the accuracy asked of whole runs.
pub const SINGULAR_PIVOT: f64 = 1e-7;

/// No column.
const NONE: u32 = u32::MAX;

/// Rows left out that are open by less than this part of their size fit: it makes no difference which are left out.
pub const FITS: f64 = 1e-11;

/// Pivots of M_d below this part of the metric's are rounding: a freedom that moves no mass. Far below any that does,
/// with the worst choice of coordinates allowed for.
const UNFELT: f64 = 1e-13;

/// Rows of C weaker than this (squared, against their reach) hold round-off only.
const EMPTY_ROW: f64 = 1e-26;

/// A correction that moves coordinates by more than this many times the relative residual is round-off, not closing...
pub const LARGEST_AMPLIFICATION: f64 = 1e3;
/// ... unless it is larger than this (in reaches): then the loops are really open.
const POSTPONED: f64 = 1e-6;

/// The choice of a reduction; a macro, so that its other fields stay free.
macro_rules! choice {
    ($r:expr) => {
        Choice {
            plan: $r.plan.as_ref().filter(|_| $r.rank > 0),
            rows: &$r.partition.rows,
            dependent: &$r.partition.dependent,
            independent: &$r.partition.independent,
            columns: $r.columns,
            column_of: &$r.column_of,
            entries: &$r.independent_entries,
            spread_entries: &$r.spread_entries,
            packed: $r.recursion.is_some(),
            rheonomic: $r.rheonomic,
        }
    };
}

/// The reduced equations of a system at one point `(t, q, v)`.
///
/// Levels follow each other: [`position`](Self::position), [`tangent`](Self::tangent),
/// [`velocity`](Self::velocity), [`acceleration`](Self::acceleration).
pub struct Reduction<'s, S: ConstrainedSystem> {
    /// The system.
    pub system: &'s S,
    /// Its scratch.
    pub scratch: S::Scratch,
    size: Size,
    rank: usize,
    k: usize,
    /// The current choice.
    pub partition: Partition,
    plan: Option<Plan>,
    /// Blocks of C.
    pub clusters: Clusters,
    /// Where many freedoms make one M_d dear: how the clusters are gone through.
    recursion: Option<Recursion>,
    /// Whether a recursion may be taken at all.
    dense_only: bool,
    /// The rows it was planned for, ascending.
    planned_rows: Option<Vec<usize>>,
    /// Columns of `dt` and `a_matrix`: all freedoms, or the most of one cluster.
    columns: usize,
    /// Column of each independent velocity; `NONE` where its cluster needs no D.
    column_of: Vec<u32>,
    /// Entries of the kept rows in independent columns: step of the elimination, entry, place in v_I.
    spread_entries: Vec<(u32, u32, u32)>,
    vdot: Vec<f64>,
    /// Reach of the independent velocity of each column, by cluster.
    column_reach: Vec<f64>,
    margins: Vec<watch::Margin>,
    room: watch::Room,
    /// Room for a left singular vector of C_D.
    left: Vec<f64>,
    /// `s_i² = [M⁻¹]_ii`, frozen between refreshes: they are only scales.
    pub s2: Vec<f64>,
    s: Vec<f64>,
    reach: Vec<f64>,
    row_scale: Vec<f64>,
    row_reach: Vec<Option<f64>>,
    /// What a large move opens each row by.
    row_size: Vec<f64>,
    /// Rows not kept, ascending.
    dropped: Vec<usize>,
    /// May the drawing tolerance bridge this row? A closing that is not kept, where there is one: nothing is closed by it.
    bridges: Vec<bool>,
    /// Must the rows in use stay in use?
    rows_stay: bool,
    /// Do velocities weigh by their reaches, whatever the masses?
    weighs_reaches: bool,
    /// Is M short of mass?
    lacks_mass: bool,
    /// Round-off of each row of Φ: what is left below it means nothing.
    noise: Vec<f64>,
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
    /// A (r x [`columns`](Self::columns)), rows in the order of `partition.dependent`.    (P1)
    pub a_matrix: Vec<f64>,
    rheonomic: bool,
    independent_entries: Vec<(u32, u32, u32)>,
    /// `Dᵀ` (nv x [`columns`](Self::columns)).                                            (P2)
    pub dt: Vec<f64>,
    /// `[0; η]`.
    pub gamma: Vec<f64>,
    /// `[0; ξ]`.
    pub delta: Vec<f64>,
    /// v (nv).
    pub v: Vec<f64>,
    /// M_d, not factored.
    pub md: Vec<f64>,
    /// Cholesky factor of M_d.
    pub md_factor: Vec<f64>,
    hd: Vec<f64>,
    /// `v_I'`.
    pub vdot_independent: Vec<f64>,
    residual: Vec<f64>,
    work: Vec<f64>,
    /// Distance when the rows in use were chosen.
    fresh_distance: Option<f64>,
    /// Factorisations and plans made.
    pub factorisations: u64,
    /// Plans made.
    pub plans: u64,
    /// Choices of rows and independent velocities so far.
    choices: u64,
}

impl<'s, S: ConstrainedSystem> Reduction<'s, S> {
    /// Room for a system whose constraints have rank `rank`; no partition yet. With many freedoms the accelerations come
    /// from the system's recursion over clusters; then there is no M_d, and `dt`, `a_matrix` are packed by cluster.
    pub fn new(system: &'s S, rank: usize) -> Self {
        let mut new = Self::dense(system, rank);
        new.clusters = system.clusters();
        new.dense_only = false;
        new
    }

    /// For questions of geometry alone: velocities weigh by their reaches, so that masses do not enter and may be missing.
    pub fn geometric(system: &'s S, rank: usize) -> Self {
        Self::new(system, rank).weighing_reaches()
    }

    /// The same for one that is at hand.
    pub fn weighing_reaches(mut self) -> Self {
        self.weighs_reaches = true;
        self
    }

    /// The same with `dt` (nv x k), `a_matrix` (r x k) and M_d in full, however many freedoms there are.
    pub fn dense(system: &'s S, rank: usize) -> Self {
        let size = system.size();
        let (n, k) = (size.nv, size.nv - rank);
        Self {
            clusters: Clusters::one(n, size.rows),
            recursion: None,
            dense_only: true,
            planned_rows: None,
            columns: 0,
            column_of: Vec::new(),
            spread_entries: Vec::new(),
            vdot: Vec::new(),
            column_reach: Vec::new(),
            margins: Vec::new(),
            room: watch::Room::default(),
            left: vec![0.0; rank],
            system,
            scratch: system.scratch(),
            size,
            rank,
            k,
            partition: Partition::default(),
            plan: None,
            s2: vec![1.0; n],
            s: vec![1.0; n],
            reach: (0..n).map(|i| system.reach(i)).collect(),
            row_scale: vec![1.0; size.rows],
            row_reach: (0..size.rows).map(|i| system.row_reach(i)).collect(),
            row_size: (0..size.rows).map(|i| system.row_reach(i).unwrap_or(1.0)).collect(),
            dropped: Vec::new(),
            bridges: vec![false; size.rows],
            rows_stay: false,
            weighs_reaches: false,
            lacks_mass: system.lacks_mass(),
            noise: vec![0.0; size.rows],
            phi: vec![0.0; size.holonomic],
            c: vec![0.0; system.pattern().nnz()],
            a: vec![0.0; size.rows],
            b: vec![0.0; size.rows],
            factors: Vec::new(),
            rhs: Vec::new(),
            a_matrix: Vec::new(),
            rheonomic: system.rheonomic(),
            independent_entries: Vec::new(),
            dt: Vec::new(),
            gamma: vec![0.0; n],
            delta: vec![0.0; n],
            v: vec![0.0; n],
            md: Vec::new(),
            md_factor: Vec::new(),
            hd: Vec::new(),
            vdot_independent: vec![0.0; k],
            residual: vec![0.0; n],
            work: vec![0.0; n.max(k).max(rank)],
            fresh_distance: None,
            factorisations: 0,
            plans: 0,
            choices: 0,
        }
    }

    /// The choice in use, for evaluations over other numbers.
    pub fn choice(&self) -> Choice<'_> {
        choice!(self)
    }
    /// Number of independent velocities.
    pub fn k(&self) -> usize {
        self.k
    }
    /// Columns of `dt` and `a_matrix`: k, or with a recursion over clusters the most freedoms of one of them.
    pub fn columns(&self) -> usize {
        self.columns
    }
    /// Are `dt` and M_d held in full, come what may?
    pub fn is_dense(&self) -> bool {
        self.dense_only
    }
    /// Do the accelerations come from a recursion over clusters?
    pub fn by_clusters(&self) -> bool {
        self.recursion.is_some()
    }
    /// Choices of rows and independent velocities so far: their number.
    pub fn choices(&self) -> u64 {
        self.choices
    }
    /// Rank of the constraints.
    pub fn rank(&self) -> usize {
        self.rank
    }
    /// Sizes of the system.
    pub fn size(&self) -> Size {
        self.size
    }

    /// s, the square roots of `s2`.
    pub fn scales(&self) -> &[f64] {
        &self.s
    }

    /// Φ, C and a at (t, q).
    #[inline]
    pub fn position(&mut self, t: f64, q: &[f64]) -> Result<(), SystemError> {
        self.system.position(t, q, &mut self.scratch, &mut self.phi, &mut self.c, &mut self.a)
    }

    /// Refresh the scales `s_i² = [M⁻¹]_ii` and the row scales at the last position.
    pub fn refresh_scales(&mut self, t: f64, q: &[f64]) -> Result<(), SystemError> {
        match self.weighs_reaches {
            true => self.s2.iter_mut().zip(&self.reach).for_each(|(s2, reach)| *s2 = reach * reach),
            false => self.system.inverse_mass_diagonal(t, q, &mut self.scratch, &mut self.s2)?,
        }
        if let Some(i) = self.s2.iter().position(|x| !(x.is_finite() && *x > 0.0)) {
            return Err(SystemError::Mass { name: self.system.velocity_name(i), pivot: 1.0 / self.s2[i] });
        }
        for (s, s2) in self.s.iter_mut().zip(&self.s2) {
            *s = s2.sqrt();
        }
        self.refresh_row_scales();
        Ok(())
    }

    /// Scales that bring the rows of C to 1; 0 for rows without a direction.
    pub fn row_scales(&self) -> &[f64] {
        &self.row_scale
    }

    fn refresh_row_scales(&mut self) {
        let pattern = self.system.pattern();
        for i in 0..self.size.rows {
            let norm = pattern.row(i).map(|e| (self.c[e] * self.s[pattern.col_idx[e]]).powi(2)).sum::<f64>().sqrt();
            // a row of round-off alone has no direction to pivot on
            let empty = norm == 0.0 || self.strength(i).is_some_and(|s| s < EMPTY_ROW);
            self.row_scale[i] = if empty { 0.0 } else { 1.0 / norm };
            // entries of C are lever arms: the lengths that are added up in Φ
            let arm = pattern.row(i).map(|e| self.c[e].abs() * self.reach[pattern.col_idx[e]]).fold(0.0, f64::max);
            self.noise[i] = self.noise[i].max(4.0 * f64::EPSILON * arm);
            let arm = self.noise[i] / (4.0 * f64::EPSILON);
            self.row_size[i] = match self.row_reach[i] {
                Some(reach) => reach.max(arm),
                None if arm > 0.0 => arm,
                None => 1.0,
            };
        }
    }

    /// Take `independent` as the independent velocities and plan the elimination of the others at the last position.
    pub fn set_partition(&mut self, t: f64, independent: &[usize]) -> Result<(), SystemError> {
        let pattern = self.system.pattern();
        let mut eligible = vec![true; self.size.nv];
        for &i in independent {
            eligible[i] = false;
        }
        self.refresh_row_scales();
        let rows = self.eligible_rows();
        let plan =
            Plan::new(pattern, &self.c, &rows, &eligible, &self.row_scale, &self.s, self.rank, PlanOptions::default())
                .map_err(|_| SystemError::Singular { t, pivot: 0.0, limit: SINGULAR_PIVOT })?;
        self.take(t, plan, independent)
    }

    /// Any admissible partition at (t, q): the one a sparse elimination with pivoting arrives at. Leaves the tangent there.
    pub(crate) fn first_partition(&mut self, t: f64, q: &[f64]) -> Result<(), SystemError> {
        self.position(t, q)?;
        self.refresh_scales(t, q)?;
        let pattern = self.system.pattern();
        let (rows, any) = (self.eligible_rows(), vec![true; self.size.nv]);
        let plan =
            Plan::new(pattern, &self.c, &rows, &any, &self.row_scale, &self.s, self.rank, PlanOptions::default())
                .map_err(|_| SystemError::Singular { t, pivot: 0.0, limit: SINGULAR_PIVOT })?;
        let mut dependent = vec![false; self.size.nv];
        plan.pivot_cols().iter().for_each(|&c| dependent[c] = true);
        let independent: Vec<usize> = (0..self.size.nv).filter(|&i| !dependent[i]).collect();
        self.take(t, plan, &independent)?;
        self.tangent(t)
    }

    /// Take `independent` as the independent velocities and `plan`, made at the last position, for the others.
    pub(crate) fn take(&mut self, t: f64, plan: Plan, independent: &[usize]) -> Result<(), SystemError> {
        self.plans += 1;
        self.fresh_distance = None;
        if self.rank > 0 && plan.smallest_pivot() < SINGULAR_PIVOT {
            return Err(SystemError::Singular { t, pivot: plan.smallest_pivot(), limit: SINGULAR_PIVOT });
        }
        self.adopt(plan, independent);
        Ok(())
    }

    fn adopt(&mut self, plan: Plan, independent: &[usize]) {
        let pattern = self.system.pattern();
        let sorted = |x: &[usize]| {
            let mut x = x.to_vec();
            x.sort_unstable();
            x
        };
        let others = sorted(plan.pivot_rows()) != sorted(&self.partition.rows);
        if others || sorted(plan.pivot_cols()) != sorted(&self.partition.dependent) {
            self.choices += 1;
        }
        self.partition.independent = independent.to_vec();
        self.partition.dependent = plan.pivot_cols().to_vec();
        self.partition.rows = plan.pivot_rows().to_vec();
        let mut dropped = vec![true; self.size.rows];
        self.partition.rows.iter().for_each(|&i| dropped[i] = false);
        self.dropped = (0..self.size.rows).filter(|&i| dropped[i]).collect();
        if self.system.drawing_tolerance() > 0.0 {
            let closing = |i: usize| i < self.size.holonomic && !self.system.row_is_drive(i);
            self.bridges.iter_mut().enumerate().for_each(|(i, x)| *x = dropped[i] && closing(i));
        }
        self.plan_recursion();
        self.place_columns(independent);
        let mut place = vec![NONE; self.size.nv];
        for (j, &i) in independent.iter().enumerate() {
            place[i] = j as u32;
        }
        self.independent_entries.clear();
        self.spread_entries.clear();
        for (step, &row) in self.partition.rows.iter().enumerate() {
            for e in pattern.row(row) {
                let j = place[pattern.col_idx[e]];
                if j == NONE {
                    continue;
                }
                self.spread_entries.push((step as u32, e as u32, j));
                let column = self.column_of[j as usize];
                if column != NONE {
                    self.independent_entries.push((step as u32, e as u32, column));
                }
            }
        }
        self.margins.resize(self.clusters.count.max(1), watch::Margin::default());
        if self.recursion.is_some() {
            self.lay_out();
        }
        self.column_reach.clear();
        self.column_reach.resize(self.clusters.count.max(1) * self.columns, 0.0);
        for (&i, &c) in independent.iter().zip(&self.column_of) {
            if c != NONE {
                let cluster = self.clusters.of_velocity[i] as usize;
                self.column_reach[cluster * self.columns + c as usize] = self.reach[i];
            }
        }
        choice!(self).units(&mut self.dt);
        self.gamma.fill(0.0);
        self.delta.fill(0.0);
        self.factors.resize(plan.factor_len(), 0.0);
        self.plan = Some(plan);
    }

    /// How the system goes through its clusters with the rows kept; asked again only when others are.
    fn plan_recursion(&mut self) {
        if self.dense_only {
            return;
        }
        let mut rows = self.partition.rows.clone();
        rows.sort_unstable();
        if self.planned_rows.as_ref() == Some(&rows) {
            return;
        }
        self.recursion = self.system.plan_recursion(&rows, &mut self.scratch);
        self.planned_rows = Some(rows);
        if self.recursion.is_none() {
            // whether it pays depends on how many rows are kept, not on which
            self.dense_only = true;
            self.clusters = Clusters::one(self.size.nv, self.size.rows);
        }
    }

    /// Which column each independent velocity has, and room for what depends on their number.
    fn place_columns(&mut self, independent: &[usize]) {
        let k = self.k;
        match &self.recursion {
            None => {
                self.columns = k;
                self.column_of = (0..k as u32).collect();
                self.md.resize(k * k, 0.0);
                self.md_factor.resize(k * k, 0.0);
                self.hd.resize(k, 0.0);
            }
            Some(recursion) => {
                self.columns = recursion.columns;
                let mut next = vec![0u32; self.clusters.count];
                self.column_of = independent
                    .iter()
                    .map(|&i| {
                        let c = self.clusters.of_velocity[i] as usize;
                        next[c] += 1;
                        if recursion.by_partial_velocities[c] {
                            next[c] - 1
                        } else {
                            NONE
                        }
                    })
                    .collect();
                self.vdot.resize(self.size.nv, 0.0);
            }
        }
        self.rhs.resize(self.rank * (self.columns + 1), 0.0);
        self.a_matrix.resize(self.rank * self.columns, 0.0);
        self.dt.resize(self.size.nv * self.columns, 0.0);
    }

    /// Factor C_D at the last position; a pivot that shrank asks for a new plan on the same partition.
    pub fn factor(&mut self, t: f64) -> Result<(), SystemError> {
        if self.rank == 0 {
            return Ok(());
        }
        self.factorisations += 1;
        let ok = match &self.plan {
            Some(plan) => plan.factor(&self.c, &mut self.factors).is_ok(),
            None => return Err(SystemError::Unchosen("partition")),
        };
        if ok {
            return Ok(());
        }
        if !self.c.iter().all(|x| x.is_finite()) {
            return Err(SystemError::NotFinite { what: "the constraint Jacobian".into(), t });
        }
        let independent = std::mem::take(&mut self.partition.independent);
        // inside a step other rows would close other positions, where the drawing misfits
        self.rows_stay = self.rank < self.size.rows && self.misfit().0 > FITS;
        let planned = self.set_partition(t, &independent);
        self.rows_stay = false;
        if planned.is_err() {
            self.partition.independent = independent;
        }
        planned?;
        match self.plan.as_ref().map(|p| p.factor(&self.c, &mut self.factors)) {
            Some(Ok(())) => Ok(()),
            _ => Err(SystemError::Singular { t, pivot: 0.0, limit: SINGULAR_PIVOT }),
        }
    }

    /// `x ← C_D⁻¹ x` for r numbers in the order of the kept rows; on return in the order of D.
    pub fn solve(&self, x: &mut [f64], columns: usize) {
        if let Some(plan) = &self.plan {
            plan.solve(&self.factors, x, columns);
        }
    }

    /// `x ← C_D⁻ᵀ x` for r numbers in the order of D; on return in the order of the kept rows.
    pub fn solve_transposed(&self, x: &mut [f64]) {
        if let Some(plan) = &self.plan {
            plan.solve_transposed(&self.factors, x, 1);
        }
    }

    /// A, D and η at the last position: `v_D = A v_I + η`.                                 (P1, P2)
    pub fn tangent(&mut self, t: f64) -> Result<(), SystemError> {
        self.factor(t)?;
        let choice = choice!(self);
        choice.tangent(
            &self.factors,
            &self.c,
            &self.a,
            &mut self.rhs,
            &mut self.a_matrix,
            &mut self.dt,
            &mut self.gamma,
        );
        Ok(())
    }

    /// `v = Dᵀ v_I + [0; η]`, left in `self.v`.                                            (P2)
    pub fn spread(&mut self, v_independent: &[f64]) {
        let choice = choice!(self);
        let tangent = (&self.dt[..], &self.gamma[..]);
        choice.spread(&self.factors, &self.c, &self.a, tangent, v_independent, &mut self.work, &mut self.v);
    }

    /// b at (t, q, self.v) and ξ.                                                          (S5, P1)
    pub fn velocity(&mut self, t: f64, q: &[f64]) -> Result<(), SystemError> {
        self.system.velocity(t, q, &self.v, &mut self.scratch, &mut self.b)?;
        choice!(self).bias(&self.factors, &self.b, &mut self.work, &mut self.delta);
        Ok(())
    }

    /// `M_d v_I' = h_d` with the state of the lower levels.                                (P3)
    pub fn acceleration(&mut self, t: f64, q: &[f64]) -> Result<(), SystemError> {
        if self.recursion.is_some() {
            let tangent =
                ClusterTangent { columns: self.columns, dt: &self.dt, delta: &self.delta, c: &self.c, b: &self.b };
            self.system.accelerate(t, q, &self.v, &tangent, &mut self.scratch, &mut self.vdot)?;
            for (x, &i) in self.vdot_independent.iter_mut().zip(&self.partition.independent) {
                *x = self.vdot[i];
            }
            return Ok(());
        }
        let tangent = Tangent { k: self.k, dt: &self.dt, delta: &self.delta };
        self.system.project(t, q, &self.v, &tangent, &mut self.scratch, &mut self.md, &mut self.hd)?;
        self.md_factor.copy_from_slice(&self.md);
        self.vdot_independent.copy_from_slice(&self.hd);
        dense::cholesky(&mut self.md_factor, self.k).map_err(|e| SystemError::Mass {
            name: self.system.velocity_name(self.partition.independent[e.index]),
            pivot: e.pivot,
        })?;
        if self.lacks_mass {
            self.feels()?;
        }
        dense::cholesky_solve(&self.md_factor, self.k, &mut self.vdot_independent);
        Ok(())
    }

    /// Where M is short of mass: does each pivot of M_d hold its own against the metric, or is it what rounding left?
    fn feels(&self) -> Result<(), SystemError> {
        for (j, &i) in self.partition.independent.iter().enumerate() {
            let pivot = self.md_factor[j * self.k + j].powi(2);
            if pivot * self.s2[i] < UNFELT {
                return Err(SystemError::Mass { name: self.system.velocity_name(i), pivot });
            }
        }
        Ok(())
    }

    /// Take pivots of M_d as they are: tangent velocities of others have units of their own.
    pub fn trusting_pivots(mut self) -> Self {
        self.lacks_mass = false;
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
        &self.hd
    }

    /// `v' = Dᵀ v_I' + [0; ξ]` of the last evaluation.                                     (P2)
    pub fn full_acceleration(&self, out: &mut [f64]) {
        if self.recursion.is_some() {
            out.copy_from_slice(&self.vdot);
            return;
        }
        choice!(self).full_acceleration(&self.dt, &self.delta, &self.vdot_independent, out);
    }

    /// Multipliers of all rows from the dependent rows of `M v' − h`: `C_Dᵀ λ = (M v' − h)_D`; zero on dropped rows.
    ///                                                                                     (R1, 41)
    pub fn multipliers(&mut self, t: f64, q: &[f64], vdot: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        self.system.inverse_dynamics(t, q, &self.v, vdot, &mut self.scratch, &mut self.residual)?;
        choice!(self).multipliers(&self.factors, &self.residual, &mut self.work, out);
        Ok(())
    }

    /// One Newton step of the dependent coordinates with the current factors, `q_D ← q_D − C_D⁻¹ Φ`.  (34)
    ///
    /// Needs `position` and `factor` at q, and all rows holonomic. Next to a singular position the step amplifies the
    /// round-off of Φ without bounds; one that does so more than [`LARGEST_AMPLIFICATION`] times is left for a later
    /// step, when the mechanism has passed. True if q moved.
    pub fn correct_dependent(&mut self, q: &mut [f64]) -> bool {
        let x = &mut self.work[..self.rank];
        for (x, &row) in x.iter_mut().zip(&self.partition.rows) {
            *x = -self.phi[row];
        }
        if let Some(plan) = &self.plan {
            plan.solve(&self.factors, x, 1);
        }
        // both in reaches where the system knows them; elsewhere both in natural scales, so that units cancel
        let known = self.row_reach.iter().all(Option::is_some);
        let part = |i: usize| match known {
            true if self.noise[i] > 0.0 => 4.0 * f64::EPSILON / self.noise[i],
            true => 0.0,
            false => self.row_scale[i],
        };
        let rows = self.phi.iter().enumerate().filter(|(i, _)| !self.bridges[*i]);
        let residual = rows.fold(0.0, |m: f64, (i, x)| m.max(x.abs() * part(i)));
        let scale = if known { &self.reach } else { &self.s };
        let moved = x.iter().zip(&self.partition.dependent).fold(0.0, |m: f64, (x, &i)| m.max(x.abs() / scale[i]));
        if moved > LARGEST_AMPLIFICATION * residual && moved < POSTPONED {
            return false;
        }
        self.move_dependent(q);
        true
    }

    /// The step that [`Reduction::correct_dependent`] left for later: for those who must close here and see that more
    /// than round-off is open.
    pub fn move_dependent(&mut self, q: &mut [f64]) {
        self.residual.fill(0.0);
        for (x, &i) in self.work.iter().zip(&self.partition.dependent) {
            self.residual[i] = *x;
        }
        self.system.step(q, &self.residual);
    }
}
