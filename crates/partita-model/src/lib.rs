//! Bodies, joints, forces: from a description to a [`partita_system::ConstrainedSystem`].

pub mod articulated;
mod carry;
pub mod closing;
pub mod compile;
pub mod dynamics;
pub mod error;
pub mod joint;
pub mod load;
pub mod loop_closure;
pub mod model;
pub mod observe;
mod part;
pub mod place;
pub mod reaction;
pub mod spec;
pub mod topology;
pub mod tree;
pub mod validate;
pub mod value;

pub use error::DescriptionError;
pub use model::Model;
pub use part::Part;
