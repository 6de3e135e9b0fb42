//! Forces, and those along a joint coordinate that are described by records of their own: friction, stops, gas springs.

use super::loads::{Bushing, Contact, Gravity, Law, Rope, Tyre, Weightless};
use super::{Axes, Measure, Value, VectorValue};
use serde::{Deserialize, Serialize};
use std::slice::from_mut as one;

/// An applied force.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Force {
    /// Spring and damper between two points.
    Spring {
        /// Name.
        name: String,
        /// First body or `ground`.
        body1: String,
        /// Point on it, body axes.
        point1: [f64; 3],
        /// Second body or `ground`.
        body2: String,
        /// Point on it, body axes.
        point2: [f64; 3],
        /// [N/m].
        stiffness: f64,
        /// [N s/m].
        damping: f64,
        /// Free length (m).
        length: f64,
    },
    /// Spring and damper in a joint coordinate.
    TorsionSpring {
        /// Name.
        name: String,
        /// Joint.
        joint: String,
        /// Which of its coordinates.
        #[serde(default)]
        coordinate: usize,
        /// [N m/rad] or [N/m].
        stiffness: f64,
        /// [N m s/rad] or [N s/m].
        damping: f64,
        /// Free position.
        angle: f64,
    },
    /// Effort along a joint coordinate.
    Torque {
        /// Name.
        name: String,
        /// Joint.
        joint: String,
        /// Which of its coordinates.
        #[serde(default)]
        coordinate: usize,
        /// Effort.
        value: Value,
        /// The abscissa of a table, if it is not time.
        #[serde(default)]
        over: Option<Measure>,
        /// Whether the table over it is periodic.
        #[serde(default)]
        periodic: bool,
    },
    /// Force at a point of a body.
    Force {
        /// Name.
        name: String,
        /// Body.
        body: String,
        /// Point in body axes.
        point: [f64; 3],
        /// Components.
        value: VectorValue,
        /// Axes of the components.
        #[serde(default)]
        axes: Axes,
    },
    /// Stiffness and damping in all directions between two frames.
    Bushing(Box<Bushing>),
    /// Friction in a joint coordinate.
    Friction(Friction),
    /// Compliant ends of a joint coordinate.
    Stop(Stop),
    /// A gas spring in a joint coordinate.
    GasSpring(GasSpring),
    /// A sphere against a plane or a sphere.
    Contact(Contact),
    /// A rope between two points.
    Rope(Rope),
    /// A wheel on a road.
    Tyre(Tyre),
    /// A function of its readings.
    Law(Law),
    /// No gravity on a body.
    Weightless(Weightless),
    /// Time-dependent gravity.
    Gravity(Gravity),
}

impl Force {
    /// Its name.
    pub fn name(&self) -> &str {
        match self {
            Self::Spring { name, .. }
            | Self::TorsionSpring { name, .. }
            | Self::Torque { name, .. }
            | Self::Force { name, .. } => name,
            _ => self.record().map_or("", ForceRecord::name),
        }
    }

    /// Its own record.
    pub fn record(&self) -> Option<&dyn ForceRecord> {
        match self {
            Self::Spring { .. } | Self::TorsionSpring { .. } | Self::Torque { .. } | Self::Force { .. } => None,
            Self::Bushing(x) => Some(&**x),
            Self::Friction(x) => Some(x),
            Self::Stop(x) => Some(x),
            Self::GasSpring(x) => Some(x),
            Self::Contact(x) => Some(x),
            Self::Rope(x) => Some(x),
            Self::Tyre(x) => Some(x),
            Self::Law(x) => Some(x),
            Self::Weightless(x) => Some(x),
            Self::Gravity(x) => Some(x),
        }
    }

    /// Its own record, mutable.
    pub fn record_mut(&mut self) -> Option<&mut dyn ForceRecord> {
        match self {
            Self::Spring { .. } | Self::TorsionSpring { .. } | Self::Torque { .. } | Self::Force { .. } => None,
            Self::Bushing(x) => Some(&mut **x),
            Self::Friction(x) => Some(x),
            Self::Stop(x) => Some(x),
            Self::GasSpring(x) => Some(x),
            Self::Contact(x) => Some(x),
            Self::Rope(x) => Some(x),
            Self::Tyre(x) => Some(x),
            Self::Law(x) => Some(x),
            Self::Weightless(x) => Some(x),
            Self::Gravity(x) => Some(x),
        }
    }

    /// The joint and its coordinate along which it acts as an effort.
    pub fn along(&self) -> Option<(&str, usize)> {
        match self {
            Self::TorsionSpring { joint, coordinate, .. } | Self::Torque { joint, coordinate, .. } => {
                Some((joint, *coordinate))
            }
            _ => self.record().and_then(ForceRecord::along),
        }
    }

    /// The joint and its coordinate on which an effort depends; by default the one along which it acts.
    pub fn over(&self) -> Option<(&str, usize)> {
        match self {
            Self::Torque { over: Some(Measure::Joint { joint, coordinate }), .. } => Some((joint, *coordinate)),
            Self::Torque { over: Some(_), .. } => None,
            _ => self.along(),
        }
    }

    /// Joints along whose coordinate it acts, or which it reads.
    pub fn joints(&self) -> Vec<&str> {
        let own = self.record().map_or_else(Vec::new, ForceRecord::joints);
        self.along().into_iter().chain(self.over()).chain(own).map(|(joint, _)| joint).collect()
    }
}

/// Properties of a force with its own record: names, parameters, tables, checks.
pub trait ForceRecord {
    /// Its name.
    fn name(&self) -> &str;
    /// Bodies that it names.
    fn bodies(&self) -> Vec<&str> {
        Vec::new()
    }
    /// The joint and its coordinate along which it acts as an effort.
    fn along(&self) -> Option<(&str, usize)> {
        None
    }
    /// Joints that it names, with the coordinate.
    fn joints(&self) -> Vec<(&str, usize)> {
        self.along().into_iter().collect()
    }
    /// Values that may be tables or functions.
    fn values(&self) -> Vec<&Value> {
        Vec::new()
    }
    /// Its parameters: field and numbers.
    fn numbers(&mut self) -> Vec<(&'static str, &mut [f64])> {
        Vec::new()
    }
    /// Error in its numbers, all of them finite.
    fn fault(&self) -> Option<String> {
        None
    }
}

fn constant(v: &mut Value) -> Option<&mut [f64]> {
    match v {
        Value::Constant(x) => Some(one(x)),
        Value::Table(_) | Value::Function(_) => None,
    }
}

/// The first of these numbers that must not be negative and is.
pub(super) fn negative(all: &[(&str, f64)]) -> Option<String> {
    all.iter().find(|x| x.1 < 0.0).map(|(what, x)| format!("{what} = {x} is negative; give 0 or more"))
}

/// The first of these numbers that must be above zero and is not.
pub(super) fn without_size(all: &[(&str, f64)]) -> Option<String> {
    all.iter().find(|x| x.1 <= 0.0).map(|(what, x)| format!("{what} = {x} must be greater than 0"))
}

pub(super) fn no_direction(what: &str, x: &[f64; 3]) -> Option<String> {
    x.iter().all(|x| *x == 0.0).then(|| format!("{what} = {x:?} has no direction"))
}

pub(super) fn no_exponent(x: f64) -> Option<String> {
    (x < 1.0)
        .then(|| format!("exponent = {x} would make a contact infinitely stiff at its first touch; give 1 or more"))
}

/// Friction in a joint coordinate.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Friction {
    /// Name.
    pub name: String,
    /// Joint.
    pub joint: String,
    /// Which of its coordinates.
    #[serde(default)]
    pub coordinate: usize,
    /// Magnitude while it slides (N) or (N m).
    #[serde(default = "no_level")]
    pub dynamic: Value,
    /// Static magnitude; none: that of sliding.
    #[serde(default, rename = "static")]
    pub held: Option<Value>,
    /// Stick velocity [m/s] or [rad/s].
    pub stick_velocity: f64,
    /// The magnitudes follow the reaction of the joint instead.
    #[serde(default)]
    pub follows: Option<Follows>,
}

fn no_level() -> Value {
    Value::Constant(0.0)
}

/// How friction magnitudes follow the reaction of their joint.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Follows {
    /// Kinetic coefficient.
    pub coefficient: f64,
    /// Static coefficient; none: the kinetic one.
    #[serde(default, rename = "static_coefficient")]
    pub held: Option<f64>,
    /// Radius of a sliding rotation, or the arm that keeps a translation from rotating (m).
    #[serde(default)]
    pub radius: Option<f64>,
    /// Length of the bearing (m).
    #[serde(default)]
    pub length: Option<f64>,
    /// Radius at which the force along the axis of a rotation slides (m).
    #[serde(default)]
    pub collar: Option<f64>,
    /// Constant normal force (N).
    #[serde(default)]
    pub preload: f64,
}

impl ForceRecord for Friction {
    fn name(&self) -> &str {
        &self.name
    }
    fn along(&self) -> Option<(&str, usize)> {
        Some((&self.joint, self.coordinate))
    }
    fn values(&self) -> Vec<&Value> {
        std::iter::once(&self.dynamic).chain(&self.held).collect()
    }
    fn numbers(&mut self) -> Vec<(&'static str, &mut [f64])> {
        let mut all = vec![("stick_velocity", one(&mut self.stick_velocity))];
        all.extend(constant(&mut self.dynamic).map(|x| ("dynamic", x)));
        all.extend(self.held.as_mut().and_then(constant).map(|x| ("static", x)));
        if let Some(f) = &mut self.follows {
            all.retain(|(field, _)| *field != "dynamic");
            all.push(("coefficient", one(&mut f.coefficient)));
            all.push(("preload", one(&mut f.preload)));
            let given = [
                ("static_coefficient", &mut f.held),
                ("radius", &mut f.radius),
                ("length", &mut f.length),
                ("collar", &mut f.collar),
            ];
            all.extend(given.into_iter().filter_map(|(field, x)| x.as_mut().map(|x| (field, one(x)))));
        }
        all
    }
    fn fault(&self) -> Option<String> {
        let level = |what, v: &Value| match v {
            Value::Constant(x) => negative(&[(what, *x)]),
            Value::Table(_) | Value::Function(_) => None,
        };
        without_size(&[("stick_velocity", self.stick_velocity)])
            .or_else(|| level("dynamic", &self.dynamic))
            .or_else(|| self.held.as_ref().and_then(|v| level("static", v)))
            .or_else(|| self.follows.as_ref().and_then(Follows::fault))
    }
}

impl Follows {
    fn fault(&self) -> Option<String> {
        negative(&[
            ("coefficient", self.coefficient),
            ("static_coefficient", self.held.unwrap_or_default()),
            ("collar", self.collar.unwrap_or_default()),
            ("preload", self.preload),
        ])
        .or_else(|| without_size(&[("radius", self.radius.unwrap_or(1.0)), ("length", self.length.unwrap_or(1.0))]))
    }
}

/// Compliant ends of a joint coordinate.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stop {
    /// Name.
    pub name: String,
    /// Joint.
    pub joint: String,
    /// Which of its coordinates.
    #[serde(default)]
    pub coordinate: usize,
    /// Lower end, where it begins to push forward.
    #[serde(default)]
    pub lower: Option<f64>,
    /// Upper end, where it begins to push back.
    #[serde(default)]
    pub upper: Option<f64>,
    /// Effort at a unit of depth.
    pub stiffness: f64,
    /// Power of the depth.
    pub exponent: f64,
    /// Growth of the effort with the speed inward (s/m or s/rad).
    pub damping: f64,
}

impl ForceRecord for Stop {
    fn name(&self) -> &str {
        &self.name
    }
    fn along(&self) -> Option<(&str, usize)> {
        Some((&self.joint, self.coordinate))
    }
    fn numbers(&mut self) -> Vec<(&'static str, &mut [f64])> {
        let mut all = vec![("stiffness", one(&mut self.stiffness)), ("damping", one(&mut self.damping))];
        all.extend(self.lower.as_mut().map(|x| ("lower", one(x))));
        all.extend(self.upper.as_mut().map(|x| ("upper", one(x))));
        all
    }
    fn fault(&self) -> Option<String> {
        let order = match (self.lower, self.upper) {
            (None, None) => Some("it has neither a lower nor an upper end; give one".into()),
            (Some(a), Some(b)) if a >= b => Some(format!("lower = {a} is not below upper = {b}")),
            _ => None,
        };
        order
            .or_else(|| negative(&[("stiffness", self.stiffness), ("damping", self.damping)]))
            .or_else(|| no_exponent(self.exponent))
    }
}

/// A closed column of gas in a joint coordinate.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GasSpring {
    /// Name.
    pub name: String,
    /// Joint.
    pub joint: String,
    /// Which of its coordinates.
    #[serde(default)]
    pub coordinate: usize,
    /// Effort as drawn; a negative one pushes back.
    pub force: f64,
    /// Length of the column as drawn (m) or (rad).
    pub length: f64,
    /// Exponent of the polytropic change of state.
    pub exponent: f64,
}

impl ForceRecord for GasSpring {
    fn name(&self) -> &str {
        &self.name
    }
    fn along(&self) -> Option<(&str, usize)> {
        Some((&self.joint, self.coordinate))
    }
    fn numbers(&mut self) -> Vec<(&'static str, &mut [f64])> {
        vec![("force", one(&mut self.force)), ("length", one(&mut self.length))]
    }
    fn fault(&self) -> Option<String> {
        without_size(&[("length", self.length)])
            .or_else(|| (self.exponent <= 1.0).then(|| format!("exponent = {} must be greater than 1", self.exponent)))
    }
}
