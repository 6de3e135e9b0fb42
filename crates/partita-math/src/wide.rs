//! The registers left as they were found by wide vector instructions.
//!
//! Large kernels use whole vector registers where the processor has them. What they leave in the upper halves slows down every
//! narrow instruction that follows on the same thread, by 1.7 for a whole evaluation, until an instruction clears it: a
//! decomposition at the start of a run would make all its steps dearer.
#![allow(unsafe_code, reason = "the instruction that clears the registers is an intrinsic")]

/// Clears the upper halves of the vector registers when dropped.
pub(crate) struct Cleared;

impl Drop for Cleared {
    fn drop(&mut self) {
        #[cfg(target_arch = "x86_64")]
        if std::is_x86_feature_detected!("avx") {
            // SAFETY: the processor has the instruction, as was just asked; no code generated for a processor without it, as
            // this crate is, keeps anything in the halves that it clears
            unsafe { std::arch::x86_64::_mm256_zeroupper() }
        }
    }
}

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use crate::dense::Matrix;
    use crate::factor;
    use std::arch::x86_64::{__cpuid, __cpuid_count, _xgetbv};

    /// Upper halves of the first sixteen 256-bit and 512-bit registers, in the processor's own list of what is in use.
    const UPPER: u64 = 1 << 2 | 1 << 6;

    #[target_feature(enable = "xsave")]
    unsafe fn in_use() -> u64 {
        // SAFETY: as for the caller
        unsafe { _xgetbv(1) & UPPER }
    }

    /// Does the processor tell what is in use?
    #[allow(unused_unsafe, reason = "older compilers call the question unsafe")]
    fn tells() -> bool {
        // SAFETY: every x86-64 processor has the instruction
        let (highest, features) = unsafe { (__cpuid(0).eax, __cpuid(1).ecx) };
        // SAFETY: the leaf exists
        highest >= 0xd && features & (1 << 27) != 0 && unsafe { __cpuid_count(0xd, 1) }.eax & (1 << 2) != 0
    }

    #[test]
    fn large_factorisations_leave_no_wide_registers_in_use() {
        if !tells() {
            return;
        }
        let n = 60;
        let entry = |i: usize, j: usize| ((3 * i + 7 * j) % 11) as f64 + if i == j { 500.0 } else { 0.0 };
        let a: Vec<f64> = (0..n * n).map(|e| entry(e / n, e % n) + entry(e % n, e / n)).collect();
        let matrix = Matrix::from_vec(n, n, a.clone());
        let half = Matrix::from_vec(n / 2, n, a[..n * n / 2].to_vec());
        let ones = vec![1.0; n];
        let calls: [(&str, &dyn Fn() -> bool); 6] = [
            ("svd", &|| factor::svd(&matrix).is_ok()),
            ("svd_full", &|| factor::svd_full(&half).is_ok()),
            ("qr_null_space", &|| factor::qr_null_space(&half).is_ok()),
            ("symmetric_eigen", &|| factor::symmetric_eigen(&matrix).is_ok()),
            ("solve_dense", &|| factor::solve_dense(&matrix, &ones).is_ok()),
            ("cholesky_large", &|| factor::cholesky_large(&mut a.clone(), n).is_ok()),
        ];
        for (name, call) in calls {
            assert!(call(), "{name}");
            // SAFETY: the processor has the instruction, as was asked
            assert_eq!(unsafe { in_use() }, 0, "{name}");
        }
    }
}
