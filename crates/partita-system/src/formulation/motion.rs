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
mod prescribed;
mod steps;

pub use combinations::*;

use super::{Formulation, Side, Step};
use crate::breakpoints::Watched;
use crate::error::Result;
use crate::guards::GuardMonitor;
use crate::positions::Positions;
use crate::record::{Output, PartitionEvent, Sample};
use crate::reduction::Reduction;
use crate::singular::consistency::Watch;
use crate::system::{ConstrainedSystem, SystemError, SystemRef};
use crate::tangent::instant::{self, Describer};
use crate::tangent::Tangent;
use checks::Checks;
use compiled::CompiledMotion;
use crossing::CrossingMonitor;
use prescribed::Prescribed;

/// Degrees of freedom up to which outputs are described by one M_d for all clusters. Scale: number. Reason: the recursion
/// over clusters, which is made for many, loses digits where loops hold some motions weakly; up to here one M_d costs
/// hardly more.
const DESCRIBED_AS_ONE: usize = 24;

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
    /// Of the dimensions.
    drawing_errors: (f64, f64),
    /// Whether anything was evaluated since.
    moved: bool,
    /// Time of the levels last evaluated.
    levels_at: f64,
    /// Whether the point last evaluated is the state from which the next step is planned.
    planned_from: bool,
    /// Whether the last evaluation was one by compiled code, which leaves the levels where they were.
    behind: bool,
    /// Whether the position level was evaluated at the end of the step, where the next evaluation is.
    settled: bool,
    /// Evaluations by compiled code, where there may be any.
    compiled: Option<CompiledMotion>,
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

impl<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>, P: Positions<'s, S, T>> Motion<'s, S, T, P> {
    fn with(name: &'static str, tangent: T, positions: P) -> Self {
        let r = tangent.seen();
        let (system, n) = (r.system.clone(), r.size().nv);
        Self {
            name,
            k: tangent.count(),
            describer: Describer::new(system.clone(), r.rank(), r.is_dense() || r.k() <= DESCRIBED_AS_ONE),
            tangent,
            positions,
            observes_work: system.structure().has_power || system.structure().rheonomic,
            margin: None,
            drawing_errors: system.structure().drawing.errors,
            moved: true,
            levels_at: f64::NAN,
            planned_from: false,
            behind: false,
            settled: false,
            compiled: None,
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

    /// All levels at (t, y).
    fn evaluate(&mut self, t: f64, y: &[f64]) -> Result<()> {
        self.levels(t, y, false)
    }

    /// All levels at (t, y), with the accelerations in `vdot` if they are known.
    fn levels(&mut self, t: f64, y: &[f64], known: bool) -> Result<()> {
        (self.behind, self.levels_at) = (false, t);
        let (p, w) = self.offsets();
        let factored = match std::mem::take(&mut self.settled) && !self.monitor.crosses_next {
            true => false,
            false => self.positions.locate(&mut self.tangent, t, y, self.monitor.crosses_next)?,
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

    /// Rates of all states at the point last evaluated.
    fn rates(&mut self, t: f64, y: &[f64], dy: &mut [f64]) -> Result<()> {
        let (p, w) = self.offsets();
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
        Ok(applied + if self.system.structure().rheonomic { self.tangent.driving(t, q)? } else { 0.0 })
    }

    /// Whether (t, y) is the end of the step that was judged, its loops closed to round-off and its levels evaluated.
    fn ends_at(&self, t: f64, y: &[f64]) -> bool {
        let q = self.positions.q();
        !self.moved
            && !self.behind
            && self.levels_at == t
            && self.offsets().0 == q.len()
            && *q == y[..q.len()]
            && self.tangent.seen().is_closed()
    }

    /// Whether the levels in use belong to the choice of `within`, with rows that no position would change.
    fn has_levels_of(&self, within: Option<&PartitionEvent>) -> bool {
        let r = self.tangent.seen();
        let serves = r.is_dense() || r.k() > DESCRIBED_AS_ONE;
        serves
            && r.plans > 0
            && r.rank() == r.size().rows
            && self.tangent.independent(within) == Some(&r.partition.independent)
    }
}

impl<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>, P: Positions<'s, S, T>> Formulation for Motion<'s, S, T, P> {
    fn set_out(&mut self, step: &mut Step) -> Result<()> {
        self.evaluate(step.t, step.y)?;
        self.margin = self.tangent.margin();
        self.look_back(step.t);
        self.begin();
        // what acts may have changed: no way leads back
        self.monitor.checkpoints.clear();
        self.planned_from = true;
        let planned = self.plan_ahead(step).map(drop);
        self.planned_from = false;
        planned
    }
    fn side(&mut self, t: f64, y: &[f64]) -> Option<Side> {
        self.moved = true;
        let found = match self.monitor.judged {
            true => self.positions.output(&mut self.tangent, t, y),
            false => self.positions.locate(&mut self.tangent, t, y, self.monitor.crosses_next),
        };
        self.tangent.tangent(t, self.positions.q(), found.ok()?).ok()?;
        self.side_inside(t)
    }
    fn dim(&self) -> usize {
        self.place_of_prescribed() + self.prescribed.count()
    }
    /// Where drives prescribe all motion, their work is the only state.
    fn controlled(&self) -> usize {
        self.offsets().1 + usize::from(self.observes_work && self.k == 0)
    }
    /// The work, which may vary faster than the motion.
    fn observed(&self) -> Option<usize> {
        (self.observes_work && self.k > 0).then(|| self.offsets().1)
    }
    fn natural_sizes(&self, out: &mut [f64]) {
        out.fill(1.0);
        let (p, w) = self.offsets();
        let mut of_q = vec![1.0; self.system.size().nq];
        super::sizes_of_coordinates(&*self.system, &mut of_q);
        self.positions.sizes(&of_q, &mut out[..p]);
        if self.observes_work {
            out[w] = self.tangent.seen().natural_energy();
        }
        out[p..w].iter_mut().enumerate().for_each(|(j, x)| *x = self.tangent.natural_size(j));
    }
    fn start(&mut self, t: f64, q: &[f64], v: &[f64], y: &mut [f64]) -> Result<()> {
        let (p, w) = self.offsets();
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
        match self.compiled_rates(t, y, dy) {
            true => {
                self.moved = true;
                Ok(())
            }
            false => self.derivative_by_levels(t, y, dy),
        }
    }
    fn state_at(&mut self, t: f64, y: &[f64], out: &mut Output) -> Result<()> {
        let (p, w) = self.offsets();
        let ends = self.ends_at(t, y);
        self.moved = true;
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
        out.set(t, self.positions.q(), &self.tangent.seen().v, self.work(y));
        self.system.normalise(&mut out.q);
        out.choice = self.tangent.base().events().len().saturating_sub(1);
        out.basis = self.tangent.unlisted_basis();
        out.singular = singular;
        if !singular {
            let found = self.output_gaps(t);
            self.count_output(t, found);
        }
        Ok(())
    }
    fn keep_choice(&mut self) {
        self.tangent.base_mut().keep_choice();
    }
    fn accept_output(&mut self, at: &Output, within: (f64, f64)) -> Result<bool> {
        self.moved = true;
        let r = self.tangent.reduction();
        r.position(at.t, &at.q)?;
        r.v.copy_from_slice(&at.v);
        let found = self.output_gaps(at.t);
        let accepted = found.position.part <= within.0 && found.velocity.part <= within.1;
        if accepted {
            self.count_output(at.t, found);
        }
        Ok(accepted)
    }
    fn describe(&mut self, at: &Output, within: Option<&PartitionEvent>, out: &mut Sample) -> Result<()> {
        if self.has_levels_of(within) {
            // an evaluation like any other: nothing is chosen anew
            self.moved = true;
            let choice = self.tangent.seen().partition.independent.clone();
            return instant::describe(self.tangent.reduction(), at, Some(&choice), out).map(drop);
        }
        let r = self.describer.describe(at, self.tangent.independent(within), out)?;
        self.tangent.describe(r, at, within, out)
    }
}
