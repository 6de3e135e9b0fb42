//! The state inside a step: a polynomial of degree four, as accurate as the ends.
//!
//! The polynomial of the stages is two orders less accurate than the end of the step. Where outputs are asked for, half the
//! step is taken as well, from the same start: its end, that of the whole step and the slopes of their stages at both have the
//! order of the method. Slopes evaluated at these points would magnify what the iterations left by all that is stiff.
//!
//! ```text
//! y(θ) = y_old + p(θ),   p by divided differences over θ = 1, 1, ½, ½, 0
//! ```

use super::coefficients::{NODES, S};
use super::stages::StageSolver;

/// Terms of the polynomial.
const TERMS: usize = 5;

/// The polynomial of a step.
#[derive(Debug)]
pub(super) struct Polynomial {
    /// Divided differences, one vector after the other.
    terms: Vec<f64>,
    pub(super) known: bool,
}

impl Polynomial {
    pub(super) fn new(dim: usize) -> Self {
        Self { terms: vec![0.0; TERMS * dim], known: false }
    }

    /// Of a step from y_old to y_new with these stages, and those of its first half.
    pub(super) fn fill(&mut self, y_old: &[f64], y_new: &[f64], whole: &StageSolver, half: &StageSolver) {
        let (n, slope) = (y_old.len(), &NODES.inverse[S - 1]);
        for l in 0..n {
            let (end, middle) = (y_new[l] - y_old[l], half.z[(S - 1) * n + l]);
            // slopes over the whole step
            let (at_end, at_middle) = (whole.increment(slope, l), 2.0 * half.increment(slope, l));
            let (late, early) = (2.0 * (end - middle), 2.0 * middle);
            let second = [2.0 * (at_end - late), 2.0 * (late - at_middle), 2.0 * (at_middle - early)];
            let third = [2.0 * (second[0] - second[1]), second[1] - second[2]];
            let of = [end, at_end, second[0], third[0], third[0] - third[1]];
            of.into_iter().enumerate().for_each(|(i, x)| self.terms[i * n + l] = x);
        }
        self.known = true;
    }

    /// The state at part θ, into `out`.
    pub(super) fn evaluate(&self, theta: f64, y_old: &[f64], out: &mut [f64]) {
        let n = y_old.len();
        let (end, middle) = (theta - 1.0, theta - 0.5);
        let factors = [end, end, middle, middle];
        for l in 0..n {
            let mut sum = self.terms[(TERMS - 1) * n + l];
            for i in (0..TERMS - 1).rev() {
                sum = self.terms[i * n + l] + factors[i] * sum;
            }
            out[l] = y_old[l] + sum;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_motion_of_degree_three_is_reproduced_and_one_of_degree_four_too_by_its_ends() {
        let y = |x: f64| x * (1.0 + x * (2.0 + x * (-3.0 + 0.0 * x)));
        let mut solvers = [StageSolver::new(1), StageSolver::new(1)];
        for (solver, part) in solvers.iter_mut().zip([1.0, 0.5]) {
            (0..S).for_each(|i| solver.z[i] = y(part * NODES.c[i]));
        }
        let mut made = Polynomial::new(1);
        made.fill(&[0.0], &[y(1.0)], &solvers[0], &solvers[1]);
        for theta in [0.0, 0.2, 0.5, 0.77, 1.0] {
            let mut out = [0.0];
            made.evaluate(theta, &[0.0], &mut out);
            assert!((out[0] - y(theta)).abs() < 1e-14, "{theta} {out:?}");
        }
    }
}
