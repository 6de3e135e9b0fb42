//! A program by values instead of registers.
//!
//! A call leaves nothing in the vector registers. Angles are therefore collected: operations are ordered by the number of
//! sines that they come after, and the sines between two of these stages are computed by one call.

use partita_math::program::{Code, Program};

/// Places that move by different steps in one loop. Reason: each takes a general register.
pub(crate) const POINTERS: usize = 8;

/// Where a value comes from.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Source {
    Input(usize),
    Constant(usize),
    /// Computed by an operation of the list.
    Operation,
    /// Place of a sine, or cosine, among the results of all calls.
    Sine(usize),
    /// Place among the arrays: computed in a loop.
    Array(usize),
}

/// A part of the code.
pub(crate) enum Item {
    Operation(Operation),
    Roll(Box<Roll>),
}

/// A loop.
pub(crate) struct Roll {
    pub(crate) count: usize,
    /// One turn: its inputs are what it reads, its outputs what it keeps.
    pub(crate) body: Values,
    pub(crate) reads: Vec<Read>,
    /// Where each output of a turn goes.
    pub(crate) keeps: Vec<Keep>,
    /// Places among the arrays and the values that are copied there before.
    pub(crate) entries: Vec<(usize, usize)>,
}

impl Source {
    /// The place that many numbers further.
    pub(crate) fn further(self, by: isize) -> Self {
        let to = |k: usize| k.wrapping_add_signed(by);
        match self {
            Self::Input(k) => Self::Input(to(k)),
            Self::Constant(k) => Self::Constant(to(k)),
            Self::Sine(k) => Self::Sine(to(k)),
            Self::Array(k) => Self::Array(to(k)),
            Self::Operation => Self::Operation,
        }
    }
}

/// Where an output of a turn goes.
#[derive(Clone, Copy)]
pub(crate) enum Keep {
    /// To the arrays: turn 0 to the first place, each one after a step further, or to the same one.
    Array { first: usize, step: usize },
    /// To an output of the program.
    Output { first: usize, step: isize },
}

/// Where an input of a turn lies.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Read {
    /// A value, the same in every turn.
    Same(usize),
    /// At this place in turn 0, and a step further in each turn after.
    Moving { first: Source, step: isize },
}

/// An operation on values instead of registers; millions of them are kept at a time.
pub(crate) struct Operation {
    pub(crate) code: Code,
    pub(crate) operands: [u32; 3],
    /// Of a power: its place among the exponents.
    pub(crate) exponent: u32,
    pub(crate) to: u32,
}

impl Operation {
    /// The values that it reads.
    pub(crate) fn reads(&self) -> &[u32] {
        &self.operands[..arity(self.code)]
    }

    /// The value that it computes.
    pub(crate) fn to(&self) -> usize {
        self.to as usize
    }

    /// Whether it is a function that is called.
    pub(crate) fn is_call(&self) -> bool {
        matches!(self.code, Code::Power | Code::Atan2 | Code::Hypot | Code::Round)
    }
}

/// Values in the order in which they are known, each with its stage: the number of calls before it.
pub(crate) struct Values {
    pub(crate) sources: Vec<Source>,
    /// Number of constants.
    pub(crate) constants: usize,
    stages: Vec<u32>,
    /// Numbers in the arrays of loops.
    pub(crate) arrays: usize,
    /// Operations of each stage, then the angles of its call.
    pub(crate) operations: Vec<Vec<Item>>,
    pub(crate) angles: Vec<Vec<usize>>,
    /// Value of each output; none where a loop writes it.
    pub(crate) outputs: Vec<Option<usize>>,
}

impl Values {
    pub(crate) fn new(program: &Program) -> Self {
        let mut all = Self {
            sources: (0..program.inputs()).map(Source::Input).collect(),
            constants: program.constants().len(),
            stages: Vec::new(),
            arrays: 0,
            operations: Vec::new(),
            angles: Vec::new(),
            outputs: Vec::new(),
        };
        all.sources.extend((0..program.constants().len()).map(Source::Constant));
        all.stages.resize(all.sources.len(), 0);
        // the value in each register
        let mut held: Vec<u32> = (0..program.registers() as u32).collect();
        // stage of the call, and the sine, which its cosine follows
        let mut sines: Vec<(usize, usize)> = Vec::new();
        for i in program.instructions() {
            let operands = [i.x, i.y, i.z].map(|r| held.get(r as usize).copied().unwrap_or(0));
            if i.code == Code::SinCos {
                let angle = operands[0] as usize;
                let stage = all.stages[angle] as usize;
                let pair = [all.value(Source::Sine(0), stage + 1), all.value(Source::Sine(0), stage + 1)];
                sines.push((stage, pair[0] as usize));
                all.at_stage(stage);
                all.angles[stage].push(angle);
                (held[i.to as usize], held[i.also as usize]) = (pair[0], pair[1]);
                continue;
            }
            let used = &operands[..arity(i.code)];
            let stage = used.iter().map(|&x| all.stages[x as usize]).max().unwrap_or(0) as usize;
            let to = all.value(Source::Operation, stage);
            all.at_stage(stage);
            let operation = Operation { code: i.code, operands, exponent: i.also, to };
            all.operations[stage].push(Item::Operation(operation));
            held[i.to as usize] = to;
        }
        all.stages = Vec::new();
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
        all.outputs = program.output_registers().iter().map(|&r| Some(held[r as usize] as usize)).collect();
        all
    }

    /// One turn of a loop: operations without calls, at most `results`, whose values follow the inputs.
    pub(crate) fn of_turn([inputs, results]: [usize; 2], operations: Vec<Item>, outputs: Vec<usize>) -> Self {
        let mut sources: Vec<Source> = (0..inputs).map(Source::Input).collect();
        sources.resize(inputs + results, Source::Operation);
        Self {
            sources,
            constants: 0,
            stages: Vec::new(),
            arrays: 0,
            operations: vec![operations],
            angles: vec![Vec::new()],
            outputs: outputs.into_iter().map(Some).collect(),
        }
    }

    fn value(&mut self, source: Source, stage: usize) -> u32 {
        self.sources.push(source);
        self.stages.push(stage as u32);
        self.sources.len() as u32 - 1
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
