//! The binary inside an FMU: a mechanism from `resources/model.json`, advanced from one communication point to the
//! next.
//!
//! `slave` is the mechanism with its inputs and outputs, in safe Rust and independent of FMI. `instance` is the boundary
//! to C: what the functions of FMI do, with `fmi2` and `fmi3`, the functions of its two versions, the only place with
//! pointers; no panic crosses it.

pub mod fmi2;
pub mod fmi3;
mod inputs;
mod instance;
mod resource;
pub mod resources;
mod serial;
mod slave;
