//! User-defined tangent velocities: `v = Dᵀ(t, q) u + γ(t, q)` in closed form, found by inspection or by a symbolic
//! program.
//!
//! `M_d u' = D (h − M δ)` with `δ = (dDᵀ/dt) u + γ'` from the user, or by central differences of the sixth order along
//! the motion. States (q, u): coordinates by S2. Only M_d is factored, so an evaluation costs the products with D
//! alone; prefer it for fixed simple mechanisms whose tangent is known. The user functions are checked against the
//! constraints at the start: C Dᵀ = 0, C γ + a = 0, C δ + b = 0, and v within the span.
//!
//! Drift of positions is corrected by the least displacement in the mass metric (33) whichever correction is requested:
//! there are no coordinates that could be left unchanged. Angles keep their whole turns, on which the user functions
//! may depend.

use super::instant::{quality_of_exact, quality_of_tangent};
use super::{Base, TangentChoice, TangentClosing, TangentLevels, TangentReplay};
use crate::error::Result;
use crate::manifold::orthogonal::orthogonal_step;
use crate::options::TangentMap;
use crate::record::{ChoiceLog, Correction, History, Output, PartitionEvent, Sample};
use crate::reduction::{Reduction, Sides};
use crate::start;
use crate::system::{ConstrainedSystem, SystemError, SystemRef};
use partita_math::dense::{self, Matrix};
use partita_math::tolerance;
use std::sync::Arc;

/// Half-width of the difference formula. Unit: characteristic displacements of the fastest velocity. Reason: the sixth
/// power is far below round-off.
const TANGENT_MOVE: f64 = 1e-2;

/// Tangent given by the user as functions D and γ.
pub struct MappedTangent<'s, S: ConstrainedSystem> {
    base: Base<'s, S>,
    map: Arc<dyn TangentMap>,
    displacement: Vec<f64>,
    near: Vec<f64>,
    step: Vec<f64>,
    dt: Vec<f64>,
    values: [Vec<f64>; 6],
    best: Vec<f64>,
    differences: u64,
    worst: f64,
    /// u at the start.
    first: Vec<f64>,
}

impl<'s, S: ConstrainedSystem> MappedTangent<'s, S> {
    /// For a system of the given rank.
    pub fn new(system: impl Into<SystemRef<'s, S>>, rank: usize, map: Arc<dyn TangentMap>) -> Self {
        let r = Reduction::dense(system, rank).trusting_pivots();
        let (nq, n, k) = (r.size().nq, r.size().nv, r.k());
        Self {
            displacement: r.system.structure().displacements().collect(),
            base: Base::new(r),
            map,
            near: vec![0.0; nq],
            step: vec![0.0; n],
            dt: vec![0.0; n * k],
            values: [(); 6].map(|()| vec![0.0; n]),
            best: vec![0.0; n],
            differences: 0,
            worst: 0.0,
            first: Vec::new(),
        }
    }

    fn basis_vectors(&mut self, t: f64, q: &[f64]) -> Result<()> {
        let r = &mut self.base.r;
        self.map.tangent(t, q, &mut r.at.dt)?;
        self.map.offset(t, q, &mut r.at.gamma)?;
        match r.at.dt.iter().chain(&r.at.gamma).all(|x| x.is_finite()) {
            true => Ok(()),
            false => Err(SystemError::NotFinite { what: "a tangent velocity of the user".into(), t }),
        }
    }

    /// δ, then b and u', at the velocities last computed.
    fn levels(&mut self, t: f64, q: &[f64], u: &[f64]) -> Result<()> {
        let r = &mut self.base.r;
        if !self.map.bias(t, q, &r.at.v, &mut r.at.delta)? {
            self.bias_by_differences(t, q, u)?;
        }
        let r = &mut self.base.r;
        if !r.at.delta.iter().all(|x| x.is_finite()) {
            return Err(SystemError::NotFinite { what: "the bias of the user's tangent velocities".into(), t });
        }
        r.system.velocity(t, q, &r.at.v, &mut r.scratch, &mut r.at.b)?;
        r.acceleration(t, q).map_err(|e| match e {
            SystemError::Mass { pivot, .. } if r.at.md.iter().all(|x| x.is_finite()) => SystemError::Basis {
                name: "user-tangent".into(),
                t,
                reason: format!(
                    "its velocities are linearly dependent, or {} moves without inertia (pivot {pivot:.2e} of the \
                     reduced mass matrix); use others for this part of the motion",
                    without_inertia(r)
                ),
            },
            SystemError::Mass { .. } => SystemError::NotFinite { what: "the reduced mass matrix".into(), t },
            other => other,
        })
    }

    /// δ: the change of `Dᵀ u + γ` along the motion with u constant.
    fn bias_by_differences(&mut self, t: f64, q: &[f64], u: &[f64]) -> Result<()> {
        let rate = self.base.r.at.v.iter().zip(&self.displacement).fold(0.0, |m: f64, (v, r)| m.max(v.abs() / r));
        // a large displacement in the time of one unit where nothing moves (only t changes)
        let mut s = TANGENT_MOVE / (1.0 + rate);
        let mut least = f64::INFINITY;
        self.differences += 1;
        for _ in 0..3 {
            for (i, part) in [1.0, -1.0, 2.0, -2.0, 3.0, -3.0].into_iter().enumerate() {
                self.velocity_near(t, q, u, part * s / 3.0, i)?;
            }
            let h = s / 3.0;
            let (mut apart, mut size): (f64, f64) = (0.0, 0.0);
            for i in 0..self.step.len() {
                let d = |j: usize| self.values[2 * j][i] - self.values[2 * j + 1][i];
                let sixth = (45.0 * d(0) - 9.0 * d(1) + d(2)) / (60.0 * h);
                let fourth = (8.0 * d(0) - d(1)) / (12.0 * h);
                apart = apart.max((sixth - fourth).abs() / self.displacement[i]);
                size = size.max((sixth.abs() + self.base.r.at.v[i].abs() * (1.0 + rate)) / self.displacement[i]);
                self.step[i] = sixth;
            }
            let apart = if size > 0.0 { apart / size } else { 0.0 };
            if apart < least || least.is_infinite() {
                least = apart;
                self.best.copy_from_slice(&self.step);
            }
            // the error of the sixth order is about the three halves' power of their difference
            if apart <= tolerance::DIFFERENCE_ROUNDING {
                break;
            }
            s *= 0.25;
        }
        self.base.r.at.delta.copy_from_slice(&self.best);
        self.worst = self.worst.max(least);
        Ok(())
    }

    /// `Dᵀ u + γ` where the motion will be (was) after `s`, into `values[i]`.
    fn velocity_near(&mut self, t: f64, q: &[f64], u: &[f64], s: f64, i: usize) -> Result<()> {
        let k = u.len();
        self.near.copy_from_slice(q);
        self.step.iter_mut().zip(&self.base.r.at.v).for_each(|(x, v)| *x = s * v);
        self.base.r.system.step(&mut self.near, &self.step);
        self.map.tangent(t + s, &self.near, &mut self.dt)?;
        self.map.offset(t + s, &self.near, &mut self.values[i])?;
        for (j, x) in self.values[i].iter_mut().enumerate() {
            *x += dense::dot(&self.dt[j * k..(j + 1) * k], u);
        }
        Ok(())
    }

    /// Length of row `row` of C in natural scales.
    fn row_length(&self, row: usize) -> f64 {
        let pattern = self.base.r.system.pattern();
        pattern
            .row(row)
            .map(|e| (self.base.r.at.c[e] * self.base.r.scales()[pattern.col_idx[e]]).powi(2))
            .sum::<f64>()
            .sqrt()
    }

    /// `C x` in row `row`, and its natural size.
    fn along(&self, row: usize, x: impl Fn(usize) -> f64) -> (f64, f64) {
        let pattern = self.base.r.system.pattern();
        let sum = pattern.row(row).map(|e| self.base.r.at.c[e] * x(pattern.col_idx[e])).sum();
        let large = self.base.r.scales().iter().enumerate().fold(0.0, |m: f64, (i, s)| m.max(x(i).abs() / s));
        (sum, self.row_length(row) * large)
    }

    /// `C Dᵀ = 0` and `C γ + a = 0` at the last position.
    fn check_tangent(&self) -> Result<()> {
        let k = self.base.r.k();
        for row in 0..self.base.r.size().rows {
            let words = || &self.base.r.system.structure().rows[row].description;
            for j in 0..k {
                let (sum, size) = self.along(row, |i| self.base.r.at.dt[i * k + j]);
                if sum.abs() > tolerance::WORST_ROUNDING * size {
                    return Err(SystemError::argument(
                        "tangent",
                        format!(
                            "tangent velocity {j} violates {}: C D^T is {sum:.3e} there (of {size:.3e}) instead of 0; \
                         check column {j} of the tangent and the position at which it is evaluated",
                            words()
                        ),
                    ));
                }
            }
            let (sum, size) = self.along(row, |i| self.base.r.at.gamma[i]);
            let (left, size) = (sum + self.base.r.at.a[row], size + self.base.r.at.a[row].abs());
            if left.abs() > tolerance::WORST_ROUNDING * size {
                return Err(SystemError::argument(
                    "tangent",
                    format!(
                        "the offset of the tangent velocities violates {}: C gamma + a is {left:.3e} there (of \
                     {size:.3e}) instead of 0; give offset(t, q) for time-dependent constraints",
                        words()
                    ),
                ));
            }
        }
        Ok(())
    }

    /// `C δ + b = 0` at the last evaluation.
    fn check_bias(&self) -> Result<()> {
        let rate = self.base.r.at.v.iter().zip(&self.displacement).fold(0.0, |m: f64, (v, r)| m.max(v.abs() / r));
        for row in 0..self.base.r.size().rows {
            let (sum, size) = self.along(row, |i| self.base.r.at.delta[i]);
            let left = sum + self.base.r.at.b[row];
            // where the terms vanish by chance: the size for a velocity changing at the rate of the motion
            let size = size + self.base.r.at.b[row].abs() + self.along(row, |i| self.base.r.at.v[i]).1 * rate;
            if left.abs() > tolerance::EQUAL_IN_SIX_DIGITS * size {
                return Err(SystemError::argument(
                    "tangent",
                    format!(
                        "the bias of the tangent velocities violates {}: C delta + b is {left:.3e} there (of \
                     {size:.3e}) instead of 0; check bias(t, q, v), or omit it, and finite differences are used",
                        self.base.r.system.structure().rows[row].description
                    ),
                ));
            }
        }
        Ok(())
    }

    /// u for v by least squares in the mass metric.
    fn fit(&mut self, t: f64, q: &[f64], v: &[f64]) -> Result<Vec<f64>> {
        let (n, k) = (v.len(), self.base.r.k());
        let (mut mass, mut h) = (vec![0.0; n * n], vec![0.0; n]);
        self.base.r.system.velocity(t, q, v, &mut self.base.r.scratch, &mut self.base.r.at.b)?;
        self.base.r.system.dynamics(t, q, v, &mut self.base.r.scratch, &mut mass, &mut h)?;
        self.base.r.system.add_metric(&mut self.base.r.scratch, &mut mass);
        let mass = Matrix::from_vec(n, n, mass);
        let d = Matrix::from_vec(n, k, self.base.r.at.dt.clone());
        let mut md = d.transpose().matmul(&mass).matmul(&d).into_vec();
        let sigma = quality_of_exact(&md, k).sigma;
        let least = tolerance::DEPENDENT;
        if sigma < least || dense::cholesky(&mut md, k).is_err() {
            return Err(SystemError::argument(
                "tangent",
                format!(
                    "the {k} tangent velocities are linearly dependent at the start (sigma = {sigma:.1e}, at least \
                 {least:.0e} is needed); the columns of the tangent must span all {k} degrees of freedom"
                ),
            ));
        }
        let rest: Vec<f64> = v.iter().zip(&self.base.r.at.gamma).map(|(v, g)| v - g).collect();
        let mut u = d.transpose().matvec(&mass.matvec(&rest));
        dense::cholesky_solve(&md, k, &mut u);
        let off: Vec<f64> = d.matvec(&u).iter().zip(&rest).map(|(x, y)| x - y).collect();
        let length = |x: &[f64]| dense::dot(&mass.matvec(x), x).max(0.0).sqrt();
        let (off, size) = (length(&off), length(v) + length(&self.base.r.at.gamma));
        if off > tolerance::EQUAL_IN_SIX_DIGITS * size {
            return Err(SystemError::argument(
                "tangent",
                format!(
                    "the initial velocities are not a combination of the tangent velocities: {off:.3e} of {size:.3e} \
                 remains (mass metric); start with velocities that satisfy the constraints"
                ),
            ));
        }
        Ok(u)
    }
}

impl<'s, S: ConstrainedSystem> TangentLevels<'s, S> for MappedTangent<'s, S> {
    fn base(&self) -> &Base<'s, S> {
        &self.base
    }
    fn base_mut(&mut self) -> &mut Base<'s, S> {
        &mut self.base
    }
    /// The u fitted to the initial state; it does not change later.
    fn select(&mut self, _v: &[f64], u: &mut [f64]) {
        u.copy_from_slice(&self.first);
    }
    fn tangent(&mut self, t: f64, q: &[f64], _factored: bool) -> Result<()> {
        self.basis_vectors(t, q)
    }
    fn accelerate(&mut self, t: f64, q: &[f64], u: &[f64]) -> Result<()> {
        self.levels(t, q, u)
    }
}

impl<'s, S: ConstrainedSystem> TangentChoice<'s, S> for MappedTangent<'s, S> {
    fn start(&mut self, t: f64, q: &mut [f64], v: &[f64]) -> Result<()> {
        start::choose_partition(&mut self.base.r, t, q, None, None)?; // for the rows and the scales
        self.base.r.position(t, q)?;
        self.basis_vectors(t, q)?;
        self.check_tangent()?;
        let u = self.fit(t, q, v)?;
        self.base.r.spread(&u);
        self.levels(t, q, &u)?;
        self.check_bias()?;
        self.first = u;
        let (r, named) = (&self.base.r, "the event lists the best choice of coordinates at this time");
        let reason = format!("the user's tangent velocities are integrated; {named}");
        let (p, quality) = (&r.planned.partition, quality_of_exact(&r.at.md, r.k()));
        self.base.choices = ChoiceLog::default();
        self.base.choices.record(PartitionEvent::new(t, &p.independent, &p.independent, &p.dependent, reason, quality));
        Ok(())
    }
    fn describe(
        &mut self,
        r: Option<&mut Reduction<'s, S>>,
        _at: &Output,
        _within: Option<&PartitionEvent>,
        out: &mut Sample,
    ) -> Result<()> {
        let Some(r) = r.filter(|_| !out.brief) else { return Ok(()) };
        self.map.tangent(out.t, &out.q, &mut self.dt)?;
        let quality = quality_of_tangent(r, &self.dt);
        (out.sigma, out.sqrt_mu) = (quality.sigma, quality.sqrt_mu);
        Ok(())
    }
    fn report(&self, history: &mut History) {
        if self.differences > 0 {
            history.notes.push(format!(
                "the bias of the user's tangent velocities was computed by finite differences along the motion ({} \
                 times); the fourth and sixth order differ by at most {:.1e} of its size",
                self.differences, self.worst
            ));
        }
    }
}

impl<'s, S: ConstrainedSystem> TangentReplay<'s, S> for MappedTangent<'s, S> {}

impl<'s, S: ConstrainedSystem> TangentClosing<'s, S> for MappedTangent<'s, S> {
    /// Always by the least displacement: there are no coordinates that could be left unchanged.
    fn correction(&mut self, t: f64, q: &[f64], _rule: Correction, dv: &mut [f64]) -> Result<bool> {
        dv.copy_from_slice(&orthogonal_step(&mut self.base.r, t, q)?);
        Ok(true)
    }
    fn sides(&self, sides: &mut Sides) {
        self.base.r.sides(sides);
    }
    fn choice_of_sides(&self) -> (u64, u64) {
        (self.base.r.choices(), 0)
    }
}

/// The velocity with the largest share in the tangent velocity that has no inertia.
fn without_inertia<S: ConstrainedSystem>(r: &Reduction<S>) -> String {
    let k = r.k();
    let index = dense::cholesky(&mut r.at.md.clone(), k).map_or_else(|e| e.index, |()| 0);
    let share = |i: &usize| r.at.dt[i * k + index].abs();
    let most = (0..r.size().nv).max_by(|a, b| share(a).total_cmp(&share(b))).unwrap_or(0);
    r.system.structure().velocity_name(most)
}
