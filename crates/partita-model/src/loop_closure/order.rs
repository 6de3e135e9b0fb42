//! In which order the loops can be closed: rigid clusters that grow by triangles.                              (L2)
//!
//! Every node starts as a cluster of its own. Joints whose coordinates are known merge the clusters they join. Three
//! clusters joined pairwise by one unknown joint each are a triangle: where its closed form is known, all three joints
//! become known and the clusters one. This does not depend on which joint of a loop is cut, nor on the ground. Two
//! clusters joined by two unknown joints (or one, twice over) close likewise. What remains is left to the implicit
//! blocks, after each of which further triangles may be found.

use super::graph::{Graph, Kind};
use super::laws::{SolvedLaw, TreeLaw};
use super::polygon::{Pair, Polygon, Unknown};
use partita_math::tolerance;
use std::collections::VecDeque;

/// What can be found next in closed form.
pub(super) enum Next {
    /// The joints of a polygon.
    Polygon(Polygon),
    /// A coordinate that a coupling gives.
    Law(SolvedLaw),
}

/// The clusters while they grow.
pub(super) struct Order<'g> {
    pub(super) graph: &'g Graph,
    laws: &'g [TreeLaw],
    pub(super) planar: bool,
    pub(super) joints: Vec<Unknown>,
    settled: Vec<bool>,
    known: Vec<bool>,
    /// Known edges at each node.
    pub(super) known_at: Vec<Vec<usize>>,
    root: Vec<usize>,
    /// Unknown joints at each cluster.
    at: Vec<Vec<usize>>,
    queue: VecDeque<usize>,
    deferred: VecDeque<usize>,
    /// Number of the search that last met each node, and the number of the current search.
    pub(super) stamp: Vec<u32>,
    pub(super) now: u32,
}

impl<'g> Order<'g> {
    /// With the edges whose coordinates are given, and the inputs among the velocities of balls, one bit each.
    pub fn new(graph: &'g Graph, laws: &'g [TreeLaw], planar: bool, given: &[bool], ball_inputs: &[u8]) -> Self {
        let mut order = Self {
            graph,
            laws,
            planar,
            joints: Vec::new(),
            settled: Vec::new(),
            known: vec![false; graph.edges.len()],
            known_at: vec![Vec::new(); graph.nodes],
            root: (0..graph.nodes).collect(),
            at: vec![Vec::new(); graph.nodes],
            queue: VecDeque::new(),
            deferred: VecDeque::new(),
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

    /// Unknown joints: in space the two motions of a universal or cylindrical joint are taken as one, if neither is
    /// given.
    fn group(&mut self, given: &[bool], ball_inputs: &[u8]) {
        let g = self.graph;
        let mut e = 0;
        while e < g.edges.len() {
            let edge = &g.edges[e];
            if given[e] || edge.kind == Kind::Rigid {
                e += 1;
                continue;
            }
            let pair = if self.planar || given.get(e + 1) != Some(&false) { None } else { pair_of(g, e) };
            let joint = match pair {
                Some(pair) => Unknown { ends: (edge.from, g.edges[e + 1].to), edges: vec![e, e + 1], pair },
                None => single(g, e, ball_inputs[e]),
            };
            e += joint.edges.len();
            self.joints.push(joint);
        }
    }

    pub(super) fn find(&mut self, mut i: usize) -> usize {
        while self.root[i] != i {
            self.root[i] = self.root[self.root[i]];
            i = self.root[i];
        }
        i
    }

    pub(super) fn ends(&mut self, j: usize) -> (usize, usize) {
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
            // joints inside a cluster are no longer counted
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

    /// Edges whose coordinates were found by another method.
    pub fn learned(&mut self, edges: &[usize]) {
        for j in 0..self.joints.len() {
            if self.settled[j] || !self.joints[j].edges.iter().any(|e| edges.contains(e)) {
                continue;
            }
            let rest: Vec<usize> = self.joints[j].edges.iter().copied().filter(|e| !edges.contains(e)).collect();
            match rest[..] {
                // of a joint treated as one the other motion remains alone
                [e] => self.joints[j] = single(self.graph, e, 0),
                _ => self.settle(j),
            }
        }
        edges.iter().for_each(|&e| self.learn(e));
    }

    /// Whether the coordinate of this edge is known.
    pub fn is_known(&self, e: usize) -> bool {
        self.known[e]
    }

    /// The next closed form.
    pub fn next(&mut self) -> Option<Next> {
        if let Some(found) = self.next_polygon() {
            return Some(Next::Polygon(found));
        }
        let found = self.laws.iter().find_map(|law| law.solved(|e| self.known[e]))?;
        self.learned(&[found.edge]);
        Some(Next::Law(found))
    }

    /// The next polygon that closes in closed form.
    fn next_polygon(&mut self) -> Option<Polygon> {
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
        matches!(self.joints[j].pair, Pair::Turn | Pair::Slide)
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

    /// Whether there is a closed form for this triangle.
    fn recognised(&mut self, three: [usize; 3]) -> Option<Polygon> {
        let slides = three.iter().filter(|&&j| self.joints[j].pair == Pair::Slide).count();
        if three.iter().all(|&j| self.is_elementary(j)) {
            let mut found = self.polygon(&three);
            return (slides < 3 && self.fits_a_plane(&mut found)).then_some(found);
        }
        // the characteristic pair: a link with a centre at one end, a centre or an axis at the other, and one more
        // joint
        let elementary = *three.iter().find(|&&j| self.is_elementary(j))?;
        let centres: Vec<usize> = three.iter().copied().filter(|&j| j != elementary).collect();
        let [a, b] = centres[..] else { return None };
        let (a, b) = if matches!(self.joints[a].pair, Pair::Ball { .. }) { (a, b) } else { (b, a) };
        let closed_form = match (self.joints[a].pair, self.joints[b].pair) {
            // the spin of the link about the line of its centres is an input of one of the balls
            (Pair::Ball { inputs: i }, Pair::Ball { inputs: j }) => i.count_ones() + j.count_ones() == 1,
            (Pair::Ball { inputs }, Pair::Universal | Pair::Cylindrical) => inputs == 0,
            _ => false,
        };
        if !closed_form {
            return None;
        }
        let found = self.polygon(&[elementary, a, b]);
        // the distance from an axis is of the first order in cosine and sine for turns about a parallel one only
        let first_order = self.joints[b].pair != Pair::Cylindrical
            || self.joints[elementary].pair == Pair::Slide
            || self.keeps_parallel(&found);
        first_order.then_some(found)
    }
}

/// Edge e as a joint of its own, with these inputs among the velocities of a ball.
fn single(g: &Graph, e: usize, inputs: u8) -> Unknown {
    let edge = &g.edges[e];
    let pair = match edge.kind {
        Kind::Slide => Pair::Slide,
        Kind::Ball => Pair::Ball { inputs },
        _ => Pair::Turn,
    };
    Unknown { ends: (edge.from, edge.to), edges: vec![e], pair }
}

/// Whether edge e and the next one are a universal or a cylindrical joint, with nothing else on the part between them.
fn pair_of(g: &Graph, e: usize) -> Option<Pair> {
    let (a, b) = (&g.edges[e], g.edges.get(e + 1)?);
    let joined = a.joint.is_some() && a.joint == b.joint && b.from == a.to && a.in_tree() == b.in_tree();
    let pair = match (a.kind, b.kind) {
        (Kind::Turn, Kind::Turn) => Pair::Universal,
        // between two motions of one joint there is no constant rotation: the axes can be compared
        (Kind::Slide, Kind::Turn) | (Kind::Turn, Kind::Slide) if a.axis.cross(b.axis).norm() < tolerance::PARALLEL => {
            Pair::Cylindrical
        }
        _ => return None,
    };
    let alone = || g.edges.iter().filter(|x| x.from == a.to || x.to == a.to).count() == 2;
    (joined && alone()).then_some(pair)
}
