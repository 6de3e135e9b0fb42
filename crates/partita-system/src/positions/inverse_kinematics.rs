//! Dependent coordinates by inverse kinematics: `q_D = g(q_I, t; ε)` (37), without iteration over all loops.
//!
//! Its branches ε are constants of the motion between change points, where pivots go through zero because the mechanism
//! itself is singular: these are crossed on the branch that the velocities determine, and reported in the notes. At a
//! dead point of fixed inputs the run ends with a message.

use super::independent::{Core, Dependent, Point};
use crate::error::Result;
use crate::record::History;
use crate::system::{ConstrainedSystem, SystemError};
use crate::tangent::blocks::Blocks;
use crate::tangent::TangentLevels;
use partita_math::tolerance;

/// The next step may be longer by this factor. Scale: ratio. Reason: the prediction of the branch is extrapolated over
/// it.
const LONGEST_NEXT: f64 = 5.0;

/// The closing of a [`Blocks`] tangent, followed over change points.
#[derive(Default)]
pub struct InverseKinematics {
    /// A copy to restore when a closing fails half-way.
    good: Vec<f64>,
    /// The branches at the end of the last step, and of the one that is judged.
    branches: Vec<i8>,
    trial: Vec<i8>,
    /// Whether the next step may meet a singular position, judged by the decrease of the distance in the last one.
    approaching: bool,
    /// Whether the branches followed the motion at the last evaluation, and at the end of the step under judgement.
    following: bool,
    trial_following: bool,
    /// Iterations in blocks without a closed form, without those for outputs.
    iterations: u64,
    /// Distance from a singular position at the end of the last step.
    far: f64,
    /// Blocks that changed to their other branch: block, time, and whether it was foreseen.
    flips: Vec<(String, f64, bool)>,
}

fn take_branches<S: ConstrainedSystem>(tangent: &mut Blocks<S>, into: &mut Vec<i8>) {
    into.clear();
    into.extend(tangent.closing().iter().flat_map(|x| x.state()).map(|s| s.branch));
}

impl<'s, S: ConstrainedSystem> Dependent<'s, S, Blocks<'s, S>> for InverseKinematics {
    const SOLVES: bool = false;

    fn start(&mut self, core: &Core, tangent: &mut Blocks<'s, S>, margin: Option<f64>) {
        self.good.clone_from(&core.q);
        self.far = margin.unwrap_or(f64::INFINITY);
        take_branches(tangent, &mut self.branches);
        self.trial.clone_from(&self.branches);
    }

    /// Where a singular position may be crossed, each block takes the branch nearest to the position predicted from the
    /// velocities at the end of the last step: its pivot passes through zero, and only the velocities determine the
    /// next sign. If the prediction is too close to the singular position to distinguish the branches, the step length
    /// is changed. Within a finished step the path is known more accurately than this distance.
    fn solve(&mut self, core: &mut Core, tangent: &mut Blocks<'s, S>, t: f64, y: &[f64], at: Point) -> Result<()> {
        let follow = match at {
            Point::Inside => self.trial_following,
            _ => at == Point::Crossing || self.approaching,
        };
        let keeps = std::mem::replace(&mut self.following, follow) && !follow;
        std::mem::swap(&mut self.good, &mut core.q);
        // whole turns are those of the prediction: the point solved for last may be a long step away
        core.predict(&*tangent.seen().system, t, y, at);
        let closing = tangent.closing()?;
        let iterated = closing.iterations();
        if keeps {
            closing.set_branches(&self.branches);
        }
        let closed = if follow {
            match closing.follow(t, &mut core.q) {
                Ok(doubt) if doubt > tolerance::MUCH_SMALLER && at != Point::Inside => Err(None),
                followed => followed.map(drop).map_err(Some),
            }
        } else {
            let closed = closing.close(t, &mut core.q).or_else(|_| {
                // iterative blocks may have started too far away: once more from the end of the last step
                core.q.copy_from_slice(&core.home);
                core.states.scatter(y, &mut core.q);
                closing.close(t, &mut core.q)
            });
            closed.map_err(Some)
        };
        if at != Point::Inside {
            self.iterations += closing.iterations() - iterated;
        }
        if let Err(failed) = closed {
            let e = failed.unwrap_or_else(|| tangent.undecided(t, &core.q));
            std::mem::swap(&mut self.good, &mut core.q);
            return Err(e);
        }
        tangent.check_closed(t, &core.q, tolerance::OPEN)
    }

    fn look(&mut self, tangent: &mut Blocks<'s, S>) {
        self.trial_following = self.following;
        take_branches(tangent, &mut self.trial);
    }

    fn accept(&mut self, tangent: &mut Blocks<'s, S>, t: f64, margin: Option<f64>) {
        if let Ok(closing) = tangent.closing() {
            for ((block, now), kept) in closing.blocks().iter().zip(&self.trial).zip(&mut self.branches) {
                if *now != 0 && *kept != 0 && now != kept {
                    self.flips.push((block.words.clone(), t, self.trial_following));
                }
                *kept = *now;
            }
        }
        let here = margin.unwrap_or(f64::INFINITY);
        self.approaching = here < LONGEST_NEXT * (self.far - here);
        self.far = here;
    }

    fn chosen_anew(&mut self, tangent: &mut Blocks<'s, S>) {
        take_branches(tangent, &mut self.branches);
        // distances of different inputs are not comparable: assume the worst once
        self.approaching = true;
    }

    fn undecided(&mut self, core: &Core, tangent: &Blocks<'s, S>, t: f64) -> SystemError {
        tangent.undecided(t, &core.q)
    }

    fn report(&self, history: &mut History) {
        history.counters.newton_iterations = self.iterations;
        for (block, t, foreseen) in self.flips.iter().take(6) {
            history.notes.push(match foreseen {
                true => format!(
                    "{block} crossed its change point in the step before t = {t} and continues on its other branch"
                ),
                false => format!("{block} changed to another branch in the step before t = {t}: the motion jumped"),
            });
        }
        if self.flips.len() > 6 {
            history.notes.push(format!("{} more changes of branches are not listed", self.flips.len() - 6));
        }
    }
}
