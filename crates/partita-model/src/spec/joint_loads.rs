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
    /// Stick velocity [m/s] or [rad/s]; 0: set-valued, it sticks as a constraint.
    pub stick_velocity: f64,
    /// The magnitudes follow the reaction of the joint instead.
    #[serde(default)]
    pub follows: Option<Follows>,
    /// In a mode of a run, where it may stick: the signs of the motion that its sliding and its static magnitude resist; both
    /// 0: it has no force, a row carries what it carries.
    #[serde(skip)]
    pub signs: [f64; 2],
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
        let mut all = Vec::new();
        if self.stick_velocity != 0.0 {
            all.push(("stick_velocity", self.stick_velocity.numbers()));
        }
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
    fn set_valued(&self) -> Option<&str> {
        (self.stick_velocity == 0.0).then_some("friction that sticks: give it a stick_velocity")
    }
    fn signs(&mut self) -> Option<&mut [f64; 2]> {
        Some(&mut self.signs)
    }
    fn fault(&self) -> Option<String> {
        let level = |what, v: &Value| match v {
            Value::Constant(x) => negative(&[(what, *x)]),
            Value::Table(_) | Value::Function(_) => None,
        };
        let follows = self.follows.is_some() && self.stick_velocity == 0.0;
        let follows = follows.then(|| {
            "friction that sticks (stick_velocity = 0) needs its magnitude (dynamic), not a coefficient of a reaction: \
             reaction and friction might have no values together, or several; or give a stick_velocity"
                .to_owned()
        });
        negative(&[("stick_velocity", self.stick_velocity)])
            .or(follows)
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

/// Ends of a joint coordinate, compliant or rigid.
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
    /// Effort at a unit of depth; of compliant ends.
    #[serde(default)]
    pub stiffness: Option<f64>,
    /// Power of the depth.
    pub exponent: f64,
    /// Growth of the effort with the speed inward (s/m or s/rad).
    pub damping: f64,
    /// Coefficient of restitution; of rigid ends.
    #[serde(default)]
    pub restitution: Option<f64>,
}

impl ForceRecord for Stop {
    fn name(&self) -> &str {
        &self.name
    }
    fn along(&self) -> Option<(&str, usize)> {
        Some((&self.joint, self.coordinate))
    }
    fn numbers(&mut self) -> Vec<(&'static str, Vec<&mut f64>)> {
        let all = [
            ("stiffness", self.stiffness.numbers()),
            ("damping", if self.restitution.is_some() { Vec::new() } else { self.damping.numbers() }),
            ("lower", self.lower.numbers()),
            ("upper", self.upper.numbers()),
            ("restitution", self.restitution.numbers()),
        ];
        all.into_iter().filter(|(_, x)| !x.is_empty()).collect()
    }
    fn set_valued(&self) -> Option<&str> {
        self.restitution.map(|_| "a rigid stop (restitution): give it a stiffness")
    }
    fn fault(&self) -> Option<String> {
        self.misplaced()
    }
}

/// A joint coordinate that turns freely in one sense.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Freewheel {
    /// Name.
    pub name: String,
    /// Joint.
    pub joint: String,
    /// Which of its coordinates.
    #[serde(default)]
    pub coordinate: usize,
    /// The sign of the rate that is free.
    pub free: f64,
}

impl ForceRecord for Freewheel {
    fn name(&self) -> &str {
        &self.name
    }
    fn along(&self) -> Option<(&str, usize)> {
        Some((&self.joint, self.coordinate))
    }
    fn set_valued(&self) -> Option<&str> {
        Some("a freewheel: leave it out")
    }
    fn fault(&self) -> Option<String> {
        (self.free.abs() != 1.0).then(|| format!("free = {} is no sense; give 1 or -1", self.free))
    }
}

/// A joint coordinate that is held from where it passes a value.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Latch {
    /// Name.
    pub name: String,
    /// Joint.
    pub joint: String,
    /// Which of its coordinates.
    #[serde(default)]
    pub coordinate: usize,
    /// Where it closes.
    pub at: f64,
    /// The sign of the rate with which it closes; 0: of either.
    pub direction: f64,
}

properties! { Latch { along [joint coordinate] numbers [at] } }

impl Stop {
    fn misplaced(&self) -> Option<String> {
        let order = match (self.lower, self.upper) {
            (None, None) => Some("it has neither a lower nor an upper end; give one".into()),
            (Some(a), Some(b)) if a >= b => Some(format!("lower = {a} is not below upper = {b}")),
            _ => None,
        };
        let kind = match (self.stiffness, self.restitution) {
            (Some(_), Some(_)) => Some("it is compliant (stiffness) or rigid (restitution), not both; give one".into()),
            (None, None) => Some("give a stiffness (compliant ends) or a restitution (rigid ends)".into()),
            (None, Some(e)) if !(0.0..=1.0).contains(&e) => Some(format!("restitution = {e} must lie between 0 and 1")),
            _ => None,
        };
        order
            .or(kind)
            .or_else(|| negative(&[("stiffness", self.stiffness.unwrap_or_default()), ("damping", self.damping)]))
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
