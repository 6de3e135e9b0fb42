//! One suite for everything that executes a recording: random ones, and one with every operation.

use super::*;
use crate::scalar::{Cases, Functions, Recorder};

/// Something that executes recordings: outputs for each of these members.
type Executes = fn(&Recording, settled: Range<usize>, members: &[Vec<f64>]) -> Vec<Vec<f64>>;

fn recorded(r: &Recording, _: Range<usize>, members: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let mut work = vec![0.0; r.len()];
    let mut one = |x: &Vec<f64>| {
        let mut out = vec![0.0; r.outputs()];
        r.evaluate(x, &mut work, &mut out);
        out
    };
    members.iter().map(&mut one).collect()
}

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

const ALL: [(&str, Executes); 5] = [
    ("recording", recorded),
    ("program, one by one", one_by_one),
    ("program, 8 lanes", in_lanes::<1>),
    ("program, 16 lanes", in_lanes::<2>),
    ("program, 32 lanes", in_lanes::<4>),
];

/// All of them give the same bits, except for the sign of a zero.
fn all_agree(r: &Recording, settled: Range<usize>, members: &[Vec<f64>]) {
    let expected = recorded(r, settled.clone(), members);
    for (name, execute) in ALL {
        let found = execute(r, settled.clone(), members);
        for (i, (x, y)) in found.iter().zip(&expected).enumerate() {
            for (o, (x, y)) in x.iter().zip(y).enumerate() {
                assert!(x == y || (x.is_nan() && y.is_nan()), "{name}: output {o} of member {i} is {x:e}, not {y:e}");
            }
        }
        assert_eq!(found.len(), members.len());
    }
}

/// A function of `inputs` numbers, built at random from everything that can be recorded.
fn random_recording(inputs: usize, operations: usize, random: &mut fastrand::Rng) -> Recording {
    Recording::new(inputs, |given| {
        let mut known: Vec<Recorder> = given.to_vec();
        known.push(Recorder::from_f64(random.f64()));
        for _ in 0..operations {
            let mut pick = || known[random.usize(known.len().saturating_sub(12)..known.len())];
            let (x, y, z) = (pick(), pick(), pick());
            let one = Recorder::one();
            let new = match random.u32(0..18) {
                0 | 1 => x + y * z,
                2 => x - y * z,
                3 => y * z - x,
                4 => x * y,
                5 => x / (one + y * y),
                6 => -x,
                7 => (x * x + one).sqrt(),
                8 => x.abs().min(one).power(1.5),
                9 => {
                    let (s, c) = x.sin_cos();
                    s * y + c
                }
                10 => x.sin_cos().1,
                11 => x.atan2(y),
                12 => x.hypot(y).min(one),
                13 => x.round() - x,
                14 => x.max(y),
                15 => x.where_positive(y, z),
                16 => x.over_or_zero(y - y.round()).max(-one).min(one),
                _ => {
                    let (start, row) = x.interval(&[-1.0, 0.0, 0.5], &[[1.0, 2.0, 0.0, 3.0], [0.5; 4], [-1.0; 4]]);
                    (row[0] * (x - start) + row[1]).scale(0.5)
                }
            };
            // moderate sizes
            known.push(new.max(Recorder::from_f64(-50.0)).min(Recorder::from_f64(50.0)));
        }
        let outputs = 1 + random.usize(0..6);
        let mut found: Vec<Recorder> = (0..outputs).map(|_| known[random.usize(0..known.len())]).collect();
        found.extend([known[known.len() - 1], Recorder::from_f64(7.0), given[0]]);
        Ok::<_, ()>(found)
    })
    .unwrap()
}

#[test]
fn every_execution_has_the_same_bits() {
    let mut random = fastrand::Rng::with_seed(1);
    for round in 0..300 {
        let inputs = 1 + random.usize(0..5);
        let r = random_recording(inputs, 1 + random.usize(0..120), &mut random);
        let count = [1, 3, 8, 41][round % 4];
        let members: Vec<Vec<f64>> =
            (0..count).map(|_| (0..inputs).map(|_| 6.0 * (random.f64() - 0.5)).collect()).collect();
        let first = random.usize(0..=inputs);
        all_agree(&r, first..inputs, &members);
    }
}

#[test]
fn numbers_that_are_not_finite_stay_in_their_lane() {
    let r = Recording::new(1, |x| Ok::<_, ()>(vec![x[0].sin_cos().0 / x[0], x[0].sqrt(), x[0].atan2(x[0])])).unwrap();
    let members: Vec<Vec<f64>> = [1.0, 0.0, -1.0, f64::NAN, f64::INFINITY, 2.0].iter().map(|x| vec![*x]).collect();
    all_agree(&r, 0..0, &members);
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
    all_agree(&r, 1..3, &[vec![1.0, 2.0, 3.0], vec![0.1, 0.2, 0.3]]);
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
    all_agree(&r, 0..0, &[vec![0.7]]);
}
