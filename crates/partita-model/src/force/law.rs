//! A function of the quantities that it reads.

use super::spot::Spot;
use super::{At, Effect, ForceApplication, ForceScratch};
use crate::measurement::Measurement;
use crate::value::{alike_a_turn_on, failed};
use partita_math::scalar::{Arguments, Functions, Scalar};
use partita_math::spatial::{Mat3, Space, Vec3};
use partita_system::SystemError;

/// One quantity that a law reads.
#[derive(Clone, Debug)]
pub enum LawInput<G: Space> {
    /// Position and velocity of a point.
    Point(Spot<G>),
    /// Position of the origin, axes row by row, velocity of the origin, angular velocity; and the axes on its link.
    Body(Spot<G>, Mat3<G::S>),
    /// Value and rate of a joint's coordinate.
    Joint(Measurement<G>),
}

impl<G: Space> LawInput<G> {
    /// Link that is read.
    pub fn links(&self) -> Vec<usize> {
        match self {
            Self::Point(p) | Self::Body(p, _) => vec![p.attachment.link],
            Self::Joint(r) => r.links.to_vec(),
        }
    }

    /// How many numbers it shows, and whether the first is an angle whose whole turns are not counted.
    pub(crate) fn shown(&self) -> (usize, bool) {
        match self {
            Self::Point(_) => (6, false),
            Self::Body(..) => (18, false),
            Self::Joint(reading) => (2, reading.wraps),
        }
    }

    /// The readings, in world axes, appended to the numbers in `out`; `out` leads from mechanism axes to those of the
    /// world.
    pub(crate) fn show(&self, at: &At<G>, out: &Mat3<G::S>, numbers: &mut Vec<G::S>) {
        let world = |x: Vec3<G::S>| out.apply(x).0;
        match self {
            Self::Point(p) => {
                let x = at.spot(p);
                numbers.extend(world(x));
                numbers.extend(world(at.moving(p.attachment.link, x)));
            }
            Self::Body(p, axes) => {
                let x = at.spot(p);
                numbers.extend(world(x));
                let axes = out.mul(&at.axes(p.attachment.link)).mul(axes);
                numbers.extend(axes.0.into_iter().flatten());
                numbers.extend(world(at.moving(p.attachment.link, x)));
                numbers.extend(world(at.spinning(p.attachment.link)));
            }
            Self::Joint(reading) => {
                let read = reading.read(at.tree, at.s, at.instant.q, at.instant.v);
                numbers.extend([read.value, read.rate]);
            }
        }
    }
}

/// Numbers of a wrench.
const WRENCH: usize = 6;

/// Forces and moments by a function of its readings, all in world axes.
#[derive(Clone, Debug)]
pub struct Law<G: Space> {
    /// Name, for messages.
    pub name: String,
    /// Number of the function.
    pub function: usize,
    /// Its readings.
    pub sees: Vec<LawInput<G>>,
    /// Sizes of the numbers it reads.
    pub sizes: Vec<f64>,
    /// Places among them of angles whose whole turns are not counted.
    pub uncounted: Vec<usize>,
    /// Points at which it acts.
    pub on: Vec<Spot<G>>,
    /// World axes from mechanism axes.
    pub out: Mat3<G::S>,
}

impl<G: Space> Law<G> {
    pub(crate) fn wrench(&self, at: &At<G>, memory: &mut ForceScratch<G>) -> Result<Effect<G>, SystemError> {
        let ForceScratch { plain, seen, answers, wrenches, .. } = memory;
        seen.clear();
        self.sees.iter().for_each(|sight| sight.show(at, &self.out, seen));
        answers.clear();
        answers.resize(WRENCH * self.on.len(), G::S::zero());
        let given = Arguments { t: at.instant.t, q: &seen[..], v: &[], q_sizes: &self.sizes, v_sizes: &[] };
        let functions = &at.instant.callers.functions;
        G::S::call_into(given, plain, answers, |t, seen, _, out| {
            let ask = |seen: &[f64], out: &mut [f64]| {
                functions.law(self.function, t, seen, out).map_err(|e| failed(&self.name, e))
            };
            ask(seen, out)?;
            alike_a_turn_on(self.uncounted.iter().copied(), seen, out, &self.name, ask)?;
            match out.iter().all(|x| x.is_finite()) {
                true => Ok(()),
                false => Err(SystemError::NotFinite { what: self.name.clone(), t }),
            }
        })?;
        wrenches.clear();
        let mut power = G::S::zero();
        for (p, w) in self.on.iter().zip(answers.chunks_exact(WRENCH)) {
            let own = |w: &[G::S]| self.out.apply_transposed(Vec3([w[0], w[1], w[2]]));
            let (force, moment, x) = (own(&w[..3]), own(&w[3..]), at.spot(p));
            let push = at.wrench_at(&p.attachment, x, moment, force);
            // only in the plane of a planar mechanism is there work
            power += G::dot(push.force, at.velocity(p.attachment.link, push.arm));
            power += G::dot_ang(push.moment, at.s.links[p.attachment.link].w);
            wrenches.push(push);
        }
        Ok(Effect { application: ForceApplication::Listed, potential: G::S::zero(), power })
    }
}
