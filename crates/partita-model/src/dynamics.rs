//! Forces and inertia: tangential projection by partial velocities, inverse dynamics, mass matrix.

use crate::tree::{Tree, TreeScratch};
use partita_math::scalar::Scalar;
use partita_math::spatial::Space;

impl<G: Space> Tree<G> {
    /// Clear the applied forces.
    pub fn clear_forces(&self, s: &mut TreeScratch<G>) {
        for x in &mut s.links {
            x.moment = G::Ang::default();
            x.force = G::Vec::default();
        }
        s.effort.fill(G::S::zero());
    }

    /// Add a force at an arm (world axes, from the reference point) of a link.
    #[inline(always)]
    pub fn add_force(&self, s: &mut TreeScratch<G>, link: usize, arm: G::Vec, force: G::Vec) {
        let x = &mut s.links[link];
        x.force += force;
        x.moment += G::moment(arm, force);
    }

    /// Kinetic energy and potential of gravity at v, the last twists.
    pub fn energy(&self, v: &[G::S], s: &TreeScratch<G>) -> (G::S, G::S) {
        let (mut kinetic, mut potential) = (G::S::zero(), G::S::zero());
        for (i, rotor) in self.rotating() {
            kinetic += (rotor * v[i] * v[i]).scale(0.5);
        }
        for ((i, link), x) in self.links.iter().enumerate().zip(&s.links).skip(1) {
            let turning = G::dot_ang(x.w, G::spin(&x.inertia, x.w));
            kinetic += (link.mass * G::dot(x.u, x.u) + turning).scale(0.5);
            potential -= link.mass * G::dot(self.gravity, self.reference_point(i, s));
        }
        (kinetic, potential)
    }

    /// `M_d = D M Dᵀ` and `h_d = D (h − M [0; ξ])` by propagating the k partial velocities and the bias through the
    /// tree; M is never formed.                                                            (P3)
    ///
    /// `tangent` is Dᵀ (nv x k) row by row, `delta` is `[0; ξ]`. Needs twists, inertias and applied forces.
    /// Cost: links times k².
    pub fn project(
        &self,
        k: usize,
        tangent: &[G::S],
        delta: &[G::S],
        s: &mut TreeScratch<G>,
        md: &mut [G::S],
        hd: &mut [G::S],
    ) {
        match k {
            1 => self.project_one(tangent, delta, s, md, hd),
            k => self.project_columns(k, tangent, delta, s, md, hd),
        }
    }

    /// [`project`](Self::project) for one degree of freedom.
    #[inline(never)]
    fn project_one(&self, tangent: &[G::S], delta: &[G::S], s: &mut TreeScratch<G>, md: &mut [G::S], hd: &mut [G::S]) {
        let (mut mass, mut force) = ([G::S::zero()], [G::S::zero()]); // sums in registers
        self.project_columns(1, tangent, delta, s, &mut mass, &mut force);
        (md[0], hd[0]) = (mass[0], force[0]);
    }

    /// As [`project`](Self::project); compiled for one column and for any number of them.
    #[inline(always)]
    fn project_columns(
        &self,
        k: usize,
        tangent: &[G::S],
        delta: &[G::S],
        s: &mut TreeScratch<G>,
        md: &mut [G::S],
        hd: &mut [G::S],
    ) {
        let columns = k + 1;
        let mut partial = std::mem::take(&mut s.partial);
        let wanted = self.links.len() * columns;
        if partial.len() < wanted {
            partial.resize(wanted, Default::default()); // at set-up; later the room is there
        }
        partial[..columns].fill(Default::default()); // the ground rests
        let (md, hd) = (&mut md[..k * k], &mut hd[..k]);
        md.fill(G::S::zero());
        hd.fill(G::S::zero());
        let idle = &self.idle[..self.links.len()];
        for i in 1..self.links.len() {
            let link = &self.links[i];
            let (before, rest) = partial.split_at_mut(i * columns);
            let parent = &before[link.parent * columns..(link.parent + 1) * columns];
            let mine = &mut rest[..columns];
            self.propagate_columns(i, s, parent, mine, |j, v| if j < k { tangent[v * k + j] } else { delta[v] });
            if idle[i] {
                continue;
            }
            let (x, mass) = (&s.links[i], link.mass);
            // the load that remains for the motion: F + m (g − a), T − I α − w × I w
            let (alpha, acc) = (x.alpha + mine[k].0, x.acc + mine[k].1);
            let force = x.force + G::scale(self.gravity - acc, mass);
            let spin = G::spin(&x.inertia, x.w);
            let moment = x.moment - G::spin(&x.inertia, alpha) - G::cross_ang(x.w, spin);
            for j in 0..k {
                let (w, u) = mine[j];
                hd[j] += G::dot(u, force) + G::dot_ang(w, moment);
                let (p, l) = (G::scale(u, mass), G::spin(&x.inertia, w));
                for (i2, (w2, u2)) in mine[..=j].iter().enumerate() {
                    md[j * k + i2] += G::dot(*u2, p) + G::dot_ang(*w2, l);
                }
            }
        }
        for j in 0..k {
            for i in 0..j {
                md[i * k + j] = md[j * k + i];
            }
        }
        for &v in &self.efforts {
            for j in 0..k {
                hd[j] += tangent[v * k + j] * s.effort[v];
            }
        }
        for (v, rotor) in self.rotating() {
            for j in 0..k {
                let push = rotor * tangent[v * k + j];
                hd[j] -= push * delta[v];
                for i in 0..k {
                    md[j * k + i] += push * tangent[v * k + i];
                }
            }
        }
        s.partial = partial;
    }

    /// `M v' − h` at the last twists and forces, inward over the tree.                    Cost: links.
    pub fn inverse_dynamics(&self, vdot: &[G::S], s: &mut TreeScratch<G>, out: &mut [G::S]) {
        self.newton_euler(|v| vdot[v], s, out);
    }

    /// h at the last twists and forces: inverse dynamics without acceleration.
    pub fn forces(&self, s: &mut TreeScratch<G>, h: &mut [G::S]) {
        self.newton_euler(|_| G::S::zero(), s, h);
        h.iter_mut().for_each(|x| *x = -*x);
    }

    #[inline(always)]
    fn newton_euler(&self, vdot: impl Fn(usize) -> G::S, s: &mut TreeScratch<G>, out: &mut [G::S]) {
        let n = self.links.len();
        let mut wrench = std::mem::take(&mut s.partial);
        if wrench.len() < 2 * n {
            wrench.resize(2 * n, Default::default());
        }
        {
            // first half: accelerations; second half: wrenches that the joint of each link must supply
            let (acceleration, wrench) = wrench.split_at_mut(n);
            acceleration[0] = Default::default();
            wrench[0] = Default::default();
            for i in 1..n {
                let (w, u) = acceleration[self.links[i].parent];
                acceleration[i] = self.propagate(i, s, w, u, &vdot);
                let (link, x) = (&self.links[i], &s.links[i]);
                let (alpha, acc) = (x.alpha + acceleration[i].0, x.acc + acceleration[i].1);
                let spin = G::spin(&x.inertia, x.w);
                let force = G::scale(acc - self.gravity, link.mass) - x.force;
                let moment = G::spin(&x.inertia, alpha) + G::cross_ang(x.w, spin) - x.moment;
                wrench[i] = (moment, force);
            }
            for i in (1..n).rev() {
                let (moment, force) = wrench[i];
                let effort = &s.effort;
                self.along(i, s, moment, force, |v, x| out[v] = x - effort[v]);
                let p = self.links[i].parent;
                let at_parent = self.to_parent(i, s, moment, force);
                wrench[p].0 += at_parent;
                wrench[p].1 += force;
            }
        }
        for (v, rotor) in self.rotating() {
            out[v] += rotor * vdot(v);
        }
        s.partial = wrench;
    }

    /// Add to a dense M the inertia that massless links need in a metric, at the last poses.
    pub fn add_massless(&self, s: &TreeScratch<G>, mass: &mut [G::S]) {
        for x in &self.massless {
            let inertia = G::world_inertia(&s.links[x.link].rot, &x.inertia);
            // the links that carry it, from the ground outwards, and its twist for each of their velocities
            let mut path = vec![x.link];
            while let Some(&first) = path.last().filter(|&&i| self.links[i].parent != 0) {
                path.push(self.links[first].parent);
            }
            path.reverse();
            let mut twists: Vec<(usize, G::Ang, G::Vec)> = Vec::new();
            for &i in &path {
                for (_, w, u) in &mut twists {
                    (*w, *u) = self.propagate(i, s, *w, *u, |_| G::S::zero());
                }
                let own = if matches!(self.links[i].motion, crate::tree::LinkMotion::Ball) { 3 } else { 1 };
                for c in self.links[i].v..self.links[i].v + own {
                    let one = |v: usize| if v == c { G::S::one() } else { G::S::zero() };
                    let (w, u) = self.propagate(i, s, G::Ang::default(), G::Vec::default(), one);
                    twists.push((c, w, u));
                }
            }
            for &(a, w, u) in &twists {
                let (p, l) = (G::scale(u, x.mass), G::spin(&inertia, w));
                for &(b, w2, u2) in &twists {
                    mass[b * self.nv + a] += G::dot(u2, p) + G::dot_ang(w2, l);
                }
            }
        }
    }

    /// Dense M at the last poses and inertias, column by column: a coordinate moves only its descendants.
    pub fn mass_matrix(&self, s: &mut TreeScratch<G>, mass: &mut [G::S]) {
        let (n, nv) = (self.links.len(), self.nv);
        mass.fill(G::S::zero());
        let mut memory = std::mem::take(&mut s.partial);
        if memory.len() < 2 * n {
            memory.resize(2 * n, Default::default());
        }
        let mut moves = std::mem::take(&mut s.moves);
        for root in 1..n {
            let own = match self.links[root].motion {
                crate::tree::LinkMotion::Ball => 3,
                _ => 1,
            };
            moves.fill(false);
            moves[root] = true;
            for i in root + 1..n {
                moves[i] = moves[self.links[i].parent];
            }
            for c in self.links[root].v..self.links[root].v + own {
                let (twist, wrench) = memory.split_at_mut(n);
                wrench[..n].fill(Default::default());
                for i in root..n {
                    if moves[i] {
                        let (w, u) = if i == root { Default::default() } else { twist[self.links[i].parent] };
                        let (w, u) = self.propagate(i, s, w, u, |v| if v == c { G::S::one() } else { G::S::zero() });
                        twist[i] = (w, u);
                        let x = &s.links[i];
                        wrench[i] = (G::spin(&x.inertia, w), G::scale(u, self.links[i].mass));
                    }
                }
                for i in (1..n).rev() {
                    let (moment, force) = wrench[i];
                    self.along(i, s, moment, force, |v, x| mass[v * nv + c] = x);
                    let p = self.links[i].parent;
                    let at_parent = self.to_parent(i, s, moment, force);
                    wrench[p].0 += at_parent;
                    wrench[p].1 += force;
                }
            }
        }
        for (v, rotor) in self.rotating() {
            mass[v * nv + v] += rotor;
        }
        s.partial = memory;
        s.moves = moves;
    }
}
