//! The forces of a description as elements.

use super::loads;
use super::{
    CutEffort, CutSight, CutTorsion, Effort, EffortOver, Element, Place, PointForce, Reading, Seen, Spring, Torsion,
    Unit,
};
use crate::compile;
use crate::error::DescriptionError;
use crate::joint::Motion;
use crate::measurement;
use crate::numbers::{DescribedForce, Numbers};
use crate::spec::{Axes, Force, Spec, Table, Value};
use crate::tree::Tree;
use crate::validate;
use crate::value::{Source, VectorSource};
use crate::zero_position::{Placed, PlacedJoint};
use partita_math::scalar::Scalar;
use partita_math::spatial::{Mat3, Space, Vec3};

/// What the elements are made from.
struct Maker<'a, S> {
    placed: &'a Placed,
    numbers: &'a Numbers<S>,
    origins: Vec<Vec3<S>>,
}

impl<G: Space> Element<G> {
    /// What functions of the state see besides the coordinates of the tree: those of joints that close loops.
    pub(crate) fn sights(
        placed: &Placed,
        numbers: &Numbers<G::S>,
        elements: &[Self],
    ) -> Result<Vec<CutSight<G>>, DescriptionError> {
        if !elements.iter().any(Self::sees_state) {
            return Ok(Vec::new());
        }
        let mut names: Vec<(&String, usize)> = placed.joint_numbers.iter().map(|(name, j)| (name, *j)).collect();
        names.sort_unstable_by_key(|(_, j)| *j);
        let mut sights = Vec::new();
        for (name, _) in names {
            sights.extend(CutSight::all(placed, numbers, name)?);
        }
        Ok(sights)
    }

    /// What sensors look at, if there are functions of the state to see it.
    pub(crate) fn sensed(
        spec: &Spec,
        placed: &Placed,
        numbers: &Numbers<G::S>,
        elements: &[Self],
    ) -> Result<Vec<Seen<G>>, DescriptionError> {
        if spec.sights.is_empty() || !elements.iter().any(Self::sees_state) {
            return Ok(Vec::new());
        }
        loads::sensed(spec, &validate::nodes(spec)?, placed, numbers)
    }

    /// All forces of a description, springs between points first.
    pub fn all(
        spec: &Spec,
        placed: &Placed,
        numbers: &Numbers<G::S>,
        tree: &Tree<G>,
    ) -> Result<Vec<Self>, DescriptionError> {
        let nodes = validate::nodes(spec)?;
        let maker = Maker { placed, numbers, origins: compile::origins(placed, numbers) };
        let mut elements = Vec::with_capacity(spec.forces.len());
        for (f, n) in spec.forces.iter().zip(&numbers.forces) {
            if let Force::Spring { body1, body2, damping, .. } = f {
                let ends = [nodes[body1.as_str()], nodes[body2.as_str()]];
                elements.push(Self::Spring(maker.spring(ends, n, *damping != 0.0)));
            }
        }
        for (f, n) in spec.forces.iter().zip(&numbers.forces) {
            match f {
                Force::Spring { .. } => {}
                Force::TorsionSpring { name, joint, coordinate, damping, .. }
                    if placed.joints[joint_index(placed, joint)].links.is_none() =>
                {
                    let along = Reading::new(placed, numbers, name, (joint, *coordinate), n.rest)?;
                    elements.push(Self::CutTorsion(Box::new(CutTorsion {
                        name: name.clone(),
                        along,
                        stiffness: n.stiffness,
                        damping: n.damping,
                        angle: n.rest,
                        damped: *damping != 0.0,
                    })));
                }
                Force::TorsionSpring { name, joint, coordinate, damping, .. } => {
                    let (q, v) = tree_coordinate(placed, "force", name, joint, *coordinate)?;
                    let q = q.ok_or_else(|| {
                        DescriptionError::new("force", name, "a turn in space has no single angle to spring back to; put springs between points of the bodies")
                    })?;
                    let (stiffness, damped) = (n.stiffness, *damping != 0.0);
                    elements.push(Self::Torsion(Torsion {
                        q,
                        v,
                        stiffness,
                        damping: n.damping,
                        angle: n.rest,
                        damped,
                    }));
                }
                Force::Torque { name, joint, coordinate, value: Value::Table(curve), over: Some(over), periodic } => {
                    let along = Reading::new(placed, numbers, name, (joint, *coordinate), G::S::zero())?;
                    let over =
                        measurement::Maker::<G>::new(spec, placed, numbers, tree)?.reading(over, "force", name)?;
                    let (name, curve, periodic) = (name.clone(), curve.clone(), *periodic);
                    let turns = over.wraps && over.adds_up.is_empty() && !(periodic && each_turn(&curve));
                    elements.push(Self::EffortOver(Box::new(EffortOver { name, along, over, curve, periodic, turns })));
                }
                Force::Torque { name, joint, coordinate, value, .. } => {
                    elements.push(maker.torque(name, joint, *coordinate, value, n)?);
                }
                Force::Force { name, body, value, axes, .. } => {
                    let node = nodes[body.as_str()];
                    if node == 0 {
                        return Err(DescriptionError::new(
                            "force",
                            name,
                            "the ground does not feel a force; name a body",
                        ));
                    }
                    let turns = *axes == Axes::Body;
                    let axes = if turns { placed.bodies[node - 1].rot } else { placed.basis };
                    let point = numbers.point_on(placed, node, n.points[0]);
                    elements.push(Self::Force(PointForce {
                        name: name.clone(),
                        on: maker.place::<G>(node, point),
                        value: VectorSource::new(value, n.value),
                        axes: Mat3::from_f64(axes.0),
                        turns,
                    }));
                }
                other => {
                    let Some(load) = loads::element(spec, &nodes, placed, numbers, other, n)? else { continue };
                    elements.push(load);
                }
            }
        }
        let followers = elements.iter_mut().filter_map(|e| match e {
            Self::Friction(x) => x.follows.as_mut(),
            _ => None,
        });
        followers.enumerate().for_each(|(i, bearing)| bearing.place = i);
        Ok(elements)
    }
}

impl<S: Scalar> Maker<'_, S> {
    /// A point of the zero position on a node's link.
    fn place<G: Space<S = S>>(&self, node: usize, point: Vec3<S>) -> Place<G> {
        let link = self.placed.link_of(node);
        Place { node, link, at: G::vec_in(point - self.numbers.reference[link]) }
    }

    fn spring<G: Space<S = S>>(&self, nodes: [usize; 2], n: &DescribedForce<S>, damped: bool) -> Spring<G> {
        let end = |i: usize| {
            let (node, point) = (nodes[i], self.numbers.point_on(self.placed, nodes[i], n.points[i]));
            if self.placed.link_of(node) == 0 {
                // on the ground the point is the origin itself
                return (Place { node, link: 0, at: G::Vec::default() }, point, point);
            }
            (self.place::<G>(node, point), self.origins[self.placed.link_of(node)], point)
        };
        let ((a, origin_a, pa), (b, origin_b, pb)) = (end(0), end(1));
        let grounded = |e: &Place<G>, point| if e.link == 0 { G::vec_in(point) } else { G::Vec::default() };
        let out_of_plane = G::out_of_space(pb - pa);
        Spring {
            grounded: [grounded(&a, pa), grounded(&b, pb)],
            a,
            b,
            offset: G::vec_in(origin_b - origin_a),
            out_of_plane2: out_of_plane * out_of_plane,
            stiffness: n.stiffness,
            damping: n.damping,
            length: n.rest,
            damped,
        }
    }

    fn torque<G: Space<S = S>>(
        &self,
        name: &str,
        joint: &str,
        coordinate: usize,
        value: &Value,
        n: &DescribedForce<S>,
    ) -> Result<Element<G>, DescriptionError> {
        let placed = self.placed;
        let j = joint_index(placed, joint);
        let p = &placed.joints[j];
        let mut which = coordinate;
        let found = p.shape.motions.iter().find(|m| {
            let found = which < m.velocities();
            which -= if found { 0 } else { m.velocities() };
            found
        });
        let motion = *found.ok_or_else(|| {
            let m = format!(
                "joint \"{joint}\" has {} coordinates, number {coordinate} was asked for (the first is 0)",
                p.shape.freedoms()
            );
            DescriptionError::new("force", name, m)
        })?;
        let value = Source::new(value, n.value.0[0]);
        let in_space = motion == Motion::Ball;
        // the velocities of a ball are not the joint's own where it is walked from child to parent, nor where the zero
        // position has turned what is drawn
        let own = !p.reversed && p.on_child.0 == placed.basis.0;
        if p.links.is_some() && (own || !in_space) {
            let (q, v) = tree_coordinate(placed, "force", name, joint, coordinate)?;
            return Ok(Element::Effort(Effort { name: name.into(), q, v, value }));
        }
        Ok(Element::CutEffort(CutEffort {
            name: name.into(),
            parent: Place { node: p.parent, link: placed.link_of(p.parent), at: G::Vec::default() },
            child: self.place::<G>(p.child, self.numbers.joints[j].1),
            unit: unit(p, motion, which),
            value,
        }))
    }
}

/// The wrench that does work on a motion of a joint alone, of which the coordinate is number `which`.
pub(super) fn unit<G: Space>(p: &PlacedJoint, motion: Motion, which: usize) -> Unit<G> {
    let moment = |x: Vec3<f64>, y: Vec3<f64>| Unit::Moment(G::ang_from(x.0), G::ang_from(y.0));
    let turns: Vec<Vec3<f64>> =
        p.shape.motions.iter().filter_map(|m| if let Motion::Turn(a) = m { Some(*a) } else { None }).collect();
    match (motion, turns.as_slice()) {
        (Motion::Slide(a), _) => Unit::Force(G::vec_from(p.on_parent.apply(a).0)),
        (Motion::Turn(a), [first, second]) => {
            // the moment between the axes, one fixed on the parent and one on the child, that does work on one only
            let c = first.dot(*second);
            let (own, other) = (1.0 / (1.0 - c * c), -c / (1.0 - c * c));
            let (x, y) = if a == *first { (own, other) } else { (other, own) };
            moment(p.on_parent.apply(*first).times(x), p.on_child.apply(*second).times(y))
        }
        (Motion::Turn(a), _) => moment(p.on_parent.apply(a), Vec3::zero()),
        // turns in space are counted in the child's axes
        (Motion::Ball, _) => moment(Vec3::zero(), p.on_child.column(which)),
    }
}

/// Is a periodic curve the same after a whole turn?
fn each_turn(curve: &Table) -> bool {
    let (Some(first), Some(last)) = (curve.breaks.first(), curve.breaks.last()) else { return true };
    let times = 2.0 * std::f64::consts::PI / (last - first);
    times >= 0.5 && (times - times.round()).abs() <= 1e-9 * times
}

/// Index of a joint that exists.
pub fn joint_index(placed: &Placed, name: &str) -> usize {
    placed.joint_numbers.get(name).copied().unwrap_or(0)
}

/// Coordinate (if any) and velocity of a joint's coordinate in the tree.
pub fn tree_coordinate(
    placed: &Placed,
    element: &'static str,
    name: &str,
    joint: &str,
    coordinate: usize,
) -> Result<(Option<usize>, usize), DescriptionError> {
    let p = &placed.joints[joint_index(placed, joint)];
    let Some(links) = &p.links else {
        let m = match placed.joints.iter().any(|p| p.links.is_some()) {
            true => format!(
                "joint \"{joint}\" closes a loop in which every joint is driven, sprung or loaded, so it has no \
                 coordinate; replace one of them by a spring between points"
            ),
            false => format!(
                "joint \"{joint}\" has no coordinate in absolute coordinates, where only bodies have; use relative ones"
            ),
        };
        return Err(DescriptionError::new(element, name, m));
    };
    let mut left = coordinate;
    for (motion, &link) in p.shape.motions.iter().zip(links) {
        if left < motion.velocities() {
            let l = &placed.links[link];
            let ball = *motion == Motion::Ball;
            return Ok(((!ball).then_some(l.q), l.v + left));
        }
        left -= motion.velocities();
    }
    let m = format!(
        "joint \"{joint}\" has {} coordinates, number {coordinate} was asked for (the first is 0)",
        p.shape.freedoms()
    );
    Err(DescriptionError::new(element, name, m))
}
