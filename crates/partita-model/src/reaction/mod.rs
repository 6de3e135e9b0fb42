//! Reactions of all joints: at a cut joint from λ, at a tree joint by a Newton-Euler sweep with λ applied.   (R3)

mod applied;
mod augmented;

use crate::evaluator::{Engine, Evaluator, Scratch};
use crate::joint::Motion;
use applied::Applied;
use partita_math::dense;
use partita_math::scalar::Scalar;
use partita_math::spatial::{Mat3, Planar, Space, Vec3};
use partita_system::SystemError;

fn lift<S: Scalar>(x: Vec3<f64>) -> Vec3<S> {
    Vec3::from_f64(x.0)
}

fn constant<S: Scalar>(m: &Mat3<f64>) -> Mat3<S> {
    Mat3::from_f64(m.0)
}

/// Moment about a point, and force.
#[derive(Clone, Copy, Debug)]
pub struct Wrench<S = f64> {
    /// Moment.
    pub moment: Vec3<S>,
    /// Force.
    pub force: Vec3<S>,
}

impl<S: Scalar> Default for Wrench<S> {
    fn default() -> Self {
        Self { moment: Vec3::zero(), force: Vec3::zero() }
    }
}

impl<S: Scalar> Wrench<S> {
    /// The same wrench about a point that lies `arm` before the old one (old = new + arm).
    fn about(&self, arm: Vec3<S>) -> Self {
        Self { moment: self.moment + arm.cross(self.force), force: self.force }
    }
    fn add(&mut self, o: &Self) {
        self.moment += o.moment;
        self.force += o.force;
    }
    fn opposite(&self) -> Self {
        Self { moment: -self.moment, force: -self.force }
    }
    /// In the axes of the world.
    fn out_of(&self, basis: &Mat3<S>) -> Self {
        Self { moment: basis.apply_transposed(self.moment), force: basis.apply_transposed(self.force) }
    }
}

/// Reactions at one instant.
#[derive(Clone, Debug, Default)]
pub struct Reactions<S = f64> {
    /// Action of each joint's constraints on its child, reduced to the joint's point, world axes.
    pub joints: Vec<Wrench<S>>,
    /// Effort of drives along each joint's velocities.
    pub drives: Vec<Vec<S>>,
    /// Largest Newton-Euler residual over the bodies over the largest force (moments over the mechanism's size).
    pub residual: S,
}

/// What is known before the sweep.
struct Known<S> {
    reactions: Reactions<S>,
    /// What each body still needs.
    needed: Vec<Wrench<S>>,
    /// Applied along each velocity of the tree.
    efforts: Vec<S>,
}

/// Pivots below this part of a diagonal entry: axes in line.
const IN_LINE: f64 = 1e-14;

/// Along `axes` (three at the most): replace the components of x by `wanted`. Axes in line (gimbal lock) leave x alone:
/// nothing tells them apart.
fn replace<S: Scalar>(x: Vec3<S>, axes: &[Vec3<S>], wanted: &[S]) -> Vec3<S> {
    let n = axes.len();
    if n == 0 {
        return x;
    }
    let mut gram = [S::zero(); 9];
    let mut off = [S::zero(); 3];
    for i in 0..n {
        for j in 0..n {
            gram[i * n + j] = axes[i].dot(axes[j]);
        }
        off[i] = wanted[i] - axes[i].dot(x);
    }
    let mut apart = S::one();
    let diagonal: [S; 3] = std::array::from_fn(|i| if i < n { gram[i * n + i] } else { S::one() });
    dense::cholesky_straight(&mut gram[..n * n], n);
    for i in 0..n {
        let (root, least) = (gram[i * n + i], diagonal[i].scale(IN_LINE));
        // NaN is not above 0
        apart = apart.where_positive(root * root - least, apart);
    }
    dense::cholesky_solve(&gram[..n * n], n, &mut off);
    let replaced = axes.iter().zip(off).fold(x, |x, (a, k)| x + a.times(k));
    Vec3::where_positive(apart, replaced, x)
}

impl<S: Scalar> Evaluator<S> {
    /// Free axes of a joint now (turns, slides), mechanism axes, in the order of its velocities.
    fn free_axes(&self, j: usize, s: &Scratch<S>) -> Vec<(bool, Vec3<S>)> {
        let p = &self.placed.joints[j];
        let mut axes = Vec::new();
        match &p.links {
            Some(links) => {
                for (m, &link) in p.shape.motions.iter().zip(links) {
                    let x = &s.full.links[link];
                    let sign = S::from_f64(if p.reversed { -1.0 } else { 1.0 });
                    match m {
                        Motion::Turn(_) => axes.push((true, x.axis.times(sign))),
                        Motion::Slide(_) => axes.push((false, x.direction.times(sign))),
                        Motion::Ball => (0..3).for_each(|i| axes.push((true, x.rot.column(i)))),
                    }
                }
            }
            None => {
                let parent = self.node_state(s, p.parent).rot.mul(&constant(&p.on_parent));
                let child = self.node_state(s, p.child).rot.mul(&constant(&p.on_child));
                let turns = p.shape.motions.iter().filter(|m| matches!(m, Motion::Turn(_))).count();
                let mut seen = 0;
                for m in &p.shape.motions {
                    match m {
                        Motion::Turn(a) => {
                            seen += 1;
                            // the last of two turns is about an axis of the child
                            axes.push((
                                true,
                                if seen == turns { child.apply(lift(*a)) } else { parent.apply(lift(*a)) },
                            ));
                        }
                        Motion::Slide(a) => axes.push((false, parent.apply(lift(*a)))),
                        Motion::Ball => (0..3).for_each(|i| axes.push((true, child.column(i)))),
                    }
                }
            }
        }
        axes
    }

    /// Wrenches of the closings for the multipliers λ: joint, wrench on its child about the joint's point there.
    fn closing_reactions(&self, s: &mut Scratch<S>, lambda: &[S]) -> Vec<(usize, Wrench<S>)> {
        match (&self.engine, &s.flat) {
            (Engine::Flat(tree), Some(x)) => tree
                .closings
                .iter()
                .map(|k| {
                    let (m, f) = tree.closing_wrench(k, x, lambda);
                    (k.joint, Wrench { moment: Planar::ang_to(m), force: Planar::vec_to(f) })
                })
                .collect(),
            _ => self
                .full
                .closings
                .iter()
                .map(|k| {
                    let (moment, force) = self.full.closing_wrench(k, &s.full, lambda);
                    (k.joint, Wrench { moment, force })
                })
                .collect(),
        }
    }

    fn com_now(&self, s: &Scratch<S>, body: usize) -> Vec3<S> {
        let link = self.placed.bodies[body].link;
        self.full.place(link, &s.full) + self.arm_now(s, link, self.numbers.bodies[body].com)
    }

    fn joint_point_now(&self, s: &Scratch<S>, j: usize) -> Vec3<S> {
        let p = &self.placed.joints[j];
        let link = self.placed.link_of(p.child);
        self.full.place(link, &s.full) + self.arm_now(s, link, self.numbers.joints[j].1)
    }

    /// Wrench through every tree joint on its outer body, about that body's centre of mass, given what each body needs.
    fn inward(&self, s: &Scratch<S>, mut needed: Vec<Wrench<S>>) -> Vec<Wrench<S>> {
        for e in self.placed.topology.tree.iter().rev() {
            if e.from > 0 {
                let w = needed[e.to - 1].about(self.com_now(s, e.to - 1) - self.com_now(s, e.from - 1));
                needed[e.from - 1].add(&w);
            }
        }
        needed
    }

    /// What each body needs besides what is applied: m a − F, J α + ω × J ω − T, about its centre of mass; and the
    /// applied efforts along the tree's velocities.
    fn needed(
        &self,
        t: S,
        q: &[S],
        v: &[S],
        vdot: &[S],
        s: &mut Scratch<S>,
    ) -> Result<(Vec<Wrench<S>>, Vec<S>), SystemError> {
        let Applied { on: mut needed, efforts } = self.applied(t, q, v, s)?;
        let acceleration = self.link_accelerations(vdot, s);
        for ((w, b), p) in needed.iter_mut().zip(&self.numbers.bodies).zip(&self.placed.bodies) {
            let x = &s.full.links[p.link];
            let (alpha, acc) = acceleration[p.link];
            let arm = x.rot.apply(b.com - self.numbers.reference[p.link]);
            let a = acc + alpha.cross(arm) + x.w.cross(x.w.cross(arm));
            let j = x.rot.mul(&b.inertia).mul(&x.rot.transpose());
            let spin = j.apply(x.w);
            let moment = j.apply(alpha) + x.w.cross(spin);
            *w = Wrench { moment: moment - w.moment, force: a.times(b.mass) - w.force };
        }
        Ok((needed, efforts))
    }

    /// What the multipliers give by themselves: the reactions of cut joints and the efforts of drives; and what each body
    /// still needs with them.
    fn known(
        &self,
        t: S,
        q: &[S],
        v: &[S],
        vdot: &[S],
        lambda: &[S],
        s: &mut Scratch<S>,
    ) -> Result<Known<S>, SystemError> {
        self.look(q, v, s);
        let (mut needed, efforts) = self.needed(t, q, v, vdot, s)?;
        let mut result = Reactions {
            joints: vec![Wrench::default(); self.placed.joints.len()],
            drives: self.placed.joints.iter().map(|p| vec![S::zero(); p.shape.freedoms()]).collect(),
            residual: S::zero(),
        };
        for (j, w) in self.closing_reactions(s, lambda) {
            let p = &self.placed.joints[j];
            let point = self.joint_point_now(s, j);
            self.put(s, &mut needed, p.child, &w.opposite(), point);
            self.put(s, &mut needed, p.parent, &w, point);
            result.joints[j] = w;
        }
        for d in self.drives.iter() {
            result.drives[d.joint][d.coordinate] = lambda[d.row];
        }
        Ok(Known { reactions: result, needed, efforts })
    }

    /// Reactions of all joints for a motion with the multipliers `lambda`.
    pub fn reactions(
        &self,
        t: S,
        q: &[S],
        v: &[S],
        vdot: &[S],
        lambda: &[S],
        s: &mut Scratch<S>,
    ) -> Result<Reactions<S>, SystemError> {
        let Known { reactions: mut result, needed, efforts } = self.known(t, q, v, vdot, lambda, s)?;
        let transmitted = self.inward(s, needed.clone());
        let mut left = needed;
        let heaviest = self.numbers.bodies.iter().fold(S::zero(), |m, b| m.max(b.mass));
        let mut largest = self.full.gravity.norm() * heaviest;
        for e in &self.placed.topology.tree {
            let outer = e.to - 1;
            let Some(j) = e.joint else { continue };
            let point = self.joint_point_now(s, j);
            let w = transmitted[outer].about(self.com_now(s, outer) - point);
            let w = if e.reversed { w.opposite() } else { w }; // on the child
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
            let with = |wanted: &dyn Fn(usize) -> S| {
                let of = |turns: bool| -> (Vec<Vec3<S>>, Vec<S>) {
                    axes.iter().enumerate().filter(|(_, a)| a.0 == turns).map(|(i, a)| (a.1, wanted(i))).unzip()
                };
                let ((ta, tw), (sa, sw)) = (of(true), of(false));
                Wrench { moment: replace(w.moment, &ta, &tw), force: replace(w.force, &sa, &sw) }
            };
            let drives = &result.drives[j];
            // along a free direction only a drive can be a reaction; what is applied there is not one
            let reaction = with(&|i| drives[i]);
            let acting = with(&|i| drives[i] + efforts[velocities[i]]);
            result.joints[j] = reaction;
            let (parent, child) = (p.parent, p.child);
            self.put(s, &mut left, child, &acting.opposite(), point);
            self.put(s, &mut left, parent, &acting, point);
            largest = largest.max(acting.force.norm());
        }
        for w in &result.joints {
            largest = largest.max(w.force.norm()).max(w.moment.norm().scale(1.0 / self.placed.size));
        }
        for w in &left {
            result.residual = result.residual.max(w.force.norm()).max(w.moment.norm().scale(1.0 / self.placed.size));
        }
        result.residual = largest.where_positive(result.residual / largest, result.residual);
        let basis = constant(&self.placed.basis);
        result.joints.iter_mut().for_each(|w| *w = w.out_of(&basis));
        Ok(result)
    }

    /// Angular acceleration and acceleration of the reference point of every link.
    fn link_accelerations(&self, vdot: &[S], s: &Scratch<S>) -> Vec<(Vec3<S>, Vec3<S>)> {
        let mut moved = vec![(Vec3::zero(), Vec3::zero()); self.full.links.len()];
        for i in 1..moved.len() {
            let (w, u) = moved[self.full.links[i].parent];
            moved[i] = self.full.carry(i, &s.full, w, u, |v| vdot[v]);
        }
        moved.iter().zip(&s.full.links).map(|(m, x)| (x.alpha + m.0, x.acc + m.1)).collect()
    }

    /// Joint wrenches (world axes) that the multipliers alone bring about: for self-stresses.
    pub fn wrenches_of(&self, q: &[S], lambda: &[S], s: &mut Scratch<S>) -> Vec<Wrench<S>> {
        let still = vec![S::zero(); self.placed.nv];
        self.look(q, &still, s);
        let mut needed = vec![Wrench::default(); self.placed.bodies.len()];
        let mut joints = vec![Wrench::default(); self.placed.joints.len()];
        for (j, w) in self.closing_reactions(s, lambda) {
            let p = &self.placed.joints[j];
            let point = self.joint_point_now(s, j);
            self.put(s, &mut needed, p.child, &w.opposite(), point);
            self.put(s, &mut needed, p.parent, &w, point);
            joints[j] = w;
        }
        let transmitted = self.inward(s, needed);
        for e in &self.placed.topology.tree {
            if let Some(j) = e.joint {
                let w = transmitted[e.to - 1].about(self.com_now(s, e.to - 1) - self.joint_point_now(s, j));
                joints[j] = if e.reversed { w.opposite() } else { w };
            }
        }
        let basis = constant(&self.placed.basis);
        joints.iter().map(|w| w.out_of(&basis)).collect()
    }
}
