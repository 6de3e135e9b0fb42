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

use crate::layout::{lay_out, Layout};
use crate::registers::first_two_commute;
use crate::turns::{self, CodeLoop, Members, Operand, Origin, Part};
use crate::values::{Item, Keep, Operation, Read, Roll, Source, Values, POINTERS};
use std::collections::hash_map::Entry;
use std::collections::{BTreeMap, HashMap};

/// Operations of turns that are computed together where each waits for the one before, and the most turns: an instruction
/// waits some cycles longer for what lies in memory than for a register.
const TOGETHER: usize = 256;
const MOST_TOGETHER: usize = 8;

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
    let mut stage = |parts: Vec<Part>| {
        let mut items = Vec::with_capacity(parts.len());
        for part in parts {
            match part {
                Part::Straight(operation) => items.push(Item::Operation(operation)),
                Part::Loop => items.extend(rolls.next().into_iter().flatten().map(|x| Item::Roll(Box::new(x)))),
            }
        }
        items
    };
    values.operations = parts.into_iter().map(&mut stage).collect();
}

/// Operations that compute the same in every turn, once. They may differ by turns in what each reads, and so are not
/// joined before: one that is equal by chance in some parts would make these unlike the others.
fn join_equal(found: &mut [CodeLoop], members: &mut Members) {
    let mut known = HashMap::new();
    let mut joined: Vec<Vec<Option<[usize; 2]>>> = found.iter().map(|x| vec![None; x.codes.len()]).collect();
    for roll in 0..found.len() {
        for operation in 0..found[roll].codes.len() {
            found[roll].operands[operation].iter_mut().for_each(|x| x.follow(roll, &joined));
            let CodeLoop { count, codes, operands, entries, .. } = &found[roll];
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
fn written(found: &mut [CodeLoop], outputs: &[Option<usize>], members: &Members) -> Vec<usize> {
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

impl CodeLoop {
    /// As number `roll` of all, with their results at `layouts`: several turns together where each one waits for the one
    /// before, so that most of what they wait for lies in registers; then those that are left.
    fn made(&self, roll: usize, layouts: &[Layout], tables: &mut Tables) -> Vec<Roll> {
        let operations = self.computed().count();
        let turns = if self.entries.is_empty() { 1 } else { (TOGETHER / operations.max(1)).clamp(2, MOST_TOGETHER) };
        let left = self.count % turns;
        let read = |x: &Operand, tables: &mut Tables| x.read(roll, layouts, tables);
        let reads: Vec<Option<Read>> = self.computed().flatten().map(|x| read(x, tables)).collect();
        let own = &layouts[roll];
        let mut all = vec![self.turns(0, [self.count / turns, turns], own, &reads)];
        all.extend((left > 0).then(|| self.turns(self.count - left, [1, left], own, &reads)));
        all
    }

    /// From a turn on, so many times so many turns together; `of_turn` is what each operand reads in turn 0, and none if that
    /// is of the turn itself.
    fn turns(&self, from: usize, turns: [usize; 2], own: &Layout, of_turn: &[Option<Read>]) -> Roll {
        let ([count, turns], length) = (turns, self.codes.len());
        let mut reads = Reads::default();
        let mut found = Vec::with_capacity(turns * length);
        for turn in 0..turns {
            let mut of_turn = of_turn.iter();
            for operands in self.computed() {
                let mut all = [None; 3];
                for (to, (operand, read)) in all.iter_mut().zip(operands.iter().zip(&mut of_turn)) {
                    *to = match (operand, read) {
                        (Operand::Own(operation), _) => Some(Taken::Result(turn * length + operation)),
                        // what the turn before has passed on
                        (
                            Operand::Moving { of: Origin::Loop { operation, .. }, .. },
                            Some(Read::Moving { step: 0, .. }),
                        ) if turn > 0 => Some(Taken::Result((turn - 1) * length + operation)),
                        (_, read) => read.map(|x| reads.take(x.together(from + turn, turns))),
                    };
                }
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

    /// Where it lies for loop `reader`; the constants of a table are appended.
    fn read(&self, reader: usize, layouts: &[Layout], tables: &mut Tables) -> Option<Read> {
        Some(match self {
            Self::Own(_) => return None,
            Self::Same(x) => Read::Same(*x),
            Self::Table(which) => Read::Moving { first: Source::Constant(tables.place(which)), step: 1 },
            Self::Moving { of, first, step } => match of {
                Origin::Input => Read::Moving { first: Source::Input(*first as usize), step: *step },
                Origin::Sine => Read::Moving { first: Source::Sine(*first as usize), step: *step },
                Origin::Loop { roll, operation } if *roll == reader => {
                    Read::Moving { first: Source::Array(layouts[*roll].passed[*operation]?), step: 0 }
                }
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
