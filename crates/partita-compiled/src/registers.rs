//! Which values lie in which registers, and when they move: steps that one instruction or a few of any processor carry out.
//!
//! All code of a program is one run without branches but loops, which are entered and left with empty registers, so that it
//! is known when each value is needed next. Where a register is wanted and none is free, the value that is needed last
//! leaves, to the stack if it lies nowhere else. What is needed later than all that lies in registers is read where it is,
//! by the instruction that needs it if the processor can.

use crate::values::{Item, Keep, Operation, Read, Roll, Source, Values, POINTERS};
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

const NONE: usize = usize::MAX;

/// Steps at which each value is needed, ascending, one list after another; those passed are skipped.
struct Needs {
    steps: Vec<usize>,
    next: Vec<usize>,
    end: Vec<usize>,
}

impl Needs {
    fn new(values: &Values) -> Self {
        let count = values.sources.len();
        let mut end = vec![0; count + 1];
        each_need(values, |x, _| end[x + 1] += 1);
        for x in 0..count {
            end[x + 1] += end[x];
        }
        let mut next = end[..count].to_vec();
        let mut steps = vec![0; end[count]];
        each_need(values, |x, step| {
            steps[next[x]] = step;
            next[x] += 1;
        });
        let next = end[..count].to_vec();
        end.remove(0);
        Self { steps, next, end }
    }

    /// When a value is needed next; later than ever if it is not.
    fn next(&self, x: usize) -> usize {
        if self.next[x] < self.end[x] {
            self.steps[self.next[x]]
        } else {
            NONE
        }
    }

    /// When it is needed after a step at which it is.
    fn after(&self, x: usize, step: usize) -> usize {
        self.steps[self.next[x]..self.end[x]].iter().copied().find(|&at| at > step).unwrap_or(NONE)
    }

    /// A step is done.
    fn pass(&mut self, x: usize, step: usize) {
        while self.next(x) <= step {
            self.next[x] += 1;
        }
    }
}

/// Every value with every step that needs it, in order: an operation is a step, and so are a loop and a call for sines.
fn each_need(values: &Values, mut need: impl FnMut(usize, usize)) {
    let mut step = 0;
    for (operations, angles) in values.operations.iter().zip(&values.angles) {
        for item in operations {
            match item {
                Item::Operation(operation) => operation.reads().iter().for_each(|&x| need(x, step)),
                Item::Roll(roll) => roll.needs().for_each(|x| need(x, step)),
            }
            step += 1;
        }
        angles.iter().for_each(|&x| need(x, step));
        step += 1;
    }
}

/// The steps of a program on a processor with these registers.
pub(crate) fn steps(values: &Values, processor: Registers) -> Steps {
    let most = values.angles.iter().map(Vec::len).max().unwrap_or(0);
    let sines = most + 2 * values.angles.iter().map(Vec::len).sum::<usize>();
    let fixed = sines + values.arrays;
    let count = values.sources.len();
    let mut allocation = Allocation {
        values,
        processor,
        needs: Needs::new(values),
        held: vec![NONE; processor.held],
        register: vec![Register::MAX; count],
        stack: vec![NONE; count],
        free: Vec::new(),
        next: fixed,
        over: Vec::new(),
        first_sine: most,
        first_array: sines,
        steps: Vec::new(),
    };
    allocation.write();
    Steps { steps: allocation.steps, stack: allocation.next, fixed }
}

struct Allocation<'v> {
    values: &'v Values,
    processor: Registers,
    needs: Needs,
    /// The value in each register, and the register of each value.
    held: Vec<usize>,
    register: Vec<Register>,
    /// Where each value lies on the stack, which of that is free again, and the first that was never used.
    stack: Vec<usize>,
    free: Vec<usize>,
    next: usize,
    /// What is free after this step.
    over: Vec<usize>,
    first_sine: usize,
    first_array: usize,
    steps: Vec<Step>,
}

/// Copies from which on a loop is made.
const FEWEST_COPIES: usize = 8;

impl Allocation<'_> {
    fn write(&mut self) {
        let values = self.values;
        let mut outputs: Vec<Vec<usize>> = vec![Vec::new(); values.sources.len()];
        let asked = || values.outputs.iter().enumerate().filter_map(|(o, &x)| Some((o, x?)));
        asked().for_each(|(o, x)| outputs[x].push(o));
        let (mut done, mut step) = (0, 0);
        for (operations, angles) in values.operations.iter().zip(&values.angles) {
            for item in operations {
                match item {
                    Item::Operation(operation) => self.operation(operation, step, &outputs[operation.to]),
                    Item::Roll(roll) => self.roll(roll, step),
                }
                step += 1;
            }
            if !angles.is_empty() {
                self.sines(angles, done, step);
                done += angles.len();
            }
            step += 1;
        }
        // results were written as soon as they were known, but those of loops
        let known = asked().filter(|x| !matches!(values.sources[x.1], Source::Operation));
        let copies: Vec<_> = known.map(|(o, x)| (self.place(x), Address::Output(o))).collect();
        self.copy(&copies);
    }

    fn operation(&mut self, operation: &Operation, step: usize, outputs: &[usize]) {
        if self.needs.next(operation.to) == NONE && outputs.is_empty() {
            self.pass(operation.reads(), step);
            return self.free.append(&mut self.over);
        }
        let to = match operation.code {
            _ if operation.is_call() => {
                self.clear();
                for (i, &x) in operation.reads().iter().enumerate() {
                    self.steps.push(Step::Load(i as Register, self.place(x)));
                }
                if operation.code == Code::Power {
                    self.steps.push(Step::Load(1, Address::Constant(self.values.constants + operation.exponent)));
                }
                self.pass(operation.reads(), step);
                self.steps.push(Step::Call(operation.code));
                self.hold(operation.to, 0);
                0
            }
            code => {
                let operands = self.operands(operation, step);
                self.pass(operation.reads(), step);
                let to = self.result(operation.to);
                self.steps.push(Step::Compute { code, to, operands });
                to
            }
        };
        self.store(to, outputs);
        if to == self.processor.passing && self.needs.next(operation.to) != NONE {
            let place = self.new_place(operation.to);
            self.steps.push(Step::Store(place, to));
        }
        self.free.append(&mut self.over);
    }

    fn store(&mut self, from: Register, outputs: &[usize]) {
        self.steps.extend(outputs.iter().map(|&o| Step::Store(Address::Output(o), from)));
    }

    /// Where an operation reads its operands, which are loaded first if they have to be.
    fn operands(&mut self, operation: &Operation, step: usize) -> [Operand; 3] {
        let reads = operation.reads();
        let mut order = operation.operands;
        let is_held = |x: usize| self.register[x] != Register::MAX;
        // what lies in memory is the second one, where the two may change places
        if first_two_commute(operation.code) && !is_held(order[0]) && is_held(order[1]) {
            order.swap(0, 1);
        }
        let mut found = [Operand::Register(0); 3];
        for i in 0..reads.len() {
            let x = order[i];
            found[i] = match self.register[x] {
                Register::MAX if may_lie_in_memory(operation.code, i) && !self.is_worth_holding(x, step, reads) => {
                    Operand::Memory(self.place(x))
                }
                Register::MAX => Operand::Register(self.load(x, reads)),
                register => Operand::Register(register),
            };
        }
        found
    }

    /// Whether a value in memory is worth a register, from a step on at which it is needed beside others.
    fn is_worth_holding(&self, x: usize, step: usize, besides: &[usize]) -> bool {
        if !self.processor.reads_memory {
            return true;
        }
        let after = self.needs.after(x, step);
        after != NONE && (self.held.contains(&NONE) || self.last(besides).is_some_and(|(_, at)| at > after))
    }

    /// The register of the value that is needed last, and when that is; `besides` are needed now.
    fn last(&self, besides: &[usize]) -> Option<(usize, usize)> {
        let others = self.held.iter().enumerate().filter(|(_, x)| !besides.contains(x));
        others.map(|(register, &x)| (register, self.needs.next(x))).max_by_key(|(_, at)| *at)
    }

    /// A value from memory into a register.
    fn load(&mut self, x: usize, besides: &[usize]) -> Register {
        let free = self.held.iter().position(|&x| x == NONE);
        let register = free.or_else(|| self.last(besides).map(|(register, _)| register));
        // three operands at most are needed beside it: processors have more registers than that
        let register = register.expect("a register for an operand");
        self.release(register);
        self.steps.push(Step::Load(register as Register, self.place(x)));
        self.hold(x, register);
        register as Register
    }

    /// A register for a result: that in which it will be held, or the passing one.
    fn result(&mut self, x: usize) -> Register {
        let next = self.needs.next(x);
        let free = || self.held.iter().position(|&x| x == NONE);
        let later = || self.last(&[]).filter(|(_, at)| *at > next).map(|(register, _)| register);
        match if next == NONE { None } else { free().or_else(later) } {
            Some(register) => {
                self.release(register);
                self.hold(x, register);
                register as Register
            }
            None => self.processor.passing,
        }
    }

    fn hold(&mut self, x: usize, register: usize) {
        if self.needs.next(x) != NONE {
            (self.held[register], self.register[x]) = (x, register as Register);
        }
    }

    /// What lies in a register leaves it, to the stack if it is needed again and lies nowhere else.
    fn release(&mut self, register: usize) {
        let x = std::mem::replace(&mut self.held[register], NONE);
        if x == NONE {
            return;
        }
        self.register[x] = Register::MAX;
        let is_computed = matches!(self.values.sources[x], Source::Operation);
        if is_computed && self.stack[x] == NONE && self.needs.next(x) != NONE {
            let place = self.new_place(x);
            self.steps.push(Step::Store(place, register as Register));
        }
    }

    /// Nothing stays in a register over a call.
    fn clear(&mut self) {
        (0..self.held.len()).for_each(|register| self.release(register));
    }

    /// A step that needed these is done: what is needed no more leaves its register and its place.
    fn pass(&mut self, needed: &[usize], step: usize) {
        for &x in needed {
            self.needs.pass(x, step);
            if self.needs.next(x) != NONE {
                continue;
            }
            if self.register[x] != Register::MAX {
                self.held[self.register[x] as usize] = NONE;
                self.register[x] = Register::MAX;
            }
            if self.stack[x] != NONE {
                self.over.push(std::mem::replace(&mut self.stack[x], NONE));
            }
        }
    }

    fn new_place(&mut self, x: usize) -> Address {
        self.stack[x] = self.new_number();
        Address::Stack(self.stack[x])
    }

    fn new_number(&mut self) -> usize {
        self.free.pop().unwrap_or_else(|| {
            self.next += 1;
            self.next - 1
        })
    }

    /// Where a value lies in memory.
    fn place(&self, x: usize) -> Address {
        self.place_of(self.values.sources[x], x)
    }

    fn place_of(&self, source: Source, x: usize) -> Address {
        match source {
            Source::Input(k) => Address::Input(k),
            Source::Constant(k) => Address::Constant(k),
            Source::Sine(k) => Address::Stack(self.first_sine + k),
            Source::Array(k) => Address::Stack(self.first_array + k),
            Source::Operation => Address::Stack(self.stack[x]),
        }
    }

    /// The sines of a stage; `done` were computed before.
    fn sines(&mut self, angles: &[usize], done: usize, step: usize) {
        let mut copies = Vec::new();
        for (i, &x) in angles.iter().enumerate() {
            match self.register[x] {
                Register::MAX => copies.push((self.place(x), Address::Stack(i))),
                register => self.steps.push(Step::Store(Address::Stack(i), register)),
            }
        }
        self.copy(&copies);
        self.pass(angles, step);
        self.free.append(&mut self.over);
        self.clear();
        self.steps.push(Step::Sines { count: angles.len(), to: self.first_sine + 2 * done });
    }
}

impl Allocation<'_> {
    /// From place to place; loops where both move by a step.
    fn copy(&mut self, mut copies: &[(Address, Address)]) {
        let passing = self.processor.passing;
        while let Some(&(from, to)) = copies.first() {
            let step = |i: usize| {
                let &(a, b) = copies.get(i)?;
                Some((from.distance(a)?, to.distance(b)?))
            };
            let by = step(1);
            let follows = |i: &usize| by.is_some_and(|(a, b)| step(*i) == Some((a * *i as isize, b * *i as isize)));
            let count = if self.processor.loops { 1 + (1..copies.len()).take_while(follows).count() } else { 1 };
            let (now, later) = copies.split_at(if count < FEWEST_COPIES { 1 } else { count });
            copies = later;
            match by {
                Some((a, b)) if now.len() > 1 => {
                    let pointers = vec![Pointer { first: from, step: a }, Pointer { first: to, step: b }];
                    let turn =
                        vec![Step::Load(passing, Address::Moving(0, 0)), Step::Store(Address::Moving(1, 0), passing)];
                    self.steps.push(Step::Loop { count, pointers, turn });
                }
                _ => self.steps.extend([Step::Load(passing, from), Step::Store(to, passing)]),
            }
        }
    }

    /// A loop, for which nothing stays in a register.
    fn roll(&mut self, roll: &Roll, step: usize) {
        self.clear();
        let entry = |&(to, x): &(usize, usize)| (self.place(x), Address::Stack(self.first_array + to));
        let entries: Vec<_> = roll.entries.iter().map(entry).collect();
        self.copy(&entries);
        let inner = steps(&roll.body, self.processor);
        let spilled: Vec<usize> = (0..inner.stack).map(|_| self.new_number()).collect();
        let mut pointers: Vec<Pointer> = Vec::with_capacity(POINTERS);
        let mut moving = |first: Address, step: isize| {
            let near = |x: &Pointer| if x.step == step { x.first.distance(first) } else { None };
            if let Some(found) = pointers.iter().enumerate().find_map(|(i, x)| Some((i, near(x)?))) {
                return Address::Moving(found.0, found.1);
            }
            pointers.push(Pointer { first, step });
            Address::Moving(pointers.len() - 1, 0)
        };
        let reads: Vec<Address> = roll
            .reads
            .iter()
            .map(|read| match *read {
                Read::Same(x) => self.place(x),
                Read::Moving { first, step } => moving(self.place_of(first, NONE), step),
            })
            .collect();
        let keep = |keep: &Keep| match *keep {
            Keep::Array(place) => moving(Address::Stack(self.first_array + place), 1),
            Keep::Output { first, step } => moving(Address::Output(first), step),
        };
        let keeps: Vec<Address> = roll.keeps.iter().map(keep).collect();
        let to = |place: Address| match place {
            Address::Input(k) => reads[k],
            Address::Output(k) => keeps[k],
            Address::Stack(k) => Address::Stack(spilled[k]),
            Address::Constant(_) | Address::Moving(..) => place,
        };
        let turn = inner.steps.into_iter().map(|step| step.at(to)).collect();
        self.steps.push(Step::Loop { count: roll.count, pointers, turn });
        let needed: Vec<usize> = roll.needs().collect();
        self.pass(&needed, step);
        self.over.extend(spilled);
        self.free.append(&mut self.over);
    }
}

impl Address {
    /// How far another one of the same memory is from it.
    fn distance(self, other: Self) -> Option<isize> {
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
    fn at(self, to: impl Fn(Address) -> Address) -> Self {
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

impl Roll {
    /// Values that are the same in every turn, and entries.
    fn needs(&self) -> impl Iterator<Item = usize> + '_ {
        let same = self.reads.iter().filter_map(|read| match read {
            Read::Same(x) => Some(*x),
            Read::Moving { .. } => None,
        });
        same.chain(self.entries.iter().map(|entry| entry.1))
    }
}

/// Whether the first two operands may change places.
fn first_two_commute(code: Code) -> bool {
    matches!(code, Code::Add | Code::Mul | Code::ProductPlus | Code::ProductMinus | Code::MinusProduct)
}

/// Whether an instruction of a processor that reads memory may read this operand there.
fn may_lie_in_memory(code: Code, operand: usize) -> bool {
    match code {
        Code::Add | Code::Sub | Code::Mul | Code::Div | Code::MinusProduct => operand == 1,
        Code::ProductPlus | Code::ProductMinus => operand > 0,
        _ => false,
    }
}
