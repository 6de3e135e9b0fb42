//! Conditions between measurements of a mechanism.

use super::{Level, Measure, Table};
use partita_math::scalar::Scalar;
use serde::{Deserialize, Serialize};
use std::slice::from_mut as one;

/// A condition between measurements.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Coupling {
    /// `Σ factor · reading = offset`.
    Linear {
        /// Name.
        name: String,
        /// Common name: gear, rack, distance, ...
        word: String,
        /// Readings.
        terms: Vec<Measure>,
        /// Their factors.
        factors: Vec<f64>,
        /// The sum.
        offset: f64,
        /// The numbers from which factors and sum were computed, if others were given.
        #[serde(rename = "said", default, skip_serializing_if = "Option::is_none")]
        given_as: Option<GivenAs>,
    },
    /// `first reading = f(second reading)`, piecewise cubic.
    Curve {
        /// Name.
        name: String,
        /// Common name: cam, coupler, ...
        word: String,
        /// The two readings.
        terms: Vec<Measure>,
        /// The curve.
        curve: Table,
        /// Whether it is periodic.
        #[serde(default)]
        periodic: bool,
    },
    /// `F(t, readings) = 0`, or at the level of velocities `Σ F_i(t, readings) · rate_i + F_t = 0`.
    Function {
        /// Name.
        name: String,
        /// Common name.
        word: String,
        /// Readings.
        terms: Vec<Measure>,
        /// Index i among the functions given.
        function: usize,
        /// Level.
        #[serde(default)]
        level: Level,
        /// The reading whose unit F has: r_0 of `r_0 - f(r_1)`.
        #[serde(default)]
        like: Option<usize>,
    },
    /// A disc or a ball that rolls on a plane.
    Roll {
        /// Name.
        name: String,
        /// The body that rolls.
        body: String,
        /// Its centre, body axes.
        center: [f64; 3],
        /// Axis of the disc, body axes; none for a ball.
        #[serde(default)]
        axis: Option<[f64; 3]>,
        /// Radius (m).
        radius: f64,
        /// Body or `ground` that carries the plane.
        on: String,
        /// A point of the plane, axes of that body.
        point: [f64; 3],
        /// Its normal, towards the centre, axes of that body.
        normal: [f64; 3],
        /// Whether it may slip. Then only contact is imposed.
        #[serde(default)]
        slips: bool,
    },
}

impl Coupling {
    /// Its name.
    pub fn name(&self) -> &str {
        match self {
            Self::Linear { name, .. }
            | Self::Curve { name, .. }
            | Self::Function { name, .. }
            | Self::Roll { name, .. } => name,
        }
    }
    /// Common name.
    pub fn word(&self) -> &str {
        match self {
            Self::Linear { word, .. } | Self::Curve { word, .. } | Self::Function { word, .. } => word,
            Self::Roll { .. } => "rolling contact",
        }
    }
    /// Its readings.
    pub fn terms(&self) -> &[Measure] {
        match self {
            Self::Linear { terms, .. } | Self::Curve { terms, .. } | Self::Function { terms, .. } => terms,
            Self::Roll { .. } => &[],
        }
    }

    /// Its parameters: field and numbers, by the names under which they were given.
    pub fn numbers(&mut self) -> Vec<(&'static str, &mut [f64])> {
        match self {
            Self::Linear { given_as: Some(GivenAs::Ratio(x)), .. } => vec![("ratio", one(x))],
            Self::Linear { given_as: Some(GivenAs::Radius(x)), .. } => vec![("radius", one(x))],
            Self::Linear { given_as: Some(GivenAs::Radii { radius1, radius2, .. }), .. } => {
                vec![("radius1", one(radius1)), ("radius2", one(radius2))]
            }
            Self::Linear { given_as: Some(GivenAs::Length), terms, offset, .. } => {
                let mut all = vec![("length", one(offset))];
                if let [Measure::Distance { point1, point2, .. }] = terms.as_mut_slice() {
                    all.extend([("point1", &mut point1[..]), ("point2", &mut point2[..])]);
                }
                all
            }
            Self::Linear { given_as: None, factors, offset, .. } => vec![("factors", factors), ("offset", one(offset))],
            Self::Roll { center, radius, point, .. } => {
                vec![("center", &mut center[..]), ("radius", one(radius)), ("point", &mut point[..])]
            }
            Self::Curve { .. } | Self::Function { .. } => Vec::new(),
        }
    }

    /// Error in its numbers, all of them finite.
    pub fn fault(&self) -> Option<String> {
        match self {
            Self::Linear { given_as: Some(given_as), terms, factors, offset, .. } => {
                given_as.fault(*offset).or_else(|| given_as.does_not_fit(terms, factors))
            }
            Self::Roll { radius, .. } if *radius <= 0.0 => {
                Some(format!("radius = {radius} m: the radius of a wheel must be positive"))
            }
            _ => None,
        }
    }
}

/// The numbers that define a sum instead of its factors: `first reading + factor · second reading = offset`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum GivenAs {
    /// A gear: the ratio of the first rate to the second.
    Ratio(f64),
    /// A rack: the displacement of the first (m) per radian of the second.
    Radius(f64),
    /// A belt from the second pulley to the first.
    Radii {
        /// Radius of the second (m).
        radius1: f64,
        /// Radius of the first (m).
        radius2: f64,
        /// Whether they rotate in opposite senses.
        crossed: bool,
    },
    /// A distance: the sum is its length (m).
    Length,
}

impl GivenAs {
    /// The second factor (the first is 1) computed from its numbers in order, over any scalar; none for a length.
    pub fn factor<S: Scalar>(self, x: &[S]) -> Option<S> {
        match (self, x) {
            (Self::Ratio(_) | Self::Radius(_), [x]) => Some(-*x),
            (Self::Radii { crossed, .. }, [radius1, radius2]) => {
                let ratio = *radius1 / *radius2;
                Some(if crossed { ratio } else { -ratio })
            }
            _ => None,
        }
    }

    /// Invalid numbers.
    fn fault(self, length: f64) -> Option<String> {
        let positive = |what: &str, x: f64| (x <= 0.0).then(|| format!("{what} = {x} m must be positive"));
        match self {
            Self::Ratio(0.0) => Some("ratio is 0: joint2 would stand still; use add_fixed instead".to_string()),
            Self::Radius(0.0) => Some("radius is 0 m: the rack would stand still".to_string()),
            Self::Ratio(_) | Self::Radius(_) => None,
            Self::Radii { radius1, radius2, .. } => {
                positive("radius1", radius1).or_else(|| positive("radius2", radius2))
            }
            Self::Length => positive("length", length),
        }
    }

    /// Factors and terms that these numbers do not produce.
    fn does_not_fit(self, terms: &[Measure], factors: &[f64]) -> Option<String> {
        let made = match self {
            Self::Ratio(x) | Self::Radius(x) => self.factor(&[x]),
            Self::Radii { radius1, radius2, .. } => self.factor(&[radius1, radius2]),
            Self::Length => None,
        };
        let fits = match (made, terms, factors) {
            (Some(made), [_, _], [first, second]) => *first == 1.0 && *second == made,
            (None, [Measure::Distance { .. }], [first]) => *first == 1.0,
            _ => false,
        };
        (!fits).then(|| format!("its description ({self:?}) does not produce its factors {factors:?}; omit `said`"))
    }
}
