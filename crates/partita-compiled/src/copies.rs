//! Copies from place to place, as loops where they repeat.

use crate::steps::{Address, Pointers, Register, Registers, Step};
use crate::values::POINTERS;
use std::cmp::Reverse;

/// Turns from which on a loop is made, and the most copies of a turn.
const FEWEST: usize = 8;
const LONGEST: usize = 16;

type Copy = (Address, Address);

/// Steps of copies, whose order means nothing.
pub(crate) fn steps(mut copies: &[Copy], processor: Registers) -> Vec<Step> {
    let passing = processor.passing;
    let mut steps = Vec::new();
    while let Some(&(from, to)) = copies.first() {
        let lengths = 1..=if processor.loops { LONGEST } else { 0 };
        let found = lengths.filter_map(|length| repeated(copies, length, passing));
        // the shorter turn of two that copy as much
        let (now, made) = match found.min_by_key(|(copies, _)| Reverse(*copies)) {
            Some((now, made)) => (now, vec![made]),
            None => (1, vec![Step::Load(passing, from), Step::Store(to, passing)]),
        };
        steps.extend(made);
        copies = &copies[now..];
    }
    steps
}

/// A loop of the first copies in turns of a length, and how many these are.
fn repeated(copies: &[Copy], length: usize, passing: Register) -> Option<(usize, Step)> {
    let mut pointers = Pointers::default();
    let (mut count, mut turn) = (usize::MAX, Vec::new());
    for i in 0..length.min(copies.len()) {
        let far = |turn: usize| {
            let (&(from, to), &(a, b)) = (&copies[i], copies.get(i + turn * length)?);
            Some((from.distance(a)?, to.distance(b)?))
        };
        let (a, b) = far(1)?;
        let follows = |turn: &usize| far(*turn) == Some((a * *turn as isize, b * *turn as isize));
        count = count.min(1 + (1..copies.len()).take_while(follows).count());
        turn.extend([
            Step::Load(passing, pointers.place(copies[i].0, a)),
            Step::Store(pointers.place(copies[i].1, b), passing),
        ]);
    }
    let suits = count >= FEWEST && pointers.0.len() <= POINTERS;
    let made = Step::Loop { count, pointers: pointers.0, turn };
    suits.then_some((count * length, made))
}
