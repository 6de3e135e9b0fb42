//! Measures of many positions.

use super::slice::{Set, Slice};
use super::Range;
use crate::error::AnalysisError;
use crate::inverse::Inverse;
use crate::outputs::{chunk_of, tables, Rows, Watch};
use partita_model::Model;
use partita_system::prelude::*;
use partita_system::{start, SystemError};

/// What a set of actuators can do at each position in the rows of q, of one branch of closed positions: the part of each
/// along the admissible motions, `L_d⁻¹ D E diag(1/|k_s|)` (k x s); NaN where the constraints are singular.          (25)
///
/// The margin of any subset is the least singular value of its columns.
///
/// # Errors
/// Those of functions that the model calls, and of `watch`.
pub fn measures(
    model: &Model,
    inverse: &Inverse,
    t: f64,
    q: &[f64],
    watch: Watch,
) -> Result<(usize, Vec<f64>, Vec<f64>), AnalysisError> {
    let (size, s) = (model.size(), inverse.count());
    let count = q.len() / size.nq.max(1);
    let row_of = |i: usize| &q[i * size.nq..][..size.nq];
    let finite = |x: &[f64]| x.iter().all(|x| x.is_finite());
    let regular = (0..count).map(row_of).filter(|x| finite(x)).find_map(|x| start::analyse(model, t, x).ok());
    let Some(regular) = regular else { return Ok((0, Vec::new(), vec![0.0; count])) };
    let rank = regular.rank;
    let k = size.nv - rank;
    let set = |i: usize, memory: &mut crate::inverse::InverseScratch, rows: &mut Rows| {
        rows.row(0, i).fill(f64::NAN);
        if !finite(row_of(i)) {
            return Ok(());
        }
        match inverse.set(t, row_of(i), memory) {
            Ok(found) => rows.row(0, i).copy_from_slice(found.scaled().data()),
            Err(AnalysisError::System(SystemError::Singular { .. } | SystemError::SingularStart { .. })) => {}
            Err(e) => return Err(e),
        }
        Ok(())
    };
    let found = tables(count, &[k * s], chunk_of(model), || inverse.memory(rank), set, watch)?;
    let weakest = weakest_constraints(model, t, (q, rank), watch)?;
    Ok((k, found.into_iter().next().unwrap_or_default(), weakest))
}

/// The least singular value of the constraints in natural scales at each position.
fn weakest_constraints(
    model: &Model,
    t: f64,
    (q, rank): (&[f64], usize),
    watch: Watch,
) -> Result<Vec<f64>, AnalysisError> {
    let nq = model.size().nq;
    let count = q.len() / nq.max(1);
    let none = Range { t, targets: &[], limits: &[], seeds: &[], one_branch: false };
    let one = |i: usize, slice: &mut Slice, rows: &mut Rows| {
        let there = &q[i * nq..][..nq];
        rows.row(0, i)[0] = if there.iter().all(|x| x.is_finite()) {
            slice.field.evaluate(there)?;
            slice.weakest_constraint(there)?
        } else {
            f64::NAN
        };
        Ok::<(), AnalysisError>(())
    };
    let made = || Slice::of_rank(model, none, Set::Constraints, rank);
    Ok(tables(count, &[1], chunk_of(model), made, one, watch)?.into_iter().next().unwrap_or_default())
}
