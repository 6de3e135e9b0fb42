//! Functions of events: measures of the mechanism with their rates, arithmetic of these, and functions of the user.

use crate::error::DescriptionError;
use crate::measurement::Maker;
use crate::model::{Model, ModelScratch};
use crate::observe::DegreeOfFreedom;
use crate::spec::Measure;
use crate::value::Functions;
use partita_math::spatial::Spatial;
use partita_math::tolerance;
use partita_system::event::{EventFunctions, MotionState};
use partita_system::prelude::*;
use partita_system::watched::Reading;
use partita_system::SystemError;
use serde::Deserialize;
use std::fmt::{Debug, Formatter};
use std::sync::Arc;

/// Longest time over which the rate of a function of the user is taken from a difference [s]. Reason: short beside all that
/// such functions of time alone describe, and long beside the rounding of times.
const LONGEST_DIFFERENCE: f64 = 1e-6;
/// Displacement over which that is done. Scale: characteristic displacement. Reason: the rounding of the values and the
/// curvature between them are as small as each other.
const DIFFERENCE: f64 = 1e-7;

/// A number that is followed along a motion.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Formula {
    /// Constant.
    Number(f64),
    /// t.
    Time,
    /// A measure.
    Position(Measure),
    /// Its rate.
    Velocity(Measure),
    /// A function of the user at (t, q, v), by its number.
    Call(usize),
    /// a + b + ...
    Sum(Vec<Formula>),
    /// a b ...
    Product(Vec<Formula>),
    /// a / b
    Quotient(Box<[Formula; 2]>),
    /// |a|
    Norm(Box<Formula>),
}

/// The same, with its measures by their numbers.
#[derive(Clone, Debug)]
enum Tree {
    Number(f64),
    Time,
    Position(usize),
    Velocity(usize),
    Call(usize),
    Sum(Vec<Tree>),
    Product(Vec<Tree>),
    Quotient(Box<[Tree; 2]>),
    Norm(Box<Tree>),
}

/// x, x' and x''.
type Course = [f64; 3];

/// A measure, and what is known about its whole turns.
#[derive(Debug)]
struct Followed {
    freedom: DegreeOfFreedom,
    /// t, x, x' where the motion stands, for an angle that is known up to whole turns.
    last: Option<(f64, f64, f64)>,
    /// The same at the instants read since.
    read: Vec<(f64, f64, f64)>,
}

/// The functions of the events of a mechanism.
pub struct MechanismFunctions {
    model: Arc<Model>,
    scratch: ModelScratch,
    functions: Arc<dyn Functions>,
    names: Vec<String>,
    trees: Vec<Tree>,
    followed: Vec<Followed>,
    courses: Vec<Course>,
    /// When the first reading was made: functions may not be defined before.
    start: Option<f64>,
    /// Memory for a state beside.
    q: Vec<f64>,
    v: Vec<f64>,
    dv: Vec<f64>,
}

impl Debug for MechanismFunctions {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("MechanismFunctions").field("names", &self.names).field("trees", &self.trees).finish()
    }
}

impl MechanismFunctions {
    /// Of events by name; `functions` are those of the user.
    ///
    /// # Errors
    /// Where a measure does not exist, or a function.
    pub fn new(
        model: Arc<Model>,
        formulas: &[(String, Formula)],
        functions: Arc<dyn Functions>,
    ) -> Result<Self, DescriptionError> {
        let own = &model.own;
        let maker = Maker::<Spatial<f64>>::new(&model.spec, &own.placed, &own.numbers, &own.full)?;
        let (mut measures, mut followed) = (Vec::new(), Vec::new());
        let mut follow = |measure: &Measure, name: &str| {
            if let Some(i) = measures.iter().position(|known| known == measure) {
                return Ok(i);
            }
            let freedom = DegreeOfFreedom::new(maker.reading(measure, "event", name)?, &model);
            measures.push(measure.clone());
            followed.push(Followed { freedom, last: None, read: Vec::new() });
            Ok::<usize, DescriptionError>(followed.len() - 1)
        };
        let mut trees = Vec::with_capacity(formulas.len());
        for (name, formula) in formulas {
            trees.push(planted(formula, name, functions.count(), &mut follow)?);
        }
        let size = model.size();
        let (q, v, dv) = (vec![0.0; size.nq], vec![0.0; size.nv], vec![0.0; size.nv]);
        let (scratch, courses) = (model.scratch(), vec![[0.0; 3]; followed.len()]);
        let names = formulas.iter().map(|x| x.0.clone()).collect();
        Ok(Self { model, scratch, functions, names, trees, followed, courses, start: None, q, v, dv })
    }

    /// The measures at a state.
    fn measure(&mut self, at: &MotionState) {
        let Self { model, scratch, followed, courses, .. } = self;
        if followed.iter().any(|x| x.freedom.needs_look()) {
            model.equations().look(&at.q, &at.v, scratch.equations());
        }
        for (x, course) in followed.iter_mut().zip(courses) {
            let [mut value, rate] = x.freedom.value_and_rate(model, (&at.q, &at.v), scratch);
            if x.freedom.wraps() {
                if let Some((t, last, last_rate)) = x.last {
                    // of the candidates the one next to the mean of both rates
                    let expected = last + 0.5 * (last_rate + rate) * (at.t - t);
                    value += ((expected - value) / std::f64::consts::TAU).round() * std::f64::consts::TAU;
                }
                x.read.push((at.t, value, rate));
            }
            *course = [value, rate, x.freedom.acceleration(model, &at.vdot, scratch)];
        }
    }

    /// x and x' of a function of the user, which is called at the state and shortly before.
    fn called(&mut self, i: usize, name: &str, at: &MotionState) -> Result<Course, SystemError> {
        let failed = |source| SystemError::Function { what: format!("event \"{name}\""), source };
        let x = self.functions.scalar(i, at.t, &at.q, &at.v).map_err(failed)?;
        let fastest = self.model.travel(&at.v).max(self.model.travel(&at.vdot).sqrt());
        let span = (DIFFERENCE / fastest).min(LONGEST_DIFFERENCE).max(tolerance::DIFFERENCE_ROUNDING * at.t.abs());
        // not before the start
        let h = if self.start.is_some_and(|start| at.t - span >= start) { -span } else { span };
        self.q.copy_from_slice(&at.q);
        for ((dv, v), (a, moved)) in self.dv.iter_mut().zip(&at.v).zip(at.vdot.iter().zip(&mut self.v)) {
            (*dv, *moved) = (h * (v + 0.5 * h * a), v + h * a);
        }
        self.model.step(&mut self.q, &self.dv);
        let beside = self.functions.scalar(i, at.t + h, &self.q, &self.v).map_err(failed)?;
        Ok([x, (beside - x) / h, 0.0])
    }

    fn course(&mut self, tree: &Tree, name: &str, at: &MotionState) -> Result<Course, SystemError> {
        let product = |[x, dx, _]: Course, [y, dy, _]: Course| [x * y, x * dy + y * dx, 0.0];
        Ok(match tree {
            Tree::Number(x) => [*x, 0.0, 0.0],
            Tree::Time => [at.t, 1.0, 0.0],
            Tree::Position(i) => self.courses[*i],
            Tree::Velocity(i) => [self.courses[*i][1], self.courses[*i][2], 0.0],
            Tree::Call(i) => self.called(*i, name, at)?,
            Tree::Sum(parts) => {
                let mut sum = [0.0; 3];
                for part in parts {
                    let [x, dx, _] = self.course(part, name, at)?;
                    sum = [sum[0] + x, sum[1] + dx, 0.0];
                }
                sum
            }
            Tree::Product(parts) => {
                let mut found = [1.0, 0.0, 0.0];
                for part in parts {
                    found = product(found, self.course(part, name, at)?);
                }
                found
            }
            Tree::Quotient(parts) => {
                let [x, dx, _] = self.course(&parts[0], name, at)?;
                let [y, dy, _] = self.course(&parts[1], name, at)?;
                [x / y, (dx - x / y * dy) / y, 0.0]
            }
            Tree::Norm(part) => {
                let [x, dx, _] = self.course(part, name, at)?;
                [x.abs(), if x < 0.0 { -dx } else { dx }, 0.0]
            }
        })
    }
}

/// A formula with the numbers of its measures, which `follow` gives.
fn planted(
    formula: &Formula,
    name: &str,
    functions: usize,
    follow: &mut dyn FnMut(&Measure, &str) -> Result<usize, DescriptionError>,
) -> Result<Tree, DescriptionError> {
    let mut all = |parts: &[Formula]| {
        let mut found = Vec::with_capacity(parts.len());
        for part in parts {
            found.push(planted(part, name, functions, follow)?);
        }
        Ok::<Vec<Tree>, DescriptionError>(found)
    };
    Ok(match formula {
        Formula::Number(x) => Tree::Number(*x),
        Formula::Time => Tree::Time,
        Formula::Call(i) if *i < functions => Tree::Call(*i),
        Formula::Call(i) => return Err(DescriptionError::new("event", name, format!("there is no function {i}"))),
        Formula::Sum(parts) => Tree::Sum(all(parts)?),
        Formula::Product(parts) => Tree::Product(all(parts)?),
        Formula::Position(measure) => Tree::Position(follow(measure, name)?),
        Formula::Velocity(measure) => Tree::Velocity(follow(measure, name)?),
        Formula::Quotient(parts) => {
            let [a, b] = &**parts;
            Tree::Quotient(Box::new([planted(a, name, functions, follow)?, planted(b, name, functions, follow)?]))
        }
        Formula::Norm(part) => Tree::Norm(Box::new(planted(part, name, functions, follow)?)),
    })
}

impl EventFunctions for MechanismFunctions {
    fn read(&mut self, at: &MotionState, out: &mut [Reading]) -> Result<(), SystemError> {
        self.start.get_or_insert(at.t);
        self.measure(at);
        let (trees, names) = (std::mem::take(&mut self.trees), std::mem::take(&mut self.names));
        let mut read = || {
            for ((out, tree), name) in out.iter_mut().zip(&trees).zip(&names) {
                let [x, rate, _] = self.course(tree, name, at)?;
                if !x.is_finite() {
                    return Err(SystemError::NotFinite { what: format!("event \"{name}\""), t: at.t });
                }
                *out = Reading::new(x, if rate.is_finite() { rate } else { 0.0 });
            }
            Ok(())
        };
        let done = read();
        (self.trees, self.names) = (trees, names);
        done
    }
    fn accept(&mut self, t: f64) {
        for x in &mut self.followed {
            x.last = x.read.iter().rev().find(|read| read.0 == t).copied().or(x.last);
            x.read.clear();
        }
    }
}
