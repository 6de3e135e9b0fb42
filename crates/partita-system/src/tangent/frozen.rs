//! The general selector (36): any constant S (k x n) with [S; C] regular makes tangent velocities `u = S v`.
//!
//! ```text
//! [D_Sᵀ G] = [S; C]⁻¹,   v = D_Sᵀ u − G a,   v' = D_Sᵀ u' − G b,   (D_S M D_Sᵀ) u' = D_S (h + M G b)          (36)
//! ```
//!
//! Rows of the identity in S are a partition; a [`Basis`] provides others: `zero-eigenvalue`, `svd`, `qr`, `gram-schmidt`. All
//! give the same accelerations as any other form; they differ in the velocities integrated, in cost and in how long a basis
//! lasts. With S frozen its quality decays along the motion
//! as that of a partition does, and the same number tells: √μ_S, the smallest principal cosine between span(Sᵀ), covectors
//! measured by M⁻¹, and the tangent space. Dense: one LU of [S; C] per evaluation, n³/3 + n²(k + 1).

mod closing;
mod life;

use super::basis::Basis;
use super::dense::DenseTangent;
use super::instant::quality_of_selector;
use super::{kept_rows, Occasion, Tangent};
use crate::kinematics::projection::dense_rows;
use crate::partition::criterion::{self, Quality};
use crate::record::Verdict;
use crate::record::{Correction, FormulationCounters, Journal, PartitionEvent};
use crate::reduction::{Reduction, SINGULAR_PIVOT};
use crate::start;
use crate::system::{ConstrainedSystem, SystemError};
use partita_math::dense::{self, Matrix};
use partita_math::factor::{self, FactorError};

/// The reduced equations (36) of a system at one point, for a frozen S.
///
/// Computed with `w = L⁻¹ u` in the place of u, where `S M⁻¹ Sᵀ = L Lᵀ` when frozen: the same covectors made orthonormal, so
/// that neither pivots nor M_d depend on the units a rule works in. D_wᵀ, γ = −G a, δ = −G b, M_d and w' are left in `d`, v in
/// `r`, whose partition serves for its rows alone.
pub struct Frozen<'s, S: ConstrainedSystem> {
    /// Levels of the system, and room for the results.
    pub r: Reduction<'s, S>,
    /// The tangent of the orthonormal covectors.
    pub d: DenseTangent,
    renew: f64,
    basis: Box<dyn Basis>,
    /// S.
    selector: Matrix,
    /// `L⁻¹ S`.
    orthonormal: Vec<f64>,
    /// L with `S M⁻¹ Sᵀ = L Lᵀ` at the freezing time.
    lower: Vec<f64>,
    /// Natural scales of the velocities at the freezing time.
    columns: Vec<f64>,
    rows: Vec<f64>,
    lu: Vec<f64>,
    pivots: Vec<usize>,
    rhs: Vec<f64>,
    w: Vec<f64>,
    mass: Vec<f64>,
    h: Vec<f64>,
    fresh: Quality,
    lowest: f64,
    rejects_in_a_row: u32,
    frozen: u64,
    kept: u64,
    /// Of redundant rows, do others serve better?
    fading: bool,
    events: Vec<PartitionEvent>,
}

impl<'s, S: ConstrainedSystem> Frozen<'s, S> {
    /// Room for a system of the given rank; nothing frozen yet. `renew`: see
    /// [`FormulationOptions`](crate::options::FormulationOptions::renew).
    pub fn new(system: &'s S, rank: usize, basis: Box<dyn Basis>, renew: f64) -> Self {
        let r = Reduction::dense(system, rank);
        let (n, k) = (r.size().nv, r.k());
        Self {
            r,
            d: DenseTangent::new(n, k),
            renew,
            basis,
            selector: Matrix::new(k, n),
            orthonormal: vec![0.0; k * n],
            lower: vec![0.0; k * k],
            columns: vec![1.0; n],
            rows: vec![1.0; n],
            lu: vec![0.0; n * n],
            pivots: vec![0; n],
            rhs: vec![0.0; n],
            w: vec![0.0; k],
            mass: vec![0.0; n * n],
            h: vec![0.0; n],
            fresh: Quality { sigma: 1.0, sqrt_mu: 1.0 },
            lowest: 1.0,
            rejects_in_a_row: 0,
            frozen: 0,
            kept: 0,
            fading: false,
            events: Vec::new(),
        }
    }

    /// Name of the rule.
    pub fn name(&self) -> &'static str {
        self.basis.name()
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

    /// Take S from the rule at `(t, q)`; on failure the old one stays. Leaves v at zero.
    pub fn freeze(&mut self, t: f64, q: &[f64]) -> Result<(), SystemError> {
        let (n, k) = (self.r.size().nv, self.r.k());
        self.levels_at_rest(t, q)?;
        self.r.refresh_scales(t, q)?;
        let mut c = dense_rows(self.r.system, &self.r.c, &self.r.partition.rows);
        for i in 0..c.rows() {
            let length = dense::dot(c.row(i), c.row(i)).sqrt();
            if length > 0.0 {
                c.row_mut(i).iter_mut().for_each(|x| *x /= length);
            }
        }
        let mass = Matrix::from_vec(n, n, self.mass.clone());
        let new = self.basis.basis(&mass, &c).map_err(|e| match e {
            FactorError::NotFinite => {
                SystemError::NotFinite { what: "the mass matrix or the constraint Jacobian".into(), t }
            }
            other => self.failed(t, format!("it could not be computed ({other}); take another rule")),
        })?;
        if (new.rows(), new.cols()) != (k, n) {
            return Err(SystemError::Singular { t, pivot: 0.0, limit: SINGULAR_PIVOT });
        }
        let old = (self.selector.clone(), self.orthonormal.clone(), self.lower.clone(), self.columns.clone());
        self.selector = new;
        self.columns.copy_from_slice(self.r.scales());
        let adopted = self.adopt(t);
        if adopted.is_err() {
            (self.selector, self.orthonormal, self.lower, self.columns) = old;
        }
        adopted
    }

    /// Orthonormalise the new S, factor with it and see how good it is.
    fn adopt(&mut self, t: f64) -> Result<(), SystemError> {
        let (n, k) = (self.r.size().nv, self.r.k());
        let block = self.inverse_mass_block()?;
        self.lower.copy_from_slice(&block);
        if dense::cholesky(&mut self.lower, k).is_err() {
            return Err(self.failed(t, "its covectors depend on each other; take another rule".into()));
        }
        for i in 0..n {
            let column = &mut self.rhs[..k];
            (0..k).for_each(|j| column[j] = self.selector[(j, i)]);
            dense::cholesky_forward(&self.lower, k, column);
            (0..k).for_each(|j| self.orthonormal[j * n + i] = column[j]);
        }
        self.factor(t)?;
        self.basis_vectors();
        self.fresh = self.quality_with(&block);
        self.lowest = self.lowest.min(self.fresh.sqrt_mu);
        self.frozen += 1;
        Ok(())
    }

    /// Position, bias and dense M at v = 0.
    fn levels_at_rest(&mut self, t: f64, q: &[f64]) -> Result<(), SystemError> {
        self.r.position(t, q)?;
        self.r.v.fill(0.0);
        self.r.system.velocity(t, q, &self.r.v, &mut self.r.scratch, &mut self.r.b)?;
        self.r.system.dynamics(t, q, &self.r.v, &mut self.r.scratch, &mut self.mass, &mut self.h)
    }

    fn failed(&self, t: f64, reason: String) -> SystemError {
        SystemError::Basis { name: self.name().into(), t, reason }
    }

    /// `u = S v`.
    pub fn values(&self, v: &[f64], u: &mut [f64]) {
        for (j, u) in u.iter_mut().enumerate() {
            *u = dense::dot(self.selector.row(j), v);
        }
    }

    /// Factor [S; C] at the last position.
    pub fn factor(&mut self, t: f64) -> Result<(), SystemError> {
        let size = self.orthonormal.len();
        self.lu[..size].copy_from_slice(&self.orthonormal);
        self.factor_below(t)
    }

    /// Factor with other covectors (k x n) in the place of the orthonormal ones of S.
    pub fn factor_with(&mut self, t: f64, covectors: &[f64]) -> Result<(), SystemError> {
        self.lu[..covectors.len()].copy_from_slice(covectors);
        self.factor_below(t)
    }

    /// Add the rows of C below those in place, bring all to natural scales and length 1, and factor.
    fn factor_below(&mut self, t: f64) -> Result<(), SystemError> {
        let (n, k) = (self.r.size().nv, self.r.k());
        self.r.factorisations += 1;
        self.lu[k * n..].fill(0.0);
        let pattern = self.r.system.pattern();
        for (i, &row) in self.r.partition.rows.iter().enumerate() {
            for e in pattern.row(row) {
                self.lu[(k + i) * n + pattern.col_idx[e]] = self.r.c[e];
            }
        }
        for (scale, row) in self.rows.iter_mut().zip(self.lu.chunks_exact_mut(n)) {
            row.iter_mut().zip(&self.columns).for_each(|(x, s)| *x *= s);
            *scale = 1.0 / dense::dot(row, row).sqrt();
            row.iter_mut().for_each(|x| *x *= *scale);
        }
        let ratio = match dense::lu(&mut self.lu, n, &mut self.pivots) {
            Ok(()) => dense::lu_pivot_ratio(&self.lu, n),
            Err(e) if e.pivot == 0.0 => 0.0,
            // a row of zeros has no length either: it is singular, not infinite
            Err(_) if self.r.c.iter().all(|x| x.is_finite()) => 0.0,
            Err(_) => return Err(SystemError::NotFinite { what: "the constraint Jacobian".into(), t }),
        };
        if ratio >= SINGULAR_PIVOT {
            return Ok(());
        }
        Err(self.blame(t, ratio))
    }

    /// Is it the mechanism that is singular, or the basis that no longer fits?
    fn blame(&self, t: f64, pivot: f64) -> SystemError {
        let mut c = dense_rows(self.r.system, &self.r.c, &self.r.partition.rows);
        for i in 0..c.rows() {
            let row = c.row_mut(i);
            row.iter_mut().zip(&self.columns).for_each(|(x, s)| *x *= s);
            let length = dense::dot(row, row).sqrt();
            row.iter_mut().for_each(|x| *x /= length);
        }
        let smallest = factor::svd(&c).map_or(0.0, |f| f.s.last().copied().unwrap_or(1.0));
        if smallest < SINGULAR_PIVOT {
            return SystemError::Singular { t, pivot: smallest, limit: SINGULAR_PIVOT };
        }
        let reason = format!(
            "with the constraints it leaves a scaled pivot of {pivot:.2e} (limit {SINGULAR_PIVOT:.0e}) while the mechanism itself \
             is regular: the motion has turned away from the directions it was frozen in; let it be renewed earlier (a larger \
             renew, at most 1)"
        );
        self.failed(t, reason)
    }

    /// `x ← [S; C]⁻¹ x` for k + r numbers in the order of S and the kept rows; on return a velocity.
    ///
    /// The first k numbers are values of the orthonormal covectors, see [`in_orthonormal`](Self::in_orthonormal).
    pub fn solve(&self, x: &mut [f64]) {
        x.iter_mut().zip(&self.rows).for_each(|(x, s)| *x *= s);
        dense::lu_solve(&self.lu, x.len(), &self.pivots, x);
        x.iter_mut().zip(&self.columns).for_each(|(x, s)| *x *= s);
    }

    /// Values of S v as values of the orthonormal covectors: `x ← L⁻¹ x` (k).
    pub fn in_orthonormal(&self, x: &mut [f64]) {
        dense::cholesky_forward(&self.lower, x.len(), x);
    }

    /// D_wᵀ and γ = −G a with the last factors.
    pub fn basis_vectors(&mut self) {
        let (n, k) = (self.r.size().nv, self.r.k());
        let mut x = std::mem::take(&mut self.rhs);
        for j in 0..k {
            x.fill(0.0);
            x[j] = 1.0;
            self.solve(&mut x);
            (0..n).for_each(|i| self.d.dt[i * k + j] = x[i]);
        }
        self.d.gamma.fill(0.0);
        if self.r.system.rheonomic() {
            x[..k].fill(0.0);
            for (x, &row) in x[k..].iter_mut().zip(&self.r.partition.rows) {
                *x = -self.r.a[row];
            }
            self.solve(&mut x);
            self.d.gamma.copy_from_slice(&x);
        }
        self.rhs = x;
    }

    /// b at (t, q, r.v), and δ = −G b.
    pub fn velocity(&mut self, t: f64, q: &[f64]) -> Result<(), SystemError> {
        let k = self.r.k();
        self.r.system.velocity(t, q, &self.r.v, &mut self.r.scratch, &mut self.r.b)?;
        let mut x = std::mem::take(&mut self.rhs);
        x[..k].fill(0.0);
        for (x, &row) in x[k..].iter_mut().zip(&self.r.partition.rows) {
            *x = -self.r.b[row];
        }
        self.solve(&mut x);
        self.d.delta.copy_from_slice(&x);
        self.rhs = x;
        Ok(())
    }

    /// `M_d w' = D_w (h − M δ)` with the state of the lower levels.                        (36)
    pub fn acceleration(&mut self, t: f64, q: &[f64]) -> Result<(), SystemError> {
        self.d.accelerate(&mut self.r, t, q, |_| None)
    }

    /// The tangent at `(t, q)`, and v for u.
    pub fn kinematics(&mut self, t: f64, q: &[f64], u: &[f64]) -> Result<(), SystemError> {
        self.r.position(t, q)?;
        self.factor(t)?;
        self.basis_vectors();
        self.velocities(u);
        Ok(())
    }

    /// All levels at `(t, q, u)`.
    pub fn evaluate(&mut self, t: f64, q: &[f64], u: &[f64]) -> Result<(), SystemError> {
        self.kinematics(t, q, u)?;
        self.velocity(t, q)?;
        self.acceleration(t, q)
    }

    /// `v = D_Sᵀ u + γ`, left in `r.v`.
    pub fn velocities(&mut self, u: &[f64]) {
        self.w.copy_from_slice(u);
        dense::cholesky_forward(&self.lower, u.len(), &mut self.w);
        self.d.spread(&self.w, &mut self.r.v);
    }

    /// u' of the last evaluation.
    pub fn tangent_acceleration(&self, out: &mut [f64]) {
        let k = out.len();
        for (j, out) in out.iter_mut().enumerate() {
            *out = dense::dot(&self.lower[j * k..=j * k + j], &self.d.du); // L w'
        }
    }

    /// D_Sᵀ (n x k) of the last evaluation.
    pub fn tangent_matrix(&self) -> Matrix {
        let (n, k) = (self.r.size().nv, self.r.k());
        let mut d = Matrix::from_vec(n, k, self.d.dt.clone());
        for i in 0..n {
            dense::cholesky_backward(&self.lower, k, d.row_mut(i));
        }
        d
    }

    /// σ and √μ_S at `(t, q)` with the last tangent, which must be of there. Cost: n³/6 + n²k.
    pub fn quality_here(&mut self, t: f64, q: &[f64]) -> Result<Quality, SystemError> {
        self.r.system.dynamics(t, q, &self.r.v, &mut self.r.scratch, &mut self.mass, &mut self.h)?;
        let block = self.inverse_mass_block()?;
        Ok(self.quality_with(&block))
    }

    /// `S M⁻¹ Sᵀ` (k x k).
    fn inverse_mass_block(&self) -> Result<Vec<f64>, SystemError> {
        let (n, k) = (self.r.size().nv, self.r.k());
        let mut l = self.mass.clone();
        dense::cholesky(&mut l, n)
            .map_err(|e| SystemError::Mass { name: self.r.system.velocity_name(e.index), pivot: e.pivot })?;
        let mut w = self.selector.clone();
        for j in 0..k {
            dense::cholesky_forward(&l, n, w.row_mut(j));
        }
        Ok((0..k * k).map(|e| dense::dot(w.row(e / k), w.row(e % k))).collect())
    }

    fn quality_with(&self, block: &[f64]) -> Quality {
        let (n, k) = (self.r.size().nv, self.r.k());
        // D M Dᵀ from the dense M at hand: M_d of the last evaluation may be of another point
        let d = self.tangent_matrix();
        let md = d.transpose().matmul(&Matrix::from_vec(n, n, self.mass.clone())).matmul(&d);
        let lengths: Vec<f64> = (0..k).map(|j| block[j * k + j]).collect();
        criterion::quality(md.data(), &lengths, block)
    }
}

impl<'s, S: ConstrainedSystem> Tangent<'s, S> for Frozen<'s, S> {
    fn reduction(&mut self) -> &mut Reduction<'s, S> {
        &mut self.r
    }
    fn seen(&self) -> &Reduction<'s, S> {
        &self.r
    }
    fn start(&mut self, t: f64, q: &mut [f64], _v: &[f64]) -> Result<(), SystemError> {
        self.begin(t, q)
    }
    fn select(&mut self, v: &[f64], u: &mut [f64]) -> Result<(), SystemError> {
        self.values(v, u);
        Ok(())
    }
    fn tangent(&mut self, t: f64, _q: &[f64], factored: bool) -> Result<(), SystemError> {
        if !factored {
            self.factor(t)?;
        }
        self.basis_vectors();
        Ok(())
    }
    fn spread(&mut self, u: &[f64]) {
        self.velocities(u);
    }
    fn accelerate(&mut self, t: f64, q: &[f64], _u: &[f64]) -> Result<(), SystemError> {
        self.velocity(t, q)?;
        self.acceleration(t, q)
    }
    fn rates(&self, du: &mut [f64]) {
        self.tangent_acceleration(du);
    }
    fn full_acceleration(&self, out: &mut [f64]) {
        self.d.full_acceleration(out);
    }
    fn offset(&self) -> &[f64] {
        &self.d.gamma
    }
    fn correct(&mut self, t: f64, q: &mut [f64], rule: Correction) -> Result<bool, SystemError> {
        self.correct_once(t, q, rule)
    }
    fn judge(&mut self, t: f64, q: &[f64]) -> Verdict {
        self.look(t, q)
    }
    fn attends(&self) -> bool {
        self.fading
    }
    fn accept(&mut self, t: f64, q: &[f64]) -> Result<(), SystemError> {
        if std::mem::take(&mut self.fading) {
            // should no better rows be found, the next evaluation tells
            let _ = start::choose_partition(&mut self.r, t, q, None, None);
        }
        Ok(())
    }
    fn renew(&mut self, t: f64, q: &mut [f64], _v: &[f64], why: Occasion) -> Result<bool, SystemError> {
        let why = match why {
            Occasion::Decayed => "it had decayed along the motion",
            Occasion::Spoilt => "it went bad inside the step, which is repeated",
            Occasion::Positions(why) => why,
        };
        self.freeze_anew(t, q, why)
    }
    fn quality(
        &mut self,
        r: &mut Reduction<'s, S>,
        t: f64,
        q: &[f64],
        within: Option<&PartitionEvent>,
    ) -> Result<Option<Quality>, SystemError> {
        let frozen = within.and_then(|event| event.basis.as_deref()).unwrap_or(&self.selector);
        quality_of_selector(r, t, q, frozen).map(Some)
    }
    fn events(&self) -> &[PartitionEvent] {
        &self.events
    }
    fn report(&self, journal: &mut Journal) {
        let (factorisations, plans) = (self.r.factorisations, self.frozen);
        journal.counters = FormulationCounters { factorisations, plans, ..FormulationCounters::default() };
        journal.rows = kept_rows(&self.r);
        journal.notes.extend(self.told());
    }
}
