//! Positions for values of goals that are inputs from which all loops follow in closed form.
//!
//! A path to the value of one goal is the beginning of the paths to all values beyond it. The positions after each full
//! step, the *stations*, are therefore found once for all poses; each pose takes the last step alone.

use super::continuation::Start;
use super::goal::Target;
use super::outcome::{Outcome, PoseNumbers};
use crate::equilibrium::displacement_between;
use crate::instant::Levels;
use partita_math::tolerance;
use partita_model::loop_closure::{ClosingProgram, LoopClosing};
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

/// The part of the direct path that is done, and the length of its next step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Path {
    done: f64,
    stride: f64,
    longest: f64,
}

impl Path {
    /// From this part on, in steps of this length at most.
    fn new(done: f64, longest: f64) -> Self {
        // full steps while nothing limits them, so that the last one is not needlessly short
        let even = done == 0.0 && longest < 1.0;
        Self { done, longest, stride: if even { 1.0 / (1.0 / longest).ceil() } else { longest } }
    }

    /// End of the next step.
    pub fn next(&self) -> f64 {
        if self.done + self.stride > 1.0 - tolerance::EQUAL {
            1.0
        } else {
            self.done + self.stride
        }
    }

    /// It was taken.
    pub fn taken(&mut self, next: f64) {
        (self.done, self.stride) = (next, (2.0 * self.stride).min(self.longest));
    }
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
        let memory = STORED / self.q.len().max(1);
        let mut stations = Stations::default();
        for (path, direction) in stations.paths.iter_mut().zip([1.0, -1.0]) {
            let farthest = values.iter().fold(0.0, |far: f64, value| far.max(direction * (value - from)));
            self.begin();
            path.push((self.there.clone(), self.pivots.clone()));
            while path.len() <= memory && path.len() as f64 * step < farthest {
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

    /// The path to these values, and the last station before them where it begins: position and pivots.
    fn station(&self, values: &[f64]) -> (Path, &[f64], &[f64]) {
        let mut far = 0.0f64;
        for (x, &value) in self.targets.iter().zip(values) {
            far = x.own().map_or(far, |(at, _)| far.max((value - self.q[at]).abs() / x.displacement));
        }
        let step = tolerance::STRIDE / far;
        let up = self.targets[0].own().is_some_and(|(at, _)| values[0] >= self.q[at]);
        // one step at least is left, which ends at the value itself
        let before = ((1.0 / step).ceil() - 1.0).max(0.0) as usize;
        let path = &self.stations.paths[usize::from(!up)];
        let last = before.min(path.len().saturating_sub(1));
        match path.get(last).filter(|_| last > 0) {
            Some((there, pivots)) => (Path::new(last as f64 * step, step), there, pivots),
            None => (Path::new(0.0, step), &self.q, &self.first),
        }
    }

    /// As `station`, with the pivots of blocks with a sign alone.
    pub fn path(&self, values: &[f64]) -> (Path, &[f64], impl Iterator<Item = f64> + '_) {
        let (path, q, pivots) = self.station(values);
        (path, q, self.signs.iter().zip(pivots).filter(|(sign, _)| **sign != 0).map(|(_, x)| *x))
    }

    /// The program of the closing on this branch, if it has one.
    pub fn program(&self) -> Option<ClosingProgram> {
        let mut closing = self.model.loop_closing(self.t, &self.q, Some(&self.inputs)).ok()?;
        closing.set_branches(&self.signs);
        closing.program(self.t)
    }

    /// Coordinates of the goals at this part of the path.
    pub fn goals<'v>(&'v self, values: &'v [f64], part: f64) -> impl Iterator<Item = (usize, f64)> + 'v {
        self.targets.iter().zip(values).filter_map(move |(x, &value)| {
            let (at, _) = x.own()?;
            Some((at, if part == 1.0 { value } else { self.q[at] + (value - self.q[at]) * part }))
        })
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

    /// Largest displacement of the step that was refused last, where it closed.
    fn refused(&self) -> f64 {
        displacement_between(self.model, &self.there, &self.before).iter().fold(0.0, |m: f64, x| m.max(x.abs()))
    }

    /// Close the loops with the goals at this fraction of the path; otherwise the block that fails and its closure
    /// error.
    fn close(&mut self, values: &[f64], part: f64) -> Result<Option<(f64, usize)>, SystemError> {
        let mut trial = std::mem::take(&mut self.trial);
        trial.clone_from(&self.there);
        self.goals(values, part).for_each(|(at, x)| trial[at] = x);
        self.trial = trial;
        match self.closing.close(self.t, &mut self.trial) {
            Ok(()) => {}
            Err(SystemError::Limit { block, shortfall, .. }) => {
                let index = self.closing.blocks().iter().position(|b| b.words.starts_with(&block)).unwrap_or(0);
                return Ok(Some((shortfall, index)));
            }
            Err(e) => return Err(e),
        }
        self.levels.position(self.t, &self.trial)?;
        let closure_error = |(i, x): (usize, &f64)| x.abs() / self.model.structure().rows[i].size();
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

    pub fn pose(&mut self, values: &[f64]) -> Result<(PoseNumbers, Vec<f64>), SystemError> {
        self.begin();
        let (mut path, there, pivots) = self.station(values);
        let (there, pivots) = (there.to_vec(), pivots.to_vec());
        (self.there, self.pivots) = (there, pivots);
        let far = tolerance::STRIDE / path.longest;
        // the nearest part of the path at which a loop does not close
        let mut blocked = f64::INFINITY;
        while path.done < 1.0 {
            let next = path.next();
            let step = self.advance(values, next)?;
            match step {
                Step::Taken => {
                    path.taken(next);
                    continue;
                }
                Step::Limit => blocked = blocked.min(next),
                Step::Unclear => {}
            }
            path.stride *= 0.5;
            // next to a limit of the goals the other coordinates still move by their root
            let is_short = path.stride * far < tolerance::SHORTEST_STEP;
            if is_short && (step == Step::Limit || self.refused() < tolerance::SHORTEST_STEP) {
                // next to a limit a pivot vanishes too; which of both the last step meets is chance
                let limit = (blocked - path.done) * far < tolerance::CLEARLY * tolerance::SHORTEST_STEP;
                return self.beyond(values, path.done, limit);
            }
        }
        Ok((PoseNumbers::closed(false), values.to_vec()))
    }

    /// The position found, NaN where the pose was not assembled.
    pub fn write(&self, found: &PoseNumbers, q: &mut [f64]) {
        match found.outcome {
            Outcome::Closed => q.copy_from_slice(&self.there),
            _ => q.fill(f64::NAN),
        }
    }

    /// The direct path ends here, after this fraction: at a limit, or where branches meet.
    fn beyond(&mut self, values: &[f64], done: f64, limit: bool) -> Result<(PoseNumbers, Vec<f64>), SystemError> {
        let missing = self.close(values, 1.0)?;
        // a single goal has only one path; with several goals the signs define the branch, whatever the path
        if missing.is_none() && values.len() > 1 {
            return Ok((PoseNumbers::closed(true), values.to_vec()));
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
        Ok((PoseNumbers { outcome, shortfall, angle: 0.0, culprit, detour: false }, reached))
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
