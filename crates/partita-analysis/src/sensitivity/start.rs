//! The start of a run, with derivatives: numbers move while the coordinates that are held stay, or follow.
//!
//! ```text
//! q closed for the numbers, z such that each held coordinate has its value;  v = Dᵀ u + η, u such that its rate has
//! ```

use super::legs::Leg;
use super::retaken::{constant, put_values, Rates, State};
use super::{Direction, HeldCoordinate};
use crate::error::AnalysisError;
use partita_math::dense::{lu, lu_pivot_ratio, lu_solve};
use partita_math::tolerance;
use partita_model::carried::{Carried, CarriedState, Observable, CARRIED};
use partita_model::event_functions::Formula;
use partita_model::Evaluator;
use partita_system::prelude::*;
use partita_system::rates::ChosenRates;
use partita_system::SystemError;

/// Positions and rates of what is held.
struct HeldCoordinates<'e> {
    e: &'e Evaluator<Carried>,
    observers: partita_model::carried::Observers,
    /// Number of a measure, or of a velocity with its coordinate, if it has one.
    all: Vec<Result<usize, (usize, Option<usize>)>>,
    measures: usize,
}

impl HeldCoordinates<'_> {
    /// All at a state.
    fn read(&self, t: f64, q: &[Carried], v: &[Carried]) -> Result<(Vec<Carried>, Vec<Carried>), SystemError> {
        let (mut s, mut out) = (self.e.scratch(), vec![constant(0.0); 2 * self.measures]);
        self.observers.read(self.e, &mut s, &CarriedState { t: constant(t), q, v, forces: None }, &mut out)?;
        let position = |x: &Result<usize, (usize, Option<usize>)>| match x {
            Ok(i) => out[*i],
            Err((_, coordinate)) => coordinate.map_or(constant(0.0), |i| q[i]),
        };
        let rate = |x: &Result<usize, (usize, Option<usize>)>| match x {
            Ok(i) => out[self.measures + i],
            Err((i, _)) => v[*i],
        };
        Ok((self.all.iter().map(position).collect(), self.all.iter().map(rate).collect()))
    }
}

/// The state where a leg begins, with derivatives along these directions.
///
/// # Errors
/// Where what is held does not determine the motion.
pub fn started(
    leg: &Leg,
    (e, rates): (&Evaluator<Carried>, &Rates),
    held: &[(String, HeldCoordinate)],
    directions: &[Direction],
) -> Result<State, AnalysisError> {
    let Some(stride) = leg.strides.first() else { return Ok(State::constant(&leg.end)) };
    let (from, choice) = (&stride.from, stride.choice.choice());
    let k = choice.k();
    let names = || held.iter().map(|x| x.0.as_str()).collect::<Vec<_>>().join(", ");
    if held.len() != k {
        let message = format!(
            "{} coordinates are held at the start ({}), but the mechanism has {k} degrees of freedom; name as many joints \
             as that",
            held.len(),
            names()
        );
        return Err(AnalysisError::Argument { argument: "held", message });
    }
    let mut x = rates.of(&stride.choice);
    let (mut measures, mut all) = (Vec::new(), Vec::with_capacity(k));
    for (_, coordinate_held) in held {
        all.push(match coordinate_held {
            HeldCoordinate::Measure(measure) => {
                measures.push(measure.clone());
                Ok(measures.len() - 1)
            }
            HeldCoordinate::Velocity(i) => {
                let own = leg.model.structure().coordinates_of(*i);
                Err((*i, (own.len() == 1).then_some(own.start)))
            }
        });
    }
    let positions = measures.iter().map(|m| Observable::Formula(Formula::Position(m.clone())));
    let speeds = measures.iter().map(|m| Observable::Formula(Formula::Velocity(m.clone())));
    let read: Vec<Observable> = positions.chain(speeds).collect();
    let coordinates =
        HeldCoordinates { e, observers: leg.model.observers(e, &read, "start")?, all, measures: measures.len() };
    let still = State::constant(from);
    // closed for the numbers, independent coordinates as they are
    let u: Vec<Carried> = choice.independent.iter().map(|&i| still.v[i]).collect();
    let mut q = still.q.clone();
    close(&mut *x, rates, &mut q, from)?;
    // how what is held moves with each independent coordinate
    let mut matrix = vec![0.0; k * k];
    for first in (0..k).step_by(CARRIED) {
        let mut seeded = u.clone();
        (first..k.min(first + CARRIED)).for_each(|j| seeded[j].eps[j - first] = 1.0);
        let v = x.velocities(constant(from.t), &still.q, &seeded)?.to_vec();
        // the numbers of the mechanism change v as well
        let base = x.velocities(constant(from.t), &still.q, &u)?.to_vec();
        let v: Vec<Carried> = v.iter().zip(&base).map(|(v, base)| difference(v, base)).collect();
        let without: Vec<Carried> = still.v.clone();
        let ((_, moved), (_, rest)) =
            (coordinates.read(from.t, &still.q, &v)?, coordinates.read(from.t, &still.q, &without)?);
        for j in first..k.min(first + CARRIED) {
            (0..k).for_each(|i| matrix[i * k + j] = moved[i].eps[j - first] - rest[i].eps[j - first]);
        }
    }
    let mut pivots = vec![0; k];
    let regular = lu(&mut matrix, k, &mut pivots).is_ok() && lu_pivot_ratio(&matrix, k) > tolerance::SINGULAR_PIVOT;
    if !regular {
        let message = format!(
            "what is held ({}) does not determine the motion at the start, where it is at a dead point; hold other joints",
            names()
        );
        return Err(AnalysisError::Argument { argument: "held", message });
    }
    let solved = |wanted: &dyn Fn(&Direction) -> &[f64], found: &[Carried]| -> Vec<[f64; CARRIED]> {
        let mut along = vec![[0.0; CARRIED]; k];
        for (l, direction) in directions.iter().enumerate() {
            let given = wanted(direction);
            let mut b: Vec<f64> = (0..k).map(|i| given.get(i).copied().unwrap_or(0.0) - found[i].eps[l]).collect();
            lu_solve(&matrix, k, &pivots, &mut b);
            along.iter_mut().zip(&b).for_each(|(to, x)| to[l] = *x);
        }
        along
    };
    let (found, _) = coordinates.read(from.t, &q, &still.v)?;
    let dz = solved(&|x: &Direction| &x.start, &found);
    let mut moving = vec![constant(0.0); still.v.len()];
    choice.independent.iter().zip(&dz).for_each(|(&i, dz)| moving[i].eps = *dz);
    let mut moved = vec![constant(0.0); q.len()];
    e.rate(&still.q, &moving, &mut moved);
    q.iter_mut().zip(&moved).for_each(|(q, moved)| *q += *moved);
    close(&mut *x, rates, &mut q, from)?;
    let v = x.velocities(constant(from.t), &q, &u)?.to_vec();
    let (_, found) = coordinates.read(from.t, &q, &v)?;
    let du = solved(&|x: &Direction| &x.start_rates, &found);
    let u: Vec<Carried> = u.iter().zip(&du).map(|(u, du)| Carried::new(u.re, *du)).collect();
    let mut v = x.velocities(constant(from.t), &q, &u)?.to_vec();
    put_values(&mut v, &from.v);
    Ok(State { q, v })
}

/// The derivatives that one number has and the other has not.
fn difference(x: &Carried, base: &Carried) -> Carried {
    Carried::new(x.re, std::array::from_fn(|l| x.eps[l] - base.eps[l]))
}

/// Close a position, its values known.
fn close(
    x: &mut dyn ChosenRates<Carried>,
    rates: &Rates,
    q: &mut [Carried],
    at: &super::legs::Instant,
) -> Result<(), SystemError> {
    x.correct_to(constant(at.t), q, &rates.kept)?;
    put_values(q, &at.q);
    Ok(())
}
