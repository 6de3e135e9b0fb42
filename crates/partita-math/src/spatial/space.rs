//! The operations that a recursion over bodies needs from its space.

use super::rotation::Mat3;
use super::vector::Vec3;
use crate::scalar::Scalar;
use std::fmt::Debug;
use std::ops::{Add, AddAssign, Neg, Sub, SubAssign};

/// All additive quantities of a recursion.
pub trait Additive:
    Copy
    + Debug
    + Default
    + Send
    + Sync
    + Add<Output = Self>
    + Sub<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
{
}
impl<T> Additive for T where
    T: Copy
        + Debug
        + Default
        + Send
        + Sync
        + Add<Output = T>
        + Sub<Output = T>
        + Neg<Output = T>
        + AddAssign
        + SubAssign
{
}

/// A space for rigid bodies: three dimensions ([`super::Spatial`]) or a plane ([`super::Planar`]); the sum of the
/// traits below.
///
/// Vectors are in world axes. A twist is (angular velocity, velocity of the body's reference point), a wrench is
/// (moment about that point, force).
pub trait Space: Inertias + Locks + Embedding + Copy + Clone + Debug + Default + Send + Sync + 'static {}

impl<G> Space for G where G: Inertias + Locks + Embedding + Copy + Clone + Debug + Default + Send + Sync + 'static {}

/// Lengths, axes and their products.
pub trait Vectors {
    /// The number type.
    type S: Scalar;
    /// Lengths, velocities, forces.
    type Vec: Additive;
    /// Angular velocities, moments, axes of rotation.
    type Ang: Additive;
    /// Components of a twist.
    const DIM: usize;
    /// Components of a length.
    const LENGTHS: usize;
    /// Whether turns about different axes combine: `v' = 0` then leaves angular accelerations, which a plane has not.
    const GYROSCOPIC: bool;

    /// `w × x`.
    fn cross(w: Self::Ang, x: Self::Vec) -> Self::Vec;
    /// `a × b` of two axes.
    fn cross_ang(a: Self::Ang, b: Self::Ang) -> Self::Ang;
    /// Moment `r × f`.
    fn moment(r: Self::Vec, f: Self::Vec) -> Self::Ang;
    /// Scalar product of lengths.
    fn dot(a: Self::Vec, b: Self::Vec) -> Self::S;
    /// Scalar product of axes.
    fn dot_ang(a: Self::Ang, b: Self::Ang) -> Self::S;
    /// `k x`.
    fn scale(x: Self::Vec, k: Self::S) -> Self::Vec;
    /// `k x`.
    fn scale_ang(x: Self::Ang, k: Self::S) -> Self::Ang;
    /// A length from its components.
    fn vec_of(x: impl Iterator<Item = Self::S>) -> Self::Vec;
    /// Component `i` of a length.
    fn component(x: Self::Vec, i: usize) -> Self::S;
    /// A twist (or wrench) as DIM numbers, rotation first; the rest is 0.
    fn components(w: Self::Ang, v: Self::Vec) -> [Self::S; 6];
}

/// Orientations of bodies.
pub trait Rotations: Vectors {
    /// Orientation of a body.
    type Rot: Copy + Debug + Send + Sync;

    /// No rotation.
    fn identity() -> Self::Rot;
    /// `R x` for a length.
    fn rotate(r: &Self::Rot, x: Self::Vec) -> Self::Vec;
    /// `R x` for an axis.
    fn rotate_ang(r: &Self::Rot, x: Self::Ang) -> Self::Ang;
    /// `R exp(axis angle)`, `axis` a unit vector in body axes.
    fn turn(r: &Self::Rot, axis: Self::Ang, angle: Self::S) -> Self::Rot;
    /// `R R(p)` with the quaternion `p`.
    fn turn_quaternion(r: &Self::Rot, p: [Self::S; 4]) -> Self::Rot;
    /// Axis `i` of the body in the world.
    fn body_axis(r: &Self::Rot, i: usize) -> Self::Ang;
    /// Angle by which B is rotated from A about the unit `axis` (world axes), measured from a direction that coincides
    /// on both when it is 0; in space in (−π, π], in the plane not wrapped.
    fn turned(axis: Self::Ang, probe: [Self::Ang; 2], a: &Self::Rot, b: &Self::Rot) -> Self::S;
}

/// Inertias of bodies.
pub trait Inertias: Rotations {
    /// Inertia about the centre of mass.
    type Inertia: Copy + Debug + Default + Send + Sync;

    /// Inertia from a matrix.
    fn inertia_in(i: &Mat3<Self::S>) -> Self::Inertia;
    /// Inertia in world axes, for [`Inertias::spin`].
    fn world_inertia(r: &Self::Rot, i: &Self::Inertia) -> Self::Inertia;
    /// `I w` with an inertia in world axes.
    fn spin(i: &Self::Inertia, w: Self::Ang) -> Self::Ang;
    /// Add a world inertia (about the centre of mass) and mass to a DIM x DIM matrix, rotation first.
    fn add_inertia(i: &Self::Inertia, mass: Self::S, out: &mut [Self::S]);
}

/// Locked relative rotations between two bodies: closing rows on orientations.
pub trait Locks: Rotations {
    /// A locked relative rotation.
    type Lock: Copy + Debug + Send + Sync;

    /// The locked rotation `u · w = const` of the axes `u` (on A) and `w` (on B), both given in body axes.
    fn lock_from(u: [f64; 3], w: [f64; 3], residual: f64) -> Self::Lock;
    /// Residual of a locked rotation between frames A and B.
    fn lock_residual(lock: &Self::Lock, a: &Self::Rot, b: &Self::Rot) -> Self::S;
    /// Its gradient: the residual's rate is `axis · (w_B − w_A)`.
    fn lock_axis(lock: &Self::Lock, a: &Self::Rot, b: &Self::Rot) -> Self::Ang;
    /// Rate of that axis times the relative angular velocity.
    fn lock_bias(lock: &Self::Lock, a: &Self::Rot, b: &Self::Rot, wa: Self::Ang, wb: Self::Ang) -> Self::S;
}

/// Embedding of the space in three dimensions; the plane is x-y.
pub trait Embedding: Rotations {
    /// A length from three plain numbers.
    fn vec_from(x: [f64; 3]) -> Self::Vec;
    /// An axis from three plain numbers.
    fn ang_from(x: [f64; 3]) -> Self::Ang;
    /// A length from three numbers.
    fn vec_in(x: Vec3<Self::S>) -> Self::Vec;
    /// An axis from three numbers.
    fn ang_in(x: Vec3<Self::S>) -> Self::Ang;
    /// A length as three numbers.
    fn vec_to(x: Self::Vec) -> Vec3<Self::S>;
    /// An axis as three numbers.
    fn ang_to(x: Self::Ang) -> Vec3<Self::S>;
    /// Orientation as a matrix.
    fn rot_to(r: &Self::Rot) -> Mat3<Self::S>;
    /// The component of a length that this space does not represent (normal to the plane), as a constant.
    fn out_of_space(x: Vec3<Self::S>) -> Self::S;
}
