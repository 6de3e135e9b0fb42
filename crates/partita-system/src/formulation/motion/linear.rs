//! Rates changed to first order along the motions that the loops allow.                                    (V1-V3)
//!
//! ```text
//! x = (z, u):   dq = N Dᵀ dz,   dv = Dᵀ du − G d(C v + a),   M_d du' = −D (dr − M G ds)
//! ```

use super::Motion;
use crate::error::Result;
use crate::linear_rates::{Along, LinearRates, Route, Rows};
use crate::positions::Positions;
use crate::reduction::Reduction;
use crate::sparse_rates::{PointMemory, SparsePlan, SparseRates};
use crate::system::{At, Changes, ConstrainedSystem, Derivatives, Directions};
use crate::tangent::Tangent;
use partita_math::dense::{self, Matrix};

/// Memory of a linearisation.
#[derive(Debug, Default)]
struct Columns {
    dq: Vec<f64>,
    dv: Vec<f64>,
    dvdot: Vec<f64>,
    lifted: Vec<f64>,
    kept: Vec<f64>,
}

/// `x ← x − G s` for changes s of all rows.                                                               (V2, V3)
fn correct<S: ConstrainedSystem>(r: &Reduction<S>, s: &[f64], kept: &mut Vec<f64>, x: &mut [f64]) {
    kept.clear();
    kept.extend(r.planned.partition.rows.iter().map(|&i| s[i]));
    r.solve(kept, 1);
    kept.iter().zip(&r.planned.partition.dependent).for_each(|(g, &i)| x[i] -= g);
}

impl<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>, P: Positions<'s, S, T>> Motion<'s, S, T, P> {
    /// The rates at (t, y) changed to first order: exactly where y holds all coordinates and the independent velocities of a
    /// partition, by differences otherwise.
    pub(super) fn linear(&mut self, t: f64, y: &[f64], out: &mut LinearRates) -> Result<()> {
        let r = self.tangent.seen();
        let holonomic = r.planned.partition.rows.iter().all(|&i| i < r.size().holonomic);
        match holonomic && self.positions.has_all() && self.tangent.independent(None).is_some() {
            true => self.by_variations(t, y, out),
            false => self.by_differences(t, y, out),
        }
    }

    fn by_differences(&mut self, t: f64, y: &[f64], out: &mut LinearRates) -> Result<()> {
        let sizes = self.layout.sizes.clone();
        let mut dy = vec![0.0; y.len()];
        self.derivative_by_levels(t, y, &mut dy)?;
        let count = self.offsets().1;
        let mut rates = |y: &[f64], dy: &mut [f64]| self.derivative_by_levels(t, y, dy);
        out.by_differences((count, |i| sizes[i]), (y, &dy), &mut rates)
    }

    fn by_variations(&mut self, t: f64, y: &[f64], out: &mut LinearRates) -> Result<()> {
        let (p, w) = self.offsets();
        if self.without_matrix(t, y, out)? {
            return Ok(());
        }
        if !self.tangent.seen().by_clusters() && self.tangent.seen().columns() == self.k {
            self.derivative_of_levels(t, y)?;
            return vary(self.tangent.reduction(), (t, self.positions.q()), (p, y.len()), out);
        }
        // D and M_d in full, for this choice
        let r = self.tangent.seen();
        let mut full = Reduction::dense(r.system.clone(), r.rank()).keeping(&r.planned.partition.rows);
        let independent = r.planned.partition.independent.clone();
        let q = &y[..p];
        full.position(t, q)?;
        full.refresh_scales(t, q)?;
        full.set_partition(t, &independent)?;
        full.evaluate(t, q, &y[p..w])?;
        vary(&mut full, (t, q), (p, y.len()), out)
    }

    /// As the entries of sparse equations; false where a matrix costs less, or the system does not know its couplings.
    fn without_matrix(&mut self, t: f64, y: &[f64], out: &mut LinearRates) -> Result<bool> {
        let r = self.tangent.seen();
        let (n, k, rank) = (r.size().nv, r.k(), r.rank());
        let counted = out.route == Route::Counted;
        if out.route == Route::Dense || counted && cost_of_matrix(n, k) <= least_cost(n, rank) {
            return Ok(false);
        }
        let system = r.system.clone();
        let Some(expanded) = system.expanded() else { return Ok(false) };
        let partition = &r.planned.partition;
        let chosen = (&partition.rows[..], &partition.dependent[..], &partition.independent[..]);
        let known = out.sparse.as_ref().is_some_and(|x| x.plan().is_for(chosen));
        if known && counted && out.sparse.as_ref().is_some_and(|x| x.costs_more) {
            return Ok(false);
        }
        if !known {
            let structure = system.structure();
            let own = |i: usize| structure.coordinates_of(i);
            let turning = |i: usize| match own(i).len() {
                1 => Vec::new(),
                _ => (0..n).filter(|&j| own(j) == own(i)).collect(),
            };
            let patterns = (expanded.clone(), system.pattern().clone());
            let plan = SparsePlan::new(patterns, chosen, (0..n).map(turning).collect());
            out.sparse = Some(Box::new(SparseRates::new(plan.into())));
        }
        self.derivative_of_levels(t, y)?;
        let (p, _) = self.offsets();
        let r = self.tangent.reduction();
        differentiate(r, (t, &y[..p]), out)?;
        let Some(sparse) = &mut out.sparse else { return Ok(false) };
        if counted && !known {
            let cost = sparse.multiplications(out.shift).map(|m| cost_of_sparse(system.expansion_cost(), m));
            sparse.costs_more = cost.is_none_or(|cost| cost >= cost_of_matrix(n, k));
        }
        Ok(!(counted && sparse.costs_more))
    }

    /// All levels at (t, y), without their rates.
    fn derivative_of_levels(&mut self, t: f64, y: &[f64]) -> Result<()> {
        self.levels(t, y, false)
    }
}

/// Multiplications by which one velocity is differentiated along one direction. Scale: number. Reason: measured, those of
/// dense factors as the unit.
const DIFFERENTIATED: usize = 60;
/// Factorisations for each linearisation. Scale: number. Reason: the length of steps changes more often than the matrix.
const FACTORED: usize = 10;
/// Multiplications with a real and with a complex number. Scale: number. Reason: one and four.
const OF_BOTH: usize = 5;
/// What a multiplication of sparse factors takes. Scale: those of dense ones. Reason: measured; each finds its place by an index.
const INDEXED: usize = 3;
/// What sparse derivatives take. Scale: multiplications in them. Reason: measured, with values, indices, and a share of
/// the recording.
const OF_EXPANSION: usize = 8;
/// Multiplications of sparse factors for each unknown, of which there are hardly fewer. Scale: number. Reason: those of four-bars
/// side by side.
const LEAST_FILL: usize = 9;
/// Multiplications of sparse derivatives for each velocity, of which there are hardly fewer. Scale: number. Reason: those of a
/// chain of pendulums in absolute coordinates.
const LEAST_EXPANSION: usize = 90;

/// Multiplications of a linearisation and its factors by a matrix of all degrees of freedom.
fn cost_of_matrix(n: usize, k: usize) -> usize {
    3 * DIFFERENTIATED * n * (n + k) + 2 * n * n * k + FACTORED * OF_BOTH * k * k * k / 3
}

/// The same without one.
fn cost_of_sparse(expansion: usize, multiplications: usize) -> usize {
    OF_EXPANSION * expansion + FACTORED * OF_BOTH * INDEXED * multiplications
}

/// What that costs at least.
fn least_cost(n: usize, rank: usize) -> usize {
    cost_of_sparse(LEAST_EXPANSION * n, LEAST_FILL * (n + 3 * rank))
}

/// The derivatives of the equations at the point to which r belongs, entry by entry, and how x is selected and lifted.
fn differentiate<S: ConstrainedSystem>(
    r: &mut Reduction<S>,
    (t, q): (f64, &[f64]),
    out: &mut LinearRates,
) -> Result<()> {
    out.begin_sparse();
    let (Some(sparse), Along::Sparse { rates, select, beside }) = (&mut out.sparse, &mut out.along) else {
        return Ok(());
    };
    let mut memory = std::mem::take(&mut sparse.memory);
    memory.fit(r.size());
    let PointMemory { vdot, multipliers, columns, by_coordinate, unit, column, moved, before, after } = &mut memory;
    r.full_acceleration(vdot);
    r.multipliers(t, q, vdot, multipliers)?;
    let plan = sparse.plan().clone();
    let x = sparse.values();
    x.c.copy_from_slice(&r.at.c);
    let (system, structure) = (&*r.system, r.system.structure());
    system.expand(&At { t, q, v: &r.at.v, vdot, multipliers }, &mut x.expanded);
    out.derivatives = Derivatives::Exact;
    // N and N⁺, whose columns and rows are perpendicular where a rotation in space has three
    let n = r.size().nv;
    let place = |i: usize| plan.turning()[i].iter().position(|&j| j == i).unwrap_or(0);
    let most = (0..n).map(place).max().unwrap_or(0);
    for which in 0..=most {
        (0..n).for_each(|i| unit[i] = f64::from(u8::from(place(i) == which)));
        system.rate(q, unit, column);
        for i in (0..n).filter(|&i| place(i) == which) {
            columns[i].clear();
            columns[i].extend(structure.coordinates_of(i).map(|l| (l, column[l])));
        }
    }
    let columns = &*columns;
    let inverse = |i: usize| {
        let square: f64 = columns[i].iter().map(|e| e.1 * e.1).sum();
        columns[i].iter().map(move |&(l, x)| (l, x / square))
    };
    let turns = |i: usize| !plan.turning()[i].is_empty();
    system.rate(q, &r.at.v, before);
    for which in (0..=most).filter(|_| most > 0) {
        // N is linear in q
        (0..n).for_each(|i| unit[i] = f64::from(u8::from(place(i) == which && turns(i))));
        system.rate(q, unit, column);
        moved.iter_mut().zip(q.iter().zip(&*column)).for_each(|(to, (q, d))| *to = q + d);
        system.rate(moved, &r.at.v, after);
        for i in (0..n).filter(|&i| turns(i)) {
            x.turning[i][which] = inverse(i).map(|(l, x)| x * (after[l] - before[l])).sum();
        }
    }
    by_coordinate.iter_mut().for_each(Vec::clear);
    (0..n).for_each(|i| columns[i].iter().for_each(|&(l, x)| by_coordinate[l].push((i, x))));
    [&mut *rates, &mut *select, &mut *beside].into_iter().for_each(Rows::clear);
    by_coordinate.iter().for_each(|row| rates.push(row.iter().copied()));
    let partition = &r.planned.partition;
    partition.independent.iter().for_each(|&i| select.push(inverse(i)));
    (0..partition.independent.len()).for_each(|i| select.push(std::iter::once((q.len() + i, 1.0))));
    partition.dependent.iter().for_each(|&i| beside.push(inverse(i)));
    sparse.settle(r.closing());
    sparse.memory = memory;
    Ok(())
}

/// (V1-V3) at the point to which r belongs. Of the `dim` components of y p are coordinates.
fn vary<S: ConstrainedSystem>(
    r: &mut Reduction<S>,
    (t, q): (f64, &[f64]),
    (p, dim): (usize, usize),
    out: &mut LinearRates,
) -> Result<()> {
    let (n, rows, k) = (r.size().nv, r.size().rows, r.k());
    let (mut vdot, mut multipliers) = (vec![0.0; n], vec![0.0; rows]);
    r.full_acceleration(&mut vdot);
    r.multipliers(t, q, &vdot, &mut multipliers)?;
    let r = &*r;
    let system = &*r.system;
    let at = At { t, q, v: &r.at.v, vdot: &vdot, multipliers: &multipliers };
    // z, dependent displacements that no loop allows, and u
    let (moved_by, count) = (n, n + k);
    let mut x = Columns::default();
    [&mut x.dq, &mut x.dv, &mut x.dvdot].into_iter().for_each(|x| x.resize(count * n, 0.0));
    let mut changes = Changes::new(rows, n, count);
    for i in 0..n {
        for j in 0..k {
            x.dq[j * n + i] = r.at.dt[i * k + j]; // (V1)
            x.dv[(n + j) * n + i] = r.at.dt[i * k + j];
        }
    }
    let partition = &r.planned.partition;
    partition.dependent.iter().enumerate().for_each(|(j, &i)| x.dq[(k + j) * n + i] = 1.0);
    let along = |count: usize, x: &Columns, changes: &mut Changes| {
        system.vary(&at, &Directions { count, q: &x.dq, v: &x.dv, vdot: &x.dvdot }, changes)
    };
    // each level needs the changes of the one before
    if rows > 0 {
        along(moved_by, &x, &mut changes)?;
        for j in 0..moved_by {
            correct(r, &changes.rates[j * rows..(j + 1) * rows], &mut x.kept, &mut x.dv[j * n..(j + 1) * n]);
            // (V2)
        }
        along(count, &x, &mut changes)?;
        for j in 0..count {
            let s = &changes.accelerations[j * rows..(j + 1) * rows];
            correct(r, s, &mut x.kept, &mut x.dvdot[j * n..(j + 1) * n]); // (V3)
        }
    }
    let derivatives = along(count, &x, &mut changes)?;
    let structure = system.structure();
    let plain = |i: usize| structure.coordinates_of(i).len() == 1;
    out.begin(2 * k, partition.independent.iter().all(|&i| plain(i)));
    out.derivatives = derivatives;
    // rows of N⁺, N's columns being perpendicular where a rotation in space has three
    let mut coordinates = Matrix::new(n, p);
    let mut column = vec![0.0; p];
    x.lifted.resize(n, 0.0);
    for i in 0..n {
        x.lifted.fill(0.0);
        x.lifted[i] = 1.0;
        system.rate(q, &x.lifted, &mut column);
        let square: f64 = column.iter().map(|x| x * x).sum();
        column.iter().enumerate().for_each(|(l, x)| coordinates[(i, l)] = x / square);
    }
    let (m, mut lift, mut select) = (2 * k, vec![0.0; dim * 2 * k], vec![0.0; 2 * k * dim]);
    let mut coupling = vec![0.0; if n > k { m * dim } else { 0 }];
    for (i, &velocity) in partition.independent.iter().enumerate() {
        (0..p).for_each(|l| select[i * dim + l] = coordinates[(velocity, l)]);
        select[(k + i) * dim + p + i] = 1.0;
        lift[(p + i) * m + k + i] = 1.0;
    }
    let (mut moved, mut before, mut after) = (q.to_vec(), vec![0.0; p], vec![0.0; p]);
    system.rate(q, &r.at.v, &mut before);
    let mut du = vec![0.0; m];
    for j in 0..count {
        let (dq, dv) = (&x.dq[j * n..(j + 1) * n], &x.dv[j * n..(j + 1) * n]);
        system.rate(q, dq, &mut column);
        if j < k {
            (0..p).for_each(|i| lift[i * m + j] = column[i]);
        }
        // N is linear in q
        moved.iter_mut().zip(q.iter().zip(&column)).for_each(|(to, (q, d))| *to = q + d);
        system.rate(&moved, &r.at.v, &mut after);
        system.rate(q, dv, &mut column);
        (0..p).for_each(|i| column[i] += after[i] - before[i]);
        let force = &changes.forces[j * n..(j + 1) * n];
        for i in 0..k {
            du[i] = (0..p).map(|l| select[i * dim + l] * column[l]).sum();
            du[k + i] = -(0..n).map(|l| r.at.dt[l * k + i] * force[l]).sum::<f64>();
        }
        dense::cholesky_solve(&r.at.md_factor, k, &mut du[k..]);
        for (i, d) in du.iter().enumerate() {
            match j {
                _ if j < k => out.a[i * m + j] = *d,
                _ if j >= n => out.a[i * m + k + j - n] = *d,
                _ => {
                    let of = partition.dependent[j - k];
                    (0..p).for_each(|l| coupling[i * dim + l] += d * coordinates[(of, l)]);
                }
            }
        }
    }
    out.along =
        Along::Tangent { lift: Rows::of(&lift, m), select: Rows::of(&select, dim), coupling: Rows::of(&coupling, dim) };
    Ok(())
}
