//! Equations S1-S5 given as Python functions.

use crate::arrays::{any_vector, array, entries_of, rows_of, vector};
use crate::calls;
use crate::events::{observing, EventList};
use crate::failure::{self, guarded, raise};
use crate::run::{self, ClosedStates, Options};
use crate::state::{self, Array};
use crate::tangent::TangentFunctions;
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use partita_system::equations::{derivatives, Equations, ExplicitClosing, UserSystem};
use partita_system::SystemError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::Arc;

/// The callables of a system.
struct Callables {
    n: usize,
    names: Vec<String>,
    mass: Py<PyAny>,
    forces: Py<PyAny>,
    constraints: Py<PyAny>,
    jacobian: Py<PyAny>,
    constraint_rate: Option<Py<PyAny>>,
    bias: Py<PyAny>,
    closing: Option<Closing>,
}

/// The function that closes the loops, and the coordinates that it computes.
struct Closing {
    function: Py<PyAny>,
    dependent: Vec<usize>,
}

impl Callables {
    fn clone_ref(&self, py: Python<'_>) -> Self {
        Self {
            n: self.n,
            names: self.names.clone(),
            mass: self.mass.clone_ref(py),
            forces: self.forces.clone_ref(py),
            constraints: self.constraints.clone_ref(py),
            jacobian: self.jacobian.clone_ref(py),
            constraint_rate: self.constraint_rate.as_ref().map(|x| x.clone_ref(py)),
            bias: self.bias.clone_ref(py),
            closing: self
                .closing
                .as_ref()
                .map(|c| Closing { function: c.function.clone_ref(py), dependent: c.dependent.clone() }),
        }
    }
}

/// A system with the number of rows found at one point.
struct Sized {
    f: Callables,
    rows: usize,
    holonomic: usize,
}

impl Equations for Sized {
    fn n(&self) -> usize {
        self.f.n
    }
    fn rows(&self) -> usize {
        self.rows
    }
    fn holonomic(&self) -> usize {
        self.holonomic
    }
    fn name(&self, i: usize) -> String {
        self.f.names.get(i).cloned().unwrap_or_else(|| format!("q{i}"))
    }
    fn rheonomic(&self) -> bool {
        self.f.constraint_rate.is_some()
    }
    fn mass(&self, t: f64, q: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        calls::fill(&self.f.mass, "mass", t, q, None, out)
    }
    fn forces(&self, t: f64, q: &[f64], v: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        calls::fill(&self.f.forces, "forces", t, q, Some(v), out)
    }
    fn constraints(&self, t: f64, q: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        calls::fill(&self.f.constraints, "constraints", t, q, None, out)
    }
    fn jacobian(&self, t: f64, q: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        calls::fill(&self.f.jacobian, "jacobian", t, q, None, out)
    }
    fn rate(&self, t: f64, q: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        match &self.f.constraint_rate {
            Some(f) => calls::fill(f, "constraint_rate", t, q, None, out),
            None => {
                out.fill(0.0);
                Ok(())
            }
        }
    }
    fn bias(&self, t: f64, q: &[f64], v: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        calls::fill(&self.f.bias, "bias", t, q, Some(v), out)
    }
    fn explicit_closing(&self) -> Option<&dyn ExplicitClosing> {
        self.f.closing.as_ref().map(|closing| closing as &dyn ExplicitClosing)
    }
}

impl ExplicitClosing for Closing {
    fn dependent(&self) -> &[usize] {
        &self.dependent
    }
    fn close(&self, t: f64, q: &mut [f64]) -> Result<(), SystemError> {
        let mut values = vec![0.0; self.dependent.len()];
        calls::fill(&self.function, "closing", t, q, None, &mut values)?;
        for (&i, x) in self.dependent.iter().zip(values) {
            q[i] = x;
        }
        Ok(())
    }
}

/// Equations (S1)-(S5) given as callables.
#[pyclass(frozen, module = "partita._core")]
pub struct System {
    f: Callables,
    /// Characteristic lengths; `None`: estimated at the start of a run.
    lengths: Option<Vec<f64>>,
    /// Whether derivatives are compared with differences.
    checked: bool,
}

impl System {
    fn sized(&self, py: Python<'_>, t: f64, q: &[f64]) -> PyResult<UserSystem<Sized>> {
        let n = self.f.n;
        let c = calls::call(&self.f.jacobian, "jacobian", t, q, None).map_err(|e| failure::system(py, e))?;
        let phi = calls::call(&self.f.constraints, "constraints", t, q, None).map_err(|e| failure::system(py, e))?;
        let rows = c.len() / n;
        if rows * n != c.len() || phi.len() > rows {
            let message = format!(
                "jacobian returned {} numbers for {n} coordinates, constraints {}; C is (m, {n}) and Phi has m numbers or \
                 fewer",
                c.len(),
                phi.len()
            );
            return Err(raise(py, "ArgumentError", &message, &[("argument", "jacobian".into())]));
        }
        let system =
            UserSystem::new(Sized { f: self.f.clone_ref(py), rows, holonomic: phi.len() }).checked(self.checked);
        Ok(match &self.lengths {
            Some(lengths) => system.with_lengths(lengths.clone()),
            None => system,
        })
    }

    /// As `sized`, with lengths estimated where none are given.
    fn measured(&self, py: Python<'_>, t: f64, q: &[f64]) -> PyResult<UserSystem<Sized>> {
        let system = self.sized(py, t, q)?;
        if self.lengths.is_some() {
            return Ok(system);
        }
        let found = derivatives::lengths(&system.equations, t, q).map_err(|e| failure::system(py, e))?;
        Ok(system.with_lengths(found))
    }
}

#[pymethods]
impl System {
    #[new]
    #[pyo3(signature = (n, mass, forces, constraints, jacobian, constraint_rate, bias, names, closing=None, lengths=None, checked=true))]
    fn new(
        py: Python<'_>,
        n: usize,
        mass: Py<PyAny>,
        forces: Py<PyAny>,
        constraints: Py<PyAny>,
        jacobian: Py<PyAny>,
        constraint_rate: Option<Py<PyAny>>,
        bias: Py<PyAny>,
        names: Vec<String>,
        closing: Option<(Py<PyAny>, Vec<usize>)>,
        lengths: Option<Vec<f64>>,
        checked: bool,
    ) -> PyResult<Self> {
        if n == 0 {
            return Err(raise(
                py,
                "ArgumentError",
                "n is 0; a system needs at least one coordinate",
                &[("argument", "n".into())],
            ));
        }
        let closing = closing.map(|(function, dependent)| Closing { function, dependent });
        let f = Callables { n, names, mass, forces, constraints, jacobian, constraint_rate, bias, closing };
        Ok(Self { f, lengths, checked })
    }

    #[getter]
    fn nq(&self) -> usize {
        self.f.n
    }
    #[getter]
    fn nv(&self) -> usize {
        self.f.n
    }

    #[pyo3(signature = (t, q, v, targets, rates, tolerance))]
    fn assemble<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        q: PyReadonlyArray1<'py, f64>,
        v: PyReadonlyArray1<'py, f64>,
        targets: Vec<(usize, f64)>,
        rates: Vec<(usize, f64)>,
        tolerance: f64,
    ) -> PyResult<(Array<'py>, Array<'py>, String)> {
        guarded(py, || {
            let q = vector(&q, self.f.n, "q")?;
            let v = vector(&v, self.f.n, "v")?;
            let system = self.measured(py, t, &q)?;
            let (q, v, report) = state::assemble(&system, t, (q, &v), &targets, &rates, tolerance)
                .map_err(|e| failure::system(py, e))?;
            Ok((array(py, &[q.len()], q), array(py, &[v.len()], v), report))
        })
    }

    fn mass_matrix<'py>(&self, py: Python<'py>, t: f64, q: PyReadonlyArray1<'py, f64>) -> PyResult<Array<'py>> {
        let m = calls::call(&self.f.mass, "mass", t, &any_vector(&q), None).map_err(|e| failure::system(py, e))?;
        Ok(array(py, &[self.f.n, self.f.n], m))
    }
    fn forces<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        q: PyReadonlyArray1<'py, f64>,
        v: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<Array<'py>> {
        let h = calls::call(&self.f.forces, "forces", t, &any_vector(&q), Some(&any_vector(&v)))
            .map_err(|e| failure::system(py, e))?;
        Ok(array(py, &[h.len()], h))
    }
    fn constraints<'py>(&self, py: Python<'py>, t: f64, q: PyReadonlyArray1<'py, f64>) -> PyResult<Array<'py>> {
        let x = calls::call(&self.f.constraints, "constraints", t, &any_vector(&q), None)
            .map_err(|e| failure::system(py, e))?;
        Ok(array(py, &[x.len()], x))
    }
    fn jacobian<'py>(&self, py: Python<'py>, t: f64, q: PyReadonlyArray1<'py, f64>) -> PyResult<Array<'py>> {
        let x =
            calls::call(&self.f.jacobian, "jacobian", t, &any_vector(&q), None).map_err(|e| failure::system(py, e))?;
        Ok(array(py, &[x.len() / self.f.n, self.f.n], x))
    }
    fn rate<'py>(&self, py: Python<'py>, t: f64, q: PyReadonlyArray1<'py, f64>) -> PyResult<Array<'py>> {
        guarded(py, || {
            let q = vector(&q, self.f.n, "q")?;
            let system = self.sized(py, t, &q)?;
            let mut a = vec![0.0; system.equations.rows];
            system.equations.rate(t, &q, &mut a).map_err(|e| failure::system(py, e))?;
            Ok(array(py, &[a.len()], a))
        })
    }
    fn bias<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        q: PyReadonlyArray1<'py, f64>,
        v: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<Array<'py>> {
        let b = calls::call(&self.f.bias, "bias", t, &any_vector(&q), Some(&any_vector(&v)))
            .map_err(|e| failure::system(py, e))?;
        Ok(array(py, &[b.len()], b))
    }
    fn acceleration<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        q: PyReadonlyArray1<'py, f64>,
        v: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<(Array<'py>, Array<'py>)> {
        guarded(py, || {
            let (q, v) = (vector(&q, self.f.n, "q")?, vector(&v, self.f.n, "v")?);
            let system = self.sized(py, t, &q)?;
            state::acceleration(py, &system, t, &q, &v)
        })
    }
    /// S1-S5 and their reduction at one instant, by name.
    #[pyo3(signature = (t, q, v))]
    fn at<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        q: PyReadonlyArray1<'py, f64>,
        v: Option<PyReadonlyArray1<'py, f64>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        guarded(py, || {
            let q = vector(&q, self.f.n, "q")?;
            let v = v.map(|v| vector(&v, self.f.n, "v")).transpose()?;
            let system = self.sized(py, t, &q)?;
            state::at(py, &system, t, &q, v.as_deref())
        })
    }
    fn measure<'py>(&self, py: Python<'py>, t: f64, q: PyReadonlyArray1<'py, f64>) -> PyResult<Array<'py>> {
        guarded(py, || {
            let q = vector(&q, self.f.n, "q")?;
            let system = self.sized(py, t, &q)?;
            state::measure(py, &system, t, &q)
        })
    }

    #[pyo3(signature = (options, t_eval, q, v, progress, tangent=None, step_bytes=0, events=None))]
    fn simulate<'py>(
        &self,
        py: Python<'py>,
        options: &Bound<'py, Options>,
        t_eval: PyReadonlyArray1<'py, f64>,
        q: PyReadonlyArray1<'py, f64>,
        v: PyReadonlyArray1<'py, f64>,
        progress: Option<Py<PyAny>>,
        tangent: Option<TangentFunctions>,
        step_bytes: usize,
        events: Option<EventList>,
    ) -> PyResult<Bound<'py, PyDict>> {
        guarded(py, || {
            let options = options.get().keeping(step_bytes);
            let (q, v) = (vector(&q, self.f.n, "q")?, vector(&v, self.f.n, "v")?);
            let system = Arc::new(self.measured(py, options.t0, &q)?);
            let tangent = run::tangent(self.f.n, tangent);
            let events = observing(py, events, |events| events.of_system(system.clone()))?;
            run::run(py, system, &options, &t_eval, (&q, &v), tangent, events, progress, true)
        })
    }

    /// Seconds of one evaluation for each of the `options`, at the states (t, q, v), a row each.
    #[pyo3(signature = (options, steps, t, q, v, tangent=None))]
    fn evaluation_costs<'py>(
        &self,
        py: Python<'py>,
        options: Vec<String>,
        steps: Vec<f64>,
        t: PyReadonlyArray1<'py, f64>,
        q: PyReadonlyArray2<'py, f64>,
        v: PyReadonlyArray2<'py, f64>,
        tangent: Option<TangentFunctions>,
    ) -> PyResult<Vec<f64>> {
        guarded(py, || {
            let states = ClosedStates { t: &t, q: &q, v: &v };
            let (n, times) = (self.f.n, entries_of(&t));
            let Some(first) = times.first() else { return Ok(vec![f64::NAN; options.len()]) };
            let all = rows_of(&q, times.len(), n, "q")?;
            let system = self.measured(py, *first, &all[..n])?;
            run::costs(py, &system, &options, &steps, &states, run::tangent(n, tangent))
        })
    }
}
