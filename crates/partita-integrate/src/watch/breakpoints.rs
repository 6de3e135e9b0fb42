//! Breakpoints of curves: steps end where one is passed that matters.
//!
//! A method of order eight evaluates the motion at a dozen points of a step and treats it as a polynomial between them.
//! With a breakpoint inside, its error decreases only with the square of the step, and the estimate is no better. So
//! steps end at breakpoints wherever their effect exceeds the tolerance.                                          (W2)

use super::track::{Sample, Track};
use super::{Look, StepView, Watch};
use crate::failure::StepFailure;
use partita_system::breakpoints::{Breakpoints, Reads, Within};
use partita_system::cubic::{Cubic, INSIDE, LONGEST_CUBIC};
use partita_system::watched::Reading;
use partita_system::SystemError;

/// The first breakpoint that a step passes and that matters.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Passed {
    /// There is none.
    Nothing,
    /// The step must be evaluated at this time.
    Unclear(f64),
    /// The step should end at this time.
    At(f64),
}

/// The breakpoints along the current step.
#[derive(Clone, Debug, Default)]
pub(crate) struct BreakpointWatch {
    breakpoints: Vec<Breakpoints>,
    /// Index in the track of the first.
    first: usize,
    /// How far each reading goes in the step.
    travelled: Vec<f64>,
    /// x'' at the start.
    bend: Vec<f64>,
}

impl BreakpointWatch {
    /// Of these curves, whose abscissas are the functions of a track from this index on.
    pub(crate) fn new(breakpoints: Vec<Breakpoints>, first: usize) -> Self {
        let n = breakpoints.len();
        Self { bend: vec![0.0; n], travelled: vec![0.0; n], breakpoints, first }
    }

    /// Whether the step passes one that matters.
    fn passed(&mut self, track: &Track, tolerance: f64) -> Passed {
        let samples = track.samples();
        let [first, .., last] = samples else { return Passed::Nothing };
        let length = last.t - first.t;
        if length.is_nan() || length <= 0.0 {
            return Passed::Nothing;
        }
        for (i, (breakpoints, travelled)) in self.breakpoints.iter().zip(&mut self.travelled).enumerate() {
            let far = |ends: &[Sample]| match shows(ends, breakpoints.reads()) {
                true => track.cubic(self.first + i, ends).travelled(),
                false => breakpoints.most(ends[0].moves(&ends[1])),
            };
            *travelled = samples.windows(2).map(far).sum();
        }
        for (n, ends) in samples.windows(2).enumerate() {
            let (h, shown) = (ends[1].t - ends[0].t, |t: f64| (t - first.t) / length);
            let mut found: Option<(f64, f64, bool)> = None;
            for (i, breakpoints) in self.breakpoints.iter().enumerate() {
                let part = [shown(ends[0].t), shown(ends[1].t)];
                let rounding = Within::rounding(last.t, length);
                let step = Within { tolerance, travelled: self.travelled[i], part, rounding };
                let (at, known) = if shows(ends, breakpoints.reads()) {
                    let cubic = track.cubic(self.first + i, ends);
                    let off = match breakpoints.reads() {
                        Reads::Time => 0.0,
                        _ => ends[0].off[self.first + i].unwrap_or(cubic.bend()),
                    };
                    match breakpoints.within(&cubic, &step) {
                        Some(at) => (at, true),
                        None => match breakpoints.suspect(&cubic, off, &step) {
                            Some(at) => (at, false),
                            None => continue,
                        },
                    }
                } else if breakpoints.may_matter(step.travelled, tolerance) {
                    (INSIDE, false)
                } else {
                    continue;
                };
                if found.is_none_or(|(first, ..)| at < first) {
                    found = Some((at, breakpoints.instant(ends[0].t + at * h, h), known));
                }
            }
            match found {
                None => {}
                Some((_, t, true)) => return Passed::At(t),
                Some((_, t, false)) if !track.is_full() => return Passed::Unclear(t),
                Some(_) => return Passed::At(ends[usize::from(n == 0)].t),
            }
        }
        Passed::Nothing
    }

    /// When a step of length h that begins now would pass one, by prediction.
    pub(crate) fn ahead(&self, track: &Track, h: f64, tolerance: f64) -> Option<f64> {
        let start = track.samples().first()?;
        if h.is_nan() || h <= 0.0 {
            return None;
        }
        let passes = |(i, breakpoints): (usize, &Breakpoints)| {
            // no farther than the prediction holds
            let h = match breakpoints.reads() {
                Reads::Time => h,
                _ => h.min(LONGEST_CUBIC / start.fastest),
            };
            let (now, bend) = (start.readings[self.first + i], self.bend[i]);
            let then = Reading::new(now.x + h * (now.rate + 0.5 * h * bend), now.rate + h * bend);
            let cubic = Cubic::new(h, (now.x, now.rate), (then.x, then.rate));
            let rounding = Within::rounding(start.t, h);
            let step = Within { tolerance, travelled: cubic.travelled(), part: [0.0, 1.0], rounding };
            Some(breakpoints.instant(start.t + h * breakpoints.within(&cubic, &step)?, h))
        };
        self.breakpoints.iter().enumerate().filter_map(passes).reduce(f64::min)
    }
}

/// Whether the readings at both ends show what lies between.
fn shows(ends: &[Sample], reads: Reads) -> bool {
    reads == Reads::Time || ends[0].moves(&ends[1]) <= LONGEST_CUBIC
}

impl Watch for BreakpointWatch {
    fn look(&mut self, step: &mut StepView) -> Result<Look, StepFailure<SystemError>> {
        if self.breakpoints.is_empty() || !step.may_end_earlier() {
            return Ok(Look::Clear);
        }
        loop {
            match self.passed(step.track, step.tolerance.0) {
                Passed::Nothing => return Ok(Look::Clear),
                Passed::At(t) => return Ok(Look::EndAt { t, corner: false }),
                Passed::Unclear(t) => step.sample(t, &mut |_, _, _| ())?,
            }
        }
    }

    fn accept(&mut self, track: &Track) {
        let [.., to] = track.samples() else { return };
        let from = track.samples().iter().rev().nth(1).unwrap_or(to);
        let h = to.t - from.t;
        let readings = from.readings.iter().zip(&to.readings).skip(self.first);
        for (bend, (from, to)) in self.bend.iter_mut().zip(readings) {
            // the difference of rates alone: turns may lie between the values
            *bend = if h > 0.0 { (to.rate - from.rate) / h } else { 0.0 };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use partita_system::breakpoints::Enters;

    /// A linear table with the corner 0, 1, 0 over 0, 1, 2.
    fn tent(periodic: bool, reads: Reads) -> Breakpoints {
        let cubics = [[0.0, 0.0, 1.0, 0.0], [0.0, 0.0, -1.0, 1.0]];
        Breakpoints::new(&[0.0, 1.0, 2.0], &cubics, Enters::Effort, periodic, reads).unwrap()
    }

    fn at(x: f64, rate: f64) -> Reading {
        Reading::new(x, rate)
    }

    /// The fraction of a step of length h that ends at the first breakpoint; the places are looked at on `read` itself.
    fn passed(of: &Breakpoints, h: f64, fastest: f64, read: impl Fn(f64) -> Reading) -> (Option<f64>, usize) {
        let (mut watch, mut track) = (BreakpointWatch::new(vec![of.clone()], 0), Track::new(vec![of.reads()]));
        let at = |t: f64| {
            let reading = read(t);
            move |out: &mut [Reading]| {
                out[0] = reading;
                fastest
            }
        };
        track.end(0.0, at(0.0));
        watch.accept(&track);
        track.end(h, at(h));
        for n in 0..200 {
            match watch.passed(&track, 1e-9) {
                Passed::Nothing => return (None, n),
                Passed::At(t) => return (Some(t / h), n),
                Passed::Unclear(t) => track.inside(t, at(t)),
            }
        }
        panic!("no end of places");
    }

    /// The cubic between two readings.
    fn between(h: f64, from: Reading, to: Reading) -> impl Fn(f64) -> Reading {
        let cubic = Cubic::new(h, (from.x, from.rate), (to.x, to.rate));
        move |t| {
            let ([_, b, c, d], s) = (cubic.0, t / h);
            at(cubic.at(s), (b + s * (2.0 * c + s * 3.0 * d)) / h)
        }
    }

    fn within(of: &Breakpoints, h: f64, from: Reading, to: Reading) -> Option<f64> {
        passed(of, h, 0.0, between(h, from, to)).0
    }

    #[test]
    fn a_breakpoint_within_the_step_is_found_where_it_is() {
        let tent = tent(false, Reads::Other);
        let part = within(&tent, 0.1, at(0.8, 4.0), at(1.2, 4.0)).unwrap();
        assert!((part - 0.5).abs() < 1e-12, "{part}");
        // accelerated from rest, x = 0.8 + 0.4 s^2
        let part = within(&tent, 0.1, at(0.8, 0.0), at(1.2, 8.0)).unwrap();
        assert!((part - 0.5f64.sqrt()).abs() < 1e-12, "{part}");
    }

    #[test]
    fn one_that_is_passed_there_and_back_is_found() {
        // x = 0.9 + 0.8 s (1 - s), at 1 where s (1 - s) = 1/8
        let part = within(&tent(false, Reads::Other), 1.0, at(0.9, 0.8), at(0.9, -0.8)).unwrap();
        assert!((part - 0.5 * (1.0 - 0.5f64.sqrt())).abs() < 1e-12, "{part}");
    }

    /// A reading that swings, in steps of many turns: the first passage counts, and the least touch.
    #[test]
    fn a_reading_that_swings_is_followed() {
        let tent = tent(false, Reads::Other);
        for h in [0.9, 1.0, 2.0, 7.3, 15.0] {
            for (middle, phase) in [(0.5, 0.3), (1.5, 2.0), (0.3, 5.0), (0.2005, 0.1), (1.7995, 4.0)] {
                let w = std::f64::consts::TAU;
                let read = |t: f64| at(middle + 0.8 * (w * t + phase).cos(), -0.8 * w * (w * t + phase).sin());
                let touches: Option<f64> =
                    (0..200_000).map(|i| h * f64::from(i) / 2e5).find(|t| (read(*t).x > 1.0) != (read(0.0).x > 1.0));
                let (part, looked) = passed(&tent, h, w, read);
                match touches {
                    Some(t) => assert!((part.unwrap() * h - t).abs() < 0.02, "{h} {middle}: {part:?} {t}"),
                    None => assert_eq!(part, None, "{h} {middle}"),
                }
                assert!(looked < 100, "{looked}");
            }
        }
        // a hundredth beside the corner
        for h in [0.3, 0.9, 2.0] {
            let read = |t: f64| at(0.19 + 0.8 * (6.0 * t).cos(), -4.8 * (6.0 * t).sin());
            assert_eq!(passed(&tent, h, 6.0, read).0, None, "{h}");
        }
    }

    #[test]
    fn none_is_found_where_none_matters() {
        let open = tent(false, Reads::Other);
        assert_eq!(within(&open, 0.1, at(0.2, 1.0), at(0.3, 1.0)), None);
        // 1e-6 from the end: half its square times a jump of 2, over an effort that acts on 2
        assert_eq!(within(&open, 0.1, at(0.8, 2.0), at(1.0 + 1e-6, 2.0)), None);
        // the ends of a table that does not repeat itself are no breakpoints
        assert_eq!(within(&open, 0.1, at(1.9, 2.0), at(2.1, 2.0)), None);
        // a parabola in two pieces has none
        let cubics = [[0.0, 1.0, 0.0, 0.0], [0.0, 1.0, 2.0, 1.0]];
        assert!(Breakpoints::new(&[0.0, 1.0, 2.0], &cubics, Enters::Effort, false, Reads::Other).is_none());
    }

    #[test]
    fn periods_and_whole_turns_are_followed_up_and_down() {
        for (from, to) in [(1.9, 2.1), (3.9, 4.1), (-0.1, 0.1), (0.1, -0.1), (-1.9, -2.1)] {
            let rate = (to - from) / 0.1;
            let part = within(&tent(true, Reads::Other), 0.1, at(from, rate), at(to, rate)).unwrap();
            assert!((part - 0.5).abs() < 1e-12, "{from} to {to}: {part}");
        }
        let of_angle = tent(true, Reads::Angle);
        let part = within(&of_angle, 0.1, at(0.9 + std::f64::consts::TAU, 2.0), at(1.1, 2.0)).unwrap();
        assert!((part - 0.5).abs() < 1e-12, "{part}");
    }
}
