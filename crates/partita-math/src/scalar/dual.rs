//! A value with derivatives.

use super::{interval_of, Arguments, Cases, Functions, Real, Scalar};
use std::cmp::Ordering;
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

/// A value with its derivatives in N directions: `re + Σ eps_i ε_i` with `ε_i ε_j = 0`.
///
/// Seed the directions with [`Dual::new`], run any function written over [`Scalar`], read the derivatives from `eps`.
/// Exact to rounding; one direction costs about three times the plain evaluation, eight at once far less than eight
/// times as much.
///
/// Its operations are calls: written out at every place they would be a third of the library, for derivatives that no
/// run evaluates.
#[derive(Copy, Clone, Debug)]
pub struct Dual<const N: usize = 1> {
    /// The value.
    pub re: f64,
    /// The derivatives along the seeded directions.
    pub eps: [f64; N],
}

impl<const N: usize> Default for Dual<N> {
    fn default() -> Self {
        Self::constant(0.0)
    }
}

impl Dual {
    /// The quantity that is differentiated with respect to: derivative 1.
    #[inline(always)]
    pub const fn variable(re: f64) -> Self {
        Self { re, eps: [1.0] }
    }
}

impl<const N: usize> Dual<N> {
    /// A value with given derivatives.
    #[inline(always)]
    pub const fn new(re: f64, eps: [f64; N]) -> Self {
        Self { re, eps }
    }

    /// A constant: derivatives 0.
    #[inline(always)]
    pub const fn constant(re: f64) -> Self {
        Self { re, eps: [0.0; N] }
    }

    /// A value whose derivatives are a times those of the one and b times those of the other.
    #[inline(always)]
    fn combined(re: f64, (a, one): (f64, &Self), (b, other): (f64, &Self)) -> Self {
        Self::of(re, |i| one.eps[i] * a + b * other.eps[i])
    }

    /// The same value, its derivatives divided.
    #[inline(always)]
    fn slopes_over(self, divisor: f64) -> Self {
        Self::of(self.re, |i| self.eps[i] / divisor)
    }

    /// A value whose derivatives are computed one by one.
    #[inline(always)]
    fn of(re: f64, eps: impl Fn(usize) -> f64) -> Self {
        Self { re, eps: std::array::from_fn(eps) }
    }
}

/// Compares values only, as [`Real`] requires.
impl<const N: usize> PartialEq for Dual<N> {
    #[inline(always)]
    fn eq(&self, other: &Self) -> bool {
        self.re == other.re
    }
}

/// Compares values only, as [`Real`] requires.
impl<const N: usize> PartialOrd for Dual<N> {
    #[inline(always)]
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        self.re.partial_cmp(&other.re)
    }
}

impl<const N: usize> Add for Dual<N> {
    type Output = Self;
    #[inline(never)]
    fn add(self, other: Self) -> Self {
        Self::of(self.re + other.re, |i| self.eps[i] + other.eps[i])
    }
}

impl<const N: usize> Sub for Dual<N> {
    type Output = Self;
    #[inline(never)]
    fn sub(self, other: Self) -> Self {
        Self::of(self.re - other.re, |i| self.eps[i] - other.eps[i])
    }
}

impl<const N: usize> Mul for Dual<N> {
    type Output = Self;
    #[inline(never)]
    fn mul(self, other: Self) -> Self {
        Self::combined(self.re * other.re, (other.re, &self), (self.re, &other))
    }
}

impl<const N: usize> Div for Dual<N> {
    type Output = Self;
    #[inline(never)]
    fn div(self, other: Self) -> Self {
        let re = self.re / other.re;
        Self::combined(re, (1.0, &self), (-re, &other)).slopes_over(other.re)
    }
}

impl<const N: usize> Neg for Dual<N> {
    type Output = Self;
    #[inline(never)]
    fn neg(self) -> Self {
        Self::of(-self.re, |i| -self.eps[i])
    }
}

impl<const N: usize> AddAssign for Dual<N> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<const N: usize> SubAssign for Dual<N> {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

impl<const N: usize> MulAssign for Dual<N> {
    #[inline(always)]
    fn mul_assign(&mut self, other: Self) {
        *self = *self * other;
    }
}

impl<const N: usize> Scalar for Dual<N> {
    #[inline(always)]
    fn from_f64(x: f64) -> Self {
        Self::constant(x)
    }
    #[inline(always)]
    fn zero() -> Self {
        Self::constant(0.0)
    }
    #[inline(always)]
    fn one() -> Self {
        Self::constant(1.0)
    }
    #[inline(never)]
    fn sqrt(self) -> Self {
        let root = self.re.sqrt();
        // A constant stays a constant, also at 0 where the slope is infinite.
        Self::of(root, |i| if self.eps[i] == 0.0 { 0.0 } else { 0.5 * self.eps[i] / root })
    }
    #[inline(never)]
    fn power(self, exponent: f64) -> Self {
        let slope = exponent * self.re.power(exponent - 1.0);
        Self::of(self.re.power(exponent), |i| slope * self.eps[i])
    }
    #[inline(never)]
    fn sin_cos(self) -> (Self, Self) {
        let (s, c) = Scalar::sin_cos(self.re);
        (Self::of(s, |i| c * self.eps[i]), Self::of(c, |i| -s * self.eps[i]))
    }
    #[inline(never)]
    fn atan2(self, x: Self) -> Self {
        let square = self.re * self.re + x.re * x.re;
        Self::of(Scalar::atan2(self.re, x.re), |i| (x.re * self.eps[i] - self.re * x.eps[i]) / square)
    }
    #[inline(never)]
    fn hypot(self, other: Self) -> Self {
        let length = self.re.hypot(other.re);
        Self::of(length, |i| {
            let along = self.re * self.eps[i] + other.re * other.eps[i];
            // As for the root: constants, and points that stay at 0 to the first order.
            if along == 0.0 {
                0.0
            } else {
                along / length
            }
        })
    }
    #[inline(never)]
    fn scale(self, factor: f64) -> Self {
        Self::of(self.re * factor, |i| self.eps[i] * factor)
    }
}

impl<const N: usize> Cases for Dual<N> {
    #[inline(always)]
    fn abs(self) -> Self {
        if self.re.is_sign_negative() {
            -self
        } else {
            self
        }
    }
    #[inline(always)]
    fn round(self) -> Self {
        Self::constant(self.re.round())
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        // If one is NaN the other is taken, as in `f64`.
        if other.re > self.re || self.re.is_nan() {
            other
        } else {
            self
        }
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        if other.re < self.re || self.re.is_nan() {
            other
        } else {
            self
        }
    }
    #[inline(always)]
    fn where_positive(self, yes: Self, no: Self) -> Self {
        if self.re > 0.0 {
            yes
        } else {
            no
        }
    }
    #[inline(never)]
    fn over_or_zero(self, divisor: Self) -> Self {
        if divisor.re == 0.0 {
            Self::zero()
        } else {
            self / divisor
        }
    }
}

impl<const N: usize> Functions for Dual<N> {
    const CALLS: bool = true;
    fn interval(self, breaks: &[f64], rows: &[[f64; 4]]) -> (Self, [Self; 4]) {
        let i = interval_of(self.re, breaks, rows.len());
        (Self::constant(breaks[i]), rows[i].map(Self::constant))
    }
    fn given(_: usize, x: f64) -> Self {
        Self::constant(x)
    }
    fn outside(self, low: f64, high: f64) -> Option<f64> {
        self.re.outside(low, high)
    }
    fn call_into<E>(
        at: Arguments<Self>,
        memory: &mut Vec<f64>,
        out: &mut [Self],
        mut f: impl FnMut(f64, &[f64], &[f64], &mut [f64]) -> Result<(), E>,
    ) -> Result<(), E> {
        let (n, m) = (at.q.len(), at.q.len() + at.v.len());
        memory.resize(m + 2 * out.len(), 0.0);
        let (given, values) = memory.split_at_mut(m);
        let (ahead, behind) = values.split_at_mut(out.len());
        let mut shifted = |i: usize, h: f64, values: &mut [f64]| {
            for (x, d) in given.iter_mut().zip(at.q.iter().chain(at.v)) {
                *x = d.re + h * d.eps[i];
            }
            f(at.t.re + h * at.t.eps[i], &given[..n], &given[n..], values)
        };
        shifted(0, 0.0, ahead)?;
        out.iter_mut().zip(ahead.iter()).for_each(|(out, x)| *out = Self::constant(*x));
        // largest speed of an argument, each against its size
        let speed = |i: usize, x: &[Self], sizes: &[f64]| {
            let sizes = sizes.iter().copied().chain(std::iter::repeat(1.0));
            x.iter().zip(sizes).fold(0.0, |m: f64, (x, s)| m.max(x.eps[i].abs() / s.max(x.re.abs())))
        };
        for i in 0..N {
            let of_time = at.t.eps[i].abs() / at.t.re.abs().max(1.0);
            let fastest = of_time.max(speed(i, at.q, at.q_sizes)).max(speed(i, at.v, at.v_sizes));
            if fastest == 0.0 {
                continue;
            }
            // where the errors of a central difference meet: h² of the third derivative, ε/h of round-off
            let h = f64::EPSILON.cbrt() / fastest;
            shifted(i, h, ahead)?;
            shifted(i, -h, behind)?;
            for (out, (x, y)) in out.iter_mut().zip(ahead.iter().zip(behind.iter())) {
                out.eps[i] = (x - y) / (2.0 * h);
            }
        }
        Ok(())
    }
}

impl<const N: usize> Real for Dual<N> {
    #[inline(always)]
    fn value(self) -> f64 {
        self.re
    }
}
