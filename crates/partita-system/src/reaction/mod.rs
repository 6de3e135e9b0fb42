//! Which reactions are physically determined.

pub mod uniqueness;
