//! A plane: one rotation and two translations. The normal is z.

use super::rotation::Mat3;
use super::space::{Embedding, Inertias, Locks, Rotations, Vectors};
use super::vector::{Vec2, Vec3};
use crate::scalar::Scalar;
use std::marker::PhantomData;

/// The x-y plane over the numbers `S`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Planar<S>(PhantomData<S>);

/// An orientation in the plane; the angle is kept, so that one sine and cosine serve each body.
#[derive(Clone, Copy, Debug)]
pub struct PlanarRotation<S> {
    /// Angle from the drawing, not wrapped.
    pub angle: S,
    sin: S,
    cos: S,
}

impl<S: Scalar> Vectors for Planar<S> {
    type S = S;
    type Vec = Vec2<S>;
    type Ang = S;
    const DIM: usize = 3;
    const LENGTHS: usize = 2;
    const GYROSCOPIC: bool = false;

    #[inline(always)]
    fn cross(w: S, x: Vec2<S>) -> Vec2<S> {
        Vec2([-(w * x.0[1]), w * x.0[0]])
    }
    #[inline(always)]
    fn cross_ang(_: S, _: S) -> S {
        S::zero()
    }
    #[inline(always)]
    fn moment(r: Vec2<S>, f: Vec2<S>) -> S {
        r.0[0] * f.0[1] - r.0[1] * f.0[0]
    }
    #[inline(always)]
    fn dot(a: Vec2<S>, b: Vec2<S>) -> S {
        a.dot(b)
    }
    #[inline(always)]
    fn dot_ang(a: S, b: S) -> S {
        a * b
    }
    #[inline(always)]
    fn scale(x: Vec2<S>, k: S) -> Vec2<S> {
        x.times(k)
    }
    #[inline(always)]
    fn scale_ang(x: S, k: S) -> S {
        x * k
    }
    #[inline(always)]
    fn vec_of(x: impl Iterator<Item = S>) -> Vec2<S> {
        let mut v = Vec2::zero();
        v.0.iter_mut().zip(x).for_each(|(v, x)| *v = x);
        v
    }
    #[inline(always)]
    fn component(x: Vec2<S>, i: usize) -> S {
        x.0[i]
    }
    #[inline(always)]
    fn components(w: S, v: Vec2<S>) -> [S; 6] {
        let o = S::zero();
        [w, v.0[0], v.0[1], o, o, o]
    }
}

impl<S: Scalar> Rotations for Planar<S> {
    type Rot = PlanarRotation<S>;

    #[inline(always)]
    fn identity() -> PlanarRotation<S> {
        PlanarRotation { angle: S::zero(), sin: S::zero(), cos: S::one() }
    }
    #[inline(always)]
    fn rotate(r: &PlanarRotation<S>, x: Vec2<S>) -> Vec2<S> {
        let [a, b] = x.0;
        Vec2([r.cos * a - r.sin * b, r.sin * a + r.cos * b])
    }
    #[inline(always)]
    fn rotate_ang(_: &PlanarRotation<S>, x: S) -> S {
        x
    }
    #[inline(always)]
    fn turn(r: &PlanarRotation<S>, axis: S, angle: S) -> PlanarRotation<S> {
        let angle = r.angle + axis * angle;
        let (sin, cos) = angle.sin_cos();
        PlanarRotation { angle, sin, cos }
    }
    /// A ball joint is not planar, and the planar recogniser never admits one. Here it is a rotation about z.
    fn turn_quaternion(r: &PlanarRotation<S>, p: [S; 4]) -> PlanarRotation<S> {
        Self::turn(r, S::one(), p[3].atan2(p[0]) * S::from_f64(2.0))
    }
    #[inline(always)]
    fn body_axis(_: &PlanarRotation<S>, _: usize) -> S {
        S::one()
    }
    #[inline(always)]
    fn turned(axis: S, _: [S; 2], a: &PlanarRotation<S>, b: &PlanarRotation<S>) -> S {
        axis * (b.angle - a.angle)
    }
}

impl<S: Scalar> Inertias for Planar<S> {
    type Inertia = S;

    #[inline(always)]
    fn world_inertia(_: &PlanarRotation<S>, i: &S) -> S {
        *i
    }
    #[inline(always)]
    fn spin(i: &S, w: S) -> S {
        *i * w
    }
    fn inertia_in(i: &Mat3<S>) -> S {
        i.0[2][2]
    }
    #[inline(always)]
    fn add_inertia(i: &S, mass: S, out: &mut [S]) {
        out[0] += *i;
        out[4] += mass;
        out[8] += mass;
    }
}

impl<S: Scalar> Locks for Planar<S> {
    type Lock = S;

    /// In the plane the locked rotation is the angle itself.
    #[inline(always)]
    fn lock_residual(lock: &S, a: &PlanarRotation<S>, b: &PlanarRotation<S>) -> S {
        b.angle - a.angle - *lock
    }
    #[inline(always)]
    fn lock_axis(_: &S, _: &PlanarRotation<S>, _: &PlanarRotation<S>) -> S {
        S::one()
    }
    #[inline(always)]
    fn lock_bias(_: &S, _: &PlanarRotation<S>, _: &PlanarRotation<S>, _: S, _: S) -> S {
        S::zero()
    }
    /// `u · w = 0` with `w` a quarter turn ahead of `u` when closed: the angle that B must keep from A.
    fn lock_from(u: [f64; 3], w: [f64; 3], _: f64) -> S {
        let ahead = (u[0] * w[1] - u[1] * w[0]).atan2(u[0] * w[0] + u[1] * w[1]);
        S::from_f64(std::f64::consts::FRAC_PI_2 - ahead)
    }
}

impl<S: Scalar> Embedding for Planar<S> {
    fn vec_from(x: [f64; 3]) -> Vec2<S> {
        Vec2::from_f64([x[0], x[1]])
    }
    fn ang_from(x: [f64; 3]) -> S {
        S::from_f64(x[2])
    }
    #[inline(always)]
    fn vec_in(x: Vec3<S>) -> Vec2<S> {
        Vec2([x.0[0], x.0[1]])
    }
    #[inline(always)]
    fn ang_in(x: Vec3<S>) -> S {
        x.0[2]
    }
    #[inline(always)]
    fn vec_to(x: Vec2<S>) -> Vec3<S> {
        Vec3([x.0[0], x.0[1], S::zero()])
    }
    #[inline(always)]
    fn ang_to(x: S) -> Vec3<S> {
        Vec3([S::zero(), S::zero(), x])
    }
    fn rot_to(r: &PlanarRotation<S>) -> Mat3<S> {
        let (s, c, o, i) = (r.sin, r.cos, S::zero(), S::one());
        Mat3([[c, -s, o], [s, c, o], [o, o, i]])
    }
    fn out_of_space(x: Vec3<S>) -> S {
        x.0[2]
    }
}
