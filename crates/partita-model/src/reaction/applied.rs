//! Loads on the bodies other than those of their joints.

use crate::evaluator::{Evaluator, Scratch};
use crate::force::{AppliedWrench, At, ForceApplication};
use crate::part::Part;
use crate::wrench::Wrench;
use partita_math::scalar::Scalar;
use partita_math::spatial::{Spatial, Vec3};
use partita_math::tolerance;
use partita_system::SystemError;

/// Residuals are compared with at least this part of the forces whose difference a spring pulls by. Scale: ratio. Reason:
/// positions are off by [`tolerance::SOLUTION_ROUNDING`] of the size, and what is left of forces then is no finding.
const ROUNDED: f64 = tolerance::SOLUTION_ROUNDING / tolerance::WORST_ROUNDING;

/// Applied forces at one instant, in mechanism axes.
pub(super) struct Applied<S> {
    /// On each body, about its centre of mass: gravity too.
    pub on: Vec<Wrench<S>>,
    /// Along each velocity of the tree.
    pub efforts: Vec<S>,
    /// The largest force of one element, before those of several cancel each other, and at least what rounding makes of
    /// springs.
    pub largest: S,
}

impl<S: Scalar> Evaluator<S> {
    /// Put a wrench about a point of space on a node.
    pub(super) fn put(&self, s: &Scratch<S>, on: &mut [Wrench<S>], node: usize, w: &Wrench<S>, point: Vec3<S>) {
        if node > 0 {
            on[node - 1].add(&w.about(point - self.com_now(s, node - 1)));
        }
    }

    /// All loads on the bodies of `part` except those of joints, after [`look_at`](Self::look_at). A user function is
    /// called once for each force.
    pub(super) fn applied(
        &self,
        part: &Part,
        t: S,
        q: &[S],
        v: &[S],
        s: &mut Scratch<S>,
    ) -> Result<Applied<S>, SystemError> {
        self.reaction_friction_at(t, q, v, s)?;
        let bodies = &self.numbers.bodies;
        let efforts = vec![S::zero(); self.placed.nv];
        let mut all = Applied { on: vec![Wrench::default(); bodies.len()], efforts, largest: S::zero() };
        let per_length = 1.0 / self.placed.size;
        let size = |p: &AppliedWrench<Spatial<S>>| p.force.norm().max(p.moment.norm().scale(per_length));
        for &node in &part.nodes {
            all.on[node - 1].force = self.full.gravity.times(bodies[node - 1].mass);
        }
        let mut memory = std::mem::take(&mut s.full_forces);
        let (seen_q, seen_v) = self.full.seen(&self.instant(t, q, v), &s.full, &mut memory);
        let (q, v) = if self.full.sees_tree_alone() { (q, v) } else { (&seen_q[..], &seen_v[..]) };
        for e in part.elements.iter().map(|&i| &self.full.elements[i]) {
            let effect =
                e.wrench(&At { tree: &self.full, s: &s.full, instant: self.seen_instant(t, q, v) }, &mut memory)?;
            let own = match &effect.application {
                ForceApplication::Along(_, effort) => effort.abs().scale(per_length.min(1.0)),
                ForceApplication::On(p) | ForceApplication::Between(_, p) => size(p),
                ForceApplication::Listed => memory.wrenches.iter().fold(S::zero(), |m, p| m.max(size(p))),
            };
            let rounded = e.elastic(&self.full, self.placed.size).scale(ROUNDED);
            all.largest = all.largest.max(own).max(rounded);
            match &effect.application {
                ForceApplication::Along(i, effort) => all.efforts[*i] += *effort,
                ForceApplication::On(p) => self.put_wrench(s, &mut all.on, p),
                ForceApplication::Between(a, b) => {
                    self.put_wrench(s, &mut all.on, a);
                    self.put_wrench(s, &mut all.on, b);
                }
                ForceApplication::Listed => memory.wrenches.iter().for_each(|p| self.put_wrench(s, &mut all.on, p)),
            }
        }
        (memory.q, memory.v) = (seen_q, seen_v);
        s.full_forces = memory;
        Ok(all)
    }

    fn put_wrench(&self, s: &Scratch<S>, on: &mut [Wrench<S>], p: &AppliedWrench<Spatial<S>>) {
        let point = self.full.reference_point(p.link, &s.full) + p.arm;
        self.put(s, on, p.node, &Wrench { moment: p.moment, force: p.force }, point);
    }
}
