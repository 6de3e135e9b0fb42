//! Where the results of loops lie that others read.

use crate::turns::{CodeLoop, Members, Operand, Origin, Part};
use crate::values::{Values, POINTERS};
use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

/// Results of a turn from which on they lie side by side. Scale: numbers; a line of a cache. Reason: a cache foresees few
/// places that move at a time, and some hundred arrays move in one loop.
const RECORD: usize = 8;

/// Memory in which places move.
#[derive(PartialEq, Eq)]
enum Space {
    Input,
    Constant,
    Output,
    Stack,
}

/// Where the results of a loop that others read lie.
pub(crate) struct Layout {
    /// Place of each operation's in turn 0.
    pub(crate) slots: Vec<Option<usize>>,
    /// How much further it is in each turn after.
    pub(crate) stride: usize,
    /// Place of each that the next turn reads: the same one in all turns.
    pub(crate) passed: Vec<Option<usize>>,
}

/// Layouts of all loops, and of how many numbers they are. What is read no more gives its place to others.
pub(crate) fn lay_out(
    values: &Values,
    parts: &[Vec<Part>],
    found: &[CodeLoop],
    members: &Members,
) -> (Vec<Layout>, usize) {
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
        let size = 8 * ((found.count * stride).div_ceil(8) | 1);
        let mut place = |last: usize| {
            let place = free.get_mut(&size).and_then(Vec::pop).unwrap_or_else(|| {
                next += size;
                next - size
            });
            taken.push(Reverse((last, size, place)));
            place
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
fn strides(found: &[CodeLoop], last: &[Vec<Option<usize>>]) -> Vec<usize> {
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

impl CodeLoop {
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
}
