//! An explicit method that notices where stiff forces limit its steps: it says so, or leaves the motion to an implicit one and
//! takes it back.

use crate::counters::Counters;
use crate::explicit_rk::ExplicitRungeKutta;
use crate::failure::StepFailure;
use crate::implicit_rk::Radau;
use crate::ode::Ode;
use crate::options::{Options, OptionsError};
use crate::scheme::Taken;
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

/// The method at work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum AtWork {
    Explicit,
    Implicit,
}

/// An explicit method, and the implicit one beside it: without one it is said what that would do.
#[derive(Debug)]
pub(crate) struct Switching {
    name: &'static str,
    explicit: ExplicitRungeKutta,
    implicit: Option<Box<Radau>>,
    at_work: AtWork,
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
    changes: Vec<(f64, AtWork, Stiffness)>,
    count: u64,
    /// Looks and their evaluations.
    looks: Counters,
    counters: Counters,
}

impl Switching {
    /// That stays with its method.
    pub(crate) fn advising(name: &'static str, explicit: ExplicitRungeKutta, dim: usize, options: &Options) -> Self {
        Self {
            name,
            explicit,
            implicit: None,
            at_work: AtWork::Explicit,
            sizes: vec![1.0; dim],
            tolerance: options.rtol,
            linear: LinearRates::default(),
            since: 0,
            due: ADVISES,
            agreed: 0,
            stable: 0,
            known: None,
            changes: Vec::new(),
            count: 0,
            looks: Counters::default(),
            counters: Counters::default(),
        }
    }

    /// That changes to Radau IIA and back.
    pub(crate) fn changing(
        name: &'static str,
        explicit: ExplicitRungeKutta,
        dim: usize,
        options: Options,
    ) -> Result<Self, OptionsError> {
        let advising = Self::advising(name, explicit, dim, &options);
        Ok(Self { implicit: Some(Box::new(Radau::new(dim, options)?)), due: LOOKS, ..advising })
    }

    fn control(&self) -> &dyn StepControl {
        match (self.at_work, &self.implicit) {
            (AtWork::Implicit, Some(implicit)) => &**implicit,
            _ => &self.explicit,
        }
    }

    fn control_mut(&mut self) -> &mut dyn StepControl {
        match (self.at_work, &mut self.implicit) {
            (AtWork::Implicit, Some(implicit)) => &mut **implicit,
            _ => &mut self.explicit,
        }
    }

    fn storage(&mut self) -> &mut dyn StepStorage {
        match (self.at_work, &mut self.implicit) {
            (AtWork::Implicit, Some(implicit)) => &mut **implicit,
            _ => &mut self.explicit,
        }
    }

    fn stored(&self) -> &dyn StepStorage {
        match (self.at_work, &self.implicit) {
            (AtWork::Implicit, Some(implicit)) => &**implicit,
            _ => &self.explicit,
        }
    }

    fn stepper<E: Display>(&mut self) -> &mut dyn Stepper<E> {
        match (self.at_work, &mut self.implicit) {
            (AtWork::Implicit, Some(implicit)) => &mut **implicit,
            _ => &mut self.explicit,
        }
    }

    fn count(&mut self) {
        let implicit = self.implicit.as_ref().map_or(Counters::default(), |x| *x.counters());
        self.counters = *self.explicit.counters() + implicit + self.looks;
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

    fn note(&mut self, t: f64, to: AtWork, found: Stiffness) {
        self.count += 1;
        if self.changes.len() < LISTED {
            self.changes.push((t, to, found));
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
        let Some(implicit) = &mut self.implicit else {
            self.due *= 2;
            if let Some(found) = limited.filter(|_| self.changes.is_empty()) {
                self.note(t, AtWork::Implicit, found);
            }
            return;
        };
        let Some(limited) = limited else {
            let far = found.is_none_or(|found| found.is_far(h));
            (self.agreed, self.due) = (0, if far { RARELY.min(2 * self.due) } else { LOOKS });
            return;
        };
        (self.agreed, self.due) = (self.agreed + 1, LOOKS / 2);
        if self.agreed >= AGREE {
            implicit.adopt(self.explicit.hand_over());
            (self.at_work, self.stable, self.known) = (AtWork::Implicit, 0, None);
            self.note(t, AtWork::Implicit, limited);
        }
    }

    /// Before an implicit step: whether an explicit one would be stable.
    fn watch_implicit(&mut self) {
        let Some(implicit) = &self.implicit else { return };
        let (now, made) = (implicit.current(), implicit.counters().jacobians);
        if self.known.is_none_or(|(known, _)| known != made) {
            let about = (&self.sizes[..], self.tolerance);
            let found = implicit.linear().and_then(|x| Stiffness::of(x, about, now.dy_old, now.next));
            self.known = found.map(|found| (made, found));
        }
        let Some((_, found)) = self.known else { return };
        self.stable = if found.allows(now.next) { self.stable + 1 } else { 0 };
        if self.stable >= STABLE {
            let t = now.t_old;
            self.explicit.adopt(implicit.hand_over());
            (self.at_work, self.since, self.due, self.agreed) = (AtWork::Explicit, 0, LOOKS, 0);
            self.note(t, AtWork::Explicit, found);
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
        self.implicit.iter_mut().for_each(|x| x.set_sizes(sizes));
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
        let words = |(t, to, found): &(f64, AtWork, Stiffness)| {
            let (t, why) = (formatted(*t), found.words());
            match (&self.implicit, to) {
                (None, _) => format!(
                    "at t = {t} s stability, not accuracy, limits the steps of {}: {why}; method=\"radau\" takes \
                     longer ones, and method=\"auto\" changes to it",
                    self.name
                ),
                (Some(_), AtWork::Implicit) => format!("at t = {t} s the method changes to radau: {why}"),
                (Some(_), AtWork::Explicit) => format!("at t = {t} s the method changes back to {}: {why}", self.name),
            }
        };
        let mut notes: Vec<String> = self.changes.iter().map(words).collect();
        let rest = self.count as usize - self.changes.len();
        if rest > 0 {
            notes.push(format!("the method changes {rest} times more"));
        }
        notes.extend(self.implicit.iter().flat_map(|x| x.notes()));
        notes
    }
}

impl StepStorage for Switching {
    fn save(&self, out: &mut Vec<f64>) -> bool {
        out.push(f64::from(u8::from(self.at_work == AtWork::Implicit)));
        self.stored().save(out)
    }
    fn save_extra(&self, out: &mut Vec<f64>) {
        self.stored().save_extra(out);
    }
    fn load(&mut self, ends: (f64, f64), step: &[f64], extra: &[f64]) {
        self.at_work = if step[0] == 0.0 { AtWork::Explicit } else { AtWork::Implicit };
        self.storage().load(ends, &step[1..], extra);
    }
    fn taken(&self) -> Option<Taken> {
        self.stored().taken()
    }
}

impl<E: Display> Stepper<E> for Switching {
    fn start(&mut self, ode: &mut dyn Ode<Error = E>, t: f64, y: &[f64], t_end: f64) -> Result<(), StepFailure<E>> {
        let started = self.stepper().start(ode, t, y, t_end);
        self.count();
        started
    }
    fn attempt(&mut self, ode: &mut dyn Ode<Error = E>) -> Result<(), StepFailure<E>> {
        match self.at_work {
            AtWork::Implicit => self.watch_implicit(),
            AtWork::Explicit => self.watch_explicit(ode),
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
