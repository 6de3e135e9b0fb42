//! Sines, cosines and angles of eight numbers, with the bits of the scalar functions.
//!
//! The steps are those of the scalar functions for arguments of moderate size, both sides of each case computed and one
//! selected. Where an argument of the eight needs more (a larger number, a remainder next to the end of its octant, a zero), all eight
//! are computed one by one.

use crate::scalar::Scalar;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

type Eight = [f64; 8];

/// Largest argument that is reduced here. Scale: rad. Reason: below 2²⁰ π/2 the scalar function reduces with the same
/// constants.
const LARGEST: f64 = 1e6;
/// Largest remainder of an argument. Scale: rad. Reason: above it, next to π/4, the scalar function may count another
/// octant.
const LARGEST_REMAINDER: f64 = 0.785;
/// Smallest remainder of an argument. Scale: fraction of the argument. Reason: below it the scalar function takes a second
/// step of reduction.
const SMALLEST_REMAINDER: f64 = 1.0 / (1 << 15) as f64;
/// Below it the sine is its argument, sign of zero included. Scale: rad. Reason: the next term of the series is below
/// rounding.
const SINE_IS_ARGUMENT: f64 = 1e-8;
/// Rounds to whole numbers when added and subtracted. Unit: 1. Reason: the last bits of the sum are those of the number.
const WHOLE: f64 = 1.5 / f64::EPSILON;
/// Quarter turns in a radian. Unit: 1/rad. Reason: the bits of the scalar function.
const TWO_OVER_PI: f64 = f64::from_bits(0x3FE4_5F30_6DC9_C883);
/// The first 33 bits of π/2, and the rest. Unit: rad. Reason: their products with whole numbers are exact.
const HALF_PI: [f64; 2] = [f64::from_bits(0x3FF9_21FB_5440_0000), f64::from_bits(0x3DD0_B461_1A62_6331)];
/// Coefficients of the sine between −π/4 and π/4. Unit: 1. Reason: those of the scalar function (FreeBSD's `k_sin.c`).
const SINE: [f64; 6] = [
    -0.16666666666666632,
    0.00833333333332249,
    -0.0001984126982985795,
    2.7557313707070068e-06,
    -2.5050760253406863e-08,
    1.58969099521155e-10,
];
/// Coefficients of the cosine between −π/4 and π/4. Unit: 1. Reason: those of the scalar function (FreeBSD's `k_cos.c`).
const COSINE: [f64; 6] = [
    0.0416666666666666,
    -0.001388888888887411,
    2.480158728947673e-05,
    -2.7557314351390663e-07,
    2.087572321298175e-09,
    -1.1359647557788195e-11,
];
/// Angles whose tangents are 0.5, 1, 1.5 and infinite, to a number each. Unit: rad. Reason: those of the scalar function
/// (FreeBSD's `s_atan.c`).
const ANGLES: [f64; 4] = [0.4636476090008061, FRAC_PI_4, 0.982793723247329, FRAC_PI_2];
/// The rest of these angles. Unit: rad. Reason: those of the scalar function (FreeBSD's `s_atan.c`).
const ANGLE_RESTS: [f64; 4] =
    [2.2698777452961687e-17, 3.061616997868383e-17, 1.3903311031230998e-17, 6.123233995736766e-17];
/// Coefficients of the angle of a small tangent. Unit: 1. Reason: those of the scalar function (FreeBSD's `s_atan.c`).
const ANGLE: [f64; 11] = [
    0.3333333333333293,
    -0.19999999999876483,
    0.14285714272503466,
    -0.11111110405462356,
    0.09090887133436507,
    -0.0769187620504483,
    0.06661073137387531,
    -0.058335701337905735,
    0.049768779946159324,
    -0.036531572744216916,
    0.016285820115365782,
];
/// Tangents at which the next of these angles is taken off. Scale: tangent. Reason: those of the scalar function.
const ENDS: [f64; 4] = [0.4375, 0.6875, 1.1875, 2.4375];
/// π less the nearest number. Unit: rad. Reason: the bits of the scalar function.
const PI_REST: f64 = f64::from_bits(0x3CA1_A626_3314_5C07);
/// Bounds of quotients that are computed here. Scale: tangent. Reason: beyond them the scalar function returns limits.
const QUOTIENTS: [f64; 2] = [1e-15, 1e15];
/// Bounds of the parts of quotients. Scale: 1. Reason: no quotient of theirs overflows or underflows.
const PARTS: [f64; 2] = [1e-100, 1e100];
/// From here on all numbers are whole. Scale: 1. Reason: the last bit of such a number is 1.
const ALL_WHOLE: f64 = 1.0 / f64::EPSILON;

/// Whether this argument is reduced as below, and its sine and cosine.
#[inline(always)]
fn reduced(x: f64) -> (bool, f64, f64) {
    let size = x.abs();
    let counted = x * TWO_OVER_PI + WHOLE;
    let n = counted - WHOLE;
    let (r, w) = (x - n * HALF_PI[0], n * HALF_PI[1]);
    let y = r - w;
    let rest = (r - y) - w;
    let first = n == 0.0;
    let usual = (size < LARGEST) & (first | (y.abs() >= SMALLEST_REMAINDER * size)) & (y.abs() <= LARGEST_REMAINDER);
    let z = y * y;
    let z2 = z * z;
    let p = SINE[1] + z * (SINE[2] + z * SINE[3]) + z * z2 * (SINE[4] + z * SINE[5]);
    let v = z * y;
    let alone = y + v * (SINE[0] + z * p);
    let alone = if size < SINE_IS_ARGUMENT { x } else { alone };
    let with_rest = y - ((z * (0.5 * rest - v * p) - rest) - v * SINE[0]);
    let sine = if first { alone } else { with_rest };
    let p = z * (COSINE[0] + z * (COSINE[1] + z * COSINE[2])) + z2 * z2 * (COSINE[3] + z * (COSINE[4] + z * COSINE[5]));
    let half = 0.5 * z;
    let w = 1.0 - half;
    let cosine = w + (((1.0 - w) - half) + (z * p - y * rest));
    let quadrant = counted.to_bits();
    let odd = quadrant & 1 == 1;
    let (s, c) = (if odd { cosine } else { sine }, if odd { sine } else { cosine });
    let signed = |x: f64, quadrant: u64| f64::from_bits(x.to_bits() ^ ((quadrant & 2) << 62));
    (usual, signed(s, quadrant), signed(c, quadrant.wrapping_add(1)))
}

/// Sines and cosines.
#[inline(always)]
pub(super) fn sin_cos(x: &Eight) -> (Eight, Eight) {
    let (mut s, mut c, mut usual) = ([0.0; 8], [0.0; 8], true);
    for i in 0..8 {
        let found = reduced(x[i]);
        usual &= found.0;
        (s[i], c[i]) = (found.1, found.2);
    }
    if usual {
        (s, c)
    } else {
        one_by_one(x)
    }
}

#[cold]
#[inline(never)]
fn one_by_one(x: &Eight) -> (Eight, Eight) {
    let found = x.map(Scalar::sin_cos);
    (found.map(|x| x.0), found.map(|x| x.1))
}

/// Whether this angle is found as below, and the angle.
#[inline(always)]
fn angle(y: f64, x: f64) -> (bool, f64) {
    let t = (y / x).abs();
    let usual = (x.abs() > PARTS[0])
        & (x.abs() < PARTS[1])
        & (y.abs() > PARTS[0])
        & (y.abs() < PARTS[1])
        & (t > QUOTIENTS[0])
        & (t < QUOTIENTS[1]);
    let [second, third, fourth, fifth] = ENDS.map(|end| t >= end);
    let choice = |a: f64, b: f64, c: f64, d: f64, e: f64| {
        let x = if second { b } else { a };
        let x = if third { c } else { x };
        let x = if fourth { d } else { x };
        if fifth {
            e
        } else {
            x
        }
    };
    let above = choice(t, 2.0 * t - 1.0, t - 1.0, t - 1.5, -1.0);
    let below = choice(1.0, 2.0 + t, t + 1.0, 1.0 + 1.5 * t, t);
    let high = choice(0.0, ANGLES[0], ANGLES[1], ANGLES[2], ANGLES[3]);
    let low = choice(0.0, ANGLE_RESTS[0], ANGLE_RESTS[1], ANGLE_RESTS[2], ANGLE_RESTS[3]);
    let u = above / below;
    let z = u * u;
    let w = z * z;
    let a = &ANGLE;
    let s1 = z * (a[0] + w * (a[2] + w * (a[4] + w * (a[6] + w * (a[8] + w * a[10])))));
    let s2 = w * (a[1] + w * (a[3] + w * (a[5] + w * (a[7] + w * a[9]))));
    let p = u * (s1 + s2);
    let found = if second { high - (p - low - u) } else { u - p };
    let found = if x < 0.0 { PI - (found - PI_REST) } else { found };
    (usual, found.copysign(y))
}

/// Angles of the points (x, y).
#[inline(always)]
pub(super) fn atan2(y: &Eight, x: &Eight) -> Eight {
    let (mut out, mut usual) = ([0.0; 8], true);
    for i in 0..8 {
        let found = angle(y[i], x[i]);
        usual &= found.0;
        out[i] = found.1;
    }
    if usual {
        out
    } else {
        angles_one_by_one(y, x)
    }
}

#[cold]
#[inline(never)]
fn angles_one_by_one(y: &Eight, x: &Eight) -> Eight {
    std::array::from_fn(|i| Scalar::atan2(y[i], x[i]))
}

/// The nearest whole number, halves away from zero.
#[inline(always)]
pub(super) fn round(x: f64) -> f64 {
    let size = x.abs();
    let even = (size + ALL_WHOLE) - ALL_WHOLE;
    let half = 0.5;
    let whole = if size - even >= half { even + 1.0 } else { even };
    let whole = if size < ALL_WHOLE { whole } else { size };
    whole.copysign(x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::{Cases, Lanes};

    /// Arguments of every size, and those next to multiples of π/4.
    fn arguments(random: &mut fastrand::Rng) -> f64 {
        let sign = if random.bool() { 1.0 } else { -1.0 };
        sign * match random.u32(0..6) {
            0 => random.f64(),
            1 => 10.0 * random.f64(),
            2 => 10f64.powf(24.0 * random.f64() - 12.0),
            3 => f64::from(random.u32(0..40)) * PI / 4.0 + 10f64.powf(-16.0 * random.f64()) * (random.f64() - 0.5),
            4 => [0.0, 0.5, 1.0, PI, PI / 2.0, f64::INFINITY, f64::NAN, f64::MIN_POSITIVE][random.usize(0..8)],
            _ => 1e3 * random.f64(),
        }
    }

    fn same(a: f64, b: f64) -> bool {
        a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan())
    }

    #[test]
    fn each_lane_has_the_bits_of_the_scalar_function() {
        let mut random = fastrand::Rng::with_seed(1);
        let mut together = 0;
        for round in 0..200_000 {
            // half of the rounds draw what all lanes compute together
            let mut draw = || match round % 2 {
                0 => arguments(&mut random),
                _ => 20.0 * (random.f64() - 0.5),
            };
            let (x, y) = (Lanes::from_fn(|_| draw()), Lanes::from_fn(|_| draw()));
            together += u32::from(x.0.iter().all(|x| reduced(*x).0));
            let ((s, c), a, r) = (x.sin_cos(), y.atan2(x), x.round());
            for i in 0..8 {
                let (x, y) = (x.0[i], y.0[i]);
                let expected = Scalar::sin_cos(x);
                assert!(same(s.0[i], expected.0) && same(c.0[i], expected.1), "sine and cosine of {x:e}");
                assert!(same(a.0[i], Scalar::atan2(y, x)), "angle of {y:e}, {x:e}");
                assert!(same(r.0[i], Cases::round(x)), "{x:e} rounded");
            }
        }
        assert!(together > 90_000, "{together}");
    }
}
