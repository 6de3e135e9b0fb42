//! Observations of a state: poses and motions of bodies and joints.

use crate::error::DescriptionError;
use crate::evaluator::Engine;
use crate::joint::{self, Motion};
use crate::measurement::{Maker, Measurement};
use crate::model::{Model, ModelScratch};
use crate::tree::{Tree, TreeScratch};
use partita_math::spatial::{Mat3, Quaternion, Space, Spatial, Vec3};

/// One body at one instant, world axes.
#[derive(Clone, Copy, Debug)]
pub struct BodyState {
    /// Origin of the body frame.
    pub position: Vec3<f64>,
    /// Body axes (columns).
    pub rotation: Mat3<f64>,
    /// Velocity of the origin.
    pub velocity: Vec3<f64>,
    /// Angular velocity.
    pub angular_velocity: Vec3<f64>,
}

/// One joint at one instant.
#[derive(Clone, Debug, Default)]
pub struct JointState {
    /// Coordinates.
    pub position: Vec<f64>,
    /// Velocities.
    pub velocity: Vec<f64>,
    /// The joint's point on the child, world axes.
    pub point: [f64; 3],
}

/// A degree of freedom of a joint, in the tree or not: its measurement, and the velocities that change it.
#[derive(Clone, Debug)]
pub struct DegreeOfFreedom<G: Space<S = f64> = Spatial<f64>> {
    reading: Measurement<G>,
    velocities: Vec<usize>,
    /// Memory for its row.
    row: Vec<f64>,
}

impl<G: Space<S = f64>> DegreeOfFreedom<G> {
    pub(crate) fn new(mut reading: Measurement<G>, model: &Model) -> Self {
        let mut velocities = Vec::new();
        for m in &mut reading.movers {
            let link = &model.own.placed.links[m.link];
            m.column = velocities.len();
            velocities.extend(link.v..link.v + link.motion.velocities());
        }
        let row = vec![0.0; velocities.len()];
        Self { reading, velocities, row }
    }

    /// Whether it is read from poses and twists.
    pub(crate) fn needs_look(&self) -> bool {
        self.reading.velocity().is_none()
    }

    /// Whether it is known up to whole turns only.
    pub(crate) fn wraps(&self) -> bool {
        self.reading.wraps
    }

    /// Its value, rate and acceleration at (q, v, v') and the last poses and twists: C v' + b, C and b of its reading.
    pub(crate) fn course(
        &mut self,
        tree: &Tree<G>,
        s: &TreeScratch<G>,
        (q, v, vdot): (&[f64], &[f64], &[f64]),
    ) -> [f64; 3] {
        let read = self.reading.read(tree, s, q, v);
        self.row.fill(0.0);
        self.reading.columns(1.0, tree, s, &mut self.row);
        let turned: f64 = self.row.iter().zip(&self.velocities).map(|(c, &v)| c * vdot[v]).sum();
        [read.value, read.rate, turned + self.reading.bias(tree, s)]
    }
}

impl DegreeOfFreedom {
    /// Its acceleration for v' after [`look`](crate::evaluator::Evaluator::look): `C v' + b`, C and b of its reading.
    pub fn acceleration(&mut self, model: &Model, vdot: &[f64], s: &ModelScratch) -> f64 {
        self.row.fill(0.0);
        self.reading.columns(1.0, &model.own.full, &s.evaluated().full, &mut self.row);
        let turned: f64 = self.row.iter().zip(&self.velocities).map(|(c, &v)| c * vdot[v]).sum();
        turned + self.reading.bias(&model.own.full, &s.evaluated().full)
    }
}

impl Model {
    /// The degrees of freedom of the joints `which` side by side, each in the order of its velocities.
    ///
    /// # Errors
    /// None for a model that could be compiled.
    pub fn degrees_of_freedom_of(&self, which: &[usize]) -> Result<Vec<DegreeOfFreedom>, DescriptionError> {
        let measurements = Maker::<Spatial<f64>>::new(&self.spec, &self.own.placed, &self.own.numbers, &self.own.full)?;
        let mut found = Vec::new();
        for &j in which {
            let p = &self.own.placed.joints[j];
            for (i, motion) in p.shape.motions.iter().enumerate() {
                match motion {
                    Motion::Ball => found.extend((0..3).map(|c| DegreeOfFreedom::new(measurements.spin(p, c), self))),
                    _ => found.push(DegreeOfFreedom::new(measurements.coordinate(j, i), self)),
                }
            }
        }
        Ok(found)
    }

    /// Body `i` after [`look`](crate::evaluator::Evaluator::look).
    pub fn body_state(&self, i: usize, s: &ModelScratch) -> BodyState {
        let b = &self.own.placed.bodies[i];
        let x = &s.evaluated().full.links[b.link];
        let arm = self.own.arm_now(s.evaluated(), b.link, self.own.numbers.bodies[i].origin);
        let out = self.own.placed.basis.transpose();
        BodyState {
            position: out.apply(self.own.full.reference_point(b.link, &s.evaluated().full) + arm),
            rotation: out.mul(&x.rot).mul(&b.rot),
            velocity: out.apply(x.u + x.w.cross(arm)),
            angular_velocity: out.apply(x.w),
        }
    }

    /// Joint `j` after [`look`](crate::evaluator::Evaluator::look). Angles of a joint that closes a spatial loop are in
    /// (−π, π].
    pub fn joint_state(&self, j: usize, q: &[f64], v: &[f64], s: &ModelScratch) -> JointState {
        let p = &self.own.placed.joints[j];
        let (child, parent) =
            (self.own.node_state(s.evaluated(), p.child), self.own.node_state(s.evaluated(), p.parent));
        let arm_c = self.own.arm_now(s.evaluated(), self.own.placed.link_of(p.child), self.own.numbers.joints[j].1);
        let point = child.centre + arm_c;
        let mut state = JointState { point: self.own.placed.basis.apply_transposed(point).0, ..JointState::default() };
        match &p.links {
            Some(links) => {
                for (m, &link) in p.shape.motions.iter().zip(links) {
                    let l = &self.own.placed.links[link];
                    if *m == Motion::Ball {
                        let mut turn = Quaternion([q[l.q], q[l.q + 1], q[l.q + 2], q[l.q + 3]]);
                        let mut w = Vec3([v[l.v], v[l.v + 1], v[l.v + 2]]);
                        if p.reversed {
                            w = -turn.matrix().apply(w);
                            turn = Quaternion([turn.0[0], -turn.0[1], -turn.0[2], -turn.0[3]]);
                        }
                        // from the axes of the zero position to those of the drawing, where a rough drawing was rotated
                        let [real, x, y, z] = turn.0;
                        let [x, y, z] = p.on_child.apply_transposed(Vec3([x, y, z])).0;
                        state.position.extend([real, x, y, z]);
                        state.velocity.extend(p.on_child.apply_transposed(w).0);
                    } else {
                        state.position.push(q[l.q]);
                        state.velocity.push(v[l.v]);
                    }
                }
            }
            None => {
                let arm_p =
                    self.own.arm_now(s.evaluated(), self.own.placed.link_of(p.parent), self.own.numbers.joints[j].0);
                // child and parent as they carry the axes of the drawing
                let rp = parent.rot.mul(&p.on_parent);
                let rc = child.rot.mul(&p.on_child);
                let r = rp.transpose().mul(&rc);
                let gap = rp.apply_transposed(point - parent.centre - arm_p);
                joint::position_of(&p.shape.motions, &r, gap, &mut state.position);
                if let (Engine::Planar(_), Some(planar)) = (&self.own.engine, &s.evaluated().planar) {
                    // in the plane angles are not wrapped
                    let (lp, lc) = (self.own.placed.link_of(p.parent), self.own.placed.link_of(p.child));
                    let full = planar.links[lc].rot.angle - planar.links[lp].rot.angle;
                    for (x, m) in state.position.iter_mut().zip(&p.shape.motions) {
                        if let Motion::Turn(a) = m {
                            *x = full * p.on_parent.apply(*a).0[2].signum();
                        }
                    }
                }
                let w = rp.apply_transposed(child.w - parent.w);
                let rate = child.u + child.w.cross(arm_c) - parent.u - parent.w.cross(point - parent.centre);
                let rate = rp.apply_transposed(rate);
                joint::rate_of(&p.shape.motions, &r, &state.position, w, rate, &mut state.velocity);
            }
        }
        state
    }

    /// Joint axes as the parent carries them, world axes.
    pub fn joint_frame(&self, j: usize, s: &ModelScratch) -> Mat3<f64> {
        let p = &self.own.placed.joints[j];
        let r = self.own.node_state(s.evaluated(), p.parent).rot.mul(&p.on_parent).mul(&p.shape.frame);
        self.own.placed.basis.transpose().mul(&r)
    }
}

/// Counts the turns of joints that close loops in space from one output to the next.
///
/// Their angles are measured from the pose and so are known up to full turns; of the candidates the one nearest to the
/// prediction by the mean of the two speeds is taken. That is safe while outputs are closer than about half a turn of
/// unforeseen motion. In the plane, and for joints in the tree, angles are never wrapped and nothing is counted. A
/// quaternion and its negative are one rotation; the one next to the previous is taken.
#[derive(Clone, Debug)]
pub struct TurnCounter {
    turns: Vec<Vec<bool>>,
    /// Index of the quaternion of each joint, if it is measured from the pose.
    quaternions: Vec<Option<usize>>,
    last: Vec<Option<(f64, JointState)>>,
}

impl TurnCounter {
    /// For the joints of a model.
    pub fn new(model: &Model) -> Self {
        let turns = model
            .own
            .placed
            .joints
            .iter()
            .map(|p| {
                let wrapped = p.links.is_none() && !model.is_planar();
                let plain = p.shape.motions.iter().all(|m| *m != Motion::Ball);
                p.shape.motions.iter().map(|m| wrapped && plain && matches!(m, Motion::Turn(_))).collect()
            })
            .collect();
        let quaternions = model
            .own
            .placed
            .joints
            .iter()
            .map(|p| {
                let read = p.links.is_none() && p.shape.motions.contains(&Motion::Ball);
                // translations come before it
                read.then_some(p.shape.dof().saturating_sub(3))
            })
            .collect();
        Self { turns, quaternions, last: vec![None; model.own.placed.joints.len()] }
    }

    /// Whether the rotation of joint `j` has more than one valid value.
    pub fn counts(&self, j: usize) -> bool {
        self.turns[j].contains(&true) || self.quaternions[j].is_some()
    }

    /// Add full turns to the angles of joint `j` at `t`; calls are in order of time.
    pub fn unwrap(&mut self, j: usize, t: f64, state: &mut JointState) {
        if !self.counts(j) {
            return;
        }
        if let (Some((_, last)), Some(first)) = (&self.last[j], self.quaternions[j]) {
            let turned: f64 = last.position[first..].iter().zip(&state.position[first..]).map(|(a, b)| a * b).sum();
            if turned < 0.0 {
                state.position[first..].iter_mut().for_each(|x| *x = -*x);
            }
        }
        if let Some((before, last)) = &self.last[j] {
            for i in (0..self.turns[j].len()).filter(|&i| self.turns[j][i]) {
                let expected = last.position[i] + 0.5 * (last.velocity[i] + state.velocity[i]) * (t - before);
                let turn = 2.0 * std::f64::consts::PI;
                state.position[i] += ((expected - state.position[i]) / turn).round() * turn;
            }
        }
        self.last[j] = Some((t, state.clone()));
    }
}
