//! A run that starts in a singular position: its first step, along the branch that the velocities determine.

use partita_integrate::simulate::{Outcome, Status};
use partita_integrate::singular_start::{singular_step, SingularStep};
use partita_system::branching::branch_directions;
use partita_system::record::Output;
use partita_system::{ConstrainedSystem, SystemError, SystemRef};

/// The step out of the singular position, with its note.
pub(super) struct BranchStart<'s, S: ConstrainedSystem> {
    pub step: SingularStep<'s, S>,
    /// Its note.
    pub note: String,
}

/// The first step from (t, q, v) that was refused as `singular`, up to `end` at the latest.
///
/// # Errors
/// `singular`, where the velocities single out no branch, with the reason; where no step was found.
pub(super) fn start_singular<'s, S: ConstrainedSystem>(
    system: SystemRef<'s, S>,
    (t, q, v): (f64, &[f64], &[f64]),
    (end, tolerance): (f64, f64),
    singular: SystemError,
) -> Result<BranchStart<'s, S>, SystemError> {
    let branch_directions = branch_directions::along(&*system, (t, q, v), singular)?;
    let step = singular_step(
        system.clone(),
        branch_directions.rank,
        (t, q, v),
        branch_directions.acceleration(q, v)?.as_deref(),
        (end, tolerance),
    )?;
    let mut note = format!(
        "the run starts in a singular position and leaves it along the branch with the rates {}; its first {} s are \
         one step of Gauss collocation on that branch; at the start itself accelerations and reactions are not \
         determined",
        branch_directions.described(v),
        partita_math::formatted(step.length())
    );
    if step.moved > 0.0 {
        note = format!(
            "{note}; the start lay beside the singular position and was moved onto the branch by {:.1e} (radians, \
             fractions of lengths)",
            step.moved
        );
    }
    if step.lenient {
        note = format!(
            "{note}; next to the position rounding limits the accuracy to {:.0e} of the motion, where the tolerance \
             is {tolerance:.0e}",
            step.error
        );
    }
    Ok(BranchStart { step, note })
}

impl<S: ConstrainedSystem> BranchStart<'_, S> {
    /// The outputs before the end of the step; how many.
    pub fn outputs(&mut self, times: &[f64], out: &mut Vec<Output>) -> Result<usize, SystemError> {
        let count = times.partition_point(|t| *t < self.step.t);
        for &t in &times[..count] {
            let mut output = Output::default();
            self.step.output(t, &mut output)?;
            out.push(output);
        }
        Ok(count)
    }

    /// Work done for it.
    pub fn report(&self, outcome: &mut Outcome, notes: &mut Vec<String>) {
        notes.push(self.note.clone());
        outcome.counters.steps += 1;
        outcome.counters.lenient += u64::from(self.step.lenient);
        outcome.counters.evaluations += self.step.evaluations;
        if outcome.status == Status::Finished {
            outcome.message = format!("reached t = {}", outcome.t);
        }
    }
}
