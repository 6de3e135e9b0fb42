//! Explicit closing: 2k states, the loops closed by inverse kinematics, nothing iterated and nothing to correct.
//!
//! `q_D = g(q_I, t; ε)` (37), its branches ε constants of the motion between change points; A, η and ξ follow block
//! by block from small systems (38), the equations of motion from P3, the multipliers of the physical closing
//! conditions from the same blocks backwards (43). Prefer it for loops that are recognised, with an input that can
//! turn freely: it is the cheapest form, and closed by construction. An input that runs into a dead point of its
//! block has to be changed; where the choice is the system's own, that is done between steps. (Woernle 1988; Hiller,
//! Kecskeméthy; catalogue row 15.)

mod inputs;
mod levels;

use super::blocks::Blocks;
use super::continuity::Continuity;
use super::dead_point::dead_point;
use super::instant::Describer;
use super::options::FormulationOptions;
use super::state_coordinates::StateCoordinates;
use super::{turns, Formulation, FormulationCounters, Output, PartitionEvent, Review, Sample};
use crate::kinematics::closing::Closing;
use crate::start;
use crate::system::{ConstrainedSystem, SystemError};

/// Steps after which the scales are looked at again, and after which a system that had no better inputs is asked again.
const PERIOD: u32 = 8;
/// The next step may be so many times as long as the last one.
const LONGEST_NEXT: f64 = 5.0;
/// A branch is chosen by the motion where it is at least twice as near as the other: the prediction is then wrong by
/// less than what lies between them.
const MOST_DOUBT: f64 = 0.5;

/// The 2k form on an explicit closing.
///
/// States: the coordinates of the inputs (the whole quaternion of a ball joint), their velocities, and the work, where
/// there is any. Of the options it reads `independent` (inputs that stay) and `exchange` (hysteresis of a change of
/// inputs). At a dead point of inputs that stay the run ends with a message. Change points, where pivots go through
/// zero because the mechanism itself is singular, are passed on the branch that the velocities lead to, and told in
/// the notes.
pub struct ExplicitClosing<'s, S: ConstrainedSystem> {
    system: &'s S,
    scratch: S::Scratch,
    describer: Describer<'s, S>,
    rank: usize,
    k: usize,
    fixed: Option<Vec<usize>>,
    exchange: f64,
    observes_work: bool,
    states: StateCoordinates,
    /// None before the start.
    loops: Option<Loops<'s>>,
    /// The position last closed, and a copy to come back to when a closing fails half-way.
    q: Vec<f64>,
    good: Vec<f64>,
    /// Position and time at the end of the last step, and the branches there.
    home: Vec<f64>,
    home_t: f64,
    branches: Vec<i8>,
    /// Does the march say that a singular position is being passed?
    passing: bool,
    /// May the next step meet one, by how the distance fell in the last?
    approaching: bool,
    /// Did the branches follow the motion in the last step, and did they at the last evaluation?
    followed: bool,
    following: bool,
    qdot: Vec<f64>,
    phi: Vec<f64>,
    c: Vec<f64>,
    a: Vec<f64>,
    b: Vec<f64>,
    dt: Vec<f64>,
    gamma: Vec<f64>,
    delta: Vec<f64>,
    v: Vec<f64>,
    vdot: Vec<f64>,
    md: Vec<f64>,
    md_factor: Vec<f64>,
    hd: Vec<f64>,
    s: Vec<f64>,
    s2: Vec<f64>,
    force: Vec<f64>,
    lambda: Vec<f64>,
    move_by: Vec<f64>,
    /// A, row by row in the order of the unknowns (r x k).
    gains: Vec<f64>,
    continuity: Continuity,
    /// Distance from a singular position at the end of the last step.
    far: f64,
    steps_since_scales: u32,
    /// Steps to go before the system is asked for other inputs again.
    patience: u32,
    /// Gain of an exchange when it was last asked.
    asked_at: f64,
    next: Option<Box<dyn Closing + Send + 's>>,
    events: Vec<PartitionEvent>,
    counters: FormulationCounters,
    /// Blocks that went over to their other branch: block, time, and was it foreseen?
    flips: Vec<(String, f64, bool)>,
}

/// A closing in use.
struct Loops<'s> {
    closing: Box<dyn Closing + Send + 's>,
    blocks: Blocks,
    unknown: Vec<usize>,
}

impl<'s, S: ConstrainedSystem> ExplicitClosing<'s, S> {
    /// For a system of the given rank (see [`crate::start::analyse`]). There must be no nonholonomic rows.
    pub fn new(system: &'s S, rank: usize, options: &FormulationOptions) -> Result<Self, SystemError> {
        let size = system.size();
        if size.rows > size.holonomic {
            return Err(SystemError::Request(format!(
                "\"explicit-closing\" computes dependent coordinates from independent ones; {} of the {} rows ({}, ...) \
                 hold for velocities only and determine no coordinate; use \"projective\"",
                size.rows - size.holonomic,
                size.rows,
                system.row_name(size.holonomic)
            )));
        }
        let (n, k) = (size.nv, size.nv - rank);
        let mut fixed = options.independent.clone();
        if let Some(inputs) = &mut fixed {
            *inputs = start::distinct("inputs", inputs, n)?;
            if inputs.len() != k {
                return Err(SystemError::Request(format!(
                    "{} inputs were asked for, but the mechanism has {k} degrees of freedom; name as many, or \
                     none",
                    inputs.len()
                )));
            }
        }
        Ok(Self {
            system,
            scratch: system.scratch(),
            describer: Describer::new(system, rank),
            rank,
            k,
            fixed,
            exchange: options.exchange,
            observes_work: system.has_power() || system.rheonomic(),
            states: StateCoordinates::new(system, k),
            loops: None,
            q: vec![0.0; size.nq],
            good: vec![0.0; size.nq],
            home: vec![0.0; size.nq],
            home_t: 0.0,
            branches: Vec::new(),
            passing: false,
            approaching: false,
            followed: false,
            following: false,
            qdot: vec![0.0; size.nq],
            phi: vec![0.0; size.holonomic],
            c: vec![0.0; system.pattern().nnz()],
            a: vec![0.0; size.rows],
            b: vec![0.0; size.rows],
            dt: vec![0.0; n * k],
            gamma: vec![0.0; n],
            delta: vec![0.0; n],
            v: vec![0.0; n],
            vdot: vec![0.0; n],
            md: vec![0.0; k * k],
            md_factor: vec![0.0; k * k],
            hd: vec![0.0; k],
            s: vec![1.0; n],
            s2: vec![1.0; n],
            force: vec![0.0; n],
            lambda: vec![0.0; size.rows],
            move_by: vec![0.0; n],
            gains: vec![0.0; rank * k],
            continuity: Continuity::default(),
            far: f64::INFINITY,
            steps_since_scales: 0,
            patience: 0,
            asked_at: 0.0,
            next: None,
            events: Vec::new(),
            counters: FormulationCounters::default(),
            flips: Vec::new(),
        })
    }

    /// Use a closing from the closed position `self.q` on.
    fn adopt(&mut self, t: f64, mut closing: Box<dyn Closing + Send + 's>) -> Result<(), SystemError> {
        closing.close(t, &mut self.q)?;
        self.system.position(t, &self.q, &mut self.scratch, &mut self.phi, &mut self.c, &mut self.a)?;
        let blocks = Blocks::new(self.system, closing.inputs(), closing.blocks(), self.rank, &self.c)?;
        self.states.choose(self.system, closing.inputs());
        self.dt.fill(0.0);
        self.gamma.fill(0.0);
        self.delta.fill(0.0);
        for (j, &i) in closing.inputs().iter().enumerate() {
            self.dt[i * self.k + j] = 1.0;
        }
        self.branches.clear();
        self.branches.extend(closing.state().iter().map(|s| s.branch));
        self.loops = Some(Loops { unknown: blocks.unknown().collect(), blocks, closing });
        self.counters.plans += 1;
        self.refresh_scales(t)
    }

    fn refresh_scales(&mut self, t: f64) -> Result<(), SystemError> {
        self.system.inverse_mass_diagonal(t, &self.q, &mut self.scratch, &mut self.s2)?;
        if let Some(i) = self.s2.iter().position(|x| !(x.is_finite() && *x > 0.0)) {
            return Err(SystemError::Mass { name: self.system.velocity_name(i), pivot: 1.0 / self.s2[i] });
        }
        self.s.iter_mut().zip(&self.s2).for_each(|(s, s2)| *s = s2.sqrt());
        Ok(())
    }

    fn inputs(&self) -> &[usize] {
        self.loops.as_ref().map_or(&[], |l| l.closing.inputs())
    }

    fn names(&self, velocities: &[usize]) -> String {
        velocities.iter().map(|&i| self.system.velocity_name(i)).collect::<Vec<_>>().join(", ")
    }

    /// y from `self.q` and `self.v` for the inputs in use; the work is left alone.
    fn write(&mut self, y: &mut [f64]) {
        self.states.gather(&self.q, y);
        let places = self.states.places();
        for (j, &i) in self.inputs().iter().enumerate() {
            y[places + j] = self.v[i];
        }
    }

    fn note_flips(&mut self, t: f64) {
        let Some(loops) = &self.loops else { return };
        for ((block, state), kept) in loops.closing.blocks().iter().zip(loops.closing.state()).zip(&mut self.branches) {
            if state.branch != 0 && *kept != 0 && state.branch != *kept {
                self.flips.push((block.words.clone(), t, self.following));
            }
            *kept = state.branch;
        }
    }

    /// Smallest singular value of C_D times √(1 + |A|²), all in reaches: as in
    /// [`super::reduction::Reduction::distance`].
    fn distance_here(&mut self) -> f64 {
        let k = self.k;
        let Some(loops) = self.loops.as_mut().filter(|_| self.rank > 0) else { return f64::INFINITY };
        let smallest = loops.blocks.smallest_singular_value(self.system, &self.c, &mut self.force, &mut self.lambda);
        let inputs = loops.closing.inputs();
        let part = |d: usize, j: usize| self.dt[d * k + j] * self.system.reach(inputs[j]) / self.system.reach(d);
        let mixed: f64 = loops.unknown.iter().map(|&d| (0..k).map(|j| part(d, j).powi(2)).sum::<f64>()).sum();
        smallest * (1.0 + mixed).sqrt()
    }
}

impl<S: ConstrainedSystem> Formulation for ExplicitClosing<'_, S> {
    fn name(&self) -> &'static str {
        "explicit-closing"
    }

    /// Places for the coordinates of any inputs (k without ball joints), k velocities, and the work if there is any.
    fn dim(&self) -> usize {
        self.controlled() + usize::from(self.observes_work)
    }

    fn controlled(&self) -> usize {
        self.states.places() + self.k
    }

    fn start(&mut self, t: f64, q: &[f64], v: &[f64], y: &mut [f64]) -> Result<(), SystemError> {
        let closing = self.system.closing(t, q, self.fixed.as_deref())?;
        self.q.copy_from_slice(q);
        self.adopt(t, closing)?;
        self.v.copy_from_slice(v);
        y.fill(0.0);
        self.write(y);
        self.evaluate(t, y)?;
        self.home.copy_from_slice(&self.q);
        self.home_t = t;
        self.far = self.distance_here();
        let near = Continuity::nearness(self.best_gain(), self.far);
        self.continuity.start(t, &self.v, &self.vdot, near);
        let reason = match &self.fixed {
            Some(_) => "inputs fixed by the user".to_string(),
            None => "inputs that close the loops explicitly".to_string(),
        };
        self.log(t, &[], reason)
    }

    fn derivative(&mut self, t: f64, y: &[f64], dy: &mut [f64]) -> Result<(), SystemError> {
        self.evaluate(t, y)?;
        let (places, k) = (self.states.places(), self.k);
        self.system.rate(&self.q, &self.v, &mut self.qdot);
        self.states.gather_rates(&self.qdot, dy);
        dy[places..places + k].copy_from_slice(&self.hd);
        if self.observes_work {
            dy[places + k] = self.power(t)?;
        }
        Ok(())
    }

    fn correct(&mut self, _t: f64, y: &mut [f64]) -> Result<bool, SystemError> {
        self.states.scatter(y, &mut self.q);
        self.system.normalise(&mut self.q);
        if self.states.agree(&self.q, y) {
            return Ok(false);
        }
        self.states.gather(&self.q, y);
        Ok(true)
    }

    fn review(&mut self, t: f64, _y: &[f64]) -> Review {
        self.next = None;
        let gain = self.best_gain();
        let here = self.distance_here();
        let before = std::mem::replace(&mut self.far, here);
        if !self.continuity.step(t, &self.v, &self.vdot, &self.s, Continuity::nearness(gain, self.far)) {
            self.far = before;
            return Review::Reject;
        }
        self.home.copy_from_slice(&self.q);
        self.home_t = t;
        self.note_flips(t);
        self.followed = self.following;
        self.approaching = self.far < LONGEST_NEXT * (before - self.far);
        if self.k == 0 || self.rank == 0 {
            return Review::Keep;
        }
        self.steps_since_scales += 1;
        if self.steps_since_scales >= PERIOD {
            self.steps_since_scales = 0;
            // a failure here would be met by the next evaluation too, which reports it; the old scales serve till then
            let _ = self.refresh_scales(t);
        }
        if self.fixed.is_none() && gain > self.exchange && self.better_inputs(t, gain) {
            return Review::Change;
        }
        if self.continuity.is_stuck(gain) {
            self.continuity.give_up();
            return Review::Reject;
        }
        Review::Keep
    }

    fn distance(&mut self) -> Option<(f64, u64)> {
        (self.rank > 0).then_some((self.far, self.counters.plans))
    }

    fn close_stages(&mut self, on: bool) {
        self.passing = on;
    }

    fn wrap(&mut self, y: &mut [f64], turns: &mut [i32]) -> bool {
        let wrapped = turns::reduce(self.system, &mut self.home, turns);
        if wrapped {
            self.q.copy_from_slice(&self.home);
            self.states.gather(&self.home, y);
        }
        wrapped
    }

    fn change(&mut self, t: f64, y: &mut [f64], dy: &mut [f64]) -> Result<(), SystemError> {
        let Some(next) = self.next.take() else { return Ok(()) };
        // outputs may have been evaluated since: come back to the end of the step
        self.evaluate(t, y)?;
        let before = self.inputs().to_vec();
        let growth = self.growth(next.inputs());
        let (from, to) = (self.names(&before), self.names(next.inputs()));
        self.adopt(t, next)?;
        self.counters.exchanges += 1;
        // distances of different inputs do not compare: be careful once
        self.approaching = true;
        self.write(y);
        self.derivative(t, y, dy)?;
        let reason = format!("{to} in the place of {from} as inputs: the volume of the choice grows by {growth:.3}");
        self.log(t, &before, reason)
    }

    fn recover(&mut self, t: f64, y: &mut [f64], dy: &mut [f64]) -> Result<(), SystemError> {
        self.derivative(t, y, dy)?;
        if !self.continuity.is_broken() {
            return Ok(());
        }
        let Some(loops) = &self.loops else { return Ok(()) };
        Err(undecided(self.system, self.rank, t, &self.q, &*loops.closing))
    }

    fn state_at(&mut self, t: f64, y: &[f64], out: &mut Output) -> Result<(), SystemError> {
        let mut y = y.to_vec();
        self.correct(t, &mut y)?;
        self.kinematics(t, &y)?;
        let work = if self.observes_work { y[self.states.places() + self.k] } else { 0.0 };
        out.set(t, &self.q, &self.v, work);
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
        let inputs = within.map_or_else(|| self.inputs(), |event| &event.independent).to_vec();
        self.describer.describe(t, q, v, Some(&inputs), out).map(|_| ())
    }

    fn events(&self) -> &[PartitionEvent] {
        &self.events
    }

    fn counters(&self) -> FormulationCounters {
        self.counters
    }

    fn rows(&self) -> Vec<usize> {
        let mut rows: Vec<usize> = self.loops.iter().flat_map(|l| l.blocks.rows()).collect();
        rows.sort_unstable();
        rows
    }

    fn notes(&self) -> Vec<String> {
        let Some(loops) = &self.loops else { return Vec::new() };
        let words = loops.closing.blocks().iter().zip(loops.closing.state()).map(|(block, state)| {
            let how = if block.explicit { "in closed form" } else { "by Newton's method" };
            match state.branch {
                0 => format!("{} {how}", block.words),
                sign => format!("{} {how}, branch {sign:+}", block.words),
            }
        });
        let words: Vec<String> = words.collect();
        let mut notes = Vec::new();
        if !words.is_empty() {
            let inputs = self.names(self.inputs());
            notes.push(format!("the loops are closed explicitly for the inputs {inputs}: {}", words.join("; ")));
        }
        for (block, t, foreseen) in self.flips.iter().take(6) {
            notes.push(match foreseen {
                true => format!(
                    "{block} passed its change point in the step before t = {t}: its other branch goes on there"
                ),
                false => format!("{block} changed its branch in the step before t = {t}: the motion jumped there"),
            });
        }
        if self.flips.len() > 6 {
            notes.push(format!("{} more changes of branches are not listed", self.flips.len() - 6));
        }
        notes
    }
}

/// Where two branches meet and the inputs lead no further: a dead point of theirs, or, where a drive leads, a limit of the
/// block that meets its other branch first.
fn undecided<S: ConstrainedSystem>(system: &S, rank: usize, t: f64, q: &[f64], closing: &dyn Closing) -> SystemError {
    let blocks = closing.blocks().iter().zip(closing.state());
    let worst = blocks.min_by(|x, y| x.1.pivot.total_cmp(&y.1.pivot));
    let block = worst.map_or_else(String::new, |(block, _)| block.words.clone());
    if closing.inputs().is_empty() {
        return SystemError::Limit { block, t, shortfall: 0.0 };
    }
    let seen = format!("{block} would have to go over to its other branch, where it meets this one");
    dead_point(system, rank, t, q, closing.inputs(), seen)
}
