//! Bodies that have no mass or next to none, or no inertia about some axis.
//!
//! The motion needs mass on the motions that the loops leave, `D M Dᵀ`, and nowhere else: a coupler may have none. M itself is then
//! singular and no metric any more. Where a metric is wanted (scales of coordinates, rank, corrections) such bodies count with a
//! least share of the heaviest. No equation of motion contains it.
//!
//! One motion is different: that of a rod between balls about its own line. It moves nothing else, and without inertia about
//! that line nothing says how it goes; where nobody asks for it either, it is held. Any inertia about the line does that, for it
//! never turns: none of its moments, and none of its energy, is ever felt.

use crate::place::Placed;
use crate::spec::{Force, JointKind, Measure, Spec};
use partita_math::dense::Matrix;
use partita_math::factor::symmetric_eigen;
use partita_math::spatial::{Mat3, Vec3};

/// Least share of the heaviest body: squared sines between rows of C shrink by it, and below 1e-9 rows count as
/// redundant; the middle between that and bodies that really are light beside others.
const LEAST_MASS: f64 = 1e-6;
/// Least principal moment, in parts of the body's mass times the square of its reach: a bar a thousand times as long as thick
/// has half of it.
const LEAST_INERTIA: f64 = 1e-6;
/// Inertia below this part of what a body has across is what rounding leaves of none.
const NONE: f64 = 1e-12;
/// Points closer to a line than this, in parts of the drawing, are on it.
const ON_LINE: f64 = 1e-9;

/// What a link lacks.
#[derive(Clone, Debug)]
pub struct Light {
    /// Link.
    pub link: usize,
    /// Mass.
    pub mass: f64,
    /// Inertia about its reference point, mechanism axes in the zero position.
    pub inertia: Mat3<f64>,
}

/// A rod whose spin is held.
#[derive(Clone, Debug)]
pub struct HeldSpin {
    /// Its body, by number.
    pub body: usize,
    /// The line it would spin about, mechanism axes in the zero position.
    pub line: Vec3<f64>,
    /// Inertia about it.
    pub inertia: f64,
}

/// A body that ball joints in one line hold, and nothing else does.
#[derive(Clone, Debug)]
pub struct Idle {
    /// The body, by number.
    pub body: usize,
    /// The joints.
    pub joints: Vec<usize>,
    /// Their line, mechanism axes in the zero position.
    pub line: Vec3<f64>,
    /// A point of it.
    pub point: Vec3<f64>,
}

/// `m 1`.
fn all_round(m: f64) -> Mat3<f64> {
    Mat3([[m, 0.0, 0.0], [0.0, m, 0.0], [0.0, 0.0, m]])
}

/// The points of a body's joints.
fn points(placed: &Placed, body: usize) -> impl Iterator<Item = Vec3<f64>> + '_ {
    placed.joints.iter().flat_map(move |p| {
        let on = |node: usize, point: Vec3<f64>| (node == body + 1).then_some(point);
        on(p.parent, p.parent_point).into_iter().chain(on(p.child, p.child_point))
    })
}

/// Mass of the heaviest body; what turns without mass counts with its inertia.
fn heaviest(placed: &Placed) -> f64 {
    let turning = |i: &Mat3<f64>| i.0.as_flattened().iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let square = placed.size * placed.size;
    placed.bodies.iter().fold(0.0, |m: f64, b| m.max(b.mass).max(turning(&b.inertia) / square))
}

/// What links lack to count in a metric.
pub fn light(placed: &Placed) -> Vec<Light> {
    let heaviest = heaviest(placed);
    if heaviest <= 0.0 {
        return Vec::new();
    }
    let count = placed.links.len();
    let (mut mass, mut first) = (vec![0.0; count], vec![Vec3::<f64>::zero(); count]);
    for b in &placed.bodies {
        mass[b.link] += b.mass;
        first[b.link] += b.com.times(b.mass);
    }
    let centre = |l: usize| if mass[l] > 0.0 { first[l].times(1.0 / mass[l]) } else { placed.links[l].point };
    let mut found = Vec::new();
    for link in 1..count {
        let on: Vec<usize> = (0..placed.bodies.len()).filter(|&i| placed.bodies[i].link == link).collect();
        if on.is_empty() {
            continue; // a step of a joint with several motions
        }
        let (at, mut inertia, mut reach) = (centre(link), Mat3::zero(), 0.0f64);
        for &i in &on {
            let b = &placed.bodies[i];
            inertia = inertia.add(&b.inertia).add(&Mat3::steiner(b.mass, b.com - at));
            reach = points(placed, i).fold(reach, |r, p| r.max((p - at).norm()));
        }
        if reach <= ON_LINE * placed.size {
            reach = placed.length;
        }
        let missing = (LEAST_MASS * heaviest - mass[link]).max(0.0);
        let mut more = all_round(missing * reach * reach);
        let least = LEAST_INERTIA * (mass[link] + missing) * reach * reach;
        let whole = inertia.add(&more);
        let Ok((moments, axes)) = symmetric_eigen(&Matrix::from_vec(3, 3, whole.0.as_flattened().to_vec())) else {
            continue; // not finite: refused elsewhere
        };
        for (j, moment) in moments.iter().enumerate().filter(|(_, m)| **m < least) {
            let axis = Vec3([axes[(0, j)], axes[(1, j)], axes[(2, j)]]);
            more = more.add(&along(axis, least - moment));
        }
        if missing > 0.0 || more.0.as_flattened().iter().any(|x| *x != 0.0) {
            found.push(Light { link, mass: missing, inertia: more });
        }
    }
    found
}

/// `m e eᵀ`.
pub(crate) fn along(e: Vec3<f64>, m: f64) -> Mat3<f64> {
    Mat3(e.0.map(|a| e.0.map(|b| a * b * m)))
}

/// Bodies held by ball joints in one line alone.
pub fn idle(spec: &Spec, placed: &Placed) -> Vec<Idle> {
    let mut found = Vec::new();
    for body in 0..spec.bodies.len() {
        let joints: Vec<usize> = (0..placed.joints.len())
            .filter(|&j| [placed.joints[j].parent, placed.joints[j].child].contains(&(body + 1)))
            .filter(|&j| spec.joints[j].kind != JointKind::Free)
            .collect();
        if joints.len() < 2 || joints.iter().any(|&j| spec.joints[j].kind != JointKind::Spherical) {
            continue;
        }
        let at: Vec<Vec3<f64>> = points(placed, body).collect();
        let Some(&point) = at.first() else { continue };
        let far = at.iter().map(|x| *x - point).max_by(|a, b| a.norm().total_cmp(&b.norm()));
        let Some(line) = far.and_then(|x| x.unit()) else { continue };
        if at.iter().all(|x| (*x - point).cross(line).norm() < ON_LINE * placed.size) {
            found.push(Idle { body, joints, line, point });
        }
    }
    found
}

/// Rods without inertia about their line, whose spin nobody asks for.
pub fn held(spec: &Spec, placed: &Placed) -> Vec<HeldSpin> {
    if placed.planar {
        return Vec::new();
    }
    let heaviest = heaviest(placed);
    let rods = idle(spec, placed).into_iter().filter(|x| !is_seen(spec, placed, x));
    rods.filter_map(|x| {
        let b = &placed.bodies[x.body];
        let about = b.inertia.add(&Mat3::steiner(b.mass, b.com - x.point));
        let own = x.line.dot(about.apply(x.line));
        let across = 0.5 * (about.0[0][0] + about.0[1][1] + about.0[2][2] - own);
        let reach = points(placed, x.body).fold(0.0, |r: f64, p| r.max((p - x.point).norm()));
        (own <= NONE * across.max(b.mass * reach * reach)).then(|| {
            let i = &b.inertia.0;
            let inertia = (0.5 * (i[0][0] + i[1][1] + i[2][2])).max(LEAST_MASS * heaviest * reach * reach);
            HeldSpin { body: x.body, line: x.line, inertia }
        })
    })
    .collect()
}

/// Does a force, a drive or a condition see this body turn about its line?
fn is_seen(spec: &Spec, placed: &Placed, x: &Idle) -> bool {
    let b = &placed.bodies[x.body];
    let name = spec.bodies[x.body].name.as_str();
    let off = |body: &str, point: &[f64; 3]| {
        let at = b.origin + b.rot.apply(Vec3(*point));
        body == name && (at - x.point).cross(x.line).norm() >= ON_LINE * placed.size
    };
    let turned = |body: &str, axis: &[f64; 3]| body == name && b.rot.apply(Vec3(*axis)).cross(x.line).norm() >= ON_LINE;
    let joint = |j: &str| x.joints.iter().any(|&i| spec.joints[i].name == j);
    let measured = |m: &Measure| match m {
        Measure::Joint { joint: j, .. } => joint(j),
        Measure::Distance { body1, point1, body2, point2 } => off(body1, point1) || off(body2, point2),
        Measure::Along { body1, body2, point2, .. } => body1 == name || off(body2, point2),
        Measure::Cosine { body1, axis1, body2, axis2 } => turned(body1, axis1) || turned(body2, axis2),
    };
    let by_force = |f: &Force| match f {
        Force::Spring { body1, point1, body2, point2, .. } => off(body1, point1) || off(body2, point2),
        Force::Force { body, point, .. } => off(body, point),
        Force::TorsionSpring { joint: j, .. } => joint(j),
        Force::Torque { joint: j, over, .. } => joint(j) || over.as_ref().is_some_and(measured),
        Force::Weightless(_) | Force::Gravity(_) => false,
        other => other
            .load()
            .is_some_and(|load| load.bodies().contains(&name) || load.joints().into_iter().any(|(j, _)| joint(j))),
    };
    let by_coupling = |c: &crate::spec::Coupling| match c {
        crate::spec::Coupling::Roll { body, on, .. } => body == name || on == name,
        other => other.terms().iter().any(measured),
    };
    spec.drives.iter().any(|d| measured(&d.measure))
        || spec.couplings.iter().any(by_coupling)
        || spec.forces.iter().any(by_force)
}
