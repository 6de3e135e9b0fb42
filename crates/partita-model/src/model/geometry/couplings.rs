//! A drawing with couplings, decided in stages: its joints alone, then with the conditions on positions, then with those
//! on rates.
//!
//! The frames of joints are repaired, couplings are not. A loop of joints therefore has its own decision first: what a
//! wheel, a contact or a rod adds to it must not make its geometric error a condition.                             (T3)

use super::change::{largest, OWN};
use super::{by_blocks, closed, coarsest, BlockDecision, Decided, Drawing, Wanted};
use crate::model::Model;
use crate::spec::{Coupling, Joint, Spec};
use crate::value::Functions;
use partita_system::prelude::*;
use partita_system::rank::pivots;
use partita_system::SystemError;
use std::sync::Arc;

/// The decision about one block.
pub(super) fn judged(spec: &Spec, functions: Arc<dyn Functions>, floats: bool, wanted: Wanted) -> Decided {
    let undecided = || Decided::plain(BlockDecision::Undecided, None);
    let Some(drawing) = Drawing::new(spec.clone(), functions.clone(), None, true) else { return undecided() };
    if let Some(decided) = drawing.settled(drawing.afloat(floats), wanted.0) {
        return decided;
    }
    // first, for without them nothing else moves: bearings on one axis
    if let Some((laid, numbers)) = drawing.bearings(wanted.0) {
        let joints = &laid.model.spec.joints;
        let decided =
            in_stages(&Spec { joints: joints.clone(), ..spec.clone() }, (functions.clone(), floats), wanted, true);
        if decided.dof.is_some_and(|k| k > 0) || decided.ambiguous.is_some() {
            return decided.after(numbers, drawing.length, &drawing.model.spec, joints);
        }
    }
    in_stages(spec, (functions, floats), wanted, true)
}

/// One block. Where it has couplings, what is without them is decided first, and repaired once: then it is another
/// drawing.
fn in_stages(spec: &Spec, of: (Arc<dyn Functions>, bool), wanted: Wanted, repair: bool) -> Decided {
    let undecided = || Decided::plain(BlockDecision::Undecided, None);
    let Some(drawing) = Drawing::new(spec.clone(), of.0.clone(), None, true) else { return undecided() };
    let own = drawing.afloat(of.1);
    if let Some(decided) = drawing.settled(own, wanted.0) {
        return decided;
    }
    let Some(inner) = drawing.inner(of.0.clone(), wanted.0) else { return drawing.whole(own, wanted) };
    if let Some(ambiguous) = inner.ambiguous {
        return ambiguous;
    }
    if let Some((numbers, joints)) = inner.repaired.filter(|_| repair) {
        let decided = in_stages(&Spec { joints: joints.clone(), ..spec.clone() }, of, wanted, false);
        return decided.after(numbers, drawing.length, &drawing.model.spec, &joints);
    }
    // a larger tolerance than the drawing's would change its joints, and no coupling
    let as_drawn = wanted.0.min(spec.drawing_tolerance);
    match drawing.on_top(own, inner.rank, as_drawn) {
        Ok(Some(decided)) => decided,
        _ => drawing.whole(own, (as_drawn, wanted.1)),
    }
}

/// A drawing without some of its couplings.
pub(super) struct Inner {
    /// Its rank over a finite motion, where that is decided.
    pub(super) rank: Option<usize>,
    /// A block that is ambiguous by itself.
    pub(super) ambiguous: Option<Decided>,
    /// The change of joint frames that repairs it, in fractions of the length of the whole drawing, and its joints.
    pub(super) repaired: Option<(Vec<f64>, Vec<Joint>)>,
}

impl Drawing {
    /// The decision about the next simpler drawing; none where there are no couplings.
    pub(super) fn inner(&self, functions: Arc<dyn Functions>, tolerance: f64) -> Option<Inner> {
        let spec = simpler(&self.model)?;
        let model = Self::new(spec, functions, Some(self.length), self.model.is_planar())?.model;
        if model.is_planar() != self.model.is_planar() {
            return None;
        }
        let (blocks, dof) = by_blocks(&model, tolerance);
        let mut inner = Inner {
            rank: dof.map(|k| model.size().nv.saturating_sub(k)),
            ambiguous: blocks.iter().find(|x| x.1.ambiguous.is_some()).map(|x| x.1.clone()),
            repaired: None,
        };
        let (mut numbers, mut joints) = (vec![0.0; OWN * model.spec.joints.len()], model.spec.joints.clone());
        for (block, decided) in blocks.iter().filter(|x| x.1.verdict == BlockDecision::Repaired) {
            for (k, &j) in block.joints.iter().enumerate() {
                decided.apply(k, &block.spec.joints[k], &mut joints[j]);
                let Some(change) = decided.numbers.get(k * OWN..(k + 1) * OWN) else { continue };
                for (i, (to, x)) in numbers[j * OWN..(j + 1) * OWN].iter_mut().zip(change).enumerate() {
                    *to = if i % (OWN / 2) < 3 { x * decided.length / self.length } else { *x };
                }
            }
        }
        if largest(&numbers) > 0.0 {
            inner.repaired = Some((numbers, joints));
        }
        Some(inner)
    }

    /// The decision where the simpler drawing has this rank, here as along its motion, and all that it leaves out is
    /// independent of it and of each other. None where not.
    pub(super) fn on_top(
        &self,
        own: usize,
        rank: Option<usize>,
        tolerance: f64,
    ) -> Result<Option<Decided>, SystemError> {
        let (model, size, level) = (&self.model, self.model.size(), coarsest(tolerance));
        let (Some(rank), Some(q)) = (rank, closed(model, level)) else { return Ok(None) };
        let left_out = |i: usize| match self.is_holonomic() {
            true => model.coupling_of_row(i).is_some(),
            false => i >= size.holonomic,
        };
        let kept = pivots(model, 0.0, &q, &left_out)?;
        let added = (0..size.rows).filter(|&i| left_out(i)).count();
        let clear = kept.iter().filter(|x| left_out(x.0) && x.1 > level * level).count() == added;
        if !clear || kept.len() != rank + added {
            return Ok(None);
        }
        let verdict = if kept.len() == size.rows { BlockDecision::Regular } else { BlockDecision::Redundant };
        Ok(Some(Decided::with(verdict, (size.nv - kept.len()).saturating_sub(own), &kept)))
    }
}

/// Without the conditions on rates if there are some, else without couplings; none where nothing remains to be left out.
fn simpler(model: &Model) -> Option<Spec> {
    let spec = &*model.spec;
    if spec.couplings.is_empty() {
        return None;
    }
    let positions: Vec<usize> = (0..model.size().holonomic).filter_map(|i| model.coupling_of_row(i)).collect();
    let holonomic = model.size().rows == model.size().holonomic;
    let left = |(i, c): (usize, &Coupling)| {
        let mut c = c.clone();
        if let Coupling::Roll { slips, .. } = &mut c {
            *slips = true;
        }
        positions.contains(&i).then_some(c)
    };
    let couplings = match holonomic {
        true => Vec::new(),
        false => spec.couplings.iter().enumerate().filter_map(left).collect(),
    };
    Some(Spec { couplings, ..spec.clone() })
}
