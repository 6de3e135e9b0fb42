//! In which order the loops can be closed: rigid clusters that grow by triangles.                             (8.3)
//!
//! Every node starts as a cluster of its own. Joints whose coordinates are known merge the clusters they join. Three
//! clusters joined pairwise by one unknown joint each are a triangle: where its closed form is known, all three joints
//! become known and the clusters one. This does not depend on which joint of a loop is cut, nor on the ground. Two
//! clusters joined by two unknown joints (or one, twice over) close likewise. What remains is left to the implicit
//! blocks, after each of which further triangles may be found.

use super::arm::Arm;
use super::graph::{Graph, Kind};
use partita_math::spatial::{Mat3, Vec3};
use std::collections::VecDeque;

/// What an unknown joint lets free.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Freedom {
    Turn,
    Slide,
    /// So many of its velocities are inputs.
    Ball {
        inputs: u8,
    },
    /// Two turns about axes through one point.
    Universal,
}

/// A joint with unknown coordinates: edges one behind the other, from the first node to the second.
#[derive(Clone, Debug)]
pub(super) struct Unknown {
    pub ends: (usize, usize),
    pub edges: Vec<usize>,
    pub freedom: Freedom,
}

/// A joint as the walk around a polygon crosses it.
#[derive(Clone, Debug)]
pub(super) struct Crossed {
    /// Edges and their senses, in the order of the walk.
    pub edges: Vec<(usize, bool)>,
    pub freedom: Freedom,
}

/// Joints and the sides between them: side i leads from joint i to joint i + 1.
#[derive(Clone, Debug)]
pub(super) struct Polygon {
    pub joints: Vec<Crossed>,
    pub sides: Vec<Arm>,
    /// The side that is called the frame.
    pub frame: usize,
    /// Normal and two axes of its plane, where a planar polygon stands in space.
    pub plane: Option<[Vec3<f64>; 3]>,
}

/// The clusters while they grow.
pub(super) struct Order<'g> {
    graph: &'g Graph,
    planar: bool,
    pub joints: Vec<Unknown>,
    settled: Vec<bool>,
    known: Vec<bool>,
    known_at: Vec<Vec<usize>>,
    root: Vec<usize>,
    /// Unknown joints at each cluster.
    at: Vec<Vec<usize>>,
    queue: VecDeque<usize>,
    deferred: VecDeque<usize>,
    seen: Vec<(usize, usize, bool)>,
    stamp: Vec<u32>,
    now: u32,
}

impl<'g> Order<'g> {
    /// With the edges whose coordinates are given, and the numbers of inputs among the velocities of balls.
    pub fn new(graph: &'g Graph, planar: bool, given: &[bool], ball_inputs: &[u8]) -> Self {
        let mut order = Self {
            graph,
            planar,
            joints: Vec::new(),
            settled: Vec::new(),
            known: vec![false; graph.edges.len()],
            known_at: vec![Vec::new(); graph.nodes],
            root: (0..graph.nodes).collect(),
            at: vec![Vec::new(); graph.nodes],
            queue: VecDeque::new(),
            deferred: VecDeque::new(),
            seen: Vec::new(),
            stamp: vec![0; graph.nodes],
            now: 0,
        };
        order.group(given, ball_inputs);
        order.settled = vec![false; order.joints.len()];
        for (i, j) in order.joints.iter().enumerate() {
            order.at[j.ends.0].push(i);
            order.at[j.ends.1].push(i);
            order.queue.push_back(i);
        }
        for e in 0..graph.edges.len() {
            if given[e] || graph.edges[e].kind == Kind::Rigid {
                order.learn(e);
            }
        }
        order
    }

    /// Unknown joints: in space the two turns of a universal joint are taken as one, if neither is given.
    fn group(&mut self, given: &[bool], ball_inputs: &[u8]) {
        let g = self.graph;
        let mut e = 0;
        while e < g.edges.len() {
            let edge = &g.edges[e];
            if given[e] || edge.kind == Kind::Rigid {
                e += 1;
                continue;
            }
            let next = g.edges.get(e + 1);
            let universal = !self.planar
                && next.is_some_and(|n| {
                    edge.joint.is_some()
                        && n.joint == edge.joint
                        && n.from == edge.to
                        && n.in_tree() == edge.in_tree()
                        && (edge.kind, n.kind) == (Kind::Turn, Kind::Turn)
                        && !given[e + 1]
                        // nothing else may be held by the part between them
                        && g.edges.iter().filter(|x| x.from == edge.to || x.to == edge.to).count() == 2
                });
            let freedom = match edge.kind {
                _ if universal => Freedom::Universal,
                Kind::Slide => Freedom::Slide,
                Kind::Ball => Freedom::Ball { inputs: ball_inputs[e] },
                _ => Freedom::Turn,
            };
            let edges: Vec<usize> = if universal { vec![e, e + 1] } else { vec![e] };
            let last = edges[edges.len() - 1];
            e = last + 1;
            self.joints.push(Unknown { ends: (g.edges[edges[0]].from, g.edges[last].to), edges, freedom });
        }
    }

    fn find(&mut self, mut i: usize) -> usize {
        while self.root[i] != i {
            self.root[i] = self.root[self.root[i]];
            i = self.root[i];
        }
        i
    }

    fn ends(&mut self, j: usize) -> (usize, usize) {
        let (a, b) = self.joints[j].ends;
        (self.find(a), self.find(b))
    }

    /// An edge has become known: its nodes are one cluster.
    fn learn(&mut self, e: usize) {
        if std::mem::replace(&mut self.known[e], true) {
            return;
        }
        let edge = &self.graph.edges[e];
        self.known_at[edge.from].push(e);
        self.known_at[edge.to].push(e);
        let (a, b) = (self.find(edge.from), self.find(edge.to));
        if a == b {
            return;
        }
        let (big, small) = if self.at[a].len() >= self.at[b].len() { (a, b) } else { (b, a) };
        self.root[small] = big;
        for j in std::mem::take(&mut self.at[small]) {
            if !self.settled[j] {
                self.at[big].push(j);
                self.queue.push_back(j);
            }
        }
        if self.at[big].len() > 32 {
            // joints inside count no longer
            let settled = &self.settled;
            self.at[big].retain(|&j| !settled[j]);
        }
    }

    /// Joint j is known as a whole.
    fn settle(&mut self, j: usize) {
        self.settled[j] = true;
        for e in self.joints[j].edges.clone() {
            self.learn(e);
        }
    }

    /// Edges whose coordinates were found by other means.
    pub fn learned(&mut self, edges: &[usize]) {
        for j in 0..self.joints.len() {
            if !self.settled[j] && self.joints[j].edges.iter().all(|e| edges.contains(e)) {
                self.settle(j);
            }
        }
        edges.iter().for_each(|&e| self.learn(e));
    }

    /// Is the coordinate of this edge known by now?
    pub fn is_known(&self, e: usize) -> bool {
        self.known[e]
    }

    /// The next polygon that closes in closed form.
    pub fn next_polygon(&mut self) -> Option<Polygon> {
        while let Some(j) = self.queue.pop_front() {
            if self.settled[j] {
                continue;
            }
            let (x, y) = self.ends(j);
            let cut = self.joints[j].edges.iter().all(|&e| !self.graph.edges[e].in_tree());
            if x == y && cut {
                self.settled[j] = true; // a cut joint between parts that are in place: nobody needs its coordinate
                continue;
            }
            if let Some(found) = self.triangle_with(j) {
                self.queue.push_front(j);
                return Some(found);
            }
            self.deferred.push_back(j);
        }
        while let Some(j) = self.deferred.pop_front() {
            if self.settled[j] || !self.is_elementary(j) {
                continue;
            }
            if let Some(found) = self.pair_with(j) {
                return Some(found);
            }
        }
        None
    }

    fn is_elementary(&self, j: usize) -> bool {
        matches!(self.joints[j].freedom, Freedom::Turn | Freedom::Slide)
    }

    fn triangle_with(&mut self, j: usize) -> Option<Polygon> {
        let (x, y) = self.ends(j);
        if x == y {
            return None;
        }
        let (near, far) = if self.at[x].len() <= self.at[y].len() { (x, y) } else { (y, x) };
        for second in self.at[near].clone() {
            if second == j || self.settled[second] {
                continue;
            }
            let (a, b) = self.ends(second);
            let z = if a == near { b } else { a };
            if z == near || z == far {
                continue;
            }
            let meeting = if self.at[z].len() <= self.at[far].len() { z } else { far };
            for third in self.at[meeting].clone() {
                if third == j || third == second || self.settled[third] {
                    continue;
                }
                let (a, b) = self.ends(third);
                if (a, b) != (z, far) && (b, a) != (z, far) {
                    continue;
                }
                if let Some(found) = self.recognised([j, second, third]) {
                    for i in [j, second, third] {
                        self.settle(i);
                    }
                    return Some(found);
                }
            }
        }
        None
    }

    /// Two joints between two clusters, or one within a cluster, in the plane.
    fn pair_with(&mut self, j: usize) -> Option<Polygon> {
        let (x, y) = self.ends(j);
        let mut joints = vec![j];
        if x != y {
            let (near, far) = if self.at[x].len() <= self.at[y].len() { (x, y) } else { (y, x) };
            let mut second = None;
            for i in self.at[near].clone() {
                if i != j && !self.settled[i] && self.is_elementary(i) {
                    let (a, b) = self.ends(i);
                    if (a, b) == (near, far) || (b, a) == (near, far) {
                        second = Some(i);
                        break;
                    }
                }
            }
            joints.push(second?);
        }
        let mut found = self.polygon(&joints);
        self.fits_a_plane(&mut found).then(|| {
            joints.iter().for_each(|&i| self.settle(i));
            found
        })
    }

    /// Is there a closed form for this triangle?
    fn recognised(&mut self, three: [usize; 3]) -> Option<Polygon> {
        let slides = three.iter().filter(|&&j| self.joints[j].freedom == Freedom::Slide).count();
        if three.iter().all(|&j| self.is_elementary(j)) {
            let mut found = self.polygon(&three);
            return (slides < 3 && self.fits_a_plane(&mut found)).then_some(found);
        }
        // the characteristic pair: a link held in two centres, and one joint more
        let elementary = *three.iter().find(|&&j| self.is_elementary(j))?;
        let centres: Vec<usize> = three.iter().copied().filter(|&j| j != elementary).collect();
        let [a, b] = centres[..] else { return None };
        let (a, b) = if self.joints[a].freedom == Freedom::Universal { (b, a) } else { (a, b) };
        let closed_form = match (self.joints[a].freedom, self.joints[b].freedom) {
            // the spin of the link about the line of its centres is an input of one of the balls
            (Freedom::Ball { inputs: i }, Freedom::Ball { inputs: j }) => i + j == 1,
            (Freedom::Ball { inputs }, Freedom::Universal) => inputs == 0,
            _ => false,
        };
        closed_form.then(|| self.polygon(&[elementary, a, b]))
    }

    /// The polygon of these joints in this order.
    fn polygon(&mut self, joints: &[usize]) -> Polygon {
        let n = joints.len();
        let ends: Vec<(usize, usize)> = joints.iter().map(|&j| self.ends(j)).collect();
        let shared = |a: (usize, usize), b: (usize, usize)| if a.0 == b.0 || a.0 == b.1 { a.0 } else { a.1 };
        // the cluster behind joint i
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
                Crossed { edges, freedom: u.freedom }
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
        self.seen.clear();
        let mut i = tail.len() - 1;
        while tail[i].1 != usize::MAX {
            self.seen.push((i, tail[i].2, tail[i].3));
            i = tail[i].1;
        }
        if start == from {
            self.seen.iter().rev().map(|&(_, e, f)| (e, f)).collect()
        } else {
            self.seen.iter().map(|&(_, e, f)| (e, !f)).collect()
        }
    }

    /// Do all joints of the polygon and of its sides move in one plane? (They do in a planar mechanism.)
    fn fits_a_plane(&self, p: &mut Polygon) -> bool {
        if self.planar {
            return true;
        }
        let g = self.graph;
        let mut edges: Vec<usize> = p.joints.iter().flat_map(|j| j.edges.iter().map(|e| e.0)).collect();
        edges.extend(p.sides.iter().flat_map(|s| s.path.iter().map(|e| e.0)));
        let turn = edges.iter().find(|&&e| g.edges[e].kind == Kind::Turn);
        let slides: Vec<Vec3<f64>> =
            edges.iter().filter(|&&e| g.edges[e].kind == Kind::Slide).map(|&e| g.edges[e].axis).collect();
        let across = || slides.iter().find_map(|a| slides[0].cross(*a).unit().filter(|_| slides[0].cross(*a).norm() > 1e-6));
        let Some(n) = turn.map(|&e| g.edges[e].axis).or_else(across) else { return false };
        // 1e-12: axes are given in double precision and turned a few times
        let fits = edges.iter().all(|&e| {
            let e = &g.edges[e];
            let moves = match e.kind {
                Kind::Turn => e.axis.cross(n).norm() < 1e-12,
                Kind::Slide => e.axis.dot(n).abs() < 1e-12,
                Kind::Rigid => true,
                Kind::Ball => false,
            };
            moves && (e.rest.apply(n) - n).norm() < 1e-12
        });
        let (e1, e2) = n.complement();
        p.plane = Some([n, e1, e2]);
        fits
    }
}

/// Node and point at the near or far side of a crossed edge.
fn side_of(g: &Graph, (e, forward): (usize, bool), far: bool) -> (usize, Vec3<f64>) {
    let edge = &g.edges[e];
    if forward == far {
        (edge.to, edge.at_to)
    } else {
        (edge.from, edge.at_from)
    }
}

/// Angle of a turn about the normal of a plane.
pub(super) fn turn_in(plane: &[Vec3<f64>; 3], r: &Mat3<f64>) -> f64 {
    let x = r.apply(plane[1]);
    x.dot(plane[2]).atan2(x.dot(plane[1]))
}
