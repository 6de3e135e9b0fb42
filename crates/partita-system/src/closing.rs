//! Explicit closing: the dependent coordinates as functions of the independent ones.           (37)

use crate::error::SystemError;

/// One step of an explicit closing. The rows of a block contain, besides its own unknown velocities, only inputs and
/// unknowns of earlier blocks: C_D is block-triangular, its diagonal blocks are regular.
///
/// A step may have no rows and no unknowns: steps that are coupled in C (a loop cut where two of them meet, the two
/// signs of a spatial loop) are consecutive, and the last one contains the rows of all.
#[derive(Clone, Debug, PartialEq)]
pub struct Block {
    /// Rows of C that determine the unknowns (as many as unknowns).
    pub rows: Vec<usize>,
    /// Velocities solved for.
    pub unknown: Vec<usize>,
    /// Whether it is solved in closed form, or by Newton's method with the block's own Jacobian.
    pub explicit: bool,
    /// In words: kind and joints, such as `RRR dyad (joints "B", "C", "D")`.
    pub words: String,
}

/// State of one block at a position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlockState {
    /// Sign ε of the pivot: which of the two solutions; 0 where a block has only one (or is implicit).
    pub branch: i8,
    /// The pivot over its largest possible value, without its sign: 0 at a dead point of the block, 1 at best. (L1, 39)
    pub pivot: f64,
}

/// `q_D = g(q_I, t; ε)`: closes the loops for given inputs by inverse kinematics, the branches kept.
pub trait Closing {
    /// Input velocities, ascending.
    fn inputs(&self) -> &[usize];
    /// Blocks in order of solution.
    fn blocks(&self) -> &[Block];
    /// Replace the dependent coordinates of q by those that close the loops on the kept branches.
    ///
    /// The dependent values found in q decide only how many whole turns an angle has made (the result is the nearest
    /// one), and where implicit blocks start. Fails with [`SystemError::Limit`] where a block cannot close.
    fn close(&mut self, t: f64, q: &mut [f64]) -> Result<(), SystemError>;
    /// As `close`, on the branches nearest to the dependent coordinates found in q, which become the kept ones: for a
    /// change point, beyond which a block continues with the other sign.
    ///
    /// Returns the ambiguity: the largest ratio, over the blocks, of the distances of the solution taken and of the
    /// next one from q; 0 where there was no choice, 1 where both are as near. A closing without branches of its own
    /// just closes. Costs all solutions of each block.
    fn follow(&mut self, t: f64, q: &mut [f64]) -> Result<f64, SystemError> {
        self.close(t, q).map(|()| 0.0)
    }
    /// Branch and pivot of each block at the last `close`.
    fn state(&self) -> &[BlockState];
    /// Iterations of Newton's method so far, in blocks without a closed form.
    fn iterations(&self) -> u64 {
        0
    }
    /// Choose other branches (one sign per block; 0 leaves a block as it is).
    fn set_branches(&mut self, branches: &[i8]);
}
