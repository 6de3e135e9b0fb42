//! The motion in a tangent basis times position coordinates: the one implementation of all forms.
//!
//! ```text
//! y = (position coordinates, u, work),   v = Dᵀ u + γ,   M_d u' = D (h − M δ)                 (F1)
//! ```
//!
//! [`Tangent`] defines the basis and [`Positions`] how q is found; the rest is common to all: a step is tried, judged,
//! accepted, its choice renewed, singular positions crossed, outputs closed.

mod checks;
mod crossing;
mod prescribed;

use super::{Formulation, Step, Verdict};
use crate::breakpoints::Watched;
use crate::equations::full::AccelerationRule;
use crate::error::Result;
use crate::formulation::FormulationSteps;
use crate::guards::{GuardMonitor, Look};
use crate::options::FormulationOptions;
use crate::positions::all::All;
use crate::positions::chart::Chart;
use crate::positions::independent::Independent;
use crate::positions::inverse_kinematics::InverseKinematics;
use crate::positions::newton::Newton;
use crate::positions::{needs_positions, Positions};
use crate::record::{Gaps, History, Output, PartitionEvent, Sample, StepChecks};
use crate::reduction::Reduction;
use crate::singular::consistency::Watch;
use crate::system::{ConstrainedSystem, SystemError, SystemRef};
use crate::tangent::all::Everything;
use crate::tangent::basis::{Basis, Rule};
use crate::tangent::blocks::Blocks;
use crate::tangent::frozen::Frozen;
use crate::tangent::instant::{self, Describer};
use crate::tangent::partition::Chosen;
use crate::tangent::user::Given;
use crate::tangent::TangentLevels;
use crate::tangent::{Occasion, Tangent};
use checks::Checks;
use crossing::CrossingMonitor;
use partita_math::tolerance;
use prescribed::Prescribed;

/// A motion in the tangent T with the position coordinates P.
pub struct Motion<'s, S: ConstrainedSystem + 's, T, P> {
    name: &'static str,
    system: SystemRef<'s, S>,
    k: usize,
    tangent: T,
    positions: P,
    observes_work: bool,
    describer: Describer<'s, S>,
    /// Margin at the end of the step that was judged.
    margin: Option<(f64, u64)>,
    /// Whether anything was evaluated since.
    moved: bool,
    /// Singular positions behind and ahead.
    monitor: CrossingMonitor,
    /// Breakpoints of curves along the motion.
    breakpoints: Watched,
    /// Rows that prescribe a motion, compared with their derivatives.
    prescribed: Prescribed<S>,
    /// Functions of the state that no step crosses unseen.
    guards: GuardMonitor,
    /// Whether the current evaluation is the dense output at which guards are read.
    looking: bool,
    /// Memory for a state ahead and its rates.
    ahead: (Vec<f64>, Vec<f64>),
    /// Constraint violations at the ends of steps.
    watch: Watch,
    /// Other checks of steps and outputs.
    checks: Checks,
    v: Vec<f64>,
    vdot: Vec<f64>,
}

/// A partition and all coordinates (k + nq states): `projective`, and with an infinite threshold `fixed`.
pub type Projective<'s, S> = Motion<'s, S, Chosen<'s, S>, All>;
/// A partition and its coordinates, the others by Newton's method (2k states).
pub type WehageHaug<'s, S> = Motion<'s, S, Chosen<'s, S>, Independent<Newton>>;
/// Blocks and their inputs, the loops closed by inverse kinematics (2k states).
pub type ExplicitClosing<'s, S> = Motion<'s, S, Blocks<'s, S>, Independent<InverseKinematics>>;
/// A frozen basis and all coordinates.
pub type TangentVelocities<'s, S> = Motion<'s, S, Frozen<'s, S>, All>;
/// A frozen basis and a chart of the closed positions (2k states).
pub type TangentSpace<'s, S> = Motion<'s, S, Frozen<'s, S>, Chart>;
/// The user's basis and all coordinates.
pub type UserTangent<'s, S> = Motion<'s, S, Given<'s, S>, All>;
/// All coordinates and all velocities, by the rule R.
pub type FullState<'s, S, R> = Motion<'s, S, Everything<'s, S, R>, All>;

impl<'s, S: ConstrainedSystem> Projective<'s, S> {
    /// For a system of the given rank (see [`crate::start::analyse`]).
    pub fn new(system: impl Into<SystemRef<'s, S>>, rank: usize, options: &FormulationOptions) -> Self {
        let system = system.into();
        let name = if options.switch_threshold.is_finite() { "projective" } else { "fixed" };
        let positions = All::new(system.size(), options.correction);
        Self::with(name, Chosen::new(system, rank, options), positions)
    }
}

impl<'s, S: ConstrainedSystem> WehageHaug<'s, S> {
    /// For a system of the given rank. There must be no nonholonomic rows. No corrections are needed.
    pub fn new(system: impl Into<SystemRef<'s, S>>, rank: usize, options: &FormulationOptions) -> Result<Self> {
        let system = system.into();
        needs_positions(&*system, "wehage-haug", "integrates as many coordinates as velocities")?;
        let positions = Independent::new(&*system, rank, Newton::default());
        Ok(Self::with("wehage-haug", Chosen::new(system, rank, options), positions))
    }
}

impl<'s, S: ConstrainedSystem> ExplicitClosing<'s, S> {
    /// For a system of the given rank. There must be no nonholonomic rows.
    pub fn new(system: impl Into<SystemRef<'s, S>>, rank: usize, options: &FormulationOptions) -> Result<Self> {
        let system = system.into();
        needs_positions(&*system, "explicit-closing", "computes dependent coordinates from independent ones")?;
        let positions = Independent::new(&*system, rank, InverseKinematics::default());
        Ok(Self::with("explicit-closing", Blocks::new(system, rank, options)?, positions))
    }
}

impl<'s, S: ConstrainedSystem> TangentVelocities<'s, S> {
    /// For a system of the given rank, with S from a rule.
    pub fn new(
        system: impl Into<SystemRef<'s, S>>,
        rank: usize,
        basis: Box<dyn Basis>,
        options: &FormulationOptions,
    ) -> Self {
        let system = system.into();
        let (name, positions) = (basis.name(), All::new(system.size(), options.correction));
        Self::with(name, Frozen::new(system, rank, basis, options.renew), positions)
    }
}

impl<'s, S: ConstrainedSystem> TangentSpace<'s, S> {
    /// For a system of the given rank without nonholonomic rows.
    pub fn new(system: impl Into<SystemRef<'s, S>>, rank: usize, options: &FormulationOptions) -> Result<Self> {
        let system = system.into();
        needs_positions(&*system, "tangent-space", "parametrises closed positions")?;
        let positions = Chart::new(&*system, rank, options.renew)?;
        Ok(Self::with(
            "tangent-space",
            Frozen::new(system, rank, Box::new(Rule::GramSchmidt), options.renew),
            positions,
        ))
    }
}

impl<'s, S: ConstrainedSystem> UserTangent<'s, S> {
    /// For a system of the given rank; needs the user's tangent velocities in the options. Their functions may count
    /// whole turns.
    pub fn new(system: impl Into<SystemRef<'s, S>>, rank: usize, options: &FormulationOptions) -> Result<Self> {
        let system = system.into();
        let Some(map) = &options.tangent else {
            let message =
                "user-tangent needs tangent velocities: give tangent=, the matrix D^T as a function of (t, q)";
            return Err(SystemError::argument("tangent", message.into()));
        };
        let positions = All::new(system.size(), options.correction).whole_turns();
        Ok(Self::with("user-tangent", Given::new(system, rank, map.clone()), positions))
    }
}

impl<'s, S: ConstrainedSystem, R: AccelerationRule> FullState<'s, S, R> {
    /// For a system of the given rank, with v' and λ from a rule.
    pub fn new(system: impl Into<SystemRef<'s, S>>, rank: usize, rule: R, options: &FormulationOptions) -> Self {
        let name = rule.name();
        let tangent = Everything::new(system, rank, rule, options);
        let positions = All::new(tangent.seen().size(), tangent.correction);
        Self::with(name, tangent, positions)
    }
}

impl<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>, P: Positions<'s, S, T>> Motion<'s, S, T, P> {
    fn with(name: &'static str, tangent: T, positions: P) -> Self {
        let r = tangent.seen();
        let (system, n) = (r.system.clone(), r.size().nv);
        Self {
            name,
            k: tangent.count(),
            describer: Describer::new(system.clone(), r.rank(), r.is_dense()),
            tangent,
            positions,
            observes_work: system.has_power() || system.rheonomic(),
            margin: None,
            moved: true,
            monitor: CrossingMonitor::new(system.size()),
            breakpoints: Watched::new(system.breakpoints()),
            prescribed: Prescribed::new(&*system),
            guards: GuardMonitor::new(system.guards()),
            looking: false,
            ahead: (Vec::new(), Vec::new()),
            watch: Watch::default(),
            checks: Checks::default(),
            v: vec![0.0; n],
            vdot: vec![0.0; n],
            system,
        }
    }

    /// The tangent, at the point last evaluated.
    pub fn tangent(&mut self) -> &mut T {
        &mut self.tangent
    }

    /// The levels of the tangent, at the point last evaluated.
    pub fn reduction(&mut self) -> &mut Reduction<'s, S> {
        self.tangent.reduction()
    }

    /// The position last found.
    pub fn position(&self) -> &[f64] {
        self.positions.q()
    }

    /// Index of u and of the work in y.
    fn places(&self) -> (usize, usize) {
        (self.positions.places(), self.positions.places() + self.k)
    }

    fn work(&self, y: &[f64]) -> f64 {
        if self.observes_work {
            y[self.places().1]
        } else {
            0.0
        }
    }

    /// All levels at (t, y).
    fn evaluate(&mut self, t: f64, y: &[f64]) -> Result<()> {
        let (p, w) = self.places();
        let factored = self.positions.locate(&mut self.tangent, t, y, self.monitor.crosses_next)?;
        let (tangent, q, u) = (&mut self.tangent, self.positions.q(), &y[p..w]);
        let levels = |tangent: &mut T| {
            tangent.tangent(t, q, factored)?;
            tangent.spread(u);
            tangent.accelerate(t, q, u)
        };
        levels(tangent).map_err(|e| tangent.blame(t, q, e))
    }

    /// Rates of all states at the point last evaluated.
    fn rates(&mut self, t: f64, y: &[f64], dy: &mut [f64]) -> Result<()> {
        let (p, w) = self.places();
        self.positions.rates(&mut self.tangent, &y[p..w], dy);
        self.tangent.rates(&mut dy[p..w]);
        if self.observes_work {
            dy[w] = self.power(t)?;
        }
        if !self.prescribed.is_empty() {
            self.tangent.full_acceleration(&mut self.vdot);
            let beside = self.place_of_prescribed();
            let v = &self.tangent.seen().v;
            self.prescribed.rates(&self.system, self.positions.q(), v, &self.vdot, &mut dy[beside..]);
        }
        Ok(())
    }

    /// dE/dt that is not the work of conservative forces: applied power and, for driven constraints, −λᵀa.
    fn power(&mut self, t: f64) -> Result<f64> {
        let q = self.positions.q();
        let r = self.tangent.reduction();
        let applied = r.system.power(t, q, &r.v, &mut r.scratch)?;
        Ok(applied + if self.system.rheonomic() { self.tangent.driving(t, q)? } else { 0.0 })
    }

    /// Accept or reject the step, and choose anew where required.
    fn conclude(&mut self, verdict: Verdict, step: &mut Step) -> Result<bool> {
        let t = step.t;
        if verdict == Verdict::Repeat {
            let failed = self.monitor.crosses_next && !self.monitor.judged;
            if self.monitor.lost || failed {
                return self.cross_again(step);
            }
            self.monitor.judged = false;
            let serving = self.monitor.serving.take();
            if self.monitor.spoilt {
                self.monitor.spoilt_in_a_row += 1;
            }
            if self.monitor.spoilt && serving.is_none() {
                let (half_t, half) = self.half_way();
                let singular = SystemError::Singular { t: half_t, pivot: 0.0, limit: tolerance::SINGULAR_PIVOT };
                // a fixed choice has no alternative
                if let e @ SystemError::DeadPoint { .. } = self.tangent.blame(half_t, &half, singular) {
                    return Err(e);
                }
            }
            self.evaluate(t, step.y)?;
            if let Some(e) = self.positions.failure(&mut self.tangent, t) {
                return Err(e);
            }
            match serving {
                // where they do not serve at the start of the step it is repeated with a shorter one
                Some(rows) => drop(self.tangent.reduction().keep_rows(t, &rows)),
                None => drop(self.choose_anew(t, step.y, step.dy, Occasion::Spoilt)?),
            }
            self.derivative(t, step.y, step.dy)?;
            self.tangent.seen().sides(&mut self.monitor.sides);
            if let (Some(zero), Some(pace)) = (self.monitor.crossing.zero(), step.pace.as_deref_mut()) {
                self.monitor.crossing.cross(zero, pace);
            }
            return Ok(true);
        }
        self.watch.accept();
        self.checks.accept();
        self.monitor.spoilt_in_a_row = 0;
        if self.moved && (verdict == Verdict::Change || self.tangent.attends()) {
            self.evaluate(t, step.y)?; // outputs were evaluated since
        }
        let why = self.positions.wants_change().map_or(Occasion::Decayed, Occasion::Positions);
        self.positions.accept(&mut self.tangent, t, self.margin.map(|m| m.0));
        let beside = self.place_of_prescribed();
        self.prescribed.accept(&mut step.y[beside..]);
        let mut rewritten = !self.prescribed.is_empty();
        rewritten |= verdict == Verdict::Change && self.choose_anew(t, step.y, step.dy, why)?;
        self.tangent.accept(t, self.positions.q())?;
        let taken = (t, self.monitor.length().unwrap_or(0.0));
        if self.monitor.crossing.crossed(taken, self.flip(t, step.located)) {
            self.monitor.checkpoints.clear();
        }
        self.begin();
        rewritten |= self.positions.wrap(&self.tangent, step.y, step.turns);
        rewritten |= self.plan_ahead(step)?;
        Ok(rewritten)
    }

    /// Whether the levels in use belong to the choice of `within`, with rows that no position would change.
    fn has_levels_of(&self, within: Option<&PartitionEvent>) -> bool {
        let r = self.tangent.seen();
        r.plans > 0 && r.rank() == r.size().rows && self.tangent.independent(within) == Some(&r.partition.independent)
    }

    /// A new choice at the point last evaluated; (q, v, v') stay the same. True if y and y' were rewritten.
    fn choose_anew(&mut self, t: f64, y: &mut [f64], dy: &mut [f64], why: Occasion) -> Result<bool> {
        let (p, w) = self.places();
        self.v.copy_from_slice(&self.tangent.seen().v);
        self.tangent.full_acceleration(&mut self.vdot);
        let mut q = self.positions.q().to_vec();
        if !self.tangent.renew(t, &mut q, &self.v, why)? {
            return Ok(false);
        }
        self.positions.rewrite(&mut self.tangent, &q, y);
        self.tangent.select(&self.v, &mut y[p..w]);
        self.tangent.select(&self.vdot, &mut dy[p..w]); // S δ = 0
        self.tangent.reduction().v.copy_from_slice(&self.v);
        self.positions.rates(&mut self.tangent, &y[p..w], dy);
        Ok(true)
    }
}

impl<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>, P: Positions<'s, S, T>> FormulationSteps
    for Motion<'s, S, T, P>
{
    fn trial_end(&mut self, t: f64, y: &mut [f64], dy: &mut [f64], known: bool) -> Result<(Verdict, bool)> {
        self.looking = false;
        let (p, w) = self.places();
        if !self.prescribed.is_empty() {
            let beside = self.place_of_prescribed();
            self.prescribed.look(self.tangent.seen(), t, &y[beside..], self.positions.q())?;
        }
        let mut evaluates = self.positions.settle(&mut self.tangent, t, y)? || !known;
        let (of_q, rest) = y.split_at_mut(p);
        if self.tangent.integrates_velocities() {
            self.checks.integrated(&rest[..w - p]);
        }
        evaluates |= self.tangent.settle(t, of_q, &mut rest[..w - p])?;
        if evaluates {
            self.derivative(t, y, dy)?;
        }
        self.moved = false;
        self.prescribed.look_at_end(self.tangent.seen(), self.positions.q());
        self.watch.look(t, self.tangent.seen());
        self.watch.check(t, self.positions.q(), self.tangent.seen())?;
        self.margin = self.tangent.margin();
        self.look_back(t);
        self.check_step(t);
        if self.monitor.jumped {
            return Err(SystemError::Crossing { t, tries: self.monitor.crossing.tries() });
        }
        if self.monitor.lost || self.monitor.spoilt {
            return Ok((Verdict::Repeat, evaluates));
        }
        let mut verdict = self.positions.judge(&mut self.tangent, t, self.margin.map(|m| m.0));
        if verdict == Verdict::Keep {
            verdict = self.tangent.judge(t, self.positions.q());
        }
        if verdict == Verdict::Keep {
            verdict = match (self.positions.wants_change(), self.positions.is_stuck()) {
                (Some(_), _) => Verdict::Change,
                (None, true) => Verdict::Repeat,
                (None, false) => Verdict::Keep,
            };
        }
        Ok((verdict, evaluates))
    }
    fn breakpoint_within(&self, tolerance: f64) -> Option<f64> {
        // one that crosses a singular position has its place and length from there
        (!self.monitor.crosses_next).then(|| self.breakpoints.within(tolerance))?
    }
    fn breakpoint_ahead(&self, h: f64, tolerance: f64) -> Option<f64> {
        (!self.monitor.crosses_next).then(|| self.breakpoints.ahead(h, tolerance))?
    }
    fn guard(&mut self, tolerance: f64, may_end: bool) -> Look {
        let look = self.guards.look(tolerance);
        self.looking = matches!(look, Look::At(_));
        match look {
            // one that crosses a singular position has its place and length from there
            Look::Crossed { t, guard, hidden } if !may_end || self.monitor.crosses_next => {
                if hidden {
                    self.checks.hidden(t, guard);
                }
                Look::Clear
            }
            _ => look,
        }
    }
    fn look_at(&mut self, t: f64, y: &[f64]) -> Result<()> {
        (self.moved, self.looking) = (true, false);
        self.evaluate(t, y)?;
        let r = self.tangent.reduction();
        let (q, fastest) = (self.positions.q(), r.fastest());
        self.guards.inside(t, fastest, |out| r.system.guard_readings(t, q, &r.v, &mut r.scratch, out));
        Ok(())
    }
    fn commit(&mut self, verdict: Verdict, step: &mut Step) -> Result<bool> {
        self.conclude(verdict, step)
    }
    fn crossings(&self) -> Vec<f64> {
        self.monitor.crossing.times.clone()
    }
    fn gaps(&self) -> Gaps {
        self.watch.gaps
    }
    fn checks(&self) -> StepChecks {
        self.checks.taken
    }
    fn forget_gaps(&mut self) {
        self.watch.gaps = Gaps::default();
        self.checks.forget();
    }
    fn margin(&self) -> Option<f64> {
        self.margin.map(|m| m.0)
    }
    fn history(&self) -> History {
        let mut history = History { name: self.name, crossings: self.crossings(), ..History::default() };
        (history.open, history.gaps, history.checks) = (self.watch.open, self.watch.gaps, self.checks.taken);
        self.tangent.base().report(&mut history);
        self.tangent.report(&mut history);
        self.positions.report(&mut history);
        history.notes.extend(self.guards.notes());
        history
    }
}

impl<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>, P: Positions<'s, S, T>> Formulation for Motion<'s, S, T, P> {
    fn set_out(&mut self, step: &mut Step) -> Result<()> {
        self.evaluate(step.t, step.y)?;
        self.margin = self.tangent.margin();
        self.look_back(step.t);
        self.begin();
        self.plan_ahead(step).map(drop)
    }
    fn side(&mut self, t: f64, y: &[f64]) -> Option<f64> {
        self.moved = true;
        let factored = self.positions.locate(&mut self.tangent, t, y, self.monitor.crosses_next).ok()?;
        self.tangent.tangent(t, self.positions.q(), factored).ok()?;
        let (distance, _) = self.tangent.margin()?;
        self.monitor.side(self.tangent.seen()).map(|side| side * distance)
    }
    fn dim(&self) -> usize {
        self.place_of_prescribed() + self.prescribed.count()
    }
    /// Where drives prescribe all motion, their work is what there is to integrate.
    fn controlled(&self) -> usize {
        self.places().1 + usize::from(self.observes_work && self.k == 0)
    }
    fn natural_sizes(&self, out: &mut [f64]) {
        out.fill(1.0);
        let (p, w) = self.places();
        let mut of_q = vec![1.0; self.system.size().nq];
        super::sizes_of_coordinates(&*self.system, &mut of_q);
        self.positions.sizes(&of_q, &mut out[..p]);
        if self.observes_work {
            out[w] = self.tangent.seen().natural_energy();
        }
        out[p..w].iter_mut().enumerate().for_each(|(j, x)| *x = self.tangent.natural_size(j));
    }
    fn start(&mut self, t: f64, q: &[f64], v: &[f64], y: &mut [f64]) -> Result<()> {
        let (p, w) = self.places();
        let mut q = q.to_vec();
        self.tangent.start(t, &mut q, v)?;
        self.guards.forget();
        y.fill(0.0);
        self.positions.start(&mut self.tangent, t, &q, y);
        self.tangent.select(v, &mut y[p..w]);
        let beside = self.place_of_prescribed();
        self.prescribed.start(&q, v, &mut y[beside..]);
        self.prescribed.open_at_start(&self.system, t, &y[beside..], (&q, v))
    }
    fn derivative(&mut self, t: f64, y: &[f64], dy: &mut [f64]) -> Result<()> {
        self.moved = true;
        self.evaluate(t, y)?;
        if self.guards.waits() {
            let r = self.tangent.reduction();
            let out = self.guards.start(t, r.fastest());
            r.system.guard_readings(t, self.positions.q(), &r.v, &mut r.scratch, out);
        } else if self.looking {
            let (r, q) = (self.tangent.reduction(), self.positions.q());
            self.guards.beside(t, |out| r.system.guard_readings(t, q, &r.v, &mut r.scratch, out));
        }
        self.rates(t, y, dy)
    }
    fn state_at(&mut self, t: f64, y: &[f64], out: &mut Output) -> Result<()> {
        let (p, w) = self.places();
        self.moved = true;
        let factored = self.positions.output(&mut self.tangent, t, y)?;
        let singular = match self.tangent.tangent(t, self.positions.q(), factored) {
            Err(SystemError::Singular { .. }) => true,
            found => {
                found?;
                self.is_at_a_singular_position()
            }
        };
        let u = &mut self.v[..w - p];
        u.copy_from_slice(&y[p..w]);
        if self.tangent.integrates_velocities() {
            self.checks.integrated(u);
        }
        self.tangent.settle(t, self.positions.q(), u)?;
        self.tangent.spread(u);
        out.set(t, self.positions.q(), &self.tangent.seen().v, self.work(y));
        self.system.normalise(&mut out.q);
        out.choice = self.tangent.base().events().len().saturating_sub(1);
        out.singular = singular;
        if !singular {
            self.check_output(t);
        }
        Ok(())
    }
    fn describe(&mut self, at: &Output, within: Option<&PartitionEvent>, out: &mut Sample) -> Result<()> {
        if self.has_levels_of(within) {
            // an evaluation like any other: nothing is chosen anew
            self.moved = true;
            let choice = self.tangent.seen().partition.independent.clone();
            return instant::describe(self.tangent.reduction(), at, Some(&choice), out).map(drop);
        }
        let r = self.describer.describe(at, self.tangent.independent(within), out)?;
        self.tangent.describe(r, within, out)
    }
}
