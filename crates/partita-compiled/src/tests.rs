//! Compiled programs are held to what every execution is, and to allocate nothing.

#[path = "../../partita-tests/src/counting/mod.rs"]
#[allow(dead_code, reason = "bytes are counted for others")]
mod counting;
#[path = "../../partita-math/src/program/suite.rs"]
mod suite;

#[cfg(target_arch = "x86_64")]
use super::values::{Item, Keep};
use super::{Code, NATIVE};
use partita_math::program::{Compiled, Compiler, Program};
use partita_math::scalar::{Recorder, Recording, Scalar};
use std::ops::Range;
use suite::Executes;

fn compiled(r: &Recording, _: Range<usize>, members: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let code = code_of(r);
    members.iter().map(|x| outputs(&*code, r, x)).collect()
}

fn code_of(r: &Recording) -> Box<dyn Compiled> {
    NATIVE.compile(r.clone(), usize::MAX).unwrap().unwrap()
}

fn outputs(code: &dyn Compiled, r: &Recording, x: &[f64]) -> Vec<f64> {
    let mut out = vec![f64::NAN; r.outputs()];
    code.evaluate(x, &mut out, &mut vec![f64::NAN; code.memory()]);
    out
}

/// As for a processor without AVX.
#[cfg(target_arch = "x86_64")]
fn without_avx(r: &Recording, settled: Range<usize>, members: &[Vec<f64>]) -> Vec<Vec<f64>> {
    by_x86_64(r, settled, members, false, false)
}

/// Loops are made, however short the program is.
#[cfg(target_arch = "x86_64")]
fn in_loops(r: &Recording, settled: Range<usize>, members: &[Vec<f64>]) -> Vec<Vec<f64>> {
    by_x86_64(r, settled, members, std::arch::is_x86_feature_detected!("avx"), true)
}

#[cfg(target_arch = "x86_64")]
fn in_loops_without_avx(r: &Recording, settled: Range<usize>, members: &[Vec<f64>]) -> Vec<Vec<f64>> {
    by_x86_64(r, settled, members, false, true)
}

#[cfg(target_arch = "x86_64")]
fn by_x86_64(r: &Recording, settled: Range<usize>, members: &[Vec<f64>], avx: bool, loops: bool) -> Vec<Vec<f64>> {
    let program = if loops { Program::of_parts(r) } else { Program::new(r, settled) };
    let code = Code::new(super::for_x86_64(&program, avx, loops), &program).unwrap();
    members.iter().map(|x| outputs(&code, r, x)).collect()
}

#[cfg(target_arch = "x86_64")]
const ALL: [(&str, Executes); 4] = [
    ("compiled", compiled),
    ("compiled without AVX", without_avx),
    ("in loops", in_loops),
    ("in loops without AVX", in_loops_without_avx),
];
#[cfg(not(target_arch = "x86_64"))]
const ALL: [(&str, Executes); 1] = [("compiled", compiled)];

#[test]
fn compiled_programs_have_the_same_bits() {
    suite::have_the_same_bits(&ALL);
}

#[test]
fn compiled_programs_pass_on_what_is_not_finite() {
    suite::keep_what_is_not_finite_apart(&ALL);
}

/// Sines of sines: several calls, and many angles in one.
#[test]
fn sines_of_many_stages_have_the_same_bits() {
    for count in [1, 3, 4, 7, 8, 9, 20] {
        let r = Recording::new(count, |x| {
            let mut angles = x.to_vec();
            for _ in 0..3 {
                let all: Vec<_> = angles.iter().map(|x| x.sin_cos()).collect();
                angles = (0..count).map(|i| all[i].0 * x[i] + all[(i + 1) % count].1).collect();
            }
            Ok::<_, ()>(angles)
        });
        let members: Vec<Vec<f64>> =
            (0..5).map(|m| (0..count).map(|i| (m * count + i) as f64 * 0.7).collect()).collect();
        suite::agree(&ALL, &r.unwrap(), 0..0, &members);
    }
}

/// More values than registers at a time, further away than an instruction of one byte reaches, on more than one page.
#[test]
fn long_programs_have_the_same_bits() {
    let mut random = fastrand::Rng::with_seed(2);
    for operations in [1000, 4000, 16_000] {
        let r = suite::random_recording(4, operations, &mut random);
        suite::agree(&ALL, &r, 1..3, &[vec![0.3, -1.2, 2.5, 0.9], vec![-0.7, 0.1, 1.5, 2.2]]);
        let r = all_at_once(operations);
        suite::agree(&ALL, &r, 0..0, &[vec![0.3], vec![-1.7]]);
    }
}

/// A recursion along a chain and back, with a constant and inputs of each link, boundaries and a link unlike the others.
fn chain(links: usize, unlike: Option<usize>, random: &mut fastrand::Rng) -> Recording {
    let masses: Vec<f64> = (0..links).map(|_| 0.5 + random.f64()).collect();
    let of = |x: &[Recorder]| {
        let (angles, rest) = x.split_at(links);
        let (rates, given) = rest.split_at(links);
        let (mut angle, mut rate, mut place) = (given[0], given[1], [Recorder::zero(); 2]);
        let mut seen = Vec::new();
        for i in 0..links {
            angle += angles[i];
            rate += rates[i] * given[2];
            let (s, c) = angle.sin_cos();
            place = [place[0] + c.scale(masses[i]), place[1] + s * given[1]];
            if unlike == Some(i) {
                place[0] = place[0].atan2(place[1]) - rates[0];
            }
            seen.push((s, c, rate, place));
        }
        let (mut force, mut inertia) = ([Recorder::zero(); 2], given[3]);
        let mut out = vec![Recorder::zero(); 2 * links];
        for i in (0..links).rev() {
            let (s, c, rate, [x, y]) = seen[i];
            inertia = inertia.scale(masses[i]) + c * c / (Recorder::one() + x * x);
            force = [force[0] * c - force[1] * s + rate * rate, force[0] * s + force[1] * c - inertia * y];
            out[i] = (force[0] * x - force[1] * y) / inertia;
            out[2 * links - 1 - i] = rate;
        }
        out.extend([force[1], inertia, place[0]]);
        Ok::<_, ()>(out)
    };
    Recording::new(2 * links + 4, of).unwrap()
}

/// Turns that run together, and all numbers of those that are left.
#[cfg(target_arch = "x86_64")]
#[test]
fn turns_run_together_with_the_same_bits_however_many_are_left() {
    let mut random = fastrand::Rng::with_seed(7);
    for links in 60..70 {
        let input = |random: &mut fastrand::Rng| (0..2 * links + 4).map(|_| random.f64() - 0.5).collect();
        let members: Vec<Vec<f64>> = (0..2).map(|_| input(&mut random)).collect();
        suite::agree(&ALL, &chain(links, None, &mut random), 0..0, &members);
        let members: Vec<Vec<f64>> =
            (1..3).map(|m| (0..=links).map(|i| ((m * i + 1) as f64).sin()).collect()).collect();
        let r = many_results(links, 7);
        suite::agree(&ALL, &r, 0..0, &members);
        // what a turn passes on it keeps where it has read that of the one before: never in a turn that still reads it
        let program = Program::of_parts(&r);
        let mut values = super::Values::new(&program);
        super::rolls::roll(&mut values, &mut program.constants().to_vec());
        for item in values.operations.iter().flatten() {
            if let Item::Roll(roll) = item {
                let passes = roll.keeps.iter().any(|x| matches!(x, Keep::Array { step: 0, .. }));
                assert_eq!(passes, roll.count > 1, "{links} links: {} times", roll.count);
            }
        }
    }
}

/// Loops over links, forward and back, have the bits of straight code; they are short, and need no stack.
#[cfg(target_arch = "x86_64")]
#[test]
fn what_repeats_becomes_loops_with_the_same_bits() {
    let mut random = fastrand::Rng::with_seed(5);
    for (links, unlike) in
        [(3, None), (9, None), (12, Some(5)), (40, None), (41, Some(20)), (3000, None), (3000, Some(1700))]
    {
        let r = chain(links, unlike, &mut random);
        let members: Vec<Vec<f64>> = (0..3).map(|_| (0..2 * links + 4).map(|_| random.f64() - 0.5).collect()).collect();
        suite::agree(&ALL, &r, 0..0, &members);
        let program = Program::of_parts(&r);
        let length = |loops| super::for_x86_64(&program, true, loops).length;
        let (rolled, straight) = (length(true), length(false));
        if links >= 40 {
            let parts = 1 + usize::from(unlike.is_some());
            assert!(rolled < 600 * parts, "{links} links, {unlike:?}: {rolled} steps in loops, {straight} without");
        }
    }
}

/// Many results of each part: the next part reads them, and a later loop in the opposite order.
#[cfg(target_arch = "x86_64")]
fn many_results(parts: usize, results: usize) -> Recording {
    let of = |x: &[Recorder]| {
        let mut all = vec![vec![x[0] + x[1]; results]];
        for i in 0..parts {
            let before = &all[i];
            let of = |j: usize| before[j] * x[i] + before[(j + 1) % results].scale(0.5) - x[i + 1];
            all.push((0..results).map(of).collect());
        }
        let (mut sum, mut out) = (x[2], Vec::new());
        for (i, own) in all.iter().enumerate().skip(1).rev() {
            sum = own.iter().zip(&all[i - 1]).fold(sum.scale(0.25), |sum, (a, b)| sum * *a - *b);
            out.push(sum);
        }
        Ok::<_, ()>(out)
    };
    Recording::new(parts + 1, of).unwrap()
}

/// From eight results on those of a turn lie side by side.
#[cfg(target_arch = "x86_64")]
#[test]
fn many_results_of_a_turn_lie_side_by_side_with_the_same_bits() {
    for (parts, results) in [(3, 9), (9, 8), (40, 6), (40, 8), (41, 12), (2000, 11)] {
        let r = many_results(parts, results);
        let members: Vec<Vec<f64>> =
            (1..3).map(|m| (0..=parts).map(|i| ((m * i + 1) as f64).sin()).collect()).collect();
        suite::agree(&ALL, &r, 0..0, &members);
        let program = Program::of_parts(&r);
        let mut values = super::Values::new(&program);
        super::rolls::roll(&mut values, &mut program.constants().to_vec());
        let steps = super::registers::steps(&values, super::x86_64::registers(true, true)).steps;
        // eight turns run together at most: arrays move by no more
        let side_by_side = steps.iter().any(|step| match step {
            super::steps::Step::Loop { pointers, .. } => pointers.iter().any(|x| x.step < -8),
            _ => false,
        });
        assert_eq!(side_by_side, parts >= 40 && results >= 8, "{parts} parts with {results} results");
    }
}

/// Parts with two lengths, each of which is a factor of the same sine, and of another one that the next part reads.
#[cfg(target_arch = "x86_64")]
fn two_lengths(parts: usize, second: impl Fn(usize, f64) -> f64) -> Recording {
    let of = |x: &[Recorder]| {
        let (mut sum, mut out) = (x[0], Vec::new());
        for (i, x) in x.iter().enumerate() {
            let (length, (s, c)) = (1.0 + (i as f64).sqrt(), x.sin_cos());
            let [a, b] = [length, second(i, length)].map(|length| [s.scale(length), c.scale(length)]);
            sum = (sum + a[0] * a[1]) / (Recorder::one() + b[0] * b[1] * sum);
            out.push(sum - a[1] * b[0]);
        }
        Ok::<_, ()>(out)
    };
    Recording::new(parts, of).unwrap()
}

/// Lengths of a drawing differ in last digits or do not: that makes no part unlike the others.
#[cfg(target_arch = "x86_64")]
#[test]
fn what_is_equal_by_chance_repeats_and_what_always_is_equal_is_computed_once() {
    const PARTS: usize = 3000;
    let steps = |second: fn(usize, f64) -> f64| {
        let r = two_lengths(PARTS, second);
        let members: Vec<Vec<f64>> = (1..3).map(|m| (0..PARTS).map(|i| ((m * i) as f64).cos()).collect()).collect();
        suite::agree(&ALL, &r, 0..0, &members);
        super::for_x86_64(&Program::of_parts(&r), true, true).length
    };
    let never = steps(|_, length| length * (1.0 + f64::EPSILON));
    let by_chance = steps(|i, length| if i * i % 7 < 3 { length } else { length * (1.0 + f64::EPSILON) });
    let always = steps(|_, length| length);
    let all = [always, by_chance, never];
    assert!(
        always + 2 <= by_chance.min(never) && by_chance.max(never) < 300,
        "always, by chance, never equal: {all:?} steps"
    );
}

/// All terms are needed at once, in the opposite order.
fn all_at_once(terms: usize) -> Recording {
    let of = |x: &[Recorder]| {
        let all: Vec<_> = (1..=terms).map(|i| x[0].scale(i as f64).sqrt() - x[0]).collect();
        Ok::<_, ()>(vec![all.iter().rev().fold(Recorder::zero(), |sum, y| y.scale(0.9) - sum)])
    };
    Recording::new(1, of).unwrap()
}

/// Whatever processor this is.
#[test]
fn programs_become_instructions_of_64_bit_arm() {
    let mut random = fastrand::Rng::with_seed(3);
    for operations in [1, 10, 100, 1000, 10_000] {
        let r = suite::random_recording(3, operations, &mut random);
        let program = Program::new(&r, 0..0);
        let super::Assembled { bytes, constants, .. } = super::for_aarch64(&program).unwrap();
        assert_eq!(constants.len(), program.constants().len() + program.exponents().len());
        assert!(bytes.len() % 4 == 0 && bytes.len() / 4 >= program.len() + program.outputs());
        assert_eq!(bytes[bytes.len() - 4..], 0xd65f_03c0_u32.to_le_bytes());
    }
}

#[test]
fn what_does_not_fit_on_the_stack_is_refused() {
    let program = Program::new(&all_at_once(33_000), 0..0);
    let refused = super::for_aarch64(&program).err().unwrap();
    assert!(refused.0.contains("on the stack, and 32768 may lie there"), "{refused}");
}

/// The outputs of a square root.
fn root() -> Box<dyn Compiled> {
    let r = Recording::new(1, |x| Ok::<_, ()>(vec![x[0].sqrt(), Recorder::one()])).unwrap();
    code_of(&r)
}

#[test]
#[should_panic(expected = "numbers of inputs and outputs")]
fn other_numbers_of_outputs_are_refused() {
    root().evaluate(&[2.0], &mut [0.0], &mut []);
}

#[test]
#[should_panic(expected = "numbers of inputs and outputs")]
fn other_numbers_of_inputs_are_refused() {
    root().evaluate(&[], &mut [0.0; 2], &mut []);
}

#[test]
fn a_call_allocates_nothing() {
    let r = Recording::new(9, |x| {
        let sum = x.iter().fold(Recorder::zero(), |sum, x| sum + x.sin_cos().0 * x.atan2(x.sqrt()).power(1.5));
        Ok::<_, ()>(vec![sum, sum.sin_cos().1])
    });
    let code = code_of(&r.unwrap());
    let mut out = [0.0; 2];
    code.evaluate(&[0.5; 9], &mut out, &mut []);
    let ((), count) = counting::allocations(|| code.evaluate(&[0.7; 9], &mut out, &mut []));
    assert_eq!(count, 0);
}

#[test]
fn threads_share_a_compiled_program() {
    let code = root();
    std::thread::scope(|threads| {
        for x in [1.0, 2.0, 3.0] {
            let code = &code;
            threads.spawn(move || {
                let mut out = [0.0; 2];
                for _ in 0..1000 {
                    code.evaluate(&[x], &mut out, &mut []);
                    assert_eq!(out, [x.sqrt(), 1.0]);
                }
            });
        }
    });
}

/// Bytes of executable memory without a file.
#[cfg(target_os = "linux")]
fn executable() -> usize {
    let maps = std::fs::read_to_string("/proc/self/maps").unwrap();
    let anonymous = maps.lines().map(|line| line.split_whitespace().collect::<Vec<_>>()).filter(|x| x.len() == 5);
    let size = |x: Vec<&str>| {
        let ends: Vec<usize> = x[0].split('-').map(|end| usize::from_str_radix(end, 16).unwrap()).collect();
        if x[1].contains('x') {
            ends[1] - ends[0]
        } else {
            0
        }
    };
    anonymous.map(size).sum()
}

#[cfg(target_os = "linux")]
#[test]
fn compiled_programs_give_their_memory_back() {
    const COUNT: usize = 400;
    const PAGE: usize = 4096;
    let before = executable();
    let kept: Vec<_> = (0..COUNT).map(|_| root()).collect();
    let while_kept = executable();
    drop(kept);
    let after = executable();
    // other tests compile some at the same time
    assert!(while_kept >= before + COUNT * PAGE / 2, "{while_kept} bytes are executable, {before} before");
    assert!(after < before + COUNT * PAGE / 4, "{after} bytes are executable, {before} before");
}
