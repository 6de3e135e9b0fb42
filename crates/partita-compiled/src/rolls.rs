//! Operations that repeat, as loops.
//!
//! A mechanism of many equal parts is evaluated by the same operations for each of them, level by level. Code for all of
//! them one after the other is read from memory at every evaluation; a loop stays in the first cache.
//!
//! ```text
//! turn i      reads    inputs, sines, constants, arrays at place first + step · i,  or what is the same in every turn
//!             keeps    its values that others read: side by side, those of turn i in record i; or in an array each
//! recursions  run      several turns together, the last of which passes on what the next turn reads, at the same place
//!                      each time; before turn 0 what comes in its stead, the entry, is copied there
//! ```
//!
//! The order of all operations stays as it is, so that the bits do; what is the same in every turn is computed once.

use crate::registers::first_two_commute;
use crate::turns::{self, Found, Members, Operand, Origin, Part};
use crate::values::{Item, Keep, Operation, Read, Roll, Source, Values, POINTERS};
use std::cmp::Reverse;
use std::collections::hash_map::Entry;
use std::collections::{BTreeMap, BinaryHeap, HashMap};

/// Results of a turn from which on they lie side by side. Scale: numbers; a line of a cache. Reason: a cache foresees few
/// places that move at a time, and some hundred arrays move in one loop.
const RECORD: usize = 8;

/// Operations of turns that are computed together where each waits for the one before, and the most turns: an instruction
/// waits some cycles longer for what lies in memory than for a register.
const TOGETHER: usize = 256;
const MOST_TOGETHER: usize = 8;

/// Memory in which places move.
#[derive(PartialEq, Eq)]
enum Space {
    Input,
    Constant,
    Output,
    Stack,
}

/// Make loops of what repeats. Constants that differ between turns are appended to `constants`.
pub(crate) fn roll(values: &mut Values, constants: &mut Vec<f64>) {
    let stages = std::mem::take(&mut values.operations);
    let (parts, mut found, mut members) = turns::search(values, stages);
    join_equal(&mut found, &mut members);
    for o in written(&mut found, &values.outputs, &members) {
        values.outputs[o] = None;
    }
    let (layouts, arrays) = lay_out(values, &parts, &found, &members);
    for (x, source) in values.sources.iter_mut().enumerate() {
        if let Some([roll, turn, operation]) = members.get(x) {
            let layout = &layouts[roll];
            if let Some(first) = layout.slots[operation] {
                *source = Source::Array(first + turn * layout.stride);
            }
        }
    }
    values.arrays = arrays;
    let mut tables = Tables { constants, known: HashMap::new() };
    let mut rolls = found.iter().enumerate().map(|(roll, found)| found.made(roll, &layouts, &mut tables));
    let mut items = |part| match part {
        Part::Straight(operation) => vec![Item::Operation(operation)],
        Part::Loop => rolls.next().into_iter().flatten().map(|x| Item::Roll(Box::new(x))).collect(),
    };
    values.operations = parts.into_iter().map(|stage| stage.into_iter().flat_map(&mut items).collect()).collect();
}

/// Operations that compute the same in every turn, once. They may differ by turns in what each reads, and so are not
/// joined before: one that is equal by chance in some parts would make these unlike the others.
fn join_equal(found: &mut [Found], members: &mut Members) {
    let mut known = HashMap::new();
    let mut joined: Vec<Vec<Option<[usize; 2]>>> = found.iter().map(|x| vec![None; x.codes.len()]).collect();
    for roll in 0..found.len() {
        for operation in 0..found[roll].codes.len() {
            found[roll].operands[operation].iter_mut().for_each(|x| x.follow(roll, &joined));
            let Found { count, codes, operands, entries, .. } = &found[roll];
            // before its turn 0 lies what another one has not
            let stays = entries.iter().any(|entry| entry.0 == operation);
            let code = codes[operation].0;
            let of_all = |x: &Operand| match x {
                Operand::Own(operation) => {
                    Operand::Moving { of: Origin::Loop { roll, operation: *operation }, first: 0, step: 1 }
                }
                other => other.clone(),
            };
            let mut reads: Vec<Operand> = operands[operation].iter().map(of_all).collect();
            if first_two_commute(code) && reads[1] < reads[0] {
                reads.swap(0, 1);
            }
            let key = (*count, code as u8, codes[operation].1, reads);
            match known.entry(key) {
                Entry::Occupied(first) if !stays => joined[roll][operation] = Some(*first.get()),
                Entry::Occupied(_) => {}
                Entry::Vacant(place) => {
                    place.insert([roll, operation]);
                }
            }
        }
    }
    // those that were read before they were joined
    for (roll, found) in found.iter_mut().enumerate() {
        found.operands.iter_mut().flatten().for_each(|x| x.follow(roll, &joined));
        found.joined = joined[roll].iter().map(Option::is_some).collect();
    }
    for [roll, _, operation] in members.0.iter_mut().flatten() {
        if let Some(first) = joined[*roll as usize][*operation as usize] {
            [*roll, *operation] = first.map(|i| i as u32);
        }
    }
}

/// The outputs that loops write: one in each turn, a step further each time.
fn written(found: &mut [Found], outputs: &[Option<usize>], members: &Members) -> Vec<usize> {
    // by loops and operations: outputs in the order of the turns
    let mut of: BTreeMap<(usize, usize), Vec<(usize, usize)>> = BTreeMap::new();
    for (o, x) in outputs.iter().enumerate() {
        if let Some([roll, turn, operation]) = x.and_then(|x| members.get(x)) {
            of.entry((roll, operation)).or_default().push((turn, o));
        }
    }
    let mut all = Vec::new();
    for ((roll, operation), mut own) in of {
        let found = &mut found[roll];
        own.sort_unstable();
        let (first, step) = (own[0].1, own.get(1).map_or(0, |x| x.1 as isize - own[0].1 as isize));
        let follows = |(i, x): (usize, &(usize, usize))| x.0 == i && x.1 as isize == first as isize + i as isize * step;
        if own.len() != found.count || !own.iter().enumerate().all(follows) {
            continue;
        }
        let more = usize::from(found.outputs.iter().all(|x| x.2 != step));
        if found.pointers + more <= POINTERS {
            found.pointers += more;
            found.outputs.push((operation, first, step));
            all.extend(own.iter().map(|x| x.1));
        }
    }
    all
}

/// Where the results of a loop that others read lie.
struct Layout {
    /// Place of each operation's in turn 0.
    slots: Vec<Option<usize>>,
    /// How much further it is in each turn after.
    stride: usize,
    /// Place of each that the next turn reads: the same one in all turns.
    passed: Vec<Option<usize>>,
}

/// Layouts of all loops, and of how many numbers they are. What is read no more gives its place to others.
fn lay_out(values: &Values, parts: &[Vec<Part>], found: &[Found], members: &Members) -> (Vec<Layout>, usize) {
    // number of loops begun when each result is read last
    let mut last: Vec<Vec<Option<usize>>> = found.iter().map(|x| vec![None; x.codes.len()]).collect();
    let see = |last: &mut Vec<Vec<Option<usize>>>, roll: usize, operation: usize, when: usize| {
        last[roll][operation] = last[roll][operation].max(Some(when));
    };
    let see_value = |last: &mut Vec<Vec<Option<usize>>>, x: usize, when: usize| {
        if let Some([roll, _, operation]) = members.get(x) {
            see(last, roll, operation, when);
        }
    };
    let mut begun = 0;
    for (parts, angles) in parts.iter().zip(&values.angles) {
        for part in parts {
            match part {
                Part::Straight(operation) => {
                    operation.reads().iter().for_each(|&x| see_value(&mut last, x as usize, begun))
                }
                Part::Loop => {
                    begun += 1;
                    found[begun - 1].entries.iter().for_each(|(_, x)| see_value(&mut last, *x, begun));
                    for operand in found[begun - 1].computed().flatten() {
                        match operand {
                            Operand::Same(x) => see_value(&mut last, *x, begun),
                            Operand::Moving { of: Origin::Loop { roll, operation }, .. } if *roll + 1 != begun => {
                                see(&mut last, *roll, *operation, begun);
                            }
                            _ => {}
                        }
                    }
                }
            }
        }
        angles.iter().for_each(|&x| see_value(&mut last, x, begun));
    }
    values.outputs.iter().flatten().for_each(|&x| see_value(&mut last, x, usize::MAX));
    let strides = strides(found, &last);
    let mut next = 0;
    // places by size, and those in use: last, size, place
    let mut free: HashMap<usize, Vec<usize>> = HashMap::new();
    let mut taken: BinaryHeap<Reverse<(usize, usize, usize)>> = BinaryHeap::new();
    let mut layouts = Vec::with_capacity(found.len());
    for (roll, ((last, found), &stride)) in last.iter().zip(found).zip(&strides).enumerate() {
        while let Some(&Reverse((_, size, place))) = taken.peek().filter(|x| x.0 .0 <= roll) {
            free.entry(size).or_default().push(place);
            taken.pop();
        }
        // an odd number of lines of a cache: arrays that are read side by side lie in different sets
        let size = 8 * (((found.count + 1) * stride).div_ceil(8) | 1);
        let mut place = |last: usize| {
            let place = free.get_mut(&size).and_then(Vec::pop).unwrap_or_else(|| {
                next += size;
                next - size
            });
            taken.push(Reverse((last, size, place)));
            // after that of an entry
            place + stride
        };
        let slots = if stride == 1 {
            last.iter().map(|last| last.map(&mut place)).collect()
        } else {
            let first = last.iter().flatten().max().map_or(0, |&last| place(last));
            let mut own = first..;
            last.iter().map(|last| last.and_then(|_| own.next())).collect()
        };
        let mut passed = vec![None; found.codes.len()];
        for (entry, place) in found.entries.iter().zip(next..) {
            passed[entry.0] = Some(place);
        }
        next += found.entries.len().next_multiple_of(8);
        layouts.push(Layout { slots, stride, passed });
    }
    (layouts, next)
}

/// How far results of a turn are from those of the next one: side by side with the other results of their turn where there
/// are many and the loops that read them have pointers enough; 1 where each has an array. `last`: when each is read last.
fn strides(found: &[Found], last: &[Vec<Option<usize>>]) -> Vec<usize> {
    let kept: Vec<usize> = last.iter().map(|last| last.iter().flatten().count()).collect();
    let mut strides = vec![1; found.len()];
    let mut readers: Vec<Vec<usize>> = (0..found.len()).map(|roll| vec![roll]).collect();
    for (reader, found) in found.iter().enumerate() {
        for operand in found.computed().flatten() {
            if let Operand::Moving { of: Origin::Loop { roll, .. }, .. } = operand {
                if readers[*roll].last() != Some(&reader) {
                    readers[*roll].push(reader);
                }
            }
        }
    }
    let mut many: Vec<usize> = (0..found.len()).filter(|&roll| kept[roll] >= RECORD).collect();
    many.sort_by_key(|&roll| Reverse(kept[roll]));
    for roll in many {
        strides[roll] = kept[roll];
        if readers[roll].iter().any(|&reader| found[reader].pointers_with(&strides, reader) > POINTERS) {
            strides[roll] = 1;
        }
    }
    strides
}

/// Constants, and where those of tables lie among them.
struct Tables<'c> {
    constants: &'c mut Vec<f64>,
    known: HashMap<Vec<usize>, usize>,
}

impl Tables<'_> {
    /// Place of the first one; they are appended where no other loop has the same ones.
    fn place(&mut self, which: &[usize]) -> usize {
        if let Some(known) = self.known.get(which) {
            return *known;
        }
        let first = self.constants.len();
        self.constants.extend(which.iter().map(|&k| self.constants[k]).collect::<Vec<_>>());
        self.known.insert(which.to_vec(), first);
        first
    }
}

impl Found {
    /// Operands of the operations that it computes.
    fn computed(&self) -> impl Iterator<Item = &Vec<Operand>> {
        self.operands.iter().zip(&self.joined).filter(|x| !x.1).map(|x| x.0)
    }

    /// Places that move by different steps, with these distances between turns; it is number `roll` of all.
    fn pointers_with(&self, strides: &[usize], roll: usize) -> usize {
        let mut moving = vec![(Space::Stack, strides[roll] as isize)];
        let of_outputs = self.outputs.iter().map(|x| (Space::Output, x.2));
        let read = self.computed().flatten().filter_map(|operand| match operand {
            Operand::Own(_) | Operand::Same(_) => None,
            Operand::Table(_) => Some((Space::Constant, 1)),
            Operand::Moving { of, step, .. } => Some(match of {
                Origin::Input => (Space::Input, *step),
                Origin::Loop { roll, .. } => (Space::Stack, *step * strides[*roll] as isize),
                _ => (Space::Stack, *step),
            }),
        });
        for x in of_outputs.chain(read) {
            if !moving.contains(&x) {
                moving.push(x);
            }
        }
        moving.len()
    }

    /// As number `roll` of all, with their results at `layouts`: several turns together where each one waits for the one
    /// before, so that most of what they wait for lies in registers; then those that are left.
    fn made(&self, roll: usize, layouts: &[Layout], tables: &mut Tables) -> Vec<Roll> {
        let operations = self.computed().count();
        let turns = if self.entries.is_empty() { 1 } else { (TOGETHER / operations.max(1)).clamp(2, MOST_TOGETHER) };
        let left = self.count % turns;
        let mut all = vec![self.turns(roll, 0, [self.count / turns, turns], layouts, tables)];
        all.extend((left > 0).then(|| self.turns(roll, self.count - left, [1, left], layouts, tables)));
        all
    }

    /// From a turn on, so many times so many turns together.
    fn turns(&self, roll: usize, from: usize, turns: [usize; 2], layouts: &[Layout], tables: &mut Tables) -> Roll {
        let ([count, turns], length, own) = (turns, self.codes.len(), &layouts[roll]);
        let mut reads = Reads::default();
        let mut found = Vec::with_capacity(turns * length);
        for turn in 0..turns {
            for operands in self.computed() {
                let mut take = |operand: &Operand| match *operand {
                    Operand::Own(operation) => Some(Taken::Result(turn * length + operation)),
                    Operand::Moving { of: Origin::Loop { roll: of, operation }, .. } if of == roll => match turn {
                        0 => own.passed[operation]
                            .map(|place| reads.take(Read::Moving { first: Source::Array(place), step: 0 })),
                        _ => Some(Taken::Result((turn - 1) * length + operation)),
                    },
                    _ => operand.read(layouts, tables).map(|x| reads.take(x.together(from + turn, turns))),
                };
                let mut all = [None; 3];
                all.iter_mut().zip(operands).for_each(|(to, x)| *to = take(x));
                found.push(all);
            }
        }
        let all = reads.all;
        let number = |taken: Option<Taken>| match taken {
            Some(Taken::Result(x)) => (all.len() + x) as u32,
            Some(Taken::Read(x)) => x as u32,
            None => 0,
        };
        let results = |turn: usize| all.len() + turn * length;
        let codes = || self.codes.iter().enumerate().filter(|x| !self.joined[x.0]);
        let each = (0..turns).flat_map(|turn| codes().map(move |(o, code)| (turn, o, *code)));
        let operations = each.zip(found).map(|((turn, o, (code, exponent)), operands)| {
            let to = (results(turn) + o) as u32;
            Item::Operation(Operation { code, operands: operands.map(number), exponent, to })
        });
        let known = |slots: &[Option<usize>]| -> Vec<(usize, usize)> {
            slots.iter().enumerate().filter_map(|(o, place)| Some((o, (*place)?))).collect()
        };
        let (slots, passed, step) = (known(&own.slots), known(&own.passed), own.stride);
        let mut kept: Vec<(usize, Keep)> = Vec::new();
        for turn in 0..turns {
            let at = from + turn;
            let to_array = |first: usize| Keep::Array { first: first + at * step, step: turns * step };
            kept.extend(slots.iter().map(|&(o, first)| (results(turn) + o, to_array(first))));
            let to_output = |first: usize, step: isize| Keep::Output {
                first: first.wrapping_add_signed(at as isize * step),
                step: turns as isize * step,
            };
            kept.extend(self.outputs.iter().map(|&(o, first, step)| (results(turn) + o, to_output(first, step))));
        }
        // no turn comes after those that are left
        let passed = passed.iter().filter(|_| from == 0);
        kept.extend(passed.map(|&(o, first)| (results(turns - 1) + o, Keep::Array { first, step: 0 })));
        let outputs = kept.iter().map(|x| x.0).collect();
        let entry = |&(o, x): &(usize, usize)| Some((own.passed[o]?, x));
        let entries = self.entries.iter().filter(|_| from == 0).filter_map(entry).collect();
        let body = Values::of_turn([all.len(), turns * length], operations.collect(), outputs);
        Roll { count, keeps: kept.iter().map(|x| x.1).collect(), body, reads: all, entries }
    }
}

/// An operand of turns that are computed together: a result of one of them, or one of what they read.
#[derive(Clone, Copy)]
enum Taken {
    Result(usize),
    Read(usize),
}

/// What turns read, each once.
#[derive(Default)]
struct Reads {
    all: Vec<Read>,
    known: HashMap<Read, usize>,
}

impl Reads {
    fn take(&mut self, read: Read) -> Taken {
        let number = *self.known.entry(read).or_insert(self.all.len());
        if number == self.all.len() {
            self.all.push(read);
        }
        Taken::Read(number)
    }
}

impl Read {
    /// From another turn on, and so many turns further each time.
    fn together(self, from: usize, turns: usize) -> Self {
        match self {
            Self::Same(x) => Self::Same(x),
            Self::Moving { first, step } => {
                Self::Moving { first: first.further(from as isize * step), step: turns as isize * step }
            }
        }
    }
}

impl Operand {
    /// What a loop reads, if that was joined with another operation.
    fn follow(&mut self, roll: usize, joined: &[Vec<Option<[usize; 2]>>]) {
        match self {
            Self::Own(own) => match joined[roll][*own] {
                Some([of, operation]) if of == roll => *own = operation,
                Some([roll, operation]) => {
                    *self = Self::Moving { of: Origin::Loop { roll, operation }, first: 0, step: 1 };
                }
                None => {}
            },
            Self::Moving { of: Origin::Loop { roll, operation }, .. } => {
                if let Some(first) = joined[*roll][*operation] {
                    [*roll, *operation] = first;
                }
            }
            Self::Same(_) | Self::Moving { .. } | Self::Table(_) => {}
        }
    }

    /// Where it lies; the constants of a table are appended.
    fn read(&self, layouts: &[Layout], tables: &mut Tables) -> Option<Read> {
        Some(match self {
            Self::Own(_) => return None,
            Self::Same(x) => Read::Same(*x),
            Self::Table(which) => Read::Moving { first: Source::Constant(tables.place(which)), step: 1 },
            Self::Moving { of, first, step } => match of {
                Origin::Input => Read::Moving { first: Source::Input(*first as usize), step: *step },
                Origin::Sine => Read::Moving { first: Source::Sine(*first as usize), step: *step },
                Origin::Loop { roll, operation } => {
                    let Layout { slots, stride, .. } = &layouts[*roll];
                    let first = slots[*operation]?.checked_add_signed(*first * *stride as isize)?;
                    Read::Moving { first: Source::Array(first), step: *step * *stride as isize }
                }
                Origin::Constant | Origin::Straight => return None,
            },
        })
    }
}
