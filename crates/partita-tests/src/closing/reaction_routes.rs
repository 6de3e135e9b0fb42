//! Reactions by three routes that share little: multipliers of a cut joint from the explicit closing (43), and for
//! the same joint kept in the tree, another one cut, the Newton-Euler recursion (R3) and augmented joint coordinates
//! (45).

use crate::linkages::*;
use partita_math::dense;
use partita_model::reaction::Wrench;
use partita_model::spec::Spec;
use partita_model::value::NoFunctions;
use partita_model::zero_position::Coordinates;
use partita_model::Model;
use partita_system::formulation::motion::ExplicitClosing;
use partita_system::formulation::Formulation;
use partita_system::formulation::Purpose;
use partita_system::kinematics::velocity;
use partita_system::options::FormulationOptions;
use partita_system::prelude::*;
use partita_system::record::{Output, Sample};
use partita_system::reduction::Reduction;
use partita_system::start;
use std::sync::Arc;

/// All there is to know at (q, v), by explicit closing.
fn sample(model: &Model, q: &[f64], v: &[f64], inputs: Option<&[usize]>) -> Sample {
    let rank = start::analyse(model, 0.0, q).unwrap().rank;
    let options = FormulationOptions { independent: inputs.map(<[usize]>::to_vec), ..FormulationOptions::default() };
    let mut f = ExplicitClosing::new(model, rank, &options).unwrap();
    let (mut y, mut out) = (vec![0.0; f.layout().dim()], Output::default());
    f.start(0.0, q, v, &mut y).unwrap();
    f.state_at(0.0, &y, Purpose::Look, &mut out).unwrap();
    Sample::of(&mut f, &out, &[]).unwrap()
}

/// Velocities with these rates and the others as they must be.
fn moving(model: &Model, q: &[f64], rates: &[(usize, f64)]) -> Vec<f64> {
    let mut r = Reduction::new(model, start::analyse(model, 0.0, q).unwrap().rank);
    start::choose_partition(&mut r, 0.0, q, None, None).unwrap();
    velocity::with_rates(&mut r, 0.0, q, rates).unwrap()
}

fn by_recursion(model: &Model, s: &Sample) -> Vec<Wrench> {
    let found =
        model.equations().reactions(s.t, &s.q, &s.v, &s.vdot, &s.multipliers, model.scratch().equations()).unwrap();
    // every body in balance: what any joint is held to
    assert!(found.residual < 1e-9, "{}: {:e}", model.spec.name, found.residual);
    found.joints
}

fn by_augmented_coordinates(model: &Model, s: &Sample) -> Vec<Wrench> {
    model.augmented_reactions(s.t, &s.q, &s.v, &s.vdot, &s.multipliers, &mut model.scratch()).unwrap()
}

/// Forces and moments; of a planar mechanism those in its plane, which its loops determine.
fn components(model: &Model, w: &Wrench) -> Vec<f64> {
    if model.is_planar() {
        return vec![w.force.0[0], w.force.0[1], w.moment.0[2]];
    }
    w.force.0.into_iter().chain(w.moment.0).collect()
}

fn size(all: &[Wrench]) -> f64 {
    all.iter().fold(0.0, |m: f64, w| m.max(w.force.norm()).max(w.moment.norm()))
}

/// Each joint that can be cut, against every other joint cut in its place.
fn compare(draw: impl Fn() -> Drawing, rates: &[(&str, f64)]) {
    let names: Vec<String> = draw().0.joints.iter().map(|j| j.name.clone()).collect();
    let cut = |name: &String| draw().cut(name).model();
    let (mut compared, mut cuts) = (0, 0);
    // one motion for all: that of the drawing with the first joint in the tree
    let leading = cut(&names[names.len() - 1]);
    let rates: Vec<(usize, f64)> = rates.iter().map(|(name, rate)| (velocity(&leading, name), *rate)).collect();
    let v = moving(&leading, &leading.initial(), &rates);
    for (j, name) in names.iter().enumerate() {
        let model = cut(name);
        let (q, v) = model.transferred(&leading, &leading.initial(), &v);
        let here = sample(&model, &q, &v, None);
        assert!(model.zero_position().joints[j].links.is_none(), "{name} was not cut");
        cuts += 1;
        // the wrench of the multipliers themselves
        let by_closing = by_recursion(&model, &here);
        let largest = size(&by_closing);
        for elsewhere in &names {
            let other = cut(elsewhere);
            if other.zero_position().joints[j].links.is_none() {
                continue;
            }
            let (q, v) = other.transferred(&model, &here.q, &here.v);
            let there = sample(&other, &q, &v, None);
            for (route, all) in [
                ("the recursion", by_recursion(&other, &there)),
                ("augmented coordinates", by_augmented_coordinates(&other, &there)),
            ] {
                let (x, y) = (components(&model, &by_closing[j]), components(&other, &all[j]));
                for (x, y) in x.iter().zip(&y) {
                    let title = &model.spec.name;
                    assert!(
                        (x - y).abs() <= 1e-9 * largest,
                        "{title}, {name} against {elsewhere} cut, {route}: {x} {y} of {largest}"
                    );
                }
                compared += 1;
            }
        }
    }
    assert!(cuts == names.len() && compared >= 2 * cuts, "{cuts} cuts, {compared} comparisons");
}

#[test]
fn four_bar_reactions_do_not_know_the_cut() {
    compare(|| four_bar([1.0, 0.3, 0.9, 0.7], 1.0, 1.0), &[("A", 3.0)]);
}

#[test]
fn slider_crank_reactions_do_not_know_the_cut() {
    compare(slider_crank, &[("A", 3.0)]);
}

#[test]
fn watt_reactions_do_not_know_the_cut() {
    compare(watt, &[("A", 3.0)]);
}

#[test]
fn stephenson_reactions_do_not_know_the_cut() {
    compare(stephenson, &[("A", 3.0)]);
}

#[test]
fn squeezer_reactions_do_not_know_the_cut() {
    compare(squeezer, &[("O", 30.0)]);
}

#[test]
fn rssr_reactions_do_not_know_the_cut() {
    compare(|| rssr("S"), &[("crank", 3.0)]);
}

/// The reference four-bar: links (1, 2.5, 2) of 1 kg/m on a ground of 2.2, drawn at the crank angle 0.8, D cut.
fn reference() -> Model {
    let Drawing(mut spec) = four_bar([2.2, 1.0, 2.5, 2.0], 0.8, 1.0).cut("D");
    let at = |spec: &Spec, name: &str| spec.joints.iter().find(|j| j.name == name).map(|j| j.point).unwrap();
    for (body, from, to) in [("crank", "A", "B"), ("coupler", "B", "C"), ("rocker", "D", "C")] {
        let (from, to) = (at(&spec, from), at(&spec, to));
        let along = [0, 1, 2].map(|i| to[i] - from[i]);
        let l = along[0].hypot(along[1]);
        let b = spec.bodies.iter_mut().find(|b| b.name == body).unwrap();
        b.mass = l;
        b.position = from;
        b.com = along.map(|x| 0.5 * x);
        b.inertia = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, l.powi(3) / 12.0]];
    }
    Model::new(spec, Arc::new(NoFunctions), Coordinates::Relative).unwrap()
}

/// All numbers of the reference four-bar that concern reactions, twelve digits of each.
#[test]
fn reference_four_bar_reactions() {
    let model = reference();
    let (a, b, c) = (velocity(&model, "A"), velocity(&model, "B"), velocity(&model, "C"));
    let q = model.initial();
    let v = moving(&model, &q, &[(a, 1.5)]);
    let s = sample(&model, &q, &v, Some(&[a]));
    let near = |found: &[f64], expected: &[f64], what: &str| {
        for (x, y) in found.iter().zip(expected) {
            // twelve decimals were written down
            assert!((x - y).abs() < 2e-11 * y.abs().max(1.0), "{what}: {x}, not {y}");
        }
    };
    near(&[s.v[b], s.v[c]], &[-1.855403823966, 0.712815169891], "velocities");
    near(&[s.vdot[a], s.vdot[b], s.vdot[c]], &[-10.466415143407, 14.180313468504, -4.507165728272], "accelerations");
    // (43): λ = C_D⁻ᵀ λ̃, with the generalised forces λ̃ along the dependent coordinates
    let mut needed = vec![0.0; 3];
    let mut scratch = model.scratch();
    let (_, rows) = position(&model, 0.0, &s.q);
    model
        .position(0.0, &s.q, &mut scratch, &mut [0.0; 2], &mut vec![0.0; model.pattern().nnz()], &mut [0.0; 2])
        .unwrap();
    model.velocity(0.0, &s.q, &s.v, &mut scratch, &mut [0.0; 2]).unwrap();
    model.inverse_dynamics(0.0, &s.q, &s.v, &s.vdot, &mut scratch, &mut needed).unwrap();
    near(&[needed[b], needed[c]], &[47.505507711703, -5.971888165969], "generalised forces");
    let along = |i: usize| dense::dot(&[rows[0][i], rows[1][i]], &s.multipliers);
    near(&[along(b), along(c)], &[needed[b], needed[c]], "multipliers against generalised forces");
    let joints = by_recursion(&model, &s);
    let force = |name: &str| {
        let j = model.spec.joints.iter().position(|j| j.name == name).unwrap();
        [joints[j].force.0[0], joints[j].force.0[1]]
    };
    near(&force("D"), &[7.546968149505, 27.999622165247], "D");
    near(&force("A"), &[5.975764412228, 8.554094290154], "A");
    near(&force("B"), &[3.00548613374, 3.197130719028], "B");
    near(&force("C"), &[-6.157297666382, -9.18658040682], "C");
    for (x, y) in joints.iter().zip(by_augmented_coordinates(&model, &s)) {
        near(&y.force.0, &x.force.0, "augmented coordinates");
    }
}
