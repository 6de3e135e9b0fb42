//! Options of a stepper.

use crate::tableau::adaptive;
use partita_math::tolerance;

/// Absolute part of the error tolerance.
#[derive(Debug, Clone, PartialEq)]
pub enum AbsoluteTolerance {
    /// One value for every component, in natural sizes.
    Same(f64),
    /// One value for each controlled component, in their order and natural sizes.
    Each(Vec<f64>),
}

impl From<f64> for AbsoluteTolerance {
    fn from(value: f64) -> Self {
        Self::Same(value)
    }
}

impl From<Vec<f64>> for AbsoluteTolerance {
    fn from(values: Vec<f64>) -> Self {
        Self::Each(values)
    }
}

/// Settings of a [`Stepper`](crate::stepper::Stepper).
///
/// A step is accepted when `error / (atol s + rtol max(|y_old|, |y_new|))` is at most one in every controlled
/// component, where `error` is the estimate times [`ERROR_MARGIN`](crate::step_size::ERROR_MARGIN) and s the natural
/// size of the component: 1 unless [`set_sizes`](crate::stepper::StepControl::set_sizes) sets another. Mechanisms set
/// their characteristic length for displacements and 1 for angles.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Relative tolerance.
    pub rtol: f64,
    /// Absolute tolerance.
    pub atol: AbsoluteTolerance,
    /// Number of leading components whose error is controlled; the rest (accumulated work, say) is integrated without
    /// error control. The dimension or more means all.
    pub controlled: usize,
    /// A component behind the controlled ones, such as accumulated work, whose error is bounded more loosely by methods that
    /// choose their order.
    pub observed: Option<usize>,
    /// Longest step allowed under error control; the last one may be a hundredth longer.
    pub max_step: f64,
    /// Use this fixed step, without error control: on the grid `t_start + i h`, ending exactly on `t_end`.
    pub fixed_step: Option<f64>,
    /// Length of the first step under error control; chosen by the stepper when absent.
    pub first_step: Option<f64>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            rtol: tolerance::RTOL,
            atol: AbsoluteTolerance::Same(tolerance::ATOL),
            controlled: usize::MAX,
            observed: None,
            max_step: f64::INFINITY,
            fixed_step: None,
            first_step: None,
        }
    }
}

/// Settings that contradict themselves, the method or the equation.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum OptionsError {
    /// A method without an error estimate and no fixed step.
    #[error(
        "method {method} has no error estimate and runs with a fixed step only; give fixed_step, or choose among {}",
        adaptive()
    )]
    NeedsFixedStep {
        /// Name of the method.
        method: &'static str,
    },
    /// A value is out of range.
    #[error("{name} = {value} is out of range; it must be {range}")]
    OutOfRange {
        /// Name of the option.
        name: &'static str,
        /// The value given.
        value: f64,
        /// What is allowed, in words.
        range: &'static str,
    },
    /// A list of tolerances of the wrong length.
    #[error("atol has {given} entries for {controlled} controlled components; give one number, or one for each")]
    ToleranceCount {
        /// Entries given.
        given: usize,
        /// Entries wanted.
        controlled: usize,
    },
}

impl Options {
    /// Check these settings for an equation of dimension `dim`.
    ///
    /// # Errors
    /// The first contradiction found.
    pub fn check(&self, dim: usize) -> Result<(), OptionsError> {
        let positive = |x: f64| x > 0.0 && x.is_finite();
        let in_range = |name, value, valid, range| {
            if valid {
                Ok(())
            } else {
                Err(OptionsError::OutOfRange { name, value, range })
            }
        };
        for (name, step) in [("fixed_step", self.fixed_step), ("first_step", self.first_step)] {
            if let Some(h) = step {
                in_range(name, h, positive(h), "positive and finite")?;
            }
        }
        in_range("max_step", self.max_step, self.max_step > 0.0, "positive")?;
        let tolerance = |x: f64| x >= 0.0 && x.is_finite();
        in_range("rtol", self.rtol, tolerance(self.rtol), "finite and not negative")?;
        let atol: &[f64] = match &self.atol {
            AbsoluteTolerance::Same(value) => std::slice::from_ref(value),
            AbsoluteTolerance::Each(values) => {
                let controlled = self.controlled.min(dim);
                if values.len() != controlled {
                    return Err(OptionsError::ToleranceCount { given: values.len(), controlled });
                }
                values
            }
        };
        for &value in atol {
            in_range("atol", value, tolerance(value), "finite and not negative")?;
        }
        Ok(())
    }
}
