//! All velocities as states, u = v: one frame for every method that gives `v'` and λ at an instant.
//!
//! The position drifts like t² and the velocity like t (only `C v' + b = 0` holds automatically), so after a step the
//! errors of S3 and S4 are corrected: q by the least change in the mass metric (33) or in dependent coordinates alone
//! (34), v always by (35), which keeps the momentum along the tangent. Prefer the reduced forms except for
//! verification; prefer these where M is cheap to factor and a reference in all coordinates is needed.

use super::{Base, TangentChoice, TangentClosing, TangentLevels, TangentReplay};
use crate::equations::full::{AccelerationRule, Failure, Instant};
use crate::error::Result;
use crate::manifold::orthogonal::{dense_rows, orthogonal_step, MassProjection};
use crate::options::FormulationOptions;
use crate::record::{Correction, History, Output, PartitionEvent, Sample};
use crate::reduction::{velocity_residuals, Reduction, Sides};
use crate::start;
use crate::system::{ConstrainedSystem, SystemError, SystemRef};
use partita_math::dense;
use partita_math::tolerance;

/// Input of the rule, with its own memory excluded.
macro_rules! instant {
    ($self:expr) => {{
        let r = &$self.base.r;
        Instant {
            pattern: r.system.pattern(),
            rows: &$self.rows,
            holonomic: r.size().holonomic,
            mass: &$self.mass,
            h: &$self.h,
            phi: &r.at.phi,
            c: &r.at.c,
            a: &r.at.a,
            b: &r.at.b,
            v: &r.at.v,
            scales: &$self.scales,
        }
    }};
}

/// All velocities of a system, v' and λ by a rule.
///
/// Of the options it reads `correction`, and `switch_threshold` for the partition that (34) moves; it has no independent
/// coordinates of its own.
pub struct AllVelocities<'s, S: ConstrainedSystem> {
    base: Base<'s, S>,
    /// Called once in an evaluation, by its table: the frame is not compiled anew for each of the rules.
    rule: Box<dyn AccelerationRule + Send>,
    /// How the errors are corrected.
    pub(crate) correction: Correction,
    switch_threshold: f64,
    /// The rows given to the rule.
    rows: Vec<usize>,
    /// The choice they were taken from.
    taken: u64,
    mass: Vec<f64>,
    h: Vec<f64>,
    vdot: Vec<f64>,
    lambda: Vec<f64>,
    /// Scales of the rows of C where M is singular, otherwise empty.
    scales: Vec<f64>,
    violation: Vec<f64>,
    factorisations: u64,
    iterations: u64,
}

impl<'s, S: ConstrainedSystem> AllVelocities<'s, S> {
    /// For a system of the given rank (see [`start::analyse`]).
    pub fn new(
        system: impl Into<SystemRef<'s, S>>,
        rank: usize,
        rule: Box<dyn AccelerationRule + Send>,
        options: &FormulationOptions,
    ) -> Self {
        let base = Base::new(Reduction::new(system, rank));
        let size = base.r.size();
        Self {
            base,
            correction: if rule.corrected() && rank > 0 { options.correction } else { Correction::None },
            mass: vec![0.0; rule.mass_pattern().map_or(size.nv * size.nv, |pattern| pattern.nnz())],
            rule,
            switch_threshold: options.switch_threshold,
            rows: Vec::with_capacity(size.rows),
            taken: 0,
            h: vec![0.0; size.nv],
            vdot: vec![0.0; size.nv],
            lambda: vec![0.0; size.rows],
            scales: Vec::new(),
            violation: Vec::with_capacity(size.rows),
            factorisations: 0,
            iterations: 0,
        }
    }

    /// Choose rows, and the coordinates that (34) moves.
    fn choose(&mut self, t: f64, q: &[f64]) -> Result<()> {
        start::choose_partition(&mut self.base.r, t, q, None, None)?;
        self.take_rows();
        Ok(())
    }

    /// The rows of the choice in use.
    fn take_rows(&mut self) {
        self.taken = self.base.r.choices();
        if self.base.r.system.structure().lacks_mass {
            self.scales.clear();
            self.scales.extend_from_slice(self.base.r.row_scales());
        }
        self.rows.clear();
        self.rows.extend_from_slice(&self.base.r.planned.partition.rows);
        self.rows.sort_unstable();
    }

    /// S1 and S5 at the last position with velocities v, stored in `self.base.r`, `self.mass` and `self.h`.
    fn levels(&mut self, t: f64, q: &[f64], v: &[f64]) -> Result<()> {
        let r = &mut self.base.r;
        r.at.v.copy_from_slice(v);
        r.system.velocity(t, q, v, &mut r.scratch, &mut r.at.b)?;
        match self.rule.mass_pattern() {
            None => r.system.dynamics(t, q, v, &mut r.scratch, &mut self.mass, &mut self.h),
            Some(_) => r.system.sparse_dynamics(t, q, v, &mut r.scratch, &mut self.mass, &mut self.h),
        }
    }

    fn ask(&mut self) -> Result<(), Failure> {
        let x = instant!(self);
        self.lambda.fill(0.0);
        self.factorisations += 1;
        self.iterations += self.rule.solve(&x, &mut self.vdot, &mut self.lambda)?;
        Ok(())
    }

    /// v' and λ at the last position with velocities v, stored in `self.vdot` and `self.lambda`.
    fn solve(&mut self, t: f64, q: &[f64], v: &[f64]) -> Result<()> {
        self.levels(t, q, v)?;
        let mut asked = self.ask();
        let (rank, size) = (self.base.r.rank(), self.base.r.size());
        if matches!(asked, Err(Failure::Rows { .. })) && rank > 0 && rank < size.rows {
            // of redundant rows another selection may be independent here: v' and Cᵀ λ do not depend on it
            self.choose(t, q)?;
            self.levels(t, q, v)?;
            asked = self.ask();
        }
        match asked {
            Ok(()) if self.vdot.iter().all(|x| x.is_finite()) => Ok(()),
            Ok(()) => Err(SystemError::NotFinite { what: "an acceleration".into(), t }),
            Err(failure) => Err(self.refused(t, failure)),
        }
    }

    fn refused(&self, t: f64, failure: Failure) -> SystemError {
        let r = &self.base.r;
        match failure {
            Failure::Mass { index, pivot } => {
                SystemError::Mass { name: r.system.structure().velocity_name(index), pivot }
            }
            Failure::Rows { sine2 } if r.at.c.iter().all(|x| x.is_finite()) => {
                SystemError::Singular { t, pivot: sine2, limit: tolerance::LOST_PIVOT }
            }
            Failure::Rows { .. } => SystemError::NotFinite { what: "the constraint Jacobian".into(), t },
        }
    }

    /// One correction of v onto C v + a = 0 by the rule's own method; false where it has none.                   (35)
    fn settled_by_the_rule(&mut self, t: f64, v: &mut [f64]) -> Result<bool> {
        let (x, r) = (instant!(self), &self.base.r);
        self.violation.clear();
        self.violation.extend(velocity_residuals(r.system.pattern(), &r.at.c, v, &r.at.a));
        let moved = self.rule.least_move(&x, &self.violation, &mut self.vdot);
        match moved {
            None => return Ok(false),
            Some(Ok(())) => dense::axpy(1.0, &self.vdot, v),
            Some(Err(failure)) => return Err(self.refused(t, failure)),
        }
        Ok(true)
    }
}

impl<'s, S: ConstrainedSystem> TangentLevels<'s, S> for AllVelocities<'s, S> {
    fn base(&self) -> &Base<'s, S> {
        &self.base
    }
    fn base_mut(&mut self) -> &mut Base<'s, S> {
        &mut self.base
    }
    fn count(&self) -> usize {
        self.base.r.size().nv
    }
    fn select(&mut self, v: &[f64], u: &mut [f64]) {
        u.copy_from_slice(v);
    }
    fn tangent(&mut self, _t: f64, _q: &[f64], _factored: bool) -> Result<()> {
        if self.taken != self.base.r.choices() {
            self.take_rows();
        }
        Ok(())
    }
    fn spread(&mut self, u: &[f64]) {
        self.base.r.at.v.copy_from_slice(u);
    }
    fn accelerate(&mut self, t: f64, q: &[f64], u: &[f64]) -> Result<()> {
        self.solve(t, q, u)
    }
    fn rates(&mut self, du: &mut [f64]) {
        du.copy_from_slice(&self.vdot);
    }
    fn full_acceleration(&self, out: &mut [f64]) {
        out.copy_from_slice(&self.vdot);
    }
    /// λ is known, and there is no D: with rows that depend on time −λᵀ a itself.
    fn power(&mut self, t: f64, q: &[f64]) -> Result<f64> {
        let r = &mut self.base.r;
        Ok(r.system.power(t, q, &r.at.v, &mut r.scratch)? - dense::dot(&self.lambda, &r.at.a))
    }
}

impl<'s, S: ConstrainedSystem> TangentChoice<'s, S> for AllVelocities<'s, S> {
    fn natural_size(&self, j: usize) -> f64 {
        self.base.r.system.structure().displacement(j)
    }
    fn start(&mut self, t: f64, q: &mut [f64], v: &[f64]) -> Result<()> {
        self.choose(t, q)?;
        if matches!(self.correction, Correction::Partition | Correction::Kantorovich) {
            self.base.evaluate(t, q, v)?;
            let reason = "corrections leave the coordinates of largest projective measure untouched";
            self.base.log(t, q, &[], reason.into())?;
        }
        Ok(())
    }
    /// v' and λ are the rule's own; nothing is chosen, so the reported choice is the best of the moment.
    fn describe(
        &mut self,
        _r: Option<&mut Reduction<'s, S>>,
        _at: &Output,
        _within: Option<&PartitionEvent>,
        out: &mut Sample,
    ) -> Result<()> {
        if out.note.is_some() {
            return Ok(()); // in a singular position none of them is determined
        }
        if self.rows.is_empty() && self.base.r.rank() > 0 {
            self.choose(out.t, &out.q)?;
        }
        self.base.r.position(out.t, &out.q)?;
        match self.solve(out.t, &out.q, &out.v) {
            Ok(()) => {
                out.vdot.clone_from(&self.vdot);
                out.multipliers.clone_from(&self.lambda);
                Ok(())
            }
            Err(e) => Err(e),
        }
    }
    fn report(&self, history: &mut History) {
        (history.counters.factorisations, history.counters.proximal_iterations) =
            (self.factorisations, self.iterations);
        history.counters.plans += self.rule.plans();
        match self.rule.loads_all_rows() {
            true => history.rows = (0..self.base.r.size().rows).collect(),
            false => history.rows.clone_from(&self.rows),
        }
        history.notes.extend(self.rule.notes());
        if self.correction == Correction::None && self.base.r.rank() > 0 {
            history.notes.push(format!(
                "the loops are not exactly closed because \"{}\" ran without corrections: at the ends of steps \
                 |Phi| reached {:.2e} and |C v + a| {:.2e}",
                self.rule.name(),
                history.closure_error.0,
                history.closure_error.1
            ));
        }
    }
}

impl<'s, S: ConstrainedSystem> TangentReplay<'s, S> for AllVelocities<'s, S> {
    fn version(&self) -> Option<u64> {
        Some(self.base.r.version())
    }
}

impl<'s, S: ConstrainedSystem> TangentClosing<'s, S> for AllVelocities<'s, S> {
    /// Distance from a singular position of the partition, whose factors no evaluation needs. It is known no better than
    /// the closure error of positions that drift.
    fn sides(&self, sides: &mut Sides) {
        self.base.r.sides(sides);
    }
    fn choice_of_sides(&self) -> (u64, u64) {
        (self.base.r.choices(), 0)
    }
    fn margin(&mut self) -> Option<(f64, u64)> {
        let r = &mut self.base.r;
        let free = self.correction == Correction::None || r.rank() == 0 || r.tangent(f64::NAN).is_err();
        (!free).then(|| r.distance())
    }
    fn integrates_velocities(&self) -> bool {
        self.correction != Correction::None
    }
    fn distance_of_drift(&mut self) -> Option<f64> {
        let r = &mut self.base.r;
        let drifts = self.correction == Correction::None && r.rank() > 0;
        (drifts && r.tangent(f64::NAN).is_ok()).then(|| r.distance().0)
    }
    fn correction(&mut self, t: f64, q: &[f64], rule: Correction, dv: &mut [f64]) -> Result<bool> {
        let (size, r) = (self.base.r.size(), &mut self.base.r);
        if rule == Correction::MassOrthogonal || size.rows != size.holonomic {
            dv.copy_from_slice(&orthogonal_step(r, t, q)?);
            return Ok(true);
        }
        if rule == Correction::Kantorovich {
            return Ok(r.dependent_correction(dv));
        }
        if r.tangent(t).is_err() || r.best_switch().is_some_and(|x| x.gain > self.switch_threshold) {
            let (before, v) = (r.planned.partition.independent.clone(), r.at.v.clone());
            self.choose(t, q)?;
            self.base.switches += 1;
            self.base.evaluate(t, q, &v)?;
            let reason = "corrections now move other coordinates, because those in use have become poor";
            self.base.log(t, q, &before, reason.into())?;
        }
        Ok(self.base.r.dependent_correction(dv))
    }
    /// `v ← v − M⁻¹ Cᵀ M_c⁻¹ (C v + a)`, twice: from an interpolation error to round-off.                     (35)
    fn settle(&mut self, t: f64, q: &[f64], v: &mut [f64]) -> Result<bool> {
        if self.correction == Correction::None {
            return Ok(false);
        }
        self.base.r.position(t, q)?;
        self.levels(t, q, v)?;
        if self.settled_by_the_rule(t, v)? {
            return self.settled_by_the_rule(t, v);
        }
        let r = &mut self.base.r;
        let rows = &r.planned.partition.rows;
        let c = dense_rows(&*r.system, &r.at.c, rows);
        // the next evaluation refills it
        r.system.add_metric(&mut r.scratch, &mut self.mass);
        let p = MassProjection::new(&*r.system, t, &self.mass, &c)?;
        for _ in 0..2 {
            let violation: Vec<f64> = velocity_residuals(r.system.pattern(), &r.at.c, v, &r.at.a).collect();
            let x: Vec<f64> = rows.iter().map(|&i| violation[i]).collect();
            dense::axpy(1.0, &p.correction(&x), v);
        }
        Ok(true)
    }
}
