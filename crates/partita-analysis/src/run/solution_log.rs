//! Data stored by a run, and the outputs computed from them on request.

use super::verdict::{Finding, Limits};
use super::{Balance, Motions, Recipe};
use crate::error::AnalysisError;
use crate::outputs::{tables, Rows, Watch};
use partita_integrate::march::StepReader;
use partita_integrate::simulate::Settings;
use partita_integrate::step_log::StepLog;
use partita_system::record::{Gap, Gaps, Output, PartitionEvent, Sample};
use partita_system::reduction::largest;
use partita_system::{ConstrainedSystem, SystemError, SystemRef};

/// States read between two looks at an interrupt. Reason: fractions of a second even for large mechanisms.
const READ_AT_ONCE: usize = 64;

/// Outputs of a run with the choices in use: from them everything else about an instant can be computed later.
pub struct SolutionLog {
    /// How the formulation is made.
    pub recipe: Recipe,
    /// Choices, the first included.
    pub events: Vec<PartitionEvent>,
    /// Closed positions and velocities.
    pub outputs: Vec<Output>,
    /// Limits of constraint violations.
    pub limits: Limits,
    /// The steps, with the settings by which they were taken; none of a stepper.
    pub steps: Option<(StepLog, Settings)>,
}

/// Accelerations, multipliers and closures at all outputs, row by row.
#[derive(Clone, Debug)]
pub struct Described {
    /// v' (nv).
    pub vdot: Vec<f64>,
    /// λ of all rows; zero where a row was dropped as redundant.
    pub multipliers: Vec<f64>,
    /// Independent velocities (k), NaN where a position is singular and nothing was chosen.
    pub independent: Vec<f64>,
    /// Largest |Φ| over all rows.
    pub closure: Vec<f64>,
    /// Largest |C v + a| over all rows.
    pub velocity_closure: Vec<f64>,
    /// Number of independent velocities.
    pub k: usize,
    /// Undetermined quantities, where and why.
    pub notes: Vec<String>,
    /// Largest constraint violation at the outputs, relative to the row sizes and to the fastest rate.
    pub gaps: Gaps,
}

/// How mobile the coordinates are, and which velocities are integrated and how good they are, at all outputs, row by
/// row.
#[derive(Clone, Debug)]
pub struct Assessed {
    /// P4 (nv).
    pub measure: Vec<f64>,
    /// σ of the choice.
    pub sigma: Vec<f64>,
    /// √μ of the choice.
    pub sqrt_mu: Vec<f64>,
    /// S (k x nv) of the tangent velocities; empty where independent velocities are integrated, or all.
    pub selector: Vec<f64>,
}

/// Numbers kept of the constraint violations at an output: a relative value and a row of each kind, and the fastest
/// rate.
const OPEN: usize = 5;

/// Number of outputs that share an elimination plan. It depends on the mechanism only, so that results are independent
/// of the number of cores; it is smaller for large mechanisms, so that an interrupt takes effect in time.
fn chunk(nv: usize) -> usize {
    (100_000 / nv.max(1)).clamp(16, 128)
}

impl SolutionLog {
    /// What reads the steps of a run of this system; none where no step is kept.
    ///
    /// # Errors
    /// Where the formulation cannot be made.
    pub fn reader<'s, S: Motions + 's>(
        &self,
        system: impl Into<SystemRef<'s, S>>,
    ) -> Result<Option<StepReader<'s>>, AnalysisError> {
        let Some((_, settings)) = self.steps.as_ref().filter(|(log, _)| log.count() > 0) else { return Ok(None) };
        let system = system.into();
        let nq = system.size().nq;
        let formulation = self.recipe.make(system)?;
        StepReader::new(formulation, nq, settings.method, settings.options.clone())
            .map(Some)
            .map_err(|e| SystemError::argument("settings", format!("settings: {e}")).into())
    }

    /// Read the states at these times into `take`, with the number of each; where no step is kept that at the last earlier
    /// time at which one is, if there is one.
    ///
    /// # Errors
    /// Where something cannot be evaluated, and those of `watch`.
    pub fn read(
        &self,
        reader: &mut StepReader,
        times: &[f64],
        watch: Watch,
        take: &mut dyn FnMut(usize, &Output),
    ) -> Result<(), AnalysisError> {
        let Some((log, _)) = &self.steps else { return Ok(()) };
        // in the order of time, so that each step is loaded once
        let mut order: Vec<usize> = (0..times.len()).collect();
        order.sort_by(|i, j| times[*i].total_cmp(&times[*j]));
        for (done, i) in order.into_iter().enumerate() {
            if done % READ_AT_ONCE == READ_AT_ONCE - 1 {
                watch()?;
            }
            if let Some(state) = reader.read(log, times[i])? {
                take(i, state);
            }
        }
        Ok(())
    }

    /// One table for each width, a row for each output described by the formulation.
    fn tables<S: Motions>(
        &self,
        system: &S,
        shared: bool,
        brief: bool,
        widths: &[usize],
        fill: impl Fn(&Sample, usize, &mut Rows) + Sync,
        watch: Watch,
    ) -> Result<std::vec::IntoIter<Vec<f64>>, AnalysisError> {
        // of redundant rows those in use depend on the outputs before
        let size = system.size();
        let chunk = if shared && self.recipe.rank == size.rows { chunk(size.nv) } else { usize::MAX };
        let row = |i: usize, (f, sample): &mut (Option<_>, Sample), rows: &mut Rows| {
            if i % chunk == 0 {
                *f = Some(self.recipe.make(system)?);
            }
            let Some(f) = f else { return Ok(()) };
            describe(&mut **f, &self.outputs[i], &self.events, sample)?;
            fill(sample, i, rows);
            Ok::<(), AnalysisError>(())
        };
        let scratch = || (None, Sample { brief, ..Sample::default() });
        Ok(tables(self.outputs.len(), widths, chunk, scratch, row, watch)?.into_iter())
    }

    /// Accelerations, multipliers and closures of the outputs; `shared` is false where they may not be computed
    /// concurrently (user functions).
    ///
    /// # Errors
    /// Where something cannot be evaluated, and those of `watch`.
    pub fn describe<S: Motions>(&self, system: &S, shared: bool, watch: Watch) -> Result<Described, AnalysisError> {
        system.described(self, shared, watch)
    }

    pub(super) fn described<S: Motions>(
        &self,
        system: &S,
        shared: bool,
        watch: Watch,
    ) -> Result<Described, AnalysisError> {
        let size = system.size();
        let k = size.nv - self.recipe.rank;
        let fill = |sample: &Sample, i: usize, rows: &mut Rows| {
            rows.row(0, i).copy_from_slice(&sample.vdot);
            rows.row(1, i).copy_from_slice(&sample.multipliers);
            let chosen = rows.row(2, i);
            chosen.fill(f64::NAN);
            for (to, from) in chosen.iter_mut().zip(&sample.independent) {
                *to = *from as f64;
            }
            rows.row(3, i)[0] = sample.closure;
            rows.row(4, i)[0] = sample.velocity_closure;
            let (position, velocity) = (sample.gaps.position, sample.gaps.velocity);
            let closure_error = [position, velocity].map(|gap| [gap.part, gap.row as f64]).concat();
            let (last, open_to) = (OPEN - 1, rows.row(5, i));
            open_to[..last].copy_from_slice(&closure_error);
            open_to[last] = sample.fastest;
        };
        let mut found = self.tables(system, shared, true, &[size.nv, size.rows, k, 1, 1, OPEN], fill, watch)?;
        let mut next = || found.next().unwrap_or_default();
        let (vdot, multipliers, independent) = (next(), next(), next());
        let (closure, velocity_closure) = (next(), next());
        let mut described = Described {
            vdot,
            multipliers,
            independent,
            closure,
            velocity_closure,
            k,
            notes: Vec::new(),
            gaps: self.worst(&next()),
        };
        described.notes.extend(self.undetermined(system, &described, size.nv)?);
        Ok(described)
    }

    /// Work since the start of forces without potential and of driven constraints, at all outputs.
    pub fn work<S: Balance>(&self, system: &S) -> Vec<f64> {
        let mut work: Vec<f64> = self.outputs.iter().map(|x| x.work).collect();
        // where an output cannot be evaluated, nothing else about it is known either
        let counted = system.counted_potential(&self.outputs).unwrap_or_default();
        let first = counted.first().copied().unwrap_or_default();
        work.iter_mut().zip(counted).for_each(|(to, x)| *to += x - first);
        work
    }

    /// Findings of a run from the outputs that were described.
    pub fn judge<S: ConstrainedSystem>(&self, system: &S, described: &Described) -> Vec<Finding> {
        let mut found = Vec::new();
        self.limits.judge(system, &described.gaps, "the output", &mut found);
        found
    }

    /// Measures, qualities and tangent velocities of the outputs.
    ///
    /// # Errors
    /// As `describe`.
    pub fn assess<S: Motions>(&self, system: &S, shared: bool, watch: Watch) -> Result<Assessed, AnalysisError> {
        system.assessed(self, shared, watch)
    }

    pub(super) fn assessed<S: Motions>(
        &self,
        system: &S,
        shared: bool,
        watch: Watch,
    ) -> Result<Assessed, AnalysisError> {
        let fill = |sample: &Sample, i: usize, rows: &mut Rows| {
            rows.row(0, i).copy_from_slice(&sample.measure);
            rows.row(1, i)[0] = sample.sigma;
            rows.row(2, i)[0] = sample.sqrt_mu;
            rows.row(3, i).copy_from_slice(&sample.selector);
        };
        let selector = self.events.first().and_then(|event| event.basis.as_ref()).map_or(0, |s| s.data().len());
        let widths = [system.size().nv, 1, 1, selector];
        let mut found = self.tables(system, shared, false, &widths, fill, watch)?;
        let mut next = || found.next().unwrap_or_default();
        Ok(Assessed { measure: next(), sigma: next(), sqrt_mu: next(), selector: next() })
    }

    /// Largest constraint violations at the outputs.
    fn worst(&self, closure_error: &[f64]) -> Gaps {
        let fastest = largest(closure_error.chunks_exact(OPEN).map(|x| x[OPEN - 1]));
        let mut gaps = Gaps::default();
        for (x, output) in closure_error.chunks_exact(OPEN).zip(&self.outputs) {
            let gap = |i: usize| Gap { part: x[2 * i], t: output.t, row: x[2 * i + 1] as usize };
            let mut here = Gaps { position: gap(0), velocity: gap(1) };
            here.in_parts_of(fastest);
            gaps.raise(&here);
        }
        gaps
    }

    /// A sentence for outputs in which accelerations have no value.
    fn undetermined<S: Motions>(
        &self,
        system: &S,
        found: &Described,
        nv: usize,
    ) -> Result<Option<String>, SystemError> {
        let without = |i: &usize| found.vdot[i * nv..(i + 1) * nv].iter().any(|x| x.is_nan());
        let all: Vec<usize> = (0..self.outputs.len()).filter(without).collect();
        let Some(&first) = all.first() else { return Ok(None) };
        let mut f = self.recipe.make(system)?;
        let mut sample = Sample { brief: true, ..Sample::default() };
        describe(&mut *f, &self.outputs[first], &self.events, &mut sample)?;
        let times = super::some(&all, |&i| format!("{:.6}", self.outputs[i].t));
        let why = sample.note.unwrap_or_else(|| "accelerations are not determined".into());
        Ok(Some(format!("{} outputs (t = {times}) are at singular positions; {why}", all.len())))
    }
}

fn describe<F: partita_system::formulation::Formulation + ?Sized>(
    f: &mut F,
    output: &Output,
    events: &[PartitionEvent],
    sample: &mut Sample,
) -> Result<(), SystemError> {
    f.describe(output, events.get(output.choice), sample)
}
