//! The binary inside an FMU: a mechanism from `resources/model.json`, advanced from one communication point to the
//! next.
//!
//! `slave` is the mechanism with its inputs and outputs, in safe Rust and independent of FMI. `interface` is the
//! boundary to C: the functions of FMI 2.0, the only place with pointers; no panic crosses it.

mod inputs;
pub mod interface;
mod resource;
pub mod resources;
mod serial;
mod slave;
