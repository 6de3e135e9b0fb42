//! Findings of a run, in sentences: open constraints, velocity jumps, steps beyond the tolerance, energy
//! and forces out of balance. It is decided once, when the run ends.

use super::balance::{self, Balance, BalanceOptions, Energy};
use super::{Request, SolutionLog};
use partita_integrate::simulate::{Outcome, Status};
use partita_math::tolerance;
use partita_system::error::six_digits;
use partita_system::formulation::Formulation;
use partita_system::record::{Gap, Gaps, Output, Sample, StepChecks};

use partita_system::{ConstrainedSystem, SystemError};

/// Steps beyond the tolerance that one singular position explains: a crossing step and those that lead up to it.
const LENIENT_EACH: u64 = 20;

/// Velocity jumps that make a run suspect, and invalid. Scale: fraction of the speed. Reason: a violation of (S4)
/// changes velocities by less than a tolerance, next to a singular position divided by the distance; beyond the second
/// the motion has changed to another branch or lost a hundredth of its energy.
const JUMPS: (f64, f64) = (1e-3, 1e-1);
/// Changes of velocity beyond this are explained by no tolerance. Scale: fraction of the speed. Reason: loose tolerances
/// explain larger changes than tight ones, up to a fiftieth.
const JUMPS_EXPLAINED: f64 = 2e-2;

/// A motion longer than this along which the mechanism is singular up to the errors of its drawing is another one than was
/// drawn. Unit: characteristic displacement. Reason: singular positions are points that a motion passes at once.
const HELD_BY_ERRORS: f64 = 5e-3;

/// One finding of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// Whether it makes the run invalid, or merely suspect.
    pub invalid: bool,
    /// When (s).
    pub t: f64,
    /// The finding with its size, in a sentence.
    pub sentence: String,
}

/// Constraint violations beyond which a run is suspect, and invalid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Positions, relative to their sizes.
    pub position: (f64, f64),
    /// Rates, relative to the fastest.
    pub velocity: (f64, f64),
    /// Accelerations, relative to the strongest; none where constraints are stabilised by accelerations.
    pub acceleration: Option<(f64, f64)>,
    /// Velocity jumps, relative to the speed.
    pub jump: (f64, f64),
    /// What balances depend on.
    pub asked: BalanceOptions,
    /// Absolute tolerance.
    pub atol: f64,
    /// Energy that was exchanged before.
    pub exchanged: f64,
}

impl Limits {
    /// Limits for a run with these options: constraints that are deliberately not corrected drift by what the tolerance
    /// explains.
    pub fn of(request: &Request) -> Self {
        let drifts = request.correction == "none" || request.formulation == "baumgarte";
        let explained = match (drifts, request.step) {
            (false, _) => 0.0,
            (true, None) => (tolerance::DRIFT * request.rtol).clamp(tolerance::OPEN, tolerance::OPEN_RATE),
            (true, Some(_)) => tolerance::FAR_OPEN, // nobody was asked how exact the steps are
        };
        let (position, velocity) = (tolerance::CLOSED_IN_RUN.max(explained), tolerance::WORST_ROUNDING.max(explained));
        let rtol = if request.step.is_some() { 1.0 } else { request.rtol };
        Self {
            position: (position, (tolerance::CLEARLY * explained).max(tolerance::OPEN)),
            velocity: (velocity, (tolerance::CLEARLY * explained).max(tolerance::OPEN_RATE)),
            acceleration: (request.formulation != "baumgarte")
                .then_some((tolerance::OPEN_ACCELERATION, tolerance::CLEARLY * tolerance::OPEN_ACCELERATION)),
            jump: (JUMPS.0.max((tolerance::ERROR_GROWTH * rtol).min(JUMPS_EXPLAINED)), JUMPS.1),
            asked: BalanceOptions { tolerance: rtol, drifts },
            atol: request.atol,
            exchanged: request.exchanged_before.unwrap_or_default(),
        }
    }

    /// Findings from the steps of a run; with `outputs`, from the outputs too.
    pub fn judge_checks<S: ConstrainedSystem>(&self, system: &S, checks: &StepChecks, found: &mut Vec<Finding>) {
        self.judge(system, &checks.outputs, "the output", found);
        let mut look = |gap: Gap, (suspect, invalid): (f64, f64), sentence: &dyn Fn(f64) -> String| {
            if gap.part > suspect || gap.part.is_nan() {
                let invalid = gap.part > invalid || gap.part.is_nan();
                found.push(Finding { invalid, t: gap.t, sentence: sentence(six_digits(gap.t)) });
            }
        };
        if let Some(limits) = self.acceleration {
            let gap = checks.acceleration;
            look(gap, limits, &|t| {
                let row = &system.structure().rows[gap.row].description;
                let (part, limit) = (gap.part, limits.0);
                format!(
                    "the acceleration of {row} is off by {part:.1e} of the largest one at t = {t} s; at most \
                    {limit:.0e} is expected"
                )
            });
        }
        look(checks.jump, self.jump, &|t| {
            format!(
                "velocities jump by {:.1e} of the speed (mass metric) in the step to t = {t} s, where at most \
                 {:.0e} is expected: the motion has changed to another branch at a singular position, or lost energy \
                 there; use a smaller rtol or the formulation \"projective\"",
                checks.jump.part, self.jump.0
            )
        });
        // where a mechanism rests, what the tolerance leaves is many times as fast
        let noticed = checks.surge_rate > tolerance::CLEARLY * tolerance::ERROR_GROWTH * self.atol;
        let surge = if noticed { checks.surge } else { Gap::default() };
        look(surge, (tolerance::CLEARLY, tolerance::CLEARLY), &|t| {
            format!(
                "the velocity at the output t = {t} s is {:.1e} times as fast as the ends of steps explain: \
                 something acts between two steps and was missed; give a max_step",
                checks.surge.part
            )
        });
        look(checks.hidden, (0.0, 0.0), &|t| {
            let name = system.watched().guards.get(checks.hidden.row).map_or_else(String::new, |x| x.name.clone());
            format!(
                "{name} is crossed in both directions at t = {t} s within one step, which did not detect it; take \
                 shorter steps, or let the step size adapt (no `step`)"
            )
        });
        look(checks.branch, (tolerance::BRANCH_BY_ERROR, tolerance::BRANCH_BY_ERROR), &|t| {
            format!(
                "the motion crosses a singular position at t = {t} s with a closure error of {:.1e} of the squared \
                 distance from it, so that this error decides the branch; use a formulation that closes the loops \
                 (\"projective\")",
                checks.branch.part
            )
        });
        look(checks.by_errors, (HELD_BY_ERRORS, HELD_BY_ERRORS), &|t| {
            format!(
                "up to t = {t} s the motion follows a branch on which the loops hold the mechanism by errors of its \
                 drawing alone (dimensions off by {:.1e} were changed to fit, within the drawing tolerance): an exact \
                 drawing has more degrees of freedom there; give the dimensions more exactly",
                system.structure().drawing.errors.0
            )
        });
        Self::judge_branch(system, checks.nearest, found);
    }

    /// Where errors of the dimensions decide between branches.
    fn judge_branch<S: ConstrainedSystem>(system: &S, nearest: Gap, found: &mut Vec<Finding>) {
        let removed = system.structure().drawing.errors.0;
        if removed * nearest.part > tolerance::BRANCH_BY_ERROR {
            let (t, distance) = (six_digits(nearest.t), nearest.part.recip().sqrt());
            let sentence = format!(
                "the motion comes as near as {distance:.1e} (rad, fractions of lengths) to a singular position at t = {t} \
                 s, and dimensions off by {removed:.1e} were changed to fit, within the drawing tolerance: branches \
                 that meet there in an exact drawing pass each other, and which one the motion follows depends on \
                 these errors; give the dimensions more exactly"
            );
            found.push(Finding { invalid: false, t: nearest.t, sentence });
        }
    }

    /// Findings from these gaps at `what` (steps, outputs).
    pub fn judge<S: ConstrainedSystem>(&self, system: &S, gaps: &Gaps, what: &str, found: &mut Vec<Finding>) {
        let mut look = |gap: Gap, (suspect, invalid): (f64, f64), kind: &str, of: &str| {
            if gap.part > suspect || gap.part.is_nan() {
                let row = &system.structure().rows[gap.row].description;
                found.push(Finding {
                    invalid: gap.part > invalid || gap.part.is_nan(),
                    t: gap.t,
                    sentence: format!(
                        "{kind} of {row} is off by {:.1e} of {of} at {what} t = {} s; at most {suspect:.0e} is \
                         expected",
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

/// Outputs that are not finite.
fn of_numbers(outputs: &[Output], found: &mut Vec<Finding>) {
    let spoilt = outputs.iter().find(|x| !x.q.iter().chain(&x.v).all(|x| x.is_finite()));
    if let Some(Output { t, .. }) = spoilt {
        let sentence = format!("the motion is not finite from t = {} s on", six_digits(*t));
        found.push(Finding { invalid: true, t: *t, sentence });
    }
}

/// That errors of the dimensions smaller than may be there would decide between branches, or will where the run goes on.
pub(super) fn note_of_nearness<S: ConstrainedSystem>(system: &S, checks: &StepChecks) -> Option<String> {
    let ((removed, possible), nearest) = (system.structure().drawing.errors, checks.nearest.worse(checks.near_end));
    let decides = |near: Gap| removed * near.part > tolerance::BRANCH_BY_ERROR;
    let counts = possible * nearest.part > 1.0 || decides(nearest);
    (counts && !decides(checks.nearest)).then(|| {
        format!(
            "the motion comes as near as {:.1e} (rad, fractions of lengths) to a singular position at t = {} s: \
             dimensions that differ by {:.0e} would let branches meet there, and other errors of them would lead to \
             another one",
            nearest.part.recip().sqrt(),
            six_digits(nearest.t),
            nearest.part.recip()
        )
    })
}

/// Judge a run that has ended: add findings to those `found` already, and decide its success. An invalidating finding
/// changes the outcome; later checks do not. The energy is accounted for from `start` on, where it is known, for the
/// outputs need not begin there.
pub(super) fn conclude<S: Balance>(
    system: &S,
    formulation: &mut dyn Formulation,
    (log, start): (&SolutionLog, Option<&Output>),
    outcome: &mut Outcome,
    found: &mut Vec<Finding>,
) {
    of_steps(outcome, found);
    of_numbers(&log.outputs, found);
    if !matches!(outcome.status, Status::Finished | Status::Event) {
        return;
    }
    if let Err((t, error)) = agree(system, &log.outputs) {
        outcome.status = Status::EvaluationFailed;
        outcome.message = format!("the result is wrong: {error}");
        (outcome.t, outcome.error) = (t, Some(error));
        return;
    }
    let mut scratch = system.scratch();
    found.extend(of_ends(system, formulation, log, &mut scratch));
    let exchanged = formulation.point().checks().1.exchanged();
    found.extend(of_energies(system, (log, start), outcome.counters.steps, exchanged, &mut scratch));
    if let Some(invalid) = found.iter().find(|x| x.invalid) {
        outcome.status = Status::Invalid;
        outcome.message = format!("{}, but the result is invalid: {}", outcome.message, invalid.sentence);
    }
}

/// The functions of the user in the middle and at the end of the computed interval. A function that fails there has
/// been reported already.
fn agree<S: Balance>(system: &S, outputs: &[Output]) -> Result<(), (f64, SystemError)> {
    for x in outputs.get(outputs.len() / 2).into_iter().chain(outputs.last()) {
        if let Err(e @ SystemError::Derivative { .. }) = system.agree(x.t, &x.q, &x.v) {
            return Err((x.t, e));
        }
    }
    Ok(())
}

/// Check the first and the last output that have accelerations: these and the multipliers must be finite, and all
/// bodies in balance.
fn of_ends<S: Balance>(
    system: &S,
    formulation: &mut dyn Formulation,
    log: &SolutionLog,
    scratch: &mut S::Scratch,
) -> Option<Finding> {
    let (limits, outputs) = (&log.limits, &log.outputs);
    let ends = [outputs.first(), outputs.last().filter(|_| outputs.len() > 1)];
    let mut residuals = Vec::with_capacity(2);
    let mut sample = Sample { brief: true, ..Sample::default() };
    for x in ends.into_iter().flatten().filter(|x| !x.singular) {
        let reported = formulation.describe(x, log.events.get(x.choice), &mut sample);
        let finite = sample.vdot.iter().chain(&sample.multipliers).all(|x| x.is_finite());
        match reported {
            Ok(()) if finite => {}
            Ok(()) if sample.note.is_some() => continue, // next to a singular position nothing is determined
            Ok(()) => {
                let t = six_digits(x.t);
                let sentence = format!("accelerations and efforts are not finite at the output t = {t} s");
                return Some(Finding { invalid: true, t: x.t, sentence });
            }
            Err(_) => continue, // a failure there is reported by the output that needs it
        }
        sample.q.iter_mut().zip(&x.turns).for_each(|(q, n)| *q = partita_system::positions::turns::whole(*q, *n));
        if let Ok(Some(residual)) = system.residual(&sample, scratch) {
            residuals.push((x.t, residual));
        }
    }
    balance::of_reactions(residuals.into_iter(), limits.asked)
}

/// The energy over the start and some outputs.
fn of_energies<S: Balance>(
    system: &S,
    (log, start): (&SolutionLog, Option<&Output>),
    steps: u64,
    exchanged: f64,
    scratch: &mut S::Scratch,
) -> Option<Finding> {
    let mut some = balance::some(&log.outputs);
    if let Some(start) = start.filter(|start| some.first().is_some_and(|first| first.t > start.t)) {
        some.insert(0, start);
    }
    if some.len() < 2 {
        return None; // a balance is between two
    }
    let energies = system.energies(&some, scratch).ok().flatten()?;
    let at =
        some.iter().zip(energies).map(|(x, (kinetic, potential))| Energy { t: x.t, kinetic, potential, work: x.work });
    let at: Vec<Energy> = at.collect();
    let least = exchanged.max(log.limits.exchanged).max(system.energy_floor(log.limits.atol));
    balance::of_energy(&at, log.limits.asked, steps, least)
}

/// Steps accepted beyond the tolerance: reported where no singular position explains them.
pub fn of_steps(outcome: &Outcome, found: &mut Vec<Finding>) {
    let (lenient, crossings) = (outcome.counters.lenient, outcome.crossings.count());
    let explained = LENIENT_EACH * crossings.max(1);
    if lenient > explained {
        found.push(Finding {
            invalid: false,
            t: outcome.t,
            sentence: format!(
                "{lenient} of {} steps were accepted with an error beyond the tolerance; {crossings} singular \
                 positions explain {explained} of them",
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
    use partita_system::record::Crossings;

    fn asked(correction: &str, rtol: f64) -> Request {
        let text = format!(
            "{{\"t_end\": 1.0, \"rtol\": {rtol:e}, \"atol\": 1e-10, \"method\": \"dop853\", \"formulation\": \"projective\", \
             \"correction\": \"{correction}\", \"switch_threshold\": 1.25, \"max_steps\": 100, \"selection\": \"collective\", \
             \"renew\": 0.5}}"
        );
        serde_json::from_str(&text).unwrap()
    }

    fn word(request: &Request, position: f64, velocity: f64) -> &'static str {
        let m = model(four_bar([Revolute; 4]));
        let gap = |part: f64| Gap { part, t: 0.5, row: 1 };
        let mut found = Vec::new();
        let gaps = Gaps { position: gap(position), velocity: gap(velocity) };
        Limits::of(request).judge(&m, &gaps, "the output", &mut found);
        match (found.iter().any(|f| f.invalid), found.is_empty()) {
            (true, _) => "invalid",
            (false, true) => "valid",
            (false, false) => "suspect",
        }
    }

    #[test]
    fn closed_conditions_from_both_sides() {
        let r = asked("partition", 1e-4); // what is closed does not depend on the tolerance
        assert_eq!(word(&r, 0.9e-9, 0.9e-7), "valid");
        assert_eq!(word(&r, 1.1e-9, 0.0), "suspect");
        assert_eq!(word(&r, 0.0, 1.1e-7), "suspect");
        assert_eq!(word(&r, 0.9e-6, 0.9e-3), "suspect");
        assert_eq!(word(&r, 1.1e-6, 0.0), "invalid");
        assert_eq!(word(&r, 0.0, 1.1e-3), "invalid");
        assert_eq!(word(&r, f64::INFINITY, 0.0), "invalid");
        assert_eq!(word(&r, f64::NAN, 0.0), "invalid");
    }

    /// Twenty steps beyond the tolerance are one crossing, sixty-one are more than three.
    #[test]
    fn steps_beyond_the_tolerance_from_both_sides() {
        let found = |lenient: u64, crossings: usize| {
            let counters = Counters { steps: 100, lenient, ..Counters::default() };
            let times = vec![0.5; crossings];
            let (message, crossings) = (String::new(), Crossings { times, ..Crossings::default() });
            let outcome = Outcome {
                status: Status::Finished,
                message,
                t: 1.0,
                counters,
                crossings,
                notes: Vec::new(),
                error: None,
            };
            let mut found = Vec::new();
            of_steps(&outcome, &mut found);
            found
        };
        for (lenient, crossings, suspect) in [(0, 0, 0), (20, 0, 0), (21, 0, 1), (21, 1, 1), (60, 3, 0), (61, 3, 1)] {
            let found = found(lenient, crossings);
            assert_eq!(found.len(), suspect, "{lenient} {crossings}");
            assert!(found.iter().all(|f| !f.invalid && f.t == 1.0 && f.sentence.starts_with(&lenient.to_string())));
        }
    }

    /// Jumps, accelerations and branches that errors decide on, each from both sides of its limits.
    #[test]
    fn steps_from_both_sides() {
        let m = model(four_bar([Revolute; 4]));
        let gap = |part: f64| Gap { part, t: 0.5, row: 1 };
        let words = |request: &Request, checks: StepChecks| {
            let mut found = Vec::new();
            Limits::of(request).judge_checks(&m, &checks, &mut found);
            (found.len(), found.iter().any(|f| f.invalid))
        };
        let none = StepChecks::default();
        let (tight, loose) = (asked("partition", 1e-8), asked("partition", 1e-3));
        for (request, part, seen) in [
            (&tight, 0.9e-3, (0, false)),
            (&tight, 1.1e-3, (1, false)),
            (&loose, 1.9e-2, (0, false)),
            (&loose, 2.1e-2, (1, false)),
            (&tight, 0.9e-1, (1, false)),
            (&loose, 1.1e-1, (1, true)),
            (&tight, f64::NAN, (1, true)),
        ] {
            assert_eq!(words(request, StepChecks { jump: gap(part), ..none }), seen, "{part}");
        }
        for (part, seen) in [(0.9e-2, (0, false)), (1.1e-2, (1, false)), (1.1e-1, (1, true))] {
            assert_eq!(words(&tight, StepChecks { acceleration: gap(part), ..none }), seen, "{part}");
        }
        for (part, seen) in [(0.09, (0, false)), (0.11, (1, true))] {
            assert_eq!(words(&tight, StepChecks { branch: gap(part), ..none }), seen, "{part}");
        }
        for (part, seen) in [(9.0, (0, false)), (11.0, (1, true))] {
            assert_eq!(words(&tight, StepChecks { surge: gap(part), surge_rate: part, ..none }), seen, "{part}");
        }
        // at rest, what the tolerance leaves
        let rests = tolerance::CLEARLY * tolerance::ERROR_GROWTH * tight.atol;
        for (rate, seen) in [(0.9 * rests, (0, false)), (1.1 * rests, (1, true))] {
            assert_eq!(words(&tight, StepChecks { surge: gap(1e3), surge_rate: rate, ..none }), seen, "{rate}");
        }
        let outputs = Gaps { velocity: gap(1.1e-3), ..Gaps::default() };
        assert_eq!(words(&tight, StepChecks { outputs, ..none }), (1, true));
    }

    #[test]
    fn drift_that_was_asked_for_from_both_sides() {
        let r = asked("none", 1e-8);
        assert_eq!(word(&r, 0.9e-4, 0.9e-4), "valid");
        assert_eq!(word(&r, 1.1e-4, 0.0), "suspect");
        assert_eq!(word(&r, 1.1e-3, 0.0), "invalid");
    }
}
