//! A recording as JavaScript: straight-line functions over one array of numbers.
//!
//! ```text
//! w = [ inputs | outputs | what one function leaves for the next ]
//! prepare()     what depends on constants and settled inputs alone
//! stage k       what the outputs of stage k need and no stage before has computed
//! ```
//! Long functions are cut into pieces of some hundred operations, which engines still compile to machine code.

use super::{Operation, Recording};
use std::fmt::Write;
use std::ops::Range;

/// Operations of one function at the most.
const PIECE: usize = 300;

/// What functions of the page the operations call.
const PRELUDE: &str = "\"use strict\";
const { sin, cos, sqrt, atan2, hypot, abs, max, min, pow } = Math;
const round = (x) => (x < 0 ? -Math.round(-x) : Math.round(x));
const ratio = (x, y) => (y === 0 ? 0 : x / y);
";

/// A program of the page.
#[derive(Clone, Debug)]
pub struct Script {
    /// The body of a function of `w` that returns an object of functions without arguments.
    pub text: String,
    /// Length of `w`.
    pub work: usize,
    /// Place of the first output; the others follow in order.
    pub outputs: usize,
    /// Operations by function: `prepare`, then the stages.
    pub operations: Vec<usize>,
}

/// A number that reads back to the bit.
fn literal(c: f64) -> String {
    match c {
        c if c.is_nan() => "NaN".into(),
        c if c == f64::INFINITY => "Infinity".into(),
        c if c == f64::NEG_INFINITY => "(-Infinity)".into(),
        c if c.is_sign_negative() => format!("({c:e})"),
        c => format!("{c:e}"),
    }
}

impl Recording {
    /// As JavaScript. `settled` inputs change seldom: what depends on them alone is computed by `prepare`. The outputs are
    /// told apart by `stages`, each with the name of its function; a function may be called when those before it were.
    pub fn script(&self, settled: Range<usize>, stages: &[(&str, Range<usize>)]) -> Script {
        let count = self.operations.len();
        // 0: prepare; 1 + k: stage k; none: nothing needs it
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
        let mut writer = Writer::new(self, of);
        let mut names = vec![("prepare".to_string(), 0..0)];
        names.extend(stages.iter().map(|(name, outputs)| (name.to_string(), outputs.clone())));
        writer.write(&names)
    }
}

struct Writer<'a> {
    recording: &'a Recording,
    /// Function of each operation.
    of: Vec<Option<usize>>,
    /// Piece of each operation, and its place in `w` if another piece reads it.
    piece: Vec<usize>,
    slot: Vec<Option<usize>>,
    work: usize,
}

impl<'a> Writer<'a> {
    fn new(recording: &'a Recording, of: Vec<Option<usize>>) -> Self {
        let count = of.len();
        let functions = of.iter().flatten().max().map_or(1, |x| x + 1);
        let (mut piece, mut next) = (vec![usize::MAX; count], 0);
        for function in 0..functions {
            let mut inside = 0;
            for i in (0..count).filter(|&i| of[i] == Some(function)) {
                if matches!(recording.operations[i], Operation::Input(_) | Operation::Constant(_)) {
                    continue;
                }
                piece[i] = next + inside / PIECE;
                inside += 1;
            }
            next += inside.div_ceil(PIECE).max(1);
        }
        let mut slot = vec![None; count];
        let mut work = recording.inputs + recording.outputs.len();
        for (i, operation) in recording.operations.iter().enumerate().filter(|x| of[x.0].is_some()) {
            operation.operands(|x| {
                let x = x as usize;
                if piece[x] != usize::MAX && piece[x] != piece[i] && slot[x].is_none() {
                    slot[x] = Some(work);
                    work += 1;
                }
            });
        }
        // outputs are copied at the end of their functions
        for &x in &recording.outputs {
            let x = x as usize;
            if piece[x] != usize::MAX && slot[x].is_none() {
                slot[x] = Some(work);
                work += 1;
            }
        }
        Self { recording, of, piece, slot, work }
    }

    /// An operand as piece `here` reads it.
    fn read(&self, x: u32, here: usize) -> String {
        let i = x as usize;
        match self.recording.operations[i] {
            Operation::Input(k) => format!("w[{k}]"),
            Operation::Constant(c) => literal(c),
            _ => match self.slot[i] {
                Some(slot) if self.piece[i] != here => format!("w[{slot}]"),
                _ => format!("a{i}"),
            },
        }
    }

    fn expression(&self, operation: Operation, here: usize) -> String {
        use Operation as O;
        let at = |x: u32| self.read(x, here);
        match operation {
            O::Input(k) => format!("w[{k}]"),
            O::Constant(c) => literal(c),
            O::Add(x, y) => format!("{} + {}", at(x), at(y)),
            O::Sub(x, y) => format!("{} - {}", at(x), at(y)),
            O::Mul(x, y) => format!("{} * {}", at(x), at(y)),
            O::Div(x, y) => format!("{} / {}", at(x), at(y)),
            O::OverOrZero(x, y) => format!("ratio({}, {})", at(x), at(y)),
            O::Neg(x) => format!("-{}", at(x)),
            O::Sqrt(x) => format!("sqrt({})", at(x)),
            O::Power(x, e) => format!("pow({}, {})", at(x), literal(e)),
            O::Sin(x) => format!("sin({})", at(x)),
            O::Cos(x) => format!("cos({})", at(x)),
            O::Atan2(x, y) => format!("atan2({}, {})", at(x), at(y)),
            O::Hypot(x, y) => format!("hypot({}, {})", at(x), at(y)),
            O::Abs(x) => format!("abs({})", at(x)),
            O::Round(x) => format!("round({})", at(x)),
            O::Max(x, y) => format!("max({}, {})", at(x), at(y)),
            O::Min(x, y) => format!("min({}, {})", at(x), at(y)),
            O::WherePositive(x, y, n) => format!("{} > 0 ? {} : {}", at(x), at(y), at(n)),
            O::Reached(x, b) => format!("{} >= {} ? 1 : -1", at(x), literal(b)),
            O::Scale(x, f) => format!("{} * {}", at(x), literal(f)),
        }
    }

    fn write(&mut self, functions: &[(String, Range<usize>)]) -> Script {
        let mut text = String::from(PRELUDE);
        let (mut operations, mut made) = (Vec::new(), String::new());
        let first = self.recording.inputs;
        for (number, (name, outputs)) in functions.iter().enumerate() {
            let own = |i: &usize| self.of[*i] == Some(number) && self.piece[*i] != usize::MAX;
            let all: Vec<usize> = (0..self.of.len()).filter(own).collect();
            let mut calls = String::new();
            for (k, piece) in all.chunk_by(|x, y| self.piece[*x] == self.piece[*y]).enumerate() {
                let _ = writeln!(text, "function {name}{k}() {{");
                for &i in piece {
                    let right = self.expression(self.recording.operations[i], self.piece[i]);
                    let _ = match self.slot[i] {
                        Some(slot) => writeln!(text, "const a{i} = {right}; w[{slot}] = a{i};"),
                        None => writeln!(text, "const a{i} = {right};"),
                    };
                }
                text.push_str("}\n");
                let _ = write!(calls, "{name}{k}();");
            }
            let copies: Vec<usize> = outputs.clone().collect();
            for (k, part) in copies.chunks(PIECE).enumerate() {
                let _ = writeln!(text, "function {name}Out{k}() {{");
                for &o in part {
                    let right = self.read(self.recording.outputs[o], usize::MAX);
                    let _ = writeln!(text, "w[{}] = {right};", first + o);
                }
                text.push_str("}\n");
                let _ = write!(calls, "{name}Out{k}();");
            }
            operations.push(all.len());
            let _ = writeln!(made, "{name}() {{ {calls} }},");
        }
        let _ = writeln!(text, "return {{\n{made}}};");
        Script { text, work: self.work, outputs: first, operations }
    }
}
