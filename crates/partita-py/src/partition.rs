//! The criterion for plain matrices.

use crate::arrays::{array, dense, indices, matrix};
use crate::failure::{self, guarded, raise};
use numpy::{PyArrayDyn, PyReadonlyArray1, PyReadonlyArray2};
use partita_analysis::matrices::{Choice, Matrices};
use partita_math::dense::Matrix;
use partita_system::partition::Selection;
use pyo3::prelude::*;
use pyo3::types::PyDict;

fn matrices(
    py: Python<'_>,
    mass: &PyReadonlyArray2<'_, f64>,
    jacobian: &PyReadonlyArray2<'_, f64>,
) -> PyResult<Matrices> {
    Matrices::new(read(mass), read(jacobian)).map_err(|e| failure::analysis(py, e))
}

fn read(x: &PyReadonlyArray2<'_, f64>) -> Matrix {
    let (rows, columns, data) = matrix(x);
    Matrix::from_vec(rows, columns, data)
}

/// rho (nv,).
#[pyfunction]
pub fn measure<'py>(
    py: Python<'py>,
    mass: PyReadonlyArray2<'py, f64>,
    jacobian: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    guarded(py, || {
        let rho = matrices(py, &mass, &jacobian)?.measure().map_err(|e| failure::analysis(py, e))?;
        Ok(array(py, &[rho.len()], rho))
    })
}

/// independent, dependent, A, D, rho, sigma, sqrt_mu, rows.
#[pyfunction]
#[pyo3(signature = (mass, jacobian, threshold, weights, selection="collective", fixed=None))]
pub fn choose<'py>(
    py: Python<'py>,
    mass: PyReadonlyArray2<'py, f64>,
    jacobian: PyReadonlyArray2<'py, f64>,
    threshold: f64,
    weights: Option<PyReadonlyArray1<'py, f64>>,
    selection: &str,
    fixed: Option<Vec<usize>>,
) -> PyResult<Bound<'py, PyDict>> {
    guarded(py, || {
        let both = matrices(py, &mass, &jacobian)?;
        let n = mass.as_array().nrows();
        let weights = weights.map(|w| crate::arrays::vector(&w, n, "weights")).transpose()?;
        let Some(rule) = Selection::by_name(selection) else {
            let names: Vec<&str> = Selection::ALL.iter().map(|s| s.name()).collect();
            let message = format!("there is no selection \"{selection}\"; choose among {}", names.join(", "));
            return Err(raise(py, "ArgumentError", &message, &[("argument", "selection".into())]));
        };
        let choice = Choice { rule, threshold, weights, fixed };
        let found = both.choose(&choice).map_err(|e| failure::analysis(py, e))?;
        let d = PyDict::new(py);
        d.set_item("independent", indices(py, &found.split.independent))?;
        d.set_item("dependent", indices(py, &found.split.dependent))?;
        d.set_item("A", dense(py, found.split.a))?;
        d.set_item("D", dense(py, found.split.d))?;
        d.set_item("rho", array(py, &[n], found.rho))?;
        d.set_item("sigma", found.quality.sigma)?;
        d.set_item("sqrt_mu", found.quality.sqrt_mu)?;
        d.set_item("rows", indices(py, &found.split.rows))?;
        Ok(d)
    })
}

/// k, k_constrained, k_tangential, P_c, P_d, M_c, M_d, T_cd, M_s, sqrt_mu, rows; independent and dependent without a selector.
#[pyfunction]
#[pyo3(signature = (mass, jacobian, fixed=None, selector=None))]
pub fn geometry<'py>(
    py: Python<'py>,
    mass: PyReadonlyArray2<'py, f64>,
    jacobian: PyReadonlyArray2<'py, f64>,
    fixed: Option<Vec<usize>>,
    selector: Option<PyReadonlyArray2<'py, f64>>,
) -> PyResult<Bound<'py, PyDict>> {
    guarded(py, || {
        let both = matrices(py, &mass, &jacobian)?;
        let selector = selector.as_ref().map(read);
        let (g, split) = both.geometry(fixed, selector.as_ref()).map_err(|e| failure::analysis(py, e))?;
        let d = PyDict::new(py);
        for (name, x) in [("k", g.k), ("k_constrained", g.k_constrained), ("k_tangential", g.k_tangential)] {
            d.set_item(name, array(py, &[x.len()], x))?;
        }
        for (name, x) in
            [("P_c", g.p_c), ("P_d", g.p_d), ("M_c", g.m_c), ("M_d", g.m_d), ("T_cd", g.t_cd), ("M_s", g.m_s)]
        {
            d.set_item(name, dense(py, x))?;
        }
        d.set_item("sqrt_mu", g.sqrt_mu)?;
        d.set_item("rows", indices(py, &split.rows))?;
        if selector.is_none() {
            d.set_item("independent", indices(py, &split.independent))?;
            d.set_item("dependent", indices(py, &split.dependent))?;
        }
        Ok(d)
    })
}
