//! Loops closed: assembly, inverse kinematics, reactions of cut joints.

mod assembly;
mod explicit_closing_runs;
mod loop_closure_allocations;
mod loop_closure_couplings;
mod loop_closure_networks;
mod loop_closure_plane;
mod loop_closure_random;
mod loop_closure_scalars;
mod loop_closure_space;
mod reaction_routes;
mod redundant_proximal;
mod scales;
