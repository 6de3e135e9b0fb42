//! Partita computes the motion and the forces of mechanisms with closed loops: four-bars, engines, suspensions, parallel
//! robots, legs.
//!
//! Describe a [`Mechanism`] by its bodies and joints as they are drawn, compile it to a [`Model`], close its loops to a
//! [`State`], and simulate: the [`Run`] holds positions, velocities and the reactions of all joints.
//!
//! ```
//! use partita::{GROUND, Mechanism, Simulation};
//!
//! let z = [0.0, 0.0, 1.0];
//! let model = Mechanism::new("four-bar")
//!     .gravity([0.0, -9.81, 0.0])
//!     .rod("crank", [0.0, 0.0, 0.0], [0.0, 1.0, 0.0], 1.0)
//!     .rod("coupler", [0.0, 1.0, 0.0], [3.0, 2.0, 0.0], 3.0)
//!     .rod("rocker", [3.0, 2.0, 0.0], [3.0, 0.0, 0.0], 2.0)
//!     .revolute("A", GROUND, "crank", [0.0, 0.0, 0.0], z)
//!     .revolute("B", "crank", "coupler", [0.0, 1.0, 0.0], z)
//!     .revolute("C", "coupler", "rocker", [3.0, 2.0, 0.0], z)
//!     .revolute("D", "rocker", GROUND, [3.0, 0.0, 0.0], z)
//!     .compile()?;
//! assert_eq!(model.mobility()?.mobility, 1);
//! let start = model.assemble(&[("A", 0.2)])?;
//! let run = model.simulate(&start, &Simulation::new(2.0))?;
//! assert!(run.is_success());
//! println!("the crank ends at {:.3} rad", run.joint("A")?.last().unwrap().position[0]);
//! # Ok::<(), partita::Error>(())
//! ```
//!
//! Units are SI and radians; points and axes of a description are those of the world as the mechanism is drawn. The
//! crates behind this interface, for those who extend it: [`model`], [`analysis`], [`system`], [`integrate`], [`math`].

mod compiled;
mod description;
mod error;
mod run;

pub use compiled::{Model, State};
pub use description::Mechanism;
pub use error::Error;
pub use partita_analysis as analysis;
pub use partita_analysis::Mobility;
pub use partita_integrate as integrate;
pub use partita_math as math;
pub use partita_model as model;
pub use partita_model::spec::{Body, Drive, Force, Joint, JointKind, Spec};
pub use partita_system as system;
pub use run::{BodyMotion, Energy, JointMotion, Reaction, Run, Simulation};

/// The name of the ground, for joints and forces.
///
/// ```
/// assert_eq!(partita::GROUND, "ground");
/// ```
pub const GROUND: &str = partita_model::validate::GROUND;
