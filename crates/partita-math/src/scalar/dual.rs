//! A value with a derivative.

use super::{interval_of, Arguments, Cases, Functions, Real, Scalar};
use std::cmp::Ordering;
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

/// A value with its derivative in one direction: `re + eps ε` with `ε² = 0`.
///
/// Seed the direction with [`Dual::variable`], run any function written over [`Scalar`], read the derivative from `eps`.
/// Exact to rounding; costs about three times the plain evaluation.
#[derive(Copy, Clone, Debug, Default)]
pub struct Dual {
    /// The value.
    pub re: f64,
    /// The derivative along the seeded direction.
    pub eps: f64,
}

impl Dual {
    /// A value with a given derivative.
    #[inline(always)]
    pub const fn new(re: f64, eps: f64) -> Self {
        Self { re, eps }
    }

    /// The quantity that is differentiated with respect to: derivative 1.
    #[inline(always)]
    pub const fn variable(re: f64) -> Self {
        Self { re, eps: 1.0 }
    }

    /// A constant: derivative 0.
    #[inline(always)]
    pub const fn constant(re: f64) -> Self {
        Self { re, eps: 0.0 }
    }
}

/// Compares values only, as [`Real`] requires.
impl PartialEq for Dual {
    #[inline(always)]
    fn eq(&self, other: &Self) -> bool {
        self.re == other.re
    }
}

/// Compares values only, as [`Real`] requires.
impl PartialOrd for Dual {
    #[inline(always)]
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        self.re.partial_cmp(&other.re)
    }
}

impl Add for Dual {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self::new(self.re + other.re, self.eps + other.eps)
    }
}

impl Sub for Dual {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self::new(self.re - other.re, self.eps - other.eps)
    }
}

impl Mul for Dual {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self::new(self.re * other.re, self.eps * other.re + self.re * other.eps)
    }
}

impl Div for Dual {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        let re = self.re / other.re;
        Self::new(re, (self.eps - re * other.eps) / other.re)
    }
}

impl Neg for Dual {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self::new(-self.re, -self.eps)
    }
}

impl AddAssign for Dual {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl SubAssign for Dual {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

impl MulAssign for Dual {
    #[inline(always)]
    fn mul_assign(&mut self, other: Self) {
        *self = *self * other;
    }
}

impl Scalar for Dual {
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
    #[inline(always)]
    fn sqrt(self) -> Self {
        let root = self.re.sqrt();
        // A constant stays a constant, also at 0 where the slope is infinite.
        let eps = if self.eps == 0.0 { 0.0 } else { 0.5 * self.eps / root };
        Self::new(root, eps)
    }
    #[inline(always)]
    fn power(self, exponent: f64) -> Self {
        let slope = exponent * self.re.power(exponent - 1.0);
        Self::new(self.re.power(exponent), slope * self.eps)
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (s, c) = Scalar::sin_cos(self.re);
        (Self::new(s, c * self.eps), Self::new(c, -s * self.eps))
    }
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        let square = self.re * self.re + x.re * x.re;
        Self::new(Scalar::atan2(self.re, x.re), (x.re * self.eps - self.re * x.eps) / square)
    }
    #[inline(always)]
    fn hypot(self, other: Self) -> Self {
        let length = self.re.hypot(other.re);
        let along = self.re * self.eps + other.re * other.eps;
        // As for the root: constants, and points that stay at 0 to the first order.
        Self::new(length, if along == 0.0 { 0.0 } else { along / length })
    }
    #[inline(always)]
    fn scale(self, factor: f64) -> Self {
        Self::new(self.re * factor, self.eps * factor)
    }
}

impl Cases for Dual {
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
    #[inline(always)]
    fn over_or_zero(self, divisor: Self) -> Self {
        if divisor.re == 0.0 {
            Self::zero()
        } else {
            self / divisor
        }
    }
}

impl Functions for Dual {
    const CALLS: bool = true;
    fn interval(self, breaks: &[f64], rows: &[[f64; 4]]) -> (Self, [Self; 4]) {
        let i = interval_of(self.re, breaks, rows.len());
        (Self::constant(breaks[i]), rows[i].map(Self::constant))
    }
    fn outside(self, low: f64, high: f64) -> Option<f64> {
        self.re.outside(low, high)
    }
    fn call_into<E>(
        at: Arguments<Self>,
        room: &mut Vec<f64>,
        out: &mut [Self],
        mut f: impl FnMut(f64, &[f64], &[f64], &mut [f64]) -> Result<(), E>,
    ) -> Result<(), E> {
        let (n, m) = (at.q.len(), at.q.len() + at.v.len());
        room.resize(m + 2 * out.len(), 0.0);
        let (given, values) = room.split_at_mut(m);
        let (ahead, behind) = values.split_at_mut(out.len());
        let mut shifted = |h: f64, values: &mut [f64]| {
            for (x, d) in given.iter_mut().zip(at.q.iter().chain(at.v)) {
                *x = d.re + h * d.eps;
            }
            f(at.t.re + h * at.t.eps, &given[..n], &given[n..], values)
        };
        shifted(0.0, ahead)?;
        out.iter_mut().zip(ahead.iter()).for_each(|(out, x)| *out = Self::constant(*x));
        // largest speed of an argument, each against its size
        let speed = |x: &[Self], sizes: &[f64]| {
            let sizes = sizes.iter().copied().chain(std::iter::repeat(1.0));
            x.iter().zip(sizes).fold(0.0, |m: f64, (x, s)| m.max(x.eps.abs() / s.max(x.re.abs())))
        };
        let fastest =
            (at.t.eps.abs() / at.t.re.abs().max(1.0)).max(speed(at.q, at.q_sizes)).max(speed(at.v, at.v_sizes));
        if fastest == 0.0 {
            return Ok(());
        }
        // where the errors of a central difference meet: h² of the third derivative, ε/h of round-off
        let h = f64::EPSILON.cbrt() / fastest;
        shifted(h, ahead)?;
        shifted(-h, behind)?;
        for (out, (x, y)) in out.iter_mut().zip(ahead.iter().zip(behind.iter())) {
            out.eps = (x - y) / (2.0 * h);
        }
        Ok(())
    }
}

impl Real for Dual {
    #[inline(always)]
    fn value(self) -> f64 {
        self.re
    }
}
