//! From the drawing to the zero position of the tree: the parent of each body, and all poses for zero coordinates.
//!
//! In a closed drawing that is the drawing itself. In an open one (a joint that sits elsewhere on its child) the child
//! and all it carries are moved so that the tree joint fits.

use crate::coincident;
use crate::error::DescriptionError;
use crate::joint::{self, alignment, Motion, Shape};
use crate::lengths::{body_length, typical_length};
use crate::planarity;
use crate::spec::LARGEST_TOLERANCE;
use crate::spec::{Coupling, Cut, Force, Joint, Measure, Spec};
use crate::topology::{Edge, Topology, TreeEdge, CUT};
use crate::validate;
use partita_math::scalar::Scalar;
use partita_math::spatial::{Mat3, Vec3};
use partita_math::tolerance;
use std::collections::{HashMap, HashSet};

/// Type of coordinates of the tree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Coordinates {
    /// Joint coordinates along a spanning tree; some joints are cut.
    #[default]
    Relative,
    /// Every body floats, every joint is cut.
    Absolute,
}

/// A rigid motion of the drawing: `x → to + rot (x - from)`. A joint drawn at the point `from` is at `to` to the last
/// digit: points that coincide in the drawing coincide here, and a body between two joints in one point has no arm of
/// rounding errors.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moved<S> {
    pub rot: Mat3<S>,
    pub from: Vec3<S>,
    pub to: Vec3<S>,
}

impl<S: Scalar> Moved<S> {
    /// The drawing itself.
    pub fn rest() -> Self {
        Self { rot: Mat3::identity(), from: Vec3::zero(), to: Vec3::zero() }
    }

    pub fn point(&self, x: Vec3<S>) -> Vec3<S> {
        self.to + self.rot.apply(x - self.from)
    }
}

/// A body in the zero position, mechanism axes.
#[derive(Clone, Debug)]
pub struct PlacedBody {
    /// The link that carries it; 0 is the ground.
    pub link: usize,
    /// Origin of the body frame.
    pub origin: Vec3<f64>,
    /// Body axes.
    pub rot: Mat3<f64>,
    /// Centre of mass.
    pub com: Vec3<f64>,
    /// Inertia about it.
    pub inertia: Mat3<f64>,
    /// Displacement added to it so that it is at the point of a joint, to the last digit.
    pub rounding: Vec3<f64>,
    /// Mass.
    pub mass: f64,
}

/// A link in the zero position.
#[derive(Clone, Debug)]
pub struct PlacedLink {
    /// Link it moves on.
    pub parent: usize,
    /// Motion, mechanism axes.
    pub motion: Motion,
    /// The joint's point.
    pub point: Vec3<f64>,
    /// First coordinate.
    pub q: usize,
    /// First velocity.
    pub v: usize,
}

/// A joint in the zero position.
#[derive(Clone, Debug)]
pub struct PlacedJoint {
    /// Shape in the axes of the drawing.
    pub shape: Shape,
    /// Axes of the drawing, as the parent carries them, in mechanism axes.
    pub on_parent: Mat3<f64>,
    /// As `on_parent`, on the child.
    pub on_child: Mat3<f64>,
    /// Its point on the parent.
    pub parent_point: Vec3<f64>,
    /// Its point on the child.
    pub child_point: Vec3<f64>,
    /// Node of the parent (0 ground, body i is i + 1).
    pub parent: usize,
    /// Node of the child.
    pub child: usize,
    /// Its links in the order of its motions, if it is in the tree; empty for a fixed joint.
    pub links: Option<Vec<usize>>,
    /// Whether it is traversed from child to parent.
    pub reversed: bool,
    /// Whether it acts no longer, because an event parted it.
    pub apart: bool,
}

impl PlacedJoint {
    /// Its links, if its coordinates are those of the state, side by side: not of a joint that closes a loop, nor of
    /// one with several degrees of freedom that is traversed from child to parent.
    pub fn in_state(&self) -> Option<&[usize]> {
        self.links.as_deref().filter(|links| !(links.is_empty() || self.reversed && self.shape.dof() > 1))
    }
}

/// Where the rotation of a rotor stands in the state.
#[derive(Clone, Copy, Debug)]
pub struct PlacedRotor {
    /// Velocity that moves it.
    pub v: usize,
    /// Its own link, where its joint closes a loop: its rotation is then a coordinate, coupled to that of the joint.
    pub link: Option<usize>,
}

/// Mass and inertia that a link lacks in a metric.
#[derive(Clone, Debug)]
pub struct Massless {
    /// Link.
    pub link: usize,
    /// Mass.
    pub mass: f64,
    /// Inertia about its reference point, mechanism axes in the zero position.
    pub inertia: Mat3<f64>,
}

/// A body whose spin is held.
#[derive(Clone, Debug)]
pub struct HeldSpin {
    /// The body, by number.
    pub body: usize,
    /// The line it would spin about, mechanism axes in the zero position; none: any line.
    pub line: Option<Vec3<f64>>,
    /// Inertia that holds it, about the centre of mass, mechanism axes in the zero position.
    pub inertia: Mat3<f64>,
}

/// The zero position.
#[derive(Clone, Debug)]
pub struct Placed {
    /// Mechanism axes from world axes (rows): the identity, unless a planar mechanism lies in a tilted plane.
    pub basis: Mat3<f64>,
    /// Whether all motions lie in one plane.
    pub planar: bool,
    /// Bodies.
    pub bodies: Vec<PlacedBody>,
    /// Links; entry 0 is the ground.
    pub links: Vec<PlacedLink>,
    /// Joints.
    pub joints: Vec<PlacedJoint>,
    /// Rotors.
    pub rotors: Vec<PlacedRotor>,
    /// Rotation of each node from the drawing.
    pub turns: Vec<Mat3<f64>>,
    /// Number of each joint by its name.
    pub joint_numbers: HashMap<String, usize>,
    /// Tree and cuts.
    pub topology: Topology,
    /// The tree along which joints transmit loads that no row of C contains: that of the coordinates; for a planar
    /// mechanism in absolute coordinates one of its joints, each of which keeps its bodies in the plane.
    pub carrying: Vec<TreeEdge>,
    /// Coordinates.
    pub nq: usize,
    /// Velocities.
    pub nv: usize,
    /// Names of the coordinates.
    pub coordinate_names: Vec<String>,
    /// Names of the velocities.
    pub velocity_names: Vec<String>,
    /// Extent of the whole drawing.
    pub size: f64,
    /// Characteristic length: the extent of a typical body, however many of them there are.
    pub length: f64,
    /// What links without mass or inertia lack in a metric.
    pub massless: Vec<Massless>,
    /// Rods between balls whose spin is held.
    pub held: Vec<HeldSpin>,
}

/// Names of the joints that are driven, coupled or loaded along a coordinate, or move a rotor.
fn loaded(spec: &Spec) -> HashSet<&str> {
    let measures = spec.drives.iter().map(|d| &d.measure).chain(spec.couplings.iter().flat_map(Coupling::terms));
    // an angle in the tree counts its turns
    let by_forces = spec.forces.iter().flat_map(Force::joints);
    let by_rotors = spec.rotors.iter().map(|r| r.joint.as_str());
    measures.filter_map(Measure::of_joint).chain(by_forces).chain(by_rotors).collect()
}

fn edges(spec: &Spec, shapes: &[Shape]) -> Result<Vec<Edge>, DescriptionError> {
    let (nodes, loaded) = (validate::nodes(spec)?, loaded(spec));
    Ok(spec
        .joints
        .iter()
        .zip(shapes)
        .map(|(j, shape)| Edge {
            parent: nodes[j.parent.as_str()],
            child: nodes[j.child.as_str()],
            class: match j.cut {
                // the tree must not depend on whether a joint is apart
                _ if shape.is_always_cut() || spec.parting.contains_key(&j.name) => CUT,
                Cut::Always => 2,
                Cut::Never => 0,
                Cut::Auto if loaded.contains(j.name.as_str()) => 0,
                Cut::Auto => 1,
            },
            dof: shape.dof(),
        })
        .collect())
}

/// The plane of the mechanism, if all its motions lie in one: rows of the basis.
fn plane(motions: &[Motion], shapes: &[(&Shape, Mat3<f64>)]) -> Option<Mat3<f64>> {
    let parallel = |a: Vec3<f64>, b: Vec3<f64>| a.cross(b).norm() < tolerance::PARALLEL;
    let turn = |m: &Motion| if let Motion::Turn(a) = m { Some(*a) } else { None };
    let mut normal = motions.iter().find_map(turn);
    if normal.is_none() {
        // translations alone: any plane that contains them all (two directions at the most)
        let slides: Vec<Vec3<f64>> =
            motions.iter().filter_map(|m| if let Motion::Slide(a) = m { Some(*a) } else { None }).collect();
        let first = *slides.first()?;
        let across = slides.iter().map(|a| first.cross(*a)).max_by(|x, y| x.norm().total_cmp(&y.norm()))?;
        normal = Some(match across.norm() {
            sine if sine < tolerance::PARALLEL => first.complement().0,
            // guides that were intended to be parallel define no plane
            sine if sine < tolerance::INTENDED_PARALLEL * LARGEST_TOLERANCE => return None,
            _ => across.unit()?,
        });
    }
    let n = normal?;
    let inside = |m: &Motion, r: &Mat3<f64>| match m {
        Motion::Turn(a) => parallel(r.apply(*a), n),
        Motion::Slide(a) => r.apply(*a).dot(n).abs() < tolerance::PARALLEL,
        Motion::Ball => false,
    };
    let identity = Mat3::identity();
    if !motions.iter().all(|m| inside(m, &identity)) {
        return None;
    }
    // a closing joint may be a ball: in the plane it is a pin
    let fits = |(s, r): &(&Shape, Mat3<f64>)| s.motions.iter().all(|m| *m == Motion::Ball || inside(m, r));
    if !shapes.iter().all(fits) {
        return None;
    }
    let n = Vec3(n.0.map(|x| if x.abs() < tolerance::ROUNDING { 0.0 } else { x }));
    if n.0[0] == 0.0 && n.0[1] == 0.0 {
        return Some(Mat3::identity());
    }
    let (e1, e2) = n.complement();
    Some(Mat3([e1.0, e2.0, n.0]))
}

/// All readings besides coordinates of the joints themselves.
fn measures(spec: &Spec) -> impl Iterator<Item = &Measure> {
    let over = spec.forces.iter().filter_map(|f| match f {
        Force::Torque(x) => x.over.as_ref(),
        _ => None,
    });
    spec.couplings.iter().flat_map(Coupling::terms).chain(spec.drives.iter().map(|d| &d.measure)).chain(over)
}

impl Placed {
    /// Coordinate and velocity in the tree of a coordinate of joint `j`; none for a spatial rotation or a joint that is
    /// cut.
    pub fn coordinate(&self, j: usize, coordinate: usize) -> Option<(usize, usize)> {
        let p = &self.joints[j];
        let each = p.shape.motions.iter().zip(p.links.as_ref()?);
        let (motion, link) = each.flat_map(|x| std::iter::repeat_n(x, x.0.velocities())).nth(coordinate)?;
        let link = &self.links[*link];
        (*motion != Motion::Ball).then_some((link.q, link.v))
    }

    /// Build the zero position of a validated description.
    pub fn new(spec: &Spec, coordinates: Coordinates, allow_plane: bool) -> Result<Self, DescriptionError> {
        let shapes: Vec<Shape> = joint::shapes(spec)?;
        let edges = edges(spec, &shapes)?;
        let count = spec.bodies.len() + 1;
        let topology = match coordinates {
            Coordinates::Relative => Topology::new(count, &edges),
            Coordinates::Absolute => Topology {
                tree: (1..count).map(|to| TreeEdge { joint: None, from: 0, to, reversed: false }).collect(),
                cuts: (0..edges.len()).collect(),
            },
        };
        let moved = Self::zero_position(spec, &edges, &topology, count)?;
        let free = joint::shape(&floating(spec, 1), &Mat3::identity())?;

        // motions in world axes, to see whether they share a plane
        let mut motions = Vec::new();
        for e in &topology.tree {
            if let Some(j) = e.joint {
                motions.extend(shapes[j].motions.iter().map(|m| turned(m, &moved[edges[j].parent].rot)));
            }
        }
        // a body that no chain of joints links to the ground can leave any plane, whatever the coordinates
        let of_joints = Topology::new(count, &edges).tree;
        let floats = of_joints.iter().any(|e| e.joint.is_none());
        let closers: Vec<(&Shape, Mat3<f64>)> =
            topology.cuts.iter().map(|&j| (&shapes[j], moved[edges[j].parent].rot)).collect();
        let absolute = coordinates == Coordinates::Absolute;
        if absolute {
            motions.extend(closers.iter().flat_map(|(s, r)| s.motions.iter().map(|m| turned(m, r))));
        }
        let size = typical_length(spec);
        let rolls = |c: &Coupling| matches!(c, Coupling::Roll { .. });
        // the plane keeps one component of a rotating axis, and no axis of a cosine
        let cosine = |m: &Measure| matches!(m, Measure::Cosine { .. });
        let numbers: HashMap<String, usize> = spec.joints.iter().map(|j| j.name.clone()).zip(0..).collect();
        let spatial = shapes.iter().any(Shape::is_always_cut)
            || spec.couplings.iter().any(rolls)
            || measures(spec).any(cosine)
            || spec.drives.iter().any(|d| match &d.measure {
                Measure::Joint { joint, coordinate } => {
                    numbers.get(joint).is_some_and(|&j| shapes[j].motion_of(*coordinate) == Some(Motion::Ball))
                }
                _ => false,
            });
        let mut plane = if !allow_plane || floats || spatial { None } else { plane(&motions, &closers) };
        if let Some(basis) = plane {
            // closures must be satisfied out of the plane too; if they are not, the spatial rows report it
            let fits = topology.cuts.iter().all(|&j| {
                let (p, c) = closing_points(&spec.joints[j], &edges[j], &moved);
                let of_normal = alignment(&spec.joints[j]).map(|x| basis.mul(&x).mul(&basis.transpose()).column(2));
                let in_plane =
                    of_normal.is_ok_and(|n| n.0[0].abs().max(n.0[1].abs()) < tolerance::PARALLEL && n.0[2] > 0.0);
                (basis.apply(c - p).0[2]).abs() < tolerance::EQUAL * size && in_plane
            });
            let planar = (0..count)
                .all(|i| (basis.mul(&moved[i].rot).mul(&basis.transpose()).0[2][2] - 1.0).abs() < tolerance::PARALLEL);
            // a displacement along an axis that leaves the plane would lose a part
            let along = measures(spec).all(|m| match m {
                Measure::Along { body1, axis, .. } => {
                    let body = spec.bodies.iter().position(|b| b.name == *body1);
                    let turned = body.map_or(Vec3(*axis), |i| {
                        moved[i + 1].rot.mul(&Mat3(spec.bodies[i].orientation)).apply(Vec3(*axis))
                    });
                    let axis = basis.apply(turned);
                    axis.0[2].abs() <= tolerance::PARALLEL * axis.norm()
                }
                _ => true,
            });
            let motion = |joint: &str, i: usize| numbers.get(joint).and_then(|&j| shapes[j].motion_of(i));
            let pressed = planarity::needs_space(spec, basis.0[2], motion);
            if !fits || !planar || !along || pressed {
                plane = None;
            }
        }
        let basis = plane.unwrap_or_else(Mat3::identity);

        let mut placed = Self {
            basis,
            planar: plane.is_some(),
            bodies: Vec::with_capacity(count - 1),
            links: vec![PlacedLink { parent: 0, motion: Motion::Ball, point: Vec3::zero(), q: 0, v: 0 }],
            joints: Vec::with_capacity(shapes.len()),
            rotors: Vec::new(),
            turns: moved.iter().map(|m| m.rot).collect(),
            joint_numbers: spec.joints.iter().enumerate().map(|(i, j)| (j.name.clone(), i)).collect(),
            carrying: if absolute && plane.is_some() { of_joints } else { topology.tree.clone() },
            topology,
            nq: 0,
            nv: 0,
            coordinate_names: Vec::new(),
            velocity_names: Vec::new(),
            size,
            length: body_length(spec).unwrap_or(size),
            massless: Vec::new(),
            held: Vec::new(),
        };
        for ((j, edge), shape) in spec.joints.iter().zip(&edges).zip(&shapes) {
            let (p, c) = closing_points(j, edge, &moved);
            placed.joints.push(PlacedJoint {
                shape: shape.clone(),
                on_parent: basis.mul(&moved[edge.parent].rot),
                on_child: basis.mul(&moved[edge.child].rot).mul(&alignment(j)?.transpose()),
                parent_point: basis.apply(p),
                child_point: basis.apply(c),
                parent: edge.parent,
                child: edge.child,
                links: None,
                reversed: false,
                apart: spec.is_apart(j),
            });
        }
        for (b, m) in spec.bodies.iter().zip(&moved[1..]) {
            let rot = basis.mul(&m.rot).mul(&Mat3(b.orientation));
            let origin = basis.apply(m.point(Vec3(b.position)));
            placed.bodies.push(PlacedBody {
                link: 0,
                origin,
                rot,
                com: origin + rot.apply(Vec3(b.com)),
                rounding: Vec3::zero(),
                inertia: rot.mul(&Mat3(b.inertia)).mul(&rot.transpose()),
                mass: b.mass,
            });
        }
        placed.unite_centres();
        placed.grow_links(spec, &free);
        Ok(placed)
    }

    /// A centre of mass at the point of a joint up to rounding is moved there: its weight has no arm.
    fn unite_centres(&mut self) {
        let near = coincident::near(self.joints.iter().flat_map(|p| [p.parent_point.0, p.child_point.0]));
        for p in &self.joints {
            for (node, point) in [(p.parent, p.parent_point), (p.child, p.child_point)] {
                let Some(body) = node.checked_sub(1).map(|i| &mut self.bodies[i]) else { continue };
                let off = point - body.com;
                if off.0.iter().any(|x| *x != 0.0) && off.0.iter().all(|x| x.abs() <= near) {
                    (body.com, body.rounding) = (point, body.rounding + off);
                }
            }
        }
    }

    /// New pose of each node, by which the tree joints fit.
    fn zero_position(
        spec: &Spec,
        edges: &[Edge],
        topology: &Topology,
        count: usize,
    ) -> Result<Vec<Moved<f64>>, DescriptionError> {
        let mut moved = vec![Moved::rest(); count];
        for e in &topology.tree {
            let Some(j) = e.joint else { continue };
            let joint = &spec.joints[j];
            assert!(edges[j].parent == e.from || edges[j].child == e.from);
            let align = alignment(joint)?;
            let child_point = joint.child_point.unwrap_or(joint.point);
            let (align, near, far) = if e.reversed {
                (align.transpose(), child_point, joint.point)
            } else {
                (align, joint.point, child_point)
            };
            if joint.child_point.is_none() && joint.child_axis.is_none() && joint.child_frame.is_none() {
                moved[e.to] = moved[e.from];
                continue;
            }
            let rot = moved[e.from].rot.mul(&align);
            moved[e.to] = Moved { rot, from: Vec3(far), to: moved[e.from].point(Vec3(near)) };
        }
        Ok(moved)
    }

    fn grow_links(&mut self, spec: &Spec, free: &Shape) {
        let mut rides = vec![0usize; spec.bodies.len() + 1];
        let planar = [
            Motion::Slide(Vec3([1.0, 0.0, 0.0])),
            Motion::Slide(Vec3([0.0, 1.0, 0.0])),
            Motion::Turn(Vec3([0.0, 0.0, 1.0])),
        ];
        for e in self.topology.tree.clone() {
            let (motions, names, point, prefix) = match e.joint {
                Some(j) => {
                    let p = &self.joints[j];
                    // in the zero position the joint's axes are the same on both sides
                    let motions: Vec<Motion> = p.shape.motions.iter().map(|m| turned(m, &p.on_parent)).collect();
                    (motions, p.shape.names.clone(), p.parent_point, spec.joints[j].name.clone())
                }
                None => {
                    let com = self.bodies[e.to - 1].com;
                    let name = spec.bodies[e.to - 1].name.clone();
                    if self.planar {
                        (planar.to_vec(), vec!["x", "y", "turn"], com, name)
                    } else {
                        (free.motions.clone(), free.names.clone(), com, name)
                    }
                }
            };
            let mut order: Vec<usize> = (0..motions.len()).collect();
            if e.reversed {
                order.reverse();
            }
            let mut link = rides[e.from];
            let mut of_motion = vec![0; motions.len()];
            for &i in &order {
                let motion = if e.reversed { backwards(&motions[i]) } else { motions[i] };
                self.links.push(PlacedLink { parent: link, motion, point, q: self.nq, v: self.nv });
                link = self.links.len() - 1;
                of_motion[i] = link;
                self.nq += motion.coordinates();
                self.nv += motion.velocities();
                let single = motions.len() == 1 && e.joint.is_some() && motion != Motion::Ball;
                let name = if single { prefix.clone() } else { format!("{prefix}.{}", names[i]) };
                if motion == Motion::Ball {
                    self.coordinate_names.extend(["qw", "qx", "qy", "qz"].map(|a| format!("{prefix}.{a}")));
                    self.velocity_names.extend(["wx", "wy", "wz"].map(|a| format!("{prefix}.{a}")));
                } else {
                    self.coordinate_names.push(name.clone());
                    self.velocity_names.push(name);
                }
            }
            rides[e.to] = link;
            self.bodies[e.to - 1].link = link;
            if let Some(j) = e.joint {
                self.joints[j].links = Some(of_motion);
                self.joints[j].reversed = e.reversed;
            }
        }
    }

    /// The joints that are cut and act, by their numbers.
    pub fn closings(&self) -> impl Iterator<Item = usize> + '_ {
        self.topology.cuts.iter().copied().filter(|&j| !self.joints[j].apart)
    }

    /// Link of a node.
    pub fn link_of(&self, node: usize) -> usize {
        if node == 0 {
            0
        } else {
            self.bodies[node - 1].link
        }
    }
}

/// A free joint for a floating body.
fn floating(spec: &Spec, node: usize) -> Joint {
    let name = spec.bodies.get(node - 1).map_or("", |b| &b.name);
    Joint::new(name, crate::spec::JointKind::Free, validate::GROUND, name, [0.0; 3])
}

fn closing_points(joint: &Joint, edge: &Edge, moved: &[Moved<f64>]) -> (Vec3<f64>, Vec3<f64>) {
    let on_child = joint.child_point.unwrap_or(joint.point);
    (moved[edge.parent].point(Vec3(joint.point)), moved[edge.child].point(Vec3(on_child)))
}

fn turned(m: &Motion, r: &Mat3<f64>) -> Motion {
    match m {
        Motion::Turn(a) => Motion::Turn(r.apply(*a)),
        Motion::Slide(a) => Motion::Slide(r.apply(*a)),
        Motion::Ball => Motion::Ball,
    }
}

fn backwards(m: &Motion) -> Motion {
    match m {
        Motion::Turn(a) => Motion::Turn(-*a),
        Motion::Slide(a) => Motion::Slide(-*a),
        Motion::Ball => Motion::Ball,
    }
}
