//! The mechanism as a graph of elementary motions: tree joints and cut joints alike.

use super::arm::turn_of;
use crate::joint::Motion;
use crate::model::Model;
use crate::numbers::Numbers;
use crate::rows::Owner;
use partita_math::scalar::Scalar;
use partita_math::spatial::{Mat3, Vec3};

/// The free motion of an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Rotation about the axis.
    Turn,
    /// Translation along the axis.
    Slide,
    /// All turns.
    Ball,
    /// Nothing: a fixed joint that closes a loop.
    Rigid,
}

/// Where the coordinate of an edge is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Home {
    /// In q and v: a link of the tree.
    Tree {
        /// First coordinate.
        q: usize,
        /// First velocity.
        v: usize,
    },
    /// Nowhere: motion of this number of a joint that is cut.
    Cut(usize),
}

/// Position of an edge in the zero position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum EdgePoint {
    /// At the point of a link.
    Link(usize),
    /// At the point of a cut joint; after its last motion as the child carries it.
    Cut {
        /// Joint.
        joint: usize,
        /// Whether it is the last of the joint's motions.
        last: bool,
    },
}

impl EdgePoint {
    /// As `from` carries it, and as `to` does.
    pub fn points<S: Scalar>(self, numbers: &Numbers<S>) -> [Vec3<S>; 2] {
        match self {
            Self::Link(i) => [numbers.links[i]; 2],
            Self::Cut { joint, last } => {
                let (parent, child) = numbers.joints[joint];
                [parent, if last { child } else { parent }]
            }
        }
    }
}

/// One elementary motion between two nodes. Nodes carry the axes of the zero position:
///
/// ```text
/// turn:  R_to = R_from · R(axis, x) · rest,   the points coincide
/// slide: R_to = R_from · rest,                point on `to` = point on `from` + x · axis
/// ball:  R_to = R_from · B · rest,            the points coincide
/// ```
#[derive(Clone, Debug)]
pub(super) struct Edge {
    pub from: usize,
    pub to: usize,
    pub kind: Kind,
    /// In the axes of `from`.
    pub axis: Vec3<f64>,
    /// The joint's point in the zero position.
    pub point: EdgePoint,
    /// Constant rotation: the identity but for cut joints of open drawings.
    pub rest: Mat3<f64>,
    /// Its rotation about z: all of it where the mechanism is planar.
    pub turned: f64,
    pub home: Home,
    /// Joint of the description; none for a body that floats.
    pub joint: Option<usize>,
}

impl Edge {
    /// Velocities, if it belongs to the tree.
    pub fn velocities(&self) -> std::ops::Range<usize> {
        match (self.home, self.kind) {
            (Home::Tree { v, .. }, Kind::Ball) => v..v + 3,
            (Home::Tree { v, .. }, _) => v..v + 1,
            (Home::Cut(_), _) => 0..0,
        }
    }
    /// Whether its coordinate is one of q.
    pub fn in_tree(&self) -> bool {
        matches!(self.home, Home::Tree { .. })
    }
}

/// Links (node i is link i, 0 the ground), the inner nodes of cut joints after them, and all motions between them.
#[derive(Clone, Debug)]
pub(super) struct Graph {
    pub nodes: usize,
    pub edges: Vec<Edge>,
}

impl Graph {
    pub fn new(model: &Model) -> Self {
        let placed = &model.own.placed;
        let mut graph = Self { nodes: placed.links.len(), edges: Vec::new() };
        let mut joint_of = vec![None; placed.links.len()];
        for (j, p) in placed.joints.iter().enumerate() {
            for &link in p.links.iter().flatten() {
                joint_of[link] = Some(j);
            }
        }
        for (i, l) in placed.links.iter().enumerate().skip(1) {
            let (kind, axis) = kind_of(&l.motion, placed.planar);
            graph.edges.push(Edge {
                from: l.parent,
                to: i,
                kind,
                axis,
                point: EdgePoint::Link(i),
                rest: Mat3::identity(),
                turned: 0.0,
                home: Home::Tree { q: l.q, v: l.v },
                joint: joint_of[i],
            });
        }
        for &j in &placed.topology.cuts {
            if model.row_names[..model.closing_rows].iter().any(|r| r.owner == Owner::Joint(j)) {
                graph.add_cut(model, j);
            }
        }
        graph
    }

    /// The motions of a cut joint one after the other, with massless nodes between them.
    fn add_cut(&mut self, model: &Model, j: usize) {
        let placed = &model.own.placed;
        let p = &placed.joints[j];
        let (first, last) = (placed.link_of(p.parent), placed.link_of(p.child));
        let rest = p.on_parent.mul(&p.on_child.transpose());
        let count = p.shape.motions.len();
        let edge = |from, to, kind, axis, home| Edge {
            from,
            to,
            kind,
            axis,
            point: EdgePoint::Cut { joint: j, last: false },
            rest: Mat3::identity(),
            turned: 0.0,
            home,
            joint: Some(j),
        };
        if count == 0 {
            self.edges.push(edge(first, last, Kind::Rigid, Vec3::zero(), Home::Cut(0)));
        }
        let mut from = first;
        for (i, m) in p.shape.motions.iter().enumerate() {
            let to = if i + 1 == count {
                last
            } else {
                self.nodes += 1;
                self.nodes - 1
            };
            let (kind, axis) = kind_of(m, placed.planar);
            let axis = if *m == Motion::Ball { axis } else { p.on_parent.apply(axis) };
            self.edges.push(edge(from, to, kind, axis, Home::Cut(i)));
            from = to;
        }
        if let Some(e) = self.edges.last_mut() {
            e.point = EdgePoint::Cut { joint: j, last: true };
            (e.rest, e.turned) = (rest, turn_of(&rest));
        }
    }
}

/// In the plane a ball is a pin.
fn kind_of(m: &Motion, planar: bool) -> (Kind, Vec3<f64>) {
    match m {
        Motion::Turn(a) => (Kind::Turn, *a),
        Motion::Slide(a) => (Kind::Slide, *a),
        Motion::Ball if planar => (Kind::Turn, Vec3([0.0, 0.0, 1.0])),
        Motion::Ball => (Kind::Ball, Vec3::zero()),
    }
}
