//! Programs of the core as code of this processor.
//!
//! ```text
//! Program ──► translate: instructions of Cranelift ──► machine code ──► code: memory that is executed, the one wall
//! ```
//!
//! Every operation is that of the core, with its rounding: nothing is reordered or fused, and functions that are not
//! instructions of the processor are those the core calls. A compiled program therefore has the bits of
//! [`Recording::evaluate`](partita_math::scalar::Recording::evaluate).

mod code;
mod functions;
mod translate;

use code::Code;
use cranelift_codegen::control::ControlPlane;
use cranelift_codegen::dominator_tree::DominatorTree;
use cranelift_codegen::flowgraph::ControlFlowGraph;
use cranelift_codegen::ir::Function;
use cranelift_codegen::isa::OwnedTargetIsa;
use cranelift_codegen::settings::{self, Configurable};
use partita_math::program::{Compiled, Compiler, NotCompiled, Program};
use std::sync::OnceLock;

/// The compiler by Cranelift.
#[derive(Debug)]
pub struct Cranelift;

/// To be installed (see [`Compiler`]).
pub static CRANELIFT: Cranelift = Cranelift;

fn refused(e: impl std::fmt::Display) -> NotCompiled {
    NotCompiled(e.to_string())
}

/// This processor, as Cranelift describes it; found once.
fn processor() -> Result<OwnedTargetIsa, NotCompiled> {
    static FOUND: OnceLock<Result<OwnedTargetIsa, NotCompiled>> = OnceLock::new();
    let find = || {
        if cfg!(not(any(target_arch = "x86_64", target_arch = "aarch64"))) {
            return Err(refused("its processor is neither of x86-64 nor 64-bit ARM"));
        }
        let mut flags = settings::builder();
        for (name, value) in [("opt_level", "none"), ("enable_verifier", "false"), ("unwind_info", "false")] {
            flags.set(name, value).map_err(refused)?;
        }
        cranelift_native::builder().map_err(refused)?.finish(settings::Flags::new(flags)).map_err(refused)
    };
    FOUND.get_or_init(find).clone()
}

impl Compiler for Cranelift {
    fn compile(&self, program: &Program) -> Result<Box<dyn Compiled>, NotCompiled> {
        let isa = processor()?;
        let mut function = Function::new();
        translate::translate(program, &*isa, &mut function);
        // One block of instructions that the processor has: its passes before this one would change nothing, and their
        // rules of optimisation, a megabyte with all they need, would be part of the library.
        let blocks = ControlFlowGraph::with_function(&function);
        let order = DominatorTree::with_function(&function, &blocks);
        let compiled = isa.compile_function(&function, &order, false, &mut ControlPlane::default()).map_err(refused)?;
        // functions are called by their addresses: nothing is left to be linked
        if !compiled.buffer.relocs().is_empty() {
            return Err(refused("its code refers to symbols"));
        }
        let code = Code::new(compiled.code_buffer(), program).map_err(refused)?;
        Ok(Box::new(code))
    }
}

#[cfg(test)]
mod tests;
