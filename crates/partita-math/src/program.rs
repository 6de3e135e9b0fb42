//! A recording made ready for many evaluations: registers reused, constants and settled inputs apart.
//!
//! ```text
//! Recording ──► Program ──► Work<f64, 1>      one evaluation
//!                      ├──► Work<Lanes, G>    8 G members side by side, G groups of eight to each instruction
//!                      └──► Compiled          one evaluation, by code of this processor
//! ```
//!
//! Values lie in *registers*. Inputs and constants keep theirs; a settled value, which depends on settled inputs and
//! constants alone, is computed by [`Work::prepare`] and keeps its own; every other value gives its register to another
//! after its last reader, so that the work of a block of members stays in the first cache. A sine and a cosine of one
//! angle are one instruction, and so are a product and the sum that alone reads it, each of which still rounds. Every
//! member therefore has the bits of [`Recording::evaluate`].

mod build;
mod compiled;

pub use compiled::{Compiled, Compiler, NotCompiled};

use crate::scalar::{Lanes, Recording, Scalar};
use crate::wide::{widely, Kernel};
use std::ops::Range;

/// What an instruction does with the registers that it reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Code {
    /// x + y.
    Add,
    /// x − y.
    Sub,
    /// x y.
    Mul,
    /// x / y.
    Div,
    /// x / y, 0 where y is 0.
    OverOrZero,
    /// −x.
    Neg,
    /// √x.
    Sqrt,
    /// x to a constant exponent.
    Power,
    /// Sine and cosine of x.
    SinCos,
    /// Angle of the point (y, x).
    Atan2,
    /// √(x² + y²) without overflow.
    Hypot,
    /// |x|.
    Abs,
    /// The nearest whole number, halves away from 0.
    Round,
    /// The larger one; the other one where one is NaN.
    Max,
    /// The smaller one; the other one where one is NaN.
    Min,
    /// y where x is above 0, else z.
    WherePositive,
    /// 1, or −1 where x lies below y.
    Reached,
    /// x y + z, z + x y.
    ProductPlus,
    /// x y − z.
    ProductMinus,
    /// z − x y.
    MinusProduct,
}

/// One instruction: registers that it writes and reads.
#[derive(Clone, Copy, Debug)]
pub struct Instruction {
    /// What it does.
    pub code: Code,
    /// The register that it writes.
    pub to: u32,
    /// Of a sine and a cosine: the register of the cosine. Of a power: the exponent's place.
    pub also: u32,
    /// The registers that it reads, as many as its code has operands.
    pub x: u32,
    /// See `x`.
    pub y: u32,
    /// See `x`.
    pub z: u32,
}

/// A recording made ready for many evaluations; immutable, shared by threads.
#[derive(Clone, Debug)]
pub struct Program {
    inputs: usize,
    /// Of the settled part.
    prepare: Vec<Instruction>,
    code: Vec<Instruction>,
    constants: Vec<f64>,
    exponents: Vec<f64>,
    registers: usize,
    /// Register of each output.
    outputs: Vec<u32>,
}

impl Program {
    /// The program of a recording, reduced first (see [`Recording::lean`]). `settled` inputs change seldom.
    pub fn new(recording: &Recording, settled: Range<usize>) -> Self {
        build::program(&recording.lean(), settled)
    }

    /// The program of a recording, reduced as [`Recording::of_parts`] does.
    pub fn of_parts(recording: &Recording) -> Self {
        build::program(&recording.by_parts(), 0..0)
    }

    /// Number of inputs.
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// Number of outputs.
    pub fn outputs(&self) -> usize {
        self.outputs.len()
    }

    /// Number of instructions of an evaluation, those of the settled part not counted.
    pub fn len(&self) -> usize {
        self.code.len()
    }

    /// All instructions in order, those of the settled part first. Inputs are in the first registers, the constants
    /// follow them.
    pub fn instructions(&self) -> impl Iterator<Item = &Instruction> {
        self.prepare.iter().chain(&self.code)
    }

    /// Number of registers.
    pub fn registers(&self) -> usize {
        self.registers
    }

    /// Constants, in the registers after those of the inputs.
    pub fn constants(&self) -> &[f64] {
        &self.constants
    }

    /// Exponents of powers.
    pub fn exponents(&self) -> &[f64] {
        &self.exponents
    }

    /// Register of each output.
    pub fn output_registers(&self) -> &[u32] {
        &self.outputs
    }

    /// Whether an evaluation computes nothing.
    pub fn is_empty(&self) -> bool {
        self.code.is_empty()
    }

    /// Memory for evaluations.
    pub fn work<S: Scalar, const G: usize>(&self) -> Work<S, G> {
        let mut registers = vec![[S::zero(); G]; self.registers];
        for (register, c) in registers[self.inputs..].iter_mut().zip(&self.constants) {
            *register = [S::from_f64(*c); G];
        }
        let mut work = Work { registers };
        work.prepare(self);
        work
    }
}

/// The registers of `G` numbers each; with [`Lanes`], of 8 G members.
#[derive(Clone, Debug)]
pub struct Work<S, const G: usize> {
    registers: Vec<[S; G]>,
}

impl<S: Scalar, const G: usize> Work<S, G> {
    /// Input k, to be written.
    #[inline(always)]
    pub fn input(&mut self, program: &Program, k: usize) -> &mut [S; G] {
        &mut self.inputs(program)[k]
    }

    /// All inputs, to be written.
    #[inline(always)]
    pub fn inputs(&mut self, program: &Program) -> &mut [[S; G]] {
        &mut self.registers[..program.inputs]
    }

    /// Output o of the last evaluation.
    #[inline(always)]
    pub fn output(&self, program: &Program, o: usize) -> &[S; G] {
        &self.registers[program.outputs[o] as usize]
    }

    /// What depends on settled inputs alone: after each change of theirs.
    pub fn prepare(&mut self, program: &Program) {
        widely(Execution { instructions: &program.prepare, exponents: &program.exponents, work: &mut self.registers });
    }

    /// One evaluation of every member, with the widest instructions of this processor.
    pub fn evaluate(&mut self, program: &Program) {
        widely(Execution { instructions: &program.code, exponents: &program.exponents, work: &mut self.registers });
    }

    /// As [`evaluate`](Self::evaluate), to be compiled into a [`Kernel`].
    #[inline(always)]
    pub fn evaluate_inside(&mut self, program: &Program) {
        execute(&program.code, &program.exponents, &mut self.registers);
    }
}

impl<const G: usize> Work<Lanes, G> {
    /// Input k of a member.
    #[inline(always)]
    pub fn set(&mut self, k: usize, member: usize, x: f64) {
        self.registers[k][member / Lanes::COUNT].0[member % Lanes::COUNT] = x;
    }

    /// Output o of a member.
    #[inline(always)]
    pub fn get(&self, program: &Program, o: usize, member: usize) -> f64 {
        self.output(program, o)[member / Lanes::COUNT].0[member % Lanes::COUNT]
    }
}

struct Execution<'a, S, const G: usize> {
    instructions: &'a [Instruction],
    exponents: &'a [f64],
    work: &'a mut [[S; G]],
}

impl<S: Scalar, const G: usize> Kernel for Execution<'_, S, G> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        execute(self.instructions, self.exponents, self.work);
    }
}

// Loops, since a function that the compiler does not put into the kernel would have no wide instructions.

#[inline(always)]
fn one<S: Scalar, const G: usize>(work: &mut [[S; G]], i: &Instruction, f: impl Fn(S) -> S) {
    let mut found = work[i.x as usize];
    for x in &mut found {
        *x = f(*x);
    }
    work[i.to as usize] = found;
}

#[inline(always)]
fn two<S: Scalar, const G: usize>(work: &mut [[S; G]], i: &Instruction, f: impl Fn(S, S) -> S) {
    let (mut found, y) = (work[i.x as usize], &work[i.y as usize]);
    for (x, y) in found.iter_mut().zip(y) {
        *x = f(*x, *y);
    }
    work[i.to as usize] = found;
}

#[inline(always)]
fn three<S: Scalar, const G: usize>(work: &mut [[S; G]], i: &Instruction, f: impl Fn(S, S, S) -> S) {
    let (mut found, y, z) = (work[i.x as usize], &work[i.y as usize], &work[i.z as usize]);
    for (x, (y, z)) in found.iter_mut().zip(y.iter().zip(z)) {
        *x = f(*x, *y, *z);
    }
    work[i.to as usize] = found;
}

/// A function of one register or two, by its name: a closure as long as some of them would be a function of its own.
macro_rules! by_name {
    ($work:ident, $i:ident, $f:ident($($also:expr)?)) => {
        for g in 0..G {
            $work[$i.to as usize][g] = $work[$i.x as usize][g].$f($($also)?);
        }
    };
    ($work:ident, $i:ident, $f:ident of two) => {
        for g in 0..G {
            $work[$i.to as usize][g] = $work[$i.x as usize][g].$f($work[$i.y as usize][g]);
        }
    };
}

#[inline(always)]
fn execute<S: Scalar, const G: usize>(instructions: &[Instruction], exponents: &[f64], work: &mut [[S; G]]) {
    for i in instructions {
        match i.code {
            Code::Add => two(work, i, |x, y| x + y),
            Code::Sub => two(work, i, |x, y| x - y),
            Code::Mul => two(work, i, |x, y| x * y),
            Code::ProductPlus => three(work, i, |x, y, z| x * y + z),
            Code::ProductMinus => three(work, i, |x, y, z| x * y - z),
            Code::MinusProduct => three(work, i, |x, y, z| z - x * y),
            Code::Neg => one(work, i, |x| -x),
            Code::Div => two(work, i, |x, y| x / y),
            Code::OverOrZero => two(work, i, |x, y| x.over_or_zero(y)),
            Code::Sqrt => one(work, i, |x| x.sqrt()),
            Code::Power => {
                let exponent = exponents[i.also as usize];
                by_name!(work, i, power(exponent));
            }
            Code::SinCos => {
                for g in 0..G {
                    let (s, c) = work[i.x as usize][g].sin_cos();
                    work[i.to as usize][g] = s;
                    work[i.also as usize][g] = c;
                }
            }
            Code::Atan2 => by_name!(work, i, atan2 of two),
            Code::Hypot => by_name!(work, i, hypot of two),
            Code::Abs => one(work, i, |x| x.abs()),
            Code::Round => by_name!(work, i, round()),
            Code::Max => two(work, i, |x, y| x.max(y)),
            Code::Min => two(work, i, |x, y| x.min(y)),
            Code::WherePositive => three(work, i, |x, y, z| x.where_positive(y, z)),
            // y − x above 0: x lies below y
            Code::Reached => two(work, i, |x, y| (y - x).where_positive(S::from_f64(-1.0), S::one())),
        }
    }
}

#[cfg(test)]
mod suite;
#[cfg(test)]
mod tests;
