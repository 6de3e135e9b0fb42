//! C at the position for which a closing is planned: independent rows, and which row is matched with which unknown.

use super::btf;
use crate::model::Model;
use crate::zero_position::Coordinates;
use partita_math::dense::dot;
use partita_math::elimination::Pattern;
use partita_math::rank::independent_rows;
use partita_math::tolerance;
use partita_system::prelude::*;
use partita_system::{SystemError, SystemRef};

/// C at a position.
pub(super) struct Instant<'m> {
    pub model: SystemRef<'m, Model>,
    pub c: Vec<f64>,
}

impl<'m> Instant<'m> {
    /// Fails where the position is not closed.
    pub fn new(model: SystemRef<'m, Model>, t: f64, q: &[f64]) -> Result<Self, SystemError> {
        if model.coordinates() == Coordinates::Absolute {
            return Err(SystemError::argument(
                "coordinates",
                "explicit closing works with joint coordinates, which absolute coordinates do not have; use \
                 relative coordinates"
                    .into(),
            ));
        }
        let size = model.size();
        if q.len() != size.nq {
            let message = format!("{} coordinates were given, but the mechanism has {}", q.len(), size.nq);
            return Err(SystemError::argument("q", message));
        }
        let (mut phi, mut a) = (vec![0.0; size.holonomic], vec![0.0; size.rows]);
        let mut c = vec![0.0; model.pattern().nnz()];
        model.position(t, q, &mut model.scratch(), &mut phi, &mut c, &mut a)?;
        for (i, x) in phi.iter().enumerate() {
            let closure_error = x.abs() / model.structure().rows[i].size();
            if !closure_error.is_finite() {
                return Err(SystemError::NotFinite { what: model.structure().rows[i].description.to_string(), t });
            }
            if closure_error > tolerance::OPEN {
                let message = format!(
                    "{} has a closure error of {}: explicit closing starts from a closed position; assemble first",
                    model.structure().rows[i].description,
                    partita_math::formatted(x.abs())
                );
                return Err(SystemError::argument("q", message));
            }
        }
        Ok(Self { model, c })
    }

    pub fn pattern(&self) -> &Pattern {
        self.model.pattern()
    }

    /// Independent rows of the columns that `within` names; rows that are nearly zero there are ignored.
    pub fn rows(&self, within: &[bool]) -> Vec<usize> {
        let scale: Vec<f64> = within
            .iter()
            .enumerate()
            .map(|(v, &w)| if w { self.model.structure().displacement(v) } else { 0.0 })
            .collect();
        let mut c = self.c.clone();
        for i in 0..self.pattern().rows {
            let size = self.model.structure().rows[i].size();
            let sum: f64 =
                self.pattern().row(i).map(|e| (c[e] * scale[self.pattern().col_idx[e]] / size).powi(2)).sum();
            if sum < tolerance::REDUNDANT {
                self.pattern().row(i).for_each(|e| c[e] = 0.0);
            }
        }
        let mut rows = independent_rows(self.pattern(), &c, &scale, tolerance::REDUNDANT).kept;
        rows.sort_unstable();
        rows
    }

    /// As many independent velocities among `within` as these rows have; fewer where they are dependent.
    pub fn columns(&self, rows: &[usize], within: &[bool]) -> Vec<usize> {
        let candidates: Vec<usize> = (0..within.len()).filter(|&v| within[v]).collect();
        let mut place = vec![usize::MAX; within.len()];
        candidates.iter().enumerate().for_each(|(i, &v)| place[v] = i);
        let mut entries: Vec<Vec<(usize, f64)>> = vec![Vec::new(); candidates.len()];
        for (i, &r) in rows.iter().enumerate() {
            let size = self.model.structure().rows[r].size();
            for e in self.pattern().row(r) {
                let v = self.pattern().col_idx[e];
                if within[v] {
                    entries[place[v]].push((i, self.c[e] * self.model.structure().displacement(v) / size));
                }
            }
        }
        let mut row_ptr = vec![0];
        for of in &entries {
            row_ptr.push(row_ptr[row_ptr.len() - 1] + of.len());
        }
        let (col_idx, values): (Vec<usize>, Vec<f64>) = entries.into_iter().flatten().unzip();
        let transposed = Pattern::new(candidates.len(), rows.len(), row_ptr, col_idx);
        let kept = independent_rows(&transposed, &values, &vec![1.0; rows.len()], tolerance::REDUNDANT).kept;
        kept.into_iter().map(|i| candidates[i]).collect()
    }

    /// The rows of `others` that are combinations of `rows`, up to round-off.
    pub fn that_follow_exactly(&self, rows: &[usize], others: impl Iterator<Item = usize>) -> Vec<usize> {
        let n = self.model.size().nv;
        let natural = |r: usize| {
            let mut row = vec![0.0; n];
            let size = self.model.structure().rows[r].size();
            for e in self.pattern().row(r) {
                let v = self.pattern().col_idx[e];
                row[v] = self.c[e] * self.model.structure().displacement(v) / size;
            }
            row
        };
        let mut basis: Vec<Vec<f64>> = Vec::new();
        let rest = |basis: &[Vec<f64>], mut row: Vec<f64>| {
            for _ in 0..2 {
                for unit in basis {
                    let along = dot(unit, &row);
                    row.iter_mut().zip(unit).for_each(|(x, u)| *x -= along * u);
                }
            }
            row
        };
        for &r in rows {
            let mut row = rest(&basis, natural(r));
            let length = dot(&row, &row).sqrt();
            row.iter_mut().for_each(|x| *x /= length.max(f64::MIN_POSITIVE));
            basis.push(row);
        }
        let follows = |&r: &usize| {
            let row = rest(&basis, natural(r));
            dot(&row, &row).sqrt() < tolerance::NULL_VALUE
        };
        others.filter(follows).collect()
    }

    /// Degrees of freedom here.
    pub fn mobility(&self) -> usize {
        let nv = self.model.size().nv;
        nv - self.rows(&vec![true; nv]).len()
    }

    /// Rows and, for each unknown, the row matched to it and the unknowns in that row.
    pub(super) fn structure(&self, rows: &[usize], unknown: &[usize]) -> Option<(Vec<usize>, Vec<Vec<usize>>)> {
        let mut index = vec![usize::MAX; self.model.size().nv];
        unknown.iter().enumerate().for_each(|(i, &u)| index[u] = i);
        let columns: Vec<Vec<usize>> = rows
            .iter()
            .map(|&r| {
                let all = self.pattern().row(r).map(|e| index[self.pattern().col_idx[e]]);
                all.filter(|&p| p != usize::MAX).collect()
            })
            .collect();
        let row_of = btf::matching(&columns, unknown.len())?;
        let needs = row_of.iter().map(|&r| columns[r].clone()).collect();
        Some((row_of.iter().map(|&r| rows[r]).collect(), needs))
    }
}
