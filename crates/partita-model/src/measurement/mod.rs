//! Measurements of a mechanism: coordinates of joints, distances, displacements along an axis, direction cosines.
//!
//! ```text
//! Reading ──► value x                       at the last poses
//!         ──► unit wrench, x' = wrench · relative twist
//!         ──► bias, x'' for v' = 0          at the last twists
//! ```
//!
//! A measurement is defined alike for a joint of the tree, whose coordinate it is, for a joint that closes a loop and
//! for two bodies without a common joint. Couplings, drives and forces in joints are made of measurements, so that none
//! of them depends on the position of a joint in the tree.

mod build;

pub use build::{drivable, is_angle, known, Maker};

use crate::tree::{Anchor, LinkMotion, Tree, TreeScratch};
use partita_math::spatial::Space;

/// A link whose velocities change a reading.
#[derive(Clone, Copy, Debug)]
pub struct Mover {
    /// The link.
    pub link: usize,
    /// Whether it is on the side of B (the child).
    pub on_b: bool,
    /// Index of its first velocity in the row.
    pub column: usize,
}

/// Two points and the vector between the origins of their branches.
#[derive(Clone, Copy, Debug)]
pub struct Ends<G: Space> {
    /// On A.
    pub a: Anchor<G>,
    /// On B.
    pub b: Anchor<G>,
    /// From the origin of A's branch to that of B's.
    pub offset: G::Vec,
    /// Origin of B's branch, or the point itself where B is the ground.
    pub origin_b: G::Vec,
}

/// Kind of a measurement.
#[derive(Clone, Copy, Debug)]
pub enum Quantity<G: Space> {
    /// A coordinate of the tree.
    Coordinate {
        /// Coordinate.
        q: usize,
        /// Velocity.
        v: usize,
    },
    /// A velocity of the tree that is not the rate of a coordinate; its value is 0.
    Velocity(usize),
    /// Displacement of B from A along an axis fixed on A.
    Along(Ends<G>, G::Vec),
    /// Distance of two points; the constant part of it out of the plane, squared.
    Distance(Ends<G>, G::S),
    /// A rotation of B relative to A, about an axis fixed on one of them.
    Turn(Turn<G>),
    /// Half of `y_A · x_B − x_A · y_B`: the sine by which B is twisted about the axis of A.
    Twist {
        /// Axes x and y on A.
        on_a: [G::Ang; 2],
        /// As `on_a`, on B.
        on_b: [G::Ang; 2],
    },
    /// `u · w`, u on A and w on B.
    Cosine(G::Ang, G::Ang),
    /// The rate of rotation about an axis of B; it has no position, and its value is 0.
    Spin(G::Ang),
}

/// A rotation of B relative to A.
#[derive(Clone, Copy, Debug)]
pub struct Turn<G: Space> {
    /// Its rate is `(on_a + on_b) · (w_B − w_A)`: parts fixed on A and on B.
    pub rate: [G::Ang; 2],
    /// Axis it is measured about: fixed on A, or on B.
    pub axis: G::Ang,
    /// Whether the axis is fixed on B.
    pub about_b: bool,
    /// The direction whose rotation is measured, as A and as B carry it.
    pub probe: [G::Ang; 2],
}

/// A measurement of a mechanism.
#[derive(Clone, Debug)]
pub struct Measurement<G: Space> {
    /// What.
    pub quantity: Quantity<G>,
    /// Links of A and B; 0 for a coordinate of the tree.
    pub links: [usize; 2],
    /// Nodes of A and B; 0 for coordinates of the tree.
    pub nodes: [usize; 2],
    /// Links between A and B.
    pub movers: Vec<Mover>,
    /// Whether it is known up to whole turns only.
    pub wraps: bool,
    /// Rotations of the tree with their signs, whose sum is an angle in the plane, whole turns included and in either
    /// space.
    pub adds_up: Vec<(usize, f64)>,
}

/// A wrench on B, its opposite on A at the same point of space.
#[derive(Clone, Copy, Debug)]
pub struct Unit<G: Space> {
    /// Moment about the point.
    pub moment: G::Ang,
    /// Force.
    pub force: G::Vec,
    /// The point, from the origin of B's branch and from that of A's.
    pub point: [G::Vec; 2],
    /// The point in the world of the tree.
    pub in_world: G::Vec,
}

/// Value, rate and gradient of a measurement.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Read<G: Space> {
    pub value: G::S,
    pub rate: G::S,
    /// See [`Measurement::unit`].
    pub unit: Option<Unit<G>>,
}

impl<G: Space> Ends<G> {
    /// Both points, each from the origin of its own branch, and the gap from A to B.
    #[inline(always)]
    pub(crate) fn now(&self, tree: &Tree<G>, s: &TreeScratch<G>) -> (G::Vec, G::Vec, G::Vec) {
        let pa = s.links[self.a.link].centre + tree.arm(&self.a, s);
        let pb = s.links[self.b.link].centre + tree.arm(&self.b, s);
        (pa, pb, pb - pa + self.offset)
    }

    /// Velocity and bias acceleration of the gap.
    #[inline(always)]
    fn rates(&self, tree: &Tree<G>, s: &TreeScratch<G>) -> (G::Vec, G::Vec) {
        let ((ua, aa), (ub, ab)) = (point_rates(tree, &self.a, s), point_rates(tree, &self.b, s));
        (ub - ua, ab - aa)
    }
}

/// Velocity and bias acceleration of a point.
#[inline(always)]
fn point_rates<G: Space>(tree: &Tree<G>, at: &Anchor<G>, s: &TreeScratch<G>) -> (G::Vec, G::Vec) {
    let (x, arm) = (&s.links[at.link], tree.arm(at, s));
    let turning = G::cross(x.w, arm);
    (x.u + turning, x.acc + G::cross(x.alpha, arm) + G::cross(x.w, turning))
}

impl<G: Space> Turn<G> {
    #[inline(always)]
    fn parts(&self, a: &G::Rot, b: &G::Rot) -> [G::Ang; 2] {
        [G::rotate_ang(a, self.rate[0]), G::rotate_ang(b, self.rate[1])]
    }
}

/// Axes x, y of A and x, y of B of a twist, and the direction of its rate.
#[inline(always)]
fn twist_axes<G: Space>(on_a: &[G::Ang; 2], on_b: &[G::Ang; 2], a: &G::Rot, b: &G::Rot) -> ([G::Ang; 4], G::Ang) {
    let [xa, ya, xb, yb] =
        [G::rotate_ang(a, on_a[0]), G::rotate_ang(a, on_a[1]), G::rotate_ang(b, on_b[0]), G::rotate_ang(b, on_b[1])];
    let axis = half::<G>(G::cross_ang(xb, ya) - G::cross_ang(yb, xa));
    ([xa, ya, xb, yb], axis)
}

#[inline(always)]
fn half<G: Space>(x: G::Ang) -> G::Ang {
    G::scale_ang(x, partita_math::scalar::Scalar::from_f64(0.5))
}

impl<G: Space> Measurement<G> {
    /// Its value at q and the last poses.
    #[inline(always)]
    pub fn value(&self, tree: &Tree<G>, s: &TreeScratch<G>, q: &[G::S]) -> G::S {
        match &self.quantity {
            Quantity::Coordinate { q: i, .. } => q[*i],
            _ => self.value_between(tree, s, q),
        }
    }

    /// For a measurement between two bodies.
    #[inline(never)]
    fn value_between(&self, tree: &Tree<G>, s: &TreeScratch<G>, q: &[G::S]) -> G::S {
        let (a, b) = (&s.links[self.links[0]].rot, &s.links[self.links[1]].rot);
        match &self.quantity {
            Quantity::Coordinate { q: i, .. } => q[*i],
            Quantity::Along(ends, axis) => G::dot(G::rotate(a, *axis), ends.now(tree, s).2),
            Quantity::Distance(ends, out) => length::<G>(ends.now(tree, s).2, *out),
            Quantity::Turn(_) if !self.adds_up.is_empty() => self
                .adds_up
                .iter()
                .fold(G::S::default(), |x, (i, sign)| x + partita_math::scalar::Scalar::scale(q[*i], *sign)),
            Quantity::Turn(turn) => {
                let axis = G::rotate_ang(if turn.about_b { b } else { a }, turn.axis);
                G::turned(axis, turn.probe, a, b)
            }
            Quantity::Twist { on_a, on_b } => {
                let ([xa, ya, xb, yb], _) = twist_axes::<G>(on_a, on_b, a, b);
                half_of::<G>(G::dot_ang(ya, xb) - G::dot_ang(xa, yb))
            }
            Quantity::Cosine(u, w) => G::dot_ang(G::rotate_ang(a, *u), G::rotate_ang(b, *w)),
            Quantity::Velocity(_) | Quantity::Spin(_) => G::S::default(),
        }
    }

    /// The wrench on B whose power, with its opposite on A, is the rate of the measurement; none for coordinates of the
    /// tree.
    #[inline(always)]
    pub fn unit(&self, tree: &Tree<G>, s: &TreeScratch<G>) -> Option<Unit<G>> {
        match &self.quantity {
            Quantity::Coordinate { .. } | Quantity::Velocity(_) => None,
            _ => self.unit_between(tree, s),
        }
    }

    /// For a measurement between two bodies.
    #[inline(never)]
    fn unit_between(&self, tree: &Tree<G>, s: &TreeScratch<G>) -> Option<Unit<G>> {
        let (a, b) = (&s.links[self.links[0]].rot, &s.links[self.links[1]].rot);
        let push = |ends: &Ends<G>, direction: G::Vec| {
            let (_, pb, _) = ends.now(tree, s);
            Unit {
                moment: G::Ang::default(),
                force: direction,
                point: [pb, pb + ends.offset],
                in_world: ends.origin_b + pb,
            }
        };
        let turn = |moment: G::Ang| {
            let point = [s.links[self.links[1]].centre, s.links[self.links[0]].centre];
            Unit { moment, force: G::Vec::default(), point, in_world: tree.reference_point(self.links[1], s) }
        };
        match &self.quantity {
            Quantity::Coordinate { .. } | Quantity::Velocity(_) => None,
            Quantity::Along(ends, axis) => Some(push(ends, G::rotate(a, *axis))),
            Quantity::Distance(ends, out) => {
                let gap = ends.now(tree, s).2;
                Some(push(ends, over::<G>(gap, length::<G>(gap, *out))))
            }
            Quantity::Turn(t) => {
                let [x, y] = t.parts(a, b);
                Some(turn(x + y))
            }
            Quantity::Twist { on_a, on_b } => Some(turn(twist_axes::<G>(on_a, on_b, a, b).1)),
            Quantity::Cosine(u, w) => Some(turn(G::cross_ang(G::rotate_ang(b, *w), G::rotate_ang(a, *u)))),
            Quantity::Spin(axis) => Some(turn(G::rotate_ang(b, *axis))),
        }
    }

    /// Its rate at v and the last twists.
    #[inline(always)]
    pub fn rate(&self, tree: &Tree<G>, s: &TreeScratch<G>, v: &[G::S]) -> G::S {
        match (self.velocity(), self.unit(tree, s)) {
            (Some(i), _) => v[i],
            (None, Some(unit)) => self.rate_along(&unit, s),
            (None, None) => G::S::default(),
        }
    }

    #[inline(always)]
    fn rate_along(&self, unit: &Unit<G>, s: &TreeScratch<G>) -> G::S {
        let (xa, xb) = (&s.links[self.links[0]], &s.links[self.links[1]]);
        let at = |x: &crate::tree::LinkState<G>, p: G::Vec| x.u + G::cross(x.w, p - x.centre);
        G::dot_ang(unit.moment, xb.w - xa.w) + G::dot(unit.force, at(xb, unit.point[0]) - at(xa, unit.point[1]))
    }

    /// Value, rate and gradient at (q, v) and the last poses and twists.
    #[inline(always)]
    pub(crate) fn read(&self, tree: &Tree<G>, s: &TreeScratch<G>, q: &[G::S], v: &[G::S]) -> Read<G> {
        match &self.quantity {
            Quantity::Coordinate { q: i, v: k } => Read { value: q[*i], rate: v[*k], unit: None },
            Quantity::Velocity(k) => Read { value: G::S::default(), rate: v[*k], unit: None },
            _ => self.read_between(tree, s, q),
        }
    }

    /// For a measurement between two bodies.
    #[inline(never)]
    fn read_between(&self, tree: &Tree<G>, s: &TreeScratch<G>, q: &[G::S]) -> Read<G> {
        let unit = self.unit(tree, s);
        let rate = unit.as_ref().map_or(G::S::default(), |unit| self.rate_along(unit, s));
        Read { value: self.value(tree, s, q), rate, unit }
    }

    /// Whether it is an angle.
    pub fn is_angle(&self, tree: &Tree<G>) -> bool {
        match self.quantity {
            Quantity::Coordinate { .. } | Quantity::Velocity(_) => {
                !matches!(tree.links[self.movers[0].link].motion, LinkMotion::Slide(_))
            }
            Quantity::Turn(_) | Quantity::Twist { .. } | Quantity::Spin(_) => true,
            Quantity::Along(..) | Quantity::Distance(..) | Quantity::Cosine(..) => false,
        }
    }

    /// The coordinate of the tree that it is.
    pub fn coordinate(&self) -> Option<usize> {
        match self.quantity {
            Quantity::Coordinate { q, .. } => Some(q),
            _ => None,
        }
    }

    /// The velocity of the tree that equals its rate, if one does.
    #[inline(always)]
    pub fn velocity(&self) -> Option<usize> {
        match self.quantity {
            Quantity::Coordinate { v, .. } | Quantity::Velocity(v) => Some(v),
            _ => None,
        }
    }

    /// Coordinates of the tree whose whole turns it counts.
    pub fn counted(&self) -> impl Iterator<Item = usize> + '_ {
        self.coordinate().into_iter().chain(self.adds_up.iter().map(|(q, _)| *q))
    }

    /// Its second derivative for v' = 0 at the last twists.
    #[inline(always)]
    pub fn bias(&self, tree: &Tree<G>, s: &TreeScratch<G>) -> G::S {
        match &self.quantity {
            Quantity::Coordinate { .. } | Quantity::Velocity(_) => G::S::default(),
            _ => self.bias_between(tree, s),
        }
    }

    /// For a measurement between two bodies.
    #[inline(never)]
    fn bias_between(&self, tree: &Tree<G>, s: &TreeScratch<G>) -> G::S {
        let (xa, xb) = (&s.links[self.links[0]], &s.links[self.links[1]]);
        let (w, alpha) = (xb.w - xa.w, xb.alpha - xa.alpha);
        match &self.quantity {
            Quantity::Coordinate { .. } | Quantity::Velocity(_) => G::S::default(),
            Quantity::Along(ends, axis) => {
                let (rate, acc) = ends.rates(tree, s);
                let d = G::rotate(&xa.rot, *axis);
                let d1 = G::cross(xa.w, d);
                let d2 = G::cross(xa.alpha, d) + G::cross(xa.w, d1);
                let twice = G::dot(d1, rate);
                G::dot(d2, ends.now(tree, s).2) + twice + twice + G::dot(d, acc)
            }
            Quantity::Distance(ends, out) => {
                let (gap, (rate, acc)) = (ends.now(tree, s).2, ends.rates(tree, s));
                let length = length::<G>(gap, *out);
                let n = over::<G>(gap, length);
                let along = G::dot(n, rate);
                G::dot(n, acc) + (G::dot(rate, rate) - along * along) / length
            }
            Quantity::Turn(t) => {
                let [x, y] = t.parts(&xa.rot, &xb.rot);
                let turned = G::cross_ang(xa.w, x) + G::cross_ang(xb.w, y);
                G::dot_ang(x + y, alpha) + G::dot_ang(turned, w)
            }
            Quantity::Twist { on_a, on_b } => {
                let ([xa_, ya, xb_, yb], axis) = twist_axes::<G>(on_a, on_b, &xa.rot, &xb.rot);
                let (of_a, of_b) = (|x| G::cross_ang(xa.w, x), |x| G::cross_ang(xb.w, x));
                let moved = G::cross_ang(of_b(xb_), ya) + G::cross_ang(xb_, of_a(ya))
                    - G::cross_ang(of_b(yb), xa_)
                    - G::cross_ang(yb, of_a(xa_));
                G::dot_ang(axis, alpha) + G::dot_ang(half::<G>(moved), w)
            }
            Quantity::Cosine(u, v) => {
                let (u, v) = (G::rotate_ang(&xa.rot, *u), G::rotate_ang(&xb.rot, *v));
                let moved = G::cross_ang(G::cross_ang(xb.w, v), u) + G::cross_ang(v, G::cross_ang(xa.w, u));
                G::dot_ang(G::cross_ang(v, u), alpha) + G::dot_ang(moved, w)
            }
            Quantity::Spin(axis) => {
                let axis = G::rotate_ang(&xb.rot, *axis);
                G::dot_ang(axis, alpha) + G::dot_ang(G::cross_ang(xb.w, axis), w)
            }
        }
    }

    /// Add `factor` times its gradient to a row of C.
    #[inline(always)]
    pub fn columns(&self, factor: G::S, tree: &Tree<G>, s: &TreeScratch<G>, row: &mut [G::S]) {
        match self.unit(tree, s) {
            None => row[self.movers[0].column] += factor,
            Some(unit) => {
                let scaled =
                    Unit { moment: G::scale_ang(unit.moment, factor), force: G::scale(unit.force, factor), ..unit };
                power_columns(&self.movers, &scaled, tree, s, row);
            }
        }
    }
}

/// Add the power of a wrench on B, its opposite on A, for unit velocities of the links between them, to a row.
#[inline(always)]
pub(crate) fn power_columns<G: Space>(
    movers: &[Mover],
    unit: &Unit<G>,
    tree: &Tree<G>,
    s: &TreeScratch<G>,
    row: &mut [G::S],
) {
    for m in movers {
        let x = &s.links[m.link];
        let arm = unit.point[usize::from(!m.on_b)] - x.joint;
        let put = |value: G::S| if m.on_b { value } else { -value };
        let about_joint = || unit.moment + G::moment(arm, unit.force);
        match tree.links[m.link].motion {
            LinkMotion::Turn(_) => row[m.column] += put(G::dot_ang(x.axis, about_joint())),
            LinkMotion::Slide(_) => row[m.column] += put(G::dot(x.direction, unit.force)),
            LinkMotion::Ball => {
                let moment = about_joint();
                for j in 0..3 {
                    row[m.column + j] += put(G::dot_ang(G::body_axis(&x.rot, j), moment));
                }
            }
        }
    }
}

#[inline(always)]
fn length<G: Space>(gap: G::Vec, out_of_plane2: G::S) -> G::S {
    partita_math::scalar::Scalar::sqrt(G::dot(gap, gap) + out_of_plane2)
}

#[inline(always)]
fn over<G: Space>(x: G::Vec, by: G::S) -> G::Vec {
    G::scale(x, <G::S as partita_math::scalar::Scalar>::one() / by)
}

#[inline(always)]
fn half_of<G: Space>(x: G::S) -> G::S {
    partita_math::scalar::Scalar::scale(x, 0.5)
}
