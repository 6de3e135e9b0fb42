//! The cycle of the stepper: exact counts, ends met exactly, obstacles, corrections, continuation.

use crate::problems::{conclude, distance, finish, Closure, Decay, Kepler};
use partita_integrate::explicit_rk::ExplicitRungeKutta;
use partita_integrate::failure::StepFailure;
use partita_integrate::ode::{Ode, RhsError};
use partita_integrate::options::{AbsoluteTolerance, Options, OptionsError};
use partita_integrate::step_size::{StepController, LARGEST_FACTOR, SAFETY, SMALLEST_FACTOR};
use partita_integrate::stepper::{Conclusion, StepControl, Stepper};
use partita_integrate::tableau::{by_name, Tableau, DOP853, DOPRI5, METHODS, RK4, TSIT5};

fn adaptive() -> impl Iterator<Item = &'static Tableau> {
    METHODS.into_iter().filter(|method| method.error_order > 0)
}

/// A tolerance that a method is made for, at which steps are long enough for some to be refused.
fn usual(method: &Tableau) -> f64 {
    if method.order > 3 {
        1e-6
    } else {
        1e-3
    }
}

fn tolerance(rtol: f64) -> Options {
    Options { rtol, atol: rtol.into(), ..Options::default() }
}

#[test]
fn every_evaluation_is_counted() {
    for method in adaptive() {
        let mut calls = 0;
        let mut ode = Closure {
            dim: 4,
            f: |t: f64, y: &[f64], dy: &mut [f64]| {
                calls += 1;
                partita_integrate::ode::Ode::rhs(&mut Kepler, t, y, dy).map_err(|_| RhsError::Fatal("never"))
            },
        };
        let mut stepper = ExplicitRungeKutta::new(method, 4, tolerance(usual(method))).unwrap();
        stepper.start(&mut ode, 0.0, &Kepler::at(0.0), 20.0).unwrap();
        let mut out = [0.0; 4];
        while !stepper.current().finished() {
            stepper.attempt(&mut ode).unwrap();
            assert_eq!(conclude(&mut stepper, &mut ode), Ok(Conclusion::Done));
            let middle = 0.5 * (stepper.current().t_old + stepper.current().t_new);
            stepper.interpolate(&mut ode, middle, &mut out).unwrap();
            stepper.interpolate(&mut ode, middle, &mut out).unwrap();
            stepper.commit();
        }
        let done = *stepper.counters();
        let attempts = done.steps + done.rejected;
        let concluding = if method.fsal { 0 } else { done.steps };
        // the first stage of an attempt is the last slope of the step before; two evaluations choose the first step
        assert_eq!(done.evaluations, 2 + attempts * (method.stages as u64 - 1) + concluding, "{}", method.name);
        assert_eq!(done.dense_evaluations, done.steps * method.dense.nodes.len() as u64, "{}", method.name);
        assert_eq!(calls, done.evaluations + done.dense_evaluations, "{}", method.name);
        assert!(done.rejected > 0 && done.retries == 0 && done.not_finite == 0, "{}: {done:?}", method.name);
    }
}

#[test]
fn a_small_problem_costs_what_it_always_cost() {
    // `y' = −y` over one second at 1e-8; a change of these numbers is a change of the controller or of a table
    let mut seen = vec![];
    for method in adaptive() {
        let mut stepper = ExplicitRungeKutta::new(method, 1, tolerance(1e-8)).unwrap();
        stepper.start(&mut Decay(1.0), 0.0, &[1.0], 1.0).unwrap();
        finish(&mut stepper, &mut Decay(1.0)).unwrap();
        assert!((stepper.current().y_old[0] - (-1.0_f64).exp()).abs() < 2e-8, "{}", method.name);
        let done = stepper.counters();
        seen.push((method.name, done.steps, done.rejected, done.evaluations));
    }
    assert_eq!(seen, [("dop853", 4, 0, 50), ("dopri5", 15, 0, 92), ("tsit5", 14, 0, 86), ("bs23", 169, 0, 509)]);
}

#[test]
fn the_end_is_met_exactly_forwards_and_backwards() {
    for method in METHODS {
        for t_end in [std::f64::consts::E, -0.7] {
            let fixed_step = (method.error_order == 0).then_some(0.01);
            let mut stepper = ExplicitRungeKutta::new(method, 4, Options { fixed_step, ..tolerance(1e-9) }).unwrap();
            stepper.start(&mut Kepler, 0.3, &Kepler::at(0.3), t_end).unwrap();
            finish(&mut stepper, &mut Kepler).unwrap();
            assert_eq!(stepper.current().t_old, t_end, "{}", method.name);
            assert!(distance(stepper.current().y_old, &Kepler::at(t_end)) < 1e-6, "{}", method.name);
        }
    }
}

#[test]
fn fixed_steps_lie_on_their_grid() {
    for (h, t_end, steps) in [(0.1, 1.0, 10), (0.3, 1.0, 4), (1e-3, -10.0, 10_000), (2.0, 1.0, 1)] {
        for method in METHODS {
            let mut stepper =
                ExplicitRungeKutta::new(method, 1, Options { fixed_step: Some(h), ..Options::default() }).unwrap();
            let mut ode = Decay(0.1);
            stepper.start(&mut ode, 0.0, &[1.0], t_end).unwrap();
            for i in 1..=steps {
                stepper.attempt(&mut ode).unwrap();
                let expected = if i == steps { t_end } else { f64::from(i) * h.copysign(t_end) };
                assert_eq!(stepper.current().t_new, expected);
                assert_eq!(conclude(&mut stepper, &mut ode), Ok(Conclusion::Done));
                stepper.commit();
            }
            assert!(stepper.current().finished());
            let stages = if method.fsal { method.stages - 1 } else { method.stages };
            assert_eq!(stepper.counters().evaluations, 1 + u64::from(steps as u32) * stages as u64);
        }
    }
}

#[test]
fn a_fixed_grid_is_found_again_after_an_obstacle() {
    let mut calls = 0;
    let f = |_: f64, y: &[f64], dy: &mut [f64]| {
        calls += 1;
        dy[0] = -y[0];
        if calls == 7 {
            Err(RhsError::Retry("once"))
        } else {
            Ok(())
        }
    };
    let mut ode = Closure { dim: 1, f };
    let mut stepper =
        ExplicitRungeKutta::new(&RK4, 1, Options { fixed_step: Some(0.1), ..Options::default() }).unwrap();
    stepper.start(&mut ode, 0.0, &[1.0], 0.3).unwrap();
    let mut times = vec![];
    while !stepper.current().finished() {
        stepper.attempt(&mut ode).unwrap();
        assert_eq!(conclude(&mut stepper, &mut ode), Ok(Conclusion::Done));
        times.push(stepper.current().t_new);
        stepper.commit();
    }
    assert_eq!(times.len(), 4);
    assert!(distance(&times, &[0.1, 0.16, 0.2, 0.3]) < 1e-15, "{times:?}");
    assert_eq!((stepper.counters().retries, stepper.counters().rejected), (1, 1));
}

#[test]
fn obstacles_shorten_the_step_and_hold_the_next() {
    for method in adaptive() {
        // long first steps carry the stages to y < 0, where this equation does not exist
        let f = |_: f64, y: &[f64], dy: &mut [f64]| {
            if y[0] < 0.0 {
                return Err(RhsError::Retry("the root of a negative number"));
            }
            dy[0] = -50.0 * y[0];
            Ok(())
        };
        let mut ode = Closure { dim: 1, f };
        let mut stepper =
            ExplicitRungeKutta::new(method, 1, Options { first_step: Some(1.0), ..tolerance(1e-6) }).unwrap();
        stepper.start(&mut ode, 0.0, &[1.0], 1.0).unwrap();
        stepper.attempt(&mut ode).unwrap();
        assert!(stepper.counters().retries > 0, "{}", method.name);
        assert_eq!(conclude(&mut stepper, &mut ode), Ok(Conclusion::Done));
        let taken = stepper.current().t_new - stepper.current().t_old;
        stepper.commit();
        assert!(stepper.current().next <= taken, "{}", method.name);
        finish(&mut stepper, &mut ode).unwrap();
        assert!(stepper.current().y_old[0].abs() < 1e-5, "{}", method.name);
    }
}

#[test]
fn a_wall_is_reported_with_its_time_and_reason() {
    for method in METHODS {
        let f = |t: f64, _: &[f64], dy: &mut [f64]| {
            dy[0] = 1.0;
            if t > 0.5 {
                Err(RhsError::Retry("the loop does not close"))
            } else {
                Ok(())
            }
        };
        let mut ode = Closure { dim: 1, f };
        let fixed_step = (method.error_order == 0).then_some(0.1);
        let mut stepper = ExplicitRungeKutta::new(method, 1, Options { fixed_step, ..tolerance(1e-6) }).unwrap();
        stepper.start(&mut ode, 0.0, &[0.0], 1.0).unwrap();
        let failure = finish(&mut stepper, &mut ode).unwrap_err();
        assert!(failure.to_string().contains("the loop does not close"), "{failure}");
        let StepFailure::TooSmall { t, h, last } = failure else { panic!("{failure}") };
        assert!((t - 0.5).abs() < 1e-12 && h < 1e-14 && last.is_some(), "{}: {t} {h}", method.name);
        // the state at the last good point is kept
        assert!((stepper.current().y_old[0] - 0.5).abs() < 1e-12, "{}", method.name);
    }
}

#[test]
fn an_end_that_is_not_evaluable_rejects_the_step() {
    let mut calls = 0;
    let f = |_: f64, y: &[f64], dy: &mut [f64]| {
        calls += 1;
        dy[0] = -y[0];
        // the start, eleven stages, then the end
        if calls == 13 {
            Err(RhsError::Retry("singular"))
        } else {
            Ok(())
        }
    };
    let mut ode = Closure { dim: 1, f };
    let options = Options { first_step: Some(0.1), ..tolerance(1e-6) };
    let mut stepper = ExplicitRungeKutta::new(&DOP853, 1, options).unwrap();
    stepper.start(&mut ode, 0.0, &[1.0], 1.0).unwrap();
    stepper.attempt(&mut ode).unwrap();
    assert_eq!(conclude(&mut stepper, &mut ode), Ok(Conclusion::Rejected));
    assert_eq!((stepper.current().t_old, stepper.current().next), (0.0, 0.1 * 0.6));
    finish(&mut stepper, &mut ode).unwrap();
    assert!((stepper.current().y_old[0] - (-1.0_f64).exp()).abs() < 1e-6);
    let done = stepper.counters();
    assert_eq!((done.retries, done.rejected), (1, 1));
}

#[test]
fn a_stage_of_dense_output_alone_that_is_not_evaluable_is_said_so() {
    let mut calls = 0;
    let f = |_: f64, y: &[f64], dy: &mut [f64]| {
        calls += 1;
        dy[0] = -y[0];
        // the start, eleven stages, the end, then the first stage of dense output
        if calls == 14 {
            Err(RhsError::Retry("singular"))
        } else {
            Ok(())
        }
    };
    let mut ode = Closure { dim: 1, f };
    let options = Options { first_step: Some(0.1), ..tolerance(1e-6) };
    let mut stepper = ExplicitRungeKutta::new(&DOP853, 1, options).unwrap();
    stepper.start(&mut ode, 0.0, &[1.0], 1.0).unwrap();
    stepper.attempt(&mut ode).unwrap();
    assert_eq!(conclude(&mut stepper, &mut ode), Ok(Conclusion::Done));
    let mut y = [0.0];
    let failure = stepper.interpolate(&mut ode, 0.05, &mut y).unwrap_err();
    assert!(matches!(failure, StepFailure::Interpolation { t, .. } if (t - 0.01).abs() < 1e-15), "{failure}");
    // the step may be rejected, or asked again
    stepper.interpolate(&mut ode, 0.05, &mut y).unwrap();
    assert!((y[0] - (-0.05_f64).exp()).abs() < 1e-9);
}

#[test]
fn fatal_errors_stop_at_once() {
    let f = |t: f64, _: &[f64], _: &mut [f64]| {
        if t > 0.5 {
            Err(RhsError::Fatal("the user's function raised an error"))
        } else {
            Ok(())
        }
    };
    let mut ode = Closure { dim: 1, f };
    let mut stepper = ExplicitRungeKutta::new(&DOPRI5, 1, tolerance(1e-6)).unwrap();
    stepper.start(&mut ode, 0.0, &[0.0], 1.0).unwrap();
    let failure = finish(&mut stepper, &mut ode).unwrap_err();
    assert!(matches!(failure, StepFailure::Rhs { t, .. } if t > 0.5 && t <= 1.0), "{failure}");
    assert!(failure.to_string().contains("the user's function raised an error"));
    assert_eq!(stepper.counters().rejected, 0);
}

#[test]
fn numbers_that_are_not_finite_name_their_component() {
    for method in METHODS {
        let fixed_step = (method.error_order == 0).then_some(0.1);
        let options = Options { fixed_step, controlled: 1, ..tolerance(1e-6) };
        // the second component is not even under error control
        let f = |t: f64, _: &[f64], dy: &mut [f64]| {
            dy.copy_from_slice(&[1.0, if t > 0.5 { f64::NAN } else { 0.0 }]);
            Ok(())
        };
        let mut ode = Closure { dim: 2, f };
        let mut stepper = ExplicitRungeKutta::new(method, 2, options).unwrap();
        stepper.start(&mut ode, 0.0, &[0.0; 2], 1.0).unwrap();
        let failure = finish(&mut stepper, &mut ode).unwrap_err();
        assert!(
            matches!(failure, StepFailure::NotFinite { t, component: 1 } if (t - 0.5).abs() < 1e-12),
            "{}: {failure}",
            method.name
        );
        assert!(stepper.counters().not_finite > 10, "{}", method.name);
        let failure = stepper.start(&mut ode, 0.0, &[f64::INFINITY, 0.0], 1.0).unwrap_err();
        assert_eq!(failure, StepFailure::NotFinite { t: 0.0, component: 0 });
    }
}

#[test]
fn what_is_not_controlled_does_not_change_the_steps() {
    // the work of a stiff, noisy force rides along with a planet
    let f = |t: f64, y: &[f64], dy: &mut [f64]| {
        let _ = partita_integrate::ode::Ode::rhs(&mut Kepler, t, &y[..4], &mut dy[..4]);
        dy[4] = (1e4 * t).sin();
        Ok(())
    };
    for method in adaptive() {
        let mut alone = ExplicitRungeKutta::new(method, 4, tolerance(1e-7)).unwrap();
        alone.start(&mut Kepler, 0.0, &Kepler::at(0.0), 10.0).unwrap();
        finish(&mut alone, &mut Kepler).unwrap();

        let mut with_work = ExplicitRungeKutta::new(method, 5, Options { controlled: 4, ..tolerance(1e-7) }).unwrap();
        let mut ode = Closure { dim: 5, f };
        let mut y = [0.0; 5];
        y[..4].copy_from_slice(&Kepler::at(0.0));
        with_work.start(&mut ode, 0.0, &y, 10.0).unwrap();
        finish(&mut with_work, &mut ode).unwrap();

        assert_eq!(alone.counters(), with_work.counters(), "{}", method.name);
        assert_eq!(alone.current().y_old, &with_work.current().y_old[..4], "{}", method.name);
    }
}

#[test]
fn each_component_has_its_own_absolute_tolerance() {
    // the same oscillation in metres and in micrometres: tolerances in their units give the same steps
    let run = |scale: f64, atol: AbsoluteTolerance| {
        let f = move |_: f64, y: &[f64], dy: &mut [f64]| {
            dy.copy_from_slice(&[y[1] * scale, -y[0] / scale]);
            Ok(())
        };
        let mut ode = Closure { dim: 2, f };
        let mut stepper =
            ExplicitRungeKutta::new(&TSIT5, 2, Options { rtol: 1e-9, atol, ..Options::default() }).unwrap();
        stepper.start(&mut ode, 0.0, &[0.0, 1.0], 10.0).unwrap();
        finish(&mut stepper, &mut ode).unwrap();
        *stepper.counters()
    };
    let metres = run(1.0, 1e-6.into());
    assert_eq!(metres, run(1048576.0, vec![1.048576, 1e-6].into()));
    assert_ne!(metres, run(1048576.0, 1e-6.into()));
}

/// Of twenty components one decays, held to a tolerance of its own, and the others rest and may err as they like: the steps
/// are the same wherever it stands. (Errors are measured in tiles of eight.)
#[test]
fn where_a_component_stands_is_no_matter() {
    for method in adaptive() {
        let run = |index: usize| {
            let f = move |_: f64, y: &[f64], dy: &mut [f64]| {
                dy.fill(0.0);
                dy[index] = -y[index];
                Ok(())
            };
            let (mut atol, mut y) = (vec![1.0; 20], vec![0.0; 20]);
            (atol[index], y[index]) = (1e-9, 1.0);
            let mut ode = Closure { dim: 20, f };
            let options = Options { rtol: 1e-9, atol: atol.into(), ..Options::default() };
            let mut stepper = ExplicitRungeKutta::new(method, 20, options).unwrap();
            stepper.start(&mut ode, 0.0, &y, 5.0).unwrap();
            finish(&mut stepper, &mut ode).unwrap();
            (*stepper.counters(), stepper.current().y_old[index])
        };
        let first = run(0);
        assert!((first.1 - (-5.0_f64).exp()).abs() < 1e-8 && first.0.steps > 5, "{}: {first:?}", method.name);
        (1..20).for_each(|index| assert_eq!(run(index), first, "{}: component {index}", method.name));
    }
}

#[test]
fn a_corrected_end_is_met_by_dense_output_and_by_the_next_step() {
    for method in adaptive() {
        let mut stepper = ExplicitRungeKutta::new(method, 4, tolerance(1e-8)).unwrap();
        stepper.start(&mut Kepler, 0.0, &Kepler::at(0.0), 6.0).unwrap();
        let mut y = [0.0; 4];
        while !stepper.current().finished() {
            stepper.attempt(&mut Kepler).unwrap();
            let exact = Kepler::at(stepper.current().t_new);
            let concluded = stepper.conclude(&mut |t, y, dy, _| {
                y.copy_from_slice(&exact);
                Kepler.rhs(t, y, dy).map(|()| true)
            });
            assert_eq!(concluded, Ok(Conclusion::Done));
            let (t_old, t_new) = (stepper.current().t_old, stepper.current().t_new);
            let h = t_new - t_old;
            stepper.interpolate(&mut Kepler, t_new, &mut y).unwrap();
            assert_eq!(y, exact, "{}", method.name);
            stepper.interpolate(&mut Kepler, t_old, &mut y).unwrap();
            assert_eq!(y, stepper.current().y_old, "{}", method.name);
            // value and slope are continuous: the difference quotient at the end is the slope there
            let d = 1e-4 * h;
            stepper.interpolate(&mut Kepler, t_new - d, &mut y).unwrap();
            for i in 0..4 {
                // (second derivatives are below 5)
                assert!(
                    ((exact[i] - y[i]) / d - stepper.current().dy_new[i]).abs() < 5.0 * d + 1e-9,
                    "{}",
                    method.name
                );
            }
            stepper.interpolate(&mut Kepler, t_old + 0.37 * h, &mut y).unwrap();
            assert!(distance(&y, &Kepler::at(t_old + 0.37 * h)) < 1e-6, "{}", method.name);
            stepper.commit();
            assert_eq!(stepper.current().y_old, exact, "{}", method.name);
        }
    }
}

#[test]
fn a_replaced_start_is_where_the_next_step_begins() {
    for method in adaptive() {
        let mut stepper = ExplicitRungeKutta::new(method, 1, tolerance(1e-8)).unwrap();
        let mut ode = Decay(1.0);
        stepper.start(&mut ode, 0.0, &[1.0], 2.0).unwrap();
        stepper.attempt(&mut ode).unwrap();
        assert_eq!(conclude(&mut stepper, &mut ode), Ok(Conclusion::Done));
        let (t, evaluations) = (stepper.current().t_new, stepper.counters().evaluations);
        stepper.commit();
        stepper.replace_start(t, &[5.0], &[-5.0]);
        assert_eq!(stepper.counters().evaluations, evaluations);
        assert_eq!((stepper.current().y_old, stepper.current().dy_old), (&[5.0][..], &[-5.0][..]));
        finish(&mut stepper, &mut ode).unwrap();
        assert!((stepper.current().y_old[0] - 5.0 * (t - 2.0).exp()).abs() < 1e-7, "{}", method.name);
    }
}

#[test]
fn a_rejected_step_is_repeated_shorter_from_the_same_or_a_replaced_start() {
    for method in adaptive() {
        let mut stepper =
            ExplicitRungeKutta::new(method, 1, Options { first_step: Some(0.1), ..tolerance(usual(method)) }).unwrap();
        let mut ode = Decay(1.0);
        stepper.start(&mut ode, 0.0, &[1.0], 1.0).unwrap();
        stepper.attempt(&mut ode).unwrap();
        stepper.reject(0.5);
        stepper.attempt(&mut ode).unwrap();
        assert_eq!(stepper.current().t_new, 0.05);
        assert_eq!(conclude(&mut stepper, &mut ode), Ok(Conclusion::Done));
        stepper.reject(0.1);
        stepper.replace_start(0.0, &[2.0], &[-2.0]);
        assert_eq!(stepper.current().next, 0.05 * 0.1);
        finish(&mut stepper, &mut ode).unwrap();
        assert_eq!(stepper.counters().rejected, 2);
        assert!((stepper.current().y_old[0] - 2.0 * (-1.0_f64).exp()).abs() < 10.0 * usual(method), "{}", method.name);
    }
}

#[test]
fn a_motion_goes_on_to_one_end_after_another() {
    let mut stepper = ExplicitRungeKutta::new(&DOP853, 4, Options { max_step: 0.25, ..tolerance(1e-10) }).unwrap();
    let mut from = 0.0;
    for t_end in [1.0, 1.001, 4.0, 2.0] {
        stepper.start(&mut Kepler, from, &Kepler::at(from), t_end).unwrap();
        while !stepper.current().finished() {
            stepper.attempt(&mut Kepler).unwrap();
            // one hundredth more where it leads to the end
            assert!((stepper.current().t_new - stepper.current().t_old).abs() <= 1.01 * 0.25);
            assert_eq!(conclude(&mut stepper, &mut Kepler), Ok(Conclusion::Done));
            stepper.commit();
        }
        assert_eq!(stepper.current().t_old, t_end);
        assert!(distance(stepper.current().y_old, &Kepler::at(t_end)) < 1e-8);
        from = t_end;
    }
}

#[test]
fn contradictory_options_are_refused_in_words() {
    let refuse = |method, options| ExplicitRungeKutta::new(method, 3, options).unwrap_err();
    let plain = Options::default;
    assert_eq!(refuse(&RK4, plain()), OptionsError::NeedsFixedStep { method: "rk4" });
    let each = |n: usize| AbsoluteTolerance::Each(vec![1e-9; n]);
    assert_eq!(
        refuse(&DOP853, Options { atol: each(3), controlled: 2, ..plain() }).to_string(),
        "atol has 3 entries for 2 controlled components; give one number, or one for each"
    );
    for options in [
        Options { rtol: f64::NAN, ..plain() },
        Options { atol: (-1.0).into(), ..plain() },
        Options { max_step: 0.0, ..plain() },
        Options { fixed_step: Some(-0.1), ..plain() },
        Options { first_step: Some(f64::INFINITY), ..plain() },
    ] {
        assert!(matches!(refuse(&DOP853, options), OptionsError::OutOfRange { .. }));
    }
}

#[test]
fn the_controller_keeps_its_bounds_and_its_memory() {
    let mut controller = StepController::new(4, 0.04);
    assert_eq!(controller.accepted(0.0), LARGEST_FACTOR);
    assert!(controller.rejected(1.5) < 1.0);
    assert_eq!(controller.accepted(0.0), 1.0); // right after a rejection
    assert_eq!(controller.accepted(0.0), LARGEST_FACTOR);
    assert_eq!(controller.rejected(1e9), SMALLEST_FACTOR);
    controller.hold();
    assert_eq!(controller.accepted(1e-6), 1.0);
    // a growing error foretells another: the second step is more careful than after an equal error before
    let after = |before: f64| {
        let mut controller = StepController::new(4, 0.04);
        controller.accepted(before);
        controller.accepted(0.5)
    };
    assert!(after(0.05) < after(0.5));
    // without an integral share the memory is empty: factor = 0.9 err^(-1/8)
    let factor = StepController::new(7, 0.0).accepted(0.5);
    assert!((factor - SAFETY * 2.0_f64.powf(0.125)).abs() < 1e-15);
}

#[test]
fn methods_are_found_by_name() {
    for method in METHODS {
        assert!(std::ptr::eq(by_name(method.name).unwrap(), method));
    }
    assert!(by_name("euler").is_none());
}

#[test]
fn discontinuities_are_met_exactly_in_both_directions_and_keep_the_order() {
    // y' = a hat of time, one wide and one a thousandth wide, after a long rest; y is its integral
    let hat = |t: f64, at: f64, width: f64| (1.0 - (t - at).abs() / width).max(0.0);
    let f = |t: f64| hat(t, 5.0, 1.0) + hat(t, 8.0, 1e-3);
    let mut ode = Closure {
        dim: 1,
        f: |t: f64, _: &[f64], dy: &mut [f64]| {
            dy[0] = f(t);
            Ok::<(), RhsError<&str>>(())
        },
    };
    let discontinuities = vec![4.0, 5.0, 6.0, 7.999, 8.0, 8.001];
    for method in adaptive() {
        for (from, to) in [(0.0, 10.0), (10.0, 0.0)] {
            let mut stepper = ExplicitRungeKutta::new(method, 1, tolerance(1e-8)).unwrap();
            stepper.start(&mut ode, from, &[0.0], to).unwrap();
            let mut met = Vec::new();
            while !stepper.current().finished() {
                crate::problems::aim_at_next(&mut stepper, &discontinuities);
                stepper.attempt(&mut ode).unwrap();
                assert_eq!(conclude(&mut stepper, &mut ode), Ok(Conclusion::Done));
                stepper.commit();
                met.push(stepper.current().t_old);
            }
            assert!(discontinuities.iter().all(|c| met.contains(c)), "{}: {met:?}", method.name);
            // between corners it is a parabola: what is left is round-off of corners near 8, ten thousandfold in the narrow hat
            let area = (to - from).signum() * (1.0 + 1e-3);
            assert!(
                (stepper.current().y_old[0] - area).abs() < 1e-11,
                "{}: {}",
                method.name,
                stepper.current().y_old[0]
            );
        }
    }
}
