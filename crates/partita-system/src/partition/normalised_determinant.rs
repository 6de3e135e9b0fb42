//! The normalised determinant (28): `vol² = det(C_D)² / (det M · det M_c · Π_{i∈I} [M⁻¹]_ii)`.
//!
//! The determinant rule made independent of units, of scaling and of the combination of the constraints. For one degree
//! of freedom it is the projective measure itself, vol = ρ. Largest vol and largest σ differ slightly for more.

use super::volume::{self, Largest};

/// The choice from `Dᵀ` (n x k) of the admissible partition `independent` and the scales `s_i = |k_i|` (19);
/// `weights` (preferences of the user) multiply the share of each coordinate. Cost and exactness: [`volume::largest`].
pub fn choose(dt: &[f64], independent: &[usize], s: &[f64], weights: Option<&[f64]>) -> Largest {
    let bias: Vec<f64> = (0..s.len()).map(|i| weights.map_or(0.0, |w| w[i].ln())).collect();
    volume::largest(&volume::natural(dt, independent, s), &bias, independent)
}

/// `vol' / vol` of the partition `next` against `independent`, whose Dᵀ is given, preferences included.
pub fn ratio(dt: &[f64], independent: &[usize], s: &[f64], weights: Option<&[f64]>, next: &[usize]) -> f64 {
    let preference = |which: &[usize]| which.iter().map(|&i| weights.map_or(0.0, |w| w[i].ln())).sum::<f64>();
    let natural = volume::log_minor(&volume::natural(dt, independent, s), next);
    (natural + preference(next) - preference(independent)).exp()
}
