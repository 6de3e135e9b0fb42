//! Tables that are looked up beside a recording, not in it.

use super::super::interval_of;

/// A table in which a number of a recording is looked up: its interval, start and cubic, are inputs.
#[derive(Clone, Debug)]
pub struct Lookup {
    breaks: Vec<f64>,
    rows: Vec<[f64; 4]>,
}

impl Lookup {
    /// Numbers of an interval: its start and its cubic.
    pub const NUMBERS: usize = 5;

    pub(super) fn new(breaks: &[f64], rows: &[[f64; 4]]) -> Self {
        Self { breaks: breaks.to_vec(), rows: rows.to_vec() }
    }

    pub(super) fn is(&self, breaks: &[f64], rows: &[[f64; 4]]) -> bool {
        self.breaks == breaks && self.rows == rows
    }

    /// Breaks, and rows of the intervals.
    pub fn table(&self) -> (&[f64], &[[f64; 4]]) {
        (&self.breaks, &self.rows)
    }

    /// The interval that x is in; at once if it is the one before.
    pub fn interval(&self, x: f64, before: usize) -> usize {
        let count = self.rows.len();
        let begun = |i: usize| i == 0 || self.breaks[i] <= x;
        match before < count && begun(before) && (before + 1 == count || !begun(before + 1)) {
            true => before,
            false => interval_of(x, &self.breaks, count),
        }
    }

    /// Its numbers.
    pub fn numbers(&self, interval: usize) -> [f64; Self::NUMBERS] {
        let [a, b, c, d] = self.rows[interval];
        [self.breaks[interval], a, b, c, d]
    }
}

#[cfg(test)]
mod tests {
    use super::Lookup;
    use crate::scalar::{Functions, Recorder, Recording};

    fn table(count: usize) -> (Vec<f64>, Vec<[f64; 4]>) {
        let mut random = fastrand::Rng::with_seed(count as u64);
        let breaks = (0..=count).map(|i| i as f64 + 0.5 * random.f64()).collect();
        (breaks, (0..count).map(|_| std::array::from_fn(|_| random.f64())).collect())
    }

    #[test]
    fn the_interval_before_does_not_matter() {
        let (breaks, rows) = table(40);
        let lookup = Lookup::new(&breaks, &rows);
        let beside = [f64::NAN, f64::NEG_INFINITY, f64::INFINITY, -1.0, 100.0];
        for x in breaks.iter().flat_map(|b| [*b, b.next_down(), b + 0.2]).chain(beside) {
            let (start, row) = x.interval(&breaks, &rows);
            for before in (0..rows.len()).chain([rows.len(), usize::MAX]) {
                let [own, cubic @ ..] = lookup.numbers(lookup.interval(x, before));
                assert_eq!((own, cubic), (start, row), "{x} after {before}");
            }
        }
    }

    #[test]
    fn a_recording_of_parts_is_as_long_for_any_table() {
        for count in [2, 30, 3000] {
            let (breaks, rows) = table(count);
            // looked up twice in the same table, and in one more by what was found
            let cubic = |x: Recorder| {
                let (start, [a, b, c, d]) = x.interval(&breaks, &rows);
                ((a * (x - start) + b) * (x - start) + c) * (x - start) + d
            };
            let of = |x: &[Recorder]| Ok::<_, ()>(vec![cubic(x[0]) + cubic(x[0]), cubic(cubic(x[1]))]);
            let found = Recording::of_parts(usize::MAX, [2, 0], of).unwrap().unwrap();
            assert_eq!((found.lookups().len(), found.inputs(), found.outputs()), (3, 2 + 3 * Lookup::NUMBERS, 2 + 3));
            assert!(found.len() < 60);
            let alone = Recording::new(2, of).unwrap();
            assert!(alone.lookups().is_empty() && alone.inputs() == 2 && alone.len() > 5 * count);
        }
    }
    #[test]
    fn another_table_at_the_same_address_is_another_one() {
        let (breaks, mut rows) = table(9);
        let of = |x: &[Recorder]| {
            let both = [0.0, 1.0].map(|by| {
                rows.iter_mut().for_each(|row| row[0] += by);
                x[0].interval(&breaks, &rows).1[0]
            });
            Ok::<_, ()>(both.to_vec())
        };
        let found = Recording::of_parts(usize::MAX, [1, 0], of).unwrap().unwrap();
        let [first, second] = found.lookups() else { panic!("{} tables", found.lookups().len()) };
        assert_eq!(first.numbers(0)[1] + 1.0, second.numbers(0)[1]);
    }
}
