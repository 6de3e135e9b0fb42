//! Elements of the forces that are described by records of their own.

use super::build::Maker;
use super::law::LawInput;
use super::spot::Spot;
use super::{Buffer, Bushing, Contact, Element, Gravity, Law, Line, Surface, TwoPoint, Tyre, Weightless};
use crate::error::DescriptionError;
use crate::numbers::Fields;
use crate::spec::{self, Force, Sight};
use crate::value::{places_uncounted, VectorSource};
use partita_math::scalar::Scalar;
use partita_math::spatial::{Mat3, Space, Vec3};
use std::collections::HashSet;

impl<G: Space> Maker<'_, G> {
    /// The element of a force.
    pub(super) fn element(&self, force: &Force, n: &Fields<G::S>) -> Result<Element<G>, DescriptionError> {
        let (placed, numbers) = (self.placed, self.numbers);
        let two_bodies = |name: &str, a: &str, b: &str| match a == b {
            true => Err(DescriptionError::new(
                "force",
                name,
                format!("both sides are on \"{a}\"; name two different bodies"),
            )),
            false => Ok(()),
        };
        Ok(match force {
            Force::Spring(x) => {
                Element::Spring(self.spring([&x.body1, &x.body2].map(|x| self.node(x)), n, x.damping != 0.0))
            }
            Force::Force(x) => self.point_force(x, n)?,
            Force::Bushing(x) => {
                two_bodies(&x.name, &x.body1, &x.body2)?;
                let any = |m: &[[f64; 6]; 6]| m.iter().flatten().any(|x| *x != 0.0);
                let skew = (0..6).any(|i| (0..i).any(|j| x.stiffness[i][j] != x.stiffness[j][i]));
                let frame = |body: &str, f: &[[f64; 3]; 3]| Mat3::<G::S>::from_f64(self.axes(body).mul(&Mat3(*f)).0);
                let matrix = |field: &str| {
                    let all = n.field(field);
                    std::array::from_fn(|i| std::array::from_fn(|j| all.get(6 * i + j).copied().unwrap_or_default()))
                };
                let twists = |m: &[[f64; 6]; 6]| (0..6).any(|i| (0..6).any(|j| (i > 2 || j > 2) && m[i][j] != 0.0));
                Element::Bushing(Box::new(Bushing {
                    name: x.name.clone(),
                    turns: twists(&x.stiffness) || twists(&x.damping),
                    ends: [self.spot(&x.body1, n.vector("point1")), self.spot(&x.body2, n.vector("point2"))],
                    frames: [frame(&x.body1, &x.frame1), frame(&x.body2, &x.frame2)],
                    stiffness: matrix("stiffness"),
                    damping: matrix("damping"),
                    damped: any(&x.damping) || skew,
                }))
            }
            Force::Contact(x) => {
                two_bodies(&x.name, &x.body1, &x.body2)?;
                let surface = match &x.normal {
                    Some(normal) => Surface::Plane(self.direction(&x.body2, normal)),
                    None => Surface::Sphere(n.number("radius2")),
                };
                Element::Contact(Box::new(Contact {
                    centre: self.spot(&x.body1, n.vector("point1")),
                    radius: n.number("radius1"),
                    other: self.spot(&x.body2, n.vector("point2")),
                    surface,
                    buffer: Buffer::new(n, x.exponent, x.damping),
                    friction: ["friction", "static_friction", "stick_velocity"].map(|field| n.number(field)),
                    rough: x.friction != 0.0 || x.static_friction != 0.0,
                }))
            }
            Force::Tyre(x) => {
                two_bodies(&x.name, &x.body, &x.ground)?;
                Element::Tyre(Box::new(Tyre {
                    centre: self.spot(&x.body, n.vector("center")),
                    axis: self.direction(&x.body, &x.axis),
                    radius: n.number("radius"),
                    road: self.spot(&x.ground, n.vector("point")),
                    normal: self.direction(&x.ground, &x.normal),
                    buffer: Buffer::new(n, 1.0, x.damping),
                    coefficients: ["friction", "longitudinal", "lateral", "slow_speed"].map(|field| n.number(field)),
                    has_slip_forces: x.friction != 0.0 && (x.longitudinal != 0.0 || x.lateral != 0.0),
                }))
            }
            Force::Law(x) => Element::Law(Box::new(self.law(x)?)),
            Force::Weightless(x) => {
                let node = self.node(&x.body);
                if node == 0 {
                    return Err(DescriptionError::new("force", &x.name, "the ground has no weight; name a body"));
                }
                let b = &numbers.bodies[node - 1];
                Element::Weightless(Weightless { on: self.attachment(node, b.com), mass: b.mass })
            }
            Force::Gravity(x) => {
                let massless: HashSet<&str> = self
                    .spec
                    .forces
                    .iter()
                    .filter_map(|f| if let Force::Weightless(w) = f { Some(w.body.as_str()) } else { None })
                    .collect();
                let heavy = (0..self.spec.bodies.len()).filter(|&i| {
                    self.spec.bodies[i].mass > 0.0 && !massless.contains(self.spec.bodies[i].name.as_str())
                });
                let on =
                    heavy.map(|i| (self.attachment(i + 1, numbers.bodies[i].com), numbers.bodies[i].mass)).collect();
                let axes = Mat3::from_f64(placed.basis.0);
                Element::Gravity(Box::new(Gravity {
                    name: x.name.clone(),
                    value: VectorSource::new(&x.value, &[]),
                    axes,
                    on,
                }))
            }
            other => match (Line::new(other, n), other.record().line()) {
                (Some(law), Some([(body1, _), (body2, _)])) => {
                    two_bodies(other.name(), body1, body2)?;
                    let [a, b] = [(body1, "point1"), (body2, "point2")].map(|(body, x)| self.spot(body, n.vector(x)));
                    Element::TwoPoint(Box::new(TwoPoint { a, b, law }))
                }
                _ => match self.load(other, n)? {
                    Some(load) => Element::Load(Box::new(load)),
                    None => return Err(DescriptionError::new("force", other.name(), "it acts on nothing")),
                },
            },
        })
    }

    /// What sensors read, for functions of the state.
    pub(super) fn sights_of_sensors(&self) -> Result<Vec<LawInput<G>>, DescriptionError> {
        let known = |sight: &Sight| match sight {
            Sight::Point(spec::Spot { body: name, .. }) | Sight::Body(name) => {
                self.measurements.nodes.contains_key(name.as_str())
            }
            Sight::Joint(name, _) => self.placed.joint_numbers.contains_key(name),
        };
        match self.spec.sights.iter().find(|sight| !known(sight)) {
            Some(sight) => {
                Err(DescriptionError::new("sensor", "", format!("it refers to {sight:?}, which does not exist")))
            }
            None => self.spec.sights.iter().map(|sight| self.sight("of a sensor", sight)).collect(),
        }
    }

    /// A point given in the axes of a body.
    fn spot(&self, body: &str, point: Vec3<G::S>) -> Spot<G> {
        let node = self.node(body);
        let zero = self.numbers.point_on(self.placed, node, point);
        // motions in the plane keep their offset from it
        Spot { attachment: self.attachment(node, zero), out: Vec3([G::S::zero(), G::S::zero(), G::out_of_space(zero)]) }
    }

    /// Axes of a body in the zero position, mechanism axes.
    fn axes(&self, body: &str) -> Mat3<f64> {
        match self.node(body) {
            0 => self.placed.basis,
            node => self.placed.bodies[node - 1].rot,
        }
    }

    /// A unit vector given in the axes of a body.
    fn direction(&self, body: &str, x: &[f64; 3]) -> Vec3<G::S> {
        let unit = Vec3(*x).unit().unwrap_or_else(Vec3::zero);
        Vec3::from_f64(self.axes(body).apply(unit).0)
    }

    fn sight(&self, name: &str, sight: &Sight) -> Result<LawInput<G>, DescriptionError> {
        Ok(match sight {
            Sight::Point(p) => LawInput::Point(self.spot(&p.body, Vec3::from_f64(p.point))),
            Sight::Body(body) => LawInput::Body(self.spot(body, Vec3::zero()), Mat3::from_f64(self.axes(body).0)),
            Sight::Joint(joint, i) => LawInput::Joint(self.measurements.joint(joint, *i, "force", name)?),
        })
    }

    fn law(&self, x: &spec::Law) -> Result<Law<G>, DescriptionError> {
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
            if self.node(&p.body) == 0 {
                return Err(DescriptionError::new(
                    "force",
                    &x.name,
                    "a force on the ground has no effect; name \
                    bodies",
                ));
            }
        }
        let on = x.on.iter().map(|p| self.spot(&p.body, Vec3::from_f64(p.point))).collect();
        let out = Mat3::from_f64(self.placed.basis.transpose().0);
        let spec::Value::Function(function) = x.value else {
            return Err(DescriptionError::new("force", &x.name, "its value is not a function"));
        };
        let uncounted = places_uncounted(0, sees.iter().map(LawInput::shown));
        Ok(Law { name: x.name.clone(), function, sees, sizes, uncounted, on, out })
    }
}
