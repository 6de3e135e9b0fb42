//! Poses by closed forms, many side by side.
//!
//! Each lane follows the path of its pose, with the steps that [`Explicit::pose`] takes where nothing limits them. A
//! lane in which a step meets anything else leaves its pose to it; the next pose takes the lane.

use super::explicit::{Explicit, Path};
use super::many::put;
use super::outcome::PoseNumbers;
use crate::outputs::Rows;
use partita_math::program::Work;
use partita_math::scalar::Lanes;
use partita_math::tolerance;
use partita_model::loop_closure::ClosingProgram;
use partita_system::SystemError;
use std::ops::Range;
use std::sync::Arc;

/// Groups of eight poses to an instruction. Reason: four hide the latency of the arithmetic, and their work still lies in the
/// first cache.
const GROUPS: usize = 4;
const LANES: usize = GROUPS * Lanes::COUNT;
/// Poses that lanes take from one list.
pub(super) const BATCH: usize = 16 * LANES;
/// From this many poses on a closing is recorded. Reason: recording takes as long as some hundreds of poses one by one.
pub(super) const WORTH_A_RECORDING: usize = 256;

/// A pose under way.
#[derive(Clone, Copy)]
struct Lane {
    pose: usize,
    path: Path,
    next: f64,
}

/// Lanes of one thread.
pub(super) struct PoseLanes {
    program: Arc<ClosingProgram>,
    work: Work<Lanes, GROUPS>,
    check: Work<Lanes, GROUPS>,
    /// Poses in the lanes of `check`.
    unchecked: Vec<usize>,
    lanes: [Option<Lane>; LANES],
    /// Pivots of each lane at the end of its last step, block by block.
    pivots: Vec<[f64; LANES]>,
}

impl PoseLanes {
    pub fn new(program: &Arc<ClosingProgram>) -> Self {
        Self {
            work: program.solve.work(),
            check: program.check.work(),
            unchecked: Vec::with_capacity(LANES),
            lanes: [None; LANES],
            pivots: vec![[0.0; LANES]; program.pivots],
            program: program.clone(),
        }
    }

    /// All poses of a range, those that need more than full steps by `one`.
    pub fn fill<'v>(
        &mut self,
        poses: Range<usize>,
        of: impl Fn(usize) -> &'v [f64],
        one: &mut Explicit,
        rows: &mut Rows,
    ) -> Result<(), SystemError> {
        let mut waiting = poses;
        let mut left = Vec::new();
        loop {
            let mut busy = false;
            for l in 0..LANES {
                if self.lanes[l].is_none() {
                    self.lanes[l] = waiting.next().map(|pose| self.begin(l, pose, of(pose), one));
                }
                if let Some(lane) = &mut self.lanes[l] {
                    busy = true;
                    lane.next = lane.path.next();
                    let values = of(lane.pose);
                    one.goals(values, lane.next).for_each(|(k, x)| self.work.set(k, l, x));
                }
            }
            if !busy {
                break;
            }
            self.work.evaluate(&self.program.solve);
            let taken = self.taken();
            for k in 0..self.program.coordinates {
                let found = *self.work.output(&self.program.solve, k);
                *self.work.input(&self.program.solve, k) = found;
            }
            for l in 0..LANES {
                let Some(lane) = &mut self.lanes[l] else { continue };
                if !taken[l] {
                    left.push(lane.pose);
                    self.lanes[l] = None;
                } else if lane.next == 1.0 {
                    let (pose, values) = (lane.pose, of(lane.pose));
                    put(&PoseNumbers::closed(false), values, rows, pose);
                    let to = self.unchecked.len();
                    for (k, q) in rows.row(0, pose).iter_mut().enumerate() {
                        *q = self.work.get(&self.program.solve, k, l);
                        self.check.set(k, to, *q);
                    }
                    self.unchecked.push(pose);
                    if self.unchecked.len() == LANES {
                        self.check_all(&mut left);
                    }
                    self.lanes[l] = None;
                } else {
                    lane.path.taken(lane.next);
                }
            }
        }
        self.check_all(&mut left);
        for pose in left {
            let (found, reached) = one.pose(of(pose))?;
            put(&found, &reached, rows, pose);
            one.write(&found, rows.row(0, pose));
        }
        Ok(())
    }

    /// Leave poses that the closed forms do not close.
    fn check_all(&mut self, left: &mut Vec<usize>) {
        self.check.evaluate(&self.program.check);
        for (l, pose) in self.unchecked.drain(..).enumerate() {
            // NaN is left
            let closed = self.check.get(&self.program.check, 0, l) <= tolerance::CLOSED_FORM;
            if !closed {
                left.push(pose);
            }
        }
    }

    /// Where lane l begins.
    fn begin(&mut self, l: usize, pose: usize, values: &[f64], one: &Explicit) -> Lane {
        let (path, q, pivots) = one.path(values);
        q.iter().enumerate().for_each(|(k, x)| self.work.set(k, l, *x));
        self.pivots.iter_mut().zip(pivots).for_each(|(lanes, x)| lanes[l] = x);
        Lane { pose, path, next: 0.0 }
    }

    /// Lanes whose step closes with healthy pivots, which become those of the next step.
    fn taken(&mut self) -> [bool; LANES] {
        let (p, work) = (&*self.program, &self.work);
        let lanes = |o: usize| work.output(&p.solve, o).as_slice();
        let at = |x: &[Lanes], l: usize| x[l / Lanes::COUNT].0[l % Lanes::COUNT];
        let excess = lanes(p.excess());
        // NaN is refused
        let mut taken: [bool; LANES] = std::array::from_fn(|l| at(excess, l) <= 0.0);
        for (k, before) in self.pivots.iter_mut().enumerate() {
            let now = lanes(p.pivot(k));
            for l in 0..LANES {
                let (x, was) = (at(now, l), before[l]);
                taken[l] &= tolerance::HALF_LOST * x >= (x - was).abs();
                before[l] = x;
            }
        }
        taken
    }
}
