//! From a system, a request and a state to an integration: the one set-up of runs, steppers, timings and pages.

use super::balance::Balance;
use super::inconsistent::{self, StartViolations};
use super::singular_start::{self, BranchStart};
use super::{some, Assessed, Described, Limits, Request, SolutionLog};
use crate::error::AnalysisError;
use crate::outputs::Watch;
use partita_integrate::simulate::Settings;
use partita_math::tolerance;
use partita_model::Model;
use partita_system::equations::{Equations, UserSystem};
use partita_system::formulation::{registry, Formulation};
use partita_system::options::{FormulationOptions, TangentMap};
use partita_system::reduction::Reduction;
use partita_system::singular::consistency;
use partita_system::start::{self, Start};
use partita_system::{weight, ConstrainedSystem, SystemError, SystemRef};
use std::sync::Arc;

/// A system with the code by which its motions are set up: generic code is compiled anew in every crate that uses it,
/// but here, once for each system, in the crate that implements this trait for it.
pub trait Motions: ConstrainedSystem {
    /// The formulation of a recipe.
    ///
    /// # Errors
    /// See [`registry::by_name`].
    fn formulation<'s>(
        system: SystemRef<'s, Self>,
        recipe: &Recipe,
    ) -> Result<Box<dyn Formulation + Send + 's>, SystemError>
    where
        Self: Sized + 's;

    /// An examined state. See [`ExaminedStart::at`].
    ///
    /// # Errors
    /// See [`ExaminedStart::at`].
    fn examined<'s>(
        system: SystemRef<'s, Self>,
        state: (f64, &[f64], &[f64]),
        to: (f64, f64),
        longest: f64,
    ) -> Result<ExaminedStart<'s, Self>, AnalysisError>
    where
        Self: Sized;

    /// The outputs of a run, described. See [`SolutionLog::describe`].
    ///
    /// # Errors
    /// See [`SolutionLog::describe`].
    fn described(&self, log: &SolutionLog, shared: bool, watch: Watch) -> Result<Described, AnalysisError>;

    /// The outputs of a run, assessed. See [`SolutionLog::assess`].
    ///
    /// # Errors
    /// See [`SolutionLog::describe`].
    fn assessed(&self, log: &SolutionLog, shared: bool, watch: Watch) -> Result<Assessed, AnalysisError>;

    /// Names of the bodies that move at these velocities, where there are bodies.
    fn bodies_moved(&self, _q: &[f64], _v: &[f64]) -> Vec<String> {
        Vec::new()
    }

    /// Notes on a start with these velocities, or reasons to refuse it.
    ///
    /// # Errors
    /// Velocities whose motion is not continued.
    fn start_notes(&self, _q: &[f64], _v: &[f64]) -> Result<Vec<String>, SystemError> {
        Ok(Vec::new())
    }
}

/// The methods of [`Motions`] by generic code, for the system of the `impl` in which they stand.
macro_rules! compiled_here {
    () => {
        fn formulation<'s>(
            system: SystemRef<'s, Self>,
            recipe: &Recipe,
        ) -> Result<Box<dyn Formulation + Send + 's>, SystemError>
        where
            Self: 's,
        {
            recipe.formulation_of(system)
        }

        fn examined<'s>(
            system: SystemRef<'s, Self>,
            state: (f64, &[f64], &[f64]),
            to: (f64, f64),
            longest: f64,
        ) -> Result<ExaminedStart<'s, Self>, AnalysisError> {
            ExaminedStart::examined(system, state, to, longest)
        }

        fn described(&self, log: &SolutionLog, shared: bool, watch: Watch) -> Result<Described, AnalysisError> {
            log.described(self, shared, watch)
        }

        fn assessed(&self, log: &SolutionLog, shared: bool, watch: Watch) -> Result<Assessed, AnalysisError> {
            log.assessed(self, shared, watch)
        }
    };
}

impl Motions for Model {
    compiled_here!();

    fn bodies_moved(&self, q: &[f64], v: &[f64]) -> Vec<String> {
        Model::bodies_moved(self, q, v)
    }

    fn start_notes(&self, q: &[f64], v: &[f64]) -> Result<Vec<String>, SystemError> {
        Model::start_notes(self, q, v)
    }
}

impl<E: Equations> Motions for UserSystem<E> {
    compiled_here!();
}

/// The recipe of a formulation: by name, for a rank, with options. Runs create it to integrate, and again to describe
/// outputs.
#[derive(Clone)]
pub struct Recipe {
    /// The formulation, by name.
    pub formulation: String,
    /// Rank of the constraints.
    pub rank: usize,
    /// Options of the formulation.
    pub options: FormulationOptions,
}

impl Recipe {
    /// The formulation for `system`.
    ///
    /// # Errors
    /// See [`registry::by_name`].
    pub fn make<'s, S: Motions + 's>(
        &self,
        system: impl Into<SystemRef<'s, S>>,
    ) -> Result<Box<dyn Formulation + Send + 's>, SystemError> {
        S::formulation(system.into(), self)
    }

    fn formulation_of<'s, S: ConstrainedSystem<Scratch: Send> + 's>(
        &self,
        system: SystemRef<'s, S>,
    ) -> Result<Box<dyn Formulation + Send + 's>, SystemError> {
        registry::by_name(&self.formulation, system, self.rank, &self.options)
    }
}

/// An examined initial state.
pub struct ExaminedStart<'s, S: ConstrainedSystem> {
    /// Rank and redundant rows.
    pub start: Start,
    /// The start on a branch out of a singular position.
    pub(super) singular_start: Option<BranchStart<'s, S>>,
    /// Constraint violations of the state.
    seen: StartViolations,
}

impl<'s, S: Motions> ExaminedStart<'s, S> {
    /// Rank, redundant rows and the branch out of a singular position, up to `end` and to this tolerance. It verifies
    /// that redundant rows agree with the others, every motion moves mass, and the state nearly satisfies the
    /// constraints.
    ///
    /// # Errors
    /// Where one of these conditions fails, and where the velocities determine no branch.
    pub fn at(
        system: impl Into<SystemRef<'s, S>>,
        state: (f64, &[f64], &[f64]),
        to: (f64, f64),
        longest: f64,
    ) -> Result<Self, AnalysisError> {
        S::examined(system.into(), state, to, longest)
    }

    fn examined(
        system: SystemRef<'s, S>,
        (t, q, v): (f64, &[f64], &[f64]),
        (end, tolerance): (f64, f64),
        longest: f64,
    ) -> Result<Self, AnalysisError> {
        let mut probe = Reduction::new(system.clone(), 0);
        let (start, singular_start) = match start::analyse_with(&mut probe, t, q) {
            Err(e @ SystemError::SingularStart { .. }) => {
                let singular_start = singular_start::start_singular(system.clone(), (t, q, v), (end, tolerance), e)?;
                (start::analyse(&*system, singular_start.step.t, &singular_start.step.q)?, Some(singular_start))
            }
            found => (found?, None),
        };
        let given = (t, q, v);
        let (t, q, v) = singular_start.as_ref().map_or(given, |x| (x.step.t, &x.step.q[..], &x.step.v[..]));
        consistency::check(&*system, &start, (t, q, v), longest)?;
        let seen = inconsistent::see(&mut probe, given, singular_start.is_none())?;
        if let Some((motion, moving)) = weight::words(&*system, t, q, start.rank)? {
            return Err(SystemError::Unfelt { t, motion, bodies: system.bodies_moved(q, &moving) }.into());
        }
        Ok(Self { start, singular_start, seen })
    }
}

/// Where a motion starts: the state given, or the closed one next to it.
pub(super) struct Entry<'s, S: ConstrainedSystem> {
    /// Examined there.
    pub looked: ExaminedStart<'s, S>,
    /// Coordinates and velocities.
    pub q: Vec<f64>,
    /// See `q`.
    pub v: Vec<f64>,
    /// By how much it was corrected.
    pub corrected: Option<String>,
}

impl<'s, S: Motions> Entry<'s, S> {
    /// From (t, q, v), up to `to` and to this tolerance, with the formulation of `recipe`, whose rank is set.
    ///
    /// # Errors
    /// See [`ExaminedStart::at`]; where the state cannot be closed.
    pub fn at(
        system: &SystemRef<'s, S>,
        recipe: &mut Recipe,
        (t, q, v): (f64, &[f64], &[f64]),
        to: (f64, f64),
        longest: f64,
    ) -> Result<Self, AnalysisError> {
        let mut looked = ExaminedStart::at(system.clone(), (t, q, v), to, longest)?;
        recipe.rank = looked.start.rank;
        let (mut own, mut corrected) = ((q.to_vec(), v.to_vec()), None);
        if looked.singular_start.is_none() && !looked.seen.satisfied() {
            own = inconsistent::corrected(system, recipe, (t, q, v))?;
            corrected = inconsistent::note(&**system, &looked.seen, (q, v), Some((&own.0[..], &own.1[..])));
            looked = ExaminedStart::at(system.clone(), (t, &own.0, &own.1), to, longest)?;
            recipe.rank = looked.start.rank;
        }
        Ok(Self { looked, q: own.0, v: own.1, corrected })
    }
}

/// The formulation to be integrated, its initial state, and their data.
pub struct Prepared<'s, S: Balance> {
    system: SystemRef<'s, S>,
    /// Its formulation, not yet started.
    pub formulation: Box<dyn Formulation + Send + 's>,
    /// How to make it again.
    pub recipe: Recipe,
    /// Method, steps and the end: that of the request, or where a table ends before.
    pub settings: Settings,
    /// Limits of constraint violations.
    pub limits: Limits,
    /// Notes for the user, in sentences.
    pub notes: Vec<String>,
    /// Whether it is a structure at rest.
    pub rigid: bool,
    /// What ends the integration early, and when.
    pub(super) ends: Option<(f64, String)>,
    /// The first step, where the start is singular.
    pub(super) singular_start: Option<BranchStart<'s, S>>,
    /// Constraint violations of the start.
    pub(super) seen: StartViolations,
    /// How the start was corrected.
    pub(super) corrected: Option<String>,
    /// Coordinates and velocities at the start, which satisfy the constraints.
    pub q: Vec<f64>,
    /// See `q`.
    pub v: Vec<f64>,
}

impl<'s, S: Balance<Scratch: Send>> Prepared<'s, S> {
    /// For `request`, from (q, v) at its start.
    ///
    /// # Errors
    /// The request is invalid, or the run cannot start there.
    pub fn new(
        system: impl Into<SystemRef<'s, S>>,
        request: &Request,
        tangent: Option<Arc<dyn TangentMap>>,
        (q, v): (&[f64], &[f64]),
    ) -> Result<Self, AnalysisError> {
        let system = system.into();
        Self::made(system.clone(), request, tangent, (q, v)).map_err(|e| explained(&*system, e))
    }

    fn made(
        system: SystemRef<'s, S>,
        request: &Request,
        tangent: Option<Arc<dyn TangentMap>>,
        (q, v): (&[f64], &[f64]),
    ) -> Result<Self, AnalysisError> {
        let t0 = request.t0;
        system.agree(t0, q, v)?;
        let mut settings = request.settings()?;
        let watched = system.watched();
        let ends = watched.domain.filter(|(end, _)| within(*end, request));
        if let Some((end, _)) = &ends {
            settings.t_end = *end;
        }
        let options = request.formulation_options(&*system, tangent)?;
        let limits = Limits::of(request);
        let mut notes = Vec::new();
        let unread = registry::unread(&request.formulation, &options);
        if !unread.is_empty() {
            notes.push(format!("formulation \"{}\" does not use {}", request.formulation, unread.join(", ")));
        }
        let discontinuity = watched.discontinuities.iter().copied().find(|t| *t > t0);
        let end = discontinuity.map_or(settings.t_end, |discontinuity| discontinuity.min(settings.t_end));
        let mut recipe = Recipe { formulation: request.formulation.clone(), rank: 0, options };
        let to = (end, request.rtol);
        let Entry { looked, q, v, corrected } = Entry::at(&system, &mut recipe, (t0, q, v), to, request.t_end - t0)?;
        let found = &looked.start;
        if !found.dropped.is_empty() {
            notes.push(note_of_dropped(&*system, found));
        }
        let driven = (0..system.size().rows).any(|i| system.structure().rows[i].is_drive);
        let rigid = found.rank == system.size().nv && !driven;
        if rigid && !system.structure().rheonomic {
            notes.push(CANNOT_MOVE.to_string());
        }
        let own = (&q[..], &v[..]);
        let (q_start, v_start) = looked.singular_start.as_ref().map_or(own, |x| (&x.step.q[..], &x.step.v[..]));
        notes.extend(system.start_notes(q_start, v_start)?);
        let formulation = recipe
            .make(system.clone())
            .map_err(|e| AnalysisError::Argument { argument: "formulation", message: e.to_string() })?;
        let ExaminedStart { singular_start, seen, .. } = looked;
        Ok(Self {
            system,
            formulation,
            recipe,
            settings,
            limits,
            notes,
            rigid,
            ends,
            singular_start,
            seen,
            corrected,
            q,
            v,
        })
    }

    /// Whether nothing ever moves.
    pub fn rests(&self) -> bool {
        self.rigid && !self.system.structure().rheonomic
    }
}

/// An error with the known causes added.
pub(super) fn explained<S: Balance>(system: &S, error: AnalysisError) -> AnalysisError {
    match error {
        AnalysisError::System(error) => match system.cause(&error) {
            Some(cause) => AnalysisError::Explained { error, cause },
            None => AnalysisError::System(error),
        },
        other => other,
    }
}

/// Whether an end at this time lies inside the run, by more than the round-off of its last step.
fn within(end: f64, request: &Request) -> bool {
    end > request.t0 && request.t_end - end > tolerance::EQUAL * (request.t_end - request.t0)
}

fn note_of_dropped<S: ConstrainedSystem>(system: &S, found: &Start) -> String {
    format!(
        "{} loop-closure constraints are redundant and were removed by a rank decision ({}); the gap between kept and dropped \
         pivots is {:.1e}",
        found.dropped.len(),
        some(&found.dropped, |&i| system.structure().rows[i].name.to_string()),
        found.gap
    )
}

/// A run of a structure: it stays at rest, which is not a failure.
pub(super) const CANNOT_MOVE: &str =
    "the mechanism is a structure without degrees of freedom and cannot move; the run keeps it at rest and computes \
     the static reactions";

/// Message for a structure whose constraints are too weak for its reactions to be computed.
pub(super) fn no_reactions() -> AnalysisError {
    let message = "the mechanism cannot move, but the constraints that lock it are so weak that their forces are \
        lost in rounding; give the joint positions with all digits, or a larger drawing_tolerance for the play they \
        have"
        .to_string();
    AnalysisError::Argument { argument: "drawing_tolerance", message }
}
