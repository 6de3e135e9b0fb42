//! Mechanisms drawn by chance, so that no symmetry helps.

use partita_math::spatial::{Mat3, Quaternion, Vec3};
use partita_model::spec::{
    Axes, Body, Bushing, Contact, Coupling, Cut, Drive, Force, Friction, GasSpring, GasStrut, Gravity, Joint,
    JointKind, Law, Level, Measure, PointForce, Rope, Sight, Spec, Spot, Spring, Stop, Table, Torque, TorsionSpring,
    Tyre, Value, VectorValue, Weightless, DRAWING_TOLERANCE, VERSION,
};

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
        rotors: vec![],
        sights: vec![],
        parting: std::collections::BTreeMap::new(),
    }
}

/// Name of a node: the ground, then bodies from 1.
fn node_name(node: usize) -> String {
    if node == 0 {
        "ground".into()
    } else {
        format!("body{node}")
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
    let one = |rng: &mut fastrand::Rng, i: usize, a: usize, b: usize, closing: bool| {
        // half of the joints are drawn from the far side
        let (a, b) = if rng.bool() { (node_name(a), node_name(b)) } else { (node_name(b), node_name(a)) };
        if wishes.planar {
            planar_joint(rng, format!("joint{i}"), &a, &b, normal, closing)
        } else {
            spatial_joint(rng, format!("joint{i}"), &a, &b)
        }
    };
    for i in 1..=count {
        spec.bodies.push(body(rng, node_name(i)));
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

fn torque(joint: &str, coordinate: usize, value: Value) -> Force {
    let (name, joint) = (format!("torque {joint}"), joint.to_string());
    Force::Torque(Torque { name, joint, coordinate, value, over: None, periodic: false })
}

fn forces(rng: &mut fastrand::Rng, spec: &mut Spec, count: usize, wishes: Wishes) {
    for i in 0..rng.usize(1..4) {
        let a = rng.usize(0..=count);
        let b = (a + rng.usize(1..=count)) % (count + 1);
        spec.forces.push(Force::Spring(Spring {
            name: format!("spring{i}"),
            body1: node_name(a),
            point1: point(rng, 0.5),
            body2: node_name(b),
            point2: point(rng, 0.5),
            stiffness: between(rng, 5.0, 30.0),
            damping: between(rng, 0.0, 1.0),
            length: between(rng, 0.2, 1.0),
        }));
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
        let body = node_name(rng.usize(1..=count));
        let point = point(rng, 0.5);
        spec.forces.push(Force::Force(PointForce { name: format!("force{i}"), body, point, value, axes }));
    }
    for j in spec.joints.clone() {
        let (motions, name) = (scalar_motions(&j), j.name.clone());
        if j.kind == JointKind::Spherical && wishes.bound && j.cut == Cut::Auto && rng.bool() {
            spec.forces.push(torque(&name, rng.usize(0..3), Value::Constant(2.3)));
        }
        if motions == 0 || rng.f64() < 0.5 {
            continue;
        }
        let coordinate = rng.usize(0..motions);
        let value = if rng.bool() { Value::Function(0) } else { Value::Constant(1.7) };
        spec.forces.push(torque(&name, coordinate, value));
        if !wishes.bound || j.cut == Cut::Always {
            continue;
        }
        spec.forces.push(Force::TorsionSpring(TorsionSpring {
            name: format!("torsion {name}"),
            joint: name.clone(),
            coordinate: rng.usize(0..motions),
            stiffness: between(rng, 1.0, 9.0),
            damping: between(rng, 0.0, 1.0),
            angle: 0.3,
        }));
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
    let two = |rng: &mut fastrand::Rng| {
        let a = rng.usize(1..=count);
        (node_name(a), node_name((a + rng.usize(1..=count)) % (count + 1)))
    };
    let matrix = |rng: &mut fastrand::Rng, size: f64| [[0; 6]; 6].map(|row| row.map(|_| between(rng, -size, size)));
    let (body1, body2) = two(rng);
    let frame1 = rotation(rng);
    let axes =
        |name: &str| spec.bodies.iter().find(|b| b.name == name).map_or(Mat3::identity(), |b| Mat3(b.orientation));
    let frame2 = axes(&body2).transpose().mul(&axes(&body1)).mul(&frame1).0;
    let mut all = vec![Force::Bushing(Bushing {
        name: "bushing".into(),
        body1,
        point1: point(rng, 0.5),
        frame1: frame1.0,
        body2,
        point2: point(rng, 0.5),
        frame2,
        stiffness: Box::new(matrix(rng, 5.0)),
        damping: Box::new(matrix(rng, 1.0)),
    })];
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
        restitution: None,
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
        restitution: None,
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
    // taut everywhere, and at its stop
    all.push(Force::Rope(Rope {
        name: "rope".into(),
        body1: node_name(1),
        point1: [0.3, -0.2, 0.1],
        body2: node_name(0),
        point2: [7.0, 5.0, -6.0],
        length: 0.5,
        stiffness: 0.4,
        exponent: 1.5,
        damping: 0.05,
        restitution: None,
    }));
    all.push(Force::GasStrut(GasStrut {
        name: "strut".into(),
        body1: node_name(1),
        point1: [0.1, 0.3, -0.2],
        body2: node_name(0),
        point2: [7.0, 6.0, -5.0],
        force: 0.6,
        progression: 1.4,
        stroke: 3.0,
        length: 4.0,
        exponent: 1.3,
        damping: 0.05,
        end_stiffness: Some(0.3),
    }));
    let spots = [point(rng, 0.5), point(rng, 0.5)].map(|point| Spot { body: node_name(rng.usize(1..=count)), point });
    let mut sees = vec![Sight::Point(spots[0].clone()), Sight::Body(node_name(rng.usize(0..=count)))];
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
            signs: [0.0; 2],
        }));
        all.push(Force::Friction(Friction {
            name: format!("dry {}", j.name),
            joint: j.name.clone(),
            coordinate: coordinate(),
            dynamic: Value::Constant(0.9),
            held: Some(Value::Constant(1.1)),
            stick_velocity: 0.0,
            follows: None,
            signs: [-1.0, 0.0],
        }));
        all.push(Force::Stop(Stop {
            name: format!("stop {}", j.name),
            joint: j.name.clone(),
            coordinate: coordinate(),
            lower: None,
            upper: Some(-1.5),
            stiffness: Some(0.8),
            exponent: 1.2,
            damping: 0.05,
            restitution: None,
        }));
        all.push(Force::GasSpring(GasSpring {
            name: format!("gas {}", j.name),
            joint: j.name.clone(),
            coordinate: coordinate(),
            force: -1.1,
            length: 20.0,
            exponent: 1.3,
        }));
    }
    all.push(Force::Law(Law { name: "law".into(), value: Value::Function(1), sees, on: spots.to_vec() }));
    all.push(Force::Weightless(Weightless { name: "weightless".into(), body: node_name(rng.usize(1..=count)) }));
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
    let a = rng.usize(1..=count);
    let b = (a + rng.usize(1..=count)) % (count + 1);
    let (body1, body2, point1, point2) = (node_name(a), node_name(b), point(rng, 0.5), point(rng, 0.5));
    let (word, terms_of) = ("coupling".to_string(), |n: usize| coordinates[..n].to_vec());
    let (first, second) = (between(rng, 0.5, 2.0), between(rng, -2.0, -0.5));
    let plane = spec.joints.iter().find(|j| planar && j.kind != JointKind::Prismatic).and_then(|j| j.axis);
    if coordinates.len() < 3 || planar != plane.is_some() || planar && kind == ROLLS {
        return false;
    }
    let axes = |node: usize| if node == 0 { Mat3::identity() } else { Mat3(spec.bodies[node - 1].orientation) };
    let in_drawing = |node: usize, p: [f64; 3]| {
        let origin = if node == 0 { [0.0; 3] } else { spec.bodies[node - 1].position };
        Vec3(origin) + axes(node).apply(Vec3(p))
    };
    let gap = in_drawing(b, point2) - in_drawing(a, point1);
    let in_plane = |x: Vec3<f64>| match plane.and_then(|n| Vec3(n).unit()) {
        Some(n) => x - n.times(n.dot(x)),
        None => x,
    };
    let linear = |terms: Vec<Measure>, factors: Vec<f64>, offset: f64| Coupling::Linear {
        name: "linear".into(),
        word: word.clone(),
        terms,
        factors,
        offset,
        given_as: None,
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
            let world = in_plane(Vec3(point(rng, 1.0))).unit().unwrap();
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
