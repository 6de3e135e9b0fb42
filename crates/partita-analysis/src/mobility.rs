//! Mobility and redundancy: how many ways the mechanism can move, and which rows of its joints say nothing new.

use crate::error::AnalysisError;
use crate::geometry::{in_space, Geometry};
use crate::reason::{names, reason};
use crate::stress::{stresses, Pose};
use partita_math::elimination::Pattern;
use partita_math::rank::independent_rows;
use partita_model::Model;
use partita_system::start::{analyse, REDUNDANT};
use partita_system::{ConstrainedSystem, SystemError};
use serde::Serialize;

/// A row that says nothing new.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Redundant {
    /// Its name.
    pub row: String,
    /// The joint it belongs to.
    pub joint: String,
    /// Why, in a sentence.
    pub why: String,
}

/// What can move, and what holds it. Joints are counted in space, whether or not the mechanism is planar.
///
/// ```text
/// joint_rows − joint_rank = closing_rows − closing_rank = redundant rows of joints
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mobility {
    /// Degrees of freedom k, those that drives prescribe not counted.
    pub mobility: usize,
    /// Conditions of all joints together: 5 for a revolute.
    pub joint_rows: usize,
    /// How many of them are independent: 6 · bodies − degrees of freedom with the drives released.
    pub joint_rank: usize,
    /// Conditions of the joints that close loops.
    pub closing_rows: usize,
    /// How many of them are independent.
    pub closing_rank: usize,
    /// Rows that follow from the others, and drives that leave nothing to prescribe, in the order of `dropped`. The
    /// choice among rows that depend on each other is not unique; their number is.
    pub redundant: Vec<Redundant>,
    /// The same as rows of [`Model::in_space`], ascending.
    pub dropped: Vec<usize>,
}

/// Mobility and redundant rows at an assembled position.
///
/// Masses do not enter. Fails at a singular position, where rows depend on each other that do not next to it.
/// Cost: sparse; in proportion to the number of loops of a chain, and one sparse solution per redundant row.
pub fn mobility(model: &Model, t: f64, q: &[f64]) -> Result<Mobility, AnalysisError> {
    let (twin, q) = in_space(model, q)?;
    let released = Geometry::new(&twin, false);
    let free = analyse(&released, t, &q)?;
    let (nv, bodies) = (twin.placed.nv, twin.placed.bodies.len());
    let pose = Pose::new(&twin, &q);
    let mut redundant = Vec::with_capacity(free.dropped.len());
    for (stress, &row) in stresses(&released, &pose, &free, t, &q)?.iter().zip(&free.dropped) {
        redundant.push(Redundant {
            row: twin.row_name(row),
            joint: twin.spec.joints[twin.joint_of_row(row)].name.clone(),
            why: reason(&pose, stress),
        });
    }
    let mut found = Mobility {
        mobility: nv - free.rank,
        joint_rows: twin.placed.joints.iter().map(|p| p.shape.rows()).sum(),
        joint_rank: 6 * bodies + free.rank - nv,
        closing_rows: twin.row_names.len(),
        closing_rank: free.rank,
        redundant,
        dropped: free.dropped,
    };
    if !twin.drives.is_empty() {
        let driven = Geometry::new(&twin, true);
        let rank = analyse(&driven, t, &q)?.rank;
        if rank < found.closing_rank + twin.drives.len() {
            superfluous_drives(&driven, t, &q, &mut found)?;
        }
        found.mobility = nv - rank;
    }
    Ok(found)
}

/// Drives whose coordinate the loops and the drives before them already prescribe.
fn superfluous_drives(driven: &Geometry, t: f64, q: &[f64], found: &mut Mobility) -> Result<(), SystemError> {
    let (size, pattern, reach, model) = (driven.size(), driven.pattern(), driven.scales(), driven.model);
    let (mut phi, mut c, mut a) = (vec![0.0; size.rows], vec![0.0; pattern.nnz()], vec![0.0; size.rows]);
    driven.position(t, q, &mut driven.scratch(), &mut phi, &mut c, &mut a)?;
    let mut rows: Vec<usize> = (0..model.row_names.len()).filter(|i| found.dropped.binary_search(i).is_err()).collect();
    let mut before: Vec<&str> = Vec::new();
    let has_motion = found.mobility > 0;
    for d in &model.drives {
        rows.push(d.row);
        let columns: Vec<Vec<usize>> = rows.iter().map(|&i| pattern.col_idx[pattern.row(i)].to_vec()).collect();
        let values: Vec<f64> = rows.iter().flat_map(|&i| &c[pattern.row(i)]).copied().collect();
        let rank = independent_rows(&Pattern::from_rows(pattern.cols, &columns), &values, &reach, REDUNDANT).rank;
        if rank == rows.len() {
            before.push(&d.name);
            continue;
        }
        rows.pop();
        found.dropped.push(d.row);
        let why = match (has_motion, before.as_slice()) {
            (false, _) => "the mechanism has no motion that could be driven".into(),
            (true, []) => "the closed loops leave this coordinate no motion that could be driven".into(),
            (true, before) => format!("with {} driven, this coordinate follows already", names(before)),
        };
        let joint = model.spec.joints[d.joint].name.clone();
        found.redundant.push(Redundant { row: driven.row_name(d.row), joint, why });
    }
    Ok(())
}
