//! A recording as plain data, for programs that replay it over numbers of their own.

use super::lean::key;
use super::{Lookup, Operation, Recording};

/// The operations of a recording, each an entry whose operands are indices of earlier entries.
#[derive(Clone, Debug)]
pub struct PlainTape {
    /// Of each entry its operation, an index in [`OPERATIONS`](Self::OPERATIONS).
    pub codes: Vec<u8>,
    /// Of each entry its operands, as many as the operation has, then 0; of an input its number; of an interval what is
    /// looked up, the table, and which of [`Lookup::NUMBERS`].
    pub operands: Vec<[u32; 3]>,
    /// Of each entry the constant that belongs to it: the constant itself, an exponent, a break, a factor; else 0.
    pub constants: Vec<f64>,
    /// The entry of each output.
    pub outputs: Vec<u32>,
    /// Tables in which numbers are looked up.
    pub tables: Vec<Lookup>,
}

impl PlainTape {
    /// Names of the operations, in the order of their codes. `over_or_zero` is x / y, 0 where y is 0; `where_positive` is y
    /// where x > 0, else z; `reached` is 1 where x is at or above the constant, else −1; `round` rounds halves away from 0;
    /// `interval` is the start, or a coefficient, of the interval of a table that x is in.
    pub const OPERATIONS: [&str; 22] = [
        "input",
        "constant",
        "add",
        "sub",
        "mul",
        "div",
        "over_or_zero",
        "neg",
        "sqrt",
        "power",
        "sin",
        "cos",
        "atan2",
        "hypot",
        "abs",
        "round",
        "max",
        "min",
        "where_positive",
        "reached",
        "scale",
        "interval",
    ];
}

impl Recording {
    /// Code of an interval.
    const INTERVAL: u8 = 21;

    /// The recording as plain data. Prefer a [`lean`](Self::lean) one.
    pub fn tape(&self) -> PlainTape {
        let own = self.inputs - Lookup::NUMBERS * self.lookups.len();
        // what is looked up comes after the outputs
        let (outputs, seen) = self.outputs.split_at(self.outputs.len() - self.lookups.len());
        let entry = |x: &Operation| match *x {
            Operation::Input(k) if k as usize >= own => {
                let (table, part) = ((k as usize - own) / Lookup::NUMBERS, (k as usize - own) % Lookup::NUMBERS);
                (Self::INTERVAL, [seen[table], table as u32, part as u32], 0)
            }
            _ => key(*x),
        };
        let entries: Vec<_> = self.operations.iter().map(entry).collect();
        PlainTape {
            codes: entries.iter().map(|x| x.0).collect(),
            operands: entries.iter().map(|x| x.1).collect(),
            constants: entries.iter().map(|x| f64::from_bits(x.2)).collect(),
            outputs: outputs.to_vec(),
            tables: self.lookups.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::PlainTape;
    use crate::scalar::{Cases, Functions, Recorder, Recording, Scalar};

    /// Replayed by the names of the operations alone.
    fn replayed(tape: &PlainTape, inputs: &[f64]) -> Vec<f64> {
        let mut values: Vec<f64> = Vec::new();
        for ((&code, &[i, j, k]), &c) in tape.codes.iter().zip(&tape.operands).zip(&tape.constants) {
            let at = |slot: u32| values.get(slot as usize).copied().unwrap_or(f64::NAN);
            values.push(match PlainTape::OPERATIONS[code as usize] {
                "input" => inputs[i as usize],
                "constant" => c,
                "add" => at(i) + at(j),
                "sub" => at(i) - at(j),
                "mul" => at(i) * at(j),
                "div" => at(i) / at(j),
                "over_or_zero" => at(i).over_or_zero(at(j)),
                "neg" => -at(i),
                "sqrt" => at(i).sqrt(),
                "power" => Scalar::power(at(i), c),
                "sin" => Scalar::sin_cos(at(i)).0,
                "cos" => Scalar::sin_cos(at(i)).1,
                "atan2" => Scalar::atan2(at(i), at(j)),
                "hypot" => at(i).hypot(at(j)),
                "abs" => at(i).abs(),
                "round" => at(i).round(),
                "max" => at(i).max(at(j)),
                "min" => at(i).min(at(j)),
                "where_positive" => at(i).where_positive(at(j), at(k)),
                "reached" if at(i) >= c => 1.0,
                "reached" => -1.0,
                "scale" => at(i) * c,
                "interval" => {
                    let table = &tape.tables[j as usize];
                    table.numbers(table.interval(at(i), 0))[k as usize]
                }
                other => panic!("{other} is no operation"),
            });
        }
        tape.outputs.iter().map(|&x| values[x as usize]).collect()
    }

    #[test]
    fn the_names_of_a_tape_say_what_its_operations_are() {
        let record = |x: &[Recorder]| {
            let (s, c) = x[0].sin_cos();
            let table = x[1].interval(&[-1.0, 0.3, 1.0], &[[1.0, 2.0, 3.0, 4.0], [4.0, 3.0, 2.0, 1.0]]);
            let sums = [s + c, s - c, s * c, s / c, s.over_or_zero(c), s.over_or_zero(x[2] - x[2]), -s];
            let roots = [x[0].abs().sqrt(), c.abs().power(2.5), s.atan2(c), s.hypot(c), x[1].scale(3.0).round()];
            let cases = [s.max(c), s.min(c), s.where_positive(c, x[1]), table.0, table.1[1], x[2].scale(-0.7)];
            Ok::<_, ()>([&sums[..], &roots, &cases].concat())
        };
        let mut random = fastrand::Rng::with_seed(11);
        let made = Recording::new(3, record).unwrap();
        let looked_up = Recording::with_given(3, |_| Vec::new(), record).unwrap();
        let mut work = vec![0.0; made.len()];
        for other in [made.clone(), made.lean(), looked_up.clone(), looked_up.lean()] {
            let tape = other.tape();
            assert_eq!((tape.codes.len(), tape.tables.len()), (other.len(), other.lookups().len()));
            for _ in 0..20 {
                let x = [0; 3].map(|_| 4.0 * random.f64() - 2.0);
                let mut out = vec![0.0; made.outputs()];
                made.evaluate(&x, &mut work, &mut out);
                assert_eq!(replayed(&tape, &x), out);
            }
        }
    }

    #[test]
    fn given_numbers_are_made_of_the_inputs() {
        let made = Recording::with_given(
            2,
            |x| vec![x[1].scale(2.0), x[0]],
            |x| Ok::<_, ()>(vec![x[0] + Recorder::given(0, 5.0), Recorder::given(1, 5.0), Recorder::given(2, 5.0)]),
        );
        let (made, mut out) = (made.unwrap(), [0.0; 3]);
        made.evaluate(&[3.0, 4.0], &mut vec![0.0; made.len()], &mut out);
        assert_eq!(out, [11.0, 3.0, 5.0]);
    }
}
