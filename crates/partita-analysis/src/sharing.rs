//! One rule for what rigid bodies leave open: how redundant joints share their load.                          (R2)
//!
//! Reactions w of all joints are known up to self-stresses, w + S α. Of all that are possible those are returned that are
//! least in a metric W,
//!
//! ```text
//! min Σ_j w_jᵀ W_j w_j     w* = w − S (Sᵀ W S)⁻¹ Sᵀ W w
//! ```
//!
//! over all joints, whether they carry coordinates or close loops. Without compliances W_j weighs forces by 1 and moments
//! about the joint's point by 1/L², L the typical length of a body: a number without units, the same in all axes and for
//! every choice of coordinates, cuts and rows. With compliances of the joints it is twice their elastic energy, so that w*
//! are the reactions of rigid bodies on elastic joints (Castigliano). Either way w* moves continuously with the mechanism,
//! and what every self-stress leaves alone is left alone.

use crate::error::AnalysisError;
use crate::geometry::{lifted, Geometry};
use crate::stress::{Balance, Pose, Stress};
use partita_math::elimination::Pattern;
use partita_math::least_norm::LeastNorm;
use partita_math::spatial::Mat3;
use partita_model::model::ModelScratch;
use partita_model::reaction::Wrench;
use partita_model::Model;
use partita_system::start::rank_here;
use partita_system::{ConstrainedSystem, SystemError};

/// Damping of the least-norm solution over the squared length of a self-stress; repetitions take its effect back.
const DAMPING: f64 = 1e-10;
/// Repetitions at the most: each leaves of the error the damping over the squared sine between self-stresses.
const REPETITIONS: usize = 12;
/// A correction below this part of the first is rounding.
const SETTLED: f64 = 1e-14;
/// What an elimination of another position may leave unbalanced, over what the reference left.
const WORN: f64 = 1e-9;
/// Compliance of what is not said to be elastic, over the least compliance that was: nothing, as far as six digits show it.
const RIGID: f64 = 1e-6;

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
        // compliances as those of a force: a moment acts on an arm of a length
        let as_force = |i: usize, c: f64| if i < 3 { c } else { c * length * length };
        let given = joints.iter().flat_map(|j| j.compliance.iter().flat_map(|c| c.iter().enumerate()));
        let least = given.filter(|(_, &c)| c > 0.0).fold(f64::INFINITY, |m, (i, &c)| m.min(as_force(i, c)));
        if !least.is_finite() {
            return Self { weights: vec![plain(1.0); joints.len()], alike: true };
        }
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
        let mut made = Self { system, metric: Metric::new(system.model), balance: None };
        let start = match rank_here(system, t, q) {
            Err(SystemError::Singular { .. }) => return Ok(made),
            other => other?,
        };
        if !start.dropped.is_empty() {
            let (balance, c) = Balance::new(system, &start, t, q)?;
            let found = balance.stresses(&Pose::new(system.model, q), &c).unwrap_or_default();
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
        let pose = Pose::new(self.system.model, q);
        if let Some((balance, limit)) = &self.balance {
            let c = self.system.jacobian(t, q)?;
            if let Some(found) = balance.stresses(&pose, &c) {
                if found.iter().all(|s| s.unbalanced <= 10.0 * limit) {
                    return Ok(found);
                }
            }
        }
        let start = rank_here(self.system, t, q)?;
        crate::stress::stresses(self.system, &pose, &start, t, q)
    }

    /// Choose the reactions among all that are possible: wrenches in world axes about the joints' points on their children, and
    /// the efforts of the drives, by their number. Reactions that are not finite (a singular position) stay so.
    pub(crate) fn share(
        &self,
        t: f64,
        q: &[f64],
        joints: &mut [Wrench],
        drives: &mut [f64],
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
                for (d, effort) in &stress.drives {
                    drives[*d] += effort * alpha;
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
    f(Some(&Rule { model, twin: &twin, sharing }))
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
}

impl Rule<'_> {
    pub(crate) fn room(&self) -> Room {
        self.sharing.room()
    }

    /// See [`Sharing::share`]; `drives` by the numbers of the model's drives.
    pub(crate) fn share(
        &self,
        t: f64,
        q: &[f64],
        joints: &mut [Wrench],
        drives: &mut [f64],
        room: &mut Room,
    ) -> Result<(), AnalysisError> {
        self.sharing.share(t, &lifted(self.model, self.twin, q), joints, drives, room)
    }
}
