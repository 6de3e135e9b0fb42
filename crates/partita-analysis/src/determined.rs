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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::examples::*;
    use partita_model::place::Coordinates;
    use partita_model::spec::JointKind::{Cylindrical, Revolute, Spherical};

    const ALL: [bool; 6] = [true; 6];

    /// Benchmark 9: of 20 components the 8 forces in the plane are determined.
    #[test]
    fn four_parallel_revolutes() {
        for coordinates in [Coordinates::Relative, Coordinates::Absolute] {
            let m = compiled(tilted(four_bar([Revolute; 4])), coordinates);
            let known = determined(&m, 0.0, &m.initial(), true).unwrap();
            assert_eq!(known, [[true, true, false, false, false, true]; 4]);
            // no world axis lies in the tilted plane
            let known = determined(&m, 0.0, &m.initial(), false).unwrap();
            assert_eq!(known, [[false; 6]; 4]);
        }
        let m = model(four_bar([Revolute; 4]));
        assert_eq!(determined(&m, 0.0, &m.initial(), false).unwrap(), [[true, true, false, false, false, true]; 4]);
    }

    #[test]
    fn nothing_is_left_open_where_nothing_is_redundant() {
        // 5 + 5 + 3 + 4 rows for 3 bodies and one motion
        let m = model(tilted(four_bar([Revolute, Revolute, Spherical, Cylindrical])));
        assert_eq!(determined(&m, 0.0, &m.initial(), true).unwrap(), [ALL; 4]);
        let mut open = four_bar([Revolute; 4]);
        open.joints.pop();
        for coordinates in [Coordinates::Relative, Coordinates::Absolute] {
            let m = compiled(open.clone(), coordinates);
            assert_eq!(determined(&m, 0.0, &m.initial(), true).unwrap(), [ALL; 3]);
        }
    }

    /// One self-stress in six joints. By symmetry it leaves some components alone in the drawn position; a little later
    /// nothing but the free directions.
    #[test]
    fn bricard() {
        let m = model(crate::examples::bricard());
        let mut q = m.initial();
        assert!(determined(&m, 0.0, &q, true).unwrap().iter().all(|k| k[5] && *k != ALL));
        partita_system::kinematics::assembly::move_to(&m, 0.0, &mut q, &[(0, 0.4)], 1e-12).unwrap();
        assert_eq!(determined(&m, 0.0, &q, true).unwrap(), [[false, false, false, false, false, true]; 6]);
    }

    /// A pendulum hangs on the coupler: its pin is determined whatever the loop does.
    #[test]
    fn what_hangs_on_a_redundant_loop_is_determined() {
        let mut spec = tilted(four_bar([Revolute; 4]));
        let coupler = spec.bodies[1].clone();
        spec.bodies.push(partita_model::spec::Body { name: "bob".into(), ..coupler });
        let at = spec.joints[2].point;
        spec.joints.push(joint("pin", Revolute, "coupler", "bob", at, spec.joints[0].axis.unwrap()));
        let m = model(spec);
        let known = determined(&m, 0.0, &m.initial(), true).unwrap();
        assert_eq!(known[4], ALL);
        assert_ne!(known[1], ALL);
    }

    /// Two motors on one motion: their torques, and with them forces in the plane, are open.
    #[test]
    fn two_drives_on_one_motion() {
        let mut spec = tilted(four_bar([Revolute; 4]));
        spec.drives.push(drive("motor", "A"));
        let m = model(spec.clone());
        assert!(determined(&m, 0.0, &m.initial(), true).unwrap().iter().all(|k| k[0] && k[1] && k[5]));
        spec.drives.push(drive("second", "D"));
        let m = model(spec);
        let known = determined(&m, 0.0, &m.initial(), true).unwrap();
        assert_eq!(known[0], [false; 6]);
        assert!(known[1][5] && known[2][5]);
    }
}
