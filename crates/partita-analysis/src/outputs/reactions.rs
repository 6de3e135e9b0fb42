//! Reactions of joints along a motion.

use super::chunk_of;
use super::rows::{tables, Rows, Watch};
use super::{Forces, States};
use crate::error::AnalysisError;
use crate::sharing::{with_rule_for_loads, Rule, SharingScratch};
use partita_model::model::ModelScratch;
use partita_model::reaction::Wrench;
use partita_model::Model;
use partita_system::prelude::*;

/// Width of the axes of a joint (row by row) in the tables of this module.
pub const JOINT_AXES: usize = 9;

/// The first output with finite reactions, at which redundancy is analysed.
fn reference<'a>(model: &Model, states: &States<'a>, forces: &Forces) -> Option<(f64, &'a [f64])> {
    let known = |i: &usize| {
        let (vdot, lambda) = forces.at(model, *i);
        vdot.iter().chain(lambda).all(|x| x.is_finite())
    };
    (0..states.len()).find(known).map(|i| {
        let (t, q, _) = states.at(model, i);
        (t, q)
    })
}

/// Whether the rule of [`sharing`](crate::sharing) has any effect. If so, one reaction costs as much as all.
///
/// # Errors
/// Where the mechanism cannot be compiled in space.
pub fn shares(model: &Model, states: &States, forces: &Forces) -> Result<bool, AnalysisError> {
    with_rule_for_loads(model.permanent(), reference(model, states, forces), |rule| Ok(rule.is_some()))
}

/// Distribute undetermined reactions; drives that do not always hold take no part in that.
fn share(
    model: &Model,
    rule: &Rule,
    (t, q): (f64, &[f64]),
    joints: &mut [Wrench],
    lambda: &mut [f64],
    memory: &mut SharingScratch,
) -> Result<(), AnalysisError> {
    let rows = model.rows_of(model.permanent());
    let mut own: Vec<f64> = rows.iter().map(|&row| lambda[row]).collect();
    rule.share(t, q, joints, &mut own, memory)?;
    rows.iter().zip(own).for_each(|(&row, x)| lambda[row] = x);
    Ok(())
}

/// Scratch memory of a thread: that of the model, and that of the rule where there is one.
fn scratches<'a>(
    model: &'a Model,
    rule: Option<&'a Rule>,
) -> impl Fn() -> (ModelScratch, Option<SharingScratch<'a>>) + 'a {
    move || (model.scratch(), rule.map(Rule::memory))
}

/// Force, moment, efforts of the drives and axes of one joint, for a motion with its accelerations and multipliers.
///
/// Undetermined components are chosen by the rule of [`sharing`](crate::sharing), which involves all joints.
///
/// # Errors
/// Errors of user functions on the bodies that the joint connects, and those of `watch`.
pub fn reaction(
    model: &Model,
    states: &States,
    forces: &Forces,
    j: usize,
    watch: Watch,
) -> Result<Vec<Vec<f64>>, AnalysisError> {
    let dof = model.shape(j).dof();
    with_rule_for_loads(model.permanent(), reference(model, states, forces), |rule| {
        let part = if rule.is_some() { model.whole().clone() } else { model.equations().part_of_reaction(j) };
        let row = |i: usize, (s, memory): &mut (ModelScratch, Option<SharingScratch>), rows: &mut Rows| {
            let ((t, q, v), (vdot, lambda)) = (states.at(model, i), forces.at(model, i));
            let mut drives = model.equations().drive_of(j, lambda);
            let w = match (rule, memory) {
                (Some(rule), Some(memory)) => {
                    let mut joints =
                        model.equations().reactions_of(&part, t, q, v, vdot, lambda, s.equations())?.joints;
                    let mut shared = lambda.to_vec();
                    share(model, rule, (t, q), &mut joints, &mut shared, memory)?;
                    drives = model.equations().drive_of(j, &shared);
                    joints[j]
                }
                _ => model.equations().reaction_of(j, &part, t, q, v, vdot, lambda, s.equations())?,
            };
            rows.row(0, i).copy_from_slice(&w.force.0);
            rows.row(1, i).copy_from_slice(&w.moment.0);
            rows.row(2, i).copy_from_slice(&drives);
            rows.row(3, i).copy_from_slice(model.joint_frame(j, s).0.as_flattened());
            Ok(())
        };
        tables(states.len(), &[3, 3, dof, JOINT_AXES], chunk_of(model), scratches(model, rule), row, watch)
    })
}

/// As `reaction`, for all joints side by side, with the Newton-Euler residual over the largest force, that of each body,
/// and the multipliers of all conditions other than loop closures: efforts of couplings and drives, distributed by the same
/// rule.
///
/// # Errors
/// Errors of user functions and of `watch`.
pub fn reactions(
    model: &Model,
    states: &States,
    forces: &Forces,
    watch: Watch,
) -> Result<Vec<Vec<f64>>, AnalysisError> {
    let (whole, nj) = (model.whole(), model.spec.joints.len());
    let dof: usize = model.zero_position().joints.iter().map(|p| p.shape.dof()).sum();
    with_rule_for_loads(model.permanent(), reference(model, states, forces), |rule| {
        let row = |i: usize, (s, memory): &mut (ModelScratch, Option<SharingScratch>), rows: &mut Rows| {
            let ((t, q, v), (vdot, lambda)) = (states.at(model, i), forces.at(model, i));
            let mut r = model.equations().reactions_of(whole, t, q, v, vdot, lambda, s.equations())?;
            let mut shared = lambda.to_vec();
            if let (Some(rule), Some(memory)) = (rule, memory) {
                let mut joints = r.joints.clone();
                share(model, rule, (t, q), &mut joints, &mut shared, memory)?;
                let change: Vec<f64> = shared.iter().zip(lambda).map(|(x, y)| x - y).collect();
                model.equations().replace_reactions(&mut r, &joints, (t, q, &change), s.evaluated())?;
                for (j, _) in model.drives().iter().filter_map(|d| d.joint) {
                    r.drives[j] = model.equations().drive_of(j, &shared);
                }
            }
            rows.row(6, i).copy_from_slice(&shared[model.closing_rows..]);
            for (to, from) in rows.row(2, i).iter_mut().zip(r.drives.iter().flatten()) {
                *to = *from;
            }
            write(rows, i, &r.joints);
            for j in 0..nj {
                rows.row(3, i)[9 * j..][..9].copy_from_slice(model.joint_frame(j, s).0.as_flattened());
            }
            rows.row(4, i)[0] = r.residual;
            rows.row(5, i).copy_from_slice(&r.residuals);
            Ok(())
        };
        let conditions = model.size().rows - model.closing_rows;
        let widths = [3 * nj, 3 * nj, dof, JOINT_AXES * nj, 1, model.spec.bodies.len(), conditions];
        tables(states.len(), &widths, chunk_of(model), scratches(model, rule), row, watch)
    })
}

/// Forces and moments of all joints side by side, by augmented joint coordinates and the same rule.
///
/// # Errors
/// Errors of user functions and of `watch`.
pub fn augmented(
    model: &Model,
    states: &States,
    forces: &Forces,
    watch: Watch,
) -> Result<Vec<Vec<f64>>, AnalysisError> {
    let nj = model.spec.joints.len();
    with_rule_for_loads(model.permanent(), reference(model, states, forces), |rule| {
        let row = |i: usize, (s, memory): &mut (ModelScratch, Option<SharingScratch>), rows: &mut Rows| {
            let ((t, q, v), (vdot, lambda)) = (states.at(model, i), forces.at(model, i));
            let mut joints = model.augmented_reactions(t, q, v, vdot, lambda, s)?;
            if let (Some(rule), Some(memory)) = (rule, memory) {
                share(model, rule, (t, q), &mut joints, &mut lambda.to_vec(), memory)?;
            }
            write(rows, i, &joints);
            Ok(())
        };
        tables(states.len(), &[3 * nj, 3 * nj], chunk_of(model), scratches(model, rule), row, watch)
    })
}

/// Forces and moments into the first two tables.
fn write(rows: &mut Rows, i: usize, joints: &[Wrench]) {
    for (j, w) in joints.iter().enumerate() {
        rows.row(0, i)[3 * j..][..3].copy_from_slice(&w.force.0);
        rows.row(1, i)[3 * j..][..3].copy_from_slice(&w.moment.0);
    }
}
