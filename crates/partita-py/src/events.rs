//! Events of a run or a stepper, from Python.

use crate::failure::{self, unexpected};
use crate::functions::Callables;
use partita_integrate::simulate::Observe;
use partita_model::error::DescriptionError;
use partita_model::event_functions::{Formula, Formulas};
use partita_model::Model;
use partita_system::event::{Direction, Event};
use partita_system::ConstrainedSystem;
use pyo3::prelude::*;
use serde::Deserialize;
use std::sync::Arc;

/// Events as text, the functions that they call, and how often they may occur.
pub type EventList = (String, Vec<Py<PyAny>>, usize);

/// An event, as the Python package writes it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    name: String,
    formula: Formula,
    /// The sign of the rate, or 0.
    direction: i8,
    #[serde(default)]
    last: Option<u64>,
    #[serde(default)]
    most: Option<u64>,
}

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
        let written: Vec<Written> = serde_json::from_str(&text).map_err(|e| unexpected(format!("events: {e}")))?;
        let event = |x: &Written| Event {
            name: x.name.clone(),
            direction: match x.direction {
                0 => Direction::Either,
                1.. => Direction::Rising,
                _ => Direction::Falling,
            },
            last: x.last,
            most: x.most.unwrap_or(u64::MAX),
            side: None,
        };
        let events = written.iter().map(event).collect();
        let formulas = written.into_iter().map(|x| (x.name, x.formula)).collect();
        Ok(Self { events, formulas, functions: Arc::new(Callables::new(functions)), most })
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
