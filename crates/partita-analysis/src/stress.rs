//! Self-stresses as people feel them: joint wrenches that balance one another without any load.
//!
//! The multipliers of a self-stress, `Cᵀ λ = 0`, act in the cut joints; the tree joints between the two sides of a cut
//! pass its wrench on. Only the joints around the loops are touched, so that a long chain of loops costs no more per loop
//! than a short one.

use crate::error::AnalysisError;
use crate::geometry::Geometry;
use partita_math::elimination::{Plan, PlanOptions, SparseRoom};
use partita_math::spatial::{Spatial, Vec3};
use partita_model::model::Model;
use partita_model::reaction::Wrench;
use partita_model::tree::TreeScratch;
use partita_system::reduction::{bridged_gap, SINGULAR_PIVOT};
use partita_system::start::Start;
use partita_system::{ConstrainedSystem, SystemError};
use std::collections::BTreeMap;

/// Multipliers below this fraction of the largest are rounding errors of the solution.
const NEGLIGIBLE: f64 = 1e-13;
/// A component below this fraction of the largest is zero.
const ZERO: f64 = 1e-9;

/// One self-stress.
pub(crate) struct Stress {
    /// Wrench of each joint that carries any, on its child, about the joint's point there; world axes.
    pub(crate) joints: Vec<(usize, Wrench)>,
    /// Forces (and moments over the mechanism's size) up to this are zero.
    pub(crate) zero: f64,
}

/// Poses of the tree and the way from each body to the ground.
pub(crate) struct Pose<'m> {
    /// The mechanism in space.
    pub(crate) model: &'m Model,
    /// Its links now.
    pub(crate) tree: TreeScratch<Spatial<f64>>,
    /// The joints' points on their children now.
    pub(crate) points: Vec<Vec3<f64>>,
    /// Tree edge that holds each node, and the number of edges between it and the ground.
    held: Vec<(usize, usize)>,
}

impl<'m> Pose<'m> {
    /// At q of the mechanism in space, whose axes are the world's.
    pub(crate) fn new(model: &'m Model, q: &[f64]) -> Self {
        let mut tree = model.full.scratch();
        model.full.poses(q, &mut tree);
        let placed = &model.placed;
        let reference = model.reference();
        let points = placed
            .joints
            .iter()
            .map(|p| {
                let link = placed.link_of(p.child);
                model.full.place(link, &tree) + tree.links[link].rot.apply(p.child_point - reference[link])
            })
            .collect();
        let mut held = vec![(usize::MAX, 0); placed.bodies.len() + 1];
        for (i, e) in placed.topology.tree.iter().enumerate() {
            held[e.to] = (i, held[e.from].1 + 1);
        }
        Self { model, tree, points, held }
    }

    /// Tree edges between two nodes, each with the side it is on: away from the ground towards `b`?
    fn between(&self, mut a: usize, mut b: usize) -> Vec<(usize, bool)> {
        let tree = &self.model.placed.topology.tree;
        let mut edges = Vec::new();
        while a != b {
            let towards_b = self.held[b].1 >= self.held[a].1;
            let node = if towards_b { &mut b } else { &mut a };
            let edge = self.held[*node].0;
            edges.push((edge, towards_b));
            *node = tree[edge].from;
        }
        edges
    }

    /// Joint wrenches of the multipliers `(row, λ)`; moments are collected about `origin` and then reduced.
    fn wrenches(&self, lambda: &[(usize, f64)], closing_of: &[usize], dense: &mut [f64]) -> Vec<(usize, Wrench)> {
        let full = &self.model.full;
        let Some(&(first, _)) = lambda.first() else { return Vec::new() };
        let mut closings: Vec<usize> = lambda.iter().filter_map(|&(row, _)| closing_of.get(row).copied()).collect();
        closings.sort_unstable();
        closings.dedup();
        lambda.iter().for_each(|&(row, x)| dense[row] = x);
        let origin = self.points[self.model.joint_of_row(first)];
        let mut sums: BTreeMap<usize, Wrench> = BTreeMap::new();
        for &i in &closings {
            let k = &full.closings[i];
            let (moment, force) = full.closing_wrench(k, &self.tree, dense);
            let moment = moment + (self.points[k.joint] - origin).cross(force);
            let mut pass = |joint: usize, sign: f64| {
                let w = sums.entry(joint).or_default();
                w.moment += moment.times(sign);
                w.force += force.times(sign);
            };
            pass(k.joint, 1.0);
            let p = &self.model.placed.joints[k.joint];
            for (edge, towards_child) in self.between(p.parent, p.child) {
                let e = &self.model.placed.topology.tree[edge];
                // a body beyond the edge that the closing pushes is held back through it
                if let Some(j) = e.joint {
                    pass(j, if towards_child == e.reversed { 1.0 } else { -1.0 });
                }
            }
        }
        lambda.iter().for_each(|&(row, _)| dense[row] = 0.0);
        let about = |(j, w): (usize, Wrench)| {
            (j, Wrench { moment: w.moment - (self.points[j] - origin).cross(w.force), force: w.force })
        };
        sums.into_iter().map(about).collect()
    }
}

/// One self-stress per dropped row, in their order: that row with multiplier 1, balanced by the rows kept.           (R2)
///
/// Cost: one sparse solution per dropped row.
pub(crate) fn stresses(
    system: &Geometry,
    pose: &Pose,
    start: &Start,
    t: f64,
    q: &[f64],
) -> Result<Vec<Stress>, AnalysisError> {
    if start.dropped.is_empty() {
        return Ok(Vec::new());
    }
    let (size, pattern, reach) = (system.size(), system.pattern(), system.scales());
    let length = system.model.placed.size;
    let c = system.jacobian(t, q)?;
    let row_norm = |i: usize| pattern.row(i).map(|e| (c[e] * reach[pattern.col_idx[e]]).powi(2)).sum::<f64>().sqrt();
    let row_scale: Vec<f64> =
        (0..size.rows).map(row_norm).map(|norm| if norm > 0.0 { 1.0 / norm } else { 0.0 }).collect();
    let mut kept = vec![true; size.rows];
    start.dropped.iter().for_each(|&i| kept[i] = false);
    let any = vec![true; size.nv];
    let singular = || SystemError::Singular { t, pivot: 0.0, limit: SINGULAR_PIVOT };
    let plan = Plan::new(pattern, &c, &kept, &any, &row_scale, &reach, start.rank, PlanOptions::default())
        .map_err(|_| singular())?;
    let mut factors = vec![0.0; plan.factor_len()];
    plan.factor(&c, &mut factors).map_err(|_| singular())?;
    let mut step_of = vec![None; size.nv];
    plan.pivot_cols().iter().enumerate().for_each(|(step, &j)| step_of[j] = Some(step));
    let mut room = SparseRoom::new(plan.rank());
    let mut balance = |row: usize| -> Vec<(usize, f64)> {
        let b: Vec<(usize, f64)> =
            pattern.row(row).filter_map(|e| step_of[pattern.col_idx[e]].map(|step| (step, -c[e]))).collect();
        let mut lambda = plan.solve_transposed_sparse(&factors, &b, &mut room);
        lambda.sort_unstable_by_key(|x| x.0);
        let of_rows = lambda.into_iter().map(|(step, x)| (plan.pivot_rows()[step], x));
        std::iter::once((row, 1.0)).chain(of_rows).collect()
    };

    // self-stresses of the mechanism as it was meant, seen through a drawing that misfits
    let least = if start.misfit > 0.0 { ZERO.max(bridged_gap(system.drawing_tolerance())) } else { ZERO };
    let mut closing_of = Vec::with_capacity(size.rows);
    let mut unit = vec![1.0; size.rows];
    for (i, k) in system.model.full.closings.iter().enumerate() {
        closing_of.extend(std::iter::repeat_n(i, k.rows()));
        unit[k.row + k.slide_rows()..k.row + k.rows()].fill(1.0 / length);
    }
    let mut dense = vec![0.0; system.model.pattern().rows];
    let mut off = vec![0.0; size.nv];
    let mut found = Vec::with_capacity(start.dropped.len());
    for &row in &start.dropped {
        let mut lambda = balance(row);
        let top = lambda.iter().fold(0.0, |m: f64, &(row, x)| m.max((x * unit[row]).abs()));
        lambda.retain(|&(row, x)| (x * unit[row]).abs() > NEGLIGIBLE * top);
        // what the self-stress leaves unbalanced (nearly dependent rows, a position closed to a tolerance)
        let entries = || lambda.iter().flat_map(|&(row, x)| pattern.row(row).map(move |e| (pattern.col_idx[e], e, x)));
        entries().for_each(|(j, e, x)| off[j] += x * c[e] * reach[j] / length);
        let unbalanced = entries().fold(0.0, |m: f64, (j, _, _)| m.max(off[j].abs()));
        entries().for_each(|(j, _, _)| off[j] = 0.0);
        let mut joints = pose.wrenches(&lambda, &closing_of, &mut dense);
        let magnitude = |w: &Wrench| w.force.norm().max(w.moment.norm() / length);
        let largest = joints.iter().fold(top, |m: f64, (_, w)| m.max(magnitude(w)));
        let zero = (least * largest).max(10.0 * unbalanced);
        joints.retain(|(_, w)| magnitude(w) > zero);
        found.push(Stress { joints, zero });
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::examples::{bricard, chain, four_bar, joint, model, spherical_four_bar, tilted, Z};
    use partita_model::spec::{Cut, JointKind};

    /// Walked edge by edge around the loops, or by the sweep of the model over all bodies: the same wrenches.
    #[test]
    fn wrenches_agree_with_the_sweep_over_all_bodies() {
        let mut welded = four_bar([JointKind::Revolute; 4]);
        welded.bodies.push(crate::examples::body("plate", [3.0, 0.0, 0.0], [3.0, 1.0, 1.0]));
        welded.joints.push(joint("weld", JointKind::Fixed, "plate", "rocker", [3.0, 0.5, 0.0], Z));
        welded.joints[2].child = "plate".into();
        welded.joints[3].cut = Cut::Never;
        let mut rng = fastrand::Rng::with_seed(3);
        // the chain has three cut joints, whose moments are collected about the point of one
        for spec in [tilted(welded), bricard(), spherical_four_bar(), tilted(chain(3, 0.4))] {
            let m = model(spec).in_space().unwrap();
            let q = m.initial();
            let lambda: Vec<(usize, f64)> = (0..m.row_names.len()).map(|i| (i, rng.f64() - 0.5)).collect();
            let full: Vec<f64> = lambda.iter().map(|x| x.1).collect();
            let swept = m.wrenches_of(&q, &full, &mut m.scratch());
            let mut closing_of = Vec::new();
            m.full.closings.iter().enumerate().for_each(|(i, k)| closing_of.extend(vec![i; k.rows()]));
            let walked = Pose::new(&m, &q).wrenches(&lambda, &closing_of, &mut vec![0.0; full.len()]);
            assert_eq!(walked.len(), m.spec.joints.len());
            for (j, w) in walked {
                assert!((w.force - swept[j].force).norm() < 1e-14, "{}", m.spec.joints[j].name);
                assert!((w.moment - swept[j].moment).norm() < 1e-14, "{}", m.spec.joints[j].name);
            }
        }
    }
}
