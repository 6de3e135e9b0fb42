//! One applied force as an output: its loads, its effort along a joint, its energy and its power.

use crate::error::DescriptionError;
use crate::evaluator::{Evaluator, Scratch};
use crate::force::{AppliedWrench, At, Effort, Element, ForceApplication, LoadLaw};
use crate::joint::Motion;
use crate::model::{Model, ModelScratch};
use crate::part::Part;
use crate::spec::Force;
use crate::value::Source;
use partita_math::scalar::Scalar;
use partita_math::spatial::{Spatial, Vec3};
use partita_system::SystemError;

/// The wrench of an applied force at one instant, world axes.
#[derive(Clone, Debug, Default)]
pub struct Shown<S = f64> {
    /// Power of all that acts.
    pub power: S,
    /// Its potential, 0 if it has none.
    pub potential: S,
    /// Effort along a coordinate of a joint; none for a force between points.
    pub effort: Option<S>,
    /// On each body that it acts on: point, force, and moment about that point.
    pub wrenches: Vec<[Vec3<S>; 3]>,
    /// Magnitudes of friction that may stick: while it slips, and while it sticks; none for another force.
    pub levels: Option<[S; 2]>,
}

impl<S: Scalar> Evaluator<S> {
    /// Applied force `e` of the model at (t, q, v), after [`look_at`](Self::look_at) its part.
    ///
    /// # Errors
    /// Errors of user functions.
    pub fn shown(&self, e: usize, t: S, q: &[S], v: &[S], s: &mut Scratch<S>) -> Result<Shown<S>, SystemError> {
        if self.full.elements[e].follows_reactions() {
            self.reaction_friction_at(t, q, v, s)?;
        }
        let mut memory = std::mem::take(&mut s.full_forces);
        let (seen_q, seen_v) = self.full.seen(&self.instant(t, q, v), &s.full, &mut memory);
        let (all_q, all_v) = if self.full.sees_tree_alone() { (q, v) } else { (&seen_q[..], &seen_v[..]) };
        let at = At { tree: &self.full, s: &s.full, instant: self.seen_instant(t, all_q, all_v) };
        let element = &self.full.elements[e];
        let levels = match element {
            Element::Load(load) => load.friction_levels(&at, &mut memory),
            _ => Ok(None),
        };
        let found = levels.and_then(|levels| Ok((levels, element.wrench(&at, &mut memory)?)));
        let found = found.map(|(levels, effect)| {
            let effort = element.effort(&at, &effect);
            let mut shown = Shown { potential: effect.potential, effort, levels, ..Shown::default() };
            let mut push = |p: &AppliedWrench<Spatial<S>>| {
                let x = &s.full.links[p.link];
                shown.power += p.force.dot(x.u + x.w.cross(p.arm)) + p.moment.dot(x.w);
                let point = self.full.reference_point(p.link, &s.full) + p.arm;
                shown.wrenches.push([point, p.force, p.moment].map(|x| self.outward(x)));
            };
            match &effect.application {
                ForceApplication::Along(i, effort) => shown.power += *effort * v[*i],
                ForceApplication::On(p) => push(p),
                ForceApplication::Between(a, b) => [a, b].into_iter().for_each(push),
                ForceApplication::Listed => memory.wrenches.iter().for_each(push),
            }
            shown
        });
        (memory.q, memory.v) = (seen_q, seen_v);
        s.full_forces = memory;
        found
    }

    /// From mechanism axes to those of the world.
    fn outward(&self, x: Vec3<S>) -> Vec3<S> {
        Vec3([0, 1, 2].map(|i| Vec3::<S>::from_f64(self.placed.basis.column(i).0).dot(x)))
    }
}

/// A constant effort along a coordinate that is not one of the state: of a joint that closes a loop, or of any joint in
/// absolute coordinates. Inside a run it does work, because the coordinate is known up to whole turns there; at outputs,
/// where these are counted, it has the potential that it has along coordinates of the state.
#[derive(Clone, Copy, Debug)]
pub struct CountedEffort {
    /// The effort.
    pub effort: f64,
    /// Number of the joint.
    pub joint: usize,
    /// Which of its coordinates.
    pub coordinate: usize,
}

impl Model {
    /// Force number `i` of the description, if it is such an effort.
    pub fn counted_effort(&self, i: usize) -> Option<CountedEffort> {
        let (Force::Torque(torque), Ok((e, _))) = (self.spec.forces.get(i)?, self.load_number(i)) else { return None };
        let Element::Load(load) = &self.own.full.elements[e] else { return None };
        let LoadLaw::Effort(Effort { value: Source::Constant(effort), in_state: false }) = load.law else {
            return None;
        };
        let (joint, coordinate) = (*self.own.placed.joint_numbers.get(&torque.joint)?, torque.coordinate);
        // angular velocities of a spatial rotation are no rates of coordinates
        let scalars = self.own.placed.joints[joint].shape.motions.iter().take_while(|m| **m != Motion::Ball).count();
        (coordinate < scalars).then_some(CountedEffort { effort, joint, coordinate })
    }

    /// Index among the elements of force number `i` of the description, and number of bodies it acts on: springs
    /// between points come first.
    ///
    /// # Errors
    /// If there is no such force.
    pub fn load_number(&self, i: usize) -> Result<(usize, usize), DescriptionError> {
        let spring = |f: &Force| matches!(f, Force::Spring(_));
        let (forces, elements) = (&self.spec.forces, &self.own.full.elements);
        if i >= forces.len() || elements.len() != forces.len() {
            let message = format!("there is no force {i}; there are {}, numbered from 0", forces.len());
            return Err(DescriptionError::new("mechanism", &self.spec.name, message));
        }
        let before = forces[..i].iter().filter(|f| spring(f) == spring(&forces[i])).count();
        let springs = forces.iter().filter(|f| spring(f)).count();
        let e = if spring(&forces[i]) { before } else { springs + before };
        Ok((e, elements[e].nodes().len()))
    }

    /// Acceleration of the origin and angular acceleration of body `i` for v', after [`look_at`](Evaluator::look_at)
    /// its part; world axes.
    pub fn body_acceleration(&self, i: usize, part: &Part, vdot: &[f64], s: &ModelScratch) -> [Vec3<f64>; 2] {
        let b = &self.own.placed.bodies[i];
        let (x, (turned, moved)) =
            (&s.evaluated().full.links[b.link], self.own.link_acceleration(part, b.link, vdot, s.evaluated()));
        let arm = self.own.arm_now(s.evaluated(), b.link, self.own.numbers.bodies[i].origin);
        let alpha = x.alpha + turned;
        let acc = x.acc + moved + alpha.cross(arm) + x.w.cross(x.w.cross(arm));
        [acc, alpha].map(|x| self.own.placed.basis.apply_transposed(x))
    }
}
