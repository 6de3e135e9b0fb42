//! Linkages drawn by their joints, and what every explicit closing must satisfy.
#![allow(dead_code, reason = "each test file uses the part it needs")]

use partita_math::dense::{lu, lu_solve};
use partita_math::spatial::Quaternion;
use partita_model::loop_closure::LoopClosing;
use partita_model::spec::JointKind::{Revolute, Spherical, Universal};
use partita_model::spec::{
    Body, Cut, Drive, Joint, JointKind, Level, Measure, Spec, Value, DRAWING_TOLERANCE, VERSION,
};
use partita_model::tree::LinkMotion;
use partita_model::value::NoFunctions;
use partita_model::zero_position::Coordinates;
use partita_model::Model;
use partita_system::closing::Closing;
use partita_system::prelude::*;
use partita_system::record::Output;
use partita_system::reduction::largest;
use std::f64::consts::TAU;
use std::sync::Arc;

pub const Z: [f64; 3] = [0.0, 0.0, 1.0];

/// A drawing under way.
#[derive(Clone)]
pub struct Drawing(pub Spec);

pub fn drawing(name: &str) -> Drawing {
    Drawing(Spec {
        partita: VERSION,
        name: name.into(),
        gravity: [0.0, -9.81, 0.0],
        drawing_tolerance: DRAWING_TOLERANCE,
        bodies: vec![],
        joints: vec![],
        couplings: vec![],
        drives: vec![],
        forces: vec![],
        rotors: vec![],
        sights: vec![],
        parting: std::collections::BTreeMap::new(),
    })
}

fn body(name: &str, at: [f64; 3]) -> Body {
    Body {
        name: name.into(),
        mass: 1.0,
        com: [0.1, 0.05, 0.02],
        inertia: [[0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.08]],
        position: at,
        orientation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        shape: None,
    }
}

impl Drawing {
    /// A joint between two bodies, which are drawn where they are first named.
    pub fn joint(
        mut self,
        name: &str,
        kind: JointKind,
        parent: &str,
        child: &str,
        point: [f64; 3],
        axis: [f64; 3],
    ) -> Self {
        for b in [parent, child] {
            if b != "ground" && !self.0.bodies.iter().any(|x| x.name == b) {
                self.0.bodies.push(body(b, point));
            }
        }
        self.0.joints.push(Joint { axis: Some(axis), ..Joint::new(name, kind, parent, child, point) });
        self
    }
    pub fn pin(self, name: &str, parent: &str, child: &str, at: [f64; 2]) -> Self {
        self.joint(name, Revolute, parent, child, [at[0], at[1], 0.0], Z)
    }
    pub fn slide(self, name: &str, parent: &str, child: &str, at: [f64; 2], along: [f64; 2]) -> Self {
        self.joint(name, JointKind::Prismatic, parent, child, [at[0], at[1], 0.0], [along[0], along[1], 0.0])
    }
    /// Second axis of the joint drawn last.
    pub fn and(mut self, axis2: [f64; 3]) -> Self {
        self.0.joints.last_mut().unwrap().axis2 = Some(axis2);
        self
    }
    /// Cut this joint and no other if that opens the loop.
    pub fn cut(mut self, name: &str) -> Self {
        for j in &mut self.0.joints {
            if j.name == name {
                j.cut = Cut::Always;
            }
        }
        self
    }
    pub fn drive(mut self, joint: &str, motion: Value) -> Self {
        let (name, measure) = (format!("drive of {joint}"), Measure::joint(joint, 0));
        self.0.drives.push(Drive::new(name, measure, motion, Level::Position));
        self
    }
    /// Without gravity.
    pub fn weightless(mut self) -> Self {
        self.0.gravity = [0.0; 3];
        self
    }
    pub fn model(self) -> Model {
        Model::new(self.0, Arc::new(NoFunctions), Coordinates::Relative).unwrap()
    }
}

/// The point at l2 from P and l3 from Q on the side ε of the line PQ.
pub fn dyad(p: [f64; 2], q: [f64; 2], l2: f64, l3: f64, sign: f64) -> [f64; 2] {
    let (dx, dy) = (q[0] - p[0], q[1] - p[1]);
    let r = dx.hypot(dy);
    let u = (r * r + l2 * l2 - l3 * l3) / (2.0 * r);
    let h = sign * (l2 * l2 - u * u).sqrt();
    [p[0] + (u * dx - h * dy) / r, p[1] + (u * dy + h * dx) / r]
}

pub fn polar(l: f64, angle: f64) -> [f64; 2] {
    [l * angle.cos(), l * angle.sin()]
}

/// Lengths ground, crank, coupler, rocker; drawn at the crank angle, C on the side ε.
pub fn four_bar([l0, l1, l2, l3]: [f64; 4], crank: f64, sign: f64) -> Drawing {
    let (b, d) = (polar(l1, crank), [l0, 0.0]);
    let c = dyad(b, d, l2, l3, sign);
    drawing("four-bar")
        .pin("A", "ground", "crank", [0.0; 2])
        .pin("B", "crank", "coupler", b)
        .pin("C", "coupler", "rocker", c)
        .pin("D", "ground", "rocker", d)
}

pub const ROCKER: [f64; 3] = [0.2, 1.0, 0.3];
pub const CRANK_AT: [f64; 3] = [0.3, 0.0, 0.1];
pub const ROCKER_AT: [f64; 3] = [0.9, 0.2, 1.1];
pub const PIVOT: [f64; 3] = [1.2, 0.0, 0.2];

/// RSSR, or RSUR: crank about z in the origin, rocker about a skew axis.
pub fn rssr(last: &str) -> Drawing {
    let d = drawing("RSSR")
        .joint("crank", Revolute, "ground", "crank", [0.0; 3], Z)
        .joint("A", Spherical, "crank", "rod", CRANK_AT, Z);
    let d = if last == "U" {
        d.joint("B", Universal, "rod", "rocker", ROCKER_AT, [0.1, 1.0, 0.0]).and([1.0, 0.0, 0.2])
    } else {
        d.joint("B", Spherical, "rod", "rocker", ROCKER_AT, Z)
    };
    d.joint("rocker", Revolute, "ground", "rocker", PIVOT, ROCKER)
}

/// Crank 0.3 in the origin, coupler 0.9, rocker 0.7 on the pin D at 1; B and C at the crank angle 60 degrees.
fn crank_and_rocker() -> [[f64; 2]; 3] {
    let (b, d) = (polar(0.3, TAU / 6.0), [1.0, 0.0]);
    [b, dyad(b, d, 0.9, 0.7, 1.0), d]
}

/// The point at `length` from `from`, `angle` on from the direction towards `to`.
fn arm(from: [f64; 2], to: [f64; 2], length: f64, angle: f64) -> [f64; 2] {
    let [x, y] = polar(length, angle + (to[1] - from[1]).atan2(to[0] - from[0]));
    [from[0] + x, from[1] + y]
}

/// A crank and its rocker, whose second arm drives another pair of links: Watt's chain of the second kind.
pub fn watt() -> Drawing {
    let [b, c, d] = crank_and_rocker();
    let e = arm(d, c, 0.6, -70_f64.to_radians());
    let (f, g) = (dyad(e, [2.0, 0.0], 0.7, 0.6, 1.0), [2.0, 0.0]);
    drawing("Watt")
        .pin("A", "ground", "crank", [0.0; 2])
        .pin("B", "crank", "coupler", b)
        .pin("C", "coupler", "rocker", c)
        .pin("D", "ground", "rocker", d)
        .pin("E", "rocker", "link", e)
        .pin("F", "link", "lever", f)
        .pin("G", "ground", "lever", g)
}

/// The same with the second pair driven by a point of the coupler: Stephenson's chain of the third kind.
pub fn stephenson() -> Drawing {
    let [b, c, d] = crank_and_rocker();
    let p = arm(b, c, 0.6, 50_f64.to_radians());
    let g = [-0.9, 0.4];
    let f = dyad(p, g, 0.8, 0.7, -1.0);
    drawing("Stephenson")
        .pin("A", "ground", "crank", [0.0; 2])
        .pin("B", "crank", "coupler", b)
        .pin("C", "coupler", "rocker", c)
        .pin("D", "ground", "rocker", d)
        .pin("P", "coupler", "link", p)
        .pin("F", "link", "lever", f)
        .pin("G", "ground", "lever", g)
}

/// Crank of 0.3, rod of 1, the slide 0.1 beside the crank's pin.
pub fn slider_crank() -> Drawing {
    let pin = polar(0.3, 0.6);
    let wrist = [pin[0] + (1.0 - (pin[1] - 0.1).powi(2)).sqrt(), 0.1];
    drawing("slider-crank")
        .pin("A", "ground", "crank", [0.0; 2])
        .pin("B", "crank", "rod", pin)
        .pin("C", "rod", "slider", wrist)
        .slide("D", "ground", "slider", wrist, [1.0, 0.0])
}

/// Seven bodies and three loops after Andrews' squeezer, in decimetres: E is the pin of four links.
pub fn squeezer() -> Drawing {
    let (a, b) = ([-0.7, -0.02], [-0.36, 0.33]);
    let f = polar(0.07, 0.4);
    let e = [f[0] - 0.28 * 0.1_f64.cos(), f[1] - 0.28 * 0.1_f64.sin()];
    let (g, h) = (arm(a, e, 0.4, 0.5), arm(a, e, 0.4, -0.4));
    drawing("squeezer")
        .pin("O", "ground", "OF", [0.0; 2])
        .pin("F", "OF", "EF", f)
        .pin("B", "ground", "EBD", b)
        .pin("A1", "ground", "AG", a)
        .pin("G", "AG", "GE", g)
        .pin("A2", "ground", "AH", a)
        .pin("H", "AH", "HE", h)
        .pin("E1", "EF", "EBD", e)
        .pin("E2", "EF", "GE", e)
        .pin("E3", "EF", "HE", e)
}

pub fn velocity(model: &Model, name: &str) -> usize {
    model.structure().velocities.iter().position(|v| &*v.name == name).unwrap_or_else(|| panic!("no velocity {name}"))
}

pub fn coordinate(model: &Model, name: &str) -> usize {
    let at = |n: &String| n == name;
    model.zero_position().coordinate_names.iter().position(at).unwrap_or_else(|| panic!("no coordinate {name}"))
}

/// Largest |Φ|, and C by rows.
pub fn position(model: &Model, t: f64, q: &[f64]) -> (f64, Vec<Vec<f64>>) {
    let (size, pattern) = (model.size(), model.pattern());
    let (mut phi, mut a, mut c) = (vec![0.0; size.holonomic], vec![0.0; size.rows], vec![0.0; pattern.nnz()]);
    model.position(t, q, &mut model.scratch(), &mut phi, &mut c, &mut a).unwrap();
    let mut dense = vec![vec![0.0; size.nv]; size.rows];
    for (i, row) in dense.iter_mut().enumerate() {
        pattern.row(i).for_each(|e| row[pattern.col_idx[e]] = c[e]);
    }
    (phi.iter().fold(0.0, |m: f64, x| m.max(x.abs())), dense)
}

/// The branches at the last closing.
pub fn branches(closing: &LoopClosing) -> Vec<i8> {
    closing.state().iter().map(|s| s.branch).collect()
}

/// Closing within round-off: a few ulp of the size, and what the rounding of large angles itself opens.
pub fn assert_closed(model: &Model, t: f64, q: &[f64], what: &str) {
    let angle = q.iter().fold(1.0, |m: f64, x| m.max(x.abs()));
    let (closure_error, _) = position(model, t, q);
    let allowed = model.extent().max(1.0) * f64::EPSILON * (20.0 + 6.0 * angle);
    assert!(closure_error <= allowed, "{what}: |Φ| = {closure_error:.2e}, allowed {allowed:.2e}");
}

/// Velocities on the way through five positions h apart, by differences of fourth order.
fn velocities(model: &Model, q: &[Vec<f64>; 5], h: f64) -> Vec<f64> {
    let d = |i: usize| (8.0 * (q[3][i] - q[1][i]) - (q[4][i] - q[0][i])) / (12.0 * h);
    let mut v = vec![0.0; model.size().nv];
    for l in model.equations().full.links.iter().skip(1) {
        if matches!(l.motion, LinkMotion::Ball) {
            let p = Quaternion([0, 1, 2, 3].map(|k| q[2][l.q + k]));
            let back = Quaternion([p.0[0], -p.0[1], -p.0[2], -p.0[3]]);
            let rate = back.times(&Quaternion([0, 1, 2, 3].map(|k| d(l.q + k))));
            (0..3).for_each(|k| v[l.v + k] = 2.0 * rate.0[k + 1]);
        } else {
            v[l.v] = d(l.q);
        }
    }
    v
}

/// A = dq_D/dq_I of the closed forms equals −C_D⁻¹ C_I, block by block in the order of the blocks.           (38)
pub fn assert_tangent(model: &Model, closing: &mut LoopClosing, t: f64, q: &[f64]) {
    let inputs = closing.inputs().to_vec();
    let blocks = closing.blocks().to_vec();
    for &input in &inputs {
        let mut samples: [Vec<f64>; 5] = std::array::from_fn(|_| q.to_vec());
        let mut differences = |h: f64| {
            for (k, at) in samples.iter_mut().enumerate() {
                at.copy_from_slice(q);
                let mut dv = vec![0.0; model.size().nv];
                dv[input] = h * (k as f64 - 2.0);
                model.step(at, &dv);
                closing.close(t, at).unwrap();
            }
            velocities(model, &samples, h)
        };
        let h = 1e-3 * model.structure().displacement(input);
        let (coarse, found) = (differences(2.0 * h), differences(h));
        let (_, c) = position(model, t, &samples[2]);
        let mut v = vec![0.0; found.len()];
        let mut solved = vec![false; v.len()];
        // a link that may spin between two balls takes its spin from its own input
        for &i in &inputs {
            (v[i], solved[i]) = (found[i], true);
        }
        for b in &blocks {
            assert_eq!(b.rows.len(), b.unknown.len(), "{}", b.words);
            let n = b.rows.len();
            let mut m = vec![0.0; n * n];
            let mut x = vec![0.0; n];
            for (i, &r) in b.rows.iter().enumerate() {
                for (k, &value) in c[r].iter().enumerate() {
                    if let Some(j) = b.unknown.iter().position(|&u| u == k) {
                        m[i * n + j] = value;
                    } else if value != 0.0 {
                        assert!(solved[k], "{}: row {r} needs {}", b.words, model.structure().velocities[k].name);
                        x[i] -= value * v[k];
                    }
                }
            }
            let mut pivots = vec![0; n];
            lu(&mut m, n, &mut pivots).unwrap();
            lu_solve(&m, n, &pivots, &mut x);
            for (&u, x) in b.unknown.iter().zip(x) {
                assert!(!std::mem::replace(&mut solved[u], true), "{} twice", model.structure().velocities[u].name);
                v[u] = x;
            }
        }
        assert!(solved.iter().all(|s| *s), "a velocity is in no block");
        for (i, (a, b)) in found.iter().zip(&v).enumerate() {
            // the error of the differences is a fifteenth of what halving their step changes, their round-off 1e-15/h
            let allowed = 1e-8 * (1.0 + b.abs()) + 0.2 * (coarse[i] - a).abs();
            assert!((a - b).abs() < allowed, "{}: {a} by differences, {b}", model.structure().velocities[i].name);
        }
    }
}

/// Turn an input by `angle` in `count` steps: closed at every one, branches kept, tangent checked now and then.
pub fn sweep(model: &Model, closing: &mut LoopClosing, input: &str, angle: f64, count: usize) -> Vec<f64> {
    let mut q = model.initial();
    closing.close(0.0, &mut q).unwrap();
    let at = coordinate(model, input);
    let own = branches(closing);
    let from = q[at];
    for k in 0..=count {
        q[at] = from + angle * k as f64 / count as f64;
        closing.close(0.0, &mut q).unwrap_or_else(|e| panic!("{input} = {}: {e}", q[at]));
        assert_closed(model, 0.0, &q, &format!("{} at {input} = {}", model.spec.name, q[at]));
        assert_eq!(branches(closing), own, "branch lost at {input} = {}", q[at]);
        assert!(closing.state().iter().all(|s| s.pivot > 0.0 && s.pivot <= 1.0));
        if k % (count / 7).max(1) == 3 {
            assert_tangent(model, closing, 0.0, &q.clone());
            closing.close(0.0, &mut q).unwrap();
        }
    }
    q
}

/// The closing for these inputs from the drawn position.
pub fn by<'m>(model: &'m Model, names: &[&str]) -> LoopClosing<'m> {
    let inputs: Vec<usize> = names.iter().map(|n| velocity(model, n)).collect();
    model.loop_closing(0.0, &model.initial(), Some(&inputs)).unwrap()
}

/// The blocks of a closing.
pub fn words(closing: &LoopClosing) -> Vec<String> {
    closing.blocks().iter().map(|b| b.words.clone()).collect()
}

/// Two ternary links t1, t2; Watt: t1-t2, two dyads. Stephenson: t1-a-t2, t1-b-t2, t1-c-d-t2.
pub fn six_bar(watt: bool, ground: &str) -> Drawing {
    let name = |s: &'static str| if s == ground { "ground" } else { s };
    let d = drawing("six-bar");
    if watt {
        return d
            .pin("1", name("t1"), name("t2"), [0.0, 0.0])
            .pin("2", name("t2"), name("a"), [0.3, 0.9])
            .pin("3", name("a"), name("b"), [1.6, 1.3])
            .pin("4", name("t1"), name("b"), [1.5, 0.0])
            .pin("5", name("t2"), name("c"), [-0.4, 0.8])
            .pin("6", name("c"), name("d"), [-1.5, 1.2])
            .pin("7", name("t1"), name("d"), [-1.4, -0.2]);
    }
    d.pin("1", name("t1"), name("a"), [0.0, 0.0])
        .pin("2", name("a"), name("t2"), [0.2, 0.8])
        .pin("3", name("t1"), name("b"), [1.8, 0.1])
        .pin("4", name("b"), name("t2"), [1.5, 1.4])
        .pin("5", name("t1"), name("c"), [-0.9, 0.3])
        .pin("6", name("c"), name("d"), [-0.7, 1.5])
        .pin("7", name("d"), name("t2"), [0.6, 1.9])
}

/// Largest |Φ| at an output; NaN counts as infinite.
pub fn closure_error(model: &Model, s: &Output) -> f64 {
    let size = model.size();
    let (mut phi, mut c, mut a) = (vec![0.0; size.holonomic], vec![0.0; model.pattern().nnz()], vec![0.0; size.rows]);
    model.position(s.t, &s.q, &mut model.scratch(), &mut phi, &mut c, &mut a).unwrap();
    largest(phi)
}
