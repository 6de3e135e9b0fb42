//! Bodies without mass or nearly so, or without inertia about some axis.
//!
//! The equations of motion need mass in the motions that the loops allow, `D M Dᵀ`, and nowhere else: a coupler may be
//! massless. M itself is then singular and no longer a metric. Where a metric is needed (scales of coordinates, rank,
//! corrections) such bodies have a small fraction of the heaviest mass. No equation of motion contains it.
//!
//! One motion is special: the spin of a body about a line that contains its centre of mass and its ball joints, as of a
//! thin rod. It moves nothing else and is indeterminate without inertia; unless an initial spin is given, it is held by
//! a fictitious inertia about the line, which has no effect because the body never spins. A point mass, or a massless
//! body on one ball joint, is held about all axes in the same way.

use crate::spec::{JointKind, Spec};
use crate::spin::{around, attachment, is_seen, line_through, point_on, Turning};
use crate::zero_position::{HeldSpin, Massless, Placed};
use partita_math::dense::Matrix;
use partita_math::factor::symmetric_eigen;
use partita_math::spatial::{Mat3, Vec3};
use partita_math::tolerance;

/// Lighter bodies, and smaller principal moments, are massless. Scale: fraction of the heaviest mass; of the mass times
/// the square of the characteristic displacement. Reason: squared sines between rows shrink by it in the mass metric,
/// and those below 1e-9 count as redundant; a bar a thousand times as long as thick has half of such a moment.
const MASSLESS: f64 = 1e-6;
/// Mass of massless bodies in the metric. Unit: fraction of the heaviest mass. Reason: no coordinate is then a hundred
/// times as mobile as its neighbours for want of mass alone.
const MASSLESS_COUNTS: f64 = 1e-2;

/// `m 1`.
fn all_round(m: f64) -> Mat3<f64> {
    Mat3([[m, 0.0, 0.0], [0.0, m, 0.0], [0.0, 0.0, m]])
}

/// The points of a body's joints.
fn points<'a>(placed: &'a Placed, around: &'a [Vec<usize>], body: usize) -> impl Iterator<Item = Vec3<f64>> + 'a {
    around[body].iter().map(|&j| &placed.joints[j]).flat_map(move |p| {
        let on = |node: usize, point: Vec3<f64>| (node == body + 1).then_some(point);
        on(p.parent, p.parent_point).into_iter().chain(on(p.child, p.child_point))
    })
}

/// Mass of the heaviest body; a massless rotation is compared with its inertia.
fn heaviest(placed: &Placed) -> f64 {
    let turning = |i: &Mat3<f64>| i.0.as_flattened().iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let square = placed.size * placed.size;
    placed.bodies.iter().fold(0.0, |m: f64, b| m.max(b.mass).max(turning(&b.inertia) / square))
}

/// Find the massless bodies of a placed description, with its present masses.
pub fn weigh(placed: &mut Placed, spec: &Spec) {
    placed.held = held(spec, placed);
    placed.massless = massless(placed);
}

/// Mass and inertia that bodies lack in a metric.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lacking {
    /// Mass.
    pub(crate) mass: f64,
    /// Inertia about their centre.
    pub(crate) inertia: Mat3<f64>,
}

/// The inertia that links lack in a metric.
pub fn massless(placed: &Placed) -> Vec<Massless> {
    let (around, mut on_link) = (around(placed), vec![Vec::new(); placed.links.len()]);
    for (i, b) in placed.bodies.iter().enumerate() {
        on_link[b.link].push(i);
    }
    let of = |(link, on): (usize, &Vec<usize>)| {
        let sum = |x: &dyn Fn(usize) -> Vec3<f64>| on.iter().fold(Vec3::zero(), |sum, &i| sum + x(i));
        let mass: f64 = on.iter().map(|&i| placed.bodies[i].mass).sum();
        let first = sum(&|i| placed.bodies[i].com.times(placed.bodies[i].mass));
        let centre = if mass > 0.0 { first.times(1.0 / mass) } else { placed.links[link].point };
        let Lacking { mass, inertia } = lacking(placed, &around, on, centre)?;
        Some(Massless { link, mass, inertia })
    };
    // where there are no bodies: a step of a joint with several motions
    on_link.iter().enumerate().skip(1).filter(|x| !x.1.is_empty()).filter_map(of).collect()
}

/// What these bodies, moving as one about their `centre`, lack in a metric; none where they have it.
pub(crate) fn lacking(placed: &Placed, around: &[Vec<usize>], on: &[usize], centre: Vec3<f64>) -> Option<Lacking> {
    let heaviest = heaviest(placed);
    if heaviest <= 0.0 {
        return None;
    }
    let mass: f64 = on.iter().map(|&i| placed.bodies[i].mass).sum();
    let (mut inertia, mut radius) = (Mat3::zero(), 0.0f64);
    for &i in on {
        let b = &placed.bodies[i];
        inertia = inertia.add(&b.inertia).add(&Mat3::steiner(b.mass, b.com - centre));
        radius = points(placed, around, i).fold(radius, |r, p| r.max((p - centre).norm()));
    }
    // a body held in its centre has the arm of its own inertia, however large the mechanism is
    let least = tolerance::SOLUTION_ROUNDING * placed.size;
    let turning = (0..3).fold(0.0, |m: f64, i| m.max(inertia.0[i][i]));
    let gyration = if mass > 0.0 { (turning / mass).sqrt() } else { 0.0 };
    let own = gyration > least;
    let nothing = if own { least.max(tolerance::EQUAL * gyration) } else { tolerance::EQUAL * placed.size };
    if radius <= nothing {
        radius = if own { gyration } else { placed.length };
    }
    let missing = if mass < MASSLESS * heaviest { MASSLESS_COUNTS * heaviest - mass } else { 0.0 };
    let mut more = all_round(missing * radius * radius);
    let whole_round = (mass + missing) * radius * radius;
    let whole = inertia.add(&more);
    // not finite: refused elsewhere
    let (moments, axes) = symmetric_eigen(&Matrix::from_vec(3, 3, whole.0.as_flattened().to_vec())).ok()?;
    for (j, moment) in moments.iter().enumerate().filter(|(_, m)| **m < MASSLESS * whole_round) {
        let axis = Vec3([axes[(0, j)], axes[(1, j)], axes[(2, j)]]);
        more = more.add(&along(axis, MASSLESS_COUNTS * whole_round - moment));
    }
    let lacks = missing > 0.0 || more.0.as_flattened().iter().any(|x| *x != 0.0);
    lacks.then_some(Lacking { mass: missing, inertia: more })
}

/// `m e eᵀ`.
fn along(e: Vec3<f64>, m: f64) -> Mat3<f64> {
    Mat3(e.0.map(|a| e.0.map(|b| a * b * m)))
}

/// The joints of a body, if all of them leave it free to rotate about one of its points.
fn balls(spec: &Spec, placed: &Placed, around: &[Vec<usize>], body: usize) -> Option<Vec<usize>> {
    let joints: Vec<usize> = around[body].iter().copied().filter(|&j| spec.joints[j].kind != JointKind::Free).collect();
    let ball = |&j: &usize| attachment(placed, j, body).is_some_and(|x| x.is_ball());
    joints.iter().all(ball).then_some(joints)
}

/// Bodies without inertia about the axis that their ball joints and their mass leave free, if no spin is prescribed.
pub fn held(spec: &Spec, placed: &Placed) -> Vec<HeldSpin> {
    if placed.planar {
        return Vec::new();
    }
    let (heaviest, around) = (heaviest(placed), around(placed));
    let of = |body: usize| {
        let joints = balls(spec, placed, &around, body)?;
        let b = &placed.bodies[body];
        // a free joint constrains nothing, but is the reference point of others
        let mut at: Vec<Vec3<f64>> =
            joints.iter().map(|&j| point_on(placed, j, body)).chain((b.mass > 0.0).then_some(b.com)).collect();
        if at.is_empty() {
            at.push(b.com);
        }
        let mut line = line_through(&at, placed)?;
        let point = at[0];
        let radius = at.iter().fold(0.0, |r: f64, p| r.max((*p - b.com).norm()));
        let (moments, axes) = symmetric_eigen(&Matrix::from_vec(3, 3, b.inertia.0.as_flattened().to_vec())).ok()?;
        let nothing = tolerance::LONG_ROUNDING * moments[2].max(b.mass * radius * radius);
        if line.is_none() && moments[2] > nothing {
            // one point, and inertia: a thin rod on a ball at its centre, or floating
            line = Some(Vec3([axes[(0, 0)], axes[(1, 0)], axes[(2, 0)]]));
        }
        let own = line.map_or(moments[2], |e| e.dot(b.inertia.apply(e)));
        let bodies = &[body];
        let turning = Turning { bodies, point, line };
        if own > nothing || is_seen(spec, placed, &turning) {
            return None;
        }
        let length = if radius > tolerance::EQUAL * placed.size { radius } else { placed.length };
        let inertia = (0.5 * (moments[0] + moments[1] + moments[2])).max(MASSLESS_COUNTS * heaviest * length * length);
        let inertia = line.map_or_else(|| all_round(inertia), |e| along(e, inertia));
        Some(HeldSpin { body, line, inertia })
    };
    (0..spec.bodies.len()).filter_map(of).collect()
}
