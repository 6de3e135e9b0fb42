//! Evaluations inside a step by compiled code, with the bits of those by levels.
//!
//! Only rates are computed: the end of a step, outputs and everything that looks at the levels evaluates these. At the end of
//! a step accelerations are taken from the code where they come from a recursion, since nothing else of it is looked at. Where
//! a pivot comes near its guard, a number is not finite or an evaluation would fail, the levels decide.

use super::{LevelsOf, Motion};
use crate::compiled::{Compilation, CompiledCode, CompiledRates, WITHOUT};
use crate::error::Result;
use crate::positions::Positions;
use crate::record::History;
use crate::reduction::Reduction;
use crate::system::ConstrainedSystem;
use crate::tangent::Tangent;
use partita_math::program::Compiler;
use partita_math::scalar::Lookup;
use std::sync::Arc;

/// The compiled rates of the choice in use.
#[derive(Debug)]
pub(super) struct CompiledMotion {
    compiler: &'static dyn Compiler,
    when: Compilation,
    /// Number of the plan that they belong to.
    plan: u64,
    rates: Option<Arc<CompiledRates>>,
    /// Number of the rates of (q, u, work), and of those of v for the plan.
    rates_count: usize,
    vdot_count: usize,
    /// Number of the reciprocal pivots and of the excess.
    watched_count: usize,
    /// Whether rows depend on time.
    moves: bool,
    /// The point last evaluated: (q, u), t, the numbers given from outside, intervals of tables.
    inputs: Vec<f64>,
    /// Number of (q, u).
    states: usize,
    /// Number of those given.
    given: usize,
    /// Interval of each table.
    intervals: Vec<usize>,
    /// Whether inputs, outputs and memory are those of the code.
    fits: bool,
    outputs: Vec<f64>,
    /// Memory of the code.
    memory: Vec<f64>,
    /// Evaluations.
    count: u64,
}

impl CompiledMotion {
    /// For motions of a system in all coordinates and independent velocities; none where nothing is ever compiled.
    pub(super) fn new<S: ConstrainedSystem>(r: &Reduction<S>, when: Compilation) -> Option<Self> {
        let (size, moves) = (r.size(), r.system.structure().rheonomic);
        let compiler = <dyn Compiler>::installed().filter(|_| when != Compilation::Never)?;
        let (states, given) = (size.nq + r.k(), r.system.structure().given_count);
        let rates_count = states + usize::from(r.system.structure().has_power || moves);
        Some(Self {
            compiler,
            when,
            plan: 0,
            rates: None,
            rates_count,
            vdot_count: 0,
            watched_count: 0,
            moves,
            inputs: vec![0.0; states + 1 + given],
            states,
            given,
            intervals: Vec::new(),
            fits: false,
            outputs: Vec::new(),
            memory: Vec::new(),
            count: 0,
        })
    }

    /// The rates of (q, u, work), and of v, at (t, y) by the code for the choice in use; none where there is no code, or where
    /// it does not apply.
    fn evaluate<S: ConstrainedSystem>(&mut self, r: &Reduction<S>, t: f64, y: &[f64]) -> Option<[&[f64]; 2]> {
        if self.plan != r.counts.plans || !self.fits {
            self.fit(r)?;
        }
        let CompiledCode { code, lookups } = self.rates.as_ref()?.code()?;
        let (states, rest) = self.inputs.split_at_mut(self.states);
        states.copy_from_slice(&y[..states.len()]);
        rest[0] = t;
        rest[1..=self.given].iter_mut().enumerate().for_each(|(i, x)| *x = r.system.given_number(i));
        code.evaluate(&self.inputs, &mut self.outputs, &mut self.memory);
        // what is looked up may depend on what others found, so that all are known after as many times
        for _ in lookups {
            let (found, inputs) = (self.outputs.len() - lookups.len(), self.states + 1 + self.given);
            if !look_up(lookups, &self.outputs[found..], &mut self.intervals, &mut self.inputs[inputs..]) {
                break;
            }
            code.evaluate(&self.inputs, &mut self.outputs, &mut self.memory);
        }
        let ([rates, vdot], watched) = self.last();
        let (excess, pivots) = watched.split_last()?;
        let applies = *excess <= 0.0 && r.clearly_regular(pivots);
        let finite = rates.iter().chain(vdot).all(|x| x.is_finite());
        (applies && finite).then(|| self.last().0)
    }

    /// The code for the choice in use, made if it is due, and memory for it; none while there is no code.
    #[inline(never)]
    fn fit<S: ConstrainedSystem>(&mut self, r: &Reduction<S>) -> Option<()> {
        if self.plan != r.counts.plans {
            self.plan = r.counts.plans;
            self.rates = r.system.compiled_rates(&r.choice());
            self.vdot_count = if self.moves || r.by_clusters() { r.size().nv } else { 0 };
            self.watched_count = r.rank() + 1;
            self.fits = false;
        }
        let rates = self.rates.as_ref()?;
        if rates.is_due(self.when) {
            self.make(rates, r);
        }
        let CompiledCode { code, lookups } = rates.code()?;
        self.inputs.resize(self.states + 1 + self.given + Lookup::NUMBERS * lookups.len(), 0.0);
        self.outputs.resize(self.rates_count + self.vdot_count + self.watched_count + lookups.len(), 0.0);
        self.memory.resize(code.memory().max(self.memory.len()), 0.0);
        self.intervals.clear();
        self.intervals.resize(lookups.len(), usize::MAX);
        self.fits = true;
        Some(())
    }

    /// Make the code now, or have it made.
    fn make<S: ConstrainedSystem>(&self, rates: &Arc<CompiledRates>, r: &Reduction<S>) {
        let (compiler, when, choice) = (self.compiler, self.when, r.choice());
        if when != Compilation::Beside {
            return rates.make(compiler, when, |most| r.system.recorded_rates(&choice, most));
        }
        let (rates, choice) = (rates.clone(), choice.owned());
        // where no thread can be had the levels go on
        let _ = S::beside(&r.system, move |system| {
            rates.make(compiler, when, |most| system.recorded_rates(&choice.choice(), most));
        });
    }

    /// The rates last evaluated, and what tells whether they apply.
    fn last(&self) -> ([&[f64]; 2], &[f64]) {
        let (rates, rest) = self.outputs.split_at(self.rates_count);
        let (vdot, rest) = rest.split_at(self.vdot_count);
        ([rates, vdot], &rest[..self.watched_count])
    }

    /// Whether (t, y) is the point last evaluated, for the plan in use.
    fn is_at<S: ConstrainedSystem>(&self, r: &Reduction<S>, t: f64, y: &[f64]) -> bool {
        let (states, rest) = self.inputs.split_at(self.states);
        let is_given = |(i, x): (usize, &f64)| r.system.given_number(i) == *x;
        self.plan == r.counts.plans
            && rest[0] == t
            && *states == y[..states.len()]
            && rest[1..=self.given].iter().enumerate().all(is_given)
    }

    /// Contribution to the history of a run.
    pub(super) fn report(&self, history: &mut History) {
        history.counters.compiled_evaluations = self.count;
        let why = match &self.rates {
            Some(rates) => rates.refusal(self.when),
            None => (self.when == Compilation::Always && self.count == 0 && self.plan > 0).then(|| WITHOUT.to_string()),
        };
        if let Some(why) = why {
            history.notes.push(format!("evaluations were not compiled, which changes their time alone: {why}"));
        }
    }
}

/// Put the intervals into `inputs` that these numbers are in; whether one is not that of before.
fn look_up(lookups: &[Lookup], found: &[f64], intervals: &mut [usize], inputs: &mut [f64]) -> bool {
    let mut changed = false;
    let numbers = inputs.chunks_exact_mut(Lookup::NUMBERS);
    for (((lookup, x), interval), numbers) in lookups.iter().zip(found).zip(intervals).zip(numbers) {
        let now = lookup.interval(*x, *interval);
        if now != *interval {
            numbers.copy_from_slice(&lookup.numbers(now));
            (*interval, changed) = (now, true);
        }
    }
    changed
}

impl<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>, P: Positions<'s, S, T>> Motion<'s, S, T, P> {
    /// Evaluate rates by compiled code; for motions in all coordinates and the independent velocities of a partition.
    pub(super) fn compiling(self, when: Compilation) -> Self {
        // rows that may jump are watched by accelerations
        let watched = |x: &CompiledMotion| x.moves || self.prescribed.is_empty();
        let compiled = CompiledMotion::new(self.tangent.seen(), when).filter(watched);
        Self { compiled, ..self }
    }

    /// The rates at (t, y) by compiled code; false where the levels must evaluate them.
    #[inline]
    pub(super) fn compiled_rates(&mut self, t: f64, y: &[f64], dy: &mut [f64]) -> bool {
        let beside = self.layout.beside;
        if self.monitor.crosses_next() {
            return false;
        }
        let Some(compiled) = &mut self.compiled else { return false };
        let r = self.tangent.reduction();
        let Some([rates, vdot]) = compiled.evaluate(r, t, y) else { return false };
        dy[..rates.len()].copy_from_slice(rates);
        if !self.prescribed.is_empty() {
            self.prescribed.pick(rates, vdot, &mut dy[beside..]);
        }
        compiled.count += 1;
        r.counts.factorisations += u64::from(r.rank() > 0);
        self.levels_of = LevelsOf::Behind;
        true
    }

    /// All levels at the end of a step, with accelerations from the code where they come from a recursion, and the rates
    /// there if they are asked for; false, and nothing evaluated, where the levels must find them too. Where the levels are
    /// `behind`, the last evaluation by code applied, and serves if it was here.
    pub(super) fn end_by_code(&mut self, t: f64, y: &[f64], dy: Option<&mut [f64]>, behind: bool) -> Result<bool> {
        let beside = self.layout.beside;
        if self.monitor.crosses_next() || !self.tangent.seen().by_clusters() {
            return Ok(false);
        }
        let Some(compiled) = &mut self.compiled else { return Ok(false) };
        let r = self.tangent.seen();
        // without rates it is no evaluation of its own
        let asked = u64::from(dy.is_some());
        let found = match behind && compiled.is_at(r, t, y) {
            true => Some(compiled.last().0),
            false => compiled.evaluate(r, t, y),
        };
        let Some([rates, vdot]) = found else { return Ok(false) };
        if let Some(dy) = dy {
            dy[..rates.len()].copy_from_slice(rates);
            if !self.prescribed.is_empty() {
                self.prescribed.pick(rates, vdot, &mut dy[beside..]);
            }
        }
        self.vdot.copy_from_slice(vdot);
        compiled.count += asked;
        self.levels(t, y, true)?;
        Ok(true)
    }
}
