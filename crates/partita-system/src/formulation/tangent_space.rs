//! Tangent-space parametrisation: 2k states in a chart of the closed positions (Potra, Yen 1991; Yen 1993; Haug).
//!
//! From a base position q₀ the mechanism is moved by `q = step(q₀, Δ)`; the chart gives p = S Δ, and Newton's method finds the Δ
//! with `Φ(q, t) = 0`, `S Δ = p` at every evaluation:
//!
//! ```text
//! p' = S Δ',   u = S v,   M_d u' = D_S (h + M G b)                                            (36)
//! ```
//!
//! Without turns in space Δ' = v, so p' = u. A turn in space advances by q₀ exp(Θ), and its rotation vector at the rate
//! `Θ' = ω + ½ Θ×ω + c(θ) Θ×(Θ×ω)` for body rates ω (46). S is mass-orthonormal when frozen (see
//! [`gram_schmidt`](super::gram_schmidt)). The chart is left for a new one, based where the mechanism stands, when the
//! quality of S falls, when Newton's method needs many iterations, or when a ball has turned far; (q, v) stay the same.
//!
//! The loops are closed to round-off at every stage, with nothing to correct afterwards: prefer it where forces or tables must
//! never see open loops, or where 2k states matter (long smooth arcs); it costs some two to four factorisations of [S; C] per
//! evaluation, n³/3 each. Nonholonomic rows have no positions to parametrise and are refused.

use super::gram_schmidt::GramSchmidt;
use super::selector::Selector;
use super::{turns, Formulation, FormulationCounters, Output, PartitionEvent, Review, Sample};
use crate::system::{ConstrainedSystem, SystemError};
use partita_math::dense;

/// Newton's method squares the error: from a stage away (1e-2 of a large move) it is at round-off after five.
const ITERATIONS: u32 = 12;
/// So many iterations are a sign that the chart is bent too much here.
const MANY: u32 = 7;
/// Moves below this part of a large one that no longer shrink are round-off.
const STALLED: f64 = 1e-9;
/// A ball that has turned this far from the base asks for a new chart: the rate of the rotation vector grows without bounds
/// towards 2π, and a quarter of the way there it is still as good as straight ...
const FAR_TURN: f64 = std::f64::consts::FRAC_PI_2;
/// ... and one that turned this far inside a step spoils the step.
const TOO_FAR_TURN: f64 = 1.5 * std::f64::consts::PI;

/// States (p, u) in a tangent chart.
pub struct TangentSpace<'s, S: ConstrainedSystem> {
    x: Selector<'s, S>,
    renew: f64,
    observes_work: bool,
    /// The velocities of each ball.
    balls: Vec<[usize; 3]>,
    reach: Vec<f64>,
    base: Vec<f64>,
    /// Δ of the last evaluation, and at the end of the last step.
    delta: Vec<f64>,
    accepted: Vec<f64>,
    /// The accepted one before, for a step that is given up.
    before: Vec<f64>,
    q: Vec<f64>,
    w: Vec<f64>,
    rhs: Vec<f64>,
    covectors: Vec<f64>,
    iterations: u32,
    why: &'static str,
}

impl<'s, S: ConstrainedSystem> TangentSpace<'s, S> {
    /// For a system of the given rank without nonholonomic rows. `renew`: see
    /// [`FormulationOptions`](super::options::FormulationOptions::renew).
    pub fn new(system: &'s S, rank: usize, renew: f64) -> Result<Self, SystemError> {
        let size = system.size();
        if size.rows > size.holonomic {
            return Err(SystemError::Request(format!(
                "tangent-space parametrises closed positions, but {} does not constrain positions (it is nonholonomic); use \
                 projective or gram-schmidt",
                system.row_words(size.holonomic)
            )));
        }
        let (n, k) = (size.nv, size.nv - rank);
        Ok(Self {
            x: Selector::new(system, rank, Box::new(GramSchmidt)),
            renew,
            observes_work: system.has_power() || system.rheonomic(),
            balls: balls(system)?,
            reach: (0..n).map(|i| system.reach(i)).collect(),
            base: vec![0.0; size.nq],
            delta: vec![0.0; n],
            accepted: vec![0.0; n],
            before: vec![0.0; n],
            q: vec![0.0; size.nq],
            w: vec![0.0; k],
            rhs: vec![0.0; n],
            covectors: vec![0.0; k * n],
            iterations: 0,
            why: "",
        })
    }

    /// The selector, at the point last evaluated.
    pub fn selector(&mut self) -> &mut Selector<'s, S> {
        &mut self.x
    }

    /// Coordinates found by the last evaluation.
    pub fn position(&self) -> &[f64] {
        &self.q
    }

    fn k(&self) -> usize {
        self.x.r.k()
    }

    fn bent(&self, t: f64, reason: String) -> SystemError {
        SystemError::Basis { name: self.x.name().into(), t, reason }
    }

    /// Find q for p, starting from the end of the last step; leaves the levels and the factors of [S; C] there.
    fn find(&mut self, t: f64, p: &[f64]) -> Result<(), SystemError> {
        let (n, k) = (self.delta.len(), self.k());
        self.w.copy_from_slice(p);
        self.x.in_orthonormal(&mut self.w);
        self.delta.copy_from_slice(&self.accepted);
        let mut before = f64::INFINITY;
        for iteration in 0..=ITERATIONS {
            self.iterations = iteration;
            let turned = self.largest_turn();
            if turned > TOO_FAR_TURN {
                return Err(self.bent(t, format!(
                    "a ball has turned by {turned:.2} rad from where its chart was made; let it be renewed (renew > 0), or take \
                     shorter steps"
                )));
            }
            self.q.copy_from_slice(&self.base);
            self.x.r.system.step(&mut self.q, &self.delta);
            self.x.r.position(t, &self.q)?;
            self.factor(t)?;
            for j in 0..k {
                self.rhs[j] = self.w[j] - dense::dot(&self.x.orthonormal()[j * n..(j + 1) * n], &self.delta);
            }
            for (x, &row) in self.rhs[k..].iter_mut().zip(&self.x.r.partition.rows) {
                *x = -self.x.r.phi[row];
            }
            self.x.solve(&mut self.rhs);
            let large = |x: &[f64]| x.iter().zip(&self.reach).fold(0.0, |m: f64, (x, r)| larger(m, x.abs() / r));
            let (moved, far) = (large(&self.rhs), 1.0 + large(&self.delta));
            let settled = moved <= 4.0 * f64::EPSILON * far && self.x.r.is_closed();
            if settled || (moved < STALLED * far && moved > 0.25 * before) {
                if !self.balls.is_empty() {
                    self.x.factor(t)?;
                }
                return Ok(());
            }
            // the first move is along the tangent; moves that do not halve from there lead to another solution, or none
            if !moved.is_finite() || (iteration > 0 && moved > 0.5 * before) {
                break;
            }
            before = moved;
            // Δ' = T⁻¹ v
            turned_back(&self.balls, &self.delta, &mut self.rhs);
            dense::axpy(1.0, &self.rhs, &mut self.delta);
        }
        let reason = format!(
            "no closed position was found for its coordinates in {} iterations of Newton's method (last move {before:.1e}); let it \
             be renewed earlier (a larger renew, at most 1), or take shorter steps",
            self.iterations
        );
        Err(self.bent(t, reason))
    }

    /// Factor [S T⁻¹; C] at the last position: the rows that tell p' from v, above those of C.
    fn factor(&mut self, t: f64) -> Result<(), SystemError> {
        if self.balls.is_empty() {
            return self.x.factor(t);
        }
        let n = self.delta.len();
        self.covectors.copy_from_slice(self.x.orthonormal());
        for row in self.covectors.chunks_exact_mut(n) {
            for b in &self.balls {
                // (T⁻¹)ᵀ turns the other way
                let s = turn_rate(b.map(|i| -self.delta[i]), b.map(|i| row[i]));
                (0..3).for_each(|i| row[b[i]] = s[i]);
            }
        }
        self.x.factor_with(t, &self.covectors)
    }

    fn largest_turn(&self) -> f64 {
        let square = |b: &[usize; 3]| b.iter().map(|&i| self.delta[i] * self.delta[i]).sum::<f64>();
        self.balls.iter().fold(0.0, |m: f64, b| larger(m, square(b))).sqrt()
    }

    /// All levels at (t, p, u).
    fn evaluate(&mut self, t: f64, y: &[f64]) -> Result<(), SystemError> {
        let k = self.k();
        self.find(t, &y[..k])?;
        self.x.tangent();
        self.x.spread(&y[k..2 * k]);
        self.x.velocity(t, &self.q)?;
        self.x.acceleration(t, &self.q)
    }

    /// A new chart at the point of y; rewrites y and its derivative from (q, v, v') there.
    fn rebase(&mut self, t: f64, y: &mut [f64], dy: &mut [f64], why: &str) -> Result<(), SystemError> {
        let k = self.k();
        self.evaluate(t, y)?;
        let v = self.x.r.v.clone();
        let mut vdot = vec![0.0; v.len()];
        self.x.r.full_acceleration(&mut vdot);
        let mut q = self.q.clone();
        self.x.r.system.normalise(&mut q);
        if self.x.renew(t, &q, why)? {
            self.base.copy_from_slice(&q);
            self.accepted.fill(0.0);
            y[..k].fill(0.0);
            self.x.select(&v, &mut y[k..2 * k]);
            self.x.select(&v, &mut dy[..k]);
            self.x.select(&vdot, &mut dy[k..2 * k]);
        }
        Ok(())
    }
}

impl<S: ConstrainedSystem> Formulation for TangentSpace<'_, S> {
    fn name(&self) -> &'static str {
        "tangent-space"
    }
    fn dim(&self) -> usize {
        self.controlled() + usize::from(self.observes_work)
    }
    fn controlled(&self) -> usize {
        2 * self.k()
    }
    fn start(&mut self, t: f64, q: &[f64], v: &[f64], y: &mut [f64]) -> Result<(), SystemError> {
        let k = self.k();
        self.x.start(t, q)?;
        self.base.copy_from_slice(q);
        self.accepted.fill(0.0);
        y.fill(0.0);
        self.x.select(v, &mut y[k..2 * k]);
        Ok(())
    }
    fn derivative(&mut self, t: f64, y: &[f64], dy: &mut [f64]) -> Result<(), SystemError> {
        let k = self.k();
        self.evaluate(t, y)?;
        if self.balls.is_empty() {
            // S v = u + S γ, and S γ = 0
            dy[..k].copy_from_slice(&y[k..2 * k]);
        } else {
            self.rhs.copy_from_slice(&self.x.r.v);
            turned_back(&self.balls, &self.delta, &mut self.rhs);
            self.x.select(&self.rhs, &mut dy[..k]);
        }
        self.x.tangent_acceleration(&mut dy[k..2 * k]);
        if self.observes_work {
            dy[2 * k] = self.x.power(t, &self.q)?;
        }
        Ok(())
    }
    fn correct(&mut self, _t: f64, _y: &mut [f64]) -> Result<bool, SystemError> {
        Ok(false) // closed at every evaluation
    }
    fn review(&mut self, t: f64, _y: &[f64]) -> Review {
        let q = std::mem::take(&mut self.q);
        let mut review = self.x.judge(t, &q, self.renew);
        self.q = q;
        self.why = "it had decayed along the motion";
        if review == Review::Keep && self.renew > 0.0 {
            if self.largest_turn() > FAR_TURN {
                (review, self.why) = (Review::Change, "a ball had turned far from the base of the chart");
            } else if self.iterations >= MANY {
                (review, self.why) = (Review::Change, "Newton's method needed many iterations");
            }
        }
        if review != Review::Reject {
            self.before.copy_from_slice(&self.accepted);
            self.accepted.copy_from_slice(&self.delta);
        }
        review
    }
    fn retreat(&mut self) {
        self.accepted.copy_from_slice(&self.before);
    }
    /// The base gives the turns away, so that the coordinates found from it stay small; y does not change.
    fn wrap(&mut self, _y: &mut [f64], turns: &mut [i32]) -> bool {
        let mut q = self.base.clone();
        self.x.r.system.step(&mut q, &self.accepted);
        for (i, q) in q.into_iter().enumerate() {
            let mut angle = q;
            if turns::reduce_one(self.x.r.system, i, &mut angle, &mut turns[i]) {
                self.base[i] += angle - q;
            }
        }
        false
    }
    fn change(&mut self, t: f64, y: &mut [f64], dy: &mut [f64]) -> Result<(), SystemError> {
        self.rebase(t, y, dy, self.why)
    }
    fn recover(&mut self, t: f64, y: &mut [f64], dy: &mut [f64]) -> Result<(), SystemError> {
        self.rebase(t, y, dy, "it went bad inside the step, which is repeated")?;
        self.derivative(t, y, dy)
    }
    fn state_at(&mut self, t: f64, y: &[f64], out: &mut Output) -> Result<(), SystemError> {
        let k = self.k();
        self.find(t, &y[..k])?;
        self.x.tangent();
        self.x.spread(&y[k..2 * k]);
        out.set(t, &self.q, &self.x.r.v, if self.observes_work { y[2 * k] } else { 0.0 });
        self.x.r.system.normalise(&mut out.q);
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
        self.x.describe(t, q, v, within, out)
    }
    fn events(&self) -> &[PartitionEvent] {
        self.x.events()
    }
    fn counters(&self) -> FormulationCounters {
        FormulationCounters {
            factorisations: self.x.r.factorisations,
            plans: self.x.frozen(),
            ..FormulationCounters::default()
        }
    }
    fn rows(&self) -> Vec<usize> {
        self.x.kept_rows()
    }
    fn notes(&self) -> Vec<String> {
        self.x.notes(self.renew)
    }
}

/// The larger of two numbers, NaN winning.
fn larger(m: f64, x: f64) -> f64 {
    if m > x || m.is_nan() {
        m
    } else {
        x
    }
}

/// Velocities that form a ball: three that change the same quaternion.
fn balls<S: ConstrainedSystem>(system: &S) -> Result<Vec<[usize; 3]>, SystemError> {
    let n = system.size().nv;
    let mut found: Vec<(usize, Vec<usize>)> = Vec::new();
    for i in 0..n {
        let range = system.coordinates_of(i);
        match (range.len(), found.iter_mut().find(|f| f.0 == range.start)) {
            (1, _) => {}
            (_, Some(f)) => f.1.push(i),
            (_, None) => found.push((range.start, vec![i])),
        }
    }
    found
        .into_iter()
        .map(|(start, velocities)| match <[usize; 3]>::try_from(velocities) {
            Ok(b) if system.coordinates_of(b[0]).len() == 4 => Ok(b),
            _ => Err(SystemError::Request(format!(
                "tangent-space knows coordinates that are integrals of velocities and unit quaternions; coordinate {start} is \
                 neither; use projective"
            ))),
        })
        .collect()
}

/// `T⁻¹ x` in place: a velocity as the rate of Δ.
fn turned_back(balls: &[[usize; 3]], delta: &[f64], x: &mut [f64]) {
    for b in balls {
        let rate = turn_rate(b.map(|i| delta[i]), b.map(|i| x[i]));
        (0..3).for_each(|i| x[b[i]] = rate[i]);
    }
}

/// `Θ' = ω + ½ Θ×ω + c(θ) Θ×(Θ×ω)`, `c = (1 − (θ/2) cot(θ/2)) / θ²`.                              (46)
fn turn_rate(turn: [f64; 3], w: [f64; 3]) -> [f64; 3] {
    let square: f64 = turn.iter().map(|x| x * x).sum();
    let half = 0.5 * square.sqrt();
    // by its series where the quotient would lose digits: the next term is θ⁶/1209600
    let c = if half < 0.05 {
        1.0 / 12.0 + square * (1.0 / 720.0 + square / 30240.0)
    } else {
        (1.0 - half / half.tan()) / square
    };
    let once = cross(turn, w);
    let twice = cross(turn, once);
    [0, 1, 2].map(|i| w[i] + 0.5 * once[i] + c * twice[i])
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
