//! Rates of a choice of coordinates as compiled code: kept with the system, made once a choice has proved to be used long
//! enough.
//!
//! ```text
//! inputs   q | v_I | t
//! rates    q' | v_I' | power, where it is observed | 1 / pivots of C_D | excess              (S2, P1-P3)
//! ```
//! The excess is above 0 where an evaluation by levels fails.

use crate::choice::Choice;
use partita_math::program::{Compiled, Compiler, Program};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Evaluations by a choice before it is compiled. Unit: evaluations. Reason: about as many as the code saves the time that
/// making it takes, so that no run takes twice as long as by the better decision.
const WORTH_COMPILING: u64 = 5000;

/// Largest program that is compiled. Unit: instructions. Reason: longer code does not fit into the processor's cache of
/// instructions, and reading it takes longer than computing.
const LONGEST: usize = 3000;

/// Choices of a system whose programs are kept. Reason: more than a mechanism visits in one cycle of its motion.
const MOST_CHOICES: usize = 32;

/// When the rates of a choice are compiled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Compilation {
    /// Where a compiler is installed, once a choice has proved to be used long enough, and is not too large.
    #[default]
    Auto,
    /// At the first evaluation by a choice, whatever its size.
    Always,
    /// Never.
    Never,
}

/// The rates of a choice: evaluations before they are compiled, and the code.
#[derive(Debug)]
pub struct CompiledRates {
    rows: Vec<usize>,
    dependent: Vec<usize>,
    evaluations: AtomicU64,
    code: OnceLock<Option<Box<dyn Compiled>>>,
}

impl CompiledRates {
    /// The code, compiled now if this evaluation is the one that makes it worth while.
    pub(crate) fn code(
        &self,
        compiler: &dyn Compiler,
        when: Compilation,
        program: impl FnOnce() -> Option<Program>,
    ) -> Option<&dyn Compiled> {
        if let Some(known) = self.code.get() {
            return known.as_deref();
        }
        if when == Compilation::Auto && self.evaluations.fetch_add(1, Ordering::Relaxed) < WORTH_COMPILING {
            return None;
        }
        let compiled = || {
            let program = program().filter(|x| when == Compilation::Always || x.len() <= LONGEST)?;
            compiler.compile(&program).ok()
        };
        self.code.get_or_init(compiled).as_deref()
    }
}

/// The rates of the choices of a system, by the order in which C_D is eliminated.
#[derive(Clone, Debug, Default)]
pub struct CompiledChoices(Arc<Mutex<Vec<Arc<CompiledRates>>>>);

impl CompiledChoices {
    /// Those of a choice; none where there are too many.
    pub fn of(&self, choice: &Choice) -> Option<Arc<CompiledRates>> {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = all.iter().find(|x| x.rows == choice.rows && x.dependent == choice.dependent) {
            return Some(known.clone());
        }
        if all.len() >= MOST_CHOICES {
            return None;
        }
        let (rows, dependent) = (choice.rows.to_vec(), choice.dependent.to_vec());
        let new = Arc::new(CompiledRates { rows, dependent, evaluations: AtomicU64::new(0), code: OnceLock::new() });
        all.push(new.clone());
        Some(new)
    }
}
