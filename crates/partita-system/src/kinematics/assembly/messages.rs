//! Messages on what remains open.

use super::descent::Ending;
use super::Assembly;
use crate::manifold::least_change::LeastChange;
use crate::messages::{loop_of, some};
use crate::system::{ConstrainedSystem, SystemError};
use partita_math::formatted;
use partita_math::sorting::sort_by;

fn open_rows<S: ConstrainedSystem>(d: &LeastChange<S>, tolerance: f64) -> String {
    let s = &d.scaled;
    let mut open: Vec<usize> = (0..s.rows()).filter(|&i| s.phi[i].is_nan() || s.phi[i].abs() > tolerance).collect();
    sort_by(&mut open, |&a, &b| s.phi[b].abs().total_cmp(&s.phi[a].abs()));
    some(
        &open
            .iter()
            .map(|&i| match s.raw(i).is_finite() {
                true => format!("{} by {}", s.system.structure().rows[i].description, formatted(s.raw(i).abs())),
                false => format!("{}, which is not finite", s.system.structure().rows[i].description),
            })
            .collect::<Vec<_>>(),
    )
}

/// `Assembly` at the position last evaluated.
pub(super) fn not_closed<S: ConstrainedSystem>(
    d: &LeastChange<S>,
    report: &Assembly,
    tolerance: f64,
    advice: &str,
) -> SystemError {
    stopped(d, report, tolerance, (open_rows(d, tolerance), advice))
}

fn stopped<S: ConstrainedSystem>(
    d: &LeastChange<S>,
    report: &Assembly,
    tolerance: f64,
    (loops, advice): (String, &str),
) -> SystemError {
    let (iterations, residual) = (report.iterations, d.scaled.residual());
    SystemError::Assembly { iterations, residual, tolerance, loops, advice: advice.into() }
}

/// Why the best position found, the one last evaluated, is not closed.
pub(super) fn refused<S: ConstrainedSystem>(
    d: &LeastChange<S>,
    endings: &[Ending],
    turned: &[usize],
    report: &Assembly,
    tolerance: f64,
) -> SystemError {
    let s = &d.scaled;
    let worst = |a: &usize, b: &usize| s.phi[*a].abs().total_cmp(&s.phi[*b].abs());
    let of = |ending: Ending| {
        let parts = d.blocks.iter().zip(endings).filter(move |(_, e)| **e == ending);
        parts.flat_map(|(b, _)| b.rows.iter().copied()).max_by(worst)
    };
    if let (Some(&row), true) = (turned.first(), endings.contains(&Ending::TurnedOver)) {
        let words = s.system.structure().rows[row].description.to_string();
        let advice = format!(
            "all {} starts close {words} with its axes opposed; place {} nearer to the closed position, or reverse \
             its axis on one of its bodies",
            report.restarts + 1,
            closed_loop(d, row)
        );
        let over = turned.iter().map(|&i| format!("{} with opposed axes", s.system.structure().rows[i].description));
        let mut loops: Vec<String> = over.collect();
        loops.extend(Some(open_rows(d, tolerance)).filter(|x| !x.is_empty()));
        return stopped(d, report, tolerance, (some(&loops), &advice));
    }
    let Some(row) = of(Ending::AtRest) else {
        let farthest = of(Ending::Unfinished).map_or_else(String::new, |i| closed_loop(d, i));
        let advice = format!(
            "none of {} starts converged, so the lengths may be right; place {farthest} nearer to the closed \
             position, or start from a closed state",
            report.restarts + 1
        );
        return not_closed(d, report, tolerance, &advice);
    };
    // all rows of the same joint
    let all = &s.system.structure().rows;
    let owner = |i: usize| all[i].name.rsplit_once('.').map_or(&*all[i].name, |x| x.0);
    let name = owner(row);
    let rows: Vec<usize> = (0..s.rows()).filter(|&i| owner(i) == name).collect();
    let size = |angle: bool| {
        let of_kind = rows.iter().filter(|&&i| all[i].is_angle == angle);
        of_kind.map(|&i| s.raw(i).powi(2)).sum::<f64>().sqrt()
    };
    SystemError::Lengths {
        owner: name.into(),
        loop_description: closed_loop(d, row).into(),
        shortfall: size(false),
        angle: size(true),
        starts: report.restarts + 1,
        iterations: report.iterations,
        residual: s.residual(),
        loops: open_rows(d, tolerance).into(),
    }
}

fn closed_loop<S: ConstrainedSystem>(d: &LeastChange<S>, row: usize) -> String {
    format!("{} closed by {}", loop_of(d.scaled.system, row), d.scaled.system.structure().rows[row].description)
}
