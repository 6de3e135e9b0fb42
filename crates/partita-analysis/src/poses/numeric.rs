//! Poses by following the motion from the start, the last step of each in a batch where a lattice applies.

use super::continuation::{Continuation, Ending, Start};
use super::field::{Duty, Field};
use super::goal::Target;
use super::lattice::{LastSteps, Lattice};
use super::nearest::nearest;
use super::outcome::{Outcome, PoseNumbers};
use partita_math::tolerance;
use partita_model::Model;
use partita_system::SystemError;

/// Paths from stations that would need shorter steps are not followed. Unit: characteristic displacement. Reason: next
/// to a limit the path from the start decides, and two paths there would cost twice.
pub(super) const SHORTEST_NEAR: f64 = 0.1 * tolerance::STRIDE;

/// Poses by following the motion.
pub(super) struct Numeric<'l, 'm> {
    pub continuation: Continuation<'m>,
    start: &'m Start,
    last_steps: Option<LastSteps<'l, 'm>>,
    /// The position found.
    pub there: Vec<f64>,
    /// Values that the goals reached.
    pub reached: Vec<f64>,
}

impl<'l, 'm> Numeric<'l, 'm> {
    pub fn new(
        model: &'m Model,
        t: f64,
        targets: &'m [Target],
        start: &'m Start,
        lattice: Option<&'l Lattice<'m>>,
    ) -> Self {
        let continuation = Continuation::new(model, targets, t);
        Self {
            continuation,
            start,
            last_steps: lattice.map(LastSteps::new),
            there: start.q.clone(),
            reached: start.y.clone(),
        }
    }

    /// Take the last steps of the poses of a batch together.
    pub fn batch<'v>(&mut self, values: impl Iterator<Item = &'v [f64]>) -> Result<(), SystemError> {
        match &mut self.last_steps {
            Some(last_steps) => last_steps.batch(&mut self.continuation, values),
            None => Ok(()),
        }
    }

    /// Points between which the goals vary linearly, one after the other, forward and backward.
    fn detours(&self, values: &[f64]) -> [Vec<Vec<f64>>; 2] {
        let one_by_one = |order: &mut dyn Iterator<Item = usize>| {
            let mut now = self.start.y.clone();
            let mut by = Vec::with_capacity(values.len());
            for k in order {
                now[k] = values[k];
                by.push(now.clone());
            }
            by.pop();
            by
        };
        [one_by_one(&mut (0..values.len())), one_by_one(&mut (0..values.len()).rev())]
    }

    /// Pose `i` of the last batch.
    pub fn pose(&mut self, i: usize, values: &[f64]) -> Result<PoseNumbers, SystemError> {
        self.reached.copy_from_slice(values);
        if let Some(last_steps) = &self.last_steps {
            if let Some(q) = last_steps.pose(i) {
                self.there.copy_from_slice(q);
                return Ok(PoseNumbers::closed(false));
            }
            if let Some(start) = last_steps.near(i) {
                if self.continuation.go_near(start, values, SHORTEST_NEAR, &mut self.there)? {
                    return Ok(PoseNumbers::closed(false));
                }
            }
        }
        let first = self.continuation.go(self.start, values, &mut self.there)?;
        if first == Ending::There {
            return Ok(self.agreeing(values, false));
        }
        let reached = self.continuation.field.y.clone();
        let here = self.there.clone();
        if self.start.free.iter().filter(|f| **f).count() > 1 {
            for by in self.detours(values) {
                if self.continuation.go_by(self.start, &by, values, &mut self.there)? == Ending::There {
                    return Ok(self.agreeing(values, true));
                }
            }
        }
        let found = self.open(&here, &reached, values, nearest)?;
        let outcome = if matches!(first, Ending::Crossing(_)) { Outcome::Singular } else { found.outcome };
        Ok(PoseNumbers { outcome, ..found })
    }

    /// The closure error with the goals at these values, from a closed position with others: open, or closed on another
    /// branch.
    pub fn open(
        &mut self,
        from: &[f64],
        y: &[f64],
        values: &[f64],
        nearest: impl FnOnce(&mut Field<'m>, &mut Vec<f64>, &[f64]) -> Result<(), SystemError>,
    ) -> Result<PoseNumbers, SystemError> {
        self.there.clear();
        self.there.extend_from_slice(from);
        self.continuation.begin(self.start);
        let f = &mut self.continuation.field;
        f.y.copy_from_slice(y);
        let m = f.closings();
        f.duty[..m].fill(Duty::Soft);
        nearest(f, &mut self.there, values)?;
        let goals_met = f.worst(Duty::Hard) <= tolerance::CLOSED.sqrt();
        let (culprit, shortfall, angle) = f.closure_error();
        let closes = goals_met && f.worst(Duty::Soft) <= tolerance::CLOSED.sqrt();
        let outcome = if closes { Outcome::OtherBranch } else { Outcome::Open };
        let (shortfall, angle) = if goals_met { (shortfall, angle) } else { (f64::NAN, f64::NAN) };
        self.reached.copy_from_slice(y);
        Ok(PoseNumbers { outcome, shortfall, angle, culprit, detour: false })
    }

    /// Goals that depend on the others must have reached their targets.
    pub fn agreeing(&mut self, values: &[f64], detour: bool) -> PoseNumbers {
        self.continuation.field.look(&self.there);
        let f = &self.continuation.field;
        let off = |k: usize| (f.y[k] - values[k]).abs() / f.targets[k].displacement;
        let dependent = (0..values.len()).filter(|&k| !self.start.free[k]);
        match dependent.max_by(|&i, &j| off(i).total_cmp(&off(j))) {
            Some(k) if off(k) > tolerance::EQUAL => {
                PoseNumbers { outcome: Outcome::Contradiction, shortfall: f.y[k], angle: f64::NAN, culprit: k, detour }
            }
            _ => PoseNumbers::closed(detour),
        }
    }
}
