//! Modes: which rows act, and which forces in their place.

use crate::run::impact::OneSided;
use std::collections::{BTreeMap, BTreeSet};

/// A coordinate that is slower is at rest. Scale: natural size of the coordinate per second. Reason: far above the rounding
/// of rates, far below any motion.
pub(super) const RATE_AT_REST: f64 = 1e-9;

/// What a condition on one side bounds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Bounds {
    Position,
    Rate,
}

/// A stop or a freewheel: its event, its row in the whole mechanism, its law, and the size of what it bounds.
#[derive(Clone, Debug)]
pub(super) struct StopOf {
    pub(super) event: usize,
    pub(super) drive: String,
    pub(super) side: OneSided,
    pub(super) size: f64,
    pub(super) bounds: Bounds,
}

/// A friction that may stick: its event, its row in the whole mechanism, and its force.
#[derive(Clone, Debug)]
pub(super) struct FrictionOf {
    pub(super) event: usize,
    pub(super) drive: String,
    pub(super) row: usize,
    pub(super) force: usize,
    pub(super) name: String,
    pub(super) size: f64,
}

impl FrictionOf {
    /// Its coordinate, in its positive sense.
    pub(super) fn side(&self) -> OneSided {
        OneSided { row: self.row, sign: 1.0, restitution: 0.0, slow: 0.0 }
    }
}

/// How a friction acts; signs are those of the motion that its force resists.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum StickSlip {
    /// By a row.
    Sticks,
    /// By a force against the motion.
    Slips(i8),
    /// Other rows hold its coordinate at rest; its force is as large as it can be at rest, or zero.
    Rests(i8),
}

impl StickSlip {
    pub(super) fn sign(self) -> i8 {
        match self {
            Self::Sticks => 0,
            Self::Slips(sign) | Self::Rests(sign) => sign,
        }
    }

    /// The signs of the motion that its sliding and its static magnitude resist.
    pub(super) fn signs(self) -> [f64; 2] {
        match self {
            Self::Sticks => [0.0; 2],
            Self::Slips(sign) => [sign.into(), 0.0],
            Self::Rests(sign) => [0.0, sign.into()],
        }
    }
}

/// Which rows act.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Mode {
    /// Drives that hold in both directions.
    pub(super) locked: BTreeSet<String>,
    /// Stops that press, by their numbers.
    pub(super) pressing: BTreeSet<usize>,
    /// Stops that are closed while what is held, and what sticks, holds their coordinates, so that they need not press.
    pub(super) covered: BTreeSet<usize>,
    /// How the frictions act.
    pub(super) frictions: Vec<StickSlip>,
    /// What moves.
    pub(super) whole: Whole,
}

impl Mode {
    /// Whether a stop is closed and stays so.
    pub(super) fn rests(&self, stop: usize) -> bool {
        self.pressing.contains(&stop) || self.covered.contains(&stop)
    }
}

/// What moves, whichever rows act.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Whole {
    /// Joints that are apart.
    pub(super) parted: BTreeSet<String>,
    /// Bits of the inputs that were set.
    pub(super) inputs: BTreeMap<usize, u64>,
}

/// What a mode follows beside the events.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Own {
    /// The force of a stop.
    Press(usize),
    /// A friction at rest is about to slip in this sense, or is moved by other rows.
    Slip(usize, i8),
}
