//! A mechanism over numbers that carry derivatives along a few directions: its rates for a choice of coordinates, and what
//! is observed of it.

use crate::coupling::Condition;
use crate::error::DescriptionError;
use crate::evaluator::{Evaluator, Scratch, Wide};
use crate::event_functions::Formula;
use crate::force::Element;
use crate::measurement::{Maker, Measurement};
use crate::model::Model;
use crate::rows::Owner;
use crate::spec::Measure;
use crate::wrench::Wrench;
use partita_math::scalar::{Cases, Recorder, Recording, Scalar};
use partita_math::spatial::Spatial;
use partita_system::choice::Choice;
use partita_system::prelude::*;
use partita_system::rates::ChosenRates;
use partita_system::SystemError;
use serde::Deserialize;

/// Directions along which derivatives are carried together.
pub const CARRIED: usize = crate::evaluator::TOGETHER;

/// A number with its derivatives along these.
pub type Carried = Wide;

/// A number that is observed along a motion.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Observable {
    /// Arithmetic of measures and their rates.
    Formula(Formula),
    /// A component of what a joint's constraints do to its child, world axes: three of the force, three of the moment about
    /// the joint's point.
    Wrench(String, usize),
    /// The effort of a drive.
    Effort(String),
    /// a + b + ...
    Sum(Vec<Observable>),
    /// a b ...
    Product(Vec<Observable>),
    /// a / b
    Quotient(Box<[Observable; 2]>),
    /// `√(a² + b² + ...)`
    Norm(Vec<Observable>),
}

/// One of them, with what it reads.
enum Observed {
    Formula(Formula<usize>),
    Wrench(usize, usize),
    /// A row.
    Effort(usize),
    Sum(Vec<Observed>),
    Product(Vec<Observed>),
    Quotient(Box<[Observed; 2]>),
    Norm(Vec<Observed>),
}

impl Observed {
    fn reads_forces(&self) -> bool {
        match self {
            Self::Formula(_) => false,
            Self::Wrench(..) | Self::Effort(_) => true,
            Self::Sum(parts) | Self::Product(parts) | Self::Norm(parts) => parts.iter().any(Self::reads_forces),
            Self::Quotient(parts) => parts.iter().any(Self::reads_forces),
        }
    }

    /// Its value for measures with their rates, wrenches and multipliers; NaN where there are none of these.
    fn value<S: Scalar>(&self, t: S, measures: &[[S; 2]], forces: Option<(&[Wrench<S>], &[S])>) -> S {
        let of = |x: &Self| x.value(t, measures, forces);
        match (self, forces) {
            (Self::Formula(formula), _) => formula.over(t, measures),
            (Self::Wrench(joint, i), Some((joints, _))) => {
                let (force, moment) = (&joints[*joint].force.0, &joints[*joint].moment.0);
                force.iter().chain(moment).nth(*i).copied().unwrap_or(S::from_f64(f64::NAN))
            }
            (Self::Effort(row), Some((_, lambda))) => lambda[*row],
            (Self::Wrench(..) | Self::Effort(_), None) => S::from_f64(f64::NAN),
            (Self::Sum(parts), _) => parts.iter().fold(S::zero(), |sum, x| sum + of(x)),
            (Self::Product(parts), _) => parts.iter().fold(S::one(), |product, x| product * of(x)),
            (Self::Quotient(parts), _) => of(&parts[0]) / of(&parts[1]),
            (Self::Norm(parts), _) => parts.iter().fold(S::zero(), |sum, x| sum.hypot(of(x))),
        }
    }
}

/// The pieces of a step of one choice of coordinates as recordings, whose inputs are t, q, v_I and the numbers of some
/// parameters, one after the other.
pub struct StepRecordings {
    /// q' and v_I' inside a step.
    pub rates: Recording,
    /// q and v at the end, closed.                                                          (34, P2)
    pub end: Recording,
    /// What is integrated.
    pub integrands: Recording,
}

/// What computes a piece of a step of t, q and v_I.
type PieceOfStep<'a> =
    dyn Fn(&Evaluator<Recorder>, Recorder, &[Recorder], &[Recorder]) -> Result<Vec<Recorder>, SystemError> + 'a;

/// Observables over numbers with derivatives.
pub struct Observers<S: Scalar = Carried> {
    measures: Vec<Measurement<Spatial<S>>>,
    all: Vec<Observed>,
}

impl Model {
    /// The equations with derivatives along changes of these parameters.
    ///
    /// # Errors
    /// As [`over_with`](Self::over_with), and for functions of the user that depend on the motion.
    pub fn carrying(&self, changes: &[(&str, &[Carried])]) -> Result<Evaluator<Carried>, DescriptionError> {
        let functions = &*self.own.callers.functions;
        let sees = |e: &&Element<Spatial<f64>>| e.sees_state(functions) || matches!(e, Element::Law(_));
        let force = self.own.full.elements.iter().filter(sees).find_map(|e| e.calls(functions));
        let of_motion = |c: &&Condition<Spatial<f64>>| c.calls(functions) && matches!(c.owner, Owner::Coupling(_));
        let coupling = self.own.full.conditions.iter().find(of_motion).map(|c| &*c.name);
        let named = [("force", force), ("coupling", coupling)].into_iter().find_map(|(kind, x)| x.map(|x| (kind, x)));
        if let Some((kind, name)) = named {
            let message =
                "it calls a function of Python that depends on the motion, which has no derivative; give a table, or \
                           the numbers of an element";
            return Err(DescriptionError::new(kind, name, message));
        }
        self.over_with::<Carried>(changes)
    }

    /// The rates of a choice of coordinates, with derivatives.
    pub fn carried_rates<'c>(
        &self,
        e: &'c Evaluator<Carried>,
        choice: Choice<'c>,
    ) -> Box<dyn ChosenRates<Carried> + 'c> {
        Box::new(self.evaluation(e, choice))
    }

    /// These observables; `name` is what asks for them.
    ///
    /// # Errors
    /// Where a joint, body or drive does not exist, and for functions of the user, which have no derivative.
    pub fn observers<S: Scalar>(
        &self,
        e: &Evaluator<S>,
        observables: &[Observable],
        name: &str,
    ) -> Result<Observers<S>, DescriptionError> {
        let maker = Maker::<Spatial<S>>::new(&self.spec, &e.placed, &e.numbers, &e.full)?;
        let mut making = Making { model: self, maker, name, known: Vec::new(), measures: Vec::new() };
        let all = observables.iter().map(|x| making.observed(x)).collect::<Result<_, _>>()?;
        Ok(Observers { measures: making.measures, all })
    }

    /// A piece of a step, which `of` computes from t, q and v_I, with these parameters as further inputs.
    fn recorded_piece(
        &self,
        k: usize,
        parameters: &[(String, usize)],
        of: &PieceOfStep,
    ) -> Result<Recording, DescriptionError> {
        let (nq, first) = (self.size().nq, 1 + self.size().nq + k);
        let inputs = first + parameters.iter().map(|p| p.1).sum::<usize>();
        let made = Recording::new(inputs, |x| {
            let mut next = first;
            let named = |(name, count): &'_ (String, usize)| {
                next += count;
                (name.clone(), &x[next - count..next])
            };
            let all: Vec<(String, &[Recorder])> = parameters.iter().map(named).collect();
            let changes: Vec<(&str, &[Recorder])> = all.iter().map(|(name, x)| (name.as_str(), *x)).collect();
            let e = self.over_with::<Recorder>(&changes)?;
            of(&e, x[0], &x[1..1 + nq], &x[1 + nq..first]).map_err(|e| {
                DescriptionError::new("mechanism", &self.spec.name, format!("its equations cannot be recorded: {e}"))
            })
        })?;
        Ok(made.lean())
    }

    /// q' and v_I' of a choice as a recording of t, q, v_I and the numbers of these parameters.
    ///
    /// # Errors
    /// As [`over_with`](Self::over_with), and for functions that are known in `f64` alone.
    pub fn rates_recording(
        &self,
        choice: Choice,
        parameters: &[(String, usize)],
    ) -> Result<Recording, DescriptionError> {
        let dim = self.size().nq + choice.k();
        self.recorded_piece(choice.k(), parameters, &|e, t, q, u| {
            let mut out = vec![Recorder::zero(); dim];
            self.evaluation(e, choice).rates(t, q, u, &mut out)?;
            Ok(out)
        })
    }

    /// The pieces of a step of a choice, of these parameters and what is integrated.
    ///
    /// # Errors
    /// As [`over_with`](Self::over_with), and for functions that are known in `f64` alone.
    pub fn step_recordings(
        &self,
        choice: Choice,
        parameters: &[(String, usize)],
        integrals: &[Observable],
    ) -> Result<StepRecordings, DescriptionError> {
        let (rows, k) = (self.size().rows, choice.k());
        // names are checked before, as errors of a recording are those of its equations
        self.observers(&self.over_with::<Recorder>(&[])?, integrals, "objective")?;
        Ok(StepRecordings {
            rates: self.rates_recording(choice, parameters)?,
            end: self.recorded_piece(k, parameters, &|e, t, q, u| {
                let (mut q, mut x) = (q.to_vec(), self.evaluation(e, choice));
                e.normalise(&mut q);
                x.correct(t, &mut q)?;
                x.velocities(t, &q, u)?;
                Ok([q, x.v].concat())
            })?,
            integrands: self.recorded_piece(k, parameters, &|e, t, q, u| {
                let (mut x, mut out) = (self.evaluation(e, choice), vec![Recorder::zero(); integrals.len()]);
                if integrals.is_empty() {
                    return Ok(out);
                }
                let mut lambda = vec![Recorder::zero(); rows];
                x.levels(t, q, u)?;
                x.multipliers(t, q, &mut lambda)?;
                let observers = self
                    .observers(e, integrals, "objective")
                    .map_err(|e| SystemError::argument("objective", e.to_string()))?;
                let at = CarriedState { t, q, v: &x.v, forces: Some((&x.vdot, &lambda)) };
                observers.read(e, &mut e.scratch(), &at, &mut out)?;
                Ok(out)
            })?,
        })
    }

    /// M, C and a at a state, M and C row by row.
    ///
    /// # Errors
    /// Where the equations cannot be evaluated.
    pub fn mass_and_rows(
        &self,
        e: &Evaluator<Carried>,
        t: Carried,
        q: &[Carried],
        v: &[Carried],
    ) -> Result<[Vec<Carried>; 3], SystemError> {
        let (size, pattern) = (self.size(), self.pattern());
        let zeros = |n: usize| vec![Carried::zero(); n];
        let (n, mut s) = (size.nv, e.scratch());
        let (mut phi, mut c, mut a) = (zeros(size.holonomic), zeros(pattern.nnz()), zeros(size.rows));
        let (mut b, mut mass, mut h) = (zeros(size.rows), zeros(n * n), zeros(n));
        e.position(t, q, &mut s, &mut phi, &mut c, &mut a)?;
        e.velocity(t, q, v, &mut s, &mut b)?;
        e.dynamics(t, q, v, &mut s, &mut mass, &mut h)?;
        let mut rows = zeros(size.rows * n);
        for i in 0..size.rows {
            pattern.row(i).for_each(|entry| rows[i * n + pattern.col_idx[entry]] = c[entry]);
        }
        Ok([mass, rows, a])
    }

    /// A measure, or a rate of rotation about an axis of the child, which has no position.
    fn measured<S: Scalar>(
        &self,
        maker: &Maker<Spatial<S>>,
        measure: &Measure,
        name: &str,
    ) -> Result<Measurement<Spatial<S>>, DescriptionError> {
        if let Measure::Joint { joint, coordinate } = measure {
            if let Some((j, component)) = maker.turn_in_space(joint, *coordinate, name)? {
                let p = &self.own.placed.joints[j];
                return Ok(maker.spin(p, component));
            }
        }
        maker.reading(measure, "objective", name)
    }
}

/// Observers while they are made.
struct Making<'a, S: Scalar> {
    model: &'a Model,
    maker: Maker<'a, Spatial<S>>,
    /// What asks for them.
    name: &'a str,
    known: Vec<Measure>,
    measures: Vec<Measurement<Spatial<S>>>,
}

impl<S: Scalar> Making<'_, S> {
    fn refused(&self, message: String) -> DescriptionError {
        DescriptionError::new("objective", self.name, message)
    }

    fn all(&mut self, parts: &[Observable]) -> Result<Vec<Observed>, DescriptionError> {
        parts.iter().map(|x| self.observed(x)).collect()
    }

    fn observed(&mut self, x: &Observable) -> Result<Observed, DescriptionError> {
        Ok(match x {
            Observable::Formula(formula) => Observed::Formula(self.formula(formula)?),
            Observable::Wrench(joint, component) => {
                let number = self.model.own.placed.joint_numbers.get(joint).copied();
                let number = number.ok_or_else(|| self.refused(format!("there is no joint \"{joint}\"")))?;
                Observed::Wrench(number, *component)
            }
            Observable::Effort(drive) => {
                let row = self.model.drives().iter().find(|d| d.name == *drive).map(|d| d.row);
                Observed::Effort(row.ok_or_else(|| self.refused(format!("there is no drive \"{drive}\"")))?)
            }
            Observable::Sum(parts) => Observed::Sum(self.all(parts)?),
            Observable::Product(parts) => Observed::Product(self.all(parts)?),
            Observable::Norm(parts) => Observed::Norm(self.all(parts)?),
            Observable::Quotient(parts) => {
                Observed::Quotient(Box::new([self.observed(&parts[0])?, self.observed(&parts[1])?]))
            }
        })
    }

    fn formula(&mut self, formula: &Formula) -> Result<Formula<usize>, DescriptionError> {
        let mut failure = None;
        let numbered = formula.map(&mut |measure: &Measure| {
            self.measure(measure).unwrap_or_else(|e| {
                failure = Some(e);
                0
            })
        });
        match failure {
            Some(e) => Err(e),
            None if numbered.calls() => Err(self.refused(
                "it reads a function of Python, which has no derivative; give measures, sensors of positions and rates, or \
                 sums and products of them"
                    .into(),
            )),
            None => Ok(numbered),
        }
    }

    /// The number of a measure.
    fn measure(&mut self, measure: &Measure) -> Result<usize, DescriptionError> {
        if let Some(i) = self.known.iter().position(|x| x == measure) {
            return Ok(i);
        }
        self.measures.push(self.model.measured(&self.maker, measure, self.name)?);
        self.known.push(measure.clone());
        Ok(self.known.len() - 1)
    }
}

/// A state with derivatives, its accelerations and multipliers where forces are observed.
#[derive(Clone, Copy)]
pub struct CarriedState<'a, S = Carried> {
    /// Time.
    pub t: S,
    /// Coordinates.
    pub q: &'a [S],
    /// Velocities.
    pub v: &'a [S],
    /// v' and λ of all rows.
    pub forces: Option<(&'a [S], &'a [S])>,
}

impl<S: Scalar> Observers<S> {
    /// Whether accelerations and multipliers are needed.
    pub fn reads_forces(&self) -> bool {
        self.all.iter().any(Observed::reads_forces)
    }

    /// All of them at a state.
    ///
    /// # Errors
    /// Where forces cannot be evaluated.
    pub fn read(
        &self,
        e: &Evaluator<S>,
        s: &mut Scratch<S>,
        at: &CarriedState<S>,
        out: &mut [S],
    ) -> Result<(), SystemError> {
        e.look(at.q, at.v, s);
        let wrenches = match at.forces.filter(|_| self.reads_forces()) {
            Some((vdot, lambda)) => Some((e.reactions(at.t, at.q, at.v, vdot, lambda, s)?.joints, lambda)),
            None => None,
        };
        let read: Vec<[S; 2]> =
            self.measures.iter().map(|m| [m.value(&e.full, &s.full, at.q), m.rate(&e.full, &s.full, at.v)]).collect();
        let forces = wrenches.as_ref().map(|(joints, lambda)| (&joints[..], *lambda));
        out.iter_mut().zip(&self.all).for_each(|(out, x)| *out = x.value(at.t, &read, forces));
        Ok(())
    }
}

impl<M> Formula<M> {
    /// With other measures.
    pub(crate) fn map<N>(&self, of: &mut impl FnMut(&M) -> N) -> Formula<N> {
        let mut all = |parts: &[Self]| parts.iter().map(|part| part.map(of)).collect();
        match self {
            Self::Number(x) => Formula::Number(*x),
            Self::Time => Formula::Time,
            Self::Call(i) => Formula::Call(*i),
            Self::Sum(parts) => Formula::Sum(all(parts)),
            Self::Product(parts) => Formula::Product(all(parts)),
            Self::Position(m) => Formula::Position(of(m)),
            Self::Velocity(m) => Formula::Velocity(of(m)),
            Self::Quotient(parts) => Formula::Quotient(Box::new([parts[0].map(of), parts[1].map(of)])),
            Self::Norm(part) => Formula::Norm(Box::new(part.map(of))),
        }
    }

    /// Whether it calls a function of the user.
    pub(crate) fn calls(&self) -> bool {
        match self {
            Self::Call(_) => true,
            Self::Sum(parts) | Self::Product(parts) => parts.iter().any(Self::calls),
            Self::Quotient(parts) => parts.iter().any(Self::calls),
            Self::Norm(part) => part.calls(),
            Self::Number(_) | Self::Time | Self::Position(_) | Self::Velocity(_) => false,
        }
    }
}

impl Formula<usize> {
    /// Its value for values and rates of its measures; NaN for functions of the user.
    fn over<S: Scalar>(&self, t: S, measures: &[[S; 2]]) -> S {
        match self {
            Self::Number(x) => S::from_f64(*x),
            Self::Time => t,
            Self::Call(_) => S::from_f64(f64::NAN),
            Self::Position(i) => measures[*i][0],
            Self::Velocity(i) => measures[*i][1],
            Self::Sum(parts) => parts.iter().fold(S::zero(), |sum, x| sum + x.over(t, measures)),
            Self::Product(parts) => parts.iter().fold(S::one(), |product, x| product * x.over(t, measures)),
            Self::Quotient(parts) => parts[0].over(t, measures) / parts[1].over(t, measures),
            Self::Norm(part) => Cases::abs(part.over(t, measures)),
        }
    }
}
