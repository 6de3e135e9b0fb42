//! Events of a run or a stepper, from Python.

use crate::failure::{self, unexpected};
use crate::functions::Callables;
use partita_integrate::simulate::Observe;
use partita_model::event_functions::{Formula, MechanismFunctions};
use partita_model::Model;
use partita_system::event::{Direction, Event};
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
pub struct EventsOfModel {
    model: Arc<Model>,
    events: Vec<Event>,
    formulas: Vec<(String, Formula)>,
    functions: Arc<Callables>,
    most: usize,
}

impl EventsOfModel {
    /// Read the events of a mechanism.
    pub fn new(model: Arc<Model>, (text, functions, most): EventList) -> PyResult<Self> {
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
        };
        let events = written.iter().map(event).collect();
        let formulas = written.into_iter().map(|x| (x.name, x.formula)).collect();
        Ok(Self { model, events, formulas, functions: Arc::new(Callables::new(functions)), most })
    }

    /// What finds them, from a start on.
    pub fn observe(&self) -> Result<Observe, partita_model::error::DescriptionError> {
        let functions = MechanismFunctions::new(self.model.clone(), &self.formulas, self.functions.clone())?;
        Ok(Observe { events: self.events.clone(), functions: Box::new(functions), most: self.most })
    }
}

/// What finds these events of a mechanism.
pub fn of_mechanism(py: Python<'_>, model: Arc<Model>, events: EventList) -> PyResult<Observe> {
    EventsOfModel::new(model, events)?.observe().map_err(|e| failure::description(py, &e))
}
