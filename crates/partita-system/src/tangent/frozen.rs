//! The general selector (36): any constant S (k x n) with [S; C] regular makes tangent velocities `u = S v`.
//!
//! ```text
//! [D_Sᵀ G] = [S; C]⁻¹,   v = D_Sᵀ u − G a,   v' = D_Sᵀ u' − G b,   (D_S M D_Sᵀ) u' = D_S (h + M G b)          (36)
//! ```
//!
//! Rows of the identity in S are a partition; a [`Basis`] provides others: `zero-eigenvalue`, `svd`, `qr`,
//! `liang-lance`, `gram-schmidt`. All give the same accelerations as any other form; they differ in the velocities
//! integrated, in cost and in how long a basis lasts. With S frozen its quality decays along the motion as that of a
//! partition does, measured by the same number √μ_S, the smallest principal cosine between span(Sᵀ), covectors measured
//! by M⁻¹, and the tangent space.
//!
//! [S; C] is solved for through the D of any partition: `D_Sᵀ = Dᵀ (S Dᵀ)⁻¹`, so `(S Dᵀ) v_I = u − S γ`, and v_I' (P3)
//! gives `u' = S v'`. One elimination of C_D and one LU of S Dᵀ (k x k) per evaluation. The partition does not affect
//! the result: a better one replaces it when a switch gains.

use super::basis::Basis;
use super::instant::quality_of_selector;
use super::{Base, ChoiceSnapshot, Occasion, TangentChoice, TangentClosing, TangentLevels, TangentReplay};
use crate::error::Result;
use crate::manifold::orthogonal::{dense_rows, orthogonal_step};
use crate::options::Renew;
use crate::partition::criterion::Quality;
use crate::record::{Correction, History, Output, PartitionEvent, Sample, StepDecision};
use crate::reduction::{Reduction, Sides};
use crate::start;
use crate::system::{ConstrainedSystem, SystemError, SystemRef};
use partita_math::dense::{self, Matrix};
use partita_math::factor::FactorError;
use partita_math::tolerance;
use std::sync::Arc;

/// The reduced equations (36) of a system at one point, for a frozen S.
///
/// Computed with `w = L⁻¹ u` instead of u, where `S M⁻¹ Sᵀ = L Lᵀ` when frozen: the same covectors made orthonormal, so
/// that pivots do not depend on the units of a rule.
pub struct Frozen<'s, S: ConstrainedSystem> {
    base: Base<'s, S>,
    renew: Renew,
    basis: Box<dyn Basis>,
    /// S.
    selector: Arc<Matrix>,
    /// `L⁻¹ S`.
    orthonormal: Vec<f64>,
    /// L with `S M⁻¹ Sᵀ = L Lᵀ` at the freezing time.
    lower: Vec<f64>,
    /// `L⁻¹ S Dᵀ` in natural scales of the independent velocities, factored.
    lu: Vec<f64>,
    pivots: Vec<usize>,
    w: Vec<f64>,
    x: Vec<f64>,
    rows: Vec<f64>,
    fresh: Quality,
    lowest: f64,
    rejects_in_a_row: u32,
    frozen: u64,
    kept: u64,
}

impl<'s, S: ConstrainedSystem> Frozen<'s, S> {
    /// Memory for a system of the given rank; nothing frozen yet. `renew`: see
    /// [`FormulationOptions`](crate::options::FormulationOptions::renew).
    pub fn new(
        system: impl Into<SystemRef<'s, S>>,
        rank: usize,
        basis: Box<dyn Basis>,
        renew: impl Into<Renew>,
    ) -> Self {
        let base = Base::new(Reduction::dense(system, rank));
        let n = base.r.size().nv;
        let k = n - rank;
        Self {
            base,
            renew: renew.into(),
            basis,
            selector: Arc::new(Matrix::new(k, n)),
            orthonormal: vec![0.0; k * n],
            lower: vec![0.0; k * k],
            lu: vec![0.0; k * k],
            pivots: vec![0; k],
            w: vec![0.0; k],
            x: vec![0.0; n],
            rows: vec![0.0; rank],
            fresh: Quality { sigma: 1.0, sqrt_mu: 1.0 },
            lowest: 1.0,
            rejects_in_a_row: 0,
            frozen: 0,
            kept: 0,
        }
    }

    /// S (k x n), as it was frozen.
    pub fn selector(&self) -> &Matrix {
        &self.selector
    }
    /// The covectors of S made orthonormal in the metric of the freezing time (k x n).
    pub fn orthonormal(&self) -> &[f64] {
        &self.orthonormal
    }
    /// σ and √μ_S when S was frozen.
    pub fn fresh(&self) -> Quality {
        self.fresh
    }

    /// Take S from the rule at `(t, q)` and record it; on failure the old one is kept. Sets v to zero.
    fn freeze(&mut self, t: f64, q: &[f64], reason: impl Fn(f64) -> String) -> Result<()> {
        let r = &mut self.base.r;
        start::choose_partition(r, t, q, None, None)?;
        r.at.v.fill(0.0);
        r.velocity(t, q)?;
        r.acceleration(t, q)?;
        self.take(t, q)?;
        let r = &mut self.base.r;
        self.fresh = quality_of_selector(r, t, q, &self.selector)?;
        self.lowest = self.lowest.min(self.fresh.sqrt_mu);
        let (p, basis) = (&r.planned.partition, Some(self.selector.clone()));
        let reason = reason(self.fresh.sqrt_mu);
        // the reported choice is the best one of coordinates; nothing enters or leaves
        let named = PartitionEvent::new(t, &p.independent, &p.independent, &p.dependent, reason, self.fresh);
        self.base.choices.record(PartitionEvent { basis, ..named });
        Ok(())
    }

    /// Take S from the rule at `(t, q)`, the point last evaluated; on failure the old one is kept.
    fn take(&mut self, t: f64, q: &[f64]) -> Result<()> {
        let r = &mut self.base.r;
        let (n, k) = (r.size().nv, r.k());
        let (mut mass, new) = made(&*self.basis, r, t, q, (self.frozen > 0).then_some(&*self.selector))?;
        dense::cholesky(mass.data_mut(), n)
            .map_err(|e| SystemError::Mass { name: r.system.structure().velocity_name(e.index), pivot: e.pivot })?;
        // S M⁻¹ Sᵀ = Y Yᵀ with Y = S L_M⁻ᵀ
        let mut half = new.clone();
        (0..k).for_each(|j| dense::cholesky_forward(mass.data(), n, half.row_mut(j)));
        let mut lower = half.matmul(&half.transpose()).into_vec();
        if dense::cholesky(&mut lower, k).is_err() {
            return Err(failed(self.basis.name(), t, "its covectors are linearly dependent; use another rule"));
        }
        // L⁻¹ S, column by column
        let mut columns = new.transpose();
        (0..n).for_each(|i| dense::cholesky_forward(&lower, k, columns.row_mut(i)));
        let orthonormal = columns.transpose().into_vec();
        self.factor(t, Some(&orthonormal))?;
        self.frozen += 1;
        (self.selector, self.orthonormal, self.lower) = (Arc::new(new), orthonormal, lower);
        Ok(())
    }

    /// Solve for the partition and factor S Dᵀ at the last position, or the same with other covectors (k x n).
    pub fn solve_levels(&mut self, t: f64, q: &[f64], covectors: Option<&[f64]>) -> Result<()> {
        let r = &mut self.base.r;
        match r.tangent(t) {
            // another partition may do where this one has become singular inside a step
            Err(SystemError::Singular { .. }) => start::choose_partition(r, t, q, None, None)?,
            other => other?,
        }
        self.factor(t, covectors)
    }

    /// All levels at the closed (t, q) with velocities v, with the present S.
    fn go_on(&mut self, t: f64, q: &[f64], v: &[f64]) -> Result<()> {
        let mut u = vec![0.0; self.count()];
        self.select(v, &mut u);
        self.tangent(t, q, false)?;
        self.spread(&u);
        self.accelerate(t, q, &u)
    }

    /// Renew S after each step, where it is neither judged nor recorded.
    fn follow(&mut self, t: f64, q: &[f64], v: &[f64]) -> Result<bool> {
        if std::mem::take(&mut self.base.fading) {
            start::choose_partition(&mut self.base.r, t, q, None, None)?;
            self.base.evaluate(t, q, v)?;
        }
        match self.take(t, q) {
            Err(e) if e.is_local() => {
                self.kept += 1;
                Ok(false)
            }
            other => other.map(|()| true),
        }
    }

    /// Factor S Dᵀ, or the same with other covectors (k x n), at the last tangent of the partition.
    pub fn factor(&mut self, t: f64, covectors: Option<&[f64]>) -> Result<()> {
        let r = &self.base.r;
        let (n, k, s) = (r.size().nv, r.k(), r.scales());
        let covectors = covectors.unwrap_or(&self.orthonormal);
        self.lu.fill(0.0);
        for (out, row) in self.lu.chunks_exact_mut(k.max(1)).zip(covectors.chunks_exact(n)) {
            for (i, x) in row.iter().enumerate().filter(|(_, x)| **x != 0.0) {
                dense::axpy(*x, &r.at.dt[i * k..(i + 1) * k], out);
            }
            out.iter_mut().zip(&r.planned.partition.independent).for_each(|(x, &i)| *x *= s[i]);
        }
        let ratio = match dense::lu(&mut self.lu, k, &mut self.pivots) {
            Ok(()) => dense::lu_pivot_ratio(&self.lu, k),
            Err(_) if r.at.dt.iter().all(|x| x.is_finite()) => 0.0,
            Err(_) => return Err(SystemError::NotFinite { what: "the constraint Jacobian".into(), t }),
        };
        let limit = tolerance::SINGULAR_PIVOT;
        if k == 0 || ratio >= limit {
            return Ok(());
        }
        let reason = format!(
            "with the constraints it leaves a scaled pivot of {ratio:.2e} (limit {limit:.0e}) although the \
             mechanism itself is regular: the motion has turned away from the frozen directions; renew them earlier \
             (a larger renew, at most 1)"
        );
        Err(failed(self.basis.name(), t, &reason))
    }

    /// `x ← (S Dᵀ)⁻¹ x`: values of the covectors last factored as independent velocities.
    fn in_partition(&self, x: &mut [f64]) {
        dense::lu_solve(&self.lu, x.len(), &self.pivots, x);
        let r = &self.base.r;
        x.iter_mut().zip(&r.planned.partition.independent).for_each(|(x, &i)| *x *= r.scales()[i]);
    }

    /// `out = [S; C]⁻¹ [w; −Φ]` with the last factors, for values w (k) of the covectors they were made with, used up.
    pub fn solve(&mut self, covectors: Option<&[f64]>, w: &mut [f64], out: &mut [f64]) {
        let r = &self.base.r;
        self.rows.iter_mut().zip(&r.planned.partition.rows).for_each(|(x, &row)| *x = -r.at.phi[row]);
        r.solve(&mut self.rows, 1);
        out.fill(0.0);
        self.rows.iter().zip(&r.planned.partition.dependent).for_each(|(x, &i)| out[i] = *x);
        let covectors = covectors.unwrap_or(&self.orthonormal);
        for (w, row) in w.iter_mut().zip(covectors.chunks_exact(out.len())) {
            *w -= dense::dot(row, out);
        }
        self.in_partition(w);
        for (x, row) in out.iter_mut().zip(self.base.r.at.dt.chunks_exact(w.len().max(1))) {
            *x += dense::dot(row, w);
        }
    }

    /// Values of S v as values of the orthonormal covectors: `x ← L⁻¹ x` (k).
    pub fn in_orthonormal(&self, x: &mut [f64]) {
        dense::cholesky_forward(&self.lower, x.len(), x);
    }

    /// σ and √μ_S at `(t, q)`, the point last evaluated. Cost: about n³.
    pub fn quality_here(&mut self, t: f64, q: &[f64]) -> Result<Quality> {
        quality_of_selector(&mut self.base.r, t, q, &self.selector)
    }
}

impl<'s, S: ConstrainedSystem> TangentLevels<'s, S> for Frozen<'s, S> {
    fn base(&self) -> &Base<'s, S> {
        &self.base
    }
    fn base_mut(&mut self) -> &mut Base<'s, S> {
        &mut self.base
    }
    fn select(&mut self, v: &[f64], u: &mut [f64]) {
        u.iter_mut().enumerate().for_each(|(j, u)| *u = dense::dot(self.selector.row(j), v));
    }
    fn tangent(&mut self, t: f64, q: &[f64], factored: bool) -> Result<()> {
        match factored {
            true => Ok(()),
            false => self.solve_levels(t, q, None),
        }
    }
    /// `(S Dᵀ) v_I = u − S γ`, and v from v_I.
    fn spread(&mut self, u: &[f64]) {
        let mut w = std::mem::take(&mut self.w);
        w.copy_from_slice(u);
        self.in_orthonormal(&mut w);
        let gamma = &self.base.r.at.gamma;
        for (w, row) in w.iter_mut().zip(self.orthonormal.chunks_exact(gamma.len())) {
            *w -= dense::dot(row, gamma);
        }
        self.in_partition(&mut w);
        self.base.r.spread(&w);
        self.w = w;
    }
    fn rates(&mut self, du: &mut [f64]) {
        let mut vdot = std::mem::take(&mut self.x);
        self.base.r.full_acceleration(&mut vdot);
        self.select(&vdot, du);
        self.x = vdot;
    }
}

impl<'s, S: ConstrainedSystem> TangentChoice<'s, S> for Frozen<'s, S> {
    fn start(&mut self, t: f64, q: &mut [f64], v: &[f64]) -> Result<()> {
        self.frozen = 0;
        self.resume(t, q, v)
    }
    fn resume(&mut self, t: f64, q: &mut [f64], v: &[f64]) -> Result<()> {
        if self.renew.never() && self.frozen > 0 {
            start::choose_partition(&mut self.base.r, t, q, None, None)?;
            return self.go_on(t, q, v);
        }
        let name = self.basis.name();
        let lasts = match self.renew {
            Renew::EachStep => ", and renewed after each step, which is counted but not listed",
            Renew::Below(_) => "",
        };
        self.freeze(t, q, |_| {
            format!(
                "tangent basis \"{name}\" frozen: its velocities are integrated; the event lists the best choice of \
                 coordinates at this time{lasts}"
            )
        })?;
        self.go_on(t, q, v)
    }
    /// S is to be renewed when √μ_S falls below `renew` times its value when frozen; 0: never.
    fn judge(&mut self, t: f64, q: &[f64]) -> StepDecision {
        if self.base.is_rigid_or_free() {
            return StepDecision::Keep;
        }
        let r = &mut self.base.r;
        self.base.fading = r.rows_fade() || r.best_switch().is_some_and(|x| x.gain > tolerance::DOUBLED);
        let Renew::Below(least) = self.renew else { return StepDecision::Change };
        // a failure here would recur in the next evaluation, which reports it
        let Ok(now) = self.quality_here(t, q) else { return StepDecision::Keep };
        self.lowest = self.lowest.min(now.sqrt_mu);
        let part = now.sqrt_mu / self.fresh.sqrt_mu;
        let fails = part < least;
        if fails && tolerance::CLEARLY * part < least && self.rejects_in_a_row < 3 {
            self.rejects_in_a_row += 1;
            return StepDecision::Repeat;
        }
        self.rejects_in_a_row = 0;
        match fails {
            true => StepDecision::Change,
            false => StepDecision::Keep,
        }
    }
    fn accept(&mut self, t: f64, q: &[f64]) -> Result<()> {
        if std::mem::take(&mut self.base.fading) {
            // if none better is found, the next evaluation reports it
            let _ = start::choose_partition(&mut self.base.r, t, q, None, None);
        }
        Ok(())
    }
    /// Freeze again; a basis that cannot be computed here leaves the old one in place.
    fn renew(&mut self, t: f64, q: &mut [f64], v: &[f64], why: Occasion) -> Result<bool> {
        if self.renew == Renew::EachStep && why != Occasion::Spoilt {
            return self.follow(t, q, v);
        }
        if self.renew.never() && why == Occasion::Spoilt {
            return Ok(false);
        }
        let why = match why {
            Occasion::Decayed => "its quality had decayed",
            Occasion::Spoilt => "it became poor within the step, which is repeated",
            Occasion::Positions(why) => why,
        };
        let (before, name) = (self.quality_here(t, q).map_or(0.0, |now| now.sqrt_mu), self.basis.name());
        let frozen = self.freeze(t, q, |now| {
            format!("tangent basis \"{name}\" renewed ({why}): its quality sqrt(mu) rises from {before:.4} to {now:.4}")
        });
        match frozen {
            Err(e) if e.is_local() => {
                self.kept += 1;
                Ok(false)
            }
            other => other.map(|()| true),
        }
    }
    fn unlisted_basis(&self) -> Option<Arc<Matrix>> {
        (self.renew == Renew::EachStep).then(|| self.selector.clone())
    }
    fn describe(
        &mut self,
        r: Option<&mut Reduction<'s, S>>,
        at: &Output,
        within: Option<&PartitionEvent>,
        out: &mut Sample,
    ) -> Result<()> {
        if out.brief {
            return Ok(());
        }
        let listed = within.and_then(|event| event.basis.as_deref());
        let own = || (self.frozen > 0).then_some(&*self.selector);
        let known = at.basis.as_deref().or(listed).or_else(own);
        out.selector.clear();
        out.selector.extend_from_slice(known.unwrap_or(&self.selector).data());
        let Some(r) = r else { return Ok(()) };
        if self.renew == Renew::EachStep {
            // as if renewed at the output itself, whatever the step it lies in; next to a singular position kept
            match made(&*self.basis, r, out.t, &out.q, known) {
                Ok((_, new)) => out.selector.copy_from_slice(new.data()),
                Err(e) if e.is_local() => {}
                Err(e) => return Err(e),
            }
        }
        let (k, n) = (r.k(), r.size().nv);
        let selector = Matrix::from_vec(k, n, std::mem::take(&mut out.selector));
        let quality = quality_of_selector(r, out.t, &out.q, &selector)?;
        (out.sigma, out.sqrt_mu) = (quality.sigma, quality.sqrt_mu);
        out.selector = selector.into_vec();
        Ok(())
    }
    fn report(&self, history: &mut History) {
        history.counters.renewals = self.frozen;
        if self.base.is_rigid_or_free() {
            return;
        }
        let renewed = match self.renew.never() {
            false => format!("renewed {} times", self.frozen.saturating_sub(1)),
            true => "never renewed (renew = 0)".into(),
        };
        let quality = match self.renew {
            // nothing depends on it, so it was not evaluated
            Renew::EachStep => ", after each step".into(),
            Renew::Below(_) => format!("; its quality sqrt(mu) was {:.3} at the lowest", self.lowest),
        };
        history
            .notes
            .push(format!("tangent basis \"{}\": frozen at the start and {renewed}{quality}", self.basis.name()));
        if self.kept > 0 {
            history.notes.push(format!(
                "{} times no new tangent basis was found (next to a singular position) and the old one was kept",
                self.kept
            ));
        }
    }
}

impl<'s, S: ConstrainedSystem> TangentReplay<'s, S> for Frozen<'s, S> {
    fn version(&self) -> Option<u64> {
        Some(self.base.r.version() + self.frozen)
    }
    fn snapshot(&self) -> ChoiceSnapshot {
        let basis = Some((self.selector.clone(), self.orthonormal.clone(), self.lower.clone()));
        ChoiceSnapshot { reduction: self.base.r.snapshot(), basis }
    }
    fn restore(&mut self, from: &ChoiceSnapshot) {
        self.base.r.restore(&from.reduction);
        if let Some((selector, orthonormal, lower)) = &from.basis {
            self.selector = selector.clone();
            self.orthonormal.copy_from_slice(orthonormal);
            self.lower.copy_from_slice(lower);
        }
    }
}

impl<'s, S: ConstrainedSystem> TangentClosing<'s, S> for Frozen<'s, S> {
    /// `q ← q − G Φ`: the tangent part S·Δ is unchanged, the analogue of (34); with nonholonomic rows by the least
    /// displacement.
    fn correction(&mut self, t: f64, q: &[f64], rule: Correction, dv: &mut [f64]) -> Result<bool> {
        let size = self.base.r.size();
        if rule == Correction::MassOrthogonal || size.rows != size.holonomic {
            dv.copy_from_slice(&orthogonal_step(&mut self.base.r, t, q)?);
            return Ok(true);
        }
        if rule != Correction::Kantorovich {
            self.solve_levels(t, q, None)?;
        }
        let mut w = std::mem::take(&mut self.w);
        w.fill(0.0);
        self.solve(None, &mut w, dv);
        self.w = w;
        Ok(true)
    }
    fn sides(&self, sides: &mut Sides) {
        self.base.r.sides(sides);
        let determinant = dense::lu_determinant(&self.lu, self.pivots.len(), &self.pivots);
        sides.extend(determinant < 0.0, self.frozen);
    }
    fn choice_of_sides(&self) -> (u64, u64) {
        (self.base.r.choices(), self.frozen)
    }
    fn margin(&mut self) -> Option<(f64, u64)> {
        let r = &mut self.base.r;
        (r.rank() > 0).then(|| r.distance())
    }
}

/// M, or the metric beside it, and S of a rule that starts from `last`, at `(t, q)`, the point where the velocity
/// level of r was last evaluated.
fn made<S: ConstrainedSystem>(
    basis: &dyn Basis,
    r: &mut Reduction<S>,
    t: f64,
    q: &[f64],
    last: Option<&Matrix>,
) -> Result<(Matrix, Matrix)> {
    let (n, k) = (r.size().nv, r.k());
    let (mut mass, mut h) = (Matrix::new(n, n), vec![0.0; n]);
    r.system.dynamics(t, q, &r.at.v, &mut r.scratch, mass.data_mut(), &mut h)?;
    r.system.add_metric(&mut r.scratch, mass.data_mut());
    let mut c = dense_rows(&*r.system, &r.at.c, &r.planned.partition.rows);
    for i in 0..c.rows() {
        let length = dense::dot(c.row(i), c.row(i)).sqrt();
        c.row_mut(i).iter_mut().for_each(|x| *x /= length);
    }
    let new = basis.basis(&mass, &c, last).map_err(|e| match e {
        FactorError::NotFinite => {
            SystemError::NotFinite { what: "the mass matrix or the constraint Jacobian".into(), t }
        }
        other => failed(basis.name(), t, &format!("it could not be computed ({other}); use another rule")),
    })?;
    if (new.rows(), new.cols()) != (k, n) {
        return Err(SystemError::Singular { t, pivot: 0.0, limit: tolerance::SINGULAR_PIVOT });
    }
    Ok((mass, new))
}

fn failed(name: &str, t: f64, reason: &str) -> SystemError {
    SystemError::Basis { name: name.into(), t, reason: reason.into() }
}
