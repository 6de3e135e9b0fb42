//! An explicit method that notices where stiff forces limit its steps: it says so, or leaves the motion to an implicit one and
//! takes it back.

use crate::counters::Counters;
use crate::explicit_rk::ExplicitRungeKutta;
use crate::failure::StepFailure;
use crate::implicit_rk::Radau;
use crate::ode::Ode;
use crate::options::{Options, OptionsError};
use crate::stepper::{Conclusion, CurrentStep, StepControl, StepEnd, StepPlan, StepStorage, Stepper};
use crate::stiffness::Stiffness;
use partita_math::formatted;
use partita_system::linear_rates::LinearRates;
use std::fmt::Display;

/// Steps between two looks, where the method may change. Unit: number. Reason: a look costs as much as one to ten steps.
const LOOKS: u64 = 20;
/// Most steps between two looks while nothing limits the steps. Unit: number. Reason: a hundredth of the work at most.
const RARELY: u64 = 640;
/// Steps before the first look, where the method stays; the next ones follow after twice as many. Unit: number. Reason:
/// runs that take no more steps need no advice.
const ADVISES: u64 = 250;
/// Looks in a row that have to agree. Unit: number. Reason: one may meet a short transient.
const AGREE: u32 = 2;
/// Implicit steps in a row with which an explicit method would be stable, before it takes over. Unit: number. Reason: the first
/// steps after a change are short for their own reasons.
const STABLE: u32 = 12;
/// Changes of the method that are told one by one. Unit: number. Reason: a sentence each.
const LISTED: usize = 3;

/// What is done about it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Policy {
    /// It is said.
    Advise,
    /// The method is changed.
    Change,
}

/// An explicit method, and the implicit one beside it.
#[derive(Debug)]
pub(crate) struct Switching {
    policy: Policy,
    name: &'static str,
    explicit: ExplicitRungeKutta,
    implicit: Radau,
    /// Whether the implicit one is at work.
    is_stiff: bool,
    sizes: Vec<f64>,
    /// The tolerance, in these sizes.
    tolerance: f64,
    linear: LinearRates,
    /// Explicit steps since the last look, and when the next one is due.
    since: u64,
    due: u64,
    agreed: u32,
    stable: u32,
    /// Rates where the implicit method was linearised last, and how often it was.
    known: Option<(u64, Stiffness)>,
    /// When the method changed, and what for.
    changes: Vec<(f64, bool, Stiffness)>,
    count: u64,
    /// Looks and their evaluations.
    looks: Counters,
    counters: Counters,
}

impl Switching {
    pub(crate) fn new(
        policy: Policy,
        name: &'static str,
        explicit: ExplicitRungeKutta,
        dim: usize,
        options: Options,
    ) -> Result<Self, OptionsError> {
        Ok(Self {
            policy,
            name,
            explicit,
            is_stiff: false,
            sizes: vec![1.0; dim],
            tolerance: options.rtol,
            implicit: Radau::new(dim, options)?,
            linear: LinearRates::default(),
            since: 0,
            due: if policy == Policy::Change { LOOKS } else { ADVISES },
            agreed: 0,
            stable: 0,
            known: None,
            changes: Vec::new(),
            count: 0,
            looks: Counters::default(),
            counters: Counters::default(),
        })
    }

    fn control(&self) -> &dyn StepControl {
        match self.is_stiff {
            true => &self.implicit,
            false => &self.explicit,
        }
    }

    fn control_mut(&mut self) -> &mut dyn StepControl {
        match self.is_stiff {
            true => &mut self.implicit,
            false => &mut self.explicit,
        }
    }

    fn stepper<E: Display>(&mut self) -> &mut dyn Stepper<E> {
        match self.is_stiff {
            true => &mut self.implicit,
            false => &mut self.explicit,
        }
    }

    fn count(&mut self) {
        self.counters = *self.explicit.counters() + *self.implicit.counters() + self.looks;
    }

    /// What limits explicit steps here; none where it cannot be told.
    fn look<E: Display>(&mut self, ode: &mut dyn Ode<Error = E>) -> Option<Stiffness> {
        let now = self.explicit.current();
        let made = ode.linear_rates(now.t_old, (now.y_old, now.dy_old), &self.sizes, &mut self.linear);
        self.looks.jacobians += 1;
        self.looks.evaluations += self.linear.evaluations;
        made.ok()?;
        Stiffness::of(&self.linear, (&self.sizes, self.tolerance), now.dy_old, now.next)
    }

    fn note(&mut self, t: f64, to_implicit: bool, found: Stiffness) {
        self.count += 1;
        if self.changes.len() < LISTED {
            self.changes.push((t, to_implicit, found));
        }
    }

    /// Before an explicit step: look whether it is limited by stability.
    fn watch_explicit<E: Display>(&mut self, ode: &mut dyn Ode<Error = E>) {
        if self.since < self.due {
            return;
        }
        self.since = 0;
        let (h, t) = (self.explicit.current().next, self.explicit.current().t_old);
        let found = self.look(ode);
        let limited = found.filter(|found| found.limits(h));
        match (self.policy, limited) {
            (Policy::Advise, limited) => {
                self.due *= 2;
                if let Some(found) = limited.filter(|_| self.changes.is_empty()) {
                    self.note(t, true, found);
                }
            }
            (Policy::Change, None) => {
                let far = found.is_none_or(|found| found.is_far(h));
                (self.agreed, self.due) = (0, if far { RARELY.min(2 * self.due) } else { LOOKS });
            }
            (Policy::Change, Some(found)) => {
                (self.agreed, self.due) = (self.agreed + 1, LOOKS / 2);
                if self.agreed >= AGREE {
                    self.implicit.adopt(self.explicit.hand_over());
                    (self.is_stiff, self.stable, self.known) = (true, 0, None);
                    self.note(t, true, found);
                }
            }
        }
    }

    /// Before an implicit step: whether an explicit one would be stable.
    fn watch_implicit(&mut self) {
        let now = self.implicit.current();
        let made = self.implicit.counters().jacobians;
        if self.known.is_none_or(|(known, _)| known != made) {
            let found = self
                .implicit
                .linear()
                .and_then(|x| Stiffness::of(x, (&self.sizes, self.tolerance), now.dy_old, now.next));
            self.known = found.map(|found| (made, found));
        }
        let Some((_, found)) = self.known else { return };
        self.stable = if found.allows(now.next) { self.stable + 1 } else { 0 };
        if self.stable >= STABLE {
            let t = now.t_old;
            self.explicit.adopt(self.implicit.hand_over());
            (self.is_stiff, self.since, self.due, self.agreed) = (false, 0, LOOKS, 0);
            self.note(t, false, found);
        }
    }
}

impl StepControl for Switching {
    fn current(&self) -> CurrentStep<'_> {
        self.control().current()
    }
    fn counters(&self) -> &Counters {
        &self.counters
    }
    fn plan(&mut self, plan: &StepPlan) {
        self.control_mut().plan(plan);
    }
    fn set_sizes(&mut self, sizes: &[f64]) {
        self.sizes.copy_from_slice(sizes);
        self.explicit.set_sizes(sizes);
        self.implicit.set_sizes(sizes);
    }
    fn set_reference(&mut self, size: f64) {
        self.explicit.set_reference(size);
    }
    fn replace_start(&mut self, t: f64, y: &[f64], dy: &[f64]) {
        self.control_mut().replace_start(t, y, dy);
    }
    fn commit(&mut self) {
        self.since += 1;
        self.control_mut().commit();
        self.count();
    }
    fn reject(&mut self, factor: f64) {
        self.control_mut().reject(factor);
        self.count();
    }
    fn end_at(&mut self, t: f64) {
        self.control_mut().end_at(t);
        self.count();
    }
    fn end_at_corner(&mut self, t: f64) {
        self.control_mut().end_at_corner(t);
        self.count();
    }
    fn notes(&self) -> Vec<String> {
        let words = |(t, to_implicit, found): &(f64, bool, Stiffness)| {
            let (t, why) = (formatted(*t), found.words());
            match (self.policy, to_implicit) {
                (Policy::Advise, _) => format!(
                    "at t = {t} s stability, not accuracy, limits the steps of {}: {why}; method=\"radau\" takes \
                     longer ones, and method=\"auto\" changes to it",
                    self.name
                ),
                (Policy::Change, true) => format!("at t = {t} s the method changes to radau: {why}"),
                (Policy::Change, false) => format!("at t = {t} s the method changes back to {}: {why}", self.name),
            }
        };
        let mut notes: Vec<String> = self.changes.iter().map(words).collect();
        let rest = self.count as usize - self.changes.len();
        if rest > 0 {
            notes.push(format!("the method changes {rest} times more"));
        }
        notes.extend(self.implicit.notes());
        notes
    }
}

impl StepStorage for Switching {
    fn save(&self, out: &mut Vec<f64>) -> bool {
        out.push(f64::from(u8::from(self.is_stiff)));
        match self.is_stiff {
            true => self.implicit.save(out),
            false => self.explicit.save(out),
        }
    }
    fn save_extra(&self, out: &mut Vec<f64>) {
        match self.is_stiff {
            true => self.implicit.save_extra(out),
            false => self.explicit.save_extra(out),
        }
    }
    fn load(&mut self, ends: (f64, f64), step: &[f64], extra: &[f64]) {
        self.is_stiff = step[0] != 0.0;
        match self.is_stiff {
            true => self.implicit.load(ends, &step[1..], extra),
            false => self.explicit.load(ends, &step[1..], extra),
        }
    }
}

impl<E: Display> Stepper<E> for Switching {
    fn start(&mut self, ode: &mut dyn Ode<Error = E>, t: f64, y: &[f64], t_end: f64) -> Result<(), StepFailure<E>> {
        let started = self.stepper().start(ode, t, y, t_end);
        self.count();
        started
    }
    fn attempt(&mut self, ode: &mut dyn Ode<Error = E>) -> Result<(), StepFailure<E>> {
        match self.is_stiff {
            true => self.watch_implicit(),
            false => self.watch_explicit(ode),
        }
        let attempted = self.stepper().attempt(ode);
        self.count();
        attempted
    }
    fn conclude(&mut self, end: StepEnd<'_, E>) -> Result<Conclusion, StepFailure<E>> {
        let concluded = self.stepper().conclude(end);
        self.count();
        concluded
    }
    fn interpolate(&mut self, ode: &mut dyn Ode<Error = E>, t: f64, out: &mut [f64]) -> Result<(), StepFailure<E>> {
        let found = self.stepper().interpolate(ode, t, out);
        self.count();
        found
    }
}
