//! Polygons: unknown joints and the rigid sides between them, from clusters.

use super::arm::{lift, Arm, Side};
use super::graph::{Edge, Graph, Kind};
use super::order::Order;
use partita_math::scalar::Scalar;
use partita_math::spatial::{Mat3, Vec3};
use partita_math::tolerance;

/// Kind of an unknown joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Pair {
    Turn,
    Slide,
    /// With those of its velocities that are inputs, one bit each.
    Ball {
        inputs: u8,
    },
    /// Two rotations about axes through one point.
    Universal,
    /// A rotation about and a translation along one axis.
    Cylindrical,
}

/// A joint with unknown coordinates: consecutive edges, from the first node to the second.
#[derive(Clone, Debug)]
pub(super) struct Unknown {
    pub ends: (usize, usize),
    pub edges: Vec<usize>,
    pub pair: Pair,
}

/// A joint in the sense of the path around a polygon.
#[derive(Clone, Debug)]
pub(super) struct Crossed {
    /// Edges and their senses, in the order of the path.
    pub edges: Vec<(usize, bool)>,
    pub pair: Pair,
}

/// Joints and the sides between them: side i leads from joint i to joint i + 1.
#[derive(Clone, Debug)]
pub(super) struct Polygon {
    pub joints: Vec<Crossed>,
    pub sides: Vec<Arm>,
    /// The side that is called the frame.
    pub frame: usize,
    /// Normal and two axes of its plane, for a planar polygon in space.
    pub plane: Option<[Vec3<f64>; 3]>,
}

impl Order<'_> {
    /// The polygon of these joints in this order.
    pub(super) fn polygon(&mut self, joints: &[usize]) -> Polygon {
        let n = joints.len();
        let ends: Vec<(usize, usize)> = joints.iter().map(|&j| self.ends(j)).collect();
        let shared = |a: (usize, usize), b: (usize, usize)| if a.0 == b.0 || a.0 == b.1 { a.0 } else { a.1 };
        // the cluster after joint i
        let cluster: Vec<usize> = match n {
            3 => (0..3).map(|i| shared(ends[i], ends[(i + 1) % 3])).collect(),
            2 => vec![ends[0].1, ends[0].0],
            _ => vec![ends[0].1],
        };
        let forward: Vec<bool> = (0..n).map(|i| ends[i].1 == cluster[i]).collect();
        let crossed: Vec<Crossed> = joints
            .iter()
            .zip(&forward)
            .map(|(&j, &forward)| {
                let u = &self.joints[j];
                let mut edges: Vec<(usize, bool)> = u.edges.iter().map(|&e| (e, forward)).collect();
                if !forward {
                    edges.reverse();
                }
                Crossed { edges, pair: u.pair }
            })
            .collect();
        let sides = (0..n)
            .map(|i| {
                let (from, start) = side_of(self.graph, crossed[i].edges[crossed[i].edges.len() - 1], true);
                let (to, end) = side_of(self.graph, crossed[(i + 1) % n].edges[0], false);
                Arm { start, path: self.path(from, to), end }
            })
            .collect();
        let ground = self.find(0);
        let frame = (0..n).find(|&i| cluster[i] == ground).unwrap_or(0);
        Polygon { joints: crossed, sides, frame, plane: None }
    }

    /// Shortest way through known joints from one node of a cluster to another.
    fn path(&mut self, from: usize, to: usize) -> Vec<(usize, bool)> {
        if from == to {
            return Vec::new();
        }
        // away from the ground, which may have a thousand neighbours
        let (start, goal) = if from == 0 { (to, from) } else { (from, to) };
        self.now += 1;
        self.stamp[start] = self.now;
        // node, entry it was reached from, forward
        let mut tail = vec![(start, usize::MAX, 0usize, true)];
        let mut head = 0;
        'search: while head < tail.len() {
            let node = tail[head].0;
            for &e in &self.known_at[node] {
                let edge = &self.graph.edges[e];
                let (next, forward) = if edge.from == node { (edge.to, true) } else { (edge.from, false) };
                if self.stamp[next] == self.now {
                    continue;
                }
                self.stamp[next] = self.now;
                tail.push((next, head, e, forward));
                if next == goal {
                    break 'search;
                }
            }
            head += 1;
        }
        let mut back = Vec::new();
        let mut i = tail.len() - 1;
        while tail[i].1 != usize::MAX {
            back.push((tail[i].2, tail[i].3));
            i = tail[i].1;
        }
        if start == from {
            back.reverse();
        } else {
            back.iter_mut().for_each(|e| e.1 = !e.1);
        }
        back
    }

    /// Whether the side after the last joint keeps the axes of the last and the first joint as parallel as they are
    /// drawn.
    pub(super) fn keeps_parallel(&self, p: &Polygon) -> bool {
        let g = self.graph;
        let edges = |i: usize| p.joints[i].edges.iter().map(|e| &g.edges[e.0]);
        let Some(n) = edges(0).next().map(|e| e.axis) else { return false };
        let along = |e: &Edge| e.axis.cross(n).norm() < tolerance::PARALLEL;
        let fixed = |e: &Edge| (e.rest.apply(n) - n).norm() < tolerance::PARALLEL;
        let side = p.sides[p.joints.len() - 1].path.iter().map(|e| &g.edges[e.0]);
        edges(0).chain(edges(p.joints.len() - 1)).all(|e| along(e) && fixed(e))
            && side.into_iter().all(|e| fixed(e) && (matches!(e.kind, Kind::Slide | Kind::Rigid) || along(e)))
    }

    /// Whether all joints of the polygon and of its sides move in one plane. (They do in a planar mechanism.)
    pub(super) fn fits_a_plane(&self, p: &mut Polygon) -> bool {
        if self.planar {
            return true;
        }
        let g = self.graph;
        let mut edges: Vec<usize> = p.joints.iter().flat_map(|j| j.edges.iter().map(|e| e.0)).collect();
        edges.extend(p.sides.iter().flat_map(|s| s.path.iter().map(|e| e.0)));
        let turn = edges.iter().find(|&&e| g.edges[e].kind == Kind::Turn);
        let slides: Vec<Vec3<f64>> =
            edges.iter().filter(|&&e| g.edges[e].kind == Kind::Slide).map(|&e| g.edges[e].axis).collect();
        let across = || {
            slides
                .iter()
                .find_map(|a| slides[0].cross(*a).unit().filter(|_| slides[0].cross(*a).norm() > tolerance::DEPENDENT))
        };
        let Some(n) = turn.map(|&e| g.edges[e].axis).or_else(across) else { return false };
        let fits = edges.iter().all(|&e| {
            let e = &g.edges[e];
            let moves = match e.kind {
                Kind::Turn => e.axis.cross(n).norm() < tolerance::PARALLEL,
                Kind::Slide => e.axis.dot(n).abs() < tolerance::PARALLEL,
                Kind::Rigid => true,
                Kind::Ball => false,
            };
            moves && (e.rest.apply(n) - n).norm() < tolerance::PARALLEL
        });
        let (e1, e2) = n.complement();
        p.plane = Some([n, e1, e2]);
        fits
    }
}

/// Node at the near or far side of a crossed edge, and that side.
fn side_of(g: &Graph, (e, forward): (usize, bool), far: bool) -> (usize, Side) {
    let behind = forward == far;
    let node = if behind { g.edges[e].to } else { g.edges[e].from };
    (node, Side { edge: e, behind })
}

/// Angle of a rotation about the normal of a plane.
pub(super) fn turn_in<S: Scalar>(plane: &[Vec3<f64>; 3], r: &Mat3<S>) -> S {
    let x = r.apply(lift(plane[1]));
    x.dot(lift(plane[2])).atan2(x.dot(lift(plane[1])))
}
