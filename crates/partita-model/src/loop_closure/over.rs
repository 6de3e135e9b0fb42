//! The plan executed over any scalar: without choices or comparisons.                                            (37)

use super::arm::Pose;
use super::close::planar_side;
use super::implicit::{StraightScratch, STRAIGHT};
use super::planar::Fit;
use super::{spatial, LoopClosing, Work};
use crate::evaluator::Evaluator;
use crate::value;
use partita_math::scalar::Scalar;
use partita_math::spatial::Mat3;
use partita_system::SystemError;
use std::sync::Arc;

/// Memory of [`LoopClosing::close_over`].
pub struct ClosingScratch<S: Scalar> {
    pose: Pose<S>,
    straight: StraightScratch<S>,
    /// Of each step.
    pivots: Vec<[S; 2]>,
}

impl LoopClosing<'_> {
    /// Memory for closing over other numbers, of the same model.
    pub fn scratch_over<S: Scalar>(&self, e: &Evaluator<S>) -> ClosingScratch<S> {
        let block = |s: &super::Step| if let Work::Implicit(b) = &s.work { b.rows.len() } else { 0 };
        let n = self.steps.iter().map(block).max().unwrap_or(0);
        let straight = StraightScratch::new(&self.model, e, n);
        let pivots = vec![[S::one(); 2]; self.steps.len()];
        ClosingScratch { pose: Pose::new(&self.graph, &e.numbers), straight, pivots }
    }

    /// The pivot of each block with a sign, in the order of `state`, after [`close_over`](Self::close_over).
    pub fn pivots_over<'a, S: Scalar>(&'a self, memory: &'a ClosingScratch<S>) -> impl Iterator<Item = S> + 'a {
        self.entries
            .iter()
            .filter(|(step, k)| self.steps[*step].signs[*k] != 0)
            .map(|&(step, k)| memory.pivots[step][k])
    }

    /// Replaces the dependent coordinates in q by those that close the loops for its inputs, on the present branches,
    /// over any scalar: derivatives of the closing by its inputs and by the parameters of `e`, eight closings at once,
    /// ...
    ///
    /// `e` must come from this closing's model. q holds a position within half a turn (for implicit blocks: a tenth of
    /// a characteristic displacement) on entry. Returns a number that is above 0 where the loops do not close there; it
    /// is not evaluated here. The spin of a link between two balls is given by q where its own input does not determine
    /// it.
    pub fn close_over<S: Scalar>(
        &self,
        e: &Evaluator<S>,
        t: S,
        q: &mut [S],
        memory: &mut ClosingScratch<S>,
    ) -> Result<S, SystemError> {
        self.close_in(STRAIGHT, e, t, q, memory)
    }

    /// As [`close_over`](Self::close_over), with this many iterations in each implicit block.
    pub(crate) fn close_in<S: Scalar>(
        &self,
        iterations: usize,
        e: &Evaluator<S>,
        t: S,
        q: &mut [S],
        memory: &mut ClosingScratch<S>,
    ) -> Result<S, SystemError> {
        if !Arc::ptr_eq(&e.placed, &self.model.own.placed) {
            let message = "the evaluator and the closing belong to different models; create both from one model";
            return Err(SystemError::argument("evaluator", message.into()));
        }
        let ClosingScratch { pose, straight, pivots } = memory;
        for (i, edge) in self.graph.edges.iter().enumerate() {
            // quantities that are not coordinates of q keep their values in this closing
            (pose.x[i], pose.balls[i]) = (S::from_f64(self.pose.x[i]), Mat3::from_f64(self.pose.balls[i].0));
            if edge.in_tree() {
                pose.read(&self.graph, i, q);
            }
        }
        let mut fit = Fit::good();
        for (step, pivots) in self.steps.iter().zip(pivots) {
            match &step.work {
                Work::Drive(d, edge) => {
                    let drive = &e.drives[*d];
                    let memory = &mut straight.scratch.memory;
                    pose.x[*edge] = match e.numbers.drives[drive.number].first() {
                        Some(x) => x,
                        None => value::motion_at(&drive.motion, &e.callers, t, &drive.name, memory)?[0],
                    };
                    if let Some((i, _)) = drive.tree {
                        q[i] = pose.x[*edge];
                    }
                    continue;
                }
                Work::Plane(p, plane) => {
                    let count = plane.joints.len();
                    let mut sides = [planar_side(p, 0, &self.graph, pose); 3];
                    for (k, side) in sides.iter_mut().enumerate().take(count).skip(1) {
                        *side = planar_side(p, k, &self.graph, pose);
                    }
                    let (x, pivot, own) = plane.solve(&sides[..count], step.signs[0], self.tolerance);
                    plane.joints.iter().zip(x).for_each(|(j, x)| pose.x[j.edge] = x);
                    pivots[0] = pivot;
                    fit = fit.or(own);
                }
                Work::Space(p) => {
                    let found = spatial::solve(&self.graph, p, step.signs, pose);
                    found.write(pose);
                    *pivots = found.pivots;
                    fit = fit.or(found.fit);
                }
                Work::Law(law) => {
                    pose.x[law.edge] = law.value(e, q)?;
                    q[law.coordinate()] = pose.x[law.edge];
                    continue;
                }
                Work::Implicit(block) => {
                    fit = fit.or(block.solve_straight((&*self.model, e), t, q, straight, iterations)?);
                    step.edges.iter().for_each(|&i| pose.read(&self.graph, i, q));
                    continue;
                }
            }
            step.edges.iter().for_each(|&i| pose.write(&self.graph, i, q));
        }
        Ok(fit.excess)
    }
}
