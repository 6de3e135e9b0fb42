//! Bodies and joints as a graph: a spanning tree, and the joints cut to open the loops.
//!
//! Which joints stay: first those that must (driven, loaded along a coordinate, `cut = "never"`), then those with the
//! fewest degrees of freedom, then those nearest to the ground, then by order of description. So the tree is shallow,
//! the loops are short, and equal descriptions give equal trees.

use std::collections::BTreeSet;

/// Class of a joint that can only close loops: a body without another joint floats.
pub const CUT: u8 = 3;

/// One edge of the graph. Node 0 is the ground, body i is node i + 1.
#[derive(Clone, Copy, Debug)]
pub struct Edge {
    /// Parent node as described.
    pub parent: usize,
    /// Child node as described.
    pub child: usize,
    /// 0: must stay, 1: no preference, 2: should be cut, [`CUT`]: is always cut.
    pub class: u8,
    /// Velocities the joint allows.
    pub dof: usize,
}

/// An edge of the tree, directed away from the ground.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TreeEdge {
    /// Joint, or `None` for a floating body.
    pub joint: Option<usize>,
    /// Node nearer to the ground.
    pub from: usize,
    /// Node farther away.
    pub to: usize,
    /// Whether it is traversed against the description (from child to parent).
    pub reversed: bool,
}

/// Tree and cuts.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Topology {
    /// Every node but the ground once, parents first.
    pub tree: Vec<TreeEdge>,
    /// Joints cut, ascending.
    pub cuts: Vec<usize>,
}

impl Topology {
    /// Grow the tree from the ground.
    pub fn new(nodes: usize, edges: &[Edge]) -> Self {
        let mut incident: Vec<Vec<usize>> = vec![Vec::new(); nodes];
        for (i, e) in edges.iter().enumerate() {
            incident[e.parent].push(i);
            incident[e.child].push(i);
        }
        let mut depth = vec![usize::MAX; nodes];
        let mut in_tree = vec![false; edges.len()];
        let mut tree = Vec::with_capacity(nodes.saturating_sub(1));
        // candidates ordered by (class, degrees of freedom, depth of the inner node, joint)
        let mut open: BTreeSet<(u8, usize, usize, usize)> = BTreeSet::new();
        let mut next_floating = 1;
        depth[0] = 0;
        let mut newest = 0;
        loop {
            for &i in &incident[newest] {
                let e = &edges[i];
                if e.class < CUT && (depth[e.parent] == usize::MAX || depth[e.child] == usize::MAX) {
                    open.insert((e.class, e.dof, depth[newest], i));
                }
            }
            let mut grown = None;
            while let Some((_, _, _, i)) = open.pop_first() {
                let e = &edges[i];
                let (inner, outer) =
                    if depth[e.parent] != usize::MAX { (e.parent, e.child) } else { (e.child, e.parent) };
                if depth[outer] != usize::MAX {
                    continue; // both ends are held by now: this joint closes a loop
                }
                depth[outer] = depth[inner] + 1;
                in_tree[i] = true;
                tree.push(TreeEdge { joint: Some(i), from: inner, to: outer, reversed: inner == e.child });
                grown = Some(outer);
                break;
            }
            newest = match grown {
                Some(node) => node,
                None => {
                    while next_floating < nodes && depth[next_floating] != usize::MAX {
                        next_floating += 1;
                    }
                    if next_floating == nodes {
                        break;
                    }
                    depth[next_floating] = 1;
                    tree.push(TreeEdge { joint: None, from: 0, to: next_floating, reversed: false });
                    next_floating
                }
            };
        }
        let cuts = (0..edges.len()).filter(|&i| !in_tree[i]).collect();
        Self { tree, cuts }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn edge(parent: usize, child: usize) -> Edge {
        Edge { parent, child, class: 1, dof: 1 }
    }

    /// What every tree must satisfy, whatever the graph.
    fn check(nodes: usize, edges: &[Edge], t: &Topology) {
        let mut held = vec![false; nodes];
        held[0] = true;
        for e in &t.tree {
            assert!(held[e.from], "a parent comes after its child");
            assert!(!std::mem::replace(&mut held[e.to], true), "a body is held twice");
            if let Some(j) = e.joint {
                let d = &edges[j];
                let walked = if e.reversed { (d.child, d.parent) } else { (d.parent, d.child) };
                assert_eq!(walked, (e.from, e.to));
            }
        }
        assert!(held.iter().all(|h| *h));
        let joints_in_tree = t.tree.iter().filter(|e| e.joint.is_some()).count();
        assert_eq!(joints_in_tree + t.cuts.len(), edges.len());
    }

    /// ```text
    ///        j1
    ///   {1} ---- {2}        tree: {0} -> {1}, {0} -> {3}, {1} -> {2}
    /// j0 |        . j2      loop: joint j2 is cut
    ///   {0} ---- {3}
    ///        j3
    /// ```
    #[test]
    fn a_four_bar_is_cut_away_from_the_ground() {
        let edges = [edge(0, 1), edge(1, 2), edge(2, 3), edge(0, 3)];
        let t = Topology::new(4, &edges);
        check(4, &edges, &t);
        assert_eq!(t.cuts, [2]);
    }

    /// ```text
    ///        j1
    ///   {1} .... {2}        j2 and j3 must stay: then j1, farther from the ground than j0, is cut
    /// j0 |        | j2
    ///   {0} ---- {3}
    ///        j3
    /// ```
    #[test]
    fn a_joint_that_must_stay_is_not_cut() {
        let mut edges = [edge(0, 1), edge(1, 2), edge(2, 3), edge(3, 0)];
        edges[2].class = 0;
        edges[3].class = 0;
        let t = Topology::new(4, &edges);
        check(4, &edges, &t);
        assert_eq!(t.cuts, [1]);
        assert!(t.tree.iter().any(|e| e.joint == Some(2) && e.reversed));
    }

    /// ```text
    ///   {0}   {1} ---- {2}     nothing holds {1}: it floats, and carries {2}
    ///              j0
    /// ```
    #[test]
    fn a_body_without_a_joint_floats() {
        let edges = [edge(1, 2)];
        let t = Topology::new(3, &edges);
        check(3, &edges, &t);
        assert_eq!(t.tree[0].joint, None);
        assert!(t.cuts.is_empty());
    }

    #[test]
    fn random_graphs_keep_the_invariants() {
        let mut rng = fastrand::Rng::with_seed(5);
        for _ in 0..300 {
            let nodes = rng.usize(1..12);
            let edges: Vec<Edge> = (0..rng.usize(0..20))
                .filter_map(|_| {
                    let (a, b) = (rng.usize(0..nodes), rng.usize(0..nodes));
                    (a != b).then(|| Edge { parent: a, child: b, class: rng.u8(0..4), dof: rng.usize(0..4) })
                })
                .collect();
            check(nodes, &edges, &Topology::new(nodes, &edges));
        }
    }
}
