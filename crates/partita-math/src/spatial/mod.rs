//! Vectors, rotations and the two spaces that mechanisms live in.
//!
//! Recursions of the model are written once over [`Space`]: for [`Spatial`] (six numbers per twist) and for [`Planar`]
//! (three), and over any [`crate::scalar::Scalar`].

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
