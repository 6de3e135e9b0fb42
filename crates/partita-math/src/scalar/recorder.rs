//! A number that records the operations applied to it.
//!
//! ```text
//! record(n, f) ──► f runs once over Recorder; each operation is an entry of a tape ──► Recording ──► evaluate(inputs)
//! ```
//!
//! The tape belongs to the thread and to one recording: numbers that outlive it, or meet another one, are NaN.

mod c;
mod counts;
mod lean;
mod lookup;
mod module;
mod reverse;
mod tape;

pub use c::{head, Numbers};
pub use counts::OperationCounts;
pub use lookup::Lookup;
pub use module::Module;
pub use tape::PlainTape;

use super::{Arguments, Cases, Functions, Scalar};
use lean::{Numbered, Once};
use std::cell::RefCell;
use std::collections::HashMap;
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

/// One entry of a tape; operands are indices of earlier entries.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Operation {
    Input(u32),
    Constant(f64),
    Add(u32, u32),
    Sub(u32, u32),
    Mul(u32, u32),
    Div(u32, u32),
    OverOrZero(u32, u32),
    Neg(u32),
    Sqrt(u32),
    Power(u32, f64),
    Sin(u32),
    Cos(u32),
    Atan2(u32, u32),
    Hypot(u32, u32),
    Abs(u32),
    Round(u32),
    Max(u32, u32),
    Min(u32, u32),
    WherePositive(u32, u32, u32),
    /// 1 where the number is at or above this constant, else −1.
    Reached(u32, f64),
    Scale(u32, f64),
}

/// The current tape, and the number of recordings so far.
struct Tape {
    number: u32,
    entries: Option<Numbered>,
    /// Largest number of operations, and whether there would be more.
    most: usize,
    is_full: bool,
    /// Numbers that were compared with bounds, which `f64` alone can do.
    bounded: Vec<(Recorder, f64, f64)>,
    /// The inputs that are given from outside.
    given: Vec<Recorder>,
    /// Number of inputs.
    inputs: usize,
    /// What is looked up in tables, by the entry and the address of the rows, with the number of its lookup; none where breaks
    /// are compared one by one.
    known: Option<HashMap<(u32, usize), (Interval, usize)>>,
    lookups: Vec<(Recorder, Lookup)>,
}

/// Start and cubic of an interval.
type Interval = [Recorder; Lookup::NUMBERS];

thread_local! {
    static TAPE: RefCell<Tape> = const {
        RefCell::new(Tape {
            number: 0,
            entries: None,
            most: 0,
            is_full: false,
            bounded: Vec::new(),
            given: Vec::new(),
            inputs: 0,
            known: None,
            lookups: Vec::new(),
        })
    };
}

/// A number of a recording: a constant, or the result of an entry of the tape.
///
/// It has no value and no order; made by [`Recording::new`]. Functions known in `f64` alone cannot be recorded.
#[derive(Copy, Clone, Debug)]
pub struct Recorder(Kind);

#[derive(Copy, Clone, Debug)]
enum Kind {
    Constant(f64),
    /// Recording and index.
    Entry(u32, u32),
}

impl Default for Recorder {
    fn default() -> Self {
        Self(Kind::Constant(0.0))
    }
}

impl Tape {
    /// Index of an operand, if it belongs to the recording that is running.
    fn slot(&mut self, x: Recorder) -> Option<u32> {
        match x.0 {
            Kind::Constant(c) => self.push(Operation::Constant(c)),
            Kind::Entry(number, slot) => (number == self.number).then_some(slot),
        }
    }

    fn push(&mut self, operation: Operation) -> Option<u32> {
        let entries = self.entries.as_mut()?;
        self.is_full |= entries.operations.len() >= self.most;
        if self.is_full {
            return None;
        }
        Some(entries.slot(operation))
    }

    fn input(&mut self) -> Recorder {
        let slot = self.push(Operation::Input(self.inputs as u32)).unwrap_or(0);
        self.inputs += 1;
        Recorder(Kind::Entry(self.number, slot))
    }

    /// Start and cubic of the interval that an entry is in, as inputs; none where breaks are compared, or there are none.
    fn look_up(&mut self, x: Recorder, breaks: &[f64], rows: &[[f64; 4]]) -> Option<Interval> {
        let Kind::Entry(_, slot) = x.0 else { return None };
        let key = (slot, rows.as_ptr() as usize);
        // an address may have been that of another table
        let is_that = |of: usize| self.lookups[of].1.is(breaks, rows);
        match self.known.as_ref().filter(|_| rows.len() > 1)?.get(&key) {
            Some((inputs, of)) if is_that(*of) => return Some(*inputs),
            _ => {}
        }
        let inputs = std::array::from_fn(|_| self.input());
        self.known.as_mut()?.insert(key, (inputs, self.lookups.len()));
        self.lookups.push((x, Lookup::new(breaks, rows)));
        Some(inputs)
    }
}

/// Appends an operation on operands that are not all constants.
fn append<const N: usize>(operands: [Recorder; N], make: impl Fn([u32; N]) -> Operation) -> Recorder {
    TAPE.with_borrow_mut(|tape| {
        let mut slots = [0; N];
        for (slot, x) in slots.iter_mut().zip(operands) {
            match tape.slot(x) {
                Some(found) => *slot = found,
                None => return Recorder::from_f64(f64::NAN),
            }
        }
        match tape.push(make(slots)) {
            Some(slot) => Recorder(Kind::Entry(tape.number, slot)),
            None => Recorder::from_f64(f64::NAN),
        }
    })
}

impl Recorder {
    /// Above 0 where a number of this recording lies beyond bounds with which it was compared so far, and where `f64`
    /// therefore fails (see [`Functions::outside`]).
    pub fn beyond() -> Self {
        let bounded = TAPE.with_borrow(|tape| tape.bounded.clone());
        bounded.into_iter().fold(Self::from_f64(-1.0), |most, (x, low, high)| {
            most.max(Self::from_f64(low) - x).max(x - Self::from_f64(high))
        })
    }

    #[inline]
    fn one_of(self, plain: impl Fn(f64) -> f64, make: impl Fn(u32) -> Operation) -> Self {
        match self.0 {
            Kind::Constant(x) => Self::from_f64(plain(x)),
            Kind::Entry(..) => append([self], |[x]| make(x)),
        }
    }

    #[inline]
    fn two_of(self, other: Self, plain: impl Fn(f64, f64) -> f64, make: impl Fn(u32, u32) -> Operation) -> Self {
        match (self.0, other.0) {
            (Kind::Constant(x), Kind::Constant(y)) => Self::from_f64(plain(x, y)),
            _ => append([self, other], |[x, y]| make(x, y)),
        }
    }
}

impl Add for Recorder {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        self.two_of(other, |x, y| x + y, Operation::Add)
    }
}

impl Sub for Recorder {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self.two_of(other, |x, y| x - y, Operation::Sub)
    }
}

impl Mul for Recorder {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        self.two_of(other, |x, y| x * y, Operation::Mul)
    }
}

impl Div for Recorder {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        self.two_of(other, |x, y| x / y, Operation::Div)
    }
}

impl Neg for Recorder {
    type Output = Self;
    fn neg(self) -> Self {
        self.one_of(|x| -x, Operation::Neg)
    }
}

impl AddAssign for Recorder {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl SubAssign for Recorder {
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

impl MulAssign for Recorder {
    fn mul_assign(&mut self, other: Self) {
        *self = *self * other;
    }
}

impl Scalar for Recorder {
    #[inline(always)]
    fn from_f64(x: f64) -> Self {
        Self(Kind::Constant(x))
    }
    fn zero() -> Self {
        Self::from_f64(0.0)
    }
    fn one() -> Self {
        Self::from_f64(1.0)
    }
    fn sqrt(self) -> Self {
        self.one_of(f64::sqrt, Operation::Sqrt)
    }
    fn power(self, exponent: f64) -> Self {
        self.one_of(|x| x.power(exponent), |x| Operation::Power(x, exponent))
    }
    fn sin_cos(self) -> (Self, Self) {
        (self.one_of(f64::sin, Operation::Sin), self.one_of(f64::cos, Operation::Cos))
    }
    fn atan2(self, x: Self) -> Self {
        self.two_of(x, Scalar::atan2, Operation::Atan2)
    }
    fn hypot(self, other: Self) -> Self {
        self.two_of(other, f64::hypot, Operation::Hypot)
    }
    fn scale(self, factor: f64) -> Self {
        self.one_of(|x| x * factor, |x| Operation::Scale(x, factor))
    }
}

impl Cases for Recorder {
    fn abs(self) -> Self {
        self.one_of(f64::abs, Operation::Abs)
    }
    fn round(self) -> Self {
        self.one_of(f64::round, Operation::Round)
    }
    fn max(self, other: Self) -> Self {
        self.two_of(other, f64::max, Operation::Max)
    }
    fn min(self, other: Self) -> Self {
        self.two_of(other, f64::min, Operation::Min)
    }
    fn where_positive(self, yes: Self, no: Self) -> Self {
        match self.0 {
            Kind::Constant(x) if x > 0.0 => yes,
            Kind::Constant(_) => no,
            Kind::Entry(..) => append([self, yes, no], |[x, y, n]| Operation::WherePositive(x, y, n)),
        }
    }
    fn over_or_zero(self, divisor: Self) -> Self {
        self.two_of(divisor, f64::over_or_zero, Operation::OverOrZero)
    }
}

impl Functions for Recorder {
    const CALLS: bool = false;
    /// Inputs, or one comparison for each break, so that the recording serves every interval.
    fn interval(self, breaks: &[f64], rows: &[[f64; 4]]) -> (Self, [Self; 4]) {
        if let Some([start, a, b, c, d]) = TAPE.with_borrow_mut(|tape| tape.look_up(self, breaks, rows)) {
            return (start, [a, b, c, d]);
        }
        let (mut start, mut row) = (Self::from_f64(breaks[0]), rows[0].map(Self::from_f64));
        for (&b, r) in breaks.iter().zip(rows).skip(1) {
            let reached = self.one_of(|x| if x >= b { 1.0 } else { -1.0 }, |x| Operation::Reached(x, b));
            start = reached.where_positive(Self::from_f64(b), start);
            row = std::array::from_fn(|k| reached.where_positive(Self::from_f64(r[k]), row[k]));
        }
        (start, row)
    }
    /// Where a recording has no such input, the number that it is now.
    fn given(place: usize, x: f64) -> Self {
        TAPE.with_borrow(|tape| tape.given.get(place).copied()).unwrap_or(Self::from_f64(x))
    }
    fn outside(self, low: f64, high: f64) -> Option<f64> {
        match self.0 {
            Kind::Constant(x) => x.outside(low, high),
            Kind::Entry(..) => {
                TAPE.with_borrow_mut(|tape| tape.bounded.push((self, low, high)));
                None
            }
        }
    }
    fn call_into<E>(
        _: Arguments<Self>,
        _: &mut Vec<f64>,
        out: &mut [Self],
        _: impl FnMut(f64, &[f64], &[f64], &mut [f64]) -> Result<(), E>,
    ) -> Result<(), E> {
        out.fill(Self::from_f64(f64::NAN));
        Ok(())
    }
}

/// Operations of the longest recording: an operand is a number of 32 bits, and one operation may be entered as three.
const MOST: usize = u32::MAX as usize - 3;

/// A function as a list of operations, evaluated without searching, branching or allocating.
#[derive(Clone, Debug)]
pub struct Recording {
    inputs: usize,
    pub(crate) operations: Vec<Operation>,
    /// The operation of each output.
    pub(crate) outputs: Vec<u32>,
    /// How it is reduced.
    once: Once,
    /// Tables whose intervals are its last inputs; the numbers that are looked up are its last outputs.
    lookups: Vec<Lookup>,
}

impl Recording {
    /// Runs `f` once on recording numbers and keeps the recording. `f` must not record itself.
    ///
    /// Fails where `f` fails.
    pub fn new<E>(inputs: usize, f: impl FnOnce(&[Recorder]) -> Result<Vec<Recorder>, E>) -> Result<Self, E> {
        Self::record(Once::Nothing, MOST, [inputs, 0], f).map(|(made, _)| made)
    }

    /// As [`new`](Self::new), where the numbers given from outside (see [`Functions::given`]) are what `given` makes of the
    /// inputs, and intervals of tables are inputs after them (see [`lookups`](Self::lookups)).
    pub fn with_given<E>(
        inputs: usize,
        given: impl FnOnce(&[Recorder]) -> Vec<Recorder>,
        f: impl FnOnce(&[Recorder]) -> Result<Vec<Recorder>, E>,
    ) -> Result<Self, E> {
        Self::new(inputs, |x| {
            let made = given(x);
            TAPE.with_borrow_mut(|tape| (tape.given, tape.known) = (made, Some(HashMap::new())));
            f(x)
        })
    }

    /// The recording of a function of many parts, reduced as [`lean`](Self::lean) does, but for equal operations on
    /// constants: what equal parts do stays alike, and can be repeated, where constants of some parts are equal by chance.
    ///
    /// Its inputs are arguments of `f`, as many as the first number tells, after them numbers given from outside (see
    /// [`Functions::given`]), then intervals of tables (see [`lookups`](Self::lookups)). None where there are more than `most`
    /// operations, inputs and constants counted, of which no more are then kept.
    pub fn of_parts<E>(
        most: usize,
        inputs: [usize; 2],
        f: impl FnOnce(&[Recorder]) -> Result<Vec<Recorder>, E>,
    ) -> Result<Option<Self>, E> {
        let (made, is_whole) = Self::record(Once::WithoutConstants, most.min(MOST), inputs, f)?;
        Ok(is_whole.then(|| made.needed()))
    }

    /// A recording of at most so many operations, and whether it is whole.
    fn record<E>(
        once: Once,
        most: usize,
        [arguments, given]: [usize; 2],
        f: impl FnOnce(&[Recorder]) -> Result<Vec<Recorder>, E>,
    ) -> Result<(Self, bool), E> {
        let own = TAPE.with_borrow_mut(|tape| {
            tape.number = tape.number.wrapping_add(1);
            tape.entries = Some(Numbered::new(once));
            (tape.most, tape.is_full) = (most, false);
            tape.bounded.clear();
            tape.inputs = 0;
            tape.known = (once == Once::WithoutConstants).then(HashMap::new);
            let own: Vec<_> = (0..arguments).map(|_| tape.input()).collect();
            tape.given = (0..given).map(|_| tape.input()).collect();
            own
        });
        let found = f(&own);
        TAPE.with_borrow_mut(|tape| {
            let (seen, lookups): (Vec<_>, Vec<_>) = std::mem::take(&mut tape.lookups).into_iter().unzip();
            let outputs = found.map(|found| {
                let slot = |tape: &mut Tape, x| tape.slot(x).or_else(|| tape.push(Operation::Constant(f64::NAN)));
                found.into_iter().chain(seen).map(|x| slot(tape, x).unwrap_or(0)).collect()
            });
            let inputs = tape.inputs;
            (tape.given, tape.known) = (Vec::new(), None);
            let operations = tape.entries.take().map_or_else(Vec::new, |entries| entries.operations);
            outputs.map(|outputs| (Self { inputs, operations, outputs, once, lookups }, !tape.is_full))
        })
    }

    /// Number of inputs.
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// Tables in which numbers are looked up: [`Lookup::NUMBERS`] inputs for each, the last of all, and as many outputs,
    /// what is looked up.
    pub fn lookups(&self) -> &[Lookup] {
        &self.lookups
    }

    /// Number of outputs.
    pub fn outputs(&self) -> usize {
        self.outputs.len()
    }

    /// Whether an output is the constant 0, whatever the inputs. For a [`lean`](Self::lean) recording this gives the
    /// sparsity pattern.
    pub fn is_zero(&self, output: usize) -> bool {
        matches!(self.operations[self.outputs[output] as usize], Operation::Constant(c) if c == 0.0)
    }

    /// The recording with these of its outputs, in this order.
    #[must_use]
    pub fn with_outputs(&self, wanted: &[usize]) -> Self {
        Self { outputs: wanted.iter().map(|&o| self.outputs[o]).collect(), once: Once::Nothing, ..self.clone() }
    }

    /// Number of operations, inputs and constants counted: the length of `work` in [`evaluate`](Self::evaluate).
    pub fn len(&self) -> usize {
        self.operations.len()
    }

    /// Whether nothing is recorded.
    pub fn is_empty(&self) -> bool {
        self.operations.is_empty()
    }

    /// The outputs for these inputs: identical to those of `f64`, to the bit.
    ///
    /// # Panics
    /// If `inputs`, `work` or `out` is shorter than the recording requires.
    pub fn evaluate(&self, inputs: &[f64], work: &mut [f64], out: &mut [f64]) {
        assert!(inputs.len() >= self.inputs, "{} inputs for a recording of {}", inputs.len(), self.inputs);
        assert!(work.len() >= self.len(), "{} places for {} operations", work.len(), self.len());
        for (i, operation) in self.operations.iter().enumerate() {
            let (before, rest) = work.split_at_mut(i);
            let at = |slot: u32| before[slot as usize];
            rest[0] = match *operation {
                Operation::Input(k) => inputs[k as usize],
                Operation::Constant(c) => c,
                Operation::Add(x, y) => at(x) + at(y),
                Operation::Sub(x, y) => at(x) - at(y),
                Operation::Mul(x, y) => at(x) * at(y),
                Operation::Div(x, y) => at(x) / at(y),
                Operation::OverOrZero(x, y) => at(x).over_or_zero(at(y)),
                Operation::Neg(x) => -at(x),
                Operation::Sqrt(x) => at(x).sqrt(),
                Operation::Power(x, exponent) => at(x).power(exponent),
                Operation::Sin(x) => Scalar::sin_cos(at(x)).0,
                Operation::Cos(x) => Scalar::sin_cos(at(x)).1,
                Operation::Atan2(x, y) => Scalar::atan2(at(x), at(y)),
                Operation::Hypot(x, y) => at(x).hypot(at(y)),
                Operation::Abs(x) => at(x).abs(),
                Operation::Round(x) => at(x).round(),
                Operation::Max(x, y) => at(x).max(at(y)),
                Operation::Min(x, y) => at(x).min(at(y)),
                Operation::WherePositive(x, y, n) => at(x).where_positive(at(y), at(n)),
                Operation::Reached(x, b) => {
                    if at(x) >= b {
                        1.0
                    } else {
                        -1.0
                    }
                }
                Operation::Scale(x, factor) => at(x) * factor,
            };
        }
        for (out, &slot) in out[..self.outputs.len()].iter_mut().zip(&self.outputs) {
            *out = work[slot as usize];
        }
    }
}
