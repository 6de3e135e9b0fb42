//! Rates changed to first order without a matrix of all degrees of freedom: for mechanisms with many of them.
//!
//! ```text
//! (μ − A) (z, u) = (b, c)   in all displacements x, changes of velocities y = (μ − W) x − b − β, of accelerations
//!                           w = μ y − c − γ and of multipliers ν; β and γ zero on I, b and c zero on D
//!
//! C x                                                          = 0                              (V1)
//! (R_q − C W) x − C β                                          = C b                            (V2)
//! (S_q − μ R_q + S_v (μ − W)) x − S_v β − C γ                  = C c + S_v b                    (V3)
//! (μ² M + μ (r_v − M W) + r_q − r_v W) x − (μ M + r_v) β − M γ − Cᵀ ν = (μ M + r_v) b + M c
//! ```
//!
//! R = C v + a, s = C v' + b and r = M v' − h − Cᵀ λ couple bodies that have a joint or a force in common, and no others: the
//! matrix has as many entries as there are bodies, and so have its factors where bodies form chains. W x are the changes of the
//! rates of displacements with the displacements, of spatial rotations alone.

use crate::system::{Changes, Couplings};
use partita_math::dense::Complex;
use partita_math::elimination::{LuFactors, LuOrder, Number, Pattern, Plan};
use std::sync::Arc;

/// No row, no column.
const NONE: usize = usize::MAX;

/// Frequency for which pivots are chosen first, over the root of the largest stiffness over the largest mass. Unit: ratio.
/// Reason: stiff motions and soft ones both count there.
const FIRST_SHIFT: f64 = 1e-3;

/// What the choice of rows and coordinates determines.
#[derive(Debug)]
pub struct SparsePlan {
    couplings: Arc<Couplings>,
    mass: Pattern,
    c: Pattern,
    /// Rows kept, and coordinates.
    rows: Vec<usize>,
    dependent: Vec<usize>,
    independent: Vec<usize>,
    /// Index of each velocity among the dependent ones.
    index: Vec<usize>,
    /// Velocities with which the rates of the displacement of each change.
    turning: Vec<Vec<usize>>,
    /// Of the matrix, and where each term is added.
    pattern: Pattern,
    targets: Vec<u32>,
}

/// What the equations are at a point.
#[derive(Debug, Default)]
pub struct SparseValues {
    /// Entries of M.
    pub mass: Vec<f64>,
    /// Entries of C.
    pub c: Vec<f64>,
    /// Changes of the equations along the groups of the couplings.
    pub changes: Changes,
    /// Entries of W, velocity by velocity in the order of [`SparsePlan::turning`].
    pub turning: Vec<Vec<f64>>,
}

/// Rates changed to first order, as the entries of sparse equations.
#[derive(Debug)]
pub struct SparseRates {
    plan: Arc<SparsePlan>,
    values: SparseValues,
    /// Factors of C_D.
    closing: Option<(Plan, Vec<f64>)>,
    /// Entries of the matrix: factors of 1, μ and μ².
    parts: Vec<[f64; 3]>,
    order: Option<Arc<LuOrder>>,
    /// Whether a matrix of all degrees of freedom costs less.
    pub(crate) costs_more: bool,
    /// Displacements, and memory of their closing.
    displaced: Vec<f64>,
    work: Vec<f64>,
}

impl SparsePlan {
    /// For these rows and coordinates; `turning` tells with which velocities the rates of the displacement of each change.
    pub fn new(
        couplings: Arc<Couplings>,
        (mass, c): (Pattern, Pattern),
        (rows, dependent, independent): (&[usize], &[usize], &[usize]),
        turning: Vec<Vec<usize>>,
    ) -> Self {
        let mut index = vec![NONE; mass.rows];
        dependent.iter().enumerate().for_each(|(i, &j)| index[j] = i);
        let mut new = Self {
            index,
            rows: rows.to_vec(),
            dependent: dependent.to_vec(),
            independent: independent.to_vec(),
            couplings,
            mass,
            c,
            turning,
            pattern: Pattern::default(),
            targets: Vec::new(),
        };
        let mut met: Vec<(usize, usize)> = Vec::new();
        new.terms(&SparseValues::default(), |i, j, _| met.push((i, j)));
        let size = new.size();
        let mut columns = vec![Vec::new(); size];
        met.iter().for_each(|&(i, j)| columns[i].push(j));
        columns.iter_mut().for_each(|row| {
            row.sort_unstable();
            row.dedup();
        });
        new.pattern = Pattern::from_rows(size, &columns);
        let entry = |(i, j): (usize, usize)| {
            let row = new.pattern.row(i);
            row.start + new.pattern.col_idx[row].partition_point(|&col| col < j)
        };
        new.targets = met.iter().map(|&e| entry(e) as u32).collect();
        new
    }

    /// Whether it is for these.
    pub fn is_for(&self, (rows, dependent, independent): (&[usize], &[usize], &[usize])) -> bool {
        self.rows == rows && self.dependent == dependent && self.independent == independent
    }

    /// Velocities with which the rates of the displacement of each change.
    pub fn turning(&self) -> &[Vec<usize>] {
        &self.turning
    }

    /// Number of unknowns.
    fn size(&self) -> usize {
        self.mass.rows + 3 * self.rows.len()
    }

    /// Each term of the matrix: row, column, factors of 1, μ and μ². Values that are missing are zero.
    fn terms(&self, x: &SparseValues, mut put: impl FnMut(usize, usize, [f64; 3])) {
        let (n, r, of) = (self.mass.rows, self.rows.len(), &self.couplings);
        let (closed, rates, accelerations) = (n, n + r, n + 2 * r);
        let at = |values: &[f64], e: usize| values.get(e).copied().unwrap_or(0.0);
        let turning = |j: usize, l: usize| x.turning.get(j).map_or(0.0, |w| w[l]);
        for i in 0..n {
            for e in self.mass.row(i) {
                let (j, m) = (self.mass.col_idx[e], at(&x.mass, e));
                put(i, j, [0.0, 0.0, m]);
                self.turning[j].iter().enumerate().for_each(|(l, &to)| put(i, to, [0.0, -m * turning(j, l), 0.0]));
                if self.index[j] != NONE {
                    put(i, rates + self.index[j], [0.0, -m, 0.0]);
                    put(i, accelerations + self.index[j], [-m, 0.0, 0.0]);
                }
            }
            for e in of.forces_by_position.row(i) {
                let j = of.forces_by_position.col_idx[e];
                put(i, j, [at(&x.changes.forces, of.position_groups[j] * n + i), 0.0, 0.0]);
            }
            for e in of.forces_by_velocity.row(i) {
                let j = of.forces_by_velocity.col_idx[e];
                let d = at(&x.changes.forces, of.velocity_groups[j] * n + i);
                put(i, j, [0.0, d, 0.0]);
                self.turning[j].iter().enumerate().for_each(|(l, &to)| put(i, to, [-d * turning(j, l), 0.0, 0.0]));
                if self.index[j] != NONE {
                    put(i, rates + self.index[j], [-d, 0.0, 0.0]);
                }
            }
        }
        for (a, &row) in self.rows.iter().enumerate() {
            let all = self.c.rows;
            for e in self.c.row(row) {
                let (j, c) = (self.c.col_idx[e], at(&x.c, e));
                put(j, closed + a, [-c, 0.0, 0.0]);
                put(closed + a, j, [c, 0.0, 0.0]);
                let turned = self.turning[j].iter().enumerate();
                turned.for_each(|(l, &to)| put(rates + a, to, [-c * turning(j, l), 0.0, 0.0]));
                if self.index[j] != NONE {
                    put(rates + a, rates + self.index[j], [-c, 0.0, 0.0]);
                    put(accelerations + a, accelerations + self.index[j], [-c, 0.0, 0.0]);
                }
            }
            for e in of.rates_by_position.row(row) {
                let j = of.rates_by_position.col_idx[e];
                let d = at(&x.changes.rates, of.position_groups[j] * all + row);
                put(rates + a, j, [d, 0.0, 0.0]);
                put(accelerations + a, j, [0.0, -d, 0.0]);
            }
            for e in of.accelerations_by_position.row(row) {
                let j = of.accelerations_by_position.col_idx[e];
                let d = at(&x.changes.accelerations, of.position_groups[j] * all + row);
                put(accelerations + a, j, [d, 0.0, 0.0]);
            }
            for e in of.accelerations_by_velocity.row(row) {
                let j = of.accelerations_by_velocity.col_idx[e];
                let d = at(&x.changes.accelerations, of.velocity_groups[j] * all + row);
                put(accelerations + a, j, [0.0, d, 0.0]);
                let turned = self.turning[j].iter().enumerate();
                turned.for_each(|(l, &to)| put(accelerations + a, to, [-d * turning(j, l), 0.0, 0.0]));
                if self.index[j] != NONE {
                    put(accelerations + a, rates + self.index[j], [-d, 0.0, 0.0]);
                }
            }
        }
    }
}

/// Σ of the entries of a row, as they are given, times x.
fn row_times<T: Number>(pattern: &Pattern, i: usize, value: impl Fn(usize, usize) -> f64, x: &[T]) -> T {
    pattern.row(i).fold(T::default(), |sum, e| {
        let j = pattern.col_idx[e];
        sum.plus(x[j].scaled(value(e, j)))
    })
}

impl SparseRates {
    /// With this plan, still without values.
    pub fn new(plan: Arc<SparsePlan>) -> Self {
        Self {
            values: SparseValues::default(),
            closing: None,
            parts: vec![[0.0; 3]; plan.pattern.nnz()],
            order: None,
            costs_more: false,
            displaced: vec![0.0; plan.mass.rows],
            work: Vec::with_capacity(plan.rows.len()),
            plan,
        }
    }

    /// Its plan.
    pub fn plan(&self) -> &Arc<SparsePlan> {
        &self.plan
    }

    /// Memory for the values of the equations, to be followed by [`settle`](Self::settle).
    pub fn values(&mut self) -> &mut SparseValues {
        &mut self.values
    }

    /// The values are known, and the factors of C_D by this elimination.
    pub fn settle(&mut self, closing: Option<(&Plan, &[f64])>) {
        match (&mut self.closing, closing) {
            (Some((plan, factors)), Some((now, by))) if plan.is_same(now) => {
                factors.clear();
                factors.extend_from_slice(by);
            }
            (own, closing) => *own = closing.map(|(plan, factors)| (plan.clone(), factors.to_vec())),
        }
        self.parts.fill([0.0; 3]);
        let (parts, mut targets) = (&mut self.parts, self.plan.targets.iter());
        self.plan.terms(&self.values, |_, _, term| {
            if let Some(&target) = targets.next() {
                parts[target as usize].iter_mut().zip(term).for_each(|(to, x)| *to += x);
            }
        });
    }

    /// Number of changes z and u.
    pub fn count(&self) -> usize {
        2 * self.plan.independent.len()
    }

    /// Dependent displacements: what the loops forbid is described by as many.
    pub fn beside(&self) -> usize {
        self.plan.dependent.len()
    }

    /// Multiplications of a factorisation, with pivots chosen once; none where there are no pivots.
    pub fn multiplications(&mut self) -> Option<usize> {
        if self.order.is_none() {
            let most = |part: usize| self.parts.iter().fold(0.0, |m: f64, x| m.max(x[part].abs()));
            let (stiffness, mass) = (most(0), most(2));
            let shift = FIRST_SHIFT * (stiffness / mass).sqrt();
            let shift = if shift.is_finite() && shift > 0.0 { shift } else { 1.0 };
            let values: Vec<f64> = self.parts.iter().map(|x| x[0] + shift * (x[1] + shift * x[2])).collect();
            self.order = LuOrder::new(&self.plan.pattern, &values).ok().map(Arc::new);
        }
        self.order.as_ref().map(|order| order.multiplications())
    }

    /// x_D = −C_D⁻¹ (C_I x_I + s) of rows s, where x_D is still anything; `work` grows once.
    fn close(&self, x: &mut [f64], s: impl Fn(usize) -> f64, work: &mut Vec<f64>) {
        let (p, Some((plan, factors))) = (&*self.plan, &self.closing) else { return };
        p.dependent.iter().for_each(|&i| x[i] = 0.0);
        work.clear();
        work.extend(p.rows.iter().map(|&row| -s(row) - row_times(&p.c, row, |e, _| self.values.c[e], x)));
        plan.solve(factors, work, 1);
        p.dependent.iter().zip(&*work).for_each(|(&i, s)| x[i] = *s);
    }

    /// Displacements of all coordinates with those of the independent ones, z: `Dᵀ z`.                    (V1)
    pub fn displace(&mut self, z: &[f64]) -> &[f64] {
        let (mut x, mut work) = (std::mem::take(&mut self.displaced), std::mem::take(&mut self.work));
        self.displaced_by(z, &mut x, &mut work);
        (self.displaced, self.work) = (x, work);
        &self.displaced
    }

    fn displaced_by(&self, z: &[f64], x: &mut [f64], work: &mut Vec<f64>) {
        self.plan.independent.iter().zip(z).for_each(|(&i, z)| x[i] = *z);
        self.close(x, |_| 0.0, work);
    }

    /// (W x)_i.
    fn turned<T: Number>(&self, i: usize, x: &[T]) -> T {
        let own = self.plan.turning[i].iter().zip(&self.values.turning[i]);
        own.fold(T::default(), |sum, (&l, w)| sum.plus(x[l].scaled(*w)))
    }

    /// Changes of the equations of row i along x, by positions or by velocities.
    fn along<T: Number>(&self, (pattern, groups): (&Pattern, &[usize]), of: &[f64], i: usize, x: &[T]) -> T {
        row_times(pattern, i, |_, j| of[groups[j] * pattern.rows + i], x)
    }

    /// The right sides for (b, c) on I, and displacements e on D that no loop allows; b on return with W e.
    fn right_sides<T: Number>(&self, mu: T, memory: &mut Memory<T>) {
        let (p, x, of) = (&*self.plan, &self.values, &*self.plan.couplings);
        let (n, r) = (p.mass.rows, p.rows.len());
        let Memory { b, c, e, x: out } = memory;
        p.independent.iter().for_each(|&i| b[i] = b[i].plus(self.turned(i, e)));
        let by_position = |p: &Pattern, x: &[f64], i: usize| self.along((p, &of.position_groups), x, i, e);
        let by_velocity = |p: &Pattern, x: &[f64], i: usize| self.along((p, &of.velocity_groups), x, i, b);
        let opposite = |x: T| x.scaled(-1.0);
        for i in 0..n {
            let mass = |x: &[T]| row_times(&p.mass, i, |e, _| self.values.mass[e], x);
            out[i] = mass(b).times(mu).plus(by_velocity(&of.forces_by_velocity, &x.changes.forces, i)).plus(mass(c));
            out[i] = out[i].plus(opposite(by_position(&of.forces_by_position, &x.changes.forces, i)));
        }
        for (a, &row) in p.rows.iter().enumerate() {
            let closing = |y: &[T]| row_times(&p.c, row, |e, _| x.c[e], y);
            let rate = by_position(&of.rates_by_position, &x.changes.rates, row);
            out[n + a] = T::default();
            out[n + r + a] = closing(b).plus(opposite(rate));
            out[n + 2 * r + a] = closing(c)
                .plus(by_velocity(&of.accelerations_by_velocity, &x.changes.accelerations, row))
                .plus(opposite(by_position(&of.accelerations_by_position, &x.changes.accelerations, row)))
                .plus(rate.times(mu));
        }
    }

    /// z' and u' of (z, u), into `out` (both of [`count`](Self::count) numbers), with factors of the saddle matrix.
    fn product(&self, saddle: &mut Saddle, zu: &[f64], out: &mut [f64]) {
        let (p, v, of) = (&*self.plan, &self.values, &*self.plan.couplings);
        let (n, k) = (p.mass.rows, p.independent.len());
        let Saddle { x, y, work, side, .. } = saddle;
        self.displaced_by(&zu[..k], x, work);
        p.independent.iter().zip(&zu[k..]).for_each(|(&i, u)| y[i] = *u);
        let positions = |p: &Pattern, of_x: &[f64], i: usize, x: &[f64]| {
            self.along((p, &of.position_groups), of_x, i, x)
        };
        let velocities = |p: &Pattern, of_y: &[f64], i: usize, y: &[f64]| {
            self.along((p, &of.velocity_groups), of_y, i, y)
        };
        self.close(y, |row| positions(&of.rates_by_position, &v.changes.rates, row, x), work); // (V2)
        for i in 0..n {
            side[i] = -positions(&of.forces_by_position, &v.changes.forces, i, x)
                - velocities(&of.forces_by_velocity, &v.changes.forces, i, y);
        }
        for (a, &row) in p.rows.iter().enumerate() {
            side[n + a] = -positions(&of.accelerations_by_position, &v.changes.accelerations, row, x)
                - velocities(&of.accelerations_by_velocity, &v.changes.accelerations, row, y);
        }
        saddle.factors.solve(&saddle.order, side); // (V3)
        for (a, &i) in p.independent.iter().enumerate() {
            (out[a], out[k + a]) = (y[i] + self.turned(i, x), side[i]);
        }
    }

    /// Factors with which rates themselves are changed to first order; none where M and C determine no accelerations.
    fn saddle(&self) -> Option<Saddle> {
        let (p, v) = (&*self.plan, &self.values);
        let (n, r) = (p.mass.rows, p.rows.len());
        let mut rows: Vec<Vec<(usize, f64)>> = vec![Vec::new(); n + r];
        for i in 0..n {
            rows[i].extend(p.mass.row(i).map(|e| (p.mass.col_idx[e], v.mass[e])));
        }
        for (a, &row) in p.rows.iter().enumerate() {
            for e in p.c.row(row) {
                let (j, c) = (p.c.col_idx[e], v.c[e]);
                rows[j].push((n + a, -c));
                rows[n + a].push((j, c));
            }
        }
        let values: Vec<f64> = rows.iter().flatten().map(|e| e.1).collect();
        let columns: Vec<Vec<usize>> = rows.into_iter().map(|row| row.into_iter().map(|e| e.0).collect()).collect();
        let pattern = Pattern::from_rows(n + r, &columns);
        let order = LuOrder::new(&pattern, &values).ok()?;
        let mut factors = LuFactors::default();
        factors.factor(&pattern, &order, &values).ok()?;
        let zeros = |n: usize| vec![0.0; n];
        Some(Saddle { order, factors, x: zeros(n), y: zeros(n), work: Vec::new(), side: zeros(n + r) })
    }

    /// A in full, column by column: for comparisons.
    pub fn in_full(&self) -> Option<Vec<f64>> {
        let (mut saddle, m) = (self.saddle()?, self.count());
        let (mut x, mut column, mut out) = (vec![0.0; m], vec![0.0; m], vec![0.0; m * m]);
        for j in 0..m {
            x[j] = 1.0;
            self.product(&mut saddle, &x, &mut column);
            x[j] = 0.0;
            (0..m).for_each(|i| out[i * m + j] = column[i]);
        }
        Some(out)
    }

    /// The function x ↦ A x; none where M and C determine no accelerations.
    pub fn products(&self) -> Option<impl FnMut(&[f64], &mut [f64]) + '_> {
        let mut saddle = self.saddle()?;
        Some(move |x: &[f64], out: &mut [f64]| self.product(&mut saddle, x, out))
    }
}

/// Factors of the saddle matrix of accelerations and multipliers, and memory of products.
struct Saddle {
    order: LuOrder,
    factors: LuFactors<f64>,
    x: Vec<f64>,
    y: Vec<f64>,
    work: Vec<f64>,
    side: Vec<f64>,
}

/// Right sides and solutions of all unknowns.
#[derive(Clone, Debug, Default)]
struct Memory<T> {
    b: Vec<T>,
    c: Vec<T>,
    e: Vec<T>,
    x: Vec<T>,
}

/// Factors of μ − A for one real or complex μ.
#[derive(Clone, Debug, Default)]
pub struct ShiftedFactors<T> {
    mu: T,
    /// Pivots, and the plan to whose matrices they belong.
    order: Option<(Arc<LuOrder>, Arc<SparsePlan>)>,
    factors: LuFactors<T>,
    values: Vec<T>,
    memory: Memory<T>,
}

/// A matrix without pivots that serve.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("the sparse matrix is singular: take a shorter step")]
pub struct Unfactored;

impl<T: Number> ShiftedFactors<T> {
    /// Factor for this μ. While the pivots serve nothing is allocated.
    ///
    /// # Errors
    /// A singular matrix, or one that is not finite.
    pub fn factor(&mut self, of: &SparseRates, mu: T) -> Result<(), Unfactored> {
        let plan = &*of.plan;
        let (n, size) = (plan.mass.rows, plan.size());
        let Memory { b, c, e, x } = &mut self.memory;
        [b, c, e].into_iter().for_each(|x| x.resize(n, T::default()));
        x.resize(size, T::default());
        self.mu = mu;
        self.values.clear();
        let value = |[a, b, c]: &[f64; 3]| {
            T::real(*a).plus(mu.times(T::real(*b).plus(mu.scaled(*c))))
        };
        self.values.extend(of.parts.iter().map(value));
        if self.order.as_ref().is_none_or(|(_, plan)| !Arc::ptr_eq(plan, &of.plan)) {
            self.order = of.order.clone().map(|order| (order, of.plan.clone()));
        }
        if let Some((order, _)) = &self.order {
            if self.factors.factor(&plan.pattern, order, &self.values).is_ok() {
                return Ok(());
            }
        }
        // pivots for this μ, or for a real one as large
        let real = mu.size();
        let values: Vec<f64> = of.parts.iter().map(|x| x[0] + real * (x[1] + real * x[2])).collect();
        let order = LuOrder::new(&plan.pattern, &values).map_err(|_| Unfactored)?;
        let made = self.factors.factor(&plan.pattern, &order, &self.values).map_err(|_| Unfactored);
        self.order = Some((Arc::new(order), of.plan.clone()));
        made
    }

    /// `(z, u) ← (μ − A)⁻¹ (z, u)`, with displacements behind them that no loop allows: they stay.
    pub fn solve(&mut self, of: &SparseRates, zue: &mut [T]) {
        let Some((order, _)) = &self.order else { return };
        let (plan, k) = (&*of.plan, of.plan.independent.len());
        let Memory { b, c, e, .. } = &mut self.memory;
        for (a, &i) in plan.independent.iter().enumerate() {
            (b[i], c[i], e[i]) = (zue[a], zue[k + a], T::default());
        }
        for (a, &i) in plan.dependent.iter().enumerate() {
            (b[i], c[i], e[i]) = (T::default(), T::default(), zue[2 * k + a]);
        }
        of.right_sides(self.mu, &mut self.memory);
        let Memory { b, x, .. } = &mut self.memory;
        self.factors.solve(order, x);
        for (a, &i) in plan.independent.iter().enumerate() {
            zue[a] = x[i];
            let rest = of.turned(i, x).plus(b[i]).scaled(-1.0);
            zue[k + a] = x[i].times(self.mu).plus(rest);
        }
    }
}

/// Factors for a real μ.
pub type RealShift = ShiftedFactors<f64>;
/// Factors for a complex μ.
pub type ComplexShift = ShiftedFactors<Complex>;
