//! The criterion of a choice at an evaluation: σ, √μ and ρ, densely or cluster by cluster.

use super::Reduction;
use crate::partition::criterion::{self, Quality};
use crate::partition::Partition;
use crate::system::{ClusterTangent, Clustered, ConstrainedSystem, SystemError};
use partita_math::dense;
use partita_math::elimination::Plan;
use partita_math::ratio::{self, Forms};

/// Most degrees of freedom of a cluster for which its block of M_d⁻¹ is formed. Reason: cost and memory of blocks grow with
/// their cube and square; of more, the ratios are found by products, whose number does not grow.
const FORMED: usize = 100;

impl<S: ConstrainedSystem> Reduction<'_, S> {
    /// σ and √μ at the last evaluation; of many clusters, those of the worst.
    pub fn quality(&mut self, t: f64, q: &[f64]) -> Result<Quality, SystemError> {
        let system = self.system.clone();
        if let (Some(_), Some(clustered)) = (&self.planned.recursion, system.clustered()) {
            return self.quality_by_clusters(clustered, t, q);
        }
        quality_of(&*self.system, t, q, &self.planned.partition.independent, &self.at.md, &mut self.scratch)
    }

    /// The worst σ and √μ of all clusters: each with the others free to move.
    fn quality_by_clusters(
        &mut self,
        clustered: &dyn Clustered<S::Scratch>,
        t: f64,
        q: &[f64],
    ) -> Result<Quality, SystemError> {
        let mut blocks: Vec<(Vec<usize>, Vec<f64>)> = Vec::new();
        let mut diagonal = vec![0.0; self.size.nv];
        let tangent = self.at.cluster_tangent(self.planned.columns);
        let independent = &self.planned.partition.independent;
        let form = &mut |_: usize, which: &[usize], values: &[f64]| blocks.push((which.to_vec(), values.to_vec()));
        clustered.mobility(&tangent, independent, FORMED, &mut self.scratch, &mut diagonal, form);
        let mut lengths = vec![0.0; self.size.nv];
        self.system.inverse_mass_diagonal(t, q, &mut self.scratch, &mut lengths)?;
        let mut worst = Quality { sigma: 1.0, sqrt_mu: 1.0 };
        for (which, mut values) in blocks {
            let k = which.len();
            if k == 0 {
                continue;
            }
            let s2: Vec<f64> = which.iter().map(|&i| lengths[i]).collect();
            if k == 1 {
                let x = (values[0] / s2[0]).max(0.0).sqrt().min(1.0);
                worst = Quality { sigma: worst.sigma.min(x), sqrt_mu: worst.sqrt_mu.min(x) };
                continue;
            }
            let mut block = vec![0.0; self.size.nv * k];
            self.system.inverse_mass_columns(t, q, &which, &mut self.scratch, &mut block)?;
            let block: Vec<f64> = which.iter().flat_map(|&i| block[i * k..(i + 1) * k].iter().copied()).collect();
            if dense::cholesky(&mut values, k).is_err() {
                return Ok(Quality { sigma: 0.0, sqrt_mu: 0.0 });
            }
            let mut md = vec![0.0; k * k];
            dense::inverse_from_cholesky(&values, k, &mut md);
            let own = criterion::quality(&md, &s2, &block);
            worst = Quality { sigma: worst.sigma.min(own.sigma), sqrt_mu: worst.sqrt_mu.min(own.sqrt_mu) };
        }
        let mut own: Vec<Vec<usize>> = vec![Vec::new(); self.planned.clusters.count];
        independent.iter().for_each(|&i| own[self.planned.clusters.of_velocity[i] as usize].push(i));
        for which in own.iter().filter(|which| which.len() > FORMED) {
            let own = self.quality_by_products(clustered, (t, q), which, &lengths)?;
            worst = Quality { sigma: worst.sigma.min(own.sigma), sqrt_mu: worst.sqrt_mu.min(own.sqrt_mu) };
        }
        Ok(worst)
    }

    /// σ and √μ of a cluster without its block W of M_d⁻¹: σ² is the least xᵀ W x / Σ s² x², μ the least
    /// xᵀ W x / xᵀ [M⁻¹]_II x.                                                            (26), (27)
    fn quality_by_products(
        &mut self,
        clustered: &dyn Clustered<S::Scratch>,
        (t, q): (f64, &[f64]),
        which: &[usize],
        lengths: &[f64],
    ) -> Result<Quality, SystemError> {
        let n = self.size.nv;
        let size: Vec<f64> = which.iter().map(|&i| lengths[i]).collect();
        let mut index = vec![None; n];
        which.iter().enumerate().for_each(|(j, &i)| index[i] = Some(j));
        let own = |x: &&(u32, u32, u32)| index[self.planned.partition.independent[x.2 as usize]].is_some();
        let spread: Vec<_> = self.planned.spread_entries.iter().filter(own).copied().collect();
        let Some(plan) = &self.planned.plan else { return Ok(Quality { sigma: 1.0, sqrt_mu: 1.0 }) };
        let mut cluster = Cluster {
            system: &*self.system,
            clustered,
            scratch: &mut self.scratch,
            partition: &self.planned.partition,
            plan,
            factors: &self.at.factors,
            c: &self.at.c,
            dt: (self.planned.columns, &self.at.dt),
            state: (t, q, &self.at.v),
            which,
            index,
            spread,
            size: &size,
            none: vec![0.0; n],
            no_rows: vec![0.0; self.size.rows],
            at_rest: vec![0.0; n],
            effort: vec![0.0; n],
            answer: vec![0.0; n],
            dependent: vec![0.0; self.planned.rank],
            freely: false,
        };
        // irregular, so that it is orthogonal to no vector of a regular system
        let first: Vec<f64> = (0..which.len()).map(|i| (1.0 + 0.5 * (i as f64 * 1.7).sin()) / size[i].sqrt()).collect();
        let sigma = ratio::least_ratio(first.clone(), &mut cluster);
        cluster.freely = true;
        let mu = ratio::least_ratio(first, &mut cluster);
        let root = |x: f64| x.max(0.0).sqrt().min(1.0);
        Ok(Quality { sigma: root(sigma?), sqrt_mu: root(mu?) })
    }

    /// P4 at the last evaluation, with fresh scales.
    pub fn measure(&mut self, t: f64, q: &[f64], rho: &mut [f64]) -> Result<(), SystemError> {
        let mut s2 = vec![0.0; self.size.nv];
        self.system.inverse_mass_diagonal(t, q, &mut self.scratch, &mut s2)?;
        if let (Some(_), Some(clustered)) = (&self.planned.recursion, self.system.clustered()) {
            let tangent = self.at.cluster_tangent(self.planned.columns);
            let independent = &self.planned.partition.independent;
            clustered.mobility(&tangent, independent, usize::MAX, &mut self.scratch, rho, &mut |_, _, _| {});
            for (r, s2) in rho.iter_mut().zip(&s2) {
                *r = (*r / s2).max(0.0).sqrt().min(1.0);
            }
            return Ok(());
        }
        let mut work = vec![0.0; self.planned.k];
        criterion::measure_tangent(&self.at.dt, self.planned.k, &self.at.md_factor, &s2, &mut work, rho);
        Ok(())
    }
}

/// A cluster, by products: its block of M_d⁻¹ with all others free to move, and lengths.
struct Cluster<'c, S: ConstrainedSystem> {
    system: &'c S,
    clustered: &'c dyn Clustered<S::Scratch>,
    scratch: &'c mut S::Scratch,
    partition: &'c Partition,
    plan: &'c Plan,
    factors: &'c [f64],
    c: &'c [f64],
    /// Columns of the packed Dᵀ, and their values.
    dt: (usize, &'c [f64]),
    /// Time, positions, velocities.
    state: (f64, &'c [f64], &'c [f64]),
    which: &'c [usize],
    /// Place of each velocity in the cluster's vector.
    index: Vec<Option<usize>>,
    /// Entries of C in its independent columns: step, entry, index in v_I.
    spread: Vec<(u32, u32, u32)>,
    size: &'c [f64],
    none: Vec<f64>,
    no_rows: Vec<f64>,
    /// −h.
    at_rest: Vec<f64>,
    effort: Vec<f64>,
    answer: Vec<f64>,
    dependent: Vec<f64>,
    /// Whether lengths are those of [M⁻¹]_II, not of its diagonal.
    freely: bool,
}

impl<S: ConstrainedSystem> Forms for Cluster<'_, S> {
    type Error = SystemError;

    fn products(&mut self, x: &[f64], ax: &mut [f64], bx: &mut [f64]) -> Result<(), SystemError> {
        let (columns, dt) = self.dt;
        let tangent = ClusterTangent { columns, dt, delta: &self.none, c: self.c, b: &self.no_rows };
        self.effort.fill(0.0);
        self.which.iter().zip(x).for_each(|(&i, x)| self.effort[i] = *x);
        self.clustered.respond(&tangent, &self.effort, self.scratch, &mut self.answer)?;
        self.which.iter().zip(ax).for_each(|(&i, to)| *to = self.answer[i]);
        if self.freely {
            self.clustered.respond_freely(&self.effort, self.scratch, &mut self.answer)?;
            self.which.iter().zip(bx).for_each(|(&i, to)| *to = self.answer[i]);
        } else {
            bx.iter_mut().zip(x).zip(self.size).for_each(|((to, x), size)| *to = x * size);
        }
        Ok(())
    }

    /// By the block of Dᵀ M D: M_d with all other clusters at rest.
    fn precondition(&mut self, x: &mut [f64]) -> Result<(), SystemError> {
        let Partition { independent, dependent, .. } = self.partition;
        let place = |j: u32| self.index[independent[j as usize]];
        self.dependent.fill(0.0);
        for &(step, e, j) in &self.spread {
            self.dependent[step as usize] -= self.c[e as usize] * place(j).map_or(0.0, |j| x[j]);
        }
        self.plan.solve(self.factors, &mut self.dependent, 1);
        self.effort.fill(0.0);
        self.which.iter().zip(&*x).for_each(|(&i, x)| self.effort[i] = *x);
        dependent.iter().zip(&self.dependent).for_each(|(&i, x)| self.effort[i] = *x);
        let (t, q, v) = self.state;
        self.system.inverse_dynamics(t, q, v, &self.none, self.scratch, &mut self.at_rest)?;
        self.system.inverse_dynamics(t, q, v, &self.effort, self.scratch, &mut self.answer)?;
        self.answer.iter_mut().zip(&self.at_rest).for_each(|(x, rest)| *x -= rest);
        self.dependent.iter_mut().zip(dependent).for_each(|(x, &i)| *x = self.answer[i]);
        self.plan.solve_transposed(self.factors, &mut self.dependent, 1);
        self.which.iter().zip(&mut *x).for_each(|(&i, x)| *x = self.answer[i]);
        for &(step, e, j) in &self.spread {
            if let Some(j) = place(j) {
                x[j] -= self.c[e as usize] * self.dependent[step as usize];
            }
        }
        Ok(())
    }
}

/// σ and √μ of independent velocities with the reduced mass matrix M_d at `(t, q)`, the last position of the scratch.
pub fn quality_of<S: ConstrainedSystem>(
    system: &S,
    t: f64,
    q: &[f64],
    independent: &[usize],
    md: &[f64],
    scratch: &mut S::Scratch,
) -> Result<Quality, SystemError> {
    let (n, k) = (system.size().nv, independent.len());
    let mut columns = vec![0.0; n * k];
    system.inverse_mass_columns(t, q, independent, scratch, &mut columns)?;
    let block: Vec<f64> = independent.iter().flat_map(|&i| columns[i * k..(i + 1) * k].iter().copied()).collect();
    let s2: Vec<f64> = (0..k).map(|j| block[j * k + j]).collect();
    Ok(criterion::quality(md, &s2, &block))
}
