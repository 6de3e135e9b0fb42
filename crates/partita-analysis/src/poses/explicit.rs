//! Positions for values of goals that are inputs from which all loops follow in closed form.
//!
//! A path to the value of one goal is the beginning of the paths to all values beyond it. The positions after each full
//! step, the *stations*, are therefore found once for all poses; each pose takes the last step alone.

use super::continuation::Start;
use super::goal::Target;
use super::outcome::{Found, Outcome};
use crate::instant::Levels;
use partita_math::tolerance;
use partita_model::loop_closure::LoopClosing;
use partita_model::Model;
use partita_system::closing::Closing;
use partita_system::manifold::ClosureError;
use partita_system::messages::not_finite;
use partita_system::prelude::*;
use partita_system::SystemError;
use std::sync::Arc;

/// Up to this many blocks, other signs are tried where a pose does not close on its branch.
const BLOCKS: usize = 6;
/// Maximum number of numbers stored at stations: eight megabytes.
pub(super) const STORED: usize = 1 << 20;

/// Positions after each full step from the start, upwards and downwards, with the pivots there; the first is the start.
#[derive(Default)]
struct Stations {
    paths: [Vec<(Vec<f64>, Vec<f64>)>; 2],
}

/// What became of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    /// It was taken.
    Taken,
    /// A loop does not close there.
    Limit,
    /// A pivot may have passed zero.
    Unclear,
}

/// Poses by closed forms.
pub(super) struct Explicit<'m> {
    model: &'m Model,
    t: f64,
    q: Vec<f64>,
    targets: &'m [Target],
    inputs: Vec<usize>,
    closing: LoopClosing<'m>,
    signs: Vec<i8>,
    /// The position found.
    pub there: Vec<f64>,
    before: Vec<f64>,
    trial: Vec<f64>,
    /// Pivots at q, and the position reached on the path.
    first: Vec<f64>,
    pivots: Vec<f64>,
    levels: Levels<'m, Model>,
    stations: Arc<Stations>,
}

impl<'m> Explicit<'m> {
    /// Where the goals are inputs that order all loops.
    pub fn new(model: &'m Model, t: f64, q: &[f64], targets: &'m [Target], start: &Start) -> Option<Self> {
        if start.rest > 0 || !start.free.iter().all(|f| *f) {
            return None;
        }
        let inputs: Option<Vec<usize>> = targets.iter().map(|x| x.own().map(|own| own.1)).collect();
        let inputs = inputs?;
        let closing = model.loop_closing(t, q, Some(&inputs)).ok()?;
        if !closing.is_explicit() {
            return None;
        }
        let signs = closing.state().iter().map(|s| s.branch).collect();
        let pivots: Vec<f64> = closing.state().iter().map(|s| s.pivot).collect();
        Some(Self {
            model,
            t,
            targets,
            inputs,
            closing,
            signs,
            q: q.to_vec(),
            there: q.to_vec(),
            before: q.to_vec(),
            trial: q.to_vec(),
            first: pivots.clone(),
            pivots,
            levels: Levels::new(model),
            stations: Arc::default(),
        })
    }

    /// The same for another thread: the plan follows from the position alone.
    pub fn again(&self) -> Option<Self> {
        Some(Self {
            closing: self.model.loop_closing(self.t, &self.q, Some(&self.inputs)).ok()?,
            q: self.q.clone(),
            inputs: self.inputs.clone(),
            signs: self.signs.clone(),
            there: self.q.clone(),
            before: self.q.clone(),
            trial: self.q.clone(),
            first: self.first.clone(),
            pivots: self.first.clone(),
            levels: Levels::new(self.model),
            stations: self.stations.clone(),
            ..*self
        })
    }

    /// The blocks that have two solutions, with the sign of the one on this branch.
    pub fn branch(&self) -> Vec<(String, i8)> {
        let words = self.closing.blocks().iter().map(|b| b.words.clone());
        words.zip(self.signs.iter().copied()).filter(|(_, sign)| *sign != 0).collect()
    }

    /// A block in words.
    pub fn words_of(&self, block: usize) -> String {
        self.closing.blocks().get(block).map_or_else(String::new, |b| b.words.clone())
    }

    /// With the stations on the path to the farthest of these values of one goal. Several goals have no path in common.
    pub fn with_stations(mut self, values: &[f64]) -> Result<Self, SystemError> {
        let [x] = self.targets else { return Ok(self) };
        let Some((at, _)) = x.own() else { return Ok(self) };
        let (from, step) = (self.q[at], tolerance::STRIDE * x.displacement);
        let room = STORED / self.q.len().max(1);
        let mut stations = Stations::default();
        for (path, direction) in stations.paths.iter_mut().zip([1.0, -1.0]) {
            let farthest = values.iter().fold(0.0, |far: f64, value| far.max(direction * (value - from)));
            self.begin();
            path.push((self.there.clone(), self.pivots.clone()));
            while path.len() <= room && path.len() as f64 * step < farthest {
                let value = from + direction * path.len() as f64 * step;
                if self.advance(&[value], 1.0)? != Step::Taken {
                    break;
                }
                path.push((self.there.clone(), self.pivots.clone()));
            }
        }
        self.stations = Arc::new(stations);
        Ok(self)
    }

    /// At the start, on its branch.
    fn begin(&mut self) {
        self.closing.set_branches(&self.signs);
        self.there.clone_from(&self.q);
        self.pivots.clone_from(&self.first);
    }

    /// From the last station before the values, `step` of the path apart: the part of the path that is done.
    fn begin_near(&mut self, values: &[f64], step: f64) -> f64 {
        self.begin();
        let up = self.targets[0].own().is_some_and(|(at, _)| values[0] >= self.q[at]);
        let stations = self.stations.clone();
        // one step at least is left, which ends at the value itself
        let before = ((1.0 / step).ceil() - 1.0).max(0.0) as usize;
        let path = &stations.paths[usize::from(!up)];
        let last = before.min(path.len().saturating_sub(1));
        let Some((there, pivots)) = path.get(last).filter(|_| last > 0) else { return 0.0 };
        self.there.clone_from(there);
        self.pivots.clone_from(pivots);
        last as f64 * step
    }

    /// A step to this part of the path, unless a loop does not close there or a pivot changes too much.
    fn advance(&mut self, values: &[f64], part: f64) -> Result<Step, SystemError> {
        self.before.clone_from(&self.there);
        if self.close(values, part)?.is_some() {
            return Ok(Step::Limit);
        }
        // a pivot that halves within a step may have passed zero, or may reach it next
        let well = self
            .pivots
            .iter()
            .zip(self.closing.state())
            .all(|(before, now)| now.branch == 0 || tolerance::HALF_LOST * now.pivot >= (now.pivot - before).abs());
        if !well {
            std::mem::swap(&mut self.there, &mut self.before);
            return Ok(Step::Unclear);
        }
        self.pivots.iter_mut().zip(self.closing.state()).for_each(|(before, now)| *before = now.pivot);
        Ok(Step::Taken)
    }

    fn set(&mut self, values: &[f64], part: f64) {
        for (x, &value) in self.targets.iter().zip(values) {
            if let Some((at, _)) = x.own() {
                self.trial[at] = if part == 1.0 { value } else { self.q[at] + (value - self.q[at]) * part };
            }
        }
    }

    /// Close the loops with the goals at this fraction of the path; otherwise the block that fails and its closure
    /// error.
    fn close(&mut self, values: &[f64], part: f64) -> Result<Option<(f64, usize)>, SystemError> {
        self.trial.clone_from(&self.there);
        self.set(values, part);
        match self.closing.close(self.t, &mut self.trial) {
            Ok(()) => {}
            Err(SystemError::Limit { block, shortfall, .. }) => {
                let index = self.closing.blocks().iter().position(|b| b.words.starts_with(&block)).unwrap_or(0);
                return Ok(Some((shortfall, index)));
            }
            Err(e) => return Err(e),
        }
        self.levels.position(self.t, &self.trial)?;
        let closure_error = |(i, x): (usize, &f64)| x.abs() / self.model.row_displacement(i).unwrap_or(1.0);
        let worst = ClosureError::of(self.levels.phi.iter().enumerate().map(closure_error)).worst;
        if !worst.is_finite() {
            return Err(not_finite(self.model, self.t, &self.levels.phi, &self.levels.c));
        }
        if worst > tolerance::CLOSED_FORM {
            let raw = self.levels.phi.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            return Ok(Some((raw, 0)));
        }
        std::mem::swap(&mut self.there, &mut self.trial);
        Ok(None)
    }

    pub fn pose(&mut self, values: &[f64]) -> Result<(Found, Vec<f64>), SystemError> {
        let mut far = 0.0f64;
        for (x, &value) in self.targets.iter().zip(values) {
            far = x.own().map_or(far, |(at, _)| far.max((value - self.q[at]).abs() / x.displacement));
        }
        let longest = tolerance::STRIDE / far;
        let (mut done, mut stride) = (self.begin_near(values, longest), longest);
        // full steps while nothing limits them, so that the last one is not needlessly short
        if done == 0.0 && longest < 1.0 {
            stride = 1.0 / (1.0 / longest).ceil();
        }
        // the nearest part of the path at which a loop does not close
        let mut blocked = f64::INFINITY;
        while done < 1.0 {
            let next = if done + stride > 1.0 - tolerance::EQUAL { 1.0 } else { done + stride };
            match self.advance(values, next)? {
                Step::Taken => {
                    done = next;
                    stride = (2.0 * stride).min(longest);
                    continue;
                }
                Step::Limit => blocked = blocked.min(next),
                Step::Unclear => {}
            }
            stride *= 0.5;
            if stride * far < tolerance::SHORTEST_STEP {
                // next to a limit a pivot vanishes too; which of both the last step meets is chance
                let limit = (blocked - done) * far < tolerance::CLEARLY * tolerance::SHORTEST_STEP;
                return self.beyond(values, done, limit);
            }
        }
        Ok((Found::closed(false), values.to_vec()))
    }

    /// The direct path ends here, after this fraction: at a limit, or where branches meet.
    fn beyond(&mut self, values: &[f64], done: f64, limit: bool) -> Result<(Found, Vec<f64>), SystemError> {
        let missing = self.close(values, 1.0)?;
        // a single goal has only one path; with several goals the signs define the branch, whatever the path
        if missing.is_none() && values.len() > 1 {
            return Ok((Found::closed(true), values.to_vec()));
        }
        let (shortfall, culprit) = missing.unwrap_or((0.0, 0));
        let at = |x: &Target| x.own().map_or(f64::NAN, |own| self.q[own.0]);
        let reached = self.targets.iter().zip(values).map(|(x, value)| at(x) + (value - at(x)) * done).collect();
        let outcome = match missing {
            None if !limit => Outcome::Singular,
            None => Outcome::OtherBranch,
            Some(_) if self.other_branch(values)? => Outcome::OtherBranch,
            Some(_) => Outcome::Open,
        };
        Ok((Found { outcome, shortfall, angle: 0.0, culprit, detour: false }, reached))
    }

    /// Whether it closes with other signs.
    fn other_branch(&mut self, values: &[f64]) -> Result<bool, SystemError> {
        let free: Vec<usize> = (0..self.signs.len()).filter(|&i| self.signs[i] != 0).collect();
        if free.len() > BLOCKS {
            return Ok(false);
        }
        for combination in 1usize..1 << free.len() {
            let mut signs = self.signs.clone();
            for (bit, &i) in free.iter().enumerate() {
                if combination >> bit & 1 == 1 {
                    signs[i] = -signs[i];
                }
            }
            self.closing.set_branches(&signs);
            if self.close(values, 1.0)?.is_none() {
                return Ok(true);
            }
        }
        Ok(false)
    }
}
