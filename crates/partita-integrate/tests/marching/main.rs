//! Marching in time.

#[path = "../counting/mod.rs"]
mod counting;
#[path = "../mechanisms/mod.rs"]
mod mechanisms;
#[path = "../problems/mod.rs"]
mod problems;

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
