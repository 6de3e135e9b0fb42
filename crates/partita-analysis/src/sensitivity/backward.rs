//! The derivatives of one number by many, backwards through the steps that were taken.
//!
//! ```text
//! k̄_i = h b_i ȳ + h Σ_j a_ji ȳ_j,   ȳ_j = f_yᵀ k̄_j,   p̄ += f_pᵀ k̄_j        explicit steps, from the last stage on
//! (1 − h a ⊗ J)ᵀ λ = h b ⊗ ȳ,       ȳ += Σ J_iᵀ λ_i                         implicit ones
//! ```
//!
//! What a step does is recorded once for each choice of coordinates and read backwards; the states where steps began are
//! those of the run. Instants and the start, of which there are few, are differentiated forwards and transposed.

use super::legs::{Instant, Leg, Stride};
use super::parameters::Parameters;
use super::retaken::{advanced_plain, Rates, State};
use super::{cross, start, stepping, Equations, Reader, SensitivityRequest};
use crate::error::AnalysisError;
use crate::outputs::Watch;
use partita_math::dense::{lu, lu_solve_transposed};
use partita_math::program::{Compiled, Compiler};
use partita_math::scalar::Recording;
use partita_model::carried::{Carried, CARRIED};
use partita_system::choice::OwnedChoice;
use partita_system::prelude::*;
use partita_system::SystemError;
use serde::Deserialize;
use std::sync::Arc;

/// Steps of one choice from which on what they do is compiled. Unit: number. Reason: recording and compiling a step takes as
/// long as some dozens of steps evaluated without.
const WORTH_COMPILING: usize = 60;
/// Longest code that is made. Scale: steps, those that repeat counted once. Reason: as of the rates of runs, which a gradient
/// is a few times as long as.
const LONGEST: usize = 1_000_000;

/// What is differentiated: a weighed sum of what is observed and of what is integrated.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Weights {
    /// Of each observable at each time.
    pub observables: Vec<Vec<f64>>,
    /// Of each integral.
    pub integrals: Vec<f64>,
}

/// A recording with its gradient, as code where that pays.
struct Piece {
    value: Recording,
    gradient: Recording,
    code: Option<[Box<dyn Compiled>; 2]>,
    work: Vec<f64>,
}

impl Piece {
    fn new(value: Recording, compiles: bool) -> Self {
        let gradient = value.gradient();
        let code = compiles.then(<dyn Compiler>::installed).flatten().and_then(|compiler| {
            let made = |recording: &Recording| compiler.compile(recording.clone(), LONGEST).ok().flatten();
            Some([made(&value)?, made(&gradient)?])
        });
        let of_code = code.iter().flatten().map(|x| x.memory()).max().unwrap_or(0);
        let work = vec![0.0; value.len().max(gradient.len()).max(of_code)];
        Self { value, gradient, code, work }
    }

    fn evaluate(&mut self, inputs: &[f64], out: &mut [f64]) {
        match &self.code {
            Some([value, _]) => value.evaluate(inputs, out, &mut self.work),
            None => self.value.evaluate(inputs, &mut self.work, out),
        }
    }

    /// The derivatives by the inputs of the outputs, each with its weight.
    fn pull(&mut self, inputs: &[f64], weights: &[f64]) -> Vec<f64> {
        let (all, mut out) = ([inputs, weights].concat(), vec![0.0; inputs.len()]);
        match &self.code {
            Some([_, gradient]) => gradient.evaluate(&all, &mut out, &mut self.work),
            None => self.gradient.evaluate(&all, &mut self.work, &mut out),
        }
        out
    }
}

/// What a step of a choice does.
struct Pieces {
    choice: Arc<OwnedChoice>,
    rates: Piece,
    end: Piece,
    integrands: Option<Piece>,
}

/// Derivatives by a state and by the numbers of parameters.
struct Back {
    q: Vec<f64>,
    v: Vec<f64>,
    p: Vec<f64>,
}

fn add(to: &mut [f64], x: &[f64]) {
    to.iter_mut().zip(x).for_each(|(to, x)| *to += x);
}

/// The derivatives along the directions of what is weighed.
///
/// # Errors
/// Where something has no derivative, or cannot be recorded.
pub fn backward(
    legs: &[Leg],
    asked: &SensitivityRequest,
    weights: &Weights,
    watch: Watch,
) -> Result<Vec<f64>, AnalysisError> {
    let filled = stepping(legs);
    let Some(&first) = filled.first() else { return Ok(vec![0.0; asked.directions.len()]) };
    let parameters = Parameters::new(&legs[first], &asked.directions)?;
    let size = legs[first].model.size();
    let mut back = Back { q: vec![0.0; size.nq], v: vec![0.0; size.nv], p: vec![0.0; parameters.values.len()] };
    for (place, &i) in filled.iter().enumerate().rev() {
        watch()?;
        if let Some(&next) = filled.get(place + 1) {
            back = through(legs, (i, next), &parameters, (asked, weights), back)?;
        }
        leg_back(&legs[i], &parameters, (asked, weights), &mut back, &mut *watch)?;
    }
    // the start
    let mut out = Vec::with_capacity(asked.directions.len());
    for chunk in asked.directions.chunks(CARRIED) {
        let leg = &legs[first];
        let equations = Equations::new(leg, chunk)?;
        let [rates, _] = equations.rates(leg);
        let state = start::started(leg, (&equations.own[0], &rates), &asked.held, chunk)?;
        for l in 0..chunk.len() {
            let dot = |x: &[Carried], y: &[f64]| x.iter().zip(y).map(|(x, y)| x.eps[l] * y).sum::<f64>();
            out.push(dot(&state.q, &back.q) + dot(&state.v, &back.v));
        }
    }
    for (out, seed) in out.iter_mut().zip(&parameters.seeds) {
        *out += seed.iter().zip(&back.p).map(|(x, y)| x * y).sum::<f64>();
    }
    Ok(out)
}

/// Through what happens between two legs, transposed.
fn through(
    legs: &[Leg],
    (from, to): (usize, usize),
    parameters: &Parameters,
    (asked, weights): (&SensitivityRequest, &Weights),
    after: Back,
) -> Result<Back, AnalysisError> {
    let (nq, nv) = (after.q.len(), after.v.len());
    let end = State::constant(&legs[from].end);
    let mut before = Back { q: vec![0.0; nq], v: vec![0.0; nv], p: after.p.clone() };
    let part = legs.get(from..=to).unwrap_or_default();
    let column = |equations: &[Equations], at: State| -> Result<[f64; CARRIED], AnalysisError> {
        let crossed = cross(part, equations, (0, part.len() - 1), at, &asked.integrals)?;
        let lost: f64 = crossed.lost.iter().zip(&weights.integrals).map(|(x, w)| x * w).sum();
        Ok(std::array::from_fn(|l| {
            let dot = |x: &[Carried], y: &[f64]| x.iter().zip(y).map(|(x, y)| x.eps[l] * y).sum::<f64>();
            dot(&crossed.state.q, &after.q) + dot(&crossed.state.v, &after.v) + lost * crossed.shift[l]
        }))
    };
    let plain = part.iter().map(|leg| Equations::new(leg, &[])).collect::<Result<Vec<_>, _>>()?;
    for first in (0..nq + nv).step_by(CARRIED) {
        let (mut at, last) = (end.clone(), (nq + nv).min(first + CARRIED));
        for j in first..last {
            let seed = if j < nq { &mut at.q[j] } else { &mut at.v[j - nq] };
            seed.eps[j - first] = 1.0;
        }
        let found = column(&plain, at)?;
        for j in first..last {
            *(if j < nq { &mut before.q[j] } else { &mut before.v[j - nq] }) = found[j - first];
        }
    }
    for (chunk, units) in parameters.units().iter().enumerate() {
        let equations = part.iter().map(|leg| Equations::new(leg, units)).collect::<Result<Vec<_>, _>>()?;
        let found = column(&equations, end.clone())?;
        let first = chunk * CARRIED;
        (0..units.len()).for_each(|l| before.p[first + l] += found[l]);
    }
    Ok(before)
}

/// Through the steps of a leg.
fn leg_back(
    leg: &Leg,
    parameters: &Parameters,
    (asked, weights): (&SensitivityRequest, &Weights),
    back: &mut Back,
    watch: Watch,
) -> Result<(), AnalysisError> {
    let plain = Equations::new(leg, &[])?;
    let mut pieces: Vec<Pieces> = Vec::new();
    for (place, stride) in leg.strides.iter().enumerate().rev() {
        if place % 64 == 0 {
            watch()?;
        }
        let known = pieces.iter().position(|x| Arc::ptr_eq(&x.choice, &stride.choice));
        let known = match known {
            Some(known) => known,
            None => {
                let count = leg.strides.iter().filter(|x| Arc::ptr_eq(&x.choice, &stride.choice)).count();
                let made = leg.model.step_recordings(stride.choice.choice(), &parameters.all, &asked.integrals)?;
                let compiles = count >= WORTH_COMPILING;
                pieces.push(Pieces {
                    choice: stride.choice.clone(),
                    rates: Piece::new(made.rates, compiles),
                    end: Piece::new(made.end, compiles),
                    integrands: (!asked.integrals.is_empty()).then(|| Piece::new(made.integrands, compiles)),
                });
                pieces.len() - 1
            }
        };
        let pieces = &mut pieces[known];
        let next = leg.strides.get(place + 1).map_or(&leg.end, |next| &next.from);
        let to = Instant { t: stride.t_end, ..next.clone() };
        let mut inside: Vec<Back> = Vec::new();
        for (number, at) in &stride.outputs {
            let Some(own) = weights.observables.get(*number).filter(|x| x.iter().any(|w| *w != 0.0)) else { continue };
            let mut gradient = observed(leg, (&plain, parameters), asked, (at, &stride.choice), own)?;
            add(&mut back.p, &gradient.p);
            if at.t == stride.t_end {
                add(&mut back.q, &gradient.q);
                add(&mut back.v, &gradient.v);
            } else {
                gradient.p.fill(0.0);
                step_back(leg, (stride, at), (pieces, &plain), parameters, &[], &mut gradient)?;
                inside.push(gradient);
            }
        }
        step_back(leg, (stride, &to), (pieces, &plain), parameters, &weights.integrals, back)?;
        for one in &inside {
            add(&mut back.q, &one.q);
            add(&mut back.v, &one.v);
            add(&mut back.p, &one.p);
        }
    }
    if let Some(stride) = leg.strides.first() {
        for (number, at) in &leg.first {
            let Some(own) = weights.observables.get(*number).filter(|x| x.iter().any(|w| *w != 0.0)) else { continue };
            let gradient = observed(leg, (&plain, parameters), asked, (at, &stride.choice), own)?;
            add(&mut back.q, &gradient.q);
            add(&mut back.v, &gradient.v);
            add(&mut back.p, &gradient.p);
        }
    }
    Ok(())
}

/// The gradient of what is observed at an instant.
fn observed(
    leg: &Leg,
    (plain, parameters): (&Equations, &Parameters),
    asked: &SensitivityRequest,
    (at, choice): (&Instant, &OwnedChoice),
    weights: &[f64],
) -> Result<Back, AnalysisError> {
    let (nq, nv) = (at.q.len(), at.v.len());
    let mut out = Back { q: vec![0.0; nq], v: vec![0.0; nv], p: vec![0.0; parameters.values.len()] };
    let sum = |x: &[Carried], l: usize| x.iter().zip(weights).map(|(x, w)| x.eps[l] * w).sum::<f64>();
    let [_, rates] = plain.rates(leg);
    let mut read = Reader::new(leg, &asked.observables, (&rates, &rates))?;
    for first in (0..nq + nv).step_by(CARRIED) {
        let (mut state, last) = (State::constant(at), (nq + nv).min(first + CARRIED));
        for j in first..last {
            let seed = if j < nq { &mut state.q[j] } else { &mut state.v[j - nq] };
            seed.eps[j - first] = 1.0;
        }
        read.read(at, &state, choice)?;
        for j in first..last {
            *(if j < nq { &mut out.q[j] } else { &mut out.v[j - nq] }) = sum(&read.observed, j - first);
        }
    }
    for (chunk, units) in parameters.units().iter().enumerate() {
        let equations = Equations::new(leg, units)?;
        let [own, still] = equations.rates(leg);
        let mut read = Reader::new(leg, &asked.observables, (&own, &still))?;
        read.read(at, &State::constant(at), choice)?;
        (0..units.len()).for_each(|l| out.p[chunk * CARRIED + l] = sum(&read.observed, l));
    }
    Ok(out)
}

/// Through a step from its start to `to`, transposed: `back` is at `to` before and at the start after.
fn step_back(
    leg: &Leg,
    (stride, to): (&Stride, &Instant),
    (pieces, plain): (&mut Pieces, &Equations),
    parameters: &Parameters,
    integrals: &[f64],
    back: &mut Back,
) -> Result<(), AnalysisError> {
    let (choice, scheme) = (stride.choice.choice(), &stride.taken.scheme);
    let (nq, k) = (back.q.len(), choice.k());
    let dim = nq + k;
    let inputs = |t: f64, y: &[f64]| [&[t][..], y, &parameters.values].concat();
    let own = |v: &[f64]| choice.independent.iter().map(|&i| v[i]).collect::<Vec<f64>>();
    // the end, closed
    let end = inputs(to.t, &[&to.q[..], &own(&to.v)].concat());
    let found = pieces.end.pull(&end, &[&back.q[..], &back.v].concat());
    let mut y_bar = found[1..1 + dim].to_vec();
    add(&mut back.p, &found[1 + dim..]);
    let (t, whole) = (stride.from.t, stride.t_end - stride.from.t);
    let y: Vec<f64> = [&stride.from.q[..], &own(&stride.from.v)].concat();
    let weighs = |x: &Option<Piece>| x.is_some() && integrals.iter().any(|w| *w != 0.0);
    let gathers = weighs(&pieces.integrands);
    if !scheme.implicit {
        let h = to.t - t;
        let mut states: Vec<Vec<f64>> = Vec::with_capacity(scheme.c.len());
        let mut slopes: Vec<Vec<f64>> = Vec::with_capacity(scheme.c.len());
        for (c, row) in scheme.c.iter().zip(&scheme.a) {
            let state = advanced_plain(&y, h, row, &slopes);
            let mut slope = vec![0.0; dim];
            pieces.rates.evaluate(&inputs(t + c * h, &state), &mut slope);
            states.push(state);
            slopes.push(slope);
        }
        let mut of_states: Vec<Vec<f64>> = vec![Vec::new(); states.len()];
        let last_of_y = y_bar.clone();
        for i in (0..states.len()).rev() {
            let mut slope_bar: Vec<f64> = last_of_y.iter().map(|x| h * scheme.b[i] * x).collect();
            for j in i + 1..states.len() {
                let a = scheme.a[j][i];
                if a != 0.0 {
                    slope_bar.iter_mut().zip(&of_states[j]).for_each(|(to, x)| *to += h * a * x);
                }
            }
            let at = inputs(t + scheme.c[i] * h, &states[i]);
            let mut found = pieces.rates.pull(&at, &slope_bar);
            if let (true, Some(integrands)) = (gathers, &mut pieces.integrands) {
                let weighed: Vec<f64> = integrals.iter().map(|w| w * h * scheme.b[i]).collect();
                add(&mut found, &integrands.pull(&at, &weighed));
            }
            add(&mut y_bar, &found[1..1 + dim]);
            add(&mut back.p, &found[1 + dim..]);
            of_states[i] = found[1..1 + dim].to_vec();
        }
    } else {
        let [_, rates] = plain.rates(leg);
        let (h, weights) = match stride.across {
            true => (whole, Rates::weights_until(scheme, (to.t - t) / whole)),
            false => (to.t - t, scheme.b.clone()),
        };
        let guess = (stride.across || to.t == stride.t_end).then_some((&stride.taken.states[..], stride.dim));
        let solved = rates.stages(&stride.choice, scheme, (t, h), &y, guess)?;
        let stages = scheme.c.len();
        let mut matrix = solved.matrix;
        let mut pivots = vec![0; stages * dim];
        let singular = || SystemError::NotFinite { what: "the stages of an implicit step".into(), t };
        lu(&mut matrix, stages * dim, &mut pivots).map_err(|_| singular())?;
        // what is integrated adds to the stages themselves
        let mut of_states = vec![vec![0.0; dim]; stages];
        if let (true, Some(integrands)) = (gathers, &mut pieces.integrands) {
            for i in 0..stages {
                let weighed: Vec<f64> = integrals.iter().map(|w| w * h * scheme.b[i]).collect();
                let found = integrands.pull(&inputs(t + scheme.c[i] * h, &solved.states[i]), &weighed);
                add(&mut of_states[i], &found[1..1 + dim]);
                add(&mut back.p, &found[1 + dim..]);
            }
        }
        let mut right = vec![0.0; stages * dim];
        for i in 0..stages {
            for l in 0..dim {
                right[i * dim + l] = h * weights[i] * y_bar[l];
                for (j, of_state) in of_states.iter().enumerate() {
                    right[i * dim + l] += h * scheme.a[j][i] * of_state[l];
                }
            }
        }
        of_states.iter().for_each(|x| add(&mut y_bar, x));
        lu_solve_transposed(&matrix, stages * dim, &pivots, &mut right);
        for (i, slope_bar) in right.chunks_exact(dim).enumerate() {
            let found = pieces.rates.pull(&inputs(t + scheme.c[i] * h, &solved.states[i]), slope_bar);
            add(&mut y_bar, &found[1..1 + dim]);
            add(&mut back.p, &found[1 + dim..]);
        }
    }
    back.q.copy_from_slice(&y_bar[..nq]);
    back.v.fill(0.0);
    choice.independent.iter().zip(&y_bar[nq..]).for_each(|(&i, x)| back.v[i] = *x);
    Ok(())
}
