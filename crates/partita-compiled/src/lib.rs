//! Programs of the core as code of this processor.
//!
//! ```text
//! Program ──► values ──► registers: steps ──► x86_64, aarch64: bytes ──► code: memory that is executed, the one wall
//! ```
//!
//! Every operation is that of the core, with its rounding: nothing is reordered or fused, and functions that are not
//! instructions of the processor are those the core calls. A compiled program therefore has the bits of
//! [`Recording::evaluate`](partita_math::scalar::Recording::evaluate).

#[cfg(any(target_arch = "aarch64", test))]
mod aarch64;
mod code;
mod functions;
mod registers;
mod values;
#[cfg(target_arch = "x86_64")]
mod x86_64;

use code::Code;
use partita_math::program::{Compiled, Compiler, NotCompiled, Program};
use registers::Steps;
use values::Values;

/// The compiler for this processor.
#[derive(Debug)]
pub struct Native;

/// To be installed (see [`Compiler`]).
pub static NATIVE: Native = Native;

/// Numbers on the stack of a program. Scale: numbers of eight bytes. Reason: half of the smallest stack that a system
/// gives a thread, half a megabyte.
const MOST_ON_STACK: usize = 32_768;

impl Compiler for Native {
    fn compile(&self, program: &Program) -> Result<Box<dyn Compiled>, NotCompiled> {
        let (bytes, constants) = machine_code(program)?;
        let code = Code::new(&bytes, constants.into(), program).map_err(|e| NotCompiled(e.to_string()))?;
        Ok(Box::new(code))
    }
}

/// The code of a program, and the constants that it reads.
fn machine_code(program: &Program) -> Result<(Vec<u8>, Vec<f64>), NotCompiled> {
    #[cfg(target_arch = "x86_64")]
    return for_x86_64(program, std::arch::is_x86_feature_detected!("avx"));
    #[cfg(target_arch = "aarch64")]
    return for_aarch64(program);
    #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
    return Err(NotCompiled("its processor is neither of x86-64 nor 64-bit ARM".into()));
}

#[cfg(target_arch = "x86_64")]
fn for_x86_64(program: &Program, avx: bool) -> Result<(Vec<u8>, Vec<f64>), NotCompiled> {
    let steps = fits(registers::steps(&Values::new(program), x86_64::registers(avx)))?;
    let mut constants = [program.constants(), program.exponents()].concat();
    let bytes = x86_64::assemble(&steps, constants.len(), avx);
    constants.extend(x86_64::MASKS);
    Ok((bytes, constants))
}

#[cfg(any(target_arch = "aarch64", test))]
fn for_aarch64(program: &Program) -> Result<(Vec<u8>, Vec<f64>), NotCompiled> {
    let steps = fits(registers::steps(&Values::new(program), aarch64::registers()))?;
    Ok((aarch64::assemble(&steps), [program.constants(), program.exponents()].concat()))
}

fn fits(steps: Steps) -> Result<Steps, NotCompiled> {
    if steps.stack <= MOST_ON_STACK {
        return Ok(steps);
    }
    Err(NotCompiled(format!("it would keep {} numbers on the stack, and {MOST_ON_STACK} may lie there", steps.stack)))
}

#[cfg(test)]
mod tests;
