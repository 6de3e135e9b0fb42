//! How mobile everything is with the loops closed: `[Dᵀ M_d⁻¹ D]_ii` and the blocks of `M_d⁻¹`, without M_d.     (21)
//!
//! Outward, the compliance Ω of each link: its acceleration for a wrench on it. A joint or cluster receives that of its
//! base link through its gain, and adds its own. Needs the results of [`Tree::accelerate`].

use super::dof;
use super::few::solve;
use super::plan::{Duty, FewPlan, Plan, RangePlan, NONE};
use super::sweep::{add_force_at, add_times, arm_components, dot, shift_motion};
use crate::memory::ClusterScratch;
use crate::tree::{Tree, TreeScratch};
use partita_math::scalar::Scalar;
use partita_math::spatial::Space;
use partita_system::system::BlockSink;

/// Memory for the answer to one unit load in a cluster, and the compliances of all links.
struct UnitLoadScratch<S> {
    compliance: Vec<S>,
    force: Vec<S>,
    motion: Vec<S>,
    left: Vec<S>,
    row_left: Vec<S>,
    lambda: Vec<S>,
    rates: Vec<S>,
}

/// A unit load on a cluster whose base rests or moves.
enum Unit {
    Effort(usize),
    /// Component of a wrench on a link.
    Wrench(usize, usize),
    /// Component of the base's acceleration.
    Base(usize),
}

impl<G: Space> Tree<G> {
    /// `[Dᵀ M_d⁻¹ D]_ii` of all velocities, and for each cluster its block of `M_d⁻¹` for the velocities `independent`:
    /// `block(cluster, velocities, values)`; nothing for clusters by range space with more than `most` of these. `dt` is the
    /// packed Dᵀ. Cost: links; clusters by range space: links times velocities.
    pub fn mobility(
        &self,
        plan: &Plan,
        dt: &[G::S],
        independent: &[usize],
        most: usize,
        cluster_of: &[u32],
        s: &TreeScratch<G>,
        x: &ClusterScratch<G::S>,
        diagonal: &mut [G::S],
        block: BlockSink<G::S>,
    ) {
        let d = G::DIM;
        let zeros = |n: usize| vec![G::S::zero(); n];
        let mut memory = UnitLoadScratch {
            compliance: zeros(self.links.len() * d * d),
            force: zeros(self.links.len() * d),
            motion: zeros(self.links.len() * d),
            left: zeros(self.nv),
            row_left: zeros(plan.rows.len()),
            lambda: zeros(plan.rows.len()),
            rates: zeros(self.nv),
        };
        let mut own: Vec<Vec<usize>> = vec![Vec::new(); plan.routes.len()];
        for &i in independent {
            own[cluster_of[i] as usize].push(i);
        }
        // a cluster is processed at its first link: all its base links come before
        let mut range_at = vec![usize::MAX; self.links.len()];
        for (n, r) in plan.ranged.iter().enumerate() {
            range_at[r.links[0] as usize] = n;
        }
        let mut inside = vec![usize::MAX; self.links.len()];
        for (n, r) in plan.ranged.iter().enumerate() {
            r.links.iter().for_each(|&i| inside[i as usize] = n);
        }
        // links that others than those of their own cluster hang on
        let mut carries = vec![false; self.links.len()];
        for i in 1..self.links.len() {
            let parent = self.links[i].parent;
            carries[parent] |= inside[i] == usize::MAX || inside[i] != inside[parent];
        }
        for i in 1..self.links.len() {
            match plan.links[i].duty {
                Duty::First(n) => {
                    let f = &plan.few[n as usize];
                    let which = &own[f.cluster as usize];
                    self.few_mobility(plan, f, dt, which, s, x, &mut memory, diagonal, block);
                }
                Duty::Other => {}
                Duty::Own if range_at[i] != usize::MAX => {
                    let r = &plan.ranged[range_at[i]];
                    let which = &own[r.cluster as usize];
                    self.range_mobility(plan, r, which, most, &carries, s, x, &mut memory, diagonal, block);
                }
                Duty::Own if inside[i] != usize::MAX => {}
                Duty::Own => {
                    let cluster = cluster_of[self.links[i].v] as usize;
                    self.joint_mobility(i, s, x, &mut memory, diagonal, cluster, block);
                }
            }
        }
    }

    /// A joint in no loop: `D⁻¹ + Kᵀ Ω K` and Ω = (1 − S Kᵀ) X Ω Xᵀ (1 − S Kᵀ)ᵀ + S D⁻¹ Sᵀ, axis by axis.
    fn joint_mobility(
        &self,
        i: usize,
        s: &TreeScratch<G>,
        x: &ClusterScratch<G::S>,
        memory: &mut UnitLoadScratch<G::S>,
        diagonal: &mut [G::S],
        cluster: usize,
        block: BlockSink<G::S>,
    ) {
        let d = G::DIM;
        let link = &self.links[i];
        let f = dof(&link.motion);
        let arm = self.arm_from_parent_components(i, s);
        let mut omega = [G::S::zero(); 36];
        if link.parent != 0 {
            congruence::<G>(&arm, &memory.compliance[link.parent * d * d..(link.parent + 1) * d * d], &mut omega);
        }
        // covariances of the rates found so far with the link's motion
        let mut with = [[G::S::zero(); 6]; 3];
        let mut values = [G::S::zero(); 9];
        for j in 0..f {
            let v = link.v + j;
            let (axis, push) = (&x.axis[v * d..(v + 1) * d], &x.push[v * d..(v + 1) * d]);
            let inverse = x.inverse[v];
            let mut pushed = [G::S::zero(); 6]; // Ω U D⁻¹
            for r in 0..d {
                pushed[r] = dot(&omega[r * d..(r + 1) * d], push) * inverse;
            }
            let own = inverse + dot(push, &pushed[..d]) * inverse;
            values[j * f + j] = own;
            diagonal[v] = own;
            for h in 0..j {
                let mixed = -dot(push, &with[h][..d]) * inverse;
                values[j * f + h] = mixed;
                values[h * f + j] = mixed;
                add_times(&mut with[h][..d], axis, mixed);
            }
            // a' = a + S v': Ω' = Ω − p Sᵀ − S pᵀ + S own Sᵀ
            for r in 0..d {
                for c in 0..d {
                    let change = axis[r] * own * axis[c] - pushed[r] * axis[c] - axis[r] * pushed[c];
                    omega[r * d + c] += change;
                }
                with[j][r] = axis[r] * own - pushed[r];
            }
        }
        memory.compliance[i * d * d..(i + 1) * d * d].copy_from_slice(&omega[..d * d]);
        let velocities: Vec<usize> = (link.v..link.v + f).collect();
        block(cluster, &velocities, &values[..f * f]);
    }

    /// A cluster by partial velocities: `M_d⁻¹ = 𝒟⁻¹ + K Ω Kᵀ`.
    fn few_mobility(
        &self,
        plan: &Plan,
        f: &FewPlan,
        dt: &[G::S],
        which: &[usize],
        s: &TreeScratch<G>,
        x: &ClusterScratch<G::S>,
        memory: &mut UnitLoadScratch<G::S>,
        diagonal: &mut [G::S],
        block: BlockSink<G::S>,
    ) {
        let (d, k, stride) = (G::DIM, f.k, plan.columns);
        let (o, one) = (G::S::zero(), G::S::one());
        let mut inverse = vec![o; k * k];
        (0..k).for_each(|j| inverse[j * k + j] = one);
        solve(&x.few.mass[f.square..f.square + k * k], k, &mut inverse, k);
        let resting = inverse.clone();
        let gain = &x.few.gain[f.small * d..(f.small + k) * d];
        let omega = memory.compliance[f.base * d * d..(f.base + 1) * d * d].to_vec();
        let mut pushed = vec![o; k * d]; // K Ω
        for j in 0..k {
            for c in 0..d {
                pushed[j * d + c] = (0..d).fold(o, |sum, r| sum + gain[j * d + r] * omega[r * d + c]);
            }
        }
        for j in 0..k {
            for h in 0..k {
                inverse[j * k + h] += dot(&pushed[j * d..(j + 1) * d], &gain[h * d..(h + 1) * d]);
            }
        }
        let centre = s.links[f.base].centre;
        for (n, &(i, _)) in f.links.iter().enumerate() {
            let i = i as usize;
            let link = &self.links[i];
            for v in link.v..link.v + dof(&link.motion) {
                let row = &dt[v * stride..v * stride + k];
                diagonal[v] = (0..k).fold(o, |sum, j| sum + row[j] * dot(&inverse[j * k..(j + 1) * k], row));
            }
            // Ω = Ξ Ω Ξᵀ + W 𝒟⁻¹ Wᵀ, Ξ = X − W K
            let arm = arm_components::<G>(s.links[i].centre - centre);
            let partial = &x.few.partial[(f.partial + n * k) * d..(f.partial + (n + 1) * k) * d];
            let mut xi = [o; 36];
            for c in 0..d {
                let mut unit = [o; 6];
                unit[c] = one;
                let mut moved = [o; 6];
                shift_motion::<G>(&arm, &unit[..d], &mut moved[..d]);
                for r in 0..d {
                    xi[r * d + c] = (0..k).fold(moved[r], |sum, j| sum - partial[j * d + r] * gain[j * d + c]);
                }
            }
            let mine = &mut memory.compliance[i * d * d..(i + 1) * d * d];
            sandwich(&xi, &omega, d, mine);
            for r in 0..d {
                for c in 0..d {
                    for j in 0..k {
                        for h in 0..k {
                            mine[r * d + c] += partial[j * d + r] * resting[j * k + h] * partial[h * d + c];
                        }
                    }
                }
            }
        }
        block(f.cluster as usize, which, &inverse);
    }

    /// A cluster by range space: unit loads one after the other.
    fn range_mobility(
        &self,
        plan: &Plan,
        p: &RangePlan,
        which: &[usize],
        most: usize,
        carries: &[bool],
        s: &TreeScratch<G>,
        x: &ClusterScratch<G::S>,
        memory: &mut UnitLoadScratch<G::S>,
        diagonal: &mut [G::S],
        block: BlockSink<G::S>,
    ) {
        let d = G::DIM;
        let o = G::S::zero();
        let velocities: Vec<usize> = p
            .links
            .iter()
            .flat_map(|&i| {
                let l = &self.links[i as usize];
                l.v..l.v + dof(&l.motion)
            })
            .collect();
        let omega = memory.compliance[p.base * d * d..(p.base + 1) * d * d].to_vec();
        // T: rates and motions for a unit acceleration of the base
        let mut follow = vec![o; self.nv * d];
        let mut xi = vec![[o; 36]; p.links.len()];
        for c in 0..d {
            self.range_response(plan, p, &Unit::Base(c), s, x, memory);
            velocities.iter().for_each(|&v| follow[v * d + c] = memory.rates[v]);
            for (n, &i) in p.links.iter().enumerate() {
                (0..d).for_each(|r| xi[n][r * d + c] = memory.motion[i as usize * d + r]);
            }
        }
        let shared = |a: usize, b: usize| {
            (0..d).fold(o, |sum, r| {
                sum + follow[a * d + r] * dot(&omega[r * d..(r + 1) * d], &follow[b * d..(b + 1) * d])
            })
        };
        let k = which.len();
        let asked = k <= most;
        let mut values = vec![o; if asked { k * k } else { 0 }];
        let mut index = vec![usize::MAX; self.nv];
        which.iter().enumerate().for_each(|(j, &v)| index[v] = j);
        for &v in velocities.iter().filter(|_| asked) {
            self.range_response(plan, p, &Unit::Effort(v), s, x, memory);
            diagonal[v] = memory.rates[v] + shared(v, v);
            if index[v] != usize::MAX {
                for (j, &w) in which.iter().enumerate() {
                    values[j * k + index[v]] = memory.rates[w] + shared(v, w);
                }
            }
        }
        for (n, &i) in p.links.iter().enumerate() {
            let i = i as usize;
            if !carries[i] {
                continue;
            }
            let mut own = [o; 36];
            for c in 0..d {
                self.range_response(plan, p, &Unit::Wrench(i, c), s, x, memory);
                (0..d).for_each(|r| own[r * d + c] = memory.motion[i * d + r]);
            }
            let mine = &mut memory.compliance[i * d * d..(i + 1) * d * d];
            sandwich(&xi[n], &omega, d, mine);
            mine.iter_mut().zip(&own).for_each(|(m, o)| *m += *o);
        }
        if asked {
            block(p.cluster as usize, which, &values);
        }
    }

    /// Rates and motions of a cluster by range space for one unit load, with the factors already computed. Cost: its
    /// links.
    fn range_response(
        &self,
        plan: &Plan,
        p: &RangePlan,
        unit: &Unit,
        s: &TreeScratch<G>,
        x: &ClusterScratch<G::S>,
        memory: &mut UnitLoadScratch<G::S>,
    ) {
        let d = G::DIM;
        let (o, one) = (G::S::zero(), G::S::one());
        memory.row_left.fill(o);
        for &i in &p.links {
            memory.force[i as usize * d..(i as usize + 1) * d].fill(o);
        }
        if let Unit::Wrench(i, c) = *unit {
            memory.force[i * d + c] = -one;
        }
        let forward = |e: usize, memory: &mut UnitLoadScratch<G::S>| {
            let e = &plan.eliminations[e];
            let left = memory.row_left[e.row as usize] * x.row_inverse[e.row as usize];
            for a in &plan.neighbours[e.neighbours.start as usize..e.neighbours.end as usize] {
                let change = x.coupling[a.slot as usize] * left;
                memory.row_left[a.row as usize] -= change;
            }
            left
        };
        for &i in p.links.iter().rev() {
            let i = i as usize;
            let (link, here) = (&self.links[i], &plan.links[i]);
            for e in here.complete.clone() {
                let left = forward(e as usize, memory);
                let e = &plan.eliminations[e as usize];
                let own = &x.row_force[e.force as usize * d..][..d];
                add_times(&mut memory.force[i * d..(i + 1) * d], own, -left);
            }
            for j in (0..dof(&link.motion)).rev() {
                let v = link.v + j;
                let effort = if matches!(*unit, Unit::Effort(w) if w == v) { one } else { o };
                let force = &mut memory.force[i * d..(i + 1) * d];
                let left = effort - dot(&x.axis[v * d..(v + 1) * d], force);
                memory.left[v] = left;
                let share = left * x.inverse[v];
                add_times(force, &x.push[v * d..(v + 1) * d], share);
                for (a, row) in here.propagated.clone().zip(&plan.propagated[here.propagated.start as usize..]) {
                    memory.row_left[row.row as usize] += x.row_effort[a as usize * 3 + j] * share;
                }
            }
            if link.parent != p.base {
                let arm = self.arm_from_parent_components(i, s);
                let (before, rest) = memory.force.split_at_mut(i * d);
                add_force_at::<G>(&arm, rest, &mut before[link.parent * d..]);
            }
        }
        for &e in &p.at_base {
            forward(e as usize, memory);
        }
        let mut base = [o; 6];
        if let Unit::Base(c) = *unit {
            base[c] = one;
        }
        let backward = |e: usize, motion: &[G::S], memory: &mut UnitLoadScratch<G::S>| {
            let e = &plan.eliminations[e];
            let mut sum = -memory.row_left[e.row as usize];
            if e.force != NONE {
                sum += dot(&x.row_force[e.force as usize * d..][..d], motion);
            }
            for a in &plan.neighbours[e.neighbours.start as usize..e.neighbours.end as usize] {
                let known = x.coupling[a.slot as usize] * memory.lambda[a.row as usize];
                sum -= known;
            }
            memory.lambda[e.row as usize] = sum * x.row_inverse[e.row as usize];
        };
        for &e in p.at_base.iter().rev() {
            backward(e as usize, &base[..d], memory);
        }
        for &i in &p.links {
            let i = i as usize;
            let (link, here) = (&self.links[i], &plan.links[i]);
            let arm = self.arm_from_parent_components(i, s);
            let mut own = [o; 6];
            if link.parent == p.base {
                shift_motion::<G>(&arm, &base[..d], &mut own[..d]);
            } else {
                shift_motion::<G>(&arm, &memory.motion[link.parent * d..(link.parent + 1) * d], &mut own[..d]);
            }
            for j in 0..dof(&link.motion) {
                let v = link.v + j;
                let mut left = memory.left[v] - dot(&x.push[v * d..(v + 1) * d], &own[..d]);
                for (a, row) in here.propagated.clone().zip(&plan.propagated[here.propagated.start as usize..]) {
                    left += x.row_effort[a as usize * 3 + j] * memory.lambda[row.row as usize];
                }
                let rate = left * x.inverse[v];
                memory.rates[v] = rate;
                add_times(&mut own[..d], &x.axis[v * d..(v + 1) * d], rate);
            }
            memory.motion[i * d..(i + 1) * d].copy_from_slice(&own[..d]);
            for e in here.complete.clone().rev() {
                backward(e as usize, &own[..d], memory);
            }
        }
    }
}

/// `out = X m Xᵀ`, X the shift by `arm`.
fn congruence<G: Space>(arm: &[G::S; 3], m: &[G::S], out: &mut [G::S]) {
    let d = G::DIM;
    let o = G::S::zero();
    let mut half = [o; 36]; // X m, column by column: shifts of the columns of m
    for c in 0..d {
        let mut column = [o; 6];
        (0..d).for_each(|r| column[r] = m[r * d + c]);
        let mut moved = [o; 6];
        shift_motion::<G>(arm, &column[..d], &mut moved[..d]);
        (0..d).for_each(|r| half[r * d + c] = moved[r]);
    }
    for r in 0..d {
        shift_motion::<G>(arm, &half[r * d..(r + 1) * d], &mut out[r * d..(r + 1) * d]);
    }
}

/// `out = x m xᵀ` for d x d matrices.
fn sandwich<S: Scalar>(x: &[S], m: &[S], d: usize, out: &mut [S]) {
    let o = S::zero();
    let mut half = [o; 36];
    for r in 0..d {
        for c in 0..d {
            half[r * d + c] = (0..d).fold(o, |sum, l| sum + x[r * d + l] * m[l * d + c]);
        }
    }
    for r in 0..d {
        for c in 0..d {
            out[r * d + c] = dot(&half[r * d..(r + 1) * d], &x[c * d..(c + 1) * d]);
        }
    }
}
