//! Occasional decisions at a position: scales of velocities and rows, the choice and the plan of its elimination, the
//! recursion over the clusters, and the layout of the data of an evaluation.

use super::{is_round_off, Reduction, NONE};
use crate::clusters::Clusters;
use crate::system::{ConstrainedSystem, SystemError};
use partita_math::elimination::{Plan, PlanOptions};
use partita_math::tolerance;

impl<S: ConstrainedSystem> Reduction<'_, S> {
    /// Refresh the scales `s_i² = [M⁻¹]_ii` and the row scales at the last position.
    pub fn refresh_scales(&mut self, t: f64, q: &[f64]) -> Result<(), SystemError> {
        match self.scale.weighs_displacements {
            true => self
                .scale
                .s2
                .iter_mut()
                .zip(&self.scale.displacement)
                .for_each(|(s2, displacement)| *s2 = displacement * displacement),
            false => self.system.inverse_mass_diagonal(t, q, &mut self.scratch, &mut self.scale.s2)?,
        }
        if let Some(i) = self.scale.s2.iter().position(|x| !(x.is_finite() && *x > 0.0)) {
            return Err(SystemError::Mass {
                name: self.system.structure().velocity_name(i),
                pivot: 1.0 / self.scale.s2[i],
            });
        }
        for (s, s2) in self.scale.s.iter_mut().zip(&self.scale.s2) {
            *s = s2.sqrt();
        }
        self.refresh_row_scales();
        Ok(())
    }

    /// Scales that normalise the rows of C; 0 for rows without a direction.
    pub fn row_scales(&self) -> &[f64] {
        &self.scale.row_scale
    }

    pub(super) fn refresh_row_scales(&mut self) {
        let pattern = self.system.pattern();
        for i in 0..self.size.rows {
            let norm =
                pattern.row(i).map(|e| (self.at.c[e] * self.scale.s[pattern.col_idx[e]]).powi(2)).sum::<f64>().sqrt();
            let empty = norm == 0.0 || self.strength(i).is_some_and(is_round_off);
            self.scale.row_scale[i] = if empty { 0.0 } else { 1.0 / norm };
            // entries of C are lever arms: the lengths that are added up in Φ
            let arm = pattern
                .row(i)
                .map(|e| self.at.c[e].abs() * self.scale.displacement[pattern.col_idx[e]])
                .fold(0.0, f64::max);
            let noise = self.scale.noise[i].max(tolerance::ROUNDING * arm);
            self.counts.version += u64::from(noise != self.scale.noise[i]);
            self.scale.noise[i] = noise;
            let arm = self.scale.noise[i] / tolerance::ROUNDING;
            self.scale.row_size[i] = match self.system.structure().rows[i].displacement {
                Some(displacement) => displacement.max(arm),
                None if arm > 0.0 => arm,
                None => 1.0,
            };
        }
    }

    /// Take `independent` as the independent velocities and plan the elimination of the others at the last position.
    /// The rows in use are kept where they serve: they span all others, whatever the coordinates.
    pub fn set_partition(&mut self, t: f64, independent: &[usize]) -> Result<(), SystemError> {
        self.refresh_row_scales();
        if self.has_rows() && (self.plan_with(t, independent, &self.rows_in_use()).is_ok()) {
            return Ok(());
        }
        let rows = self.eligible_rows();
        self.plan_with(t, independent, &rows)
    }

    /// Whether redundant rows have been chosen already.
    fn has_rows(&self) -> bool {
        self.planned.rank > 0
            && self.planned.rank < self.size.rows
            && self.planned.partition.rows.len() == self.planned.rank
    }

    /// Plan the elimination of the dependent velocities by some of these rows, at the current row scales.
    pub(super) fn plan_with(&mut self, t: f64, independent: &[usize], rows: &[bool]) -> Result<(), SystemError> {
        let pattern = self.system.pattern();
        let mut eligible = vec![true; self.size.nv];
        for &i in independent {
            eligible[i] = false;
        }
        let plan = Plan::new(
            pattern,
            &self.at.c,
            rows,
            &eligible,
            &self.scale.row_scale,
            &self.scale.s,
            self.planned.rank,
            PlanOptions::default(),
        )
        .map_err(|_| SystemError::Singular { t, pivot: 0.0, limit: tolerance::SINGULAR_PIVOT })?;
        self.take(t, plan, independent)
    }

    /// Any admissible partition at (t, q): the one a sparse elimination with pivoting arrives at. Evaluates the tangent
    /// there.
    pub(crate) fn first_partition(&mut self, t: f64, q: &[f64]) -> Result<(), SystemError> {
        self.position(t, q)?;
        self.refresh_scales(t, q)?;
        if self.has_rows() && self.plan_freely(t, &self.rows_in_use()).is_ok() {
            self.factor(t)?;
            self.exchange_rows(t)?;
        } else {
            self.plan_freely(t, &self.eligible_rows())?;
        }
        self.tangent(t)
    }

    /// Any admissible partition with rows out of these.
    fn plan_freely(&mut self, t: f64, rows: &[bool]) -> Result<(), SystemError> {
        let any = vec![true; self.size.nv];
        self.plan_among(t, &any, rows)
    }

    /// By the rows in use, at the last position: as many of these velocities become dependent as the rows determine.
    pub fn plan_dependent(&mut self, t: f64, among: &[usize]) -> Result<(), SystemError> {
        let mut eligible = vec![false; self.size.nv];
        among.iter().for_each(|&i| eligible[i] = true);
        self.plan_among(t, &eligible, &self.rows_in_use())
    }

    /// Any admissible partition with dependent velocities among these and rows out of these.
    fn plan_among(&mut self, t: f64, eligible: &[bool], rows: &[bool]) -> Result<(), SystemError> {
        let pattern = self.system.pattern();
        let plan = Plan::new(
            pattern,
            &self.at.c,
            rows,
            eligible,
            &self.scale.row_scale,
            &self.scale.s,
            self.planned.rank,
            PlanOptions::default(),
        )
        .map_err(|_| SystemError::Singular { t, pivot: 0.0, limit: tolerance::SINGULAR_PIVOT })?;
        let mut dependent = vec![false; self.size.nv];
        plan.pivot_cols().iter().for_each(|&c| dependent[c] = true);
        let independent: Vec<usize> = (0..self.size.nv).filter(|&i| !dependent[i]).collect();
        self.take(t, plan, &independent)
    }

    /// Take `independent` as the independent velocities and `plan`, made at the last position, for the others.
    pub(crate) fn take(&mut self, t: f64, plan: Plan, independent: &[usize]) -> Result<(), SystemError> {
        self.counts.plans += 1;
        if self.planned.rank > 0 && plan.smallest_pivot() < tolerance::SINGULAR_PIVOT {
            return Err(SystemError::Singular { t, pivot: plan.smallest_pivot(), limit: tolerance::SINGULAR_PIVOT });
        }
        self.adopt(plan, independent);
        Ok(())
    }

    pub(super) fn adopt(&mut self, plan: Plan, independent: &[usize]) {
        self.counts.version += 1;
        let system = self.system.clone();
        let pattern = system.pattern();
        // the rows in use are those not left out, once there are any
        let now = &mut self.planned.partition;
        let new_rows =
            now.rows.len() != self.planned.rank || plan.pivot_rows().iter().any(|&i| self.planned.left_out[i]);
        let mut was_dependent = vec![false; self.size.nv];
        now.dependent.iter().for_each(|&i| was_dependent[i] = true);
        let new_columns =
            now.dependent.len() != self.planned.rank || plan.pivot_cols().iter().any(|&i| !was_dependent[i]);
        self.counts.choices += u64::from(new_rows || new_columns);
        for (to, from) in [
            (&mut now.independent, independent),
            (&mut now.dependent, plan.pivot_cols()),
            (&mut now.rows, plan.pivot_rows()),
        ] {
            to.clear();
            to.extend_from_slice(from);
        }
        self.planned.left_out.fill(true);
        now.rows.iter().for_each(|&i| self.planned.left_out[i] = false);
        self.planned.dropped.clear();
        self.planned.dropped.extend((0..self.size.rows).filter(|&i| self.planned.left_out[i]));
        self.lay_out_rows();
        self.plan_recursion();
        self.place_columns(independent);
        let mut index = vec![NONE; self.size.nv];
        for (j, &i) in independent.iter().enumerate() {
            index[i] = j as u32;
        }
        self.planned.independent_entries.clear();
        self.planned.spread_entries.clear();
        for (step, &row) in self.planned.partition.rows.iter().enumerate() {
            for e in pattern.row(row) {
                let j = index[pattern.col_idx[e]];
                if j == NONE {
                    continue;
                }
                self.planned.spread_entries.push((step as u32, e as u32, j));
                let column = self.planned.column_of[j as usize];
                if column != NONE {
                    self.planned.independent_entries.push((step as u32, e as u32, column));
                }
            }
        }
        self.distance.lay_out(self.planned.rank, self.planned.k, self.planned.clusters.count);
        if self.planned.recursion.is_some() {
            self.lay_out();
        }
        self.planned.choice().units(&mut self.at.dt);
        self.at.gamma.fill(0.0);
        self.at.delta.fill(0.0);
        self.at.factors.resize(plan.factor_len(), 0.0);
        self.planned.plan = Some(plan);
    }

    /// The system's method for its clusters with the rows kept; requested again only when others are kept.
    fn plan_recursion(&mut self) {
        if self.planned.dense_only {
            return;
        }
        let mut rows = self.planned.partition.rows.clone();
        rows.sort_unstable();
        if self.planned.planned_rows.as_ref() == Some(&rows) {
            return;
        }
        self.planned.recursion = self.system.clustered().and_then(|x| x.plan_recursion(&rows, &mut self.scratch));
        self.planned.planned_rows = Some(rows);
        if self.planned.recursion.is_none() {
            // whether it is cheaper depends on how many rows are kept, not on which
            self.planned.dense_only = true;
            self.planned.clusters = Clusters::one(self.size.nv, self.size.rows);
        }
    }

    /// The column of each independent velocity, and memory that depends on their number.
    fn place_columns(&mut self, independent: &[usize]) {
        let k = self.planned.k;
        match &self.planned.recursion {
            None => {
                self.planned.columns = k;
                self.planned.column_of = (0..k as u32).collect();
                self.at.md.resize(k * k, 0.0);
                self.at.md_factor.resize(k * k, 0.0);
                self.at.hd.resize(k, 0.0);
            }
            Some(recursion) => {
                self.planned.columns = recursion.columns;
                let mut next = vec![0u32; self.planned.clusters.count];
                self.planned.column_of = independent
                    .iter()
                    .map(|&i| {
                        let c = self.planned.clusters.of_velocity[i] as usize;
                        next[c] += 1;
                        if recursion.by_partial_velocities[c] {
                            next[c] - 1
                        } else {
                            NONE
                        }
                    })
                    .collect();
            }
        }
        self.at.rhs.resize(self.planned.rank * (self.planned.columns + 1), 0.0);
        self.at.a_matrix.resize(self.planned.rank * self.planned.columns, 0.0);
        self.at.dt.resize(self.size.nv * self.planned.columns, 0.0);
    }
}
