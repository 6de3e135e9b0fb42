//! Rotors of motors that turn with a joint.

use serde::{Deserialize, Serialize};
use std::slice::from_mut as one;

fn direct() -> f64 {
    1.0
}

/// The rotor of a motor behind a gear, on a coordinate of a joint: the joint moves the inertia `ratio² inertia` besides
/// its bodies. Only the rotation against the parent counts, as usual for gears of high ratio.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rotor {
    /// Unique name.
    pub name: String,
    /// Joint.
    pub joint: String,
    /// Which of its coordinates.
    #[serde(default)]
    pub coordinate: usize,
    /// Inertia about its own axis (kg m²).
    pub inertia: f64,
    /// Rate of the rotor over the rate of the joint; for a translation in rad/m.
    #[serde(default = "direct")]
    pub ratio: f64,
}

impl Rotor {
    /// Its numbers, by the names of their fields.
    pub fn numbers(&mut self) -> Vec<(&'static str, &mut [f64])> {
        vec![("inertia", one(&mut self.inertia)), ("ratio", one(&mut self.ratio))]
    }

    /// Error in its numbers, all of them finite.
    pub fn fault(&self) -> Option<String> {
        let Self { inertia, ratio, .. } = self;
        if *inertia <= 0.0 {
            return Some(format!("inertia = {inertia}; the inertia of a rotor must be positive: remove it for none"));
        }
        (*ratio == 0.0).then(|| "ratio = 0: the rotor would stand still; remove it".to_string())
    }
}
