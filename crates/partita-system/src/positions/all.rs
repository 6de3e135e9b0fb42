//! All coordinates as states: `q' = N(q) v`.
//!
//! No equation for q_D is solved inside a step: along solutions Φ is a first integral, and `C v + a = 0` holds to
//! round-off because v is computed, not integrated. After a step the remainder of S3 is removed.

use super::{turns, Positions};
use crate::error::Result;
use crate::record::{Correction, Journal};
use crate::reduction::Reduction;
use crate::system::ConstrainedSystem;
use crate::tangent::Tangent;

/// q itself (nq states).
pub struct All {
    correction: Correction,
    /// May angles lose whole turns?
    wraps: bool,
    q: Vec<f64>,
    last: Vec<f64>,
    corrections: u64,
}

impl All {
    /// For nq coordinates.
    pub fn new(nq: usize, correction: Correction) -> Self {
        Self { correction, wraps: true, q: vec![0.0; nq], last: vec![0.0; nq], corrections: 0 }
    }

    /// Angles keep their whole turns: somebody counts on them.
    pub fn whole_turns(self) -> Self {
        Self { wraps: false, ..self }
    }

    /// Is there nothing to correct?
    fn stays<S: ConstrainedSystem>(&self, r: &Reduction<S>) -> bool {
        self.correction == Correction::None || r.size().holonomic == 0 || r.rank() == 0
    }

    /// Correct q until the loops are closed to round-off or nothing is gained any more; leaves the position level
    /// there.
    ///
    /// Two iterations of Newton's method reach round-off from an interpolation error, one more sees that nothing is
    /// gained.
    fn close<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>>(
        &mut self,
        tangent: &mut T,
        t: f64,
        rule: Correction,
    ) -> Result<()> {
        let mut left = f64::INFINITY;
        for _ in 0..8 {
            tangent.reduction().position(t, &self.q)?;
            let now = tangent.seen().closure_of_kept();
            if now >= left {
                self.q.copy_from_slice(&self.last);
                return tangent.reduction().position(t, &self.q);
            }
            if tangent.seen().is_closed() || (left.is_finite() && now > 0.25 * left) {
                return Ok(());
            }
            self.last.copy_from_slice(&self.q);
            left = now;
            // what cannot be removed here, next to a singular position, stays
            if !matches!(tangent.correct(t, &mut self.q, rule), Ok(true)) {
                break;
            }
        }
        tangent.reduction().position(t, &self.q)
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
    /// While a singular position is passed the loops are closed first: the tangent is a quotient of small numbers
    /// there, and what one stage leaves open the next one divides again.
    fn locate(&mut self, tangent: &mut T, t: f64, y: &[f64], passing: bool) -> Result<bool> {
        let nq = self.q.len();
        self.q.copy_from_slice(&y[..nq]);
        let size = tangent.seen().size();
        match passing && size.rows == size.holonomic && tangent.seen().rank() > 0 {
            true => self.close(tangent, t, Correction::Partition)?,
            false => tangent.reduction().position(t, &self.q)?,
        }
        Ok(false)
    }
    fn holds_all(&self) -> bool {
        true
    }
    fn q(&self) -> &[f64] {
        &self.q
    }
    fn rates(&mut self, tangent: &mut T, _u: &[f64], dy: &mut [f64]) {
        let (nq, r) = (self.q.len(), tangent.reduction());
        r.system.rate(&self.q, &r.v, &mut dy[..nq]);
    }
    fn settle(&mut self, tangent: &mut T, t: f64, y: &mut [f64]) -> Result<bool> {
        let (q, r) = (&mut y[..self.q.len()], tangent.reduction());
        let moved = r.system.normalise(q);
        if self.stays(r) {
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
    fn output(&mut self, tangent: &mut T, t: f64, y: &[f64]) -> Result<bool> {
        let nq = self.q.len();
        self.q.copy_from_slice(&y[..nq]);
        tangent.seen().system.normalise(&mut self.q);
        match self.stays(tangent.seen()) {
            true => tangent.reduction().position(t, &self.q)?,
            false => self.close(tangent, t, self.correction)?,
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
