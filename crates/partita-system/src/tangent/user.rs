//! Tangent velocities of the user: `v = Dᵀ(t, q) u + γ(t, q)` in closed form, found by inspection or by a symbolic program.
//!
//! `M_d u' = D (h − M δ)` with `δ = (dDᵀ/dt) u + γ'` from the user, or by central differences of the sixth order along the
//! motion. States (q, u): coordinates by S2. Nothing is factored but M_d, so an evaluation costs the products with D alone;
//! prefer it for fixed simple mechanisms whose tangent is known. What is handed over is held against the constraints at the
//! start: C Dᵀ = 0, C γ + a = 0, C δ + b = 0, and v within the span.
//!
//! Drift of positions is removed by the least move in the mass metric (33) whichever correction is asked for: there are no
//! coordinates that could stay untouched. Angles keep their whole turns: the user's functions may count them.

use super::dense::{best_partition, DenseTangent};
use super::instant::{quality_of_exact, quality_of_tangent};
use super::{kept_rows, Tangent};
use crate::kinematics::projection::correct_orthogonally;
use crate::options::TangentMap;
use crate::partition::criterion::Quality;
use crate::record::{Correction, Journal, PartitionEvent};
use crate::reduction::Reduction;
use crate::start;
use crate::system::{ConstrainedSystem, SystemError};
use partita_math::dense::{self, Matrix};
use std::sync::Arc;

/// Products with C at the start may miss zero by this part of their natural size: what formulas with a few hundred operations
/// and a position closed to 1e-12 leave, and far below any wrong sign.
const FITS: f64 = 1e-8;
/// The same for velocities, which people type with some digits, and for biases found by differences.
const FITS_ROUGHLY: f64 = 1e-6;
/// σ below which the tangent velocities count as dependent: M_d then keeps no more than four digits.
const DEPENDENT: f64 = 1e-6;
/// Half-width of the difference formula, in large moves of the fastest velocity: the sixth power is far below round-off.
const MOVE: f64 = 1e-2;
/// Disagreement of the fourth and the sixth order from which a shorter step is tried (the error of the sixth is about its
/// three halves' power).
const DISAGREEMENT: f64 = 1e-8;

/// The user's D.
pub struct Given<'s, S: ConstrainedSystem> {
    r: Reduction<'s, S>,
    d: DenseTangent,
    map: Arc<dyn TangentMap>,
    reach: Vec<f64>,
    near: Vec<f64>,
    step: Vec<f64>,
    dt: Vec<f64>,
    values: [Vec<f64>; 6],
    best: Vec<f64>,
    differences: u64,
    worst: f64,
    events: Vec<PartitionEvent>,
    /// u at the start.
    first: Vec<f64>,
}

impl<'s, S: ConstrainedSystem> Given<'s, S> {
    /// For a system of the given rank.
    pub fn new(system: &'s S, rank: usize, map: Arc<dyn TangentMap>) -> Self {
        let r = Reduction::dense(system, rank);
        let (nq, n, k) = (r.size().nq, r.size().nv, r.k());
        Self {
            r,
            d: DenseTangent::new(n, k),
            map,
            reach: (0..n).map(|i| system.reach(i)).collect(),
            near: vec![0.0; nq],
            step: vec![0.0; n],
            dt: vec![0.0; n * k],
            values: [(); 6].map(|()| vec![0.0; n]),
            best: vec![0.0; n],
            differences: 0,
            worst: 0.0,
            events: Vec::new(),
            first: Vec::new(),
        }
    }

    fn basis_vectors(&mut self, t: f64, q: &[f64]) -> Result<(), SystemError> {
        self.map.tangent(t, q, &mut self.d.dt)?;
        self.map.offset(t, q, &mut self.d.gamma)?;
        match self.d.dt.iter().chain(&self.d.gamma).all(|x| x.is_finite()) {
            true => Ok(()),
            false => Err(SystemError::NotFinite { what: "a tangent velocity of the user".into(), t }),
        }
    }

    /// δ, then b and u', at the velocities last computed.
    fn levels(&mut self, t: f64, q: &[f64], u: &[f64]) -> Result<(), SystemError> {
        if !self.map.bias(t, q, &self.r.v, &mut self.d.delta)? {
            self.bias_by_differences(t, q, u)?;
        }
        if !self.d.delta.iter().all(|x| x.is_finite()) {
            return Err(SystemError::NotFinite { what: "the bias of the user's tangent velocities".into(), t });
        }
        self.r.system.velocity(t, q, &self.r.v, &mut self.r.scratch, &mut self.r.b)?;
        self.d.accelerate(&mut self.r, t, q, |_| None).map_err(|e| match e {
            SystemError::Mass { name, pivot } => SystemError::Basis {
                name: "user-tangent".into(),
                t,
                reason: format!(
                    "its velocities depend on each other, or {name} moves without inertia (pivot {pivot:.2e} of the reduced \
                     mass matrix); take others for this part of the motion"
                ),
            },
            other => other,
        })
    }

    /// δ: how `Dᵀ u + γ` changes along the motion with u held fast.
    fn bias_by_differences(&mut self, t: f64, q: &[f64], u: &[f64]) -> Result<(), SystemError> {
        let rate = self.r.v.iter().zip(&self.reach).fold(0.0, |m: f64, (v, r)| m.max(v.abs() / r));
        // a large move in the time of one unit where nothing moves (only t does)
        let mut s = MOVE / (1.0 + rate);
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
                apart = apart.max((sixth - fourth).abs() / self.reach[i]);
                size = size.max((sixth.abs() + self.r.v[i].abs() * (1.0 + rate)) / self.reach[i]);
                self.step[i] = sixth;
            }
            let apart = if size > 0.0 { apart / size } else { 0.0 };
            if apart < least || least.is_infinite() {
                least = apart;
                self.best.copy_from_slice(&self.step);
            }
            if apart <= DISAGREEMENT {
                break;
            }
            s *= 0.25;
        }
        self.d.delta.copy_from_slice(&self.best);
        self.worst = self.worst.max(least);
        Ok(())
    }

    /// `Dᵀ u + γ` where the motion will be (was) after `s`, into `values[i]`.
    fn velocity_near(&mut self, t: f64, q: &[f64], u: &[f64], s: f64, i: usize) -> Result<(), SystemError> {
        let k = u.len();
        self.near.copy_from_slice(q);
        self.step.iter_mut().zip(&self.r.v).for_each(|(x, v)| *x = s * v);
        self.r.system.step(&mut self.near, &self.step);
        self.map.tangent(t + s, &self.near, &mut self.dt)?;
        self.map.offset(t + s, &self.near, &mut self.values[i])?;
        for (j, x) in self.values[i].iter_mut().enumerate() {
            *x += dense::dot(&self.dt[j * k..(j + 1) * k], u);
        }
        Ok(())
    }

    /// Length of row `row` of C in natural scales.
    fn row_length(&self, row: usize) -> f64 {
        let pattern = self.r.system.pattern();
        pattern.row(row).map(|e| (self.r.c[e] * self.r.scales()[pattern.col_idx[e]]).powi(2)).sum::<f64>().sqrt()
    }

    /// `C x` in row `row`, and its natural size.
    fn along(&self, row: usize, x: impl Fn(usize) -> f64) -> (f64, f64) {
        let pattern = self.r.system.pattern();
        let sum = pattern.row(row).map(|e| self.r.c[e] * x(pattern.col_idx[e])).sum();
        let large = self.r.scales().iter().enumerate().fold(0.0, |m: f64, (i, s)| m.max(x(i).abs() / s));
        (sum, self.row_length(row) * large)
    }

    /// `C Dᵀ = 0` and `C γ + a = 0` at the last position.
    fn check_tangent(&self) -> Result<(), SystemError> {
        let k = self.r.k();
        for row in 0..self.r.size().rows {
            let words = || self.r.system.row_words(row);
            for j in 0..k {
                let (sum, size) = self.along(row, |i| self.d.dt[i * k + j]);
                if sum.abs() > FITS * size {
                    return Err(SystemError::Request(format!(
                        "tangent velocity {j} breaks {}: C D^T is {sum:.3e} there (of {size:.3e}) instead of 0; check column {j} \
                         of the tangent and the position it is meant for",
                        words()
                    )));
                }
            }
            let (sum, size) = self.along(row, |i| self.d.gamma[i]);
            let (left, size) = (sum + self.r.a[row], size + self.r.a[row].abs());
            if left.abs() > FITS * size {
                return Err(SystemError::Request(format!(
                    "the offset of the tangent velocities breaks {}: C gamma + a is {left:.3e} there (of {size:.3e}) instead of \
                     0; hand over offset(t, q) for constraints that move with time",
                    words()
                )));
            }
        }
        Ok(())
    }

    /// `C δ + b = 0` at the last evaluation.
    fn check_bias(&self) -> Result<(), SystemError> {
        let rate = self.r.v.iter().zip(&self.reach).fold(0.0, |m: f64, (v, r)| m.max(v.abs() / r));
        for row in 0..self.r.size().rows {
            let (sum, size) = self.along(row, |i| self.d.delta[i]);
            let left = sum + self.r.b[row];
            // where the terms vanish by chance: what a velocity changing at the rate of the motion would give
            let size = size + self.r.b[row].abs() + self.along(row, |i| self.r.v[i]).1 * rate;
            if left.abs() > FITS_ROUGHLY * size {
                return Err(SystemError::Request(format!(
                    "the bias of the tangent velocities breaks {}: C delta + b is {left:.3e} there (of {size:.3e}) instead of 0; \
                     check bias(t, q, v), or leave it out to have it found by differences",
                    self.r.system.row_words(row)
                )));
            }
        }
        Ok(())
    }

    /// u for v by least squares in the mass metric.
    fn fit(&mut self, t: f64, q: &[f64], v: &[f64]) -> Result<Vec<f64>, SystemError> {
        let (n, k) = (v.len(), self.r.k());
        let (mut mass, mut h) = (vec![0.0; n * n], vec![0.0; n]);
        self.r.system.velocity(t, q, v, &mut self.r.scratch, &mut self.r.b)?;
        self.r.system.dynamics(t, q, v, &mut self.r.scratch, &mut mass, &mut h)?;
        let mass = Matrix::from_vec(n, n, mass);
        let d = Matrix::from_vec(n, k, self.d.dt.clone());
        let mut md = d.transpose().matmul(&mass).matmul(&d).into_vec();
        let sigma = quality_of_exact(&md, k).sigma;
        if sigma < DEPENDENT || dense::cholesky(&mut md, k).is_err() {
            return Err(SystemError::Request(format!(
                "the {k} tangent velocities depend on each other at the start (sigma = {sigma:.1e}, at least {DEPENDENT:.0e} is \
                 needed); the columns of the tangent must span all {k} degrees of freedom"
            )));
        }
        let rest: Vec<f64> = v.iter().zip(&self.d.gamma).map(|(v, g)| v - g).collect();
        let mut u = d.transpose().matvec(&mass.matvec(&rest));
        dense::cholesky_solve(&md, k, &mut u);
        let off: Vec<f64> = d.matvec(&u).iter().zip(&rest).map(|(x, y)| x - y).collect();
        let length = |x: &[f64]| dense::dot(&mass.matvec(x), x).max(0.0).sqrt();
        let (off, size) = (length(&off), length(v) + length(&self.d.gamma));
        if off > FITS_ROUGHLY * size {
            return Err(SystemError::Request(format!(
                "the initial velocities are no combination of the tangent velocities: {off:.3e} of {size:.3e} is left over (in the \
                 mass metric); start with velocities that satisfy the constraints"
            )));
        }
        Ok(u)
    }
}

impl<'s, S: ConstrainedSystem> Tangent<'s, S> for Given<'s, S> {
    fn reduction(&mut self) -> &mut Reduction<'s, S> {
        &mut self.r
    }
    fn seen(&self) -> &Reduction<'s, S> {
        &self.r
    }
    fn start(&mut self, t: f64, q: &mut [f64], v: &[f64]) -> Result<(), SystemError> {
        start::choose_partition(&mut self.r, t, q, None, None)?; // for the rows and the scales
        self.r.position(t, q)?;
        self.basis_vectors(t, q)?;
        self.check_tangent()?;
        let u = self.fit(t, q, v)?;
        self.d.spread(&u, &mut self.r.v);
        self.levels(t, q, &u)?;
        self.check_bias()?;
        self.first = u;
        let best = best_partition(self.r.system, self.r.rank(), t, q)?;
        let quality = quality_of_exact(&self.d.md, self.r.k());
        let reason =
            "the user's tangent velocities are integrated; named is the best choice of coordinates at this time";
        self.events = vec![PartitionEvent {
            entering: Vec::new(),
            ..PartitionEvent::new(t, &[], &best.independent, &best.dependent, reason.into(), quality)
        }];
        Ok(())
    }
    /// The u that was fitted to the start; there is no other choice later.
    fn select(&mut self, _v: &[f64], u: &mut [f64]) -> Result<(), SystemError> {
        u.copy_from_slice(&self.first);
        Ok(())
    }
    fn tangent(&mut self, t: f64, q: &[f64], _factored: bool) -> Result<(), SystemError> {
        self.basis_vectors(t, q)
    }
    fn spread(&mut self, u: &[f64]) {
        self.d.spread(u, &mut self.r.v);
    }
    fn accelerate(&mut self, t: f64, q: &[f64], u: &[f64]) -> Result<(), SystemError> {
        self.levels(t, q, u)
    }
    fn rates(&self, du: &mut [f64]) {
        du.copy_from_slice(&self.d.du);
    }
    fn full_acceleration(&self, out: &mut [f64]) {
        self.d.full_acceleration(out);
    }
    fn offset(&self) -> &[f64] {
        &self.d.gamma
    }
    /// Always by the least move: there are no coordinates that could stay untouched.
    fn correct(&mut self, t: f64, q: &mut [f64], _rule: Correction) -> Result<bool, SystemError> {
        correct_orthogonally(&mut self.r, t, q)?;
        Ok(true)
    }
    fn quality(
        &mut self,
        r: &mut Reduction<'s, S>,
        t: f64,
        q: &[f64],
        _within: Option<&PartitionEvent>,
    ) -> Result<Option<Quality>, SystemError> {
        self.map.tangent(t, q, &mut self.dt)?;
        Ok(Some(quality_of_tangent(r, &self.dt)))
    }
    fn events(&self) -> &[PartitionEvent] {
        &self.events
    }
    fn report(&self, journal: &mut Journal) {
        journal.rows = kept_rows(&self.r);
        if self.differences > 0 {
            journal.notes.push(format!(
                "the bias of the user's tangent velocities was found by differences along the motion ({} times); their fourth and \
                 sixth order disagree by {:.1e} of its size at most",
                self.differences, self.worst
            ));
        }
    }
}
