//! Multipliers by the range-space method: which rows pass which links, and the sparse elimination of `C H⁻¹ Cᵀ`.
//!
//! A row enters at the outermost links it acts on and is complete at the link whose subtree contains all of them. There
//! it is eliminated: no joint further in changes it any more. Rows that are complete at the same link are eliminated in
//! the order of least degree. Any order is safe: for independent rows the matrix is symmetric and positive definite.

use super::dof;
use super::plan::{Plan, PropagatedRow, NONE};
use crate::tree::Tree;
use partita_math::elimination::Pattern;
use partita_math::spatial::Space;
use std::collections::{BTreeSet, HashMap};

/// One multiplier eliminated.
#[derive(Clone, Debug)]
pub(super) struct Elimination {
    /// Its row.
    pub row: u32,
    /// Slot of its pivot.
    pub pivot: u32,
    /// Index of its force on the link; `NONE` on the ground.
    pub force: u32,
    /// Rows it is coupled with that are eliminated later, in `Plan::neighbours`.
    pub neighbours: std::ops::Range<u32>,
    /// Slots of the products of neighbours, lower triangle row by row, in `Plan::updates`.
    pub updates: u32,
}

/// A row coupled with one that is eliminated.
#[derive(Clone, Copy, Debug)]
pub(super) struct Neighbour {
    pub row: u32,
    /// Slot of the coupling.
    pub slot: u32,
    /// Index of its force on the link.
    pub force: u32,
}

/// Number of multiplications of one elimination.
pub(super) fn cost(e: &Elimination, d: usize) -> usize {
    let n = e.neighbours.len();
    let force = if e.force == NONE { 0 } else { d * d + 2 * d * n };
    n * n / 2 + 2 * n + force
}

struct Slots {
    of: HashMap<(u32, u32), u32>,
}

impl Slots {
    fn get(&mut self, a: u32, b: u32) -> u32 {
        let next = self.of.len() as u32;
        *self.of.entry((a.max(b), a.min(b))).or_insert(next)
    }
}

/// Plan the rows `kept` of the clusters that use the range-space method.
pub(super) fn plan<G: Space>(plan: &mut Plan, tree: &Tree<G>, pattern: &Pattern, kept: &[usize]) {
    let n = tree.links.len();
    plan.rows = kept.iter().map(|&r| r as u32).collect();
    let mut link_of = vec![0usize; tree.nv];
    for (i, l) in tree.links.iter().enumerate().skip(1) {
        link_of[l.v..l.v + dof(&l.motion)].fill(i);
    }
    // entries of each row by link; the links it passes inward
    let mut passes: Vec<Vec<(u32, [u32; 3])>> = vec![Vec::new(); n];
    let mut complete: Vec<Vec<u32>> = vec![Vec::new(); n];
    for (r, &row) in kept.iter().enumerate() {
        let mut own: HashMap<usize, [u32; 3]> = HashMap::new();
        for e in pattern.row(row) {
            let v = pattern.col_idx[e];
            let i = link_of[v];
            own.entry(i).or_insert([NONE; 3])[v - tree.links[i].v] = e as u32;
        }
        let end = completed_at(tree, own.keys().copied());
        let mut seen = BTreeSet::new();
        for mut i in own.keys().copied() {
            while i != end && seen.insert(i) {
                i = tree.links[i].parent;
            }
        }
        for i in seen {
            passes[i].push((r as u32, own.get(&i).copied().unwrap_or([NONE; 3])));
        }
        complete[end].push(r as u32);
    }
    // indices of forces: at each link for the rows that pass its joint or are complete there
    let mut slot_of: Vec<HashMap<u32, u32>> = vec![HashMap::new(); n];
    let mut forces = 0;
    for i in 1..n {
        for r in passes[i].iter().map(|x| x.0).chain(complete[i].iter().copied()) {
            slot_of[i].insert(r, forces);
            forces += 1;
        }
    }
    plan.forces = forces as usize;
    let mut slots = Slots { of: HashMap::new() };
    let mut coupled: Vec<BTreeSet<u32>> = vec![BTreeSet::new(); kept.len()];
    for i in (0..n).rev() {
        eliminate(plan, &complete[i], (i != 0).then_some(&slot_of[i]), &mut slots, &mut coupled, i);
        if i == 0 {
            break;
        }
        let parent = tree.links[i].parent;
        let first = plan.propagated.len() as u32;
        for &(row, entry) in &passes[i] {
            let force = slot_of[i][&row];
            let parent_force = if parent == 0 { NONE } else { slot_of[parent][&row] };
            plan.propagated.push(PropagatedRow { row, force, parent_force, entry });
        }
        plan.links[i].propagated = first..plan.propagated.len() as u32;
        plan.links[i].pairs = plan.pairs.len() as u32;
        for (a, &(ra, _)) in passes[i].iter().enumerate() {
            for &(rb, _) in &passes[i][..=a] {
                plan.pairs.push(slots.get(ra, rb));
                if ra != rb {
                    coupled[ra as usize].insert(rb);
                    coupled[rb as usize].insert(ra);
                }
            }
        }
    }
    plan.slots = slots.of.len();
}

/// The innermost link whose subtree contains all of these: joints further in do not move them relative to each other.
fn completed_at<G: Space>(tree: &Tree<G>, links: impl Iterator<Item = usize>) -> usize {
    // replaced by their parents until they coincide: the larger number is further out
    links
        .map(|i| tree.links[i].parent)
        .reduce(|mut a, mut b| {
            while a != b {
                if a > b {
                    a = tree.links[a].parent;
                } else {
                    b = tree.links[b].parent;
                }
            }
            a
        })
        .unwrap_or(0)
}

fn eliminate(
    plan: &mut Plan,
    rows: &[u32],
    slot_of: Option<&HashMap<u32, u32>>,
    slots: &mut Slots,
    coupled: &mut [BTreeSet<u32>],
    link: usize,
) {
    let first = plan.eliminations.len() as u32;
    let force = |r: u32| slot_of.map_or(NONE, |p| p[&r]);
    // rows by their number of couplings, least first; a change of degree moves a row
    let mut queue: BTreeSet<(usize, u32)> = rows.iter().map(|&r| (coupled[r as usize].len(), r)).collect();
    let mut waiting: BTreeSet<u32> = rows.iter().copied().collect();
    while let Some((_, row)) = queue.pop_first() {
        waiting.remove(&row);
        let around: Vec<u32> = std::mem::take(&mut coupled[row as usize]).into_iter().collect();
        let begin = plan.neighbours.len() as u32;
        let updates = plan.updates.len() as u32;
        for &a in &around {
            plan.neighbours.push(Neighbour { row: a, slot: slots.get(row, a), force: force(a) });
        }
        for (x, &a) in around.iter().enumerate() {
            if waiting.contains(&a) {
                queue.remove(&(coupled[a as usize].len(), a));
            }
            coupled[a as usize].remove(&row);
            for (y, &b) in around.iter().enumerate() {
                if y <= x {
                    plan.updates.push(slots.get(a, b));
                }
                if a != b {
                    coupled[a as usize].insert(b);
                }
            }
            if waiting.contains(&a) {
                queue.insert((coupled[a as usize].len(), a));
            }
        }
        plan.eliminations.push(Elimination {
            row,
            pivot: slots.get(row, row),
            force: force(row),
            neighbours: begin..plan.neighbours.len() as u32,
            updates,
        });
    }
    plan.links[link].complete = first..plan.eliminations.len() as u32;
}
