//! M with its own sparsity: two velocities are coupled where a link of one is an ancestor of a link of the other.
//!
//! Absolute coordinates have a block for each body; in joint coordinates the entries are those between the velocities
//! of one chain of ancestors. The pattern is determined once, and an evaluation writes the entries in its order.

use crate::tree::{LinkMotion, Tree, TreeScratch};
use partita_math::elimination::Pattern;
use partita_math::scalar::Scalar;
use partita_math::spatial::Space;
use std::ops::Range;

/// Positions of the entries of M, and the paths through the tree that produce them.
#[derive(Clone, Debug, Default)]
pub(crate) struct MassLayout {
    /// Of M (nv x nv), both triangles.
    pub pattern: Pattern,
    /// Descendants of each link, itself first, one list after the other.
    outboard: Vec<u32>,
    /// Where the list of each link starts.
    starts: Vec<usize>,
    /// Indices of (i, j) and of (j, i), in the order in which an evaluation meets them.
    entries: Vec<[u32; 2]>,
    /// Indices of the diagonal.
    diagonal: Vec<u32>,
}

fn velocities<G: Space>(tree: &Tree<G>, link: usize) -> Range<usize> {
    let l = &tree.links[link];
    l.v..l.v + if matches!(l.motion, LinkMotion::Ball) { 3 } else { 1 }
}

impl MassLayout {
    /// For the links of a tree.
    pub fn new<G: Space>(tree: &Tree<G>) -> Self {
        let n = tree.links.len();
        let mut of: Vec<Vec<u32>> = vec![Vec::new(); n];
        for i in 1..n {
            let mut carrier = i;
            while carrier != 0 {
                of[carrier].push(i as u32);
                carrier = tree.links[carrier].parent;
            }
        }
        let mut rows = vec![Vec::new(); tree.nv];
        for (root, outboard) in of.iter().enumerate() {
            for &i in outboard {
                for c in velocities(tree, root) {
                    for v in velocities(tree, i as usize) {
                        rows[v].push(c);
                        if i as usize != root {
                            rows[c].push(v);
                        }
                    }
                }
            }
        }
        rows.iter_mut().for_each(|row| row.sort_unstable());
        let pattern = Pattern::from_rows(tree.nv, &rows);
        let entry = |i: usize, j: usize| {
            let row = pattern.row(i);
            (row.start + pattern.col_idx[row].partition_point(|&x| x < j)) as u32
        };
        let mut entries = Vec::with_capacity(pattern.nnz());
        for (root, outboard) in of.iter().enumerate().skip(1) {
            for c in velocities(tree, root) {
                for &i in outboard.iter().rev() {
                    entries.extend(velocities(tree, i as usize).map(|v| [entry(v, c), entry(c, v)]));
                }
            }
        }
        let mut starts = vec![0];
        of.iter().for_each(|x| starts.push(starts[starts.len() - 1] + x.len()));
        let diagonal = (0..tree.nv).map(|v| entry(v, v)).collect();
        Self { outboard: of.concat(), starts, entries, diagonal, pattern }
    }
}

impl<G: Space> Tree<G> {
    /// The entries of M at the last pose, in the order of the layout. Cost: descendants, summed over velocities.
    pub(crate) fn sparse_mass(&self, layout: &MassLayout, s: &mut TreeScratch<G>, out: &mut [G::S]) {
        let n = self.links.len();
        let mut memory = std::mem::take(&mut s.partial);
        if memory.len() < 2 * n {
            memory.resize(2 * n, Default::default());
        }
        let (twist, wrench) = memory.split_at_mut(n);
        let mut entries = layout.entries.iter();
        for root in 1..n {
            let outboard = &layout.outboard[layout.starts[root]..layout.starts[root + 1]];
            for c in velocities(self, root) {
                for &i in outboard {
                    let i = i as usize;
                    let (w, u) = if i == root { Default::default() } else { twist[self.links[i].parent] };
                    let (w, u) = self.propagate(i, s, w, u, |v| if v == c { G::S::one() } else { G::S::zero() });
                    twist[i] = (w, u);
                    wrench[i] = (G::spin(&s.links[i].inertia, w), G::scale(u, self.links[i].mass));
                }
                for &i in outboard.iter().rev() {
                    let i = i as usize;
                    let (moment, force) = wrench[i];
                    self.along(i, s, moment, force, |_, x| {
                        if let Some(&[one, other]) = entries.next() {
                            (out[one as usize], out[other as usize]) = (x, x);
                        }
                    });
                    if i != root {
                        let at_parent = self.to_parent(i, s, moment, force);
                        let carrier = &mut wrench[self.links[i].parent];
                        carrier.0 += at_parent;
                        carrier.1 += force;
                    }
                }
            }
        }
        for (v, rotor) in self.rotating() {
            out[layout.diagonal[v] as usize] += rotor;
        }
        s.partial = memory;
    }
}
