//! Events: the zeros of functions that only observe. They are located on the dense output of the step as it is taken, so
//! that a run is the same to the bit whether it is observed or not. One that ends the integration has its step end there,
//! on the true motion.                                                                                            (W1)

use super::interval::{sides, Felt, Interval, Shown};
use super::track::{Sample, Track};
use super::{Look, StepView, Watch};
use crate::failure::StepFailure;
use partita_math::tolerance;
use partita_system::event::{Event, Occurrence};
use partita_system::SystemError;

/// Zeros of different functions that are closer are at one instant. Scale: multiples of how exactly each is located.
/// Reason: both may be off by that.
const ONE_INSTANT: f64 = 2.0;
/// How much farther from the zero each further trial of a step may end that ends at an event. Scale: multiples. Reason:
/// from rounding to the error of the loosest tolerance in a dozen trials.
const WIDER: f64 = 10.0;

/// A zero of a function in the concluded step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Zero {
    pub(crate) t: f64,
    pub(crate) event: usize,
    pub(crate) rises: bool,
}

/// What the readings show about the zeros of a step.
enum Search {
    /// All are found.
    Done,
    /// The functions must be read at this time.
    Unclear(f64),
}

/// The events of an integration.
#[derive(Debug, Default)]
pub(crate) struct EventWatch {
    events: Vec<Event>,
    /// How often each has occurred.
    count: Vec<u64>,
    /// The largest terms of each function so far: what it is rounded to.
    size: Vec<f64>,
    /// The longest step so far.
    longest: f64,
    /// When the integration began, and whether each has left zero since.
    begins: Option<f64>,
    left: Vec<bool>,
    /// Whether each has left it by the instant of the step that is looked at.
    gone: Vec<bool>,
    /// The zeros of the concluded step that count, in the order of time.
    zeros: Vec<Zero>,
    /// In how many steps the readings did not decide about each, and in the concluded one.
    undecided: Vec<u64>,
    unclear: Vec<bool>,
    /// Trials of a step that ends at an event, and that event.
    trials: i32,
    wanted: Option<Zero>,
    /// Occurrences allowed.
    most: usize,
    occurrences: Vec<Occurrence>,
}

impl EventWatch {
    /// These events, with at most so many occurrences.
    pub(crate) fn new(events: Vec<Event>, most: usize) -> Self {
        let n = events.len();
        let (count, size, undecided) = (vec![0; n], vec![0.0; n], vec![0; n]);
        let [unclear, left, gone] = [(); 3].map(|()| vec![false; n]);
        Self { count, size, undecided, unclear, left, gone, most, events, ..Self::default() }
    }

    /// What has happened.
    pub(crate) fn take_occurrences(&mut self) -> Vec<Occurrence> {
        std::mem::take(&mut self.occurrences)
    }

    /// What has happened since then did not: the motion is set back.
    pub(crate) fn forget_occurrences(&mut self) {
        for occurrence in std::mem::take(&mut self.occurrences) {
            self.count[occurrence.event] -= 1;
        }
        self.zeros.clear();
    }

    /// Events about which steps did not decide, in sentences.
    pub(crate) fn notes(&self) -> impl Iterator<Item = String> + '_ {
        self.events.iter().zip(&self.undecided).filter(|x| *x.1 > 0).map(|(event, count)| {
            format!(
                "whether event \"{}\" happened could not be decided in {count} steps: its function varies faster than the \
                 motion; give a max_step",
                event.name
            )
        })
    }

    /// The zeros of the step that stands, to be reported.
    pub(crate) fn zeros(&self) -> &[Zero] {
        &self.zeros
    }

    /// One of them with its state.
    pub(crate) fn report(&mut self, occurrence: Occurrence) {
        self.count[occurrence.event] += 1;
        self.occurrences.push(occurrence);
    }

    /// The last one.
    pub(crate) fn last(&self) -> Option<&Occurrence> {
        self.occurrences.last()
    }

    /// The event that ends the integration at the end of the last step.
    pub(crate) fn ending(&self) -> Option<&str> {
        let last = self.occurrences.last()?;
        let at = self.occurrences.iter().rev().take_while(|x| x.state.t == last.state.t);
        at.map(|x| x.event)
            .find(|e| self.events[*e].last.is_some_and(|last| self.count[*e] >= last))
            .map(|e| &*self.events[e].name)
    }

    /// How exactly times near t are located.
    fn resolution(&self, t: f64) -> f64 {
        tolerance::SUM_ROUNDING * t.abs() + tolerance::LONG_ROUNDING * self.longest
    }

    /// The shortest step that is taken to an event.
    fn shortest(&self, from: f64) -> f64 {
        tolerance::LONG_ROUNDING * (from.abs() + self.longest)
    }

    /// A reading of event e that is zero as far as it, motions and times are known.
    fn small(&self, e: usize, track: &Track, at: &Sample) -> f64 {
        let rate = at.readings[track.count() + e].rate.abs();
        tolerance::ROUNDING * self.size[e] + self.resolution(at.t) * rate
    }

    /// Its side before and after an instant.
    fn sides(&self, e: usize, track: &Track, at: &Sample) -> (bool, bool) {
        sides(at.readings[track.count() + e], self.small(e, track, at))
    }

    /// Whether a function is as near to zero as where an integration begins at its zero.
    fn is_within(&self, e: usize, track: &Track, at: &Sample) -> bool {
        at.readings[track.count() + e].x.abs() <= tolerance::LONG_ROUNDING * self.size[e]
    }

    /// The side to which a function goes that has not yet left the zero at which the integration began.
    fn rests(&self, e: usize, track: &Track, ends: &[Sample]) -> Option<bool> {
        if self.gone[e] || self.events[e].side.is_some() || !self.is_within(e, track, &ends[0]) {
            return None;
        }
        let moved = (ends[1].t - ends[0].t) * ends[0].readings[track.count() + e].rate;
        match moved.abs() > tolerance::LONG_ROUNDING * self.size[e] {
            true => Some(moved > 0.0),
            false => Some(self.sides(e, track, &ends[1]).0),
        }
    }

    /// Whether a reading is zero.
    fn is_zero(&self, e: usize, track: &Track, at: &Sample) -> bool {
        at.readings[track.count() + e].x.abs() <= self.small(e, track, at)
    }

    /// Whether a function is zero at both ends of an interval, and its rates do not move it from there.
    fn stays_zero(&self, e: usize, track: &Track, ends: &[Sample]) -> bool {
        let h = ends[1].t - ends[0].t;
        let small = tolerance::ROUNDING * self.size[e];
        ends.iter().all(|at| {
            let reading = at.readings[track.count() + e];
            reading.x.abs() <= small && (h * reading.rate).abs() <= small
        })
    }

    /// Whether a function is moved by its rate at the end of an interval, or stays where it is.
    fn moves(&self, e: usize, track: &Track, ends: &[Sample]) -> bool {
        let rate = ends[1].readings[track.count() + e].rate.abs();
        !self.is_zero(e, track, &ends[0]) || rate * (ends[1].t - ends[0].t) > self.small(e, track, &ends[1])
    }

    /// All zeros of the step, if its readings show them.
    fn search(&mut self, track: &Track) -> Search {
        self.zeros.clear();
        self.unclear.fill(false);
        self.gone.copy_from_slice(&self.left);
        let samples = track.samples();
        for (i, ends) in samples.windows(2).enumerate() {
            for e in (0..self.events.len()).filter(|&e| self.count[e] < self.events[e].most) {
                // an instant that the search for a zero has come near to is not where the integration began
                self.gone[e] = self.gone[e] || !self.is_within(e, track, &ends[0]);
                let resting = self.rests(e, track, ends);
                let given = resting.or(self.events[e].side.filter(|_| i == 0));
                let after = given.unwrap_or(self.sides(e, track, &ends[0]).1);
                if self.stays_zero(e, track, ends) {
                    continue;
                }
                let small = [self.small(e, track, &ends[0]), self.small(e, track, &ends[1])];
                let (function, felt) = (track.count() + e, Felt::Nowhere);
                let size = self.size[e];
                let interval = Interval { ends, function, small, recent: 0.0, goes_on: true, felt, given, size };
                match interval.shown(track) {
                    Shown::Clear => {}
                    Shown::Doubtful(t) if !track.is_full() => return Search::Unclear(t),
                    Shown::Doubtful(_) => self.unclear[e] = true,
                    Shown::Crossed(t) => self.zeros.push(Zero { t, event: e, rises: !after }),
                }
                // one at the start of the step belongs to the step before
                let (before, after) = self.sides(e, track, &ends[1]);
                if resting.is_some() && self.is_within(e, track, &ends[1]) {
                    continue;
                }
                if before != after && (self.events[e].side.is_some() || self.moves(e, track, ends)) {
                    self.zeros.push(Zero { t: ends[1].t, event: e, rises: after });
                }
            }
        }
        self.put_in_order();
        Search::Done
    }

    /// In the order of time, and at one instant in that of definition; those that do not count are left out.
    fn put_in_order(&mut self) {
        self.zeros.sort_by(|a, b| a.t.total_cmp(&b.t).then(a.event.cmp(&b.event)));
        for i in 1..self.zeros.len() {
            // those of different functions that are as close as they are located are one instant
            let [before, zero] = [self.zeros[i - 1], self.zeros[i]];
            if zero.event != before.event && zero.t - before.t <= ONE_INSTANT * self.resolution(zero.t) {
                self.zeros[i].t = before.t;
            }
        }
        // what was zero when the integration began, as far as steps end on zeros, is not zero again
        let near = |t: f64, begins: f64| t - begins <= WIDER * self.shortest(begins);
        let again =
            |zero: &Zero| self.events[zero.event].side.is_none() && self.begins.is_some_and(|t| near(zero.t, t));
        let kept: Vec<Zero> = self.zeros.iter().copied().filter(|zero| !again(zero)).collect();
        self.zeros = kept;
        let Self { zeros, events, count, .. } = self;
        zeros.sort_by(|a, b| a.t.total_cmp(&b.t).then(a.event.cmp(&b.event)));
        let (mut seen, mut before) = (count.clone(), vec![None; events.len()]);
        zeros.retain(|zero| {
            let (event, seen) = (&events[zero.event], &mut seen[zero.event]);
            // between two of one direction lies one of the other: it is the same one, located twice
            let other = before[zero.event].replace(zero.rises) != Some(zero.rises);
            let most = event.most.min(event.last.unwrap_or(u64::MAX));
            let counts = other && event.direction.counts(zero.rises) && *seen < most;
            *seen += u64::from(counts);
            counts
        });
    }

    /// The first zero that ends the integration.
    fn first_ending(&self) -> Option<Zero> {
        let mut seen = self.count.clone();
        self.zeros.iter().copied().find(|zero| {
            seen[zero.event] += 1;
            self.events[zero.event].last == Some(seen[zero.event])
        })
    }

    /// A step that cannot be shortened does not show whether something acts.
    fn not_known(&self) -> SystemError {
        let e = self.unclear.iter().position(|unclear| *unclear).unwrap_or(0);
        let name = &self.events[e].name;
        SystemError::argument("step", format!("whether event \"{name}\" happened is not seen; take shorter steps"))
    }

    /// More occurrences than are allowed.
    fn too_many(&self) -> Option<SystemError> {
        if self.occurrences.len() + self.zeros.len() <= self.most {
            return None;
        }
        let (first, last) = (self.zeros.first()?, self.occurrences.last().map(|x| x.state.t));
        let often = self.count.iter().enumerate().max_by_key(|x| *x.1).map_or(first.event, |x| x.0);
        Some(SystemError::argument(
            "events",
            format!(
                "event \"{}\" at t = {} s is one more than the {} events that a run may have (the last one was at t = {} \
                 s, \"{}\" occurred {} times): its function oscillates about zero or returns to it; give it a direction, \
                 an end (terminal=True) or once=True, shorten the run, or raise the limit \"events\"",
                self.events[first.event].name,
                first.t,
                self.most,
                last.unwrap_or(first.t),
                self.events[often].name,
                self.count[often],
            ),
        ))
    }
}

impl Watch for EventWatch {
    fn look(&mut self, step: &mut StepView) -> Result<Look, StepFailure<SystemError>> {
        let (from, to) = step.ends();
        self.longest = self.longest.max(to - from);
        self.begins.get_or_insert(from);
        if let ([from, ..], [.., to]) = (step.track.samples(), step.track.samples()) {
            let first = step.track.count();
            for (size, (a, b)) in self.size.iter_mut().zip(from.readings.iter().zip(&to.readings).skip(first)) {
                *size = size.max(a.terms).max(b.terms);
            }
        }
        loop {
            if let Some((t, error)) = step.track.failed() {
                return Ok(Look::Refuse(t, error));
            }
            match self.search(step.track) {
                Search::Done => break,
                Search::Unclear(t) => step.sample(t, &mut |_, _, _| {})?,
            }
        }
        let acts = |e: usize| self.events[e].side.is_some() || self.events[e].last.is_some();
        if (0..self.events.len()).any(|e| self.unclear[e] && acts(e)) {
            // what acts has to be known
            return Ok(match step.may_end_earlier() && step.stepper.current().may_shrink {
                true => Look::Repeat(None),
                false => Look::Refuse(to, self.not_known()),
            });
        }
        // a step as short as can be to a zero at its start ends there, whatever rounding says
        if let (None, Some(wanted)) = (self.first_ending(), self.wanted) {
            if to <= from + self.shortest(from) {
                self.zeros.push(Zero { t: to, ..wanted });
            }
        }
        if let Some(end) = self.first_ending() {
            // the dense output and the steps that end on it differ by their errors: a step that ends beyond the zero by no
            // more than that is the one, and each trial allows for larger ones
            let allowed = self.resolution(to) * WIDER.powi(self.trials);
            // one at the very start is met by a step as short as can be
            let shortest = from + self.shortest(from);
            if to - end.t > allowed && to > shortest {
                self.trials += 1;
                self.wanted = Some(end);
                return Ok(Look::EndAt { t: end.t.max(shortest), corner: false });
            }
            self.zeros.iter_mut().filter(|zero| zero.t >= end.t).for_each(|zero| zero.t = to);
        }
        Ok(self.too_many().map_or(Look::Clear, |error| Look::Refuse(to, error)))
    }

    fn accept(&mut self, track: &Track) {
        if let Some(end) = track.samples().last() {
            for e in 0..self.events.len() {
                self.left[e] |= !self.is_within(e, track, end);
            }
        }
        self.zeros.clear();
        (self.trials, self.wanted) = (0, None);
        self.undecided.iter_mut().zip(&self.unclear).for_each(|(count, unclear)| *count += u64::from(*unclear));
    }
}
