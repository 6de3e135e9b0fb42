//! A wheel on a road.

use super::resistance::Buffer;
use super::spot::Spot;
use super::{At, Effect};
use partita_math::scalar::{Cases, Scalar};
use partita_math::spatial::{Space, Vec3};

/// A disc that presses on a plane, with forces against slip that saturate.
///
/// The normal force N acts at the lowest point of the free disc, so that it has a potential; forces against slip act where
/// the radius to that point meets the road. With the velocity `s` of the disc's material there, along the wheel and across
/// it, and the speed V of the centre along the road, they are `−z/√(1 + z²/(friction N)²)`,
/// `z = (longitudinal s_x, lateral s_y)/√(V² + slow²)`.
#[derive(Clone, Debug)]
pub struct Tyre<G: Space> {
    /// Centre of the wheel.
    pub centre: Spot<G>,
    /// Axis of the wheel, link axes.
    pub axis: Vec3<G::S>,
    /// Its free radius.
    pub radius: G::S,
    /// A point of the road.
    pub road: Spot<G>,
    /// Its normal, link axes.
    pub normal: Vec3<G::S>,
    /// Normal force over depth.
    pub buffer: Buffer<G::S>,
    /// Coefficient of friction, force over slip along the wheel and across it, slow speed.
    pub coefficients: [G::S; 4],
    /// Whether it has slip forces.
    pub has_slip_forces: bool,
}

/// Contact of a wheel and its road.
struct Meeting<S> {
    normal: Vec3<S>,
    axis: Vec3<S>,
    centre: Vec3<S>,
    height: S,
    /// Cosine of the camber.
    upright: S,
    /// Steepest direction in the plane of the wheel.
    down: Vec3<S>,
    depth: S,
    /// The lowest point of the free disc, and its velocity in the axes of the road.
    lowest: Vec3<S>,
    sinking: Vec3<S>,
}

impl<G: Space<S = f64>> Tyre<G> {
    /// Gap, its rate, and the speed at which the disc's lowest point moves over the road.
    pub(crate) fn gap(&self, at: &At<G>) -> [f64; 3] {
        let meeting = self.meet(at);
        [-meeting.depth, meeting.normal.dot(meeting.sinking), meeting.sinking.norm()]
    }
}

impl<G: Space> Tyre<G> {
    #[inline(always)]
    fn meet(&self, at: &At<G>) -> Meeting<G::S> {
        let (wheel, road) = (&self.centre.attachment, &self.road.attachment);
        let normal = at.axes(road.link).apply(self.normal);
        let axis = at.axes(wheel.link).apply(self.axis);
        let centre = at.spot(&self.centre);
        let height = normal.dot(centre - at.spot(&self.road));
        let steep = normal - axis.times(axis.dot(normal));
        let upright = steep.norm();
        let down = Vec3(steep.0.map(|x| x.over_or_zero(upright)));
        // the disc's lowest point sinks as the depth grows, also where the wheel leans
        let lowest = centre - down.times(self.radius);
        let sinking = at.moving(wheel.link, lowest) - at.moving(road.link, lowest);
        let depth = self.radius * upright - height;
        Meeting { normal, axis, centre, height, upright, down, depth, lowest, sinking }
    }

    #[inline(always)]
    pub(crate) fn wrench(&self, at: &At<G>) -> Effect<G> {
        let (wheel, road) = (&self.centre.attachment, &self.road.attachment);
        let Meeting { normal, axis, centre, height, upright, down, depth, lowest, sinking } = self.meet(at);
        let speed = -normal.dot(sinking);
        let pressed = self.buffer.pressed(depth, speed);
        let push = normal.times(pressed.push);
        // the wheel is below the road
        let point = centre - down.times(height.over_or_zero(upright));
        let (mut force, mut power) = (push, pressed.power);
        if self.has_slip_forces {
            let [friction, longitudinal, lateral, slow] = self.coefficients;
            let forward = axis.cross(normal).direction();
            let across = normal.cross(forward);
            let slip = at.moving(wheel.link, point) - at.moving(road.link, point);
            let travel = forward.dot(at.moving(wheel.link, centre) - at.moving(road.link, centre));
            let rolled = G::S::one() / (travel * travel + slow * slow).sqrt();
            let x = longitudinal * forward.dot(slip) * rolled;
            let y = lateral * across.dot(slip) * rolled;
            let limit = friction * pressed.push;
            let part = limit.over_or_zero((limit * limit + x * x + y * y).sqrt());
            let tangential = (forward.times(x) + across.times(y)).times(-part);
            force += tangential;
            power += tangential.dot(slip);
        }
        let moment = (lowest - point).cross(push);
        Effect { application: at.pair(wheel, road, point, moment, force), potential: pressed.potential, power }
    }
}
