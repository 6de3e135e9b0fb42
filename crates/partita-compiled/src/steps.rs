//! What code does, whatever the processor.

use partita_math::program::Code;

/// Bytes of a page of memory. The system makes a stack longer where the next page is touched, not one further away.
pub(crate) const PAGE: usize = 4096;

/// A register of a number.
pub(crate) type Register = u8;

/// Where a number lies in memory, counted in numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Address {
    Input(usize),
    Constant(usize),
    Output(usize),
    Stack(usize),
    /// Beyond the place of a pointer of the loop.
    Moving(usize, isize),
}

/// What moves in a loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Pointer {
    /// Where it is in the first turn, and how much further in each turn after.
    pub(crate) first: Address,
    pub(crate) step: isize,
}

/// What an instruction reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Operand {
    Register(Register),
    Memory(Address),
}

/// What the code does.
#[derive(Clone, Debug)]
pub(crate) enum Step {
    Load(Register, Address),
    Store(Address, Register),
    /// An operation that is no call, with as many operands as its code has.
    Compute {
        code: Code,
        to: Register,
        operands: [Operand; 3],
    },
    /// A function of numbers that lie in the first registers, to the first one.
    Call(Code),
    /// Sines and cosines of angles, which come first on the stack.
    Sines {
        count: usize,
        to: usize,
    },
    Loop {
        count: usize,
        pointers: Vec<Pointer>,
        turn: Vec<Step>,
    },
}

/// Registers of a processor.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Registers {
    /// Those that values may be held in: the first ones, which a function has its arguments and its result in.
    pub(crate) held: usize,
    /// One more, for a result that goes to memory at once.
    pub(crate) passing: Register,
    /// Whether an operand may lie in memory.
    pub(crate) reads_memory: bool,
    /// Whether copies in a row become loops.
    pub(crate) loops: bool,
}

/// The steps of a program, and the stack that they need.
#[derive(Debug)]
pub(crate) struct Steps {
    pub(crate) steps: Vec<Step>,
    /// Numbers on the stack.
    pub(crate) stack: usize,
    /// Of these, those of angles, sines and arrays, which come first.
    pub(crate) fixed: usize,
}

impl Steps {
    /// Number of steps, those of a loop counted once.
    pub(crate) fn len(&self) -> usize {
        let all = self.steps.iter().map(|step| match step {
            Step::Loop { turn, .. } => turn.len(),
            _ => 1,
        });
        all.sum()
    }
}

/// Pointers of a loop, while its turn is made.
#[derive(Default)]
pub(crate) struct Pointers(pub(crate) Vec<Pointer>);

impl Pointers {
    /// What is at a place in turn 0, and a step further in each turn after.
    pub(crate) fn place(&mut self, first: Address, step: isize) -> Address {
        let near = |x: &Pointer| if x.step == step { x.first.distance(first) } else { None };
        if let Some(found) = self.0.iter().enumerate().find_map(|(i, x)| Some((i, near(x)?))) {
            return Address::Moving(found.0, found.1);
        }
        self.0.push(Pointer { first, step });
        Address::Moving(self.0.len() - 1, 0)
    }
}

impl Address {
    /// How far another one of the same memory is from it.
    pub(crate) fn distance(self, other: Self) -> Option<isize> {
        use Address as A;
        match (self, other) {
            (A::Input(a), A::Input(b)) | (A::Constant(a), A::Constant(b)) => Some(b as isize - a as isize),
            (A::Output(a), A::Output(b)) | (A::Stack(a), A::Stack(b)) => Some(b as isize - a as isize),
            _ => None,
        }
    }
}

impl Step {
    /// With other addresses; for a turn, which has neither calls nor loops.
    pub(crate) fn at(self, to: impl Fn(Address) -> Address) -> Self {
        match self {
            Self::Load(register, place) => Self::Load(register, to(place)),
            Self::Store(place, register) => Self::Store(to(place), register),
            Self::Compute { code, to: result, operands } => {
                let operands = operands.map(|x| match x {
                    Operand::Memory(place) => Operand::Memory(to(place)),
                    Operand::Register(_) => x,
                });
                Self::Compute { code, to: result, operands }
            }
            Self::Call(_) | Self::Sines { .. } | Self::Loop { .. } => self,
        }
    }
}
