//! Mechanisms drawn by chance, so that no symmetry helps, and states in which they stand and move.
#![allow(dead_code, reason = "each test file uses the part it needs")]

use partita_math::spatial::{Mat3, Quaternion, Vec3};
use partita_model::observe::BodyState;
use partita_model::place::Coordinates;
use partita_model::spec::{
    Axes, Body, Bushing, Contact, Coupling, Cut, Drive, Force, Friction, Gravity, Joint, JointKind, Law, Level,
    Measure, Sight, Spec, Spot, Stop, Table, Tyre, Value, VectorValue, Weightless, DRAWING_TOLERANCE, VERSION,
};
use partita_model::value::{Functions, RELATION};
use partita_model::Model;
use partita_system::kinematics::assembly;
use partita_system::reduction::Reduction;
use partita_system::{start, ConstrainedSystem};
use std::sync::Arc;

type Failed = Box<dyn std::error::Error + Send + Sync>;

/// Smooth functions of time alone: they mean the same in any coordinates.
pub struct OfTime;

impl Functions for OfTime {
    fn count(&self) -> usize {
        3
    }
    fn scalar(&self, i: usize, t: f64, _: &[f64], _: &[f64]) -> Result<f64, Failed> {
        Ok(2.0 * (1.3 * t + i as f64).sin())
    }
    fn vector(&self, i: usize, t: f64, _: &[f64], _: &[f64]) -> Result<[f64; 3], Failed> {
        Ok([3.0 * (2.0 * t).cos(), 1.0 + i as f64, t * t - 2.0])
    }
    fn motion(&self, _: usize, t: f64) -> Result<[f64; 3], Failed> {
        let (s, c) = (1.7 * t).sin_cos();
        Ok([0.3 * s + 0.2 * t, 0.51 * c + 0.2, -0.867 * s])
    }
    fn law(&self, i: usize, t: f64, seen: &[f64], out: &mut [f64]) -> Result<(), Failed> {
        law(i, t, seen, out);
        Ok(())
    }
    fn relation(&self, _: usize, t: f64, x: &[f64], rates: &[f64]) -> Result<[f64; RELATION], Failed> {
        Ok(relation(t, x, rates))
    }
}

/// `x_0 + 0.4 x_1 + 0.2 sin(x_0 − x_1) − 0.1 sin t` with its derivatives, as couplings ask for them.
pub fn relation(t: f64, x: &[f64], rates: &[f64]) -> [f64; RELATION] {
    let (apart, rate) = (x[0] - x[1], rates[0] - rates[1]);
    let mut found = [0.0; RELATION];
    found[0] = x[0] + 0.4 * x[1] + 0.2 * apart.sin() - 0.1 * t.sin();
    found[1] = -0.1 * t.cos();
    found[2] = -0.2 * apart.sin() * rate * rate + 0.1 * t.sin();
    (found[3], found[4]) = (1.0 + 0.2 * apart.cos(), 0.4 - 0.2 * apart.cos());
    found
}

/// A smooth function of all that a law sees.
pub fn law(i: usize, t: f64, seen: &[f64], out: &mut [f64]) {
    for (k, out) in out.iter_mut().enumerate() {
        let sum: f64 = seen.iter().enumerate().map(|(j, x)| x * (0.7 * (j + k) as f64 + 1.0).sin()).sum();
        *out = (t + i as f64 + 0.3 * sum).sin();
    }
}

pub fn between(rng: &mut fastrand::Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * rng.f64()
}

pub fn point(rng: &mut fastrand::Rng, size: f64) -> [f64; 3] {
    [0; 3].map(|_| between(rng, -size, size))
}

pub fn rotation(rng: &mut fastrand::Rng) -> Mat3<f64> {
    Quaternion([0; 4].map(|_| between(rng, -1.0, 1.0))).normalised().matrix()
}

/// The body as a few point masses: an inertia that can exist.
fn inertia(rng: &mut fastrand::Rng, mass: f64) -> [[f64; 3]; 3] {
    (0..4).fold(Mat3::zero(), |sum, _| sum.add(&Mat3::steiner(0.25 * mass, Vec3(point(rng, 0.4))))).0
}

pub fn body(rng: &mut fastrand::Rng, name: String) -> Body {
    let mass = between(rng, 0.5, 3.0);
    Body {
        name,
        mass,
        com: point(rng, 0.3),
        inertia: inertia(rng, mass),
        position: point(rng, 1.0),
        orientation: rotation(rng).0,
        shape: None,
    }
}

pub fn joint(name: String, kind: JointKind, parent: &str, child: &str, point: [f64; 3]) -> Joint {
    Joint::new(name, kind, parent, child, point)
}

pub fn empty(name: &str) -> Spec {
    let gravity = [1.0, -9.0, 3.0];
    Spec {
        partita: VERSION,
        name: name.into(),
        gravity,
        drawing_tolerance: DRAWING_TOLERANCE,
        bodies: vec![],
        joints: vec![],
        couplings: vec![],
        drives: vec![],
        forces: vec![],
        sights: vec![],
    }
}

const KINDS: [JointKind; 8] = [
    JointKind::Revolute,
    JointKind::Prismatic,
    JointKind::Cylindrical,
    JointKind::Universal,
    JointKind::Spherical,
    JointKind::Planar,
    JointKind::Generic,
    JointKind::Free,
];

/// What to draw.
#[derive(Clone, Copy, Debug)]
pub struct Wishes {
    /// All motions in one (tilted) plane.
    pub planar: bool,
    /// Loads along joint coordinates and drives, which bind their joints to the tree.
    pub bound: bool,
    pub drives: bool,
}

fn spatial_joint(rng: &mut fastrand::Rng, name: String, parent: &str, child: &str) -> Joint {
    // free joints say little: seldom; one joint in twelve is fixed
    let kinds = if rng.f64() < 0.1 { 8 } else { 7 };
    let kind = match rng.usize(0..12) {
        0 => JointKind::Fixed,
        1..=7 => KINDS[rng.usize(0..4)],
        _ => KINDS[rng.usize(0..kinds)],
    };
    let mut j = joint(name, kind, parent, child, point(rng, 1.0));
    j.axis = Some(point(rng, 1.0));
    j.axis2 = Some(point(rng, 1.0));
    if kind == JointKind::Universal && rng.bool() {
        // square to the last bit, as most are drawn
        (j.axis, j.axis2) = (Some([0.0, 0.0, 1.0]), Some([1.0, 0.0, 0.0]));
    }
    if kind == JointKind::Generic {
        j.frame = Some(rotation(rng).0);
        let all = ["x", "y", "z", "rx", "ry", "rz"];
        j.free = Some(all.iter().filter(|_| rng.f64() < 0.35).map(|s| (*s).to_string()).collect());
    }
    j
}

/// In the plane with the normal `n`; balls only where a loop closes.
fn planar_joint(
    rng: &mut fastrand::Rng,
    name: String,
    parent: &str,
    child: &str,
    n: Vec3<f64>,
    closing: bool,
) -> Joint {
    let kind = match rng.usize(0..10) {
        0..=5 => JointKind::Revolute,
        6..=7 => JointKind::Prismatic,
        8 if closing => JointKind::Spherical,
        _ => JointKind::Planar,
    };
    let mut j = joint(name, kind, parent, child, point(rng, 1.0));
    let across = n.cross(Vec3(point(rng, 1.0)));
    j.axis = Some(if kind == JointKind::Prismatic { across.0 } else { n.0 });
    j
}

fn scalar_motions(j: &Joint) -> usize {
    match j.kind {
        JointKind::Revolute | JointKind::Prismatic => 1,
        JointKind::Cylindrical | JointKind::Universal => 2,
        JointKind::Planar => 3,
        _ => 0,
    }
}

/// A tree of three to six bodies and one or two joints that close loops, with springs and forces.
pub fn drawing(rng: &mut fastrand::Rng, wishes: Wishes) -> Spec {
    let mut spec = empty("drawn by chance");
    let normal = Vec3(point(rng, 1.0)).unit().unwrap();
    let count = rng.usize(3..7);
    let name = |node: usize| if node == 0 { "ground".to_string() } else { format!("body{node}") };
    let one = |rng: &mut fastrand::Rng, i: usize, a: usize, b: usize, closing: bool| {
        // half of the joints are drawn from the far side
        let (a, b) = if rng.bool() { (name(a), name(b)) } else { (name(b), name(a)) };
        if wishes.planar {
            planar_joint(rng, format!("joint{i}"), &a, &b, normal, closing)
        } else {
            spatial_joint(rng, format!("joint{i}"), &a, &b)
        }
    };
    for i in 1..=count {
        spec.bodies.push(body(rng, name(i)));
        // bodies of a chain rather than a star
        let inner = if rng.f64() < 0.6 { i - 1 } else { rng.usize(0..i) };
        let j = one(rng, i, inner, i, false);
        spec.joints.push(j);
    }
    for i in 0..rng.usize(1..3) {
        let a = rng.usize(0..=count);
        let b = (a + rng.usize(1..=count)) % (count + 1);
        let mut j = one(rng, count + 1 + i, a, b, true);
        if rng.bool() {
            j.cut = Cut::Always;
        }
        spec.joints.push(j);
    }
    forces(rng, &mut spec, count, wishes);
    spec
}

fn forces(rng: &mut fastrand::Rng, spec: &mut Spec, count: usize, wishes: Wishes) {
    let name = |node: usize| if node == 0 { "ground".to_string() } else { format!("body{node}") };
    for i in 0..rng.usize(1..4) {
        let a = rng.usize(0..=count);
        let b = (a + rng.usize(1..=count)) % (count + 1);
        spec.forces.push(Force::Spring {
            name: format!("spring{i}"),
            body1: name(a),
            point1: point(rng, 0.5),
            body2: name(b),
            point2: point(rng, 0.5),
            stiffness: between(rng, 5.0, 30.0),
            damping: between(rng, 0.0, 1.0),
            length: between(rng, 0.2, 1.0),
        });
    }
    let components = [Value::Constant(1.5), Value::Function(1), Value::Constant(-2.0)];
    for (i, (value, axes)) in [
        (VectorValue::Whole(Value::Function(2)), Axes::World),
        (VectorValue::Components(components), Axes::Body),
        (VectorValue::Components([0.5, -1.0, 2.0].map(Value::Constant)), Axes::World),
    ]
    .into_iter()
    .enumerate()
    {
        // in the plane forces stay in the plane only where it is level; out of it they are the joints' business
        let body = name(rng.usize(1..=count));
        spec.forces.push(Force::Force { name: format!("force{i}"), body, point: point(rng, 0.5), value, axes });
    }
    for j in spec.joints.clone() {
        let (motions, name) = (scalar_motions(&j), j.name.clone());
        if j.kind == JointKind::Spherical && wishes.bound && j.cut == Cut::Auto && rng.bool() {
            let (coordinate, value) = (rng.usize(0..3), Value::Constant(2.3));
            spec.forces.push(Force::Torque {
                name: format!("torque {name}"),
                joint: name.clone(),
                coordinate,
                value,
                over: None,
                periodic: false,
            });
        }
        if motions == 0 || rng.f64() < 0.5 {
            continue;
        }
        let coordinate = rng.usize(0..motions);
        let value = if rng.bool() { Value::Function(0) } else { Value::Constant(1.7) };
        spec.forces.push(Force::Torque {
            name: format!("torque {name}"),
            joint: name.clone(),
            coordinate,
            value,
            over: None,
            periodic: false,
        });
        if !wishes.bound || j.cut == Cut::Always {
            continue;
        }
        spec.forces.push(Force::TorsionSpring {
            name: format!("torsion {name}"),
            joint: name.clone(),
            coordinate: rng.usize(0..motions),
            stiffness: between(rng, 1.0, 9.0),
            damping: between(rng, 0.0, 1.0),
            angle: 0.3,
        });
        if wishes.drives && spec.drives.is_empty() {
            let motion = Value::Function(0);
            spec.drives.push(Drive {
                name: format!("drive {name}"),
                measure: Measure::joint(name, rng.usize(0..motions)),
                motion,
                level: Level::Position,
                turning: None,
            });
        }
    }
}

/// One of each force with a record of its own, all of them where they are smooth: pressed, moving, turned by less than
/// half a turn.
pub fn loads(rng: &mut fastrand::Rng, spec: &mut Spec) {
    let count = spec.bodies.len();
    let name = |node: usize| if node == 0 { "ground".to_string() } else { format!("body{node}") };
    let two = |rng: &mut fastrand::Rng| {
        let a = rng.usize(1..=count);
        (name(a), name((a + rng.usize(1..=count)) % (count + 1)))
    };
    let matrix = |rng: &mut fastrand::Rng, size: f64| [[0; 6]; 6].map(|row| row.map(|_| between(rng, -size, size)));
    let (body1, body2) = two(rng);
    let frame1 = rotation(rng);
    let axes =
        |name: &str| spec.bodies.iter().find(|b| b.name == name).map_or(Mat3::identity(), |b| Mat3(b.orientation));
    let frame2 = axes(&body2).transpose().mul(&axes(&body1)).mul(&frame1).0;
    let mut all = vec![Force::Bushing(Box::new(Bushing {
        name: "bushing".into(),
        body1,
        point1: point(rng, 0.5),
        frame1: frame1.0,
        body2,
        point2: point(rng, 0.5),
        frame2,
        stiffness: matrix(rng, 5.0),
        damping: matrix(rng, 1.0),
    }))];
    let (body1, body2) = two(rng);
    all.push(Force::Contact(Contact {
        name: "on a plane".into(),
        body1,
        point1: point(rng, 0.5),
        radius1: 6.0,
        body2,
        point2: point(rng, 0.5),
        normal: Some(point(rng, 1.0)),
        radius2: None,
        stiffness: 0.5,
        exponent: 1.5,
        damping: 0.05,
        friction: 0.3,
        static_friction: 0.5,
        stick_velocity: 0.7,
    }));
    let (body1, body2) = two(rng);
    let point1 = point(rng, 0.5);
    all.push(Force::Contact(Contact {
        name: "of spheres".into(),
        body1,
        point1,
        radius1: 3.0,
        body2,
        point2: point1.map(|x| x + 1.0),
        normal: None,
        radius2: Some(4.0),
        stiffness: 0.5,
        exponent: 2.0,
        damping: 0.05,
        friction: 0.3,
        static_friction: 0.3,
        stick_velocity: 0.7,
    }));
    let (body1, body2) = two(rng);
    let axis = point(rng, 1.0);
    // upright as drawn
    let world = axes(&body1).apply(Vec3(axis)).cross(Vec3(point(rng, 1.0)));
    all.push(Force::Tyre(Tyre {
        name: "tyre".into(),
        normal: axes(&body2).apply_transposed(world).0,
        body: body1,
        center: point(rng, 0.5),
        axis,
        radius: 8.0,
        ground: body2,
        point: point(rng, 0.5),
        stiffness: 0.5,
        damping: 0.02,
        friction: 0.8,
        longitudinal: 3.0,
        lateral: 2.0,
        slow_speed: 0.5,
    }));
    let spots = [point(rng, 0.5), point(rng, 0.5)].map(|point| Spot { body: name(rng.usize(1..=count)), point });
    let mut sees = vec![Sight::Point(spots[0].clone()), Sight::Body(name(rng.usize(0..=count)))];
    for j in &spec.joints {
        let motions = scalar_motions(j);
        if motions == 0 || rng.f64() < 0.5 {
            continue;
        }
        let mut coordinate = || rng.usize(0..motions);
        sees.push(Sight::Joint(j.name.clone(), coordinate()));
        all.push(Force::Friction(Friction {
            name: format!("friction {}", j.name),
            joint: j.name.clone(),
            coordinate: coordinate(),
            dynamic: Value::Constant(1.3),
            held: Some(Value::Function(2)),
            stick_velocity: 0.6,
            follows: None,
        }));
        all.push(Force::Stop(Stop {
            name: format!("stop {}", j.name),
            joint: j.name.clone(),
            coordinate: coordinate(),
            lower: None,
            upper: Some(-1.5),
            stiffness: 0.8,
            exponent: 1.2,
            damping: 0.05,
        }));
    }
    all.push(Force::Law(Law { name: "law".into(), value: Value::Function(1), sees, on: spots.to_vec() }));
    all.push(Force::Weightless(Weightless { name: "weightless".into(), body: name(rng.usize(1..=count)) }));
    all.push(Force::Gravity(Gravity { name: "gravity".into(), value: VectorValue::Whole(Value::Function(1)) }));
    spec.forces.extend(all);
}

/// Kinds of [`couple`]; what rolls leaves the plane.
pub const COUPLINGS: usize = 9;
pub const ROLLS: usize = 6;

/// A coupling, or a drive, of each kind between what is drawn, in the plane of the drawing if it has one; true if the
/// drawing has what it needs.
pub fn couple(rng: &mut fastrand::Rng, spec: &mut Spec, planar: bool, kind: usize) -> bool {
    let count = spec.bodies.len();
    let mut coordinates: Vec<Measure> = Vec::new();
    for j in &spec.joints {
        coordinates.extend((0..scalar_motions(j)).map(|i| Measure::joint(&j.name, i)));
    }
    rng.shuffle(&mut coordinates);
    let name = |node: usize| if node == 0 { "ground".to_string() } else { format!("body{node}") };
    let a = rng.usize(1..=count);
    let b = (a + rng.usize(1..=count)) % (count + 1);
    let (body1, body2, point1, point2) = (name(a), name(b), point(rng, 0.5), point(rng, 0.5));
    let (word, terms_of) = ("coupling".to_string(), |n: usize| coordinates[..n].to_vec());
    let (first, second) = (between(rng, 0.5, 2.0), between(rng, -2.0, -0.5));
    let plane = spec.joints.iter().find(|j| planar && j.kind != JointKind::Prismatic).and_then(|j| j.axis);
    if coordinates.len() < 3 || planar != plane.is_some() || planar && kind == ROLLS {
        return false;
    }
    let axes = |node: usize| if node == 0 { Mat3::identity() } else { Mat3(spec.bodies[node - 1].orientation) };
    let place = |node: usize, p: [f64; 3]| {
        let origin = if node == 0 { [0.0; 3] } else { spec.bodies[node - 1].position };
        Vec3(origin) + axes(node).apply(Vec3(p))
    };
    let gap = place(b, point2) - place(a, point1);
    let flat = |x: Vec3<f64>| match plane.and_then(|n| Vec3(n).unit()) {
        Some(n) => x - n.times(n.dot(x)),
        None => x,
    };
    let linear = |terms: Vec<Measure>, factors: Vec<f64>, offset: f64| Coupling::Linear {
        name: "linear".into(),
        word: word.clone(),
        terms,
        factors,
        offset,
    };
    let coupling = match kind % COUPLINGS {
        0 => linear(terms_of(2), vec![first, second], 0.0),
        1 => linear(terms_of(3), vec![first, second, 0.7], 0.1),
        2 => {
            // one cubic through the origin, written twice
            let ([a, b, c], end) = ([0; 3].map(|_| between(rng, -0.1, 0.1)), 4.0);
            let from = |x: f64| [a, 3.0 * a * x + b, (3.0 * a * x + 2.0 * b) * x + c, ((a * x + b) * x + c) * x];
            let curve = Table { breaks: vec![-end, 0.0, end], coefficients: vec![from(-end), from(0.0)] };
            Coupling::Curve { name: "curve".into(), word, terms: terms_of(2), curve, periodic: false }
        }
        3 | 7 => {
            let level = if kind % COUPLINGS == 3 { Level::Position } else { Level::Velocity };
            let (function, like) = (0, None);
            Coupling::Function { name: "function".into(), word, terms: terms_of(2), function, level, like }
        }
        4 => linear(vec![Measure::Distance { body1, point1, body2, point2 }], vec![1.0], gap.norm()),
        5 => {
            let world = flat(Vec3(point(rng, 1.0))).unit().unwrap();
            let axis = axes(a).apply_transposed(world).0;
            let along = Measure::Along { body1, point1, axis, body2, point2 };
            linear(vec![along, coordinates[0].clone()], vec![1.0, 0.4 * second], world.dot(gap))
        }
        ROLLS => {
            // a disc or a ball on a plane of another body: as large as it is drawn high
            let (down, disc) = (gap.unit().unwrap(), Vec3(point(rng, 1.0)).unit().unwrap());
            let axis = rng.bool().then(|| axes(a).apply_transposed(disc).0);
            let lean = axis.map_or(0.0, |_| disc.dot(down));
            let radius = gap.norm() / (1.0 - lean * lean).sqrt();
            let normal = axes(b).apply_transposed(down.times(-1.0)).0;
            let (body, center, on, point, slips) = (body1, point1, body2, point2, rng.bool());
            Coupling::Roll { name: "roll".into(), body, center, axis, radius, on, point, normal, slips }
        }
        _ => {
            let (name, measure) = ("rate".to_string(), coordinates[0].clone());
            spec.drives.retain(|d| d.measure != measure);
            spec.drives.push(Drive {
                name,
                measure,
                motion: Value::Function(0),
                level: Level::Velocity,
                turning: None,
            });
            return true;
        }
    };
    spec.couplings.push(coupling);
    true
}

pub fn compile(spec: &Spec, coordinates: Coordinates) -> Option<Model> {
    Model::new(spec.clone(), Arc::new(OfTime), coordinates).ok()
}

/// A state with everything that follows from it.
#[derive(Clone, Debug)]
pub struct Moment {
    pub t: f64,
    pub q: Vec<f64>,
    pub v: Vec<f64>,
    pub vdot: Vec<f64>,
    pub lambda: Vec<f64>,
    pub rank: usize,
}

/// Weakest accepted constraints and partitions: what is computed through them loses three digits at the most.
const WELL_POSED: f64 = 1e-3;

impl Moment {
    /// Accelerations and multipliers of a state; none where the constraints or all partitions are weak.
    pub fn at(model: &Model, t: f64, q: Vec<f64>, v: Vec<f64>) -> Option<Self> {
        let found = start::analyse(model, t, &q).ok()?;
        if !found.dropped.is_empty() && !model.out_of_plane.is_empty() || found.smallest < WELL_POSED {
            return None;
        }
        let mut r = Reduction::new(model, found.rank);
        start::choose_partition(&mut r, t, &q, None, None).ok()?;
        let speeds: Vec<f64> = r.partition.independent.iter().map(|&i| v[i]).collect();
        r.evaluate(t, &q, &speeds).ok()?;
        if r.quality(t, &q).ok()?.sqrt_mu < WELL_POSED {
            return None;
        }
        let mut moment = Self { t, q, v: r.v.clone(), vdot: v, lambda: vec![0.0; model.size().rows], rank: found.rank };
        r.full_acceleration(&mut moment.vdot);
        r.multipliers(t, &moment.q, &moment.vdot, &mut moment.lambda).ok()?;
        Some(moment)
    }

    /// Somewhere away from the drawing, moving.
    pub fn random(rng: &mut fastrand::Rng, model: &Model) -> Option<Self> {
        let t = between(rng, 0.1, 0.5);
        let mut q = model.initial();
        assembly::close(model, t, &mut q, 1e-9, &[]).ok()?;
        let rank = start::analyse(model, t, &q).ok().filter(|s| s.dropped.is_empty() || model.is_planar())?.rank;
        let mut r = Reduction::new(model, rank);
        if r.k() == 0 {
            return None;
        }
        for _ in 0..3 {
            start::choose_partition(&mut r, t, &q, None, None).ok()?;
            r.gamma.fill(0.0);
            let move_by: Vec<f64> = (0..r.k()).map(|_| between(rng, -0.3, 0.3)).collect();
            r.spread(&move_by);
            if r.v.iter().any(|x| x.abs() > 1.0) {
                return None;
            }
            model.step(&mut q, &r.v.clone());
            model.normalise(&mut q);
            assembly::close(model, t, &mut q, 1e-9, &[]).ok()?;
        }
        start::choose_partition(&mut r, t, &q, None, None).ok()?;
        let speeds: Vec<f64> = (0..r.k()).map(|_| between(rng, -1.0, 1.0)).collect();
        r.evaluate(t, &q, &speeds).ok()?;
        let v = r.v.clone();
        Self::at(model, t, q, v)
    }
}

/// Run `check` on `count` mechanisms with a state each.
pub fn on_random_mechanisms(
    seed: u64,
    count: usize,
    wishes: Wishes,
    check: impl FnMut(&mut fastrand::Rng, &Model, &Moment),
) {
    on_mechanisms(seed, count, wishes, |_, _, _| true, check);
}

/// The same with a coupling or a drive of every one of these kinds in turn.
pub fn on_coupled_mechanisms(
    seed: u64,
    count: usize,
    wishes: Wishes,
    kinds: &[usize],
    check: impl FnMut(&mut fastrand::Rng, &Model, &Moment),
) {
    let coupled = |rng: &mut fastrand::Rng, spec: &mut Spec, done: usize| {
        couple(rng, spec, wishes.planar, kinds[done % kinds.len()])
    };
    on_mechanisms(seed, count, wishes, coupled, check);
}

fn on_mechanisms(
    seed: u64,
    count: usize,
    wishes: Wishes,
    mut more: impl FnMut(&mut fastrand::Rng, &mut Spec, usize) -> bool,
    mut check: impl FnMut(&mut fastrand::Rng, &Model, &Moment),
) {
    let mut rng = fastrand::Rng::with_seed(seed);
    let (mut done, mut drawn) = (0, 0);
    while done < count {
        drawn += 1;
        assert!(drawn < 100 * count, "only {done} of {drawn} drawings could be used");
        let mut spec = drawing(&mut rng, wishes);
        loads(&mut fastrand::Rng::with_seed(seed + drawn as u64), &mut spec);
        if !more(&mut rng, &mut spec, done) {
            continue;
        }
        let Some(model) = compile(&spec, Coordinates::Relative) else { continue };
        if model.is_planar() != wishes.planar {
            continue;
        }
        let Some(moment) = Moment::random(&mut rng, &model) else { continue };
        check(&mut rng, &model, &moment);
        done += 1;
    }
}

/// All bodies at (q, v).
pub fn bodies(model: &Model, q: &[f64], v: &[f64]) -> Vec<BodyState> {
    let mut s = model.scratch();
    model.look(q, v, &mut s);
    (0..model.placed.bodies.len()).map(|i| model.body_state(i, &s)).collect()
}

/// Derivative at 0 by central differences of fourth order: error h⁴/30 times the fifth derivative, round-off ε/h.
pub fn derivative(h: f64, mut f: impl FnMut(f64) -> Vec<f64>) -> Vec<f64> {
    let (a, b, c, d) = (f(-2.0 * h), f(-h), f(h), f(2.0 * h));
    (0..a.len()).map(|i| (8.0 * (c[i] - b[i]) - (d[i] - a[i])) / (12.0 * h)).collect()
}

/// The step of [`derivative`] at which its two errors meet: 3e-16 times a fifth derivative (up to 1e5 where springs are
/// short), and 3e-13 of round-off.
pub const STEP: f64 = 3e-4;

/// Second derivative at 0, of fourth order as well: error h⁴/90 times the sixth derivative, round-off 5 ε/h².
pub fn second_derivative(h: f64, mut f: impl FnMut(f64) -> Vec<f64>) -> Vec<f64> {
    let (a, b, m, c, d) = (f(-2.0 * h), f(-h), f(0.0), f(h), f(2.0 * h));
    (0..a.len()).map(|i| (16.0 * (c[i] + b[i]) - (d[i] + a[i]) - 30.0 * m[i]) / (12.0 * h * h)).collect()
}

/// q after the motion with v and v' for the time h: right to the second order, which is what a derivative needs.
pub fn moved(model: &Model, m: &Moment, h: f64) -> (Vec<f64>, Vec<f64>) {
    let mut q = m.q.clone();
    let dv: Vec<f64> = m.v.iter().zip(&m.vdot).map(|(v, a)| h * v + 0.5 * h * h * a).collect();
    model.step(&mut q, &dv);
    (q, m.v.iter().zip(&m.vdot).map(|(v, a)| v + h * a).collect())
}

/// Accelerations of all bodies, linear and angular, one after the other.
pub fn accelerations(model: &Model, m: &Moment) -> Vec<f64> {
    derivative(STEP, |h| {
        let (q, v) = moved(model, m, h);
        bodies(model, &q, &v).iter().flat_map(|b| b.velocity.0.into_iter().chain(b.angular_velocity.0)).collect()
    })
}

/// Largest difference against the largest entry (or 1).
pub fn apart(x: &[f64], y: &[f64]) -> f64 {
    assert_eq!(x.len(), y.len());
    let size = x.iter().chain(y).fold(1.0, |m: f64, x| m.max(x.abs()));
    x.iter().zip(y).fold(0.0, |m: f64, (x, y)| m.max((x - y).abs())) / size
}

/// A spatial chain closed to the ground: cylinder, universal, pin, ball.
pub fn in_space() -> Spec {
    let mut rng = fastrand::Rng::with_seed(2);
    let mut spec = empty("in space");
    let kinds = [JointKind::Cylindrical, JointKind::Universal, JointKind::Revolute, JointKind::Spherical];
    let mut from = "ground".to_string();
    for (i, kind) in kinds.into_iter().enumerate() {
        let name = format!("body{i}");
        if i < 3 {
            spec.bodies.push(body(&mut rng, name.clone()));
        }
        let to = if i < 3 { name } else { "ground".into() };
        let mut j = joint(format!("joint{i}"), kind, &from, &to, point(&mut rng, 1.0));
        (j.axis, j.axis2) = (Some(point(&mut rng, 1.0)), Some(point(&mut rng, 1.0)));
        spec.joints.push(j);
        from = to;
    }
    spec
}
