//! Numbers, tables and functions of time and state.

use crate::error::DescriptionError;
use crate::spec::{Table, Turning, Value, VectorValue};
use partita_math::scalar::{Arguments, Scalar};
use partita_math::spatial::{Mat3, Quaternion, Vec3};
use partita_math::tolerance;
use partita_system::SystemError;
use std::f64::consts::TAU;
use std::sync::Arc;

/// Maximum number of readings of a user-defined relation.
pub const READINGS: usize = 12;
/// Number of values of a user-defined relation: F, F_t, F'', and the gradient.
pub const RELATION: usize = 3 + READINGS;

/// Number of values of a user-defined rotation: a rotation row by row, its angular velocity and angular acceleration,
/// in the axes that it rotates.
pub const TURNING: usize = 15;

/// The functions given with a description.
pub trait Functions: Send + Sync {
    /// Number of functions.
    fn count(&self) -> usize;
    /// Whether function number `i` reads q and v. Where none does, coordinates of cut joints and readings of sensors,
    /// which follow those of the tree, are not computed for it.
    fn sees_state(&self, _i: usize) -> bool {
        true
    }
    /// Whether nobody waits for the model with these functions any more: what takes long ends early, undecided.
    fn is_abandoned(&self) -> bool {
        false
    }
    /// Where function `i` is given from outside and not called: place of its number, or of the first one of the course of a
    /// drive: the time from which on it applies, and the coefficients of a cubic from there on, lowest first.
    fn given(&self, _i: usize) -> Option<usize> {
        None
    }
    /// How many numbers are given from outside.
    fn given_count(&self) -> usize {
        0
    }
    /// The given number at a place.
    fn given_number(&self, _place: usize) -> f64 {
        f64::NAN
    }
    /// Effort number `i` at (t, q, v).
    fn scalar(&self, i: usize, t: f64, q: &[f64], v: &[f64]) -> Result<f64, Box<dyn std::error::Error + Send + Sync>>;
    /// Force number `i` at (t, q, v).
    fn vector(
        &self,
        i: usize,
        t: f64,
        q: &[f64],
        v: &[f64],
    ) -> Result<[f64; 3], Box<dyn std::error::Error + Send + Sync>>;
    /// Motion number `i` at t: position, velocity, acceleration.
    fn motion(&self, i: usize, t: f64) -> Result<[f64; 3], Box<dyn std::error::Error + Send + Sync>>;
    /// Orientation number `i` at t: the rotation row by row, its angular velocity and acceleration in the axes that it
    /// rotates.
    fn turning(&self, i: usize, _t: f64) -> Result<[f64; TURNING], Box<dyn std::error::Error + Send + Sync>> {
        Err(format!("function {i} is not a spatial rotation").into())
    }
    /// Law number `i` at t for its readings: three forces and three moments for each point it acts on.
    fn law(
        &self,
        i: usize,
        _t: f64,
        _seen: &[f64],
        _out: &mut [f64],
    ) -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
        Err(format!("function {i} is not a force law").into())
    }
    /// Relation number `i` at t, readings x and their rates: F, F_t, F'' for x'' = 0, and the gradient.
    fn relation(
        &self,
        i: usize,
        _t: f64,
        _x: &[f64],
        _rates: &[f64],
    ) -> Result<[f64; RELATION], Box<dyn std::error::Error + Send + Sync>> {
        Err(format!("function {i} is not a relation between readings").into())
    }
}

/// No functions.
pub struct NoFunctions;

impl Functions for NoFunctions {
    fn count(&self) -> usize {
        0
    }
    fn scalar(&self, i: usize, _: f64, _: &[f64], _: &[f64]) -> Result<f64, Box<dyn std::error::Error + Send + Sync>> {
        Err(format!("there is no function {i}").into())
    }
    fn vector(
        &self,
        i: usize,
        _: f64,
        _: &[f64],
        _: &[f64],
    ) -> Result<[f64; 3], Box<dyn std::error::Error + Send + Sync>> {
        Err(format!("there is no function {i}").into())
    }
    fn motion(&self, i: usize, _: f64) -> Result<[f64; 3], Box<dyn std::error::Error + Send + Sync>> {
        Err(format!("there is no function {i}").into())
    }
}

/// A value: a constant (a parameter, so of any number type), a table, a function.
#[derive(Clone, Debug)]
pub enum Source<S> {
    /// The same at all times.
    Constant(S),
    /// Piecewise cubic in time.
    Table(Table),
    /// Function number i.
    Function(usize),
}

/// Three components.
#[derive(Clone, Debug)]
pub enum VectorSource<S> {
    /// One by one.
    Components([Source<S>; 3]),
    /// Function number i, which returns all components.
    Function([Source<S>; 1]),
}

/// Arguments of a value: time and state.
pub(crate) struct Instant<'a, S> {
    pub t: S,
    pub q: &'a [S],
    pub v: &'a [S],
    pub callers: &'a Callers,
    /// Places in `q` of angles whose whole turns are not counted.
    pub uncounted: &'a [usize],
}

/// The functions of a model, and the sizes of their arguments.
pub(crate) struct Callers {
    pub functions: Arc<dyn Functions>,
    /// Typical sizes of the coordinates and of the velocities.
    pub q_sizes: Vec<f64>,
    pub v_sizes: Vec<f64>,
}

impl<S: Scalar> Instant<'_, S> {
    fn arguments(&self) -> Arguments<'_, S> {
        let (q_sizes, v_sizes) = (&self.callers.q_sizes[..], &self.callers.v_sizes[..]);
        Arguments { t: self.t, q: self.q, v: self.v, q_sizes, v_sizes }
    }

    /// The values of a function that `ask` calls with numbers in place of `q`.
    fn asked<const N: usize>(
        &self,
        q: &[f64],
        what: &str,
        ask: impl Fn(&[f64]) -> Result<[f64; N], SystemError>,
    ) -> Result<[f64; N], SystemError> {
        let found = ask(q)?;
        alike_a_turn_on(self.uncounted.iter().copied(), q, &found, what, |q, out| {
            out.copy_from_slice(&ask(q)?);
            Ok(())
        })?;
        Ok(found)
    }
}

/// Places of angles whose whole turns are not counted in numbers of so many entries each, the first one at `from`.
pub(crate) fn places_uncounted(mut from: usize, shown: impl Iterator<Item = (usize, bool)>) -> Vec<usize> {
    let mut found = Vec::new();
    for (count, wraps) in shown {
        found.extend(wraps.then_some(from));
        from += count;
    }
    found
}

/// Step by which the slope of a function is seen. Unit: rad. Reason: a thousandth of what its values hang on.
const SLOPE_STEP: f64 = 1e-3;

/// Near half a turn of an angle whose whole turns are not counted, at the places `uncounted` of the numbers x, a function
/// must have the same values a turn further on: otherwise the next one might jump. `found` are its values at x; `ask`
/// calls it.
///
/// # Errors
/// `Uncounted`, and those of the function.
pub(crate) fn alike_a_turn_on(
    uncounted: impl Iterator<Item = usize>,
    x: &[f64],
    found: &[f64],
    what: &str,
    mut ask: impl FnMut(&[f64], &mut [f64]) -> Result<(), SystemError>,
) -> Result<(), SystemError> {
    for i in uncounted.filter(|&i| x[i].abs() > tolerance::HALF_TURN) {
        let mut beside = x.to_vec();
        let [mut other, mut next] = [found.to_vec(), found.to_vec()];
        beside[i] -= TAU.copysign(x[i]);
        ask(&beside, &mut other)?;
        beside[i] += SLOPE_STEP;
        ask(&beside, &mut next)?;
        let size =
            |y: f64, (other, next): (&f64, &f64)| y.abs().max(other.abs()).max((next - other).abs() / SLOPE_STEP);
        let seen = || found.iter().zip(other.iter().zip(&next));
        let largest = seen().fold(0.0, |m: f64, (y, x)| m.max(size(*y, x)));
        if seen().any(|(y, (other, _))| (y - other).abs() > tolerance::EQUAL * largest) {
            return Err(SystemError::Uncounted { what: what.to_string(), by: x[i] });
        }
    }
    Ok(())
}

/// Value, first and second derivative of a table at t.
pub fn table_at<S: Scalar>(table: &Table, t: S, what: &str) -> Result<[S; 3], SystemError> {
    let (from, to) = (table.breaks[0], table.breaks[table.breaks.len() - 1]);
    // steps end on the last break up to round-off
    let slack = tolerance::EQUAL * (to - from);
    if let Some(t) = t.outside(from - slack, to + slack) {
        return Err(SystemError::OutsideTable { what: what.into(), t, from, to });
    }
    Ok(cubic_at(table, t))
}

/// Value, first and second derivative of a piecewise cubic at x; the outer pieces extend beyond the table.
#[inline(always)]
pub(crate) fn cubic_at<S: Scalar>(table: &Table, x: S) -> [S; 3] {
    let (start, [a, b, c, d]) = x.interval(&table.breaks, &table.coefficients);
    let x = x - start;
    let position = ((a * x + b) * x + c) * x + d;
    [position, (a.scale(3.0) * x + b.scale(2.0)) * x + c, a.scale(6.0) * x + b.scale(2.0)]
}

/// Remainder of x up to multiples of a period.
#[inline(always)]
pub(crate) fn up_to<S: Scalar>(x: S, period: Option<S>) -> S {
    match period {
        Some(period) => x - (x * (S::one() / period)).round() * period,
        None => x,
    }
}

/// What is known of the abscissa of a curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Abscissa {
    /// All of it.
    Known,
    /// An angle whose whole turns are not counted.
    UpToTurns,
    /// The curve repeats, and it does not matter.
    Periodic,
}

/// Value and derivatives of a curve at x.
#[inline(always)]
pub(crate) fn curve_at<S: Scalar>(curve: &Table, abscissa: Abscissa, x: S, what: &str) -> Result<[S; 3], SystemError> {
    let (first, last) = (curve.breaks[0], curve.breaks[curve.breaks.len() - 1]);
    let period = match abscissa {
        Abscissa::Known => None,
        Abscissa::UpToTurns => Some(TAU),
        Abscissa::Periodic => Some(last - first),
    };
    // the nearest whole number of periods around the middle
    let middle = S::from_f64(0.5 * (first + last));
    let x = period.map_or(x, |period| middle + up_to(x - middle, Some(S::from_f64(period))));
    let slack = tolerance::EQUAL * (last - first);
    if let Some(x) = (abscissa != Abscissa::Periodic).then(|| x.outside(first - slack, last + slack)).flatten() {
        return Err(SystemError::OutsideCurve { what: what.into(), x, from: first, to: last });
    }
    Ok(cubic_at(curve, x))
}

pub(crate) fn finite<const N: usize>(x: [f64; N], what: &str, t: f64) -> Result<[f64; N], SystemError> {
    if x.iter().all(|x| x.is_finite()) {
        Ok(x)
    } else {
        Err(SystemError::NotFinite { what: what.into(), t })
    }
}

pub(crate) fn failed(what: &str, source: Box<dyn std::error::Error + Send + Sync>) -> SystemError {
    SystemError::Function { what: what.into(), source }
}

impl<S: Scalar> Source<S> {
    /// From a description; `given`: in place of its number.
    pub fn new(value: &Value, given: Option<&S>) -> Self {
        match value {
            Value::Constant(x) => Self::Constant(given.copied().unwrap_or_else(|| S::from_f64(*x))),
            Value::Table(table) => Self::Table(table.clone()),
            Value::Function(i) => Self::Function(*i),
        }
    }

    /// The value at an instant. Derivatives are exact for constants and tables, by differences for functions.
    #[inline(always)]
    pub(crate) fn at(&self, i: &Instant<S>, what: &str, memory: &mut Vec<f64>) -> Result<S, SystemError> {
        match self {
            Self::Constant(x) => Ok(*x),
            Self::Table(table) => Ok(table_at(table, i.t, what)?[0]),
            Self::Function(k) => {
                if let Some(place) = i.callers.functions.given(*k) {
                    return Ok(given(i.callers, place));
                }
                let [x] = S::call(i.arguments(), memory, |t, q, v| {
                    i.asked(q, what, |q| {
                        let x = i.callers.functions.scalar(*k, t, q, v).map_err(|e| failed(what, e))?;
                        finite([x], what, t)
                    })
                })?;
                Ok(x)
            }
        }
    }
}

impl<S: Scalar> VectorSource<S> {
    /// From a description; `given`: in place of its numbers, if any.
    pub fn new(value: &VectorValue, given: &[S]) -> Self {
        match value {
            VectorValue::Components(all) => {
                Self::Components(std::array::from_fn(|i| Source::new(&all[i], given.get(i))))
            }
            VectorValue::Whole(Value::Function(i)) => Self::Function([Source::Function(*i)]),
            VectorValue::Whole(x) => Self::Components([0; 3].map(|_| Source::new(x, None))),
        }
    }

    /// Whether it is constant.
    pub fn is_constant(&self) -> bool {
        self.sources().iter().all(|s| matches!(s, Source::Constant(_)))
    }

    pub(crate) fn sources(&self) -> &[Source<S>] {
        match self {
            Self::Components(c) => c,
            Self::Function(f) => f,
        }
    }

    /// The value at an instant.
    #[inline(always)]
    pub(crate) fn at(&self, i: &Instant<S>, what: &str, memory: &mut Vec<f64>) -> Result<Vec3<S>, SystemError> {
        match self {
            Self::Components([x, y, z]) => {
                Ok(Vec3([x.at(i, what, memory)?, y.at(i, what, memory)?, z.at(i, what, memory)?]))
            }
            Self::Function([Source::Function(k)]) => Ok(Vec3(S::call(i.arguments(), memory, |t, q, v| {
                i.asked(q, what, |q| {
                    let x = i.callers.functions.vector(*k, t, q, v).map_err(|e| failed(what, e))?;
                    finite(x, what, t)
                })
            })?)),
            Self::Function([x]) => Ok(Vec3([x.at(i, what, memory)?; 3])),
        }
    }
}

/// The number at a place of those that are given from outside.
fn given<S: Scalar>(callers: &Callers, place: usize) -> S {
    S::given(place, callers.functions.given_number(place))
}

/// Value, first and second derivative at t of the course whose first number is at a place.
fn course_at<S: Scalar>(callers: &Callers, place: usize, t: S) -> [S; 3] {
    let [since, a, b, c, d] = std::array::from_fn(|k| given::<S>(callers, place + k));
    let x = t - since;
    let (twice, bend) = (c.scale(2.0), d.scale(3.0) * x);
    [a + (b + (c + d * x) * x) * x, b + (twice + bend) * x, twice + d.scale(6.0) * x]
}

/// Position, velocity, acceleration of a drive at t.
pub(crate) fn motion_at<S: Scalar>(
    v: &Value,
    callers: &Callers,
    t: S,
    what: &str,
    memory: &mut Vec<f64>,
) -> Result<[S; 3], SystemError> {
    match v {
        Value::Constant(x) => Ok([S::from_f64(*x), S::zero(), S::zero()]),
        Value::Table(table) => table_at(table, t, what),
        Value::Function(i) => match callers.functions.given(*i) {
            Some(place) => Ok(course_at(callers, place, t)),
            None => S::call(Arguments { t, q: &[], v: &[], q_sizes: &[], v_sizes: &[] }, memory, |t, _, _| {
                let x = callers.functions.motion(*i, t).map_err(|e| failed(what, e))?;
                finite(x, what, t)
            }),
        },
    }
}

/// A prescribed orientation at one time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Turned<S> {
    /// Rotation, row by row.
    pub rotation: [[S; 3]; 3],
    /// Angular velocity, in the axes that it rotates.
    pub spin: [S; 3],
    /// Angular acceleration in these axes.
    pub growth: [S; 3],
}

/// Terms of the series of a sine over its angle: a table rotates by less than a turn from break to break, and for half
/// of that the last one is 1e-20.
const TERMS: i32 = 16;

/// `cos √x`, `sin √x / √x` and the first two derivatives of the latter over x: even functions of an angle, by their
/// series, without a root that is not differentiable at 0.
fn sines<S: Scalar>(x: S) -> [S; 4] {
    let mut sums = [S::zero(); 4];
    for n in (0..TERMS).rev() {
        let m = f64::from(n);
        // 1 / (2n)! and the like, signs alternating, by Horner's rule on ratios of neighbours
        let step = |first: f64| -1.0 / ((2.0 * m + first) * (2.0 * m + first + 1.0));
        sums[0] = S::one() + x * sums[0].scale(step(1.0));
        sums[1] = S::one() + x * sums[1].scale(step(2.0));
    }
    // derivatives of Σ c_n xⁿ, c_n = (−1)ⁿ / (2n + 1)!
    let mut c = 1.0;
    let coefficients: [f64; TERMS as usize] = std::array::from_fn(|n| {
        let m = n as f64;
        c *= if n == 0 { 1.0 } else { -1.0 / (2.0 * m * (2.0 * m + 1.0)) };
        c
    });
    for (n, c) in coefficients.iter().enumerate().rev() {
        let m = n as f64;
        if n >= 1 {
            sums[2] = sums[2] * x + S::from_f64(m * c);
        }
        if n >= 2 {
            sums[3] = sums[3] * x + S::from_f64(m * (m - 1.0) * c);
        }
    }
    sums
}

/// The prescribed orientation at t.
pub(crate) fn turned_at<S: Scalar>(
    turning: &Turning,
    callers: &Callers,
    t: S,
    what: &str,
    memory: &mut Vec<f64>,
) -> Result<Turned<S>, SystemError> {
    let zero = [S::zero(); 3];
    match turning {
        Turning::Held(r) => Ok(Turned { rotation: r.map(|row| row.map(S::from_f64)), spin: zero, growth: zero }),
        Turning::Function(i) => {
            let arguments = Arguments { t, q: &[], v: &[], q_sizes: &[], v_sizes: &[] };
            let x = S::call(arguments, memory, |t, _, _| {
                let x = callers.functions.turning(*i, t).map_err(|e| failed(what, e))?;
                finite(x, what, t)
            })?;
            let three = |from: usize| [x[from], x[from + 1], x[from + 2]];
            Ok(Turned { rotation: [three(0), three(3), three(6)], spin: three(9), growth: three(12) })
        }
        Turning::Table { vectors, rotations } => {
            // half the rotation vector from the last break, and its derivatives
            let mut half = [[S::zero(); 3]; 3];
            for (i, vector) in vectors.iter().enumerate() {
                let found = table_at(vector, t, what)?;
                (0..3).for_each(|level| half[level][i] = found[level].scale(0.5));
            }
            let [h, h1, h2] = half.map(Vec3);
            let (x, x1) = (h.dot(h), h.dot(h1).scale(2.0));
            let x2 = (h1.dot(h1) + h.dot(h2)).scale(2.0);
            let [c, s, s_x, s_xx] = sines(x);
            let (s1, s2) = (s_x * x1, s_xx * x1 * x1 + s_x * x2);
            // d cos √x / dx = −s / 2
            let (c1, c2) = (-(s * x1).scale(0.5), -(s1 * x1 + s * x2).scale(0.5));
            let quaternion = |w: S, v: Vec3<S>| Quaternion([w, v.0[0], v.0[1], v.0[2]]);
            let p = quaternion(c, h.times(s));
            let p1 = quaternion(c1, h.times(s1) + h1.times(s));
            let p2 = quaternion(c2, h.times(s2) + h1.times(s1.scale(2.0)) + h2.times(s));
            let back = quaternion(c, -h.times(s));
            let twice = |q: Quaternion<S>| [1, 2, 3].map(|i| back.times(&q).0[i].scale(2.0));
            let (_, first) = t.interval(&vectors[0].breaks, rotations);
            Ok(Turned { rotation: Quaternion(first).times(&p).matrix().0, spin: twice(p1), growth: twice(p2) })
        }
    }
}

/// Refuse an orientation that cannot be evaluated.
pub fn check_turning(x: &Turning, functions: usize, name: &str) -> Result<(), DescriptionError> {
    let fail = |m: String| Err(DescriptionError::new("drive", name, m));
    let unit = |norm: f64| (norm - 1.0).abs() < tolerance::EQUAL_IN_SIX_DIGITS;
    match x {
        Turning::Held(r) => {
            let m = Mat3(*r);
            let rows =
                (0..3).all(|i| unit(m.column(i).norm())) && unit(m.column(0).cross(m.column(1)).dot(m.column(2)));
            match rows {
                true => Ok(()),
                false => fail(format!(
                    "{r:?} is not a rotation; give a matrix whose columns are unit axes at right \
                        angles"
                )),
            }
        }
        Turning::Function(i) => check(&Value::Function(*i), functions, "drive", name),
        Turning::Table { vectors, rotations } => {
            vectors.iter().try_for_each(|v| check(&Value::Table(v.clone()), functions, "drive", name))?;
            let same = vectors.iter().all(|v| v.breaks == vectors[0].breaks);
            if !same || rotations.len() + 1 != vectors[0].breaks.len() {
                return fail("its table of rotations needs common breakpoints and one quaternion per interval".into());
            }
            match rotations.iter().all(|q| unit(q.iter().map(|x| x * x).sum::<f64>())) {
                true => Ok(()),
                false => fail("its table of rotations needs unit quaternions".into()),
            }
        }
    }
}

/// Refuse values that cannot be evaluated.
pub fn check(v: &Value, functions: usize, element: &'static str, name: &str) -> Result<(), DescriptionError> {
    let fail = |m: String| Err(DescriptionError::new(element, name, m));
    match v {
        Value::Constant(x) if !x.is_finite() => fail(format!("its value is {x}; give a finite number")),
        Value::Constant(_) => Ok(()),
        Value::Table(t) => {
            let ascending = t.breaks.windows(2).all(|w| w[0] < w[1]);
            let finite = t.breaks.iter().chain(t.coefficients.iter().flatten()).all(|x| x.is_finite());
            if t.breaks.len() < 2 || t.breaks.len() != t.coefficients.len() + 1 || !ascending || !finite {
                return fail(format!(
                    "its table needs increasing, finite breakpoints and one cubic per interval ({} breaks, {} \
                     cubics)",
                    t.breaks.len(),
                    t.coefficients.len()
                ));
            }
            Ok(())
        }
        Value::Function(i) if *i >= functions => {
            fail(format!("it names function {i}, but {functions} functions were given"))
        }
        Value::Function(_) => Ok(()),
    }
}
