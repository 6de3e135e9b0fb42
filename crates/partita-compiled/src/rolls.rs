//! Operations that repeat, as loops.
//!
//! A mechanism of many equal parts is evaluated by the same operations for each of them, level by level. Code for all of
//! them one after the other is read from memory at every evaluation; a loop stays in the first cache.
//!
//! ```text
//! turn i      reads    inputs, sines, constants, arrays at place first + step · i,  or what is the same in every turn
//!             keeps    its values that others read: each has an array of its own, turn i at place i; outputs likewise
//! recursions  read     place i − 1; before turn 0 what comes in its stead, the entry, is copied there
//! ```
//!
//! The order of all operations stays as it is, so that the bits do; what is the same in every turn is computed once.

use crate::registers::first_two_commute;
use crate::turns::{self, Found, Members, Operand, Origin, Part};
use crate::values::{Item, Keep, Operation, Read, Roll, Source, Values, POINTERS};
use std::cmp::Reverse;
use std::collections::hash_map::Entry;
use std::collections::{BTreeMap, BinaryHeap, HashMap};

/// Make loops of what repeats. Constants that differ between turns are appended to `constants`.
pub(crate) fn roll(values: &mut Values, constants: &mut Vec<f64>) {
    let stages = std::mem::take(&mut values.operations);
    let (parts, mut found, mut members) = turns::search(values, stages);
    join_equal(&mut found, &mut members);
    for o in written(&mut found, &values.outputs, &members) {
        values.outputs[o] = None;
    }
    let (slots, arrays) = lay_out(values, &parts, &found, &members);
    for (x, source) in values.sources.iter_mut().enumerate() {
        if let Some([roll, turn, operation]) = members.get(x) {
            if let Some(first) = slots[roll][operation] {
                *source = Source::Array(first + turn);
            }
        }
    }
    values.arrays = arrays;
    let mut tables = Tables { constants, known: HashMap::new() };
    let mut rolls = found.iter().zip(&slots).map(|(found, own)| found.made(own, &slots, &mut tables));
    let mut item = |part| match part {
        Part::Straight(operation) => Some(Item::Operation(operation)),
        Part::Loop => rolls.next().map(|x| Item::Roll(Box::new(x))),
    };
    values.operations = parts.into_iter().map(|stage| stage.into_iter().filter_map(&mut item).collect()).collect();
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

/// Places of the arrays of each loop, for the operations whose results others read, and of how many numbers they are. What
/// is read no more gives its place to others.
fn lay_out(
    values: &Values,
    parts: &[Vec<Part>],
    found: &[Found],
    members: &Members,
) -> (Vec<Vec<Option<usize>>>, usize) {
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
                            Operand::Moving { of: Origin::Loop { roll, operation }, .. } => {
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
    let mut next = 0;
    // places by size, and those in use: last, size, place
    let mut free: HashMap<usize, Vec<usize>> = HashMap::new();
    let mut taken: BinaryHeap<Reverse<(usize, usize, usize)>> = BinaryHeap::new();
    let mut slots = Vec::with_capacity(found.len());
    for (roll, (last, found)) in last.iter().zip(found).enumerate() {
        while let Some(&Reverse((_, size, place))) = taken.peek().filter(|x| x.0 .0 <= roll) {
            free.entry(size).or_default().push(place);
            taken.pop();
        }
        // an odd number of lines of a cache: arrays that are read side by side lie in different sets
        let size = 8 * ((found.count + 1).div_ceil(8) | 1);
        let mut place = |last: usize| {
            let place = free.get_mut(&size).and_then(Vec::pop).unwrap_or_else(|| {
                next += size;
                next - size
            });
            taken.push(Reverse((last, size, place)));
            // after that of an entry
            place + 1
        };
        slots.push(last.iter().map(|last| last.map(&mut place)).collect());
    }
    (slots, next)
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

    /// With its arrays at `own`, those of all loops at `slots`.
    fn made(&self, own: &[Option<usize>], slots: &[Vec<Option<usize>>], tables: &mut Tables) -> Roll {
        let (mut inputs, mut reads) = (HashMap::<&Operand, usize>::new(), Vec::new());
        for operand in self.computed().flatten() {
            if matches!(operand, Operand::Own(_)) || inputs.contains_key(operand) {
                continue;
            }
            let Some(read) = operand.read(slots, tables) else { continue };
            inputs.insert(operand, reads.len());
            reads.push(read);
        }
        let operand = |x: &Operand| match x {
            Operand::Own(operation) => reads.len() + operation,
            other => inputs.get(other).copied().unwrap_or(0),
        };
        let all = self.codes.iter().zip(&self.operands).enumerate().filter(|x| !self.joined[x.0]);
        let operations = all.map(|(o, (&(code, exponent), operands))| {
            let mut all = [0; 3];
            all.iter_mut().zip(operands).for_each(|(to, x)| *to = operand(x) as u32);
            Item::Operation(Operation { code, operands: all, exponent, to: (reads.len() + o) as u32 })
        });
        let arrays = own.iter().enumerate().filter_map(|(o, place)| Some((o, Keep::Array((*place)?))));
        let outputs = self.outputs.iter().map(|&(o, first, step)| (o, Keep::Output { first, step }));
        let kept: Vec<(usize, Keep)> = arrays.chain(outputs).collect();
        let outputs = kept.iter().map(|(o, _)| reads.len() + o).collect();
        let body = Values::of_turn([reads.len(), self.codes.len()], operations.collect(), outputs);
        let entries = self.entries.iter().filter_map(|&(o, x)| Some((own[o]? - 1, x))).collect();
        Roll { count: self.count, keeps: kept.iter().map(|x| x.1).collect(), body, reads, entries }
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
    fn read(&self, slots: &[Vec<Option<usize>>], tables: &mut Tables) -> Option<Read> {
        Some(match self {
            Self::Own(_) => return None,
            Self::Same(x) => Read::Same(*x),
            Self::Table(which) => Read::Moving { first: Source::Constant(tables.place(which)), step: 1 },
            Self::Moving { of, first, step } => {
                let first = match of {
                    Origin::Input => Source::Input(*first as usize),
                    Origin::Sine => Source::Sine(*first as usize),
                    Origin::Loop { roll, operation } => {
                        Source::Array(slots[*roll][*operation]?.checked_add_signed(*first)?)
                    }
                    Origin::Constant | Origin::Straight => return None,
                };
                Read::Moving { first, step: *step }
            }
        })
    }
}
