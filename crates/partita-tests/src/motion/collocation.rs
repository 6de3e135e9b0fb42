//! A second method behind the contract of a stepper: Gauss collocation, implicit, with dense output by its polynomial. The
//! march knows nothing of it, and steps, changes of coordinates, closed outputs and passages come out as by any method.

use crate::linkages::four_bar;
use crate::planar::{chain, upright_angle};
use partita_integrate::counters::Counters;
use partita_integrate::failure::StepFailure;
use partita_integrate::method::{self, Method};
use partita_integrate::ode::{Ode, RhsError};
use partita_integrate::options::{AbsoluteTolerance, Options, OptionsError};
use partita_integrate::simulate::{simulate, Outcome, Settings, Status};
use partita_integrate::stepper::{Conclusion, CurrentStep, StepControl, StepEnd, StepPlan, StepStorage, Stepper};
use partita_model::Model;
use partita_system::formulation::motion::Projective;
use partita_system::kinematics::velocity;
use partita_system::options::FormulationOptions;
use partita_system::positions::turns;
use partita_system::prelude::*;
use partita_system::record::Output;
use partita_system::reduction::Reduction;
use partita_system::start;
use partita_system::SystemError;
use std::fmt::Display;
use std::ops::ControlFlow;

/// Three Gauss nodes: order six at the end of a step, four inside it.
#[derive(Debug)]
struct Gauss;

/// 0.5 - sqrt(15) / 10 and its mirror image.
const NODES: [f64; 3] = [0.112_701_665_379_258_31, 0.5, 0.887_298_334_620_741_7];
const WEIGHTS: [f64; 3] = [5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0];

impl Method for Gauss {
    fn name(&self) -> &'static str {
        "gauss6"
    }
    fn stepper(&'static self, dim: usize, options: Options) -> Result<Box<dyn Stepper<SystemError>>, OptionsError> {
        options.check(dim)?;
        Ok(Box::new(Collocation::new(dim, options)))
    }
}

/// Lagrange polynomials of the nodes.
fn lagrange(x: f64) -> [f64; 3] {
    std::array::from_fn(|j| (0..3).filter(|&i| i != j).map(|i| (x - NODES[i]) / (NODES[j] - NODES[i])).product::<f64>())
}

/// Their integrals from 0 to x, by the quadrature of the nodes, which is exact for them.
fn integrals(x: f64) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for (c, b) in NODES.iter().zip(WEIGHTS) {
        sum.iter_mut().zip(lagrange(x * c)).for_each(|(s, l)| *s += x * b * l);
    }
    sum
}

#[derive(Debug)]
struct Collocation {
    options: Options,
    t: [f64; 3], // old, new, end
    y_old: Vec<f64>,
    dy_old: Vec<f64>,
    y_new: Vec<f64>,
    dy_new: Vec<f64>,
    /// What the end was corrected by.
    shift: Vec<f64>,
    stage: Vec<f64>,
    slopes: [Vec<f64>; 3],
    sizes: Vec<f64>,
    step: f64,
    goal: Option<f64>,
    error: f64,
    counters: Counters,
}

impl Collocation {
    fn new(dim: usize, options: Options) -> Self {
        let zeros = || vec![0.0; dim];
        Self {
            t: [0.0; 3],
            y_old: zeros(),
            dy_old: zeros(),
            y_new: zeros(),
            dy_new: zeros(),
            shift: zeros(),
            stage: zeros(),
            slopes: [zeros(), zeros(), zeros()],
            sizes: vec![1.0; dim],
            step: options.fixed_step.unwrap_or(1e-3),
            goal: None,
            error: 0.0,
            counters: Counters::default(),
            options,
        }
    }

    fn at(&self, h: f64, x: f64, out: &mut [f64]) {
        let weights = integrals(x);
        for (i, out) in out.iter_mut().enumerate() {
            *out = self.y_old[i] + h * (0..3).map(|j| weights[j] * self.slopes[j][i]).sum::<f64>();
        }
    }

    /// Stages by iteration until they change by rounding alone.
    fn solve<E: Display>(&mut self, ode: &mut dyn Ode<Error = E>, h: f64) -> Result<(), RhsError<E>> {
        for slopes in &mut self.slopes {
            slopes.copy_from_slice(&self.dy_old);
        }
        for _ in 0..40 {
            let mut change = 0.0_f64;
            for (j, c) in NODES.iter().enumerate() {
                let mut stage = std::mem::take(&mut self.stage);
                self.at(h, *c, &mut stage);
                let done = ode.rhs(self.t[0] + c * h, &stage, &mut self.dy_new);
                self.stage = stage;
                self.counters.evaluations += 1;
                done?;
                for (k, new) in self.slopes[j].iter_mut().zip(&self.dy_new) {
                    change = change.max((*k - new).abs() / (1.0 + new.abs()));
                    *k = *new;
                }
            }
            if change < 1e-14 {
                break;
            }
        }
        Ok(())
    }

    /// Error of the polynomial's slope at the start, in tolerances: of third order in h.
    fn estimate(&self, h: f64) -> f64 {
        let weights = lagrange(0.0);
        let AbsoluteTolerance::Same(atol) = self.options.atol else { return f64::NAN };
        (0..self.y_old.len().min(self.options.controlled)).fold(0.0, |worst: f64, i| {
            let off = (0..3).map(|j| weights[j] * self.slopes[j][i]).sum::<f64>() - self.dy_old[i];
            let tolerance = atol * self.sizes[i] + self.options.rtol * self.y_old[i].abs().max(self.y_new[i].abs());
            worst.max((h * off).abs() / tolerance)
        })
    }

    fn shorten<E: Display>(&mut self, h: f64, factor: f64, last: Option<E>) -> Result<(), StepFailure<E>> {
        self.counters.rejected += 1;
        self.step = h.abs() * factor;
        match self.step < 1e-14 {
            true => Err(StepFailure::TooSmall { t: self.t[0], h: self.step, last }),
            false => Ok(()),
        }
    }
}

impl StepControl for Collocation {
    fn current(&self) -> CurrentStep<'_> {
        CurrentStep {
            t_old: self.t[0],
            t_new: self.t[1],
            t_end: self.t[2],
            y_old: &self.y_old,
            dy_old: &self.dy_old,
            y_new: &self.y_new,
            dy_new: &self.dy_new,
            next: self.step,
            may_shrink: self.step > 1e-12,
        }
    }
    fn counters(&self) -> &Counters {
        &self.counters
    }
    fn plan(&mut self, plan: &StepPlan) {
        (self.step, self.goal) = (plan.length, plan.goal);
    }
    fn set_sizes(&mut self, sizes: &[f64]) {
        self.sizes.copy_from_slice(sizes);
    }
    fn replace_start(&mut self, t: f64, y: &[f64], dy: &[f64]) {
        self.t[0] = t;
        self.y_old.copy_from_slice(y);
        self.dy_old.copy_from_slice(dy);
    }
    fn commit(&mut self) {
        let h = self.t[1] - self.t[0];
        self.t[0] = self.t[1];
        std::mem::swap(&mut self.y_old, &mut self.y_new);
        std::mem::swap(&mut self.dy_old, &mut self.dy_new);
        self.step = self.options.fixed_step.unwrap_or((0.9 * h * self.error.powf(-0.25)).clamp(0.2 * h, 5.0 * h));
        self.goal = None;
        self.counters.steps += 1;
    }
    fn reject(&mut self, factor: f64) {
        self.step = factor * (self.t[1] - self.t[0]);
        self.counters.rejected += 1;
    }
    fn end_at(&mut self, t: f64) {
        self.goal = Some(t);
        self.counters.rejected += 1;
    }
}

impl StepStorage for Collocation {}

impl<E: Display> Stepper<E> for Collocation {
    fn start(&mut self, ode: &mut dyn Ode<Error = E>, t: f64, y: &[f64], t_end: f64) -> Result<(), StepFailure<E>> {
        self.t = [t, t, t_end];
        self.y_old.copy_from_slice(y);
        self.counters.evaluations += 1;
        match ode.rhs(t, y, &mut self.dy_old) {
            Ok(()) => Ok(()),
            Err(RhsError::Retry(error) | RhsError::Fatal(error)) => Err(StepFailure::Rhs { t, error }),
        }
    }

    fn attempt(&mut self, ode: &mut dyn Ode<Error = E>) -> Result<(), StepFailure<E>> {
        loop {
            let goal = self.goal.map_or(self.t[2], |goal| goal.min(self.t[2]));
            let rest = goal - self.t[0];
            let (h, t) = if rest <= 1.01 * self.step { (rest, goal) } else { (self.step, self.t[0] + self.step) };
            match self.solve(ode, h) {
                Ok(()) => {}
                Err(RhsError::Retry(error)) => {
                    self.shorten(h, 0.6, Some(error))?;
                    continue;
                }
                Err(RhsError::Fatal(error)) => return Err(StepFailure::Rhs { t, error }),
            }
            let mut end = std::mem::take(&mut self.y_new);
            self.at(h, 1.0, &mut end);
            self.y_new = end;
            self.shift.copy_from_slice(&self.y_new);
            self.error = if self.options.fixed_step.is_some() { 0.0 } else { self.estimate(h) };
            if self.error <= 1.0 {
                self.t[1] = t;
                return Ok(());
            }
            self.shorten(h, (0.9 * self.error.powf(-0.25)).max(0.2), None)?;
        }
    }

    fn conclude(&mut self, end: StepEnd<'_, E>) -> Result<Conclusion, StepFailure<E>> {
        let t = self.t[1];
        match end(t, &mut self.y_new, &mut self.dy_new, false) {
            Ok(evaluated) => self.counters.evaluations += u64::from(evaluated),
            Err(RhsError::Retry(error)) => {
                self.shorten(t - self.t[0], 0.6, Some(error))?;
                return Ok(Conclusion::Rejected);
            }
            Err(RhsError::Fatal(error)) => return Err(StepFailure::Rhs { t, error }),
        }
        self.shift.iter_mut().zip(&self.y_new).for_each(|(s, y)| *s = y - *s);
        Ok(Conclusion::Done)
    }

    fn interpolate(&mut self, _: &mut dyn Ode<Error = E>, t: f64, out: &mut [f64]) -> Result<(), StepFailure<E>> {
        let h = self.t[1] - self.t[0];
        let x = (t - self.t[0]) / h;
        self.at(h, x, out);
        out.iter_mut().zip(&self.shift).for_each(|(out, s)| *out += x * s);
        Ok(())
    }
}

fn run(
    model: &Model,
    joint: &str,
    rate: f64,
    at: &[f64],
    method: &'static dyn Method,
    options: Options,
) -> (Vec<Output>, Outcome) {
    let q = model.initial();
    let found = start::analyse(model, 0.0, &q).unwrap();
    let driven = model.structure().velocities.iter().position(|v| &*v.name == joint).unwrap();
    let mut r = Reduction::new(model, found.rank);
    start::choose_partition(&mut r, 0.0, &q, None, None).unwrap();
    let v = velocity::with_rates(&mut r, 0.0, &q, &[(driven, rate)]).unwrap();
    let mut f = Projective::new(model, found.rank, &FormulationOptions::default());
    let settings = Settings { t_end: *at.last().unwrap(), method, options, max_steps: 20_000 };
    let mut outputs = Vec::new();
    let mut sink = |output: &Output| {
        outputs.push(output.clone());
        Ok(())
    };
    let outcome = simulate(&mut f, 0.0, &q, &v, at, &settings, &mut sink, &mut |_| ControlFlow::Continue(())).unwrap();
    assert_eq!(outcome.status, Status::Finished, "{}", outcome.message);
    (outputs, outcome)
}

fn apart(x: &Output, y: &Output) -> f64 {
    x.q.iter().zip(&y.q).chain(x.v.iter().zip(&y.v)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn dop853() -> (&'static dyn Method, Options) {
    (method::by_name("dop853").unwrap(), Options { rtol: 1e-13, atol: 1e-13.into(), ..Options::default() })
}

#[test]
fn a_march_of_the_four_bar_has_the_order_of_collocation() {
    let model = four_bar([1.0, 0.4, 0.9, 0.8], 0.8, 1.0).model();
    let joint = model.structure().velocity_name(0);
    // at the end of a step, and at the same part of the one that follows it
    let steps = [0.025, 0.0125];
    let at = |h: f64| [0.75, 0.75 + 0.3 * h];
    let errors = steps.map(|h| {
        let (method, options) = dop853();
        let (exact, _) = run(&model, &joint, 3.0, &at(h), method, options);
        let options = Options { fixed_step: Some(h), ..Options::default() };
        let [one, two] = at(h);
        let (outputs, _) = run(&model, &joint, 3.0, &[one, two, 0.8], &Gauss, options);
        [0, 1].map(|i| apart(&outputs[i], &exact[i]))
    });
    for (i, order) in [6.0, 4.0].into_iter().enumerate() {
        let slope = (errors[0][i] / errors[1][i]).log2();
        assert!(errors[1][i] > 1e-13, "{errors:?}");
        assert!((slope - order).abs() < 0.5, "order {slope} of {order}: {errors:?}");
    }
}

#[test]
fn steps_chosen_by_another_estimate_change_coordinates_and_keep_the_tolerance() {
    let model = four_bar([1.0, 0.4, 0.9, 0.8], 0.8, 1.0).model();
    let joint = model.structure().velocity_name(0);
    let at: Vec<f64> = (0..=20).map(|i| 0.2 * f64::from(i)).collect();
    let (method, options) = dop853();
    let (exact, other) = run(&model, &joint, 3.0, &at, method, options);
    let options = Options { rtol: 1e-8, atol: 1e-10.into(), ..Options::default() };
    let (outputs, outcome) = run(&model, &joint, 3.0, &at, &Gauss, options);
    assert!(outcome.counters.steps > 50 && other.counters.steps > 20);
    for (x, y) in outputs.iter().zip(&exact) {
        assert!(apart(x, y) < 1e-6, "{:e} at {}", apart(x, y), x.t);
    }
}

#[test]
fn singular_positions_are_crossed_between_steps_of_any_method() {
    let loops = 2;
    let model = chain(loops);
    let (t_end, rate) = (3.0, 1.237);
    let options = Options { rtol: 1e-8, atol: 1e-10.into(), ..Options::default() };
    let (outputs, outcome) = run(&model, "P0", -rate, &[t_end], &Gauss, options);
    let upright = model.structure().velocities.iter().position(|v| &*v.name == "P0").unwrap();
    let reached = turns::whole(outputs[0].q[upright], outputs[0].turns[upright]);
    let exact = upright_angle(loops, rate, &[t_end])[0];
    assert!(outcome.crossings.count() >= 2, "{:?}", outcome.crossings);
    assert!((reached + exact).abs() < 1e-5, "{reached} of {}", -exact);
}
