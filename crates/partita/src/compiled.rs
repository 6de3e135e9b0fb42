//! A compiled mechanism and its states.

use crate::error::Error;
use crate::run::{Run, Simulation};
use partita_analysis::poses::{self, Ask, Goal, Target};
use partita_analysis::{AnalysisError, Mobility, mobility};
use partita_math::tolerance;
use partita_system::prelude::*;
use std::ops::ControlFlow;
use std::sync::Arc;

/// A compiled mechanism. It is immutable; clones share it, also across threads.
///
/// ```
/// use partita::{GROUND, Mechanism};
///
/// let m = Mechanism::new("pendulum").rod("rod", [0.0; 3], [1.0, 0.0, 0.0], 1.0);
/// let model = m.revolute("pin", GROUND, "rod", [0.0; 3], [0.0, 0.0, 1.0]).compile()?;
/// assert_eq!(model.joints(), ["pin"]);
/// # Ok::<(), partita::Error>(())
/// ```
#[derive(Clone)]
pub struct Model {
    pub(crate) inner: Arc<partita_model::Model>,
}

/// A state of a model: everything that a run starts from.
///
/// ```
/// # use partita::{GROUND, Mechanism};
/// # let m = Mechanism::new("pendulum").rod("rod", [0.0; 3], [1.0, 0.0, 0.0], 1.0);
/// # let model = m.revolute("pin", GROUND, "rod", [0.0; 3], [0.0, 0.0, 1.0]).compile()?;
/// let state = model.assemble(&[("pin", 0.5)])?;
/// assert_eq!((state.t, state.q[0], state.v[0]), (0.0, 0.5, 0.0));
/// # Ok::<(), partita::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// Time (s).
    pub t: f64,
    /// Coordinates (nq).
    pub q: Vec<f64>,
    /// Velocities (nv).
    pub v: Vec<f64>,
}

impl Model {
    pub(crate) fn of(inner: partita_model::Model) -> Self {
        Self { inner: Arc::new(inner) }
    }

    /// The model behind this face: rows, recursions, the contract of a constrained system.
    ///
    /// ```
    /// # use partita::{GROUND, Mechanism};
    /// # let m = Mechanism::new("pendulum").rod("rod", [0.0; 3], [1.0, 0.0, 0.0], 1.0);
    /// # let model = m.revolute("pin", GROUND, "rod", [0.0; 3], [0.0, 0.0, 1.0]).compile()?;
    /// use partita::system::prelude::*;
    ///
    /// assert_eq!(model.inner().size().nv, 1);
    /// # Ok::<(), partita::Error>(())
    /// ```
    pub fn inner(&self) -> &partita_model::Model {
        &self.inner
    }

    /// Names of the joints, in the order of the description.
    ///
    /// ```
    /// # use partita::{GROUND, Mechanism};
    /// # let m = Mechanism::new("pendulum").rod("rod", [0.0; 3], [1.0, 0.0, 0.0], 1.0);
    /// # let model = m.revolute("pin", GROUND, "rod", [0.0; 3], [0.0, 0.0, 1.0]).compile()?;
    /// assert_eq!(model.joints(), ["pin"]);
    /// # Ok::<(), partita::Error>(())
    /// ```
    pub fn joints(&self) -> Vec<&str> {
        self.inner.spec.joints.iter().map(|j| j.name.as_str()).collect()
    }

    /// Names of the bodies, in the order of the description.
    ///
    /// ```
    /// # use partita::{GROUND, Mechanism};
    /// # let m = Mechanism::new("pendulum").rod("rod", [0.0; 3], [1.0, 0.0, 0.0], 1.0);
    /// # let model = m.revolute("pin", GROUND, "rod", [0.0; 3], [0.0, 0.0, 1.0]).compile()?;
    /// assert_eq!(model.bodies(), ["rod"]);
    /// # Ok::<(), partita::Error>(())
    /// ```
    pub fn bodies(&self) -> Vec<&str> {
        self.inner.spec.bodies.iter().map(|b| b.name.as_str()).collect()
    }

    /// Degrees of freedom, and which conditions of the joints are redundant and why, at the assembled drawing.
    ///
    /// # Errors
    /// `Analysis` where the loops do not close or the position is singular.
    ///
    /// ```
    /// # use partita::{GROUND, Mechanism};
    /// # let m = Mechanism::new("pendulum").rod("rod", [0.0; 3], [1.0, 0.0, 0.0], 1.0);
    /// # let model = m.revolute("pin", GROUND, "rod", [0.0; 3], [0.0, 0.0, 1.0]).compile()?;
    /// assert_eq!(model.mobility()?.mobility, 1);
    /// # Ok::<(), partita::Error>(())
    /// ```
    pub fn mobility(&self) -> Result<Mobility, Error> {
        let state = self.assemble(&[])?;
        Ok(mobility(&self.inner, state.t, &state.q)?)
    }

    /// Close the loops at t = 0 with these joint coordinates; the others change as little as possible, and only driven
    /// velocities are nonzero. For a joint with several coordinates the value is that of the first.
    ///
    /// # Errors
    /// `Unknown` joints; `Analysis` where the loops do not close or the targets cannot be met, with the remaining
    /// difference.
    ///
    /// ```
    /// # use partita::{GROUND, Mechanism};
    /// # let m = Mechanism::new("pendulum").rod("rod", [0.0; 3], [1.0, 0.0, 0.0], 1.0);
    /// # let model = m.revolute("pin", GROUND, "rod", [0.0; 3], [0.0, 0.0, 1.0]).compile()?;
    /// assert_eq!(model.assemble(&[("pin", -1.0)])?.q, [-1.0]);
    /// assert!(model.assemble(&[("hinge", -1.0)]).unwrap_err().to_string().contains("known: pin"));
    /// # Ok::<(), partita::Error>(())
    /// ```
    pub fn assemble(&self, targets: &[(&str, f64)]) -> Result<State, Error> {
        let ask = Ask { levels: vec![self.targets(targets)?], tolerance: tolerance::CLOSED, ..Ask::default() };
        let found = poses::one(&self.inner, 0.0, &self.inner.initial(), &ask)?;
        let rest = vec![0.0; self.inner.size().nv];
        let v = match self.inner.structure().rheonomic {
            true => poses::with_rates(&self.inner, 0.0, &found.q, &rest, &[], &[])?,
            false => rest,
        };
        Ok(State { t: 0.0, q: found.q, v })
    }

    /// The same position with these joint rates met; the other velocities are the nearest ones in the mass metric.
    ///
    /// # Errors
    /// `Unknown` joints; `Analysis` where the rates are incompatible.
    ///
    /// ```
    /// # use partita::{GROUND, Mechanism};
    /// # let m = Mechanism::new("pendulum").rod("rod", [0.0; 3], [1.0, 0.0, 0.0], 1.0);
    /// # let model = m.revolute("pin", GROUND, "rod", [0.0; 3], [0.0, 0.0, 1.0]).compile()?;
    /// let start = model.with_rates(&model.assemble(&[])?, &[("pin", 6.0)])?;
    /// assert!((start.v[0] - 6.0).abs() < 1e-12);
    /// # Ok::<(), partita::Error>(())
    /// ```
    pub fn with_rates(&self, state: &State, rates: &[(&str, f64)]) -> Result<State, Error> {
        self.fits(state)?;
        let rates = self.targets(rates)?;
        let v = poses::with_rates(&self.inner, state.t, &state.q, &state.v, &[], &rates)?;
        Ok(State { v, ..state.clone() })
    }

    /// Simulate from a state. A run that ends early is a run too, with its results so far and the reason.
    ///
    /// # Errors
    /// `Analysis` where the state does not belong to this model, an option is invalid or the run cannot start.
    ///
    /// ```
    /// # use partita::{GROUND, Mechanism, Simulation};
    /// # let m = Mechanism::new("pendulum").rod("rod", [0.0; 3], [1.0, 0.0, 0.0], 1.0).gravity([0.0, -9.81, 0.0]);
    /// # let model = m.revolute("pin", GROUND, "rod", [0.0; 3], [0.0, 0.0, 1.0]).compile()?;
    /// let run = model.simulate(&model.assemble(&[])?, &Simulation::new(1.0))?;
    /// assert!(run.is_success());
    /// let other = partita::State { t: 0.0, q: vec![0.0, 1.0], v: vec![f64::NAN] };
    /// assert!(model.simulate(&other, &Simulation::new(1.0)).is_err());
    /// assert!(model.simulate(&model.assemble(&[])?, &Simulation::new(-1.0)).is_err());
    /// assert!(model.simulate(&model.assemble(&[])?, &Simulation::new(1.0).tolerances(f64::NAN, 1e-8)).is_err());
    /// # Ok::<(), partita::Error>(())
    /// ```
    pub fn simulate(&self, start: &State, simulation: &Simulation) -> Result<Run, Error> {
        self.simulate_while(start, simulation, &mut |_| true)
    }

    /// As `simulate`, as long as `go_on` returns true; it is called after every step with the time.
    ///
    /// # Errors
    /// As [`simulate`](Self::simulate).
    ///
    /// ```
    /// # use partita::{GROUND, Mechanism, Simulation};
    /// # let m = Mechanism::new("pendulum").rod("rod", [0.0; 3], [1.0, 0.0, 0.0], 1.0).gravity([0.0, -9.81, 0.0]);
    /// # let model = m.revolute("pin", GROUND, "rod", [0.0; 3], [0.0, 0.0, 1.0]).compile()?;
    /// let run = model.simulate_while(&model.assemble(&[])?, &Simulation::new(10.0), &mut |t| t < 0.5)?;
    /// assert!(!run.is_success() && run.times().last().unwrap() < &10.0);
    /// # Ok::<(), partita::Error>(())
    /// ```
    pub fn simulate_while(
        &self,
        start: &State,
        simulation: &Simulation,
        go_on: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Run, Error> {
        self.fits(start)?;
        simulation.check()?;
        let request = simulation.request(start.t);
        let times = simulation.times(start.t);
        let mut watch = |t: f64| if go_on(t) { ControlFlow::Continue(()) } else { ControlFlow::Break(()) };
        let state = (&start.q[..], &start.v[..]);
        let found = partita_analysis::run::run(&*self.inner, &request, None, &times, state, &mut watch)?;
        Ok(Run::of(self.clone(), found))
    }

    /// Whether it is a state of this model.
    fn fits(&self, state: &State) -> Result<(), Error> {
        let size = self.inner.size();
        let finite = state.t.is_finite() && state.q.iter().chain(&state.v).all(|x| x.is_finite());
        if (state.q.len(), state.v.len()) == (size.nq, size.nv) && finite {
            return Ok(());
        }
        let message = format!(
            "the state has {} coordinates and {} velocities{}; this model has {} and {}: take one from assemble()",
            state.q.len(),
            state.v.len(),
            if finite { "" } else { ", not all of them finite" },
            size.nq,
            size.nv
        );
        Err(AnalysisError::Argument { argument: "state", message }.into())
    }

    fn targets(&self, named: &[(&str, f64)]) -> Result<Vec<(Target, f64)>, Error> {
        let all = named.iter().map(|(name, value)| {
            let joint = self.joint(name)?;
            Ok((Target::new(&self.inner, &Goal::Joint { joint, coordinate: 0 }, name)?, *value))
        });
        all.collect()
    }

    pub(crate) fn joint(&self, name: &str) -> Result<usize, Error> {
        index_of("joint", name, &self.joints())
    }

    pub(crate) fn body(&self, name: &str) -> Result<usize, Error> {
        index_of("body", name, &self.bodies())
    }
}

fn index_of(kind: &'static str, name: &str, known: &[&str]) -> Result<usize, Error> {
    let unknown = || Error::Unknown { kind, name: name.into(), known: known.join(", ") };
    known.iter().position(|x| *x == name).ok_or_else(unknown)
}
