//! Rates changed to first order without a matrix of all degrees of freedom: for mechanisms with many of them.
//!
//! ```text
//! (μ − A) (z, u) = (b, c)   in displacements x of all coordinates, multipliers ν, and results p that lie between (V1-V3):
//!
//! C x = 0
//! f_q (x + e) + f_v y + f_w w + f_ν ν + f_p p = 0     of f = C v + a, C v' + b, M v' − h − Cᵀ λ;   = p of results between
//!
//! y = (μ − W) x − b − β,   w = μ y − c − γ            β and γ zero on I, b and c zero on D
//! ```
//!
//! The derivatives are those of neighbours in the mechanism: the matrix has as many entries as there are bodies, and so have its
//! factors where bodies form chains. e are displacements that no loop allows. W x are the changes of the rates of displacements
//! with the displacements, of spatial rotations alone.

use crate::system::Size;
use partita_math::dense::Complex;
use partita_math::elimination::{LuFactors, LuOrder, Number, Pattern, Plan, PlanError};
use std::sync::Arc;

/// No row, no column.
const NONE: usize = usize::MAX;

/// What a row of the derivatives is of.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Column {
    Displacement(usize),
    Velocity(usize),
    Acceleration(usize),
    Multiplier(usize),
    Between(usize),
}

impl Column {
    /// The column j for n velocities and so many rows.
    fn of(j: usize, n: usize, rows: usize) -> Self {
        match j {
            _ if j < n => Self::Displacement(j),
            _ if j < 2 * n => Self::Velocity(j - n),
            _ if j < 3 * n => Self::Acceleration(j - 2 * n),
            _ if j < 3 * n + rows => Self::Multiplier(j - 3 * n),
            _ => Self::Between(j - 3 * n - rows),
        }
    }
}

/// What the choice of rows and coordinates determines.
#[derive(Debug)]
pub struct SparsePlan {
    /// Of the derivatives, and what its columns are of.
    expanded: Pattern,
    columns: Vec<Column>,
    c: Pattern,
    /// Number of velocities, and of results between.
    n: usize,
    between: usize,
    /// Rows kept, and coordinates.
    rows: Vec<usize>,
    dependent: Vec<usize>,
    independent: Vec<usize>,
    /// Index of each row among the rows kept, and of each velocity among the dependent ones.
    kept: Vec<usize>,
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
    /// Entries of the derivatives.
    pub expanded: Vec<f64>,
    /// Entries of C.
    pub c: Vec<f64>,
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
    pub(crate) memory: PointMemory,
}

/// Memory of what is computed at a point.
#[derive(Debug, Default)]
pub(crate) struct PointMemory {
    pub vdot: Vec<f64>,
    pub multipliers: Vec<f64>,
    /// Columns of N, and its rows.
    pub columns: Vec<Vec<(usize, f64)>>,
    pub by_coordinate: Vec<Vec<(usize, f64)>>,
    pub unit: Vec<f64>,
    pub column: Vec<f64>,
    pub moved: Vec<f64>,
    pub before: Vec<f64>,
    pub after: Vec<f64>,
}

impl PointMemory {
    /// For a system of this size.
    pub fn fit(&mut self, size: Size) {
        [&mut self.vdot, &mut self.unit].into_iter().for_each(|x| x.resize(size.nv, 0.0));
        self.multipliers.resize(size.rows, 0.0);
        self.columns.resize(size.nv, Vec::new());
        self.by_coordinate.resize(size.nq, Vec::new());
        let coordinates = [&mut self.column, &mut self.moved, &mut self.before, &mut self.after];
        coordinates.into_iter().for_each(|x| x.resize(size.nq, 0.0));
    }
}

impl SparsePlan {
    /// For these rows and coordinates; `turning` tells with which velocities the rates of the displacement of each change.
    pub fn new(
        (expanded, c): (Pattern, Pattern),
        (rows, dependent, independent): (&[usize], &[usize], &[usize]),
        turning: Vec<Vec<usize>>,
    ) -> Self {
        let (n, all) = (c.cols, c.rows);
        let numbered = |count: usize, of: &[usize]| {
            let mut out = vec![NONE; count];
            of.iter().enumerate().for_each(|(i, &j)| out[j] = i);
            out
        };
        let mut new = Self {
            between: expanded.cols - 3 * n - all,
            n,
            kept: numbered(all, rows),
            index: numbered(n, dependent),
            rows: rows.to_vec(),
            dependent: dependent.to_vec(),
            independent: independent.to_vec(),
            columns: (0..expanded.cols).map(|j| Column::of(j, n, all)).collect(),
            expanded,
            c,
            turning,
            pattern: Pattern::default(),
            targets: Vec::new(),
        };
        let mut met: Vec<(usize, usize)> = Vec::new();
        new.terms(&SparseValues::default(), |i, j, _| met.push((i, j)));
        new.pattern = pattern_of(new.size(), &met);
        let entry = |&(i, j): &(usize, usize)| {
            let row = new.pattern.row(i);
            (row.start + new.pattern.col_idx[row].partition_point(|&col| col < j)) as u32
        };
        new.targets = met.iter().map(entry).collect();
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
        self.n + 3 * self.rows.len() + self.between
    }

    /// The equation of each row of the derivatives, of [`size`](Self::size); none of a row that is not kept.
    fn equations(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let (n, r, all) = (self.n, self.rows.len(), self.c.rows);
        let row = move |i: usize| match i.checked_sub(self.between) {
            None => Some((i, n + 3 * r + i)),
            Some(f) if f < all => Some((i, n + r + self.kept[f])).filter(|_| self.kept[f] != NONE),
            Some(f) if f < 2 * all => Some((i, n + 2 * r + self.kept[f - all])).filter(|_| self.kept[f - all] != NONE),
            Some(f) => Some((i, f - 2 * all)),
        };
        (0..self.expanded.rows).filter_map(row)
    }

    /// What an entry of the derivatives is along.
    fn column(&self, e: usize) -> Column {
        self.columns[self.expanded.col_idx[e]]
    }

    /// Each term of the matrix: row, column, factors of 1, μ and μ². Values that are missing are zero.
    fn terms(&self, x: &SparseValues, mut put: impl FnMut(usize, usize, [f64; 3])) {
        let (n, r) = (self.n, self.rows.len());
        let (closed, rates, accelerations, between) = (n, n + r, n + 2 * r, n + 3 * r);
        let at = |values: &[f64], e: usize| values.get(e).copied().unwrap_or(0.0);
        for (row, i) in self.equations() {
            if i >= between {
                put(i, i, [-1.0, 0.0, 0.0]);
            }
            for e in self.expanded.row(row) {
                let f = at(&x.expanded, e);
                // by y and w, which follow from x, β and γ
                let (j, by_velocity) = match self.column(e) {
                    Column::Displacement(j) => {
                        put(i, j, [f, 0.0, 0.0]);
                        continue;
                    }
                    Column::Multiplier(row) => {
                        if self.kept[row] != NONE {
                            put(i, closed + self.kept[row], [f, 0.0, 0.0]);
                        }
                        continue;
                    }
                    Column::Between(p) => {
                        put(i, between + p, [f, 0.0, 0.0]);
                        continue;
                    }
                    Column::Velocity(j) => (j, true),
                    Column::Acceleration(j) => (j, false),
                };
                let times = |f: f64| if by_velocity { [f, 0.0, 0.0] } else { [0.0, f, 0.0] };
                put(i, j, if by_velocity { [0.0, f, 0.0] } else { [0.0, 0.0, f] });
                for (l, &to) in self.turning[j].iter().enumerate() {
                    put(i, to, times(-f * x.turning.get(j).map_or(0.0, |w| w[l])));
                }
                if self.index[j] != NONE {
                    put(i, rates + self.index[j], times(-f));
                    if !by_velocity {
                        put(i, accelerations + self.index[j], [-f, 0.0, 0.0]);
                    }
                }
            }
        }
        for (a, &row) in self.rows.iter().enumerate() {
            self.c.row(row).for_each(|e| put(closed + a, self.c.col_idx[e], [at(&x.c, e), 0.0, 0.0]));
        }
    }
}

/// A square pattern with these entries, columns ascending.
fn pattern_of(size: usize, entries: &[(usize, usize)]) -> Pattern {
    let mut columns = vec![Vec::new(); size];
    entries.iter().for_each(|&(i, j)| columns[i].push(j));
    columns.iter_mut().for_each(|row| {
        row.sort_unstable();
        row.dedup();
    });
    Pattern::from_rows(size, &columns)
}

impl SparseRates {
    /// With this plan, still without values.
    pub fn new(plan: Arc<SparsePlan>) -> Self {
        Self {
            values: SparseValues {
                expanded: vec![0.0; plan.expanded.nnz()],
                c: vec![0.0; plan.c.nnz()],
                turning: plan.turning.iter().map(|of| vec![0.0; of.len()]).collect(),
            },
            closing: None,
            parts: vec![[0.0; 3]; plan.pattern.nnz()],
            order: None,
            costs_more: false,
            displaced: vec![0.0; plan.n],
            work: Vec::with_capacity(plan.rows.len()),
            memory: PointMemory::default(),
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

    /// Multiplications of a factorisation, with pivots chosen once, for this μ; none where there are no pivots.
    pub fn multiplications(&mut self, shift: f64) -> Option<usize> {
        if self.order.is_none() {
            self.order = self.order_for(if shift > 0.0 { shift } else { 1.0 }).ok().map(Arc::new);
        }
        self.order.as_ref().map(|order| order.multiplications())
    }

    fn order_for(&self, mu: f64) -> Result<LuOrder, PlanError> {
        let values: Vec<f64> = self.parts.iter().map(|x| x[0] + mu * (x[1] + mu * x[2])).collect();
        LuOrder::new(&self.plan.pattern, &values)
    }

    /// Displacements of all coordinates with those of the independent ones, z: `Dᵀ z`.                    (V1)
    pub fn displace(&mut self, z: &[f64]) -> &[f64] {
        let (mut x, mut work) = (std::mem::take(&mut self.displaced), std::mem::take(&mut self.work));
        self.displaced_by(z, &mut x, &mut work);
        (self.displaced, self.work) = (x, work);
        &self.displaced
    }

    fn displaced_by(&self, z: &[f64], x: &mut [f64], work: &mut Vec<f64>) {
        let p = &*self.plan;
        p.independent.iter().zip(z).for_each(|(&i, z)| x[i] = *z);
        let Some((plan, factors)) = &self.closing else { return };
        p.dependent.iter().for_each(|&i| x[i] = 0.0);
        work.clear();
        let moved = |row: usize| p.c.row(row).map(|e| self.values.c[e] * x[p.c.col_idx[e]]).sum::<f64>();
        work.extend(p.rows.iter().map(|&row| -moved(row)));
        plan.solve(factors, work, 1);
        p.dependent.iter().zip(&*work).for_each(|(&i, s)| x[i] = *s);
    }

    /// (W x)_i.
    fn turned<T: Number>(&self, i: usize, x: &[T]) -> T {
        let own = self.plan.turning[i].iter().zip(&self.values.turning[i]);
        own.fold(T::default(), |sum, (&l, w)| sum.plus(x[l].scaled(*w)))
    }

    /// The right sides for (b, c) on I, and displacements e on D that no loop allows; b on return with W e.
    fn right_sides<T: Number>(&self, mu: T, memory: &mut Memory<T>) {
        let p = &*self.plan;
        let Memory { b, c, e, x: out } = memory;
        p.independent.iter().for_each(|&i| b[i] = b[i].plus(self.turned(i, e)));
        out.fill(T::default());
        for (row, i) in p.equations() {
            let mut sum = T::default();
            for entry in p.expanded.row(row) {
                let f = self.values.expanded[entry];
                let term = match p.column(entry) {
                    Column::Displacement(j) => e[j].scaled(-1.0),
                    Column::Velocity(j) => b[j],
                    Column::Acceleration(j) => b[j].times(mu).plus(c[j]),
                    Column::Multiplier(_) | Column::Between(_) => continue,
                };
                sum = sum.plus(term.scaled(f));
            }
            out[i] = sum;
        }
    }

    /// The function x ↦ A x; none where M and C determine no accelerations.
    pub fn products(&self) -> Option<impl FnMut(&[f64], &mut [f64]) + '_> {
        let p = &*self.plan;
        let (n, r, k) = (p.n, p.rows.len(), p.independent.len());
        // unknown are accelerations, multipliers, dependent changes of velocities, and what lies between
        let unknown = |e: usize| match p.column(e) {
            Column::Displacement(_) => NONE,
            Column::Velocity(j) if p.index[j] == NONE => NONE,
            Column::Velocity(j) => n + r + p.index[j],
            Column::Acceleration(j) => j,
            Column::Multiplier(row) if p.kept[row] == NONE => NONE,
            Column::Multiplier(row) => n + p.kept[row],
            Column::Between(p) => n + 2 * r + p,
        };
        // of the equations those of closed displacements are left out
        let equation = move |i: usize| if i < n { i } else { i - r };
        let mut entries: Vec<(usize, usize, f64)> = Vec::new();
        for (row, i) in p.equations() {
            if i >= n + 3 * r {
                entries.push((equation(i), equation(i), -1.0));
            }
            let own = p.expanded.row(row).map(|e| (equation(i), unknown(e), self.values.expanded[e]));
            entries.extend(own.filter(|e| e.1 != NONE));
        }
        entries.sort_unstable_by_key(|e| (e.0, e.1));
        let pattern = pattern_of(n + 2 * r + p.between, &entries.iter().map(|e| (e.0, e.1)).collect::<Vec<_>>());
        let values: Vec<f64> = entries.iter().map(|e| e.2).collect();
        let order = LuOrder::new(&pattern, &values).ok()?;
        let mut factors = LuFactors::default();
        factors.factor(&pattern, &order, &values).ok()?;
        let (mut x, mut y, mut side, mut work) = (vec![0.0; n], vec![0.0; n], vec![0.0; pattern.rows], Vec::new());
        Some(move |zu: &[f64], out: &mut [f64]| {
            self.displaced_by(&zu[..k], &mut x, &mut work);
            p.independent.iter().zip(&zu[k..]).for_each(|(&i, u)| y[i] = *u);
            p.dependent.iter().for_each(|&i| y[i] = 0.0);
            for (row, i) in p.equations() {
                let given = |e: usize| match p.column(e) {
                    Column::Displacement(j) => self.values.expanded[e] * x[j],
                    Column::Velocity(j) => self.values.expanded[e] * y[j],
                    _ => 0.0,
                };
                side[equation(i)] = -p.expanded.row(row).map(given).sum::<f64>();
            }
            factors.solve(&order, &mut side);
            for (a, &i) in p.independent.iter().enumerate() {
                (out[a], out[k + a]) = (y[i] + self.turned(i, &x), side[i]);
            }
        })
    }

    /// A in full, column by column: for comparisons.
    pub fn in_full(&self) -> Option<Vec<f64>> {
        let (mut product, m) = (self.products()?, self.count());
        let (mut x, mut column, mut out) = (vec![0.0; m], vec![0.0; m], vec![0.0; m * m]);
        for j in 0..m {
            x[j] = 1.0;
            product(&x, &mut column);
            x[j] = 0.0;
            (0..m).for_each(|i| out[i * m + j] = column[i]);
        }
        Some(out)
    }
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
    /// Pivots, and the plan to whose matrices they belong; others that may serve as well.
    order: Option<(Arc<LuOrder>, Arc<SparsePlan>)>,
    other: Option<(Arc<LuOrder>, Arc<SparsePlan>)>,
    factors: LuFactors<T>,
    values: Vec<T>,
    memory: Memory<T>,
}

/// A matrix without pivots that serve.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("the sparse matrix is singular: take a shorter step")]
pub struct Unfactored;

impl<T: Number> ShiftedFactors<T> {
    /// Try the pivots of other factors before new ones are chosen.
    pub fn try_before<U>(&mut self, other: &ShiftedFactors<U>) {
        self.other.clone_from(&other.order);
    }

    /// Factor for this μ. While the pivots serve nothing is allocated.
    ///
    /// # Errors
    /// A singular matrix, or one that is not finite.
    pub fn factor(&mut self, of: &SparseRates, mu: T) -> Result<(), Unfactored> {
        let plan = &*of.plan;
        let (n, size) = (plan.n, plan.size());
        let Memory { b, c, e, x } = &mut self.memory;
        [b, c, e].into_iter().for_each(|x| x.resize(n, T::default()));
        x.resize(size, T::default());
        self.mu = mu;
        self.values.clear();
        let value = |[a, b, c]: &[f64; 3]| T::real(*a).plus(mu.times(T::real(*b).plus(mu.scaled(*c))));
        self.values.extend(of.parts.iter().map(value));
        if self.order.as_ref().is_none_or(|(_, plan)| !Arc::ptr_eq(plan, &of.plan)) {
            self.order = of.order.clone().map(|order| (order, of.plan.clone()));
        }
        for _ in 0..2 {
            if let Some((order, of_plan)) = &self.order {
                let is_for = Arc::ptr_eq(of_plan, &of.plan);
                if is_for && self.factors.factor(&plan.pattern, order, &self.values).is_ok() {
                    return Ok(());
                }
            }
            std::mem::swap(&mut self.order, &mut self.other);
        }
        // pivots for this μ, or for a real one as large
        let order = of.order_for(mu.size()).map_err(|_| Unfactored)?;
        let made = self.factors.factor_by_any(&plan.pattern, &order, &self.values).map_err(|_| Unfactored);
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
