//! Forces: their kinds in one list, what each has to say of itself, and the forces at points.

use super::joint_loads::{Freewheel, Friction, GasSpring, Latch, Stop, Torque, TorsionSpring};
use super::loads::{Bushing, Contact, Gravity, Law, Tyre, Weightless};
use super::{Axes, Measure, Value, VectorValue};
use serde::{Deserialize, Serialize};

/// The kinds of forces, each with its record.
macro_rules! forces {
    ($(#[doc = $doc:literal] $kind:ident($record:ident)),+ $(,)?) => {
        /// An applied force.
        #[derive(Clone, Debug, Serialize, Deserialize)]
        #[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
        pub enum Force {
            $(#[doc = $doc] $kind($record)),+
        }

        impl Force {
            /// Its record.
            pub fn record(&self) -> &dyn ForceRecord {
                match self {
                    $(Self::$kind(x) => x),+
                }
            }

            /// Its record, mutable.
            pub fn record_mut(&mut self) -> &mut dyn ForceRecord {
                match self {
                    $(Self::$kind(x) => x),+
                }
            }
        }
    };
}

forces! {
    /// Spring and damper between two points.
    Spring(Spring),
    /// Spring and damper in a joint coordinate.
    TorsionSpring(TorsionSpring),
    /// Effort along a joint coordinate.
    Torque(Torque),
    /// Force at a point of a body.
    Force(PointForce),
    /// Stiffness and damping in all directions between two frames.
    Bushing(Bushing),
    /// Friction in a joint coordinate.
    Friction(Friction),
    /// Ends of a joint coordinate.
    Stop(Stop),
    /// A joint coordinate that turns freely in one sense.
    Freewheel(Freewheel),
    /// A joint coordinate that is held from a value on.
    Latch(Latch),
    /// A gas spring in a joint coordinate.
    GasSpring(GasSpring),
    /// A sphere against a plane or a sphere.
    Contact(Contact),
    /// A rope between two points.
    Rope(Rope),
    /// A gas strut between two points.
    GasStrut(GasStrut),
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
        self.record().name()
    }

    /// The joint and its coordinate along which it acts as an effort.
    pub fn along(&self) -> Option<(&str, usize)> {
        self.record().along()
    }

    /// The joint and its coordinate on which an effort depends; by default the one along which it acts.
    pub fn over(&self) -> Option<(&str, usize)> {
        match self {
            Self::Torque(Torque { over: Some(Measure::Joint { joint, coordinate }), .. }) => Some((joint, *coordinate)),
            Self::Torque(Torque { over: Some(_), .. }) => None,
            _ => self.along(),
        }
    }

    /// Joints along whose coordinate it acts, or which it reads.
    pub fn joints(&self) -> Vec<&str> {
        let own = self.record().joints();
        self.along().into_iter().chain(self.over()).chain(own).map(|(joint, _)| joint).collect()
    }
}

/// Properties of a force: names, parameters, tables, checks.
pub trait ForceRecord {
    /// Its name.
    fn name(&self) -> &str;
    /// Bodies that it names.
    fn bodies(&self) -> Vec<&str> {
        Vec::new()
    }
    /// The bodies and the points between which it acts along their line.
    fn line(&self) -> Option<[(&str, [f64; 3]); 2]> {
        None
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
    fn numbers(&mut self) -> Vec<(&'static str, Vec<&mut f64>)> {
        Vec::new()
    }
    /// What it is, and advice, where it has more than one force at a state, of which a run alone knows from its history
    /// which one acts.
    fn set_valued(&self) -> Option<&str> {
        None
    }
    /// Of friction that may stick, in a mode of a run: the signs of the motion that its magnitudes resist.
    fn signs(&mut self) -> Option<&mut [f64; 2]> {
        None
    }
    /// Error in its numbers, all of them finite.
    fn fault(&self) -> Option<String> {
        None
    }
}

/// The properties of a record, each from a list of its fields.
macro_rules! properties {
    ($record:ident { $($property:ident $list:tt)* }) => {
        impl ForceRecord for $record {
            fn name(&self) -> &str {
                &self.name
            }
            $(properties! { @$property $list })*
        }
    };
    (@bodies [$($field:ident),*]) => {
        fn bodies(&self) -> Vec<&str> {
            vec![$(&self.$field),*]
        }
    };
    (@line [$body1:ident $point1:ident, $body2:ident $point2:ident]) => {
        properties! { @bodies [$body1, $body2] }
        fn line(&self) -> Option<[(&str, [f64; 3]); 2]> {
            Some([(&self.$body1, self.$point1), (&self.$body2, self.$point2)])
        }
    };
    (@along [$joint:ident $coordinate:ident]) => {
        fn along(&self) -> Option<(&str, usize)> {
            Some((&self.$joint, self.$coordinate))
        }
    };
    (@values [$field:ident]) => {
        fn values(&self) -> Vec<&Value> {
            self.$field.values()
        }
    };
    (@numbers [$($field:ident),*]) => {
        fn numbers(&mut self) -> Vec<(&'static str, Vec<&mut f64>)> {
            let all = [$((stringify!($field), self.$field.numbers())),*];
            all.into_iter().filter(|(_, x)| !x.is_empty()).collect()
        }
    };
    (@checks [$($check:ident($($field:ident),+)),*]) => {
        fn fault(&self) -> Option<String> {
            None$(.or_else(|| $check(&[$((stringify!($field), self.$field)),+])))*
        }
    };
    (@set_valued $method:ident) => {
        fn set_valued(&self) -> Option<&str> {
            self.$method()
        }
    };
    (@fault $method:ident) => {
        fn fault(&self) -> Option<String> {
            self.$method()
        }
    };
}
pub(super) use properties;

/// A field with numbers that may be parameters: none of them if one is a table, a function or left out.
pub(super) trait Numbers {
    fn numbers(&mut self) -> Vec<&mut f64>;
}

impl Numbers for f64 {
    fn numbers(&mut self) -> Vec<&mut f64> {
        vec![self]
    }
}

impl<T: Numbers, const N: usize> Numbers for [T; N] {
    fn numbers(&mut self) -> Vec<&mut f64> {
        self.iter_mut().flat_map(T::numbers).collect()
    }
}

impl<T: Numbers> Numbers for Option<T> {
    fn numbers(&mut self) -> Vec<&mut f64> {
        self.as_mut().map_or_else(Vec::new, T::numbers)
    }
}

impl Numbers for Value {
    fn numbers(&mut self) -> Vec<&mut f64> {
        match self {
            Self::Constant(x) => vec![x],
            Self::Table(_) | Self::Function(_) => Vec::new(),
        }
    }
}

impl Numbers for VectorValue {
    fn numbers(&mut self) -> Vec<&mut f64> {
        match self {
            Self::Components(all) if all.iter().all(|x| matches!(x, Value::Constant(_))) => all.numbers(),
            _ => Vec::new(),
        }
    }
}

impl Value {
    pub(super) fn values(&self) -> Vec<&Self> {
        vec![self]
    }
}

impl VectorValue {
    pub(super) fn values(&self) -> Vec<&Value> {
        match self {
            Self::Components(all) => all.iter().collect(),
            Self::Whole(one) => vec![one],
        }
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

/// The first of these numbers that must be above one and is not.
pub(super) fn not_above_one(all: &[(&str, f64)]) -> Option<String> {
    all.iter().find(|x| x.1 <= 1.0).map(|(what, x)| format!("{what} = {x} must be greater than 1"))
}

/// The first of these vectors that is zero.
pub(super) fn no_direction(all: &[(&str, [f64; 3])]) -> Option<String> {
    all.iter().find(|x| x.1 == [0.0; 3]).map(|(what, x)| format!("{what} = {x:?} has no direction"))
}

/// The first of these powers of a depth with which a force begins too steeply.
pub(super) fn too_steep(all: &[(&str, f64)]) -> Option<String> {
    all.iter().find(|x| x.1 < 1.0).map(|(what, x)| {
        format!("{what} = {x} would make a contact infinitely stiff at its first touch; give 1 or more")
    })
}

/// A force at a point of a body.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PointForce {
    /// Name.
    pub name: String,
    /// Body.
    pub body: String,
    /// Point in body axes.
    pub point: [f64; 3],
    /// Components.
    pub value: VectorValue,
    /// Axes of the components.
    #[serde(default)]
    pub axes: Axes,
}

properties! { PointForce { bodies [body] values [value] numbers [point, value] } }

/// A spring and damper between two points.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spring {
    /// Name.
    pub name: String,
    /// First body or `ground`.
    pub body1: String,
    /// Point on it, body axes.
    pub point1: [f64; 3],
    /// Second body or `ground`.
    pub body2: String,
    /// Point on it, body axes.
    pub point2: [f64; 3],
    /// [N/m].
    pub stiffness: f64,
    /// [N s/m].
    pub damping: f64,
    /// Free length (m).
    pub length: f64,
}

properties! { Spring { line [body1 point1, body2 point2] numbers [stiffness, damping, length, point1, point2] } }

/// A rope between two points of two bodies.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rope {
    /// Name.
    pub name: String,
    /// First body or `ground`.
    pub body1: String,
    /// Point on it, body axes.
    pub point1: [f64; 3],
    /// Second body or `ground`.
    pub body2: String,
    /// Point on it, body axes.
    pub point2: [f64; 3],
    /// Length without tension (m).
    pub length: f64,
    /// Tension at a unit of stretch.
    pub stiffness: f64,
    /// Power of the stretch.
    #[serde(default = "straight")]
    pub exponent: f64,
    /// Growth of the tension with the speed of stretching [s/m].
    #[serde(default)]
    pub damping: f64,
    /// Coefficient of restitution, of a rope that does not stretch, whose stiffness is 0: a run holds it by a row.
    #[serde(default)]
    pub restitution: Option<f64>,
}

fn straight() -> f64 {
    1.0
}

properties! { Rope {
    line [body1 point1, body2 point2]
    numbers [point1, point2, length, stiffness, damping, restitution]
    set_valued rigid
    fault misjudged
} }

impl Rope {
    fn rigid(&self) -> Option<&str> {
        self.restitution.map(|_| "a rope that does not stretch (restitution): give it a stiffness")
    }
    fn misjudged(&self) -> Option<String> {
        let rigid = self.restitution.and_then(|e| match () {
            () if !(0.0..=1.0).contains(&e) => Some(format!("restitution = {e} must lie between 0 and 1")),
            () if self.stiffness != 0.0 => Some("a rope that does not stretch (restitution) has no stiffness".into()),
            () => None,
        });
        rigid
            .or_else(|| without_size(&[("length", self.length)]))
            .or_else(|| negative(&[("stiffness", self.stiffness), ("damping", self.damping)]))
            .or_else(|| too_steep(&[("exponent", self.exponent)]))
    }
}

/// A gas strut between two points of two bodies: it pushes them apart.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GasStrut {
    /// Name.
    pub name: String,
    /// First body or `ground`.
    pub body1: String,
    /// Point on it, body axes.
    pub point1: [f64; 3],
    /// Second body or `ground`.
    pub body2: String,
    /// Point on it, body axes.
    pub point2: [f64; 3],
    /// Force at its full length (N).
    pub force: f64,
    /// Force at full compression over that.
    pub progression: f64,
    /// From its full length to full compression (m).
    pub stroke: f64,
    /// Full length (m).
    pub length: f64,
    /// Exponent of the polytropic change of state.
    pub exponent: f64,
    /// [N s/m].
    #[serde(default)]
    pub damping: f64,
    /// Of the stops at both ends of the stroke [N/m]; none: no stops.
    #[serde(default)]
    pub end_stiffness: Option<f64>,
}

properties! { GasStrut {
    line [body1 point1, body2 point2]
    numbers [point1, point2, force, progression, stroke, length, damping, end_stiffness]
    fault inconsistent
} }

impl GasStrut {
    fn inconsistent(&self) -> Option<String> {
        let (stroke, length) = (self.stroke, self.length);
        without_size(&[("force", self.force), ("stroke", stroke)])
            .or_else(|| not_above_one(&[("progression", self.progression), ("exponent", self.exponent)]))
            .or_else(|| negative(&[("damping", self.damping), ("end_stiffness", self.end_stiffness.unwrap_or(0.0))]))
            .or_else(|| (stroke >= length).then(|| format!("stroke = {stroke} is not below length = {length}")))
    }
}
