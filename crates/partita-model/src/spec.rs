//! The description of a mechanism: plain, versioned data. World axes of the drawing, SI, radians.

use serde::{Deserialize, Serialize};

/// Version of the description that this build reads.
pub const VERSION: u32 = 1;

/// A drawing tolerance where none is said: four decimals, as drawings are dimensioned.
pub const DRAWING_TOLERANCE: f64 = 1e-4;
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
    /// How far the drawing may be off (radians, parts of lengths): what is redundant but for so much counts as redundant.
    #[serde(default = "drawing_tolerance")]
    pub drawing_tolerance: f64,
    /// Rigid bodies.
    #[serde(default)]
    pub bodies: Vec<Body>,
    /// Joints between them and the ground.
    #[serde(default)]
    pub joints: Vec<Joint>,
    /// Prescribed joint motions.
    #[serde(default)]
    pub drives: Vec<Drive>,
    /// Applied forces.
    #[serde(default)]
    pub forces: Vec<Force>,
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
    /// Hint for pictures.
    #[serde(default)]
    pub shape: Option<serde_json::Value>,
}

/// Kinds of joints.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum JointKind {
    /// One turn about an axis.
    Revolute,
    /// One slide along an axis.
    Prismatic,
    /// A slide and a turn along one axis.
    Cylindrical,
    /// Two turns about crossing axes.
    Universal,
    /// All turns.
    Spherical,
    /// Two slides in a plane and the turn in it.
    Planar,
    /// None.
    Fixed,
    /// All six.
    Free,
    /// Any subset of three slides and three turns.
    Generic,
}

/// May this joint be cut when loops are opened?
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Cut {
    /// As it suits.
    #[default]
    Auto,
    /// Wherever it closes a loop.
    Always,
    /// Only if nothing else closes the loop.
    Never,
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
    /// Where it sits (m).
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
    /// Free directions (generic): x, y, z, rx, ry, rz.
    #[serde(default)]
    pub free: Option<Vec<String>>,
    /// Where it sits on the child in an open drawing.
    #[serde(default)]
    pub child_point: Option<[f64; 3]>,
    /// Its axis on the child in an open drawing.
    #[serde(default)]
    pub child_axis: Option<[f64; 3]>,
    /// May it be cut?
    #[serde(default)]
    pub cut: Cut,
}

impl Joint {
    /// A joint of this kind between two bodies at a point, without an axis yet; where a loop is cut is left to the tree.
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
            child_point: None,
            child_axis: None,
            cut: Cut::Auto,
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
    /// Function number i of those handed along.
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

/// A prescribed joint coordinate.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Drive {
    /// Name.
    pub name: String,
    /// Which joint.
    pub joint: String,
    /// Which of its coordinates.
    #[serde(default)]
    pub coordinate: usize,
    /// Its position over time.
    pub motion: Value,
}

/// Three components, or one function for all.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(untagged)]
pub enum VectorValue {
    /// One by one.
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
        /// Their axes.
        #[serde(default)]
        axes: Axes,
    },
}

impl Force {
    /// Its name.
    pub fn name(&self) -> &str {
        match self {
            Self::Spring { name, .. }
            | Self::TorsionSpring { name, .. }
            | Self::Torque { name, .. }
            | Self::Force { name, .. } => name,
        }
    }
}
