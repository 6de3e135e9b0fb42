//! The watched functions along the current step: their readings at its start, at its end, and inside where these are not
//! conclusive, with bounds of what the cubics between them miss. All watches share them.                       (W1)

use super::observed::Observed;
use partita_system::breakpoints::Reads;
use partita_system::cubic::{errors_of_parts, Cubic, MOST_PLACES};
use partita_system::formulation::Formulation;
use partita_system::watched::Reading;
use partita_system::SystemError;

/// An instant of the step, with the bounds of the interval that begins there.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sample {
    pub(crate) t: f64,
    /// The fastest rate of the mechanism [1/s].
    pub(crate) fastest: f64,
    pub(crate) readings: Vec<Reading>,
    /// Error bounds of cubics over the interval in its middle; none where they are not known yet.
    pub(crate) off: Vec<Option<f64>>,
}

impl Sample {
    /// How far the mechanism moves until another instant, in characteristic displacements.
    pub(crate) fn moves(&self, to: &Self) -> f64 {
        (to.t - self.t) * self.fastest.max(to.fastest)
    }
}

/// The functions along the current step.
#[derive(Debug, Default)]
pub(crate) struct Track {
    reads: Vec<Reads>,
    /// How many of them are the system's. The others are those of the events.
    count: usize,
    pub(crate) observed: Option<Observed>,
    /// Start, points inside, end; `used` of them.
    samples: Vec<Sample>,
    used: usize,
}

/// The cubic between two readings of a function; one of an angle is continued to the end as that is read.
pub(crate) fn cubic(reads: Reads, h: f64, from: Reading, to: Reading) -> Cubic {
    let mut x0 = from.x;
    if reads == Reads::Angle {
        let start = to.x - 0.5 * h * (from.rate + to.rate);
        x0 += ((start - x0) / std::f64::consts::TAU).round() * std::f64::consts::TAU;
    }
    Cubic::new(h, (x0, from.rate), (to.x, to.rate))
}

impl Track {
    /// Of functions that are read so.
    pub(crate) fn new(reads: Vec<Reads>) -> Self {
        Self { count: reads.len(), reads, ..Self::default() }
    }

    /// Follow these functions as well.
    pub(crate) fn observe(&mut self, observed: Observed) {
        self.reads.truncate(self.count);
        self.reads.resize(self.count + observed.count(), Reads::Other);
        (self.observed, self.used) = (Some(observed), 0);
        self.samples.clear();
    }

    /// Number of functions of the system.
    pub(crate) fn count(&self) -> usize {
        self.count
    }

    /// Read the functions at the point last evaluated, with these whole turns, where a step ends at t or the integration
    /// begins.
    pub(crate) fn end_at(&mut self, t: f64, formulation: &mut dyn Formulation, turns: &[i32]) {
        let (count, mut observed) = (self.count, self.observed.take());
        self.end(t, |out| {
            let fastest = formulation.point().readings(t, &mut out[..count]);
            if let Some(observed) = &mut observed {
                observed.read_here(t, formulation, turns, &mut out[count..]);
            }
            fastest
        });
        self.observed = observed;
    }

    /// The first reading of an event that failed.
    pub(crate) fn failed(&mut self) -> Option<(f64, SystemError)> {
        self.observed.as_mut().and_then(Observed::failed)
    }

    /// Whether there are no functions.
    pub(crate) fn is_empty(&self) -> bool {
        self.reads.is_empty()
    }

    /// Whether no start is known yet.
    pub(crate) fn waits(&self) -> bool {
        self.used == 0 && !self.reads.is_empty()
    }

    /// Reset to no state.
    pub(crate) fn forget(&mut self) {
        self.used = 0;
    }

    /// Start, points inside, end; the start alone before a step is concluded.
    pub(crate) fn samples(&self) -> &[Sample] {
        &self.samples[..self.used]
    }

    /// Whether so many points inside the step were evaluated that it is to be shortened instead.
    pub(crate) fn is_full(&self) -> bool {
        self.used >= MOST_PLACES
    }

    /// The cubic of function i between two instants.
    pub(crate) fn cubic(&self, i: usize, ends: &[Sample]) -> Cubic {
        cubic(self.reads[i], ends[1].t - ends[0].t, ends[0].readings[i], ends[1].readings[i])
    }

    /// A sample after those in use, filled by `read`, which returns the fastest rate there [1/s].
    fn next(&mut self, t: f64, read: impl FnOnce(&mut [Reading]) -> f64) {
        if self.used == self.samples.len() {
            let n = self.reads.len();
            let (readings, off) = (vec![Reading::default(); n], vec![None; n]);
            self.samples.push(Sample { readings, off, ..Sample::default() });
        }
        self.used += 1;
        let sample = &mut self.samples[self.used - 1];
        sample.t = t;
        sample.fastest = read(&mut sample.readings);
        sample.off.fill(None);
    }

    /// A step ends at t, or an integration begins there.
    pub(crate) fn end(&mut self, t: f64, read: impl FnOnce(&mut [Reading]) -> f64) {
        self.used = self.used.min(1);
        self.samples[..self.used].iter_mut().for_each(|x| x.off.fill(None));
        self.next(t, read);
    }

    /// An instant inside the concluded step.
    pub(crate) fn inside(&mut self, t: f64, read: impl FnOnce(&mut [Reading]) -> f64) {
        let at = self.samples[..self.used].partition_point(|x| x.t < t).clamp(1, self.used - 1);
        self.next(t, read);
        self.samples[at..self.used].rotate_right(1);
        let Some([from, here, to]) = self.samples.get_mut(at - 1..=at + 1) else { return };
        let (h, s) = (to.t - from.t, (t - from.t) / (to.t - from.t));
        for (i, reads) in self.reads.iter().enumerate() {
            let cubic = cubic(*reads, h, from.readings[i], to.readings[i]);
            let missed = cubic.at(s) - here.readings[i].x;
            let seen = match reads {
                Reads::Time => 0.0,
                Reads::Angle => (missed - (missed / std::f64::consts::TAU).round() * std::f64::consts::TAU).abs(),
                Reads::Other => missed.abs(),
            };
            let [off, then] = errors_of_parts(s, seen, from.off[i].unwrap_or(cubic.bend()));
            (from.off[i], here.off[i]) = (Some(off), Some(then));
        }
    }

    /// The step stands: its end is the start of the next one.
    pub(crate) fn accept(&mut self) {
        if self.used > 0 {
            self.samples.swap(0, self.used - 1);
            self.used = 1;
            if let Some(observed) = &mut self.observed {
                observed.accept(self.samples[0].t);
            }
        }
    }
}
