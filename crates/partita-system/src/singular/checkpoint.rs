//! A singular position crossed: states before it to return to, and whether the motion kept its branch.

use partita_math::tolerance;

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

/// Boundary of a step: its start is compared with its end.
#[derive(Clone, Debug)]
pub struct StepBoundary {
    t: f64,
    nq: usize,
    nv: usize,
    /// q, v, v'; nothing before a step begins.
    all: Vec<f64>,
}

impl StepBoundary {
    /// Change of velocities that accelerations may leave unexplained over a step that keeps its branch. Scale: fraction
    /// of the mean speed. Reason: the error of the trapezoidal rule is a twentieth over half a radian; where branches
    /// part, velocities differ by about their own size.
    const MISSED_ON_BRANCH: f64 = 0.3;
    /// Memory for nq coordinates and n velocities.
    pub fn new(nq: usize, n: usize) -> Self {
        Self { t: 0.0, nq, nv: n, all: Vec::with_capacity(nq + 2 * n) }
    }

    /// A step begins here.
    pub fn start(&mut self, t: f64, q: &[f64], v: &[f64], vdot: &[f64]) {
        self.t = t;
        self.all.clear();
        [q, v, vdot].into_iter().for_each(|x| self.all.extend_from_slice(x));
    }

    /// When it began.
    pub fn t(&self) -> f64 {
        self.t
    }

    /// Position there.
    pub fn q(&self) -> &[f64] {
        self.all.get(..self.nq).unwrap_or_default()
    }

    /// Velocities there.
    pub fn v(&self) -> &[f64] {
        self.all.get(self.nq..self.nq + self.nv).unwrap_or_default()
    }

    fn vdot(&self) -> &[f64] {
        self.all.get(self.nq + self.nv..).unwrap_or_default()
    }

    /// Displacement, in velocities, from here half-way to `end`, by the velocities at both.
    pub fn half_way(&self, end: &Self) -> Vec<f64> {
        let h = end.t - self.t;
        self.v().iter().zip(end.v()).map(|(a, b)| 0.5 * h * (0.75 * a + 0.25 * b)).collect()
    }

    /// Velocities do not jump: is their change up to `end` that of the accelerations at both? They count in their
    /// scales s, so that the sum is nearly the mass metric's.
    pub fn continues_to(&self, end: &Self, s: &[f64]) -> bool {
        if self.all.len() != end.all.len() {
            return true; // no step began yet
        }
        let (h, v, end_vdot) = (end.t - self.t, end.v(), end.vdot());
        let (from, vdot) = (self.v(), self.vdot());
        let norm = |f: &dyn Fn(usize) -> f64| (0..s.len()).map(|i| (f(i) / s[i]).powi(2)).sum::<f64>().sqrt();
        let missed = |i: usize| v[i] - from[i] - 0.5 * h * (vdot[i] + end_vdot[i]);
        let speed = 0.5 * (norm(&|i| from[i]) + norm(&|i| v[i]));
        let fastest = (0..s.len()).fold(0.0, |m: f64, i| m.max(v[i].abs().max(from[i].abs()) / s[i]));
        let jumps = |i: usize| {
            let change = (v[i] - from[i]).abs();
            change / s[i] > tolerance::VISIBLE_CHANGE * fastest && missed(i).abs() > tolerance::NOT_ACCELERATED * change
        };
        // NaN does not hold
        norm(&missed) <= Self::MISSED_ON_BRANCH * speed && !(0..s.len()).any(jumps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn boundary(t: f64, v: &[f64], vdot: &[f64]) -> StepBoundary {
        let mut boundary = StepBoundary::new(0, v.len());
        boundary.start(t, &[], v, vdot);
        boundary
    }

    #[test]
    fn a_smooth_motion_passes_at_every_step_and_a_jump_at_none() {
        // x = sin t, y = cos t over the top: y goes on, or is thrown back
        for h in [1e-6, 1e-3, 0.1, 0.5, 1.0] {
            let (a, b) = (0.5 * (std::f64::consts::PI - h), 0.5 * (std::f64::consts::PI + h));
            let before = boundary(a, &[a.cos(), -a.sin()], &[-a.sin(), -a.cos()]);
            let after = boundary(b, &[b.cos(), -b.sin()], &[-b.sin(), -b.cos()]);
            let back = boundary(b, &[b.cos(), b.sin()], &[-b.sin(), b.cos()]);
            assert!(before.continues_to(&after, &[1.0, 1.0]), "{h}");
            assert!(!before.continues_to(&back, &[1.0, 1.0]), "{h}");
            // one small velocity of many that jumps
            let (slow, jumped) = (boundary(a, &[1.0, 0.2], &[0.0, 0.0]), boundary(b, &[1.0, -0.2], &[0.0, 0.0]));
            assert!(
                !slow.continues_to(&jumped, &[1.0, 1.0])
                    && slow.continues_to(&boundary(b, &[1.0, 0.2], &[0.0, 0.0]), &[1.0, 1.0])
            );
        }
        assert!(!boundary(0.0, &[1.0], &[0.0]).continues_to(&boundary(1.0, &[f64::NAN], &[0.0]), &[1.0]));
    }

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
