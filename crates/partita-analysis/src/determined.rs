//! Which components of the reactions the motion determines.
//!
//! A self-stress can be added to the reactions of any motion. A component that every self-stress leaves alone is
//! determined; any other depends on elasticity and clearances, which rigid bodies do not have (Wojtyra 2005).

use crate::error::AnalysisError;
use crate::geometry::{in_space, Geometry};
use crate::stress::{stresses, Pose};
use partita_model::Model;
use partita_system::start::analyse;
use partita_system::ConstrainedSystem;

/// For each joint: are its (fx, fy, fz, mx, my, mz) determined? In joint axes if `in_joint_frame`, else in world axes.
///
/// Along a free direction of the joint there is no reaction but a drive's; none counts as determined (zero).
/// Fails where [`mobility`](crate::mobility::mobility) does. Cost: one sparse solution per redundant row.
pub fn determined(model: &Model, t: f64, q: &[f64], in_joint_frame: bool) -> Result<Vec<[bool; 6]>, AnalysisError> {
    let (twin, q) = in_space(model, q)?;
    // drives belong to it: two that prescribe one motion can work against each other
    let system = Geometry::new(&twin, true);
    let start = analyse(&system, t, &q)?;
    let mut known = vec![[true; 6]; twin.placed.joints.len()];
    if start.dropped.is_empty() {
        return Ok(known);
    }
    let mut scratch = twin.scratch();
    twin.look(&q, &vec![0.0; twin.placed.nv], &mut scratch);
    let size = twin.placed.size;
    for stress in stresses(&system, &Pose::new(&twin, &q), &start, t, &q)? {
        for (j, w) in &stress.joints {
            let (force, moment) = if in_joint_frame {
                let frame = twin.joint_frame(*j, &scratch);
                (frame.apply_transposed(w.force), frame.apply_transposed(w.moment))
            } else {
                (w.force, w.moment)
            };
            for i in 0..3 {
                known[*j][i] &= force.0[i].abs() <= stress.zero;
                known[*j][3 + i] &= moment.0[i].abs() / size <= stress.zero;
            }
        }
    }
    Ok(known)
}
