//! Whether a drawing fits: asked of the bodies, each by its own six coordinates, and all joints between them.
//!
//! Which joints close loops is a matter of the tree, and with it what a row is worth. Between free bodies every joint is a
//! closing, every point is measured in the same length, and every body by its centre of mass: the verdict is the same in any
//! coordinates, axes, units and order, and each [block](super::blocks) has its own.

use super::blocks::Blocks;
use super::Model;
use partita_system::drawing::{judged, Judged};
use partita_system::{ConstrainedSystem, Fit, SystemError};

impl Model {
    /// Every block by itself: what else there is, and of what size, is nothing to it.
    pub(super) fn judged_by_blocks(&self, t: f64, q: &[f64], tolerance: f64) -> Result<Option<Fit>, SystemError> {
        // between free bodies couplings may hold rates alone, which say nothing of where things are
        let whole = |parts: &Blocks| parts.blocks.iter().all(|x| x.twin.size().rows == x.twin.size().holonomic);
        let Some(parts) = self.blocks(q).filter(whole) else { return Ok(None) };
        let fits = Fit { freedoms: 0, drawn: 0, misfit: 0.0, within: true };
        let (mut all, mut within, mut beyond) = (parts.freedoms, Vec::new(), Vec::new());
        let mut is_clear = true;
        for block in parts.blocks {
            match judged(&block.twin, t, &block.q, tolerance)? {
                Judged::Fits(freedoms) => all += freedoms.saturating_sub(block.afloat),
                Judged::Unclear => is_clear = false,
                Judged::Misfits(fit) => {
                    all += fit.drawn.saturating_sub(block.afloat);
                    if fit.within { &mut within } else { &mut beyond }.push(fit);
                }
            }
        }
        // what is within the tolerance is bridged, whatever else there is that is not
        let misfits = if within.is_empty() { beyond } else { within };
        if misfits.is_empty() || !is_clear {
            return Ok(Some(fits));
        }
        let more: usize = misfits.iter().map(|x| x.freedoms - x.drawn).sum();
        let misfit = misfits.iter().fold(0.0, |m: f64, x| m.max(x.misfit));
        Ok(Some(Fit { freedoms: all + more, drawn: all, misfit, within: misfits.iter().all(|x| x.within) }))
    }
}
