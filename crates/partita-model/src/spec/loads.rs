//! Forces between frames and surfaces of bodies, laws, weight.

use super::forces::{negative, no_direction, properties, too_steep, without_size, ForceRecord, Numbers};
use super::{Value, VectorValue};
use partita_math::tolerance;
use serde::{Deserialize, Serialize};

/// Stiffness and damping in all six directions between two frames.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bushing {
    /// Name.
    pub name: String,
    /// First body or `ground`: in its frame stiffness and damping are given.
    pub body1: String,
    /// Origin of its frame, body axes.
    pub point1: [f64; 3],
    /// Axes of its frame in body axes (columns).
    pub frame1: [[f64; 3]; 3],
    /// Second body or `ground`.
    pub body2: String,
    /// Origin of its frame, body axes.
    pub point2: [f64; 3],
    /// Axes of its frame in body axes (columns).
    pub frame2: [[f64; 3]; 3],
    /// Displacements before rotations [N/m, N, N/rad, N m/rad].
    pub stiffness: Box<[[f64; 6]; 6]>,
    /// [N s/m, ...].
    pub damping: Box<[[f64; 6]; 6]>,
}

properties! { Bushing { bodies [body1, body2] numbers [point1, point2, stiffness, damping] fault turned } }

impl Bushing {
    fn turned(&self) -> Option<String> {
        let both = [("frame1", &self.frame1), ("frame2", &self.frame2)];
        both.into_iter().find_map(|(what, f)| {
            let column = |j: usize| [f[0][j], f[1][j], f[2][j]];
            let dot = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
            let (x, y, z) = (column(0), column(1), column(2));
            let third = [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]];
            let off = [dot(x, x) - 1.0, dot(y, y) - 1.0, dot(x, y), dot(third, z) - 1.0, dot(z, z) - 1.0];
            let fits = off.iter().all(|x| x.abs() < tolerance::EQUAL);
            (!fits).then(|| format!("{what} is not a rotation; orthogonalise it"))
        })
    }
}

fn three_halves() -> f64 {
    1.5
}

/// A sphere on one body against a plane or a sphere on another.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Contact {
    /// Name.
    pub name: String,
    /// Body of the sphere.
    pub body1: String,
    /// Its centre, body axes.
    pub point1: [f64; 3],
    /// Its radius; 0 is a point.
    pub radius1: f64,
    /// Other body or `ground`.
    pub body2: String,
    /// A point of the plane, or the centre of the other sphere, body axes.
    pub point2: [f64; 3],
    /// Normal of the plane, towards the free side, body axes.
    #[serde(default)]
    pub normal: Option<[f64; 3]>,
    /// Radius of the other sphere.
    #[serde(default)]
    pub radius2: Option<f64>,
    /// Force at a unit of depth.
    pub stiffness: f64,
    /// Power of the depth.
    #[serde(default = "three_halves")]
    pub exponent: f64,
    /// Growth of the force with the speed inward [s/m].
    #[serde(default)]
    pub damping: f64,
    /// Kinetic coefficient of friction.
    #[serde(default)]
    pub friction: f64,
    /// Static coefficient of friction.
    #[serde(default)]
    pub static_friction: f64,
    /// Stick velocity [m/s].
    pub stick_velocity: f64,
    /// Coefficient of restitution, of a rigid contact, whose stiffness is 0: a run holds it by a row.
    #[serde(default)]
    pub restitution: Option<f64>,
}

properties! { Contact {
    bodies [body1, body2]
    numbers [point1, radius1, point2, stiffness, damping, friction, static_friction, stick_velocity, radius2, restitution]
    set_valued rigid
    fault misplaced
} }

impl Contact {
    fn rigid(&self) -> Option<&str> {
        self.restitution.map(|_| "a rigid contact (restitution): give it a stiffness")
    }
    fn misplaced(&self) -> Option<String> {
        if let Some(e) = self.restitution.filter(|e| !(0.0..=1.0).contains(e)) {
            return Some(format!("restitution = {e} must lie between 0 and 1"));
        }
        if self.restitution.is_some() && (self.stiffness != 0.0 || self.friction != 0.0) {
            return Some("a rigid contact (restitution) has neither a stiffness nor friction".into());
        }
        let radius = || negative(&[("radius1", self.radius1)]);
        let against = match (self.normal, self.radius2) {
            (Some(normal), None) => radius().or_else(|| no_direction(&[("normal", normal)])),
            (None, Some(other)) => radius().or_else(|| without_size(&[("radius2", other)])),
            _ => Some("the other side is a plane (normal) or a sphere (radius2), one of the two".into()),
        };
        against
            .or_else(|| {
                negative(&[
                    ("stiffness", self.stiffness),
                    ("damping", self.damping),
                    ("friction", self.friction),
                    ("static_friction", self.static_friction),
                ])
            })
            .or_else(|| without_size(&[("stick_velocity", self.stick_velocity)]))
            .or_else(|| too_steep(&[("exponent", self.exponent)]))
    }
}

/// A disc on a body that rolls on a plane.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tyre {
    /// Name.
    pub name: String,
    /// Body of the wheel.
    pub body: String,
    /// Centre of the wheel, body axes.
    pub center: [f64; 3],
    /// Its axis, body axes.
    pub axis: [f64; 3],
    /// Its free radius.
    pub radius: f64,
    /// Body of the road, or `ground`.
    pub ground: String,
    /// A point of the road, body axes.
    pub point: [f64; 3],
    /// Normal of the road, upward, body axes.
    pub normal: [f64; 3],
    /// Force at a unit of depth [N/m].
    pub stiffness: f64,
    /// Growth of the force with the speed inward [s/m].
    #[serde(default)]
    pub damping: f64,
    /// Coefficient of friction that slip forces approach.
    #[serde(default)]
    pub friction: f64,
    /// Force for a unit of slip along the wheel (N).
    #[serde(default)]
    pub longitudinal: f64,
    /// Force for a unit of slip across it (N).
    #[serde(default)]
    pub lateral: f64,
    /// Speed below which slip is computed as at this speed [m/s].
    pub slow_speed: f64,
}

properties! { Tyre {
    bodies [body, ground]
    numbers [center, radius, point, stiffness, damping, friction, longitudinal, lateral, slow_speed]
    checks [
        without_size(radius, slow_speed),
        no_direction(axis, normal),
        negative(stiffness, damping, friction, longitudinal, lateral)
    ]
} }

/// A reading of a force law.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum Sight {
    /// Position and velocity of a point of a body, world axes.
    Point(Spot),
    /// Position, orientation (row by row), velocity of the origin and angular velocity of a body, world axes.
    Body(String),
    /// Position and rate of a joint's coordinate.
    Joint(String, usize),
}

/// A point of a body.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spot {
    /// The body.
    pub body: String,
    /// Point in body axes.
    pub point: [f64; 3],
}

/// Forces and moments computed by a function of its readings.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Law {
    /// Name.
    pub name: String,
    /// A function of t and of all readings, one after the other; three forces and three moments for each of `on`.
    pub value: Value,
    /// Its readings.
    pub sees: Vec<Sight>,
    /// Where it acts.
    pub on: Vec<Spot>,
}

impl ForceRecord for Law {
    fn name(&self) -> &str {
        &self.name
    }
    fn bodies(&self) -> Vec<&str> {
        let seen = self.sees.iter().filter_map(|s| match s {
            Sight::Point(p) => Some(p.body.as_str()),
            Sight::Body(name) => Some(name.as_str()),
            Sight::Joint(..) => None,
        });
        seen.chain(self.on.iter().map(|p| p.body.as_str())).collect()
    }
    fn joints(&self) -> Vec<(&str, usize)> {
        let joint = |s| match s {
            &Sight::Joint(ref name, i) => Some((name.as_str(), i)),
            Sight::Point(_) | Sight::Body(_) => None,
        };
        self.sees.iter().filter_map(joint).collect()
    }
    fn fault(&self) -> Option<String> {
        match (self.on.as_slice(), &self.value) {
            ([], _) => Some("it acts on nothing; name a point of a body".into()),
            (_, Value::Function(_)) => None,
            _ => Some("its value is not a function; use a force for a number or a table".into()),
        }
    }
    fn values(&self) -> Vec<&Value> {
        vec![&self.value]
    }
}

/// A body without gravity.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Weightless {
    /// Name.
    pub name: String,
    /// The body.
    pub body: String,
}

properties! { Weightless { bodies [body] } }

/// Time-dependent gravity, in addition to the constant one.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gravity {
    /// Name.
    pub name: String,
    /// Acceleration, world axes [m/s²].
    pub value: VectorValue,
}

properties! { Gravity { values [value] } }
