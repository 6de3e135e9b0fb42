//! The criterion for plain matrices.

use crate::arrays::{array, matrix, shaped};
use crate::failure::{self, guarded, raise};
use numpy::{PyArrayDyn, PyReadonlyArray1, PyReadonlyArray2};
use partita_math::dense::{self, Matrix};
use partita_math::elimination::Pattern;
use partita_math::rank::independent_rows;
use partita_system::equations::{ByHand, Equations};
use partita_system::formulation::reduction::Reduction;
use partita_system::partition::Selection;
use partita_system::start;
use partita_system::tangent::chooser;
use partita_system::SystemError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// M and C at one point, as a system at rest.
struct Frozen {
    mass: Vec<f64>,
    c: Vec<f64>,
    n: usize,
    m: usize,
}

impl Equations for Frozen {
    fn n(&self) -> usize {
        self.n
    }
    fn rows(&self) -> usize {
        self.m
    }
    fn holonomic(&self) -> usize {
        self.m
    }
    fn name(&self, i: usize) -> String {
        format!("coordinate {i}")
    }
    fn rheonomic(&self) -> bool {
        false
    }
    fn mass(&self, _: f64, _: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        out.copy_from_slice(&self.mass);
        Ok(())
    }
    fn forces(&self, _: f64, _: &[f64], _: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        out.fill(0.0);
        Ok(())
    }
    fn constraints(&self, _: f64, _: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        out.fill(0.0);
        Ok(())
    }
    fn jacobian(&self, _: f64, _: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        out.copy_from_slice(&self.c);
        Ok(())
    }
    fn rate(&self, _: f64, _: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        out.fill(0.0);
        Ok(())
    }
    fn bias(&self, _: f64, _: &[f64], _: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        out.fill(0.0);
        Ok(())
    }
}

fn frozen(
    py: Python<'_>,
    mass: &PyReadonlyArray2<'_, f64>,
    jacobian: &PyReadonlyArray2<'_, f64>,
) -> PyResult<ByHand<Frozen>> {
    let ((n, columns, mass), (m, width, c)) = (matrix(mass), matrix(jacobian));
    let fail = |argument: &str, message: String| raise(py, "ArgumentError", &message, &[("argument", argument.into())]);
    if n == 0 || n != columns {
        return Err(fail("mass", format!("mass is {n} x {columns}; it must be square and not empty")));
    }
    if width != n {
        return Err(fail("jacobian", format!("jacobian has {width} columns, mass is {n} x {n}; both belong to q")));
    }
    for (what, x) in [("mass", &mass), ("jacobian", &c)] {
        if x.iter().any(|x| !x.is_finite()) {
            return Err(fail(what, format!("{what} has an entry that is not finite")));
        }
    }
    let size = mass.iter().fold(0.0, |s: f64, x| s.max(x.abs()));
    for i in 0..n {
        for j in 0..i {
            let (a, b) = (mass[i * n + j], mass[j * n + i]);
            // what summing in another order can leave
            if (a - b).abs() > 1e-9 * size {
                return Err(fail("mass", format!("mass is not symmetric: M[{i},{j}] = {a}, M[{j},{i}] = {b}; take the half sum with the transpose")));
            }
        }
    }
    let mut l = mass.clone();
    if let Err(e) = dense::cholesky(&mut l, n) {
        let message = format!(
            "mass is not positive definite: pivot {:.3e} at coordinate {}; every motion needs inertia",
            e.pivot, e.index
        );
        return Err(fail("mass", message));
    }
    Ok(ByHand::new(Frozen { mass, c, n, m }))
}

/// Reduction of M and C with their rank and an all-zero motion; also the rows dropped.
fn reduced(system: &ByHand<Frozen>) -> Result<(Reduction<'_, ByHand<Frozen>>, Vec<f64>), SystemError> {
    let q = vec![0.0; system.equations.n];
    let mut probe = Reduction::new(system, 0);
    probe.position(0.0, &q)?;
    probe.refresh_scales(0.0, &q)?;
    let pattern = Pattern::dense(system.equations.m, system.equations.n);
    // no motion to test redundancy with: the rank is that of the matrix given
    let rank = independent_rows(&pattern, &system.equations.c, probe.scales(), start::REDUNDANT).rank;
    Ok((Reduction::new(system, rank), q))
}

/// rho (nv,).
#[pyfunction]
pub fn measure<'py>(
    py: Python<'py>,
    mass: PyReadonlyArray2<'py, f64>,
    jacobian: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    guarded(py, || {
        let system = frozen(py, &mass, &jacobian)?;
        let compute = || -> Result<Vec<f64>, SystemError> {
            let (mut r, q) = reduced(&system)?;
            start::choose_partition(&mut r, 0.0, &q, None, None)?;
            r.evaluate(0.0, &q, &vec![0.0; r.k()])?;
            let mut rho = vec![0.0; q.len()];
            r.measure(0.0, &q, &mut rho)?;
            Ok(rho)
        };
        let rho = compute().map_err(|e| failure::system(py, e))?;
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
        let system = frozen(py, &mass, &jacobian)?;
        let n = system.equations.n;
        let weights = weights.map(|w| crate::arrays::vector(&w, n, "weights")).transpose()?;
        if threshold < 1.0 || threshold.is_nan() {
            let message = format!("threshold = {threshold}; an exchange must gain something, give 1 or more");
            return Err(raise(py, "ArgumentError", &message, &[("argument", "threshold".into())]));
        }
        let Some(rule) = Selection::by_name(selection) else {
            let names: Vec<&str> = Selection::ALL.iter().map(|s| s.name()).collect();
            let message = format!("there is no selection \"{selection}\"; choose among {}", names.join(", "));
            return Err(raise(py, "ArgumentError", &message, &[("argument", "selection".into())]));
        };
        if let Some(i) = fixed.iter().flatten().find(|&&i| i >= n) {
            let message = format!("fixed names coordinate {i}; there are {n}, numbered from 0");
            return Err(raise(py, "ArgumentError", &message, &[("argument", "fixed".into())]));
        }
        let compute = || -> Result<_, SystemError> {
            let (mut r, q) = reduced(&system)?;
            match (&fixed, rule) {
                (Some(fixed), _) => start::choose_partition(&mut r, 0.0, &q, None, Some(fixed))?,
                (None, Selection::Collective) => {
                    start::choose_with_threshold(&mut r, 0.0, &q, weights.as_deref(), threshold)?;
                }
                (None, rule) => {
                    chooser::check(rule, weights.as_deref(), None)?;
                    chooser::choose_by(&mut r, 0.0, &q, rule, weights.as_deref())?;
                }
            }
            r.evaluate(0.0, &q, &vec![0.0; r.k()])?;
            let mut rho = vec![0.0; n];
            r.measure(0.0, &q, &mut rho)?;
            let quality = r.quality(0.0, &q)?;
            Ok((r, rho, quality))
        };
        let (r, rho, quality) = compute().map_err(|e| failure::system(py, e))?;
        let (k, rank) = (r.k(), r.rank());
        // dependent ascending for the reader; A's rows follow
        let mut order: Vec<usize> = (0..rank).collect();
        order.sort_unstable_by_key(|&p| r.partition.dependent[p]);
        let dependent: Vec<i64> = order.iter().map(|&p| r.partition.dependent[p] as i64).collect();
        let a: Vec<f64> = order.iter().flat_map(|&p| r.a_matrix[p * k..(p + 1) * k].to_vec()).collect();
        let d_matrix = Matrix::from_vec(n, k, r.dt.clone()).transpose().into_vec();
        let mut rows: Vec<i64> = r.partition.rows.iter().map(|&i| i as i64).collect();
        rows.sort_unstable();
        let independent: Vec<i64> = r.partition.independent.iter().map(|&i| i as i64).collect();
        let d = PyDict::new(py);
        d.set_item("independent", shaped(py, &[k], independent))?;
        d.set_item("dependent", shaped(py, &[rank], dependent))?;
        d.set_item("A", array(py, &[rank, k], a))?;
        d.set_item("D", array(py, &[k, n], d_matrix))?;
        d.set_item("rho", array(py, &[n], rho))?;
        d.set_item("sigma", quality.sigma)?;
        d.set_item("sqrt_mu", quality.sqrt_mu)?;
        d.set_item("rows", shaped(py, &[rank], rows))?;
        Ok(d)
    })
}
