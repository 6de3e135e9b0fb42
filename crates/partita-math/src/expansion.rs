//! The derivatives of a recording as a sparse matrix, by way of some of its results.
//!
//! ```text
//! c = f(x, c)     y = g(x, c)      each row of f and g depends on a few of the inputs x and of the results c before
//! ```
//!
//! In a chain of bodies everything depends on all joints before it: derivatives by the joints are full. A result that depends on
//! more than a few numbers is therefore taken for a number of its own: what depends on it depends on that number. Results
//! carried from body to body are then such numbers, and the rows have as many entries as bodies have neighbours.

use crate::elimination::Pattern;
use crate::scalar::{Operation, Recording, Scalar};
use std::collections::HashMap;

/// A result with derivatives.
#[derive(Clone, Copy, Debug)]
struct Derived {
    /// Its operation.
    operation: u32,
    /// Its derivatives, in the memory for them.
    start: u32,
    count: u32,
    /// Those of its operands.
    operands: [Operand; 2],
}

/// Derivatives of an operand; those of a number of its own are the one at 0.
#[derive(Clone, Copy, Debug, Default)]
struct Operand {
    start: u32,
    count: u32,
    /// Where they are added among those of the result: from here among the indices, or in the same order.
    indices: Option<u32>,
}

/// What a row takes.
#[derive(Clone, Copy, Debug)]
struct Extent {
    start: u32,
    count: u32,
}

/// A recording and where its derivatives are nonzero.
#[derive(Clone, Debug)]
pub struct Expansion {
    recording: Recording,
    derived: Vec<Derived>,
    /// For each result the row that it is.
    row_of: Vec<Option<u32>>,
    indices: Vec<u16>,
    /// Derivatives of each output.
    outputs: Vec<Extent>,
    memory: usize,
    longest: usize,
    multiplications: usize,
    /// Rows: results that are numbers of their own, then outputs. Columns: variables, then those results.
    pattern: Pattern,
}

/// Memory of an evaluation.
#[derive(Clone, Debug, Default)]
pub struct ExpansionScratch {
    values: Vec<f64>,
    derivatives: Vec<f64>,
    outputs: Vec<f64>,
    sums: Vec<f64>,
}

/// Memory for derivatives that is used again.
struct Memory {
    free: HashMap<usize, Vec<u32>>,
    size: usize,
}

impl Memory {
    fn take(&mut self, count: usize) -> u32 {
        self.free.get_mut(&count).and_then(Vec::pop).unwrap_or_else(|| {
            self.size += count;
            (self.size - count) as u32
        })
    }

    fn give_back(&mut self, start: u32, count: usize) {
        self.free.entry(count).or_default().push(start);
    }
}

/// What a result depends on.
#[derive(Clone, Default)]
struct Support {
    /// Variables and numbers of their own, ascending.
    of: Vec<u32>,
    start: u32,
    /// Whether it is the constant 0.
    is_zero: bool,
}

impl Operation {
    /// The operands whose derivatives count: what a case is decided by does not.
    fn differentiated(self) -> [Option<u32>; 2] {
        use Operation as O;
        match self {
            O::Input(_) | O::Constant(_) | O::Round(_) | O::Reached(..) => [None; 2],
            O::Neg(x) | O::Sqrt(x) | O::Power(x, _) | O::Sin(x) | O::Cos(x) | O::Abs(x) | O::Scale(x, _) => {
                [Some(x), None]
            }
            O::Add(x, y) | O::Sub(x, y) | O::Mul(x, y) | O::Div(x, y) | O::OverOrZero(x, y) => [Some(x), Some(y)],
            O::Atan2(x, y) | O::Hypot(x, y) | O::Max(x, y) | O::Min(x, y) => [Some(x), Some(y)],
            O::WherePositive(_, x, y) => [Some(x), Some(y)],
        }
    }

    /// Its derivatives by these, where its value and theirs are known. Where a root or a length is 0 it is taken to stay.
    fn partial(self, value: f64, at: impl Fn(u32) -> f64) -> [f64; 2] {
        use Operation as O;
        let first = |yes: bool| if yes { [1.0, 0.0] } else { [0.0, 1.0] };
        let over = |x: f64, length: f64| if length == 0.0 { 0.0 } else { x / length };
        match self {
            O::Add(..) => [1.0, 1.0],
            O::Sub(..) => [1.0, -1.0],
            O::Mul(x, y) => [at(y), at(x)],
            O::Div(_, y) => [1.0 / at(y), -value / at(y)],
            O::OverOrZero(_, y) => [over(1.0, at(y)), -over(value, at(y))],
            O::Neg(_) => [-1.0, 0.0],
            O::Sqrt(_) => [over(0.5, value), 0.0],
            O::Power(x, exponent) => [exponent * at(x).power(exponent - 1.0), 0.0],
            O::Sin(x) => [Scalar::sin_cos(at(x)).1, 0.0],
            O::Cos(x) => [-Scalar::sin_cos(at(x)).0, 0.0],
            O::Atan2(y, x) => {
                let square = at(x) * at(x) + at(y) * at(y);
                [at(x) / square, -at(y) / square]
            }
            O::Hypot(x, y) => [over(at(x), value), over(at(y), value)],
            O::Abs(x) => [1.0f64.copysign(at(x)), 0.0],
            O::Max(x, y) => first(!(at(y) > at(x) || at(x).is_nan())),
            O::Min(x, y) => first(!(at(y) < at(x) || at(x).is_nan())),
            O::WherePositive(x, ..) => first(at(x) > 0.0),
            O::Scale(_, factor) => [factor, 0.0],
            O::Input(_) | O::Constant(_) | O::Round(_) | O::Reached(..) => [0.0; 2],
        }
    }
}

impl Expansion {
    /// Of a recording, by `variables` of its inputs: `variable(i)` is the number of input i among them. A result that depends
    /// on more than `most` numbers becomes one of its own.
    pub fn new(recording: Recording, variables: usize, variable: impl Fn(usize) -> Option<usize>, most: usize) -> Self {
        let count = recording.operations.len();
        let mut last = vec![0; count];
        for (i, operation) in recording.operations.iter().enumerate() {
            operation.operands(|x| last[x as usize] = i);
        }
        recording.outputs.iter().for_each(|&x| last[x as usize] = count);
        let mut memory = Memory { free: HashMap::new(), size: 1 };
        let mut supports = vec![Support::default(); count];
        let mut derived: Vec<Derived> = Vec::new();
        let mut row_of = Vec::new();
        let (mut indices, mut rows, mut multiplications) = (Vec::new(), Vec::<Vec<usize>>::new(), 0);
        for (i, &operation) in recording.operations.iter().enumerate() {
            let zero = |x: u32| supports[x as usize].is_zero;
            let is_zero = match operation {
                Operation::Constant(c) => c == 0.0,
                Operation::Mul(x, y) => zero(x) || zero(y),
                Operation::Div(x, _) | Operation::OverOrZero(x, _) | Operation::Neg(x) | Operation::Abs(x) => zero(x),
                Operation::Scale(x, factor) => factor == 0.0 || zero(x),
                Operation::Add(x, y) | Operation::Sub(x, y) => zero(x) && zero(y),
                _ => false,
            };
            if let Operation::Input(k) = operation {
                let of = variable(k as usize).map(|v| v as u32).into_iter().collect();
                supports[i] = Support { of, start: 0, is_zero };
                continue;
            }
            let with = |x: &Option<u32>| x.filter(|&x| !is_zero && !supports[x as usize].of.is_empty());
            let used = operation.differentiated().map(|x| with(&x));
            let mut of: Vec<u32> = used.iter().flatten().flat_map(|&x| &supports[x as usize].of).copied().collect();
            of.sort_unstable();
            of.dedup();
            let mut start = 0;
            if !of.is_empty() {
                start = memory.take(of.len());
                let mut operands = [Operand::default(); 2];
                for (operand, x) in operands.iter_mut().zip(used) {
                    let Some(own) = x.map(|x| &supports[x as usize]) else { continue };
                    multiplications += own.of.len();
                    let mut found = None;
                    if own.of.len() < of.len() {
                        found = Some(indices.len() as u32);
                        indices.extend(own.of.iter().map(|v| of.partition_point(|x| x < v) as u16));
                    }
                    *operand = Operand { start: own.start, count: own.of.len() as u32, indices: found };
                }
                derived.push(Derived { operation: i as u32, start, count: of.len() as u32, operands });
                row_of.push(None);
                if of.len() > most {
                    memory.give_back(start, of.len());
                    if let Some(row) = row_of.last_mut() {
                        *row = Some(rows.len() as u32);
                    }
                    rows.push(of.iter().map(|&v| v as usize).collect());
                    (of, start) = (vec![(variables + rows.len() - 1) as u32], 0);
                }
            }
            supports[i] = Support { of, start, is_zero };
            // operands that nothing needs any more
            let mut done = Vec::new();
            operation.operands(|x| done.push(x));
            done.sort_unstable();
            done.dedup();
            for x in done.into_iter().filter(|&x| last[x as usize] == i) {
                let own = std::mem::take(&mut supports[x as usize]);
                if own.start != 0 {
                    memory.give_back(own.start, own.of.len());
                }
            }
        }
        let own = rows.len();
        let given =
            |x: &u32| Extent { start: supports[*x as usize].start, count: supports[*x as usize].of.len() as u32 };
        let outputs = recording.outputs.iter().map(given).collect();
        rows.extend(recording.outputs.iter().map(|&x| supports[x as usize].of.iter().map(|&v| v as usize).collect()));
        let pattern = Pattern::from_rows(variables + own, &rows);
        let longest = derived.iter().map(|x| x.count as usize).max().unwrap_or(0);
        Self { recording, derived, row_of, indices, outputs, memory: memory.size, longest, multiplications, pattern }
    }

    /// Where the derivatives may be nonzero. Rows: results that are numbers of their own, then outputs; columns: variables, then
    /// these results.
    pub fn pattern(&self) -> &Pattern {
        &self.pattern
    }

    /// Multiplications of derivatives in an evaluation.
    pub fn multiplications(&self) -> usize {
        self.multiplications
    }

    /// The derivatives for these inputs, entry by entry of the pattern.
    ///
    /// # Panics
    /// If there are fewer inputs or entries than needed.
    pub fn evaluate(&self, inputs: &[f64], scratch: &mut ExpansionScratch, entries: &mut [f64]) {
        let ExpansionScratch { values, derivatives, outputs, sums } = scratch;
        values.resize(self.recording.len(), 0.0);
        outputs.resize(self.recording.outputs(), 0.0);
        derivatives.resize(self.memory, 0.0);
        self.recording.evaluate(inputs, values, outputs);
        derivatives[0] = 1.0;
        sums.resize(self.longest, 0.0);
        for (derived, row) in self.derived.iter().zip(&self.row_of) {
            let slot = derived.operation as usize;
            let partial = self.recording.operations[slot].partial(values[slot], |x| values[x as usize]);
            let own = derived.start as usize..(derived.start + derived.count) as usize;
            let [one, other] = derived.operands;
            let sum = &mut sums[..derived.count as usize];
            sum.fill(0.0);
            for (operand, factor) in [(one, partial[0]), (other, partial[1])] {
                // at 0 everything stays, also where a slope is infinite
                if factor == 0.0 {
                    continue;
                }
                let of = &derivatives[operand.start as usize..(operand.start + operand.count) as usize];
                match operand.indices {
                    None => sum.iter_mut().zip(of).for_each(|(to, x)| *to += factor * x),
                    Some(from) => {
                        let indices = &self.indices[from as usize..from as usize + of.len()];
                        indices.iter().zip(of).for_each(|(&to, x)| sum[to as usize] += factor * x);
                    }
                }
            }
            match row {
                Some(row) => entries[self.pattern.row(*row as usize)].copy_from_slice(sum),
                None => derivatives[own].copy_from_slice(sum),
            }
        }
        let first = self.pattern.rows - self.outputs.len();
        for (i, of) in self.outputs.iter().enumerate() {
            let of = &derivatives[of.start as usize..(of.start + of.count) as usize];
            entries[self.pattern.row(first + i)].copy_from_slice(of);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dense::{lu, lu_solve};
    use crate::scalar::{Cases, Dual, Recorder};

    /// A chain of turning links, with what else may occur: its end, and the sum of its forces.
    fn chain<S: Scalar>(x: &[S]) -> Vec<S> {
        let (mut angle, mut end, mut force) = (S::zero(), [S::zero(); 2], S::zero());
        let mut out = Vec::new();
        for &q in x {
            angle += q;
            let (s, c) = angle.sin_cos();
            end = [end[0] + c.scale(0.7), end[1] + s * S::from_f64(0.7)];
            force += (end[0] * end[0] + end[1] * end[1]).sqrt().over_or_zero(q) - end[0].hypot(end[1]).power(1.5);
            force +=
                end[0].max(end[1]) * q.abs() - end[1].atan2(end[0]).min(c) + q.where_positive(s, c / (q + S::one()));
            out.push(force * (-q).round() + end[0] - S::zero() * s);
        }
        out.extend([end[0], force, x[0], S::from_f64(2.0)]);
        out
    }

    /// The derivatives by the variables alone, once the results between are eliminated.
    fn eliminated(of: &Expansion, entries: &[f64], variables: usize) -> Vec<f64> {
        let own = of.pattern.cols - variables;
        let full = |i: usize| {
            let mut row = vec![0.0; of.pattern.cols];
            of.pattern.row(i).for_each(|e| row[of.pattern.col_idx[e]] += entries[e]);
            row
        };
        let mut matrix = vec![0.0; own * own];
        for i in 0..own {
            (0..own).for_each(|j| matrix[i * own + j] = f64::from(u8::from(i == j)) - full(i)[variables + j]);
        }
        let mut order = vec![0; own];
        lu(&mut matrix, own, &mut order).unwrap();
        let mut columns = vec![vec![0.0; own]; variables];
        for (j, column) in columns.iter_mut().enumerate() {
            (0..own).for_each(|i| column[i] = full(i)[j]);
            lu_solve(&matrix, own, &order, column);
        }
        (own..of.pattern.rows)
            .flat_map(|i| {
                let (row, columns) = (full(i), &columns);
                (0..variables)
                    .map(move |j| row[j] + (0..own).map(|c| row[variables + c] * columns[j][c]).sum::<f64>())
                    .collect::<Vec<_>>()
            })
            .collect()
    }

    #[test]
    fn derivatives_are_those_of_dual_numbers_however_many_results_lie_between() {
        let (n, mut rng) = (9, fastrand::Rng::with_seed(3));
        for most in [1, 2, 3, 6, 30] {
            let made = Recording::new(n + 1, |x| Ok::<_, ()>(chain(&x[1..]))).unwrap();
            let of = Expansion::new(made, n, |i| i.checked_sub(1), most);
            assert_eq!(of.pattern.cols > n, most < n);
            let (mut scratch, mut entries) = (ExpansionScratch::default(), vec![f64::NAN; of.pattern.nnz()]);
            for _ in 0..3 {
                let x: Vec<f64> = (0..=n).map(|_| rng.f64() - 0.3).collect();
                of.evaluate(&x, &mut scratch, &mut entries);
                let found = eliminated(&of, &entries, n);
                for j in 0..n {
                    let seeded = |i: usize| Dual::<1>::new(x[1 + i], [f64::from(u8::from(i == j))]);
                    let along = chain(&(0..n).map(seeded).collect::<Vec<_>>());
                    for (i, y) in along.iter().enumerate() {
                        let (a, b) = (found[i * n + j], y.eps[0]);
                        assert!((a - b).abs() < 1e-11 * (1.0 + b.abs()), "{most} {i} {j}: {a} {b}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_chain_twice_as_long_has_twice_as_many_entries() {
        let entries = |n: usize| {
            let made = Recording::new(n, |x| Ok::<_, ()>(chain(x))).unwrap();
            Expansion::new(made, n, Some, 8).pattern.nnz()
        };
        // the first links depend on fewer
        let [first, short, long] = [entries(40), entries(80), entries(120)];
        assert_eq!(long - short, short - first);
    }

    #[test]
    fn what_is_constant_has_no_entries() {
        let made = Recording::new(2, |x| {
            let nothing = Recorder::zero() * x[0];
            Ok::<_, ()>(vec![nothing + x[1], nothing, x[1].round(), x[0].scale(0.0)])
        });
        let of = Expansion::new(made.unwrap(), 2, Some, 4);
        assert_eq!((of.pattern.nnz(), of.pattern.col_idx.clone()), (1, vec![1]));
    }
}
