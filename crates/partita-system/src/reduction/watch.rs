//! Monitoring of the reduction: distance from singularity, closure errors, quality of the choice.

use super::Reduction;
use crate::partition::criterion;
use crate::system::{ClusterTangent, ConstrainedSystem, SystemError};
use partita_math::dense::{self, Matrix};
use partita_math::elimination::{Block, Pattern, Plan};
use partita_math::factor;
use partita_math::tolerance;

impl<S: ConstrainedSystem> Reduction<'_, S> {
    /// Smallest scaled pivot of the current plan: how far C_D was from losing rank when it was made.
    pub fn smallest(&self) -> f64 {
        self.planned.plan.as_ref().map_or(1.0, Plan::smallest_pivot)
    }

    /// Side of the singular positions of C_D at the last factorisation.
    pub fn sides(&self, sides: &mut Sides) {
        sides.negative.clear();
        (sides.choice, sides.basis) = ((self.counts.choices, 0), false);
        sides.of_blocks.clear();
        if let Some(plan) = self.planned.plan.as_ref().filter(|_| self.planned.rank > 0) {
            sides.blocks = plan.signs(&self.at.factors, &mut sides.negative);
            let partition = &self.planned.partition;
            let scale =
                |step: usize| (1.0 / self.size_of_row(step), self.scale.displacement[partition.dependent[step]]);
            plan.blocks(&self.at.c, &self.at.factors, scale, &mut sides.of_blocks);
        }
    }

    /// Largest |Φ|; NaN counts as infinite.
    pub fn closure(&self) -> f64 {
        largest(self.at.phi.iter().copied())
    }

    /// Largest |Φ| of the rows kept.
    pub fn closure_of_kept(&self) -> f64 {
        largest(self.at.phi.iter().zip(&self.planned.left_out).filter(|x| !x.1).map(|x| *x.0))
    }

    /// Whether the kept rows are zero up to their own round-off.
    pub fn is_closed(&self) -> bool {
        self.at
            .phi
            .iter()
            .zip(&self.scale.noise)
            .zip(&self.planned.left_out)
            .all(|((x, n), left_out)| *left_out || x.abs() <= *n)
    }

    /// Largest |Φ_i| and its row, each Φ_i in units of its own round-off, at least that of the closure error of a large
    /// displacement: a row without motion consists of rounding errors alone. NaN counts as infinite.
    pub fn closure_error(&self) -> (f64, usize) {
        let rows = self.at.phi.iter().zip(&self.scale.noise).enumerate().filter(|(i, _)| !self.planned.left_out[*i]);
        rows.fold((0.0, 0), |best: (f64, usize), (i, (x, n))| {
            let least = self.system.structure().rows[i]
                .displacement
                .map_or(f64::MIN_POSITIVE, |displacement| tolerance::ROUNDING * displacement);
            let closure_error = if x.is_nan() { f64::INFINITY } else { x.abs() / n.max(least) };
            if closure_error > best.0 {
                (closure_error, i)
            } else {
                best
            }
        })
    }

    /// Largest |C v + a| over all rows at the last position with `self.v`.
    pub fn velocity_closure(&self) -> f64 {
        largest(velocity_residuals(self.system.pattern(), &self.at.c, &self.at.v, &self.at.a))
    }

    /// Squared size of row i of C for unit characteristic displacements, over its closure error under a large
    /// displacement: 1 for a well-scaled row.
    pub fn strength(&self, i: usize) -> Option<f64> {
        Some(strength(
            self.system.pattern(),
            &self.at.c,
            &self.scale.displacement,
            i,
            self.system.structure().rows[i].displacement?,
        ))
    }

    /// P5 cluster by cluster at the last tangent: volumes are products over clusters, so each cluster chooses
    /// independently. Clusters that form no D keep their choice; it is changed by switches.
    pub fn choose_by_clusters(&mut self, weights: Option<&[f64]>) -> Result<Vec<usize>, SystemError> {
        let (Some(recursion), Some(clustered)) = (&self.planned.recursion, self.system.clustered()) else {
            return Ok(self.planned.partition.independent.clone());
        };
        let n = self.size.nv;
        let (none, mut out) = (vec![0.0; n], vec![0.0; n]);
        let tangent = ClusterTangent {
            columns: self.planned.columns,
            dt: &self.at.dt,
            delta: &none,
            c: &self.at.c,
            b: &self.at.b,
        };
        clustered.respond(&tangent, &none, &mut self.scratch, &mut out)?;
        let mut own: Vec<Vec<usize>> = vec![Vec::new(); self.planned.clusters.count];
        for &i in &self.planned.partition.independent {
            own[self.planned.clusters.of_velocity[i] as usize].push(i);
        }
        let mut chosen = Vec::with_capacity(self.planned.k);
        let mut few = 0;
        for (c, velocities) in self.planned.clusters.velocities().iter().enumerate() {
            if !recursion.by_partial_velocities[c] {
                chosen.extend_from_slice(&own[c]);
                continue;
            }
            let k = own[c].len();
            let mut mass = clustered.cluster_mass(few, &self.scratch).to_vec();
            few += 1;
            if k == 0 {
                continue;
            }
            if let Err(e) = dense::cholesky(&mut mass, k) {
                let name = self.system.structure().velocity_name(own[c][e.index]);
                return Err(SystemError::Mass { name, pivot: e.pivot });
            }
            let dt: Vec<f64> = velocities
                .iter()
                .flat_map(|&i| &self.at.dt[i * self.planned.columns..i * self.planned.columns + k])
                .copied()
                .collect();
            let s2: Vec<f64> = velocities.iter().map(|&i| self.scale.s2[i]).collect();
            let weights: Option<Vec<f64>> = weights.map(|w| velocities.iter().map(|&i| w[i]).collect());
            let found = criterion::choose(&dt, k, &mass, &s2, weights.as_deref());
            chosen.extend(found.iter().map(|&i| velocities[i]));
        }
        chosen.sort_unstable();
        Ok(chosen)
    }

    /// Velocities with these rates that satisfy S4 and differ from some with the momentum `M v` by the least kinetic
    /// energy, and the rates they reach; by responses to efforts along the rated velocities. Needs the tangent of the
    /// partition.
    pub fn least_energy(
        &mut self,
        momentum: &[f64],
        rates: &[(usize, f64)],
    ) -> Result<(Vec<f64>, Vec<f64>), SystemError> {
        let Some(clustered) = self.system.clustered() else { return Err(SystemError::Unchosen("recursion")) };
        let n = self.size.nv;
        let mut effort = momentum.to_vec();
        let mut v = vec![0.0; n];
        let tangent = ClusterTangent {
            columns: self.planned.columns,
            dt: &self.at.dt,
            delta: &self.at.gamma,
            c: &self.at.c,
            b: &self.at.a,
        };
        clustered.respond(&tangent, &effort, &mut self.scratch, &mut v)?;
        let (none, no_rows) = (vec![0.0; n], vec![0.0; self.size.rows]);
        let mut answers = Matrix::new(rates.len(), n);
        for (j, &(i, _)) in rates.iter().enumerate() {
            effort.fill(0.0);
            effort[i] = 1.0;
            let tangent = ClusterTangent {
                columns: self.planned.columns,
                dt: &self.at.dt,
                delta: &none,
                c: &self.at.c,
                b: &no_rows,
            };
            clustered.respond(&tangent, &effort, &mut self.scratch, answers.row_mut(j))?;
        }
        // in natural scales, so that units do not affect what counts as zero
        let mut normal = Matrix::new(rates.len(), rates.len());
        let mut want = vec![0.0; rates.len()];
        for (a, &(i, rate)) in rates.iter().enumerate() {
            want[a] = (rate - v[i]) / self.scale.s[i];
            for (b, &(j, _)) in rates.iter().enumerate() {
                normal[(a, b)] = answers[(b, i)] / (self.scale.s[i] * self.scale.s[j]);
            }
        }
        let (efforts, _) = factor::least_squares_min_norm(&normal, &want, tolerance::NULL_VALUE)
            .map_err(|_| SystemError::NotFinite { what: "a rate".into(), t: 0.0 })?;
        for (b, &(j, _)) in rates.iter().enumerate() {
            for (v, x) in v.iter_mut().zip(answers.row(b)) {
                *v += x * efforts[b] / self.scale.s[j];
            }
        }
        let reached = rates.iter().map(|&(i, _)| v[i]).collect();
        Ok((v, reached))
    }
}

/// Signs of the determinants of C_D, block by block.
#[derive(Clone, Debug)]
pub struct Sides {
    negative: Vec<bool>,
    /// Whether another determinant is negative: that of the velocities in use by those that are independent.
    basis: bool,
    /// The blocks in characteristic displacements, if there are several.
    of_blocks: Vec<Block>,
    /// The choice and the blocks they belong to.
    choice: (u64, u64),
    blocks: u64,
}

impl Sides {
    /// Memory for this number of rows.
    pub fn new(rank: usize) -> Self {
        let (negative, of_blocks) = (Vec::with_capacity(rank + 2), Vec::with_capacity(rank));
        Self { negative, of_blocks, basis: false, choice: (0, 0), blocks: 0 }
    }

    /// The choice they belong to.
    pub fn choice(&self) -> (u64, u64) {
        self.choice
    }

    /// Together with the sign of another determinant, that of the basis with this number.
    pub fn extend(&mut self, negative: bool, basis: u64) {
        (self.choice.1, self.basis) = (basis, negative);
    }

    /// Distance of C_D from losing rank, from below: the least of its blocks. None where there is one block.
    pub fn clearance(&self) -> Option<f64> {
        self.of_blocks.iter().map(Block::least_singular_value).reduce(f64::min)
    }

    /// Whether every block stayed regular in between, if none moved by more than `by`: what all of a long chain loses is
    /// small everywhere, and says little about the loops by themselves.
    pub fn stay_regular(&self, other: &Self, by: f64) -> bool {
        let comparable = self.choice == other.choice && self.blocks == other.blocks && !self.of_blocks.is_empty();
        let stays = |(a, b): (&Block, &Block)| a.least_singular_value() + b.least_singular_value() >= by;
        comparable && self.of_blocks.iter().zip(&other.of_blocks).all(stays)
    }

    /// Whether C_D was singular in between. Not distinguished from sides of another choice.
    pub fn differ(&self, other: &Self) -> bool {
        self.changed(other) > 0
    }

    /// Number of blocks of C_D whose sides differ; of other blocks, whether C_D was singular in between; of another
    /// choice, none.
    ///
    /// With a basis S the velocities in use are those of [C; S], whose determinant is the product of those of C_D and of
    /// S Dᵀ: at a dead point of the independent coordinates alone both change their signs, which is none of theirs.
    pub fn changed(&self, other: &Self) -> usize {
        if self.choice != other.choice {
            return 0;
        }
        // the last sign is that of all blocks
        let of_blocks = match (self.blocks == other.blocks, self.negative.split_last(), other.negative.split_last()) {
            (true, Some((_, a)), Some((_, b))) => a.iter().zip(b).filter(|(a, b)| a != b).count(),
            _ => usize::from(self.negative.last() != other.negative.last()),
        };
        of_blocks.abs_diff(usize::from(self.basis != other.basis))
    }
}

/// Largest |x|; NaN counts as infinite.
pub fn largest(x: impl IntoIterator<Item = f64>) -> f64 {
    x.into_iter().fold(0.0, |m: f64, x| if x.is_nan() { f64::INFINITY } else { m.max(x.abs()) })
}

/// Squared size of row i of C, given by its values in pattern order, for these displacements of the coordinates, over
/// its closure error `large` under a large displacement.
pub fn strength(pattern: &Pattern, c: &[f64], displacement: &[f64], i: usize, large: f64) -> f64 {
    pattern.row(i).map(|e| (c[e] * displacement[pattern.col_idx[e]]).powi(2)).sum::<f64>() / (large * large)
}

/// Whether a row of this strength is round-off alone: it has no direction, and normalised it would be noise.
pub fn is_round_off(strength: f64) -> bool {
    strength < tolerance::NEGLIGIBLE * tolerance::NEGLIGIBLE
}

/// C v + a, row by row, for values of C in pattern order.
pub fn velocity_residuals<'x>(
    pattern: &'x Pattern,
    c: &'x [f64],
    v: &'x [f64],
    a: &'x [f64],
) -> impl Iterator<Item = f64> + 'x {
    a.iter().enumerate().map(|(i, a)| pattern.row(i).map(|e| c[e] * v[pattern.col_idx[e]]).sum::<f64>() + a)
}
