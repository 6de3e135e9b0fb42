//! The core inside a page: `python/partita/sketch/core.js` calls it, as a WebAssembly module.
//!
//! `answers` is what is computed, in safe Rust: a request as JSON in, an answer as JSON out. `memory` is the boundary to
//! JavaScript, the only place with pointers.

pub mod answers;
pub mod memory;
