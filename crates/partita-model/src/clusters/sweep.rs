//! The recursion itself: inward over the links, then outward. Without branches given a plan; written over any number
//! type.

use super::dof;
use super::plan::{Duty, Plan, NONE};
use crate::memory::ClusterScratch;
use crate::tree::{LinkMotion, Tree, TreeScratch};
use partita_math::scalar::Scalar;
use partita_math::spatial::Space;
use partita_system::system::ClusterTangent;

/// Tangents together with the loads on the links.
pub(crate) struct LoadedTangents<'a, S> {
    pub tangents: ClusterTangent<'a, S>,
    /// Effort along each velocity.
    pub effort: &'a [S],
    /// From rest, without forces and gravity: the motion that the efforts alone cause.
    pub at_rest: bool,
}

impl<S: Scalar> ClusterScratch<S> {
    /// Memory for a tree of `links` links and `velocities` velocities in `d` dimensions, with this plan.
    pub fn fit(&mut self, links: usize, velocities: usize, d: usize, plan: &Plan) {
        let memory = |x: &mut Vec<S>, n: usize| {
            x.clear();
            x.resize(n, S::zero());
        };
        memory(&mut self.inertia, links * d * d);
        memory(&mut self.force, links * d);
        memory(&mut self.motion, links * d);
        memory(&mut self.axis, velocities * d);
        memory(&mut self.push, velocities * d);
        memory(&mut self.inverse, velocities);
        memory(&mut self.left, velocities);
        memory(&mut self.pivots, velocities);
        memory(&mut self.row_force, plan.forces * d);
        memory(&mut self.row_effort, plan.propagated.len() * 3);
        memory(&mut self.coupling, plan.slots);
        memory(&mut self.row_left, plan.rows.len());
        memory(&mut self.row_inverse, plan.rows.len());
        memory(&mut self.lambda, plan.rows.len());
        self.few.fit(d, plan);
    }

    /// Inertia felt by each velocity of the clusters that do not use partial velocities (1 for the others); a velocity
    /// whose value is not positive moves nothing.
    pub fn pivots(&self) -> &[S] {
        &self.pivots
    }
}

/// Twist `(w, u)` of a point at the distance `arm` from another one: u + w × arm.
#[inline(always)]
pub(super) fn shift_motion<G: Space>(arm: &[G::S; 3], x: &[G::S], out: &mut [G::S]) {
    if G::DIM == 3 {
        out[0] = x[0];
        out[1] = x[1] - x[0] * arm[1];
        out[2] = x[2] + x[0] * arm[0];
    } else {
        for i in 0..3 {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            out[i] = x[i];
            out[3 + i] = x[3 + i] + x[j] * arm[k] - x[k] * arm[j];
        }
    }
}

/// Add the wrench x at the end of `arm` to `out` at its beginning: moment + arm × force.
#[inline(always)]
pub(super) fn add_force_at<G: Space>(arm: &[G::S; 3], x: &[G::S], out: &mut [G::S]) {
    if G::DIM == 3 {
        out[0] += x[0] + arm[0] * x[2] - arm[1] * x[1];
        out[1] += x[1];
        out[2] += x[2];
    } else {
        for i in 0..3 {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            out[i] += x[i] + arm[j] * x[3 + k] - arm[k] * x[3 + j];
            out[3 + i] += x[3 + i];
        }
    }
}

/// Add `Xᵀ m X` to `out`, X the shift by `arm`.
#[inline(always)]
pub(super) fn add_inertia_at<G: Space>(arm: &[G::S; 3], m: &[G::S], out: &mut [G::S]) {
    let d = G::DIM;
    // m X: the rotational columns gain the translational ones times their arms
    let mut half = [G::S::zero(); 36];
    half[..d * d].copy_from_slice(&m[..d * d]);
    for r in 0..d {
        if d == 3 {
            half[r * 3] += m[r * 3 + 2] * arm[0] - m[r * 3 + 1] * arm[1];
        } else {
            for i in 0..3 {
                let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                half[r * 6 + i] += m[r * 6 + 3 + k] * arm[j] - m[r * 6 + 3 + j] * arm[k];
            }
        }
    }
    for c in 0..d {
        if d == 3 {
            out[c] += half[c] + arm[0] * half[6 + c] - arm[1] * half[3 + c];
            out[3 + c] += half[3 + c];
            out[6 + c] += half[6 + c];
        } else {
            for i in 0..3 {
                let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                out[i * 6 + c] += half[i * 6 + c] + arm[j] * half[(3 + k) * 6 + c] - arm[k] * half[(3 + j) * 6 + c];
                out[(3 + i) * 6 + c] += half[(3 + i) * 6 + c];
            }
        }
    }
}

#[inline(always)]
pub(super) fn dot<S: Scalar>(a: &[S], b: &[S]) -> S {
    a.iter().zip(b).fold(S::zero(), |sum, (a, b)| sum + *a * *b)
}

#[inline(always)]
pub(super) fn add_times<S: Scalar>(out: &mut [S], x: &[S], factor: S) {
    out.iter_mut().zip(x).for_each(|(o, x)| *o += *x * factor);
}

/// `m += x xᵀ factor`.
#[inline(always)]
fn add_outer<S: Scalar>(m: &mut [S], x: &[S], factor: S) {
    let d = x.len();
    for (i, a) in x.iter().enumerate() {
        let a = *a * factor;
        m[i * d..(i + 1) * d].iter_mut().zip(x).for_each(|(o, b)| *o += a * *b);
    }
}

impl<G: Space> Tree<G> {
    /// From the parent's reference point to that of link i.
    #[inline(always)]
    pub(super) fn arm_from_parent_components(&self, i: usize, s: &TreeScratch<G>) -> [G::S; 3] {
        let x = &s.links[i];
        arm_components::<G>(match self.links[i].motion {
            LinkMotion::Slide(_) => x.arm_in,
            _ => x.arm_in + x.arm_out,
        })
    }

    /// `v'` of all velocities with `C v' + b = 0`, at the last twists, inertias and applied forces.    (P3, 48)
    ///
    /// Without search, branches on values or allocation. Cost: links.
    pub(crate) fn accelerate(
        &self,
        plan: &Plan,
        given: &LoadedTangents<G::S>,
        s: &TreeScratch<G>,
        x: &mut ClusterScratch<G::S>,
        vdot: &mut [G::S],
    ) {
        self.prepare(plan, given, s, x);
        for i in (1..self.links.len()).rev() {
            match plan.links[i].duty {
                Duty::Own => {
                    self.complete_rows(plan, i, x);
                    self.joint_inward(plan, i, given, s, x);
                }
                Duty::First(f) => self.few_inward(plan, &plan.few[f as usize], given, s, x),
                Duty::Other => {}
            }
        }
        self.complete_rows(plan, 0, x);
        x.motion[..G::DIM].fill(G::S::zero());
        self.multipliers_of(plan, 0, x);
        for i in 1..self.links.len() {
            match plan.links[i].duty {
                Duty::Own => self.joint_outward(plan, i, s, x, vdot),
                Duty::First(f) => self.few_outward(plan, &plan.few[f as usize], given, s, x, vdot),
                Duty::Other => {}
            }
        }
    }

    /// Inertias, unit twists, and the forces that remain at the initial accelerations.
    fn prepare(&self, plan: &Plan, given: &LoadedTangents<G::S>, s: &TreeScratch<G>, x: &mut ClusterScratch<G::S>) {
        let d = G::DIM;
        let (o, one) = (G::S::zero(), G::S::one());
        x.inertia.fill(o);
        x.row_force.fill(o);
        x.coupling.fill(o);
        x.pivots.fill(one);
        for (left, &row) in x.row_left.iter_mut().zip(&plan.rows) {
            *left = given.tangents.b[row as usize];
        }
        x.motion[..d].fill(o);
        for i in 1..self.links.len() {
            let (link, l) = (&self.links[i], &s.links[i]);
            // the initial acceleration, stored in `motion` until the outward pass: v' = ξ in clusters that need it
            let p = link.parent;
            let arm = self.arm_from_parent_components(i, s);
            let (before, rest) = x.motion.split_at_mut(i * d);
            shift_motion::<G>(&arm, &before[p * d..(p + 1) * d], rest);
            for v in link.v..link.v + dof(&link.motion) {
                let (w, u) =
                    self.propagate(i, s, G::Ang::default(), G::Vec::default(), |j| if j == v { one } else { o });
                let axis = &mut x.axis[v * d..(v + 1) * d];
                axis.copy_from_slice(&G::components(w, u)[..d]);
                if plan.starts_from_bias[v] {
                    add_times(&mut rest[..d], axis, given.tangents.delta[v]);
                }
            }
            let m = &mut x.inertia[i * d * d..(i + 1) * d * d];
            G::add_inertia(&l.inertia, link.mass, m);
            let spin = G::spin(&l.inertia, l.w);
            let weight = G::scale(l.acc - self.gravity, link.mass) - l.force;
            let moment = G::spin(&l.inertia, l.alpha) + G::cross_ang(l.w, spin) - l.moment;
            let force = &mut x.force[i * d..(i + 1) * d];
            if given.at_rest {
                force.fill(o);
            } else {
                force.copy_from_slice(&G::components(moment, weight)[..d]);
            }
            for r in 0..d {
                force[r] += dot(&m[r * d..(r + 1) * d], &rest[..d]);
            }
        }
        x.force[..d].fill(o);
    }

    /// Eliminate the rows that are complete at link i.
    pub(super) fn complete_rows(&self, plan: &Plan, i: usize, x: &mut ClusterScratch<G::S>) {
        let d = G::DIM;
        let done = &plan.links[i].complete;
        for e in &plan.eliminations[done.start as usize..done.end as usize] {
            let w = G::S::one() / x.coupling[e.pivot as usize];
            let left = x.row_left[e.row as usize];
            x.row_inverse[e.row as usize] = w;
            let mut own = [G::S::zero(); 6];
            if e.force != NONE {
                own[..d].copy_from_slice(&x.row_force[e.force as usize * d..][..d]);
                add_outer(&mut x.inertia[i * d * d..(i + 1) * d * d], &own[..d], w);
                add_times(&mut x.force[i * d..(i + 1) * d], &own[..d], -(w * left));
            }
            let mut update = e.updates as usize;
            let around = &plan.neighbours[e.neighbours.start as usize..e.neighbours.end as usize];
            for (n, a) in around.iter().enumerate() {
                let factor = x.coupling[a.slot as usize] * w;
                let change = factor * left;
                x.row_left[a.row as usize] -= change;
                if e.force != NONE {
                    add_times(&mut x.row_force[a.force as usize * d..][..d], &own[..d], -factor);
                }
                for b in &around[..=n] {
                    let change = factor * x.coupling[b.slot as usize];
                    x.coupling[plan.updates[update] as usize] -= change;
                    update += 1;
                }
            }
        }
    }

    /// Multipliers of the rows that were completed at link i, whose acceleration is known.
    pub(super) fn multipliers_of(&self, plan: &Plan, i: usize, x: &mut ClusterScratch<G::S>) {
        let d = G::DIM;
        let done = &plan.links[i].complete;
        for e in plan.eliminations[done.start as usize..done.end as usize].iter().rev() {
            let mut sum = -x.row_left[e.row as usize];
            if e.force != NONE {
                sum += dot(&x.row_force[e.force as usize * d..][..d], &x.motion[i * d..(i + 1) * d]);
            }
            for a in &plan.neighbours[e.neighbours.start as usize..e.neighbours.end as usize] {
                let known = x.coupling[a.slot as usize] * x.lambda[a.row as usize];
                sum -= known;
            }
            x.lambda[e.row as usize] = sum * x.row_inverse[e.row as usize];
        }
    }

    fn joint_inward(
        &self,
        plan: &Plan,
        i: usize,
        given: &LoadedTangents<G::S>,
        s: &TreeScratch<G>,
        x: &mut ClusterScratch<G::S>,
    ) {
        let d = G::DIM;
        let (link, here) = (&self.links[i], &plan.links[i]);
        let first = here.propagated.start as usize;
        let propagated = &plan.propagated[first..here.propagated.end as usize];
        for j in (0..dof(&link.motion)).rev() {
            let v = link.v + j;
            let (inertia, force) = (&mut x.inertia[i * d * d..(i + 1) * d * d], &mut x.force[i * d..(i + 1) * d]);
            let axis = &x.axis[v * d..(v + 1) * d];
            let push = &mut x.push[v * d..(v + 1) * d];
            for r in 0..d {
                push[r] = dot(&inertia[r * d..(r + 1) * d], axis);
            }
            let mut felt = dot(axis, push);
            if let Some(rotor) = self.rotor(v) {
                felt += rotor;
            }
            x.pivots[v] = felt;
            let inverse = G::S::one() / felt;
            let left = given.effort[v] - dot(axis, force);
            (x.inverse[v], x.left[v]) = (inverse, left);
            add_outer(inertia, push, -inverse);
            add_times(force, push, inverse * left);
            let mut pair = here.pairs as usize;
            for (a, row) in propagated.iter().enumerate() {
                let on_link = &mut x.row_force[row.force as usize * d..][..d];
                let mut effort = -dot(axis, on_link);
                if row.entry[j] != NONE {
                    effort += given.tangents.c[row.entry[j] as usize];
                }
                x.row_effort[(first + a) * 3 + j] = effort;
                let share = effort * inverse;
                add_times(on_link, push, share);
                x.row_left[row.row as usize] += share * left;
                for b in 0..=a {
                    let change = share * x.row_effort[(first + b) * 3 + j];
                    x.coupling[plan.pairs[pair] as usize] += change;
                    pair += 1;
                }
            }
        }
        let p = link.parent;
        if p == 0 {
            return;
        }
        let arm = self.arm_from_parent_components(i, s);
        let (before, rest) = x.inertia.split_at_mut(i * d * d);
        add_inertia_at::<G>(&arm, rest, &mut before[p * d * d..]);
        let (before, rest) = x.force.split_at_mut(i * d);
        add_force_at::<G>(&arm, rest, &mut before[p * d..]);
        for row in propagated {
            let mut on_link = [G::S::zero(); 6];
            on_link[..d].copy_from_slice(&x.row_force[row.force as usize * d..][..d]);
            add_force_at::<G>(&arm, &on_link, &mut x.row_force[row.parent_force as usize * d..]);
        }
    }

    fn joint_outward(
        &self,
        plan: &Plan,
        i: usize,
        s: &TreeScratch<G>,
        x: &mut ClusterScratch<G::S>,
        vdot: &mut [G::S],
    ) {
        let d = G::DIM;
        let (link, here) = (&self.links[i], &plan.links[i]);
        let first = here.propagated.start as usize;
        let propagated = &plan.propagated[first..here.propagated.end as usize];
        let arm = self.arm_from_parent_components(i, s);
        let (before, rest) = x.motion.split_at_mut(i * d);
        let own = &mut rest[..d];
        shift_motion::<G>(&arm, &before[link.parent * d..(link.parent + 1) * d], own);
        for j in 0..dof(&link.motion) {
            let v = link.v + j;
            let mut left = x.left[v] - dot(&x.push[v * d..(v + 1) * d], own);
            for (a, row) in propagated.iter().enumerate() {
                left += x.row_effort[(first + a) * 3 + j] * x.lambda[row.row as usize];
            }
            vdot[v] = left * x.inverse[v];
            add_times(own, &x.axis[v * d..(v + 1) * d], vdot[v]);
        }
        self.multipliers_of(plan, i, x);
    }
}

/// A length as three numbers.
#[inline(always)]
pub(super) fn arm_components<G: Space>(x: G::Vec) -> [G::S; 3] {
    let third = if G::LENGTHS == 3 { G::component(x, 2) } else { G::S::zero() };
    [G::component(x, 0), G::component(x, 1), third]
}
