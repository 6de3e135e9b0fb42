//! Data that are possible but unlikely: idle spins, missing masses, confused units.

use crate::reason::names;
use partita_math::dense::Matrix;
use partita_math::factor::symmetric_eigen;
use partita_math::formatted;
use partita_math::tolerance;
use partita_model::spec::{Body, Force, Level, Measure, Value};
use partita_model::spin;
use partita_model::Model;
use serde::Serialize;

/// A rotation of bodies about a line that moves no other body.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Idle {
    /// The bodies: one, or several that rotate as one.
    pub bodies: Vec<String>,
    /// Joints and couplings that link them to others.
    pub joints: Vec<String>,
    /// Whether the spin is held: the body has no inertia about its axis and no initial spin is given.
    pub held: bool,
}

/// Spins that move no other body and on which no load depends.
pub(crate) fn idle(model: &Model) -> Vec<Idle> {
    free_spins(model).into_iter().filter(|x| !x.loaded).map(|x| named(model, &x)).collect()
}

/// Bodies of which one of these spins is a rotation.
pub(crate) fn idle_bodies(model: &Model) -> Vec<usize> {
    free_spins(model).into_iter().filter(|x| !x.loaded).flat_map(|x| x.bodies).collect()
}

/// The same, and those on which some load depends.
fn free_spins(model: &Model) -> Vec<spin::Idle> {
    spin::idle(&model.spec, model.zero_position())
}

fn named(model: &Model, x: &spin::Idle) -> Idle {
    let joints = x.joints.iter().map(|&j| model.spec.joints[j].name.clone());
    let couplings = x.couplings.iter().map(|&k| model.spec.couplings[k].name().to_string());
    Idle {
        bodies: x.bodies.iter().map(|&b| model.spec.bodies[b].name.clone()).collect(),
        joints: joints.chain(couplings).collect(),
        held: model.zero_position().held.iter().any(|h| x.bodies == [h.body]),
    }
}

/// The body without mass or inertia that makes the mass matrix indefinite; none if all bodies have both.
pub fn weightless(model: &Model) -> Option<String> {
    let massless = |b: &Body| b.mass <= 0.0 || least_inertia(b) <= 0.0;
    model.spec.bodies.iter().any(massless).then(|| without_inertia(model))
}

/// The body whose missing inertia makes the motion indeterminate.
pub(crate) fn without_inertia(model: &Model) -> String {
    if let Some(words) = spins_unfelt(model) {
        return words;
    }
    let massless: Vec<&str> = model
        .spec
        .bodies
        .iter()
        .filter(|b| b.mass <= 0.0 || least_inertia(b) <= 0.0)
        .map(|b| b.name.as_str())
        .collect();
    format!("one motion has no inertia; check {}, where the mass or a moment of inertia is 0", names(&massless))
}

/// Bodies that can spin without inertia, and are not held because some element depends on the spin.
pub(crate) fn spins_unfelt(model: &Model) -> Option<String> {
    let number = |name: &str| model.spec.bodies.iter().find(|b| b.name == name);
    let empty = |x: &Idle| x.bodies.iter().all(|b| number(b).is_some_and(|b| least_inertia(b) <= 0.0));
    let spins: Vec<Idle> = free_spins(model).iter().map(|x| named(model, x)).filter(|x| !x.held && empty(x)).collect();
    let spinning: Vec<String> = spins
        .iter()
        .map(|x| format!("{} about its own line between {}", x.bodies.join(" with "), names(&x.joints)))
        .collect();
    (!spinning.is_empty()).then(|| {
        format!(
            "no inertia: {} can spin without resistance; give it an axial inertia (add_body; a round bar has m r^2 \
             / 2 about its axis), or replace one ball joint by a universal joint",
            names(&spinning)
        )
    })
}

/// The smallest principal moment, zero where it is round-off.
fn least_inertia(b: &Body) -> f64 {
    let m = Matrix::from_vec(3, 3, b.inertia.concat());
    let Ok((values, _)) = symmetric_eigen(&m) else { return 0.0 };
    let largest = values.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    if least <= tolerance::LONG_ROUNDING * largest {
        0.0
    } else {
        least
    }
}

/// A whole angle beyond this was probably given in degrees. Scale: rad. Reason: more than one and a half turns.
const DEGREES: f64 = 10.0;
/// A body larger or smaller by this factor was probably given in another unit. Scale: ratio to the usual size. Reason:
/// between centimetre and metre, millimetre and metre.
const FAR_OFF: f64 = 100.0;

/// Data that are possible but unlikely.
pub fn suspicious(model: &Model) -> Vec<String> {
    let mut found = Vec::new();
    let turns = |joint: &str, coordinate: usize| {
        model.zero_position().joint_numbers.get(joint).is_some_and(|&j| model.shape(j).turns(coordinate))
    };
    let mut angle = |what: String, x: f64| {
        if x.abs() >= DEGREES && x.fract() == 0.0 {
            found.push(format!(
                "{what} is {x} rad, {:.1} full turns; {x} degrees would be {:.6} rad",
                x / std::f64::consts::TAU,
                x.to_radians()
            ));
        }
    };
    for d in model
        .spec
        .drives
        .iter()
        .filter(|d| d.level == Level::Position)
        .filter(|d| matches!(&d.measure, Measure::Joint { joint, coordinate } if turns(joint, *coordinate)))
    {
        if let Value::Constant(x) = d.motion {
            angle(format!("the position of {}", d.name), x);
        }
    }
    for f in &model.spec.forces {
        if let Force::TorsionSpring(x) = f {
            if turns(&x.joint, x.coordinate) {
                angle(format!("the free angle of {}", x.name), x.angle);
            }
        }
    }
    let extents: Vec<(usize, f64)> =
        (0..model.spec.bodies.len()).filter_map(|i| extent(model, i).map(|x| (i, x))).collect();
    let mut sizes: Vec<f64> = extents.iter().map(|x| x.1).collect();
    sizes.sort_by(f64::total_cmp);
    if let Some(&usual) = sizes.get(sizes.len() / 2).filter(|_| sizes.len() > 2) {
        for (i, x) in extents.iter().filter(|(_, x)| *x > FAR_OFF * usual || *x * FAR_OFF < usual) {
            found.push(format!(
                "{} extends over {} m, where bodies typically measure {} m; check the unit (see partita.units)",
                model.spec.bodies[*i].name,
                formatted(*x),
                formatted(usual)
            ));
        }
    }
    found
}

/// The largest distance between two joints of a body.
fn extent(model: &Model, i: usize) -> Option<f64> {
    let points: Vec<_> = model
        .zero_position()
        .joints
        .iter()
        .filter_map(|p| match (p.parent == i + 1, p.child == i + 1) {
            (_, true) => Some(p.child_point),
            (true, _) => Some(p.parent_point),
            _ => None,
        })
        .collect();
    let far = points.iter().flat_map(|a| points.iter().map(move |b| (*a - *b).norm())).fold(0.0, f64::max);
    (far > 0.0).then_some(far)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::examples::*;
    use partita_model::spec::Drive;
    use partita_model::spec::JointKind::Revolute;

    #[test]
    fn typing_errors() {
        let mut spec = stretched_slider_crank();
        let mut turned = spec.clone();
        turned.joints[1].kind = partita_model::spec::JointKind::Fixed;
        turned.drives.push(Drive {
            name: "motor".into(),
            measure: Measure::joint("A", 0),
            level: Level::Position,
            motion: Value::Constant(90.0),
            turning: None,
        });
        assert!(suspicious(&model(turned.clone()))[0].contains("90 rad, 14.3 full turns; 90 degrees would be 1.57"));
        turned.drives[0].level = Level::Velocity;
        assert!(suspicious(&model(turned)).is_empty());
        spec.bodies.push(body("mast", [0.0; 3], [0.0, 300.0, 0.0]));
        spec.joints.push(joint("foot", Revolute, "ground", "mast", [0.0, -300.0, 0.0], Z));
        spec.joints.push(joint("top", Revolute, "mast", "ground", [0.0, 300.0, 0.0], Z));
        let messages = suspicious(&model(spec));
        assert!(messages.len() == 1 && messages[0].starts_with("mast extends over 600 m,"), "{messages:?}");
    }
}
