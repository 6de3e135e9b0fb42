//! The one wall around machine code: memory that holds it, and calls with arguments of checked lengths.
#![allow(unsafe_code, reason = "memory becomes a function, and is called")]

use crate::Assembled;
use memmap2::{Mmap, MmapMut};
use partita_math::program::{Compiled, Program};
use std::io;

/// The signature of all compiled programs: inputs, constants, outputs, memory.
#[cfg(target_arch = "x86_64")]
type Call = unsafe extern "sysv64" fn(*const f64, *const f64, *mut f64, *mut f64);
#[cfg(not(target_arch = "x86_64"))]
type Call = unsafe extern "C" fn(*const f64, *const f64, *mut f64, *mut f64);

/// A compiled program; its memory is given back when dropped.
///
/// The code writes to its outputs, to the memory of the call and to its stack alone, so threads may share it.
#[derive(Debug)]
pub(crate) struct Code {
    memory: Mmap,
    constants: Box<[f64]>,
    inputs: usize,
    outputs: usize,
    numbers: usize,
}

impl Code {
    /// For the machine code of a function with this signature, which reads the inputs of `program` and its constants, and
    /// writes its outputs and its memory.
    ///
    /// # Errors
    /// Where the system refuses memory, or memory that can be executed.
    pub(crate) fn new(assembled: Assembled, program: &Program) -> io::Result<Self> {
        let Assembled { bytes: machine_code, constants, memory: numbers, .. } = assembled;
        let mut memory = MmapMut::map_anon(machine_code.len())?;
        memory[..machine_code.len()].copy_from_slice(&machine_code);
        let memory = memory.make_exec()?;
        #[cfg(target_arch = "aarch64")]
        {
            use wasmtime_jit_icache_coherence as icache;
            // SAFETY: the range is that of the memory above
            unsafe { icache::clear_cache(memory.as_ptr().cast(), memory.len()) }.map_err(io::Error::other)?;
            icache::pipeline_flush_mt().map_err(io::Error::other)?;
        }
        Ok(Self { memory, constants: constants.into(), inputs: program.inputs(), outputs: program.outputs(), numbers })
    }
}

impl Compiled for Code {
    #[inline]
    fn evaluate(&self, inputs: &[f64], outputs: &mut [f64], memory: &mut [f64]) {
        assert_eq!((inputs.len(), outputs.len()), (self.inputs, self.outputs), "numbers of inputs and outputs");
        assert!(memory.len() >= self.numbers, "memory of an evaluation");
        // SAFETY: the memory begins with a function of this signature, as an assembler wrote it;
        // it reads `inputs` numbers, whose presence was just tested, and the constants of its program, and writes `outputs`
        // and `numbers` numbers, tested too; all are disjoint
        unsafe {
            let call = std::mem::transmute::<*const u8, Call>(self.memory.as_ptr());
            call(inputs.as_ptr(), self.constants.as_ptr(), outputs.as_mut_ptr(), memory.as_mut_ptr());
        }
    }

    fn memory(&self) -> usize {
        self.numbers
    }
}
