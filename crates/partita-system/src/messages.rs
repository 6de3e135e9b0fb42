//! Names of rows in the terms of the drawing.

use crate::system::{ConstrainedSystem, SystemError};

/// Maximum number of names in a message.
const NAMED: usize = 6;

/// "a, b, c", or the first six and how many more there are.
pub fn some(names: &[String]) -> String {
    let more = if names.len() > NAMED { format!(" and {} more", names.len() - NAMED) } else { String::new() };
    format!("{}{more}", names[..names.len().min(NAMED)].join(", "))
}

/// `NotFinite` at t, with the first row of S3 whose Φ or C is not finite, if one is.
pub fn not_finite<S: ConstrainedSystem>(system: &S, t: f64, phi: &[f64], c: &[f64]) -> SystemError {
    let finite = |i: usize| phi[i].is_finite() && system.pattern().row(i).all(|e| c[e].is_finite());
    let row = (0..system.size().holonomic).find(|&i| !finite(i));
    let what = row.map_or("a loop-closure constraint", |i| &*system.structure().rows[i].description);
    SystemError::NotFinite { what: what.into(), t }
}

/// The loop that row i closes, by its joints, if there are any.
pub fn loop_of<S: ConstrainedSystem>(system: &S, i: usize) -> String {
    let pattern = system.pattern();
    let mut through: Vec<String> = Vec::new();
    for e in pattern.row(i) {
        let name = &*system.structure().velocities[pattern.col_idx[e]].name;
        let joint = name.rsplit_once('.').map_or(name, |x| x.0).to_string();
        if !through.contains(&joint) {
            through.push(joint);
        }
    }
    match through.as_slice() {
        [] => "the loop".into(),
        _ => format!("the loop through {}", some(&through)),
    }
}
