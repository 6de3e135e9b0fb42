//! Restores the state of the vector registers after wide instructions.
//!
//! Large kernels use whole vector registers where the processor has them. What they leave in the upper halves slows
//! down every narrow instruction that follows on the same thread, by 1.7 for a whole evaluation, until an instruction
//! clears it: a decomposition at the start of a run would slow down all its steps.
#![allow(unsafe_code, reason = "the instruction that clears the registers is an intrinsic")]

/// Clears the upper halves of the vector registers when dropped.
pub(crate) struct Cleared;

impl Drop for Cleared {
    fn drop(&mut self) {
        #[cfg(target_arch = "x86_64")]
        if std::is_x86_feature_detected!("avx") {
            // SAFETY: the processor has the instruction, as was just tested; no code generated for a processor without it, as
            // this crate is, keeps anything in the halves that it clears
            unsafe { std::arch::x86_64::_mm256_zeroupper() }
        }
    }
}

/// Which upper halves are in use, of registers of 256 and of 512 bits, as reported by the processor; `None` if it does
/// not report them.
#[cfg(all(test, target_arch = "x86_64"))]
#[allow(unused_unsafe, reason = "older compilers mark the query of the processor as unsafe")]
pub(crate) fn in_use() -> Option<u64> {
    use std::arch::x86_64::{__cpuid, __cpuid_count, _xgetbv};
    #[target_feature(enable = "xsave")]
    unsafe fn asked() -> u64 {
        // SAFETY: as for the caller
        unsafe { _xgetbv(1) & (1 << 2 | 1 << 6) }
    }
    // SAFETY: every x86-64 processor has the instruction
    let (highest, features) = unsafe { (__cpuid(0).eax, __cpuid(1).ecx) };
    // SAFETY: the leaf exists
    let supported = highest >= 0xd && features & (1 << 27) != 0 && unsafe { __cpuid_count(0xd, 1) }.eax & (1 << 2) != 0;
    // SAFETY: the processor has the instruction and answers this question
    supported.then(|| unsafe { asked() })
}

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use super::*;

    /// Where the processor reports what is in use.
    #[test]
    fn upper_halves_are_cleared() {
        if !std::is_x86_feature_detected!("avx") {
            return;
        }
        // what is done once, at the first call, may clear them as well
        for _ in 0..2 {
            // SAFETY: the processor has the instruction; the register is declared as overwritten
            unsafe { std::arch::asm!("vcmptrueps ymm15, ymm15, ymm15", out("xmm15") _) };
            let used = in_use();
            drop(Cleared);
            if used.is_some_and(|used| used != 0) {
                assert_eq!(in_use(), Some(0));
            }
        }
    }
}
