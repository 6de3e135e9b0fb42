//! All coordinates as states: `q' = N(q) v`.
//!
//! No equation for q_D is solved inside a step: along solutions Φ is a first integral, and `C v + a = 0` holds to
//! round-off because v is computed, not integrated. After a step the error of S3 is corrected.

use super::{turns, Positions};
use crate::error::Result;
use crate::manifold::kept_rows::TO_ROUND_OFF;
use crate::manifold::{close, ClosingScratch, ClosureError, Linearization, Part, Residuals};
use crate::positions::PositionSteps;
use crate::record::{Correction, History};
use crate::reduction::Reduction;
use crate::system::{ConstrainedSystem, Size};
use crate::tangent::Tangent;
use partita_math::tolerance;

/// q itself (nq states).
pub struct All {
    correction: Correction,
    /// Whether whole turns may be removed from angles.
    wraps: bool,
    q: Vec<f64>,
    dv: Vec<f64>,
    memory: ClosingScratch,
    corrections: u64,
    /// Whether the last correction of an end of a step found nothing to correct, with the position level there.
    found: bool,
}

/// All of q moved by the corrections of a tangent.
struct Corrected<'a, S, T> {
    system: &'a S,
    tangent: &'a mut T,
    t: f64,
    rule: Correction,
    dv: &'a mut [f64],
    closure_error: ClosureError,
}

impl<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>> Residuals for Corrected<'_, S, T> {
    fn evaluate(&mut self, q: &[f64]) -> Result<()> {
        self.tangent.reduction().position(self.t, q)?;
        self.closure_error = ClosureError::of(self.tangent.seen().closure_error_of_rows());
        Ok(())
    }
    fn closure_error(&self, _part: usize) -> ClosureError {
        self.closure_error
    }
}

impl<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>> Linearization for Corrected<'_, S, T> {
    fn solve(&mut self, q: &[f64], _parts: &[Part]) -> Result<bool> {
        self.tangent.correction(self.t, q, self.rule, self.dv)
    }
    fn length(&self, _part: usize) -> f64 {
        self.system.travel(self.dv)
    }
    fn scale(&mut self, _part: usize, by: f64) {
        self.dv.iter_mut().for_each(|x| *x *= by);
    }
    fn advance(&mut self, q: &mut [f64]) {
        self.system.step(q, self.dv);
    }
}

impl All {
    /// For a system of this size.
    pub fn new(size: Size, correction: Correction) -> Self {
        let (q, dv) = (vec![0.0; size.nq], vec![0.0; size.nv]);
        Self {
            correction,
            wraps: true,
            memory: ClosingScratch::for_coordinates(size.nq),
            q,
            dv,
            corrections: 0,
            found: false,
        }
    }

    /// Angles keep their whole turns, because a function depends on them.
    pub fn whole_turns(self) -> Self {
        Self { wraps: false, ..self }
    }

    /// Whether there is nothing to correct.
    fn stays<S: ConstrainedSystem>(&self, r: &Reduction<S>) -> bool {
        self.correction == Correction::None || r.size().holonomic == 0 || r.rank() == 0
    }

    /// Further corrections with the factors in use, each of which at least halves the closure error: then, with the
    /// distance ω of the first one, there is one closed position within 2 ω, and they converge to it. The factors are
    /// renewed where one does not.
    fn contract<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>>(
        &mut self,
        tangent: &mut T,
        t: f64,
        q: &mut [f64],
    ) -> Result<()> {
        let mut before = tangent.seen().closure_error().0;
        loop {
            tangent.reduction().position(t, q)?;
            let (left, r) = (tangent.seen().closure_error().0, tangent.seen());
            if r.is_closed() {
                return Ok(());
            }
            // false where one of them is not finite
            let halved = left < tolerance::CONVERGES * before;
            if !halved {
                self.q.copy_from_slice(q);
                self.close(tangent, t, Correction::Partition)?;
                q.copy_from_slice(&self.q);
                return Ok(());
            }
            if !tangent.correction(t, q, self.correction, &mut self.dv)? {
                return Ok(());
            }
            tangent.seen().system.step(q, &self.dv);
            self.corrections += 1;
            before = left;
        }
    }

    /// Correct q until the loops are closed to round-off or there is no further gain; evaluates the position level
    /// there.
    fn close<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>>(
        &mut self,
        tangent: &mut T,
        t: f64,
        rule: Correction,
    ) -> Result<()> {
        let (system, dv) = (tangent.seen().system.clone(), &mut self.dv[..]);
        let mut rows = Corrected { system: &*system, tangent, t, rule, dv, closure_error: ClosureError::default() };
        match close(&mut rows, &mut self.q, &TO_ROUND_OFF, &mut self.memory) {
            Ok(_) => Ok(()),
            // an error that cannot be corrected here, next to a singular position, remains
            Err(_) => tangent.reduction().position(t, &self.q),
        }
    }
}

impl<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>> Positions<'s, S, T> for All {
    const CLOSED: bool = false;
    fn sizes(&self, of_q: &[f64], out: &mut [f64]) {
        out.copy_from_slice(of_q);
    }
    fn width(&self) -> usize {
        self.q.len()
    }
    fn start(&mut self, _tangent: &mut T, _t: f64, q: &[f64], y: &mut [f64]) {
        y[..q.len()].copy_from_slice(q);
    }
    /// While a singular position is crossed the loops are closed first: the tangent is a quotient of small numbers
    /// there, and the error of one stage is divided by them in the next.
    fn locate(&mut self, tangent: &mut T, t: f64, y: &[f64], crossing: bool) -> Result<bool> {
        let nq = self.q.len();
        self.q.copy_from_slice(&y[..nq]);
        let size = tangent.seen().size();
        match crossing && size.rows == size.holonomic && tangent.seen().rank() > 0 {
            true => self.close(tangent, t, Correction::Partition)?,
            false => tangent.reduction().position(t, &self.q)?,
        }
        Ok(false)
    }
    fn has_all(&self) -> bool {
        true
    }
    fn q(&self) -> &[f64] {
        &self.q
    }
    fn rates(&mut self, tangent: &mut T, _u: &[f64], dy: &mut [f64]) {
        let (nq, r) = (self.q.len(), tangent.reduction());
        r.system.rate(&self.q, &r.at.v, &mut dy[..nq]);
    }
    fn output(&mut self, tangent: &mut T, t: f64, y: &[f64]) -> Result<bool> {
        let nq = self.q.len();
        self.q.copy_from_slice(&y[..nq]);
        tangent.seen().system.normalise(&mut self.q);
        match self.stays(tangent.seen()) {
            true => tangent.reduction().position(t, &self.q)?,
            // an output may lie far from the factors of the last evaluation
            false if self.correction == Correction::Kantorovich => self.close(tangent, t, Correction::Partition)?,
            false => self.close(tangent, t, self.correction)?,
        }
        Ok(false)
    }
}

impl<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>> PositionSteps<'s, S, T> for All {
    fn settle(&mut self, tangent: &mut T, t: f64, y: &mut [f64]) -> Result<bool> {
        self.found = false;
        let (q, r) = (&mut y[..self.q.len()], tangent.reduction());
        let moved = r.system.normalise(q);
        if self.stays(r) {
            return Ok(moved);
        }
        r.position(t, q)?;
        r.jumped(t)?;
        if r.is_closed() {
            self.q.copy_from_slice(q);
            self.found = true;
            return Ok(moved);
        }
        if !tangent.correction(t, q, self.correction, &mut self.dv)? {
            return Ok(moved);
        }
        tangent.seen().system.step(q, &self.dv);
        self.corrections += 1;
        if self.correction == Correction::Kantorovich {
            self.contract(tangent, t, q)?;
        }
        Ok(true)
    }
    fn is_found(&self) -> bool {
        self.found
    }
    fn wrap(&mut self, tangent: &T, y: &mut [f64], turns: &mut [i32]) -> bool {
        self.wraps && turns::reduce(&*tangent.seen().system, &mut y[..self.q.len()], turns)
    }
    fn report(&self, history: &mut History) {
        history.counters.corrections += self.corrections;
    }
}
