//! The collective choice P5 with characteristic displacements ℓ_i instead of |k_i|: how many of its own large
//! displacements a coordinate makes, for a given kinetic energy of the mechanism.
//!
//! For comparison: the mobility with the loops opened plays no part, so that of positions and angles it prefers angles,
//! and keeps those of cranks. It is unit-free as the displacements are. With one degree of freedom masses do not
//! matter, since they scale all measures alike.

use super::{criterion, normalised_determinant};

/// The choice from `Dᵀ` (n x k), the Cholesky factor of `M_d` and the displacements ℓ (n); see [`criterion::choose`].
pub fn choose(dt: &[f64], k: usize, md_factor: &[f64], displacement: &[f64], weights: Option<&[f64]>) -> Vec<usize> {
    let squares: Vec<f64> = displacement.iter().map(|x| x * x).collect();
    criterion::choose(dt, k, md_factor, &squares, weights)
}

/// The volume of `next` over that of `now`, whose Dᵀ is given, in these displacements, preferences included.
pub fn ratio(dt: &[f64], now: &[usize], displacement: &[f64], weights: Option<&[f64]>, next: &[usize]) -> f64 {
    normalised_determinant::ratio(dt, now, displacement, weights, next)
}
