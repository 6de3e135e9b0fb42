//! Identification by least squares: which combinations of parameters a regressor determines, and their values.
//!
//! ```text
//! [Y S | r]  ──►  one triangle for each channel  ──►  singular values without noise: rank, base parameters
//!                                                ──►  weighted by noise: changes, standard deviations
//! ```
//!
//! Y holds the derivatives of what is measured, r what is measured less what is computed, S the natural sizes of the
//! parameters. Triangles hold all that the data say, so that weights may change without a second pass over them.

use crate::error::AnalysisError;
use partita_math::dense::{self, Matrix};
use partita_math::factor::{self, FactorError};
use partita_math::tolerance;

/// Rows that are reduced together.
const BLOCK: usize = 64;
/// Singular values of a regressor above this belong to combinations that are determined. Scale: fraction of the largest.
/// Reason: loops closed to rounding leave 1e-12; a motion that excites a combination as weakly says nothing of it.
const DETERMINED_BY_DATA: f64 = 1e-8;
/// Singular values of a regressor below this are equal zeros. Scale: fraction of the largest. Reason: some tens of
/// roundings.
const ZERO_BY_DATA: f64 = 1e-15;
/// Coefficients of a base parameter below this are zero. Scale: natural sizes. Reason: rounding in the loops over the
/// smallest singular value that is kept.
const COEFFICIENT_ROUNDING: f64 = 1e-6;
/// A parameter is expressed by others only where a combination that is not determined contains this much of it. Scale:
/// fraction of the largest part, natural sizes. Reason: one digit of the coefficients at most is lost.
const LEAST_SHARE: f64 = 0.1;
/// A direction of parameters with a larger standard deviation is drowned by noise. Scale: natural sizes of the
/// parameters. Reason: the data then say less than the order of magnitude of the prior.
const DROWNED_BY_NOISE: f64 = 1.0;
/// Rounds in which weights follow the residuals.
const ROUNDS: usize = 50;
/// Weights that change less have settled. Scale: fraction of a standard deviation. Reason: six digits, more than an
/// estimate from data has.
const SETTLED_WEIGHT: f64 = 1e-6;

/// What is fitted.
#[derive(Clone, Copy, Debug)]
pub struct Data<'a> {
    /// One for each row, channel and parameter; rows with a NaN are left out.
    pub derivatives: &'a [f64],
    /// Measured less computed, one for each row and channel.
    pub residuals: &'a [f64],
    /// Root mean square of what each channel measured.
    pub sizes: &'a [f64],
    /// Standard deviation of the noise of each channel; NaN: from the residuals.
    pub noise: &'a [f64],
    /// Natural size of each parameter.
    pub scales: &'a [f64],
    /// Parameters with larger numbers are expressed by others rather than those with smaller ones.
    pub preference: &'a [f64],
}

/// The answer.
#[derive(Clone, Debug, Default)]
pub struct Fit {
    /// Singular values of the regressor in natural sizes, channels of equal weight, descending.
    pub singular: Vec<f64>,
    /// Number of combinations that are determined without noise.
    pub rank: usize,
    /// Parameters that stand for a combination each.
    pub base: Vec<usize>,
    /// The others.
    pub dependent: Vec<usize>,
    /// Coefficients: base parameter + Σ coefficient × dependent parameter is determined (row by row).
    pub coefficients: Vec<f64>,
    /// Change of each parameter by least squares, shortest in natural sizes; without drowned directions.
    pub changes: Vec<f64>,
    /// Change of each base combination, drowned directions included.
    pub base_changes: Vec<f64>,
    /// Standard deviation of each base combination.
    pub base_deviations: Vec<f64>,
    /// Standard deviation of each parameter; infinite where it is not determined alone.
    pub deviations: Vec<f64>,
    /// Singular directions of the weighted problem, best determined first (rank x parameters), in natural sizes.
    pub directions: Vec<f64>,
    /// Standard deviation along each, in natural sizes.
    pub direction_deviations: Vec<f64>,
    /// How many of the last are drowned.
    pub drowned: usize,
    /// Standard deviation of the noise of each channel, given or from the residuals.
    pub noise: Vec<f64>,
    /// Root mean square of the residuals of each channel.
    pub left: Vec<f64>,
}

/// Upper triangle of `[R; rows]`, in place of R: both have `width` columns.
fn reduce(r: &mut Matrix, rows: &mut [f64]) {
    let width = r.cols();
    let count = rows.len() / width;
    for k in 0..width {
        let below = (0..count).map(|i| rows[i * width + k].powi(2)).sum::<f64>();
        if below == 0.0 {
            continue;
        }
        let head = r[(k, k)];
        let length = (head * head + below).sqrt();
        let alpha = if head > 0.0 { -length } else { length };
        // reflection along (head − alpha, rows)
        let first = head - alpha;
        let half = -alpha * first;
        r[(k, k)] = alpha;
        for j in k + 1..width {
            let mut sum = first * r[(k, j)];
            (0..count).for_each(|i| sum += rows[i * width + k] * rows[i * width + j]);
            let by = sum / half;
            r[(k, j)] -= by * first;
            (0..count).for_each(|i| rows[i * width + j] -= by * rows[i * width + k]);
        }
        (0..count).for_each(|i| rows[i * width + k] = 0.0);
    }
}

/// One triangle of [Y S | r] for each channel, and the rows in each.
fn triangles(data: &Data) -> (Vec<Matrix>, usize) {
    let (m, n) = (data.sizes.len(), data.scales.len());
    let mut triangles = vec![Matrix::new(n + 1, n + 1); m];
    let mut waiting: Vec<Vec<f64>> = vec![Vec::with_capacity(BLOCK * (n + 1)); m];
    let mut count = 0;
    let rows = data.derivatives.chunks_exact((m * n).max(1)).zip(data.residuals.chunks_exact(m.max(1)));
    for (y, r) in rows {
        if y.iter().chain(r).any(|x| !x.is_finite()) {
            continue;
        }
        count += 1;
        for (c, waiting) in waiting.iter_mut().enumerate() {
            waiting.extend(y[c * n..][..n].iter().zip(data.scales).map(|(y, s)| y * s));
            waiting.push(r[c]);
            if waiting.len() == BLOCK * (n + 1) {
                reduce(&mut triangles[c], waiting);
                waiting.clear();
            }
        }
    }
    waiting.iter_mut().zip(&mut triangles).for_each(|(rows, r)| reduce(r, rows));
    (triangles, count)
}

/// Rows of all triangles, each weighted; the first `n` columns.
fn stacked(triangles: &[Matrix], n: usize, weight: impl Fn(usize) -> f64) -> Matrix {
    let rows = triangles.iter().enumerate().flat_map(|(c, r)| {
        let weight = weight(c);
        (0..n + 1).flat_map(move |i| r.row(i)[..n].iter().map(move |x| weight * x))
    });
    Matrix::from_vec(triangles.len() * (n + 1), n, rows.collect())
}

/// How many singular values belong to combinations that are determined: those before the widest gap.
fn rank_of(singular: &[f64]) -> usize {
    let largest = singular.first().copied().unwrap_or(0.0);
    let floor = ZERO_BY_DATA * largest;
    if floor <= 0.0 {
        return 0;
    }
    let ratio = |i: usize| singular[i - 1].max(floor) / singular.get(i).copied().unwrap_or(0.0).max(floor);
    let small = |i: &usize| singular[*i] <= DETERMINED_BY_DATA * largest;
    (1..singular.len())
        .filter(small)
        .max_by(|i, j| ratio(*i).total_cmp(&ratio(*j)).then(j.cmp(i)))
        .unwrap_or(singular.len())
}

/// Parameters that are expressed by the others, one for each combination that is not determined (rows of `null`,
/// orthonormal): of those with a large part in what is left the most preferred, of equal ones that with the largest part,
/// then the first. Parts are lengths in the space of these combinations, so that no basis of it matters.
fn expressed(null: &Matrix, preference: &[f64]) -> Vec<usize> {
    let (count, n) = (null.rows(), null.cols());
    let (mut left, mut chosen) = (null.clone(), Vec::with_capacity(count));
    for _ in 0..count {
        let part = |j: usize| (0..count).map(|i| left[(i, j)].powi(2)).sum::<f64>().sqrt();
        let parts: Vec<f64> = (0..n).map(|j| if chosen.contains(&j) { 0.0 } else { part(j) }).collect();
        let largest = parts.iter().fold(0.0, |m: f64, x| m.max(*x));
        let better = |j: usize, than: usize| {
            let leads = parts[j] > parts[than] * (1.0 + tolerance::TIE);
            preference[j] > preference[than] || (preference[j] == preference[than] && leads)
        };
        let large = (0..n).filter(|j| parts[*j] > 0.0 && parts[*j] >= LEAST_SHARE * largest);
        let Some(j) = large.reduce(|best, j| if better(j, best) { j } else { best }) else { break };
        let along: Vec<f64> = (0..count).map(|i| left[(i, j)] / parts[j]).collect();
        for k in 0..n {
            let by = (0..count).map(|i| along[i] * left[(i, k)]).sum::<f64>();
            (0..count).for_each(|i| left[(i, k)] -= by * along[i]);
        }
        chosen.push(j);
    }
    chosen
}

/// Base parameters, those that are expressed by them, and how: θ_base + Σ coefficient θ_dependent is determined.
fn regrouped(mut null: Matrix, preference: &[f64]) -> (Vec<usize>, Vec<usize>, Matrix) {
    let (count, n) = (null.rows(), null.cols());
    let dependent = expressed(&null, preference);
    for (step, &j) in dependent.iter().enumerate() {
        let largest = (step..count).max_by(|a, b| null[(*a, j)].abs().total_cmp(&null[(*b, j)].abs()));
        let Some(i) = largest else { break };
        for k in 0..n {
            (null[(step, k)], null[(i, k)]) = (null[(i, k)], null[(step, k)]);
        }
        let pivot = null[(step, j)];
        null.row_mut(step).iter_mut().for_each(|x| *x /= pivot);
        let row = null.row(step).to_vec();
        for other in (0..count).filter(|other| *other != step) {
            let by = -null[(other, j)];
            dense::axpy(by, &row, null.row_mut(other));
        }
    }
    let base: Vec<usize> = (0..n).filter(|j| !dependent.contains(j)).collect();
    // Y_b N_b + Y_d = 0 for N_d = 1: Y_d = −Y_b N_b, so that θ_b − N_b θ_d is seen
    let mut coefficients = Matrix::new(base.len(), dependent.len());
    for (b, &i) in base.iter().enumerate() {
        for d in 0..dependent.len() {
            let x = -null[(d, i)];
            coefficients[(b, d)] = if x.abs() > COEFFICIENT_ROUNDING { x } else { 0.0 };
        }
    }
    (base, dependent, coefficients)
}

/// Rank, base parameters, least squares and standard deviations of a regressor.
///
/// # Errors
/// Numbers that are not finite; no row at all.
pub fn fit(data: &Data) -> Result<Fit, AnalysisError> {
    let (m, n) = (data.sizes.len(), data.scales.len());
    let failed = |_: FactorError| AnalysisError::Argument {
        argument: "data",
        message: "the least squares could not be computed: the derivatives are too large".into(),
    };
    let (triangles, count) = triangles(data);
    if count == 0 {
        let message =
            "no instant is left from which efforts follow: at each the motion is singular or not known".into();
        return Err(AnalysisError::Argument { argument: "data", message });
    }
    // without noise, channels of equal weight
    let strength = |c: usize| {
        let squares = (0..n).flat_map(|i| triangles[c].row(i)[..n].iter()).map(|x| x * x).sum::<f64>();
        if squares > 0.0 {
            1.0 / squares.sqrt()
        } else {
            0.0
        }
    };
    let plain = factor::svd_full(&stacked(&triangles, n, strength)).map_err(failed)?;
    let rank = rank_of(&plain.s);
    let v = &plain.v;
    let null = Matrix::from_vec(n - rank, n, (rank..n).flat_map(|j| (0..n).map(move |i| v[(i, j)])).collect());
    let (base, dependent, regrouped) = regrouped(null, data.preference);
    let mut found = Fit { singular: plain.s.clone(), rank, base, dependent, ..Fit::default() };
    if rank == 0 {
        let left = |c: usize| (triangles[c].row(n)[n].powi(2) / count as f64).sqrt();
        found.left = (0..m).map(left).collect();
        found.noise = found.left.clone();
        (found.changes, found.deviations) = (vec![0.0; n], vec![f64::INFINITY; n]);
        return Ok(found);
    }
    // weighted, in the determined space
    let space = Matrix::from_vec(n, rank, (0..n).flat_map(|i| (0..rank).map(move |j| v[(i, j)])).collect());
    let shares: Vec<Matrix> =
        triangles.iter().map(|r| stacked(std::slice::from_ref(r), n, |_| 1.0).matmul(&space)).collect();
    let floor = |c: usize| tolerance::SUM_ROUNDING * data.sizes[c].max(f64::MIN_POSITIVE);
    let given = |c: usize| data.noise[c].is_finite();
    let freedom = (count * m).saturating_sub(rank).max(1) as f64 / (count * m) as f64;
    let mut noise: Vec<f64> =
        (0..m).map(|c| if given(c) { data.noise[c] } else { data.sizes[c].max(floor(c)) }).collect();
    let right = |c: usize, i: usize| triangles[c][(i, n)];
    let mut solution = (Vec::new(), Matrix::new(0, 0), Vec::new());
    for _ in 0..ROUNDS {
        let rows = (0..m).flat_map(|c| shares[c].data().iter().map(move |x| (c, *x)).collect::<Vec<_>>());
        let a = Matrix::from_vec(m * (n + 1), rank, rows.map(|(c, x)| x / noise[c]).collect());
        let parts = factor::svd(&a).map_err(failed)?;
        let b: Vec<f64> =
            (0..m).flat_map(|c| (0..n + 1).map(move |i| (c, i))).map(|(c, i)| right(c, i) / noise[c]).collect();
        let z: Vec<f64> = (0..rank)
            .map(|j| (0..b.len()).map(|i| parts.u[(i, j)] * b[i]).sum::<f64>() / parts.s[j].max(f64::MIN_POSITIVE))
            .collect();
        let change = parts.v.matvec(&z);
        found.left = (0..m)
            .map(|c| {
                let computed = shares[c].matvec(&change);
                let squares = (0..n + 1).map(|i| (right(c, i) - computed[i]).powi(2)).sum::<f64>();
                (squares / count as f64).sqrt()
            })
            .collect();
        solution = (parts.s, parts.v, z);
        let next: Vec<f64> =
            (0..m).map(|c| if given(c) { noise[c] } else { (found.left[c] / freedom.sqrt()).max(floor(c)) }).collect();
        let settled = next.iter().zip(&noise).all(|(x, y)| (x - y).abs() <= SETTLED_WEIGHT * y);
        noise = next;
        if settled {
            break;
        }
    }
    let (strengths, turned, z) = solution;
    let deviations: Vec<f64> = strengths.iter().map(|s| 1.0 / s.max(f64::MIN_POSITIVE)).collect();
    // columns: directions in natural sizes
    let directions = space.matmul(&turned);
    found.drowned = deviations.iter().filter(|x| **x > DROWNED_BY_NOISE).count();
    found.changes = (0..n)
        .map(|i| {
            let kept = (0..rank).filter(|j| deviations[*j] <= DROWNED_BY_NOISE);
            data.scales[i] * kept.map(|j| directions[(i, j)] * z[j]).sum::<f64>()
        })
        .collect();
    let along = |combination: &dyn Fn(usize) -> f64| {
        let part = |j: usize| (0..n).map(|i| combination(i) * directions[(i, j)]).sum::<f64>();
        let parts: Vec<f64> = (0..rank).map(part).collect();
        let variance = parts.iter().zip(&deviations).map(|(x, s)| (x * s).powi(2)).sum::<f64>();
        (dense::dot(&parts, &z), variance.sqrt())
    };
    found.deviations = vec![f64::INFINITY; n];
    for (b, &i) in found.base.iter().enumerate() {
        let coefficient = |j: usize| {
            let other = found.dependent.iter().position(|d| *d == j).map_or(0.0, |d| regrouped[(b, d)]);
            if i == j {
                1.0
            } else {
                other
            }
        };
        let (change, deviation) = along(&coefficient);
        found.base_changes.push(data.scales[i] * change);
        found.base_deviations.push(data.scales[i] * deviation);
        if regrouped.row(b).iter().all(|x| *x == 0.0) {
            found.deviations[i] = data.scales[i] * deviation;
        }
        let per = |(d, x): (usize, &f64)| x * data.scales[i] / data.scales[found.dependent[d]];
        found.coefficients.extend(regrouped.row(b).iter().enumerate().map(per));
    }
    found.directions = directions.transpose().into_vec();
    found.direction_deviations = deviations;
    found.noise = noise;
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// y = (a + 2 b) x + c x²; b and a are never apart.
    #[test]
    fn combinations_are_found_with_their_values() {
        let truth = [0.5, 1.5, -2.0];
        let x: Vec<f64> = (0..200).map(|i| f64::from(i) / 50.0 - 2.0).collect();
        let derivatives: Vec<f64> = x.iter().flat_map(|x| [*x, 2.0 * x, x * x, 0.0]).collect();
        // alternating noise of 0.01, orthogonal to nothing in particular
        let noise = |i: usize| if i % 2 == 0 { 0.01 } else { -0.01 };
        let residuals: Vec<f64> =
            (0..x.len()).map(|i| (truth[0] + 2.0 * truth[1]) * x[i] + truth[2] * x[i] * x[i] + noise(i)).collect();
        let found = fit(&Data {
            derivatives: &derivatives,
            residuals: &residuals,
            sizes: &[1.0],
            noise: &[f64::NAN],
            scales: &[1.0, 0.5, 2.0, 1.0],
            preference: &[1.0, 4.0, 1.0, 1.0],
        })
        .unwrap();
        assert_eq!((found.rank, &found.base[..]), (2, &[0, 2][..]));
        let b = found.dependent.iter().position(|d| *d == 1).unwrap();
        assert!((found.coefficients[b] - 2.0).abs() < 1e-9 && (found.noise[0] - 0.01).abs() < 1e-4);
        let closed = |power: i32| 0.01 / x.iter().map(|x| x.powi(2 * power)).sum::<f64>().sqrt();
        for (value, change, deviation, power) in [
            (3.5, found.base_changes[0], found.base_deviations[0], 1),
            (-2.0, found.base_changes[1], found.base_deviations[1], 2),
        ] {
            // x and x² are nearly orthogonal over a symmetric interval
            assert!((deviation / closed(power) - 1.0).abs() < 0.02, "{deviation} {}", closed(power));
            assert!((change - value).abs() < 3.0 * deviation);
        }
        // the least change in natural sizes: (1, 2 0.5) are equal parts of a + 2 b
        assert!((found.changes[0] - found.changes[1] / 0.5).abs() < 1e-9 && found.changes[3] == 0.0);
        assert!(
            found.deviations[0].is_infinite() && found.deviations[2].is_finite() && found.deviations[3].is_infinite()
        );
    }
}
