//! The equations of a mechanism as a program for another environment, with its parameters as inputs.
//!
//! ```text
//! inputs    t | q | v | parameters | v' | λ
//! position  Φ, values of C in pattern order, a                                                (S3, S4)
//! velocity  b, lower triangle of M without its zeros, h                                        (S5, S1)
//! metric    lower triangle of the metric, where it differs from M: for massless bodies
//! look      of each body position and axes (row by row), of each joint its point; kinetic, potential energy
//! reactions of each joint force and moment on its child about its point, world axes, for v' and λ                 (R3)
//! ```

use crate::error::DescriptionError;
use crate::evaluator::{with_engine, Evaluator, Scratch};
use crate::model::Model;
use partita_math::scalar::{Module, Recorder, Recording, Scalar};
use partita_math::spatial::Mat3;
use partita_system::prelude::*;
use partita_system::SystemError;
use std::ops::Range;

/// A mechanism's equations as a module, and the offsets of its numbers.
#[derive(Clone, Debug)]
pub struct Recorded {
    /// The module.
    pub module: Module,
    /// Each parameter with the offset of its first number and their count.
    pub parameters: Vec<(String, usize, usize)>,
    /// The other inputs that a caller sets, v' and λ of all rows, likewise.
    pub inputs: Vec<(&'static str, usize, usize)>,
    /// Each output with the offset of its first number and their count.
    pub outputs: Vec<(&'static str, usize, usize)>,
    /// For `mass` and `metric` the indices in the lower triangle, counted row by row, of entries that are not always 0.
    pub patterns: Vec<(&'static str, Vec<usize>)>,
}

/// Stages, and their outputs.
const STAGES: [(&str, &[&str]); 5] = [
    ("position", &["phi", "c", "a"]),
    ("velocity", &["b", "mass", "h"]),
    ("metric", &["metric"]),
    ("look", &["bodies", "joints", "energy"]),
    ("reactions", &["reactions"]),
];

/// Triangles whose zeros are omitted.
const PATTERNED: [&str; 2] = ["mass", "metric"];

/// Of a dense symmetric matrix.
fn lower<S: Scalar>(full: &[S], n: usize) -> impl Iterator<Item = S> + '_ {
    (0..n).flat_map(move |i| (0..=i).map(move |j| full[i * n + j]))
}

impl<S: Scalar> Evaluator<S> {
    /// Poses of bodies and points of joints in the world, after [`look`](Self::look).
    pub(crate) fn poses_and_points(&self, s: &Scratch<S>) -> (Vec<S>, Vec<S>) {
        let out = Mat3::<S>::from_f64(self.placed.basis.transpose().0);
        let (mut bodies, mut joints) = (Vec::new(), Vec::new());
        for (body, n) in self.placed.bodies.iter().zip(&self.numbers.bodies) {
            let arm = self.arm_now(s, body.link, n.origin);
            let position = out.apply(self.full.reference_point(body.link, &s.full) + arm);
            let turned = out.mul(&s.full.links[body.link].rot).mul(&Mat3::from_f64(body.rot.0));
            bodies.extend(position.0);
            bodies.extend(turned.0.as_flattened());
        }
        for (joint, points) in self.placed.joints.iter().zip(&self.numbers.joints) {
            let arm = self.arm_now(s, self.placed.link_of(joint.child), points.1);
            joints.extend(out.apply(self.node_state(s, joint.child).centre + arm).0);
        }
        (bodies, joints)
    }
}

impl Model {
    /// The equations as a program whose inputs are time, state and these parameters (see
    /// [`parameters`](crate::parameters)), except those that [`over_with`](Self::over_with) cannot take because they
    /// determine whole turns: those stay constant.
    ///
    /// # Errors
    /// Parameters that do not exist or are given twice; elements that call user functions, and reaction-dependent
    /// frictions: they cannot be recorded.
    pub fn recorded(&self, names: &[String]) -> Result<Recorded, DescriptionError> {
        let present = self.parameters();
        let (nq, nv) = (self.own.placed.nq, self.own.placed.nv);
        let mut next = 1 + nq + nv;
        let mut parameters = Vec::with_capacity(names.len());
        for name in names.iter().filter(|name| self.is_smooth(name)) {
            // unknown names are refused below, with those that exist
            let count = present.iter().find(|p| p.0 == *name).map_or(0, |p| p.1.len());
            parameters.push((name.clone(), next, count));
            next += count;
        }
        let settled = 1 + nq + nv..next;
        let inputs = vec![("vdot", next, nv), ("lambda", next + nv, self.size().rows)];
        next += nv + self.size().rows;
        let mut sizes: Vec<usize> = Vec::new();
        let made = Recording::new(next, |x| {
            let changes: Vec<(&str, &[Recorder])> =
                parameters.iter().map(|(name, from, n)| (name.as_str(), &x[*from..from + n])).collect();
            let evaluator = self.over_with::<Recorder>(&changes)?;
            let groups = self.everything(&evaluator, x, settled.end).map_err(|e| {
                DescriptionError::new("mechanism", &self.spec.name, format!("its equations cannot be recorded: {e}"))
            })?;
            sizes = groups.iter().map(Vec::len).collect();
            Ok::<_, DescriptionError>(groups.concat())
        })?
        .lean();
        let (mut outputs, mut stages, mut patterns) = (Vec::new(), Vec::new(), Vec::new());
        let (mut from, mut kept, mut size) = (0, Vec::new(), sizes.iter());
        for (stage, names) in STAGES {
            let start = kept.len();
            for name in names.iter().filter(|name| self.is_smooth(name)) {
                let (all, first) = (size.next().copied().unwrap_or(0), kept.len());
                let sparse = PATTERNED.contains(name);
                kept.extend((from..from + all).filter(|&o| !(sparse && made.is_zero(o))));
                if sparse {
                    patterns.push((*name, kept[first..].iter().map(|o| o - from).collect()));
                }
                outputs.push((*name, next + first, kept.len() - first));
                from += all;
            }
            stages.push((stage, Range { start, end: kept.len() }));
        }
        let made = made.with_outputs(&kept);
        Ok(Recorded { module: made.module(settled, &stages), parameters, inputs, outputs, patterns })
    }

    /// All outputs, in the order of [`STAGES`]; v' and λ are the inputs from `acting` on.
    fn everything(
        &self,
        e: &Evaluator<Recorder>,
        x: &[Recorder],
        acting: usize,
    ) -> Result<Vec<Vec<Recorder>>, SystemError> {
        let (nq, nv) = (self.own.placed.nq, self.own.placed.nv);
        let zeros = |n: usize| vec![Recorder::zero(); n];
        let (t, q, v) = (x[0], &x[1..1 + nq], &x[1 + nq..1 + nq + nv]);
        let (rows, holonomic) = (self.row_names.len(), self.size().holonomic);
        let mut s = e.scratch();
        let (mut phi, mut c, mut a) = (zeros(holonomic), zeros(self.pattern().col_idx.len()), zeros(rows));
        let (mut b, mut mass, mut h) = (zeros(rows), zeros(nv * nv), zeros(nv));
        e.position(t, q, &mut s, &mut phi, &mut c, &mut a)?;
        e.velocity(t, q, v, &mut s, &mut b)?;
        e.dynamics(t, q, v, &mut s, &mut mass, &mut h)?;
        let lower = |m: &[Recorder]| lower(m, nv).collect::<Vec<_>>();
        let mut metric = Vec::new();
        if self.structure().lacks_mass {
            let mut heavier = mass.clone();
            with_engine!(e, s, |tree, x| tree.add_massless(x, &mut heavier));
            metric = lower(&heavier);
        }
        e.look(q, v, &mut s);
        let (bodies, joints) = e.poses_and_points(&s);
        let [kinetic, potential, _] = e.energies(t, q, v, &s)?;
        let (vdot, lambda) = x[acting..].split_at(nv);
        let found = e.reactions(t, q, v, vdot, lambda, &mut s)?;
        let reactions = found.joints.iter().flat_map(|w| w.force.0.into_iter().chain(w.moment.0)).collect();
        Ok(vec![phi, c, a, b, lower(&mass), h, metric, bodies, joints, vec![kinetic, potential], reactions])
    }
}
