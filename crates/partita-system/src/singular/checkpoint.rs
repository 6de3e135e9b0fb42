//! States before a singular position, to return to.

/// A state of the integration.
#[derive(Clone, Debug)]
pub struct Checkpoint {
    /// Time.
    pub t: f64,
    /// Coordinates.
    pub q: Vec<f64>,
    /// Velocities.
    pub v: Vec<f64>,
    /// Work.
    pub work: f64,
    /// Whole turns taken off the coordinates so far.
    pub turns: Vec<i32>,
}

/// When a state was, its work, and its place in the memory of a trail.
#[derive(Clone, Copy, Debug)]
struct Mark {
    t: f64,
    work: f64,
    slot: usize,
}

/// States since the last singular position, to return to if the integration came too close to the next one to cross it.
#[derive(Clone, Debug)]
pub struct Checkpoints {
    nq: usize,
    nv: usize,
    marks: [Mark; Checkpoints::LENGTH],
    /// Number of stored states in use; the latest is the first.
    count: usize,
    /// Coordinates and velocities of each.
    numbers: Vec<f64>,
    turns: Vec<i32>,
}

impl Checkpoints {
    /// States kept.
    const LENGTH: usize = 8;

    /// Memory for states of nq coordinates and nv velocities.
    pub fn new(nq: usize, nv: usize) -> Self {
        let marks = std::array::from_fn(|slot| Mark { t: 0.0, work: 0.0, slot });
        let (numbers, turns) = (vec![0.0; Self::LENGTH * (nq + nv)], vec![0; Self::LENGTH * nq]);
        Self { nq, nv, marks, count: 0, numbers, turns }
    }

    /// Forget all.
    pub fn clear(&mut self) {
        self.count = 0;
    }

    /// A state at t, unless the latest is younger than `apart`.
    pub fn push(&mut self, t: f64, apart: f64, (q, v): (&[f64], &[f64]), work: f64, turns: &[i32]) {
        if self.count > 0 && t - self.marks[0].t < apart {
            return;
        }
        self.marks.rotate_right(1);
        self.count = (self.count + 1).min(Self::LENGTH);
        let slot = self.marks[0].slot;
        self.marks[0] = Mark { t, work, slot };
        let (of_q, of_v) = self.numbers[slot * (self.nq + self.nv)..].split_at_mut(self.nq);
        of_q.copy_from_slice(q);
        of_v[..self.nv].copy_from_slice(v);
        self.turns[slot * self.nq..(slot + 1) * self.nq].copy_from_slice(turns);
    }

    /// The latest state that is not after t; those after it are forgotten.
    pub fn back_to(&mut self, t: f64) -> Option<Checkpoint> {
        while self.count > 0 && self.marks[0].t > t {
            self.marks[..self.count].rotate_left(1);
            self.count -= 1;
        }
        let &Mark { t, work, slot } = self.marks[..self.count].first()?;
        let (q, v) = self.numbers[slot * (self.nq + self.nv)..(slot + 1) * (self.nq + self.nv)].split_at(self.nq);
        let turns = self.turns[slot * self.nq..(slot + 1) * self.nq].to_vec();
        Some(Checkpoint { t, q: q.to_vec(), v: v.to_vec(), work, turns })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checkpoints_lead_back_to_the_latest_state_before() {
        let mut checkpoints = Checkpoints::new(1, 1);
        assert!(checkpoints.back_to(1.0).is_none());
        for i in 0..20 {
            let t = 0.1 * f64::from(i);
            checkpoints.push(t, 0.15, (&[t], &[-t]), 2.0 * t, &[i]);
        }
        // every second state is far enough from the one before, and eight are kept
        let checkpoint = checkpoints.back_to(1.45).unwrap();
        assert!(
            (checkpoint.t - 1.4).abs() < 1e-12
                && checkpoint.q == [checkpoint.t]
                && checkpoint.v == [-checkpoint.t]
                && checkpoint.turns == [14]
        );
        assert!(checkpoints.back_to(0.3).is_none(), "older ones were given up");
        checkpoints.clear();
        assert!(checkpoints.back_to(9.0).is_none());
    }
}
