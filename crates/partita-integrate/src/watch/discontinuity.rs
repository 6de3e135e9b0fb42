//! Where, inside a step, a function of time or its derivative jumps: by bisection of the step.

use partita_math::tolerance;

/// Location of the discontinuity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Location {
    /// Nowhere: it changes smoothly over the step.
    Smooth,
    /// Between these two times, in which it changes far more than elsewhere.
    Within {
        /// Before it.
        before: f64,
        /// After it.
        after: f64,
    },
    /// At this time, by this amount.
    Jump {
        /// When.
        t: f64,
        /// By how much.
        by: f64,
    },
}

/// A half that contains more than this of a change contains its cause. Scale: fraction of the change. Reason: a smooth
/// function distributes its change evenly; a jump lies in one half.
const KEPT_BY_A_HALF: f64 = 0.75;
/// This many halves that contain less indicate a smooth function. Reason: one half may contain less by chance, where
/// the rest of a change counts against a jump.
const SMOOTH_HALVES: u32 = 3;
/// Precision of the location of a jump. Scale: fraction of the step. Reason: far below any time in which a smooth
/// motion changes, and above round-off.
const LOCATED: f64 = 1e-9;
/// A step ends before a change that takes less time than this. Scale: fraction of the step. Reason: nodes of methods
/// lie a tenth of a step apart.
const ABRUPT: f64 = 0.1;

/// Halving of a step.
pub(super) struct Search {
    from: f64,
    to: f64,
}

impl Search {
    pub(super) fn new(from: f64, to: f64) -> Self {
        Self { from, to }
    }

    /// Where the first value of `at`, 0 at the start of the step and `end` at its end, jumps.
    pub(super) fn jump<E>(&self, at: &mut impl FnMut(f64) -> Result<[f64; 2], E>, end: f64) -> Result<Location, E> {
        let found = self.halve(&mut |t| Ok(at(t)?[0]), (0.0, end), tolerance::HALF_LOST * end.abs())?;
        Ok(match found {
            (Location::Within { after, .. }, by, true) => Location::Jump { t: after, by },
            (location, ..) => location,
        })
    }

    /// Where the second value of `at` jumps by so much that its integral over the step may miss `missed`.
    pub(super) fn kink<E>(&self, at: &mut impl FnMut(f64) -> Result<[f64; 2], E>, missed: f64) -> Result<Location, E> {
        let ends = (at(self.from)?[1], at(self.to)?[1]);
        Ok(self.halve(&mut |t| Ok(at(t)?[1]), ends, (missed / (self.to - self.from)).abs())?.0)
    }

    /// The part in which a change of `least` at least is concentrated, the change in it, and whether it is as short as
    /// can be resolved.
    fn halve<E>(
        &self,
        at: &mut impl FnMut(f64) -> Result<f64, E>,
        (one, two): (f64, f64),
        least: f64,
    ) -> Result<(Location, f64, bool), E> {
        let (mut low, mut high, mut smooth) = ((self.from, one), (self.to, two), 0);
        let length = self.to - self.from;
        let shortest = (LOCATED * length.abs()).max(tolerance::SOLUTION_ROUNDING * self.to.abs());
        // as long as a half keeps the change
        let mut within = (low.0, high.0, high.1 - low.1);
        while (high.0 - low.0).abs() > shortest {
            let t = 0.5 * (low.0 + high.0);
            let middle = (t, at(t)?);
            let change = (high.1 - low.1).abs();
            let first = (middle.1 - low.1).abs() >= (high.1 - middle.1).abs();
            if first {
                high = middle;
            } else {
                low = middle;
            }
            if (high.1 - low.1).abs() >= KEPT_BY_A_HALF * change {
                within = (low.0, high.0, high.1 - low.1);
                smooth = 0;
            } else {
                smooth += 1;
            }
            if smooth == SMOOTH_HALVES || (high.1 - low.1).abs() < least {
                break;
            }
        }
        let located = (high.0 - low.0).abs() <= shortest;
        if located {
            within = (low.0, high.0, high.1 - low.1);
        }
        // a step that is no longer than what can be resolved is abrupt itself
        let abrupt = located || (within.1 - within.0).abs() < ABRUPT * length.abs();
        let location = match abrupt && within.2.abs() >= least {
            true => Location::Within { before: within.0, after: within.1 },
            false => Location::Smooth,
        };
        Ok((location, within.2, located))
    }
}
