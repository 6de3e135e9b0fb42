//! Equations shared by the tests.
#![allow(dead_code, reason = "each test file uses its own part")]

use partita_integrate::failure::StepFailure;
use partita_integrate::ode::{Ode, RhsError};
use partita_integrate::stepper::{Conclusion, StepControl, StepPlan, Stepper};
use std::fmt::Display;

/// A planet on an ellipse of eccentricity 0.3: x, y and their rates.
pub struct Kepler;

impl Kepler {
    /// The state at `t`, from Kepler's equation.
    pub fn at(t: f64) -> [f64; 4] {
        let e = 0.3_f64;
        let mut anomaly = t;
        for _ in 0..50 {
            anomaly -= (anomaly - e * anomaly.sin() - t) / (1.0 - e * anomaly.cos());
        }
        let (sin, cos) = anomaly.sin_cos();
        let (minor, rate) = ((1.0 - e * e).sqrt(), 1.0 / (1.0 - e * cos));
        [cos - e, minor * sin, -rate * sin, rate * minor * cos]
    }
}

impl Ode for Kepler {
    type Error = std::convert::Infallible;

    fn dim(&self) -> usize {
        4
    }

    fn rhs(&mut self, _: f64, y: &[f64], dy: &mut [f64]) -> Result<(), RhsError<Self::Error>> {
        let cube = (y[0] * y[0] + y[1] * y[1]).sqrt().powi(3);
        dy.copy_from_slice(&[y[2], y[3], -y[0] / cube, -y[1] / cube]);
        Ok(())
    }
}

/// `y' = −rate y`.
pub struct Decay(pub f64);

impl Ode for Decay {
    type Error = &'static str;

    fn dim(&self) -> usize {
        1
    }

    fn rhs(&mut self, _: f64, y: &[f64], dy: &mut [f64]) -> Result<(), RhsError<Self::Error>> {
        dy[0] = -self.0 * y[0];
        Ok(())
    }
}

/// Any closure `f(t, y, dy)` of one dimension or more.
pub struct Closure<F> {
    pub dim: usize,
    pub f: F,
}

impl<F> Ode for Closure<F>
where
    F: FnMut(f64, &[f64], &mut [f64]) -> Result<(), RhsError<&'static str>>,
{
    type Error = &'static str;

    fn dim(&self) -> usize {
        self.dim
    }

    fn rhs(&mut self, t: f64, y: &[f64], dy: &mut [f64]) -> Result<(), RhsError<&'static str>> {
        (self.f)(t, y, dy)
    }
}

/// Largest difference of two states.
pub fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Evaluate the slope at the end of an attempted step, where it is not known, without a correction.
pub fn conclude<E: Display>(
    stepper: &mut dyn Stepper<E>,
    ode: &mut dyn Ode<Error = E>,
) -> Result<Conclusion, StepFailure<E>> {
    stepper.conclude(&mut |t, y, dy, known| if known { Ok(false) } else { ode.rhs(t, y, dy).map(|()| true) })
}

/// Have the next step end at the first of these ascending times that lies ahead, if it would go beyond.
pub fn aim_at_next<S: StepControl + ?Sized>(stepper: &mut S, times: &[f64]) {
    let now = stepper.current();
    let (from, to) = (now.t_old.min(now.t_end), now.t_old.max(now.t_end));
    let between = || times.iter().copied().filter(|t| (from..=to).contains(t) && *t != now.t_old);
    let goal = if now.t_end > now.t_old { between().next() } else { between().next_back() };
    let length = now.next;
    stepper.plan(&StepPlan { length, goal });
}

/// March to the end without corrections.
pub fn finish<E: Display>(stepper: &mut dyn Stepper<E>, ode: &mut dyn Ode<Error = E>) -> Result<(), StepFailure<E>> {
    finish_by_way_of(stepper, ode, &[])
}

/// As `finish`, with steps that end at these times.
pub fn finish_by_way_of<E: Display>(
    stepper: &mut dyn Stepper<E>,
    ode: &mut dyn Ode<Error = E>,
    times: &[f64],
) -> Result<(), StepFailure<E>> {
    while !stepper.current().finished() {
        aim_at_next(stepper, times);
        stepper.attempt(ode)?;
        if conclude(stepper, ode)? == Conclusion::Done {
            stepper.commit();
        }
    }
    Ok(())
}
