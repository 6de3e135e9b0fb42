//! Explicit closing of user-defined equations: one block, the user function.                                     (37)

use super::{Equations, ExplicitClosing, UserSystem};
use crate::closing::{Block, BlockState, Closing};
use crate::reduction::Reduction;
use crate::system::{SystemError, SystemRef};
use partita_math::dense;

/// The user's closing function as one explicit block.
pub(super) struct UserClosing<'e, E: Equations> {
    user_system: SystemRef<'e, UserSystem<E>>,
    inputs: Vec<usize>,
    blocks: [Block; 1],
    state: [BlockState; 1],
    c: Vec<f64>,
    factor: Vec<f64>,
    pivots: Vec<usize>,
}

impl<'e, E: Equations> UserClosing<'e, E> {
    /// Check the function's coordinates against the rank of C and choose the rows that determine them, by pivoting.
    pub(super) fn new(
        user_system: SystemRef<'e, UserSystem<E>>,
        t: f64,
        q: &[f64],
        inputs: Option<&[usize]>,
    ) -> Result<Self, SystemError> {
        let owner = user_system.clone();
        let e = &owner.equations;
        let refuse = |message: String| Err(SystemError::argument("closing", message));
        let Some(closed) = e.explicit_closing().map(ExplicitClosing::dependent) else {
            return refuse(
                "explicit closing of a user-defined system needs a closing function and the coordinates it computes \
                 (closing=); give them, or use another formulation"
                    .into(),
            );
        };
        let n = e.n();
        let mut unknown = closed.to_vec();
        unknown.sort_unstable();
        unknown.dedup();
        if unknown.len() != closed.len() || unknown.last().is_some_and(|&i| i >= n) || unknown.len() > e.holonomic() {
            return refuse(format!(
                "the closing function computes the coordinates {closed:?}; they must be distinct, below {n}, and at \
                 most as many as the {} position constraints",
                e.holonomic()
            ));
        }
        let own: Vec<usize> = (0..n).filter(|i| !unknown.contains(i)).collect();
        let words = |x: &[usize]| x.iter().map(|&i| e.name(i)).collect::<Vec<_>>().join(", ");
        if inputs.is_some_and(|asked| asked != own) {
            return refuse(format!(
                "the closing function takes {} as inputs, but {} were requested; give a function that computes the \
                 others",
                words(&own),
                words(inputs.unwrap_or_default())
            ));
        }
        let mut r = Reduction::new(&*user_system, unknown.len());
        r.position(t, q)?;
        r.refresh_scales(t, q)?;
        if r.set_partition(t, &own).is_err() {
            return refuse(format!(
                "the constraints do not determine {} from {} here (C_D is singular): compute other coordinates in \
                 the closing function, or start at another position",
                words(&unknown),
                words(&own)
            ));
        }
        let m = unknown.len();
        let rows = r.planned.partition.rows.clone();
        let block = Block { rows, words: format!("closing function for {}", words(&unknown)), unknown, explicit: true };
        let mut new = Self {
            user_system,
            inputs: own,
            blocks: [block],
            state: [BlockState { branch: 0, pivot: 0.0 }],
            c: vec![0.0; e.rows() * n],
            factor: vec![0.0; m * m],
            pivots: vec![0; m],
        };
        new.judge(t, q)?;
        Ok(new)
    }

    /// Sign and size of the determinant of C_D: its size over the product of its rows' lengths, their largest volume.
    fn judge(&mut self, t: f64, q: &[f64]) -> Result<(), SystemError> {
        let n = q.len();
        let Block { rows, unknown, .. } = &self.blocks[0];
        let m = unknown.len();
        self.user_system.equations.jacobian(t, q, &mut self.c)?;
        for (i, &row) in rows.iter().enumerate() {
            let line = &mut self.factor[i * m..(i + 1) * m];
            line.iter_mut().zip(unknown).for_each(|(x, &j)| *x = self.c[row * n + j]);
            // scaled to length 1, so that the determinant is the volume
            let length = dense::dot(line, line).sqrt();
            line.iter_mut().for_each(|x| *x /= length);
        }
        let volume = match dense::lu(&mut self.factor, m, &mut self.pivots) {
            Ok(()) => dense::lu_determinant(&self.factor, m, &self.pivots),
            Err(_) => 0.0,
        };
        let branch = if volume > 0.0 { 1 } else { -i8::from(volume < 0.0) };
        self.state[0] = BlockState { branch, pivot: volume.abs().min(1.0) };
        Ok(())
    }
}

impl<E: Equations> Closing for UserClosing<'_, E> {
    fn inputs(&self) -> &[usize] {
        &self.inputs
    }
    fn blocks(&self) -> &[Block] {
        &self.blocks
    }
    fn close(&mut self, t: f64, q: &mut [f64]) -> Result<(), SystemError> {
        let e = &self.user_system.equations;
        if let Some(closing) = e.explicit_closing() {
            closing.close(t, q)?;
        }
        if let Some(i) = q.iter().position(|x| !x.is_finite()) {
            return Err(SystemError::NotFinite {
                what: format!("{}, computed by the closing function,", e.name(i)),
                t,
            });
        }
        self.judge(t, q)
    }
    fn state(&self) -> &[BlockState] {
        &self.state
    }
    /// The user function decides the branch.
    fn set_branches(&mut self, _branches: &[i8]) {}
}
