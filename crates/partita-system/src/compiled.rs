//! Rates of a choice of coordinates as compiled code: kept with the system, made once a choice has proved to be used long
//! enough.
//!
//! ```text
//! inputs   q | v_I | t | numbers given from outside | intervals of tables
//! rates    q' | v_I' | power | v' | 1 / pivots of C_D | excess | what is looked up in tables           (S2, P1-P3)
//! ```
//! A table is looked up outside the code: it is evaluated with the intervals of the last point, and again where a number that
//! it looks up is in another one.
//! The power, of applied forces and drives, is there where it is observed, v' where rows depend on time or accelerations come
//! from a recursion. The excess is above 0 where an evaluation by levels fails.

use crate::choice::Choice;
use partita_math::program::{Compiled, Compiler, NotCompiled};
use partita_math::scalar::{Lookup, Recording};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Evaluations by a choice before it is compiled. Scale: evaluations. Reason: recording it and making the code takes as long
/// as it saves over seven hundred to two thousand, so that no run takes much more than twice the time of the better decision.
const WORTH_COMPILING: u64 = 1500;

/// Longest code that is made. Scale: steps, those that repeat counted once. Reason: three megabytes, read from the third cache
/// at each evaluation, take about as long as an evaluation by levels.
const LONGEST: usize = 400_000;

/// Operations after which a recording is given up, equal ones counted once. Scale: operations. Reason: ten thousand loops
/// have about five million, which repeat, and take as much memory while the code is made as the mechanism does.
const MOST_RECORDED: usize = 20 * LONGEST;

/// Choices of a system whose code is kept. Scale: choices. Reason: more than a mechanism visits in one cycle of its motion.
const MOST_CHOICES: usize = 32;

/// Why rates cannot be recorded.
pub(crate) const WITHOUT: &str =
    "Python functions, reaction-dependent friction and bodies without mass are evaluated as without";

/// When the rates of a choice are compiled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Compilation {
    /// Where a compiler is installed, once a choice has proved to be used long enough, and is not too large.
    #[default]
    Auto,
    /// As `Auto`, by a thread of its own, so that no step waits for the code.
    Beside,
    /// At the first evaluation by a choice, whatever its size.
    Always,
    /// Never.
    Never,
}

impl Compilation {
    /// Most operations that are recorded, and the longest code.
    fn limits(self) -> [usize; 2] {
        match self {
            Self::Auto | Self::Beside => [MOST_RECORDED, LONGEST],
            Self::Always => [usize::MAX; 2],
            Self::Never => [0; 2],
        }
    }
}

/// The rates of a choice: evaluations before they are compiled, and the code.
#[derive(Debug)]
pub struct CompiledRates {
    rows: Vec<usize>,
    dependent: Vec<usize>,
    /// Whether the accelerations come from a recursion over clusters.
    packed: bool,
    evaluations: AtomicU64,
    code: OnceLock<Code>,
}

/// The code, and the tables that it reads: their intervals are its last inputs, what is looked up its last outputs.
#[derive(Debug)]
pub(crate) struct CompiledCode {
    pub(crate) code: Box<dyn Compiled>,
    pub(crate) lookups: Vec<Lookup>,
}

/// What became of a choice.
#[derive(Debug)]
enum Code {
    Compiled(CompiledCode),
    /// It cannot be recorded, or is too large.
    Without,
    /// This computer does not compile it.
    Refused(NotCompiled),
}

impl CompiledRates {
    /// The code; none where the levels are evaluated.
    pub(crate) fn code(&self) -> Option<&CompiledCode> {
        match self.code.get()? {
            Code::Compiled(code) => Some(code),
            Code::Without | Code::Refused(_) => None,
        }
    }

    /// Whether one more evaluation makes it worth while to [`make`](Self::make) the code now. A thread of its own is to do
    /// that once.
    pub(crate) fn is_due(&self, when: Compilation) -> bool {
        let before = || self.evaluations.fetch_add(1, Ordering::Relaxed);
        self.code.get().is_none()
            && match when {
                Compilation::Auto => before() >= WORTH_COMPILING,
                Compilation::Beside => before() == WORTH_COMPILING,
                Compilation::Always => true,
                Compilation::Never => false,
            }
    }

    /// Compile them, unless that is done.
    pub(crate) fn make(
        &self,
        compiler: &dyn Compiler,
        when: Compilation,
        recording: impl FnOnce(usize) -> Option<Recording>,
    ) {
        self.code.get_or_init(|| compile(compiler, when.limits(), recording));
    }

    /// Why there is no code, where this computer makes none, or none could be made although it was asked for.
    pub(crate) fn refusal(&self, when: Compilation) -> Option<String> {
        match self.code.get()? {
            Code::Refused(why) => Some(why.to_string()),
            Code::Without if when == Compilation::Always => Some(WITHOUT.into()),
            Code::Compiled(_) | Code::Without => None,
        }
    }
}

fn compile(compiler: &dyn Compiler, limits: [usize; 2], recording: impl FnOnce(usize) -> Option<Recording>) -> Code {
    let [most, longest] = limits;
    let Some(recording) = recording(most) else { return Code::Without };
    let lookups = recording.lookups().to_vec();
    match compiler.compile(recording, longest) {
        Ok(code) => code.map_or(Code::Without, |code| Code::Compiled(CompiledCode { code, lookups })),
        Err(why) => Code::Refused(why),
    }
}

/// The rates of the choices of a system, by the order in which C_D is eliminated.
#[derive(Clone, Debug, Default)]
pub struct CompiledChoices(Arc<Mutex<Vec<Arc<CompiledRates>>>>);

impl CompiledChoices {
    /// Those of a choice; none where there are too many.
    pub fn of(&self, choice: &Choice) -> Option<Arc<CompiledRates>> {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let is_that = |x: &&Arc<CompiledRates>| {
            x.rows == choice.rows && x.dependent == choice.dependent && x.packed == choice.packed
        };
        if let Some(known) = all.iter().find(is_that) {
            return Some(known.clone());
        }
        if all.len() >= MOST_CHOICES {
            return None;
        }
        let new = Arc::new(CompiledRates {
            rows: choice.rows.to_vec(),
            dependent: choice.dependent.to_vec(),
            packed: choice.packed,
            evaluations: AtomicU64::new(0),
            code: OnceLock::new(),
        });
        all.push(new.clone());
        Some(new)
    }
}
