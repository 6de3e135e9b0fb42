//! The steps of a run, kept so that states inside them can be read later: SciPy's dense output, closed.
//!
//! An accepted step leaves what its dense output reads and the choice of coordinates that was in use; nothing is evaluated
//! for it. The memory is bounded: where it is full every second step is forgotten, and from then on every second one is
//! kept, then every fourth, and so on.

use partita_system::formulation::{ChoiceSnapshot, Course, Point};
use std::mem::size_of;
use std::sync::Arc;

/// Numbers in a block of memory. Reason: blocks are taken one at a time, and never moved.
const BLOCK: usize = 1 << 13;

/// A step that was taken.
#[derive(Clone, Debug)]
pub(crate) struct LoggedStep {
    pub(crate) t_old: f64,
    pub(crate) t_new: f64,
    /// Whether it crosses a singular position.
    pub(crate) course: Course,
    /// Distances from one at both ends; NaN where they are not known.
    pub(crate) margins: [f64; 2],
    pub(crate) choice: Arc<ChoiceSnapshot>,
    /// Whole turns removed from each coordinate before it.
    pub(crate) turns: Arc<[i32]>,
    /// Singular positions inside.
    pub(crate) located: Box<[f64]>,
    /// Where its numbers are: the block, the first one and how many.
    block: usize,
    first: usize,
    count: usize,
}

/// The steps of a run.
#[derive(Debug, Default)]
pub struct StepLog {
    /// Memory allowed, and taken.
    limit: usize,
    bytes: usize,
    /// Of how many steps one is kept, and how many were taken.
    every: u64,
    taken: u64,
    steps: Vec<LoggedStep>,
    blocks: Vec<Vec<f64>>,
    /// The choice last seen, and its number.
    choice: Option<(u64, Arc<ChoiceSnapshot>)>,
    /// The end of the run: its last step may go beyond.
    end: f64,
}

impl StepLog {
    /// Within so many bytes; with none nothing is kept.
    pub fn within(limit: usize) -> Self {
        Self { limit, every: 1, ..Self::default() }
    }

    /// Bytes taken.
    pub fn bytes(&self) -> usize {
        self.bytes
    }

    /// Of how many steps one is kept; 1 where all are.
    pub fn every(&self) -> u64 {
        self.every
    }

    /// Whether not even one step fits.
    pub fn is_given_up(&self) -> bool {
        self.limit == 0 && self.taken > 0
    }

    /// Number of steps kept.
    pub fn count(&self) -> usize {
        self.steps.len()
    }

    /// When the first step begins, and the last one or the run ends.
    pub fn span(&self) -> Option<(f64, f64)> {
        Some((self.steps.first()?.t_old, self.steps.last()?.t_new.min(self.end)))
    }

    /// The run ends at t.
    pub(crate) fn end_at(&mut self, t: f64) {
        self.end = t;
    }

    /// The step that contains t; else the last one that ends before t.
    pub(crate) fn find(&self, t: f64) -> Result<usize, Option<usize>> {
        let i = self.steps.partition_point(|step| step.t_new < t);
        match self.steps.get(i).is_some_and(|step| step.t_old <= t) {
            true => Ok(i),
            false => Err(i.checked_sub(1)),
        }
    }

    pub(crate) fn step(&self, i: usize) -> &LoggedStep {
        &self.steps[i]
    }

    /// The numbers of step i.
    pub(crate) fn numbers(&self, i: usize) -> &[f64] {
        let step = &self.steps[i];
        &self.blocks[step.block][step.first..step.first + step.count]
    }

    /// Whether a step that ends at t is to be kept: one that an integration which was set back repeats is not, as outputs are
    /// not taken again.
    fn takes(&mut self, t: f64) -> bool {
        if self.limit == 0 || self.steps.last().is_some_and(|last| t <= last.t_new) {
            return false;
        }
        self.taken += 1;
        (self.taken - 1) % self.every == 0
    }

    /// Keep a step from `t_old` to `t_new` that `formulation` has judged; `save` appends its numbers.
    pub(crate) fn push(
        &mut self,
        formulation: &dyn Point,
        (t_old, t_new): (f64, f64),
        course: Course,
        (turns, located): (&[i32], &[f64]),
        save: impl FnOnce(&mut Vec<f64>) -> bool,
    ) {
        if !self.takes(t_new) {
            return;
        }
        let Some(choice) = self.choice_of(formulation) else { return };
        let last = self.steps.last().map(|last| (last.turns.clone(), last.count));
        let turns = match &last {
            Some((same, _)) if **same == *turns => same.clone(),
            _ => turns.into(),
        };
        // about as many numbers as the step before
        let block = self.block_for(last.map_or(0, |last| last.1));
        let numbers = &mut self.blocks[block];
        let first = numbers.len();
        if !save(numbers) {
            numbers.truncate(first);
            return;
        }
        let count = numbers.len() - first;
        let margins = formulation.step_margins().map(|margin| margin.unwrap_or(f64::NAN));
        let located: Box<[f64]> = located.into();
        self.bytes += size_of::<LoggedStep>() + size_of::<f64>() * (count + located.len());
        self.steps.push(LoggedStep { t_old, t_new, course, margins, choice, turns, located, block, first, count });
        while self.bytes > self.limit {
            self.thin();
        }
    }

    /// The choice in use.
    fn choice_of(&mut self, formulation: &dyn Point) -> Option<Arc<ChoiceSnapshot>> {
        let version = formulation.choice_version()?;
        if let Some((_, known)) = self.choice.as_ref().filter(|(known, _)| *known == version) {
            return Some(known.clone());
        }
        let new = Arc::new(formulation.choice_snapshot()?);
        self.bytes += new.bytes();
        self.choice = Some((version, new.clone()));
        Some(new)
    }

    /// A block with memory for this many numbers.
    fn block_for(&mut self, count: usize) -> usize {
        if self.blocks.last().is_none_or(|block| block.len() + count > block.capacity()) {
            self.blocks.push(Vec::with_capacity(BLOCK.max(count)));
        }
        self.blocks.len() - 1
    }

    /// Forget every second step. One that is too large by itself ends the log.
    fn thin(&mut self) {
        if self.steps.len() < 2 {
            *self = Self { every: self.every, taken: self.taken, ..Self::default() };
            return;
        }
        self.every *= 2;
        let (steps, blocks) = (std::mem::take(&mut self.steps), std::mem::take(&mut self.blocks));
        self.bytes = 0;
        let mut last: Option<&Arc<ChoiceSnapshot>> = None;
        for step in steps.into_iter().step_by(2) {
            let numbers = &blocks[step.block][step.first..step.first + step.count];
            let block = self.block_for(step.count);
            let first = self.blocks[block].len();
            self.blocks[block].extend_from_slice(numbers);
            self.bytes += size_of::<LoggedStep>() + size_of::<f64>() * (step.count + step.located.len());
            self.steps.push(LoggedStep { block, first, ..step });
        }
        for step in &self.steps {
            if last.is_none_or(|last| !Arc::ptr_eq(last, &step.choice)) {
                self.bytes += step.choice.bytes();
                last = Some(&step.choice);
            }
        }
    }
}
