//! The description of a mechanism: plain, versioned data. World axes of the drawing, SI, radians.

mod couplings;
mod forces;
mod joint_loads;
mod loads;
mod rotor;

pub use couplings::{Coupling, GivenAs};
pub use forces::*;
pub use joint_loads::{Follows, Freewheel, Friction, GasSpring, Latch, Stop, Torque, TorsionSpring};
pub use loads::{Bushing, Contact, Gravity, Law, Sight, Spot, Tyre, Weightless};
pub use rotor::Rotor;

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Version of the description that this build reads.
pub const VERSION: u32 = 1;

/// The drawing tolerance unless one is given. Unit: lengths of a block; rad. Reason: four decimals, as drawings are
/// dimensioned.
pub const DRAWING_TOLERANCE: f64 = 1e-4;
/// The largest drawing tolerance. Scale: lengths of a block; rad. Reason: with a larger difference it is another
/// mechanism.
pub const LARGEST_TOLERANCE: f64 = 1e-2;
fn drawing_tolerance() -> f64 {
    DRAWING_TOLERANCE
}

/// A mechanism as drawn.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spec {
    /// Version of the description.
    pub partita: u32,
    /// Name of the mechanism.
    pub name: String,
    /// Gravity [m/s²].
    pub gravity: [f64; 3],
    /// Possible error of the drawing (radians, fractions of lengths): joints that over-constrain by no more than that
    /// are repaired.
    #[serde(default = "drawing_tolerance")]
    pub drawing_tolerance: f64,
    /// Rigid bodies.
    #[serde(default)]
    pub bodies: Vec<Body>,
    /// Joints between them and the ground.
    #[serde(default)]
    pub joints: Vec<Joint>,
    /// Conditions between joints and bodies that are not joints.
    #[serde(default)]
    pub couplings: Vec<Coupling>,
    /// Rotors that turn with joints.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub rotors: Vec<Rotor>,
    /// Prescribed joint motions.
    #[serde(default)]
    pub drives: Vec<Drive>,
    /// Applied forces.
    #[serde(default)]
    pub forces: Vec<Force>,
    /// Quantities that functions of the state read besides coordinates: bodies, points and joints, for sensors.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sights: Vec<Sight>,
    /// Joints that events of a run may part, and whether they are apart; no part of a description.
    #[serde(skip)]
    pub parting: BTreeMap<String, bool>,
}

// Compiled here once: the generic reader and writer would be compiled anew in every crate that uses them.
impl Spec {
    /// Whether a joint acts no longer, because an event parted it.
    pub fn is_apart(&self, joint: &Joint) -> bool {
        self.parting.get(&joint.name).copied().unwrap_or(false)
    }

    /// Bodies and the ground that a coupling connects.
    pub fn joined_by<'x>(&'x self, coupling: &'x Coupling) -> Vec<&'x str> {
        if let Coupling::Roll { body, on, .. } = coupling {
            return vec![body, on];
        }
        let mut found: Vec<&str> = Vec::new();
        for m in coupling.terms() {
            match m {
                Measure::Joint { joint, .. } => {
                    let of = self.joints.iter().filter(|j| j.name == *joint);
                    found.extend(of.flat_map(|j| [j.parent.as_str(), j.child.as_str()]));
                }
                Measure::Distance { body1, body2, .. }
                | Measure::Along { body1, body2, .. }
                | Measure::Cosine { body1, body2, .. } => found.extend([body1.as_str(), body2.as_str()]),
            }
        }
        found
    }

    /// The description that is written in JSON.
    ///
    /// # Errors
    /// The text is not JSON, or no description.
    pub fn from_json(text: &str) -> serde_json::Result<Self> {
        serde_json::from_str(text)
    }

    /// In JSON.
    ///
    /// # Errors
    /// A number that JSON cannot represent.
    pub fn to_json(&self) -> serde_json::Result<String> {
        serde_json::to_string(self)
    }
}

/// A rigid body; its frame has its origin at `position`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Body {
    /// Unique name.
    pub name: String,
    /// Mass (kg).
    pub mass: f64,
    /// Centre of mass in body axes (m).
    pub com: [f64; 3],
    /// Inertia about the centre of mass in body axes [kg m²].
    pub inertia: [[f64; 3]; 3],
    /// Origin in the drawing (m).
    pub position: [f64; 3],
    /// Body axes in the drawing (columns).
    pub orientation: [[f64; 3]; 3],
    /// Shape for pictures.
    #[serde(default)]
    pub shape: Option<serde_json::Value>,
}

/// Kinds of joints.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JointKind {
    /// One rotation about an axis.
    Revolute,
    /// One translation along an axis.
    Prismatic,
    /// A translation and a rotation along one axis.
    Cylindrical,
    /// Two rotations about crossing axes.
    Universal,
    /// All turns.
    Spherical,
    /// Two translations in a plane and the rotation in it.
    Planar,
    /// None.
    Fixed,
    /// All six.
    Free,
    /// Any subset of three translations and three rotations.
    Generic,
    /// A rotation about an axis and the coupled advance along it.
    Screw,
    /// Two bends that transmit a spin unchanged.
    ConstantVelocity,
    /// A point on a line, free to rotate.
    PointOnLine,
    /// A point in a plane.
    PointOnPlane,
    /// Axes that stay parallel.
    Parallel,
    /// Axes that stay at a right angle.
    Perpendicular,
    /// All axes stay parallel.
    Orientation,
    /// A translation along a slot, then a rotation about a pin perpendicular to it.
    PinSlot,
    /// Directions that are free, or functions of those.
    Custom,
}

impl JointKind {
    /// Its name in messages.
    pub fn words(self) -> &'static str {
        match self {
            Self::Revolute => "revolute",
            Self::Prismatic => "prismatic",
            Self::Cylindrical => "cylindrical",
            Self::Universal => "universal",
            Self::Spherical => "spherical",
            Self::Planar => "planar",
            Self::Fixed => "fixed",
            Self::Free => "free",
            Self::Generic => "generic",
            Self::Screw => "screw",
            Self::ConstantVelocity => "constant velocity",
            Self::PointOnLine => "point on line",
            Self::PointOnPlane => "point on plane",
            Self::Parallel => "parallel",
            Self::Perpendicular => "perpendicular",
            Self::Orientation => "orientation",
            Self::PinSlot => "pin slot",
            Self::Custom => "custom",
        }
    }
}

/// Whether this joint may be cut when loops are opened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Cut {
    /// Decided by the spanning tree.
    #[default]
    Auto,
    /// Wherever it closes a loop.
    Always,
    /// Only if nothing else closes the loop.
    Never,
}

/// A direction of a joint whose displacement is a function of its free ones.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Follower {
    /// x, y, z, rx, ry or rz.
    pub direction: String,
    /// Number of the relation that is 0: of this displacement, then of those of the free directions in the order above.
    pub function: usize,
}

/// A joint in the drawing.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Joint {
    /// Unique name.
    pub name: String,
    /// Kind.
    pub kind: JointKind,
    /// Parent body or `ground`.
    pub parent: String,
    /// Child body.
    pub child: String,
    /// Its position (m).
    #[serde(default)]
    pub point: [f64; 3],
    /// Its axis (revolute, prismatic, cylindrical), normal (planar) or first axis (universal).
    #[serde(default)]
    pub axis: Option<[f64; 3]>,
    /// Second axis (universal).
    #[serde(default)]
    pub axis2: Option<[f64; 3]>,
    /// Joint axes x, y, z as columns (generic).
    #[serde(default)]
    pub frame: Option<[[f64; 3]; 3]>,
    /// Free directions (generic, custom): x, y, z, rx, ry, rz.
    #[serde(default)]
    pub free: Option<Vec<String>>,
    /// Directions that are functions of the free ones (custom).
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub followers: Vec<Follower>,
    /// Advance for a whole turn (m), positive for a right-hand thread (screw).
    #[serde(default)]
    pub pitch: Option<f64>,
    /// Its position on the child in an open drawing.
    #[serde(default)]
    pub child_point: Option<[f64; 3]>,
    /// Its axis on the child in an open drawing.
    #[serde(default)]
    pub child_axis: Option<[f64; 3]>,
    /// Joint axes on the child in an open drawing, as columns: those of the joint lie along these when all its
    /// coordinates are 0.
    #[serde(default)]
    pub child_frame: Option<[[f64; 3]; 3]>,
    /// Whether it may be cut.
    #[serde(default)]
    pub cut: Cut,
    /// Compliance along and about the joint axes x, y, z [m/N], [rad/(N m)], by which redundant joints share loads.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub compliance: Option<[f64; 6]>,
}

impl Joint {
    /// A joint of this kind between two bodies at a point, without an axis yet; the spanning tree decides where loops
    /// are cut.
    pub fn new(name: impl Into<String>, kind: JointKind, parent: &str, child: &str, point: [f64; 3]) -> Self {
        Self {
            name: name.into(),
            kind,
            parent: parent.into(),
            child: child.into(),
            point,
            axis: None,
            axis2: None,
            frame: None,
            free: None,
            followers: Vec::new(),
            pitch: None,
            child_point: None,
            child_axis: None,
            child_frame: None,
            cut: Cut::Auto,
            compliance: None,
        }
    }
}

/// A number, a table or a function.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum Value {
    /// The same at all times.
    Constant(f64),
    /// Piecewise cubic in time.
    Table(Table),
    /// Index i among the functions given.
    Function(usize),
}

/// Piecewise cubic: `c3 x³ + c2 x² + c1 x + c0`, `x = t − break`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Table {
    /// Ascending break points.
    pub breaks: Vec<f64>,
    /// Four coefficients an interval, highest power first.
    pub coefficients: Vec<[f64; 4]>,
}

impl Table {
    /// The same within `half` of x, and nothing beyond: the outer pieces extend.
    pub(crate) fn around(&self, x: f64, half: f64) -> Self {
        let (from, to) = (x - half, x + half);
        let inner = self.breaks.iter().copied().filter(|b| *b > from && *b < to);
        let breaks: Vec<f64> = std::iter::once(from).chain(inner).chain([to]).collect();
        let piece = |start: &f64| {
            let last = self.coefficients.len() - 1;
            let i = self.breaks.partition_point(|b| b <= start).saturating_sub(1).min(last);
            let ([a, b, c, d], x) = (self.coefficients[i], start - self.breaks[i]);
            [a, 3.0 * a * x + b, (3.0 * a * x + 2.0 * b) * x + c, ((a * x + b) * x + c) * x + d]
        };
        let coefficients = breaks[..breaks.len() - 1].iter().map(piece).collect();
        Self { breaks, coefficients }
    }
}

/// A measurement of a mechanism.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "of", rename_all = "snake_case", deny_unknown_fields)]
pub enum Measure {
    /// A coordinate of a joint: a translation (m) or an angle (rad).
    Joint {
        /// Joint.
        joint: String,
        /// Which of its coordinates.
        #[serde(default)]
        coordinate: usize,
    },
    /// Distance of two points (m).
    Distance {
        /// First body or `ground`.
        body1: String,
        /// Point on it, body axes.
        point1: [f64; 3],
        /// Second body or `ground`.
        body2: String,
        /// Point on it, body axes.
        point2: [f64; 3],
    },
    /// Displacement of a point of the second body from one of the first along an axis of the first (m).
    Along {
        /// First body or `ground`.
        body1: String,
        /// Point on it, body axes.
        point1: [f64; 3],
        /// Axis on it, body axes.
        axis: [f64; 3],
        /// Second body or `ground`.
        body2: String,
        /// Point on it, body axes.
        point2: [f64; 3],
    },
    /// Cosine of the angle between an axis of each of two bodies.
    Cosine {
        /// First body or `ground`.
        body1: String,
        /// Axis on it, body axes.
        axis1: [f64; 3],
        /// Second body or `ground`.
        body2: String,
        /// Axis on it, body axes.
        axis2: [f64; 3],
    },
}

impl Measure {
    /// A coordinate of a joint.
    pub fn joint(joint: impl Into<String>, coordinate: usize) -> Self {
        Self::Joint { joint: joint.into(), coordinate }
    }
    /// The joint whose coordinate it is.
    pub fn of_joint(&self) -> Option<&str> {
        match self {
            Self::Joint { joint, .. } => Some(joint),
            _ => None,
        }
    }
}

/// Whether a condition constrains positions, or only rates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// Positions.
    #[default]
    Position,
    /// Rates alone: nonholonomic.
    Velocity,
}

/// A prescribed motion.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Drive {
    /// Name.
    pub name: String,
    /// The prescribed quantity.
    pub measure: Measure,
    /// Its position over time, or its rate.
    pub motion: Value,
    /// Which of them.
    #[serde(default)]
    pub level: Level,
    /// For a joint with spatial rotation: the orientation of which its coordinate is a component, instead of `motion`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub turning: Option<Turning>,
}

impl Drive {
    /// A drive of a translation, an angle or any other measurement.
    pub fn new(name: impl Into<String>, measure: Measure, motion: Value, level: Level) -> Self {
        Self { name: name.into(), measure, motion, level, turning: None }
    }

    /// Its number by the name of its field: a position or a rate that is the same at all times.
    pub fn numbers(&mut self) -> Vec<(&'static str, &mut [f64])> {
        let field = match self.level {
            Level::Position => "position",
            Level::Velocity => "velocity",
        };
        match (&self.turning, &mut self.motion) {
            (None, Value::Constant(x)) => vec![(field, std::slice::from_mut(x))],
            _ => Vec::new(),
        }
    }
}

/// An orientation over time: of the child relative to the parent, as given by the coordinates of the joint.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum Turning {
    /// The same at all times.
    Held([[f64; 3]; 3]),
    /// From break to break a rotation vector (three cubics over the same breaks), applied after a quaternion (w, x, y,
    /// z).
    Table {
        /// The components of the vector.
        vectors: [Table; 3],
        /// Where each interval begins.
        rotations: Vec<[f64; 4]>,
    },
    /// Index i among the functions given.
    Function(usize),
}

/// Three components, or one function for all.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(untagged)]
pub enum VectorValue {
    /// A value for each component.
    Components([Value; 3]),
    /// A function returning three numbers.
    Whole(Value),
}

/// Axes of a force.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Axes {
    /// World axes.
    #[default]
    World,
    /// Body axes.
    Body,
}
