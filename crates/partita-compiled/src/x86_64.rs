//! Steps as instructions of x86-64: those of AVX where the processor has them, else of SSE2.
//!
//! ```text
//! rdi, rsi, rdx, rcx ──► r14 inputs, rbp constants, r15 outputs, rbx the stack or memory for it, kept over calls (System V)
//! loops                  rax turns left, rcx, rdx, rsi, rdi, r8 to r11 what moves
//! ```

use crate::functions;
use crate::steps::{Address, Operand, Pointer, Register, Registers, Step, Steps, PAGE};
use crate::values::POINTERS;
use partita_math::program::Code;

/// Where the masks lie among the constants, beyond those of the program.
#[derive(Clone, Copy, Debug)]
struct Masks {
    sign: Address,
    others: Address,
    one: Address,
}

/// The sign of a number, all its other bits, and 1: constants of the code beside those of a program.
pub(crate) const MASKS: [f64; 3] = [-0.0, f64::from_bits(!(1 << 63)), 1.0];

/// Registers for what lies between the instructions of one step.
const FIRST: Register = 15;
const SECOND: Register = 14;
/// One more for SSE2, whose instructions overwrite an operand.
const THIRD: Register = 13;

/// An instruction on two registers, or a register and memory: prefix and opcode.
#[derive(Clone, Copy)]
struct Instruction(u8, u8);

const ADD: Instruction = Instruction(0xf2, 0x58);
const MULTIPLY: Instruction = Instruction(0xf2, 0x59);
const SUBTRACT: Instruction = Instruction(0xf2, 0x5c);
const DIVIDE: Instruction = Instruction(0xf2, 0x5e);
const SMALLER: Instruction = Instruction(0xf2, 0x5d);
const LARGER: Instruction = Instruction(0xf2, 0x5f);
const ROOT: Instruction = Instruction(0xf2, 0x51);
const COMPARE: Instruction = Instruction(0xf2, 0xc2);
const AND: Instruction = Instruction(0x66, 0x54);
const AND_NOT: Instruction = Instruction(0x66, 0x55);
const OR: Instruction = Instruction(0x66, 0x56);
const XOR: Instruction = Instruction(0x66, 0x57);
const COPY: Instruction = Instruction(0x66, 0x28);
const LOAD: Instruction = Instruction(0xf2, 0x10);
const STORE: Instruction = Instruction(0xf2, 0x11);

/// What a comparison asks.
const EQUAL: u8 = 0;
const LESS: u8 = 1;
const UNORDERED: u8 = 3;

/// General registers.
const RBX: u8 = 3;
const RBP: u8 = 5;
const R14: u8 = 14;
const R15: u8 = 15;
/// Those that move in a loop.
const MOVING: [u8; POINTERS] = [1, 2, 6, 7, 8, 9, 10, 11];

/// The last operand of an instruction.
#[derive(Clone, Copy, PartialEq)]
enum Last {
    Register(u8),
    /// The address in a general register, and bytes beyond it.
    Memory(u8, i32),
}

/// Registers of this processor, with AVX or without, for code with loops or without.
pub(crate) fn registers(avx: bool, loops: bool) -> Registers {
    Registers { held: if avx { 14 } else { 13 }, passing: FIRST, reads_memory: true, loops }
}

/// The code of a function `(inputs, constants, outputs, memory)`; `constants` are those before the masks. With
/// `on_stack` it needs no memory.
pub(crate) fn assemble(steps: &Steps, constants: usize, avx: bool, on_stack: bool) -> Vec<u8> {
    let [sign, others, one] = [0, 1, 2].map(|i| Address::Constant(constants + i));
    // most of what left the registers lies within the reach of one byte
    let middle = 8 * steps.fixed + 128;
    let mut a =
        Assembler { bytes: Vec::with_capacity(8 * steps.steps.len()), avx, middle, masks: Masks { sign, others, one } };
    // at calls the stack is a multiple of sixteen bytes: a return address and four registers lie on it
    let frame = if on_stack { (8 * steps.stack).max(middle).next_multiple_of(16) } else { 0 } + 8;
    a.enter(frame, on_stack);
    steps.steps.iter().for_each(|step| a.step(step));
    a.leave(frame);
    a.bytes
}

struct Assembler {
    bytes: Vec<u8>,
    avx: bool,
    /// Bytes from the end of the stack to the address in rbx.
    middle: usize,
    masks: Masks,
}

impl Assembler {
    fn put(&mut self, bytes: &[u8]) {
        self.bytes.extend_from_slice(bytes);
    }

    fn enter(&mut self, frame: usize, on_stack: bool) {
        // push rbx, rbp, r14, r15
        self.put(&[0x53, 0x55, 0x41, 0x56, 0x41, 0x57]);
        for page in 1..=frame / PAGE {
            // mov [rsp - distance], eax
            self.put(&[0x89, 0x84, 0x24]);
            self.put(&(-((page * PAGE) as i32)).to_le_bytes());
        }
        // sub rsp, frame; lea rbx, [rsp + middle] or [rcx + middle]
        self.put(&[0x48, 0x81, 0xec]);
        self.put(&(frame as i32).to_le_bytes());
        self.put(if on_stack { &[0x48, 0x8d, 0x9c, 0x24] } else { &[0x48, 0x8d, 0x99] });
        self.put(&(self.middle as i32).to_le_bytes());
        // mov r14, rdi; mov rbp, rsi; mov r15, rdx
        self.put(&[0x49, 0x89, 0xfe, 0x48, 0x89, 0xf5, 0x49, 0x89, 0xd7]);
    }

    fn leave(&mut self, frame: usize) {
        // add rsp, frame; pop r15, r14, rbp, rbx; ret
        self.put(&[0x48, 0x81, 0xc4]);
        self.put(&(frame as i32).to_le_bytes());
        self.put(&[0x41, 0x5f, 0x41, 0x5e, 0x5d, 0x5b, 0xc3]);
    }

    fn step(&mut self, step: &Step) {
        match step {
            Step::Load(to, from) => self.load(*to, *from),
            Step::Store(to, from) => {
                let to = self.memory(*to);
                self.write(STORE, *from, 0, to);
            }
            Step::Compute { code, to, operands } => self.compute(*code, *to, *operands),
            Step::Call(code) => self.call(functions::of(*code)),
            Step::Loop { count, pointers, turn } => self.turns(*count, pointers, turn),
            &Step::Sines { count, to } => {
                // mov edi, count; lea rsi, [rbx + angles]; lea rdx, [rbx + sines]
                self.put(&[0xbf]);
                self.put(&(count as u32).to_le_bytes());
                self.put(&[0x48, 0x8d, 0xb3]);
                self.put(&self.beyond_middle(0).to_le_bytes());
                self.put(&[0x48, 0x8d, 0x93]);
                self.put(&self.beyond_middle(to).to_le_bytes());
                self.call(functions::sines as *const ());
            }
        }
    }

    fn turns(&mut self, count: usize, pointers: &[Pointer], turn: &[Step]) {
        for (&register, pointer) in MOVING.iter().zip(pointers) {
            // lea register, [base + distance]
            let Last::Memory(base, distance) = self.memory(pointer.first) else { unreachable!("an address") };
            let [high, high_base] = [register > 7, base > 7].map(u8::from);
            self.put(&[0x48 | high << 2 | high_base, 0x8d, 0x80 | (register & 7) << 3 | base & 7]);
            self.put(&distance.to_le_bytes());
        }
        // mov eax, count
        self.put(&[0xb8]);
        self.put(&(count as u32).to_le_bytes());
        let first = self.bytes.len();
        turn.iter().for_each(|step| self.step(step));
        for (&register, pointer) in MOVING.iter().zip(pointers) {
            // add register, bytes
            self.put(&[0x48 | u8::from(register > 7), 0x81, 0xc0 | register & 7]);
            self.put(&(8 * pointer.step as i32).to_le_bytes());
        }
        // dec eax; jnz first
        self.put(&[0xff, 0xc8, 0x0f, 0x85]);
        let back = self.bytes.len() + 4 - first;
        self.put(&(-(back as i32)).to_le_bytes());
    }

    /// mov rax, function; call rax
    fn call(&mut self, function: *const ()) {
        self.put(&[0x48, 0xb8]);
        self.put(&(function as usize as u64).to_le_bytes());
        self.put(&[0xff, 0xd0]);
    }

    fn beyond_middle(&self, number: usize) -> i32 {
        8 * number as i32 - self.middle as i32
    }

    fn memory(&self, place: Address) -> Last {
        match place {
            Address::Input(k) => Last::Memory(R14, 8 * k as i32),
            Address::Constant(k) => Last::Memory(RBP, 8 * k as i32),
            Address::Output(k) => Last::Memory(R15, 8 * k as i32),
            Address::Stack(k) => Last::Memory(RBX, self.beyond_middle(k)),
            Address::Moving(pointer, distance) => Last::Memory(MOVING[pointer], 8 * distance as i32),
        }
    }

    fn load(&mut self, to: Register, from: Address) {
        let from = self.memory(from);
        self.write(LOAD, to, 0, from);
    }

    fn compute(&mut self, code: Code, to: Register, operands: [Operand; 3]) {
        let last = operands.map(|x| match x {
            Operand::Register(r) => Last::Register(r),
            Operand::Memory(place) => self.memory(place),
        });
        let register = |i: usize| match operands[i] {
            Operand::Register(r) => r,
            // `may_lie_in_memory` names the others
            Operand::Memory(_) => unreachable!("an operand in memory that the instruction does not read there"),
        };
        match code {
            Code::Add => self.two(ADD, to, register(0), last[1]),
            Code::Sub => self.two(SUBTRACT, to, register(0), last[1]),
            Code::Mul => self.two(MULTIPLY, to, register(0), last[1]),
            Code::Div => self.two(DIVIDE, to, register(0), last[1]),
            Code::Sqrt => {
                let x = register(0);
                self.write(ROOT, to, x, Last::Register(x));
            }
            Code::Neg => {
                self.load(FIRST, self.masks.sign);
                self.two(XOR, to, register(0), Last::Register(FIRST));
            }
            Code::Abs => {
                self.load(FIRST, self.masks.others);
                self.two(AND, to, register(0), Last::Register(FIRST));
            }
            Code::ProductPlus => {
                self.two(MULTIPLY, SECOND, register(0), last[1]);
                self.two(ADD, to, SECOND, last[2]);
            }
            Code::ProductMinus => {
                self.two(MULTIPLY, SECOND, register(0), last[1]);
                self.two(SUBTRACT, to, SECOND, last[2]);
            }
            Code::MinusProduct => {
                self.two(MULTIPLY, SECOND, register(0), last[1]);
                self.two(SUBTRACT, to, register(2), Last::Register(SECOND));
            }
            Code::OverOrZero => {
                self.two(DIVIDE, FIRST, register(0), last[1]);
                self.two(XOR, SECOND, SECOND, Last::Register(SECOND));
                self.compare(EQUAL, SECOND, register(1));
                self.two(AND_NOT, to, SECOND, Last::Register(FIRST));
            }
            // the instructions give y where either is NaN
            Code::Max | Code::Min => {
                let (x, y) = (register(0), register(1));
                self.two(if code == Code::Max { LARGER } else { SMALLER }, FIRST, x, Last::Register(y));
                self.copy(SECOND, y);
                self.compare(UNORDERED, SECOND, y);
                self.select(to, x, FIRST);
            }
            Code::WherePositive => {
                self.two(XOR, SECOND, SECOND, Last::Register(SECOND));
                self.compare(LESS, SECOND, register(0));
                self.copy(FIRST, register(2));
                self.select(to, register(1), FIRST);
            }
            Code::Reached => {
                self.copy(SECOND, register(0));
                self.compare(LESS, SECOND, register(1));
                self.load(FIRST, self.masks.sign);
                self.two(AND, SECOND, SECOND, Last::Register(FIRST));
                self.load(FIRST, self.masks.one);
                self.two(OR, to, FIRST, Last::Register(SECOND));
            }
            Code::Power | Code::SinCos | Code::Atan2 | Code::Hypot | Code::Round => unreachable!("a call"),
        }
    }

    /// The second register for whether it and another number meet a condition.
    fn compare(&mut self, condition: u8, x: Register, y: Register) {
        self.two(COMPARE, x, x, Last::Register(y));
        self.put(&[condition]);
    }

    /// x where the second register says so, else what is in the first register.
    fn select(&mut self, to: Register, x: Register, first: Register) {
        self.two(AND_NOT, first, SECOND, Last::Register(first));
        self.two(AND, SECOND, SECOND, Last::Register(x));
        self.two(OR, to, SECOND, Last::Register(first));
    }

    fn copy(&mut self, to: Register, from: Register) {
        if to != from {
            self.write(COPY, to, 0, Last::Register(from));
        }
    }

    /// An instruction on x and y. Those of SSE2 overwrite x.
    fn two(&mut self, instruction: Instruction, to: Register, x: Register, y: Last) {
        if self.avx || to == x {
            // a shorter instruction, where the two may change places
            return match y {
                Last::Register(y) if self.avx && y > 7 && x < 8 && commutes(instruction) => {
                    self.write(instruction, to, y, Last::Register(x));
                }
                y => self.write(instruction, to, x, y),
            };
        }
        let by = if y == Last::Register(to) { THIRD } else { to };
        self.copy(by, x);
        self.write(instruction, by, by, y);
        self.copy(to, by);
    }

    /// The bytes of an instruction. `x` is read by the three-operand form of AVX alone, and 0 where there is none.
    fn write(&mut self, Instruction(prefix, opcode): Instruction, to: Register, x: Register, y: Last) {
        let base = match y {
            Last::Register(r) => r,
            Last::Memory(r, _) => r,
        };
        let [high_to, high_base] = [to > 7, base > 7].map(u8::from);
        if self.avx {
            let prefix = if prefix == 0x66 { 1 } else { 3 };
            let x_and_prefix = (!x & 15) << 3 | prefix;
            if high_base == 0 {
                self.put(&[0xc5, (1 - high_to) << 7 | x_and_prefix]);
            } else {
                self.put(&[0xc4, (1 - high_to) << 7 | 1 << 6 | (1 - high_base) << 5 | 1, x_and_prefix]);
            }
            self.put(&[opcode]);
        } else {
            self.put(&[prefix]);
            if high_to + high_base > 0 {
                self.put(&[0x40 | high_to << 2 | high_base]);
            }
            self.put(&[0x0f, opcode]);
        }
        let (to, base) = ((to & 7) << 3, base & 7);
        match y {
            Last::Register(_) => self.put(&[0xc0 | to | base]),
            Last::Memory(_, distance) => match i8::try_from(distance) {
                Ok(distance) => self.put(&[0x40 | to | base, distance as u8]),
                Err(_) => {
                    self.put(&[0x80 | to | base]);
                    self.put(&distance.to_le_bytes());
                }
            },
        }
    }
}

/// Whether an instruction gives the same with its operands in the other order.
fn commutes(instruction: Instruction) -> bool {
    let Instruction(_, opcode) = instruction;
    [ADD, MULTIPLY, AND, OR, XOR].iter().any(|x| x.1 == opcode)
}
