//! Breakpoints of piecewise cubics: points where a curve is not smooth.
//!
//! A method of order eight evaluates the motion at a dozen points of a step and treats it as a polynomial between them.
//! With a breakpoint inside, its error decreases only with the square of the step, and the estimate is no better. So
//! steps end at breakpoints wherever their effect exceeds the tolerance.

use crate::cubic::{Cubic, EDGE, HALVINGS};
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

    /// What the curve reads.
    pub fn reads(&self) -> Reads {
        self.reads
    }

    /// The first breakpoint that matters on an interval of a step: the fraction of the interval.
    pub fn within(&self, cubic: &Cubic, step: &Within) -> Option<f64> {
        if !self.may_matter(step.travelled, step.tolerance) {
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
    pub fn suspect(&self, cubic: &Cubic, off: f64, step: &Within) -> Option<f64> {
        if off == 0.0 || !self.may_matter(step.travelled, step.tolerance) {
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
    pub fn instant(&self, t: f64, h: f64) -> f64 {
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
    pub fn most(&self, moves: f64) -> f64 {
        self.spacing * self.jumps.len() as f64 * moves
    }

    /// Whether any of them may matter within a step over this part of the curve.
    pub fn may_matter(&self, travelled: f64, tolerance: f64) -> bool {
        self.matter(&self.largest, travelled, tolerance)
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
pub struct Within {
    /// Error of the velocities that is allowed, relative.
    pub tolerance: f64,
    /// How far the reading goes in the step.
    pub travelled: f64,
    /// Fractions of the step where it begins and ends.
    pub part: [f64; 2],
    /// Part of the step that is lost in the rounding of its times.
    pub rounding: f64,
}

impl Within {
    /// How much of a step of this length times distinguish.
    pub fn rounding(t: f64, length: f64) -> f64 {
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

#[cfg(test)]
mod tests {
    use super::*;

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
