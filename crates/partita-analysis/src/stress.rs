//! Self-stresses as joint wrenches that balance one another without any load.
//!
//! The multipliers of a self-stress, `Cᵀ λ = 0`, act in the cut joints; the tree joints between the two sides of a cut
//! pass its wrench on. Only the joints around the loops are touched, so that a long chain of loops costs no more per
//! loop than a short one.

use crate::error::AnalysisError;
use crate::geometry::Geometry;
use partita_math::elimination::{Plan, PlanOptions, SparseScratch};
use partita_math::spatial::{Spatial, Vec3};
use partita_math::tolerance;
use partita_model::joint::Motion;
use partita_model::model::Model;
use partita_model::reaction::{wrench_of_efforts, Wrench};
use partita_model::rows::Owner;
use partita_model::tree::TreeScratch;
use partita_system::prelude::*;
use partita_system::start::Start;
use partita_system::SystemError;

/// One self-stress.
#[derive(Default)]
pub(crate) struct Stress {
    /// Wrench of each joint that carries any, on its child, about the joint's point there; world axes.
    pub(crate) joints: Vec<(usize, Wrench)>,
    /// Effort of each drive that takes part in it, along its velocity.
    pub(crate) drives: Vec<(usize, f64)>,
    /// Multipliers of all conditions other than loop closures that take part in it, by rows of the mechanism in space.
    pub(crate) conditions: Vec<(usize, f64)>,
    /// Forces (and moments over the mechanism's size) up to this are zero.
    pub(crate) zero: f64,
    /// Its imbalance over its largest force: how nearly dependent the rows are.
    pub(crate) unbalanced: f64,
}

/// Poses of the tree and the path from each body to the ground.
pub(crate) struct Pose<'m> {
    /// The mechanism in space.
    pub(crate) model: &'m Model,
    /// Its links at present.
    pub(crate) tree: TreeScratch<Spatial<f64>>,
    /// The joints' points on their children at present.
    pub(crate) points: Vec<Vec3<f64>>,
    /// Tree edge that holds each node, and the number of edges between it and the ground.
    held: Vec<(usize, usize)>,
    /// Time and coordinates.
    at: (f64, Vec<f64>),
}

/// Sums of wrenches by joint, of few joints.
struct Sums {
    of: Vec<Wrench>,
    touched: Vec<usize>,
    is_touched: Vec<bool>,
}

impl Sums {
    fn add(&mut self, joint: usize, sign: f64, w: &Wrench) {
        if !self.is_touched[joint] {
            self.is_touched[joint] = true;
            self.touched.push(joint);
            self.of[joint] = Wrench::default();
        }
        let sum = &mut self.of[joint];
        sum.moment += w.moment.times(sign);
        sum.force += w.force.times(sign);
    }
}

/// Scratch memory for the wrenches of self-stresses, one after another.
struct WrenchScratch {
    /// Multipliers of all rows of the model; zero between two self-stresses.
    dense: Vec<f64>,
    closings: Vec<usize>,
    sums: Sums,
}

impl WrenchScratch {
    fn new(model: &Model) -> Self {
        let joints = model.spec.joints.len();
        let sums = Sums { of: vec![Wrench::default(); joints], touched: Vec::new(), is_touched: vec![false; joints] };
        Self { dense: vec![0.0; model.pattern().rows], closings: Vec::new(), sums }
    }
}

impl<'m> Pose<'m> {
    /// At q of the mechanism in space, whose axes are the world's.
    pub(crate) fn new(model: &'m Model, t: f64, q: &[f64]) -> Self {
        let placed = model.zero_position();
        let mut held = vec![(usize::MAX, 0); placed.bodies.len() + 1];
        for (i, e) in placed.topology.tree.iter().enumerate() {
            held[e.to] = (i, held[e.from].1 + 1);
        }
        let mut made =
            Self { model, tree: model.equations().full.scratch(), points: Vec::new(), held, at: (t, Vec::new()) };
        made.move_to(t, q);
        made
    }

    /// To another position.
    pub(crate) fn move_to(&mut self, t: f64, q: &[f64]) {
        let (model, tree) = (self.model, &mut self.tree);
        model.equations().full.poses(q, tree);
        let reference = model.equations().reference();
        self.points.clear();
        self.points.extend(model.zero_position().joints.iter().map(|p| {
            let link = model.zero_position().link_of(p.child);
            model.equations().full.reference_point(link, tree)
                + tree.links[link].rot.apply(p.child_point - reference[link])
        }));
        self.at.0 = t;
        self.at.1.clear();
        self.at.1.extend_from_slice(q);
    }

    /// Visit the tree edges between two nodes, each with the side it is on: away from the ground towards `b`?
    fn between(&self, mut a: usize, mut b: usize, mut visit: impl FnMut(usize, bool)) {
        let tree = self.model.tree();
        while a != b {
            let towards_b = self.held[b].1 >= self.held[a].1;
            let node = if towards_b { &mut b } else { &mut a };
            let edge = self.held[*node].0;
            visit(edge, towards_b);
            *node = tree[edge].from;
        }
    }

    /// Joints loaded by a condition other than a loop closure: its own joint and those on the path between the bodies
    /// it acts on, except, for couplings, the coordinates along which it acts.
    fn pass_condition(&self, (row, x): (usize, f64), origin: Vec3<f64>, sums: &mut Sums) -> Result<(), SystemError> {
        let (model, (t, q)) = (self.model, &self.at);
        let owner = model.row_names[row].owner;
        let own = match owner {
            Owner::Joint(j) => Some(j),
            Owner::Drive(i) => model.drives().iter().find(|d| d.number == i).and_then(|d| d.joint).map(|(j, _)| j),
            Owner::Coupling(_) | Owner::Rotor(_) => None,
        };
        let mut taken: Vec<(usize, f64)> = Vec::new();
        model.equations().apply_condition(
            &self.tree,
            (*t, q),
            (row, x),
            |[a, b], w, point| {
                let w = Wrench { moment: w.moment + (point - origin).cross(w.force), force: w.force };
                own.into_iter().for_each(|j| sums.add(j, 1.0, &w));
                self.between(a, b, |edge, towards_b| {
                    let e = model.tree()[edge];
                    if let Some(j) = e.joint {
                        sums.add(j, if towards_b == e.reversed { 1.0 } else { -1.0 }, &w);
                    }
                });
            },
            |v, effort| taken.push((v, effort)),
        )?;
        // the effort of a coupling along a coordinate is not a reaction of its joint
        if own.is_some() || taken.is_empty() {
            return Ok(());
        }
        let effort = |v: usize| taken.iter().filter(|x| x.0 == v).map(|x| x.1).sum::<f64>();
        for (j, p) in model.zero_position().joints.iter().enumerate() {
            let (mut axes, mut efforts) = (Vec::new(), Vec::new());
            for (motion, &l) in p.shape.motions.iter().zip(p.links.iter().flatten()) {
                let (x, v) = (&self.tree.links[l], model.zero_position().links[l].v);
                match motion {
                    Motion::Turn(_) => axes.push((true, x.axis)),
                    Motion::Slide(_) => axes.push((false, x.direction)),
                    Motion::Ball => axes.extend((0..3).map(|i| (true, x.rot.column(i)))),
                }
                efforts.extend((v..v + motion.velocities()).map(effort));
            }
            if efforts.iter().any(|x| *x != 0.0) {
                let Wrench { moment, force } = wrench_of_efforts(&axes, &efforts);
                let w = Wrench { moment: moment + (self.points[j] - origin).cross(force), force };
                sums.add(j, if p.reversed { 1.0 } else { -1.0 }, &w);
            }
        }
        Ok(())
    }

    /// What a unit effort of a condition exerts, component by component: efforts along velocities, then the wrenches between
    /// bodies; moments over `length`.
    pub(crate) fn exerted(&self, row: usize, length: f64, mut on: impl FnMut(usize, f64)) -> Result<(), SystemError> {
        let (mut pushed, mut taken) = (Vec::new(), Vec::new());
        let (t, q) = &self.at;
        self.model.equations().apply_condition(
            &self.tree,
            (*t, q),
            (row, 1.0),
            |_, w, _| pushed.extend(w.force.0.into_iter().chain(w.moment.times(1.0 / length).0)),
            |v, effort| taken.push((v, effort)),
        )?;
        let nv = self.model.size().nv;
        pushed.into_iter().enumerate().for_each(|(i, x)| on(nv + i, x));
        taken.into_iter().for_each(|(v, x)| on(v, if self.turns(v) { x / length } else { x }));
        Ok(())
    }

    /// Whether a velocity of a joint is that of a rotation.
    fn turns(&self, v: usize) -> bool {
        let placed = self.model.zero_position();
        placed.joints.iter().flat_map(|p| p.shape.motions.iter().zip(p.links.iter().flatten())).any(|(motion, &l)| {
            let first = placed.links[l].v;
            (first..first + motion.velocities()).contains(&v) && !matches!(motion, Motion::Slide(_))
        })
    }

    /// Joint wrenches of the multipliers `(row, λ)`, by number of the joint; moments are collected about the point of one and
    /// then reduced.
    fn wrenches(
        &self,
        lambda: &[(usize, f64)],
        closing_of: &[usize],
        WrenchScratch { dense, closings, sums }: &mut WrenchScratch,
        found: &mut Vec<(usize, Wrench)>,
    ) {
        found.clear();
        let full = &self.model.equations().full;
        let Some(&(first, _)) = lambda.first() else { return };
        closings.clear();
        closings.extend(lambda.iter().filter_map(|&(row, _)| closing_of.get(row).copied()));
        closings.sort_unstable();
        closings.dedup();
        lambda.iter().for_each(|&(row, x)| dense[row] = x);
        let origin = self.model.joint_of_row(first).map_or_else(Vec3::zero, |j| self.points[j]);
        for &i in closings.iter() {
            let k = &full.closings[i];
            let (moment, force) = full.closing_wrench(k, &self.tree, dense);
            let w = Wrench { moment: moment + (self.points[k.joint] - origin).cross(force), force };
            sums.add(k.joint, 1.0, &w);
            let p = &self.model.zero_position().joints[k.joint];
            self.between(p.parent, p.child, |edge, towards_child| {
                let e = self.model.tree()[edge];
                // the edge transmits the load of the loop closure on the bodies beyond it
                if let Some(j) = e.joint {
                    sums.add(j, if towards_child == e.reversed { 1.0 } else { -1.0 }, &w);
                }
            });
        }
        lambda.iter().for_each(|&(row, _)| dense[row] = 0.0);
        for &(row, x) in lambda.iter().filter(|(row, _)| *row >= self.model.closing_rows) {
            // a function that fails here fails in every evaluation, where it is reported
            let _ = self.pass_condition((row, x), origin, sums);
        }
        sums.touched.sort_unstable();
        found.extend(sums.touched.drain(..).map(|j| {
            sums.is_touched[j] = false;
            let w = &sums.of[j];
            (j, Wrench { moment: w.moment - (self.points[j] - origin).cross(w.force), force: w.force })
        }));
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
    let (balance, c) = Balance::new(system, start, t, q)?;
    balance.stresses(pose, &c).ok_or_else(|| singular(t).into())
}

fn singular(t: f64) -> SystemError {
    SystemError::Singular { t, pivot: 0.0, limit: tolerance::SINGULAR_PIVOT }
}

/// The elimination that balances dropped rows by those kept: made at one position, valid while its pivots are large
/// enough.
pub(crate) struct Balance<'g, 'm> {
    system: &'g Geometry<'m>,
    dropped: Vec<usize>,
    /// Components of a self-stress below this fraction of the largest count as zero.
    least: f64,
    plan: Plan,
    /// Step of the elimination that uses a column.
    step_of: Vec<Option<usize>>,
    /// Closing of each row of a closing.
    closing_of: Vec<usize>,
    /// Drive of each row of a drive.
    drive_of: Vec<Option<usize>>,
    /// What makes a force of each multiplier.
    unit: Vec<f64>,
    displacement: Vec<f64>,
}

impl<'g, 'm> Balance<'g, 'm> {
    /// At a position whose rank is known; and the values of C there, those of the dropped rows as they are.
    pub(crate) fn new(
        system: &'g Geometry<'m>,
        start: &Start,
        t: f64,
        q: &[f64],
    ) -> Result<(Self, Vec<f64>), AnalysisError> {
        let (size, pattern, displacement) = (system.size(), system.pattern(), system.scales());
        let length = system.model.extent();
        let c = system.jacobian_with(&start.dropped, t, q)?;
        let row_norm =
            |i: usize| pattern.row(i).map(|e| (c[e] * displacement[pattern.col_idx[e]]).powi(2)).sum::<f64>().sqrt();
        let row_scale: Vec<f64> =
            (0..size.rows).map(row_norm).map(|norm| if norm > 0.0 { 1.0 / norm } else { 0.0 }).collect();
        let mut kept = vec![true; size.rows];
        start.dropped.iter().for_each(|&i| kept[i] = false);
        let any = vec![true; size.nv];
        let plan = Plan::new(pattern, &c, &kept, &any, &row_scale, &displacement, start.rank, PlanOptions::default())
            .map_err(|_| singular(t))?;
        let mut step_of = vec![None; size.nv];
        plan.pivot_cols().iter().enumerate().for_each(|(step, &j)| step_of[j] = Some(step));
        let mut closing_of = Vec::with_capacity(size.rows);
        let mut unit = vec![1.0; size.rows];
        for (i, k) in system.model.equations().full.closings.iter().enumerate() {
            closing_of.extend(std::iter::repeat_n(i, k.rows()));
            unit[k.row + k.slide_rows()..k.row + k.rows()].fill(1.0 / length);
        }
        let mut drive_of = vec![None; size.rows];
        for (i, d) in system.model.drives().iter().enumerate() {
            if let Some(row) = (0..size.rows).find(|&row| system.row_of_model(row) == d.row) {
                drive_of[row] = Some(i);
            }
        }
        for row in system.model.closing_rows.min(size.rows)..size.rows {
            if system.model.structure().rows[system.row_of_model(row)].is_angle {
                unit[row] = 1.0 / length;
            }
        }
        Ok((
            Self {
                system,
                dropped: start.dropped.clone(),
                least: tolerance::NEGLIGIBLE,
                plan,
                step_of,
                closing_of,
                drive_of,
                unit,
                displacement,
            },
            c,
        ))
    }

    /// The rows that are balanced.
    pub(crate) fn dropped(&self) -> &[usize] {
        &self.dropped
    }

    /// Scratch memory reused from position to position.
    pub(crate) fn memory(&self) -> BalanceScratch {
        BalanceScratch {
            factors: vec![0.0; self.plan.factor_len()],
            sparse: SparseScratch::new(self.plan.rank()),
            few: Vec::new(),
            steps: Vec::new(),
            lambda: Vec::new(),
            of_model: Vec::new(),
            off: vec![0.0; self.system.size().nv],
            wrench_scratch: WrenchScratch::new(self.system.model),
        }
    }

    /// The multipliers `(row, λ)` that balance one row, itself first, for the factors of C.
    fn multipliers(&self, row: usize, c: &[f64], memory: &mut BalanceScratch) {
        let BalanceScratch { factors, sparse, few, steps, lambda, .. } = memory;
        let pattern = self.system.pattern();
        few.clear();
        few.extend(pattern.row(row).filter_map(|e| self.step_of[pattern.col_idx[e]].map(|step| (step, -c[e]))));
        self.plan.solve_transposed_sparse(factors, few, sparse, steps);
        steps.sort_unstable_by_key(|x| x.0);
        lambda.clear();
        lambda.push((row, 1.0));
        lambda.extend(steps.iter().map(|&(step, x)| (self.plan.pivot_rows()[step], x)));
    }

    /// The self-stresses for the values of C at a position; `None` where the elimination is no longer valid.
    pub(crate) fn stresses(&self, pose: &Pose, c: &[f64]) -> Option<Vec<Stress>> {
        let mut found = Vec::new();
        self.stresses_into(pose, c, &mut self.memory(), &mut found).then_some(found)
    }

    /// As `stresses`, replacing those `found` before; false where the elimination plan no longer applies.
    pub(crate) fn stresses_into(
        &self,
        pose: &Pose,
        c: &[f64],
        memory: &mut BalanceScratch,
        found: &mut Vec<Stress>,
    ) -> bool {
        let (pattern, model) = (self.system.pattern(), self.system.model);
        let length = model.extent();
        if self.plan.factor(c, &mut memory.factors).is_err() {
            return false;
        }
        found.resize_with(self.dropped.len(), Stress::default);
        for (&row, stress) in self.dropped.iter().zip(found) {
            self.multipliers(row, c, memory);
            let BalanceScratch { lambda, off, of_model, wrench_scratch, .. } = &mut *memory;
            let top = lambda.iter().fold(0.0, |m: f64, &(row, x)| m.max((x * self.unit[row]).abs()));
            lambda.retain(|&(row, x)| (x * self.unit[row]).abs() > tolerance::SOLUTION_ROUNDING * top);
            // the imbalance of the self-stress (nearly dependent rows, a position closed to a tolerance)
            let entries =
                || lambda.iter().flat_map(|&(row, x)| pattern.row(row).map(move |e| (pattern.col_idx[e], e, x)));
            entries().for_each(|(j, e, x)| off[j] += x * c[e] * self.displacement[j] / length);
            let unbalanced = entries().fold(0.0, |m: f64, (j, _, _)| m.max(off[j].abs()));
            entries().for_each(|(j, _, _)| off[j] = 0.0);
            of_model.clear();
            of_model.extend(lambda.iter().map(|&(row, x)| (self.system.row_of_model(row), x)));
            pose.wrenches(of_model, &self.closing_of, wrench_scratch, &mut stress.joints);
            let magnitude = |w: &Wrench| w.force.norm().max(w.moment.norm() / length);
            let largest = stress.joints.iter().fold(top, |m: f64, (_, w)| m.max(magnitude(w)));
            let zero = (self.least * largest).max(tolerance::CLEARLY * unbalanced);
            stress.joints.retain(|(_, w)| magnitude(w) > zero);
            stress.drives.clear();
            stress.drives.extend(lambda.iter().filter_map(|&(row, x)| Some((self.drive_of[row]?, x))));
            stress.conditions.clear();
            stress.conditions.extend(of_model.iter().filter(|(row, _)| *row >= model.closing_rows));
            (stress.zero, stress.unbalanced) = (zero, unbalanced / largest);
        }
        true
    }
}

/// Memory that the self-stresses of positions share.
pub(crate) struct BalanceScratch {
    factors: Vec<f64>,
    sparse: SparseScratch,
    /// The row to be balanced, by steps of the elimination, and what balances it.
    few: Vec<(usize, f64)>,
    steps: Vec<(usize, f64)>,
    /// Multipliers by rows of the geometry, and by rows of the mechanism.
    lambda: Vec<(usize, f64)>,
    of_model: Vec<(usize, f64)>,
    /// Residual along each velocity; zero between two self-stresses.
    off: Vec<f64>,
    wrench_scratch: WrenchScratch,
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
            let swept = m.equations().wrenches_of(&q, &full, m.scratch().equations());
            let mut closing_of = Vec::new();
            m.equations().full.closings.iter().enumerate().for_each(|(i, k)| closing_of.extend(vec![i; k.rows()]));
            let (mut by_balance, mut wrench_scratch) = (Vec::new(), WrenchScratch::new(&m));
            Pose::new(&m, 0.0, &q).wrenches(&lambda, &closing_of, &mut wrench_scratch, &mut by_balance);
            assert_eq!(by_balance.len(), m.spec.joints.len());
            for (j, w) in by_balance {
                assert!((w.force - swept[j].force).norm() < 1e-14, "{}", m.spec.joints[j].name);
                assert!((w.moment - swept[j].moment).norm() < 1e-14, "{}", m.spec.joints[j].name);
            }
        }
    }
}
