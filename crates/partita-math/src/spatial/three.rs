//! Three-dimensional space: three rotations and three translations.

use super::rotation::{Mat3, Quaternion};
use super::space::{Embedding, Inertias, Locks, Rotations, Vectors};
use super::vector::Vec3;
use crate::scalar::Scalar;
use std::marker::PhantomData;

/// Three-dimensional space over the numbers `S`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Spatial<S>(PhantomData<S>);

/// A locked rotation in space: `u · w − c` with `u` fixed on A and `w` fixed on B.
#[derive(Clone, Copy, Debug)]
pub struct Lock3<S> {
    u: Vec3<S>,
    w: Vec3<S>,
    c: S,
}

/// Symmetric 3x3 inertia.
#[derive(Clone, Copy, Debug)]
pub struct Inertia3<S>(pub Mat3<S>);

impl<S: Scalar> Default for Inertia3<S> {
    fn default() -> Self {
        Self(Mat3::zero())
    }
}

impl<S: Scalar> Vectors for Spatial<S> {
    type S = S;
    type Vec = Vec3<S>;
    type Ang = Vec3<S>;
    const DIM: usize = 6;
    const LENGTHS: usize = 3;
    const GYROSCOPIC: bool = true;

    #[inline(always)]
    fn cross(w: Vec3<S>, x: Vec3<S>) -> Vec3<S> {
        w.cross(x)
    }
    #[inline(always)]
    fn cross_ang(a: Vec3<S>, b: Vec3<S>) -> Vec3<S> {
        a.cross(b)
    }
    #[inline(always)]
    fn moment(r: Vec3<S>, f: Vec3<S>) -> Vec3<S> {
        r.cross(f)
    }
    #[inline(always)]
    fn dot(a: Vec3<S>, b: Vec3<S>) -> S {
        a.dot(b)
    }
    #[inline(always)]
    fn dot_ang(a: Vec3<S>, b: Vec3<S>) -> S {
        a.dot(b)
    }
    #[inline(always)]
    fn scale(x: Vec3<S>, k: S) -> Vec3<S> {
        x.times(k)
    }
    #[inline(always)]
    fn scale_ang(x: Vec3<S>, k: S) -> Vec3<S> {
        x.times(k)
    }
    #[inline(always)]
    fn vec_of(x: impl Iterator<Item = S>) -> Vec3<S> {
        let mut v = Vec3::zero();
        v.0.iter_mut().zip(x).for_each(|(v, x)| *v = x);
        v
    }
    #[inline(always)]
    fn component(x: Vec3<S>, i: usize) -> S {
        x.0[i]
    }
    #[inline(always)]
    fn components(w: Vec3<S>, v: Vec3<S>) -> [S; 6] {
        [w.0[0], w.0[1], w.0[2], v.0[0], v.0[1], v.0[2]]
    }
}

impl<S: Scalar> Rotations for Spatial<S> {
    type Rot = Mat3<S>;

    #[inline(always)]
    fn identity() -> Mat3<S> {
        Mat3::identity()
    }
    #[inline(always)]
    fn rotate(r: &Mat3<S>, x: Vec3<S>) -> Vec3<S> {
        r.apply(x)
    }
    #[inline(always)]
    fn rotate_ang(r: &Mat3<S>, x: Vec3<S>) -> Vec3<S> {
        r.apply(x)
    }
    #[inline(always)]
    fn turn(r: &Mat3<S>, axis: Vec3<S>, angle: S) -> Mat3<S> {
        let (s, c) = angle.sin_cos();
        r.mul(&Mat3::about(axis, s, c))
    }
    #[inline(always)]
    fn turn_quaternion(r: &Mat3<S>, p: [S; 4]) -> Mat3<S> {
        r.mul(&Quaternion(p).matrix())
    }
    #[inline(always)]
    fn body_axis(r: &Mat3<S>, i: usize) -> Vec3<S> {
        r.column(i)
    }
    #[inline(always)]
    fn turned(axis: Vec3<S>, probe: [Vec3<S>; 2], a: &Mat3<S>, b: &Mat3<S>) -> S {
        let (p, q) = (a.apply(probe[0]), b.apply(probe[1]));
        axis.dot(p.cross(q)).atan2(p.dot(q) - axis.dot(p) * axis.dot(q))
    }
}

impl<S: Scalar> Inertias for Spatial<S> {
    type Inertia = Inertia3<S>;

    #[inline(always)]
    fn world_inertia(r: &Mat3<S>, i: &Inertia3<S>) -> Inertia3<S> {
        Inertia3(r.mul(&i.0).mul(&r.transpose()))
    }
    #[inline(always)]
    fn spin(i: &Inertia3<S>, w: Vec3<S>) -> Vec3<S> {
        i.0.apply(w)
    }
    fn inertia_in(i: &Mat3<S>) -> Inertia3<S> {
        Inertia3(*i)
    }
    #[inline(always)]
    fn add_inertia(i: &Inertia3<S>, mass: S, out: &mut [S]) {
        for r in 0..3 {
            for c in 0..3 {
                out[r * 6 + c] += i.0 .0[r][c];
            }
            out[(r + 3) * 6 + r + 3] += mass;
        }
    }
}

impl<S: Scalar> Locks for Spatial<S> {
    type Lock = Lock3<S>;

    #[inline(always)]
    fn lock_residual(l: &Lock3<S>, a: &Mat3<S>, b: &Mat3<S>) -> S {
        a.apply(l.u).dot(b.apply(l.w)) - l.c
    }
    #[inline(always)]
    fn lock_axis(l: &Lock3<S>, a: &Mat3<S>, b: &Mat3<S>) -> Vec3<S> {
        b.apply(l.w).cross(a.apply(l.u))
    }
    #[inline(always)]
    fn lock_bias(l: &Lock3<S>, a: &Mat3<S>, b: &Mat3<S>, wa: Vec3<S>, wb: Vec3<S>) -> S {
        let (u, w) = (a.apply(l.u), b.apply(l.w));
        (wb - wa).dot(wb.cross(w).cross(u) + w.cross(wa.cross(u)))
    }
    fn lock_from(u: [f64; 3], w: [f64; 3], c: f64) -> Lock3<S> {
        Lock3 { u: Vec3::from_f64(u), w: Vec3::from_f64(w), c: S::from_f64(c) }
    }
}

impl<S: Scalar> Embedding for Spatial<S> {
    fn vec_from(x: [f64; 3]) -> Vec3<S> {
        Vec3::from_f64(x)
    }
    fn ang_from(x: [f64; 3]) -> Vec3<S> {
        Vec3::from_f64(x)
    }
    #[inline(always)]
    fn vec_in(x: Vec3<S>) -> Vec3<S> {
        x
    }
    #[inline(always)]
    fn ang_in(x: Vec3<S>) -> Vec3<S> {
        x
    }
    #[inline(always)]
    fn vec_to(x: Vec3<S>) -> Vec3<S> {
        x
    }
    #[inline(always)]
    fn ang_to(x: Vec3<S>) -> Vec3<S> {
        x
    }
    #[inline(always)]
    fn rot_to(r: &Mat3<S>) -> Mat3<S> {
        *r
    }
    fn out_of_space(_: Vec3<S>) -> S {
        S::zero()
    }
}
