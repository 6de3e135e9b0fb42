//! Linear combinations of stages, the work of the stepper itself.
//!
//! Every vector is padded with zeros to whole tiles of eight numbers: a tile is summed in registers over all terms of
//! a row and written once, without remainders, for a pendulum (one tile) as for a chain of a thousand loops.

/// Numbers summed together in registers.
pub(crate) const TILE: usize = 8;

/// Length of a vector of `dim` numbers with its padding.
pub(crate) fn padded(dim: usize) -> usize {
    dim.div_ceil(TILE) * TILE
}

/// Append a vector without its padding. Whole tiles are moved in registers, where a copy of a few numbers is a call.
#[inline(always)]
pub(crate) fn append(padded: &[f64], dim: usize, out: &mut Vec<f64>) {
    let end = out.len() + dim;
    padded.chunks_exact(TILE).for_each(|tile| out.extend_from_slice(tile));
    out.truncate(end);
}

/// One non-zero weight and the slot of its stage.
#[derive(Debug, Clone, Copy)]
struct Term {
    slot: usize,
    weight: f64,
}

/// The weights of one row of a tableau, zeros left out.
#[derive(Debug, Clone)]
pub(crate) struct Row {
    terms: Box<[Term]>,
}

impl Row {
    /// Row of these weights, one for each slot.
    pub(crate) fn new(weights: &[f64]) -> Self {
        let present = weights.iter().enumerate().filter(|(_, w)| **w != 0.0);
        Self { terms: present.map(|(slot, &weight)| Term { slot, weight }).collect() }
    }

    /// A row over this many slots whose weights change; all zero.
    pub(crate) fn full(slots: usize) -> Self {
        Self { terms: (0..slots).map(|slot| Term { slot, weight: 0.0 }).collect() }
    }

    /// Other weights, for a row over all slots.
    pub(crate) fn set(&mut self, weights: &[f64]) {
        self.terms.iter_mut().zip(weights).for_each(|(term, weight)| term.weight = *weight);
    }

    /// The weights of another row over the same slots.
    pub(crate) fn set_as(&mut self, other: &Self) {
        self.terms.copy_from_slice(&other.terms);
    }

    /// `Σ w_j k_j` for a tile of each stage.
    #[inline(always)]
    pub(crate) fn sum<'a>(&self, stage: impl Fn(usize) -> &'a [f64]) -> [f64; TILE] {
        let mut sum = [0.0; TILE];
        for term in &self.terms {
            let k = &stage(term.slot)[..TILE];
            for lane in 0..TILE {
                sum[lane] += term.weight * k[lane];
            }
        }
        sum
    }

    /// `Σ w_j k_j` on the tile that begins at component `at`, for stages laid one after another, `stride` numbers each.
    #[inline(always)]
    pub(crate) fn tile(&self, stages: &[f64], stride: usize, at: usize) -> [f64; TILE] {
        self.sum(|slot| &stages[slot * stride + at..])
    }

    /// `out = base + h Σ w_j k_j`, all padded. The sum comes first: it rounds at the size of the increment.
    pub(crate) fn advance(&self, stages: &[f64], h: f64, base: &[f64], out: &mut [f64]) {
        let stride = base.len();
        let tiles = base.chunks_exact(TILE).zip(out.chunks_exact_mut(TILE));
        for (i, (base, out)) in tiles.enumerate() {
            let sum = self.tile(stages, stride, i * TILE);
            for lane in 0..TILE {
                out[lane] = base[lane] + h * sum[lane];
            }
        }
    }

    /// `out = h Σ w_j k_j`, all padded.
    pub(crate) fn scaled(&self, stages: &[f64], h: f64, out: &mut [f64]) {
        let stride = out.len();
        for (i, out) in out.chunks_exact_mut(TILE).enumerate() {
            let sum = self.tile(stages, stride, i * TILE);
            for lane in 0..TILE {
                out[lane] = h * sum[lane];
            }
        }
    }
}

/// First component that is not finite. The common case, that there is none, costs one pass without branches.
pub(crate) fn first_not_finite(x: &[f64]) -> Option<usize> {
    if x.iter().fold(true, |all, v| all & v.is_finite()) {
        return None;
    }
    x.iter().position(|v| !v.is_finite())
}
