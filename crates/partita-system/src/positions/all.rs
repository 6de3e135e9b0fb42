//! All coordinates as states: `q' = N(q) v`.
//!
//! No equation for q_D is solved inside a step: along solutions Φ is a first integral, and `C v + a = 0` holds to round-off
//! because v is computed, not integrated. After a step the remainder of S3 is removed.

use super::correction::close_with;
use super::{turns, Positions};
use crate::record::{Correction, Journal};
use crate::system::{ConstrainedSystem, SystemError};
use crate::tangent::Tangent;

/// q itself (nq states).
pub struct All {
    correction: Correction,
    /// May angles lose whole turns?
    wraps: bool,
    q: Vec<f64>,
    corrections: u64,
}

impl All {
    /// For nq coordinates.
    pub fn new(nq: usize, correction: Correction) -> Self {
        Self { correction, wraps: true, q: vec![0.0; nq], corrections: 0 }
    }

    /// Angles keep their whole turns: somebody counts on them.
    pub fn whole_turns(self) -> Self {
        Self { wraps: false, ..self }
    }
}

impl<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>> Positions<'s, S, T> for All {
    const CLOSED: bool = false;

    fn sizes(&self, of_q: &[f64], out: &mut [f64]) {
        out.copy_from_slice(of_q);
    }
    fn places(&self) -> usize {
        self.q.len()
    }
    fn start(&mut self, _tangent: &mut T, _t: f64, q: &[f64], y: &mut [f64]) {
        y[..q.len()].copy_from_slice(q);
    }
    /// While a singular position is passed the loops are closed first: the tangent is a quotient of small numbers there, and
    /// what one stage leaves open the next one divides again.
    fn locate(&mut self, tangent: &mut T, t: f64, y: &[f64], passing: bool) -> Result<bool, SystemError> {
        let nq = self.q.len();
        self.q.copy_from_slice(&y[..nq]);
        let r = tangent.reduction();
        r.position(t, &self.q)?;
        let size = r.size();
        if passing && size.rows == size.holonomic && r.rank() > 0 {
            for _ in 0..3 {
                if tangent.reduction().is_closed() || !tangent.correct(t, &mut self.q, Correction::Partition)? {
                    break;
                }
                tangent.reduction().position(t, &self.q)?;
            }
        }
        Ok(false)
    }
    fn q(&self) -> &[f64] {
        &self.q
    }
    fn rates(&mut self, tangent: &mut T, _u: &[f64], dy: &mut [f64]) {
        let (nq, r) = (self.q.len(), tangent.reduction());
        r.system.rate(&self.q, &r.v, &mut dy[..nq]);
    }
    fn settle(&mut self, tangent: &mut T, t: f64, y: &mut [f64]) -> Result<bool, SystemError> {
        let (q, r) = (&mut y[..self.q.len()], tangent.reduction());
        let moved = r.system.normalise(q);
        if self.correction == Correction::None || r.size().holonomic == 0 || r.rank() == 0 {
            return Ok(moved);
        }
        r.position(t, q)?;
        r.jumped(t)?;
        if r.is_closed() || !tangent.correct(t, q, self.correction)? {
            return Ok(moved);
        }
        self.corrections += 1;
        Ok(true)
    }
    fn output(&mut self, tangent: &mut T, t: f64, y: &[f64]) -> Result<bool, SystemError> {
        let nq = self.q.len();
        self.q.copy_from_slice(&y[..nq]);
        let r = tangent.reduction();
        r.system.normalise(&mut self.q);
        if self.correction == Correction::None || r.size().holonomic == 0 || r.rank() == 0 {
            r.position(t, &self.q)?;
            return Ok(false);
        }
        let open = |tangent: &mut &mut T, q: &[f64]| {
            let r = tangent.reduction();
            r.position(t, q)?;
            Ok((!r.is_closed()).then(|| r.closure()))
        };
        // what cannot be removed here, next to a singular position, stays
        let step = |tangent: &mut &mut T, q: &mut [f64]| Ok(matches!(tangent.correct(t, q, self.correction), Ok(true)));
        let mut x = tangent;
        if !close_with(&mut x, &mut self.q, open, step)? {
            x.reduction().position(t, &self.q)?;
        }
        Ok(false)
    }
    fn wrap(&mut self, tangent: &T, y: &mut [f64], turns: &mut [i32]) -> bool {
        self.wraps && turns::reduce(tangent.seen().system, &mut y[..self.q.len()], turns)
    }
    fn report(&self, journal: &mut Journal) {
        journal.counters.corrections += self.corrections;
    }
}
