//! Bodies, joints, forces: from a description to a [`partita_system::ConstrainedSystem`].

pub mod articulated;
mod carry;
pub mod closing;
pub mod clusters;
pub mod compile;
pub mod coupling;
pub mod dynamics;
pub mod error;
pub mod evaluator;
pub mod force;
pub mod gauge;
pub mod horizon;
pub mod joint;
pub mod loop_closure;
pub mod mechanics;
pub mod memory;
pub mod model;
mod names;
pub mod numbers;
pub mod observe;
pub mod parameters;
mod part;
pub mod place;
pub mod reaction;
pub mod reduced;
pub mod rows;
mod sparse_mass;
pub mod spec;
pub mod topology;
pub mod tree;
pub mod validate;
pub mod value;

pub use error::DescriptionError;
pub use evaluator::Evaluator;
pub use model::Model;
pub use part::Part;
