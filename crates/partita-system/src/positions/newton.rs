//! Dependent coordinates by Newton's method: `Φ(q, t) = 0` is solved for q_D from the predicted position, q_I unchanged
//! (34).
//!
//! Classical coordinate partitioning (Wehage, Haug 1982). At dead points of fixed independent
//! coordinates, and at singular positions of the mechanism, the equations have two solutions that meet. Newton's method
//! starts from the prediction by the velocities and so crosses singular positions on the right one; a stage that might
//! have found either, and a step in which velocities jump, are repeated. If no step succeeds, as at most dead points of
//! fixed coordinates, the run ends with a message.

use super::independent::{Core, Dependent, Point};
use crate::error::Result;
use crate::manifold::kept_rows::{KeptRows, TO_ROUND_OFF};
use crate::manifold::{close, ClosingScratch};
use crate::record::{Correction, History};
use crate::reduction::Reduction;
use crate::singular::dead_point::dead_point;
use crate::system::{ConstrainedSystem, SystemError};
use crate::tangent::partition::Chosen;
use crate::tangent::{TangentChoice, TangentLevels};
use partita_math::tolerance;

/// Newton's method for q_D.
#[derive(Default)]
pub struct Newton {
    /// Iterations so far, without those for outputs.
    iterations: u64,
    memory: ClosingScratch,
}

impl Newton {
    /// `q_D ← q_D − C_D⁻¹ Φ` until only round-off remains.                                                       (34)
    ///
    /// Returns, near a singular position, the smaller part of the two distances from it, before and after; else 1. Where
    /// that is much smaller, the start was nearly half-way between two solutions, and either one may be found.
    fn close<S: ConstrainedSystem>(&mut self, r: &mut Reduction<S>, t: f64, q: &mut [f64], near: bool) -> Result<f64> {
        let mut rows = KeptRows::new(r, t, Correction::Partition).measuring(near);
        let done = close(&mut rows, q, &TO_ROUND_OFF, &mut self.memory)?;
        let first = rows.first_distance;
        self.iterations += done.iterations as u64;
        if done.is_closed() {
            return Ok(first.map_or(1.0, |first| {
                let ratio = r.distance().0 / first;
                ratio.min(1.0 / ratio)
            }));
        }
        let row = r.closure_error().1;
        let name = &r.system.structure().rows[row].description;
        let block = format!("{name} (Newton's method for the dependent coordinates, {} iterations)", done.iterations);
        Err(SystemError::Limit { block, t, shortfall: r.at.phi[row].abs() })
    }

    /// From the predicted position, or else from the end of the last step.
    fn find<'s, S: ConstrainedSystem>(
        &mut self,
        core: &mut Core,
        tangent: &mut Chosen<'s, S>,
        (t, y): (f64, &[f64]),
        at: Point,
        near: bool,
    ) -> Result<()> {
        let closed = self.close(tangent.reduction(), t, &mut core.q, near);
        if matches!(closed, Ok(ratio) if ratio < tolerance::MUCH_SMALLER && t > core.home_t && at != Point::Inside) {
            return Err(undecided(core, tangent, t));
        }
        if closed.is_ok() {
            return Ok(());
        }
        // a long step may predict poorly: once more from the end of the last one
        core.q.copy_from_slice(&core.home);
        core.states.scatter(y, &mut core.q);
        let closed = self.close(tangent.reduction(), t, &mut core.q, near);
        if closed.is_err() {
            core.q.copy_from_slice(&core.home);
        }
        closed.map(|_| ()).map_err(|e| tangent.blame(t, &core.home, e))
    }
}

/// Message where two solutions cannot be distinguished.
fn undecided<S: ConstrainedSystem>(core: &Core, tangent: &Chosen<S>, t: f64) -> SystemError {
    let seen = "they do not determine on which of two branches the others continue".to_string();
    let r = tangent.seen();
    dead_point(&*r.system, r.rank(), t, &core.q, &r.planned.partition.independent, seen)
}

impl<'s, S: ConstrainedSystem> Dependent<'s, S, Chosen<'s, S>> for Newton {
    const SOLVES: bool = true;

    fn solve(&mut self, core: &mut Core, tangent: &mut Chosen<'s, S>, t: f64, y: &[f64], at: Point) -> Result<()> {
        // the prediction by the velocities is nearest, and selects the right solution where solutions cross
        core.predict(&*tangent.reduction().system, t, y, at);
        let near = core.continuity.is_near();
        let before = self.iterations;
        let found = self.find(core, tangent, (t, y), at, near);
        if at == Point::Inside {
            self.iterations = before;
        }
        found
    }

    /// Message where two solutions cannot be distinguished.
    fn undecided(&mut self, core: &Core, tangent: &Chosen<'s, S>, t: f64) -> SystemError {
        undecided(core, tangent, t)
    }

    fn report(&self, history: &mut History) {
        history.counters.newton_iterations = self.iterations;
    }
}
