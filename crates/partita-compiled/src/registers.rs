//! Which values lie in which registers, and when they move: steps that one instruction or a few of any processor carry out.
//!
//! All code of a program is one run without branches but loops, which are entered and left with empty registers, so that it
//! is known when each value is needed next. Where a register is wanted and none is free, the value that is needed last
//! leaves, to the stack if it lies nowhere else. What is needed later than all that lies in registers is read where it is,
//! by the instruction that needs it if the processor can.

use crate::copies;
use crate::steps::{Address, Operand, Pointers, Register, Registers, Step, Steps};
use crate::values::{Item, Keep, Operation, Read, Roll, Source, Values};
use partita_math::program::Code;

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
                Item::Operation(operation) => operation.reads().iter().for_each(|&x| need(x as usize, step)),
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

impl Allocation<'_> {
    fn write(&mut self) {
        let values = self.values;
        let asked = || values.outputs.iter().enumerate().filter_map(|(o, &x)| Some((o, x?)));
        let mut outputs: Vec<(usize, usize)> = asked().map(|(o, x)| (x, o)).collect();
        outputs.sort_unstable();
        let of = |x: usize| {
            let first = outputs.partition_point(|own| own.0 < x);
            &outputs[first..first + outputs[first..].partition_point(|own| own.0 == x)]
        };
        let (mut done, mut step) = (0, 0);
        for (operations, angles) in values.operations.iter().zip(&values.angles) {
            for item in operations {
                match item {
                    Item::Operation(operation) => self.operation(operation, step, of(operation.to())),
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

    fn operation(&mut self, operation: &Operation, step: usize, outputs: &[(usize, usize)]) {
        let all = operation.operands.map(|x| x as usize);
        let reads = &all[..operation.reads().len()];
        if self.needs.next(operation.to()) == NONE && outputs.is_empty() {
            self.pass(reads, step);
            return self.free.append(&mut self.over);
        }
        let to = match operation.code {
            _ if operation.is_call() => {
                self.clear();
                for (i, &x) in reads.iter().enumerate() {
                    self.steps.push(Step::Load(i as Register, self.place(x)));
                }
                if operation.code == Code::Power {
                    self.steps
                        .push(Step::Load(1, Address::Constant(self.values.constants + operation.exponent as usize)));
                }
                self.pass(reads, step);
                self.steps.push(Step::Call(operation.code));
                self.hold(operation.to(), 0);
                0
            }
            code => {
                let operands = self.operands(operation.code, reads, step);
                self.pass(reads, step);
                let to = self.result(operation.to());
                self.steps.push(Step::Compute { code, to, operands });
                to
            }
        };
        self.store(to, outputs);
        if to == self.processor.passing && self.needs.next(operation.to()) != NONE {
            let place = self.new_place(operation.to());
            self.steps.push(Step::Store(place, to));
        }
        self.free.append(&mut self.over);
    }

    fn store(&mut self, from: Register, outputs: &[(usize, usize)]) {
        self.steps.extend(outputs.iter().map(|&(_, o)| Step::Store(Address::Output(o), from)));
    }

    /// Where an operation reads its operands, which are loaded first if they have to be.
    fn operands(&mut self, code: Code, reads: &[usize], step: usize) -> [Operand; 3] {
        let mut order = [0; 3];
        order[..reads.len()].copy_from_slice(reads);
        let is_held = |x: usize| self.register[x] != Register::MAX;
        // what lies in memory is the second one, where the two may change places
        if first_two_commute(code) && !is_held(order[0]) && is_held(order[1]) {
            order.swap(0, 1);
        }
        let mut found = [Operand::Register(0); 3];
        for i in 0..reads.len() {
            let x = order[i];
            found[i] = match self.register[x] {
                Register::MAX if may_lie_in_memory(code, i) && !self.is_worth_holding(x, step, reads) => {
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
    /// From place to place.
    fn copy(&mut self, copies: &[(Address, Address)]) {
        self.steps.extend(copies::steps(copies, self.processor));
    }

    /// A loop, for which nothing stays in a register.
    fn roll(&mut self, roll: &Roll, step: usize) {
        self.clear();
        let entry = |&(to, x): &(usize, usize)| (self.place(x), Address::Stack(self.first_array + to));
        let entries: Vec<_> = roll.entries.iter().map(entry).collect();
        self.copy(&entries);
        let inner = steps(&roll.body, self.processor);
        let spilled: Vec<usize> = (0..inner.stack).map(|_| self.new_number()).collect();
        let mut pointers = Pointers::default();
        let reads: Vec<Address> = roll
            .reads
            .iter()
            .map(|read| match *read {
                Read::Same(x) => self.place(x),
                Read::Moving { first, step: 0 } => self.place_of(first, NONE),
                Read::Moving { first, step } => pointers.place(self.place_of(first, NONE), step),
            })
            .collect();
        let mut keep = |keep: &Keep| match *keep {
            Keep::Array { first, step: 0 } => Address::Stack(self.first_array + first),
            Keep::Array { first, step } => pointers.place(Address::Stack(self.first_array + first), step as isize),
            Keep::Output { first, step } => pointers.place(Address::Output(first), step),
        };
        let keeps: Vec<Address> = roll.keeps.iter().map(&mut keep).collect();
        let to = |place: Address| match place {
            Address::Input(k) => reads[k],
            Address::Output(k) => keeps[k],
            Address::Stack(k) => Address::Stack(spilled[k]),
            Address::Constant(_) | Address::Moving(..) => place,
        };
        let turn = inner.steps.into_iter().map(|step| step.at(to)).collect();
        self.steps.push(Step::Loop { count: roll.count, pointers: pointers.0, turn });
        let needed: Vec<usize> = roll.needs().collect();
        self.pass(&needed, step);
        self.over.extend(spilled);
        self.free.append(&mut self.over);
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
pub(crate) fn first_two_commute(code: Code) -> bool {
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
