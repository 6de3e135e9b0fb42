//! Functions that compiled programs call: those of the core, for one number or for a list of them.
#![allow(unsafe_code, reason = "lists are given as pointers")]

use partita_math::program::Code;
use partita_math::scalar::{Cases, Lanes, Scalar};
use partita_math::wide::{widely, Kernel};

/// Angles from which on eight are computed side by side. Reason: eight in lanes take as long as some of them by themselves.
const IN_LANES: usize = 4;

/// Eight angles: their sines and cosines.
struct Eight<'a>(&'a [f64], &'a mut [[f64; 2]]);

impl Kernel for Eight<'_> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let mut angles = Lanes::zero();
        angles.0[..self.0.len()].copy_from_slice(self.0);
        let (s, c) = angles.sin_cos();
        self.1.iter_mut().enumerate().for_each(|(i, x)| *x = [s.0[i], c.0[i]]);
    }
}

/// Sines and cosines of angles.
fn sines_of(angles: &[f64], out: &mut [[f64; 2]]) {
    for (angles, out) in angles.chunks(Lanes::COUNT).zip(out.chunks_mut(Lanes::COUNT)) {
        if angles.len() < IN_LANES {
            for (x, out) in angles.iter().zip(out) {
                *out = Scalar::sin_cos(*x).into();
            }
        } else {
            widely(Eight(angles, out));
        }
    }
}

/// Functions with the convention by which compiled programs call, the same on every system.
macro_rules! called {
    ($($(#[$about:meta])* fn $name:ident($($x:ident: $of:ty),*) $(-> $to:ty)? { $($body:tt)* })*) => {$(
        $(#[$about])*
        #[cfg(target_arch = "x86_64")]
        pub(crate) extern "sysv64" fn $name($($x: $of),*) $(-> $to)? { $($body)* }
        $(#[$about])*
        #[cfg(not(target_arch = "x86_64"))]
        pub(crate) extern "C" fn $name($($x: $of),*) $(-> $to)? { $($body)* }
    )*};
}

called! {
    /// As `sines_of`, for `count` angles; both lists lie in the memory of the caller, apart from each other.
    fn sines(count: usize, angles: *const f64, out: *mut [f64; 2]) {
        // SAFETY: the assemblers give lists of this length on the stack of the program
        let (angles, out) =
            unsafe { (std::slice::from_raw_parts(angles, count), std::slice::from_raw_parts_mut(out, count)) };
        sines_of(angles, out);
    }

    fn power(x: f64, exponent: f64) -> f64 {
        x.power(exponent)
    }

    fn atan2(x: f64, y: f64) -> f64 {
        Scalar::atan2(x, y)
    }

    fn hypot(x: f64, y: f64) -> f64 {
        Scalar::hypot(x, y)
    }

    fn round(x: f64) -> f64 {
        Cases::round(x)
    }
}

/// The function of an operation that is a call.
pub(crate) fn of(code: Code) -> *const () {
    match code {
        Code::Power => power as *const (),
        Code::Atan2 => atan2 as *const (),
        Code::Hypot => hypot as *const (),
        Code::Round => round as *const (),
        _ => unreachable!("an operation without a function"),
    }
}
