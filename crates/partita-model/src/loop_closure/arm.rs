//! Rigid parts: how two joints stand to each other through joints whose coordinates are known.

use super::graph::{Graph, Kind};
use partita_math::spatial::{Mat3, Vec3};

/// A walk along joints with known coordinates, from one joint's point to another's.
#[derive(Clone, Debug)]
pub(super) struct Arm {
    /// Where it starts, zero position.
    pub start: Vec3<f64>,
    /// Edges crossed, and whether from their `from` to their `to`.
    pub path: Vec<(usize, bool)>,
    /// Where it ends, zero position.
    pub end: Vec3<f64>,
}

/// An arm in the plane: the vector from start to end in the axes of its first node, and the turn of its last node.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct FlatArm {
    pub vector: [f64; 2],
    pub turn: f64,
}

/// The vector `v` turned by an angle.
pub(super) fn rotated(v: [f64; 2], angle: f64) -> [f64; 2] {
    if angle == 0.0 {
        return v;
    }
    let (s, c) = angle.sin_cos();
    [c * v[0] - s * v[1], s * v[0] + c * v[1]]
}

/// Turn of a rotation about z.
pub(super) fn turn_of(r: &Mat3<f64>) -> f64 {
    r.0[1][0].atan2(r.0[0][0])
}

impl Arm {
    /// In a mechanism that is planar as a whole.
    pub fn flat(&self, g: &Graph, x: &[f64]) -> FlatArm {
        let mut at = self.start;
        let (mut vector, mut turn) = ([0.0; 2], 0.0);
        let (mut s, mut c) = (0.0f64, 1.0f64);
        let mut add = |d: [f64; 2], s: f64, c: f64| {
            vector[0] += c * d[0] - s * d[1];
            vector[1] += s * d[0] + c * d[1];
        };
        for &(i, forward) in &self.path {
            let e = &g.edges[i];
            let (near, far) = if forward { (e.at_from, e.at_to) } else { (e.at_to, e.at_from) };
            add([near.0[0] - at.0[0], near.0[1] - at.0[1]], s, c);
            at = far;
            let rest = turn_of(&e.rest);
            let along = [e.axis.0[0] * x[i], e.axis.0[1] * x[i]];
            let mut by = if e.kind == Kind::Turn { e.axis.0[2] * x[i] + rest } else { rest };
            if e.kind == Kind::Slide && forward {
                add(along, s, c);
            }
            if !forward {
                by = -by;
            }
            if by != 0.0 {
                turn += by;
                (s, c) = turn.sin_cos();
            }
            if e.kind == Kind::Slide && !forward {
                add([-along[0], -along[1]], s, c);
            }
        }
        add([self.end.0[0] - at.0[0], self.end.0[1] - at.0[1]], s, c);
        FlatArm { vector, turn }
    }

    /// In space: the turn of the last node and the vector, both in the axes of the first node.
    pub fn spatial(&self, g: &Graph, x: &[f64], balls: &[Mat3<f64>]) -> (Mat3<f64>, Vec3<f64>) {
        let mut at = self.start;
        let (mut r, mut v) = (Mat3::identity(), Vec3::zero());
        for &(i, forward) in &self.path {
            let e = &g.edges[i];
            let (near, far) = if forward { (e.at_from, e.at_to) } else { (e.at_to, e.at_from) };
            v += r.apply(near - at);
            at = far;
            if e.kind == Kind::Slide && forward {
                v += r.apply(e.axis.times(x[i]));
            }
            r = r.mul(&crossing(g, i, forward, x[i], &balls[i]));
            if e.kind == Kind::Slide && !forward {
                v -= r.apply(e.axis.times(x[i]));
            }
        }
        v += r.apply(self.end - at);
        (r, v)
    }
}

/// Turn from one side of an edge to the other.
pub(super) fn crossing(g: &Graph, i: usize, forward: bool, x: f64, ball: &Mat3<f64>) -> Mat3<f64> {
    let e = &g.edges[i];
    let r = match e.kind {
        Kind::Turn => Mat3::about(e.axis, x.sin(), x.cos()).mul(&e.rest),
        Kind::Ball => ball.mul(&e.rest),
        Kind::Slide | Kind::Rigid => e.rest,
    };
    if forward {
        r
    } else {
        r.transpose()
    }
}
