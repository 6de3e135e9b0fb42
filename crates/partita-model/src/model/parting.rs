//! A mechanism some of whose joints events of a run may part, and what it is when they have.
//!
//! Where a joint may be parted it is cut, whatever the coordinates, and the plane is left to bodies that the other
//! joints keep in it. So the coordinates are the same before and after, and the rows of the joint are all that goes.

use super::{geometry, Geometry, Model};
use crate::error::DescriptionError;
use std::collections::BTreeSet;
use std::sync::Arc;

impl Model {
    /// The same mechanism in the same kind of coordinates, with these joints cut, so that a run can part them.
    ///
    /// # Errors
    /// Where it cannot be compiled.
    pub fn that_parts(&self, joints: &[String]) -> Result<Self, DescriptionError> {
        let mut spec = (*self.spec).clone();
        spec.parting.extend(joints.iter().map(|name| (name.clone(), false)));
        self.same(spec, (self.coordinates, true))
    }

    /// The mechanism without the constraints of these joints, which [`that_parts`](Self::that_parts) names, in its
    /// coordinates.
    ///
    /// # Errors
    /// Where it cannot be compiled.
    pub fn parted(&self, joints: &BTreeSet<String>) -> Result<Self, DescriptionError> {
        if let Some(permanent) = &self.permanent {
            // drives of events have no influence on the tree
            let more = self.spec.drives[permanent.spec.drives.len()..].to_vec();
            return Arc::new(permanent.parted(joints)?).with_more_drives(more);
        }
        let mut spec = (*self.spec).clone();
        for (name, apart) in &mut spec.parting {
            *apart |= joints.contains(name);
        }
        let mut made = Self::compiled(spec, self.functions(), (self.coordinates, self.is_planar()), true)?;
        let [own, before] = [&made, self].map(|model| &model.own.placed.velocity_names);
        assert_eq!(own, before, "coordinates do not depend on what is apart");
        // of less than was drawn nothing is to be repaired: what is not decided is found by the pivots of each start
        let (found, joints) = geometry::decide(&made, made.spec.drawing_tolerance);
        made.decide(Arc::new(if joints.is_none() { found } else { Geometry::default() }));
        Ok(made.with_recursion(self.preference))
    }
}
