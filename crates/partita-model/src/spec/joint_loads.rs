//! Loads along a joint coordinate: springs, efforts, friction, stops, gas springs.

use super::forces::{negative, not_above_one, properties, too_steep, without_size, ForceRecord, Numbers};
use super::{Measure, Value};
use serde::{Deserialize, Serialize};

/// A spring and damper in a joint coordinate.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TorsionSpring {
    /// Name.
    pub name: String,
    /// Joint.
    pub joint: String,
    /// Which of its coordinates.
    #[serde(default)]
    pub coordinate: usize,
    /// [N m/rad] or [N/m].
    pub stiffness: f64,
    /// [N m s/rad] or [N s/m].
    pub damping: f64,
    /// Free position.
    pub angle: f64,
}

properties! { TorsionSpring { along [joint coordinate] numbers [stiffness, damping, angle] } }

/// An effort along a joint coordinate.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Torque {
    /// Name.
    pub name: String,
    /// Joint.
    pub joint: String,
    /// Which of its coordinates.
    #[serde(default)]
    pub coordinate: usize,
    /// Effort.
    pub value: Value,
    /// The abscissa of a table, if it is not time.
    #[serde(default)]
    pub over: Option<Measure>,
    /// Whether the table over it is periodic.
    #[serde(default)]
    pub periodic: bool,
}

properties! { Torque { along [joint coordinate] values [value] numbers [value] } }

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
    fn numbers(&mut self) -> Vec<(&'static str, Vec<&mut f64>)> {
        let mut all = vec![("stick_velocity", self.stick_velocity.numbers())];
        if self.follows.is_none() {
            all.push(("dynamic", self.dynamic.numbers()));
        }
        all.push(("static", self.held.numbers()));
        if let Some(f) = &mut self.follows {
            all.extend([
                ("coefficient", f.coefficient.numbers()),
                ("preload", f.preload.numbers()),
                ("static_coefficient", f.held.numbers()),
                ("radius", f.radius.numbers()),
                ("length", f.length.numbers()),
                ("collar", f.collar.numbers()),
            ]);
        }
        all.into_iter().filter(|(_, x)| !x.is_empty()).collect()
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

properties! { Stop {
    along [joint coordinate] numbers [stiffness, damping, lower, upper] fault misplaced
} }

impl Stop {
    fn misplaced(&self) -> Option<String> {
        let order = match (self.lower, self.upper) {
            (None, None) => Some("it has neither a lower nor an upper end; give one".into()),
            (Some(a), Some(b)) if a >= b => Some(format!("lower = {a} is not below upper = {b}")),
            _ => None,
        };
        order
            .or_else(|| negative(&[("stiffness", self.stiffness), ("damping", self.damping)]))
            .or_else(|| too_steep(&[("exponent", self.exponent)]))
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

properties! { GasSpring {
    along [joint coordinate]
    numbers [force, length]
    checks [without_size(length), not_above_one(exponent)]
} }
