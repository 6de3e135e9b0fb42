//! The description of a mechanism, built step by step.

use crate::compiled::Model;
use crate::error::Error;
use partita_model::spec::{Body, DRAWING_TOLERANCE, Drive, Force, Joint, JointKind, Rotor, Spec, VERSION};
use partita_model::value::{Functions, NoFunctions};
use partita_model::zero_position::Coordinates;
use std::sync::Arc;

/// A mechanism as drawn: rigid bodies, joints, forces and drives. Nothing is checked until it is compiled.
///
/// ```
/// use partita::{GROUND, Mechanism};
///
/// let pendulum = Mechanism::new("pendulum")
///     .gravity([0.0, -9.81, 0.0])
///     .rod("rod", [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], 2.0)
///     .revolute("pin", GROUND, "rod", [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
/// assert_eq!(pendulum.spec().bodies.len(), 1);
/// ```
#[derive(Clone, Debug)]
pub struct Mechanism {
    spec: Spec,
}

impl Mechanism {
    /// An empty mechanism without gravity.
    ///
    /// ```
    /// assert_eq!(partita::Mechanism::new("crane").spec().name, "crane");
    /// ```
    pub fn new(name: &str) -> Self {
        let spec = Spec {
            partita: VERSION,
            name: name.into(),
            gravity: [0.0; 3],
            drawing_tolerance: DRAWING_TOLERANCE,
            bodies: Vec::new(),
            joints: Vec::new(),
            couplings: Vec::new(),
            drives: Vec::new(),
            forces: Vec::new(),
            rotors: Vec::new(),
            sights: Vec::new(),
            parting: std::collections::BTreeMap::new(),
        };
        Self { spec }
    }

    /// The mechanism of a description in JSON, as [`to_json`](Self::to_json) writes it.
    ///
    /// # Errors
    /// `Json` with line and column for a text that is not a description; unknown keys are errors.
    ///
    /// ```
    /// use partita::Mechanism;
    ///
    /// let there = Mechanism::new("crane").to_json()?;
    /// assert_eq!(Mechanism::from_json(&there)?.spec().name, "crane");
    /// assert!(Mechanism::from_json(r#"{"partita": 1, "name": "x", "gravity": [0, 0, 0], "wheels": 4}"#).is_err());
    /// # Ok::<(), partita::Error>(())
    /// ```
    pub fn from_json(text: &str) -> Result<Self, Error> {
        Ok(Self { spec: Spec::from_json(text)? })
    }

    /// The description in JSON.
    ///
    /// # Errors
    /// `Json` where a number is NaN or infinite.
    ///
    /// ```
    /// assert!(partita::Mechanism::new("crane").to_json()?.contains("crane"));
    /// # Ok::<(), partita::Error>(())
    /// ```
    pub fn to_json(&self) -> Result<String, Error> {
        Ok(self.spec.to_json()?)
    }

    /// The description as data, with every feature of the model.
    ///
    /// ```
    /// assert!(partita::Mechanism::new("crane").spec().joints.is_empty());
    /// ```
    pub fn spec(&self) -> &Spec {
        &self.spec
    }

    /// The description as data, mutable.
    ///
    /// ```
    /// let mut m = partita::Mechanism::new("crane");
    /// m.spec_mut().drawing_tolerance = 0.0;
    /// ```
    pub fn spec_mut(&mut self) -> &mut Spec {
        &mut self.spec
    }

    /// Gravity [m/s²] in world axes.
    ///
    /// ```
    /// let m = partita::Mechanism::new("crane").gravity([0.0, 0.0, -9.81]);
    /// assert_eq!(m.spec().gravity[2], -9.81);
    /// ```
    pub fn gravity(mut self, gravity: [f64; 3]) -> Self {
        self.spec.gravity = gravity;
        self
    }

    /// Add a rigid body of any shape.
    ///
    /// ```
    /// use partita::{Body, Mechanism};
    ///
    /// let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    /// let ball = Body {
    ///     name: "ball".into(),
    ///     mass: 1.0,
    ///     com: [0.0; 3],
    ///     inertia: axes.map(|row| row.map(|x| 0.4 * x)),
    ///     position: [0.0; 3],
    ///     orientation: axes,
    ///     shape: None,
    /// };
    /// assert_eq!(Mechanism::new("ball").body(ball).spec().bodies[0].mass, 1.0);
    /// ```
    pub fn body(mut self, body: Body) -> Self {
        self.spec.bodies.push(body);
        self
    }

    /// Add a uniform slender rod between two points of the world as drawn; its frame stands at `start` with world axes.
    ///
    /// ```
    /// let m = partita::Mechanism::new("m").rod("rod", [0.0; 3], [3.0, 4.0, 0.0], 2.0);
    /// assert_eq!(m.spec().bodies[0].com, [1.5, 2.0, 0.0]);
    /// ```
    pub fn rod(self, name: &str, start: [f64; 3], end: [f64; 3], mass: f64) -> Self {
        let along = [0, 1, 2].map(|i| end[i] - start[i]);
        let square: f64 = along.iter().map(|x| x * x).sum();
        // m l² / 12 perpendicular to its axis, zero about it
        let inertia = [0, 1, 2]
            .map(|i| [0, 1, 2].map(|j| mass / 12.0 * (f64::from(u8::from(i == j)) * square - along[i] * along[j])));
        self.body(Body {
            name: name.into(),
            mass,
            com: along.map(|x| 0.5 * x),
            inertia,
            position: start,
            orientation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            shape: None,
        })
    }

    /// Add a joint of any kind; for its axes set the fields of [`Joint`].
    ///
    /// ```
    /// use partita::{GROUND, Joint, JointKind, Mechanism};
    ///
    /// let mut screw = Joint::new("screw", JointKind::Screw, GROUND, "nut", [0.0; 3]);
    /// (screw.axis, screw.pitch) = (Some([1.0, 0.0, 0.0]), Some(0.01));
    /// assert_eq!(Mechanism::new("jack").joint(screw).spec().joints.len(), 1);
    /// ```
    pub fn joint(mut self, joint: Joint) -> Self {
        self.spec.joints.push(joint);
        self
    }

    /// Add a hinge: rotation about an axis through a point.
    ///
    /// ```
    /// let m = partita::Mechanism::new("m").revolute("A", "ground", "crank", [0.0; 3], [0.0, 0.0, 1.0]);
    /// assert_eq!(m.spec().joints[0].name, "A");
    /// ```
    pub fn revolute(self, name: &str, parent: &str, child: &str, point: [f64; 3], axis: [f64; 3]) -> Self {
        self.axial(name, JointKind::Revolute, (parent, child), point, axis)
    }

    /// Add a slide along an axis.
    ///
    /// ```
    /// let m = partita::Mechanism::new("m").prismatic("guide", "ground", "piston", [0.0; 3], [1.0, 0.0, 0.0]);
    /// assert_eq!(m.spec().joints[0].axis, Some([1.0, 0.0, 0.0]));
    /// ```
    pub fn prismatic(self, name: &str, parent: &str, child: &str, point: [f64; 3], axis: [f64; 3]) -> Self {
        self.axial(name, JointKind::Prismatic, (parent, child), point, axis)
    }

    /// Add a ball joint.
    ///
    /// ```
    /// let m = partita::Mechanism::new("m").spherical("ball", "arm", "wheel", [0.0, 0.4, 0.2]);
    /// assert_eq!(m.spec().joints[0].point, [0.0, 0.4, 0.2]);
    /// ```
    pub fn spherical(self, name: &str, parent: &str, child: &str, point: [f64; 3]) -> Self {
        self.joint(Joint::new(name, JointKind::Spherical, parent, child, point))
    }

    /// Add an applied force: springs, torques, laws.
    ///
    /// ```
    /// use partita::model::spec::TorsionSpring;
    /// use partita::{Force, Mechanism};
    ///
    /// let spring = Force::TorsionSpring(TorsionSpring {
    ///     name: "spring".into(),
    ///     joint: "A".into(),
    ///     coordinate: 0,
    ///     stiffness: 10.0,
    ///     damping: 0.1,
    ///     angle: 0.0,
    /// });
    /// assert_eq!(Mechanism::new("m").force(spring).spec().forces.len(), 1);
    /// ```
    pub fn force(mut self, force: Force) -> Self {
        self.spec.forces.push(force);
        self
    }

    /// Add the rotor of a motor behind a gear: the joint moves `ratio² inertia` besides its bodies.
    ///
    /// ```
    /// use partita::model::spec::Rotor;
    /// use partita::Mechanism;
    ///
    /// let rotor = Rotor { name: "motor".into(), joint: "A".into(), coordinate: 0, inertia: 1e-4, ratio: 50.0 };
    /// assert_eq!(Mechanism::new("m").rotor(rotor).spec().rotors.len(), 1);
    /// ```
    pub fn rotor(mut self, rotor: Rotor) -> Self {
        self.spec.rotors.push(rotor);
        self
    }

    /// Prescribe a motion.
    ///
    /// ```
    /// use partita::model::spec::{Level, Measure, Value};
    /// use partita::{Drive, Mechanism};
    ///
    /// let turn = Drive::new("motor", Measure::joint("A", 0), Value::Constant(6.0), Level::Velocity);
    /// assert_eq!(Mechanism::new("m").drive(turn).spec().drives.len(), 1);
    /// ```
    pub fn drive(mut self, drive: Drive) -> Self {
        self.spec.drives.push(drive);
        self
    }

    /// Check the description and compile it, in joint coordinates.
    ///
    /// Cost: proportional to bodies and joints; loops whose drawing does not fit exactly are examined one by one.
    ///
    /// # Errors
    /// `Description` with the body, joint or force that is wrong and what to do.
    ///
    /// ```
    /// let rod = partita::Mechanism::new("m").rod("rod", [0.0; 3], [1.0, 0.0, 0.0], 1.0);
    /// let e = rod.revolute("A", "ground", "crank", [0.0; 3], [0.0, 0.0, 1.0]).compile();
    /// assert!(e.err().unwrap().to_string().contains("crank"));
    /// ```
    pub fn compile(&self) -> Result<Model, Error> {
        self.compile_with(Arc::new(NoFunctions))
    }

    /// As `compile`, with the functions to which forces and drives refer by number.
    ///
    /// # Errors
    /// As [`compile`](Self::compile).
    ///
    /// ```
    /// use partita::model::value::NoFunctions;
    ///
    /// assert!(partita::Mechanism::new("nothing").compile_with(std::sync::Arc::new(NoFunctions)).is_err());
    /// ```
    pub fn compile_with(&self, functions: Arc<dyn Functions>) -> Result<Model, Error> {
        Ok(Model::of(partita_model::Model::new(self.spec.clone(), functions, Coordinates::Relative)?))
    }

    fn axial(
        self,
        name: &str,
        kind: JointKind,
        (parent, child): (&str, &str),
        point: [f64; 3],
        axis: [f64; 3],
    ) -> Self {
        let mut joint = Joint::new(name, kind, parent, child, point);
        joint.axis = Some(axis);
        self.joint(joint)
    }
}
