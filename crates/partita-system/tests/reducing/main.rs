//! Reduction, choice of coordinates and formulations of single instants.

#[path = "../by_hand/mod.rs"]
mod by_hand;
#[path = "../instants/mod.rs"]
mod instants;

mod counter_examples;
mod every_formulation;
mod identities;
mod invariance;
mod rule_statistics;
mod selection;
mod tangent_methods;
