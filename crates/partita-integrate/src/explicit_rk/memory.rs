//! The slopes of earlier steps: with them a table of two stages becomes a multistep method.
//!
//! A step of Adams, Bashforth and Moulton with one evaluation in the middle predicts with the polynomial through the
//! last m slopes, evaluates there, corrects with that slope too, and evaluates again. It is a table of two stages, the
//! slope at the start and the one at the prediction, with the earlier slopes in the slots behind them, whose weights
//! follow from the lengths of the last steps. Nothing else of an explicit method changes.
//!
//! ```text
//! x_j = (t_{n−j} − t_n) / h      g_m = ∫₀¹ Π_{i<m} (x − x_i) dx      w_m = Π_{i<m} (1 − x_i)
//! p_m = y_n + h Σ_j b_j f_{n−j}            the integral of the polynomial P_m through m slopes
//! e_m = f(p) − P_m(1)                      what the evaluation adds
//! y   = p_m + h (g_m / w_m) e_m            of order m + 1
//! err = h |g_m / w_m − g_{m−1} / w_{m−1}| e_m,  less the corrector of order m
//! ```
//!
//! The same e_m with one slope more or less tells what the neighbouring orders would have left; the order that allows
//! the longest step is taken. (Shampine and Gordon 1975; Hairer, Nørsett and Wanner III.5, III.7.)

use super::method::Method;
use crate::combination::Row;
use crate::dense_output::DenseOutput;
use crate::step_size::{ErrorNorm, ERROR_MARGIN};

/// Most slopes that predict: the highest order is one more.
pub(super) const MOST: usize = 9;
/// Slots: the slopes at the start, at the prediction and at the end, and those of earlier steps.
pub(super) const SLOTS: usize = 3 + MOST;
/// Slot of the slope at the prediction, and of that at the end.
const PREDICTED: usize = 1;
const END: usize = 2;
/// Slots that dense output combines: the slopes at the start and at the end, then those of earlier steps, the last one first.
pub(super) const DENSE_SLOTS: [usize; MOST + 1] = {
    let mut slots = [0; MOST + 1];
    let mut i = 1;
    while i <= MOST {
        slots[i] = END + i - 1;
        i += 1;
    }
    slots
};
/// Largest lengthening of a step of a multistep method. Unit: ratio of steps. Reason: Adams formulas on grids that grow
/// faster lose their stability from order three on.
pub(super) const LARGEST_GROWTH: f64 = 2.0;
/// Least lengthening of a step that is made. Scale: ratio of steps. Reason: equal steps leave smaller errors than steps
/// that grow and shrink by turns.
pub(super) const LEAST_GROWTH: f64 = 1.2;
/// Another order must allow a step longer by this. Scale: ratio of steps. Reason: estimates of neighbouring orders differ
/// by as much from one step to the next.
const ORDER_GAIN: f64 = 1.1;
/// Repeated errors above the tolerance in one step after which it begins anew at the lowest order.
const FAILURES: u32 = 3;

/// Points and weights of Gauss on [0, 1], exact up to degree eleven: symmetric, three of each.
const GAUSS: [(f64, f64); 3] = [
    (0.932_469_514_203_152, 0.171_324_492_379_170_35),
    (0.661_209_386_466_264_5, 0.360_761_573_048_138_6),
    (0.238_619_186_083_196_9, 0.467_913_934_572_691_04),
];

/// Times of earlier slopes, and the order in use.
#[derive(Debug)]
pub(super) struct Memory {
    /// Times of the earlier slopes, the last one first.
    past: [f64; MOST],
    /// How many of them are known.
    known: usize,
    /// Slopes that predict.
    order: usize,
    /// x_j of the attempted step.
    nodes: [f64; MOST + 1],
    /// Error estimates of order 1, and of one order less, of this order and of one more.
    estimates: [Row; 4],
    /// Longest step from a new start, by the estimate of order 1 of the last step taken.
    longest_anew: f64,
    failures: u32,
}

impl Memory {
    pub(super) fn new() -> Self {
        let estimates = std::array::from_fn(|_| Row::full(SLOTS));
        Self {
            past: [0.0; MOST],
            known: 0,
            order: 1,
            nodes: [0.0; MOST + 1],
            estimates,
            longest_anew: f64::INFINITY,
            failures: 0,
        }
    }

    /// Forget the earlier slopes.
    pub(super) fn forget(&mut self) {
        (self.known, self.order, self.failures) = (0, 1, 0);
    }

    /// Order of the error estimate.
    pub(super) fn order(&self) -> usize {
        self.order
    }

    /// A step of this length, not longer than a first step may be.
    pub(super) fn limited(&self, step: f64) -> f64 {
        if self.known == 0 {
            step.min(self.longest_anew)
        } else {
            step
        }
    }

    /// Slot of the slope j steps ago.
    fn slot(j: usize) -> usize {
        if j == 0 {
            0
        } else {
            END + j
        }
    }

    /// Weights of a step from t of length h, into the rows of the method.
    pub(super) fn prepare(&mut self, t: f64, h: f64, method: &mut Method) {
        for j in 0..self.known {
            self.nodes[j + 1] = (self.past[j] - t) / h;
        }
        let m = self.order;
        let (x, g) = (&self.nodes[..=self.known], integrals(&self.nodes));
        let mut predictor = [0.0; SLOTS];
        for j in 0..m {
            let mut product: f64 = (0..j).map(|i| x[j] - x[i]).product();
            for (l, g) in g.iter().enumerate().take(m).skip(j) {
                if l > j {
                    product *= x[j] - x[l];
                }
                predictor[Self::slot(j)] += g / product;
            }
        }
        let mut corrector = predictor;
        let added = g[m] / scale(x, m);
        added_slope(x, m).iter().zip(&mut corrector).for_each(|(e, weight)| *weight += added * e);
        method.set_step(&predictor, &corrector);
        for (row, m) in self.estimates.iter_mut().zip([1, m.saturating_sub(1), m, m + 1]) {
            match m >= 1 && m <= self.known + 1 && m <= MOST {
                true => {
                    let factor = (g[m] / scale(x, m) - g[m - 1] / scale(x, m - 1)).abs();
                    row.set(&added_slope(x, m).map(|e| factor * e));
                }
                false => row.set(&[0.0; SLOTS]),
            }
        }
        method.set_estimate(&self.estimates[2]);
    }

    /// The step at hand was too inaccurate.
    pub(super) fn failed(&mut self) {
        self.failures += 1;
        if self.failures >= FAILURES {
            self.order = 1;
        }
    }

    /// Choose the order of the next step, and tell the error that a step of this length has with it.
    pub(super) fn decide(&mut self, norm: &ErrorNorm, h: f64, stages: &[f64], y_old: &[f64], y_new: &[f64]) -> f64 {
        let squares = norm.largest_squares(&self.estimates, stages, y_old, y_new);
        let [first, lower, same, higher] = squares.map(|x| ERROR_MARGIN * h.abs() * x.sqrt());
        let step = |error: f64, order: usize| error.max(f64::MIN_POSITIVE).powf(-1.0 / (order as f64 + 1.0));
        self.longest_anew = h.abs() * step(first, 1);
        let m = self.order;
        let comparable = self.known >= m && m < MOST;
        let (mut best, mut error) = (m, same);
        if m > 1 && step(lower, m - 1) > ORDER_GAIN * step(same, m) {
            (best, error) = (m - 1, lower);
        } else if comparable && step(higher, m + 1) > ORDER_GAIN * step(same, m) {
            (best, error) = (m + 1, higher);
        } else if self.known < m && m < MOST && self.failures == 0 {
            // after a new start each step knows one slope more than it can compare
            best = m + 1;
        }
        self.order = best;
        self.failures = 0;
        error
    }

    /// The step from t is taken: its slopes become earlier ones.
    pub(super) fn shift(&mut self, t: f64, stages: &mut [f64], stride: usize) {
        self.past.copy_within(..MOST - 1, 1);
        self.past[0] = t;
        let first = (END + 1) * stride;
        stages.copy_within(first..first + (MOST - 1) * stride, first + stride);
        stages.copy_within(..stride, first);
        self.known = (self.known + 1).min(MOST);
        self.order = self.order.min(self.known + 1);
    }

    /// Append what `fill_dense` reads; the number of slots that it combines, out of [`DENSE_SLOTS`].
    pub(super) fn save(&self, out: &mut Vec<f64>) -> usize {
        out.push(self.order as f64);
        out.extend_from_slice(&self.nodes);
        self.order + 1
    }

    /// Take back what was saved; the rest.
    pub(super) fn load<'a>(&mut self, from: &'a [f64]) -> &'a [f64] {
        let (own, rest) = from.split_at(1 + self.nodes.len());
        self.order = own[0] as usize;
        self.nodes.copy_from_slice(&own[1..]);
        rest
    }

    /// The rows of dense output: the integral of the polynomial through the slopes that predicted and the one at the end.
    pub(super) fn fill_dense(&self, dense: &mut DenseOutput) {
        let m = self.order;
        let mut rows = [[0.0; SLOTS]; MOST - 2];
        for i in 0..=m {
            let at = |i: usize| if i == 0 { 1.0 } else { self.nodes[i - 1] };
            // Π (x − z_l) / (z_i − z_l), ascending powers
            let mut basis = [0.0; MOST + 2];
            basis[0] = 1.0;
            for (degree, l) in (0..=m).filter(|l| *l != i).enumerate() {
                let scale = 1.0 / (at(i) - at(l));
                for power in (0..=degree + 1).rev() {
                    let below = if power > 0 { basis[power - 1] } else { 0.0 };
                    basis[power] = scale * (below - at(l) * basis[power]);
                }
            }
            // its integral over x; then divided by x and by 1 − x in turns
            let mut rest: [f64; MOST + 2] = std::array::from_fn(|power| basis[power] / (power as f64 + 1.0));
            let slot = if i == 0 { END } else { Self::slot(i - 1) };
            for j in 0..=m {
                let value = if j % 2 == 0 { rest.iter().sum() } else { rest[0] };
                if j >= 3 {
                    rows[j - 3][slot] = value;
                }
                if j % 2 == 0 {
                    let mut quotient = 0.0;
                    for power in (0..rest.len()).rev() {
                        let coefficient = rest[power];
                        rest[power] = -quotient;
                        quotient += coefficient;
                    }
                } else {
                    rest.copy_within(1.., 0);
                    rest[MOST + 1] = 0.0;
                }
            }
        }
        dense.set_rows(&rows);
    }
}

/// g_0, g_1, ...
fn integrals(x: &[f64; MOST + 1]) -> [f64; MOST + 2] {
    let mut g = [0.0; MOST + 2];
    for (node, weight) in GAUSS.iter().flat_map(|(z, w)| [(0.5 * (1.0 + z), 0.5 * w), (0.5 * (1.0 - z), 0.5 * w)]) {
        let mut product = weight;
        for (m, g) in g.iter_mut().enumerate() {
            *g += product;
            product *= node - x.get(m).copied().unwrap_or(0.0);
        }
    }
    g
}

/// w_m.
fn scale(x: &[f64], m: usize) -> f64 {
    x[..m].iter().map(|x| 1.0 - x).product()
}

/// e_m: the slope at the prediction less the polynomial through m slopes, by slots.
fn added_slope(x: &[f64], m: usize) -> [f64; SLOTS] {
    let mut e = [0.0; SLOTS];
    e[PREDICTED] = 1.0;
    for j in 0..m {
        let at_end: f64 = (0..m).filter(|i| *i != j).map(|i| (1.0 - x[i]) / (x[j] - x[i])).product();
        e[Memory::slot(j)] = -at_end;
    }
    e
}
