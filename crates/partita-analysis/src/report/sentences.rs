//! The sentences of a report: redundancy, floating bodies, nearness to a singular position.

use crate::mobility::{Mobility, Redundant};
use crate::reason::names;
use crate::remedies::Remedy;
use partita_model::Model;
use std::collections::HashSet;

/// A position is close to a singular one below this. Scale: squared sine of the closing rows. Reason: closure errors
/// are amplified a hundred times there.
const CLOSE_TO_SINGULAR: f64 = 1e-4;
/// Reasons listed before the rest is counted.
const REASONS: usize = 3;

/// A number of things.
fn count(n: usize, one: &str, many: &str) -> String {
    format!("{n} {}", if n == 1 { one } else { many })
}

/// Notes on the whole mechanism, one sentence each.
pub(super) fn notes(model: &Model, found: &Mobility) -> Vec<String> {
    let mut notes = Vec::new();
    notes.extend(found.of_drawing(model.spec.drawing_tolerance));
    let superfluous: Vec<&Redundant> = found.redundant[found.closing_rows - found.closing_rank..].iter().collect();
    for d in superfluous {
        // a drive of a measure is called by its own name
        let of = if d.row.ends_with(&d.joint) { String::new() } else { format!(" of {}", d.joint) };
        notes.push(format!("{}{of} is redundant: {}; remove it", d.row, d.why));
    }
    notes.extend(floating(model));
    if found.smallest < CLOSE_TO_SINGULAR {
        notes.push(format!(
            "close to a singular position: a loop-closure row is within {:.1e} rad of being dependent on the \
             others, and errors grow as the inverse of that angle; start farther away if possible",
            found.smallest.sqrt()
        ));
    }
    notes
}

/// Over-constraint of the bodies by the joints, its reason and its remedy: one paragraph, empty where nothing is
/// redundant.
pub(super) fn redundancy(found: &Mobility, replacements: &[Remedy]) -> String {
    let rows = &found.redundant[..found.closing_rows - found.closing_rank];
    if rows.is_empty() {
        return String::new();
    }
    let mut reasons: Vec<(&str, Vec<&str>)> = Vec::new();
    let mut others = 0;
    for r in rows {
        match reasons.iter().position(|x| x.0 == r.why) {
            Some(i) => reasons[i].1.push(&r.row),
            None if reasons.len() < REASONS => reasons.push((&r.why, vec![&r.row])),
            None => others += 1,
        }
    }
    let verb = if rows.len() == 1 { "is" } else { "are" };
    let mut reported = vec![format!(
        "Over-constrained: {} of the {} {verb} redundant (rank {}).",
        rows.len(),
        count(found.joint_rows, "constraint of the joints", "constraints of the joints"),
        found.joint_rank
    )];
    reported.extend(reasons.iter().map(|(why, of)| format!("{}: {why}.", names(of))));
    if others > 0 {
        reported.push(format!(
            "Redundant for similar reasons: {}.",
            count(others, "further constraint", "further constraints")
        ));
    }
    reported.push(
        "They change neither the motion nor the reactions marked as determined; the other reactions are distributed \
         by least squares, or by the compliances given."
            .into(),
    );
    if !replacements.is_empty() {
        let all: Vec<String> = replacements.iter().map(|c| format!("{} {} by {}", c.is, c.joint, c.by)).collect();
        reported.push(format!("Remedy: replace {}; then nothing is redundant, and nothing else moves.", names(&all)));
    }
    reported.join(" ")
}

/// Bodies that no chain of joints and couplings links to the ground, one note per group.
pub(super) fn floating(model: &Model) -> Vec<String> {
    let nodes = model.spec.bodies.len() + 1;
    let mut neighbours = vec![Vec::new(); nodes];
    for p in &model.zero_position().joints {
        neighbours[p.parent].push(p.child);
        neighbours[p.child].push(p.parent);
    }
    let node = |name: &str| model.spec.bodies.iter().position(|b| b.name == name).map_or(0, |i| i + 1);
    for coupling in &model.spec.couplings {
        let ends: Vec<usize> = model.spec.joined_by(coupling).into_iter().map(node).collect();
        for pair in ends.windows(2) {
            neighbours[pair[0]].push(pair[1]);
            neighbours[pair[1]].push(pair[0]);
        }
    }
    let mut seen = HashSet::new();
    let mut group = |first: usize| {
        let (mut open, mut group) = (vec![first], Vec::new());
        while let Some(i) = open.pop() {
            if seen.insert(i) {
                group.push(i);
                open.extend(&neighbours[i]);
            }
        }
        group.sort_unstable();
        group
    };
    group(0);
    let mut notes = Vec::new();
    for i in 1..nodes {
        let bodies: Vec<&str> = group(i).iter().map(|&i| model.spec.bodies[i - 1].name.as_str()).collect();
        match bodies.as_slice() {
            [] => {}
            [one] => notes.push(format!("{one} is connected by no joint: it floats freely")),
            all => notes.push(format!(
                "{} are connected with each other but not with the ground: they float freely",
                names(all)
            )),
        }
    }
    notes
}
