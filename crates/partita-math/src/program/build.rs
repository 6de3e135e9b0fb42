//! From a recording to instructions and registers.

use super::{Code, Instruction, Program};
use crate::scalar::{Operation, Recording};
use rustc_hash::FxHashMap;
use std::ops::Range;

/// What a value is.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// It keeps its register from the start.
    Given,
    Settled,
    Changing,
}

/// No register.
const NONE: u32 = u32::MAX;

struct Builder<'a> {
    operations: &'a [Operation],
    kind: Vec<Kind>,
    /// Readers still to come; an output has one more, for ever.
    readers: Vec<u32>,
    /// The sine of each angle, and the cosine.
    sines: FxHashMap<u32, [Option<u32>; 2]>,
    /// Products that the sum which alone reads them computes.
    fused: Vec<bool>,
    register: Vec<u32>,
    free: Vec<u32>,
    registers: u32,
    exponents: Vec<f64>,
}

pub(super) fn program(lean: &Recording, settled: Range<usize>) -> Program {
    let mut b = Builder::new(lean, &settled);
    let mut constants = Vec::new();
    for (i, operation) in b.operations.iter().enumerate() {
        if let Operation::Input(k) = operation {
            b.register[i] = *k;
        }
    }
    b.registers = lean.inputs() as u32;
    // factors and the bounds of tables are constants of their operations
    let mut known = FxHashMap::default();
    for (i, operation) in b.operations.iter().enumerate() {
        let (Operation::Constant(c) | Operation::Reached(_, c) | Operation::Scale(_, c)) = operation else { continue };
        let register = *known.entry(c.to_bits()).or_insert(b.registers);
        if register == b.registers {
            constants.push(*c);
            b.registers += 1;
        }
        if let Operation::Constant(_) = operation {
            b.register[i] = register;
        }
    }
    let mut parts = [Vec::new(), Vec::new()];
    for (part, kind) in parts.iter_mut().zip([Kind::Settled, Kind::Changing]) {
        for i in 0..b.operations.len() {
            if b.kind[i] == kind && !b.fused[i] {
                b.append(i, &known, part);
            }
        }
    }
    let [prepare, code] = parts;
    let outputs = lean.outputs.iter().map(|&x| b.register[x as usize]).collect();
    Program {
        inputs: lean.inputs(),
        prepare,
        code,
        constants,
        exponents: b.exponents,
        registers: b.registers as usize,
        outputs,
    }
}

impl<'a> Builder<'a> {
    fn new(lean: &'a Recording, settled: &Range<usize>) -> Self {
        let operations = &lean.operations;
        let count = operations.len();
        let (mut kind, mut constant) = (vec![Kind::Given; count], vec![false; count]);
        let (mut readers, mut sines) = (vec![0; count], FxHashMap::<u32, [Option<u32>; 2]>::default());
        for (i, operation) in operations.iter().enumerate() {
            let mut all = true;
            operation.operands(|x| {
                readers[x as usize] += 1;
                all &= constant[x as usize];
            });
            (constant[i], kind[i]) = match operation {
                Operation::Input(k) => (settled.contains(&(*k as usize)), Kind::Given),
                Operation::Constant(_) => (true, Kind::Given),
                _ => (all, if all { Kind::Settled } else { Kind::Changing }),
            };
            match operation {
                Operation::Sin(x) => sines.entry(*x).or_default()[0] = Some(i as u32),
                Operation::Cos(x) => sines.entry(*x).or_default()[1] = Some(i as u32),
                _ => {}
            }
        }
        // outputs, and settled values that the changing part reads, keep their registers
        lean.outputs.iter().for_each(|&x| readers[x as usize] += 1);
        let mut fused = vec![false; count];
        for (i, operation) in operations.iter().enumerate() {
            if let Operation::Add(x, y) | Operation::Sub(x, y) = operation {
                let product = |x: u32| {
                    let x = x as usize;
                    matches!(operations[x], Operation::Mul(..)) && readers[x] == 1 && kind[x] == kind[i]
                };
                if let Some(x) = [*x, *y].into_iter().find(|x| product(*x)) {
                    fused[x as usize] = true;
                }
            }
        }
        for (i, operation) in operations.iter().enumerate() {
            operation.operands(|x| {
                if kind[x as usize] == Kind::Settled && kind[i] != Kind::Settled {
                    readers[x as usize] += 1;
                }
            });
        }
        Self {
            operations,
            kind,
            readers,
            sines,
            fused,
            register: vec![NONE; count],
            free: Vec::new(),
            registers: 0,
            exponents: Vec::new(),
        }
    }

    /// A register for value i, a free one if there is one.
    fn take(&mut self, i: usize) -> u32 {
        self.register[i] = self.spare();
        self.register[i]
    }

    /// The register of an operand; free for another value if this was its last reader.
    fn read(&mut self, x: u32) -> u32 {
        let i = x as usize;
        self.readers[i] -= 1;
        let register = self.register[i];
        if self.readers[i] == 0 && self.kind[i] != Kind::Given {
            self.free.push(register);
        }
        register
    }

    /// The instruction that computes value i.
    fn append(&mut self, i: usize, constants: &FxHashMap<u64, u32>, part: &mut Vec<Instruction>) {
        use Operation as O;
        if self.register[i] != NONE {
            return; // a sine or a cosine that is known with the other
        }
        let constant = |c: f64| constants.get(&c.to_bits()).copied().unwrap_or(NONE);
        let plain = |code: Code, [x, y, z]: [u32; 3]| Instruction { code, to: NONE, also: NONE, x, y, z };
        let mut made = match self.operations[i] {
            O::Input(_) | O::Constant(_) => return,
            O::Sin(x) | O::Cos(x) => return self.append_sine(x, part),
            O::Add(x, y) => match [(x, y), (y, x)].into_iter().find_map(|(x, z)| Some((self.factors(x)?, z))) {
                Some((factors, z)) => self.fusion(Code::ProductPlus, factors, z),
                None => plain(Code::Add, [self.read(x), self.read(y), 0]),
            },
            O::Sub(x, y) => match (self.factors(x), self.factors(y)) {
                (Some(factors), _) => self.fusion(Code::ProductMinus, factors, y),
                (None, Some(factors)) => self.fusion(Code::MinusProduct, factors, x),
                (None, None) => plain(Code::Sub, [self.read(x), self.read(y), 0]),
            },
            O::Mul(x, y) => plain(Code::Mul, [self.read(x), self.read(y), 0]),
            O::Div(x, y) => plain(Code::Div, [self.read(x), self.read(y), 0]),
            O::OverOrZero(x, y) => plain(Code::OverOrZero, [self.read(x), self.read(y), 0]),
            O::Atan2(x, y) => plain(Code::Atan2, [self.read(x), self.read(y), 0]),
            O::Hypot(x, y) => plain(Code::Hypot, [self.read(x), self.read(y), 0]),
            O::Max(x, y) => plain(Code::Max, [self.read(x), self.read(y), 0]),
            O::Min(x, y) => plain(Code::Min, [self.read(x), self.read(y), 0]),
            O::Neg(x) => plain(Code::Neg, [self.read(x), 0, 0]),
            O::Sqrt(x) => plain(Code::Sqrt, [self.read(x), 0, 0]),
            O::Abs(x) => plain(Code::Abs, [self.read(x), 0, 0]),
            O::Round(x) => plain(Code::Round, [self.read(x), 0, 0]),
            O::WherePositive(x, y, n) => plain(Code::WherePositive, [self.read(x), self.read(y), self.read(n)]),
            O::Reached(x, bound) => plain(Code::Reached, [self.read(x), constant(bound), 0]),
            O::Scale(x, factor) => plain(Code::Mul, [self.read(x), constant(factor), 0]),
            O::Power(x, exponent) => {
                self.exponents.push(exponent);
                let mut made = plain(Code::Power, [self.read(x), 0, 0]);
                made.also = self.exponents.len() as u32 - 1;
                made
            }
        };
        made.to = self.take(i);
        part.push(made);
    }

    /// The factors of a product that its sum computes.
    fn factors(&self, x: u32) -> Option<(u32, u32)> {
        match self.operations[x as usize] {
            Operation::Mul(a, b) if self.fused[x as usize] => Some((a, b)),
            _ => None,
        }
    }

    /// Product and sum in one.
    fn fusion(&mut self, code: Code, (x, y): (u32, u32), z: u32) -> Instruction {
        Instruction { code, to: NONE, also: NONE, x: self.read(x), y: self.read(y), z: self.read(z) }
    }

    /// Sine and cosine of an angle at the first of them.
    fn append_sine(&mut self, x: u32, part: &mut Vec<Instruction>) {
        let pair = self.sines.get(&x).copied().unwrap_or_default();
        let angle = self.register[x as usize];
        // written before all of the angle is read: in registers of their own
        let [to, also] = pair.map(|i| match i {
            Some(i) => self.take(i as usize),
            None => self.spare(),
        });
        for _ in pair.into_iter().flatten() {
            self.read(x);
        }
        // what nobody reads is free again
        for (i, register) in pair.into_iter().zip([to, also]) {
            if i.is_none() {
                self.free.push(register);
            }
        }
        part.push(Instruction { code: Code::SinCos, to, also, x: angle, y: 0, z: 0 });
    }

    /// A register for a value that nobody reads.
    fn spare(&mut self) -> u32 {
        self.free.pop().unwrap_or_else(|| {
            self.registers += 1;
            self.registers - 1
        })
    }
}
