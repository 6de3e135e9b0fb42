//! The numbers of a mechanism apart from its structure, over any scalar.
//!
//! ```text
//! Described   numbers as the description gives them: the parameters
//!     │  same formulas for every scalar
//! Numbers     the zero position: points, masses, inertias in mechanism axes, from which trees and forces are made
//! ```

use crate::spec::{Coupling, GivenAs, Spec};
use crate::zero_position::{Moved, Placed};
use partita_math::scalar::Scalar;
use partita_math::spatial::{Mat3, Vec3};

/// Numbers of a body as described.
#[derive(Clone, Copy, Debug)]
pub struct DescribedBody<S> {
    /// Mass.
    pub mass: S,
    /// Centre of mass, body axes.
    pub com: Vec3<S>,
    /// Inertia about it, body axes.
    pub inertia: Mat3<S>,
}

/// Numbers by the names of their fields.
#[derive(Clone, Debug)]
pub struct Fields<S>(pub Vec<(&'static str, Vec<S>)>);

impl<S: Scalar> Fields<S> {
    fn lifted<'n, N: IntoIterator<Item = &'n mut f64>>(fields: Vec<(&'static str, N)>) -> Self {
        let lifted = |x: N| x.into_iter().map(|x| S::from_f64(*x)).collect();
        Self(fields.into_iter().map(|(name, x)| (name, lifted(x))).collect())
    }

    /// The numbers of a field; none if it is a table or a function, or left out.
    pub fn field(&self, name: &str) -> &[S] {
        self.0.iter().find(|(field, _)| *field == name).map_or(&[], |(_, x)| x)
    }

    /// The number of a field, 0 where it has none.
    pub fn number(&self, name: &str) -> S {
        self.field(name).first().copied().unwrap_or_else(S::zero)
    }

    /// The first number of the first field, if there is one.
    pub fn first(&self) -> Option<S> {
        self.0.first().and_then(|(_, x)| x.first().copied())
    }

    /// The three numbers of a field.
    pub fn vector(&self, name: &str) -> Vec3<S> {
        let x = self.field(name);
        Vec3(std::array::from_fn(|i| x.get(i).copied().unwrap_or_else(S::zero)))
    }

    /// The factors of a sum, and its value.
    pub fn sum(&self, coupling: &Coupling) -> (Vec<S>, S) {
        let Coupling::Linear { factors, offset, given_as, .. } = coupling else { return (Vec::new(), S::zero()) };
        let numbers: Vec<S> = self.0.iter().map(|(name, _)| self.number(name)).collect();
        let lifted = || factors.iter().map(|f| S::from_f64(*f)).collect();
        match given_as {
            None => (self.field("factors").to_vec(), self.number("offset")),
            Some(GivenAs::Length) => (lifted(), self.number("length")),
            Some(given_as) => {
                let made = given_as.factor(&numbers).map(|second| vec![S::one(), second]);
                (made.unwrap_or_else(lifted), S::from_f64(*offset))
            }
        }
    }
}

/// Numbers of a description that may change while its structure stays: parameters.
#[derive(Clone, Debug)]
pub struct Described<S> {
    /// Gravity, world axes.
    pub gravity: Vec3<S>,
    /// One for each body.
    pub bodies: Vec<DescribedBody<S>>,
    /// Point of each joint in the drawing, and where it is on the child in an open drawing.
    pub joints: Vec<(Vec3<S>, Option<Vec3<S>>)>,
    /// The pitch of each joint; 0 of those that have none.
    pub pitches: Vec<S>,
    /// Numbers of each coupling by field.
    pub couplings: Vec<Fields<S>>,
    /// Numbers of each rotor by field.
    pub rotors: Vec<Fields<S>>,
    /// Numbers of each force by field.
    pub forces: Vec<Fields<S>>,
    /// Numbers of each drive by field.
    pub drives: Vec<Fields<S>>,
}

impl<S: Scalar> Described<S> {
    /// The numbers of a description.
    pub fn new(spec: &Spec) -> Self {
        let vec = Vec3::<S>::from_f64;
        let bodies = spec.bodies.iter().map(|b| DescribedBody {
            mass: S::from_f64(b.mass),
            com: vec(b.com),
            inertia: Mat3::from_f64(b.inertia),
        });
        Self {
            gravity: vec(spec.gravity),
            bodies: bodies.collect(),
            joints: spec.joints.iter().map(|j| (vec(j.point), j.child_point.map(vec))).collect(),
            pitches: spec.joints.iter().map(|j| S::from_f64(j.pitch.unwrap_or(0.0))).collect(),
            couplings: spec.couplings.iter().map(|c| Fields::lifted(c.clone().numbers())).collect(),
            rotors: spec.rotors.iter().map(|r| Fields::lifted(r.clone().numbers())).collect(),
            forces: spec.forces.iter().map(|f| Fields::lifted(f.clone().record_mut().numbers())).collect(),
            drives: spec.drives.iter().map(|d| Fields::lifted(d.clone().numbers())).collect(),
        }
    }
}

/// A body in the zero position, mechanism axes.
#[derive(Clone, Copy, Debug)]
pub struct BodyNumbers<S> {
    /// Mass.
    pub mass: S,
    /// Origin of the body frame.
    pub origin: Vec3<S>,
    /// Centre of mass.
    pub com: Vec3<S>,
    /// Inertia about it.
    pub inertia: Mat3<S>,
}

/// The zero position in numbers.
#[derive(Clone, Debug)]
pub struct Numbers<S> {
    /// Gravity.
    pub gravity: Vec3<S>,
    /// Bodies.
    pub bodies: Vec<BodyNumbers<S>>,
    /// Point of each joint on its parent and on its child.
    pub joints: Vec<(Vec3<S>, Vec3<S>)>,
    /// The joint's point of each link; the ground's is 0.
    pub links: Vec<Vec3<S>>,
    /// Reference point of each link: its centre of mass, or the joint's point where it has no mass.
    pub reference: Vec<Vec3<S>>,
    /// Pitches of the joints as described.
    pub pitches: Vec<S>,
    /// Numbers of the couplings as described.
    pub couplings: Vec<Fields<S>>,
    /// Numbers of the rotors as described.
    pub rotors: Vec<Fields<S>>,
    /// Numbers of the forces as described.
    pub forces: Vec<Fields<S>>,
    /// Numbers of the drives as described.
    pub drives: Vec<Fields<S>>,
}

impl<S: Scalar> Numbers<S> {
    /// The numbers of the zero position itself, as constants.
    pub fn new(spec: &Spec, placed: &Placed) -> Self {
        let lift = |x: Vec3<f64>| Vec3::<S>::from_f64(x.0);
        let bodies = placed.bodies.iter().map(|b| BodyNumbers {
            mass: S::from_f64(b.mass),
            origin: lift(b.origin),
            com: lift(b.com),
            inertia: Mat3::from_f64(b.inertia.0),
        });
        let described = Described::new(spec);
        let new = Self {
            gravity: lift(placed.basis.apply(Vec3(spec.gravity))),
            bodies: bodies.collect(),
            joints: placed.joints.iter().map(|p| (lift(p.parent_point), lift(p.child_point))).collect(),
            links: placed.links.iter().map(|l| lift(l.point)).collect(),
            reference: Vec::new(),
            pitches: described.pitches,
            couplings: described.couplings,
            rotors: described.rotors,
            forces: described.forces,
            drives: described.drives,
        };
        new.referred(placed)
    }

    /// The zero position for other parameters, computed like that of the description, with the known rotations.
    pub fn from_parameters(spec: &Spec, placed: &Placed, given: &Described<S>) -> Self {
        let constant = |m: &Mat3<f64>| Mat3::<S>::from_f64(m.0);
        let basis = constant(&placed.basis);
        let mut motions = vec![Moved::<S>::rest(); placed.turns.len()];
        for e in &placed.topology.tree {
            let Some(j) = e.joint else { continue };
            motions[e.to] = motions[e.from];
            let (point, child_point) = given.joints[j];
            let far = child_point.unwrap_or(point);
            let joint = &spec.joints[j];
            if child_point.is_some() || joint.child_axis.is_some() || joint.child_frame.is_some() {
                let (near, far) = if e.reversed { (far, point) } else { (point, far) };
                let to = motions[e.from].point(near);
                motions[e.to] = Moved { rot: constant(&placed.turns[e.to]), from: far, to };
            }
        }
        let moved = |node: usize, x: Vec3<S>| basis.apply(motions[node].point(x));
        let bodies: Vec<BodyNumbers<S>> = placed
            .bodies
            .iter()
            .zip(&given.bodies)
            .enumerate()
            .map(|(i, (p, b))| {
                let rot = constant(&p.rot);
                let origin = moved(i + 1, Vec3::from_f64(spec.bodies[i].position));
                BodyNumbers {
                    mass: b.mass,
                    origin,
                    com: origin + rot.apply(b.com) + Vec3::from_f64(p.rounding.0),
                    inertia: rot.mul(&b.inertia).mul(&rot.transpose()),
                }
            })
            .collect();
        let joints: Vec<(Vec3<S>, Vec3<S>)> = placed
            .joints
            .iter()
            .zip(&given.joints)
            .map(|(p, (point, child))| (moved(p.parent, *point), moved(p.child, child.unwrap_or(*point))))
            .collect();
        let mut links = vec![Vec3::zero(); placed.links.len()];
        for (p, (parent_point, _)) in placed.joints.iter().zip(&joints) {
            p.links.iter().flatten().for_each(|&l| links[l] = *parent_point);
        }
        for e in placed.topology.tree.iter().filter(|e| e.joint.is_none()) {
            // a floating body floats about its centre of mass
            let mut link = placed.bodies[e.to - 1].link;
            while link != 0 {
                links[link] = bodies[e.to - 1].com;
                link = placed.links[link].parent;
            }
        }
        let gravity = basis.apply(given.gravity);
        let Described { pitches, couplings, rotors, forces, drives, .. } = given.clone();
        Self { gravity, bodies, joints, links, reference: Vec::new(), pitches, couplings, rotors, forces, drives }
            .referred(placed)
    }

    /// With the reference points for a zero position, whose masses determine which links are massive, which depends on
    /// structure.
    pub(crate) fn referred(mut self, placed: &Placed) -> Self {
        let numbers = &mut self;
        let mut massive = vec![0.0; placed.links.len()];
        let mut mass = vec![S::zero(); placed.links.len()];
        let mut first = vec![Vec3::<S>::zero(); placed.links.len()];
        let mut begun: Vec<Option<Vec3<S>>> = vec![None; placed.links.len()];
        for (p, b) in placed.bodies.iter().zip(&numbers.bodies) {
            massive[p.link] += p.mass;
            mass[p.link] += b.mass;
            // relative to the first one: where all coincide, so does their mean
            let from = *begun[p.link].get_or_insert(b.com);
            first[p.link] += (b.com - from).times(b.mass);
        }
        numbers.reference = (0..mass.len())
            .map(|i| match i {
                0 => Vec3::zero(),
                _ => match begun[i] {
                    Some(from) if massive[i] > 0.0 => from + first[i].times(S::one() / mass[i]),
                    _ => numbers.links[i],
                },
            })
            .collect();
        self
    }

    /// Position of a point given in the axes of a node's body; on the ground it is given in the world.
    pub(crate) fn point_on(&self, placed: &Placed, node: usize, p: Vec3<S>) -> Vec3<S> {
        if node == 0 {
            return Mat3::from_f64(placed.basis.0).apply(p);
        }
        self.bodies[node - 1].origin + Mat3::from_f64(placed.bodies[node - 1].rot.0).apply(p)
    }
}
