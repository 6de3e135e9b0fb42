//! The steps of a run, kept so that states inside them can be read later: SciPy's dense output, closed.
//!
//! An accepted step leaves what its dense output reads and the choice of coordinates that was in use; nothing is evaluated
//! for it. The memory is bounded: where it is full every second step is forgotten, and from then on every second one is
//! kept, then every fourth, and so on.

use partita_system::formulation::{ChoiceSnapshot, Course, Point};
use std::mem::{size_of, size_of_val};
use std::ops::Range;

/// Numbers in the first block of memory, and in the largest ones. Reason: blocks are taken one at a time and never moved,
/// and a short run takes little.
const BLOCKS: Range<usize> = 1 << 9..1 << 13;

/// A step that was taken: a line of memory, copied without counting who has it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LoggedStep {
    pub(crate) t_old: f64,
    pub(crate) t_new: f64,
    /// Distances from a singular position at both ends; NaN where they are not known.
    pub(crate) margins: [f64; 2],
    /// Whether it crosses one.
    pub(crate) course: Course,
    /// Its choice, and the whole turns removed before it: which of those of the log.
    pub(crate) choice: u32,
    turns: u32,
    /// Where its numbers are: the block, the first one, how many the stepper has, and how many singular positions inside
    /// follow them.
    block: u32,
    first: u32,
    count: u32,
    located: u32,
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
    /// The choices, in the order of the steps, and the number of the last one.
    choices: Vec<ChoiceSnapshot>,
    version: Option<u64>,
    /// Whole turns, in the order of the steps.
    turns: Vec<Box<[i32]>>,
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

    /// The choice with which step i was taken.
    pub(crate) fn choice(&self, i: usize) -> &ChoiceSnapshot {
        &self.choices[self.steps[i].choice as usize]
    }

    /// Whole turns removed from each coordinate before step i.
    pub(crate) fn turns(&self, i: usize) -> &[i32] {
        &self.turns[self.steps[i].turns as usize]
    }

    /// The numbers of the stepper in step i, and the singular positions inside.
    pub(crate) fn numbers(&self, i: usize) -> (&[f64], &[f64]) {
        let step = &self.steps[i];
        self.blocks[step.block as usize][step.indices()].split_at(step.count as usize)
    }

    /// Whether a step that ends at t is to be kept: one that an integration which was set back repeats is not, as outputs are
    /// not taken again.
    fn takes(&mut self, t: f64) -> bool {
        if self.limit == 0 || self.steps.last().is_some_and(|last| t <= last.t_new) {
            return false;
        }
        self.taken += 1;
        self.every == 1 || (self.taken - 1) % self.every == 0
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
        let (turns, margins) = (self.turns_of(turns), formulation.step_margins());
        // about as many numbers as the step before
        let block = self.block_for(self.steps.last().map_or(0, |last| last.indices().len()));
        let numbers = &mut self.blocks[block];
        let first = numbers.len();
        if !save(numbers) {
            numbers.truncate(first);
            return;
        }
        let count = numbers.len() - first;
        numbers.extend_from_slice(located);
        self.bytes += size_of::<LoggedStep>() + size_of::<f64>() * (count + located.len());
        self.steps.push(LoggedStep {
            t_old,
            t_new,
            margins,
            course,
            choice,
            turns,
            block: block as u32,
            first: first as u32,
            count: count as u32,
            located: located.len() as u32,
        });
        while self.bytes > self.limit {
            self.thin();
        }
    }

    /// The choice in use: which one it is.
    fn choice_of(&mut self, formulation: &dyn Point) -> Option<u32> {
        let version = formulation.choice_version()?;
        if self.version != Some(version) {
            self.add_choice(formulation.choice_snapshot()?);
            self.version = Some(version);
        }
        Some(self.choices.len() as u32 - 1)
    }

    /// These turns: which they are.
    fn turns_of(&mut self, turns: &[i32]) -> u32 {
        if self.turns.last().is_none_or(|last| **last != *turns) {
            self.bytes += size_of_val(turns);
            self.turns.push(turns.into());
        }
        self.turns.len() as u32 - 1
    }

    fn add_choice(&mut self, choice: ChoiceSnapshot) {
        self.bytes += choice.bytes();
        self.choices.push(choice);
    }

    /// A block with memory for this many numbers.
    fn block_for(&mut self, count: usize) -> usize {
        let last = self.blocks.last();
        if last.is_none_or(|block| block.len() + count > block.capacity()) {
            let size = last.map_or(BLOCKS.start, |block| BLOCKS.end.min(2 * block.capacity()));
            self.blocks.push(Vec::with_capacity(size.max(count)));
        }
        self.blocks.len() - 1
    }

    /// Forget every second step. One that is too large by itself ends the log.
    fn thin(&mut self) {
        let (every, limit) = if self.steps.len() < 2 { (self.every, 0) } else { (2 * self.every, self.limit) };
        let thinned = Self { limit, every, taken: self.taken, end: self.end, ..Self::default() };
        let before = std::mem::replace(self, thinned);
        if limit == 0 {
            return;
        }
        let in_use = before.choices.len();
        let (mut choices, mut of) = (before.choices.into_iter().enumerate(), None);
        for step in before.steps.iter().step_by(2) {
            if of != Some(step.choice) {
                let found = choices.find(|(i, _)| *i == step.choice as usize);
                found.into_iter().for_each(|(_, choice)| self.add_choice(choice));
                of = Some(step.choice);
            }
            let turns = self.turns_of(&before.turns[step.turns as usize]);
            let numbers = &before.blocks[step.block as usize][step.indices()];
            let block = self.block_for(numbers.len());
            let (choice, first) = (self.choices.len() as u32 - 1, self.blocks[block].len() as u32);
            self.blocks[block].extend_from_slice(numbers);
            self.bytes += size_of::<LoggedStep>() + size_of_val(numbers);
            self.steps.push(LoggedStep { choice, turns, block: block as u32, first, ..*step });
        }
        self.version = before.version.filter(|_| of.is_some_and(|of| of as usize + 1 == in_use));
    }
}

impl LoggedStep {
    /// The indices of its numbers in their block.
    fn indices(&self) -> Range<usize> {
        let first = self.first as usize;
        first..first + (self.count + self.located) as usize
    }
}
