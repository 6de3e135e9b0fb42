//! Guards: no step crosses one unseen.
//!
//! The force of a contact is zero on one side and has a discontinuous slope at the boundary. An error estimate evaluates a
//! dozen points of a step and misses a contact between two of them. So the guards are followed over the whole of a
//! concluded step, by their values and rates at its ends and, where these are not conclusive, at points inside it, on its
//! dense output. A step that crosses one is repeated and ends there.                                              (W1)

use super::interval::{sides, Felt, Interval, Shown};
use super::track::{Sample, Track};
use super::{Look, StepView, Watch};
use crate::failure::StepFailure;
use partita_math::tolerance;
use partita_system::error::six_digits;
use partita_system::watched::{Guard, Reading};
use partita_system::SystemError;

/// Longest first step on the other side of a guard. Unit: fraction of the natural size of the guard. Reason: a contact
/// still acts there, whatever the motion.
const FIRST_INSIDE: f64 = 0.1;

/// The first crossing of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Crossed {
    /// There is none.
    Nowhere,
    /// The step must be evaluated at this time.
    Unclear(f64),
    /// A guard is crossed.
    At {
        t: f64,
        guard: usize,
        /// Whether the guard is on the same side at both ends of the step.
        hidden: bool,
    },
}

/// The guards along the current step.
#[derive(Clone, Debug, Default)]
pub(crate) struct GuardWatch {
    guards: Vec<Guard>,
    /// First time at which each was passed through.
    passed: Vec<Option<f64>>,
    /// The largest speed of each at both ends of the step before.
    recent: Vec<f64>,
    /// How close to zero a guard is met, as a fraction of its size.
    meets: f64,
    /// Readings where the dense output is evaluated outside the step, and where one of them met a guard that neither
    /// end shows: the interpolant is not the motion then.
    beside: Vec<Reading>,
    met: Option<(f64, usize)>,
}

impl GuardWatch {
    /// Of these guards, the first functions of a track.
    pub(crate) fn new(guards: Vec<Guard>) -> Self {
        Self { passed: vec![None; guards.len()], recent: vec![0.0; guards.len()], guards, ..Self::default() }
    }

    /// Longest next step, where it begins at a guard that the last one met.
    pub(crate) fn entered(&self, track: &Track) -> Option<f64> {
        let start = track.samples().first()?;
        let all = self.guards.iter().enumerate().filter(|(g, _)| {
            let (before, after) = self.sides(*g, start);
            before != after
        });
        all.map(|(g, guard)| FIRST_INSIDE * guard.size / start.readings[g].speed).reduce(f64::min)
    }

    /// The elements that were passed through, in sentences.
    pub(crate) fn notes(&self) -> impl Iterator<Item = String> + '_ {
        self.guards.iter().zip(&self.passed).filter_map(|(guard, passed)| {
            let ((_, sentence), t) = (guard.through.as_ref()?, six_digits((*passed)?));
            Some(format!("{} is too soft at t = {t} s: {sentence}", guard.name))
        })
    }

    /// Readings at a stage of the dense output at t, which need not lie on the motion.
    fn look_beside(&mut self, track: &Track, t: f64, read: &mut dyn FnMut(&mut [Reading])) {
        let Some(start) = track.samples().first() else { return };
        self.beside.resize(track.count(), Reading::default());
        read(&mut self.beside);
        let met = (0..self.guards.len()).find(|g| {
            let (x, size) = (self.beside[*g].x, self.guards[*g].size);
            x.abs() > self.meets * size && self.is_hidden(*g, track) && (x > 0.0) != self.sides(*g, start).1
        });
        self.met = self.met.or(met.map(|g| (t, g)));
    }

    /// Look at a step of a motion that is as exact as `rtol`.
    fn begin(&mut self, rtol: f64) {
        self.met = None;
        self.meets = tolerance::CLOSED.max(tolerance::NEGLIGIBLE_ERROR * rtol);
    }

    /// Whether the step crosses one.
    fn first(&self, track: &Track) -> Crossed {
        if let Some((t, guard)) = self.met {
            return Crossed::At { t, guard, hidden: true };
        }
        let samples = track.samples();
        for (i, ends) in samples.windows(2).enumerate() {
            let mut first: Option<(f64, usize, bool)> = None;
            for g in 0..self.guards.len() {
                let (at, crossed) = match self.shown(g, track, ends, (i > 0, i + 2 < samples.len())) {
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
                Some((t, guard, true)) => return Crossed::At { t, guard, hidden: self.is_hidden(guard, track) },
                Some((t, ..)) if !track.is_full() => return Crossed::Unclear(t),
                Some((_, guard, _)) => {
                    let t = ends[usize::from(i == 0)].t;
                    return Crossed::At { t, guard, hidden: self.is_hidden(guard, track) };
                }
            }
        }
        Crossed::Nowhere
    }

    /// Its side before and after an instant, positive or not.
    fn sides(&self, g: usize, at: &Sample) -> (bool, bool) {
        sides(at.readings[g], self.small(g, at))
    }

    /// A reading that is zero, as far as motions and times are known.
    fn small(&self, g: usize, at: &Sample) -> f64 {
        self.meets * self.guards[g].size + tolerance::SUM_ROUNDING * (at.t * at.readings[g].rate).abs()
    }

    fn is_hidden(&self, g: usize, track: &Track) -> bool {
        let samples = track.samples();
        let ([from, ..], [.., to]) = (samples, samples) else { return false };
        self.sides(g, from).1 == self.sides(g, to).0
    }

    /// Guard g over an interval, and at its start where that lies inside the step; `inside` flags both ends.
    fn shown(&self, g: usize, track: &Track, ends: &[Sample], inside: (bool, bool)) -> Shown {
        let (before, after) = self.sides(g, &ends[0]);
        if inside.0 && before != after {
            return Shown::Crossed(ends[0].t);
        }
        let small = [self.small(g, &ends[0]), self.small(g, &ends[1])];
        let (recent, goes_on, felt) = (self.recent[g], inside.1, Felt::Below);
        Interval { ends, function: g, small, recent, goes_on, felt, given: None, size: 0.0 }.shown(track)
    }
}

impl Watch for GuardWatch {
    fn look(&mut self, step: &mut StepView) -> Result<Look, StepFailure<SystemError>> {
        if self.guards.is_empty() {
            return Ok(Look::Clear);
        }
        self.begin(step.tolerance.0);
        loop {
            match self.first(step.track) {
                Crossed::Nowhere => return Ok(Look::Clear),
                Crossed::At { t, guard, hidden } if !step.may_end_earlier() => {
                    if hidden {
                        *step.hidden = Some((t, guard));
                    }
                    return Ok(Look::Clear);
                }
                // it ends there as exactly as times can say
                Crossed::At { t, .. } if !step.crosses() && step.ends_at(t) => return Ok(Look::Clear),
                Crossed::At { t, .. } => return Ok(Look::EndAt { t, corner: true }),
                Crossed::Unclear(t) => step.sample(t, &mut |track, t, read| self.look_beside(track, t, read))?,
            }
        }
    }

    fn accept(&mut self, track: &Track) {
        let samples = track.samples();
        let ([from, ..], [.., to]) = (samples, samples) else { return };
        for (i, guard) in self.guards.iter().enumerate() {
            let Some((limit, _)) = guard.through else { continue };
            let first = samples.iter().find(|x| x.readings[i].x < limit).map(|x| x.t);
            self.passed[i] = self.passed[i].or(first);
        }
        let ends = from.readings.iter().zip(&to.readings);
        self.recent.iter_mut().zip(ends).for_each(|(x, (a, b))| *x = a.speed.max(b.speed));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use partita_system::breakpoints::Reads;

    /// A step from 0 to h over a guard x(t) with its rate and speed, the places looked at on x itself.
    fn judge(h: f64, fastest: f64, read: impl Fn(f64) -> Reading) -> (Crossed, usize) {
        let guard = Guard { name: "gap".into(), size: 1.0, through: None };
        let (mut watch, mut track) = (GuardWatch::new(vec![guard]), Track::new(vec![Reads::Other]));
        let at = |t: f64| {
            let reading = read(t);
            move |out: &mut [Reading]| {
                out[0] = reading;
                fastest
            }
        };
        track.end(0.0, at(0.0));
        track.end(h, at(h));
        watch.begin(1e-10);
        for n in 0..200 {
            match watch.first(&track) {
                Crossed::Unclear(t) => track.inside(t, at(t)),
                found => return (found, n),
            }
        }
        panic!("no end of places");
    }

    fn at(x: f64, rate: f64, speed: f64) -> Reading {
        Reading { x, rate, apart: x.abs(), speed, terms: 0.0 }
    }

    fn crossed(look: Crossed) -> (f64, bool) {
        match look {
            Crossed::At { t, hidden, .. } => (t, hidden),
            other => panic!("{other:?}"),
        }
    }

    /// A ball that flies past another one at the distance b from its centre, radii adding up to 1.
    fn flight(b: f64) -> impl Fn(f64) -> Reading {
        move |t| {
            let (x, v) = (10.0 * t - 50.0, 10.0);
            let d2 = x * x + b * b;
            Reading { x: 0.5 * (d2 - 1.0), rate: x * v, apart: (d2.sqrt() - 1.0).abs(), speed: v, terms: 0.0 }
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
            assert_eq!(judge(10.0, 10.0, flight(b)).0, Crossed::Nowhere, "{b}");
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
                Reading {
                    x,
                    rate: pin * (angle - centre).sin() * rate / r,
                    apart: (d2.sqrt() - r).abs(),
                    speed,
                    terms: 0.0,
                }
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
                assert_eq!(found, Crossed::Nowhere, "{least}");
            }
        }
        assert!(touched > 1000 && passed > 10_000, "{touched} {passed}");
        assert!(looked < 30_000, "{looked}");
    }

    #[test]
    fn what_is_far_away_needs_no_look() {
        assert_eq!(judge(1.0, 10.0, flight(0.0)), (Crossed::Nowhere, 0));
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
        assert_eq!(judge(1.0, std::f64::consts::TAU, bump(-1e-4)).0, Crossed::Nowhere);
    }

    #[test]
    fn a_side_that_is_left_at_the_start_is_no_crossing() {
        // touches at 0 and comes back at 1
        let fall = |t: f64| at(t * (t - 1.0), 2.0 * t - 1.0, 1.0);
        assert_eq!(judge(0.7, 1.0, fall).0, Crossed::Nowhere);
        let (t, hidden) = crossed(judge(1.5, 1.0, fall).0);
        assert!(!hidden && (t - 1.0).abs() < 1e-9);
    }

    #[test]
    fn the_first_of_several_ends_the_step() {
        let guard = |name: &str| Guard { name: name.into(), size: 1.0, through: None };
        let mut watch = GuardWatch::new(vec![guard("late"), guard("early")]);
        let mut track = Track::new(vec![Reads::Other; 2]);
        let read = |t: f64| {
            move |out: &mut [Reading]| {
                out[0] = at(0.8 - t, -1.0, 1.0);
                out[1] = at(0.3 - t * t, -2.0 * t, 2.0);
                1.0
            }
        };
        track.end(0.0, read(0.0));
        track.end(1.0, read(1.0));
        watch.begin(1e-10);
        let found = loop {
            match watch.first(&track) {
                Crossed::Unclear(t) => track.inside(t, read(t)),
                found => break found,
            }
        };
        assert!(matches!(found, Crossed::At { t, guard: 1, hidden: false } if (t - 0.3f64.sqrt()).abs() < 1e-9));
    }

    /// A jump through zero, which has no root, is met within a few units in the last place of the time.
    #[test]
    fn a_jump_is_located() {
        let jump = |t: f64| at(if t < 0.6 { 1.0 } else { -1.0 }, 0.0, 1.0);
        let found = judge(1.0, 0.1, jump).0;
        assert!(matches!(found, Crossed::At { t, .. } if (t - 0.6).abs() < 1e-9), "{found:?}");
    }
}
