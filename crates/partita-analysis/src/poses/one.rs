//! One position: closed from a drawing or a guess with some coordinates held, then brought to its targets in order of
//! priority.

use super::closed::closed;
use super::continuation::{Continuation, Ending};
use super::explain;
use super::field::Duty;
use super::goal::Target;
use super::nearest::nearest;
use partita_math::tolerance;
use partita_model::Model;
use partita_system::kinematics::assembly;
use partita_system::prelude::*;
use partita_system::SystemError;

/// The goals of a position.
#[derive(Clone, Debug, Default)]
pub struct Ask {
    /// Coordinates from which closing starts, instead of those of the drawing.
    pub guess: Vec<(Target, f64)>,
    /// Coordinates that keep their initial values.
    pub fixed: Vec<Target>,
    /// Targets in order of priority: the first are met, those of each next level as nearly as the earlier ones allow,
    /// in the sense of least squares.
    pub levels: Vec<Vec<(Target, f64)>>,
    /// Largest residual, relative.
    pub tolerance: f64,
}

/// What became of one target.
#[derive(Clone, Debug, PartialEq)]
pub struct Met {
    /// Its name.
    pub name: String,
    /// Its level, from 0.
    pub level: usize,
    /// The goals.
    pub asked: f64,
    /// Its value.
    pub value: f64,
}

/// The resulting position.
#[derive(Clone, Debug, Default)]
pub struct One {
    /// Coordinates.
    pub q: Vec<f64>,
    /// Iterations in all.
    pub iterations: usize,
    /// Largest |Φ| at the end.
    pub residual: f64,
    /// Number of steps to the targets.
    pub steps: usize,
    /// By closed forms?
    pub explicit: bool,
    /// The targets.
    pub met: Vec<Met>,
}

/// Close the loops of the model from q and satisfy the goals.
///
/// # Errors
/// `Assembly`, `Lengths` and `Targets` where there is no such position; `Argument` for invalid goals, or where a
/// coupling that is held by its rates alone would slip; `Wound` where an angle cannot be distinguished from one a turn
/// beside it.
pub fn one(model: &Model, t: f64, q: &[f64], ask: &Ask) -> Result<One, SystemError> {
    let mut found = One { q: q.to_vec(), ..One::default() };
    guess(model, t, &mut found.q, &ask.guess)?;
    let held = held(model, &found.q, &ask.fixed);
    let locked: Vec<usize> = ask.fixed.iter().filter_map(|x| x.own().map(|own| own.1)).collect();
    let drawn = found.q.clone();
    let closed =
        closed(model, t, &mut found.q, ask.tolerance, &locked).map_err(|e| explain::held(model, t, &drawn, ask, e))?;
    (found.iterations, found.residual) = (closed.iterations, closed.residual);
    let (required, lower) = ask.levels.split_first().map_or((&[][..], &[][..]), |(a, b)| (&a[..], b));
    let mut wanted: Vec<(Target, f64)> = held;
    wanted.extend_from_slice(required);
    meet(model, t, &mut found, &wanted, ask.tolerance)?;
    let mut kept = wanted;
    for (level, wishes) in lower.iter().enumerate() {
        wish(model, t, &mut found, &mut kept, wishes).map_err(|e| {
            if let SystemError::NotFinite { .. } = e {
                stopped(level + 1, &e)
            } else {
                e
            }
        })?;
    }
    let asked = ask.levels.iter().enumerate().flat_map(|(level, x)| x.iter().map(move |x| (level, x)));
    let (rest, mut s) = (vec![0.0; model.size().nv], model.scratch());
    for (level, (x, asked)) in asked {
        let value = x.value(model, &found.q, &rest, &mut s, *asked);
        x.check_turns(model, value)?;
        found.met.push(Met { name: x.name.clone(), level, asked: *asked, value });
    }
    model.held_on(q, &found.q)?;
    Ok(found)
}

fn stopped(level: usize, e: &SystemError) -> SystemError {
    SystemError::argument(
        "targets",
        format!("the equations cannot be evaluated at the targets of priority {level}: {e}"),
    )
}

/// q with the guessed coordinates: those of the state as given, others as nearly as displacements of the state allow,
/// without closing the loops.
fn guess(model: &Model, t: f64, q: &mut Vec<f64>, guess: &[(Target, f64)]) -> Result<(), SystemError> {
    for (x, value) in guess {
        if let Some((at, _)) = x.own() {
            q[at] = *value;
        }
    }
    if guess.iter().all(|(x, _)| x.own().is_some()) {
        return Ok(());
    }
    let (targets, aims): (Vec<Target>, Vec<f64>) = guess.iter().cloned().unzip();
    let mut continuation = Continuation::new(model, &targets, t);
    let f = &mut continuation.field;
    let m = f.closings();
    f.duty[..m].fill(Duty::Idle);
    for (k, x) in targets.iter().enumerate() {
        f.duty[m + k] = if x.own().is_some() { Duty::Hard } else { Duty::Soft };
    }
    f.y.copy_from_slice(&aims);
    nearest(f, q, &aims)?;
    Ok(())
}

/// The coordinates that are held, with their values.
fn held(model: &Model, q: &[f64], fixed: &[Target]) -> Vec<(Target, f64)> {
    let (rest, mut s) = (vec![0.0; model.size().nv], model.scratch());
    let mut of = |x: &Target| (x.clone(), x.value(model, q, &rest, &mut s, 0.0));
    fixed.iter().map(&mut of).collect()
}

/// Move to where all of these targets are met, with the loops closed.
fn meet(model: &Model, t: f64, found: &mut One, wanted: &[(Target, f64)], tolerance: f64) -> Result<(), SystemError> {
    if wanted.is_empty() {
        return Ok(());
    }
    let own: Option<Vec<(usize, f64)>> = wanted.iter().map(|(x, value)| x.own().map(|own| (own.0, *value))).collect();
    let velocities: Vec<usize> = wanted.iter().filter_map(|(x, _)| x.own().map(|own| own.1)).collect();
    let closed = found.q.clone();
    match own {
        Some(own) => match model.at_targets(t, &found.q, &own) {
            Some(q) => (found.q, found.explicit) = (q, true),
            None => {
                let moved = assembly::move_to(model, t, &mut found.q, &own, tolerance)
                    .map_err(|e| explain::targets(model, t, &closed, wanted, e))?;
                found.iterations += moved.iterations;
                found.steps += moved.target_steps;
            }
        },
        None => {
            let (targets, aims): (Vec<Target>, Vec<f64>) = wanted.iter().cloned().unzip();
            let mut continuation = Continuation::new(model, &targets, t);
            let start = continuation.start(&closed)?;
            let ending = continuation.go(&start, &aims, &mut found.q)?;
            let off = explain::off(&mut continuation, &found.q, &aims);
            if ending != Ending::There || off > tolerance::CLOSED.sqrt() {
                let nothing = SystemError::Targets {
                    message: "the targets cannot be met".into(),
                    residual: f64::NAN,
                    iterations: found.iterations,
                    loops: String::new(),
                };
                return Err(explain::targets(model, t, &closed, wanted, nothing));
            }
        }
    }
    let last = assembly::close(model, t, &mut found.q, tolerance, &velocities)?;
    found.iterations += last.iterations;
    found.residual = last.residual;
    Ok(())
}

/// Approach these targets as closely as the targets kept so far allow, and keep the values that are reached.
fn wish(
    model: &Model,
    t: f64,
    found: &mut One,
    kept: &mut Vec<(Target, f64)>,
    wishes: &[(Target, f64)],
) -> Result<(), SystemError> {
    let first = kept.len();
    kept.extend_from_slice(wishes);
    let (targets, mut aims): (Vec<Target>, Vec<f64>) = kept.iter().cloned().unzip();
    let mut continuation = Continuation::new(model, &targets, t);
    let start = continuation.start(&found.q)?;
    // angles measured from poses are taken to the nearest whole turn
    for k in first..aims.len() {
        if targets[k].wraps() {
            let turn = std::f64::consts::TAU;
            aims[k] += ((start.y[k] - aims[k]) / turn).round() * turn;
        }
    }
    aims[..first].copy_from_slice(&start.y[..first]);
    // directly where possible; otherwise continue from where that ends
    continuation.go(&start, &aims, &mut found.q)?;
    let f = &mut continuation.field;
    let m = f.closings();
    for k in 0..targets.len() {
        f.duty[m + k] = if k < first { Duty::Hard } else { Duty::Soft };
    }
    nearest(f, &mut found.q, &aims)?;
    f.look(&found.q);
    let own: Vec<usize> = kept[..first].iter().filter_map(|(x, _)| x.own().map(|own| own.1)).collect();
    for (k, (_, value)) in kept.iter_mut().enumerate().skip(first) {
        *value = f.y[k];
    }
    let last = assembly::close(model, t, &mut found.q, tolerance::CLOSED, &own)?;
    found.iterations += last.iterations;
    found.residual = last.residual;
    Ok(())
}
