//! Loops in space by a characteristic pair of joints.                                                        (39)
//!
//! ```text
//!            J                      J: a turn or a slide between X and Y
//!    Y ------------- X              Z: a link with its centres in A and B
//!      \           /                A: a ball; B: a ball, a universal or a cylindrical joint
//!     B  \       /  A
//!          ( Z )
//! ```
//!
//! The distance of the centres, fixed on Z, does not contain the coordinates of A and B: one equation for that of J.
//! Then the direction of Z is known. A universal joint aligns it by its two angles; between two balls the link keeps
//! its spin, as far as the shortest rotation allows: the spin is an input, and the part of it that this velocity
//! measures is a factor of the pivot.
//!
//! B may be a cylindrical joint as well. Then the relevant distance is that of the centre A from its axis, for a
//! rotation J about a parallel axis or a translation J.
//!
//! Without branches, over any scalar, as in the plane.

use super::arm::{crossing, lift, Pose};
use super::graph::{Graph, Kind};
use super::planar::Fit;
use super::polygon::{Pair, Polygon};
use partita_math::scalar::Scalar;
use partita_math::spatial::{Mat3, Vec3};
use partita_math::tolerance;

/// Round-off that an exactly flat position may show in terms of this size: twice that of a polygon, for products of two
/// rotations.
fn flat_within<S: Scalar>(terms: S) -> S {
    terms.scale(2.0 * tolerance::ROUNDING)
}

/// Coordinates computed by a step, before they are used.
#[derive(Clone, Copy, Debug)]
pub(super) struct StepCoordinates<S> {
    /// Rotations and translations by edge.
    turns: [(usize, S); 3],
    /// Balls by edge.
    balls: [(usize, Mat3<S>); 2],
    counts: [usize; 2],
    /// Pivots: of J, and of the universal joint.
    pub pivots: [S; 2],
    /// Whether it closes.
    pub fit: Fit<S>,
}

impl<S: Scalar> StepCoordinates<S> {
    fn new() -> Self {
        Self {
            turns: [(0, S::zero()); 3],
            balls: [(0, Mat3::identity()); 2],
            counts: [0; 2],
            pivots: [S::one(); 2],
            fit: Fit::good(),
        }
    }

    fn turn(&mut self, edge: usize, x: S) {
        self.turns[self.counts[0]] = (edge, x);
        self.counts[0] += 1;
    }

    /// Orientation of a ball from the rotation across it.
    fn ball(&mut self, g: &Graph, (e, forward): (usize, bool), cross: &Mat3<S>) {
        let rest = Mat3::from_f64(g.edges[e].rest.transpose().0);
        self.balls[self.counts[1]] = (e, if forward { cross.mul(&rest) } else { cross.transpose().mul(&rest) });
        self.counts[1] += 1;
    }

    /// Use them.
    pub fn write(&self, p: &mut Pose<S>) {
        self.turns[..self.counts[0]].iter().for_each(|(e, x)| p.x[*e] = *x);
        self.balls[..self.counts[1]].iter().for_each(|(e, r)| p.balls[*e] = *r);
    }
}

/// `a cos ψ + b sin ψ + c = 0`: ψ and the pivot `√(R² − c²)/R`; if there is none, how far |c| exceeds R.   (39)
pub(super) fn characteristic<S: Scalar>(a: S, b: S, c: S, scale: S, sign: f64) -> (S, S, Fit<S>) {
    let r = a.hypot(b);
    let fit = Fit { excess: c.abs() - r - flat_within(scale), shortfall: c.abs() - r };
    let fit = fit.unless_above_0(r - S::from_f64(f64::MIN_POSITIVE));
    let root = ((r - c.abs()).max(S::zero()) * (r + c.abs())).sqrt().scale(sign);
    (b.atan2(a) + root.atan2(-c), root.abs() / r, fit)
}

/// Signed angle about `axis` from a to b.
fn angle_about<S: Scalar>(axis: Vec3<S>, a: Vec3<S>, b: Vec3<S>) -> S {
    let (a, b) = (a - axis.times(axis.dot(a)), b - axis.times(axis.dot(b)));
    axis.dot(a.cross(b)).atan2(a.dot(b))
}

/// Solve the triangle (J, A, B) for the coordinates of its edges. Signs: of J, and of the universal joint.
pub(super) fn solve<S: Scalar>(g: &Graph, p: &Polygon, signs: [i8; 2], pose: &Pose<S>) -> StepCoordinates<S> {
    let mut found = StepCoordinates::new();
    let constant = |m: &Mat3<f64>| Mat3::<S>::from_f64(m.0);
    let (r1, d1) = p.sides[0].spatial(g, pose);
    let (r2, d2) = p.sides[1].spatial(g, pose);
    let (r3, d3) = p.sides[2].spatial(g, pose);
    let (j, forward) = p.joints[0].edges[0];
    let edge = &g.edges[j];
    let rest = constant(&edge.rest);
    let length = d2.norm();
    // axes E before J, F after it; forward: A = R(a, ψ) K d1 in E, or backward, in K E: A = R(a, −ψ) d1
    let b = -r3.apply_transposed(d3);
    let (c, b, sense) = if forward { (rest.apply(d1), b, 1.0) } else { (d1, rest.apply(b), -1.0) };
    let axis = lift::<S>(edge.axis);
    let first = f64::from(signs[0]);
    let (value, pivot, fit) = if p.joints[2].pair == Pair::Cylindrical {
        // all projected along the axis of B
        let (before, behind) = axes_of(g, p.joints[2].edges[0], p.joints[2].edges[1]);
        let u = r3.apply_transposed(lift(behind));
        let u = if forward { u } else { rest.apply(u) };
        let across = |x: Vec3<S>, u: Vec3<S>| x - u.times(u.dot(x));
        let distance = across(r2.apply_transposed(d2), lift(before)).norm();
        let (c, b) = (across(c, u), across(b, u));
        if edge.kind == Kind::Turn {
            on_circle(axis, c, b, distance, first)
        } else {
            let across = across(axis, u);
            let part = across.norm();
            let stuck = Fit { excess: flat_within(S::one()) - part, shortfall: ((c - b).norm() - distance).abs() };
            let (value, pivot, fit) = on_line(across.direction(), c, b, distance, first);
            (value / part, pivot, stuck.or(fit))
        }
    } else if edge.kind == Kind::Turn {
        on_circle(axis, c, b, length, first)
    } else {
        on_line(axis, c, b, length, first)
    };
    let x = value.scale(sense);
    found.turn(j, x);
    (found.fit, found.pivots[0]) = (fit, pivot);
    let r_ef = crossing(g, j, forward, x, &Mat3::identity());
    // everything in the axes F: the direction from A to B
    let shift = match (edge.kind, forward) {
        (Kind::Slide, true) => r_ef.apply_transposed(axis.times(-x)),
        (Kind::Slide, false) => axis.times(x),
        _ => Vec3::zero(),
    };
    let centre_b = r_ef.apply_transposed(-r3.apply_transposed(d3)) + shift;
    let w = centre_b - d1;
    let r_b = r_ef.transpose().mul(&r3.transpose());
    match p.joints[2].pair {
        Pair::Universal => {
            let cross = universal(g, p, (w, d2), (&r_b, &r2), f64::from(signs[1]), &mut found);
            let r_z = r_b.mul(&cross.transpose()).mul(&r2.transpose());
            found.ball(g, p.joints[1].edges[0], &r1.transpose().mul(&r_z));
        }
        Pair::Cylindrical => {
            let cross = cylindrical(g, p, (w, d2), (&r_b, &r2), &mut found);
            let r_z = r_b.mul(&cross.transpose()).mul(&r2.transpose());
            found.ball(g, p.joints[1].edges[0], &r1.transpose().mul(&r_z));
        }
        _ => {
            let (a, a_forward) = p.joints[1].edges[0];
            let (b, b_forward) = p.joints[2].edges[0];
            let spin = |joint: usize| match p.joints[joint].pair {
                Pair::Ball { inputs } if inputs != 0 => Some(inputs.trailing_zeros() as usize),
                _ => None,
            };
            let old = if spin(1).is_some() {
                r1.mul(&crossing(g, a, a_forward, S::zero(), &pose.balls[a]))
            } else {
                r_b.mul(&crossing(g, b, b_forward, S::zero(), &pose.balls[b]).transpose()).mul(&r2.transpose())
            };
            let (from, to) = (old.apply(d2).direction(), w.direction());
            let lost =
                Fit { shortfall: length, ..Fit::good() }.unless_above_0(from.dot(from)).unless_above_0(to.dot(to));
            found.fit = fit.or(lost);
            let r_z = Mat3::between(from, to).mul(&old);
            found.ball(g, (a, a_forward), &r1.transpose().mul(&r_z));
            found.ball(g, (b, b_forward), &r_z.mul(&r2).transpose().mul(&r_b));
            // the part of the spin that its input measures: the line of the centres in the axes after the ball
            let seen = match (spin(1), a_forward, b_forward) {
                (Some(i), true, _) => r_z.apply_transposed(to).0[i],
                (Some(i), false, _) => r1.apply_transposed(to).0[i],
                (None, _, true) => r_b.apply_transposed(to).0[spin(2).unwrap_or(0)],
                (None, _, false) => r_z.mul(&r2).apply_transposed(to).0[spin(2).unwrap_or(0)],
            };
            found.pivots[0] = pivot * seen.abs().min(S::one());
        }
    }
    found
}

/// `|R(a, ψ) c − b| = L`.
fn on_circle<S: Scalar>(axis: Vec3<S>, c: Vec3<S>, b: Vec3<S>, length: S, sign: f64) -> (S, S, Fit<S>) {
    let along = axis.times(axis.dot(c));
    let (across, gap) = (c - along, b - along);
    let (p, q) = (gap.dot(across).scale(-2.0), gap.dot(axis.cross(c)).scale(-2.0));
    let rest = gap.dot(gap) + across.dot(across) - length * length;
    let scale = gap.dot(gap) + across.dot(across) + length * length;
    let (angle, pivot, fit) = characteristic(p, q, rest, scale, sign);
    let r = p.hypot(q);
    let (far, near) = (rest + length * length + r, rest + length * length - r);
    let root = |x: S| x.max(S::zero()).sqrt();
    let shortfall = rest.where_positive(root(near) - length, length - root(far));
    (angle, pivot, Fit { shortfall, ..fit })
}

/// `|a s + c − b| = L`.
fn on_line<S: Scalar>(axis: Vec3<S>, c: Vec3<S>, b: Vec3<S>, length: S, sign: f64) -> (S, S, Fit<S>) {
    let w0 = c - b;
    let along = axis.dot(w0);
    let off = (w0 - axis.times(along)).norm();
    let fit = Fit { excess: off - length - flat_within(off + length), shortfall: (off - length).max(S::zero()) };
    let root = ((length - off).max(S::zero()) * (length + off)).sqrt().scale(sign);
    (root - along, root.abs() / length, fit.unless_above_0(length))
}

/// The two rotations of the universal joint B that bring the centre of A to its position; the rotation across B.
fn universal<S: Scalar>(
    g: &Graph,
    p: &Polygon,
    (w, d2): (Vec3<S>, Vec3<S>),
    (r_b, r2): (&Mat3<S>, &Mat3<S>),
    sign: f64,
    found: &mut StepCoordinates<S>,
) -> Mat3<S> {
    let [(i1, f1), (i2, f2)] = p.joints[2].edges[..] else { return Mat3::identity() };
    let (e1, e2) = (&g.edges[i1], &g.edges[i2]);
    // crossing i = L_i R(a_i, ψ_i) M_i
    let split = |rest: &Mat3<f64>, forward: bool| {
        let rest = Mat3::from_f64(rest.0);
        if forward {
            (Mat3::identity(), rest)
        } else {
            (rest.transpose(), Mat3::identity())
        }
    };
    let ((l1, m1), (l2, m2)) = (split(&e1.rest, f1), split(&e2.rest, f2));
    let (axis1, axis2) = (lift::<S>(e1.axis), lift::<S>(e2.axis));
    // from B to A, in the axes of the far side of B and in those of Z
    let y: Vec3<S> = m2.apply(-r_b.apply_transposed(w));
    let z: Vec3<S> = l1.apply_transposed(-r2.apply_transposed(d2));
    let between: Mat3<S> = m1.mul(&l2);
    let a1 = between.apply_transposed(axis1);
    let along = axis2.times(axis2.dot(y));
    let (a, b) = (a1.dot(y - along), a1.dot(axis2.cross(y)));
    let c = a1.dot(along) - axis1.dot(z);
    let (psi2, pivot, fit) = characteristic(a, b, c, y.norm() + z.norm(), sign);
    found.fit = found.fit.or(Fit { shortfall: fit.shortfall.max(S::zero()), ..fit });
    found.pivots[1] = pivot;
    let (s2, c2) = psi2.sin_cos();
    let turned = between.apply(Mat3::about(axis2, s2, c2).apply(y));
    let psi1 = angle_about(axis1, turned, z);
    let (x1, x2) = (if f1 { psi1 } else { -psi1 }, if f2 { psi2 } else { -psi2 });
    found.turn(i1, x1);
    found.turn(i2, x2);
    let identity = Mat3::identity();
    crossing(g, i1, f1, x1, &identity).mul(&crossing(g, i2, f2, x2, &identity))
}

/// Axis of a cylindrical joint in the axes of the node before its first crossed edge and of the node after its last
/// one.
fn axes_of(g: &Graph, first: (usize, bool), last: (usize, bool)) -> (Vec3<f64>, Vec3<f64>) {
    let seen = |(e, from): (usize, bool)| {
        let e = &g.edges[e];
        if from {
            e.axis
        } else {
            e.rest.apply_transposed(e.axis)
        }
    };
    (seen(first), seen((last.0, !last.1)))
}

/// Rotation and translation of the cylindrical joint B that bring the centre of A to its position; the rotation across
/// B.
fn cylindrical<S: Scalar>(
    g: &Graph,
    p: &Polygon,
    (w, d2): (Vec3<S>, Vec3<S>),
    (r_b, r2): (&Mat3<S>, &Mat3<S>),
    found: &mut StepCoordinates<S>,
) -> Mat3<S> {
    let identity = Mat3::identity();
    let y = -r_b.apply_transposed(w);
    let z = -r2.apply_transposed(d2);
    let edges = &p.joints[2].edges;
    // rotations before and after the unknown one: across B = before · R(a, ψ) · after
    let (mut before, mut behind, mut unknown) = (identity, identity, None);
    for &(i, forward) in edges {
        let e = &g.edges[i];
        let rest = Mat3::from_f64(if forward { e.rest } else { e.rest.transpose() }.0);
        match (e.kind, forward) {
            (Kind::Turn, true) => {
                unknown = Some((i, 1.0));
                behind = rest;
            }
            (Kind::Turn, false) => {
                before = before.mul(&rest);
                unknown = Some((i, -1.0));
            }
            _ if unknown.is_none() => before = before.mul(&rest),
            _ => behind = behind.mul(&rest),
        }
    }
    let mut turn = S::zero();
    if let Some((i, sense)) = unknown {
        turn = angle_about(lift(g.edges[i].axis), behind.apply(y), before.apply_transposed(z)).scale(sense);
        found.turn(i, turn);
    }
    let mut cross = identity;
    let mut slides = None;
    for &(i, forward) in edges {
        let here = cross;
        cross = cross.mul(&crossing(g, i, forward, turn, &identity));
        if g.edges[i].kind == Kind::Slide {
            // axes in which the translation is given: before the crossing, or after it going backward
            slides = Some((i, if forward { (here, 1.0) } else { (cross, -1.0) }));
        }
    }
    if let Some((i, (axes, sense))) = slides {
        let slide = lift::<S>(g.edges[i].axis).dot(axes.apply_transposed(z - cross.apply(y)));
        found.turn(i, slide.scale(sense));
    }
    cross
}
