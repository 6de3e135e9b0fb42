//! Singular positions: foreseen and passed, or told from dead points of a choice.

pub mod change_point;
pub mod consistency;
pub mod crossing;
pub mod dead_point;
