//! Further checks of a certificate besides the closure errors: accelerations, and the rank of the constraints.

use super::chunk_of;
use super::rows::{tables, Rows, Watch};
use super::{Forces, States};
use crate::error::AnalysisError;
use crate::instant::Levels;
use partita_math::tolerance;
use partita_model::Model;
use partita_system::prelude::*;
use partita_system::start::rank_here;
use partita_system::SystemError;

/// At each state: the largest |C v' + b|, its row, the worst row of Φ, the rank of C, and the smallest squared sine
/// between an accepted row and the others. NaN where there is no row, or no acceleration.                        (S5)
///
/// # Errors
/// Errors of user functions and of `watch`.
pub fn checks(model: &Model, states: &States, forces: &Forces, watch: Watch) -> Result<Vec<Vec<f64>>, AnalysisError> {
    let pattern = model.pattern();
    let worst = |values: &mut dyn Iterator<Item = f64>| {
        values.enumerate().fold((f64::NAN, f64::NAN), |m, (i, x)| if x.abs() <= m.0 { m } else { (x.abs(), i as f64) })
    };
    let switched: Vec<bool> = {
        let always = model.rows_of(model.permanent());
        (0..model.size().rows).map(|row| !always.contains(&row)).collect()
    };
    let row = |i: usize, levels: &mut Levels<Model>, rows: &mut Rows| {
        let ((t, q, v), (vdot, lambda)) = (states.at(model, i), forces.at(model, i));
        levels.velocity(t, q, v)?;
        let along = |r: usize| pattern.row(r).map(|e| levels.c[e] * vdot[pattern.col_idx[e]]).sum::<f64>();
        let finite = vdot.iter().all(|x| x.is_finite());
        // a drive that does not hold asks for nothing, nor friction that slips, whose force stands as its multiplier
        let rate = |r: usize| {
            let terms = pattern.row(r).map(|e| levels.c[e] * v[pattern.col_idx[e]]);
            terms.fold((levels.a[r], levels.a[r].abs()), |sum, x| (sum.0 + x, sum.1 + x.abs()))
        };
        let rests = |r: usize| {
            let (rate, terms) = rate(r);
            rate.abs() <= tolerance::STANDING.max(tolerance::EQUAL * terms)
        };
        let acts = |r: usize| !switched[r] || lambda[r] != 0.0 && rests(r);
        let violation = |r: usize| match (finite, acts(r)) {
            (true, true) => along(r) + levels.b[r],
            (true, false) => 0.0,
            (false, _) => f64::NAN,
        };
        let (acceleration, at) = worst(&mut (0..pattern.rows).map(violation));
        let (_, phi) = worst(&mut levels.phi.iter().enumerate().map(|(r, x)| if acts(r) { *x } else { 0.0 }));
        let (rank, smallest) = match rank_here(model.permanent(), t, q) {
            Ok(found) => (found.rank as f64, found.smallest),
            Err(SystemError::Singular { .. } | SystemError::Mass { .. }) => (f64::NAN, 0.0),
            Err(other) => return Err(other.into()),
        };
        for (table, x) in [acceleration, at, phi, rank, smallest].into_iter().enumerate() {
            rows.row(table, i)[0] = x;
        }
        Ok(())
    };
    tables(states.len(), &[1; 5], chunk_of(model), || Levels::new(model), row, watch)
}
