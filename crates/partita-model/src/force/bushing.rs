//! Stiffness and damping in all six directions between two frames.

use super::spot::Spot;
use super::{At, Effect};
use partita_math::scalar::{Functions, Scalar};
use partita_math::spatial::{Mat3, Quaternion, Space, Vec3};
use partita_math::tolerance;
use partita_system::SystemError;

/// With `x = (d, θ)`, the displacement of frame 2 and the rotation vector of its rotation, both in the axes of frame 1,
/// body 2 feels `−K x − C x'` along x, body 1 the opposite at the same point of space.
#[derive(Clone, Debug)]
pub struct Bushing<G: Space> {
    /// Name, for messages.
    pub name: String,
    /// Whether it resists rotation. Then it connects frames rotated by less than half a turn.
    pub turns: bool,
    /// Origins of the frames.
    pub ends: [Spot<G>; 2],
    /// Axes of the two frames, link axes.
    pub frames: [Mat3<G::S>; 2],
    /// Stiffness.
    pub stiffness: [[G::S; 6]; 6],
    /// Damping.
    pub damping: [[G::S; 6]; 6],
    /// Whether it does non-conservative work.
    pub damped: bool,
}

impl<G: Space<S = f64>> Bushing<G> {
    /// The angle of its rotation, the rate of that, and the speed of rotation.
    pub(crate) fn twist(&self, at: &At<G>) -> [f64; 3] {
        let [one, two] = [&self.ends[0].attachment, &self.ends[1].attachment];
        let frame = at.axes(one.link).mul(&self.frames[0]);
        let (turn, _) = rotation_vector(&frame.transpose().mul(&at.axes(two.link).mul(&self.frames[1])));
        let spin = frame.apply_transposed(at.spinning(two.link) - at.spinning(one.link));
        let angle = turn.norm();
        let rate = if angle > 0.0 { turn.dot(spin) / angle } else { spin.norm() };
        [angle, rate, spin.norm()]
    }
}

impl<G: Space> Bushing<G> {
    #[inline(always)]
    pub(crate) fn wrench(&self, at: &At<G>) -> Result<Effect<G>, SystemError> {
        let [one, two] = [&self.ends[0].attachment, &self.ends[1].attachment];
        let frame = at.axes(one.link).mul(&self.frames[0]);
        let turned = frame.transpose().mul(&at.axes(two.link).mul(&self.frames[1]));
        let point = at.spot(&self.ends[1]);
        let displaced = frame.apply_transposed(point - at.spot(&self.ends[0]));
        let (turn, curl) = rotation_vector(&turned);
        if let (true, Some(by)) = (self.turns, turn.norm().outside(-tolerance::HALF_TURN, tolerance::HALF_TURN)) {
            return Err(SystemError::Twisted { what: self.name.clone(), by });
        }
        // the motion relative to frame 1
        let drift = frame.apply_transposed(at.moving(two.link, point) - at.moving(one.link, point));
        let spin = frame.apply_transposed(at.spinning(two.link) - at.spinning(one.link));
        let x = six(displaced, turn);
        let rate = six(drift, turn_rate(turn, curl, spin));
        let (elastic, other) = (times(&self.stiffness, &x), times(&self.damping, &rate));
        let mut power = -dot(&rate, &other);
        // of a K that is not symmetric only the symmetric part has a potential
        for i in 0..6 {
            for j in 0..i {
                let skew = (self.stiffness[i][j] - self.stiffness[j][i]).scale(0.5);
                power -= skew * (rate[i] * x[j] - rate[j] * x[i]);
            }
        }
        let along: [G::S; 6] = std::array::from_fn(|i| -(elastic[i] + other[i]));
        let force = frame.apply(Vec3([along[0], along[1], along[2]]));
        let moment = frame.apply(moment_of(turn, curl, Vec3([along[3], along[4], along[5]])));
        let application = at.pair(two, one, point, moment, force);
        Ok(Effect { application, potential: dot(&x, &elastic).scale(0.5), power })
    }
}

fn six<S: Scalar>(a: Vec3<S>, b: Vec3<S>) -> [S; 6] {
    let ([x, y, z], [u, v, w]) = (a.0, b.0);
    [x, y, z, u, v, w]
}

fn dot<S: Scalar>(a: &[S; 6], b: &[S; 6]) -> S {
    (1..6).fold(a[0] * b[0], |sum, i| sum + a[i] * b[i])
}

fn times<S: Scalar>(m: &[[S; 6]; 6], x: &[S; 6]) -> [S; 6] {
    std::array::from_fn(|i| dot(&m[i], x))
}

/// The rotation vector θ of a rotation by less than half a turn, and `(1 − ½θ cot ½θ)/θ²`.
fn rotation_vector<S: Scalar>(r: &Mat3<S>) -> (Vec3<S>, S) {
    let Quaternion([w, x, y, z]) = Quaternion::from_matrix(r);
    // of the two quaternions of a rotation the one with the smaller angle
    let sign = w.where_positive(S::one(), -S::one());
    let (half, cos) = (Vec3([x, y, z]).times(sign), w * sign);
    let sin2 = half.dot(half);
    let sin = sin2.sqrt();
    let angle = sin.atan2(cos).scale(2.0);
    // by series where quotients would lose digits: the remainder is below the round-off of the sum
    let near = S::from_f64(tolerance::SHORT_TURN * tolerance::SHORT_TURN) - sin2;
    let series = S::from_f64(2.0) + sin2.scale(1.0 / 3.0) + (sin2 * sin2).scale(3.0 / 20.0);
    let turn = half.times(near.where_positive(series, angle.over_or_zero(sin)));
    let square = turn.dot(turn);
    let small = S::from_f64(tolerance::SERIES_ANGLE * tolerance::SERIES_ANGLE) - square;
    let mut series = square.scale(1.0 / 47_900_160.0);
    for term in [1.0 / 1_209_600.0, 1.0 / 30_240.0, 1.0 / 720.0] {
        series = (series + S::from_f64(term)) * square;
    }
    series += S::from_f64(1.0 / 12.0);
    let half_cot = (angle * cos).over_or_zero(sin).scale(0.5);
    (turn, small.where_positive(series, (S::one() - half_cot).over_or_zero(square)))
}

/// Rate of the rotation vector at the angular velocity `w`, both in the axes at rest: `w − ½θ×w + c θ×(θ×w)`.
fn turn_rate<S: Scalar>(turn: Vec3<S>, curl: S, w: Vec3<S>) -> Vec3<S> {
    let once = turn.cross(w);
    w - once.times(S::from_f64(0.5)) + turn.cross(once).times(curl)
}

/// The moment whose power is that of `along` on the rates of the rotation vector: the transpose.
fn moment_of<S: Scalar>(turn: Vec3<S>, curl: S, along: Vec3<S>) -> Vec3<S> {
    let once = turn.cross(along);
    along + once.times(S::from_f64(0.5)) + turn.cross(once).times(curl)
}

#[cfg(test)]
mod tests {
    use super::*;
    use partita_math::scalar::Dual;

    /// The rate by dual numbers, through the quaternion of the turn.
    #[test]
    fn a_rotation_vector_and_its_rate() {
        let mut rng = fastrand::Rng::with_seed(7);
        for k in 0..200 {
            let size = [1e-9, 1e-3, 0.099, 0.101, 1.0, 3.0][k % 6];
            let axis = Vec3([0; 3].map(|_| rng.f64() - 0.5)).unit().unwrap();
            let w = Vec3([0; 3].map(|_| rng.f64() - 0.5));
            let q = Quaternion::exp(axis.times(size));
            let (turn, curl) = rotation_vector(&q.matrix());
            assert!((turn - axis.times(size)).norm() < 4e-15 * (1.0 + size));
            // w in the axes that stay
            let inner = q.matrix().apply_transposed(w);
            let rate = q.rate(inner);
            let moved = Quaternion(std::array::from_fn(|i| Dual::new(q.0[i], [rate[i]])));
            let (by_dual, _) = rotation_vector(&moved.matrix());
            let rate = turn_rate(turn, curl, w);
            let slope = Vec3(by_dual.0.map(|x| x.eps[0]));
            assert!((rate - slope).norm() < 1e-11, "{size}: {rate:?} {slope:?}");
            let along = Vec3([0; 3].map(|_| rng.f64() - 0.5));
            assert!((moment_of(turn, curl, along).dot(w) - along.dot(rate)).abs() < 1e-13);
        }
    }
}
