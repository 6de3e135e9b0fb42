//! Rotors in the zero position: on the coordinate of a joint in the tree, else on a link of their own.

use crate::error::DescriptionError;
use crate::joint::Motion;
use crate::measurement;
use crate::spec::{Measure, Rotor, Spec};
use crate::zero_position::{Placed, PlacedLink, PlacedRotor};
use partita_math::spatial::Vec3;

/// The coordinate with which a rotor turns.
pub(crate) fn measure(r: &Rotor) -> Measure {
    Measure::joint(r.joint.as_str(), r.coordinate)
}

/// Place the rotors of a description. A rotor on a joint that closes a loop spins about an axis of the ground: as its
/// inertia counts along its own rotation alone, it could be anywhere.
pub(crate) fn place(placed: &mut Placed, spec: &Spec) -> Result<(), DescriptionError> {
    for r in &spec.rotors {
        let turning = measure(r);
        measurement::known(&turning, placed, "rotor", &r.name)?;
        let at = placed.joint_numbers.get(&r.joint).and_then(|&j| placed.coordinate(j, r.coordinate));
        if let Some((_, v)) = at {
            placed.rotors.push(PlacedRotor { v, link: None });
            continue;
        }
        let (q, v) = (placed.nq, placed.nv);
        let motion = match measurement::is_angle(placed, &turning) {
            true => Motion::Turn(Vec3([0.0, 0.0, 1.0])),
            false => Motion::Slide(Vec3([1.0, 0.0, 0.0])),
        };
        placed.links.push(PlacedLink { parent: 0, motion, point: Vec3::zero(), q, v });
        placed.rotors.push(PlacedRotor { v, link: Some(placed.links.len() - 1) });
        placed.coordinate_names.push(r.name.clone());
        placed.velocity_names.push(r.name.clone());
        (placed.nq, placed.nv) = (q + 1, v + 1);
    }
    Ok(())
}
