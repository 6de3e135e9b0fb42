//! A joint of the user's own, by a function of the user's.

use partita::model::spec::Follower;
use partita::model::value::{Functions, RELATION};
use partita::{Error, GROUND, Joint, JointKind, Mechanism, Model, Simulation};
use std::error::Error as Failure;
use std::f64::consts::TAU;
use std::sync::Arc;

const PITCH: f64 = 0.3;

/// Relation 0 of x = (z, rz): z − rz · pitch / 2π.
struct Thread;

impl Functions for Thread {
    fn count(&self) -> usize {
        1
    }
    fn scalar(&self, i: usize, _: f64, _: &[f64], _: &[f64]) -> Result<f64, Box<dyn Failure + Send + Sync>> {
        Err(format!("function {i} is a relation").into())
    }
    fn vector(&self, i: usize, _: f64, _: &[f64], _: &[f64]) -> Result<[f64; 3], Box<dyn Failure + Send + Sync>> {
        Err(format!("function {i} is a relation").into())
    }
    fn motion(&self, i: usize, _: f64) -> Result<[f64; 3], Box<dyn Failure + Send + Sync>> {
        Err(format!("function {i} is a relation").into())
    }
    fn relation(
        &self,
        _: usize,
        _: f64,
        x: &[f64],
        _: &[f64],
    ) -> Result<[f64; RELATION], Box<dyn Failure + Send + Sync>> {
        let mut found = [0.0; RELATION];
        (found[0], found[3], found[4]) = (x[0] - x[1] * PITCH / TAU, 1.0, -PITCH / TAU);
        Ok(found)
    }
}

fn nut(joint: Joint) -> Result<Model, Error> {
    let m = Mechanism::new("jack").gravity([0.4, 0.0, -9.81]);
    m.rod("nut", [0.1, 0.0, 0.0], [0.6, 0.2, 0.0], 2.0).joint(joint).compile_with(Arc::new(Thread))
}

#[test]
fn a_screw_of_ones_own_is_the_screw() -> Result<(), Error> {
    let mut screw = Joint::new("J", JointKind::Screw, GROUND, "nut", [0.0; 3]);
    (screw.axis, screw.pitch) = (Some([0.0, 0.0, 1.0]), Some(PITCH));
    let mut own = Joint::new("J", JointKind::Custom, GROUND, "nut", [0.0; 3]);
    own.free = Some(vec!["rz".into()]);
    own.followers = vec![Follower { direction: "z".into(), function: 0 }];
    let mut runs = Vec::new();
    for joint in [screw, own] {
        let model = nut(joint)?;
        let run = model.simulate(&model.assemble(&[])?, &Simulation::new(0.5).tolerances(1e-12, 1e-13))?;
        assert!(run.is_success(), "{}", run.message());
        runs.push((run.joint("J")?, run.reaction("J")?));
    }
    let [(motion, reaction), (of_own, by_own)] = &runs[..] else { panic!("two runs") };
    for (a, b) in motion.iter().zip(of_own) {
        assert!(a.position.iter().zip(&b.position).all(|(x, y)| (x - y).abs() < 1e-11));
        assert!(a.velocity.iter().zip(&b.velocity).all(|(x, y)| (x - y).abs() < 1e-10));
    }
    for (a, b) in reaction.iter().zip(by_own) {
        assert!((0..3).all(|i| (a.force[i] - b.force[i]).abs() < 1e-8 && (a.moment[i] - b.moment[i]).abs() < 1e-8));
    }
    assert!(motion.last().is_some_and(|x| x.position[1].abs() > 0.1));
    Ok(())
}

#[test]
fn a_joint_of_ones_own_that_has_no_angles_is_refused() {
    let mut own = Joint::new("J", JointKind::Custom, GROUND, "nut", [0.0; 3]);
    own.free = Some(vec!["rx".into(), "rz".into()]);
    own.followers = vec![Follower { direction: "ry".into(), function: 0 }];
    let error = nut(own.clone()).err().map(|e| e.to_string()).unwrap_or_default();
    assert!(error.contains("three axes"), "{error}");
    own.followers = Vec::new();
    assert!(nut(own).err().is_some_and(|e| e.to_string().contains("generic joint")));
}
