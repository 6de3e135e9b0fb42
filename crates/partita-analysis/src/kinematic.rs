//! Velocities and accelerations that goals prescribe, without dynamics.
//!
//! ```text
//! v  = Dᵀ u + [0; η],   G v = y'              G: rates of the goals by velocities
//! v' = Dᵀ u' + [0; ξ],  G v' + G' v = y''                                                                (I3)
//! ```
//!
//! The goals determine u where P = G Dᵀ has full rank; it is measured in an orthonormal basis of the motions, in natural
//! scales: its least singular value is the sine of the angle between the goals and what they cannot move.

use crate::error::AnalysisError;
use crate::geometry::Geometry;
use crate::outputs::{tables, Rows, Watch};
use crate::plausibility::idle;
use crate::poses::Target;
use partita_math::dense::{self, Matrix};
use partita_math::factor::{svd, Svd};
use partita_math::tolerance;
use partita_model::model::ModelScratch;
use partita_model::observe::DegreeOfFreedom;
use partita_model::Model;
use partita_system::prelude::*;
use partita_system::reduction::Reduction;
use partita_system::{start, SystemError};

/// How many goals a mechanism needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DegreesOfFreedom {
    /// Degrees of freedom.
    pub all: usize,
    /// Rotations among them that move no other body and need no goal.
    pub idle: usize,
}

/// The degrees of freedom at the closed position q, for rates: prescribed motions and rolling conditions count.
///
/// # Errors
/// `SingularStart` where branches meet.
pub fn degrees_of_freedom(model: &Model, t: f64, q: &[f64]) -> Result<DegreesOfFreedom, SystemError> {
    let all = model.size().nv - start::analyse(&Geometry::new(model, true), t, q)?.rank;
    Ok(DegreesOfFreedom { all, idle: idle(model).len().min(all) })
}

/// What became of the rates of one pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Determined {
    /// The goals determine them.
    Yes,
    /// No rates were asked for: there is no position.
    Open,
    /// The rates of the goals do not determine the motion here.
    Singular,
    /// No motion has these rates.
    Contradiction,
    /// No motion has these accelerations.
    Accelerations,
}

impl Determined {
    const ALL: [Self; 5] = [Self::Yes, Self::Open, Self::Singular, Self::Contradiction, Self::Accelerations];

    /// In one word, for messages.
    pub fn word(self) -> &'static str {
        match self {
            Self::Yes => "determined",
            Self::Open => "open",
            Self::Singular => "singular",
            Self::Contradiction => "contradiction",
            Self::Accelerations => "accelerations contradict",
        }
    }
}

/// Velocities and accelerations of poses, row by row; NaN where the goals do not determine them.
#[derive(Clone, Debug, Default)]
pub struct Rates {
    /// v.
    pub v: Vec<f64>,
    /// v'.
    pub vdot: Vec<f64>,
    /// Velocities for unit rate of each goal alone, goal after goal: ∂v/∂y'.
    pub ratios: Vec<f64>,
    /// Least singular value of P: 0 where the goals do not determine the motion, 1 at best.
    pub margin: Vec<f64>,
    /// The goal that is missed most where they contradict, and by how much.
    pub missed: Vec<(usize, f64)>,
    /// What became of each.
    pub determined: Vec<Determined>,
}

/// Rates of the goals at one pose.
struct RateScratch<'g, 'm> {
    model: &'m Model,
    targets: &'g [Target],
    dofs: Vec<Option<DegreeOfFreedom>>,
    reduction: Reduction<'g, Geometry<'m>>,
    scratch: ModelScratch,
    scales: Vec<f64>,
    memory: Vec<f64>,
    /// Orthonormal basis of the motions in natural scales (k rows of n).
    base: Vec<Vec<f64>>,
    /// Rates of the goals by scaled velocities, each of length 1 (rows of n), and their lengths.
    rows: Vec<Vec<f64>>,
    lengths: Vec<f64>,
}

/// A row of results.
struct Row<'r> {
    v: &'r mut [f64],
    vdot: &'r mut [f64],
    ratios: &'r mut [f64],
}

impl<'g, 'm> RateScratch<'g, 'm> {
    fn new(
        model: &'m Model,
        geometry: &'g Geometry<'m>,
        rank: usize,
        targets: &'g [Target],
        dofs: Vec<Option<DegreeOfFreedom>>,
    ) -> Self {
        let n = model.size().nv;
        Self {
            model,
            targets,
            dofs,
            reduction: Reduction::dense(geometry, rank),
            scratch: model.scratch(),
            scales: geometry.scales(),
            memory: vec![0.0; n],
            base: Vec::new(),
            rows: Vec::new(),
            lengths: Vec::new(),
        }
    }

    /// The motions and the rows of the goals at (t, q); false where the mechanism is singular.
    fn linearise(&mut self, t: f64, q: &[f64]) -> Result<bool, SystemError> {
        let r = &mut self.reduction;
        match start::choose_partition(r, t, q, None, None) {
            Err(SystemError::Singular { .. } | SystemError::SingularStart { .. }) => return Ok(false),
            other => other?,
        }
        let (n, k) = (self.scales.len(), r.k());
        self.base.clear();
        for j in 0..k {
            let mut x: Vec<f64> = (0..n).map(|i| r.at.dt[i * k + j] / self.scales[i]).collect();
            for _ in 0..2 {
                for other in &self.base {
                    let part = dense::dot(&x, other);
                    x.iter_mut().zip(other).for_each(|(x, o)| *x -= part * o);
                }
            }
            let size = dense::dot(&x, &x).sqrt();
            x.iter_mut().for_each(|x| *x /= size);
            self.base.push(x);
        }
        self.rows.clear();
        self.lengths.clear();
        for x in self.targets {
            let (mut row, mut at) = (vec![0.0; n], x.velocities.iter());
            x.rates(self.model, q, &mut self.memory, &mut self.scratch, |g| {
                if let Some(&i) = at.next() {
                    row[i] = g * self.scales[i];
                }
            });
            let length = dense::dot(&row, &row).sqrt();
            if length > 0.0 {
                row.iter_mut().for_each(|x| *x /= length);
            }
            self.rows.push(row);
            self.lengths.push(length);
        }
        Ok(true)
    }

    /// P, decomposed; none where there is no goal or no degree of freedom.
    fn decomposed(&self) -> Option<Svd> {
        let mut p = Matrix::new(self.rows.len(), self.base.len());
        for (i, row) in self.rows.iter().enumerate() {
            self.base.iter().enumerate().for_each(|(j, x)| p[(i, j)] = dense::dot(row, x));
        }
        svd(&p).ok()
    }

    /// The least combination of motions that changes the goals by `wanted` (over the lengths of their rows), added to
    /// `to` in units of the velocities.
    fn solve(&self, f: &Svd, wanted: &[f64], to: &mut [f64]) {
        for k in 0..f.s.len() {
            let along: f64 = wanted.iter().enumerate().map(|(i, w)| f.u[(i, k)] * w).sum::<f64>() / f.s[k];
            for (j, x) in self.base.iter().enumerate() {
                let part = along * f.v[(j, k)];
                to.iter_mut().zip(x).zip(&self.scales).for_each(|((to, x), scale)| *to += part * x * scale);
            }
        }
    }

    /// What rows of goals still lack for these velocities, over their lengths; `bias` is known beside them.
    fn missing(&self, wanted: &[f64], bias: &[f64], v: &[f64]) -> Vec<f64> {
        let of = |i: usize| {
            let along: f64 = self.rows[i].iter().zip(v).zip(&self.scales).map(|((g, v), s)| g * v / s).sum();
            if self.lengths[i] > 0.0 {
                (wanted[i] - bias[i]) / self.lengths[i] - along
            } else {
                wanted[i] - bias[i]
            }
        };
        (0..self.rows.len()).map(of).collect()
    }

    /// The goal that is missed, if one is, and what it reaches short of its rate.
    fn missed(&self, missing: &[f64], wanted: &[f64], v: &[f64]) -> Option<(usize, f64)> {
        let speed = v.iter().zip(&self.scales).fold(0.0, |m: f64, (v, s)| m.max((v / s).abs()));
        let asked = wanted.iter().zip(&self.lengths).filter(|x| *x.1 > 0.0);
        let fastest = asked.fold(speed, |m, (w, l)| m.max((w / l).abs()));
        let worst = (0..missing.len()).max_by(|&i, &j| missing[i].abs().total_cmp(&missing[j].abs()))?;
        let length = if self.lengths[worst] > 0.0 { self.lengths[worst] } else { 1.0 };
        (missing[worst].abs() > tolerance::RATES_MET * fastest).then_some((worst, missing[worst] * length))
    }

    /// Velocities and accelerations at one pose, with the margin.
    fn pose(
        &mut self,
        (t, q): (f64, &[f64]),
        (rates, accelerations): (&[f64], &[f64]),
        needed: usize,
        row: &mut Row,
    ) -> Result<(Determined, f64, (usize, f64)), SystemError> {
        let none = (0, 0.0);
        if !q.iter().all(|x| x.is_finite()) {
            return Ok((Determined::Open, f64::NAN, none));
        }
        if !self.linearise(t, q)? {
            return Ok((Determined::Singular, 0.0, none));
        }
        let w = self.rows.len();
        let f = if needed == 0 { None } else { self.decomposed() };
        let margin = match &f {
            None => 1.0,
            Some(f) if f.s.len() < needed => 0.0,
            Some(f) => f.s[needed - 1],
        };
        if margin * margin < tolerance::REDUNDANT {
            return Ok((Determined::Singular, margin, none));
        }
        let still = vec![0.0; w];
        let mut v = self.reduction.at.gamma.clone();
        if let Some(f) = &f {
            let missing = self.missing(rates, &still, &v);
            self.solve(f, &missing, &mut v);
            // the second solution removes the round-off of the first
            let missing = self.missing(rates, &still, &v);
            self.solve(f, &missing, &mut v);
            for (k, to) in row.ratios.chunks_mut(v.len()).enumerate() {
                let mut unit = vec![0.0; w];
                unit[k] = if self.lengths[k] > 0.0 { 1.0 / self.lengths[k] } else { 0.0 };
                self.solve(f, &unit, to);
            }
        }
        if let Some(missed) = self.missed(&self.missing(rates, &still, &v), rates, &v) {
            return Ok((Determined::Contradiction, margin, missed));
        }
        self.reduction.at.v.copy_from_slice(&v);
        self.reduction.velocity(t, q)?;
        let mut vdot = self.reduction.at.delta.clone();
        let zero = vec![0.0; v.len()];
        let mut bias = vec![0.0; w];
        for ((bias, x), dof) in bias.iter_mut().zip(self.targets).zip(&mut self.dofs) {
            *bias = x.acceleration(self.model, (q, &v, &zero), &mut self.scratch, dof);
        }
        if let Some(f) = &f {
            for _ in 0..2 {
                let missing = self.missing(accelerations, &bias, &vdot);
                self.solve(f, &missing, &mut vdot);
            }
        }
        row.v.copy_from_slice(&v);
        // accelerations of a motion at rest have no speed to be measured by, and grow with its square
        let size = v.iter().zip(&self.scales).fold(0.0, |m: f64, (v, s)| m.max((v / s).abs())).powi(2);
        let missing = self.missing(accelerations, &bias, &vdot);
        if let Some(missed) = self.missed(&missing, accelerations, &vdot) {
            if missed.1.abs() > tolerance::RATES_MET * size {
                return Ok((Determined::Accelerations, margin, missed));
            }
        }
        row.vdot.copy_from_slice(&vdot);
        Ok((Determined::Yes, margin, none))
    }
}

/// Velocities and accelerations for which the goals move at the rates and accelerations of each row, at the closed
/// positions in the rows of q; an open one has NaN there. `near` is a regular closed position.
///
/// Rotations that move no other body turn as little as possible. The rate of an orientation is an angular velocity
/// along an axis of the world. Each row depends on its own position alone.
///
/// # Errors
/// `SingularStart` where branches meet at `near`; errors of functions that the model calls, and of `watch`.
pub fn rates(
    model: &Model,
    (t, near): (f64, &[f64]),
    q: &[f64],
    targets: &[Target],
    (rates, accelerations): (&[f64], &[f64]),
    watch: Watch,
) -> Result<Rates, AnalysisError> {
    let (size, w) = (model.size(), targets.len());
    let count = q.len() / size.nq;
    let geometry = Geometry::new(model, true);
    let DegreesOfFreedom { all, idle } = degrees_of_freedom(model, t, near)?;
    let needed = all - idle;
    let dofs: Vec<_> = targets.iter().map(|x| x.degree_of_freedom(model)).collect::<Result<_, _>>()?;
    let widths = [size.nv, size.nv, size.nv * w, 4];
    let one = |i: usize, memory: &mut RateScratch, rows: &mut Rows| {
        let (mut v, mut vdot) = (vec![f64::NAN; size.nv], vec![f64::NAN; size.nv]);
        let mut ratios = vec![0.0; size.nv * w];
        let of = |x| <[f64]>::get(x, i * w..(i + 1) * w).unwrap_or_default();
        let mut row = Row { v: &mut v, vdot: &mut vdot, ratios: &mut ratios };
        let there = (t, &q[i * size.nq..][..size.nq]);
        let (found, margin, missed) = memory.pose(there, (of(rates), of(accelerations)), needed, &mut row)?;
        if matches!(found, Determined::Open | Determined::Singular) {
            ratios.fill(f64::NAN);
        }
        let number = Determined::ALL.iter().position(|x| *x == found).unwrap_or(0);
        rows.row(0, i).copy_from_slice(&v);
        rows.row(1, i).copy_from_slice(&vdot);
        rows.row(2, i).copy_from_slice(&ratios);
        rows.row(3, i).copy_from_slice(&[number as f64, margin, missed.0 as f64, missed.1]);
        Ok(())
    };
    let chunk = if model.equations().calls_functions() { usize::MAX } else { 1 };
    let memory = || RateScratch::new(model, &geometry, size.nv - all, targets, dofs.clone());
    let mut tables = tables(count, &widths, chunk, memory, one, watch)?.into_iter();
    let mut next = || tables.next().unwrap_or_default();
    let mut found = Rates { v: next(), vdot: next(), ratios: next(), ..Rates::default() };
    for x in next().chunks(4) {
        found.determined.push(Determined::ALL[x[0] as usize]);
        found.margin.push(x[1]);
        found.missed.push((x[2] as usize, x[3]));
    }
    Ok(found)
}
