//! A concluded step, as watches see it.

use super::Track;
use crate::adapter::Adapter;
use crate::failure::StepFailure;
use crate::stepper::Stepper;
use partita_math::tolerance;
use partita_system::formulation::{Course, Depth, Formulation, TrialEnd};
use partita_system::watched::Reading;
use partita_system::SystemError;

/// When C_D was singular in the step under way.
#[derive(Clone, Debug, Default)]
pub(crate) struct Located {
    /// In the order of time.
    pub(crate) times: Vec<f64>,
    search: Search,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Search {
    #[default]
    None,
    Done,
}

impl Located {
    /// A new step: it was not searched yet.
    pub(crate) fn forget(&mut self) {
        self.times.clear();
        self.search = Search::None;
    }

    /// Whether the search could be made.
    pub(crate) fn note(&mut self, found: Option<f64>) {
        self.search = if found.is_some() { Search::Done } else { Search::None };
    }

    /// The times, where the step was searched for them.
    pub(crate) fn known(&self) -> Option<&[f64]> {
        (self.search == Search::Done).then_some(&self.times[..])
    }
}

/// Who chooses the lengths of steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Lengths {
    /// The control of the error.
    Controlled,
    /// The user.
    Fixed,
}

/// Writes the watched functions where an evaluation was made.
pub(crate) type Read<'r> = &'r mut dyn FnMut(&mut [Reading]);

/// Receives the track, a time, and what reads the functions there.
pub(crate) type Beside<'b> = &'b mut dyn FnMut(&Track, f64, Read<'_>);

/// The concluded step: both ends, the state at any time inside, the watched functions along it.
pub(crate) struct StepView<'m> {
    pub(crate) formulation: &'m mut dyn Formulation,
    pub(crate) stepper: &'m mut dyn Stepper<SystemError>,
    pub(crate) track: &'m mut Track,
    pub(crate) located: &'m mut Located,
    /// A crossing of a guard and back that a fixed step cannot end at.
    pub(crate) hidden: &'m mut Option<(f64, usize)>,
    pub(crate) state: &'m mut [f64],
    pub(crate) end: &'m TrialEnd,
    pub(crate) course: Course,
    pub(crate) lengths: Lengths,
    /// Error of the velocities that is allowed, relative, and absolute in natural sizes.
    pub(crate) tolerance: (f64, f64),
    /// Whole turns removed from each coordinate before the step.
    pub(crate) turns: &'m [i32],
}

impl StepView<'_> {
    /// Times of its start and end.
    pub(crate) fn ends(&self) -> (f64, f64) {
        let step = self.stepper.current();
        (step.t_old, step.t_new)
    }

    /// Whether the step may be taken anew with another length that the integration chooses.
    pub(crate) fn may_end_earlier(&self) -> bool {
        self.lengths == Lengths::Controlled
    }

    /// Whether it ends at t, except for rounding of times.
    pub(crate) fn ends_at(&self, t: f64) -> bool {
        (self.stepper.current().t_new - t).abs() <= tolerance::SUM_ROUNDING * t.abs()
    }

    /// Whether it is one across a singular position.
    pub(crate) fn crosses(&self) -> bool {
        self.course == Course::Across
    }

    /// The state at t, as interpolated, into `state`.
    ///
    /// # Errors
    /// Where a stage of the dense output cannot be evaluated.
    pub(crate) fn interpolate(&mut self, t: f64) -> Result<(), StepFailure<SystemError>> {
        self.stepper.interpolate(&mut Adapter::new(self.formulation), t, self.state)
    }

    /// Read the watched functions at t; `beside` receives their readings at the stages of the dense output that this takes.
    ///
    /// # Errors
    /// Where something cannot be evaluated there.
    pub(crate) fn sample(&mut self, t: f64, beside: Beside) -> Result<(), StepFailure<SystemError>> {
        let track = &*self.track;
        let mut look = |t: f64, formulation: &mut dyn Formulation| {
            beside(track, t, &mut |out| {
                formulation.point().readings(t, out);
            });
            Depth::Levels
        };
        let mut ode = Adapter { depth: Depth::Levels, after: Some(&mut look), ..Adapter::new(self.formulation) };
        self.stepper.interpolate(&mut ode, t, self.state)?;
        let failed = |error| StepFailure::Rhs { t, error };
        self.formulation.point().evaluate(t, self.state).map_err(failed)?;
        let (count, mut observed) = (self.track.count(), self.track.observed.take());
        let mut read = Ok(());
        self.track.inside(t, |out| {
            let fastest = self.formulation.point().readings(t, &mut out[..count]);
            if let Some(observed) = &mut observed {
                read = observed.read_inside((t, self.state), self.formulation, self.turns, &mut out[count..]);
            }
            fastest
        });
        self.track.observed = observed;
        read.map_err(failed)
    }
}
