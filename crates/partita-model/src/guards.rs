//! Guards of a mechanism: gaps of contacts and tyres, corners of laws between points, ends of stops, limits of the rotation of bushings.

use crate::evaluator::{with_engine, Evaluator, Scratch};
use crate::force::{At, Element, Surface};
use crate::model::Model;
use partita_math::spatial::Space;
use partita_math::tolerance;
use partita_system::watched::{Guard, Reading};

/// The reading of a value and its rate, where the value moves at no more than `speed`.
fn reading(x: f64, rate: f64, speed: f64) -> Reading {
    Reading { x, rate, apart: x.abs(), speed, terms: 0.0 }
}

impl<G: Space<S = f64>> Element<G> {
    /// The guarded quantities.
    fn guards(&self, name: &str) -> Vec<Guard> {
        let guard = |what: String, size, through| Guard { name: what, size, through };
        match self {
            Self::Contact(e) if e.yields() => {
                let size = match e.surface {
                    Surface::Plane(_) if e.radius > 0.0 => e.radius,
                    Surface::Plane(_) => 1.0,
                    Surface::Sphere(other) => e.radius + other,
                };
                vec![guard(format!("contact \"{name}\""), size, e.passed_through())]
            }
            Self::TwoPoint(e) => {
                let what = format!("{} \"{name}\"", e.law.word());
                e.law.corners().iter().flatten().map(|x| guard(what.clone(), x.length, None)).collect()
            }
            Self::Tyre(e) => vec![guard(format!("tyre \"{name}\""), e.radius, None)],
            Self::Bushing(e) if e.turns => vec![guard(format!("bushing \"{name}\""), 1.0, None)],
            Self::Load(e) => {
                let size = e.stop_range();
                e.ends().into_iter().flatten().map(|_| guard(format!("stop \"{name}\""), size, None)).collect()
            }
            _ => Vec::new(),
        }
    }

    /// Write the readings of the guards to the front of `out`; returns their number.
    fn read_guards(&self, at: &At<G>, out: &mut [Reading]) -> usize {
        match self {
            Self::Contact(e) if e.yields() => {
                let [x, rate, gap, speed] = e.gap(at);
                out[0] = Reading { x, rate, apart: gap.abs(), speed, terms: 0.0 };
                1
            }
            Self::TwoPoint(e) => {
                let corners = e.law.corners();
                out.iter_mut().zip(corners.iter().flatten()).map(|(out, x)| *out = e.gap(at, x)).count()
            }
            Self::Tyre(e) => {
                let [gap, rate, speed] = e.gap(at);
                out[0] = reading(gap, rate, speed);
                1
            }
            Self::Bushing(e) if e.turns => {
                let [angle, rate, speed] = e.twist(at);
                out[0] = reading(tolerance::HALF_TURN - angle, -rate, speed);
                1
            }
            Self::Load(e) => {
                let [lower, upper] = e.ends();
                if lower.is_none() && upper.is_none() {
                    return 0;
                }
                let (x, rate) = e.value_and_rate(at);
                let ends = [lower.map(|end| (x - end, rate)), upper.map(|end| (end - x, -rate))];
                let written = out.iter_mut().zip(ends.into_iter().flatten());
                written.map(|(out, (x, rate))| *out = reading(x, rate, rate.abs())).count()
            }
            _ => 0,
        }
    }
}

impl Model {
    /// Quantities whose zero no step may cross unseen.
    pub(crate) fn guarded(&self) -> Vec<Guard> {
        if !self.own.full.elements.iter().any(is_guarded) {
            return Vec::new();
        }
        let mut names = vec![""; self.own.full.elements.len()];
        for (i, force) in self.spec.forces.iter().enumerate() {
            if let Ok((e, _)) = self.load_number(i) {
                names[e] = force.name();
            }
        }
        self.own.full.elements.iter().zip(names).flat_map(|(e, name)| e.guards(name)).collect()
    }
}

impl Evaluator<f64> {
    /// The readings of the guards at the point last evaluated.
    pub(crate) fn read_guards(&self, t: f64, (q, v): (&[f64], &[f64]), s: &mut Scratch<f64>, out: &mut [Reading]) {
        let instant = self.instant(t, q, v);
        with_engine!(self, s, |mechanics, s| {
            let at = mechanics.at(s, instant);
            let mut n = 0;
            for e in &mechanics.elements {
                n += e.read_guards(&at, &mut out[n..]);
            }
        });
    }
}

fn is_guarded<G: Space>(e: &Element<G>) -> bool {
    matches!(e, Element::Contact(_) | Element::TwoPoint(_) | Element::Tyre(_) | Element::Bushing(_) | Element::Load(_))
}
