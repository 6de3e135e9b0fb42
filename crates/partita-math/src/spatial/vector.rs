//! Vectors of two and three numbers.

use crate::scalar::Scalar;
use std::ops::{Add, AddAssign, Neg, Sub, SubAssign};

macro_rules! vector {
    ($(#[$doc:meta])* $name:ident, $n:literal) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq)]
        pub struct $name<S>(pub [S; $n]);

        impl<S: Scalar> $name<S> {
            /// The vector of zeros.
            #[inline(always)]
            pub fn zero() -> Self {
                Self([S::zero(); $n])
            }
            /// From plain numbers.
            #[inline(always)]
            pub fn from_f64(x: [f64; $n]) -> Self {
                Self(x.map(S::from_f64))
            }
            /// Scalar product.
            #[inline(always)]
            pub fn dot(self, o: Self) -> S {
                let mut s = self.0[0] * o.0[0];
                for i in 1..$n {
                    s += self.0[i] * o.0[i];
                }
                s
            }
            /// Multiple of the vector.
            #[inline(always)]
            pub fn times(mut self, k: S) -> Self {
                for x in &mut self.0 {
                    *x *= k;
                }
                self
            }
            /// Euclidean length.
            #[inline(always)]
            pub fn norm(self) -> S {
                self.dot(self).sqrt()
            }
        }
        impl<S: Scalar> Add for $name<S> {
            type Output = Self;
            #[inline(always)]
            fn add(mut self, o: Self) -> Self {
                self += o;
                self
            }
        }
        impl<S: Scalar> Sub for $name<S> {
            type Output = Self;
            #[inline(always)]
            fn sub(mut self, o: Self) -> Self {
                self -= o;
                self
            }
        }
        impl<S: Scalar> Neg for $name<S> {
            type Output = Self;
            #[inline(always)]
            fn neg(mut self) -> Self {
                for x in &mut self.0 {
                    *x = -*x;
                }
                self
            }
        }
        impl<S: Scalar> AddAssign for $name<S> {
            #[inline(always)]
            fn add_assign(&mut self, o: Self) {
                for i in 0..$n {
                    self.0[i] += o.0[i];
                }
            }
        }
        impl<S: Scalar> SubAssign for $name<S> {
            #[inline(always)]
            fn sub_assign(&mut self, o: Self) {
                for i in 0..$n {
                    self.0[i] -= o.0[i];
                }
            }
        }
    };
}

vector!(
    /// Two components, in the plane of a planar mechanism.
    Vec2,
    2
);
vector!(
    /// Three components.
    Vec3,
    3
);

impl<S: Scalar> Vec3<S> {
    /// Vector product.
    #[inline(always)]
    pub fn cross(self, o: Self) -> Self {
        let (a, b) = (self.0, o.0);
        Self([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
    }

    /// `yes` where `test` is above 0, else `no`.
    #[inline(always)]
    pub fn where_positive(test: S, yes: Self, no: Self) -> Self {
        Self(std::array::from_fn(|i| test.where_positive(yes.0[i], no.0[i])))
    }

    /// Unit vector along this one; zero for a vector without length.
    #[inline(always)]
    pub fn direction(self) -> Self {
        let n = self.norm();
        Self(self.0.map(|x| x.over_or_zero(n)))
    }

    /// A unit vector perpendicular to this unit vector and to the world axis least aligned with it.
    pub fn across(self) -> Self {
        let [x, y, z] = self.0.map(S::abs);
        let (o, i) = (S::zero(), S::one());
        // above 0 where the first is at least as large
        let seed = Self::where_positive(x - y, Self([o, i, o]), Self([i, o, o]));
        let seed = Self::where_positive(x.min(y) - z, Self([o, o, i]), seed);
        (seed - self.times(seed.dot(self))).direction()
    }
}

impl Vec3<f64> {
    /// Unit vector along this one; `None` for a vector without a direction.
    pub fn unit(self) -> Option<Self> {
        let n = self.norm();
        (n.is_finite() && n > 0.0).then(|| self.times(1.0 / n))
    }

    /// Two unit vectors that complete this unit vector to a right-handed frame `(e1, e2, self)`.
    ///
    /// Chosen from the world axis least aligned with it, so that equal inputs give equal frames.
    pub fn complement(self) -> (Self, Self) {
        let a = self.0.map(f64::abs);
        let seed = if a[0] <= a[1] && a[0] <= a[2] {
            Vec3([1.0, 0.0, 0.0])
        } else if a[1] <= a[2] {
            Vec3([0.0, 1.0, 0.0])
        } else {
            Vec3([0.0, 0.0, 1.0])
        };
        let e1 = seed - self.times(seed.dot(self));
        let e1 = e1.times(1.0 / e1.norm());
        (e1, self.cross(e1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn complement_is_a_right_handed_frame() {
        let mut rng = fastrand::Rng::with_seed(1);
        for _ in 0..100 {
            let z = Vec3([rng.f64() - 0.5, rng.f64() - 0.5, rng.f64() - 0.5]).unit().unwrap();
            let (x, y) = z.complement();
            assert!((x.cross(y) - z).norm() < 1e-15 * 8.0);
            assert!(x.dot(z).abs() < 1e-15 && (x.norm() - 1.0).abs() < 1e-15);
        }
    }
}
