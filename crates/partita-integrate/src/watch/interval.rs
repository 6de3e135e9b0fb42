//! The zeros of a watched function between two instants, from its readings there and the cubic through them. (W1)

use super::track::{Sample, Track};
use partita_math::tolerance;
use partita_system::cubic::{Cubic, EDGE, INSIDE, LONGEST_CUBIC};
use partita_system::watched::Reading;

/// Largest speed inside a step relative to those at its two ends. Scale: multiples of the speed at the ends. Reason:
/// within the longest step that the error allows a speed doubles.
const FASTER_INSIDE: f64 = 2.0;
/// Least distance of the place at which a crossing is sought from the ends of its interval. Unit: fraction of the
/// interval. Reason: the interval shrinks at least by that.
const NEAR_AN_END: f64 = 1e-9;

/// Error of a cubic from which on an interval is halved instead. Scale: fraction of the values at its ends. Reason: the
/// zero of the cubic may be anywhere then.
const ROUGH: f64 = 0.1;

/// Result of an interval for a function.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Shown {
    /// It is not crossed.
    Clear,
    /// The function must be evaluated at this time.
    Doubtful(f64),
    /// It is crossed here.
    Crossed(f64),
}

/// The sides on which zeros are felt by the error of a step, so that it shows them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Felt {
    /// That of negative values.
    Below,
    /// None: a function that only observes.
    Nowhere,
}

/// A function over an interval.
pub(super) struct Interval<'t> {
    /// Both ends.
    pub(super) ends: &'t [Sample],
    /// Which function.
    pub(super) function: usize,
    /// A reading at either end that is zero, as far as motions and times are known.
    pub(super) small: [f64; 2],
    /// Its largest speed in the step before.
    pub(super) recent: f64,
    /// Whether its end lies inside the step.
    pub(super) goes_on: bool,
    pub(super) felt: Felt,
    /// The side on which it is at its start, where its reading there does not tell.
    pub(super) given: Option<bool>,
    /// Size of the terms of which an observed function is the sum: below zero by their rounding is not below.
    pub(super) size: f64,
}

/// The side before and after an instant, positive or not, where readings up to `small` are zero.
pub(super) fn sides(Reading { x, rate, .. }: Reading, small: f64) -> (bool, bool) {
    match x.abs() > small || rate == 0.0 {
        true => (x >= 0.0, x >= 0.0),
        false => (rate < 0.0, rate > 0.0),
    }
}

impl Interval<'_> {
    /// Whether it is crossed between both ends.
    pub(super) fn shown(&self, track: &Track) -> Shown {
        let (from, to) = (&self.ends[0], &self.ends[1]);
        let (one, two) = (from.readings[self.function], to.readings[self.function]);
        let (after, ahead) = (sides(one, self.small[0]).1, sides(two, self.small[1]).0);
        let h = to.t - from.t;
        // at rest on a zero it is on the side towards which it moves
        let small = self.small[0];
        let rests = one.x.abs() <= small && (h * one.rate).abs() <= small + tolerance::TAKES_PART * two.x.abs();
        let after = self.given.unwrap_or(if rests { ahead } else { after });
        let crosses = after != ahead;
        if h <= tolerance::SUM_ROUNDING * from.t.abs().max(to.t.abs()) {
            // too short to be divided: a jump, unless the step ends here anyway
            return if crosses && self.goes_on { Shown::Crossed(to.t) } else { Shown::Clear };
        }
        let cubic = track.cubic(self.function, self.ends);
        let cubic = if after { cubic } else { cubic.reversed() };
        if crosses {
            // where a function jumps the cubic says nothing
            let off = from.off[self.function].unwrap_or(0.0);
            let rough = (ROUGH * (one.x.abs() + two.x.abs())).max(tolerance::LONG_ROUNDING * self.size);
            let says = self.felt == Felt::Below || off <= rough;
            let zero = if says { cubic.zero().clamp(NEAR_AN_END, 1.0 - NEAR_AN_END) } else { 0.5 };
            return Shown::Doubtful(from.t + h * zero);
        }
        let speed = one.speed.max(two.speed).max(self.recent);
        if one.apart + two.apart > FASTER_INSIDE * h * speed {
            return Shown::Clear;
        }
        match self.deepest(&cubic, after) {
            None => Shown::Clear,
            Some(at) => Shown::Doubtful(from.t + h * at.clamp(EDGE, 1.0 - EDGE)),
        }
    }

    /// Where a function on the same side at both ends may be on the other one in between, as a fraction of the interval.
    fn deepest(&self, cubic: &Cubic, after: bool) -> Option<f64> {
        let (from, to) = (&self.ends[0], &self.ends[1]);
        let known = from.off[self.function];
        let off = known.unwrap_or(cubic.bend());
        let smooth = (to.t - from.t) * from.fastest.max(to.fastest) <= LONGEST_CUBIC;
        if !smooth {
            return Some(cubic.minimum().map_or(INSIDE, |x| x.0));
        }
        let (at, lowest) = cubic.lowest(off);
        let grazes = || cubic.minimum().is_some_and(|x| x.1.abs().max(off) <= self.small[0]);
        // on the other side its force is in the error of the step; on this one it is felt nowhere, and is looked for
        let bound_suffices = self.felt == Felt::Nowhere || !after || known.is_some();
        let below = lowest <= -tolerance::TEN_ROUNDINGS * self.size;
        ((below || !bound_suffices) && !grazes()).then_some(at)
    }
}
