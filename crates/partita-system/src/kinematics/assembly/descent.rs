//! Descents from one start after the other, each part of the mechanism by itself.

use crate::manifold::least_change::{from_afar, LeastChange};
use crate::manifold::{self, ClosingScratch, Residuals, Rule};
use crate::system::{ConstrainedSystem, SystemError};

/// How a part ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ending {
    Closed,
    /// Closed, with an axis pointing backwards: another mechanism.
    TurnedOver,
    /// At rest with loops open.
    AtRest,
    /// Out of iterations.
    Unfinished,
}

impl From<manifold::Ending> for Ending {
    fn from(ending: manifold::Ending) -> Self {
        match ending {
            manifold::Ending::Closed => Self::Closed,
            manifold::Ending::AtRest => Self::AtRest,
            manifold::Ending::Unfinished | manifold::Ending::Elsewhere => Self::Unfinished,
        }
    }
}

pub(super) struct Descent<'s, S: ConstrainedSystem> {
    pub rows: LeastChange<'s, S>,
    /// How each part ended, and its |Φ|², scaled.
    pub parts: Vec<(Ending, f64)>,
    memory: ClosingScratch,
    y: Vec<f64>,
}

impl<'s, S: ConstrainedSystem> Descent<'s, S> {
    pub fn new(system: &'s S, t: f64, q: &[f64]) -> Result<Self, SystemError> {
        let rows = LeastChange::new(system, t, q, &[])?;
        let parts = vec![(Ending::Unfinished, f64::INFINITY); rows.blocks.len()];
        Ok(Self { rows, parts, memory: ClosingScratch::default(), y: vec![0.0; system.size().nv] })
    }

    /// Parts open by no more than `tolerance` are closed as they stand.
    pub fn leave(&mut self, tolerance: f64) {
        for (i, part) in self.parts.iter_mut().enumerate() {
            let closure_error = self.rows.closure_error_of(i);
            *part = (
                if closure_error.worst <= tolerance { Ending::Closed } else { Ending::Unfinished },
                closure_error.square,
            );
        }
    }

    /// Close the parts that are not closed. Leaves Φ and C of q. Returns the iterations.
    pub fn descend(&mut self, q: &mut [f64], rule: &Rule) -> Result<usize, SystemError> {
        for (b, (ending, _)) in self.rows.blocks.iter_mut().zip(&self.parts) {
            b.rests = *ending == Ending::Closed;
        }
        let done = manifold::close(&mut self.rows, q, rule, &mut self.memory)?;
        for (i, (part, p)) in self.parts.iter_mut().zip(&self.memory.parts).enumerate() {
            *part = (p.ending.map_or(Ending::Unfinished, Ending::from), self.rows.closure_error_of(i).square);
        }
        Ok(done.iterations)
    }

    /// Parts without further progress that are open by no more than this are as closed as their drawing allows.
    pub fn accept_last_digits(&mut self, closure_error: f64) {
        for (i, (ending, _)) in self.parts.iter_mut().enumerate() {
            if matches!(ending, Ending::AtRest | Ending::Unfinished)
                && self.rows.closure_error_of(i).worst <= closure_error
            {
                *ending = Ending::Closed;
            }
        }
    }

    /// Parts closed with an axis reversed are not closed.
    pub fn turn_over(&mut self, q: &[f64]) -> Vec<usize> {
        let rows = self.rows.scaled.system.turned_over(q);
        for (b, part) in self.rows.blocks.iter().zip(&mut self.parts).filter(|(_, part)| part.0 == Ending::Closed) {
            if rows.iter().any(|i| b.rows.contains(i)) {
                *part = (Ending::TurnedOver, f64::INFINITY);
            }
        }
        rows
    }

    pub fn is_closed(&self) -> bool {
        self.parts.iter().all(|part| part.0 == Ending::Closed)
    }

    /// Another start for the parts that are not closed: the drawing, rotated irregularly by more with each attempt.
    ///
    /// Of a large part only the neighbours of an open row start again; every third attempt all of it does.
    pub fn start_again(&mut self, q: &mut [f64], drawn: &[f64], attempt: usize) -> Result<(), SystemError> {
        self.rows.evaluate(q)?;
        self.y.fill(0.0);
        let amplitude = 0.1 + 0.1 * attempt as f64;
        let s = &self.rows.scaled;
        for (i, b) in self.rows.blocks.iter().enumerate().filter(|(i, _)| self.parts[*i].0 != Ending::Closed) {
            let mut again = vec![false; self.y.len()];
            let closure_error = if attempt % 3 == 0 { 0.0 } else { 0.05 * self.rows.closure_error_of(i).worst };
            for &row in b.rows.iter().filter(|&&row| s.phi[row].abs() >= closure_error) {
                s.pattern.row(row).for_each(|e| again[s.pattern.col_idx[e]] = true);
            }
            for &v in b.columns.iter().filter(|&&v| again[v]) {
                let range = s.system.structure().coordinates_of(v);
                q[range.clone()].copy_from_slice(&drawn[range]);
                if !s.locked[v] {
                    self.y[v] = amplitude * irregular(v, attempt);
                }
            }
        }
        self.rows.go(q, 1.0, &self.y);
        Ok(())
    }
}

/// To round-off, or as far as it goes within the tolerance.
pub(super) fn to_round_off(tolerance: f64) -> Rule {
    from_afar(tolerance)
}

/// To within the tolerance, no farther.
pub(super) fn nearly(tolerance: f64) -> Rule {
    Rule { closed: tolerance, ..from_afar(tolerance) }
}

/// Numbers in (−1, 1) without a pattern, always the same: multiples of the golden ratio, mixed.
fn irregular(v: usize, attempt: usize) -> f64 {
    let mut x =
        (v as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (attempt as u64).wrapping_mul(0xd1b5_4a32_d192_ed03);
    x ^= x >> 32;
    x = x.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    x ^= x >> 29;
    (x >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}
