//! Arrays between Python and Rust.

use numpy::ndarray::{ArrayD, IxDyn};
use numpy::{
    IntoPyArray, PyArray1, PyArrayDyn, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArray,
    PyUntypedArrayMethods, ToPyArray,
};
use partita_math::dense::Matrix;
use pyo3::prelude::*;
use pyo3::types::{PyFloat, PyList, PyTuple};
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

/// `times` as a flat array of floats where it is one, or a list or tuple of floats, and increases from t0 to t_end; None
/// otherwise.
#[pyfunction]
pub fn increasing<'py>(times: &Bound<'py, PyAny>, t0: f64, t_end: f64) -> Option<Bound<'py, PyAny>> {
    // written so that NaN is outside
    let fits = |x: &[f64]| match x {
        [first, .., last] => *first >= t0 && *last <= t_end && x.windows(2).all(|x| x[0] < x[1]),
        [only] => t0 <= *only && *only <= t_end,
        [] => false,
    };
    if times.is_exact_instance_of::<PyUntypedArray>() {
        let array = times.cast::<PyArray1<f64>>().ok()?.try_readonly().ok()?;
        return fits(&entries_of(&array)).then(|| times.clone());
    }
    let listed: Vec<f64> = if let Ok(list) = times.cast_exact::<PyList>() {
        list.iter().map(|x| number(&x)).collect::<Option<_>>()?
    } else {
        times.cast_exact::<PyTuple>().ok()?.iter().map(|x| number(&x)).collect::<Option<_>>()?
    };
    fits(&listed).then(|| listed.into_pyarray(times.py()).into_any())
}

/// A float; None for everything else.
fn number(x: &Bound<'_, PyAny>) -> Option<f64> {
    x.cast::<PyFloat>().ok().map(|x| x.value())
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
    // `as_slice` also has arrays that lie column by column
    let by_rows = x.as_slice().ok().filter(|_| x.is_c_contiguous());
    Ok(by_rows.map_or_else(|| Cow::Owned(matrix(x).2), Cow::Borrowed))
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
