//! The forces of a description as elements.

use super::{AttachmentPoint, CutSight, Element, LawInput, LoadLaw, PointForce, Spring};
use crate::error::DescriptionError;
use crate::measurement;
use crate::numbers::{Fields, Numbers};
use crate::spec::{self, Axes, Force, Spec};
use crate::tree::Tree;
use crate::value::VectorSource;
use crate::zero_position::Placed;
use partita_math::sorting::sort_by_key;
use partita_math::spatial::{Mat3, Space, Vec3};

/// Data from which the elements are made.
pub(crate) struct Maker<'a, G: Space> {
    pub(super) spec: &'a Spec,
    pub(super) placed: &'a Placed,
    pub(super) numbers: &'a Numbers<G::S>,
    pub(super) measurements: measurement::Maker<'a, G>,
}

impl<'a, G: Space> Maker<'a, G> {
    /// For the links of a tree.
    pub fn new(
        spec: &'a Spec,
        placed: &'a Placed,
        numbers: &'a Numbers<G::S>,
        tree: &'a Tree<G>,
    ) -> Result<Self, DescriptionError> {
        Ok(Self { spec, placed, numbers, measurements: measurement::Maker::new(spec, placed, numbers, tree)? })
    }

    /// What functions of the state read besides the coordinates of the tree: those of joints that close loops.
    pub fn sights(&self, sees_state: bool) -> Result<Vec<CutSight<G>>, DescriptionError> {
        if !sees_state {
            return Ok(Vec::new());
        }
        let mut names: Vec<(&String, usize)> = self.placed.joint_numbers.iter().map(|(name, j)| (name, *j)).collect();
        sort_by_key(&mut names, |(_, j)| *j);
        let mut sights = Vec::new();
        for (name, j) in names {
            sights.extend(CutSight::all(&self.placed.joints[j], name, &self.measurements)?);
        }
        Ok(sights)
    }

    /// What sensors read, if there are functions of the state.
    pub fn sensed(&self, sees_state: bool) -> Result<Vec<LawInput<G>>, DescriptionError> {
        if self.spec.sights.is_empty() || !sees_state {
            return Ok(Vec::new());
        }
        self.sights_of_sensors()
    }

    /// All forces of the description, springs between points first.
    pub fn elements(&self) -> Result<Vec<Element<G>>, DescriptionError> {
        let described = self.spec.forces.iter().zip(&self.numbers.forces);
        let (first, others): (Vec<_>, Vec<_>) = described.partition(|(f, _)| matches!(f, Force::Spring(_)));
        let mut elements = Vec::with_capacity(self.spec.forces.len());
        for (f, n) in first.into_iter().chain(others) {
            elements.push(self.element(f, n)?);
        }
        let followers = elements.iter_mut().filter_map(|e| match e {
            Element::Load(x) => match &mut x.law {
                LoadLaw::Friction(x) => x.follows.as_mut(),
                _ => None,
            },
            _ => None,
        });
        followers.enumerate().for_each(|(i, bearing)| bearing.index = i);
        Ok(elements)
    }

    /// A force at a point of a body.
    pub(super) fn point_force(&self, x: &spec::PointForce, n: &Fields<G::S>) -> Result<Element<G>, DescriptionError> {
        let (name, node) = (&x.name, self.node(&x.body));
        if node == 0 {
            return Err(DescriptionError::new("force", name, "a force on the ground has no effect; name a body"));
        }
        let turns = x.axes == Axes::Body;
        let axes = if turns { self.placed.bodies[node - 1].rot } else { self.placed.basis };
        let on = self.attachment(node, self.numbers.point_on(self.placed, node, n.vector("point")));
        let value = VectorSource::new(&x.value, n.field("value"));
        Ok(Element::Force(PointForce { name: name.clone(), on, value, axes: Mat3::from_f64(axes.0), turns }))
    }

    /// Number of a body, 0 for the ground.
    pub(super) fn node(&self, body: &str) -> usize {
        self.measurements.nodes[body]
    }

    /// A point of the zero position on a node's link.
    pub(super) fn attachment(&self, node: usize, point: Vec3<G::S>) -> AttachmentPoint<G> {
        let link = self.placed.link_of(node);
        AttachmentPoint { node, link, at: G::vec_in(point - self.numbers.reference[link]) }
    }

    pub(super) fn spring(&self, nodes: [usize; 2], n: &Fields<G::S>, damped: bool) -> Spring<G> {
        let end = |i: usize| {
            let (node, point) =
                (nodes[i], self.numbers.point_on(self.placed, nodes[i], n.vector(["point1", "point2"][i])));
            if self.placed.link_of(node) == 0 {
                // on the ground the point is the origin itself
                return (AttachmentPoint { node, link: 0, at: G::Vec::default() }, point, point);
            }
            (self.attachment(node, point), self.measurements.origins[self.placed.link_of(node)], point)
        };
        let ((a, origin_a, pa), (b, origin_b, pb)) = (end(0), end(1));
        let grounded = |e: &AttachmentPoint<G>, point| if e.link == 0 { G::vec_in(point) } else { G::Vec::default() };
        let out_of_plane = G::out_of_space(pb - pa);
        Spring {
            grounded: [grounded(&a, pa), grounded(&b, pb)],
            a,
            b,
            offset: G::vec_in(origin_b - origin_a),
            out_of_plane2: out_of_plane * out_of_plane,
            stiffness: n.number("stiffness"),
            damping: n.number("damping"),
            length: n.number("length"),
            damped,
        }
    }
}
