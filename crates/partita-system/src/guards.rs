//! Guards: scalar functions of the state that no step may cross unseen, such as gaps of contacts and ends of stops.
//!
//! The force of a contact is zero on one side and has a discontinuous slope at the boundary. An error estimate
//! evaluates a dozen points of a step and misses a contact between two of them. So the guards are followed over the
//! whole of an accepted step, by their values and rates at its ends and, where these are not conclusive, at points
//! inside it, on its dense output. A step that crosses one is repeated and ends there.

use crate::cubic::{errors_of_parts, Cubic, EDGE, INSIDE, LONGEST_CUBIC, MOST_PLACES};
use crate::error::six_digits;
use partita_math::tolerance;

/// Largest speed inside a step relative to those at its two ends. Scale: multiples of the speed at the ends. Reason:
/// within the longest step that the error allows a speed doubles.
const FASTER_INSIDE: f64 = 2.0;
/// Least distance of the place at which a crossing is sought from the ends of its interval. Unit: fraction of the
/// interval. Reason: the interval shrinks at least by that.
const NEAR_AN_END: f64 = 1e-9;
/// Longest first step on the other side of a guard. Unit: fraction of the natural size of the guard. Reason: a contact
/// still acts there, whatever the motion.
const FIRST_INSIDE: f64 = 0.1;

/// A guard.
#[derive(Clone, Debug, PartialEq)]
pub struct Guard {
    /// The guarded element, in words: `contact "tip"`.
    pub name: String,
    /// Natural size of its values.
    pub size: f64,
    /// The value below which the element was passed through, with the message for it.
    pub through: Option<(f64, String)>,
}

/// The reading of a guard at an instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GuardReading {
    /// Its value: positive on one side, negative on the other.
    pub x: f64,
    /// x'.
    pub rate: f64,
    /// Distance of the guarded element from changing sides, in the unit of the speed.
    pub apart: f64,
    /// Largest speed at which that can change, while the rates of the mechanism stay as they are.
    pub speed: f64,
}

impl GuardReading {
    fn cubic(&self, h: f64, to: Self) -> Cubic {
        Cubic::new(h, (self.x, self.rate), (to.x, to.rate))
    }
}

/// Decision about a step by its guards.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Look {
    /// None is crossed within it.
    Clear,
    /// The dense output at this time must be evaluated.
    At(f64),
    /// The first crossing, and the number of the guard; `hidden` where neither end of the step shows it.
    Crossed {
        /// When.
        t: f64,
        /// Index of the guard.
        guard: usize,
        /// Whether the guard is on the same side at both ends of the step.
        hidden: bool,
    },
}

/// An instant of the step, with the bounds of the interval that begins there.
#[derive(Clone, Debug)]
struct Sample {
    t: f64,
    /// The fastest rate of the mechanism [1/s].
    fastest: f64,
    readings: Vec<GuardReading>,
    /// Error bounds of cubics over the interval in its middle; none where they are not known yet.
    off: Vec<Option<f64>>,
}

/// The guards along the current step.
#[derive(Clone, Debug, Default)]
pub struct GuardMonitor {
    guards: Vec<Guard>,
    /// Start, points inside, end; `used` of them.
    samples: Vec<Sample>,
    used: usize,
    /// First time at which each was passed through.
    passed: Vec<Option<f64>>,
    /// The largest speed of each at both ends of the step before.
    recent: Vec<f64>,
    /// How close to zero a guard is met, as a fraction of its size.
    meets: f64,
    /// Readings where the dense output is evaluated outside the step, and where one of them met a guard that neither
    /// end shows: the interpolant is not the motion then.
    beside: Vec<GuardReading>,
    met: Option<(f64, usize)>,
}

/// Result of an interval for a guard.
#[derive(Clone, Copy, PartialEq)]
enum Shown {
    /// It is not crossed.
    Clear,
    /// This fraction of the interval must be evaluated.
    Doubtful(f64),
    /// It is crossed here.
    Crossed(f64),
}

impl GuardMonitor {
    /// Of these guards.
    pub fn new(guards: Vec<Guard>) -> Self {
        Self { passed: vec![None; guards.len()], recent: vec![0.0; guards.len()], guards, ..Self::default() }
    }

    /// Whether there are no guards.
    pub fn is_empty(&self) -> bool {
        self.guards.is_empty()
    }

    /// Whether no start is known yet.
    pub fn waits(&self) -> bool {
        self.used == 0 && !self.guards.is_empty()
    }

    /// Reset to no state.
    pub fn forget(&mut self) {
        self.used = 0;
    }

    /// A sample after those in use, to be filled.
    fn next(&mut self, t: f64, fastest: f64) -> &mut Sample {
        let n = self.guards.len();
        if self.used == self.samples.len() {
            let sample = Sample { t, fastest, readings: vec![GuardReading::default(); n], off: vec![None; n] };
            self.samples.push(sample);
        }
        self.used += 1;
        let sample = &mut self.samples[self.used - 1];
        (sample.t, sample.fastest) = (t, fastest);
        sample.off.fill(None);
        sample
    }

    /// An integration begins at t; the readings there are to be written. `fastest` is the fastest rate there [1/s].
    pub fn start(&mut self, t: f64, fastest: f64) -> &mut [GuardReading] {
        self.used = 0;
        self.recent.fill(0.0);
        &mut self.next(t, fastest).readings
    }

    /// A step ends at t; the readings there are to be written.
    pub fn end(&mut self, t: f64, fastest: f64) -> &mut [GuardReading] {
        self.used = self.used.min(1);
        self.met = None;
        self.samples[..self.used].iter_mut().for_each(|x| x.off.fill(None));
        &mut self.next(t, fastest).readings
    }

    /// An instant inside the step that is judged; `read` writes the readings there.
    pub fn inside(&mut self, t: f64, fastest: f64, read: impl FnOnce(&mut [GuardReading])) {
        let at = self.samples[..self.used].partition_point(|x| x.t < t).clamp(1, self.used - 1);
        read(&mut self.next(t, fastest).readings);
        self.samples[at..self.used].rotate_right(1);
        let (before, rest) = self.samples.split_at_mut(at);
        let (from, (here, to)) = (&mut before[at - 1], rest.split_first_mut().expect("a sample was put there"));
        let (h, s) = (to[0].t - from.t, (t - from.t) / (to[0].t - from.t));
        for g in 0..self.guards.len() {
            let cubic = from.readings[g].cubic(h, to[0].readings[g]);
            let seen = (cubic.at(s) - here.readings[g].x).abs();
            let [off, then] = errors_of_parts(s, seen, from.off[g].unwrap_or(cubic.bend()));
            (from.off[g], here.off[g]) = (Some(off), Some(then));
        }
    }

    /// An evaluation of the dense output at t; `read` writes the readings there.
    pub fn beside(&mut self, t: f64, read: impl FnOnce(&mut [GuardReading])) {
        self.beside.resize(self.guards.len(), GuardReading::default());
        read(&mut self.beside);
        let met = (0..self.guards.len()).find(|g| {
            let (x, size) = (self.beside[*g].x, self.guards[*g].size);
            x.abs() > self.meets * size
                && self.is_hidden(*g, self.meets)
                && (x > 0.0) != self.sides(*g, &self.samples[0], self.meets).1
        });
        self.met = self.met.or(met.map(|g| (t, g)));
    }

    /// The step that was judged is accepted.
    pub fn accept(&mut self) {
        if self.used == 0 {
            return;
        }
        for (i, guard) in self.guards.iter().enumerate() {
            let Some((limit, _)) = guard.through else { continue };
            let beyond = |x: &&Sample| x.readings[i].x < limit;
            let first = self.samples[..self.used].iter().find(beyond).map(|x| x.t);
            self.passed[i] = self.passed[i].or(first);
        }
        let (from, to) = (&self.samples[0].readings, &self.samples[self.used - 1].readings);
        self.recent.iter_mut().zip(from.iter().zip(to)).for_each(|(x, (a, b))| *x = a.speed.max(b.speed));
        self.samples.swap(0, self.used - 1);
        self.used = 1;
    }

    /// Longest next step, where it begins at a guard that the last one met.
    pub fn entered(&self) -> Option<f64> {
        let start = self.samples[..self.used].first()?;
        let all = self.guards.iter().enumerate().filter(|(g, _)| {
            let (before, after) = self.sides(*g, start, self.meets);
            before != after
        });
        all.map(|(g, guard)| FIRST_INSIDE * guard.size / start.readings[g].speed).reduce(f64::min)
    }

    /// The elements that were passed through, in sentences.
    pub fn notes(&self) -> impl Iterator<Item = String> + '_ {
        self.guards.iter().zip(&self.passed).filter_map(|(guard, passed)| {
            let ((_, sentence), t) = (guard.through.as_ref()?, six_digits((*passed)?));
            Some(format!("{} is too soft at t = {t} s: {sentence}", guard.name))
        })
    }

    /// Whether the step that is judged crosses one, where motions are as exact as `rtol`.
    pub fn look(&mut self, rtol: f64) -> Look {
        self.meets = tolerance::CLOSED.max(tolerance::NEGLIGIBLE_ERROR * rtol);
        let meets = self.meets;
        let samples = &self.samples[..self.used];
        if let Some((t, guard)) = self.met {
            return Look::Crossed { t, guard, hidden: true };
        }
        for (i, ends) in samples.windows(2).enumerate() {
            let mut first: Option<(f64, usize, bool)> = None;
            for g in 0..self.guards.len() {
                let (at, crossed) = match self.shown(g, ends, (i > 0, i + 2 < self.used), meets) {
                    Shown::Clear => continue,
                    Shown::Doubtful(t) => (t, false),
                    Shown::Crossed(t) => (t, true),
                };
                if first.is_none_or(|(t, ..)| at < t) {
                    first = Some((at, g, crossed));
                }
            }
            match first {
                None => {}
                Some((t, guard, true)) => return Look::Crossed { t, guard, hidden: self.is_hidden(guard, meets) },
                Some((t, ..)) if self.used < MOST_PLACES => return Look::At(t),
                Some((_, guard, _)) => {
                    let t = ends[usize::from(i == 0)].t;
                    return Look::Crossed { t, guard, hidden: self.is_hidden(guard, meets) };
                }
            }
        }
        Look::Clear
    }

    /// Its side before and after an instant, positive or not.
    fn sides(&self, g: usize, at: &Sample, meets: f64) -> (bool, bool) {
        let GuardReading { x, rate, .. } = at.readings[g];
        match x.abs() > self.small(g, at, meets) || rate == 0.0 {
            true => (x >= 0.0, x >= 0.0),
            false => (rate < 0.0, rate > 0.0),
        }
    }

    /// A reading that is zero, as far as motions and times are known.
    fn small(&self, g: usize, at: &Sample, meets: f64) -> f64 {
        meets * self.guards[g].size + tolerance::SUM_ROUNDING * (at.t * at.readings[g].rate).abs()
    }

    fn is_hidden(&self, g: usize, meets: f64) -> bool {
        let (from, to) = (&self.samples[0], &self.samples[self.used - 1]);
        self.sides(g, from, meets).1 == self.sides(g, to, meets).0
    }

    /// Guard g over an interval, and at its start where that lies inside the step; `inside` flags both ends.
    fn shown(&self, g: usize, ends: &[Sample], inside: (bool, bool), meets: f64) -> Shown {
        let (from, to) = (&ends[0], &ends[1]);
        let (before, after) = self.sides(g, from, meets);
        if inside.0 && before != after {
            return Shown::Crossed(from.t);
        }
        let (h, (one, two), ahead) = (to.t - from.t, (from.readings[g], to.readings[g]), self.sides(g, to, meets).0);
        // at rest on a guard it is on the side towards which it moves
        let small = self.small(g, from, meets);
        let rests = one.x.abs() <= small && (h * one.rate).abs() <= small + tolerance::TAKES_PART * two.x.abs();
        let after = if rests { ahead } else { after };
        let crosses = after != ahead;
        if h <= tolerance::SUM_ROUNDING * from.t.abs().max(to.t.abs()) {
            // too short to be divided: a jump, unless the step ends here anyway
            return if crosses && inside.1 { Shown::Crossed(to.t) } else { Shown::Clear };
        }
        let cubic = one.cubic(h, two);
        let cubic = if after { cubic } else { cubic.reversed() };
        if crosses {
            let zero = cubic.zero().clamp(NEAR_AN_END, 1.0 - NEAR_AN_END);
            return Shown::Doubtful(from.t + h * zero);
        }
        let speed = one.speed.max(two.speed).max(self.recent[g]);
        if one.apart + two.apart > FASTER_INSIDE * h * speed {
            return Shown::Clear;
        }
        let off = from.off[g].unwrap_or(cubic.bend());
        let smooth = h * from.fastest.max(to.fastest) <= LONGEST_CUBIC;
        let (at, lowest) = cubic.lowest(off);
        let grazes = || cubic.minimum().is_some_and(|x| x.1.abs().max(off) <= small);
        let at = match smooth {
            // on the other side its force is in the error of the step; on this one it is felt nowhere, and is looked for
            true if (lowest > 0.0 && (!after || from.off[g].is_some())) || grazes() => return Shown::Clear,
            true => at,
            false => cubic.minimum().map_or(INSIDE, |x| x.0),
        };
        Shown::Doubtful(from.t + h * at.clamp(EDGE, 1.0 - EDGE))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A step from 0 to h over a guard x(t) with its rate and speed, the places looked at on x itself.
    fn judge(h: f64, fastest: f64, read: impl Fn(f64) -> GuardReading) -> (Look, usize) {
        let guard = Guard { name: "gap".into(), size: 1.0, through: None };
        let mut monitor = GuardMonitor::new(vec![guard]);
        monitor.start(0.0, fastest)[0] = read(0.0);
        monitor.end(h, fastest)[0] = read(h);
        for n in 0..200 {
            match monitor.look(1e-10) {
                Look::At(t) => monitor.inside(t, fastest, |out| out[0] = read(t)),
                found => return (found, n),
            }
        }
        panic!("no end of places");
    }

    fn at(x: f64, rate: f64, speed: f64) -> GuardReading {
        GuardReading { x, rate, apart: x.abs(), speed }
    }

    fn crossed(look: Look) -> (f64, bool) {
        match look {
            Look::Crossed { t, hidden, .. } => (t, hidden),
            other => panic!("{other:?}"),
        }
    }

    /// A ball that flies past another one at the distance b from its centre, radii adding up to 1.
    fn flight(b: f64) -> impl Fn(f64) -> GuardReading {
        move |t| {
            let (x, v) = (10.0 * t - 50.0, 10.0);
            let d2 = x * x + b * b;
            GuardReading { x: 0.5 * (d2 - 1.0), rate: x * v, apart: (d2.sqrt() - 1.0).abs(), speed: v }
        }
    }

    #[test]
    fn a_contact_between_two_ends_is_found_where_it_begins() {
        for b in [0.0, 0.5, 0.9, 0.999, 1.0 - 1e-9] {
            let (found, samples) = judge(10.0, 10.0, flight(b));
            let (t, hidden) = crossed(found);
            assert!(hidden && (t - (5.0 - 0.1 * (1.0 - b * b).sqrt())).abs() < 1e-6, "{b}: {t}");
            assert!(samples < 60, "{b}: {samples}");
        }
        for b in [1.0 + 1e-9, 1.001, 1.5, 20.0] {
            assert_eq!(judge(10.0, 10.0, flight(b)).0, Look::Clear, "{b}");
        }
    }

    /// Pendulums by chance that swing past pins by chance, in steps of up to two radians and half a period: wherever a pin is
    /// touched, the step crosses.
    #[test]
    fn what_swings_past_a_pin_touches_it_where_it_does() {
        let mut seed = 1u64;
        let mut chance = |low: f64, high: f64| {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            low + (high - low) * (seed >> 11) as f64 / (1u64 << 53) as f64
        };
        let (mut touched, mut passed, mut looked) = (0, 0, 0);
        for _ in 0..20_000 {
            let (swing, w, phase) = (chance(0.3, 2.5), chance(0.5, 3.0), chance(0.0, 6.3));
            let (r, centre, pin) = (chance(0.01, 0.1), chance(-2.5, 2.5), chance(0.9, 1.1));
            let read = |t: f64| {
                let (angle, rate) = (swing * (w * t + phase).sin(), swing * w * (w * t + phase).cos());
                let d2 = 1.0 + pin * pin - 2.0 * pin * (angle - centre).cos();
                let x = (d2 - r * r) / (2.0 * r);
                let speed = 0.5 * (rate.abs() + swing * w);
                GuardReading { x, rate: pin * (angle - centre).sin() * rate / r, apart: (d2.sqrt() - r).abs(), speed }
            };
            let h = (chance(0.2, 2.0) / swing).min(3.0) / w;
            let least = (0..=500).map(|i| read(h * f64::from(i) / 500.0).x).fold(f64::INFINITY, f64::min);
            let apart = read(0.0).x > 0.0 && read(h).x > 0.0;
            let (found, samples) = judge(h, swing * w, read);
            looked += samples;
            if apart && least < 0.0 {
                touched += 1;
                assert!(crossed(found).1, "{least}");
            } else if apart && least > 1e-2 {
                passed += 1;
                assert_eq!(found, Look::Clear, "{least}");
            }
        }
        assert!(touched > 1000 && passed > 10_000, "{touched} {passed}");
        assert!(looked < 30_000, "{looked}");
    }

    #[test]
    fn what_is_far_away_needs_no_look() {
        assert_eq!(judge(1.0, 10.0, flight(0.0)), (Look::Clear, 0));
    }

    /// A bump on a disc that passes close by once a turn, in steps of many turns.
    #[test]
    fn a_contact_once_a_turn_is_found_in_steps_of_whole_turns() {
        let bump = |depth: f64| {
            move |t: f64| {
                let turn = std::f64::consts::TAU * t;
                at(1.0 - depth + (turn + 0.3).cos(), -std::f64::consts::TAU * (turn + 0.3).sin(), std::f64::consts::TAU)
            }
        };
        for h in [1.0, 2.0, 3.0, 2.5] {
            let (t, _) = crossed(judge(h, std::f64::consts::TAU, bump(1e-4)).0);
            assert!((t - ((1e-4f64 - 1.0).acos() - 0.3) / std::f64::consts::TAU).abs() < 1e-9, "{h}: {t}");
        }
        assert_eq!(judge(1.0, std::f64::consts::TAU, bump(-1e-4)).0, Look::Clear);
    }

    #[test]
    fn a_side_that_is_left_at_the_start_is_no_crossing() {
        // touches at 0 and comes back at 1
        let fall = |t: f64| at(t * (t - 1.0), 2.0 * t - 1.0, 1.0);
        assert_eq!(judge(0.7, 1.0, fall).0, Look::Clear);
        let (t, hidden) = crossed(judge(1.5, 1.0, fall).0);
        assert!(!hidden && (t - 1.0).abs() < 1e-9);
    }

    #[test]
    fn the_first_of_several_ends_the_step() {
        let guard = |name: &str| Guard { name: name.into(), size: 1.0, through: None };
        let mut monitor = GuardMonitor::new(vec![guard("late"), guard("early")]);
        let read = |t: f64, out: &mut [GuardReading]| {
            out[0] = at(0.8 - t, -1.0, 1.0);
            out[1] = at(0.3 - t * t, -2.0 * t, 2.0);
        };
        read(0.0, monitor.start(0.0, 1.0));
        read(1.0, monitor.end(1.0, 1.0));
        let found = loop {
            match monitor.look(1e-10) {
                Look::At(t) => monitor.inside(t, 1.0, |out| read(t, out)),
                found => break found,
            }
        };
        assert!(matches!(found, Look::Crossed { t, guard: 1, hidden: false } if (t - 0.3f64.sqrt()).abs() < 1e-9));
    }

    /// A jump through zero, which has no root, is met within a few units in the last place of the time.
    #[test]
    fn a_jump_is_located() {
        let jump = |t: f64| at(if t < 0.6 { 1.0 } else { -1.0 }, 0.0, 1.0);
        let found = judge(1.0, 0.1, jump).0;
        assert!(matches!(found, Look::Crossed { t, .. } if (t - 0.6).abs() < 1e-9), "{found:?}");
    }
}
