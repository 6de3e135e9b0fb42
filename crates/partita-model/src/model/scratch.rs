//! Memory of evaluations, returned to its model for reuse.

use crate::clusters;
use crate::evaluator::Scratch;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Memory of the evaluations of a model.
pub struct ModelScratch {
    /// Gone once it is dropped.
    pub(super) own: Option<Box<Scratch<f64>>>,
    pub(super) dense: Dense,
    pub(super) recursion: clusters::Plan,
    pub(super) spare: Arc<Spare>,
}

/// Memory of evaluations that was used before. Its content is never an answer.
#[derive(Default)]
pub(super) struct Spare(Mutex<Vec<Memory>>);

type Memory = (Box<Scratch<f64>>, Dense);

impl Spare {
    /// Maximum number kept: as many as runs in eight threads use at a time.
    const MOST: usize = 24;

    pub(super) fn all(&self) -> MutexGuard<'_, Vec<Memory>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for ModelScratch {
    fn drop(&mut self) {
        let Some(mut own) = self.own.take() else { return };
        own.forces_at = false;
        let mut spare = self.spare.all();
        if spare.len() < Spare::MOST {
            spare.push((own, std::mem::take(&mut self.dense)));
        }
    }
}

/// Why the memory of a scratch exists.
const LENT: &str = "memory is given back when its scratch is dropped";

impl ModelScratch {
    /// That of the equations.
    pub fn equations(&mut self) -> &mut Scratch<f64> {
        self.own.as_deref_mut().expect(LENT)
    }

    /// That of the equations, as last evaluated.
    pub fn evaluated(&self) -> &Scratch<f64> {
        self.own.as_deref().expect(LENT)
    }
}

/// Dense matrices and vectors of an evaluation.
#[derive(Default)]
pub(super) struct Dense {
    pub(super) mass: Vec<f64>,
    pub(super) h: Vec<f64>,
    pub(super) work: Vec<f64>,
}
