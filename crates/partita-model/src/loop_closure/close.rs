//! Following the plan: positions, branches and pivots for given inputs.                                      (37)

use super::arm::{lift, nearest_turn, rotated, turn_of, PlanarArm, Pose};
use super::graph::{Home, Kind};
use super::implicit::Field;
use super::planar::{PlanarJoint, Shortfall};
use super::polygon::{turn_in, Polygon};
use super::{spatial, Graph, LoopClosing, Step, Work};
use crate::evaluator::Engine;
use crate::tree::{Closing as CutJoint, LinkMotion};
use crate::value;
use partita_math::scalar::Scalar;
use partita_math::spatial::{Planar, Quaternion};
use partita_system::closing::{Block, BlockState, Closing};
use partita_system::SystemError;
use std::f64::consts::TAU;

/// Joints of a polygon in a plane, and their coordinates.
type JointCoordinates<'a> = (&'a [PlanarJoint], [f64; 3]);

impl Step {
    /// Sides of a polygon in a plane, for the coordinates known so far.
    fn place_sides(&mut self, g: &Graph, pose: &Pose<f64>) {
        let Work::Plane(p, plane) = &self.work else { return };
        for k in (0..plane.joints.len()).filter(|&k| self.moving[k]) {
            self.sides[k] = match &self.chains[k] {
                Some(chain) => chain.at(&pose.x),
                None => planar_side(p, k, g, pose),
            };
        }
    }

    /// Joints and coordinates of a polygon in a plane with the present sides; none for another step.
    fn plane(&mut self, tolerance: f64) -> Option<Result<JointCoordinates<'_>, Shortfall>> {
        let Work::Plane(_, plane) = &self.work else { return None };
        let sides = &self.sides[..plane.joints.len()];
        let (x, pivot, fit) = plane.solve(sides, self.signs[0], tolerance);
        self.pivots[0] = pivot;
        Some(match fit.check() {
            Ok(()) if (x[0] + x[1] + x[2]).is_finite() => Ok((&plane.joints, x)),
            Err(short) if sides.iter().all(|s| s.turn.is_finite() && s.length.is_finite()) => Err(short),
            _ => Err(Shortfall(f64::NAN)),
        })
    }
}

impl LoopClosing<'_> {
    /// Edge coordinates of the tree from q.
    pub(super) fn read(&mut self, q: &[f64]) {
        (0..self.graph.edges.len()).for_each(|i| self.pose.read(&self.graph, i, q));
    }

    /// Coordinates of the edges of one step from q, as far as they belong to the tree.
    fn read_step(&mut self, step: usize, q: &[f64]) {
        self.steps[step].edges.iter().for_each(|&i| self.pose.read(&self.graph, i, q));
    }

    /// Largest distance of the coordinates of a step from those in q, in radians and sizes; those of cut joints are no
    /// part of q.
    fn apart_from(&self, step: usize, q: &[f64]) -> f64 {
        let mut apart = 0.0f64;
        for &i in &self.steps[step].edges {
            let e = &self.graph.edges[i];
            let Home::Tree { q: at, .. } = e.home else { continue };
            apart = apart.max(match e.kind {
                Kind::Turn => {
                    let d = self.pose.x[i] - q[at];
                    (d - (d / TAU).round() * TAU).abs()
                }
                Kind::Slide => (self.pose.x[i] - q[at]).abs() / self.model.own.placed.length,
                Kind::Ball => {
                    let r = Quaternion([q[at], q[at + 1], q[at + 2], q[at + 3]]).normalised().matrix();
                    (0..9).fold(0.0, |m: f64, c| m.max((self.pose.balls[i].0[c / 3][c % 3] - r.0[c / 3][c % 3]).abs()))
                }
                Kind::Rigid => 0.0,
            });
        }
        apart
    }

    /// Choose the signs of a step by the values in q; returns their ambiguity, and whether the coordinates of its edges
    /// are known: those of the kept signs are, of others not yet.
    fn choose_signs(&mut self, step: usize, q: &[f64]) -> (f64, bool) {
        let kept = self.steps[step].signs;
        let free = kept.iter().filter(|s| **s != 0).count();
        let mut best = (f64::INFINITY, kept);
        let mut next = f64::INFINITY;
        self.steps[step].place_sides(&self.graph, &self.pose);
        // the kept signs last: they win a tie, and are mostly those chosen
        for choice in (0..1u8 << free).rev() {
            let sign = |i: usize| if choice >> i & 1 == 0 { kept[i] } else { -kept[i] };
            self.steps[step].signs = [sign(0), sign(1)];
            let apart = match self.solve_placed(step) {
                Ok(()) => self.apart_from(step, q),
                Err(_) => f64::INFINITY,
            };
            if apart <= best.0 {
                next = best.0;
                best = (apart, self.steps[step].signs);
            } else {
                next = next.min(apart);
            }
            if choice > 0 {
                self.read_step(step, q);
            }
        }
        let known = best.1 == kept && best.0.is_finite();
        if !known {
            self.steps[step].signs = best.1;
            self.read_step(step, q);
        }
        let ambiguity = if next.is_finite() && next > 0.0 { best.0 / next } else { 0.0 };
        (ambiguity, known)
    }

    /// States of the blocks from the steps.
    fn update_states(&mut self) {
        for (state, &(step, k)) in self.states.iter_mut().zip(&self.entries) {
            let step = &self.steps[step];
            *state = BlockState { branch: step.signs[k], pivot: step.pivots[k] };
        }
    }

    /// One step; the coordinates of its edges are written to `x` and `balls`, and to q where they belong to it.
    pub(super) fn advance(&mut self, i: usize, t: f64, q: &mut [f64]) -> Result<(), SystemError> {
        self.steps[i].place_sides(&self.graph, &self.pose);
        match self.steps[i].plane(self.tolerance) {
            Some(Ok((joints, x))) => {
                for (j, mut x) in joints.iter().zip(x) {
                    if let Some(at) = j.q {
                        if j.turns {
                            x = nearest_turn(x, q[at]);
                        }
                        q[at] = x;
                    }
                    self.pose.x[j.edge] = x;
                }
                return Ok(());
            }
            Some(Err(x)) => return Err(self.shortfall(i, t, x)),
            None => {}
        }
        match &self.steps[i].work {
            Work::Drive(d, edge) => {
                let drive = &self.model.own.drives[*d];
                let memory = &mut self.scratch.equations().memory;
                let [p, _, _] = value::motion_at(&drive.motion, &self.model.own.callers, t, &drive.name, memory)?;
                self.pose.x[*edge] = p;
                if let Some((i, _)) = drive.tree {
                    q[i] = p;
                }
                return Ok(());
            }
            Work::Law(law) => {
                let x = law.value(&self.model.own, q)?;
                if !x.is_finite() {
                    return Err(SystemError::NotFinite { what: self.steps[i].words.clone(), t });
                }
                (self.pose.x[law.edge], q[law.coordinate()]) = (x, x);
                return Ok(());
            }
            Work::Implicit(block) => {
                let mut field = Field {
                    model: &self.model,
                    scratch: &mut self.scratch,
                    phi: &mut self.phi,
                    c: &mut self.c,
                    a: &mut self.a,
                    dv: &mut self.dv,
                    memory: &mut self.newton,
                    iterations: &mut self.iterations,
                };
                let pivot = block.solve(&mut field, t, q, &self.steps[i].words)?;
                self.steps[i].pivots[0] = pivot;
                for k in 0..self.steps[i].edges.len() {
                    let edge = self.steps[i].edges[k];
                    if let Home::Tree { q: at, .. } = self.graph.edges[edge].home {
                        if self.graph.edges[edge].kind == Kind::Ball {
                            self.pose.balls[edge] = Quaternion([q[at], q[at + 1], q[at + 2], q[at + 3]]).matrix();
                        } else {
                            self.pose.x[edge] = q[at];
                        }
                    }
                }
                return Ok(());
            }
            Work::Plane(..) | Work::Space(_) => {}
        }
        self.solve(i).map_err(|x| self.shortfall(i, t, x))?;
        let (pose, graph) = (&mut self.pose, &self.graph);
        self.steps[i].edges.iter().for_each(|&e| pose.write(graph, e, q));
        Ok(())
    }

    /// Error of a step that does not close.
    fn shortfall(&self, i: usize, t: f64, Shortfall(shortfall): Shortfall) -> SystemError {
        let words = &self.steps[i].words;
        match shortfall.is_finite() {
            true => SystemError::Limit { block: words.clone(), t, shortfall },
            false => SystemError::NotFinite { what: words.clone(), t },
        }
    }

    /// All steps, with consistent whole turns.
    fn advance_all(&mut self, t: f64, q: &mut [f64]) -> Result<(), SystemError> {
        // a coupling converts whole turns to parts of turns: corrections before it affect those after it
        for _ in 0..=self.steps.len() {
            for i in 0..self.steps.len() {
                self.advance(i, t, q)?;
            }
            if !self.whole_turns(q)? || !self.counts() {
                return Ok(());
            }
        }
        Err(contradiction())
    }

    /// Whether a coupling counts whole turns.
    fn counts(&self) -> bool {
        !self.model.own.full.conditions.is_empty()
    }

    /// The closed form of step i for the coordinates known so far.
    pub(super) fn solve(&mut self, i: usize) -> Result<(), Shortfall> {
        self.steps[i].place_sides(&self.graph, &self.pose);
        self.solve_placed(i)
    }

    /// The same with the present sides of a polygon in a plane.
    fn solve_placed(&mut self, i: usize) -> Result<(), Shortfall> {
        if let Some(found) = self.steps[i].plane(self.tolerance) {
            let (joints, x) = found?;
            joints.iter().zip(x).for_each(|(j, x)| self.pose.x[j.edge] = x);
            return Ok(());
        }
        let step = &mut self.steps[i];
        match &step.work {
            Work::Space(p) => {
                let found = spatial::solve(&self.graph, p, step.signs, &self.pose);
                found.fit.check()?;
                found.write(&mut self.pose);
                step.pivots = found.pivots;
            }
            Work::Plane(..) | Work::Drive(..) | Work::Law(_) | Work::Implicit(_) => {}
        }
        Ok(())
    }

    /// In the plane a joint that locks a rotation locks it with its whole turns: the turns that the nearest angles miss
    /// are added to the angle that has moved the most. True if q changed.
    fn whole_turns(&self, q: &mut [f64]) -> Result<bool, SystemError> {
        let Engine::Planar(tree) = &self.model.own.engine else { return Ok(false) };
        if !self.locks_turns {
            return Ok(false);
        }
        let locked = || tree.closings.iter().filter(|k| !k.locks.is_empty());
        let missing = |k: &CutJoint<Planar<f64>>, q: &[f64]| {
            let mut angle = -k.locks[0];
            for p in &k.path {
                if let LinkMotion::Turn(axis) = tree.links[p.link].motion {
                    angle += if p.on_b { axis * q[tree.links[p.link].q] } else { -axis * q[tree.links[p.link].q] };
                }
            }
            (angle / TAU).round()
        };
        // a correction of one closure may open another through a shared angle: as many passes as closures suffice for
        // any order
        let mut moved = false;
        for _ in 0..=tree.closings.len() {
            let mut changed = false;
            for k in locked() {
                let turns = missing(k, q);
                if turns == 0.0 {
                    continue;
                }
                let mut best: Option<(usize, f64, f64)> = None;
                for p in &k.path {
                    let link = &tree.links[p.link];
                    let LinkMotion::Turn(axis) = link.motion else { continue };
                    if self.counted[link.v] {
                        continue;
                    }
                    let by = turns * if p.on_b { axis } else { -axis };
                    let moved = (q[link.q] - self.old[link.q]) * by.signum();
                    if best.is_none_or(|b| moved > b.2) {
                        best = Some((link.q, by, moved));
                    }
                }
                let Some((at, by, _)) = best else { continue };
                q[at] -= by * TAU;
                changed = true;
            }
            if !changed {
                return Ok(moved);
            }
            moved = true;
        }
        Err(contradiction())
    }
}

fn contradiction() -> SystemError {
    let message = "the whole turns of the joints between slides contradict each other; give inputs within a turn of a \
                   closed position";
    SystemError::argument("q", message.into())
}

/// Side k of a polygon in its plane.
pub(super) fn planar_side<S: Scalar>(p: &Polygon, k: usize, g: &Graph, pose: &Pose<S>) -> PlanarArm<S> {
    match &p.plane {
        None => p.sides[k].planar(g, pose),
        Some(plane) => {
            let (r, v) = p.sides[k].spatial(g, pose);
            PlanarArm::new([v.dot(lift(plane[1])), v.dot(lift(plane[2]))], turn_in(plane, &r))
        }
    }
}

/// The joints of a polygon in its plane.
pub(super) fn planar_joints(p: &Polygon, g: &Graph) -> Vec<PlanarJoint> {
    p.joints
        .iter()
        .map(|j| {
            let (i, forward) = j.edges[0];
            let e = &g.edges[i];
            let (axis, normal, rest) = match &p.plane {
                None => ([e.axis.0[0], e.axis.0[1]], e.axis.0[2], turn_of(&e.rest)),
                Some(plane) => {
                    ([e.axis.dot(plane[1]), e.axis.dot(plane[2])], e.axis.dot(plane[0]), turn_in(plane, &e.rest))
                }
            };
            let (sense, rest) = if forward { (1.0, rest) } else { (-1.0, -rest) };
            // backward, the axis comes after the constant rotation
            let along = if forward { axis } else { rotated([-axis[0], -axis[1]], rest) };
            let q = if let Home::Tree { q, .. } = e.home { Some(q) } else { None };
            PlanarJoint { edge: i, q, turns: e.kind == Kind::Turn, sign: sense * normal.signum(), rest, axis: along }
        })
        .collect()
}

impl Closing for LoopClosing<'_> {
    fn inputs(&self) -> &[usize] {
        &self.inputs
    }
    fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    /// Cost: one sine and cosine for each known turn between the joints of a polygon, three arc tangents a triangle; an
    /// implicit block of n unknowns takes n³/3 multiply-adds and one evaluation of the positions an iteration.
    fn close(&mut self, t: f64, q: &mut [f64]) -> Result<(), SystemError> {
        if self.locks_turns {
            self.old.copy_from_slice(q);
        }
        self.given.iter().for_each(|&i| self.pose.read(&self.graph, i, q));
        self.advance_all(t, q)?;
        self.update_states();
        Ok(())
    }

    fn follow(&mut self, t: f64, q: &mut [f64]) -> Result<f64, SystemError> {
        self.old.copy_from_slice(q);
        self.read(q);
        let mut doubt = 0.0f64;
        for i in 0..self.steps.len() {
            if self.steps[i].signs[0] != 0 {
                let (ambiguity, known) = self.choose_signs(i, q);
                doubt = doubt.max(ambiguity);
                if known {
                    let (pose, graph) = (&mut self.pose, &self.graph);
                    self.steps[i].edges.iter().for_each(|&e| pose.write(graph, e, q));
                    continue;
                }
            }
            self.advance(i, t, q)?;
        }
        if self.whole_turns(q)? && self.counts() {
            self.advance_all(t, q)?;
        }
        self.update_states();
        Ok(doubt)
    }

    fn state(&self) -> &[BlockState] {
        &self.states
    }

    fn iterations(&self) -> u64 {
        self.iterations
    }

    fn set_branches(&mut self, branches: &[i8]) {
        for (&(step, k), &sign) in self.entries.iter().zip(branches) {
            let current = &mut self.steps[step].signs[k];
            if *current != 0 && sign != 0 {
                *current = sign.signum();
            }
        }
    }
}
