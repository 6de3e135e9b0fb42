//! A sphere against a plane or another sphere.

use super::resistance::{Buffer, Slide};
use super::spot::{self, Spot};
use super::{At, Effect};
use partita_math::scalar::{Cases, Scalar};
use partita_math::spatial::{Space, Vec3};
use partita_system::error::six_digits;

/// The other side of the contact.
#[derive(Clone, Copy, Debug)]
pub enum Surface<S> {
    /// A plane with this normal, link axes, towards the free side.
    Plane(Vec3<S>),
    /// A sphere of this radius.
    Sphere(S),
}

/// Compliant contact with friction. On a plane the force acts at the plane, between spheres midway in their overlap.
#[derive(Clone, Debug)]
pub struct Contact<G: Space> {
    /// Centre of the sphere.
    pub centre: Spot<G>,
    /// Its radius.
    pub radius: G::S,
    /// A point of the plane, or the other centre.
    pub other: Spot<G>,
    /// The other side.
    pub surface: Surface<G::S>,
    /// Normal force over depth.
    pub buffer: Buffer<G::S>,
    /// Coefficients of friction, kinetic and static, and the stick velocity.
    pub friction: [G::S; 3],
    /// Whether there is friction.
    pub rough: bool,
}

impl<G: Space<S = f64>> Contact<G> {
    /// Whether it pushes by its depth; a rigid one is held by a row.
    pub(crate) fn yields(&self) -> bool {
        self.buffer.stiffness != 0.0
    }

    /// Gap, its rate, the distance of the surfaces and the largest speed at which it changes. The gap of spheres is
    /// `(d² − ρ²) / 2ρ` with the distance d of the centres and the sum ρ of the radii: a smooth function of the motion
    /// where the distance has a corner, with the same sign.
    pub(crate) fn gap(&self, at: &At<G>) -> [f64; 4] {
        let (one, two) = (&self.centre.attachment, &self.other.attachment);
        let centre = at.spot(&self.centre);
        let apart = centre - at.spot(&self.other);
        match self.surface {
            Surface::Plane(n) => {
                let n = at.axes(two.link).apply(n);
                let moving = at.moving(one.link, centre) - at.moving(two.link, centre);
                let gap = n.dot(apart) - self.radius;
                [gap, n.dot(moving), gap, at.fastest(one.link, centre) + at.fastest(two.link, centre)]
            }
            Surface::Sphere(radius) => {
                let sum = self.radius + radius;
                let other = at.spot(&self.other);
                let moving = at.moving(one.link, centre) - at.moving(two.link, other);
                let gap = (apart.dot(apart) - sum * sum) / (2.0 * sum);
                let fastest = at.fastest(one.link, centre) + at.fastest(two.link, other);
                [gap, apart.dot(moving) / sum, apart.norm() - sum, fastest]
            }
        }
    }

    /// Speed of one surface along the other where they touch.
    pub(crate) fn slip(&self, at: &At<G>) -> f64 {
        let (one, two) = (&self.centre.attachment, &self.other.attachment);
        let centre = at.spot(&self.centre);
        let apart = centre - at.spot(&self.other);
        let normal = match self.surface {
            Surface::Plane(n) => at.axes(two.link).apply(n),
            Surface::Sphere(_) => apart.direction(),
        };
        let point = centre - normal.times(self.radius);
        let slip = at.moving(one.link, point) - at.moving(two.link, point);
        (slip - normal.times(normal.dot(slip))).norm()
    }

    /// The gap of spheres that overlap almost entirely, and the message for it.
    pub(crate) fn passed_through(&self) -> Option<(f64, String)> {
        let Surface::Sphere(radius) = self.surface else { return None };
        let (sum, smaller) = (self.radius + radius, self.radius.min(radius));
        let distance = (sum - 2.0 * smaller).max(0.5 * smaller);
        let energy = six_digits(self.buffer.pressed(sum, 0.0).potential);
        let sentence = format!(
            "its spheres overlap almost entirely and could separate on the far side; up to there it stores {energy} \
             J: increase its stiffness if the bodies collide with more energy"
        );
        Some(((distance * distance - sum * sum) / (2.0 * sum), sentence))
    }
}

impl<G: Space> Contact<G> {
    #[inline(always)]
    pub(crate) fn wrench(&self, at: &At<G>) -> Effect<G> {
        let (one, two) = (&self.centre.attachment, &self.other.attachment);
        let centre = at.spot(&self.centre);
        let gap = centre - at.spot(&self.other);
        let (normal, depth, inside) = match self.surface {
            Surface::Plane(n) => {
                let n = at.axes(two.link).apply(n);
                let depth = self.radius - n.dot(gap);
                (n, depth, depth)
            }
            Surface::Sphere(radius) => {
                let distance = gap.norm();
                let depth = self.radius + radius - distance;
                (Vec3(gap.0.map(|x| x.over_or_zero(distance))), depth, depth.scale(0.5))
            }
        };
        let point = centre - normal.times(self.radius - inside);
        let slip = at.moving(one.link, point) - at.moving(two.link, point);
        let speed = -normal.dot(slip);
        let pressed = self.buffer.pressed(depth, speed);
        let (mut force, mut power) = (normal.times(pressed.push), pressed.power);
        if self.rough {
            let along = slip + normal.times(speed);
            let square = along.dot(along);
            let [dynamic, held, stick] = self.friction;
            let drag = pressed.push * Slide { dynamic, held, stick }.per_speed(square);
            force -= along.times(drag);
            power -= drag * square;
        }
        Effect { application: at.pair(one, two, point, spot::none(), force), potential: pressed.potential, power }
    }
}
