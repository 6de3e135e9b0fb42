use super::*;
use crate::examples::{bricard, chain, compiled, four_bar, model, spherical_four_bar, tilted};
use partita_math::tolerance;
use partita_model::spec::JointKind::{Cylindrical, Revolute, Spherical, Universal};
use partita_model::zero_position::Coordinates;
use partita_model::Model;
use partita_system::kinematics::assembly;
use partita_system::prelude::*;

fn closed(m: &Model) -> Vec<f64> {
    let mut q = m.initial();
    assembly::close(m, 0.0, &mut q, tolerance::CLOSED, &[]).unwrap();
    q
}

/// All coordinates of joints that are one by one, a point of the last body and its orientation.
fn all_goals(m: &Model) -> Vec<Target> {
    let mut goals = Vec::new();
    for joint in 0..m.spec.joints.len() {
        let count: usize = m.shape(joint).motions.iter().map(|x| x.coordinates()).sum();
        goals.extend((0..count).map(|coordinate| Goal::Joint { joint, coordinate }));
    }
    let body = m.spec.bodies.len() - 1;
    goals.extend((0..3).map(|axis| Goal::Point { body, point: [0.3, -0.2, 0.5], axis }));
    // a reference that is a quarter of a turn away about one axis, and a little about another
    let (s, c) = 0.2f64.sin_cos();
    let reference = [0.0, -1.0, 0.0, c, 0.0, -s, s, 0.0, c];
    goals.extend((0..3).map(|axis| Goal::Turn { body, reference, axis }));
    goals.iter().filter_map(|goal| Target::new(m, goal, "goal").ok()).collect()
}

fn many_of(m: &Model, q: &[f64], targets: &[Target], values: &[f64]) -> Poses {
    many(m, 0.0, q, targets, values, None, &mut || Ok(())).unwrap()
}

fn closure_error(m: &Model, q: &[f64]) -> f64 {
    let (mut phi, mut c, mut a) =
        (vec![0.0; m.size().holonomic], vec![0.0; m.pattern().nnz()], vec![0.0; m.size().rows]);
    m.position(0.0, q, &mut m.scratch(), &mut phi, &mut c, &mut a).unwrap();
    phi.iter().fold(0.0, |m: f64, x| m.max(x.abs()))
}

#[test]
fn gradients_are_those_of_the_values() {
    let mut universal = four_bar([Revolute, Spherical, Universal, Revolute]);
    universal.joints[2].axis2 = Some([0.6, 0.8, 0.0]);
    let cylindrical = tilted(four_bar([Revolute, Spherical, Cylindrical, Revolute]));
    for coordinates in [Coordinates::Relative, Coordinates::Absolute] {
        for spec in [universal.clone(), cylindrical.clone(), four_bar([Revolute; 4]), bricard()] {
            let m = compiled(spec, coordinates);
            let (n, mut s) = (m.size().nv, m.scratch());
            // away from the drawing, closed: coordinates of open joints agree with their rates only approximately
            let first = Target::new(&m, &Goal::Joint { joint: 0, coordinate: 0 }, "first").unwrap();
            let ask = Ask { levels: vec![vec![(first, 0.3)]], tolerance: tolerance::CLOSED, ..Ask::default() };
            let q = one(&m, 0.0, &m.initial(), &ask).unwrap().q;
            let (rest, mut memory) = (vec![0.0; n], vec![0.0; n]);
            let goals = all_goals(&m);
            assert!(goals.len() >= 7);
            for x in &goals {
                let mut gradient = vec![0.0; n];
                let mut own = x.velocities.iter();
                x.gradient(&m, &q, [0.0; 3], &mut memory, &mut s, |g| gradient[*own.next().unwrap()] = g);
                assert!(memory.iter().all(|v| *v == 0.0));
                let here = x.value(&m, &q, &rest, &mut s, 0.0);
                for v in 0..n {
                    let mut at = |h: f64| {
                        let mut q = q.clone();
                        let mut dv = vec![0.0; n];
                        dv[v] = h;
                        m.step(&mut q, &dv);
                        x.value(&m, &q, &rest, &mut s, here)
                    };
                    let slope = (at(1e-5) - at(-1e-5)) / 2e-5;
                    assert!((slope - gradient[v]).abs() < 1e-8, "{v}: {slope} {}", gradient[v]);
                }
            }
        }
    }
}

/// Loops whose conditions depend on each other, and one with a link that spins: closed with all rows along a
/// continuation.
#[test]
fn poses_are_where_continuation_leads() {
    let kinds = [Revolute, Spherical, Spherical, Revolute];
    for (spec, far) in [
        (tilted(four_bar([Revolute; 4])), 0.6),
        (tilted(four_bar(kinds)), 0.6),
        (bricard(), 0.5),
        (spherical_four_bar(), 0.4),
        (tilted(chain(3, 0.7)), 0.5),
    ] {
        let name = spec.name.clone();
        let m = model(spec);
        let q = closed(&m);
        let first = Target::new(&m, &Goal::Joint { joint: 0, coordinate: 0 }, "first").unwrap();
        let Some((at, _)) = first.own() else { panic!("{name}: the first joint is in the tree") };
        let values = [-far, -0.1, 0.0, 0.2, far];
        let poses = many_of(&m, &q, std::slice::from_ref(&first), &values);
        for (i, &value) in values.iter().enumerate() {
            assert_eq!(poses.outcomes[i], Outcome::Closed, "{name} {value} {:?}", poses.reasons);
            let found = &poses.q[i * q.len()..][..q.len()];
            assert_eq!(found[at], value);
            assert!(closure_error(&m, found) < 1e-11, "{name} {}", closure_error(&m, found));
            let mut walked = q.clone();
            for part in 1..=20 {
                let next = value * f64::from(part) / 20.0;
                assembly::move_to(&m, 0.0, &mut walked, &[(at, next)], tolerance::CLOSED).unwrap();
            }
            // the spin of a link is arbitrary: compare points of the last body
            let (rest, mut s) = (vec![0.0; m.size().nv], m.scratch());
            for axis in 0..3 {
                let point = Goal::Point { body: m.spec.bodies.len() - 1, point: [0.3, -0.2, 0.5], axis };
                let x = Target::new(&m, &point, "point").unwrap();
                let (a, b) = (x.value(&m, found, &rest, &mut s, 0.0), x.value(&m, &walked, &rest, &mut s, 0.0));
                assert!((a - b).abs() < 1e-8, "{name} {value}: {a} {b}");
            }
        }
    }
}

/// The same poses by closed forms from the crank and by following from the joint that closes the loop.
#[test]
fn following_finds_what_closed_forms_find() {
    let m = model(four_bar([Revolute; 4]));
    let q = closed(&m);
    let targets: Vec<Target> =
        (0..4).map(|joint| Target::new(&m, &Goal::Joint { joint, coordinate: 0 }, "turn").unwrap()).collect();
    let cut = targets.iter().position(|x| x.own().is_none()).unwrap();
    let values: Vec<f64> = (0..9).map(|i| 0.1 * f64::from(i) - 0.4).collect();
    let explicit = many_of(&m, &q, &targets[..1], &values);
    assert!(explicit.branch.is_some() && explicit.outcomes.iter().all(|x| *x == Outcome::Closed));
    let (rest, mut s) = (vec![0.0; m.size().nv], m.scratch());
    let turned: Vec<f64> = explicit.q.chunks(q.len()).map(|q| targets[cut].value(&m, q, &rest, &mut s, 0.0)).collect();
    let followed = many_of(&m, &q, &targets[cut..=cut], &turned);
    assert!(followed.branch.is_none());
    for (a, b) in explicit.q.iter().zip(&followed.q) {
        assert!((a - b).abs() < 1e-10, "{a} {b}");
    }
}

#[test]
fn what_cannot_be_placed_is_refused() {
    let m = model(tilted(four_bar([Revolute, Spherical, Spherical, Revolute])));
    let ball = Target::new(&m, &Goal::Joint { joint: 1, coordinate: 0 }, "B.qw").unwrap_err().to_string();
    assert!(ball.contains("use points of the body"), "{ball}");
    let first = Target::new(&m, &Goal::Joint { joint: 0, coordinate: 0 }, "A").unwrap();
    let q = closed(&m);
    let refused = many(&m, 0.0, &q, &[], &[1.0], None, &mut || Ok(())).unwrap_err().to_string();
    assert!(refused.contains("do not fit"), "{refused}");
    let far = many(&m, 0.0, &q, &[first], &[1.0, 1e9], None, &mut || Ok(())).unwrap_err().to_string();
    assert!(far.contains("pose 1"), "{far}");
}
