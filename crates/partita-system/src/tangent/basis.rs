//! Rules that provide a constant S for tangent velocities `u = S v`.

use partita_math::dense::{self, Matrix};
use partita_math::factor::{self, FactorError};
use partita_math::tolerance;

/// A rule that provides S.
pub trait Basis: Send {
    /// Name of the formulation it makes.
    fn name(&self) -> &'static str;
    /// S (k x n) from M (n x n) and the kept rows of C (r x n), each brought to length 1, at one position.
    ///
    /// r + k = n; fewer than k rows come out where C loses rank. `last` is the basis that this one replaces, for rules
    /// that start from it.
    fn basis(&self, mass: &Matrix, c: &Matrix, last: Option<&Matrix>) -> Result<Matrix, FactorError>;
}

/// The rules of the literature.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// Eigenvectors of the zero eigenvalues of CᵀC (Kamman, Huston 1984): orthonormal, they span the null space of C in
    /// the units given. Forming CᵀC squares the condition of C: a zero and a small eigenvalue are distinguished only
    /// down to √ε, 1e-8 of the largest. Cost when frozen: n²m/2 + about 4.5 n³. Of historical interest; prefer
    /// `OrthogonalTriangular` for the same space at less cost and full accuracy.
    ZeroEigenvalue,
    /// Right singular vectors of C (Singh, Likins 1985; Mani, Haug, Atkinson 1985): `C = U Σ [V₁ V₂]ᵀ`, S = V₂ᵀ,
    /// orthonormal in the units given, to full accuracy however small the singular values are. Cost when frozen: about
    /// 2n²m + 4nm² + 4.5m³, the most expensive of the bases and the most reliable. The singular values depend on the
    /// units of the velocities; the space does not.
    SingularValues,
    /// QR of Cᵀ (Kim, Vanderploeg 1986): `Cᵀ = [Q₁ Q₂] [R; 0]`, S = Q₂ᵀ, orthonormal in the units given, the cheapest
    /// such basis: nm² − m³/3 + (2nm − m²)k when frozen.
    OrthogonalTriangular,
    /// The differentiable null space of Liang, Lance 1987: orthonormal in the units given, and the continuation of the
    /// previous basis.
    ///
    /// A Gram-Schmidt process on the columns of [Cᵀ, Sᵀ] with S from the last basis: the components of the old
    /// directions orthogonal to the present constraints, made orthonormal in their order. With the same C the same
    /// basis results; along a motion it varies as smoothly as C does, where other orthonormal bases of the same space
    /// may turn by any angle when they are renewed. The first basis is that of `OrthogonalTriangular`. Cost when
    /// frozen: 2nmk + 2nk² besides that of the QR of Cᵀ.
    LiangLance,
    /// Mass-orthonormal tangent velocities (Agrawal, Saigal 1989; Blajer 1995).
    ///
    /// `D₀ M₀ D₀ᵀ = 1`, S = D₀ M₀: the reduced mass matrix is the identity when the basis is frozen and its quality
    /// √μ_S is 1, the best possible, whatever the units; u' is the reduced force itself there. The vectors are those of
    /// a Gram-Schmidt process in the mass metric that begins with the constraints. Cost when frozen: that of
    /// `OrthogonalTriangular` + n³/6 + n²(m + k)/2. The basis that lasts longest.
    GramSchmidt,
}

impl Basis for Rule {
    fn name(&self) -> &'static str {
        match self {
            Self::ZeroEigenvalue => "zero-eigenvalue",
            Self::SingularValues => "svd",
            Self::OrthogonalTriangular => "qr",
            Self::LiangLance => "liang-lance",
            Self::GramSchmidt => "gram-schmidt",
        }
    }
    fn basis(&self, mass: &Matrix, c: &Matrix, last: Option<&Matrix>) -> Result<Matrix, FactorError> {
        let (n, r) = (mass.rows(), c.rows());
        let columns = |m: &Matrix, first: usize| {
            Matrix::from_vec(n - r, n, (0..(n - r) * n).map(|e| m[(e % n, first + e / n)]).collect())
        };
        match self {
            Self::ZeroEigenvalue => Ok(columns(&factor::symmetric_eigen(&c.transpose().matmul(c))?.1, 0)),
            Self::SingularValues | Self::OrthogonalTriangular | Self::LiangLance if r == 0 => Ok(Matrix::identity(n)),
            Self::SingularValues => Ok(columns(&factor::svd_full(c)?.v, r)),
            // a reduced rank shows as too many rows: the caller reports it
            Self::OrthogonalTriangular => Ok(factor::qr_null_space(c)?.null.transpose()),
            Self::LiangLance => match last.filter(|s| (s.rows(), s.cols()) == (n - r, n)) {
                None => Self::OrthogonalTriangular.basis(mass, c, None),
                Some(last) => continued(last, c),
            },
            Self::GramSchmidt => gram_schmidt(mass, c),
        }
    }
}

/// Twice is enough: the second pass removes the components along the others that the first pass leaves, up to ε times
/// its condition.
const PASSES: usize = 2;

/// The rows of `last` without the prohibited directions, made orthonormal one after the other.
fn continued(last: &Matrix, c: &Matrix) -> Result<Matrix, FactorError> {
    let n = last.cols();
    let space = factor::qr_null_space(c)?;
    if n - space.rank != last.rows() {
        return Ok(space.null.transpose()); // a rank that fell shows as too many rows: the caller reports it
    }
    let mut done = space.range.transpose();
    let r = done.rows();
    done = Matrix::from_vec(n, n, [done.data(), last.data()].concat());
    for j in r..n {
        let (before, own) = done.data_mut().split_at_mut(j * n);
        let x = &mut own[..n];
        for _ in 0..PASSES {
            for y in before.chunks_exact(n) {
                let along = dense::dot(x, y);
                dense::axpy(-along, y, x);
            }
            let length = dense::dot(x, x).sqrt();
            if length < tolerance::DEPENDENT {
                return Err(FactorError::NotPositiveDefinite { index: j - r });
            }
            x.iter_mut().for_each(|x| *x /= length);
        }
    }
    Ok(Matrix::from_vec(n - r, n, done.data()[r * n..].to_vec()))
}

/// Rows of S: mass-orthonormal tangent vectors as covectors.
fn gram_schmidt(mass: &Matrix, c: &Matrix) -> Result<Matrix, FactorError> {
    let n = mass.rows();
    let mut l = mass.data().to_vec();
    dense::cholesky(&mut l, n).map_err(|e| match e.pivot.is_finite() {
        true => FactorError::NotPositiveDefinite { index: e.index },
        false => FactorError::NotFinite,
    })?;
    // with x̂ = Lᵀ x the mass metric is the Euclidean one; covectors become L⁻¹ c
    let mut hats = c.clone();
    for i in 0..c.rows() {
        dense::cholesky_forward(&l, n, hats.row_mut(i));
    }
    // the constraints first (the tangent vectors are orthogonal to them)
    let range = match c.rows() {
        0 => Matrix::new(n, 0),
        _ => factor::qr_null_space(&hats)?.range,
    };
    let mut done: Vec<Vec<f64>> = (0..range.cols()).map(|j| (0..n).map(|i| range[(i, j)]).collect()).collect();
    let r = done.len();
    while done.len() < n {
        // next the unit vector with the largest remainder: at least (n − done)/n of its square
        let left = |i: &usize| 1.0 - done.iter().map(|x| x[*i] * x[*i]).sum::<f64>();
        let Some(next) = (0..n).max_by(|a, b| left(a).total_cmp(&left(b))) else { break };
        let mut x = vec![0.0; n];
        x[next] = 1.0;
        for _ in 0..PASSES {
            for y in &done {
                let along = dense::dot(&x, y);
                dense::axpy(-along, y, &mut x);
            }
            let length = dense::dot(&x, &x).sqrt();
            x.iter_mut().for_each(|x| *x /= length);
        }
        done.push(x);
    }
    // D₀ = x̂ᵀ L⁻¹, so S = D₀ L Lᵀ = x̂ᵀ Lᵀ
    let mut s = Matrix::new(n - r, n);
    for (j, x) in done[r..].iter().enumerate() {
        for i in 0..n {
            s[(j, i)] = dense::dot(&l[i * n..=i * n + i], x);
        }
    }
    Ok(s)
}
