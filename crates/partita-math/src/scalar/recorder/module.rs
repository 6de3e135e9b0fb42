//! A recording as a WebAssembly module: straight-line functions over one memory of numbers.
//!
//! ```text
//! memory    inputs | outputs | what one function leaves for the next
//! prepare   what depends on constants and settled inputs alone
//! stage k   what the outputs of stage k need and no stage before has computed
//! ```
//! Long functions are cut into pieces: engines optimise a function only up to a size. A value read once stays on the
//! stack; a value read again lies in a local, which is free after its last reader.

use super::{Operation, Recording};
use std::collections::HashMap;
use std::ops::Range;
use wasm_encoder::{
    CodeSection, EntityType, ExportKind, ExportSection, Function, FunctionSection, Ieee64, ImportSection,
    InstructionSink, MemArg, MemorySection, MemoryType, Module as Binary, TypeSection, ValType,
};

/// Maximum number of operations of one function.
const PIECE: usize = 1000;
const PAGE: usize = 65536;

/// Functions that the module imports from `Math`, with the number of arguments; `round` is halves away from zero.
const IMPORTS: [(&str, u32); 6] = [("sin", 1), ("cos", 1), ("round", 1), ("atan2", 2), ("hypot", 2), ("pow", 2)];
const SIN: u32 = 0;
const COS: u32 = 1;
const ROUND: u32 = 2;
const ATAN2: u32 = 3;
const HYPOT: u32 = 4;
const POW: u32 = 5;

/// Types of functions: none, one or two arguments; the last two return a number.
const BARE: u32 = 0;

/// A program of the page.
#[derive(Clone, Debug)]
pub struct Module {
    /// The binary. It imports from `math` and exports `memory` and its functions, which take no arguments.
    pub bytes: Vec<u8>,
    /// Numbers in the memory that it uses.
    pub work: usize,
    /// Offset of the first output; the others follow in order.
    pub outputs: usize,
    /// Operations by function: `prepare`, then the stages.
    pub operations: Vec<usize>,
}

impl Recording {
    /// As a WebAssembly module. `settled` inputs change seldom: what depends on them alone is computed by `prepare`.
    /// The outputs are distinguished by `stages`, each with the name of its function; a function may be called after
    /// those before it. An output may be written as soon as it is known, by an earlier function.
    pub fn module(&self, settled: Range<usize>, stages: &[(&str, Range<usize>)]) -> Module {
        let mut names = vec![("prepare", 0..0)];
        names.extend(stages.iter().cloned());
        Plan::new(self, self.staged(settled, stages)).written(&names)
    }

    /// The function of each operation: 0 for `prepare`, `1 + k` for stage k; none where nothing needs it.
    fn staged(&self, settled: Range<usize>, stages: &[(&str, Range<usize>)]) -> Vec<Option<usize>> {
        let count = self.operations.len();
        let mut of: Vec<Option<usize>> = vec![None; count];
        for (stage, (_, outputs)) in stages.iter().enumerate().rev() {
            let mut needed = vec![false; count];
            self.outputs[outputs.clone()].iter().for_each(|&x| needed[x as usize] = true);
            for i in (0..count).rev() {
                if needed[i] {
                    of[i] = Some(stage + 1);
                    self.operations[i].operands(|x| needed[x as usize] = true);
                }
            }
        }
        let mut constant = vec![true; count];
        for (i, operation) in self.operations.iter().enumerate() {
            constant[i] = match operation {
                Operation::Input(k) => settled.contains(&(*k as usize)),
                other => {
                    let mut all = true;
                    other.operands(|x| all &= constant[x as usize]);
                    all
                }
            };
            if constant[i] && of[i].is_some() {
                of[i] = Some(0);
            }
        }
        of
    }
}

/// Which function and piece computes each value, and where it is stored for others.
struct Plan<'a> {
    recording: &'a Recording,
    of: Vec<Option<usize>>,
    /// Piece of each operation that is computed in one; inputs and constants have none.
    piece: Vec<Option<usize>>,
    /// Offset in memory of each value that another piece reads or an output needs.
    slot: Vec<Option<usize>>,
    work: usize,
}

impl<'a> Plan<'a> {
    fn new(recording: &'a Recording, of: Vec<Option<usize>>) -> Self {
        let count = of.len();
        let functions = of.iter().flatten().max().map_or(1, |x| x + 1);
        let (mut piece, mut next) = (vec![None; count], 0);
        for function in 0..functions {
            let mut inside = 0;
            for i in (0..count).filter(|&i| of[i] == Some(function)) {
                if !matches!(recording.operations[i], Operation::Input(_) | Operation::Constant(_)) {
                    piece[i] = Some(next + inside / PIECE);
                    inside += 1;
                }
            }
            next += inside.div_ceil(PIECE).max(1);
        }
        let mut slot = vec![None; count];
        for (o, &x) in recording.outputs.iter().enumerate() {
            let x = x as usize;
            if piece[x].is_some() && slot[x].is_none() {
                slot[x] = Some(recording.inputs + o);
            }
        }
        let mut work = recording.inputs + recording.outputs.len();
        for (i, operation) in recording.operations.iter().enumerate().filter(|x| of[x.0].is_some()) {
            operation.operands(|x| {
                let x = x as usize;
                if piece[x].is_some() && piece[x] != piece[i] && slot[x].is_none() {
                    slot[x] = Some(work);
                    work += 1;
                }
            });
        }
        Self { recording, of, piece, slot, work }
    }

    fn written(&self, functions: &[(&str, Range<usize>)]) -> Module {
        let (mut types, mut imports) = (TypeSection::new(), ImportSection::new());
        types.ty().function([], []);
        types.ty().function([ValType::F64], [ValType::F64]);
        types.ty().function([ValType::F64; 2], [ValType::F64]);
        for (name, arguments) in IMPORTS {
            imports.import("math", name, EntityType::Function(arguments));
        }
        let (mut kinds, mut exports, mut code) = (FunctionSection::new(), ExportSection::new(), CodeSection::new());
        exports.export("memory", ExportKind::Memory, 0);
        let mut next = IMPORTS.len() as u32;
        let mut operations = Vec::new();
        let mut add = |function: &Function| {
            kinds.function(BARE);
            code.function(function);
            next += 1;
            next - 1
        };
        for (number, (name, outputs)) in functions.iter().enumerate() {
            let own = |i: &usize| self.of[*i] == Some(number) && self.piece[*i].is_some();
            let all: Vec<usize> = (0..self.of.len()).filter(own).collect();
            let mut calls: Vec<u32> =
                all.chunk_by(|x, y| self.piece[*x] == self.piece[*y]).map(|part| add(&self.body(part))).collect();
            let copied = if number == 0 { self.constants() } else { self.copies(outputs.clone()) };
            calls.extend(copied.chunks(PIECE).map(|part| add(&self.copying(part))));
            let mut whole = Function::new([]);
            for call in calls {
                whole.instructions().call(call);
            }
            whole.instructions().end();
            exports.export(name, ExportKind::Func, add(&whole));
            operations.push(all.len());
        }
        let mut memories = MemorySection::new();
        let minimum = (8 * self.work).div_ceil(PAGE).max(1) as u64;
        memories.memory(MemoryType { minimum, maximum: None, memory64: false, shared: false, page_size_log2: None });
        let mut binary = Binary::new();
        binary.section(&types).section(&imports).section(&kinds).section(&memories).section(&exports).section(&code);
        Module { bytes: binary.finish(), work: self.work, outputs: self.recording.inputs, operations }
    }

    /// Outputs that are constants: written once.
    fn constants(&self) -> Vec<usize> {
        let outputs = &self.recording.outputs;
        let constant = |o: &usize| matches!(self.recording.operations[outputs[*o] as usize], Operation::Constant(_));
        (0..outputs.len()).filter(constant).collect()
    }

    /// Outputs that are computed elsewhere: inputs, and duplicates of other outputs.
    fn copies(&self, outputs: Range<usize>) -> Vec<usize> {
        let elsewhere = |o: &usize| {
            let x = self.recording.outputs[*o] as usize;
            match self.recording.operations[x] {
                Operation::Constant(_) => false,
                _ => self.slot[x] != Some(self.recording.inputs + o),
            }
        };
        outputs.filter(elsewhere).collect()
    }

    fn copying(&self, outputs: &[usize]) -> Function {
        let mut body = Body::new(self, None);
        for &o in outputs {
            body.code().i32_const(0);
            body.read(self.recording.outputs[o]);
            body.store(self.recording.inputs + o);
        }
        body.finish()
    }

    fn body(&self, part: &[usize]) -> Function {
        let mut body = Body::new(self, part.first().and_then(|&i| self.piece[i]));
        for &i in part {
            body.count(i);
        }
        for &i in part {
            body.root(i);
        }
        body.finish()
    }
}

/// One function under construction.
struct Body<'a> {
    plan: &'a Plan<'a>,
    piece: Option<usize>,
    bytes: Vec<u8>,
    /// How often each value will still be read here, and the local in which it lies.
    readers: HashMap<u32, usize>,
    local: HashMap<u32, u32>,
    free: Vec<u32>,
    locals: u32,
}

fn at(slot: usize) -> MemArg {
    MemArg { offset: 8 * slot as u64, align: 3, memory_index: 0 }
}

impl<'a> Body<'a> {
    fn new(plan: &'a Plan<'a>, piece: Option<usize>) -> Self {
        Self {
            plan,
            piece,
            bytes: Vec::new(),
            readers: Default::default(),
            local: Default::default(),
            free: Vec::new(),
            locals: 0,
        }
    }

    fn code(&mut self) -> InstructionSink<'_> {
        InstructionSink::new(&mut self.bytes)
    }

    fn count(&mut self, i: usize) {
        let operation = self.plan.recording.operations[i];
        operation.operands(|x| *self.readers.entry(x).or_default() += 1);
        // a divisor is also tested
        if let Operation::OverOrZero(_, y) = operation {
            *self.readers.entry(y).or_default() += 1;
        }
    }

    /// Whether a value is computed at its only use.
    fn inlined(&self, x: u32) -> bool {
        let i = x as usize;
        self.plan.piece[i] == self.piece && self.plan.slot[i].is_none() && self.readers.get(&x) == Some(&1)
    }

    /// Computes a value that is read more than once, or stored in memory.
    fn root(&mut self, i: usize) {
        let x = i as u32;
        if self.inlined(x) {
            return;
        }
        let slot = self.plan.slot[i];
        if slot.is_some() {
            self.code().i32_const(0);
        }
        self.compute(i);
        if self.readers.get(&x).is_some_and(|&n| n > 0) {
            let local = self.new_local(x);
            match slot {
                Some(_) => self.code().local_tee(local),
                None => self.code().local_set(local),
            };
        }
        if let Some(slot) = slot {
            self.store(slot);
        }
    }

    fn store(&mut self, slot: usize) {
        self.code().f64_store(at(slot));
    }

    fn new_local(&mut self, x: u32) -> u32 {
        let local = self.free.pop().unwrap_or_else(|| {
            self.locals += 1;
            self.locals - 1
        });
        self.local.insert(x, local);
        local
    }

    /// Puts a value on the stack.
    fn read(&mut self, x: u32) {
        let i = x as usize;
        let known = self.local.get(&x).copied();
        if known.is_none() && self.inlined(x) {
            return self.compute(i);
        }
        let left = self.readers.get(&x).copied().unwrap_or(1) - 1;
        self.readers.insert(x, left);
        if let Some(local) = known {
            self.code().local_get(local);
            if left == 0 {
                self.local.remove(&x);
                self.free.push(local);
            }
            return;
        }
        let slot = match self.plan.recording.operations[i] {
            Operation::Constant(c) => {
                self.code().f64_const(Ieee64::from(c));
                return;
            }
            Operation::Input(k) => k as usize,
            _ => self.plan.slot[i].unwrap_or(0),
        };
        self.code().i32_const(0).f64_load(at(slot));
        if left > 0 {
            let local = self.new_local(x);
            self.code().local_tee(local);
        }
    }

    fn compute(&mut self, i: usize) {
        use Operation as O;
        let operation = self.plan.recording.operations[i];
        match operation {
            // the order of the stack: the two alternatives come first
            O::WherePositive(x, yes, no) => {
                self.read(yes);
                self.read(no);
                self.read(x);
                self.code().f64_const(Ieee64::from(0.0)).f64_gt().select();
            }
            O::Reached(x, b) => {
                self.code().f64_const(Ieee64::from(1.0)).f64_const(Ieee64::from(-1.0));
                self.read(x);
                self.code().f64_const(Ieee64::from(b)).f64_ge().select();
            }
            O::OverOrZero(x, y) => {
                self.code().f64_const(Ieee64::from(0.0));
                self.read(x);
                self.read(y);
                self.code().f64_div();
                self.read(y);
                self.code().f64_const(Ieee64::from(0.0)).f64_eq().select();
            }
            _ => {
                operation.with(|x| {
                    self.read(x);
                    x
                });
                self.apply(operation);
            }
        }
    }

    /// The operation, its operands being on the stack.
    fn apply(&mut self, operation: Operation) {
        use Operation as O;
        let mut code = self.code();
        match operation {
            O::Add(..) => code.f64_add(),
            O::Sub(..) => code.f64_sub(),
            O::Mul(..) => code.f64_mul(),
            O::Div(..) => code.f64_div(),
            O::Neg(_) => code.f64_neg(),
            O::Sqrt(_) => code.f64_sqrt(),
            O::Abs(_) => code.f64_abs(),
            O::Max(..) => code.f64_max(),
            O::Min(..) => code.f64_min(),
            O::Sin(_) => code.call(SIN),
            O::Cos(_) => code.call(COS),
            O::Round(_) => code.call(ROUND),
            O::Atan2(..) => code.call(ATAN2),
            O::Hypot(..) => code.call(HYPOT),
            O::Power(_, e) => code.f64_const(Ieee64::from(e)).call(POW),
            O::Scale(_, f) => code.f64_const(Ieee64::from(f)).f64_mul(),
            O::Input(_) | O::Constant(_) | O::OverOrZero(..) | O::WherePositive(..) | O::Reached(..) => return,
        };
    }

    fn finish(mut self) -> Function {
        self.code().end();
        let mut function = Function::new([(self.locals, ValType::F64)]);
        function.raw(self.bytes);
        function
    }
}
