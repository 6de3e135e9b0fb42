//! Classical coordinate partitioning: 2k states, the dependent coordinates by Newton's method in every evaluation.
//!
//! States are the independent coordinates and velocities; at each stage `Φ(q, t) = 0` is solved for q_D from where the
//! motion leads, q_I untouched (34), and the rest is P1-P3 as in the compact form. Same motion and same order of
//! error as that one, at one to three solves more per stage. Prefer it where forces, tables or events must never see
//! an open loop, or where the number of states counts. (Wehage, Haug 1982; catalogue row 3.)
//!
//! Where the drift ends is the whole difference to [`Projective`], which does the rest here too: choice, exchange, events.

use super::continuity::Continuity;
use super::dead_point::dead_point;
use super::projective::{Projective, ProjectiveOptions};
use super::reduction::Reduction;
use super::state_coordinates::StateCoordinates;
use super::{turns, Formulation, FormulationCounters, Output, PartitionEvent, Review, Sample};
use crate::system::{ConstrainedSystem, SystemError};

/// Newton's method from a neighbouring solution needs two or three iterations. Far off it doubles its digits late,
/// and next to a singular position, where two solutions meet, each iteration only halves the distance: 26 for eight
/// digits.
const MOST_ITERATIONS: u64 = 30;
/// A residual of so many round-offs that does not fall any further counts as closed: angles of many turns carry that.
const ROUND_OFF: f64 = 1e4;
/// Where two solutions meet, Newton's method that multiplies or divides the distance from there by more than this
/// started nearly half-way between them: which one it found is chance.
const MOST_CHANGE: f64 = 3.0;
/// A residual of more round-offs than this is no round-off even next to a singular position: an open loop.
const UNDECIDED: f64 = 1e2;

/// The 2k form with closed stages.
///
/// States: the coordinates of the independent velocities, v_I and the work, where there is any. A ball joint's whole
/// quaternion is a state as soon as one of its velocities is independent; closing turns it by what the dependent ones
/// need, and the turned one is written back after a step. Because of that the number of states is counted for the choice
/// that needs most, see [`dim`](Formulation::dim); without ball joints it is 2k.
///
/// At dead points of fixed independent coordinates, and at singular positions of the mechanism, the equations have two
/// solutions that meet. Newton's method starts where the velocities lead and so passes singular positions on the right
/// one; a stage that might have found either, and a step in which velocities jump, are repeated. If none is left, as at
/// most dead points of fixed coordinates, the run ends with a message.
pub struct WehageHaug<'s, S: ConstrainedSystem> {
    system: &'s S,
    inner: Projective<'s, S>,
    states: StateCoordinates,
    /// (q, v_I, work) of the compact form: q from the last solution.
    full: Vec<f64>,
    dfull: Vec<f64>,
    /// q at the end of the last step, to start over from.
    home: Vec<f64>,
    home_t: f64,
    continuity: Continuity,
    move_by: Vec<f64>,
    /// Distance from a singular position at the end of the last step, number of its plan.
    far: Option<(f64, u64)>,
    vdot: Vec<f64>,
    iterations: u64,
}

impl<'s, S: ConstrainedSystem> WehageHaug<'s, S> {
    /// For a system of the given rank (see [`crate::start::analyse`]). There must be no nonholonomic rows.
    ///
    /// `options.correction` has no effect: there is nothing left to correct.
    pub fn new(system: &'s S, rank: usize, options: ProjectiveOptions) -> Result<Self, SystemError> {
        let size = system.size();
        if size.rows > size.holonomic {
            return Err(SystemError::Request(format!(
                "\"wehage-haug\" integrates as many coordinates as velocities, which needs constraints that hold for \
                 positions; {} of the {} rows ({}, ...) hold for velocities only; use \"projective\"",
                size.rows - size.holonomic,
                size.rows,
                system.row_name(size.holonomic)
            )));
        }
        let inner = Projective::new(system, rank, options);
        let full = vec![0.0; inner.dim()];
        Ok(Self {
            system,
            states: StateCoordinates::new(system, size.nv - rank),
            dfull: full.clone(),
            full,
            inner,
            home: vec![0.0; size.nq],
            home_t: 0.0,
            continuity: Continuity::default(),
            move_by: vec![0.0; size.nv],
            far: None,
            vdot: vec![0.0; size.nv],
            iterations: 0,
        })
    }

    fn nq(&self) -> usize {
        self.home.len()
    }

    /// y from `self.full`, for the current choice.
    fn write(&self, y: &mut [f64]) {
        let (nq, places) = (self.nq(), self.states.places());
        self.states.gather(&self.full[..nq], y);
        y[places..].copy_from_slice(&self.full[nq..]);
    }

    /// `self.full` from y, its dependent coordinates solved for.
    fn read(&mut self, t: f64, y: &[f64]) -> Result<(), SystemError> {
        let (nq, places) = (self.nq(), self.states.places());
        self.full[nq..].copy_from_slice(&y[places..]);
        // where the velocities lead is nearest, and where solutions cross it tells the right one
        self.full[..nq].copy_from_slice(&self.home);
        self.continuity.predict(t, &mut self.move_by);
        self.system.step(&mut self.full[..nq], &self.move_by);
        self.states.scatter(y, &mut self.full[..nq]);
        let closed = self.newton(t);
        if matches!(closed, Ok(ratio) if ratio > MOST_CHANGE && t > self.home_t) {
            return Err(self.dead_point(t));
        }
        if closed.is_ok() {
            return Ok(());
        }
        // a long step may lead far off: once more from the end of the last one
        self.full[..nq].copy_from_slice(&self.home);
        self.states.scatter(y, &mut self.full[..nq]);
        let closed = self.newton(t);
        if closed.is_err() {
            self.full[..nq].copy_from_slice(&self.home);
        }
        closed.map(|_| ()).map_err(|e| self.inner.blame(t, &self.home, e))
    }

    /// What there is to say where two solutions cannot be told apart.
    fn dead_point(&mut self, t: f64) -> SystemError {
        let seen = "they cannot tell on which of two branches the others go on".to_string();
        let (nq, r) = (self.nq(), self.inner.reduction());
        let independent = r.partition.independent.clone();
        dead_point(self.system, r.rank(), t, &self.full[..nq], &independent, seen)
    }

    /// `q_D ← q_D − C_D⁻¹ Φ` until nothing but round-off is left.                           (34)
    ///
    /// Returns, near a singular position, by which factor its distance changed on the way, one way or the other; else
    /// 1.
    fn newton(&mut self, t: f64) -> Result<f64, SystemError> {
        let nq = self.nq();
        let near = self.continuity.is_near();
        let (q, r) = (&mut self.full[..nq], self.inner.reduction());
        r.position(t, q)?;
        let mut last = f64::INFINITY;
        let mut first = None;
        let change = |r: &mut Reduction<'_, S>, first: Option<f64>| {
            first.map_or(1.0, |first| {
                let ratio = r.distance().0 / first;
                ratio.max(1.0 / ratio)
            })
        };
        for _ in 0..MOST_ITERATIONS {
            let (open, _) = r.openness();
            if r.is_closed() || (open <= ROUND_OFF && open > 0.5 * last) {
                return Ok(change(r, first));
            }
            if !open.is_finite() {
                return Err(SystemError::NotFinite { what: "a closing condition".into(), t });
            }
            last = open;
            r.factor(t)?;
            if near && first.is_none() {
                first = Some(r.distance().0);
            }
            if !r.correct_dependent(q) {
                if open <= UNDECIDED {
                    return Ok(change(r, first)); // what is left would be amplified, not removed
                }
                r.move_dependent(q);
            }
            self.iterations += 1;
            r.position(t, q)?;
        }
        let (open, row) = r.openness();
        if open <= ROUND_OFF {
            return Ok(change(r, first));
        }
        let name = self.system.row_words(row);
        let block = format!("{name} (Newton's method for the dependent coordinates, {MOST_ITERATIONS} iterations)");
        Err(SystemError::Limit { block, t, shortfall: r.phi[row].abs() })
    }

    /// `self.dfull` as rates of the states.
    fn write_rates(&self, dy: &mut [f64]) {
        let (nq, places) = (self.nq(), self.states.places());
        self.states.gather_rates(&self.dfull[..nq], dy);
        dy[places..].copy_from_slice(&self.dfull[nq..]);
    }

    fn choose(&mut self) {
        let independent = &self.inner.reduction().partition.independent;
        self.states.choose(self.system, independent);
    }
}

impl<S: ConstrainedSystem> Formulation for WehageHaug<'_, S> {
    fn name(&self) -> &'static str {
        "wehage-haug"
    }

    /// Places for the coordinates of any choice (k without ball joints), k velocities, and the work if there is any.
    fn dim(&self) -> usize {
        self.states.places() + self.full.len() - self.nq()
    }

    fn controlled(&self) -> usize {
        self.states.places() + self.inner.controlled() - self.nq()
    }

    fn start(&mut self, t: f64, q: &[f64], v: &[f64], y: &mut [f64]) -> Result<(), SystemError> {
        self.inner.start(t, q, v, &mut self.full)?;
        self.home.copy_from_slice(q);
        self.home_t = t;
        self.choose();
        self.write(y);
        let r = self.inner.reduction();
        r.full_acceleration(&mut self.vdot);
        let gain = r.best_exchange().map_or(0.0, |x| x.gain);
        let distance = if r.rank() > 0 { r.distance().0 } else { f64::INFINITY };
        self.continuity.start(t, &r.v, &self.vdot, Continuity::nearness(gain, distance));
        Ok(())
    }

    fn derivative(&mut self, t: f64, y: &[f64], dy: &mut [f64]) -> Result<(), SystemError> {
        self.read(t, y)?;
        self.inner.derivative(t, &self.full, &mut self.dfull)?;
        self.write_rates(dy);
        Ok(())
    }

    fn correct(&mut self, t: f64, y: &mut [f64]) -> Result<bool, SystemError> {
        self.read(t, y)?;
        let nq = self.nq();
        self.system.normalise(&mut self.full[..nq]);
        if self.states.agree(&self.full[..nq], y) {
            return Ok(false);
        }
        self.write(y); // a quaternion was turned or brought to length 1
        Ok(true)
    }

    fn review(&mut self, t: f64, _y: &[f64]) -> Review {
        let (nq, r) = (self.nq(), self.inner.reduction());
        r.full_acceleration(&mut self.vdot);
        let gain = r.best_exchange().map_or(0.0, |x| x.gain);
        self.far = (r.rank() > 0).then(|| r.distance());
        let near = Continuity::nearness(gain, self.far.map_or(f64::INFINITY, |d| d.0));
        if !self.continuity.step(t, &r.v, &self.vdot, r.scales(), near) {
            return Review::Reject;
        }
        self.home.copy_from_slice(&self.full[..nq]);
        self.home_t = t;
        let review = self.inner.review(t, &self.full);
        if review == Review::Keep && self.continuity.is_stuck(gain) {
            self.continuity.give_up();
            return Review::Reject;
        }
        review
    }

    fn distance(&mut self) -> Option<(f64, u64)> {
        self.far
    }

    fn wrap(&mut self, y: &mut [f64], turns: &mut [i32]) -> bool {
        let (nq, wrapped) = (self.nq(), turns::reduce(self.system, &mut self.home, turns));
        if wrapped {
            self.full[..nq].copy_from_slice(&self.home);
            self.states.gather(&self.home, y);
        }
        wrapped
    }

    fn change(&mut self, t: f64, y: &mut [f64], dy: &mut [f64]) -> Result<(), SystemError> {
        self.read(t, y)?; // outputs may have been evaluated since
        self.inner.change(t, &mut self.full, &mut self.dfull)?;
        self.choose();
        self.write(y);
        self.derivative(t, y, dy)
    }

    fn recover(&mut self, t: f64, y: &mut [f64], dy: &mut [f64]) -> Result<(), SystemError> {
        self.read(t, y)?;
        if self.continuity.is_broken() {
            return Err(self.dead_point(t));
        }
        self.inner.recover(t, &mut self.full, &mut self.dfull)?;
        self.choose();
        self.write(y);
        self.write_rates(dy);
        Ok(())
    }

    fn state_at(&mut self, t: f64, y: &[f64], out: &mut Output) -> Result<(), SystemError> {
        self.read(t, y)?;
        let (nq, r) = (self.nq(), self.inner.reduction());
        let k = r.k();
        r.tangent(t)?;
        r.spread(&self.full[nq..nq + k]);
        out.set(t, &self.full[..nq], &r.v, self.full.get(nq + k).copied().unwrap_or(0.0));
        Ok(())
    }

    fn describe(
        &mut self,
        t: f64,
        q: &[f64],
        v: &[f64],
        within: Option<&PartitionEvent>,
        out: &mut Sample,
    ) -> Result<(), SystemError> {
        self.inner.describe(t, q, v, within, out)
    }

    fn events(&self) -> &[PartitionEvent] {
        self.inner.events()
    }

    fn counters(&self) -> FormulationCounters {
        FormulationCounters { iterations: self.iterations, ..self.inner.counters() }
    }

    fn rows(&self) -> Vec<usize> {
        self.inner.rows()
    }

    fn notes(&self) -> Vec<String> {
        self.inner.notes()
    }
}
