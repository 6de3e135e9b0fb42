//! Cubics by values and rates at the two ends of an interval, and how far what they stand for may be from them. (W1)

/// Longest interval over which a function of the state is approximated by a cubic. Scale: characteristic displacement.
/// Reason: over a third of a turn it has one minimum; over a full turn it returns to its values and hides the extrema
/// between.
pub const LONGEST_CUBIC: f64 = 2.0;
/// Number of points inside a step that are evaluated before it is shortened instead. Scale: a number. Reason: a step
/// with more inconclusive intervals extends over many turns.
pub const MOST_PLACES: usize = 120;
/// Parts of an interval at whose ends a cubic is compared with its error.
const PARTS: u32 = 16;
/// Point of evaluation where a cubic has no minimum of its own. Unit: fraction of the interval. Reason: the golden
/// section, so that no period of the motion coincides with repeated halves.
pub const INSIDE: f64 = 0.381_966;
/// The error of a cubic over an interval, from one sample in a longer one. Unit: the error for constant
/// fourth derivatives. Reason: allows for as much as was observed half-way along twice the interval.
const OTHER_FOURTH: f64 = 16.0;
/// Least distance of the place at which an extremum is evaluated from the ends of its interval. Unit: fraction of the
/// interval. Reason: a second evaluation at the same point adds nothing.
pub const EDGE: f64 = 0.01;
/// Number of bisections that locate a zero to round-off.
pub const HALVINGS: usize = 50;

/// The errors of the cubics over both parts of an interval that is divided at its fraction s, where its own cubic was
/// off by `seen` and known to be off by at most `known`.
pub fn errors_of_parts(s: f64, seen: f64, known: f64) -> [f64; 2] {
    // at one place the error may be zero by chance
    let off = (OTHER_FOURTH / (4.0 * s * (1.0 - s)).powi(2) * seen).max(known);
    [off * s.powi(4), off * (1.0 - s).powi(4)]
}

/// The cubic given by values and rates at both ends, over the fraction s of the interval.
#[derive(Clone, Copy)]
pub struct Cubic(pub [f64; 4]);

impl Cubic {
    /// Over an interval of length h, from (x, x') at its start to that at its end.
    pub fn new(h: f64, (x0, from): (f64, f64), (x1, to): (f64, f64)) -> Self {
        let (r0, r1) = (h * from, h * to);
        Self([x0, r0, 3.0 * (x1 - x0) - 2.0 * r0 - r1, r0 + r1 - 2.0 * (x1 - x0)])
    }

    /// With the other sign.
    pub fn reversed(&self) -> Self {
        Self(self.0.map(|x| -x))
    }

    /// Its value.
    pub fn at(&self, s: f64) -> f64 {
        let [a, b, c, d] = self.0;
        a + s * (b + s * (c + s * d))
    }

    /// Largest distance from its linear part.
    pub fn bend(&self) -> f64 {
        self.0[2].abs() + self.0[3].abs()
    }

    /// Its minimum inside, and where it lies.
    pub fn minimum(&self) -> Option<(f64, f64)> {
        let [_, b, c, d] = self.0;
        let under_root = c * c - 3.0 * d * b;
        // the root with the positive second derivative
        let s = -b / (c + under_root.max(0.0).sqrt());
        (under_root >= 0.0 && s > 0.0 && s < 1.0).then(|| (s, self.at(s)))
    }

    /// The lowest that is possible inside for what is off by at most this, in the middle: where, and how low.
    pub fn lowest(&self, off: f64) -> (f64, f64) {
        // the error of Hermite's cubic is proportional to s² (1 − s)²
        let bound = |s: f64| (s, self.at(s) - off * 16.0 * (s * (1.0 - s)).powi(2));
        let all = (1..PARTS).map(|i| f64::from(i) / f64::from(PARTS)).chain(self.minimum().map(|x| x.0)).map(bound);
        all.fold((INSIDE, f64::INFINITY), |least, x| if x.1 < least.1 { x } else { least })
    }

    /// The root of the cubic, if the values at its ends have different signs.
    pub fn zero(&self) -> f64 {
        let (mut low, mut high, ends) = (0.0, 1.0, [self.at(0.0), self.at(1.0)]);
        // one of the ends may be a zero already
        let falls = if ends[0].abs() > ends[1].abs() { ends[0] > 0.0 } else { ends[1] < 0.0 };
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            *(if (self.at(middle) > 0.0) == falls { &mut low } else { &mut high }) = middle;
        }
        0.5 * (low + high)
    }

    /// Where it turns between 0 and 1, ascending; 1 for what does not exist.
    pub fn turns(&self) -> [f64; 2] {
        let [_, r, b, c] = self.0;
        let under_root = b * b - 3.0 * c * r;
        if under_root < 0.0 {
            return [1.0; 2];
        }
        let sum = -(b + under_root.sqrt().copysign(b));
        let inside = |x: f64| if x > 0.0 && x < 1.0 { x } else { 1.0 };
        let (one, two) = (inside(r / sum), inside(sum / (3.0 * c)));
        [one.min(two), one.max(two)]
    }

    /// How far it goes, to and fro.
    pub fn travelled(&self) -> f64 {
        let [one, two] = self.turns();
        [0.0, one, two, 1.0].windows(2).map(|s| (self.at(s[1]) - self.at(s[0])).abs()).sum()
    }
}
