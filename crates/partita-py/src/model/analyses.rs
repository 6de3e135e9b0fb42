//! Analyses of a compiled mechanism: positions, their limits, what is asked of one state.

use super::{Assembled, Model, Table, Vector};
use crate::analyses;
use crate::arrays::{array, matrix, vector};
use crate::ensemble::{self, MemberStates};
use crate::failure::{self, guarded};
use crate::poses;
use crate::run::Options;
use crate::state::Array;
use crate::waiting::heard;
use pyo3::prelude::*;
use pyo3::types::PyDict;

#[pymethods]
impl Model {
    /// (q, v) with the loops closed: `targets` by level, `rates` of velocities, `turns` those of other coordinates;
    /// also the JSON report.
    #[pyo3(signature = (t, q, v, targets, rates, turns, fixed, guess, tolerance))]
    fn assemble<'py>(
        slf: &Bound<'py, Self>,
        t: f64,
        q: Vector<'py>,
        v: Vector<'py>,
        targets: Vec<Vec<poses::Valued>>,
        rates: Vec<(usize, f64)>,
        turns: Vec<poses::Valued>,
        fixed: Vec<poses::Named>,
        guess: Vec<poses::Valued>,
        tolerance: f64,
    ) -> PyResult<(Array<'py>, Array<'py>, String)> {
        let py = slf.py();
        guarded(py, || {
            let (model, own) = (slf.get(), slf.clone().unbind());
            let (q, near) = model.state(&q, &v)?;
            let wanted = poses::Wanted::read(py, &model.inner, targets, rates, turns, fixed, guess, tolerance)?;
            let ask = move || wanted.assemble(&own.get().inner, t, &q, &near);
            let (q, v, report) = heard(py, model.is_large(), ask)?.map_err(|e| failure::system(py, e))?;
            Ok((array(py, &[q.len()], q), array(py, &[v.len()], v), report))
        })
    }

    /// Functions in C recorded at the closed position q: name, declaration, text and operations of each. Without
    /// actuators those of the motion, else the map between these velocities and those of the joints.
    #[pyo3(signature = (name, t, q, actuators, joints))]
    fn c_functions(
        &self,
        py: Python<'_>,
        name: &str,
        t: f64,
        q: Vector<'_>,
        actuators: Option<Vec<usize>>,
        joints: Vec<usize>,
    ) -> PyResult<Vec<(String, String, String, usize)>> {
        guarded(py, || {
            let (model, q) = (&self.inner, vector(&q, self.nq(), "q")?);
            let made = match &actuators {
                None => model.c_rates(name).and_then(|rates| Ok(vec![rates, model.c_accelerations(name, t, &q)?])),
                Some(actuators) => model.c_actuator_map(name, (t, &q), actuators, &joints),
            };
            let made = made.map_err(|e| failure::system(py, e))?;
            Ok(made.into_iter().map(|f| (f.name, f.head, f.text, f.operations)).collect())
        })
    }

    /// All positions that close for the input values in the closed position q: (q, branches, residual) of each, names
    /// of the blocks, notes.
    #[pyo3(signature = (t, q, inputs))]
    fn assemblies<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        q: Vector<'py>,
        inputs: Option<Vec<usize>>,
    ) -> PyResult<(Vec<Assembled<'py>>, Vec<String>, Vec<String>)> {
        guarded(py, || {
            let q = vector(&q, self.nq(), "q")?;
            let all = self.inner.assemblies(t, &q, inputs.as_deref()).map_err(|e| failure::system(py, e))?;
            let found = all.found.into_iter().map(|a| (array(py, &[a.q.len()], a.q), a.branches, a.residual)).collect();
            Ok((found, all.blocks, all.notes))
        })
    }

    /// Positions in which the goals have the values of each row, on the branch of the closed position q, by name; rows of
    /// a `grid` of this shape from neighbour to neighbour.
    #[pyo3(signature = (t, q, goals, values, grid=None))]
    fn poses<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        q: Vector<'py>,
        goals: Vec<poses::Named>,
        values: Table<'py>,
        grid: Option<Vec<usize>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        guarded(py, || poses::many(py, &self.inner, t, &q, &goals, &values, grid.as_deref()))
    }

    /// Motions of many members: other states in the rows of q and v, other `parameters` (names and how many numbers each
    /// has) in the rows of `values`.
    #[pyo3(signature = (options, t_eval, q, v, parameters, values, assembles, workers, progress))]
    fn ensemble<'py>(
        &self,
        py: Python<'py>,
        options: &Options,
        t_eval: Vector<'py>,
        q: Table<'py>,
        v: Table<'py>,
        parameters: Vec<(String, usize)>,
        values: Table<'py>,
        assembles: bool,
        workers: Option<usize>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let given = MemberStates { q: &q, v: &v, parameters, values: &values, assembles };
        guarded(py, || ensemble::ensemble(py, &self.inner, options, &t_eval, given, workers, progress))
    }

    /// Velocities and accelerations for which the goals move at the rates and accelerations of each row, at the closed
    /// positions in the rows of q, by name; `near` is a regular one.
    #[pyo3(signature = (t, near, q, goals, rates, accelerations))]
    fn rates<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        near: Vector<'py>,
        q: Table<'py>,
        goals: Vec<poses::Named>,
        rates: Table<'py>,
        accelerations: Table<'py>,
    ) -> PyResult<Bound<'py, PyDict>> {
        guarded(py, || poses::rates(py, &self.inner, (t, &near), &q, &goals, (&rates, &accelerations)))
    }

    /// Degrees of freedom at the closed position q, and rotations among them that move no other body.
    #[pyo3(signature = (t, q))]
    fn degrees_of_freedom(&self, py: Python<'_>, t: f64, q: Vector<'_>) -> PyResult<(usize, usize)> {
        guarded(py, || poses::degrees_of_freedom(py, &self.inner, t, &q))
    }

    /// Where the straight path of the goals from the closed position q to the values `to` ends: q, values of the goals,
    /// and whether it is located to round-off; None where it does not end.
    #[pyo3(signature = (t, q, goals, to))]
    fn limit<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        q: Vector<'py>,
        goals: Vec<poses::Named>,
        to: Vector<'py>,
    ) -> PyResult<Option<poses::Ended<'py>>> {
        guarded(py, || poses::limit(py, &self.inner, t, &q, &goals, &to))
    }

    /// Where `reading` is stationary on the straight path of the goals from the closed position q to the values `to`: q
    /// and the fraction of the path.
    #[pyo3(signature = (t, q, goals, to, reading))]
    fn stationary<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        q: Vector<'py>,
        goals: Vec<poses::Named>,
        to: Vector<'py>,
        reading: poses::Named,
    ) -> PyResult<Option<(Array<'py>, f64)>> {
        guarded(py, || poses::stationary(py, &self.inner, t, &q, &goals, &to, reading))
    }

    /// (q, v) of this model where every body is and moves as in another one of the same description.
    fn transferred<'py>(
        &self,
        py: Python<'py>,
        other: &Model,
        q: Vector<'py>,
        v: Vector<'py>,
    ) -> PyResult<(Array<'py>, Array<'py>)> {
        guarded(py, || {
            let (q, v) = other.state(&q, &v)?;
            self.inner.check_transfer(&other.inner, &q).map_err(|e| failure::system(py, e))?;
            let (q, v) = self.inner.transferred(&other.inner, &q, &v);
            Ok((array(py, &[q.len()], q), array(py, &[v.len()], v)))
        })
    }

    /// The linearised equations about (t, q, v), with a column of E in each row of `efforts`, and the accelerations of the
    /// drives with these rows as inputs.
    #[pyo3(signature = (t, q, v, efforts, independent = None, drives = Vec::new(), beside = true))]
    fn linearized<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        q: Vector<'py>,
        v: Vector<'py>,
        efforts: Table<'py>,
        independent: Option<Vec<usize>>,
        drives: Vec<usize>,
        beside: bool,
    ) -> PyResult<Bound<'py, PyDict>> {
        guarded(py, || {
            let (q, v) = self.state(&q, &v)?;
            let (_, _, efforts) = matrix(&efforts);
            analyses::linearized(py, &self.inner, (t, &q, &v), independent.as_deref(), &efforts, &drives, beside)
        })
    }

    /// q moved by the displacement in each row, its loops closed.
    fn displaced<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        q: Vector<'py>,
        displacements: Table<'py>,
    ) -> PyResult<Array<'py>> {
        guarded(py, || {
            let q = vector(&q, self.nq(), "q")?;
            analyses::displaced(py, &self.inner, t, &q, &matrix(&displacements).2)
        })
    }
}
