//! The rates of a choice with their derivatives along eight directions, as a program in which each lane has a direction.

use super::legs::{Leg, Stride};
use super::parameters::Parameters;
use partita_math::program::{Program, Work};
use partita_math::scalar::Lanes;
use partita_model::carried::{Carried, CARRIED};
use partita_system::choice::OwnedChoice;
use partita_system::prelude::*;
use std::sync::Arc;

/// Steps of a choice from which on its rates are recorded. Unit: number. Reason: recording takes as long as the evaluations of
/// a few steps.
const WORTH_RECORDING: usize = 8;

/// A program of a choice, of t, q and v_I and their changes, parameters and theirs.
struct Recorded {
    choice: Arc<OwnedChoice>,
    program: Option<Arc<Program>>,
}

/// The programs of the choices of a leg.
pub struct Programs {
    all: Vec<Recorded>,
    parameters: Parameters,
}

/// A program at work along some directions.
pub struct Tangents {
    program: Arc<Program>,
    work: Work<Lanes, 1>,
    dim: usize,
}

impl Programs {
    /// Of a leg, for these parameters.
    pub fn new(leg: &Leg, parameters: Parameters) -> Self {
        let mut all: Vec<Recorded> = Vec::new();
        for stride in &leg.strides {
            if all.iter().any(|x| Arc::ptr_eq(&x.choice, &stride.choice)) {
                continue;
            }
            let count = leg.strides.iter().filter(|x| Arc::ptr_eq(&x.choice, &stride.choice)).count();
            let choice = stride.choice.choice();
            let moving = 1 + leg.model.size().nq + choice.k();
            // what cannot be recorded is evaluated with derivatives
            let recording = (count >= WORTH_RECORDING && !stride.taken.scheme.implicit)
                .then(|| leg.model.rates_recording(choice, &parameters.all).ok())
                .flatten();
            let program = recording.map(|recording| {
                let inputs = 2 * recording.inputs();
                Arc::new(Program::new(&recording.tangent(moving), 2 * moving..inputs))
            });
            all.push(Recorded { choice: stride.choice.clone(), program });
        }
        Self { all, parameters }
    }

    /// The program of a step along the directions from the `first` on, if there is one.
    pub fn of(&self, stride: &Stride, nq: usize, first: usize) -> Option<Tangents> {
        let known = self.all.iter().find(|x| Arc::ptr_eq(&x.choice, &stride.choice))?;
        let (program, dim) = (known.program.clone()?, nq + stride.choice.choice().k());
        let mut work = program.work::<Lanes, 1>();
        let (settled, count) = (2 * (1 + dim), self.parameters.values.len());
        for (i, x) in self.parameters.values.iter().enumerate() {
            for l in 0..CARRIED {
                work.set(settled + i, l, *x);
                let seed = self.parameters.seeds.get(first + l).map_or(0.0, |seed| seed[i]);
                work.set(settled + count + i, l, seed);
            }
        }
        work.prepare(&program);
        Some(Tangents { program, work, dim })
    }
}

impl Tangents {
    /// q' and v_I' at (t, y).
    pub fn slope(&mut self, t: f64, y: &[Carried]) -> Vec<Carried> {
        let moving = 1 + self.dim;
        let inputs = self.work.inputs(&self.program);
        inputs[0][0] = Lanes([t; Lanes::COUNT]);
        inputs[moving][0] = Lanes([0.0; Lanes::COUNT]);
        for (i, y) in y.iter().enumerate() {
            inputs[1 + i][0] = Lanes([y.re; Lanes::COUNT]);
            inputs[moving + 1 + i][0] = Lanes(y.eps);
        }
        self.work.evaluate(&self.program);
        let of = |o: usize| self.work.output(&self.program, o)[0].0;
        (0..self.dim).map(|i| Carried::new(of(i)[0], of(self.dim + i))).collect()
    }
}
