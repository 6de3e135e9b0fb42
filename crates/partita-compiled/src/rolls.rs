//! Operations that repeat, as loops.
//!
//! A mechanism of many equal parts is evaluated by the same operations for each of them, level by level. Code for all of
//! them one after the other is read from memory at every evaluation; a loop stays in the first cache.
//!
//! ```text
//! turn i      reads    inputs, sines, constants, arrays at place first + step · i,  or what is the same in every turn
//!             keeps    its values that others read: each has an array of its own, turn i at place i
//! recursions  read     place i − 1; before turn 0 what comes in its stead, the entry, is copied there
//! ```
//!
//! The order of all operations stays as it is, so that the bits do.

use crate::values::{Item, Operation, Source, Values};
use partita_math::program::Code;
use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash, Hasher};

/// Operands at most that far belong to the pattern of an operation. Scale: operations.
const NEAR: usize = 64;
/// Operations by which places are found where a pattern may repeat.
const WINDOW: usize = 4;
/// Most operations of a turn, and how many lengths are tried at a place.
const LONGEST: usize = 512;
const TRIED: usize = 16;
/// Turns from which on a loop is made, and operations in all. Reason: a loop is entered and left in some ten cycles.
const FEWEST: usize = 8;
const SHORTEST: usize = 48;
/// Places that move by different steps in one loop. Reason: each takes a general register.
pub(crate) const POINTERS: usize = 8;

/// A loop.
pub(crate) struct Roll {
    pub(crate) count: usize,
    /// One turn: its inputs are what it reads, its outputs what it keeps.
    pub(crate) body: Values,
    pub(crate) reads: Vec<Read>,
    /// Place of each output of turn 0 among the arrays.
    pub(crate) keeps: Vec<usize>,
    /// Places among the arrays and the values that are copied there before.
    pub(crate) entries: Vec<(usize, usize)>,
}

/// Where an input of a turn lies.
#[derive(Clone, Copy)]
pub(crate) enum Read {
    /// A value, the same in every turn.
    Same(usize),
    /// At this place in turn 0, and a step further in each turn after.
    Moving { first: Source, step: isize },
}

/// A value, as far as turns are compared.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
enum Origin {
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
#[derive(Clone, PartialEq, Eq, Hash)]
enum Operand {
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
struct Found {
    count: usize,
    codes: Vec<(Code, usize)>,
    operands: Vec<Vec<Operand>>,
    /// Operations whose results the next turn reads, and what turn 0 reads in their stead.
    entries: Vec<(usize, usize)>,
}

struct Search<'v> {
    values: &'v Values,
    found: Vec<Found>,
    /// Loop, turn and operation of a value.
    member: HashMap<usize, (usize, usize, usize)>,
}

/// A turn that is looked at: operations `start..start + length` of a stage are turn 0.
#[derive(Clone, Copy)]
struct Turns<'o> {
    operations: &'o [Operation],
    /// Place of the first one among the values: results of a stage follow each other.
    position: &'o HashMap<usize, usize>,
    start: usize,
    length: usize,
}

/// Make loops of what repeats. Constants that differ between turns are appended to `constants`.
pub(crate) fn roll(values: &mut Values, constants: &mut Vec<f64>) {
    let stages = std::mem::take(&mut values.operations);
    let mut search = Search { values, found: Vec::new(), member: HashMap::new() };
    let parts: Vec<Vec<Part>> = stages.into_iter().map(|stage| search.stage(operations_of(stage))).collect();
    let Search { found, member, .. } = search;
    let (places, arrays) = lay_out(values, &parts, &found, &member);
    for (&x, &(roll, turn, operation)) in &member {
        if let Some(first) = places[roll][operation] {
            values.sources[x] = Source::Array(first + turn);
        }
    }
    values.arrays = arrays;
    let mut rolls = found.iter().zip(&places).map(|(found, own)| found.made(own, &places, constants));
    let mut item = |part| match part {
        Part::Straight(operation) => Some(Item::Operation(operation)),
        Part::Loop => rolls.next().map(Item::Roll),
    };
    values.operations = parts.into_iter().map(|stage| stage.into_iter().filter_map(&mut item).collect()).collect();
}

/// Part of a stage; loops are those that were found, in order.
enum Part {
    Straight(Operation),
    Loop,
}

fn operations_of(stage: Vec<Item>) -> Vec<Operation> {
    let operation = |x| match x {
        Item::Operation(x) => Some(x),
        Item::Roll(_) => None,
    };
    stage.into_iter().filter_map(operation).collect()
}

impl Search<'_> {
    fn stage(&mut self, operations: Vec<Operation>) -> Vec<Part> {
        let position: HashMap<usize, usize> = operations.iter().enumerate().map(|(p, x)| (x.to, p)).collect();
        let patterns: Vec<u64> = operations.iter().enumerate().map(|(p, x)| pattern(x, p, &position)).collect();
        let next = repetitions(&patterns);
        let (mut ends, mut p) = (Vec::new(), 0);
        while p < operations.len() {
            let turns = Turns { operations: &operations, position: &position, start: p, length: 0 };
            match self.best(turns, &patterns, &next) {
                Some((turns, count)) => {
                    let end = turns.start + count * turns.length;
                    self.accept(turns, count);
                    ends.push((turns.start, end));
                    p = end;
                }
                None => p += 1,
            }
        }
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
    fn best<'o>(&self, from: Turns<'o>, patterns: &[u64], next: &[usize]) -> Option<(Turns<'o>, usize)> {
        let mut at = from.start;
        let mut all: Vec<(Turns, usize)> = Vec::new();
        for _ in 0..TRIED {
            at = next[at];
            let length = at.saturating_sub(from.start);
            if at == usize::MAX || length > LONGEST {
                break;
            }
            let turns = Turns { length, ..from };
            let count = self.count(turns, patterns);
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
        let again = self.count(later, patterns);
        Some(if again + 1 >= count && again >= FEWEST { (later, again) } else { (turns, count) })
    }

    /// Turns that repeat the first one.
    fn count(&self, turns: Turns, patterns: &[u64]) -> usize {
        let Turns { start, length, .. } = turns;
        let repeats = |turn: usize| {
            let at = start + turn * length;
            at + length <= patterns.len() && patterns[at..at + length] == patterns[start..start + length]
        };
        if !(repeats(1) && repeats(2)) || self.pointers(turns) > POINTERS || self.entries(turns).is_none() {
            return 1;
        }
        (1..).find(|&turn| !(repeats(turn) && self.agrees(turns, turn))).unwrap_or(1)
    }

    /// Whether what a turn reads continues what turns 1 and 2 read.
    fn agrees(&self, turns: Turns, turn: usize) -> bool {
        turns.each_read(|o, a| self.continues(turns, turn, o, a))
    }

    /// The same of one operand.
    fn continues(&self, turns: Turns, turn: usize, o: usize, a: usize) -> bool {
        let [(x1, f1, k1), (x2, f2, k2), (x, f, k)] = [1, 2, turn].map(|i| self.origin(turns, i, o, a));
        let own = |of: Origin, k: usize, i: usize| self.is_own(of) && k == i;
        if own(f1, k1, 1) || own(f, k, turn) {
            return f == f1 && own(f1, k1, 1) && own(f, k, turn);
        }
        if x1 == x2 {
            return x == x1;
        }
        let steps = turn as isize - 1;
        f == f1
            && f == f2
            && match f {
                Origin::Straight => false,
                Origin::Constant => true,
                _ => k as isize - k1 as isize == steps * (k2 as isize - k1 as isize),
            }
    }

    /// Results that the next turn reads, with what turn 0 reads in their stead; none where turn 0 is not like the others.
    fn entries(&self, turns: Turns) -> Option<Vec<(usize, usize)>> {
        let mut entries: Vec<(usize, usize)> = Vec::new();
        let like = turns.each_read(|o, a| {
            let [(x, ..), (_, f1, k1), (_, f2, k2)] = [0, 1, 2].map(|i| self.origin(turns, i, o, a));
            match f1 {
                Origin::Loop { operation, .. } if self.is_own(f1) && (k1, k2) == (0, 1) && f1 == f2 => {
                    match entries.iter().find(|entry| entry.0 == operation) {
                        Some(entry) => return entry.1 == x,
                        None => entries.push((operation, x)),
                    }
                    true
                }
                _ => self.continues(turns, 0, o, a),
            }
        });
        like.then_some(entries)
    }
    /// Whether this is the loop that is looked for.
    fn is_own(&self, of: Origin) -> bool {
        matches!(of, Origin::Loop { roll, .. } if roll == self.found.len())
    }

    /// A value that a turn reads: where it comes from, and its number there.
    fn origin(&self, turns: Turns, turn: usize, operation: usize, operand: usize) -> (usize, Origin, usize) {
        let x = turns.reads(turn, operation)[operand];
        if let Some(p) = turns.position.get(&x).and_then(|p| p.checked_sub(turns.start)) {
            let of = Origin::Loop { roll: self.found.len(), operation: p % turns.length };
            return (x, of, p / turns.length);
        }
        if let Some(&(roll, turn, operation)) = self.member.get(&x) {
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
        turns.each_read(|o, a| {
            let [(x1, f1, k1), (x2, _, k2)] = [1, 2].map(|i| self.origin(turns, i, o, a));
            let step = k2 as isize - k1 as isize;
            let space = match f1 {
                Origin::Input => (0, step),
                Origin::Constant => (1, 1),
                _ => (2, step),
            };
            if x1 != x2 && !(self.is_own(f1) && k1 == 1) && !moving.contains(&space) {
                moving.push(space);
            }
            true
        });
        moving.len()
    }

    fn accept(&mut self, turns: Turns, count: usize) {
        let operand = |o: usize, a: usize| {
            let [(x1, f1, k1), (x2, _, k2)] = [1, 2].map(|i| self.origin(turns, i, o, a));
            let step = k2 as isize - k1 as isize;
            match f1 {
                Origin::Loop { operation, .. } if self.is_own(f1) && k1 == 1 => Operand::Own(operation),
                _ if x1 == x2 => Operand::Same(x1),
                Origin::Constant => Operand::Table((0..count).map(|i| self.origin(turns, i, o, a).2).collect()),
                of => Operand::Moving { of, first: k1 as isize - step, step },
            }
        };
        let of_turn = || turns.operations[turns.start..turns.start + turns.length].iter();
        let operands = of_turn().enumerate().map(|(o, x)| (0..x.reads().len()).map(|a| operand(o, a)).collect());
        let found = Found {
            count,
            codes: of_turn().map(|x| (x.code, x.exponent)).collect(),
            operands: operands.collect(),
            entries: self.entries(turns).unwrap_or_default(),
        };
        let roll = self.found.len();
        self.found.push(found);
        for (p, x) in turns.operations[turns.start..turns.start + count * turns.length].iter().enumerate() {
            self.member.insert(x.to, (roll, p / turns.length, p % turns.length));
        }
    }
}

impl Turns<'_> {
    fn reads(&self, turn: usize, operation: usize) -> &[usize] {
        self.operations[self.start + turn * self.length + operation].reads()
    }

    /// Whether a condition holds for every operand of every operation of a turn.
    fn each_read(&self, mut holds: impl FnMut(usize, usize) -> bool) -> bool {
        (0..self.length).all(|o| (0..self.reads(0, o).len()).all(|a| holds(o, a)))
    }

    /// How much later turns begin if the fewest values pass from one to the next.
    fn fewest_shared(&self) -> usize {
        // how far each result is read
        let mut reach = vec![0; self.length];
        for o in 0..self.length {
            for x in self.reads(1, o) {
                let at = self.start + self.length + o;
                if let Some(distance) = self.position.get(x).and_then(|p| at.checked_sub(*p)) {
                    if (1..=self.length).contains(&distance) {
                        let by = (o + self.length - distance) % self.length;
                        reach[by] = distance.max(reach[by]);
                    }
                }
            }
        }
        let mut shared = vec![0; self.length];
        for (o, &reach) in reach.iter().enumerate() {
            (o + 1..=o + reach).for_each(|at| shared[at % self.length] += 1);
        }
        (0..self.length).min_by_key(|&at| shared[at]).unwrap_or(0)
    }
}

/// An operation without what it reads from afar; a call is like no other.
fn pattern(x: &Operation, p: usize, position: &HashMap<usize, usize>) -> u64 {
    let mut hash = DefaultHasher::new();
    if x.is_call() {
        (usize::MAX, p).hash(&mut hash);
    }
    (x.code as u8).hash(&mut hash);
    for read in x.reads() {
        position.get(read).map(|q| p - q).filter(|distance| *distance <= NEAR).hash(&mut hash);
    }
    hash.finish()
}

/// Where the patterns from each place on occur next.
fn repetitions(patterns: &[u64]) -> Vec<usize> {
    let mut next = vec![usize::MAX; patterns.len()];
    let mut latest = HashMap::new();
    for (p, window) in patterns.windows(WINDOW).enumerate().rev() {
        if let Some(later) = latest.insert(window, p) {
            next[p] = later;
        }
    }
    next
}

/// Places of the arrays of each loop, for the operations whose results others read, and of how many numbers they are.
fn lay_out(
    values: &Values,
    parts: &[Vec<Part>],
    found: &[Found],
    member: &HashMap<usize, (usize, usize, usize)>,
) -> (Vec<Vec<Option<usize>>>, usize) {
    let mut read: Vec<Vec<bool>> = found.iter().map(|x| vec![false; x.codes.len()]).collect();
    let mut see = |x: &usize| {
        if let Some(&(roll, _, operation)) = member.get(x) {
            read[roll][operation] = true;
        }
    };
    for part in parts.iter().flatten() {
        if let Part::Straight(operation) = part {
            operation.reads().iter().for_each(&mut see);
        }
    }
    values.angles.iter().flatten().chain(&values.outputs).for_each(&mut see);
    found.iter().flat_map(|x| &x.entries).for_each(|(_, x)| see(x));
    let mut moving = Vec::new();
    for operand in found.iter().flat_map(|x| x.operands.iter().flatten()) {
        match operand {
            Operand::Same(x) => see(x),
            Operand::Moving { of: Origin::Loop { roll, operation }, .. } => moving.push((*roll, *operation)),
            _ => {}
        }
    }
    moving.into_iter().for_each(|(roll, operation)| read[roll][operation] = true);
    let mut next = 0;
    let mut place = |count: usize| {
        // after that of an entry
        let here = next + 1;
        // an odd number of lines of a cache: arrays that are read side by side lie in different sets
        next += 8 * ((count + 1).div_ceil(8) | 1);
        here
    };
    let places =
        read.iter().zip(found).map(|(read, found)| read.iter().map(|read| read.then(|| place(found.count))).collect());
    let places = places.collect();
    (places, next)
}

impl Found {
    /// With its arrays at `own`, those of all loops at `places`.
    fn made(&self, own: &[Option<usize>], places: &[Vec<Option<usize>>], constants: &mut Vec<f64>) -> Roll {
        let (mut inputs, mut reads) = (HashMap::<&Operand, usize>::new(), Vec::new());
        for operand in self.operands.iter().flatten() {
            if matches!(operand, Operand::Own(_)) || inputs.contains_key(operand) {
                continue;
            }
            let Some(read) = operand.read(places, constants) else { continue };
            inputs.insert(operand, reads.len());
            reads.push(read);
        }
        let operand = |x: &Operand| match x {
            Operand::Own(operation) => reads.len() + operation,
            other => inputs.get(other).copied().unwrap_or(0),
        };
        let operations = self.codes.iter().zip(&self.operands).enumerate().map(|(o, (&(code, exponent), operands))| {
            let mut all = [0; 3];
            all.iter_mut().zip(operands).for_each(|(to, x)| *to = operand(x));
            Item::Operation(Operation { code, operands: all, exponent, to: reads.len() + o })
        });
        let kept = || own.iter().enumerate().filter_map(|(o, place)| Some((o, (*place)?)));
        let outputs = kept().map(|(o, _)| reads.len() + o).collect();
        let body = Values::of_turn(reads.len(), operations.collect(), outputs);
        let entries = self.entries.iter().filter_map(|&(o, x)| Some((own[o]? - 1, x))).collect();
        Roll { count: self.count, keeps: kept().map(|x| x.1).collect(), body, reads, entries }
    }
}

impl Operand {
    /// Where it lies; the constants of a table are appended.
    fn read(&self, places: &[Vec<Option<usize>>], constants: &mut Vec<f64>) -> Option<Read> {
        Some(match self {
            Self::Own(_) => return None,
            Self::Same(x) => Read::Same(*x),
            Self::Table(which) => {
                let first = Source::Constant(constants.len());
                constants.extend(which.iter().map(|&k| constants[k]).collect::<Vec<_>>());
                Read::Moving { first, step: 1 }
            }
            Self::Moving { of, first, step } => {
                let first = match of {
                    Origin::Input => Source::Input(*first as usize),
                    Origin::Sine => Source::Sine(*first as usize),
                    Origin::Loop { roll, operation } => {
                        Source::Array(places[*roll][*operation]?.checked_add_signed(*first)?)
                    }
                    Origin::Constant | Origin::Straight => return None,
                };
                Read::Moving { first, step: *step }
            }
        })
    }
}
