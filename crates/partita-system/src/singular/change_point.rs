//! Change points foreseen and stepped over.

/// How a march goes on: what it plans for the next step, and what it is told.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    /// Length of the next step.
    pub next: f64,
    /// Length of a step whose stages all keep clear of a point in its middle, in units of the distance to that point.
    pub stretch: f64,
    /// Tolerances are not to be taken for smaller than this in the next step.
    pub floor: f64,
    /// Errors up to so many tolerances are accepted there.
    pub limit: f64,
}

/// Stepping over singular positions of the mechanism.
///
/// Next to one the tangent is a quotient of small numbers: what went wrong before is divided by the distance, so steps that
/// end close to it are followed by ever shorter ones, while one step across it, with no stage near it, is as exact as any
/// other. The distance falls linearly in time, so the passage is foreseen: the march takes care to arrive with room to
/// spare and crosses in one step whose stages keep away from it.
#[derive(Default)]
pub struct Passage {
    /// Distance at the ends of the last two steps, the latest first: time, distance, number of its plan.
    before: [Option<(f64, f64, u64)>; 2],
    /// When the next singular position is expected.
    expected: Option<f64>,
    /// The one that the step under way is to cross.
    crossing: Option<f64>,
    /// The usual step size away from singular positions.
    usual: f64,
    /// Times stepped over.
    pub times: Vec<f64>,
}

impl Passage {
    /// A crossing step is this part of the usual one, so that its own error is far below the tolerance.
    const PART: f64 = 0.6;
    /// Around a passage the estimate cannot fall below round-off divided by the square of the distance, and shorter steps
    /// make it worse: about 1e-12 for a comfortable crossing, up to 1e-10 in one of a thousand passages of forty loops.
    /// Errors up to this (radians, metres) are accepted there.
    const ROUND_OFF: f64 = 1e-10;
    /// The crossing step itself may not fail: where the position lay a little off the expected place a stage came close to
    /// it. So many tolerances are accepted; its own error is small by its length.
    const CROSSING: f64 = 1e3;

    /// Look at the distance at the start of the next step and choose its length if a singular position lies ahead; true
    /// while one is being passed. `confirm` tells whether one so far ahead is really there.
    pub fn foresee(
        &mut self,
        t: f64,
        pace: &mut Pace,
        now: Option<(f64, u64)>,
        confirm: impl FnOnce(f64) -> bool,
    ) -> bool {
        let Some((distance, plan)) = now else { return false };
        // a step that had to be shortened may have ended before it
        self.times.extend(self.crossing.take().filter(|zero| *zero < t));
        let [one, two] = self.before;
        self.before = [Some((t, distance, plan)), one];
        let same = |x: Option<(f64, f64, u64)>| x.filter(|x| x.2 == plan && x.0 < t).map(|x| (x.0, x.1));
        if let Some(one) = same(one) {
            self.expected = zero_ahead((t, distance), one, same(two)).filter(|z| z - t < 10.0 * self.usual);
        }
        (pace.floor, pace.limit) = (0.0, 1.0);
        let Some(zero) = self.expected else {
            // leaving: as long as it is as close behind as a usual step, the estimate is not to be trusted yet
            let leaving = self.times.last().is_some_and(|passed| t - passed < 2.0 * self.usual);
            if leaving {
                pace.floor = Self::ROUND_OFF;
                pace.next = pace.next.min(self.usual);
            } else {
                self.usual = pace.next.max(0.9 * self.usual).min(1.3 * pace.next);
            }
            return leaving;
        };
        let ahead = zero - t;
        if ahead <= 0.0 || ahead > 3.0 * self.usual {
            self.expected = self.expected.filter(|_| ahead > 0.0);
            return false;
        }
        let crossing = pace.stretch * ahead;
        if crossing <= Self::PART * self.usual {
            if !confirm(ahead) {
                // what fell was something else; look again from here
                self.before = [None; 2];
                self.expected = None;
                return false;
            }
            pace.limit = Self::CROSSING;
            pace.next = crossing;
            self.crossing = Some(zero);
            self.expected = None;
        } else {
            // leave the distance that one comfortable crossing needs
            let approach = ahead - 0.9 * Self::PART * self.usual / pace.stretch;
            pace.next = approach.min(pace.next);
        }
        pace.floor = Self::ROUND_OFF;
        true
    }
}

/// Where a falling distance will be zero: by the parabola through the last three values, by the line through two.
fn zero_ahead(now: (f64, f64), one: (f64, f64), two: Option<(f64, f64)>) -> Option<f64> {
    let slope = (now.1 - one.1) / (now.0 - one.0);
    if slope >= 0.0 {
        return None;
    }
    let line = -now.1 / slope;
    let Some(two) = two.filter(|x| x.0 < one.0 && x.1 > one.1) else { return Some(now.0 + line) };
    let bend = (slope - (one.1 - two.1) / (one.0 - two.0)) / (now.0 - two.0);
    // now.1 + s x + bend x² = 0 with the slope s of the parabola at the end
    let s = slope + bend * (now.0 - one.0);
    let under_root = s * s - 4.0 * bend * now.1;
    if s >= 0.0 || under_root < 0.0 {
        return Some(now.0 + line);
    }
    Some(now.0 + 2.0 * now.1 / (under_root.sqrt() - s))
}
