//! Vectors, rotations and the two spaces that mechanisms live in.
//!
//! [`Space`] is the door through which the recursions of the model floor are written once: over
//! [`Spatial`] (six numbers a twist) and over [`Planar`] (three), and over any [`crate::scalar::Scalar`].

mod planar;
pub mod rotation;
mod space;
mod three;
mod vector;

pub use planar::{Planar, PlanarRotation};
pub use rotation::{Mat3, Quaternion};
pub use space::{Embedding, Inertias, Locks, Rotations, Space, Vectors};
pub use three::Spatial;
pub use vector::{Vec2, Vec3};
