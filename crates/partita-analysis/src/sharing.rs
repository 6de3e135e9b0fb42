//! One rule for the indeterminate part of reactions: how redundant joints share their load.                      (R2)
//!
//! Reactions w of all joints are known up to self-stresses, w + S α. Of all that are possible those are returned that
//! are least in a metric W,
//!
//! ```text
//! min Σ_j w_jᵀ W_j w_j     w* = w − S (Sᵀ W S)⁻¹ Sᵀ W w
//! ```
//!
//! over all joints, in the tree or closing loops. Without compliances W_j weighs forces by 1 and
//! moments about the joint's point by 1/L², L the typical length of a body: a number without units, the same in all
//! axes and for every choice of coordinates, cuts and rows. With compliances of the joints it is twice their elastic
//! energy, so that w* are the reactions of rigid bodies on elastic joints (Castigliano). Either way w* moves
//! continuously with the mechanism, and what every self-stress leaves alone is left alone. Where self-stresses load no
//! joint (gears that hold one another), the efforts of couplings and drives among them are least in the same sense.

use crate::error::AnalysisError;
use crate::geometry::{in_space, lifted, Geometry, GeometryScratch};
use crate::stress::{Balance, BalanceScratch, Pose, Stress};
use partita_math::dense::Matrix;
use partita_math::elimination::Pattern;
use partita_math::factor;
use partita_math::least_norm::LeastNorm;
use partita_math::spatial::Mat3;
use partita_math::tolerance;
use partita_model::model::ModelScratch;
use partita_model::reaction::Wrench;
use partita_model::rows::Owner;
use partita_model::Model;
use partita_system::partition::split::Split;
use partita_system::prelude::*;
use partita_system::start::{analyse, rank_here};
use partita_system::SystemError;
use std::collections::HashMap;

mod base;
mod efforts;
mod weighed;

pub use base::{self_stresses, SelfStresses};
use weighed::{least_compliance, Metric, Rows};

/// Maximum number of repetitions: each multiplies the error by the damping over the squared sine between self-stresses.
const REPETITIONS: usize = 12;
/// The rule for one mechanism, with the data kept from one position to the next.
pub struct Sharing<'g, 'm> {
    system: &'g Geometry<'m>,
    metric: Metric,
    balance: Option<(Balance<'g, 'm>, f64)>,
}

/// Scratch memory shared by positions.
pub struct SharingScratch<'m> {
    model: ModelScratch,
    pose: Pose<'m>,
    geometry: GeometryScratch,
    phi: Vec<f64>,
    c: Vec<f64>,
    a: Vec<f64>,
    balance: Option<BalanceScratch>,
    stresses: Vec<Stress>,
    rows: Rows,
    solver: Option<(Pattern, LeastNorm)>,
    damping: Vec<f64>,
    /// Reactions along the columns, the work of self-stresses on them, the correction and its weights.
    along: Vec<f64>,
    work: Vec<f64>,
    y: Vec<f64>,
    z: Vec<f64>,
}

impl<'g, 'm> Sharing<'g, 'm> {
    /// For positions like (t, q), q those of `system.model`, the mechanism in space.
    pub(crate) fn new(system: &'g Geometry<'m>, t: f64, q: &[f64]) -> Result<Self, AnalysisError> {
        let mut made = Self { system, metric: Metric::new(system.model), balance: None };
        let start = match rank_here(system, t, q) {
            Err(SystemError::Singular { .. }) => return Ok(made),
            other => other?,
        };
        if !start.dropped.is_empty() {
            let (balance, c) = Balance::new(system, &start, t, q)?;
            let found = balance.stresses(&Pose::new(system.model, t, q), &c).unwrap_or_default();
            let worst = found.iter().fold(0.0, |m: f64, s| m.max(s.unbalanced));
            made.balance = Some((balance, worst.max(tolerance::NEGLIGIBLE)));
        }
        Ok(made)
    }

    /// Whether reactions are indeterminate.
    pub fn is_idle(&self) -> bool {
        self.balance.is_none()
    }

    /// Scratch memory of one thread.
    pub fn memory(&self) -> SharingScratch<'m> {
        let (model, rows) = (self.system.model, self.system.size().rows);
        SharingScratch {
            model: model.scratch(),
            pose: Pose::new(model, 0.0, &model.initial()),
            geometry: self.system.scratch(),
            phi: vec![0.0; rows],
            c: vec![0.0; self.system.pattern().nnz()],
            a: vec![0.0; rows],
            balance: self.balance.as_ref().map(|(balance, _)| balance.memory()),
            stresses: Vec::new(),
            rows: Rows::default(),
            solver: None,
            damping: Vec::new(),
            along: Vec::new(),
            work: Vec::new(),
            y: Vec::new(),
            z: Vec::new(),
        }
    }

    /// The self-stresses at a position, left in the scratch memory.
    fn stresses(&self, t: f64, q: &[f64], memory: &mut SharingScratch) -> Result<(), AnalysisError> {
        memory.pose.move_to(t, q);
        if let (Some((balance, limit)), Some(own)) = (&self.balance, &mut memory.balance) {
            self.system.position(t, q, &mut memory.geometry, &mut memory.phi, &mut memory.c, &mut memory.a)?;
            self.system.restore(balance.dropped(), &memory.geometry, &mut memory.c);
            if balance.stresses_into(&memory.pose, &memory.c, own, &mut memory.stresses)
                && memory.stresses.iter().all(|s| s.unbalanced <= tolerance::CLEARLY * limit)
            {
                return Ok(());
            }
        }
        let start = rank_here(self.system, t, q)?;
        memory.stresses = crate::stress::stresses(self.system, &memory.pose, &start, t, q)?;
        Ok(())
    }

    /// Select among all possible reactions: wrenches in world axes about the joints' points on their children;
    /// `condition` receives, by rows of the mechanism in space, the changes of the multipliers of conditions other than
    /// loop closures. Reactions that are not finite (a singular position) stay so.
    pub(crate) fn share(
        &self,
        t: f64,
        q: &[f64],
        joints: &mut [Wrench],
        mut condition: impl FnMut(usize, f64),
        memory: &mut SharingScratch,
    ) -> Result<bool, AnalysisError> {
        let finite = joints.iter().all(|w| w.force.norm().is_finite() && w.moment.norm().is_finite());
        if self.is_idle() || !finite {
            return Ok(false);
        }
        self.stresses(t, q, memory)?;
        if !self.rows(q, memory) {
            return Ok(true);
        }
        let SharingScratch { stresses, rows, solver, damping, along, work, y, z, .. } = memory;
        let mut first = 0.0;
        for pass in 0..REPETITIONS {
            rows.take(&self.metric, joints, along);
            work.clear();
            work.extend((0..rows.scales.len()).map(|i| rows.row(i).map(|(j, x)| x * along[j]).sum::<f64>()));
            if pass == 0 {
                if work.iter().all(|x| *x == 0.0) {
                    return Ok(true);
                }
                damping.resize(rows.scales.len(), tolerance::DAMPING);
                y.resize(rows.cols, 0.0);
                z.resize(rows.scales.len(), 0.0);
                rows.solver(solver).factor(&rows.values, damping);
            }
            let solver = rows.solver(solver);
            solver.solve(work, y);
            solver.weights(z);
            let size = y.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            for ((stress, scale), z) in rows.of(stresses).zip(z.iter()) {
                let alpha = -z * scale;
                for (j, w) in &stress.joints {
                    joints[*j].force += w.force.times(alpha);
                    joints[*j].moment += w.moment.times(alpha);
                }
                for &(row, x) in &stress.conditions {
                    condition(row, x * alpha);
                }
            }
            if pass == 0 {
                first = size;
            }
            if size <= tolerance::SUM_ROUNDING * first {
                break;
            }
        }
        Ok(true)
    }

    /// Both parts of the rule: reactions of the joints, then efforts of `lambda` that no joint feels, where `own` is the
    /// multiplier of a row of the mechanism in space.
    fn share_all(
        &self,
        (t, q): (f64, &[f64]),
        joints: &mut [Wrench],
        own: &dyn Fn(usize) -> Option<usize>,
        lambda: &mut [f64],
        memory: &mut SharingScratch,
    ) -> Result<(), AnalysisError> {
        let condition = |row: usize, x: f64| {
            if let Some(i) = own(row) {
                lambda[i] += x;
            }
        };
        if self.share(t, q, joints, condition, memory)? {
            efforts::share((&memory.pose, &memory.stresses), self.system.model.length(), own, lambda)?;
        }
        Ok(())
    }

    /// The self-stresses weighed and of length 1, side by side over what they load; false where there are none.
    fn rows(&self, q: &[f64], memory: &mut SharingScratch) -> bool {
        let model = self.system.model;
        let SharingScratch { stresses, rows, model: s, .. } = memory;
        if !self.metric.alike {
            model.equations().look(q, &vec![0.0; model.size().nv], s.equations());
        }
        let axes = |j: usize| if self.metric.alike { Mat3::identity() } else { model.joint_frame(j, s) };
        rows.fill(&self.metric, stresses, axes);
        !rows.scales.is_empty()
    }
}

/// `f` with the rule for a motion through the states (t, q), or without where nothing is redundant.
///
/// # Errors
/// Where the mechanism cannot be compiled in space, and those of `f`.
pub(crate) fn with_rule<T, E: From<AnalysisError>>(
    model: &Model,
    reference: Option<(f64, &[f64])>,
    f: impl FnOnce(Option<&Rule>) -> Result<T, E>,
) -> Result<T, E> {
    let Some((t, q)) = reference.filter(|_| may_share(model)) else { return f(None) };
    let (twin, q) = in_space(model, q)?;
    let system = Geometry::of_reactions(model, &twin);
    let sharing = Sharing::new(&system, t, &q)?;
    if sharing.is_idle() {
        return f(None);
    }
    f(Some(&Rule { model, twin: &twin, sharing, rows: rows_between(model, &twin) }))
}

/// As `with_rule`, for reactions of a motion, without a rule where it would change none of them: self-stresses of a
/// mechanism whose loop closures are independent in its plane are perpendicular to it, and where all forces lie in the plane they
/// do no work on the reactions. Then each joint is computed by itself. Compliances along axes inclined to the plane
/// would couple both.
///
/// # Errors
/// As [`with_rule`].
pub(crate) fn with_rule_for_loads<T, E: From<AnalysisError>>(
    model: &Model,
    reference: Option<(f64, &[f64])>,
    f: impl FnOnce(Option<&Rule>) -> Result<T, E>,
) -> Result<T, E> {
    let independent = |(t, q): (f64, &[f64])| analyse(model, t, q).is_ok_and(|start| start.dropped.is_empty());
    let within = || least_compliance(model).is_none() && model.loads_lie_in_plane();
    with_rule(model, reference.filter(|at| !(within() && independent(*at))), f)
}

/// The row of `model` that corresponds to each row of a condition in `twin`: the one with the same index among the rows
/// of its owner. The overall order can differ where one model counts whole turns and the other constrains only rates.
pub(crate) fn rows_between(model: &Model, twin: &Model) -> Vec<Option<usize>> {
    let mut of_owner: HashMap<Owner, Vec<usize>> = HashMap::new();
    for (row, named) in model.row_names.iter().enumerate().skip(model.closing_rows) {
        of_owner.entry(named.owner).or_default().push(row);
    }
    let mut seen: HashMap<Owner, usize> = HashMap::new();
    let mut found = vec![None; twin.row_names.len()];
    for (row, named) in twin.row_names.iter().enumerate().skip(twin.closing_rows) {
        let index = seen.entry(named.owner).or_default();
        found[row] = of_owner.get(&named.owner).and_then(|rows| rows.get(*index)).copied();
        *index += 1;
    }
    found
}

/// Multipliers of the reactions chosen by the rule, from any that satisfy the equations of motion; `split` identifies
/// the kept rows, c is C (m x n). Dense.
///
/// # Errors
/// Where the mechanism cannot be compiled in space, and errors of user functions.
pub fn multipliers(
    model: &Model,
    (t, q, v): (f64, &[f64], &[f64]),
    vdot: &[f64],
    lambda: &mut [f64],
    c: &Matrix,
    split: &Split,
) -> Result<(), AnalysisError> {
    let dropped: Vec<usize> = (0..lambda.len()).filter(|i| split.rows.binary_search(i).is_err()).collect();
    if dropped.is_empty() {
        return Ok(());
    }
    let mut s = model.scratch();
    let given = model.equations().reactions(t, q, v, vdot, lambda, s.equations())?;
    let (mut wanted, mut shared) = (given.joints.clone(), lambda.to_vec());
    with_rule(model, Some((t, q)), |rule| match rule {
        Some(rule) => rule.share(t, q, &mut wanted, &mut shared, &mut rule.memory()),
        None => Ok(()),
    })?;
    let length = model.length();
    let conditions = model.closing_rows.min(lambda.len())..lambda.len();
    let components = |joints: &[Wrench]| -> Vec<f64> {
        joints.iter().flat_map(|w| w.force.0.into_iter().chain(w.moment.times(1.0 / length).0)).collect()
    };
    let mut change: Vec<f64> = components(&wanted).iter().zip(components(&given.joints)).map(|(x, y)| x - y).collect();
    change.extend(conditions.clone().map(|i| shared[i] - lambda[i]));
    // a self-stress for each row left out, in multipliers of this model's rows
    let mut stresses = Vec::with_capacity(dropped.len());
    let mut wrenches = Matrix::new(change.len(), dropped.len());
    for (index, &row) in dropped.iter().enumerate() {
        let mut kept: Vec<f64> = split.dependent.iter().map(|&j| -c[(row, j)]).collect();
        split.solve_transposed(&mut kept);
        let mut n = vec![0.0; lambda.len()];
        n[row] = 1.0;
        split.rows.iter().zip(kept).for_each(|(&i, x)| n[i] = x);
        let mut w = components(&model.equations().wrenches_of(q, &n, s.equations()));
        w.extend(&n[conditions.clone()]);
        let size = w.iter().map(|x| x * x).sum::<f64>().sqrt();
        if size > 0.0 {
            n.iter_mut().for_each(|x| *x /= size);
            w.iter().enumerate().for_each(|(i, x)| wrenches[(i, index)] = x / size);
        }
        stresses.push(n);
    }
    let found = factor::least_squares_min_norm(&wrenches, &change, tolerance::NULL_VALUE);
    let (weights, _) = found.map_err(|e| AnalysisError::Argument {
        argument: "q",
        message: format!("the distribution of load over redundant rows could not be computed here: {e}"),
    })?;
    for (n, x) in stresses.iter().zip(weights) {
        lambda.iter_mut().zip(n).for_each(|(l, n)| *l += x * n);
    }
    Ok(())
}

/// Whether conditions can be redundant that joints pass on: loop closures, and couplings and drives beside a joint.
fn may_share(model: &Model) -> bool {
    let others = model.row_names.len() > model.closing_rows;
    !model.cuts().is_empty() || others && !model.zero_position().joints.is_empty()
}

/// The rule in the coordinates of the model itself.
pub(crate) struct Rule<'a> {
    model: &'a Model,
    twin: &'a Model,
    sharing: Sharing<'a, 'a>,
    /// Row of the model for each row of the twin that belongs to a condition other than a loop closure.
    rows: Vec<Option<usize>>,
}

impl<'a> Rule<'a> {
    pub(crate) fn memory(&self) -> SharingScratch<'a> {
        self.sharing.memory()
    }

    /// See [`Sharing::share`]; of the multipliers `lambda` of the model those of loop closures are unchanged: their
    /// share is in the wrenches.
    pub(crate) fn share(
        &self,
        t: f64,
        q: &[f64],
        joints: &mut [Wrench],
        lambda: &mut [f64],
        memory: &mut SharingScratch,
    ) -> Result<(), AnalysisError> {
        let own = |row: usize| self.rows[row];
        if self.model.needs_turns() {
            let (twin, q) = in_space(self.model, q)?;
            let system = Geometry::of_reactions(self.model, &twin);
            let sharing = Sharing::new(&system, t, &q)?;
            return sharing.share_all((t, &q), joints, &own, lambda, &mut sharing.memory());
        }
        self.sharing.share_all((t, &lifted(self.model, self.twin, q)), joints, &own, lambda, memory)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::examples::*;
    use partita_model::spec::JointKind::Revolute;
    use partita_model::spec::{Axes, Force, PointForce, Spec, Spring, Value, VectorValue};
    use partita_model::zero_position::Coordinates;

    /// A leaf on three hinges of one axis, which carries its weight of 9.81 N.
    fn shaft() -> Spec {
        let mut spec = empty("shaft");
        spec.gravity = [0.0, 0.0, -9.81];
        spec.bodies.push(body("shaft", [0.0; 3], [0.8, 0.0, 0.0]));
        for (name, z) in [("low", -0.8), ("middle", 0.1), ("high", 0.8)] {
            spec.joints.push(joint(name, Revolute, "ground", "shaft", [0.0, 0.0, z], Z));
        }
        spec
    }

    /// Shared wrenches at rest in the drawn position.
    fn shared(m: &Model) -> Vec<Wrench> {
        let (q, v) = (m.initial(), vec![0.0; m.size().nv]);
        let i = crate::instant::at(m, 0.0, &q, Some(&v)).unwrap();
        let mut s = m.scratch();
        let mut joints = m.equations().reactions(0.0, &q, &v, &i.vdot, &i.multipliers, s.equations()).unwrap().joints;
        with_rule::<_, AnalysisError>(m, Some((0.0, &q)), |rule| {
            let rule = rule.expect("something is redundant");
            rule.share(0.0, &q, &mut joints, &mut i.multipliers.clone(), &mut rule.memory())
        })
        .unwrap();
        joints
    }

    #[test]
    fn perpendicular_to_an_orthonormal_base_in_any_coordinates() {
        for spec in [shaft(), tilted(four_bar([Revolute; 4])), bricard(), spherical_four_bar(), tilted(chain(3, 0.4))] {
            let mut before: Option<Vec<Wrench>> = None;
            for coordinates in [Coordinates::Relative, Coordinates::Absolute] {
                let m = compiled(spec.clone(), coordinates);
                let (nj, w) = (m.spec.joints.len(), shared(&m));
                let base = self_stresses(&m, 0.0, &m.initial()).unwrap();
                let per = |c: usize| if c < 3 { 1.0 } else { base.length.powi(-2) };
                let of = |a: usize, j: usize, c: usize| base.wrenches[(a * nj + j) * 6 + c];
                let all = || (0..nj).flat_map(|j| (0..6).map(move |c| (j, c)));
                for a in 0..base.count {
                    for b in 0..base.count {
                        let dot: f64 = all().map(|(j, c)| of(a, j, c) * of(b, j, c) * per(c)).sum();
                        assert!((dot - f64::from(u8::from(a == b))).abs() < 1e-10, "{a} {b} {dot}");
                    }
                    let number = |j: usize, c: usize| if c < 3 { w[j].force.0[c] } else { w[j].moment.0[c - 3] };
                    let along: f64 = all().map(|(j, c)| of(a, j, c) * number(j, c) * per(c)).sum();
                    assert!(along.abs() < 1e-9, "{} {along}", m.spec.name);
                }
                if let Some(before) = &before {
                    for (x, y) in before.iter().zip(&w) {
                        assert!((x.force - y.force).norm() + (x.moment - y.moment).norm() < 1e-9, "{}", m.spec.name);
                    }
                }
                before = Some(w);
            }
        }
    }

    /// In its plane a mechanism has nothing to share, until a mass, a joint, a force or a compliance leaves the plane.
    #[test]
    fn what_lies_in_the_plane_is_left_alone_by_the_rule() {
        let asked = |spec: Spec| {
            let m = model(spec);
            assert!(m.is_planar(), "{}", m.spec.name);
            with_rule_for_loads::<_, AnalysisError>(&m, Some((0.0, &m.initial())), |rule| Ok(rule.is_some())).unwrap()
        };
        let force = |point: [f64; 3], value: [f64; 3]| {
            Force::Force(PointForce {
                name: "push".into(),
                body: "coupler".into(),
                point,
                value: VectorValue::Components(value.map(Value::Constant)),
                axes: Axes::World,
            })
        };
        let spring = |z: f64| {
            Force::Spring(Spring {
                name: "spring".into(),
                body1: "ground".into(),
                point1: [0.0, 2.0, z],
                body2: "coupler".into(),
                point2: [0.1, 0.0, z],
                stiffness: 10.0,
                damping: 0.0,
                length: 1.0,
            })
        };
        let changed = |change: &dyn Fn(&mut Spec)| {
            let mut spec = four_bar([Revolute; 4]);
            spec.gravity = [0.0, -9.81, 0.0];
            change(&mut spec);
            spec
        };
        type Change = fn(&mut Spec);
        let within: [&dyn Fn(&mut Spec); 3] =
            [&|_| {}, &|s| s.forces.push(force([0.0; 3], [1.0, 2.0, 0.0])), &|s| s.forces.push(spring(0.0))];
        for change in within {
            let m = model(changed(change));
            assert!(!asked(changed(change)));
            // and the rule itself says so
            let (q, v) = (m.initial(), vec![0.3; m.size().nv]);
            let i = crate::instant::at(&m, 0.0, &q, Some(&v)).unwrap();
            let own = m
                .equations()
                .reactions(0.0, &q, &i.v, &i.vdot, &i.multipliers, m.scratch().equations())
                .unwrap()
                .joints;
            let mut joints = own.clone();
            with_rule::<_, AnalysisError>(&m, Some((0.0, &q)), |rule| {
                let rule = rule.expect("redundant across the plane");
                rule.share(0.0, &q, &mut joints, &mut i.multipliers.clone(), &mut rule.memory())
            })
            .unwrap();
            for (x, y) in joints.iter().zip(&own) {
                assert!((x.force - y.force).norm() + (x.moment - y.moment).norm() < 1e-13 * x.force.norm());
            }
        }
        // wherever the plane lies
        assert!(!asked(tilted(changed(&|s| s.gravity = [0.0; 3]))));
        let leaving: [Change; 4] = [
            |s| s.gravity[2] = 1e-6,
            |s| s.bodies[1].com[2] += 1e-3,
            |s| s.bodies[1].inertia = [[1.0, 0.0, 0.1], [0.0, 1.0, 0.0], [0.1, 0.0, 1.0]],
            |s| s.joints[2].compliance = Some([1e-8, 1e-8, 2e-8, 1e-7, 1e-7, 0.0]),
        ];
        for change in leaving {
            assert!(asked(changed(&change)));
        }
        for change in [force([0.0, 0.0, 1e-3], [1.0, 2.0, 0.0]), force([0.0; 3], [0.0, 0.0, 1.0]), spring(1e-3)] {
            assert!(asked(changed(&|s| s.forces.push(change.clone()))));
        }
        // nor where two cranks hold what one would
        let mut twice = changed(&|_| {});
        let weld = joint("again", Revolute, "crank", "coupler", twice.joints[1].point, Z);
        twice.joints.push(weld);
        assert!(asked(twice));
    }

    /// Along the axis a self-stress is a force alone: elastic hinges share the weight as 1 / compliance.
    #[test]
    fn elastic_hinges_share_by_their_compliance() {
        let even = shared(&model(shaft()));
        assert!(even.iter().all(|w| (w.force.0[2] - 3.27).abs() < 1e-10));
        let mut spec = shaft();
        for (j, c) in spec.joints.iter_mut().zip([1e-8, 2e-8, 4e-8]) {
            j.compliance = Some([c, c, c, 1e-7, 1e-7, 0.0]);
        }
        let shares = shared(&model(spec));
        for (w, part) in shares.iter().zip([4.0, 2.0, 1.0]) {
            assert!((w.force.0[2] - 9.81 * part / 7.0).abs() < 1e-8, "{:?}", w.force);
        }
    }

    #[test]
    fn multipliers_of_the_rule_balance_the_same_motion() {
        let m = model(bricard());
        let (q, v) = (m.initial(), vec![0.0; m.size().nv]);
        let i = crate::instant::at(&m, 0.0, &q, Some(&v)).unwrap();
        let mut lambda = i.multipliers.clone();
        multipliers(&m, (0.0, &q, &v), &i.vdot, &mut lambda, &i.c, &i.split).unwrap();
        assert!(lambda.iter().zip(&i.multipliers).any(|(x, y)| (x - y).abs() > 1e-3));
        let change: Vec<f64> = lambda.iter().zip(&i.multipliers).map(|(x, y)| x - y).collect();
        assert!(i.c.transpose().matvec(&change).iter().all(|x| x.abs() < 1e-10));
        let own = m.equations().reactions(0.0, &q, &v, &i.vdot, &lambda, m.scratch().equations()).unwrap().joints;
        for (x, y) in own.iter().zip(shared(&m)) {
            assert!((x.force - y.force).norm() < 1e-9);
        }
    }
}
