//! Readings of a description.

use super::{Ends, Measurement, Mover, Quantity, Turn};
use crate::compile;
use crate::error::DescriptionError;
use crate::joint::Motion;
use crate::numbers::Numbers;
use crate::spec::{Drive, Level, Measure, Spec};
use crate::tree::{Link, LinkMotion, Tree};
use crate::validate;
use crate::zero_position::{Placed, PlacedJoint};
use partita_math::spatial::{Mat3, Space, Vec3};
use std::collections::HashMap;

/// Data from which readings are made.
pub struct Maker<'a, G: Space> {
    placed: &'a Placed,
    numbers: &'a Numbers<G::S>,
    pub(crate) origins: Vec<Vec3<G::S>>,
    links: &'a [Link<G>],
    pub(crate) nodes: HashMap<&'a str, usize>,
}

/// Number of a joint.
fn joint_number(placed: &Placed, joint: &str, element: &'static str, name: &str) -> Result<usize, DescriptionError> {
    let number = placed.joint_numbers.get(joint).copied();
    number.ok_or_else(|| DescriptionError::new(element, name, format!("there is no joint \"{joint}\"")))
}

/// Refuse readings that do not exist: unknown names, coordinates that a joint does not have.
pub fn known(m: &Measure, placed: &Placed, element: &'static str, name: &str) -> Result<(), DescriptionError> {
    let Measure::Joint { joint, coordinate } = m else { return Ok(()) };
    let j = joint_number(placed, joint, element, name)?;
    motion_of(&placed.joints[j], *coordinate, joint, element, name).map(|_| ())
}

/// Refuse drives of quantities that cannot be driven so.
pub fn drivable(d: &Drive, placed: &Placed) -> Result<(), DescriptionError> {
    let in_space = |(j, i): (usize, usize)| placed.joints[j].shape.motions[i] == Motion::Ball;
    let of_joint = match &d.measure {
        Measure::Joint { joint, coordinate } => match placed.joint_numbers.get(joint) {
            Some(&j) => Some((j, any_motion(&placed.joints[j], *coordinate, joint, "drive", &d.name)?.0)),
            None => None,
        },
        _ => None,
    };
    let turns = of_joint.is_some_and(in_space);
    match (&d.turning, d.level) {
        (Some(_), Level::Position) if turns => Ok(()),
        (Some(_), _) => {
            let message = "an orientation can be prescribed only for the positions of a spatial rotation";
            Err(DescriptionError::new("drive", &d.name, message))
        }
        (None, Level::Velocity) if turns => Ok(()),
        (None, _) => known(&d.measure, placed, "drive", &d.name),
    }
}

/// The motion whose coordinate is number `coordinate` of a joint: a translation or a rotation, and its index among the
/// motions.
fn motion_of(
    p: &PlacedJoint,
    coordinate: usize,
    joint: &str,
    element: &'static str,
    name: &str,
) -> Result<usize, DescriptionError> {
    let (motion, _) = any_motion(p, coordinate, joint, element, name)?;
    if p.shape.motions[motion] == Motion::Ball {
        let message = format!(
            "coordinate {coordinate} of joint \"{joint}\" is part of a spatial rotation, which no single number \
             measures; name a translation or an angle, measure between points of the bodies, or drive the joint by \
             its pose"
        );
        return Err(DescriptionError::new(element, name, message));
    }
    Ok(motion)
}

/// The motion whose velocity is number `coordinate` of a joint, and which of its velocities.
fn any_motion(
    p: &PlacedJoint,
    coordinate: usize,
    joint: &str,
    element: &'static str,
    name: &str,
) -> Result<(usize, usize), DescriptionError> {
    let mut left = coordinate;
    for (i, m) in p.shape.motions.iter().enumerate() {
        if left < m.velocities() {
            return Ok((i, left));
        }
        left -= m.velocities();
    }
    let message = format!(
        "joint \"{joint}\" has {} coordinates, but number {coordinate} was requested (the first is number 0)",
        p.shape.dof()
    );
    Err(DescriptionError::new(element, name, message))
}

impl<'a, G: Space> Maker<'a, G> {
    /// For the links of a tree.
    pub fn new(
        spec: &'a Spec,
        placed: &'a Placed,
        numbers: &'a Numbers<G::S>,
        tree: &'a Tree<G>,
    ) -> Result<Self, DescriptionError> {
        let (origins, nodes) = (compile::origins(placed, numbers), validate::nodes(spec)?);
        Ok(Self { placed, numbers, origins, links: &tree.links, nodes })
    }

    /// The reading of a measure; `element` and `name` identify the caller.
    pub fn reading(&self, m: &Measure, element: &'static str, name: &str) -> Result<Measurement<G>, DescriptionError> {
        let node = |body: &str| match self.nodes.get(body) {
            Some(node) => Ok(*node),
            None => Err(DescriptionError::new(element, name, format!("there is no body \"{body}\""))),
        };
        match m {
            Measure::Joint { joint, coordinate } => self.joint(joint, *coordinate, element, name),
            Measure::Distance { body1, point1, body2, point2 } => {
                let nodes = [node(body1)?, node(body2)?];
                Ok(self.distance(nodes, [Vec3::from_f64(*point1), Vec3::from_f64(*point2)]))
            }
            Measure::Along { body1, point1, axis, body2, point2 } => {
                let nodes = [node(body1)?, node(body2)?];
                let axis = self.axis(nodes[0], *axis, element, name)?;
                let ends = self.ends(nodes, [self.point(nodes[0], point1), self.point(nodes[1], point2)]);
                Ok(self.between(nodes, Quantity::Along(ends, G::vec_from(axis.0))))
            }
            Measure::Cosine { body1, axis1, body2, axis2 } => {
                let nodes = [node(body1)?, node(body2)?];
                let [u, w] = [self.axis(nodes[0], *axis1, element, name)?, self.axis(nodes[1], *axis2, element, name)?];
                Ok(self.between(nodes, Quantity::Cosine(G::ang_from(u.0), G::ang_from(w.0))))
            }
        }
    }

    /// A translation or an angle of a joint.
    pub(crate) fn joint(
        &self,
        joint: &str,
        coordinate: usize,
        element: &'static str,
        name: &str,
    ) -> Result<Measurement<G>, DescriptionError> {
        let j = joint_number(self.placed, joint, element, name)?;
        let motion = motion_of(&self.placed.joints[j], coordinate, joint, element, name)?;
        Ok(self.coordinate(j, motion))
    }

    /// The measurement along which an effort in a joint acts: also a rate of spatial rotation about an axis of the
    /// child.
    pub(crate) fn effort(
        &self,
        joint: &str,
        coordinate: usize,
        element: &'static str,
        name: &str,
    ) -> Result<Measurement<G>, DescriptionError> {
        let p = &self.placed.joints[joint_number(self.placed, joint, element, name)?];
        let (motion, component) = any_motion(p, coordinate, joint, element, name)?;
        if p.shape.motions[motion] != Motion::Ball {
            return self.joint(joint, coordinate, element, name);
        }
        // the velocities of a ball joint are not its own where it is traversed from child to parent, nor where the zero
        // position differs from the drawing
        let own = !p.reversed && p.on_child.0 == self.placed.basis.0;
        Ok(match p.links.as_ref().filter(|_| own) {
            Some(links) => {
                self.in_tree(links[motion], Quantity::Velocity(self.placed.links[links[motion]].v + component))
            }
            None => self.between([p.parent, p.child], Quantity::Spin(self.axes(&p.on_child)[component])),
        })
    }

    /// The coordinate of a link that turns or slides.
    pub(crate) fn of_link(&self, link: usize) -> Measurement<G> {
        let at = &self.placed.links[link];
        self.in_tree(link, Quantity::Coordinate { q: at.q, v: at.v })
    }

    /// The coordinates of the tree itself.
    fn in_tree(&self, link: usize, quantity: Quantity<G>) -> Measurement<G> {
        let movers = vec![Mover { link, on_b: true, column: 0 }];
        Measurement { quantity, links: [0, 0], nodes: [0, 0], movers, wraps: false, adds_up: Vec::new() }
    }

    /// The reading of a drive: also a rate of spatial rotation, which is not the derivative of a coordinate.
    pub fn driven(&self, d: &Drive) -> Result<Measurement<G>, DescriptionError> {
        let Measure::Joint { joint, coordinate } = &d.measure else {
            return self.reading(&d.measure, "drive", &d.name);
        };
        let (j, component) = match self.turn_in_space(joint, *coordinate, &d.name)? {
            Some(found) => found,
            None => return self.reading(&d.measure, "drive", &d.name),
        };
        let p = &self.placed.joints[j];
        Ok(self.spin(p, component))
    }

    /// The rate of rotation about an axis of the child, of a joint with spatial rotation.
    pub(crate) fn spin(&self, p: &PlacedJoint, component: usize) -> Measurement<G> {
        let mut reading = self.between([p.parent, p.child], Quantity::Spin(self.axes(&p.on_child)[component]));
        if p.links.is_some() {
            reading.nodes = [0, 0];
        }
        reading
    }

    /// Axes of the drawing as a side of a joint carries them.
    pub(crate) fn axes(&self, r: &Mat3<f64>) -> [G::Ang; 3] {
        [0, 1, 2].map(|i| G::ang_from(r.column(i).0))
    }

    /// The joint and the component, if a velocity is part of a spatial rotation.
    pub(crate) fn turn_in_space(
        &self,
        joint: &str,
        coordinate: usize,
        name: &str,
    ) -> Result<Option<(usize, usize)>, DescriptionError> {
        let Some(&j) = self.placed.joint_numbers.get(joint) else { return Ok(None) };
        let p = &self.placed.joints[j];
        let (motion, component) = any_motion(p, coordinate, joint, "drive", name)?;
        Ok((p.shape.motions[motion] == Motion::Ball).then_some((j, component)))
    }

    /// Twist of the child of joint `j` about the z axis of the joint.
    pub fn twist(&self, j: usize) -> Measurement<G> {
        let p = &self.placed.joints[j];
        let of = |r: &Mat3<f64>| [0, 1].map(|i| G::ang_from(r.apply(p.shape.frame.column(i)).0));
        self.between([p.parent, p.child], Quantity::Twist { on_a: of(&p.on_parent), on_b: of(&p.on_child) })
    }

    /// The coordinate of a motion of joint `j`.
    pub fn coordinate(&self, j: usize, motion: usize) -> Measurement<G> {
        let p = &self.placed.joints[j];
        if let Some(links) = &p.links {
            return self.of_link(links[motion]);
        }
        let nodes = [p.parent, p.child];
        match p.shape.motions[motion] {
            Motion::Slide(a) => {
                let (parent_point, child_point) = self.numbers.joints[j];
                let ends = self.ends(nodes, [parent_point, child_point]);
                self.between(nodes, Quantity::Along(ends, G::vec_from(p.on_parent.apply(a).0)))
            }
            Motion::Turn(a) => {
                let mut reading = self.between(nodes, Quantity::Turn(turn(p, a)));
                if self.placed.planar {
                    (reading.adds_up, reading.wraps) = (in_plane(self.placed, p, a), false);
                }
                reading
            }
            // never needed: `motion_of` refuses it
            Motion::Ball => self.twist(j),
        }
    }

    /// Links of two nodes.
    pub(crate) fn links(&self, nodes: [usize; 2]) -> [usize; 2] {
        nodes.map(|n| self.placed.link_of(n))
    }

    /// Number of a body that exists, 0 for the ground.
    pub(crate) fn node(&self, body: &str) -> usize {
        self.nodes.get(body).copied().unwrap_or(0)
    }

    fn point(&self, node: usize, p: &[f64; 3]) -> Vec3<G::S> {
        self.numbers.point_on(self.placed, node, Vec3::from_f64(*p))
    }

    /// A unit axis given on a node, in the zero position.
    fn axis(
        &self,
        node: usize,
        axis: [f64; 3],
        element: &'static str,
        name: &str,
    ) -> Result<Vec3<f64>, DescriptionError> {
        let unit = Vec3(axis).unit().ok_or_else(|| {
            DescriptionError::new(
                element,
                name,
                format!("axis = {axis:?} has no direction; give a vector of finite length"),
            )
        })?;
        let rot = if node == 0 { self.placed.basis } else { self.placed.bodies[node - 1].rot };
        Ok(rot.apply(unit))
    }

    /// The distance of two points, given in the axes of their nodes' bodies.
    pub(crate) fn distance(&self, nodes: [usize; 2], points: [Vec3<G::S>; 2]) -> Measurement<G> {
        let [a, b] = [0, 1].map(|i| self.numbers.point_on(self.placed, nodes[i], points[i]));
        let out = G::out_of_space(b - a);
        self.between(nodes, Quantity::Distance(self.ends(nodes, [a, b]), out * out))
    }

    /// Two points of the zero position on their nodes.
    pub(crate) fn ends(&self, nodes: [usize; 2], points: [Vec3<G::S>; 2]) -> Ends<G> {
        let links = self.links(nodes);
        let reference = &self.numbers.reference;
        let (a, origin_a) = compile::anchor::<G>(links[0], points[0], reference, &self.origins);
        let (b, origin_b) = compile::anchor::<G>(links[1], points[1], reference, &self.origins);
        Ends { a, b, offset: G::vec_in(origin_b - origin_a), origin_b: G::vec_in(origin_b) }
    }

    /// A quantity between two nodes, with the links that change it.
    pub(crate) fn between(&self, nodes: [usize; 2], quantity: Quantity<G>) -> Measurement<G> {
        let links = self.links(nodes);
        // parents come before their children: the later one of the two is never an ancestor of the other
        let mut movers: Vec<Mover> = Vec::new();
        let [mut on_a, mut on_b] = links;
        while on_a != on_b {
            let is_b = on_b > on_a;
            let end = if is_b { &mut on_b } else { &mut on_a };
            movers.push(Mover { link: *end, on_b: is_b, column: 0 });
            *end = self.links[*end].parent;
        }
        let turns = matches!(quantity, Quantity::Turn(_) | Quantity::Twist { .. } | Quantity::Cosine(..))
            || matches!(quantity, Quantity::Spin(_));
        if turns {
            movers.retain(|m| !matches!(self.links[m.link].motion, LinkMotion::Slide(_)));
        }
        // in the plane angles are counted
        let wraps = matches!(quantity, Quantity::Turn(_)) && G::LENGTHS == 3;
        Measurement { quantity, links, nodes, movers, wraps, adds_up: Vec::new() }
    }
}

/// Rotations of the tree between the two sides of a joint of a planar mechanism.
fn in_plane(placed: &Placed, p: &PlacedJoint, axis: Vec3<f64>) -> Vec<(usize, f64)> {
    let sign = p.on_parent.apply(axis).0[2].signum();
    let mut all: Vec<(usize, f64)> = Vec::new();
    for (node, sign) in [(p.child, sign), (p.parent, -sign)] {
        let mut link = placed.link_of(node);
        while link != 0 {
            let l = &placed.links[link];
            if let Motion::Turn(a) = l.motion {
                let x = sign * a.0[2].signum();
                match all.iter().position(|(q, _)| *q == l.q) {
                    // the links that carry both sides
                    Some(i) => drop(all.swap_remove(i)),
                    None => all.push((l.q, x)),
                }
            }
            link = l.parent;
        }
    }
    all
}

/// The rotation about axis `a` of a joint that closes a loop.
fn turn<G: Space>(p: &PlacedJoint, a: Vec3<f64>) -> Turn<G> {
    let turns: Vec<Vec3<f64>> =
        p.shape.motions.iter().filter_map(|m| if let Motion::Turn(a) = m { Some(*a) } else { None }).collect();
    let (on_parent, on_child) = (|x: Vec3<f64>| p.on_parent.apply(x), |x: Vec3<f64>| p.on_child.apply(x));
    let ang = |x: Vec3<f64>| G::ang_from(x.0);
    match turns.as_slice() {
        [first, second] => {
            // the moment between the axes, one fixed on the parent and one on the child, that does work on one only
            let c = first.dot(*second);
            let (own, other) = (1.0 / (1.0 - c * c), -c / (1.0 - c * c));
            let is_second = a != *first;
            let (x, y) = if is_second { (other, own) } else { (own, other) };
            let probe = if is_second { *first } else { *second };
            Turn {
                rate: [ang(on_parent(*first).times(x)), ang(on_child(*second).times(y))],
                axis: if is_second { ang(on_child(a)) } else { ang(on_parent(a)) },
                about_b: is_second,
                probe: [ang(on_parent(probe)), ang(on_child(probe))],
            }
        }
        _ => {
            let probe = a.complement().0;
            Turn {
                rate: [ang(on_parent(a)), G::Ang::default()],
                axis: ang(on_parent(a)),
                about_b: false,
                probe: [ang(on_parent(probe)), ang(on_child(probe))],
            }
        }
    }
}

/// Whether a reading measures an angle (rad). Others measure lengths (m), cosines nothing.
pub fn is_angle(placed: &Placed, m: &Measure) -> bool {
    match m {
        Measure::Joint { joint, coordinate } => {
            let Some(&j) = placed.joint_numbers.get(joint) else { return false };
            let mut left = *coordinate;
            for motion in &placed.joints[j].shape.motions {
                if left < motion.velocities() {
                    return !matches!(motion, Motion::Slide(_));
                }
                left -= motion.velocities();
            }
            false
        }
        _ => false,
    }
}
