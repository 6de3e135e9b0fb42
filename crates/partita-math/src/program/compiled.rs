//! Programs as code of this processor: what compiles them stands above the core, which knows this contract.

use crate::scalar::Recording;
use std::fmt::Debug;
use std::sync::OnceLock;

/// A program as code of this processor, with the bits of [`Recording::evaluate`].
pub trait Compiled: Debug + Send + Sync {
    /// The outputs for these inputs; allocates nothing. `memory` is that of this call alone, whatever it holds.
    ///
    /// # Panics
    /// If there are other numbers of inputs or outputs than the program has, or less memory than [`memory`](Self::memory).
    fn evaluate(&self, inputs: &[f64], outputs: &mut [f64], memory: &mut [f64]);

    /// Numbers that an evaluation needs memory for, beside a stack.
    fn memory(&self) -> usize;
}

/// Why a program was not compiled.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("this computer makes no code of a program: {0}")]
pub struct NotCompiled(pub String);

/// Something that compiles recordings.
pub trait Compiler: Debug + Send + Sync {
    /// The program of a recording (see [`Recording::of_parts`]) as code of this processor; none where it takes more than
    /// `most` instructions, of which those that repeat count once.
    ///
    /// # Errors
    /// Where the processor is not known, or the system refuses memory for code.
    fn compile(&self, recording: Recording, most: usize) -> Result<Option<Box<dyn Compiled>>, NotCompiled>;
}

static COMPILER: OnceLock<&'static dyn Compiler> = OnceLock::new();

impl dyn Compiler {
    /// Make this the compiler of the process; the first one stays.
    pub fn install(compiler: &'static dyn Compiler) {
        let _ = COMPILER.set(compiler);
    }

    /// The compiler of the process, if one was installed.
    pub fn installed() -> Option<&'static dyn Compiler> {
        COMPILER.get().copied()
    }
}
