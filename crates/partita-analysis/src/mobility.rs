//! Mobility and redundancy: the degrees of freedom of the mechanism, and which constraint rows of its joints are
//! redundant.

use crate::error::AnalysisError;
use crate::geometric_error::{self, GeometricError};
use crate::geometry::{in_space, Geometry};
use crate::reason::{names, reason};
use crate::stress::{stresses, Pose};
use partita_math::elimination::Pattern;
use partita_math::rank::independent_rows;
use partita_math::tolerance;
use partita_model::Model;
use partita_system::prelude::*;
use partita_system::start::analyse;
use partita_system::SystemError;
use serde::Serialize;

/// A redundant row.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Redundant {
    /// Its name.
    pub row: String,
    /// The joint it belongs to.
    pub joint: String,
    /// Why, in a sentence.
    pub why: String,
}

/// Degrees of freedom and constraints. Joints are counted in space, whether or not the mechanism is planar.
///
/// ```text
/// joint_rows − joint_rank = closing_rows − closing_rank = redundant rows of joints
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Mobility {
    /// Degrees of freedom k, not counting driven ones.
    pub mobility: usize,
    /// Conditions of all joints together: 5 for a revolute.
    pub joint_rows: usize,
    /// Number of independent ones: 6 · bodies − degrees of freedom with the drives released.
    pub joint_rank: usize,
    /// Conditions of the joints that close loops.
    pub closing_rows: usize,
    /// Number of independent ones.
    pub closing_rank: usize,
    /// Velocities of the tree in space.
    pub velocities: usize,
    /// Redundant rows and redundant drives, in the order of `dropped`. The choice among rows that depend on each other
    /// is not unique; their number is.
    pub redundant: Vec<Redundant>,
    /// The same as rows of [`Model::in_space`], ascending.
    pub dropped: Vec<usize>,
    /// Geometric errors of the drawing, in sentences: repaired if within the tolerance, kept as conditions if beyond
    /// it.
    pub geometric_errors: Vec<String>,
    /// The largest change of a joint frame that makes the drawing fit (rad, fractions of lengths); 0 where it fits as
    /// drawn.
    pub geometric_error: f64,
    /// Degrees of freedom, drives released, without a geometric error that exceeds the tolerance.
    pub repaired_mobility: Option<usize>,
    /// Squared sine of the angle between the weakest row and those on which it nearly depends: 0 in a singular
    /// position.
    pub smallest: f64,
}

/// Mobility and redundant rows at an assembled position.
///
/// Masses do not enter. Fails at a singular position, where rows are dependent that are independent nearby. Cost:
/// sparse; proportional to the number of loops of a chain, and one sparse solution per redundant row.
pub fn mobility(model: &Model, t: f64, q: &[f64]) -> Result<Mobility, AnalysisError> {
    let (twin, q) = in_space(model, q)?;
    let released = Geometry::new(&twin, false);
    let free = analyse(&released, t, &q)?;
    let (nv, bodies) = (twin.size().nv, twin.spec.bodies.len());
    let pose = Pose::new(&twin, t, &q);
    let mut redundant = Vec::with_capacity(free.dropped.len());
    let of_rows = stresses(&released, &pose, &free, t, &q)?;
    let GeometricError { sentences: geometric_errors, size: geometric_error, repaired_mobility } =
        geometric_error::of_drawing(model);
    for (stress, &row) in of_rows.iter().zip(&free.dropped) {
        redundant.push(Redundant {
            row: released.structure().rows[row].name.to_string(),
            joint: twin.row_names[released.row_of_model(row)].owner.name(&twin.spec).to_string(),
            why: reason(&pose, stress),
        });
    }
    let mut found = Mobility {
        mobility: nv - free.rank,
        joint_rows: twin.zero_position().joints.iter().map(|p| p.shape.conditions()).sum::<usize>()
            + twin.coupling_rows(),
        joint_rank: 6 * bodies + free.rank - nv,
        closing_rows: released.size().rows,
        closing_rank: free.rank,
        velocities: nv,
        redundant,
        geometric_errors,
        geometric_error,
        repaired_mobility,
        smallest: released.distance(&free, t, &q)?,
        dropped: free.dropped.iter().map(|&i| released.row_of_model(i)).collect(),
    };
    if !twin.drives().is_empty() {
        let driven = Geometry::new(&twin, true);
        let start = analyse(&driven, t, &q)?;
        let rank = start.rank;
        found.smallest = driven.distance(&start, t, &q)?;
        if rank < found.closing_rank + twin.drives().len() {
            superfluous_drives(&driven, t, &q, &mut found)?;
        }
        found.mobility = nv - rank;
    }
    Ok(found)
}

impl Mobility {
    /// The geometric errors of the drawing and their treatment, in one sentence; none where it fits.
    pub fn of_drawing(&self, tolerance: f64) -> Option<String> {
        if self.geometric_errors.is_empty() {
            return None;
        }
        let what = self.geometric_errors.join("; ");
        Some(match self.repaired_mobility {
            None => format!(
                "the geometry is inexact, within the drawing tolerance of {tolerance:.0e}: {what}; the model is the \
                 nearest geometry that closes"
            ),
            Some(repaired_mobility) => format!(
                "{} only because of a geometric error beyond the drawing tolerance of {tolerance:.0e}: {what}; \
                 without this error it would have {repaired_mobility} degree{} of freedom: place that joint more \
                 accurately, or give a larger drawing_tolerance if the joint has that much play",
                if self.closing_rank == self.velocities { "a structure" } else { "less mobile" },
                if repaired_mobility == 1 { "" } else { "s" }
            ),
        })
    }
}

/// Drives whose coordinate the loops and earlier drives already determine.
fn superfluous_drives(driven: &Geometry, t: f64, q: &[f64], found: &mut Mobility) -> Result<(), SystemError> {
    let (pattern, displacement, model) = (driven.pattern(), driven.scales(), driven.model);
    let c = driven.jacobian(t, q)?;
    let mut rows: Vec<usize> = model.undriven().filter(|i| found.dropped.binary_search(i).is_err()).collect();
    let mut before: Vec<&str> = Vec::new();
    let has_motion = found.mobility > 0;
    for d in model.drives() {
        rows.push(d.row);
        let columns: Vec<Vec<usize>> = rows.iter().map(|&i| pattern.col_idx[pattern.row(i)].to_vec()).collect();
        let values: Vec<f64> = rows.iter().flat_map(|&i| &c[pattern.row(i)]).copied().collect();
        let rank =
            independent_rows(&Pattern::from_rows(pattern.cols, &columns), &values, &displacement, tolerance::REDUNDANT)
                .rank;
        if rank == rows.len() {
            before.push(&d.name);
            continue;
        }
        rows.pop();
        found.dropped.push(d.row);
        let why = match (has_motion, before.as_slice()) {
            (false, _) => "the mechanism has no degree of freedom that could be driven".into(),
            (true, []) => "the closed loops lock this coordinate, so it cannot be driven".into(),
            (true, before) => format!("this coordinate is already determined by driving {}", names(before)),
        };
        let joint = d.joint.map_or(&d.name, |(j, _)| &model.spec.joints[j].name).clone();
        found.redundant.push(Redundant { row: driven.structure().rows[d.row].name.to_string(), joint, why });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::examples::*;
    use partita_model::spec::JointKind::{Fixed, Prismatic, Revolute, Spherical};
    use partita_model::spec::Spec;
    use partita_model::zero_position::Coordinates;

    fn of(spec: Spec) -> Mobility {
        let m = model(spec);
        let found = mobility(&m, 0.0, &m.initial()).unwrap();
        assert_eq!(found.joint_rows - found.joint_rank, found.closing_rows - found.closing_rank);
        found
    }
    fn numbers(m: &Mobility) -> (usize, usize, usize) {
        (m.mobility, m.joint_rows, m.joint_rank)
    }

    #[test]
    fn four_parallel_revolutes_in_space() {
        for spec in [four_bar([Revolute; 4]), tilted(four_bar([Revolute; 4]))] {
            let m = of(spec);
            assert_eq!(numbers(&m), (1, 20, 17));
            assert_eq!((m.closing_rows, m.closing_rank, m.redundant.len()), (5, 2, 3));
            for r in &m.redundant {
                assert_eq!(r.joint, "C");
                assert!(r.row.starts_with("C."));
                assert!(r.why.starts_with("all axes of rotation of A, B, C and D are parallel"), "{}", r.why);
            }
        }
    }

    #[test]
    fn any_coordinates_any_masses_any_units() {
        for coordinates in [Coordinates::Relative, Coordinates::Absolute] {
            for length in [1e-3, 1.0, 1e3] {
                let mut spec = tilted(four_bar([Revolute; 4]));
                for (i, b) in spec.bodies.iter_mut().enumerate() {
                    b.position = b.position.map(|x| length * x);
                    b.com = b.com.map(|x| length * x);
                    b.mass = 100_f64.powi(i as i32);
                    b.inertia = [[0.0; 3]; 3];
                }
                spec.joints.iter_mut().for_each(|j| j.point = j.point.map(|x| length * x));
                let m = compiled(spec, coordinates);
                assert_eq!(numbers(&mobility(&m, 0.0, &m.initial()).unwrap()), (1, 20, 17));
            }
        }
    }

    #[test]
    fn a_moved_position_is_lifted_out_of_the_plane() {
        // turn the whole four-bar about A, in absolute coordinates of its tilted plane, with A alone to hold it
        let mut spec = tilted(four_bar([Revolute; 4]));
        spec.joints.truncate(3);
        let m = compiled(spec, Coordinates::Absolute);
        let mut q = m.initial();
        partita_system::kinematics::assembly::move_to(&m, 0.0, &mut q, &[(2, 0.7)], 1e-12).unwrap();
        let (twin, lifted) = in_space(&m, &q).unwrap();
        let mut phi = vec![0.0; twin.size().rows];
        let (mut c, mut a) = (vec![0.0; twin.pattern().nnz()], phi.clone());
        twin.position(0.0, &lifted, &mut twin.scratch(), &mut phi, &mut c, &mut a).unwrap();
        assert_eq!(phi.len(), 15);
        assert!(phi.iter().all(|x| x.abs() < 1e-11), "{phi:?}");
        assert_eq!(numbers(&mobility(&m, 0.0, &q).unwrap()), (3, 15, 15));
    }

    /// A four-bar on a turning arm: in most positions of the arm its rows out of the plane are rounding errors alone.
    #[test]
    fn a_plane_that_turns() {
        let mut spec = four_bar([Revolute; 4]);
        spec.bodies.push(body("arm", [0.0; 3], [1.0; 3]));
        spec.joints.iter_mut().filter(|j| j.parent == "ground").for_each(|j| j.parent = "arm".into());
        spec.joints.push(joint("shoulder", Revolute, "ground", "arm", [0.0, -1.0, 0.0], [1.0, 0.2, 0.1]));
        let m = model(tilted(spec));
        let mut q = m.initial();
        let shoulder = m.structure().velocities.iter().position(|v| &*v.name == "shoulder").unwrap();
        for angle in [0.0, 0.3, 0.7, 1.9, -2.5] {
            q[shoulder] = angle;
            let found = mobility(&m, 0.0, &q).unwrap();
            assert_eq!(numbers(&found), (2, 25, 22));
            assert!(found
                .redundant
                .iter()
                .all(|r| r.why.starts_with("all axes of rotation of A, B, C and D are parallel")));
        }
    }

    #[test]
    fn double_four_bar() {
        let m = of(chain(2, 0.0));
        assert_eq!(numbers(&m), (1, 35, 29));
        assert!(m.redundant.iter().all(|r| r.why.contains("parallel")), "{:?}", m.redundant);
    }

    #[test]
    fn in_line_it_is_singular() {
        let m = model(chain(2, std::f64::consts::FRAC_PI_2));
        let error = mobility(&m, 0.0, &m.initial()).unwrap_err().to_string();
        assert!(error.contains("singular"), "{error}");
    }

    #[test]
    fn a_long_chain_is_as_easy_per_loop() {
        let clock = std::time::Instant::now();
        let m = of(chain(1000, 0.3));
        println!("{:?} for 1000 loops", clock.elapsed());
        assert_eq!(numbers(&m), (1, 15005, 12005));
        // around one loop, not around all
        assert!(m.redundant.iter().all(|r| r.why.len() < 200), "{}", m.redundant[2000].why);
    }

    #[test]
    fn bricard_moves_by_its_dimensions() {
        let m = of(bricard());
        assert_eq!(numbers(&m), (1, 30, 29));
        let why = &m.redundant[0].why;
        assert!(why.starts_with("the reactions of P0, P1, P2, P3, P4 and P5 can balance"), "{why}");
    }

    #[test]
    fn axes_through_one_point() {
        let m = of(spherical_four_bar());
        assert_eq!(numbers(&m), (1, 20, 17));
        assert!(m.redundant.iter().all(|r| r.why.contains("meet in one point")), "{:?}", m.redundant);
    }

    /// Two hinges of one door: five rows too many.
    #[test]
    fn one_axis() {
        let mut spec = empty("door");
        spec.bodies.push(body("door", [0.0; 3], [1.0, 0.0, 2.0]));
        spec.joints.push(joint("low", Revolute, "ground", "door", [0.0, 0.0, 0.2], Z));
        spec.joints.push(joint("high", Revolute, "ground", "door", [0.0, 0.0, 1.8], Z));
        let m = of(spec);
        assert_eq!(numbers(&m), (1, 10, 5));
        assert!(m.redundant.iter().all(|r| r.why.starts_with("low and high share one axis")));
    }

    /// A third crank of the same length: its in-plane row fits by its dimensions alone.
    #[test]
    fn a_parallelogram_with_a_third_crank() {
        let mut spec = empty("parallelogram");
        let (tops, pins) = ([0.0, 1.0, 2.5].map(|x| [x + 0.3, 1.0, 0.0]), [0.0, 1.0, 2.5].map(|x| [x, 0.0, 0.0]));
        spec.bodies.push(body("coupler", tops[0], tops[2]));
        for (i, (p, t)) in pins.into_iter().zip(tops).enumerate() {
            let crank = format!("crank{i}");
            spec.bodies.push(body(&crank, p, t));
            spec.joints.push(joint(&format!("A{i}"), Revolute, "ground", &crank, p, Z));
            spec.joints.push(joint(&format!("B{i}"), Revolute, &crank, "coupler", t, Z));
        }
        let m = of(spec);
        assert_eq!(numbers(&m), (1, 30, 23));
        let by_dimension = m.redundant.iter().filter(|r| r.why.contains("with these dimensions")).count();
        assert!(by_dimension >= 1 && m.redundant.len() == 7, "{:?}", m.redundant);
    }

    #[test]
    fn slides_alone() {
        let mut spec = empty("wedges");
        let (x, y) = ([1.0, 0.0, 0.0], [0.6, 0.8, 0.0]);
        spec.bodies = vec![body("wedge", [0.0; 3], [1.0, 0.0, 0.0]), body("ram", [1.0, 1.0, 0.0], [1.0, 2.0, 0.0])];
        spec.joints = vec![
            joint("floor", Prismatic, "ground", "wedge", [0.0; 3], x),
            joint("slope", Prismatic, "wedge", "ram", [1.0, 0.5, 0.0], y),
            joint("guide", Prismatic, "ground", "ram", [1.0, 2.0, 0.0], [0.0, 1.0, 0.0]),
        ];
        let m = of(spec);
        assert_eq!(numbers(&m), (1, 15, 11));
        assert!(m.redundant.iter().all(|r| r.why.contains("are prismatic")), "{:?}", m.redundant);
    }

    #[test]
    fn a_slider_crank_moves_in_one_plane() {
        let mut spec = empty("slider-crank");
        let (b, c) = ([0.03, 0.04, 0.0], [0.2, 0.0, 0.0]);
        spec.bodies = vec![body("crank", [0.0; 3], b), body("rod", b, c), body("slider", c, [0.21, 0.0, 0.0])];
        spec.joints = vec![
            joint("A", Revolute, "ground", "crank", [0.0; 3], Z),
            joint("B", Revolute, "crank", "rod", b, Z),
            joint("C", Revolute, "rod", "slider", c, Z),
            joint("S", Prismatic, "ground", "slider", c, [1.0, 0.0, 0.0]),
        ];
        let m = of(spec);
        assert_eq!(numbers(&m), (1, 20, 17));
        assert!(m.redundant.iter().all(|r| r.why.starts_with("all motions of A, B, C and S lie in one plane")));
    }

    #[test]
    fn trees_have_nothing_redundant() {
        let mut spec = four_bar([Revolute, Spherical, Fixed, Revolute]);
        spec.joints.truncate(3);
        let m = of(spec);
        assert_eq!(numbers(&m), (4, 14, 14));
        assert!(m.redundant.is_empty());
        let mut free = empty("stone");
        free.bodies.push(body("stone", [0.0; 3], [0.1, 0.2, 0.3]));
        assert_eq!(numbers(&of(free)), (6, 0, 0));
    }

    #[test]
    fn a_drive_takes_motion_but_is_no_row_of_a_joint() {
        let mut spec = tilted(four_bar([Revolute; 4]));
        spec.drives.push(drive("motor", "A"));
        let m = of(spec.clone());
        assert_eq!(numbers(&m), (0, 20, 17));
        assert_eq!(m.redundant.len(), 3);
        spec.drives.push(drive("second", "D"));
        let m = of(spec);
        assert_eq!(numbers(&m), (0, 20, 17));
        let last = m.redundant.last().unwrap();
        assert_eq!((last.row.as_str(), last.joint.as_str()), ("drive second", "D"));
        assert!(last.why.contains("already determined by driving motor"), "{}", last.why);
    }

    /// Three bars make a triangle.
    #[test]
    fn a_structure_cannot_move() {
        let mut spec = empty("triangle");
        let (a, b, c) = ([0.0; 3], [1.0, 0.0, 0.0], [0.3, 0.8, 0.0]);
        spec.bodies = vec![body("left", a, c), body("right", b, c)];
        spec.joints = vec![
            joint("A", Revolute, "ground", "left", a, Z),
            joint("B", Revolute, "ground", "right", b, Z),
            joint("C", Revolute, "left", "right", c, Z),
        ];
        let m = of(spec);
        assert_eq!(numbers(&m), (0, 15, 12));
    }
}
