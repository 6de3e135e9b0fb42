//! Which coordinates are states when the others follow from them: those of the independent velocities.

use crate::system::ConstrainedSystem;

/// The coordinates that belong to k independent velocities, as leading states.
///
/// A velocity with a coordinate of its own adds that one. One of a spatial rotation adds the whole quaternion, whose
/// four numbers have no meaning individually. The number of states then depends on the choice; the longest list sets
/// the number of slots, and unused slots hold the constant 1, whose relative tolerance is never zero.
pub(super) struct StateCoordinates {
    width: usize,
    list: Vec<usize>,
}

impl StateCoordinates {
    /// Slots for any choice of k velocities.
    pub(super) fn new<S: ConstrainedSystem>(system: &S, k: usize) -> Self {
        let size = system.size();
        let mut seen = vec![false; size.nq];
        let mut longer: Vec<usize> = Vec::new(); // numbers a choice gains by one velocity out of each turn in space
        for r in (0..size.nv).map(|i| system.structure().coordinates_of(i)).filter(|r| r.len() > 1) {
            if !std::mem::replace(&mut seen[r.start], true) {
                longer.push(r.len() - 1);
            }
        }
        longer.sort_unstable();
        longer.reverse();
        let width = (k + longer.iter().take(k).sum::<usize>()).min(size.nq);
        Self { width, list: Vec::with_capacity(width) }
    }

    /// Number of slots.
    pub(super) fn width(&self) -> usize {
        self.width
    }

    /// Use the coordinates of these velocities.
    pub(super) fn choose<S: ConstrainedSystem>(&mut self, system: &S, independent: &[usize]) {
        self.list.clear();
        let mut taken = vec![false; system.size().nq];
        for c in independent.iter().flat_map(|&i| system.structure().coordinates_of(i)) {
            if !std::mem::replace(&mut taken[c], true) {
                self.list.push(c);
            }
        }
    }

    /// States from q.
    pub(super) fn gather(&self, q: &[f64], y: &mut [f64]) {
        let (used, rest) = y[..self.width].split_at_mut(self.list.len());
        used.iter_mut().zip(&self.list).for_each(|(y, &c)| *y = q[c]);
        rest.fill(1.0);
    }

    /// Rates of the states from q'.
    pub(super) fn gather_rates(&self, qdot: &[f64], dy: &mut [f64]) {
        let (used, rest) = dy[..self.width].split_at_mut(self.list.len());
        used.iter_mut().zip(&self.list).for_each(|(y, &c)| *y = qdot[c]);
        rest.fill(0.0);
    }

    /// Put the states into q.
    pub(super) fn scatter(&self, y: &[f64], q: &mut [f64]) {
        self.list.iter().zip(y).for_each(|(&c, y)| q[c] = *y);
    }

    /// Whether y holds these coordinates of q, bit by bit.
    pub(super) fn agree(&self, q: &[f64], y: &[f64]) -> bool {
        self.list.iter().zip(y).all(|(&c, y)| q[c].to_bits() == y.to_bits())
    }
}
