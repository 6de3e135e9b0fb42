//! `f64` itself.

use super::{interval_of, Arguments, Cases, Functions, Real, Scalar};

impl Scalar for f64 {
    #[inline(always)]
    fn from_f64(x: f64) -> Self {
        x
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
    fn power(self, exponent: f64) -> Self {
        libm::pow(self, exponent)
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        libm::sincos(self)
    }
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        libm::atan2(self, x)
    }
    #[inline(always)]
    fn hypot(self, other: Self) -> Self {
        f64::hypot(self, other)
    }
    #[inline(always)]
    fn scale(self, factor: f64) -> Self {
        self * factor
    }
}

impl Cases for f64 {
    #[inline(always)]
    fn abs(self) -> Self {
        f64::abs(self)
    }
    /// In line where numbers are small: a call for each angle would take longer than its arithmetic.
    #[inline(always)]
    fn round(self) -> Self {
        let size = f64::abs(self);
        if size < f64::from(i32::MAX) {
            // of its halves, which are exact
            let whole = ((2.0 * size) as i64 + 1) >> 1;
            (whole as f64).copysign(self)
        } else {
            f64::round(self)
        }
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        f64::max(self, other)
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        f64::min(self, other)
    }
    #[inline(always)]
    fn where_positive(self, yes: Self, no: Self) -> Self {
        if self > 0.0 {
            yes
        } else {
            no
        }
    }
    #[inline(always)]
    fn over_or_zero(self, divisor: Self) -> Self {
        if divisor == 0.0 {
            0.0
        } else {
            self / divisor
        }
    }
}

impl Functions for f64 {
    const CALLS: bool = true;
    #[inline]
    fn interval(self, breaks: &[f64], rows: &[[f64; 4]]) -> (Self, [Self; 4]) {
        let i = interval_of(self, breaks, rows.len());
        (breaks[i], rows[i])
    }
    #[inline(always)]
    fn given(_: usize, x: f64) -> Self {
        x
    }
    #[inline(always)]
    fn outside(self, low: f64, high: f64) -> Option<f64> {
        // written so that NaN is outside
        (!(self >= low && self <= high)).then_some(self)
    }
    #[inline(always)]
    fn call_into<E>(
        at: Arguments<Self>,
        _: &mut Vec<f64>,
        out: &mut [Self],
        mut f: impl FnMut(f64, &[f64], &[f64], &mut [f64]) -> Result<(), E>,
    ) -> Result<(), E> {
        f(at.t, at.q, at.v, out)
    }
}

impl Real for f64 {
    #[inline(always)]
    fn value(self) -> f64 {
        self
    }
}
