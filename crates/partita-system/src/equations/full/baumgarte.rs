//! Baumgarte's stabilisation: `Φ̈ + 2α Φ̇ + β² Φ = 0` instead of `Φ̈ = 0`.
//!
//! Kept for comparison with older programs. In the multiplier form b is replaced by
//! `b + 2α (C v + a) + β² Φ`; rows without a position (nonholonomic) take `b + 2α (C v + a)`. Closure errors are damped,
//! not eliminated: they are of the order of the integration error, and the two numbers, which have no best value, stiffen
//! the equations. Exact corrections cost less and need no numbers. (Baumgarte 1972.)

use super::saddle::Saddle;
use super::{AccelerationRule, Failure, Instant};
use crate::system::SystemError;

/// `v'` and λ from the saddle-point matrix with a stabilised right-hand side.
pub struct Stabilised {
    alpha: f64,
    beta: f64,
    saddle: Saddle,
    b: Vec<f64>,
}

impl Stabilised {
    /// Memory for n velocities, m rows and r independent ones; needs the two numbers.
    ///
    /// # Errors
    /// Numbers that are missing, or that make the constraints unstable.
    pub fn new(n: usize, m: usize, r: usize, numbers: Option<(f64, f64)>) -> Result<Self, SystemError> {
        let Some((alpha, beta)) = numbers else {
            return Err(SystemError::argument(
                "baumgarte",
                "\"baumgarte\" needs its two numbers, baumgarte = (alpha, beta) in 1/s: they have no default, \
                 because suitable values depend on the mechanism, its speed and the step (too small: the constraints \
                 drift; too large: the equations become stiff); other formulations need no such numbers"
                    .into(),
            ));
        };
        if let Some((name, x)) =
            [("alpha", alpha), ("beta", beta)].into_iter().find(|(_, x)| !(x.is_finite() && *x >= 0.0))
        {
            return Err(SystemError::argument(
                "baumgarte",
                format!("baumgarte: {name} = {x} 1/s; it must be finite and not negative"),
            ));
        }
        Ok(Self { alpha, beta, saddle: Saddle::new(n, r), b: vec![0.0; m] })
    }
}

impl AccelerationRule for Stabilised {
    fn name(&self) -> &'static str {
        "baumgarte"
    }

    fn corrected(&self) -> bool {
        false
    }

    fn solve(&mut self, x: &Instant, vdot: &mut [f64], lambda: &mut [f64]) -> Result<u64, Failure> {
        for &i in x.rows {
            let violation = if i < x.holonomic { x.phi[i] } else { 0.0 };
            self.b[i] = x.b[i] + 2.0 * self.alpha * x.closure_error_rate(i) + self.beta * self.beta * violation;
        }
        self.saddle.solve(&Instant { b: &self.b, ..*x }, vdot, lambda)
    }

    fn notes(&self) -> Vec<String> {
        vec![format!(
            "stabilised by Baumgarte's method with alpha = {} 1/s and beta = {} 1/s; corrections are not applied, and \
             accelerations and multipliers contain the stabilising part",
            self.alpha, self.beta
        )]
    }
}
