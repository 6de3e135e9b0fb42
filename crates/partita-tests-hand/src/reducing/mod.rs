//! Reduction, choice of coordinates and formulations of single instants.

mod counter_examples;
mod every_formulation;
mod identities;
mod invariance;
mod rule_statistics;
mod selection;
mod tangent_methods;
