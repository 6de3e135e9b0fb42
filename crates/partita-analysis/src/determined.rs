//! Which components of the reactions the motion determines.
//!
//! A self-stress can be added to the reactions of any motion. A component that every self-stress leaves alone is
//! determined; any other depends on elasticity and clearances, which rigid bodies do not have (Wojtyra 2005).

//!
//! The load of a self-stress on a joint changes with the position: a hinge loaded only across its axis in the zero
//! position may also be loaded along it when the frame has rotated. Therefore determinacy is evaluated at each
//! position, by the directions in which self-stresses can load the joint. A component along any axis is determined if
//! the axis is perpendicular
//! to them.                                                                                          (R2)

use crate::error::AnalysisError;
use crate::geometry::{in_space, lifted, Geometry};
use crate::outputs::{tables, Rows, States, Watch};
use crate::sharing::rows_between;
use crate::stress::{stresses, Pose, Stress};
use partita_math::spatial::{Mat3, Vec3};
use partita_model::rows::Owner;
use partita_model::spec::Measure;
use partita_model::Model;
use partita_system::prelude::*;
use partita_system::start::{analyse, rank_here, Start};
use partita_system::SystemError;

/// Directions in which self-stresses load a joint, the longest first, in units of the level that counts as zero.
type Directions = [Vec3<f64>; 3];
/// Number of entries for the directions of one joint: force, then moment, row by row.
pub const DIRECTIONS: usize = 18;

/// The loads that self-stresses can put on one joint, world axes.
#[derive(Clone, Copy, Debug, Default)]
struct LoadedDirections {
    force: Directions,
    moment: Directions,
}

impl LoadedDirections {
    /// (fx, fy, fz, mx, my, mz) along the columns of `frame`: determined?
    fn known(&self, frame: &Mat3<f64>) -> [bool; 6] {
        let along = |x: &Directions, i: usize| x.iter().all(|d| d.dot(frame.column(i)).abs() <= 1.0);
        std::array::from_fn(|i| if i < 3 { along(&self.force, i) } else { along(&self.moment, i - 3) })
    }

    /// Every load that a joint can transmit.
    fn everything() -> Self {
        let all = [0, 1, 2].map(|i| Vec3([0, 1, 2].map(|j| if i == j { f64::INFINITY } else { 0.0 })));
        Self { force: all, moment: all }
    }
}

/// An orthogonal basis of the span of the vectors; lengths up to 1 count as zero.
fn spanned(mut vectors: Vec<Vec3<f64>>) -> Directions {
    let mut found = Directions::default();
    for direction in &mut found {
        let longest = vectors.iter().copied().max_by(|a, b| a.norm().total_cmp(&b.norm()));
        let Some(longest) = longest.filter(|x| x.norm() > 1.0) else { break };
        *direction = longest;
        let unit = longest.times(1.0 / longest.norm());
        vectors.iter_mut().for_each(|x| *x = *x + unit.times(-unit.dot(*x)));
    }
    found
}

/// The joints that self-stresses load, each with the directions in which they do.
fn loaded_directions(joints: usize, size: f64, stresses: &[Stress]) -> Vec<LoadedDirections> {
    let mut loads = vec![(Vec::new(), Vec::new()); joints];
    for stress in stresses {
        for (j, w) in &stress.joints {
            loads[*j].0.push(w.force.times(1.0 / stress.zero));
            loads[*j].1.push(w.moment.times(1.0 / (size * stress.zero)));
        }
    }
    loads.into_iter().map(|(f, m)| LoadedDirections { force: spanned(f), moment: spanned(m) }).collect()
}

/// For each joint: are its (fx, fy, fz, mx, my, mz) determined? In joint axes if `in_joint_frame`, else in world axes.
///
/// Along a free direction of the joint the only reaction is that of a drive; otherwise the component counts as
/// determined (zero). Fails where [`mobility`](crate::mobility::mobility) does. Cost: one sparse solution per redundant
/// row.
pub fn determined(model: &Model, t: f64, q: &[f64], in_joint_frame: bool) -> Result<Vec<[bool; 6]>, AnalysisError> {
    let (twin, q) = in_space(model, q)?;
    // drives belong to it: two that prescribe one motion can work against each other
    let system = Geometry::of_reactions(model, &twin);
    let (found, _) = here(&system, &analyse(&system, t, &q)?, t, &q)?;
    let mut scratch = twin.scratch();
    twin.equations().look(&q, &vec![0.0; twin.size().nv], scratch.equations());
    let frame = |j: usize| if in_joint_frame { twin.joint_frame(j, &scratch) } else { Mat3::identity() };
    Ok(found.iter().enumerate().map(|(j, x)| x.known(&frame(j))).collect())
}

/// All joints, and the rows of conditions that are open, at a position whose rank is known.
fn here(
    system: &Geometry,
    start: &Start,
    t: f64,
    q: &[f64],
) -> Result<(Vec<LoadedDirections>, Vec<bool>), AnalysisError> {
    let (placed, rows) = (system.model.zero_position(), system.model.row_names.len());
    if start.dropped.is_empty() {
        return Ok((vec![LoadedDirections::default(); placed.joints.len()], vec![false; rows]));
    }
    let found = stresses(system, &Pose::new(system.model, t, q), start, t, q)?;
    Ok((loaded_directions(placed.joints.len(), placed.size, &found), open_rows(system.model, &found)))
}

/// As `here`, at any position, including a singular one, where instantaneous indeterminacy counts.
fn anywhere(system: &Geometry, t: f64, q: &[f64]) -> Result<(Vec<LoadedDirections>, Vec<bool>), AnalysisError> {
    match rank_here(system, t, q).map_err(Into::into).and_then(|start| here(system, &start, t, q)) {
        // fewer conditions are independent: no component is reported as determined
        Err(AnalysisError::System(SystemError::Singular { .. })) => {
            let model = system.model;
            Ok((vec![LoadedDirections::everything(); model.spec.joints.len()], vec![true; model.row_names.len()]))
        }
        found => found,
    }
}

/// As `anywhere`, at a position of the model; in space it has the twin of `system`, or one around that position.
fn around(
    model: &Model,
    system: &Geometry,
    t: f64,
    q: &[f64],
) -> Result<(Vec<LoadedDirections>, Vec<bool>), AnalysisError> {
    if !model.needs_turns() {
        return anywhere(system, t, &lifted(model, system.model, q));
    }
    let (twin, q) = in_space(model, q)?;
    anywhere(&Geometry::of_reactions(model, &twin), t, &q)
}

/// Rows of conditions whose effort self-stresses change.
fn open_rows(model: &Model, stresses: &[Stress]) -> Vec<bool> {
    let mut open = vec![false; model.row_names.len()];
    // a cosine has no unit, so that its effort is a moment like that of an angle
    let cosine = |row: usize| match model.row_names[row].owner {
        Owner::Drive(i) => matches!(model.spec.drives[i].measure, Measure::Cosine { .. }),
        _ => false,
    };
    for stress in stresses {
        for &(row, effort) in &stress.conditions {
            let is_moment = model.structure().rows[row].is_angle || cosine(row);
            open[row] |= (if is_moment { effort / model.extent() } else { effort }).abs() > stress.zero;
        }
    }
    open
}

/// [`determined`] of all joints at each state: 6 flags a joint (1 or 0) in world axes, the same in joint axes, one for
/// the effort along each velocity of each joint, and one for each multiplier of a condition other than a loop closure.
///
/// At a singular position more components are undetermined than next to it, and they are reported.
///
/// # Errors
/// Where the mechanism cannot be compiled in space, and those of `watch`.
pub fn flags(model: &Model, states: &States, watch: Watch) -> Result<Vec<Vec<f64>>, AnalysisError> {
    let twin = model.in_space().map_err(AnalysisError::from)?;
    let (system, still) = (Geometry::of_reactions(model, &twin), vec![0.0; twin.size().nv]);
    let mut dof = 0;
    let first: Vec<usize> = twin
        .zero_position()
        .joints
        .iter()
        .map(|p| {
            dof += p.shape.dof();
            dof - p.shape.dof()
        })
        .collect();
    let of_model = rows_between(model, &twin);
    let row = |i: usize, s: &mut partita_model::model::ModelScratch, rows: &mut Rows| {
        let (t, q, _) = states.at(model, i);
        let (found, open) = around(model, &system, t, q)?;
        twin.equations().look(&lifted(model, &twin, q), &still, s.equations());
        rows.row(2, i).fill(1.0);
        for d in twin.drives().iter().filter(|d| open[d.row]) {
            if let Some((j, c)) = d.joint {
                rows.row(2, i)[first[j] + c] = 0.0;
            }
        }
        rows.row(3, i).fill(1.0);
        for own in of_model.iter().zip(&open).filter_map(|(own, open)| own.filter(|_| *open)) {
            rows.row(3, i)[own - model.closing_rows] = 0.0;
        }
        for (j, x) in found.iter().enumerate() {
            for (table, frame) in [Mat3::identity(), twin.joint_frame(j, s)].iter().enumerate() {
                let known = x.known(frame).map(|yes| f64::from(u8::from(yes)));
                rows.row(table, i)[6 * j..][..6].copy_from_slice(&known);
            }
        }
        Ok(())
    };
    let (width, conditions) = (6 * twin.spec.joints.len(), model.row_names.len() - model.closing_rows);
    tables(states.len(), &[width, width, dof, conditions], 1, || twin.scratch(), row, watch)
}

/// Directions in which self-stresses load joint `j` at each state ([`DIRECTIONS`] numbers, world axes): a component
/// along a unit axis is determined where its product with none of the three exceeds 1.
///
/// # Errors
/// The errors of [`flags`].
pub fn directions(model: &Model, states: &States, j: usize, watch: Watch) -> Result<Vec<f64>, AnalysisError> {
    let twin = model.in_space().map_err(AnalysisError::from)?;
    let system = Geometry::of_reactions(model, &twin);
    let row = |i: usize, (): &mut (), rows: &mut Rows| {
        let (t, q, _) = states.at(model, i);
        let (found, _) = around(model, &system, t, q)?;
        for (to, from) in rows.row(0, i).chunks_mut(3).zip(found[j].force.iter().chain(&found[j].moment)) {
            to.copy_from_slice(&from.0);
        }
        Ok(())
    };
    Ok(tables(states.len(), &[DIRECTIONS], 1, || (), row, watch)?.remove(0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::examples::*;
    use partita_model::spec::JointKind::{Cylindrical, Revolute, Spherical};
    use partita_model::zero_position::Coordinates;

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
