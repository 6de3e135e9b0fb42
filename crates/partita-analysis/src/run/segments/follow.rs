//! What is followed in a segment beside the events of the user: how long what is held lasts.

use partita_model::Model;
use partita_system::event::{EventFunctions, MotionState};
use partita_system::watched::Reading;
use partita_system::SystemError;
use std::sync::{Arc, Mutex, PoisonError};

/// Functions that several segments follow one after the other.
#[derive(Clone, Debug)]
pub(super) struct Shared(pub(super) Arc<Mutex<Box<dyn EventFunctions>>>);

impl EventFunctions for Shared {
    fn read(&mut self, at: &MotionState, out: &mut [Reading]) -> Result<(), SystemError> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).read(at, out)
    }
    fn accept(&mut self, t: f64) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).accept(t);
    }
}

/// The force that a friction can carry at most.
#[derive(Clone)]
pub(super) struct Largest {
    pub(super) model: Arc<Model>,
    pub(super) force: usize,
}

impl std::fmt::Debug for Largest {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.debug_struct("Largest").field("force", &self.force).finish_non_exhaustive()
    }
}

/// What is followed because of what is held; positive while that lasts.
#[derive(Clone, Debug)]
pub(super) enum Lasts {
    /// The force of a contact, or what friction can carry beyond its force.
    Force { row: usize, sign: f64, most: Option<Largest> },
    /// The rate that an event follows is not beyond this one.
    Rate { event: usize, sign: f64, width: f64 },
}

/// The same along a motion.
#[derive(Clone, Debug)]
pub(super) struct Following {
    pub(super) what: Lasts,
    /// Time and value where the motion stands, and where they were read since.
    pub(super) last: Option<(f64, f64)>,
    pub(super) read: Vec<(f64, f64)>,
}

impl From<Lasts> for Following {
    fn from(what: Lasts) -> Self {
        Self { what, last: None, read: Vec::new() }
    }
}

/// The functions of the events, and those that say how long what is held lasts.
#[derive(Debug)]
pub(super) struct WithContacts {
    pub(super) inner: Shared,
    pub(super) count: usize,
    pub(super) contacts: Vec<Following>,
}

impl EventFunctions for WithContacts {
    fn read(&mut self, at: &MotionState, out: &mut [Reading]) -> Result<(), SystemError> {
        self.inner.read(at, &mut out[..self.count])?;
        let (events, own) = out.split_at_mut(self.count);
        for (x, out) in self.contacts.iter_mut().zip(own) {
            let (force, terms) = match &x.what {
                Lasts::Force { row, sign, most } => {
                    let (force, levels) = (sign * at.multipliers[*row], most.as_ref());
                    let levels = levels.map(|x| x.model.friction_levels(x.force, at.t, (&at.q, &at.v))).transpose()?;
                    let most = levels.flatten().map_or(0.0, |levels| levels[1]);
                    (most + force, most.abs() + force.abs())
                }
                Lasts::Rate { event, sign, width } => (width - sign * events[*event].x, *width),
            };
            // a segment is first read where it begins
            x.last.get_or_insert((at.t, force));
            let rate = x.last.filter(|last| last.0 < at.t).map_or(0.0, |last| (force - last.1) / (at.t - last.0));
            x.read.push((at.t, force));
            *out = Reading { x: force, rate, terms, ..Reading::default() };
        }
        Ok(())
    }
    fn accept(&mut self, t: f64) {
        self.inner.accept(t);
        for x in &mut self.contacts {
            x.last = x.read.iter().rev().find(|read| read.0 == t).copied().or(x.last);
            x.read.clear();
        }
    }
    fn reads_forces(&self) -> bool {
        self.contacts.iter().any(|x| matches!(x.what, Lasts::Force { .. }))
    }
}
