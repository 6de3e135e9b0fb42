//! Positions at rest: their search, families of them, loads that hold one.

use super::{Inner, Model, Table, Vector};
use crate::arrays::{array, dense, indices, matrix, vector};
use crate::ending::released;
use crate::failure::{self, guarded};
use crate::state::Array;
use partita_analysis::equilibrium::{self as statics, Equilibrium, Point, Unknown};
use partita_analysis::AnalysisError;
use partita_system::prelude::*;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::Arc;

fn reported(py: Python<'_>, found: Equilibrium) -> PyResult<Bound<'_, PyDict>> {
    let d = PyDict::new(py);
    d.set_item("q", array(py, &[found.q.len()], found.q))?;
    d.set_item("multipliers", array(py, &[found.multipliers.len()], found.multipliers))?;
    d.set_item("independent", indices(py, &found.independent))?;
    d.set_item("stiffness", dense(py, found.stiffness))?;
    d.set_item("curvatures", array(py, &[found.curvatures.len()], found.curvatures))?;
    d.set_item("symmetric", found.symmetric)?;
    d.set_item("iterations", found.iterations)?;
    Ok(d)
}

/// Positions as columns of a table.
fn points<'py>(py: Python<'py>, points: &[&Point], nq: usize) -> PyResult<Bound<'py, PyDict>> {
    let d = PyDict::new(py);
    let numbers = |of: &dyn Fn(&Point) -> f64| points.iter().map(|p| of(p)).collect::<Vec<f64>>();
    let q: Vec<f64> = points.iter().flat_map(|p| p.q.iter().copied()).collect();
    d.set_item("q", array(py, &[points.len(), nq], q))?;
    d.set_item("x", array(py, &[points.len()], numbers(&|p| p.x)))?;
    d.set_item("s", array(py, &[points.len()], numbers(&|p| p.s)))?;
    d.set_item("negative", points.iter().map(|p| p.negative).collect::<Vec<_>>())?;
    Ok(d)
}

#[pymethods]
impl Model {
    /// The position at rest that a search from the closed position q arrives at, none of the `known` ones.
    fn equilibrium<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        q: Vector<'py>,
        stable: bool,
        known: Table<'py>,
    ) -> PyResult<Bound<'py, PyDict>> {
        guarded(py, || {
            let q = vector(&q, self.inner.size().nq, "q")?;
            let (rows, _, numbers) = matrix(&known);
            let known: Vec<Vec<f64>> = (0..rows).map(|i| numbers[i * q.len()..][..q.len()].to_vec()).collect();
            let search = || statics::equilibrium(&self.inner, t, &q, stable, &known);
            reported(py, released(py, search).map_err(|e| failure::analysis(py, e))?)
        })
    }

    /// Whether two positions at rest belong to one continuum of them.
    fn indifferent<'py>(&self, py: Python<'py>, t: f64, start: Vector<'py>, end: Vector<'py>) -> PyResult<bool> {
        guarded(py, || {
            let nq = self.inner.size().nq;
            let (from, to) = (vector(&start, nq, "start")?, vector(&end, nq, "end")?);
            released(py, || statics::is_connected(&self.inner, t, &from, &to)).map_err(|e| failure::analysis(py, e))
        })
    }

    /// The same of a position at rest that is known.
    fn resting<'py>(&self, py: Python<'py>, t: f64, q: Vector<'py>) -> PyResult<Bound<'py, PyDict>> {
        guarded(py, || {
            let q = vector(&q, self.inner.size().nq, "q")?;
            let found = released(py, || statics::describe(&self.inner, t, &q)).map_err(|e| failure::analysis(py, e))?;
            reported(py, found)
        })
    }

    /// The family of equilibria through q at x, where parameters have the first numbers plus x times the second ones.
    fn equilibrium_family<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        q: Vector<'py>,
        along: Vec<(String, Vec<f64>, Vec<f64>)>,
        x: f64,
        asked: Vector<'py>,
    ) -> PyResult<Bound<'py, PyDict>> {
        guarded(py, || {
            let nq = self.inner.size().nq;
            let q = vector(&q, nq, "q")?;
            let asked = vector(&asked, asked.as_array().len(), "along")?;
            let equations = |x: f64| -> Result<Arc<Inner>, AnalysisError> {
                let numbers: Vec<Vec<f64>> =
                    along.iter().map(|(_, from, by)| from.iter().zip(by).map(|(a, b)| a + x * b).collect()).collect();
                let changes: Vec<(&str, &[f64])> =
                    along.iter().zip(&numbers).map(|(a, x)| (a.0.as_str(), x.as_slice())).collect();
                Ok(Arc::new(self.inner.with_parameters(&changes)?))
            };
            let found =
                released(py, || statics::family(&equations, t, &q, x, &asked)).map_err(|e| failure::analysis(py, e))?;
            let d = PyDict::new(py);
            d.set_item("points", points(py, &found.points.iter().collect::<Vec<_>>(), nq)?)?;
            d.set_item("asked", points(py, &found.asked.iter().map(|x| &x.1).collect::<Vec<_>>(), nq)?)?;
            d.set_item("which", found.asked.iter().map(|x| x.0).collect::<Vec<_>>())?;
            d.set_item("events", points(py, &found.events.iter().map(|x| &x.at).collect::<Vec<_>>(), nq)?)?;
            d.set_item("fold", found.events.iter().map(|x| x.fold).collect::<Vec<_>>())?;
            d.set_item("changes", found.events.iter().map(|x| (x.negative[0], x.negative[1])).collect::<Vec<_>>())?;
            let directions: Vec<f64> = found.events.iter().flat_map(|x| x.direction.iter().copied()).collect();
            d.set_item("directions", array(py, &[found.events.len(), self.inner.size().nv], directions))?;
            d.set_item("ends", found.ends.to_vec())?;
            Ok(d)
        })
    }

    /// Numbers of parameters, their natural sizes by powers of length and energy, with which the closed position q is one of rest.
    fn preload<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        q: Vector<'py>,
        unknown: Vec<(String, (i32, i32))>,
    ) -> PyResult<Vec<Vec<f64>>> {
        guarded(py, || {
            let q = vector(&q, self.inner.size().nq, "q")?;
            let unknown: Vec<Unknown> = unknown.into_iter().map(|(name, powers)| Unknown { name, powers }).collect();
            released(py, || statics::preload(&self.inner, t, &q, &unknown)).map_err(|e| failure::analysis(py, e))
        })
    }

    /// Size of a large displacement of each velocity: 1 for an angle, a length otherwise.
    fn characteristic_displacements<'py>(&self, py: Python<'py>) -> Array<'py> {
        let inner = &self.inner;
        let sizes: Vec<f64> = inner.structure().displacements().collect();
        array(py, &[sizes.len()], sizes)
    }

    /// Displacement from one position to another, in characteristic displacements.
    fn displacement_between<'py>(&self, py: Python<'py>, start: Vector<'py>, end: Vector<'py>) -> PyResult<Array<'py>> {
        let nq = self.inner.size().nq;
        let found =
            statics::displacement_between(&*self.inner, &vector(&start, nq, "start")?, &vector(&end, nq, "end")?);
        Ok(array(py, &[found.len()], found))
    }
}
