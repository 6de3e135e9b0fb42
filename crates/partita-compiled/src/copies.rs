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
    let (first, rest) = copies.split_at_checked(length)?;
    let moves = |(one, later): (&Copy, &Copy)| Some([one.0.distance(later.0)?, one.1.distance(later.1)?]);
    let steps: Vec<[isize; 2]> = first.iter().zip(rest.get(..length)?).map(moves).collect::<Option<_>>()?;
    let mut pointers = Pointers::default();
    let mut turn = Vec::with_capacity(2 * length);
    for (&(from, to), &[a, b]) in first.iter().zip(&steps) {
        turn.extend([Step::Load(passing, pointers.place(from, a)), Step::Store(pointers.place(to, b), passing)]);
    }
    if pointers.0.len() > POINTERS {
        return None;
    }
    let follows = |(turn, later): (isize, &[Copy])| {
        let by = |(x, step): ((&Copy, &Copy), &[isize; 2])| moves(x) == Some(step.map(|step| turn * step));
        first.iter().zip(later).zip(&steps).all(by)
    };
    // turn by turn, so that what does not repeat is looked at in few of them
    let count = 1 + (1..).zip(rest.chunks_exact(length)).take_while(|turn| follows(*turn)).count();
    (count >= FEWEST).then_some((count * length, Step::Loop { count, pointers: pointers.0, turn }))
}

#[cfg(test)]
mod tests {
    use super::{steps, Address as A, Copy, Registers, Step};

    fn lengths(copies: &[Copy]) -> Vec<(usize, usize)> {
        let processor = Registers { held: 4, passing: 4, reads_memory: true, loops: true };
        let of = |step: Step| match step {
            Step::Loop { count, turn, .. } => (count, turn.len() / 2),
            _ => (1, 0),
        };
        steps(copies, processor).into_iter().map(of).collect()
    }

    #[test]
    fn copies_repeat_in_the_shortest_turns_that_cover_them() {
        let pair = |i: usize| [(A::Input(i), A::Output(2 * i)), (A::Stack(5 * i), A::Output(2 * i + 1))];
        let pairs: Vec<Copy> = (0..50).flat_map(pair).collect();
        assert_eq!(lengths(&pairs), [(50, 2)]);
        let plain: Vec<Copy> = (0..50).map(|i| (A::Input(i), A::Output(i))).collect();
        assert_eq!(lengths(&plain), [(50, 1)]);
        // seven turns are not worth a loop: a load and a store each
        assert_eq!(lengths(&pairs[..14]).len(), 28);
        let rest = [&pairs[..41], &[(A::Input(1000), A::Output(1))]].concat();
        assert_eq!(lengths(&rest), [vec![(20, 2)], vec![(1, 0); 4]].concat());
    }

    /// Every second copy repeats, the others do not: none is looked at again for each that comes before it.
    #[test]
    fn many_copies_that_do_not_repeat_become_steps_of_their_own() {
        let pair = |i: usize| [(A::Input(i), A::Output(2 * i)), (A::Stack(i * i), A::Output(2 * i + 1))];
        let copies: Vec<Copy> = (0..100_000).flat_map(pair).collect();
        assert_eq!(lengths(&copies).len(), 2 * copies.len());
    }
}
