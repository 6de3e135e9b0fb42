//! Names of coordinates are composed of those of joints and bodies and must be unique.

use crate::error::DescriptionError;
use crate::spec::Spec;
use crate::zero_position::Placed;
use std::collections::HashMap;

/// Refuse joints (and loose bodies) whose coordinates would have the same name, and a joint with the name of another's
/// coordinate.
pub fn distinct(spec: &Spec, placed: &Placed) -> Result<(), DescriptionError> {
    for names in [&placed.coordinate_names, &placed.velocity_names] {
        let mut taken = HashMap::with_capacity(names.len());
        for (i, name) in names.iter().enumerate() {
            if taken.insert(name.as_str(), i).is_some() {
                return Err(clash(name, "two coordinates of the mechanism would have this name"));
            }
        }
    }
    let tree = placed.joints.iter().enumerate().filter_map(|(j, p)| p.links.as_ref().map(|links| (j, links)));
    for (owner, links) in tree {
        for link in links.iter().map(|&l| &placed.links[l]) {
            let of_q = &placed.coordinate_names[link.q..link.q + link.motion.coordinates()];
            let of_v = &placed.velocity_names[link.v..link.v + link.motion.velocities()];
            for name in of_q.iter().chain(of_v) {
                if placed.joint_numbers.get(name).is_some_and(|&j| j != owner) {
                    let of = &spec.joints[owner].name;
                    return Err(clash(name, &format!("a coordinate of joint \"{of}\" has the same name")));
                }
            }
        }
    }
    Ok(())
}

fn clash(name: &str, why: &str) -> DescriptionError {
    DescriptionError::new("joint", name, format!("{why}, so the name would be ambiguous; rename one"))
}
