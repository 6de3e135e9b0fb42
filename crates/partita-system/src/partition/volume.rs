//! Comparison of whole partitions, by |det C_D| in any units.
//!
//! Of two partitions I and I' of one instant, `|det C_D'| / |det C_D| = |det of the rows I' of Dᵀ|` (complementary
//! minors), so every determinant is a k x k minor of what one admissible partition has computed anyway. In natural
//! units, `Dᵀ_ij s_j / s_i`, the minor is the ratio of the normalised determinants (28); other units or preferences are
//! factors of single coordinates, and enter as their logarithms.

use partita_math::dense;
use partita_math::tolerance;

/// Up to this many partitions are all compared: 50 000 minors of a small matrix take some milliseconds.
pub const LARGEST_ENUMERATION: usize = 50_000;

/// A choice with the largest determinant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Largest {
    /// The k velocities, ascending.
    pub independent: Vec<usize>,
    /// Every partition was compared. Otherwise: no single switch increases the determinant.
    pub exact: bool,
}

/// `Dᵀ` (n x k) of the partition `independent` in natural units: `Dᵀ_ij s_j / s_i`, which is Âᵀ above a unit block (31).
pub fn natural(dt: &[f64], independent: &[usize], s: &[f64]) -> Vec<f64> {
    let k = independent.len();
    (0..dt.len()).map(|e| dt[e] * s[independent[e % k]] / s[e / k]).collect()
}

/// `ln |det|` of the rows `which` of a matrix with `which.len()` columns; −∞ where they depend on each other.
/// Cost: k³/3.
pub fn log_minor(rows: &[f64], which: &[usize]) -> f64 {
    let k = which.len();
    let mut block: Vec<f64> = which.iter().flat_map(|&i| &rows[i * k..(i + 1) * k]).copied().collect();
    signed_log(&mut block, k).1
}

/// Sign and `ln |det|` of a k x k block, which is destroyed.
pub fn signed_log(block: &mut [f64], k: usize) -> (f64, f64) {
    let mut pivots = vec![0; k];
    if dense::lu(block, k, &mut pivots).is_err() {
        return (0.0, f64::NEG_INFINITY);
    }
    (0..k).fold((1.0, 0.0), |(sign, sum), i| {
        let x = block[i * k + i];
        let swapped = if pivots[i] == i { 1.0 } else { -1.0 };
        (sign * swapped * x.signum(), sum + x.abs().ln())
    })
}

/// The choice with the largest `|det of its rows| · exp(Σ bias)`, for rows (n x k) in natural units.
///
/// Exact by enumeration as long as C(n, k) ≤ [`LARGEST_ENUMERATION`] (cost C(n, k) k³/3), otherwise by switches from
/// `first` on until none gains (cost n k each): finding the largest of all is then infeasible for every method. Ties go
/// to the lower indices.
pub fn largest(rows: &[f64], bias: &[f64], first: &[usize]) -> Largest {
    let (n, k) = (bias.len(), first.len());
    if partitions(n, k) > LARGEST_ENUMERATION {
        return Largest { independent: by_switches(rows, bias, first), exact: false };
    }
    let mut which: Vec<usize> = (0..k).collect();
    let mut best = (f64::NEG_INFINITY, which.clone());
    loop {
        let value = log_minor(rows, &which) + which.iter().map(|&i| bias[i]).sum::<f64>();
        if value > best.0 + tolerance::TIE || best.0 == f64::NEG_INFINITY && value > best.0 {
            best = (value, which.clone());
        }
        // the next one in lexicographic order
        let Some(index) = (0..k).rev().find(|&p| which[p] < n - k + p) else { break };
        which[index] += 1;
        (index + 1..k).for_each(|p| which[p] = which[p - 1] + 1);
    }
    Largest { independent: best.1, exact: true }
}

/// C(n, k), at most `usize::MAX`.
fn partitions(n: usize, k: usize) -> usize {
    let k = k.min(n - k);
    // C(n, i + 1) = C(n, i) (n − i) / (i + 1), exact at every step
    (0..k).try_fold(1usize, |c, i| c.checked_mul(n - i).map(|c| c / (i + 1))).unwrap_or(usize::MAX)
}

/// The partition that no single switch improves, from `first` on.
fn by_switches(rows: &[f64], bias: &[f64], first: &[usize]) -> Vec<usize> {
    let (n, k) = (bias.len(), first.len());
    let mut chosen = first.to_vec();
    let Some(mut x) = relative_to(rows, &chosen) else { return chosen };
    // every switch multiplies the determinant by more than one, so the loop ends; the bound is for round-off
    for _ in 0..10 * n {
        let mut best = (tolerance::TIE, None);
        for i in (0..n).filter(|i| !chosen.contains(i)) {
            for j in 0..k {
                let gain = x[i * k + j].abs().ln() + bias[i] - bias[chosen[j]];
                if gain > best.0 + tolerance::TIE {
                    best = (gain, Some((i, j)));
                }
            }
        }
        let Some((i, j)) = best.1 else { break };
        pivot(&mut x, k, i, j);
        chosen[j] = i;
    }
    chosen.sort_unstable();
    chosen
}

/// Rows (n x k) relative to the rows `which`: `X = T (T_which)⁻¹`, so that `X_which = 1`. `None` if they are dependent.
/// Cost: k³/3 + n k².
pub fn relative_to(rows: &[f64], which: &[usize]) -> Option<Vec<f64>> {
    let k = which.len();
    let mut block: Vec<f64> = which.iter().flat_map(|&i| &rows[i * k..(i + 1) * k]).copied().collect();
    let mut pivots = vec![0; k];
    dense::lu(&mut block, k, &mut pivots).ok()?;
    let mut out = rows.to_vec();
    // x T_which = t  is  T_whichᵀ xᵀ = tᵀ
    out.chunks_mut(k.max(1)).for_each(|row| dense::lu_solve_transposed(&block, k, &pivots, row));
    Some(out)
}

/// Make row i the unit row j of X (n x k): the principal pivot of a switch.
fn pivot(x: &mut [f64], k: usize, i: usize, j: usize) {
    let with: Vec<f64> = x[i * k..(i + 1) * k].to_vec();
    for row in x.chunks_mut(k) {
        let y = row[j] / with[j];
        for (c, (x, w)) in row.iter_mut().zip(&with).enumerate() {
            *x = if c == j { y } else { *x - y * w };
        }
    }
}
