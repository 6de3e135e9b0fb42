//! Individually: the k coordinates of largest ρ, regardless of their dependence.
//!
//! For comparison. With one degree of freedom it is the projective criterion; with more, two coordinates that measure the
//! same motion may both be large, and then their choice is poor or impossible (a pendulum at 45° beside three coupled
//! carts: both coordinates of the pendulum lead, and nothing drives the carts).

use partita_math::tolerance;

/// The k largest `ρ_i w_i`, ascending; `weights` are preferences. Ties within round-off go to the lower index.
/// Cost: n k.
pub fn choose(rho: &[f64], k: usize, weights: Option<&[f64]>) -> Vec<usize> {
    let score = |i: usize| rho[i] * weights.map_or(1.0, |w| w[i]);
    let mut chosen: Vec<usize> = Vec::with_capacity(k);
    for _ in 0..k {
        let best = (0..rho.len()).filter(|i| !chosen.contains(i)).reduce(|b, i| {
            match score(i) > score(b) * (1.0 + tolerance::TIE) {
                true => i,
                false => b,
            }
        });
        chosen.extend(best);
    }
    chosen.sort_unstable();
    chosen
}

/// By how much `next` is better than `now`: the largest measure that enters over the smallest that leaves; 1 where they
/// are the same. No two choices can each be better than the other by the same threshold above 1.
pub fn ratio(rho: &[f64], weights: Option<&[f64]>, now: &[usize], next: &[usize]) -> f64 {
    let score = |i: &usize| rho[*i] * weights.map_or(1.0, |w| w[*i]);
    let enters = next.iter().filter(|i| !now.contains(i)).map(score).fold(0.0, f64::max);
    let leaves = now.iter().filter(|i| !next.contains(i)).map(score).fold(f64::INFINITY, f64::min);
    match leaves.is_finite() {
        true => enters / leaves,
        false => 1.0,
    }
}
