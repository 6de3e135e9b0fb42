//! Which operations repeat: turns of loops.
//!
//! A turn is a run of operations that those after it repeat: the same ones, each of whose operands is the same value in
//! every turn, a value of the same turn or of the one before, a constant, or what moves by a constant step among inputs,
//! sines and results of other loops.

use crate::values::{Item, Operation, Source, Values, POINTERS};
use partita_math::program::Code;
use rustc_hash::FxHashMap;

/// Operands at most that far belong to the pattern of an operation. Scale: operations.
const NEAR: usize = 64;
/// Operations by which places are found where a pattern may repeat.
const WINDOW: usize = 4;
/// Most operations of a turn, and how many lengths are tried at a place.
const LONGEST: usize = 512;
const TRIED: usize = 16;
/// Turns from which on a loop is made, and operations in all. Reason: a loop is entered and left in some ten cycles.
const FEWEST: usize = 8;
const SHORTEST: usize = 32;

/// A value, as far as turns are compared.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum Origin {
    Input,
    Sine,
    Constant,
    /// An operation of a loop.
    Loop {
        roll: usize,
        operation: usize,
    },
    Straight,
}

/// What an operand is in every turn.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum Operand {
    /// The result of an operation of the turn.
    Own(usize),
    Same(usize),
    Moving {
        of: Origin,
        first: isize,
        step: isize,
    },
    /// Constants.
    Table(Vec<usize>),
}

/// A loop that was found.
pub(crate) struct CodeLoop {
    pub(crate) count: usize,
    pub(crate) codes: Vec<(Code, u32)>,
    pub(crate) operands: Vec<Vec<Operand>>,
    /// Operations that another one computes (see `rolls::join_equal`).
    pub(crate) joined: Vec<bool>,
    /// Operations whose results the next turn reads, and what turn 0 reads in their stead.
    pub(crate) entries: Vec<(usize, usize)>,
    /// Operations whose results are outputs: that of turn 0, and the step to that of the next turn.
    pub(crate) outputs: Vec<(usize, usize, isize)>,
    /// Places that move by different steps.
    pub(crate) pointers: usize,
}

impl CodeLoop {
    /// Operands of the operations that it computes.
    pub(crate) fn computed(&self) -> impl Iterator<Item = &Vec<Operand>> {
        self.operands.iter().zip(&self.joined).filter(|x| !x.1).map(|x| x.0)
    }
}

/// Loop, turn and operation of the values that loops compute.
pub(crate) struct Members(pub(crate) Vec<Option<[u32; 3]>>);

impl Members {
    pub(crate) fn get(&self, x: usize) -> Option<[usize; 3]> {
        self.0[x].map(|all| all.map(|i| i as usize))
    }
}

/// Part of a stage; loops are those that were found, in order.
pub(crate) enum Part {
    Straight(Operation),
    Loop,
}

/// The parts of each stage, the loops among them in order, and the values that these compute.
pub(crate) fn search(values: &Values, stages: Vec<Vec<Item>>) -> (Vec<Vec<Part>>, Vec<CodeLoop>, Members) {
    let count = values.sources.len();
    let mut search =
        Search { values, found: Vec::new(), members: Members(vec![None; count]), position: vec![None; count] };
    let parts = stages.into_iter().map(|stage| search.stage(operations_of(stage))).collect();
    (parts, search.found, search.members)
}

struct Search<'v> {
    values: &'v Values,
    found: Vec<CodeLoop>,
    members: Members,
    /// Place of each value among the operations of the stage that is searched.
    position: Vec<Option<u32>>,
}

/// A turn that is looked at: operations `start..start + length` of a stage are turn 0.
#[derive(Clone, Copy)]
struct Turns<'o> {
    operations: &'o [Operation],
    /// Place of the first one among the values: results of a stage follow each other.
    position: &'o [Option<u32>],
    start: usize,
    length: usize,
}

impl Search<'_> {
    fn stage(&mut self, operations: Vec<Operation>) -> Vec<Part> {
        let mut position = std::mem::take(&mut self.position);
        operations.iter().zip(0..).for_each(|(x, p)| position[x.to()] = Some(p));
        let patterns: Vec<u64> = operations.iter().enumerate().map(|(p, x)| pattern(x, p, &position)).collect();
        let next = repetitions(&patterns);
        let (mut ends, mut p) = (Vec::new(), 0);
        // no turns of a length begin before this
        let mut hopeless = vec![0; LONGEST + 1];
        while p < operations.len() {
            let turns = Turns { operations: &operations, position: &position, start: p, length: 0 };
            match self.best(turns, &patterns, &next, &mut hopeless) {
                Some((turns, count)) => {
                    let end = turns.start + count * turns.length;
                    self.accept(turns, count);
                    ends.push((turns.start, end));
                    p = end;
                }
                None => p += 1,
            }
        }
        operations.iter().for_each(|x| position[x.to()] = None);
        self.position = position;
        let mut parts = Vec::new();
        let mut loops = ends.into_iter().peekable();
        for (p, operation) in operations.into_iter().enumerate() {
            while loops.next_if(|(_, end)| *end <= p).is_some() {}
            match loops.peek() {
                Some((start, _)) if *start == p => parts.push(Part::Loop),
                Some((start, _)) if *start < p => {}
                _ => parts.push(Part::Straight(operation)),
            }
        }
        parts
    }

    /// The loop from here on that covers most, shorter turns first if they cover half of that.
    fn best<'o>(
        &self,
        from: Turns<'o>,
        patterns: &[u64],
        next: &[usize],
        hopeless: &mut [usize],
    ) -> Option<(Turns<'o>, usize)> {
        let mut at = from.start;
        let mut all: Vec<(Turns, usize)> = Vec::new();
        for _ in 0..TRIED {
            at = next[at];
            let length = at.saturating_sub(from.start);
            if at == usize::MAX || length > LONGEST {
                break;
            }
            if hopeless[length] > from.start {
                continue;
            }
            let turns = Turns { length, ..from };
            let (count, later) = self.count(turns, patterns);
            if count < FEWEST {
                hopeless[length] = later;
            }
            if count >= FEWEST && count * length >= SHORTEST {
                all.push((turns, count));
                // nothing covers twice as much
                if 2 * count * length > patterns.len() - from.start {
                    break;
                }
            }
        }
        let most = all.iter().map(|(turns, count)| turns.length * count).max()?;
        let (turns, count) = all.into_iter().find(|(turns, count)| 2 * turns.length * count >= most)?;
        // from where on turns share least
        let start = turns.start + turns.fewest_shared();
        let later = Turns { start, ..turns };
        let again = self.count(later, patterns).0;
        Some(if again + 1 >= count && again >= FEWEST { (later, again) } else { (turns, count) })
    }

    /// Turns that repeat the first one, and where others of this length may begin: the operation that ends these does not
    /// end them.
    fn count(&self, turns: Turns, patterns: &[u64]) -> (usize, usize) {
        let Turns { start, length, .. } = turns;
        let repeats = |turn: usize| {
            let at = start + turn * length;
            at + length <= patterns.len() && patterns[at..at + length] == patterns[start..start + length]
        };
        if !(repeats(1) && repeats(2)) {
            return (1, start + 1);
        }
        if let Err(operation) = self.entries(turns) {
            return (1, start + operation + 1);
        }
        if self.pointers(turns) > POINTERS {
            return (1, start + 1);
        }
        let mut turn = 3;
        while repeats(turn) {
            if let Some(operation) = turns.first_read(|o, a| !self.continues(turns, turn, o, a)) {
                // next to be among the first three turns
                return (turn, start + (turn - 3) * length + operation + 1);
            }
            turn += 1;
        }
        (turn, start + 1)
    }

    /// Whether what a turn reads continues what turns 1 and 2 read.
    fn continues(&self, turns: Turns, turn: usize, o: usize, a: usize) -> bool {
        let [(x1, f1, k1), (x2, f2, k2), (x, f, k)] = [1, 2, turn].map(|i| self.origin(turns, i, o, a));
        let own = |of: Origin, k: usize, i: usize| self.is_own(of) && k == i;
        if own(f1, k1, 1) || own(f, k, turn) {
            return f == f1 && own(f1, k1, 1) && own(f, k, turn);
        }
        if f1 == Origin::Constant {
            return f == f1 && f2 == f1;
        }
        if x1 == x2 {
            return x == x1;
        }
        let steps = turn as isize - 1;
        f == f1 && f == f2 && f != Origin::Straight && k as isize - k1 as isize == steps * (k2 as isize - k1 as isize)
    }

    /// Results that the next turn reads, with what turn 0 reads in their stead; or the first operation by which the first
    /// turns are not alike.
    fn entries(&self, turns: Turns) -> Result<Vec<(usize, usize)>, usize> {
        let mut entries: Vec<(usize, usize)> = Vec::new();
        let unlike = turns.first_read(|o, a| {
            let [(x, ..), (_, f1, k1), (_, f2, k2)] = [0, 1, 2].map(|i| self.origin(turns, i, o, a));
            match f1 {
                Origin::Loop { operation, .. } if self.is_own(f1) && (k1, k2) == (0, 1) && f1 == f2 => {
                    match entries.iter().find(|entry| entry.0 == operation) {
                        Some(entry) => return entry.1 != x,
                        None => entries.push((operation, x)),
                    }
                    false
                }
                _ => !(self.continues(turns, 0, o, a) && self.continues(turns, 2, o, a)),
            }
        });
        unlike.map_or(Ok(entries), Err)
    }

    /// Whether this is the loop that is looked for.
    fn is_own(&self, of: Origin) -> bool {
        matches!(of, Origin::Loop { roll, .. } if roll == self.found.len())
    }

    /// A value that a turn reads: where it comes from, and its number there.
    fn origin(&self, turns: Turns, turn: usize, operation: usize, operand: usize) -> (usize, Origin, usize) {
        let x = turns.reads(turn, operation)[operand] as usize;
        if let Some(p) = turns.position[x].and_then(|p| (p as usize).checked_sub(turns.start)) {
            let of = Origin::Loop { roll: self.found.len(), operation: p % turns.length };
            return (x, of, p / turns.length);
        }
        if let Some([roll, turn, operation]) = self.members.get(x) {
            return (x, Origin::Loop { roll, operation }, turn);
        }
        let (of, k) = match self.values.sources[x] {
            Source::Input(k) => (Origin::Input, k),
            Source::Sine(k) => (Origin::Sine, k),
            Source::Constant(k) => (Origin::Constant, k),
            Source::Operation | Source::Array(_) => (Origin::Straight, 0),
        };
        (x, of, k)
    }

    /// Places that move by different steps, those of what is kept included.
    fn pointers(&self, turns: Turns) -> usize {
        let mut moving = vec![(2, 1)];
        turns.first_read(|o, a| {
            let [(x1, f1, k1), (x2, _, k2)] = [1, 2].map(|i| self.origin(turns, i, o, a));
            let step = k2 as isize - k1 as isize;
            let space = match f1 {
                Origin::Input => (0, step),
                Origin::Constant => (1, 1),
                _ => (2, step),
            };
            // constants of later turns may differ where those of the first ones do not
            let moves = (x1 != x2 || f1 == Origin::Constant) && !(self.is_own(f1) && k1 == 1);
            if moves && !moving.contains(&space) {
                moving.push(space);
            }
            false
        });
        moving.len()
    }

    fn accept(&mut self, turns: Turns, count: usize) {
        let operand = |o: usize, a: usize| {
            let [(x1, f1, k1), (x2, _, k2)] = [1, 2].map(|i| self.origin(turns, i, o, a));
            let step = k2 as isize - k1 as isize;
            match f1 {
                Origin::Loop { operation, .. } if self.is_own(f1) && k1 == 1 => Operand::Own(operation),
                Origin::Constant if (0..count).any(|i| self.origin(turns, i, o, a).0 != x1) => {
                    Operand::Table((0..count).map(|i| self.origin(turns, i, o, a).2).collect())
                }
                _ if x1 == x2 => Operand::Same(x1),
                of => Operand::Moving { of, first: k1 as isize - step, step },
            }
        };
        let of_turn = || turns.operations[turns.start..turns.start + turns.length].iter();
        let operands = of_turn().enumerate().map(|(o, x)| (0..x.reads().len()).map(|a| operand(o, a)).collect());
        let found = CodeLoop {
            count,
            codes: of_turn().map(|x| (x.code, x.exponent)).collect(),
            operands: operands.collect(),
            joined: vec![false; turns.length],
            entries: self.entries(turns).unwrap_or_default(),
            outputs: Vec::new(),
            pointers: self.pointers(turns),
        };
        let roll = self.found.len();
        self.found.push(found);
        for (p, x) in turns.operations[turns.start..turns.start + count * turns.length].iter().enumerate() {
            self.members.0[x.to()] = Some([roll, p / turns.length, p % turns.length].map(|i| i as u32));
        }
    }
}

impl Turns<'_> {
    fn reads(&self, turn: usize, operation: usize) -> &[u32] {
        self.operations[self.start + turn * self.length + operation].reads()
    }

    /// The first operation of a turn with an operand of which a condition holds.
    fn first_read(&self, mut asked: impl FnMut(usize, usize) -> bool) -> Option<usize> {
        (0..self.length).find(|&o| (0..self.reads(0, o).len()).any(|a| asked(o, a)))
    }

    /// How much later turns begin if the fewest values pass from one to the next.
    fn fewest_shared(&self) -> usize {
        // how far each result is read
        let mut until = vec![0; self.length];
        for o in 0..self.length {
            for &x in self.reads(1, o) {
                let at = self.start + self.length + o;
                if let Some(distance) = self.position[x as usize].and_then(|p| at.checked_sub(p as usize)) {
                    if (1..=self.length).contains(&distance) {
                        let by = (o + self.length - distance) % self.length;
                        until[by] = distance.max(until[by]);
                    }
                }
            }
        }
        let mut shared = vec![0; self.length];
        for (o, &until) in until.iter().enumerate() {
            (o + 1..=o + until).for_each(|at| shared[at % self.length] += 1);
        }
        (0..self.length).min_by_key(|&at| shared[at]).unwrap_or(0)
    }
}

/// An operation without what it reads from afar, as a number; a call is like no other.
fn pattern(x: &Operation, p: usize, position: &[Option<u32>]) -> u64 {
    let distance = |read: &u32| position[*read as usize].map_or(0, |q| p - q as usize);
    let near = x.reads().iter().map(distance).map(|distance| if distance <= NEAR { distance as u64 } else { 0 });
    let of_call = if x.is_call() { p as u64 + 1 } else { 0 };
    near.fold(of_call, |all, distance| all * (NEAR as u64 + 1) + distance) << 8 | x.code as u64
}

/// Where the patterns from each place on occur next.
fn repetitions(patterns: &[u64]) -> Vec<usize> {
    let mut next = vec![usize::MAX; patterns.len()];
    let mut latest = FxHashMap::default();
    for (p, window) in patterns.windows(WINDOW).enumerate().rev() {
        if let Some(later) = latest.insert(window, p) {
            next[p] = later;
        }
    }
    next
}

fn operations_of(stage: Vec<Item>) -> Vec<Operation> {
    let operation = |x| match x {
        Item::Operation(x) => Some(x),
        Item::Roll(_) => None,
    };
    stage.into_iter().filter_map(operation).collect()
}
