//! The multistep method: it raises its order by itself, stays as exact as asked, and begins anew where it must.

use crate::problems::{conclude, distance, Closure, Decay, Kepler};
use partita_integrate::explicit_rk::ExplicitRungeKutta;
use partita_integrate::ode::RhsError;
use partita_integrate::options::Options;
use partita_integrate::stepper::{Conclusion, StepControl, Stepper};
use partita_integrate::tableau::{BS23, DOPRI5, HEUN_EULER};

fn options(rtol: f64) -> Options {
    Options { rtol, atol: rtol.into(), ..Options::default() }
}

fn adams(dim: usize, options: Options) -> ExplicitRungeKutta {
    ExplicitRungeKutta::remembering(&HEUN_EULER, dim, options).unwrap()
}

/// Error at the end, largest error in the middle of a step, and evaluations.
fn orbit(stepper: &mut ExplicitRungeKutta, t_end: f64) -> (f64, f64, u64) {
    stepper.start(&mut Kepler, 0.0, &Kepler::at(0.0), t_end).unwrap();
    let (mut out, mut between) = ([0.0; 4], 0.0_f64);
    while !stepper.current().finished() {
        stepper.attempt(&mut Kepler).unwrap();
        assert_eq!(conclude(stepper, &mut Kepler), Ok(Conclusion::Done));
        let middle = 0.5 * (stepper.current().t_old + stepper.current().t_new);
        stepper.interpolate(&mut Kepler, middle, &mut out).unwrap();
        between = between.max(distance(&out, &Kepler::at(middle)));
        stepper.commit();
    }
    let end = distance(stepper.current().y_old, &Kepler::at(stepper.current().t_end));
    (end, between, stepper.counters().evaluations)
}

#[test]
fn errors_follow_the_tolerance_and_the_order_rises() {
    let mut last: Option<(f64, u64)> = None;
    for rtol in [1e-4, 1e-5, 1e-7, 1e-9, 1e-11] {
        let (end, between, evaluations) = orbit(&mut adams(4, options(rtol)), 20.0);
        let (other, _, _) = orbit(&mut ExplicitRungeKutta::new(&DOPRI5, 4, options(rtol)).unwrap(), 20.0);
        assert!(end < 20.0 * other, "{rtol:e}: {end:e} and {other:e}");
        assert!(between < 300.0 * rtol, "{rtol:e}: {between:e}");
        if let Some((error, fewer)) = last {
            assert!(end < 0.1 * error, "{rtol:e}: {end:e} after {error:e}");
            // at a fixed order m two digits would cost 10^(2 / (m + 1)) times as much: this is above order seven
            assert!((evaluations as f64) < 2.0 * fewer as f64, "{rtol:e}: {evaluations} after {fewer}");
        }
        last = Some((end, evaluations));
    }
}

#[test]
fn it_takes_fewer_evaluations_than_one_step_methods_of_lower_order() {
    let (_, _, adams) = orbit(&mut adams(4, options(1e-9)), 20.0);
    for table in [&DOPRI5, &BS23] {
        let (_, _, other) = orbit(&mut ExplicitRungeKutta::new(table, 4, options(1e-9)).unwrap(), 20.0);
        assert!(adams < other, "{}: {adams} and {other}", table.name);
    }
}

#[test]
fn polynomials_are_exact_once_their_slopes_are_known() {
    // y' = 7 t^6: after seven steps the polynomial through the slopes is the slope itself
    let f = |t: f64, _: &[f64], dy: &mut [f64]| {
        dy[0] = 7.0 * t.powi(6);
        Ok::<(), RhsError<&str>>(())
    };
    let mut ode = Closure { dim: 1, f };
    let mut stepper = adams(1, Options { fixed_step: Some(0.05), ..Options::default() });
    stepper.start(&mut ode, 0.0, &[0.0], 2.0).unwrap();
    let (mut steps, mut out) = (0, [0.0]);
    while !stepper.current().finished() {
        stepper.attempt(&mut ode).unwrap();
        assert_eq!(conclude(&mut stepper, &mut ode), Ok(Conclusion::Done));
        let now = stepper.current();
        if steps >= 12 {
            let made = now.y_new[0] - now.y_old[0];
            let exact = now.t_new.powi(7) - now.t_old.powi(7);
            assert!((made - exact).abs() < 1e-12 * exact, "step {steps}: {made:e}, {exact:e}");
            let (start, old) = (now.t_old, now.y_old[0]);
            let t = start + 0.3 * (now.t_new - start);
            stepper.interpolate(&mut ode, t, &mut out).unwrap();
            let exact = t.powi(7) - start.powi(7);
            assert!(
                (out[0] - old - exact).abs() < 1e-12 * exact,
                "between, step {steps}: {:e}, {exact:e}",
                out[0] - old
            );
        }
        stepper.commit();
        steps += 1;
    }
}

#[test]
fn backwards_is_forwards() {
    let (forwards, _, evaluations) = orbit(&mut adams(4, options(1e-8)), 5.0);
    let (backwards, _, other) = orbit(&mut adams(4, options(1e-8)), -5.0);
    assert!(forwards < 1e-6 && backwards < 1e-6, "{forwards:e} {backwards:e}");
    assert!(evaluations.abs_diff(other) < evaluations / 4, "{evaluations} {other}");
}

#[test]
fn a_replaced_start_begins_anew_at_a_length_that_is_accepted() {
    let mut stepper = adams(4, options(1e-9));
    stepper.start(&mut Kepler, 0.0, &Kepler::at(0.0), 10.0).unwrap();
    let (mut longest, mut replaced) = (0.0_f64, 0);
    while !stepper.current().finished() {
        stepper.attempt(&mut Kepler).unwrap();
        assert_eq!(conclude(&mut stepper, &mut Kepler), Ok(Conclusion::Done));
        let now = stepper.current();
        let length = now.t_new - now.t_old;
        longest = longest.max(length);
        stepper.commit();
        if stepper.counters().steps % 40 == 0 {
            let now = stepper.current();
            let (t, y, mut dy, next) = (now.t_old, now.y_old.to_vec(), now.dy_old.to_vec(), now.next);
            // the same motion, as where whole turns are taken off
            stepper.replace_start(t, &y, &dy);
            assert_eq!(stepper.current().next, next);
            dy[0] *= 1.0 + 1e-14;
            stepper.replace_start(t, &y, &dy);
            assert!(stepper.current().next < 0.05 * longest);
            replaced += 1;
        }
    }
    assert!(replaced > 2);
    assert!(distance(stepper.current().y_old, &Kepler::at(10.0)) < 1e-6);
    assert!(stepper.counters().rejected < 2 * replaced + 20, "{:?}", stepper.counters());
}

#[test]
fn a_discontinuity_is_met_and_leaves_no_trace() {
    // y' = −|t − 1| / (t − 1) y: down and up again; slopes from before t = 1 would spoil the steps after it
    let f = |t: f64, y: &[f64], dy: &mut [f64]| {
        dy[0] = if t < 1.0 { -y[0] } else { y[0] };
        Ok::<(), RhsError<&str>>(())
    };
    // at the discontinuity itself the slope is that behind it
    let mut ode = Closure { dim: 1, f };
    let run = |discontinuities: Vec<f64>, ode: &mut Closure<_>| {
        let mut stepper = adams(1, options(1e-9));
        stepper.start(ode, 0.0, &[1.0], 2.0).unwrap();
        crate::problems::finish_by_way_of(&mut stepper, ode, &discontinuities).unwrap();
        ((stepper.current().y_old[0] - 1.0).abs(), stepper.counters().rejected)
    };
    let (known, refused) = run(vec![1.0], &mut ode);
    assert!(known < 1e-7, "{known:e}");
    let (unknown, more) = run(vec![], &mut ode);
    assert!(unknown < 1e-6 && more > refused, "{unknown:e}, {more} and {refused} steps refused");
}

#[test]
fn an_obstacle_is_not_the_end() {
    let mut calls = 0;
    let f = |_: f64, y: &[f64], dy: &mut [f64]| {
        calls += 1;
        dy[0] = -y[0];
        match calls % 11 {
            7 => Err(RhsError::Retry("sometimes")),
            _ => Ok(()),
        }
    };
    let mut ode = Closure { dim: 1, f };
    let mut stepper = adams(1, options(1e-8));
    stepper.start(&mut ode, 0.0, &[1.0], 3.0).unwrap();
    crate::problems::finish(&mut stepper, &mut ode).unwrap();
    assert!((stepper.current().y_old[0] - (-3.0_f64).exp()).abs() < 1e-7);
    assert!(stepper.counters().retries > 0);
}

#[test]
fn an_equation_without_components_is_integrated() {
    let f = |_: f64, _: &[f64], _: &mut [f64]| Ok::<(), RhsError<&str>>(());
    let mut ode = Closure { dim: 0, f };
    let mut stepper = adams(0, options(1e-8));
    stepper.start(&mut ode, 0.0, &[], 3.0).unwrap();
    crate::problems::finish(&mut stepper, &mut ode).unwrap();
    assert_eq!(stepper.current().t_old, 3.0);
    // and one that rests
    let mut rest = adams(1, options(1e-8));
    rest.start(&mut Decay(0.0), 0.0, &[1.0], 1e6).unwrap();
    crate::problems::finish(&mut rest, &mut Decay(0.0)).unwrap();
    assert_eq!(rest.current().y_old[0], 1.0);
}
