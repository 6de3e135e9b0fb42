//! Zeros of a function of one variable.

use crate::tolerance;

/// Number of points tried until a function is zero: false position converges in about eight.
const LOCATING: usize = 100;

/// The point between `a` and `b` = (point, value) where a function is zero, if the signs at these ends differ: by false
/// position, to rounding of their distance. The point returned is the last one for which `value` was called. None where
/// it has no value.
///
/// # Errors
/// The errors of `value`.
pub fn false_position<E>(
    mut a: (f64, f64),
    mut b: (f64, f64),
    mut value: impl FnMut(f64) -> Result<Option<f64>, E>,
) -> Result<Option<f64>, E> {
    let shortest = tolerance::ROUNDING * (b.0 - a.0).abs();
    let (mut x, mut kept) = (a.0, 0);
    for _ in 0..LOCATING {
        let last = x;
        x = a.0 + (b.0 - a.0) * a.1 / (a.1 - b.1);
        if !(x > a.0.min(b.0) && x < a.0.max(b.0)) {
            x = 0.5 * (a.0 + b.0);
        }
        let Some(here) = value(x)? else { return Ok(None) };
        if here == 0.0 || (x - last).abs() <= shortest || (b.0 - a.0).abs() <= shortest {
            break;
        }
        // the end that stays has its value halved
        if (here > 0.0) == (a.1 > 0.0) {
            a = (x, here);
            b.1 *= if kept > 0 { 0.5 } else { 1.0 };
            kept = 1;
        } else {
            b = (x, here);
            a.1 *= if kept < 0 { 0.5 } else { 1.0 };
            kept = -1;
        }
    }
    Ok(Some(x))
}

#[cfg(test)]
mod tests {
    use super::false_position;

    #[test]
    fn zeros_of_smooth_and_of_nearly_flat_functions() {
        for (f, wanted) in [
            (f64::cos as fn(f64) -> f64, std::f64::consts::FRAC_PI_2),
            (|x: f64| (x - 1.0).powi(3), 1.0),
            (|x: f64| (20.0 * (x - 1.3)).tanh(), 1.3),
        ] {
            let found = false_position((0.0, f(0.0)), (3.0, f(3.0)), |x| Ok::<_, ()>(Some(f(x)))).unwrap().unwrap();
            assert!((found - wanted).abs() < 1e-5, "{found} instead of {wanted}");
        }
    }
}
