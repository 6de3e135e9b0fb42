//! Conditions on rates (rolling) that nearly follow from the others, and whether they were intended to.

use super::{closed, coarsest, BlockDecision, Decided, Drawing, Model, LARGEST_CHANGE, WEAK_CONDITION};
use crate::tree::LinkMotion;
use partita_math::dense::Matrix;
use partita_math::factor::qr_null_space_by;
use partita_math::tolerance;
use partita_system::prelude::*;
use partita_system::rank::{exact, pivots, Exact};
use partita_system::SystemError;

impl Drawing {
    /// The decision about conditions on rates in a drawing. A row that remains after all the others opposes one more
    /// motion V of theirs; its slip in V, as a fraction of the speed of contacts, is the error of an axis or a radius.
    ///                                                                                                          (T4)
    pub(super) fn rates(&self, own: usize, tolerance: f64) -> Result<Decided, SystemError> {
        let model = &self.model;
        let size = model.size();
        let open = || Ok(Decided::plain(BlockDecision::Undecided, None));
        let Some(q) = closed(model, coarsest(tolerance)) else { return open() };
        let kept = pivots(model, 0.0, &q, &|i| i >= size.holonomic)?;
        let (mut phi, mut a) = (vec![0.0; size.holonomic], vec![0.0; size.rows]);
        let mut c = vec![0.0; model.pattern().nnz()];
        model.position(0.0, &q, &mut model.scratch(), &mut phi, &mut c, &mut a)?;
        let limit = LARGEST_CHANGE * tolerance;
        let weak = |x: &(usize, f64)| x.0 >= size.holonomic && x.1 <= WEAK_CONDITION * WEAK_CONDITION;
        for (i, x) in kept.iter().enumerate().filter(|x| weak(x.1)) {
            let before: Vec<usize> = kept[..i].iter().map(|x| x.0).collect();
            let slip = slip(model, &c, &before, x.0);
            if slip > tolerance::TAKES_PART && slip <= limit {
                return Ok(Decided::ambiguous(model, x.0));
            }
            if slip <= limit {
                return open();
            }
        }
        if kept.len() == size.rows {
            return Ok(Decided::with(BlockDecision::Regular, (size.nv - size.rows).saturating_sub(own), &kept));
        }
        // the others are conditions, however weak
        Ok(match exact(model, 0.0, &q, tolerance::DEPENDENT)? {
            Exact::Redundant(dof, _) => Decided::with(BlockDecision::Redundant, dof.saturating_sub(own), &kept),
            Exact::Regular(..) | Exact::Open => Decided::plain(BlockDecision::Undecided, None),
        })
    }
}

/// Slip of a contact, as a fraction of the fastest contact's speed, in the motion that its `row` opposes and the rows
/// `before` it do not.
fn slip(model: &Model, c: &[f64], before: &[usize], row: usize) -> f64 {
    let (pattern, n) = (model.pattern(), model.size().nv);
    let displacement: Vec<f64> = model.structure().displacements().collect();
    let of = |i: usize| {
        let mut all = vec![0.0; n];
        pattern.row(i).for_each(|e| all[pattern.col_idx[e]] = c[e] * displacement[pattern.col_idx[e]]);
        all
    };
    let mut others = Matrix::new(before.len(), n);
    for (k, &i) in before.iter().enumerate() {
        let all = of(i);
        let length = all.iter().map(|x| x * x).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
        others.row_mut(k).iter_mut().zip(&all).for_each(|(x, y)| *x = y / length);
    }
    // rows that were kept are independent, and as many as there are
    let Ok(free) = qr_null_space_by(&others, &mut |pivots| pivots.len()) else { return f64::INFINITY };
    let own = of(row);
    let mut v = vec![0.0; n];
    for k in 0..free.null.cols() {
        let part: f64 = (0..n).map(|i| free.null[(i, k)] * own[i]).sum();
        (0..n).for_each(|i| v[i] += part * free.null[(i, k)]);
    }
    let mut is_slide = vec![false; n];
    let slides = model.own.full.links.iter().skip(1).filter(|l| matches!(l.motion, LinkMotion::Slide(_)));
    slides.for_each(|l| is_slide[l.v] = true);
    let rate: f64 = own.iter().zip(&v).map(|(c, v)| c * v).sum();
    // speeds at contacts by translations, and by rotations with their arms
    let speed = |i: usize| {
        let mut by = [(0.0f64, 0.0f64); 2];
        for e in pattern.row(i) {
            let j = pattern.col_idx[e];
            let most = &mut by[usize::from(is_slide[j])];
            *most = (most.0.max(c[e].abs()), most.1.max((v[j] * displacement[j]).abs()));
        }
        by.iter().fold(0.0, |m: f64, x| m.max(x.0 * x.1))
    };
    let fastest = (model.size().holonomic..model.size().rows).map(speed).fold(0.0, f64::max);
    match fastest > 0.0 {
        true => rate.abs() / fastest,
        false => f64::INFINITY,
    }
}
