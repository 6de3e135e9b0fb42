//! A recording as the text of a function in C.
//!
//! A value read once stands where it is read, unless its expression becomes long; a value read again is a variable.
//! Arguments are read before the first result is written, so an array may be both.

use super::{Operation, Recording};
use std::fmt::Write;
use std::ops::Range;

/// Longest expression that stands within another one, and longest line, in characters.
const EXPRESSION: usize = 60;
const LINE: usize = 116;

/// Numbers among the arguments of a function in C, or among its results.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Numbers<'a> {
    /// Name.
    pub name: &'a str,
    /// How many; none for one number that is passed by value.
    pub count: Option<usize>,
}

impl<'a> Numbers<'a> {
    /// An array.
    pub fn array(name: &'a str, count: usize) -> Self {
        Self { name, count: Some(count) }
    }

    /// One number.
    pub fn one(name: &'a str) -> Self {
        Self { name, count: None }
    }

    fn len(&self) -> usize {
        self.count.unwrap_or(1)
    }

    fn entry(&self, i: usize) -> String {
        match self.count {
            Some(_) => format!("{}[{i}]", self.name),
            None => self.name.to_string(),
        }
    }
}

/// What binds the last operation of an expression: its parts need parentheses where they bind less.
#[derive(Clone, Copy, PartialEq, PartialOrd)]
enum Binds {
    Sum,
    Product,
    Sign,
    Name,
}

/// An expression that is not a variable yet, or the name of one.
#[derive(Clone)]
struct Expression {
    text: String,
    binds: Binds,
}

impl Expression {
    fn within(&self, at_least: Binds) -> String {
        match self.binds >= at_least {
            true => self.text.clone(),
            false => format!("({})", self.text),
        }
    }
}

/// The head of a function, without what follows it: `static` apart, the line of a header too.
pub fn head(name: &str, inputs: &[Numbers], outputs: &[Numbers], refuses: bool) -> String {
    let mut arguments = Vec::new();
    for x in inputs {
        let changed = if outputs.contains(x) { "" } else { "const " };
        arguments.push(match x.count {
            Some(n) => format!("{changed}double {}[{n}]", x.name),
            None => format!("double {}", x.name),
        });
    }
    let only_results = outputs.iter().filter(|x| !inputs.contains(x));
    arguments.extend(only_results.map(|x| format!("double {}", x.entry(x.len()))));
    let result = if refuses { "int" } else { "void" };
    format!("{result} {name}({})", arguments.join(", "))
}

impl Recording {
    /// The recording as a function in C: its inputs are `inputs` one after the other, its outputs `outputs`. Where it
    /// `refuses`, one more output is not written: the function returns 1 where that is above 0, or a result no number,
    /// else 0.
    ///
    /// Prefer a [`lean`](Self::lean) recording. The functions of `math.h` take the place of ours, and compilers may join
    /// a product and a sum: results agree with [`evaluate`](Self::evaluate) up to rounding.
    ///
    /// # Panics
    /// If the arguments do not add up to the inputs and outputs of the recording.
    pub fn c(&self, name: &str, inputs: &[Numbers], outputs: &[Numbers], refuses: bool) -> String {
        let entries = |list: &[Numbers]| list.iter().flat_map(|x| (0..x.len()).map(|i| x.entry(i))).collect::<Vec<_>>();
        let (read, written) = (entries(inputs), entries(outputs));
        assert_eq!(read.len(), self.inputs, "the arguments are not the inputs of the recording");
        assert_eq!(written.len() + usize::from(refuses), self.outputs.len(), "the results are not its outputs");
        let mut body = Body::new(self, &read);
        for i in 0..self.operations.len() {
            if body.readers[i] > 0 {
                body.add(i);
            }
        }
        let changes = inputs.iter().any(|x| outputs.contains(x));
        let results: Vec<String> = self.outputs.iter().map(|&x| body.result(x, changes)).collect();
        let mut text = format!("{}\n{{\n", head(name, inputs, outputs, refuses));
        let used = |range: Range<usize>| {
            let read = |(i, x): (usize, &Operation)| matches!(x, Operation::Input(k) if body.readers[i] > 0 && range.contains(&(*k as usize)));
            self.operations.iter().enumerate().any(read)
        };
        let mut from = 0;
        for x in inputs {
            if !outputs.contains(x) && !used(from..from + x.len()) {
                let _ = writeln!(text, "    (void){};", x.name);
            }
            from += x.len();
        }
        body.lines(&mut text);
        let mut line = String::new();
        for (place, value) in written.iter().zip(&results) {
            put(&mut text, &mut line, &format!("{place} = {value};"), " ");
        }
        flush(&mut text, &mut line);
        if refuses {
            // what is no number does not reach a maximum
            let mut line = format!("return !({} <= 0.0 && isfinite(", results[written.len()]);
            for (i, x) in written.iter().enumerate() {
                let last = i + 1 == written.len();
                put(
                    &mut text,
                    &mut line,
                    &format!("{x}{}", if last { "));" } else { " +" }),
                    if i == 0 { "" } else { " " },
                );
            }
            flush(&mut text, &mut line);
        }
        text.push_str("}\n");
        text
    }
}

/// Appends a piece to the line, which is ended first where it would be too long.
fn put(text: &mut String, line: &mut String, piece: &str, between: &str) {
    if !line.is_empty() && line.len() + between.len() + piece.len() > LINE {
        flush(text, line);
    }
    if !line.is_empty() {
        line.push_str(between);
    }
    line.push_str(piece);
}

fn flush(text: &mut String, line: &mut String) {
    if !line.is_empty() {
        let _ = writeln!(text, "    {line}");
        line.clear();
    }
}

/// A number as C reads it, exactly.
fn constant(c: f64) -> Expression {
    let text = match c {
        c if c.is_nan() => "NAN".to_string(),
        c if c.is_infinite() => (if c > 0.0 { "INFINITY" } else { "-INFINITY" }).to_string(),
        c => format!("{c:?}"),
    };
    let binds = if text.starts_with('-') { Binds::Sign } else { Binds::Name };
    Expression { text, binds }
}

/// A function under construction.
struct Body<'a> {
    recording: &'a Recording,
    names: &'a [String],
    /// How often each value is still to be read.
    readers: Vec<usize>,
    values: Vec<Option<Expression>>,
    /// Variables: `x0 = ...`.
    statements: Vec<String>,
}

impl<'a> Body<'a> {
    fn new(recording: &'a Recording, names: &'a [String]) -> Self {
        let count = recording.operations.len();
        let mut readers = vec![0; count];
        recording.outputs.iter().for_each(|&x| readers[x as usize] += 1);
        for i in (0..count).rev() {
            if readers[i] > 0 {
                recording.operations[i].operands(|x| readers[x as usize] += 1);
                // a divisor is also tested
                if let Operation::OverOrZero(_, y) = recording.operations[i] {
                    readers[y as usize] += 1;
                }
            }
        }
        Self { recording, names, readers, values: vec![None; count], statements: Vec::new() }
    }

    /// Makes a value a variable, unless it is a name or a constant already.
    fn named(&mut self, x: u32) {
        let Some(value) = self.values[x as usize].clone() else { return };
        if value.binds == Binds::Name && !value.text.contains('(') || self.is_constant(x) {
            return;
        }
        let name = format!("x{}", self.statements.len());
        self.statements.push(format!("{name} = {}", value.text));
        self.values[x as usize] = Some(Expression { text: name, binds: Binds::Name });
    }

    fn is_constant(&self, x: u32) -> bool {
        matches!(self.recording.operations[x as usize], Operation::Constant(_))
    }

    fn length(&self, x: u32) -> usize {
        self.values[x as usize].as_ref().map_or(0, |x| x.text.len())
    }

    fn part(&self, x: u32, binds: Binds) -> String {
        self.values[x as usize].as_ref().map_or_else(String::new, |x| x.within(binds))
    }

    /// Computes a value.
    fn add(&mut self, i: usize) {
        let operation = self.recording.operations[i];
        let mut operands = Vec::new();
        operation.operands(|x| operands.push(x));
        // the longest ones become variables until the rest fits
        while operands.iter().map(|x| self.length(*x)).sum::<usize>() > EXPRESSION {
            let Some(&longest) = operands.iter().max_by_key(|x| self.length(**x)) else { break };
            let before = self.length(longest);
            self.named(longest);
            if self.length(longest) == before {
                break;
            }
        }
        self.values[i] = Some(self.expression(operation));
        if self.readers[i] > 1 {
            self.named(i as u32);
        }
    }

    fn expression(&self, operation: Operation) -> Expression {
        use Binds::{Name, Product, Sign, Sum};
        use Operation as O;
        let two = |x, left, sign: &str, y, right, binds| Expression {
            text: format!("{} {sign} {}", self.part(x, left), self.part(y, right)),
            binds,
        };
        let call = |name: &str, operands: &[u32]| {
            let parts: Vec<String> = operands.iter().map(|x| self.part(*x, Sum)).collect();
            Expression { text: format!("{name}({})", parts.join(", ")), binds: Name }
        };
        let of = |text: String| Expression { text, binds: Name };
        match operation {
            O::Input(k) => of(self.names[k as usize].clone()),
            O::Constant(c) => constant(c),
            O::Add(x, y) => two(x, Sum, "+", y, Product, Sum),
            O::Sub(x, y) => two(x, Sum, "-", y, Product, Sum),
            O::Mul(x, y) => two(x, Product, "*", y, Sign, Product),
            O::Div(x, y) => two(x, Product, "/", y, Sign, Product),
            O::Scale(x, f) => {
                Expression { text: format!("{} * {}", self.part(x, Product), constant(f).text), binds: Product }
            }
            O::Neg(x) => Expression { text: format!("-{}", self.part(x, Name)), binds: Sign },
            O::Sqrt(x) => call("sqrt", &[x]),
            O::Sin(x) => call("sin", &[x]),
            O::Cos(x) => call("cos", &[x]),
            O::Abs(x) => call("fabs", &[x]),
            O::Round(x) => call("round", &[x]),
            O::Atan2(x, y) => call("atan2", &[x, y]),
            O::Hypot(x, y) => call("hypot", &[x, y]),
            O::Max(x, y) => call("fmax", &[x, y]),
            O::Min(x, y) => call("fmin", &[x, y]),
            O::Power(x, e) => of(format!("pow({}, {})", self.part(x, Sum), constant(e).text)),
            O::WherePositive(x, y, n) => {
                of(format!("({} > 0.0 ? {} : {})", self.part(x, Sum), self.part(y, Sum), self.part(n, Sum)))
            }
            O::Reached(x, b) => of(format!("({} >= {} ? 1.0 : -1.0)", self.part(x, Sum), constant(b).text)),
            O::OverOrZero(x, y) => {
                of(format!("({} == 0.0 ? 0.0 : {} / {})", self.part(y, Sum), self.part(x, Product), self.part(y, Sign)))
            }
        }
    }

    /// The text of a result. Where an argument is a result too, none is read any more when results are written.
    fn result(&mut self, x: u32, changes: bool) -> String {
        let reads = |text: &str| changes && text.contains('[');
        let value = self.values[x as usize].clone();
        let Some(value) = value else { return "0.0".to_string() };
        if !reads(&value.text) {
            return value.text;
        }
        let name = format!("x{}", self.statements.len());
        self.statements.push(format!("{name} = {}", value.text));
        name
    }

    /// The variables, several to a line.
    fn lines(&self, text: &mut String) {
        let mut line = String::new();
        for statement in &self.statements {
            if line.is_empty() {
                line = format!("const double {statement}");
            } else if line.len() + statement.len() + 3 > LINE {
                let _ = writeln!(text, "    {line};");
                line = format!("const double {statement}");
            } else {
                let _ = write!(line, ", {statement}");
            }
        }
        if !line.is_empty() {
            let _ = writeln!(text, "    {line};");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::{Cases, Recorder, Scalar};

    fn text(inputs: usize, f: impl FnOnce(&[Recorder]) -> Vec<Recorder>) -> String {
        let made = Recording::new(inputs, |x| Ok::<_, ()>(f(x))).unwrap().lean();
        let outputs = Numbers::array("y", made.outputs());
        made.c("f", &[Numbers::array("x", inputs)], &[outputs], false)
    }

    #[test]
    fn parentheses_keep_the_order_of_operations() {
        let found = text(3, |x| vec![x[0] - (x[1] - x[2]), (x[0] + x[1]) * x[2], x[0] / (x[1] * x[2]), -(x[0] * x[1])]);
        for part in ["x[0] - (x[1] - x[2])", "(x[0] + x[1]) * x[2]"] {
            assert!(found.contains(part), "{found}");
        }
    }

    #[test]
    fn what_is_read_twice_is_computed_once() {
        let found = text(1, |x| {
            let s = x[0].sin_cos().0;
            vec![s * s + Recorder::one(), s.over_or_zero(s)]
        });
        assert_eq!(found.matches("sin(").count(), 1, "{found}");
    }

    #[test]
    fn an_array_that_is_read_and_written_is_read_first() {
        let made = Recording::new(2, |x| Ok::<_, ()>(vec![x[1], x[0], x[0] - Recorder::one()])).unwrap();
        let q = Numbers::array("q", 2);
        let found = made.c("swap", &[q], &[q], true);
        let order = |part: &str| found.find(part).unwrap_or_else(|| panic!("{part} is missing in\n{found}"));
        assert!(order("= q[0]") < order("q[0] ="), "{found}");
        assert!(order("= q[1]") < order("q[1] ="), "{found}");
        assert!(found.starts_with("int swap(double q[2])"), "{found}");
        assert!(found.contains("return !("), "{found}");
    }

    #[test]
    fn numbers_that_are_none_have_their_names() {
        let found = text(1, |x| vec![x[0], Recorder::from_f64(f64::NAN), Recorder::from_f64(f64::NEG_INFINITY)]);
        assert!(found.contains("y[1] = NAN;") && found.contains("y[2] = -INFINITY;"), "{found}");
    }
}
