//! The rounding of slopes, below which no estimate of an error shows anything.
//!
//! A stiff force changes an acceleration by far more than its own rounding where a position changes by one: 1e8 N/m on a
//! kilogram by 1e-8 m/s². The estimate of an error is a sum of slopes over the step and has this rounding, which falls
//! with the step alone, however exact the step is. Below it a controller shortens steps for nothing.

use partita_math::tolerance;

/// Rounding of an estimate over that of one slope. Unit: factor. Reason: the margin of the estimate, and its weights, of
/// which two or three are as large as one; several roundings add up in a slope.
const OF_ESTIMATE: f64 = 32.0;
/// Steps for which the rounding that was measured is taken. Unit: number. Reason: one evaluation in a hundred, while
/// stiffness changes little.
const KEPT: u32 = 100;
/// An error that falls by less than this power of the step is rounding or a corner. Unit: power of the ratio of steps.
/// Reason: rounding falls with the first power, the estimates of all methods with the third at least.
const SLOW: i32 = 2;

/// What is known of it.
#[derive(Debug)]
pub(crate) struct SlopeRounding {
    /// Change of each slope where every state changes by one rounding.
    pub slopes: Vec<f64>,
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
        Self { slopes: vec![0.0; stride], known: false, steps: 0, needed: false, rejected: None }
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

    /// A state one rounding beside y, where components have at least these sizes; alternating, so that nothing is moved as
    /// a whole.
    pub(crate) fn beside(&self, y: &[f64], sizes: &[f64], out: &mut [f64]) {
        for (i, ((to, y), size)) in out.iter_mut().zip(y).zip(sizes).enumerate() {
            let by = 0.25 * tolerance::ROUNDING * y.abs().max(*size);
            *to = if i % 2 == 0 { y + by } else { y - by };
        }
    }

    /// The slopes there, and those of y.
    pub(crate) fn measured(&mut self, slopes: &[f64]) {
        self.slopes.iter_mut().zip(slopes).for_each(|(to, x)| *to = (*to - x).abs());
        (self.known, self.steps, self.needed) = (self.slopes.iter().all(|x| x.is_finite()), 0, false);
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
        x.measured(&[0.0; 8]);
        assert!(!x.suspected(2.0, 0.02, 1.4), "it was measured here");
    }

    #[test]
    fn it_is_measured_anew_where_it_is_needed_and_forgotten_otherwise() {
        let mut x = SlopeRounding::new(8);
        x.measured(&[0.0; 8]);
        (0..KEPT).for_each(|i| x.taken(i == 3));
        assert!(x.known && x.is_due());
        x.measured(&[0.0; 8]);
        (0..KEPT).for_each(|_| x.taken(false));
        assert!(!x.known && !x.is_due());
    }

    #[test]
    fn states_beside_are_one_rounding_away() {
        let (x, y, mut out) = (SlopeRounding::new(4), [1.0, -3.0, 0.0, 1e-20], [0.0; 4]);
        x.beside(&y, &[1.0; 4], &mut out);
        let apart: Vec<f64> = out.iter().zip(y).map(|(a, b)| (a - b).abs()).collect();
        assert!(apart.iter().all(|d| *d > 0.0 && *d <= 4.0 * f64::EPSILON), "{apart:?}");
    }
}
