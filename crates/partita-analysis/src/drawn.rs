//! The rank of a mechanism along its motion, by what its drawing says.

use crate::geometry::Geometry;
use partita_system::drawing::bridged;
use partita_system::start::{drawn_beyond, rank_as_drawn, rank_here, rank_of_ideal, Start};
use partita_system::{ConstrainedSystem, SystemError};

/// How a mechanism is drawn, and where the drawing misfits its rank: as it was meant, or as it is drawn. A misfit belongs to
/// the drawing: it is asked once.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Drawn {
    Fits,
    /// Within the tolerance.
    Bridged(usize),
    /// By more: what misfits is a condition, even one so weak that the rank at one position would miss it.
    Beyond(usize),
}

impl Drawn {
    pub(crate) fn of(system: &Geometry, t: f64, q: &[f64]) -> Self {
        match bridged(system, t, q, system.drawing_tolerance()).ok().flatten() {
            Some(found) => Self::Bridged(found.rank),
            None => drawn_beyond(system, t, q).map_or(Self::Fits, Self::Beyond),
        }
    }

    /// The rank at a position, and the rows left out there.
    pub(crate) fn rank_at(self, system: &Geometry, t: f64, q: &[f64]) -> Result<Start, SystemError> {
        match self {
            Self::Bridged(rank) => rank_of_ideal(system, rank, t, q),
            Self::Beyond(rank) => rank_as_drawn(system, rank, t, q),
            Self::Fits => rank_here(system, t, q),
        }
    }
}
