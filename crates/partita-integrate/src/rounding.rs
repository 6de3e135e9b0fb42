//! The rounding of slopes, below which no estimate of an error shows anything.
//!
//! A stiff force between points that are far from the origin changes an acceleration by far more than its own rounding
//! where their positions are rounded: 1e8 N/m on a kilogram at one metre by 1e-8 m/s². The estimate of an error is a sum
//! of slopes over the step and has this rounding, which falls with the step alone, however exact the step is. Below it a
//! controller shortens steps for nothing.
//!
//! It is measured by second differences over a few roundings of the states: whatever is smooth, however steep, cancels in
//! them.

use crate::ode::Ode;
use std::fmt::Display;

/// Rounding of an estimate over that of one slope. Unit: factor. Reason: the margin of the estimate, and its weights, of
/// which two or three are as large as one; several roundings add up in a slope.
const OF_ESTIMATE: f64 = 32.0;
/// Distance of the states between which slopes are compared. Unit: roundings of their sizes. Reason: several, so that
/// their own roundings differ; few, so that nothing bends between them.
const APART: f64 = 8.0;
/// Pairs of states that are compared, moved in other directions each. Unit: number. Reason: one of two may round alike.
const PAIRS: usize = 2;
/// Where the two states of a pair lie, and the weights of their slopes. Unit: distance, and number. Reason: what is linear
/// cancels; at equal distances what is rounded might cancel, too.
const SIDES: [(f64, f64); 2] = [(1.0, 0.7), (-0.7, 1.0)];
/// Second differences of slopes over the rounding of one. Unit: factor. Reason: the root of the sum of squared weights.
const OF_DIFFERENCE: f64 = 2.1;
/// Steps for which the rounding that was measured is taken. Unit: number. Reason: one evaluation in a hundred, while
/// stiffness changes little.
const KEPT: u32 = 100;
/// An error that falls by less than this power of the step is rounding or a corner. Unit: power of the ratio of steps.
/// Reason: rounding falls with the first power, the estimates of all methods with the third at least.
const SLOW: i32 = 2;

/// What is known of it.
#[derive(Debug)]
pub(crate) struct SlopeRounding {
    /// That of each slope.
    pub slopes: Vec<f64>,
    /// A slope of a state beside, and the second differences.
    beside: Vec<f64>,
    differences: Vec<f64>,
    /// Whether it is taken into account.
    pub known: bool,
    /// Steps since it was measured, and whether one of them needed it.
    steps: u32,
    needed: bool,
    /// Start, length and error of the last attempt that was rejected.
    rejected: Option<(f64, f64, f64)>,
}

impl SlopeRounding {
    /// Memory for so many states.
    pub(crate) fn new(stride: usize) -> Self {
        let none = || vec![0.0; stride];
        Self {
            slopes: none(),
            beside: none(),
            differences: none(),
            known: false,
            steps: 0,
            needed: false,
            rejected: None,
        }
    }

    /// Forget all.
    pub(crate) fn forget(&mut self) {
        (self.known, self.steps, self.needed, self.rejected) = (false, 0, false, None);
    }

    /// Whether two attempts from t, the last one of length h, failed with errors that hardly depend on the step. Then it
    /// should be measured.
    pub(crate) fn suspected(&mut self, t: f64, h: f64, error: f64) -> bool {
        let before = self.rejected.replace((t, h, error));
        let slow = |(at, longer, larger): (f64, f64, f64)| at == t && error > larger * (h / longer).abs().powi(SLOW);
        before.is_some_and(slow) && !(self.known && self.steps == 0)
    }

    /// Whether what was measured is too old, and still needed.
    pub(crate) fn is_due(&self) -> bool {
        self.known && self.needed && self.steps >= KEPT
    }

    /// A state a few roundings beside y, where components have at least these sizes: `side` is that of a state of the
    /// pair, whose directions differ from component to component.
    fn move_beside(pair: usize, side: f64, y: &[f64], sizes: &[f64], out: &mut [f64]) {
        for (i, ((to, y), size)) in out.iter_mut().zip(y).zip(sizes).enumerate() {
            let by = APART * f64::EPSILON * y.abs().max(*size) * (1.0 + 0.25 * pair as f64);
            *to = if (i >> pair) % 2 == 0 { y + side * by } else { y - side * by };
        }
    }

    /// Begin with a pair of states around one with these slopes.
    fn begin(&mut self, pair: usize, slopes: &[f64]) {
        if pair == 0 {
            self.slopes.fill(0.0);
        }
        self.differences.iter_mut().zip(slopes).for_each(|(to, x)| *to = -(SIDES[0].1 + SIDES[1].1) * x);
    }

    /// The slopes `beside` are those of one state of the pair, with this weight.
    fn add(&mut self, weight: f64) {
        self.differences.iter_mut().zip(&self.beside).for_each(|(to, x)| *to += weight * x);
    }

    /// Both are known.
    fn end(&mut self) {
        let found = self.slopes.iter_mut().zip(&self.differences);
        found.for_each(|(to, x)| *to = to.max(x.abs() / OF_DIFFERENCE));
        (self.known, self.steps, self.needed) = (self.differences.iter().all(|x| x.is_finite()), 0, false);
    }

    /// Measure that of the slopes at (t, y), where components have at least these sizes; `moved` is memory for a state. Where
    /// that is impossible it stays unknown. All but `sizes` and the slopes have the length of the equation.
    pub(crate) fn measure<E: Display>(
        &mut self,
        ode: &mut dyn Ode<Error = E>,
        t: f64,
        (y, slopes): (&[f64], &[f64]),
        sizes: &[f64],
        moved: &mut [f64],
        evaluations: &mut u64,
    ) {
        for pair in 0..PAIRS {
            self.begin(pair, slopes);
            for (side, weight) in SIDES {
                Self::move_beside(pair, side, y, sizes, moved);
                *evaluations += 1;
                if ode.rhs(t, moved, &mut self.beside[..moved.len()]).is_err() {
                    return self.forget();
                }
                self.add(weight);
            }
            self.end();
        }
    }

    /// A step was taken; `needed`: its error was within the tolerance only because of this.
    pub(crate) fn taken(&mut self, needed: bool) {
        self.needed |= needed;
        self.steps += 1;
        if self.known && self.steps >= KEPT && !self.needed {
            self.known = false;
        }
    }

    /// The rounding of an estimate over a step of length h, for component i.
    #[inline(always)]
    pub(crate) fn of_estimate(slope: f64, h: f64) -> f64 {
        OF_ESTIMATE * slope * h.abs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_errors_that_hardly_depend_on_the_step_are_suspected() {
        let mut x = SlopeRounding::new(8);
        assert!(!x.suspected(1.0, 0.1, 50.0));
        assert!(!x.suspected(1.0, 0.05, 50.0 / 33.0), "an error of order five");
        assert!(x.suspected(1.0, 0.025, 0.9 * 50.0 / 33.0), "rounding");
        assert!(!x.suspected(2.0, 0.025, 1.4), "another step");
        x.end();
        assert!(!x.suspected(2.0, 0.02, 1.4), "it was measured here");
    }

    #[test]
    fn it_is_measured_anew_where_it_is_needed_and_forgotten_otherwise() {
        let mut x = SlopeRounding::new(8);
        x.end();
        (0..KEPT).for_each(|i| x.taken(i == 3));
        assert!(x.known && x.is_due());
        x.end();
        (0..KEPT).for_each(|_| x.taken(false));
        assert!(!x.known && !x.is_due());
    }

    #[test]
    fn what_is_smooth_cancels_and_what_is_rounded_does_not() {
        // a spring of 1e12 N/m, by the displacement itself, and by the distance of a point half a metre away
        let (y, sizes) = ([3e-11, 0.0], [1.0, 1.0]);
        let slopes = |y: &[f64; 2]| [-1e12 * y[0], -1e12 * ((0.437_281_9 + y[1]) - 0.437_281_9)];
        let (mut x, mut at) = (SlopeRounding::new(2), [0.0; 2]);
        for pair in 0..PAIRS {
            x.begin(pair, &slopes(&y));
            for (side, weight) in SIDES {
                SlopeRounding::move_beside(pair, side, &y, &sizes, &mut at);
                assert!(at.iter().zip(y).all(|(a, b)| a != &b && (a - b).abs() < 1e-14));
                x.beside.copy_from_slice(&slopes(&at));
                x.add(weight);
            }
            x.end();
        }
        assert!(x.known && x.slopes[0] < 1e-14 * 30.0, "{:?}", x.slopes);
        assert!(x.slopes[1] > 1e-6 && x.slopes[1] < 1e-3, "{:?}", x.slopes);
    }
}
