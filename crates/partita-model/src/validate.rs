//! Requirements that a description must satisfy before it is compiled, whatever its source.

use crate::error::DescriptionError;
use crate::spec::LARGEST_TOLERANCE;
use crate::spec::{Body, Coupling, Force, ForceRecord, Measure, Spec, Torque, Value, VERSION};
use crate::value;
use partita_math::dense::Matrix;
use partita_math::factor;
use partita_math::tolerance;
use std::collections::HashMap;

/// Name of the ground.
pub const GROUND: &str = "ground";

/// A valid tolerance.
fn drawing_tolerance(spec: &Spec) -> Result<(), DescriptionError> {
    let x = spec.drawing_tolerance;
    if (0.0..=LARGEST_TOLERANCE).contains(&x) {
        return Ok(());
    }
    let message = format!(
        "drawing_tolerance = {x}; give a number from 0 (the geometry is exact) to {LARGEST_TOLERANCE} (radians, and \
         fractions of lengths); beyond that the drawing describes another mechanism"
    );
    Err(DescriptionError::new("mechanism", &spec.name, message))
}

/// Node numbers by body name (the ground is 0).
pub fn nodes(spec: &Spec) -> Result<HashMap<&str, usize>, DescriptionError> {
    let mut nodes = HashMap::from([(GROUND, 0)]);
    for (i, b) in spec.bodies.iter().enumerate() {
        if b.name.trim().is_empty() {
            return Err(DescriptionError::new("body", &b.name, format!("body number {} has no name", i + 1)));
        }
        if b.name == GROUND {
            return Err(DescriptionError::new("body", &b.name, "this name is reserved; choose another"));
        }
        if nodes.insert(&b.name, i + 1).is_some() {
            return Err(DescriptionError::new("body", &b.name, "two bodies have this name; rename one"));
        }
    }
    Ok(nodes)
}

fn finite(x: &[f64], element: &'static str, name: &str, what: &str) -> Result<(), DescriptionError> {
    if x.iter().all(|x| x.is_finite()) {
        return Ok(());
    }
    Err(DescriptionError::new(element, name, format!("{what} = {x:?} is not finite; give finite numbers")))
}

fn body(b: &Body) -> Result<(), DescriptionError> {
    let fail = |m: String| Err(DescriptionError::new("body", &b.name, m));
    finite(&[b.mass], "body", &b.name, "mass")?;
    finite(&b.com, "body", &b.name, "com")?;
    finite(&b.position, "body", &b.name, "position")?;
    finite(&b.inertia.concat(), "body", &b.name, "inertia")?;
    finite(&b.orientation.concat(), "body", &b.name, "orientation")?;
    if b.mass < 0.0 {
        return fail(format!("mass = {} kg is negative", b.mass));
    }
    let i = &b.inertia;
    let size = i.concat().iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let slack = tolerance::EQUAL * size;
    for (r, c) in [(0, 1), (0, 2), (1, 2)] {
        if (i[r][c] - i[c][r]).abs() > slack {
            return fail(format!("inertia is not symmetric: I{r}{c} = {}, I{c}{r} = {}", i[r][c], i[c][r]));
        }
    }
    let tensor = Matrix::from_vec(3, 3, i.concat());
    if let Ok((p, _)) = factor::symmetric_eigen(&tensor) {
        if p[0] < -slack {
            return fail(format!("inertia is not positive: principal moments {p:?}"));
        }
        if p[2] > p[0] + p[1] + slack {
            return fail(format!(
                "no distribution of mass has this inertia: the largest principal moment {} exceeds the sum of the \
                 others {}; check the order of the entries",
                p[2],
                p[0] + p[1]
            ));
        }
    }
    rotation(&b.orientation, "body", &b.name, "orientation")
}

/// Refuse rotations about nothing.
fn rotation(r: &[[f64; 3]; 3], element: &'static str, name: &str, what: &str) -> Result<(), DescriptionError> {
    let fail = |m: String| Err(DescriptionError::new(element, name, m));
    for a in 0..3 {
        for c in 0..3 {
            let dot: f64 = (0..3).map(|k| r[k][a] * r[k][c]).sum();
            if (dot - f64::from(u8::from(a == c))).abs() > tolerance::EQUAL {
                return fail(format!("{what} is not a rotation: columns {a} and {c} have the product {dot:.12}"));
            }
        }
    }
    let det = r[0][0] * (r[1][1] * r[2][2] - r[1][2] * r[2][1]) - r[0][1] * (r[1][0] * r[2][2] - r[1][2] * r[2][0])
        + r[0][2] * (r[1][0] * r[2][1] - r[1][1] * r[2][0]);
    if det < 0.0 {
        return fail(format!("{what} is a reflection (determinant {det:.3})"));
    }
    Ok(())
}

/// Refuse elements between a body and itself.
fn two(a: usize, b: usize, element: &'static str, name: &str) -> Result<(), DescriptionError> {
    match a == b {
        true => Err(DescriptionError::new(element, name, "its two bodies are the same; name two different ones")),
        false => Ok(()),
    }
}

/// Errors of a load; its bodies and joints are known.
fn load(load: &mut dyn ForceRecord, functions: usize) -> Result<(), DescriptionError> {
    let name = load.name().to_string();
    let fail = |m: String| Err(DescriptionError::new("force", &name, m));
    let numbers = load.numbers().into_iter().map(|(what, x)| (what, x.iter().map(|x| **x).collect::<Vec<_>>()));
    numbers.into_iter().try_for_each(|(what, x)| finite(&x, "force", &name, what))?;
    if let Some(m) = load.fault() {
        return fail(m);
    }
    load.values().into_iter().try_for_each(|v| value::check(v, functions, "force", &name))
}

/// All checks that need no compilation.
pub fn validate(spec: &Spec, functions: usize) -> Result<(), DescriptionError> {
    if spec.partita != VERSION {
        let message = format!("its description has version {}, this program reads version {VERSION}", spec.partita);
        return Err(DescriptionError::new("mechanism", &spec.name, message));
    }
    finite(&spec.gravity, "mechanism", &spec.name, "gravity")?;
    drawing_tolerance(spec)?;
    if spec.bodies.is_empty() {
        return Err(DescriptionError::new("mechanism", &spec.name, "it has no bodies; add one"));
    }
    let nodes = nodes(spec)?;
    spec.bodies.iter().try_for_each(body)?;
    let known = |element: &'static str, name: &str, body: &str| match nodes.get(body) {
        Some(node) => Ok(*node),
        None => Err(DescriptionError::new(element, name, format!("there is no body \"{body}\""))),
    };
    let mut names: HashMap<&str, usize> = HashMap::new();
    for (i, j) in spec.joints.iter().enumerate() {
        let fail = |m: String| Err(DescriptionError::new("joint", &j.name, m));
        if j.name.trim().is_empty() {
            return fail(format!("joint number {} has no name", i + 1));
        }
        if names.insert(&j.name, i).is_some() {
            return fail("two joints have this name; rename one".into());
        }
        let (p, c) = (known("joint", &j.name, &j.parent)?, known("joint", &j.name, &j.child)?);
        if p == c {
            return fail(format!("it joins \"{}\" to itself", j.parent));
        }
        finite(&j.point, "joint", &j.name, "point")?;
        for f in &j.followers {
            value::check(&Value::Function(f.function), functions, "joint", &j.name)?;
        }
        for (x, what) in
            [(j.axis, "axis"), (j.axis2, "axis2"), (j.child_point, "child_point"), (j.child_axis, "child_axis")]
        {
            if let Some(x) = x {
                finite(&x, "joint", &j.name, what)?;
            }
        }
        for (x, what) in [(j.frame, "frame"), (j.child_frame, "child_frame")] {
            if let Some(x) = x {
                finite(&x.concat(), "joint", &j.name, what)?;
                rotation(&x, "joint", &j.name, what)?;
            }
        }
        if j.child_frame.is_some() && j.child_axis.is_some() {
            return fail("child_axis and child_frame both orient the joint on its child; give one of them".into());
        }
        if let Some(c) = j.compliance {
            finite(&c, "joint", &j.name, "compliance")?;
            if let Some(x) = c.iter().find(|x| **x < 0.0) {
                return fail(format!("its compliance has the entry {x}; it must not be negative (0 is rigid)"));
            }
        }
    }
    let joint = |element: &'static str, name: &str, joint: &str| match names.get(joint) {
        Some(_) => Ok(()),
        None => Err(DescriptionError::new(element, name, format!("there is no joint \"{joint}\""))),
    };
    let measure = |m: &Measure, element: &'static str, name: &str| -> Result<(), DescriptionError> {
        match m {
            Measure::Joint { joint: j, .. } => joint(element, name, j),
            Measure::Distance { body1, point1, body2, point2 } => {
                finite(&[*point1, *point2].concat(), element, name, "point1, point2")?;
                two(known(element, name, body1)?, known(element, name, body2)?, element, name)
            }
            Measure::Along { body1, point1, axis, body2, point2 } => {
                finite(&[*point1, *point2, *axis].concat(), element, name, "point1, point2, axis")?;
                two(known(element, name, body1)?, known(element, name, body2)?, element, name)
            }
            Measure::Cosine { body1, axis1, body2, axis2 } => {
                finite(&[*axis1, *axis2].concat(), element, name, "axis1, axis2")?;
                two(known(element, name, body1)?, known(element, name, body2)?, element, name)
            }
        }
    };
    let mut couplings: HashMap<&str, usize> = HashMap::new();
    for (i, c) in spec.couplings.iter().enumerate() {
        let fail = |m: String| Err(DescriptionError::new("coupling", c.name(), m));
        if c.name().trim().is_empty() {
            return fail(format!("coupling number {} has no name", i + 1));
        }
        if couplings.insert(c.name(), i).is_some() {
            return fail("two couplings have this name; rename one".into());
        }
        c.terms().iter().try_for_each(|m| measure(m, "coupling", c.name()))?;
        let count = c.terms().len();
        for (what, x) in c.clone().numbers() {
            finite(x, "coupling", c.name(), what)?;
        }
        if let Some(m) = c.fault() {
            return fail(m);
        }
        match c {
            Coupling::Linear { factors, offset, .. } => {
                finite(factors, "coupling", c.name(), "factors")?;
                finite(&[*offset], "coupling", c.name(), "offset")?;
                if count == 0 || factors.len() != count || factors.contains(&0.0) {
                    return fail(format!(
                        "it needs at least one term and a nonzero factor for each of its {count} terms; the factors \
                         are {factors:?}"
                    ));
                }
            }
            Coupling::Curve { curve, .. } => {
                if count != 2 {
                    return fail(format!("a curve relates two readings, but {count} are given"));
                }
                value::check(&Value::Table(curve.clone()), functions, "coupling", c.name())?;
            }
            Coupling::Function { function, .. } => {
                if count == 0 || count > value::READINGS {
                    return fail(format!(
                        "a function takes 1 to {} readings, but {count} are given; use a linear coupling for a sum \
                         of any number",
                        value::READINGS
                    ));
                }
                value::check(&Value::Function(*function), functions, "coupling", c.name())?;
            }
            Coupling::Roll { body, axis, on, normal, .. } => {
                two(known("coupling", c.name(), body)?, known("coupling", c.name(), on)?, "coupling", c.name())?;
                let axis = axis.unwrap_or([0.0, 0.0, 1.0]);
                finite(&[axis, *normal].concat(), "coupling", c.name(), "axis, normal")?;
            }
        }
    }
    let mut rotors: HashMap<&str, usize> = HashMap::new();
    for (i, r) in spec.rotors.iter().enumerate() {
        let fail = |m: String| Err(DescriptionError::new("rotor", &r.name, m));
        if r.name.trim().is_empty() {
            return fail(format!("rotor number {} has no name", i + 1));
        }
        if rotors.insert(&r.name, i).is_some() {
            return fail("two rotors have this name; rename one".into());
        }
        joint("rotor", &r.name, &r.joint)?;
        r.clone().numbers().into_iter().try_for_each(|(what, x)| finite(x, "rotor", &r.name, what))?;
        if let Some(m) = r.fault() {
            return fail(m);
        }
    }
    for d in &spec.drives {
        measure(&d.measure, "drive", &d.name)?;
        value::check(&d.motion, functions, "drive", &d.name)?;
        if let Some(turning) = &d.turning {
            value::check_turning(turning, functions, &d.name)?;
        }
    }
    for f in &spec.forces {
        if let Force::Torque(Torque { name, value: v, over: Some(over), .. }) = f {
            measure(over, "force", name)?;
            if !matches!(v, Value::Table(_)) {
                let m = "an abscissa is given, but its value is not a table";
                return Err(DescriptionError::new("force", name, m));
            }
        }
        let mut copy = f.clone();
        let load = copy.record_mut();
        load.bodies().into_iter().try_for_each(|b| known("force", load.name(), b).map(|_| ()))?;
        load.joints().into_iter().try_for_each(|(j, _)| joint("force", load.name(), j))?;
        self::load(load, functions)?;
    }
    Ok(())
}
