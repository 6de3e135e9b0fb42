//! Whether the motion has been thrown back at a dead point. Needed by 2k forms only.

use crate::step_boundary::{length, StepBoundary};
use partita_math::tolerance;

/// The end of the last step, as a reference for the next one.
///
/// At a dead point of its inputs the equations in 2k states have two solutions: the mechanism passes, and its dependent
/// coordinates go over to the other branch, or it is thrown back on the branch it came from. Both have the same inputs
/// to second order, so the error estimate sees no difference, and a closing that keeps its branch takes the wrong one.
/// What distinguishes them is that velocities do not jump: thrown back, the dependent ones change sign within the step,
/// however short it is, while no acceleration accounts for that.
#[derive(Clone, Debug, Default)]
pub(super) struct Continuity {
    /// The end of the step before the last one, of the last one, and of the one that was judged, not yet accepted.
    before: End,
    last: End,
    next: End,
    /// Largest speed so far: a mechanism at rest has no direction to lose.
    fastest: f64,
    /// Longest step so far.
    longest: f64,
    in_a_row: u32,
}

/// End of a step.
#[derive(Clone, Debug, Default)]
struct End {
    at: StepBoundary,
    /// Nearness of a dead point or a singular position, see [`Continuity::nearness`].
    near: f64,
    /// Short steps in a row towards a dead point that hardly come nearer.
    creeping: u32,
}

impl Continuity {
    /// Below this distance a singular position counts as near. Scale: distance in natural scales. Reason: crossing from there
    /// takes about half a radian.
    const SINGULAR_NEAR: f64 = 0.3;
    /// At this nearness to a dead point no step succeeds. Scale: gain of the switch. Reason: the equations in 2k
    /// states are rounding there.
    const STUCK: f64 = 1e4;
    /// From this nearness on short steps are blamed on the dead point or singular position. Scale: gain of the
    /// switch. Reason: one and a half digits are lost there.
    const BLAMED_NEARNESS: f64 = 30.0;
    /// Steps up to this are predicted from the change of accelerations over the step before. Scale: multiples of that
    /// step. Reason: farther away the extrapolation errs by more than the change.
    const EXTRAPOLATED: f64 = 2.0;
    /// Steps that are shorter creep, where they also cover less of the time left to the position. Scale: fraction of the
    /// longest step so far, and of that time. Reason: error control shortens healthy steps less, and a healthy approach
    /// covers a good part in each step; less has an error estimate of rounding, and thousands of steps would follow.
    const CREEPING: f64 = 0.03;
    /// So many steps in a row that hardly advance end the run.
    const PATIENCE: u32 = 12;
    /// After this many repetitions, each with half the step, the cause is not the step.
    const MOST: u32 = 10;

    /// How near the inputs are to a dead point, or the mechanism to a singular position; far is below 1.
    ///
    /// Where all dependent velocities are slower than the independent ones (`gain`, the largest of a switch), no
    /// dead point is near. `distance` is the margin of the tangent.
    pub(super) fn nearness(gain: f64, distance: f64) -> f64 {
        gain.max(Self::SINGULAR_NEAR / distance)
    }

    /// Displacement (in velocities) from the end of the last step to t, ahead of it: extrapolated with the velocities
    /// and accelerations there, and the change of the latter if the step before was not much shorter.
    pub(super) fn predict(&self, t: f64, dv: &mut [f64]) {
        let (before, last) = (&self.before.at, &self.last.at);
        let (h, length) = (t - last.t(), last.t() - before.t());
        let part = if h < Self::EXTRAPOLATED * length { h / (3.0 * length) } else { 0.0 };
        let ends = last.v().iter().zip(last.vdot()).zip(before.vdot());
        for (d, ((v, vdot), before)) in dv.iter_mut().zip(ends) {
            *d = h * (v + 0.5 * h * (vdot + part * (vdot - before)));
        }
    }

    /// As `predict`, for t inside the step that was judged, by the cubic of velocities and accelerations at both its ends;
    /// where no step was judged, as [`predict`](Self::predict).
    pub(super) fn inside(&self, t: f64, dv: &mut [f64]) {
        match self.next.at.t() > self.last.at.t() {
            true => self.last.at.displacement(&self.next.at, t, dv),
            false => self.predict(t, dv),
        }
    }

    /// Restart from this state.
    pub(super) fn start(&mut self, t: f64, v: &[f64], vdot: &[f64], near: f64) {
        self.last.at.start(t, &[], v, vdot);
        (self.last.near, self.last.creeping) = (near, 0);
        (self.before, self.next) = (self.last.clone(), self.last.clone());
    }

    /// Whether the step to here is continuous. Velocities count in their scales s. If it does, [`accept`](Self::accept)
    /// makes it the last one.
    pub(super) fn judge(&mut self, t: f64, v: &[f64], vdot: &[f64], s: &[f64], near: f64) -> bool {
        let (from, next) = (&self.last, &mut self.next);
        next.at.start(t, &[], v, vdot);
        let speed = length(s, |i| v[i]);
        self.fastest = self.fastest.max(speed);
        let h = t - from.at.t();
        let moving = length(s, |i| from.at.v()[i]) + speed > tolerance::NEGLIGIBLE * self.fastest;
        if h > 0.0 && from.near.max(near) > 1.0 && moving && !from.at.continues_to(&next.at, s) {
            self.in_a_row += 1;
            return false;
        }
        self.in_a_row = 0;
        // 1/nearness falls linearly: its relative growth is the step over the time left after it
        let growth = (near - from.near) / from.near;
        let short = h < Self::CREEPING * self.longest.max(h);
        let creeps = near > Self::BLAMED_NEARNESS && short && (0.0..Self::CREEPING).contains(&growth);
        let creeping = if creeps { from.creeping + 1 } else { 0 };
        (next.near, next.creeping) = (near, creeping);
        true
    }

    /// The step that was judged is the last one from here on.
    pub(super) fn accept(&mut self) {
        self.longest = self.longest.max(self.next.at.t() - self.last.at.t());
        std::mem::swap(&mut self.before, &mut self.last);
        std::mem::swap(&mut self.last, &mut self.next);
    }

    /// Whether no step is possible from the end of the one judged. For inputs that nothing replaces.
    pub(super) fn is_stuck(&self, gain: f64) -> bool {
        gain > Self::STUCK || self.next.creeping > Self::PATIENCE
    }

    /// Whether a dead point or a singular position was near at the end of the last step.
    pub(super) fn is_near(&self) -> bool {
        self.last.near > 1.0
    }

    /// The inputs cannot be replaced and are at their dead point: no step is possible from here.
    pub(super) fn give_up(&mut self) {
        self.in_a_row = Self::MOST + 1;
    }

    /// Would repeating the step once more be in vain?
    pub(super) fn gave_up(&self) -> bool {
        self.in_a_row > Self::MOST
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// x = sin t, y = cos t from both sides of t = π/2, y going on or thrown back.
    fn over_the_top(h: f64, back: f64) -> bool {
        let top = std::f64::consts::FRAC_PI_2;
        let at = |t: f64, sign: f64| ([t.cos(), -sign * t.sin()], [-t.sin(), -sign * t.cos()]);
        let mut c = Continuity::default();
        let ((v, vdot), (w, wdot)) = (at(top - 0.5 * h, 1.0), at(top + 0.5 * h, back));
        c.start(0.0, &v, &vdot, 10.0);
        c.judge(h, &w, &wdot, &[1.0, 1.0], 10.0)
    }

    #[test]
    fn passing_and_being_thrown_back_differ_at_every_step() {
        for h in [1e-6, 1e-3, 0.1, 0.5, 1.0] {
            assert!(over_the_top(h, 1.0) && !over_the_top(h, -1.0), "{h}");
        }
    }

    /// v = t³ from 1 to 2: the cubic is the velocity itself; ahead of it the parabola v + ½ h v'.
    #[test]
    fn displacements_are_those_of_the_cubic() {
        let mut c = Continuity::default();
        c.start(1.0, &[1.0], &[3.0], 0.0);
        let mut d = [0.0];
        c.predict(1.5, &mut d);
        assert!((d[0] - (0.5 + 0.125 * 3.0)).abs() < 1e-15);
        assert!(c.judge(2.0, &[8.0], &[12.0], &[1.0], 0.0));
        for t in [1.0, 1.2, 1.7, 2.0] {
            c.inside(t, &mut d);
            assert!((d[0] - (t * t * t * t - 1.0) / 4.0).abs() < 1e-14, "{t}: {}", d[0]);
        }
        c.accept();
        c.predict(2.5, &mut d);
        assert!((d[0] - (0.5 * 8.0 + 0.125 * 12.0 + 0.125 / 6.0 * 9.0)).abs() < 1e-14, "{}", d[0]);
    }

    #[test]
    fn turning_round_is_no_jump() {
        // v = cos t over its zero: whatever the ends
        for h in [1e-3, 0.1, 1.0] {
            for shift in [0.1, 0.5, 0.9] {
                let start = std::f64::consts::FRAC_PI_2 - shift * h;
                let mut c = Continuity::default();
                c.start(start, &[start.cos()], &[-start.sin()], 10.0);
                let end = start + h;
                assert!(c.judge(end, &[end.cos()], &[-end.sin()], &[1.0], 10.0), "{h} {shift}");
            }
        }
    }

    #[test]
    fn rest_has_no_direction() {
        let mut c = Continuity::default();
        c.start(0.0, &[1.0], &[0.0], 10.0);
        assert!(c.judge(1.0, &[1.0], &[0.0], &[1.0], 10.0));
        c.start(1.0, &[1e-12], &[0.0], 10.0);
        assert!(c.judge(2.0, &[-1e-12], &[0.0], &[1.0], 10.0));
    }
}
