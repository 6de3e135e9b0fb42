//! Redundant rows that were dropped: do they follow from the rows kept, in values as in directions?
//!
//! A dropped row depends on the others in its direction alone. Whether it agrees with them is checked before the first
//! step, in its value, its rates and over a short motion, and after every step. Where it does not, the conditions
//! contradict each other: no motion satisfies all of them.                                              (C2)

use crate::manifold::kept_rows::close_kept;
use crate::record::{Gap, Gaps};
use partita_math::tolerance;

use crate::reduction::Reduction;
use crate::start::{choose_partition, Start};
use crate::system::{ConstrainedSystem, SystemError};

/// Length of the motion at the start. Unit: time of a large displacement. Reason: long enough for second orders to
/// exceed rounding.
const SHORT_MOTION: f64 = 1e-3;

/// Whether the dropped rows agree with the kept ones at the start, and for a short time after it.
///
/// `longest` bounds that time.
///
/// # Errors
/// `Contradiction`, with the rows that contradict each other. Where the evaluation fails nothing is reported, because
/// the run reports the failure.
pub fn check<S: ConstrainedSystem>(
    system: &S,
    start: &Start,
    (t, q, v): (f64, &[f64], &[f64]),
    longest: f64,
) -> Result<(), SystemError> {
    if start.dropped.is_empty() {
        return Ok(());
    }
    let mut r = Reduction::new(system, start.rank);
    let mut here = q.to_vec();
    if choose_partition(&mut r, t, q, None, None).is_err() || close(&mut r, t, &mut here).is_err() {
        return Ok(());
    }
    let (part, row) = r.dropped_gap();
    if part > tolerance::OPEN {
        return Err(r.contradiction(t, row, part, ""));
    }
    let speeds: Vec<f64> = r.planned.partition.independent.iter().map(|&i| v[i]).collect();
    if r.evaluate(t, &here, &speeds).is_err() {
        return Ok(());
    }
    let (rate, row) = r.dropped_velocity_gap();
    let fastest = r.fastest();
    if rate > tolerance::OPEN_RATE * fastest {
        return Err(r.contradiction(t, row, rate, "/s"));
    }
    let mut vdot = vec![0.0; v.len()];
    r.full_acceleration(&mut vdot);
    let (bend, row) = r.dropped_acceleration_gap(&vdot);
    let strongest = r.strongest(&vdot).max(fastest * fastest);
    if bend > tolerance::OPEN_ACCELERATION * strongest {
        return Err(r.contradiction(t, row, bend, "/s^2"));
    }
    if strongest == 0.0 {
        return Ok(()); // at rest, and nothing that would end it
    }
    let h = (SHORT_MOTION / strongest.sqrt()).min(longest);
    let moved: Vec<f64> = r.at.v.iter().zip(&vdot).map(|(v, a)| h * (v + 0.5 * h * a)).collect();
    system.step(&mut here, &moved);
    if close(&mut r, t + h, &mut here).is_err() || r.gap_of_kept() > tolerance::CLOSED_IN_RUN {
        return Ok(());
    }
    let (part, row) = r.dropped_gap();
    match part > tolerance::CLOSED_IN_RUN {
        true => Err(r.contradiction(t + h, row, part, "")),
        false => Ok(()),
    }
}

/// Close the kept rows to round-off near q; leaves the factors there.
fn close<S: ConstrainedSystem>(r: &mut Reduction<S>, t: f64, q: &mut [f64]) -> Result<(), SystemError> {
    close_kept(r, t, q)?;
    r.factor(t)
}

/// At the point last evaluated, rates relative to sizes alone [1/s].
pub(crate) fn gaps<S: ConstrainedSystem>(t: f64, r: &Reduction<S>) -> Gaps {
    let gap = |(part, row): (f64, usize)| Gap { part, t, row };
    Gaps { position: gap(r.gap()), velocity: gap(r.velocity_gap()) }
}

/// Residuals at the end of the step that is judged, and at the ends of accepted ones.
#[derive(Clone, Copy, Debug, Default)]
pub struct Closure {
    /// |Φ| and |C v + a|.
    trial: (f64, f64),
    trial_gaps: Gaps,
    trial_fastest: f64,
    /// The largest of those taken.
    pub closure_error: (f64, f64),
    /// As `closure_error`, in parts, with times and rows.
    pub gaps: Gaps,
    /// The fastest rate so far [1/s].
    fastest: f64,
}

impl Closure {
    /// The fastest rate up to the end of the step that was examined last [1/s].
    pub fn fastest_yet(&self) -> f64 {
        self.trial_fastest
    }

    /// Examine the end of a step, the point last evaluated.
    pub fn look<S: ConstrainedSystem>(&mut self, t: f64, r: &Reduction<S>) {
        let (rate, of_rates) = r.velocity_violations();
        self.trial = (r.closure(), rate);
        let fastest = self.fastest.max(r.fastest());
        self.trial_fastest = fastest;
        let gap = |(part, row): (f64, usize)| Gap { part, t, row };
        self.trial_gaps = Gaps { position: gap(r.gap()), velocity: gap(of_rates) };
        self.trial_gaps.in_parts_of(fastest);
    }

    /// The step that was examined is accepted.
    pub fn accept(&mut self) {
        self.fastest = self.trial_fastest;
        self.closure_error = (self.closure_error.0.max(self.trial.0), self.closure_error.1.max(self.trial.1));
        self.gaps.raise(&self.trial_gaps);
    }

    /// Whether the dropped rows contradict the others at the end of the step that was examined, (t, q, v).
    ///
    /// # Errors
    /// `Contradiction`, with the rows that contradict each other.
    pub fn check<S: ConstrainedSystem>(&self, t: f64, q: &[f64], r: &Reduction<S>) -> Result<(), SystemError> {
        if r.dropped().is_empty() {
            return Ok(());
        }
        let (kept, size) = (r.gap_of_kept(), r.size());
        let (part, (rate, _)) = (r.dropped_gap().0, r.dropped_velocity_gap());
        let fastest = self.trial_fastest;
        let violated = part > tolerance::OPEN && part > tolerance::CLEARLY * kept;
        let limit = if size.rows == size.holonomic { tolerance::OPEN_RATE } else { tolerance::OPEN };
        if !violated && rate <= limit * fastest {
            return Ok(());
        }
        // with the kept rows closed to round-off, in a choice of its own
        let mut probe = Reduction::new(r.system.clone(), r.rank());
        let mut here = q.to_vec();
        if choose_partition(&mut probe, t, q, None, None).is_err() || close(&mut probe, t, &mut here).is_err() {
            return Ok(()); // next to a singular position: nothing can be said
        }
        let (part, row) = probe.dropped_gap();
        if part > tolerance::OPEN {
            return Err(probe.contradiction(t, row, part, ""));
        }
        let speeds: Vec<f64> = probe.planned.partition.independent.iter().map(|&i| r.at.v[i]).collect();
        if probe.tangent(t).is_err() {
            return Ok(());
        }
        probe.spread(&speeds);
        let (rate, row) = probe.dropped_velocity_gap();
        match rate > limit * fastest {
            true => Err(probe.contradiction(t, row, rate, "/s")),
            false => Ok(()),
        }
    }
}
