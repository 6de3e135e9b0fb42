//! What stands against a run, in sentences: conditions that are open, steps beyond the tolerance, numbers that are none.

use super::Request;
use partita_integrate::simulate::Outcome;
use partita_system::error::six_digits;
use partita_system::record::{Gap, Gaps};
use partita_system::reduction::openness::{CLOSED, OPEN, OPEN_RATE};
use partita_system::ConstrainedSystem;

/// Of its own accord a run leaves conditions open by no more than this many tolerances: the error of a step, over the steps of
/// a motion and grown with it.
const DRIFT: f64 = 1e4;
/// What fixed steps may drift by, of whom no tolerance is asked: a hundredth can still be seen as small.
const FIXED: f64 = 1e-2;
/// Rates off by more than this part of the fastest are no round-off: 1e-16 times the worst condition that is worked with.
const RATES_HOLD: f64 = 1e-7;
/// Steps beyond the tolerance that one singular position explains: a crossing step and those that lead up to it.
const LENIENT_EACH: u64 = 20;

/// One thing that stands against a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// Does it break the run, or is it merely doubtful?
    pub broken: bool,
    /// When (s).
    pub t: f64,
    /// What and how much, in a sentence.
    pub sentence: String,
}

/// How far conditions may be open before a run is doubtful, and before it is broken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Positions, in parts.
    pub position: (f64, f64),
    /// Rates, in parts of the fastest.
    pub velocity: (f64, f64),
}

impl Limits {
    /// For a run as asked for: conditions that are not closed on purpose drift by what the tolerance explains.
    pub fn of(request: &Request) -> Self {
        let drifts = request.correction == "none" || request.formulation == "baumgarte";
        let explained = match (drifts, request.step) {
            (false, _) => 0.0,
            (true, None) => (DRIFT * request.rtol).clamp(OPEN, OPEN_RATE),
            (true, Some(_)) => FIXED, // nobody was asked how exact the steps are
        };
        let (position, velocity) = (CLOSED.max(explained), RATES_HOLD.max(explained));
        Self {
            position: (position, (10.0 * explained).max(OPEN)),
            velocity: (velocity, (10.0 * explained).max(OPEN_RATE)),
        }
    }

    /// What these gaps say of `what` (steps, outputs).
    pub fn judge<S: ConstrainedSystem>(&self, system: &S, gaps: &Gaps, what: &str, found: &mut Vec<Finding>) {
        let mut look = |gap: Gap, (doubtful, broken): (f64, f64), kind: &str, of: &str| {
            if gap.part > doubtful || gap.part.is_nan() {
                let row = system.row_words(gap.row);
                found.push(Finding {
                    broken: gap.part > broken || gap.part.is_nan(),
                    t: gap.t,
                    sentence: format!(
                        "{kind} of {row} is off by {:.1e} of {of} at {what} t = {} s; up to {doubtful:.0e} holds",
                        gap.part,
                        six_digits(gap.t)
                    ),
                });
            }
        };
        look(gaps.position, self.position, "the closing", "its size");
        look(gaps.velocity, self.velocity, "the rate", "the fastest");
    }
}

/// Steps that were accepted beyond the tolerance: told where a singular position does not explain them.
pub fn of_steps(outcome: &Outcome, found: &mut Vec<Finding>) {
    let (lenient, passages) = (outcome.counters.lenient, outcome.passages.len() as u64);
    let explained = LENIENT_EACH * passages.max(1);
    if lenient > explained {
        found.push(Finding {
            broken: false,
            t: outcome.t,
            sentence: format!(
                "{lenient} of {} steps were accepted with an error beyond the tolerance, {passages} singular positions \
                 explain {explained}",
                outcome.counters.steps
            ),
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::examples::{four_bar, model};
    use partita_integrate::counters::Counters;
    use partita_integrate::simulate::Status;
    use partita_model::spec::JointKind::Revolute;

    fn asked(correction: &str, rtol: f64) -> Request {
        let text = format!(
            "{{\"t_end\": 1.0, \"rtol\": {rtol:e}, \"atol\": 1e-10, \"method\": \"dop853\", \"formulation\": \"projective\", \
             \"correction\": \"{correction}\", \"exchange\": 1.25, \"max_steps\": 100, \"selection\": \"collective\", \
             \"renew\": 0.5}}"
        );
        serde_json::from_str(&text).unwrap()
    }

    fn word(request: &Request, position: f64, velocity: f64) -> &'static str {
        let m = model(four_bar([Revolute; 4]));
        let gap = |part: f64| Gap { part, t: 0.5, row: 1 };
        let mut found = Vec::new();
        let gaps = Gaps { position: gap(position), velocity: gap(velocity), ..Gaps::default() };
        Limits::of(request).judge(&m, &gaps, "the output", &mut found);
        match (found.iter().any(|f| f.broken), found.is_empty()) {
            (true, _) => "broken",
            (false, true) => "holds",
            (false, false) => "doubtful",
        }
    }

    #[test]
    fn closed_conditions_from_both_sides() {
        let r = asked("partition", 1e-4); // what is closed does not depend on the tolerance
        assert_eq!(word(&r, 0.9e-9, 0.9e-7), "holds");
        assert_eq!(word(&r, 1.1e-9, 0.0), "doubtful");
        assert_eq!(word(&r, 0.0, 1.1e-7), "doubtful");
        assert_eq!(word(&r, 0.9e-6, 0.9e-3), "doubtful");
        assert_eq!(word(&r, 1.1e-6, 0.0), "broken");
        assert_eq!(word(&r, 0.0, 1.1e-3), "broken");
        assert_eq!(word(&r, f64::INFINITY, 0.0), "broken");
        assert_eq!(word(&r, f64::NAN, 0.0), "broken");
    }

    /// Twenty steps beyond the tolerance are one crossing, sixty-one are more than three.
    #[test]
    fn steps_beyond_the_tolerance_from_both_sides() {
        let found = |lenient: u64, passages: usize| {
            let counters = Counters { steps: 100, lenient, ..Counters::default() };
            let (message, passages) = (String::new(), vec![0.5; passages]);
            let outcome = Outcome { status: Status::Finished, message, t: 1.0, counters, passages, error: None };
            let mut found = Vec::new();
            of_steps(&outcome, &mut found);
            found
        };
        for (lenient, passages, doubtful) in [(0, 0, 0), (20, 0, 0), (21, 0, 1), (21, 1, 1), (60, 3, 0), (61, 3, 1)] {
            let found = found(lenient, passages);
            assert_eq!(found.len(), doubtful, "{lenient} {passages}");
            assert!(found.iter().all(|f| !f.broken && f.t == 1.0 && f.sentence.starts_with(&lenient.to_string())));
        }
    }

    #[test]
    fn drift_that_was_asked_for_from_both_sides() {
        let r = asked("none", 1e-8);
        assert_eq!(word(&r, 0.9e-4, 0.9e-4), "holds");
        assert_eq!(word(&r, 1.1e-4, 0.0), "doubtful");
        assert_eq!(word(&r, 1.1e-3, 0.0), "broken");
    }
}
