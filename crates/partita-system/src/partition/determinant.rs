//! The determinant rule: the largest |det C_D| in the units given.
//!
//! For comparison. The result depends on metres or millimetres, radians or degrees: rescaling a coordinate by f
//! multiplies the determinant of every partition in which it is dependent by 1/f. Its unit-free replacement is the
//! [normalised determinant](super::normalised_determinant). (Argued against by Blajer, Schiehlen, Schirm 1994.)

use super::volume::{self, Largest};

/// The choice from `Dᵀ` (n x k) of the admissible partition `independent`, with scales `s` for the arithmetic only.
/// Cost and exactness: [`volume::largest`].
pub fn choose(dt: &[f64], independent: &[usize], s: &[f64]) -> Largest {
    let bias: Vec<f64> = s.iter().map(|s| s.ln()).collect();
    volume::largest(&volume::natural(dt, independent, s), &bias, independent)
}

/// `|det C_D'| / |det C_D|` in the units given, of the partition `next` relative to `independent`, whose Dᵀ is given.
pub fn ratio(dt: &[f64], independent: &[usize], s: &[f64], next: &[usize]) -> f64 {
    let units = |which: &[usize]| which.iter().map(|&i| s[i].ln()).sum::<f64>();
    let natural = volume::log_minor(&volume::natural(dt, independent, s), next);
    (natural + units(next) - units(independent)).exp()
}
