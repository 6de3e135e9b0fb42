//! Programs of the core as code of this processor.
//!
//! ```text
//! Program ──► values ──► turns, rolls: loops ──► registers, copies: steps ──► x86_64, aarch64: bytes ──► code: memory that
//!                                                                                         is executed, the one wall
//! ```
//!
//! Every operation is that of the core, with its rounding: nothing is reordered or fused, and functions that are not
//! instructions of the processor are those the core calls. A compiled program therefore has the bits of
//! [`Recording::evaluate`].

#[cfg(any(target_arch = "aarch64", test))]
mod aarch64;
mod code;
mod copies;
mod functions;
mod layout;
mod registers;
mod rolls;
mod steps;
mod turns;
mod values;
#[cfg(target_arch = "x86_64")]
mod x86_64;

use code::Code;
use partita_math::program::{Compiled, Compiler, NotCompiled, Program};
use partita_math::scalar::Recording;
use values::Values;

/// The compiler for this processor.
#[derive(Debug)]
pub struct Native;

/// To be installed (see [`Compiler`]).
pub static NATIVE: Native = Native;

/// Numbers on the stack of a program; more lie in memory given to it. Scale: numbers of eight bytes. Reason: half of the
/// smallest stack that a system gives a thread, half a megabyte.
const MOST_ON_STACK: usize = 32_768;

/// Recorded operations from which on loops are made. Reason: shorter code fits into a second cache, and without loops more of
/// its values stay in registers.
const LOOPS_FROM: usize = 28_000;

/// Code, the constants that it reads, and what it needs.
struct Assembled {
    bytes: Vec<u8>,
    constants: Vec<f64>,
    /// Numbers of the memory that it is given.
    memory: usize,
    /// Steps, those of a loop counted once.
    length: usize,
}

impl Compiler for Native {
    fn compile(&self, recording: Recording, most: usize) -> Result<Option<Box<dyn Compiled>>, NotCompiled> {
        let of_parts = cfg!(target_arch = "x86_64") && recording.len() >= LOOPS_FROM;
        let program = if of_parts { Program::of_parts(&recording) } else { Program::new(&recording, 0..0) };
        drop(recording);
        let assembled = machine_code(&program, of_parts)?;
        if assembled.length > most {
            return Ok(None);
        }
        let code = Code::new(assembled, &program).map_err(|e| NotCompiled(e.to_string()))?;
        Ok(Some(Box::new(code)))
    }
}

/// The code of a program, in loops if it is one of many parts and the processor has them.
fn machine_code(program: &Program, of_parts: bool) -> Result<Assembled, NotCompiled> {
    #[cfg(target_arch = "x86_64")]
    return Ok(for_x86_64(program, std::arch::is_x86_feature_detected!("avx"), of_parts));
    #[cfg(target_arch = "aarch64")]
    return for_aarch64(program);
    #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
    return Err(NotCompiled("its processor is neither of x86-64 nor 64-bit ARM".into()));
}

#[cfg(target_arch = "x86_64")]
fn for_x86_64(program: &Program, avx: bool, loops: bool) -> Assembled {
    let mut constants = [program.constants(), program.exponents()].concat();
    let mut values = Values::new(program);
    if loops {
        rolls::roll(&mut values, &mut constants);
    }
    let steps = registers::steps(&values, x86_64::registers(avx, loops));
    let on_stack = steps.stack <= MOST_ON_STACK;
    let bytes = x86_64::assemble(&steps, constants.len(), avx, on_stack);
    constants.extend(x86_64::MASKS);
    Assembled {
        bytes,
        constants,
        memory: if on_stack { 0 } else { steps.stack.max(steps.fixed + 16) },
        length: steps.len(),
    }
}

#[cfg(any(target_arch = "aarch64", test))]
fn for_aarch64(program: &Program) -> Result<Assembled, NotCompiled> {
    let steps = registers::steps(&Values::new(program), aarch64::registers());
    if steps.stack > MOST_ON_STACK {
        return Err(NotCompiled(format!(
            "it would keep {} numbers on the stack, and {MOST_ON_STACK} may lie there",
            steps.stack
        )));
    }
    let constants = [program.constants(), program.exponents()].concat();
    Ok(Assembled { bytes: aarch64::assemble(&steps), constants, memory: 0, length: steps.len() })
}

#[cfg(test)]
mod tests;
