//! A cluster with few degrees of freedom, as one joint: its links move by `S_c = S D_cᵀ`.                       (48)

use super::dof;
use super::plan::{FewPlan, Plan, NONE};
use super::sweep::{add_force_at, add_inertia_at, arm_components, dot, shift_motion, LoadedTangents};
use crate::memory::{ClusterScratch, FewScratch};
use crate::tree::{Tree, TreeScratch};
use partita_math::scalar::Scalar;
use partita_math::spatial::Space;

impl<S: Scalar> FewScratch<S> {
    pub(super) fn fit(&mut self, d: usize, plan: &Plan) {
        let memory = |x: &mut Vec<S>, n: usize| {
            x.clear();
            x.resize(n, S::zero());
        };
        memory(&mut self.partial, plan.partials * d);
        memory(&mut self.mass, plan.squares);
        memory(&mut self.whole, plan.squares);
        memory(&mut self.own, plan.smalls);
        memory(&mut self.gain, plan.smalls * d);
    }
}

/// `A = L Lᵀ` in place (lower triangle); pivots are not checked, a bad one ends in NaN.
fn cholesky<S: Scalar>(a: &mut [S], n: usize) {
    for i in 0..n {
        for j in 0..=i {
            let sum = (0..j).fold(a[i * n + j], |sum, l| sum - a[i * n + l] * a[j * n + l]);
            a[i * n + j] = if i == j { sum.sqrt() } else { sum / a[j * n + j] };
        }
    }
}

/// `L Lᵀ x = b` for b with `columns` columns, row by row.
pub(super) fn solve<S: Scalar>(l: &[S], n: usize, b: &mut [S], columns: usize) {
    for i in 0..n {
        for c in 0..columns {
            let sum = (0..i).fold(b[i * columns + c], |sum, j| sum - l[i * n + j] * b[j * columns + c]);
            b[i * columns + c] = sum / l[i * n + i];
        }
    }
    for i in (0..n).rev() {
        for c in 0..columns {
            let sum = (i + 1..n).fold(b[i * columns + c], |sum, j| sum - l[j * n + i] * b[j * columns + c]);
            b[i * columns + c] = sum / l[i * n + i];
        }
    }
}

impl<G: Space> Tree<G> {
    pub(super) fn few_inward(
        &self,
        plan: &Plan,
        f: &FewPlan,
        given: &LoadedTangents<G::S>,
        s: &TreeScratch<G>,
        x: &mut ClusterScratch<G::S>,
    ) {
        let (d, k, stride) = (G::DIM, f.k, plan.columns);
        let o = G::S::zero();
        self.partial_twists(f, given, stride, s, x);
        let mut few = std::mem::take(&mut x.few);
        let mass = &mut few.whole[f.square..f.square + k * k];
        let own = &mut few.own[f.small..f.small + k];
        let gain = &mut few.gain[f.small * d..(f.small + k) * d];
        mass.fill(o);
        own.fill(o);
        gain.fill(o);
        let centre = s.links[f.base].centre;
        for (n, &(i, _)) in f.links.iter().enumerate().rev() {
            let i = i as usize;
            self.complete_rows(plan, i, x);
            let inertia = &x.inertia[i * d * d..(i + 1) * d * d];
            let force = &x.force[i * d..(i + 1) * d];
            let partial = &few.partial[(f.partial + n * k) * d..(f.partial + (n + 1) * k) * d];
            // from the base's reference point; the ground receives nothing
            let arm = arm_components::<G>(s.links[i].centre - centre);
            for j in 0..k {
                let twist = &partial[j * d..(j + 1) * d];
                let mut push = [o; 6];
                for r in 0..d {
                    push[r] = dot(&inertia[r * d..(r + 1) * d], twist);
                }
                own[j] -= dot(twist, force);
                for h in 0..=j {
                    mass[j * k + h] += dot(&partial[h * d..(h + 1) * d], &push[..d]);
                }
                if f.base != 0 {
                    add_force_at::<G>(&arm, &push, &mut gain[j * d..(j + 1) * d]);
                }
            }
            let link = &self.links[i];
            for v in link.v..link.v + dof(&link.motion) {
                let rates = &given.tangents.dt[v * stride..v * stride + k];
                for j in 0..k {
                    own[j] += rates[j] * given.effort[v];
                }
                if let Some(rotor) = self.rotor(v) {
                    for j in 0..k {
                        let push = rotor * rates[j];
                        own[j] -= push * given.tangents.delta[v];
                        for h in 0..=j {
                            mass[j * k + h] += push * rates[h];
                        }
                    }
                }
            }
            if f.base != 0 {
                let (before, rest) = x.inertia.split_at_mut(i * d * d);
                add_inertia_at::<G>(&arm, rest, &mut before[f.base * d * d..]);
                let (before, rest) = x.force.split_at_mut(i * d);
                add_force_at::<G>(&arm, rest, &mut before[f.base * d..]);
            }
        }
        let factor = &mut few.mass[f.square..f.square + k * k];
        factor.copy_from_slice(mass);
        cholesky(factor, k);
        solve(factor, k, own, 1);
        if f.base != 0 {
            // push of the degrees of freedom on the base (k x DIM); the gain follows from it
            let inertia = &mut x.inertia[f.base * d * d..(f.base + 1) * d * d];
            let force = &mut x.force[f.base * d..(f.base + 1) * d];
            for j in 0..k {
                for r in 0..d {
                    force[r] += gain[j * d + r] * own[j];
                }
            }
            let mut half = [o; 6];
            // L⁻¹ U: then U 𝒟⁻¹ Uᵀ is its square, and symmetric to the last bit
            for i in 0..k {
                for r in 0..d {
                    let sum = (0..i).fold(gain[i * d + r], |sum, j| sum - factor[i * k + j] * gain[j * d + r]);
                    gain[i * d + r] = sum / factor[i * k + i];
                }
                half[..d].copy_from_slice(&gain[i * d..(i + 1) * d]);
                for r in 0..d {
                    for c in 0..d {
                        let change = half[r] * half[c];
                        inertia[r * d + c] -= change;
                    }
                }
            }
            for i in (0..k).rev() {
                for r in 0..d {
                    let sum = (i + 1..k).fold(gain[i * d + r], |sum, j| sum - factor[j * k + i] * gain[j * d + r]);
                    gain[i * d + r] = sum / factor[i * k + i];
                }
            }
        }
        x.few = few;
    }

    /// Twists of the cluster's links per degree of freedom, relative to its base.
    fn partial_twists(
        &self,
        f: &FewPlan,
        given: &LoadedTangents<G::S>,
        stride: usize,
        s: &TreeScratch<G>,
        x: &mut ClusterScratch<G::S>,
    ) {
        let (d, k) = (G::DIM, f.k);
        for (n, &(i, parent)) in f.links.iter().enumerate() {
            let i = i as usize;
            let arm = self.arm_from_parent_components(i, s);
            let (before, rest) = x.few.partial.split_at_mut((f.partial + n * k) * d);
            let link = &self.links[i];
            for j in 0..k {
                let mine = &mut rest[j * d..(j + 1) * d];
                if parent == NONE {
                    mine.fill(G::S::zero());
                } else {
                    let from = (f.partial + parent as usize * k + j) * d;
                    shift_motion::<G>(&arm, &before[from..from + d], mine);
                }
                for v in link.v..link.v + dof(&link.motion) {
                    let rate = given.tangents.dt[v * stride + j];
                    for (m, a) in mine.iter_mut().zip(&x.axis[v * d..(v + 1) * d]) {
                        *m += *a * rate;
                    }
                }
            }
        }
    }

    pub(super) fn few_outward(
        &self,
        plan: &Plan,
        f: &FewPlan,
        given: &LoadedTangents<G::S>,
        s: &TreeScratch<G>,
        x: &mut ClusterScratch<G::S>,
        vdot: &mut [G::S],
    ) {
        let (d, k, stride) = (G::DIM, f.k, plan.columns);
        let mut base = [G::S::zero(); 6];
        if f.base != 0 {
            base[..d].copy_from_slice(&x.motion[f.base * d..(f.base + 1) * d]);
        }
        for j in 0..k {
            let propagated = dot(&x.few.gain[(f.small + j) * d..(f.small + j + 1) * d], &base[..d]);
            x.few.own[f.small + j] -= propagated;
        }
        let centre = s.links[f.base].centre;
        for (n, &(i, _)) in f.links.iter().enumerate() {
            let i = i as usize;
            let arm = arm_components::<G>(s.links[i].centre - centre);
            let own = &x.few.own[f.small..f.small + k];
            let motion = &mut x.motion[i * d..(i + 1) * d];
            shift_motion::<G>(&arm, &base, motion);
            for (j, u) in own.iter().enumerate() {
                let from = (f.partial + n * k + j) * d;
                for (m, w) in motion.iter_mut().zip(&x.few.partial[from..from + d]) {
                    *m += *w * *u;
                }
            }
            let link = &self.links[i];
            for v in link.v..link.v + dof(&link.motion) {
                vdot[v] = given.tangents.delta[v] + dot(&given.tangents.dt[v * stride..v * stride + k], own);
            }
            self.multipliers_of(plan, i, x);
        }
    }

    /// Reduced mass (k x k, lower triangle) of the cluster number `f` of those that use partial velocities, on a
    /// resting base, after [`accelerate`](Self::accelerate).
    pub(crate) fn cluster_mass<'x>(&self, plan: &Plan, f: usize, x: &'x ClusterScratch<G::S>) -> &'x [G::S] {
        let few = &plan.few[f];
        &x.few.whole[few.square..few.square + few.k * few.k]
    }
}
