//! Self-stresses: combinations of multipliers that do no work on any motion, `Cᵀ λ = 0`.            (R2)
//!
//! A multiplier is determined by the motion if and only if it is zero in every self-stress (Wojtyra 2005).

use crate::formulation::reduction::Reduction;
use crate::system::ConstrainedSystem;

/// One self-stress per dropped row: that row with multiplier 1 and the kept rows balancing it.
///
/// Needs `position` and `factor` at an assembled position. Rows and multipliers of each, zeros left out. Cost: one
/// sparse solve per dropped row.
pub fn self_stresses<S: ConstrainedSystem>(r: &Reduction<S>, dropped: &[usize]) -> Vec<Vec<(usize, f64)>> {
    let pattern = r.system.pattern();
    let n = r.size().nv;
    let mut column = vec![0.0; n];
    dropped
        .iter()
        .map(|&row| {
            column.fill(0.0);
            for e in pattern.row(row) {
                column[pattern.col_idx[e]] = r.c[e];
            }
            // C_Rᵀ x = c_row, from the dependent columns
            let mut x: Vec<f64> = r.partition.dependent.iter().map(|&i| -column[i]).collect();
            r.solve_transposed(&mut x);
            let mut stress = vec![(row, 1.0)];
            stress.extend(r.partition.rows.iter().copied().zip(x).filter(|p| p.1 != 0.0));
            stress
        })
        .collect()
}
