//! Why targets cannot be reached: which of them contradict each other, the limit of a joint, and the closure error.

use super::continuation::{Continuation, Ending};
use super::field::Duty;
use super::goal::Target;
use super::messages::{gap, listed, loop_of};
use super::nearest::nearest;
use super::one::Ask;
use partita_math::tolerance;
use partita_model::zero_position::Coordinates;
use partita_model::Model;
use partita_system::kinematics::assembly;
use partita_system::prelude::*;
use partita_system::SystemError;

/// Values of a joint listed.
const LISTED: usize = 6;

/// Distance of the goals from their targets at q, in characteristic displacements.
pub(super) fn off(continuation: &mut Continuation, q: &[f64], aims: &[f64]) -> f64 {
    continuation.field.look(q);
    let f = &continuation.field;
    let far = f.y.iter().zip(aims).zip(f.targets).map(|((y, aim), x)| (y - aim).abs() / x.displacement);
    far.fold(0.0, f64::max)
}

/// Whether held joints are the reason why a drawing does not close.
pub(super) fn held(model: &Model, t: f64, drawn: &[f64], ask: &Ask, e: SystemError) -> SystemError {
    let own: Vec<&Target> = ask.fixed.iter().filter(|x| x.own().is_some()).collect();
    if own.is_empty() || !matches!(e, SystemError::Assembly { .. } | SystemError::Lengths { .. }) {
        return e;
    }
    if assembly::close(model, t, &mut drawn.to_vec(), ask.tolerance, &[]).is_err() {
        return e;
    }
    let names = listed(
        &own.iter().map(|x| format!("{} = {:.6}", x.name, drawn[x.own().unwrap_or((0, 0)).0])).collect::<Vec<_>>(),
    );
    let message = format!(
        "the loops close only if {names} may move; hold fewer joints, or give a guess in which the held joints \
         already fit ({e})"
    );
    targets_error(&e, message, f64::NAN, String::new())
}

fn targets_error(e: &SystemError, message: String, shortfall: f64, loops: String) -> SystemError {
    let (left, done, open) = match e {
        SystemError::Assembly { residual, iterations, loops, .. } => (*residual, *iterations, loops.clone()),
        SystemError::Lengths { residual, iterations, loops, .. } => (*residual, *iterations, loops.to_string()),
        SystemError::Targets { residual, iterations, loops, .. } => (*residual, *iterations, loops.clone()),
        _ => (f64::NAN, 0, String::new()),
    };
    let residual = if shortfall.is_finite() { shortfall } else { left };
    let loops = if loops.is_empty() { open } else { loops };
    SystemError::Targets { message, residual, iterations: done, loops }
}

/// Why these targets cannot be met from the closed position q, in words; `e` where the reason is not found.
pub(super) fn targets(model: &Model, t: f64, q: &[f64], wanted: &[(Target, f64)], e: SystemError) -> SystemError {
    if !matches!(e, SystemError::Assembly { .. } | SystemError::Targets { .. }) {
        return e;
    }
    let found = match by_joints(model, q, wanted) {
        Some((twin, q, wanted)) => explained(&twin, t, &q, &wanted, &e),
        None => explained(model, t, q, wanted, &e),
    };
    match found {
        Ok(Some(found)) => found,
        Ok(None) => e,
        Err(other) => other,
    }
}

/// A model, a closed position of it, and the targets.
type PoseRequest = (Model, Vec<f64>, Vec<(Target, f64)>);

/// The same question in joint coordinates, where a gap shows in one joint instead of a little in all of them.
fn by_joints(model: &Model, q: &[f64], wanted: &[(Target, f64)]) -> Option<PoseRequest> {
    if model.coordinates() == Coordinates::Relative || wanted.iter().any(|(x, _)| x.own().is_some()) {
        return None;
    }
    let twin = model.in_coordinates(Coordinates::Relative).ok()?;
    let (q, _) = twin.transferred(model, q, &vec![0.0; model.size().nv]);
    let again = |(x, value): &(Target, f64)| Target::new(&twin, &x.goal, &x.name).ok().map(|x| (x, *value));
    let wanted: Option<Vec<_>> = wanted.iter().map(again).collect();
    wanted.map(|wanted| (twin, q, wanted))
}

fn explained(
    model: &Model,
    t: f64,
    q: &[f64],
    wanted: &[(Target, f64)],
    e: &SystemError,
) -> Result<Option<SystemError>, SystemError> {
    let (all, aims): (Vec<Target>, Vec<f64>) = wanted.iter().cloned().unzip();
    let mut here = q.to_vec();
    // one after the other: the first that cannot be met when those before it are
    for k in 0..all.len() {
        let mut continuation = Continuation::new(model, &all[..=k], t);
        let start = continuation.start(&here)?;
        let mut there = here.clone();
        let ending = if start.free[k] { continuation.go(&start, &aims[..=k], &mut there)? } else { Ending::There };
        if ending == Ending::There && off(&mut continuation, &there, &aims[..=k]) <= tolerance::CLOSED.sqrt() {
            here = there;
            continue;
        }
        let x = &all[k];
        let (held, turn) = (targets_text(&all[..k], &aims[..k]), format!("{} = {:.6}", x.name, aims[k]));
        if !start.free[k] {
            let (values, others) = possible(model, t, &here, &all[..k], x);
            let can = listed_or(&values.iter().map(|v| format!("{v:.6}")).collect::<Vec<_>>());
            let message = match k {
                0 => format!("{turn} cannot be reached: {} cannot move from {can} {} here", x.name, x.unit),
                _ => format!(
                    "the targets {} contradict each other: with {held} {} can be {can} {}{others}, not {:.6}; drop \
                     one of them, or give it a lower priority",
                    listed(&[held.clone(), turn.clone()]),
                    x.name,
                    x.unit,
                    aims[k]
                ),
            };
            return Ok(Some(targets_error(e, message, f64::NAN, String::new())));
        }
        continuation.field.look(&there);
        let end = continuation.field.y[k];
        let f = &mut continuation.field;
        let m = f.closings();
        f.duty[..m].fill(Duty::Soft);
        f.duty[m..].fill(Duty::Hard);
        nearest(f, &mut there, &aims[..=k])?;
        let met = f.worst(Duty::Hard) <= tolerance::CLOSED.sqrt();
        let (worst, length, angle) = f.closure_error();
        let closes = met && f.worst(Duty::Soft) <= tolerance::CLOSED.sqrt();
        let with = if k == 0 { String::new() } else { format!(" with {held}") };
        let so_far = format!("{turn} cannot be reached{with}: {} ends at {end:.6} {}", x.name, x.unit);
        let message = match ending {
            Ending::Crossing(_) => {
                format!("{so_far}, at a singular position where branches meet; give `near` beyond it")
            }
            _ if closes => format!(
                "{so_far}; another branch closes there, but no motion leads to it from here; give `near` on that branch"
            ),
            _ if met => format!(
                "{so_far}; at the target, {} keeps a closure error of {}; choose a nearer target, or change a \
                 length of this loop by at least that much",
                loop_of(model, worst),
                gap(length, angle)
            ),
            _ => format!("{so_far}; no configuration reaches the target; choose a nearer one"),
        };
        return Ok(Some(targets_error(
            e,
            message,
            if met { length.max(angle) } else { f64::NAN },
            loop_of(model, worst),
        )));
    }
    Ok(None)
}

fn targets_text(targets: &[Target], aims: &[f64]) -> String {
    listed(&targets.iter().zip(aims).map(|(x, aim)| format!("{} = {aim:.6}", x.name)).collect::<Vec<_>>())
}

fn listed_or(words: &[String]) -> String {
    match words {
        [first @ .., last] if !first.is_empty() => format!("{} or {last}", first.join(", ")),
        _ => words.concat(),
    }
}

/// Values of x in the assemblies for the other targets at q, at least that of q itself; and which assemblies these are,
/// if not all.
fn possible(model: &Model, t: f64, q: &[f64], others: &[Target], x: &Target) -> (Vec<f64>, &'static str) {
    let (rest, mut s) = (vec![0.0; model.size().nv], model.scratch());
    let mut values = vec![x.value(model, q, &rest, &mut s, 0.0)];
    let inputs: Option<Vec<usize>> = others.iter().map(|x| x.own().map(|own| own.1)).collect();
    let all = inputs.and_then(|inputs| model.assemblies(t, q, Some(&inputs)).ok());
    for one in all.iter().flat_map(|all| &all.found) {
        let value = x.value(model, &one.q, &rest, &mut s, values[0]);
        if values.iter().all(|v| (v - value).abs() > tolerance::EQUAL_IN_SIX_DIGITS * x.displacement) {
            values.push(value);
        }
    }
    let whole = all.is_some_and(|all| all.found.len() > 1 || all.notes.is_empty()) && values.len() <= LISTED;
    values.truncate(LISTED);
    (values, if whole { "" } else { " on this branch, or a value that another branch allows" })
}
