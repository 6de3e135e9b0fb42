//! One rule for what rigid bodies leave open: how redundant joints share their load.                          (R2)
//!
//! Reactions w of all joints are known up to self-stresses, w + S α. Of all that are possible those are returned that
//! are least in a metric W,
//!
//! ```text
//! min Σ_j w_jᵀ W_j w_j     w* = w − S (Sᵀ W S)⁻¹ Sᵀ W w
//! ```
//!
//! over all joints, whether they carry coordinates or close loops. Without compliances W_j weighs forces by 1 and
//! moments about the joint's point by 1/L², L the typical length of a body: a number without units, the same in all
//! axes and for every choice of coordinates, cuts and rows. With compliances of the joints it is twice their elastic
//! energy, so that w* are the reactions of rigid bodies on elastic joints (Castigliano). Either way w* moves
//! continuously with the mechanism, and what every self-stress leaves alone is left alone.

use crate::drawn::Drawn;
use crate::error::AnalysisError;
use crate::geometry::{lifted, Geometry};
use crate::stress::{Balance, Pose, Stress};
use partita_math::dense::Matrix;
use partita_math::elimination::Pattern;
use partita_math::factor;
use partita_math::least_norm::LeastNorm;
use partita_math::spatial::{Mat3, Vec3};
use partita_model::model::ModelScratch;
use partita_model::reaction::Wrench;
use partita_model::rows::Owner;
use partita_model::Model;
use partita_system::partition::split::Split;
use partita_system::start::analyse;
use partita_system::{ConstrainedSystem, SystemError};
use std::collections::HashMap;

/// Damping of the least-norm solution over the squared length of a self-stress; repetitions take its effect back.
const DAMPING: f64 = 1e-10;
/// Repetitions at the most: each leaves of the error the damping over the squared sine between self-stresses.
const REPETITIONS: usize = 12;
/// A correction below this part of the first is rounding.
const SETTLED: f64 = 1e-14;
/// What an elimination of another position may leave unbalanced, over what the reference left.
const WORN: f64 = 1e-9;
/// Compliance of what is not said to be elastic, over the least compliance that was: nothing, as far as six digits show
/// it.
const RIGID: f64 = 1e-6;

/// Component i of a compliance as that of a force: a moment acts on an arm of a length.
fn as_of_a_force(length: f64, i: usize, c: f64) -> f64 {
    if i < 3 {
        c
    } else {
        c * length * length
    }
}

/// The least of the compliances given, if any is.
fn least_compliance(model: &Model) -> Option<f64> {
    let given = model.spec.joints.iter().flat_map(|j| j.compliance.iter().flat_map(|c| c.iter().enumerate()));
    let as_force = given.filter(|(_, &c)| c > 0.0).map(|(i, &c)| as_of_a_force(model.placed.length, i, c));
    as_force.min_by(f64::total_cmp)
}

/// Weights of the six components of each joint's wrench, square roots, along the joint's axes.
#[derive(Clone, Debug)]
struct Metric {
    weights: Vec<[f64; 6]>,
    /// Are they the same along all axes?
    alike: bool,
}

impl Metric {
    fn new(model: &Model) -> Self {
        let length = model.placed.length;
        let joints = &model.spec.joints;
        let plain = |x: f64| [x, x, x, x / length, x / length, x / length];
        let Some(least) = least_compliance(model) else {
            return Self { weights: vec![plain(1.0); joints.len()], alike: true };
        };
        let as_force = |i: usize, c: f64| as_of_a_force(length, i, c);
        let rigid = RIGID * least;
        let of = |c: &Option<[f64; 6]>| {
            let scale = plain(1.0);
            std::array::from_fn(|i| c.map_or(rigid, |c| as_force(i, c[i]).max(rigid)).sqrt() * scale[i])
        };
        Self { weights: joints.iter().map(|j| of(&j.compliance)).collect(), alike: false }
    }

    /// The wrench whose plain square is the metric's.
    fn weighed(&self, j: usize, axes: &Mat3<f64>, w: &Wrench) -> [f64; 6] {
        let k = &self.weights[j];
        let (f, m) = match self.alike {
            true => (w.force, w.moment),
            false => (axes.apply_transposed(w.force), axes.apply_transposed(w.moment)),
        };
        std::array::from_fn(|i| k[i] * if i < 3 { f.0[i] } else { m.0[i - 3] })
    }
}

/// The rule for one mechanism, with what lasts from one position to the next.
pub struct Sharing<'g, 'm> {
    system: &'g Geometry<'m>,
    metric: Metric,
    drawn: Drawn,
    balance: Option<(Balance<'g, 'm>, f64)>,
}

/// Room that positions share.
pub struct Room {
    model: ModelScratch,
    solver: Option<(Pattern, LeastNorm)>,
}

impl<'g, 'm> Sharing<'g, 'm> {
    /// For positions like (t, q), q those of `system.model`, the mechanism in space.
    pub(crate) fn new(system: &'g Geometry<'m>, t: f64, q: &[f64]) -> Result<Self, AnalysisError> {
        let drawn = Drawn::of(system, t, q);
        let mut made = Self { system, metric: Metric::new(system.model), drawn, balance: None };
        let start = match drawn.rank_at(system, t, q) {
            Err(SystemError::Singular { .. }) => return Ok(made),
            other => other?,
        };
        if !start.dropped.is_empty() {
            let (balance, c) = Balance::new(system, &start, t, q)?;
            let found = balance.stresses(&Pose::new(system.model, t, q), &c).unwrap_or_default();
            let worst = found.iter().fold(0.0, |m: f64, s| m.max(s.unbalanced));
            made.balance = Some((balance, worst.max(WORN)));
        }
        Ok(made)
    }

    /// Is there anything to share?
    pub fn is_idle(&self) -> bool {
        self.balance.is_none()
    }

    /// Room for one thread.
    pub fn room(&self) -> Room {
        Room { model: self.system.model.scratch(), solver: None }
    }

    /// The self-stresses at a position.
    fn stresses(&self, t: f64, q: &[f64]) -> Result<Vec<Stress>, AnalysisError> {
        let pose = Pose::new(self.system.model, t, q);
        if let Some((balance, limit)) = &self.balance {
            let c = self.system.jacobian(t, q)?;
            if let Some(found) = balance.stresses(&pose, &c) {
                if found.iter().all(|s| s.unbalanced <= 10.0 * limit) {
                    return Ok(found);
                }
            }
        }
        let start = self.drawn.rank_at(self.system, t, q)?;
        crate::stress::stresses(self.system, &pose, &start, t, q)
    }

    /// Choose the reactions among all that are possible: wrenches in world axes about the joints' points on their
    /// children; `condition` is told, by rows of the mechanism in space, what the multipliers of conditions that are no
    /// closings change by. Reactions that are not finite (a singular position) stay so.
    pub(crate) fn share(
        &self,
        t: f64,
        q: &[f64],
        joints: &mut [Wrench],
        mut condition: impl FnMut(usize, f64),
        room: &mut Room,
    ) -> Result<(), AnalysisError> {
        let finite = joints.iter().all(|w| w.force.norm().is_finite() && w.moment.norm().is_finite());
        if self.is_idle() || !finite {
            return Ok(());
        }
        let stresses = self.stresses(t, q)?;
        let Some(rows) = self.rows(q, &stresses, room) else { return Ok(()) };
        let solver = match &mut room.solver {
            Some((pattern, solver)) if *pattern == rows.pattern => solver,
            other => &mut other.insert((rows.pattern.clone(), LeastNorm::new(&rows.pattern))).1,
        };
        solver.factor(&rows.values, &vec![DAMPING; rows.pattern.rows]);
        let axes = |j: usize, s: &ModelScratch| self.axes(j, s);
        let (mut y, mut z) = (vec![0.0; rows.pattern.cols], vec![0.0; rows.pattern.rows]);
        let mut first = 0.0;
        for pass in 0..REPETITIONS {
            let mut along = vec![0.0; rows.pattern.cols];
            for (place, &j) in rows.joints.iter().enumerate() {
                let weighed = self.metric.weighed(j, &axes(j, &room.model), &joints[j]);
                along[6 * place..][..6].copy_from_slice(&weighed);
            }
            let dot = |i: usize| rows.pattern.row(i).map(|e| rows.values[e] * along[rows.pattern.col_idx[e]]).sum();
            let r: Vec<f64> = (0..rows.pattern.rows).map(dot).collect();
            solver.solve(&r, &mut y);
            solver.weights(&mut z);
            let size = y.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            for ((stress, scale), z) in rows.of(&stresses).zip(&z) {
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
            if size <= SETTLED * first {
                break;
            }
        }
        Ok(())
    }

    fn axes(&self, j: usize, s: &ModelScratch) -> Mat3<f64> {
        match self.metric.alike {
            true => Mat3::identity(),
            false => self.system.model.joint_frame(j, s),
        }
    }

    /// The self-stresses weighed and of length 1, side by side over the joints that they load.
    fn rows(&self, q: &[f64], stresses: &[Stress], room: &mut Room) -> Option<Rows> {
        let model = self.system.model;
        if !self.metric.alike {
            model.look(q, &vec![0.0; model.placed.nv], &mut room.model);
        }
        let mut place = vec![usize::MAX; model.placed.joints.len()];
        let mut joints = Vec::new();
        for &(j, _) in stresses.iter().flat_map(|s| &s.joints) {
            if place[j] == usize::MAX {
                place[j] = joints.len();
                joints.push(j);
            }
        }
        let (mut columns, mut values, mut scales) = (Vec::new(), Vec::new(), Vec::new());
        for (i, stress) in stresses.iter().enumerate() {
            let weighed: Vec<(usize, [f64; 6])> = stress
                .joints
                .iter()
                .map(|(j, w)| (place[*j], self.metric.weighed(*j, &self.axes(*j, &room.model), w)))
                .collect();
            let length = weighed.iter().flat_map(|x| x.1).map(|x| x * x).sum::<f64>().sqrt();
            if length > 0.0 {
                columns.push(weighed.iter().flat_map(|(p, _)| (0..6).map(move |c| 6 * p + c)).collect());
                values.extend(weighed.iter().flat_map(|x| x.1).map(|x| x / length));
                scales.push((i, 1.0 / length));
            }
        }
        let pattern = Pattern::from_rows(6 * joints.len(), &columns);
        (!scales.is_empty()).then_some(Rows { pattern, values, joints, scales })
    }
}

/// Self-stresses as a sparse matrix.
struct Rows {
    pattern: Pattern,
    values: Vec<f64>,
    /// Joint of each six columns.
    joints: Vec<usize>,
    /// Number and scale of the self-stress of each row.
    scales: Vec<(usize, f64)>,
}

impl Rows {
    fn of<'a>(&'a self, stresses: &'a [Stress]) -> impl Iterator<Item = (&'a Stress, f64)> {
        self.scales.iter().map(|&(i, scale)| (&stresses[i], scale))
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
    let Some((t, q)) = reference.filter(|_| has_loops(model)) else { return f(None) };
    let twin = model.in_space().map_err(AnalysisError::from)?;
    let system = Geometry::new(&twin, true);
    let sharing = Sharing::new(&system, t, &lifted(model, &twin, q))?;
    if sharing.is_idle() {
        return f(None);
    }
    f(Some(&Rule { model, twin: &twin, sharing, rows: rows_between(model, &twin) }))
}

/// The same for reactions of a motion, without a rule where it would change none of them: self-stresses of a mechanism
/// whose closings are independent in its plane lie across it, and where all that acts lies in the plane they do no work on
/// the reactions. Then each joint is found by itself. Compliances along axes that lean out of the plane would tie both.
///
/// # Errors
/// As [`with_rule`].
pub(crate) fn with_rule_for_loads<T, E: From<AnalysisError>>(
    model: &Model,
    reference: Option<(f64, &[f64])>,
    f: impl FnOnce(Option<&Rule>) -> Result<T, E>,
) -> Result<T, E> {
    let independent = |(t, q): (f64, &[f64])| analyse(model, t, q).is_ok_and(|start| start.dropped.is_empty());
    let within = || least_compliance(model).is_none() && model.carries_in_plane();
    with_rule(model, reference.filter(|at| !(within() && independent(*at))), f)
}

/// The row of `model` that says the same as each row of a condition in `twin`: the one that is as far down among those
/// of its owner. The order of all can differ, where one space counts whole turns and the other holds rates alone.
pub(crate) fn rows_between(model: &Model, twin: &Model) -> Vec<Option<usize>> {
    let mut of_owner: HashMap<Owner, Vec<usize>> = HashMap::new();
    for (row, named) in model.row_names.iter().enumerate().skip(model.closing_rows) {
        of_owner.entry(named.owner).or_default().push(row);
    }
    let mut seen: HashMap<Owner, usize> = HashMap::new();
    let mut found = vec![None; twin.row_names.len()];
    for (row, named) in twin.row_names.iter().enumerate().skip(twin.closing_rows) {
        let place = seen.entry(named.owner).or_default();
        found[row] = of_owner.get(&named.owner).and_then(|rows| rows.get(*place)).copied();
        *place += 1;
    }
    found
}

/// Orthonormal self-stresses at one position: a base of all that can be added to the reactions there.
#[derive(Clone, Debug, Default)]
pub struct SelfStresses {
    /// Force and moment about the joint's point on its child, world axes, of every joint in each self-stress (s x 6
    /// nj).
    pub wrenches: Vec<f64>,
    /// Effort of every drive in each (s x drives).
    pub efforts: Vec<f64>,
    /// How many.
    pub count: usize,
    /// What moments are divided by to be compared with forces.
    pub length: f64,
}

/// Squares of components within this part of each other are equal: the first joint is taken.
const EQUAL: f64 = 1e-6;
/// Singular values of self-stresses of length 1 below this part of the largest are nothing.
const SAME: f64 = 1e-10;

/// The self-stresses at (t, q), orthonormal in the metric of the rule, in an order that depends on the mechanism alone:
/// the first loads some component as heavily as any can, the next loads it not at all and another one as heavily as is
/// left.
///
/// For looking at; dense, O(s² nj).
///
/// # Errors
/// Where the mechanism cannot be compiled in space or has no rank.
pub fn self_stresses(model: &Model, t: f64, q: &[f64]) -> Result<SelfStresses, AnalysisError> {
    let (nj, nd) = (model.placed.joints.len(), model.drives.len());
    let none = SelfStresses { length: model.placed.length, ..SelfStresses::default() };
    with_rule(model, Some((t, q)), |rule| {
        let Some(Rule { twin, sharing, .. }) = rule else { return Ok(none) };
        let q = lifted(model, twin, q);
        let stresses = sharing.stresses(t, &q)?;
        let mut room = sharing.room();
        let Some(rows) = sharing.rows(&q, &stresses, &mut room) else { return Ok(none) };
        twin.look(&q, &vec![0.0; twin.placed.nv], &mut room.model);
        let mut given = Matrix::new(rows.pattern.rows, rows.pattern.cols);
        for i in 0..rows.pattern.rows {
            for e in rows.pattern.row(i) {
                given[(i, rows.pattern.col_idx[e])] = rows.values[e];
            }
        }
        let parts = factor::svd(&given).map_err(|e| AnalysisError::Argument {
            argument: "state",
            message: format!("the self-stresses have no orthonormal base here: {e}"),
        })?;
        let s = parts.rank(SAME);
        // weights of the rows given, per unit length of the base: base = weights given
        let mut weights = Matrix::new(s, given.rows());
        for (a, i) in (0..s).flat_map(|a| (0..given.rows()).map(move |i| (a, i))) {
            weights[(a, i)] = parts.u[(i, a)] / parts.s[a];
        }
        // the same along the joints' axes, so that the order does not depend on the world's
        let turned: Vec<Mat3<f64>> = rows
            .joints
            .iter()
            .map(|&j| if sharing.metric.alike { twin.joint_frame(j, &room.model) } else { Mat3::identity() })
            .collect();
        let mut along = Matrix::new(s, rows.pattern.cols);
        for a in 0..s {
            for (place, axes) in turned.iter().enumerate().flat_map(|(p, m)| [(6 * p, m), (6 * p + 3, m)]) {
                let x = Vec3(std::array::from_fn(|c| parts.v[(place + c, a)]));
                along.row_mut(a)[place..place + 3].copy_from_slice(&axes.apply_transposed(x).0);
            }
        }
        turn_to_pivots(&mut along, &mut weights);
        let mut found = SelfStresses { wrenches: vec![0.0; s * 6 * nj], efforts: vec![0.0; s * nd], count: s, ..none };
        for a in 0..s {
            for ((stress, scale), x) in rows.of(&stresses).zip(weights.row(a)) {
                for (j, w) in &stress.joints {
                    let to = &mut found.wrenches[(a * nj + j) * 6..][..6];
                    to.iter_mut().zip(w.force.0.iter().chain(&w.moment.0)).for_each(|(to, w)| *to += x * scale * w);
                }
                for (d, effort) in &stress.drives {
                    found.efforts[a * nd + d] += x * scale * effort;
                }
            }
        }
        Ok(found)
    })
}

/// Turn an orthonormal base (rows of `along`) so that row i is the projection of a unit component onto what the rows
/// before it leave, the longest there is, the first of equals; `weights` along with it.
fn turn_to_pivots(along: &mut Matrix, weights: &mut Matrix) {
    let (s, n) = (along.rows(), along.cols());
    for a in 0..s {
        let size = |j: usize, along: &Matrix| (a..s).map(|i| along[(i, j)].powi(2)).sum::<f64>();
        let most = (0..n).fold(0.0, |m: f64, j| m.max(size(j, along)));
        let Some(pivot) = (0..n).find(|&j| size(j, along) >= (1.0 - EQUAL) * most) else { return };
        // rotate rows a.. so that row a takes all of column `pivot`, one pair after the other
        for i in a + 1..s {
            let (x, y) = (along[(a, pivot)], along[(i, pivot)]);
            let r = x.hypot(y);
            if r == 0.0 {
                continue;
            }
            let (cos, sin) = (x / r, y / r);
            for m in [&mut *along, &mut *weights] {
                for j in 0..m.cols() {
                    let (x, y) = (m[(a, j)], m[(i, j)]);
                    (m[(a, j)], m[(i, j)]) = (cos * x + sin * y, cos * y - sin * x);
                }
            }
        }
        if along[(a, pivot)] < 0.0 {
            along.row_mut(a).iter_mut().chain(weights.row_mut(a)).for_each(|x| *x = -*x);
        }
    }
}

/// Multipliers of the reactions that the rule chooses, from any that belong to the motion: `split` says which rows were
/// kept, c is C (m x n). Dense.
///
/// # Errors
/// Where the mechanism cannot be compiled in space, and what a user's function raises.
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
    let given = model.reactions(t, q, v, vdot, lambda, &mut s)?;
    let mut wanted = given.joints.clone();
    with_rule(model, Some((t, q)), |rule| match rule {
        Some(rule) => rule.share(t, q, &mut wanted, &mut lambda.to_vec(), &mut rule.room()),
        None => Ok(()),
    })?;
    let length = model.placed.length;
    let flat = |joints: &[Wrench]| -> Vec<f64> {
        joints.iter().flat_map(|w| w.force.0.into_iter().chain(w.moment.times(1.0 / length).0)).collect()
    };
    let change: Vec<f64> = flat(&wanted).iter().zip(flat(&given.joints)).map(|(x, y)| x - y).collect();
    // a self-stress for each row left out, in multipliers of this model's rows
    let mut stresses = Vec::with_capacity(dropped.len());
    let mut wrenches = Matrix::new(change.len(), dropped.len());
    for (place, &row) in dropped.iter().enumerate() {
        let mut kept: Vec<f64> = split.dependent.iter().map(|&j| -c[(row, j)]).collect();
        split.solve_transposed(&mut kept);
        let mut n = vec![0.0; lambda.len()];
        n[row] = 1.0;
        split.rows.iter().zip(kept).for_each(|(&i, x)| n[i] = x);
        let w = flat(&model.wrenches_of(q, &n, &mut s));
        let size = w.iter().map(|x| x * x).sum::<f64>().sqrt();
        if size > 0.0 {
            n.iter_mut().for_each(|x| *x /= size);
            w.iter().enumerate().for_each(|(i, x)| wrenches[(i, place)] = x / size);
        }
        stresses.push(n);
    }
    let found = factor::least_squares_min_norm(&wrenches, &change, SAME);
    let (weights, _) = found.map_err(|e| AnalysisError::Argument {
        argument: "q",
        message: format!("how redundant rows share their load could not be computed here: {e}"),
    })?;
    for (n, x) in stresses.iter().zip(weights) {
        lambda.iter_mut().zip(n).for_each(|(l, n)| *l += x * n);
    }
    Ok(())
}

/// Only loops and drives can be redundant.
fn has_loops(model: &Model) -> bool {
    let joints = model.placed.joints.len();
    !model.placed.topology.cuts.is_empty() || joints > 0 && !model.drives.is_empty()
}

/// The rule, asked with the coordinates of the model itself.
pub(crate) struct Rule<'a> {
    model: &'a Model,
    twin: &'a Model,
    sharing: Sharing<'a, 'a>,
    /// Row of the model for each row of the twin that is a condition's and no closing's.
    rows: Vec<Option<usize>>,
}

impl Rule<'_> {
    pub(crate) fn room(&self) -> Room {
        self.sharing.room()
    }

    /// See [`Sharing::share`]; of the multipliers `lambda` of the model those of closings are left as they are: their
    /// share is in the wrenches.
    pub(crate) fn share(
        &self,
        t: f64,
        q: &[f64],
        joints: &mut [Wrench],
        lambda: &mut [f64],
        room: &mut Room,
    ) -> Result<(), AnalysisError> {
        let condition = |row: usize, x: f64| {
            if let Some(own) = self.rows[row] {
                lambda[own] += x;
            }
        };
        self.sharing.share(t, &lifted(self.model, self.twin, q), joints, condition, room)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::examples::*;
    use partita_model::place::Coordinates;
    use partita_model::spec::JointKind::Revolute;
    use partita_model::spec::Spec;

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
        let (q, v) = (m.initial(), vec![0.0; m.placed.nv]);
        let i = crate::instant::at(m, 0.0, &q, Some(&v)).unwrap();
        let mut s = m.scratch();
        let mut joints = m.reactions(0.0, &q, &v, &i.vdot, &i.multipliers, &mut s).unwrap().joints;
        with_rule::<_, AnalysisError>(m, Some((0.0, &q)), |rule| {
            let rule = rule.expect("something is redundant");
            rule.share(0.0, &q, &mut joints, &mut i.multipliers.clone(), &mut rule.room())
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
                let (nj, w) = (m.placed.joints.len(), shared(&m));
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
        let (q, v) = (m.initial(), vec![0.0; m.placed.nv]);
        let i = crate::instant::at(&m, 0.0, &q, Some(&v)).unwrap();
        let mut lambda = i.multipliers.clone();
        multipliers(&m, (0.0, &q, &v), &i.vdot, &mut lambda, &i.c, &i.split).unwrap();
        assert!(lambda.iter().zip(&i.multipliers).any(|(x, y)| (x - y).abs() > 1e-3));
        let change: Vec<f64> = lambda.iter().zip(&i.multipliers).map(|(x, y)| x - y).collect();
        assert!(i.c.transpose().matvec(&change).iter().all(|x| x.abs() < 1e-10));
        let own = m.reactions(0.0, &q, &v, &i.vdot, &lambda, &mut m.scratch()).unwrap().joints;
        for (x, y) in own.iter().zip(shared(&m)) {
            assert!((x.force - y.force).norm() < 1e-9);
        }
    }
}
