//! Numbers, tables and functions of time and state.

use crate::error::DescriptionError;
use crate::spec::{Table, Value, VectorValue};
use partita_system::SystemError;

/// The functions handed along with a description.
pub trait Functions: Send + Sync {
    /// Number of functions.
    fn count(&self) -> usize;
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

/// Value, first and second derivative of a table at t.
pub fn table_at(table: &Table, t: f64, what: &str) -> Result<[f64; 3], SystemError> {
    let (from, to) = (table.breaks[0], table.breaks[table.breaks.len() - 1]);
    // steps end on the last break up to round-off
    let slack = 1e-9 * (to - from);
    if !(t >= from - slack && t <= to + slack) {
        return Err(SystemError::OutsideTable { what: what.into(), t, from, to });
    }
    let i = table.breaks.partition_point(|b| *b <= t).clamp(1, table.coefficients.len()) - 1;
    let x = t - table.breaks[i];
    let [a, b, c, d] = table.coefficients[i];
    Ok([((a * x + b) * x + c) * x + d, (3.0 * a * x + 2.0 * b) * x + c, 6.0 * a * x + 2.0 * b])
}

fn finite(x: f64, what: &str, t: f64) -> Result<f64, SystemError> {
    if x.is_finite() {
        Ok(x)
    } else {
        Err(SystemError::NotFinite { what: what.into(), t })
    }
}

/// A value at (t, q, v).
pub fn scalar_at(v: &Value, f: &dyn Functions, t: f64, q: &[f64], u: &[f64], what: &str) -> Result<f64, SystemError> {
    match v {
        Value::Constant(x) => Ok(*x),
        Value::Table(table) => Ok(table_at(table, t, what)?[0]),
        Value::Function(i) => {
            let x = f.scalar(*i, t, q, u).map_err(|source| SystemError::Function { what: what.into(), source })?;
            finite(x, what, t)
        }
    }
}

/// A vector at (t, q, v).
pub fn vector_at(
    v: &VectorValue,
    f: &dyn Functions,
    t: f64,
    q: &[f64],
    u: &[f64],
    what: &str,
) -> Result<[f64; 3], SystemError> {
    match v {
        VectorValue::Components([a, b, c]) => {
            Ok([scalar_at(a, f, t, q, u, what)?, scalar_at(b, f, t, q, u, what)?, scalar_at(c, f, t, q, u, what)?])
        }
        VectorValue::Whole(Value::Function(i)) => {
            let x = f.vector(*i, t, q, u).map_err(|source| SystemError::Function { what: what.into(), source })?;
            for x in x {
                finite(x, what, t)?;
            }
            Ok(x)
        }
        VectorValue::Whole(v) => {
            let x = scalar_at(v, f, t, q, u, what)?;
            Ok([x, x, x])
        }
    }
}

/// Position, velocity, acceleration of a drive at t.
pub fn motion_at(v: &Value, f: &dyn Functions, t: f64, what: &str) -> Result<[f64; 3], SystemError> {
    match v {
        Value::Constant(x) => Ok([*x, 0.0, 0.0]),
        Value::Table(table) => table_at(table, t, what),
        Value::Function(i) => {
            let x = f.motion(*i, t).map_err(|source| SystemError::Function { what: what.into(), source })?;
            for x in x {
                finite(x, what, t)?;
            }
            Ok(x)
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
                    "its table needs ascending, finite break points and one cubic an interval ({} breaks, {} cubics)",
                    t.breaks.len(),
                    t.coefficients.len()
                ));
            }
            Ok(())
        }
        Value::Function(i) if *i >= functions => {
            fail(format!("it names function {i}, but {functions} functions were handed along"))
        }
        Value::Function(_) => Ok(()),
    }
}
