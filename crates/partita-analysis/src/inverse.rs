//! Inverse dynamics: the efforts that a motion needs, for any set of actuators.
//!
//! ```text
//! states, v' ──► M v' − h ──► τ_d = D (M v' − h) ──► B τ = τ_d ──► C_Dᵀ λ = (M v' − h − E τ)_D
//! ```
//!
//! The set need not be that which the motion was made with: drives are left out, and actuators are forces, so that none
//! of them is a constraint. Reactions follow from the multipliers of an actuated model, as those of a run do.

pub mod regressor;

use crate::error::AnalysisError;
use crate::outputs::{chunk_of, tables, Rows, States, Watch};
use crate::plausibility::idle;
use crate::sharing::rows_between;
use partita_math::dense::{self, Matrix};
use partita_math::factor;
use partita_math::quadratic::ProgramError;
use partita_math::spatial::Vec3;
use partita_math::tolerance;
use partita_model::freed::{Along, Freed};
use partita_model::model::{ModelScratch, Silent};
use partita_model::rows::Owner;
use partita_model::spec::{Drive, Force, Level, Measure, Value};
use partita_model::Model;
use partita_system::actuation::{self, Actuation};
use partita_system::prelude::*;
use partita_system::reduction::Reduction;
use partita_system::system::Tangent;
use partita_system::{start, SystemError};
use serde::Deserialize;
use std::sync::Arc;

/// One actuator as named by the user: an effort along a measurement, or a force along an axis of a body.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Actuator {
    /// Name.
    pub name: String,
    /// The measurement, or the displacements of a point along the axes of the world.
    pub along: Vec<Measure>,
    /// Whether the measurement is a rate alone: of a spatial rotation.
    #[serde(default)]
    pub rate: bool,
    /// Body and axis, body axes, for a force that turns with the body.
    #[serde(default)]
    pub axis: Option<(String, [f64; 3])>,
}

/// What distributes the efforts where there are more actuators than degrees of freedom.
#[derive(Clone, Debug)]
pub struct Distribution {
    /// Weight of each actuator.
    pub weights: Vec<f64>,
    /// Efforts to which the least are added (s), at each instant.
    pub preload: Vec<f64>,
    /// Lower and upper limit of each effort, if there are any.
    pub limits: Vec<[f64; 2]>,
    /// Whether the largest fraction of the limits is to be least, instead of the weighted squares.
    pub least_use: bool,
}

/// Why an instant has no efforts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gap {
    /// It has.
    None,
    /// The constraints lose rank: the motion is not unique here.
    Constraints,
    /// A motion escapes the actuators.
    Actuators,
    /// The accelerations are not known.
    Motion,
}

/// Efforts over the instants of a motion, row by row.
#[derive(Clone, Debug, Default)]
pub struct Efforts {
    /// τ (s).
    pub efforts: Vec<f64>,
    /// λ of the actuated model.
    pub multipliers: Vec<f64>,
    /// Smallest singular value of the set.
    pub margin: Vec<f64>,
    /// What of the needed forces no effort gives, as a fraction.
    pub remainder: Vec<f64>,
    /// Efforts that cause no motion (s x (s − k)).
    pub null_space: Vec<f64>,
    /// Rate along each actuator (s): times its effort, its power.
    pub rates: Vec<f64>,
    /// v', idle rotations as the efforts leave them.
    pub vdot: Vec<f64>,
    /// Degrees of freedom.
    pub k: usize,
    /// Why an instant has no efforts.
    pub gaps: Vec<Gap>,
    /// The instant at which the set is farthest from causing every motion, and the actuator that does the least there.
    pub weakest: Option<(usize, usize)>,
}

/// Where an actuator acts: rows of the actuated model.
#[derive(Clone, Debug)]
struct Lever {
    rows: Vec<usize>,
    /// Number of the body and the axis.
    axis: Option<(usize, [f64; 3])>,
}

/// A mechanism with a set of actuators.
pub struct Inverse {
    /// With a row for each measurement along which an actuator acts.
    actuated: Arc<Model>,
    /// Without drives.
    released: Arc<Model>,
    levers: Vec<Lever>,
    /// Whether a force turns with its body.
    turning: bool,
    /// Whether all efforts act along velocities of the tree: E is constant.
    constant: bool,
    names: Vec<String>,
    /// Row of `actuated` for each row of `released`.
    rows: Vec<usize>,
    /// Its bodies with all joints open.
    freed: Freed,
    /// Rotations that move nothing else.
    idle: usize,
}

/// Memory of a thread.
pub(crate) struct InverseScratch {
    pub(crate) reduction: Reduction<'static, Model>,
    scratch: ModelScratch,
    phi: Vec<f64>,
    c: Vec<f64>,
    a: Vec<f64>,
    still: Vec<f64>,
    residual: Vec<f64>,
    md: Vec<f64>,
    hd: Vec<f64>,
    /// E.
    pub(crate) columns: Vec<Vec<(usize, f64)>>,
    /// Factors of the rows of each actuator.
    factors: Vec<[f64; 3]>,
}

/// Numbers that say how badly a motion violates the constraints: of positions, rates and accelerations the worst part
/// and its row.
const FITS: usize = 6;

impl Inverse {
    /// The forces `silent` have the effort 0: they are actuators themselves.
    ///
    /// # Errors
    /// `Description` for a measurement that does not exist, `Argument` for friction that follows reactions.
    pub fn new(model: &Arc<Model>, actuators: &[Actuator], silent: &[Silent]) -> Result<Self, AnalysisError> {
        let follows = |f: &&Force| matches!(f, Force::Friction(x) if x.follows.is_some());
        if let Some(friction) = model.spec.forces.iter().find(follows).map(Force::name) {
            let message = format!(
                "the friction \"{friction}\" follows the reaction of its joint, which the efforts change in turn; give \
                 its magnitudes (dynamic=)"
            );
            return Err(AnalysisError::Argument { argument: "actuators", message });
        }
        let mut measures: Vec<Drive> = Vec::new();
        let mut number = |along: &Measure, actuator: &Actuator| {
            measures.iter().position(|d| d.measure == *along).unwrap_or_else(|| {
                let level = if actuator.rate { Level::Velocity } else { Level::Position };
                measures.push(Drive::new(&actuator.name, along.clone(), Value::Constant(0.0), level));
                measures.len() - 1
            })
        };
        let numbers: Vec<Vec<usize>> =
            actuators.iter().map(|a| a.along.iter().map(|along| number(along, a)).collect()).collect();
        let actuated = model.with_actuators(measures, silent)?;
        let row_of = |drive: usize| actuated.row_names.iter().position(|r| r.owner == Owner::Drive(drive)).unwrap_or(0);
        let mut levers = Vec::with_capacity(actuators.len());
        for (actuator, numbers) in actuators.iter().zip(&numbers) {
            let body = |name: &str| model.spec.bodies.iter().position(|b| b.name == name);
            let axis = match &actuator.axis {
                None => None,
                Some((name, axis)) => {
                    let unknown = || AnalysisError::Unknown {
                        name: name.clone(),
                        message: format!("actuator \"{}\": there is no body \"{name}\"", actuator.name),
                    };
                    Some((body(name).ok_or_else(unknown)?, *axis))
                }
            };
            levers.push(Lever { rows: numbers.iter().map(|&d| row_of(d)).collect(), axis });
        }
        let released = Arc::new(model.released(silent)?);
        let mut rows: Vec<usize> = (0..released.row_names.len()).collect();
        for (row, own) in rows_between(&actuated, &released).into_iter().enumerate() {
            rows[row] = own.unwrap_or(row);
        }
        let names = actuators.iter().map(|a| a.name.clone()).collect();
        let turning = levers.iter().any(|l| l.axis.is_some());
        let along = |row: usize| actuated.drives().iter().any(|d| d.row == row && d.velocity().is_some());
        let constant = !turning && levers.iter().flat_map(|l| &l.rows).all(|&row| along(row));
        let (idle, freed) = (idle(&released).len(), actuated.freed());
        Ok(Self { actuated: Arc::new(actuated), released, levers, turning, constant, names, rows, freed, idle })
    }

    /// Whether E is the same at all positions, its rate zero.
    pub(crate) fn is_constant(&self) -> bool {
        self.constant
    }

    /// The mechanism without drives.
    pub(crate) fn released(&self) -> &Arc<Model> {
        &self.released
    }

    /// Number of actuators.
    pub fn count(&self) -> usize {
        self.levers.len()
    }

    /// A large value of the measurement of actuator `j`: 1 for an angle, a length for a displacement.
    pub(crate) fn size(&self, j: usize) -> f64 {
        let turns = self.levers[j].rows.iter().any(|&row| self.actuated.structure().rows[row].is_angle);
        if turns {
            1.0
        } else {
            self.actuated.length()
        }
    }

    /// Their names.
    pub(crate) fn names(&self) -> String {
        self.names.join(", ")
    }

    /// The model whose multipliers are found.
    pub fn actuated(&self) -> &Arc<Model> {
        &self.actuated
    }

    pub(crate) fn memory(&self, rank: usize) -> InverseScratch {
        let (size, n) = (self.actuated.size(), self.released.size().nv);
        let k = n - rank;
        InverseScratch {
            reduction: Reduction::dense(self.released.clone(), rank),
            scratch: self.actuated.scratch(),
            phi: vec![0.0; size.holonomic],
            c: vec![0.0; self.actuated.pattern().nnz()],
            a: vec![0.0; size.rows],
            still: vec![0.0; n],
            residual: vec![0.0; n],
            md: vec![0.0; k * k],
            hd: vec![0.0; k],
            columns: self.levers.iter().map(|l| Vec::with_capacity(self.width(l))).collect(),
            factors: vec![[1.0; 3]; self.levers.len()],
        }
    }

    /// Factors of the rows of an actuator at the last positions.
    fn factors(&self, lever: &Lever, s: &ModelScratch) -> [f64; 3] {
        match lever.axis {
            None => [1.0; 3],
            Some((body, axis)) => {
                let r = self.actuated.body_state(body, s).rotation;
                std::array::from_fn(|i| (0..3).map(|j| r.0[i][j] * axis[j]).sum())
            }
        }
    }

    /// Number of entries of a column of E.
    fn width(&self, lever: &Lever) -> usize {
        lever.rows.iter().map(|&row| self.actuated.pattern().row(row).len()).sum()
    }

    /// E at (t, q), left in the memory with the factors of each actuator.
    pub(crate) fn columns(&self, t: f64, q: &[f64], memory: &mut InverseScratch) -> Result<(), SystemError> {
        let pattern = self.actuated.pattern();
        if self.turning {
            self.actuated.equations().look(q, &memory.still, memory.scratch.equations());
        }
        self.actuated.position(t, q, &mut memory.scratch, &mut memory.phi, &mut memory.c, &mut memory.a)?;
        for ((lever, factors), column) in self.levers.iter().zip(&mut memory.factors).zip(&mut memory.columns) {
            *factors = self.factors(lever, &memory.scratch);
            column.clear();
            for (&row, factor) in lever.rows.iter().zip(factors) {
                column.extend(pattern.row(row).map(|e| (pattern.col_idx[e], *factor * memory.c[e])));
            }
        }
        Ok(())
    }

    /// The columns of E at (t, q), nv numbers each, one after the other.
    ///
    /// # Errors
    /// Where the model cannot be evaluated.
    pub fn columns_at(&self, t: f64, q: &[f64]) -> Result<Vec<f64>, SystemError> {
        let (mut memory, n) = (self.memory(0), self.released.size().nv);
        self.columns(t, q, &mut memory)?;
        let mut all = vec![0.0; n * memory.columns.len()];
        for (row, column) in all.chunks_exact_mut(n).zip(&memory.columns) {
            column.iter().for_each(|&(i, x)| row[i] += x);
        }
        Ok(all)
    }

    /// E'ᵀ v of each actuator at v, after `columns` at the same (t, q): what its rate changes by for v' = 0. `b` has room for
    /// all rows.
    pub(crate) fn biases(
        &self,
        (t, q, v): (f64, &[f64], &[f64]),
        memory: &mut InverseScratch,
        b: &mut [f64],
        out: &mut [f64],
    ) -> Result<(), SystemError> {
        self.actuated.velocity(t, q, v, &mut memory.scratch, b)?;
        if self.turning {
            self.actuated.equations().look(q, v, memory.scratch.equations());
        }
        let pattern = self.actuated.pattern();
        for ((lever, factors), x) in self.levers.iter().zip(&memory.factors).zip(out) {
            *x = lever.rows.iter().zip(factors).map(|(&row, factor)| factor * b[row]).sum();
            if let Some((body, _)) = lever.axis {
                // the axis turns with its body
                let turned = self.actuated.body_state(body, &memory.scratch).angular_velocity.cross(Vec3(*factors)).0;
                for (&row, factor) in lever.rows.iter().zip(turned) {
                    *x += factor * pattern.row(row).map(|e| memory.c[e] * v[pattern.col_idx[e]]).sum::<f64>();
                }
            }
        }
        Ok(())
    }

    /// |E_s|² of each actuator at the positions of the last `columns`, with all joints open.                (I2)
    pub(crate) fn lengths2(&self, t: f64, q: &[f64], memory: &mut InverseScratch) -> Result<Vec<f64>, SystemError> {
        self.actuated.equations().look(q, &memory.still, memory.scratch.equations());
        let length2 = |(lever, factors): (&Lever, &[f64; 3])| {
            let rows = lever.rows.iter().zip(factors).map(|(&row, factor)| (Along::Row(row), *factor));
            self.freed.length2(self.actuated.equations(), (t, q), memory.scratch.evaluated(), rows)
        };
        self.levers.iter().zip(&memory.factors).map(length2).collect()
    }

    /// The set at (t, q): B and its margin, with the choice of coordinates left in the reduction.
    pub(crate) fn set(&self, t: f64, q: &[f64], memory: &mut InverseScratch) -> Result<Actuation, AnalysisError> {
        self.columns(t, q, memory)?;
        start::choose_partition(&mut memory.reduction, t, q, None, None)?;
        let lengths2 = self.lengths2(t, q, memory)?;
        let r = &mut memory.reduction;
        let k = r.k();
        r.system.velocity(t, q, &memory.still, &mut r.scratch, &mut r.at.b)?;
        let tangent = Tangent { k, dt: &r.at.dt, delta: &memory.still };
        r.system.project(t, q, &memory.still, &tangent, &mut r.scratch, &mut memory.md, &mut memory.hd)?;
        let d: Vec<Vec<f64>> = (0..k).map(|c| (0..memory.still.len()).map(|i| r.at.dt[i * k + c]).collect()).collect();
        self.freed.add_lacking(self.actuated.equations(), q, &d, memory.scratch.equations(), &mut memory.md);
        let mut b = Matrix::new(k, memory.columns.len());
        actuation::reduced(&r.at.dt, k, memory.columns.iter().map(Vec::as_slice), b.data_mut());
        Ok(Actuation::new(b, &memory.md, &lengths2).map_err(|e| match e {
            Some((i, pivot)) => SystemError::Mass {
                name: r.system.structure().velocity_name(r.planned.partition.independent[i]),
                pivot,
            },
            None => SystemError::NotFinite { what: "the effect of the actuators".into(), t },
        })?)
    }

    /// Rank of the constraints at the first instant that is not singular.
    fn rank(&self, states: &States) -> Result<usize, AnalysisError> {
        let mut first = None;
        for i in 0..states.len() {
            let (t, q, _) = states.at(&self.released, i);
            match start::analyse(&*self.released, t, q) {
                Ok(found) => return Ok(found.rank),
                Err(e @ (SystemError::SingularStart { .. } | SystemError::Singular { .. })) => {
                    first.get_or_insert(e);
                }
                Err(e) => return Err(e.into()),
            }
        }
        match first {
            Some(e) => Err(e.into()),
            None => Ok(0),
        }
    }

    /// Efforts, multipliers and margins for the accelerations v' at the states, which belong to one branch.
    ///
    /// # Errors
    /// `Argument` for a motion that violates the constraints; errors of user functions, and those of `watch`.
    pub fn efforts(
        &self,
        states: &States,
        vdot: &[f64],
        by: &Distribution,
        watch: Watch,
    ) -> Result<Efforts, AnalysisError> {
        let rank = self.rank(states)?;
        let (n, s, rows) = (self.released.size().nv, self.levers.len(), self.actuated.size().rows);
        let k = n - rank;
        if k == 0 {
            let message = "the mechanism has no degree of freedom without its drives: no actuator can move it".into();
            return Err(AnalysisError::Argument { argument: "actuators", message });
        }
        let spare = s.saturating_sub(k);
        // rotations that move nothing else, and have no actuator
        let spins = s < k && k - s <= self.idle;
        let widths = [s, rows, 1, 1, s * spare, 1, 1, FITS, s, n];
        let row = |i: usize, memory: &mut InverseScratch, out: &mut Rows| {
            let (t, q, v) = states.at(&self.released, i);
            let vdot = &vdot[i * n..][..n];
            out.row(9, i).copy_from_slice(vdot);
            for table in 0..4 {
                out.row(table, i).fill(f64::NAN);
            }
            out.row(4, i).fill(f64::NAN);
            let mut gap = |gap: Gap| out.row(5, i)[0] = f64::from(gap as u8);
            if vdot.iter().any(|x| !x.is_finite()) {
                gap(Gap::Motion);
                return Ok(());
            }
            let set = match self.set(t, q, memory) {
                Ok(found) => found,
                Err(AnalysisError::System(SystemError::Singular { .. } | SystemError::SingularStart { .. })) => {
                    gap(Gap::Constraints);
                    return Ok(());
                }
                Err(e) => return Err(e),
            };
            for (rate, column) in out.row(8, i).iter_mut().zip(&memory.columns) {
                *rate = column.iter().map(|&(j, e)| e * v[j]).sum();
            }
            self.fit((t, q, v, vdot), memory, out.row(7, i))?;
            out.row(2, i)[0] = set.margin();
            out.row(6, i)[0] = set.weakest().map_or(0.0, |x| x.0 as f64);
            if !set.is_regular() {
                out.row(5, i)[0] = f64::from(Gap::Actuators as u8);
                return Ok(());
            }
            let r = &mut memory.reduction;
            // −D h, and D (M v' − h)
            let mut along = |vdot: &[f64]| {
                r.system.inverse_dynamics(t, q, v, vdot, &mut r.scratch, &mut memory.residual)?;
                let mut sum = vec![0.0; k];
                memory.residual.iter().zip(r.at.dt.chunks_exact(k)).for_each(|(x, d)| dense::axpy(*x, d, &mut sum));
                Ok::<_, SystemError>(sum)
            };
            let (applied, mut needed) = (along(&memory.still)?, along(vdot)?);
            let inertial: Vec<f64> = needed.iter().zip(&applied).map(|(x, y)| x - y).collect();
            let overflow = |_| SystemError::NotFinite { what: "an effort".into(), t };
            let preload = &by.preload[i * s..][..s];
            let mut tau = set.efforts(&needed, preload, &by.weights).map_err(overflow)?;
            if spare > 0 && !by.limits.is_empty() {
                tau = limited(&set, &needed, preload, by, tau, t)?;
            }
            if spins {
                // they go on as they will: M_d du' = B τ − τ_d
                let mut du: Vec<f64> = set.b().matvec(&tau).iter().zip(&needed).map(|(x, y)| x - y).collect();
                let mut l = memory.md.clone();
                factor::cholesky_large(&mut l, k).map_err(overflow)?;
                dense::cholesky_solve(&l, k, &mut du);
                let moved = out.row(9, i);
                moved.iter_mut().zip(r.at.dt.chunks_exact(k)).for_each(|(x, d)| *x += dense::dot(d, &du));
                needed = along(moved)?;
            }
            out.row(0, i).copy_from_slice(&tau);
            out.row(3, i)[0] = set.remainder(&needed, &tau, [&applied, &inertial]);
            if spare > 0 {
                out.row(4, i).copy_from_slice(set.null_space(&by.weights).map_err(overflow)?.data());
            }
            self.multipliers(&tau, memory, out.row(1, i));
            Ok::<(), AnalysisError>(())
        };
        let found = tables(states.len(), &widths, chunk_of(&self.released), || self.memory(rank), row, watch)?;
        let mut found = found.into_iter();
        let mut next = || found.next().unwrap_or_default();
        let (efforts, multipliers, margin, remainder) = (next(), next(), next(), next());
        let (mut null_space, gaps, weakest, fits) = (next(), next(), next(), next());
        let (rates, vdot) = (next(), next());
        self.fitting(states, &fits)?;
        continued(&mut null_space, s, spare, &by.weights);
        let least =
            (0..states.len()).filter(|&i| margin[i].is_finite()).min_by(|&i, &j| margin[i].total_cmp(&margin[j]));
        let gaps =
            gaps.iter().map(|x| [Gap::None, Gap::Constraints, Gap::Actuators, Gap::Motion][*x as usize]).collect();
        let weakest = least.map(|i| (i, weakest[i] as usize));
        Ok(Efforts { efforts, multipliers, margin, remainder, null_space, rates, vdot, k, gaps, weakest })
    }

    /// λ of the actuated model: efforts in the rows of actuators, and `C_Dᵀ λ = (M v' − h − E τ)_D`.          (R1)
    fn multipliers(&self, tau: &[f64], memory: &mut InverseScratch, out: &mut [f64]) {
        out.fill(0.0);
        for ((lever, factors), tau) in self.levers.iter().zip(&memory.factors).zip(tau) {
            lever.rows.iter().zip(factors).for_each(|(&row, factor)| out[row] += factor * tau);
        }
        for (column, tau) in memory.columns.iter().zip(tau) {
            column.iter().for_each(|&(i, e)| memory.residual[i] -= e * tau);
        }
        let partition = &memory.reduction.planned.partition;
        let mut lambda: Vec<f64> = partition.dependent.iter().map(|&i| memory.residual[i]).collect();
        memory.reduction.solve_transposed(&mut lambda);
        partition.rows.iter().zip(lambda).for_each(|(&row, x)| out[self.rows[row]] = x);
    }

    /// Largest violations of S3, S4 and S5 without drives, and leaves the level of velocities at v.
    fn fit(
        &self,
        (t, q, v, vdot): (f64, &[f64], &[f64], &[f64]),
        memory: &mut InverseScratch,
        out: &mut [f64],
    ) -> Result<(), SystemError> {
        let r = &mut memory.reduction;
        r.at.v.copy_from_slice(v);
        r.velocity(t, q)?;
        let (fastest, strongest) = (r.fastest(), r.strongest(vdot));
        let part = |gap: (f64, usize), of: f64| [if of > tolerance::STANDING { gap.0 / of } else { 0.0 }, gap.1 as f64];
        let strongest = strongest.max(fastest * fastest);
        let found = [part(r.gap(), 1.0), part(r.velocity_gap(), fastest), part(r.acceleration_gap(vdot), strongest)];
        out.copy_from_slice(found.as_flattened());
        Ok(())
    }

    /// Refuse a motion that violates the constraints by more than a run may.
    fn fitting(&self, states: &States, fits: &[f64]) -> Result<(), AnalysisError> {
        let kinds = [
            ("positions", tolerance::OPEN, "its closure error", "of what a large displacement causes"),
            ("velocities", tolerance::OPEN_RATE, "its rate error", "of the fastest rate"),
            ("accelerations", tolerance::OPEN_ACCELERATION, "its acceleration error", "of the strongest acceleration"),
        ];
        for (kind, (levels, limit, what, of)) in kinds.into_iter().enumerate() {
            let part = |i: &usize| fits[i * FITS + 2 * kind];
            let Some(worst) = (0..states.len()).max_by(|i, j| part(i).total_cmp(&part(j))) else { continue };
            if part(&worst) <= limit {
                continue;
            }
            let row = &self.released.structure().rows[fits[worst * FITS + 2 * kind + 1] as usize].name;
            let message = format!(
                "the {levels} of the motion do not fit the constraints: at t = {:.6} s constraint {row} is violated, {what} \
                 is {:.2e} {of} (at most {limit:.0e}); give a motion of this mechanism, as simulate and assemble return it",
                states.t[worst],
                part(&worst),
            );
            return Err(AnalysisError::Argument { argument: "motion", message });
        }
        Ok(())
    }
}

/// Efforts within limits; where no distribution is, that with the least use.
fn limited(
    set: &Actuation,
    needed: &[f64],
    preload: &[f64],
    by: &Distribution,
    free: Vec<f64>,
    t: f64,
) -> Result<Vec<f64>, AnalysisError> {
    let fits = |tau: &[f64]| tau.iter().zip(&by.limits).all(|(x, [lower, upper])| (lower..=upper).contains(&x));
    let found = match by.least_use {
        false if fits(&free) => return Ok(free),
        false => set.within(needed, preload, &by.weights, &by.limits),
        true => Err(ProgramError::Infeasible),
    };
    let found = found.or_else(|e| match e {
        ProgramError::Infeasible => set.least_use(needed, &by.limits),
        other => Err(other),
    });
    found.map_err(|e| AnalysisError::Argument {
        argument: "limits",
        message: format!("the efforts within the limits could not be computed at t = {t:.6} s: {e}"),
    })
}

/// Rotate each basis (s x width, row by row) into the one nearest to that before it, so that its columns are continuous:
/// Gram-Schmidt of the previous columns projected on the new space. The first points towards positive efforts.
fn continued(bases: &mut [f64], s: usize, width: usize, weights: &[f64]) {
    let mut before: Option<Vec<Vec<f64>>> = None;
    if width == 0 {
        return;
    }
    let dot = |x: &[f64], y: &[f64]| x.iter().zip(y).zip(weights).map(|((x, y), w)| x * y * w).sum::<f64>();
    for basis in bases.chunks_exact_mut(s * width).filter(|x| x.iter().all(|x| x.is_finite())) {
        let own: Vec<Vec<f64>> = (0..width).map(|j| (0..s).map(|i| basis[i * width + j]).collect()).collect();
        let mut next: Vec<Vec<f64>> = Vec::with_capacity(width);
        let wanted = before.take().unwrap_or_else(|| own.clone());
        for (x, own_x) in wanted.iter().zip(&own) {
            let mut y = vec![0.0; s];
            own.iter().for_each(|o| dense::axpy(dot(o, x), o, &mut y));
            next.iter().for_each(|o| dense::axpy(-dot(o, &y), o, &mut y));
            let length = dot(&y, &y).sqrt();
            if length < tolerance::HALF_LOST {
                // the space has turned away from it: any of its own that is left
                y.clone_from(own_x);
                next.iter().for_each(|o| dense::axpy(-dot(o, &y), o, &mut y));
            }
            let length = dot(&y, &y).sqrt().max(f64::MIN_POSITIVE);
            y.iter_mut().for_each(|y| *y /= length);
            next.push(y);
        }
        if let [only] = &mut next[..] {
            let largest = only.iter().fold(0.0, |m: f64, x| if x.abs() > m.abs() { *x } else { m });
            let turned = wanted == own && largest < 0.0;
            only.iter_mut().filter(|_| turned).for_each(|x| *x = -*x);
        }
        for (j, column) in next.iter().enumerate() {
            column.iter().enumerate().for_each(|(i, x)| basis[i * width + j] = *x);
        }
        before = Some(next);
    }
}
