//! Closing positions: one damped Newton or Gauss-Newton loop for all rows and all linear steps.
//!
//! ```text
//! C(q) dq = -Φ(q)   in the sense of the linear step,   q ← q ⊕ f dq,   f ≤ 1
//! ```
//!
//! A step is accepted if it lowers |Φ|²; otherwise the next one has more damping, or is shorter where the linear step
//! has no damping. Rows form parts that share no row and no velocity: each has its own damping, accepts or refuses its
//! own steps and ends by itself, so that a thousand loops side by side take as many iterations as the slowest of them.

use crate::error::Result;
use crate::system::SystemError;
use partita_math::tolerance;

/// A step with a smaller gain is refused. Scale: fraction of the gain that its linear rows promise. Reason: the usual
/// bound of sufficient decrease.
const LEAST_GAIN: f64 = 1e-4;
/// Steps that gain less or more than this are damped more or less by the factors of [`DAMPING_FACTORS`]. Scale: fraction
/// of the promised gain. Reason: the usual rule of trust regions.
const POOR_AND_GOOD: (f64, f64) = (0.25, 0.75);
/// Factors of the damping after a step with a poor and with a good gain. Unit: factors. Reason: the usual rule of trust
/// regions.
const DAMPING_FACTORS: (f64, f64) = (3.0, 0.2);
/// After a refused step the damping grows by the first factor, or the length falls by the second. Unit: factors.
/// Reason: the usual rule of trust regions.
const REFUSED_STEP: (f64, f64) = (4.0, 0.5);
/// Damping of the first step. Unit: squares of singular values in natural scales. Reason: rows weaker than a tenth have
/// no effect at first.
const FIRST_DAMPING: f64 = 1e-2;
/// A larger damping has no effect. Scale: squares of singular values in natural scales. Reason: displacements are below
/// round-off then.
const LARGEST_DAMPING: f64 = 1e10;
/// A step cut below this that still does not gain ends the loop. Scale: fraction of the linear step. Reason: ten
/// halvings; a descent direction gains earlier.
const SHORTEST_CUT: f64 = 1e-3;
/// At a minimum: |Cᵀ Φ| below this. Scale: fraction of |Φ|. Reason: a mechanism that closes at a singular position
/// comes to √Φ, 1e-6 at the tolerance 1e-12.
const AT_REST: f64 = 1e-7;
/// At a minimum where [`PATIENCE`] iterations have gained nothing: |Cᵀ Φ| below this. Scale: fraction of |Φ|. Reason:
/// slow progress and a small slope together.
const NEARLY_AT_REST: f64 = 1e-3;
/// An iteration that lowers |Φ|² by less gains nothing. Scale: fraction of |Φ|². Reason: a hundred such iterations
/// would be needed for one digit.
const SLOW_GAIN: f64 = 1e-2;
/// This many iterations in a row that gain nothing end the loop.
const PATIENCE: usize = 20;
/// Steps at a minimum with open rows are converging when they shorten by this factor. Scale: ratio of successive steps.
/// Reason: only linear convergence is possible there.
const SHORTER: f64 = 0.7;

/// Residuals of rows, in the scale of their linearization.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ClosureError {
    /// Σ Φ_i².
    pub square: f64,
    /// Largest |Φ_i|.
    pub worst: f64,
}

impl ClosureError {
    /// Of these residuals; NaN counts as infinite.
    #[inline]
    pub fn of(phi: impl Iterator<Item = f64>) -> Self {
        let mut closure_error = Self::default();
        for x in phi {
            closure_error.square += x * x;
            closure_error.worst = closure_error.worst.max(x.abs());
        }
        match closure_error.square.is_nan() {
            true => Self { square: f64::INFINITY, worst: f64::INFINITY },
            false => closure_error,
        }
    }
}

/// The rows to be closed. Independent sets of rows may be parts; by default there is one.
pub trait Residuals {
    /// Rows and their derivatives at q.
    ///
    /// # Errors
    /// `NotFinite` where one of them is: a step that leads there is refused. Other errors end the loop.
    fn evaluate(&mut self, q: &[f64]) -> Result<()>;
    /// Residuals of the rows of a part where last evaluated; 0 for parts that are to be left unchanged.
    fn closure_error(&self, part: usize) -> ClosureError;
    /// |Cᵀ Φ|² of a part where last evaluated, if rows that stay open are to be found by it.
    fn slope(&self, _part: usize) -> Option<f64> {
        None
    }
    /// Number of parts.
    fn parts(&self) -> usize {
        1
    }
    /// Copies the coordinates of a part from one position to another.
    fn keep(&self, _part: usize, from: &[f64], to: &mut [f64]) {
        to.copy_from_slice(from);
    }
}

/// The linear step that closes [`Residuals`], where they were last evaluated.
///
/// The loop calls [`evaluate`](Residuals::evaluate), then [`solve`](Self::solve), [`length`](Self::length),
/// [`scale`](Self::scale) and [`advance`](Self::advance). Positions are of any type that `advance` can move.
pub trait Linearization: Residuals {
    /// The linear step at q, for the parts in progress. False: next to a singular position no step reduces the
    /// residual, which is round-off.
    ///
    /// # Errors
    /// Where there is no linear step.
    fn solve(&mut self, q: &[f64], parts: &[Part]) -> Result<bool>;
    /// The largest displacement in the step of a part: in characteristic displacements where they are known.
    fn length(&self, part: usize) -> f64;
    /// Shorten the step of a part.
    fn scale(&mut self, part: usize, by: f64);
    /// q displaced by the step.
    fn advance(&mut self, q: &mut [f64]);
    /// The step of a part was accepted.
    fn take(&mut self, _part: usize) {}
    /// Σ Φ² that the linear rows predict after the step of a part, shortened to `fraction`.
    fn left(&self, part: usize, fraction: f64) -> f64 {
        (1.0 - fraction) * (1.0 - fraction) * self.closure_error(part).square
    }
    /// The smallest damping of this part that has an effect, if `solve` damps its steps.
    fn least_damping(&self, _part: usize) -> Option<f64> {
        None
    }
    /// Whether the linear step was found by its final rule. While a rule is graded, steps that gain nothing end
    /// nothing.
    fn is_settled(&self) -> bool {
        true
    }
}

/// Criteria of closed rows, and limits of steps.
#[derive(Clone, Copy, Debug)]
pub struct Rule {
    /// Maximum number of iterations.
    pub iterations: usize,
    /// Rows with at most this residual are closed.
    pub closed: f64,
    /// Rows that no step closes any further count as closed up to this residual.
    pub accepted: f64,
    /// Longer steps are shortened to this.
    pub longest: f64,
    /// The first step is no longer than this, ...
    pub first: f64,
    /// ... and each next one no longer than this fraction of the previous: otherwise they lead to another solution, or
    /// to none.
    pub shrink: f64,
    /// Where rows cannot be closed: a step no longer than this is the last, ...
    pub rest: f64,
    /// ... and one no longer than this that is at least half as long as the previous.
    pub rounding: f64,
    /// Steps are accepted whether or not they lower |Φ|²; this many that are shortened do not count as iterations.
    pub undamped: Option<usize>,
}

impl Rule {
    /// Close rows to `closed`, or to `accepted` as far as rounding allows, by unlimited steps.
    pub const fn new(iterations: usize, closed: f64, accepted: f64) -> Self {
        Self {
            iterations,
            closed,
            accepted,
            longest: f64::INFINITY,
            first: f64::INFINITY,
            shrink: f64::INFINITY,
            rest: 0.0,
            rounding: 0.0,
            undamped: None,
        }
    }

    /// Steps are cut to this length.
    pub const fn cut(self, longest: f64) -> Self {
        Self { longest, ..self }
    }

    /// The first step is no longer than `first`, each next one no longer than the fraction `shrink` of the previous.
    pub const fn contracting(self, first: f64, shrink: f64) -> Self {
        Self { first, shrink, ..self }
    }

    /// Rows may remain open: steps that become as short as this have found the minimum of |Φ|².
    pub const fn to_rest(self, rest: f64) -> Self {
        Self { rest, ..self }
    }

    /// Every step is accepted: for linear steps that ignore weak rows, the residuals of these mean nothing. They end
    /// where steps below `rounding` no longer shorten; up to `far` shortened ones are added to the iterations.
    pub const fn undamped(self, rounding: f64, far: usize) -> Self {
        Self { rounding, undamped: Some(far), ..self }
    }
}

/// How a part ended, from best to worst.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Ending {
    /// Closed, or left unchanged.
    Closed,
    /// At a minimum of |Φ|² with rows open.
    AtRest,
    /// Out of iterations, or no step gains.
    Unfinished,
    /// Steps do not contract: they lead to another solution, or to none.
    Elsewhere,
}

/// One part in progress.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    /// Residual of its rows.
    pub closure_error: ClosureError,
    /// Its damping; see [`Linearization::least_damping`].
    pub damping: f64,
    /// How it ended; none while it is in progress.
    pub ending: Option<Ending>,
    /// Sum of the lengths of all its steps.
    pub moved: f64,
    /// The fraction of a linear step that is taken, for steps without damping.
    fraction: f64,
    /// Length of the previous linear step.
    before: f64,
    /// Length of the linear step, and of the part that is taken.
    length: f64,
    taken: f64,
    promised: f64,
    idle: usize,
    /// Steps that were shortened to the longest.
    far: usize,
}

impl Part {
    /// Whether it is neither closed nor abandoned.
    pub fn is_active(&self) -> bool {
        self.ending.is_none()
    }

    /// No step closes it any further.
    fn stall(&mut self, rule: &Rule, otherwise: Ending) {
        self.ending = Some(if self.closure_error.worst <= rule.accepted { Ending::Closed } else { otherwise });
    }
}

/// Memory of the loop, reused: after the first use nothing is allocated.
#[derive(Clone, Debug, Default)]
pub struct ClosingScratch {
    /// The position before the current step.
    best: Vec<f64>,
    /// The parts as the last loop left them.
    pub parts: Vec<Part>,
}

/// Result of a loop.
#[derive(Clone, Copy, Debug)]
pub struct Closed {
    /// The worst ending of a part.
    pub ending: Ending,
    /// Number of linear steps.
    pub iterations: usize,
    /// The residual where the loop ended.
    pub closure_error: ClosureError,
    /// Sum of the lengths of all steps, of the part that moved most.
    pub moved: f64,
}

impl Closed {
    /// Whether all parts are closed.
    pub fn is_closed(&self) -> bool {
        self.ending == Ending::Closed
    }
}

impl ClosingScratch {
    /// With memory for q of this length.
    pub fn for_coordinates(nq: usize) -> Self {
        Self { best: Vec::with_capacity(nq), parts: Vec::with_capacity(1) }
    }

    fn begin<L: Linearization + ?Sized>(&mut self, l: &L, q: &[f64], rule: &Rule) {
        self.best.resize(q.len(), 0.0);
        self.parts.clear();
        self.parts.extend((0..l.parts()).map(|i| Part {
            closure_error: l.closure_error(i),
            damping: FIRST_DAMPING,
            ending: None,
            moved: 0.0,
            fraction: 1.0,
            before: if rule.shrink.is_finite() { rule.first / rule.shrink } else { f64::INFINITY },
            length: 0.0,
            taken: 0.0,
            promised: 0.0,
            idle: 0,
            far: 0,
        }));
    }

    fn is_active(&self) -> bool {
        self.parts.iter().any(Part::is_active)
    }

    /// Parts that are closed, or at a minimum, where last evaluated.
    fn look<L: Linearization + ?Sized>(&mut self, l: &L, rule: &Rule) {
        for (i, p) in self.parts.iter_mut().enumerate().filter(|(_, p)| p.is_active()) {
            if p.closure_error.worst <= rule.closed {
                p.ending = Some(Ending::Closed);
                continue;
            }
            if !p.closure_error.square.is_finite() {
                p.ending = Some(Ending::Unfinished);
                continue;
            }
            let idle = p.idle >= PATIENCE;
            let slope = l.slope(i).map(|slope| (slope / p.closure_error.square).sqrt());
            if slope.is_some_and(|x| x <= AT_REST || idle && x <= NEARLY_AT_REST) {
                p.stall(rule, Ending::AtRest);
            } else if idle || p.damping > LARGEST_DAMPING || p.fraction < SHORTEST_CUT {
                p.stall(rule, Ending::Unfinished);
            }
        }
    }

    /// Limit the steps that were found, and store their predictions.
    fn limit<L: Linearization + ?Sized>(&mut self, l: &mut L, rule: &Rule) {
        for (i, p) in self.parts.iter_mut().enumerate().filter(|(_, p)| p.is_active()) {
            p.length = l.length(i);
            if !p.length.is_finite() || p.length > (rule.shrink * p.before).max(tolerance::LAST_MOVE) {
                p.stall(rule, Ending::Elsewhere);
                l.scale(i, 0.0);
                continue;
            }
            let mut fraction = p.fraction;
            if fraction * p.length > rule.longest {
                fraction = rule.longest / p.length;
                p.far += 1;
            }
            if fraction < 1.0 {
                l.scale(i, fraction);
            }
            p.promised = p.closure_error.square - l.left(i, fraction);
            p.taken = fraction * p.length;
        }
    }

    /// Accept the steps to where last evaluated, or refuse them; true if one was refused.
    fn judge<L: Linearization + ?Sized>(&mut self, l: &mut L, q: &mut [f64], rule: &Rule, finite: bool) -> bool {
        let mut refused = false;
        for (i, p) in self.parts.iter_mut().enumerate().filter(|(_, p)| p.is_active()) {
            let now = l.closure_error(i);
            let gain =
                if finite && now.square.is_finite() { p.closure_error.square - now.square } else { f64::NEG_INFINITY };
            let stationary = rule.rest > 0.0 && gain.abs() <= tolerance::LONG_ROUNDING * p.closure_error.square;
            let shorter = p.length <= SHORTER * p.before;
            let takes = rule.undamped.is_some() && gain.is_finite();
            if gain > LEAST_GAIN * p.promised && gain > 0.0 || stationary && shorter || takes {
                l.take(i);
                let (more, less) = DAMPING_FACTORS;
                p.damping *= match gain {
                    _ if stationary || takes => 1.0,
                    x if x > POOR_AND_GOOD.1 * p.promised => less,
                    x if x < POOR_AND_GOOD.0 * p.promised => more,
                    _ => 1.0,
                };
                // where rows cannot be closed the step length indicates the minimum
                p.idle = if rule.rest > 0.0 || gain > SLOW_GAIN * p.closure_error.square { 0 } else { p.idle + 1 };
                let stalls = now.worst > tolerance::CONVERGES * p.closure_error.worst && now.worst <= rule.accepted;
                let rounding = p.length <= rule.rounding && p.length >= tolerance::CONVERGES * p.before;
                let last = (p.length <= rule.rest || rounding) && p.fraction == 1.0;
                // step lengths under different damping are not comparable
                (p.closure_error, p.before) = (now, if l.is_settled() { p.length } else { f64::INFINITY });
                p.fraction = (p.fraction / REFUSED_STEP.1).min(1.0);
                p.moved += p.taken;
                if (stalls || last) && l.is_settled() {
                    p.stall(rule, Ending::AtRest);
                }
                continue;
            }
            refused = true;
            l.keep(i, &self.best, q);
            p.idle += 1;
            let least = l.least_damping(i);
            if l.is_settled()
                && (p.closure_error.worst <= rule.accepted || p.length <= rule.rest || stationary && least.is_none())
            {
                p.stall(rule, Ending::AtRest);
                continue;
            }
            match least {
                _ if stationary && !l.is_settled() => {}
                Some(least) => p.damping = (REFUSED_STEP.0 * p.damping).max(least),
                None => p.fraction *= REFUSED_STEP.1,
            }
        }
        refused
    }

    fn report(&self, iterations: usize) -> Closed {
        let mut closed =
            Closed { ending: Ending::Closed, iterations, closure_error: ClosureError::default(), moved: 0.0 };
        for p in &self.parts {
            closed.ending = closed.ending.max(p.ending.unwrap_or(Ending::Unfinished));
            closed.closure_error.square += p.closure_error.square;
            closed.closure_error.worst = closed.closure_error.worst.max(p.closure_error.worst);
            closed.moved = closed.moved.max(p.moved);
        }
        closed
    }
}

/// Close rows from q on; q ends at the best position found, the rows evaluated there.
///
/// Near a regular solution the steps are Newton's and the digits double with each; far from it they are damped. `memory`
/// holds the result of each part.
///
/// # Errors
/// The errors of `l`: where nothing can be evaluated at q itself, and where there is no linear step.
pub fn close<L: Linearization + ?Sized>(
    l: &mut L,
    q: &mut [f64],
    rule: &Rule,
    memory: &mut ClosingScratch,
) -> Result<Closed> {
    l.evaluate(q)?;
    memory.begin(l, q, rule);
    let mut iterations = 0;
    loop {
        memory.look(l, rule);
        if !memory.is_active() {
            break;
        }
        let far = memory.parts.iter().map(|p| p.far).max().unwrap_or(0).min(rule.undamped.unwrap_or(0));
        let gains = iterations < rule.iterations + far && l.solve(q, &memory.parts)?;
        if !gains {
            memory.parts.iter_mut().filter(|p| p.is_active()).for_each(|p| p.stall(rule, Ending::Unfinished));
            break;
        }
        iterations += 1;
        memory.limit(l, rule);
        if !memory.is_active() {
            break;
        }
        memory.best.copy_from_slice(q);
        l.advance(q);
        let finite = match l.evaluate(q) {
            Ok(()) => true,
            Err(SystemError::NotFinite { .. }) => false,
            Err(e) => {
                q.copy_from_slice(&memory.best);
                return Err(e);
            }
        };
        if memory.judge(l, q, rule, finite) {
            l.evaluate(q)?;
        }
    }
    Ok(memory.report(iterations))
}
