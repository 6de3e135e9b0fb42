//! What everything that executes a recording is held to: random ones, and one with every operation.

use partita_math::scalar::{Cases, Functions, Recorder, Recording, Scalar};
use std::ops::Range;

/// Something that executes recordings: outputs for each of these members.
pub type Executes = fn(&Recording, settled: Range<usize>, members: &[Vec<f64>]) -> Vec<Vec<f64>>;

fn recorded(r: &Recording, _: Range<usize>, members: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let mut work = vec![0.0; r.len()];
    let mut one = |x: &Vec<f64>| {
        let mut out = vec![0.0; r.outputs()];
        r.evaluate(x, &mut work, &mut out);
        out
    };
    members.iter().map(&mut one).collect()
}

/// All of them give the same bits, except for the sign of a zero.
pub fn agree(all: &[(&str, Executes)], r: &Recording, settled: Range<usize>, members: &[Vec<f64>]) {
    let expected = recorded(r, settled.clone(), members);
    for (name, execute) in all {
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
pub fn random_recording(inputs: usize, operations: usize, random: &mut fastrand::Rng) -> Recording {
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

/// Random recordings, as many members at a time as fill lanes or not.
pub fn have_the_same_bits(all: &[(&str, Executes)]) {
    let mut random = fastrand::Rng::with_seed(1);
    for round in 0..300 {
        let inputs = 1 + random.usize(0..5);
        let r = random_recording(inputs, 1 + random.usize(0..120), &mut random);
        let count = [1, 3, 8, 41][round % 4];
        let members: Vec<Vec<f64>> =
            (0..count).map(|_| (0..inputs).map(|_| 6.0 * (random.f64() - 0.5)).collect()).collect();
        let first = random.usize(0..=inputs);
        agree(all, &r, first..inputs, &members);
    }
}

/// One member has no influence on another.
pub fn keep_what_is_not_finite_apart(all: &[(&str, Executes)]) {
    let r = Recording::new(1, |x| Ok::<_, ()>(vec![x[0].sin_cos().0 / x[0], x[0].sqrt(), x[0].atan2(x[0])])).unwrap();
    let members: Vec<Vec<f64>> = [1.0, 0.0, -1.0, f64::NAN, f64::INFINITY, 2.0].iter().map(|x| vec![*x]).collect();
    agree(all, &r, 0..0, &members);
}
