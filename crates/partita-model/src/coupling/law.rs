//! Laws over readings `r`: `F(t, r) = 0`, with `F_i = ∂F/∂r_i`, `F_t`, and the second derivative along the motion.
//!
//! ```text
//! Φ = F     C = Σ F_i C_i     a = F_t     b = Σ F_i b_i + F''|r''=0
//! ```

use crate::measurement::Measurement;
use crate::numbers::Fields;
use crate::spec::{Drive, Table, Value};
use crate::tree::{Tree, TreeScratch};
use crate::value::{self, failed, finite, Abscissa, Callers, Functions, Instant};
use partita_math::scalar::{Arguments, Scalar};
use partita_math::spatial::Space;
use partita_system::SystemError;

/// Maximum number of readings of a function.
const MOST: usize = value::READINGS;

/// A law.
#[derive(Clone, Debug)]
pub enum Law<S> {
    /// `Σ factor · r = offset`; up to multiples of a period where whole turns are not known.
    Linear {
        /// Factors.
        factors: Vec<S>,
        /// Sum.
        offset: S,
        /// Period.
        period: Option<S>,
    },
    /// `r_0 = f(r_1)`.
    Curve {
        /// f.
        curve: Table,
        /// What is known of r_1.
        abscissa: Abscissa,
        /// Period up to which r_0 is known.
        period: Option<f64>,
    },
    /// `r_0 = f(t)`.
    Motion {
        /// f.
        motion: Prescribed<S>,
        /// Period up to which r_0 is known.
        period: Option<f64>,
    },
    /// `r_0' = f(t)`: a condition on rates alone.
    Rate(Prescribed<S>),
    /// A user-defined function.
    Function(usize),
}

/// What a drive prescribes over time: a number of it is a parameter.
#[derive(Clone, Debug)]
pub struct Prescribed<S> {
    value: Value,
    /// In place of its number.
    given: Option<S>,
}

impl<S: Scalar> Prescribed<S> {
    /// Of a drive with these numbers.
    pub fn new(drive: &Drive, numbers: &Fields<S>) -> Self {
        Self { value: drive.motion.clone(), given: numbers.first() }
    }

    /// Value, first and second derivative at t.
    fn at(&self, callers: &Callers, t: S, what: &str, memory: &mut Vec<f64>) -> Result<[S; 3], SystemError> {
        match self.given {
            Some(x) => Ok([x, S::zero(), S::zero()]),
            None => value::motion_at(&self.value, callers, t, what, memory),
        }
    }
}

/// A law at one position.
pub(crate) struct LawAt<'a, S> {
    /// F.
    pub value: S,
    /// F_t.
    pub rate: S,
    gradient: Gradient<'a, S>,
}

/// F_i: the factors of the law, however many, or those found.
enum Gradient<'a, S> {
    Given(&'a [S]),
    Found([S; MOST]),
}

impl<S> LawAt<'_, S> {
    /// F_i.
    #[inline(always)]
    pub(crate) fn gradient(&self) -> &[S] {
        match &self.gradient {
            Gradient::Given(factors) => factors,
            Gradient::Found(gradient) => gradient,
        }
    }
}

impl<S: Scalar> Law<S> {
    /// F, F_t and F_i at the last poses.
    #[inline(always)]
    pub(crate) fn position<'a, G: Space<S = S>>(
        &'a self,
        tree: &Tree<G>,
        s: &TreeScratch<G>,
        at: &Instant<S>,
        readings: &[Measurement<G>],
        name: &str,
        memory: &mut Vec<f64>,
    ) -> Result<LawAt<'a, S>, SystemError> {
        let (o, one) = (S::zero(), S::one());
        let read = |i: usize| readings[i].value(tree, s, at.q);
        let mut gradient = [o; MOST];
        let (value, rate) = match self {
            Self::Linear { factors, offset, period } => {
                let sum = factors.iter().enumerate().fold(-*offset, |sum, (i, &factor)| sum + factor * read(i));
                let gradient = Gradient::Given(factors);
                return Ok(LawAt { value: value::up_to(sum, *period), rate: o, gradient });
            }
            Self::Curve { curve, abscissa, period } => {
                let [y, slope, _] = value::curve_at(curve, *abscissa, read(1), name)?;
                (gradient[0], gradient[1]) = (one, -slope);
                (value::up_to(read(0) - y, period.map(S::from_f64)), o)
            }
            Self::Motion { motion, period } => {
                let [p, u, _] = motion.at(at.callers, at.t, name, memory)?;
                gradient[0] = one;
                (value::up_to(read(0) - p, period.map(S::from_f64)), -u)
            }
            Self::Rate(motion) => {
                let [p, _, _] = motion.at(at.callers, at.t, name, memory)?;
                gradient[0] = one;
                (o, -p)
            }
            Self::Function(k) => {
                let mut x = [o; MOST];
                readings.iter().enumerate().for_each(|(i, _)| x[i] = read(i));
                let n = readings.len();
                let uncounted = |i: usize| readings[i].wraps;
                let found = called(*k, at.callers, at.t, (&x[..n], &[o; MOST][..n]), uncounted, name, memory)?;
                gradient.copy_from_slice(&found[3..]);
                (found[0], found[1])
            }
        };
        Ok(LawAt { value, rate, gradient: Gradient::Found(gradient) })
    }

    /// b at the last twists.
    #[inline(always)]
    pub(crate) fn velocity<G: Space<S = S>>(
        &self,
        tree: &Tree<G>,
        s: &TreeScratch<G>,
        at: &Instant<S>,
        readings: &[Measurement<G>],
        name: &str,
        memory: &mut Vec<f64>,
    ) -> Result<S, SystemError> {
        let bias = |i: usize| readings[i].bias(tree, s);
        match self {
            Self::Linear { factors, .. } => {
                Ok(factors.iter().enumerate().fold(S::zero(), |sum, (i, &factor)| sum + factor * bias(i)))
            }
            Self::Curve { curve, abscissa, .. } => {
                let [_, slope, bend] = value::curve_at(curve, *abscissa, readings[1].value(tree, s, at.q), name)?;
                let rate = readings[1].rate(tree, s, at.v);
                Ok(bias(0) - slope * bias(1) - bend * rate * rate)
            }
            Self::Motion { motion, .. } => Ok(bias(0) - motion.at(at.callers, at.t, name, memory)?[2]),
            Self::Rate(motion) => Ok(bias(0) - motion.at(at.callers, at.t, name, memory)?[1]),
            Self::Function(k) => {
                let (mut x, mut rates) = ([S::zero(); MOST], [S::zero(); MOST]);
                for (i, reading) in readings.iter().enumerate() {
                    (x[i], rates[i]) = (reading.value(tree, s, at.q), reading.rate(tree, s, at.v));
                }
                let n = readings.len();
                // the position level has reported it already
                let found = called(*k, at.callers, at.t, (&x[..n], &rates[..n]), |_| false, name, memory)?;
                Ok((0..n).fold(found[2], |sum, i| sum + found[3 + i] * bias(i)))
            }
        }
    }

    /// Whether it depends explicitly on time.
    pub fn is_rheonomic(&self) -> bool {
        match self {
            Self::Motion { motion, .. } => !matches!(motion.value, Value::Constant(_)),
            Self::Rate(motion) => !matches!(motion.value, Value::Constant(x) if x == 0.0),
            Self::Function(_) => true,
            Self::Linear { .. } | Self::Curve { .. } => false,
        }
    }

    /// Whether it calls one of these functions.
    pub fn calls(&self, functions: &dyn Functions) -> bool {
        match self {
            Self::Motion { motion, .. } | Self::Rate(motion) => {
                matches!(motion.value, Value::Function(i) if functions.given(i).is_none())
            }
            Self::Function(_) => true,
            Self::Linear { .. } | Self::Curve { .. } => false,
        }
    }
}

/// The values of a user-defined function at readings and rates.
fn called<S: Scalar>(
    k: usize,
    callers: &Callers,
    t: S,
    (x, rates): (&[S], &[S]),
    uncounted: impl Fn(usize) -> bool,
    name: &str,
    memory: &mut Vec<f64>,
) -> Result<[S; value::RELATION], SystemError> {
    let arguments = Arguments { t, q: x, v: rates, q_sizes: &[], v_sizes: &[] };
    S::call(arguments, memory, |t, x, rates| {
        let ask = |x: &[f64]| {
            let found = callers.functions.relation(k, t, x, rates).map_err(|e| failed(name, e))?;
            finite(found, name, t)
        };
        let found = ask(x)?;
        value::alike_a_turn_on((0..x.len()).filter(|&i| uncounted(i)), x, &found, name, |x, out| {
            out.copy_from_slice(&ask(x)?);
            Ok(())
        })?;
        Ok(found)
    })
}
