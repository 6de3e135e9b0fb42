//! Positions and velocities that satisfy the constraints.

pub mod assembly;
pub mod velocity;
