//! The two ends of a step: what lies between them, and whether velocities are continuous from one to the other.

use partita_math::tolerance;

/// Length of a velocity in scales s: nearly that in the mass metric.
pub fn length(s: &[f64], v: impl Fn(usize) -> f64) -> f64 {
    s.iter().enumerate().map(|(i, s)| (v(i) / s).powi(2)).sum::<f64>().sqrt()
}

/// Boundary of a step: its start is compared with its end.
#[derive(Clone, Debug, Default)]
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
    /// A change of velocity of which accelerations leave more unexplained belongs to another branch. Scale: fraction of the
    /// change of this velocity. Reason: on the same branch they account for most of it; a mechanism that is thrown back
    /// misses all of it.
    const NOT_ACCELERATED: f64 = 0.75;
    /// Memory for nq coordinates and n velocities.
    pub fn new(nq: usize, n: usize) -> Self {
        Self { t: 0.0, nq, nv: n, all: Vec::with_capacity(nq + 2 * n) }
    }

    /// A step begins here.
    pub fn start(&mut self, t: f64, q: &[f64], v: &[f64], vdot: &[f64]) {
        (self.t, self.nq, self.nv) = (t, q.len(), v.len());
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

    /// Accelerations there.
    pub fn vdot(&self) -> &[f64] {
        self.all.get(self.nq + self.nv..).unwrap_or_default()
    }

    /// Displacement (in velocities) from here to t, inside the step to `end`: the integral of the cubic of velocities and
    /// accelerations at both.
    pub fn displacement(&self, end: &Self, t: f64, dv: &mut [f64]) {
        let h = end.t - self.t;
        let s = (t - self.t) / h;
        let (s2, s3, s4) = (s * s, s.powi(3), s.powi(4));
        let [p0, m0, p1, m1] =
            [s4 / 2.0 - s3 + s, s4 / 4.0 - 2.0 / 3.0 * s3 + s2 / 2.0, s3 - s4 / 2.0, s4 / 4.0 - s3 / 3.0]
                .map(|x| x * h);
        for (i, d) in dv.iter_mut().enumerate() {
            *d = p0 * self.v()[i] + p1 * end.v()[i] + h * (m0 * self.vdot()[i] + m1 * end.vdot()[i]);
        }
    }

    /// Velocities do not jump: is their change up to `end` that of the accelerations at both? They count in their
    /// scales s, so that the sum is nearly the mass metric's.                              (X4)
    pub fn continues_to(&self, end: &Self, s: &[f64]) -> bool {
        if self.all.len() != end.all.len() {
            return true; // no step began yet
        }
        let (h, v, end_vdot) = (end.t - self.t, end.v(), end.vdot());
        let (from, vdot) = (self.v(), self.vdot());
        let missed = |i: usize| v[i] - from[i] - 0.5 * h * (vdot[i] + end_vdot[i]);
        let mean = 0.5 * (length(s, |i| from[i]) + length(s, |i| v[i]));
        let fastest = (0..s.len()).fold(0.0, |m: f64, i| m.max(v[i].abs().max(from[i].abs()) / s[i]));
        let jumps = |i: usize| {
            let change = (v[i] - from[i]).abs();
            change / s[i] > tolerance::VISIBLE_CHANGE * fastest && missed(i).abs() > Self::NOT_ACCELERATED * change
        };
        // NaN does not hold
        length(s, missed) <= Self::MISSED_ON_BRANCH * mean && !(0..s.len()).any(jumps)
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

    /// v = t³ from 1 to 2: the cubic is the velocity itself.
    #[test]
    fn displacements_are_those_of_the_cubic() {
        let (from, to) = (boundary(1.0, &[1.0], &[3.0]), boundary(2.0, &[8.0], &[12.0]));
        let mut d = [0.0];
        for t in [1.0, 1.2, 1.7, 2.0] {
            from.displacement(&to, t, &mut d);
            assert!((d[0] - (t * t * t * t - 1.0) / 4.0).abs() < 1e-14, "{t}: {}", d[0]);
        }
    }
}
