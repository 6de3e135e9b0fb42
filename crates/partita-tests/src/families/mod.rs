//! Families of linkages of any length, and their drawings with geometric errors.
#![allow(dead_code, reason = "each test file uses the part it needs")]

use crate::linkages::*;
use partita_model::spec::JointKind::{Prismatic, Revolute, Spherical};
use partita_model::tree::LinkMotion;
use partita_model::Model;
use partita_system::prelude::*;

/// Four-bars on common uprights: one degree of freedom, as many loops as asked for.
pub fn uprights(n: usize, coupler: impl Fn(usize) -> f64) -> Drawing {
    let mut d = drawing("uprights");
    let at = |i: usize| 1.1 * i as f64;
    for i in 0..=n {
        d = d.pin(&format!("A{i}"), "ground", &format!("upright{i}"), [at(i), 0.0]);
    }
    for i in 0..n {
        let (up, next, bar) = (format!("upright{i}"), format!("upright{}", i + 1), format!("coupler{i}"));
        d = d.pin(&format!("B{i}"), &up, &bar, [at(i), 1.0]).pin(
            &format!("C{i}"),
            &bar,
            &next,
            [at(i + 1), coupler(i)],
        );
    }
    d
}

/// Crank-rockers one beside the other, without a joint in common.
pub fn side_by_side(n: usize) -> Drawing {
    let mut d = drawing("side by side");
    for i in 0..n {
        let x = 2.0 * i as f64;
        let (b, c) = ([x + 0.15, 0.26], [x + 0.9, 0.65]);
        let name = |s: &str| format!("{s}{i}");
        d = d
            .pin(&name("A"), "ground", &name("crank"), [x, 0.0])
            .pin(&name("B"), &name("crank"), &name("coupler"), b)
            .pin(&name("C"), &name("coupler"), &name("rocker"), c)
            .pin(&name("D"), "ground", &name("rocker"), [x + 1.0, 0.0]);
    }
    d
}

/// Four-bars in series: each stands on the rocker of the last.
pub fn on_the_last_rocker(n: usize) -> Drawing {
    let mut d = drawing("in series");
    let mut base = "ground".to_string();
    for i in 0..n {
        let x = 0.2 * i as f64;
        let name = |s: &str| format!("{s}{i}");
        d = d
            .pin(&name("A"), &base, &name("crank"), [x, 0.0])
            .pin(&name("B"), &name("crank"), &name("coupler"), [x + 0.15, 0.26])
            .pin(&name("C"), &name("coupler"), &name("rocker"), [x + 0.9, 0.65])
            .pin(&name("D"), &base, &name("rocker"), [x + 1.0, 0.0]);
        base = name("rocker");
    }
    d
}

/// Theo Jansen's leg, in decimetres.
pub fn jansen(crank: f64) -> Drawing {
    let (o, pivot) = ([0.0, 0.0], [-0.38, -0.078]);
    let p = polar(0.15, crank);
    let c = dyad(p, pivot, 0.5, 0.415, 1.0);
    let below = dyad(p, pivot, 0.619, 0.393, -1.0);
    let e = dyad(pivot, c, 0.401, 0.558, 1.0);
    let f = dyad(e, below, 0.394, 0.367, 1.0);
    drawing("Jansen")
        .pin("O", "ground", "crank", o)
        .pin("P1", "crank", "j", p)
        .pin("P2", "crank", "k", p)
        .pin("C", "j", "bde", c)
        .pin("B1", "ground", "bde", pivot)
        .pin("B2", "ground", "c", pivot)
        .pin("D1", "k", "c", below)
        .pin("D2", "c", "foot", below)
        .pin("E", "bde", "f", e)
        .pin("F", "f", "foot", f)
}

/// A leg of Klann's kind: crank, coupler that carries the leg, two rockers.
pub fn klann(crank: f64) -> Drawing {
    let (lower, upper) = ([-0.61, -0.13], [-0.37, 0.61]);
    let m = polar(0.11 * 2.0, crank);
    let c = dyad(m, lower, 0.58, 0.42, -1.0);
    let d = {
        let (x, y) = (c[0] - m[0], c[1] - m[1]);
        [c[0] + 0.8 * x + 0.1 * y, c[1] + 0.8 * y - 0.1 * x]
    };
    let e = dyad(d, upper, 0.45, 0.62, -1.0);
    drawing("Klann")
        .pin("O", "ground", "crank", [0.0, 0.0])
        .pin("M", "crank", "coupler", m)
        .pin("C", "coupler", "lower", c)
        .pin("A", "ground", "lower", lower)
        .pin("D", "coupler", "leg", d)
        .pin("E", "leg", "upper", e)
        .pin("B", "ground", "upper", upper)
}

/// Planar parallel robot: three legs of two links.
pub fn three_rrr() -> Drawing {
    let mut d = drawing("3-RRR");
    for i in 0..3 {
        let angle = 2.1 * i as f64 + 0.3;
        let (base, tip) = (polar(1.0, angle), polar(0.3, angle + 0.4));
        let elbow = dyad(base, tip, 0.6, 0.65, 1.0);
        d = d
            .pin(&format!("A{i}"), "ground", &format!("upper{i}"), base)
            .pin(&format!("B{i}"), &format!("upper{i}"), &format!("lower{i}"), elbow)
            .pin(&format!("C{i}"), &format!("lower{i}"), "platform", tip);
    }
    d
}

/// Bricard's ring along six edges of a cube: mobile although 6 - 6 = 0.
pub fn bricard() -> Drawing {
    let (x, y, z) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    let corners = [[0.0; 3], x, [1.0, 1.0, 0.0], [1.0; 3], [0.0, 1.0, 1.0], z];
    let mut d = drawing("Bricard");
    for (i, (at, axis)) in corners.into_iter().zip([y, z, x, y, z, x]).enumerate() {
        let name = |i: usize| if i % 6 == 0 { "ground".to_string() } else { format!("link{}", i % 6) };
        d = d.joint(&format!("R{i}"), Revolute, &name(i), &name(i + 1), at, axis);
    }
    d
}

/// Scissors on a pin and a slide.
pub fn scissors(n: usize) -> Drawing {
    let mut d = drawing("scissors").pin("base", "ground", "a0", [0.0, 0.0]).slide(
        "slide",
        "ground",
        "shoe",
        [0.8, 0.0],
        [1.0, 0.0],
    );
    d = d.pin("shoe", "shoe", "b0", [0.8, 0.0]);
    for i in 0..n {
        let y = 0.6 * i as f64;
        let (a, b) = (format!("a{i}"), format!("b{i}"));
        d = d.pin(&format!("m{i}"), &a, &b, [0.4, y + 0.3]);
        if i + 1 < n {
            let (c, e) = (format!("a{}", i + 1), format!("b{}", i + 1));
            // the bar that rises to the right carries the one that rises to the left
            d = d.pin(&format!("r{i}"), &a, &e, [0.8, y + 0.6]).pin(&format!("l{i}"), &b, &c, [0.0, y + 0.6]);
        }
    }
    d
}

/// A hanging ring of links.
pub fn ring(n: usize) -> Drawing {
    let mut d = drawing("ring");
    let radius = n as f64 / std::f64::consts::TAU;
    for i in 0..n {
        let name = |i: usize| if i % n == 0 { "ground".to_string() } else { format!("link{}", i % n) };
        d = d.pin(&format!("P{i}"), &name(i), &name(i + 1), polar(radius, std::f64::consts::TAU * i as f64 / n as f64));
    }
    d
}

/// Spatial slider-cranks with two balls each, one beside the other.
pub fn spatial_cranks(n: usize) -> Drawing {
    let mut d = drawing("spatial slider-cranks");
    for i in 0..n {
        let x = 2.0 * i as f64;
        let name = |s: &str| format!("{s}{i}");
        d = d
            .joint(&name("A"), Revolute, "ground", &name("crank"), [x, 0.1, 0.12], [1.0, 0.0, 0.0])
            .joint(&name("B"), Spherical, &name("crank"), &name("rod"), [x, 0.1, 0.2], Z)
            .joint(&name("C"), Spherical, &name("rod"), &name("slider"), [x + 0.2, 0.0, 0.0], Z)
            .joint(&name("D"), Prismatic, "ground", &name("slider"), [x + 0.2, 0.0, 0.0], [1.0, 0.0, 0.0]);
    }
    d
}

/// The drawing with every link turned (slid) by up to `part` of a radian (of its characteristic displacement) against
/// the world.
pub fn rough(model: &Model, rng: &mut fastrand::Rng, part: f64) -> Vec<f64> {
    let links = &model.equations().full.links;
    let noise: Vec<f64> = (0..links.len()).map(|_| 2.0 * rng.f64() - 1.0).collect();
    let mut dv = vec![0.0; model.size().nv];
    for (i, l) in links.iter().enumerate().skip(1) {
        match l.motion {
            LinkMotion::Turn(_) => {
                let parent = matches!(links[l.parent].motion, LinkMotion::Turn(_)) && l.parent > 0;
                dv[l.v] = part * (noise[i] - if parent { noise[l.parent] } else { 0.0 });
            }
            LinkMotion::Slide(_) => dv[l.v] = part * model.structure().displacement(l.v) * noise[i],
            LinkMotion::Ball => (0..3).for_each(|k| dv[l.v + k] = part * (2.0 * rng.f64() - 1.0)),
        }
    }
    let mut q = model.initial();
    model.step(&mut q, &dv);
    q
}
