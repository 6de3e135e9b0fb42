//! The closed position next to a given one: all loops at once by Newton's method, over any scalar.

use super::implicit::{Implicit, Straight, StraightScratch};
use super::instant::Instant;
use crate::evaluator::Evaluator;
use crate::model::Model;
use partita_math::scalar::Scalar;
use partita_math::tolerance;
use partita_system::prelude::*;
use partita_system::{SystemError, SystemRef};

/// Iterations: from a tenth of a characteristic displacement each squares the remaining error.
const ITERATIONS: usize = 3;

/// Rows and velocities by which all loops close near one closed position, the other velocities held: see
/// [`Model::adjacent_closing`].
pub struct AdjacentClosing {
    block: Implicit,
    /// Ratio of the pivots where it was planned.
    ratio: f64,
}

/// Memory of [`AdjacentClosing::close`].
pub struct AdjacentScratch<S: Scalar>(StraightScratch<S>);

/// How a position closed.
#[derive(Clone, Copy, Debug)]
pub struct Adjacent<S> {
    /// Largest correction of the first, the second and the third iteration, in characteristic displacements.
    pub corrections: [S; ITERATIONS],
    /// Determinant of the block at the last iteration.
    pub determinant: S,
    /// Largest closure error of any loop at the end, in characteristic displacements; 0 where all rows are corrected.
    pub closure_error: S,
}

impl<S: Scalar> AdjacentScratch<S> {
    /// For positions of this model, whatever the plan.
    pub fn new(model: &Model, e: &Evaluator<S>) -> Self {
        Self(StraightScratch::new(model, e, model.size().holonomic.min(model.size().nv)))
    }
}

impl AdjacentClosing {
    fn new(model: SystemRef<'_, Model>, t: f64, q: &[f64], held: &[usize]) -> Result<Option<Self>, SystemError> {
        let (size, c) = (model.size(), derivatives(&model, t, q)?);
        let at = Instant { model, c };
        let free: Vec<bool> = (0..size.nv).map(|v| !held.contains(&v)).collect();
        let rows: Vec<usize> = at.rows(&free).into_iter().filter(|&r| r < size.holonomic).collect();
        let mut unknown = at.columns(&rows, &free);
        if rows.is_empty() || unknown.len() != rows.len() {
            return Ok(None);
        }
        unknown.sort_unstable();
        let block = Implicit::new(&at, rows, unknown, &[]);
        let (_, ratio) = block.determinant(&at.model, &at.c);
        Ok((ratio > 0.0).then_some(Self { block, ratio }))
    }

    /// Determinant of the block at the closed position q; none where the plan has become poor.
    ///
    /// # Errors
    /// Those of functions that the conditions call.
    pub fn determinant(&self, model: &Model, t: f64, q: &[f64]) -> Result<Option<f64>, SystemError> {
        let (determinant, ratio) = self.block.determinant(model, &derivatives(model, t, q)?);
        Ok((ratio >= tolerance::MUCH_SMALLER * self.ratio && determinant != 0.0).then_some(determinant))
    }

    /// Moves the unknowns of q, a position near that of the plan, to where the loops are closed, without branches.
    ///
    /// `e` and `model` are those of the plan.
    ///
    /// # Errors
    /// Those of functions that the conditions call.
    pub fn close<S: Scalar>(
        &self,
        model: &Model,
        e: &Evaluator<S>,
        t: S,
        q: &mut [S],
        AdjacentScratch(memory): &mut AdjacentScratch<S>,
    ) -> Result<Adjacent<S>, SystemError> {
        let mut found =
            Adjacent { corrections: [S::zero(); ITERATIONS], determinant: S::one(), closure_error: S::zero() };
        for correction in &mut found.corrections {
            let Straight { largest, determinant } = self.block.iterate((model, e), t, q, memory)?;
            *correction = largest;
            found.determinant = determinant;
        }
        // what the last correction leaves of the rows of the block is its square; others are not corrected
        if self.block.rows.len() == memory.phi.len() {
            return Ok(found);
        }
        e.closings(t, q, &mut memory.scratch, &mut memory.phi, &mut memory.c, &mut memory.a)?;
        for (row, phi) in memory.phi.iter().enumerate() {
            let error = phi.abs() / S::from_f64(model.structure().rows[row].size());
            found.closure_error = found.closure_error.max(error);
        }
        Ok(found)
    }
}

/// Values of C at (t, q).
fn derivatives(model: &Model, t: f64, q: &[f64]) -> Result<Vec<f64>, SystemError> {
    let size = model.size();
    let (mut phi, mut a) = (vec![0.0; size.holonomic], vec![0.0; size.rows]);
    let mut c = vec![0.0; model.pattern().nnz()];
    model.position(t, q, &mut model.scratch(), &mut phi, &mut c, &mut a)?;
    Ok(c)
}

impl Model {
    /// A plan by which all loops close near the closed position q with the `held` velocities unchanged; none where no
    /// velocities that are not held determine the others.
    ///
    /// # Errors
    /// Those of functions that the conditions call.
    pub fn adjacent_closing(&self, t: f64, q: &[f64], held: &[usize]) -> Result<Option<AdjacentClosing>, SystemError> {
        AdjacentClosing::new(self.into(), t, q, held)
    }
}
