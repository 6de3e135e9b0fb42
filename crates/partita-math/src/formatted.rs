//! Numbers formatted for messages.

/// Numbers in this range are written without an exponent. Unit: SI units of the number. Reason: at most six digits
/// before the point and three zeros behind it.
const PLAIN: (f64, f64) = (1e-4, 1e6);

/// Four significant digits: 1.44, 0.0002267, 2.5e-9; NaN and infinity are written as such.
///
/// ```
/// use partita_math::formatted;
/// assert_eq!(formatted(1.439_886), "1.44");
/// assert_eq!(formatted(-2.267_277e-4), "-0.0002267");
/// assert_eq!(formatted(2.5e-9), "2.5e-9");
/// assert_eq!(formatted(1_234_567.0), "1.235e6");
/// assert_eq!(formatted(99_999.6), "100000");
/// ```
pub fn formatted(x: f64) -> String {
    let rounded: f64 = format!("{x:.3e}").parse().unwrap_or(x);
    if rounded == 0.0 {
        return "0".into();
    }
    match (PLAIN.0..PLAIN.1).contains(&rounded.abs()) || !rounded.is_finite() {
        true => format!("{rounded}"),
        false => format!("{rounded:e}"),
    }
}
