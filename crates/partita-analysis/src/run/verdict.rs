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
        let explained = if drifts { (DRIFT * request.rtol).clamp(OPEN, OPEN_RATE) } else { 0.0 };
        let (position, velocity) = (CLOSED.max(explained), RATES_HOLD.max(explained));
        Self {
            position: (position, (1e3 * explained).max(OPEN)),
            velocity: (velocity, (1e3 * explained).max(OPEN_RATE)),
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
