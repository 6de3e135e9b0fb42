//! Eight numbers side by side.

mod functions;

use super::{interval_of, Arguments, Cases, Functions, Scalar};
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

/// Eight independent numbers: one run through a function gives eight evaluations, each identical to that of `f64`, to
/// the bit.
///
/// Plain loops over an array, which a compiler may turn into vector instructions.
#[derive(Copy, Clone, Debug, Default, PartialEq)]
#[repr(C, align(64))]
pub struct Lanes(pub [f64; Lanes::COUNT]);

impl Lanes {
    /// Number of lanes.
    pub const COUNT: usize = 8;

    /// Lane i from `f(i)`.
    #[inline(always)]
    pub fn from_fn(mut f: impl FnMut(usize) -> f64) -> Self {
        let mut found = Self::default();
        for (i, x) in found.0.iter_mut().enumerate() {
            *x = f(i);
        }
        found
    }

    #[inline(always)]
    fn map(mut self, f: impl Fn(f64) -> f64) -> Self {
        for x in &mut self.0 {
            *x = f(*x);
        }
        self
    }

    #[inline(always)]
    fn with(mut self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        for (x, y) in self.0.iter_mut().zip(&other.0) {
            *x = f(*x, *y);
        }
        self
    }
}

impl Add for Lanes {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.with(other, |x, y| x + y)
    }
}

impl Sub for Lanes {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.with(other, |x, y| x - y)
    }
}

impl Mul for Lanes {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.with(other, |x, y| x * y)
    }
}

impl Div for Lanes {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self.with(other, |x, y| x / y)
    }
}

impl Neg for Lanes {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.map(|x| -x)
    }
}

impl AddAssign for Lanes {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl SubAssign for Lanes {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

impl MulAssign for Lanes {
    #[inline(always)]
    fn mul_assign(&mut self, other: Self) {
        *self = *self * other;
    }
}

impl Scalar for Lanes {
    #[inline(always)]
    fn from_f64(x: f64) -> Self {
        Self([x; Self::COUNT])
    }
    #[inline(always)]
    fn zero() -> Self {
        Self::from_f64(0.0)
    }
    #[inline(always)]
    fn one() -> Self {
        Self::from_f64(1.0)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        self.map(f64::sqrt)
    }
    #[inline(always)]
    fn power(self, exponent: f64) -> Self {
        self.map(|x| x.power(exponent))
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (s, c) = functions::sin_cos(&self.0);
        (Self(s), Self(c))
    }
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        Self(functions::atan2(&self.0, &x.0))
    }
    #[inline(always)]
    fn hypot(self, other: Self) -> Self {
        self.with(other, f64::hypot)
    }
    #[inline(always)]
    fn scale(self, factor: f64) -> Self {
        self.map(|x| x * factor)
    }
}

impl Cases for Lanes {
    #[inline(always)]
    fn abs(self) -> Self {
        self.map(f64::abs)
    }
    #[inline(always)]
    fn round(self) -> Self {
        self.map(functions::round)
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.with(other, f64::max)
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.with(other, f64::min)
    }
    #[inline(always)]
    fn where_positive(self, yes: Self, no: Self) -> Self {
        Self::from_fn(|i| self.0[i].where_positive(yes.0[i], no.0[i]))
    }
    #[inline(always)]
    fn over_or_zero(self, divisor: Self) -> Self {
        self.with(divisor, f64::over_or_zero)
    }
}

impl Functions for Lanes {
    const CALLS: bool = true;
    fn interval(self, breaks: &[f64], rows: &[[f64; 4]]) -> (Self, [Self; 4]) {
        let at = self.0.map(|x| interval_of(x, breaks, rows.len()));
        (Self(at.map(|i| breaks[i])), std::array::from_fn(|k| Self(at.map(|i| rows[i][k]))))
    }
    fn given(_: usize, x: f64) -> Self {
        Self::from_f64(x)
    }
    fn outside(self, low: f64, high: f64) -> Option<f64> {
        self.0.iter().find_map(|x| x.outside(low, high))
    }
    /// Eight calls.
    fn call_into<E>(
        at: Arguments<Self>,
        memory: &mut Vec<f64>,
        out: &mut [Self],
        mut f: impl FnMut(f64, &[f64], &[f64], &mut [f64]) -> Result<(), E>,
    ) -> Result<(), E> {
        let (n, m) = (at.q.len(), at.q.len() + at.v.len());
        memory.resize(m + out.len(), 0.0);
        let (given, values) = memory.split_at_mut(m);
        for lane in 0..Self::COUNT {
            for (x, y) in given.iter_mut().zip(at.q.iter().chain(at.v)) {
                *x = y.0[lane];
            }
            f(at.t.0[lane], &given[..n], &given[n..], values)?;
            for (out, x) in out.iter_mut().zip(values.iter()) {
                out.0[lane] = *x;
            }
        }
        Ok(())
    }
}
