//! Arrays between Python and Rust.

use numpy::ndarray::{ArrayD, IxDyn};
use numpy::{
    IntoPyArray, PyArrayDyn, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods, ToPyArray,
};
use partita_math::dense::Matrix;
use pyo3::prelude::*;
use std::borrow::Cow;

use crate::failure::raise;

/// A copy of a one-dimensional array of the given length, all finite.
pub fn vector(x: &PyReadonlyArray1<'_, f64>, length: usize, what: &str) -> PyResult<Vec<f64>> {
    let v = any_vector(x);
    if v.len() != length {
        let message = format!("{what} has {} entries, the model has {length}", v.len());
        return Err(raise(x.py(), "ArgumentError", &message, &[("argument", what.into())]));
    }
    if let Some(i) = v.iter().position(|x| !x.is_finite()) {
        let message = format!("{what}[{i}] = {} is not a finite number", v[i]);
        return Err(raise(x.py(), "ArgumentError", &message, &[("argument", what.into())]));
    }
    Ok(v)
}

/// A copy of a one-dimensional array.
pub fn any_vector(x: &PyReadonlyArray1<'_, f64>) -> Vec<f64> {
    x.as_array().iter().copied().collect()
}

/// Whether `times` is a flat array of increasing numbers from t0 to t_end.
#[pyfunction]
pub fn increases(times: &Bound<'_, PyAny>, t0: f64, t_end: f64) -> bool {
    let Ok(times) = times.extract::<PyReadonlyArray1<'_, f64>>() else { return false };
    let times = entries_of(&times);
    let (Some(first), Some(last)) = (times.first(), times.last()) else { return false };
    // written so that NaN is outside
    *first >= t0 && *last <= t_end && times.windows(2).all(|x| x[0] < x[1])
}

/// An array of the given shape from its entries, row by row.
pub fn array<'py>(py: Python<'py>, shape: &[usize], data: Vec<f64>) -> Bound<'py, PyArrayDyn<f64>> {
    shaped(py, shape, data)
}

/// Same for any entries that NumPy knows.
pub fn shaped<'py, T: numpy::Element + Clone + Default>(
    py: Python<'py>,
    shape: &[usize],
    data: Vec<T>,
) -> Bound<'py, PyArrayDyn<T>> {
    match ArrayD::from_shape_vec(IxDyn(shape), data) {
        Ok(a) => a.into_pyarray(py),
        // a wrong count is an error of this crate: an empty array shows it, a crash would not
        Err(_) => ArrayD::<T>::default(IxDyn(&[0])).to_pyarray(py),
    }
}

/// A matrix as an array.
pub fn dense(py: Python<'_>, x: Matrix) -> Bound<'_, PyArrayDyn<f64>> {
    array(py, &[x.rows(), x.cols()], x.into_vec())
}

/// Indices as an array of integers.
pub fn indices<'py>(py: Python<'py>, x: &[usize]) -> Bound<'py, PyArrayDyn<i64>> {
    shaped(py, &[x.len()], x.iter().map(|&i| i as i64).collect())
}

/// The entries of a vector, copied only where they are not contiguous.
pub fn entries_of<'x>(x: &'x PyReadonlyArray1<'_, f64>) -> Cow<'x, [f64]> {
    x.as_slice().map_or_else(|_| Cow::Owned(any_vector(x)), Cow::Borrowed)
}

/// The entries of a matrix with one row per time, its shape checked.
pub fn rows_of<'x>(x: &'x PyReadonlyArray2<'_, f64>, nt: usize, width: usize, what: &str) -> PyResult<Cow<'x, [f64]>> {
    let shape = x.shape();
    if (shape[0], shape[1]) != (nt, width) {
        let message = format!("{what} is {} x {}; it must be {nt} x {width}, a row for each time", shape[0], shape[1]);
        return Err(raise(x.py(), "ArgumentError", &message, &[("argument", what.into())]));
    }
    Ok(x.as_slice().map_or_else(|_| Cow::Owned(matrix(x).2), Cow::Borrowed))
}

/// Contiguous copy of a matrix, with its shape.
pub fn matrix(x: &PyReadonlyArray2<'_, f64>) -> (usize, usize, Vec<f64>) {
    let shape = x.shape();
    (shape[0], shape[1], x.as_array().iter().copied().collect())
}

/// Entries of an array that a callback returned, or `None` if it is not an array of numbers.
pub fn entries(x: &Bound<'_, PyAny>) -> Option<Vec<f64>> {
    let a = x.cast::<PyArrayDyn<f64>>().ok()?;
    Some(a.readonly().as_array().iter().copied().collect())
}
