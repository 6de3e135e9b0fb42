//! Tangent-space parametrisation: 2k states in a chart of the closed positions (Potra, Yen 1991; Yen 1993; Haug).
//!
//! From a base position q₀ the mechanism is moved by `q = step(q₀, Δ)`; the chart gives p = S Δ, and Newton's method
//! finds the Δ with `Φ(q, t) = 0`, `S Δ = p` at every evaluation:
//!
//! ```text
//! p' = S Δ',   u = S v,   M_d u' = D_S (h + M G b)                                            (36)
//! ```
//!
//! Without spatial rotations Δ' = v, so p' = u. A spatial rotation advances by q₀ exp(Θ), and its rotation vector at
//! the rate `Θ' = ω + ½ Θ×ω + c(θ) Θ×(Θ×ω)` for body rates ω (46). S is mass-orthonormal when frozen (see
//! [`Rule::GramSchmidt`](crate::tangent::basis::Rule::GramSchmidt)). The chart is replaced by one based at the present
//! position when the quality of S falls, when Newton's method needs many iterations, or when a ball joint has rotated
//! far; (q, v) are unchanged.
//!
//! The loops are closed to round-off at every stage, with nothing to correct afterwards: prefer it where forces or
//! tables must never be evaluated with open loops, or where 2k states matter (long smooth arcs); it costs some two to
//! four factorisations of [S; C] per evaluation, of C_D and of S Dᵀ each. Nonholonomic rows have no positions to
//! parametrise and are refused.

use super::continuity::Continuity;
use super::{turns, Positions};
use crate::error::Result;
use crate::manifold::kept_rows::TO_ROUND_OFF;
use crate::manifold::{close, Closed, ClosingScratch, ClosureError, Linearization, Part, Residuals, Rule};
use crate::options::Renew;
use crate::positions::PositionSteps;
use crate::record::History;
use crate::record::StepDecision;
use crate::system::{ConstrainedSystem, SystemError};
use crate::tangent::frozen::Frozen;
use crate::tangent::{TangentClosing, TangentLevels};
use partita_math::dense;
use partita_math::tolerance;

/// To round-off. Newton's method squares the error: from a stage away (1e-2 of a large displacement) it converges in
/// five iterations. The first correction is along the tangent; corrections that do not halve from there lead to another
/// solution, or none.
const RULE: Rule = Rule { iterations: 12, ..TO_ROUND_OFF }.contracting(f64::INFINITY, tolerance::CONVERGES);
/// This many iterations indicate that the chart is too curved here.
const MANY: u32 = 7;
/// A ball joint that has rotated this far from the base point needs a new chart. Scale: rad. Reason: the rate of the
/// rotation vector grows without bounds towards 2π; a quarter of the way it is nearly straight.
const FAR_TURN: f64 = std::f64::consts::FRAC_PI_2;
/// A ball joint that has rotated this far inside a step invalidates the step. Scale: rad. Reason: three quarters of the
/// way to where the rate is unbounded.
const TOO_FAR_TURN: f64 = 1.5 * std::f64::consts::PI;

/// How a position is predicted.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Prediction {
    /// Ahead of the last step.
    Ahead,
    /// Inside the step that was judged: its end is known too.
    Inside,
}

/// Coordinates p (k states) of a tangent chart.
pub struct Chart {
    renew: Renew,
    /// The velocities of each ball.
    balls: Vec<[usize; 3]>,
    displacement: Vec<f64>,
    base: Vec<f64>,
    /// Δ of the last evaluation, at the end of the last step, and of the one that is judged.
    delta: Vec<f64>,
    accepted: Vec<f64>,
    trial: Vec<f64>,
    /// Velocities from which Δ is predicted, and that may not jump.
    continuity: Continuity,
    vdot: Vec<f64>,
    q: Vec<f64>,
    w: Vec<f64>,
    /// Residual of w.
    miss: Vec<f64>,
    rhs: Vec<f64>,
    covectors: Vec<f64>,
    memory: ClosingScratch,
    iterations: u32,
    /// Number of all iterations, without those for outputs.
    sum: u64,
    wants: Option<&'static str>,
}

impl Chart {
    /// For a system of the given rank without nonholonomic rows. `renew`: see
    /// [`FormulationOptions`](crate::options::FormulationOptions::renew).
    pub fn new<S: ConstrainedSystem>(system: &S, rank: usize, renew: Renew) -> Result<Self> {
        let size = system.size();
        let (n, k) = (size.nv, size.nv - rank);
        Ok(Self {
            renew,
            balls: balls(system)?,
            displacement: system.structure().displacements().collect(),
            base: vec![0.0; size.nq],
            delta: vec![0.0; n],
            accepted: vec![0.0; n],
            trial: vec![0.0; n],
            continuity: Continuity::default(),
            vdot: vec![0.0; n],
            q: vec![0.0; size.nq],
            w: vec![0.0; k],
            miss: vec![0.0; k],
            rhs: vec![0.0; n],
            covectors: vec![0.0; k * n],
            memory: ClosingScratch::for_coordinates(n),
            iterations: 0,
            sum: 0,
            wants: None,
        })
    }

    fn bent(&self, t: f64, reason: String) -> SystemError {
        SystemError::Basis { name: "gram-schmidt".into(), t, reason }
    }

    /// Find q for p, starting from its prediction by the velocities, which is nearest where solutions meet, or else from
    /// the end of the last step; evaluates the levels and the factors of [S; C] there.
    fn find<S: ConstrainedSystem>(&mut self, x: &mut Frozen<S>, t: f64, p: &[f64], at: Prediction) -> Result<()> {
        self.w.copy_from_slice(p);
        x.in_orthonormal(&mut self.w);
        match at {
            Prediction::Ahead => self.continuity.predict(t, &mut self.delta),
            Prediction::Inside => self.continuity.inside(t, &mut self.delta),
        }
        turned_back(&self.balls, &self.accepted, &mut self.delta);
        dense::axpy(1.0, &self.accepted, &mut self.delta);
        let mut found = self.close(x, t);
        if !matches!(&found, Ok(found) if found.is_closed()) {
            self.delta.copy_from_slice(&self.accepted);
            found = self.close(x, t);
        }
        let found = found?;
        self.iterations = found.iterations as u32;
        if found.is_closed() {
            return x.solve_levels(t, &self.q, None);
        }
        let reason = format!(
            "no closed position was found for its coordinates in {} iterations of Newton's method (open by {:.1e} \
             of its round-off); renew the chart earlier (a larger renew, at most 1), or take shorter steps",
            self.iterations, found.closure_error.worst
        );
        Err(self.bent(t, reason))
    }

    /// Newton's method from Δ.
    fn close<S: ConstrainedSystem>(&mut self, x: &mut Frozen<S>, t: f64) -> Result<Closed> {
        let (mut delta, mut memory) = (std::mem::take(&mut self.delta), std::mem::take(&mut self.memory));
        let mut rows = InChart { chart: self, x, t, length: 0.0, closure_error: ClosureError::default() };
        let found = close(&mut rows, &mut delta, &RULE, &mut memory);
        (self.delta, self.memory) = (delta, memory);
        found
    }

    /// How near the mechanism is to a singular position at the point last evaluated.
    fn nearness<S: ConstrainedSystem>(x: &mut Frozen<S>) -> f64 {
        Continuity::nearness(0.0, x.margin().map_or(f64::INFINITY, |m| m.0))
    }

    /// Rows of S T⁻¹, by which p' follows from v; empty if they are those of S.
    fn turn_covectors<S: ConstrainedSystem>(&mut self, x: &Frozen<S>, delta: &[f64]) {
        self.covectors.copy_from_slice(x.orthonormal());
        for row in self.covectors.chunks_exact_mut(delta.len()) {
            for b in &self.balls {
                // (T⁻¹)ᵀ turns the other way
                let s = turn_rate(b.map(|i| -delta[i]), b.map(|i| row[i]));
                (0..3).for_each(|i| row[b[i]] = s[i]);
            }
        }
    }

    fn largest_turn(&self, delta: &[f64]) -> f64 {
        let square = |b: &[usize; 3]| b.iter().map(|&i| delta[i] * delta[i]).sum::<f64>();
        self.balls.iter().fold(0.0, |m: f64, b| larger(m, square(b))).sqrt()
    }
}

/// The equations of a chart, `S Δ = p` and `Φ = 0`, for Δ.
struct InChart<'a, 'f, 's, S: ConstrainedSystem> {
    chart: &'a mut Chart,
    x: &'f mut Frozen<'s, S>,
    t: f64,
    length: f64,
    closure_error: ClosureError,
}

impl<S: ConstrainedSystem> InChart<'_, '_, '_, S> {
    fn large(&self, x: &[f64]) -> f64 {
        x.iter().zip(&self.chart.displacement).fold(0.0, |m: f64, (x, r)| larger(m, x.abs() / r))
    }
}

impl<S: ConstrainedSystem> Residuals for InChart<'_, '_, '_, S> {
    fn evaluate(&mut self, delta: &[f64]) -> Result<()> {
        let far = 1.0 + self.large(delta);
        let (c, n) = (&mut *self.chart, delta.len());
        let turned = c.largest_turn(delta);
        if turned > TOO_FAR_TURN {
            return Err(c.bent(
                self.t,
                format!(
                "a ball joint has rotated by {turned:.2} rad since its chart was made; allow renewal (renew > 0), or \
                 take shorter steps"
            ),
            ));
        }
        c.q.copy_from_slice(&c.base);
        let r = self.x.reduction();
        r.system.step(&mut c.q, delta);
        r.position(self.t, &c.q)?;
        for (j, (miss, w)) in c.miss.iter_mut().zip(&c.w).enumerate() {
            *miss = w - dense::dot(&self.x.orthonormal()[j * n..(j + 1) * n], delta);
        }
        // round-off of S Δ, as for the rows
        let size = |row: &[f64]| row.iter().zip(&c.displacement).map(|(s, r)| (s * r).abs()).sum::<f64>();
        let missed = c.miss.iter().zip(self.x.orthonormal().chunks_exact(n.max(1)));
        let missed = missed.map(|(miss, row)| miss / (tolerance::ROUNDING * far * size(row)));
        self.closure_error = ClosureError::of(self.x.seen().closure_error_of_rows().chain(missed));
        Ok(())
    }
    fn closure_error(&self, _part: usize) -> ClosureError {
        self.closure_error
    }
}

impl<S: ConstrainedSystem> Linearization for InChart<'_, '_, '_, S> {
    fn solve(&mut self, delta: &[f64], _parts: &[Part]) -> Result<bool> {
        let c = &mut *self.chart;
        c.turn_covectors(self.x, delta);
        let covectors = (!c.balls.is_empty()).then_some(&c.covectors[..]);
        self.x.solve_levels(self.t, &c.q, covectors)?;
        self.x.solve(covectors, &mut c.miss, &mut c.rhs);
        self.length = self.large(&self.chart.rhs);
        // Δ' = T⁻¹ v
        turned_back(&self.chart.balls, delta, &mut self.chart.rhs);
        Ok(true)
    }
    fn length(&self, _part: usize) -> f64 {
        self.length
    }
    fn scale(&mut self, _part: usize, by: f64) {
        self.chart.rhs.iter_mut().for_each(|x| *x *= by);
    }
    fn advance(&mut self, delta: &mut [f64]) {
        dense::axpy(1.0, &self.chart.rhs, delta);
    }
}

impl<'s, S: ConstrainedSystem> Positions<'s, S, Frozen<'s, S>> for Chart {
    const CLOSED: bool = true;
    fn width(&self) -> usize {
        self.w.len()
    }
    fn start(&mut self, x: &mut Frozen<'s, S>, t: f64, q: &[f64], y: &mut [f64]) {
        self.base.copy_from_slice(q);
        self.accepted.fill(0.0);
        y[..self.w.len()].fill(0.0);
        x.full_acceleration(&mut self.vdot);
        let near = Self::nearness(x);
        self.continuity.start(t, &x.seen().at.v, &self.vdot, near);
    }
    fn locate(&mut self, x: &mut Frozen<'s, S>, t: f64, y: &[f64], _crossing: bool) -> Result<bool> {
        let found = self.find(x, t, &y[..self.w.len()], Prediction::Ahead);
        self.sum += u64::from(self.iterations);
        found.map(|()| true)
    }
    fn q(&self) -> &[f64] {
        &self.q
    }
    fn rates(&mut self, x: &mut Frozen<'s, S>, u: &[f64], dy: &mut [f64]) {
        let k = u.len();
        if self.balls.is_empty() {
            dy[..k].copy_from_slice(u); // S v = u + S γ, and S γ = 0
        } else {
            self.rhs.copy_from_slice(&x.seen().at.v);
            turned_back(&self.balls, &self.delta, &mut self.rhs);
            x.select(&self.rhs, &mut dy[..k]);
        }
    }
    fn output(&mut self, x: &mut Frozen<'s, S>, t: f64, y: &[f64]) -> Result<bool> {
        self.find(x, t, &y[..self.w.len()], Prediction::Inside).map(|()| true)
    }
    fn rewrite(&mut self, x: &mut Frozen<'s, S>, q: &[f64], y: &mut [f64]) {
        self.base.copy_from_slice(q);
        x.seen().system.normalise(&mut self.base);
        self.q.copy_from_slice(&self.base);
        self.accepted.fill(0.0);
        self.delta.fill(0.0);
        y[..self.w.len()].fill(0.0);
    }
}

impl<'s, S: ConstrainedSystem> PositionSteps<'s, S, Frozen<'s, S>> for Chart {
    fn settle(&mut self, _x: &mut Frozen<'s, S>, _t: f64, _y: &mut [f64]) -> Result<bool> {
        Ok(false) // closed at every evaluation
    }
    fn judge(&mut self, x: &mut Frozen<'s, S>, t: f64, margin: Option<f64>) -> StepDecision {
        x.full_acceleration(&mut self.vdot);
        let near = Continuity::nearness(0.0, margin.unwrap_or(f64::INFINITY));
        let r = x.seen();
        if !self.continuity.judge(t, &r.at.v, &self.vdot, r.scales(), near) {
            return StepDecision::Repeat;
        }
        self.trial.copy_from_slice(&self.delta);
        self.wants = if self.renew.never() {
            None
        } else if self.largest_turn(&self.delta) > FAR_TURN {
            Some("a ball joint had rotated far from the base point of the chart")
        } else if self.iterations >= MANY {
            Some("Newton's method needed many iterations")
        } else {
            None
        };
        StepDecision::Keep
    }
    fn wants_change(&self) -> Option<&'static str> {
        self.wants
    }
    fn accept(&mut self, _x: &mut Frozen<'s, S>, _t: f64, _margin: Option<f64>) {
        self.accepted.copy_from_slice(&self.trial);
        self.continuity.accept();
    }
    fn failure(&mut self, _x: &mut Frozen<'s, S>, t: f64) -> Option<SystemError> {
        let reason = "next to a singular position velocities jump to another branch after every step";
        self.continuity.gave_up().then(|| self.bent(t, format!("{reason}; use \"projective\"")))
    }
    fn report(&self, history: &mut History) {
        history.counters.newton_iterations = self.sum;
    }
    /// The base gives the turns away, so that the coordinates found from it stay small; y does not change.
    fn wrap(&mut self, x: &Frozen<'s, S>, _y: &mut [f64], turns: &mut [i32]) -> bool {
        let mut q = self.base.clone();
        x.seen().system.step(&mut q, &self.accepted);
        for (i, q) in q.into_iter().enumerate() {
            let mut angle = q;
            if turns::reduce_one(&*x.seen().system, i, &mut angle, &mut turns[i]) {
                self.base[i] += angle - q;
            }
        }
        false
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

/// Velocities that form a ball joint: three that change the same quaternion.
fn balls<S: ConstrainedSystem>(system: &S) -> Result<Vec<[usize; 3]>> {
    let n = system.size().nv;
    let mut found: Vec<(usize, Vec<usize>)> = Vec::new();
    for i in 0..n {
        let range = system.structure().coordinates_of(i);
        match (range.len(), found.iter_mut().find(|f| f.0 == range.start)) {
            (1, _) => {}
            (_, Some(f)) => f.1.push(i),
            (_, None) => found.push((range.start, vec![i])),
        }
    }
    found
        .into_iter()
        .map(|(start, velocities)| match <[usize; 3]>::try_from(velocities) {
            Ok(b) if system.structure().velocities[b[0]].coordinates.len() == 4 => Ok(b),
            _ => Err(SystemError::argument(
                "formulation",
                format!(
                    "tangent-space supports coordinates that are integrals of velocities, and unit quaternions; \
                 coordinate {start} is neither; use \"projective\""
                ),
            )),
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
    let angle = square.sqrt();
    let half = 0.5 * angle;
    // by its series where the quotient would lose digits: the next term is θ⁶/1209600
    let c = if angle < tolerance::SERIES_ANGLE {
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
