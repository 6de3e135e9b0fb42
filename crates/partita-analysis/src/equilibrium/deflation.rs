//! Positions that are known are moved out of the way of a search.
//!
//! ```text
//! η(z) = Π (1 + 1/|z − z_i|²)      η h_d = 0  has the zeros of h_d without z_i
//! K_d dz = h_d   →   dz / (1 − (ln η)' dz)
//! ```
//!
//! Newton's method on η h_d takes steps along those of h_d, of another length: away from a known position that they
//! would go to.

use partita_system::ConstrainedSystem;
use std::f64::consts::TAU;

/// Displacement (nv, in characteristic displacements) from one position to another: angles without whole turns after
/// which all forces are the same again, spatial rotations as their rotation vector in axes of the body.
pub fn displacement_between<S: ConstrainedSystem>(system: &S, from: &[f64], to: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; system.size().nv];
    let mut i = 0;
    while i < out.len() {
        let own = system.structure().coordinates_of(i);
        if own.len() == 1 {
            let mut by = to[own.start] - from[own.start];
            if system.structure().coordinates[own.start].repeats {
                by -= TAU * (by / TAU).round();
            }
            out[i] = by / system.structure().displacement(i);
            i += 1;
            continue;
        }
        let (a, b) = (&from[own.clone()], &to[own]);
        let real: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
        let (w, sign) = (real.abs(), real.signum());
        let vector = [(1, 2, 3), (2, 3, 1), (3, 1, 2)]
            .map(|(x, y, z)| sign * (a[0] * b[x] - a[x] * b[0] - a[y] * b[z] + a[z] * b[y]));
        let sine = vector.iter().map(|x| x * x).sum::<f64>().sqrt();
        // both signs of a quaternion are one rotation
        let factor = if sine > 0.0 { 2.0 * sine.atan2(w) / sine } else { 2.0 };
        for (j, x) in vector.iter().enumerate() {
            out[i + j] = factor * x / system.structure().displacement(i + j);
        }
        i += 3;
    }
    out
}

/// η at q, and (ln η)' along the displacement `by` (nv, in characteristic displacements).
pub(super) fn deflation<S: ConstrainedSystem>(system: &S, q: &[f64], known: &[Vec<f64>], by: &[f64]) -> (f64, f64) {
    let (mut eta, mut slope) = (1.0, 0.0);
    for one in known {
        let from = displacement_between(system, one, q);
        let square: f64 = from.iter().map(|x| x * x).sum();
        let along: f64 = from.iter().zip(by).map(|(x, y)| x * y).sum();
        eta *= 1.0 + 1.0 / square;
        slope -= 2.0 * along / (square * (1.0 + square));
    }
    (eta, slope)
}
