//! Interpretation of a drawing as exactly one mechanism, decided when it is compiled.                            (T3)
//!
//! A drawing is *exact*; or *repaired*, where a change of its joint frames within the drawing tolerance makes it
//! movable over a finite path; or kept *as drawn*. Blocks of loops are judged one by one, by pivots and a short exact
//! motion where these suffice ([`exact()`]), else by levels of singular values along finite motions.

mod alike;
mod bearings;
mod blocks;
mod change;
mod couplings;
mod levels;
mod rates;
mod snapped;
mod zeros;

use super::Model;
use crate::spec::{Joint, Spec};
use crate::value::Functions;
use crate::zero_position::Coordinates;
use blocks::{Block, Pose};
use change::{is_sought, largest, OWN};
use couplings::judged;
use levels::Fit;
use partita_math::tolerance;
use partita_system::kinematics::assembly;
use partita_system::manifold::truncated::FIRST_GRADE;
use partita_system::prelude::*;
use partita_system::rank::{exact, pivots, weakest, Cut, Exact, Kernel};
use partita_system::start;
use partita_system::system::structure::{Finite, Verdict};
use std::cell::OnceCell;
use std::collections::HashMap;
use std::sync::Arc;
pub(super) use zeros::closed_zeros;

/// The coarsest level of singular values. Unit: multiples of the drawing tolerance. Reason: those of random geometric
/// errors are up to 0.9 of it, of longer loops more.
const COARSEST: f64 = 10.0;
/// Conditions above this are accepted; weaker ones are distinguished from none by the judgement of motions, not by
/// pivots at a position. Scale: singular values in natural scales; fraction of the largest for the conditions of a
/// change. Reason: sums of squares can still resolve its square.
const WEAK_CONDITION: f64 = 1e-3;
/// Number of velocities up to which singular values of the whole mechanism are cheap.
const DENSE: usize = 150;
/// The largest change of a joint frame. Scale: multiples of the drawing tolerance. Reason: one for the frame, one for
/// its counterpart.
const LARGEST_CHANGE: f64 = 2.0;
/// Decision about one block of loops.
#[derive(Clone, Debug, PartialEq)]
pub enum BlockDecision {
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
    pub verdict: BlockDecision,
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
        let repaired = self.blocks.iter().filter(|x| x.verdict == BlockDecision::Repaired);
        repaired.flat_map(|x| &x.changed).fold(0.0, |m: f64, x| m.max(*x))
    }

    /// As part of the structure of the system.
    pub(super) fn verdict(&self, spec: &Spec) -> Verdict {
        let Self { dof, instantaneous, weak, hidden, .. } = *self;
        Verdict {
            finite: dof.map(|dof| Finite { dof, instantaneous, weak, hidden }),
            ambiguous: self.ambiguous.clone(),
            instantaneous: self.locked(spec),
            errors: (self.geometric_error(), spec.drawing_tolerance),
        }
    }

    /// What locks instantaneous motions, in words.
    fn locked(&self, spec: &Spec) -> String {
        let shaky = self.blocks.iter().filter(|x| x.verdict == BlockDecision::Shaky);
        let names: Vec<String> =
            shaky.flat_map(|x| &x.joints).map(|&j| format!("\"{}\"", spec.joints[j].name)).collect();
        match names.as_slice() {
            [] => spec.couplings.iter().take(6).map(|c| c.name().to_string()).collect::<Vec<_>>().join(", "),
            few if few.len() <= 8 => format!("joints {}", few.join(", ")),
            many => format!("joints {} and {} more", many[..8].join(", "), many.len() - 8),
        }
    }

    /// Whether the drawn position is singular.
    fn is_singular(&self) -> bool {
        self.blocks.iter().any(|x| matches!(x.verdict, BlockDecision::SingularHere | BlockDecision::Shaky))
    }

    /// What was repaired, in a sentence.
    pub fn words(&self, spec: &Spec) -> Option<String> {
        let repaired = || self.blocks.iter().filter(|x| x.verdict == BlockDecision::Repaired);
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

impl Drawing {
    /// Compiled; measured in `length`, or in that of the drawing.
    fn new(spec: Spec, functions: Arc<dyn Functions>, length: Option<f64>, allow_plane: bool) -> Option<Self> {
        let mut model = Model::compiled(spec, functions, (Coordinates::Absolute, allow_plane), true).ok()?;
        let known = length.or_else(|| model.length_at(&model.initial())).unwrap_or(model.own.placed.size);
        model.measure_in(known);
        Some(Self { model, length: known })
    }

    /// Whether nobody waits for the decision any more.
    fn is_abandoned(&self) -> bool {
        self.model.functions().is_abandoned()
    }

    /// Whether all conditions are on positions.
    fn is_holonomic(&self) -> bool {
        self.model.size().rows == self.model.size().holonomic
    }
}

/// Decide the geometry of a compiled mechanism. `tolerance` is that of its drawing, or a larger one to find out what
/// would make it movable. The joints of a repaired mechanism are the second result.
///
/// The decision is that of joint coordinates, whatever those of the model: it must not depend on them, and of the rows
/// of a loop alone more are settled by their pivots. How weak the constraints are is a matter of the rows in use.
pub(super) fn decide(model: &Model, tolerance: f64) -> (Geometry, Option<Vec<Joint>>) {
    let by_joints = match model.coordinates {
        Coordinates::Relative => None,
        Coordinates::Absolute => {
            let form = (Coordinates::Relative, true);
            Model::compiled((*model.spec).clone(), model.functions(), form, false).ok()
        }
    };
    let (mut found, joints) = decided(by_joints.as_ref().unwrap_or(model), tolerance);
    let undecided = found.dof.is_none() && found.ambiguous.is_none() && joints.is_none();
    if undecided {
        let (dof, weak) = counted(model, tolerance);
        // of large blocks no motion was tried
        let large = found.blocks.iter().any(|x| x.verdict == BlockDecision::Undecided && !is_sought(x.joints.len()));
        found.ambiguous = weak.filter(|_| large);
        found.dof = dof.filter(|_| found.ambiguous.is_none());
    }
    if (by_joints.is_some() && !found.is_singular() && joints.is_none()) || (undecided && found.dof.is_some()) {
        let drawn = closed(model, coarsest(tolerance));
        found.weak |= weakest_of(model, drawn.as_deref(), found.dof) < WEAK_CONDITION * WEAK_CONDITION;
    }
    (found, joints)
}

/// Degrees of freedom by the pivots of the drawing, where nothing else decides: if it closes, in joint coordinates, drives
/// released, and what is redundant there is so next to it. With them the weakest condition, if it is weaker than the
/// tolerance: it is possibly a geometric error.
fn counted(model: &Model, tolerance: f64) -> (Option<usize>, Option<String>) {
    let spec = Spec { drives: Vec::new(), ..(*model.spec).clone() };
    let form = (Coordinates::Relative, true);
    let Ok(model) = Model::compiled(spec, model.functions(), form, true) else { return (None, None) };
    let holonomic = model.size().rows == model.size().holonomic;
    let Some(drawn) = closed(&model, coarsest(tolerance)).filter(|_| holonomic) else { return (None, None) };
    let kept = pivots(&model, 0.0, &drawn, &|_| false).unwrap_or_default();
    let dof = |rank: usize| Some(model.size().nv - rank);
    match kept.iter().min_by(|a, b| a.1.total_cmp(&b.1)) {
        // weak by intention, and weaker than a start without a decision would count
        Some(x) if x.1 > tolerance * tolerance && x.1 < tolerance::REDUNDANT => (dof(kept.len()), None),
        weakest => {
            let found = start::analyse(&model, 0.0, &drawn).ok();
            let weak =
                weakest.filter(|x| x.1 <= tolerance * tolerance).map(|x| model.structure().rows[x.0].owner.to_string());
            (found.and_then(|x| dof(x.rank)), weak)
        }
    }
}

/// The decision in the coordinates of the model.
fn decided(model: &Model, tolerance: f64) -> (Geometry, Option<Vec<Joint>>) {
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
    let (blocks, dof) = by_blocks(model, tolerance);
    let mut found = Geometry { dof, ..Geometry::default() };
    let mut joints: Option<Vec<Joint>> = None;
    for (block, decided) in blocks {
        let verdict = &decided.verdict;
        if *verdict == BlockDecision::Shaky {
            found.instantaneous += decided.kernel.unwrap_or(0).saturating_sub(decided.dof.unwrap_or(0));
        }
        found.ambiguous = found.ambiguous.or(decided.ambiguous.clone());
        found.weak |= decided.weak;
        if *verdict == BlockDecision::Repaired {
            let all = joints.get_or_insert_with(|| spec.joints.clone());
            for (k, &j) in block.joints.iter().enumerate() {
                decided.apply(k, &block.spec.joints[k], &mut all[j]);
            }
        }
        if !matches!(verdict, BlockDecision::Regular | BlockDecision::Redundant) {
            let moved = (decided.most(0) * decided.length, decided.most(3));
            let changed = decided.numbers.chunks(OWN).map(largest).collect();
            let (dof, kernel, verdict, length) = (decided.dof, decided.kernel, decided.verdict, decided.length);
            found.blocks.push(BlockVerdict { joints: block.joints, verdict, dof, kernel, changed, moved, length });
        }
    }
    let singular = found.is_singular();
    let conditions = found.blocks.iter().any(|x| x.verdict == BlockDecision::Conditions);
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

/// The decision about each block, and degrees of freedom of all of them and of what is in none; `None` where a block is
/// undecided.
fn by_blocks(model: &Model, tolerance: f64) -> (Vec<(Block, Decided)>, Option<usize>) {
    let parts = blocks::blocks(&model.spec);
    let floating = if model.is_planar() { 3 } else { 6 };
    let of_free = parts.free.iter().map(|&j| model.own.placed.joints[j].shape.mobility()).sum::<usize>();
    let mut known: HashMap<Vec<i64>, Decided> = HashMap::new();
    let closed: OnceCell<Option<Pose>> = OnceCell::new();
    let blocks = parts.blocks.into_iter().map(|block| {
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
        (block, decided)
    });
    let blocks: Vec<(Block, Decided)> = blocks.collect();
    let own = Some(of_free + floating * parts.afloat);
    let dof = blocks.iter().fold(own, |sum, x| sum.zip(x.1.dof).map(|(a, b)| a + b));
    (blocks, dof)
}

/// The drawing closed, if it is or nearly so; parts that move by their dimensions move where they are closed alone.
///
/// Weak rows are not closed here: they would pull a drawing with geometric errors along its own motion.
fn closed(model: &Model, level: f64) -> Option<Vec<f64>> {
    let mut q = model.initial();
    let mut kernel = Kernel::new(model, 0.0);
    if kernel.closure_error(&q).is_ok_and(|closure_error| closure_error < tolerance::CLOSED_IN_RUN) {
        return Some(q);
    }
    if model.size().nv > DENSE {
        return assembly::close(model, 0.0, &mut q, tolerance::CLOSED, &[]).ok().map(|_| q);
    }
    let closed = kernel.close(&mut q, Cut::Level(level)).ok().flatten()?;
    (closed.closure_error < tolerance::CLOSED_IN_RUN && model.turned_over(&q).is_empty()).then_some(q)
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
    (COARSEST * tolerance).clamp(COARSEST * tolerance::NULL_VALUE, FIRST_GRADE)
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
    verdict: BlockDecision,
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
    fn plain(verdict: BlockDecision, dof: Option<usize>) -> Self {
        let (numbers, joints) = (Vec::new(), Vec::new());
        Self { verdict, dof, kernel: None, numbers, length: 1.0, joints, ambiguous: None, weak: false }
    }

    /// Decided by these rows and their pivots.
    fn with(verdict: BlockDecision, dof: usize, kept: &[(usize, f64)]) -> Self {
        let least = kept.iter().fold(1.0, |m: f64, x| m.min(x.1));
        Self { weak: least <= WEAK_CONDITION * WEAK_CONDITION, ..Self::plain(verdict, Some(dof)) }
    }

    /// A block of which this row remains open.
    fn ambiguous(of: &Model, row: usize) -> Self {
        Self {
            ambiguous: Some(of.structure().rows[row].owner.to_string()),
            ..Self::plain(BlockDecision::Ambiguous, None)
        }
    }

    /// Add the change that first made the drawing `plane`: these numbers, in fractions of `length`.
    fn after(mut self, mut numbers: Vec<f64>, length: f64, drawn: &Spec, plane: &[Joint]) -> Self {
        let last: Vec<Joint> = match self.joints.is_empty() {
            true => plane.to_vec(),
            false => self.joints.into_iter().map(|x| x.1).collect(),
        };
        let in_length = |i: usize| if i % (OWN / 2) < 3 { self.length / length } else { 1.0 };
        numbers.iter_mut().zip(&self.numbers).enumerate().for_each(|(i, (x, more))| *x += more * in_length(i));
        self.joints = drawn.joints.iter().cloned().zip(last).collect();
        if self.verdict != BlockDecision::Shaky {
            self.verdict = BlockDecision::Repaired;
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

/// A drawing made plane by a change, its joints beside each other laid in one point; and the whole change.
fn with_bearings((plane, mut numbers): (Drawing, Vec<f64>), tolerance: f64) -> (Drawing, Vec<f64>) {
    let laid = plane.bearings(tolerance).filter(|x| x.0.model.is_planar());
    let Some((laid, more)) = laid else { return (plane, numbers) };
    numbers.iter_mut().zip(&more).for_each(|(x, more)| *x += more);
    (laid, numbers)
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
            Exact::Regular(k, _) => Some(Decided::plain(BlockDecision::Regular, Some(k.saturating_sub(own)))),
            Exact::Redundant(k, _) if !alike::is_unlike(&self.model, tolerance) => {
                Some(Decided::plain(BlockDecision::Redundant, Some(k.saturating_sub(own))))
            }
            _ => None,
        }
    }

    /// Decision where neither pivots nor what is without couplings decide. Motions are tried of blocks that are not too
    /// large; those that are intended to be plane are made so whatever their size.
    fn whole(&self, own: usize, (tolerance, pose): Wanted) -> Decided {
        let undecided = || Decided::plain(BlockDecision::Undecided, None);
        let is_sought = is_sought(self.model.spec.joints.len());
        if !self.is_holonomic() {
            let decided = is_sought.then(|| self.rates(own, tolerance).ok()).flatten();
            return decided.unwrap_or_else(undecided);
        }
        let moved = |drawing: &Self, own: usize| is_sought.then(|| drawing.decided(own, (tolerance, pose))).flatten();
        // a drawing intended to be plane is made so first: there a body has only three numbers
        if let Some((plane, numbers)) = self.flattened(tolerance).map(|x| with_bearings(x, tolerance)) {
            let own = if own > 0 { plane.afloat(true) } else { 0 };
            let by_pivots = || {
                let (dof, weak) = if is_sought { (None, None) } else { counted(&plane.model, tolerance) };
                let dof = dof.filter(|_| weak.is_none())?.saturating_sub(own);
                Some(Decided::plain(BlockDecision::Redundant, Some(dof)))
            };
            let decided = plane.settled(own, tolerance).or_else(|| plane.with_equal_sides(own, tolerance));
            let decided = decided.or_else(|| moved(&plane, own)).or_else(by_pivots);
            if let Some(decided) = decided.filter(|x| x.dof.is_some_and(|k| k > 0)) {
                return decided.after(numbers, plane.length, &self.model.spec, &plane.model.spec.joints);
            }
        }
        self.with_equal_sides(own, tolerance).or_else(|| moved(self, own)).unwrap_or_else(undecided)
    }

    /// Decision by finite motions; None where they do not decide.
    fn decided(&self, own: usize, wanted: Wanted) -> Option<Decided> {
        let (fit, seen) = self.levels(own, wanted).ok().flatten()?;
        let drawn = &self.model.spec.joints;
        match fit {
            Some(Fit { ambiguous: Some(row), .. }) => Some(Decided::ambiguous(&self.model, row)),
            Some(fit) => {
                let verdict = match () {
                    () if fit.dof < fit.kernel => BlockDecision::Shaky,
                    () if fit.change.is_some() => BlockDecision::Repaired,
                    () if fit.weak => BlockDecision::Conditions,
                    () if seen.coarse > fit.kernel => BlockDecision::SingularHere,
                    () => BlockDecision::Redundant,
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
                let verdict = if seen.coarse > own { BlockDecision::Conditions } else { BlockDecision::Locked };
                Some(Decided::plain(verdict, Some(0)))
            }
            // independent conditions are what is drawn, however weak
            None => {
                let dof = seen.regular.and_then(|k| k.checked_sub(own)).filter(|k| *k > 0)?;
                Some(Decided { weak: true, ..Decided::plain(BlockDecision::Conditions, Some(dof)) })
            }
        }
    }

    /// The drawing with nearly parallel axes made parallel, where it then is plane; and the change.
    fn flattened(&self, tolerance: f64) -> Option<(Self, Vec<f64>)> {
        if self.model.is_planar() || !self.model.spec.couplings.is_empty() {
            return None;
        }
        let mut numbers = self.parallel(&self.model.initial(), tolerance::INTENDED_PARALLEL * tolerance);
        let mut plane = self.changed_to(&numbers)?;
        if !plane.model.is_planar() {
            // heights along the normal: each joint where its bodies fit
            let heights = plane.heights()?;
            numbers.iter_mut().zip(&heights).for_each(|(x, more)| *x += more);
            plane = self.changed_to(&numbers)?;
        }
        // the error of a hinge out of parallel is shared equally by its two bodies
        let most = |first: usize, limit: f64| most(&numbers, first) <= limit * tolerance;
        (plane.model.is_planar() && most(0, LARGEST_CHANGE) && most(3, tolerance::INTENDED_PARALLEL))
            .then_some((plane, numbers))
    }
}
