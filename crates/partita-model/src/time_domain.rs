//! Time domain of a mechanism: up to the end of the table that ends first.

use crate::spec::{Force, Level, Spec, Table, Turning, Value};
use partita_system::breakpoints::{Breakpoints, Enters, Reads};

/// The name of an element and what it is.
type Named<'s> = (&'s str, &'static str);

/// Whether a force may change with time: by tables, or by functions.
pub fn changes(spec: &Spec) -> bool {
    let varies = |value: &Value| match value {
        Value::Constant(_) => false,
        Value::Table(t) => t.coefficients.iter().any(|c| c[..3] != [0.0; 3] || c[3] != t.coefficients[0][3]),
        Value::Function(_) => true,
    };
    spec.forces.iter().flat_map(over_time).any(varies)
}

/// The values of a force over time.
fn over_time(force: &Force) -> Vec<&Value> {
    match force {
        // a table over a coordinate has no end in time
        Force::Torque(x) if x.over.is_some() => Vec::new(),
        other => other.record().values(),
    }
}

/// All tables over time, with their element and how they enter.
fn all(spec: &Spec) -> impl Iterator<Item = (&Table, Named<'_>, Enters)> {
    let drives = spec.drives.iter().map(|d| {
        let enters = match d.level {
            Level::Position => Enters::Position,
            Level::Velocity => Enters::Rate,
        };
        (&d.motion, (&d.name[..], "drive"), enters)
    });
    let forces = spec
        .forces
        .iter()
        .flat_map(|f| over_time(f).into_iter().map(|value| (value, (f.name(), "force"), Enters::Effort)));
    drives.chain(forces).filter_map(|(value, named, enters)| match value {
        Value::Table(table) => Some((table, named, enters)),
        Value::Constant(_) | Value::Function(_) => None,
    })
}

/// The end of the table that ends first, and its element, in words.
pub fn time_domain(spec: &Spec) -> Option<(f64, String)> {
    // an orientation starts again in each interval: it has an end, but its breakpoints are not those of one curve
    let turns = spec.drives.iter().filter_map(|d| match &d.turning {
        Some(Turning::Table { vectors, .. }) => Some((&vectors[0], (&d.name[..], "drive"), Enters::Position)),
        _ => None,
    });
    let ends = all(spec).chain(turns).filter_map(|(table, named, _)| Some((*table.breaks.last()?, named)));
    let first = ends.reduce(|first, other| if other.0 < first.0 { other } else { first });
    first.map(|(end, (name, kind))| (end, words(name, kind)))
}

/// A point of a table is a discontinuity of slope if its distance from the line between its neighbours is larger.
/// Scale: range of the table. Reason: a sampled wave of a hundred points has none.
const DISCONTINUITY: f64 = 1e-3;

/// Ascending times at which a table is discontinuous: a pulse has some, and a step without an evaluation between them
/// would miss it.
pub fn discontinuities(spec: &Spec) -> Vec<f64> {
    let mut found: Vec<f64> = all(spec).flat_map(|(table, ..)| discontinuities_of(table)).collect();
    found.sort_by(f64::total_cmp);
    found.dedup();
    found
}

/// The breakpoints of all tables of time.
pub fn breakpoints(spec: &Spec) -> Vec<Breakpoints> {
    all(spec)
        .filter_map(|(table, _, enters)| {
            Breakpoints::new(&table.breaks, &table.coefficients, enters, false, Reads::Time)
        })
        .collect()
}

fn discontinuities_of(table: &Table) -> Vec<f64> {
    let t = &table.breaks;
    let (Some(last), Some(from)) = (table.coefficients.last(), t.len().checked_sub(2)) else { return Vec::new() };
    let mut values: Vec<f64> = table.coefficients.iter().map(|c| c[3]).collect();
    values.push(last.iter().fold(0.0, |sum, c| sum * (t[from + 1] - t[from]) + c));
    let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(*x), b.max(*x)));
    let is_discontinuity = |i: &usize| {
        let part = (t[*i] - t[i - 1]) / (t[i + 1] - t[i - 1]);
        (values[i - 1] + part * (values[i + 1] - values[i - 1]) - values[*i]).abs() > DISCONTINUITY * (high - low)
    };
    (1..=from).filter(is_discontinuity).map(|i| t[i]).collect()
}

/// Common names need no prefix.
fn words(name: &str, kind: &str) -> String {
    match name.starts_with(&format!("{kind} of ")) || name.starts_with("torque of ") {
        true => format!("the {name}"),
        false => format!("{kind} \"{name}\""),
    }
}
