//! Notes on a motion in words: the bodies that move, and spins that are indeterminate.

use super::Model;
use partita_math::{formatted, tolerance};
use partita_system::SystemError;

impl Model {
    /// The bodies that are held from spinning, in a sentence.
    pub fn held_note(&self) -> Option<String> {
        let names: Vec<&str> = self.own.placed.held.iter().map(|x| self.spec.bodies[x.body].name.as_str()).collect();
        let is = match names.len() {
            0 => return None,
            1 => "is",
            _ => "are",
        };
        let more = if names.len() > 6 { ", ..." } else { "" };
        let named = names.iter().take(6).copied().collect::<Vec<_>>().join(", ");
        Some(format!(
            "{named}{more} {is} held from spinning: without inertia about the axis that the joints leave {} free, \
             this motion is indeterminate, and nothing else depends on it",
            if names.len() == 1 { "it" } else { "them" }
        ))
    }

    /// Names of the bodies that move at these velocities.
    pub fn bodies_moved(&self, q: &[f64], v: &[f64]) -> Vec<String> {
        let mut s = self.own.scratch();
        self.own.look(q, v, &mut s);
        let speed = |link: usize| {
            let x = &s.full.links[link];
            x.w.norm().max(x.u.norm() / self.own.placed.length)
        };
        let all: Vec<f64> = self.own.placed.bodies.iter().map(|b| speed(b.link)).collect();
        let most = all.iter().copied().fold(0.0, f64::max);
        let moving = self.spec.bodies.iter().zip(all).filter(|x| x.1 > tolerance::TAKES_PART * most);
        moving.map(|x| x.0.name.clone()).collect()
    }

    /// Notes on a start with these velocities, or reasons to refuse it.
    ///
    /// # Errors
    /// Velocities whose motion is not continued.
    pub fn start_notes(&self, q: &[f64], v: &[f64]) -> Result<Vec<String>, SystemError> {
        if self.own.placed.held.is_empty() {
            return Ok(Vec::new());
        }
        let mut s = self.own.scratch();
        self.own.look(q, v, &mut s);
        let fastest =
            s.full.links.iter().fold(0.0, |m: f64, x| m.max(x.w.norm()).max(x.u.norm() / self.own.placed.length));
        for x in &self.own.placed.held {
            let state = &s.full.links[self.own.placed.bodies[x.body].link];
            let spin = x.line.map_or_else(|| state.w.norm(), |e| state.w.dot(state.rot.apply(e)));
            if spin.abs() > tolerance::WORST_ROUNDING * fastest {
                let name = &self.spec.bodies[x.body].name;
                let about = if x.line.is_some() { "about its own line" } else { "about itself" };
                let message = format!(
                    "body \"{name}\" starts with a spin of {} rad/s {about}, but has no inertia about that axis, so \
                     the motion is indeterminate; give it an axial inertia (add_body; m r^2 / 2 for a round bar), or \
                     omit the spin, which is then held",
                    formatted(spin)
                );
                return Err(SystemError::argument("rates", message));
            }
        }
        Ok(self.held_note().into_iter().collect())
    }
}
