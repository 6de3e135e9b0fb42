//! Closing rows: Φ, C and b of the cut joints.                                            (S3, S4, S5)

use crate::tree::{swung, Closing, LinkMotion, Locked, Tree, TreeScratch};
use partita_math::scalar::Functions;
use partita_math::spatial::Space;

impl<G: Space> Tree<G> {
    /// Poses of all links at q, Φ and the values of C of all closings. Each closing is looked at as soon as the poses are
    /// known that it reads.
    pub fn poses_and_closings(&self, q: &[G::S], s: &mut TreeScratch<G>, phi: &mut [G::S], c: &mut [G::S]) {
        self.in_turns(s, |i, s| self.pose(i, q, s), |k, s| self.close_one(k, s, phi, c));
    }

    /// All links, and each closing as soon as the links are done that it reads: in a mechanism of thousands of loops these
    /// have not left a cache yet. What is recorded stays level by level, where operations wait for each other least.
    fn in_turns(
        &self,
        s: &mut TreeScratch<G>,
        link: impl Fn(usize, &mut TreeScratch<G>),
        mut closing: impl FnMut(&Closing<G>, &TreeScratch<G>),
    ) {
        let (mut next, all) = (1, self.links.len());
        for k in &self.closings {
            let end = if G::S::RECORDS { all } else { k.last_link() + 1 };
            (next..end).for_each(|i| link(i, s));
            next = next.max(end);
            closing(k, s);
        }
        (next..all).for_each(|i| link(i, s));
    }

    /// Φ and the values of C of all closings at the last poses.
    pub fn close(&self, s: &TreeScratch<G>, phi: &mut [G::S], c: &mut [G::S]) {
        for closing in &self.closings {
            self.close_one(closing, s, phi, c);
        }
    }

    fn close_one(&self, k: &Closing<G>, s: &TreeScratch<G>, phi: &mut [G::S], c: &mut [G::S]) {
        let (xa, xb) = (&s.links[k.a.link], &s.links[k.b.link]);
        let (pa, pb) = (self.spot(&k.a, s), self.spot(&k.b, s));
        let gap = pb - pa + k.offset;
        let width = k.slide_columns;
        match &k.slides {
            Locked::World => {
                for i in 0..G::LENGTHS {
                    phi[k.row + i] = G::component(gap, i);
                }
                let rows = &mut c[k.entry..k.entry + G::LENGTHS * width];
                for p in &k.path {
                    let point = if p.on_b { pb } else { pa };
                    self.point_columns(p.link, point, p.on_b, s, |j, column| {
                        for i in 0..G::LENGTHS {
                            rows[p.slide_column + j + i * width] = G::component(column, i);
                        }
                    });
                }
            }
            Locked::Along(axes) => {
                for (i, &axis) in axes.iter().enumerate() {
                    let d = G::rotate(&xa.rot, axis);
                    phi[k.row + i] = G::dot(d, gap);
                    let row = &mut c[k.entry + i * width..k.entry + (i + 1) * width];
                    // the axis rotates with A: on both sides the rate is that of the point of B, relative to its own
                    // branch
                    for p in &k.path {
                        let point = if p.on_b { pb } else { pb + k.offset };
                        self.point_columns(p.link, point, p.on_b, s, |j, column| {
                            row[p.slide_column + j] = G::dot(d, column);
                        });
                    }
                }
            }
        }
        let (row0, entry0) = (k.row + k.slide_rows(), k.entry + k.slide_rows() * width);
        for (i, lock) in k.locks.iter().enumerate() {
            phi[row0 + i] = G::lock_residual(lock, &xa.rot, &xb.rot);
            let axis = G::lock_axis(lock, &xa.rot, &xb.rot);
            let row = &mut c[entry0 + i * k.turn_columns..entry0 + (i + 1) * k.turn_columns];
            for p in &k.path {
                let x = &s.links[p.link];
                let put = |value: G::S| if p.on_b { value } else { -value };
                match self.links[p.link].motion {
                    LinkMotion::Turn(_) => row[p.turn_column] = put(G::dot_ang(axis, x.axis)),
                    LinkMotion::Ball => {
                        for j in 0..3 {
                            row[p.turn_column + j] = put(G::dot_ang(axis, G::body_axis(&x.rot, j)));
                        }
                    }
                    LinkMotion::Slide(_) => {}
                }
            }
        }
    }

    /// Velocity of a world point for unit rates of link i, negative on the side of A.
    #[inline(always)]
    fn point_columns(
        &self,
        i: usize,
        point: G::Vec,
        on_b: bool,
        s: &TreeScratch<G>,
        mut put: impl FnMut(usize, G::Vec),
    ) {
        let x = &s.links[i];
        let arm = point - x.joint;
        let arm = if on_b { arm } else { -arm };
        match self.links[i].motion {
            LinkMotion::Turn(_) => put(0, G::cross(x.axis, arm)),
            LinkMotion::Slide(_) => put(0, if on_b { x.direction } else { -x.direction }),
            LinkMotion::Ball => {
                for j in 0..3 {
                    put(j, G::cross(G::body_axis(&x.rot, j), arm));
                }
            }
        }
    }

    /// Twists and bias accelerations of all links at v and b of all closings, in turns as in
    /// [`poses_and_closings`](Self::poses_and_closings).
    pub fn twists_and_bias(&self, v: &[G::S], s: &mut TreeScratch<G>, b: &mut [G::S]) {
        self.in_turns(s, |i, s| self.twist(i, v, s), |k, s| self.bias_one(k, s, b));
    }

    /// b of all closings at the last twists.
    pub fn bias(&self, s: &TreeScratch<G>, b: &mut [G::S]) {
        for closing in &self.closings {
            self.bias_one(closing, s, b);
        }
    }

    fn bias_one(&self, k: &Closing<G>, s: &TreeScratch<G>, b: &mut [G::S]) {
        let (xa, xb) = (&s.links[k.a.link], &s.links[k.b.link]);
        let (ra, rb) = (self.arm(&k.a, s), self.arm(&k.b, s));
        let (ua, ub) = (G::cross(xa.w, ra), G::cross(xb.w, rb));
        let acc_a = swung::<G>(xa.acc, xa.alpha, ra) + G::cross(xa.w, ua);
        let acc_b = swung::<G>(xb.acc, xb.alpha, rb) + G::cross(xb.w, ub);
        let acc = acc_b - acc_a;
        match &k.slides {
            Locked::World => {
                for i in 0..G::LENGTHS {
                    b[k.row + i] = G::component(acc, i);
                }
            }
            Locked::Along(axes) => {
                let gap = xb.centre + rb - xa.centre - ra + k.offset;
                let rate = xb.u + ub - xa.u - ua;
                for (i, &axis) in axes.iter().enumerate() {
                    let d = G::rotate(&xa.rot, axis);
                    let d1 = G::cross(xa.w, d);
                    let d2 = G::cross(xa.alpha, d) + G::cross(xa.w, d1);
                    let twice = G::dot(d1, rate);
                    b[k.row + i] = G::dot(d2, gap) + twice + twice + G::dot(d, acc);
                }
            }
        }
        let row0 = k.row + k.slide_rows();
        for (i, lock) in k.locks.iter().enumerate() {
            let axis = G::lock_axis(lock, &xa.rot, &xb.rot);
            b[row0 + i] = G::dot_ang(axis, xb.alpha - xa.alpha) + G::lock_bias(lock, &xa.rot, &xb.rot, xa.w, xb.w);
        }
    }

    /// Forces of the closings on their links for given multipliers: `(link, moment about its reference, force)`.
    pub fn closing_wrenches(&self, s: &TreeScratch<G>, lambda: &[G::S], mut put: impl FnMut(usize, G::Ang, G::Vec)) {
        for k in &self.closings {
            let (moment, force) = self.closing_wrench(k, s, lambda);
            let (rb, xa) = (self.arm(&k.b, s), &s.links[k.a.link]);
            let xb = &s.links[k.b.link];
            put(k.b.link, moment + G::moment(rb, force), force);
            // action equals reaction at the same point of space
            let back = xb.centre + rb - xa.centre + k.offset;
            put(k.a.link, -(moment + G::moment(back, force)), -force);
        }
    }

    /// Wrench of one closing on its child: moment about the joint's point on the child, and force.  (R3)
    pub fn closing_wrench(&self, k: &Closing<G>, s: &TreeScratch<G>, lambda: &[G::S]) -> (G::Ang, G::Vec) {
        let (xa, xb) = (&s.links[k.a.link], &s.links[k.b.link]);
        let mut force = G::Vec::default();
        let mut moment = G::Ang::default();
        match &k.slides {
            Locked::World => {
                force = G::vec_of((0..G::LENGTHS).map(|i| lambda[k.row + i]));
            }
            Locked::Along(axes) => {
                for (i, &axis) in axes.iter().enumerate() {
                    force += G::scale(G::rotate(&xa.rot, axis), lambda[k.row + i]);
                }
            }
        }
        let row0 = k.row + k.slide_rows();
        for (i, lock) in k.locks.iter().enumerate() {
            moment += G::scale_ang(G::lock_axis(lock, &xa.rot, &xb.rot), lambda[row0 + i]);
        }
        (moment, force)
    }
}
