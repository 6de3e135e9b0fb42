//! The constrained system S1-S5 and everything that needs no body and no joint: the partition and its projective
//! criterion, closing and projecting, the reduced equations, multipliers.

pub mod actuation;
pub mod branching;
pub mod breakpoints;
pub mod choice;
pub mod closing;
pub mod clusters;
pub mod compiled;
pub mod cubic;
pub mod equations;
pub mod error;
pub mod event;
pub mod formulation;
pub mod kinematics;
pub mod linear_rates;
pub mod manifold;
pub mod messages;
pub mod options;
pub mod partition;
pub mod positions;
pub mod rank;
pub mod rates;
pub mod record;
pub mod reduction;
pub mod singular;
pub mod sparse_rates;
pub mod start;
pub mod step_boundary;
pub mod system;
pub mod tangent;
pub mod variation;
pub mod watched;
pub mod weight;

pub use partition::Partition;
/// All traits of a system, to be imported together.
pub mod prelude {
    pub use crate::system::{
        Clustered as _, ConstrainedSystem as _, Guards as _, Levels as _, Manifold as _, Methods as _, Metric as _,
    };
}

pub use system::{ConstrainedSystem, Finite, Size, SystemError, SystemRef};
