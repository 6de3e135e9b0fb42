//! Where the forces of a mechanism have no derivative that holds on both sides: friction that sticks, and laws at a
//! corner.

use crate::evaluator::{with_engine, Evaluator, Scratch};
use crate::force::{At, Element, Load, LoadLaw, Surface};
use crate::model::Model;
use partita_math::formatted;
use partita_math::spatial::Space;
use partita_math::tolerance;
use partita_system::system::Levels;
use partita_system::SystemError;

/// Compressions with this power of the depth have a slope that jumps at the first touch. Scale: power. Reason: with a
/// higher one it begins at zero.
const LINEAR: f64 = 1.0;

impl Model {
    /// What has no derivative at (t, q, v), in sentences.
    ///
    /// # Errors
    /// Where the position cannot be evaluated.
    pub fn one_sided(&self, t: f64, q: &[f64], v: &[f64]) -> Result<Vec<String>, SystemError> {
        let (size, nnz) = (self.size(), self.pattern().nnz());
        let mut s = self.scratch();
        let (mut phi, mut c) = (vec![0.0; size.holonomic], vec![0.0; nnz]);
        let (mut a, mut b) = (vec![0.0; size.rows], vec![0.0; size.rows]);
        self.position(t, q, &mut s, &mut phi, &mut c, &mut a)?;
        self.velocity(t, q, v, &mut s, &mut b)?;
        let mut names = vec![""; self.own.full.elements.len()];
        for (i, force) in self.spec.forces.iter().enumerate() {
            if let Ok((e, _)) = self.load_number(i) {
                names[e] = force.name();
            }
        }
        let mut found = self.own.one_sided_elements(t, (q, v), s.equations(), &names);
        found.extend(self.curves().one_sided(&self.own, t, (q, v), s.equations()));
        Ok(found)
    }
}

impl Evaluator<f64> {
    fn one_sided_elements(
        &self,
        t: f64,
        (q, v): (&[f64], &[f64]),
        s: &mut Scratch<f64>,
        names: &[&str],
    ) -> Vec<String> {
        let instant = self.instant(t, q, v);
        with_engine!(self, s, |mechanics, s| {
            let at = mechanics.at(s, instant);
            mechanics.elements.iter().zip(names).filter_map(|(e, name)| e.corner(&at, name)).collect()
        })
    }
}

/// A rate within the stick velocity.
fn sticks(what: &str, rate: f64, stick: f64) -> Option<String> {
    (rate.abs() <= stick).then(|| {
        format!(
            "{what} sticks: its speed {} is within its stick velocity {}, where it resists motion either way and is no \
             damper",
            formatted(rate.abs()),
            formatted(stick)
        )
    })
}

fn touches(what: &str, name: &str) -> String {
    format!("{what} \"{name}\" is exactly where it begins to act: nothing on one side, its stiffness on the other")
}

impl<G: Space<S = f64>> Element<G> {
    fn corner(&self, at: &At<G>, name: &str) -> Option<String> {
        let begins = |what: &str, gap: f64, size: f64, exponent: f64| {
            (exponent <= LINEAR && gap.abs() <= tolerance::EQUAL * size).then(|| touches(what, name))
        };
        match self {
            Self::Load(load) => load.corner(at, name),
            Self::Contact(e) => {
                let [_, _, gap, _] = e.gap(at);
                let size = match e.surface {
                    Surface::Plane(_) if e.radius > 0.0 => e.radius,
                    Surface::Plane(_) => 1.0,
                    Surface::Sphere(other) => e.radius + other,
                };
                let slip = e.slip(at);
                begins("contact", gap, size, e.buffer.exponent).or_else(|| {
                    (e.rough && gap < 0.0)
                        .then(|| sticks(&format!("contact \"{name}\""), slip, e.friction[2]))
                        .flatten()
                })
            }
            Self::TwoPoint(e) => {
                let distance = e.distance(at);
                let corners = e.law.corners();
                let mut all = corners.iter().flatten();
                all.find_map(|x| begins(e.law.word(), x.length - distance, x.length, x.exponent))
            }
            Self::Tyre(e) => begins("tyre", e.gap(at)[0], e.radius, e.buffer.exponent),
            _ => None,
        }
    }
}

impl<G: Space<S = f64>> Load<G> {
    fn corner(&self, at: &At<G>, name: &str) -> Option<String> {
        let (x, rate) = self.value_and_rate(at);
        match &self.law {
            LoadLaw::Friction(friction) => sticks(&format!("friction \"{name}\""), rate, friction.stick),
            LoadLaw::Stop(stop) if stop.buffer.exponent <= LINEAR => {
                let near = |end: &f64| (x - end).abs() <= tolerance::EQUAL * self.stop_range();
                self.ends().iter().flatten().any(near).then(|| touches("stop", name))
            }
            _ => None,
        }
    }
}
