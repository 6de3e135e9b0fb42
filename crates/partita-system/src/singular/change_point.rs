//! Change points foreseen and stepped over.

use crate::record::Crossings;
use partita_math::tolerance;

/// How an integration continues: its plan for the next step.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    /// Length of the next step.
    pub next: f64,
    /// The singular position that the next step is to cross, if it is to cross one.
    pub across: Option<Across>,
}

/// A singular position to be crossed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Across {
    /// When it is expected.
    pub zero: f64,
    /// Length of a step across it that has succeeded before.
    pub whole: f64,
    /// Length of a step across it, estimated from the motion.
    pub longest: f64,
    /// How often that was tried before.
    pub tries: usize,
}

/// Stepping over singular positions of the mechanism.
///
/// Next to one the tangent is a quotient of small numbers: earlier errors are divided by the distance, so steps that
/// end close to it are followed by ever shorter ones, while one step across it, with no stage near it, is as exact as
/// any other. The distance falls linearly in time, so the crossing is foreseen; one that was not is detected by the
/// sides of C_D, and its step is repeated.
pub struct Crossing {
    /// Distance at the ends of the last two steps, the latest first: time, distance, number of its plan.
    before: [Option<(f64, f64, u64)>; 2],
    /// When the next singular position is expected.
    expected: Option<f64>,
    /// Singular position that the current step is to cross.
    planned: Option<f64>,
    /// Length of a crossing step, by the motion at its start, and the part of what that suggests that has served.
    whole: f64,
    part: f64,
    /// Was the last step one that crosses?
    behind: bool,
    /// Singular position that the last step was to cross without a change of sign of C_D.
    unsigned: Option<f64>,
    /// Attempts at crossing the expected one, from new starting points or with new lengths.
    tries: usize,
    /// Did velocities jump after one of them?
    jumped: bool,
    /// How often the march was sent back before it.
    returns: usize,
    /// When that is expected, at the latest.
    tried: Option<f64>,
    /// Singular position that no step crossed, perhaps a limit of the motion; ordinary steps go on towards it.
    barred: Option<f64>,
    /// Times stepped over.
    pub times: Crossings,
}

impl Default for Crossing {
    fn default() -> Self {
        Self {
            before: [None; 2],
            expected: None,
            planned: None,
            whole: 0.0,
            part: 1.0,
            behind: false,
            unsigned: None,
            tries: 0,
            jumped: false,
            returns: 0,
            tried: None,
            barred: None,
            times: Crossings::default(),
        }
    }
}

/// What to do about a singular position ahead.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Advice {
    /// Nothing: none is near, or the march comes nearer first.
    Free,
    /// It is crossed in the next step.
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
    /// From this far a position is crossed; from farther away the march comes nearer first. Scale: fraction of a crossing
    /// step. Reason: enough of the step lies beyond.
    const FARTHEST_AHEAD: f64 = 0.6;
    /// Where an approach ends. Unit: fraction of a crossing step before the position. Reason: its middle.
    const APPROACH: f64 = 0.4;
    /// No other step ends so close before a position. Scale: fraction of a crossing step. Reason: what rounding leaves at
    /// its end, over the square of the distance, stays below 1e-13.
    const ROOM: f64 = 0.1;
    /// Attempts before the march goes back.
    const FROM_ONE_PLACE: usize = 3;
    /// Attempts in all.
    const ATTEMPTS: usize = 9;
    /// Shortening of a crossing step that failed. Unit: ratio of lengths. Reason: collocation gains a digit or two.
    const NEXT_TRY: f64 = 0.6;
    /// Number of evaluations ahead that refine the time at which a position is expected.
    const REFINEMENTS: usize = 2;
    /// How far ahead the fall of the distance is probed. Unit: fraction of a step. Reason: far enough for a
    /// difference, near enough for a line.
    const LOOK_AHEAD: f64 = 0.1;

    /// The step to t was taken, h long; `flip` is about when C_D changed sides in it, if it did, and `located` holds all
    /// times at which it was singular there, where the step was searched for them. True if a singular position was crossed.
    pub fn crossed(&mut self, (t, h): (f64, f64), flip: Option<f64>, located: Option<&[f64]>) -> bool {
        self.behind = self.planned.is_some();
        if self.behind {
            // half-way back to what the motion suggests: the next one may be another one
            self.part = (self.part * h / self.whole).sqrt().min(1.0);
        }
        let foreseen = self.planned.take().filter(|zero| *zero < t);
        match located {
            Some(zeros) if !zeros.is_empty() => zeros.iter().for_each(|zero| self.times.push(*zero)),
            // two that coincide change no sign: where they were not searched for they count when the step after them has
            // changed none either
            _ => match flip.or(self.unsigned.take()) {
                Some(zero) => self.times.push(zero),
                None => {
                    self.unsigned = foreseen.filter(|_| located.is_none());
                    if foreseen.is_some() {
                        (self.before, self.expected) = ([None; 2], None);
                    }
                    return foreseen.is_some();
                }
            },
        }
        self.unsigned = None;
        self.forget_tries();
        self.before = [None; 2];
        self.expected = None;
        true
    }

    /// A step from t passed the position at `zero` without being made for it.
    pub fn found(&mut self, zero: f64, t: f64, pace: &mut Pace) -> Advice {
        if self.barred.is_some() {
            return Advice::GiveUp { zero };
        }
        self.approach_or_cross(zero, zero - t, pace)
    }

    /// Cross the position at `zero`, so far `ahead`, or come nearer first.
    fn approach_or_cross(&mut self, zero: f64, ahead: f64, pace: &mut Pace) -> Advice {
        if ahead > Self::FARTHEST_AHEAD * self.whole {
            self.expected = Some(zero);
            pace.next = pace.next.min(ahead - Self::APPROACH * self.whole);
            return Advice::Free;
        }
        self.cross(zero, pace);
        Advice::Crossing
    }

    fn forget_tries(&mut self) {
        (self.tries, self.jumped, self.returns) = (0, false, 0);
    }

    /// The step from t failed to cross, its velocities `jumped` or its equations were not solved: by a shorter one from
    /// there, or from nearer, if that is worth a try.
    pub fn again(&mut self, zero: f64, t: f64, jumped: bool, pace: &mut Pace) -> Advice {
        self.tries += 1;
        self.jumped |= jumped;
        self.part *= Self::NEXT_TRY;
        self.whole *= Self::NEXT_TRY;
        let ahead = zero - t;
        if self.tries % Self::FROM_ONE_PLACE == 0 || self.is_too_close(ahead) {
            return Advice::GiveUp { zero };
        }
        self.planned = None;
        self.approach_or_cross(zero, ahead, pace)
    }

    /// It failed again and again, and there is no state to go back to: go on half of the way, and cross from there, or go
    /// on without crossing. False where that was tried too.
    pub fn nearer(&mut self, zero: f64, t: f64, pace: &mut Pace) -> bool {
        let ahead = zero - t;
        (self.planned, self.expected, self.before) = (None, Some(zero), [None; 2]);
        pace.next = pace.next.min(0.5 * ahead);
        if self.tries < Self::ATTEMPTS && ahead > Self::ROOM * self.whole {
            return true;
        }
        self.barred.replace(zero).is_none()
    }

    /// Whether the position is nearer than a tenth of the room before it: rounding has grown a hundredfold there, and the
    /// march goes back.
    fn is_too_close(&self, ahead: f64) -> bool {
        tolerance::CLEARLY * ahead < Self::ROOM * self.whole
    }

    /// The next step crosses the position at `zero`.
    pub fn cross(&mut self, zero: f64, pace: &mut Pace) {
        self.planned = Some(zero);
        self.tried = Some(self.tried.map_or(zero, |z| zero.max(z)));
        self.expected = None;
        pace.across = Some(Across { zero, whole: self.whole, longest: self.whole / self.part, tries: self.tries });
    }

    /// There is nothing to cross at the time foreseen.
    pub fn forget(&mut self) {
        (self.planned, self.unsigned, self.expected) = (None, None, None);
    }

    /// Number of attempts at the current one, and whether velocities jumped after one of them.
    pub fn tries(&self) -> (usize, bool) {
        (self.tries, self.jumped)
    }

    /// When the step under way is to cross one.
    pub fn zero(&self) -> Option<f64> {
        self.planned
    }

    /// Whether one is expected ahead for which no step is planned yet.
    pub fn is_expected(&self) -> bool {
        self.expected.is_some()
    }

    /// Is one ahead that no step led across?
    pub fn is_barred(&self) -> bool {
        self.barred.is_some()
    }

    /// Length of a crossing step.
    pub fn whole(&self) -> f64 {
        self.whole
    }

    /// The march was put back before the position at `zero`.
    pub fn put_back(&mut self, zero: f64, pace: &mut Pace) {
        self.before = [None; 2];
        self.cross(zero, pace);
    }

    /// Where to go back to before the position at `zero`, each time farther; none where that was tried often enough.
    pub fn back(&self, zero: f64) -> Option<f64> {
        let far = Self::ROOM * (1 + self.tries / Self::FROM_ONE_PLACE) as f64;
        (self.tries < Self::ATTEMPTS).then_some(zero - far * self.whole)
    }

    /// Look at the distance at the start of the next step, and cross if a singular position lies ahead. `whole` is the
    /// length of a crossing step by the motion here; `probe` returns the distance so far ahead, by the same plan.
    pub fn foresee(
        &mut self,
        t: f64,
        pace: &mut Pace,
        now: Option<(f64, u64)>,
        whole: f64,
        mut probe: impl FnMut(f64) -> Probe,
    ) -> Advice {
        let whole = self.part * whole;
        let before = std::mem::replace(&mut self.whole, whole);
        if std::mem::take(&mut self.behind) {
            // the length of the last ordinary step belongs to the rates before the crossing
            pace.next *= (whole / before).min(1.0);
        }
        let Some((distance, plan)) = now.filter(|_| whole.is_finite()) else { return Advice::Free };
        let [one, two] = self.before;
        self.before = [Some((t, distance, plan)), one];
        let same = |x: Option<(f64, f64, u64)>| x.filter(|x| x.2 == plan && x.0 < t).map(|x| (x.0, x.1));
        let limit = pace.next + 2.0 * whole;
        match same(one) {
            Some(one) => self.expected = zero_ahead((t, distance), one, same(two)).filter(|z| z - t < limit),
            // a choice just made has no past
            None => {
                let ahead = Self::LOOK_AHEAD * pace.next.min(whole);
                self.expected = match probe(ahead) {
                    Probe::Distance(there) if there < distance => {
                        Some(t + ahead * distance / (distance - there)).filter(|z| z - t < limit)
                    }
                    _ => self.expected.filter(|z| *z > t),
                };
            }
        }
        let Some(zero) = self.expected.filter(|zero| *zero > t) else {
            (self.expected, self.barred) = (None, None);
            if self.tried.is_none_or(|zero| t > zero) {
                self.forget_tries(); // the motion turned away from it
            }
            return Advice::Free;
        };
        // as long as it is where it was expected
        self.barred = self.barred.filter(|barred| zero - *barred < Self::ROOM * whole);
        let ahead = zero - t;
        if self.barred.is_some() || ahead > pace.next + Self::ROOM * whole {
            return Advice::Free;
        }
        let (mut zero, mut ahead) = (zero, ahead);
        if ahead <= Self::FARTHEST_AHEAD * whole {
            // the line through the distances here and there, once more from where it leads
            for _ in 0..Self::REFINEMENTS {
                let Probe::Distance(there) = probe(ahead) else { break };
                if there > tolerance::MUCH_SMALLER * distance {
                    // what fell was something else; look again from the end of the next step
                    (self.before, self.expected) = ([None; 2], None);
                    return Advice::Free;
                }
                ahead *= distance / (distance - there);
            }
            zero = t + ahead;
        }
        if self.is_too_close(ahead) {
            if self.tries.max(self.returns) >= Self::ATTEMPTS {
                return Advice::GiveUp { zero };
            }
            if let Some(to) = self.back(zero) {
                self.returns += 1;
                return Advice::Back { zero, to };
            }
        }
        self.approach_or_cross(zero, ahead, pace)
    }
}

/// Result of a look ahead.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Probe {
    /// So far from singular, negative beyond it.
    Distance(f64),
    /// Nothing that could be compared.
    Unknown,
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
