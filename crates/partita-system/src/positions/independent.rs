//! The coordinates of the independent velocities as states (2k in all); the dependent ones are solved for in every
//! evaluation.
//!
//! Same motion and same order of error as with all coordinates. Prefer it where forces, tables or events must never be
//! evaluated with an open loop, or where the number of states matters.
//!
//! A ball joint's whole quaternion is a state as soon as one of its velocities is independent; closing rotates it by
//! its dependent ones, and the result is written back after a step. Therefore the number of states is that of the
//! choice that needs most; without ball joints it is k.

use super::continuity::Continuity;
use super::state_coordinates::StateCoordinates;
use super::{turns, Positions};
use crate::error::Result;
use crate::positions::PositionSteps;
use crate::record::History;
use crate::record::StepDecision;
use crate::system::{ConstrainedSystem, SystemError};
use crate::tangent::Tangent;

/// Kind of point that is solved for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Point {
    /// A stage of a step.
    Stage,
    /// A stage while a singular position is being passed.
    Crossing,
    /// An output inside the step that was judged: its end is known too.
    Inside,
}

/// Starting data of every solver for dependent coordinates.
pub struct Core {
    pub(super) states: StateCoordinates,
    /// The position last found.
    pub(super) q: Vec<f64>,
    /// Position and time at the end of the last step.
    pub(super) home: Vec<f64>,
    pub(super) home_t: f64,
    pub(super) continuity: Continuity,
    move_by: Vec<f64>,
}

impl Core {
    /// The prediction of q by the velocities at the end of the last step, with the states of y.
    pub(super) fn predict<S: ConstrainedSystem>(&mut self, system: &S, t: f64, y: &[f64], at: Point) {
        self.q.copy_from_slice(&self.home);
        match at {
            Point::Inside => self.continuity.inside(t, &mut self.move_by),
            _ => self.continuity.predict(t, &mut self.move_by),
        }
        system.step(&mut self.q, &self.move_by);
        self.states.scatter(y, &mut self.q);
    }
}

/// A solver for dependent coordinates.
pub trait Dependent<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>> {
    /// Whether solving changes the states too, so that the end of a step is solved before they are compared.
    const SOLVES: bool;
    /// The tangent was started at `core.q`.
    fn start(&mut self, _core: &Core, _tangent: &mut T, _margin: Option<f64>) {}
    /// Find `core.q` for y; evaluates the position level there.
    fn solve(&mut self, core: &mut Core, tangent: &mut T, t: f64, y: &[f64], at: Point) -> Result<()>;
    /// Data of the end of the step under judgement.
    fn look(&mut self, _tangent: &mut T) {}
    /// Accept the step that was judged.
    fn accept(&mut self, _tangent: &mut T, _t: f64, _margin: Option<f64>) {}
    /// The tangent has chosen anew.
    fn chosen_anew(&mut self, _tangent: &mut T) {}
    /// Message where two solutions cannot be distinguished.
    fn undecided(&mut self, core: &Core, tangent: &T, t: f64) -> SystemError;
    /// Contribution to the history of a run.
    fn report(&self, _history: &mut History) {}
}

/// Independent coordinates, the others by K.
pub struct Independent<K> {
    core: Core,
    by: K,
    /// q, v' and the gain of a switch at the end of the step that is judged.
    trial: Vec<f64>,
    vdot: Vec<f64>,
    gain: f64,
    rates: Vec<f64>,
    /// The state at an output, where it has to be determined first.
    y: Vec<f64>,
}

impl<K> Independent<K> {
    /// For a system of the given rank.
    pub fn new<S: ConstrainedSystem>(system: &S, rank: usize, by: K) -> Self {
        let size = system.size();
        let core = Core {
            states: StateCoordinates::new(system, size.nv - rank),
            q: vec![0.0; size.nq],
            home: vec![0.0; size.nq],
            home_t: 0.0,
            continuity: Continuity::default(),
            move_by: vec![0.0; size.nv],
        };
        Self {
            core,
            by,
            trial: vec![0.0; size.nq],
            vdot: vec![0.0; size.nv],
            gain: 0.0,
            rates: vec![0.0; size.nq],
            y: Vec::new(),
        }
    }

    fn choose<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>>(&mut self, tangent: &T) {
        let system = tangent.seen().system.clone();
        self.core.states.choose(&*system, tangent.independent(None).unwrap_or(&[]));
    }
}

impl<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>, K: Dependent<'s, S, T>> Positions<'s, S, T> for Independent<K> {
    const CLOSED: bool = true;
    fn sizes(&self, of_q: &[f64], out: &mut [f64]) {
        self.core.states.gather(of_q, out);
    }
    fn width(&self) -> usize {
        self.core.states.width()
    }
    fn start(&mut self, tangent: &mut T, t: f64, q: &[f64], y: &mut [f64]) {
        self.core.q.copy_from_slice(q);
        self.core.home.copy_from_slice(q);
        self.core.home_t = t;
        self.choose(tangent);
        self.core.states.gather(q, y);
        let margin = tangent.margin().map(|m| m.0);
        tangent.full_acceleration(&mut self.vdot);
        let near = Continuity::nearness(best_gain(tangent), margin.unwrap_or(f64::INFINITY));
        self.core.continuity.start(t, &tangent.seen().at.v, &self.vdot, near);
        self.by.start(&self.core, tangent, margin);
    }
    fn locate(&mut self, tangent: &mut T, t: f64, y: &[f64], crossing: bool) -> Result<bool> {
        let at = if crossing { Point::Crossing } else { Point::Stage };
        self.by.solve(&mut self.core, tangent, t, y, at)?;
        Ok(false)
    }
    fn q(&self) -> &[f64] {
        &self.core.q
    }
    fn rates(&mut self, tangent: &mut T, _u: &[f64], dy: &mut [f64]) {
        let r = tangent.seen();
        r.system.rate(&self.core.q, &r.at.v, &mut self.rates);
        self.core.states.gather_rates(&self.rates, dy);
    }
    fn output(&mut self, tangent: &mut T, t: f64, y: &[f64]) -> Result<bool> {
        if K::SOLVES {
            self.by.solve(&mut self.core, tangent, t, y, Point::Inside)?;
            return Ok(false);
        }
        let mut own = std::mem::take(&mut self.y);
        own.clear();
        own.extend_from_slice(y);
        let settled = self.settle(tangent, t, &mut own);
        let found = settled.and_then(|_| self.by.solve(&mut self.core, tangent, t, &own, Point::Inside));
        self.y = own;
        found.map(|()| false)
    }
    fn rewrite(&mut self, tangent: &mut T, q: &[f64], y: &mut [f64]) {
        self.core.q.copy_from_slice(q);
        self.choose(tangent);
        self.core.states.gather(q, y);
        self.by.chosen_anew(tangent);
    }
}

impl<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>, K: Dependent<'s, S, T>> PositionSteps<'s, S, T>
    for Independent<K>
{
    fn settle(&mut self, tangent: &mut T, t: f64, y: &mut [f64]) -> Result<bool> {
        if K::SOLVES {
            self.by.solve(&mut self.core, tangent, t, y, Point::Stage)?;
        } else {
            self.core.states.scatter(y, &mut self.core.q);
        }
        tangent.seen().system.normalise(&mut self.core.q);
        if self.core.states.agree(&self.core.q, y) {
            return Ok(false);
        }
        self.core.states.gather(&self.core.q, y); // a quaternion was turned or brought to length 1
        Ok(true)
    }
    fn judge(&mut self, tangent: &mut T, t: f64, margin: Option<f64>) -> StepDecision {
        tangent.full_acceleration(&mut self.vdot);
        self.gain = best_gain(tangent);
        let near = Continuity::nearness(self.gain, margin.unwrap_or(f64::INFINITY));
        let r = tangent.seen();
        if !self.core.continuity.judge(t, &r.at.v, &self.vdot, r.scales(), near) {
            return StepDecision::Repeat;
        }
        self.trial.copy_from_slice(&self.core.q);
        self.by.look(tangent);
        StepDecision::Keep
    }
    fn is_stuck(&mut self) -> bool {
        let stuck = self.core.continuity.is_stuck(self.gain);
        if stuck {
            self.core.continuity.give_up();
        }
        stuck
    }
    fn accept(&mut self, tangent: &mut T, t: f64, margin: Option<f64>) {
        self.core.q.copy_from_slice(&self.trial);
        self.core.home.copy_from_slice(&self.trial);
        self.core.home_t = t;
        self.core.continuity.accept();
        self.by.accept(tangent, t, margin);
    }
    fn failure(&mut self, tangent: &mut T, t: f64) -> Option<SystemError> {
        self.core.continuity.gave_up().then(|| self.by.undecided(&self.core, tangent, t))
    }
    fn wrap(&mut self, tangent: &T, y: &mut [f64], turns: &mut [i32]) -> bool {
        let wrapped = turns::reduce(&*tangent.seen().system, &mut self.core.home, turns);
        if wrapped {
            self.core.q.copy_from_slice(&self.core.home);
            self.core.states.gather(&self.core.home, y);
        }
        wrapped
    }
    fn report(&self, history: &mut History) {
        self.by.report(history);
    }
}

/// The largest gain a switch of coordinates promises at the last evaluation.         (P6)
fn best_gain<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>>(tangent: &mut T) -> f64 {
    tangent.reduction().best_switch().map_or(0.0, |x| x.gain)
}
