//! Rates of a state changed to first order, for the iterations of implicit methods.
//!
//! ```text
//! δy = L x + e,   x = S δy        S δ(y') = A x + B e        S L = 1
//! ```
//!
//! Where y holds more coordinates than a motion has freedoms, x are changes that the loops allow, 2k of them at most: only
//! along these can forces be stiff and the motion stay closed. What is left, e, follows from the rates themselves.

use crate::sparse_rates::SparseRates;
use crate::system::Derivatives;

/// A matrix without its zeros, row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rows {
    /// End of each row among the entries.
    ends: Vec<usize>,
    /// Column and value.
    entries: Vec<(usize, f64)>,
}

impl Rows {
    /// Of a dense matrix with so many columns.
    pub fn of(dense: &[f64], columns: usize) -> Self {
        let mut out = Self::default();
        for row in dense.chunks_exact(columns.max(1)) {
            out.entries.extend(row.iter().copied().enumerate().filter(|(_, x)| *x != 0.0));
            out.ends.push(out.entries.len());
        }
        out
    }

    /// No rows.
    pub(crate) fn clear(&mut self) {
        self.ends.clear();
        self.entries.clear();
    }

    /// Another row.
    pub(crate) fn push(&mut self, row: impl Iterator<Item = (usize, f64)>) {
        self.entries.extend(row.filter(|e| e.1 != 0.0));
        self.ends.push(self.entries.len());
    }

    /// The entries of each row.
    fn iter(&self) -> impl Iterator<Item = &[(usize, f64)]> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts.zip(&self.ends).map(|(from, to)| &self.entries[from..*to])
    }

    /// `y += M x`.
    fn add_product(&self, x: &[f64], y: &mut [f64]) {
        for (y, row) in y.iter_mut().zip(self.iter()) {
            *y += row.iter().map(|(j, m)| m * x[*j]).sum::<f64>();
        }
    }
}

/// Which changes x are.
#[derive(Clone, Debug, PartialEq)]
pub enum Along {
    /// Those of the leading components of y.
    Leading,
    /// Those that L gives (`lift`, dim x count) and S finds (`select`, count x dim), row by row.
    Tangent {
        /// L.
        lift: Rows,
        /// S.
        select: Rows,
        /// B (`count` x dim), or nothing where it is zero.
        coupling: Rows,
    },
    /// The same along displacements of all coordinates, where A is not formed: [`LinearRates::sparse`] has it.
    Sparse {
        /// Rates of coordinates by velocities (coordinates x nv).
        rates: Rows,
        /// S, as above.
        select: Rows,
        /// Displacements of dependent coordinates by y.
        beside: Rows,
    },
}

/// Whether A is formed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Route {
    /// Where that costs less, by a count of multiplications.
    #[default]
    Counted,
    /// Always.
    Dense,
    /// Never, where the system knows its couplings.
    Sparse,
}

/// A, and which changes it belongs to.
#[derive(Debug)]
pub struct LinearRates {
    /// Number of changes x.
    pub count: usize,
    /// Them.
    pub along: Along,
    /// A (count x count), row by row; empty where it is not formed.
    pub a: Vec<f64>,
    /// What stands for A where it is not formed; where it is, memory.
    pub sparse: Option<Box<SparseRates>>,
    /// Whether it is formed.
    pub route: Route,
    /// μ of the first factors of μ − A [1/s], for which pivots are chosen; zero where none is known.
    pub shift: f64,
    /// Whether the first half of x changes at the rates of the second half alone: `A = [0 1; −M_d⁻¹ K  −M_d⁻¹ D]`.
    pub second_order: bool,
    /// How it was computed.
    pub derivatives: Derivatives,
    /// Evaluations of the rates that it took.
    pub evaluations: u64,
}

/// Lengths of differences of the rates. Scale: relative to a component and its natural size. Reason: the root of the rounding,
/// where the errors of a one-sided difference meet.
const RATE_DIFFERENCE: f64 = 1.5e-8;

/// Rates of a state: writes y' for y.
pub type RatesOf<'r, E> = &'r mut dyn FnMut(&[f64], &mut [f64]) -> Result<(), E>;

impl Default for LinearRates {
    fn default() -> Self {
        Self {
            count: 0,
            along: Along::Leading,
            a: Vec::new(),
            sparse: None,
            route: Route::default(),
            shift: 0.0,
            second_order: false,
            derivatives: Derivatives::Exact,
            evaluations: 0,
        }
    }
}

impl LinearRates {
    /// For so many changes.
    pub(crate) fn begin(&mut self, count: usize, second_order: bool) {
        (self.count, self.second_order, self.evaluations) = (count, second_order, 0);
        self.a.clear();
        self.a.resize(count * count, 0.0);
    }

    /// By differences of the rates `dy` at (t, y), along the leading `count` components, of these natural sizes.
    ///
    /// # Errors
    /// That of an evaluation.
    pub fn by_differences<E>(
        &mut self,
        (count, sizes): (usize, impl Fn(usize) -> f64),
        (y, dy): (&[f64], &[f64]),
        rates: RatesOf<E>,
    ) -> Result<(), E> {
        self.begin(count, false);
        (self.along, self.derivatives) = (Along::Leading, Derivatives::Differences);
        let (mut moved, mut found) = (y.to_vec(), vec![0.0; y.len()]);
        for j in 0..count {
            moved[j] = y[j] + RATE_DIFFERENCE * y[j].abs().max(sizes(j)).max(f64::MIN_POSITIVE);
            let by = moved[j] - y[j];
            rates(&moved, &mut found)?;
            self.evaluations += 1;
            (0..count).for_each(|i| self.a[i * count + j] = (found[i] - dy[i]) / by);
            moved[j] = y[j];
        }
        Ok(())
    }

    /// For so many changes, without A.
    pub(crate) fn begin_sparse(&mut self) {
        let count = self.sparse.as_ref().map_or(0, |x| x.count());
        (self.count, self.second_order, self.evaluations) = (count, true, 0);
        self.a.clear();
        if !matches!(self.along, Along::Sparse { .. }) {
            self.along = Along::Sparse { rates: Rows::default(), select: Rows::default(), beside: Rows::default() };
        }
    }

    /// What stands for A, where it is not formed.
    pub fn unformed(&self) -> Option<&SparseRates> {
        self.sparse.as_deref().filter(|_| matches!(self.along, Along::Sparse { .. }))
    }

    /// Numbers of x and what is carried behind them: where A is not formed, displacements that no loop allows.
    pub fn width(&self) -> usize {
        self.count + self.unformed().map_or(0, |x| x.beside())
    }

    /// `x = S δy` (the leading [`count`](Self::count) numbers), and zeros.
    pub fn select(&self, change: &[f64], x: &mut [f64]) {
        match &self.along {
            Along::Leading => x.copy_from_slice(&change[..self.count]),
            Along::Tangent { select, .. } | Along::Sparse { select, .. } => {
                x.fill(0.0);
                select.add_product(change, x);
            }
        }
    }

    /// `out += L x`.
    pub fn lift(&mut self, x: &[f64], out: &mut [f64]) {
        match (&self.along, &mut self.sparse) {
            (Along::Leading, _) => out.iter_mut().zip(&x[..self.count]).for_each(|(out, x)| *out += x),
            (Along::Tangent { lift, .. }, _) => lift.add_product(x, out),
            (Along::Sparse { rates, .. }, Some(sparse)) => {
                let k = self.count / 2;
                rates.add_product(sparse.displace(&x[..k]), out);
                out[rates.ends.len()..].iter_mut().zip(&x[k..2 * k]).for_each(|(out, u)| *out += u);
            }
            (Along::Sparse { .. }, None) => {}
        }
    }

    /// Natural sizes of x, from those of y.
    pub fn sizes(&self, of_y: &[f64]) -> Vec<f64> {
        let mut sizes = vec![0.0; self.count];
        match &self.along {
            Along::Leading => sizes.copy_from_slice(&of_y[..self.count]),
            Along::Tangent { select, .. } | Along::Sparse { select, .. } => {
                let size = |row: &[(usize, f64)]| row.iter().map(|(j, s)| s.abs() * of_y[*j]).sum();
                sizes.iter_mut().zip(select.iter()).for_each(|(to, row)| *to = size(row));
            }
        }
        sizes
    }

    /// `x += B e`, or where A is not formed what leads to that, behind x.
    pub fn couple(&self, e: &[f64], x: &mut [f64]) {
        match &self.along {
            Along::Leading => {}
            Along::Tangent { coupling, .. } => coupling.add_product(e, x),
            Along::Sparse { beside, .. } => beside.add_product(e, &mut x[self.count..]),
        }
    }
}
