//! Rows closed by the pseudo-inverse of C without its small singular values, and curves along what these leave free.
//!
//! ```text
//! dq = -C_s⁺ Φ,   C_s = Σ_{σ_i > s} u_i σ_i v_iᵀ
//! ```
//!
//! Singular values up to the level s count as null: rows that are weaker are left open, where they are. From afar the
//! level is graded, strong rows first, else steps jump off along weak ones.                                      (11.9)

use super::close::{close, Closed, Ending, Linearization, Open, Part, Room, Rule};
use super::follow::Curve;
use super::scaled::Scaled;
use crate::error::Result;
use crate::system::{ConstrainedSystem, SystemError};
use partita_math::factor::{svd, svd_full, Svd};

/// Levels of the first iterations: from this, ...
const COARSE: f64 = 0.03;
/// ... a tenth of it every so many.
const EVERY: usize = 2;
/// Longest step, in reaches.
const LONGEST: f64 = 0.3;
/// A step this short is the last.
const REST: f64 = 1e-13;
/// A direction that loses more than this part of itself from one position to the next does not go on.
const GOES_ON: f64 = 0.5;

/// To the least of |Φ| in the rows above the level: what stays open is [`Ending::AtRest`].
pub const TO_REST: Rule = Rule::new(100, f64::EPSILON, 1e-13).cut(LONGEST).to_rest(REST);

/// All rows of a system but the idle ones, dense.
pub struct Truncated<'s, S: ConstrainedSystem> {
    /// The rows in natural scales.
    pub scaled: Scaled<'s, S>,
    /// Singular values up to this are null.
    pub level: f64,
    /// Is the level graded over the iterations?
    pub graded: bool,
    t: f64,
    iteration: usize,
    cut: f64,
    open: Open,
    /// Σ Φ² of what the step takes back.
    within: f64,
    y: Vec<f64>,
    dv: Vec<f64>,
}

impl<'s, S: ConstrainedSystem> Truncated<'s, S> {
    /// At the time t; scales as at q.
    ///
    /// # Errors
    /// Where nothing can be evaluated at (t, q).
    pub fn new(system: &'s S, t: f64, q: &[f64], level: f64) -> Result<Self> {
        let n = system.size().nv;
        Ok(Self {
            scaled: Scaled::new(system, t, q, &[])?,
            level,
            graded: true,
            t,
            iteration: 0,
            cut: level,
            open: Open::default(),
            within: 0.0,
            y: vec![0.0; n],
            dv: vec![0.0; n],
        })
    }

    /// Close q by this rule, the level graded from the start.
    ///
    /// # Errors
    /// As [`close`].
    pub fn close(&mut self, q: &mut [f64], rule: &Rule, room: &mut Room) -> Result<Closed> {
        self.iteration = 0;
        close(self, q, rule, room)
    }

    /// C at q by its singular values, with full bases on both sides.
    ///
    /// # Errors
    /// Where nothing can be evaluated at q.
    pub fn spectrum(&mut self, q: &[f64]) -> Result<Svd> {
        self.scaled.evaluate(self.t, q)?;
        svd_full(&self.scaled.dense()).map_err(|_| self.not_finite())
    }

    /// Directions (in reaches) whose singular values are null.
    pub fn null(&self, f: &Svd) -> Vec<Vec<f64>> {
        let n = f.v.rows();
        let first = f.s.iter().filter(|s| **s > self.level).count();
        (first..n).map(|j| (0..n).map(|i| f.v[(i, j)]).collect()).collect()
    }

    fn not_finite(&self) -> SystemError {
        SystemError::NotFinite { what: "a closing condition".into(), t: self.t }
    }
}

impl<S: ConstrainedSystem> Linearization for Truncated<'_, S> {
    fn evaluate(&mut self, q: &[f64]) -> Result<()> {
        self.scaled.evaluate(self.t, q)?;
        self.open = Open::of(self.scaled.phi.iter().copied());
        Ok(())
    }
    fn open(&self, _part: usize) -> Open {
        self.open
    }
    fn solve(&mut self, _q: &[f64], _parts: &[Part]) -> Result<bool> {
        let f = svd(&self.scaled.dense()).map_err(|_| self.not_finite())?;
        let graded = COARSE * 0.1f64.powi((self.iteration / EVERY) as i32);
        self.cut = if self.graded { self.level.max(graded) } else { self.level };
        self.iteration += 1;
        self.y.fill(0.0);
        self.within = 0.0;
        for (k, s) in f.s.iter().enumerate().filter(|x| *x.1 > self.cut) {
            let part: f64 = self.scaled.phi.iter().enumerate().map(|(i, x)| f.u[(i, k)] * x).sum();
            self.within += part * part;
            self.y.iter_mut().enumerate().for_each(|(j, y)| *y -= part / s * f.v[(j, k)]);
        }
        Ok(true)
    }
    fn length(&self, _part: usize) -> f64 {
        largest(&self.y)
    }
    fn scale(&mut self, _part: usize, by: f64) {
        self.y.iter_mut().for_each(|y| *y *= by);
    }
    fn advance(&mut self, q: &mut [f64]) {
        self.scaled.advance(q, 1.0, &self.y, &mut self.dv);
    }
    fn left(&self, _part: usize, fraction: f64) -> f64 {
        self.open.square - fraction * (2.0 - fraction) * self.within
    }
    fn is_settled(&self) -> bool {
        self.cut <= self.level
    }
}

/// The curve along a direction that is carried on in what the level leaves free, by the length of its fastest move.
pub struct Along<'s, S: ConstrainedSystem> {
    /// The rows.
    pub rows: Truncated<'s, S>,
    /// C at the position last closed.
    pub spectrum: Option<Svd>,
    /// Rows may stay open by this.
    open: f64,
    room: Room,
}

impl<'s, S: ConstrainedSystem> Along<'s, S> {
    /// Along what these rows leave free; they may stay open by `open`, where they rest.
    pub fn new(rows: Truncated<'s, S>, open: f64) -> Self {
        Self { rows, spectrum: None, open, room: Room::default() }
    }
}

impl<S: ConstrainedSystem> Curve for Along<'_, S> {
    /// The projection of the direction before on what is free now, its fastest move 1.
    fn direct(&mut self, q: &[f64], _s: f64, tangent: &mut [f64]) -> Result<bool> {
        let f = self.rows.spectrum(q)?;
        let before = norm(tangent);
        let mut on = vec![0.0; tangent.len()];
        for free in self.rows.null(&f) {
            let part: f64 = free.iter().zip(tangent.iter()).map(|(a, b)| a * b).sum();
            on.iter_mut().zip(&free).for_each(|(x, d)| *x += part * d);
        }
        self.spectrum = Some(f);
        let (after, fastest) = (norm(&on), largest(&on));
        tangent.iter_mut().zip(&on).for_each(|(t, x)| *t = x / fastest);
        Ok(after > GOES_ON * before && before > 0.0)
    }
    fn predict(&mut self, q: &mut [f64], tangent: &[f64], ds: f64) {
        self.rows.scaled.advance(q, ds, tangent, &mut self.rows.dv);
    }
    fn close(&mut self, q: &mut [f64], _s: f64) -> Result<Closed> {
        self.rows.close(q, &TO_REST, &mut self.room)
    }
    fn accepts(&self, closed: &Closed) -> bool {
        closed.ending <= Ending::AtRest && closed.open.worst <= self.open
    }
}

fn norm(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn largest(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |m: f64, x| m.max(x.abs()))
}
