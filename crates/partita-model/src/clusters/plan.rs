//! The method of each cluster, and all its data that do not change while the same rows are kept.

use super::delassus::{self, Elimination};
use super::dof;
use crate::tree::Tree;
use partita_math::elimination::Pattern;
use partita_math::spatial::Space;
use partita_system::clusters::Clusters;
use std::ops::Range;

/// No entry, no index.
pub(super) const NONE: u32 = u32::MAX;

/// Up to this number of degrees of freedom a cluster uses partial velocities regardless of the operation count: D
/// loses one digit where C M⁻¹ Cᵀ loses two.
const FEW: usize = 4;

/// The method for a cluster.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Route {
    /// Partial velocities S D_cᵀ.
    PartialVelocities,
    /// Range space on the cluster's tree.
    RangeSpace,
    /// A joint in no loop: the plain articulated recursion.
    Free,
}

/// Criterion for the method of the clusters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Preference {
    /// The count of operations; one dense M_d where that is least.
    #[default]
    Counted,
    /// Always one dense M_d.
    Dense,
    /// Partial velocities in every cluster.
    PartialVelocities,
    /// Range space in every cluster.
    RangeSpace,
}

/// Operation of the recursion at a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Duty {
    /// Its own joint is eliminated.
    Own,
    /// First link of a cluster that uses partial velocities, with its index.
    First(u32),
    /// Another link of such a cluster.
    Other,
}

/// A row of C that is propagated through the joint of a link.
#[derive(Clone, Copy, Debug)]
pub(super) struct PropagatedRow {
    /// Number of the row among those eliminated.
    pub row: u32,
    /// Index of its force on the link.
    pub force: u32,
    /// Index of its force on the parent; `NONE` on the ground.
    pub parent_force: u32,
    /// Entries of C of the joint's velocities.
    pub entry: [u32; 3],
}

#[derive(Clone, Debug)]
pub(super) struct LinkPlan {
    pub duty: Duty,
    /// Rows that pass the joint, among `Plan::propagated`.
    pub propagated: Range<u32>,
    /// Index in `Plan::pairs` of the slots of their products, lower triangle row by row.
    pub pairs: u32,
    /// Rows that are complete here, among `Plan::eliminations`.
    pub complete: Range<u32>,
}

/// A cluster that uses partial velocities.
#[derive(Clone, Debug)]
pub(super) struct FewPlan {
    /// Its number.
    pub cluster: u32,
    /// Its base link.
    pub base: usize,
    /// Its links, parents first, with the index of the parent among them (`NONE`: the base).
    pub links: Vec<(u32, u32)>,
    /// Degrees of freedom.
    pub k: usize,
    /// Index of its partial velocities.
    pub partial: usize,
    /// Index of its k numbers.
    pub small: usize,
    /// Index of its k x k numbers.
    pub square: usize,
}

/// A cluster that uses the range-space method.
#[derive(Clone, Debug)]
pub(super) struct RangePlan {
    /// Its number.
    pub cluster: u32,
    /// Its base link.
    pub base: usize,
    /// Its links, parents first.
    pub links: Vec<u32>,
    /// Its rows that are complete at the base, among `Plan::eliminations`, in their order.
    pub at_base: Vec<u32>,
}

/// The recursion over the clusters of one tree with certain rows kept.
#[derive(Clone, Debug, Default)]
pub struct Plan {
    /// Method of each cluster.
    pub routes: Vec<Route>,
    /// Columns that Dᵀ needs: the largest number of degrees of freedom of a cluster that uses partial velocities.
    pub columns: usize,
    /// Approximate number of multiplications of one recursion.
    pub cost: usize,
    pub(super) links: Vec<LinkPlan>,
    pub(super) few: Vec<FewPlan>,
    pub(super) ranged: Vec<RangePlan>,
    pub(super) propagated: Vec<PropagatedRow>,
    pub(super) pairs: Vec<u32>,
    pub(super) eliminations: Vec<Elimination>,
    pub(super) neighbours: Vec<delassus::Neighbour>,
    pub(super) updates: Vec<u32>,
    /// Row of C of each eliminated row.
    pub(super) rows: Vec<u32>,
    pub(super) slots: usize,
    pub(super) forces: usize,
    pub(super) partials: usize,
    pub(super) smalls: usize,
    pub(super) squares: usize,
    /// Velocities of clusters that use partial velocities: their accelerations start from ξ.
    pub(super) starts_from_bias: Vec<bool>,
}

impl Plan {
    /// For a tree, its clusters and the rows of C that are kept.
    pub fn new<G: Space>(
        tree: &Tree<G>,
        pattern: &Pattern,
        clusters: &Clusters,
        kept: &[usize],
        preference: Preference,
    ) -> Self {
        let mut links_of: Vec<Vec<usize>> = vec![Vec::new(); clusters.count];
        let mut velocities = vec![0usize; clusters.count];
        for (i, l) in tree.links.iter().enumerate().skip(1) {
            links_of[clusters.of_velocity[l.v] as usize].push(i);
        }
        for &c in &clusters.of_velocity {
            velocities[c as usize] += 1;
        }
        let mut rows_of: Vec<Vec<usize>> = vec![Vec::new(); clusters.count];
        for &r in kept {
            rows_of[clusters.of_row[r] as usize].push(r);
        }
        // range space needs inertia on each joint with the loops open, D on the motions of the closed loops
        let mut short = vec![false; clusters.count];
        tree.massless.iter().for_each(|x| short[clusters.of_velocity[tree.links[x.link].v] as usize] = true);
        let by_range = Self::with_routes(tree, pattern, &links_of, &rows_of, |c| match () {
            () if rows_of[c].is_empty() => Route::Free,
            () if short[c] => Route::PartialVelocities,
            () => Route::RangeSpace,
        });
        if preference == Preference::RangeSpace {
            return by_range;
        }
        let range_cost = by_range.cluster_costs(tree, clusters);
        Self::with_routes(tree, pattern, &links_of, &rows_of, |c| {
            let (k, n) = (velocities[c].saturating_sub(rows_of[c].len()), links_of[c].len());
            let at_ground = links_of[c].first().is_some_and(|&i| tree.links[i].parent == 0);
            match () {
                () if rows_of[c].is_empty() => Route::Free,
                () if preference == Preference::PartialVelocities || short[c] => Route::PartialVelocities,
                () if k <= FEW || few_cost::<G>(n, k, rows_of[c].len(), at_ground) <= range_cost[c] => {
                    Route::PartialVelocities
                }
                () => Route::RangeSpace,
            }
        })
    }

    fn with_routes<G: Space>(
        tree: &Tree<G>,
        pattern: &Pattern,
        links_of: &[Vec<usize>],
        rows_of: &[Vec<usize>],
        route: impl Fn(usize) -> Route,
    ) -> Self {
        let nothing = LinkPlan { duty: Duty::Own, propagated: 0..0, pairs: 0, complete: 0..0 };
        let mut plan = Self {
            routes: (0..links_of.len()).map(route).collect(),
            links: vec![nothing; tree.links.len()],
            starts_from_bias: vec![false; tree.nv],
            ..Self::default()
        };
        let mut ranged = Vec::new();
        for (c, links) in links_of.iter().enumerate() {
            match plan.routes[c] {
                Route::Free => {}
                Route::RangeSpace => {
                    ranged.extend_from_slice(&rows_of[c]);
                    // the parent of the first link is not in the cluster
                    let base = tree.links[links[0]].parent;
                    let links = links.iter().map(|&i| i as u32).collect();
                    plan.ranged.push(RangePlan { cluster: c as u32, base, links, at_base: Vec::new() });
                }
                Route::PartialVelocities => plan.add_few(tree, c, links, rows_of[c].len()),
            }
        }
        delassus::plan(&mut plan, tree, pattern, &ranged);
        let mut index = vec![usize::MAX; links_of.len()];
        plan.ranged.iter().enumerate().for_each(|(n, r)| index[r.cluster as usize] = n);
        let mut of_row = vec![usize::MAX; pattern.rows];
        for (c, rows) in rows_of.iter().enumerate() {
            rows.iter().for_each(|&r| of_row[r] = index[c]);
        }
        for (i, l) in plan.links.iter().enumerate() {
            for e in l.complete.clone() {
                let n = of_row[plan.rows[plan.eliminations[e as usize].row as usize] as usize];
                if plan.ranged[n].base == i {
                    plan.ranged[n].at_base.push(e);
                }
            }
        }
        let d = G::DIM;
        let own = plan.links.iter().skip(1).filter(|l| l.duty == Duty::Own).count();
        plan.cost = own * own_cost::<G>()
            + plan.links.iter().map(|l| carried_cost(l.propagated.len(), d)).sum::<usize>()
            + plan.eliminations.iter().map(|e| delassus::cost(e, d)).sum::<usize>()
            + plan.few.iter().map(|f| few_cost::<G>(f.links.len(), f.k, 0, f.base == 0)).sum::<usize>();
        plan
    }

    fn add_few<G: Space>(&mut self, tree: &Tree<G>, cluster: usize, links: &[usize], rows: usize) {
        let number = self.few.len() as u32;
        let mut local = Vec::with_capacity(links.len());
        let mut base = 0;
        let mut velocities = 0;
        for &i in links {
            let parent = tree.links[i].parent;
            // the links of a cluster are nearly consecutive: search backwards
            let index = links.binary_search(&parent);
            if index.is_err() {
                base = parent;
            }
            local.push((i as u32, index.map_or(NONE, |p| p as u32)));
            self.links[i].duty = Duty::Other;
            let own = dof(&tree.links[i].motion);
            velocities += own;
            self.starts_from_bias[tree.links[i].v..tree.links[i].v + own].fill(true);
        }
        self.links[links[0]].duty = Duty::First(number);
        let k = velocities.saturating_sub(rows);
        self.few.push(FewPlan {
            cluster: cluster as u32,
            base,
            links: local,
            k,
            partial: self.partials,
            small: self.smalls,
            square: self.squares,
        });
        self.columns = self.columns.max(k);
        self.partials += links.len() * k;
        self.smalls += k;
        self.squares += k * k;
    }

    /// Number of multiplications of each cluster by the range-space method.
    fn cluster_costs<G: Space>(&self, tree: &Tree<G>, clusters: &Clusters) -> Vec<usize> {
        let mut cost = vec![0; clusters.count];
        let of_link = |i: usize| clusters.of_velocity[tree.links[i].v] as usize;
        for (i, l) in self.links.iter().enumerate().skip(1) {
            cost[of_link(i)] += own_cost::<G>() + carried_cost(l.propagated.len(), G::DIM);
        }
        for e in &self.eliminations {
            cost[clusters.of_row[self.rows[e.row as usize] as usize] as usize] += delassus::cost(e, G::DIM);
        }
        cost
    }
}

/// Own joint of a link: articulated inertia, its shift to the parent, the outward pass.
fn own_cost<G: Space>() -> usize {
    let d = G::DIM;
    4 * d * d + 10 * d
}

fn carried_cost(rows: usize, d: usize) -> usize {
    rows * 4 * d + rows * rows / 2
}

/// A cluster by partial velocities; the columns of A, a solve each, are counted with it.
fn few_cost<G: Space>(links: usize, k: usize, rows: usize, at_ground: bool) -> usize {
    let d = G::DIM;
    let shared = links * (k * (d * d + 2 * d) + k * k * d / 2 + 2 * d) + k * k * k / 6 + 4 * rows * k;
    shared + if at_ground { 0 } else { links * (3 * d * d + k * d) + k * d * d }
}
