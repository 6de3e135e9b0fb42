//! Balances by which a motion is checked: of energy over its outputs, of forces and moments on every body.

use super::cost::{self, ClosedState, Contender};
use super::prepared::Motions;
use super::verdict::Finding;
use super::{Request, Run};
use crate::error::AnalysisError;
use crate::outputs::{self, States};
use crate::{plausibility, poses};
use partita_integrate::simulate::Observe;
use partita_math::tolerance;
use partita_model::spec::{Body, Spec};
use partita_model::Model;
use partita_system::equations::{derivatives, Equations, UserSystem};
use partita_system::error::six_digits;
use partita_system::options::TangentMap;
use partita_system::positions::turns;
use partita_system::record::{Output, Sample};
use partita_system::system::Levels;
use partita_system::SystemError;
use std::ops::ControlFlow;
use std::sync::Arc;

/// The Newton-Euler residual that invalidates a run. Scale: fraction of the largest force. Reason: no digit is safe
/// there.
const NO_BALANCE: f64 = 1e-3;
/// Energy errors that rounding explains. Scale: fraction of the energy exchanged. Reason: the steps of a run, also past
/// singular positions.
const ENERGY_FLOOR: f64 = 1e-8;
/// Energy errors that no tolerance, however loose, and no fixed step excuses. Scale: fraction of the energy exchanged.
/// Reason: a twentieth is visible in every figure.
const ENERGY_TAKEN: f64 = 5e-2;
/// Energy errors that invalidate a run; with loose tolerances, ten times what these explain. Scale: fraction of the
/// energy exchanged. Reason: a hundredth is no longer an error of rounding or of steps.
const ENERGY_INVALID: f64 = 1e-2;
/// Number of outputs at which the end of a run evaluates energies: enough to show the energy exchanged and its error,
/// and few enough to cost little.
const LOOKS: usize = 16;

/// A system whose motions can be checked by more than its constraints.
pub trait Balance: Motions {
    /// Newton-Euler residual of the worst body over the largest force; none where there are no bodies.
    ///
    /// # Errors
    /// Errors of user functions.
    fn residual(&self, at: &Sample, scratch: &mut Self::Scratch) -> Result<Option<f64>, SystemError>;
    /// Kinetic and potential energy at some outputs; none where no potential is known.
    ///
    /// # Errors
    /// Errors of user functions.
    fn energies(&self, at: &[&Output], scratch: &mut Self::Scratch) -> Result<Option<Vec<(f64, f64)>>, SystemError>;
    /// Potential, at all outputs of a run, of what does work inside it; empty where there is nothing of the kind.
    ///
    /// # Errors
    /// Where an output cannot be evaluated.
    fn counted_potential(&self, _at: &[Output]) -> Result<Vec<f64>, AnalysisError> {
        Ok(Vec::new())
    }
    /// Smallest reference energy of a balance, for this absolute tolerance.
    fn energy_floor(&self, atol: f64) -> f64;
    /// Whether user functions agree with their derivatives at (t, q, v), as far as this is to be checked.
    ///
    /// # Errors
    /// `Derivative`, and errors of the functions.
    fn agree(&self, t: f64, q: &[f64], v: &[f64]) -> Result<(), SystemError>;
    /// The cause of an error, where the whole system reveals more than its equations.
    fn cause(&self, _error: &SystemError) -> Option<String> {
        None
    }
    /// The reason why a motion that stopped at t cannot continue to `until` as driven, from a closed position shortly
    /// before and its time.
    fn driven_beyond(&self, _from: (f64, &[f64]), _t: f64, _until: f64) -> Option<String> {
        None
    }
    /// A run. See [`run`](super::run()).
    ///
    /// # Errors
    /// See [`run`](super::run()).
    fn integrated(
        &self,
        request: &Request,
        tangent: Option<Arc<dyn TangentMap>>,
        t_eval: &[f64],
        state: (&[f64], &[f64]),
        observe: Option<Observe>,
        watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Run, AnalysisError>
    where
        Self::Scratch: Send;
    /// Seconds of one evaluation of each contender. See [`evaluation_costs`](super::cost::evaluation_costs).
    ///
    /// # Errors
    /// See [`evaluation_costs`](super::cost::evaluation_costs).
    fn timed(
        &self,
        contenders: &[Contender],
        states: &[ClosedState],
        watch: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Option<Vec<f64>>, AnalysisError>
    where
        Self::Scratch: Send;
}

/// Runs of the system of the `impl` in which this stands: compiled once for it, as the methods of [`Motions`] are.
macro_rules! runs_compiled_here {
    () => {
        fn integrated(
            &self,
            request: &Request,
            tangent: Option<Arc<dyn TangentMap>>,
            t_eval: &[f64],
            state: (&[f64], &[f64]),
            observe: Option<Observe>,
            watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
        ) -> Result<Run, AnalysisError>
        where
            Self::Scratch: Send,
        {
            super::integrated(self, request, tangent, t_eval, state, observe, watch)
        }

        fn timed(
            &self,
            contenders: &[Contender],
            states: &[ClosedState],
            watch: &mut dyn FnMut() -> ControlFlow<()>,
        ) -> Result<Option<Vec<f64>>, AnalysisError>
        where
            Self::Scratch: Send,
        {
            cost::timed(self, contenders, states, watch)
        }
    };
}

impl Balance for Model {
    runs_compiled_here!();

    fn residual(&self, at: &Sample, scratch: &mut Self::Scratch) -> Result<Option<f64>, SystemError> {
        self.equations()
            .residual_of(self.whole(), at.t, &at.q, &at.v, &at.vdot, &at.multipliers, scratch.equations())
            .map(Some)
    }

    fn energies(&self, at: &[&Output], scratch: &mut Self::Scratch) -> Result<Option<Vec<(f64, f64)>>, SystemError> {
        let mut q = Vec::new();
        let one = |x: &&Output| {
            q.clear();
            q.extend(x.q.iter().zip(&x.turns).map(|(q, n)| turns::whole(*q, *n)));
            self.equations().look(&q, &x.v, scratch.equations());
            self.energy(x.t, &q, &x.v, scratch)
        };
        at.iter().map(one).collect::<Result<_, _>>().map(Some)
    }

    fn counted_potential(&self, at: &[Output]) -> Result<Vec<f64>, AnalysisError> {
        if (0..self.spec.forces.len()).all(|i| self.counted_effort(i).is_none()) {
            return Ok(Vec::new());
        }
        let t: Vec<f64> = at.iter().map(|x| x.t).collect();
        let whole = |x: &Output| x.q.iter().zip(&x.turns).map(|(q, n)| turns::whole(*q, *n)).collect::<Vec<_>>();
        let q: Vec<f64> = at.iter().flat_map(whole).collect();
        let v: Vec<f64> = at.iter().flat_map(|x| x.v.iter().copied()).collect();
        outputs::counted_potential(self, &States { t: &t, q: &q, v: &v }, &mut || Ok(()))
    }

    fn energy_floor(&self, atol: f64) -> f64 {
        energy_floor(&self.spec, atol)
    }

    fn agree(&self, _t: f64, _q: &[f64], _v: &[f64]) -> Result<(), SystemError> {
        Ok(()) // a mechanism's derivatives are its own
    }

    fn cause(&self, error: &SystemError) -> Option<String> {
        match error {
            SystemError::Mass { .. } => plausibility::weightless(self),
            // a motion that is named needs no more than the rod that spins
            SystemError::Unfelt { .. } => plausibility::spins_unfelt(self),
            _ => None,
        }
    }

    fn driven_beyond(&self, from: (f64, &[f64]), t: f64, until: f64) -> Option<String> {
        poses::driven_beyond(self, from, t, until)
    }
}

impl<E: Equations> Balance for UserSystem<E> {
    runs_compiled_here!();

    fn residual(&self, _at: &Sample, _scratch: &mut Self::Scratch) -> Result<Option<f64>, SystemError> {
        Ok(None)
    }

    fn energies(&self, _at: &[&Output], _scratch: &mut Self::Scratch) -> Result<Option<Vec<(f64, f64)>>, SystemError> {
        Ok(None)
    }

    fn energy_floor(&self, _atol: f64) -> f64 {
        0.0
    }

    fn agree(&self, t: f64, q: &[f64], v: &[f64]) -> Result<(), SystemError> {
        match self.is_checked() {
            true => {
                let lengths: Vec<f64> = self.structure().displacements().collect();
                derivatives::check(&self.equations, t, q, v, &lengths)
            }
            false => Ok(()),
        }
    }
}

/// Smallest reference energy (J) of a balance: the kinetic energy of all bodies at speeds of the absolute tolerance,
/// and the round-off of the potential of weights that balance each other.
pub fn energy_floor(spec: &Spec, atol: f64) -> f64 {
    let mass: f64 = spec.bodies.iter().map(|b| b.mass).sum();
    let turning: f64 = spec.bodies.iter().flat_map(|b| (0..3).map(|i| b.inertia[i][i])).sum();
    let points = || spec.bodies.iter().map(|b| b.position).chain(spec.joints.iter().map(|j| j.point));
    let spread = |i: usize| {
        let of = || points().map(|p| p[i]);
        of().fold(f64::NEG_INFINITY, f64::max) - of().fold(f64::INFINITY, f64::min)
    };
    let arm = |b: &Body| b.com.iter().map(|x| x * x).sum::<f64>().sqrt();
    let extent = if points().next().is_some() { (0..3).map(|i| spread(i).powi(2)).sum::<f64>().sqrt() } else { 0.0 };
    let extent = extent + spec.bodies.iter().map(arm).fold(0.0, f64::max);
    let pull = spec.gravity.iter().map(|g| g * g).sum::<f64>().sqrt();
    (0.5 * (mass + turning) * atol * atol + tolerance::LONG_ROUNDING * pull * extent * mass) / ENERGY_FLOOR
}

/// The options of a run on which its balances depend.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BalanceOptions {
    /// Relative tolerance; 1 for fixed steps, whose tolerance is unknown.
    pub tolerance: f64,
    /// Whether constraints are left uncorrected on purpose.
    pub drifts: bool,
}

/// Findings from Newton-Euler residuals with the returned reactions, each with its time; NaN where a reaction has no
/// value.
pub fn of_reactions(residuals: impl Iterator<Item = (f64, f64)>, asked: BalanceOptions) -> Option<Finding> {
    let known = residuals.filter(|x| x.1.is_finite());
    let (t, worst) = known.map(|(t, x)| (t, x.abs())).fold((0.0, -1.0), |m, x| if x.1 > m.1 { x } else { m });
    let (mut suspect, mut invalid) = (tolerance::WORST_ROUNDING, NO_BALANCE);
    if asked.drifts {
        let (times, least, most) = (tolerance::DRIFT, tolerance::OPEN, tolerance::OPEN_RATE);
        suspect = (times * asked.tolerance).clamp(least, most);
        invalid = invalid.max(tolerance::CLEARLY * suspect);
    }
    (worst > suspect).then(|| Finding {
        invalid: worst > invalid.max(tolerance::CLEARLY * suspect),
        t,
        sentence: format!(
            "the Newton-Euler residual of the returned reactions is {worst:.1e} of the largest force at t = {} s; \
             at most {suspect:.0e} is expected",
            six_digits(t)
        ),
    })
}

/// Energies at an output.
#[derive(Clone, Copy, Debug)]
pub struct Energy {
    /// Time.
    pub t: f64,
    /// Kinetic energy (J).
    pub kinetic: f64,
    /// Potential energy (J).
    pub potential: f64,
    /// Work since the start (J).
    pub work: f64,
}

/// The finding from the energy balance over the outputs, relative to the energy exchanged (at least `least`) and
/// compared with what the tolerance explains over the number of steps.
pub fn of_energy(at: &[Energy], asked: BalanceOptions, steps: u64, least: f64) -> Option<Finding> {
    let first = at.first()?;
    let most = |of: &dyn Fn(&Energy) -> f64| at.iter().fold(0.0, |m: f64, x| m.max(of(x).abs()));
    let exchanged = most(&|x| x.kinetic).max(most(&|x| x.potential - first.potential)).max(most(&|x| x.work));
    let scale = exchanged.max(least).max(tolerance::LONG_ROUNDING / ENERGY_FLOOR * most(&|x| x.potential));
    if scale <= 0.0 {
        return None;
    }
    let total = |x: &Energy| x.kinetic + x.potential - x.work;
    let off = |x: &Energy| {
        let off = (total(x) - total(first)).abs() / scale;
        if off.is_nan() {
            f64::INFINITY
        } else {
            off
        }
    };
    let (t, worst) = at.iter().map(|x| (x.t, off(x))).fold((first.t, 0.0), |m, x| if x.1 > m.1 { x } else { m });
    let tolerance = asked.tolerance;
    let explained = ((tolerance::ERROR_GROWTH + steps as f64) * tolerance).clamp(ENERGY_FLOOR, ENERGY_TAKEN);
    (worst > explained).then(|| Finding {
        invalid: worst > ENERGY_INVALID.max(tolerance::CLEARLY * explained),
        t,
        sentence: format!(
            "the energy balance is off by {worst:.1e} of the energy exchanged at t = {} s; the tolerances explain \
             at most {explained:.0e}",
            six_digits(t)
        ),
    })
}

/// A few of the outputs, the first and the last among them.
pub(super) fn some(outputs: &[Output]) -> Vec<&Output> {
    match outputs.len() {
        n if n <= LOOKS => outputs.iter().collect(),
        n => (0..LOOKS).map(|i| &outputs[i * (n - 1) / (LOOKS - 1)]).collect(),
    }
}
