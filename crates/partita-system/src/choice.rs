//! The arithmetic of P1-P3 and R1 for a given choice: without branches, over any number type.
//!
//! Nothing here searches, compares or allocates. The choice (rows, coordinates, the order of the elimination, the
//! recursion over the clusters) is given as a [`Choice`]; whether it still applies is checked elsewhere.

use partita_math::dense;
use partita_math::elimination::Plan;
use partita_math::scalar::Scalar;

/// The choice, as an evaluation needs it.
#[derive(Clone, Copy)]
pub struct Choice<'a> {
    /// Elimination of C_D; none where no row is kept.
    pub plan: Option<&'a Plan>,
    /// Rows kept, in the order of the elimination.
    pub rows: &'a [usize],
    /// Dependent velocities, in the order of the elimination.
    pub dependent: &'a [usize],
    /// Independent velocities, ascending.
    pub independent: &'a [usize],
    /// Columns of Dᵀ and A.
    pub columns: usize,
    /// Column of each independent velocity; `u32::MAX` where its cluster needs no D.
    pub column_of: &'a [u32],
    /// Entries of kept rows in columns of A: step of the elimination, entry of C, column.
    pub entries: &'a [(u32, u32, u32)],
    /// As `entries`, for all independent velocities: step, entry, index in v_I.
    pub spread_entries: &'a [(u32, u32, u32)],
    /// Whether a column represents the degrees of freedom of several clusters.
    pub packed: bool,
    /// Whether there are rows that depend on time.
    pub rheonomic: bool,
}

/// A choice with data of its own.
pub struct OwnedChoice {
    plan: Option<Plan>,
    rows: Vec<usize>,
    dependent: Vec<usize>,
    independent: Vec<usize>,
    columns: usize,
    column_of: Vec<u32>,
    entries: Vec<(u32, u32, u32)>,
    spread_entries: Vec<(u32, u32, u32)>,
    packed: bool,
    rheonomic: bool,
}

impl OwnedChoice {
    /// The choice.
    pub fn choice(&self) -> Choice<'_> {
        Choice {
            plan: self.plan.as_ref(),
            rows: &self.rows,
            dependent: &self.dependent,
            independent: &self.independent,
            columns: self.columns,
            column_of: &self.column_of,
            entries: &self.entries,
            spread_entries: &self.spread_entries,
            packed: self.packed,
            rheonomic: self.rheonomic,
        }
    }
}

impl Choice<'_> {
    /// The same with data of its own.
    pub fn owned(&self) -> OwnedChoice {
        OwnedChoice {
            plan: self.plan.cloned(),
            rows: self.rows.to_vec(),
            dependent: self.dependent.to_vec(),
            independent: self.independent.to_vec(),
            columns: self.columns,
            column_of: self.column_of.to_vec(),
            entries: self.entries.to_vec(),
            spread_entries: self.spread_entries.to_vec(),
            packed: self.packed,
            rheonomic: self.rheonomic,
        }
    }

    /// Degrees of freedom.
    pub fn k(&self) -> usize {
        self.independent.len()
    }

    /// Put the unit entries of the independent velocities into Dᵀ.
    pub fn units<T: Scalar>(&self, dt: &mut [T]) {
        dt.fill(T::zero());
        for (&i, &c) in self.independent.iter().zip(self.column_of) {
            if c != u32::MAX {
                dt[i * self.columns + c as usize] = T::one();
            }
        }
    }

    /// A, D and η: `v_D = A v_I + η`, with C_D factored. `rhs` has room for r x (columns + 1).               (P1, P2)
    #[inline(always)]
    pub fn tangent<T: Scalar>(
        &self,
        factors: &[T],
        c: &[T],
        a: &[T],
        rhs: &mut [T],
        a_matrix: &mut [T],
        dt: &mut [T],
        gamma: &mut [T],
    ) {
        let Some(plan) = self.plan else { return };
        let k = self.columns;
        let columns = k + usize::from(self.rheonomic);
        let rhs = &mut rhs[..self.rows.len() * columns];
        rhs.fill(T::zero());
        for &(step, e, j) in self.entries {
            rhs[step as usize * columns + j as usize] = -c[e as usize];
        }
        if self.rheonomic {
            for (step, &row) in self.rows.iter().enumerate() {
                rhs[step * columns + k] = -a[row];
            }
        }
        plan.solve(factors, rhs, columns);
        if k == 1 && !self.rheonomic {
            // a copy of a slice costs more than all else here
            for ((x, a), &i) in rhs.iter().zip(a_matrix).zip(self.dependent) {
                (*a, dt[i]) = (*x, *x);
            }
            return;
        }
        for (p, &i) in self.dependent.iter().enumerate() {
            let row = &rhs[p * columns..(p + 1) * columns];
            a_matrix[p * k..(p + 1) * k].copy_from_slice(&row[..k]);
            dt[i * k..(i + 1) * k].copy_from_slice(&row[..k]);
            if self.rheonomic {
                gamma[i] = row[k];
            }
        }
    }

    /// `v = Dᵀ v_I + [0; η]`.                                                             (P2)
    #[inline(always)]
    pub fn spread<T: Scalar>(
        &self,
        factors: &[T],
        c: &[T],
        a: &[T],
        (dt, gamma): (&[T], &[T]),
        v_independent: &[T],
        work: &mut [T],
        v: &mut [T],
    ) {
        let k = self.columns;
        if self.packed {
            // one solve, where D has too many columns to be formed
            let x = &mut work[..self.rows.len()];
            for (x, &row) in x.iter_mut().zip(self.rows) {
                *x = -a[row];
            }
            for &(step, e, j) in self.spread_entries {
                x[step as usize] -= c[e as usize] * v_independent[j as usize];
            }
            if let Some(plan) = self.plan {
                plan.solve(factors, x, 1);
            }
            self.put_dependent(x, v);
            for (x, &i) in v_independent.iter().zip(self.independent) {
                v[i] = *x;
            }
            return;
        }
        if k == 1 {
            let x = v_independent[0];
            for ((v, d), g) in v.iter_mut().zip(dt).zip(gamma) {
                *v = *d * x + *g;
            }
            return;
        }
        for (i, (v, g)) in v.iter_mut().zip(gamma).enumerate() {
            *v = *g + dense::dot(&dt[i * k..(i + 1) * k], v_independent);
        }
    }

    /// `ξ = −C_D⁻¹ b`, written to the slots of D.                                                                (P1)
    #[inline(always)]
    pub fn bias<T: Scalar>(&self, factors: &[T], b: &[T], work: &mut [T], delta: &mut [T]) {
        let x = &mut work[..self.rows.len()];
        for (x, &row) in x.iter_mut().zip(self.rows) {
            *x = -b[row];
        }
        if let Some(plan) = self.plan {
            plan.solve(factors, x, 1);
        }
        self.put_dependent(x, delta);
    }

    /// `v' = Dᵀ v_I' + [0; ξ]`, for a Dᵀ that is not packed.                              (P2)
    pub fn full_acceleration<T: Scalar>(&self, dt: &[T], delta: &[T], vdot_independent: &[T], out: &mut [T]) {
        let k = self.columns;
        for (i, (x, d)) in out.iter_mut().zip(delta).enumerate() {
            *x = *d + dense::dot(&dt[i * k..(i + 1) * k], vdot_independent);
        }
    }

    /// `C_Dᵀ λ = (M v' − h)_D` for the residual M v' − h of all velocities; zero on dropped rows.  (R1, 41)
    pub fn multipliers<T: Scalar>(&self, factors: &[T], residual: &[T], work: &mut [T], out: &mut [T]) {
        out.fill(T::zero());
        let Some(plan) = self.plan else { return };
        let x = &mut work[..self.rows.len()];
        for (x, &i) in x.iter_mut().zip(self.dependent) {
            *x = residual[i];
        }
        plan.solve_transposed(factors, x, 1);
        for (x, &row) in x.iter().zip(self.rows) {
            out[row] = *x;
        }
    }

    pub(crate) fn put_dependent<T: Scalar>(&self, x: &[T], out: &mut [T]) {
        for (x, &i) in x.iter().zip(self.dependent) {
            out[i] = *x;
        }
    }
}
