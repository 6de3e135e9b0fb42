//! Bodies, joints, forces: from a description to a [`partita_system::ConstrainedSystem`].

pub mod articulated;
mod carry;
pub mod closing;
pub mod clusters;
pub mod compile;
pub mod dynamics;
pub mod error;
pub mod evaluator;
pub mod force;
pub mod joint;
pub mod loop_closure;
pub mod mechanics;
pub mod model;
pub mod numbers;
pub mod observe;
pub mod parameters;
pub mod place;
pub mod reaction;
pub mod spec;
pub mod topology;
pub mod tree;
pub mod validate;
pub mod value;

pub use error::DescriptionError;
pub use evaluator::Evaluator;
pub use model::Model;
