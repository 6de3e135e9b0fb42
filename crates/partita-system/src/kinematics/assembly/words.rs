//! What stays open, in words.

use super::descent::{Descent, Ending};
use super::Assembly;
use crate::system::{ConstrainedSystem, SystemError};

/// Rows and joints named in one message.
const NAMED: usize = 6;

fn some(names: &[String]) -> String {
    let more = if names.len() > NAMED { format!(" and {} more", names.len() - NAMED) } else { String::new() };
    format!("{}{more}", names[..names.len().min(NAMED)].join(", "))
}

fn open_rows<S: ConstrainedSystem>(d: &Descent<S>, tolerance: f64) -> String {
    let s = &d.scaled;
    let mut open: Vec<usize> = (0..s.rows()).filter(|&i| s.phi[i].abs() > tolerance).collect();
    open.sort_by(|&a, &b| s.phi[b].abs().total_cmp(&s.phi[a].abs()));
    some(&open.iter().map(|&i| format!("{} by {:.3e}", s.system.row_words(i), s.raw(i).abs())).collect::<Vec<_>>())
}

/// `Assembly` at the position last evaluated.
pub(super) fn open<S: ConstrainedSystem>(
    d: &Descent<S>,
    report: &Assembly,
    tolerance: f64,
    advice: &str,
) -> SystemError {
    SystemError::Assembly {
        iterations: report.iterations,
        residual: d.scaled.residual(),
        tolerance,
        loops: open_rows(d, tolerance),
        advice: advice.into(),
    }
}

/// Why the best position found, the one last evaluated, is not closed.
pub(super) fn refused<S: ConstrainedSystem>(
    d: &Descent<S>,
    endings: &[Ending],
    turned: &[usize],
    report: &Assembly,
    tolerance: f64,
) -> SystemError {
    let s = &d.scaled;
    let worst = |a: &usize, b: &usize| s.phi[*a].abs().total_cmp(&s.phi[*b].abs());
    let of = |ending: Ending| {
        let parts = d.parts.iter().zip(endings).filter(move |(_, e)| **e == ending);
        parts.flat_map(|(p, _)| p.rows.iter().copied()).max_by(worst)
    };
    if let (Some(&row), true) = (turned.first(), endings.contains(&Ending::TurnedOver)) {
        let words = s.system.row_words(row);
        let advice = format!(
            "all of {} starts close {words} the wrong way round, its axes pointing backwards; draw {} nearer to where it \
             closes, or turn its axis on one of its bodies",
            report.restarts + 1,
            loop_of(d, row)
        );
        return open(d, report, tolerance, &advice);
    }
    let Some(row) = of(Ending::AtRest) else {
        let farthest = of(Ending::Unfinished).map_or_else(String::new, |i| loop_of(d, i));
        let advice = format!(
            "none of {} starts came to rest, so this says nothing of the lengths; draw {farthest} nearer to where it closes, \
             or start from a state in which it does",
            report.restarts + 1
        );
        return open(d, report, tolerance, &advice);
    };
    // all rows of the same joint
    let owner = |i: usize| s.system.row_name(i).rsplit_once('.').map_or_else(|| s.system.row_name(i), |x| x.0.into());
    let name = owner(row);
    let rows: Vec<usize> = (0..s.rows()).filter(|&i| owner(i) == name).collect();
    let size = |angle: bool| {
        let of_kind = rows.iter().filter(|&&i| s.system.row_is_angle(i) == angle);
        of_kind.map(|&i| s.raw(i).powi(2)).sum::<f64>().sqrt()
    };
    SystemError::Lengths {
        owner: name.into(),
        loop_words: loop_of(d, row).into(),
        shortfall: size(false),
        angle: size(true),
        starts: report.restarts + 1,
        iterations: report.iterations,
        residual: s.residual(),
        loops: open_rows(d, tolerance).into(),
    }
}

/// The loop that row i closes: the joints it runs through.
fn loop_of<S: ConstrainedSystem>(d: &Descent<S>, i: usize) -> String {
    let s = &d.scaled;
    let mut through: Vec<String> = Vec::new();
    for e in s.pattern.row(i) {
        let name = s.system.velocity_name(s.pattern.col_idx[e]);
        let joint = name.rsplit_once('.').map_or(name.as_str(), |x| x.0).to_string();
        if !through.contains(&joint) {
            through.push(joint);
        }
    }
    format!("the loop through {} closed by {}", some(&through), s.system.row_words(i))
}
