//! Least squares of identification.

use crate::arrays::{any_vector, array};
use crate::failure::{self, guarded, unexpected};
use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use partita_analysis::identification::{fit, Data};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Rank, base parameters, changes and standard deviations, by name: derivatives (nt, channels, n), residuals
/// (nt, channels), sizes and noise of the channels, natural sizes and preference of the parameters.
#[pyfunction]
pub fn least_squares<'py>(
    py: Python<'py>,
    derivatives: PyReadonlyArray3<'py, f64>,
    residuals: PyReadonlyArray2<'py, f64>,
    sizes: PyReadonlyArray1<'py, f64>,
    noise: PyReadonlyArray1<'py, f64>,
    scales: PyReadonlyArray1<'py, f64>,
    preference: PyReadonlyArray1<'py, f64>,
) -> PyResult<Bound<'py, PyDict>> {
    guarded(py, || {
        let (sizes, noise) = (any_vector(&sizes), any_vector(&noise));
        let (scales, preference) = (any_vector(&scales), any_vector(&preference));
        let (m, n) = (sizes.len(), scales.len());
        let fits = derivatives.shape()[1..] == [m, n] && residuals.shape() == [derivatives.shape()[0], m];
        if !fits || noise.len() != m || preference.len() != n {
            return Err(unexpected("the shapes of a regressor do not fit".into()));
        }
        let (y, r) = (derivatives.as_array(), residuals.as_array());
        let (y, r): (Vec<f64>, Vec<f64>) = (y.iter().copied().collect(), r.iter().copied().collect());
        let data = Data {
            derivatives: &y,
            residuals: &r,
            sizes: &sizes,
            noise: &noise,
            scales: &scales,
            preference: &preference,
        };
        let found = py.detach(|| fit(&data)).map_err(|e| failure::analysis(py, e))?;
        let (rank, others) = (found.rank, n - found.rank);
        let d = PyDict::new(py);
        d.set_item("rank", rank)?;
        d.set_item("base", found.base)?;
        d.set_item("dependent", found.dependent)?;
        d.set_item("drowned", found.drowned)?;
        let arrays: [(&str, Vec<f64>, &[usize]); 10] = [
            ("singular", found.singular, &[n]),
            ("coefficients", found.coefficients, &[rank, others]),
            ("changes", found.changes, &[n]),
            ("base_changes", found.base_changes, &[rank]),
            ("base_deviations", found.base_deviations, &[rank]),
            ("deviations", found.deviations, &[n]),
            ("directions", found.directions, &[rank, n]),
            ("direction_deviations", found.direction_deviations, &[rank]),
            ("noise", found.noise, &[m]),
            ("left", found.left, &[m]),
        ];
        for (name, data, shape) in arrays {
            d.set_item(name, array(py, shape, data))?;
        }
        Ok(d)
    })
}
