//! The mechanism as it was meant: of all drawings that fit, the one nearest to the one that was made.
//!
//! Between free bodies every joint is a closing. Its frame on either body may sit a little off, by p (displacements over the
//! mechanism's length, and turns): along the motion of the mechanism as it was meant each self-stress n asks for
//!
//! ```text
//! nᵀ (Φ + J p) = 0,   J = C times the motion of the body that carries the frame
//! ```
//!
//! and the shortest p that satisfies all of them is the least change of the drawing. What opens by rounding then, opens by
//! rounding elsewhere. No joint is changed by more than the tolerance: what it takes more to mend is another mechanism.

mod lengths;

use super::Model;
use crate::place::{alignment, Coordinates};
use crate::spec::{Joint, Spec};
use crate::tree::TreeScratch;
use lengths::{Alike, Condition};
use partita_math::dense::Matrix;
use partita_math::factor::svd;
use partita_math::spatial::{Mat3, Quaternion, Spatial, Vec3};
use partita_system::drawing::{fit, judged, openings, redundant, Judged, Place, Said};
use partita_system::{ConstrainedSystem, SystemError};

/// Products of a decomposition beyond which nothing is sought: it would take longer than the run.
const LARGEST: usize = 150_000_000;
/// Changes of the drawing: each is quadratically better than the one before, from 1e-4 to rounding in three or four.
const ROUNDS: usize = 10;
/// What opens by less, in parts of sizes, is rounding.
const FITS: f64 = 1e-13;
/// ... and less than this cannot be had.
const ROUNDING: f64 = 1e-15;
/// Axes that are parallel within so many tolerances were meant to be.
const PARALLEL: f64 = 3.0;
/// Singular values below these parts of the largest say nothing, tried in turn: those of a drawing that misfits are off by some
/// hundred misfits.
const NOTHING: [f64; 5] = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6];
/// Where the drawing fits, those that say something are so many times those that do not.
const CLEAR: f64 = 1e3;
/// ... which are less than this.
const WEAK: f64 = 1e-6;
/// A fit that rests on singular values of less than this may be near a double root...
const SURE: f64 = 1e-4;
/// ... where some of those that say nothing are this part of the change that is left, or more (a tenth to a thousand times)...
const DOUBLE: f64 = 1e-2;
/// ... which is less than this, or what opens would show it.
const LEFT: f64 = 1e-5;
/// What is off by less was rounded.
const ROUNDED: f64 = 1e-14;
/// Numbers of a joint: displacement and turn on either side.
const OWN: usize = 12;
/// Each joint may be changed by so many tolerances, on both sides together: one in its point and one in its axis on either side,
/// and what it takes over from others.
const EACH: f64 = 3.0;

/// A mechanism as it was meant, and by how much its drawing was off.
pub struct Meant {
    /// The mechanism.
    pub model: Model,
    /// The joint that was changed most.
    pub joint: usize,
    /// The largest displacement of a joint on a body (m).
    pub shift: f64,
    /// Its largest turn (rad).
    pub turn: f64,
}

/// A change of the drawing by which it fits.
struct Change {
    numbers: Vec<f64>,
    /// The smallest singular value that was taken to say something, in parts of the largest.
    least: f64,
    /// Those that say nothing.
    weak: Vec<f64>,
}

impl Change {
    /// Is no joint changed by more than a few tolerances?
    fn is_small(&self, tolerance: f64) -> bool {
        self.numbers.chunks(OWN).all(|x| of_joint(x) <= EACH * tolerance)
    }

    /// Is what opens a double root in lengths that are `off` by so much? They say something then where they are off.
    fn is_double(&self, off: f64) -> bool {
        self.least < SURE || off < LEFT && self.weak.iter().any(|s| *s > (DOUBLE * off).max(ROUNDED))
    }
}

/// A step towards the drawing that fits.
struct Nearer {
    change: Vec<f64>,
    /// The smallest singular value that says something, and the largest that does not, in parts of the largest.
    gap: (f64, f64),
    /// Those that certainly say nothing.
    weak: Vec<f64>,
}

impl Nearer {
    fn is_clear(&self) -> bool {
        self.gap.0 > CLEAR * self.gap.1
    }
}

impl Model {
    /// The same mechanism, its joints moved by no more than the drawing tolerance so that it fits: found where it was drawn, or
    /// else at q. None where it fits as it is drawn, where the drawing does not say what was meant, or misfits by more.
    ///
    /// Cost: some hundred evaluations, and dense decompositions, where the drawing misfits.
    ///
    /// # Errors
    /// Where nothing can be evaluated at (t, q).
    pub fn as_meant(&self, t: f64, q: &[f64]) -> Result<Option<Meant>, SystemError> {
        if self.held_words().is_some() {
            return Ok(None);
        }
        // the position that was drawn is the same for all runs: one that goes on where another ended is of the same drawing
        let drawn = self.initial();
        if drawn != q {
            if let Ok(Some(meant)) = self.as_meant_at(t, &drawn) {
                return Ok(Some(meant));
            }
        }
        self.as_meant_at(t, q)
    }

    fn as_meant_at(&self, t: f64, q: &[f64]) -> Result<Option<Meant>, SystemError> {
        let tolerance = self.spec.drawing_tolerance;
        let misfits = match fit(self, t, q, tolerance)? {
            Some(fit) if !fit.within => return Ok(None),
            None if !self.is_unlike() => return Ok(None),
            found => found.is_some(),
        };
        let Some(parts) = self.blocks(q) else { return Ok(None) };
        let normal = self.is_planar().then(|| self.placed.basis.apply_transposed(Vec3([0.0, 0.0, 1.0])));
        // displacements in parts of the whole mechanism: what a block is changed by, a block's own
        let mut change = vec![0.0; OWN * self.spec.joints.len()];
        let (mut joint, mut most, mut shift, mut turn) = (0, 0.0, 0.0f64, 0.0f64);
        for block in &parts.blocks {
            let Some(own) = block.twin.change_of_block((t, &block.q, normal), misfits)? else { continue };
            let size = block.twin.placed.size;
            for (&j, x) in block.joints.iter().zip(own.chunks(OWN)) {
                if of_joint(x) > most {
                    (joint, most) = (j, of_joint(x));
                }
                for (i, (out, x)) in change[j * OWN..].iter_mut().zip(x).enumerate() {
                    *out = if i % 6 < 3 { x * size / self.placed.size } else { *x };
                }
                let part = |i: usize| Vec3([x[i], x[i + 1], x[i + 2]]).norm();
                shift = shift.max(part(0).max(part(6)) * size);
                turn = turn.max(part(3).max(part(9)));
            }
        }
        if most == 0.0 {
            return Ok(None);
        }
        let Some(model) = self.changed_by(&change, (self.coordinates, self.is_planar()), normal) else {
            return Ok(None);
        };
        let tilted = model.placed.basis.mul(&self.placed.basis.transpose());
        let same = (0..3).all(|i| tilted.0[i][i] > 1.0 - 1e-9);
        if model.size() != self.size() || model.is_planar() != self.is_planar() || !same {
            return Ok(None); // coordinates would mean something else
        }
        Ok(Some(Meant { joint, shift, turn, model: model.with_recursion(self.preference) }))
    }

    /// The change of this block by which it fits; None where it fits, or where it does not say what was meant.
    fn change_of_block(
        &self,
        at: (f64, &[f64], Option<Vec3<f64>>),
        misfits: bool,
    ) -> Result<Option<Vec<f64>>, SystemError> {
        let (t, q, normal) = at;
        let (spec, tolerance) = (&self.spec, self.spec.drawing_tolerance);
        if !is_sought(spec.joints.len()) || !spec.couplings.is_empty() {
            return Ok(None);
        }
        let found = if misfits { judged(self, t, q, tolerance)? } else { Judged::Unclear };
        let (freedoms, seen) = match found {
            Judged::Misfits(fit) if !fit.within => return Ok(None),
            Judged::Misfits(fit) => (fit.freedoms, true),
            // what opens by the square of a length that is off stays unseen where that is small
            _ if self.is_unlike() => (redundant(self, t, q, tolerance)?.unwrap_or(0), false),
            _ => (0, false),
        };
        if freedoms == 0 {
            return Ok(None);
        }
        let parallel = self.parallel(q);
        let plain = self.fitting(at, freedoms, (&parallel, &[]))?;
        let begun = plain.as_ref().map_or(parallel.as_slice(), |x| &x.numbers);
        let change = match self.alike_too(begun, q, normal) {
            // what opens had a double root, or none was found
            Some((numbers, kept, off)) if plain.as_ref().is_none_or(|x| x.is_double(off)) => {
                let alike = self.fitting(at, freedoms, (&numbers, &kept))?;
                alike.filter(|x| x.is_small(tolerance)).or(plain.filter(|_| seen))
            }
            _ => plain.filter(|_| seen),
        };
        Ok(change.filter(|x| x.is_small(tolerance)).map(|x| x.numbers))
    }

    /// The change by which this block fits, next to the one that is `begun`, with what is `kept` of it.
    fn fitting(
        &self,
        at: (f64, &[f64], Option<Vec3<f64>>),
        freedoms: usize,
        (begun, kept): (&[f64], &[Alike]),
    ) -> Result<Option<Change>, SystemError> {
        for nothing in NOTHING {
            if let Some(change) = self.change(at, freedoms, (begun, kept, nothing))? {
                return Ok(Some(change));
            }
        }
        Ok(None)
    }

    /// The change by which this block fits, if singular values below this part of the largest say nothing; None
    /// where what was meant is not clear then.
    fn change(
        &self,
        at: (f64, &[f64], Option<Vec3<f64>>),
        freedoms: usize,
        (begun, kept, nothing): (&[f64], &[Alike], f64),
    ) -> Result<Option<Change>, SystemError> {
        let (t, q, normal) = at;
        let mut change = begun.to_vec();
        let mut open = f64::INFINITY;
        let mut now = self.changed_by(&change, (Coordinates::Absolute, false), normal);
        for round in 0..ROUNDS {
            let drawing = now.as_ref().unwrap_or(self);
            let places = openings(drawing, (t, q), freedoms)?;
            if places.len() < 3 {
                return Ok(None);
            }
            let before = open;
            open = places.iter().flat_map(|x| &x.said).fold(0.0, |m: f64, x| m.max(x.open.abs()));
            let Some(found) = drawing.nearer(&places, &drawing.conditions(kept), nothing) else { return Ok(None) };
            if open < ROUNDING || open > 0.7 * before {
                let fits = open < FITS && (round == 0 || found.is_clear());
                return Ok(fits.then_some(Change { numbers: change, least: found.gap.0, weak: found.weak }));
            }
            if open.is_nan() {
                return Ok(None);
            }
            change.iter_mut().zip(&found.change).for_each(|(x, more)| *x += more);
            now = self.changed_by(&change, (Coordinates::Absolute, false), normal);
            if now.is_none() {
                return Ok(None);
            }
        }
        Ok(None)
    }

    /// This change, axes parallel and lengths equal besides that nearly are so; what is to be kept of it; and by how much it
    /// was off.
    fn alike_too(&self, change: &[f64], q: &[f64], normal: Option<Vec3<f64>>) -> Option<(Vec<f64>, Vec<Alike>, f64)> {
        let mut numbers = change.to_vec();
        let mut off = 0.0f64;
        let mut add = |more: &[f64]| {
            numbers.iter_mut().zip(more).for_each(|(x, more)| *x += more);
            off = more.iter().fold(off, |m: f64, x| m.max(x.abs()));
            self.changed_by(&numbers, (Coordinates::Absolute, false), normal)
        };
        let drawing = self.changed_by(change, (Coordinates::Absolute, false), normal)?;
        let parallel = add(&drawing.parallel(q))?;
        let alike = parallel.alike();
        add(&parallel.made_alike(&alike)?)?;
        (off > ROUNDED).then_some((numbers, alike, off))
    }

    /// The change of this drawing between free bodies by which axes that are nearly parallel where they stand are so exactly:
    /// where the fit of others is a double root, to first order these would do as they are.
    fn parallel(&self, q: &[f64]) -> Vec<f64> {
        let mut change = vec![0.0; OWN * self.spec.joints.len()];
        let mut s = self.full.scratch();
        self.full.poses(q, &mut s);
        // where the turn stands in a change, how its body is turned, and the axis now
        let mut axes: Vec<(usize, Mat3<f64>, Vec3<f64>)> = Vec::new();
        for (j, (joint, placed)) in self.spec.joints.iter().zip(&self.placed.joints).enumerate() {
            let (Some(axis), None, Ok(align)) = (joint.axis, joint.axis2, alignment(joint)) else { continue };
            let Some(axis) = Vec3(axis).unit() else { continue };
            for (node, place, axis) in [(placed.parent, 3, axis), (placed.child, 9, align.apply_transposed(axis))] {
                let turn = s.links[self.placed.link_of(node)].rot;
                axes.push((j * OWN + place, turn, turn.apply(axis)));
            }
        }
        let near = PARALLEL * self.spec.drawing_tolerance;
        while let Some((_, _, first)) = axes.first().copied() {
            let (group, others): (Vec<_>, Vec<_>) = axes.into_iter().partition(|x| x.2.cross(first).norm() <= near);
            axes = others;
            let ahead = |x: Vec3<f64>| x.times(if x.dot(first) < 0.0 { -1.0 } else { 1.0 });
            // the one that the others are nearest to: where most are exactly parallel, those stay as they are
            let off = |x: Vec3<f64>| group.iter().map(|y| x.cross(y.2).norm()).sum::<f64>();
            let least = group.iter().min_by(|x, y| off(x.2).total_cmp(&off(y.2))).map_or(first, |x| ahead(x.2));
            for &(place, turn, axis) in &group {
                let across = ahead(axis).cross(least);
                let (sine, cosine) = (across.norm(), ahead(axis).dot(least));
                if sine > 0.0 {
                    let by = turn.apply_transposed(across.times(sine.atan2(cosine) / sine));
                    change[place..place + 3].copy_from_slice(&by.0);
                }
            }
        }
        change
    }

    /// With the frames of the joints changed by so much; in a plane it stays the plane across its normal.
    fn changed_by(
        &self,
        change: &[f64],
        (coordinates, allow_plane): (Coordinates, bool),
        normal: Option<Vec3<f64>>,
    ) -> Option<Self> {
        let mut spec: Spec = (*self.spec).clone();
        for (joint, x) in spec.joints.iter_mut().zip(change.chunks(OWN)) {
            set(joint, x, self.placed.size, normal);
        }
        Self::compiled(spec, self.callers.functions.clone(), (coordinates, allow_plane), true).ok()
    }

    /// The shortest change of this drawing between free bodies by which all that is said would be nothing, and what is kept
    /// would hold.
    fn nearer(&self, places: &[Place], kept: &[Condition], nothing: f64) -> Option<Nearer> {
        let said: usize = places.iter().map(|x| x.said.len()).sum();
        if (said + kept.len()) * (OWN * self.spec.joints.len()).pow(2) > LARGEST {
            return None;
        }
        let mut rows = Matrix::new(said + kept.len(), OWN * self.spec.joints.len());
        let mut open = Vec::with_capacity(said + kept.len());
        let mut s = self.full.scratch();
        for place in places {
            self.full.poses(&place.q, &mut s);
            for said in &place.said {
                self.slope(place, said, &s, rows.row_mut(open.len()));
                open.push(-said.open);
            }
        }
        for condition in kept {
            condition.set(rows.row_mut(open.len()));
            open.push(-condition.off);
        }
        let f = svd(&rows).ok()?;
        let largest = f.s.first().copied()?;
        let weak = f.s.iter().map(|s| s / largest).filter(|s| *s < WEAK).collect();
        let mut found = Nearer { change: vec![0.0; rows.cols()], gap: (1.0, 0.0), weak };
        for (i, s) in f.s.iter().enumerate() {
            if *s <= nothing * largest {
                found.gap.1 = s / largest;
                break;
            }
            found.gap.0 = s / largest;
            let part = (0..rows.rows()).map(|r| f.u[(r, i)] * open[r]).sum::<f64>() / s;
            found.change.iter_mut().enumerate().for_each(|(j, x)| *x += part * f.v[(j, i)]);
        }
        Some(found)
    }

    /// What a change of each number would open, added up as it is `said`; of a drawing between free bodies.
    fn slope(&self, place: &Place, said: &Said, s: &TreeScratch<Spatial<f64>>, out: &mut [f64]) {
        let (pattern, size) = (self.pattern(), self.placed.size);
        for &(row, weight) in &said.rows {
            let Some(j) = self.joint_of_row(row) else { continue };
            let joint = &self.placed.joints[j];
            for (node, other, point, first) in [
                (joint.parent, joint.child, joint.parent_point, 0),
                (joint.child, joint.parent, joint.child_point, OWN / 2),
            ] {
                // a frame on the ground moves by as much as the other body would move against it
                let (body, sign) = if node == 0 { (other, -weight) } else { (node, weight) };
                let (own, link) = (self.placed.link_of(node), self.placed.link_of(body));
                let v = self.placed.links[link].v;
                let mut effort = [0.0; 6];
                for e in pattern.row(row) {
                    if let Some(k) = (pattern.col_idx[e] + 3).checked_sub(v).filter(|k| *k < 6) {
                        effort[k] = sign * place.c[e];
                    }
                }
                let force = Vec3([effort[0], effort[1], effort[2]]);
                let moment = s.links[link].rot.apply(Vec3([effort[3], effort[4], effort[5]]));
                let turn = &s.links[own].rot;
                let here = self.full.place(own, s) + turn.apply(point - self.reference()[own]);
                let about = moment + (self.full.place(link, s) - here).cross(force);
                let shift = turn.apply_transposed(force).times(size);
                let turned = turn.apply_transposed(about);
                let numbers = &mut out[j * OWN + first..][..OWN / 2];
                shift.0.iter().chain(&turned.0).zip(numbers).for_each(|(x, out)| *out += x);
            }
        }
    }
}

/// Is what was meant sought in a block of so many joints?
fn is_sought(joints: usize) -> bool {
    (OWN * joints).saturating_pow(3) <= LARGEST
}

/// How much a joint is changed.
fn of_joint(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Change the frames of a joint by displacements (in parts of `size`) and turns, first on the parent; in a plane its axes
/// turn about the normal alone, on both bodies alike.
fn set(joint: &mut Joint, by: &[f64], size: f64, normal: Option<Vec3<f64>>) {
    let part = |i: usize| Vec3([by[i], by[i + 1], by[i + 2]]);
    let child = Vec3(joint.child_point.unwrap_or(joint.point)) + part(6).times(size);
    joint.child_point = Some(child.0);
    joint.point = (Vec3(joint.point) + part(0).times(size)).0;
    if let Some(n) = normal {
        let turn = Quaternion::exp(n.times(0.5 * n.dot(part(3) + part(9)))).matrix();
        joint.axis = joint.axis.map(|axis| turn.apply(Vec3(axis)).0);
        joint.frame = joint.frame.map(|frame| turn.mul(&Mat3(frame)).0);
        return;
    }
    let [on_parent, on_child] = [part(3), part(9)].map(|w| Quaternion::exp(w).matrix());
    let Ok(drawn) = alignment(joint) else { return };
    for axis in [&mut joint.axis, &mut joint.axis2].into_iter().flatten() {
        *axis = on_parent.apply(Vec3(*axis)).0;
    }
    joint.frame = joint.frame.map(|frame| on_parent.mul(&Mat3(frame)).0);
    let fits = on_parent.mul(&drawn).mul(&on_child.transpose());
    let frame = joint.frame.map_or_else(Mat3::identity, Mat3);
    joint.child_axis = None;
    joint.child_frame = Some(fits.transpose().mul(&frame).0);
}
