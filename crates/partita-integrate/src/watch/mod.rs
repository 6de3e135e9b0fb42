//! What may happen inside a step: one question between "the step is accurate enough" and "the step is accepted".
//!
//! Each watch looks at the concluded step as a [`StepView`] and lets it stand, has it end earlier, has it repeated or
//! refuses to go on. They are asked in a stated order; the first that objects decides, and all are asked again about the
//! step that follows from it. The formulation knows none of them: they read the system at points of the step.

mod breakpoints;
mod discontinuity;
mod events;
mod guards;
mod interval;
mod observed;
mod prescribed;
mod singular;
mod singular_times;
mod times;
mod track;
mod view;

use crate::failure::StepFailure;
use breakpoints::BreakpointWatch;
pub(crate) use events::{EventWatch, Zero};
use guards::GuardWatch;
pub(crate) use observed::Observed;
use partita_system::formulation::{Formulation, Repeated};
use partita_system::SystemError;
use prescribed::PrescribedWatch;
use singular::SingularWatch;
pub(crate) use singular_times::find as find_singular_times;
use times::KnownTimes;
pub(crate) use track::Track;
pub(crate) use view::{Lengths, Located, StepView};

/// Decision of a watch about a step.
#[derive(Debug)]
pub(crate) enum Look {
    /// It may stand.
    Clear,
    /// It is taken anew, to end at t.
    EndAt {
        /// When.
        t: f64,
        /// Whether the slopes have a corner there.
        corner: bool,
    },
    /// It is taken anew, half as long or as the formulation plans.
    Repeat(Option<Repeated>),
    /// The integration ends at this time.
    Refuse(f64, SystemError),
}

/// A watch over steps.
pub(crate) trait Watch {
    /// May the concluded step stand as it is?
    ///
    /// # Errors
    /// Where the dense output cannot be evaluated; a shorter step is tried then.
    fn look(&mut self, step: &mut StepView) -> Result<Look, StepFailure<SystemError>>;
    /// The step stands.
    fn accept(&mut self, _track: &Track) {}
}

/// All watches of an integration.
#[derive(Debug)]
pub(crate) struct Watches {
    pub(crate) guards: GuardWatch,
    breakpoints: BreakpointWatch,
    pub(crate) times: KnownTimes,
    singular: SingularWatch,
    pub(crate) prescribed: PrescribedWatch,
    pub(crate) events: Option<EventWatch>,
}

impl Watches {
    /// Of a motion, with the functions that they follow.
    pub(crate) fn new(formulation: &mut dyn Formulation) -> (Self, Track) {
        let point = formulation.point();
        let watched = point.watched();
        let track = Track::new(watched.reads());
        let watches = Self {
            breakpoints: BreakpointWatch::new(watched.breakpoints, watched.guards.len()),
            guards: GuardWatch::new(watched.guards),
            times: KnownTimes::new(watched.discontinuities),
            singular: SingularWatch,
            prescribed: PrescribedWatch::new(point.prescribing()),
            events: None,
        };
        (watches, track)
    }

    /// Where a step of length h from t towards `end` should end: at a known time, or by prediction.
    pub(crate) fn ahead(&self, track: &Track, (t, end): (f64, f64), h: f64, tolerance: f64) -> Option<f64> {
        let first = |a: f64, b: f64| if (b < a) == (end > t) { b } else { a };
        let predicted = self.breakpoints.ahead(track, h, tolerance).map(|t| self.times.at(t).unwrap_or(t));
        predicted.into_iter().chain(self.times.ahead(t, end)).reduce(first)
    }

    /// The first objection to the concluded step.
    ///
    /// # Errors
    /// See [`Watch::look`].
    pub(crate) fn look(&mut self, step: &mut StepView) -> Result<Look, StepFailure<SystemError>> {
        let Self { guards, breakpoints, singular, prescribed, times, events } = self;
        let all: [&mut dyn Watch; 4] = [guards, breakpoints, singular, prescribed];
        let events = events.iter_mut().map(|events| events as &mut dyn Watch);
        for watch in all.into_iter().chain(events) {
            match watch.look(step) {
                Ok(Look::Clear) => {}
                Ok(Look::EndAt { t, corner }) => {
                    // at a known time slopes jump
                    let known = times.at(t);
                    return Ok(Look::EndAt { t: known.unwrap_or(t), corner: corner && known.is_none() });
                }
                objection => return objection,
            }
        }
        Ok(Look::Clear)
    }

    /// An integration begins where the track does.
    pub(crate) fn accept_start(&mut self, track: &Track) {
        self.guards.accept(track);
        self.breakpoints.accept(track);
    }

    /// The concluded step stands.
    pub(crate) fn accept(&mut self, track: &mut Track) {
        let Self { guards, breakpoints, singular, prescribed, times: _, events } = self;
        let all: [&mut dyn Watch; 4] = [guards, breakpoints, singular, prescribed];
        let events = events.iter_mut().map(|events| events as &mut dyn Watch);
        all.into_iter().chain(events).for_each(|watch| watch.accept(track));
        track.accept();
    }
}
