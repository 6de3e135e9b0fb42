//! Elements of the forces that are described by records of their own.

use super::law::Seen;
use super::reading::KNOWN;
use super::spot::Spot;
use super::{
    Bearing, Buffer, Bushing, Contact, Element, Friction, Gravity, Law, Place, Reading, Stop, Surface, Tyre, Weightless,
};
use crate::error::DescriptionError;
use crate::numbers::{DescribedForce, Numbers};
use crate::spec::{self, Force, Sight, Spec};
use crate::value::{Source, VectorSource};
use crate::zero_position::Placed;
use partita_math::scalar::Scalar;
use partita_math::spatial::{Mat3, Space, Vec3};
use std::collections::{HashMap, HashSet};

/// What the elements are made from.
struct Maker<'a, S> {
    nodes: &'a HashMap<&'a str, usize>,
    placed: &'a Placed,
    numbers: &'a Numbers<S>,
}

/// The element of a force, if it is one of these and acts on anything.
pub(super) fn element<G: Space>(
    spec: &Spec,
    nodes: &HashMap<&str, usize>,
    placed: &Placed,
    numbers: &Numbers<G::S>,
    force: &Force,
    n: &DescribedForce<G::S>,
) -> Result<Option<Element<G>>, DescriptionError> {
    let maker = Maker { nodes, placed, numbers };
    let two_bodies = |name: &str, a: &str, b: &str| match a == b {
        true => {
            Err(DescriptionError::new("force", name, format!("both sides are on \"{a}\"; name two different bodies")))
        }
        false => Ok(()),
    };
    Ok(Some(match force {
        Force::Spring { .. } | Force::TorsionSpring { .. } | Force::Torque { .. } | Force::Force { .. } => {
            return Ok(None);
        }
        Force::Bushing(x) => {
            two_bodies(&x.name, &x.body1, &x.body2)?;
            let any = |m: &[[f64; 6]; 6]| m.iter().flatten().any(|x| *x != 0.0);
            let skew = (0..6).any(|i| (0..i).any(|j| x.stiffness[i][j] != x.stiffness[j][i]));
            let frame = |body: &str, f: &[[f64; 3]; 3]| Mat3::<G::S>::from_f64(maker.axes(body).mul(&Mat3(*f)).0);
            let matrix = |field: &str| {
                let all = n.of_load.field(field);
                std::array::from_fn(|i| std::array::from_fn(|j| all.get(6 * i + j).copied().unwrap_or_default()))
            };
            let twists = |m: &[[f64; 6]; 6]| (0..6).any(|i| (0..6).any(|j| (i > 2 || j > 2) && m[i][j] != 0.0));
            Element::Bushing(Box::new(Bushing {
                name: x.name.clone(),
                turns: twists(&x.stiffness) || twists(&x.damping),
                ends: [maker.spot(&x.body1, n.vector("point1")), maker.spot(&x.body2, n.vector("point2"))],
                frames: [frame(&x.body1, &x.frame1), frame(&x.body2, &x.frame2)],
                stiffness: matrix("stiffness"),
                damping: matrix("damping"),
                damped: any(&x.damping) || skew,
            }))
        }
        Force::Friction(x) => {
            let along = maker.reading(&x.name, (&x.joint, x.coordinate), G::S::zero())?;
            let mut levels = vec![Source::new(&x.dynamic, n.number("dynamic"))];
            levels.extend(x.held.as_ref().map(|v| Source::new(v, n.number("static"))));
            let follows = x.follows.as_ref().map(|f| {
                let given = |what: Option<f64>, field| what.map(|_| n.number(field));
                let coefficient = n.number("coefficient");
                Bearing {
                    coefficient,
                    held: given(f.held, "static_coefficient").unwrap_or(coefficient),
                    radius: given(f.radius, "radius"),
                    length: given(f.length, "length"),
                    collar: given(f.collar, "collar"),
                    preload: n.number("preload"),
                    place: 0,
                }
            });
            Element::Friction(Box::new(Friction {
                name: x.name.clone(),
                along,
                levels,
                follows,
                stick: n.number("stick_velocity"),
            }))
        }
        Force::Stop(x) => {
            let end = |given: Option<f64>, field| given.map(|_| n.number(field));
            let (lower, upper) = (end(x.lower, "lower"), end(x.upper, "upper"));
            let middle = match (lower, upper) {
                (Some(a), Some(b)) => (a + b).scale(0.5),
                (a, b) => a.or(b).unwrap_or_default(),
            };
            let along: Reading<G> = maker.reading(&x.name, (&x.joint, x.coordinate), middle)?;
            if let (true, Some(a), Some(b)) = (along.wraps(), x.lower, x.upper) {
                if b - a >= 2.0 * std::f64::consts::PI {
                    let m = format!(
                        "the angle of joint \"{}\", which is cut, is read off the pose up to full turns, so that ends \
                         {:.3} rad apart cannot be told; keep the joint in the tree (cut=\"never\", relative \
                         coordinates)",
                        x.joint,
                        b - a
                    );
                    return Err(DescriptionError::new("force", &x.name, m));
                }
            }
            let buffer = maker.buffer(n, x.exponent, x.damping);
            let half = x.lower.zip(x.upper).map_or(0.0, |(a, b)| 0.5 * (b - a));
            // beyond an end there is room for what it gives way
            let middle = (middle, KNOWN.max(0.5 * (half + std::f64::consts::PI)));
            Element::Stop(Box::new(Stop { name: x.name.clone(), along, lower, upper, middle, buffer }))
        }
        Force::Contact(x) => {
            two_bodies(&x.name, &x.body1, &x.body2)?;
            let surface = match &x.normal {
                Some(normal) => Surface::Plane(maker.direction(&x.body2, normal)),
                None => Surface::Sphere(n.number("radius2")),
            };
            Element::Contact(Box::new(Contact {
                centre: maker.spot(&x.body1, n.vector("point1")),
                radius: n.number("radius1"),
                other: maker.spot(&x.body2, n.vector("point2")),
                surface,
                buffer: maker.buffer(n, x.exponent, x.damping),
                friction: ["friction", "static_friction", "stick_velocity"].map(|field| n.number(field)),
                rough: x.friction != 0.0 || x.static_friction != 0.0,
            }))
        }
        Force::Tyre(x) => {
            two_bodies(&x.name, &x.body, &x.ground)?;
            Element::Tyre(Box::new(Tyre {
                centre: maker.spot(&x.body, n.vector("center")),
                axis: maker.direction(&x.body, &x.axis),
                radius: n.number("radius"),
                road: maker.spot(&x.ground, n.vector("point")),
                normal: maker.direction(&x.ground, &x.normal),
                buffer: maker.buffer(n, 1.0, x.damping),
                grip: ["friction", "longitudinal", "lateral", "slow_speed"].map(|field| n.number(field)),
                grips: x.friction != 0.0 && (x.longitudinal != 0.0 || x.lateral != 0.0),
            }))
        }
        Force::Law(x) => Element::Law(Box::new(maker.law(x)?)),
        Force::Weightless(x) => {
            let node = nodes[x.body.as_str()];
            if node == 0 {
                return Err(DescriptionError::new("force", &x.name, "the ground has no weight; name a body"));
            }
            let b = &numbers.bodies[node - 1];
            Element::Weightless(Weightless { on: maker.place(node, b.com), mass: b.mass })
        }
        Force::Gravity(x) => {
            let massless: HashSet<&str> = spec
                .forces
                .iter()
                .filter_map(|f| if let Force::Weightless(w) = f { Some(w.body.as_str()) } else { None })
                .collect();
            let heavy = (0..spec.bodies.len())
                .filter(|&i| spec.bodies[i].mass > 0.0 && !massless.contains(spec.bodies[i].name.as_str()));
            let on = heavy.map(|i| (maker.place(i + 1, numbers.bodies[i].com), numbers.bodies[i].mass)).collect();
            let axes = Mat3::from_f64(placed.basis.0);
            Element::Gravity(Box::new(Gravity {
                name: x.name.clone(),
                value: VectorSource::new(&x.value, n.value),
                axes,
                on,
            }))
        }
    }))
}

/// What sensors look at, for functions of the state.
pub(super) fn sensed<G: Space>(
    spec: &Spec,
    nodes: &HashMap<&str, usize>,
    placed: &Placed,
    numbers: &Numbers<G::S>,
) -> Result<Vec<Seen<G>>, DescriptionError> {
    let maker = Maker { nodes, placed, numbers };
    let known = |sight: &Sight| match sight {
        Sight::Point(spec::Spot { body: name, .. }) | Sight::Body(name) => nodes.contains_key(name.as_str()),
        Sight::Joint(name, _) => placed.joint_numbers.contains_key(name),
    };
    match spec.sights.iter().find(|sight| !known(sight)) {
        Some(sight) => Err(DescriptionError::new("sensor", "", format!("it looks at {sight:?}, which there is not"))),
        None => spec.sights.iter().map(|sight| maker.sight("of a sensor", sight)).collect(),
    }
}

impl<S: Scalar> Maker<'_, S> {
    /// A point of the zero position on a node's link.
    fn place<G: Space<S = S>>(&self, node: usize, point: Vec3<S>) -> Place<G> {
        let link = self.placed.link_of(node);
        Place { node, link, at: G::vec_in(point - self.numbers.reference[link]) }
    }

    /// A point given in the axes of a body.
    fn spot<G: Space<S = S>>(&self, body: &str, point: Vec3<S>) -> Spot<G> {
        let node = self.nodes[body];
        let zero = self.numbers.point_on(self.placed, node, point);
        // motions in the plane keep what is out of it
        Spot { place: self.place(node, zero), out: Vec3([S::zero(), S::zero(), out_of::<G>(zero)]) }
    }

    /// Axes of a body in the zero position, mechanism axes.
    fn axes(&self, body: &str) -> Mat3<f64> {
        match self.nodes[body] {
            0 => self.placed.basis,
            node => self.placed.bodies[node - 1].rot,
        }
    }

    /// A unit vector given in the axes of a body.
    fn direction(&self, body: &str, x: &[f64; 3]) -> Vec3<S> {
        let unit = Vec3(*x).unit().unwrap_or_else(Vec3::zero);
        Vec3::from_f64(self.axes(body).apply(unit).0)
    }

    fn reading<G: Space<S = S>>(
        &self,
        force: &str,
        joint: (&str, usize),
        middle: S,
    ) -> Result<Reading<G>, DescriptionError> {
        Reading::new(self.placed, self.numbers, force, joint, middle)
    }

    fn buffer(&self, n: &DescribedForce<S>, exponent: f64, damping: f64) -> Buffer<S> {
        Buffer { stiffness: n.number("stiffness"), damping: n.number("damping"), exponent, damped: damping != 0.0 }
    }

    fn sight<G: Space<S = S>>(&self, name: &str, sight: &Sight) -> Result<Seen<G>, DescriptionError> {
        Ok(match sight {
            Sight::Point(p) => Seen::Point(self.spot(&p.body, Vec3::from_f64(p.point))),
            Sight::Body(body) => Seen::Body(self.spot(body, Vec3::zero()), Mat3::from_f64(self.axes(body).0)),
            Sight::Joint(joint, i) => Seen::Joint(self.reading(name, (joint, *i), S::zero())?),
        })
    }

    fn law<G: Space<S = S>>(&self, x: &spec::Law) -> Result<Law<G>, DescriptionError> {
        let (mut sees, mut sizes) = (Vec::with_capacity(x.sees.len()), Vec::new());
        let length = self.placed.length;
        for sight in &x.sees {
            sees.push(self.sight(&x.name, sight)?);
            match sight {
                Sight::Point(_) => sizes.extend([length; 6]),
                Sight::Body(_) => {
                    sizes.extend([length; 3].into_iter().chain([1.0; 9]).chain([length; 3]).chain([1.0; 3]));
                }
                Sight::Joint(..) => sizes.extend([1.0; 2]),
            }
        }
        for p in &x.on {
            if self.nodes[p.body.as_str()] == 0 {
                return Err(DescriptionError::new("force", &x.name, "the ground does not feel a force; name bodies"));
            }
        }
        let on = x.on.iter().map(|p| self.spot(&p.body, Vec3::from_f64(p.point))).collect();
        let out = Mat3::from_f64(self.placed.basis.transpose().0);
        let spec::Value::Function(function) = x.value else {
            return Err(DescriptionError::new("force", &x.name, "its value is no function"));
        };
        Ok(Law { name: x.name.clone(), function, sees, sizes, on, out })
    }
}

/// What the space does not carry of a length.
fn out_of<G: Space>(x: Vec3<G::S>) -> G::S {
    G::out_of_space(x)
}
