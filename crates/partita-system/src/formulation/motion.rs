//! The motion in a tangent basis times position coordinates: the one implementation of all forms.
//!
//! ```text
//! y = (position coordinates, u, work),   v = Dᵀ u + γ,   M_d u' = D (h − M δ)                 (F1)
//! ```
//!
//! [`Tangent`] defines the basis and [`Positions`] how q is found; the rest is common to all. Here: evaluations and
//! outputs. `combinations` has the formulations by name, `steps` what is done at the end of a step.

mod checks;
mod combinations;
mod compiled;
mod crossing;
mod linear;
mod prescribed;
mod steps;

pub use combinations::*;

use super::{Depth, Formulation, Layout, LinearRates, Point, Prescribing, Prescription, Purpose, Side, Step, TrialEnd};
use crate::error::Result;
use crate::event::MotionState;
use crate::positions::Positions;
use crate::record::{Crossings, Gaps, History, Output, PartitionEvent, Sample, StepChecks, StepDecision};
use crate::reduction::Reduction;
use crate::singular::consistency::Closure;
use crate::system::{ConstrainedSystem, SystemError, SystemRef};
use crate::tangent::instant::{self, Describer};
use crate::tangent::Tangent;
use crate::watched::{Reading, Watched};
use checks::Checks;
use compiled::CompiledMotion;
use crossing::CrossingMonitor;
use prescribed::Prescribed;

/// Degrees of freedom up to which outputs are described by one M_d for all clusters. Scale: number. Reason: the recursion
/// over clusters, which is made for many, loses digits where loops hold some motions weakly; up to here one M_d costs
/// hardly more.
const DESCRIBED_AS_ONE: usize = 24;

/// The point to which the levels belong.
#[derive(Clone, Copy, Debug, PartialEq)]
enum LevelsOf {
    /// Somewhere: something was evaluated since the end of the step.
    Elsewhere,
    /// As before the last evaluation, which was one by compiled code.
    Behind,
    /// The position level alone at the end of the step, where the next evaluation is.
    Settled,
    /// The end of the step that was judged, at this time.
    End(f64),
    /// The state from which the next step is planned.
    Planning,
}

/// A motion in the tangent T with the position coordinates P.
pub struct Motion<'s, S: ConstrainedSystem + 's, T, P> {
    name: &'static str,
    system: SystemRef<'s, S>,
    k: usize,
    layout: Layout,
    /// Natural sizes of q.
    sizes_of_q: Vec<f64>,
    tangent: T,
    positions: P,
    observes_work: bool,
    describer: Describer<'s, S>,
    /// Margin at the end of the step that was judged.
    margin: Option<(f64, u64)>,
    /// Of the dimensions.
    drawing_errors: (f64, f64),
    levels_of: LevelsOf,
    /// Time of the levels last evaluated.
    levels_at: f64,
    /// Evaluations by compiled code, where there may be any.
    compiled: Option<CompiledMotion>,
    /// Singular positions behind and ahead.
    monitor: CrossingMonitor,
    /// Rows that prescribe a motion.
    prescribed: Prescribed<S>,
    /// Memory for a state ahead and its rates.
    ahead: (Vec<f64>, Vec<f64>),
    /// Constraint violations at the ends of steps.
    closure: Closure,
    /// Other checks of steps and outputs.
    checks: Checks,
    v: Vec<f64>,
    vdot: Vec<f64>,
}

impl<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>, P: Positions<'s, S, T>> Motion<'s, S, T, P> {
    fn with(name: &'static str, tangent: T, positions: P) -> Self {
        let r = tangent.seen();
        let (system, n) = (r.system.clone(), r.size().nv);
        let (k, observes_work) = (tangent.count(), system.structure().has_power || system.structure().rheonomic);
        let prescribed = Prescribed::new(&*system);
        let work = positions.width() + k;
        let beside = work + usize::from(observes_work);
        let layout = Layout {
            sizes: vec![1.0; beside + prescribed.count()],
            // where drives prescribe all motion, their work is the only state
            controlled: work + usize::from(observes_work && k == 0),
            // the work may vary faster than the motion
            observed: (observes_work && k > 0).then_some(work),
            beside,
        };
        Self {
            name,
            k,
            layout,
            sizes_of_q: super::sizes_of_coordinates(&*system),
            describer: Describer::new(system.clone(), r.rank(), r.is_dense() || r.k() <= DESCRIBED_AS_ONE),
            tangent,
            positions,
            observes_work,
            margin: None,
            drawing_errors: system.structure().drawing.errors,
            levels_of: LevelsOf::Elsewhere,
            levels_at: f64::NAN,
            compiled: None,
            monitor: CrossingMonitor::new(system.size()),
            prescribed,
            ahead: (Vec::new(), Vec::new()),
            closure: Closure::default(),
            checks: Checks::default(),
            v: vec![0.0; n],
            vdot: vec![0.0; n],
            system,
        }
    }

    /// Natural sizes of the state as it is now.
    fn measure(&mut self) {
        let (p, w) = self.offsets();
        let out = &mut self.layout.sizes;
        self.positions.sizes(&self.sizes_of_q, &mut out[..p]);
        if self.observes_work {
            out[w] = self.tangent.seen().natural_energy();
        }
        out[p..w].iter_mut().enumerate().for_each(|(j, x)| *x = self.tangent.natural_size(j));
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
    fn offsets(&self) -> (usize, usize) {
        (self.positions.width(), self.positions.width() + self.k)
    }

    fn work(&self, y: &[f64]) -> f64 {
        if self.observes_work {
            y[self.offsets().1]
        } else {
            0.0
        }
    }

    /// All levels at (t, y), with the accelerations in `vdot` if they are known.
    fn levels(&mut self, t: f64, y: &[f64], known: bool) -> Result<()> {
        let (p, w) = self.offsets();
        let settled = std::mem::replace(&mut self.levels_of, LevelsOf::Elsewhere) == LevelsOf::Settled;
        self.levels_at = t;
        let crossing = self.monitor.crosses_next();
        let factored = match settled && !crossing {
            true => false,
            false => self.positions.locate(&mut self.tangent, t, y, crossing)?,
        };
        let (tangent, q, u) = (&mut self.tangent, self.positions.q(), &y[p..w]);
        let levels = |tangent: &mut T| {
            tangent.tangent(t, q, factored)?;
            tangent.spread(u);
            if known {
                return tangent.reduction().accept_acceleration(t, q, &self.vdot);
            }
            tangent.accelerate(t, q, u)
        };
        levels(tangent).map_err(|e| tangent.blame(t, q, e))
    }

    /// Rates of all states at (t, y), the levels evaluated there.
    fn derivative_by_levels(&mut self, t: f64, y: &[f64], dy: &mut [f64]) -> Result<()> {
        self.evaluate(t, y)?;
        self.rates_here(t, y, dy)
    }

    /// Rates of all states at the point last evaluated.
    fn rates_here(&mut self, t: f64, y: &[f64], dy: &mut [f64]) -> Result<()> {
        let (p, w) = self.offsets();
        self.positions.rates(&mut self.tangent, &y[p..w], dy);
        self.tangent.rates(&mut dy[p..w]);
        if self.observes_work {
            dy[w] = self.tangent.power(t, self.positions.q())?;
        }
        if !self.prescribed.is_empty() {
            self.tangent.full_acceleration(&mut self.vdot);
            let beside = self.layout.beside;
            let v = &self.tangent.seen().at.v;
            self.prescribed.rates(&self.system, self.positions.q(), v, &self.vdot, &mut dy[beside..]);
        }
        Ok(())
    }

    /// Whether (t, y) is the end of the step that was judged, its loops closed to round-off and its levels evaluated.
    fn ends_at(&self, t: f64, y: &[f64]) -> bool {
        let q = self.positions.q();
        self.levels_of == LevelsOf::End(t)
            && self.offsets().0 == q.len()
            && *q == y[..q.len()]
            && self.tangent.seen().is_closed()
    }

    /// Whether the levels in use belong to the choice of `within`, with rows that no position would change.
    fn has_levels_of(&self, within: Option<&PartitionEvent>) -> bool {
        let r = self.tangent.seen();
        let serves = r.is_dense() || r.k() > DESCRIBED_AS_ONE;
        serves
            && r.counts.plans > 0
            && r.rank() == r.size().rows
            && self.tangent.independent(within) == Some(&r.planned.partition.independent)
    }
}

impl<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>, P: Positions<'s, S, T>> Point for Motion<'s, S, T, P> {
    fn watched(&self) -> Watched {
        self.system.watched()
    }
    fn evaluate(&mut self, t: f64, y: &[f64]) -> Result<()> {
        self.levels(t, y, false)
    }
    fn state(&mut self, forces_at: Option<f64>, out: &mut MotionState) -> Result<()> {
        out.q.clear();
        out.q.extend_from_slice(self.positions.q());
        self.system.normalise(&mut out.q);
        out.v.clear();
        out.v.extend_from_slice(&self.tangent.seen().at.v);
        out.vdot.resize(self.v.len(), 0.0);
        self.tangent.full_acceleration(&mut out.vdot);
        if let Some(t) = forces_at {
            let r = self.tangent.reduction();
            out.multipliers.resize(r.size().rows, 0.0);
            r.multipliers(t, self.positions.q(), &out.vdot, &mut out.multipliers)?;
        }
        Ok(())
    }
    fn readings(&mut self, t: f64, out: &mut [Reading]) -> f64 {
        let r = self.tangent.reduction();
        r.system.readings(t, self.positions.q(), &r.at.v, &mut r.scratch, out);
        r.fastest()
    }
    fn side(&mut self, t: f64, y: &[f64]) -> Option<Side> {
        self.levels_of = LevelsOf::Elsewhere;
        let found = match self.monitor.judgement {
            Some(_) => self.positions.output(&mut self.tangent, t, y),
            None => self.positions.locate(&mut self.tangent, t, y, self.monitor.crosses_next()),
        };
        self.tangent.tangent(t, self.positions.q(), found.ok()?).ok()?;
        self.side_inside(t)
    }
    fn obstacle(&self, t: f64) -> Option<SystemError> {
        (self.monitor.crossing.tries().0 > 0).then(|| self.not_crossed(t))
    }
    fn prescribing(&self) -> &[usize] {
        &self.prescribed.rows
    }
    fn prescribed(&mut self, at: Prescribing, out: &mut [Prescription]) -> Result<()> {
        self.prescribed.conditions(self.tangent.seen(), at, out)
    }
    fn prescriber(&self, row: usize) -> String {
        self.system.structure().rows[row].owner.to_string()
    }
    fn accept_output(&mut self, at: &Output, within: (f64, f64)) -> Result<bool> {
        self.levels_of = LevelsOf::Elsewhere;
        let r = self.tangent.reduction();
        r.position(at.t, &at.q)?;
        r.at.v.copy_from_slice(&at.v);
        let found = self.output_gaps(at.t);
        let accepted = found.position.part <= within.0 && found.velocity.part <= within.1;
        if accepted {
            self.count_output(at.t, found);
        }
        Ok(accepted)
    }
    fn checks(&self) -> (Gaps, StepChecks) {
        (self.closure.gaps, self.checks.taken)
    }
    fn crossings(&self) -> Crossings {
        self.monitor.crossing.times.clone()
    }
}

impl<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>, P: Positions<'s, S, T>> Formulation for Motion<'s, S, T, P> {
    fn layout(&self) -> &Layout {
        &self.layout
    }
    fn start(&mut self, t: f64, q: &[f64], v: &[f64], y: &mut [f64]) -> Result<()> {
        let (p, w) = self.offsets();
        let mut q = q.to_vec();
        (self.closure.gaps, self.checks.taken) = (Gaps::default(), StepChecks::default());
        self.tangent.start(t, &mut q, v)?;
        y.fill(0.0);
        self.positions.start(&mut self.tangent, t, &q, y);
        self.tangent.select(v, &mut y[p..w]);
        self.prescribed.start(&q, v, &mut y[self.layout.beside..]);
        self.measure();
        Ok(())
    }
    fn rates(&mut self, t: f64, y: &[f64], dy: &mut [f64], depth: Depth) -> Result<()> {
        match depth == Depth::Rates && self.compiled_rates(t, y, dy) {
            true => Ok(()),
            false => self.derivative_by_levels(t, y, dy),
        }
    }
    fn linear_rates(&mut self, t: f64, y: &[f64], out: &mut LinearRates) -> Result<()> {
        self.linear(t, y, out)
    }
    fn trial_end(&mut self, t: f64, y: &mut [f64], dy: &mut [f64], known: bool) -> Result<TrialEnd> {
        self.end(t, y, dy, known)
    }
    fn commit(&mut self, decision: StepDecision, step: &mut Step) -> Result<bool> {
        let rewritten = match decision {
            StepDecision::Begin => self.begin_at(step),
            StepDecision::Repeat => self.repeat(step),
            StepDecision::Keep | StepDecision::Change => self.accept(decision, step),
        }?;
        if rewritten {
            self.measure();
        }
        Ok(rewritten)
    }
    fn state_at(&mut self, t: f64, y: &[f64], purpose: Purpose, out: &mut Output) -> Result<()> {
        let (p, w) = self.offsets();
        let ends = self.ends_at(t, y);
        self.levels_of = LevelsOf::Elsewhere;
        let singular = if ends {
            self.is_singular(self.margin)
        } else {
            let factored = self.positions.output(&mut self.tangent, t, y)?;
            match self.tangent.tangent(t, self.positions.q(), factored) {
                Err(SystemError::Singular { .. }) => true,
                found => {
                    found?;
                    self.is_at_a_singular_position()
                }
            }
        };
        let u = &mut self.v[..w - p];
        u.copy_from_slice(&y[p..w]);
        if self.tangent.integrates_velocities() {
            self.checks.integrated(u);
        }
        self.tangent.settle(t, self.positions.q(), u)?;
        self.tangent.spread(u);
        out.set(t, self.positions.q(), &self.tangent.seen().at.v, self.work(y));
        self.system.normalise(&mut out.q);
        out.choice = self.tangent.base().events().len().saturating_sub(1);
        out.basis = self.tangent.unlisted_basis();
        out.singular = singular;
        if !singular {
            let found = self.output_gaps(t);
            self.count_output(t, found);
        }
        if purpose == Purpose::Keep {
            self.tangent.base_mut().keep_choice();
        }
        Ok(())
    }
    fn describe(&mut self, at: &Output, within: Option<&PartitionEvent>, out: &mut Sample) -> Result<()> {
        if self.has_levels_of(within) {
            // an evaluation like any other: nothing is chosen anew
            self.levels_of = LevelsOf::Elsewhere;
            let choice = self.tangent.seen().planned.partition.independent.clone();
            return instant::describe(self.tangent.reduction(), at, Some(&choice), out).map(drop);
        }
        let r = self.describer.describe(at, self.tangent.independent(within), out)?;
        self.tangent.describe(r, at, within, out)
    }
    fn history(&self) -> History {
        let mut history = History { name: self.name, crossings: self.crossings(), ..History::default() };
        (history.closure_error, history.gaps, history.checks) =
            (self.closure.closure_error, self.closure.gaps, self.checks.taken);
        self.tangent.base().report(&mut history);
        self.tangent.report(&mut history);
        self.positions.report(&mut history);
        if let Some(compiled) = &self.compiled {
            compiled.report(&mut history);
        }
        history
    }
    fn point(&mut self) -> &mut dyn Point {
        self
    }
}
