//! Number types for generic arithmetic: plain `f64`, [`Dual`] numbers that carry a derivative, [`Lanes`] of eight
//! numbers side by side, and a [`Recorder`] that records the operations.
//!
//! ```text
//! Cases       one of two numbers, taken without a branch
//! Functions   tables, and functions that are known in f64 alone
//!   Scalar    with these two, arithmetic, straight through: no value to look at, no order
//!     Real    and a value: choices (pivots, limits, Newton's method) require it
//! ```
//!
//! A recursion written once over [`Scalar`] gives values with `f64`, exact directional derivatives with [`Dual`], eight
//! evaluations at once with [`Lanes`], and a program to run elsewhere with [`Recorder`].

mod dual;
mod lanes;
mod plain;
mod recorder;

pub use dual::Dual;
pub use lanes::Lanes;
pub(crate) use recorder::Operation;
pub use recorder::{head as c_head, Lookup, Module, Numbers, OperationCounts, PlainTape, Recorder, Recording};

use std::fmt::Debug;
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

/// Arguments of a function known in `f64` alone: (t, q, v).
#[derive(Clone, Copy, Debug)]
pub struct Arguments<'a, S> {
    /// One number.
    pub t: S,
    /// A list of numbers.
    pub q: &'a [S],
    /// Another list.
    pub v: &'a [S],
    /// Typical sizes of the entries of `q` (1 where there are fewer), for differences.
    pub q_sizes: &'a [f64],
    /// Typical sizes of the entries of `v`.
    pub v_sizes: &'a [f64],
}

/// A number for arithmetic without comparisons: nothing written over it branches on a value.
///
/// Implementers promise that every operation acts on the value as it does on `f64`, so that the value of any result is
/// that of `f64`, to the bit. Where a formula has two cases, both are computed and
/// [`where_positive`](Cases::where_positive) (or [`max`](Cases::max), ...) selects one.
pub trait Scalar:
    Cases
    + Functions
    + Default
    + Debug
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
    + Send
    + Sync
    + 'static
{
    /// The constant `x`.
    fn from_f64(x: f64) -> Self;
    /// The constant 0.
    fn zero() -> Self;
    /// The constant 1.
    fn one() -> Self;
    /// Product with a constant; cheaper than promoting the constant.
    fn scale(self, factor: f64) -> Self;
    /// Square root; at 0 the derivative is infinite.
    fn sqrt(self) -> Self;
    /// A constant power, at least 1, of a number that is not negative.
    fn power(self, exponent: f64) -> Self;
    /// Sine and cosine of an angle in radians.
    fn sin_cos(self) -> (Self, Self);
    /// Angle of the point (`x`, `self`) in radians, above −π and up to π.
    fn atan2(self, x: Self) -> Self;
    /// `√(self² + other²)` without intermediate overflow.
    fn hypot(self, other: Self) -> Self;
}

/// Selection among numbers without a branch: the derivative is that of the number selected.
pub trait Cases: Copy {
    /// Absolute value; at 0 it follows the sign bit.
    fn abs(self) -> Self;
    /// The nearest whole number; its derivative is 0.
    fn round(self) -> Self;
    /// The larger one.
    fn max(self, other: Self) -> Self;
    /// The smaller one.
    fn min(self, other: Self) -> Self;
    /// `yes` where this number is above 0, else `no`.
    fn where_positive(self, yes: Self, no: Self) -> Self;
    /// Quotient, 0 where the divisor is 0.
    fn over_or_zero(self, divisor: Self) -> Self;
}

/// Tables, and functions that are known in `f64` alone.
pub trait Functions: Copy + Default {
    /// Whether functions known in `f64` only can be called (see [`call`](Functions::call)).
    const CALLS: bool;
    /// Whether operations are recorded, to be carried out later, in the order in which they are written.
    const RECORDS: bool = !Self::CALLS;

    /// Start and cubic of the interval of a table that this number is in: `breaks` ascend, interval i has row i, the
    /// first and the last one extend beyond the table.
    fn interval(self, breaks: &[f64], rows: &[[f64; 4]]) -> (Self, [Self; 4]);
    /// Number `place` of those that are given from outside, beside the arguments; now it is `x`. A recording reads it from
    /// its inputs.
    fn given(place: usize, x: f64) -> Self;
    /// A value outside [low, high] that this number has, if there is one. A recording has no values and returns none.
    fn outside(self, low: f64, high: f64) -> Option<f64>;
    /// A function that is known in `f64` alone: `memory` is memory for plain arguments, grown once.
    ///
    /// Exact for values. A derivative is approximated by central differences along its own direction, with two more
    /// calls: error about 1e-10 of the size of the function for arguments of the given sizes; none is computed where
    /// the arguments are constants. Types that cannot call (see [`CALLS`](Functions::CALLS)) return NaN.
    fn call<const N: usize, E>(
        at: Arguments<Self>,
        memory: &mut Vec<f64>,
        mut f: impl FnMut(f64, &[f64], &[f64]) -> Result<[f64; N], E>,
    ) -> Result<[Self; N], E> {
        let mut out = [Self::default(); N];
        Self::call_into(at, memory, &mut out, |t, q, v, out| {
            out.copy_from_slice(&f(t, q, v)?);
            Ok(())
        })?;
        Ok(out)
    }
    /// [`call`](Functions::call) of a function with as many values as its last argument holds.
    fn call_into<E>(
        at: Arguments<Self>,
        memory: &mut Vec<f64>,
        out: &mut [Self],
        f: impl FnMut(f64, &[f64], &[f64], &mut [f64]) -> Result<(), E>,
    ) -> Result<(), E>;
}

/// A [`Scalar`] with a value that can be compared: comparisons use the value only, so that every branch is taken as it
/// would be with `f64`.
pub trait Real: Scalar + PartialOrd {
    /// The value, without derivatives.
    fn value(self) -> f64;
}

/// Interval of a table: the last one that begins at or before x.
#[inline]
fn interval_of(x: f64, breaks: &[f64], count: usize) -> usize {
    breaks.partition_point(|b| *b <= x).clamp(1, count) - 1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: f64, b: f64) {
        assert!((a - b).abs() <= 1e-13 * (1.0 + b.abs()), "{a} is not {b}");
    }

    /// Every elementary operation once, over any scalar.
    fn mixture<S: Scalar>(x: S) -> S {
        let (s, c) = (x * x).sin_cos();
        let mut y = (s + S::from_f64(2.0)).sqrt() / (c.scale(0.5) - S::from_f64(3.0));
        y += x.abs();
        y -= s.atan2(c + S::one());
        y *= -x;
        y += s.hypot(c.scale(2.0)) + (x.scale(3.0)).round() * x + x.abs().power(1.5);
        y += s.max(c) - x.min(s) * c.where_positive(x, s);
        let (start, [a, b, c, d]) = x.interval(&TABLE.0, &TABLE.1);
        let z = x - start;
        y += ((a * z + b) * z + c) * z + d;
        (y + S::zero()).over_or_zero(x + S::from_f64(5.0)) + y.over_or_zero(S::zero())
    }

    /// A table that is smooth neither in value nor in slope.
    const TABLE: ([f64; 4], [[f64; 4]; 3]) =
        ([-2.0, -0.5, 0.7, 2.0], [[0.1, 0.2, -0.3, 0.4], [1.0, -2.0, 3.0, -4.0], [-0.2, 0.3, 0.5, 0.0]]);

    #[test]
    fn derivatives_match_closed_forms() {
        let mut random = fastrand::Rng::with_seed(1);
        for _ in 0..100 {
            let x = 0.1 + 2.0 * random.f64();
            let d = Dual::variable(x);
            close((d * d * d).eps[0], 3.0 * x * x);
            close((Dual::one() / d).eps[0], -1.0 / (x * x));
            close(d.sqrt().eps[0], 0.5 / x.sqrt());
            close(d.power(2.5).eps[0], 2.5 * x * x.sqrt());
            close(d.sin_cos().0.eps[0], x.cos());
            close(d.sin_cos().1.eps[0], -x.sin());
            close(d.atan2(Dual::one()).eps[0], 1.0 / (1.0 + x * x));
            close(Dual::one().atan2(d).eps[0], -1.0 / (1.0 + x * x));
            close((-d).abs().eps[0], 1.0);
            close(d.scale(-3.0).eps[0], -3.0);
        }
    }

    #[test]
    fn angle_of_sine_and_cosine_has_unit_slope() {
        let (s, c) = Dual::variable(2.5).sin_cos();
        let angle = s.atan2(c);
        close(angle.re, 2.5);
        close(angle.eps[0], 1.0);
    }

    #[test]
    fn value_of_a_dual_is_the_plain_value_and_slope_the_difference_quotient() {
        let mut random = fastrand::Rng::with_seed(2);
        let mut edges = 0;
        for _ in 0..100 {
            let x = 4.0 * random.f64() - 2.0;
            let y = mixture(Dual::variable(x));
            assert_eq!(y.value(), mixture(x));
            let h = 1e-6;
            // where the table, a round or a choice has an edge there is no quotient
            let smooth = |f: &dyn Fn(f64) -> f64| (f(x + h) - 2.0 * f(x) + f(x - h)).abs() < 1e-9;
            if !smooth(&mixture) {
                edges += 1;
                continue;
            }
            let quotient = (mixture(x + h) - mixture(x - h)) / (2.0 * h);
            assert!((y.eps[0] - quotient).abs() < 1e-7 * (1.0 + quotient.abs()));
        }
        assert!(edges < 5);
    }

    #[test]
    fn lanes_are_single_numbers_to_the_bit() {
        let mut random = fastrand::Rng::with_seed(3);
        for _ in 0..50 {
            let x = Lanes::from_fn(|_| 4.0 * random.f64() - 2.0);
            let y = mixture(x);
            for i in 0..Lanes::COUNT {
                assert_eq!(y.0[i].to_bits(), mixture(x.0[i]).to_bits());
            }
        }
    }

    #[test]
    fn a_recording_gives_what_f64_gives_to_the_bit() {
        let mut random = fastrand::Rng::with_seed(4);
        let made =
            Recording::new(2, |x| Ok::<_, ()>(vec![mixture(x[0]), x[1] / x[0], Recorder::from_f64(7.0)])).unwrap();
        assert_eq!((made.inputs(), made.outputs()), (2, 3));
        let (mut work, mut out) = (vec![0.0; made.len()], [0.0; 3]);
        for _ in 0..50 {
            let x = [4.0 * random.f64() - 2.0, random.f64()];
            made.evaluate(&x, &mut work, &mut out);
            assert_eq!(out[0].to_bits(), mixture(x[0]).to_bits());
            assert_eq!(out[1..], [x[1] / x[0], 7.0]);
        }
        assert_eq!(Recording::new(1, |_| Err(5)).unwrap_err(), 5);
    }

    #[test]
    fn a_number_that_outlives_its_recording_is_nan() {
        let mut kept = Recorder::zero();
        let made = Recording::new(1, |x| {
            kept = x[0];
            Ok::<_, ()>(vec![x[0]])
        });
        assert!(made.is_ok());
        let other = Recording::new(1, |x| Ok::<_, ()>(vec![x[0] + kept, kept])).unwrap();
        let (mut work, mut out) = (vec![0.0; other.len()], [0.0; 2]);
        other.evaluate(&[1.0], &mut work, &mut out);
        assert!(out.iter().all(|x| x.is_nan()));
    }

    /// f(t, q, v) = t² q₀ sin v₀, and its second output.
    fn opaque<S: Scalar>(t: S, q: S, v: S, calls: &mut usize) -> [S; 2] {
        let at = Arguments { t, q: &[q], v: &[v], q_sizes: &[1.0], v_sizes: &[1.0] };
        S::call(at, &mut Vec::new(), |t, q, v| {
            *calls += 1;
            Ok::<_, ()>([t * t * q[0] * v[0].sin(), q[0]])
        })
        .unwrap()
    }

    #[test]
    fn functions_known_in_f64_are_called_for_every_scalar() {
        let calls = &mut 0;
        let plain = opaque(2.0, 0.3, 0.7, calls);
        assert_eq!(*calls, 1);
        let d: [Dual; 2] = opaque(Dual::constant(2.0), Dual::constant(0.3), Dual::constant(0.7), calls);
        assert_eq!((*calls, d[0].re, d[0].eps[0]), (2, plain[0], 0.0));
        let d = opaque(Dual::new(2.0, [0.5]), Dual::new(0.3, [-3.0]), Dual::new(0.7, [100.0]), calls);
        assert_eq!((*calls, d[0].re), (5, plain[0]));
        let (s, c) = 0.7_f64.sin_cos();
        let exact = 2.0 * 2.0 * 0.5 * 0.3 * s + 4.0 * -3.0 * s + 4.0 * 0.3 * c * 100.0;
        // what the documentation of `call` promises, of the largest slope
        assert!((d[0].eps[0] - exact).abs() < 1e-9 * 100.0, "{:e}", d[0].eps[0] - exact);
        let lanes = opaque(Lanes::from_f64(2.0), Lanes::from_f64(0.3), Lanes::from_f64(0.7), calls);
        assert_eq!((*calls, lanes[0].0), (13, [plain[0]; 8]));
    }

    #[test]
    fn rounding_in_line_is_that_of_f64() {
        let mut random = fastrand::Rng::with_seed(5);
        let ends = [0.0, 0.5, 0.5 - f64::EPSILON / 4.0, 1.5, 2.5, 2147483646.5, 2147483647.5, 1e18, f64::INFINITY];
        let drawn = (0..1000).map(|_| 1e3 * (random.f64() - 0.5)).collect::<Vec<_>>();
        for x in ends.into_iter().flat_map(|x| [x, -x]).chain(drawn) {
            assert_eq!(Cases::round(x).to_bits(), f64::round(x).to_bits(), "{x}");
        }
        assert!(Cases::round(f64::NAN).is_nan());
    }

    #[test]
    fn several_directions_are_single_ones_to_the_bit() {
        let mut random = fastrand::Rng::with_seed(6);
        for _ in 0..50 {
            let x = 4.0 * random.f64() - 2.0;
            let along: [f64; 3] = std::array::from_fn(|_| random.f64() - 0.5);
            let (y, called) = (
                mixture(Dual::new(x, along)),
                opaque(Dual::new(x, along), Dual::new(0.3, along), Dual::new(x, [0.0; 3]), &mut 0),
            );
            for i in 0..3 {
                let one = mixture(Dual::new(x, [along[i]]));
                assert_eq!((y.re.to_bits(), y.eps[i].to_bits()), (one.re.to_bits(), one.eps[0].to_bits()));
                let one = opaque(Dual::new(x, [along[i]]), Dual::new(0.3, [along[i]]), Dual::new(x, [0.0]), &mut 0);
                assert_eq!(called[0].eps[i].to_bits(), one[0].eps[0].to_bits());
            }
        }
    }

    #[test]
    fn constants_have_no_slope_even_where_the_root_is_steep() {
        assert_eq!(Dual::<1>::constant(0.0).sqrt().eps, [0.0]);
        assert_eq!((Dual::variable(0.0).power(1.0).eps[0], Dual::variable(0.0).power(1.5).eps[0]), (1.0, 0.0));
        assert!(Dual::new(1.0, [5.0]) < Dual::new(2.0, [-5.0]));
    }
}
