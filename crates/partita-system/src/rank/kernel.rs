//! Phi and C of the loop closures at one position as dense matrices in natural sizes, and their singular values.

use crate::manifold::scaled::Scaled;
use crate::manifold::truncated::{Cut, Motions, Truncated};
use crate::manifold::{ClosingScratch, Ending};
use crate::system::{ConstrainedSystem, SystemError};
use partita_math::factor::{svd, svd_full};

/// Result of a closing.
pub struct Closed {
    /// Largest relative residual of a row.
    pub closure_error: f64,
    /// The displacement, in characteristic displacements, summed over the iterations.
    pub moved: Vec<f64>,
}

/// The loop closures of a system, drives released, at time t.
pub struct Kernel<'s, S: ConstrainedSystem> {
    pub(super) closings: Truncated<'s, S>,
    memory: ClosingScratch,
    /// Holonomic rows that prescribe no motion.
    pub rows: Vec<usize>,
    /// Closure error of each of them under a large displacement.
    pub sizes: Vec<f64>,
}

impl<'s, S: ConstrainedSystem> Kernel<'s, S> {
    /// `sizes` of rows that the system does not know are 1.
    pub fn new(system: &'s S, t: f64) -> Self {
        let mut scaled = Scaled::known(system, &[]);
        scaled.idle.iter_mut().enumerate().for_each(|(i, idle)| *idle = system.structure().rows[i].is_drive);
        let rows: Vec<usize> = scaled.active().collect();
        Self {
            sizes: rows.iter().map(|&i| scaled.length[i]).collect(),
            rows,
            closings: Truncated::new(scaled, t, Cut::Level(0.0)),
            memory: ClosingScratch::default(),
        }
    }

    /// Velocities.
    pub fn velocities(&self) -> usize {
        self.closings.scaled.displacement.len()
    }

    /// Phi of the system at the last position.
    pub fn raw_phi(&self) -> &[f64] {
        &self.closings.scaled.raw_phi
    }

    /// Values of its C there.
    pub fn raw_c(&self) -> &[f64] {
        &self.closings.scaled.raw_c
    }

    /// Largest relative residual of a row at q.
    pub fn closure_error(&mut self, q: &[f64]) -> Result<f64, SystemError> {
        self.closings.open_at(q)
    }

    /// Self-stresses at q: orthonormal combinations of rows, relative to their sizes, that do no work on any motion. By
    /// singular values: with those of a pivoted QR changes of rounded sheets do not converge.
    pub fn stresses(&mut self, q: &[f64], cut: Cut) -> Result<Vec<Vec<f64>>, SystemError> {
        let (_, c) = self.closings.look(q)?;
        let Ok(f) = svd_full(&c) else { return Ok(Vec::new()) };
        let column = |j: usize| (0..f.u.rows()).map(|i| f.u[(i, j)]).collect();
        Ok((cut.count(&f.s)..f.u.cols()).map(column).collect())
    }

    /// Singular values at q, descending.
    pub fn values(&mut self, q: &[f64]) -> Result<Vec<f64>, SystemError> {
        let (_, c) = self.closings.look(q)?;
        Ok(svd(&c).map_or_else(|_| vec![0.0], |f| f.s))
    }

    /// Pivots at q, and the motions free of all rows.
    pub fn motions(&mut self, q: &[f64], cut: Cut) -> Result<Motions, SystemError> {
        self.closings.cut = cut;
        self.closings.motions(q)
    }

    /// Size of a displacement (in characteristic displacements): the fastest coordinate, or its invariant over axes.
    pub fn travel(&self, y: &[f64]) -> f64 {
        self.closings.travel(y)
    }

    /// Move q by y, in characteristic displacements.
    pub fn step(&mut self, q: &mut [f64], y: &[f64]) {
        self.closings.step(q, 1.0, y);
    }

    /// Gauss-Newton with all rows by the accepted pivots. `None` where the displacements do not converge.
    ///                                                                                                           (T1)
    pub fn close(&mut self, q: &mut [f64], cut: Cut) -> Result<Option<Closed>, SystemError> {
        self.closings.cut = cut;
        let closed = match self.closings.close(q, &mut self.memory) {
            Err(SystemError::NotFinite { .. }) => return Ok(None),
            closed => closed?,
        };
        let moved = self.closings.moved.clone();
        Ok((closed.ending <= Ending::AtRest).then_some(Closed { closure_error: closed.closure_error.worst, moved }))
    }
}
