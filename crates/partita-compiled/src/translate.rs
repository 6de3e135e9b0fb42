//! From the instructions of a program to those of Cranelift: one block without branches.
//!
//! A call leaves nothing in the vector registers. Angles are therefore collected: operations are ordered by the number of
//! sines that they come after, and the sines between two of these stages are computed by one call.

use crate::functions;
use cranelift_codegen::cursor::{Cursor, FuncCursor};
use cranelift_codegen::ir::condcodes::FloatCC;
use cranelift_codegen::ir::types::F64;
use cranelift_codegen::ir::{
    AbiParam, Function, InstBuilder, MemFlags, SigRef, Signature, StackSlotData, StackSlotKind, Type, Value,
};
use cranelift_codegen::isa::TargetIsa;
use partita_math::program::{Code, Program};

/// Bytes of a number.
const SIZE: i32 = 8;

/// Where a value comes from.
#[derive(Clone, Copy)]
enum Source {
    Input(usize),
    Constant(usize),
    /// Computed by an operation of the list.
    Operation,
    /// Place of a sine, or cosine, among the results of all calls.
    Sine(usize),
}

/// An operation on values instead of registers.
struct Operation {
    code: Code,
    operands: [usize; 3],
    exponent: f64,
    to: usize,
}

/// Values in the order in which they are known, each with its stage: the number of calls before it.
struct Values {
    sources: Vec<Source>,
    stages: Vec<usize>,
    /// Operations of each stage, then the angles of its call.
    operations: Vec<Vec<Operation>>,
    angles: Vec<Vec<usize>>,
    /// Value of each output.
    outputs: Vec<usize>,
}

impl Values {
    fn new(program: &Program) -> Self {
        let mut all = Self {
            sources: (0..program.inputs()).map(Source::Input).collect(),
            stages: Vec::new(),
            operations: Vec::new(),
            angles: Vec::new(),
            outputs: Vec::new(),
        };
        all.sources.extend((0..program.constants().len()).map(Source::Constant));
        all.stages.resize(all.sources.len(), 0);
        // the value in each register
        let mut held: Vec<usize> = (0..program.registers()).collect();
        // stage of the call, and the sine, which its cosine follows
        let mut sines: Vec<(usize, usize)> = Vec::new();
        for i in program.instructions() {
            let operands = [i.x, i.y, i.z].map(|r| held.get(r as usize).copied().unwrap_or(0));
            if i.code == Code::SinCos {
                let stage = all.stages[operands[0]];
                let pair = [all.value(Source::Sine(0), stage + 1), all.value(Source::Sine(0), stage + 1)];
                sines.push((stage, pair[0]));
                all.at_stage(stage);
                all.angles[stage].push(operands[0]);
                (held[i.to as usize], held[i.also as usize]) = (pair[0], pair[1]);
                continue;
            }
            let used = &operands[..arity(i.code)];
            let stage = used.iter().map(|&x| all.stages[x]).max().unwrap_or(0);
            let to = all.value(Source::Operation, stage);
            let exponent = match i.code {
                Code::Power => program.exponents()[i.also as usize],
                _ => 0.0,
            };
            all.at_stage(stage);
            all.operations[stage].push(Operation { code: i.code, operands, exponent, to });
            held[i.to as usize] = to;
        }
        // results lie stage by stage
        let mut next = vec![0; all.angles.len()];
        for stage in 1..next.len() {
            next[stage] = next[stage - 1] + all.angles[stage - 1].len();
        }
        for (stage, sine) in sines {
            all.sources[sine] = Source::Sine(2 * next[stage]);
            all.sources[sine + 1] = Source::Sine(2 * next[stage] + 1);
            next[stage] += 1;
        }
        all.outputs = program.output_registers().iter().map(|&r| held[r as usize]).collect();
        all
    }

    fn value(&mut self, source: Source, stage: usize) -> usize {
        self.sources.push(source);
        self.stages.push(stage);
        self.sources.len() - 1
    }

    fn at_stage(&mut self, stage: usize) {
        while self.operations.len() <= stage {
            self.operations.push(Vec::new());
            self.angles.push(Vec::new());
        }
    }
}

/// Operands of an operation.
fn arity(code: Code) -> usize {
    match code {
        Code::Neg | Code::Sqrt | Code::Power | Code::SinCos | Code::Abs | Code::Round => 1,
        Code::Add | Code::Sub | Code::Mul | Code::Div | Code::OverOrZero => 2,
        Code::Atan2 | Code::Hypot | Code::Max | Code::Min | Code::Reached => 2,
        Code::WherePositive | Code::ProductPlus | Code::ProductMinus | Code::MinusProduct => 3,
    }
}

/// Values that the code holds in registers at a time. Scale: registers. Reason: of the sixteen of x86-64 some are left for
/// the operands and the result of one operation.
const HELD: usize = 12;

/// A value in a register.
struct Held {
    value: usize,
    register: Value,
}

/// Addresses that a function is called with.
struct Lists {
    inputs: Value,
    constants: Value,
    outputs: Value,
}

/// Writes instructions at the end of the one block, and decides which values stay in registers: where there is none left, the
/// one that is needed last goes to the stack. Cranelift's allocator then finds registers for all at once; by itself it would
/// take a time that grows with the square of their number.
struct Writer<'f> {
    at: FuncCursor<'f>,
    values: &'f Values,
    /// Steps at which each value is needed, the last one first; those passed are removed.
    needed: Vec<Vec<usize>>,
    held: Vec<Held>,
    /// Those loaded for this step.
    loaded: Vec<Held>,
    /// Place of each value on the stack, and those that are free again.
    offsets: Vec<Option<i32>>,
    free: Vec<i32>,
    next_offset: i32,
    /// Addresses of the three lists.
    lists: Lists,
    /// Address within the stack: values that have left the registers lie above it, angles of a call and the results of
    /// all calls below.
    stack: Value,
    /// Bytes from that address to the first angle, and to the first sine.
    angles: i32,
    sines: i32,
    /// Signatures of one number, of two, and of the list of sines.
    signatures: [SigRef; 3],
    pointer: Type,
}

/// The function of a program: `(inputs, constants, outputs)`, pointers to numbers.
pub(crate) fn translate(program: &Program, isa: &dyn TargetIsa, function: &mut Function) {
    let (pointer, convention) = (isa.pointer_type(), isa.default_call_conv());
    let signature = |parameters: &[Type], result: Option<Type>| {
        let mut signature = Signature::new(convention);
        signature.params.extend(parameters.iter().map(|x| AbiParam::new(*x)));
        signature.returns.extend(result.map(AbiParam::new));
        signature
    };
    function.signature = signature(&[pointer; 3], None);
    let signatures = [
        function.import_signature(signature(&[F64], Some(F64))),
        function.import_signature(signature(&[F64, F64], Some(F64))),
        function.import_signature(signature(&[pointer; 3], None)),
    ];
    let values = Values::new(program);
    let most = values.angles.iter().map(Vec::len).max().unwrap_or(0) as i32;
    let all = values.angles.iter().map(Vec::len).sum::<usize>() as i32;
    let below = (most + 2 * all) * SIZE;
    let slot = function.create_sized_stack_slot(StackSlotData::new(StackSlotKind::ExplicitSlot, 0, 4));
    let block = function.dfg.make_block();
    function.layout.append_block(block);
    let [inputs, constants, outputs] = [0; 3].map(|_| function.dfg.append_block_param(block, pointer));
    let mut at = FuncCursor::new(function).at_bottom(block);
    let stack = at.ins().stack_addr(pointer, slot, below);
    let writer = Writer {
        at,
        values: &values,
        needed: values.needed(),
        held: Vec::with_capacity(HELD + 4),
        loaded: Vec::with_capacity(4),
        offsets: vec![None; values.sources.len()],
        free: Vec::new(),
        next_offset: 0,
        lists: Lists { inputs, constants, outputs },
        stack,
        angles: -below,
        sines: -2 * all * SIZE,
        signatures,
        pointer,
    };
    let above = writer.write();
    function.sized_stack_slots[slot].size = (below + above).max(SIZE) as u32;
}

impl Values {
    /// Steps at which each value is needed, the last one first: an operation is a step, and so is a call.
    fn needed(&self) -> Vec<Vec<usize>> {
        let mut needed = vec![Vec::new(); self.sources.len()];
        let mut step = 0;
        for (operations, angles) in self.operations.iter().zip(&self.angles) {
            for operation in operations {
                operation.operands[..arity(operation.code)].iter().for_each(|&x| needed[x].push(step));
                step += 1;
            }
            angles.iter().for_each(|&x| needed[x].push(step));
            step += 1;
        }
        needed.iter_mut().for_each(|steps| steps.reverse());
        needed
    }
}

impl Writer<'_> {
    /// Write all of it; the bytes of values that left the registers.
    fn write(mut self) -> i32 {
        let values = self.values;
        let mut offsets: Vec<Vec<i32>> = vec![Vec::new(); values.sources.len()];
        for (o, &x) in values.outputs.iter().enumerate() {
            offsets[x].push(o as i32 * SIZE);
        }
        let (mut done, mut step) = (0, 0);
        for (operations, angles) in values.operations.iter().zip(&values.angles) {
            for operation in operations {
                let found = self.result(operation);
                // an output is written as soon as it is known
                for &place in &offsets[operation.to] {
                    self.at.ins().store(MemFlags::trusted(), found, self.lists.outputs, place);
                }
                self.keep(Held { value: operation.to, register: found }, step);
                step += 1;
            }
            if !angles.is_empty() {
                self.call_sines(angles, done);
                done += angles.len();
            }
            self.pass(step);
            step += 1;
        }
        for (x, offsets) in offsets.iter().enumerate() {
            if matches!(values.sources[x], Source::Operation) {
                continue;
            }
            for &place in offsets {
                let value = self.value(x);
                self.at.ins().store(MemFlags::trusted(), value, self.lists.outputs, place);
            }
        }
        self.at.ins().return_(&[]);
        self.next_offset
    }

    /// The sines of a stage; `done` were computed before.
    fn call_sines(&mut self, angles: &[usize], done: usize) {
        for (i, &x) in angles.iter().enumerate() {
            let angle = self.value(x);
            self.put(angle, self.angles + i as i32 * SIZE);
        }
        let count = self.at.ins().iconst(self.pointer, angles.len() as i64);
        let from = self.address(self.angles);
        let to = self.address(self.sines + 2 * done as i32 * SIZE);
        self.call(functions::sines as *const (), 2, &[count, from, to]);
    }

    /// Nothing stays in a register over a call.
    fn call(&mut self, function: *const (), signature: usize, arguments: &[Value]) -> Option<Value> {
        self.loaded.clear();
        while !self.held.is_empty() {
            self.release(self.held.len() - 1);
        }
        let address = self.at.ins().iconst(self.pointer, function as usize as i64);
        let call = self.at.ins().call_indirect(self.signatures[signature], address, arguments);
        self.at.func.dfg.inst_results(call).first().copied()
    }

    /// A step is done: what is needed no more frees its register and its place.
    fn pass(&mut self, step: usize) {
        for x in 0..self.held.len() {
            let value = self.held[x].value;
            while self.needed[value].last().is_some_and(|&at| at <= step) {
                self.needed[value].pop();
            }
        }
        let (needed, offsets, free) = (&self.needed, &mut self.offsets, &mut self.free);
        self.held.retain(|x| {
            let over = needed[x.value].is_empty();
            if over {
                free.extend(offsets[x.value].take());
            }
            !over
        });
    }

    /// After a step: its result and what was loaded for it stay in registers where they are needed sooner than others.
    fn keep(&mut self, result: Held, step: usize) {
        self.held.append(&mut self.loaded);
        self.held.push(result);
        self.pass(step);
        while self.held.len() > HELD {
            let next = |x: &Held| self.needed[x.value].last().copied().unwrap_or(usize::MAX);
            let Some(last) = (0..self.held.len()).max_by_key(|&i| next(&self.held[i])) else { return };
            self.release(last);
        }
    }

    /// A value leaves its register, to the stack if it is needed again and nowhere else.
    fn release(&mut self, i: usize) {
        let Held { value, register } = self.held.swap_remove(i);
        let computed = matches!(self.values.sources[value], Source::Operation);
        if computed && self.offsets[value].is_none() && !self.needed[value].is_empty() {
            let place = self.free.pop().unwrap_or_else(|| {
                self.next_offset += SIZE;
                self.next_offset - SIZE
            });
            self.put(register, place);
            self.offsets[value] = Some(place);
        }
    }

    /// The address of a place on the stack.
    fn address(&mut self, place: i32) -> Value {
        let distance = self.at.ins().iconst(self.pointer, i64::from(place));
        self.at.ins().iadd(self.stack, distance)
    }

    /// A value into its place on the stack.
    fn put(&mut self, value: Value, place: i32) {
        self.at.ins().store(MemFlags::trusted(), value, self.stack, place);
    }

    /// A value where it is needed.
    fn value(&mut self, x: usize) -> Value {
        if let Some(held) = self.held.iter().chain(&self.loaded).find(|held| held.value == x) {
            return held.register;
        }
        let (from, place) = match self.values.sources[x] {
            Source::Input(k) => (self.lists.inputs, k as i32 * SIZE),
            Source::Constant(k) => (self.lists.constants, k as i32 * SIZE),
            Source::Sine(k) => (self.stack, self.sines + k as i32 * SIZE),
            // what was computed and is not held lies on the stack: operations stand in an order in which it is known
            Source::Operation => (self.stack, self.offsets[x].expect("a place for a value that is needed")),
        };
        let found = self.at.ins().load(F64, MemFlags::trusted(), from, place);
        self.loaded.push(Held { value: x, register: found });
        found
    }

    fn result(&mut self, operation: &Operation) -> Value {
        let operands = &operation.operands[..arity(operation.code)];
        let read: Vec<Value> = operands.iter().map(|&x| self.value(x)).collect();
        let [x, y, z] = [0, 1, 2].map(|i| read.get(i).copied().unwrap_or(read[0]));
        match operation.code {
            Code::Add => self.at.ins().fadd(x, y),
            Code::Sub => self.at.ins().fsub(x, y),
            Code::Mul => self.at.ins().fmul(x, y),
            Code::Div => self.at.ins().fdiv(x, y),
            Code::Neg => self.at.ins().fneg(x),
            Code::Sqrt => self.at.ins().sqrt(x),
            Code::Abs => self.at.ins().fabs(x),
            Code::ProductPlus => {
                let product = self.at.ins().fmul(x, y);
                self.at.ins().fadd(product, z)
            }
            Code::ProductMinus => {
                let product = self.at.ins().fmul(x, y);
                self.at.ins().fsub(product, z)
            }
            Code::MinusProduct => {
                let product = self.at.ins().fmul(x, y);
                self.at.ins().fsub(z, product)
            }
            Code::OverOrZero => {
                let zero = self.at.ins().f64const(0.0);
                let quotient = self.at.ins().fdiv(x, y);
                self.where_(FloatCC::Equal, [y, zero], [zero, quotient])
            }
            Code::Max => self.most(FloatCC::GreaterThan, x, y),
            Code::Min => self.most(FloatCC::LessThan, x, y),
            Code::WherePositive => {
                let zero = self.at.ins().f64const(0.0);
                self.where_(FloatCC::GreaterThan, [x, zero], [y, z])
            }
            Code::Reached => {
                let (reached, below) = (self.at.ins().f64const(1.0), self.at.ins().f64const(-1.0));
                self.where_(FloatCC::GreaterThan, [y, x], [below, reached])
            }
            Code::Power => {
                let exponent = self.at.ins().f64const(operation.exponent);
                self.function(functions::power as *const (), &[x, exponent])
            }
            Code::Atan2 => self.function(functions::atan2 as *const (), &[x, y]),
            Code::Hypot => self.function(functions::hypot as *const (), &[x, y]),
            Code::Round => self.function(functions::round as *const (), &[x]),
            Code::SinCos => unreachable!("sines are computed by the call of their stage"),
        }
    }

    /// A function of one number or two.
    fn function(&mut self, function: *const (), arguments: &[Value]) -> Value {
        let found = self.call(function, arguments.len() - 1, arguments);
        found.unwrap_or(arguments[0])
    }

    fn where_(&mut self, condition: FloatCC, [x, y]: [Value; 2], [yes, no]: [Value; 2]) -> Value {
        let condition_met = self.at.ins().fcmp(condition, x, y);
        self.at.ins().select(condition_met, yes, no)
    }

    /// The larger or smaller one; the other one where one is NaN.
    fn most(&mut self, condition: FloatCC, x: Value, y: Value) -> Value {
        let other = self.where_(FloatCC::Unordered, [y, y], [x, y]);
        self.where_(condition, [x, y], [x, other])
    }
}
