//! Measured orders on the Kepler problem, whose solution is known in closed form.

use crate::problems::{conclude, distance, finish, Closure, Kepler};
use partita_integrate::explicit_rk::ExplicitRungeKutta;
use partita_integrate::implicit_rk::Radau;
use partita_integrate::options::Options;
use partita_integrate::stepper::{Conclusion, StepControl, Stepper};
use partita_integrate::tableau::{Tableau, METHODS};

fn fixed(method: &'static Tableau, h: f64) -> ExplicitRungeKutta {
    ExplicitRungeKutta::new(method, 4, Options { fixed_step: Some(h), ..Options::default() }).unwrap()
}

/// Distance from the exact state at t = 4 after `steps` equal steps.
fn error_at_the_end(method: &'static Tableau, steps: u32) -> f64 {
    let mut stepper = fixed(method, 4.0 / f64::from(steps));
    stepper.start(&mut Kepler, 0.0, &Kepler::at(0.0), 4.0).unwrap();
    while !stepper.current().finished() {
        stepper.attempt(&mut Kepler).unwrap();
        assert_eq!(conclude(&mut stepper, &mut Kepler), Ok(Conclusion::Done));
        stepper.commit();
    }
    assert_eq!(stepper.counters().steps, u64::from(steps));
    distance(stepper.current().y_old, &Kepler::at(4.0))
}

/// Largest error of dense output inside one single step of length `h` from the exact state at t = 3, where the
/// planet is slow and the leading term of the error rules.
fn error_inside_a_step(method: &'static Tableau, h: f64) -> f64 {
    let mut stepper = fixed(method, h);
    stepper.start(&mut Kepler, 3.0, &Kepler::at(3.0), 3.0 + h).unwrap();
    stepper.attempt(&mut Kepler).unwrap();
    assert_eq!(conclude(&mut stepper, &mut Kepler), Ok(Conclusion::Done));
    let mut largest = 0.0_f64;
    let mut y = [0.0; 4];
    for i in 0..=20 {
        let t = 3.0 + h * f64::from(i) / 20.0;
        stepper.interpolate(&mut Kepler, t, &mut y).unwrap();
        largest = largest.max(distance(&y, &Kepler::at(t)));
    }
    largest
}

#[test]
fn error_falls_with_the_order_on_the_label() {
    for method in METHODS {
        // step numbers where the leading term dominates and round-off (1e-15) is far below
        let steps = match method.order {
            3 => [512, 1024],
            4 => [128, 256],
            5 => [192, 384],
            _ => [48, 96],
        };
        let errors = steps.map(|n| error_at_the_end(method, n));
        let slope = (errors[0] / errors[1]).log2();
        assert!((slope - method.order as f64).abs() < 0.2, "{}: {errors:?}, {slope}", method.name);
    }
}

#[test]
fn dense_output_error_falls_one_order_above_the_label() {
    for method in METHODS {
        let h = if method.dense.order > 4 { [0.4, 0.2] } else { [0.1, 0.05] };
        let errors = h.map(|h| error_inside_a_step(method, h));
        let slope = (errors[0] / errors[1]).log2();
        let order = method.dense.order as f64 + 1.0;
        assert!((slope - order).abs() < 0.2, "{}: {errors:?}, {slope}", method.name);
    }
}

#[test]
fn global_error_follows_the_tolerance() {
    for method in METHODS.into_iter().filter(|method| method.error_order > 0) {
        for rtol in [1e-4, 1e-7, 1e-10] {
            let options = Options { rtol, atol: rtol.into(), ..Options::default() };
            let mut stepper = ExplicitRungeKutta::new(method, 4, options).unwrap();
            stepper.start(&mut Kepler, 0.0, &Kepler::at(0.0), 6.0).unwrap();
            while !stepper.current().finished() {
                stepper.attempt(&mut Kepler).unwrap();
                assert_eq!(conclude(&mut stepper, &mut Kepler), Ok(Conclusion::Done));
                stepper.commit();
            }
            // the orbit multiplies an early error by about the time that follows it, the steps add theirs
            let error = distance(stepper.current().y_old, &Kepler::at(6.0));
            assert!(error < 100.0 * rtol, "{} at {rtol:e}: {error:e}", method.name);
        }
    }
}

/// An integral of time alone is a quadrature: a method of order p is exact for t^(p-1), if its stages are where they should be.
#[test]
fn integrals_of_polynomials_are_exact() {
    for method in METHODS {
        let p = method.order as i32;
        let f = move |t: f64, _: &[f64], dy: &mut [f64]| {
            dy[0] = f64::from(p) * t.powi(p - 1);
            Ok(())
        };
        let mut ode = Closure { dim: 1, f };
        let options = Options { fixed_step: Some(0.25), ..Options::default() };
        let mut stepper = ExplicitRungeKutta::new(method, 1, options).unwrap();
        stepper.start(&mut ode, 0.5, &[0.5_f64.powi(p)], 1.5).unwrap();
        finish(&mut stepper, &mut ode).unwrap();
        // coefficients of up to 12 with sixteen digits, twelve stages, four steps
        let (y, exact) = (stepper.current().y_old[0], 1.5_f64.powi(p));
        assert!((y - exact).abs() < 1e-13 * exact, "{}: {y} instead of {exact}", method.name);
    }
}

/// One step, or all of them, by Radau IIA.
fn implicit(h: f64, t: f64, t_end: f64) -> Radau {
    let options = Options { fixed_step: Some(h), rtol: 1e-12, atol: 1e-12.into(), ..Options::default() };
    let mut stepper = Radau::new(4, options).unwrap();
    stepper.start(&mut Kepler, t, &Kepler::at(t), t_end).unwrap();
    stepper
}

#[test]
fn radau_has_order_five_and_its_dense_output_too() {
    let errors = [64, 128].map(|n| {
        let mut stepper = implicit(4.0 / f64::from(n), 0.0, 4.0);
        while !stepper.current().finished() {
            stepper.attempt(&mut Kepler).unwrap();
            assert_eq!(conclude(&mut stepper, &mut Kepler), Ok(Conclusion::Done));
            stepper.commit();
        }
        distance(stepper.current().y_old, &Kepler::at(4.0))
    });
    let slope = (errors[0] / errors[1]).log2();
    assert!((slope - 5.0).abs() < 0.3, "{errors:?}, {slope}");
    let errors = [0.2, 0.1].map(|h| {
        let mut stepper = implicit(h, 3.0, 3.0 + h);
        stepper.attempt(&mut Kepler).unwrap();
        assert_eq!(conclude(&mut stepper, &mut Kepler), Ok(Conclusion::Done));
        let mut y = [0.0; 4];
        (0..=20).fold(0.0, |largest: f64, i| {
            let t = 3.0 + h * f64::from(i) / 20.0;
            stepper.interpolate(&mut Kepler, t, &mut y).unwrap();
            largest.max(distance(&y, &Kepler::at(t)))
        })
    });
    let slope = (errors[0] / errors[1]).log2();
    assert!((slope - 5.0).abs() < 0.4, "{errors:?}, {slope}");
}

#[test]
fn the_error_of_radau_follows_the_tolerance_and_its_work_the_sixth_root() {
    let mut work = Vec::new();
    for rtol in [1e-5, 1e-8, 1e-11] {
        let options = Options { rtol, atol: rtol.into(), ..Options::default() };
        let mut stepper = Radau::new(4, options).unwrap();
        stepper.start(&mut Kepler, 0.0, &Kepler::at(0.0), 6.0).unwrap();
        while !stepper.current().finished() {
            stepper.attempt(&mut Kepler).unwrap();
            assert_eq!(conclude(&mut stepper, &mut Kepler), Ok(Conclusion::Done));
            stepper.commit();
        }
        let error = distance(stepper.current().y_old, &Kepler::at(6.0));
        assert!(error < 300.0 * rtol && error > 1e-3 * rtol, "{rtol}: {error}");
        work.push(stepper.counters().steps as f64);
    }
    // an estimate of order three would take ten times the steps for six digits more
    assert!(work[2] / work[1] < 4.5, "{work:?}");
}
