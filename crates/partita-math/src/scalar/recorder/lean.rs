//! A reduced recording: equal operations once, constants folded, operations without influence on outputs removed.

use super::{Operation, Recording};
use crate::scalar::Cases;
use crate::scalar::Scalar;
use hashbrown::HashTable;
use rustc_hash::FxBuildHasher;
use std::borrow::Cow;
use std::hash::BuildHasher;

/// An operation as a key: its kind (see [`PlainTape`](super::PlainTape)), its operands, the bits of its constant.
type Key = (u8, [u32; 3], u64);

pub(super) fn key(operation: Operation) -> Key {
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

/// An operation in the table: part of the hash of its key, so that a table that grows asks for no key again, and its index.
#[derive(Debug)]
struct Known {
    hash: u32,
    index: u32,
}

impl Known {
    /// The hash as tables take it, which look at both ends.
    fn hash(&self) -> u64 {
        u64::from(self.hash) << 32 | u64::from(self.hash)
    }
}

/// Which operations are entered once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Once {
    /// None: all stay as they are.
    Nothing,
    /// Equal ones; constants are folded.
    Equal,
    /// Equal ones, but none with a constant among its operands: what many equal parts do stays alike though constants of
    /// some parts are equal by chance.
    WithoutConstants,
}

/// Operations numbered by what they compute.
#[derive(Debug)]
pub(super) struct Numbered {
    pub(super) operations: Vec<Operation>,
    known: HashTable<Known>,
    once: Once,
}

impl Numbered {
    pub(super) fn new(once: Once) -> Self {
        Self { operations: Vec::new(), known: HashTable::new(), once }
    }

    /// Index of an operation as it is, known or new.
    fn enter(&mut self, operation: Operation) -> u32 {
        let Self { operations, known, once } = self;
        let next = operations.len() as u32;
        let mut is_apart = *once == Once::Nothing;
        if *once == Once::WithoutConstants && !matches!(operation, Operation::Constant(_)) {
            let is_constant = |x: u32| matches!(operations.get(x as usize), Some(Operation::Constant(_)));
            operation.operands(|x| is_apart |= is_constant(x));
        }
        if is_apart {
            operations.push(operation);
            return next;
        }
        let wanted = key(operation);
        let hash = FxBuildHasher.hash_one(wanted);
        let new = Known { hash: (hash ^ hash >> 32) as u32, index: next };
        let is_that = |x: &Known| {
            x.hash == new.hash && operations.get(x.index as usize).is_some_and(|known| key(*known) == wanted)
        };
        let slot = known.entry(new.hash(), is_that, Known::hash).or_insert(new).get().index;
        if slot == next {
            operations.push(operation);
        }
        slot
    }

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
    pub(super) fn slot(&mut self, operation: Operation) -> u32 {
        use Operation as O;
        if self.once == Once::Nothing {
            return self.enter(operation);
        }
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
        self.enter(folded)
    }
}

impl Recording {
    /// The same function in fewer operations: equal ones once, sums with 0 and products with 0 and 1 omitted, and
    /// operations that no output needs removed.
    ///
    /// If all intermediate numbers are finite, the outputs are those of the recording bit by bit, except for the sign
    /// of a zero.
    pub fn lean(&self) -> Self {
        self.reduced(Once::Equal).into_owned()
    }

    /// Reduced as [`Recording::of_parts`] does.
    pub(crate) fn by_parts(&self) -> Cow<'_, Self> {
        self.reduced(Once::WithoutConstants)
    }

    fn reduced(&self, once: Once) -> Cow<'_, Self> {
        if self.once == once {
            return Cow::Borrowed(self);
        }
        let mut numbered = Numbered::new(once);
        let mut slots: Vec<u32> = Vec::with_capacity(self.operations.len());
        for operation in &self.operations {
            let moved = operation.with(|x| slots.get(x as usize).copied().unwrap_or(0));
            slots.push(numbered.slot(moved));
        }
        let outputs = self.outputs.iter().map(|&x| slots.get(x as usize).copied().unwrap_or(0)).collect();
        let lookups = self.lookups.clone();
        Cow::Owned(Self { inputs: self.inputs, operations: numbered.operations, outputs, once, lookups }.needed())
    }

    /// Without operations that no output needs.
    pub(super) fn needed(mut self) -> Self {
        let mut asked = vec![false; self.operations.len()];
        self.outputs.iter().for_each(|&x| asked[x as usize] = true);
        for i in (0..asked.len()).rev() {
            if asked[i] {
                self.operations[i].operands(|x| asked[x as usize] = true);
            }
        }
        let (mut last, mut count) = (vec![0u32; asked.len()], 0);
        for i in (0..asked.len()).filter(|&i| asked[i]) {
            last[i] = count as u32;
            self.operations[count] = self.operations[i].with(|x| last[x as usize]);
            count += 1;
        }
        self.operations.truncate(count);
        self.operations.shrink_to_fit();
        self.outputs.iter_mut().for_each(|x| *x = last[*x as usize]);
        self
    }
}
