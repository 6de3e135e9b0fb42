//! Inverse dynamics: a mechanism with actuators.

use crate::arrays::{any_vector, array, entries_of, rows_of, vector};
use crate::failure::{self, guarded, raise, unexpected};
use crate::model::Model;
use crate::outputs::watched;
use crate::state::Array;
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use partita_analysis::inverse::regressor::{Channel, Directions, Regressor};
use partita_analysis::inverse::{Actuator, Distribution, Gap};
use partita_analysis::outputs::States;
use partita_system::prelude::*;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

/// A mechanism with a set of actuators; constant.
#[pyclass(frozen, module = "partita._core")]
pub struct Inverse {
    inner: Arc<partita_analysis::inverse::Inverse>,
    actuators: usize,
}

/// The equations in the rates of its actuators; memory for them.
#[pyclass(frozen, module = "partita._core")]
pub struct Actuated {
    inner: Mutex<partita_analysis::actuated::Actuated>,
}

#[pymethods]
impl Actuated {
    /// Mass matrix, bias, ratios and rates at one state, by name.
    fn at<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        q: PyReadonlyArray1<'py, f64>,
        v: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<Bound<'py, PyDict>> {
        guarded(py, || {
            // a panic in an evaluation leaves numbers that the next one overwrites
            let mut a = self.inner.lock().unwrap_or_else(PoisonError::into_inner);
            let size = a.size();
            let (q, v) = (vector(&q, size.nq, "q")?, vector(&v, size.nv, "v")?);
            a.evaluate(t, &q, &v).map_err(|e| failure::analysis(py, e))?;
            let k = a.bias.len();
            let d = PyDict::new(py);
            d.set_item("M", array(py, &[k, k], a.mass.clone()))?;
            d.set_item("bias", array(py, &[k], a.bias.clone()))?;
            d.set_item("ratios", array(py, &[size.nv, k], a.ratios.clone()))?;
            d.set_item("rates", array(py, &[k], a.rates(&v)))?;
            Ok(d)
        })
    }

    /// Efforts that carry the constant gravity.
    fn gravity<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        q: PyReadonlyArray1<'py, f64>,
        v: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<Array<'py>> {
        guarded(py, || {
            let mut a = self.inner.lock().unwrap_or_else(PoisonError::into_inner);
            let size = a.size();
            let (q, v) = (vector(&q, size.nq, "q")?, vector(&v, size.nv, "v")?);
            let found = a.gravity(t, &q, &v).map_err(|e| failure::analysis(py, e))?;
            Ok(array(py, &[found.len()], found))
        })
    }

    /// How far the set is from a position in which a motion escapes it.
    fn margin(&self, py: Python<'_>, t: f64, q: PyReadonlyArray1<'_, f64>) -> PyResult<f64> {
        guarded(py, || {
            let mut a = self.inner.lock().unwrap_or_else(PoisonError::into_inner);
            let q = vector(&q, a.size().nq, "q")?;
            a.margin(t, &q).map_err(|e| failure::analysis(py, e))
        })
    }

    /// Seconds of one evaluation at a state, the fastest of several.
    fn cost<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        q: PyReadonlyArray1<'py, f64>,
        v: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<f64> {
        guarded(py, || {
            let mut a = self.inner.lock().unwrap_or_else(PoisonError::into_inner);
            let size = a.size();
            let (q, v) = (vector(&q, size.nq, "q")?, vector(&v, size.nv, "v")?);
            let mut best = f64::INFINITY;
            for _ in 0..BATCHES {
                let began = Instant::now();
                for _ in 0..REPEATED {
                    a.evaluate(t, &q, &v).map_err(|e| failure::analysis(py, e))?;
                }
                best = best.min(began.elapsed().as_secs_f64() / f64::from(REPEATED));
            }
            Ok(best)
        })
    }
}

/// Evaluations that are timed together, and how often.
const REPEATED: u32 = 20;
const BATCHES: u32 = 25;

impl Inverse {
    /// The mechanism with the actuators.
    pub(crate) fn inner(&self) -> &partita_analysis::inverse::Inverse {
        &self.inner
    }
}

#[pymethods]
impl Inverse {
    /// `actuators` as JSON; the forces `silent` (number, component) act as actuators alone.
    #[new]
    fn new(py: Python<'_>, model: &Model, actuators: &str, silent: Vec<(usize, Option<usize>)>) -> PyResult<Self> {
        guarded(py, || {
            let actuators: Vec<Actuator> = serde_json::from_str(actuators).map_err(|e| unexpected(e.to_string()))?;
            let made = partita_analysis::inverse::Inverse::new(model.shared(), &actuators, &silent);
            Ok(Self { inner: Arc::new(made.map_err(|e| failure::analysis(py, e))?), actuators: actuators.len() })
        })
    }

    /// The model whose multipliers are found.
    #[getter]
    fn model(&self) -> Model {
        Model::without_structure(self.inner.actuated().clone())
    }

    /// The equations in the rates of the actuators, for positions like (t, q).
    fn at<'py>(&self, py: Python<'py>, t: f64, q: PyReadonlyArray1<'py, f64>) -> PyResult<Actuated> {
        guarded(py, || {
            let q = vector(&q, self.inner.actuated().size().nq, "q")?;
            let made = partita_analysis::actuated::Actuated::new(self.inner.clone(), t, &q);
            Ok(Actuated { inner: Mutex::new(made.map_err(|e| failure::analysis(py, e))?) })
        })
    }

    /// E at (t, q): a row for each actuator (s, nv).
    fn columns<'py>(&self, py: Python<'py>, t: f64, q: PyReadonlyArray1<'py, f64>) -> PyResult<Array<'py>> {
        guarded(py, || {
            let size = self.inner.actuated().size();
            let q = vector(&q, size.nq, "q")?;
            let found = self.inner.columns_at(t, &q).map_err(|e| failure::system(py, e))?;
            Ok(array(py, &[self.actuators, size.nv], found))
        })
    }

    /// Efforts, multipliers and margins for a motion, by name.
    #[pyo3(signature = (t, q, v, vdot, weights, preload, limits, least_use))]
    fn efforts<'py>(
        &self,
        py: Python<'py>,
        t: PyReadonlyArray1<'py, f64>,
        q: PyReadonlyArray2<'py, f64>,
        v: PyReadonlyArray2<'py, f64>,
        vdot: PyReadonlyArray2<'py, f64>,
        weights: PyReadonlyArray1<'py, f64>,
        preload: PyReadonlyArray2<'py, f64>,
        limits: Option<PyReadonlyArray2<'py, f64>>,
        least_use: bool,
    ) -> PyResult<Bound<'py, PyDict>> {
        guarded(py, || {
            let (size, s) = (self.inner.actuated().size(), self.actuators);
            let t = entries_of(&t);
            let nt = t.len();
            let (q, v) = (rows_of(&q, nt, size.nq, "q")?, rows_of(&v, nt, size.nv, "v")?);
            let (vdot, preload) = (rows_of(&vdot, nt, size.nv, "vdot")?, rows_of(&preload, nt, s, "preload")?);
            let weights = any_vector(&weights);
            if weights.len() != s {
                let message = format!("weights has {} entries; there are {s} actuators", weights.len());
                return Err(raise(py, "ArgumentError", &message, &[("argument", "weights".into())]));
            }
            let limits = match &limits {
                None => Vec::new(),
                Some(x) => rows_of(x, s, 2, "limits")?.chunks_exact(2).map(|x| [x[0], x[1]]).collect(),
            };
            let by = Distribution { weights, preload: preload.into_owned(), limits, least_use };
            let states = States { t: &t, q: &q, v: &v };
            let found = watched(py, |watch| self.inner.efforts(&states, &vdot, &by, watch))?;
            let spare = s.saturating_sub(found.k);
            let d = PyDict::new(py);
            let shapes: [(&str, Vec<f64>, &[usize]); 7] = [
                ("efforts", found.efforts, &[s]),
                ("multipliers", found.multipliers, &[size.rows]),
                ("rates", found.rates, &[s]),
                ("vdot", found.vdot, &[size.nv]),
                ("margin", found.margin, &[]),
                ("remainder", found.remainder, &[]),
                ("null_space", found.null_space, &[s, spare]),
            ];
            for (name, data, shape) in shapes {
                d.set_item(name, array(py, &[&[nt], shape].concat(), data))?;
            }
            d.set_item("gaps", found.gaps.iter().map(word).collect::<Vec<_>>())?;
            d.set_item("k", found.k)?;
            d.set_item("weakest", found.weakest)?;
            Ok(d)
        })
    }

    /// Values of channels along a motion (nt, channels), their derivatives along directions of parameters
    /// (nt, channels, directions), and gaps, by name. `channels` as JSON; `seen`: the same actuators and further measured
    /// coordinates; `held`: which of these are measured.
    #[pyo3(signature = (seen, held, t, q, v, vdot, names, values, along, channels))]
    fn regressor<'py>(
        &self,
        py: Python<'py>,
        seen: PyRef<'py, Self>,
        held: Vec<usize>,
        t: PyReadonlyArray1<'py, f64>,
        q: PyReadonlyArray2<'py, f64>,
        v: PyReadonlyArray2<'py, f64>,
        vdot: PyReadonlyArray2<'py, f64>,
        names: Vec<String>,
        values: Vec<Vec<f64>>,
        along: Vec<Vec<f64>>,
        channels: &str,
    ) -> PyResult<Bound<'py, PyDict>> {
        guarded(py, || {
            let size = self.inner.actuated().size();
            let t = entries_of(&t);
            let nt = t.len();
            let (q, v) = (rows_of(&q, nt, size.nq, "q")?, rows_of(&v, nt, size.nv, "v")?);
            let vdot = rows_of(&vdot, nt, size.nv, "vdot")?;
            let channels: Vec<Channel> = serde_json::from_str(channels).map_err(|e| unexpected(e.to_string()))?;
            let numbers: usize = values.iter().map(Vec::len).sum();
            if names.len() != values.len() || along.iter().any(|x| x.len() != numbers) {
                return Err(unexpected("directions do not fit the parameters".into()));
            }
            let (m, count) = (channels.len(), along.len());
            let by = Directions { names, values, along };
            let made = Regressor::new(self.inner.clone(), (seen.inner.clone(), held), &by, channels)
                .map_err(|e| failure::analysis(py, e))?;
            let states = States { t: &t, q: &q, v: &v };
            let found = watched(py, |watch| made.along(&states, &vdot, watch))?;
            let d = PyDict::new(py);
            d.set_item("values", array(py, &[nt, m], found.values))?;
            d.set_item("derivatives", array(py, &[nt, m, count], found.derivatives))?;
            d.set_item("gaps", found.gaps.iter().map(word).collect::<Vec<_>>())?;
            Ok(d)
        })
    }
}

/// Why an instant has no efforts, as Python reads it.
fn word(gap: &Gap) -> &'static str {
    match gap {
        Gap::None => "",
        Gap::Constraints => "constraints",
        Gap::Actuators => "actuators",
        Gap::Motion => "motion",
    }
}
