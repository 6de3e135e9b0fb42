//! Where bodies and joints are, how they move, and the energies.

use super::chunk_of;
use super::rows::{tables, Watch};
use super::States;
use crate::error::AnalysisError;
use crate::instant::Levels;
use partita_model::model::ModelScratch;
use partita_model::observe::{DegreeOfFreedom, JointState, TurnCounter};
use partita_model::{Model, Part};
use partita_system::prelude::*;

/// Widths of the tables of [`bodies`] for one body: position, rotation (row by row), velocity, angular velocity.
pub const BODY: [usize; 4] = [3, 9, 3, 3];
/// Width of the last table of [`joints`] for one joint.
pub const JOINT_POINT: usize = 3;

/// The part of the mechanism on which the requested outputs depend.
fn part_of(model: &Model, which: &[usize], one: impl Fn(usize) -> Part) -> Part {
    match which {
        [i] => one(*i),
        _ => model.whole().clone(),
    }
}

/// Position of the origin, rotation, velocity of the origin and angular velocity of the bodies `which`, world axes.
///
/// # Errors
/// The errors of `watch`.
pub fn bodies(model: &Model, states: &States, which: &[usize], watch: Watch) -> Result<Vec<Vec<f64>>, AnalysisError> {
    let part = part_of(model, which, |i| model.equations().part_of_body(i));
    let widths = BODY.map(|w| w * which.len());
    let row = |i: usize, s: &mut ModelScratch, rows: &mut super::Rows| {
        let (_, q, v) = states.at(model, i);
        model.equations().look_at(&part, q, v, s.equations());
        for (index, &body) in which.iter().enumerate() {
            let x = model.body_state(body, s);
            rows.row(0, i)[3 * index..][..3].copy_from_slice(&x.position.0);
            for (to, from) in rows.row(1, i)[9 * index..][..9].chunks_mut(3).zip(&x.rotation.0) {
                to.copy_from_slice(from);
            }
            rows.row(2, i)[3 * index..][..3].copy_from_slice(&x.velocity.0);
            rows.row(3, i)[3 * index..][..3].copy_from_slice(&x.angular_velocity.0);
        }
        Ok(())
    };
    tables(states.len(), &widths, 1, || model.scratch(), row, watch)
}

/// Coordinates, velocities and points (on the child, world axes) of the joints `which`, side by side.
///
/// Whole turns of joints that close spatial loops are counted from one output to the next.
///
/// # Errors
/// The errors of `watch`.
pub fn joints(model: &Model, states: &States, which: &[usize], watch: Watch) -> Result<Vec<Vec<f64>>, AnalysisError> {
    let part = part_of(model, which, |j| model.equations().part_of_joint(j));
    let size = |j: usize| {
        let shape = model.shape(j);
        (shape.motions.iter().map(partita_model::joint::Motion::coordinates).sum::<usize>(), shape.dof())
    };
    let (nq, nv) = which.iter().map(|&j| size(j)).fold((0, 0), |sum, x| (sum.0 + x.0, sum.1 + x.1));
    let row = |i: usize, s: &mut ModelScratch, rows: &mut super::Rows| {
        let (_, q, v) = states.at(model, i);
        model.equations().look_at(&part, q, v, s.equations());
        let (mut at_q, mut at_v) = (0, 0);
        for (index, &j) in which.iter().enumerate() {
            let x = model.joint_state(j, q, v, s);
            rows.row(0, i)[at_q..][..x.position.len()].copy_from_slice(&x.position);
            rows.row(1, i)[at_v..][..x.velocity.len()].copy_from_slice(&x.velocity);
            rows.row(2, i)[3 * index..][..3].copy_from_slice(&x.point);
            (at_q, at_v) = (at_q + x.position.len(), at_v + x.velocity.len());
        }
        Ok(())
    };
    let mut found = tables(states.len(), &[nq, nv, JOINT_POINT * which.len()], 1, || model.scratch(), row, watch)?;
    let mut turns = TurnCounter::new(model);
    let (mut at_q, mut at_v) = (0, 0);
    for &j in which {
        let (of_q, of_v) = size(j);
        let counted: &[f64] = if turns.counts(j) { states.t } else { &[] };
        for (i, &t) in counted.iter().enumerate() {
            let position = &mut found[0][i * nq + at_q..][..of_q];
            let mut x = JointState { position: position.to_vec(), ..JointState::default() };
            let velocity = i * nv + at_v;
            x.velocity = found[1][velocity..velocity + of_v].to_vec();
            turns.unwrap(j, t, &mut x);
            found[0][i * nq + at_q..][..of_q].copy_from_slice(&x.position);
        }
        (at_q, at_v) = (at_q + of_q, at_v + of_v);
    }
    Ok(found)
}

/// Accelerations along the degrees of freedom of the joints `which`, side by side, in the order of their velocities.
///
/// # Errors
/// The errors of `watch`.
pub fn joint_accelerations(
    model: &Model,
    states: &States,
    vdot: &[f64],
    which: &[usize],
    watch: Watch,
) -> Result<Vec<Vec<f64>>, AnalysisError> {
    let part = part_of(model, which, |j| model.equations().part_of_joint(j));
    let dof = model.degrees_of_freedom_of(which).map_err(AnalysisError::from)?;
    let nv = model.size().nv;
    let row = |i: usize, (s, own): &mut (ModelScratch, Vec<DegreeOfFreedom>), rows: &mut super::Rows| {
        let (_, q, v) = states.at(model, i);
        model.equations().look_at(&part, q, v, s.equations());
        for (to, dof) in rows.row(0, i).iter_mut().zip(own) {
            *to = dof.acceleration(model, &vdot[i * nv..][..nv], s);
        }
        Ok(())
    };
    let memory = || (model.scratch(), dof.clone());
    tables(states.len(), &[dof.len()], 1, memory, row, watch)
}

/// Kinetic and potential energy. User functions that have a potential are called once per output.
///
/// # Errors
/// What such a function raises, and those of `watch`.
pub fn energies(model: &Model, states: &States, watch: Watch) -> Result<Vec<Vec<f64>>, AnalysisError> {
    let row = |i: usize, levels: &mut Levels<Model>, rows: &mut super::Rows| {
        let (t, q, v) = states.at(model, i);
        levels.velocity(t, q, v)?;
        let (kinetic, potential) = model.energy(t, q, v, &levels.scratch)?;
        rows.row(0, i)[0] = kinetic;
        rows.row(1, i)[0] = potential;
        Ok(())
    };
    let mut found = tables(states.len(), &[1, 1], chunk_of(model), || Levels::new(model), row, watch)?;
    for (to, counted) in found[1].iter_mut().zip(counted_potential(model, states, watch)?) {
        *to += counted;
    }
    Ok(found)
}

/// Potential of one force, if it is a constant effort whose coordinate is counted at outputs.
fn potential_of(model: &Model, states: &States, i: usize, watch: Watch) -> Result<Option<Vec<f64>>, AnalysisError> {
    let Some(x) = model.counted_effort(i) else { return Ok(None) };
    let positions = joints(model, states, &[x.joint], watch)?.swap_remove(0);
    let width = positions.len() / states.len().max(1);
    Ok(Some(positions.chunks(width.max(1)).map(|at| -x.effort * at[x.coordinate]).collect()))
}

/// Potential of all such efforts together; empty where there are none.
///
/// # Errors
/// Those of `watch`.
pub fn counted_potential(model: &Model, states: &States, watch: Watch) -> Result<Vec<f64>, AnalysisError> {
    let mut sum: Vec<f64> = Vec::new();
    for i in 0..model.spec.forces.len() {
        let Some(one) = potential_of(model, states, i, watch)? else { continue };
        sum.resize(one.len(), 0.0);
        sum.iter_mut().zip(one).for_each(|(to, x)| *to += x);
    }
    Ok(sum)
}

/// Accelerations of the origins of the bodies `which`, and angular accelerations, world axes.
///
/// # Errors
/// The errors of `watch`.
pub fn body_accelerations(
    model: &Model,
    states: &States,
    vdot: &[f64],
    which: &[usize],
    watch: Watch,
) -> Result<Vec<Vec<f64>>, AnalysisError> {
    let part = part_of(model, which, |i| model.equations().part_of_body(i));
    let nv = model.size().nv;
    let row = |i: usize, s: &mut ModelScratch, rows: &mut super::Rows| {
        let (_, q, v) = states.at(model, i);
        model.equations().look_at(&part, q, v, s.equations());
        for (index, &body) in which.iter().enumerate() {
            let found = model.body_acceleration(body, &part, &vdot[i * nv..][..nv], s);
            for (table, x) in found.into_iter().enumerate() {
                rows.row(table, i)[3 * index..][..3].copy_from_slice(&x.0);
            }
        }
        Ok(())
    };
    tables(states.len(), &[3 * which.len(); 2], 1, || model.scratch(), row, watch)
}

/// Power, potential and effort (NaN where there is none) of applied force `number` of the description, then point,
/// force and moment on each body that it acts on, world axes; also how many these are.
///
/// # Errors
/// If there is no such force; errors of user functions and of `watch`.
pub fn load(
    model: &Model,
    states: &States,
    number: usize,
    watch: Watch,
) -> Result<(Vec<Vec<f64>>, usize), AnalysisError> {
    let (e, bodies) = model.load_number(number).map_err(AnalysisError::from)?;
    let part = model.equations().part_of_load(e);
    let row = |i: usize, s: &mut ModelScratch, rows: &mut super::Rows| {
        let (t, q, v) = states.at(model, i);
        model.equations().look_at(&part, q, v, s.equations());
        let found = model.equations().shown(e, t, q, v, s.equations())?;
        rows.row(0, i)[0] = found.power;
        rows.row(1, i)[0] = found.potential;
        rows.row(2, i)[0] = found.effort.unwrap_or(f64::NAN);
        for (index, push) in found.wrenches.iter().take(bodies).enumerate() {
            for (table, x) in push.iter().enumerate() {
                rows.row(3 + table, i)[3 * index..][..3].copy_from_slice(&x.0);
            }
        }
        Ok(())
    };
    let wide = 3 * bodies;
    let memory = || model.scratch();
    let mut found = tables(states.len(), &[1, 1, 1, wide, wide, wide], chunk_of(model), memory, row, watch)?;
    if let Some(potential) = potential_of(model, states, number, watch)? {
        found[1] = potential;
    }
    Ok((found, bodies))
}
