//! A reduced recording: equal operations once, constants folded, operations without influence on outputs removed.

use super::{Operation, Recording};
use crate::scalar::Cases;
use crate::scalar::Scalar;
use rustc_hash::FxHashMap;

/// An operation as a key: its kind, its operands, the bits of its constant.
type Key = (u8, [u32; 3], u64);

fn key(operation: Operation) -> Key {
    use Operation as O;
    match operation {
        O::Input(k) => (0, [k, 0, 0], 0),
        O::Constant(c) => (1, [0; 3], c.to_bits()),
        O::Add(x, y) => (2, [x.min(y), x.max(y), 0], 0),
        O::Sub(x, y) => (3, [x, y, 0], 0),
        O::Mul(x, y) => (4, [x.min(y), x.max(y), 0], 0),
        O::Div(x, y) => (5, [x, y, 0], 0),
        O::OverOrZero(x, y) => (6, [x, y, 0], 0),
        O::Neg(x) => (7, [x, 0, 0], 0),
        O::Sqrt(x) => (8, [x, 0, 0], 0),
        O::Power(x, e) => (9, [x, 0, 0], e.to_bits()),
        O::Sin(x) => (10, [x, 0, 0], 0),
        O::Cos(x) => (11, [x, 0, 0], 0),
        O::Atan2(x, y) => (12, [x, y, 0], 0),
        O::Hypot(x, y) => (13, [x, y, 0], 0),
        O::Abs(x) => (14, [x, 0, 0], 0),
        O::Round(x) => (15, [x, 0, 0], 0),
        O::Max(x, y) => (16, [x, y, 0], 0),
        O::Min(x, y) => (17, [x, y, 0], 0),
        O::WherePositive(x, y, n) => (18, [x, y, n], 0),
        O::Reached(x, b) => (19, [x, 0, 0], b.to_bits()),
        O::Scale(x, f) => (20, [x, 0, 0], f.to_bits()),
    }
}

impl Operation {
    /// This operation on other operands.
    pub(super) fn with(self, mut at: impl FnMut(u32) -> u32) -> Self {
        match self {
            Self::Input(_) | Self::Constant(_) => self,
            Self::Add(x, y) => Self::Add(at(x), at(y)),
            Self::Sub(x, y) => Self::Sub(at(x), at(y)),
            Self::Mul(x, y) => Self::Mul(at(x), at(y)),
            Self::Div(x, y) => Self::Div(at(x), at(y)),
            Self::OverOrZero(x, y) => Self::OverOrZero(at(x), at(y)),
            Self::Neg(x) => Self::Neg(at(x)),
            Self::Sqrt(x) => Self::Sqrt(at(x)),
            Self::Power(x, e) => Self::Power(at(x), e),
            Self::Sin(x) => Self::Sin(at(x)),
            Self::Cos(x) => Self::Cos(at(x)),
            Self::Atan2(x, y) => Self::Atan2(at(x), at(y)),
            Self::Hypot(x, y) => Self::Hypot(at(x), at(y)),
            Self::Abs(x) => Self::Abs(at(x)),
            Self::Round(x) => Self::Round(at(x)),
            Self::Max(x, y) => Self::Max(at(x), at(y)),
            Self::Min(x, y) => Self::Min(at(x), at(y)),
            Self::WherePositive(x, y, n) => Self::WherePositive(at(x), at(y), at(n)),
            Self::Reached(x, b) => Self::Reached(at(x), b),
            Self::Scale(x, f) => Self::Scale(at(x), f),
        }
    }

    /// Its operands, one after the other.
    pub(crate) fn operands(self, mut each: impl FnMut(u32)) {
        self.with(|x| {
            each(x);
            x
        });
    }
}

/// Operations numbered by what they compute.
#[derive(Default)]
struct Numbered {
    operations: Vec<Operation>,
    known: FxHashMap<Key, u32>,
}

impl Numbered {
    fn constant(&self, x: u32) -> Option<f64> {
        match self.operations.get(x as usize) {
            Some(Operation::Constant(c)) => Some(*c),
            _ => None,
        }
    }

    fn negated(&self, x: u32) -> Option<u32> {
        match self.operations.get(x as usize) {
            Some(Operation::Neg(y)) => Some(*y),
            _ => None,
        }
    }

    /// Index of an operation, known or new; simplified where its operands are constants.
    fn slot(&mut self, operation: Operation) -> u32 {
        use Operation as O;
        let folded = match operation {
            O::Scale(x, f) => {
                let f = self.slot(O::Constant(f));
                return self.slot(O::Mul(x, f));
            }
            O::Add(x, y) => match (self.constant(x), self.constant(y), self.negated(x), self.negated(y)) {
                (Some(a), Some(b), ..) => O::Constant(a + b),
                (Some(0.0), ..) => return y,
                (_, Some(0.0), ..) => return x,
                (.., Some(b)) => O::Sub(x, b),
                (_, _, Some(a), _) => O::Sub(y, a),
                _ => operation,
            },
            O::Sub(x, y) => match (self.constant(x), self.constant(y), self.negated(y)) {
                (Some(a), Some(b), _) => O::Constant(a - b),
                (Some(0.0), ..) => return self.slot(O::Neg(y)),
                (_, Some(0.0), _) => return x,
                (.., Some(b)) => return self.slot(O::Add(x, b)),
                _ if x == y => O::Constant(0.0),
                _ => operation,
            },
            O::Mul(x, y) => match (self.constant(x), self.constant(y), self.negated(x), self.negated(y)) {
                (Some(a), Some(b), ..) => O::Constant(a * b),
                (Some(0.0), ..) | (_, Some(0.0), ..) => O::Constant(0.0),
                (Some(1.0), ..) => return y,
                (_, Some(1.0), ..) => return x,
                (Some(-1.0), ..) => return self.slot(O::Neg(y)),
                (_, Some(-1.0), ..) => return self.slot(O::Neg(x)),
                (_, _, Some(a), Some(b)) => return self.slot(O::Mul(a, b)),
                (_, _, Some(a), None) => {
                    let product = self.slot(O::Mul(a, y));
                    return self.slot(O::Neg(product));
                }
                (_, _, None, Some(b)) => {
                    let product = self.slot(O::Mul(x, b));
                    return self.slot(O::Neg(product));
                }
                _ => operation,
            },
            O::Div(x, y) => match (self.constant(x), self.constant(y)) {
                (Some(a), Some(b)) => O::Constant(a / b),
                (_, Some(1.0)) => return x,
                _ => operation,
            },
            O::OverOrZero(x, y) => match (self.constant(x), self.constant(y)) {
                (Some(a), Some(b)) => O::Constant(a.over_or_zero(b)),
                (Some(0.0), _) => O::Constant(0.0),
                _ => operation,
            },
            O::Neg(x) => match (self.constant(x), self.negated(x)) {
                (Some(a), _) => O::Constant(-a),
                (_, Some(y)) => return y,
                _ => operation,
            },
            O::Sqrt(x) => self.constant(x).map_or(operation, |a| O::Constant(a.sqrt())),
            O::Sin(x) => self.constant(x).map_or(operation, |a| O::Constant(Scalar::sin_cos(a).0)),
            O::Cos(x) => self.constant(x).map_or(operation, |a| O::Constant(Scalar::sin_cos(a).1)),
            O::WherePositive(x, y, n) => match self.constant(x) {
                Some(a) if a > 0.0 => return y,
                Some(_) => return n,
                None if y == n => return y,
                None => operation,
            },
            _ => operation,
        };
        let next = self.operations.len() as u32;
        let slot = *self.known.entry(key(folded)).or_insert(next);
        if slot == next {
            self.operations.push(folded);
        }
        slot
    }
}

impl Recording {
    /// The same function in fewer operations: equal ones once, sums with 0 and products with 0 and 1 omitted, and
    /// operations that no output needs removed.
    ///
    /// If all intermediate numbers are finite, the outputs are those of the recording bit by bit, except for the sign
    /// of a zero.
    pub fn lean(&self) -> Self {
        let mut numbered = Numbered::default();
        numbered.known.reserve(self.operations.len() / 3);
        let mut slots: Vec<u32> = Vec::with_capacity(self.operations.len());
        for operation in &self.operations {
            let moved = operation.with(|x| slots.get(x as usize).copied().unwrap_or(0));
            slots.push(numbered.slot(moved));
        }
        let outputs: Vec<u32> = self.outputs.iter().map(|&x| slots.get(x as usize).copied().unwrap_or(0)).collect();
        let mut asked = vec![false; numbered.operations.len()];
        outputs.iter().for_each(|&x| asked[x as usize] = true);
        for i in (0..asked.len()).rev() {
            if asked[i] {
                numbered.operations[i].operands(|x| asked[x as usize] = true);
            }
        }
        let mut last = vec![0u32; asked.len()];
        let mut operations = Vec::new();
        for (i, operation) in numbered.operations.iter().enumerate().filter(|x| asked[x.0]) {
            last[i] = operations.len() as u32;
            operations.push(operation.with(|x| last[x as usize]));
        }
        Self { inputs: self.inputs, operations, outputs: outputs.iter().map(|&x| last[x as usize]).collect() }
    }
}
