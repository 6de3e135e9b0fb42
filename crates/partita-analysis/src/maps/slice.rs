//! The positions in which some goals are held, and the measure of a set of measurements there.

use super::Range;
use crate::error::AnalysisError;
use crate::inverse::{self, Inverse};
use crate::kinematic::{degrees_of_freedom, DegreesOfFreedom};
use crate::plausibility::idle_bodies;
use crate::poses::field::{Duty, Field};
use crate::poses::Target;
use partita_math::dense::{self, Matrix};
use partita_math::factor::{least_squares_min_norm, svd, svd_full, Svd};
use partita_math::tolerance;
use partita_model::model::ModelScratch;
use partita_model::Model;
use partita_system::manifold::{
    close, Closed, ClosingScratch, ClosureError, Ending, Linearization, Part, Residuals, Rule,
};
use partita_system::prelude::*;
use partita_system::SystemError;

/// Half of the step by which the measure is differentiated. Unit: characteristic displacements. Reason: the cube root
/// of round-off; the slope is exact to ten digits, and Newton's method converges as with the exact one.
const DIFFERENCE: f64 = 1e-5;
/// Longest step towards a singular position. Unit: characteristic displacements. Reason: the measure is nearly linear
/// over a tenth of a radian.
const LONGEST_APPROACH: f64 = 0.1;
/// Singular values below this belong to motions along a curve of singular constraints. Scale: natural scales. Reason:
/// differences leave 1e-10; those that fix the position are of size one.
const ALONG: f64 = 1e-6;
/// Singular positions of constraints are sought by all their conditions together below this measure. Scale: sine.
/// Reason: closing alone loses its direction there.
const NEARLY_SINGULAR: f64 = 0.05;

/// A singular position is located where its measure and the residuals of its loops are below this. Scale: natural scales.
/// Reason: some ten roundings; further steps gain nothing.
const SINGULAR_LOCATED: f64 = 1e-14;

/// To singular positions: closed to round-off, and the measure too.
const TO_SINGULAR: Rule = Rule::new(30, SINGULAR_LOCATED, tolerance::CLOSED).cut(LONGEST_APPROACH);

/// A set of measurements.
#[derive(Clone, Copy)]
pub enum Set<'a> {
    /// Along which actuators act.
    Actuators(&'a Inverse),
    /// Whose rates are wanted.
    Outputs(&'a [Target]),
    /// None: the constraints themselves.
    Constraints,
}

impl std::fmt::Debug for Set<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Actuators(_) => "Actuators",
            Self::Outputs(_) => "Outputs",
            Self::Constraints => "Constraints",
        })
    }
}

/// What is known of a closed position, in natural scales.
#[derive(Clone, Debug)]
pub(super) struct Evaluation {
    /// Orthonormal motions with the goals held (rows of n).
    pub slice: Vec<Vec<f64>>,
    /// Least singular value of the set on the motions.
    pub measure: f64,
    /// ψ for the rows of constraints, and for the measurements.
    left: (Vec<f64>, Vec<f64>),
    /// w.
    motion: Vec<f64>,
}

/// A mechanism with some goals held, and a set of measurements.
pub(super) struct Slice<'m> {
    pub field: Field<'m>,
    set: Set<'m>,
    limits: Vec<[f64; 2]>,
    pub one_branch: bool,
    /// Bodies without those that may spin by themselves, and the number of such rotations.
    tracked: Vec<usize>,
    idle: usize,
    /// Rank of the constraints, and dimension of the slice.
    rank: usize,
    pub dimension: usize,
    inverse: Option<inverse::InverseScratch>,
    /// Outputs that rest everywhere, such as those across the plane.
    resting: Vec<bool>,
    scratch: ModelScratch,
    rest: Vec<f64>,
    memory: ClosingScratch,
}

impl<'m> Slice<'m> {
    /// With as many free goals as remain.
    pub fn new(model: &'m Model, range: Range<'m>, set: Set<'m>) -> Result<Self, AnalysisError> {
        let size = model.size();
        let argument = |argument, message| Err(AnalysisError::Argument { argument, message });
        if size.rows != size.holonomic {
            let message = "the mechanism has conditions on rates alone (rolling), so that its positions are not a set \
                           with as many dimensions as degrees of freedom; maps need conditions on positions";
            return argument("grid", message.into());
        }
        let Some(start) = range.seeds.get(..size.nq) else {
            return argument("grid", "no position is given to begin with".into());
        };
        let DegreesOfFreedom { all, .. } = degrees_of_freedom(model, range.t, start)?;
        let mut made = Self::of_rank(model, range, set, size.nv - all);
        made.field.evaluate(start)?;
        let k = made.count_motions(start)?;
        let count = match set {
            Set::Actuators(x) => x.count(),
            Set::Outputs(_) => made.moving_rows(range.seeds)?,
            Set::Constraints => k,
        };
        if count != k {
            let message = format!(
                "of names {count} measurement{}; {k} {} needed, one for each degree of freedom",
                if count == 1 { "" } else { "s" },
                if k == 1 { "is" } else { "are" },
            );
            return argument("of", message);
        }
        made.field.evaluate(start)?;
        let held = {
            let motions = made.motions(start)?.2;
            made.held(&motions)?
        };
        let free = range.limits.iter().filter(|[lower, upper]| lower < upper).count();
        made.dimension = k - held.rank(tolerance::NULL_VALUE).min(k);
        if !(1..=2).contains(&made.dimension) || made.dimension != free {
            let message = format!(
                "{k} degree{} of freedom, of which the goals that are held leave {}: give one or two goals a range, and \
                 hold the others, so that curves (of two) or points (of one) remain; {free} {} a range",
                if k == 1 { "" } else { "s" },
                made.dimension,
                if free == 1 { "has" } else { "have" },
            );
            return argument("grid", message);
        }
        Ok(made)
    }

    /// For constraints of this rank, not checked.
    pub fn of_rank(model: &'m Model, range: Range<'m>, set: Set<'m>, rank: usize) -> Self {
        let (n, spinning) = (model.size().nv, idle_bodies(model));
        let mut field = Field::new(model, range.targets, range.t);
        let m = field.closings();
        for (i, [lower, upper]) in range.limits.iter().enumerate() {
            field.aims[i] = *lower;
            if lower < upper {
                field.duty[m + i] = Duty::Idle;
            }
        }
        let inverse = match set {
            Set::Actuators(x) => Some(x.memory(0)),
            _ => None,
        };
        Self {
            field,
            set,
            limits: range.limits.to_vec(),
            one_branch: range.one_branch,
            tracked: (0..model.spec.bodies.len()).filter(|i| !spinning.contains(i)).collect(),
            idle: 0,
            rank,
            dimension: n - rank,
            inverse,
            resting: Vec::new(),
            scratch: model.scratch(),
            rest: vec![0.0; n],
            memory: ClosingScratch::default(),
        }
    }

    /// Number of outputs that something moves at one of the positions; the others are left out.
    fn moving_rows(&mut self, seeds: &[f64]) -> Result<usize, SystemError> {
        let mut moving: Vec<bool> = Vec::new();
        for q in seeds.chunks_exact(self.field.model.size().nq) {
            let rows = self.rows(q)?;
            moving.resize(rows.len(), false);
            for (moves, row) in moving.iter_mut().zip(&rows) {
                *moves |= row.iter().any(|x| x.abs() > tolerance::NULL_VALUE);
            }
        }
        self.resting = moving.iter().map(|moves| !moves).collect();
        Ok(moving.iter().filter(|moves| **moves).count())
    }

    /// Derivatives of the constraints where last evaluated.
    fn constraints(&self) -> Matrix {
        let f = &self.field;
        let mut c = Matrix::new(f.closings(), f.pattern.cols);
        for i in 0..c.rows() {
            f.pattern.row(i).for_each(|e| c[(i, f.pattern.col_idx[e])] = f.c[e]);
        }
        c
    }

    /// The constraints decomposed, the weakest of them, and an orthonormal basis of the motions at q, where the field was
    /// evaluated.
    fn motions(&mut self, q: &[f64]) -> Result<(Svd, f64, Vec<Vec<f64>>), SystemError> {
        let f = svd_full(&self.constraints()).map_err(|_| self.not_finite())?;
        let weakest = if self.rank == 0 { 1.0 } else { f.s.get(self.rank - 1).copied().unwrap_or(0.0) };
        let n = self.field.pattern.cols;
        let free: Vec<Vec<f64>> = (self.rank..n).map(|j| (0..n).map(|i| f.v[(i, j)]).collect()).collect();
        if self.idle == 0 {
            return Ok((f, weakest, free));
        }
        let twists = self.twists(q, &free)?;
        let kept = (0..free.len() - self.idle).map(|c| combined(&free, |j| twists.v[(j, c)])).collect();
        Ok((f, weakest, kept))
    }

    /// What the motions do to the bodies that are tracked, decomposed.
    fn twists(&mut self, q: &[f64], motions: &[Vec<f64>]) -> Result<Svd, SystemError> {
        let model = self.field.model;
        let mut rates = Matrix::new(6 * self.tracked.len(), motions.len());
        for (j, x) in motions.iter().enumerate() {
            let v: Vec<f64> = x.iter().zip(&self.field.displacement).map(|(x, d)| x * d).collect();
            model.equations().look(q, &v, self.scratch.equations());
            for (a, &i) in self.tracked.iter().enumerate() {
                let b = model.body_state(i, &self.scratch);
                for axis in 0..3 {
                    rates[(6 * a + axis, j)] = b.velocity.0[axis] / model.length();
                    rates[(6 * a + 3 + axis, j)] = b.angular_velocity.0[axis];
                }
            }
        }
        svd_full(&rates).map_err(|_| self.not_finite())
    }

    /// The number of motions at q, where the field was evaluated, without rotations that move no other body.
    fn count_motions(&mut self, q: &[f64]) -> Result<usize, SystemError> {
        let motions = self.motions(q)?.2;
        if self.tracked.len() < self.field.model.spec.bodies.len() {
            self.idle = motions.len() - self.twists(q, &motions)?.rank(tolerance::NULL_VALUE);
        }
        Ok(motions.len() - self.idle)
    }

    fn not_finite(&self) -> SystemError {
        SystemError::NotFinite { what: "a measurement".into(), t: self.field.t }
    }

    /// Rates of the goals that are held, for each motion.
    fn held(&self, motions: &[Vec<f64>]) -> Result<Svd, SystemError> {
        let m = self.field.closings();
        let rows: Vec<usize> = (m..self.field.duty.len()).filter(|&i| self.field.duty[i] == Duty::Hard).collect();
        let mut g = Matrix::new(rows.len(), motions.len());
        for (a, &i) in rows.iter().enumerate() {
            motions.iter().enumerate().for_each(|(b, x)| g[(a, b)] = self.field.along(i, x));
        }
        svd_full(&g).map_err(|_| self.not_finite())
    }

    /// Rows of the measurements at q, in natural scales: over what is large for each, the same everywhere. Over their
    /// lengths in the coordinates of the tree they would not vanish at a dead point of a joint that closes a loop.
    fn rows(&mut self, q: &[f64]) -> Result<Vec<Vec<f64>>, SystemError> {
        let n = self.rest.len();
        let displacement = &self.field.displacement;
        match (self.set, &mut self.inverse) {
            (Set::Actuators(x), Some(memory)) => {
                // where E is the same everywhere, once
                if !x.is_constant() || memory.columns.iter().any(Vec::is_empty) {
                    x.columns(self.field.t, q, memory)?;
                }
                let row = |(j, column): (usize, &Vec<(usize, f64)>)| {
                    let (mut row, size) = (vec![0.0; n], x.size(j));
                    column.iter().for_each(|&(i, e)| row[i] += e * displacement[i] / size);
                    row
                };
                Ok(memory.columns.iter().enumerate().map(row).collect())
            }
            (Set::Outputs(targets), _) => {
                let mut rows = Vec::with_capacity(targets.len());
                for (i, x) in targets.iter().enumerate() {
                    if self.resting.get(i) == Some(&true) {
                        continue;
                    }
                    let (mut row, mut at) = (vec![0.0; n], x.velocities.iter());
                    x.rates(self.field.model, q, &mut self.rest, &mut self.scratch, |g| {
                        if let Some(&i) = at.next() {
                            row[i] = g * displacement[i] / x.displacement;
                        }
                    });
                    rows.push(row);
                }
                Ok(rows)
            }
            _ => Ok(Vec::new()),
        }
    }

    /// The weakest of the constraints, where last evaluated.
    pub fn weakest_constraint(&mut self, q: &[f64]) -> Result<f64, SystemError> {
        Ok(self.motions(q)?.1)
    }

    /// The place at q, where the field was evaluated.
    pub fn look(&mut self, q: &[f64]) -> Result<Evaluation, SystemError> {
        let (f, weakest, motions) = self.motions(q)?;
        let held = self.held(&motions)?;
        let k = motions.len();
        let slice = (k - self.dimension..k).map(|c| combined(&motions, |j| held.v[(j, c)])).collect();
        if matches!(self.set, Set::Constraints) {
            let last = self.rank.saturating_sub(1);
            let column = |x: &Matrix| (0..x.rows()).map(|i| x[(i, last)]).collect::<Vec<_>>();
            let left = (if self.rank == 0 { Vec::new() } else { column(&f.u) }, Vec::new());
            return Ok(Evaluation { slice, measure: weakest, left, motion: column(&f.v) });
        }
        let rows = self.rows(q)?;
        let mut p = Matrix::new(rows.len(), k);
        for (i, row) in rows.iter().enumerate() {
            motions.iter().enumerate().for_each(|(j, x)| p[(i, j)] = dense::dot(row, x));
        }
        let set = svd(&p).map_err(|_| self.not_finite())?;
        let motion = combined(&motions, |j| set.v[(j, k - 1)]);
        let u: Vec<f64> = (0..rows.len()).map(|i| set.u[(i, k - 1)]).collect();
        let mut row = vec![0.0; self.rest.len()];
        rows.iter().zip(&u).for_each(|(x, u)| dense::axpy(*u, x, &mut row));
        // what the constraints add to cancel the row across the motions
        let mut across = vec![0.0; f.u.rows()];
        for j in 0..self.rank {
            let along: f64 = (0..row.len()).map(|i| row[i] * f.v[(i, j)]).sum::<f64>() / f.s[j];
            (0..across.len()).for_each(|i| across[i] -= along * f.u[(i, j)]);
        }
        Ok(Evaluation { slice, measure: set.s[k - 1], left: (across, u), motion })
    }

    /// ψᵀ A(q) w with ψ and w of another place; the field is left at q.
    fn paired(&mut self, q: &[f64], place: &Evaluation) -> Result<f64, SystemError> {
        self.field.evaluate(q)?;
        let (across, u) = &place.left;
        let of_constraints: f64 = across.iter().enumerate().map(|(i, x)| x * self.field.along(i, &place.motion)).sum();
        let rows = self.rows(q)?;
        let of_set = rows.iter().zip(u).map(|(row, u)| u * dense::dot(row, &place.motion));
        Ok(of_constraints + of_set.sum::<f64>())
    }

    /// Derivatives of the measure at q along directions; the field is left elsewhere.
    pub fn slopes(&mut self, q: &[f64], place: &Evaluation, along: &[Vec<f64>]) -> Result<Vec<f64>, SystemError> {
        let y = self.field.y.clone();
        let mut found = Vec::with_capacity(along.len());
        for x in along {
            let length = dense::dot(x, x).sqrt();
            if length == 0.0 {
                found.push(0.0);
                continue;
            }
            let (by, mut sides) = (DIFFERENCE / length, [0.0; 2]);
            for (side, sign) in sides.iter_mut().zip([1.0, -1.0]) {
                let mut there = q.to_vec();
                self.moved(&mut there, x, sign * by);
                *side = self.paired(&there, place)?;
                self.field.y.copy_from_slice(&y);
            }
            found.push((sides[0] - sides[1]) / (2.0 * by));
        }
        Ok(found)
    }

    /// q displaced by `by` times a direction.
    pub fn moved(&mut self, q: &mut [f64], direction: &[f64], by: f64) {
        self.field.dv.copy_from_slice(direction);
        self.field.step(q, by);
    }

    /// Whether the goals where last evaluated are within the range, widened by this many large changes.
    pub fn is_within(&self, more: f64) -> bool {
        let slack = |i: usize| (more + tolerance::CLOSED) * self.field.targets[i].displacement;
        self.limits
            .iter()
            .enumerate()
            .filter(|(_, [lower, upper])| lower < upper)
            .all(|(i, [lower, upper])| (lower - slack(i)..=upper + slack(i)).contains(&self.field.y[i]))
    }

    /// Free goals where last evaluated, in large changes.
    pub fn free_goals(&self) -> Vec<f64> {
        let free = self.limits.iter().enumerate().filter(|(_, [lower, upper])| lower < upper);
        free.map(|(i, _)| self.field.y[i] / self.field.targets[i].displacement).collect()
    }

    /// Rates of the free goals along directions, where last evaluated: a row for each goal.
    pub fn free_goal_rates(&self, along: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let m = self.field.closings();
        let free = self.limits.iter().enumerate().filter(|(_, [lower, upper])| lower < upper);
        free.map(|(i, _)| along.iter().map(|x| self.field.along(m + i, x)).collect()).collect()
    }

    /// How the free goals orient the slice at a place, where the field was evaluated: 0 where they are singular, and of
    /// different signs on both sides of that.
    pub fn orientation(&self, place: &Evaluation) -> f64 {
        let rates = self.free_goal_rates(&place.slice);
        let length = |x: &Vec<f64>| dense::dot(x, x).sqrt().max(f64::MIN_POSITIVE);
        determinant(&rates) / rates.iter().map(length).product::<f64>()
    }

    /// Where all bodies are, whatever the coordinates: positions in lengths of the mechanism, and two axes.
    pub fn signature(&mut self, q: &[f64]) -> Vec<f64> {
        let model = self.field.model;
        model.equations().look(q, &self.rest, self.scratch.equations());
        let mut all = Vec::with_capacity(9 * self.tracked.len());
        for &i in &self.tracked {
            let b = model.body_state(i, &self.scratch);
            all.extend(b.position.0.map(|x| x / model.length()));
            all.extend((0..3).flat_map(|row| [b.rotation.0[row][0], b.rotation.0[row][1]]));
        }
        all
    }

    /// Derivative of the signature along a direction.
    pub fn signature_rate(&mut self, q: &[f64], direction: &[f64]) -> Vec<f64> {
        let mut sides = [1.0, -1.0].map(|sign| {
            let mut there = q.to_vec();
            self.moved(&mut there, direction, sign * DIFFERENCE);
            self.signature(&there)
        });
        let [one, other] = &mut sides;
        one.iter_mut().zip(other).for_each(|(x, y)| *x = (*x - *y) / (2.0 * DIFFERENCE));
        std::mem::take(one)
    }

    /// Move q to the singular position next to it, by this rule of closing; how it ended, with the place.
    pub fn locate(&mut self, q: &mut [f64], longest: f64) -> Result<(Closed, Option<Evaluation>), SystemError> {
        let mut memory = std::mem::take(&mut self.memory);
        let mut approach = Approach { slice: self, place: None, error: ClosureError::default() };
        let rule = TO_SINGULAR.cut(longest.min(LONGEST_APPROACH));
        let closed = match approach.slice.set {
            Set::Constraints => approach.slice.locate_constraints(q, longest),
            _ => close(&mut approach, q, &rule, &mut memory),
        };
        let place = approach.place.take();
        self.memory = memory;
        let closed = closed?;
        let place = match place {
            None if closed.is_closed() => Some(self.look(q)?),
            place => place,
        };
        Ok((closed, place))
    }

    /// Where the constraints lose rank: all conditions together, by least steps.
    fn locate_constraints(&mut self, q: &mut [f64], longest: f64) -> Result<Closed, SystemError> {
        let refused = |iterations, moved| Closed {
            ending: Ending::Elsewhere,
            iterations,
            closure_error: ClosureError::default(),
            moved,
        };
        let mut moved = 0.0;
        let mut iterations = 0;
        self.field.evaluate(q)?;
        let mut place = self.look(q)?;
        // along the motions first
        while place.measure > NEARLY_SINGULAR && iterations < TO_SINGULAR.iterations {
            let y = self.field.y.clone();
            let slopes = self.slopes(q, &place, &place.slice.clone())?;
            self.field.y.copy_from_slice(&y);
            let step = newton(&place.slice, place.measure, &slopes);
            let length = dense::dot(&step, &step).sqrt();
            let part = (LONGEST_APPROACH / length).min(1.0);
            moved += part * length;
            if moved.is_nan() || moved > longest {
                return Ok(refused(iterations, moved));
            }
            self.moved(q, &step, part);
            if !self.field.close_hard(q, &TO_SINGULAR)?.is_closed() {
                return Ok(refused(iterations, moved));
            }
            place = self.look(q)?;
            iterations += 1;
        }
        let mut psi = place.left.0;
        for _ in 0..TO_SINGULAR.iterations {
            iterations += 1;
            let (j, f) = self.all_conditions(q, &psi)?;
            let worst = ClosureError::of(f.iter().copied());
            let rhs: Vec<f64> = f.iter().map(|x| -x).collect();
            let (step, _) = least_squares_min_norm(&j, &rhs, ALONG).map_err(|_| self.not_finite())?;
            let n = self.rest.len();
            let length = step[..n].iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            moved += length;
            if moved.is_nan() || moved > longest {
                return Ok(refused(iterations, moved));
            }
            self.moved(q, &step[..n], 1.0);
            psi.iter_mut().zip(&step[n..]).for_each(|(x, d)| *x += d);
            if length <= tolerance::LAST_MOVE && worst.worst <= tolerance::LAST_MOVE {
                let (_, f) = self.all_conditions(q, &psi)?;
                let closure_error = ClosureError::of(f.iter().copied());
                let ending = if closure_error.worst <= tolerance::FITS { Ending::Closed } else { Ending::Unfinished };
                self.field.evaluate(q)?;
                return Ok(Closed { ending, iterations, closure_error, moved });
            }
        }
        Ok(refused(iterations, moved))
    }

    /// Φ, the goals held, Cᵀ ψ and |ψ|² − 1 with their derivatives by displacements and ψ.
    fn all_conditions(&mut self, q: &[f64], psi: &[f64]) -> Result<(Matrix, Vec<f64>), SystemError> {
        self.field.evaluate(q)?;
        let (m, n, y) = (self.field.closings(), self.rest.len(), self.field.y.clone());
        let hard: Vec<usize> = (0..self.field.duty.len()).filter(|&i| self.field.duty[i] == Duty::Hard).collect();
        let h = hard.len();
        let (mut j, mut f) = (Matrix::new(h + n + 1, n + m), vec![0.0; h + n + 1]);
        for (a, &i) in hard.iter().enumerate() {
            f[a] = self.field.phi[i];
            self.field.pattern.row(i).for_each(|e| j[(a, self.field.pattern.col_idx[e])] = self.field.c[e]);
        }
        let c = self.constraints();
        for i in 0..n {
            f[h + i] = (0..m).map(|row| c[(row, i)] * psi[row]).sum();
            (0..m).for_each(|row| j[(h + i, n + row)] = c[(row, i)]);
        }
        f[h + n] = 0.5 * (dense::dot(psi, psi) - 1.0);
        (0..m).for_each(|row| j[(h + n, n + row)] = psi[row]);
        for x in 0..n {
            let mut sides = [Vec::new(), Vec::new()];
            for (side, sign) in sides.iter_mut().zip([1.0, -1.0]) {
                let (mut there, mut unit) = (q.to_vec(), vec![0.0; n]);
                unit[x] = 1.0;
                self.moved(&mut there, &unit, sign * DIFFERENCE);
                self.field.evaluate(&there)?;
                self.field.y.copy_from_slice(&y);
                let c = self.constraints();
                *side = (0..n).map(|i| (0..m).map(|row| c[(row, i)] * psi[row]).sum()).collect::<Vec<f64>>();
            }
            (0..n).for_each(|i| j[(h + i, x)] = (sides[0][i] - sides[1][i]) / (2.0 * DIFFERENCE));
        }
        self.field.evaluate(q)?;
        Ok((j, f))
    }

    /// The direction of the curve of singular positions at q, where the field was evaluated; none where there is no
    /// single one.
    pub fn direction(&mut self, q: &[f64], place: &Evaluation) -> Result<Option<Vec<f64>>, SystemError> {
        let y = self.field.y.clone();
        let found = if let Set::Constraints = self.set {
            let (j, _) = self.all_conditions(q, &place.left.0)?;
            let f = svd_full(&j).map_err(|_| self.not_finite())?;
            let (n, all) = (self.rest.len(), f.v.cols());
            let null: Vec<usize> = (0..all).filter(|&i| f.s.get(i).is_none_or(|s| *s < ALONG)).collect();
            let mut part = Matrix::new(n, null.len());
            for (b, &i) in null.iter().enumerate() {
                (0..n).for_each(|a| part[(a, b)] = f.v[(a, i)]);
            }
            let own = svd(&part).map_err(|_| self.not_finite())?;
            let count = own.s.iter().filter(|s| **s > NEARLY_SINGULAR).count();
            (count == 1).then(|| (0..n).map(|i| own.u[(i, 0)]).collect())
        } else {
            let slopes = self.slopes(q, place, &place.slice)?;
            let size = dense::dot(&slopes, &slopes).sqrt();
            match (&slopes[..], &place.slice[..]) {
                ([a, b], [x, z]) if size > ALONG => {
                    Some(x.iter().zip(z).map(|(x, z)| (x * b - z * a) / size).collect())
                }
                _ => None,
            }
        };
        self.field.evaluate(q)?;
        self.field.y.copy_from_slice(&y);
        Ok(found)
    }
}

/// Of one or two rows.
fn determinant(rows: &[Vec<f64>]) -> f64 {
    match rows {
        [a, b] => a[0] * b[1] - a[1] * b[0],
        [a] => a[0],
        _ => 1.0,
    }
}

/// The sign by which the bases of two slices next to each other are oriented alike.
pub(super) fn alike(one: &[Vec<f64>], two: &[Vec<f64>]) -> f64 {
    let products: Vec<Vec<f64>> = one.iter().map(|x| two.iter().map(|y| dense::dot(x, y)).collect()).collect();
    determinant(&products).signum()
}

/// A combination of motions.
fn combined(motions: &[Vec<f64>], by: impl Fn(usize) -> f64) -> Vec<f64> {
    let mut sum = vec![0.0; motions.first().map_or(0, Vec::len)];
    motions.iter().enumerate().for_each(|(j, x)| dense::axpy(by(j), x, &mut sum));
    sum
}

/// The least displacement in the slice that changes the measure by its opposite, to first order.
pub(super) fn newton(slice: &[Vec<f64>], measure: f64, slopes: &[f64]) -> Vec<f64> {
    let square = dense::dot(slopes, slopes);
    let mut step = vec![0.0; slice.first().map_or(0, Vec::len)];
    for (x, slope) in slice.iter().zip(slopes) {
        dense::axpy(-measure * slope / square, x, &mut step);
    }
    step
}

/// Constraints, goals held and the measure, to zero together.
struct Approach<'s, 'm> {
    slice: &'s mut Slice<'m>,
    place: Option<Evaluation>,
    error: ClosureError,
}

impl Residuals for Approach<'_, '_> {
    fn evaluate(&mut self, q: &[f64]) -> Result<(), SystemError> {
        self.slice.field.evaluate(q)?;
        let place = self.slice.look(q)?;
        let f = &self.slice.field;
        let hard = f.phi.iter().zip(&f.duty).filter(|(_, duty)| **duty == Duty::Hard).map(|(x, _)| *x);
        self.error = ClosureError::of(hard.chain([place.measure]));
        self.place = Some(place);
        Ok(())
    }
    fn closure_error(&self, _part: usize) -> ClosureError {
        self.error
    }
}

impl Linearization for Approach<'_, '_> {
    fn solve(&mut self, q: &[f64], _parts: &[Part]) -> Result<bool, SystemError> {
        let Some(place) = &self.place else { return Ok(false) };
        let slice = &mut *self.slice;
        slice.field.factor_hard();
        let f = &slice.field;
        let wanted: Vec<f64> =
            f.phi.iter().zip(&f.duty).map(|(x, duty)| if *duty == Duty::Hard { -x } else { 0.0 }).collect();
        slice.field.solve(&wanted);
        let closing = slice.field.dv.clone();
        // closing moves across the slice, and changes the measure as well
        let along: Vec<Vec<f64>> = place.slice.iter().chain([&closing]).cloned().collect();
        let mut slopes = slice.slopes(q, place, &along)?;
        let measure = place.measure + slopes.pop().unwrap_or_default();
        let mut step = newton(&place.slice, measure, &slopes);
        dense::axpy(1.0, &closing, &mut step);
        slice.field.dv.copy_from_slice(&step);
        Ok(step.iter().all(|x| x.is_finite()))
    }
    fn length(&self, _part: usize) -> f64 {
        self.slice.field.dv.iter().fold(0.0, |m: f64, x| m.max(x.abs()))
    }
    fn scale(&mut self, _part: usize, by: f64) {
        self.slice.field.dv.iter_mut().for_each(|x| *x *= by);
    }
    fn advance(&mut self, q: &mut [f64]) {
        self.slice.field.step(q, 1.0);
    }
}
