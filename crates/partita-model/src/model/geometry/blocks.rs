//! Blocks of coupled loops, separated from each other.
//!
//! Bodies are nodes and joints are edges between them. Loops that share no more than one body move independently of
//! each other relative to that body. So a drawing is judged block by block, each between its own bodies, measured in
//! lengths of its own, relative to the body that connects it to the ground. A joint that closes no loop is in no block,
//! and neither is anything attached through it alone.

use crate::lengths::diameter;
use crate::model::Model;
use crate::spec::{Coupling, Joint, Spec};
use crate::tree::LinkMotion;
use crate::validate::GROUND;
use partita_math::spatial::{Mat3, Vec3};
use partita_math::tolerance;
use std::collections::{BTreeMap, BTreeSet, HashMap};

/// Displacement of a body from its drawn pose: x becomes `turn` x + `shift`.
#[derive(Clone, Copy)]
pub(super) struct Moved {
    pub(super) turn: Mat3<f64>,
    shift: Vec3<f64>,
}

impl Moved {
    fn nowhere() -> Self {
        Self { turn: Mat3::identity(), shift: Vec3::zero() }
    }

    pub(super) fn of(&self, point: Vec3<f64>) -> Vec3<f64> {
        self.turn.apply(point) + self.shift
    }

    /// This displacement relative to a body that has moved itself.
    pub(super) fn seen_from(&self, base: &Self) -> Self {
        let back = base.turn.transpose();
        Self { turn: back.mul(&self.turn), shift: back.apply(self.shift - base.shift) }
    }
}

/// Displacements of all bodies, by name.
pub(super) struct Pose(HashMap<String, Moved>);

impl Pose {
    pub(super) fn of(&self, body: &str) -> Moved {
        self.0.get(body).copied().unwrap_or(Moved::nowhere())
    }

    /// Relative to a body.
    pub(super) fn seen_from(&self, body: Option<&str>) -> Self {
        let base = body.map_or(Moved::nowhere(), |x| self.of(x));
        Self(self.0.iter().map(|(name, x)| (name.clone(), x.seen_from(&base))).collect())
    }
}

/// Loops that share more than a body, as free bodies between joints.
pub(super) struct Block {
    /// Its joints, ascending, by their numbers in the whole mechanism.
    pub(super) joints: Vec<usize>,
    /// The mechanism of these loops alone.
    pub(super) spec: Spec,
    /// Whether it has degrees of freedom as a whole. Then no body is its reference.
    pub(super) floats: bool,
    /// The reference body, if that is not the ground.
    pub(super) base: Option<String>,
}

/// A mechanism, split into blocks.
pub(super) struct Blocks {
    pub(super) blocks: Vec<Block>,
    /// Joints that close no loop.
    pub(super) free: Vec<usize>,
    /// Sets of bodies that are not connected to the ground.
    pub(super) afloat: usize,
}

/// The blocks of a mechanism as it is drawn. Cost: proportional to bodies and joints.
pub(super) fn blocks(spec: &Spec) -> Blocks {
    let index = nodes(spec);
    let node = |name: &str| index.get(name).copied().unwrap_or(0);
    let lines = lines(spec, &index);
    let taken = taken_apart(spec.bodies.len() + 1, &lines);
    let mut found = Blocks { blocks: Vec::new(), free: Vec::new(), afloat: taken.afloat };
    // couplings by a body they connect: the bodies of one coupling form one block
    let mut of_body: Vec<Vec<usize>> = vec![Vec::new(); if spec.couplings.is_empty() { 0 } else { index.len() + 1 }];
    for (i, c) in spec.couplings.iter().enumerate() {
        for body in spec.joined_by(c).into_iter().map(node).collect::<BTreeSet<_>>() {
            of_body[body].push(i);
        }
    }
    for part in taken.parts {
        let joints: Vec<usize> = part.lines.iter().copied().filter(|i| *i < spec.joints.len()).collect();
        if let ([only], 1) = (joints.as_slice(), part.lines.len()) {
            found.free.push(*only);
            continue;
        }
        let own: BTreeSet<usize> = part.lines.iter().flat_map(|&i| lines[i]).collect();
        let near: BTreeSet<usize> = own.iter().flat_map(|&i| of_body.get(i).into_iter().flatten().copied()).collect();
        let held = |i: &usize| spec.joined_by(&spec.couplings[*i]).iter().all(|x| own.contains(&node(x)));
        let couplings: Vec<Coupling> = near.into_iter().filter(held).map(|i| spec.couplings[i].clone()).collect();
        // points of conditions are fixed to bodies: the ground represents none of them
        let base = part.from.filter(|x| *x == 0 || couplings.is_empty());
        let of_base = |i: &usize| *i == 0 || Some(*i) == base;
        let mut drawn = Spec {
            partita: spec.partita,
            name: spec.name.clone(),
            gravity: [0.0; 3],
            drawing_tolerance: spec.drawing_tolerance,
            bodies: own.iter().filter(|i| !of_base(i)).map(|i| spec.bodies[i - 1].clone()).collect(),
            joints: joints.iter().map(|&j| spec.joints[j].clone()).collect(),
            couplings,
            drives: Vec::new(),
            forces: Vec::new(),
            rotors: Vec::new(),
            sights: Vec::new(),
            parting: BTreeMap::new(),
        };
        for joint in &mut drawn.joints {
            for end in [&mut joint.parent, &mut joint.child] {
                if Some(node(end)) == base {
                    *end = GROUND.into();
                }
            }
        }
        let from = base.filter(|x| *x > 0).map(|x| spec.bodies[x - 1].name.clone());
        found.blocks.push(Block { joints, spec: drawn, floats: base.is_none(), base: from });
    }
    found
}

/// The joints of each block. Cost: proportional to bodies and joints.
pub(super) fn joints_of_blocks(spec: &Spec) -> Vec<Vec<usize>> {
    let taken = taken_apart(spec.bodies.len() + 1, &lines(spec, &nodes(spec)));
    let rings = taken.parts.into_iter().map(|x| x.lines).filter(|x| x.len() > 1);
    rings.map(|x| x.into_iter().filter(|i| *i < spec.joints.len()).collect()).collect()
}

impl Model {
    /// Displacements of all bodies.
    pub(super) fn pose(&self, q: &[f64]) -> Pose {
        let mut s = self.own.full.scratch();
        self.own.full.poses(q, &mut s);
        let out = self.own.placed.basis;
        let mut all = HashMap::new();
        for (own, body) in self.own.placed.bodies.iter().zip(&self.spec.bodies) {
            let rot = Mat3(body.orientation);
            let turned: Mat3<f64> = out.transpose().mul(&s.links[own.link].rot).mul(&own.rot);
            let com = self.own.full.reference_point(own.link, &s)
                + s.links[own.link].rot.apply(own.com - self.own.reference()[own.link]);
            let turn = turned.mul(&rot.transpose());
            let drawn = Vec3(body.position) + rot.apply(Vec3(body.com));
            all.insert(body.name.clone(), Moved { turn, shift: out.apply_transposed(com) - turn.apply(drawn) });
        }
        Pose(all)
    }

    /// Coordinates of these free bodies in a pose.
    pub(super) fn coordinates_in(&self, pose: &Pose) -> Vec<f64> {
        let mut q = self.initial();
        for (body, drawn) in self.spec.bodies.iter().enumerate() {
            let moved = pose.of(&drawn.name);
            let com = Vec3(drawn.position) + Mat3(drawn.orientation).apply(Vec3(drawn.com));
            self.place_floating(body, moved.of(com) - com, &moved.turn, 0.0, &mut q);
        }
        q
    }

    /// The length of this block at q; that of the whole where conditions do not act on bodies.
    pub(super) fn length_at(&self, q: &[f64]) -> Option<f64> {
        if !self.spec.couplings.is_empty() {
            return None;
        }
        let is_rigid = |i: usize| self.own.placed.joints[i].shape.mobility() == 0;
        let pose = self.pose(q);
        length(&self.spec, is_rigid, |name| pose.of(name))
    }

    /// Measure displacements in fractions of this length.
    pub(super) fn measure_in(&mut self, length: f64) {
        for l in self.own.full.links.iter().skip(1).filter(|l| matches!(l.motion, LinkMotion::Slide(_))) {
            self.structure.velocities[l.v].displacement = length;
        }
        let closings = self.structure.rows[..self.closing_rows].iter_mut();
        closings.filter(|row| !row.is_angle).for_each(|row| row.displacement = Some(length));
    }
}

/// The number of each body; the ground's is 0.
fn nodes(spec: &Spec) -> HashMap<&str, usize> {
    spec.bodies.iter().enumerate().map(|(i, b)| (b.name.as_str(), i + 1)).collect()
}

/// Joints as edges between bodies, in their order, followed by the edges of conditions.
fn lines(spec: &Spec, index: &HashMap<&str, usize>) -> Vec<[usize; 2]> {
    let node = |name: &str| index.get(name).copied().unwrap_or(0);
    // a joint that is apart connects nothing: a line from the ground to itself is on no ring
    let ends = |j: &Joint| if spec.is_apart(j) { [0, 0] } else { [node(&j.parent), node(&j.child)] };
    let mut lines: Vec<[usize; 2]> = spec.joints.iter().map(ends).collect();
    for c in &spec.couplings {
        // the bodies of a condition form one block: a ring of edges through them
        let held: Vec<usize> = spec.joined_by(c).into_iter().map(node).collect::<BTreeSet<_>>().into_iter().collect();
        lines.extend((0..held.len()).map(|i| [held[i], held[(i + 1) % held.len()]]).filter(|x| x[0] != x[1]));
    }
    lines
}

/// Half of the total extent of bodies belongs to bodies of this diameter or more, as placed: a slider extends from one
/// end of its rail to the other, and bodies fixed to each other count as one. A beam between two small carriages is as
/// long as their travel, which the median of three would not show.
fn length(spec: &Spec, is_rigid: impl Fn(usize) -> bool, moved: impl Fn(&str) -> Moved) -> Option<f64> {
    let index = nodes(spec);
    let node = |name: &str| index.get(name).copied().unwrap_or(0);
    // the first of those that are fixed to each other, the ground before all
    let mut first: Vec<usize> = (0..=spec.bodies.len()).collect();
    for j in spec.joints.iter().enumerate().filter(|x| is_rigid(x.0)).map(|x| x.1) {
        let (a, b) = (first[node(&j.parent)], first[node(&j.child)]);
        first.iter_mut().filter(|x| **x == a.max(b)).for_each(|x| *x = a.min(b));
    }
    let mut points: Vec<Vec<Vec3<f64>>> = vec![Vec::new(); first.len()];
    for (body, &own) in spec.bodies.iter().zip(&first[1..]) {
        let com = Vec3(body.position) + Mat3(body.orientation).apply(Vec3(body.com));
        points[own].push(moved(&body.name).of(com));
    }
    for j in &spec.joints {
        let ends = [moved(&j.parent).of(Vec3(j.point)), moved(&j.child).of(Vec3(j.child_point.unwrap_or(j.point)))];
        let sides = BTreeSet::from([first[node(&j.parent)], first[node(&j.child)]]);
        sides.into_iter().for_each(|own| points[own].extend(ends));
    }
    let mut extents: Vec<f64> = points[1..].iter().filter(|x| !x.is_empty()).map(|x| diameter(x)).collect();
    let largest = extents.iter().fold(0.0, |m: f64, x| m.max(*x));
    extents.retain(|x| *x > tolerance::EQUAL * largest && x.is_finite());
    extents.sort_by(f64::total_cmp);
    let mut left = 0.5 * extents.iter().sum::<f64>();
    extents.into_iter().find(|x| {
        left -= x;
        left <= 0.0
    })
}

/// Edges that lie on common rings.
struct Part {
    lines: Vec<usize>,
    /// The node that connects them to the ground, if there is one.
    from: Option<usize>,
}

struct Taken {
    parts: Vec<Part>,
    /// Number of sets of nodes that are not connected to the ground.
    afloat: usize,
}

/// A graph, node 0 the ground, split by common rings: an edge on no ring is a part by itself.
fn taken_apart(nodes: usize, lines: &[[usize; 2]]) -> Taken {
    let mut at: Vec<Vec<usize>> = vec![Vec::new(); nodes];
    for (i, ends) in lines.iter().enumerate() {
        ends.iter().for_each(|&x| at[x].push(i));
    }
    let (mut order, mut lowest) = (vec![usize::MAX; nodes], vec![usize::MAX; nodes]);
    let mut taken = Taken { parts: Vec::new(), afloat: 0 };
    let mut count = 0;
    for root in 0..nodes {
        if order[root] != usize::MAX {
            continue;
        }
        taken.afloat += usize::from(root != 0);
        (order[root], lowest[root]) = (count, count);
        count += 1;
        let mut waiting: Vec<usize> = Vec::new();
        // node, the line that led there, and which of its lines is next: depth first, without recursion
        let mut path: Vec<(usize, usize, usize)> = vec![(root, usize::MAX, 0)];
        while let Some((node, by, next)) = path.pop() {
            if let Some(&line) = at[node].get(next) {
                path.push((node, by, next + 1));
                let [a, b] = lines[line];
                let other = a + b - node;
                if line == by || order[other] != usize::MAX && order[other] > order[node] {
                    continue; // from where it came, or seen from the other end
                }
                waiting.push(line);
                if order[other] != usize::MAX {
                    lowest[node] = lowest[node].min(order[other]);
                    continue;
                }
                (order[other], lowest[other]) = (count, count);
                count += 1;
                path.push((other, line, 0));
                continue;
            }
            let Some(&(above, ..)) = path.last() else { continue };
            lowest[above] = lowest[above].min(lowest[node]);
            if lowest[node] < order[above] {
                continue;
            }
            let first = waiting.iter().rposition(|&i| i == by).unwrap_or(0);
            let mut own = waiting.split_off(first);
            own.sort_unstable();
            // a floating part has no reference body; parts attached to it refer to the body of attachment
            let floats = root != 0 && above == root;
            taken.parts.push(Part { lines: own, from: (!floats).then_some(above) });
        }
    }
    taken
}

#[cfg(test)]
mod tests {
    use super::*;

    type PartLines = (Vec<usize>, Option<usize>);

    fn parts(nodes: usize, lines: &[[usize; 2]]) -> (Vec<PartLines>, usize) {
        let taken = taken_apart(nodes, lines);
        let mut parts: Vec<_> = taken.parts.into_iter().map(|x| (x.lines, x.from)).collect();
        parts.sort();
        (parts, taken.afloat)
    }

    #[test]
    fn a_ring_a_tail_and_a_ring_on_it() {
        // ground 0-1-2-0, a line 2-3, a ring 3-4-5-3, two lines between 5 and 6
        let lines = [[0, 1], [1, 2], [2, 0], [2, 3], [3, 4], [4, 5], [5, 3], [5, 6], [6, 5]];
        let (found, afloat) = parts(7, &lines);
        assert_eq!(afloat, 0);
        let of = [(vec![0, 1, 2], 0), (vec![3], 2), (vec![4, 5, 6], 3), (vec![7, 8], 5)];
        assert_eq!(found, of.map(|(x, from)| (x, Some(from))).to_vec());
    }

    #[test]
    fn rings_that_share_a_body_are_two_and_rings_that_share_a_bar_are_one() {
        let eight = [[0, 1], [1, 2], [2, 0], [0, 3], [3, 4], [4, 0]];
        assert_eq!(parts(5, &eight).0, vec![(vec![0, 1, 2], Some(0)), (vec![3, 4, 5], Some(0))]);
        let shared = [[0, 1], [1, 2], [2, 0], [1, 3], [3, 2]];
        assert_eq!(parts(4, &shared).0, vec![(vec![0, 1, 2, 3, 4], Some(0))]);
    }

    #[test]
    fn what_floats_is_seen_from_nowhere() {
        let lines = [[1, 2], [2, 3], [3, 1], [3, 4]];
        let (found, afloat) = parts(6, &lines);
        assert_eq!(afloat, 2); // the ring with its tail, and a body alone
        assert_eq!(found, vec![(vec![0, 1, 2], None), (vec![3], Some(3))]);
    }

    #[test]
    fn a_long_chain_is_no_deep_recursion() {
        let n = 200_000;
        let lines: Vec<[usize; 2]> = (0..n).map(|i| [i, i + 1]).collect();
        assert_eq!(taken_apart(n + 1, &lines).parts.len(), n);
    }
}
