//! The switch rule P6: the growth of the volume of the choice when a dependent coordinate replaces an independent one.

use partita_math::tolerance;

/// One possible switch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoordinateSwitch {
    /// Position in the list of dependent velocities of the one that would enter.
    pub enters: usize,
    /// Position in the list of independent velocities of the one that would leave.
    pub leaves: usize,
    /// Factor on the volume, `|A_ij| s_j / s_i`.
    pub gain: f64,
}

/// The best switch for `A` (r x k), the scales `s` of all velocities and the lists D and I.
///
/// Cost: r k comparisons, no factorisation: `A` is available from P1. The first of equal candidates is taken.
pub fn best(a: &[f64], s: &[f64], dependent: &[usize], independent: &[usize]) -> Option<CoordinateSwitch> {
    let k = independent.len();
    let mut best: Option<CoordinateSwitch> = None;
    for (p, &i) in dependent.iter().enumerate() {
        for (j, &c) in independent.iter().enumerate() {
            let gain = a[p * k + j].abs() * s[c] / s[i];
            if best.is_none_or(|b| gain > b.gain * (1.0 + tolerance::TIE)) {
                best = Some(CoordinateSwitch { enters: p, leaves: j, gain });
            }
        }
    }
    best
}
