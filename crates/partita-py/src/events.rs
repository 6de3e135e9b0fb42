//! Events of a run or a stepper, from Python.

use crate::failure::{self, unexpected};
use crate::functions::Callables;
use partita_integrate::simulate::Observe;
use partita_model::error::DescriptionError;
use partita_model::event_functions::{Formula, Formulas, WrittenEvent};
use partita_model::Model;
use partita_system::event::Event;
use partita_system::ConstrainedSystem;
use pyo3::prelude::*;
use std::sync::Arc;

/// Events as text, the functions that they call, and how often they may occur.
pub type EventList = (String, Vec<Py<PyAny>>, usize);

/// Events that were read.
pub struct Events {
    events: Vec<Event>,
    formulas: Vec<(String, Formula)>,
    functions: Arc<Callables>,
    most: usize,
}

impl Events {
    /// As the Python package writes them.
    pub fn new((text, functions, most): EventList) -> PyResult<Self> {
        let written: Vec<WrittenEvent> = serde_json::from_str(&text).map_err(|e| unexpected(format!("events: {e}")))?;
        let events = written.iter().map(WrittenEvent::event).collect();
        let formulas = written.into_iter().map(|x| (x.name, x.formula)).collect();
        Ok(Self { events, formulas, functions: Arc::new(Callables::new(functions)), most })
    }

    /// What each follows, by name.
    pub fn formulas(&self) -> Vec<(String, Formula)> {
        self.formulas.clone()
    }

    /// What finds them along a motion of a mechanism, from its start on.
    pub fn of_mechanism(&self, model: Arc<Model>) -> Result<Observe, DescriptionError> {
        let functions = Formulas::of_mechanism(model, &self.formulas, self.functions.clone())?;
        Ok(Observe { events: self.events.clone(), functions: Box::new(functions), most: self.most })
    }

    /// The same for a system given by matrices.
    pub fn of_system<S: ConstrainedSystem + Send + Sync + 'static>(
        &self,
        system: Arc<S>,
    ) -> Result<Observe, DescriptionError> {
        let functions = Formulas::of_system(system, &self.formulas, self.functions.clone())?;
        Ok(Observe { events: self.events.clone(), functions: Box::new(functions), most: self.most })
    }
}

/// What finds these events, by one of the methods of [`Events`].
pub fn observing(
    py: Python<'_>,
    events: Option<EventList>,
    make: impl FnOnce(&Events) -> Result<Observe, DescriptionError>,
) -> PyResult<Option<Observe>> {
    let Some(events) = events else { return Ok(None) };
    make(&Events::new(events)?).map(Some).map_err(|e| failure::description(py, &e))
}
