//! Marching in time.

mod adams;
mod allocations;
mod constrained_order;
mod convergence;
mod driven;
mod every_formulation;
mod explicit_closing;
mod order_conditions;
mod selection;
mod sleigh;
mod stepping;
mod tangent_methods;
