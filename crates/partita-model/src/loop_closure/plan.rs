//! The plan of a closing: which steps, in which order, on which branch, with which rows of C.

use super::arm::{PlanarArm, Pose};
use super::close::{planar_joints, planar_side};
use super::graph::{Edge, Graph, Home, Kind};
use super::implicit::{Implicit, ImplicitScratch};
use super::instant::Instant;
use super::laws::{SolvedLaw, TreeLaw};
use super::order::{Next, Order};
use super::planar::PlanarPolygon;
use super::polygon::{Pair, Polygon};
use super::{LoopClosing, Step, Work};
use crate::evaluator::{DriveRow, Engine};
use crate::joint;
use crate::model::Model;
use partita_math::spatial::{Mat3, Quaternion};
use partita_math::tolerance;
use partita_system::prelude::*;
use partita_system::{SystemError, SystemRef};
use std::f64::consts::TAU;

/// Distance of closed forms from the position at which they are planned. Scale: radians and sizes. Reason: that
/// position is closed to 1e-9 or better, of which a square root near a dead point leaves half the digits.
const SAME_ASSEMBLY: f64 = 1e-3;

/// The unknowns for given inputs.
pub(super) struct Task {
    /// Coordinates of edges that are given or driven.
    pub given: Vec<bool>,
    /// Inputs among the velocities of each ball, one bit each.
    pub ball_inputs: Vec<u8>,
    /// Drives of coordinates of the tree, and their edges.
    pub drives: Vec<(usize, usize)>,
}

impl Task {
    pub fn new(model: &Model, graph: &Graph, inputs: &[usize]) -> Self {
        let is_input = |v: usize| inputs.binary_search(&v).is_ok();
        let driven =
            |e: &Edge| model.own.drives.iter().filter_map(DriveRow::velocity).any(|v| e.velocities().contains(&v));
        let given = graph.edges.iter().map(|e| e.in_tree() && (e.velocities().all(is_input) || driven(e))).collect();
        let ball_inputs = graph
            .edges
            .iter()
            .map(|e| {
                let bits = e.velocities().enumerate().map(|(i, v)| u8::from(is_input(v)) << i);
                if e.kind == Kind::Ball {
                    bits.sum()
                } else {
                    0
                }
            })
            .collect();
        let edge_of = |v: usize| graph.edges.iter().position(|e| e.velocities().contains(&v)).unwrap_or(0);
        let drives = model.own.drives.iter().enumerate();
        let drives = drives.filter_map(|(i, d)| Some((i, edge_of(d.velocity()?)))).collect();
        Self { given, ball_inputs, drives }
    }
}

impl<'m> LoopClosing<'m> {
    /// Plan for these inputs (ascending) on the branch of the closed position q.
    pub(super) fn new(at: &Instant<'m>, q: &[f64], inputs: &[usize]) -> Result<Self, SystemError> {
        let model = &*at.model;
        let size = model.size();
        let names = || model.structure().names(inputs);
        let driven = |d: &&DriveRow| d.velocity().is_some_and(|v| inputs.binary_search(&v).is_ok());
        if let Some((d, v)) = model.own.drives.iter().find(driven).and_then(|d| Some((d, d.velocity()?))) {
            let name = &model.structure().velocities[v].name;
            return Err(SystemError::argument(
                "independent",
                format!("{name} is driven by \"{}\": it cannot be an input; leave it out", d.name),
            ));
        }
        let dependent: Vec<bool> = (0..size.nv).map(|v| inputs.binary_search(&v).is_err()).collect();
        let rows = at.rows(&dependent);
        if rows.len() + inputs.len() != size.nv {
            let k = at.mobility();
            return Err(SystemError::argument(
                "independent",
                if k != inputs.len() {
                    format!(
                        "{} inputs were requested, but the number of degrees of freedom is {k}; name as many, or none",
                        inputs.len()
                    )
                } else {
                    format!("the inputs {} do not determine the others here (C_D is singular); choose others", names())
                },
            ));
        }
        let mut closing = Self::empty(at.model.clone(), inputs, q);
        let task = Task::new(model, &closing.graph, inputs);
        let found = match closing.plan_steps(at, &task, true)? {
            true => true,
            // a closed form that does not reproduce the position it is planned at does not apply to this mechanism
            false => closing.plan_steps(at, &task, false)?,
        };
        if !found {
            let message =
                format!("the loops cannot be solved one after the other for the inputs {}; choose others", names());
            return Err(SystemError::argument("independent", message));
        }
        let mut found = vec![false; closing.graph.edges.len()];
        // in space the spin of a link between two balls keeps its present value
        let planar = closing.steps.iter().filter(|s| matches!(s.work, Work::Plane(..)));
        planar.flat_map(|s| &s.edges).for_each(|&e| found[e] = true);
        closing.given = (0..found.len()).filter(|&e| !found[e] && closing.graph.edges[e].in_tree()).collect();
        closing.counted = (0..size.nv).map(|v| !dependent[v]).collect();
        for s in closing.steps.iter().filter(|s| matches!(s.work, Work::Drive(..) | Work::Law(_))) {
            s.edges.iter().for_each(|&e| closing.graph.edges[e].velocities().for_each(|v| closing.counted[v] = true));
        }
        closing.plan_blocks(at, &rows)?;
        closing.old.copy_from_slice(q);
        Ok(closing)
    }

    fn empty(model: SystemRef<'m, Model>, inputs: &[usize], q: &[f64]) -> Self {
        let graph = Graph::new(&model);
        let size = model.size();
        let mut closing = Self {
            steps: Vec::new(),
            inputs: inputs.to_vec(),
            blocks: Vec::new(),
            states: Vec::new(),
            entries: Vec::new(),
            given: Vec::new(),
            counted: Vec::new(),
            locks_turns: match &model.own.engine {
                Engine::Planar(tree) => tree.closings.iter().any(|k| !k.locks.is_empty()),
                Engine::Full => false,
            },
            tolerance: tolerance::CLOSED_IN_RUN * model.own.placed.size,
            pose: Pose::new(&graph, &model.own.numbers),
            old: q.to_vec(),
            scratch: model.scratch(),
            phi: vec![0.0; size.holonomic],
            c: vec![0.0; model.pattern().nnz()],
            a: vec![0.0; size.rows],
            dv: vec![0.0; size.nv],
            newton: ImplicitScratch::default(),
            iterations: 0,
            graph,
            model,
        };
        closing.read(q);
        closing.read_cuts(q);
        closing
    }

    /// Coordinates of the cut joints, from the poses.
    fn read_cuts(&mut self, q: &[f64]) {
        let model = self.model.clone();
        model.own.look(q, &self.dv, self.scratch.equations());
        let state_of = |j: usize| model.joint_state(j, q, &self.dv, &self.scratch).position;
        let mut last: Option<(usize, Vec<f64>)> = None;
        for i in 0..self.graph.edges.len() {
            let e = &self.graph.edges[i];
            let (Home::Cut(k), Some(j)) = (e.home, e.joint) else { continue };
            if last.as_ref().is_none_or(|l| l.0 != j) {
                last = Some((j, state_of(j)));
            }
            let Some((_, position)) = &last else { continue };
            let motions = &model.own.placed.joints[j].shape.motions;
            let first: usize = motions[..k.min(motions.len())].iter().map(joint::Motion::coordinates).sum();
            match (e.kind, motions.get(k)) {
                (Kind::Ball, _) => {
                    // relative to the axes of the drawing; the edge needs the axes of the parent's node
                    let r = Quaternion([0, 1, 2, 3].map(|c| position[first + c])).matrix();
                    let on = &model.own.placed.joints[j].on_parent;
                    self.pose.balls[i] = on.mul(&r).mul(&on.transpose());
                }
                (Kind::Turn, Some(joint::Motion::Ball)) => {
                    // a ball in the plane is a pin
                    let r = Quaternion([0, 1, 2, 3].map(|c| position[first + c])).matrix();
                    let on = &model.own.placed.joints[j].on_parent;
                    self.pose.x[i] = super::arm::turn_of(&on.mul(&r).mul(&on.transpose()));
                }
                (Kind::Turn | Kind::Slide, Some(_)) => self.pose.x[i] = position[first],
                _ => {}
            }
        }
    }

    /// Fills the steps; `false` if a closed form fails to reproduce q, or no order is found.
    fn plan_steps(&mut self, at: &Instant, task: &Task, closed_forms: bool) -> Result<bool, SystemError> {
        let model = self.model.clone();
        self.steps.clear();
        for &(d, edge) in &task.drives {
            let words = format!("drive \"{}\"", model.own.drives[d].name);
            self.push(Work::Drive(d, edge), words, vec![edge], 0);
        }
        let graph = self.graph.clone();
        let laws = TreeLaw::all(&model, &graph);
        let mut order = Order::new(&graph, &laws, model.is_planar(), &task.given, &task.ball_inputs);
        loop {
            if closed_forms {
                while let Some(next) = order.next() {
                    match next {
                        Next::Law(law) => self.push_law(law),
                        Next::Polygon(p) => {
                            if !self.push_polygon(p) {
                                return Ok(false);
                            }
                        }
                    }
                }
            }
            let missing: Vec<usize> =
                (0..graph.edges.len()).filter(|&e| graph.edges[e].in_tree() && !order.is_known(e)).collect();
            if missing.is_empty() {
                break;
            }
            let Some((rows, unknown)) = self.next_implicit(at, &missing) else { return Ok(false) };
            let others = self.that_follow(at, &missing, &rows, &unknown);
            let solved: Vec<usize> =
                missing.into_iter().filter(|&e| graph.edges[e].velocities().any(|v| unknown.contains(&v))).collect();
            order.learned(&solved);
            let words = format!("implicit block of {} ({})", unknown.len(), model.structure().names(&unknown));
            self.push(Work::Implicit(Implicit::new(at, rows, unknown, &others)), words, solved, 0);
        }
        let largest = self.steps.iter().map(|s| if let Work::Implicit(b) = &s.work { b.rows.len() } else { 0 });
        self.newton = ImplicitScratch::new(largest.max().unwrap_or(0), self.model.size().nq);
        Ok(true)
    }

    fn push_law(&mut self, law: SolvedLaw) {
        let (words, edge, pivot) = (law.words(&self.model), law.edge, law.pivot);
        self.push(Work::Law(law), words, vec![edge], 0);
        if let Some(step) = self.steps.last_mut() {
            step.pivots[0] = pivot;
        }
    }

    fn push(&mut self, work: Work, words: String, edges: Vec<usize>, signs: usize) {
        let signs_of = [0, 1].map(|i| i8::from(i < signs));
        let (mut sides, mut moving) = ([PlanarArm::new([0.0; 2], 0.0); 3], [true; 3]);
        if let Work::Plane(p, plane) = &work {
            for k in (0..plane.joints.len()).filter(|&k| p.sides[k].is_rigid(&self.graph)) {
                (sides[k], moving[k]) = (planar_side(p, k, &self.graph, &self.pose), false);
            }
        }
        let mut chains = [const { None }; 3];
        if let Work::Plane(p, plane) = &work {
            if p.plane.is_none() {
                (0..plane.joints.len()).for_each(|k| chains[k] = p.sides[k].chain(&self.graph, &self.pose));
            }
        }
        let states = signs.max(1);
        self.steps.push(Step { work, words, signs: signs_of, states, pivots: [1.0; 2], sides, moving, chains, edges });
    }

    /// Adds a polygon on the branch that reproduces the present coordinates; `false` if none does.
    fn push_polygon(&mut self, p: Polygon) -> bool {
        let edges: Vec<usize> = p.joints.iter().flat_map(|j| j.edges.iter().map(|e| e.0)).collect();
        let words = self.words(&p);
        let elementary = p.joints.iter().all(|j| matches!(j.pair, Pair::Turn | Pair::Slide));
        let (work, signs) = if elementary {
            let plane = PlanarPolygon::new(planar_joints(&p, &self.graph), p.frame);
            let signs = usize::from(plane.has_branch());
            (Work::Plane(p, plane), signs)
        } else {
            let universal = p.joints[2].pair == Pair::Universal;
            (Work::Space(p), 1 + usize::from(universal))
        };
        self.push(work, words, edges.clone(), signs);
        let step = self.steps.len() - 1;
        let here: Vec<(f64, Mat3<f64>)> = edges.iter().map(|&e| (self.pose.x[e], self.pose.balls[e])).collect();
        let mut best = (f64::INFINITY, [0i8; 2]);
        for choice in 0..1u8 << signs {
            let sign = |i: usize| {
                if i >= signs {
                    0
                } else if choice >> i & 1 == 0 {
                    1i8
                } else {
                    -1
                }
            };
            self.steps[step].signs = [sign(0), sign(1)];
            let apart = match self.solve(step) {
                Ok(()) => self.apart(&edges, &here),
                Err(_) => f64::INFINITY,
            };
            if apart < best.0 {
                best = (apart, self.steps[step].signs);
            }
            for (&e, h) in edges.iter().zip(&here) {
                (self.pose.x[e], self.pose.balls[e]) = *h;
            }
        }
        self.steps[step].signs = best.1;
        best.0 <= SAME_ASSEMBLY
    }

    /// Largest difference of edge coordinates, in radians and sizes.
    fn apart(&self, edges: &[usize], here: &[(f64, Mat3<f64>)]) -> f64 {
        let mut apart = 0.0f64;
        for (&e, (x, ball)) in edges.iter().zip(here) {
            let d = self.pose.x[e] - x;
            apart = apart.max(match self.graph.edges[e].kind {
                Kind::Turn => (d - (d / TAU).round() * TAU).abs(),
                Kind::Slide => d.abs() / self.model.own.placed.length,
                Kind::Ball => (0..9)
                    .fold(0.0, |m: f64, i| m.max((self.pose.balls[e].0[i / 3][i % 3] - ball.0[i / 3][i % 3]).abs())),
                Kind::Rigid => 0.0,
            });
        }
        apart
    }

    /// Kind and joints of a polygon in the words of the field.
    fn words(&self, p: &Polygon) -> String {
        let letter = |f: Pair| match f {
            Pair::Turn => 'R',
            Pair::Slide => 'P',
            Pair::Ball { .. } => 'S',
            Pair::Universal => 'U',
            Pair::Cylindrical => 'C',
        };
        let n = p.joints.len();
        // from the frame around to the frame
        let mut order: Vec<usize> = (1..=n).map(|i| (p.frame + i) % n).collect();
        let spelled = |order: &[usize]| order.iter().map(|&i| letter(p.joints[i].pair)).collect::<String>();
        let backward: Vec<usize> = order.iter().rev().copied().collect();
        // RRP and RPP rather than PRR and PPR
        if spelled(&backward) > spelled(&order) {
            order = backward;
        }
        let name = |i: usize| {
            let e = p.joints[i].edges[0].0;
            match self.graph.edges[e].joint {
                Some(j) => format!("\"{}\"", self.model.spec.joints[j].name),
                None => {
                    let v = self.graph.edges[e].velocities().start;
                    format!("\"{}\"", self.model.structure().velocities[v].name)
                }
            }
        };
        let names: Vec<String> = order.iter().map(|&i| name(i)).collect();
        let kind = match n {
            3 if p.joints.iter().all(|j| matches!(j.pair, Pair::Turn | Pair::Slide)) => "dyad",
            3 => "loop",
            2 => "pair",
            _ => "joint",
        };
        let plural = if n == 1 { "joint" } else { "joints" };
        format!("{} {kind} ({plural} {})", spelled(&order), names.join(", "))
    }
}
