//! Gauss collocation: one long step that evaluates nowhere near a singular position.
//!
//! The motion through a singular position is smooth, but next to it the equations are quotients of small numbers. Gauss
//! collocation has no node at its ends, its polynomial goes through both, and every stage lies on the motion to the order
//! of the whole step, not to that of the stage:
//!
//! ```text
//! y(t₀ + c_i h) = y₀ + h Σ a_ij y'_j,   y'_i = f(t₀ + c_i h, y_i)
//! ```
//!
//! A step across a singular position ([`CrossingStep`]) is solved by sweeps over an increasing number of nodes: each sweep
//! gains an order, and the difference of two rules is the error. Where the branches form a cone its curvature grows as one
//! over the distance, and sweeps need not converge, however short the step: then, and for the step out of a singular
//! position ([`singular_start`](crate::singular_start)), the iteration uses Anderson's extrapolation.

use crate::counters::Counters;
use crate::failure::StepFailure;
use crate::ode::{Ode, RhsError};
use crate::options::Options;
use crate::step_size::ErrorNorm;
use crate::stepper::{Conclusion, CurrentStep, StepControl, StepEnd, StepPlan, Stepper};
use partita_math::dense::Matrix;
use partita_math::factor::least_squares_min_norm;
use partita_math::tolerance;
use std::fmt::Display;
use std::sync::LazyLock;

/// The extrapolated iteration has converged below this. Scale: fraction of the requested agreement. Reason: the iteration
/// adds no visible error.
const SETTLED: f64 = 1e-3;
/// Largest number of iterations, and the number of them used by the extrapolation.
const ITERATIONS: usize = 60;
const REMEMBERED: usize = 12;
/// Where two polynomials are compared. Unit: fraction of the step. Reason: inside it outputs lie, at its end the next step
/// begins.
pub(crate) const COMPARED: [f64; 5] = [0.1, 0.37, 0.63, 0.9, 1.0];

/// Rules of ever more nodes. Their numbers are even: the middle of a step, where the position is aimed at, is no node.
pub(crate) static RULES: LazyLock<[Nodes; 7]> = LazyLock::new(|| [4, 6, 8, 10, 12, 14, 16].map(Nodes::new));
/// Places of the two rules whose difference is the error of a step out of a singular position.
pub(crate) const LESS: usize = 2;
pub(crate) const MORE: usize = 3;
/// Sweeps that stop converging below this are limited by rounding. Scale: fraction of the largest change. Reason: four
/// digits were gained; sweeps that do not converge gain none.
const SWEEPS_AT_REST: f64 = 1e-4;
/// Number of rules whose nodes must be clear of the position; more are rarely needed.
const USUAL: usize = 5;
/// Sweeps that reduce the error by less do not converge, or have reached rounding. Scale: ratio of two errors. Reason:
/// sweeps that converge gain a digit or two each.
const GAINS: f64 = 0.5;

/// Gauss nodes on 0..1 with the coefficients of collocation.
#[derive(Clone, Debug)]
pub(crate) struct Nodes {
    pub(crate) c: Vec<f64>,
    /// Barycentric weights.
    w: Vec<f64>,
    /// Weights of the quadrature.
    b: Vec<f64>,
    /// The row of each node.
    a: Vec<Vec<f64>>,
}

impl Nodes {
    fn new(s: usize) -> Self {
        // roots of the Legendre polynomial by Newton's method, its weights by its slope
        let legendre = |x: f64| {
            let (mut before, mut p) = (1.0, x);
            for n in 1..s {
                let m = n as f64;
                (before, p) = (p, ((2.0 * m + 1.0) * x * p - m * before) / (m + 1.0));
            }
            (p, s as f64 * (x * p - before) / (x * x - 1.0))
        };
        let (mut c, mut b) = (Vec::new(), Vec::new());
        for i in 0..s {
            let mut x = -(std::f64::consts::PI * (i as f64 + 0.75) / (s as f64 + 0.5)).cos();
            for _ in 0..20 {
                let (p, slope) = legendre(x);
                x -= p / slope;
            }
            let slope = legendre(x).1;
            c.push(0.5 * (1.0 + x));
            b.push(1.0 / ((1.0 - x * x) * slope * slope));
        }
        let w =
            (0..s).map(|i| 1.0 / (0..s).filter(|&j| j != i).map(|j| 4.0 * (c[i] - c[j])).product::<f64>()).collect();
        let mut nodes = Self { c, w, b, a: Vec::new() };
        nodes.a = (0..s).map(|i| nodes.integrals(nodes.c[i])).collect();
        nodes
    }

    pub(crate) fn count(&self) -> usize {
        self.c.len()
    }

    /// Lagrange polynomials of the nodes at x.
    pub(crate) fn values(&self, x: f64) -> Vec<f64> {
        if let Some(i) = self.c.iter().position(|c| *c == x) {
            return (0..self.count()).map(|j| if j == i { 1.0 } else { 0.0 }).collect();
        }
        let parts: Vec<f64> = self.c.iter().zip(&self.w).map(|(c, w)| w / (x - c)).collect();
        let sum: f64 = parts.iter().sum();
        parts.iter().map(|p| p / sum).collect()
    }

    /// Their integrals from 0 to x, exact by the quadrature of the nodes.
    fn integrals(&self, x: f64) -> Vec<f64> {
        let mut sum = vec![0.0; self.count()];
        for (c, b) in self.c.iter().zip(&self.b) {
            sum.iter_mut().zip(self.values(x * c)).for_each(|(s, l)| *s += x * b * l);
        }
        sum
    }
}

/// Last differences of an iteration, to extrapolate from.
#[derive(Default)]
struct Anderson {
    last: Option<(Vec<f64>, Vec<f64>)>,
    steps: Vec<(Vec<f64>, Vec<f64>)>,
}

impl Anderson {
    /// The next iterate after `x`, from which the iteration leads to `x + f`.
    fn next(&mut self, x: &[f64], f: &[f64]) -> Vec<f64> {
        let minus = |a: &[f64], b: &[f64]| -> Vec<f64> { a.iter().zip(b).map(|(a, b)| a - b).collect() };
        if let Some((x0, f0)) = &self.last {
            self.steps.push((minus(x, x0), minus(f, f0)));
            if self.steps.len() > REMEMBERED {
                self.steps.remove(0);
            }
        }
        self.last = Some((x.to_vec(), f.to_vec()));
        let mut next: Vec<f64> = x.iter().zip(f).map(|(x, f)| x + f).collect();
        if self.steps.is_empty() {
            return next;
        }
        let mut slopes = Matrix::new(f.len(), self.steps.len());
        for (j, (_, df)) in self.steps.iter().enumerate() {
            df.iter().enumerate().for_each(|(i, d)| slopes[(i, j)] = *d);
        }
        if let Ok((parts, _)) = least_squares_min_norm(&slopes, f, tolerance::NULL_VALUE) {
            for (part, (dx, df)) in parts.iter().zip(&self.steps) {
                next.iter_mut().zip(dx.iter().zip(df)).for_each(|(n, (x, f))| *n -= part * (x + f));
            }
        }
        next
    }
}

/// A step of length h from (t, y), and the tolerance of each component of y over it; infinite where none is asked for.
#[derive(Clone, Copy)]
pub(crate) struct Task<'a> {
    pub(crate) t: f64,
    pub(crate) y: &'a [f64],
    pub(crate) h: f64,
    pub(crate) tolerances: &'a [f64],
    /// What each may be off by where rounding allows no better.
    pub(crate) allowed: &'a [f64],
}

/// Rates at the nodes of a step, and with them the polynomial through its start.
#[derive(Clone, Debug)]
pub(crate) struct Stages {
    nodes: &'static Nodes,
    h: f64,
    /// Node by node.
    rates: Vec<f64>,
}

impl Stages {
    /// What the polynomial adds to its start y up to the part x of the step, onto `y`.
    pub(crate) fn advance(&self, x: f64, y: &mut [f64]) {
        for (weight, rates) in self.nodes.integrals(x).into_iter().zip(self.rates.chunks_exact(y.len().max(1))) {
            y.iter_mut().zip(rates).for_each(|(y, d)| *y += self.h * weight * d);
        }
    }

    /// Lagrange polynomials of its nodes at the part x of the step.
    pub(crate) fn values(&self, x: f64) -> Vec<f64> {
        self.nodes.values(x)
    }

    /// The largest difference of two polynomials over the step, in tolerances.
    pub(crate) fn differ(&self, other: &Self, tolerances: &[f64]) -> f64 {
        let width = tolerances.len();
        COMPARED.into_iter().fold(0.0, |worst: f64, x| {
            let [mut one, mut two] = [vec![0.0; width], vec![0.0; width]];
            self.advance(x, &mut one);
            other.advance(x, &mut two);
            one.iter().zip(&two).zip(tolerances).fold(worst, |worst, ((a, b), tolerance)| {
                let off = (a - b).abs() / tolerance;
                if off <= worst {
                    worst
                } else {
                    off
                }
            })
        })
    }

    /// Rates at the nodes of another rule, as a first guess there.
    fn at(&self, nodes: &Nodes, width: usize) -> Vec<f64> {
        let mut rates = vec![0.0; nodes.count() * width];
        for (c, to) in nodes.c.iter().zip(rates.chunks_exact_mut(width.max(1))) {
            for (weight, of) in self.nodes.values(*c).into_iter().zip(self.rates.chunks_exact(width.max(1))) {
                to.iter_mut().zip(of).for_each(|(to, d)| *to += weight * d);
            }
        }
        rates
    }
}

/// Where a solution of the stages begins.
pub(crate) enum Guess<'a> {
    /// With these rates at the start and their change per time.
    Line(&'a [f64], &'a [f64]),
    /// With the polynomial of another rule.
    Like(&'a Stages),
}

/// What rates at the nodes lead to, each with those before it that were just found.
fn sweep<E: Display>(
    ode: &mut dyn Ode<Error = E>,
    task: &Task,
    nodes: &Nodes,
    rates: &[f64],
    found: &mut [f64],
    y: &mut [f64],
    counters: &mut Counters,
) -> Result<(), (f64, RhsError<E>)> {
    let width = y.len();
    for (i, c) in nodes.c.iter().enumerate() {
        y.copy_from_slice(task.y);
        for (j, a) in nodes.a[i].iter().enumerate() {
            let of = if j < i { &found[j * width..(j + 1) * width] } else { &rates[j * width..(j + 1) * width] };
            y.iter_mut().zip(of).for_each(|(y, d)| *y += task.h * a * d);
        }
        let t = task.t + c * task.h;
        counters.evaluations += 1;
        ode.rhs(t, y, &mut found[i * width..(i + 1) * width]).map_err(|e| (t, e))?;
    }
    Ok(())
}

/// The polynomial of other nodes through the rates along that of `stages`: what both differ by is the error of `stages`, to
/// its order.
pub(crate) fn refined<E: Display>(
    ode: &mut dyn Ode<Error = E>,
    task: &Task,
    stages: &Stages,
    nodes: &'static Nodes,
    counters: &mut Counters,
) -> Result<Stages, (f64, RhsError<E>)> {
    let rates = stages.at(nodes, task.y.len());
    let (mut found, mut y) = (rates.clone(), task.y.to_vec());
    sweep(ode, task, nodes, &rates, &mut found, &mut y, counters)?;
    Ok(Stages { nodes, h: task.h, rates: found })
}

/// The stages of a step by these nodes; none where they are not found. `counters` count its evaluations.
///
/// # Errors
/// What the equation says where it cannot be evaluated.
pub(crate) fn solve<E: Display>(
    ode: &mut dyn Ode<Error = E>,
    task: &Task,
    nodes: &'static Nodes,
    guess: Guess,
    counters: &mut Counters,
) -> Result<Option<Stages>, (f64, RhsError<E>)> {
    let width = task.y.len();
    let mut rates = match guess {
        Guess::Like(stages) => stages.at(nodes, width),
        Guess::Line(slope, change) => {
            let of = |c: &f64| slope.iter().zip(change).map(|(s, d)| s + c * task.h * d).collect::<Vec<_>>();
            nodes.c.iter().flat_map(of).collect()
        }
    };
    let mut anderson = Anderson::default();
    let (mut least, mut since) = (f64::INFINITY, 0);
    let mut found = vec![0.0; rates.len()];
    let mut y = vec![0.0; width];
    // rates in units in which all count alike
    let unit = |e: usize| task.tolerances[e % width] / task.h;
    for _ in 0..ITERATIONS {
        sweep(ode, task, nodes, &rates, &mut found, &mut y, counters)?;
        let off: Vec<f64> = found.iter().zip(&rates).enumerate().map(|(e, (n, x))| (n - x) / unit(e)).collect();
        // what is off at a node counts by its weight: one next to the position has a small one, and rounding is largest
        // there
        let (mut worst, mut beyond) = (0.0f64, 0.0f64);
        for (off, b) in off.chunks_exact(width.max(1)).zip(&nodes.b) {
            for ((off, tolerance), allowed) in off.iter().zip(task.tolerances).zip(task.allowed) {
                let off = if off.is_nan() { f64::INFINITY } else { b * off.abs() };
                worst = worst.max(off);
                beyond = beyond.max(if allowed.is_finite() { off * tolerance / allowed } else { 0.0 });
            }
        }
        if !worst.is_finite() {
            return Ok(None);
        }
        // at rest, or as still as rounding lets it be; whether that is still enough the other nodes tell
        since = if worst < 0.5 * least { 0 } else { since + 1 };
        least = least.min(worst);
        if worst <= SETTLED || (beyond <= 1.0 && since > 3) {
            return Ok(Some(Stages { nodes, h: task.h, rates: found }));
        }
        if since > 12 {
            return Ok(None);
        }
        let here: Vec<f64> = rates.iter().enumerate().map(|(e, x)| x / unit(e)).collect();
        let next = anderson.next(&here, &off);
        for (e, (to, x)) in rates.iter_mut().zip(next).enumerate() {
            // a component without a tolerance follows by plain iteration
            *to = if unit(e).is_finite() { x * unit(e) } else { found[e] };
        }
    }
    Ok(None)
}

/// Limits of the lengths of steps across one position. Unit: fraction of the length that the motion suggests. Reason:
/// collocation gains two digits or more by each halving, so three serve where one can.
const CROSSING_LENGTHS: [f64; 4] = [1.25, 0.7, 0.4, 0.2];
/// A longer step keeps its nodes clearer by this. Scale: ratio of lengths. Reason: rounding falls by its square.
const LONGER: f64 = 1.3;
/// A crossing step is at least so long. Unit: multiples of the way to the position. Reason: beyond it lies enough of the
/// step to lead on.
const BEYOND: f64 = 1.25;
/// Lengths that are looked at for one whose nodes keep clear of a position.
const LENGTHS_TRIED: usize = 60;
/// A step whose nodes keep less clear of the position than they could is taken anew. Scale: ratio of clearances. Reason:
/// rounding grows by its square, a digit.
const CLEAR: f64 = 0.3;

/// How clear the nodes of a step of length h keep of a position `ahead`, by all rules but the last, which are seldom asked.
fn clearance(h: f64, ahead: f64) -> f64 {
    RULES[..USUAL].iter().flat_map(|nodes| &nodes.c).fold(f64::INFINITY, |m: f64, c| m.min((c * h - ahead).abs()))
}

/// The length between both that keeps clearest of a position `ahead`.
fn clearest(shortest: f64, longest: f64, ahead: f64) -> f64 {
    let tried = (0..=LENGTHS_TRIED).map(|i| shortest + (longest - shortest) * i as f64 / LENGTHS_TRIED as f64);
    tried.fold(longest, |best, h| if clearance(h, ahead) > clearance(best, ahead) { h } else { best })
}

/// Lengths of a step across a position `ahead`, ever shorter ones, each with the position between two other nodes. `whole`
/// is the length that motion and accuracy suggest; none is longer than `rest`.
fn lengths(ahead: f64, whole: f64, rest: f64) -> Vec<f64> {
    let least = BEYOND * ahead;
    let mut lengths = Vec::with_capacity(CROSSING_LENGTHS.len() - 1);
    for pair in CROSSING_LENGTHS.windows(2) {
        let (longest, shortest) = ((pair[0] * whole).max(least), (pair[1] * whole).max(least));
        if longest > shortest || lengths.is_empty() {
            let longest = longest.min(rest);
            lengths.push(clearest(shortest.min(longest), longest, ahead));
        }
    }
    lengths
}

/// Steps across singular positions, behind the contract of a stepper.
#[derive(Debug)]
pub struct CrossingStep {
    t_old: f64,
    t_new: f64,
    t_end: f64,
    y_old: Vec<f64>,
    dy_old: Vec<f64>,
    y_new: Vec<f64>,
    dy_new: Vec<f64>,
    /// What the end was corrected by.
    shift: Vec<f64>,
    length: f64,
    /// The longest that the motion suggests; was the last one tried so short that rounding spoilt it?
    longest: f64,
    rounded: bool,
    /// What is tried, one after the other, until a step is as exact as was asked for.
    lengths: Vec<f64>,
    norm: ErrorNorm,
    tolerances: Vec<f64>,
    allowed: Vec<f64>,
    stages: Option<Stages>,
    counters: Counters,
}

impl CrossingStep {
    /// For an equation of dimension `dim`.
    pub fn new(dim: usize, options: &Options) -> Self {
        let zeros = || vec![0.0; dim];
        Self {
            t_old: 0.0,
            t_new: 0.0,
            t_end: 0.0,
            y_old: zeros(),
            dy_old: zeros(),
            y_new: zeros(),
            dy_new: zeros(),
            shift: zeros(),
            length: 0.0,
            longest: 0.0,
            rounded: false,
            lengths: Vec::new(),
            norm: ErrorNorm::new(options, dim, crate::combination::padded(dim)),
            tolerances: zeros(),
            allowed: zeros(),
            stages: None,
            counters: Counters::default(),
        }
    }

    /// Plan a step from `t_old` across the position at `zero`; `whole` is the length that has served, `longest` the
    /// one that the motion suggests, `tries` how often it was tried before. It ends at `t_end` at the latest.
    pub fn aim(&mut self, zero: f64, (whole, longest): (f64, f64), tries: usize, t_end: f64) {
        let (ahead, rest) = (zero - self.t_old, t_end - self.t_old);
        self.lengths = lengths(ahead, whole, rest);
        self.longest = lengths(ahead, longest, rest)[0];
        let first = tries % self.lengths.len();
        self.lengths.rotate_left(first);
        self.t_end = t_end;
    }

    /// The attempted step crosses the position at `zero`: plan another one if that lies close to a node. True if so.
    pub fn aim_again(&mut self, zero: f64) -> bool {
        let (h, ahead) = (self.t_new - self.t_old, zero - self.t_old);
        let better =
            clearest((0.7 * h).max(BEYOND * ahead), (1.3 * h).max(BEYOND * ahead), ahead).min(self.t_end - self.t_old);
        let poor = clearance(h, ahead) < CLEAR * clearance(better, ahead);
        if poor {
            self.lengths.clear();
            self.lengths.push(better);
            self.counters.rejected += 1;
        }
        poor
    }

    /// The state at `t` in the attempted step, its end not corrected.
    pub fn polynomial(&self, t: f64, out: &mut [f64]) {
        out.copy_from_slice(&self.y_old);
        if let Some(stages) = &self.stages {
            stages.advance((t - self.t_old) / (self.t_new - self.t_old), out);
        }
    }

    /// The step of length h by as many nodes as it takes.
    fn solved<E: Display>(
        &mut self,
        ode: &mut dyn Ode<Error = E>,
        h: f64,
    ) -> Result<Option<Solved>, (f64, RhsError<E>)> {
        for (i, (to, allowed)) in self.tolerances.iter_mut().zip(&mut self.allowed).enumerate() {
            *to = self.norm.tolerance(i, &self.y_old);
            let moved = self.norm.size(i).max(self.y_old[i].abs()).max((h * self.dy_old[i]).abs());
            *allowed = to.max(tolerance::SINGULAR_ROUNDING * moved);
        }
        let task = Task { t: self.t_old, y: &self.y_old, h, tolerances: &self.tolerances, allowed: &self.allowed };
        match by_sweeps(ode, &task, &self.dy_old, &mut self.counters)? {
            Sweeps::Converged(found) => return Ok(Some(found)),
            Sweeps::Slow => return Ok(None),
            Sweeps::Rounded(found) => {
                self.rounded = true;
                return Ok(Some(found));
            }
            Sweeps::Diverging => {}
        }
        let still = vec![0.0; self.y_old.len()];
        let [first, second, third] = [LESS, MORE, MORE + 1].map(|i| &RULES[i]);
        let judged = |stages: Stages, other: &Stages| Solved {
            error: stages.differ(other, task.tolerances),
            beyond: stages.differ(other, task.allowed),
            stages,
        };
        let Some(few) = solve(ode, &task, first, Guess::Line(&self.dy_old, &still), &mut self.counters)? else {
            return Ok(None);
        };
        let more = judged(refined(ode, &task, &few, second, &mut self.counters)?, &few);
        if more.error <= 1.0 {
            return Ok(Some(more));
        }
        let Some(more) = solve(ode, &task, second, Guess::Like(&more.stages), &mut self.counters)? else {
            return Ok(None);
        };
        Ok(Some(judged(refined(ode, &task, &more, third, &mut self.counters)?, &more)))
    }
}

/// The outcome of sweeps over an increasing number of nodes.
enum Sweeps {
    Converged(Solved),
    /// They converge, but no rule would be accurate enough: the step is too long.
    Slow,
    /// They do not converge.
    Diverging,
    /// They are limited by rounding: the step is too short, its nodes are too near the position.
    Rounded(Solved),
}

/// A step by sweeps over an increasing number of nodes, two by each rule, since each gains an order.
fn by_sweeps<E: Display>(
    ode: &mut dyn Ode<Error = E>,
    task: &Task,
    slope: &[f64],
    counters: &mut Counters,
) -> Result<Sweeps, (f64, RhsError<E>)> {
    let first = &RULES[0];
    let mut stages = Stages { nodes: first, h: task.h, rates: slope.repeat(first.count()) };
    let (mut last, mut raised, mut largest, mut poor) = (f64::INFINITY, f64::INFINITY, 0.0f64, 0);
    let stalled = |found: Solved, largest: f64| match found.error < SWEEPS_AT_REST * largest {
        true => Sweeps::Rounded(found),
        false => Sweeps::Diverging,
    };
    for (place, nodes) in RULES.iter().enumerate().flat_map(|(i, nodes)| [(i, nodes), (i, nodes)]) {
        let found = match refined(ode, task, &stages, nodes, counters) {
            Ok(found) => found,
            // a node so near the position that nothing can be evaluated there: others lie elsewhere
            Err((_, RhsError::Retry(_))) => continue,
            Err(fatal) => return Err(fatal),
        };
        let more = nodes.count() > stages.nodes.count();
        let (error, beyond) = (found.differ(&stages, task.tolerances), found.differ(&stages, task.allowed));
        stages = found;
        if !error.is_finite() {
            return Ok(Sweeps::Diverging);
        }
        poor = if error < GAINS * last { 0 } else { poor + 1 };
        (last, largest) = (error, largest.max(error));
        if poor > 2 {
            return Ok(stalled(Solved { stages, error, beyond }, largest));
        }
        if !more {
            continue;
        }
        if error <= 1.0 || (beyond <= 1.0 && poor > 0) {
            return Ok(Sweeps::Converged(Solved { stages, error, beyond }));
        }
        // as much gained by each of the rules that are left
        let gain = error / std::mem::replace(&mut raised, error);
        if gain > 0.0 && beyond * gain.powi((RULES.len() - 1 - place) as i32) > 1.0 {
            return Ok(match gain < GAINS {
                true => Sweeps::Slow,
                false => stalled(Solved { stages, error, beyond }, largest),
            });
        }
    }
    Ok(Sweeps::Slow)
}

/// A step, and what it is off by: in tolerances, and in what rounding next to the position excuses.
struct Solved {
    stages: Stages,
    error: f64,
    beyond: f64,
}

impl StepControl for CrossingStep {
    fn current(&self) -> CurrentStep<'_> {
        CurrentStep {
            t_old: self.t_old,
            t_new: self.t_new,
            t_end: self.t_end,
            y_old: &self.y_old,
            dy_old: &self.dy_old,
            y_new: &self.y_new,
            dy_new: &self.dy_new,
            next: self.length,
            may_shrink: false,
        }
    }
    fn counters(&self) -> &Counters {
        &self.counters
    }
    fn plan(&mut self, plan: &StepPlan) {
        self.lengths.clear();
        self.lengths.push(plan.length);
    }
    fn set_sizes(&mut self, sizes: &[f64]) {
        self.norm.set_sizes(sizes);
    }
    fn replace_start(&mut self, t: f64, y: &[f64], dy: &[f64]) {
        (self.t_old, self.t_new) = (t, t);
        self.y_old.copy_from_slice(y);
        self.dy_old.copy_from_slice(dy);
    }
    fn commit(&mut self) {
        self.t_old = self.t_new;
        std::mem::swap(&mut self.y_old, &mut self.y_new);
        std::mem::swap(&mut self.dy_old, &mut self.dy_new);
        self.counters.steps += 1;
    }
    fn reject(&mut self, factor: f64) {
        let length = factor * (self.t_new - self.t_old);
        self.plan(&StepPlan { length, goal: None });
        self.counters.rejected += 1;
    }
    fn end_at(&mut self, t: f64) {
        let length = t - self.t_old;
        self.plan(&StepPlan { length, goal: None });
        self.counters.rejected += 1;
    }
}

impl<E: Display> Stepper<E> for CrossingStep {
    fn start(&mut self, ode: &mut dyn Ode<Error = E>, t: f64, y: &[f64], t_end: f64) -> Result<(), StepFailure<E>> {
        self.t_end = t_end;
        self.counters.evaluations += 1;
        let mut slope = std::mem::take(&mut self.dy_new);
        let evaluated = ode.rhs(t, y, &mut slope);
        self.replace_start(t, y, &slope);
        self.dy_new = slope;
        match evaluated {
            Ok(()) => Ok(()),
            Err(RhsError::Retry(error) | RhsError::Fatal(error)) => Err(StepFailure::Rhs { t, error }),
        }
    }

    fn attempt(&mut self, ode: &mut dyn Ode<Error = E>) -> Result<(), StepFailure<E>> {
        let (t, rest) = (self.t_old, self.t_end - self.t_old);
        let (mut best, mut last): (Option<Solved>, _) = (None, None);
        let mut next = self.lengths.first().copied();
        let mut i = 0;
        while let Some(h) = next.map(|h| h.min(rest)) {
            self.rounded = false;
            match self.solved(ode, h) {
                // one that is no number is none
                Ok(Some(found))
                    if found.beyond
                        <= best
                            .as_ref()
                            .map_or(if self.rounded { tolerance::CLEARLY } else { 1.0 }, |best| best.beyond) =>
                {
                    best = Some(found)
                }
                Ok(_) => {}
                Err((_, RhsError::Retry(error))) => last = Some(error),
                Err((t, RhsError::Fatal(error))) => return Err(StepFailure::Rhs { t, error }),
            }
            if best.as_ref().is_some_and(|best| best.beyond <= 1.0) {
                break;
            }
            i += 1;
            next = match self.rounded {
                true => Some(self.longest).filter(|longest| *longest > LONGER * h),
                false => self.lengths.get(i).copied(),
            };
            self.counters.rejected += u64::from(next.is_some());
        }
        let h = self.lengths.first().copied().unwrap_or(0.0);
        let Some(Solved { stages, error, .. }) = best else {
            return Err(StepFailure::TooSmall { t, h, last });
        };
        self.counters.lenient += u64::from(error > 1.0);
        self.length = stages.h;
        self.t_new = if stages.h == rest { self.t_end } else { t + stages.h };
        self.y_new.copy_from_slice(&self.y_old);
        stages.advance(1.0, &mut self.y_new);
        self.shift.copy_from_slice(&self.y_new);
        self.stages = Some(stages);
        Ok(())
    }

    fn conclude(&mut self, end: StepEnd<'_, E>) -> Result<Conclusion, StepFailure<E>> {
        let t = self.t_new;
        match end(t, &mut self.y_new, &mut self.dy_new, false) {
            Ok(evaluated) => self.counters.evaluations += u64::from(evaluated),
            Err(RhsError::Retry(error)) => {
                self.counters.evaluations += 1;
                return Err(StepFailure::TooSmall { t: self.t_old, h: self.length, last: Some(error) });
            }
            Err(RhsError::Fatal(error)) => return Err(StepFailure::Rhs { t, error }),
        }
        self.shift.iter_mut().zip(&self.y_new).for_each(|(shift, y)| *shift = y - *shift);
        Ok(Conclusion::Done)
    }

    fn interpolate(&mut self, _: &mut dyn Ode<Error = E>, t: f64, out: &mut [f64]) -> Result<(), StepFailure<E>> {
        self.polynomial(t, out);
        let x = (t - self.t_old) / (self.t_new - self.t_old);
        out.iter_mut().zip(&self.shift).for_each(|(out, shift)| *out += x * shift);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nodes_integrate_what_gauss_does_exactly() {
        for s in [2, 4, 8, 10] {
            let nodes = Nodes::new(s);
            for power in 0..2 * s {
                let sum: f64 = nodes.c.iter().zip(&nodes.b).map(|(c, b)| b * c.powi(power as i32)).sum();
                assert!((sum - 1.0 / (power as f64 + 1.0)).abs() < 1e-14, "{s} {power}");
            }
            for power in 0..s {
                for x in [0.1, 0.7, 1.0] {
                    let of: f64 = nodes.integrals(x).iter().zip(&nodes.c).map(|(w, c)| w * c.powi(power as i32)).sum();
                    assert!((of - x.powi(power as i32 + 1) / (power as f64 + 1.0)).abs() < 1e-13, "{s} {power} {x}");
                    let at: f64 = nodes.values(x).iter().zip(&nodes.c).map(|(w, c)| w * c.powi(power as i32)).sum();
                    assert!((at - x.powi(power as i32)).abs() < 1e-12);
                }
            }
        }
    }

    #[test]
    fn what_does_not_contract_is_extrapolated() {
        // x = A x + b with |A| > 1: plain iteration leaves it
        let (a, b) = ([[-1.7, 0.4], [0.3, -2.1]], [1.0, -0.5]);
        let step = |x: &[f64]| -> Vec<f64> { (0..2).map(|i| a[i][0] * x[0] + a[i][1] * x[1] + b[i] - x[i]).collect() };
        let (mut x, mut anderson) = (vec![0.0, 0.0], Anderson::default());
        for _ in 0..6 {
            let f = step(&x);
            x = anderson.next(&x, &f);
        }
        assert!(step(&x).iter().all(|f| f.abs() < 1e-12));
    }

    #[test]
    fn a_crossing_step_keeps_clear_of_the_position_wherever_it_lies() {
        for ahead in [0.0, 1e-3, 0.02, 0.1, 0.3, 0.5, 0.6] {
            let found = lengths(ahead, 1.0, f64::MAX);
            assert!(found.windows(2).all(|pair| pair[1] < pair[0]), "{ahead}: {found:?}");
            for h in found {
                let clear = clearance(h, ahead) > 5e-3 * h;
                assert!(clear && h >= 1.25 * ahead && (0.2..=1.25).contains(&h), "{ahead}: {h}");
            }
        }
    }
}
