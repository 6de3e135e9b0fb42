//! The content of `resources/model.json`, written with the FMU.

use partita_analysis::run::segments::WrittenPlan;
use partita_analysis::run::Request;
use partita_model::event_functions::WrittenEvent;
use partita_model::spec::{Drive, Spec};
use serde::Deserialize;

/// The version of the file that is read.
pub const VERSION: u32 = 2;

/// The whole file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Resource {
    /// Version.
    pub fmu: u32,
    /// The same as in `modelDescription.xml`.
    pub guid: String,
    /// The mechanism; function number i is input number i.
    pub model: Spec,
    /// Tolerances and methods; its times are not used.
    pub options: Request,
    /// Initial state.
    pub start: Start,
    /// Inputs: value references 0, 1, ..., one for each of their values.
    pub inputs: Vec<Input>,
    /// Outputs: value references after those of the inputs.
    pub outputs: Vec<Shown>,
    /// Numbers that can be set before the start: value references after those of the outputs. The time is the next one.
    #[serde(default)]
    pub parameters: Vec<Parameter>,
    /// Arrays among all these, by the number of their first value and their length; other values are variables alone.
    #[serde(default)]
    pub arrays: Vec<(usize, usize)>,
    /// What holds at times, and events.
    #[serde(default)]
    pub holding: Option<Holding>,
}

/// What holds at times, and events.
#[derive(Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Holding {
    /// Events, those of elements after those of the user.
    pub events: Vec<WrittenEvent>,
    /// The drives by which they act.
    pub drives: Vec<Drive>,
    /// What they do.
    pub plan: WrittenPlan,
    /// How many may occur in a step.
    pub most: usize,
}

/// A number of a parameter of the model.
#[derive(Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameter {
    /// The parameter.
    pub name: String,
    /// Its number.
    pub component: usize,
}

/// A state.
#[derive(Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Start {
    /// Time (s).
    pub t: f64,
    /// Coordinates.
    pub q: Vec<f64>,
    /// Velocities.
    pub v: Vec<f64>,
}

/// Kind of an input; its values follow each other among those of all inputs.
#[derive(Clone, Copy, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum Input {
    /// An effort along a joint coordinate: its value.
    Effort {
        /// At the start.
        start: f64,
    },
    /// The position of a drive: it, its rate and its acceleration.
    Position {
        /// The driven quantity at the start.
        position: f64,
        /// Its rate then.
        rate: f64,
    },
    /// The rate of a drive: it and its derivative.
    Rate {
        /// The driven quantity at the start.
        position: f64,
        /// Its rate then.
        rate: f64,
    },
}

impl Input {
    /// Its values at the start.
    pub fn values(&self) -> Vec<f64> {
        match *self {
            Self::Effort { start } => vec![start],
            Self::Position { position, rate } => vec![position, rate, 0.0],
            Self::Rate { rate, .. } => vec![rate, 0.0],
        }
    }
}

/// Kind of an output.
#[derive(Clone, Deserialize)]
#[serde(tag = "what", rename_all = "lowercase", deny_unknown_fields)]
pub enum Shown {
    /// A coordinate of a joint.
    Position {
        /// The joint.
        joint: String,
        /// Its coordinate.
        component: usize,
    },
    /// A velocity of a joint.
    Velocity {
        /// The joint.
        joint: String,
        /// Its velocity.
        component: usize,
    },
    /// A component of the reaction force on the child, world axes.
    Force {
        /// The joint.
        joint: String,
        /// x, y, z.
        component: usize,
    },
    /// A component of the reaction moment on the child, world axes.
    Moment {
        /// The joint.
        joint: String,
        /// x, y, z.
        component: usize,
    },
    /// Effort of the drive along a joint coordinate.
    Effort {
        /// The joint.
        joint: String,
        /// Its coordinate.
        component: usize,
    },
    /// Kinetic energy.
    Kinetic,
    /// Potential energy.
    Potential,
    /// What an element carries that holds by these drives.
    Carried {
        /// Their names.
        drives: Vec<String>,
    },
    /// How often something happened to these events since the start.
    Count {
        /// Their numbers.
        events: Vec<usize>,
    },
    /// When it did for the last time (s); the start of the simulation where it did not yet.
    Last {
        /// Their numbers.
        events: Vec<usize>,
    },
}
