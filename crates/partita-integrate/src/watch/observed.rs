//! The functions of events, read where a step ends or inside it.

use partita_system::event::{EventFunctions, MotionState};
use partita_system::formulation::{Formulation, Purpose};
use partita_system::positions::turns;
use partita_system::record::Output;
use partita_system::watched::Reading;
use partita_system::SystemError;

/// The functions of events with memory for the states at which they are read.
#[derive(Debug)]
pub(crate) struct Observed {
    functions: Box<dyn EventFunctions>,
    count: usize,
    state: MotionState,
    output: Output,
    failed: Option<(f64, SystemError)>,
}

impl Observed {
    /// So many functions.
    pub(crate) fn new(functions: Box<dyn EventFunctions>, count: usize) -> Self {
        Self { functions, count, state: MotionState::default(), output: Output::default(), failed: None }
    }

    pub(crate) fn count(&self) -> usize {
        self.count
    }

    /// The first failure since the last call.
    pub(crate) fn failed(&mut self) -> Option<(f64, SystemError)> {
        self.failed.take()
    }

    /// The readings at t stand.
    pub(crate) fn accept(&mut self, t: f64) {
        self.functions.accept(t);
    }

    /// At the closed point last evaluated.
    pub(crate) fn read_here(&mut self, t: f64, formulation: &mut dyn Formulation, turned: &[i32], out: &mut [Reading]) {
        let forces_at = self.functions.reads_forces().then_some(t);
        match formulation.point().state(forces_at, &mut self.state) {
            Ok(()) => self.read(t, turned, out),
            Err(error) => drop(self.failed.get_or_insert((t, error))),
        }
    }

    /// At (t, y) inside a step, the point last evaluated: closed, as outputs are.
    ///
    /// # Errors
    /// Where it cannot be closed.
    pub(crate) fn read_inside(
        &mut self,
        (t, y): (f64, &[f64]),
        formulation: &mut dyn Formulation,
        turned: &[i32],
        out: &mut [Reading],
    ) -> Result<(), SystemError> {
        let forces_at = self.functions.reads_forces().then_some(t);
        formulation.point().state(forces_at, &mut self.state)?;
        formulation.state_at(t, y, Purpose::Look, &mut self.output)?;
        self.state.q.clone_from(&self.output.q);
        self.state.v.clone_from(&self.output.v);
        self.read(t, turned, out);
        Ok(())
    }

    fn read(&mut self, t: f64, turned: &[i32], out: &mut [Reading]) {
        self.state.t = t;
        for (q, n) in self.state.q.iter_mut().zip(turned) {
            *q = turns::whole(*q, *n);
        }
        if let Err(error) = self.functions.read(&self.state, out) {
            out.fill(Reading::default());
            self.failed.get_or_insert((t, error));
        }
    }
}
