//! A motion that is stepped from Python. It lives on a thread of its own, which owns all that it needs.

use crate::arrays::{array, vector};
use crate::failure::{self, guarded, raise};
use crate::functions::{Held, Kind};
use crate::run;
use crate::state::Array;
use numpy::PyReadonlyArray1;
use partita_analysis::error::AnalysisError;
use partita_analysis::run::{Request, Run, Stepping};
use partita_model::spec::{Force, Spec, Table, Value, VectorValue};
use partita_model::Model;
use partita_system::ConstrainedSystem;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::panic::{catch_unwind, AssertUnwindSafe};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};

/// An input: which force of the description and which of its components; a drive by its number where there is no component.
pub type Input = (usize, Option<usize>);

/// What is held for an input.
fn kind(&(_, component): &Input) -> Kind {
    component.map_or(Kind::Course, |_| Kind::Effort)
}

/// What is asked of the thread.
enum Command {
    Step,
    /// From t, q, v; the numbers held until then come back where it fails.
    Begin(f64, Vec<f64>, Vec<f64>, Vec<f64>),
    /// All that was kept, or where it stands alone.
    Report(bool),
    Quit,
}

/// What passes between the two threads.
#[derive(Default)]
struct Shared {
    command: Option<Command>,
    answer: Option<Result<(), AnalysisError>>,
    t: f64,
    q: Vec<f64>,
    v: Vec<f64>,
    reported: Option<Run>,
    gone: bool,
}

#[derive(Default)]
struct Worker {
    shared: Mutex<Shared>,
    changed: Condvar,
}

impl Worker {
    fn look(&self) -> MutexGuard<'_, Shared> {
        self.shared.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Hand an order over and wait for its answer.
    fn ask(&self, command: Command) -> Result<(), AnalysisError> {
        let mut shared = self.look();
        if !shared.gone {
            shared.command = Some(command);
            self.changed.notify_all();
        }
        loop {
            if let Some(answer) = shared.answer.take() {
                return answer;
            }
            if shared.gone {
                let message = "the stepper has ended by an error inside; make a new one".into();
                return Err(AnalysisError::Argument { argument: "stepper", message });
            }
            shared = self.changed.wait(shared).unwrap_or_else(PoisonError::into_inner);
        }
    }

    fn answer(&self, mut shared: MutexGuard<'_, Shared>, answer: Result<(), AnalysisError>) {
        shared.answer = Some(answer);
        self.changed.notify_all();
    }

    /// Write down where the motion stands.
    fn show(shared: &mut Shared, motion: &Stepping<Model>) {
        let now = motion.now();
        shared.t = now.t;
        for (i, q) in shared.q.iter_mut().enumerate() {
            *q = motion.coordinate(i);
        }
        shared.v.copy_from_slice(&now.v);
    }

    /// The life of the thread.
    fn serve(
        &self,
        (model, held): (&Model, &Held),
        request: &Request,
        ticks: (f64, u32),
        start: (f64, &[f64], &[f64]),
        keeps: bool,
    ) {
        let made = Stepping::new(model, request, ticks, start, keeps);
        let mut shared = self.look();
        let mut motion = match made {
            Ok(motion) => {
                Self::show(&mut shared, &motion);
                self.answer(shared, Ok(()));
                motion
            }
            Err(e) => return self.answer(shared, Err(e)),
        };
        loop {
            let mut shared = self.look();
            let command = loop {
                match shared.command.take() {
                    Some(command) => break command,
                    None => shared = self.changed.wait(shared).unwrap_or_else(PoisonError::into_inner),
                }
            };
            drop(shared);
            let (answer, reported) = match command {
                Command::Quit => return,
                Command::Step => (motion.step(), None),
                Command::Begin(t, q, v, before) => (motion.begin(t, &q, &v, || held.set(&before)), None),
                Command::Report(here) => (Ok(()), Some(motion.reported(here))),
            };
            let mut shared = self.look();
            shared.reported = reported;
            Self::show(&mut shared, &motion);
            self.answer(shared, answer);
        }
    }
}

/// A motion stepped tick by tick under inputs.
#[pyclass(frozen, module = "partita._core")]
pub struct Stepper {
    worker: Arc<Worker>,
    thread: Mutex<Option<JoinHandle<()>>>,
    held: Arc<Held>,
    model: Arc<Model>,
    inputs: Vec<Input>,
    process: u32,
    /// Held by who waits for an answer: orders come one at a time.
    turn: Mutex<()>,
}

/// Put a value in the place of each input.
fn replaced(spec: &Spec, inputs: &[Input], value: impl Fn(usize) -> Value) -> Option<Spec> {
    let mut spec = spec.clone();
    for (i, &(number, component)) in inputs.iter().enumerate() {
        let Some(component) = component else {
            spec.drives.get_mut(number)?.motion = value(i);
            continue;
        };
        match spec.forces.get_mut(number)? {
            Force::Torque { value: own, over: None, .. } => *own = value(i),
            Force::Force { value: VectorValue::Components(own), .. } => *own.get_mut(component)? = value(i),
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

impl Stepper {
    /// For a compiled model; `start` is a closed state of it.
    fn around(
        py: Python<'_>,
        model: &Model,
        (inputs, first): (Vec<Input>, Vec<f64>),
        request: Request,
        ticks: (f64, u32),
        (t, q, v): (f64, Vec<f64>, Vec<f64>),
        keeps: bool,
    ) -> PyResult<Self> {
        let kinds: Vec<Kind> = inputs.iter().map(kind).collect();
        let held = Arc::new(Held::new(model.functions(), &kinds));
        if first.len() != held.count() {
            return Err(failure::unexpected(format!("{} numbers for {} inputs", first.len(), inputs.len())));
        }
        held.set(&first);
        let number = held.first();
        let spec = replaced(&model.spec, &inputs, |i| Value::Function(number + i)).ok_or_else(|| no_input(py))?;
        let own = Model::new(spec, held.clone(), model.coordinates()).map_err(|e| failure::description(py, &e))?;
        let size = own.size();
        if (size.nq, size.nv, size.rows) != (model.size().nq, model.size().nv, model.size().rows) {
            return Err(failure::unexpected("inputs changed the coordinates of the model".into()));
        }
        let own = Arc::new(own);
        let worker = Arc::new(Worker::default());
        {
            let mut shared = worker.look();
            (shared.q, shared.v) = (vec![0.0; size.nq], vec![0.0; size.nv]);
        }
        let (there, its_model, its_held) = (worker.clone(), own.clone(), held.clone());
        let life = move || {
            let served = catch_unwind(AssertUnwindSafe(|| {
                there.serve((&its_model, &its_held), &request, ticks, (t, &q, &v), keeps)
            }));
            drop(served);
            there.look().gone = true;
            there.changed.notify_all();
        };
        let thread = thread::Builder::new().name("partita stepper".into()).spawn(life)?;
        let (thread, process) = (Mutex::new(Some(thread)), std::process::id());
        let stepper = Self { worker, thread, held, model: own, inputs, process, turn: Mutex::default() };
        stepper.waited(py, || stepper.worker.first())?;
        Ok(stepper)
    }

    /// An order with these inputs held; those before where it fails.
    fn with_inputs(&self, u: &[f64], command: Command) -> Result<(), AnalysisError> {
        let before = self.held.values();
        self.held.set(u);
        self.worker.ask(command).inspect_err(|_| self.held.set(&before))
    }

    /// Wait for the thread, with the interpreter free for others.
    fn waited(&self, py: Python<'_>, ask: impl FnOnce() -> Result<(), AnalysisError> + Send) -> PyResult<()> {
        if self.process != std::process::id() {
            let message = "a stepper does not live on in a forked process; make a new one there";
            return Err(raise(py, "ArgumentError", message, &[("argument", "stepper".into())]));
        }
        let answer = py.detach(|| {
            let _turn = self.turn.lock().unwrap_or_else(PoisonError::into_inner);
            ask()
        });
        answer.map_err(|e| failure::analysis(py, e))
    }
}

impl Worker {
    /// The thread's first word.
    fn first(&self) -> Result<(), AnalysisError> {
        let mut shared = self.look();
        loop {
            if let Some(answer) = shared.answer.take() {
                return answer;
            }
            if shared.gone {
                let message = "the stepper could not be made".into();
                return Err(AnalysisError::Argument { argument: "stepper", message });
            }
            shared = self.changed.wait(shared).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

impl Drop for Stepper {
    fn drop(&mut self) {
        if self.process != std::process::id() {
            return;
        }
        self.worker.look().command = Some(Command::Quit);
        self.worker.changed.notify_all();
        if let Some(thread) = self.thread.lock().unwrap_or_else(PoisonError::into_inner).take() {
            // it waits for orders and needs no interpreter to end
            let _ = thread.join();
        }
    }
}

#[pymethods]
impl Stepper {
    /// A motion of a compiled model to be stepped by ticks of `dt`, each of so many `steps` of a method, under `inputs`: forces
    /// of the description and components, drives without. `held` is what they hold at first: a number, or five of the course
    /// of a drive (since when, a cubic).
    #[new]
    #[pyo3(signature = (model, options, dt, steps, inputs, held, t, q, v, keeps))]
    fn new(
        py: Python<'_>,
        model: &crate::model::Model,
        options: &str,
        dt: f64,
        steps: u32,
        inputs: Vec<Input>,
        held: Vec<f64>,
        t: f64,
        q: PyReadonlyArray1<'_, f64>,
        v: PyReadonlyArray1<'_, f64>,
        keeps: bool,
    ) -> PyResult<Self> {
        guarded(py, || {
            let request = run::read_options(py, options)?;
            let size = model.inner().size();
            let (q, v) = (vector(&q, size.nq, "q")?, vector(&v, size.nv, "v")?);
            Self::around(py, model.inner(), (inputs, held), request, (dt, steps), (t, q, v), keeps)
        })
    }

    /// One tick with these numbers held.
    fn step(&self, py: Python<'_>, inputs: PyReadonlyArray1<'_, f64>) -> PyResult<()> {
        guarded(py, || {
            let u = vector(&inputs, self.held.count(), "inputs")?;
            self.waited(py, || self.with_inputs(&u, Command::Step))
        })
    }

    /// Stand at a closed state, with these numbers held.
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
            self.waited(py, || self.with_inputs(&held, Command::Begin(t, q, v, self.held.values())))
        })
    }

    /// Where it stands: t, q, v.
    fn state<'py>(&self, py: Python<'py>) -> (f64, Array<'py>, Array<'py>) {
        let (t, q, v) = {
            let shared = self.worker.look();
            (shared.t, shared.q.clone(), shared.v.clone())
        };
        (t, array(py, &[q.len()], q), array(py, &[v.len()], v))
    }

    /// What a run would have left that stands here, and the model as it is now: for as long as it stands here.
    fn here<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyDict>, crate::model::Model)> {
        guarded(py, || {
            self.waited(py, || self.worker.ask(Command::Report(true)))?;
            let reported = self.worker.look().reported.take();
            let reported = reported.ok_or_else(|| failure::unexpected("the stepper told nothing".into()))?;
            Ok((run::left(py, &self.model, reported)?, crate::model::Model::of(self.model.clone())))
        })
    }

    /// What a run would have left, and the model with the inputs as tables: `breaks` of time, a row of held numbers between each
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
                let place: usize = kinds.iter().take(i).map(|kind| kind.count()).sum();
                let piece = |held: &Vec<f64>| {
                    let number = |k: usize| held.get(place + k).copied().unwrap_or(0.0);
                    match kinds.get(i) {
                        Some(Kind::Course) => [number(4), number(3), number(2), number(1)],
                        _ => [0.0, 0.0, 0.0, number(0)],
                    }
                };
                Value::Table(Table { breaks: breaks.clone(), coefficients: values.iter().map(piece).collect() })
            };
            let spec = replaced(&self.model.spec, &self.inputs, table).ok_or_else(|| no_input(py))?;
            let model = Model::new(spec, self.model.functions(), self.model.coordinates());
            let model = Arc::new(model.map_err(|e| failure::description(py, &e))?);
            self.waited(py, || self.worker.ask(Command::Report(false)))?;
            let reported = self.worker.look().reported.take();
            let reported = reported.ok_or_else(|| failure::unexpected("the stepper told nothing".into()))?;
            Ok((run::left(py, &model, reported)?, crate::model::Model::of(model)))
        })
    }
}
