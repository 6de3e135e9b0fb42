//! Loops, gaps and lists in words.

use partita_math::formatted;
use partita_model::Model;
use partita_system::messages;
use partita_system::prelude::*;

/// "a", "a and b", "a, b and c".
pub(super) fn listed(words: &[String]) -> String {
    match words {
        [] => "nothing".into(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

/// A length and an angle, where they exist.
pub(super) fn gap(length: f64, angle: f64) -> String {
    match (length > 0.0, angle > 0.0) {
        (true, true) => format!("{} m and {} rad", formatted(length), formatted(angle)),
        (false, true) => format!("{} rad", formatted(angle)),
        (true, false) => format!("{} m", formatted(length)),
        _ => "an unknown amount".into(),
    }
}

/// The loop that row i closes: the joints it runs through, and what closes it.
pub(super) fn loop_of(model: &Model, i: usize) -> String {
    if i >= model.pattern().rows {
        return "the mechanism".into();
    }
    format!("{} closed by {}", messages::loop_of(model, i), model.structure().rows[i].owner)
}
