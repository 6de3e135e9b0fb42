//! Frictions whose magnitude follows the reaction of their own joint, which in turn depends on the friction.
//!
//! ```text
//! M v' = h + Σ_j b_j f_j + Cᵀ λ,   C v' + b = 0,   f_i = −κ_i N_i(v', λ)                       (G2)
//! ```
//! v' and λ, and with them every reaction, are affine in the efforts f. So one elimination with a right-hand side for
//! each friction gives the effect of a unit of each, and the small system [`magnitudes`](crate::friction_magnitudes)
//! determines the rest. All this is part of the applied forces: the result is h(q, v, t), and formulations need no
//! change.
//!
//! Cost: one dense factor of M and one of the rows of C for each evaluation, n³/6 + n²m/2 + nm²/2 + m³/6 for n velocities and
//! m rows, whatever the formulation.

mod respond;

use crate::error::DescriptionError;
use crate::evaluator::{Engine, Evaluator, Follow, Scratch};
use crate::force::{Bearing, Element, Friction, Load, LoadLaw};
use crate::joint::Motion;
use crate::planarity::needs_space;
use crate::spec::{Force, Spec};
use crate::zero_position::{Placed, PlacedJoint};
use partita_math::elimination::Pattern;
use partita_math::spatial::{Space, Vec3};
use partita_math::tolerance;
use partita_system::SystemError;
use std::sync::Arc;

/// Where the reaction of a joint is evaluated.
#[derive(Clone, Copy, Debug)]
enum Read {
    /// The load that the joint of the tree transmits to this link; the link whose own motion the coordinate is.
    Tree { outer: usize, moved: usize },
    /// The multipliers of this loop closure; the link that carries the axis, and the axis in its axes.
    Cut { closing: usize, link: usize, axis: Vec3<f64> },
}

/// One reaction-dependent friction.
#[derive(Clone, Debug)]
struct ReactionFriction {
    /// Index among the elements.
    element: usize,
    /// Names of the friction and of its joint.
    name: String,
    joint: String,
    /// The joint, and the link of its child, which its point is on.
    number: usize,
    child: usize,
    read: Read,
    turn: bool,
    /// Links of the joint's motions in the tree, where it has several, and whether they turn: what acts along these is no
    /// reaction.
    free: Vec<(bool, usize)>,
}

/// All reaction-dependent frictions of a mechanism.
#[derive(Clone, Debug)]
pub(crate) struct Following {
    frictions: Vec<ReactionFriction>,
    /// Of C.
    pattern: Pattern,
    /// Largest closure error of each row under a large displacement, where it is known.
    row_displacement: Vec<Option<f64>>,
    /// Squared sines below this are zero: rows that depend on each other.
    dependent: f64,
    /// Whether M itself is singular.
    short_of_mass: bool,
}

impl Following {
    /// Reaction-dependent frictions of a mechanism, if there are any.
    pub(crate) fn new(
        own: &Evaluator<f64>,
        spec: &Spec,
        (pattern, row_displacement): (&Pattern, &[Option<f64>]),
    ) -> Result<Option<Self>, DescriptionError> {
        let placed = &own.placed;
        let mut frictions = Vec::new();
        for (element, e) in own.full.elements.iter().enumerate() {
            let Some(Followed { load, .. }) = Followed::of(e) else { continue };
            let described = spec.forces.iter().find_map(|f| match f {
                Force::Friction(x) if x.name == load.name => Some(x),
                _ => None,
            });
            let Some(x) = described else { continue };
            let Some(&number) = placed.joint_numbers.get(&x.joint) else { continue };
            let p = &placed.joints[number];
            let fail = |m: String| DescriptionError::new("force", &x.name, m);
            if p.shape.own.is_some() || p.shape.rows() == 0 {
                return Err(fail(format!(
                    "joint \"{}\" has no normal force from which friction could follow (a screw, a \
                     constant-velocity or a free joint); give the friction magnitude itself (dynamic=)",
                    x.joint
                )));
            }
            let Some(read) = read(own, placed, p, number, x.coordinate) else { continue };
            let turn = p.shape.turns(x.coordinate);
            if turn && x.follows.as_ref().is_some_and(|f| f.radius.is_none()) {
                return Err(fail(format!(
                    "joint \"{}\" rotates there: a coefficient needs the radius (m) at which it slides",
                    x.joint
                )));
            }
            let child = placed.link_of(p.child);
            frictions.push(ReactionFriction {
                element,
                name: x.name.clone(),
                joint: x.joint.clone(),
                number,
                child,
                read,
                turn,
                free: free_links(p),
            });
        }
        let motion =
            |joint: &str, i: usize| placed.joint_numbers.get(joint).and_then(|&j| placed.joints[j].shape.motion_of(i));
        if placed.planar && needs_space(spec, placed.basis.0[2], motion) {
            let message =
                "with these numbers a friction depends on a reaction out of the plane of the mechanism; build the \
                 mechanism with them";
            return Err(DescriptionError::new("mechanism", &spec.name, message));
        }
        let dependent = tolerance::DEPENDENT.max(tolerance::CLEARLY * spec.drawing_tolerance).powi(2);
        let short_of_mass = !placed.massless.is_empty();
        let (pattern, row_displacement) = (pattern.clone(), row_displacement.to_vec());
        Ok((!frictions.is_empty()).then_some(Self { frictions, pattern, row_displacement, dependent, short_of_mass }))
    }
}

/// The normal forces of frictions at (t, q, v).
pub(crate) type NormalForces = dyn Fn(f64, &[f64], &[f64]) -> Result<Vec<f64>, SystemError> + Send + Sync;

/// Those of a mechanism whose reactions are those of another one in the same coordinates, with other rows and forces.
pub(crate) struct Elsewhere {
    /// Of the mechanism.
    own: Following,
    /// By the other one.
    normal: Arc<NormalForces>,
}

impl Elsewhere {
    pub(crate) fn new(own: Following, normal: Arc<NormalForces>) -> Self {
        Self { own, normal }
    }
}

impl Follow<f64> for Elsewhere {
    fn count(&self) -> usize {
        self.own.count()
    }

    fn add(
        &self,
        model: &Evaluator<f64>,
        (t, q, v): (f64, &[f64], &[f64]),
        s: &mut Scratch<f64>,
    ) -> Result<(), SystemError> {
        let normal = (self.normal)(t, q, v)?;
        let at = model.instant(t, q, v);
        match (&model.engine, &mut s.planar) {
            (Engine::Planar(tree), Some(x)) => {
                self.own.add_given(tree, &at, x, &mut s.planar_forces, &normal);
                s.full_forces.normal_forces = normal;
            }
            _ => self.own.add_given(&model.full, &at, &mut s.full, &mut s.full_forces, &normal),
        }
        Ok(())
    }
}

/// A reaction-dependent friction, and its motion.
struct Followed<'a, G: Space> {
    load: &'a Load<G>,
    law: &'a Friction<G::S>,
    bearing: &'a Bearing<G::S>,
}

impl<'a, G: Space> Followed<'a, G> {
    /// The element, if it is one.
    fn of(e: &'a Element<G>) -> Option<Self> {
        let Element::Load(load) = e else { return None };
        let LoadLaw::Friction(law) = &load.law else { return None };
        law.follows.as_ref().map(|bearing| Self { load, law, bearing })
    }
}

/// Where the reaction of a joint and its axis are evaluated.
fn read(own: &Evaluator<f64>, placed: &Placed, p: &PlacedJoint, number: usize, coordinate: usize) -> Option<Read> {
    if let Some(links) = &p.links {
        let outer = placed.link_of(if p.reversed { p.parent } else { p.child });
        return Some(Read::Tree { outer, moved: *links.get(coordinate)? });
    }
    let closing = match &own.engine {
        Engine::Planar(tree) => tree.closings.iter().position(|k| k.joint == number),
        Engine::Full => own.full.closings.iter().position(|k| k.joint == number),
    }?;
    let mut turns = p.shape.motions.iter().filter_map(|m| if let Motion::Turn(a) = m { Some(*a) } else { None });
    let first = turns.next();
    let (link, axis) = match p.shape.motion_of(coordinate)? {
        // the second of two rotations is about an axis of the child
        Motion::Turn(a) if turns.next() == Some(a) && first != Some(a) => {
            (placed.link_of(p.child), p.on_child.apply(a))
        }
        Motion::Turn(a) | Motion::Slide(a) => (placed.link_of(p.parent), p.on_parent.apply(a)),
        Motion::Ball => return None,
    };
    Some(Read::Cut { closing, link, axis })
}

/// Links of the motions of a joint in the tree, if there are several, and whether they turn.
fn free_links(p: &PlacedJoint) -> Vec<(bool, usize)> {
    let several = p.links.iter().filter(|links| links.len() > 1);
    let each = several.flat_map(|links| p.shape.motions.iter().zip(links));
    each.map(|(motion, &link)| (!matches!(motion, Motion::Slide(_)), link)).collect()
}

impl Follow<f64> for Following {
    fn count(&self) -> usize {
        self.frictions.len()
    }

    fn add(
        &self,
        model: &Evaluator<f64>,
        (t, q, v): (f64, &[f64], &[f64]),
        s: &mut Scratch<f64>,
    ) -> Result<(), SystemError> {
        let mut hold = std::mem::take(&mut s.hold);
        let at = model.instant(t, q, v);
        let found = match (&model.engine, &mut s.planar) {
            (Engine::Planar(tree), Some(x)) => {
                let found = self.magnitudes(model, tree, &at, x, &mut s.planar_forces, &mut hold);
                s.full_forces.normal_forces.clone_from(&s.planar_forces.normal_forces);
                found
            }
            _ => self.magnitudes(model, &model.full, &at, &mut s.full, &mut s.full_forces, &mut hold),
        };
        s.hold = hold;
        found
    }
}
