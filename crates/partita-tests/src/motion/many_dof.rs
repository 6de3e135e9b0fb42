//! The recursion over clusters is the reduced equations: in every way through them, for a few degrees of freedom and
//! for many.

use crate::mechanisms::{apart, compile, on_random_mechanisms, Moment, Wishes};
use partita_math::dense::Matrix;
use partita_math::factor::svd;
use partita_model::clusters::Preference;
use partita_model::zero_position::Coordinates;
use partita_model::Model;
use partita_system::prelude::*;
use partita_system::reduction::Reduction;
use partita_system::start;

/// What well-posed random mechanisms lose: C M⁻¹ Cᵀ squares a condition of up to 1e3.
const CLOSE: f64 = 1e-10;

/// By how much the distance is estimated too large at the most, far from singular positions: many singular values are
/// nearly the least there.
const FAR_AWAY: f64 = 4.0;

/// The smallest singular value of the kept rows of C, rows and columns in characteristic displacements.
fn least_singular_value(r: &Reduction<Model>, model: &Model) -> f64 {
    let pattern = model.pattern();
    let mut c = Matrix::new(r.planned.partition.rows.len(), model.size().nv);
    for (row, &i) in r.planned.partition.rows.iter().enumerate() {
        let size = model.structure().rows[i].size();
        for e in pattern.row(i) {
            let column = pattern.col_idx[e];
            c.row_mut(row)[column] += r.at.c[e] * model.structure().displacement(column) / size;
        }
    }
    svd(&c).unwrap().s.last().copied().unwrap()
}

/// Everything that depends on the way, at one state with the independent velocities given.
struct StateQuantities {
    v: Vec<f64>,
    vdot: Vec<f64>,
    lambda: Vec<f64>,
    /// ρ²: of a locked coordinate a difference of equal numbers is left, and its root is no measure of error.
    rho2: Vec<f64>,
    quality: [f64; 2],
}

fn seen(r: &mut Reduction<Model>, m: &Moment, independent: &[usize]) -> StateQuantities {
    r.position(m.t, &m.q).unwrap();
    r.refresh_scales(m.t, &m.q).unwrap();
    r.set_partition(m.t, independent).unwrap();
    let speeds: Vec<f64> = independent.iter().map(|&i| m.v[i]).collect();
    r.evaluate(m.t, &m.q, &speeds).unwrap();
    let size = r.size();
    let (mut vdot, mut lambda, mut rho) = (vec![0.0; size.nv], vec![0.0; size.rows], vec![0.0; size.nv]);
    r.full_acceleration(&mut vdot);
    r.multipliers(m.t, &m.q, &vdot, &mut lambda).unwrap();
    r.measure(m.t, &m.q, &mut rho).unwrap();
    let q = r.quality(m.t, &m.q).unwrap();
    StateQuantities {
        v: r.at.v.clone(),
        vdot,
        lambda,
        rho2: rho.iter().map(|x| x * x).collect(),
        quality: [q.sigma, q.sqrt_mu],
    }
}

fn agrees(model: &Model, m: &Moment, one_cluster: bool) {
    let mut dense = Reduction::dense(model, m.rank);
    start::choose_partition(&mut dense, m.t, &m.q, None, None).unwrap();
    let independent = dense.planned.partition.independent.clone();
    let expected = seen(&mut dense, m, &independent);
    for recursion in [Preference::PartialVelocities, Preference::RangeSpace] {
        let model = compile(&model.spec, model.coordinates()).unwrap().with_recursion(recursion);
        let mut r = Reduction::new(&model, m.rank);
        let found = seen(&mut r, m, &independent);
        assert!(r.by_clusters());
        for (what, x, y) in [
            ("v", &found.v, &expected.v),
            ("v'", &found.vdot, &expected.vdot),
            ("multipliers", &found.lambda, &expected.lambda),
            ("rho²", &found.rho2, &expected.rho2),
        ] {
            assert!(apart(x, y) < CLOSE, "{recursion:?}: {what} differ by {:.1e}", apart(x, y));
        }
        if one_cluster && r.planned.clusters.count == 1 {
            assert!(
                apart(&found.quality, &expected.quality) < 1e-6,
                "{recursion:?}: {:?} {:?}",
                found.quality,
                expected.quality
            );
        } else {
            // a cluster with the others free to move is no worse than all at once
            assert!((0..2).all(|i| found.quality[i] > expected.quality[i] - 1e-6));
        }
        if m.rank > 0 {
            let least = least_singular_value(&dense, &model);
            for distance in [r.distance().0, dense.distance().0] {
                let part = distance / least;
                assert!((1.0 - 1e-6..FAR_AWAY).contains(&part), "{recursion:?}: {distance} of {least}");
            }
        }
    }
}

#[test]
fn every_route_through_the_clusters_gives_the_reduced_equations_in_space() {
    let wishes = Wishes { planar: false, bound: true, drives: true };
    on_random_mechanisms(61, 60, wishes, |_, model, m| agrees(model, m, true));
}

#[test]
fn every_route_through_the_clusters_gives_the_reduced_equations_in_the_plane() {
    let wishes = Wishes { planar: true, bound: true, drives: true };
    on_random_mechanisms(62, 60, wishes, |_, model, m| agrees(model, m, true));
}

#[test]
fn absolute_coordinates_are_gone_through_as_well() {
    let wishes = Wishes { planar: false, bound: false, drives: false };
    on_random_mechanisms(63, 20, wishes, |_, model, m| {
        let Some(absolute) = compile(&model.spec, Coordinates::Absolute) else { return };
        let (q, v) = absolute.transferred(model, &m.q, &m.v);
        let Some(there) = Moment::at(&absolute, m.t, q, v) else { return };
        agrees(&absolute, &there, false);
    });
}

/// The bar of a parallelogram turns back along x where all hinges come into one line: C_D loses two ranks there, and the
/// distance falls to zero as it does by every other coordinate.
#[test]
fn dead_points_of_the_coordinates_hide_no_singular_position() {
    for independent in ["c.x", "c.y", "one.turn"] {
        let distances = [0.3, 0.1, 0.01, 1e-4].map(|angle: f64| {
            let (x, y) = (angle.cos(), angle.sin());
            let mut drawing = families::Drawing::new("parallelogram");
            drawing.link("one".into(), [0.0, 0.0], [x, y]);
            drawing.link("c".into(), [x, y], [2.0 + x, y]);
            drawing.link("two".into(), [2.0, 0.0], [2.0 + x, y]);
            drawing.pin("ground", "one", [0.0, 0.0]);
            drawing.pin("one", "c", [x, y]);
            drawing.pin("c", "two", [2.0 + x, y]);
            drawing.pin("ground", "two", [2.0, 0.0]);
            let model = compile(&drawing.0, Coordinates::Absolute).unwrap();
            let q = model.initial();
            let mut r = Reduction::new(&model, start::analyse(&model, 0.0, &q).unwrap().rank);
            start::choose_partition(&mut r, 0.0, &q, None, None).unwrap();
            let input = model.structure().velocities.iter().position(|v| &*v.name == independent).unwrap();
            r.set_partition(0.0, &[input]).unwrap();
            r.tangent(0.0).unwrap();
            let (distance, least) = (r.distance().0, least_singular_value(&r, &model));
            let estimated = if angle < 0.02 { 1.0 + 1e-3 } else { FAR_AWAY };
            assert!((1.0 - 1e-6..estimated).contains(&(distance / least)), "{angle}: {distance} of {least}");
            distance / angle
        });
        let (low, high) = distances.into_iter().fold((f64::INFINITY, 0.0f64), |(l, h), x| (l.min(x), h.max(x)));
        assert!(high < 2.0 * low, "{independent}: {distances:?}");
    }
}

/// Mechanisms with as many degrees of freedom as wanted.
mod families {
    use crate::mechanisms::{body, empty};
    use partita_model::spec::{Joint, JointKind, Spec};

    const Z: [f64; 3] = [0.0, 0.0, 1.0];

    pub struct Drawing(pub Spec);

    impl Drawing {
        pub fn new(name: &str) -> Self {
            let mut spec = empty(name);
            spec.gravity = [0.0, -9.81, 0.0];
            Self(spec)
        }
        /// A slender link from one point to another.
        pub fn link(&mut self, name: String, from: [f64; 2], to: [f64; 2]) {
            let mut rng = fastrand::Rng::with_seed(1);
            let mut b = body(&mut rng, name);
            let d = [to[0] - from[0], to[1] - from[1]];
            let length2 = d[0] * d[0] + d[1] * d[1];
            let i = length2 / 12.0;
            b.mass = 1.0;
            b.position = [from[0], from[1], 0.0];
            b.orientation = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            b.com = [0.5 * d[0], 0.5 * d[1], 0.0];
            b.inertia = [[i, 0.0, 0.0], [0.0, i, 0.0], [0.0, 0.0, i]];
            self.0.bodies.push(b);
        }
        pub fn pin(&mut self, parent: &str, child: &str, at: [f64; 2]) {
            let name = format!("{parent}-{child}");
            let j = Joint::new(&name, JointKind::Revolute, parent, child, [at[0], at[1], 0.0]);
            self.0.joints.push(Joint { axis: Some(Z), ..j });
        }
    }

    /// A four-bar on `base` (a body or the ground) with its pins at (x, y) and (x + 1, y).
    fn four_bar(d: &mut Drawing, n: usize, base: &str, [x, y]: [f64; 2]) {
        let (a, b, c, e) = ([x, y], [x + 0.15, y + 0.26], [x + 0.84, y + 0.68], [x + 1.0, y]);
        d.link(format!("crank{n}"), a, b);
        d.link(format!("coupler{n}"), b, c);
        d.link(format!("rocker{n}"), e, c);
        d.pin(base, &format!("crank{n}"), a);
        d.pin(&format!("crank{n}"), &format!("coupler{n}"), b);
        d.pin(base, &format!("rocker{n}"), e);
        d.pin(&format!("coupler{n}"), &format!("rocker{n}"), c);
    }

    pub fn side_by_side(count: usize) -> Spec {
        let mut d = Drawing::new("side by side");
        (0..count).for_each(|n| four_bar(&mut d, n, "ground", [2.0 * n as f64, 0.0]));
        d.0
    }

    pub fn in_series(count: usize) -> Spec {
        let mut d = Drawing::new("in series");
        four_bar(&mut d, 0, "ground", [0.0, 0.0]);
        for n in 1..count {
            four_bar(&mut d, n, &format!("rocker{}", n - 1), [0.5 * n as f64, n as f64]);
        }
        d.0
    }

    /// A ring that hangs from one pin.
    pub fn ring(count: usize) -> Spec {
        let mut d = Drawing::new("ring");
        let at = |i: usize| {
            let (s, c) = (std::f64::consts::TAU * (i % count) as f64 / count as f64).sin_cos();
            [c, 0.7 * s]
        };
        (0..count).for_each(|i| d.link(format!("link{i}"), at(i), at(i + 1)));
        d.pin("ground", "link0", at(0));
        (1..count).for_each(|i| d.pin(&format!("link{}", i - 1), &format!("link{i}"), at(i)));
        d.pin(&format!("link{}", count - 1), "link0", at(0));
        d.0
    }

    pub fn open_chain(count: usize) -> Spec {
        let mut d = Drawing::new("open chain");
        for i in 0..count {
            d.link(format!("link{i}"), [i as f64, 0.0], [i as f64 + 1.0, 0.3]);
            let parent = if i == 0 { "ground".to_string() } else { format!("link{}", i - 1) };
            d.pin(&parent, &format!("link{i}"), [i as f64, 0.0]);
        }
        d.0
    }

    /// Five-bars whose uprights each belong to two of them.
    pub fn shared_uprights(count: usize) -> Spec {
        let mut d = Drawing::new("five-bars");
        for i in 0..=count {
            let x = i as f64;
            d.link(format!("upright{i}"), [x, 0.0], [x + 0.1, 1.0]);
            d.pin("ground", &format!("upright{i}"), [x, 0.0]);
        }
        for i in 0..count {
            let (a, b, c) = ([i as f64 + 0.1, 1.0], [i as f64 + 0.6, 1.4], [i as f64 + 1.1, 1.0]);
            d.link(format!("left{i}"), a, b);
            d.link(format!("right{i}"), c, b);
            d.pin(&format!("upright{i}"), &format!("left{i}"), a);
            d.pin(&format!("upright{}", i + 1), &format!("right{i}"), c);
            d.pin(&format!("left{i}"), &format!("right{i}"), b);
        }
        d.0
    }
}

fn start_of(spec: &partita_model::spec::Spec) -> (Model, Vec<f64>, usize) {
    let model = compile(spec, Coordinates::Relative).unwrap();
    let q = model.initial();
    let rank = start::analyse(&model, 0.0, &q).unwrap().rank;
    (model, q, rank)
}

#[test]
fn chains_rings_and_rows_of_loops_move_as_one_dense_mass_matrix_says() {
    for spec in [
        families::side_by_side(9),
        families::in_series(8),
        families::ring(12),
        families::open_chain(30),
        families::shared_uprights(10),
    ] {
        let (model, q, rank) = start_of(&spec);
        let mut r = Reduction::new(&model, rank);
        start::choose_partition(&mut r, 0.0, &q, None, None).unwrap();
        let independent = r.planned.partition.independent.clone();
        let mut m = Moment { t: 0.0, q, v: vec![0.0; r.size().nv], vdot: vec![], lambda: vec![], rank };
        for (j, &i) in independent.iter().enumerate() {
            m.v[i] = 0.3 + 0.1 * (j as f64).sin();
        }
        let found = seen(&mut r, &m, &independent);
        let mut dense = Reduction::dense(&model, rank);
        let expected = seen(&mut dense, &m, &independent);
        assert!(r.by_clusters(), "{}", spec.name);
        for (x, y) in [(&found.vdot, &expected.vdot), (&found.lambda, &expected.lambda), (&found.rho2, &expected.rho2)]
        {
            assert!(apart(x, y) < CLOSE, "{}: {:.1e}", spec.name, apart(x, y));
        }
    }
}

/// Of large clusters σ and √μ are found by products, without forming M_d: they are those of the dense equations.
#[test]
fn the_criterion_of_large_clusters_is_that_of_the_dense_equations() {
    let pinned = |name: &str| families::Drawing::new(name);
    let mut rope = pinned("rope");
    let corner = |i: usize| {
        let turn = std::f64::consts::PI * i as f64 / 120.0;
        [-turn.cos(), -turn.sin()]
    };
    for i in 0..120 {
        rope.link(format!("link {i}"), corner(i), corner(i + 1));
        let before = if i == 0 { "ground".into() } else { format!("link {}", i - 1) };
        rope.pin(&before, &format!("link {i}"), corner(i));
    }
    rope.pin("link 119", "ground", corner(120));
    let mut net = pinned("net");
    for i in 0..=110 {
        let x = i as f64;
        net.link(format!("upright {i}"), [x, 0.0], [x, 1.0]);
        net.pin("ground", &format!("upright {i}"), [x, 0.0]);
    }
    for i in 0..110 {
        let (x, knee) = (i as f64, [i as f64 + 0.5, 1.4]);
        net.link(format!("left {i}"), [x, 1.0], knee);
        net.link(format!("right {i}"), [x + 1.0, 1.0], knee);
        net.pin(&format!("upright {i}"), &format!("left {i}"), [x, 1.0]);
        net.pin(&format!("upright {}", i + 1), &format!("right {i}"), [x + 1.0, 1.0]);
        net.pin(&format!("left {i}"), &format!("right {i}"), knee);
    }
    let all = [
        ("rope", &rope, Coordinates::Relative),
        ("rope", &rope, Coordinates::Absolute),
        ("net", &net, Coordinates::Relative),
    ];
    for (name, drawing, coordinates) in all {
        let model = compile(&drawing.0, coordinates).unwrap();
        let q = model.initial();
        let rank = start::analyse(&model, 0.0, &q).unwrap().rank;
        let mut dense = Reduction::dense(&model, rank);
        start::choose_partition(&mut dense, 0.0, &q, None, None).unwrap();
        let independent = dense.planned.partition.independent.clone();
        assert!(independent.len() > 100);
        let mut r = Reduction::new(&model, rank);
        let [expected, found] = [&mut dense, &mut r].map(|r| {
            r.position(0.0, &q).unwrap();
            r.refresh_scales(0.0, &q).unwrap();
            r.set_partition(0.0, &independent).unwrap();
            r.evaluate(0.0, &q, &vec![0.0; independent.len()]).unwrap();
            let q = r.quality(0.0, &q).unwrap();
            [q.sigma, q.sqrt_mu]
        });
        assert!(r.by_clusters());
        for (x, y) in found.iter().zip(&expected) {
            assert!((x - y).abs() <= 1e-6 * y, "{name}, {coordinates:?}: {found:?} are not {expected:?}");
        }
    }
}
