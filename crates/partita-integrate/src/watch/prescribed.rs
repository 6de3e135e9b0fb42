//! Rows that prescribe a motion: a step may end only where they agree with their own derivatives, since a jump of what is
//! prescribed is not visible in the derivatives.                                                                 (W3)

use super::discontinuity::{Location, Search};
use super::{Look, StepView, Track, Watch};
use crate::failure::StepFailure;
use partita_math::tolerance;
use partita_system::formulation::{Formulation, Prescribing, Prescription};
use partita_system::SystemError;

/// Times in descriptions and runs are off by this at the most. Scale: roundings of a time. Reason: those of a start, of a
/// length, and of a break of a table each.
const WORST_TIME: f64 = 8.0;

/// Levels at which a row is compared with its derivatives: Φ against the integral of velocities, C v + a against that of
/// accelerations.
const POSITION: usize = 0;
const RATE: usize = 1;

/// A row and what belongs to it.
#[derive(Clone, Copy, Debug, Default)]
struct Row {
    row: usize,
    /// Φ and C v + a at the start of the step, which are not zero where conditions are left open.
    violation: [f64; 2],
    /// As `violation`, at the end of the step.
    open_ahead: [f64; 2],
    /// The error of the quadrature at the end of the step.
    missed: [f64; 2],
    /// Size of the terms of Φ and of C v + a at the end of that step, and its maximum so far.
    trial_size: [f64; 2],
    size: [f64; 2],
    /// Its closure error under a large displacement, and whether it is kept.
    row_size: f64,
    kept: bool,
}

/// The rows that prescribe a motion.
#[derive(Clone, Debug, Default)]
pub(crate) struct PrescribedWatch {
    rows: Vec<Row>,
    read: Vec<Prescription>,
}

/// A row that misses the integral of its derivative over a step.
#[derive(Clone, Copy)]
struct Gap {
    /// Which of the rows.
    index: usize,
    level: usize,
    /// The difference from the integral.
    by: f64,
    /// Whether that is more than for a smooth function, so that the step must be rejected.
    shorten: bool,
}

impl PrescribedWatch {
    /// Of these rows.
    pub(crate) fn new(rows: &[usize]) -> Self {
        let read = vec![Prescription::default(); rows.len()];
        Self { rows: rows.iter().map(|&row| Row { row, ..Row::default() }).collect(), read }
    }

    /// A motion starts at t with these quantities: rates that were not made consistent are not jumps.
    ///
    /// # Errors
    /// Where the rows cannot be evaluated.
    pub(crate) fn start(&mut self, formulation: &mut dyn Formulation, t: f64, y: &[f64]) -> Result<(), SystemError> {
        if self.rows.is_empty() {
            return Ok(());
        }
        let integrated = &y[formulation.layout().beside..];
        formulation.point().prescribed(Prescribing::Integrated(t, integrated, false), &mut self.read)?;
        for (x, read) in self.rows.iter_mut().zip(&self.read) {
            (x.violation, x.size) = (read.violation, [0.0; 2]);
        }
        Ok(())
    }

    /// The closed end of the step, the point last evaluated.
    ///
    /// # Errors
    /// Where the rows cannot be evaluated.
    pub(crate) fn read_end(&mut self, formulation: &mut dyn Formulation) -> Result<(), SystemError> {
        if self.rows.is_empty() {
            return Ok(());
        }
        formulation.point().prescribed(Prescribing::Here, &mut self.read)?;
        for (x, read) in self.rows.iter_mut().zip(&self.read) {
            x.open_ahead = read.violation;
        }
        Ok(())
    }

    /// The quadratures at the end of the step.
    fn read_quadratures(&mut self, step: &mut StepView) -> Result<(), SystemError> {
        let integrated = &step.stepper.current().y_new[step.formulation.layout().beside..];
        let point = step.formulation.point();
        point.prescribed(Prescribing::Integrated(step.end.t, integrated, false), &mut self.read)?;
        for (x, read) in self.rows.iter_mut().zip(&self.read) {
            (x.row_size, x.kept) = (read.row_size, read.kept);
            for level in [POSITION, RATE] {
                x.missed[level] = read.violation[level] - x.violation[level];
                x.trial_size[level] = x.size[level].max(read.sizes[level]);
            }
        }
        Ok(())
    }

    /// The row that at this level misses the integral of its derivative most, if one misses it by more than the tolerances.
    fn gap(&self, step: &StepView, level: usize) -> Option<Gap> {
        let ((relative, absolute), (fastest, strongest)) = (step.tolerance, step.end.most);
        // relative to a row's size: the absolute part, the round-off of rates that nearly cancel, and that of times
        let time = WORST_TIME * f64::EPSILON * step.end.t.abs();
        let rounding = match level {
            POSITION => time * fastest,
            _ => tolerance::SOLUTION_ROUNDING * fastest + time * strongest,
        };
        let part = |x: &Row| {
            let allowed = relative * x.trial_size[level] + (absolute + rounding) * x.row_size;
            x.missed[level].abs() / allowed
        };
        // rows left out as redundant are judged by their violations
        let kept = self.rows.iter().enumerate().filter(|(_, x)| x.kept);
        let (index, worst) = kept.max_by(|x, y| part(x.1).total_cmp(&part(y.1)))?;
        let crosses = step.end.crosses || (step.may_end_earlier() && !step.located.times.is_empty());
        let shorten = part(worst) > tolerance::ERROR_GROWTH && !crosses;
        (part(worst) > 1.0).then(|| Gap { index, level, by: worst.missed[level], shorten })
    }

    /// By how much the row of this gap misses the integral at t inside the step, and its second derivative b there.
    fn missed_at(&mut self, step: &mut StepView, t: f64, gap: &Gap) -> Result<[f64; 2], StepFailure<SystemError>> {
        step.interpolate(t)?;
        let beside = step.formulation.layout().beside;
        let at = Prescribing::Integrated(t, &step.state[beside..], true);
        step.formulation.point().prescribed(at, &mut self.read).map_err(|error| StepFailure::Rhs { t, error })?;
        let read = &self.read[gap.index];
        Ok([read.violation[gap.level] - self.rows[gap.index].violation[gap.level], read.bias])
    }
}

impl Watch for PrescribedWatch {
    /// Where a row misses the integral of its derivative over the step: refuse a jump, and end the step where a derivative
    /// jumps or changes fast.
    fn look(&mut self, step: &mut StepView) -> Result<Look, StepFailure<SystemError>> {
        if self.rows.is_empty() {
            return Ok(Look::Clear);
        }
        let (from, to) = step.ends();
        let may = step.may_end_earlier() && step.stepper.current().may_shrink;
        self.read_quadratures(step).map_err(|error| StepFailure::Rhs { t: to, error })?;
        // a rate that jumps leaves a gap of positions as well
        for level in [RATE, POSITION] {
            let Some(gap) = self.gap(step, level) else { continue };
            let search = Search::new(from, to);
            let mut at = |t: f64| self.missed_at(step, t, &gap);
            let mut location = search.jump(&mut at, gap.by)?;
            if may && gap.shorten && location == Location::Smooth && level == RATE {
                location = search.kink(&mut at, gap.by)?;
            }
            match location {
                Location::Jump { t, by } => {
                    let what = step.formulation.point().prescriber(self.rows[gap.index].row).into();
                    return Ok(Look::Refuse(t, SystemError::Jump { what, t, by: by.abs(), rate: level == RATE }));
                }
                _ if !(may && gap.shorten) => {}
                Location::Within { before, .. } if before > from => {
                    return Ok(Look::EndAt { t: before, corner: false })
                }
                Location::Within { after, .. } if after < to => return Ok(Look::EndAt { t: after, corner: false }),
                _ => return Ok(Look::Repeat(None)),
            }
        }
        Ok(Look::Clear)
    }

    fn accept(&mut self, _track: &Track) {
        for x in &mut self.rows {
            (x.violation, x.size) = (x.open_ahead, x.trial_size);
        }
    }
}
