//! Interpretation of a drawing as exactly one mechanism, decided when it is compiled.                          (11.9)
//!
//! A drawing is *exact*; or *repaired*, where a change of its joint frames within the drawing tolerance makes it
//! movable over a finite path; or kept *as drawn*. Blocks of loops are judged one by one, by pivots and a short exact
//! motion where these suffice ([`exact()`]), else by levels of singular values along finite motions.

mod alike;
mod blocks;
mod change;
mod rates;

use super::Model;
use crate::spec::{Joint, Spec};
use crate::value::Functions;
use crate::zero_position::Coordinates;
use blocks::Pose;
use change::{is_sought, largest, Change, OWN};
use partita_math::tolerance;
use partita_system::kinematics::assembly;
use partita_system::prelude::*;
use partita_system::rank::{exact, weakest, Cut, Exact, Kernel};
use partita_system::SystemError;
use rates::Rates;
use std::cell::OnceCell;
use std::collections::HashMap;
use std::sync::Arc;

/// The coarsest level of singular values. Unit: multiples of the drawing tolerance. Reason: those of random geometric
/// errors are up to 0.9 of it, of longer loops more.
const COARSEST: f64 = 10.0;
/// No level is coarser, whatever the tolerance. Scale: singular values in natural scales. Reason: rows above it are
/// independent in any mechanism.
const WIDEST: f64 = 3e-2;
/// Finer levels of singular values. Scale: singular values in natural scales. Reason: two digits apart.
const FINER_LEVELS: [f64; 2] = [1e-5, 1e-7];
/// Conditions above this are accepted; weaker ones are distinguished from none by the judgement of motions, not by
/// pivots at a position. Scale: singular values in natural scales; fraction of the largest for the conditions of a
/// change. Reason: sums of squares can still resolve its square.
const WEAK_CONDITION: f64 = 1e-3;
/// Singular values below this are rounding. Scale: natural scales; fraction of the largest for the conditions of a
/// change. Reason: a drawing in double precision, solved once.
const FINEST_LEVEL: f64 = 1e-9;
/// Number of velocities up to which singular values of the whole mechanism are cheap.
const DENSE: usize = 150;
/// The largest change of a joint frame. Scale: multiples of the drawing tolerance. Reason: one for the frame, one for
/// what it is joined to.
const LARGEST_CHANGE: f64 = 2.0;
/// Axes are parallel within this in what was intended to be planar. Scale: multiples of the drawing tolerance. Reason:
/// errors of several joints add up along a loop.
const PLANE: f64 = 4.0;
/// The drawing of a block may have this closure error for a decision to be meaningful. Scale: lengths of its bodies.
/// Reason: a drawing with a larger error shows another assembly.
const NEARLY_DRAWN: f64 = 0.5;

/// Decision about one block of loops.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict {
    /// All loop closures are independent.
    Regular,
    /// Loop closures are redundant at every position.
    Redundant,
    /// The drawing is exact, but is in a singular position.
    SingularHere,
    /// Some motions exist for an instant at every position and are locked at a higher order.
    Shaky,
    /// It does not move.
    Locked,
    /// The drawing is repaired; then one of the others applies.
    Repaired,
    /// As drawn: weak conditions lock what a change beyond the tolerance would free.
    Conditions,
    /// Couplings (rolling, distances, gears) with an error of about the drawing tolerance: they are not repaired, and
    /// as drawn it is possibly not the intended mechanism.
    Ambiguous,
    /// Not decided: too large, or conditions on rates alone.
    Undecided,
}

/// A block of loops and the decision about it.
#[derive(Clone, Debug)]
pub struct BlockVerdict {
    /// Its joints, by their numbers in the description.
    pub joints: Vec<usize>,
    /// The decision.
    pub verdict: Verdict,
    /// Degrees of freedom over a finite motion, without those of a floating block as a whole.
    pub dof: Option<usize>,
    /// Null directions of the closings at generic positions.
    pub kernel: Option<usize>,
    /// Largest change of each of its joints' frames (rad, fractions of the block's length).
    pub changed: Vec<f64>,
    /// The largest displacement of a joint frame (m) and its largest rotation (rad).
    pub moved: (f64, f64),
    /// The block's length (m).
    pub length: f64,
}

/// Degrees of freedom of a mechanism according to the decision about its drawing, drives released.
#[derive(Clone, Debug, Default)]
pub struct Geometry {
    /// The blocks that were examined.
    pub blocks: Vec<BlockVerdict>,
    /// Degrees of freedom; `None` where a block is undecided.
    pub dof: Option<usize>,
    /// Motions that exist only instantaneously, at every position.
    pub instantaneous: usize,
    /// Whether conditions may be as weak as the drawing tolerance.
    pub weak: bool,
    /// Whether some are so weak that rounding hides them.
    pub hidden: bool,
    /// The weakest condition that leaves a block ambiguous, in words.
    pub ambiguous: Option<String>,
    /// The description as drawn, if it was repaired.
    pub drawn: Option<Arc<Spec>>,
}

impl Geometry {
    /// The largest change of a joint frame (rad, fractions of lengths); 0 where nothing was repaired.
    pub fn geometric_error(&self) -> f64 {
        let repaired = self.blocks.iter().filter(|x| x.verdict == Verdict::Repaired);
        repaired.flat_map(|x| &x.changed).fold(0.0, |m: f64, x| m.max(*x))
    }

    /// What was repaired, in a sentence.
    pub fn words(&self, spec: &Spec) -> Option<String> {
        let repaired = || self.blocks.iter().filter(|x| x.verdict == Verdict::Repaired);
        let of = |x: &BlockVerdict| {
            let most = x.changed.iter().zip(&x.joints).max_by(|a, b| a.0.total_cmp(b.0));
            most.map(|(by, joint)| (*by, *joint))
        };
        let (_, joint) = repaired().filter_map(of).max_by(|a, b| a.0.total_cmp(&b.0))?;
        let (shift, turn) = repaired().fold((0.0f64, 0.0f64), |m, x| (m.0.max(x.moved.0), m.1.max(x.moved.1)));
        Some(format!(
            "the geometry was repaired to close exactly: joint frames were moved by up to {shift:.1e} m and turned \
             by up to {:.1e} deg, most at \"{}\"",
            turn.to_degrees(),
            spec.joints.get(joint).map_or("", |j| &j.name)
        ))
    }
}

/// A block as free bodies between joints, measured in a length of its own.
struct Drawing {
    model: Model,
    length: f64,
}

/// The drawing at one level.
struct Fit {
    dof: usize,
    kernel: usize,
    /// Change of the frames; none where the drawing is exact.
    change: Option<Vec<f64>>,
    most: f64,
    /// Length of which the displacements of the change are fractions.
    length: f64,
    joints: Vec<Joint>,
    folds: bool,
    /// Whether it is constrained by conditions that are weak at generic positions too.
    weak: bool,
    /// It would fit by a change of couplings within the tolerance, which is not sought: the row with the largest
    /// closure error.
    ambiguous: Option<usize>,
}

impl Drawing {
    /// Compiled; measured in `length`, or in that of the drawing.
    fn new(spec: Spec, functions: Arc<dyn Functions>, length: Option<f64>, allow_plane: bool) -> Option<Self> {
        let mut model = Model::compiled(spec, functions, (Coordinates::Absolute, allow_plane), true).ok()?;
        let known = length.or_else(|| model.length_at(&model.initial())).unwrap_or(model.placed.size);
        model.measure_in(known);
        Some(Self { model, length: known })
    }

    /// Whether it can be evaluated.
    fn is_holonomic(&self) -> bool {
        self.model.size().rows == self.model.size().holonomic
    }
}

/// Decide the geometry of a compiled mechanism. `tolerance` is that of its drawing, or a larger one to find out what
/// would make it movable. The joints of a repaired mechanism are the second result.
pub(super) fn decide(model: &Model, tolerance: f64) -> (Geometry, Option<Vec<Joint>>) {
    let spec = &model.spec;
    let drawn = closed(model, coarsest(tolerance));
    let settled = match at(model, drawn.as_deref(), coarsest(tolerance)) {
        Exact::Regular(dof, least) => Some((dof, least)),
        Exact::Redundant(dof, least) if !alike::is_unlike(model, tolerance) => Some((dof, least)),
        _ => None,
    };
    if let Some((dof, least)) = settled {
        let weak = least < WEAK_CONDITION * WEAK_CONDITION;
        return (Geometry { dof: Some(dof), weak, ..Geometry::default() }, None);
    }
    let parts = blocks::blocks(spec);
    let floating = if model.is_planar() { 3 } else { 6 };
    let of_free = parts.free.iter().map(|&j| model.placed.joints[j].shape.dof()).sum::<usize>();
    let mut found = Geometry { dof: Some(of_free + floating * parts.afloat), ..Geometry::default() };
    let mut joints: Option<Vec<Joint>> = None;
    let mut known: HashMap<Vec<i64>, Decided> = HashMap::new();
    let closed: OnceCell<Option<Pose>> = OnceCell::new();
    for block in parts.blocks {
        let key = shape(&block.spec);
        let decided = match key.as_ref().and_then(|k| known.get(k)) {
            Some(decided) => decided.clone(),
            None => {
                let asked = OnceCell::new();
                let pose = || {
                    let all = closed.get_or_init(|| assembled(model, tolerance)).as_ref();
                    asked.get_or_init(|| all.map(|x| x.seen_from(block.base.as_deref()))).as_ref()
                };
                let decided = judged(&block.spec, model.functions(), block.floats, (tolerance, &pose));
                // elsewhere an equal block may close in another way
                if asked.get().is_none() {
                    key.map(|k| known.insert(k, decided.clone()));
                }
                decided
            }
        };
        let verdict = &decided.verdict;
        found.dof = found.dof.zip(decided.dof).map(|(a, b)| a + b);
        if *verdict == Verdict::Shaky {
            found.instantaneous += decided.kernel.unwrap_or(0).saturating_sub(decided.dof.unwrap_or(0));
        }
        found.ambiguous = found.ambiguous.or(decided.ambiguous.clone());
        found.weak |= decided.weak;
        if *verdict == Verdict::Repaired {
            let all = joints.get_or_insert_with(|| spec.joints.clone());
            for (k, &j) in block.joints.iter().enumerate() {
                decided.apply(k, &block.spec.joints[k], &mut all[j]);
            }
        }
        if !matches!(verdict, Verdict::Regular | Verdict::Redundant) {
            let moved = (decided.most(0) * decided.length, decided.most(3));
            let changed = decided.numbers.chunks(OWN).map(largest).collect();
            let (dof, kernel, verdict, length) = (decided.dof, decided.kernel, decided.verdict, decided.length);
            found.blocks.push(BlockVerdict { joints: block.joints, verdict, dof, kernel, changed, moved, length });
        }
    }
    let singular = found.blocks.iter().any(|x| matches!(x.verdict, Verdict::SingularHere | Verdict::Shaky));
    let conditions = found.blocks.iter().any(|x| x.verdict == Verdict::Conditions);
    // repaired conditions are weak in the drawing alone, unless they are weak along the motion too
    let asked = !singular && (joints.is_none() || found.weak);
    found.weak = asked && (conditions || found.weak);
    if asked {
        let weakest = weakest_of(model, drawn.as_deref(), found.dof);
        found.weak |= weakest < WEAK_CONDITION * WEAK_CONDITION;
        found.hidden = weakest <= tolerance::LOST_PIVOT;
    }
    (found, joints)
}

/// The drawing closed, if it is or nearly so; parts that move by their dimensions move where they are closed alone.
///
/// Weak rows are not closed here: they would pull a drawing with geometric errors along its own motion.
fn closed(model: &Model, level: f64) -> Option<Vec<f64>> {
    let mut q = model.initial();
    let mut kernel = Kernel::new(model, 0.0);
    if kernel.open(&q).is_ok_and(|open| open < tolerance::CLOSED_IN_RUN) {
        return Some(q);
    }
    if model.size().nv > DENSE {
        return assembly::close(model, 0.0, &mut q, tolerance::CLOSED, &[]).ok().map(|_| q);
    }
    let closed = kernel.close(&mut q, Cut::Level(level)).ok().flatten()?;
    (closed.open < tolerance::CLOSED_IN_RUN && model.turned_over(&q).is_empty()).then_some(q)
}

/// Where the loops close to the drawing tolerance, or come nearest to it, drives released.
fn assembled(model: &Model, tolerance: f64) -> Option<Pose> {
    let spec = Spec { drives: Vec::new(), ..(*model.spec).clone() };
    let model = Model::compiled(spec, model.functions(), (Coordinates::Relative, true), true).ok()?;
    let mut q = model.initial();
    // a remaining closure error does not affect other loops
    let _ = assembly::close(&model, 0.0, &mut q, tolerance, &[]);
    q.iter().all(|x| x.is_finite()).then(|| model.pose(&q))
}

/// Decision by pivots and a short motion at a closed position.
fn at(model: &Model, q: Option<&[f64]>, level: f64) -> Exact {
    q.and_then(|q| exact(model, 0.0, q, level).ok()).unwrap_or(Exact::Open)
}

/// The coarsest level for a drawing tolerance.
fn coarsest(tolerance: f64) -> f64 {
    (COARSEST * tolerance).clamp(COARSEST * FINEST_LEVEL, WIDEST)
}

/// The squared strength of the weakest constraint of a mechanism with this many degrees of freedom in the zero
/// position; 1 if unknown.
fn weakest_of(model: &Model, q: Option<&[f64]>, dof: Option<usize>) -> f64 {
    let closings = dof.map(|k| model.size().nv.saturating_sub(k));
    q.zip(closings).and_then(|(q, m)| weakest(model, 0.0, q, m).ok()).unwrap_or(1.0)
}

/// The decision about a block, in a form that also applies to an equal one.
#[derive(Clone)]
struct Decided {
    verdict: Verdict,
    dof: Option<usize>,
    kernel: Option<usize>,
    numbers: Vec<f64>,
    length: f64,
    /// Joints as drawn and as repaired.
    joints: Vec<(Joint, Joint)>,
    /// The weakest condition of an ambiguous block, in words.
    ambiguous: Option<String>,
    /// Whether it is constrained by conditions that are weak at generic positions too.
    weak: bool,
}

impl Decided {
    fn plain(verdict: Verdict, dof: Option<usize>) -> Self {
        let (numbers, joints) = (Vec::new(), Vec::new());
        Self { verdict, dof, kernel: None, numbers, length: 1.0, joints, ambiguous: None, weak: false }
    }

    /// A block of which this row remains open.
    fn ambiguous(of: &Model, row: usize) -> Self {
        Self { ambiguous: Some(of.row_owner(row)), ..Self::plain(Verdict::Ambiguous, None) }
    }

    /// The same for a drawing that was first made `plane`, by these numbers in fractions of `length`.
    fn after(mut self, mut numbers: Vec<f64>, length: f64, drawn: &Spec, plane: &[Joint]) -> Self {
        let last: Vec<Joint> = match self.joints.is_empty() {
            true => plane.to_vec(),
            false => self.joints.into_iter().map(|x| x.1).collect(),
        };
        let in_length = |i: usize| if i % (OWN / 2) < 3 { self.length / length } else { 1.0 };
        numbers.iter_mut().zip(&self.numbers).enumerate().for_each(|(i, (x, more))| *x += more * in_length(i));
        self.joints = drawn.joints.iter().cloned().zip(last).collect();
        if self.verdict != Verdict::Shaky {
            self.verdict = Verdict::Repaired;
        }
        Self { numbers, length, kernel: self.kernel.or(self.dof), ..self }
    }

    /// The largest displacement (`first` 0) or rotation (3) of a frame.
    fn most(&self, first: usize) -> f64 {
        most(&self.numbers, first)
    }

    /// Adopt the change of the k-th joint; `drawn` is that of an equal block, possibly in another place.
    fn apply(&self, k: usize, drawn: &Joint, to: &mut Joint) {
        let Some((before, after)) = self.joints.get(k) else { return };
        let moved = |at: [f64; 3], from: [f64; 3], now: [f64; 3]| [0, 1, 2].map(|i| at[i] + (now[i] - from[i]));
        if before.point != after.point || before.child_point != after.child_point {
            let child = |j: &Joint| j.child_point.unwrap_or(j.point);
            to.child_point = Some(moved(child(drawn), child(before), child(after)));
            to.point = moved(drawn.point, before.point, after.point);
        }
        if (before.axis, before.axis2, before.frame, before.child_frame)
            != (after.axis, after.axis2, after.frame, after.child_frame)
        {
            (to.axis, to.axis2, to.frame) = (after.axis, after.axis2, after.frame);
            (to.child_axis, to.child_frame) = (after.child_axis, after.child_frame);
        }
    }
}

/// The largest displacement (`first` 0) or rotation (3) of a frame.
fn most(numbers: &[f64], first: usize) -> f64 {
    let part = |x: &[f64]| x[first..first + 3].iter().map(|x| x * x).sum::<f64>().sqrt();
    numbers.chunks(OWN / 2).map(part).fold(0.0, f64::max)
}

/// The shape of a block by its numbers, relative to its pose; `None` where more than joints and bodies matter.
fn shape(spec: &Spec) -> Option<Vec<i64>> {
    if !spec.couplings.is_empty() {
        return None;
    }
    let first = spec.joints.first()?.point;
    let far = |x: [f64; 3]| (0..3).fold(0.0f64, |m, i| m.max((x[i] - first[i]).abs()));
    let size = spec.joints.iter().fold(0.0f64, |m, j| m.max(far(j.point)).max(far(j.child_point.unwrap_or(j.point))));
    let unit = tolerance::SOLUTION_ROUNDING * if size > 0.0 { size } else { return None };
    let mut key: Vec<i64> = vec![spec.bodies.len() as i64, (size / unit) as i64, size.to_bits() as i64];
    let names: HashMap<&str, i64> = spec.bodies.iter().zip(1..).map(|(b, i)| (b.name.as_str(), i)).collect();
    let point = |x: [f64; 3], key: &mut Vec<i64>| key.extend((0..3).map(|i| ((x[i] - first[i]) / unit).round() as i64));
    let numbers = |x: &[f64], key: &mut Vec<i64>| key.extend(x.iter().map(|x| x.to_bits() as i64));
    for b in &spec.bodies {
        let rot = partita_math::spatial::Mat3(b.orientation).apply(partita_math::spatial::Vec3(b.com));
        point((partita_math::spatial::Vec3(b.position) + rot).0, &mut key);
    }
    for j in &spec.joints {
        key.extend([&j.parent, &j.child].map(|x| names.get(x.as_str()).copied().unwrap_or(0)));
        key.push(j.kind as i64);
        point(j.point, &mut key);
        point(j.child_point.unwrap_or(j.point), &mut key);
        for x in [j.axis, j.axis2, j.child_axis] {
            key.push(i64::from(x.is_some()));
            numbers(&x.unwrap_or_default(), &mut key);
        }
        for x in [j.frame, j.child_frame] {
            key.push(i64::from(x.is_some()));
            numbers(x.unwrap_or_default().as_flattened(), &mut key);
        }
        numbers(&[j.pitch.unwrap_or(0.0)], &mut key);
        if j.free.is_some() {
            return None;
        }
    }
    Some(key)
}

/// The drawing tolerance, and where a block closes if it does not close as drawn.
type Wanted<'p> = (f64, &'p dyn Fn() -> Option<&'p Pose>);

/// One block.
fn judged(spec: &Spec, functions: Arc<dyn Functions>, floats: bool, (tolerance, pose): Wanted) -> Decided {
    let undecided = || Decided::plain(Verdict::Undecided, None);
    let Some(drawing) = Drawing::new(spec.clone(), functions, None, true) else { return undecided() };
    let own = drawing.afloat(floats);
    if !drawing.is_holonomic() {
        return match is_sought(spec.joints.len()).then(|| drawing.rates(tolerance)) {
            Some(Ok(Rates::Independent(k))) => Decided::plain(Verdict::Regular, Some(k.saturating_sub(own))),
            Some(Ok(Rates::Ambiguous(row))) => Decided::ambiguous(&drawing.model, row),
            _ => undecided(),
        };
    }
    if let Some(decided) = drawing.settled(own, tolerance) {
        return decided;
    }
    if !is_sought(spec.joints.len()) {
        return undecided();
    }
    // a drawing intended to be plane is made so first: there a body has only three numbers
    if let Some((plane, numbers)) = drawing.flattened(tolerance) {
        let own = plane.afloat(floats);
        let decided = plane.settled(own, tolerance).or_else(|| plane.decided(own, (tolerance, pose)));
        if let Some(decided) = decided.filter(|x| x.dof.is_some_and(|k| k > 0)) {
            return decided.after(numbers, plane.length, spec, &plane.model.spec.joints);
        }
    }
    drawing.decided(own, (tolerance, pose)).unwrap_or_else(undecided)
}

/// Null directions of a drawing at the finest and the coarsest level.
struct Seen {
    fine: usize,
    coarse: usize,
    /// Degrees of freedom where all conditions are independent: then the drawing moves as it is.
    regular: Option<usize>,
    /// Those of the whole, if it is not attached.
    afloat: usize,
}

impl Drawing {
    /// Degrees of freedom as a whole, if it is not attached.
    fn afloat(&self, floats: bool) -> usize {
        match (floats, self.model.is_planar()) {
            (false, _) => 0,
            (true, true) => 3,
            (true, false) => 6,
        }
    }

    /// Decision by pivots and a short motion; `own` degrees of freedom are those of the whole.
    fn settled(&self, own: usize, tolerance: f64) -> Option<Decided> {
        let level = coarsest(tolerance);
        match at(&self.model, closed(&self.model, level).as_deref(), level) {
            Exact::Regular(k, _) => Some(Decided::plain(Verdict::Regular, Some(k.saturating_sub(own)))),
            Exact::Redundant(k, _) if !alike::is_unlike(&self.model, tolerance) => {
                Some(Decided::plain(Verdict::Redundant, Some(k.saturating_sub(own))))
            }
            _ => None,
        }
    }

    /// Decision by finite motions; None where they do not decide.
    fn decided(&self, own: usize, wanted: Wanted) -> Option<Decided> {
        let (fit, seen) = self.levels(own, wanted).ok().flatten()?;
        let drawn = &self.model.spec.joints;
        match fit {
            Some(Fit { ambiguous: Some(row), .. }) => Some(Decided::ambiguous(&self.model, row)),
            Some(fit) => {
                let verdict = match () {
                    () if fit.dof < fit.kernel => Verdict::Shaky,
                    () if fit.change.is_some() => Verdict::Repaired,
                    () if fit.weak => Verdict::Conditions,
                    () if seen.coarse > fit.kernel => Verdict::SingularHere,
                    () => Verdict::Redundant,
                };
                Some(Decided {
                    verdict,
                    dof: Some(fit.dof.saturating_sub(own)),
                    kernel: Some(fit.kernel.saturating_sub(own)),
                    numbers: fit.change.unwrap_or_default(),
                    length: fit.length,
                    joints: drawn.iter().cloned().zip(fit.joints).collect(),
                    ambiguous: None,
                    weak: fit.weak,
                })
            }
            None if seen.fine <= own => {
                let verdict = if seen.coarse > own { Verdict::Conditions } else { Verdict::Locked };
                Some(Decided::plain(verdict, Some(0)))
            }
            None => None,
        }
    }

    /// The drawing with nearly parallel axes made parallel, where it then is plane; and the change.
    fn flattened(&self, tolerance: f64) -> Option<(Self, Vec<f64>)> {
        if self.model.is_planar() || !self.model.spec.couplings.is_empty() {
            return None;
        }
        let mut numbers = self.parallel(&self.model.initial(), PLANE * tolerance);
        let mut plane = self.changed_to(&numbers)?;
        if !plane.model.is_planar() {
            // heights along the normal: each joint where its bodies fit
            let heights = plane.heights()?;
            numbers.iter_mut().zip(&heights).for_each(|(x, more)| *x += more);
            plane = self.changed_to(&numbers)?;
        }
        // the error of a hinge out of parallel is shared equally by its two bodies
        let most = |first: usize, limit: f64| most(&numbers, first) <= limit * tolerance;
        (plane.model.is_planar() && most(0, LARGEST_CHANGE) && most(3, PLANE)).then_some((plane, numbers))
    }

    /// The fits at the levels, coarsest first, and the null directions of the drawing. `None` where it does not close.
    fn levels(&self, own: usize, (tolerance, pose): Wanted) -> Result<Option<(Option<Fit>, Seen)>, SystemError> {
        let near = Cut::Level(coarsest(tolerance));
        let mut home = self.model.initial();
        let closed = Kernel::new(&self.model, 0.0).close(&mut home, near)?;
        // a drawing that closes with opposed axes is another mechanism
        let open = closed.filter(|_| self.model.turned_over(&home).is_empty()).map(|x| x.open);
        let there = if open.is_none_or(|x| x > tolerance) { pose() } else { None };
        if let Some(pose) = there {
            // a drawing that no change within the tolerance closes here closes elsewhere: then lengths are those there.
            // Where it does not close either, a slide may have moved far, which would raise the tolerance: none is
            // longer than drawn
            let mut q = self.model.coordinates_in(pose);
            let there = self.model.length_at(&q);
            let closed = Kernel::new(&self.model, 0.0).close(&mut q.clone(), Cut::Level(FINEST_LEVEL))?;
            let length = match closed.is_some_and(|x| x.open <= tolerance::CLOSED_IN_RUN) {
                true => there,
                false => there.map(|x| x.min(self.length)),
            };
            let there = Self::new((*self.model.spec).clone(), self.model.functions(), length, self.model.is_planar());
            if let Some(there) = there.filter(|x| x.model.is_planar() == self.model.is_planar()) {
                let closed = Kernel::new(&there.model, 0.0).close(&mut q, near)?;
                let fits = there.model.turned_over(&q).is_empty();
                if fits && closed.is_some_and(|x| open.is_none_or(|open| x.open < open)) {
                    return there.levels_at(q, own, tolerance);
                }
            }
        }
        if open.is_none_or(|open| open > NEARLY_DRAWN) {
            return Ok(None);
        }
        self.levels_at(home, own, tolerance)
    }

    /// The same at a position that is closed as far as possible.
    fn levels_at(
        &self,
        home: Vec<f64>,
        afloat: usize,
        tolerance: f64,
    ) -> Result<Option<(Option<Fit>, Seen)>, SystemError> {
        let coarsest = coarsest(tolerance);
        let mut kernel = Kernel::new(&self.model, 0.0);
        let n = self.model.size().nv;
        let values = kernel.values(&home)?;
        let null = |level: f64| n - Cut::Level(level).count(&values);
        let counted = n.saturating_sub(kernel.rows.len());
        let fine = null(FINEST_LEVEL);
        let seen = Seen { fine, coarse: null(coarsest), regular: (fine == counted).then_some(counted), afloat };
        if seen.coarse == 0 || seen.coarse == counted {
            let fit = Fit {
                dof: seen.coarse,
                kernel: seen.coarse,
                change: None,
                most: 0.0,
                length: self.length,
                joints: self.model.spec.joints.clone(),
                folds: false,
                weak: false,
                ambiguous: None,
            };
            return Ok(Some(((seen.coarse > 0).then_some(fit), seen)));
        }
        let mut levels = vec![coarsest];
        levels.extend(FINER_LEVELS.into_iter().filter(|x| *x < coarsest));
        if seen.fine == seen.coarse {
            let finest = levels.pop().unwrap_or(coarsest);
            let fit = self.at_level(&home, finest, (tolerance, &seen))?;
            if let Some(fit) = fit.filter(|x| x.change.is_none() && x.dof == seen.coarse) {
                return Ok(Some((Some(fit), seen)));
            }
            levels.push(finest);
        }
        // this level alone returns a lock of order four to where closure errors are rounding
        levels.push(FINEST_LEVEL);
        let mut fits: Vec<Fit> = Vec::new();
        for (i, &level) in levels.iter().enumerate() {
            let next = levels.get(i + 1).map_or(seen.fine, |x| null(*x));
            let Some(fit) = self.at_level(&home, level, (tolerance, &seen))? else { continue };
            let as_drawn = fit.change.is_none() && fit.ambiguous.is_none();
            let ends = fit.dof >= next && (as_drawn || seen.fine < fit.dof);
            fits.push(fit);
            if ends {
                break;
            }
        }
        Ok(Some((chosen(fits), seen)))
    }

    /// The drawing at this level: a motion, and the change by which it fits. None where there is none.
    fn at_level(&self, home: &[f64], level: f64, (tolerance, seen): (f64, &Seen)) -> Result<Option<Fit>, SystemError> {
        let cut = Cut::Level(level);
        let mut there = home.to_vec();
        let mut kernel = Kernel::new(&self.model, 0.0);
        if kernel.close(&mut there, cut)?.is_none() {
            return Ok(None);
        }
        let Some(branch) = kernel.branch(&there, cut)? else { return Ok(None) };
        let (weak, exact) = self.conditions_along(&mut kernel, &branch)?;
        let fit = |change: Option<Vec<f64>>, joints: &[Joint]| Fit {
            weak,
            dof: branch.dof,
            kernel: branch.kernel,
            most: change.as_deref().map_or(0.0, largest),
            length: self.length,
            folds: change.as_deref().is_some_and(|x| self.folds(x)),
            change,
            joints: joints.to_vec(),
            ambiguous: None,
        };
        let open = branch.points.iter().fold(0.0, |m: f64, x| m.max(x.open));
        let unlike = self.alike_too(&vec![0.0; OWN * self.model.spec.joints.len()], &there, tolerance);
        // a motion of the drawing itself needs no change, however similar its axes are; the closure error of an exact
        // drawing is rounding, and a smaller geometric error shows in its null directions
        let exact = exact && open <= tolerance::SUM_ROUNDING;
        let moves_as_drawn = exact || seen.regular.is_some_and(|k| branch.dof <= k);
        if open < tolerance::FITS && (unlike.is_none() || moves_as_drawn) {
            return Ok(Some(fit(None, &self.model.spec.joints)));
        }
        if !self.model.spec.couplings.is_empty() || branch.dof < branch.kernel {
            // conditions have no frames that could be moved, and no slope removes a lock of higher order
            let found = || fit(None, &self.model.spec.joints);
            if open < tolerance::FITS {
                return Ok(Some(found()));
            }
            // a closure error within the limits of a whole run is judged there; one that exceeds the tolerance is as
            // drawn
            let within = open > tolerance::CLOSED_IN_RUN && open <= LARGEST_CHANGE * tolerance;
            // independent conditions that leave a motion are accepted, however weak
            let undecided = within && seen.regular.is_none_or(|k| k <= seen.afloat);
            let far = branch.points.iter().filter(|x| x.steps >= CHECKED).max_by(|a, b| a.open.total_cmp(&b.open));
            let Some(place) = far.filter(|_| undecided && branch.dof == branch.kernel) else { return Ok(None) };
            let ambiguous = Some(self.most_open(&mut kernel, &place.q)?);
            return Ok(Some(Fit { most: open, ambiguous, ..found() }));
        }
        let nothing = vec![0.0; OWN * self.model.spec.joints.len()];
        let plain = match open < tolerance::FITS {
            true => None,
            false => self.change(&branch.points, branch.kernel, (&nothing, &[]))?,
        };
        let begun = plain.as_ref().map_or(nothing.as_slice(), |x| &x.numbers);
        let alike = self.alike_too(begun, &there, tolerance);
        let small =
            |x: &Change| largest(&x.numbers) <= LARGEST_CHANGE * tolerance && !self.folds_all(&x.numbers, tolerance);
        let with = match &alike {
            // the closure error had a double root, or none was found
            Some((numbers, kept, off)) if plain.as_ref().is_none_or(|x| x.is_double(*off)) => {
                self.change(&branch.points, branch.kernel, (numbers, kept))?.filter(small)
            }
            _ => None,
        };
        for change in [with, plain.filter(small)].into_iter().flatten() {
            let Some(changed) = self.changed(&change.numbers) else { continue };
            if changed.goes(&there, &branch)? {
                return Ok(Some(fit(Some(change.numbers), &changed.model.spec.joints)));
            }
        }
        Ok((open < tolerance::FITS).then(|| fit(None, &self.model.spec.joints)))
    }

    /// The coupling whose row has the largest closure error at q; where there are none, the joint.
    fn most_open(&self, kernel: &mut Kernel<Model>, q: &[f64]) -> Result<usize, SystemError> {
        kernel.open(q)?;
        let open = |k: usize| kernel.raw_phi()[kernel.rows[k]].abs() / kernel.sizes[k];
        let is_coupling = |k: usize| self.model.joint_of_row(kernel.rows[k]).is_none();
        let most = (0..kernel.rows.len())
            .max_by(|&a, &b| is_coupling(a).cmp(&is_coupling(b)).then(open(a).total_cmp(&open(b))));
        Ok(most.map_or(0, |k| kernel.rows[k]))
    }

    /// Whether further values besides the null ones are small at most of some generic positions, and whether the null
    /// ones vanish to round-off at all of them, as in an exact drawing.
    fn conditions_along(
        &self,
        kernel: &mut Kernel<Model>,
        branch: &partita_system::rank::Branch,
    ) -> Result<(bool, bool), SystemError> {
        let n = self.model.size().nv;
        let (mut weak, mut exact, mut asked) = (0, 0, 0);
        for place in branch.points.iter().step_by((branch.points.len() / ASKED).max(1)).take(ASKED) {
            let values = kernel.values(&place.q)?;
            let small = |level: f64| n - Cut::Level(level).count(&values);
            weak += usize::from(small(WEAK_CONDITION) > branch.kernel);
            exact += usize::from(small(FINEST_LEVEL) >= branch.kernel);
            asked += 1;
        }
        Ok((2 * weak > asked, exact == asked))
    }

    /// Whether this drawing, with its loop closures as given, follows all its motions with the kernel of the branch.
    fn goes(&self, home: &[f64], branch: &partita_system::rank::Branch) -> Result<bool, SystemError> {
        let cut = Cut::Rank(self.model.size().nv - branch.kernel);
        let mut kernel = Kernel::new(&self.model, 0.0);
        let mut there = home.to_vec();
        let Some(place) = branch.points.get(branch.points.len() / 2) else { return Ok(false) };
        if kernel.close(&mut there, cut)?.is_none_or(|x| x.open > tolerance::FITS) {
            there.clone_from(&place.q);
            if kernel.close(&mut there, cut)?.is_none_or(|x| x.open > tolerance::FITS) {
                return Ok(false);
            }
        }
        let (mut open, mut count) = (0.0f64, 0);
        for motion in kernel.motions(&there, cut)?.motions {
            for sign in [1.0, -1.0] {
                let along: Vec<f64> = motion.iter().map(|x| sign * x).collect();
                kernel.path(&there, &along, cut, CHECKED, &mut |_, _, off, _| {
                    open = open.max(off);
                    count += 1;
                    open <= tolerance::FITS
                })?;
            }
        }
        Ok(count >= CHECKED && open <= tolerance::FITS)
    }

    /// Whether a change reduces a length of a body to zero.
    fn folds(&self, numbers: &[f64]) -> bool {
        let Some(changed) = self.changed(numbers) else { return false };
        let (before, after) = (self.lengths(), changed.lengths());
        before.iter().zip(&after).any(|(d, now)| *d > tolerance::EQUAL * self.length && *now < 0.5 * d)
    }

    /// Whether it removes a length that is too large for a geometric error.
    fn folds_all(&self, numbers: &[f64], tolerance: f64) -> bool {
        let Some(changed) = self.changed(numbers) else { return true };
        let (before, after) = (self.lengths(), changed.lengths());
        let longest = before.iter().fold(0.0, |m: f64, x| m.max(*x));
        before.iter().zip(&after).any(|(d, now)| *d > PLANE * tolerance * longest && *now < 0.5 * d)
    }
}

/// Number of generic positions that are examined for weak conditions.
const ASKED: usize = 5;
/// Steps of the path on which a change is checked: one radian.
const CHECKED: usize = 10;

/// The fit with the most degrees of freedom; of equal ones that with the least change, unless it folds a length that a
/// finer level keeps.
fn chosen(fits: Vec<Fit>) -> Option<Fit> {
    let most = fits.iter().map(|x| x.dof).max()?;
    let better = |a: &Fit, b: &Fit| b.dof.cmp(&a.dof).then(a.most.total_cmp(&b.most));
    let (mut first, mut others): (Vec<Fit>, Vec<Fit>) = fits.into_iter().partition(|x| x.dof == most);
    first.sort_by(better);
    let kept = first.into_iter().next()?;
    if kept.folds {
        others.retain(|x| !x.folds && tolerance::CLEARLY * x.most <= kept.most);
        others.sort_by(better);
        if let Some(other) = others.into_iter().next() {
            return Some(other);
        }
    }
    Some(kept)
}
