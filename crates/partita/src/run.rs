//! Runs and their results.

use crate::compiled::{Model, State};
use crate::error::Error;
use partita_analysis::AnalysisError;
use partita_analysis::outputs::{self, BODY, Forces, States};
use partita_analysis::run::{Described, Request};
use partita_integrate::simulate::Status;
use partita_system::positions::turns;
use partita_system::prelude::*;
use std::sync::OnceLock;

/// Default number of outputs of a run.
const OUTPUTS: usize = 201;

/// How to simulate: how long, how accurately, by which formulation.
///
/// ```
/// use partita::Simulation;
///
/// let simulation = Simulation::new(2.0).tolerances(1e-10, 1e-12).formulation("wehage-haug").outputs(11);
/// assert_eq!(simulation.request(1.0).t_end, 3.0);
/// ```
#[derive(Clone, Debug)]
pub struct Simulation {
    duration: f64,
    request: Request,
    outputs: usize,
}

impl Simulation {
    /// For a time (s), with 201 outputs, tolerances 1e-8 and 1e-10, by the projective formulation and DOP853.
    ///
    /// ```
    /// assert_eq!(partita::Simulation::new(2.0).request(0.0).formulation, "projective");
    /// ```
    pub fn new(duration: f64) -> Self {
        Self { duration, request: Request::over(0.0, duration), outputs: OUTPUTS }
    }

    /// Relative and absolute tolerance.
    ///
    /// ```
    /// assert_eq!(partita::Simulation::new(2.0).tolerances(1e-6, 1e-8).request(0.0).rtol, 1e-6);
    /// ```
    pub fn tolerances(mut self, rtol: f64, atol: f64) -> Self {
        (self.request.rtol, self.request.atol) = (rtol, atol);
        self
    }

    /// Formulation by its name; an unknown one is refused by the run, with those that there are.
    ///
    /// ```
    /// assert_eq!(partita::Simulation::new(2.0).formulation("multipliers").request(0.0).formulation, "multipliers");
    /// ```
    pub fn formulation(mut self, name: &str) -> Self {
        self.request.formulation = name.into();
        self
    }

    /// Number of outputs, evenly spaced, the start and the end among them.
    ///
    /// ```
    /// assert_eq!(partita::Simulation::new(2.0).outputs(3).times(0.0), [0.0, 1.0, 2.0]);
    /// ```
    pub fn outputs(mut self, count: usize) -> Self {
        self.outputs = count;
        self
    }

    /// Times of the outputs of a run that starts at t0.
    ///
    /// ```
    /// assert_eq!(partita::Simulation::new(2.0).outputs(2).times(1.0), [1.0, 3.0]);
    /// ```
    pub fn times(&self, t0: f64) -> Vec<f64> {
        let last = self.outputs.saturating_sub(1).max(1);
        let at = |i: usize| if i == last { t0 + self.duration } else { t0 + self.duration * i as f64 / last as f64 };
        (0..self.outputs).map(at).collect()
    }

    /// Whether the options are valid.
    pub(crate) fn check(&self) -> Result<(), AnalysisError> {
        let tolerated = |x: f64| x.is_finite() && x > 0.0;
        let (argument, message) = if !tolerated(self.duration) {
            ("duration", format!("the duration is {} s; give a positive, finite number", self.duration))
        } else if !(tolerated(self.request.rtol) && tolerated(self.request.atol)) {
            let both = (self.request.rtol, self.request.atol);
            ("tolerances", format!("rtol = {} and atol = {} must be positive and finite", both.0, both.1))
        } else {
            return Ok(());
        };
        Err(AnalysisError::Argument { argument, message })
    }

    /// All options of a run that starts at t0.
    ///
    /// ```
    /// assert_eq!(partita::Simulation::new(2.0).request(0.0).t_end, 2.0);
    /// ```
    pub fn request(&self, t0: f64) -> Request {
        Request { t0, t_end: t0 + self.duration, ..self.request.clone() }
    }
}

/// A joint at one output.
///
/// ```
/// # let model = partita::Mechanism::new("pendulum").rod("rod", [0.0; 3], [1.0, 0.0, 0.0], 1.0)
/// #     .gravity([0.0, -9.81, 0.0]).revolute("pin", "ground", "rod", [0.0; 3], [0.0, 0.0, 1.0]).compile()?;
/// # let run = model.simulate(&model.assemble(&[])?, &partita::Simulation::new(0.1))?;
/// assert!(run.joint("pin")?[200].position[0] < 0.0);
/// # Ok::<(), partita::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct JointMotion {
    /// Its coordinates (rad, m; a ball: quaternion).
    pub position: Vec<f64>,
    /// Their rates (a ball: angular velocity in the axes of the child).
    pub velocity: Vec<f64>,
}

/// A body at one output, world axes.
///
/// ```
/// # let model = partita::Mechanism::new("pendulum").rod("rod", [0.0; 3], [1.0, 0.0, 0.0], 1.0)
/// #     .gravity([0.0, -9.81, 0.0]).revolute("pin", "ground", "rod", [0.0; 3], [0.0, 0.0, 1.0]).compile()?;
/// # let run = model.simulate(&model.assemble(&[])?, &partita::Simulation::new(0.1))?;
/// assert_eq!(run.body("rod")?[0].rotation[0], [1.0, 0.0, 0.0]);
/// # Ok::<(), partita::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct BodyMotion {
    /// Origin of its frame (m).
    pub position: [f64; 3],
    /// Its axes as columns.
    pub rotation: [[f64; 3]; 3],
    /// Velocity of the origin [m/s].
    pub velocity: [f64; 3],
    /// Angular velocity [rad/s].
    pub angular_velocity: [f64; 3],
}

/// Reaction of a joint on its child at one output, world axes; NaN where it is not determined.
///
/// ```
/// # let model = partita::Mechanism::new("pendulum").rod("rod", [0.0; 3], [1.0, 0.0, 0.0], 1.0)
/// #     .gravity([0.0, -9.81, 0.0]).revolute("pin", "ground", "rod", [0.0; 3], [0.0, 0.0, 1.0]).compile()?;
/// # let run = model.simulate(&model.assemble(&[])?, &partita::Simulation::new(0.1))?;
/// let first = &run.reaction("pin")?[0];
/// assert!((first.force[1] - 9.81 / 4.0).abs() < 1e-9); // a rod let go level weighs a quarter
/// # Ok::<(), partita::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Reaction {
    /// Force (N).
    pub force: [f64; 3],
    /// Moment about the joint's point (N m).
    pub moment: [f64; 3],
}

/// Energies at one output (J).
///
/// ```
/// # let model = partita::Mechanism::new("pendulum").rod("rod", [0.0; 3], [1.0, 0.0, 0.0], 1.0)
/// #     .gravity([0.0, -9.81, 0.0]).revolute("pin", "ground", "rod", [0.0; 3], [0.0, 0.0, 1.0]).compile()?;
/// # let run = model.simulate(&model.assemble(&[])?, &partita::Simulation::new(0.1))?;
/// assert_eq!(run.energy()?[0].kinetic, 0.0);
/// # Ok::<(), partita::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Energy {
    /// Of the motion.
    pub kinetic: f64,
    /// Of gravity and springs.
    pub potential: f64,
}

/// A run: its outputs, and the quantities that are computed from them on request.
///
/// ```
/// # let model = partita::Mechanism::new("pendulum").rod("rod", [0.0; 3], [1.0, 0.0, 0.0], 1.0)
/// #     .gravity([0.0, -9.81, 0.0]).revolute("pin", "ground", "rod", [0.0; 3], [0.0, 0.0, 1.0]).compile()?;
/// let run = model.simulate(&model.assemble(&[])?, &partita::Simulation::new(1.0))?;
/// let total: Vec<f64> = run.energy()?.iter().map(|e| e.kinetic + e.potential).collect();
/// assert!(total.iter().all(|e| (e - total[0]).abs() < 1e-6));
/// # Ok::<(), partita::Error>(())
/// ```
pub struct Run {
    model: Model,
    found: partita_analysis::run::Run,
    times: Vec<f64>,
    /// Coordinates and velocities of all outputs, row by row, turns counted.
    q: Vec<f64>,
    v: Vec<f64>,
    forces: OnceLock<Described>,
}

impl Run {
    pub(crate) fn of(model: Model, found: partita_analysis::run::Run) -> Self {
        let outputs = &found.log.outputs;
        let whole = |q: &[f64], n: &[i32]| q.iter().zip(n).map(|(q, n)| turns::whole(*q, *n)).collect::<Vec<f64>>();
        Self {
            times: outputs.iter().map(|x| x.t).collect(),
            q: outputs.iter().flat_map(|x| whole(&x.q, &x.turns)).collect(),
            v: outputs.iter().flat_map(|x| x.v.iter().copied()).collect(),
            forces: OnceLock::new(),
            model,
            found,
        }
    }

    /// Whether it reached its end with every constraint satisfied at every step.
    ///
    /// ```
    /// # let model = partita::Mechanism::new("pendulum").rod("rod", [0.0; 3], [1.0, 0.0, 0.0], 1.0)
    /// #     .revolute("pin", "ground", "rod", [0.0; 3], [0.0, 0.0, 1.0]).compile()?;
    /// assert!(model.simulate(&model.assemble(&[])?, &partita::Simulation::new(1.0))?.is_success());
    /// # Ok::<(), partita::Error>(())
    /// ```
    pub fn is_success(&self) -> bool {
        self.found.outcome.status == Status::Finished
    }

    /// How it ended, in a sentence.
    ///
    /// ```
    /// # let model = partita::Mechanism::new("pendulum").rod("rod", [0.0; 3], [1.0, 0.0, 0.0], 1.0)
    /// #     .revolute("pin", "ground", "rod", [0.0; 3], [0.0, 0.0, 1.0]).compile()?;
    /// assert!(!model.simulate(&model.assemble(&[])?, &partita::Simulation::new(1.0))?.message().is_empty());
    /// # Ok::<(), partita::Error>(())
    /// ```
    pub fn message(&self) -> &str {
        &self.found.outcome.message
    }

    /// Notes in sentences: coordinates switched, redundant rows removed, singular positions crossed.
    ///
    /// ```
    /// # let model = partita::Mechanism::new("pendulum").rod("rod", [0.0; 3], [1.0, 0.0, 0.0], 1.0)
    /// #     .revolute("pin", "ground", "rod", [0.0; 3], [0.0, 0.0, 1.0]).compile()?;
    /// assert!(model.simulate(&model.assemble(&[])?, &partita::Simulation::new(1.0))?.notes().is_empty());
    /// # Ok::<(), partita::Error>(())
    /// ```
    pub fn notes(&self) -> &[String] {
        &self.found.notes
    }

    /// Times of its outputs (s).
    ///
    /// ```
    /// # let model = partita::Mechanism::new("pendulum").rod("rod", [0.0; 3], [1.0, 0.0, 0.0], 1.0)
    /// #     .revolute("pin", "ground", "rod", [0.0; 3], [0.0, 0.0, 1.0]).compile()?;
    /// assert_eq!(model.simulate(&model.assemble(&[])?, &partita::Simulation::new(1.0))?.times().len(), 201);
    /// # Ok::<(), partita::Error>(())
    /// ```
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// The last output as a state, from which another run can continue.
    ///
    /// ```
    /// # let model = partita::Mechanism::new("pendulum").rod("rod", [0.0; 3], [1.0, 0.0, 0.0], 1.0)
    /// #     .revolute("pin", "ground", "rod", [0.0; 3], [0.0, 0.0, 1.0]).compile()?;
    /// let run = model.simulate(&model.assemble(&[])?, &partita::Simulation::new(1.0))?;
    /// assert_eq!(run.last().unwrap().t, 1.0);
    /// # Ok::<(), partita::Error>(())
    /// ```
    pub fn last(&self) -> Option<State> {
        let size = self.model.inner.size();
        let t = *self.times.last()?;
        let (q, v) = (self.q.len() - size.nq, self.v.len() - size.nv);
        Some(State { t, q: self.q[q..].to_vec(), v: self.v[v..].to_vec() })
    }

    /// The underlying run: log, counters, findings.
    ///
    /// ```
    /// # let model = partita::Mechanism::new("pendulum").rod("rod", [0.0; 3], [1.0, 0.0, 0.0], 1.0)
    /// #     .revolute("pin", "ground", "rod", [0.0; 3], [0.0, 0.0, 1.0]).compile()?;
    /// let run = model.simulate(&model.assemble(&[])?, &partita::Simulation::new(1.0))?;
    /// assert!(run.inner().outcome.counters.steps > 0);
    /// # Ok::<(), partita::Error>(())
    /// ```
    pub fn inner(&self) -> &partita_analysis::run::Run {
        &self.found
    }

    /// The motion of a joint at all outputs, whether or not its coordinates are part of the state.
    ///
    /// # Errors
    /// `Unknown`.
    ///
    /// ```
    /// # let model = partita::Mechanism::new("pendulum").rod("rod", [0.0; 3], [1.0, 0.0, 0.0], 1.0)
    /// #     .revolute("pin", "ground", "rod", [0.0; 3], [0.0, 0.0, 1.0]).compile()?;
    /// let start = model.with_rates(&model.assemble(&[])?, &[("pin", 2.0)])?;
    /// let run = model.simulate(&start, &partita::Simulation::new(1.0))?;
    /// assert!((run.joint("pin")?[200].position[0] - 2.0).abs() < 1e-9);
    /// # Ok::<(), partita::Error>(())
    /// ```
    pub fn joint(&self, name: &str) -> Result<Vec<JointMotion>, Error> {
        let j = self.model.joint(name)?;
        let tables = outputs::joints(&self.model.inner, &self.states(), &[j], &mut never)?;
        let (nq, nv) = (tables[0].len() / self.times.len().max(1), tables[1].len() / self.times.len().max(1));
        let rows = (0..self.times.len()).map(|i| JointMotion {
            position: tables[0][i * nq..][..nq].to_vec(),
            velocity: tables[1][i * nv..][..nv].to_vec(),
        });
        Ok(rows.collect())
    }

    /// The motion of a body at all outputs.
    ///
    /// # Errors
    /// `Unknown`.
    ///
    /// ```
    /// # let model = partita::Mechanism::new("pendulum").rod("rod", [0.0; 3], [1.0, 0.0, 0.0], 1.0)
    /// #     .revolute("pin", "ground", "rod", [0.0; 3], [0.0, 0.0, 1.0]).compile()?;
    /// let start = model.with_rates(&model.assemble(&[])?, &[("pin", 2.0)])?;
    /// let run = model.simulate(&start, &partita::Simulation::new(1.0))?;
    /// assert!((run.body("rod")?[0].angular_velocity[2] - 2.0).abs() < 1e-12);
    /// # Ok::<(), partita::Error>(())
    /// ```
    pub fn body(&self, name: &str) -> Result<Vec<BodyMotion>, Error> {
        let body = self.model.body(name)?;
        let tables = outputs::bodies(&self.model.inner, &self.states(), &[body], &mut never)?;
        let part = |table: usize, i: usize, at: usize| three(&tables[table][i * BODY[table] + at..]);
        let rows = (0..self.times.len()).map(|i| BodyMotion {
            position: part(0, i, 0),
            rotation: [part(1, i, 0), part(1, i, 3), part(1, i, 6)],
            velocity: part(2, i, 0),
            angular_velocity: part(3, i, 0),
        });
        Ok(rows.collect())
    }

    /// Reactions of a joint at all outputs. Redundant joints share the load by their compliances, or by least squares.
    ///
    /// # Errors
    /// `Unknown`; `Analysis` where forces cannot be evaluated.
    ///
    /// ```
    /// # let model = partita::Mechanism::new("pendulum").rod("rod", [0.0; 3], [1.0, 0.0, 0.0], 1.0)
    /// #     .revolute("pin", "ground", "rod", [0.0; 3], [0.0, 0.0, 1.0]).compile()?;
    /// let start = model.with_rates(&model.assemble(&[])?, &[("pin", 2.0)])?;
    /// let run = model.simulate(&start, &partita::Simulation::new(1.0))?;
    /// assert!((run.reaction("pin")?[0].force[0] + 0.5 * 4.0).abs() < 1e-9); // m r w²
    /// # Ok::<(), partita::Error>(())
    /// ```
    pub fn reaction(&self, name: &str) -> Result<Vec<Reaction>, Error> {
        let j = self.model.joint(name)?;
        let known = match self.forces.get() {
            Some(known) => known,
            None => {
                let found = self.found.log.describe(&*self.model.inner, false, &mut never)?;
                self.forces.get_or_init(|| found)
            }
        };
        let forces = Forces { vdot: &known.vdot, multipliers: &known.multipliers };
        let tables = outputs::reaction(&self.model.inner, &self.states(), &forces, j, &mut never)?;
        let row = |i: usize| Reaction { force: three(&tables[0][3 * i..]), moment: three(&tables[1][3 * i..]) };
        Ok((0..self.times.len()).map(row).collect())
    }

    /// Energies at all outputs.
    ///
    /// # Errors
    /// `Analysis` where forces cannot be evaluated.
    ///
    /// ```
    /// # let model = partita::Mechanism::new("pendulum").rod("rod", [0.0; 3], [1.0, 0.0, 0.0], 3.0)
    /// #     .revolute("pin", "ground", "rod", [0.0; 3], [0.0, 0.0, 1.0]).compile()?;
    /// let start = model.with_rates(&model.assemble(&[])?, &[("pin", 2.0)])?;
    /// let run = model.simulate(&start, &partita::Simulation::new(1.0))?;
    /// assert!((run.energy()?[200].kinetic - 0.5 * 1.0 * 4.0).abs() < 1e-9); // m l²/3 = 1
    /// # Ok::<(), partita::Error>(())
    /// ```
    pub fn energy(&self) -> Result<Vec<Energy>, Error> {
        let tables = outputs::energies(&self.model.inner, &self.states(), &mut never)?;
        let rows = tables[0].iter().zip(&tables[1]);
        Ok(rows.map(|(kinetic, potential)| Energy { kinetic: *kinetic, potential: *potential }).collect())
    }

    fn states(&self) -> States<'_> {
        States { t: &self.times, q: &self.q, v: &self.v }
    }
}

/// Computations on a run cannot be interrupted.
fn never() -> Result<(), AnalysisError> {
    Ok(())
}

fn three(x: &[f64]) -> [f64; 3] {
    [x[0], x[1], x[2]]
}
