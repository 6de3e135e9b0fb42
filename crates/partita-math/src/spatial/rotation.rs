//! Rotation matrices and unit quaternions (scalar first).

use super::vector::Vec3;
use crate::scalar::Scalar;
use crate::tolerance;

/// A 3x3 matrix, row by row; most often a rotation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mat3<S>(pub [[S; 3]; 3]);

impl<S: Scalar> Default for Mat3<S> {
    fn default() -> Self {
        Self::identity()
    }
}

impl<S: Scalar> Mat3<S> {
    /// The matrix of zeros.
    #[inline(always)]
    pub fn zero() -> Self {
        Self([[S::zero(); 3]; 3])
    }
    /// The identity.
    #[inline(always)]
    pub fn identity() -> Self {
        let (o, i) = (S::zero(), S::one());
        Self([[i, o, o], [o, i, o], [o, o, i]])
    }
    /// From plain numbers.
    pub fn from_f64(m: [[f64; 3]; 3]) -> Self {
        Self(m.map(|r| r.map(S::from_f64)))
    }
    /// Matrix with the given columns.
    #[inline(always)]
    pub fn from_columns(x: Vec3<S>, y: Vec3<S>, z: Vec3<S>) -> Self {
        let (x, y, z) = (x.0, y.0, z.0);
        Self([[x[0], y[0], z[0]], [x[1], y[1], z[1]], [x[2], y[2], z[2]]])
    }
    /// Column `j`.
    #[inline(always)]
    pub fn column(&self, j: usize) -> Vec3<S> {
        Vec3([self.0[0][j], self.0[1][j], self.0[2][j]])
    }
    /// `M x`.
    #[inline(always)]
    pub fn apply(&self, x: Vec3<S>) -> Vec3<S> {
        let [a, b, c] = &self.0;
        Vec3([Vec3(*a).dot(x), Vec3(*b).dot(x), Vec3(*c).dot(x)])
    }
    /// `Mᵀ x`.
    #[inline(always)]
    pub fn apply_transposed(&self, x: Vec3<S>) -> Vec3<S> {
        let [a, b, c] = self.0;
        Vec3(a).times(x.0[0]) + Vec3(b).times(x.0[1]) + Vec3(c).times(x.0[2])
    }
    /// Transpose.
    #[inline(always)]
    pub fn transpose(&self) -> Self {
        Self::from_columns(Vec3(self.0[0]), Vec3(self.0[1]), Vec3(self.0[2]))
    }
    /// `M N`.
    #[inline(always)]
    pub fn mul(&self, o: &Self) -> Self {
        let (x, y, z) = (o.column(0), o.column(1), o.column(2));
        let row = |r: &[S; 3]| [Vec3(*r).dot(x), Vec3(*r).dot(y), Vec3(*r).dot(z)];
        let [a, b, c] = &self.0;
        Self([row(a), row(b), row(c)])
    }
    /// Sum.
    #[inline(always)]
    pub fn add(&self, o: &Self) -> Self {
        let mut s = *self;
        for i in 0..3 {
            for j in 0..3 {
                s.0[i][j] += o.0[i][j];
            }
        }
        s
    }
    /// Rotation about the unit vector `axis` by the angle whose sine and cosine are given (Rodrigues).
    #[inline(always)]
    pub fn about(axis: Vec3<S>, sin: S, cos: S) -> Self {
        let [x, y, z] = axis.0;
        let k = S::one() - cos;
        let (kx, ky, kz) = (x * k, y * k, z * k);
        let (sx, sy, sz) = (x * sin, y * sin, z * sin);
        Self([
            [kx * x + cos, kx * y - sz, kx * z + sy],
            [kx * y + sz, ky * y + cos, ky * z - sx],
            [kx * z - sy, ky * z + sx, kz * z + cos],
        ])
    }
}

impl<S: Scalar> Mat3<S> {
    /// `m (|r|² 1 − r rᵀ)`: contribution of a mass at `r` to an inertia about the origin.
    pub fn steiner(mass: S, r: Vec3<S>) -> Self {
        let d = r.dot(r);
        let mut s = Self::zero();
        for i in 0..3 {
            for j in 0..3 {
                s.0[i][j] = -mass * r.0[i] * r.0[j];
            }
            s.0[i][i] += mass * d;
        }
        s
    }
    /// `yes` where `test` is above 0, else `no`.
    pub fn where_positive(test: S, yes: &Self, no: &Self) -> Self {
        Self(std::array::from_fn(|i| std::array::from_fn(|j| test.where_positive(yes.0[i][j], no.0[i][j]))))
    }
    /// The shortest rotation that takes the unit vector `a` to the unit vector `b`; half a turn about an axis
    /// perpendicular to `a` where they are opposite. Smooth where they coincide.
    pub fn between(a: Vec3<S>, b: Vec3<S>) -> Self {
        let (v, c) = (a.cross(b), a.dot(b));
        // less than a right angle: c 1 + [v] + v vᵀ / (1 + c)
        let [x, y, z] = v.0;
        let k = S::one() / (S::one() + c);
        let (kx, ky, kz) = (x * k, y * k, z * k);
        let near = Self([
            [kx * x + c, kx * y - z, kx * z + y],
            [kx * y + z, ky * y + c, ky * z - x],
            [kx * z - y, ky * z + x, kz * z + c],
        ]);
        // larger: about an axis, if the plane of rotation is determined
        let s = v.norm();
        let turned = s - S::from_f64(tolerance::SUM_ROUNDING);
        let axis = Vec3::where_positive(turned, v.direction(), a.across());
        let (sin, cos) = turned.where_positive(s, S::zero()).atan2(c).sin_cos();
        Self::where_positive(c, &near, &Self::about(axis, sin, cos))
    }
}

/// Unit quaternion, scalar first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quaternion<S>(pub [S; 4]);

impl<S: Scalar> Quaternion<S> {
    /// The rotation matrix, valid for any non-zero quaternion (divided by its squared norm).
    #[inline(always)]
    pub fn matrix(&self) -> Mat3<S> {
        let [w, x, y, z] = self.0;
        let one = S::one();
        let two = S::from_f64(2.0);
        let k = two / (w * w + x * x + y * y + z * z);
        let (xx, yy, zz) = (k * x * x, k * y * y, k * z * z);
        let (xy, xz, yz) = (k * x * y, k * x * z, k * y * z);
        let (wx, wy, wz) = (k * w * x, k * w * y, k * w * z);
        Mat3([[one - yy - zz, xy - wz, xz + wy], [xy + wz, one - xx - zz, yz - wx], [xz - wy, yz + wx, one - xx - yy]])
    }
    /// Rate of the quaternion for the angular velocity `w` in the rotated frame: `½ p ∘ (0, w)`  (S2).
    #[inline(always)]
    pub fn rate(&self, w: Vec3<S>) -> [S; 4] {
        let [a, b, c, d] = self.0;
        let [x, y, z] = w.0;
        let h = S::from_f64(0.5);
        [
            -(b * x + c * y + d * z) * h,
            (a * x + c * z - d * y) * h,
            (a * y + d * x - b * z) * h,
            (a * z + b * y - c * x) * h,
        ]
    }
}

impl<S: Scalar> Quaternion<S> {
    /// Hamilton product.
    pub fn times(&self, o: &Self) -> Self {
        let [a, b, c, d] = self.0;
        let [e, f, g, h] = o.0;
        Self([
            a * e - b * f - c * g - d * h,
            a * f + b * e + c * h - d * g,
            a * g - b * h + c * e + d * f,
            a * h + b * g - c * f + d * e,
        ])
    }
    /// Scaled to unit length; the identity if it has none.
    pub fn normalised(&self) -> Self {
        let [a, b, c, d] = self.0;
        let n = (a * a + b * b + c * c + d * d).sqrt();
        let [a, b, c, d] = self.0.map(|x| x.over_or_zero(n));
        // no length: nothing is above 0
        Self([n.where_positive(a, S::one()), b, c, d])
    }
    /// The quaternion of a rotation matrix (largest component positive).
    pub fn from_matrix(m: &Mat3<S>) -> Self {
        let r = &m.0;
        let one = S::one();
        let t = [
            one + r[0][0] + r[1][1] + r[2][2],
            one + r[0][0] - r[1][1] - r[2][2],
            one - r[0][0] + r[1][1] - r[2][2],
            one - r[0][0] - r[1][1] + r[2][2],
        ];
        let (a, b, c) = (r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]);
        let (d, e, f) = (r[0][1] + r[1][0], r[0][2] + r[2][0], r[1][2] + r[2][1]);
        // each is a multiple of the quaternion; the one by its largest component keeps the digits
        let by = [[t[0], a, b, c], [a, t[1], d, e], [b, d, t[2], f], [c, e, f, t[3]]];
        let (mut largest, mut q) = (t[0], by[0]);
        for i in 1..4 {
            let more = t[i] - largest;
            q = std::array::from_fn(|k| more.where_positive(by[i][k], q[k]));
            largest = more.where_positive(t[i], largest);
        }
        Self(q).normalised()
    }
}

impl<S: Scalar> Quaternion<S> {
    /// Exponential of a rotation vector.
    pub fn exp(w: Vec3<S>) -> Self {
        let square = w.dot(w);
        let n = square.sqrt();
        let (sin, cos) = n.scale(0.5).sin_cos();
        // by their series where sin(n/2)/n would lose digits, and where the length is not differentiable
        let large = n - S::from_f64(tolerance::SHORT_TURN);
        let short = S::from_f64(0.5) - square.scale(1.0 / 48.0) + (square * square).scale(1.0 / 3840.0);
        let k = large.where_positive(sin.over_or_zero(n), short);
        let series = S::one() - square.scale(0.125) + (square * square).scale(1.0 / 384.0);
        Self([large.where_positive(cos, series), k * w.0[0], k * w.0[1], k * w.0[2]])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn random_rotation(rng: &mut fastrand::Rng) -> Mat3<f64> {
        let q = Quaternion([0; 4].map(|_: i32| rng.f64() - 0.5)).normalised();
        q.matrix()
    }

    #[test]
    fn matrix_of_quaternion_and_back() {
        let mut rng = fastrand::Rng::with_seed(2);
        for _ in 0..200 {
            let m = random_rotation(&mut rng);
            let back = Quaternion::from_matrix(&m).matrix();
            for i in 0..3 {
                for j in 0..3 {
                    assert!((m.0[i][j] - back.0[i][j]).abs() < 1e-14);
                }
            }
            let i = m.mul(&m.transpose());
            assert!((i.0[0][0] - 1.0).abs() < 1e-14 && i.0[0][1].abs() < 1e-14);
        }
    }

    #[test]
    fn quaternion_rate_is_the_derivative_of_the_exponential() {
        let mut rng = fastrand::Rng::with_seed(3);
        let q = Quaternion([0.3, -0.2, 0.9, 0.1]).normalised();
        let w = Vec3([rng.f64(), rng.f64(), rng.f64()]);
        let h = 1e-6;
        let plus = q.times(&Quaternion::exp(w.times(h)));
        let minus = q.times(&Quaternion::exp(w.times(-h)));
        let rate = q.rate(w);
        for i in 0..4 {
            // central difference: error h² and rounding eps/h
            assert!((rate[i] - (plus.0[i] - minus.0[i]) / (2.0 * h)).abs() < 1e-9);
        }
    }

    #[test]
    fn shortest_turn_takes_one_vector_to_the_other() {
        let mut rng = fastrand::Rng::with_seed(4);
        for k in 0..50 {
            let a = Vec3([rng.f64() - 0.5, rng.f64() - 0.5, rng.f64() - 0.5]).unit().unwrap();
            let b = if k % 5 == 0 { -a } else { Vec3([rng.f64(), rng.f64(), rng.f64()]).unit().unwrap() };
            assert!((Mat3::between(a, b).apply(a) - b).norm() < 1e-14);
        }
    }
}
