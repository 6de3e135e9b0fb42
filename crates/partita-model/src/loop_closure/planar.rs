//! Dyads in the plane: a closed polygon of known sides, joined by at most three joints with unknown coordinates.   (L1)
//!
//! ```text
//!            side 2
//!     joint 2 ---- joint 3        side i leads from joint i to joint i + 1 (cyclic)
//!   side 1 \       / side 3       F_i: axes at the start of side i
//!           joint 1               F_{i+1} = F_i · turn(side i) · turn(joint i + 1)
//! ```
//!
//! Dyads RRR, RRP, RPR, ... differ only in which side is called the frame, and the closed forms do not depend on it:
//! three rotations are a triangle of given lengths, one translation the intersection of a line and a circle, two
//! translations that of two lines.
//!
//! Everything is computed without branches, over any scalar; whether the polygon closes at all is reported beside its
//! solution.

use super::arm::{rotated, PlanarArm};
use partita_math::scalar::Scalar;
use partita_math::tolerance;

/// An unknown joint of a polygon, in the sense of the path around it.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlanarJoint {
    /// Edge of the graph.
    pub edge: usize,
    /// Its coordinate in q, if it belongs to the tree.
    pub q: Option<usize>,
    /// A rotation, or a translation.
    pub turns: bool,
    /// Sense of the rotation along the path.
    pub sign: f64,
    /// Constant rotation of the crossing.
    pub rest: f64,
    /// Direction of a translation where the path enters.
    pub axis: [f64; 2],
}

/// Gap between the sides (m).
#[derive(Clone, Copy, Debug)]
pub(super) struct Shortfall(pub f64);

/// Whether a polygon closes. Where `excess` is above 0 it does not, and its solution is meaningless.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fit<S> {
    /// Gap beyond round-off.
    pub excess: S,
    /// Gap between the sides (m).
    pub shortfall: S,
}

impl<S: Scalar> Fit<S> {
    /// It closes.
    pub fn good() -> Self {
        Self { excess: -S::one(), shortfall: S::zero() }
    }

    /// This one, or the other where this one is valid.
    pub fn or(self, other: Self) -> Self {
        let pick = |a: S, b: S| self.excess.where_positive(a, b);
        Self { excess: pick(self.excess, other.excess), shortfall: pick(self.shortfall, other.shortfall) }
    }

    /// Does not close where `length` is not above 0 either.
    pub fn unless_above_0(self, length: S) -> Self {
        Self { excess: length.where_positive(self.excess, S::one()), ..self }
    }
}

impl Fit<f64> {
    /// As a result: closed, or not.
    pub fn check(self) -> Result<(), Shortfall> {
        if self.excess > 0.0 {
            Err(Shortfall(self.shortfall))
        } else {
            Ok(())
        }
    }
}

/// Coordinates of the joints, the pivot over its largest possible value, and whether they are a solution at all.
pub(super) type Solved<S> = ([S; 3], S, Fit<S>);

fn cross<S: Scalar>(a: [S; 2], b: [S; 2]) -> S {
    a[0] * b[1] - a[1] * b[0]
}
fn dot<S: Scalar>(a: [S; 2], b: [S; 2]) -> S {
    a[0] * b[0] + a[1] * b[1]
}
fn sum<S: Scalar>(a: [S; 2], b: [S; 2]) -> [S; 2] {
    [a[0] + b[0], a[1] + b[1]]
}
fn times<S: Scalar>(a: [S; 2], k: S) -> [S; 2] {
    [a[0] * k, a[1] * k]
}
/// Angle from a to b.
fn angle<S: Scalar>(a: [S; 2], b: [S; 2]) -> S {
    cross(a, b).atan2(dot(a, b))
}

impl PlanarJoint {
    /// Coordinate of a rotation from the rotation of the crossing.
    fn coordinate<S: Scalar>(&self, turn: S) -> S {
        (turn - S::from_f64(self.rest)).scale(self.sign)
    }
    fn rest<S: Scalar>(&self) -> S {
        S::from_f64(self.rest)
    }
    fn axis<S: Scalar>(&self) -> [S; 2] {
        self.axis.map(S::from_f64)
    }
}

/// Closed form of a polygon, with the joint or the side from which it is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    Triangle(usize),
    OneSlide(usize),
    TwoSlides(usize),
    Bar,
    Follower(usize),
    Wedge,
    Single,
}

/// The unknown joints of a polygon in their plane, and its closed form.
#[derive(Clone, Debug)]
pub(super) struct PlanarPolygon {
    pub joints: Vec<PlanarJoint>,
    form: Form,
}

impl PlanarPolygon {
    /// Of at most three joints; `frame` is the side called the frame.
    pub fn new(joints: Vec<PlanarJoint>, frame: usize) -> Self {
        let slides = joints.iter().filter(|j| !j.turns).count();
        let find = |turns: bool| joints.iter().position(|j| j.turns == turns).unwrap_or(0);
        let form = match (joints.len(), slides) {
            (3, 0) => Form::Triangle(frame),
            (3, 1) => Form::OneSlide(find(false) + 1),
            (3, _) => Form::TwoSlides(find(true)),
            (2, 0) => Form::Bar,
            (2, 1) => Form::Follower(find(true)),
            (2, _) => Form::Wedge,
            _ => Form::Single,
        };
        Self { joints, form }
    }

    /// Whether it has two solutions and needs a sign.
    pub fn has_branch(&self) -> bool {
        matches!(self.form, Form::Triangle(_) | Form::OneSlide(_))
    }

    /// Its solution; `tolerance` (m) is the allowed residual of a redundant condition.
    pub fn solve<S: Scalar>(&self, sides: &[PlanarArm<S>], sign: i8, tolerance: f64) -> Solved<S> {
        let (joints, sign) = (&self.joints[..], f64::from(sign));
        match self.form {
            Form::Triangle(frame) => triangle(joints, sides, frame, sign),
            Form::OneSlide(first) => one_slide(joints, sides, first, sign),
            Form::TwoSlides(first) => two_slides(joints, sides, first),
            Form::Bar => bar(joints, sides, tolerance),
            Form::Follower(first) => follower(joints, sides, first, tolerance),
            Form::Wedge => wedge(joints, sides),
            Form::Single => single(joints, sides),
        }
    }
}

/// Three rotations: the triangle of the sides R, l2, l3 with the orientation ε.
fn triangle<S: Scalar>(joints: &[PlanarJoint], sides: &[PlanarArm<S>], frame: usize, sign: f64) -> Solved<S> {
    let at = |i: usize| (frame + i) % 3;
    let [d1, d2, d3] = [0, 1, 2].map(|i| sides[at(i)].vector);
    let [a1, a2, a3] = [0, 1, 2].map(|i| sides[at(i)].turn);
    let [r, l2, l3] = [0, 1, 2].map(|i| sides[at(i)].length);
    let missing = (r - (l2 + l3)).max((l2 - l3).abs() - r);
    // with a side of no length the triangle has no direction
    let fit = Fit { excess: missing - (r + l2 + l3).scale(tolerance::ROUNDING), shortfall: missing.max(S::zero()) };
    let fit = fit.unless_above_0(r).unless_above_0(l2).unless_above_0(l3);
    // height over the frame from the area in Kahan's order, which keeps its digits in flat triangles
    let (larger, smaller) = (r.max(l2), r.min(l2));
    let (a, rest) = (larger.max(l3), larger.min(l3));
    let (b, c) = (smaller.max(rest), smaller.min(rest));
    let square = (a + (b + c)) * (c - (a - b)) * (c + (a - b)) * (a + (b - c));
    let twice_area = square.max(S::zero()).sqrt().scale(0.5);
    let over_r = S::one() / r;
    // half the difference of the sides along the frame
    let shift = (l3 - l2).scale(0.5) * ((l3 + l2) * over_r);
    let u = r.scale(0.5) + shift;
    let h = twice_area.scale(sign) * over_r;
    let e = times(d1, over_r);
    let normal = [-e[1], e[0]];
    // X = P + u e + ε √(l3² − u²) e⊥
    let from_1 = sum(times(e, u), times(normal, h));
    let from_2 = sum(times(e, shift - r.scale(0.5)), times(normal, h));
    let b2 = angle(d2, from_2);
    let b3 = angle(d3, times(from_1, -S::one()));
    let mut x = [S::zero(); 3];
    x[at(0)] = joints[at(0)].coordinate(-b3 - a3);
    x[at(1)] = joints[at(1)].coordinate(b2 - a1);
    x[at(2)] = joints[at(2)].coordinate(b3 - b2 - a2);
    (x, (twice_area / (l2 * l3)).min(S::one()), fit)
}

/// One translation, crossed just before joint `first`: s with |w0 + s û| = l, the distance of the two rotations.
fn one_slide<S: Scalar>(joints: &[PlanarJoint], sides: &[PlanarArm<S>], first: usize, sign: f64) -> Solved<S> {
    let at = |i: usize| (first + i) % 3;
    let slide = &joints[at(2)];
    let [d1, d2, d3] = [0, 1, 2].map(|i| sides[at(i)].vector);
    let [a1, a2, a3] = [0, 1, 2].map(|i| sides[at(i)].turn);
    let l = sides[at(0)].length;
    let along = rotated(slide.axis(), a2);
    let w0 = sum(d2, rotated(d3, a2 + slide.rest()));
    let off = cross(along, w0);
    let missing = off.abs() - l;
    let slack = (l + off.abs() + w0[0].hypot(w0[1])).scale(tolerance::ROUNDING);
    let fit = Fit { excess: missing - slack, shortfall: missing.max(S::zero()) }.unless_above_0(l);
    let root = ((l - off.abs()).max(S::zero()) * (l + off.abs())).sqrt().scale(sign);
    let s = root - dot(along, w0);
    let w = sum(times(along, root), times([-along[1], along[0]], off));
    let b2 = angle(times(w, -S::one()), d1);
    let mut x = [S::zero(); 3];
    x[at(0)] = joints[at(0)].coordinate(-(b2 + a2 + slide.rest()) - a3);
    x[at(1)] = joints[at(1)].coordinate(b2 - a1);
    x[at(2)] = s;
    (x, root.abs() / l, fit)
}

/// Two translations and the rotation `first`: the rotation follows from those of the sides, the translations from two
/// lines.
fn two_slides<S: Scalar>(joints: &[PlanarJoint], sides: &[PlanarArm<S>], first: usize) -> Solved<S> {
    let at = |i: usize| (first + i) % 3;
    let [j1, j2, j3] = [0, 1, 2].map(|i| joints[at(i)]);
    let [s1, s2, s3] = [0, 1, 2].map(|i| sides[at(i)]);
    let before_2 = s1.turn;
    let after_2 = before_2 + j2.rest();
    let before_3 = after_2 + s2.turn;
    let after_3 = before_3 + j3.rest();
    let (u2, u3) = (rotated(j2.axis(), before_2), rotated(j3.axis(), before_3));
    let gap = sum(s1.vector, sum(rotated(s2.vector, after_2), rotated(s3.vector, after_3)));
    let ([x2, x3], pivot, fit) = lines(u2, u3, gap);
    let mut x = [S::zero(); 3];
    x[at(0)] = j1.coordinate(-(after_3 + s3.turn));
    (x[at(1)], x[at(2)]) = (x2, x3);
    (x, pivot, fit)
}

/// `s2 u2 + s3 u3 + gap = 0`; pivot: sine of the angle between the lines.
fn lines<S: Scalar>(u2: [S; 2], u3: [S; 2], gap: [S; 2]) -> ([S; 2], S, Fit<S>) {
    let sine = cross(u2, u3);
    // below this the lines are parallel to the rounding of their directions
    let fit = Fit { excess: S::from_f64(tolerance::ROUNDING) - sine.abs(), shortfall: cross(u2, gap).abs() };
    ([-cross(gap, u3) / sine, -cross(u2, gap) / sine], sine.abs().min(S::one()), fit)
}

/// Two rotations: a bar between two points whose distance is constant anyway (a redundant loop).
fn bar<S: Scalar>(joints: &[PlanarJoint], sides: &[PlanarArm<S>], tolerance: f64) -> Solved<S> {
    let [d1, d2] = [sides[0].vector, sides[1].vector];
    let missing = (d1[0].hypot(d1[1]) - d2[0].hypot(d2[1])).abs();
    let fit = Fit { excess: missing - S::from_f64(tolerance), shortfall: missing };
    let b2 = angle(d2, times(d1, -S::one()));
    let x = [joints[0].coordinate(-b2 - sides[1].turn), joints[1].coordinate(b2 - sides[0].turn), S::zero()];
    (x, S::one(), fit)
}

/// A rotation (`first`) and a translation between parts that are aligned anyway.
fn follower<S: Scalar>(joints: &[PlanarJoint], sides: &[PlanarArm<S>], first: usize, tolerance: f64) -> Solved<S> {
    let (i, j) = (first % 2, (first + 1) % 2);
    let slide = &joints[j];
    let along = rotated(slide.axis(), sides[i].turn);
    let after = sides[i].turn + slide.rest();
    let gap = sum(sides[i].vector, rotated(sides[j].vector, after));
    let missing = cross(along, gap).abs();
    let fit = Fit { excess: missing - S::from_f64(tolerance), shortfall: missing };
    let mut x = [S::zero(); 3];
    x[i] = joints[i].coordinate(-(after + sides[j].turn));
    x[j] = -dot(along, gap);
    (x, S::one(), fit)
}

/// Two translations: a wedge. The rotations of the sides cancel.
fn wedge<S: Scalar>(joints: &[PlanarJoint], sides: &[PlanarArm<S>]) -> Solved<S> {
    let [s1, s2] = [sides[0], sides[1]];
    let after = s1.turn + joints[1].rest();
    let (u2, u1) = (rotated(joints[1].axis(), s1.turn), rotated(joints[0].axis(), after + s2.turn));
    let gap = sum(s1.vector, rotated(s2.vector, after));
    let ([x2, x1], pivot, fit) = lines(u2, u1, gap);
    ([x1, x2, S::zero()], pivot, fit)
}

/// One joint between parts that are aligned anyway: its coordinate is measured.
fn single<S: Scalar>(joints: &[PlanarJoint], sides: &[PlanarArm<S>]) -> Solved<S> {
    let (j, s) = (&joints[0], &sides[0]);
    let x = if j.turns { j.coordinate(-s.turn) } else { -dot(rotated(j.axis(), s.turn), s.vector) };
    ([x, S::zero(), S::zero()], S::one(), Fit::good())
}
