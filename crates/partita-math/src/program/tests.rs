//! The executions of the core.

use super::suite::{self, agree, Executes};
use super::*;
use crate::scalar::Recorder;

fn one_by_one(r: &Recording, settled: Range<usize>, members: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let program = Program::new(r, settled);
    let mut work = program.work::<f64, 1>();
    let mut one = |x: &Vec<f64>| {
        (0..x.len()).for_each(|k| work.input(&program, k)[0] = x[k]);
        work.prepare(&program);
        work.evaluate(&program);
        (0..program.outputs()).map(|o| work.output(&program, o)[0]).collect()
    };
    members.iter().map(&mut one).collect()
}

fn in_lanes<const G: usize>(r: &Recording, settled: Range<usize>, members: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let program = Program::new(r, settled);
    let mut work = program.work::<Lanes, G>();
    let block = |members: &[Vec<f64>]| {
        for (i, x) in members.iter().enumerate() {
            x.iter().enumerate().for_each(|(k, x)| work.set(k, i, *x));
        }
        work.prepare(&program);
        // twice: an evaluation leaves nothing behind that the next one meets
        work.evaluate(&program);
        work.evaluate(&program);
        let outputs = |i| (0..program.outputs()).map(|o| work.get(&program, o, i)).collect();
        (0..members.len()).map(outputs).collect::<Vec<Vec<f64>>>()
    };
    members
        .chunks(G * Lanes::COUNT)
        .flat_map({
            let mut block = block;
            move |x| block(x)
        })
        .collect()
}

const ALL: [(&str, Executes); 4] = [
    ("program, one by one", one_by_one),
    ("program, 8 lanes", in_lanes::<1>),
    ("program, 16 lanes", in_lanes::<2>),
    ("program, 32 lanes", in_lanes::<4>),
];

#[test]
fn every_execution_has_the_same_bits() {
    suite::have_the_same_bits(&ALL);
}

#[test]
fn numbers_that_are_not_finite_stay_in_their_lane() {
    suite::keep_what_is_not_finite_apart(&ALL);
}

#[test]
fn settled_inputs_are_computed_with_once() {
    let r = Recording::new(3, |x| {
        let (s, c) = x[1].sin_cos();
        Ok::<_, ()>(vec![s * x[0] + c * x[2].sqrt(), x[2].sqrt()])
    })
    .unwrap();
    let program = Program::new(&r, 1..3);
    // one product and sum, c sqrt being settled
    assert_eq!((program.len(), program.prepare.len()), (1, 3));
    agree(&ALL, &r, 1..3, &[vec![1.0, 2.0, 3.0], vec![0.1, 0.2, 0.3]]);
}

#[test]
fn registers_are_used_again() {
    let r = Recording::new(1, |x| {
        let mut y = x[0];
        for k in 0..1000 {
            y = (y + Recorder::from_f64(f64::from(k % 3) + 0.5)).sqrt() * x[0];
        }
        Ok::<_, ()>(vec![y])
    })
    .unwrap();
    let program = Program::new(&r, 0..0);
    assert!(program.registers <= 7, "{}", program.registers);
    agree(&ALL, &r, 0..0, &[vec![0.7]]);
}
