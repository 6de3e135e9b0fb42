//! What functions of the state read of a joint whose coordinates are not in it.

use super::At;
use crate::error::DescriptionError;
use crate::joint::Motion;
use crate::measurement::{Maker, Measurement};
use crate::zero_position::PlacedJoint;
use partita_math::scalar::Scalar;
use partita_math::spatial::{Mat3, Space};

/// One motion of a joint that closes a loop, is described in absolute coordinates or is traversed from child to parent.
#[derive(Clone, Debug)]
pub enum CutSight<G: Space> {
    /// A translation or an angle, and its rate.
    Coordinate(Measurement<G>),
    /// A spatial rotation.
    Turn {
        /// Links of parent and child.
        links: [usize; 2],
        /// Axes of the drawing as the two carry them.
        axes: [Mat3<G::S>; 2],
    },
}

impl<G: Space> CutSight<G> {
    /// The motions of a joint in their order; none of one whose coordinates are in the state.
    pub(crate) fn all(p: &PlacedJoint, joint: &str, measurements: &Maker<G>) -> Result<Vec<Self>, DescriptionError> {
        if p.in_state().is_some() {
            return Ok(Vec::new());
        }
        let turns = p.shape.motions.contains(&Motion::Ball);
        let plain = p.shape.dof() - if turns { 3 } else { 0 };
        let mut found = Vec::with_capacity(plain + usize::from(turns));
        for i in 0..plain {
            found.push(Self::Coordinate(measurements.joint(joint, i, "force", joint)?));
        }
        if turns {
            let axes = [&p.on_parent, &p.on_child].map(|r| Mat3::from_f64(r.0));
            found.push(Self::Turn { links: measurements.links([p.parent, p.child]), axes });
        }
        Ok(found)
    }

    /// Links that are read.
    pub(crate) fn links(&self) -> Vec<usize> {
        match self {
            Self::Coordinate(reading) => reading.links.to_vec(),
            Self::Turn { links, .. } => links.to_vec(),
        }
    }

    /// How many numbers each list has of it, and whether the first is an angle whose whole turns are not counted.
    pub(crate) fn shown(&self) -> (usize, bool) {
        match self {
            Self::Coordinate(reading) => (1, reading.wraps),
            Self::Turn { .. } => (12, false),
        }
    }

    /// Positions and rates appended to the numbers in both lists, equally many. For a rotation: the cosines between the
    /// axes, row by row, with no rates, then the rates about the axes of the child, with no positions.
    pub(crate) fn show(&self, at: &At<G>, q: &mut Vec<G::S>, v: &mut Vec<G::S>) {
        let none = [G::S::zero(); 9];
        match self {
            Self::Coordinate(reading) => {
                let read = reading.read(at.tree, at.s, at.instant.q, at.instant.v);
                q.push(read.value);
                v.push(read.rate);
            }
            Self::Turn { links: [parent, child], axes: [on_parent, on_child] } => {
                let (rp, rc) = (at.axes(*parent).mul(on_parent), at.axes(*child).mul(on_child));
                q.extend(rp.transpose().mul(&rc).0.into_iter().flatten());
                v.extend(none);
                q.extend_from_slice(&none[..3]);
                v.extend(rc.apply_transposed(at.spinning(*child) - at.spinning(*parent)).0);
            }
        }
    }
}
