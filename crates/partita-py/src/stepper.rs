//! A motion that is stepped from Python. It owns all its data.

use crate::arrays::vector;
use crate::ending::released;
use crate::events::{EventList, Events};
use crate::failure::{self, guarded, raise};
use crate::functions::{Held, Kind};
use crate::motion::with_motion;
use crate::run::{self, Occurred};
use crate::segments::{self, happened, DecisionList, Happened};
use numpy::{PyArray1, PyReadonlyArray1, ToPyArray};
use partita_analysis::error::AnalysisError;
use partita_analysis::run::segments::{Segments, Ticks};
use partita_analysis::run::{Request, Run, Stepping};
use partita_model::spec::{Force, PointForce, Spec, Table, Torque, Value, VectorValue};
use partita_model::Model;
use partita_system::prelude::*;
use partita_system::record::Output;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, ThreadId};

/// An input: which force of the description and which of its components; a drive by its number where there is no component.
pub type Input = (usize, Option<usize>);

/// Value of an input.
fn kind(&(_, component): &Input) -> Kind {
    component.map_or(Kind::Course, |_| Kind::Effort)
}

/// Time, coordinates and velocities.
type State<'py> = (f64, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>);

/// State of a motion.
#[derive(Default)]
struct Standing {
    t: f64,
    q: Vec<f64>,
    v: Vec<f64>,
}

/// A motion that is stepped, and whether events act in it.
enum Steps {
    /// They observe, if there are any.
    Plain(Box<Stepping<'static>>),
    /// They act.
    Acting(Box<Ticks>),
}

impl Steps {
    fn now(&self) -> &Output {
        match self {
            Self::Plain(x) => x.now(),
            Self::Acting(x) => x.now(),
        }
    }
    fn coordinate(&self, i: usize) -> f64 {
        match self {
            Self::Plain(x) => x.coordinate(i),
            Self::Acting(x) => x.coordinate(i),
        }
    }
    fn step(&mut self) -> Result<(), AnalysisError> {
        match self {
            Self::Plain(x) => x.step(),
            Self::Acting(x) => x.step(),
        }
    }
    fn begin(&mut self, t: f64, q: &[f64], v: &[f64], undo: &mut dyn FnMut()) -> Result<(), AnalysisError> {
        match self {
            Self::Plain(x) => x.begin(t, q, v, undo),
            Self::Acting(x) => x.begin(t, q, v, undo),
        }
    }
}

/// What a stepper has recorded.
enum Recorded {
    Plain(Box<Run>),
    Acting(Box<Segments>),
}

impl Standing {
    fn read(&mut self, motion: &Steps) {
        let now = motion.now();
        self.t = now.t;
        self.q.clear();
        self.q.extend((0..now.q.len()).map(|i| motion.coordinate(i)));
        self.v.clone_from(&now.v);
    }
}

/// The thread that uses a motion, for the duration of the use.
struct Busy<'a>(&'a Mutex<Option<ThreadId>>);

impl<'a> Busy<'a> {
    fn new(owner: &'a Mutex<Option<ThreadId>>) -> Self {
        *locked(owner) = Some(thread::current().id());
        Self(owner)
    }
}

impl Drop for Busy<'_> {
    fn drop(&mut self) {
        *locked(self.0) = None;
    }
}

/// A motion stepped tick by tick under inputs.
#[pyclass(frozen, module = "partita._core")]
pub struct Stepper {
    motion: Mutex<Steps>,
    /// The present user: a user function called by the motion may not use it.
    busy: Mutex<Option<ThreadId>>,
    /// Read without waiting for the motion.
    standing: Mutex<Standing>,
    held: Arc<Held>,
    model: Arc<Model>,
    inputs: Vec<Input>,
    /// The drives by which events act, as JSON.
    drives: Option<String>,
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The drives by which events act, what these do, and who decides about it.
type Acting = (String, String, DecisionList);

fn with_drives(py: Python<'_>, model: &Arc<Model>, drives: &str) -> PyResult<Arc<Model>> {
    let drives = serde_json::from_str(drives).map_err(|e| failure::unexpected(format!("drives: {e}")))?;
    Ok(Arc::new(model.with_more_drives(drives).map_err(|e| failure::description(py, &e))?))
}

/// Set the value of each input.
fn replaced(spec: &Spec, inputs: &[Input], value: impl Fn(usize) -> Value) -> Option<Spec> {
    let mut spec = spec.clone();
    for (i, &(number, component)) in inputs.iter().enumerate() {
        let Some(component) = component else {
            spec.drives.get_mut(number)?.motion = value(i);
            continue;
        };
        match spec.forces.get_mut(number)? {
            Force::Torque(Torque { value: own, over: None, .. }) => *own = value(i),
            Force::Force(PointForce { value: VectorValue::Components(own), .. }) => *own.get_mut(component)? = value(i),
            _ => return None,
        }
    }
    Some(spec)
}

fn no_input(py: Python<'_>) -> PyErr {
    raise(
        py,
        "ArgumentError",
        "an input is a drive, a torque or a force with a number",
        &[("argument", "inputs".into())],
    )
}

/// The model with these inputs as numbers given from outside, and what holds them: at first these.
pub(crate) fn with_inputs(
    py: Python<'_>,
    model: &Model,
    inputs: &[Input],
    first: &[f64],
) -> PyResult<(Model, Arc<Held>)> {
    let kinds: Vec<Kind> = inputs.iter().map(kind).collect();
    let held = Arc::new(Held::new(model.functions(), &kinds));
    if first.len() != held.count() {
        return Err(failure::unexpected(format!("{} numbers for {} inputs", first.len(), inputs.len())));
    }
    held.set(first);
    let number = held.first();
    let spec = replaced(&model.spec, inputs, |i| Value::Function(number + i)).ok_or_else(|| no_input(py))?;
    let own = Model::new(spec, held.clone(), model.coordinates()).map_err(|e| failure::description(py, &e))?;
    let size = own.size();
    if (size.nq, size.nv, size.rows) != (model.size().nq, model.size().nv, model.size().rows) {
        return Err(failure::unexpected("inputs changed the coordinates of the model".into()));
    }
    Ok((own, held))
}

impl Stepper {
    /// For a compiled model; `start` is a closed state of it.
    fn around(
        py: Python<'_>,
        model: &Model,
        (inputs, first): (Vec<Input>, Vec<f64>),
        request: Request,
        ticks: (f64, u32),
        (t, q, v): (f64, Vec<f64>, Vec<f64>),
        (keeps, events, acting): (bool, Option<EventList>, Option<Acting>),
    ) -> PyResult<Self> {
        let drives = acting.as_ref().map(|x| x.0.clone());
        let (own, held) = with_inputs(py, model, &inputs, &first)?;
        let mut model = Arc::new(own);
        let events = events.map(Events::new).transpose()?;
        let motion = match (events, acting) {
            (Some(events), Some((drives, acts, decisions))) => {
                model = with_drives(py, &model, &drives)?;
                let (plan, _) = segments::planned(py, &model, &events, (&acts, decisions))?;
                let of = model.clone();
                let functions = Box::new(move || Ok(events.of_mechanism(of.clone())?.functions));
                let made = released(py, || Ticks::new(plan, functions, &request, ticks, (t, &q, &v), keeps));
                Steps::Acting(Box::new(made.map_err(|e| failure::analysis(py, e))?))
            }
            (events, _) => {
                let made = released(py, || Stepping::new(model.clone().into(), &request, ticks, (t, &q, &v), keeps));
                let mut motion = made.map_err(|e| failure::analysis(py, e))?;
                if let Some(events) = events {
                    let model = model.clone();
                    let observing = Box::new(move || Ok(events.of_mechanism(model.clone())?));
                    motion.observe(observing).map_err(|e| failure::analysis(py, e))?;
                }
                Steps::Plain(Box::new(motion))
            }
        };
        let mut standing = Standing::default();
        standing.read(&motion);
        let (motion, standing) = (Mutex::new(motion), Mutex::new(standing));
        Ok(Self { motion, busy: Mutex::default(), standing, held, model, inputs, drives })
    }

    /// Use the motion, one caller after the other, while other Python threads run.
    fn with<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut Steps) -> Result<T, AnalysisError> + Send,
    ) -> PyResult<T> {
        if *locked(&self.busy) == Some(thread::current().id()) {
            let message = "a function of the model steps the stepper that calls it; pass what it computes as an \
                input";
            return Err(raise(py, "ArgumentError", message, &[("argument", "stepper".into())]));
        }
        let done = released(py, || {
            let mut motion = self.motion.lock().map_err(|_| AnalysisError::Argument {
                argument: "stepper",
                message: "the stepper has failed; make a new one".into(),
            })?;
            let _busy = Busy::new(&self.busy);
            let done = work(&mut motion);
            locked(&self.standing).read(&motion);
            done
        });
        done.map_err(|e| failure::analysis(py, e))
    }
}

impl Stepper {
    /// All that is recorded, or the current state, of this mechanism with its inputs over time.
    fn recorded<'py>(&self, py: Python<'py>, here: bool, model: Option<&Arc<Model>>) -> PyResult<Bound<'py, PyDict>> {
        let found = self.with(py, |motion| {
            Ok(match motion {
                Steps::Plain(x) => Recorded::Plain(Box::new(x.reported(here))),
                Steps::Acting(x) => Recorded::Acting(Box::new(x.reported(here, model)?)),
            })
        })?;
        let model = model.unwrap_or(&self.model);
        match found {
            Recorded::Plain(found) => run::left(py, model, *found),
            Recorded::Acting(found) => segments::reported_segments(py, model, (*found, Vec::new()), None),
        }
    }
}

#[pymethods]
impl Stepper {
    /// A motion of a compiled model to be stepped by ticks of `dt`, each of this many `steps` of a method, under
    /// `inputs`: forces of the description and components, drives without. `held` gives the initial values: a number,
    /// or five of the course of a drive (start time, a cubic).
    #[new]
    #[pyo3(signature = (model, options, dt, steps, inputs, held, t, q, v, keeps, events=None, acting=None))]
    fn new(
        py: Python<'_>,
        model: &crate::model::Model,
        options: &Bound<'_, run::Options>,
        dt: f64,
        steps: u32,
        inputs: Vec<Input>,
        held: Vec<f64>,
        t: f64,
        q: PyReadonlyArray1<'_, f64>,
        v: PyReadonlyArray1<'_, f64>,
        keeps: bool,
        events: Option<EventList>,
        acting: Option<Acting>,
    ) -> PyResult<Self> {
        guarded(py, || {
            let request = options.get().request().clone();
            let size = model.inner().size();
            let (q, v) = (vector(&q, size.nq, "q")?, vector(&v, size.nv, "v")?);
            Self::around(py, model.inner(), (inputs, held), request, (dt, steps), (t, q, v), (keeps, events, acting))
        })
    }

    /// One tick with these values, and the state after it: t, q, v.
    fn step<'py>(&self, py: Python<'py>, inputs: PyReadonlyArray1<'py, f64>) -> PyResult<State<'py>> {
        guarded(py, || {
            let u = vector(&inputs, self.held.count(), "inputs")?;
            self.with(py, |motion| {
                let before = self.held.values();
                self.held.set(&u);
                motion.step().inspect_err(|_| self.held.set(&before))
            })?;
            Ok(self.state(py))
        })
    }

    /// Move to a closed state, with these input values.
    fn begin<'py>(
        &self,
        py: Python<'py>,
        inputs: PyReadonlyArray1<'py, f64>,
        t: f64,
        q: PyReadonlyArray1<'py, f64>,
        v: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<()> {
        guarded(py, || {
            let size = self.model.size();
            let (q, v) = (vector(&q, size.nq, "q")?, vector(&v, size.nv, "v")?);
            let held = vector(&inputs, self.held.count(), "inputs")?;
            self.with(py, |motion| {
                let before = self.held.values();
                self.held.set(&held);
                motion.begin(t, &q, &v, &mut || self.held.set(&before))
            })
        })
    }

    /// Events of the last tick: number, whether the function rises, t, q, v; or, where they act, what happened.
    fn occurred(&self, py: Python<'_>) -> PyResult<(Vec<Occurred>, Option<Vec<Happened>>)> {
        guarded(py, || {
            self.with(py, |motion| {
                Ok(match motion {
                    Steps::Plain(x) => (run::occurred(x.occurred()), None),
                    Steps::Acting(x) => (Vec::new(), Some(x.occurred().iter().map(happened).collect())),
                })
            })
        })
    }

    /// Its state: t, q, v.
    fn state<'py>(&self, py: Python<'py>) -> State<'py> {
        let x = locked(&self.standing);
        (x.t, x.q.to_pyarray(py), x.v.to_pyarray(py))
    }

    /// The results of a run that ends here, and the present model, while the motion is here.
    fn here<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyDict>, crate::model::Model)> {
        guarded(py, || {
            let found = self.recorded(py, true, None)?;
            Ok((with_motion(py, &self.model, found)?, crate::model::Model::of(self.model.clone())))
        })
    }

    /// The results of a run, and the model with the inputs as tables: `breaks` of time, a row of values between each
    /// two.
    fn result<'py>(
        &self,
        py: Python<'py>,
        breaks: Vec<f64>,
        values: Vec<Vec<f64>>,
    ) -> PyResult<(Bound<'py, PyDict>, crate::model::Model)> {
        guarded(py, || {
            let kinds: Vec<Kind> = self.inputs.iter().map(kind).collect();
            let table = |i: usize| {
                let offset: usize = kinds.iter().take(i).map(|kind| kind.count()).sum();
                let piece = |held: &Vec<f64>| {
                    let number = |k: usize| held.get(offset + k).copied().unwrap_or(0.0);
                    match kinds.get(i) {
                        Some(Kind::Course) => [number(4), number(3), number(2), number(1)],
                        _ => [0.0, 0.0, 0.0, number(0)],
                    }
                };
                Value::Table(Table { breaks: breaks.clone(), coefficients: values.iter().map(piece).collect() })
            };
            let base = self.model.permanent();
            let spec = replaced(&base.spec, &self.inputs, table).ok_or_else(|| no_input(py))?;
            let model = Model::new(spec, base.functions(), base.coordinates());
            let mut model = Arc::new(model.map_err(|e| failure::description(py, &e))?);
            if let Some(drives) = &self.drives {
                model = with_drives(py, &model, drives)?;
            }
            let found = self.recorded(py, false, Some(&model))?;
            Ok((with_motion(py, &model, found)?, crate::model::Model::of(model)))
        })
    }
}
