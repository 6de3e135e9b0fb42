//! The tree in one space with everything that acts on it: what an evaluation needs.

use crate::force::{At, Element, Room};
use crate::tree::{Tree, TreeScratch};
use crate::value::Instant;
use partita_math::scalar::Scalar;
use partita_math::spatial::Space;
use partita_system::SystemError;
use std::ops::Deref;

/// A tree and its applied forces, over one space and one kind of numbers.
#[derive(Clone, Debug)]
pub struct Mechanics<G: Space> {
    tree: Tree<G>,
    /// Applied forces, springs between points first.
    pub elements: Vec<Element<G>>,
}

impl<G: Space> Deref for Mechanics<G> {
    type Target = Tree<G>;
    fn deref(&self) -> &Tree<G> {
        &self.tree
    }
}

impl<G: Space> Mechanics<G> {
    /// Put forces on a tree. `massive` says which links have mass or inertia, a matter of structure.
    pub(crate) fn new(mut tree: Tree<G>, elements: Vec<Element<G>>, massive: &[bool]) -> Self {
        tree.idle = massive.iter().map(|m| !m).collect();
        tree.efforts.clear();
        for e in &elements {
            let (along, on) = e.touches();
            tree.efforts.extend(along);
            on.iter().for_each(|&link| tree.idle[link] = false);
        }
        tree.efforts.sort_unstable();
        tree.efforts.dedup();
        Self { tree, elements }
    }

    /// Gather all applied forces at the last twists. A user's function is called once for each force that names it.
    pub(crate) fn apply(
        &self,
        instant: Instant<G::S>,
        s: &mut TreeScratch<G>,
        room: &mut Room<G>,
    ) -> Result<(), SystemError> {
        self.clear_forces(s);
        let Instant { t, q, v, callers } = instant;
        for e in &self.elements {
            let instant = Instant { t, q, v, callers };
            let effect = e.wrench(&At { tree: &self.tree, s, instant }, room)?;
            self.add_effect(s, &effect, room);
        }
        Ok(())
    }

    /// Kinetic and potential energy, and the power of what has no potential, at the last twists.
    pub(crate) fn energies(
        &self,
        instant: Instant<G::S>,
        s: &TreeScratch<G>,
        room: &mut Room<G>,
    ) -> Result<[G::S; 3], SystemError> {
        let (kinetic, gravity) = self.energy(s);
        let (mut potential, mut power) = (G::S::zero(), G::S::zero());
        let at = At { tree: &self.tree, s, instant };
        for e in &self.elements {
            let effect = e.wrench(&at, room)?;
            potential += effect.potential;
            power += effect.power;
        }
        Ok([kinetic, gravity + potential, power])
    }
}
