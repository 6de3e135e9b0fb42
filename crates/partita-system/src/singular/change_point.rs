//! Change points foreseen and stepped over.

use partita_math::tolerance;

/// How an integration continues: its plan for the next step, and the advice.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    /// Length of the next step.
    pub next: f64,
    /// Length of a step whose stages all keep clear of a point in its middle, in units of the distance to that point.
    pub stretch: f64,
    /// Tolerances are not to be taken for smaller than this in the next step.
    pub floor: f64,
    /// Errors up to this many tolerances are accepted there.
    pub limit: f64,
}

/// Stepping over singular positions of the mechanism.
///
/// Next to one the tangent is a quotient of small numbers: earlier errors are divided by the distance, so steps that
/// end close to it are followed by ever shorter ones, while one step across it, with no stage near it, is as exact as
/// any other. The distance falls linearly in time, so the crossing is foreseen: the integration arrives at a sufficient
/// distance and crosses in one step whose stages stay away from it.
#[derive(Default)]
pub struct Crossing {
    /// Distance at the ends of the last two steps, the latest first: time, distance, number of its plan.
    before: [Option<(f64, f64, u64)>; 2],
    /// When the next singular position is expected.
    expected: Option<f64>,
    /// The one that the step under way is to cross.
    planned: Option<f64>,
    /// The usual step size away from singular positions, and whether one was seen yet.
    usual: f64,
    settled: bool,
    /// One that was to be crossed in the last step, while C_D changed no side.
    unsigned: Option<f64>,
    /// Attempts at crossing the expected one, from new starting points or with new lengths.
    tries: usize,
    /// When that is expected, at the latest.
    tried: Option<f64>,
    /// The expected one, if a look ahead showed the distance to fall that far.
    confirmed: Option<f64>,
    /// Times stepped over.
    pub times: Vec<f64>,
}

/// What to do about a singular position ahead.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Advice {
    /// Nothing: none is near.
    Free,
    /// One is being passed.
    Crossing,
    /// It was tried often enough.
    GiveUp {
        /// When it is expected.
        zero: f64,
    },
    /// It is too close to be crossed from here.
    Back {
        /// When it is expected.
        zero: f64,
        /// State to return to.
        to: f64,
    },
}

impl Crossing {
    /// Length of a crossing step. Scale: fraction of the usual step. Reason: its own error is far below the tolerance.
    const CROSSING_STEP: f64 = 0.6;

    /// From this distance on a crossing would have its first stages next to the position. Scale: fraction of the usual
    /// step. Reason: the first nodes of the methods.
    const TOO_CLOSE: f64 = 0.15;
    /// Shorter steps do not cross. Scale: fraction of the usual step. Reason: stages of so short a step all lie next to
    /// the position.
    const CREEPING: f64 = 0.02;
    /// State to return to before the position. Unit: fraction of the usual step. Reason: the middle of a crossing step.
    const STEP_BACK: f64 = 0.3;
    /// Lengths of a crossing step to try. Unit: multiples of the best. Reason: stages lie elsewhere with each.
    const CROSSING_LENGTHS: [f64; 6] = [1.0, 1.25, 1.12, 0.9, 1.5, 1.06];
    /// How far ahead the fall of the distance is probed. Unit: fraction of a step. Reason: far enough for a difference,
    /// near enough for a line.
    const LOOK_AHEAD: f64 = 0.1;

    /// The usual step away from singular positions; 0 at first.
    pub fn usual(&self) -> f64 {
        self.usual
    }

    /// The step to t was taken; `flip` is where C_D changed sides in it, if it did. True if a singular position was
    /// crossed.
    pub fn crossed(&mut self, t: f64, flip: Option<f64>) -> bool {
        let foreseen = self.planned.take().filter(|zero| *zero < t);
        // two that coincide change no sign: they count when the step after them has changed none either
        let Some(zero) = flip.or(self.unsigned.take()) else {
            self.unsigned = foreseen;
            return foreseen.is_some();
        };
        self.unsigned = None;
        self.times.push(zero);
        self.tries = 0;
        self.before = [None; 2];
        self.expected = None;
        true
    }

    /// The step under way failed to cross: another length from the same place, if there is one.
    pub fn again(&mut self, zero: f64, t: f64, pace: &mut Pace) -> bool {
        self.tries += 1;
        if zero - t < Self::TOO_CLOSE * self.usual || self.tries >= Self::CROSSING_LENGTHS.len() {
            return false;
        }
        self.cross(zero, t, pace);
        true
    }

    /// The next step, from t, crosses the position at `zero`.
    pub fn cross(&mut self, zero: f64, t: f64, pace: &mut Pace) {
        self.planned = Some(zero);
        self.tried = Some(self.tried.map_or(zero, |z| zero.max(z)));
        self.expected = None;
        pace.next =
            Self::CROSSING_LENGTHS[self.tries.min(Self::CROSSING_LENGTHS.len() - 1)] * pace.stretch * (zero - t);
        (pace.floor, pace.limit) = (tolerance::SINGULAR_ROUNDING, tolerance::SINGULAR_LENIENCE);
    }

    /// There is nothing to cross at the time foreseen.
    pub fn forget(&mut self) {
        (self.planned, self.unsigned, self.expected) = (None, None, None);
    }

    /// Whether a step of length h is negligible. One that crosses a position has its stages too close to it.
    pub fn creeps(&self, h: f64) -> bool {
        self.planned.is_none() && h < Self::CREEPING * self.usual
    }

    /// Number of attempts at the current one.
    pub fn tries(&self) -> usize {
        self.tries
    }

    /// When the step under way is to cross one.
    pub fn zero(&self) -> Option<f64> {
        self.planned
    }

    /// The integration was set back to t, before the position at `zero`.
    pub fn put_back(&mut self, zero: f64, t: f64, pace: &mut Pace) {
        self.before = [None; 2];
        self.cross(zero, t, pace);
        self.tries += 1;
    }

    /// State to return to before the position at `zero`; none where that was tried often enough.
    pub fn back(&self, zero: f64) -> Option<f64> {
        // each time from farther away
        let far = Self::STEP_BACK * (1.0 + self.tries as f64 / 2.0);
        (self.tries < Self::CROSSING_LENGTHS.len() && self.usual > 0.0).then_some(zero - far * self.usual)
    }

    /// Evaluate the distance at the start of the next step and choose its length if a singular position lies ahead.
    /// `probe` gives the distance that far ahead, by the same plan.
    pub fn foresee(
        &mut self,
        t: f64,
        pace: &mut Pace,
        now: Option<(f64, u64)>,
        mut probe: impl FnMut(f64) -> Probe,
    ) -> Advice {
        let Some((distance, plan)) = now else { return Advice::Free };
        let ([one, two], last) = (self.before, self.expected);
        self.before = [Some((t, distance, plan)), one];
        let same = |x: Option<(f64, f64, u64)>| x.filter(|x| x.2 == plan && x.0 < t).map(|x| (x.0, x.1));
        let displacement = 10.0 * if self.usual > 0.0 { self.usual } else { pace.next };
        match same(one) {
            Some(one) => self.expected = zero_ahead((t, distance), one, same(two)).filter(|z| z - t < displacement),
            // a choice just made has no past
            None => {
                let ahead = Self::LOOK_AHEAD * pace.next.min(displacement);
                self.expected = match probe(ahead) {
                    Probe::Distance(there) if there < distance => {
                        Some(t + ahead * distance / (distance - there)).filter(|z| z - t < displacement)
                    }
                    _ => self.expected.filter(|z| *z > t),
                };
            }
        }
        (pace.floor, pace.limit) = (0.0, 1.0);
        let Some(zero) = self.expected else {
            // moving away: until it is as far behind as a usual step, the estimate is not reliable
            let leaving = self.times.last().is_some_and(|passed| t - passed < 2.0 * self.usual);
            if leaving {
                pace.floor = tolerance::SINGULAR_ROUNDING;
                pace.next = pace.next.min(self.usual);
                return Advice::Crossing;
            }
            self.usual = pace.next.max(0.9 * self.usual).min(1.3 * pace.next);
            self.settled = true;
            if self.tried.is_none_or(|zero| t > zero) {
                self.tries = 0; // the motion turned away from it
            }
            return Advice::Free;
        };
        if !self.settled {
            // a run that begins next to one: the longest step so far
            self.usual = self.usual.max(pace.next);
        }
        let ahead = zero - t;
        if ahead <= 0.0 || ahead > 3.0 * self.usual {
            self.expected = self.expected.filter(|_| ahead > 0.0);
            return Advice::Free;
        }
        let planned = pace.stretch * ahead;
        let mut sure = true;
        if planned <= Self::CROSSING_STEP * self.usual {
            if matches!(probe(ahead), Probe::Distance(there) if there > CONFIRMED * distance) {
                // another quantity decreased; examine again from here
                self.before = [None; 2];
                self.expected = None;
                return Advice::Free;
            }
            if ahead < Self::TOO_CLOSE * self.usual {
                if self.tries >= Self::CROSSING_LENGTHS.len() {
                    return Advice::GiveUp { zero };
                }
                if let Some(to) = self.back(zero) {
                    return Advice::Back { zero, to };
                }
            }
            self.cross(zero, t, pace);
        } else {
            // one that was expected at the same time a step ago is there; a look ahead costs digits, for it may need
            // new plans
            let differs = |x: f64| (x - zero).abs() > 0.3 * ahead;
            if last.is_none_or(differs) && self.confirmed.is_none_or(differs) {
                match probe(ahead) {
                    // it only falls for a while, as for coordinates that another choice will replace
                    Probe::Distance(there) if there > FALLING * distance => {
                        self.confirmed = None;
                        return Advice::Free;
                    }
                    Probe::Distance(there) => sure = there <= CONFIRMED * distance,
                    Probe::Unknown => {}
                }
                self.confirmed = Some(zero);
            }
            // leave the distance that one comfortable crossing needs
            let approach = ahead - 0.9 * Self::CROSSING_STEP * self.usual / pace.stretch;
            pace.next = approach.min(pace.next);
        }
        // a decrease that may end is no reason to tolerate errors
        pace.floor = if sure { tolerance::SINGULAR_ROUNDING } else { 0.0 };
        Advice::Crossing
    }
}

/// Result of a look ahead.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Probe {
    /// So far from singular.
    Distance(f64),
    /// Nothing that could be compared.
    Unknown,
}

/// A singular position that is expected must lie below this distance. Scale: fraction of the present distance. Reason:
/// beside it the distance is small already, and a guess off by more is none.
const CONFIRMED: f64 = 0.3;

/// From far away the distance must have fallen to this. Scale: fraction of the present distance. Reason: a look ahead
/// is rough there.
const FALLING: f64 = 0.7;

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
