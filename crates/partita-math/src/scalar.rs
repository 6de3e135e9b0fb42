//! Numbers the recursions are written over: plain `f64`, and [`Dual`] numbers that carry a derivative along.
//!
//! A recursion written once over [`Scalar`] gives values with `f64` and exact directional derivatives with [`Dual`].

use std::cmp::Ordering;
use std::fmt::Debug;
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

/// A real number, possibly with more than its value inside.
///
/// Implementers promise that [`value`](Scalar::value) of any result is what `f64` would have given, and that comparisons
/// look at the value only, so that every branch is taken as it would be with `f64`.
pub trait Scalar:
    Copy
    + Clone
    + Default
    + PartialOrd
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
    /// The value, without what else is carried.
    fn value(self) -> f64;
    /// The constant 0.
    fn zero() -> Self;
    /// The constant 1.
    fn one() -> Self;
    /// Square root; at 0 the derivative is infinite.
    fn sqrt(self) -> Self;
    /// Sine and cosine of an angle in radians.
    fn sin_cos(self) -> (Self, Self);
    /// Angle of the point (`x`, `self`) in radians, above −π and up to π.
    fn atan2(self, x: Self) -> Self;
    /// Absolute value; at 0 it follows the sign bit.
    fn abs(self) -> Self;
    /// Product with a constant; cheaper than promoting the constant.
    fn scale(self, factor: f64) -> Self;
}

impl Scalar for f64 {
    #[inline(always)]
    fn from_f64(x: f64) -> Self {
        x
    }
    #[inline(always)]
    fn value(self) -> f64 {
        self
    }
    #[inline(always)]
    fn zero() -> Self {
        0.0
    }
    #[inline(always)]
    fn one() -> Self {
        1.0
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        f64::sin_cos(self)
    }
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        f64::atan2(self, x)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        f64::abs(self)
    }
    #[inline(always)]
    fn scale(self, factor: f64) -> Self {
        self * factor
    }
}

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

/// Compares values only, as [`Scalar`] asks.
impl PartialEq for Dual {
    #[inline(always)]
    fn eq(&self, other: &Self) -> bool {
        self.re == other.re
    }
}

/// Compares values only, as [`Scalar`] asks.
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
    fn value(self) -> f64 {
        self.re
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
    fn sin_cos(self) -> (Self, Self) {
        let (s, c) = self.re.sin_cos();
        (Self::new(s, c * self.eps), Self::new(c, -s * self.eps))
    }
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        let square = self.re * self.re + x.re * x.re;
        Self::new(self.re.atan2(x.re), (x.re * self.eps - self.re * x.eps) / square)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        if self.re.is_sign_negative() {
            -self
        } else {
            self
        }
    }
    #[inline(always)]
    fn scale(self, factor: f64) -> Self {
        Self::new(self.re * factor, self.eps * factor)
    }
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
        y + S::zero()
    }

    #[test]
    fn derivatives_match_closed_forms() {
        let mut random = fastrand::Rng::with_seed(1);
        for _ in 0..100 {
            let x = 0.1 + 2.0 * random.f64();
            let d = Dual::variable(x);
            close((d * d * d).eps, 3.0 * x * x);
            close((Dual::one() / d).eps, -1.0 / (x * x));
            close(d.sqrt().eps, 0.5 / x.sqrt());
            close(d.sin_cos().0.eps, x.cos());
            close(d.sin_cos().1.eps, -x.sin());
            close(d.atan2(Dual::one()).eps, 1.0 / (1.0 + x * x));
            close(Dual::one().atan2(d).eps, -1.0 / (1.0 + x * x));
            close((-d).abs().eps, 1.0);
            close(d.scale(-3.0).eps, -3.0);
        }
    }

    #[test]
    fn angle_of_sine_and_cosine_has_unit_slope() {
        let (s, c) = Dual::variable(2.5).sin_cos();
        let angle = s.atan2(c);
        close(angle.re, 2.5);
        close(angle.eps, 1.0);
    }

    #[test]
    fn value_of_a_dual_is_the_plain_value_and_slope_the_difference_quotient() {
        let mut random = fastrand::Rng::with_seed(2);
        for _ in 0..100 {
            let x = 4.0 * random.f64() - 2.0;
            let y = mixture(Dual::variable(x));
            assert_eq!(y.value(), mixture(x));
            let h = 1e-6;
            let quotient = (mixture(x + h) - mixture(x - h)) / (2.0 * h);
            assert!((y.eps - quotient).abs() < 1e-7 * (1.0 + quotient.abs()));
        }
    }

    #[test]
    fn constants_have_no_slope_even_where_the_root_is_steep() {
        assert_eq!(Dual::constant(0.0).sqrt().eps, 0.0);
        assert!(Dual::new(1.0, 5.0) < Dual::new(2.0, -5.0));
    }
}
