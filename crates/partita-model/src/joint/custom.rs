//! A user-defined joint: in its axes each of three translations and three rotations is locked, free, or a function of
//! the free ones. With functions f of the free coordinates x it is a joint of the free directions and of `y`, with
//! conditions of its own, `y − f(x) = 0`, so that trees, loops and reactions treat it like a screw.

use super::{generic, Follows, Own, Shape};
use crate::error::DescriptionError;
use crate::spec::Joint;

pub(super) fn shape(joint: &Joint) -> Result<Shape, DescriptionError> {
    let fail = |m: String| Err(DescriptionError::new("joint", &joint.name, m));
    let free = joint.free.clone().unwrap_or_default();
    if joint.followers.is_empty() {
        return fail("none of its directions depends on others; use a generic joint".into());
    }
    let all = free.iter().chain(joint.followers.iter().map(|f| &f.direction)).cloned().collect();
    let shape = generic::shape(&Joint { free: Some(all), ..joint.clone() })?;
    let motion = |direction: &String| shape.names.iter().position(|name| name == direction);
    let mut inputs: Vec<usize> = free.iter().filter_map(motion).collect();
    inputs.sort_unstable();
    let own = joint.followers.iter().map(|f| {
        let motions: Vec<usize> = motion(&f.direction).into_iter().chain(inputs.iter().copied()).collect();
        Follows { motions, function: f.function }
    });
    let own: Vec<Follows> = own.collect();
    if own.iter().any(|x| x.motions.len() != 1 + free.len()) {
        return fail(
            "it rotates about all three axes, which angles cannot describe without singularities; let at most two \
             rotations be free or dependent"
                .into(),
        );
    }
    Ok(Shape { own: Some(Own::Followers(own)), ..shape })
}
