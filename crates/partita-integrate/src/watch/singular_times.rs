//! When a step passes singular positions: the zeros of the distance along its polynomial.
//!
//! Where branches cross once, C_D changes sides. Where two singular values vanish together, or one of them with its rate,
//! it does not, and the distance has a minimum that is zero.

use partita_math::tolerance;
use partita_system::formulation::Side;

/// Parts of a step between which sides are compared. Reason: two positions that are farther apart than such a part are
/// always distinguished; nearer ones are where the distance has a minimum.
const PARTS: usize = 8;
/// Evaluations by which one is located, at the most.
const LOCATING: usize = 12;
/// A singular position on a step is located to this. Scale: fraction of the step across it. Reason: nodes keep ten times
/// as far from it.
const ROOT_FOUND: f64 = 1e-3;
/// A minimum is approached by this at least. Scale: fraction of the interval between the points around it. Reason:
/// parabolas converge faster, where they do.
const APPROACHED: f64 = 0.1;
/// Where another zero is looked for beside one. Unit: multiples of the accuracy of a zero. Reason: up to half a part.
const BESIDE: [f64; 3] = [4.0, 16.0, 64.0];

/// A point of the step.
type Point = (f64, Side);

/// Times at which the mechanism is singular within a step, in order, for the side at each time of its polynomial; distances
/// fall by `rate` per second at the most. Returns the least distance that was found, none if sides cannot be compared.
pub(crate) fn find(
    (from, to): (f64, f64),
    rate: f64,
    side: &mut dyn FnMut(f64) -> Option<Side>,
    times: &mut Vec<f64>,
) -> Option<f64> {
    times.clear();
    let (first, last) = (side(from)?, side(to)?);
    let top = first.distance.max(last.distance);
    let (zero, shortest) = (tolerance::AT_SINGULARITY * top, ROOT_FOUND * (to - from));
    let mut search = Search { shortest, top, zero, nearest: f64::INFINITY, side, times };
    if search.stays_away((from, first), (to, last), rate, PARTS) {
        return Some(search.nearest);
    }
    let (mut points, mut known) = ([(to, last); PARTS + 1], (from, first));
    points[0] = known;
    for (i, point) in points.iter_mut().enumerate().take(PARTS).skip(1) {
        known = search.at(from + (to - from) * i as f64 / PARTS as f64, known.1);
        *point = known;
    }
    for i in 0..PARTS {
        if points[i].1.changed != points[i + 1].1.changed {
            search.root(points[i], points[i + 1]);
        }
        if let Some(next) = points.get(i + 2) {
            search.valley(points[i], points[i + 1], *next);
        }
    }
    // the distance may be lowest inside the first or the last part, if it rises from the end of the step: where the line
    // through the rest of it is zero
    for (end, beside) in [(points[0], points[1]), (points[PARTS], points[PARTS - 1])] {
        if end.1.changed == beside.1.changed && end.1.distance <= beside.1.distance {
            let middle = search.at(0.5 * (end.0 + beside.0), end.1);
            let slope = (beside.1.distance - middle.1.distance) / (beside.0 - middle.0);
            let line = middle.0 - middle.1.distance / slope;
            let (mut lowest, mut far) = (middle, beside);
            if (line - end.0) * (line - middle.0) < 0.0 && middle.1.distance > end.1.distance {
                (lowest, far) = (search.at(line, end.1), middle);
            }
            let (a, b) = if end.0 < far.0 { (end, far) } else { (far, end) };
            search.valley(a, lowest, b);
        }
    }
    search.times.sort_by(f64::total_cmp);
    Some(search.nearest)
}

struct Search<'a> {
    shortest: f64,
    /// The larger distance at the ends of the step, and what counts as none.
    top: f64,
    zero: f64,
    /// The least distance inside the step so far.
    nearest: f64,
    side: &'a mut dyn FnMut(f64) -> Option<Side>,
    times: &'a mut Vec<f64>,
}

impl Search<'_> {
    /// The side at t; in the position itself, where nothing can be evaluated, that of a neighbour at no distance.
    fn at(&mut self, t: f64, beside: Side) -> Point {
        let side = (self.side)(t).unwrap_or(Side { distance: 0.0, clearance: 0.0, ..beside });
        self.nearest = self.nearest.min(side.distance);
        (t, side)
    }

    /// Whether distances that change by `rate` at the most have no zero between these points, as far as `parts` of them
    /// show.
    fn stays_away(&mut self, a: Point, b: Point, rate: f64, parts: usize) -> bool {
        if a.1.changed != b.1.changed {
            return false;
        }
        if a.1.clearance + b.1.clearance >= rate * (b.0 - a.0) {
            return true;
        }
        if parts <= 1 {
            return false;
        }
        let middle = self.at(0.5 * (a.0 + b.0), a.1);
        self.stays_away(a, middle, rate, parts / 2) && self.stays_away(middle, b, rate, parts / 2)
    }

    /// The zeros between two points on different sides: by false position, an end that stays halved.
    fn root(&mut self, a: Point, b: Point) {
        let (mut one, mut two) = ((a.0, a.1.distance), (b.0, -b.1.distance));
        let (mut zero, mut from_one) = (f64::NAN, true);
        for _ in 0..LOCATING {
            if one.1 - two.1 <= 0.0 {
                break;
            }
            let last = std::mem::replace(&mut zero, one.0 + (two.0 - one.0) * one.1 / (one.1 - two.1));
            // a short move is the last one if the zero lies within it, which the other end has to show
            let short = (zero - last).abs() < self.shortest;
            let at = match (short, from_one) {
                (true, true) => zero + self.shortest,
                (true, false) => zero - self.shortest,
                _ => zero,
            };
            if at <= one.0 || at >= two.0 {
                break;
            }
            let here = self.at(at, a.1);
            let before = here.1.changed == a.1.changed;
            if here.1.distance <= 0.0 || (short && before != from_one) {
                break;
            }
            from_one = before;
            match here.1.changed {
                x if x == a.1.changed => (one, two.1) = ((at, here.1.distance), 0.5 * two.1),
                x if x == b.1.changed => (two, one.1) = ((at, -here.1.distance), 0.5 * one.1),
                // between two of them
                _ if two.0 - one.0 > self.shortest => {
                    self.root(a, here);
                    return self.root(here, b);
                }
                _ => break,
            }
        }
        let zero = if zero.is_finite() { zero } else { 0.5 * (a.0 + b.0) };
        if self.at(zero, a.1).1.distance > tolerance::MUCH_SMALLER * self.top {
            return; // a dead point of the choice alone
        }
        match a.1.changed.abs_diff(b.1.changed) > 1 {
            // of as many loops, at one time or not
            true => self.one_or_two(zero, a, b),
            false => self.times.push(zero),
        }
    }

    /// The zero between a and b, or two on whose way C_D is on a side of neither.
    fn one_or_two(&mut self, zero: f64, a: Point, b: Point) {
        for apart in BESIDE.map(|x| x * self.shortest) {
            for t in [zero - apart, zero + apart] {
                if t <= a.0 || t >= b.0 {
                    continue;
                }
                let here = self.at(t, a.1);
                if here.1.changed != a.1.changed && here.1.changed != b.1.changed {
                    self.root(a, here);
                    return self.root(here, b);
                }
            }
        }
        self.times.push(zero);
    }

    /// The zeros at a minimum of the distance between points on one side: by parabolas of its square, which is one where
    /// the distance falls linearly, or of itself where these predict better what is found next.
    fn valley(&mut self, mut a: Point, mut m: Point, mut b: Point) {
        let lowest = m.1.distance <= a.1.distance.min(b.1.distance);
        if !lowest || a.1.changed != b.1.changed || (m.1.changed == a.1.changed && m.1.distance == a.1.distance) {
            return;
        }
        let mut power = 2;
        for _ in 0..2 * LOCATING {
            if m.1.changed != a.1.changed {
                self.root(a, m);
                return self.root(m, b);
            }
            let vertex = Parabola::through(a, m, b, power).lowest();
            if b.0 - a.0 < self.shortest || (m.1.distance <= self.zero && (vertex - m.0).abs() < self.shortest) {
                break;
            }
            let next = self.at(apart_from(vertex, a, m, b), m.1);
            let missed = |power| (Parabola::through(a, m, b, power).distance(next.0) - next.1.distance).abs();
            power = if missed(1) < missed(2) { 1 } else { 2 };
            (a, m, b) = match (next.1.distance < m.1.distance || next.1.changed != m.1.changed, next.0 < m.0) {
                (true, true) => (a, next, m),
                (true, false) => (m, next, b),
                (false, true) => (next, m, b),
                (false, false) => (a, m, next),
            };
        }
        if m.1.distance <= self.zero {
            self.one_or_two(m.0, a, b);
        }
    }
}

/// The parabola through three distances to some power.
struct Parabola {
    middle: (f64, f64),
    slope: f64,
    bend: f64,
    power: i32,
}

impl Parabola {
    fn through(a: Point, m: Point, b: Point, power: i32) -> Self {
        let of = |p: Point| p.1.distance.powi(power);
        let (left, right) = ((of(m) - of(a)) / (m.0 - a.0), (of(b) - of(m)) / (b.0 - m.0));
        let bend = (right - left) / (b.0 - a.0);
        Self { middle: (m.0, of(m)), slope: left + bend * (m.0 - a.0), bend, power }
    }

    /// Where it is lowest.
    fn lowest(&self) -> f64 {
        let vertex = self.middle.0 - 0.5 * self.slope / self.bend;
        if vertex.is_finite() {
            vertex
        } else {
            self.middle.0
        }
    }

    /// The distance that it predicts.
    fn distance(&self, t: f64) -> f64 {
        let h = t - self.middle.0;
        (self.middle.1 + h * (self.slope + h * self.bend)).max(0.0).powf(1.0 / f64::from(self.power))
    }
}

/// A point near the vertex and apart from those known.
fn apart_from(vertex: f64, a: Point, m: Point, b: Point) -> f64 {
    let away = APPROACHED * (b.0 - a.0).min(2.0 * (m.0 - a.0).min(b.0 - m.0));
    let vertex = vertex.clamp(a.0 + 0.5 * away, b.0 - 0.5 * away);
    match (vertex - m.0).abs() < APPROACHED * APPROACHED * away {
        false => vertex,
        true if b.0 - m.0 > m.0 - a.0 => m.0 + APPROACHED * (b.0 - m.0),
        true => m.0 - APPROACHED * (m.0 - a.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(f: impl Fn(f64) -> Option<(f64, usize)>) -> Vec<f64> {
        let mut times = Vec::new();
        let mut side = |t| f(t).map(|(distance, changed)| Side { distance, clearance: distance, changed });
        assert!(find((1.0, 2.0), f64::INFINITY, &mut side, &mut times).is_some());
        times
    }

    fn near(found: &[f64], expected: &[f64]) -> bool {
        found.len() == expected.len() && found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 2e-3)
    }

    /// Where the distances of two loops vanish, and where that of one loop does twice.
    #[test]
    fn every_zero_of_a_step_is_found() {
        for (a, b) in [(1.2, 1.7), (1.31, 1.36), (1.43, 1.45), (1.1, 1.95), (1.502, 1.51)] {
            let each = |t: f64| [t.sin() * (t - a), t.exp() * (t - b)];
            let two = found(|t| {
                let d = each(t);
                Some((d[0].abs().min(d[1].abs()), d.iter().filter(|x| **x > 0.0).count()))
            });
            assert!(near(&two, &[a, b]), "{a} {b}: {two:?}");
            let twice = found(|t| {
                let d = t.exp() * (t - a) * (t - b);
                Some((d.abs(), usize::from(d < 0.0)))
            });
            assert!(near(&twice, &[a, b]), "twice {a} {b}: {twice:?}");
        }
    }

    /// Two singular values that vanish together change no sign, nor does one that vanishes with its rate; a minimum that
    /// is not zero is none, and where a side is unknown the position itself is.
    #[test]
    fn positions_without_a_change_of_sides_are_found() {
        for z in [1.01, 1.06, 1.1, 1.25, 1.4321, 1.5, 1.93, 1.985] {
            assert!(near(&found(|t| Some(((t - z).abs() * t.cosh(), 0))), &[z]), "{z}");
            // next to an end such a position is too flat for the line
            assert!(
                !(1.02..1.98).contains(&z) || near(&found(|t| Some(((t - z).powi(2) * (1.0 + t), 0))), &[z]),
                "{z}"
            );
            assert!(near(&found(|t| (t != z).then_some(((t - z).abs(), usize::from(t > z)))), &[z]), "{z}");
            assert!(found(|t| Some(((t - z).hypot(0.02), 0))).is_empty(), "{z}");
        }
        // coordinates at a dead point of theirs change sides, the distance stays
        assert!(found(|t| Some((t, usize::from(t > 1.4)))).is_empty());
        assert!(found(|t| Some((t, 0))).is_empty() && found(|_| Some((1.0, 0))).is_empty());
        assert!(near(&found(|t| Some(((t - 1.3).abs(), if t > 1.3 { 40 } else { 0 }))), &[1.3]));
    }

    /// Distances that fall by a known rate at the most need few points where they are large, and all of a nearest
    /// approach is told.
    #[test]
    fn few_points_show_that_a_step_stays_away() {
        let looks = |least: f64, rate: f64| {
            let (mut count, mut times) = (0, Vec::new());
            let nearest = find(
                (0.0, 1.0),
                rate,
                &mut |t| {
                    count += 1;
                    let distance = (t - 0.61).hypot(least);
                    Some(Side { distance, clearance: distance, changed: 0 })
                },
                &mut times,
            );
            assert!(times.is_empty());
            (count, nearest.unwrap())
        };
        assert_eq!(looks(0.6, 1.0), (2, f64::INFINITY));
        assert_eq!(looks(0.4, 2.0).0, 4);
        let (count, nearest) = looks(0.01, 2.0);
        assert!(count > PARTS && (0.01..0.0101).contains(&nearest), "{count} {nearest}");
    }

    #[test]
    fn sides_that_cannot_be_compared_are_not_searched() {
        assert!(find((0.0, 1.0), f64::INFINITY, &mut |_| None, &mut Vec::new()).is_none());
    }
}
