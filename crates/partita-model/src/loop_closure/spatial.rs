//! Loops in space by a characteristic pair of joints.                                                   (8.2, 39)
//!
//! ```text
//!            J                      J: a turn or a slide between X and Y
//!    Y ------------- X              Z: a link with its centres in A and B
//!      \           /                A: a ball; B: a ball, a universal or a cylindrical joint
//!     B  \       /  A
//!          ( Z )
//! ```
//!
//! The distance of the centres, fixed on Z, does not contain the coordinates of A and B: one equation for that of J.
//! Then the direction of Z is known. A universal joint turns it there by its two angles; between two balls the link
//! keeps its spin, as far as the shortest turn allows: the spin is an input, and the part of it that this velocity sees
//! is a factor of the pivot.
//!
//! B may be a cylindrical joint as well. Then it is the distance of the centre A from its axis that counts, for a turn
//! J about a parallel axis or a slide J.

use super::arm::crossing;
use super::graph::{Graph, Kind};
use super::planar::Shortfall;
use super::polygon::{Freedom, Polygon};
use partita_math::spatial::{Mat3, Vec3};

/// Round-off that an exactly flat position may show, in parts of the terms of the equation.
const FLAT: f64 = 8.0 * f64::EPSILON;

/// `a cos ψ + b sin ψ + c = 0`: ψ and the pivot `√(R² − c²)/R`; if there is none, how far |c| exceeds R.   (39)
pub(super) fn characteristic(a: f64, b: f64, c: f64, scale: f64, sign: f64) -> Result<(f64, f64), f64> {
    let r = a.hypot(b);
    if c.abs() - r > FLAT * scale || r <= f64::MIN_POSITIVE {
        return Err(c.abs() - r);
    }
    let root = sign * ((r - c.abs()).max(0.0) * (r + c.abs())).sqrt();
    Ok((b.atan2(a) + root.atan2(-c), root.abs() / r))
}

/// Signed angle about `axis` from a to b.
fn angle_about(axis: Vec3<f64>, a: Vec3<f64>, b: Vec3<f64>) -> f64 {
    let (a, b) = (a - axis.times(axis.dot(a)), b - axis.times(axis.dot(b)));
    axis.dot(a.cross(b)).atan2(a.dot(b))
}

/// Solve the triangle (J, A, B); writes the coordinates of its edges. Signs and pivots: of J, and of the universal
/// joint.
pub(super) fn solve(
    g: &Graph,
    p: &Polygon,
    signs: [i8; 2],
    x: &mut [f64],
    balls: &mut [Mat3<f64>],
) -> Result<[f64; 2], Shortfall> {
    let (r1, d1) = p.sides[0].spatial(g, x, balls);
    let (r2, d2) = p.sides[1].spatial(g, x, balls);
    let (r3, d3) = p.sides[2].spatial(g, x, balls);
    let (j, forward) = p.joints[0].edges[0];
    let edge = &g.edges[j];
    let length = d2.norm();
    // axes E before J, F behind it; forward: A = R(a, ψ) K d1 in E, or backward, in K E: A = R(a, −ψ) d1
    let b = -r3.apply_transposed(d3);
    let (c, b, sense) = if forward { (edge.rest.apply(d1), b, 1.0) } else { (d1, edge.rest.apply(b), -1.0) };
    let axis = edge.axis;
    let first = f64::from(signs[0]);
    let (value, pivot) = if p.joints[2].freedom == Freedom::Cylindrical {
        // all seen along the axis of B
        let (before, behind) = axes_of(g, p.joints[2].edges[0], p.joints[2].edges[1]);
        let u = r3.apply_transposed(behind);
        let u = if forward { u } else { edge.rest.apply(u) };
        let flat = |x: Vec3<f64>, u: Vec3<f64>| x - u.times(u.dot(x));
        let distance = flat(r2.apply_transposed(d2), before).norm();
        let (c, b) = (flat(c, u), flat(b, u));
        if edge.kind == Kind::Turn {
            on_circle(axis, c, b, distance, first)?
        } else {
            let across = flat(axis, u);
            let part = across.norm();
            let Some(direction) = across.unit().filter(|_| part > FLAT) else {
                return Err(Shortfall(((c - b).norm() - distance).abs()));
            };
            let (value, pivot) = on_line(direction, c, b, distance, first)?;
            (value / part, pivot)
        }
    } else if edge.kind == Kind::Turn {
        on_circle(axis, c, b, length, first)?
    } else {
        on_line(axis, c, b, length, first)?
    };
    x[j] = sense * value;
    let r_ef = crossing(g, j, forward, x[j], &Mat3::identity());
    // everything in the axes F: the direction from A to B
    let shift = match (edge.kind, forward) {
        (Kind::Slide, true) => r_ef.apply_transposed(axis.times(-x[j])),
        (Kind::Slide, false) => axis.times(x[j]),
        _ => Vec3::zero(),
    };
    let centre_b = r_ef.apply_transposed(-r3.apply_transposed(d3)) + shift;
    let w = centre_b - d1;
    let r_b = r_ef.transpose().mul(&r3.transpose());
    match p.joints[2].freedom {
        Freedom::Universal => {
            let (cross, second) = universal(g, p, w, &r_b, &r2, d2, f64::from(signs[1]), x)?;
            let r_z = r_b.mul(&cross.transpose()).mul(&r2.transpose());
            set_ball(g, p.joints[1].edges[0], &r1.transpose().mul(&r_z), balls);
            Ok([pivot, second])
        }
        Freedom::Cylindrical => {
            let cross = cylindrical(g, p, w, &r_b, &r2, d2, x);
            let r_z = r_b.mul(&cross.transpose()).mul(&r2.transpose());
            set_ball(g, p.joints[1].edges[0], &r1.transpose().mul(&r_z), balls);
            Ok([pivot, 1.0])
        }
        _ => {
            let (a, a_forward) = p.joints[1].edges[0];
            let (b, b_forward) = p.joints[2].edges[0];
            let spin = |joint: usize| match p.joints[joint].freedom {
                Freedom::Ball { inputs } if inputs != 0 => Some(inputs.trailing_zeros() as usize),
                _ => None,
            };
            let old = if spin(1).is_some() {
                r1.mul(&crossing(g, a, a_forward, 0.0, &balls[a]))
            } else {
                r_b.mul(&crossing(g, b, b_forward, 0.0, &balls[b]).transpose()).mul(&r2.transpose())
            };
            let (from, to) = match (old.apply(d2).unit(), w.unit()) {
                (Some(from), Some(to)) => (from, to),
                _ => return Err(Shortfall(length)),
            };
            let r_z = Mat3::between(from, to).mul(&old);
            set_ball(g, (a, a_forward), &r1.transpose().mul(&r_z), balls);
            set_ball(g, (b, b_forward), &r_z.mul(&r2).transpose().mul(&r_b), balls);
            // the part of the spin that its input sees: the line of the centres in the axes behind the ball
            let seen = match (spin(1), a_forward, b_forward) {
                (Some(i), true, _) => r_z.apply_transposed(to).0[i],
                (Some(i), false, _) => r1.apply_transposed(to).0[i],
                (None, _, true) => r_b.apply_transposed(to).0[spin(2).unwrap_or(0)],
                (None, _, false) => r_z.mul(&r2).apply_transposed(to).0[spin(2).unwrap_or(0)],
            };
            Ok([pivot * seen.abs().min(1.0), 1.0])
        }
    }
}

/// `|R(a, ψ) c − b| = L`.
fn on_circle(axis: Vec3<f64>, c: Vec3<f64>, b: Vec3<f64>, length: f64, sign: f64) -> Result<(f64, f64), Shortfall> {
    let along = axis.times(axis.dot(c));
    let (across, gap) = (c - along, b - along);
    let (p, q) = (-2.0 * gap.dot(across), -2.0 * gap.dot(axis.cross(c)));
    let rest = gap.dot(gap) + across.dot(across) - length * length;
    let scale = gap.dot(gap) + across.dot(across) + length * length;
    characteristic(p, q, rest, scale, sign).map_err(|_| {
        let r = p.hypot(q);
        let (far, near) = (rest + length * length + r, rest + length * length - r);
        Shortfall(if rest > 0.0 { near.max(0.0).sqrt() - length } else { length - far.max(0.0).sqrt() })
    })
}

/// `|a s + c − b| = L`.
fn on_line(axis: Vec3<f64>, c: Vec3<f64>, b: Vec3<f64>, length: f64, sign: f64) -> Result<(f64, f64), Shortfall> {
    let w0 = c - b;
    let along = axis.dot(w0);
    let off = (w0 - axis.times(along)).norm();
    if off - length > FLAT * (off + length) || length <= 0.0 {
        return Err(Shortfall((off - length).max(0.0)));
    }
    let root = sign * ((length - off).max(0.0) * (length + off)).sqrt();
    Ok((root - along, root.abs() / length))
}

/// The two turns of the universal joint B that put the centre of A where it is; the turn across B and its pivot.
fn universal(
    g: &Graph,
    p: &Polygon,
    w: Vec3<f64>,
    r_b: &Mat3<f64>,
    r2: &Mat3<f64>,
    d2: Vec3<f64>,
    sign: f64,
    x: &mut [f64],
) -> Result<(Mat3<f64>, f64), Shortfall> {
    let [(i1, f1), (i2, f2)] = p.joints[2].edges[..] else { return Err(Shortfall(0.0)) };
    let (e1, e2) = (&g.edges[i1], &g.edges[i2]);
    let identity = Mat3::identity();
    // crossing i = L_i R(a_i, ψ_i) M_i
    let split = |rest: &Mat3<f64>, forward: bool| {
        if forward {
            (identity, *rest)
        } else {
            (rest.transpose(), identity)
        }
    };
    let ((l1, m1), (l2, m2)) = (split(&e1.rest, f1), split(&e2.rest, f2));
    // from B to A, as the far side of B sees it and as Z sees it
    let y = m2.apply(-r_b.apply_transposed(w));
    let z = l1.apply_transposed(-r2.apply_transposed(d2));
    let between = m1.mul(&l2);
    let a1 = between.apply_transposed(e1.axis);
    let along = e2.axis.times(e2.axis.dot(y));
    let (a, b) = (a1.dot(y - along), a1.dot(e2.axis.cross(y)));
    let c = a1.dot(along) - e1.axis.dot(z);
    let (psi2, pivot) = characteristic(a, b, c, y.norm() + z.norm(), sign).map_err(|by| Shortfall(by.max(0.0)))?;
    let turned = between.apply(Mat3::about(e2.axis, psi2.sin(), psi2.cos()).apply(y));
    let psi1 = angle_about(e1.axis, turned, z);
    x[i1] = if f1 { psi1 } else { -psi1 };
    x[i2] = if f2 { psi2 } else { -psi2 };
    let cross = crossing(g, i1, f1, x[i1], &identity).mul(&crossing(g, i2, f2, x[i2], &identity));
    Ok((cross, pivot))
}

/// Axis of a cylindrical joint as the node before its first crossed edge and the node behind its last one see it.
fn axes_of(g: &Graph, first: (usize, bool), last: (usize, bool)) -> (Vec3<f64>, Vec3<f64>) {
    let seen = |(e, from): (usize, bool)| {
        let e = &g.edges[e];
        if from {
            e.axis
        } else {
            e.rest.apply_transposed(e.axis)
        }
    };
    (seen(first), seen((last.0, !last.1)))
}

/// Turn and slide of the cylindrical joint B that put the centre of A where it is; the turn across B.
fn cylindrical(
    g: &Graph,
    p: &Polygon,
    w: Vec3<f64>,
    r_b: &Mat3<f64>,
    r2: &Mat3<f64>,
    d2: Vec3<f64>,
    x: &mut [f64],
) -> Mat3<f64> {
    let identity = Mat3::identity();
    let y = -r_b.apply_transposed(w);
    let z = -r2.apply_transposed(d2);
    let edges = &p.joints[2].edges;
    // turns before and behind the unknown one: across B = before · R(a, ψ) · behind
    let (mut before, mut behind, mut unknown) = (identity, identity, None);
    for &(i, forward) in edges {
        let e = &g.edges[i];
        let rest = if forward { e.rest } else { e.rest.transpose() };
        match (e.kind, forward) {
            (Kind::Turn, true) => {
                unknown = Some((i, 1.0));
                behind = rest;
            }
            (Kind::Turn, false) => {
                before = before.mul(&rest);
                unknown = Some((i, -1.0));
            }
            _ if unknown.is_none() => before = before.mul(&rest),
            _ => behind = behind.mul(&rest),
        }
    }
    if let Some((i, sense)) = unknown {
        x[i] = sense * angle_about(g.edges[i].axis, behind.apply(y), before.apply_transposed(z));
    }
    let mut cross = identity;
    let mut slides = None;
    for &(i, forward) in edges {
        let here = cross;
        cross = cross.mul(&crossing(g, i, forward, x[i], &identity));
        if g.edges[i].kind == Kind::Slide {
            // axes in which the slide is given: before the crossing, or behind it going backward
            slides = Some((i, if forward { (here, 1.0) } else { (cross, -1.0) }));
        }
    }
    if let Some((i, (axes, sense))) = slides {
        x[i] = sense * g.edges[i].axis.dot(axes.apply_transposed(z - cross.apply(y)));
    }
    cross
}

/// Orientation of a ball from the turn across it.
fn set_ball(g: &Graph, (e, forward): (usize, bool), cross: &Mat3<f64>, balls: &mut [Mat3<f64>]) {
    let rest = g.edges[e].rest.transpose();
    balls[e] = if forward { cross.mul(&rest) } else { cross.transpose().mul(&rest) };
}
