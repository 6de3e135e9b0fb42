//! The compiled mechanism for Python.

mod analyses;
mod rest;

use crate::arrays::{array, vector};
use crate::events::{observing, EventList};
use crate::failure::{self, guarded, raise};
use crate::functions::Callables;
use crate::motion::{with_motion, Motion};
use crate::program;
use crate::run::{self, ClosedStates, Options};
use crate::segments;
use crate::state::{self, Array};
use crate::summary::summary;
use crate::tangent::TangentFunctions;
use crate::waiting::{heard, patiently};
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use partita_analysis as analysis;
use partita_analysis::instant::Levels;
use partita_math::scalar::OperationCounts;
use partita_math::tolerance;
use partita_model::spec::Spec;
use partita_model::zero_position::Coordinates;
use partita_system::manifold::orthogonal::dense_rows;
use partita_system::prelude::*;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

/// Numbers, and rows of numbers, as given by Python.
type Vector<'py> = PyReadonlyArray1<'py, f64>;
type Table<'py> = PyReadonlyArray2<'py, f64>;

/// A compiled mechanism. It is constant; states are arguments.
#[pyclass(frozen, module = "partita._core")]
pub struct Model {
    inner: Arc<Inner>,
    structure: OnceLock<Structure>,
}

/// Properties of the mechanism in its assembled zero position.
struct Structure {
    mobility: Option<analysis::mobility::Mobility>,
    note: Option<String>,
}

pub(crate) type Inner = partita_model::Model;
/// Coordinates, branches and residual of an assembly.
type Assembled<'py> = (Array<'py>, Vec<i8>, f64);

/// Bytes of a description, and velocities of a model, above which an answer may take longer than a signal should wait.
const LONG: usize = 200_000;
const MANY: usize = 300;

impl Model {
    /// The compiled mechanism.
    pub(crate) fn inner(&self) -> &Inner {
        &self.inner
    }

    /// For a compiled mechanism.
    pub(crate) fn of(inner: Arc<Inner>) -> Self {
        Self { inner, structure: OnceLock::new() }
    }

    /// Likewise, shared.
    pub(crate) fn shared(&self) -> &Arc<Inner> {
        &self.inner
    }

    /// For a mechanism whose zero position is not assembled.
    pub(crate) fn without_structure(inner: Arc<Inner>) -> Self {
        Self { inner, structure: OnceLock::from(Structure { mobility: None, note: None }) }
    }

    /// Whether an analysis of the whole model may take long.
    fn is_large(&self) -> bool {
        self.inner.size().nv > MANY
    }

    /// Properties of the assembled zero position, computed when first needed.
    fn known<'m>(slf: &'m Bound<'_, Self>) -> PyResult<&'m Structure> {
        let (model, own) = (slf.get(), slf.clone().unbind());
        if model.structure.get().is_none() {
            heard(slf.py(), model.is_large(), move || {
                own.get().structure();
            })?;
        }
        Ok(model.structure())
    }

    fn structure(&self) -> &Structure {
        self.structure.get_or_init(|| {
            let mut q = self.inner.initial();
            let closed = analysis::poses::closed(&self.inner, 0.0, &mut q, tolerance::CLOSED, &[]);
            // where the loops do not close, the relations between rows have no meaning
            if let Err(e) = closed {
                let note = format!("the mobility needs an assembled position, but the loops do not close: {e}");
                return Structure { mobility: None, note: Some(note) };
            }
            match analysis::mobility::mobility(&self.inner, 0.0, &q) {
                Ok(m) => Structure { mobility: Some(m), note: None },
                Err(e) => Structure { mobility: None, note: Some(e.to_string()) },
            }
        })
    }

    fn state<'py>(&self, q: &Vector<'py>, v: &Vector<'py>) -> PyResult<(Vec<f64>, Vec<f64>)> {
        let size = self.inner.size();
        Ok((vector(q, size.nq, "q")?, vector(v, size.nv, "v")?))
    }

    /// The position level at q.
    fn position<'py>(&self, py: Python<'py>, t: f64, q: &Vector<'py>) -> PyResult<Levels<'_, Inner>> {
        let q = vector(q, self.nq(), "q")?;
        let mut levels = Levels::new(&*self.inner);
        levels.position(t, &q).map_err(|e| failure::system(py, e))?;
        Ok(levels)
    }
}

#[pymethods]
impl Model {
    #[new]
    #[pyo3(signature = (spec, functions, coordinates = "relative"))]
    fn new(py: Python<'_>, spec: &str, functions: Vec<Py<PyAny>>, coordinates: &str) -> PyResult<Self> {
        guarded(py, || {
            let coordinates = match coordinates {
                "relative" => Coordinates::Relative,
                "absolute" => Coordinates::Absolute,
                other => {
                    let message = format!("there are no coordinates \"{other}\"; choose relative or absolute");
                    return Err(raise(py, "ArgumentError", &message, &[("argument", "coordinates".into())]));
                }
            };
            let (long, text) = (spec.len() > LONG, spec.to_string());
            let spec = heard(py, long, move || Spec::from_json(&text))?.map_err(|e| {
                let fields = [("element", "mechanism".into()), ("name", "".into())];
                raise(py, "DescriptionError", &format!("the description cannot be read: {e}"), &fields)
            })?;
            let functions = Arc::new(Callables::new(functions));
            // the geometric errors of drawings with loops are examined
            let long = long || spec.joints.len() > spec.bodies.len();
            let (called, name) = (functions.clone(), spec.name.clone());
            let inner = patiently(py, long, &name, move || Inner::new(spec, functions, coordinates))
                .inspect_err(|_| called.abandon())?
                .map_err(|e| failure::description(py, &e))?;
            Ok(Self { inner: Arc::new(inner), structure: OnceLock::new() })
        })
    }

    /// The same mechanism with other parameters: names and numbers.
    fn with_parameters(&self, py: Python<'_>, changes: Vec<(String, Vec<f64>)>) -> PyResult<Self> {
        guarded(py, || {
            let changes: Vec<(&str, &[f64])> = changes.iter().map(|(name, x)| (name.as_str(), &x[..])).collect();
            // a repair is repeated
            let long = self.inner.geometry().drawn.is_some();
            let inner = if long {
                let owned: Vec<(String, Vec<f64>)> =
                    changes.iter().map(|(name, x)| (name.to_string(), x.to_vec())).collect();
                let (model, name) = (self.inner.clone(), self.inner.spec.name.clone());
                patiently(py, true, &name, move || {
                    let changes: Vec<(&str, &[f64])> = owned.iter().map(|(name, x)| (name.as_str(), &x[..])).collect();
                    model.with_parameters(&changes)
                })?
            } else {
                self.inner.with_parameters(&changes)
            };
            let inner = inner.map_err(|e| failure::description(py, &e))?;
            Ok(Self { inner: Arc::new(inner), structure: OnceLock::new() })
        })
    }
    /// The same mechanism in the same coordinates with more drives, as JSON.
    fn with_more_drives(&self, py: Python<'_>, drives: &str) -> PyResult<Self> {
        guarded(py, || {
            let drives = serde_json::from_str(drives).map_err(|e| failure::unexpected(format!("drives: {e}")))?;
            let inner = self.inner.with_more_drives(drives).map_err(|e| failure::description(py, &e))?;
            Ok(Self { inner: Arc::new(inner), structure: OnceLock::new() })
        })
    }
    /// The same mechanism in the same kind of coordinates, with these joints cut, so that events of a run can part them.
    fn that_parts(&self, py: Python<'_>, joints: Vec<String>) -> PyResult<Self> {
        guarded(py, || {
            let inner = self.inner.that_parts(&joints).map_err(|e| failure::description(py, &e))?;
            Ok(Self { inner: Arc::new(inner), structure: OnceLock::new() })
        })
    }
    fn parameters(&self) -> Vec<(String, Vec<f64>)> {
        self.inner.parameters()
    }
    /// The equations as a WebAssembly module with these parameters as inputs, and the data that a page needs (JSON):
    /// sizes, offsets of numbers, patterns of C and M, the rows that are redundant at the closed position q.
    fn recorded(
        slf: &Bound<'_, Self>,
        parameters: Vec<String>,
        t: f64,
        q: Vector<'_>,
    ) -> PyResult<(Py<PyBytes>, String)> {
        let py = slf.py();
        guarded(py, || {
            let (model, own) = (slf.get(), slf.clone().unbind());
            let q = vector(&q, model.nq(), "q")?;
            let (module, reported) =
                heard(py, model.is_large(), move || program::recorded(&own.get().inner, &parameters, t, &q))?
                    .map_err(|e| program::raised(py, e))?;
            Ok((PyBytes::new(py, &module).unbind(), reported))
        })
    }

    #[getter]
    fn description(&self, py: Python<'_>) -> PyResult<String> {
        guarded(py, || self.inner.spec.to_json().map_err(|e| failure::unexpected(e.to_string())))
    }

    #[getter]
    fn nq(&self) -> usize {
        self.inner.size().nq
    }
    #[getter]
    fn nv(&self) -> usize {
        self.inner.size().nv
    }
    #[getter]
    fn rows(&self) -> usize {
        self.inner.size().rows
    }
    #[getter]
    fn rank(slf: &Bound<'_, Self>) -> PyResult<usize> {
        Ok(slf.get().nv() - Self::mobility(slf)?)
    }
    #[getter]
    fn mobility(slf: &Bound<'_, Self>) -> PyResult<usize> {
        let py = slf.py();
        guarded(py, || {
            let found = Self::known(slf)?;
            match &found.mobility {
                Some(m) => Ok(m.mobility),
                None => {
                    let note = found.note.clone().unwrap_or_default();
                    let fields = [("residual", f64::NAN.into()), ("iterations", 0usize.into()), ("loops", "".into())];
                    Err(raise(py, "AssemblyError", &note, &fields))
                }
            }
        })
    }
    /// The first force with more than one value at a state, and what it is.
    #[getter]
    fn set_valued(&self) -> Option<(String, String)> {
        self.inner.set_valued().map(|(name, what)| (name.into(), what.into()))
    }
    #[getter]
    fn planar(&self) -> bool {
        self.inner.is_planar()
    }
    #[getter]
    fn calls_functions(&self) -> bool {
        self.inner.equations().calls_functions()
    }

    #[getter]
    fn summary(slf: &Bound<'_, Self>) -> PyResult<String> {
        guarded(slf.py(), || {
            let found = Self::known(slf)?;
            let text = summary(&slf.get().inner, found.mobility.as_ref(), found.note.as_deref());
            text.map_err(|e| PyRuntimeError::new_err(e.to_string()))
        })
    }

    fn initial<'py>(&self, py: Python<'py>) -> (Array<'py>, Array<'py>) {
        let size = self.inner.size();
        (array(py, &[size.nq], self.inner.initial()), array(py, &[size.nv], vec![0.0; size.nv]))
    }

    fn mass_matrix<'py>(&self, py: Python<'py>, t: f64, q: Vector<'py>) -> PyResult<Array<'py>> {
        guarded(py, || {
            let n = self.nv();
            let (q, rest) = (vector(&q, self.nq(), "q")?, vec![0.0; n]);
            let mut levels = Levels::new(&*self.inner);
            let found = levels.velocity(t, &q, &rest).and_then(|()| levels.dynamics(t, &q, &rest));
            Ok(array(py, &[n, n], found.map_err(|e| failure::system(py, e))?.0))
        })
    }
    fn forces<'py>(&self, py: Python<'py>, t: f64, q: Vector<'py>, v: Vector<'py>) -> PyResult<Array<'py>> {
        guarded(py, || {
            let (q, v) = self.state(&q, &v)?;
            let mut levels = Levels::new(&*self.inner);
            let found = levels.velocity(t, &q, &v).and_then(|()| levels.dynamics(t, &q, &v));
            Ok(array(py, &[v.len()], found.map_err(|e| failure::system(py, e))?.1))
        })
    }
    fn constraints<'py>(&self, py: Python<'py>, t: f64, q: Vector<'py>) -> PyResult<Array<'py>> {
        guarded(py, || {
            let phi = self.position(py, t, &q)?.phi;
            Ok(array(py, &[phi.len()], phi))
        })
    }
    fn jacobian<'py>(&self, py: Python<'py>, t: f64, q: Vector<'py>) -> PyResult<Array<'py>> {
        guarded(py, || {
            let c = self.position(py, t, &q)?.c;
            let rows: Vec<usize> = (0..self.rows()).collect();
            let c = dense_rows(&*self.inner, &c, &rows);
            Ok(array(py, &[self.rows(), self.nv()], c.into_vec()))
        })
    }
    fn rate<'py>(&self, py: Python<'py>, t: f64, q: Vector<'py>) -> PyResult<Array<'py>> {
        guarded(py, || {
            let a = self.position(py, t, &q)?.a;
            Ok(array(py, &[a.len()], a))
        })
    }
    fn bias<'py>(&self, py: Python<'py>, t: f64, q: Vector<'py>, v: Vector<'py>) -> PyResult<Array<'py>> {
        guarded(py, || {
            let (q, v) = self.state(&q, &v)?;
            let mut levels = Levels::new(&*self.inner);
            levels.velocity(t, &q, &v).map_err(|e| failure::system(py, e))?;
            Ok(array(py, &[levels.b.len()], levels.b))
        })
    }
    fn acceleration<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        q: Vector<'py>,
        v: Vector<'py>,
    ) -> PyResult<(Array<'py>, Array<'py>)> {
        guarded(py, || {
            let (q, v) = self.state(&q, &v)?;
            state::acceleration(py, &*self.inner, t, &q, &v)
        })
    }
    /// Operations of one evaluation, by formulation and kind.
    #[pyo3(signature = (t, q, inputs))]
    fn operation_counts(
        &self,
        py: Python<'_>,
        t: f64,
        q: Vector<'_>,
        inputs: Option<Vec<usize>>,
    ) -> PyResult<BTreeMap<&'static str, BTreeMap<&'static str, usize>>> {
        guarded(py, || {
            let q = vector(&q, self.nq(), "q")?;
            let found = self.inner.evaluation_counts(t, &q, inputs.as_deref()).map_err(|e| failure::system(py, e))?;
            let kinds = |x: OperationCounts| {
                let all = [
                    ("sums", x.sums),
                    ("products", x.products),
                    ("quotients", x.quotients),
                    ("functions", x.functions),
                    ("cases", x.cases),
                    ("total", x.total()),
                ];
                BTreeMap::from(all)
            };
            Ok(BTreeMap::from([
                ("projective", kinds(found.projective)),
                ("explicit-closing", kinds(found.explicit_closing)),
                ("iteration", kinds(found.iteration)),
            ]))
        })
    }
    /// S1-S5 and their reduction at one instant, by name.
    #[pyo3(signature = (t, q, v))]
    fn at<'py>(&self, py: Python<'py>, t: f64, q: Vector<'py>, v: Option<Vector<'py>>) -> PyResult<Bound<'py, PyDict>> {
        guarded(py, || {
            let q = vector(&q, self.nq(), "q")?;
            let v = v.map(|v| vector(&v, self.nv(), "v")).transpose()?;
            let mut i = analysis::instant::at(&*self.inner, t, &q, v.as_deref()).map_err(|e| failure::system(py, e))?;
            let known = (t, &q[..], &i.v[..]);
            let shared =
                analysis::sharing::multipliers(&self.inner, known, &i.vdot, &mut i.multipliers, &i.c, &i.split);
            shared.map_err(|e| failure::analysis(py, e))?;
            state::reported(py, i)
        })
    }
    fn measure<'py>(&self, py: Python<'py>, t: f64, q: Vector<'py>) -> PyResult<Array<'py>> {
        guarded(py, || {
            let q = vector(&q, self.nq(), "q")?;
            state::measure(py, &*self.inner, t, &q)
        })
    }

    #[pyo3(signature = (options, t_eval, q, v, progress, tangent=None, step_bytes=0, events=None))]
    fn simulate<'py>(
        &self,
        py: Python<'py>,
        options: &Bound<'py, Options>,
        t_eval: Vector<'py>,
        q: Vector<'py>,
        v: Vector<'py>,
        progress: Option<Py<PyAny>>,
        tangent: Option<TangentFunctions>,
        step_bytes: usize,
        events: Option<EventList>,
    ) -> PyResult<Bound<'py, PyDict>> {
        guarded(py, || {
            let options = options.get().keeping(step_bytes);
            let (q, v) = self.state(&q, &v)?;
            let events = observing(py, events, |events| events.of_mechanism(self.inner.clone()))?;
            let (system, calls) = (self.inner.clone(), self.inner.equations().calls_functions());
            let tangent = run::tangent(self.nv(), tangent);
            with_motion(
                py,
                &self.inner,
                run::run(py, system, &options, &t_eval, (&q, &v), tangent, events, progress, calls)?,
            )
        })
    }

    /// As `simulate`, where events act: `acts` says which drives hold, and what each event does.
    #[pyo3(signature = (options, t_eval, q, v, progress, step_bytes, events, acts, decisions))]
    fn simulate_segments<'py>(
        &self,
        py: Python<'py>,
        options: &Bound<'py, Options>,
        t_eval: Vector<'py>,
        q: Vector<'py>,
        v: Vector<'py>,
        progress: Option<Py<PyAny>>,
        step_bytes: usize,
        events: EventList,
        acts: &str,
        decisions: segments::DecisionList,
    ) -> PyResult<Bound<'py, PyDict>> {
        guarded(py, || {
            let options = options.get().keeping(step_bytes);
            let (q, v) = self.state(&q, &v)?;
            let acts = (acts, decisions);
            let found = segments::run(py, &self.inner, &options, &t_eval, (&q, &v), (events, acts), progress)?;
            with_motion(py, &self.inner, found)
        })
    }

    /// Seconds of one evaluation for each of the `options`, at the states (t, q, v), one row each.
    #[pyo3(signature = (options, steps, t, q, v, tangent=None))]
    fn evaluation_costs<'py>(
        &self,
        py: Python<'py>,
        options: Vec<String>,
        steps: Vec<f64>,
        t: Vector<'py>,
        q: Table<'py>,
        v: Table<'py>,
        tangent: Option<TangentFunctions>,
    ) -> PyResult<Vec<f64>> {
        guarded(py, || {
            let states = ClosedStates { t: &t, q: &q, v: &v };
            run::costs(py, &*self.inner, &options, &steps, &states, run::tangent(self.nv(), tangent))
        })
    }

    /// A motion through these states, one row each.
    #[pyo3(signature = (t, q, v, vdot=None, multipliers=None))]
    fn motion<'py>(
        &self,
        py: Python<'py>,
        t: Vector<'py>,
        q: Table<'py>,
        v: Table<'py>,
        vdot: Option<Table<'py>>,
        multipliers: Option<Table<'py>>,
    ) -> PyResult<Motion> {
        guarded(py, || Motion::new(py, &self.inner, &t, (&q, &v), (vdot.as_ref(), multipliers.as_ref())))
    }

    /// Data that are possible but unlikely, in sentences.
    fn suspicious(&self) -> Vec<String> {
        analysis::plausibility::suspicious(&self.inner)
    }

    fn report(slf: &Bound<'_, Self>, t: f64, q: Vector<'_>) -> PyResult<String> {
        let py = slf.py();
        guarded(py, || {
            let (model, own) = (slf.get(), slf.clone().unbind());
            let q = vector(&q, model.nq(), "q")?;
            let ask = move || analysis::report::report(&own.get().inner, t, &q);
            let report = heard(py, model.is_large(), ask)?.map_err(|e| failure::analysis(py, e))?;
            serde_json::to_string(&report).map_err(|e| failure::unexpected(e.to_string()))
        })
    }
}
