//! A closing as a program, for thousands of values of its inputs.                                                  (37)

use super::LoopClosing;
use partita_math::program::Program;
use partita_math::scalar::{Recorder, Recording, Scalar};
use partita_system::prelude::*;
use partita_system::SystemError;

/// The dependent coordinates of a closing as functions of its inputs, on its present branches at one time.
///
/// ```text
/// inputs    q of a position within half a turn, with the inputs as wanted
/// outputs   q | pivot of each block with a sign | excess: above 0 where it does not close | closure error
/// ```
/// The closure error is the sum of all rows of Φ, each in its characteristic displacement.
#[derive(Clone, Debug)]
pub struct ClosingProgram {
    /// The program.
    pub program: Program,
    /// Coordinates.
    pub coordinates: usize,
    /// Blocks with a sign.
    pub pivots: usize,
}

impl ClosingProgram {
    /// Output of a pivot.
    pub fn pivot(&self, k: usize) -> usize {
        self.coordinates + k
    }

    /// Output of the excess.
    pub fn excess(&self) -> usize {
        self.coordinates + self.pivots
    }

    /// Output of the closure error.
    pub fn closure_error(&self) -> usize {
        self.excess() + 1
    }
}

impl LoopClosing<'_> {
    /// The program of this closing at t; none where a block is implicit, where a function is called, and where joints
    /// in the plane lock whole turns, which are counted one pose at a time.
    pub fn program(&self, t: f64) -> Option<ClosingProgram> {
        let model = &*self.model;
        if self.locks_turns || !self.is_explicit() {
            return None;
        }
        let e = model.over::<Recorder>().ok()?;
        let size = model.size();
        let mut pivots = 0;
        let made = Recording::new(size.nq, |x| {
            let (t, mut q, mut room) = (Recorder::from_f64(t), x.to_vec(), self.room_over(&e));
            let excess = self.close_over(&e, t, &mut q, &mut room)?;
            let zeros = |n: usize| vec![Recorder::zero(); n];
            let (mut phi, mut c, mut a) = (zeros(size.holonomic), zeros(model.pattern().nnz()), zeros(size.rows));
            e.position(t, &q, &mut e.scratch(), &mut phi, &mut c, &mut a)?;
            let of_blocks: Vec<Recorder> = self.pivots_over(&room).collect();
            pivots = of_blocks.len();
            Ok::<_, SystemError>([q, of_blocks, vec![excess, model.open(&phi)]].concat())
        });
        Some(ClosingProgram { program: Program::new(&made.ok()?, 0..0), coordinates: size.nq, pivots })
    }
}
