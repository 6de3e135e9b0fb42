//! Reactions of all joints: at a cut joint from λ, at a tree joint by a Newton-Euler sweep with λ applied.   (R3)

mod applied;
mod augmented;

use crate::joint::Motion;
use crate::model::{three, Engine, Model, ModelScratch};
use crate::part::Part;
use partita_math::dense;
use partita_math::spatial::Vec3;
use partita_system::SystemError;

/// Moment about a point, and force.
#[derive(Clone, Copy, Debug)]
pub struct Wrench {
    /// Moment.
    pub moment: Vec3<f64>,
    /// Force.
    pub force: Vec3<f64>,
}

impl Default for Wrench {
    fn default() -> Self {
        Self { moment: Vec3::zero(), force: Vec3::zero() }
    }
}

impl Wrench {
    /// The same wrench about a point that lies `arm` before the old one (old = new + arm).
    fn about(&self, arm: Vec3<f64>) -> Self {
        Self { moment: self.moment + arm.cross(self.force), force: self.force }
    }
    fn add(&mut self, o: &Self) {
        self.moment += o.moment;
        self.force += o.force;
    }
    fn times(&self, k: f64) -> Self {
        Self { moment: self.moment.times(k), force: self.force.times(k) }
    }
}

/// Reactions at one instant.
#[derive(Clone, Debug, Default)]
pub struct Reactions {
    /// Action of each joint's constraints on its child, reduced to the joint's point, world axes.
    pub joints: Vec<Wrench>,
    /// Effort of drives along each joint's velocities.
    pub drives: Vec<Vec<f64>>,
    /// Largest Newton-Euler residual over the bodies over the largest force (moments over the mechanism's size).
    pub residual: f64,
}

/// Along `axes`: replace the components of x by `wanted`.
fn replace(x: Vec3<f64>, axes: &[Vec3<f64>], wanted: &[f64]) -> Vec3<f64> {
    let n = axes.len();
    if n == 0 {
        return x;
    }
    let mut gram = vec![0.0; n * n];
    let mut off = vec![0.0; n];
    for i in 0..n {
        for j in 0..n {
            gram[i * n + j] = axes[i].dot(axes[j]);
        }
        off[i] = wanted[i] - axes[i].dot(x);
    }
    if dense::cholesky(&mut gram, n).is_err() {
        return x; // axes in line (gimbal lock): nothing to tell them apart
    }
    dense::cholesky_solve(&gram, n, &mut off);
    axes.iter().zip(off).fold(x, |x, (a, k)| x + a.times(k))
}

/// `w` with its components along the free axes of a joint replaced by those wanted of each.
fn with_along(axes: &[(bool, Vec3<f64>)], w: &Wrench, wanted: impl Fn(usize) -> f64) -> Wrench {
    let of = |turns: bool| -> (Vec<Vec3<f64>>, Vec<f64>) {
        axes.iter().enumerate().filter(|(_, a)| a.0 == turns).map(|(i, a)| (a.1, wanted(i))).unzip()
    };
    let ((ta, tw), (sa, sw)) = (of(true), of(false));
    Wrench { moment: replace(w.moment, &ta, &tw), force: replace(w.force, &sa, &sw) }
}

impl Model {
    /// Free axes of a joint now (turns, slides), mechanism axes, in the order of its velocities.
    fn free_axes(&self, j: usize, s: &ModelScratch) -> Vec<(bool, Vec3<f64>)> {
        let p = &self.placed.joints[j];
        let mut axes = Vec::new();
        match &p.links {
            Some(links) => {
                for (m, &link) in p.shape.motions.iter().zip(links) {
                    let x = &s.full.links[link];
                    let sign = if p.reversed { -1.0 } else { 1.0 };
                    match m {
                        Motion::Turn(_) => axes.push((true, x.axis.times(sign))),
                        Motion::Slide(_) => axes.push((false, x.direction.times(sign))),
                        Motion::Ball => (0..3).for_each(|i| axes.push((true, x.rot.column(i)))),
                    }
                }
            }
            None => {
                let parent = crate::observe::node_state(self, s, p.parent).rot.mul(&p.on_parent);
                let child = crate::observe::node_state(self, s, p.child).rot.mul(&p.on_child);
                let turns = p.shape.motions.iter().filter(|m| matches!(m, Motion::Turn(_))).count();
                let mut seen = 0;
                for m in &p.shape.motions {
                    match m {
                        Motion::Turn(a) => {
                            seen += 1;
                            // the last of two turns is about an axis of the child
                            axes.push((true, if seen == turns { child.apply(*a) } else { parent.apply(*a) }));
                        }
                        Motion::Slide(a) => axes.push((false, parent.apply(*a))),
                        Motion::Ball => (0..3).for_each(|i| axes.push((true, child.column(i)))),
                    }
                }
            }
        }
        axes
    }

    /// Wrench of closing `k` for the multipliers λ on its child about the joint's point there, and its joint.
    fn closing_reaction(&self, k: usize, s: &ModelScratch, lambda: &[f64]) -> (usize, Wrench) {
        match (&self.engine, &s.flat) {
            (Engine::Flat(tree), Some(x)) => {
                let (m, f) = tree.closing_wrench(&tree.closings[k], x, lambda);
                let force = three::<partita_math::spatial::Planar<f64>>(f);
                (tree.closings[k].joint, Wrench { moment: Vec3([0.0, 0.0, m]), force })
            }
            _ => {
                let (moment, force) = self.full.closing_wrench(&self.full.closings[k], &s.full, lambda);
                (self.full.closings[k].joint, Wrench { moment, force })
            }
        }
    }

    fn com_now(&self, s: &ModelScratch, body: usize) -> Vec3<f64> {
        let b = &self.placed.bodies[body];
        self.full.place(b.link, &s.full) + self.arm_now(s, b.link, b.com)
    }

    fn joint_point_now(&self, s: &ModelScratch, j: usize) -> Vec3<f64> {
        let p = &self.placed.joints[j];
        let link = self.placed.link_of(p.child);
        self.full.place(link, &s.full) + self.arm_now(s, link, p.child_point)
    }

    /// Wrench through every tree joint of `part` on its outer body, about that body's centre of mass, given what each body
    /// needs.
    fn inward(&self, part: &Part, s: &ModelScratch, mut needed: Vec<Wrench>) -> Vec<Wrench> {
        for &e in part.edges.iter().rev() {
            let e = &self.placed.topology.tree[e];
            if e.from > 0 {
                let w = needed[e.to - 1].about(self.com_now(s, e.to - 1) - self.com_now(s, e.from - 1));
                needed[e.from - 1].add(&w);
            }
        }
        needed
    }

    /// What each body of `part` needs besides what is applied: m a − F, J α + ω × J ω − T, about its centre of mass.
    fn needed(
        &self,
        part: &Part,
        t: f64,
        q: &[f64],
        v: &[f64],
        vdot: &[f64],
        s: &ModelScratch,
    ) -> Result<Vec<Wrench>, SystemError> {
        let acceleration = self.link_accelerations(part, vdot, s);
        let mut needed = self.applied(part, t, q, v, s)?;
        for &node in &part.nodes {
            let (w, b) = (&mut needed[node - 1], &self.placed.bodies[node - 1]);
            let x = &s.full.links[b.link];
            let (alpha, acc) = acceleration[b.link];
            let (alpha, acc) = (x.alpha + alpha, x.acc + acc);
            let arm = x.rot.apply(b.com - self.reference[b.link]);
            let a = acc + alpha.cross(arm) + x.w.cross(x.w.cross(arm));
            let j = x.rot.mul(&b.inertia).mul(&x.rot.transpose());
            let spin = j.apply(x.w);
            let moment = j.apply(alpha) + x.w.cross(spin);
            *w = Wrench { moment: moment - w.moment, force: a.times(b.mass) - w.force };
        }
        Ok(needed)
    }

    /// What the multipliers give by themselves: the reactions of cut joints; and what each body of `part` still needs with
    /// them.
    fn known(
        &self,
        part: &Part,
        t: f64,
        q: &[f64],
        v: &[f64],
        vdot: &[f64],
        lambda: &[f64],
        s: &mut ModelScratch,
    ) -> Result<(Vec<Wrench>, Vec<Wrench>), SystemError> {
        self.look_at(part, q, v, s);
        let mut needed = self.needed(part, t, q, v, vdot, s)?;
        let mut joints = vec![Wrench::default(); self.placed.joints.len()];
        for &k in &part.closings {
            let (j, w) = self.closing_reaction(k, s, lambda);
            let p = &self.placed.joints[j];
            let point = self.joint_point_now(s, j);
            self.put(s, &mut needed, p.child, &w.times(-1.0), point);
            self.put(s, &mut needed, p.parent, &w, point);
            joints[j] = w;
        }
        Ok((joints, needed))
    }

    /// Efforts of the drives along the velocities of joint `j`.
    pub fn drive_of(&self, j: usize, lambda: &[f64]) -> Vec<f64> {
        let mut efforts = vec![0.0; self.placed.joints[j].shape.freedoms()];
        for d in self.drives.iter().filter(|d| d.joint == j) {
            efforts[d.coordinate] = lambda[d.row];
        }
        efforts
    }

    /// Reaction of one joint for a motion with the multipliers `lambda`, in world axes: action of the joint's constraints on
    /// its child, reduced to the joint's point. `part` is its [`part_of_reaction`](Self::part_of_reaction).
    ///
    /// What acts along the joint's own freedoms is not asked for: it is no reaction.
    pub fn reaction_of(
        &self,
        j: usize,
        part: &Part,
        t: f64,
        q: &[f64],
        v: &[f64],
        vdot: &[f64],
        lambda: &[f64],
        s: &mut ModelScratch,
    ) -> Result<Wrench, SystemError> {
        let (joints, needed) = self.known(part, t, q, v, vdot, lambda, s)?;
        let tree = &self.placed.topology.tree;
        let held = part.edges.iter().map(|&e| &tree[e]).find(|e| e.joint == Some(j));
        let w = match held {
            Some(e) => {
                let outer = e.to - 1;
                let transmitted = self.inward(part, s, needed);
                let w = transmitted[outer].about(self.com_now(s, outer) - self.joint_point_now(s, j));
                let w = if e.reversed { w.times(-1.0) } else { w }; // on the child
                let drives = self.drive_of(j, lambda);
                with_along(&self.free_axes(j, s), &w, |i| drives[i])
            }
            None => joints[j],
        };
        let out = self.placed.basis;
        Ok(Wrench { moment: out.apply_transposed(w.moment), force: out.apply_transposed(w.force) })
    }

    /// Reactions of all joints for a motion with the multipliers `lambda`.
    pub fn reactions(
        &self,
        t: f64,
        q: &[f64],
        v: &[f64],
        vdot: &[f64],
        lambda: &[f64],
        s: &mut ModelScratch,
    ) -> Result<Reactions, SystemError> {
        self.reactions_of(&self.whole(), t, q, v, vdot, lambda, s)
    }

    /// The same with the [`whole`](Self::whole) at hand.
    pub fn reactions_of(
        &self,
        whole: &Part,
        t: f64,
        q: &[f64],
        v: &[f64],
        vdot: &[f64],
        lambda: &[f64],
        s: &mut ModelScratch,
    ) -> Result<Reactions, SystemError> {
        let (joints, needed) = self.known(whole, t, q, v, vdot, lambda, s)?;
        let drives = (0..joints.len()).map(|j| self.drive_of(j, lambda)).collect();
        let mut result = Reactions { joints, drives, residual: 0.0 };
        let transmitted = self.inward(whole, s, needed.clone());
        let efforts = self.efforts(t, q, v)?;
        let mut left = needed;
        let mut largest = self.full.gravity.norm() * self.placed.bodies.iter().fold(0.0, |m: f64, b| m.max(b.mass));
        for e in &self.placed.topology.tree {
            let outer = e.to - 1;
            let Some(j) = e.joint else { continue };
            let point = self.joint_point_now(s, j);
            let w = transmitted[outer].about(self.com_now(s, outer) - point);
            let w = if e.reversed { w.times(-1.0) } else { w }; // on the child
            let p = &self.placed.joints[j];
            let axes = self.free_axes(j, s);
            let velocities: Vec<usize> = p
                .links
                .iter()
                .flatten()
                .zip(&p.shape.motions)
                .flat_map(|(&l, m)| {
                    let v = self.placed.links[l].v;
                    v..v + m.velocities()
                })
                .collect();
            let drives = &result.drives[j];
            // along a free direction only a drive can be a reaction; what is applied there is not one
            let reaction = with_along(&axes, &w, |i| drives[i]);
            let acting = with_along(&axes, &w, |i| drives[i] + efforts[velocities[i]]);
            result.joints[j] = reaction;
            let (parent, child) = (p.parent, p.child);
            self.put(s, &mut left, child, &acting.times(-1.0), point);
            self.put(s, &mut left, parent, &acting, point);
            largest = largest.max(acting.force.norm());
        }
        for w in &result.joints {
            largest = largest.max(w.force.norm()).max(w.moment.norm() / self.placed.size);
        }
        for w in &left {
            result.residual = result.residual.max(w.force.norm()).max(w.moment.norm() / self.placed.size);
        }
        result.residual = if largest > 0.0 { result.residual / largest } else { result.residual };
        let out = self.placed.basis;
        for w in &mut result.joints {
            *w = Wrench { moment: out.apply_transposed(w.moment), force: out.apply_transposed(w.force) };
        }
        Ok(result)
    }

    /// What v' adds to the angular acceleration and to the acceleration of the reference point of the links of `part`.
    fn link_accelerations(&self, part: &Part, vdot: &[f64], s: &ModelScratch) -> Vec<(Vec3<f64>, Vec3<f64>)> {
        let mut moved = vec![(Vec3::zero(), Vec3::zero()); self.full.links.len()];
        for &i in &part.links {
            let (w, u) = moved[self.full.links[i].parent];
            moved[i] = self.full.carry(i, &s.full, w, u, |v| vdot[v]);
        }
        moved
    }

    /// Joint wrenches (world axes) that the multipliers alone bring about: for self-stresses.
    pub fn wrenches_of(&self, q: &[f64], lambda: &[f64], s: &mut ModelScratch) -> Vec<Wrench> {
        let still = vec![0.0; self.placed.nv];
        let whole = self.whole();
        self.look_at(&whole, q, &still, s);
        let mut needed = vec![Wrench::default(); self.placed.bodies.len()];
        let mut joints = vec![Wrench::default(); self.placed.joints.len()];
        for &k in &whole.closings {
            let (j, w) = self.closing_reaction(k, s, lambda);
            let p = &self.placed.joints[j];
            let point = self.joint_point_now(s, j);
            self.put(s, &mut needed, p.child, &w.times(-1.0), point);
            self.put(s, &mut needed, p.parent, &w, point);
            joints[j] = w;
        }
        let transmitted = self.inward(&whole, s, needed);
        for e in &self.placed.topology.tree {
            if let Some(j) = e.joint {
                let w = transmitted[e.to - 1].about(self.com_now(s, e.to - 1) - self.joint_point_now(s, j));
                joints[j] = if e.reversed { w.times(-1.0) } else { w };
            }
        }
        let out = self.placed.basis;
        joints
            .iter()
            .map(|w| Wrench { moment: out.apply_transposed(w.moment), force: out.apply_transposed(w.force) })
            .collect()
    }
}
