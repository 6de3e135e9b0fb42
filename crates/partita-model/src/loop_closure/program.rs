//! A closing as a program, for thousands of values of its inputs.                                                  (37)

use super::LoopClosing;
use partita_math::program::Program;
use partita_math::scalar::{Recorder, Recording, Scalar};
use partita_system::prelude::*;
use partita_system::SystemError;

/// The dependent coordinates of a closing as functions of its inputs, on its present branches at one time.
///
/// ```text
/// solve   q within half a turn, with the inputs as wanted ──► q | pivot of each block with a sign | excess
/// check   q ──► closure error: the sum of all rows of Φ, each in its characteristic displacement
/// ```
/// The excess is above 0 where the loops do not close.
#[derive(Clone, Debug)]
pub struct ClosingProgram {
    /// The closed forms.
    pub solve: Program,
    /// Whether they close all loops.
    pub check: Program,
    /// Coordinates.
    pub coordinates: usize,
    /// Blocks with a sign.
    pub pivots: usize,
}

impl ClosingProgram {
    /// Output of `solve` that is a pivot.
    pub fn pivot(&self, k: usize) -> usize {
        self.coordinates + k
    }

    /// Output of `solve` that is the excess.
    pub fn excess(&self) -> usize {
        self.coordinates + self.pivots
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
        let (time, mut pivots) = (Recorder::from_f64(t), 0);
        let solve = Recording::new(size.nq, |x| {
            let (mut q, mut memory) = (x.to_vec(), self.scratch_over(&e));
            let excess = self.close_over(&e, time, &mut q, &mut memory)?;
            let of_blocks: Vec<Recorder> = self.pivots_over(&memory).collect();
            pivots = of_blocks.len();
            Ok::<_, SystemError>([q, of_blocks, vec![excess]].concat())
        });
        let check = Recording::new(size.nq, |q| {
            let zeros = |n: usize| vec![Recorder::zero(); n];
            let (mut phi, mut c, mut a) = (zeros(size.holonomic), zeros(model.pattern().nnz()), zeros(size.rows));
            e.position(time, q, &mut e.scratch(), &mut phi, &mut c, &mut a)?;
            Ok::<_, SystemError>(vec![model.open(&phi)])
        });
        let of = |made: Recording| Program::new(&made, 0..0);
        Some(ClosingProgram { solve: of(solve.ok()?), check: of(check.ok()?), coordinates: size.nq, pivots })
    }
}
