//! Singular positions: foreseen and passed, or distinguished from dead points of a choice.

pub mod change_point;
pub mod checkpoint;
pub mod consistency;
pub mod dead_point;
