//! Loops, gaps and lists in words.

use partita_model::Model;
use partita_system::ConstrainedSystem;

/// Joints named of one loop.
const NAMED: usize = 8;

/// "a", "a and b", "a, b and c".
pub(super) fn listed(words: &[String]) -> String {
    match words {
        [] => "nothing".into(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

/// A length and an angle, as far as there are any.
pub(super) fn gap(length: f64, angle: f64) -> String {
    match (length > 0.0, angle > 0.0) {
        (true, true) => format!("{length:.6e} m and {angle:.6e} rad"),
        (false, true) => format!("{angle:.6e} rad"),
        (true, false) => format!("{length:.6e} m"),
        _ => "an amount that was not found".into(),
    }
}

/// The loop that row i closes: the joints it runs through, and what closes it.
pub(super) fn loop_of(model: &Model, i: usize) -> String {
    if i >= model.pattern().rows {
        return "the mechanism".into();
    }
    let mut through: Vec<String> = Vec::new();
    for e in model.pattern().row(i) {
        let name = model.velocity_name(model.pattern().col_idx[e]);
        let joint = name.rsplit_once('.').map_or(name.as_str(), |x| x.0).to_string();
        if !through.contains(&joint) {
            through.push(joint);
        }
    }
    let more = if through.len() > NAMED { format!(" and {} more", through.len() - NAMED) } else { String::new() };
    through.truncate(NAMED);
    format!("the loop through {}{more} closed by {}", through.join(", "), model.row_owner(i))
}
