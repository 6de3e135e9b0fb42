//! Rigid parts: the relative pose of two joints through joints whose coordinates are known. Over any scalar.

use super::graph::{Graph, Home, Kind};
use crate::numbers::Numbers;
use partita_math::scalar::Scalar;
use partita_math::spatial::{Mat3, Quaternion, Vec3};
use std::f64::consts::TAU;

/// One side of an edge: after its motion, or before it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Side {
    pub edge: usize,
    pub behind: bool,
}

/// A path along joints with known coordinates, from the point of one joint to that of another.
#[derive(Clone, Debug)]
pub(super) struct Arm {
    /// Where it starts.
    pub start: Side,
    /// Edges crossed, and whether from their `from` to their `to`.
    pub path: Vec<(usize, bool)>,
    /// Where it ends.
    pub end: Side,
}

/// The numbers of a graph: coordinates of its edges, and their positions in the zero position.
#[derive(Clone, Debug)]
pub(super) struct Pose<S> {
    /// Coordinate of each rotation and translation.
    pub x: Vec<S>,
    /// Rotation of each ball joint.
    pub balls: Vec<Mat3<S>>,
    /// The joint's point in the zero position, as both sides of each edge carry it.
    points: Vec<[Vec3<S>; 2]>,
}

/// An arm in the plane: the vector from start to end in the axes of its first node, and the rotation of its last node.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlanarArm<S> {
    pub vector: [S; 2],
    pub turn: S,
    /// Length of the vector.
    pub length: S,
}

impl<S: Scalar> PlanarArm<S> {
    pub fn new(vector: [S; 2], turn: S) -> Self {
        Self { vector, turn, length: (vector[0] * vector[0] + vector[1] * vector[1]).sqrt() }
    }
}

/// The vector `v` turned by an angle.
pub(super) fn rotated<S: Scalar>(v: [S; 2], angle: S) -> [S; 2] {
    let (s, c) = angle.sin_cos();
    [c * v[0] - s * v[1], s * v[0] + c * v[1]]
}

/// Turn of a rotation about z.
pub(super) fn turn_of(r: &Mat3<f64>) -> f64 {
    r.0[1][0].atan2(r.0[0][0])
}

/// The angle x with the whole turns that bring it nearest to `old`.
#[inline(always)]
pub(super) fn nearest_turn<S: Scalar>(x: S, old: S) -> S {
    x + (old - x).scale(1.0 / TAU).round().scale(TAU)
}

/// A constant of the graph.
pub(super) fn lift<S: Scalar>(x: Vec3<f64>) -> Vec3<S> {
    Vec3::from_f64(x.0)
}

impl<S: Scalar> Pose<S> {
    pub fn new(g: &Graph, numbers: &Numbers<S>) -> Self {
        let (x, balls) = (vec![S::zero(); g.edges.len()], vec![Mat3::identity(); g.edges.len()]);
        Self { x, balls, points: g.edges.iter().map(|e| e.point.points(numbers)).collect() }
    }

    /// Coordinate of edge i from q, if it belongs to the tree.
    pub fn read(&mut self, g: &Graph, i: usize, q: &[S]) {
        let e = &g.edges[i];
        let Home::Tree { q: at, .. } = e.home else { return };
        if e.kind == Kind::Ball {
            self.balls[i] = Quaternion([q[at], q[at + 1], q[at + 2], q[at + 3]]).normalised().matrix();
        } else {
            self.x[i] = q[at];
        }
    }

    /// Coordinate of edge i to q, if it belongs to the tree: the angle and the sign of the quaternion nearest to the
    /// present value.
    pub fn write(&mut self, g: &Graph, i: usize, q: &mut [S]) {
        let e = &g.edges[i];
        let Home::Tree { q: at, .. } = e.home else { return };
        match e.kind {
            Kind::Turn => {
                self.x[i] = nearest_turn(self.x[i], q[at]);
                q[at] = self.x[i];
            }
            Kind::Ball => {
                let p = Quaternion::from_matrix(&self.balls[i]).0;
                let mut same = S::zero();
                for k in 0..4 {
                    same += p[k] * q[at + k];
                }
                for k in 0..4 {
                    q[at + k] = (-same).where_positive(-p[k], p[k]);
                }
            }
            _ => q[at] = self.x[i],
        }
    }

    fn point(&self, s: Side) -> Vec3<S> {
        self.points[s.edge][usize::from(s.behind)]
    }

    /// Points at which the path enters and leaves an edge.
    fn sides(&self, edge: usize, forward: bool) -> (Vec3<S>, Vec3<S>) {
        let [before, behind] = self.points[edge];
        if forward {
            (before, behind)
        } else {
            (behind, before)
        }
    }
}

/// An arm of rotations in a mechanism that is planar as a whole.
#[derive(Clone, Debug)]
pub(super) struct Chain {
    /// From its start to the first rotation.
    start: [f64; 2],
    /// Edge of each rotation, its sense and constant part, and the vector from there to the next.
    turns: Vec<(usize, f64, f64, [f64; 2])>,
}

impl Chain {
    /// For the coordinates of the edges.
    #[inline]
    pub fn at(&self, x: &[f64]) -> PlanarArm<f64> {
        let (mut vector, mut turn) = (self.start, 0.0);
        for &(edge, sense, rest, d) in &self.turns {
            turn += sense * x[edge] + rest;
            let d = rotated(d, turn);
            vector = [vector[0] + d[0], vector[1] + d[1]];
        }
        PlanarArm::new(vector, turn)
    }
}

impl Arm {
    /// In a mechanism that is planar as a whole.
    pub fn planar<S: Scalar>(&self, g: &Graph, p: &Pose<S>) -> PlanarArm<S> {
        let mut at = p.point(self.start);
        let (mut vector, mut turn) = ([S::zero(); 2], S::zero());
        let (mut s, mut c) = (S::zero(), S::one());
        let mut add = |d: [S; 2], s: S, c: S| {
            vector[0] += c * d[0] - s * d[1];
            vector[1] += s * d[0] + c * d[1];
        };
        for &(i, forward) in &self.path {
            let e = &g.edges[i];
            let (near, far) = p.sides(i, forward);
            add([near.0[0] - at.0[0], near.0[1] - at.0[1]], s, c);
            at = far;
            let along = [p.x[i].scale(e.axis.0[0]), p.x[i].scale(e.axis.0[1])];
            if e.kind == Kind::Slide && forward {
                add(along, s, c);
            }
            let by = match e.kind {
                Kind::Turn => Some(p.x[i].scale(e.axis.0[2]) + S::from_f64(e.turned)),
                _ if e.turned != 0.0 => Some(S::from_f64(e.turned)),
                _ => None,
            };
            if let Some(by) = by {
                turn += if forward { by } else { -by };
                (s, c) = turn.sin_cos();
            }
            if e.kind == Kind::Slide && !forward {
                add([-along[0], -along[1]], s, c);
            }
        }
        let end = p.point(self.end);
        add([end.0[0] - at.0[0], end.0[1] - at.0[1]], s, c);
        PlanarArm::new(vector, turn)
    }

    /// The same arm with all constant parts combined, if it contains only rotations.
    pub fn chain(&self, g: &Graph, p: &Pose<f64>) -> Option<Chain> {
        let mut chain = Chain { start: [0.0; 2], turns: Vec::new() };
        let mut at = p.point(self.start);
        let mut add = |chain: &mut Chain, to: Vec3<f64>, next: Vec3<f64>| {
            let last = chain.turns.last_mut().map_or(&mut chain.start, |turn| &mut turn.3);
            (last[0], last[1]) = (last[0] + to.0[0] - at.0[0], last[1] + to.0[1] - at.0[1]);
            at = next;
        };
        for &(i, forward) in &self.path {
            let e = &g.edges[i];
            let (near, far) = p.sides(i, forward);
            add(&mut chain, near, far);
            let sense = if forward { 1.0 } else { -1.0 };
            match e.kind {
                Kind::Turn => chain.turns.push((i, sense * e.axis.0[2], sense * e.turned, [0.0; 2])),
                Kind::Rigid if e.turned == 0.0 => {}
                _ => return None,
            }
        }
        let end = p.point(self.end);
        add(&mut chain, end, end);
        Some(chain)
    }

    /// Whether no coordinate changes the distance of its ends.
    pub fn is_rigid(&self, g: &Graph) -> bool {
        self.path.iter().all(|&(i, _)| g.edges[i].kind == Kind::Rigid)
    }

    /// In space: the rotation of the last node and the vector, both in the axes of the first node.
    pub fn spatial<S: Scalar>(&self, g: &Graph, p: &Pose<S>) -> (Mat3<S>, Vec3<S>) {
        let mut at = p.point(self.start);
        let (mut r, mut v) = (Mat3::identity(), Vec3::zero());
        for &(i, forward) in &self.path {
            let e = &g.edges[i];
            let (near, far) = p.sides(i, forward);
            v += r.apply(near - at);
            at = far;
            let along = lift::<S>(e.axis).times(p.x[i]);
            if e.kind == Kind::Slide && forward {
                v += r.apply(along);
            }
            r = r.mul(&crossing(g, i, forward, p.x[i], &p.balls[i]));
            if e.kind == Kind::Slide && !forward {
                v -= r.apply(along);
            }
        }
        v += r.apply(p.point(self.end) - at);
        (r, v)
    }
}

/// Rotation from one side of an edge to the other.
pub(super) fn crossing<S: Scalar>(g: &Graph, i: usize, forward: bool, x: S, ball: &Mat3<S>) -> Mat3<S> {
    let e = &g.edges[i];
    let rest = Mat3::from_f64(e.rest.0);
    let r = match e.kind {
        Kind::Turn => {
            let (s, c) = x.sin_cos();
            Mat3::about(lift(e.axis), s, c).mul(&rest)
        }
        Kind::Ball => ball.mul(&rest),
        Kind::Slide | Kind::Rigid => rest,
    };
    if forward {
        r
    } else {
        r.transpose()
    }
}
