//! Whole mechanisms: evaluations, formulations, crossings, reactions.

mod allocations;
mod change_points;
mod collocation;
mod crossings;
mod driven;
mod every_formulation;
mod heavy_top;
mod linear_rates;
mod many_dof;
mod many_turns;
mod model_identities;
mod parallel_robot;
mod parameters;
mod reactions;
mod scalars;
mod sparse_steps;
mod stepping;
mod tangent_allocations;
