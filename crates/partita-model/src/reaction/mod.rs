//! Reactions of all joints: at a cut joint from λ, at a tree joint by a Newton-Euler sweep with λ applied.   (R3)
//!
//! In absolute coordinates every joint is cut. The rows of a planar mechanism then contain nothing about loads across
//! its plane; the same sweep along a tree of its joints does.

mod applied;
mod augmented;

pub use crate::wrench::{wrench_of_efforts, Wrench};

use crate::evaluator::{Engine, Evaluator, Scratch};
use crate::joint::Motion;
use crate::part::Part;
use crate::rows::Owner;
use crate::topology::TreeEdge;
use crate::tree::TreeScratch;
use crate::wrench::Free;
use applied::Applied;
use partita_math::scalar::Scalar;
use partita_math::spatial::{Embedding, Mat3, Planar, Spatial, Vec3};
use partita_system::SystemError;

fn lift<S: Scalar>(x: Vec3<f64>) -> Vec3<S> {
    Vec3::from_f64(x.0)
}

fn constant<S: Scalar>(m: &Mat3<f64>) -> Mat3<S> {
    Mat3::from_f64(m.0)
}

/// Reactions at one instant.
#[derive(Clone, Debug, Default)]
pub struct Reactions<S = f64> {
    /// Action of each joint's constraints on its child, reduced to the joint's point, world axes.
    pub joints: Vec<Wrench<S>>,
    /// Effort of drives along each joint's velocities.
    pub drives: Vec<Vec<S>>,
    /// Largest Newton-Euler residual over the bodies over the largest force (moments over the mechanism's size),
    /// inertia terms included: a freely moving body has no other.
    pub residual: S,
    /// As `residual`, of each body.
    pub residuals: Vec<S>,
    /// Residual on each body, about its centre of mass, mechanism axes.
    left: Vec<Wrench<S>>,
    /// The largest force besides those of the joints.
    largest: S,
}

/// Known before the sweep.
struct Known<S> {
    /// Reactions of cut joints.
    joints: Vec<Wrench<S>>,
    /// Load that each body still needs.
    needed: Vec<Wrench<S>>,
    /// Applied along each velocity of the tree.
    efforts: Vec<S>,
    /// Along each velocity of the tree: efforts of the joint's own conditions and drives.
    own: Vec<S>,
    /// The largest force that enters a body's balance, moments over the mechanism's size.
    largest: S,
}

impl<S: Scalar> Evaluator<S> {
    /// Present free axes of a joint (rotations, translations), mechanism axes, in the order of its velocities; into
    /// `axes`.
    pub(crate) fn free_axes(&self, j: usize, s: &Scratch<S>, axes: &mut Vec<(bool, Vec3<S>)>) {
        let p = &self.placed.joints[j];
        axes.clear();
        match &p.links {
            Some(links) => {
                for (m, &link) in p.shape.motions.iter().zip(links) {
                    let x = &s.full.links[link];
                    let sign = S::from_f64(if p.reversed { -1.0 } else { 1.0 });
                    match m {
                        Motion::Turn(_) => axes.push((true, x.axis.times(sign))),
                        Motion::Slide(_) => axes.push((false, x.direction.times(sign))),
                        Motion::Ball => (0..3).for_each(|i| axes.push((true, x.rot.column(i).times(sign)))),
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
                            // the last of two rotations is about an axis of the child
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
    }

    /// The joint of the tree whose velocity this is, and which of its velocities.
    pub(crate) fn joint_moved_by(&self, v: usize) -> Option<(usize, usize)> {
        let mut velocities = Vec::new();
        (0..self.placed.joints.len()).find_map(|j| {
            self.velocities_of(j, &mut velocities);
            Some((j, velocities.iter().position(|i| *i == v)?))
        })
    }

    /// The unit effort along a velocity that no joint has: of a body in space.
    pub(crate) fn load_along(&self, v: usize, s: &Scratch<S>, put: impl FnOnce([usize; 2], Wrench<S>, Vec3<S>)) {
        let links = &self.placed.links;
        let Some(link) = links.iter().skip(1).position(|l| l.v == v).map(|i| i + 1) else { return };
        let carries = |mut on: usize| {
            while on > link {
                on = links[on].parent;
            }
            on == link
        };
        let Some(body) = self.placed.bodies.iter().position(|b| carries(b.link)) else { return };
        let (x, mut w) = (&s.full.links[link], Wrench::default());
        match links[link].motion {
            Motion::Turn(_) => w.moment = x.axis,
            Motion::Slide(_) => w.force = x.direction,
            Motion::Ball => return, // none of them is a coordinate
        }
        put([0, body + 1], w, self.com_now(s, body));
    }

    /// Velocities of a joint of the tree, in the order of its motions; into `velocities`.
    fn velocities_of(&self, j: usize, velocities: &mut Vec<usize>) {
        let p = &self.placed.joints[j];
        let of = |(&l, m): (&usize, &Motion)| {
            let v = self.placed.links[l].v;
            v..v + m.velocities()
        };
        velocities.clear();
        velocities.extend(p.links.iter().flatten().zip(&p.shape.motions).flat_map(of));
    }

    /// Wrench of loop closure `k` for the multipliers λ on its child about the joint's point there, and its joint.
    fn closing_reaction(&self, k: usize, s: &Scratch<S>, lambda: &[S]) -> (usize, Wrench<S>) {
        match (&self.engine, &s.planar) {
            (Engine::Planar(tree), Some(x)) => {
                let (m, f) = tree.closing_wrench(&tree.closings[k], x, lambda);
                (tree.closings[k].joint, Wrench { moment: Planar::ang_to(m), force: Planar::vec_to(f) })
            }
            _ => {
                let (moment, force) = self.full.closing_wrench(&self.full.closings[k], &s.full, lambda);
                (self.full.closings[k].joint, Wrench { moment, force })
            }
        }
    }

    fn com_now(&self, s: &Scratch<S>, body: usize) -> Vec3<S> {
        let link = self.placed.bodies[body].link;
        self.full.reference_point(link, &s.full) + self.arm_now(s, link, self.numbers.bodies[body].com)
    }

    pub(crate) fn joint_point_now(&self, s: &Scratch<S>, j: usize) -> Vec3<S> {
        let p = &self.placed.joints[j];
        let link = self.placed.link_of(p.child);
        self.full.reference_point(link, &s.full) + self.arm_now(s, link, self.numbers.joints[j].1)
    }

    /// Wrench through every tree joint of `part` on its outer body, about that body's centre of mass, given what each
    /// body needs.
    fn inward(&self, part: &Part, s: &Scratch<S>, mut needed: Vec<Wrench<S>>) -> Vec<Wrench<S>> {
        for &e in part.edges.iter().rev() {
            let e = &self.placed.carrying[e];
            if e.from > 0 {
                let w = needed[e.to - 1].about(self.com_now(s, e.to - 1) - self.com_now(s, e.from - 1));
                needed[e.from - 1].add(&w);
            }
        }
        needed
    }

    /// Load that joint `j` of the carrying edge `e` transmits to its child, about the joint's point there.
    fn passed_on(&self, e: &TreeEdge, j: usize, transmitted: &[Wrench<S>], s: &Scratch<S>) -> Wrench<S> {
        let outer = e.to - 1;
        let w = transmitted[outer].about(self.com_now(s, outer) - self.joint_point_now(s, j));
        if e.reversed {
            w.opposite()
        } else {
            w
        }
    }

    /// Load that each body of `part` needs besides the applied one: m a − F, J α + ω × J ω − T, about its centre of
    /// mass; and the applied efforts along the tree's velocities; and the largest of these terms, before they cancel
    /// each other. No reaction is known yet.
    fn needed(
        &self,
        part: &Part,
        t: S,
        q: &[S],
        v: &[S],
        vdot: &[S],
        s: &mut Scratch<S>,
    ) -> Result<Known<S>, SystemError> {
        let Applied { on: mut needed, mut efforts, mut largest } = self.applied(part, t, q, v, s)?;
        for (i, rotor) in self.full.rotating() {
            efforts[i] -= rotor * vdot[i];
        }
        let added = self.link_accelerations(part, vdot, s);
        let per_length = S::one().scale(1.0 / self.placed.size);
        for body in part.nodes.iter().map(|node| node - 1) {
            let (w, b, link) = (&mut needed[body], &self.numbers.bodies[body], self.placed.bodies[body].link);
            let x = &s.full.links[link];
            let (alpha, acc) = (x.alpha + added[link].0, x.acc + added[link].1);
            let arm = x.rot.apply(b.com - self.numbers.reference[link]);
            let (turned, drawn) = (alpha.cross(arm), x.w.cross(x.w.cross(arm)));
            let a = acc + turned + drawn;
            let j = x.rot.mul(&b.inertia).mul(&x.rot.transpose());
            let (spun, spin) = (j.apply(alpha), j.apply(x.w));
            let moment = spun + x.w.cross(spin);
            let force = acc.norm().max(turned.norm()).max(drawn.norm()) * b.mass;
            let couple = spun.norm().max(x.w.norm() * spin.norm()).max(w.moment.norm());
            largest = largest.max(force).max(w.force.norm()).max(couple * per_length);
            *w = Wrench { moment: moment - w.moment, force: a.times(b.mass) - w.force };
        }
        Ok(Known { joints: Vec::new(), needed, efforts, own: Vec::new(), largest })
    }

    /// First row of condition `k` in the space of the evaluations.
    fn row_of_condition(&self, k: usize) -> usize {
        match &self.engine {
            Engine::Planar(tree) => tree.conditions[k].row,
            Engine::Full => self.full.conditions[k].row,
        }
    }

    /// Loads of the conditions of `part` for the multipliers λ at (t, q), subtracted from the load that each body
    /// needs; those of a joint's own conditions and drives go to its wrench where it is cut, else to `own` along each
    /// velocity; others along velocities to `efforts`.
    fn hold_with(
        &self,
        part: &Part,
        (t, q, lambda): (S, &[S], &[S]),
        s: &Scratch<S>,
        known: &mut Known<S>,
    ) -> Result<(), SystemError> {
        let at = self.instant(t, q, &[]);
        for &k in &part.conditions {
            let c = &self.full.conditions[k];
            let first = self.row_of_condition(k);
            let joint = self.joint_of(c.owner);
            let Known { joints, needed, efforts, own, .. } = known;
            let along = if joint.is_some() { own } else { efforts };
            c.apply(
                &self.full,
                &s.full,
                &at,
                &lambda[first..first + c.rows()],
                |x, pushed| {
                    let w = Wrench { moment: pushed.unit.moment.times(x), force: pushed.unit.force.times(x) };
                    let [a, b] = pushed.nodes;
                    self.put(s, needed, b, &w.opposite(), pushed.unit.in_world);
                    self.put(s, needed, a, &w, pushed.unit.in_world);
                    if let Some(j) = joint {
                        joints[j].add(&w.about(pushed.unit.in_world - self.joint_point_now(s, j)));
                    }
                },
                |v, x| along[v] += x,
            )?;
        }
        Ok(())
    }

    /// Loads of a multiplier `x` of row `row`, if the row belongs to a condition of a mechanism computed in space, at
    /// poses of its tree at (t, q): wrenches on the second of two nodes, their opposites on the first, about points of
    /// the tree's world; and efforts along velocities of the tree.
    pub fn apply_condition(
        &self,
        tree: &TreeScratch<Spatial<S>>,
        (t, q): (S, &[S]),
        (row, x): (usize, S),
        mut put: impl FnMut([usize; 2], Wrench<S>, Vec3<S>),
        along: impl FnMut(usize, S),
    ) -> Result<(), SystemError> {
        let Some(c) = self.full.conditions.iter().find(|c| (c.row..c.row + c.rows()).contains(&row)) else {
            return Ok(());
        };
        let mut lambda = [S::zero(); 2];
        lambda[row - c.row] = x;
        let at = self.instant(t, q, &[]);
        let push = |x: S, pushed: &crate::coupling::Pushed<Spatial<S>>| {
            let w = Wrench { moment: pushed.unit.moment.times(x), force: pushed.unit.force.times(x) };
            put(pushed.nodes, w, pushed.unit.in_world);
        };
        c.apply(&self.full, tree, &at, &lambda, push, along)
    }

    /// Wrenches of the cut joints of `part` for the multipliers λ, subtracted from the load that each body needs.
    fn close_with(&self, part: &Part, lambda: &[S], s: &Scratch<S>, needed: &mut [Wrench<S>]) -> Vec<Wrench<S>> {
        let mut joints = vec![Wrench::default(); self.placed.joints.len()];
        for &k in &part.closings {
            let (j, w) = self.closing_reaction(k, s, lambda);
            let p = &self.placed.joints[j];
            let point = self.joint_point_now(s, j);
            self.put(s, needed, p.child, &w.opposite(), point);
            self.put(s, needed, p.parent, &w, point);
            joints[j] = w;
        }
        joints
    }

    /// The reactions of cut joints, which follow from the multipliers, and the remaining wrench of each body of `part`.
    fn known(
        &self,
        part: &Part,
        t: S,
        q: &[S],
        v: &[S],
        vdot: &[S],
        lambda: &[S],
        s: &mut Scratch<S>,
    ) -> Result<Known<S>, SystemError> {
        self.look_at(part, q, v, s);
        let mut known = self.needed(part, t, q, v, vdot, s)?;
        known.joints = self.close_with(part, lambda, s, &mut known.needed);
        known.own = vec![S::zero(); self.placed.nv];
        self.hold_with(part, (t, q, lambda), s, &mut known)?;
        Ok(known)
    }

    /// Efforts of the drives along the velocities of joint `j`.
    pub fn drive_of(&self, j: usize, lambda: &[S]) -> Vec<S> {
        let mut efforts = vec![S::zero(); self.placed.joints[j].shape.dof()];
        for d in &self.drives {
            match d.joint {
                Some((joint, coordinate)) if joint == j => efforts[coordinate] += lambda[d.row],
                _ => {}
            }
        }
        efforts
    }

    /// Reaction of one joint for a motion with the multipliers `lambda`, in world axes: action of the joint's
    /// constraints on its child, reduced to the joint's point. `part` is its
    /// [`part_of_reaction`](Self::part_of_reaction).
    ///
    /// Efforts along the joint's own degrees of freedom are not included: they are not reactions.
    pub fn reaction_of(
        &self,
        j: usize,
        part: &Part,
        t: S,
        q: &[S],
        v: &[S],
        vdot: &[S],
        lambda: &[S],
        s: &mut Scratch<S>,
    ) -> Result<Wrench<S>, SystemError> {
        let Known { joints, needed, own, .. } = self.known(part, t, q, v, vdot, lambda, s)?;
        let tree = &self.placed.carrying;
        let held = part.edges.iter().map(|&e| &tree[e]).find(|e| e.joint == Some(j));
        let w = match held {
            Some(e) => {
                let w = self.passed_on(e, j, &self.inward(part, s, needed), s);
                if self.placed.joints[j].links.is_some() {
                    let (mut axes, mut velocities) = (Vec::new(), Vec::new());
                    self.free_axes(j, s, &mut axes);
                    self.velocities_of(j, &mut velocities);
                    Free::new(&axes).with_along(&w, |i| own[velocities[i]])
                } else {
                    let mut whole = joints[j];
                    whole.add(&w.across());
                    whole
                }
            }
            None => joints[j],
        };
        Ok(w.out_of(&constant(&self.placed.basis)))
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
        self.reactions_of(&self.whole(), t, q, v, vdot, lambda, s)
    }

    /// As `reactions`, with a given [`whole`](Self::whole).
    pub fn reactions_of(
        &self,
        whole: &Part,
        t: S,
        q: &[S],
        v: &[S],
        vdot: &[S],
        lambda: &[S],
        s: &mut Scratch<S>,
    ) -> Result<Reactions<S>, SystemError> {
        let mut result = self.balanced(whole, t, q, v, vdot, lambda, s)?;
        result.drives = self.placed.joints.iter().map(|p| vec![S::zero(); p.shape.dof()]).collect();
        for d in &self.drives {
            if let Some((joint, coordinate)) = d.joint {
                result.drives[joint][coordinate] += lambda[d.row];
            }
        }
        Ok(result)
    }

    /// Action of the ground on the mechanism through all of its joints, with the efforts in them: from reactions at the
    /// present look, about the origin of the world, world axes.
    pub fn ground_wrench(&self, r: &Reactions<S>, s: &Scratch<S>) -> Wrench<S> {
        let mut sum = Wrench::default();
        for (j, (p, w)) in self.placed.joints.iter().zip(&r.joints).enumerate() {
            if (p.parent == 0) == (p.child == 0) {
                continue;
            }
            let point = constant::<S>(&self.placed.basis).apply_transposed(self.joint_point_now(s, j));
            let about = w.about(point);
            sum.add(&if p.child == 0 { about.opposite() } else { about });
        }
        sum
    }

    /// [`Reactions::residual`] of a motion, with a given [`whole`](Self::whole).
    pub fn residual_of(
        &self,
        whole: &Part,
        t: S,
        q: &[S],
        v: &[S],
        vdot: &[S],
        lambda: &[S],
        s: &mut Scratch<S>,
    ) -> Result<S, SystemError> {
        Ok(self.balanced(whole, t, q, v, vdot, lambda, s)?.residual)
    }

    /// Wrenches of all joints and what they leave of each body's balance; no efforts of drives.
    fn balanced(
        &self,
        whole: &Part,
        t: S,
        q: &[S],
        v: &[S],
        vdot: &[S],
        lambda: &[S],
        s: &mut Scratch<S>,
    ) -> Result<Reactions<S>, SystemError> {
        let Known { joints, needed, efforts, own, largest } = self.known(whole, t, q, v, vdot, lambda, s)?;
        let mut result = Reactions { joints, ..Reactions::default() };
        let transmitted = self.inward(whole, s, needed.clone());
        let mut left = needed;
        let heaviest = self.numbers.bodies.iter().fold(S::zero(), |m, b| m.max(b.mass));
        let mut largest = largest.max(self.full.gravity.norm() * heaviest);
        let (mut axes, mut velocities) = (Vec::with_capacity(6), Vec::with_capacity(6));
        for e in &self.placed.carrying {
            let Some(j) = e.joint else { continue };
            let point = self.joint_point_now(s, j);
            let w = self.passed_on(e, j, &transmitted, s);
            let p = &self.placed.joints[j];
            let (parent, child) = (p.parent, p.child);
            if p.links.is_none() {
                let across = w.across();
                result.joints[j].add(&across);
                self.put(s, &mut left, child, &across.opposite(), point);
                self.put(s, &mut left, parent, &across, point);
                continue;
            }
            self.free_axes(j, s, &mut axes);
            self.velocities_of(j, &mut velocities);
            // along a free direction only a drive or a condition of the joint can be a reaction; an applied effort is
            // not one
            let free = Free::new(&axes);
            let reaction = free.with_along(&w, |i| own[velocities[i]]);
            let acting = free.with_along(&w, |i| own[velocities[i]] + efforts[velocities[i]]);
            result.joints[j] = reaction;
            self.put(s, &mut left, child, &acting.opposite(), point);
            self.put(s, &mut left, parent, &acting, point);
            largest = largest.max(acting.force.norm());
        }
        let basis = constant(&self.placed.basis);
        result.joints.iter_mut().for_each(|w| *w = w.out_of(&basis));
        (result.left, result.largest) = (left, largest);
        self.judge(&mut result);
        Ok(result)
    }

    /// Compare the residual with the largest force.
    fn judge(&self, r: &mut Reactions<S>) {
        let size = |w: &Wrench<S>| w.force.norm().max(w.moment.norm().scale(1.0 / self.placed.size));
        let largest = r.joints.iter().fold(r.largest, |m, w| m.max(size(w)));
        let over = |w: &Wrench<S>| largest.where_positive(size(w) / largest, size(w));
        r.residuals = r.left.iter().map(over).collect();
        r.residual = r.residuals.iter().fold(S::zero(), |m, x| m.max(*x));
    }

    /// The joint whose reaction a condition is part of: its own, or that of the coordinate it drives.
    pub(crate) fn joint_of(&self, owner: Owner) -> Option<usize> {
        match owner {
            Owner::Joint(j) => Some(j),
            Owner::Drive(i) => self.drives.iter().find(|d| d.number == i).and_then(|d| d.joint).map(|(j, _)| j),
            Owner::Coupling(_) | Owner::Rotor(_) => None,
        }
    }

    /// Replace the wrenches (world axes) found at the same state by others, and judge them likewise. The difference
    /// should be a self-stress: `change` is the difference of the multipliers of couplings and of drives of measures,
    /// which are in no joint's wrench.
    pub fn replace_reactions(
        &self,
        r: &mut Reactions<S>,
        joints: &[Wrench<S>],
        (t, q, change): (S, &[S], &[S]),
        s: &Scratch<S>,
    ) -> Result<(), SystemError> {
        let basis: Mat3<S> = constant(&self.placed.basis);
        let mut left = std::mem::take(&mut r.left);
        let mut efforts = vec![S::zero(); self.placed.nv];
        let at = self.instant(t, q, &[]);
        for (k, c) in self.full.conditions.iter().enumerate().filter(|(_, c)| self.joint_of(c.owner).is_none()) {
            let first = self.row_of_condition(k);
            c.apply(
                &self.full,
                &s.full,
                &at,
                &change[first..first + c.rows()],
                |x, pushed| {
                    let w = Wrench { moment: pushed.unit.moment.times(x), force: pushed.unit.force.times(x) };
                    self.put(s, &mut left, pushed.nodes[1], &w.opposite(), pushed.unit.in_world);
                    self.put(s, &mut left, pushed.nodes[0], &w, pushed.unit.in_world);
                },
                |v, x| efforts[v] += x,
            )?;
        }
        let (mut axes, mut velocities) = (Vec::new(), Vec::new());
        for (j, w) in joints.iter().enumerate() {
            let mut more = r.joints[j].opposite();
            more.add(w);
            let more = Wrench { moment: basis.apply(more.moment), force: basis.apply(more.force) };
            let (p, point) = (&self.placed.joints[j], self.joint_point_now(s, j));
            let acting = match p.links {
                // along its degrees of freedom also the efforts of couplings and drives of measures, which are not
                // reactions
                Some(_) => {
                    self.free_axes(j, s, &mut axes);
                    self.velocities_of(j, &mut velocities);
                    let own = |i: usize| axes[i].1.dot(if axes[i].0 { more.moment } else { more.force });
                    Free::new(&axes).with_along(&more, |i| own(i) + efforts[velocities[i]])
                }
                None => more,
            };
            self.put(s, &mut left, p.child, &acting.opposite(), point);
            self.put(s, &mut left, p.parent, &acting, point);
        }
        r.joints.copy_from_slice(joints);
        r.left = left;
        self.judge(r);
        Ok(())
    }

    /// Contribution of v' to the angular acceleration and to the acceleration of the reference point of the links of
    /// `part`.
    fn link_accelerations(&self, part: &Part, vdot: &[S], s: &Scratch<S>) -> Vec<(Vec3<S>, Vec3<S>)> {
        let mut moved = vec![(Vec3::zero(), Vec3::zero()); self.full.links.len()];
        for &i in &part.links {
            let (w, u) = moved[self.full.links[i].parent];
            moved[i] = self.full.propagate(i, &s.full, w, u, |v| vdot[v]);
        }
        moved
    }

    /// Of those, the one of a link of `part`.
    pub(crate) fn link_acceleration(&self, part: &Part, link: usize, vdot: &[S], s: &Scratch<S>) -> (Vec3<S>, Vec3<S>) {
        self.link_accelerations(part, vdot, s)[link]
    }

    /// Joint wrenches (world axes) of the multipliers alone: for self-stresses.
    pub fn wrenches_of(&self, q: &[S], lambda: &[S], s: &mut Scratch<S>) -> Vec<Wrench<S>> {
        let still = vec![S::zero(); self.placed.nv];
        let whole = self.whole();
        self.look_at(&whole, q, &still, s);
        let mut needed = vec![Wrench::default(); self.placed.bodies.len()];
        let mut joints = self.close_with(&whole, lambda, s, &mut needed);
        let transmitted = self.inward(&whole, s, needed);
        for e in &self.placed.carrying {
            if let Some(j) = e.joint {
                let w = self.passed_on(e, j, &transmitted, s);
                match self.placed.joints[j].links {
                    Some(_) => joints[j] = w,
                    None => joints[j].add(&w.across()),
                }
            }
        }
        let basis = constant(&self.placed.basis);
        joints.iter().map(|w| w.out_of(&basis)).collect()
    }
}
