//! What changes at an instant: velocities by impulses, and which contacts press from there on.
//!
//! ```text
//! min |v⁺ − v⁻|_M     so that  C v⁺ + a = 0,  N v⁺ + a_N ≥ −e min(N v⁻ + a_N, 0)          (Newton, Moreau)
//! min |v' − M⁻¹ h|_M  so that  C v' + b = 0,  N v' + b_N ≥ 0                              (Gauss)
//! ```
//!
//! Bodies without inertia about an axis leave M singular, but not `M + Cᵀ W C` over rows that are always held. There C v⁺
//! and C v' are given, so that the nearest point is the same; the multipliers are λ - W C (v⁺ - v⁻).
//!
//! Both are the nearest point of a polyhedron in the mass metric: velocities and accelerations are unique, however many
//! contacts close at once and however redundant they are, and the energy never grows.

use crate::error::AnalysisError;
use partita_math::dense::{self, Matrix};
use partita_math::quadratic::Polyhedron;
use partita_math::tolerance;
use partita_model::Model;
use partita_system::prelude::*;
use partita_system::SystemError;

/// Halvings of the part of the bounces that keeps the energy.
const HALVINGS: usize = 50;

/// A condition on one side: `sign (C v + a) ≥ 0` where it is closed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OneSided {
    /// Its row.
    pub row: usize,
    /// 1 where the measure may grow from there, −1 where it may fall.
    pub sign: f64,
    /// The coefficient of restitution e.
    pub restitution: f64,
    /// What closes more slowly does not bounce.
    pub slow: f64,
}

/// The equations at a state, in the mass metric: x = Lᵀ v with M = L Lᵀ.
pub struct Impact {
    nv: usize,
    t: f64,
    /// L.
    l: Vec<f64>,
    /// Rows of C L⁻ᵀ, of length 1, and the lengths that they had.
    rows: Matrix,
    lengths: Vec<f64>,
    /// W, zero but for rows that are always held, where M alone is no metric.
    weights: Vec<f64>,
    a: Vec<f64>,
    b: Vec<f64>,
    /// L⁻¹ h and Lᵀ v.
    h: Vec<f64>,
    x: Vec<f64>,
    names: Vec<String>,
}

/// Where velocities, or accelerations, go.
pub struct Reached {
    /// v⁺ or v'.
    pub v: Vec<f64>,
    /// Impulses or forces along all rows.
    pub multipliers: Vec<f64>,
    /// Change of the kinetic energy; of accelerations without meaning.
    pub energy: f64,
}

/// A point in the mass metric and the multipliers of all rows that lead there.
type Nearest = (Vec<f64>, Vec<f64>);

/// The rows of a mechanism from which joints were parted, among those of the whole one.
pub struct Acting<'m> {
    /// What moves.
    pub model: &'m Model,
    /// The row of the whole mechanism that each of its rows is.
    pub rows: &'m [usize],
    /// Number of rows of the whole mechanism.
    pub count: usize,
    /// Those, of the whole mechanism, that are always held.
    pub always: &'m [usize],
    /// Those among them that the mechanism itself has found to be combinations of the others.
    pub dropped: &'m [usize],
}

/// Rows, each with a number: the rate that it is to have, or a force along it.
pub type Rates = [(usize, f64)];

fn failed(t: f64, message: String) -> AnalysisError {
    SystemError::Tick { t, message }.into()
}

impl Impact {
    /// At (t, q, v).
    ///
    /// # Errors
    /// Where the equations cannot be evaluated, or bodies without mass can move.
    pub fn new(acting: &Acting, t: f64, q: &[f64], v: &[f64]) -> Result<Self, AnalysisError> {
        let model = acting.model;
        let (size, structure, mut s) = (model.size(), model.structure(), model.scratch());
        let n = size.nv;
        let (mut phi, mut c) = (vec![0.0; size.holonomic], vec![0.0; structure.pattern.nnz()]);
        let (mut a, mut b) = (vec![0.0; size.rows], vec![0.0; size.rows]);
        let (mut l, mut h) = (vec![0.0; n * n], vec![0.0; n]);
        model.position(t, q, &mut s, &mut phi, &mut c, &mut a)?;
        model.velocity(t, q, v, &mut s, &mut b)?;
        model.dynamics(t, q, v, &mut s, &mut l, &mut h)?;
        let dense_row = |i: usize| {
            let mut row = vec![0.0; n];
            structure.pattern.row(i).for_each(|e| row[structure.pattern.col_idx[e]] = c[e]);
            row
        };
        let (mass, mut weights) = (l.clone(), vec![0.0; acting.count]);
        let mut factored = dense::cholesky(&mut l, n);
        if factored.is_err() {
            l = mass;
            let square = |j: usize| structure.velocities[j].displacement.powi(2);
            let largest = (0..n).fold(0.0, |m: f64, j| m.max(l[j * n + j] * square(j)));
            let counts = |row: &usize| acting.always.contains(row) && !acting.dropped.contains(row);
            for (i, &to) in acting.rows.iter().enumerate().filter(|x| counts(x.1)) {
                let row = dense_row(i);
                let size: f64 = (0..n).map(|j| row[j] * row[j] * square(j)).sum();
                weights[to] = if size > 0.0 { largest / size } else { 0.0 };
                for e in 0..n * n {
                    l[e] += weights[to] * row[e / n] * row[e % n];
                }
            }
            factored = dense::cholesky(&mut l, n);
        }
        factored.map_err(|_| {
            let message =
                "velocities change abruptly here, but bodies without mass can move along: give every body a mass";
            failed(t, message.into())
        })?;
        let mut rows = Matrix::new(acting.count, n);
        let mut names = vec![String::new(); acting.count];
        let [mut lengths, mut all_a, mut all_b] = [const { Vec::new() }; 3];
        [&mut lengths, &mut all_a, &mut all_b].into_iter().for_each(|x| x.resize(acting.count, 0.0));
        for (i, &to) in acting.rows.iter().enumerate() {
            let row = rows.row_mut(to);
            row.copy_from_slice(&dense_row(i));
            let moved = row.iter().zip(&structure.velocities).map(|(x, v)| (x * v.displacement).abs());
            // what is rounding has no direction
            let empty = moved.fold(0.0, f64::max) <= tolerance::SOLUTION_ROUNDING * structure.rows[i].size();
            if acting.dropped.contains(&to) || empty {
                row.fill(0.0);
            }
            dense::cholesky_forward(&l, n, row);
            lengths[to] = dense::dot(row, row).sqrt();
            if lengths[to] > 0.0 {
                row.iter_mut().for_each(|x| *x /= lengths[to]);
            }
            (all_a[to], all_b[to], names[to]) = (a[i], b[i], structure.rows[i].name.to_string());
        }
        dense::cholesky_forward(&l, n, &mut h);
        let (a, b) = (all_a, all_b);
        let mut impact = Self { nv: n, t, l, rows, lengths, weights, a, b, h, x: Vec::new(), names };
        impact.x = impact.to_metric(v);
        Ok(impact)
    }

    fn to_metric(&self, v: &[f64]) -> Vec<f64> {
        let n = self.nv;
        (0..n).map(|j| (j..n).map(|i| self.l[i * n + j] * v[i]).sum()).collect()
    }

    /// Rows of these that do not follow from one another.
    fn independent(&self, rows: &[usize]) -> Vec<usize> {
        let n = rows.len();
        let mut gram: Vec<f64> =
            (0..n * n).map(|e| dense::dot(self.rows.row(rows[e / n]), self.rows.row(rows[e % n]))).collect();
        let mut order = vec![0; n];
        let rank = dense::pivoted_cholesky(&mut gram, n, n, tolerance::REDUNDANT, &mut order);
        let mut kept: Vec<usize> = order[..rank].iter().map(|&i| rows[i]).collect();
        kept.sort_unstable();
        kept
    }

    /// Whether a row follows from others.
    pub fn follows(&self, row: usize, others: &[usize]) -> bool {
        let kept = self.independent(others);
        self.independent(&[&kept[..], &[row]].concat()).len() == kept.len()
    }

    /// The nearest point to `from` where the rows `held` have these values, and the others at least theirs.
    fn nearest(&self, from: &[f64], held: &Rates, least: &[(OneSided, f64)]) -> Result<Nearest, AnalysisError> {
        let all: Vec<usize> = held.iter().map(|x| x.0).collect();
        let kept = self.independent(&all);
        // what is held decides about those that follow from it
        let least: Vec<(OneSided, f64)> = least.iter().copied().filter(|x| !self.follows(x.0.row, &kept)).collect();
        let part = |row: usize, x: f64| if self.lengths[row] > 0.0 { x / self.lengths[row] } else { 0.0 };
        let value = |row: usize| held.iter().find(|x| x.0 == row).map_or(0.0, |x| part(row, x.1));
        let equations: Vec<&[f64]> = kept.iter().map(|&i| self.rows.row(i)).collect();
        let mut normals = Matrix::new(least.len(), self.nv);
        for (i, (side, _)) in least.iter().enumerate() {
            let row = self.rows.row(side.row);
            normals.row_mut(i).iter_mut().zip(row).for_each(|(to, x)| *to = side.sign * x);
        }
        let polyhedron = Polyhedron {
            equations: match equations.is_empty() {
                true => Matrix::new(0, self.nv),
                false => Matrix::from_rows(&equations),
            },
            values: kept.iter().map(|&i| value(i)).collect(),
            least: least.iter().map(|(side, x)| part(side.row, *x)).collect(),
            normals,
        };
        let (x, pushing) = polyhedron.nearest_with_pushing(from).map_err(|e| {
            let names: Vec<&str> = least.iter().map(|x| &*self.names[x.0.row]).collect();
            failed(self.t, format!("the contacts that are closed here cannot all hold ({}): {e}", names.join(", ")))
        })?;
        // rows left out as dependent agree with the others, or nothing can
        let size = dense::dot(&x, &x).sqrt().max(dense::dot(from, from).sqrt());
        for &(row, wanted) in held {
            let off = (dense::dot(self.rows.row(row), &x) - part(row, wanted)).abs();
            if off > tolerance::WORST_ROUNDING * size.max(part(row, wanted).abs()) {
                let message = format!(
                    "\"{}\" cannot be as it should from here on: the other constraints of this instant contradict it; \
                     release one of them, or choose other rates",
                    self.names[row]
                );
                return Err(failed(self.t, message));
            }
        }
        let mut multipliers = vec![0.0; self.lengths.len()];
        let loaded: Vec<usize> = kept.into_iter().chain(pushing.into_iter().map(|i| least[i].0.row)).collect();
        let m = loaded.len();
        let mut gram: Vec<f64> =
            (0..m * m).map(|e| dense::dot(self.rows.row(loaded[e / m]), self.rows.row(loaded[e % m]))).collect();
        let moved: Vec<f64> = x.iter().zip(from).map(|(x, from)| x - from).collect();
        let mut along: Vec<f64> = loaded.iter().map(|&i| dense::dot(self.rows.row(i), &moved)).collect();
        if dense::cholesky(&mut gram, m).is_ok() {
            dense::cholesky_solve(&gram, m, &mut along);
            loaded.iter().zip(&along).for_each(|(&i, x)| multipliers[i] = x / self.lengths[i]);
        }
        for i in (0..multipliers.len()).filter(|&i| self.weights[i] > 0.0) {
            multipliers[i] -= self.weights[i] * self.lengths[i] * dense::dot(self.rows.row(i), &moved);
        }
        Ok((x, multipliers))
    }

    /// Velocities after the impulses with which these rows get to these rates, and the one-sided ones do not close
    /// further: what is held at once first, then the bounces. Rates `set` for this instant alone that only a stop in
    /// the way contradicts act before it: what is set into a stop bounces off it.
    ///
    /// # Errors
    /// Where conditions contradict each other.
    pub fn velocities(&self, lasting: &Rates, set: &Rates, sides: &[OneSided]) -> Result<Reached, AnalysisError> {
        let relative =
            |held: &Rates| -> Vec<(usize, f64)> { held.iter().map(|&(row, rate)| (row, rate - self.a[row])).collect() };
        let (lasting, all) = (relative(lasting), relative(&[lasting, set].concat()));
        let at_once = self.bounced(&self.x, &all, sides);
        let met = at_once.as_ref().is_ok_and(|(x, _)| self.blocked(&all, sides, x).is_none());
        let (x, multipliers) = match set.is_empty() || met {
            true => at_once?,
            false => {
                let (met, first) = self.nearest(&self.x, &all, &[])?;
                let (x, mut multipliers) = self.bounced(&met, &lasting, sides)?;
                multipliers.iter_mut().zip(&first).for_each(|(sum, first)| *sum += first);
                (x, multipliers)
            }
        };
        if let Some(side) = self.blocked(&lasting, sides, &x) {
            let message = format!(
                "\"{}\" is in the way of the drives, which move what it stops at a rate of {:.4} into it; move the stop, or \
                 let the drives end before it",
                self.names[side.row],
                self.rate_of(side, &x).abs()
            );
            return Err(failed(self.t, message));
        }
        let energy = self.kinetic(&x) - self.kinetic(&self.x);
        let mut v = x;
        dense::cholesky_backward(&self.l, self.nv, &mut v);
        Ok(Reached { v, multipliers, energy })
    }

    /// Half the square of a velocity in the metric of M.
    fn kinetic(&self, x: &[f64]) -> f64 {
        let held = (0..self.weights.len()).filter(|&i| self.weights[i] > 0.0);
        let along = |i: usize| self.lengths[i] * dense::dot(self.rows.row(i), x);
        0.5 * (dense::dot(x, x) - held.map(|i| self.weights[i] * along(i).powi(2)).sum::<f64>())
    }

    /// A one-sided condition that these rows, where they are not at rest, move against.
    fn blocked(&self, held: &Rates, sides: &[OneSided], x: &[f64]) -> Option<OneSided> {
        let closes = |side: &&OneSided| {
            let fastest = self.lengths[side.row] * dense::dot(x, x).sqrt() + self.a[side.row].abs();
            self.rate_of(**side, x) < -tolerance::EQUAL * fastest
        };
        let moves = held.iter().any(|x| x.1 != 0.0);
        sides.iter().find(closes).copied().filter(|_| moves)
    }

    /// The nearest point to `from` where rows are held and one-sided ones bounce by Newton's law. Where that would raise
    /// the energy, as a corner of unlike stops may, or others do not let it be, as a freewheel that is to turn back, all
    /// bounces are the largest part of it for which that is not so.
    fn bounced(&self, from: &[f64], held: &[(usize, f64)], sides: &[OneSided]) -> Result<Nearest, AnalysisError> {
        let (met, _) = self.nearest(from, held, &[])?;
        let closing = |&side: &OneSided| Some(self.rate_of(side, &met)).filter(|&rate| rate < -side.slow);
        let rates: Vec<f64> = sides.iter().map(|side| closing(side).unwrap_or(0.0)).collect();
        let bounced = |part: f64| {
            let least = sides
                .iter()
                .zip(&rates)
                .map(|(&side, rate)| (side, -part * side.restitution * rate - side.sign * self.a[side.row]));
            self.nearest(from, held, &least.collect::<Vec<_>>())
        };
        let most = dense::dot(&met, &met) * (1.0 + tolerance::LONG_ROUNDING);
        // drives and rates that are set bring energy of their own
        let idle = held.iter().all(|x| x.1 == 0.0) && sides.iter().all(|side| self.a[side.row] == 0.0);
        let too_much = |found: &Result<Nearest, AnalysisError>| match found {
            Ok((x, _)) => idle && dense::dot(x, x) > most,
            Err(_) => true,
        };
        let found = bounced(1.0);
        if !too_much(&found) {
            return found;
        }
        let (mut low, mut high) = (0.0, 1.0);
        bounced(low)?;
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            *(if too_much(&bounced(middle)) { &mut high } else { &mut low }) = middle;
        }
        bounced(low)
    }

    /// Accelerations with these rows held, and the forces of those on one side that press; `applied` are forces along rows.
    ///
    /// # Errors
    /// As [`velocities`](Self::velocities).
    pub fn accelerations(&self, held: &[usize], sides: &[OneSided], applied: &Rates) -> Result<Reached, AnalysisError> {
        let held: Vec<(usize, f64)> = held.iter().map(|&row| (row, -self.b[row])).collect();
        let least: Vec<(OneSided, f64)> = sides.iter().map(|&side| (side, -side.sign * self.b[side.row])).collect();
        let mut free = self.h.clone();
        for &(row, force) in applied {
            let along = self.lengths[row] * force;
            free.iter_mut().zip(self.rows.row(row)).for_each(|(to, x)| *to += along * x);
        }
        let (x, multipliers) = self.nearest(&free, &held, &least)?;
        let mut v = x;
        dense::cholesky_backward(&self.l, self.nv, &mut v);
        Ok(Reached { v, multipliers, energy: f64::NAN })
    }

    /// The rate of a one-sided gap: negative where it closes.
    pub fn rate(&self, side: OneSided) -> f64 {
        self.rate_of(side, &self.x)
    }

    fn rate_of(&self, side: OneSided, x: &[f64]) -> f64 {
        let row = side.row;
        side.sign * (self.lengths[row] * dense::dot(self.rows.row(row), x) + self.a[row])
    }

    /// The length of a row in the mass metric.
    pub fn length(&self, row: usize) -> f64 {
        self.lengths[row]
    }

    /// The fastest that it may be at these speeds.
    pub fn fastest(&self, side: OneSided) -> f64 {
        self.lengths[side.row] * dense::dot(&self.x, &self.x).sqrt() + self.a[side.row].abs()
    }

    /// The largest second derivative that these forces may give it.
    pub fn strongest(&self, side: OneSided) -> f64 {
        self.lengths[side.row] * dense::dot(&self.h, &self.h).sqrt() + self.b[side.row].abs()
    }

    /// The second derivative that its force alone gives it.
    pub fn contact_acceleration(&self, side: OneSided, by: &Reached) -> f64 {
        side.sign * by.multipliers[side.row] * self.lengths[side.row].powi(2)
    }

    /// The force along its row that alone gives it this second derivative.
    pub fn force_for(&self, side: OneSided, acceleration: f64) -> f64 {
        let size = self.lengths[side.row].powi(2);
        if size > 0.0 {
            side.sign * acceleration / size
        } else {
            0.0
        }
    }

    /// Its second derivative at these accelerations.
    pub fn growth(&self, side: OneSided, vdot: &[f64]) -> f64 {
        let (row, x) = (side.row, self.to_metric(vdot));
        side.sign * (self.lengths[row] * dense::dot(self.rows.row(row), &x) + self.b[row])
    }
}
