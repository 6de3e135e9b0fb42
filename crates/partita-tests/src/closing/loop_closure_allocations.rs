//! A planned closing allocates nothing, neither in closed form nor by implicit blocks.

use crate::counting::allocations;
use crate::linkages::*;
use partita_model::spec::JointKind::{Revolute, Spherical, Universal};
use partita_model::spec::{Coupling, Measure, Table, Value};
use partita_model::Model;
use partita_system::closing::Closing;

fn count(model: &Model, inputs: &[&str], explicit: bool) {
    let start = model.initial();
    let inputs: Vec<usize> = inputs.iter().map(|n| velocity(model, n)).collect();
    let mut closing = model.loop_closing(0.0, &start, Some(&inputs)).unwrap();
    assert_eq!(closing.is_explicit(), explicit);
    let mut q = start.clone();
    let ((), counted) = allocations(|| {
        for k in 0..20 {
            for &v in &inputs {
                // inputs here are plain turns, the first velocities of a tree without balls before them
                q[v] = start[v] + 1e-3 * f64::from(k);
            }
            closing.close(1e-3 * f64::from(k), &mut q).unwrap();
            assert!(closing.follow(1e-3 * f64::from(k), &mut q).unwrap() < 1e-3);
        }
    });
    assert_eq!(counted, 0, "{}: {} allocations", model.spec.name, counted);
}

#[test]
fn closing_allocates_nothing() {
    let four_bar = drawing("four-bar")
        .pin("A", "ground", "crank", [0.0, 0.0])
        .pin("B", "crank", "coupler", [0.3, 0.4])
        .pin("C", "coupler", "rocker", [1.2, 0.9])
        .pin("D", "ground", "rocker", [1.0, 0.0]);
    count(&four_bar.clone().model(), &["A"], true);
    let table = Table { breaks: vec![0.0, 1.0], coefficients: vec![[0.0, 0.0, 1.0, 0.0]] };
    count(&four_bar.clone().drive("A", Value::Table(table)).model(), &[], true);
    // a second bar behind a gear, and one behind a distance
    let mut geared = four_bar.clone().pin("E", "ground", "wheel", [2.0, 0.0]);
    let terms = vec![Measure::joint("E", 0), Measure::joint("D", 0)];
    let (name, word) = ("gear".to_string(), "gear".to_string());
    geared.0.couplings.push(Coupling::Linear {
        name,
        word,
        terms,
        factors: vec![1.0, 2.0],
        offset: 0.0,
        given_as: None,
    });
    count(&geared.model(), &["A"], true);
    let mut tied = four_bar.clone().pin("E", "ground", "wheel", [2.0, 0.0]);
    let (body1, point1) = ("rocker".to_string(), [0.1, 0.3, 0.0]);
    let measure = Measure::Distance { body1, point1, body2: "wheel".into(), point2: [0.2, 0.4, 0.0] };
    let (name, word) = ("distance".to_string(), "distance".to_string());
    let drawn: f64 = 0.0 + (2.2_f64 - 1.3).hypot(0.4 - 1.2);
    tied.0.couplings.push(Coupling::Linear {
        name,
        word,
        terms: vec![measure],
        factors: vec![1.0],
        offset: drawn,
        given_as: None,
    });
    count(&tied.model(), &["A"], false);
    // a triad: both bars of a Stephenson chain's four-bar loop unknown
    let triad = drawing("triad")
        .pin("1", "ground", "a", [0.0, 0.0])
        .pin("2", "a", "t2", [0.2, 0.8])
        .pin("3", "ground", "b", [1.8, 0.1])
        .pin("4", "b", "t2", [1.5, 1.4])
        .pin("5", "ground", "c", [-0.9, 0.3])
        .pin("6", "c", "d", [-0.7, 1.5])
        .pin("7", "d", "t2", [0.6, 1.9]);
    count(&triad.model(), &["5"], false);
    let space = drawing("RSUR")
        .joint("crank", Revolute, "ground", "crank", [0.0; 3], Z)
        .joint("A", Spherical, "crank", "rod", [0.3, 0.0, 0.1], Z)
        .joint("B", Universal, "rod", "rocker", [0.9, 0.2, 1.1], [0.1, 1.0, 0.0])
        .and([1.0, 0.0, 0.2])
        .joint("rocker", Revolute, "ground", "rocker", [1.2, 0.0, 0.2], [0.2, 1.0, 0.3])
        .cut("B");
    count(&space.model(), &["crank"], true);
}
