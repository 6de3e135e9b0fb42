//! Breakpoints of piecewise cubics: points where a curve is not smooth.
//!
//! A method of order eight evaluates the motion at a dozen points of a step and treats it as a polynomial between them.
//! With a breakpoint inside, its error decreases only with the square of the step, and the estimate is no better. So
//! steps end at breakpoints wherever their effect exceeds the tolerance.

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

/// Remaining effect of a breakpoint in the middle of a step. Unit: fraction of its effect. Reason: the nodes of a
/// method lie a tenth of a step apart, and a sum over them has this relative error for a kink between two.
const BREAKPOINT_MISSED: f64 = 0.02;
/// Number of bisections that locate a breakpoint to round-off.
pub(crate) const HALVINGS: usize = 50;

/// The breakpoints of one curve, and the error of velocities at each.
#[derive(Clone, Debug)]
pub struct Breakpoints {
    breaks: Vec<f64>,
    /// For each break, the relative error of a velocity over a distance d past the breakpoint: `Σ jump_p d^p / p!`, p
    /// from 1.
    jumps: Vec<[f64; 4]>,
    /// The largest of each.
    largest: [f64; 4],
    period: Option<f64>,
    /// Whether the reading is an angle, known up to whole turns.
    angle: bool,
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
    pub fn new(breaks: &[f64], cubics: &[[f64; 4]], enters: Enters, periodic: bool, angle: bool) -> Option<Self> {
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
            period: periodic.then_some(last - first),
            angle,
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

    /// The first breakpoint that matters to a step of length h from one reading to another, if there is one: its time,
    /// as a fraction of the step.
    ///
    /// In between the reading follows the cubic given by its values and rates at both ends.
    pub fn within(&self, h: f64, from: Reading, to: Reading, tolerance: f64) -> Option<f64> {
        let mut x0 = from.x;
        if self.angle {
            // the end as the curve reads it
            let start = to.x - 0.5 * h * (from.rate + to.rate);
            x0 += ((start - x0) / std::f64::consts::TAU).round() * std::f64::consts::TAU;
        }
        let (rise, r0, r1) = (to.x - x0, h * from.rate, h * to.rate);
        let (b, c) = (3.0 * rise - 2.0 * r0 - r1, r0 + r1 - 2.0 * rise);
        let at = |s: f64| x0 + s * (r0 + s * (b + s * c));
        let [one, two] = turns(r0, b, c);
        let ends = [0.0, one, two, 1.0];
        let travelled: f64 = ends.windows(2).map(|s| (at(s[1]) - at(s[0])).abs()).sum();
        if !self.matter(&self.largest, travelled, tolerance) {
            return None;
        }
        for piece in ends.windows(2).filter(|s| s[1] > s[0]) {
            let (from, to) = (at(piece[0]), at(piece[1]));
            let up = to > from;
            let mut x = from;
            while let Some((breakpoint, i)) =
                self.next(x, up).filter(|(breakpoint, _)| if up { *breakpoint < to } else { *breakpoint > to })
            {
                x = breakpoint;
                if !self.matter(&self.jumps[i], travelled, tolerance) {
                    continue;
                }
                let (mut low, mut high) = (piece[0], piece[1]);
                for _ in 0..HALVINGS {
                    let middle = 0.5 * (low + high);
                    *(if (at(middle) < breakpoint) == up { &mut low } else { &mut high }) = middle;
                }
                // next to an end its effect is negligible, and the step cannot end there
                if lost(&self.jumps[i], travelled * low.min(1.0 - low)) > tolerance::NEGLIGIBLE_ERROR * tolerance {
                    return Some(low);
                }
            }
        }
        None
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
        let n = self.jumps.len();
        let first = self.breaks[0];
        let turns = self.period.map_or(0.0, |p| ((x - first) / p).floor());
        let offset = turns * self.period.unwrap_or(0.0);
        // up to n - 1 the breakpoints of this period; those of the next begin with its first
        let of_index = |i: usize| match i < n {
            true => self.breaks[i] + offset,
            false => self.breaks[0] + offset + self.period.unwrap_or(f64::INFINITY),
        };
        if up {
            let i = self.breaks[..n].partition_point(|k| k + offset <= x);
            let breakpoint = of_index(i);
            return (breakpoint > x && breakpoint.is_finite()).then_some((breakpoint, i % n));
        }
        let i = self.breaks[..n].partition_point(|k| k + offset < x);
        match (i, self.period) {
            (0, None) => None,
            (0, Some(p)) => Some((self.breaks[n - 1] + offset - p, n - 1)),
            _ => Some((of_index(i - 1), i - 1)),
        }
    }
}

/// Error of a velocity over a distance past a breakpoint.
fn lost(jumps: &[f64; 4], d: f64) -> f64 {
    jumps[0] * d + jumps[1] * d * d / 2.0 + jumps[2] * d * d * d / 6.0 + jumps[3] * d * d * d * d / 24.0
}

/// Zeros of `r + 2 b s + 3 c s^2` between 0 and 1, ascending; 1 for those that do not exist.
fn turns(r: f64, b: f64, c: f64) -> [f64; 2] {
    let under_root = b * b - 3.0 * c * r;
    if under_root < 0.0 {
        return [1.0; 2];
    }
    let sum = -(b + under_root.sqrt().copysign(b));
    let inside = |x: f64| if x > 0.0 && x < 1.0 { x } else { 1.0 };
    let (one, two) = (inside(r / sum), inside(sum / (3.0 * c)));
    [one.min(two), one.max(two)]
}

/// Breakpoints during an integration: readings at the start of the current step and at the end of the one that is
/// judged.
#[derive(Clone, Debug, Default)]
pub struct Watched {
    breakpoints: Vec<Breakpoints>,
    start: Ends,
    end: Ends,
    /// x'' at the start.
    bend: Vec<f64>,
}

#[derive(Clone, Debug, Default)]
struct Ends {
    t: f64,
    readings: Vec<Reading>,
}

impl Watched {
    /// Of these curves.
    pub fn new(breakpoints: Vec<Breakpoints>) -> Self {
        let ends = Ends { t: f64::NAN, readings: vec![Reading::default(); breakpoints.len()] };
        Self { bend: vec![0.0; breakpoints.len()], start: ends.clone(), end: ends, breakpoints }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.breakpoints.is_empty()
    }

    /// A step ends at t; the readings there are to be written.
    pub fn ends(&mut self, t: f64) -> &mut [Reading] {
        self.end.t = t;
        &mut self.end.readings
    }

    /// The step is accepted.
    pub fn accept(&mut self) {
        let h = self.end.t - self.start.t;
        for (bend, (from, to)) in self.bend.iter_mut().zip(self.start.readings.iter().zip(&self.end.readings)) {
            // the difference of rates alone: turns may lie between the values
            *bend = if h > 0.0 { (to.rate - from.rate) / h } else { 0.0 };
        }
        self.start.clone_from(&self.end);
    }

    /// When the step that is judged passes the first breakpoint that matters.
    pub fn within(&self, tolerance: f64) -> Option<f64> {
        let h = self.end.t - self.start.t;
        self.first(h, tolerance, |i| self.end.readings[i])
    }

    /// When a step of length h that begins now would pass one, by prediction.
    pub fn ahead(&self, h: f64, tolerance: f64) -> Option<f64> {
        self.first(h, tolerance, |i| {
            let (now, bend) = (self.start.readings[i], self.bend[i]);
            Reading { x: now.x + h * (now.rate + 0.5 * h * bend), rate: now.rate + h * bend }
        })
    }

    fn first(&self, h: f64, tolerance: f64, to: impl Fn(usize) -> Reading) -> Option<f64> {
        if h.is_nan() || h <= 0.0 {
            return None;
        }
        let parts = self
            .breakpoints
            .iter()
            .enumerate()
            .filter_map(|(i, breakpoints)| breakpoints.within(h, self.start.readings[i], to(i), tolerance));
        parts.reduce(f64::min).map(|part| self.start.t + part * h)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A linear table with the corner 0, 1, 0 over 0, 1, 2.
    fn tent(periodic: bool, angle: bool) -> Breakpoints {
        let cubics = [[0.0, 0.0, 1.0, 0.0], [0.0, 0.0, -1.0, 1.0]];
        Breakpoints::new(&[0.0, 1.0, 2.0], &cubics, Enters::Effort, periodic, angle).unwrap()
    }

    fn at(x: f64, rate: f64) -> Reading {
        Reading { x, rate }
    }

    #[test]
    fn a_breakpoint_within_the_step_is_found_where_it_is() {
        let part = tent(false, false).within(0.1, at(0.8, 4.0), at(1.2, 4.0), 1e-9).unwrap();
        assert!((part - 0.5).abs() < 1e-12, "{part}");
        // accelerated from rest, x = 0.8 + 0.4 s^2
        let part = tent(false, false).within(0.1, at(0.8, 0.0), at(1.2, 8.0), 1e-9).unwrap();
        assert!((part - 0.5f64.sqrt()).abs() < 1e-12, "{part}");
    }

    #[test]
    fn one_that_is_passed_there_and_back_is_found() {
        // x = 0.9 + 0.8 s (1 - s), at 1 where s (1 - s) = 1/8
        let part = tent(false, false).within(1.0, at(0.9, 0.8), at(0.9, -0.8), 1e-9).unwrap();
        assert!((part - 0.5 * (1.0 - 0.5f64.sqrt())).abs() < 1e-12, "{part}");
    }

    #[test]
    fn none_is_found_where_none_matters() {
        assert_eq!(tent(false, false).within(0.1, at(0.2, 1.0), at(0.3, 1.0), 1e-9), None);
        // 1e-6 from the end: half its square times a jump of 2, over an effort that acts on 2
        assert_eq!(tent(false, false).within(0.1, at(0.8, 2.0), at(1.0 + 1e-6, 2.0), 1e-9), None);
        // the ends of a table that does not repeat itself are no breakpoints
        assert_eq!(tent(false, false).within(0.1, at(1.9, 2.0), at(2.1, 2.0), 1e-9), None);
        // a parabola in two pieces has none
        let cubics = [[0.0, 1.0, 0.0, 0.0], [0.0, 1.0, 2.0, 1.0]];
        assert!(Breakpoints::new(&[0.0, 1.0, 2.0], &cubics, Enters::Effort, false, false).is_none());
    }

    #[test]
    fn periods_and_whole_turns_are_followed_up_and_down() {
        for (from, to) in [(1.9, 2.1), (3.9, 4.1), (-0.1, 0.1), (0.1, -0.1), (-1.9, -2.1)] {
            let rate = (to - from) / 0.1;
            let part = tent(true, false).within(0.1, at(from, rate), at(to, rate), 1e-9).unwrap();
            assert!((part - 0.5).abs() < 1e-12, "{from} to {to}: {part}");
        }
        let part = tent(true, true).within(0.1, at(0.9 + std::f64::consts::TAU, 2.0), at(1.1, 2.0), 1e-9).unwrap();
        assert!((part - 0.5).abs() < 1e-12, "{part}");
    }
}
