//! Steps as instructions of 64-bit ARM.
//!
//! ```text
//! x0, x1, x2 ──► x20 inputs, x21 constants, x22 outputs, x19 the stack, all kept over calls
//! ```

use crate::functions;
use crate::steps::{Address, Operand, Register, Registers, Step, Steps, PAGE};
use partita_math::program::Code;

/// Registers d0 to d7 and d16 to d29, which a function need not keep; the last two are for results that go to memory and for
/// what lies between the instructions of one step.
const HELD: usize = 22;
const BETWEEN: Register = 22;
const PASSING: Register = 23;

/// Numbers within the reach of an instruction that loads or stores.
const REACH: usize = 4096;

/// Conditions of a choice.
const EQUAL: u32 = 0;
const GREATER: u32 = 12;

/// Registers of this processor.
pub(crate) fn registers() -> Registers {
    Registers { held: HELD, passing: PASSING, reads_memory: false, loops: false }
}

/// The code of a function `(inputs, constants, outputs)`.
pub(crate) fn assemble(steps: &Steps) -> Vec<u8> {
    let mut a = Assembler { bytes: Vec::with_capacity(4 * steps.steps.len()) };
    let frame = (8 * steps.stack).next_multiple_of(16);
    a.enter(frame);
    steps.steps.iter().for_each(|step| a.step(step));
    a.leave(frame);
    a.bytes
}

struct Assembler {
    bytes: Vec<u8>,
}

/// The number of a register in instructions.
fn d(r: Register) -> u32 {
    u32::from(if r < 8 { r } else { r + 8 })
}

impl Assembler {
    fn put(&mut self, instructions: &[u32]) {
        instructions.iter().for_each(|x| self.bytes.extend_from_slice(&x.to_le_bytes()));
    }

    /// `add` or `sub` of a number below 2^24 to sp, in two instructions.
    fn move_stack_pointer(&mut self, operation: u32, bytes: usize) {
        let (high, low) = ((bytes >> 12) as u32, (bytes & 0xfff) as u32);
        self.put(&[operation | 1 << 22 | high << 10 | 31 << 5 | 31, operation | low << 10 | 31 << 5 | 31]);
    }

    fn enter(&mut self, frame: usize) {
        // stp x29, x30, [sp, #-48]!; stp x19, x20, [sp, #16]; stp x21, x22, [sp, #32]
        self.put(&[0xa9bd_7bfd, 0xa901_53f3, 0xa902_5bf5]);
        for page in 1..=(frame / PAGE) as u32 {
            // sub x16, sp, #page, lsl #12; str xzr, [x16]
            self.put(&[0xd140_0000 | page << 10 | 31 << 5 | 16, 0xf900_0000 | 16 << 5 | 31]);
        }
        self.move_stack_pointer(0xd100_0000, frame);
        // mov x19, sp; mov x20, x0; mov x21, x1; mov x22, x2
        self.put(&[0x9100_03f3, 0xaa00_03f4, 0xaa01_03f5, 0xaa02_03f6]);
    }

    fn leave(&mut self, frame: usize) {
        self.move_stack_pointer(0x9100_0000, frame);
        // ldp x21, x22, [sp, #32]; ldp x19, x20, [sp, #16]; ldp x29, x30, [sp], #48; ret
        self.put(&[0xa942_5bf5, 0xa941_53f3, 0xa8c3_7bfd, 0xd65f_03c0]);
    }

    fn step(&mut self, step: &Step) {
        match *step {
            Step::Load(to, from) => self.at(0xfd40_0000, to, from),
            Step::Store(to, from) => self.at(0xfd00_0000, from, to),
            Step::Compute { code, to, operands } => self.compute(code, to, operands),
            Step::Call(code) => self.call(functions::of(code)),
            Step::Loop { .. } => unreachable!("its registers have no loops"),
            Step::Sines { count, to } => {
                // mov x0, count; mov x1, x19; add x2, x19, sines
                self.number(0, count as u64);
                self.number(2, 8 * to as u64);
                self.put(&[0xaa13_03e1, 0x8b02_0262]);
                self.call(functions::sines as *const ());
            }
        }
    }

    /// A number into a general register.
    fn number(&mut self, to: u32, number: u64) {
        self.put(&[0xd280_0000 | (number as u32 & 0xffff) << 5 | to]);
        for part in 1..4 {
            let bits = (number >> (16 * part)) as u32 & 0xffff;
            if bits != 0 {
                self.put(&[0xf280_0000 | part << 21 | bits << 5 | to]);
            }
        }
    }

    /// By the address in x16.
    fn call(&mut self, function: *const ()) {
        self.number(16, function as usize as u64);
        self.put(&[0xd63f_0000 | 16 << 5]);
    }

    /// Loads or stores a register.
    fn at(&mut self, instruction: u32, register: Register, place: Address) {
        let (base, k) = match place {
            Address::Input(k) => (20, k),
            Address::Constant(k) => (21, k),
            Address::Output(k) => (22, k),
            Address::Stack(k) => (19, k),
            Address::Moving(..) => unreachable!("its registers have no loops"),
        };
        let (far, near) = ((k / REACH) as u32, (k % REACH) as u32);
        let mut from = base;
        if far > 0 {
            // add x16, base, #far, lsl #12
            self.put(&[0x9140_0000 | (8 * far) << 10 | base << 5 | 16]);
            from = 16;
        }
        self.put(&[instruction | near << 10 | from << 5 | d(register)]);
    }

    fn compute(&mut self, code: Code, to: Register, operands: [Operand; 3]) {
        let [x, y, z] = operands.map(|x| match x {
            Operand::Register(r) => d(r),
            Operand::Memory(_) => unreachable!("an operand in memory"),
        });
        let (to, between) = (d(to), d(BETWEEN));
        let two = |operation: u32, to: u32, x: u32, y: u32| operation | y << 16 | x << 5 | to;
        let one = |operation: u32| operation | x << 5 | to;
        let choose = |condition: u32, x: u32, y: u32| 0x1e60_0c00 | y << 16 | condition << 12 | x << 5 | to;
        const ADD: u32 = 0x1e60_2800;
        const SUBTRACT: u32 = 0x1e60_3800;
        const MULTIPLY: u32 = 0x1e60_0800;
        const DIVIDE: u32 = 0x1e60_1800;
        match code {
            Code::Add => self.put(&[two(ADD, to, x, y)]),
            Code::Sub => self.put(&[two(SUBTRACT, to, x, y)]),
            Code::Mul => self.put(&[two(MULTIPLY, to, x, y)]),
            Code::Div => self.put(&[two(DIVIDE, to, x, y)]),
            Code::ProductPlus => self.put(&[two(MULTIPLY, between, x, y), two(ADD, to, between, z)]),
            Code::ProductMinus => self.put(&[two(MULTIPLY, between, x, y), two(SUBTRACT, to, between, z)]),
            Code::MinusProduct => self.put(&[two(MULTIPLY, between, x, y), two(SUBTRACT, to, z, between)]),
            Code::Neg => self.put(&[one(0x1e61_4000)]),
            Code::Abs => self.put(&[one(0x1e60_c000)]),
            Code::Sqrt => self.put(&[one(0x1e61_c000)]),
            // fmaxnm, fminnm: the other one where one is NaN
            Code::Max => self.put(&[two(0x1e60_6800, to, x, y)]),
            Code::Min => self.put(&[two(0x1e60_7800, to, x, y)]),
            Code::OverOrZero => {
                // fcmp y, #0.0; fdiv; movi between, #0
                self.put(&[0x1e60_2008 | y << 5, two(DIVIDE, to, x, y), 0x2f00_e400 | between]);
                self.put(&[choose(EQUAL, between, to)]);
            }
            Code::WherePositive => self.put(&[0x1e60_2008 | x << 5, choose(GREATER, y, z)]),
            Code::Reached => {
                // fcmp y, x; fmov between, #-1.0; fmov to, #1.0
                self.put(&[0x1e60_2000 | x << 16 | y << 5, 0x1e7e_1000 | between, 0x1e6e_1000 | to]);
                self.put(&[choose(GREATER, between, to)]);
            }
            Code::Power | Code::SinCos | Code::Atan2 | Code::Hypot | Code::Round => unreachable!("a call"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(step: Step) -> Vec<u32> {
        let mut a = Assembler { bytes: Vec::new() };
        a.step(&step);
        a.bytes.chunks(4).map(|x| u32::from_le_bytes(x.try_into().unwrap())).collect()
    }

    /// Instructions as another assembler writes them.
    #[test]
    fn instructions_are_those_of_the_manual() {
        let operands = [2, 9, 21].map(Operand::Register);
        let compute = |code| words(Step::Compute { code, to: 1, operands });
        // d1; d2, d17, d29; d30 between
        assert_eq!(compute(Code::Add), [0x1e71_2841]); // fadd d1, d2, d17
        assert_eq!(compute(Code::Sub), [0x1e71_3841]); // fsub d1, d2, d17
        assert_eq!(compute(Code::Mul), [0x1e71_0841]); // fmul d1, d2, d17
        assert_eq!(compute(Code::Div), [0x1e71_1841]); // fdiv d1, d2, d17
        assert_eq!(compute(Code::Max), [0x1e71_6841]); // fmaxnm d1, d2, d17
        assert_eq!(compute(Code::Min), [0x1e71_7841]); // fminnm d1, d2, d17
        assert_eq!(compute(Code::Neg), [0x1e61_4041]); // fneg d1, d2
        assert_eq!(compute(Code::Abs), [0x1e60_c041]); // fabs d1, d2
        assert_eq!(compute(Code::Sqrt), [0x1e61_c041]); // fsqrt d1, d2

        // fmul d30, d2, d17; fadd d1, d30, d29
        assert_eq!(compute(Code::ProductPlus), [0x1e71_085e, 0x1e7d_2bc1]);
        // fmul d30, d2, d17; fsub d1, d30, d29
        assert_eq!(compute(Code::ProductMinus), [0x1e71_085e, 0x1e7d_3bc1]);
        // fmul d30, d2, d17; fsub d1, d29, d30
        assert_eq!(compute(Code::MinusProduct), [0x1e71_085e, 0x1e7e_3ba1]);
        // fcmp d17, #0.0; fdiv d1, d2, d17; movi d30, #0; fcsel d1, d30, d1, eq
        assert_eq!(compute(Code::OverOrZero), [0x1e60_2228, 0x1e71_1841, 0x2f00_e41e, 0x1e61_0fc1]);
        // fcmp d2, #0.0; fcsel d1, d17, d29, gt
        assert_eq!(compute(Code::WherePositive), [0x1e60_2048, 0x1e7d_ce21]);
        // fcmp d17, d2; fmov d30, #-1.0; fmov d1, #1.0; fcsel d1, d30, d1, gt
        assert_eq!(compute(Code::Reached), [0x1e62_2220, 0x1e7e_101e, 0x1e6e_1001, 0x1e61_cfc1]);
        assert_eq!(words(Step::Load(8, Address::Input(3))), [0xfd40_0e90]); // ldr d16, [x20, #24]
        assert_eq!(words(Step::Store(Address::Output(1), 0)), [0xfd00_06c0]); // str d0, [x22, #8]

        // add x16, x19, #16, lsl #12; ldr d0, [x16, #8]
        assert_eq!(words(Step::Load(0, Address::Stack(8193))), [0x9140_4270, 0xfd40_0600]);
    }

    #[test]
    fn a_function_keeps_the_registers_of_its_caller() {
        let mut a = Assembler { bytes: Vec::new() };
        a.enter(0x5010);
        let entered = a.bytes.len();
        a.leave(0x5010);
        let last = |n: usize| u32::from_le_bytes(a.bytes[a.bytes.len() - n..][..4].try_into().unwrap());
        // five pages are touched, each by two instructions
        assert_eq!(entered, 4 * (3 + 2 * 5 + 2 + 4));
        assert_eq!(last(4), 0xd65f_03c0); // ret
        assert_eq!(last(8), 0xa8c3_7bfd); // ldp x29, x30, [sp], #48
    }
}
