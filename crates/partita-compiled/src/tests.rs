//! Compiled programs are held to what every execution is, and to allocate nothing.

#[path = "../../partita-tests/src/counting/mod.rs"]
#[allow(dead_code, reason = "bytes are counted for others")]
mod counting;
#[path = "../../partita-math/src/program/suite.rs"]
mod suite;

use super::CRANELIFT;
use partita_math::program::{Compiled, Compiler, Program};
use partita_math::scalar::{Recorder, Recording, Scalar};
use std::ops::Range;
use suite::Executes;

fn compiled(r: &Recording, settled: Range<usize>, members: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let code = CRANELIFT.compile(&Program::new(r, settled)).unwrap();
    let one = |x: &Vec<f64>| {
        let mut out = vec![f64::NAN; r.outputs()];
        code.evaluate(x, &mut out);
        out
    };
    members.iter().map(one).collect()
}

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

/// The outputs of a square root.
fn root() -> Box<dyn Compiled> {
    let r = Recording::new(1, |x| Ok::<_, ()>(vec![x[0].sqrt(), Recorder::one()])).unwrap();
    CRANELIFT.compile(&Program::new(&r, 0..0)).unwrap()
}

#[test]
#[should_panic(expected = "numbers of inputs and outputs")]
fn other_numbers_of_outputs_are_refused() {
    root().evaluate(&[2.0], &mut [0.0]);
}

#[test]
#[should_panic(expected = "numbers of inputs and outputs")]
fn other_numbers_of_inputs_are_refused() {
    root().evaluate(&[], &mut [0.0; 2]);
}

#[test]
fn a_call_allocates_nothing() {
    let r = Recording::new(9, |x| {
        let sum = x.iter().fold(Recorder::zero(), |sum, x| sum + x.sin_cos().0 * x.atan2(x.sqrt()).power(1.5));
        Ok::<_, ()>(vec![sum, sum.sin_cos().1])
    });
    let code = CRANELIFT.compile(&Program::new(&r.unwrap(), 0..0)).unwrap();
    let mut out = [0.0; 2];
    code.evaluate(&[0.5; 9], &mut out);
    let ((), count) = counting::allocations(|| code.evaluate(&[0.7; 9], &mut out));
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
                    code.evaluate(&[x], &mut out);
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
