//! After set-up a step allocates nothing: not when it is rejected, corrected, interpolated or replaced.

use crate::counting::allocations;
use crate::problems::Kepler;
use partita_integrate::explicit_rk::{Conclusion, Stepper};
use partita_integrate::options::Options;
use partita_integrate::tableau::METHODS;

#[test]
fn steps_allocate_nothing() {
    for method in METHODS {
        let fixed_step = (method.error_order == 0).then_some(0.01);
        let mut stepper = Stepper::new(method, 4, Options { fixed_step, ..Options::default() }).unwrap();
        let (mut out, mut slope) = ([0.0; 4], [0.0; 4]);
        let ((), counted) = allocations(|| {
            stepper.start(&mut Kepler, 0.0, &Kepler::at(0.0), 20.0).unwrap();
            while !stepper.finished() {
                stepper.attempt(&mut Kepler).unwrap();
                if stepper.counters().steps % 5 == 3 && stepper.counters().rejected < 10 {
                    stepper.reject(0.5);
                    continue;
                }
                stepper.y_new_mut()[0] += 1e-12;
                assert_eq!(stepper.conclude(&mut Kepler, true), Ok(Conclusion::Done));
                let middle = 0.5 * (stepper.t_old() + stepper.t_new());
                stepper.interpolate(&mut Kepler, middle, &mut out).unwrap();
                slope.copy_from_slice(stepper.dy_new());
                stepper.replace(&Kepler::at(stepper.t_new()), &slope);
                stepper.commit();
                stepper.replace_start(stepper.t_old(), &Kepler::at(stepper.t_old()), &slope);
            }
        });
        assert!(stepper.counters().rejected >= 10, "{}", method.name);
        assert_eq!(counted, 0, "{}", method.name);
    }
}
