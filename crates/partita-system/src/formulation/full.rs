//! Integrating all q and all v: one frame for every method that gives `v'` and λ at an instant.
//!
//! The position drifts like t² and the velocity like t (`C v' + b = 0` is all that holds by itself), so after a step the
//! remainders of S3 and S4 are removed: q by the least change in the mass metric (33) or in dependent coordinates alone
//! (34), v always by (35), which keeps the momentum along the tangent. Prefer the reduced forms for everything but
//! checking; prefer these where M is cheap to factor and a reference in all coordinates is wanted.

use super::{Formulation, Step, Verdict};
use crate::equations::full::{AccelerationRule, Failure, Instant};
use crate::kinematics::projection::{dense_rows, MassProjection};
use crate::options::FormulationOptions;
use crate::positions::turns;
use crate::record::{Correction, FormulationCounters, Journal, Output, PartitionEvent, Sample};
use crate::reduction::Reduction;
use crate::singular::consistency::Watch;
use crate::start;
use crate::system::{ConstrainedSystem, SystemError};
use crate::tangent::instant::Describer;
use partita_math::dense;

/// Squared sine under which the kernels call a row dependent on the others: what remains of it is rounding.
const DEPENDENT: f64 = 1e-14;

/// A system integrated in all its coordinates and velocities by the rule R.
///
/// States: q (nq), v (nv) and the work, where there is any. Of the options it reads `correction`, and `exchange` for the
/// partition that (34) moves; it has no independent coordinates of its own.
pub struct FullState<'s, S: ConstrainedSystem, R> {
    r: Reduction<'s, S>,
    describer: Describer<'s, S>,
    rule: R,
    correction: Correction,
    exchange: f64,
    observes_work: bool,
    /// The rows the rule is given.
    rows: Vec<usize>,
    mass: Vec<f64>,
    h: Vec<f64>,
    vdot: Vec<f64>,
    lambda: Vec<f64>,
    events: Vec<PartitionEvent>,
    counters: FormulationCounters,
    /// What is open at the ends of steps.
    watch: Watch,
    /// Of redundant rows, do others serve better at the end of the step that is judged?
    fading: bool,
    corrections: u64,
}

impl<'s, S: ConstrainedSystem, R: AccelerationRule> FullState<'s, S, R> {
    /// For a system of the given rank (see [`start::analyse`]).
    pub fn new(system: &'s S, rank: usize, rule: R, options: &FormulationOptions) -> Self {
        let size = system.size();
        Self {
            r: Reduction::new(system, rank),
            describer: Describer::new(system, rank),
            correction: if rule.corrected() { options.correction } else { Correction::None },
            rule,
            exchange: options.exchange,
            observes_work: system.has_power() || system.rheonomic(),
            rows: Vec::with_capacity(size.rows),
            mass: vec![0.0; size.nv * size.nv],
            h: vec![0.0; size.nv],
            vdot: vec![0.0; size.nv],
            lambda: vec![0.0; size.rows],
            events: Vec::new(),
            counters: FormulationCounters::default(),
            watch: Watch::default(),
            fading: false,
            corrections: 0,
        }
    }

    /// The rule, after what it was last asked.
    pub fn rule(&self) -> &R {
        &self.rule
    }

    fn take_rows(&mut self) {
        self.rows.clear();
        if self.rule.takes_all_rows() {
            self.rows.extend(0..self.r.size().rows);
        } else {
            self.rows.extend_from_slice(&self.r.partition.rows);
            self.rows.sort_unstable();
        }
    }

    /// S1-S5 at (t, q, v), left in `self.r`, `self.mass` and `self.h`.
    fn levels(&mut self, t: f64, q: &[f64], v: &[f64]) -> Result<(), SystemError> {
        let r = &mut self.r;
        r.position(t, q)?;
        r.v.copy_from_slice(v);
        r.system.velocity(t, q, v, &mut r.scratch, &mut r.b)?;
        r.system.dynamics(t, q, v, &mut r.scratch, &mut self.mass, &mut self.h)
    }

    fn ask(&mut self) -> Result<(), Failure> {
        let r = &self.r;
        let x = Instant {
            pattern: r.system.pattern(),
            rows: &self.rows,
            holonomic: r.size().holonomic,
            mass: &self.mass,
            h: &self.h,
            phi: &r.phi,
            c: &r.c,
            a: &r.a,
            b: &r.b,
            v: &r.v,
        };
        self.lambda.fill(0.0);
        self.counters.factorisations += 1;
        self.counters.iterations += self.rule.solve(&x, &mut self.vdot, &mut self.lambda)?;
        Ok(())
    }

    /// v' and λ at (t, q, v), left in `self.vdot` and `self.lambda`.
    fn solve(&mut self, t: f64, q: &[f64], v: &[f64]) -> Result<(), SystemError> {
        self.levels(t, q, v)?;
        let mut asked = self.ask();
        if matches!(asked, Err(Failure::Rows { .. })) && self.r.rank() > 0 && self.r.rank() < self.r.size().rows {
            // of redundant rows another selection may be independent here: v' and Cᵀ λ do not depend on it
            start::choose_partition(&mut self.r, t, q, None, None)?;
            self.take_rows();
            self.levels(t, q, v)?;
            asked = self.ask();
        }
        match asked {
            Ok(()) if self.vdot.iter().all(|x| x.is_finite()) => Ok(()),
            Ok(()) => Err(SystemError::NotFinite { what: "an acceleration".into(), t }),
            Err(Failure::Mass { index, pivot }) => {
                Err(SystemError::Mass { name: self.r.system.velocity_name(index), pivot })
            }
            Err(Failure::Rows { sine2 }) if self.r.c.iter().all(|x| x.is_finite()) => {
                Err(SystemError::Singular { t, pivot: sine2, limit: DEPENDENT })
            }
            Err(Failure::Rows { .. }) => Err(SystemError::NotFinite { what: "the constraint Jacobian".into(), t }),
        }
    }

    /// The mass metric at (t, q, v) on the independent rows below `end`, and those rows.
    fn metric(
        &mut self,
        t: f64,
        q: &[f64],
        v: &[f64],
        end: usize,
    ) -> Result<(MassProjection, Vec<usize>), SystemError> {
        self.levels(t, q, v)?;
        let rows: Vec<usize> = self.r.partition.rows.iter().copied().filter(|&i| i < end).collect();
        let c = dense_rows(self.r.system, &self.r.c, &rows);
        let p = MassProjection::new(self.r.system, t, &self.mass, &c)?;
        Ok((p, rows))
    }

    /// Choose the coordinates that (34) moves if there are none yet or if they have become poor.
    fn refresh_partition(&mut self, t: f64, q: &[f64]) -> Result<(), SystemError> {
        let usable = self.r.tangent(t).is_ok();
        if usable && self.r.best_exchange().is_none_or(|x| x.gain <= self.exchange) {
            return Ok(());
        }
        let before = self.r.partition.independent.clone();
        start::choose_partition(&mut self.r, t, q, None, None)?;
        self.counters.exchanges += 1;
        self.log(t, q, &before, "corrections move other coordinates, those in use have become poor")
    }

    fn log(&mut self, t: f64, q: &[f64], before: &[usize], reason: &str) -> Result<(), SystemError> {
        let speeds: Vec<f64> = self.r.partition.independent.iter().map(|&i| self.r.v[i]).collect();
        self.r.evaluate(t, q, &speeds)?;
        let quality = self.r.quality(t, q)?;
        let p = &self.r.partition;
        self.events.push(PartitionEvent::new(t, before, &p.independent, &p.dependent, reason.into(), quality));
        Ok(())
    }

    /// One correction of q; true if it moved.
    fn close(&mut self, t: f64, q: &mut [f64], v: &[f64]) -> Result<bool, SystemError> {
        let size = self.r.size();
        self.r.position(t, q)?;
        if size.holonomic == 0 || self.r.is_closed() {
            return Ok(false);
        }
        if self.correction == Correction::Partition && size.rows == size.holonomic {
            self.r.v.copy_from_slice(v);
            self.refresh_partition(t, q)?;
            return Ok(self.r.correct_dependent(q)); // (34)
        }
        let (p, rows) = self.metric(t, q, v, size.holonomic)?;
        let x: Vec<f64> = rows.iter().map(|&i| self.r.phi[i]).collect();
        self.r.system.step(q, &p.correction(&x)); // (33)
        Ok(true)
    }

    /// `v ← v − M⁻¹ Cᵀ M_c⁻¹ (C v + a)`.                                                  (35)
    fn project(&mut self, t: f64, q: &[f64], v: &mut [f64]) -> Result<(), SystemError> {
        let (p, rows) = self.metric(t, q, v, usize::MAX)?;
        let (pattern, r) = (self.r.system.pattern(), &self.r);
        let opening = |i: usize| pattern.row(i).map(|e| r.c[e] * v[pattern.col_idx[e]]).sum::<f64>() + r.a[i];
        let x: Vec<f64> = rows.iter().map(|&i| opening(i)).collect();
        v.iter_mut().zip(p.correction(&x)).for_each(|(v, d)| *v += d);
        Ok(())
    }

    fn corrects(&self) -> bool {
        self.correction != Correction::None && self.r.rank() > 0
    }
}

impl<S: ConstrainedSystem, R: AccelerationRule> Formulation for FullState<'_, S, R> {
    fn dim(&self) -> usize {
        let s = self.r.size();
        s.nq + s.nv + usize::from(self.observes_work)
    }
    fn controlled(&self) -> usize {
        let s = self.r.size();
        s.nq + s.nv + usize::from(self.observes_work && self.r.k() == 0)
    }
    fn natural_sizes(&self, out: &mut [f64]) {
        out.fill(1.0);
        let (coordinates, rates) = out.split_at_mut(self.r.size().nq);
        super::sizes_of_coordinates(self.r.system, coordinates);
        (0..self.r.size().nv).for_each(|i| rates[i] = self.r.system.reach(i));
        if self.observes_work {
            rates[self.r.size().nv] = self.r.natural_energy();
        }
    }
    fn start(&mut self, t: f64, q: &[f64], v: &[f64], y: &mut [f64]) -> Result<(), SystemError> {
        start::choose_partition(&mut self.r, t, q, None, None)?;
        self.take_rows();
        y.fill(0.0);
        y[..q.len()].copy_from_slice(q);
        y[q.len()..q.len() + v.len()].copy_from_slice(v);
        if self.corrects() && self.correction == Correction::Partition {
            self.r.v.copy_from_slice(v);
            self.log(t, q, &[], "corrections leave the coordinates of largest projective measure untouched")?;
        }
        Ok(())
    }
    fn derivative(&mut self, t: f64, y: &[f64], dy: &mut [f64]) -> Result<(), SystemError> {
        let size = self.r.size();
        let (q, rest) = y.split_at(size.nq);
        self.solve(t, q, &rest[..size.nv])?;
        self.r.system.rate(q, &rest[..size.nv], &mut dy[..size.nq]);
        dy[size.nq..size.nq + size.nv].copy_from_slice(&self.vdot);
        if self.observes_work {
            let p = self.r.system.power(t, q, &self.r.v, &mut self.r.scratch)?;
            dy[size.nq + size.nv] = p - dense::dot(&self.lambda, &self.r.a);
        }
        Ok(())
    }
    fn trial_end(
        &mut self,
        t: f64,
        y: &mut [f64],
        dy: &mut [f64],
        known: bool,
    ) -> Result<(Verdict, bool), SystemError> {
        let size = self.r.size();
        let (q, rest) = y.split_at_mut(size.nq);
        let mut moved = self.r.system.normalise(q);
        if self.corrects() {
            let v = &mut rest[..size.nv];
            self.r.position(t, q)?;
            self.r.jumped(t)?;
            self.close(t, q, v)?;
            self.project(t, q, v)?;
            moved = true;
        }
        let evaluates = moved || !known;
        if evaluates {
            self.derivative(t, y, dy)?;
        }
        self.watch.look(t, &self.r);
        self.watch.check(t, &y[..size.nq], &self.r)?;
        self.fading = self.r.rank() < size.rows && (self.r.factor(t).is_err() || self.r.rows_fade());
        Ok((Verdict::Keep, evaluates))
    }
    fn commit(&mut self, _verdict: Verdict, step: Step) -> Result<bool, SystemError> {
        let nq = self.r.size().nq;
        self.watch.accept();
        self.corrections += u64::from(self.corrects());
        // of redundant rows others are taken in time; what fails here the next evaluation meets and reports
        if std::mem::take(&mut self.fading)
            && self.r.position(step.t, &step.y[..nq]).and_then(|()| self.r.renew_rows(step.t)).is_ok()
        {
            self.take_rows();
        }
        Ok(turns::reduce(self.r.system, &mut step.y[..nq], step.turns))
    }
    fn state_at(&mut self, t: f64, y: &[f64], out: &mut Output) -> Result<(), SystemError> {
        let size = self.r.size();
        let (q, rest) = y.split_at(size.nq);
        let (q, v) = (&mut q.to_vec()[..], &mut rest[..size.nv].to_vec()[..]);
        self.r.system.normalise(q);
        if self.corrects() {
            // from the interpolation error to round-off: quadratic for q, twice the same linear solve for v
            for _ in 0..3 {
                if !self.close(t, q, v)? {
                    break;
                }
            }
            self.project(t, q, v)?;
            self.project(t, q, v)?;
        }
        out.set(t, q, v, if self.observes_work { y[size.nq + size.nv] } else { 0.0 });
        out.choice = self.events.len().saturating_sub(1);
        Ok(())
    }

    fn describe(
        &mut self,
        t: f64,
        q: &[f64],
        v: &[f64],
        within: Option<&PartitionEvent>,
        out: &mut Sample,
    ) -> Result<(), SystemError> {
        let _ = within; // nothing is chosen: named is the best choice of coordinates of the moment
        self.describer.describe(t, q, v, None, out)?;
        if self.rows.is_empty() && self.r.rank() > 0 {
            start::choose_partition(&mut self.r, t, q, None, None)?;
            self.take_rows();
        }
        match self.solve(t, q, v) {
            Ok(()) => {
                out.vdot.copy_from_slice(&self.vdot);
                out.multipliers.copy_from_slice(&self.lambda);
                Ok(())
            }
            Err(SystemError::Singular { .. }) if out.note.is_some() => Ok(()),
            Err(e) => Err(e),
        }
    }
    fn journal(&self) -> Journal {
        let mut notes = self.rule.notes();
        if !self.corrects() && self.r.rank() > 0 {
            notes.push(format!(
                "the loops are not exactly closed, because \"{}\" was run without corrections: at the ends of steps |Phi| \
                 reached {:.2e} and |C v + a| {:.2e}",
                self.rule.name(),
                self.watch.open.0,
                self.watch.open.1
            ));
        }
        Journal {
            name: self.rule.name(),
            events: self.events.clone(),
            counters: FormulationCounters { plans: self.r.plans, corrections: self.corrections, ..self.counters },
            rows: self.rows.clone(),
            passages: Vec::new(),
            open: self.watch.open,
            gaps: self.watch.gaps,
            notes,
        }
    }
}
