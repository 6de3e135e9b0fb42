//! Idle spins: rotations of bodies about a line that move no other body and on which no load depends.
//!
//! What a joint leaves of the rotations of one of its bodies, in any position, is a point fixed on that body through which
//! the line must pass, a direction fixed on it that the line must have, or both. A single body spins where all its points
//! lie on one line. Of several bodies whose joints move, two points, each fixed on one of them, define a line in any position.

use crate::joint::{LockedSlides, Motion};
use crate::spec::{Coupling, Force, JointKind, Measure, Spec};
use crate::zero_position::Placed;
use partita_math::spatial::Vec3;
use partita_math::tolerance;

/// A rotation of bodies that moves nothing else.
#[derive(Clone, Debug)]
pub struct Idle {
    /// The bodies, by number: one, or several that rotate as one.
    pub bodies: Vec<usize>,
    /// Joints that link them to others.
    pub joints: Vec<usize>,
    /// Couplings that do.
    pub couplings: Vec<usize>,
    /// Whether some load depends on the rotation: gravity on a centre of mass off the line, a force, a drive.
    pub loaded: bool,
}

/// A rotation of bodies about a line that moves no other body.
pub(crate) struct Turning<'b> {
    /// The bodies, by number.
    pub bodies: &'b [usize],
    /// A point of the line.
    pub point: Vec3<f64>,
    /// None: any line through the point.
    pub line: Option<Vec3<f64>>,
}

impl Turning<'_> {
    /// Whether a node (0 ground, body i is i + 1) belongs to it.
    fn contains(&self, node: usize) -> bool {
        node > 0 && self.bodies.contains(&(node - 1))
    }
}

/// What a joint or a coupling requires of the line of a spin, mechanism axes in the zero position.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Attachment {
    /// The line passes through this point, fixed on the body.
    pub point: Option<Vec3<f64>>,
    /// It has this direction, fixed on the body.
    pub direction: Option<Vec3<f64>>,
}

impl Attachment {
    /// Whether the body is free to rotate about its point.
    pub fn is_ball(&self) -> bool {
        self.point.is_some() && self.direction.is_none()
    }
}

/// The joints of each body, in their order: collected once, for any number of bodies.
pub(crate) fn around(placed: &Placed) -> Vec<Vec<usize>> {
    let mut found = vec![Vec::new(); placed.bodies.len()];
    for (j, p) in placed.joints.iter().enumerate().filter(|x| !x.1.apart) {
        if p.parent > 0 {
            found[p.parent - 1].push(j);
        }
        if p.child > 0 && p.child != p.parent {
            found[p.child - 1].push(j);
        }
    }
    found
}

/// What joint `j` requires of the line about which one of its bodies spins; none where it prevents any spin.
pub(crate) fn attachment(placed: &Placed, j: usize, body: usize) -> Option<Attachment> {
    let p = &placed.joints[j];
    if p.shape.own.is_some() {
        return None;
    }
    let is_child = p.child == body + 1;
    let side = |x: Vec3<f64>| if is_child { p.on_child.apply(x) } else { p.on_parent.apply(x) };
    let mut turns = p.shape.motions.iter().filter(|m| !matches!(m, Motion::Slide(_)));
    let turn = if is_child { turns.next_back() } else { turns.next() };
    let mut direction = match turn? {
        Motion::Turn(a) => Some(side(*a)),
        _ => None,
    };
    let here = Some(point_on(placed, j, body));
    let slides: Vec<Vec3<f64>> =
        p.shape.motions.iter().filter_map(|m| if let Motion::Slide(a) = m { Some(side(*a)) } else { None }).collect();
    let point = match (&p.shape.slides, slides.as_slice()) {
        // the point of the child moves along directions fixed on the parent
        (LockedSlides::All, _) => here,
        (_, [_, _, _]) => None,
        _ if is_child => here,
        (_, slides) => {
            let (point, along) = match slides {
                [a] => (here, *a),
                [a, b] => (None, a.cross(*b).direction()),
                _ => (here, direction?),
            };
            if direction.is_some_and(|d| d.cross(along).norm() >= tolerance::EQUAL) {
                return None;
            }
            direction = Some(along);
            point
        }
    };
    Some(Attachment { point, direction })
}

/// A joint's point on one of its two bodies.
pub(crate) fn point_on(placed: &Placed, joint: usize, body: usize) -> Vec3<f64> {
    let p = &placed.joints[joint];
    if p.child == body + 1 {
        p.child_point
    } else {
        p.parent_point
    }
}

/// The line through points, none where they coincide; nothing where they are not collinear.
pub(crate) fn line_through(at: &[Vec3<f64>], placed: &Placed) -> Option<Option<Vec3<f64>>> {
    let &first = at.first()?;
    let near = tolerance::EQUAL * placed.size;
    let far = at.iter().map(|x| *x - first).max_by(|a, b| a.norm().total_cmp(&b.norm()))?;
    let Some(line) = far.unit().filter(|_| far.norm() >= near) else { return Some(None) };
    at.iter().all(|x| (*x - first).cross(line).norm() < near).then_some(Some(line))
}

/// Whether a coordinate of joint `j` changes with the rotation.
fn turns_coordinate(placed: &Placed, j: usize, coordinate: usize, x: &Turning) -> bool {
    let p = &placed.joints[j];
    if x.contains(p.parent) == x.contains(p.child) {
        return false;
    }
    let side = |a: Vec3<f64>| if x.contains(p.child) { p.on_child.apply(a) } else { p.on_parent.apply(a) };
    match p.shape.motion_of(coordinate) {
        // the child's point lies on the line, or the slide along it
        Some(Motion::Slide(_)) => false,
        Some(Motion::Turn(a)) => x.line.is_none_or(|e| side(a).cross(e).norm() < tolerance::EQUAL),
        Some(Motion::Ball) => true,
        None => false,
    }
}

/// Whether a force, a drive or a condition depends on the rotation of these bodies.
pub(crate) fn is_seen(spec: &Spec, placed: &Placed, x: &Turning) -> bool {
    let of = |name: &str| x.bodies.iter().copied().find(|&b| spec.bodies[b].name == name);
    let near = tolerance::EQUAL * placed.size;
    let off = |body: &str, point: &[f64; 3]| {
        of(body).is_some_and(|i| {
            let b = &placed.bodies[i];
            let from = b.origin + b.rot.apply(Vec3(*point)) - x.point;
            x.line.map_or_else(|| from.norm(), |e| from.cross(e).norm()) >= near
        })
    };
    let turned = |body: &str, axis: &[f64; 3]| {
        of(body).is_some_and(|i| {
            let axis = placed.bodies[i].rot.apply(Vec3(*axis));
            x.line.is_none_or(|e| axis.cross(e).norm() >= tolerance::EQUAL * axis.norm())
        })
    };
    let within = |one: &str, other: &str| of(one).is_some() && of(other).is_some();
    let joint = |name: &str, coordinate: usize| {
        placed.joint_numbers.get(name).is_some_and(|&j| turns_coordinate(placed, j, coordinate, x))
    };
    let measured = |m: &Measure| match m {
        Measure::Joint { joint: j, coordinate } => joint(j, *coordinate),
        Measure::Distance { body1, point1, body2, point2 } => {
            !within(body1, body2) && (off(body1, point1) || off(body2, point2))
        }
        Measure::Along { body1, body2, point2, .. } => {
            !within(body1, body2) && (of(body1).is_some() || off(body2, point2))
        }
        Measure::Cosine { body1, axis1, body2, axis2 } => {
            !within(body1, body2) && (turned(body1, axis1) || turned(body2, axis2))
        }
    };
    let by_force = |f: &Force| match f {
        Force::Force(x) => off(&x.body, &x.point),
        Force::Torque(x) => joint(&x.joint, x.coordinate) || x.over.as_ref().is_some_and(measured),
        Force::Weightless(_) | Force::Gravity(_) => false,
        other => {
            if let Some([(body1, point1), (body2, point2)]) = other.record().line() {
                return !within(body1, body2) && (off(body1, &point1) || off(body2, &point2));
            }
            let (bodies, own) = (other.record().bodies(), other.record().joints());
            let along = other.along().into_iter().chain(other.over());
            let inside =
                matches!(other, Force::Bushing(_) | Force::Contact(_)) && bodies.iter().all(|name| of(name).is_some());
            !inside && bodies.iter().any(|name| of(name).is_some()) || along.chain(own).any(|(j, i)| joint(j, i))
        }
    };
    let by_coupling = |c: &Coupling| match c {
        Coupling::Roll { body, on, .. } => of(body).is_some() || of(on).is_some(),
        other => other.terms().iter().any(measured),
    };
    spec.drives.iter().any(|d| measured(&d.measure))
        || spec.couplings.iter().any(by_coupling)
        || spec.forces.iter().any(by_force)
}

/// Points and directions that a set of bodies meets outside itself.
#[derive(Default)]
struct Surroundings {
    /// Body and point.
    points: Vec<(usize, Vec3<f64>)>,
    directions: Vec<Vec3<f64>>,
    /// One of the attachments leaves all rotations about a point.
    is_ball: bool,
    /// A neighbour that moves.
    moves: bool,
    joints: Vec<usize>,
    couplings: Vec<usize>,
}

/// What links these bodies to others, none where that prevents any spin.
fn surroundings(spec: &Spec, placed: &Placed, around: &[Vec<usize>], bodies: &[usize]) -> Option<Surroundings> {
    let mut found = Surroundings::default();
    let inside = |node: usize| node > 0 && bodies.contains(&(node - 1));
    for &body in bodies {
        for &j in &around[body] {
            let p = &placed.joints[j];
            if inside(p.parent) && inside(p.child) || spec.joints[j].kind == JointKind::Free {
                continue;
            }
            let attachment = attachment(placed, j, body)?;
            let Attachment { point, direction } = attachment;
            found.is_ball |= attachment.is_ball();
            found.moves |= p.parent > 0 && p.child > 0;
            found.points.extend(point.map(|x| (body, x)));
            found.directions.extend(direction);
            found.joints.push(j);
        }
    }
    for (k, coupling) in spec.couplings.iter().enumerate() {
        for m in coupling.terms() {
            let Measure::Distance { body1, point1, body2, point2 } = m else { continue };
            let of = |name: &str| bodies.iter().copied().find(|&b| spec.bodies[b].name == name);
            let (body, point, other) = match (of(body1), of(body2)) {
                (Some(body), None) => (body, point1, body2),
                (None, Some(body)) => (body, point2, body1),
                _ => continue,
            };
            let b = &placed.bodies[body];
            found.points.push((body, b.origin + b.rot.apply(Vec3(*point))));
            found.is_ball = true;
            found.moves |= other != crate::validate::GROUND;
            found.couplings.push(k);
        }
    }
    Some(found)
}

/// The line, as a point and a direction, that these attachments leave in any position.
fn line_of(placed: &Placed, bodies: &[usize], x: &Surroundings) -> Option<(Vec3<f64>, Vec3<f64>)> {
    let at: Vec<Vec3<f64>> = x.points.iter().map(|p| p.1).collect();
    let &first = at.first()?;
    let line = match (line_through(&at, placed)?, x.directions.first()) {
        (Some(line), _) => line,
        (None, Some(direction)) => *direction,
        (None, None) => return None,
    };
    if x.directions.iter().any(|d| d.cross(line).norm() >= tolerance::EQUAL) {
        return None;
    }
    let rotates = match bodies {
        [_] => true,
        // two points, each on one body, define a line however the bodies move between them
        _ => {
            x.directions.is_empty() && {
                let near = |a: Vec3<f64>, b: Vec3<f64>| (a - b).norm() < tolerance::EQUAL * placed.size;
                let alike = |of: &[(usize, Vec3<f64>)]| of.iter().all(|p| p.0 == of[0].0 && near(p.1, of[0].1));
                let (here, there): (Vec<_>, Vec<_>) = x.points.iter().copied().partition(|p| near(p.1, first));
                alike(&here) && alike(&there)
            }
        }
    };
    rotates.then_some((first, line))
}

/// Sets of bodies linked without ball joints, none of them with the ground: they may rotate as one.
fn groups(placed: &Placed, around: &[Vec<usize>]) -> Vec<Vec<usize>> {
    let is_ball = |j: usize| {
        let p = &placed.joints[j];
        let of = |node: usize| node.checked_sub(1).and_then(|body| attachment(placed, j, body));
        [p.parent, p.child].into_iter().filter_map(of).any(|x| x.is_ball())
    };
    let mut seen = vec![false; placed.bodies.len()];
    let mut found = Vec::new();
    for start in 0..seen.len() {
        if seen[start] {
            continue;
        }
        seen[start] = true;
        let (mut group, mut next, mut grounded) = (vec![start], 0, false);
        while let Some(&body) = group.get(next) {
            next += 1;
            for &j in around[body].iter().filter(|&&j| !is_ball(j)) {
                let p = &placed.joints[j];
                let other = if p.child == body + 1 { p.parent } else { p.child };
                match other.checked_sub(1) {
                    None => grounded = true,
                    Some(other) if !seen[other] => {
                        seen[other] = true;
                        group.push(other);
                    }
                    Some(_) => {}
                }
            }
        }
        if group.len() > 1 && !grounded {
            group.sort_unstable();
            found.push(group);
        }
    }
    found
}

/// Spins that move no other body, of single bodies and of those that rotate as one.
pub fn idle(spec: &Spec, placed: &Placed) -> Vec<Idle> {
    if placed.planar {
        return Vec::new();
    }
    let around = around(placed);
    let of = |bodies: &[usize]| -> Option<Idle> {
        let x = surroundings(spec, placed, &around, bodies)?;
        // a shaft in bearings has its spin as a coordinate, and so has a rotor with a ball at one end
        let spins = x.is_ball && (x.directions.is_empty() || x.moves);
        let (point, line) = line_of(placed, bodies, &x).filter(|_| spins && x.points.len() + x.directions.len() > 1)?;
        let near = tolerance::EQUAL * placed.size;
        let heavy = |&b: &usize| {
            let b = &placed.bodies[b];
            b.mass > 0.0 && (b.com - point).cross(line).norm() >= near
        };
        let loaded = bodies.iter().any(heavy) || is_seen(spec, placed, &Turning { bodies, point, line: Some(line) });
        Some(Idle { bodies: bodies.to_vec(), joints: x.joints, couplings: x.couplings, loaded })
    };
    let mut found: Vec<Idle> = (0..placed.bodies.len()).filter_map(|b| of(&[b])).collect();
    let alone = |b: &usize, found: &[Idle]| found.iter().any(|x| x.bodies == [*b] && !x.loaded);
    for group in groups(placed, &around) {
        // where each of them spins by itself, together they do nothing new
        if !group.iter().all(|b| alone(b, &found)) {
            found.extend(of(&group));
        }
    }
    found
}
