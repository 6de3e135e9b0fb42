//! After set-up a step allocates nothing: not when it is rejected, corrected, interpolated or replaced.

use crate::counting::allocations;
use crate::problems::Kepler;
use partita_integrate::explicit_rk::ExplicitRungeKutta;
use partita_integrate::ode::Ode;
use partita_integrate::options::Options;
use partita_integrate::stepper::{Conclusion, StepControl, StepPlan, Stepper};
use partita_integrate::tableau::{HEUN_EULER, METHODS};

#[test]
fn steps_allocate_nothing() {
    for (method, remembers) in METHODS.map(|method| (method, false)).into_iter().chain([(&HEUN_EULER, true)]) {
        let fixed_step = (method.error_order == 0).then_some(0.01);
        let make = if remembers { ExplicitRungeKutta::remembering } else { ExplicitRungeKutta::new };
        let mut stepper = make(method, 4, Options { fixed_step, ..Options::default() }).unwrap();
        let (mut out, mut slope) = ([0.0; 4], [0.0; 4]);
        let ((), counted) = allocations(|| {
            stepper.start(&mut Kepler, 0.0, &Kepler::at(0.0), 20.0).unwrap();
            while !stepper.current().finished() {
                stepper.attempt(&mut Kepler).unwrap();
                if stepper.counters().steps % 5 == 3 && stepper.counters().rejected < 10 {
                    stepper.reject(0.5);
                    continue;
                }
                let concluded = stepper.conclude(&mut |t, y, dy, _| {
                    y[0] += 1e-12;
                    Kepler.rhs(t, y, dy).map(|()| true)
                });
                assert_eq!(concluded, Ok(Conclusion::Done));
                let (from, to) = (stepper.current().t_old, stepper.current().t_new);
                stepper.interpolate(&mut Kepler, 0.5 * (from + to), &mut out).unwrap();
                stepper.commit();
                slope.copy_from_slice(stepper.current().dy_old);
                // a method that remembers earlier slopes begins anew there
                if !remembers || stepper.counters().steps % 7 == 0 {
                    stepper.replace_start(to, &Kepler::at(to), &slope);
                    let length = stepper.current().next;
                    stepper.plan(&StepPlan { length, goal: Some(to + length) });
                }
            }
        });
        assert!(stepper.counters().rejected >= 10, "{}", method.name);
        assert_eq!(counted, 0, "{}", method.name);
    }
}
