//! Positions at rest: the reduced forces vanish on the manifold of closed loops.
//!
//! ```text
//! h_d(z) = 0      K_d dz = h_d      K_d = D (−h − Cᵀ λ)_q Dᵀ      C_Dᵀ λ = (−h)_D                 (E1)
//! ```
//!
//! λ is that of rest, so K_d is the derivative of −h_d at any position, not only where it vanishes.

mod continuum;
mod deflation;
mod family;
mod forces;
mod preload;
mod search;

pub use continuum::is_connected;
pub use deflation::displacement_between;
pub use family::{family, Event, Family, Point};
pub use preload::{preload, Unknown};
pub use search::{describe, equilibrium, Equilibrium};
