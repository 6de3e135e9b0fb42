//! Wide instructions of the processor: kernels that use them where it has them, and the state of the vector registers
//! afterwards.
//!
//! The core is built for every x86-64 processor. A [`Kernel`] is compiled again for those with AVX2 and for those with
//! AVX-512, and the one that fits is called. No product is fused with a sum in any: all have the same bits.
//!
//! Large kernels use whole vector registers where the processor has them. What they leave in the upper halves slows
//! down every narrow instruction that follows on the same thread, by 1.7 for a whole evaluation, until an instruction
//! clears it: a decomposition at the start of a run would slow down all its steps.
#![allow(unsafe_code, reason = "functions for some processors only, and the instruction that clears the registers")]

/// A computation over arrays that gains from wide instructions. What it calls must be compiled into it: `#[inline(always)]`.
pub trait Kernel {
    /// Result.
    type Output;
    /// The computation, itself `#[inline(always)]`.
    fn run(self) -> Self::Output;
}

/// The result of a kernel, computed with the widest instructions of this processor.
#[inline]
pub fn widely<K: Kernel>(kernel: K) -> K::Output {
    #[cfg(all(target_arch = "x86_64", rustc_1_89))]
    if std::is_x86_feature_detected!("avx512f") && std::is_x86_feature_detected!("avx512dq") {
        // SAFETY: the processor has the instructions, as was just tested
        return unsafe { with_avx512(kernel) };
    }
    #[cfg(target_arch = "x86_64")]
    if std::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has the instructions, as was just tested
        return unsafe { with_avx2(kernel) };
    }
    kernel.run()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
unsafe fn with_avx2<K: Kernel>(kernel: K) -> K::Output {
    kernel.run()
}

// Older compilers do not offer these instructions: see `build.rs`.
#[cfg(all(target_arch = "x86_64", rustc_1_89))]
#[target_feature(enable = "avx512f,avx512dq")]
unsafe fn with_avx512<K: Kernel>(kernel: K) -> K::Output {
    kernel.run()
}

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

    /// x y + z of many numbers.
    struct Sums<'a>(&'a [[f64; 3]], &'a mut [f64]);

    impl Kernel for Sums<'_> {
        type Output = f64;
        #[inline(always)]
        fn run(self) -> f64 {
            self.1.iter_mut().zip(self.0).for_each(|(out, [x, y, z])| *out = x * y + z);
            self.1.iter().sum()
        }
    }

    #[test]
    fn a_kernel_has_the_same_bits_with_wide_instructions() {
        let mut random = fastrand::Rng::with_seed(1);
        let numbers: Vec<[f64; 3]> = (0..1003).map(|_| std::array::from_fn(|_| random.f64() - 0.5)).collect();
        let (mut wide, mut narrow) = (vec![0.0; 1003], vec![0.0; 1003]);
        let expected = Sums(&numbers, &mut narrow).run().to_bits();
        let mut same = |run: fn(Sums) -> f64| {
            wide.fill(0.0);
            assert_eq!(run(Sums(&numbers, &mut wide)).to_bits(), expected);
            assert_eq!(wide, narrow);
        };
        same(|sums| widely(sums));
        if std::is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has the instructions
            same(|sums| unsafe { with_avx2(sums) });
        }
        #[cfg(rustc_1_89)]
        if std::is_x86_feature_detected!("avx512f") && std::is_x86_feature_detected!("avx512dq") {
            // SAFETY: the processor has the instructions
            same(|sums| unsafe { with_avx512(sums) });
        }
    }

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
