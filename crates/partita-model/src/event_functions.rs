//! Functions of events: measures of the mechanism with their rates, arithmetic of these, and functions of the user.

use crate::error::DescriptionError;
use crate::evaluator::Engine;
use crate::measurement::Maker;
use crate::model::Model;
use crate::observe::DegreeOfFreedom;
use crate::spec::Measure;
use crate::tree::{Tree, TreeScratch};
use crate::value::Functions;
use partita_math::spatial::{Planar, Space, Spatial};
use partita_math::tolerance;
use partita_system::event::{Direction, Event, EventFunctions, MotionState};
use partita_system::watched::Reading;
use partita_system::{ConstrainedSystem, SystemError};
use serde::Deserialize;
use std::f64::consts::TAU;
use std::fmt::{Debug, Formatter};
use std::sync::Arc;

/// Longest time over which the rate of a function of the user is taken from a difference. Scale: s. Reason: short beside
/// all that such functions of time alone describe, and long beside the rounding of times.
const LONGEST_DIFFERENCE: f64 = 1e-6;
/// Displacement over which the rate of a function of the user is taken from a difference. Scale: characteristic
/// displacement. Reason: the rounding of the values and the curvature between them are as small as each other.
const MOVED_DIFFERENCE: f64 = 1e-7;

/// A number that is followed along a motion; its measures are written out, or stand by number.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Formula<M = Measure> {
    /// Constant.
    Number(f64),
    /// t.
    Time,
    /// A measure.
    Position(M),
    /// Its rate.
    Velocity(M),
    /// A function of the user at (t, q, v), by its number.
    Call(usize),
    /// a + b + ...
    Sum(Vec<Formula<M>>),
    /// a b ...
    Product(Vec<Formula<M>>),
    /// a / b
    Quotient(Box<[Formula<M>; 2]>),
    /// |a|
    Norm(Box<Formula<M>>),
}

/// An event, as files and the Python package write it.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WrittenEvent {
    /// Its name.
    pub name: String,
    /// What is zero at it.
    pub formula: Formula,
    /// The sign of the rate, or 0.
    direction: i8,
    #[serde(default)]
    last: Option<u64>,
    #[serde(default)]
    most: Option<u64>,
}

impl WrittenEvent {
    /// Without what it follows.
    pub fn event(&self) -> Event {
        Event {
            name: self.name.clone(),
            direction: match self.direction {
                0 => Direction::Either,
                1.. => Direction::Rising,
                _ => Direction::Falling,
            },
            last: self.last,
            most: self.most.unwrap_or(u64::MAX),
            side: None,
        }
    }
}

/// With the numbers of its measures.
type Term = Formula<usize>;

/// x, x' and x''.
type Course = [f64; 3];

/// x and x' of a term, and the size of what x is the sum of.
#[derive(Clone, Copy, Debug)]
struct Value {
    x: f64,
    rate: f64,
    size: f64,
}

impl Value {
    fn new(x: f64, rate: f64) -> Self {
        Self { x, rate, size: x.abs() }
    }
}

/// A measure, and what is known about its whole turns.
#[derive(Debug)]
struct Followed<G: Space<S = f64>> {
    freedom: DegreeOfFreedom<G>,
    /// t, x, x' where the motion stands, for an angle that is known up to whole turns.
    last: Option<(f64, f64, f64)>,
    /// The same at the instants read since.
    read: Vec<(f64, f64, f64)>,
}

impl<G: Space<S = f64>> Followed<G> {
    fn course(&mut self, tree: &Tree<G>, s: &TreeScratch<G>, at: &MotionState) -> Course {
        let [mut x, rate, second] = self.freedom.course(tree, s, (&at.q, &at.v, &at.vdot));
        if self.freedom.wraps() {
            if let Some((t, last, last_rate)) = self.last {
                // of the candidates the one next to the mean of both rates
                let expected = last + 0.5 * (last_rate + rate) * (at.t - t);
                x += ((expected - x) / TAU).round() * TAU;
            }
            self.read.push((at.t, x, rate));
        }
        [x, rate, second]
    }

    fn accept(&mut self, t: f64) {
        self.last = self.read.iter().rev().find(|read| read.0 == t).copied().or(self.last);
        self.read.clear();
    }
}

/// Measures along a motion.
trait Measures: Send + Sync {
    /// The course of each at a state.
    fn read(&mut self, at: &MotionState, courses: &mut [Course]);
    /// See [`EventFunctions::accept`].
    fn accept(&mut self, t: f64);
}

/// Measures in the space of the evaluations, with memory.
struct FollowedIn<G: Space<S = f64>> {
    model: Arc<Model>,
    /// The tree of the model in this space.
    tree: fn(&Model) -> &Tree<G>,
    all: Vec<Followed<G>>,
    scratch: TreeScratch<G>,
}

impl<G: Space<S = f64>> FollowedIn<G> {
    /// These measures of the events of these names.
    fn new(
        model: Arc<Model>,
        tree: fn(&Model) -> &Tree<G>,
        measures: &[(Measure, String)],
    ) -> Result<Self, DescriptionError> {
        let maker = Maker::<G>::new(&model.spec, &model.own.placed, &model.own.numbers, tree(&model))?;
        let mut all = Vec::with_capacity(measures.len());
        for (measure, name) in measures {
            let freedom = DegreeOfFreedom::new(maker.reading(measure, "event", name)?, &model);
            all.push(Followed { freedom, last: None, read: Vec::new() });
        }
        let scratch = tree(&model).scratch();
        Ok(Self { model, tree, all, scratch })
    }
}

impl<G: Space<S = f64>> Measures for FollowedIn<G> {
    fn read(&mut self, at: &MotionState, courses: &mut [Course]) {
        let tree = (self.tree)(&self.model);
        if self.all.iter().any(|x| x.freedom.needs_look()) {
            tree.poses(&at.q, &mut self.scratch);
            tree.twists(&at.v, &mut self.scratch);
        }
        for (x, course) in self.all.iter_mut().zip(courses) {
            *course = x.course(tree, &self.scratch, at);
        }
    }
    fn accept(&mut self, t: f64) {
        self.all.iter_mut().for_each(|x| x.accept(t));
    }
}

/// Of a system without bodies and joints.
struct NoMeasures;

impl Measures for NoMeasures {
    fn read(&mut self, _: &MotionState, _: &mut [Course]) {}
    fn accept(&mut self, _: f64) {}
}

/// Functions of events by formulas.
pub struct Formulas<S> {
    system: Arc<S>,
    functions: Arc<dyn Functions>,
    names: Vec<String>,
    terms: Vec<Term>,
    measures: Box<dyn Measures>,
    courses: Vec<Course>,
    /// Natural sizes of the measures.
    natural: Vec<f64>,
    /// When the first reading was made: functions may not be defined before.
    start: Option<f64>,
    /// Memory for a state beside.
    q: Vec<f64>,
    v: Vec<f64>,
    dv: Vec<f64>,
}

impl<S> Debug for Formulas<S> {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Formulas").field("names", &self.names).field("terms", &self.terms).finish()
    }
}

impl Formulas<Model> {
    /// Of a mechanism, by name; `functions` are those of the user.
    ///
    /// # Errors
    /// Where a measure does not exist, or a function.
    pub fn of_mechanism(
        model: Arc<Model>,
        formulas: &[(String, Formula)],
        functions: Arc<dyn Functions>,
    ) -> Result<Self, DescriptionError> {
        let mut measures = Vec::new();
        let terms = numbered_all(formulas, &*functions, &mut measures)?;
        // the plane knows nothing of axes and points out of it
        let in_space = measures.iter().any(|(x, _)| matches!(x, Measure::Cosine { .. } | Measure::Along { .. }));
        let followed: Box<dyn Measures> = match &model.own.engine {
            Engine::Planar(_) if !in_space => {
                Box::new(FollowedIn::<Planar<f64>>::new(model.clone(), in_plane, &measures)?)
            }
            _ => Box::new(FollowedIn::<Spatial<f64>>::new(model.clone(), |m| &m.own.full, &measures)?),
        };
        let natural = measures.iter().map(|(measure, _)| model.natural_size(measure)).collect();
        Ok(Self::with(model, functions, formulas, terms, (followed, natural)))
    }
}

/// The tree in the plane.
fn in_plane(model: &Model) -> &Tree<Planar<f64>> {
    match &model.own.engine {
        Engine::Planar(tree) => tree,
        Engine::Full => unreachable!("measures in the plane are those of a planar mechanism"),
    }
}

impl<S: ConstrainedSystem> Formulas<S> {
    /// Of a system that has no measures, by name; `functions` are those of the user.
    ///
    /// # Errors
    /// Where a formula reads a measure, or a function does not exist.
    pub fn of_system(
        system: Arc<S>,
        formulas: &[(String, Formula)],
        functions: Arc<dyn Functions>,
    ) -> Result<Self, DescriptionError> {
        let mut measures = Vec::new();
        let terms = numbered_all(formulas, &*functions, &mut measures)?;
        match measures.first() {
            None => Ok(Self::with(system, functions, formulas, terms, (Box::new(NoMeasures), Vec::new()))),
            Some((_, name)) => {
                let message = "a system given by matrices has no joints and no measures; give a function f(t, state)";
                Err(DescriptionError::new("event", name, message))
            }
        }
    }

    fn with(
        system: Arc<S>,
        functions: Arc<dyn Functions>,
        formulas: &[(String, Formula)],
        terms: Vec<Term>,
        (measures, natural): (Box<dyn Measures>, Vec<f64>),
    ) -> Self {
        let size = system.size();
        let (q, v, dv) = (vec![0.0; size.nq], vec![0.0; size.nv], vec![0.0; size.nv]);
        let names = formulas.iter().map(|x| x.0.clone()).collect();
        let courses = vec![[0.0; 3]; natural.len()];
        Self { system, functions, names, terms, measures, courses, natural, start: None, q, v, dv }
    }

    /// x and x' of a function of the user, which is called at the state and shortly before.
    fn called(&mut self, i: usize, name: &str, at: &MotionState) -> Result<Value, SystemError> {
        let failed = |source| SystemError::Function { what: format!("event \"{name}\""), source };
        let x = self.functions.scalar(i, at.t, &at.q, &at.v).map_err(failed)?;
        let fastest = self.system.travel(&at.v).max(self.system.travel(&at.vdot).sqrt());
        let span =
            (MOVED_DIFFERENCE / fastest).min(LONGEST_DIFFERENCE).max(tolerance::DIFFERENCE_ROUNDING * at.t.abs());
        // not before the start
        let h = if self.start.is_some_and(|start| at.t - span >= start) { -span } else { span };
        self.q.copy_from_slice(&at.q);
        for ((dv, v), (a, moved)) in self.dv.iter_mut().zip(&at.v).zip(at.vdot.iter().zip(&mut self.v)) {
            (*dv, *moved) = (h * (v + 0.5 * h * a), v + h * a);
        }
        self.system.step(&mut self.q, &self.dv);
        let beside = self.functions.scalar(i, at.t + h, &self.q, &self.v).map_err(failed)?;
        Ok(Value { x, rate: (beside - x) / h, size: x.abs().max(beside.abs()) })
    }

    fn value(&mut self, term: &Term, name: &str, at: &MotionState) -> Result<Value, SystemError> {
        Ok(match term {
            Term::Number(x) => Value::new(*x, 0.0),
            Term::Time => Value::new(at.t, 1.0),
            Term::Position(i) => {
                let [x, rate, _] = self.courses[*i];
                Value { x, rate, size: x.abs().max(self.natural[*i]) }
            }
            Term::Velocity(i) => {
                let [_, x, rate] = self.courses[*i];
                Value { x, rate, size: x.abs().max(self.natural[*i] * self.system.travel(&at.v)) }
            }
            Term::Call(i) => self.called(*i, name, at)?,
            Term::Sum(parts) => {
                let mut sum = Value::new(0.0, 0.0);
                for part in parts {
                    let part = self.value(part, name, at)?;
                    sum = Value { x: sum.x + part.x, rate: sum.rate + part.rate, size: sum.size + part.size };
                }
                sum
            }
            Term::Product(parts) => {
                let mut product = Value::new(1.0, 0.0);
                for part in parts {
                    let (a, b) = (product, self.value(part, name, at)?);
                    let size = (a.size * b.x.abs()).max(a.x.abs() * b.size);
                    product = Value { x: a.x * b.x, rate: a.x * b.rate + b.x * a.rate, size };
                }
                product
            }
            Term::Quotient(parts) => {
                let (a, b) = (self.value(&parts[0], name, at)?, self.value(&parts[1], name, at)?);
                let x = a.x / b.x;
                Value { x, rate: (a.rate - x * b.rate) / b.x, size: (a.size + x.abs() * b.size) / b.x.abs() }
            }
            Term::Norm(part) => {
                let part = self.value(part, name, at)?;
                Value { x: part.x.abs(), rate: if part.x < 0.0 { -part.rate } else { part.rate }, ..part }
            }
        })
    }
}

/// All formulas, with the measures that they read.
fn numbered_all(
    formulas: &[(String, Formula)],
    functions: &dyn Functions,
    measures: &mut Vec<(Measure, String)>,
) -> Result<Vec<Term>, DescriptionError> {
    let mut follow = |measure: &Measure, name: &str| {
        measures.iter().position(|known| known.0 == *measure).unwrap_or_else(|| {
            measures.push((measure.clone(), name.to_owned()));
            measures.len() - 1
        })
    };
    let mut terms = Vec::with_capacity(formulas.len());
    for (name, formula) in formulas {
        terms.push(numbered(formula, name, functions.count(), &mut follow)?);
    }
    Ok(terms)
}

/// A formula with the numbers of its measures, which `follow` gives.
fn numbered(
    formula: &Formula,
    name: &str,
    functions: usize,
    follow: &mut dyn FnMut(&Measure, &str) -> usize,
) -> Result<Term, DescriptionError> {
    let mut all = |parts: &[Formula]| {
        let mut found = Vec::with_capacity(parts.len());
        for part in parts {
            found.push(numbered(part, name, functions, follow)?);
        }
        Ok::<Vec<Term>, DescriptionError>(found)
    };
    Ok(match formula {
        Formula::Number(x) => Term::Number(*x),
        Formula::Time => Term::Time,
        Formula::Call(i) if *i < functions => Term::Call(*i),
        Formula::Call(i) => return Err(DescriptionError::new("event", name, format!("there is no function {i}"))),
        Formula::Sum(parts) => Term::Sum(all(parts)?),
        Formula::Product(parts) => Term::Product(all(parts)?),
        Formula::Position(measure) => Term::Position(follow(measure, name)),
        Formula::Velocity(measure) => Term::Velocity(follow(measure, name)),
        Formula::Quotient(parts) => {
            let [a, b] = &**parts;
            Term::Quotient(Box::new([numbered(a, name, functions, follow)?, numbered(b, name, functions, follow)?]))
        }
        Formula::Norm(part) => Term::Norm(Box::new(numbered(part, name, functions, follow)?)),
    })
}

impl<S: ConstrainedSystem + Send + Sync> EventFunctions for Formulas<S> {
    fn read(&mut self, at: &MotionState, out: &mut [Reading]) -> Result<(), SystemError> {
        self.start.get_or_insert(at.t);
        self.measures.read(at, &mut self.courses);
        let (terms, names) = (std::mem::take(&mut self.terms), std::mem::take(&mut self.names));
        let mut read = || {
            for ((out, term), name) in out.iter_mut().zip(&terms).zip(&names) {
                let Value { x, rate, size } = self.value(term, name, at)?;
                if !x.is_finite() {
                    return Err(SystemError::NotFinite { what: format!("event \"{name}\""), t: at.t });
                }
                let rate = if rate.is_finite() { rate } else { 0.0 };
                *out = Reading { x, rate, terms: size, ..Reading::default() };
            }
            Ok(())
        };
        let done = read();
        (self.terms, self.names) = (terms, names);
        done
    }
    fn accept(&mut self, t: f64) {
        self.measures.accept(t);
    }
}
