//! Derivatives of a run: of what is observed along it, by numbers of the mechanism and of its start.
//!
//! They are those of the numbers that the run computed: every step is taken again, by the coefficients and for the
//! coordinates by which it was taken, over numbers with derivatives. Lengths of steps are constants.

mod backward;
mod jump;
mod legs;
mod parameters;
mod programs;
mod retaken;
mod start;

use crate::error::AnalysisError;
use crate::outputs::Watch;
use jump::{Shift, Side};
use parameters::Parameters;
use partita_math::scalar::Scalar;
use partita_model::carried::{Carried, CarriedState, Observable, Observers, CARRIED};
use partita_model::spec::Measure;
use partita_model::{Evaluator, Model};
use partita_system::choice::OwnedChoice;
use partita_system::prelude::*;
use partita_system::rates::ChosenRates;
use programs::Programs;
use retaken::{along, constant, Rates, State};
use serde::Deserialize;

pub use backward::{backward, Weights};
pub use jump::{Jump, Reason};
pub use legs::{Instant, Leg, Stride, Time};

/// A direction in which numbers change together.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Direction {
    /// Parameters, each with the changes of its numbers.
    pub parameters: Vec<(String, Vec<f64>)>,
    /// Changes of the positions of what is held at the start.
    pub start: Vec<f64>,
    /// Changes of its rates.
    pub start_rates: Vec<f64>,
    /// Change of the end time.
    pub end: f64,
}

/// What may be held at the start.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum HeldCoordinate {
    /// A measure.
    Measure(Measure),
    /// A velocity of the mechanism, by its number, and its coordinate.
    Velocity(usize),
}

/// What is asked.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensitivityRequest {
    /// What is held at the start, and the names of that.
    pub held: Vec<(String, HeldCoordinate)>,
    /// Directions.
    pub directions: Vec<Direction>,
    /// What is observed.
    pub observables: Vec<Observable>,
    /// What is integrated over the run.
    #[serde(default)]
    pub integrals: Vec<Observable>,
}

/// Values and derivatives at each time.
#[derive(Clone, Debug, Default)]
pub struct Derivatives {
    /// Observables, time by time.
    pub values: Vec<f64>,
    /// Their total rates, likewise.
    pub rates: Vec<f64>,
    /// Derivatives of each along each direction, time by time, observable by observable.
    pub along: Vec<f64>,
    /// Integrals, each with its derivatives.
    pub integrals: Vec<(f64, Vec<f64>)>,
    /// When something happens between two legs, with the derivatives of that.
    pub shifts: Vec<(f64, Vec<f64>)>,
}

/// Derivatives at so many times along the legs of a run.
///
/// # Errors
/// Where something has no derivative.
pub fn forward(
    legs: &[Leg],
    count: usize,
    asked: &SensitivityRequest,
    watch: Watch,
) -> Result<Derivatives, AnalysisError> {
    let (m, d) = (asked.observables.len(), asked.directions.len());
    let unknown = |n: usize| vec![f64::NAN; n];
    let mut out = Derivatives {
        values: unknown(count * m),
        rates: unknown(count * m),
        along: unknown(count * m * d),
        integrals: vec![(f64::NAN, unknown(d)); asked.integrals.len()],
        shifts: Vec::new(),
    };
    let programs = legs
        .iter()
        .map(|leg| Ok(Programs::new(leg, Parameters::new(leg, &asked.directions)?)))
        .collect::<Result<Vec<_>, AnalysisError>>()?;
    for first in (0..d.max(1)).step_by(CARRIED) {
        watch()?;
        let directions = &asked.directions[first.min(d)..d.min(first + CARRIED)];
        let mut take = |number: usize, found: &[Carried], rates: &[f64]| {
            out.rates[number * m..(number + 1) * m].copy_from_slice(rates);
            for (i, x) in found.iter().enumerate() {
                out.values[number * m + i] = x.re;
                for l in 0..directions.len() {
                    out.along[(number * m + i) * d + first + l] = x.eps[l];
                }
            }
        };
        let Carrying { integrals, shifts } = carried(legs, asked, (directions, &programs, first), &mut take)?;
        for (to, x) in out.integrals.iter_mut().zip(&integrals) {
            to.0 = x.re;
            (0..directions.len()).for_each(|l| to.1[first + l] = x.eps[l]);
        }
        if out.shifts.is_empty() {
            out.shifts.extend(shifts.iter().map(|(t, _)| (*t, unknown(d))));
        }
        for (to, (_, shift)) in out.shifts.iter_mut().zip(&shifts) {
            to.1[first..first + directions.len()].copy_from_slice(&shift[..directions.len()]);
        }
    }
    Ok(out)
}

/// Values and total rates at so many times along the legs of a run, time by time.
///
/// # Errors
/// Where something cannot be evaluated.
pub fn observed(legs: &[Leg], count: usize, observables: &[Observable]) -> Result<[Vec<f64>; 2], AnalysisError> {
    let m = observables.len();
    let [mut values, mut rates] = [vec![f64::NAN; count * m], vec![f64::NAN; count * m]];
    for leg in legs {
        let e = leg.model.carrying(&[])?;
        let plain = Rates::new(&leg.model, &e, (leg.model.size().nq, leg.model.size().holonomic));
        let mut read = Reader::new(leg, observables, (&plain, &plain))?;
        let first = leg.strides.first().map(|x| (&leg.first, &x.choice));
        let all = first.into_iter().chain(leg.strides.iter().map(|x| (&x.outputs, &x.choice)));
        for (outputs, choice) in all {
            for (number, at) in outputs {
                read.read(at, &State::constant(at), choice)?;
                let to = number * m..(number + 1) * m;
                values[to.clone()].iter_mut().zip(&read.observed).for_each(|(to, x)| *to = x.re);
                rates[to].copy_from_slice(&read.rates);
            }
        }
    }
    Ok([values, rates])
}

/// What is gathered along a run beside outputs.
struct Carrying {
    integrals: Vec<Carried>,
    shifts: Vec<(f64, Shift)>,
}

/// The numbers of parameters with derivatives along directions.
fn seeded(model: &Model, directions: &[Direction]) -> Result<Vec<(String, Vec<Carried>)>, AnalysisError> {
    let present = model.parameters();
    let mut found: Vec<(String, Vec<Carried>)> = Vec::new();
    for (l, direction) in directions.iter().enumerate() {
        for (name, change) in &direction.parameters {
            let i = match found.iter().position(|x| x.0 == *name) {
                Some(i) => i,
                None => {
                    let known = |name: &str| present.iter().find(|x| x.0 == name).map(|x| &x.1[..]);
                    // a joint is on its child where it is drawn, unless that is given
                    let drawn = || known(&format!("{}.point", name.strip_suffix(".child_point")?));
                    let values = known(name).or_else(drawn).unwrap_or_default();
                    found.push((name.clone(), values.iter().map(|x| constant(*x)).collect()));
                    found.len() - 1
                }
            };
            found[i].1.iter_mut().zip(change).for_each(|(x, change)| x.eps[l] += change);
        }
    }
    Ok(found)
}

/// What is taken at each time: values with derivatives, and their total rates.
type Take<'t> = &'t mut dyn FnMut(usize, &[Carried], &[f64]);

/// The equations of a leg and of the whole mechanism behind it, with derivatives and without.
struct Equations {
    own: [Evaluator<Carried>; 2],
    whole: Option<[Evaluator<Carried>; 2]>,
}

impl Equations {
    fn new(leg: &Leg, directions: &[Direction]) -> Result<Self, AnalysisError> {
        let both = |model: &Model| -> Result<_, AnalysisError> {
            let changes = seeded(model, directions)?;
            let changes: Vec<(&str, &[Carried])> = changes.iter().map(|(name, x)| (name.as_str(), &x[..])).collect();
            Ok([model.carrying(&changes)?, model.carrying(&[])?])
        };
        let whole = leg.jump.as_ref().map(|jump| both(&jump.whole)).transpose()?;
        Ok(Self { own: both(&leg.model)?, whole })
    }

    /// Rates of a leg, with derivatives and without.
    fn rates<'a>(&'a self, leg: &'a Leg) -> [Rates<'a>; 2] {
        let size = (leg.model.size().nq, leg.model.size().holonomic);
        [0, 1].map(|i| Rates::new(&leg.model, &self.own[i], size))
    }
}

/// The legs with steps.
fn stepping(legs: &[Leg]) -> Vec<usize> {
    (0..legs.len()).filter(|&i| !legs[i].strides.is_empty()).collect()
}

/// What happens between two legs with steps.
struct Crossed {
    /// The state where the second one begins.
    state: State,
    /// Derivatives of when it happens.
    shift: Shift,
    /// Integrands before, less those after.
    lost: Vec<f64>,
}

/// From the end of a leg to the beginning of the next one with steps.
fn cross(
    legs: &[Leg],
    all: &[Equations],
    (from, to): (usize, usize),
    mut at: State,
    integrals: &[Observable],
) -> Result<Crossed, AnalysisError> {
    let ends = |i: usize| (&legs[i], &all[i]);
    let ((leg, equations), (next, after)) = (ends(from), ends(to));
    let (Some(last), Some(first)) = (leg.strides.last(), next.strides.first()) else {
        return Ok(Crossed { state: at, shift: [0.0; CARRIED], lost: vec![0.0; integrals.len()] });
    };
    let ([rates, plain], [_, plain_after]) = (equations.rates(leg), after.rates(next));
    let mut shift = [0.0; CARRIED];
    at.put_at(&leg.end);
    for i in from..to {
        let (Some(jump), Some(whole)) = (&legs[i].jump, &all[i].whole) else { continue };
        if i == from {
            let sides = [&rates, &plain].map(|rates| Side { model: &leg.model, rates, stride: last });
            shift = jump::shift(jump, &sides[0], (&sides[1], [&whole[0], &whole[1]]), &at, &leg.end)?;
            jump::moved(&mut at, &sides[1].motion(&leg.end)?, &shift, 1.0);
        }
        let there = legs[i + 1].strides.first().map_or(&legs[i + 1].end, |x| &x.from);
        // what is prescribed over time moves on until it happens
        let time = Carried::new(leg.end.t, shift);
        at.v = jump::thrown(jump, &whole[0], &at, time, &there.v)?;
        at.put_at(there);
    }
    let side = Side { model: &next.model, rates: &plain_after, stride: first };
    jump::moved(&mut at, &side.motion(&first.from)?, &shift, -1.0);
    at.put_at(&first.from);
    let mut lost = vec![0.0; integrals.len()];
    if !integrals.is_empty() {
        for (leg, plain, choice, at, sign) in
            [(leg, &plain, &last.choice, &leg.end, 1.0), (next, &plain_after, &first.choice, &first.from, -1.0)]
        {
            let mut read = Reader::new(leg, integrals, (plain, plain))?;
            read.read(at, &State::constant(at), choice)?;
            lost.iter_mut().zip(&read.observed).for_each(|(to, x)| *to += sign * x.re);
        }
    }
    Ok(Crossed { state: at, shift, lost })
}

/// Along at most so many directions as are carried together.
fn carried(
    legs: &[Leg],
    asked: &SensitivityRequest,
    (directions, programs, first): (&[Direction], &[Programs], usize),
    take: Take,
) -> Result<Carrying, AnalysisError> {
    let mut found = Carrying { integrals: vec![constant(0.0); asked.integrals.len()], shifts: Vec::new() };
    let all = legs.iter().map(|leg| Equations::new(leg, directions)).collect::<Result<Vec<_>, _>>()?;
    let mut before: Option<(usize, State)> = None;
    for i in stepping(legs) {
        let leg = &legs[i];
        let [rates, plain] = all[i].rates(leg);
        let mut rates = rates.with(&programs[i], first);
        let Some(stride) = leg.strides.first() else { continue };
        let from = match before.take() {
            None => start::started(leg, (&all[i].own[0], &rates), &asked.held, directions)?,
            Some((last, state)) => {
                let Crossed { state, shift, lost } = cross(legs, &all, (last, i), state, &asked.integrals)?;
                for (to, lost) in found.integrals.iter_mut().zip(&lost) {
                    (0..CARRIED).for_each(|l| to.eps[l] += lost * shift[l]);
                }
                found.shifts.push((legs[last].end.t, shift));
                rates.keep(&stride.choice, stride.from.t, &state.q)?;
                state
            }
        };
        let mut read = Reader::new(leg, &asked.observables, (&rates, &plain))?;
        let mut integrands = Reader::new(leg, &asked.integrals, (&rates, &plain))?;
        let integrals = &mut found.integrals;
        let mut gather = |weight: f64, t: f64, q: &[Carried], x: &mut dyn ChosenRates<Carried>| {
            integrands.read_stage(t, q, x)?;
            integrals.iter_mut().zip(&integrands.observed).for_each(|(to, x)| *to += x.scale(weight));
            Ok(())
        };
        let gather: Option<retaken::Gather> = if asked.integrals.is_empty() { None } else { Some(&mut gather) };
        let end = along(leg, &rates, from, gather, &mut |number, at, state, choice| {
            read.read(at, state, choice)?;
            take(number, &read.observed, &read.rates);
            Ok(())
        })?;
        before = Some((i, end));
    }
    Ok(found)
}

/// Reads what is asked.
struct Reader<'a> {
    observers: [Observers; 2],
    rates_of: (&'a Rates<'a>, &'a Rates<'a>),
    rows: usize,
    observed: Vec<Carried>,
    rates: Vec<f64>,
}

impl<'a> Reader<'a> {
    fn new(
        leg: &Leg,
        observables: &[Observable],
        rates_of: (&'a Rates<'a>, &'a Rates<'a>),
    ) -> Result<Self, AnalysisError> {
        let make = |rates: &Rates| leg.model.observers(rates.equations(), observables, "objective");
        let count = observables.len();
        Ok(Self {
            observers: [make(rates_of.0)?, make(rates_of.1)?],
            rates_of,
            rows: leg.model.size().rows,
            observed: vec![constant(0.0); count],
            rates: vec![0.0; count],
        })
    }

    /// At a stage of a step, whose rates were evaluated last.
    fn read_stage(&mut self, t: f64, q: &[Carried], x: &mut dyn ChosenRates<Carried>) -> Result<(), AnalysisError> {
        let (t, e) = (constant(t), self.rates_of.0.equations());
        let mut lambda = vec![constant(0.0); self.rows];
        if self.observers[0].reads_forces() {
            x.multipliers(t, q, &mut lambda)?;
        }
        let (v, vdot) = x.motion();
        let at = CarriedState { t, q, v, forces: Some((vdot, &lambda)) };
        self.observers[0].read(e, &mut e.scratch(), &at, &mut self.observed)?;
        Ok(())
    }

    /// At a state, with the coordinates in use.
    fn read(&mut self, at: &Instant, state: &State, choice: &OwnedChoice) -> Result<(), AnalysisError> {
        let t = constant(at.t);
        let (vdot, rows) = (self.rates_of.1.of(choice), self.rows);
        let read = |of: usize, rates: &Rates, t: Carried, q: &[Carried], v: &[Carried], out: &mut [Carried]| {
            let e = rates.equations();
            let mut forces = (Vec::new(), vec![constant(0.0); rows]);
            if self.observers[of].reads_forces() {
                let mut x = rates.of(choice);
                let u: Vec<Carried> = choice.choice().independent.iter().map(|&i| v[i]).collect();
                forces.0 = x.accelerations(t, q, &u)?.to_vec();
                x.multipliers(t, q, &mut forces.1)?;
            }
            let forces = Some((&forces.0[..], &forces.1[..]));
            self.observers[of].read(e, &mut e.scratch(), &CarriedState { t, q, v, forces }, out)
        };
        read(0, self.rates_of.0, t, &state.q, &state.v, &mut self.observed)?;
        // along the motion
        let (mut x, mut moving) = (vdot, State::constant(at));
        let u: Vec<Carried> = choice.choice().independent.iter().map(|&i| moving.v[i]).collect();
        let vdot = x.accelerations(t, &moving.q, &u)?.to_vec();
        let mut qdot = vec![constant(0.0); moving.q.len()];
        self.rates_of.1.equations().rate(&moving.q, &moving.v, &mut qdot);
        moving.q.iter_mut().zip(&qdot).for_each(|(q, rate)| q.eps[0] = rate.re);
        moving.v.iter_mut().zip(&vdot).for_each(|(v, rate)| v.eps[0] = rate.re);
        let mut time = t;
        time.eps[0] = 1.0;
        let mut out = vec![constant(0.0); self.rates.len()];
        read(1, self.rates_of.1, time, &moving.q, &moving.v, &mut out)?;
        self.rates.iter_mut().zip(&out).for_each(|(to, x)| *to = x.eps[0]);
        Ok(())
    }
}
