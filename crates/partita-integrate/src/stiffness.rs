//! Whether the steps of an explicit method are limited by the fastest of what it integrates, not by the motion.
//!
//! ```text
//! fastest   spectral radius of A, by powers of A
//! motion    |A w| / |w|,   w = (1 − τ A)⁻² x'      what changes within τ, a few steps, is rounding and errors, no motion,
//!           0 where τ |w| is within the tolerance
//! ```

use partita_math::dense::{dot, lu, lu_solve};
use partita_math::formatted;
use partita_system::linear_rates::LinearRates;
use partita_system::sparse_rates::{RealShift, SparseRates};

/// Powers of A. Unit: number. Reason: with a pair of complex eigenvalues the growth of single ones varies.
const POWERS: usize = 24;
/// What changes within this time is no motion. Scale: multiples of the step. Reason: ten times shorter than what is worth
/// changing the method for.
const SMOOTHED: f64 = 10.0;
/// An explicit step is limited by the fastest rate beyond this. Scale: multiples of its reciprocal. Reason: a third of what
/// the methods here are stable with at best, as steps vary.
const LIMITED: f64 = 2.0;
/// Fastest rate over that of the motion. Scale: ratio. Reason: implicit steps of a twentieth of the motion's time cost about as
/// much as explicit ones, so that less gains nothing.
const STIFF: f64 = 30.0;

/// Steps within which the motion changes less are not limited by it. Scale: multiples of the reciprocal of its rate. Reason:
/// the tightest tolerances need a quarter.
const CRAWLING: f64 = 0.02;
/// They are by what is stiff if that changes at least as much. Scale: as `LIMITED`. Reason: a twentieth of it; first steps are
/// shorter for want of knowledge.
const CRAWLING_BESIDE: f64 = 0.1;
/// An explicit step is far from that limit below this. Scale: as `LIMITED`. Reason: a quarter of it.
const FAR: f64 = 0.5;
/// An explicit step would be stable below this. Scale: as `LIMITED`. Reason: three quarters of it, so that methods do not change
/// to and fro.
const ALLOWED: f64 = 1.5;

/// The rates at a state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Stiffness {
    /// The fastest [1/s].
    pub(crate) fastest: f64,
    /// That of the motion [1/s].
    pub(crate) motion: f64,
}

fn norm(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |m: f64, x| m.max(x.abs()))
}

/// A in units of sizes: its products, and solutions with 1 − τ A.
enum Scaled<'a> {
    /// Formed, and its factors.
    Dense { a: Vec<f64>, factors: Vec<f64>, order: Vec<usize> },
    /// Not formed.
    Sparse(Box<Unformed<'a>>),
}

/// Sparse equations in place of A, and their factors.
struct Unformed<'a> {
    of: &'a SparseRates,
    times: Box<Product<'a>>,
    factors: RealShift,
    tau: f64,
    /// x, with displacements that no loop allows, and A x.
    x: Vec<f64>,
    product: Vec<f64>,
}

/// x ↦ A x.
type Product<'a> = dyn FnMut(&[f64], &mut [f64]) + 'a;

impl<'a> Scaled<'a> {
    fn new(linear: &'a LinearRates, own: &[f64], tau: f64) -> Option<Self> {
        let n = linear.count;
        if let Some(of) = linear.unformed() {
            let mut factors = RealShift::default();
            factors.factor(of, 1.0 / tau).ok()?;
            let (times, x, product) = (Box::new(of.products()?), vec![0.0; linear.width()], vec![0.0; n]);
            return Some(Self::Sparse(Box::new(Unformed { of, times, factors, tau, x, product })));
        }
        let mut a = linear.a.clone();
        a.iter_mut().enumerate().for_each(|(e, x)| *x *= own[e % n] / own[e / n]);
        let mut factors: Vec<f64> = a.iter().map(|x| -tau * x).collect();
        (0..n).for_each(|i| factors[i * n + i] += 1.0);
        let mut order = vec![0; n];
        lu(&mut factors, n, &mut order).ok()?;
        Some(Self::Dense { a, factors, order })
    }

    /// A x.
    fn times(&mut self, own: &[f64], x: &[f64]) -> Vec<f64> {
        match self {
            Self::Dense { a, .. } => a.chunks_exact(x.len().max(1)).map(|row| dot(row, x)).collect(),
            Self::Sparse(a) => {
                a.x.iter_mut().zip(x.iter().zip(own)).for_each(|(to, (x, s))| *to = x * s);
                (a.times)(&a.x[..x.len()], &mut a.product);
                a.product.iter().zip(own).map(|(x, s)| x / s).collect()
            }
        }
    }

    /// `x ← (1 − τ A)⁻¹ x`.
    fn solve(&mut self, own: &[f64], x: &mut [f64]) {
        match self {
            Self::Dense { factors, order, .. } => lu_solve(factors, x.len(), order, x),
            Self::Sparse(a) => {
                a.x.fill(0.0);
                a.x.iter_mut().zip(x.iter().zip(own)).for_each(|(to, (x, s))| *to = x * s / a.tau);
                a.factors.solve(a.of, &mut a.x);
                x.iter_mut().zip(a.x.iter().zip(own)).for_each(|(x, (y, s))| *x = y / s);
            }
        }
    }
}

impl Stiffness {
    /// Where the rates are dy, for steps of length h; `sizes` are those of the components, and the tolerance
    /// is in them. None where it cannot be told.
    pub(crate) fn of(linear: &LinearRates, (sizes, tolerance): (&[f64], f64), dy: &[f64], h: f64) -> Option<Self> {
        let (n, tau) = (linear.count, SMOOTHED * h.abs());
        let own = linear.sizes(sizes);
        let mut matrix = Scaled::new(linear, &own, tau)?;
        let mut x: Vec<f64> = (0..n).map(|i| 1.0 + 0.37 * ((i * i) % 5) as f64).collect();
        let (mut growth, mut counted) = (0.0, 0.0);
        for i in 0..POWERS {
            let next = matrix.times(&own, &x);
            let size = norm(&next);
            if size == 0.0 {
                return Some(Self { fastest: 0.0, motion: 0.0 });
            }
            // the first powers turn x into the fastest
            if i >= POWERS / 2 {
                growth += (size / norm(&x)).ln();
                counted += 1.0;
            }
            x = next.into_iter().map(|x| x / size).collect();
        }
        let fastest = f64::exp(growth / counted);
        let mut w = vec![0.0; linear.width()];
        linear.select(dy, &mut w);
        w.truncate(n);
        w.iter_mut().zip(&own).for_each(|(w, s)| *w /= s);
        matrix.solve(&own, &mut w);
        matrix.solve(&own, &mut w);
        let size = norm(&w);
        let motion = if tau * size > tolerance { norm(&matrix.times(&own, &w)) / size } else { 0.0 };
        (fastest.is_finite() && motion.is_finite()).then_some(Self { fastest, motion })
    }

    /// Whether it, not the motion, limits explicit steps of length h: by stability, or because its rounding hides the errors.
    pub(crate) fn limits(&self, h: f64) -> bool {
        let h = h.abs();
        let crawls = h * self.motion < CRAWLING && h * self.fastest > CRAWLING_BESIDE;
        self.fastest > STIFF * self.motion && (h * self.fastest > LIMITED || crawls)
    }

    /// Whether explicit steps of length h come nowhere near.
    pub(crate) fn is_far(&self, h: f64) -> bool {
        h.abs() * self.fastest < FAR
    }

    /// Whether explicit steps of length h would be stable.
    pub(crate) fn allows(&self, h: f64) -> bool {
        h.abs() * self.fastest < ALLOWED
    }

    /// In words.
    pub(crate) fn words(&self) -> String {
        format!(
            "forces change at up to {} per second, the motion at {}",
            formatted(rounded(self.fastest)),
            formatted(rounded(self.motion))
        )
    }
}

/// To two digits.
fn rounded(x: f64) -> f64 {
    format!("{x:.1e}").parse().unwrap_or(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A spring of frequency w and damping ratio d, and a slow one.
    fn springs(w: f64, d: f64) -> LinearRates {
        let a = vec![
            0.0,
            0.0,
            1.0,
            0.0, //
            0.0,
            0.0,
            0.0,
            1.0, //
            -w * w,
            0.0,
            -2.0 * d * w,
            0.0, //
            0.0,
            -9.0,
            0.0,
            0.0,
        ];
        LinearRates { count: 4, a, ..LinearRates::default() }
    }

    #[test]
    fn the_fastest_rate_is_found_whether_it_swings_or_creeps() {
        for (w, d, expected) in [(1e4, 0.1, 1e4), (1e4, 0.8, 1e4), (1e3, 50.0, 1e5)] {
            let found = Stiffness::of(&springs(w, d), (&[1.0; 4], 1e-8), &[0.0, 0.3, 0.0, -1.0], 1e-4).unwrap();
            assert!((found.fastest / expected - 1.0).abs() < 0.5, "{w} {d} {found:?}");
            assert!(found.motion > 2.0 && found.motion < 10.0, "{found:?}");
            assert!(found.limits(1e-3) && !found.limits(1e-6));
        }
    }

    #[test]
    fn a_fast_motion_is_not_stiff() {
        let found = Stiffness::of(&springs(300.0, 0.0), (&[1.0; 4], 1e-8), &[1.0, 0.0, 300.0, 0.0], 1e-4).unwrap();
        assert!(!found.limits(0.01) && found.motion > 100.0, "{found:?}");
    }

    #[test]
    fn errors_of_what_is_stiff_do_not_count_as_motion() {
        let slopes = [1e-7, 0.3, 1e-2, -1.0];
        let found = Stiffness::of(&springs(1e5, 5.0), (&[1.0; 4], 1e-8), &slopes, 5e-6).unwrap();
        assert!(found.motion < 50.0, "{found:?}");
    }

    #[test]
    fn what_rests_up_to_rounding_does_not_move() {
        let found = Stiffness::of(&springs(1e5, 5.0), (&[1.0; 4], 1e-8), &[1e-12, -1e-12, 1e-7, 1e-9], 5e-6).unwrap();
        assert!(found.motion == 0.0 && found.limits(5e-5), "{found:?}");
    }
}
