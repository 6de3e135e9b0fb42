//! Gauss collocation: one long step that evaluates nowhere near a singular position.
//!
//! The motion through a singular position is smooth, but next to it the equations are quotients of small numbers. Gauss
//! collocation has no node at its ends, its polynomial goes through both, and every stage lies on the motion to the order
//! of the whole step, not to that of the stage:
//!
//! ```text
//! y(t₀ + c_i h) = y₀ + h Σ a_ij y'_j,   y'_i = f(t₀ + c_i h, y_i)                              (X3)
//! ```
//!
//! A step across a singular position ([`CrossingStep`](crate::crossing_step::CrossingStep)) is solved by sweeps over an increasing number of nodes: each sweep
//! gains an order, and the difference of two rules is the error. Where the branches form a cone its curvature grows as one
//! over the distance, and sweeps need not converge, however short the step: then, and for the step out of a singular
//! position ([`singular_start`](crate::singular_start)), the iteration uses Anderson's extrapolation.

use crate::counters::Counters;
use crate::ode::{Ode, RhsError};
use partita_math::dense::Matrix;
use partita_math::factor::least_squares_min_norm;
use partita_math::tolerance;
use std::fmt::Display;
use std::sync::LazyLock;

/// Largest number of iterations, and the number of them used by the extrapolation.
const ITERATIONS: usize = 60;
const REMEMBERED: usize = 12;
/// Where two polynomials are compared. Unit: fraction of the step. Reason: inside it outputs lie, at its end the next step
/// begins.
pub(crate) const COMPARED: [f64; 5] = [0.1, 0.37, 0.63, 0.9, 1.0];

/// Rules of ever more nodes. Their numbers are even: the middle of a step, where the position is aimed at, is no node.
pub(crate) static RULES: LazyLock<[Nodes; 7]> = LazyLock::new(|| [4, 6, 8, 10, 12, 14, 16].map(Nodes::new));
/// Indices of the two rules whose difference is the error of a step out of a singular position.
pub(crate) const LESS: usize = 2;
pub(crate) const MORE: usize = 3;
/// Gauss nodes on 0..1 with the coefficients of collocation.
#[derive(Clone, Debug)]
pub(crate) struct Nodes {
    pub(crate) c: Vec<f64>,
    /// Barycentric weights.
    w: Vec<f64>,
    /// Weights of the quadrature.
    pub(crate) b: Vec<f64>,
    /// The Lagrange polynomials in Legendre polynomials of the step, a row for each of these.
    legendre: Vec<Vec<f64>>,
    /// The row of each node, and that of each part at which polynomials are compared.
    pub(crate) a: Vec<Vec<f64>>,
    compared: [Vec<f64>; COMPARED.len()],
}

/// Legendre polynomials at x in -1..1, each with the next one, from degree 0 on.
fn legendre(x: f64) -> impl Iterator<Item = (f64, f64)> {
    let next = move |(n, (before, p)): &(f64, (f64, f64))| {
        Some((n + 1.0, (*p, ((2.0 * n + 1.0) * x * p - n * before) / (n + 1.0))))
    };
    std::iter::successors(Some((1.0, (1.0, x))), next).map(|(_, pair)| pair)
}

impl Nodes {
    fn new(s: usize) -> Self {
        // roots of the Legendre polynomial by Newton's method, its weights by its slope
        let with_slope = |x: f64| {
            let (before, p) = legendre(x).nth(s - 1).unwrap_or((0.0, 1.0));
            (p, s as f64 * (x * p - before) / (x * x - 1.0))
        };
        let (mut c, mut b) = (Vec::new(), Vec::new());
        for i in 0..s {
            let mut x = -(std::f64::consts::PI * (i as f64 + 0.75) / (s as f64 + 0.5)).cos();
            for _ in 0..20 {
                let (p, slope) = with_slope(x);
                x -= p / slope;
            }
            let slope = with_slope(x).1;
            c.push(0.5 * (1.0 + x));
            b.push(1.0 / ((1.0 - x * x) * slope * slope));
        }
        let w =
            (0..s).map(|i| 1.0 / (0..s).filter(|&j| j != i).map(|j| 4.0 * (c[i] - c[j])).product::<f64>()).collect();
        // the quadrature of the nodes is exact for their products
        let row = |m: usize| {
            let at = |c: &f64| legendre(2.0 * c - 1.0).nth(m).map_or(0.0, |(p, _)| p);
            c.iter().zip(&b).map(|(c, b)| (2 * m + 1) as f64 * b * at(c)).collect()
        };
        let legendre = (0..s).map(row).collect();
        let mut nodes = Self { c, w, b, legendre, a: Vec::new(), compared: Default::default() };
        nodes.a = nodes.c.iter().map(|&c| nodes.integrals(c)).collect();
        nodes.compared = COMPARED.map(|x| nodes.integrals(x));
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

    /// Their integrals from 0 to x.
    fn integrals(&self, x: f64) -> Vec<f64> {
        let mut sum = vec![0.0; self.count()];
        let mut before = -1.0;
        for (m, (row, (this, next))) in self.legendre.iter().zip(legendre(2.0 * x - 1.0)).enumerate() {
            // of the polynomial of degree m
            let integral = (next - before) / (2 * (2 * m + 1)) as f64;
            sum.iter_mut().zip(row).for_each(|(sum, l)| *sum += integral * l);
            before = this;
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
    pub(crate) nodes: &'static Nodes,
    pub(crate) h: f64,
    /// Node by node.
    pub(crate) rates: Vec<f64>,
}

impl Stages {
    /// What the polynomial adds to its start y up to the part x of the step, onto `y`.
    pub(crate) fn advance(&self, x: f64, y: &mut [f64]) {
        self.add(&self.nodes.integrals(x), y);
    }

    fn add(&self, weights: &[f64], y: &mut [f64]) {
        for (weight, rates) in weights.iter().zip(self.rates.chunks_exact(y.len().max(1))) {
            y.iter_mut().zip(rates).for_each(|(y, d)| *y += self.h * weight * d);
        }
    }

    /// Lagrange polynomials of its nodes at the part x of the step.
    pub(crate) fn values(&self, x: f64) -> Vec<f64> {
        self.nodes.values(x)
    }

    /// The largest difference of two polynomials over the step, in each of these tolerances.
    pub(crate) fn differ<const N: usize>(&self, other: &Self, tolerances: [&[f64]; N]) -> [f64; N] {
        let width = tolerances[0].len();
        let [mut one, mut two] = [vec![0.0; width], vec![0.0; width]];
        let mut worst = [0.0; N];
        for (weights, others) in self.nodes.compared.iter().zip(&other.nodes.compared) {
            one.fill(0.0);
            two.fill(0.0);
            self.add(weights, &mut one);
            other.add(others, &mut two);
            one.iter_mut().zip(&two).for_each(|(a, b)| *a = (*a - b).abs());
            for (worst, tolerances) in worst.iter_mut().zip(tolerances) {
                let off = one.iter().zip(tolerances).map(|(off, tolerance)| off / tolerance);
                // NaN counts
                *worst = off.fold(*worst, |worst, off| if off > worst || off.is_nan() { off } else { worst });
            }
        }
        worst
    }

    /// Rates at the nodes of another rule, as a first guess there.
    fn at(&self, nodes: &Nodes, width: usize) -> Vec<f64> {
        if std::ptr::eq(nodes, self.nodes) {
            return self.rates.clone();
        }
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
/// The error of the equation where it cannot be evaluated.
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
        // at rest up to rounding; whether that suffices is decided by the other nodes
        since = if worst < tolerance::CONVERGES * least { 0 } else { since + 1 };
        least = least.min(worst);
        if worst <= tolerance::NEGLIGIBLE_ERROR || (beyond <= 1.0 && since > 3) {
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
}
