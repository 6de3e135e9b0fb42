//! Forces and inertia: the tangential projection by partial velocities, inverse dynamics, the mass matrix.

use crate::tree::{Tree, TreeScratch};
use partita_math::scalar::Scalar;
use partita_math::spatial::Space;

impl<G: Space> Tree<G> {
    /// Forget the applied forces.
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

    /// Add the forces of all springs at the last twists.
    pub fn spring_forces(&self, s: &mut TreeScratch<G>) {
        for k in &self.springs {
            let (ra, rb) = (self.arm(&k.a, s), self.arm(&k.b, s));
            let (xa, xb) = (&s.links[k.a.link], &s.links[k.b.link]);
            let gap = xb.centre + rb - xa.centre - ra + k.offset;
            let rate = xb.u + G::cross(xb.w, rb) - xa.u - G::cross(xa.w, ra);
            let length = (G::dot(gap, gap) + G::S::from_f64(k.out_of_plane2)).sqrt();
            if length.value() == 0.0 {
                continue; // a spring of no length has no direction to pull in
            }
            let speed = G::dot(gap, rate) / length;
            let tension = (length - G::S::from_f64(k.length)).scale(k.stiffness) + speed.scale(k.damping);
            let pull = G::scale(gap, tension / length);
            self.add_force(s, k.a.link, ra, pull);
            self.add_force(s, k.b.link, rb, -pull);
        }
    }

    /// Potential energy of springs and power of their dampers: `(V, P)`.
    pub fn spring_energy(&self, s: &TreeScratch<G>) -> (f64, f64) {
        let (mut potential, mut power) = (0.0, 0.0);
        for k in &self.springs {
            let (ra, rb) = (self.arm(&k.a, s), self.arm(&k.b, s));
            let (xa, xb) = (&s.links[k.a.link], &s.links[k.b.link]);
            let gap = xb.centre + rb - xa.centre - ra + k.offset;
            let rate = xb.u + G::cross(xb.w, rb) - xa.u - G::cross(xa.w, ra);
            let length = (G::dot(gap, gap).value() + k.out_of_plane2).sqrt();
            potential += 0.5 * k.stiffness * (length - k.length).powi(2);
            if length > 0.0 {
                power -= k.damping * (G::dot(gap, rate).value() / length).powi(2);
            }
        }
        (potential, power)
    }

    /// Kinetic energy and potential of gravity at the last twists.
    pub fn energy(&self, s: &TreeScratch<G>) -> (f64, f64) {
        let (mut kinetic, mut potential) = (0.0, 0.0);
        for ((i, link), x) in self.links.iter().enumerate().zip(&s.links).skip(1) {
            let turning = G::dot_ang(x.w, G::spin(&x.inertia, x.w)).value();
            kinetic += 0.5 * (link.mass * G::dot(x.u, x.u).value() + turning);
            potential -= link.mass * G::dot(self.gravity, self.place(i, s)).value();
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
        tangent: &[f64],
        delta: &[f64],
        s: &mut TreeScratch<G>,
        md: &mut [f64],
        hd: &mut [f64],
    ) {
        let columns = k + 1;
        let mut partial = std::mem::take(&mut s.partial);
        let wanted = self.links.len() * columns;
        if partial.len() < wanted {
            partial.resize(wanted, Default::default()); // at set-up; later the room is there
        }
        partial[..columns].fill(Default::default()); // the ground rests
        md.fill(0.0);
        hd.fill(0.0);
        for i in 1..self.links.len() {
            let link = &self.links[i];
            let (before, rest) = partial.split_at_mut(i * columns);
            let parent = &before[link.parent * columns..(link.parent + 1) * columns];
            let mine = &mut rest[..columns];
            for j in 0..k {
                let (w, u) = parent[j];
                mine[j] = self.carry(i, s, w, u, |v| G::S::from_f64(tangent[v * k + j]));
            }
            let (w, u) = parent[k];
            mine[k] = self.carry(i, s, w, u, |v| G::S::from_f64(delta[v]));
            let x = &s.links[i];
            if link.mass == 0.0 && !self.has_rotary_inertia(i) && !self.is_loaded(x) {
                continue;
            }
            let mass = G::S::from_f64(link.mass);
            // left over for the motion: F + m (g − a), T − I α − w × I w
            let (alpha, acc) = (x.alpha + mine[k].0, x.acc + mine[k].1);
            let force = x.force + G::scale(self.gravity - acc, mass);
            let spin = G::spin(&x.inertia, x.w);
            let moment = x.moment - G::spin(&x.inertia, alpha) - G::cross_ang(x.w, spin);
            for j in 0..k {
                let (w, u) = mine[j];
                hd[j] += (G::dot(u, force) + G::dot_ang(w, moment)).value();
                let (p, l) = (G::scale(u, mass), G::spin(&x.inertia, w));
                for (i2, (w2, u2)) in mine[..=j].iter().enumerate() {
                    md[j * k + i2] += (G::dot(*u2, p) + G::dot_ang(*w2, l)).value();
                }
            }
        }
        for j in 0..k {
            for i in 0..j {
                md[i * k + j] = md[j * k + i];
            }
        }
        for (v, e) in s.effort.iter().enumerate() {
            let e = e.value();
            if e != 0.0 {
                for j in 0..k {
                    hd[j] += tangent[v * k + j] * e;
                }
            }
        }
        s.partial = partial;
    }

    fn has_rotary_inertia(&self, i: usize) -> bool {
        let mut m = [0.0; 36];
        G::inertia_matrix(&self.links[i].inertia, 0.0, &mut m[..G::DIM * G::DIM]);
        m.iter().any(|x| *x != 0.0)
    }

    fn is_loaded(&self, x: &crate::tree::LinkState<G>) -> bool {
        G::dot(x.force, x.force).value() != 0.0 || G::dot_ang(x.moment, x.moment).value() != 0.0
    }

    /// `M v' − h` at the last twists and forces, inward over the tree.                    Cost: links.
    pub fn inverse_dynamics(&self, vdot: &[f64], s: &mut TreeScratch<G>, out: &mut [f64]) {
        let n = self.links.len();
        let mut wrench = std::mem::take(&mut s.partial);
        if wrench.len() < 2 * n {
            wrench.resize(2 * n, Default::default());
        }
        {
            // first half: accelerations; second half: wrenches the joint of each link must supply
            let (acceleration, wrench) = wrench.split_at_mut(n);
            acceleration[0] = Default::default();
            wrench[0] = Default::default();
            for i in 1..n {
                let (w, u) = acceleration[self.links[i].parent];
                acceleration[i] = self.carry(i, s, w, u, |v| G::S::from_f64(vdot[v]));
                let (link, x) = (&self.links[i], &s.links[i]);
                let (alpha, acc) = (x.alpha + acceleration[i].0, x.acc + acceleration[i].1);
                let spin = G::spin(&x.inertia, x.w);
                let force = G::scale(acc - self.gravity, G::S::from_f64(link.mass)) - x.force;
                let moment = G::spin(&x.inertia, alpha) + G::cross_ang(x.w, spin) - x.moment;
                wrench[i] = (moment, force);
            }
            for i in (1..n).rev() {
                let (moment, force) = wrench[i];
                let effort = &s.effort;
                self.along(i, s, moment, force, |v, x| out[v] = (x - effort[v]).value());
                let p = self.links[i].parent;
                let at_parent = self.to_parent(i, s, moment, force);
                wrench[p].0 += at_parent;
                wrench[p].1 += force;
            }
        }
        s.partial = wrench;
    }

    /// Dense M at the last poses and inertias, column by column: only what a coordinate carries moves.
    pub fn mass_matrix(&self, s: &mut TreeScratch<G>, mass: &mut [f64]) {
        let (n, nv) = (self.links.len(), self.nv);
        mass.fill(0.0);
        let mut room = std::mem::take(&mut s.partial);
        if room.len() < 2 * n {
            room.resize(2 * n, Default::default());
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
                let (twist, wrench) = room.split_at_mut(n);
                wrench[..n].fill(Default::default());
                for i in root..n {
                    if moves[i] {
                        let (w, u) = if i == root { Default::default() } else { twist[self.links[i].parent] };
                        let (w, u) = self.carry(i, s, w, u, |v| if v == c { G::S::one() } else { G::S::zero() });
                        twist[i] = (w, u);
                        let x = &s.links[i];
                        wrench[i] = (G::spin(&x.inertia, w), G::scale(u, G::S::from_f64(self.links[i].mass)));
                    }
                }
                for i in (1..n).rev() {
                    let (moment, force) = wrench[i];
                    self.along(i, s, moment, force, |v, x| mass[v * nv + c] = x.value());
                    let p = self.links[i].parent;
                    let at_parent = self.to_parent(i, s, moment, force);
                    wrench[p].0 += at_parent;
                    wrench[p].1 += force;
                }
            }
        }
        s.partial = room;
        s.moves = moves;
    }
}
