//! Derivatives of a run: of what is observed along it, by numbers of the mechanism and of its start.
//!
//! They are those of the numbers that the run computed: every step is taken again, by the coefficients and for the
//! coordinates by which it was taken, over numbers with derivatives. Lengths of steps are constants.

mod carry;
mod jump;
mod start;
mod trail;

use crate::error::AnalysisError;
use crate::outputs::Watch;
use carry::{along, constant, Rates, State};
use jump::{Shift, Side};
use partita_model::carried::{Carried, CarriedState, Observable, Observers, CARRIED};
use partita_model::spec::Measure;
use partita_model::{Evaluator, Model};
use partita_system::choice::OwnedChoice;
use partita_system::prelude::*;
use serde::Deserialize;

pub use jump::{Jump, Reason};
pub use trail::{Instant, Leg, Stride, Time};

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

/// What is asked.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Asked {
    /// What is held at the start, and the names of that.
    pub held: Vec<(String, Measure)>,
    /// Directions.
    pub directions: Vec<Direction>,
    /// What is observed.
    pub observables: Vec<Observable>,
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
}

/// Derivatives at so many times along the legs of a run.
///
/// # Errors
/// Where something has no derivative.
pub fn forward(legs: &[Leg], count: usize, asked: &Asked, watch: Watch) -> Result<Derivatives, AnalysisError> {
    let (m, d) = (asked.observables.len(), asked.directions.len());
    let unknown = |n: usize| vec![f64::NAN; n];
    let mut out = Derivatives { values: unknown(count * m), rates: unknown(count * m), along: unknown(count * m * d) };
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
        carried(legs, asked, directions, &mut take)?;
    }
    Ok(out)
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
}

/// Along at most so many directions as are carried together.
fn carried(legs: &[Leg], asked: &Asked, directions: &[Direction], take: Take) -> Result<(), AnalysisError> {
    let (names, measures): (Vec<String>, Vec<Measure>) = asked.held.iter().cloned().unzip();
    let all = legs.iter().map(|leg| Equations::new(leg, directions)).collect::<Result<Vec<_>, _>>()?;
    let mut state: Option<State> = None;
    // the last step taken, with its leg, and when what happens there happens
    let mut last: Option<usize> = None;
    let mut shift: Option<Shift> = None;
    for (i, (leg, equations)) in legs.iter().zip(&all).enumerate() {
        let [e, still] = &equations.own;
        let size = (leg.model.size().nq, leg.model.size().holonomic);
        let mut rates = Rates::new(&leg.model, e, size);
        let plain = Rates::new(&leg.model, still, size);
        if let Some(stride) = leg.strides.first() {
            let from = match state.take() {
                None => {
                    let held = start::Held { measures: &measures, names: &names };
                    start::started(leg, (e, &rates), &held, directions)?
                }
                Some(mut at) => {
                    if let Some(shift) = shift.take() {
                        let side = Side { model: &leg.model, rates: &plain, stride };
                        jump::moved(&mut at, &side.motion(&stride.from)?, &shift, -1.0);
                    }
                    at.put_at(&stride.from);
                    rates.keep(&stride.choice, stride.from.t, &at.q)?;
                    at
                }
            };
            let mut read = Reader::new(leg, asked, (&rates, &plain))?;
            state = Some(along(leg, &rates, from, &mut |number, at, state, choice| {
                read.read(at, state, choice)?;
                take(number, &read.observed, &read.rates);
                Ok(())
            })?);
            last = Some(i);
        }
        let (Some(jump), Some(whole), Some(at)) = (&leg.jump, &equations.whole, &mut state) else { continue };
        let after = legs.get(i + 1).map(|next| next.strides.first().map_or(&next.end, |x| &x.from));
        let Some(after) = after else { continue };
        if let (None, Some(last)) = (shift, last.filter(|last| *last == i)) {
            let stride = legs[last].strides.last().ok_or(AnalysisError::Argument { argument: "run", message: String::new() })?;
            let sides = [&rates, &plain].map(|rates| Side { model: &leg.model, rates, stride });
            at.put_at(&leg.end);
            let found = jump::shift(jump, &sides[0], (&sides[1], [&whole[0], &whole[1]]), at, &leg.end)?;
            jump::moved(at, &sides[1].motion(&leg.end)?, &found, 1.0);
            shift = Some(found);
        }
        at.v = jump::thrown(jump, &whole[0], at, leg.end.t, &after.v)?;
        at.put_at(after);
    }
    Ok(())
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
    fn new(leg: &Leg, asked: &Asked, rates_of: (&'a Rates<'a>, &'a Rates<'a>)) -> Result<Self, AnalysisError> {
        let make = |rates: &Rates| leg.model.observers(rates.equations(), &asked.observables, "objective");
        let count = asked.observables.len();
        Ok(Self {
            observers: [make(rates_of.0)?, make(rates_of.1)?],
            rates_of,
            rows: leg.model.size().rows,
            observed: vec![constant(0.0); count],
            rates: vec![0.0; count],
        })
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
