//! A knife edge that does not slip sideways: a constraint on velocities that no constraint on positions stands behind.

use crate::pieces::{any, distance, grid, march, reference, run, slope, times};
use partita_system::equations::Equations;
use partita_system::formulation::motion::Projective;
use partita_system::formulation::registry;
use partita_system::formulation::Formulation;
use partita_system::options::FormulationOptions;
use partita_system::record::{Correction, Sample};
use partita_system::SystemError;

type Done = Result<(), SystemError>;

const MASS: f64 = 2.0;
const INERTIA: f64 = 0.8;
/// From the knife edge to the centre of mass.
const ARM: f64 = 0.4;
/// A rod pulled behind, pinned to the knife edge: length, mass, inertia.
const ROD: [f64; 3] = [1.2, 0.5, 0.5 * 1.2 * 1.2 / 12.0];

/// x, y of the centre of mass and the heading θ; behind it, if wanted, a rod with x, y, φ. Rows: the pin (holonomic), then
/// the edge.
#[derive(Clone, Copy)]
struct Sleigh {
    rod: bool,
}

impl Sleigh {
    fn energy(&self, s: &Sample) -> f64 {
        let square = |v: &[f64], m: f64, j: f64| 0.5 * (m * (v[0] * v[0] + v[1] * v[1]) + j * v[2] * v[2]);
        square(&s.v, MASS, INERTIA) + if self.rod { square(&s.v[3..], ROD[1], ROD[2]) } else { 0.0 }
    }

    /// Velocity u of the edge along the heading `angle`, and ω.
    fn speeds(s: &Sample) -> [f64; 2] {
        let (sin, cos) = s.q[2].sin_cos();
        [cos * s.v[0] + sin * s.v[1], s.v[2]]
    }

    fn start(&self, u: f64, w: f64) -> (Vec<f64>, Vec<f64>) {
        let theta: f64 = 0.3;
        let (s, c) = theta.sin_cos();
        let mut q = vec![0.0, 0.0, theta];
        let mut v = vec![c * u - s * ARM * w, s * u + c * ARM * w, w];
        if self.rod {
            // in line with the sleigh, behind it, resting in its angle
            let half = 0.5 * ROD[0];
            q.extend([-(ARM + half) * c, -(ARM + half) * s, theta]);
            v.extend([c * u, s * u, 0.0]);
        }
        (q, v)
    }
}

impl Equations for Sleigh {
    fn n(&self) -> usize {
        if self.rod {
            6
        } else {
            3
        }
    }
    fn rows(&self) -> usize {
        if self.rod {
            3
        } else {
            1
        }
    }
    fn holonomic(&self) -> usize {
        self.rows() - 1
    }
    fn name(&self, i: usize) -> String {
        ["x", "y", "heading", "rod x", "rod y", "rod angle"][i].into()
    }
    fn rheonomic(&self) -> bool {
        false
    }
    fn mass(&self, _: f64, _: &[f64], out: &mut [f64]) -> Done {
        out.fill(0.0);
        let n = self.n();
        for (i, m) in [MASS, MASS, INERTIA, ROD[1], ROD[1], ROD[2]].iter().take(n).enumerate() {
            out[i * n + i] = *m;
        }
        Ok(())
    }
    fn forces(&self, _: f64, _: &[f64], _: &[f64], out: &mut [f64]) -> Done {
        out.fill(0.0);
        Ok(())
    }
    fn constraints(&self, _: f64, q: &[f64], out: &mut [f64]) -> Done {
        if self.rod {
            let half = 0.5 * ROD[0];
            out[0] = q[0] - ARM * q[2].cos() - q[3] - half * q[5].cos();
            out[1] = q[1] - ARM * q[2].sin() - q[4] - half * q[5].sin();
        }
        Ok(())
    }
    fn jacobian(&self, _: f64, q: &[f64], out: &mut [f64]) -> Done {
        out.fill(0.0);
        let (s, c) = q[2].sin_cos();
        let edge = [-s, c, -ARM];
        if self.rod {
            let (half, (sr, cr)) = (0.5 * ROD[0], q[5].sin_cos());
            out[..6].copy_from_slice(&[1.0, 0.0, ARM * s, -1.0, 0.0, half * sr]);
            out[6..12].copy_from_slice(&[0.0, 1.0, -ARM * c, 0.0, -1.0, -half * cr]);
        }
        let last = self.holonomic() * self.n();
        out[last..last + 3].copy_from_slice(&edge);
        Ok(())
    }
    fn rate(&self, _: f64, _: &[f64], out: &mut [f64]) -> Done {
        out.fill(0.0);
        Ok(())
    }
    fn bias(&self, _: f64, q: &[f64], v: &[f64], out: &mut [f64]) -> Done {
        let (s, c) = q[2].sin_cos();
        if self.rod {
            let (half, (sr, cr)) = (0.5 * ROD[0], q[5].sin_cos());
            out[0] = ARM * c * v[2] * v[2] + half * cr * v[5] * v[5];
            out[1] = ARM * s * v[2] * v[2] + half * sr * v[5] * v[5];
        }
        out[self.holonomic()] = -v[2] * (c * v[0] + s * v[1]);
        Ok(())
    }
}

/// `u' = c ω²`, `(J + m c²) ω' = −m c u ω`: u = V tanh(κ t + β), ω = W / cosh(κ t + β).
#[test]
fn the_sleigh_against_its_closed_form() {
    let (sleigh, system) = (Sleigh { rod: false }, any(Sleigh { rod: false }));
    let about_edge = INERTIA + MASS * ARM * ARM;
    let (u, w) = (-1.0, 2.5);
    let energy: f64 = 0.5 * (MASS * u * u + about_edge * w * w);
    let (top, spin) = ((2.0 * energy / MASS).sqrt(), (2.0 * energy / about_edge).sqrt());
    let (kappa, beta) = (MASS * ARM * top / about_edge, (u / top).atanh());
    let mut f = Projective::new(&system, 1, &FormulationOptions::default());
    let (q, v) = sleigh.start(u, w);
    let samples = march(&mut f, &q, &v, &times(0.1, 30), &reference(3.0));
    // x and y of the centre of mass take turns while the sleigh turns round
    assert!(f.history().counters.switches >= 2, "{:?}", f.history().events);
    assert_eq!(f.history().counters.corrections, 0, "there is no position to correct");
    for s in &samples {
        let x = kappa * s.t + beta;
        let [u, w] = Sleigh::speeds(s);
        // two hundred steps at 2e-14, u' grows errors by e^κt at the most
        assert!((u - top * x.tanh()).abs() < 1e-11, "{} at {}", u - top * x.tanh(), s.t);
        assert!((w - spin / x.cosh()).abs() < 1e-11);
        let heading = 0.3 + spin / kappa * (x.sinh().atan() - beta.sinh().atan());
        assert!((s.q[2] - heading).abs() < 1e-11);
        assert!(s.velocity_closure < 1e-14, "{}", s.velocity_closure);
        assert!((sleigh.energy(s) - energy).abs() < 1e-11 * energy);
        // the edge holds what makes the centre of mass turn: m (u ω + c ω'), with ω' = −m c u ω / (J + m c²)
        let side = MASS * (u * w - ARM * MASS * ARM * u * w / about_edge);
        assert!((s.multipliers[0] - side).abs() < 1e-10, "{} against {side}", s.multipliers[0]);
    }
}

#[test]
fn order_and_energy_of_sleighs() {
    const STEPS: [f64; 4] = [0.01, 0.005, 0.0025, 0.00125];
    for rod in [false, true] {
        let (sleigh, system) = (Sleigh { rod }, any(Sleigh { rod }));
        let start = sleigh.start(-1.0, 2.5);
        let at = times(0.3, 10);
        let exact = run(&system, FormulationOptions::default(), &start, &at, &reference(3.0));
        let energy = sleigh.energy(&exact[0]);
        for correction in [Correction::None, Correction::MassOrthogonal, Correction::Partition] {
            let options = FormulationOptions { correction, ..FormulationOptions::default() };
            let mut lost: f64 = 0.0;
            let errors = STEPS.map(|h| {
                let mut f = Projective::new(&system, if rod { 3 } else { 1 }, &options);
                let samples = march(&mut f, &start.0, &start.1, &at, &grid(3.0, h));
                samples.iter().for_each(|s| assert!(s.velocity_closure < 1e-13));
                if rod && correction != Correction::None {
                    assert!(f.history().counters.corrections > 0);
                    samples.iter().for_each(|s| assert!(s.closure < 1e-14, "{}", s.closure));
                }
                lost = samples.iter().fold(0.0, |m: f64, s| m.max((sleigh.energy(s) - energy).abs()));
                distance(&samples, &exact)
            });
            let p = slope(&STEPS, &errors);
            assert!((p - 4.0).abs() < 0.2, "rod {rod}, {correction:?}: order {p} from {errors:?}");
            // no worse than the error of the motion itself
            assert!(lost < 10.0 * errors[3] + 1e-12, "{lost:e} with errors {errors:?}");
        }
    }
}

/// All velocities with multipliers, corrected orthogonally, against the compact form.
#[test]
fn both_formulations_pull_the_rod_alike() {
    let (sleigh, system) = (Sleigh { rod: true }, any(Sleigh { rod: true }));
    let (q, v) = sleigh.start(-1.0, 2.5);
    let at = times(0.3, 10);
    let x = run(&system, FormulationOptions::default(), &(q.clone(), v.clone()), &at, &reference(3.0));
    let mut f = registry::by_name("multipliers", &system, 3, &least_moves()).unwrap();
    let y = march(&mut *f, &q, &v, &at, &reference(3.0));
    assert!(distance(&x, &y) < 1e-10, "{:e}", distance(&x, &y));
    for (x, y) in x.iter().zip(&y) {
        x.multipliers.iter().zip(&y.multipliers).for_each(|(x, y)| assert!((x - y).abs() < 1e-9, "{x} {y}"));
        assert!(y.closure < 1e-14 && y.velocity_closure < 1e-13);
    }
}

/// Rows without a position determine no coordinate: forms with 2k states say so.
#[test]
fn two_k_states_need_positions() {
    let (sleigh, system) = (Sleigh { rod: true }, any(Sleigh { rod: true }));
    for name in ["wehage-haug", "explicit-closing"] {
        match registry::by_name(name, &system, 3, &FormulationOptions::default()) {
            Err(SystemError::Argument { message, .. }) => assert!(message.contains("velocities only"), "{message}"),
            Err(other) => panic!("{other}"),
            Ok(_) => panic!("{name} was accepted"),
        }
    }
    // the others take them, corrections included
    let (q, v) = sleigh.start(-1.0, 2.5);
    let at = times(0.3, 10);
    let x = run(&system, FormulationOptions::default(), &(q.clone(), v.clone()), &at, &reference(3.0));
    for name in ["multipliers", "range-space", "proximal"] {
        for correction in [Correction::Partition, Correction::MassOrthogonal] {
            let options = FormulationOptions { correction, ..FormulationOptions::default() };
            let y = march(&mut *registry::by_name(name, &system, 3, &options).unwrap(), &q, &v, &at, &reference(3.0));
            assert!(distance(&x, &y) < 1e-10, "{name}: {:e}", distance(&x, &y));
            y.iter().for_each(|s| assert!(s.closure < 1e-14 && s.velocity_closure < 1e-13, "{name}"));
        }
    }
}

/// Frozen tangent velocities with a row that has no position; the chart of positions refuses it by its name.
#[test]
fn tangent_velocities_pull_the_rod_alike() {
    const STEPS: [f64; 4] = [0.01, 0.005, 0.0025, 0.00125];
    let (sleigh, system) = (Sleigh { rod: true }, any(Sleigh { rod: true }));
    let (q, v) = sleigh.start(-1.0, 2.5);
    let at = times(0.3, 10);
    let exact = run(&system, FormulationOptions::default(), &(q.clone(), v.clone()), &at, &reference(3.0));
    for name in ["zero-eigenvalue", "svd", "qr", "gram-schmidt"] {
        for correction in [Correction::None, Correction::MassOrthogonal, Correction::Partition] {
            let options = FormulationOptions { correction, renew: 0.8.into(), ..FormulationOptions::default() };
            let make = || registry::by_name(name, &system, 3, &options).unwrap();
            let samples = march(&mut *make(), &q, &v, &at, &reference(3.0));
            assert!(distance(&samples, &exact) < 1e-10, "{name}: {:e}", distance(&samples, &exact));
            for (x, y) in samples.iter().zip(&exact) {
                x.multipliers.iter().zip(&y.multipliers).for_each(|(x, y)| assert!((x - y).abs() < 1e-9, "{x} {y}"));
                assert!(x.velocity_closure < 1e-13);
                assert!(correction == Correction::None || x.closure < 1e-14, "{:e}", x.closure);
            }
            let errors = STEPS.map(|h| distance(&march(&mut *make(), &q, &v, &at, &grid(3.0, h)), &exact));
            let p = slope(&STEPS, &errors);
            assert!((p - 4.0).abs() < 0.2, "{name}, {correction:?}: order {p} from {errors:?}");
        }
    }
    let refused = registry::by_name("tangent-space", &system, 3, &FormulationOptions::default()).err().unwrap();
    assert!(refused.to_string().contains("constraint 2") && refused.to_string().contains("nonholonomic"), "{refused}");
}

fn least_moves() -> FormulationOptions {
    FormulationOptions { correction: Correction::MassOrthogonal, ..FormulationOptions::default() }
}
