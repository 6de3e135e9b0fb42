//! How long a mechanism is described: to the end of the table that ends first.

use crate::spec::{Force, Spec, Table, Value, VectorValue};

fn tables(value: &VectorValue) -> Vec<&Value> {
    match value {
        VectorValue::Components(all) => all.iter().collect(),
        VectorValue::Whole(one) => vec![one],
    }
}

/// The end of the table that ends first, and what it belongs to, in words.
pub fn horizon(spec: &Spec) -> Option<(f64, String)> {
    let drives = spec.drives.iter().map(|d| (&d.motion, words(&d.name, "drive")));
    let forces = spec.forces.iter().flat_map(|f| {
        let values = match f {
            Force::Torque { value, .. } => vec![value],
            Force::Force { value, .. } => tables(value),
            Force::Spring { .. } | Force::TorsionSpring { .. } => Vec::new(),
        };
        values.into_iter().map(|value| (value, words(f.name(), "force")))
    });
    let end = |table: &Table| table.breaks.last().copied();
    let ends = drives.chain(forces).filter_map(|(value, what)| match value {
        Value::Table(table) => end(table).map(|t| (t, what)),
        Value::Constant(_) | Value::Function(_) => None,
    });
    ends.reduce(|first, other| if other.0 < first.0 { other } else { first })
}

/// Usual names say what they are themselves.
fn words(name: &str, kind: &str) -> String {
    match name.starts_with(&format!("{kind} of ")) || name.starts_with("torque of ") {
        true => format!("the {name}"),
        false => format!("{kind} \"{name}\""),
    }
}
