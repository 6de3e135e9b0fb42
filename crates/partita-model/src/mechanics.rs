//! The tree in one space with all its loads: what an evaluation needs.

use crate::coupling::Condition;
use crate::force::{At, CutSight, Element, ForceScratch, LawInput};
use crate::tree::{Tree, TreeScratch};
use crate::value::{places_uncounted, Instant};
use partita_math::scalar::Scalar;
use partita_math::spatial::{Mat3, Space};
use partita_system::SystemError;
use std::ops::Deref;

/// A tree and its applied forces, over one space and one kind of numbers.
#[derive(Clone, Debug)]
pub struct Mechanics<G: Space> {
    tree: Tree<G>,
    /// Applied forces, springs between points first.
    pub elements: Vec<Element<G>>,
    /// Conditions other than loop closures of joints, in the order of their rows.
    pub conditions: Vec<Condition<G>>,
    /// Coordinates of joints that close loops, in the order of the joints: functions of the state read them after those
    /// of the tree. None where there is no such function.
    pub(crate) sights: Vec<CutSight<G>>,
    /// Readings of sensors, which the same functions read after those coordinates; none where there is no function.
    pub(crate) sensed: Vec<LawInput<G>>,
    /// Places among all these numbers of angles whose whole turns are not counted.
    pub(crate) uncounted: Vec<usize>,
    /// World axes from mechanism axes.
    pub(crate) out: Mat3<G::S>,
}

impl<G: Space> Deref for Mechanics<G> {
    type Target = Tree<G>;
    fn deref(&self) -> &Tree<G> {
        &self.tree
    }
}

impl<G: Space> Mechanics<G> {
    /// Put forces on a tree. `massive` flags the links with mass or inertia, which depends on structure.
    pub(crate) fn new(
        mut tree: Tree<G>,
        conditions: Vec<Condition<G>>,
        elements: Vec<Element<G>>,
        sights: Vec<CutSight<G>>,
        massive: &[bool],
    ) -> Self {
        tree.idle = massive.iter().map(|m| !m).collect();
        tree.efforts.clear();
        for e in &elements {
            let (along, on) = e.touches();
            tree.efforts.extend(along);
            on.iter().for_each(|&link| tree.idle[link] = false);
        }
        tree.efforts.sort_unstable();
        tree.efforts.dedup();
        Self { tree, elements, conditions, sights, sensed: Vec::new(), uncounted: Vec::new(), out: Mat3::identity() }
    }

    /// Let functions of the state, which read `nq` coordinates of the tree first, read what sensors read.
    pub(crate) fn sensing(mut self, nq: usize, sensed: Vec<LawInput<G>>, out: Mat3<G::S>) -> Self {
        (self.sensed, self.out) = (sensed, out);
        let shown = self.sights.iter().map(CutSight::shown).chain(self.sensed.iter().map(LawInput::shown));
        self.uncounted = places_uncounted(nq, shown);
        self
    }

    /// Whether functions of the state depend on the coordinates of the tree only.
    pub(crate) fn sees_tree_alone(&self) -> bool {
        self.sights.is_empty() && self.sensed.is_empty()
    }

    /// M is a metric as it is: no link needs more than its own mass.
    pub(crate) fn count_as_drawn(&mut self) {
        self.tree.massless.clear();
    }

    /// Φ, C and a of all conditions at the last poses.                                    (S3, S4)
    pub(crate) fn hold(
        &self,
        at: &Instant<G::S>,
        s: &TreeScratch<G>,
        memory: &mut Vec<f64>,
        phi: &mut [G::S],
        c: &mut [G::S],
        a: &mut [G::S],
    ) -> Result<(), SystemError> {
        self.conditions.iter().try_for_each(|x| x.position(&self.tree, s, at, memory, phi, c, a))
    }

    /// b of all conditions at the last twists.                                            (S5)
    pub(crate) fn hold_rates(
        &self,
        at: &Instant<G::S>,
        s: &TreeScratch<G>,
        memory: &mut Vec<f64>,
        b: &mut [G::S],
    ) -> Result<(), SystemError> {
        self.conditions.iter().try_for_each(|x| x.velocity(&self.tree, s, at, memory, b))
    }

    /// Rows of C, those of positions among them, and entries.
    pub fn sizes(&self) -> (usize, usize, usize) {
        let rows = |x: &Condition<G>| x.rows();
        let (all, entries) = self
            .conditions
            .iter()
            .fold((self.tree.rows, self.tree.entries), |(n, e), x| (n + rows(x), e + rows(x) * x.columns.len()));
        let of_rates: usize = self.conditions.iter().filter(|x| !x.holonomic).map(rows).sum();
        (all, all - of_rates, entries)
    }

    /// Gather all applied forces at the last twists. A user function is called once for each force that names it.
    pub(crate) fn apply(
        &self,
        instant: Instant<G::S>,
        s: &mut TreeScratch<G>,
        memory: &mut ForceScratch<G>,
    ) -> Result<(), SystemError> {
        self.clear_forces(s);
        let (q, v) = self.seen(&instant, s, memory);
        let Instant { t, callers, .. } = instant;
        let uncounted = &self.uncounted[..];
        let (all_q, all_v) = if self.sees_tree_alone() { (instant.q, instant.v) } else { (&q[..], &v[..]) };
        for e in &self.elements {
            let instant = Instant { t, q: all_q, v: all_v, callers, uncounted };
            let effect = e.wrench(&At { tree: &self.tree, s, instant }, memory)?;
            self.add_effect(s, &effect, memory);
        }
        (memory.q, memory.v) = (q, v);
        Ok(())
    }

    /// Coordinates and velocities as functions read them, in the scratch memory; nothing where the tree's are all there
    /// is.
    #[inline]
    pub(crate) fn seen(
        &self,
        instant: &Instant<G::S>,
        s: &TreeScratch<G>,
        memory: &mut ForceScratch<G>,
    ) -> (Vec<G::S>, Vec<G::S>) {
        match self.sees_tree_alone() {
            true => (Vec::new(), Vec::new()),
            false => self.seen_beyond(instant, s, memory),
        }
    }

    #[inline(never)]
    fn seen_beyond(
        &self,
        instant: &Instant<G::S>,
        s: &TreeScratch<G>,
        memory: &mut ForceScratch<G>,
    ) -> (Vec<G::S>, Vec<G::S>) {
        let (mut q, mut v) = (std::mem::take(&mut memory.q), std::mem::take(&mut memory.v));
        q.clear();
        v.clear();
        q.extend_from_slice(instant.q);
        v.extend_from_slice(instant.v);
        let Instant { t, q: tree_q, v: tree_v, callers, .. } = *instant;
        let instant = Instant { t, q: tree_q, v: tree_v, callers, uncounted: &[] };
        let at = At { tree: &self.tree, s, instant };
        for sight in &self.sights {
            sight.show(&at, &mut q, &mut v);
        }
        self.sensed.iter().for_each(|sight| sight.show(&at, &self.out, &mut q));
        (q, v)
    }

    /// The data that elements read, at the last poses and twists.
    pub(crate) fn at<'a>(&'a self, s: &'a TreeScratch<G>, instant: Instant<'a, G::S>) -> At<'a, G> {
        At { tree: &self.tree, s, instant }
    }

    /// Kinetic and potential energy, and the power of forces without a potential, at the last twists.
    pub(crate) fn energies(
        &self,
        instant: Instant<G::S>,
        s: &TreeScratch<G>,
        memory: &mut ForceScratch<G>,
    ) -> Result<[G::S; 3], SystemError> {
        let (kinetic, gravity) = self.energy(instant.v, s);
        let [potential, power] = self.potential_and_power(instant, s, memory)?;
        Ok([kinetic, gravity + potential, power])
    }

    /// Potential of the applied forces, and the power of those without one, at the last twists.
    #[inline]
    pub(crate) fn potential_and_power(
        &self,
        instant: Instant<G::S>,
        s: &TreeScratch<G>,
        memory: &mut ForceScratch<G>,
    ) -> Result<[G::S; 2], SystemError> {
        let (mut potential, mut power) = (G::S::zero(), G::S::zero());
        let (q, v) = self.seen(&instant, s, memory);
        let Instant { t, callers, .. } = instant;
        let uncounted = &self.uncounted[..];
        let (all_q, all_v) = if self.sees_tree_alone() { (instant.q, instant.v) } else { (&q[..], &v[..]) };
        let at = At { tree: &self.tree, s, instant: Instant { t, q: all_q, v: all_v, callers, uncounted } };
        for e in &self.elements {
            let effect = e.wrench(&at, memory)?;
            potential += effect.potential;
            power += effect.power;
        }
        (memory.q, memory.v) = (q, v);
        Ok([potential, power])
    }
}
