//! Breakpoints of piecewise cubics: points where a curve is not smooth.
//!
//! A method of order eight evaluates the motion at a dozen points of a step and treats it as a polynomial between them.
//! With a breakpoint inside, its error decreases only with the square of the step, and the estimate is no better. So
//! steps end at breakpoints wherever their effect exceeds the tolerance.

use crate::cubic::{errors_of_parts, Cubic, EDGE, HALVINGS, INSIDE, LONGEST_CUBIC, MOST_PLACES};
use partita_math::tolerance;

/// Level of the equations at which a curve enters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Enters {
    /// As an effort.
    Effort,
    /// As a prescribed rate.
    Rate,
    /// As a prescribed or followed position.
    Position,
}

/// What a curve reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reads {
    /// Time, which is known exactly.
    Time,
    /// An angle, known up to whole turns.
    Angle,
    /// Another function of the state.
    Other,
}

/// Remaining effect of a breakpoint in the middle of a step. Unit: fraction of its effect. Reason: the nodes of a
/// method lie a tenth of a step apart, and a sum over them has this relative error for a kink between two.
const BREAKPOINT_MISSED: f64 = 0.02;

/// The breakpoints of one curve, and the error of velocities at each.
#[derive(Clone, Debug)]
pub struct Breakpoints {
    breaks: Vec<f64>,
    /// For each break, the relative error of a velocity over a distance d past the breakpoint: `Σ jump_p d^p / p!`, p
    /// from 1.
    jumps: Vec<[f64; 4]>,
    /// The largest of each.
    largest: [f64; 4],
    /// Leading jumps that leave the equations without a derivative: of an effort and its slope, of a rate's slope, of
    /// a curvature.
    sharp: usize,
    period: Option<f64>,
    reads: Reads,
    /// Mean distance between two.
    spacing: f64,
}

/// The abscissa, and its rate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading {
    /// x.
    pub x: f64,
    /// x'.
    pub rate: f64,
}

impl Breakpoints {
    /// Of piecewise cubics, the highest power first; `periodic` if they repeat after the last break. None where no
    /// break is a breakpoint.
    pub fn new(breaks: &[f64], cubics: &[[f64; 4]], enters: Enters, periodic: bool, reads: Reads) -> Option<Self> {
        let n = cubics.len();
        let (first, last) = (*breaks.first()?, *breaks.last()?);
        let derivatives = |[a, b, c, d]: [f64; 4], x: f64| {
            [((a * x + b) * x + c) * x + d, (3.0 * a * x + 2.0 * b) * x + c, 6.0 * a * x + 2.0 * b, 6.0 * a]
        };
        let mut sizes = [0.0f64; 4];
        for (i, cubic) in cubics.iter().enumerate() {
            for x in [0.0, breaks[i + 1] - breaks[i]] {
                for (size, y) in sizes.iter_mut().zip(derivatives(*cubic, x)) {
                    *size = size.max(y.abs());
                }
            }
        }
        // derivative number k over the unit of the velocities is the jump of power p
        let (lowest, measure) = match enters {
            Enters::Effort => (0, sizes[0] * (last - first)),
            Enters::Rate => (1, sizes[0]),
            Enters::Position => (2, sizes[1]),
        };
        if measure == 0.0 {
            return None;
        }
        let mut found = Self {
            breaks: breaks.to_vec(),
            jumps: vec![[0.0; 4]; n],
            largest: [0.0; 4],
            sharp: if enters == Enters::Effort { 2 } else { 1 },
            period: periodic.then_some(last - first),
            reads,
            spacing: (last - first) / n as f64,
        };
        for i in usize::from(!periodic)..n {
            let before = if i == 0 { n - 1 } else { i - 1 };
            let left = derivatives(cubics[before], breaks[before + 1] - breaks[before]);
            let right = derivatives(cubics[i], 0.0);
            for k in lowest..4 {
                let jump = (right[k] - left[k]).abs();
                if jump > tolerance::EQUAL * sizes[k] {
                    found.jumps[i][k - lowest] = jump / measure;
                    found.largest[k - lowest] = found.largest[k - lowest].max(jump / measure);
                }
            }
        }
        (found.largest != [0.0; 4]).then_some(found)
    }

    /// The breakpoint at x, if the equations have no derivative there.
    pub fn sharp_at(&self, x: f64) -> Option<f64> {
        let near = tolerance::EQUAL * self.spacing;
        let (breakpoint, i) = self.next(x - near, true)?;
        let sharp = self.jumps[i][..self.sharp].iter().any(|jump| *jump > 0.0);
        (sharp && breakpoint <= x + near).then_some(breakpoint)
    }

    /// The reading in between, as the cubic given by values and rates at both ends of an interval of length h.
    fn cubic(&self, h: f64, from: Reading, to: Reading) -> Cubic {
        let mut x0 = from.x;
        if self.reads == Reads::Angle {
            // the end as the curve reads it
            let start = to.x - 0.5 * h * (from.rate + to.rate);
            x0 += ((start - x0) / std::f64::consts::TAU).round() * std::f64::consts::TAU;
        }
        Cubic::new(h, (x0, from.rate), (to.x, to.rate))
    }

    /// The first breakpoint that matters on an interval of a step: the fraction of the interval.
    fn within(&self, cubic: &Cubic, step: &Within) -> Option<f64> {
        if !self.matter(&self.largest, step.travelled, step.tolerance) {
            return None;
        }
        let [one, two] = cubic.turns();
        for piece in [0.0, one, two, 1.0].windows(2).filter(|s| s[1] > s[0]) {
            let (from, to) = (cubic.at(piece[0]), cubic.at(piece[1]));
            let up = to > from;
            let mut x = from;
            while let Some((breakpoint, i)) =
                self.next(x, up).filter(|(breakpoint, _)| if up { *breakpoint <= to } else { *breakpoint >= to })
            {
                x = breakpoint;
                if !self.matter(&self.jumps[i], step.travelled, step.tolerance) {
                    continue;
                }
                let (mut low, mut high) = (piece[0], piece[1]);
                for _ in 0..HALVINGS {
                    let middle = 0.5 * (low + high);
                    *(if (cubic.at(middle) < breakpoint) == up { &mut low } else { &mut high }) = middle;
                }
                // next to an end of the step its effect is negligible, and it cannot end there
                let part = step.part[0] + low * (step.part[1] - step.part[0]);
                let inside = part.min(1.0 - part);
                if inside > step.rounding && step.is_felt(&self.jumps[i], step.travelled * inside) {
                    return Some(low);
                }
            }
        }
        None
    }

    /// Where on an interval the reading may reach a breakpoint that its cubic, off by at most so much, does not show.
    fn suspect(&self, cubic: &Cubic, off: f64, step: &Within) -> Option<f64> {
        if off == 0.0 || !self.matter(&self.largest, step.travelled, step.tolerance) {
            return None;
        }
        // where it turns, the reading stays long on what it hardly reaches
        let stays = (off * (off + cubic.travelled())).sqrt();
        for (up, cubic) in [(true, cubic.reversed()), (false, *cubic)] {
            let sign = if up { -1.0 } else { 1.0 };
            let (at, lowest) = cubic.lowest(off);
            let shown = cubic.at(0.0).min(cubic.at(1.0)).min(cubic.minimum().map_or(f64::INFINITY, |x| x.1));
            let mut x = sign * shown;
            while let Some((breakpoint, i)) = self.next(x, up).filter(|found| sign * found.0 > lowest) {
                x = breakpoint;
                if self.matter(&self.jumps[i], step.travelled, step.tolerance) && step.is_felt(&self.jumps[i], stays) {
                    return Some(at.clamp(EDGE, 1.0 - EDGE));
                }
            }
        }
        None
    }

    /// The instant at which the reading is at a breakpoint, found at t on an interval of length h: of time, the breakpoint
    /// itself. A step that ends a rounding beside it begins on the wrong side of a jump.
    fn instant(&self, t: f64, h: f64) -> f64 {
        if self.reads != Reads::Time {
            return t;
        }
        let i = self.breaks.partition_point(|k| *k < t);
        let beside = self.breaks[i.saturating_sub(1)..(i + 1).min(self.breaks.len())].iter().copied();
        let nearest = beside.min_by(|a, b| (a - t).abs().total_cmp(&(b - t).abs())).unwrap_or(t);
        match (nearest - t).abs() <= tolerance::SUM_ROUNDING * (t.abs() + h) {
            true => nearest,
            false => t,
        }
    }

    /// How far a reading goes at most, to and fro over the curve, where the mechanism moves that far.
    fn most(&self, moves: f64) -> f64 {
        self.spacing * self.jumps.len() as f64 * moves
    }

    /// Whether a breakpoint matters within a step over this part of the curve.
    fn matter(&self, jumps: &[f64; 4], travelled: f64, tolerance: f64) -> bool {
        let breakpoints = travelled / self.spacing;
        // of many, each acts over the distance to the next
        let each = lost(jumps, travelled.min(self.spacing)) * breakpoints.max(1.0);
        let missed = BREAKPOINT_MISSED * each;
        missed > tolerance * breakpoints.clamp(1.0, tolerance::ERROR_GROWTH)
    }

    /// The next breakpoint after x on the way up or down, and its number.
    fn next(&self, x: f64, up: bool) -> Option<(f64, usize)> {
        let (n, first) = (self.jumps.len() as i64, self.breaks[0]);
        // they are numbered through all periods; the last break of one is the first of the next
        let place = |j: i64| match self.period {
            Some(p) => self.breaks[j.rem_euclid(n) as usize] + j.div_euclid(n) as f64 * p,
            None => self.breaks[j as usize],
        };
        let turns = self.period.map_or(0.0, |p| ((x - first) / p).floor());
        if turns.abs() * tolerance::SUM_ROUNDING > 1.0 {
            return None; // the angle is not known to a period
        }
        let offset = turns * self.period.unwrap_or(0.0);
        let in_period = self.breaks[..self.jumps.len()].partition_point(|k| k + offset <= x) as i64;
        let mut j = turns as i64 * n + in_period;
        let (lowest, highest) = if self.period.is_some() { (i64::MIN, i64::MAX) } else { (0, n) };
        // the first above x, wherever its period was rounded to
        while j > lowest && place(j - 1) > x {
            j -= 1;
        }
        while j < highest && place(j) <= x {
            j += 1;
        }
        if !up {
            j -= 1;
            while j >= lowest && place(j) >= x {
                j -= 1;
            }
        }
        (j >= lowest && j < highest).then(|| (place(j), j.rem_euclid(n) as usize))
    }
}

/// An interval of a step.
struct Within {
    tolerance: f64,
    /// How far the reading goes in the step.
    travelled: f64,
    /// Fractions of the step where it begins and ends.
    part: [f64; 2],
    /// Part of the step that is lost in the rounding of its times.
    rounding: f64,
}

impl Within {
    /// How much of a step of this length times distinguish.
    fn rounding(t: f64, length: f64) -> f64 {
        tolerance::SUM_ROUNDING * t.abs() / length
    }

    /// Whether a breakpoint is felt over a distance past it.
    fn is_felt(&self, jumps: &[f64; 4], d: f64) -> bool {
        lost(jumps, d) > tolerance::NEGLIGIBLE_ERROR * self.tolerance
    }
}

/// Error of a velocity over a distance past a breakpoint.
fn lost(jumps: &[f64; 4], d: f64) -> f64 {
    jumps[0] * d + jumps[1] * d * d / 2.0 + jumps[2] * d * d * d / 6.0 + jumps[3] * d * d * d * d / 24.0
}

/// What is to be done with a step for the breakpoints in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Passing {
    /// None that matters is passed.
    Clear,
    /// The dense output at this time must be evaluated.
    At(f64),
    /// The step should end at this time.
    Until(f64),
}

/// Breakpoints during an integration: readings at the start of the current step, at the end of the one that is
/// judged, and inside where these do not show what the reading does.
#[derive(Clone, Debug, Default)]
pub struct Watched {
    breakpoints: Vec<Breakpoints>,
    /// Start, points inside, end; `used` of them.
    samples: Vec<Sample>,
    used: usize,
    /// How far each reading goes in the step.
    travelled: Vec<f64>,
    /// x'' at the start.
    bend: Vec<f64>,
}

/// An instant, with what is known of the interval that begins there.
#[derive(Clone, Debug, Default)]
struct Sample {
    t: f64,
    /// The fastest rate of the mechanism [1/s].
    fastest: f64,
    readings: Vec<Reading>,
    /// Errors of cubics over the interval; none where they are not known yet.
    off: Vec<Option<f64>>,
}

impl Watched {
    /// Of these curves.
    pub fn new(breakpoints: Vec<Breakpoints>) -> Self {
        let n = breakpoints.len();
        Self { bend: vec![0.0; n], travelled: vec![0.0; n], breakpoints, ..Self::default() }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.breakpoints.is_empty()
    }

    fn next(&mut self, t: f64, fastest: f64) -> &mut Sample {
        if self.used == self.samples.len() {
            let n = self.breakpoints.len();
            self.samples.push(Sample {
                readings: vec![Reading::default(); n],
                off: vec![None; n],
                ..Sample::default()
            });
        }
        self.used += 1;
        let sample = &mut self.samples[self.used - 1];
        (sample.t, sample.fastest) = (t, fastest);
        sample.off.fill(None);
        sample
    }

    /// A step ends at t; the readings there are to be written. `fastest` is the fastest rate there [1/s].
    pub fn ends(&mut self, t: f64, fastest: f64) -> &mut [Reading] {
        self.used = self.used.min(1);
        self.samples[..self.used].iter_mut().for_each(|x| x.off.fill(None));
        &mut self.next(t, fastest).readings
    }

    /// An instant inside the step that is judged; `read` writes the readings there.
    pub fn inside(&mut self, t: f64, fastest: f64, read: impl FnOnce(&mut [Reading])) {
        let at = self.samples[..self.used].partition_point(|x| x.t < t).clamp(1, self.used - 1);
        read(&mut self.next(t, fastest).readings);
        self.samples[at..self.used].rotate_right(1);
        let [from, here, to] = &mut self.samples[at - 1..=at + 1] else { return };
        let (h, s) = (to.t - from.t, (t - from.t) / (to.t - from.t));
        for (i, breakpoints) in self.breakpoints.iter().enumerate() {
            let cubic = breakpoints.cubic(h, from.readings[i], to.readings[i]);
            let seen = match breakpoints.reads {
                Reads::Time => 0.0,
                Reads::Angle => {
                    let off = cubic.at(s) - here.readings[i].x;
                    (off - (off / std::f64::consts::TAU).round() * std::f64::consts::TAU).abs()
                }
                Reads::Other => (cubic.at(s) - here.readings[i].x).abs(),
            };
            let [off, then] = errors_of_parts(s, seen, from.off[i].unwrap_or(cubic.bend()));
            (from.off[i], here.off[i]) = (Some(off), Some(then));
        }
    }

    /// The step is accepted.
    pub fn accept(&mut self) {
        if self.used == 0 {
            return;
        }
        let (from, to) = (&self.samples[self.used.saturating_sub(2)], &self.samples[self.used - 1]);
        let h = to.t - from.t;
        for (bend, (from, to)) in self.bend.iter_mut().zip(from.readings.iter().zip(&to.readings)) {
            // the difference of rates alone: turns may lie between the values
            *bend = if h > 0.0 { (to.rate - from.rate) / h } else { 0.0 };
        }
        self.samples.swap(0, self.used - 1);
        self.used = 1;
    }

    /// Whether the step that is judged passes a breakpoint that matters.
    pub fn look(&mut self, tolerance: f64) -> Passing {
        let samples = &self.samples[..self.used];
        let [first, .., last] = samples else { return Passing::Clear };
        let length = last.t - first.t;
        if length.is_nan() || length <= 0.0 {
            return Passing::Clear;
        }
        for (i, (breakpoints, travelled)) in self.breakpoints.iter().zip(&mut self.travelled).enumerate() {
            let far = |ends: &[Sample]| match ends[0].shows(&ends[1], breakpoints.reads) {
                true => {
                    let h = ends[1].t - ends[0].t;
                    breakpoints.cubic(h, ends[0].readings[i], ends[1].readings[i]).travelled()
                }
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
                let (at, known) = if ends[0].shows(&ends[1], breakpoints.reads) {
                    let cubic = breakpoints.cubic(h, ends[0].readings[i], ends[1].readings[i]);
                    let off = match breakpoints.reads {
                        Reads::Time => 0.0,
                        _ => ends[0].off[i].unwrap_or(cubic.bend()),
                    };
                    match breakpoints.within(&cubic, &step) {
                        Some(at) => (at, true),
                        None => match breakpoints.suspect(&cubic, off, &step) {
                            Some(at) => (at, false),
                            None => continue,
                        },
                    }
                } else if breakpoints.matter(&breakpoints.largest, step.travelled, tolerance) {
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
                Some((_, t, true)) => return Passing::Until(t),
                Some((_, t, false)) if self.used < MOST_PLACES => return Passing::At(t),
                Some(_) => return Passing::Until(ends[usize::from(n == 0)].t),
            }
        }
        Passing::Clear
    }

    /// When a step of length h that begins now would pass one, by prediction.
    pub fn ahead(&self, h: f64, tolerance: f64) -> Option<f64> {
        let start = self.samples[..self.used].first()?;
        if h.is_nan() || h <= 0.0 {
            return None;
        }
        let passes = |(i, breakpoints): (usize, &Breakpoints)| {
            // no farther than the prediction holds
            let h = match breakpoints.reads {
                Reads::Time => h,
                _ => h.min(LONGEST_CUBIC / start.fastest),
            };
            let (now, bend) = (start.readings[i], self.bend[i]);
            let then = Reading { x: now.x + h * (now.rate + 0.5 * h * bend), rate: now.rate + h * bend };
            let cubic = Cubic::new(h, (now.x, now.rate), (then.x, then.rate));
            let rounding = Within::rounding(start.t, h);
            let step = Within { tolerance, travelled: cubic.travelled(), part: [0.0, 1.0], rounding };
            Some(breakpoints.instant(start.t + h * breakpoints.within(&cubic, &step)?, h))
        };
        self.breakpoints.iter().enumerate().filter_map(passes).reduce(f64::min)
    }
}

impl Sample {
    /// How far the mechanism moves until another instant, in characteristic displacements.
    fn moves(&self, to: &Self) -> f64 {
        (to.t - self.t) * self.fastest.max(to.fastest)
    }

    /// Whether the readings at both show what lies between.
    fn shows(&self, to: &Self, reads: Reads) -> bool {
        reads == Reads::Time || self.moves(to) <= LONGEST_CUBIC
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A linear table with the corner 0, 1, 0 over 0, 1, 2.
    fn tent(periodic: bool, reads: Reads) -> Breakpoints {
        let cubics = [[0.0, 0.0, 1.0, 0.0], [0.0, 0.0, -1.0, 1.0]];
        Breakpoints::new(&[0.0, 1.0, 2.0], &cubics, Enters::Effort, periodic, reads).unwrap()
    }

    fn at(x: f64, rate: f64) -> Reading {
        Reading { x, rate }
    }

    /// The fraction of a step of length h that ends at the first breakpoint; the places are looked at on `read` itself.
    fn passed(of: &Breakpoints, h: f64, fastest: f64, read: impl Fn(f64) -> Reading) -> (Option<f64>, usize) {
        let mut watched = Watched::new(vec![of.clone()]);
        watched.ends(0.0, fastest)[0] = read(0.0);
        watched.accept();
        watched.ends(h, fastest)[0] = read(h);
        for n in 0..200 {
            match watched.look(1e-9) {
                Passing::Clear => return (None, n),
                Passing::Until(t) => return (Some(t / h), n),
                Passing::At(t) => watched.inside(t, fastest, |out| out[0] = read(t)),
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

    /// From each breakpoint the next one follows, whatever the period and however its multiples are rounded.
    #[test]
    fn every_breakpoint_follows_the_one_before() {
        for period in [std::f64::consts::TAU, 1.0, 0.7, 1e-3 / 3.0, 123.4] {
            let breaks: Vec<f64> = [0.1, 0.3, 0.31, 0.9].iter().map(|x| x * period).chain([1.1 * period]).collect();
            let cubics = [[0.0; 4], [0.0, 0.0, 1.0, 0.0], [0.0; 4], [0.0, 0.0, 2.0, 0.0]];
            let found = Breakpoints::new(&breaks, &cubics, Enters::Effort, true, Reads::Angle).unwrap();
            for up in [true, false] {
                let mut x = if up { -300.05 * period } else { 300.05 * period };
                let mut before = None;
                for n in 0..2400 {
                    let (next, i) = found.next(x, up).unwrap();
                    assert!((next > x) == up && (next - x).abs() < 0.6 * period, "{period} {n}: {x} {next}");
                    let expected = |j: usize| if up { (j + 1) % 4 } else { (j + 3) % 4 };
                    assert_eq!(i, before.map_or(i, expected));
                    (x, before) = (next, Some(i));
                }
            }
        }
    }
}
