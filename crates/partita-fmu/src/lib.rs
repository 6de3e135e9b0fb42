//! The binary inside an FMU: a mechanism from `resources/model.json`, marched from one communication point to the next.
//!
//! `slave` is the mechanism with its inputs and outputs, safe Rust without a word of FMI. `interface` is the wall to C: the
//! functions of FMI 2.0, the only place with pointers; no panic passes it.

mod inputs;
pub mod interface;
mod resource;
mod resources;
mod slave;
