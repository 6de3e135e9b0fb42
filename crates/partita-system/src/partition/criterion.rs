//! The projective measure P4 and the collective choice P5.
//!
//! `k_i`, the gradient of coordinate i, has the squared length `[M⁻¹]_ii` in the mass metric; the part of it that lies
//! in the tangent space has `[Dᵀ M_d⁻¹ D]_ii`. Their ratio ρ² is dimensionless: it is the mobility of the coordinate
//! with the loops closed, relative to the loops opened. (Blajer, Schiehlen, Schirm 1994.)

use partita_math::dense::{self, Matrix};
use partita_math::factor;
use partita_math::tolerance;

/// `ρ_i` from the tangent side (21): needs `Dᵀ` (n x k), the Cholesky factor of `M_d` and `s_i² = [M⁻¹]_ii`.
///
/// Cost: n k²/2. `work` holds k numbers.
pub fn measure_tangent(dt: &[f64], k: usize, md_factor: &[f64], s2: &[f64], work: &mut [f64], rho: &mut [f64]) {
    for (i, r) in rho.iter_mut().enumerate() {
        let y = &mut work[..k];
        y.copy_from_slice(&dt[i * k..(i + 1) * k]);
        dense::cholesky_forward(md_factor, k, y);
        // rounding can raise a fully mobile coordinate slightly above 1
        *r = (dense::dot(y, y) / s2[i]).sqrt().min(1.0);
    }
}

/// `ρ_i` from the constraint side (20): needs only M and C (independent rows), before any choice.
///
/// `ρ_i² = 1 − [M⁻¹ Cᵀ (C M⁻¹ Cᵀ)⁻¹ C M⁻¹]_ii / [M⁻¹]_ii`. Dense; returns `None` when M or C M⁻¹ Cᵀ is not positive
/// definite.
pub fn measure_constraint(mass: &Matrix, c: &Matrix) -> Option<Vec<f64>> {
    let (n, m) = (mass.rows(), c.rows());
    let mut l = mass.data().to_vec();
    dense::cholesky(&mut l, n).ok()?;
    let mut minv = vec![0.0; n * n];
    dense::inverse_from_cholesky(&l, n, &mut minv);
    let minv = Matrix::from_vec(n, n, minv);
    let w = c.matmul(&minv); // C M⁻¹
    let mut mc = w.matmul(&c.transpose()).into_vec(); // M_c
    dense::cholesky(&mut mc, m).ok()?;
    let mut column = vec![0.0; m];
    Some(
        (0..n)
            .map(|i| {
                for r in 0..m {
                    column[r] = w[(r, i)];
                }
                dense::cholesky_forward(&mc, m, &mut column);
                (1.0 - dense::dot(&column, &column) / minv[(i, i)]).max(0.0).sqrt()
            })
            .collect(),
    )
}

/// The collective choice P5: Cholesky with diagonal pivoting of `W_ij = [Dᵀ M_d⁻¹ D]_ij / (s_i s_j)`, done on its
/// factor B (25), column by column.
///
/// The first pivot is the criterion itself; each next one is the criterion with the coordinates already chosen locked.
/// `weights` (preferences of the user) multiply ρ. Ties go to the lower index. Returns the k velocities, ascending.
/// Cost: n k².
pub fn choose(dt: &[f64], k: usize, md_factor: &[f64], s2: &[f64], weights: Option<&[f64]>) -> Vec<usize> {
    let n = s2.len();
    let mut b = vec![0.0; n * k]; // row i: column b_i of (25)
    let mut left = vec![0.0; n]; // |b_i|² of what the locked directions leave
    for i in 0..n {
        let y = &mut b[i * k..(i + 1) * k];
        y.copy_from_slice(&dt[i * k..(i + 1) * k]);
        dense::cholesky_forward(md_factor, k, y);
        let scale = weights.map_or(1.0, |w| w[i]) / s2[i].sqrt();
        y.iter_mut().for_each(|x| *x *= scale);
        left[i] = dense::dot(y, y);
    }
    let mut chosen = Vec::with_capacity(k);
    let mut u = vec![0.0; k];
    for _ in 0..k {
        // ties within round-off go to the lower index, so that units cannot decide them
        let best = (0..n).filter(|i| !chosen.contains(i)).fold(None, |best: Option<usize>, i| match best {
            Some(b) if left[i] <= left[b] * (1.0 + tolerance::TIE) => Some(b),
            _ => Some(i),
        });
        let Some(best) = best else { break };
        let norm = left[best].sqrt();
        if norm > 0.0 {
            for (u, x) in u.iter_mut().zip(&b[best * k..(best + 1) * k]) {
                *u = x / norm;
            }
            for i in 0..n {
                let row = &mut b[i * k..(i + 1) * k];
                let p = dense::dot(row, &u);
                for (x, u) in row.iter_mut().zip(&u) {
                    *x -= p * u;
                }
                left[i] = dense::dot(row, row);
            }
        }
        chosen.push(best);
    }
    chosen.sort_unstable();
    chosen
}

/// The two quality numbers of a partition.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quality {
    /// σ = smallest singular value of B_I (26): conditioning of the reduced equations.
    pub sigma: f64,
    /// √μ (27): smallest principal cosine between the chosen gradients and the tangent space. Errors of everything
    /// computed through the partition are at most 1/√μ times those of the orthogonal counterpart.
    pub sqrt_mu: f64,
}

/// σ and √μ from `M_d` (k x k, not factored), `s²` and the block `[M⁻¹]_II` (k x k).
pub fn quality(md: &[f64], s2_independent: &[f64], inverse_mass_block: &[f64]) -> Quality {
    let k = s2_independent.len();
    if k == 0 {
        return Quality { sigma: 1.0, sqrt_mu: 1.0 };
    }
    if k == 1 {
        let x = 1.0 / (md[0] * s2_independent[0]).sqrt();
        return Quality { sigma: x.min(1.0), sqrt_mu: (1.0 / (md[0] * inverse_mass_block[0]).sqrt()).min(1.0) };
    }
    let largest = |m: Matrix| match factor::symmetric_eigen(&m) {
        Ok((values, _)) => values[k - 1],
        Err(_) => f64::INFINITY,
    };
    // (26): σ⁻² = λ_max(N M_d N)
    let mut scaled = Matrix::new(k, k);
    for i in 0..k {
        for j in 0..k {
            scaled[(i, j)] = md[i * k + j] * (s2_independent[i] * s2_independent[j]).sqrt();
        }
    }
    // (27): μ⁻¹ = λ_max([M⁻¹]_II M_d) = λ_max(Lᵀ M_d L) with [M⁻¹]_II = L Lᵀ
    let mut l = inverse_mass_block.to_vec();
    let sqrt_mu = if dense::cholesky(&mut l, k).is_ok() {
        let lower = Matrix::from_vec(k, k, (0..k * k).map(|x| if x % k <= x / k { l[x] } else { 0.0 }).collect());
        let m = lower.transpose().matmul(&Matrix::from_vec(k, k, md.to_vec())).matmul(&lower);
        (1.0 / largest(m).sqrt()).min(1.0)
    } else {
        0.0
    };
    Quality { sigma: (1.0 / largest(scaled).sqrt()).min(1.0), sqrt_mu }
}
